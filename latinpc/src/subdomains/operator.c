#include "subdomains/latinsubdomains.h"

/*
   The operators of the subdomains without search directions: B^t k B of the links plus springs to the ground, or rows of a matrix
   (subdomains/matis.c). The other stages use them through this file and subdomains/sparse.c alone: product, diagonal, dense and
   sparse matrix, and data to compare operators.
*/

/* Computes f = K v, subdomain by subdomain */
PetscErrorCode LatinOperatorMult(const LatinSubdomains *sub, const PetscReal v[], PetscReal f[])
{
  const PetscInt bs = sub->bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) f[i] = sub->ground ? sub->ground[i] * v[i] : 0.0;
  for (PetscInt i = 0; i < sub->copies && sub->ki; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++) f[i] += LatinEntry(sub, i, k) * v[LatinEntryColumn(sub, i, k)];
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
  PetscCall(PetscLogFlops((sub->ki ? 2.0 * sub->ki[sub->copies] : 0.0) + (8.0 * bs + 1.0) * sub->links + (sub->ground ? 1.0 * bs * sub->copies : 0.0)));
  PetscFunctionReturn(0);
}

/* Computes the diagonal of the operators, [copies * bs] */
PetscErrorCode LatinOperatorDiagonal(const LatinSubdomains *sub, PetscReal diagonal[])
{
  const PetscInt bs = sub->bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) diagonal[i] = sub->ground ? sub->ground[i] : 0.0;
  for (PetscInt i = 0; i < sub->copies && sub->ki; i++) {
    const PetscInt at = sub->dense ? sub->ki[i] + i : sub->kd[i];

    if (at >= 0) diagonal[i] = LatinEntry(sub, i, at);
  }
  PetscCall(PetscLogFlops(4.0 * bs * sub->links));
  for (PetscInt l = 0; l < sub->links; l++)
    for (PetscInt c = 0; c < bs; c++) {
      const PetscReal v = sub->stiffness[l] * PetscSqr(sub->direction[bs * l + c]);

      diagonal[bs * sub->ends[2 * l] + c] += v;
      diagonal[bs * sub->ends[2 * l + 1] + c] += v;
    }
  PetscFunctionReturn(0);
}

/* Copies a block of the operator of subdomain s of a matrix to A (n x n). position[row]: row and column in A, -1: not in it */
void LatinOperatorDense(const LatinSubdomains *sub, PetscInt s, PetscInt n, const PetscInt position[], PetscReal A[])
{
  const PetscInt top = sub->node_offset[s];

  for (size_t i = 0; i < (size_t)n * (size_t)n; i++) A[i] = 0.0;
  for (PetscInt i = top; i < sub->node_offset[s + 1]; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1] && position[i - top] >= 0; k++)
      if (position[LatinEntryColumn(sub, i, k) - top] >= 0) A[(size_t)position[LatinEntryColumn(sub, i, k) - top] + (size_t)n * (size_t)position[i - top]] = LatinEntry(sub, i, k);
}

/* Appends all data of the operator of a subdomain to a stream: equal streams mean equal operators */
PetscErrorCode LatinOperatorStream_Private(const LatinSubdomains *sub, PetscInt s, LatinStream *stream)
{
  const PetscInt bs = sub->bs, top = sub->node_offset[s], first = sub->ki ? 0 : sub->link_offset[s], links = sub->ki ? 0 : sub->link_offset[s + 1] - first;
  unsigned char *room = NULL;

  PetscFunctionBegin;
  if (sub->ki) {
    for (PetscInt i = top; i < sub->node_offset[s + 1]; i++) {
      const PetscInt n = sub->ki[i + 1] - sub->ki[i];

      PetscCall(LatinStreamAdd_Private(stream, &n, sizeof(n)));
      if (sub->dense) { /* the only subdomain here */
        PetscCall(LatinStreamAdd_Private(stream, sub->dense_a + (size_t)n * (size_t)(i - top), (size_t)n * sizeof(*sub->dense_a)));
        continue;
      }
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
