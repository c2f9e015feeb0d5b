#include "base/room.h"
#include "subdomains/latinsubdomains.h"

/*
   Assembly of the sparse matrix of one subdomain: its links, or its rows of a matrix; springs on the diagonal; dense symmetric
   blocks. Terms of an entry are added in the order of links and blocks on both sides of the diagonal: the matrix is symmetric
   to the bit.
*/

/* Terms of the rows of a subdomain, which are numbered from its first one */
typedef struct {
  const LatinSubdomains *sub;
  const LatinBlock      *block;
  const PetscReal       *spring;
  const PetscBool       *held; /* [rows] whether to replace a row and column by those of the identity */
  PetscInt               top, rows, blocks;
  PetscInt              *link_first, *link;     /* [nodes + 2] range of each node; links at each node, increasing */
  PetscInt              *part_first, *part;     /* [rows + 2] range of each row; rows of blocks at each row; rows of all blocks are numbered consecutively */
  PetscInt              *part_block, *part_row; /* block and row in it of each of these numbers */
} LatinRows;

/* Rows of one node during the assembly, by blocks of bs x bs entries */
typedef struct {
  /* number of blocks; [n] nodes of their columns, which are sorted at the end; their places in value[] */
  PetscInt   n, *node, *slot;
  PetscInt  *place; /* [nodes] block of the columns of a node, valid if node[place] is this node */
  PetscReal *value; /* [n][bs][bs] entries */
  PetscBool *met;   /* [n][bs][bs] whether an entry is one of a link, of whatever stiffness; NULL: zeros are no entries */
} LatinNodeRows;

/* Returns the block of the columns of a node, which is zeroed on first use */
static inline PetscReal *LatinNodeBlock(const LatinRows *rows, LatinNodeRows *gathered, PetscInt node)
{
  const PetscInt size = rows->sub->bs * rows->sub->bs;
  PetscInt       at   = gathered->place[node];

  if (at >= gathered->n || gathered->node[at] != node) {
    at = gathered->place[node] = gathered->slot[gathered->n] = gathered->n;
    gathered->node[gathered->n++]                            = node;
    for (PetscInt k = 0; k < size; k++) gathered->value[size * at + k] = 0.0;
    for (PetscInt k = 0; k < size && gathered->met; k++) gathered->met[size * at + k] = PETSC_FALSE;
  }
  return gathered->value + size * at;
}

/* Lists the links at each node and the block rows at each row */
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

/* Returns an upper bound of the number of column nodes of a node */
static PetscInt LatinRowsNeighbours(const LatinRows *rows, PetscInt node)
{
  const LatinSubdomains *sub  = rows->sub;
  PetscInt               most = 1 + rows->link_first[node + 1] - rows->link_first[node];

  for (PetscInt r = sub->bs * node; r < sub->bs * (node + 1); r++) {
    if (sub->ki) most += sub->ki[rows->top + r + 1] - sub->ki[rows->top + r];
    for (PetscInt p = rows->part_first[r]; p < rows->part_first[r + 1]; p++) most += rows->block[rows->part_block[rows->part[p]]].n;
  }
  return PetscMin(most, rows->rows / sub->bs);
}

/* Adds a link to the rows of a node: columns of the node and of the other end */
static inline void LatinNodeLink(const LatinRows *rows, PetscInt bs, LatinNodeRows *gathered, PetscInt node, PetscInt l)
{
  const LatinSubdomains *sub       = rows->sub;
  const PetscInt         other     = sub->ends[2 * l] + sub->ends[2 * l + 1] - 2 * (rows->top / bs) - node;
  const PetscReal       *direction = sub->direction + bs * l;
  PetscReal             *own, *far;

  if (other == node) return; /* both ends are the same node: no stiffness */
  far = LatinNodeBlock(rows, gathered, other);
  own = gathered->value;
  for (PetscInt c = 0; c < bs; c++)
    for (PetscInt j = 0; j < bs; j++) {
      const PetscReal k = sub->stiffness[l] * (direction[c] * direction[j]);

      own[bs * c + j] += k;
      far[bs * c + j] -= k;
    }
  if (!gathered->met) return;
  for (PetscInt c = 0, at = (PetscInt)(far - own); c < bs; c++)
    for (PetscInt j = 0; j < bs; j++)
      if (direction[c] * direction[j] != 0.0) gathered->met[bs * c + j] = gathered->met[at + bs * c + j] = PETSC_TRUE;
}

/* Assembles the rows of a node; the diagonal block comes first */
static void LatinNodeGather(const LatinRows *rows, PetscInt node, LatinNodeRows *gathered)
{
  const LatinSubdomains *sub = rows->sub;
  const PetscInt         bs = sub->bs, top = rows->top;
  PetscReal             *own;

  gathered->n = 0;
  own         = LatinNodeBlock(rows, gathered, node);
  for (PetscInt c = 0, r = top + bs * node; c < bs; c++, r++) {
    own[bs * c + c] = rows->spring[r];
    if (sub->ground) own[bs * c + c] += sub->ground[r];
    for (PetscInt k = sub->ki ? sub->ki[r] : 0; sub->ki && k < sub->ki[r + 1]; k++) LatinNodeBlock(rows, gathered, (LatinEntryColumn(sub, r, k) - top) / bs)[bs * c + (LatinEntryColumn(sub, r, k) - top) % bs] += LatinEntry(sub, r, k);
  }
  for (PetscInt k = rows->link_first[node]; k < rows->link_first[node + 1] && !sub->ki; k++) {
    if (bs == 3) LatinNodeLink(rows, 3, gathered, node, rows->link[k]); /* constant loop length */
    else LatinNodeLink(rows, bs, gathered, node, rows->link[k]);
  }
  for (PetscInt c = 0, r = bs * node; c < bs; c++, r++)
    for (PetscInt p = rows->part_first[r]; p < rows->part_first[r + 1]; p++) {
      const LatinBlock *block = &rows->block[rows->part_block[rows->part[p]]];
      const PetscReal  *a     = block->a + (size_t)block->n * (size_t)rows->part_row[rows->part[p]];

      for (PetscInt j = 0; j < block->n; j++) LatinNodeBlock(rows, gathered, (block->dof[j] - top) / bs)[bs * c + (block->dof[j] - top) % bs] += a[j];
    }
}

/*
   Writes row c of a node to K from entry nz on. Held columns and zeros are left out, but not zeros of links with large rotations nor `met` ones, as the
   pattern must not change. Returns the end of the row
*/
static PetscInt LatinNodeRow(const LatinRows *rows, const LatinNodeRows *gathered, PetscInt node, PetscInt c, LatinSparse *K, PetscInt nz)
{
  const PetscInt bs = rows->sub->bs, r = bs * node + c;

  if (rows->held[r]) {
    K->j[nz]   = r;
    K->a[nz++] = 1.0;
    return nz;
  }
  for (PetscInt n = 0; n < gathered->n; n++) {
    const PetscInt   at    = bs * (bs * gathered->slot[n] + c);
    const PetscReal *value = gathered->value + at;

    for (PetscInt j = 0, column = bs * gathered->node[n]; j < bs; j++, column++) {
      if (column != r && ((value[j] == 0.0 && !rows->sub->part && !(gathered->met && gathered->met[at + j])) || rows->held[column])) continue;
      K->j[nz]   = column;
      K->a[nz++] = value[j];
    }
  }
  return nz;
}

/* The same for row r of the operator of a matrix, without blocks: its columns are sorted already */
static PetscInt LatinMatrixRow(const LatinRows *rows, PetscInt r, LatinSparse *K, PetscInt nz)
{
  const LatinSubdomains *sub   = rows->sub;
  const PetscInt         first = nz;
  PetscInt               own   = -1;

  for (PetscInt k = sub->ki[rows->top + r]; k < sub->ki[rows->top + r + 1] && !rows->held[r]; k++) {
    const PetscInt  column = LatinEntryColumn(sub, rows->top + r, k) - rows->top;
    const PetscReal value  = LatinEntry(sub, rows->top + r, k);

    if (column != r && (value == 0.0 || rows->held[column])) continue;
    if (column == r) own = nz;
    K->j[nz]   = column;
    K->a[nz++] = value;
  }
  if (own < 0) { /* the diagonal entry is a spring alone */
    for (own = nz++; own > first && K->j[own - 1] > r; own--) {
      K->j[own] = K->j[own - 1];
      K->a[own] = K->a[own - 1];
    }
    K->j[own] = r;
    K->a[own] = 0.0;
  }
  K->a[own] = rows->held[r] ? 1.0 : rows->spring[rows->top + r] + K->a[own];
  return nz;
}

/*
   Assembles K: the operator of subdomain s plus springs and dense blocks; rows and columns of held dofs are those of the identity. spring[] and held[]
   are arrays over all copies. LatinSparseReset_Private() frees K.
*/
PetscErrorCode LatinSparseCreate_Private(const LatinSubdomains *sub, PetscInt s, const PetscReal spring[], const PetscBool held[], PetscInt blocks, const LatinBlock block[], LatinSparse *K)
{
  const PetscInt bs = sub->bs, top = bs * sub->node_offset[s], nodes = sub->node_offset[s + 1] - sub->node_offset[s];
  LatinRows      rows     = {.sub = sub, .spring = spring, .held = held + top, .top = top, .rows = bs * nodes, .blocks = blocks, .block = block};
  LatinNodeRows  gathered = {.n = 0};
  size_t         entries  = 0;
  PetscInt       most = 0, nz = 0;

  PetscFunctionBegin;
  PetscCall(LatinRowsCreate_Private(&rows, s));
  for (PetscInt i = 0; i < nodes; i++) {
    const PetscInt neighbours = LatinRowsNeighbours(&rows, i);

    most = PetscMax(most, neighbours);
    entries += (size_t)(bs * bs) * (size_t)neighbours;
  }
  PetscCall(PetscMalloc1(bs * nodes + 1, &K->i));
  PetscCall(PetscMalloc2(entries, &K->j, entries, &K->a));
  PetscCall(PetscMalloc3(most, &gathered.node, most, &gathered.slot, bs * bs * most, &gathered.value));
  /* links slacken and stiffnesses cancel, but one symbolic factorisation serves all */
  if (sub->tangent && !sub->part && !sub->ki) PetscCall(PetscMalloc1(bs * bs * most, &gathered.met));
  PetscCall(PetscCalloc1(nodes, &gathered.place));
  for (PetscInt i = 0; i < nodes; i++) {
    if (sub->ki && bs == 1 && rows.part_first[i] == rows.part_first[i + 1]) {
      K->i[i] = nz;
      nz      = LatinMatrixRow(&rows, i, K, nz);
      continue;
    }
    LatinNodeGather(&rows, i, &gathered);
    PetscCall(PetscSortIntWithArray(gathered.n, gathered.node, gathered.slot));
    for (PetscInt c = 0; c < bs; c++) {
      K->i[bs * i + c] = nz;
      nz               = LatinNodeRow(&rows, &gathered, i, c, K, nz);
    }
  }
  K->i[bs * nodes] = nz;
  LatinRoomRelease(K->j + nz, (entries - (size_t)nz) * sizeof(*K->j)); /* releases the unused memory, which may have been touched before */
  LatinRoomRelease(K->a + nz, (entries - (size_t)nz) * sizeof(*K->a));
  K->bs   = bs;
  K->rows = bs * nodes;
  PetscCall(PetscFree3(gathered.node, gathered.slot, gathered.value));
  PetscCall(PetscFree(gathered.met));
  PetscCall(PetscFree(gathered.place));
  PetscCall(LatinRowsDestroy_Private(&rows));
  PetscFunctionReturn(0);
}

/* Recomputes the values of row r of K, see LatinSparseRenew_Private(). top: first row of the subdomain. Returns whether its pattern has not changed */
static PetscBool LatinSparseRenewRow(const LatinSubdomains *sub, PetscInt top, PetscInt r, const PetscReal spring[], const PetscBool held[], LatinSparse *K)
{
  const PetscInt row = top + r, end = K->i[r + 1];
  PetscInt       nz = K->i[r];

  for (PetscInt k = sub->ki[row]; k < sub->ki[row + 1] && !held[row]; k++) {
    const PetscInt  column = LatinEntryColumn(sub, row, k) - top;
    const PetscReal value  = LatinEntry(sub, row, k);

    if (column != r && (value == 0.0 || held[top + column])) continue;     /* no entry of K */
    if (column > r && nz < end && K->j[nz] == r) K->a[nz++] = spring[row]; /* the diagonal entry is a spring alone */
    if (nz == end || K->j[nz] != column) return PETSC_FALSE;
    K->a[nz++] = column == r ? spring[row] + value : value;
  }
  if (nz < end && K->j[nz] == r) K->a[nz++] = held[row] ? 1.0 : spring[row]; /* the same, and nothing behind it */
  return (PetscBool)(nz == end);
}

/*
   Recomputes the values of K, the operator of a subdomain of a matrix without blocks. *same: the pattern has not changed; otherwise the values are
   undefined
*/
PetscErrorCode LatinSparseRenew_Private(const LatinSubdomains *sub, PetscInt s, const PetscReal spring[], const PetscBool held[], LatinSparse *K, PetscBool *same)
{
  const PetscInt top = sub->bs * sub->node_offset[s];

  PetscFunctionBegin;
  *same = (PetscBool)(sub->ki && sub->bs == 1 && K->bs == 1 && K->rows == sub->node_offset[s + 1] - top);
  for (PetscInt r = 0; r < K->rows && *same; r++) *same = LatinSparseRenewRow(sub, top, r, spring, held, K);
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSparseReset_Private(LatinSparse *K)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(K->i));
  PetscCall(PetscFree2(K->j, K->a));
  PetscFunctionReturn(0);
}
