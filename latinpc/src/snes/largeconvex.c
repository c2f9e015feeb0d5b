#include "snes/sneslatinimpl.h"

#define LATIN_LARGE_CARRIED 4.0 /* times the size of the structure: displacements along the loads from which cables are taut */

/*
   Where the iteration over links that only pull or push leaps away it proves nothing: their energy is convex. An interior-point method goes down it,
   from where loads may carry their nodes: there links are taut, and no node has to pass its support. Collective on snes
*/
PetscErrorCode SNESLatinLargeConvex_Private(SNES snes)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  PetscBool            done      = PETSC_FALSE, far;
  PetscReal            size, prescribed, most;
  Vec                  away;

  PetscFunctionBegin;
  PetscCall(LatinEquilibriumFar_Private(structure, snes->vec_sol, &far));
  if (data->next != LATIN_NEXT_DIVERGED && !(far && data->next == LATIN_NEXT_ROUNDING)) PetscFunctionReturn(0);
  if (structure->midpoint || !SNESLatinEstimates(data) || data->newton.type == LATIN_NEWTON_NEVER) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &away));
  PetscCall(VecCopy(snes->vec_sol, away));
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  PetscCall(VecZeroEntries(snes->vec_sol));
  PetscCall(SNESComputeFunction(snes, snes->vec_sol, snes->vec_func));
  PetscCall(VecNorm(snes->vec_func, NORM_INFINITY, &most));
  if (most > 0.0) PetscCall(VecAXPY(snes->vec_sol, -LATIN_LARGE_CARRIED * size / most, snes->vec_func));
  PetscCall(SNESLatinLargeInterior_Private(snes, NULL, &done));
  if (!done) data->next = LATIN_NEXT_DIVERGED;
  if (!done) PetscCall(VecCopy(away, snes->vec_sol));
  PetscCall(DMRestoreGlobalVector(structure->dm, &away));
  PetscFunctionReturn(0);
}
