#include "localsolvers/latinlocalsolvers.h"
#include "partition/dissection.h"

/*
   Order of elimination: nested dissection of the graph of the nodes, which has bs^2 times fewer edges than that of the dofs: by planes if coordinates
   are known (partition/dissection.c), else by METIS. The bs rows of a node are consecutive; bs is the block size of the matrix.
*/

/*
   passes of METIS' refinement of a separator; with its default of 10 the fill is the same to 1 % (mean of three seeds), in 1.2 (grid) to 1.4 (networks)
   of the time
*/
#define LATIN_ORDERING_PASSES 1

/* Lists the neighbours of each node i in the graph of the nodes, each once, i included: list[first[i]] to list[first[i + 1] - 1]. The caller frees *list */
PetscErrorCode LatinOrderingNodes_Private(PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], PetscInt first[], PetscInt **list)
{
  PetscInt *seen, used = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n, &seen));
  PetscCall(PetscMalloc1(ia[bs * n], list)); /* an upper bound: unused pages are not touched */
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
   Creates the symmetric graph of the nodes that have a vertex, of a matrix of n nodes. An entry may be zero by rounding on one side of the diagonal
   alone, and METIS may not terminate on an unsymmetric graph. The caller frees *start and *list.
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

/* Gets coordinates of the nodes of a matrix of a sequential DMPLEX, with bs unknowns at each vertex; else *places is NULL */
static PetscErrorCode LatinOrderingMesh_Private(Mat A, PetscInt bs, PetscInt nodes, Vec *places)
{
  PetscSection       unknowns, points;
  const PetscScalar *x;
  PetscScalar       *at;
  PetscInt           dim, start, end, low, high, total, found = 0;
  PetscBool          plex = PETSC_FALSE;
  PetscMPIInt        size = 0;
  DM                 dm;
  Vec                all = NULL;

  PetscFunctionBegin;
  PetscCall(MatGetDM(A, &dm));
  if (dm) PetscCall(PetscObjectTypeCompare((PetscObject)dm, DMPLEX, &plex));
  if (plex) PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)dm), &size));
  if (size == 1) PetscCall(DMGetCoordinatesLocal(dm, &all));
  if (!all) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalSection(dm, &unknowns));
  PetscCall(DMGetCoordinateSection(dm, &points));
  PetscCall(DMGetCoordinateDim(dm, &dim));
  PetscCall(DMPlexGetDepthStratum(dm, 0, &start, &end));
  PetscCall(PetscSectionGetConstrainedStorageSize(unknowns, &total));
  PetscCall(PetscSectionGetChart(points, &low, &high));
  if (total != bs * nodes || low > start || high < end) PetscFunctionReturn(0); /* the matrix is a part of that of the mesh, or vertices have no coordinates */
  PetscCall(VecCreateSeq(PETSC_COMM_SELF, dim * nodes, places));
  PetscCall(VecSetBlockSize(*places, dim));
  PetscCall(VecGetArrayRead(all, &x));
  PetscCall(VecGetArrayWrite(*places, &at));
  for (PetscInt v = start; v < end; v++) {
    PetscInt first, rows, held, from, known;

    PetscCall(PetscSectionGetOffset(unknowns, v, &first));
    PetscCall(PetscSectionGetDof(unknowns, v, &rows));
    PetscCall(PetscSectionGetConstraintDof(unknowns, v, &held));
    PetscCall(PetscSectionGetOffset(points, v, &from));
    PetscCall(PetscSectionGetDof(points, v, &known));
    for (PetscInt r = first; r < first + rows - held && known == dim; r++, found++) PetscCall(PetscArraycpy(at + dim * (r / bs), x + from, dim));
  }
  PetscCall(VecRestoreArrayWrite(*places, &at));
  PetscCall(VecRestoreArrayRead(all, &x));
  if (found != bs * nodes) PetscCall(VecDestroy(places)); /* there are unknowns on edges or cells */
  PetscFunctionReturn(0);
}

/* Gets coordinates of the nodes of a matrix, [nodes][dim], composed on it or from its mesh; NULL if there are none. The caller destroys them */
static PetscErrorCode LatinOrderingPlaces_Private(Mat A, PetscInt bs, PetscInt nodes, Vec *places)
{
  PetscInt n, dim;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)A, LATIN_PLACES, (PetscObject *)places));
  if (!*places) {
    PetscCall(LatinOrderingMesh_Private(A, bs, nodes, places));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscObjectReference((PetscObject)*places));
  PetscCall(VecGetBlockSize(*places, &dim));
  PetscCall(VecGetLocalSize(*places, &n));
  PetscCheck(n == dim * nodes, PETSC_COMM_SELF, PETSC_ERR_PLIB, "A matrix of %" PetscInt_FMT " nodes carries %" PetscInt_FMT " coordinates, not %" PetscInt_FMT " of each", nodes, n, dim);
  PetscFunctionReturn(0);
}

/* Computes position[], the place of each vertex in the order of elimination */
static PetscErrorCode LatinOrderVertices_Private(Mat A, PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], const PetscInt vertex[], idx_t vertices, idx_t position[])
{
  idx_t             *start, *list, *order, options[METIS_NOPTIONS];
  const PetscScalar *all;
  PetscReal         *x;
  PetscInt           dim;
  PetscBool          done   = PETSC_FALSE;
  Vec                places = NULL;

  PetscFunctionBegin;
  PetscCall(LatinOrderingGraph_Private(bs, n, ia, ja, vertex, &start, &list));
  PetscCall(LatinOrderingPlaces_Private(A, bs, n, &places));
  if (places) {
    PetscCall(VecGetBlockSize(places, &dim));
    PetscCall(VecGetArrayRead(places, &all));
    PetscCall(PetscMalloc1(dim * vertices, &x));
    for (PetscInt i = 0; i < dim * n; i++)
      if (vertex[i / dim] >= 0) x[dim * vertex[i / dim] + i % dim] = PetscRealPart(all[i]);
    PetscCall(VecRestoreArrayRead(places, &all));
    PetscCall(VecDestroy(&places));
    PetscCall(LatinDissect_Private(dim, vertices, start, list, x, position, &done));
    PetscCall(PetscFree(x));
  }
  if (!done) {
    int status;

    PetscCall(PetscMalloc1(vertices, &order));
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_NITER] = LATIN_ORDERING_PASSES;
    status                      = METIS_NodeND(&vertices, start, list, NULL, options, order, position);
    PetscCheck(status == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not order the nodes of a matrix (status %d)", status);
    PetscCall(PetscFree(order));
  }
  PetscCall(PetscFree(start));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(0);
}

/*
   Computes order[], the rows of A in the order of elimination. Nodes with kept rows (those of the Schur complement) come last, and their kept rows
   after all others. kept[rows] may be NULL
*/
PetscErrorCode LatinOrderNodes_Private(Mat A, PetscInt rows, const PetscInt ia[], const PetscInt ja[], const PetscBool kept[], PetscInt order[])
{
  PetscInt bs, n, *vertex, at;
  idx_t   *position, nodes = 0;

  PetscFunctionBegin;
  PetscCall(MatGetBlockSize(A, &bs));
  n = rows / bs;
  PetscCall(PetscMalloc2(n, &vertex, n, &position));
  for (PetscInt i = 0; i < n; i++) {
    PetscBool keeps = PETSC_FALSE;

    for (PetscInt r = bs * i; r < bs * (i + 1) && kept; r++) keeps = (PetscBool)(keeps || kept[r]);
    vertex[i] = keeps ? -1 : (PetscInt)nodes++;
  }
  if (nodes) PetscCall(LatinOrderVertices_Private(A, bs, n, ia, ja, vertex, nodes, position));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt r = 0; r < bs && vertex[i] >= 0; r++) order[bs * (PetscInt)position[vertex[i]] + r] = bs * i + r;
  at = bs * (PetscInt)nodes;
  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt r = 0; r < rows; r++)
      if (vertex[r / bs] < 0 && kept[r] == (PetscBool)pass) order[at++] = r;
  PetscCall(PetscFree2(vertex, position));
  PetscFunctionReturn(0);
}

/* A MatOrderingType, for matrices of one rank with a symmetric pattern */
PetscErrorCode LatinOrdering(Mat A, MatOrderingType type, IS *rows, IS *columns)
{
  const PetscInt *ia, *ja;
  PetscInt        size, n, *order;
  PetscBool       done;

  PetscFunctionBegin;
  (void)type;
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &size, &ia, &ja, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Ordering %s needs the rows of a matrix of type seqaij", LATIN_ORDERING);
  n = size; /* MatRestoreRowIJ() resets size */
  PetscCall(PetscMalloc1(size, &order));
  PetscCall(LatinOrderNodes_Private(A, size, ia, ja, NULL, order));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &size, &ia, &ja, &done));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, order, PETSC_OWN_POINTER, rows));
  PetscCall(ISSetPermutation(*rows));
  PetscCall(PetscObjectReference((PetscObject)*rows));
  *columns = *rows;
  PetscFunctionReturn(0);
}
