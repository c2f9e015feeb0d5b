#include "partition/latinpartition.h"
#include <metis.h>
#include <stdlib.h>

/*
   METIS on the graph of the nodes (vertices, that weigh as many as they have links; edges: the links). It makes the sum
   over the nodes of the other subdomains around them small. Links follow their nodes; those between two subdomains all
   go to one of the two, so that only the nodes of the other one are shared.

   There may be more subdomains of a few links than nodes: then the middles of the links are vertices as well, and have
   the weights in place of the nodes.
*/

#define LATIN_METIS_SMALL 16 /* links a subdomain below which links, not nodes, are vertices: with 4, 27 of 89 subdomains stay empty */

typedef struct {
  idx_t count, *start, *list, *weight, *part;
} LatinGraph;

static PetscErrorCode LatinGraphCreate_Private(const LatinCut *cut, PetscBool middles, LatinGraph *graph)
{
  idx_t *next;

  PetscFunctionBegin;
  graph->count = (idx_t)(cut->nodes + (middles ? cut->links : 0));
  PetscCall(PetscMalloc4(graph->count + 1, &graph->start, (middles ? 4 : 2) * cut->links, &graph->list, graph->count, &graph->weight, graph->count, &graph->part));
  next = graph->list;
  for (PetscInt v = 0; v < cut->nodes; v++) {
    graph->start[v]  = (idx_t)(next - graph->list);
    graph->weight[v] = middles ? 0 : (idx_t)(cut->offset[v + 1] - cut->offset[v]);
    for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
      const PetscInt l = cut->incident[j];

      *next++ = (idx_t)(middles ? cut->nodes + l : cut->ends[2 * l] + cut->ends[2 * l + 1] - v);
    }
  }
  for (PetscInt l = 0; l < cut->links && middles; l++) {
    graph->start[cut->nodes + l]  = (idx_t)(next - graph->list);
    graph->weight[cut->nodes + l] = 1;
    *next++                       = (idx_t)cut->ends[2 * l];
    *next++                       = (idx_t)cut->ends[2 * l + 1];
  }
  graph->start[graph->count] = (idx_t)(next - graph->list);
  PetscFunctionReturn(0);
}

/* Of the links between subdomains a and b, count from key on, the nodes in a less those in b; seen[] is stamped */
static PetscInt LatinFollowSides(const LatinCut *cut, const idx_t of_node[], idx_t a, PetscInt count, const LatinKey key[], PetscInt stamp, PetscInt seen[])
{
  PetscInt more = 0;

  for (PetscInt i = 0; i < 2 * count; i++) {
    const PetscInt v = cut->ends[2 * key[i / 2].number + i % 2];

    if (seen[v] == stamp) continue;
    seen[v] = stamp;
    more += of_node[v] == a ? 1 : -1;
  }
  return more;
}

/*
   Links between two subdomains go to the one whose nodes on them are more, for the others are shared; and, against it,
   to the smaller one: links count half in either until it is their turn.
*/
static PetscErrorCode LatinFollow_Private(const LatinCut *cut, const idx_t of_node[], PetscInt part[])
{
  const PetscReal mean = (PetscReal)cut->links / (PetscReal)cut->parts;
  LatinKey       *key;
  PetscInt       *size, *seen, n = 0; /* sizes in half links */

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(cut->links, &key));
  PetscCall(PetscCalloc2(cut->parts, &size, cut->nodes, &seen));
  for (PetscInt l = 0; l < cut->links; l++) {
    const idx_t a = of_node[cut->ends[2 * l]], b = of_node[cut->ends[2 * l + 1]];

    size[a]++;
    size[b]++;
    part[l] = (PetscInt)a;
    if (a == b) continue;
    key[n].hash     = ((uint64_t)PetscMin(a, b) << 32) + (uint64_t)PetscMax(a, b);
    key[n++].number = l;
  }
  if (n) qsort(key, (size_t)n, sizeof(*key), LatinKeyCompare);
  for (PetscInt i = 0, last; i < n; i = last) {
    const idx_t a = (idx_t)(key[i].hash >> 32), b = (idx_t)(key[i].hash & 0xffffffff);
    idx_t       to;

    for (last = i; last < n && key[last].hash == key[i].hash; last++) continue;
    to = LatinFollowSides(cut, of_node, a, last - i, key + i, i + 1, seen) >= 2 * (last - i) * (size[a] - size[b]) / mean ? a : b;
    for (PetscInt k = i; k < last; k++) part[key[k].number] = (PetscInt)to;
    size[a] += to == a ? last - i : i - last;
    size[b] += to == b ? last - i : i - last;
  }
  PetscCall(PetscFree(key));
  PetscCall(PetscFree2(size, seen));
  PetscFunctionReturn(0);
}

/* Shares the links out into cut->parts subdomains, some of which METIS may leave empty, on one rank; *failed is 0, or the status of METIS */
PetscErrorCode LatinMetis_Private(const LatinCut *cut, PetscInt part[], int *failed)
{
  const PetscBool small = (PetscBool)(cut->links < LATIN_METIS_SMALL * cut->parts);
  LatinGraph      graph;
  idx_t           options[METIS_NOPTIONS], constraints = 1, parts = (idx_t)cut->parts, objective;

  PetscFunctionBegin;
  *failed = 0;
  if (cut->parts == 1) {
    PetscCall(PetscArrayzero(part, cut->links));
    PetscFunctionReturn(0);
  }
  PetscCall(LatinGraphCreate_Private(cut, small, &graph));
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED]      = 1; /* the same partition at every run */
  options[METIS_OPTION_NUMBERING] = 0;
  if (!small) options[METIS_OPTION_OBJTYPE] = METIS_OBJTYPE_VOL;
  /* k-way refinement leaves parts empty when they are to be small; bisection does not */
  *failed = (small ? METIS_PartGraphRecursive : METIS_PartGraphKway)(&graph.count, &constraints, graph.start, graph.list, graph.weight, NULL, NULL, &parts, NULL, NULL, options, &objective, graph.part);
  if (*failed == METIS_OK) *failed = 0;
  if (!*failed && !small) PetscCall(LatinFollow_Private(cut, graph.part, part));
  for (PetscInt l = 0; l < cut->links && small && !*failed; l++) part[l] = (PetscInt)graph.part[cut->nodes + l];
  PetscCall(PetscFree4(graph.start, graph.list, graph.weight, graph.part));
  PetscFunctionReturn(0);
}
