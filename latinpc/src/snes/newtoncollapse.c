#include "snes/sneslatinimpl.h"

/* Search for a collapse if Newton's method converges slowly: whether there is an equilibrium at all, and with friction statically admissible tensions. */

/*
   Searches for statically admissible tensions inside the friction cones. *held: found, in `bears`, for all links. The problem of the cones has its
   own operators; its steps and linear stages count as Newton's. Collective on latin
*/
PetscErrorCode LatinNewtonCones_Private(Latin latin, LatinNewton *newton, Vec more, PetscReal bears[], PetscBool *held)
{
  LatinEquilibrium *found = &newton->found;
  PetscInt          steps, stages;
  LatinStructure    cones;
  KSP               ksp;
  PC                pc;
  Mat               A;

  PetscFunctionBegin;
  *held = PETSC_FALSE;
  PetscCall(LatinConesCreate_Private(latin->sub.structure, &cones));
  PetscCall(LatinEquilibriumPatches_Private(cones, more, found));
  if (found->verdict != LATIN_UNBOUNDED) {
    PetscCall(KSPCreate(PetscObjectComm((PetscObject)cones), &ksp));
    PetscCall(KSPSetType(ksp, KSPCG));
    PetscCall(KSPSetNormType(ksp, KSP_NORM_NATURAL));
    PetscCall(KSPSetTolerances(ksp, LATIN_NEWTON_TIGHT, PETSC_DEFAULT, PETSC_MAX_REAL, LATIN_NEWTON_LINEAR));
    PetscCall(KSPGetPC(ksp, &pc));
    PetscCall(PCSetType(pc, PCLATIN));
    PetscCall(PCLatinFollow_Private(pc, latin));
    PetscCall(LatinStructureAttachPC(cones, pc));
    PetscCall(PCLatinCorrected_Private(pc, PETSC_TRUE));
    PetscCall(LatinTangentCreate_Private(cones, &A));
    PetscCall(LatinEquilibriumCollapse_Private(cones, ksp, A, more, newton->limit - newton->stages, bears, &steps, &stages, held, found));
    newton->steps += steps;
    newton->stages += stages;
    if (*held) LatinConesTensions(cones, bears);
    PetscCall(MatDestroy(&A));
    PetscCall(KSPDestroy(&ksp));
  }
  PetscCall(LatinStructureDestroy(&cones));
  PetscFunctionReturn(0);
}

/*
   Searches for a collapse, that is, proves that there is no equilibrium. Runs once per solve, if Newton's method converges slowly and linear stages
   are left; its steps and stages count as Newton's. Needs PC latin: the operators have no entries for other preconditioners. Overwrites the Jacobian.
   Collective on newton->snes
*/
PetscErrorCode LatinNewtonCollapse_Private(LatinNewton *newton, Vec more)
{
  PetscInt  steps, stages;
  PetscBool latin, held;
  KSP       ksp;
  PC        pc;
  Mat       A;

  PetscFunctionBegin;
  PetscCall(SNESGetKSP(newton->snes, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &latin));
  if (newton->collapse_searched || !newton->tangent || !latin || newton->stages_left <= 0) PetscFunctionReturn(0);
  newton->collapse_searched = PETSC_TRUE;
  PetscCall(LatinEquilibriumPatches_Private(newton->structure, more, &newton->found));
  if (newton->found.verdict == LATIN_UNBOUNDED) PetscFunctionReturn(0);
  PetscCall(KSPSetTolerances(ksp, LATIN_NEWTON_TIGHT, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(SNESGetJacobian(newton->snes, &A, NULL, NULL, NULL));
  PetscCall(LatinEquilibriumCollapse_Private(newton->structure, ksp, A, more, newton->stages_left, NULL, &steps, &stages, &held, &newton->found));
  newton->held = (PetscBool)((held || newton->structure->ground) && !newton->structure->own_laws); /* masses bear any loads */
  newton->steps += steps;
  newton->stages += stages;
  newton->changes = 1; /* the tangent stiffness must be rebuilt */
  PetscFunctionReturn(0);
}
