#include "subdomains/localmatrix.h"

/* The local matrix of a MATIS by compressed rows; check of its symmetry. */

#define LATIN_LOCAL_TILE 8 /* rows of a dense matrix that are compared together: a cache line */

/* Sets *is: whether a dense matrix is symmetric to the bit. Its columns are then read as rows */
static PetscErrorCode LatinLocalMatrixMirrored_Private(Mat K, PetscBool *is)
{
  const PetscScalar *a;
  PetscInt           n, lda;

  PetscFunctionBegin;
  PetscCall(MatGetSize(K, &n, NULL));
  PetscCall(MatDenseGetLDA(K, &lda));
  PetscCall(MatDenseGetArrayRead(K, &a));
  *is = (PetscBool)(lda == n && n <= PETSC_MAX_INT / PetscMax(n, 1)); /* a PetscInt must count the entries */
  for (PetscInt first = 0; first < n && *is; first += LATIN_LOCAL_TILE)
    for (PetscInt j = 0; j < n; j++)
      for (PetscInt i = first; i < PetscMin(first + LATIN_LOCAL_TILE, j); i++)
        if (!(a[(size_t)i + (size_t)n * (size_t)j] == a[(size_t)j + (size_t)n * (size_t)i])) *is = PETSC_FALSE;
  PetscCall(MatDenseRestoreArrayRead(K, &a));
  PetscFunctionReturn(0);
}

/* Makes the compressed rows of a dense matrix */
static PetscErrorCode LatinLocalMatrixRows_Private(LatinLocalMatrix *local)
{
  PetscInt n;

  PetscFunctionBegin;
  PetscCall(MatGetSize(local->K, &n, NULL));
  PetscCall(PetscMalloc2(n + 1, &local->first, (size_t)n * (size_t)n, &local->column));
  for (PetscInt r = 0; r <= n; r++) local->first[r] = r * n;
  for (PetscInt r = 0; r < n; r++)
    for (PetscInt c = 0; c < n; c++) local->column[local->first[r] + c] = c;
  local->rows = n;
  local->i    = local->first;
  local->j    = local->column;
  PetscCall(MatDenseGetArrayRead(local->K, &local->a));
  PetscFunctionReturn(0);
}

/* Gets the local matrix of A; LatinLocalMatrixRestore_Private() releases it. Collective on A */
PetscErrorCode LatinLocalMatrixGet_Private(Mat A, LatinLocalMatrix *local)
{
  ISLocalToGlobalMapping cols;
  PetscBool              aij, dense, done;
  Mat                    K;

  PetscFunctionBegin;
  PetscCall(MatISGetLocalToGlobalMapping(A, &local->map, &cols));
  LatinAgree(PetscObjectComm((PetscObject)A), local->map != cols, PETSC_ERR_SUP, "The rows and columns of the MATIS have different local-to-global maps: -pc_type latin is for symmetric matrices");
  PetscCall(ISLocalToGlobalMappingGetIndices(local->map, &local->global));
  PetscCall(MatISGetLocalMat(A, &K));
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQAIJ, &aij));
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQDENSE, &dense));
  local->K        = K;
  local->mirrored = PETSC_FALSE;
  if (dense) PetscCall(LatinLocalMatrixMirrored_Private(K, &local->mirrored));
  if (aij || local->mirrored) PetscCall(PetscObjectReference((PetscObject)K));
  else PetscCall(MatConvert(K, MATSEQAIJ, MAT_INITIAL_MATRIX, &local->K));
  PetscCall(MatISRestoreLocalMat(A, &K));
  if (local->mirrored) {
    PetscCall(LatinLocalMatrixRows_Private(local));
    PetscFunctionReturn(0);
  }
  PetscCall(MatGetRowIJ(local->K, 0, PETSC_FALSE, PETSC_FALSE, &local->rows, &local->i, &local->j, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_PLIB, "The rows of a local matrix cannot be read");
  PetscCall(MatSeqAIJGetArrayRead(local->K, &local->a));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLocalMatrixRestore_Private(LatinLocalMatrix *local)
{
  PetscInt  n;
  PetscBool done;

  PetscFunctionBegin;
  PetscCall(ISLocalToGlobalMappingRestoreIndices(local->map, &local->global));
  if (local->mirrored) {
    PetscCall(MatDenseRestoreArrayRead(local->K, &local->a));
    PetscCall(PetscFree2(local->first, local->column));
  } else {
    PetscCall(MatSeqAIJRestoreArrayRead(local->K, &local->a));
    PetscCall(MatRestoreRowIJ(local->K, 0, PETSC_FALSE, PETSC_FALSE, &n, &local->i, &local->j, &done));
  }
  PetscCall(MatDestroy(&local->K));
  PetscFunctionReturn(0);
}

/* Gets *value, the transposed entry of entry k of row r; 0: none */
PetscErrorCode LatinLocalMatrixAcross_Private(const LatinLocalMatrix *local, PetscInt r, PetscInt k, PetscReal *value)
{
  const PetscInt first = local->i[local->j[k]], last = local->i[local->j[k] + 1];
  PetscInt       at;

  PetscFunctionBegin;
  if (local->mirrored) {
    *value = local->a[k];
    PetscFunctionReturn(0);
  }
  PetscCall(PetscFindInt(r, last - first, local->j + first, &at));
  *value = at < 0 ? 0.0 : local->a[first + at];
  PetscFunctionReturn(0);
}

/*
   Fails on all ranks if the local matrix of any rank is not symmetric or not finite. Rows and columns of isolated unknowns are
   ignored, as of MatZeroRows(). Collective on A
*/
PetscErrorCode LatinLocalMatrixSymmetric_Private(Mat A, const LatinLocalMatrix *local, const PetscInt row_copy[])
{
  PetscReal *largest, value[2] = {0.0, 0.0};
  PetscInt   bad[2] = {-1, -1};
  PetscBool  known, symmetric;

  PetscFunctionBegin;
  PetscCall(MatIsSymmetricKnown(A, &known, &symmetric));
  LatinAgree(PetscObjectComm((PetscObject)A), known && !symmetric, PETSC_ERR_SUP, "The matrix is marked as not symmetric: -pc_type latin is for symmetric positive definite matrices");
  PetscCall(PetscCalloc1(local->rows, &largest));
  for (PetscInt r = 0; r < local->rows && bad[0] < 0; r++)
    for (PetscInt k = local->i[r]; k < local->i[r + 1] && bad[0] < 0; k++) {
      largest[r] = PetscMax(largest[r], PetscAbsScalar(local->a[k]));
      if (!PetscIsInfOrNanScalar(local->a[k])) continue;
      bad[0] = local->global[r];
      bad[1] = local->global[local->j[k]];
    }
  LatinAgree(PetscObjectComm((PetscObject)A), bad[0] >= 0, PETSC_ERR_FP, "The matrix has an entry that is not a finite number, at row %" PetscInt_FMT ", column %" PetscInt_FMT, bad[0], bad[1]);
  for (PetscInt r = 0; r < local->rows && bad[0] < 0 && !local->mirrored; r++)
    for (PetscInt k = local->i[r]; k < local->i[r + 1] && bad[0] < 0; k++) {
      const PetscInt c = local->j[k];

      if (c == r || row_copy[r] == LATIN_ROW_ISOLATED || row_copy[c] == LATIN_ROW_ISOLATED) continue;
      value[0] = local->a[k];
      PetscCall(LatinLocalMatrixAcross_Private(local, r, k, &value[1]));
      if (PetscAbsReal(value[0] - value[1]) > LATIN_MATRIX_ASYMMETRY * PetscMax(largest[r], largest[c])) {
        bad[0] = local->global[r];
        bad[1] = local->global[c];
      }
    }
  PetscCall(PetscFree(largest));
  LatinAgree(PetscObjectComm((PetscObject)A), bad[0] >= 0, PETSC_ERR_SUP,
             "A local matrix of the MATIS is not symmetric: %g at row %" PetscInt_FMT ", column %" PetscInt_FMT
             ", but %g at their exchange, a difference of %g. -pc_type latin needs symmetric local matrices: add up the matrices of elements, and impose boundary conditions with MatZeroRowsColumns(), not MatZeroRows()",
             (double)value[0], bad[0], bad[1], (double)value[1], (double)(value[1] - value[0]));
  PetscFunctionReturn(0);
}
