#include "snes/largepath.h"

/*
   Whether a path leads from one equilibrium to another: the mean rate of each node's displacement over the increment must lie between the
   rates of the tangent stiffness at its start and at its end, or beside them by a part of their mean. This holds on smooth paths, and if a
   cable slackens on the way. Next to a limit point the rate at the end is useless; then the displacement may be twice that predicted at the
   start. Each node counts, with the direction of its motion: a small truss that snaps through hardly changes the norm of all displacements
   of a large net.

   Stiffening: where a structure is soft at the start and stiffens, the prediction at the start is so large that any snap would pass; and
   loads far beyond a limit point move a truss to a stiff state by as much as the drawing predicts. So no node may stiffen by more than a
   factor of two from the start of an increment to its mean, or from the mean to its end; else the increment becomes smaller. Small
   increments (LATIN_PATH_STIFFENS) are exempt, since a cable that tightens stiffens at once, and the force of a sagging net grows as the
   cube of its displacements. They are not exempt if no link tightens and the forces fall along the way: that is a snap within less than the
   least increment.

   Softening: a cable that slackens softens the structure at once. Displacements far smaller than those so far are therefore never too large
   (LATIN_PATH_KINK), and the end may be softer than the start by more than a factor of two, but only in small increments.
*/

#define LATIN_PATH_KINK   1e-2 /* displacements below this part of the largest one so far are not compared: a cable may slacken */
#define LATIN_PATH_HALVES 12   /* points tested on an increment, each half as far as the one before: finds snaps as short as 2^-11 of it */
/* largest ratio of the rates at the end and at the start of a small increment; beyond it the end may be a soft state after a snap */
#define LATIN_PATH_SOFT 8.0

/*
   Returns in *rises whether the forces of the links never fall along the straight way from u to v. If they fall, a truss has snapped
   through; it is seen up to some thousand times its height away. Overwrites w. Collective on structure
*/
static PetscErrorCode LatinPathRises_Private(LatinStructure structure, Vec u, Vec v, Vec w, PetscBool *rises)
{
  PetscScalar force, further = 0.0;
  PetscReal   noise = 0.0;
  Vec         r, way;

  PetscFunctionBegin;
  *rises = PETSC_TRUE;
  PetscCall(DMGetGlobalVector(structure->dm, &r));
  PetscCall(DMGetGlobalVector(structure->dm, &way));
  PetscCall(VecWAXPY(way, -1.0, u, v));
  for (PetscInt k = 0; k < LATIN_PATH_HALVES && *rises; k++) {
    PetscCall(VecWAXPY(w, PetscPowRealInt(0.5, k), way, u));
    PetscCall(LatinTurningResidual_Private(structure, NULL, w, r));
    PetscCall(VecDot(r, way, &force));
    if (k) *rises = (PetscBool)(PetscRealPart(force - further) <= noise);
    else noise = PETSC_SQRT_MACHINE_EPSILON * PetscAbsScalar(force);
    further = force;
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &way));
  PetscCall(DMRestoreGlobalVector(structure->dm, &r));
  PetscFunctionReturn(0);
}

/* Sets `ahead` to the prediction at the start of the increment; it and change are zero at nodes that slack links leave free at its start or end. Collective on structure */
static PetscErrorCode LatinPathTied_Private(LatinStructure structure, const LatinPath *path, const LatinPathTarget *target, Vec change, Vec ahead)
{
  const Vec rate[2] = {path->ahead, target->ahead};
  Vec       tied;

  PetscFunctionBegin;
  PetscCall(VecCopy(path->ahead, ahead));
  PetscCall(DMGetGlobalVector(structure->dm, &tied));
  for (PetscInt k = 0; k < 2; k++) {
    PetscCall(VecCopy(rate[k], tied));
    PetscCall(LatinPathLoose_Private(structure, tied, change));
    PetscCall(VecPointwiseMult(ahead, ahead, tied));
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &tied));
  PetscFunctionReturn(0);
}

/* Displacements of an increment and their predictions by the tangent stiffness, scaled to the whole path; zero at nodes that slack links leave free */
typedef struct {
  PetscReal part;   /* length of the increment, as a part of the path */
  PetscReal little; /* displacements below this are not compared */
  PetscReal moved;  /* l2 norm of mean */
  Vec       mean;   /* mean rate over the increment */
  Vec       start;  /* rate at its start */
} LatinPathRates;

/* Computes the rates of the increment from path->u to the target. Collective on snes */
static PetscErrorCode LatinPathRatesCreate_Private(SNES snes, const LatinPath *path, const LatinPathTarget *target, LatinPathRates *rates)
{
  const LatinLarge    *large     = &((SNES_Latin *)snes->data)->large;
  const LatinStructure structure = large->frame->original;
  PetscReal            before, step;

  PetscFunctionBegin;
  rates->part = target->part - large->path.reached;
  PetscCall(DMGetGlobalVector(structure->dm, &rates->mean));
  PetscCall(VecWAXPY(rates->mean, -1.0, path->u, target->u));
  PetscCall(VecNorm(rates->mean, NORM_INFINITY, &step));
  PetscCall(VecScale(rates->mean, 1.0 / rates->part));
  PetscCall(DMGetGlobalVector(structure->dm, &rates->start));
  PetscCall(LatinPathTied_Private(structure, path, target, rates->mean, rates->start));
  PetscCall(VecNorm(rates->mean, NORM_2, &rates->moved));
  PetscCall(VecNorm(path->u, NORM_INFINITY, &before));
  rates->little = PetscMax(LATIN_PATH_KINK * PetscMax(before, step), LATIN_LARGE_NONE * large->size) / rates->part;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPathRatesDestroy_Private(LatinStructure structure, LatinPathRates *rates)
{
  PetscFunctionBegin;
  PetscCall(DMRestoreGlobalVector(structure->dm, &rates->start));
  PetscCall(DMRestoreGlobalVector(structure->dm, &rates->mean));
  PetscFunctionReturn(0);
}

/* Returns in *follows whether the mean rate of each node lies between the rates of the tangent stiffness, or near them. Collective on structure */
static PetscErrorCode LatinPathFollows_Private(LatinStructure structure, const LatinPath *path, const LatinPathTarget *target, const LatinPathRates *rates, PetscBool *follows)
{
  const PetscBool small  = (PetscBool)(rates->part <= LATIN_PATH_STIFFENS);
  const PetscBool useful = (PetscBool)(target->far <= (small ? LATIN_PATH_SOFT : LATIN_PATH_FAR) * path->far); /* next to a limit point the rate at the end is not */

  PetscFunctionBegin;
  PetscCall(LatinPathBetween_Private(structure, rates->mean, rates->start, useful ? target->ahead : NULL, rates->little, follows));
  /* path->u is at a kink of a law: only the rate at the end counts */
  if (!*follows && small) PetscCall(LatinPathBetween_Private(structure, rates->mean, target->ahead, target->ahead, rates->little, follows));
  PetscFunctionReturn(0);
}

/*
   Returns in *stiffens whether any node stiffens by more than an increment of this size allows (Stiffening, in the comment of the file). Overwrites
   rates->mean. Collective on snes
*/
static PetscErrorCode LatinPathStiffens_Private(SNES snes, const LatinPath *path, const LatinPathTarget *target, const LatinPathRates *rates, PetscBool *stiffens)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  PetscBool            allowed;

  PetscFunctionBegin;
  PetscCall(LatinPathNodes_Private(structure, rates->start, rates->mean, NULL, rates->little, &allowed));
  if (allowed) PetscCall(LatinPathNodes_Private(structure, rates->mean, target->ahead, NULL, rates->little, &allowed));
  if (!allowed && rates->part <= LATIN_PATH_STIFFENS) {
    PetscCall(LatinPathTightens_Private(snes, path->u, target->u, &allowed));
    if (!allowed) PetscCall(LatinPathRises_Private(structure, path->u, target->u, rates->mean, &allowed));
  }
  *stiffens = (PetscBool)!allowed;
  PetscFunctionReturn(0);
}

/*
   Compares the increment from path->u to the target with the tangent stiffness at both ends. *smaller: 1 if the
   increment is accepted, else the factor for the next one. Sets target->other. Collective on snes
*/
PetscErrorCode LatinPathCompare_Private(SNES snes, const LatinPath *path, LatinPathTarget *target, PetscReal *smaller)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  PetscBool            follows, stiffens = PETSC_FALSE;
  LatinPathRates       rates;

  PetscFunctionBegin;
  PetscCall(LatinPathRatesCreate_Private(snes, path, target, &rates));
  PetscCall(LatinPathFollows_Private(structure, path, target, &rates, &follows));
  if (follows) PetscCall(LatinPathStiffens_Private(snes, path, target, &rates, &stiffens));
  target->other = (PetscBool)(!follows && rates.moved > LATIN_PATH_FAR * PetscMax(path->far, target->far));
  if (stiffens) *smaller = PetscMin(0.5, PetscMax(rates.moved / path->far, LATIN_PATH_STIFFENS / rates.part)); /* not below the size from which on stiffening is allowed */
  else *smaller = follows ? 1.0 : 0.5;
  PetscCall(PetscInfo(snes, "%g of the path: displacements change by %g, the tangent stiffness says %g, %g%s\n", (double)target->part, (double)(rates.part * rates.moved), (double)(rates.part * path->far), (double)(rates.part * target->far),
                      follows && !stiffens ? "" : ", of some nodes more or less than that"));
  PetscCall(LatinPathRatesDestroy_Private(structure, &rates));
  PetscFunctionReturn(0);
}
