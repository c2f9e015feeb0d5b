#include "latinimpl.h"

/*
   A coarse problem so small that every rank solves the whole of it by itself: what a parallel factor would send takes
   longer. The elements' operators are gathered once, their forces at each linear stage, and added in the order of the
   ranks: all of them have the same bits.
*/

#define LATIN_WHOLE       1500 /* most rows */
#define LATIN_WHOLE_DENSE 160  /* most rows of a dense matrix: a sparse one costs more in overhead than it saves */
#define LATIN_WHOLE_FULL  2    /* and of a larger one that has half of its entries */

/* Do the options say anything of a solver, "coarse_" for example, but what starts with `except`? */
PetscErrorCode LatinOptionsMention_Private(Latin latin, const char part[], const char except[], PetscBool *any)
{
  const char *prefix, *at;
  char       *all, name[256];
  size_t      length;

  PetscFunctionBegin;
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
  PetscCall(PetscSNPrintf(name, sizeof(name), "-%s%s", prefix ? prefix : "", part));
  PetscCall(PetscStrlen(name, &length));
  PetscCall(PetscOptionsGetAll(((PetscObject)latin)->options, &all));
  *any = PETSC_FALSE;
  for (at = strstr(all, name); at; at = strstr(at + length, name))
    if (!except || strncmp(at + length, except, strlen(except))) *any = PETSC_TRUE;
  PetscCall(PetscFree(all));
  PetscFunctionReturn(0);
}

/* Is the coarse problem to be solved as a whole by each of several ranks? Collective on latin */
PetscErrorCode LatinWholeWanted_Private(Latin latin, PetscBool *wanted)
{
  LatinCoarse         *coarse = &latin->coarse;
  const LatinElements *top    = &coarse->top;
  MPI_Comm             comm   = PetscObjectComm((PetscObject)latin);
  PetscInt64           work[2];
  PetscMPIInt          size;

  PetscFunctionBegin;
  *wanted = PETSC_FALSE;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size == 1 || !coarse->top_size || coarse->top_size > LATIN_WHOLE) PetscFunctionReturn(0);
  PetscCall(LatinOptionsMention_Private(latin, "coarse_", "groups", wanted));
  work[0] = *wanted ? 1 : 0;
  work[1] = 0;
  for (PetscInt s = 0; s < top->n; s++) work[1] += (PetscInt64)PetscSqr(top->offset[s + 1] - top->offset[s]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, work, 2, MPIU_INT64, MPI_SUM, comm));
  /* elements of very many dofs each: to send them all to all would be the larger work */
  *wanted = (PetscBool)(!work[0] && work[1] <= (PetscInt64)LATIN_WHOLE * LATIN_WHOLE);
  PetscFunctionReturn(0);
}

/* count[] of each rank, and where its part of all starts */
static PetscErrorCode LatinWholeCounts_Private(MPI_Comm comm, PetscInt mine, PetscMPIInt count[], PetscMPIInt first[])
{
  PetscMPIInt size, own;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMPIIntCast(mine, &own));
  PetscCallMPI(MPI_Allgather(&own, 1, MPI_INT, count, 1, MPI_INT, comm));
  first[0] = 0;
  for (PetscMPIInt r = 0; r < size; r++) first[r + 1] = first[r] + count[r];
  PetscFunctionReturn(0);
}

/* The sum of all elements' operators, dense and whole, n x n */
static PetscErrorCode LatinWholeGather_Private(Latin latin, PetscInt n, PetscScalar A[])
{
  LatinCoarse         *coarse = &latin->coarse;
  const LatinElements *top    = &coarse->top;
  MPI_Comm             comm   = PetscObjectComm((PetscObject)latin);
  PetscMPIInt          size, *count, *first;
  PetscInt            *mine, *m, values = 0, elements;
  PetscScalar         *out, *in, *next;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMalloc2(size, &count, size + 1, &first));
  PetscCall(PetscMalloc1(top->n + 1, &mine));
  for (PetscInt s = 0; s < top->n; s++) {
    mine[s] = top->offset[s + 1] - top->offset[s];
    values += mine[s] * (mine[s] + 1) / 2;
  }
  PetscCall(LatinWholeCounts_Private(comm, top->n, count, first));
  elements = first[size];
  PetscCall(PetscMalloc1(elements + 1, &m));
  PetscCallMPI(MPI_Allgatherv(mine, count[latin->coarse.whole_rank], MPIU_INT, m, count, first, MPIU_INT, comm));
  PetscCall(PetscFree(mine));
  PetscCall(LatinWholeCounts_Private(comm, values, count, first));
  PetscCall(PetscMalloc2(values, &out, first[size], &in));
  next = out;
  for (PetscInt s = 0; s < top->n; s++) {
    const PetscInt   width = top->offset[s + 1] - top->offset[s];
    const PetscReal *H     = top->H + top->h_offset[s];

    for (PetscInt j = 0; j < width; j++)
      for (PetscInt i = 0; i <= j; i++) *next++ = H[i + width * j];
  }
  PetscCallMPI(MPI_Allgatherv(out, count[latin->coarse.whole_rank], MPIU_SCALAR, in, count, first, MPIU_SCALAR, comm));
  next = in;
  for (PetscInt s = 0, at = 0; s < elements; at += m[s++]) {
    const PetscInt *row = coarse->whole_row + at;

    for (PetscInt j = 0; j < m[s]; j++)
      for (PetscInt i = 0; i <= j; i++, next++) {
        A[row[i] + n * row[j]] += *next;
        if (i < j) A[row[j] + n * row[i]] += *next;
      }
  }
  PetscCall(PetscFree2(out, in));
  PetscCall(PetscFree(m));
  PetscCall(PetscFree2(count, first));
  PetscFunctionReturn(0);
}

/* The matrix, on this rank alone: dense, or the upper part of a sparse one */
PetscErrorCode LatinWholeAssemble_Private(Latin latin)
{
  LatinCoarse         *coarse = &latin->coarse;
  const LatinElements *top    = &coarse->top;
  MPI_Comm             comm   = PetscObjectComm((PetscObject)latin);
  const PetscInt       n      = coarse->top_size;
  PetscInt             nz     = 0;
  PetscMPIInt          size;
  PetscScalar         *A;

  PetscFunctionBegin;
  coarse->whole = PETSC_TRUE;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCallMPI(MPI_Comm_rank(comm, &coarse->whole_rank));
  PetscCall(PetscMalloc2(size, &coarse->whole_count, size + 1, &coarse->whole_first));
  PetscCall(LatinWholeCounts_Private(comm, top->offset[top->n], coarse->whole_count, coarse->whole_first));
  PetscCall(PetscMalloc2(coarse->whole_first[size], &coarse->whole_row, coarse->whole_first[size], &coarse->whole_q));
  PetscCallMPI(MPI_Allgatherv(coarse->top_global, coarse->whole_count[coarse->whole_rank], MPIU_INT, coarse->whole_row, coarse->whole_count, coarse->whole_first, MPIU_INT, comm));
  PetscCall(PetscCalloc1(n * n, &A));
  PetscCall(LatinWholeGather_Private(latin, n, A));
  for (PetscInt k = 0; k < n * n; k++) nz += A[k] != 0.0 ? 1 : 0;
  if (n <= LATIN_WHOLE_DENSE || LATIN_WHOLE_FULL * nz >= n * n) {
    PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, n, n, A, &coarse->A));
    PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
    coarse->whole_a = A;
  } else {
    PetscCall(PetscMalloc2(n + 1, &coarse->whole_i, nz + n, &coarse->whole_j));
    PetscCall(PetscMalloc1(nz + n, &coarse->whole_a));
    nz = 0;
    for (PetscInt r = 0; r < n; r++) {
      coarse->whole_i[r] = nz;
      for (PetscInt c = r; c < n; c++)
        if (A[r + n * c] != 0.0 || c == r) {
          coarse->whole_j[nz]   = c;
          coarse->whole_a[nz++] = A[r + n * c];
        }
    }
    coarse->whole_i[n] = nz;
    PetscCall(PetscFree(A));
    PetscCall(MatCreateSeqSBAIJWithArrays(PETSC_COMM_SELF, 1, n, n, coarse->whole_i, coarse->whole_j, coarse->whole_a, &coarse->A));
  }
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* The package that factors it */
MatSolverType LatinWholePackage(Latin latin)
{
  return latin->coarse.whole_i ? MATSOLVERCHOLMOD : MATSOLVERPETSC;
}

/* The right-hand side b from the forces of the elements of all ranks. Collective on latin */
PetscErrorCode LatinWholeForces_Private(Latin latin, PetscScalar b[])
{
  LatinCoarse *coarse = &latin->coarse;
  MPI_Comm     comm   = PetscObjectComm((PetscObject)latin);
  PetscMPIInt  size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCallMPI(MPI_Allgatherv(coarse->top.q, coarse->whole_count[coarse->whole_rank], MPIU_SCALAR, coarse->whole_q, coarse->whole_count, coarse->whole_first, MPIU_SCALAR, comm));
  for (PetscMPIInt i = 0; i < coarse->whole_first[size]; i++) b[coarse->whole_row[i]] += coarse->whole_q[i];
  PetscFunctionReturn(0);
}

PetscErrorCode LatinWholeReset(Latin latin)
{
  LatinCoarse *coarse = &latin->coarse;

  PetscFunctionBegin;
  PetscCall(PetscFree2(coarse->whole_count, coarse->whole_first));
  PetscCall(PetscFree2(coarse->whole_row, coarse->whole_q));
  PetscCall(PetscFree2(coarse->whole_i, coarse->whole_j));
  PetscCall(PetscFree(coarse->whole_a));
  PetscFunctionReturn(0);
}
