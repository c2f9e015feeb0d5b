#include "interfaces/latininterfaces.h"

/*
   Detection of coefficient jumps of a matrix next to interfaces. Without jumps, weights and search directions from the diagonal of the
   operators are as good as any. With jumps, Schur complements (interfaces/searchdirection.c) and local low-energy fields
   (interfaces/spectralmodes.c) are needed.
*/

/* least ratio of the diagonal entries of two coupled unknowns of one field that is a jump; with 60, jumps of 40 are missed: 7 iterations instead of 4 */
#define LATIN_JUMP 30.0

/* Sets jumps[s]: whether coefficients jump next to an interface of subdomain s, on its side */
PetscErrorCode LatinJumps_Private(const LatinInterfaces *inter, PetscBool jumps[])
{
  const LatinSubdomains *sub = inter->sub;
  PetscReal             *diagonal;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->copies, &diagonal));
  PetscCall(LatinOperatorDiagonal(sub, diagonal));
  for (PetscInt s = 0; s < sub->n; s++) jumps[s] = PETSC_FALSE;
  for (PetscInt f = 0; f < inter->count; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) {
      const PetscInt i = inter->side_dof[k];

      for (PetscInt p = sub->ki[i]; p < sub->ki[i + 1]; p++) {
        const PetscInt j = LatinEntryColumn(sub, i, p);

        if (LatinEntry(sub, i, p) != 0.0 && sub->field[i] == sub->field[j] && PetscMax(diagonal[i], diagonal[j]) > LATIN_JUMP * PetscMin(diagonal[i], diagonal[j])) jumps[inter->interface[f].sub] = PETSC_TRUE;
      }
    }
  PetscCall(PetscFree(diagonal));
  PetscFunctionReturn(0);
}

/* Sets jumps[f]: whether coefficients jump next to any interface of one of the two subdomains of f. Collective on inter->sub->object */
PetscErrorCode LatinJumpsFaces_Private(const LatinInterfaces *inter, PetscBool jumps[])
{
  PetscBool *here;
  PetscInt  *mine, *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(inter->sub->n, &here, inter->count, &mine, inter->count, &mate));
  PetscCall(LatinJumps_Private(inter, here));
  for (PetscInt f = 0; f < inter->count; f++) mine[f] = here[inter->interface[f].sub] ? 1 : 0;
  PetscCall(LatinMateNumbers_Private(inter, mine, mate));
  for (PetscInt f = 0; f < inter->count; f++) jumps[f] = (PetscBool)(inter->interface[f].side_last > inter->interface[f].side_first && (mine[f] || mate[f]));
  PetscCall(PetscFree3(here, mine, mate));
  PetscFunctionReturn(0);
}
