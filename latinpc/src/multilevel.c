#include "latinimpl.h"

/*
   The coarse problem as the problem of another level. Its operator carries what a matrix of finite elements does: where
   its unknowns are, which fields cost next to nothing (the near null space, for algebraic multigrid and BDDC), and, for
   a coarse solver that is itself of type latin, groups of subdomains as its subdomains.

   A coarse unknown is a number a that a displacement field w gives, a(w) = R_j^t d w for a macro mode, w at its node for a
   primal one. So fields are carried over by evaluating a: that of a unit translation of each component, and of each of
   its unit gradients around a point x near to the unknown, the mean of the nodes of its interface. These numbers (the
   trace) are those of equal subdomains wherever they are, and give the affine fields of every frame: macro.c makes of
   them what it makes of nodes.
*/

static const char LatinLevelName[] = "LatinLevel";

#define LATIN_LEVEL_RANK LatinByPrecision(1e-8, 1e-4) /* part of a field that is not that of others, at least */

/* What a coarse solver sees of one coarse unknown of a subdomain: its place, its trace, the known fields */
typedef struct {
  PetscInt dim, fields, nears, width;
} LatinLevelShape;

/* Adds weight times what node `dof` of the level below has to the numbers of an unknown at x */
static void LatinLevelAdd(const LatinSubstructure *sub, const LatinLevelShape *shape, PetscInt dof, PetscReal weight, const PetscReal x[], PetscReal out[])
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

/* The numbers of the coarse unknowns of the subdomains here, [offset[n]][width] */
static PetscErrorCode LatinLevelCollect_Private(Latin latin, const LatinLevelShape *shape, PetscReal out[])
{
  LatinSubstructure *sub    = &latin->sub;
  LatinInterfaces   *inter  = &latin->inter;
  LatinCoarse       *coarse = &latin->coarse;
  const PetscInt     dim    = shape->dim;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(out, shape->width * coarse->offset[sub->n]));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;
    PetscReal             x[3] = {0.0, 0.0, 0.0}, origin[3] = {0.0, 0.0, 0.0};

    if (!face->modes) continue;
    for (PetscInt k = face->side_first; k < face->side_last; k++)
      for (PetscInt c = 0; c < dim; c++) {
        const PetscReal at = sub->x[dim * (inter->side_dof[k] / sub->bs) + c];

        if (k == face->side_first) origin[c] = at;
        x[c] += at - origin[c];
      }
    for (PetscInt c = 0; c < dim; c++) x[c] = origin[c] + x[c] / rows;
    for (PetscInt j = 0; j < face->modes; j++) {
      PetscReal *to = out + shape->width * (face->local_first + j);

      for (PetscInt c = 0; c < dim; c++) to[c] = x[c];
      for (PetscInt k = face->side_first; k < face->side_last; k++) LatinLevelAdd(sub, shape, inter->side_dof[k], LatinMacroDualRow(&latin->macro, face, k)[j], x, to);
    }
  }
  for (PetscInt s = 0; s < sub->n; s++)
    for (PetscInt p = latin->linear.primal_offset[s]; p < latin->linear.primal_offset[s + 1]; p++) {
      const PetscInt   dof = latin->linear.primal_dof[p];
      const PetscReal *x   = sub->x + dim * (dof / sub->bs);
      PetscReal       *to  = out + shape->width * (coarse->offset[s] + coarse->macro_count[s] + p - latin->linear.primal_offset[s]);

      for (PetscInt c = 0; c < dim; c++) to[c] = x[c];
      LatinLevelAdd(sub, shape, dof, 1.0, x, to);
    }
  PetscFunctionReturn(0);
}

/* known, for the coarse unknowns that this rank numbers. Both sides of an interface have the same numbers, to rounding: the larger one counts */
static PetscErrorCode LatinLevelKnow_Private(Latin latin, LatinUnknowns *known)
{
  LatinSubstructure    *sub    = &latin->sub;
  LatinCoarse          *coarse = &latin->coarse;
  const PetscInt        rows = coarse->top_local, each = sub->fields * (1 + sub->dim);
  const LatinLevelShape shape = {sub->dim, sub->fields, sub->nears, sub->dim + each + sub->nears};
  PetscReal            *leaf, *root;

  PetscFunctionBegin;
  PetscCall(LatinUnknownsReset_Private(known));
  known->dim    = sub->dim;
  known->fields = sub->fields;
  known->nears  = sub->nears;
  PetscCall(PetscMalloc2(shape.width * coarse->offset[sub->n], &leaf, shape.width * rows, &root));
  PetscCall(LatinLevelCollect_Private(latin, &shape, leaf));
  for (PetscInt i = 0; i < shape.width * rows; i++) root[i] = PETSC_MIN_REAL;
  PetscCall(LatinSFReduce_Private(coarse->top_sf, shape.width, MPIU_REAL, leaf, root, MPI_MAX));
  /* one more than needed: not NULL on a rank without unknowns */
  PetscCall(PetscMalloc1(sub->dim * rows + 1, &known->x));
  PetscCall(PetscMalloc1(each * rows + 1, &known->trace));
  PetscCall(PetscMalloc1(sub->nears * rows + 1, &known->near));
  PetscCall(PetscCalloc1(rows + 1, &known->field));
  for (PetscInt i = 0; i < rows; i++) {
    const PetscReal *from = root + shape.width * i;

    PetscCall(PetscArraycpy(known->x + sub->dim * i, from, sub->dim));
    PetscCall(PetscArraycpy(known->trace + each * i, from + sub->dim, each));
    for (PetscInt k = 0; k < sub->nears; k++) known->near[rows * k + i] = from[sub->dim + each + k];
  }
  PetscCall(PetscFree2(leaf, root));
  PetscFunctionReturn(0);
}

/* Field `which` of those near to the kernel: the known ones, or translations and, of displacements, rotations about `centre` */
static void LatinLevelField(const LatinUnknowns *known, PetscInt which, const PetscReal centre[], PetscReal size, PetscInt rows, PetscScalar out[])
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
static PetscErrorCode LatinLevelBox_Private(MPI_Comm comm, const LatinUnknowns *known, PetscInt rows, PetscReal centre[], PetscReal *size)
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
   Attaches what is near to the kernel to A, whose rows `known` is about. Fields that its unknowns cannot tell apart (few
   interfaces, few modes) are left out. Collective on A.
*/
static PetscErrorCode LatinLevelNear_Private(const LatinUnknowns *known, Mat A)
{
  MPI_Comm     comm      = PetscObjectComm((PetscObject)A);
  PetscReal    centre[3] = {0.0, 0.0, 0.0}, size = 1.0;
  PetscInt     rows, count, kept = 0;
  MatNullSpace near;
  Vec         *v;

  PetscFunctionBegin;
  PetscCall(MatGetLocalSize(A, &rows, NULL));
  PetscCall(LatinLevelBox_Private(comm, known, rows, centre, &size));
  count = known->fields + (known->fields == known->dim ? known->dim * (known->dim - 1) / 2 : 0);
  if (known->nears) count = known->nears;
  PetscCall(PetscMalloc1(count, &v));
  for (PetscInt k = 0; k < count; k++) {
    PetscScalar *a, *dots;
    PetscReal    part = 1.0, norm = 0.0;

    PetscCall(MatCreateVecs(A, &v[kept], NULL));
    PetscCall(VecGetArrayWrite(v[kept], &a));
    LatinLevelField(known, k, centre, size, rows, a);
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
    if (norm > 0.0 && part > LATIN_LEVEL_RANK) kept++;
    else PetscCall(VecDestroy(&v[kept]));
  }
  PetscCall(MatNullSpaceCreate(comm, PETSC_FALSE, kept, v, &near));
  PetscCall(MatSetNearNullSpace(A, near));
  PetscCall(MatNullSpaceDestroy(&near));
  for (PetscInt k = 0; k < kept; k++) PetscCall(VecDestroy(&v[k]));
  PetscCall(PetscFree(v));
  PetscFunctionReturn(0);
}

/* What is known of the unknowns of the coarse matrix A: kept, and attached to A. Collective on latin */
PetscErrorCode LatinLevelSetUp_Private(Latin latin, Mat A)
{
  PetscFunctionBegin;
  PetscCall(LatinLevelKnow_Private(latin, &latin->coarse.above.known));
  PetscCall(LatinLevelNear_Private(&latin->coarse.above.known, A));
  PetscFunctionReturn(0);
}

/* The same for the matrix K of a batch of subdomains, whose prescribed and primal rows are those of the identity */
PetscErrorCode LatinLevelBatch_Private(Latin latin, const LatinBatch *batch, Mat K)
{
  LatinSubstructure    *sub  = &latin->sub;
  const PetscInt        rows = batch->row[batch->patterns], each = sub->fields * (1 + sub->dim);
  const LatinLevelShape shape = {sub->dim, sub->fields, sub->nears, sub->dim + each + sub->nears};
  LatinUnknowns         known = {.dim = sub->dim, .fields = sub->fields, .nears = sub->nears};
  PetscReal            *out;

  PetscFunctionBegin;
  PetscCall(PetscMalloc4(sub->dim * rows, &known.x, each * rows, &known.trace, sub->nears * rows, &known.near, shape.width, &out));
  for (PetscInt p = 0; p < batch->patterns; p++)
    for (PetscInt row = batch->row[p]; row < batch->row[p + 1]; row++) {
      const PetscInt   dof = row - batch->row[p] + sub->bs * sub->node_offset[batch->sub[p]];
      const PetscReal *x   = sub->x + sub->dim * (dof / sub->bs);

      PetscCall(PetscArrayzero(out, shape.width));
      if (!sub->fixed[dof] && latin->linear.primal_index[dof] < 0) LatinLevelAdd(sub, &shape, dof, 1.0, x, out);
      PetscCall(PetscArraycpy(known.x + sub->dim * row, x, sub->dim));
      PetscCall(PetscArraycpy(known.trace + each * row, out + sub->dim, each));
      for (PetscInt k = 0; k < sub->nears; k++) known.near[rows * k + row] = out[sub->dim + each + k];
    }
  PetscCall(LatinLevelNear_Private(&known, K));
  PetscCall(PetscFree4(known.x, known.trace, known.near, out));
  PetscFunctionReturn(0);
}

/* The coarse matrix with the part of each rank by itself, a MATIS. Collective on latin */
PetscErrorCode LatinLevelSubassemble_Private(Latin latin, Mat *A)
{
  LatinCoarse           *coarse  = &latin->coarse;
  const LatinElements   *top     = &coarse->top;
  const PetscInt         entries = top->offset[top->n];
  PetscInt              *number, *local, *count, n = entries;
  ISLocalToGlobalMapping map;
  Mat                    K;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(entries, &number, entries, &local, entries, &count));
  PetscCall(PetscArraycpy(number, coarse->top_global, entries));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  PetscCall(PetscArrayzero(count, n));
  for (PetscInt s = 0; s < top->n; s++)
    for (PetscInt i = top->offset[s]; i < top->offset[s + 1]; i++) {
      PetscCall(PetscFindInt(coarse->top_global[i], n, number, &local[i]));
      count[local[i]] += top->offset[s + 1] - top->offset[s];
    }
  for (PetscInt i = 0; i < n; i++) count[i] = PetscMin(count[i], n);
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, 0, count, &K));
  for (PetscInt s = 0; s < top->n; s++) {
    const PetscInt m = top->offset[s + 1] - top->offset[s];

    PetscCall(MatSetValues(K, m, local + top->offset[s], m, local + top->offset[s], top->H + top->h_offset[s], ADD_VALUES)); /* symmetric: by rows or columns alike */
  }
  PetscCall(MatAssemblyBegin(K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(K, MAT_FINAL_ASSEMBLY));
  PetscCall(ISLocalToGlobalMappingCreate(PetscObjectComm((PetscObject)latin), 1, n, number, PETSC_COPY_VALUES, &map));
  PetscCall(MatCreateIS(PetscObjectComm((PetscObject)latin), 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, A));
  PetscCall(MatISSetLocalMat(*A, K));
  PetscCall(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(*A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*A, MAT_SPD, PETSC_TRUE));
  PetscCall(ISLocalToGlobalMappingDestroy(&map));
  PetscCall(MatDestroy(&K));
  PetscCall(PetscFree3(number, local, count));
  PetscFunctionReturn(0);
}

/*
   The operators of the groups, or of their connected parts, block diagonal on this rank: for a coarse solver of type latin, which finds them on A. The
   rows of a group are numbered as its members bring them, so that equal groups have equal operators.
*/
PetscErrorCode LatinLevelElements_Private(Latin latin, Mat A)
{
  LatinCoarse          *coarse = &latin->coarse;
  LatinLevel           *above  = &coarse->above;
  const LatinNestLevel *group  = &coarse->group;
  const LatinElements  *fine   = &group->fine;
  PetscInt              rows = 0, widest = 0, *first, *count, *column, *parent;
  PetscContainer        container;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(group->groups + 1, &first));
  for (PetscInt g = 0; g < group->groups; g++) {
    first[g] = rows;
    rows += group->interior[g] + group->coarse.offset[g + 1] - group->coarse.offset[g];
  }
  for (PetscInt s = 0; s < fine->n; s++) widest = PetscMax(widest, fine->offset[s + 1] - fine->offset[s]);
  PetscCall(PetscMalloc2(rows, &above->global, rows, &above->part));
  PetscCall(PetscMalloc3(rows, &count, rows, &parent, widest, &column));
  PetscCall(PetscArrayzero(count, rows));
  for (PetscInt i = 0; i < rows; i++) parent[i] = i;
  for (PetscInt g = 0; g < group->groups; g++)
    for (PetscInt m = group->first[g]; m < group->first[g + 1]; m++) {
      const PetscInt s = group->member[m];

      for (PetscInt i = fine->offset[s]; i < fine->offset[s + 1]; i++) {
        const PetscInt row = first[g] + group->slot[i];

        above->global[row] = coarse->top_global[i];
        LatinJoin(parent, row, first[g] + group->slot[fine->offset[s]]);
        count[row] += fine->offset[s + 1] - fine->offset[s];
      }
    }
  for (PetscInt i = 0; i < rows; i++) count[i] = PetscMin(count[i], rows); /* elements share columns */
  above->parts = 0;
  for (PetscInt i = 0; i < rows; i++) above->part[i] = LatinRoot(parent, i) == i ? above->parts++ : above->part[parent[i]];
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, rows, rows, 0, count, &above->K));
  for (PetscInt g = 0; g < group->groups; g++)
    for (PetscInt m = group->first[g]; m < group->first[g + 1]; m++) {
      const PetscInt s = group->member[m], n = fine->offset[s + 1] - fine->offset[s];

      for (PetscInt i = 0; i < n; i++) column[i] = first[g] + group->slot[fine->offset[s] + i];
      PetscCall(MatSetValues(above->K, n, column, n, column, fine->H + fine->h_offset[s], ADD_VALUES)); /* symmetric: by rows or columns alike */
    }
  PetscCall(MatAssemblyBegin(above->K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(above->K, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(first));
  PetscCall(PetscFree3(count, parent, column));
  PetscCall(PetscContainerCreate(PetscObjectComm((PetscObject)A), &container));
  PetscCall(PetscContainerSetPointer(container, above)); /* the coarse problem lives longer than its solver */
  PetscCall(PetscObjectCompose((PetscObject)A, LatinLevelName, (PetscObject)container));
  PetscCall(PetscContainerDestroy(&container));
  PetscFunctionReturn(0);
}

/* The level of a coarse matrix that has groups, or NULL */
PetscErrorCode LatinLevelOf_Private(Mat A, LatinLevel **level)
{
  PetscContainer container;

  PetscFunctionBegin;
  *level = NULL;
  PetscCall(PetscObjectQuery((PetscObject)A, LatinLevelName, (PetscObject *)&container));
  if (container) PetscCall(PetscContainerGetPointer(container, (void **)level));
  PetscFunctionReturn(0);
}

/* A is the coarse matrix, or NULL: whoever keeps it longer finds no groups on it */
PetscErrorCode LatinLevelReset_Private(LatinLevel *level, Mat A)
{
  PetscFunctionBegin;
  if (A) PetscCall(PetscObjectCompose((PetscObject)A, LatinLevelName, NULL));
  PetscCall(LatinUnknownsReset_Private(&level->known));
  PetscCall(MatDestroy(&level->K));
  PetscCall(PetscFree2(level->global, level->part));
  PetscFunctionReturn(0);
}
