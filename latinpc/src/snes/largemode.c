#include "snes/sneslatinimpl.h"

/*
   How a structure moves where no equilibrium follows: the displacements x of the least mu in K x = mu M x, K = E + G+ - G- the tangent stiffness: E of the laws, G+ of links
   that pull, G- of links in compression, and M = E + G+ + G-. mu is 1 of soft parts that nothing presses, as guys are, and 0 of what buckles, whatever the
   stiffness of either.
*/

#define LATIN_PATH_INVERSE 4 /* solves: with 3 a tower has a node too many, with 2 masts have guys */

/* Forces that differ from node to node: any mode has a part of them */
PetscErrorCode LatinPathForces_Private(Vec r)
{
  PetscInt     first, last;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetOwnershipRange(r, &first, &last));
  PetscCall(VecGetArrayWrite(r, &a));
  for (PetscInt i = first; i < last; i++) a[i - first] = PetscSinReal((PetscReal)(i + 1));
  PetscCall(VecRestoreArrayWrite(r, &a));
  PetscFunctionReturn(0);
}

/* The mode at the equilibrium u; `mode` is a force at first, and zero in the end where the tangent stiffness is not positive definite. Collective on snes */
PetscErrorCode LatinPathMode_Private(SNES snes, Vec u, Vec mode)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  PetscReal            moved     = 0.0;
  Vec                  force, pressed;
  Mat                  K;
  KSP                  ksp;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(KSPGetOperators(ksp, &K, NULL));
  PetscCall(DMGetGlobalVector(structure->dm, &force));
  PetscCall(DMGetGlobalVector(structure->dm, &pressed));
  PetscCall(VecCopy(mode, force));
  for (PetscInt k = 0; k < LATIN_PATH_INVERSE && moved < PETSC_MAX_REAL; k++) {
    PetscCall(VecNormalize(force, NULL));
    PetscCall(SNESLatinLargePredict_Private(snes, u, force, mode, &moved));
    PetscCall(MatMult(K, mode, force));
    PetscCall(LatinTurningPressed_Private(structure, u, mode, pressed));
    PetscCall(VecAXPY(force, 2.0, pressed));
  }
  if (moved == PETSC_MAX_REAL) PetscCall(VecZeroEntries(mode));
  PetscCall(DMRestoreGlobalVector(structure->dm, &pressed));
  PetscCall(DMRestoreGlobalVector(structure->dm, &force));
  PetscFunctionReturn(0);
}
