#include "coarse/latincoarse.h"

/*
   Coordinates and near null space of the coarse matrix, for algebraic multigrid, BDDC and a PC latin as its solver.

   A coarse dof is a functional of a displacement field w: R_j^t D w of a macro mode, the value at its node of a primal dof. The near
   null space is restricted by evaluating these functionals: for the near null space of a matrix, or the translations of each
   field and, of displacements, the rotations about the centre of all nodes.
*/

#define LATIN_NEAR_RANK LatinByPrecision(1e-8, 1e-4) /* least part of an independent vector that is orthogonal to the others: half of the digits */

/* Near null space: number of vectors; centre and half width of the bounding box of all nodes, for rotations */
typedef struct {
  PetscInt  count;
  PetscReal centre[3], size;
} LatinNear;

/* Counts the vectors and measures the bounding box. Collective on sub->object */
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

/* Returns vector `which` of the near null space at a dof of the copies */
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

/*
   Computes out[offset[n]][dim + count]: of each coarse dof of the subdomains here, coordinates (of a macro mode the mean of the interface), then values
   of the near null space
*/
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

/* Orthogonalises v against n orthonormal vectors and normalises it. *kept: it is independent of them */
static PetscErrorCode LatinNearOrthogonalise_Private(Vec v, PetscInt n, Vec others[], PetscBool *kept)
{
  PetscReal    part = 1.0, norm = 0.0;
  PetscScalar *dots;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n + 1, &dots));
  PetscCall(VecNormalize(v, &norm));
  for (PetscInt pass = 0; pass < 2 && norm > 0.0; pass++) { /* twice is enough for orthogonality */
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
   Sets coarse->x, and attaches the near null space to coarse->A. Both sides of an interface have the same values up to rounding: the larger one is
   taken. Vectors that are dependent on the coarse dofs (few interfaces, few modes) are left out. Collective on coarse->sub->object.
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
  PetscCall(PetscMalloc1(dim * rows + 1, &coarse->x)); /* + 1: not NULL on a rank without unknowns */
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
