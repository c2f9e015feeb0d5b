#include "interfaces/latininterfaces.h"

/* Rows of the operators with springs (28): the matrices of search directions join the nodes of an interface. */

/* The interfaces with a matrix for a search direction at each copy; *more: the most neighbours that they give to a node */
static PetscErrorCode LatinSpringRowsFaces_Private(const LatinDirections *dir, LatinSpringRows *graph, PetscInt *more)
{
  const LatinInterfaces *inter = dir->inter;
  const PetscInt         bs = dir->sub->bs, copies = dir->sub->copies;
  PetscInt               longest = 0, most = 0, last = -1;

  PetscFunctionBegin;
  *more              = 0;
  graph->face_offset = graph->face_list = NULL;
  if (!dir->matrix) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(copies + 2, &graph->face_offset));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];

      if (dir->matrix_first[f] < 0) continue;
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
  *more = most * longest;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSpringRowsCreate_Private(const LatinDirections *dir, LatinSpringRows *graph)
{
  PetscInt more;

  PetscFunctionBegin;
  PetscCall(LatinSpringRowsFaces_Private(dir, graph, &more));
  PetscCall(LatinRowsCreate_Private(dir->sub, more, &graph->rows));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSpringRowsDestroy_Private(LatinSpringRows *graph)
{
  PetscFunctionBegin;
  PetscCall(LatinRowsDestroy_Private(&graph->rows));
  PetscCall(PetscFree(graph->face_offset));
  PetscCall(PetscFree(graph->face_list));
  PetscFunctionReturn(0);
}

/* Block row i of the operator with the given diagonal springs, and of the matrix directions: neighbours in increasing order and their blocks */
PetscErrorCode LatinSpringRowsGet_Private(const LatinDirections *dir, LatinSpringRows *graph, PetscInt i, const PetscReal spring[], PetscInt *count)
{
  const LatinInterfaces *inter = dir->inter;
  LatinRows             *rows  = &graph->rows;
  const PetscInt         bs = dir->sub->bs, bb = bs * bs, first = graph->face_offset ? graph->face_offset[i] : 0, last = graph->face_offset ? graph->face_offset[i + 1] : 0;

  PetscFunctionBegin;
  LatinRowsOpen(rows, i, count);
  for (PetscInt p = first; p < last; p++) {
    const LatinInterface *face = &inter->interface[graph->face_list[p]];

    for (PetscInt k = face->side_first; k < face->side_last; k++) LatinRowsJoin(rows, inter->side_dof[k] / bs, count);
  }
  PetscCall(LatinRowsFill_Private(rows, i, spring, *count));
  for (PetscInt p = first; p < last; p++) {
    const LatinInterface *face = &inter->interface[graph->face_list[p]];

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscReal *row = LatinDirectionRow(dir, graph->face_list[p], k - face->side_first);

      if (inter->side_dof[k] / bs != i) continue;
      for (PetscInt q = face->side_first; q < face->side_last; q++) rows->block[bb * rows->slot[inter->side_dof[q] / bs] + (inter->side_dof[k] % bs) * bs + inter->side_dof[q] % bs] += row[q - face->side_first];
    }
  }
  LatinRowsClose(rows, *count);
  PetscFunctionReturn(0);
}
