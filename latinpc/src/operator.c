#include "latinimpl.h"

/*
   The operators of the subdomains without springs of the search direction: B^t k B of the links, and of the springs to
   the ground if there are any; or the rows that a matrix gives (matis.c). The other stages see them through this file
   alone: a product, the diagonal, the rows (by way of graph.c), and what tells equal ones.
*/

/* f = K v, subdomain by subdomain */
PetscErrorCode LatinOperatorMult(Latin latin, const PetscReal v[], PetscReal f[])
{
  LatinSubstructure *sub = &latin->sub;
  const PetscInt     bs  = sub->bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) f[i] = sub->ground ? sub->ground[i] * v[i] : 0.0;
  for (PetscInt i = 0; i < sub->copies && sub->ki; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++) f[i] += sub->ka[k] * v[sub->kj[k]];
  for (PetscInt l = 0; l < sub->links; l++) {
    const PetscReal *n = sub->direction + bs * l;
    const PetscInt   a = bs * sub->ends[2 * l], b = bs * sub->ends[2 * l + 1];
    PetscReal        t = 0.0;

    for (PetscInt c = 0; c < bs; c++) t += n[c] * (v[b + c] - v[a + c]);
    t *= sub->stiffness[l];
    for (PetscInt c = 0; c < bs; c++) {
      f[a + c] -= t * n[c];
      f[b + c] += t * n[c];
    }
  }
  PetscFunctionReturn(0);
}

PetscErrorCode LatinOperatorDiagonal(Latin latin, PetscReal diagonal[])
{
  LatinSubstructure *sub = &latin->sub;
  const PetscInt     bs  = sub->bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) diagonal[i] = sub->ground ? sub->ground[i] : 0.0;
  for (PetscInt i = 0; i < sub->copies && sub->ki; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++)
      if (sub->kj[k] == i) diagonal[i] = sub->ka[k];
  for (PetscInt l = 0; l < sub->links; l++)
    for (PetscInt c = 0; c < bs; c++) {
      const PetscReal v = sub->stiffness[l] * PetscSqr(sub->direction[bs * l + c]);

      diagonal[bs * sub->ends[2 * l] + c] += v;
      diagonal[bs * sub->ends[2 * l + 1] + c] += v;
    }
  PetscFunctionReturn(0);
}

/* ---- rows: each copy's neighbours, then the blocks that join it to them ---- */

/* Adds the most neighbours that a copy can have */
PetscErrorCode LatinOperatorRowsCreate_Private(Latin latin, LatinGraph *graph, PetscInt *widest)
{
  LatinSubstructure *sub  = &latin->sub;
  PetscInt           most = 0;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(sub->copies + 2, &graph->offset));
  PetscCall(PetscMalloc1(2 * sub->links, &graph->list));
  for (PetscInt i = 0; i < 2 * sub->links; i++) graph->offset[sub->ends[i] + 2]++;
  for (PetscInt i = 0; i < sub->copies; i++) {
    most = PetscMax(most, graph->offset[i + 2] + (sub->ki ? sub->ki[i + 1] - sub->ki[i] : 0));
    graph->offset[i + 2] += graph->offset[i + 1];
  }
  for (PetscInt i = 0; i < 2 * sub->links; i++) graph->list[graph->offset[sub->ends[i] + 1]++] = i / 2;
  *widest += most;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinOperatorRowsDestroy_Private(LatinGraph *graph)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(graph->offset));
  PetscCall(PetscFree(graph->list));
  PetscFunctionReturn(0);
}

/* Appends the neighbours of copy i that have no slot yet to the n that are there */
void LatinOperatorRowJoin(Latin latin, LatinGraph *graph, PetscInt i, PetscInt *n)
{
  const LatinSubstructure *sub = &latin->sub;

  for (PetscInt p = graph->offset[i]; p < graph->offset[i + 1]; p++) {
    const PetscInt l = graph->list[p], j = sub->ends[2 * l] == i ? sub->ends[2 * l + 1] : sub->ends[2 * l];

    if (graph->slot[j] >= 0) continue;
    graph->slot[j]           = 0;
    graph->neighbour[(*n)++] = j;
  }
  for (PetscInt k = sub->ki ? sub->ki[i] : 0; sub->ki && k < sub->ki[i + 1]; k++) {
    if (graph->slot[sub->kj[k]] >= 0) continue;
    graph->slot[sub->kj[k]]  = 0;
    graph->neighbour[(*n)++] = sub->kj[k];
  }
}

/* Adds the blocks of row i, each in the slot of its neighbour */
void LatinOperatorRowAdd(Latin latin, LatinGraph *graph, PetscInt i)
{
  const LatinSubstructure *sub = &latin->sub;
  const PetscInt           bs = sub->bs, bb = bs * bs;

  for (PetscInt c = 0; sub->ground && c < bs; c++) graph->block[bb * graph->slot[i] + c * bs + c] += sub->ground[bs * i + c];
  for (PetscInt p = graph->offset[i]; p < graph->offset[i + 1]; p++) {
    const PetscInt   l = graph->list[p], j = sub->ends[2 * l] == i ? sub->ends[2 * l + 1] : sub->ends[2 * l];
    const PetscReal *v = sub->direction + bs * l, k = sub->stiffness[l];
    PetscReal       *own = graph->block + bb * graph->slot[i], *other = graph->block + bb * graph->slot[j];

    for (PetscInt c = 0; c < bs; c++)
      for (PetscInt b = 0; b < bs; b++) {
        own[c * bs + b] += k * v[c] * v[b];
        other[c * bs + b] -= k * v[c] * v[b];
      }
  }
  for (PetscInt k = sub->ki ? sub->ki[i] : 0; sub->ki && k < sub->ki[i + 1]; k++) graph->block[graph->slot[sub->kj[k]]] += sub->ka[k];
}

/* Everything that the operator of a subdomain depends on: equal streams, equal operators */
PetscErrorCode LatinOperatorStream_Private(Latin latin, PetscInt s, LatinStream *stream)
{
  LatinSubstructure *sub = &latin->sub;
  const PetscInt     bs = sub->bs, top = sub->node_offset[s], first = sub->ki ? 0 : sub->link_offset[s], links = sub->ki ? 0 : sub->link_offset[s + 1] - first;
  unsigned char     *room = NULL;

  PetscFunctionBegin;
  if (sub->ki) {
    for (PetscInt i = top; i < sub->node_offset[s + 1]; i++) {
      const PetscInt n = sub->ki[i + 1] - sub->ki[i];

      PetscCall(LatinStreamAdd_Private(stream, &n, sizeof(n)));
      for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++) {
        const PetscInt j = sub->kj[k] - top;

        PetscCall(LatinStreamAdd_Private(stream, &j, sizeof(j)));
      }
      PetscCall(LatinStreamAdd_Private(stream, sub->ka + sub->ki[i], (size_t)n * sizeof(*sub->ka)));
    }
    PetscFunctionReturn(0);
  }
  PetscCall(LatinStreamAdd_Private(stream, &links, sizeof(links)));
  PetscCall(LatinStreamRoom_Private(stream, (size_t)(2 * links) * sizeof(PetscInt), &room));
  for (PetscInt i = 2 * first; i < 2 * (first + links); i++, room += sizeof(PetscInt)) {
    const PetscInt end = sub->ends[i] - top;

    memcpy(room, &end, sizeof(end));
  }
  if (sub->ground) PetscCall(LatinStreamAdd_Private(stream, sub->ground + bs * top, (size_t)(bs * (sub->node_offset[s + 1] - top)) * sizeof(PetscReal)));
  PetscCall(LatinStreamAdd_Private(stream, sub->stiffness + first, (size_t)links * sizeof(PetscReal)));
  PetscCall(LatinStreamAdd_Private(stream, sub->direction + bs * first, (size_t)(bs * links) * sizeof(PetscReal)));
  PetscFunctionReturn(0);
}
