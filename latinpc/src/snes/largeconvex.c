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
  PetscBool            done      = PETSC_FALSE;
  PetscReal            size, prescribed, most;
  Vec                  away;

  PetscFunctionBegin;
  if ((data->next != LATIN_NEXT_DIVERGED && data->next != LATIN_NEXT_NOT_FINITE) || structure->midpoint || !SNESLatinEstimates(data) || data->newton.type == LATIN_NEWTON_NEVER) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &away));
  PetscCall(VecCopy(snes->vec_sol, away));
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  PetscCall(VecZeroEntries(snes->vec_sol));
  PetscCall(VecAXPY(snes->vec_sol, 1.0, structure->load));
  if (snes->vec_rhs) PetscCall(VecAXPY(snes->vec_sol, 1.0, snes->vec_rhs));
  PetscCall(VecNorm(snes->vec_sol, NORM_INFINITY, &most));
  if (most > 0.0) PetscCall(VecScale(snes->vec_sol, LATIN_LARGE_CARRIED * size / most));
  PetscCall(SNESLatinLargeInterior_Private(snes, NULL, &done));
  if (!done) data->next = LATIN_NEXT_DIVERGED;
  if (!done) PetscCall(VecCopy(away, snes->vec_sol));
  PetscCall(DMRestoreGlobalVector(structure->dm, &away));
  PetscFunctionReturn(0);
}
