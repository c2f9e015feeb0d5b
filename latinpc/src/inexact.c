#include "latinimpl.h"

/*
   Approximate solvers of the subdomains and of the coarse problem. What must not be approximate is the coarse space, or
   rigid motions of a subdomain would cost energy: H and Phi come from accurate solves, with what the options choose
   as preconditioner of conjugate gradients. In the linear stage itself one application B of it takes the place of
   K_rr^-1, between projections that keep the macro displacements at zero. With A_r and V_m = K_rr^-1 A_r^t as in condense.c,
   and T = A_r V_m:

     U = P^t B P g + Phi u,   P = 1 - A_r^t T^-1 V_m^t

   P^t K_rr^-1 P is the exact operator K_rr^-1 - V_m T^-1 V_m^t; with B symmetric positive definite the linear stage
   remains so. P g takes the macro part of q = Phi^t g, and P^t y takes Phi times the macro displacements of y.
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

/*
   Notes in latin->failed when a solve has failed. A preconditioner may ask for so many iterations and no more, as PETSc's
   own do (KSPCheckSolve()); where linear stages are taken to be exact that is a failure, too.
*/
PetscErrorCode LatinSolverNote_Private(Latin latin, KSP ksp)
{
  KSPConvergedReason reason;

  PetscFunctionBegin;
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  if (reason < 0 && !(latin->preconditions && reason == KSP_DIVERGED_ITS)) latin->failed = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/*
   Defaults where the options have chosen a preconditioner that is not a factorisation: applied once for a PC latin, which
   it leaves linear, symmetric and positive definite if it is so itself; elsewhere conjugate gradients to a small
   residual, for an iteration that takes its linear stages to be exact. *direct: it is a factorisation. Before KSPSetUp().
*/
PetscErrorCode LatinSolverDefaults_Private(Latin latin, KSP ksp, const char name[], PetscBool *direct)
{
  char        option[64];
  const char *prefix;
  PC          pc;
  PetscBool   given;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, direct, PCCHOLESKY, PCLU, PCREDUNDANT, ""));
  if (*direct || latin->preconditions) PetscFunctionReturn(0);
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
  PetscCall(PetscSNPrintf(option, sizeof(option), "-%s_ksp_type", name));
  PetscCall(PetscOptionsHasName(((PetscObject)latin)->options, prefix, option, &given));
  if (given) PetscFunctionReturn(0);
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetTolerances(ksp, LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSetFromOptions(ksp)); /* a tolerance that is given counts */
  PetscFunctionReturn(0);
}

/* A solver to a small residual with the preconditioner of ksp; the caller destroys it */
PetscErrorCode LatinSolverAccurate_Private(Latin latin, KSP ksp, KSP *accurate)
{
  const PetscBool fixed = (PetscBool)(latin->inexact.asymmetry <= LATIN_INEXACT_HARMLESS && latin->inexact.variation <= LATIN_INEXACT_HARMLESS);
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
   What conjugate gradients, or any method that is not flexible, must know of their preconditioner. Collective on A.
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
PetscErrorCode LatinInexactCheck_Private(Latin latin, KSP ksp, const LatinInexact *inexact)
{
  MPI_Comm    comm = PetscObjectComm((PetscObject)ksp);
  PetscBool   flexible, symmetric;
  KSPType     type;
  const char *prefix;

  PetscFunctionBegin;
  if (inexact->asymmetry <= LATIN_INEXACT_HARMLESS && inexact->variation <= LATIN_INEXACT_HARMLESS) PetscFunctionReturn(0);
  PetscCall(KSPGetType(ksp, &type));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)ksp, &flexible, KSPFGMRES, KSPFCG, KSPGCR, KSPFBCGS, KSPPIPEFGMRES, KSPPIPEFCG, KSPPIPEGCR, KSPRICHARDSON, KSPPREONLY, ""));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)ksp, &symmetric, KSPCG, KSPGROPPCG, KSPPIPECG, KSPPIPECGRR, KSPPIPELCG, KSPPIPEPRCG, KSPPIPECG2, KSPMINRES, KSPSYMMLQ, KSPCR, KSPPIPECR, ""));
  prefix = ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "";
  PetscCheck(
    flexible || inexact->variation <= LATIN_INEXACT_HARMLESS, comm, PETSC_ERR_SUP,
    "The preconditioner changes from application to application, by %.1e: an inner iteration (-%scoarse_ksp_type, -%slocal_ksp_type or -%sinterior_ksp_type) ends early, but -ksp_type %s wants a fixed one. Take a flexible method, -ksp_type fcg or fgmres, or a smaller inner tolerance, or apply the inner preconditioner once (preonly)",
    (double)inexact->variation, prefix, prefix, prefix, type);
  PetscCheck(
    !symmetric || inexact->asymmetry <= LATIN_INEXACT_HARMLESS, comm, PETSC_ERR_SUP,
    "The preconditioner is not symmetric, by %.1e, for an inner one (-%scoarse_pc_type, -%slocal_pc_type or -%sinterior_pc_type) is not, but -ksp_type %s wants a symmetric one. Choose a symmetric one, for example gamg or icc, or -ksp_type gmres",
    (double)inexact->asymmetry, prefix, prefix, prefix, type);
  PetscFunctionReturn(0);
}

/* Adds the macro forces -q to the forces of a subdomain: P g. Nothing acts where displacements are prescribed or primal */
static void LatinInexactBefore(Latin latin, PetscInt s)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinInterfaces   *inter  = &latin->inter;
  LatinLinear       *linear = &latin->linear;
  const PetscReal   *q      = latin->coarse.q + latin->coarse.offset[s];

  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscReal      *qf   = q + face->local_first - latin->coarse.offset[s];

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscReal *row = LatinMacroDualRow(&latin->macro, face, k);

      for (PetscInt j = 0; j < face->modes; j++) linear->g[inter->side_dof[k]] -= row[j] * qf[j];
    }
  }
  for (PetscInt i = sub->bs * sub->node_offset[s]; i < sub->bs * sub->node_offset[s + 1]; i++)
    if (sub->fixed[i] || linear->primal_index[i] >= 0) linear->g[i] = 0.0;
}

/* U += P^t y + Phi u for y in place of the forces: of the coarse displacements u, y's macro displacements are taken away. Uses q */
static PetscErrorCode LatinInexactAfter_Private(Latin latin, PetscInt s, PetscReal U[])
{
  LatinSubstructure *sub    = &latin->sub;
  LatinInterfaces   *inter  = &latin->inter;
  LatinLinear       *linear = &latin->linear;
  LatinCoarse       *coarse = &latin->coarse;
  const PetscInt     first = sub->bs * sub->node_offset[s], last = sub->bs * sub->node_offset[s + 1];
  const PetscScalar  one = 1.0;
  const PetscBLASInt inc = 1;
  PetscReal         *u   = coarse->q + coarse->offset[s];
  PetscBLASInt       rows, cols;

  PetscFunctionBegin;
  for (PetscInt i = first; i < last; i++)
    if (sub->fixed[i] || linear->primal_index[i] >= 0) linear->g[i] = 0.0;
  PetscCall(PetscArraycpy(u, coarse->u + coarse->offset[s], coarse->offset[s + 1] - coarse->offset[s]));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    PetscReal            *uf   = u + face->local_first - coarse->offset[s];

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscReal *row = LatinMacroDualRow(&latin->macro, face, k);

      for (PetscInt j = 0; j < face->modes; j++) uf[j] -= row[j] * linear->g[inter->side_dof[k]];
    }
  }
  for (PetscInt i = first; i < last; i++) U[i] += linear->g[i];
  PetscCall(PetscBLASIntCast(last - first, &rows));
  PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
  if (cols) PetscCallBLAS("BLASgemv", BLASgemv_("N", &rows, &cols, &one, linear->Phi + linear->phi_offset[s], &rows, u, &inc, &one, U + first, &inc));
  PetscFunctionReturn(0);
}

/* Relocalisation and local solves (42) of a batch whose solver is approximate */
PetscErrorCode LatinInexactSolve_Private(Latin latin, PetscInt which, PetscReal U[])
{
  LatinLinear      *linear = &latin->linear;
  const LatinBatch *batch  = &linear->blocks.batch[which];
  const PetscInt    n      = batch->patterns * batch->members;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < n; m++) LatinInexactBefore(latin, batch->sub[m]);
  PetscCall(LatinBlockSolveBatch_Private(latin, &linear->solver, which, linear->g, linear->g));
  for (PetscInt m = 0; m < n; m++) PetscCall(LatinInexactAfter_Private(latin, batch->sub[m], U));
  PetscFunctionReturn(0);
}
