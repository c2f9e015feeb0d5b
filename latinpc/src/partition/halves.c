#include "partition/latinpartition.h"
#include "partition/dissection.h"

/*
   Two subdomains with a primal interface: the interface is a small vertex separator with balanced halves. This is the first step
   of the nested dissection of the whole structure, so that two subdomains cost no more than one. It is geometric
   (partition/dissection.c), or by METIS if coordinates do not reflect the graph. No repair is needed: a subdomain is
   eliminated with its interface held, where links missing there do not matter.
*/

/* Adjacency lists of the nodes: start[nodes + 1], list[2 links], which the caller frees */
static PetscErrorCode LatinHalvesGraph_Private(PetscInt nodes, PetscInt links, const PetscInt ends[], idx_t **start, idx_t **list)
{
  PetscFunctionBegin;
  PetscCall(PetscCalloc1(nodes + 2, start));
  PetscCall(PetscMalloc1(2 * links, list));
  for (PetscInt i = 0; i < 2 * links; i++) (*start)[ends[i] + 2]++;
  for (PetscInt v = 0; v < nodes; v++) (*start)[v + 2] += (*start)[v + 1];
  for (PetscInt i = 0; i < 2 * links; i++) (*list)[(*start)[ends[i] + 1]++] = (idx_t)ends[i ^ 1];
  PetscFunctionReturn(0);
}

/* part[l]: half of each link, 0 or 1; links inside the separator go to the smaller half. *failed: 0, or the status of METIS */
PetscErrorCode LatinHalves_Private(PetscInt dim, PetscInt nodes, const PetscReal x[], PetscInt links, const PetscInt ends[], PetscInt part[], int *failed)
{
  idx_t    *start, *list, *half, n = (idx_t)nodes, size, options[METIS_NOPTIONS];
  PetscInt  count[2] = {0, 0};
  PetscBool done;

  PetscFunctionBegin;
  PetscCall(LatinHalvesGraph_Private(nodes, links, ends, &start, &list));
  PetscCall(PetscMalloc1(nodes, &half));
  PetscCall(LatinDissectHalves_Private(dim, n, start, list, x, half, &done));
  *failed = 0;
  if (!done) {
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED]    = 1; /* the same partition at every run */
    options[METIS_OPTION_UFACTOR] = LATIN_HALVES_BALANCE;
    *failed                       = METIS_ComputeVertexSeparator(&n, start, list, NULL, options, &size, half);
    if (*failed == METIS_OK) *failed = 0;
  }
  for (PetscInt l = 0; l < links && !*failed; l++) {
    part[l] = (PetscInt)PetscMin(half[ends[2 * l]], half[ends[2 * l + 1]]); /* 2: both ends are on the interface */
    if (part[l] < 2) count[part[l]]++;
  }
  for (PetscInt l = 0; l < links && !*failed; l++)
    if (part[l] == 2) part[l] = count[0] <= count[1] ? 0 : 1;
  PetscCall(PetscFree(half));
  PetscCall(PetscFree(list));
  PetscCall(PetscFree(start));
  PetscFunctionReturn(0);
}
