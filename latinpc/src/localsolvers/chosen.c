#include "localsolvers/latinlocalsolvers.h"

/* Solvers of the subdomains and of the coarse problem that the user chooses by options: creation, defaults, failures. */

/* Sets *direct: whether the solver is a factorisation, applied once */
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

/* Sets *is: whether the local solver is the default factorisation: it is available, and no option sets another one */
PetscErrorCode LatinSolverIsDefault_Private(PetscObject parent, const char name[], PetscBool *is)
{
  const char *option[] = {"ksp_type", "pc_type", "pc_factor_mat_solver_type"};
  char        full[PETSC_MAX_PATH_LEN];
  PetscBool   given;

  PetscFunctionBegin;
  PetscCall(MatSolverTypeGet(LATIN_CHOLESKY, MATSEQAIJ, MAT_FACTOR_CHOLESKY, NULL, is, NULL));
  for (PetscInt i = 0; i < 3; i++) {
    PetscCall(PetscSNPrintf(full, sizeof(full), "-%s_%s", name, option[i]));
    PetscCall(PetscOptionsHasName(parent->options, parent->prefix, full, &given));
    if (given) *is = PETSC_FALSE;
  }
  PetscFunctionReturn(0);
}

/* Creates the KSP of `name` ("local", "interior", "coarse"), with the options and the prefix of its parent; default: KSPPREONLY */
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
   Sets *failed after a failed solve. In a preconditioner a fixed number of iterations is not a failure, as in PETSc's own
   (KSPCheckSolve()); for an exact linear stage it is.
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
   Sets defaults if the options choose a preconditioner that is not a factorisation. `once`: it is applied once, so that a PC latin is linear, symmetric
   and positive definite if it is. Else conjugate gradients to a small residual, for solves that must be exact. Before KSPSetUp().
*/
PetscErrorCode LatinSolverDefaults_Private(KSP ksp, PetscBool once)
{
  PetscBool direct, given;

  PetscFunctionBegin;
  PetscCall(LatinSolverDirect_Private(ksp, &direct));
  if (direct || once) PetscFunctionReturn(0);
  PetscCall(PetscOptionsHasName(((PetscObject)ksp)->options, ((PetscObject)ksp)->prefix, "-ksp_type", &given));
  if (given) PetscFunctionReturn(0);
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetTolerances(ksp, LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSetFromOptions(ksp)); /* the user's tolerance, if any, overrides */
  PetscFunctionReturn(0);
}

/* Creates *accurate: conjugate gradients to a small residual with the preconditioner of ksp, or ksp itself if it is direct. The caller destroys it */
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
  PetscCall(KSPSetOptionsPrefix(*accurate, "set_up_")); /* no user option shall match */
  PetscCall(KSPSetType(*accurate, KSPCG));
  PetscCall(KSPSetPC(*accurate, pc));
  PetscCall(KSPSetOperators(*accurate, A, A));
  PetscCall(KSPSetTolerances(*accurate, LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(0);
}
