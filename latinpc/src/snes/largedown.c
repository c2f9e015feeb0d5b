#include "snes/sneslatinimpl.h"

/*
   The energy of links that only pull or push is convex: an interior-point method goes down it from the drawing, where the iteration has leapt away, which
   proves nothing, and where it creeps on above floors after Newton's method has failed. Not where cables alone creep on: they arrive, and in the wind a net
   of 200 meshes takes a third of the time. Where it fails as well displacements stay, and it is not tried again. Collective on snes
*/
PetscErrorCode SNESLatinLargeConvex_Private(SNES snes, PetscBool leapt, PetscBool *done)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  PetscBool            struts = PETSC_FALSE, floors = PETSC_FALSE;
  Vec                  u;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(LatinPathStruts_Private(structure, &struts, &floors));
  if (struts || !(leapt || floors) || structure->midpoint || !SNESLatinLargeProves(data) || data->large.inside_failed) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &u));
  PetscCall(VecCopy(snes->vec_sol, u));
  PetscCall(VecZeroEntries(snes->vec_sol));
  PetscCall(SNESLatinLargeInterior_Private(snes, NULL, done));
  if (!*done) data->next = LATIN_NEXT_DIVERGED;
  if (!*done) PetscCall(VecCopy(u, snes->vec_sol));
  data->large.inside_failed = (PetscBool) !*done;
  PetscCall(DMRestoreGlobalVector(structure->dm, &u));
  PetscFunctionReturn(0);
}
