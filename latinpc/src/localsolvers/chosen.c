#include "localsolvers/latinlocalsolvers.h"

/* Solvers that options choose for the subdomains and for the coarse problem: their defaults, and whether they are direct. */

/* Is this a factorisation, applied once? */
PetscErrorCode LatinSolverDirect_Private(KSP ksp, PetscBool *direct)
{
  PC        pc;
  PetscBool once;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, direct, PCCHOLESKY, PCLU, PCREDUNDANT, ""));
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPPREONLY, &once));
  *direct = (PetscBool)(*direct && once);
  PetscFunctionReturn(0);
}

/* Do the options leave the local solvers to us, and is there the factorisation that is their default? */
PetscErrorCode LatinSolverIsDefault_Private(PetscObject parent, const char name[], PetscBool *is)
{
  const char *option[] = {"ksp_type", "pc_type", "pc_factor_mat_solver_type"};
  char        full[PETSC_MAX_PATH_LEN];
  PetscBool   given;
  Mat         one;

  PetscFunctionBegin;
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, 1, 1, 1, NULL, &one));
  PetscCall(MatGetFactorAvailable(one, LATIN_CHOLESKY, MAT_FACTOR_CHOLESKY, is));
  PetscCall(MatDestroy(&one));
  for (PetscInt i = 0; i < 3; i++) {
    PetscCall(PetscSNPrintf(full, sizeof(full), "-%s_%s", name, option[i]));
    PetscCall(PetscOptionsHasName(parent->options, parent->prefix, full, &given));
    if (given) *is = PETSC_FALSE;
  }
  PetscFunctionReturn(0);
}

/* A KSP for `name` ("local", "interior", "coarse"), with the options of its parent: one application of its preconditioner */
PetscErrorCode LatinSolverCreate_Private(MPI_Comm comm, PetscObject parent, const char name[], KSP *ksp)
{
  PetscFunctionBegin;
  PetscCall(KSPCreate(comm, ksp));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)*ksp, parent, 1));
  PetscCall(PetscObjectSetOptions((PetscObject)*ksp, parent->options));
  PetscCall(KSPSetOptionsPrefix(*ksp, parent->prefix));
  PetscCall(KSPAppendOptionsPrefix(*ksp, name));
  PetscCall(KSPAppendOptionsPrefix(*ksp, "_"));
  PetscCall(KSPSetType(*ksp, KSPPREONLY));
  PetscFunctionReturn(0);
}

/*
   Sets *failed when a solve has failed. A preconditioner may ask for so many iterations and no more, as PETSc's own do
   (KSPCheckSolve()); where linear stages are taken to be exact that is a failure.
*/
PetscErrorCode LatinSolverNote_Private(KSP ksp, PetscBool preconditions, PetscBool *failed)
{
  KSPConvergedReason reason;

  PetscFunctionBegin;
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  if (reason < 0 && !(preconditions && reason == KSP_DIVERGED_ITS)) *failed = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/*
   Defaults where the options have chosen a preconditioner that is not a factorisation. `once`: it is applied once, which
   leaves a PC latin linear, symmetric and positive definite if it is so itself. Otherwise conjugate gradients to a small
   residual, for what is taken to be exact. Before KSPSetUp().
*/
PetscErrorCode LatinSolverDefaults_Private(KSP ksp, PetscBool once)
{
  PC        pc;
  PetscBool direct, given;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, &direct, PCCHOLESKY, PCLU, PCREDUNDANT, ""));
  if (direct || once) PetscFunctionReturn(0);
  PetscCall(PetscOptionsHasName(((PetscObject)ksp)->options, ((PetscObject)ksp)->prefix, "-ksp_type", &given));
  if (given) PetscFunctionReturn(0);
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetTolerances(ksp, LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSetFromOptions(ksp)); /* a tolerance that is given counts */
  PetscFunctionReturn(0);
}

/* Conjugate gradients to a small residual with the preconditioner of ksp, whatever ksp makes of it, or ksp if that is direct; the caller destroys it */
PetscErrorCode LatinSolverAccurate_Private(KSP ksp, PetscBool direct, KSP *accurate)
{
  Mat A;
  PC  pc;

  PetscFunctionBegin;
  *accurate = ksp;
  if (direct) PetscCall(PetscObjectReference((PetscObject)ksp));
  if (direct) PetscFunctionReturn(0);
  PetscCall(KSPGetOperators(ksp, &A, NULL));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(KSPCreate(PetscObjectComm((PetscObject)ksp), accurate));
  PetscCall(KSPSetOptionsPrefix(*accurate, "set_up_")); /* options without prefix are for others */
  PetscCall(KSPSetType(*accurate, KSPCG));
  PetscCall(KSPSetPC(*accurate, pc));
  PetscCall(KSPSetOperators(*accurate, A, A));
  PetscCall(KSPSetTolerances(*accurate, LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(0);
}
