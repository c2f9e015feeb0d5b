#include "snes/sneslatinimpl.h"

/*
   The energy of links that only pull or push is convex: an interior-point method goes down it from the drawing, where the iteration leaps away, which proves
   nothing, and where it creeps on after Newton's method has failed. Where it fails as well displacements stay, and it is not tried again. Collective on snes
*/
PetscErrorCode SNESLatinLargeConvex_Private(SNES snes, PetscBool *done)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  PetscBool            struts    = PETSC_FALSE;
  Vec                  u;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(LatinPathStruts_Private(structure, &struts));
  if (struts || structure->midpoint || !SNESLatinLargeProves(data) || data->large.inside_failed) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &u));
  PetscCall(VecCopy(snes->vec_sol, u));
  PetscCall(VecZeroEntries(snes->vec_sol));
  PetscCall(SNESLatinLargeInterior_Private(snes, NULL, done));
  if (!*done) PetscCall(VecCopy(u, snes->vec_sol));
  data->large.inside_failed = (PetscBool) !*done;
  PetscCall(DMRestoreGlobalVector(structure->dm, &u));
  PetscFunctionReturn(0);
}
