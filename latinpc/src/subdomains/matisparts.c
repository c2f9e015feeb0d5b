#include "subdomains/localmatrix.h"
#include <metis.h>

/*
   Parts of a local matrix: its connected components, each a subdomain. With repeated unknowns (MatISSetAllowRepeated()), as of element matrices each in
   rows of its own, the components are pieces that are joined to the wanted number of subdomains: the matrix of a subdomain is the sum of those of its
   pieces.
*/

/*
   Joins the rows of each block, as unknowns of one node may be uncoupled in the matrix. Rows of a repeated unknown belong to different pieces: a block
   ends before the second of them, as the rows of a piece are consecutive. repeated[row]: whether the unknown is repeated
*/
static PetscErrorCode LatinMatrixBlocks_Private(const LatinLocalMatrix *local, PetscInt bs, const PetscBool kept[], PetscInt parent[], PetscBool repeated[])
{
  const PetscInt *global = local->global;
  PetscInt       *block, *row;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(local->rows, &block, local->rows, &row));
  for (PetscInt r = 0; r < local->rows; r++) {
    block[r]    = global[r] / bs;
    row[r]      = r;
    repeated[r] = PETSC_FALSE;
  }
  PetscCall(PetscSortIntWithArray(local->rows, block, row));
  for (PetscInt first = 0, last, begin; first < local->rows; first = last) {
    for (last = first + 1; last < local->rows && block[last] == block[first];) last++;
    PetscCall(PetscSortInt(last - first, row + first));
    begin = first;
    for (PetscInt k = first; k < last; k++) {
      for (PetscInt j = first; j < k; j++) {
        if (global[row[j]] != global[row[k]]) continue;
        repeated[row[j]] = repeated[row[k]] = PETSC_TRUE;
        if (j >= begin) begin = k;
      }
      while (begin < k && !kept[row[begin]]) begin++;
      if (kept[row[k]]) LatinJoin(parent, row[begin], row[k]);
    }
  }
  PetscCall(PetscFree2(block, row));
  PetscFunctionReturn(0);
}

/* Lists the kept rows in row[*count], sorted by their unknowns global[] */
static PetscErrorCode LatinMatrixKept_Private(const LatinLocalMatrix *local, const PetscBool kept[], PetscInt *count, PetscInt global[], PetscInt row[])
{
  PetscFunctionBegin;
  *count = 0;
  for (PetscInt r = 0; r < local->rows; r++) {
    if (!kept[r]) continue;
    global[*count]  = local->global[r];
    row[(*count)++] = r;
  }
  PetscCall(PetscSortIntWithArray(*count, global, row));
  PetscFunctionReturn(0);
}

/* Partitions the pieces piece[row] into group[piece], by METIS; pieces with a common unknown are neighbours */
static PetscErrorCode LatinMatrixGroups_Private(PetscInt rows, const PetscInt global[], const PetscInt row[], const PetscInt piece[], PetscInt pieces, PetscInt groups, PetscInt group[])
{
  idx_t *first, *list, *weight, *part, *of_unknown, options[METIS_NOPTIONS], elements = (idx_t)pieces, unknowns = 0, common = 1, parts = (idx_t)groups, cut;
  int    failed;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(pieces + 2, &first));
  PetscCall(PetscMalloc3(rows, &list, pieces, &weight, pieces, &part));
  for (PetscInt k = 0; k < rows; k++) first[piece[row[k]] + 2]++;
  for (PetscInt p = 0; p < pieces; p++) {
    weight[p] = first[p + 2];
    first[p + 2] += first[p + 1];
  }
  for (PetscInt k = 0; k < rows; k++) {
    if (k && global[k] != global[k - 1]) unknowns++;
    list[first[piece[row[k]] + 1]++] = unknowns;
  }
  unknowns++;
  PetscCall(PetscMalloc1(unknowns, &of_unknown));
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED]      = 1; /* the same partition at every run */
  options[METIS_OPTION_NUMBERING] = 0;
  failed                          = METIS_PartMeshDual(&elements, &unknowns, first, list, weight, NULL, &common, &parts, NULL, options, &cut, part, of_unknown);
  PetscCheck(failed == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not partition the %" PetscInt_FMT " pieces of a local matrix (METIS status %d)", pieces, failed);
  for (PetscInt p = 0; p < pieces; p++) group[p] = (PetscInt)part[p];
  PetscCall(PetscFree(of_unknown));
  PetscCall(PetscFree3(list, weight, part));
  PetscCall(PetscFree(first));
  PetscFunctionReturn(0);
}

/* Joins pieces with common unknowns to connected subdomains of this rank, at least `wanted` if there are as many pieces */
static PetscErrorCode LatinMatrixJoin_Private(const LatinLocalMatrix *local, PetscInt wanted, const PetscBool kept[], PetscInt parent[])
{
  PetscInt *global, *row, *piece, *group, rows, pieces = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc4(local->rows, &global, local->rows, &row, local->rows, &piece, local->rows, &group));
  PetscCall(LatinMatrixKept_Private(local, kept, &rows, global, row));
  for (PetscInt r = 0; r < local->rows; r++)
    if (kept[r] && LatinRoot(parent, r) == r) piece[r] = pieces++;
  for (PetscInt r = 0; r < local->rows; r++)
    if (kept[r]) piece[r] = piece[LatinRoot(parent, r)];
  PetscCall(PetscArrayzero(group, pieces));
  if (1 < wanted && wanted < pieces) PetscCall(LatinMatrixGroups_Private(rows, global, row, piece, pieces, wanted, group));
  for (PetscInt first = 0, last; first < rows && wanted < pieces; first = last)
    for (last = first + 1; last < rows && global[last] == global[first]; last++)
      for (PetscInt k = first; k < last; k++)
        if (group[piece[row[k]]] == group[piece[row[last]]]) LatinJoin(parent, row[k], row[last]);
  PetscCall(PetscFree4(global, row, piece, group));
  PetscFunctionReturn(0);
}

/* Joins the rows that entries or blocks couple. repeated[row]: whether the unknown is repeated */
static PetscErrorCode LatinMatrixComponents_Private(const LatinSubdomains *sub, const LatinLocalMatrix *local, const PetscBool kept[], PetscInt parent[], PetscBool repeated[])
{
  PetscInt bs;

  PetscFunctionBegin;
  PetscCall(MatGetBlockSize(sub->matrix, &bs));
  for (PetscInt r = 0; r < local->rows; r++) parent[r] = r;
  for (PetscInt r = 0; r < local->rows; r++)
    for (PetscInt k = local->i[r]; k < local->i[r + 1]; k++)
      if (kept[r] && kept[local->j[k]] && local->a[k] != 0.0) LatinJoin(parent, r, local->j[k]);
  PetscCall(LatinMatrixBlocks_Private(local, bs, kept, parent, repeated));
  PetscFunctionReturn(0);
}

/* Numbers the components in the order of their first rows: part[row], see LatinMatrixParts_Private() */
static PetscErrorCode LatinMatrixNumber_Private(PetscInt n, const PetscBool kept[], PetscInt parent[], const PetscBool repeated[], PetscInt part[], PetscInt *parts)
{
  PetscInt *number, *rows; /* of each component, at its root: its part; its rows */

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n, &number));
  PetscCall(PetscCalloc1(n, &rows));
  *parts = 0;
  for (PetscInt r = 0; r < n; r++)
    if (kept[r]) rows[LatinRoot(parent, r)]++;
  for (PetscInt r = 0; r < n; r++) number[r] = rows[r] > 1 || (rows[r] && repeated[r]) ? (*parts)++ : 0;
  for (PetscInt r = 0; r < n; r++) {
    part[r] = kept[r] ? number[LatinRoot(parent, r)] : -1;
    if (kept[r]) *parts = PetscMax(*parts, 1);
  }
  PetscCall(PetscFree(rows));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

/*
   Computes part[row], the part of each row of the local matrix, -1: no copy, numbered in the order of their first rows, and their number sub->n.
   sub->wanted subdomains are divided equally among ranks; 0: one for each rank. A component of one row, a spring to the ground, joins the first part,
   or is a part itself if its unknown is repeated. Collective on sub->object
*/
PetscErrorCode LatinMatrixParts_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, const PetscBool kept[], PetscInt part[])
{
  const PetscInt64 wanted = sub->wanted; /* 64 bits: any number is allowed; a large one makes each piece a part */
  MPI_Comm         comm   = PetscObjectComm(sub->object);
  PetscMPIInt      rank, size;
  PetscInt        *parent;
  PetscBool       *repeated, here = PETSC_FALSE, anywhere;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMalloc2(local->rows, &parent, local->rows, &repeated));
  PetscCall(LatinMatrixComponents_Private(sub, local, kept, parent, repeated));
  for (PetscInt r = 0; r < local->rows; r++) here = (PetscBool)(here || repeated[r]);
  PetscCall(MPIU_Allreduce(&here, &anywhere, 1, LATIN_MPI_BOOL, MPI_LOR, comm));
  LatinAgree(comm, sub->wanted > size && !anywhere, PETSC_ERR_ARG_INCOMP, "Local matrices of a MATIS are subdomains, which cannot be divided: remove -%ssubdomains, or give the matrix of each element rows of its own (MatISSetAllowRepeated())",
             LatinPrefix(sub));
  if (here) PetscCall(LatinMatrixJoin_Private(local, (PetscInt)PetscMax(1, wanted * (rank + 1) / size - wanted * rank / size), kept, parent));
  PetscCall(LatinMatrixNumber_Private(local->rows, kept, parent, repeated, part, &sub->n));
  PetscCall(PetscFree2(parent, repeated));
  PetscFunctionReturn(0);
}
