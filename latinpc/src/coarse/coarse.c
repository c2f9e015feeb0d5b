#include "coarse/latincoarse.h"
#include "base/room.h"

/*
   The coarse problem (30), (52): continuity of the macro displacements and of the primal nodes, balance of the
   corresponding forces (25), (39), (41). What the options choose for its solver decides on the form of its matrix.
*/

/* The solver, of the types that the options choose, before there is a matrix */
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
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, &coarse->apart, PCBDDC, PCLATIN, ""));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &coarse->second));
  PetscCall(LatinSolverDirect_Private(coarse->ksp, &direct));
  coarse->apart     = (PetscBool)(coarse->apart || fetidp);
  coarse->iterative = (PetscBool)(coarse->apart || !direct);
  PetscCall(PetscOptionsHasName(((PetscObject)pc)->options, ((PetscObject)pc)->prefix, "-pc_type", &type));
  PetscCall(PetscOptionsHasName(((PetscObject)pc)->options, ((PetscObject)pc)->prefix, "-pc_factor_mat_solver_type", &package));
  coarse->chosen = (PetscBool)(type || package);
  PetscFunctionReturn(0);
}

/*
   A factorisation by MUMPS takes half of the matrix, and so is half sent and stored. Not where each rank factors the whole
   by itself. Not collective
*/
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
  coarse->upper = (PetscBool)(size > 1 && !coarse->tree && cholesky && mumps && (coarse->chosen || coarse->top_size > LATIN_REDUNDANT));
  PetscFunctionReturn(0);
}

/*
   The default is a factorisation: ours on one rank; on several fronts that they join, or of a small sparse matrix that by each rank
   of the whole, for a parallel one of so few rows is all messages. What the options name is for the matrix of all ranks. Where each rank solves the
   whole, which gives the same bits twice, it is by the factorisation of one rank. Collective on coarse->ksp
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
  if (!coarse->chosen && size > 1 && coarse->top_size <= LATIN_REDUNDANT) PetscCall(PCSetType(pc, PCREDUNDANT));
  else if (cholesky && !package) PetscCall(LatinDirectSolver_Private(pc, coarse->A, size > 1 ? MATSOLVERMUMPS : LATIN_CHOLESKY));
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

/* Defaults of an iteration: is its tolerance ours? Then it is of the energy. Collective on coarse->ksp */
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

/* The matrix and its solver go */
static PetscErrorCode LatinCoarseForget_Private(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  PetscCall(KSPDestroy(&coarse->ksp));
  PetscCall(MatDestroy(&coarse->A));
  PetscCall(MatDestroy(&coarse->part));
  PetscCall(PetscFree(coarse->number));
  PetscFunctionReturn(0);
}

/* In the place of a part that has given its values up. A monitor of the coarse KSP asks for its product */
static PetscErrorCode LatinCoarseSpent_Mat(Mat A, Vec x, Vec y)
{
  PetscFunctionBegin;
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_SUP, "The matrix of the coarse problem has given its values up to its factor, and has no product: for residuals of its solver, as monitors show them, choose -snes_latin_coarse_pc_factor_mat_solver_type mumps");
}

/*
   The factor of the tree takes all of a matrix whose parts may be as large as it, and which no solve reads: these go, and what asks
   the matrix for a product says so. Ahead, as they are factored, where nothing is looked at that cannot be: a provisional one; else
   after that. Not where another set-up may have its pattern, nor where it is small: a monitor may ask for a product. Collective on coarse->ksp
*/
static PetscErrorCode LatinCoarseSpend_Private(LatinCoarse *coarse, PetscBool ahead)
{
  PetscBool        spend = (PetscBool)(coarse->tree && coarse->top_size > LATIN_REDUNDANT && !coarse->sub->preconditions && coarse->status.provisional == ahead && !LatinFactorFailed(&coarse->status));
  PetscObjectState state;
  Mat              empty;

  PetscFunctionBegin;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &spend, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)coarse->ksp)));
  if (!spend) PetscFunctionReturn(0);
  PetscCall(MatCreateShell(PETSC_COMM_SELF, coarse->parts, coarse->parts, coarse->parts, coarse->parts, NULL, &empty));
  PetscCall(MatShellSetOperation(empty, MATOP_MULT, (void (*)(void))LatinCoarseSpent_Mat));
  if (ahead) PetscCall(PetscObjectCompose((PetscObject)coarse->A, LATIN_TREE_SPENT, (PetscObject)empty));
  else {
    PetscCall(PetscObjectStateGet((PetscObject)coarse->A, &state));
    PetscCall(MatISSetLocalMat(coarse->A, empty));
    PetscCall(PetscObjectStateSet((PetscObject)coarse->A, state)); /* the factor stays */
  }
  PetscCall(MatDestroy(&empty));
  PetscCall(MatDestroy(&coarse->part));
  PetscFunctionReturn(0);
}

/*
   The matrix from the homogenised stiffnesses, its solver and factors; coarse->status says how that ended. Groups that
   repeat are condensed for direct solvers, for they fill the matrix; a PC latin, BDDC and FETI-DP take the part of each
   rank by itself. Collective on sub->object
*/
PetscErrorCode LatinCoarseSetUp(LatinCoarse *coarse, LatinHomogenised *stiffness)
{
  const PetscInt  dim  = coarse->sub->dim;
  const PetscBool kept = (PetscBool)(coarse->ksp != NULL);
  PetscBool       same = PETSC_FALSE, bddc;
  PC              pc;

  PetscFunctionBegin;
  if (!coarse->macro->modes_global && !coarse->primal_global) { /* no interface: one subdomain, or disconnected ones */
    PetscCall(LatinCoarseForget_Private(coarse));
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
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCBDDC, &bddc)); /* multigrid would forget the near null space */
  if (bddc && dim) PetscCall(PCSetCoordinates(pc, dim, coarse->top_local, coarse->x));
  PetscCall(LatinCoarseSpend_Private(coarse, PETSC_TRUE));
  if (coarse->top_size) PetscCall(LatinFactor_Private(coarse->ksp, coarse->A, NULL, coarse->whole, NULL, &coarse->status)); /* disconnected structures may be condensed entirely, each a group */
  PetscCall(VecDestroy(&coarse->whole));
  PetscCall(LatinCoarseSpend_Private(coarse, PETSC_FALSE));
  if (coarse->tree) LatinRoomReturn((size_t)coarse->parts * (size_t)coarse->parts * sizeof(PetscScalar));
  PetscCall(PetscLogEventEnd(LATIN_Coarse, coarse->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Frees the matrix and its factor before other stiffnesses come, unless they are kept for their pattern. Collective on sub->object */
PetscErrorCode LatinCoarseRelease(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  if (!coarse->sub->preconditions) PetscCall(LatinCoarseForget_Private(coarse));
  PetscFunctionReturn(0);
}

/* The same for other stiffnesses, after it. Collective on sub->object */
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

/* The displacements of the elements here, of a vector of the coarse problem */
static PetscErrorCode LatinCoarseDistribute_Private(LatinCoarse *coarse, Vec v)
{
  const PetscScalar *x;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(v, &x));
  PetscCall(LatinSFBcast_Private(coarse->top_sf, 1, MPIU_SCALAR, x, coarse->top.u));
  PetscCall(VecRestoreArrayRead(v, &x));
  PetscFunctionReturn(0);
}

/* An iteration that nobody else has given a tolerance ends early where it may leave a part of a displacement */
static PetscErrorCode LatinCoarseTolerance_Private(LatinCoarse *coarse, PetscReal left)
{
  PetscFunctionBegin;
  coarse->contraction = coarse->loose ? left : 0.0;
  if (coarse->loose) PetscCall(KSPSetTolerances(coarse->ksp, left > 0.0 ? left : LATIN_INEXACT_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(0);
}

/* From the condensed forces q of the subdomains to the coarse displacements u; left: what an iteration may leave of them, in energy, 0: nothing */
PetscErrorCode LatinCoarseSolve(LatinCoarse *coarse, PetscReal left)
{
  PetscScalar *b;
  PetscInt     rows;

  PetscFunctionBegin;
  if (!coarse->A) PetscFunctionReturn(0);
  PetscCall(LatinCoarseTolerance_Private(coarse, left));
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

/* The coarse displacements u of the subdomains for a vector of the coarse problem, without any other force */
PetscErrorCode LatinCoarseExpand_Private(LatinCoarse *coarse, Vec v)
{
  PetscFunctionBegin;
  PetscCall(PetscArrayzero(coarse->q, coarse->offset[coarse->sub->n]));
  PetscCall(LatinGroupsPass(coarse, PETSC_FALSE));
  PetscCall(LatinCoarseDistribute_Private(coarse, v));
  PetscCall(LatinGroupsPass(coarse, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* Resets all but the matrix and its solver */
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
  PetscCall(LatinCoarseForget_Private(coarse));
  PetscFunctionReturn(0);
}
