#include "latinimpl.h"

/*
   Where the coefficients of a matrix jump next to an interface. A weight or a search direction that knows the diagonal
   of the operators alone is as good there as any other where they do not; where they do, it takes Schur complements
   (direction.c), and local low-energy fields (floppy.c).
*/

#define LATIN_JUMP 30.0 /* of the diagonal of the operator, from an unknown to its neighbours of the same field */

/* rough[i]: do the coefficients of the matrix jump next to copy i? */
PetscErrorCode LatinJumpsCopies_Private(Latin latin, PetscBool rough[])
{
  LatinSubstructure *sub = &latin->sub;
  PetscReal         *diagonal;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->copies, &diagonal));
  PetscCall(LatinOperatorDiagonal(latin, diagonal));
  for (PetscInt i = 0; i < sub->copies; i++) {
    rough[i] = PETSC_FALSE;
    for (PetscInt p = sub->ki[i]; p < sub->ki[i + 1]; p++) {
      const PetscInt j = sub->kj[p];

      if (sub->field[i] == sub->field[j] && PetscMax(diagonal[i], diagonal[j]) > LATIN_JUMP * PetscMin(diagonal[i], diagonal[j])) rough[i] = PETSC_TRUE;
    }
  }
  PetscCall(PetscFree(diagonal));
  PetscFunctionReturn(0);
}

/* rough[s]: do they jump next to an interface of the subdomain? */
PetscErrorCode LatinJumps_Private(Latin latin, PetscBool rough[])
{
  LatinSubstructure *sub   = &latin->sub;
  LatinInterfaces   *inter = &latin->inter;
  PetscBool         *at;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->copies, &at));
  if (!latin->interior) PetscCall(LatinJumpsCopies_Private(latin, at));
  for (PetscInt i = 0; i < sub->copies && latin->interior; i++) at[i] = LatinInteriorRough(latin, i);
  for (PetscInt s = 0; s < sub->n; s++) rough[s] = PETSC_FALSE;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    for (PetscInt k = face->side_first; k < face->side_last && !rough[face->sub]; k++) rough[face->sub] = at[inter->side_dof[k]];
  }
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

/* whole[f]: do they jump next to an interface of one of the two subdomains of f? Collective on latin */
PetscErrorCode LatinJumpsFaces_Private(Latin latin, PetscBool whole[])
{
  LatinInterfaces *inter = &latin->inter;
  PetscBool       *rough;
  PetscInt        *mine, *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(latin->sub.n, &rough, inter->sides, &mine, inter->sides, &mate));
  PetscCall(LatinJumps_Private(latin, rough));
  for (PetscInt f = 0; f < inter->count; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) mine[k] = rough[inter->interface[f].sub] ? 1 : 0;
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_INT, mine, mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    whole[f] = (PetscBool)(face->side_last > face->side_first && (rough[face->sub] || mate[face->side_first]));
  }
  PetscCall(PetscFree3(rough, mine, mate));
  PetscFunctionReturn(0);
}
