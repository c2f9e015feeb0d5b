#include "snes/sneslatinimpl.h"
#include <petsc/private/tsimpl.h>

/* A step whose SNES has not converged: text of errors and reports, with the cause, as far as it is known, and a cure; shorter steps in its place. */

#define LATIN_CONTRAST 1e3 /* least ratio of masses that the message names */

/* Writes the first `listed` of `count` numbers, with commas. room: length of text. Not collective */
static PetscErrorCode LatinListed_Private(PetscInt listed, PetscInt count, const PetscInt number[], size_t room, char text[])
{
  size_t used = 0;

  PetscFunctionBegin;
  text[0] = 0;
  for (PetscInt i = 0; i < listed; i++) {
    PetscCall(PetscSNPrintf(text + used, room - used, "%s%" PetscInt_FMT, i ? ", " : "", number[i]));
    PetscCall(PetscStrlen(text, &used));
  }
  if (count > listed) PetscCall(PetscStrlcat(text, " and others", room));
  PetscFunctionReturn(0);
}

/* Finds heavy: whether a listed node has a mass; contrast: largest mass over least positive one. Collective on base */
static PetscErrorCode LatinMasses_Private(LatinStructure base, PetscInt listed, const PetscInt node[], PetscBool *heavy, PetscReal *contrast)
{
  PetscReal most[3] = {-PETSC_MAX_REAL, 0.0, 0.0}; /* minus the least mass, largest mass, 1: a listed node has one */

  PetscFunctionBegin;
  for (PetscInt i = 0; i < base->nodes_local; i++) {
    if (base->mass[i] <= 0.0) continue;
    most[0] = PetscMax(most[0], -base->mass[i]);
    most[1] = PetscMax(most[1], base->mass[i]);
    for (PetscInt j = 0; j < listed; j++)
      if (node[j] == base->nodes_start + i) most[2] = 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 3, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)base)));
  *heavy    = (PetscBool)(most[2] > 0.0);
  *contrast = most[1] / -most[0];
  PetscFunctionReturn(0);
}

/* Finds whether supports move in the step. Collective on step */
static PetscErrorCode LatinSupportsMove_Private(LatinStructure step, PetscBool *move)
{
  PetscBool here = PETSC_FALSE;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < step->dim * step->nodes_local; i++) here = (PetscBool)(here || step->prescribed[i] != 0.0);
  PetscCall(MPIU_Allreduce(&here, move, 1, LATIN_MPI_BOOL, MPI_LOR, PetscObjectComm((PetscObject)step)));
  PetscFunctionReturn(0);
}

/* Appends to cause why a step may have failed if no links or nodes are known, and what to change. room: length of cause. Collective on ts */
static PetscErrorCode LatinUnknownCause_Private(TS ts, LatinStructure step, SNES snes, PetscReal contrast, size_t room, char cause[])
{
  const PetscBool inner = (PetscBool)(snes->reason == SNES_DIVERGED_INNER), limit = (PetscBool)(snes->reason == SNES_DIVERGED_MAX_IT);
  PetscReal       floor = 0.0;
  PetscBool       latin, stuck, move; /* stuck: before the last of the iterations; move: supports */
  char            some[160];

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &latin));
  if (latin) PetscCall(SNESLatinGetEstimates(snes, NULL, NULL, NULL, &floor));
  stuck = (PetscBool)(latin && limit && snes->iter < snes->max_its);
  if (latin && step->has_friction && (inner || stuck)) {
    PetscCall(LatinSupportsMove_Private(step, &move));
    PetscCall(PetscStrlcat(cause,
                           move ? "Contacts with friction: the step may have no solution, as where supports that move wedge nodes between contacts. Move them another way, or reduce the friction. "
                                : "Contacts with friction: how they stick and slip has not been found to this error. Take a larger one, -snes_latin_error 1e-2, or reduce the friction. ",
                           room));
  } else if (inner && floor > 0.0) {
    PetscCall(PetscSNPrintf(some, sizeof(some), "The requested error is below the rounding error of this step, about %.0e: take a larger one, -snes_latin_error. ", (double)floor));
    PetscCall(PetscStrlcat(cause, some, room));
  }
  if (limit) PetscCall(PetscStrlcat(cause, stuck ? "The iteration stalled, and a larger -snes_max_it changes nothing. " : "The iterations that -snes_max_it allows were not enough. ", room));
  if (limit && contrast > LATIN_CONTRAST) {
    PetscCall(PetscSNPrintf(some, sizeof(some), "Masses differ by a factor of %.0e: light nodes between heavy ones converge slowly. ", (double)contrast));
    PetscCall(PetscStrlcat(cause, some, room));
  }
  /* a function that sets loads before a step is not told that the step has become shorter */
  PetscCall(PetscStrlcat(cause, ts->prestep ? "Take shorter steps" : "Take shorter steps, or -ts_max_snes_failures -1, which shortens those that fail", room));
  PetscFunctionReturn(0);
}

/*@C
  TSLatinGetCause - Gets why the last step of a TS has not converged, as far as it is known, and what to change.

  Collective on ts

  Input Parameters:
+ ts   - of any type, to which a structure is attached
- room - length of cause; 600 characters are enough

  Output Parameter:
. cause - sentences, without the number of the step and the converged reason of its SNES; empty if the step has converged

  Level: intermediate

.seealso: `TSLATIN`, `TSSetErrorIfStepFails()`, `SNESLatinGetUnsupportedNodes()`, `SNESLatinGetJammedLinks()`
@*/
PetscErrorCode TSLatinGetCause(TS ts, size_t room, char cause[])
{
  char            names[256];
  PetscInt        jammed = 0, loose = 0, links = 0, nodes = 0;
  const PetscInt *link = NULL, *node = NULL;
  PetscReal       contrast = 1.0;
  PetscBool       latin, heavy = PETSC_FALSE;
  SNES            snes;
  LatinStructure  step;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(ts, TS_CLASSID, 1);
  PetscCall(PetscObjectQuery((PetscObject)ts, "LatinStructure", (PetscObject *)&step));
  PetscCheck(step, PetscObjectComm((PetscObject)ts), PETSC_ERR_ORDER, "This TS has no structure: attach one with LatinStructureAttachTS()");
  PetscCall(TSGetSNES(ts, &snes));
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &latin));
  if (latin) {
    PetscCall(SNESLatinGetJammedLinks(snes, &jammed, &links, &link));
    PetscCall(SNESLatinGetUnsupportedNodes(snes, &loose, &nodes, &node, NULL));
  }
  PetscCall(LatinMasses_Private(step->base, nodes, node, &heavy, &contrast));
  cause[0] = 0;
  if (snes->reason > 0) PetscFunctionReturn(0);
  if (jammed) {
    PetscCall(LatinListed_Private(links, jammed, link, sizeof(names), names));
    PetscCall(PetscSNPrintf(cause, room, "The gaps of the rigid link%s %s are incompatible: look at the supports that move", jammed > 1 ? "s" : "", names));
  } else if (loose && !heavy) {
    PetscCall(LatinListed_Private(nodes, loose, node, sizeof(names), names));
    PetscCall(PetscSNPrintf(cause, room, "Links do not hold node%s %s against the loads, and %s one", loose > 1 ? "s" : "", names, loose > 1 ? "they have no mass: give them" : "it has no mass: give it"));
  } else {
    PetscCall(LatinUnknownCause_Private(ts, step, snes, contrast, room, cause));
  }
  PetscFunctionReturn(0);
}

/* Returns the length of the next step: shorter ones up to the end of one that has failed, then its own again. next: of the adaptor */
PetscReal LatinStepNext(TS ts, PetscReal next)
{
  TS_Latin       *data = (TS_Latin *)ts->data;
  const PetscReal left = data->end - ts->ptime;

  if (!(data->whole > 0.0)) return next;
  if (left > PETSC_SQRT_MACHINE_EPSILON * data->whole) return PetscMin(next, left);
  next        = ts->exact_final_time == TS_EXACTFINALTIME_MATCHSTEP ? PetscMin(data->whole, ts->max_time - ts->ptime) : data->whole;
  data->whole = 0.0;
  return next;
}
