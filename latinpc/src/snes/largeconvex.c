#include "snes/sneslatinimpl.h"

#define LATIN_LARGE_CARRIED 4.0 /* times the size of the structure: displacements along the loads from which cables are taut */

/* Displacements u where loads may carry their nodes. Collective on snes */
static PetscErrorCode LatinConvexCarried_Private(SNES snes, Vec u)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  PetscReal         most;

  PetscFunctionBegin;
  PetscCall(LatinStructureLoads_Private(large->frame->turns, snes->vec_rhs, u));
  PetscCall(VecNorm(u, NORM_INFINITY, &most));
  if (most > 0.0) PetscCall(VecScale(u, LATIN_LARGE_CARRIED * large->size / most));
  PetscFunctionReturn(0);
}

/* The equilibrium of cables, if *found, and tensions. Collective on snes */
static PetscErrorCode LatinConvexCables_Private(SNES snes, PetscReal tension[], PetscBool *found)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  Vec                  start;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &start));
  PetscCall(LatinConvexCarried_Private(snes, start));
  PetscCall(SNESLatinLargeFrom_Private(snes, start, PETSC_TRUE, NULL));
  PetscCall(DMRestoreGlobalVector(structure->dm, &start));
  *found = LatinNextConverged(data->next);
  PetscCall(LatinTurningTensions_Private(structure, NULL, snes->vec_sol, tension));
  PetscFunctionReturn(0);
}

/*
   The energy of cables is convex, and that of bars of the same stiffness is nowhere less, and no more where all are taut. So where bars as cables find an
   equilibrium in which each of them pulls it is the least energy of the bars as well, as of a chain that its weight pulls tight: *taut, and u. Collective on snes
*/
PetscErrorCode SNESLatinLargeTaut_Private(SNES snes, Vec u, PetscBool *taut)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  PetscMPIInt          other     = (PetscMPIInt)!SNESLatinLargeProves(data);
  PetscBool           *bar;
  PetscReal           *tension;
  PetscErrorCode       ierr;

  PetscFunctionBegin;
  *taut = PETSC_FALSE;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if ((structure->law[l] != LATIN_LAW_BAR && structure->law[l] != LATIN_LAW_CABLE) || LatinStructureKeeps(structure, l)) other = 1;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &other, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)snes)));
  if (other) PetscFunctionReturn(0);
  PetscCall(PetscMalloc2(structure->links_local, &bar, structure->links_local, &tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    bar[l] = (PetscBool)(structure->law[l] == LATIN_LAW_BAR);
    if (bar[l]) structure->law[l] = LATIN_LAW_CABLE;
  }
  ierr = LatinConvexCables_Private(snes, tension, taut);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (bar[l]) structure->law[l] = LATIN_LAW_BAR;
    if (bar[l] && !(tension[l] > 0.0)) other = 1;
  }
  PetscCall(ierr);
  PetscCall(PetscFree2(bar, tension));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &other, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)snes)));
  *taut = (PetscBool)(*taut && !other);
  if (*taut) PetscCall(VecCopy(snes->vec_sol, u));
  PetscFunctionReturn(0);
}

/*
   Where the iteration over links that only pull or push leaps away it proves nothing: their energy is convex. An interior-point method goes down it,
   from where loads may carry their nodes: there links are taut, and no node has to pass its support. Collective on snes
*/
PetscErrorCode SNESLatinLargeConvex_Private(SNES snes)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  PetscBool            done      = PETSC_FALSE;
  Vec                  away;

  PetscFunctionBegin;
  if ((data->next != LATIN_NEXT_DIVERGED && data->next != LATIN_NEXT_NOT_FINITE) || structure->midpoint || !SNESLatinLargeProves(data)) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &away));
  PetscCall(VecCopy(snes->vec_sol, away));
  PetscCall(LatinConvexCarried_Private(snes, snes->vec_sol));
  PetscCall(SNESLatinLargeInterior_Private(snes, NULL, &done));
  if (!done) data->next = LATIN_NEXT_DIVERGED;
  if (!done) PetscCall(VecCopy(away, snes->vec_sol));
  PetscCall(DMRestoreGlobalVector(structure->dm, &away));
  PetscFunctionReturn(0);
}
