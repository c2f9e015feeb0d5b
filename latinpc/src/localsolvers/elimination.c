#include "localsolvers/latinlocalsolvers.h"

/*
   Dense Schur complement of a subdomain on its interfaces, for search directions and local low-energy fields: by dense algebra for small subdomains,
   else by a sparse factorisation.
*/

#define LATIN_ELIMINATE_DENSE 400 /* rows up to which dense algebra takes less time (tensegrity-grid 60 and network 8000 by METIS into 8 to 240) */

/* Computes F by a sparse factorisation of the given package, with Schur complement */
static PetscErrorCode LatinEliminateSparse_Private(const LatinSparse *A, MatSolverType package, PetscInt gamma, const PetscInt kept[], PetscReal F[], PetscBool *bad)
{
  Mat                K, factor, dense;
  MatFactorInfo      how;
  MatFactorError     failed;
  const PetscScalar *f;
  IS                 is;

  PetscFunctionBegin;
  PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, A->rows, A->rows, A->i, A->j, A->a, &K));
  PetscCall(MatSetBlockSize(K, A->bs));
  PetscCall(MatSetOption(K, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(K, MAT_SPD, PETSC_TRUE));
  PetscCall(MatGetFactor(K, package, MAT_FACTOR_CHOLESKY, &factor));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, gamma, kept, PETSC_USE_POINTER, &is));
  PetscCall(MatFactorSetSchurIS(factor, is));
  PetscCall(MatFactorInfoInitialize(&how));
  PetscCall(MatCholeskyFactorSymbolic(factor, K, NULL, &how));
  PetscCall(MatCholeskyFactorNumeric(factor, K, &how));
  PetscCall(MatFactorGetError(factor, &failed)); /* recorded, not raised */
  if (failed) *bad = PETSC_TRUE;
  PetscCall(MatFactorGetSchurComplement(factor, &dense, NULL));
  PetscCall(MatDenseGetArrayRead(dense, &f));
  for (PetscInt j = 0; j < gamma; j++)
    for (PetscInt i = j; i < gamma; i++) F[i + (size_t)gamma * (size_t)j] = F[j + (size_t)gamma * (size_t)i] = f[i + (size_t)gamma * (size_t)j];
  PetscCall(MatDenseRestoreArrayRead(dense, &f));
  PetscCall(MatFactorRestoreSchurComplement(factor, &dense, MAT_FACTOR_SCHUR_UNFACTORED));
  PetscCall(MatDestroy(&factor));
  PetscCall(MatDestroy(&K));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(0);
}

/* Computes F by dense algebra */
static PetscErrorCode LatinEliminateDense_Private(const LatinSparse *K, PetscInt gamma, const PetscInt kept[], PetscReal F[], PetscBool *bad)
{
  const PetscInt rows = K->rows, inside = rows - gamma;
  PetscInt      *place;
  PetscReal     *A;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(rows, &place));
  PetscCall(PetscCalloc1((size_t)rows * (size_t)rows, &A));
  for (PetscInt r = 0, k = 0; r < rows; r++) {
    const PetscBool stays = (PetscBool)(k < gamma && kept[k] == r);

    place[r] = stays ? inside + k : r - k;
    k += stays ? 1 : 0;
  }
  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt k = K->i[r]; k < K->i[r + 1]; k++) A[(size_t)place[r] + (size_t)rows * (size_t)place[K->j[k]]] = K->a[k];
  PetscCall(LatinSchur_Private(rows, inside, A, bad));
  for (PetscInt j = 0; j < gamma; j++)
    for (PetscInt i = j; i < gamma; i++) F[i + (size_t)gamma * (size_t)j] = F[j + (size_t)gamma * (size_t)i] = A[(size_t)(inside + i) + (size_t)rows * (size_t)(inside + j)];
  PetscCall(PetscFree(A));
  PetscCall(PetscFree(place));
  PetscFunctionReturn(0);
}

/*
   Computes F (gamma x gamma, column-major), the Schur complement of a symmetric matrix on its rows kept[gamma], increasing; symmetric to the bit. Sets
   *bad if the eliminated block is not positive definite.
*/
PetscErrorCode LatinEliminate_Private(const LatinSparse *K, PetscInt gamma, const PetscInt kept[], PetscReal F[], PetscBool *bad)
{
  const MatSolverType package[] = {LATIN_CHOLESKY, MATSOLVERMUMPS};
  PetscBool           found     = PETSC_FALSE;
  PetscInt            p         = 0;

  PetscFunctionBegin;
  if (K->rows > LATIN_ELIMINATE_DENSE && K->i[K->rows] < (PetscReal)K->rows * K->rows / 2)
    for (p = 0; p < 2; p++) {
      PetscCall(MatSolverTypeGet(package[p], MATSEQAIJ, MAT_FACTOR_CHOLESKY, NULL, &found, NULL));
      if (found) break;
    }
  if (found) PetscCall(LatinEliminateSparse_Private(K, package[p], gamma, kept, F, bad));
  else PetscCall(LatinEliminateDense_Private(K, gamma, kept, F, bad));
  PetscFunctionReturn(0);
}
