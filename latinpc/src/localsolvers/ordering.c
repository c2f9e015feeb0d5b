#include "localsolvers/latinlocalsolvers.h"
#include <metis.h>

/*
   The order of elimination: nested dissection by METIS of the graph of the nodes, which has bs^2 times fewer edges than
   that of the degrees of freedom. The rows of a node follow each other, bs of them, the block size of the matrix.
*/

#define LATIN_ORDERING_PASSES 1 /* of METIS' refinement of a separator, of which ten are its default: the same fill to 1 % (mean of three seeds), in 0.7 (networks) to 0.83 (grid) of the time */

/* The nodes whose columns the rows of a node have, each once: list[first[i]] to list[first[i + 1] - 1]. The caller frees list */
PetscErrorCode LatinOrderingNodes_Private(PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], PetscInt first[], PetscInt **list)
{
  PetscInt *seen, used = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n, &seen));
  PetscCall(PetscMalloc1(ia[bs * n], list)); /* what is left at the end is never touched */
  for (PetscInt i = 0; i < n; i++) seen[i] = -1;
  for (PetscInt i = 0; i < n; i++) {
    first[i] = used;
    for (PetscInt k = ia[bs * i], start = 0, end = 0; k < ia[bs * (i + 1)]; k++) {
      if (ja[k] >= start && ja[k] < end) continue; /* of the same node as the last one */
      start = ja[k] - ja[k] % bs;
      end   = start + bs;
      if (seen[start / bs] == i) continue;
      seen[start / bs] = i;
      (*list)[used++]  = start / bs;
    }
  }
  first[n] = used;
  PetscCall(PetscFree(seen));
  PetscFunctionReturn(0);
}

/*
   Neighbours of the nodes that have a vertex in a matrix of n nodes, both ways: METIS may not end on a graph that lacks one
   of two edges, and an entry that rounding leaves on one side alone is such an edge. The caller frees them.
*/
static PetscErrorCode LatinOrderingGraph_Private(PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], const PetscInt vertex[], idx_t **start, idx_t **list)
{
  PetscInt *first, *next, *seen, *both, *one, *column;
  idx_t     used = 0;

  PetscFunctionBegin;
  PetscCall(PetscCalloc4(n + 1, &first, n, &next, n, &seen, n + 1, &one));
  PetscCall(LatinOrderingNodes_Private(bs, n, ia, ja, one, &column));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = one[i]; k < one[i + 1]; k++) {
      next[i]++;
      next[column[k]]++;
    }
  for (PetscInt i = 0; i < n; i++) {
    first[i + 1] = first[i] + next[i];
    next[i]      = first[i];
    seen[i]      = -1;
  }
  PetscCall(PetscMalloc1(first[n] + 1, &both));
  PetscCall(PetscMalloc1(n + 1, start));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = one[i]; k < one[i + 1]; k++) {
      both[next[i]++]         = column[k];
      both[next[column[k]]++] = i;
    }
  PetscCall(PetscMalloc1(first[n] + 1, list));
  for (PetscInt i = 0; i < n; i++) {
    if (vertex[i] < 0) continue;
    (*start)[vertex[i]] = used;
    seen[i]             = i;
    for (PetscInt k = first[i]; k < first[i + 1]; k++) {
      if (vertex[both[k]] < 0 || seen[both[k]] == i) continue;
      seen[both[k]]   = i;
      (*list)[used++] = (idx_t)vertex[both[k]];
    }
    (*start)[vertex[i] + 1] = used;
  }
  PetscCall(PetscFree(both));
  PetscCall(PetscFree(column));
  PetscCall(PetscFree4(first, next, seen, one));
  PetscFunctionReturn(0);
}

/*
   order[] lists the rows of a matrix of nodes of bs rows each: by METIS, but last the nodes that have kept rows, these
   themselves after all others. kept[rows] may be NULL
*/
PetscErrorCode LatinOrderNodes_Private(PetscInt bs, PetscInt rows, const PetscInt ia[], const PetscInt ja[], const PetscBool kept[], PetscInt order[])
{
  const PetscInt n = rows / bs;
  PetscInt      *vertex, at = 0;
  idx_t         *start, *list, *place, *position, options[METIS_NOPTIONS], nodes = 0;
  int            status = METIS_OK;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(n, &vertex, n, &place, n, &position));
  for (PetscInt i = 0; i < n; i++) {
    PetscBool keeps = PETSC_FALSE;

    for (PetscInt r = bs * i; r < bs * (i + 1) && kept; r++) keeps = (PetscBool)(keeps || kept[r]);
    vertex[i] = keeps ? -1 : (PetscInt)nodes++;
  }
  PetscCall(LatinOrderingGraph_Private(bs, n, ia, ja, vertex, &start, &list));
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_NITER] = LATIN_ORDERING_PASSES;
  if (nodes) status = METIS_NodeND(&nodes, start, list, NULL, options, place, position);
  PetscCheck(status == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not order the nodes of a matrix (status %d)", status);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt r = 0; r < bs && vertex[i] >= 0; r++) order[bs * (PetscInt)position[vertex[i]] + r] = bs * i + r;
  at = bs * (PetscInt)nodes;
  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt r = 0; r < rows; r++)
      if (vertex[r / bs] < 0 && kept[r] == (PetscBool)pass) order[at++] = r;
  PetscCall(PetscFree3(vertex, place, position));
  PetscCall(PetscFree(start));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(0);
}

/* A MatOrderingType, for matrices of one rank with a symmetric pattern */
PetscErrorCode LatinOrdering(Mat A, MatOrderingType type, IS *rows, IS *columns)
{
  const PetscInt *ia, *ja;
  PetscInt        bs, size, n, *order;
  PetscBool       done;

  PetscFunctionBegin;
  (void)type;
  PetscCall(MatGetBlockSize(A, &bs));
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &size, &ia, &ja, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Ordering %s needs the rows of a matrix of type seqaij", LATIN_ORDERING);
  n = size; /* which is given back */
  PetscCall(PetscMalloc1(size, &order));
  PetscCall(LatinOrderNodes_Private(bs, size, ia, ja, NULL, order));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &size, &ia, &ja, &done));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, order, PETSC_OWN_POINTER, rows));
  PetscCall(ISSetPermutation(*rows));
  PetscCall(PetscObjectReference((PetscObject)*rows));
  *columns = *rows;
  PetscFunctionReturn(0);
}
