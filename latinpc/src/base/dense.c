#include "base/dense.h"

/* Normalises v, scaled so that squares neither overflow nor underflow. Returns false, and writes nothing, if v is zero */
PetscBool LatinUnitVector(PetscInt dim, const PetscReal v[], PetscReal unit[])
{
  PetscReal scale = 0.0, length = 0.0;

  for (PetscInt c = 0; c < dim; c++) scale = PetscMax(scale, PetscAbsReal(v[c]));
  if (!(scale > 0.0)) return PETSC_FALSE;
  for (PetscInt c = 0; c < dim; c++) length += PetscSqr(v[c] / scale);
  length = PetscSqrtReal(length);
  for (PetscInt c = 0; c < dim; c++) unit[c] = v[c] / scale / length;
  return PETSC_TRUE;
}

/* Computes singular values s, decreasing, and right singular vectors, the columns of V (modes x modes), of A (rows x modes), from the R of its QR factors */
PetscErrorCode LatinSVD_Private(PetscInt rows, PetscInt modes, const PetscScalar A[], PetscReal s[], PetscScalar V[])
{
  PetscScalar *a, *tau, *vt, *work, dummy;
  PetscBLASInt m, n, ld, one = 1, lwork, info;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(modes, &n));
  PetscCall(PetscBLASIntCast(PetscMax(rows, modes), &m)); /* padded with zero rows to at least modes x modes */
  ld = m;
  PetscCall(PetscBLASIntCast(64 * modes, &lwork));
  PetscCall(PetscMalloc3(modes, &tau, modes * modes, &vt, lwork, &work));
  PetscCall(PetscCalloc1((size_t)m * (size_t)n, &a));
  for (PetscInt j = 0; j < modes; j++) PetscCall(PetscArraycpy(a + (size_t)m * (size_t)j, A + (size_t)rows * (size_t)j, rows));
  PetscCallBLAS("LAPACKgeqrf", LAPACKgeqrf_(&m, &n, a, &ld, tau, work, &lwork, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK geqrf failed on the modes of an interface (info %d)", (int)info);
  for (PetscInt j = 0; j < modes; j++)
    for (PetscInt i = j + 1; i < modes; i++) a[i + ld * j] = 0.0;
  PetscCallBLAS("LAPACKgesvd", LAPACKgesvd_("N", "A", &n, &n, a, &ld, s, &dummy, &one, vt, &n, work, &lwork, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK gesvd failed on the modes of an interface (info %d)", (int)info);
  for (PetscInt k = 0; k < modes; k++)
    for (PetscInt j = 0; j < modes; j++) V[j + modes * k] = vt[k + modes * j];
  PetscCall(PetscLogFlops(2.0 * m * n * n + 12.0 * n * n * n));
  PetscCall(PetscFree(a));
  PetscCall(PetscFree3(tau, vt, work));
  PetscFunctionReturn(0);
}

/* Computes out (rows x n): A (rows x modes) times the first n columns of V (modes x modes), each divided by its scale */
void LatinCombine_Private(PetscInt rows, PetscInt modes, PetscInt n, const PetscScalar A[], const PetscScalar V[], const PetscReal scale[], PetscScalar out[])
{
  for (PetscInt k = 0; k < n; k++) {
    for (PetscInt r = 0; r < rows; r++) out[r + rows * k] = 0.0;
    for (PetscInt j = 0; j < modes; j++)
      for (PetscInt r = 0; r < rows; r++) out[r + rows * k] += A[r + rows * j] * V[j + modes * k] / scale[k];
  }
}

/* Overwrites A by its lower Cholesky factor, zero above. Returns false if A is not positive definite. Plain loops: bits do not depend on its alignment */
PetscBool LatinCholesky(PetscInt n, PetscReal A[])
{
  for (PetscInt j = 0; j < n; j++) {
    for (PetscInt i = 0; i < j; i++) A[i + n * j] = 0.0;
    if (!(A[j + n * j] > 0.0) || PetscIsInfOrNanReal(A[j + n * j])) return PETSC_FALSE;
    A[j + n * j] = PetscSqrtReal(A[j + n * j]);
    for (PetscInt i = j + 1; i < n; i++) A[i + n * j] /= A[j + n * j];
    for (PetscInt k = j + 1; k < n; k++)
      for (PetscInt i = k; i < n; i++) A[i + n * k] -= A[i + n * j] * A[k + n * j];
  }
  return PETSC_TRUE;
}

/* Overwrites the symmetric matrix A, read from its lower half, by its inverse. Sets *bad if it is not positive definite */
PetscErrorCode LatinSPDInverse_Private(PetscInt n, PetscReal A[], PetscBool *bad)
{
  PetscBLASInt m, info = 0;

  PetscFunctionBegin;
  if (!n) PetscFunctionReturn(0);
  PetscCall(PetscBLASIntCast(n, &m));
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &m, A, &m, &info));
  if (!info) PetscCallBLAS("LAPACKpotri", LAPACKpotri_("L", &m, A, &m, &info));
  if (info) *bad = PETSC_TRUE;
  PetscCall(PetscLogFlops((PetscLogDouble)n * n * n));
  for (size_t j = 0; j < (size_t)n; j++)
    for (size_t i = 0; i < j; i++) A[i + (size_t)n * j] = A[j + (size_t)n * i];
  PetscFunctionReturn(0);
}

/*
   Eliminates the first `inside` unknowns of the symmetric matrix A, read from its lower half, in place: their columns become the Cholesky factor, the rest
   of that half the Schur complement. Sets *bad if the eliminated part is not positive definite
*/
PetscErrorCode LatinSchur_Private(PetscInt n, PetscInt inside, PetscReal A[], PetscBool *bad)
{
  const PetscScalar one = 1.0, minus = -1.0;
  PetscReal        *below = A + inside, *rest = below + (size_t)n * (size_t)inside;
  PetscBLASInt      bn, bi, bg, info = 0;

  PetscFunctionBegin;
  if (!inside) PetscFunctionReturn(0);
  PetscCall(PetscBLASIntCast(n, &bn));
  PetscCall(PetscBLASIntCast(inside, &bi));
  PetscCall(PetscBLASIntCast(n - inside, &bg));
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &bi, A, &bn, &info));
  if (info) *bad = PETSC_TRUE;
  if (info || !bg) PetscFunctionReturn(0);
  PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &bg, &bi, &one, A, &bn, below, &bn));
  PetscCallBLAS("BLASsyrk", BLASsyrk_("L", "N", &bg, &bi, &minus, below, &bn, &one, rest, &bn));
  PetscCall(PetscLogFlops((PetscLogDouble)bi * ((PetscLogDouble)bi * bi / 3.0 + (PetscLogDouble)bi * bg + (PetscLogDouble)bg * bg)));
  PetscFunctionReturn(0);
}

/* Unpacks a packed lower triangle (LatinLowerAt()) in place to the full symmetric matrix */
void LatinLowerMirror(PetscInt n, PetscReal A[])
{
  const size_t rows = (size_t)n;

  for (PetscInt c = n - 1; c >= 0; c--) /* backwards: no entry is overwritten before it has been moved */
    for (PetscInt r = n - 1; r >= c; r--) A[(size_t)r + rows * (size_t)c] = A[LatinLowerAt(n, c) + (size_t)r];
  for (PetscInt c = 0; c < n; c++)
    for (PetscInt r = 0; r < c; r++) A[(size_t)r + rows * (size_t)c] = A[(size_t)c + rows * (size_t)r];
}
