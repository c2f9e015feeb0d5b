#include "partition/latinpartition.h"

/*
   Makes subdomains connected. Graph partitioners leave subdomains of several connected components: all but the largest component move to neighbouring
   subdomains.
*/

typedef struct {
  PetscInt  n, *first, *node; /* number of connected components; their nodes: node[first[i]..first[i + 1]) */
  PetscInt *links;            /* [n] number of links at the nodes of each */
} LatinComponents;

/* Finds the connected components of the subdomains of this rank */
static PetscErrorCode LatinComponentsCreate_Private(const LatinCut *cut, LatinComponents *components)
{
  PetscInt  *of_node = cut->of_node, n = 0;
  PetscBool *seen;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(cut->nodes + 1, &components->first, cut->nodes, &components->node, cut->nodes, &components->links));
  PetscCall(PetscCalloc1(cut->nodes, &seen));
  components->n = 0;
  for (PetscInt start = 0; start < cut->nodes; start++) {
    if (cut->layer[start] || seen[start]) continue;
    components->first[components->n] = n;
    components->links[components->n] = 0;
    components->node[n++]            = start;
    seen[start]                      = PETSC_TRUE;
    for (PetscInt i = components->first[components->n]; i < n; i++) {
      const PetscInt v = components->node[i];

      components->links[components->n] += cut->offset[v + 1] - cut->offset[v];
      for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
        const PetscInt l = cut->incident[j], w = cut->ends[2 * l] + cut->ends[2 * l + 1] - v;

        if (of_node[w] != of_node[v] || seen[w]) continue;
        seen[w]               = PETSC_TRUE;
        components->node[n++] = w;
      }
    }
    components->n++;
  }
  components->first[components->n] = n;
  PetscCall(PetscFree(seen));
  PetscFunctionReturn(0);
}

/* Sets settled[nodes]: whether a node is in the largest component of its subdomain. local: nodes of the structure on this rank. Collective on cut->comm */
static PetscErrorCode LatinComponentsSettled_Private(const LatinCut *cut, const LatinComponents *components, PetscInt local, PetscInt settled[])
{
  PetscInt *largest, *here;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(cut->parts, &largest));
  PetscCall(PetscCalloc1(local, &here));
  for (PetscInt s = 0; s < cut->parts; s++) largest[s] = -1;
  for (PetscInt i = 0; i < components->n; i++) {
    const PetscInt s = cut->of_node[components->node[components->first[i]]];

    if (largest[s] < 0 || components->links[i] > components->links[largest[s]]) largest[s] = i;
  }
  for (PetscInt v = 0; v < cut->nodes; v++) settled[v] = 0;
  for (PetscInt i = 0; i < components->n; i++) {
    if (largest[cut->of_node[components->node[components->first[i]]]] != i) continue;
    for (PetscInt k = components->first[i]; k < components->first[i + 1]; k++) settled[components->node[k]] = 1;
  }
  PetscCall(LatinSFReduce_Private(cut->node_sf, 1, MPIU_INT, settled, here, MPI_MAX));
  PetscCall(LatinSFBcast_Private(cut->node_sf, 1, MPIU_INT, here, settled));
  PetscCall(PetscFree(here));
  PetscCall(PetscFree(largest));
  PetscFunctionReturn(0);
}

/* Returns the subdomain to whose settled nodes most links of component i lead; -1: none. links[parts]: work, zero before and after */
static PetscInt LatinComponentTo(const LatinCut *cut, const LatinComponents *components, PetscInt i, const PetscInt settled[], PetscInt links[])
{
  const PetscInt from = cut->of_node[components->node[components->first[i]]];
  PetscInt       to   = -1;

  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt k = components->first[i]; k < components->first[i + 1]; k++) {
      const PetscInt v = components->node[k];

      for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
        const PetscInt l = cut->incident[j], w = cut->ends[2 * l] + cut->ends[2 * l + 1] - v, s = cut->of_node[w];

        if (s == from || !settled[w]) continue;
        if (pass) links[s] = 0;
        else if (++links[s] > (to < 0 ? 0 : links[to])) to = s;
      }
    }
  return to;
}

/*
   Moves small components to neighbouring subdomains: changes of_node[local], the subdomains of the nodes of the structure. *moved: number of components
   moved on all ranks. Collective on cut->comm
*/
PetscErrorCode LatinConnect_Private(const LatinCut *cut, PetscInt local, PetscInt of_node[], PetscInt *moved)
{
  LatinComponents components;
  PetscInt       *settled, *links, *change, *here;

  PetscFunctionBegin;
  PetscCall(LatinComponentsCreate_Private(cut, &components));
  PetscCall(PetscMalloc3(cut->nodes, &settled, cut->nodes, &change, local, &here));
  PetscCall(PetscCalloc1(cut->parts, &links));
  PetscCall(LatinComponentsSettled_Private(cut, &components, local, settled));
  *moved = 0;
  for (PetscInt v = 0; v < cut->nodes; v++) change[v] = -1;
  for (PetscInt v = 0; v < local; v++) here[v] = -1;
  for (PetscInt i = 0; i < components.n; i++) {
    const PetscInt to = settled[components.node[components.first[i]]] ? -1 : LatinComponentTo(cut, &components, i, settled, links);

    if (to < 0) continue;
    (*moved)++;
    for (PetscInt k = components.first[i]; k < components.first[i + 1]; k++) change[components.node[k]] = to;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, moved, 1, MPIU_INT, MPI_SUM, cut->comm));
  PetscCall(LatinSFReduce_Private(cut->node_sf, 1, MPIU_INT, change, here, MPI_MAX));
  for (PetscInt v = 0; v < local; v++)
    if (here[v] >= 0) of_node[v] = here[v];
  PetscCall(PetscFree3(settled, change, here));
  PetscCall(PetscFree(links));
  PetscCall(PetscFree3(components.first, components.node, components.links));
  PetscFunctionReturn(0);
}
