#include "subdomains/latinsubdomains.h"

/*
   The matrix of one subdomain, by compressed rows: its links, or its rows of a matrix, springs on the diagonal, and dense
   symmetric blocks. What adds to an entry does so in the order of links, or of blocks, on both sides of the diagonal: both
   halves of the matrix are the same sums.
*/

/* What adds to the rows of a subdomain, whose entries are numbered from its first one */
typedef struct {
  const LatinSubdomains *sub;
  const LatinBlock      *block;
  const PetscReal       *spring;
  const PetscBool       *held; /* rows and columns of the identity */
  PetscInt               top, rows, blocks;
  PetscInt              *link_first, *link; /* links at each node, increasing */
  PetscInt              *part_first, *part; /* rows of blocks at each row: numbers of all rows of all blocks, one after the other */
  PetscInt              *part_block, *part_row;
} LatinRows;

/* One row as it is gathered */
typedef struct {
  PetscInt   row, n, *column; /* [n] not sorted */
  PetscInt  *seen;            /* [rows] the last row, plus one, that has an entry in this column */
  PetscReal *value;           /* [rows] by column */
} LatinRow;

static inline void LatinRowAdd(const LatinRows *rows, LatinRow *row, PetscInt column, PetscReal value)
{
  if (value == 0.0 || rows->held[row->row] || rows->held[column]) return;
  if (row->seen[column] != row->row + 1) {
    row->seen[column]     = row->row + 1;
    row->value[column]    = 0.0;
    row->column[row->n++] = column;
  }
  row->value[column] += value;
}

/* The links at the nodes of a structure, the rows of blocks at the rows */
static PetscErrorCode LatinRowsCreate_Private(LatinRows *rows, PetscInt s)
{
  const LatinSubdomains *sub = rows->sub;
  const PetscInt         bs = sub->bs, nodes = rows->rows / bs, first = sub->ki ? 0 : sub->link_offset[s], last = sub->ki ? 0 : sub->link_offset[s + 1];
  PetscInt               parts = 0;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < rows->blocks; b++) parts += rows->block[b].n;
  PetscCall(PetscCalloc2(nodes + 2, &rows->link_first, rows->rows + 2, &rows->part_first));
  PetscCall(PetscMalloc4(2 * (last - first), &rows->link, parts, &rows->part, parts, &rows->part_block, parts, &rows->part_row));
  for (PetscInt i = 2 * first; i < 2 * last; i++) rows->link_first[sub->ends[i] - rows->top / bs + 2]++;
  for (PetscInt i = 0; i < nodes; i++) rows->link_first[i + 2] += rows->link_first[i + 1];
  for (PetscInt i = 2 * first; i < 2 * last; i++) rows->link[rows->link_first[sub->ends[i] - rows->top / bs + 1]++] = i / 2;
  for (PetscInt b = 0; b < rows->blocks; b++)
    for (PetscInt r = 0; r < rows->block[b].n; r++) rows->part_first[rows->block[b].dof[r] - rows->top + 2]++;
  for (PetscInt r = 0; r < rows->rows; r++) rows->part_first[r + 2] += rows->part_first[r + 1];
  parts = 0;
  for (PetscInt b = 0; b < rows->blocks; b++)
    for (PetscInt r = 0; r < rows->block[b].n; r++, parts++) {
      rows->part_block[parts]                                               = b;
      rows->part_row[parts]                                                 = r;
      rows->part[rows->part_first[rows->block[b].dof[r] - rows->top + 1]++] = parts;
    }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinRowsDestroy_Private(LatinRows *rows)
{
  PetscFunctionBegin;
  PetscCall(PetscFree2(rows->link_first, rows->part_first));
  PetscCall(PetscFree4(rows->link, rows->part, rows->part_block, rows->part_row));
  PetscFunctionReturn(0);
}

/* The most entries that a row can have */
static PetscInt LatinRowsMost(const LatinRows *rows, PetscInt r)
{
  const LatinSubdomains *sub  = rows->sub;
  const PetscInt         node = r / sub->bs;
  PetscInt               most = 1;

  most += sub->ki ? sub->ki[rows->top + r + 1] - sub->ki[rows->top + r] : sub->bs * (1 + rows->link_first[node + 1] - rows->link_first[node]);
  for (PetscInt p = rows->part_first[r]; p < rows->part_first[r + 1]; p++) most += rows->block[rows->part_block[rows->part[p]]].n;
  return PetscMin(most, rows->rows);
}

/* One link's part of row r, component c of a node */
static inline void LatinRowLink(const LatinRows *rows, LatinRow *row, PetscInt l)
{
  const LatinSubdomains *sub = rows->sub;
  const PetscInt         bs = sub->bs, c = row->row % bs, node = row->row / bs + rows->top / bs;
  const PetscReal       *direction = sub->direction + bs * l;

  for (PetscInt end = 0; end < 2; end++) { /* a link from a node to itself adds to it as both */
    const PetscReal b = end ? direction[c] : -direction[c];

    if (sub->ends[2 * l + end] != node) continue;
    for (PetscInt j = 0; j < 2 * bs; j++) {
      const PetscReal other = j < bs ? -direction[j] : direction[j - bs];

      LatinRowAdd(rows, row, bs * sub->ends[2 * l + (j < bs ? 0 : 1)] + j % bs - rows->top, sub->stiffness[l] * (b * other));
    }
  }
}

/* Gathers row r */
static void LatinRowGather(const LatinRows *rows, PetscInt r, LatinRow *row)
{
  const LatinSubdomains *sub  = rows->sub;
  const PetscInt         top  = rows->top;
  const PetscReal        diag = rows->held[r] ? 1.0 : rows->spring[top + r];

  row->row       = r;
  row->seen[r]   = r + 1; /* every row has its diagonal */
  row->value[r]  = diag;
  row->column[0] = r;
  row->n         = 1;
  if (sub->ground) LatinRowAdd(rows, row, r, sub->ground[top + r]);
  for (PetscInt k = sub->ki ? sub->ki[top + r] : 0; sub->ki && k < sub->ki[top + r + 1]; k++) LatinRowAdd(rows, row, sub->kj[k] - top, sub->ka[k]);
  if (!sub->ki)
    for (PetscInt k = rows->link_first[r / sub->bs]; k < rows->link_first[r / sub->bs + 1]; k++)
      if (k == rows->link_first[r / sub->bs] || rows->link[k] != rows->link[k - 1]) LatinRowLink(rows, row, rows->link[k]);
  for (PetscInt p = rows->part_first[r]; p < rows->part_first[r + 1]; p++) {
    const LatinBlock *block = &rows->block[rows->part_block[rows->part[p]]];
    const PetscReal  *a     = block->a + (size_t)block->n * (size_t)rows->part_row[rows->part[p]];

    for (PetscInt j = 0; j < block->n; j++) LatinRowAdd(rows, row, block->dof[j] - top, a[j]);
  }
}

/*
   The operator of subdomain s with springs, and blocks: symmetric matrices of entries of the copy arrays. Rows and
   columns held[], of all copies, are those of the identity. LatinSparseReset_Private() frees it.
*/
PetscErrorCode LatinSparseCreate_Private(const LatinSubdomains *sub, PetscInt s, const PetscReal spring[], const PetscBool held[], PetscInt blocks, const LatinBlock block[], LatinSparse *K)
{
  const PetscInt bs = sub->bs, top = bs * sub->node_offset[s], n = bs * sub->node_offset[s + 1] - top;
  LatinRows      rows = {.sub = sub, .spring = spring, .held = held + top, .top = top, .rows = n, .blocks = blocks, .block = block};
  LatinRow       row;
  size_t         most = 0;
  PetscInt       nz   = 0;

  PetscFunctionBegin;
  PetscCall(LatinRowsCreate_Private(&rows, s));
  for (PetscInt r = 0; r < n; r++) most += (size_t)LatinRowsMost(&rows, r);
  PetscCall(PetscMalloc1(n + 1, &K->i));
  PetscCall(PetscMalloc2(most, &K->j, most, &K->a)); /* what is left at the end is never touched */
  PetscCall(PetscCalloc1(n, &row.seen));
  PetscCall(PetscMalloc1(n, &row.value));
  for (PetscInt r = 0; r < n; r++) {
    K->i[r]    = nz;
    row.column = K->j + nz;
    LatinRowGather(&rows, r, &row);
    PetscCall(PetscSortInt(row.n, row.column));
    for (PetscInt k = 0; k < row.n; k++) K->a[nz + k] = row.value[row.column[k]];
    nz += row.n;
  }
  K->i[n] = nz;
  K->bs   = bs;
  K->rows = n;
  PetscCall(PetscFree(row.seen));
  PetscCall(PetscFree(row.value));
  PetscCall(LatinRowsDestroy_Private(&rows));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSparseReset_Private(LatinSparse *K)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(K->i));
  PetscCall(PetscFree2(K->j, K->a));
  PetscFunctionReturn(0);
}
