#include "interfaces/latininterfaces.h"

/* At which interfaces, and in which subdomains next to them, the coefficients of a matrix jump (subdomains/operator.c). */

/* jumps[s]: do they jump next to an interface of the subdomain? */
PetscErrorCode LatinJumps_Private(const LatinInterfaces *inter, PetscBool jumps[])
{
  const LatinSubdomains *sub = inter->sub;
  PetscBool             *at;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->copies, &at));
  PetscCall(LatinJumpsCopies_Private(inter->sub, at));
  for (PetscInt s = 0; s < sub->n; s++) jumps[s] = PETSC_FALSE;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    for (PetscInt k = face->side_first; k < face->side_last && !jumps[face->sub]; k++) jumps[face->sub] = at[inter->side_dof[k]];
  }
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

/* jumps[f]: do they jump next to an interface of one of the two subdomains of f? Collective on inter->sub->object */
PetscErrorCode LatinJumpsFaces_Private(const LatinInterfaces *inter, PetscBool jumps[])
{
  PetscBool *here;
  PetscInt  *mine, *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(inter->sub->n, &here, inter->sides, &mine, inter->sides, &mate));
  PetscCall(LatinJumps_Private(inter, here));
  for (PetscInt f = 0; f < inter->count; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) mine[k] = here[inter->interface[f].sub] ? 1 : 0;
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_INT, mine, mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    jumps[f] = (PetscBool)(face->side_last > face->side_first && (here[face->sub] || mate[face->side_first]));
  }
  PetscCall(PetscFree3(here, mine, mate));
  PetscFunctionReturn(0);
}
