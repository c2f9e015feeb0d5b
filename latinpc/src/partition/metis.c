#include "partition/latinpartition.h"
#include <metis.h>

/*
   METIS on the dual graph of the links (vertices: links; edges: pairs of links with a common node).

   A node of m links makes m (m - 1) / 2 edges, so that a bare count of cut edges would spare the nodes of many links and
   cut through those of few. With the weight 1 / (m - 1) at each node, a cut costs about the same at all of them, and what
   METIS makes small is the number of interface nodes.
*/

#define LATIN_METIS_SMALL  16   /* links per subdomain */
#define LATIN_METIS_WEIGHT 1000 /* whole numbers for METIS: that many stand for 1 */

typedef struct {
  idx_t *start, *list, *weight;
} LatinDualGraph;

/* Coincident links share two nodes but one edge, which has the weight of both. Lists come out sorted: METIS cuts better */
static PetscErrorCode LatinDualGraph_Private(const LatinCut *cut, LatinDualGraph *graph, PetscBool *overflow)
{
  const PetscInt n   = cut->links;
  const idx_t    one = (idx_t)PetscMax(1, PetscMin(LATIN_METIS_WEIGHT, PETSC_MPI_INT_MAX / 4 / n)); /* METIS adds all weights up */
  PetscInt      *offset, *incident, *seen;
  PetscInt64     edges = 0, *next, *place;

  PetscFunctionBegin;
  PetscCall(LatinIncidence_Private(cut, &offset, &incident));
  PetscCall(PetscMalloc3(n, &seen, n, &place, n + 1, &next));
  PetscCall(PetscMalloc1(n + 1, &graph->start));
  PetscCall(PetscArrayzero(next, n + 1));
  graph->list   = NULL;
  graph->weight = NULL;
  *overflow     = PETSC_FALSE;
  for (PetscInt pass = 0; pass < 2 && !*overflow; pass++) { /* the first one counts */
    for (PetscInt i = 0; i < n; i++) seen[i] = -1;
    for (PetscInt l = 0; l < n; l++)
      for (PetscInt s = 0; s < 2; s++) {
        const PetscInt v = cut->ends[2 * l + s], m = offset[v + 1] - offset[v];
        const idx_t    w = (idx_t)PetscMax(1, one / PetscMax(1, m - 1));

        for (PetscInt j = offset[v]; j < offset[v + 1]; j++) {
          const PetscInt other = incident[j];

          if (other == l) continue;
          if (seen[other] == l) {
            if (pass) graph->weight[place[other]] += w;
            continue;
          }
          seen[other]  = l;
          place[other] = next[other]++;
          if (pass) {
            graph->list[place[other]]   = (idx_t)l;
            graph->weight[place[other]] = w;
          }
        }
      }
    if (pass) break;
    for (PetscInt l = 0; l <= n; l++) {
      const PetscInt64 degree = next[l];

      graph->start[l] = (idx_t)edges;
      next[l]         = edges;
      edges += degree;
    }
    if ((PetscInt64)(idx_t)edges != edges) *overflow = PETSC_TRUE;
    else PetscCall(PetscMalloc2((size_t)PetscMax(edges, 1), &graph->list, (size_t)PetscMax(edges, 1), &graph->weight));
  }
  PetscCall(PetscFree3(seen, place, next));
  PetscCall(PetscFree2(offset, incident));
  PetscFunctionReturn(0);
}

/* Shares the links out into cut->parts subdomains, on one rank. Parts that METIS leaves empty are closed up: cut->parts is what there is then */
PetscErrorCode LatinMetis_Private(LatinCut *cut, PetscInt part[], PetscBool *failed, int *status, PetscBool *overflow)
{
  LatinDualGraph graph;
  idx_t         *found, options[METIS_NOPTIONS], nvtxs = (idx_t)cut->links, ncon = 1, nparts = (idx_t)cut->parts, edgecut;
  PetscInt      *number, used = 0;

  PetscFunctionBegin;
  *status   = METIS_OK;
  *overflow = *failed = PETSC_FALSE;
  if (cut->parts == 1) {
    PetscCall(PetscArrayzero(part, cut->links));
    PetscFunctionReturn(0);
  }
  PetscCall(LatinDualGraph_Private(cut, &graph, overflow));
  if (!*overflow) {
    PetscCall(PetscMalloc1(cut->links, &found));
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED]      = 1; /* the same partition at every run */
    options[METIS_OPTION_NUMBERING] = 0;
    /* k-way refinement leaves parts empty when they are to be small; bisection does not */
    if (cut->links < LATIN_METIS_SMALL * cut->parts) *status = METIS_PartGraphRecursive(&nvtxs, &ncon, graph.start, graph.list, NULL, NULL, graph.weight, &nparts, NULL, NULL, options, &edgecut, found);
    else *status = METIS_PartGraphKway(&nvtxs, &ncon, graph.start, graph.list, NULL, NULL, graph.weight, &nparts, NULL, NULL, options, &edgecut, found);
    *failed = (PetscBool)(*status != METIS_OK);
    if (!*failed) {
      PetscCall(PetscMalloc1(cut->parts, &number));
      for (PetscInt p = 0; p < cut->parts; p++) number[p] = -1;
      for (PetscInt l = 0; l < cut->links; l++) number[found[l]] = 0;
      for (PetscInt p = 0; p < cut->parts; p++)
        if (number[p] == 0) number[p] = used++;
      for (PetscInt l = 0; l < cut->links; l++) part[l] = number[found[l]];
      PetscCall(PetscFree(number));
      cut->parts = used;
    }
    PetscCall(PetscFree(found));
  }
  PetscCall(PetscFree(graph.start));
  PetscCall(PetscFree2(graph.list, graph.weight));
  PetscFunctionReturn(0);
}
