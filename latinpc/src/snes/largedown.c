#include "snes/sneslatinimpl.h"

/*
   Solves by the interior-point method from the drawing if the iteration fails: links that only pull or push have a convex energy.

   leapt: the iteration has diverged, which proves nothing. Else it creeps on after Newton's method has failed; then only above floors are solves sent
   here. Cables alone arrive by the iteration, a net of 200 meshes in the wind in a third of the time.

   If the method fails, the displacements stay, and it is not tried again in this solve. Collective on snes
*/
PetscErrorCode SNESLatinLargeConvex_Private(SNES snes, PetscBool leapt, PetscBool *done)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->original;
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
