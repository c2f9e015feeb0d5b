#include "coarse/latincoarse.h"

/*
   The coarse matrix: the homogenised stiffnesses of the subdomains, or of groups of them, added up (30), (52). Each rank adds
   up its own; what ranks share PETSc adds in the order of the ranks, the same bits twice.
*/

/* The elements' operators, added up in a matrix of this rank; at[]: where their dofs are in it. Entries come in the order of their columns: each row then grows at its end */
static PetscErrorCode LatinCoarseLocal_Private(const LatinElements *elements, PetscInt rows, const PetscInt at[], Mat *K)
{
  PetscInt    *count, *by, *to, widest = 0;
  PetscScalar *block;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(rows, &count));
  for (PetscInt s = 0; s < elements->n; s++) {
    widest = PetscMax(widest, elements->offset[s + 1] - elements->offset[s]);
    for (PetscInt i = elements->offset[s]; i < elements->offset[s + 1]; i++) count[at[i]] += elements->offset[s + 1] - elements->offset[s];
  }
  for (PetscInt i = 0; i < rows; i++) count[i] = PetscMin(count[i], rows); /* elements share columns */
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, rows, rows, 0, count, K));
  PetscCall(PetscMalloc3(widest, &by, widest, &to, widest * widest, &block));
  for (PetscInt s = 0; s < elements->n; s++) {
    const PetscInt   m = elements->offset[s + 1] - elements->offset[s], *from = at + elements->offset[s];
    const PetscReal *H = elements->H + elements->h_offset[s];

    for (PetscInt i = 0; i < m; i++) by[i] = i;
    PetscCall(PetscSortIntWithPermutation(m, from, by));
    for (PetscInt i = 0; i < m; i++) {
      to[i] = from[by[i]];
      for (PetscInt j = 0; j < m; j++) block[j + m * i] = H[by[j] + m * by[i]]; /* symmetric: by rows or columns alike */
    }
    PetscCall(MatSetValues(*K, m, to, m, to, block, ADD_VALUES));
  }
  PetscCall(PetscFree3(by, to, block));
  PetscCall(PetscFree(count));
  PetscCall(MatAssemblyBegin(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*K, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(0);
}

/* A, of which each rank has a part K with these global numbers. Collective on A */
static PetscErrorCode LatinCoarseSum_Private(Mat A, Mat K, const PetscInt number[])
{
  const PetscInt    *ki, *kj;
  PetscInt           n, *i, *j;
  PetscBool          done;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(MatGetRowIJ(K, 0, PETSC_FALSE, PETSC_FALSE, &n, &ki, &kj, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_PLIB, "The rows of the coarse matrix cannot be read");
  PetscCall(PetscMalloc2(ki[n], &i, ki[n], &j));
  for (PetscInt r = 0; r < n; r++)
    for (PetscInt k = ki[r]; k < ki[r + 1]; k++) {
      i[k] = number[r];
      j[k] = number[kj[k]];
    }
  PetscCall(MatSetPreallocationCOO(A, ki[n], i, j));
  PetscCall(PetscFree2(i, j));
  PetscCall(MatSeqAIJGetArrayRead(K, &a));
  PetscCall(MatSetValuesCOO(A, a, INSERT_VALUES));
  PetscCall(MatSeqAIJRestoreArrayRead(K, &a));
  PetscCall(MatRestoreRowIJ(K, 0, PETSC_FALSE, PETSC_FALSE, &n, &ki, &kj, &done));
  PetscFunctionReturn(0);
}

/* Sets coarse.A, sum_E c_E^t H_E c_E over the elements; apart: with the part of each rank by itself, a MATIS. Collective on sub->object */
PetscErrorCode LatinCoarseAssemble_Private(LatinCoarse *coarse, PetscBool apart)
{
  const LatinElements   *top     = &coarse->top;
  const PetscInt         entries = top->offset[top->n];
  MPI_Comm               comm    = PetscObjectComm(coarse->sub->object);
  PetscInt              *number, *at, n = entries;
  PetscMPIInt            ranks;
  ISLocalToGlobalMapping map;
  Mat                    K;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(PetscMalloc2(entries, &number, entries, &at));
  PetscCall(PetscArraycpy(number, coarse->top_global, entries));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  for (PetscInt i = 0; i < entries; i++) PetscCall(PetscFindInt(coarse->top_global[i], n, number, &at[i]));
  PetscCall(LatinCoarseLocal_Private(top, n, at, &K));
  if (apart) {
    PetscCall(ISLocalToGlobalMappingCreate(comm, 1, n, number, PETSC_COPY_VALUES, &map));
    PetscCall(MatCreateIS(comm, 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, &coarse->A));
    PetscCall(MatISSetLocalMat(coarse->A, K));
    PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(ISLocalToGlobalMappingDestroy(&map));
  } else if (ranks == 1) {
    PetscCall(PetscObjectReference((PetscObject)K));
    coarse->A = K;
  } else {
    PetscCall(MatCreate(comm, &coarse->A));
    PetscCall(MatSetSizes(coarse->A, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size));
    PetscCall(MatSetType(coarse->A, MATAIJ));
    PetscCall(LatinCoarseSum_Private(coarse->A, K, number));
  }
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscCall(MatDestroy(&K));
  PetscCall(PetscFree2(number, at));
  PetscFunctionReturn(0);
}
