#include "localsolvers/latinlocalsolvers.h"

/*
   Direct solvers of the local and coarse problems, and the diagnosis of their factorisations:

   1. Factorisation, with more work space for MUMPS if needed.
   2. If it fails, shifted inverse iteration finds a displacement of zero or negative stiffness.
   3. A factor in single precision is tested, and computed in higher precision if it is too inaccurate.
   4. Inverse iteration with a factor in double precision finds a mechanism, a displacement of zero energy, that rounding has hidden.
*/

#define LATIN_SHIFT LatinByPrecision(1e-8, 1e-4) /* first shift of a matrix that could not be factored, relative to the diagonal */
/* factor from one shift to the next, if inverse iteration finds no displacement of zero or negative stiffness */
#define LATIN_SHIFT_GROWS 4.0
/* largest shift, relative to the diagonal, which may cancel: pressed bars have negative stiffnesses of 2.3 times the diagonal */
#define LATIN_SHIFT_MOST    10.0
#define LATIN_INVERSE_STEPS 10 /* steps of inverse iteration that isolate one displacement */
/* times LATIN_MECHANISM: a Rayleigh quotient above this proves that there is no mechanism; inverse iteration ends, for ordinary structures after one step */
#define LATIN_INVERSE_FIRM 1e6
#define LATIN_ROOM         100  /* first work space of MUMPS beyond its own estimate, in percent */
#define LATIN_ROOM_MOST    6400 /* largest work space, in percent, after three fourfold increases */

/* Sets *package to the first of four with a factorisation of A of this kind; NULL: none, then PCREDUNDANT on several ranks */
static PetscErrorCode LatinDirectChoose_Private(PC pc, Mat A, PCType type, MatFactorType kind, const MatSolverType candidates[4], MatSolverType *package)
{
  PetscMPIInt size;
  PetscBool   found = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)A), &size));
  PetscCall(PCSetType(pc, type));
  *package = NULL;
  for (PetscInt i = 0; i < 4 && !found; i++) {
    PetscCall(MatGetFactorAvailable(A, candidates[i], kind, &found));
    if (found) *package = candidates[i];
  }
  if (found) PetscCall(PCFactorSetMatSolverType(pc, *package));
  else if (size > 1) PetscCall(PCSetType(pc, PCREDUNDANT));
  PetscFunctionReturn(0);
}

/* Sets Cholesky with the preferred package; if PETSc lacks it, another one, with a warning */
PetscErrorCode LatinDirectSolver_Private(PC pc, Mat A, MatSolverType preferred)
{
  const MatSolverType candidates[] = {preferred, MATSOLVERMUMPS, MATSOLVERCHOLMOD, MATSOLVERPETSC};
  static PetscBool    warned       = PETSC_FALSE;
  MatSolverType       package;
  PetscMPIInt         rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCall(LatinDirectChoose_Private(pc, A, PCCHOLESKY, MAT_FACTOR_CHOLESKY, candidates, &package));
  if (package && !strcmp(package, preferred)) PetscFunctionReturn(0);
  if (!warned && !rank && !package) PetscCall(PetscFPrintf(PETSC_COMM_SELF, PETSC_STDERR, "latin: this PETSc has no parallel direct solver; every rank factors the whole coarse problem\n"));
  if (!warned && !rank && package) PetscCall(PetscFPrintf(PETSC_COMM_SELF, PETSC_STDERR, "latin: this PETSc has no %s; using %s instead, which may be slower\n", strcmp(preferred, LATIN_CHOLESKY) ? preferred : "cholmod", package));
  warned = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Sets LU with pivots, by the first package that PETSc has for A; else by PETSc's own, which on several ranks factors the whole matrix on each */
PetscErrorCode LatinDirectLU_Private(PC pc, Mat A)
{
  const MatSolverType candidates[] = {MATSOLVERMUMPS, MATSOLVERUMFPACK, MATSOLVERKLU, MATSOLVERSUPERLU};
  MatSolverType       package;

  PetscFunctionBegin;
  PetscCall(LatinDirectChoose_Private(pc, A, PCLU, MAT_FACTOR_LU, candidates, &package));
  PetscFunctionReturn(0);
}

/* Creates a dense matrix for right-hand sides or solutions of KSPMatSolve() */
PetscErrorCode LatinDenseCreate_Private(PetscInt rows, PetscInt columns, Mat *M)
{
  PetscFunctionBegin;
  PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, rows, columns, NULL, M));
  PetscCall(MatAssemblyBegin(*M, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*M, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(0);
}

/* Solves for all columns of B. Sets *failed to the reason of a failure, else leaves it */
PetscErrorCode LatinDenseSolve_Private(KSP ksp, Mat B, Mat X, KSPConvergedReason *failed)
{
  KSPConvergedReason reason;

  PetscFunctionBegin;
  PetscCall(KSPMatSolve(ksp, B, X));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  if (reason < 0) *failed = reason;
  PetscFunctionReturn(0);
}

/* Sets v to pseudorandom numbers, without symmetry */
static PetscErrorCode LatinAnyVector_Private(Vec v)
{
  PetscScalar *a;
  PetscInt     n, start;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(v, &n));
  PetscCall(VecGetOwnershipRange(v, &start, NULL));
  PetscCall(VecGetArray(v, &a));
  for (PetscInt i = 0; i < n; i++) a[i] = PetscSinReal(1.0 + 12.9898 * (PetscReal)((start + i) % 100003));
  PetscCall(VecRestoreArray(v, &a));
  PetscFunctionReturn(0);
}

/*
   Finds the softest displacement v of A relative to the diagonal `whole`, or (NULL) that of A, by inverse iteration: at most `steps` solves with ksp,
   until the Rayleigh quotient *stiffness of v reaches `firm`. Collective on A
*/
static PetscErrorCode LatinSoftest_Private(KSP ksp, Mat A, Vec whole, PetscInt steps, PetscReal firm, Vec v, PetscReal *stiffness)
{
  Vec         d, b;
  PetscScalar top, bottom;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(v, &d));
  PetscCall(VecDuplicate(v, &b));
  if (whole) PetscCall(VecCopy(whole, d));
  else PetscCall(MatGetDiagonal(A, d));
  PetscCall(LatinAnyVector_Private(v));
  /* scaled by the diagonal, so that units and contrast do not matter */
  PetscCall(VecSqrtAbs(d));
  PetscCall(VecPointwiseDivide(v, v, d));
  PetscCall(VecPointwiseMult(d, d, d));
  *stiffness = 0.0;
  for (PetscInt k = 0; k < steps && *stiffness < firm; k++) {
    PetscCall(VecPointwiseMult(b, d, v));
    PetscCall(VecDot(b, v, &top));
    if (!(top > 0.0)) *stiffness = 1.0;
    if (!(top > 0.0)) break;
    PetscCall(VecScale(b, 1.0 / PetscSqrtReal(top)));
    PetscCall(KSPSolve(ksp, b, v));
    PetscCall(VecDot(b, v, &top));
    PetscCall(VecPointwiseMult(b, d, v));
    PetscCall(VecDot(b, v, &bottom));
    *stiffness = bottom > 0.0 && !PetscIsInfOrNanScalar(bottom) ? top / bottom : 0.0;
  }
  PetscCall(PetscInfo(ksp, "softest displacement: %g of the diagonal\n", (double)*stiffness));
  PetscCall(VecDestroy(&d));
  PetscCall(VecDestroy(&b));
  PetscFunctionReturn(0);
}

/*
   Finds the displacement v with the eigenvalue relative to the diagonal closest to -shift, kept rows clamped, by inverse iteration. *stiffness: this
   eigenvalue plus the shift. Collective on A
*/
static PetscErrorCode LatinSoftestShifted_Private(Mat A, IS kept, PetscReal shift, Vec v, PetscReal *stiffness)
{
  Mat          shifted;
  Vec          d;
  KSP          ksp;
  PC           pc;
  PetscReal    largest;
  PetscScalar *a;
  PetscInt     n;
  PetscBool    other;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompareAny((PetscObject)A, &other, MATMPISBAIJ, MATMPIDENSE, MATIS, ""));
  if (other) PetscCall(MatConvert(A, MATMPIAIJ, MAT_INITIAL_MATRIX, &shifted)); /* for LU */
  else PetscCall(MatDuplicate(A, MAT_COPY_VALUES, &shifted));
  if (kept) PetscCall(MatZeroRowsColumnsIS(shifted, kept, 1.0, NULL, NULL));
  PetscCall(VecDuplicate(v, &d));
  PetscCall(MatGetDiagonal(shifted, d));
  PetscCall(VecAbs(d));
  PetscCall(VecMax(d, NULL, &largest));
  PetscCall(VecGetLocalSize(d, &n));
  PetscCall(VecGetArray(d, &a));
  for (PetscInt i = 0; i < n; i++)
    if (a[i] == 0.0) a[i] = largest; /* dof orthogonal to all links of its node */
  PetscCall(VecRestoreArray(d, &a));
  PetscCall(VecScale(d, shift));
  PetscCall(MatDiagonalSet(shifted, d, ADD_VALUES));
  PetscCall(VecScale(d, 1.0 / shift));
  PetscCall(KSPCreate(PetscObjectComm((PetscObject)A), &ksp));
  PetscCall(KSPSetOptionsPrefix(ksp, "set_up_")); /* no user option shall match */
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(LatinDirectLU_Private(pc, shifted)); /* the copy may still be indefinite */
  PetscCall(MatSetOption(shifted, MAT_SPD, PETSC_FALSE));
  PetscCall(KSPSetOperators(ksp, shifted, shifted));
  PetscCall(LatinSoftest_Private(ksp, shifted, d, LATIN_INVERSE_STEPS, PETSC_MAX_REAL, v, stiffness));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(VecDestroy(&d));
  PetscCall(MatDestroy(&shifted));
  PetscFunctionReturn(0);
}

/*
   Finds a displacement v of zero stiffness of a matrix that could not be factored or, if there is none, of negative stiffness, by growing shifts.
   Collective on A
*/
static PetscErrorCode LatinSoftestFailed_Private(Mat A, IS kept, Vec v)
{
  PetscReal shift = LATIN_SHIFT, stiffness;

  PetscFunctionBegin;
  PetscCall(LatinSoftestShifted_Private(A, kept, shift, v, &stiffness));
  if (stiffness < 2.0 * shift) PetscFunctionReturn(0);
  while (shift < LATIN_SHIFT_MOST && stiffness >= shift) {
    shift *= LATIN_SHIFT_GROWS;
    PetscCall(LatinSoftestShifted_Private(A, kept, shift, v, &stiffness));
  }
  PetscFunctionReturn(0);
}

/* Factors A. With MUMPS in parallel, or with its pivots, the work space is increased until it is sufficient. Collective on A */
PetscErrorCode LatinFactorTry_Private(KSP ksp, Mat A, LatinFactorStatus *status)
{
  PC          pc;
  PetscMPIInt size;
  PetscBool   direct, pivots;
  Mat         factor = NULL;

  PetscFunctionBegin;
  PetscCall(LatinInterrupt_Private());
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)A), &size));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, &direct, PCCHOLESKY, PCLU, ""));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLU, &pivots));
  direct = (PetscBool)(pivots || (direct && size > 1));
  for (PetscInt room = LATIN_ROOM; room <= LATIN_ROOM_MOST; room *= 4) {
    if (direct) {
      PetscCall(PCFactorSetUpMatSolverType(pc));
      PetscCall(PCFactorGetMatrix(pc, &factor));
      PetscTryMethod(factor, "MatMumpsSetIcntl_C", (Mat, PetscInt, PetscInt), (factor, 14, room));
    }
    PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
    status->ierr = KSPSetUp(ksp);
    PetscCall(PetscPopErrorHandler());
    (void)LatinWatchWait_Private(PetscObjectComm((PetscObject)A), status->ierr); /* other ranks may still factor a parallel matrix */
    if (!status->ierr) PetscCall(PCGetFailedReason(pc, &status->failed));
    if (status->failed != PC_FACTOR_OUTMEMORY || !direct) break;
    PetscCall(PCReset(pc));
    PetscCall(KSPSetOperators(ksp, A, A));
  }
  PetscFunctionReturn(0);
}

/*
   Measures the contraction of the error by a step of iterative refinement with the factor, in the energy norm, kept rows clamped: the larger one of two
   steps, from a pseudorandom displacement in which all stiffnesses take part. Collective on A
*/
static PetscErrorCode LatinContraction_Private(KSP ksp, Mat A, IS kept, PetscReal *contraction)
{
  Vec         b, v, w;
  PC          pc;
  PetscScalar before, after;
  PetscReal   energy;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(MatCreateVecs(A, &v, &b));
  PetscCall(VecDuplicate(v, &w));
  PetscCall(MatGetDiagonal(A, w));
  PetscCall(VecSqrtAbs(w));
  PetscCall(LatinAnyVector_Private(b));
  PetscCall(VecPointwiseMult(b, b, w));
  if (kept) PetscCall(VecISSet(b, kept, 0.0));
  PetscCall(KSPSolve(ksp, b, v));
  PetscCall(VecDot(b, v, &before));
  *contraction = PETSC_SMALL;
  for (PetscInt k = 0; k < 2; k++) {
    PetscCall(MatMult(A, v, w));
    PetscCall(VecAXPY(b, -1.0, w));
    if (kept) PetscCall(VecISSet(b, kept, 0.0));
    if (k) {
      PetscCall(LatinCholeskyEnergy(pc, b, &energy)); /* the last solve needs the energy alone */
      after = energy;
    } else {
      PetscCall(KSPSolve(ksp, b, v));
      PetscCall(VecDot(b, v, &after));
    }
    *contraction = before > 0.0 && after >= 0.0 ? PetscMax(*contraction, PetscSqrtReal(after / before)) : 1.0;
    before       = after;
  }
  PetscCall(PetscInfo(ksp, "factor in single precision: a solve contracts the error to %g\n", (double)*contraction));
  PetscCall(VecDestroy(&b));
  PetscCall(VecDestroy(&v));
  PetscCall(VecDestroy(&w));
  PetscFunctionReturn(0);
}

/*
   Tests the factor, and factors again in higher precision until its contraction is small enough. *rounding: this contraction, 0 in double precision.
   Rounding affects soft displacements most, and a mechanism entirely: an accepted factor has no mechanism
*/
static PetscErrorCode LatinRounding_Private(KSP ksp, Mat A, IS kept, PetscReal *rounding)
{
  LatinArithmetic precision;
  PC              pc;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  for (*rounding = 0.0;; *rounding = 0.0) {
    PetscCall(LatinCholeskyPrecision(pc, &precision));
    if (precision == LATIN_DOUBLE) break;
    PetscCall(LatinContraction_Private(ksp, A, kept, rounding));
    if (*rounding < LATIN_ROUNDED_CONTRACTION) break;
    PetscCall(LatinCholeskyAgain(pc, A, precision - 1));
  }
  PetscFunctionReturn(0);
}

/*
   Checks the factor of A, or why there is none:

     failed             finds a displacement of zero or negative stiffness
     single precision   tests the precision, unless linear stages will, or a larger matrix was accepted in it or a lower one
     double precision   searches for a mechanism, unless a larger matrix has none
     not direct         no check

   Collective on A
*/
static PetscErrorCode LatinFactorCheck_Private(KSP ksp, Mat A, IS kept, Vec whole, PetscBool direct, const LatinArithmetic *larger, LatinFactorStatus *status)
{
  PetscReal       stiffness = 1.0;
  LatinArithmetic precision = LATIN_DOUBLE;
  PetscBool       accepted;
  PC              pc;
  Vec             v;

  PetscFunctionBegin;
  PetscCall(MatCreateVecs(A, &v, NULL));
  if (status->mechanism) PetscCall(LatinSoftestFailed_Private(A, kept, v));
  else if (direct) {
    PetscCall(KSPGetPC(ksp, &pc));
    PetscCall(LatinCholeskyPrecision(pc, &precision));
    accepted = (PetscBool)((kept && status->staged) || (larger && precision <= *larger));
    if (precision != LATIN_DOUBLE && accepted) status->rounding = PETSC_SMALL;
    else PetscCall(LatinRounding_Private(ksp, A, kept, &status->rounding));
    if (status->rounding == 0.0 && !larger) { /* in double precision, maybe after this test */
      PetscCall(LatinSoftest_Private(ksp, A, whole, 3, LATIN_INVERSE_FIRM * LATIN_MECHANISM, v, &stiffness));
      status->softest = stiffness;
    }
  }
  if (stiffness < LATIN_MECHANISM) status->mechanism = PETSC_TRUE;
  if (status->mechanism) status->mode = v;
  else PetscCall(VecDestroy(&v));
  PetscFunctionReturn(0);
}

/*
   Factors A through its KSP. A failure is recorded, not raised: other ranks may be waiting. The displacement of a mechanism, whether the factorisation
   failed or not, is returned in status->mode.

     kept:    rows of the Schur complement, ordered last, or NULL
     whole:   diagonal before the condensation that gave A, to which its rounding is relative, or NULL
     larger:  precision that needs no test, nor A a search for mechanisms: that of a larger matrix, of which A is a principal submatrix and so no
              softer; or NULL

   Collective on A
*/
PetscErrorCode LatinFactor_Private(KSP ksp, Mat A, IS kept, Vec whole, const LatinArithmetic *larger, LatinFactorStatus *status)
{
  PC        pc;
  PetscBool direct;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)pc, &direct, PCCHOLESKY, PCLU, PCREDUNDANT, ""));
  status->rounding = 0.0;
  PetscCall(LatinFactorTry_Private(ksp, A, status));
  status->mechanism = (PetscBool)(status->ierr == PETSC_ERR_MAT_CH_ZRPVT || status->ierr == PETSC_ERR_MAT_LU_ZRPVT || status->failed == PC_FACTOR_STRUCT_ZEROPIVOT || status->failed == PC_FACTOR_NUMERIC_ZEROPIVOT ||
                                  (status->failed != PC_NOERROR && status->failed != PC_FACTOR_OUTMEMORY && direct));
  if ((status->ierr || status->failed) && !status->mechanism) PetscFunctionReturn(0);
  if (status->provisional || (status->mechanism && status->tried)) PetscFunctionReturn(0);
  PetscCall(LatinFactorCheck_Private(ksp, A, kept, whole, direct, larger, status));
  PetscFunctionReturn(0);
}

/* Factors a sequential matrix again, in the next higher precision if it has the lowest one. A failure is recorded */
PetscErrorCode LatinFactorRefine_Private(KSP ksp, Mat A, IS kept, LatinArithmetic lowest, LatinFactorStatus *status)
{
  PC              pc;
  Mat             F;
  MatFactorError  failed;
  LatinArithmetic precision;

  PetscFunctionBegin;
  status->rounding = 0.0;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(LatinCholeskyPrecision(pc, &precision));
  PetscCall(LatinCholeskyAgain(pc, A, precision == lowest && precision != LATIN_DOUBLE ? precision - 1 : precision));
  PetscCall(PCFactorGetMatrix(pc, &F));
  PetscCall(MatFactorGetError(F, &failed));
  status->mechanism = (PetscBool)(failed != MAT_FACTOR_NOERROR);
  PetscCall(LatinFactorCheck_Private(ksp, A, kept, NULL, PETSC_TRUE, NULL, status));
  PetscFunctionReturn(0);
}
