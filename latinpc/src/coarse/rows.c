#include "coarse/latincoarse.h"

/*
   Assembly of a distributed matrix from overlapping parts:

   1. Each rank sends whole compressed rows to their owners.
   2. An owner adds them in the order of the ranks: reproducible to the bit.

   PETSc's COO assembly would store several numbers for each entry.
*/

/* Rows received from one rank */
typedef struct {
  PetscMPIInt  rank;
  PetscInt     rows, next; /* number of rows; next one to add, or, before the exchange, number of entries */
  PetscInt    *info, *j;   /* [rows][2] global number and length of each row; columns */
  PetscScalar *a;
} LatinRows;

/* Lists the messages to send: *count owners to[], ascending; of each the number of rows and entries size[][2] and the first row first[]. number[n] ascends */
static PetscErrorCode LatinRowsTo_Private(PetscLayout map, PetscInt n, const PetscInt number[], const PetscInt ki[], PetscMPIInt *count, PetscMPIInt to[], PetscInt size[], PetscInt first[])
{
  const PetscInt *range;
  PetscMPIInt     ranks;

  PetscFunctionBegin;
  *count = 0; /* set first: the compiler would take an error below for a return without it */
  PetscCallMPI(MPI_Comm_size(map->comm, &ranks));
  PetscCall(PetscLayoutGetRanges(map, &range));
  for (PetscInt r = 0, q = 0, last; r < n; r = last) {
    while (q + 1 < ranks && number[r] >= range[q + 1]) q++;
    for (last = r; last < n && number[last] < range[q + 1]; last++) continue;
    to[*count]           = (PetscMPIInt)q;
    first[*count]        = r;
    size[2 * *count]     = last - r;
    size[2 * *count + 1] = ki[last] - ki[r];
    (*count)++;
  }
  PetscFunctionReturn(0);
}

/* Adds m entries with ascending columns to a row of n; j[] and a[] have room for n + m. Returns the new number of entries */
static PetscInt LatinRowsMerge(PetscInt n, PetscInt j[], PetscScalar a[], PetscInt m, const PetscInt tj[], const PetscScalar ta[])
{
  PetscInt    *old = j + m, i = 0, k = 0, count = 0;
  PetscScalar *was = a + m;

  for (PetscInt c = n - 1; c >= 0; c--) { /* move to the end */
    old[c] = j[c];
    was[c] = a[c];
  }
  while (i < n || k < m) {
    const PetscInt column = k == m || (i < n && old[i] <= tj[k]) ? old[i] : tj[k];
    PetscScalar    sum    = 0.0;

    if (i < n && old[i] == column) sum = was[i++];
    if (k < m && tj[k] == column) sum += ta[k++];
    j[count]   = column;
    a[count++] = sum;
  }
  return count;
}

/* Sends rows to their owners and receives those owned here in from[], by ascending ranks. Own rows are not copied. Collective on map->comm */
static PetscErrorCode LatinRowsExchange_Private(PetscLayout map, PetscInt info[], const PetscInt ki[], PetscInt kj[], PetscScalar ka[], PetscMPIInt sends, const PetscMPIInt to[], const PetscInt size[], const PetscInt first[], PetscMPIInt froms,
                                                LatinRows from[])
{
  PetscMPIInt  rank, tag, requests = 0, length;
  MPI_Request *request;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(map->comm, &rank));
  PetscCall(PetscCommGetNewTag(map->comm, &tag));
  PetscCall(PetscMalloc1(3 * (sends + froms), &request));
  for (PetscMPIInt i = 0; i < froms; i++) {
    LatinRows *f       = from + i;
    PetscInt   entries = f->next;

    f->next = 0;
    if (f->rank == rank) continue;
    PetscCall(PetscMalloc3(2 * f->rows, &f->info, entries, &f->j, entries, &f->a));
    PetscCall(PetscMPIIntCast(2 * f->rows, &length));
    PetscCallMPI(MPI_Irecv(f->info, length, MPIU_INT, f->rank, tag, map->comm, request + requests++));
    PetscCall(PetscMPIIntCast(entries, &length));
    PetscCallMPI(MPI_Irecv(f->j, length, MPIU_INT, f->rank, tag, map->comm, request + requests++));
    PetscCallMPI(MPI_Irecv(f->a, length, MPIU_SCALAR, f->rank, tag, map->comm, request + requests++));
  }
  for (PetscMPIInt i = 0; i < sends; i++) {
    const PetscInt r = first[i];

    if (to[i] == rank) {
      for (PetscMPIInt k = 0; k < froms; k++)
        if (from[k].rank == rank) from[k] = (LatinRows){.rank = rank, .rows = size[2 * i], .info = info + 2 * r, .j = kj + ki[r], .a = ka + ki[r]};
      continue;
    }
    PetscCall(PetscMPIIntCast(2 * size[2 * i], &length));
    PetscCallMPI(MPI_Isend(info + 2 * r, length, MPIU_INT, to[i], tag, map->comm, request + requests++));
    PetscCall(PetscMPIIntCast(size[2 * i + 1], &length));
    PetscCallMPI(MPI_Isend(kj + ki[r], length, MPIU_INT, to[i], tag, map->comm, request + requests++));
    PetscCallMPI(MPI_Isend(ka + ki[r], length, MPIU_SCALAR, to[i], tag, map->comm, request + requests++));
  }
  PetscCallMPI(MPI_Waitall(requests, request, MPI_STATUSES_IGNORE));
  PetscCall(PetscFree(request));
  PetscFunctionReturn(0);
}

/* Creates from[], the ranks to receive from, ascending; `next` holds the number of entries until the exchange. Collective on map->comm */
static PetscErrorCode LatinRowsFrom_Private(PetscLayout map, PetscMPIInt sends, const PetscMPIInt to[], const PetscInt size[], PetscMPIInt *froms, LatinRows **from)
{
  PetscMPIInt *ranks;
  PetscInt    *sizes;

  PetscFunctionBegin;
  PetscCall(PetscCommBuildTwoSided(map->comm, 2, MPIU_INT, sends, to, size, froms, &ranks, &sizes));
  PetscCall(PetscCalloc1(*froms, from));
  for (PetscMPIInt i = 0; i < *froms; i++) {
    PetscMPIInt k = i;

    for (; k > 0 && (*from)[k - 1].rank > ranks[i]; k--) (*from)[k] = (*from)[k - 1];
    (*from)[k] = (LatinRows){.rank = ranks[i], .rows = sizes[2 * i], .next = sizes[2 * i + 1]};
  }
  PetscCall(PetscFree(ranks));
  PetscCall(PetscFree(sizes));
  PetscFunctionReturn(0);
}

/* Sums the rows owned here in compressed rows oi[], oj[], oa[] */
static PetscErrorCode LatinRowsAdd_Private(PetscLayout map, PetscMPIInt froms, LatinRows from[], PetscInt **oi, PetscInt **oj, PetscScalar **oa)
{
  PetscInt *at, entries = 0, n = 0;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(froms, &at));
  for (PetscMPIInt f = 0; f < froms; f++)
    for (PetscInt r = 0; r < from[f].rows; r++) entries += from[f].info[2 * r + 1];
  PetscCall(PetscMalloc1(map->n + 1, oi));
  PetscCall(PetscMalloc2(entries, oj, entries, oa));
  (*oi)[0] = 0;
  for (PetscInt r = map->rstart; r < map->rend; r++) {
    PetscInt m = 0;

    for (PetscMPIInt f = 0; f < froms; f++) {
      LatinRows *rows = from + f;

      if (rows->next == rows->rows || rows->info[2 * rows->next] != r) continue;
      m = LatinRowsMerge(m, *oj + n, *oa + n, rows->info[2 * rows->next + 1], rows->j + at[f], rows->a + at[f]);
      at[f] += rows->info[2 * rows->next++ + 1];
    }
    n += m;
    (*oi)[r - map->rstart + 1] = n;
  }
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCoarsePartFree_Private(LatinCoarsePart *part)
{
  PetscFunctionBegin;
  PetscCall(PetscFree2(part->j, part->a));
  PetscCall(PetscFree(part->i));
  PetscFunctionReturn(0);
}

/*
   Assembles A, the sum of the parts of the ranks, with row layout map; frees the part. number[part->rows]: global numbers of the rows and columns of
   the part, ascending; columns of each row ascend. upper: A and the parts have the upper triangle alone. Collective on map->comm
*/
PetscErrorCode LatinRowsSum_Private(PetscLayout map, const PetscInt number[], LatinCoarsePart *part, PetscBool upper, Mat *A)
{
  const PetscInt n = part->rows, *ki = part->i;
  PetscMPIInt    ranks, rank, sends, froms, *to;
  PetscInt      *info, *size, *first, *oi, *oj;
  PetscScalar   *oa;
  LatinRows     *from;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(map->comm, &ranks));
  PetscCallMPI(MPI_Comm_rank(map->comm, &rank));
  PetscCall(PetscMalloc4(ranks, &to, 2 * ranks, &size, ranks, &first, 2 * n, &info));
  for (PetscInt r = 0; r < n; r++) {
    info[2 * r]     = number[r];
    info[2 * r + 1] = ki[r + 1] - ki[r];
  }
  for (PetscInt k = 0; k < ki[n]; k++) part->j[k] = number[part->j[k]];
  PetscCall(LatinRowsTo_Private(map, n, number, ki, &sends, to, size, first));
  PetscCall(LatinRowsFrom_Private(map, sends, to, size, &froms, &from));
  PetscCall(LatinRowsExchange_Private(map, info, ki, part->j, part->a, sends, to, size, first, froms, from));
  PetscCall(LatinRowsAdd_Private(map, froms, from, &oi, &oj, &oa));
  for (PetscMPIInt f = 0; f < froms; f++)
    if (from[f].rank != rank) PetscCall(PetscFree3(from[f].info, from[f].j, from[f].a));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree4(to, size, first, info));
  PetscCall(LatinCoarsePartFree_Private(part));
  if (upper) PetscCall(MatCreateMPISBAIJWithArrays(map->comm, 1, map->n, map->n, map->N, map->N, oi, oj, oa, A));
  else PetscCall(MatCreateMPIAIJWithArrays(map->comm, map->n, map->n, map->N, map->N, oi, oj, oa, A));
  PetscCall(PetscFree(oi));
  PetscCall(PetscFree2(oj, oa));
  PetscFunctionReturn(0);
}
