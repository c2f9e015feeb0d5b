#include "snes/sneslatinimpl.h"

/*
   Inextensible cables whose nodes move far, |r| <= L: the method of multipliers (snes/multipliers.c) around whole solves. With a penalty p
   such a cable of strain x = |r| - L bears max(0, lambda + p x): it is a cable of stiffness p whose natural length is L - lambda / p, so that
   the local stage, the operators and Newton's method are those of cables. What it then bears is its next lambda; operators stay, and the next solve
   starts from the displacements of this one. At the solution lambda is its tension and |r| its length, whatever p.
*/

#define LATIN_LARGE_PENALTY_GROWS 10.0                       /* the penalty grows by so much */
#define LATIN_LARGE_PENALTY_SLOW  4.0                        /* where tensions change by more than that part of what they did before: with 2 a chain of 20 takes four times the stages, with 10 a flat net fails */
#define LATIN_LARGE_PENALTY_MOST  1e2                        /* times the first penalty: more, and rounding of the penalty hides soft links */
#define LATIN_LARGE_PENALTY_TIMES 40                         /* most solves */
#define LATIN_LARGE_PENALTY_LEFT  LatinByPrecision(1e2, 2.0) /* times the last change of tensions: what it may leave; changes that fall more slowly are rounding, by which, without this, nets next to jams are refused (tests/test_large_laws.py) */
#define LATIN_LARGE_PENALTY_NEAR  1e3                        /* times the mean tension over length: the penalty from near the solution on */

/*
   The tensions at the solution vector become the multipliers. *done: the displacements, since `before`, have changed by no more than
   the error asked for, and the tensions miss no more: their change, what is left if they go on changing as since the last one, and before
   there was one `first`. Collective on snes
*/
static PetscErrorCode LatinTautUpdate_Private(SNES snes, Vec before, PetscReal first, PetscReal *change, PetscBool *done)
{
  SNES_Latin          *data       = (SNES_Latin *)snes->data;
  const LatinStructure structure  = data->large.frame->turns;
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
  moved *= *change > 0.0 ? error / *change : 1.0; /* displacements follow */
  *done = (PetscBool)(moved <= PetscMax(target * size, PETSC_MACHINE_EPSILON * data->large.size) && error <= target);
  if (SNESLatinEstimates(data)) {
    data->estimate.value    = PetscMax(data->estimate.value, size > 0.0 ? moved / size : 0.0);
    data->estimate.tensions = PetscMax(data->estimate.tensions, error);
  }
  PetscCall(PetscInfo(snes, "Tensions of inextensible cables change by %g and miss %g of themselves, displacements miss %g\n", (double)*change, (double)error, (double)(size > 0.0 ? moved / size : 0.0)));
  PetscFunctionReturn(0);
}

/* A solve from displacements near its solution: Newton's method, or the iteration. Collective on snes */
static PetscErrorCode LatinTautFrom_Private(SNES snes, Vec u)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinLargeFrom_Private(snes, u, PETSC_TRUE, NULL));
  if (LatinNextConverged(((SNES_Latin *)snes->data)->next)) PetscFunctionReturn(0);
  PetscCall(SNESLatinLargeFrom_Private(snes, u, PETSC_FALSE, NULL));
  PetscFunctionReturn(0);
}

/* The next solve, with larger penalties if tensions change slowly. Collective on snes */
static PetscErrorCode LatinTautNext_Private(SNES snes, Vec u, PetscBool grows)
{
  LatinLarge *large = &((SNES_Latin *)snes->data)->large;

  PetscFunctionBegin;
  if (grows) {
    for (PetscInt l = 0; l < large->frame->turns->links_local; l++) large->frame->spring[l] *= LATIN_LARGE_PENALTY_GROWS;
    PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_PRESENT));
  } else {
    PetscCall(LatinFrameSprings_Private(large->frame, PETSC_FALSE));
    PetscCall(SNESLatinSetUpState_Private(snes));
  }
  PetscCall(LatinTautFrom_Private(snes, u));
  PetscFunctionReturn(0);
}

/* Is the problem convex, as no link that turns bears compression, and does this solve start afresh? Collective on snes */
static PetscErrorCode LatinTautConvex_Private(SNES snes, PetscBool *convex)
{
  const SNES_Latin *data   = (SNES_Latin *)snes->data;
  PetscBool         struts = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinPathStruts_Private(data->large.frame->turns, &struts, NULL));
  *convex = (PetscBool)(!struts && SNESLatinLargeProves(data) && !SNESLatinWarm(data) && !SNESLatinUserTest(snes));
  PetscFunctionReturn(0);
}

/* Near the solution, tensions become multipliers, and a multiple of their mean over length the penalty. Collective on snes */
static PetscErrorCode LatinTautNear_Private(SNES snes, const PetscReal tension[])
{
  const LatinLarge    *large = &((SNES_Latin *)snes->data)->large;
  const LatinStructure frame = large->frame, structure = frame->turns;
  const PetscInt       dim    = structure->dim;
  PetscReal            sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal length = 0.0;

    for (PetscInt c = 0; c < dim; c++) length += PetscSqr(structure->span[dim * l + c]);
    sum[0] += PetscAbsReal(tension[l]);
    sum[1] += LatinStructureKeeps(structure, l) ? large->size : PetscSqrtReal(length) - structure->e0[l]; /* a contact has a gap, and no length */
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    frame->spring[l]                          = LATIN_LARGE_PENALTY_NEAR * sum[0] / sum[1];
    frame->spring[structure->links_local + l] = tension[l];
  }
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscFunctionReturn(0);
}

/* The first solve: from what an interior-point method finds, whose tensions have the error *first, or from the drawn configuration. Collective on snes */
static PetscErrorCode LatinTautFirst_Private(SNES snes, Vec before, PetscReal *first)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->turns;
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
    data->large.reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
    PetscFunctionReturn(0);
  }
  PetscCall(VecCopy(before, snes->vec_sol));
  if (convex) PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_DRAWN));
  PetscCall(SNESLatinLargeRun_Private(snes));
  PetscFunctionReturn(0);
}

/* A solve, from the state z on. Collective on snes */
PetscErrorCode SNESLatinLargeRigid_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->turns;
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
    PetscCall(SNESLatinResidual_Private(snes)); /* the displacements of the iteration */
    PetscCall(LatinTautUpdate_Private(snes, before, first, &change, &done));
    if (done) break;
    if (k == LATIN_LARGE_PENALTY_TIMES) data->next = SNESLatinLargeProves(data) ? LATIN_NEXT_DIVERGED : LATIN_NEXT_MAX_IT; /* tensions of accurate solves grow without end: no displacement meets the lengths */
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
