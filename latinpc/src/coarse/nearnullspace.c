#include "coarse/latincoarse.h"

/*
   What the coarse matrix carries, as a matrix of finite elements does, for algebraic multigrid, BDDC, and a PC latin of its
   own: where its unknowns are, and which fields cost next to nothing, as its near null space.

   A coarse unknown is a number that a displacement field w gives: R_j^t D w for a macro mode, w at its node for a primal
   one. So fields are carried over by evaluating it: the near null space of a matrix that has one, or the translations of
   each component and, of displacements, rotations about the middle of all nodes.
*/

#define LATIN_NEAR_RANK LatinByPrecision(1e-8, 1e-4) /* part of a field that is not that of others, at least */

/* Fields near to the kernel, and the middle and half the width of the nodes that rotations refer to */
typedef struct {
  PetscInt  count;
  PetscReal centre[3], size;
} LatinNear;

static PetscErrorCode LatinNearSetUp_Private(const LatinSubdomains *sub, LatinNear *near)
{
  const PetscInt dim    = sub->dim;
  PetscReal      box[6] = {PETSC_MIN_REAL, PETSC_MIN_REAL, PETSC_MIN_REAL, PETSC_MIN_REAL, PETSC_MIN_REAL, PETSC_MIN_REAL};

  PetscFunctionBegin;
  near->count = sub->nears ? sub->nears : sub->fields + (sub->fields == dim ? dim * (dim - 1) / 2 : 0);
  near->size  = 0.0;
  for (PetscInt i = 0; i < dim * sub->copies; i++) {
    box[i % dim]     = PetscMax(box[i % dim], sub->x[i]);
    box[3 + i % dim] = PetscMax(box[3 + i % dim], -sub->x[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, box, 6, MPIU_REAL, MPIU_MAX, PetscObjectComm(sub->object)));
  for (PetscInt c = 0; c < dim; c++) {
    near->centre[c] = 0.5 * (box[c] - box[3 + c]);
    near->size      = PetscMax(near->size, 0.5 * (box[c] + box[3 + c]));
  }
  if (!(near->size > 0.0)) near->size = 1.0;
  PetscFunctionReturn(0);
}

/* A field at an entry of the copy arrays */
static PetscReal LatinNearField(const LatinSubdomains *sub, const LatinNear *near, PetscInt which, PetscInt dof)
{
  const PetscReal *x = sub->x + sub->dim * (dof / sub->bs);
  const PetscInt   c = LatinField(sub, dof);
  PetscInt         a = 0, b = 1;

  if (sub->nears) return sub->near[dof + sub->bs * sub->copies * which];
  if (which < sub->fields) return c == which ? 1.0 : 0.0;
  for (PetscInt mode = sub->fields; mode < which; mode++)
    if (++b == sub->dim) b = ++a + 1;
  if (c == b) return (x[a] - near->centre[a]) / near->size;
  return c == a ? (near->centre[b] - x[b]) / near->size : 0.0;
}

/* The places of the coarse unknowns of the subdomains here, means of the nodes of an interface, and their numbers of all fields: [offset[n]][dim + count] */
static PetscErrorCode LatinNearCollect_Private(const LatinCoarse *coarse, const LatinNear *near, PetscReal out[])
{
  const LatinSubdomains *sub   = coarse->sub;
  const LatinInterfaces *inter = coarse->inter;
  const PetscInt         dim = sub->dim, width = dim + near->count;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(out, width * coarse->offset[sub->n]));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscInt   dof = inter->side_dof[k];
      const PetscReal *row = LatinMacroDualRow(coarse->macro, f, k);

      for (PetscInt j = 0; j < coarse->macro->of[f].modes; j++) {
        PetscReal *to = out + width * (coarse->offset[face->sub] + coarse->macro->of[f].at + j);

        for (PetscInt c = 0; c < dim; c++) to[c] += sub->x[dim * (dof / sub->bs) + c] / (face->side_last - face->side_first);
        for (PetscInt w = 0; w < near->count; w++) to[dim + w] += row[j] * LatinNearField(sub, near, w, dof);
      }
    }
  }
  for (PetscInt s = 0; s < sub->n; s++)
    for (PetscInt p = inter->primal_offset[s]; p < inter->primal_offset[s + 1]; p++) {
      const PetscInt dof = inter->primal_dof[p];
      PetscReal     *to  = out + width * (coarse->offset[s] + coarse->macro_count[s] + p - inter->primal_offset[s]);

      for (PetscInt c = 0; c < dim; c++) to[c] = sub->x[dim * (dof / sub->bs) + c];
      for (PetscInt w = 0; w < near->count; w++) to[dim + w] = LatinNearField(sub, near, w, dof);
    }
  PetscFunctionReturn(0);
}

/* The part of v that is not that of the others, normalised; *kept: there is one */
static PetscErrorCode LatinNearOrthogonalise_Private(Vec v, PetscInt n, Vec others[], PetscBool *kept)
{
  PetscReal    part = 1.0, norm = 0.0;
  PetscScalar *dots;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n + 1, &dots));
  PetscCall(VecNormalize(v, &norm));
  for (PetscInt pass = 0; pass < 2 && norm > 0.0; pass++) { /* twice is enough */
    PetscCall(VecMDot(v, n, others, dots));
    for (PetscInt j = 0; j < n; j++) dots[j] = -dots[j];
    PetscCall(VecMAXPY(v, n, dots, others));
    PetscCall(VecNormalize(v, &norm));
    part *= norm;
  }
  *kept = (PetscBool)(norm > 0.0 && part > LATIN_NEAR_RANK);
  PetscCall(PetscFree(dots));
  PetscFunctionReturn(0);
}

/*
   Sets coarse.x, and attaches the near null space to coarse.A. Both sides of an interface have the same numbers, to
   rounding: the larger one counts. Fields that are the same to the coarse unknowns (few interfaces, few modes) are left
   out. Collective on coarse->sub->object.
*/
PetscErrorCode LatinCoarseNear_Private(LatinCoarse *coarse)
{
  const PetscInt dim = coarse->sub->dim, rows = coarse->top_local;
  LatinNear      near;
  PetscInt       width, kept = 0;
  PetscReal     *leaf, *root;
  MatNullSpace   space;
  Vec           *v;

  PetscFunctionBegin;
  PetscCall(LatinNearSetUp_Private(coarse->sub, &near));
  width = dim + near.count;
  PetscCall(PetscMalloc3(width * coarse->offset[coarse->sub->n], &leaf, width * rows, &root, near.count, &v));
  PetscCall(LatinNearCollect_Private(coarse, &near, leaf));
  for (PetscInt i = 0; i < width * rows; i++) root[i] = PETSC_MIN_REAL;
  PetscCall(LatinSFReduce_Private(coarse->top_sf, width, MPIU_REAL, leaf, root, MPI_MAX));
  PetscCall(PetscMalloc1(dim * rows + 1, &coarse->x)); /* one more than needed: not NULL on a rank without unknowns */
  for (PetscInt i = 0; i < rows; i++) PetscCall(PetscArraycpy(coarse->x + dim * i, root + width * i, dim));
  for (PetscInt w = 0; w < near.count; w++) {
    PetscScalar *a;
    PetscBool    more = PETSC_FALSE;

    PetscCall(MatCreateVecs(coarse->A, &v[kept], NULL));
    PetscCall(VecGetArrayWrite(v[kept], &a));
    for (PetscInt i = 0; i < rows; i++) a[i] = root[width * i + dim + w];
    PetscCall(VecRestoreArrayWrite(v[kept], &a));
    PetscCall(LatinNearOrthogonalise_Private(v[kept], kept, v, &more));
    if (more) kept++;
    else PetscCall(VecDestroy(&v[kept]));
  }
  PetscCall(MatNullSpaceCreate(PetscObjectComm((PetscObject)coarse->A), PETSC_FALSE, kept, v, &space));
  PetscCall(MatSetNearNullSpace(coarse->A, space));
  PetscCall(MatNullSpaceDestroy(&space));
  for (PetscInt k = 0; k < kept; k++) PetscCall(VecDestroy(&v[k]));
  PetscCall(PetscFree3(leaf, root, v));
  PetscFunctionReturn(0);
}
