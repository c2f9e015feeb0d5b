#include "localsolvers/latinlocalsolvers.h"

/*
   Solvers that options choose for the subdomains and for the coarse problem: their defaults, whether they are direct, and
   how far approximate ones are from a linear symmetric operator. The linear stage with them: stages/approximatestage.c.
*/

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

/* The types that the options choose for such a KSP, before its matrix is there; *chosen: not the factorisation that is the default, by the package */
PetscErrorCode LatinSolverChosen_Private(MPI_Comm comm, PetscObject parent, const char name[], MatSolverType package, PetscBool *iterative, PetscBool *latin, PetscBool *subassembled, PetscBool *chosen)
{
  KSP         ksp;
  PC          pc;
  const char *prefix;
  PetscBool   once, direct, redundant, bddc, fetidp, named;

  PetscFunctionBegin;
  PetscCall(LatinSolverCreate_Private(comm, parent, name, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCCHOLESKY));
  PetscCall(PCFactorSetMatSolverType(pc, package)); /* for -help, which prints each prefix once */
  PetscCall(KSPSetFromOptions(ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPPREONLY, &once));
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPFETIDP, &fetidp));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &direct));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, &redundant, PCLU, PCREDUNDANT, ""));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCBDDC, &bddc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, latin));
  PetscCall(KSPGetOptionsPrefix(ksp, &prefix));
  PetscCall(PetscOptionsHasName(parent->options, prefix, "-pc_factor_mat_solver_type", &named));
  PetscCall(KSPDestroy(&ksp));
  *chosen       = (PetscBool)(!once || !direct || named);
  *subassembled = (PetscBool)(fetidp || bddc);
  *iterative    = (PetscBool)(!once || (!direct && !redundant));
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
   Defaults where the options have chosen a preconditioner that is not a factorisation: applied once for a PC latin, which
   it leaves linear, symmetric and positive definite if it is so itself; elsewhere conjugate gradients to a small
   residual, for an iteration that takes its linear stages to be exact. *direct: it is a factorisation. Before KSPSetUp().
*/
PetscErrorCode LatinSolverDefaults_Private(KSP ksp, PetscBool preconditions, PetscBool *direct)
{
  PC        pc;
  PetscBool given;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, direct, PCCHOLESKY, PCLU, PCREDUNDANT, ""));
  if (*direct || preconditions) PetscFunctionReturn(0);
  PetscCall(PetscOptionsHasName(((PetscObject)ksp)->options, ((PetscObject)ksp)->prefix, "-ksp_type", &given));
  if (given) PetscFunctionReturn(0);
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetTolerances(ksp, LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSetFromOptions(ksp)); /* a tolerance that is given counts */
  PetscFunctionReturn(0);
}

/* A solver to a small residual with the preconditioner of ksp; the caller destroys it */
PetscErrorCode LatinSolverAccurate_Private(KSP ksp, const LatinInexact *inexact, KSP *accurate)
{
  const PetscBool fixed = (PetscBool)(inexact->asymmetry <= LATIN_INEXACT_HARMLESS && inexact->variation <= LATIN_INEXACT_HARMLESS);
  Mat             A, P;
  PC              pc;
  PetscReal       rtol;

  PetscFunctionBegin;
  PetscCall(KSPGetOperators(ksp, &A, &P));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  PetscCall(KSPCreate(PetscObjectComm((PetscObject)ksp), accurate));
  PetscCall(KSPSetOptionsPrefix(*accurate, "set_up_")); /* options without prefix are for others */
  PetscCall(KSPSetType(*accurate, fixed ? KSPCG : KSPFGMRES));
  PetscCall(KSPSetPC(*accurate, pc));
  PetscCall(KSPSetOperators(*accurate, A, P));
  PetscCall(KSPSetTolerances(*accurate, PetscMin(rtol, LATIN_INEXACT_RTOL), PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(0);
}

/*
   How far a solver is from a symmetric and from a linear operator, relative: larger ones of what it was before are kept.
   What conjugate gradients, or any method that is not flexible, must hold of their preconditioner. Collective on A.
*/
PetscErrorCode LatinSolverTest_Private(KSP ksp, Mat A, LatinInexact *inexact)
{
  Vec          v[6], scale;
  PetscScalar *a, d[4];
  PetscInt     n, start;
  PetscReal    whole, rest;

  PetscFunctionBegin;
  PetscCall(MatCreateVecs(A, &v[0], NULL));
  for (PetscInt i = 1; i < 6; i++) PetscCall(VecDuplicate(v[0], &v[i]));
  PetscCall(VecGetLocalSize(v[0], &n));
  PetscCall(VecGetOwnershipRange(v[0], &start, NULL));
  for (PetscInt k = 0; k < 2; k++) { /* any two vectors without symmetry */
    PetscCall(VecGetArray(v[k], &a));
    for (PetscInt i = 0; i < n; i++) a[i] = PetscSinReal(1.0 + (k ? 78.233 : 12.9898) * (PetscReal)((start + i) % 100003));
    PetscCall(VecRestoreArray(v[k], &a));
  }
  /* so that units and contrast do not matter */
  PetscCall(VecDuplicate(v[0], &scale));
  PetscCall(MatGetDiagonal(A, scale));
  PetscCall(VecSqrtAbs(scale));
  for (PetscInt k = 0; k < 2; k++) PetscCall(VecPointwiseMult(v[k], v[k], scale));
  PetscCall(VecWAXPY(v[2], 1.0, v[0], v[1]));
  for (PetscInt k = 0; k < 3; k++) PetscCall(KSPSolve(ksp, v[k], v[3 + k]));
  PetscCall(VecDot(v[3], v[1], &d[0]));
  PetscCall(VecDot(v[0], v[4], &d[1]));
  PetscCall(VecDot(v[3], v[0], &d[2]));
  PetscCall(VecDot(v[4], v[1], &d[3]));
  PetscCall(VecPointwiseMult(v[2], v[5], scale));
  PetscCall(VecNorm(v[2], NORM_2, &whole));
  PetscCall(VecAXPBYPCZ(v[5], -1.0, -1.0, 1.0, v[3], v[4]));
  PetscCall(VecPointwiseMult(v[2], v[5], scale));
  PetscCall(VecNorm(v[2], NORM_2, &rest));
  if (d[2] * d[3] != 0.0) inexact->asymmetry = PetscMax(inexact->asymmetry, PetscAbsReal(d[0] - d[1]) / PetscSqrtReal(PetscAbsReal(d[2] * d[3])));
  PetscCall(PetscInfo(ksp, "as an operator: asymmetry %g, variation %g\n", (double)inexact->asymmetry, (double)(whole > 0.0 ? rest / whole : 0.0)));
  if (whole > 0.0) inexact->variation = PetscMax(inexact->variation, rest / whole);
  for (PetscInt i = 0; i < 6; i++) PetscCall(VecDestroy(&v[i]));
  PetscCall(VecDestroy(&scale));
  PetscFunctionReturn(0);
}

/*
   Ends in an error when a Krylov method meets a preconditioner that it is not made for: symmetric methods one that is
   not symmetric, and those that are not flexible one that changes from application to application. Collective on ksp.
*/
PetscErrorCode LatinInexactCheck_Private(const char prefix[], KSP ksp, const LatinInexact *inexact)
{
  MPI_Comm  comm = PetscObjectComm((PetscObject)ksp);
  PetscBool flexible, symmetric;
  KSPType   type;

  PetscFunctionBegin;
  if (inexact->asymmetry <= LATIN_INEXACT_HARMLESS && inexact->variation <= LATIN_INEXACT_HARMLESS) PetscFunctionReturn(0);
  PetscCall(KSPGetType(ksp, &type));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)ksp, &flexible, KSPFGMRES, KSPFCG, KSPGCR, KSPFBCGS, KSPPIPEFGMRES, KSPPIPEFCG, KSPPIPEGCR, KSPRICHARDSON, KSPPREONLY, ""));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)ksp, &symmetric, KSPCG, KSPGROPPCG, KSPPIPECG, KSPPIPECGRR, KSPPIPELCG, KSPPIPEPRCG, KSPPIPECG2, KSPMINRES, KSPSYMMLQ, KSPCR, KSPPIPECR, ""));
  PetscCheck(
    flexible || inexact->variation <= LATIN_INEXACT_HARMLESS, comm, PETSC_ERR_SUP,
    "The preconditioner changes from application to application, by %.1e: an inner iteration (-%scoarse_ksp_type, -%slocal_ksp_type or -%sinterior_ksp_type) ends early, but -ksp_type %s wants a fixed one. Take a flexible method, -ksp_type fcg or fgmres, or a smaller inner tolerance, or apply the inner preconditioner once (preonly)",
    (double)inexact->variation, prefix, prefix, prefix, type);
  PetscCheck(
    !symmetric || inexact->asymmetry <= LATIN_INEXACT_HARMLESS, comm, PETSC_ERR_SUP,
    "The preconditioner is not symmetric, by %.1e, for an inner one (-%scoarse_pc_type, -%slocal_pc_type or -%sinterior_pc_type) is not, but -ksp_type %s needs a symmetric one. Choose a symmetric one, for example gamg or icc, or -ksp_type gmres",
    (double)inexact->asymmetry, prefix, prefix, prefix, type);
  PetscFunctionReturn(0);
}
