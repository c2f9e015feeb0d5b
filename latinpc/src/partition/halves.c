#include "partition/latinpartition.h"
#include "partition/dissection.h"

/*
   Two subdomains whose interface is in the coarse problem: the fewest nodes without which the others fall into two like halves are
   the interface. That is the first step of the nested dissection by which one subdomain would be eliminated, so that two cost
   no more than it does; it is made as that is (partition/dissection.c), by METIS where places tell nothing. Nothing is to
   be repaired: a subdomain is eliminated with its interface held, where no links missing across it count.
*/

/* Neighbours of all nodes: start[nodes + 1], list[2 links], which the caller frees */
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

/* The half, 0 or 1, of each link; *failed is 0, or the status of METIS */
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
    part[l] = (PetscInt)PetscMin(half[ends[2 * l]], half[ends[2 * l + 1]]); /* 2: both are on the interface */
    if (part[l] < 2) count[part[l]]++;
  }
  for (PetscInt l = 0; l < links && !*failed; l++)
    if (part[l] == 2) part[l] = count[0] <= count[1] ? 0 : 1;
  PetscCall(PetscFree(half));
  PetscCall(PetscFree(list));
  PetscCall(PetscFree(start));
  PetscFunctionReturn(0);
}
