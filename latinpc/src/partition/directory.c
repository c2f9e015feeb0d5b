#define _GNU_SOURCE /* setenv */
#include "partition/latinpartition.h"
#include <stdlib.h>
#include <petscmat.h>

/*
   The distributed graph of the nodes: each rank has the links at its nodes of the structure. PT-Scotch or ParMETIS partition it, by PETSc's
   MatPartitioning.
*/

/* Lists the links at each node of the structure on this rank. Collective on structure */
PetscErrorCode LatinDirectoryCreate_Private(LatinStructure structure, LatinDirectory *directory)
{
  const PetscInt  n = structure->nodes_local, m = 2 * structure->links_local;
  const PetscInt *degree;
  PetscInt       *number;

  PetscFunctionBegin;
  PetscCall(LatinSFFetch_Private(PetscObjectComm((PetscObject)structure), n, m, structure->nodes, &directory->ends));
  PetscCall(PetscSFComputeDegreeBegin(directory->ends, &degree));
  PetscCall(PetscSFComputeDegreeEnd(directory->ends, &degree));
  PetscCall(PetscMalloc1(n + 1, &directory->offset));
  directory->offset[0] = 0;
  for (PetscInt v = 0; v < n; v++) directory->offset[v + 1] = directory->offset[v] + degree[v];
  PetscCall(PetscMalloc1(m, &number));
  PetscCall(PetscMalloc2(directory->offset[n], &directory->incident, directory->offset[n], &directory->neighbour));
  for (PetscInt i = 0; i < m; i++) number[i] = structure->links_start + i / 2;
  PetscCall(PetscSFGatherBegin(directory->ends, MPIU_INT, number, directory->incident));
  PetscCall(PetscSFGatherEnd(directory->ends, MPIU_INT, number, directory->incident));
  for (PetscInt i = 0; i < m; i++) number[i] = structure->nodes[i ^ 1];
  PetscCall(PetscSFGatherBegin(directory->ends, MPIU_INT, number, directory->neighbour));
  PetscCall(PetscSFGatherEnd(directory->ends, MPIU_INT, number, directory->neighbour));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDirectoryDestroy_Private(LatinDirectory *directory)
{
  PetscFunctionBegin;
  PetscCall(PetscSFDestroy(&directory->ends));
  PetscCall(PetscFree(directory->offset));
  PetscCall(PetscFree2(directory->incident, directory->neighbour));
  PetscFunctionReturn(0);
}

/* Creates the graph as a matrix; weight[]: vertex weights, numbers of links. Sorts the neighbours and removes duplicates. Collective on structure */
static PetscErrorCode LatinGraphCreate_Private(LatinStructure structure, LatinDirectory *directory, Mat *graph, PetscInt **weight)
{
  const PetscInt n = structure->nodes_local;
  PetscInt      *i, *j;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n + 1, &i));
  PetscCall(PetscMalloc1(directory->offset[n], &j));
  PetscCall(PetscMalloc1(n + 1, weight)); /* NULL on a rank without nodes means that no rank has weights */
  i[0] = 0;
  for (PetscInt v = 0; v < n; v++) {
    PetscInt degree = directory->offset[v + 1] - directory->offset[v];

    (*weight)[v] = PetscMax(degree, 1);
    PetscCall(PetscSortRemoveDupsInt(&degree, directory->neighbour + directory->offset[v])); /* parallel links are one edge */
    PetscCall(PetscArraycpy(j + i[v], directory->neighbour + directory->offset[v], degree));
    i[v + 1] = i[v] + degree;
  }
  PetscCall(MatCreateMPIAdj(PetscObjectComm((PetscObject)structure), n, structure->nodes_global, i, j, NULL, graph));
  PetscFunctionReturn(0);
}

#define LATIN_SCOTCH_THREADS "SCOTCH_PTHREAD_NUMBER" /* environment variable of PT-Scotch 7 */

#if defined(__GNUC__)
extern void SCOTCH_randomReset(void) __attribute__((weak)); /* NULL: this PETSc has no PT-Scotch */
#endif

/* Partitions the graph, the same way each time: PT-Scotch needs its random numbers reset and one thread a rank, unless the user has set their number */
static PetscErrorCode LatinGraphApply_Private(MatPartitioning partitioning, IS *is)
{
  const PetscBool chosen = (PetscBool)(getenv(LATIN_SCOTCH_THREADS) != NULL);

  PetscFunctionBegin;
  if (!chosen) (void)setenv(LATIN_SCOTCH_THREADS, "1", 0);
#if defined(__GNUC__)
  if (SCOTCH_randomReset) SCOTCH_randomReset();
#endif
  PetscCall(MatPartitioningApply(partitioning, is));
  if (!chosen) (void)unsetenv(LATIN_SCOTCH_THREADS);
  PetscFunctionReturn(0);
}

/* Computes of_node[nodes_local], the subdomain of each node. Overwrites directory->neighbour. Collective on structure */
PetscErrorCode LatinGraphPartition_Private(LatinStructure structure, LatinDirectory *directory, const char prefix[], PetscInt parts, PetscInt of_node[])
{
  MatPartitioning partitioning;
  Mat             graph;
  IS              is;
  const PetscInt *part;
  PetscInt       *weight;

  PetscFunctionBegin;
  PetscCall(LatinGraphCreate_Private(structure, directory, &graph, &weight));
  PetscCall(MatPartitioningCreate(PetscObjectComm((PetscObject)structure), &partitioning));
  PetscCall(PetscObjectSetOptionsPrefix((PetscObject)partitioning, prefix));
  PetscCall(MatPartitioningSetAdjacency(partitioning, graph));
  PetscCall(MatPartitioningSetNParts(partitioning, parts));
  PetscCall(MatPartitioningSetVertexWeights(partitioning, weight));
#if defined(LATIN_MATPARTITIONING)
  PetscCall(MatPartitioningSetType(partitioning, LATIN_MATPARTITIONING));
#endif
  PetscCall(MatPartitioningSetFromOptions(partitioning));
  PetscCall(LatinGraphApply_Private(partitioning, &is));
  PetscCall(ISGetIndices(is, &part));
  PetscCall(PetscArraycpy(of_node, part, structure->nodes_local));
  PetscCall(ISRestoreIndices(is, &part));
  PetscCall(ISDestroy(&is));
  PetscCall(MatPartitioningDestroy(&partitioning));
  PetscCall(MatDestroy(&graph));
  PetscFunctionReturn(0);
}
