#include "snes/sneslatinimpl.h"

/* Solves of large displacements from displacements that are given. */

#define LATIN_PATH_STAGES 60 /* most linear stages of one: at a limit point it takes any number */

/* Displacements u as those that a solve starts from. Collective on snes */
static PetscErrorCode LatinPathPlace_Private(SNES snes, Vec u)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESLatinLoad_Private(snes));
  PetscCall(VecCopy(u, snes->vec_sol));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateStart_Private(data->latin, &data->estimate));
  data->guess           = PETSC_TRUE;
  data->has_state       = PETSC_FALSE;
  data->first_distance  = -1.0;
  data->current         = -1;
  data->large.stateless = PETSC_TRUE;
  data->large.inside    = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Newton's method from the displacements u, where it is to prove what is found; *done: they were near an equilibrium. Collective on snes */
PetscErrorCode SNESLatinLargeProof_Private(SNES snes, Vec u, PetscBool *done)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(LatinPathPlace_Private(snes, u));
  if (!SNESLatinEstimates(data) || data->newton.type == LATIN_NEWTON_NEVER) PetscFunctionReturn(0);
  data->next = LATIN_NEXT_LINE_SEARCH;
  PetscCall(SNESLatinLargeFinish_Private(snes, LATIN_PATH_TANGENTS, PETSC_FALSE, done));
  PetscFunctionReturn(0);
}

/*
   A solve from the displacements u. From an equilibrium, `near`, Newton's method takes a few steps, and bars in compression, which
   the local stage lets buckle one by one, do not disturb it; where it fails a smaller increment is better than the iteration.
   Collective on snes
*/
PetscErrorCode SNESLatinLargeFrom_Private(SNES snes, Vec u, PetscBool near)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   done = PETSC_FALSE;

  PetscFunctionBegin;
  if (near) PetscCall(SNESLatinLargeProof_Private(snes, u, &done));
  else PetscCall(LatinPathPlace_Private(snes, u));
  if (done) PetscFunctionReturn(0);
  if (near && SNESLatinEstimates(data) && data->newton.type != LATIN_NEWTON_NEVER) {
    data->large.inside = PETSC_TRUE;
    PetscCall(SNESLatinLargeInterior_Private(snes, NULL, &done));
    PetscFunctionReturn(0);
  }
  data->large.last = near ? data->latin->linear.applications + LATIN_PATH_STAGES : PETSC_MAX_INT;
  PetscCall(SNESLatinLargeIterate_Private(snes));
  if (LatinNextConverged(data->next)) PetscCall(SNESLatinResidual_Private(snes));
  PetscFunctionReturn(0);
}
