#include "coarse/latincoarse.h"

/* The coarse matrix: the homogenised stiffnesses of the subdomains, or of groups of them, added up (30), (52). */

/* A row of an element's operator as a record: row, length, columns, values; returns how long that is. record may be NULL */
static PetscInt LatinCoarseRecord(const LatinCoarse *coarse, PetscInt s, PetscInt i, PetscBool half, const PetscInt by[], PetscScalar record[])
{
  const LatinElements *top = &coarse->top;
  const PetscInt       m = top->offset[s + 1] - top->offset[s], first = half ? i : 0, n = m - first, *row = coarse->top_global + top->offset[s];
  const PetscReal     *H = top->H + top->h_offset[s];

  if (!record) return 2 + 2 * n;
  record[0] = row[by[i]];
  record[1] = n;
  for (PetscInt j = 0; j < n; j++) {
    record[2 + j]     = row[by[first + j]];
    record[2 + n + j] = H[by[first + j] + m * by[i]]; /* symmetric to the bit */
  }
  return 2 + 2 * n;
}

static PetscErrorCode LatinCoarseAdd_Private(Mat A, const PetscScalar record[], PetscInt column[], PetscInt *length)
{
  const PetscInt row = (PetscInt)PetscRealPart(record[0]), n = (PetscInt)PetscRealPart(record[1]);

  PetscFunctionBegin;
  for (PetscInt j = 0; j < n; j++) column[j] = (PetscInt)PetscRealPart(record[2 + j]);
  PetscCall(MatSetValues(A, 1, &row, n, column, record + 2 + n, ADD_VALUES));
  *length = 2 + 2 * n;
  PetscFunctionReturn(0);
}

/*
   Adds the elements' operators to A: rows of this rank, then those that other ranks send, in the order of the ranks.
   PETSc's own assembly adds what arrives first, so that sums of three and more are not the same bits twice.
*/
static PetscErrorCode LatinCoarseFill_Private(LatinCoarse *coarse, PetscBool half, const PetscInt order[], PetscInt widest)
{
  const LatinElements *top  = &coarse->top;
  MPI_Comm             comm = PetscObjectComm(coarse->sub->object);
  PetscMPIInt          rank, size, owner, *sends, *receives, *from, *to;
  PetscScalar         *out = NULL, *in = NULL, *record;
  PetscInt            *column, *next, length;
  PetscLayout          map;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_INT, MPI_MAX, comm));
  PetscCall(MatGetLayouts(coarse->A, &map, NULL));
  PetscCall(PetscCalloc5(size, &next, size, &sends, size, &receives, size + 1, &from, size + 1, &to));
  PetscCall(PetscMalloc2(widest, &column, 2 + 2 * widest, &record));
  for (PetscInt pass = 0; pass < 2; pass++) { /* the first one counts */
    for (PetscInt s = 0; s < top->n; s++) {
      const PetscInt *by = order + top->offset[s];

      for (PetscInt i = 0; i < top->offset[s + 1] - top->offset[s]; i++) {
        PetscCall(PetscLayoutFindOwner(map, coarse->top_global[top->offset[s] + by[i]], &owner));
        if (owner != rank) next[owner] += LatinCoarseRecord(coarse, s, i, half, by, pass ? out + next[owner] : NULL);
        else if (pass) {
          (void)LatinCoarseRecord(coarse, s, i, half, by, record);
          PetscCall(LatinCoarseAdd_Private(coarse->A, record, column, &length));
        }
      }
    }
    if (pass) break;
    for (PetscMPIInt r = 0; r < size; r++) PetscCall(PetscMPIIntCast(next[r], &sends[r]));
    PetscCallMPI(MPI_Alltoall(sends, 1, MPI_INT, receives, 1, MPI_INT, comm));
    for (PetscMPIInt r = 0; r < size; r++) {
      next[r] = to[r];
      PetscCall(PetscMPIIntCast((PetscInt)to[r] + sends[r], &to[r + 1]));
      PetscCall(PetscMPIIntCast((PetscInt)from[r] + receives[r], &from[r + 1]));
    }
    PetscCall(PetscMalloc2(to[size], &out, from[size], &in));
  }
  PetscCallMPI(MPI_Alltoallv(out, sends, to, MPIU_SCALAR, in, receives, from, MPIU_SCALAR, comm));
  for (PetscMPIInt k = 0; k < from[size]; k += (PetscMPIInt)length) PetscCall(LatinCoarseAdd_Private(coarse->A, in + k, column, &length));
  PetscCall(PetscFree2(out, in));
  PetscCall(PetscFree2(column, record));
  PetscCall(PetscFree5(next, sends, receives, from, to));
  PetscFunctionReturn(0);
}

/*
   Assembles sum_E c_E^t H_E c_E over the elements, of a symmetric matrix (half) the upper part. A row has at most as many
   entries as the elements of its dof have dofs, in half a matrix those of higher numbers. Entries come in the order of
   their columns: each row then grows at its end.
*/
PetscErrorCode LatinCoarseAssemble_Private(LatinCoarse *coarse, PetscBool half)
{
  const LatinElements *top  = &coarse->top;
  MPI_Comm             comm = PetscObjectComm(coarse->sub->object);
  const PetscInt       n    = coarse->top_local;
  PetscInt            *width, *bound, *outside, *order, widest = 0;

  PetscFunctionBegin;
  for (PetscInt s = 0; s < top->n; s++) widest = PetscMax(widest, top->offset[s + 1] - top->offset[s]);
  PetscCall(PetscMalloc4(top->offset[top->n], &width, top->offset[top->n], &order, n, &bound, n, &outside));
  PetscCall(PetscArrayzero(bound, n));
  for (PetscInt s = 0; s < top->n; s++) {
    const PetscInt m = top->offset[s + 1] - top->offset[s], *row = coarse->top_global + top->offset[s];
    PetscInt      *by = order + top->offset[s];

    for (PetscInt i = 0; i < m; i++) by[i] = i;
    PetscCall(PetscSortIntWithPermutation(m, row, by));
    for (PetscInt i = 0; i < m; i++) width[top->offset[s] + by[i]] = half ? m - i : m;
  }
  PetscCall(LatinSFReduce_Private(coarse->top_sf, 1, MPIU_INT, width, bound, MPI_SUM));
  for (PetscInt i = 0; i < n; i++) {
    outside[i] = PetscMin(bound[i], coarse->top_size - n);
    bound[i]   = PetscMin(bound[i], half ? n - i : n);
  }
  PetscCall(MatCreate(comm, &coarse->A));
  PetscCall(MatSetSizes(coarse->A, n, n, coarse->top_size, coarse->top_size));
  PetscCall(MatSetType(coarse->A, half ? MATSBAIJ : MATAIJ));
  PetscCall(MatXAIJSetPreallocation(coarse->A, 1, bound, outside, bound, outside));
  PetscCall(MatSetOption(coarse->A, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  PetscCall(LatinCoarseFill_Private(coarse, half, order, widest));
  PetscCall(PetscFree4(width, order, bound, outside));
  PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* The elements' operators, added up in a matrix of this rank; row[]: where their dofs are in it */
static PetscErrorCode LatinCoarseLocal_Private(const LatinElements *elements, PetscInt rows, const PetscInt row[], Mat *K)
{
  PetscInt *count;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(rows, &count));
  for (PetscInt s = 0; s < elements->n; s++)
    for (PetscInt i = elements->offset[s]; i < elements->offset[s + 1]; i++) count[row[i]] += elements->offset[s + 1] - elements->offset[s];
  for (PetscInt i = 0; i < rows; i++) count[i] = PetscMin(count[i], rows); /* elements share columns */
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, rows, rows, 0, count, K));
  for (PetscInt s = 0; s < elements->n; s++) {
    const PetscInt m = elements->offset[s + 1] - elements->offset[s], *at = row + elements->offset[s];

    PetscCall(MatSetValues(*K, m, at, m, at, elements->H + elements->h_offset[s], ADD_VALUES)); /* symmetric: by rows or columns alike */
  }
  PetscCall(MatAssemblyBegin(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(count));
  PetscFunctionReturn(0);
}

/* The same with the part of each rank by itself, a MATIS. Collective on coarse->sub->object */
PetscErrorCode LatinCoarseSubassemble_Private(LatinCoarse *coarse)
{
  const LatinElements   *top     = &coarse->top;
  const PetscInt         entries = top->offset[top->n];
  PetscInt              *number, *local, n = entries;
  ISLocalToGlobalMapping map;
  Mat                    K;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(entries, &number, entries, &local));
  PetscCall(PetscArraycpy(number, coarse->top_global, entries));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  for (PetscInt i = 0; i < entries; i++) PetscCall(PetscFindInt(coarse->top_global[i], n, number, &local[i]));
  PetscCall(LatinCoarseLocal_Private(top, n, local, &K));
  PetscCall(ISLocalToGlobalMappingCreate(PetscObjectComm(coarse->sub->object), 1, n, number, PETSC_COPY_VALUES, &map));
  PetscCall(MatCreateIS(PetscObjectComm(coarse->sub->object), 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, &coarse->A));
  PetscCall(MatISSetLocalMat(coarse->A, K));
  PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscCall(ISLocalToGlobalMappingDestroy(&map));
  PetscCall(MatDestroy(&K));
  PetscCall(PetscFree2(number, local));
  PetscFunctionReturn(0);
}
