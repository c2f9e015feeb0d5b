#include "snes/sneslatinimpl.h"

/*
   Inextensible cables, |r| <= L, with large displacements: the method of multipliers (snes/multipliers.c) around whole solves. With a penalty p such a
   cable of strain x = |r| - L bears max(0, lambda + p x): it is a cable of stiffness p and natural length L - lambda / p. So local stage, operators and
   Newton's method are those of cables.

   1. Start: near the solution by the interior-point method if the problem is convex, else from the drawing.
   2. After a solve lambda becomes the tension of the cable. The next solve starts from the displacements of this one with the same operators. If
      tensions change too slowly, the penalty grows.
   3. End: displacements and tensions change by less than the requested error. Then lambda is the tension and |r| the length, whatever p.
*/

#define LATIN_LARGE_PENALTY_GROWS 10.0 /* factor by which the penalty grows */
#define LATIN_LARGE_PENALTY_SLOW  4.0  /* it grows unless the change of tensions falls by this factor; 2: a chain takes four times the stages, 10: nets fail */
#define LATIN_LARGE_PENALTY_MOST  1e2  /* largest penalty relative to the first; with more, its rounding hides soft links */
#define LATIN_LARGE_PENALTY_TIMES 40   /* most solves */
/*
   largest estimated error of the tensions relative to their last change; slower convergence is rounding. Without a limit, nets next to jams are refused
   (tests/test_large_laws.py)
*/
#define LATIN_LARGE_PENALTY_LEFT LatinByPrecision(1e2, 2.0)
#define LATIN_LARGE_PENALTY_NEAR 1e3 /* penalty near the solution, relative to the mean tension over length */

/*
   Makes the tensions at the solution vector the multipliers. *done: displacements since `before`, and tensions, have less than the requested error.
   That is their last change or, if larger, the sum of the next changes if these fall as the last two; after the first solve at least `first`.
   Overwrites before by the displacements. *change: relative change of the tensions. Collective on snes
*/
static PetscErrorCode LatinTautUpdate_Private(SNES snes, Vec before, PetscReal first, PetscReal *change, PetscBool *done)
{
  SNES_Latin          *data       = (SNES_Latin *)snes->data;
  const LatinStructure structure  = data->large.frame->original;
  const PetscReal      target     = SNESLatinEstimates(data) ? data->target : snes->stol;
  PetscReal           *multiplier = data->large.frame->spring + structure->links_local, *tension, last = *change, error, sum[2] = {0.0, 0.0}, moved, size;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinTurningTensions_Private(structure, NULL, snes->vec_sol, tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (!LatinLaws[structure->law[l]].rigid) continue;
    sum[0] += PetscSqr(tension[l] - multiplier[l]);
    sum[1] += PetscSqr(tension[l]);
    multiplier[l] = tension[l];
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)snes)));
  PetscCall(VecAXPY(before, -1.0, snes->vec_sol));
  PetscCall(VecNorm(before, NORM_2, &moved));
  PetscCall(VecNorm(snes->vec_sol, NORM_2, &size));
  PetscCall(VecCopy(snes->vec_sol, before));
  *change = PetscSqrtReal(LatinRatio(sum[0], sum[1]));
  error   = PetscMin(LATIN_LARGE_PENALTY_LEFT * *change, *change < last ? PetscSqr(*change) / (last - *change) : PETSC_MAX_REAL);
  error   = PetscMax(PetscMax(*change, error), last < PETSC_MAX_REAL ? 0.0 : first);
  moved *= *change > 0.0 ? error / *change : 1.0; /* displacements have the same relative rate */
  *done = (PetscBool)(moved <= PetscMax(target * size, PETSC_MACHINE_EPSILON * data->large.size) && error <= target);
  if (SNESLatinEstimates(data)) {
    data->estimate.value    = PetscMax(data->estimate.value, size > 0.0 ? moved / size : 0.0);
    data->estimate.tensions = PetscMax(data->estimate.tensions, error);
  }
  PetscCall(PetscInfo(snes, "Tensions of inextensible cables change by %g and miss %g of themselves, displacements miss %g\n", (double)*change, (double)error, (double)(size > 0.0 ? moved / size : 0.0)));
  PetscFunctionReturn(0);
}

/* Solves from displacements near the solution, by Newton's method, else by the iteration. Collective on snes */
static PetscErrorCode LatinTautFrom_Private(SNES snes, Vec u)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinLargeFrom_Private(snes, u, PETSC_TRUE, NULL));
  if (LatinNextConverged(((SNES_Latin *)snes->data)->next)) PetscFunctionReturn(0);
  PetscCall(SNESLatinLargeFrom_Private(snes, u, PETSC_FALSE, NULL));
  PetscFunctionReturn(0);
}

/* Solves again, with larger penalties if `grows`. Collective on snes */
static PetscErrorCode LatinTautNext_Private(SNES snes, Vec u, PetscBool grows)
{
  LatinLarge *large = &((SNES_Latin *)snes->data)->large;

  PetscFunctionBegin;
  if (grows) {
    for (PetscInt l = 0; l < large->frame->original->links_local; l++) large->frame->spring[l] *= LATIN_LARGE_PENALTY_GROWS;
    PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_PRESENT));
  } else {
    PetscCall(LatinFrameSprings_Private(large->frame, PETSC_FALSE));
    PetscCall(SNESLatinSetUpState_Private(snes));
  }
  PetscCall(LatinTautFrom_Private(snes, u));
  PetscFunctionReturn(0);
}

/* Returns in *convex whether the problem is convex, as no link that turns bears compression, and this solve starts afresh. Collective on snes */
static PetscErrorCode LatinTautConvex_Private(SNES snes, PetscBool *convex)
{
  const SNES_Latin *data   = (SNES_Latin *)snes->data;
  PetscBool         struts = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinPathStruts_Private(data->large.frame->original, &struts, NULL));
  *convex = (PetscBool)(!struts && SNESLatinLargeProves(data) && !SNESLatinWarm(data) && !SNESLatinUserTest(snes));
  PetscFunctionReturn(0);
}

/* Sets multipliers to these tensions near the solution, and the penalty to a multiple of their mean over length. Collective on snes */
static PetscErrorCode LatinTautNear_Private(SNES snes, const PetscReal tension[])
{
  const LatinLarge    *large = &((SNES_Latin *)snes->data)->large;
  const LatinStructure frame = large->frame, structure = frame->original;
  const PetscInt       dim    = structure->dim;
  PetscReal            sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal length = 0.0;

    for (PetscInt c = 0; c < dim; c++) length += PetscSqr(structure->span[dim * l + c]);
    sum[0] += PetscAbsReal(tension[l]);
    sum[1] += LatinStructureKeeps(structure, l) ? large->size : PetscSqrtReal(length) - structure->e0[l]; /* a contact has a gap, no length */
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    frame->spring[l]                          = LATIN_LARGE_PENALTY_NEAR * sum[0] / sum[1];
    frame->spring[structure->links_local + l] = tension[l];
  }
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscFunctionReturn(0);
}

/* Solves for the first time: from the state of the interior-point method, whose tensions have the error *first, or from the drawing. Collective on snes */
static PetscErrorCode LatinTautFirst_Private(SNES snes, Vec before, PetscReal *first)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->original;
  PetscReal     *tension;
  PetscBool      convex = PETSC_FALSE, near = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinTautConvex_Private(snes, &convex));
  PetscCall(VecCopy(snes->vec_sol, before));
  if (convex) {
    PetscCall(PetscMalloc1(structure->links_local, &tension));
    PetscCall(SNESLatinLargeInterior_Private(snes, tension, &near));
    if (near) *first = LATIN_LARGE_SAFETY * data->estimate.tensions;
    if (near) PetscCall(LatinTautNear_Private(snes, tension));
    PetscCall(PetscFree(tension));
  }
  structure->penalty    = data->large.frame->spring;
  structure->multiplier = data->large.frame->spring + structure->links_local;
  if (near) {
    PetscCall(VecCopy(snes->vec_sol, before));
    PetscCall(LatinTautFrom_Private(snes, before));
    data->large.path.reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
    PetscFunctionReturn(0);
  }
  PetscCall(VecCopy(before, snes->vec_sol));
  if (convex) PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_DRAWN));
  PetscCall(SNESLatinLargeRun_Private(snes));
  PetscFunctionReturn(0);
}

/* Solves from the state z, with the method of multipliers if there are inextensible cables. Collective on snes */
PetscErrorCode SNESLatinLargeRigid_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->original;
  PetscReal      grown = 1.0, change = PETSC_MAX_REAL, first = 0.0, last;
  PetscBool      done = PETSC_FALSE;
  Vec            before;

  PetscFunctionBegin;
  if (!data->large.frame->spring) {
    PetscCall(SNESLatinLargeRun_Private(snes));
    PetscFunctionReturn(0);
  }
  PetscCall(DMGetGlobalVector(structure->dm, &before));
  PetscCall(LatinTautFirst_Private(snes, before, &first));
  for (PetscInt k = 0; LatinNextConverged(data->next); k++) {
    PetscBool grows;

    last = change;
    PetscCall(SNESLatinResidual_Private(snes)); /* displacements, if the iteration has ended */
    PetscCall(LatinTautUpdate_Private(snes, before, first, &change, &done));
    if (done) break;
    /* tensions that grow without bound: no displacement satisfies the lengths */
    if (k == LATIN_LARGE_PENALTY_TIMES) data->next = SNESLatinLargeProves(data) ? LATIN_NEXT_DIVERGED : LATIN_NEXT_MAX_IT;
    if (k == LATIN_LARGE_PENALTY_TIMES) break;
    grows = (PetscBool)(k && change > last / LATIN_LARGE_PENALTY_SLOW && grown < LATIN_LARGE_PENALTY_MOST);
    if (grows) grown *= LATIN_LARGE_PENALTY_GROWS;
    PetscCall(LatinTautNext_Private(snes, before, grows));
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &before));
  structure->penalty = structure->multiplier = NULL;
  PetscCall(SNESLatinBalance_Private(snes));
  PetscFunctionReturn(0);
}
