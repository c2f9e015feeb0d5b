#include "snes/sneslatinimpl.h"

/*
   Softest mode where no equilibrium follows: the displacements x of the least mu in K x = mu M x, with K = E + G+ - G- the tangent stiffness and M = E
   + G+ + G-. E: stiffness of the laws, G+: geometric stiffness of links in tension, G-: that of links in compression. mu is 1 for soft parts without
   compression, as guys, and 0 in buckling, for any stiffness. Computed by inverse iteration.
*/

#define LATIN_PATH_INVERSE 4 /* inverse iterations; 3: a tower names a node too many, 2: masts name guys */

/*
   Computes the softest mode at the equilibrium u. mode: on entry a force; on return zero if the tangent stiffness is not positive definite
   where slack links do not leave nodes free. Collective on snes
*/
PetscErrorCode LatinPathMode_Private(SNES snes, Vec u, Vec mode)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
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
  PetscCall(MatMult(K, force, pressed));
  PetscCall(LatinPathLoose_Private(structure, pressed, force));
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
