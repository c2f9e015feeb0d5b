#include "coarse/latincoarse.h"
#include "base/room.h"

/*
   The coarse problem (30), (52): continuity of the macro displacements and of the primal nodes, balance of the corresponding forces (25), (39), (41).
   Set-up:

   1. The solver from the options: it determines the format of the matrix.
   2. Condensation of repeated groups of subdomains (coarse/groups.c), for direct solvers alone: it makes the matrix denser.
   3. Assembly of the matrix (coarse/assembly.c); for iterative solvers its near null space (coarse/nearnullspace.c).
   4. Factorisation; after it the matrix is released where nothing needs it.
*/

/* Creates the solver and sets the types from options, before there is a matrix. Collective on sub->object */
static PetscErrorCode LatinCoarseOptions_Private(LatinCoarse *coarse)
{
  PC          pc;
  PetscBool   fetidp, direct, type, package;
  PetscMPIInt size;

  PetscFunctionBegin;
  PetscCall(LatinSolverCreate_Private(PetscObjectComm(coarse->sub->object), coarse->sub->object, "coarse", &coarse->ksp));
  PetscCall(KSPGetPC(coarse->ksp, &pc));
  PetscCall(PCSetType(pc, PCCHOLESKY));
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)pc), &size));
  PetscCall(PCFactorSetMatSolverType(pc, size > 1 ? MATSOLVERMUMPS : LATIN_CHOLESKY));
  PetscCall(KSPSetFromOptions(coarse->ksp));
  PetscCall(PetscObjectTypeCompare((PetscObject)coarse->ksp, KSPFETIDP, &fetidp));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, &coarse->unassembled, PCBDDC, PCLATIN, ""));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &coarse->second_level));
  PetscCall(LatinSolverDirect_Private(coarse->ksp, &direct));
  coarse->unassembled = (PetscBool)(coarse->unassembled || fetidp);
  coarse->iterative   = (PetscBool)(coarse->unassembled || !direct);
  PetscCall(PetscOptionsHasName(((PetscObject)pc)->options, ((PetscObject)pc)->prefix, "-pc_type", &type));
  PetscCall(PetscOptionsHasName(((PetscObject)pc)->options, ((PetscObject)pc)->prefix, "-pc_factor_mat_solver_type", &package));
  coarse->chosen = (PetscBool)(type || package);
  PetscFunctionReturn(0);
}

/* Sets coarse->upper: whether MUMPS factors the matrix. It needs the upper triangle alone, which halves messages and memory. Not collective */
static PetscErrorCode LatinCoarseHalf_Private(LatinCoarse *coarse)
{
  const char *package = MATSOLVERMUMPS;
  char        given[64];
  PetscBool   cholesky, named, mumps = PETSC_TRUE;
  PetscMPIInt size;
  PetscObject pc;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(coarse->ksp, (PC *)&pc));
  PetscCallMPI(MPI_Comm_size(PetscObjectComm(pc), &size));
  PetscCall(PetscObjectTypeCompare(pc, PCCHOLESKY, &cholesky));
  PetscCall(PetscOptionsGetString(pc->options, pc->prefix, "-pc_factor_mat_solver_type", given, sizeof(given), &named));
  if (named) PetscCall(PetscStrcmp(given, package, &mumps));
  if (mumps) PetscCall(MatSolverTypeGet(package, MATMPISBAIJ, MAT_FACTOR_CHOLESKY, NULL, &mumps, NULL));
  coarse->upper = (PetscBool)(size > 1 && !coarse->tree && cholesky && mumps);
  PetscFunctionReturn(0);
}

/*
   Sets the default solver, a factorisation. One rank: ours. Several ranks: the multifrontal solver of coarse/tree.h, or MUMPS. A package named by
   options factors the distributed matrix. PCREDUNDANT, by options, uses our factorisation, reproducible to the bit. Collective on coarse->ksp
*/
static PetscErrorCode LatinCoarseDirect_Private(LatinCoarse *coarse)
{
  PetscMPIInt size;
  PetscBool   package, cholesky, redundant;
  PC          pc, whole;
  KSP         inner;
  Mat         A;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(coarse->ksp, &pc));
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)pc), &size));
  if (coarse->tree) {
    PetscCall(PCFactorSetMatSolverType(pc, LATIN_TREE));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscOptionsHasName(((PetscObject)pc)->options, ((PetscObject)pc)->prefix, "-pc_factor_mat_solver_type", &package));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  if (cholesky && !package) PetscCall(LatinDirectSolver_Private(pc, coarse->A, size > 1 ? MATSOLVERMUMPS : LATIN_CHOLESKY));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCREDUNDANT, &redundant));
  if (!redundant) PetscFunctionReturn(0);
  PetscCall(KSPSetOperators(coarse->ksp, coarse->A, coarse->A));
  PetscCall(PCRedundantGetKSP(pc, &inner));
  PetscCall(KSPGetPC(inner, &whole));
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, 1, 1, 1, NULL, &A));
  PetscCall(LatinDirectSolver_Private(whole, A, LATIN_CHOLESKY));
  PetscCall(MatDestroy(&A));
  PetscCall(KSPSetFromOptions(inner));
  PetscFunctionReturn(0);
}

/* Sets defaults of an iterative solver. If no option sets its type or tolerance (coarse->loose), it stops in the energy norm. Collective on coarse->ksp */
static PetscErrorCode LatinCoarseIterates_Private(LatinCoarse *coarse)
{
  const PetscObject ksp = (PetscObject)coarse->ksp;
  PetscBool         type, rtol;

  PetscFunctionBegin;
  PetscCall(LatinSolverDefaults_Private(coarse->ksp, coarse->sub->preconditions));
  PetscCall(PetscOptionsHasName(ksp->options, ksp->prefix, "-ksp_type", &type));
  PetscCall(PetscOptionsHasName(ksp->options, ksp->prefix, "-ksp_rtol", &rtol));
  coarse->loose = (PetscBool)(coarse->iterative && !coarse->sub->preconditions && !type && !rtol);
  if (coarse->loose) PetscCall(KSPSetNormType(coarse->ksp, KSP_NORM_NATURAL));
  PetscFunctionReturn(0);
}

/* Destroys the matrix and its solver. Collective on sub->object */
static PetscErrorCode LatinCoarseDestroy_Private(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  PetscCall(KSPDestroy(&coarse->ksp));
  PetscCall(MatDestroy(&coarse->A));
  PetscCall(MatDestroy(&coarse->part));
  PetscCall(PetscFree(coarse->number));
  PetscFunctionReturn(0);
}

/* Product of the shell that replaces a released local matrix: an error, for monitors of the coarse KSP that call it */
static PetscErrorCode LatinCoarseReleased_Mat(Mat A, Vec x, Vec y)
{
  PetscFunctionBegin;
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_SUP, "The matrix of the coarse problem was released after its factorisation and has no product: for residuals of its solver, as monitors show them, choose -snes_latin_coarse_pc_factor_mat_solver_type mumps");
}

/*
   Releases the local matrices: they may be as large as the multifrontal factor, and no solve reads them. A shell takes their place, whose product is an
   error. ahead: before the factorisation, if it is provisional and so makes no checks that read the matrix: it releases them itself; else after it.
   Matrices are kept if a later set-up may reuse the pattern, or if they are small, for products of monitors. Collective on coarse->ksp
*/
static PetscErrorCode LatinCoarseReleaseLocal_Private(LatinCoarse *coarse, PetscBool ahead)
{
  PetscBool        release = (PetscBool)(coarse->tree && coarse->top_size > LATIN_COARSE_KEPT && !coarse->sub->preconditions && coarse->status.provisional == ahead && !LatinFactorFailed(&coarse->status));
  PetscObjectState state;
  Mat              empty;

  PetscFunctionBegin;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &release, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)coarse->ksp)));
  if (!release) PetscFunctionReturn(0);
  PetscCall(MatCreateShell(PETSC_COMM_SELF, coarse->parts, coarse->parts, coarse->parts, coarse->parts, NULL, &empty));
  PetscCall(MatShellSetOperation(empty, MATOP_MULT, (void (*)(void))LatinCoarseReleased_Mat));
  if (ahead) PetscCall(PetscObjectCompose((PetscObject)coarse->A, LATIN_TREE_RELEASED, (PetscObject)empty));
  else {
    PetscCall(PetscObjectStateGet((PetscObject)coarse->A, &state));
    PetscCall(MatISSetLocalMat(coarse->A, empty));
    PetscCall(PetscObjectStateSet((PetscObject)coarse->A, state)); /* keep the factor */
  }
  PetscCall(MatDestroy(&empty));
  PetscCall(MatDestroy(&coarse->part));
  PetscFunctionReturn(0);
}

/*
   Sets up the matrix from the homogenised stiffnesses, its solver and factors; coarse->status reports failures. PC latin, BDDC and FETI-DP get a MATIS.
   Collective on sub->object
*/
PetscErrorCode LatinCoarseSetUp(LatinCoarse *coarse, LatinHomogenised *stiffness)
{
  const PetscInt  dim  = coarse->sub->dim;
  const PetscBool kept = (PetscBool)(coarse->ksp != NULL);
  PetscBool       same = PETSC_FALSE, bddc;
  PC              pc;

  PetscFunctionBegin;
  if (!coarse->macro->modes_global && !coarse->primal_global) { /* no interface: one subdomain, or disconnected ones */
    PetscCall(LatinCoarseDestroy_Private(coarse));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscLogEventBegin(LATIN_Coarse, coarse->sub->object, 0, 0, 0));
  if (!kept) PetscCall(LatinCoarseOptions_Private(coarse));
  PetscCall(LatinGroupsSetUp(coarse, stiffness, (PetscBool)!coarse->iterative));
  PetscCall(LatinCoarseHalf_Private(coarse));
  PetscCall(LatinCoarseAssemble_Private(coarse, stiffness, &same));
  if (coarse->iterative) PetscCall(LatinCoarseNear_Private(coarse));
  PetscCall(LatinGroupsFinish(coarse));
  PetscCall(MatCreateVecs(coarse->A, &coarse->sol, &coarse->rhs));
  if (kept && !same) {
    PetscCall(KSPDestroy(&coarse->ksp));
    PetscCall(LatinCoarseOptions_Private(coarse));
  }
  if (!same) PetscCall(LatinCoarseDirect_Private(coarse));
  PetscCall(KSPSetOperators(coarse->ksp, coarse->A, coarse->A));
  if (!same) PetscCall(LatinCoarseIterates_Private(coarse));
  PetscCall(KSPGetPC(coarse->ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCBDDC, &bddc)); /* not PCGAMG, which would replace the near null space */
  if (bddc && dim) PetscCall(PCSetCoordinates(pc, dim, coarse->top_local, coarse->x));
  PetscCall(LatinCoarseReleaseLocal_Private(coarse, PETSC_TRUE));
  coarse->status.tried = LatinSubdomainsTried(coarse->sub);
  /* no rows if each connected component is one group */
  if (coarse->top_size) PetscCall(LatinFactor_Private(coarse->ksp, coarse->A, NULL, coarse->whole, NULL, &coarse->status));
  PetscCall(VecDestroy(&coarse->whole));
  PetscCall(LatinCoarseReleaseLocal_Private(coarse, PETSC_FALSE));
  if (coarse->tree) LatinRoomTrim((size_t)coarse->parts * (size_t)coarse->parts * sizeof(PetscScalar));
  PetscCall(PetscLogEventEnd(LATIN_Coarse, coarse->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Frees the matrix and its factor before LatinCoarseRenew(), unless they are kept for their pattern. Collective on sub->object */
PetscErrorCode LatinCoarseRelease(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  if (!coarse->sub->preconditions) PetscCall(LatinCoarseDestroy_Private(coarse));
  PetscFunctionReturn(0);
}

/* Sets up the coarse problem again for other stiffnesses, after LatinCoarseRelease(). Collective on sub->object */
PetscErrorCode LatinCoarseRenew(LatinCoarse *coarse, LatinHomogenised *stiffness)
{
  const PetscBool provisional = coarse->status.provisional;

  PetscFunctionBegin;
  PetscCall(LatinGroupsReset(coarse));
  PetscCall(PetscFree(coarse->x));
  PetscCall(VecDestroy(&coarse->rhs));
  PetscCall(VecDestroy(&coarse->sol));
  PetscCall(VecDestroy(&coarse->status.mode));
  coarse->status = (LatinFactorStatus){.provisional = provisional};
  PetscCall(LatinCoarseSetUp(coarse, stiffness));
  PetscFunctionReturn(0);
}

/* Scatters a vector of coarse displacements to top.u. Collective on sub->object */
static PetscErrorCode LatinCoarseDistribute_Private(LatinCoarse *coarse, Vec v)
{
  const PetscScalar *x;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(v, &x));
  PetscCall(LatinSFBcast_Private(coarse->top_sf, 1, MPIU_SCALAR, x, coarse->top.u));
  PetscCall(VecRestoreArrayRead(v, &x));
  PetscFunctionReturn(0);
}

/* Sets the tolerance of an iterative solver if no option does: `contraction`, or an accurate one if it is 0 */
static PetscErrorCode LatinCoarseTolerance_Private(LatinCoarse *coarse, PetscReal contraction)
{
  PetscFunctionBegin;
  coarse->contraction = coarse->loose ? contraction : 0.0;
  if (coarse->loose) PetscCall(KSPSetTolerances(coarse->ksp, contraction > 0.0 ? contraction : LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(0);
}

/*
   Computes the coarse displacements u from the condensed forces q of the subdomains. contraction: relative tolerance of an iterative solver in the
   energy norm, 0: accurate. Collective on sub->object
*/
PetscErrorCode LatinCoarseSolve(LatinCoarse *coarse, PetscReal contraction)
{
  PetscScalar *b;
  PetscInt     rows;

  PetscFunctionBegin;
  if (!coarse->A) PetscFunctionReturn(0);
  PetscCall(LatinCoarseTolerance_Private(coarse, contraction));
  PetscCall(PetscLogEventBegin(LATIN_Coarse, coarse->sub->object, 0, 0, 0));
  PetscCall(LatinGroupsPass(coarse, PETSC_FALSE));
  PetscCall(VecZeroEntries(coarse->rhs));
  PetscCall(VecGetArray(coarse->rhs, &b));
  PetscCall(LatinSFReduce_Private(coarse->top_sf, 1, MPIU_SCALAR, coarse->top.q, b, MPI_SUM));
  PetscCall(VecRestoreArray(coarse->rhs, &b));
  PetscCall(VecGetSize(coarse->rhs, &rows));
  if (rows) {
    PetscCall(KSPSolve(coarse->ksp, coarse->rhs, coarse->sol));
    PetscCall(LatinSolverNote_Private(coarse->ksp, coarse->sub->preconditions, &coarse->failed));
  }
  PetscCall(LatinCoarseDistribute_Private(coarse, coarse->sol));
  PetscCall(LatinGroupsPass(coarse, PETSC_TRUE));
  PetscCall(PetscLogEventEnd(LATIN_Coarse, coarse->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Prolongs a vector of the coarse matrix to the coarse displacements u of the subdomains, under zero forces. Overwrites q. Collective on sub->object */
PetscErrorCode LatinCoarseExpand_Private(LatinCoarse *coarse, Vec v)
{
  PetscFunctionBegin;
  PetscCall(PetscArrayzero(coarse->q, coarse->offset[coarse->sub->n]));
  PetscCall(LatinGroupsPass(coarse, PETSC_FALSE));
  PetscCall(LatinCoarseDistribute_Private(coarse, v));
  PetscCall(LatinGroupsPass(coarse, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* Resets all but the matrix and its solver, for a set-up that may reuse them */
PetscErrorCode LatinCoarseRetire(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  PetscCall(LatinGroupsReset(coarse));
  PetscCall(PetscFree(coarse->x));
  PetscCall(VecDestroy(&coarse->rhs));
  PetscCall(VecDestroy(&coarse->sol));
  PetscCall(VecDestroy(&coarse->whole));
  PetscCall(PetscLayoutDestroy(&coarse->map));
  PetscCall(PetscFree(coarse->offset));
  PetscCall(PetscFree(coarse->macro_count));
  PetscCall(PetscFree3(coarse->global, coarse->q, coarse->u));
  PetscCall(VecDestroy(&coarse->status.mode));
  PetscCall(PetscMemzero(&coarse->map, sizeof(*coarse) - offsetof(LatinCoarse, map)));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCoarseReset(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  PetscCall(LatinCoarseRetire(coarse));
  PetscCall(LatinCoarseDestroy_Private(coarse));
  PetscFunctionReturn(0);
}
