#include "snes/sneslatinimpl.h"

/*
   Moving supports along a path of large displacements: prescribed displacements grow with the loads, from those at the start of the path (none, or
   those of the last solve) to those given. Whatever is computed at an equilibrium needs the supports at its part of the path. If no support moves, all
   of this does nothing.
*/

/* Moves the supports to this part of the path. Not collective */
static void LatinSupportsMove(LatinStructure structure, LatinSupports *supports, PetscReal part)
{
  const PetscInt dim = structure->dim;

  for (PetscInt i = 0; i < dim * structure->nodes_local; i++) structure->prescribed[i] = supports->given[i] - (1.0 - part) * supports->moved[i];
  for (PetscInt i = 0; i < dim * structure->vertices; i++) structure->vertex_prescribed[i] = supports->vertex_given[i] - (1.0 - part) * supports->vertex_moved[i];
  structure->held_state++;
  supports->part = part;
}

/* Moves the supports to this part of the path, in the iteration as well. Collective on snes */
PetscErrorCode SNESLatinSupportsAt_Private(SNES snes, PetscReal part)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;

  PetscFunctionBegin;
  if (!large->path.supports.moves || large->path.supports.part == part) PetscFunctionReturn(0);
  LatinSupportsMove(large->frame->original, &large->path.supports, part);
  large->frame->held_state = large->frame->original->held_state;
  PetscCall(LatinSetUp_Private(data->latin));
  PetscFunctionReturn(0);
}

/* Starts a path with supports displaced by `first`, [nodes_local][dim]; NULL: not displaced. Collective on snes */
PetscErrorCode SNESLatinSupportsFrom_Private(SNES snes, const PetscReal first[])
{
  LatinLarge    *large     = &((SNES_Latin *)snes->data)->large;
  LatinSupports *supports  = &large->path.supports;
  LatinStructure structure = large->frame->original;
  const PetscInt n = structure->dim * structure->nodes_local, m = structure->dim * structure->vertices;
  PetscMPIInt    moves = 0;

  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsAt_Private(snes, 1.0));
  for (PetscInt i = 0; i < n; i++)
    if (structure->prescribed[i] != (first ? first[i] : 0.0)) moves = 1;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &moves, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  supports->moves = (PetscBool)moves;
  if (!moves) PetscFunctionReturn(0);
  if (!supports->given) PetscCall(PetscMalloc4(n + 1, &supports->given, n, &supports->moved, m, &supports->vertex_given, m, &supports->vertex_moved));
  PetscCall(PetscArraycpy(supports->given, structure->prescribed, n));
  PetscCall(PetscArraycpy(supports->vertex_given, structure->vertex_prescribed, m));
  for (PetscInt i = 0; i < n; i++) supports->moved[i] = structure->prescribed[i] - (first ? first[i] : 0.0);
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, structure->dim, MPIU_REAL, supports->moved, supports->vertex_moved));
  supports->part = 1.0;
  PetscCall(SNESLatinSupportsAt_Private(snes, 0.0));
  PetscFunctionReturn(0);
}

/* Adds to the loads the forces of the whole motion of the supports, by the tangent stiffness at u. Collective on snes */
PetscErrorCode SNESLatinSupportsLoad_Private(SNES snes, Vec u, Vec load)
{
  LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  Vec         r;

  PetscFunctionBegin;
  if (!large->path.supports.moves) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(LatinTurningHeld_Private(large->frame->original, u, large->path.supports.vertex_moved, r));
  PetscCall(VecAXPY(load, -1.0, r));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscFunctionReturn(0);
}

/*
   Predicts the displacements `ahead` from the equilibrium u, `more` of the path further, and initial strains and tensions for Newton's method
   (large->guess.start): supports that move alone would overstretch the links next to them. rate: displacements of the whole path by the tangent stiffness at
   u. Collective on snes
*/
PetscErrorCode SNESLatinSupportsAhead_Private(SNES snes, Vec u, Vec rate, PetscReal more, Vec ahead)
{
  LatinLarge          *large     = &((SNES_Latin *)snes->data)->large;
  const LatinStructure structure = large->frame->original;
  const PetscReal      part      = large->path.supports.part;
  const PetscInt       n         = structure->links_local;

  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsAt_Private(snes, large->path.reached));
  PetscCall(PetscFree(large->guess.start));
  PetscCall(PetscMalloc1(2 * n + 1, &large->guess.start)); /* not NULL without links either */
  PetscCall(LatinTurningAhead_Private(structure, u, large->path.supports.vertex_moved, rate, more, large->guess.start, large->guess.start + n));
  PetscCall(VecWAXPY(ahead, more, rate, u));
  PetscCall(SNESLatinSupportsAt_Private(snes, part));
  PetscFunctionReturn(0);
}

/*
   Ends the path at this part and moves the supports back to where they are given. *borne: part of these displacements at the end of the path;
   PETSC_MAX_REAL if supports do not move. Collective on snes
*/
PetscErrorCode SNESLatinSupportsEnd_Private(SNES snes, PetscReal reached, PetscReal *borne)
{
  LatinLarge          *large     = &((SNES_Latin *)snes->data)->large;
  const LatinStructure structure = large->frame->original;
  const PetscInt       n         = structure->dim * structure->nodes_local;
  PetscReal            sum[2]    = {0.0, 0.0};

  PetscFunctionBegin;
  *borne = PETSC_MAX_REAL;
  PetscCall(SNESLatinSupportsAt_Private(snes, reached));
  if (!large->path.held) PetscCall(PetscMalloc1(n + 1, &large->path.held));
  PetscCall(PetscArraycpy(large->path.held, structure->prescribed, n));
  if (!large->path.supports.moves) PetscFunctionReturn(0);
  for (PetscInt i = 0; i < n; i++) {
    sum[0] += large->path.held[i] * large->path.supports.given[i];
    sum[1] += PetscSqr(large->path.supports.given[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *borne = sum[1] > 0.0 ? sum[0] / sum[1] : reached; /* none are given: part of the way back to zero */
  PetscCall(SNESLatinSupportsAt_Private(snes, 1.0));
  PetscFunctionReturn(0);
}

/* Resets the supports after a path or an error. Not collective */
PetscErrorCode LatinSupportsReset_Private(LatinLarge *large)
{
  PetscFunctionBegin;
  if (large->path.supports.moves && large->path.supports.part < 1.0) LatinSupportsMove(large->frame->original, &large->path.supports, 1.0);
  PetscCall(PetscFree4(large->path.supports.given, large->path.supports.moved, large->path.supports.vertex_given, large->path.supports.vertex_moved));
  PetscCall(PetscFree(large->guess.start));
  large->path.supports.moves = PETSC_FALSE;
  PetscFunctionReturn(0);
}
