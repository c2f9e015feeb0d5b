#include "partition/latinpartition.h"
#include "partition/dissection.h"

/*
   METIS on the graph of the nodes (edges: links; vertex weights: numbers of links). It minimises the communication volume: the sum over nodes of the
   other subdomains next to them. Links follow their nodes (partition/follow.c).

   Subdomains of a few links may outnumber the nodes: then links are vertices as well, of weight 1, and nodes have weight 0.
*/

#define LATIN_METIS_SMALL 16 /* links of a subdomain below which links carry the weights; with 4, 27 of 89 subdomains stay empty */

typedef struct {
  idx_t count, *start, *list, *weight, *part;
} LatinGraph;

/* Creates the graph of METIS; middles: links are vertices as well */
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

/* Partitions the links into cut->parts subdomains on one rank; METIS may leave some empty. *failed: 0, or the status of METIS */
PetscErrorCode LatinMetis_Private(const LatinCut *cut, PetscInt part[], int *failed)
{
  const PetscBool small = (PetscBool)(cut->links < LATIN_METIS_SMALL * cut->parts);
  LatinGraph      graph;
  idx_t           options[METIS_NOPTIONS], constraints = 1, parts = (idx_t)cut->parts, objective;
  PetscInt       *of_node;

  PetscFunctionBegin;
  *failed = 0;
  PetscCall(LatinGraphCreate_Private(cut, small, &graph));
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED]      = 1; /* the same partition at every run */
  options[METIS_OPTION_NUMBERING] = 0;
  if (!small) options[METIS_OPTION_OBJTYPE] = METIS_OBJTYPE_VOL;
  /* k-way refinement leaves small parts empty; recursive bisection does not */
  *failed = (small ? METIS_PartGraphRecursive : METIS_PartGraphKway)(&graph.count, &constraints, graph.start, graph.list, graph.weight, NULL, NULL, &parts, NULL, NULL, options, &objective, graph.part);
  if (*failed == METIS_OK) *failed = 0;
  if (!*failed && !small) {
    PetscCall(PetscMalloc1(cut->nodes, &of_node));
    for (PetscInt v = 0; v < cut->nodes; v++) of_node[v] = (PetscInt)graph.part[v];
    PetscCall(LatinFollow_Private(cut, of_node, part));
    PetscCall(PetscFree(of_node));
  }
  for (PetscInt l = 0; l < cut->links && small && !*failed; l++) part[l] = (PetscInt)graph.part[cut->nodes + l];
  PetscCall(PetscFree4(graph.start, graph.list, graph.weight, graph.part));
  PetscFunctionReturn(0);
}

/*
   Computes part[l], the half of each link, 0 or 1, for two subdomains with a primal interface, by a small vertex separator with balanced halves; links
   inside the separator go to the smaller half. This is the first step of the nested dissection of the whole structure, so that two subdomains cost no
   more than one. It is geometric (partition/dissection.c), or by METIS if coordinates do not reflect the graph. No repair is needed: a subdomain is
   eliminated with its interface held, where links missing there do not matter. *failed: 0, or the status of METIS
*/
PetscErrorCode LatinHalves_Private(const LatinCut *cut, const PetscReal x[], PetscInt part[], int *failed)
{
  LatinGraph graph;
  idx_t      size, options[METIS_NOPTIONS], *half;
  PetscInt   count[2] = {0, 0};
  PetscBool  done;

  PetscFunctionBegin;
  PetscCall(LatinGraphCreate_Private(cut, PETSC_FALSE, &graph));
  half = graph.part;
  PetscCall(LatinDissectHalves_Private(cut->dim, graph.count, graph.start, graph.list, x, half, &done));
  *failed = 0;
  if (!done) {
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED]    = 1; /* the same partition at every run */
    options[METIS_OPTION_UFACTOR] = LATIN_HALVES_BALANCE;
    *failed                       = METIS_ComputeVertexSeparator(&graph.count, graph.start, graph.list, NULL, options, &size, half);
    if (*failed == METIS_OK) *failed = 0;
  }
  for (PetscInt l = 0; l < cut->links && !*failed; l++) {
    part[l] = (PetscInt)PetscMin(half[cut->ends[2 * l]], half[cut->ends[2 * l + 1]]); /* 2: both ends are on the interface */
    if (part[l] < 2) count[part[l]]++;
  }
  for (PetscInt l = 0; l < cut->links && !*failed; l++)
    if (part[l] == 2) part[l] = count[0] <= count[1] ? 0 : 1;
  PetscCall(PetscFree4(graph.start, graph.list, graph.weight, graph.part));
  PetscFunctionReturn(0);
}
