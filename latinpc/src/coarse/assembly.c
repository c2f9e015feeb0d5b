#include "coarse/latincoarse.h"

/*
   The coarse matrix: the homogenised stiffnesses of the subdomains, or of groups of them, added up (30), (52). Each rank adds
   up its own; what ranks share is added in coarse/rows.c.
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
   The elements' operators, added up in compressed rows of this rank; at[]: where their dofs are in them. A row is added up in an
   array and goes to its column, for the matrix is symmetric: so the columns of each row come in order.
*/
static PetscErrorCode LatinCoarseLocal_Private(const LatinElements *elements, PetscInt rows, const PetscInt at[], PetscInt **i, PetscInt **j, PetscScalar **a)
{
  const PetscInt entries = elements->offset[elements->n];
  PetscInt      *start, *list, *of, *seen, *column, *next, *ki, *kj;
  PetscScalar   *sum, *ka = NULL;

  PetscFunctionBegin;
  PetscCall(PetscMalloc7(rows + 2, &start, entries, &list, entries, &of, rows, &seen, rows, &column, rows + 1, &next, rows, &sum));
  LatinCoarseTouching(elements, rows, at, start, list);
  for (PetscInt s = 0; s < elements->n; s++)
    for (PetscInt i = elements->offset[s]; i < elements->offset[s + 1]; i++) of[i] = s;
  PetscCall(PetscMalloc1(rows + 1, &ki));
  ki[0] = 0;
  kj    = NULL;
  for (PetscInt pass = 0; pass < 2; pass++) { /* the first one counts */
    for (PetscInt r = 0; r < rows; r++) seen[r] = -1;
    for (PetscInt r = 0; r < rows; r++) {
      PetscInt n = 0;

      for (PetscInt p = start[r]; p < start[r + 1]; p++) {
        const PetscInt   s = of[list[p]], first = elements->offset[s], m = elements->offset[s + 1] - first;
        const PetscReal *H = elements->H + elements->h_offset[s] + m * (list[p] - first);

        for (PetscInt j = 0; j < m; j++) {
          const PetscInt c = at[first + j];

          if (seen[c] != r) {
            seen[c]     = r;
            column[n++] = c;
            sum[c]      = H[j];
          } else sum[c] += H[j];
        }
      }
      if (!pass) ki[r + 1] = ki[r] + n;
      for (PetscInt k = 0; k < n && pass; k++) {
        kj[next[column[k]]]   = r;
        ka[next[column[k]]++] = sum[column[k]];
      }
    }
    if (pass) break;
    PetscCall(PetscMalloc2(ki[rows], &kj, ki[rows], &ka));
    PetscCall(PetscArraycpy(next, ki, rows + 1));
  }
  PetscCall(PetscFree7(start, list, of, seen, column, next, sum));
  *i = ki;
  *j = kj;
  *a = ka;
  PetscFunctionReturn(0);
}

/* The same as a matrix of this rank; frees the rows */
static PetscErrorCode LatinCoarseMatrix_Private(PetscInt rows, PetscInt *ki, PetscInt *kj, PetscScalar *ka, Mat *K)
{
  PetscFunctionBegin;
  PetscCall(MatCreate(PETSC_COMM_SELF, K));
  PetscCall(MatSetSizes(*K, rows, rows, rows, rows));
  PetscCall(MatSetType(*K, MATSEQAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(*K, ki, kj, ka));
  PetscCall(PetscFree2(kj, ka));
  PetscCall(PetscFree(ki));
  PetscFunctionReturn(0);
}

/* Sets coarse.A, sum_E c_E^t H_E c_E over the elements; apart: with the part of each rank by itself, a MATIS. Collective on sub->object */
PetscErrorCode LatinCoarseAssemble_Private(LatinCoarse *coarse, PetscBool apart)
{
  const LatinElements   *top     = &coarse->top;
  const PetscInt         entries = top->offset[top->n];
  MPI_Comm               comm    = PetscObjectComm(coarse->sub->object);
  PetscInt              *number, *at, *ki = NULL, *kj = NULL, n = entries;
  PetscScalar           *ka = NULL;
  PetscLayout            rows;
  PetscMPIInt            ranks;
  ISLocalToGlobalMapping map;
  Mat                    K;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(PetscMalloc2(entries, &number, entries, &at));
  PetscCall(PetscArraycpy(number, coarse->top_global, entries));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  for (PetscInt i = 0; i < entries; i++) PetscCall(PetscFindInt(coarse->top_global[i], n, number, &at[i]));
  PetscCall(LatinCoarseLocal_Private(top, n, at, &ki, &kj, &ka));
  if (apart) {
    PetscCall(LatinCoarseMatrix_Private(n, ki, kj, ka, &K));
    PetscCall(ISLocalToGlobalMappingCreate(comm, 1, n, number, PETSC_COPY_VALUES, &map));
    PetscCall(MatCreateIS(comm, 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, &coarse->A));
    PetscCall(MatISSetLocalMat(coarse->A, K));
    PetscCall(MatDestroy(&K));
    PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(ISLocalToGlobalMappingDestroy(&map));
  } else if (ranks == 1) {
    PetscCall(LatinCoarseMatrix_Private(n, ki, kj, ka, &coarse->A));
  } else {
    PetscCall(PetscLayoutCreateFromSizes(comm, coarse->top_local, coarse->top_size, 1, &rows));
    PetscCall(LatinRowsSum_Private(rows, n, number, ki, kj, ka, &coarse->A));
    PetscCall(PetscLayoutDestroy(&rows));
  }
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscCall(PetscFree2(number, at));
  PetscFunctionReturn(0);
}
