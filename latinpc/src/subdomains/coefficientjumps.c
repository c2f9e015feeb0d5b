#include "subdomains/latinsubdomains.h"

/*
   Where the coefficients of a matrix jump next to an interface. A weight or a search direction that uses the diagonal
   of the operators alone is as good there as any other where they do not; where they do, it takes Schur complements
   (interfaces/searchdirection.c), and local low-energy fields (interfaces/spectralmodes.c).
*/

#define LATIN_JUMP 30.0 /* of the diagonal of the operator, from an unknown to its neighbours of the same field */

/* jumps[i]: do the coefficients of the matrix jump next to copy i? */
PetscErrorCode LatinJumpsCopies_Private(const LatinSubdomains *sub, PetscBool jumps[])
{
  PetscReal *diagonal;

  PetscFunctionBegin;
  if (LatinSubdomainsCondensed(sub)) { /* as they did before the inside was eliminated */
    PetscCall(PetscArraycpy(jumps, sub->jumps, sub->copies));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscMalloc1(sub->copies, &diagonal));
  PetscCall(LatinOperatorDiagonal(sub, diagonal));
  for (PetscInt i = 0; i < sub->copies; i++) {
    jumps[i] = PETSC_FALSE;
    for (PetscInt p = sub->ki[i]; p < sub->ki[i + 1]; p++) {
      const PetscInt j = sub->kj[p];

      if (sub->field[i] == sub->field[j] && PetscMax(diagonal[i], diagonal[j]) > LATIN_JUMP * PetscMin(diagonal[i], diagonal[j])) jumps[i] = PETSC_TRUE;
    }
  }
  PetscCall(PetscFree(diagonal));
  PetscFunctionReturn(0);
}
