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

/* Rows to send: consecutive rows of the part of this rank for each owner, owners ascending */
typedef struct {
  PetscMPIInt count, *to; /* number of owners; these */
  PetscInt   *size;       /* [count][2] number of rows and of entries */
  PetscInt   *first;      /* [count] first row */
  PetscInt   *info;       /* [rows of the part][2] global number and length of each row */
} LatinRowsOut;

/* Creates the lists of rows to send. number[part->rows] ascends */
static PetscErrorCode LatinRowsOut_Private(PetscLayout map, const PetscInt number[], const LatinCoarsePart *part, LatinRowsOut *out)
{
  const PetscInt *range, *ki = part->i;
  PetscMPIInt     ranks;

  PetscFunctionBegin;
  *out = (LatinRowsOut){.count = 0}; /* set first: the compiler would take an error below for a return without it */
  PetscCallMPI(MPI_Comm_size(map->comm, &ranks));
  PetscCall(PetscLayoutGetRanges(map, &range));
  PetscCall(PetscMalloc4(ranks, &out->to, 2 * ranks, &out->size, ranks, &out->first, 2 * part->rows, &out->info));
  for (PetscInt r = 0; r < part->rows; r++) {
    out->info[2 * r]     = number[r];
    out->info[2 * r + 1] = ki[r + 1] - ki[r];
  }
  for (PetscInt r = 0, q = 0, last; r < part->rows; r = last) {
    const PetscMPIInt i = out->count++;

    while (q + 1 < ranks && number[r] >= range[q + 1]) q++;
    for (last = r; last < part->rows && number[last] < range[q + 1]; last++) continue;
    out->to[i]           = (PetscMPIInt)q;
    out->first[i]        = r;
    out->size[2 * i]     = last - r;
    out->size[2 * i + 1] = ki[last] - ki[r];
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

/* Starts to receive the rows from f->rank; *requests: number of messages */
static PetscErrorCode LatinRowsReceive_Private(PetscLayout map, PetscMPIInt tag, LatinRows *f, MPI_Request request[], PetscMPIInt *requests)
{
  const PetscInt entries = f->next;
  PetscMPIInt    infos, length;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(2 * f->rows, &f->info, entries, &f->j, entries, &f->a));
  PetscCall(PetscMPIIntCast(2 * f->rows, &infos));
  PetscCall(PetscMPIIntCast(entries, &length));
  PetscCallMPI(MPI_Irecv(f->info, infos, MPIU_INT, f->rank, tag, map->comm, request + (*requests)++));
  PetscCallMPI(MPI_Irecv(f->j, length, MPIU_INT, f->rank, tag, map->comm, request + (*requests)++));
  PetscCallMPI(MPI_Irecv(f->a, length, MPIU_SCALAR, f->rank, tag, map->comm, request + (*requests)++));
  PetscFunctionReturn(0);
}

/* Starts to send rows to their owner i; *requests: number of messages */
static PetscErrorCode LatinRowsSend_Private(PetscLayout map, PetscMPIInt tag, const LatinCoarsePart *part, const LatinRowsOut *out, PetscMPIInt i, MPI_Request request[], PetscMPIInt *requests)
{
  const PetscInt r = out->first[i];
  PetscMPIInt    infos, length;

  PetscFunctionBegin;
  PetscCall(PetscMPIIntCast(2 * out->size[2 * i], &infos));
  PetscCall(PetscMPIIntCast(out->size[2 * i + 1], &length));
  PetscCallMPI(MPI_Isend(out->info + 2 * r, infos, MPIU_INT, out->to[i], tag, map->comm, request + (*requests)++));
  PetscCallMPI(MPI_Isend(part->j + part->i[r], length, MPIU_INT, out->to[i], tag, map->comm, request + (*requests)++));
  PetscCallMPI(MPI_Isend(part->a + part->i[r], length, MPIU_SCALAR, out->to[i], tag, map->comm, request + (*requests)++));
  PetscFunctionReturn(0);
}

/* Sends rows to their owners and receives those owned here in from[], by ascending ranks. Own rows are not copied. Collective on map->comm */
static PetscErrorCode LatinRowsExchange_Private(PetscLayout map, const LatinCoarsePart *part, const LatinRowsOut *out, PetscMPIInt froms, LatinRows from[])
{
  PetscMPIInt  rank, tag, requests = 0;
  MPI_Request *request;
  LatinRows   *own = NULL;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(map->comm, &rank));
  PetscCall(PetscCommGetNewTag(map->comm, &tag));
  PetscCall(PetscMalloc1(3 * (out->count + froms), &request));
  for (PetscMPIInt i = 0; i < froms; i++) {
    if (from[i].rank == rank) own = &from[i];
    else PetscCall(LatinRowsReceive_Private(map, tag, &from[i], request, &requests));
    from[i].next = 0;
  }
  for (PetscMPIInt i = 0; i < out->count; i++) {
    const PetscInt r = out->first[i];

    if (out->to[i] != rank) PetscCall(LatinRowsSend_Private(map, tag, part, out, i, request, &requests));
    else *own = (LatinRows){.rank = rank, .rows = out->size[2 * i], .info = out->info + 2 * r, .j = part->j + part->i[r], .a = part->a + part->i[r]};
  }
  PetscCallMPI(MPI_Waitall(requests, request, MPI_STATUSES_IGNORE));
  PetscCall(PetscFree(request));
  PetscFunctionReturn(0);
}

/* Creates from[], the ranks to receive from, ascending; `next` holds the number of entries until the exchange. Collective on map->comm */
static PetscErrorCode LatinRowsFrom_Private(PetscLayout map, const LatinRowsOut *out, PetscMPIInt *froms, LatinRows **from)
{
  PetscMPIInt *ranks;
  PetscInt    *sizes;

  PetscFunctionBegin;
  PetscCall(PetscCommBuildTwoSided(map->comm, 2, MPIU_INT, out->count, out->to, out->size, froms, &ranks, &sizes));
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
  PetscMPIInt  rank, froms;
  PetscInt    *oi, *oj;
  PetscScalar *oa;
  LatinRowsOut out;
  LatinRows   *from;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(map->comm, &rank));
  for (PetscInt k = 0; k < part->i[part->rows]; k++) part->j[k] = number[part->j[k]];
  PetscCall(LatinRowsOut_Private(map, number, part, &out));
  PetscCall(LatinRowsFrom_Private(map, &out, &froms, &from));
  PetscCall(LatinRowsExchange_Private(map, part, &out, froms, from));
  PetscCall(LatinRowsAdd_Private(map, froms, from, &oi, &oj, &oa));
  for (PetscMPIInt f = 0; f < froms; f++)
    if (from[f].rank != rank) PetscCall(PetscFree3(from[f].info, from[f].j, from[f].a));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree4(out.to, out.size, out.first, out.info));
  PetscCall(LatinCoarsePartFree_Private(part));
  if (upper) PetscCall(MatCreateMPISBAIJWithArrays(map->comm, 1, map->n, map->n, map->N, map->N, oi, oj, oa, A));
  else PetscCall(MatCreateMPIAIJWithArrays(map->comm, map->n, map->n, map->N, map->N, oi, oj, oa, A));
  PetscCall(PetscFree(oi));
  PetscCall(PetscFree2(oj, oa));
  PetscFunctionReturn(0);
}
