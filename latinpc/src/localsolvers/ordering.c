#include "localsolvers/latinlocalsolvers.h"
#include <metis.h>

/*
   The order of elimination: nested dissection by METIS of the graph of the nodes, which has bs^2 times fewer edges than
   that of the degrees of freedom. The rows of a node follow each other, bs of them, the block size of the matrix.
*/

/*
   Neighbours of each node in a matrix of n nodes, both ways: METIS may not end on a graph that lacks one of two edges, and
   an entry that rounding leaves on one side alone is such an edge. The caller frees them.
*/
static PetscErrorCode LatinOrderingGraph_Private(PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], idx_t **start, idx_t **list)
{
  PetscInt *first, *next, *seen, *both;
  idx_t     used = 0;

  PetscFunctionBegin;
  PetscCall(PetscCalloc3(n + 1, &first, n, &next, n, &seen));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = ia[bs * i]; k < ia[bs * (i + 1)]; k++) {
      next[i]++;
      next[ja[k] / bs]++;
    }
  for (PetscInt i = 0; i < n; i++) {
    first[i + 1] = first[i] + next[i];
    next[i]      = first[i];
    seen[i]      = -1;
  }
  PetscCall(PetscMalloc1(first[n] + 1, &both));
  PetscCall(PetscMalloc1(n + 1, start));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = ia[bs * i]; k < ia[bs * (i + 1)]; k++) {
      both[next[i]++]          = ja[k] / bs;
      both[next[ja[k] / bs]++] = i;
    }
  PetscCall(PetscMalloc1(first[n] + 1, list));
  for (PetscInt i = 0; i < n; i++) {
    (*start)[i] = used;
    seen[i]     = i;
    for (PetscInt k = first[i]; k < first[i + 1]; k++) {
      if (seen[both[k]] == i) continue;
      seen[both[k]]   = i;
      (*list)[used++] = (idx_t)both[k];
    }
  }
  (*start)[n] = used;
  PetscCall(PetscFree(both));
  PetscCall(PetscFree3(first, next, seen));
  PetscFunctionReturn(0);
}

/* A MatOrderingType, for matrices of one rank with a symmetric pattern */
PetscErrorCode LatinOrdering(Mat A, MatOrderingType type, IS *rows, IS *columns)
{
  const PetscInt *ia, *ja;
  PetscInt        bs, size, n, *order;
  PetscBool       done;
  idx_t          *start, *list, *place, *position, options[METIS_NOPTIONS], nodes;
  int             status;

  PetscFunctionBegin;
  (void)type;
  PetscCall(MatGetBlockSize(A, &bs));
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &size, &ia, &ja, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Ordering %s needs the rows of a matrix of type seqaij", LATIN_ORDERING);
  n     = size / bs;
  nodes = (idx_t)n;
  PetscCall(LatinOrderingGraph_Private(bs, n, ia, ja, &start, &list));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &size, &ia, &ja, &done));
  PetscCall(PetscMalloc2(n, &place, n, &position));
  METIS_SetDefaultOptions(options);
  status = METIS_NodeND(&nodes, start, list, NULL, options, place, position);
  PetscCheck(status == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not order the nodes of a matrix (status %d)", status);
  PetscCall(PetscMalloc1(bs * n, &order));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt c = 0; c < bs; c++) order[bs * i + c] = bs * (PetscInt)place[i] + c;
  PetscCall(PetscFree2(place, position));
  PetscCall(PetscFree(start));
  PetscCall(PetscFree(list));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, bs * n, order, PETSC_OWN_POINTER, rows));
  PetscCall(ISSetPermutation(*rows));
  PetscCall(PetscObjectReference((PetscObject)*rows));
  *columns = *rows;
  PetscFunctionReturn(0);
}
