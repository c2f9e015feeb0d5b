#include "subdomains/latinsubdomains.h"

/*
   The matrix of one subdomain, by compressed rows: its links, or its rows of a matrix, springs on the diagonal, and dense
   symmetric blocks. Entries come in any order, each as often as something adds to it; they are sorted by columns, then by
   rows, without changing the order of equal ones: both halves of the matrix are the same sums.
*/

typedef struct {
  PetscInt  row, column;
  PetscReal value;
} LatinEntry;

typedef struct {
  const PetscBool *held; /* of the subdomain: rows and columns of the identity */
  LatinEntry      *entry;
  size_t           n;
} LatinEntries;

static inline void LatinEntriesAdd(LatinEntries *entries, PetscInt row, PetscInt column, PetscReal value)
{
  if (value != 0.0 && !entries->held[row] && !entries->held[column]) entries->entry[entries->n++] = (LatinEntry){row, column, value};
}

/* first[rows + 1]: work; it says afterwards where each row, or column, ends */
static void LatinEntriesSort(size_t n, PetscInt rows, PetscBool by_row, const LatinEntry from[], LatinEntry to[], PetscInt first[])
{
  for (PetscInt r = 0; r <= rows; r++) first[r] = 0;
  for (size_t e = 0; e < n; e++) first[1 + (by_row ? from[e].row : from[e].column)]++;
  for (PetscInt r = 0; r < rows; r++) first[r + 1] += first[r];
  for (size_t e = 0; e < n; e++) to[first[by_row ? from[e].row : from[e].column]++] = from[e];
}

/* The operator of a subdomain: links, springs to the ground, the entries of a matrix; and springs, of all copies */
static void LatinEntriesOperator(LatinEntries *entries, const LatinSubdomains *sub, PetscInt s, const PetscReal spring[])
{
  const PetscInt bs = sub->bs, top = bs * sub->node_offset[s], rows = bs * sub->node_offset[s + 1] - top;

  for (PetscInt r = 0; r < rows; r++) {
    entries->entry[entries->n++] = (LatinEntry){r, r, entries->held[r] ? 1.0 : spring[top + r]}; /* every row has its diagonal */
    if (sub->ground) LatinEntriesAdd(entries, r, r, sub->ground[top + r]);
    for (PetscInt k = sub->ki ? sub->ki[top + r] : 0; sub->ki && k < sub->ki[top + r + 1]; k++) LatinEntriesAdd(entries, r, sub->kj[k] - top, sub->ka[k]);
  }
  for (PetscInt l = sub->ki ? 0 : sub->link_offset[s]; !sub->ki && l < sub->link_offset[s + 1]; l++) {
    PetscInt  dof[6];
    PetscReal b[6]; /* a row of B */

    for (PetscInt i = 0; i < 2 * bs; i++) {
      dof[i] = bs * sub->ends[2 * l + (i < bs ? 0 : 1)] + (i < bs ? i : i - bs) - top;
      b[i]   = i < bs ? -sub->direction[bs * l + i] : sub->direction[bs * l + i - bs];
    }
    for (PetscInt i = 0; i < 2 * bs; i++)
      for (PetscInt j = 0; j < 2 * bs; j++) LatinEntriesAdd(entries, dof[i], dof[j], sub->stiffness[l] * (b[i] * b[j]));
  }
}

/*
   The operator of subdomain s with springs, and blocks: symmetric matrices of entries of the copy arrays. Rows and
   columns held[], of all copies, are those of the identity. LatinSparseReset_Private() frees it.
*/
PetscErrorCode LatinSparseCreate_Private(const LatinSubdomains *sub, PetscInt s, const PetscReal spring[], const PetscBool held[], PetscInt blocks, const LatinBlock block[], LatinSparse *K)
{
  const PetscInt bs = sub->bs, top = bs * sub->node_offset[s], rows = bs * sub->node_offset[s + 1] - top;
  size_t         most    = 2 * (size_t)rows, nz;
  LatinEntries   entries = {.held = held + top};
  LatinEntry    *sorted;

  PetscFunctionBegin;
  if (sub->ki) most += (size_t)(sub->ki[top + rows] - sub->ki[top]);
  else most += (size_t)(sub->link_offset[s + 1] - sub->link_offset[s]) * (size_t)(4 * bs * bs);
  for (PetscInt b = 0; b < blocks; b++) most += (size_t)block[b].n * (size_t)block[b].n;
  PetscCall(PetscMalloc2(most, &entries.entry, most, &sorted));
  PetscCall(PetscMalloc1(rows + 1, &K->i));
  LatinEntriesOperator(&entries, sub, s, spring);
  for (PetscInt b = 0; b < blocks; b++)
    for (PetscInt j = 0; j < block[b].n; j++)
      for (PetscInt i = 0; i < block[b].n; i++) LatinEntriesAdd(&entries, block[b].dof[i] - top, block[b].dof[j] - top, block[b].a[i + (size_t)block[b].n * (size_t)j]);
  LatinEntriesSort(entries.n, rows, PETSC_FALSE, entries.entry, sorted, K->i);
  LatinEntriesSort(entries.n, rows, PETSC_TRUE, sorted, entries.entry, K->i);
  nz = 0;
  for (size_t e = 1; e < entries.n; e++) {
    const LatinEntry *from = entries.entry + e;
    LatinEntry       *last = entries.entry + nz;

    if (from->row == last->row && from->column == last->column) last->value += from->value;
    else entries.entry[++nz] = *from;
  }
  nz += entries.n ? 1 : 0;
  K->rows = rows;
  PetscCall(PetscArrayzero(K->i, rows + 1));
  PetscCall(PetscMalloc2(nz, &K->j, nz, &K->a));
  for (size_t e = 0; e < nz; e++) {
    K->i[entries.entry[e].row + 1]++;
    K->j[e] = entries.entry[e].column;
    K->a[e] = entries.entry[e].value;
  }
  for (PetscInt r = 0; r < rows; r++) K->i[r + 1] += K->i[r];
  PetscCall(PetscFree2(entries.entry, sorted));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSparseReset_Private(LatinSparse *K)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(K->i));
  PetscCall(PetscFree2(K->j, K->a));
  PetscFunctionReturn(0);
}
