#include "localsolvers/latinlocalsolvers.h"

/*
   Fields that cost next to nothing, as the near null space of a matrix, for algebraic multigrid and BDDC: the affine
   fields of each component and the known fields near to the kernel. A coarse unknown is a number that a displacement
   field gives; fields are carried over by evaluating it, see coarse/levels.c.
*/

#define LATIN_NEAR_RANK LatinByPrecision(1e-8, 1e-4) /* part of a field that is not that of others, at least */

/* Adds weight times what node `dof` of the level below has to the numbers of an unknown at x */
void LatinTraceAdd(const LatinSubdomains *sub, const LatinTraceShape *shape, PetscInt dof, PetscReal weight, const PetscReal x[], PetscReal out[])
{
  const PetscInt   dim = shape->dim, own = sub->trace ? -1 : LatinField(sub, dof);
  const PetscReal *at = sub->x + dim * (dof / sub->bs);

  for (PetscInt c = 0; c < shape->fields; c++) {
    const PetscReal *trace = sub->trace ? sub->trace + (1 + dim) * (c + shape->fields * dof) : NULL;
    const PetscReal  one   = trace ? trace[0] : (c == own ? 1.0 : 0.0);
    PetscReal       *to    = out + dim + (1 + dim) * c;

    to[0] += weight * one;
    for (PetscInt k = 0; k < dim; k++) to[1 + k] += weight * (one * (at[k] - x[k]) + (trace ? trace[1 + k] : 0.0));
  }
  for (PetscInt k = 0; k < shape->nears; k++) out[dim + (1 + dim) * shape->fields + k] += weight * sub->near[dof + sub->bs * sub->copies * k];
}

/* Field `which` of those near to the kernel: the known ones, or translations and, of displacements, rotations about `centre` */
static void LatinNearField(const LatinUnknowns *known, PetscInt which, const PetscReal centre[], PetscReal size, PetscInt rows, PetscScalar out[])
{
  const PetscInt dim = known->dim, fields = known->fields, each = fields * (1 + dim);
  PetscInt       a = 0, b = 1;

  for (PetscInt mode = fields; mode < which; mode++)
    if (++b == dim) b = ++a + 1;
  for (PetscInt i = 0; i < rows; i++) {
    const PetscReal *trace = known->trace + each * i, *x = known->x + dim * i;

    if (known->nears) out[i] = known->near[rows * which + i];
    else if (which < fields) out[i] = trace[(1 + dim) * which];
    else {
      const PetscReal *ta = trace + (1 + dim) * a, *tb = trace + (1 + dim) * b;

      out[i] = (tb[0] * (x[a] - centre[a]) + tb[1 + a] - ta[0] * (x[b] - centre[b]) - ta[1 + b]) / size;
    }
  }
}

/* Middle and size of where the unknowns are */
static PetscErrorCode LatinNearBox_Private(MPI_Comm comm, const LatinUnknowns *known, PetscInt rows, PetscReal centre[], PetscReal *size)
{
  PetscReal box[6];

  PetscFunctionBegin;
  for (PetscInt c = 0; c < 6; c++) box[c] = PETSC_MIN_REAL;
  for (PetscInt i = 0; i < rows; i++)
    for (PetscInt c = 0; c < known->dim; c++) {
      box[c]     = PetscMax(box[c], known->x[known->dim * i + c]);
      box[3 + c] = PetscMax(box[3 + c], -known->x[known->dim * i + c]);
    }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, box, 6, MPIU_REAL, MPIU_MAX, comm));
  *size = 0.0;
  for (PetscInt c = 0; c < known->dim; c++) {
    centre[c] = 0.5 * (box[c] - box[3 + c]);
    *size     = PetscMax(*size, 0.5 * (box[c] + box[3 + c]));
  }
  if (!(*size > 0.0)) *size = 1.0;
  PetscFunctionReturn(0);
}

/*
   Attaches what is near to the kernel to A, whose rows `known` is about. Fields that are the same to its unknowns (few
   interfaces, few modes) are left out. Collective on A.
*/
PetscErrorCode LatinNearNullSpace_Private(const LatinUnknowns *known, Mat A)
{
  MPI_Comm     comm      = PetscObjectComm((PetscObject)A);
  PetscReal    centre[3] = {0.0, 0.0, 0.0}, size = 1.0;
  PetscInt     rows, count, kept = 0;
  MatNullSpace near;
  Vec         *v;

  PetscFunctionBegin;
  PetscCall(MatGetLocalSize(A, &rows, NULL));
  PetscCall(LatinNearBox_Private(comm, known, rows, centre, &size));
  count = known->fields + (known->fields == known->dim ? known->dim * (known->dim - 1) / 2 : 0);
  if (known->nears) count = known->nears;
  PetscCall(PetscMalloc1(count, &v));
  for (PetscInt k = 0; k < count; k++) {
    PetscScalar *a, *dots;
    PetscReal    part = 1.0, norm = 0.0;

    PetscCall(MatCreateVecs(A, &v[kept], NULL));
    PetscCall(VecGetArrayWrite(v[kept], &a));
    LatinNearField(known, k, centre, size, rows, a);
    PetscCall(VecRestoreArrayWrite(v[kept], &a));
    PetscCall(PetscMalloc1(kept + 1, &dots));
    PetscCall(VecNormalize(v[kept], &norm));
    for (PetscInt pass = 0; pass < 2 && norm > 0.0; pass++) { /* twice is enough */
      PetscCall(VecMDot(v[kept], kept, v, dots));
      for (PetscInt j = 0; j < kept; j++) dots[j] = -dots[j];
      PetscCall(VecMAXPY(v[kept], kept, dots, v));
      PetscCall(VecNormalize(v[kept], &norm));
      part *= norm;
    }
    PetscCall(PetscFree(dots));
    if (norm > 0.0 && part > LATIN_NEAR_RANK) kept++;
    else PetscCall(VecDestroy(&v[kept]));
  }
  PetscCall(MatNullSpaceCreate(comm, PETSC_FALSE, kept, v, &near));
  PetscCall(MatSetNearNullSpace(A, near));
  PetscCall(MatNullSpaceDestroy(&near));
  for (PetscInt k = 0; k < kept; k++) PetscCall(VecDestroy(&v[k]));
  PetscCall(PetscFree(v));
  PetscFunctionReturn(0);
}
