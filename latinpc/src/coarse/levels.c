#include "coarse/latincoarse.h"

/*
   The coarse problem as the problem of another level. Its operator carries what a matrix of finite elements does: where
   its unknowns are, which fields cost next to nothing (the near null space, for algebraic multigrid and BDDC), and, for
   a coarse solver that is itself of type latin, groups of subdomains as its subdomains.

   A coarse unknown is a number a that a displacement field w gives, a(w) = R_j^t d w for a macro mode, w at its node for a
   primal one. So fields are carried over by evaluating a: that of a unit translation of each component, and of each of
   its unit gradients around a point x near to the unknown, the mean of the nodes of its interface. These numbers (the
   trace) are those of equal subdomains wherever they are, and give the affine fields of every frame: interfaces/macrobasis.c makes of
   them what it makes of nodes.
*/

/* The numbers of the coarse unknowns of the subdomains here, [offset[n]][width] */
static PetscErrorCode LatinLevelCollect_Private(LatinCoarse *coarse, const LatinTraceShape *shape, PetscReal out[])
{
  const LatinSubdomains *sub   = coarse->sub;
  const LatinInterfaces *inter = coarse->inter;
  const PetscInt         dim   = shape->dim;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(out, shape->width * coarse->offset[sub->n]));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;
    PetscReal             x[3] = {0.0, 0.0, 0.0}, origin[3] = {0.0, 0.0, 0.0};

    if (!coarse->macro->of[f].modes) continue;
    for (PetscInt k = face->side_first; k < face->side_last; k++)
      for (PetscInt c = 0; c < dim; c++) {
        const PetscReal at = sub->x[dim * (inter->side_dof[k] / sub->bs) + c];

        if (k == face->side_first) origin[c] = at;
        x[c] += at - origin[c];
      }
    for (PetscInt c = 0; c < dim; c++) x[c] = origin[c] + x[c] / rows;
    for (PetscInt j = 0; j < coarse->macro->of[f].modes; j++) {
      PetscReal *to = out + shape->width * (coarse->offset[face->sub] + coarse->macro->of[f].at + j);

      for (PetscInt c = 0; c < dim; c++) to[c] = x[c];
      for (PetscInt k = face->side_first; k < face->side_last; k++) LatinTraceAdd(sub, shape, inter->side_dof[k], LatinMacroDualRow(coarse->macro, f, k)[j], x, to);
    }
  }
  for (PetscInt s = 0; s < sub->n; s++)
    for (PetscInt p = coarse->inter->primal_offset[s]; p < coarse->inter->primal_offset[s + 1]; p++) {
      const PetscInt   dof = coarse->inter->primal_dof[p];
      const PetscReal *x   = sub->x + dim * (dof / sub->bs);
      PetscReal       *to  = out + shape->width * (coarse->offset[s] + coarse->macro_count[s] + p - coarse->inter->primal_offset[s]);

      for (PetscInt c = 0; c < dim; c++) to[c] = x[c];
      LatinTraceAdd(sub, shape, dof, 1.0, x, to);
    }
  PetscFunctionReturn(0);
}

/* known, for the coarse unknowns that this rank numbers. Both sides of an interface have the same numbers, to rounding: the larger one counts */
static PetscErrorCode LatinLevelKnow_Private(LatinCoarse *coarse, LatinUnknowns *known)
{
  const LatinSubdomains *sub  = coarse->sub;
  const PetscInt         rows = coarse->top_local, each = sub->fields * (1 + sub->dim);
  const LatinTraceShape  shape = {sub->dim, sub->fields, sub->nears, sub->dim + each + sub->nears};
  PetscReal             *leaf, *root;

  PetscFunctionBegin;
  PetscCall(LatinUnknownsReset_Private(known));
  known->dim    = sub->dim;
  known->fields = sub->fields;
  known->nears  = sub->nears;
  PetscCall(PetscMalloc2(shape.width * coarse->offset[sub->n], &leaf, shape.width * rows, &root));
  PetscCall(LatinLevelCollect_Private(coarse, &shape, leaf));
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

/* What is known of the unknowns of the coarse matrix A: kept, and attached to A. Collective on coarse->sub->object */
PetscErrorCode LatinLevelSetUp_Private(LatinCoarse *coarse, Mat A)
{
  PetscFunctionBegin;
  PetscCall(LatinLevelKnow_Private(coarse, &coarse->above.known));
  PetscCall(LatinNearNullSpace_Private(&coarse->above.known, A));
  PetscFunctionReturn(0);
}

/* The coarse matrix with the part of each rank by itself, a MATIS. Collective on coarse->sub->object */
PetscErrorCode LatinLevelSubassemble_Private(const LatinCoarse *coarse, Mat *A)
{
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
  PetscCall(ISLocalToGlobalMappingCreate(PetscObjectComm(coarse->sub->object), 1, n, number, PETSC_COPY_VALUES, &map));
  PetscCall(MatCreateIS(PetscObjectComm(coarse->sub->object), 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, A));
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
PetscErrorCode LatinLevelElements_Private(LatinCoarse *coarse, Mat A)
{
  LatinLevel            *above = &coarse->above;
  const LatinGroupLevel *group = &coarse->group;
  const LatinElements   *fine  = &group->fine;
  PetscInt               rows = 0, widest = 0, *first, *count, *column, *parent;

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
  PetscCall(LatinLevelAttach_Private(above, A)); /* the coarse problem lives longer than its solver */
  PetscFunctionReturn(0);
}
