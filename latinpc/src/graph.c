#include "latinimpl.h"

/* Which nodes of a subdomain are joined, by links or by the springs of a search direction, and the rows of its stiffness. */

/* The interfaces with a matrix for a search direction at each copy: their springs join nodes; adds to the most neighbours of a node */
static PetscErrorCode LatinGraphFaces_Private(Latin latin, LatinGraph *graph, PetscInt *widest)
{
  LatinInterfaces *inter = &latin->inter;
  const PetscInt   bs = latin->sub.bs, copies = latin->sub.copies;
  PetscInt         longest = 0, most = 0, last = -1;

  PetscFunctionBegin;
  if (!latin->macro.matrix) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(copies + 2, &graph->face_offset));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];

      if (face->matrix_first < 0) continue;
      longest = PetscMax(longest, face->side_last - face->side_first);
      last    = -1;
      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        const PetscInt i = inter->side_dof[k] / bs;

        if (i == last) continue;
        last = i;
        if (pass) graph->face_list[graph->face_offset[i + 1]++] = f;
        else graph->face_offset[i + 2]++;
      }
    }
    if (pass) break;
    for (PetscInt i = 0; i < copies; i++) {
      most = PetscMax(most, graph->face_offset[i + 2]);
      graph->face_offset[i + 2] += graph->face_offset[i + 1];
    }
    PetscCall(PetscMalloc1(graph->face_offset[copies + 1], &graph->face_list));
  }
  *widest += most * longest;
  PetscFunctionReturn(0);
}

/* with_faces: rows have the springs of matrix directions, too */
PetscErrorCode LatinGraphCreate_Private(Latin latin, PetscBool with_faces, LatinGraph *graph)
{
  LatinSubstructure *sub    = &latin->sub;
  PetscInt           widest = 1;

  PetscFunctionBegin;
  PetscCall(LatinOperatorRowsCreate_Private(latin, graph, &widest));
  graph->face_offset = graph->face_list = NULL;
  if (with_faces) PetscCall(LatinGraphFaces_Private(latin, graph, &widest));
  PetscCall(PetscMalloc3(widest, &graph->neighbour, sub->bs * sub->bs * widest, &graph->block, sub->copies, &graph->slot));
  for (PetscInt i = 0; i < sub->copies; i++) graph->slot[i] = -1;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinGraphDestroy_Private(LatinGraph *graph)
{
  PetscFunctionBegin;
  PetscCall(LatinOperatorRowsDestroy_Private(graph));
  PetscCall(PetscFree(graph->face_offset));
  PetscCall(PetscFree(graph->face_list));
  PetscCall(PetscFree3(graph->neighbour, graph->block, graph->slot));
  PetscFunctionReturn(0);
}

/* Block row i of the operator with the given diagonal springs, and of the matrix directions: neighbours in increasing order and their blocks */
PetscErrorCode LatinGraphRow_Private(Latin latin, LatinGraph *graph, PetscInt i, const PetscReal spring[], PetscInt *count)
{
  LatinInterfaces *inter = &latin->inter;
  const PetscInt   bs = latin->sub.bs, dd = bs * bs;
  PetscInt         n = 0;

  PetscFunctionBegin;
  graph->neighbour[n++] = i;
  graph->slot[i]        = 0;
  LatinOperatorRowJoin(latin, graph, i, &n);
  for (PetscInt p = graph->face_offset ? graph->face_offset[i] : 0; graph->face_offset && p < graph->face_offset[i + 1]; p++) {
    const LatinInterface *face = &inter->interface[graph->face_list[p]];

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscInt j = inter->side_dof[k] / bs;

      if (graph->slot[j] >= 0) continue;
      graph->slot[j]        = 0;
      graph->neighbour[n++] = j;
    }
  }
  PetscCall(PetscSortInt(n, graph->neighbour));
  for (PetscInt p = 0; p < n; p++) graph->slot[graph->neighbour[p]] = p;
  PetscCall(PetscArrayzero(graph->block, dd * n));
  LatinOperatorRowAdd(latin, graph, i);
  for (PetscInt c = 0; c < bs; c++) graph->block[dd * graph->slot[i] + c * bs + c] += spring[bs * i + c];
  for (PetscInt p = graph->face_offset ? graph->face_offset[i] : 0; graph->face_offset && p < graph->face_offset[i + 1]; p++) {
    const LatinInterface *face = &inter->interface[graph->face_list[p]];

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscReal *row;

      if (inter->side_dof[k] / bs != i) continue;
      LatinDirectionRow(latin, face, k - face->side_first, &row);
      for (PetscInt q = face->side_first; q < face->side_last; q++) graph->block[dd * graph->slot[inter->side_dof[q] / bs] + (inter->side_dof[k] % bs) * bs + inter->side_dof[q] % bs] += row[q - face->side_first];
    }
  }
  for (PetscInt p = 0; p < n; p++) graph->slot[graph->neighbour[p]] = -1;
  *count = n;
  PetscFunctionReturn(0);
}
