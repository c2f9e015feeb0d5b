#include "snes/sneslatinimpl.h"

/* Displacements that the tangent stiffness predicts: where a path goes, whether a state is stable, how far Newton's method would go. */

#define LATIN_LARGE_FIRM 10.0 /* times LATIN_MECHANISM and the largest stiffness: the least stiffness that is not rounding */

/* Sets tied: 0 at nodes that the tangent stiffness of ksp leaves free, else 1. Collective on snes */
static PetscErrorCode LatinLargeTied_Private(SNES snes, KSP ksp, Vec tied)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  Vec                  any;
  Mat                  K;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &any));
  PetscCall(KSPGetOperators(ksp, &K, NULL));
  PetscCall(LatinPathForces_Private(any));
  PetscCall(MatMult(K, any, tied));
  PetscCall(LatinPathLoose_Private(structure, tied, any));
  PetscCall(DMRestoreGlobalVector(structure->dm, &any));
  PetscFunctionReturn(0);
}

/*
   Computes the displacements `step` under a load by the tangent stiffness at u, and their l2 norm: PETSC_MAX_REAL if that is not positive
   definite, or a mechanism. They are zero at nodes that slack links leave free, which rest anywhere: rounding is no load on them. Collective on snes
*/
PetscErrorCode SNESLatinLargePredict_Private(SNES snes, Vec u, Vec load, Vec step, PetscReal *moved)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  KSPConvergedReason   reason;
  PetscReal            rtol, force, loose, least, most;
  Vec                  tied, held;
  KSP                  ksp;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(DMGetGlobalVector(structure->dm, &tied));
  PetscCall(DMGetGlobalVector(structure->dm, &held));
  PetscCall(LatinLargeTied_Private(snes, ksp, tied));
  PetscCall(VecPointwiseMult(held, load, tied));
  PetscCall(VecWAXPY(step, -1.0, held, load));
  PetscCall(VecNorm(step, NORM_2, &loose));
  PetscCall(VecNorm(load, NORM_2, &force));
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  PetscCall(KSPSetTolerances(ksp, rtol * rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT)); /* accurate at each node, including soft ones */
  PetscCall(KSPSolve(ksp, loose <= PETSC_SQRT_MACHINE_EPSILON * force ? held : load, step));
  PetscCall(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(VecNorm(step, NORM_2, moved));
  PetscCall(LatinStructureStiffnessRange_Private(structure, &least, &most));
  if ((reason < 0 && reason != KSP_DIVERGED_ITS) || PetscIsInfOrNanReal(*moved) || LATIN_LARGE_FIRM * LATIN_MECHANISM * most * *moved > force) *moved = PETSC_MAX_REAL;
  else {
    PetscCall(VecPointwiseMult(step, step, tied));
    PetscCall(VecNorm(step, NORM_2, moved));
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &held));
  PetscCall(DMRestoreGlobalVector(structure->dm, &tied));
  PetscFunctionReturn(0);
}

/*
   Computes the l2 norm of the Newton step from the displacements `ahead` with the tangent stiffness at u, the last equilibrium of a path.
   Overwrites ahead. Collective on snes
*/
PetscErrorCode SNESLatinLargeCorrect_Private(SNES snes, Vec u, Vec ahead, PetscReal *norm)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  const PetscReal   part  = large->path.supports.part;
  Vec               r;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(SNESComputeFunction(snes, ahead, r));
  PetscCall(SNESLatinSupportsAt_Private(snes, large->path.reached));
  PetscCall(SNESLatinLargePredict_Private(snes, u, r, ahead, norm));
  PetscCall(SNESLatinSupportsAt_Private(snes, part));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscFunctionReturn(0);
}
