#include "coarse/latincoarse.h"

/*
   Assembly of the coarse matrix (30), (52) from the homogenised stiffnesses of subdomains or groups of them. Each rank assembles its
   own; rows that ranks share are added in the order of the ranks: results are reproducible to the bit.
*/

/* Lists the dofs of elements in each row: list[start[r]] to list[start[r + 1] - 1]. at[]: row of each dof; start has room for rows + 2 */
static void LatinCoarseTouching(const LatinElements *elements, PetscInt rows, const PetscInt at[], PetscInt start[], PetscInt list[])
{
  for (PetscInt r = 0; r < rows + 2; r++) start[r] = 0;
  for (PetscInt i = 0; i < elements->offset[elements->n]; i++) start[at[i] + 2]++;
  for (PetscInt r = 0; r < rows; r++) start[r + 2] += start[r + 1];
  for (PetscInt i = 0; i < elements->offset[elements->n]; i++) list[start[at[i] + 1]++] = i;
}

/*
   Assembles the operators of the elements of this rank; at[]: row of each of their dofs. Each row is summed in a dense array and, as the matrix is
   symmetric, stored as a column: so the columns of each row are sorted. upper: no entries left of the diagonal
*/
static PetscErrorCode LatinCoarseLocal_Private(const LatinElements *elements, PetscInt rows, const PetscInt at[], PetscBool upper, LatinCoarsePart *part)
{
  const PetscInt entries = elements->offset[elements->n];
  PetscInt      *start, *list, *of, *seen, *column, *next;
  PetscScalar   *sum;

  PetscFunctionBegin;
  PetscCall(PetscMalloc7(rows + 2, &start, entries, &list, entries, &of, rows, &seen, rows, &column, rows + 1, &next, rows, &sum));
  LatinCoarseTouching(elements, rows, at, start, list);
  for (PetscInt s = 0; s < elements->n; s++)
    for (PetscInt i = elements->offset[s]; i < elements->offset[s + 1]; i++) of[i] = s;
  *part = (LatinCoarsePart){.rows = rows};
  PetscCall(PetscMalloc1(rows + 1, &part->i));
  part->i[0] = 0;
  for (PetscInt pass = 0; pass < 2; pass++) { /* symbolic, then numeric */
    for (PetscInt r = 0; r < rows; r++) seen[r] = -1;
    for (PetscInt r = 0; r < rows; r++) {
      PetscInt n = 0, above = 0;

      for (PetscInt p = start[r]; p < start[r + 1]; p++) {
        const PetscInt   s = of[list[p]], first = elements->offset[s], m = elements->offset[s + 1] - first;
        const PetscReal *H = elements->H + elements->h_offset[s] + m * (list[p] - first);

        for (PetscInt j = 0; j < m; j++) {
          const PetscInt c = at[first + j];

          if (seen[c] != r) {
            seen[c]     = r;
            column[n++] = c;
            sum[c]      = H[j];
            above += c < r ? 1 : 0;
          } else sum[c] += H[j];
        }
      }
      if (!pass) part->i[r + 1] = part->i[r] + n - (upper ? above : 0);
      for (PetscInt k = 0; k < n && pass; k++) {
        if (upper && column[k] > r) continue;
        part->j[next[column[k]]]   = r;
        part->a[next[column[k]]++] = sum[column[k]];
      }
    }
    if (pass) break;
    PetscCall(PetscMalloc2(part->i[rows], &part->j, part->i[rows], &part->a));
    PetscCall(PetscArraycpy(next, part->i, rows + 1));
  }
  PetscCall(PetscFree7(start, list, of, seen, column, next, sum));
  PetscFunctionReturn(0);
}

/* Creates the sequential matrix K of a part */
static PetscErrorCode LatinCoarseMatrix_Private(const LatinCoarsePart *part, Mat *K)
{
  PetscFunctionBegin;
  PetscCall(MatCreate(PETSC_COMM_SELF, K));
  PetscCall(MatSetSizes(*K, part->rows, part->rows, part->rows, part->rows));
  PetscCall(MatSetType(*K, MATSEQAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(*K, part->i, part->j, part->a));
  PetscFunctionReturn(0);
}

/*
   Sets *whole: whether the part of each rank is the operator of one element, which then serves as it is. All ranks agree, as the local matrices of a
   MATIS have one type. Collective on sub->object
*/
static PetscErrorCode LatinCoarseWhole_Private(const LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscInt rows, PetscBool *whole)
{
  const LatinElements *top = &coarse->top;

  PetscFunctionBegin;
  *whole = (PetscBool)((coarse->tree || coarse->second_level) && stiffness->once && !coarse->sub->preconditions); /* the same on all ranks */
  if (!*whole) PetscFunctionReturn(0);
  *whole = (PetscBool)(top->n == 1 && !coarse->levels && rows == top->offset[top->n]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, whole, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm(coarse->sub->object)));
  PetscFunctionReturn(0);
}

/* Computes y = K x from the lower triangle of a dense matrix; PETSc's own product reads both */
static PetscErrorCode LatinCoarseMult_Private(Mat K, Vec x, Vec y)
{
  const PetscScalar *a, *from, one = 1.0, zero = 0.0;
  const PetscBLASInt inc = 1;
  PetscScalar       *to;
  PetscInt           rows;
  PetscBLASInt       n;

  PetscFunctionBegin;
  PetscCall(MatGetSize(K, &rows, NULL));
  PetscCall(PetscBLASIntCast(rows, &n));
  PetscCall(MatDenseGetArrayRead(K, &a));
  PetscCall(VecGetArrayRead(x, &from));
  PetscCall(VecGetArrayWrite(y, &to));
  if (n) PetscCallBLAS("BLASsymv", LatinBLASsymv_("L", &n, &one, a, &n, from, &inc, &zero, to, &inc));
  PetscCall(VecRestoreArrayWrite(y, &to));
  PetscCall(VecRestoreArrayRead(x, &from));
  PetscCall(MatDenseRestoreArrayRead(K, &a));
  PetscCall(PetscLogFlops(2.0 * (PetscLogDouble)n * n));
  PetscFunctionReturn(0);
}

/* Makes K from the operator of the only element here: a dense matrix, which takes over the memory */
static PetscErrorCode LatinCoarseDense_Private(const LatinElements *top, LatinHomogenised *stiffness, Mat *K)
{
  const PetscInt rows = top->offset[1];

  PetscFunctionBegin;
  PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, rows, rows, stiffness->H, K)); /* allocates nothing */
  PetscCall(MatDenseReplaceArray(*K, stiffness->H));
  stiffness->H = NULL;
  PetscCall(MatSetOperation(*K, MATOP_MULT, (void (*)(void))LatinCoarseMult_Private));
  PetscCall(MatAssemblyBegin(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*K, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(0);
}

/* Frees the lower triangle with its matrix */
static PetscErrorCode LatinCoarseLowerDestroy_Private(Mat K)
{
  PetscReal *H;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(K, &H));
  PetscCall(PetscFree(H));
  PetscFunctionReturn(0);
}

/* The same, as a shell with the packed lower triangle alone and without product: only the factorisation of coarse/tree.h reads it */
static PetscErrorCode LatinCoarseLower_Private(const LatinElements *top, LatinHomogenised *stiffness, Mat *K)
{
  const PetscInt rows = top->offset[1];

  PetscFunctionBegin;
  PetscCall(MatCreateShell(PETSC_COMM_SELF, rows, rows, rows, rows, stiffness->H, K));
  PetscCall(MatShellSetOperation(*K, MATOP_DESTROY, (void (*)(void))LatinCoarseLowerDestroy_Private));
  stiffness->H = NULL;
  PetscFunctionReturn(0);
}

/* Assembles A, the sum of the parts of the ranks, rows number[] of A. Frees the part. Collective on sub->object */
static PetscErrorCode LatinCoarseSum_Private(const LatinCoarse *coarse, LatinCoarsePart *part, const PetscInt number[], Mat *A)
{
  PetscLayout rows;

  PetscFunctionBegin;
  PetscCall(PetscLayoutCreateFromSizes(PetscObjectComm(coarse->sub->object), coarse->top_local, coarse->top_size, 1, &rows));
  PetscCall(LatinRowsSum_Private(rows, number, part, coarse->upper, A));
  PetscCall(PetscLayoutDestroy(&rows));
  PetscFunctionReturn(0);
}

/* Sets *same: whether two distributed matrices have the same type and sparsity pattern. Collective on A */
static PetscErrorCode LatinCoarseSamePlaces_Private(Mat A, Mat B, PetscBool upper, PetscBool *same)
{
  PetscInt        first[2], last[2], n, m;
  const PetscInt *i, *j;
  MatType         type;

  PetscFunctionBegin;
  PetscCall(MatGetType(A, &type));
  PetscCall(PetscObjectTypeCompare((PetscObject)B, type, same));
  if (!*same) PetscFunctionReturn(0); /* on all ranks */
  PetscCall(MatGetOwnershipRange(A, &first[0], &last[0]));
  PetscCall(MatGetOwnershipRange(B, &first[1], &last[1]));
  if (first[0] != first[1] || last[0] != last[1]) *same = PETSC_FALSE;
  if (upper) {
    PetscCall(MatGetRowUpperTriangular(A));
    PetscCall(MatGetRowUpperTriangular(B));
  }
  for (PetscInt r = first[0]; r < last[0] && *same; r++) {
    PetscCall(MatGetRow(A, r, &n, &i, NULL));
    PetscCall(MatGetRow(B, r, &m, &j, NULL));
    if (n != m) *same = PETSC_FALSE;
    else PetscCall(PetscArraycmp(i, j, n, same));
    PetscCall(MatRestoreRow(B, r, &m, &j, NULL));
    PetscCall(MatRestoreRow(A, r, &n, &i, NULL));
  }
  if (upper) {
    PetscCall(MatRestoreRowUpperTriangular(B));
    PetscCall(MatRestoreRowUpperTriangular(A));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, same, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)A)));
  PetscFunctionReturn(0);
}

/* Assembles coarse->A on several ranks, in the matrix of the last set-up if the pattern is the same. Frees the part. Collective on sub->object */
static PetscErrorCode LatinCoarseTogether_Private(LatinCoarse *coarse, LatinCoarsePart *part, const PetscInt number[], PetscBool *same)
{
  Mat sum;

  PetscFunctionBegin;
  *same = PETSC_FALSE;
  PetscCall(LatinCoarseSum_Private(coarse, part, number, &sum));
  if (coarse->A) PetscCall(LatinCoarseSamePlaces_Private(sum, coarse->A, coarse->upper, same));
  if (*same) {
    PetscCall(MatCopy(sum, coarse->A, SAME_NONZERO_PATTERN));
    PetscCall(MatDestroy(&sum));
  } else {
    PetscCall(MatDestroy(&coarse->A));
    PetscCall(MatDestroy(&coarse->part)); /* left from a set-up with a MATIS */
    PetscCall(PetscFree(coarse->number));
    coarse->A = sum;
  }
  PetscFunctionReturn(0);
}

/*
   Sets *same: whether the part, as local matrix of a MATIS or matrix of one rank, has the pattern and global numbers of the last set-up, on all ranks;
   false for a dense part. Collective on sub->object
*/
static PetscErrorCode LatinCoarseSame_Private(const LatinCoarse *coarse, const LatinCoarsePart *part, const PetscInt number[], PetscBool *same)
{
  PetscInt rows;

  PetscFunctionBegin;
  *same = PETSC_FALSE;
  if (!coarse->part) PetscFunctionReturn(0); /* on all ranks */
  PetscCall(PetscObjectTypeCompare((PetscObject)coarse->part, MATSEQAIJ, same));
  if (!part->i || coarse->parts != part->rows) *same = PETSC_FALSE;
  if (*same) PetscCall(PetscArraycmp(coarse->number, number, part->rows, same));
  if (*same) PetscCall(LatinSameRows_Private(coarse->part, part->rows, part->i, part->j, same));
  PetscCall(MatGetLocalSize(coarse->A, &rows, NULL));
  if (rows != coarse->top_local) *same = PETSC_FALSE;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, same, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm(coarse->sub->object)));
  PetscFunctionReturn(0);
}

/* Creates coarse->A with local matrix K. Takes over K and its global numbers number[rows]. Collective on sub->object */
static PetscErrorCode LatinCoarseCreate_Private(LatinCoarse *coarse, Mat K, PetscInt rows, PetscInt number[])
{
  MPI_Comm               comm = PetscObjectComm(coarse->sub->object);
  PetscMPIInt            ranks;
  ISLocalToGlobalMapping map;

  PetscFunctionBegin;
  PetscCall(MatDestroy(&coarse->A));
  PetscCall(MatDestroy(&coarse->part));
  PetscCall(PetscFree(coarse->number));
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  coarse->part   = K;
  coarse->parts  = rows;
  coarse->number = number;
  if (coarse->unassembled || ranks > 1) {
    PetscCall(ISLocalToGlobalMappingCreate(comm, 1, rows, number, PETSC_COPY_VALUES, &map));
    PetscCall(MatCreateIS(comm, 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, &coarse->A));
    PetscCall(MatISSetLocalMat(coarse->A, coarse->part));
    PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(ISLocalToGlobalMappingDestroy(&map));
  } else {
    PetscCall(PetscObjectReference((PetscObject)coarse->part));
    coarse->A = coarse->part;
  }
  PetscFunctionReturn(0);
}

/*
   Makes coarse->A on one rank or as a MATIS, with new values if the pattern is that of the last set-up. K: NULL, or the part as a dense matrix. Takes
   over number[] and K, frees the part. Collective on sub->object
*/
static PetscErrorCode LatinCoarseApart_Private(LatinCoarse *coarse, LatinCoarsePart *part, Mat K, PetscInt number[], PetscBool *same)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinCoarseSame_Private(coarse, part, number, same));
  if (*same) {
    PetscCall(MatSeqAIJGetArrayWrite(coarse->part, &a));
    PetscCall(PetscArraycpy(a, part->a, part->i[part->rows]));
    PetscCall(MatSeqAIJRestoreArrayWrite(coarse->part, &a));
    PetscCall(PetscObjectStateIncrease((PetscObject)coarse->A)); /* an assembly would announce a new pattern */
    PetscCall(PetscFree(number));
  } else {
    if (!K) PetscCall(LatinCoarseMatrix_Private(part, &K));
    PetscCall(LatinCoarseCreate_Private(coarse, K, part->rows, number));
  }
  PetscCall(LatinCoarsePartFree_Private(part));
  PetscFunctionReturn(0);
}

/*
   Raises the diagonal of a part, or of K if it is dense, to half the stiffness of a mechanism, which is still found. Of pieces that hang on a single
   node rounding alone is left, and need not be positive semidefinite, as solvers for a MATIS demand of each local matrix. at[]: row of each dof
*/
static PetscErrorCode LatinCoarseRaise_Private(const LatinElements *top, const PetscInt at[], Mat K, LatinCoarsePart *part)
{
  const PetscInt n = part->rows;
  PetscReal     *least;
  PetscScalar   *a;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(n, &least));
  for (PetscInt i = 0; i < top->offset[top->n]; i++) least[at[i]] += 0.5 * LATIN_MECHANISM * top->whole[i];
  for (PetscInt r = 0; r < n && !K; r++)
    for (PetscInt k = part->i[r]; k < part->i[r + 1]; k++)
      if (part->j[k] == r) part->a[k] = PetscMax(part->a[k], least[r]);
  if (K) {
    PetscCall(MatDenseGetArray(K, &a));
    for (PetscInt r = 0; r < n; r++) a[(size_t)r * ((size_t)n + 1)] = PetscMax(a[(size_t)r * ((size_t)n + 1)], least[r]);
    PetscCall(MatDenseRestoreArray(K, &a));
  }
  PetscCall(PetscFree(least));
  PetscFunctionReturn(0);
}

/*
   Sets coarse->A, the sum of c_E^t H_E c_E over the elements, as a MATIS if coarse->unassembled or coarse->tree. *same: it is the matrix of the last
   set-up with new values. Frees operators that are no longer needed. Collective on sub->object
*/
PetscErrorCode LatinCoarseAssemble_Private(LatinCoarse *coarse, LatinHomogenised *stiffness, PetscBool *same)
{
  const LatinElements *top     = &coarse->top;
  const PetscInt       entries = top->offset[top->n];
  PetscInt            *number, *at, n;
  PetscMPIInt          ranks;
  LatinCoarsePart      part;
  PetscBool            whole, lower;
  Mat                  K = NULL;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm(coarse->sub->object), &ranks));
  PetscCall(PetscMalloc1(entries, &number));
  PetscCall(PetscMalloc1(entries, &at));
  PetscCall(LatinPlaces_Private(entries, coarse->top_global, &n, number, at));
  for (PetscInt s = 0; s < top->n; s++) PetscCall(PetscLogFlops(PetscSqr((PetscLogDouble)(top->offset[s + 1] - top->offset[s]))));
  PetscCall(LatinCoarseWhole_Private(coarse, stiffness, n, &whole));
  lower = (PetscBool)(whole && stiffness->lower && coarse->tree && coarse->status.provisional && coarse->top_size > LATIN_COARSE_KEPT); /* a small matrix needs products, see LatinCoarseReleaseLocal_Private() */
  if (stiffness->lower && !lower) LatinLowerMirror(entries, stiffness->H);
  if (whole) {
    PetscCall(PetscArraycpy(number, coarse->top_global, entries));
    if (lower) PetscCall(LatinCoarseLower_Private(top, stiffness, &K));
    else PetscCall(LatinCoarseDense_Private(top, stiffness, &K));
    part = (LatinCoarsePart){.rows = n};
  } else PetscCall(LatinCoarseLocal_Private(top, n, at, coarse->upper, &part));
  if (coarse->unassembled) PetscCall(LatinCoarseRaise_Private(top, at, K, &part));
  if (stiffness->once) PetscCall(PetscFree(stiffness->H));
  PetscCall(PetscFree(at));
  if (coarse->unassembled || coarse->tree || ranks == 1) PetscCall(LatinCoarseApart_Private(coarse, &part, K, number, same));
  else {
    PetscCall(LatinCoarseTogether_Private(coarse, &part, number, same));
    PetscCall(PetscFree(number));
  }
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscFunctionReturn(0);
}
