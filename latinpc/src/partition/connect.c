#include "partition/latinpartition.h"

/*
   Subdomains in one piece. A graph partitioner leaves nodes apart from the rest of their subdomain: all but the largest part of
   it go over to the subdomains around, where these are in one piece.
*/

typedef struct {
  PetscInt  n, *first, *node; /* parts: their own nodes, node[first[i]..first[i + 1]) */
  PetscInt *links;            /* [n] links at their nodes */
} LatinClusters;

/* The connected nodes of each subdomain of this rank */
static PetscErrorCode LatinClustersCreate_Private(const LatinCut *cut, LatinClusters *clusters)
{
  PetscInt  *of_node = cut->of_node, n = 0;
  PetscBool *seen;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(cut->nodes + 1, &clusters->first, cut->nodes, &clusters->node, cut->nodes, &clusters->links));
  PetscCall(PetscCalloc1(cut->nodes, &seen));
  clusters->n = 0;
  for (PetscInt start = 0; start < cut->nodes; start++) {
    if (cut->depth[start] || seen[start]) continue;
    clusters->first[clusters->n] = n;
    clusters->links[clusters->n] = 0;
    clusters->node[n++]          = start;
    seen[start]                  = PETSC_TRUE;
    for (PetscInt i = clusters->first[clusters->n]; i < n; i++) {
      const PetscInt v = clusters->node[i];

      clusters->links[clusters->n] += cut->offset[v + 1] - cut->offset[v];
      for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
        const PetscInt l = cut->incident[j], w = cut->ends[2 * l] + cut->ends[2 * l + 1] - v;

        if (of_node[w] != of_node[v] || seen[w]) continue;
        seen[w]             = PETSC_TRUE;
        clusters->node[n++] = w;
      }
    }
    clusters->n++;
  }
  clusters->first[clusters->n] = n;
  PetscCall(PetscFree(seen));
  PetscFunctionReturn(0);
}

/* settled[nodes]: is a node in the largest part of its subdomain? Collective on cut->comm */
static PetscErrorCode LatinClustersSettled_Private(const LatinCut *cut, const LatinClusters *clusters, PetscInt local, PetscInt settled[])
{
  PetscInt *largest, *here;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(cut->parts, &largest));
  PetscCall(PetscCalloc1(local, &here));
  for (PetscInt s = 0; s < cut->parts; s++) largest[s] = -1;
  for (PetscInt i = 0; i < clusters->n; i++) {
    const PetscInt s = cut->of_node[clusters->node[clusters->first[i]]];

    if (largest[s] < 0 || clusters->links[i] > clusters->links[largest[s]]) largest[s] = i;
  }
  for (PetscInt v = 0; v < cut->nodes; v++) settled[v] = 0;
  for (PetscInt i = 0; i < clusters->n; i++) {
    if (largest[cut->of_node[clusters->node[clusters->first[i]]]] != i) continue;
    for (PetscInt k = clusters->first[i]; k < clusters->first[i + 1]; k++) settled[clusters->node[k]] = 1;
  }
  PetscCall(LatinSFReduce_Private(cut->node_sf, 1, MPIU_INT, settled, here, MPI_MAX));
  PetscCall(LatinSFBcast_Private(cut->node_sf, 1, MPIU_INT, here, settled));
  PetscCall(PetscFree(here));
  PetscCall(PetscFree(largest));
  PetscFunctionReturn(0);
}

/* The settled subdomain to which most links of a part lead, -1: there is none. links[parts] is zero before and after */
static PetscInt LatinClusterTo(const LatinCut *cut, const LatinClusters *clusters, PetscInt i, const PetscInt settled[], PetscInt links[])
{
  const PetscInt from = cut->of_node[clusters->node[clusters->first[i]]];
  PetscInt       to   = -1;

  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt k = clusters->first[i]; k < clusters->first[i + 1]; k++) {
      const PetscInt v = clusters->node[k];

      for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
        const PetscInt l = cut->incident[j], w = cut->ends[2 * l] + cut->ends[2 * l + 1] - v, s = cut->of_node[w];

        if (s == from || !settled[w]) continue;
        if (pass) links[s] = 0;
        else if (++links[s] > (to < 0 ? 0 : links[to])) to = s;
      }
    }
  return to;
}

/* Gives the parts of subdomains that lie apart to those around; of_node[] is that of the caller's nodes. Collective on cut->comm */
PetscErrorCode LatinConnect_Private(const LatinCut *cut, PetscInt local, PetscInt of_node[], PetscInt *moved)
{
  LatinClusters clusters;
  PetscInt     *settled, *links, *change, *here;

  PetscFunctionBegin;
  PetscCall(LatinClustersCreate_Private(cut, &clusters));
  PetscCall(PetscMalloc3(cut->nodes, &settled, cut->nodes, &change, local, &here));
  PetscCall(PetscCalloc1(cut->parts, &links));
  PetscCall(LatinClustersSettled_Private(cut, &clusters, local, settled));
  *moved = 0;
  for (PetscInt v = 0; v < cut->nodes; v++) change[v] = -1;
  for (PetscInt v = 0; v < local; v++) here[v] = -1;
  for (PetscInt i = 0; i < clusters.n; i++) {
    const PetscInt to = settled[clusters.node[clusters.first[i]]] ? -1 : LatinClusterTo(cut, &clusters, i, settled, links);

    if (to < 0) continue;
    (*moved)++;
    for (PetscInt k = clusters.first[i]; k < clusters.first[i + 1]; k++) change[clusters.node[k]] = to;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, moved, 1, MPIU_INT, MPI_SUM, cut->comm));
  PetscCall(LatinSFReduce_Private(cut->node_sf, 1, MPIU_INT, change, here, MPI_MAX));
  for (PetscInt v = 0; v < local; v++)
    if (here[v] >= 0) of_node[v] = here[v];
  PetscCall(PetscFree3(settled, change, here));
  PetscCall(PetscFree(links));
  PetscCall(PetscFree3(clusters.first, clusters.node, clusters.links));
  PetscFunctionReturn(0);
}
