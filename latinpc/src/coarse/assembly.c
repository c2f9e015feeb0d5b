#include "coarse/latincoarse.h"

/*
   The coarse matrix: the homogenised stiffnesses of the subdomains, or of groups of them, added up (30), (52). Each rank adds
   up its own; what ranks share PETSc adds in the order of the ranks, the same bits twice.
*/

/* Where in offset[], dof by dof, the elements have each of the rows: start[rows + 1], list[entries] */
static void LatinCoarseTouching(const LatinElements *elements, PetscInt rows, const PetscInt at[], PetscInt start[], PetscInt list[])
{
  for (PetscInt r = 0; r < rows + 2; r++) start[r] = 0;
  for (PetscInt i = 0; i < elements->offset[elements->n]; i++) start[at[i] + 2]++;
  for (PetscInt r = 0; r < rows; r++) start[r + 2] += start[r + 1];
  for (PetscInt i = 0; i < elements->offset[elements->n]; i++) list[start[at[i] + 1]++] = i;
}

/*
   The elements' operators, added up by rows on this rank; at[]: where their dofs are. A row is added up in an array and
   goes to its column, for the matrix is symmetric: so the columns of each row come in order. upper: none left of the diagonal
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
  for (PetscInt pass = 0; pass < 2; pass++) { /* the first one counts */
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

/* The matrix of one rank with these rows */
static PetscErrorCode LatinCoarseMatrix_Private(const LatinCoarsePart *part, Mat *K)
{
  PetscFunctionBegin;
  PetscCall(MatCreate(PETSC_COMM_SELF, K));
  PetscCall(MatSetSizes(*K, part->rows, part->rows, part->rows, part->rows));
  PetscCall(MatSetType(*K, MATSEQAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(*K, part->i, part->j, part->a));
  PetscFunctionReturn(0);
}

/* Has each rank one operator that is all of its part? On all ranks or on none, for PETSc takes local matrices of one type. Collective on sub->object */
static PetscErrorCode LatinCoarseWhole_Private(const LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscInt rows, PetscBool *whole)
{
  const LatinElements *top = &coarse->top;

  PetscFunctionBegin;
  *whole = (PetscBool)((coarse->tree || coarse->second) && stiffness->once && !coarse->sub->preconditions); /* the same on all ranks */
  if (!*whole) PetscFunctionReturn(0);
  *whole = (PetscBool)(top->n == 1 && !coarse->levels && rows == top->offset[top->n]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, whole, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm(coarse->sub->object)));
  PetscFunctionReturn(0);
}

/* y = K x: one triangle of a dense matrix is read, where PETSc reads both */
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

/* The operator of the only element here as a dense matrix, which takes it over */
static PetscErrorCode LatinCoarseDense_Private(const LatinElements *top, LatinHomogenised *stiffness, Mat *K)
{
  const PetscInt rows = top->offset[1];

  PetscFunctionBegin;
  PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, rows, rows, stiffness->H, K)); /* without memory of its own */
  PetscCall(MatDenseReplaceArray(*K, stiffness->H));
  stiffness->H = NULL;
  PetscCall(MatSetOperation(*K, MATOP_MULT, (void (*)(void))LatinCoarseMult_Private));
  PetscCall(MatAssemblyBegin(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*K, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(0);
}

/* The lower triangle goes with the matrix that carries it */
static PetscErrorCode LatinCoarseLowerDestroy_Private(Mat K)
{
  PetscReal *H;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(K, &H));
  PetscCall(PetscFree(H));
  PetscFunctionReturn(0);
}

/* The same, its lower triangle alone, of which there are no products: it is read once, by the factor of the tree */
static PetscErrorCode LatinCoarseLower_Private(const LatinElements *top, LatinHomogenised *stiffness, Mat *K)
{
  const PetscInt rows = top->offset[1];

  PetscFunctionBegin;
  PetscCall(MatCreateShell(PETSC_COMM_SELF, rows, rows, rows, rows, stiffness->H, K));
  PetscCall(MatShellSetOperation(*K, MATOP_DESTROY, (void (*)(void))LatinCoarseLowerDestroy_Private));
  stiffness->H = NULL;
  PetscFunctionReturn(0);
}

/* The parts of the ranks with these global numbers, which it frees, added up in a new matrix. Collective on sub->object */
static PetscErrorCode LatinCoarseSum_Private(const LatinCoarse *coarse, LatinCoarsePart *part, const PetscInt number[], Mat *A)
{
  PetscLayout rows;

  PetscFunctionBegin;
  PetscCall(PetscLayoutCreateFromSizes(PetscObjectComm(coarse->sub->object), coarse->top_local, coarse->top_size, 1, &rows));
  PetscCall(LatinRowsSum_Private(rows, number, part, coarse->upper, A));
  PetscCall(PetscLayoutDestroy(&rows));
  PetscFunctionReturn(0);
}

/* Have the rows of two matrices of several ranks entries in the same places, on all ranks? Collective on A */
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

/* Several ranks: the sum of their parts, which it frees, in the matrix of the last set-up if it has the same places. Collective on sub->object */
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
    PetscCall(MatDestroy(&coarse->part)); /* of a set-up whose parts stayed by themselves: it is none of this matrix */
    PetscCall(PetscFree(coarse->number));
    coarse->A = sum;
  }
  PetscFunctionReturn(0);
}

/* The part of this rank is all of the matrix, or stays by itself in a MATIS: has it the rows and global numbers of the last set-up, on all ranks? A dense one has none. Collective on sub->object */
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

/* A new matrix of these parts, K that of this rank, whose global numbers it takes over. Collective on sub->object */
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
  if (coarse->apart || ranks > 1) {
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

/* One rank, or a MATIS. Takes number over, and frees the part; K: NULL, or the part as a dense matrix, which it takes over. Collective on sub->object */
static PetscErrorCode LatinCoarseApart_Private(LatinCoarse *coarse, LatinCoarsePart *part, Mat K, PetscInt number[], PetscBool *same)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinCoarseSame_Private(coarse, part, number, same));
  if (*same) {
    PetscCall(MatSeqAIJGetArrayWrite(coarse->part, &a));
    PetscCall(PetscArraycpy(a, part->a, part->i[part->rows]));
    PetscCall(MatSeqAIJRestoreArrayWrite(coarse->part, &a));
    PetscCall(PetscObjectStateIncrease((PetscObject)coarse->A)); /* an assembly would tell solvers of another pattern */
    PetscCall(PetscFree(number));
  } else {
    if (!K) PetscCall(LatinCoarseMatrix_Private(part, &K));
    PetscCall(LatinCoarseCreate_Private(coarse, K, part->rows, number));
  }
  PetscCall(LatinCoarsePartFree_Private(part));
  PetscFunctionReturn(0);
}

/*
   Sets coarse.A, sum_E c_E^t H_E c_E over the elements; apart, or tree: with the part of each rank by itself, a MATIS. *same: it is that of
   the last set-up with new values. Operators that nothing else needs are freed. Collective on sub->object
*/
PetscErrorCode LatinCoarseAssemble_Private(LatinCoarse *coarse, LatinHomogenised *stiffness, PetscBool *same)
{
  const LatinElements *top     = &coarse->top;
  const PetscInt       entries = top->offset[top->n];
  PetscInt            *number, *at, n = entries;
  PetscMPIInt          ranks;
  LatinCoarsePart      part;
  PetscBool            whole, lower;
  Mat                  K = NULL;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm(coarse->sub->object), &ranks));
  PetscCall(PetscMalloc1(entries, &number));
  PetscCall(PetscMalloc1(entries, &at));
  PetscCall(PetscArraycpy(number, coarse->top_global, entries));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  for (PetscInt i = 0; i < entries; i++) PetscCall(PetscFindInt(coarse->top_global[i], n, number, &at[i]));
  for (PetscInt s = 0; s < top->n; s++) PetscCall(PetscLogFlops(PetscSqr((PetscLogDouble)(top->offset[s + 1] - top->offset[s]))));
  PetscCall(LatinCoarseWhole_Private(coarse, stiffness, n, &whole));
  lower = (PetscBool)(whole && stiffness->lower && coarse->tree && coarse->status.provisional && coarse->top_size > LATIN_REDUNDANT); /* a small one gives products, see LatinCoarseSpend_Private() */
  if (stiffness->lower && !lower) LatinLowerMirror(entries, stiffness->H);
  if (whole) {
    PetscCall(PetscArraycpy(number, coarse->top_global, entries));
    if (lower) PetscCall(LatinCoarseLower_Private(top, stiffness, &K));
    else PetscCall(LatinCoarseDense_Private(top, stiffness, &K));
    part = (LatinCoarsePart){.rows = n};
  } else PetscCall(LatinCoarseLocal_Private(top, n, at, coarse->upper, &part));
  if (stiffness->once) PetscCall(PetscFree(stiffness->H));
  PetscCall(PetscFree(at));
  if (coarse->apart || coarse->tree || ranks == 1) PetscCall(LatinCoarseApart_Private(coarse, &part, K, number, same));
  else {
    PetscCall(LatinCoarseTogether_Private(coarse, &part, number, same));
    PetscCall(PetscFree(number));
  }
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscFunctionReturn(0);
}
