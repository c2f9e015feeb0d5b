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

/* Operators of elements, added up in a matrix of this rank; row[]: where their dofs are in it */
static PetscErrorCode LatinLevelAdd_Private(const LatinElements *elements, PetscInt rows, const PetscInt row[], Mat *K)
{
  PetscInt *count;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(rows, &count));
  for (PetscInt s = 0; s < elements->n; s++)
    for (PetscInt i = elements->offset[s]; i < elements->offset[s + 1]; i++) count[row[i]] += elements->offset[s + 1] - elements->offset[s];
  for (PetscInt i = 0; i < rows; i++) count[i] = PetscMin(count[i], rows); /* elements share columns */
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, rows, rows, 0, count, K));
  for (PetscInt s = 0; s < elements->n; s++) {
    const PetscInt m = elements->offset[s + 1] - elements->offset[s], *at = row + elements->offset[s];

    PetscCall(MatSetValues(*K, m, at, m, at, elements->H + elements->h_offset[s], ADD_VALUES)); /* symmetric: by rows or columns alike */
  }
  PetscCall(MatAssemblyBegin(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*K, MAT_FINAL_ASSEMBLY));
  PetscCall(PetscFree(count));
  PetscFunctionReturn(0);
}

/* The coarse matrix with the part of each rank by itself, a MATIS. Collective on coarse->sub->object */
PetscErrorCode LatinLevelSubassemble_Private(const LatinCoarse *coarse, Mat *A)
{
  const LatinElements   *top     = &coarse->top;
  const PetscInt         entries = top->offset[top->n];
  PetscInt              *number, *local, n = entries;
  ISLocalToGlobalMapping map;
  Mat                    K;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(entries, &number, entries, &local));
  PetscCall(PetscArraycpy(number, coarse->top_global, entries));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  for (PetscInt i = 0; i < entries; i++) PetscCall(PetscFindInt(coarse->top_global[i], n, number, &local[i]));
  PetscCall(LatinLevelAdd_Private(top, n, local, &K));
  PetscCall(ISLocalToGlobalMappingCreate(PetscObjectComm(coarse->sub->object), 1, n, number, PETSC_COPY_VALUES, &map));
  PetscCall(MatCreateIS(PetscObjectComm(coarse->sub->object), 1, coarse->top_local, coarse->top_local, coarse->top_size, coarse->top_size, map, map, A));
  PetscCall(MatISSetLocalMat(*A, K));
  PetscCall(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(*A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*A, MAT_SPD, PETSC_TRUE));
  PetscCall(ISLocalToGlobalMappingDestroy(&map));
  PetscCall(MatDestroy(&K));
  PetscCall(PetscFree2(number, local));
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
  PetscInt               rows  = 0, *row, *global, *parent;

  PetscFunctionBegin;
  for (PetscInt g = 0; g < group->groups; g++) rows += group->interior[g] + group->coarse.offset[g + 1] - group->coarse.offset[g];
  PetscCall(PetscMalloc1(rows, &above->part));
  PetscCall(PetscMalloc3(fine->offset[fine->n], &row, rows, &global, rows, &parent));
  for (PetscInt i = 0; i < rows; i++) parent[i] = i;
  for (PetscInt g = 0, first = 0; g < group->groups; g++) {
    for (PetscInt m = group->first[g]; m < group->first[g + 1]; m++) {
      const PetscInt s = group->member[m];

      for (PetscInt i = fine->offset[s]; i < fine->offset[s + 1]; i++) {
        row[i]         = first + group->slot[i];
        global[row[i]] = coarse->top_global[i];
        LatinJoin(parent, row[i], row[fine->offset[s]]);
      }
    }
    first += group->interior[g] + group->coarse.offset[g + 1] - group->coarse.offset[g];
  }
  above->parts = 0;
  for (PetscInt i = 0; i < rows; i++) above->part[i] = LatinRoot(parent, i) == i ? above->parts++ : above->part[parent[i]];
  PetscCall(LatinLevelAdd_Private(fine, rows, row, &above->K));
  PetscCall(ISLocalToGlobalMappingCreate(PetscObjectComm(coarse->sub->object), 1, rows, global, PETSC_COPY_VALUES, &above->map));
  PetscCall(PetscFree3(row, global, parent));
  PetscCall(LatinLevelAttach_Private(above, A)); /* the coarse problem lives longer than its solver */
  PetscFunctionReturn(0);
}
