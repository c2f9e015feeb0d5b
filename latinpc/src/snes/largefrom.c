#include "snes/sneslatinimpl.h"

/* Solves of large displacements from given displacements: on a path, in a time step, and for the stop of the user after a path. */

#define LATIN_PATH_STAGES 60 /* most linear stages of a solve on a path without Newton's method; next to a limit point it would take any number */

/* Sets the displacements u as start of a solve. Collective on snes */
static PetscErrorCode LatinPathPlace_Private(SNES snes, Vec u)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESLatinLoad_Private(snes));
  PetscCall(VecCopy(u, snes->vec_sol));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateStart_Private(data->latin, &data->estimate));
  data->next            = LATIN_NEXT_LINE_SEARCH;
  data->guess           = PETSC_TRUE;
  data->has_state       = PETSC_FALSE;
  data->first_distance  = -1.0;
  data->current         = -1;
  data->large.stateless = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Runs Newton's method from the displacements u, if the stop needs its proof. *done: converged, u was near an equilibrium. Collective on snes */
PetscErrorCode SNESLatinLargeProof_Private(SNES snes, Vec u, PetscBool *done)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(LatinPathPlace_Private(snes, u));
  if (!SNESLatinLargeProves(data)) PetscFunctionReturn(0);
  PetscCall(SNESLatinLargeFinish_Private(snes, PETSC_TRUE, PETSC_FALSE, done));
  PetscFunctionReturn(0);
}

/*
   Solves from the displacements u. near: u is near an equilibrium. Then Newton's method takes a few steps; if it fails, the interior-point method
   follows, since on a path a smaller increment is better than the iteration, whose local stage lets bars in compression buckle one by one. *inside, or
   NULL: the interior-point method was used; else unchanged. Collective on snes
*/
PetscErrorCode SNESLatinLargeFrom_Private(SNES snes, Vec u, PetscBool near, PetscBool *inside)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   done = PETSC_FALSE;

  PetscFunctionBegin;
  if (near) PetscCall(SNESLatinLargeProof_Private(snes, u, &done));
  else PetscCall(LatinPathPlace_Private(snes, u));
  if (done) PetscFunctionReturn(0);
  if (near && SNESLatinLargeProves(data)) {
    if (inside) *inside = PETSC_TRUE;
    PetscCall(SNESLatinLargeInterior_Private(snes, NULL, &done));
    PetscFunctionReturn(0);
  }
  data->large.last = near ? data->latin->linear.applications + LATIN_PATH_STAGES : PETSC_MAX_INT;
  PetscCall(SNESLatinLargeIterate_Private(snes));
  if (LatinNextSolved(data->next)) PetscCall(SNESLatinResidual_Private(snes));
  PetscFunctionReturn(0);
}

/*
   Detects nodes without mass that diverge because their links slacken during the time step: the mean forces balance at infinity only. Lists them; the
   step has then failed. Collective on snes
*/
static PetscErrorCode LatinLargeLost_Private(SNES snes)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->original;
  const PetscScalar   *ground;
  PetscScalar         *u;
  PetscReal            most, all;
  PetscInt             n;
  Vec                  light;

  PetscFunctionBegin;
  PetscCall(VecNorm(snes->vec_sol, NORM_INFINITY, &all));
  if (all <= LATIN_LARGE_NOWHERE * data->large.size) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &light));
  PetscCall(VecCopy(snes->vec_sol, light));
  PetscCall(VecGetLocalSize(light, &n));
  PetscCall(VecGetArrayRead(structure->ground, &ground));
  PetscCall(VecGetArray(light, &u));
  for (PetscInt i = 0; i < n; i++)
    if (PetscRealPart(ground[i]) > 0.0) u[i] = 0.0;
  PetscCall(VecRestoreArray(light, &u));
  PetscCall(VecRestoreArrayRead(structure->ground, &ground));
  PetscCall(VecNorm(light, NORM_INFINITY, &most));
  PetscCall(VecAXPY(light, -1.0, snes->vec_sol));
  PetscCall(VecNorm(light, NORM_INFINITY, &all));
  if (most > LATIN_LARGE_NOWHERE * (data->large.size + all)) {
    PetscCall(VecAXPY(light, 1.0, snes->vec_sol));
    PetscCall(LatinEquilibriumMoved_Private(structure, light, &data->found));
    data->next = LATIN_NEXT_DIVERGED;
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &light));
  PetscFunctionReturn(0);
}

/* Solves a time step by Newton's method, or if it fails by the iteration. Collective on snes */
PetscErrorCode SNESLatinLargeStep_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   done;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeFinish_Private(snes, PETSC_TRUE, PETSC_FALSE, &done));
  if (!done) PetscCall(SNESLatinLargeIterate_Private(snes));
  if (LatinNextConverged(data->next)) PetscCall(LatinLargeLost_Private(snes));
  data->large.path.reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
  PetscFunctionReturn(0);
}

/*
   Continues from the end of a path, which was solved for the stop `error`, to the accuracy of the requested stop, by Newton's method: the iteration
   would lead to equilibria that need not be stable. Collective on snes
*/
PetscErrorCode SNESLatinLargeStop_Private(SNES snes, LatinStopType stop)
{
  SNES_Latin     *data   = (SNES_Latin *)snes->data;
  const PetscReal target = data->target, unbalance = data->unbalance;
  PetscBool       done;
  Vec             u;

  PetscFunctionBegin;
  if (data->stop == stop || !LatinNextConverged(data->next)) PetscFunctionReturn(0);
  if (stop == LATIN_STOP_RESIDUAL) data->unbalance = SNESLatinResidualTarget(snes);
  else data->target = PetscMin(target, snes->stol);
  PetscCall(VecDuplicate(snes->vec_sol, &u));
  PetscCall(VecCopy(snes->vec_sol, u));
  PetscCall(SNESLatinLargeProof_Private(snes, u, &done));
  if (!done) PetscCall(VecCopy(u, snes->vec_sol));
  PetscCall(VecDestroy(&u));
  PetscCall(SNESLatinBalance_Private(snes));
  data->stop      = stop;
  data->target    = target;
  data->unbalance = unbalance;
  if (stop != LATIN_STOP_RESIDUAL) data->next = LATIN_NEXT_CONVERGED; /* as far as rounding allows */
  else data->next = data->residual <= SNESLatinResidualTarget(snes) ? LATIN_NEXT_CONVERGED_FNORM : LATIN_NEXT_ROUNDING;
  PetscFunctionReturn(0);
}
