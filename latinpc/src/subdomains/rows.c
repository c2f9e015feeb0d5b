#include "subdomains/latinsubdomains.h"

/*
   Rows of the subdomains' operators, block by block: each copy's neighbours, joined to it by links or by entries of a
   matrix, and the blocks that join it to them. Others may join more neighbours between LatinRowsOpen() and
   LatinRowsFill_Private().
*/

/* `more`: neighbours that a copy may have beside those of the operator */
PetscErrorCode LatinRowsCreate_Private(const LatinSubdomains *sub, PetscInt more, LatinRows *rows)
{
  PetscInt most = 0, widest;

  PetscFunctionBegin;
  rows->sub = sub;
  PetscCall(PetscCalloc1(sub->copies + 2, &rows->offset));
  PetscCall(PetscMalloc1(2 * sub->links, &rows->list));
  for (PetscInt i = 0; i < 2 * sub->links; i++) rows->offset[sub->ends[i] + 2]++;
  for (PetscInt i = 0; i < sub->copies; i++) {
    most = PetscMax(most, rows->offset[i + 2] + (sub->ki ? sub->ki[i + 1] - sub->ki[i] : 0));
    rows->offset[i + 2] += rows->offset[i + 1];
  }
  for (PetscInt i = 0; i < 2 * sub->links; i++) rows->list[rows->offset[sub->ends[i] + 1]++] = i / 2;
  widest = 1 + most + more;
  PetscCall(PetscMalloc3(widest, &rows->neighbour, sub->bs * sub->bs * widest, &rows->block, sub->copies, &rows->slot));
  for (PetscInt i = 0; i < sub->copies; i++) rows->slot[i] = -1;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinRowsDestroy_Private(LatinRows *rows)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(rows->offset));
  PetscCall(PetscFree(rows->list));
  PetscCall(PetscFree3(rows->neighbour, rows->block, rows->slot));
  PetscFunctionReturn(0);
}

/* Appends copy j to the n neighbours that are there, once */
void LatinRowsJoin(LatinRows *rows, PetscInt j, PetscInt *n)
{
  if (rows->slot[j] >= 0) return;
  rows->slot[j]           = 0;
  rows->neighbour[(*n)++] = j;
}

/* The other end of a link at copy i */
static inline PetscInt LatinRowsOther(const LatinSubdomains *sub, PetscInt l, PetscInt i)
{
  return sub->ends[2 * l] == i ? sub->ends[2 * l + 1] : sub->ends[2 * l];
}

/* Copy i and its neighbours in the operator, in no order */
void LatinRowsOpen(LatinRows *rows, PetscInt i, PetscInt *n)
{
  const LatinSubdomains *sub = rows->sub;

  *n = 0;
  LatinRowsJoin(rows, i, n);
  for (PetscInt p = rows->offset[i]; p < rows->offset[i + 1]; p++) LatinRowsJoin(rows, LatinRowsOther(sub, rows->list[p], i), n);
  for (PetscInt k = sub->ki ? sub->ki[i] : 0; sub->ki && k < sub->ki[i + 1]; k++) LatinRowsJoin(rows, sub->kj[k], n);
}

/* Sorts the n neighbours and fills their blocks of row i: the operator, and the diagonal springs */
PetscErrorCode LatinRowsFill_Private(LatinRows *rows, PetscInt i, const PetscReal spring[], PetscInt n)
{
  const LatinSubdomains *sub = rows->sub;
  const PetscInt         bs = sub->bs, bb = bs * bs;

  PetscFunctionBegin;
  PetscCall(PetscSortInt(n, rows->neighbour));
  for (PetscInt p = 0; p < n; p++) rows->slot[rows->neighbour[p]] = p;
  PetscCall(PetscArrayzero(rows->block, bb * n));
  for (PetscInt c = 0; sub->ground && c < bs; c++) rows->block[bb * rows->slot[i] + c * bs + c] += sub->ground[bs * i + c];
  for (PetscInt p = rows->offset[i]; p < rows->offset[i + 1]; p++) {
    const PetscInt   l = rows->list[p], j = LatinRowsOther(sub, l, i);
    const PetscReal *v = sub->direction + bs * l, k = sub->stiffness[l];
    PetscReal       *own = rows->block + bb * rows->slot[i], *other = rows->block + bb * rows->slot[j];

    for (PetscInt c = 0; c < bs; c++)
      for (PetscInt b = 0; b < bs; b++) {
        own[c * bs + b] += k * v[c] * v[b];
        other[c * bs + b] -= k * v[c] * v[b];
      }
  }
  for (PetscInt k = sub->ki ? sub->ki[i] : 0; sub->ki && k < sub->ki[i + 1]; k++) rows->block[rows->slot[sub->kj[k]]] += sub->ka[k];
  for (PetscInt c = 0; c < bs; c++) rows->block[bb * rows->slot[i] + c * bs + c] += spring[bs * i + c];
  PetscFunctionReturn(0);
}

/* Forgets the neighbours, for the next row */
void LatinRowsClose(LatinRows *rows, PetscInt n)
{
  for (PetscInt p = 0; p < n; p++) rows->slot[rows->neighbour[p]] = -1;
}

/* Block row i of the operator with the given diagonal springs: neighbours in increasing order and their blocks */
PetscErrorCode LatinRowsGet_Private(LatinRows *rows, PetscInt i, const PetscReal spring[], PetscInt *count)
{
  PetscFunctionBegin;
  LatinRowsOpen(rows, i, count);
  PetscCall(LatinRowsFill_Private(rows, i, spring, *count));
  LatinRowsClose(rows, *count);
  PetscFunctionReturn(0);
}

/* The operator of subdomain s and springs; rows and columns held[] are those of the identity */
PetscErrorCode LatinRowsMatrix_Private(LatinRows *rows, PetscInt s, const PetscReal spring[], const PetscBool held[], LatinSparse *K)
{
  const LatinSubdomains *sub = rows->sub;
  const PetscInt         bs = sub->bs, top = bs * sub->node_offset[s];

  PetscFunctionBegin;
  K->rows = bs * sub->node_offset[s + 1] - top;
  PetscCall(PetscMalloc1(K->rows + 1, &K->i));
  for (PetscInt pass = 0; pass < 2; pass++) {
    PetscInt nz = 0, n = 0;

    for (PetscInt dof = top; dof < top + K->rows; dof++) {
      if (dof % bs == 0) PetscCall(LatinRowsGet_Private(rows, dof / bs, spring, &n));
      K->i[dof - top] = nz;
      for (PetscInt q = 0; q < n; q++)
        for (PetscInt b = 0; b < bs; b++) {
          const PetscInt col = bs * rows->neighbour[q] + b;

          if (col != dof && (held[dof] || held[col])) continue;
          if (pass) {
            K->j[nz] = col - top;
            K->a[nz] = held[dof] ? 1.0 : rows->block[bs * bs * q + (dof % bs) * bs + b];
          }
          nz++;
        }
    }
    K->i[K->rows] = nz;
    if (!pass) PetscCall(PetscMalloc2(nz, &K->j, nz, &K->a));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSparseReset_Private(LatinSparse *K)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(K->i));
  PetscCall(PetscFree2(K->j, K->a));
  PetscFunctionReturn(0);
}
