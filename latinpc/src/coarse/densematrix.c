#include "base/room.h"
#include "coarse/latincoarse.h"

/*
   A coarse matrix that is full, as that of few subdomains on several ranks is: dense, its rows shared out evenly. The parts
   of the ranks go to the owners of their rows as dense blocks, which these add up in the order of the ranks.
*/

/* The rows that the parts of all ranks have, ascending */
typedef struct {
  PetscMPIInt *size, *start; /* [ranks] */
  PetscInt    *number;
} LatinParts;

static PetscErrorCode LatinPartsGather_Private(MPI_Comm comm, PetscInt n, const PetscInt number[], LatinParts *parts)
{
  PetscMPIInt ranks, mine, all = 0;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(PetscMPIIntCast(n, &mine));
  PetscCall(PetscMalloc2(ranks, &parts->size, ranks, &parts->start));
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_INT, parts->size, 1, MPI_INT, comm));
  for (PetscMPIInt q = 0; q < ranks; q++) {
    parts->start[q] = all;
    all += parts->size[q];
  }
  PetscCall(PetscMalloc1(all, &parts->number));
  PetscCallMPI(MPI_Allgatherv(number, mine, MPIU_INT, parts->number, parts->size, parts->start, MPIU_INT, comm));
  PetscFunctionReturn(0);
}

/* The first of n ascending numbers that is not less than a bound */
static PetscInt LatinPartsFrom(PetscInt n, const PetscInt number[], PetscInt bound)
{
  PetscInt low = 0;

  for (PetscInt high = n; low < high;) {
    const PetscInt middle = low + (high - low) / 2;

    if (number[middle] < bound) low = middle + 1;
    else high = middle;
  }
  return low;
}

/* The elements' operators added up, [n][n], the rows of each owner by themselves, column-major; first[ranks + 1]: of each owner */
static PetscErrorCode LatinPartsAdd_Private(const LatinElements *elements, PetscInt n, const PetscInt at[], PetscMPIInt ranks, const PetscInt first[], PetscScalar sum[])
{
  PetscInt *ld, *rows;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(n, &ld, n, &rows));
  for (PetscMPIInt q = 0; q < ranks; q++)
    for (PetscInt r = first[q]; r < first[q + 1]; r++) {
      ld[r]   = first[q + 1] - first[q];
      rows[r] = first[q];
    }
  for (PetscInt e = 0; e < elements->n; e++) {
    const PetscInt   m = elements->offset[e + 1] - elements->offset[e], *to = at + elements->offset[e];
    const PetscReal *H = elements->H + elements->h_offset[e];

    for (PetscInt j = 0; j < m; j++, H += m)
      for (PetscInt i = 0; i < m; i++) {
        const PetscInt r = to[i];

        sum[(size_t)rows[r] * (size_t)n + (size_t)(r - rows[r]) + (size_t)ld[r] * (size_t)to[j]] += H[i];
      }
  }
  PetscCall(PetscFree2(ld, rows));
  PetscFunctionReturn(0);
}

/* Blocks of rows go to their owners: sum as above, in: those of the ranks, one after the other. Collective on comm */
static PetscErrorCode LatinPartsExchange_Private(MPI_Comm comm, const LatinParts *parts, PetscInt n, const PetscInt first[], const PetscInt rows[], const PetscScalar sum[], PetscScalar in[])
{
  PetscMPIInt  ranks, rank, tag, length, requests = 0;
  MPI_Request *request;
  MPI_Comm     own;

  PetscFunctionBegin;
  PetscCall(PetscCommDuplicate(comm, &own, &tag));
  PetscCallMPI(MPI_Comm_size(own, &ranks));
  PetscCallMPI(MPI_Comm_rank(own, &rank));
  PetscCall(PetscMalloc1(2 * ranks, &request));
  for (PetscMPIInt q = 0; q < ranks; q++) {
    const size_t entries = (size_t)rows[q] * (size_t)parts->size[q];

    PetscCheck(entries <= (size_t)PETSC_MPI_INT_MAX, PETSC_COMM_SELF, PETSC_ERR_SUP, "A block of %g entries of the coarse matrix is too large for one message: make more subdomains, or name another coarse solver", (double)entries);
    PetscCall(PetscMPIIntCast((PetscInt)entries, &length));
    if (q == rank) PetscCall(PetscArraycpy(in, sum + (size_t)first[q] * (size_t)n, entries));
    else if (length) PetscCallMPI(MPI_Irecv(in, length, MPIU_SCALAR, q, tag, own, request + requests++));
    in += entries;
  }
  for (PetscMPIInt q = 0; q < ranks; q++) {
    PetscCall(PetscMPIIntCast((first[q + 1] - first[q]) * n, &length));
    if (q != rank && length) PetscCallMPI(MPI_Isend((void *)(sum + (size_t)first[q] * (size_t)n), length, MPIU_SCALAR, q, tag, own, request + requests++));
  }
  PetscCallMPI(MPI_Waitall(requests, request, MPI_STATUSES_IGNORE));
  PetscCall(PetscFree(request));
  PetscCall(PetscCommDestroy(&own));
  PetscFunctionReturn(0);
}

/* Adds a block of m rows of the part with these n numbers; row[]: its own ones */
static void LatinPartsPut(PetscInt m, const PetscInt row[], PetscInt n, const PetscInt number[], const PetscScalar block[], PetscInt start, PetscScalar a[], size_t lda)
{
  for (PetscInt c = 0; c < n; c++, block += m) {
    PetscScalar *to = a + lda * (size_t)number[c];

    for (PetscInt r = 0; r < m; r++) to[row[r] - start] += block[r];
  }
}

/* The values of A from the elements, whose dofs are the rows at[] of a part that has these numbers in A; operators that nothing else needs are freed. Collective on A */
static PetscErrorCode LatinCoarseFill_Private(const LatinElements *elements, LatinHomogenised *stiffness, PetscInt n, const PetscInt number[], const PetscInt at[], Mat A)
{
  MPI_Comm        comm = PetscObjectComm((PetscObject)A);
  PetscMPIInt     ranks;
  const PetscInt *range;
  PetscInt        start, end, lda, *first, *row, *rows;
  size_t          entries = 0;
  LatinParts      parts;
  PetscScalar    *sum, *in, *a, *block;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(MatGetOwnershipRanges(A, &range));
  PetscCall(MatGetOwnershipRange(A, &start, &end));
  PetscCall(LatinPartsGather_Private(comm, n, number, &parts));
  PetscCall(PetscMalloc3(ranks + 1, &first, ranks, &row, ranks, &rows));
  for (PetscMPIInt q = 0; q <= ranks; q++) first[q] = LatinPartsFrom(n, number, range[q]);
  for (PetscMPIInt q = 0; q < ranks; q++) {
    const PetscInt *theirs = parts.number + parts.start[q];

    row[q]  = LatinPartsFrom(parts.size[q], theirs, start);
    rows[q] = LatinPartsFrom(parts.size[q], theirs, end) - row[q];
    entries += (size_t)rows[q] * (size_t)parts.size[q];
  }
  PetscCall(PetscCalloc1((size_t)n * (size_t)n, &sum));
  PetscCall(LatinPartsAdd_Private(elements, n, at, ranks, first, sum));
  if (stiffness->once) PetscCall(PetscFree(stiffness->H));
  PetscCall(PetscMalloc1(entries, &in));
  PetscCall(LatinPartsExchange_Private(comm, &parts, n, first, rows, sum, in));
  PetscCall(PetscFree(sum));
  PetscCall(MatZeroEntries(A));
  PetscCall(MatDenseGetLDA(A, &lda));
  PetscCall(MatDenseGetArray(A, &a));
  block = in;
  for (PetscMPIInt q = 0; q < ranks; q++) {
    const PetscInt *theirs = parts.number + parts.start[q];

    LatinPartsPut(rows[q], theirs + row[q], parts.size[q], theirs, block, start, a, (size_t)lda);
    block += (size_t)rows[q] * (size_t)parts.size[q];
  }
  PetscCall(MatDenseRestoreArray(A, &a));
  PetscCall(PetscFree(in));
  LatinRoomReturn(entries * sizeof(*in)); /* before the factor comes */
  PetscCall(PetscFree3(first, row, rows));
  PetscCall(PetscFree(parts.number));
  PetscCall(PetscFree2(parts.size, parts.start));
  PetscFunctionReturn(0);
}

/* Sets coarse.A, as LatinCoarseAssemble_Private() does; takes number over. Collective on sub->object */
PetscErrorCode LatinCoarseFull_Private(LatinCoarse *coarse, LatinHomogenised *stiffness, PetscInt n, PetscInt number[], const PetscInt at[], PetscBool *same)
{
  MPI_Comm  comm  = PetscObjectComm(coarse->sub->object);
  PetscBool dense = PETSC_FALSE;

  PetscFunctionBegin;
  if (coarse->A) PetscCall(PetscObjectTypeCompare((PetscObject)coarse->A, MATMPIDENSE, &dense));
  *same = (PetscBool)(dense && coarse->parts == n);
  if (*same) PetscCall(PetscArraycmp(coarse->number, number, n, same));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, same, 1, LATIN_MPI_BOOL, MPI_LAND, comm));
  if (!*same) {
    PetscCall(MatDestroy(&coarse->A));
    PetscCall(MatDestroy(&coarse->part));
    PetscCall(MatCreateDense(comm, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, NULL, &coarse->A));
    PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
    PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  }
  PetscCall(LatinCoarseFill_Private(&coarse->top, stiffness, n, number, at, coarse->A));
  PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(coarse->number));
  coarse->number = number;
  coarse->parts  = n;
  PetscFunctionReturn(0);
}
