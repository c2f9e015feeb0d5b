#include "snes/sneslatinimpl.h"

/* Displacements of single nodes along a path: one node that moves does not show in a norm of all. */

#define LATIN_PATH_EQUAL 1.01 /* tolerance of LatinPathBetween_Private, for the error of the linear solves */
#define LATIN_PATH_ASIDE 0.2  /* part of the mean prediction by which a node of a large net may lie beside the predictions */

/*
   Returns in *within whether each node moves by `moved` at most LATIN_PATH_FAR times as far as by `other`, or at most `little`, or at most
   LATIN_PATH_ASIDE times as far as by `middle` (or NULL). Collective on structure
*/
PetscErrorCode LatinPathNodes_Private(LatinStructure structure, Vec moved, Vec other, Vec middle, PetscReal little, PetscBool *within)
{
  const PetscInt     dim = structure->dim, vectors = middle ? 3 : 2;
  const Vec          u[3]    = {moved, other, middle};
  PetscReal         *size[3] = {NULL, NULL, NULL};
  PetscMPIInt        far     = 0;
  const PetscScalar *a;
  Vec                local;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < vectors; k++) {
    PetscCall(DMGetWorkArray(structure->dm, structure->vertices, MPIU_REAL, &size[k]));
    PetscCall(PetscArrayzero(size[k], structure->vertices));
    PetscCall(LatinStructureOpen_Private(structure, NULL, u[k], &local, &a));
    for (PetscInt i = 0; i < dim * structure->vertices; i++) size[k][i / dim] += PetscSqr(PetscRealPart(a[i]));
    PetscCall(LatinStructureClose_Private(structure, &local, &a));
  }
  for (PetscInt i = 0; i < structure->vertices; i++) {
    const PetscReal aside = middle ? LATIN_PATH_ASIDE * PetscSqrtReal(size[2][i]) : 0.0;

    if (!(PetscSqrtReal(size[0][i]) <= PetscMax(PetscMax(little, aside), LATIN_PATH_FAR * PetscSqrtReal(size[1][i])))) far = 1;
  }
  for (PetscInt k = vectors; k-- > 0;) PetscCall(DMRestoreWorkArray(structure->dm, structure->vertices, MPIU_REAL, &size[k]));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &far, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  *within = (PetscBool)!far;
  PetscFunctionReturn(0);
}

/*
   Returns in *within whether the displacement `mean` of each node is between the predictions at the start, `ahead`, and at the end, `back`: no further
   from their middle than they are, or than LATIN_PATH_ASIDE of the middle, or than half of `little`. back NULL: no further from `ahead` than `ahead` is
   from zero. Collective on structure
*/
PetscErrorCode LatinPathBetween_Private(LatinStructure structure, Vec mean, Vec ahead, Vec back, PetscReal little, PetscBool *within)
{
  Vec off, half, middle;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &off));
  PetscCall(DMGetGlobalVector(structure->dm, &half));
  PetscCall(DMGetGlobalVector(structure->dm, &middle));
  PetscCall(VecCopy(ahead, middle));
  PetscCall(VecCopy(ahead, half));
  if (back) {
    PetscCall(VecAXPBY(middle, 0.5, 0.5, back));
    PetscCall(VecAXPBY(half, -0.5, 0.5, back));
  }
  PetscCall(VecWAXPY(off, -1.0, middle, mean));
  PetscCall(VecScale(half, LATIN_PATH_EQUAL / LATIN_PATH_FAR));
  PetscCall(LatinPathNodes_Private(structure, off, half, middle, 0.5 * little, within)); /* twice `ahead` is off the middle by half of itself */
  PetscCall(DMRestoreGlobalVector(structure->dm, &middle));
  PetscCall(DMRestoreGlobalVector(structure->dm, &half));
  PetscCall(DMRestoreGlobalVector(structure->dm, &off));
  PetscFunctionReturn(0);
}

/* Sets forces that differ from node to node, so that they have a part in any mode */
PetscErrorCode LatinPathForces_Private(Vec r)
{
  PetscInt     first, last;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetOwnershipRange(r, &first, &last));
  PetscCall(VecGetArrayWrite(r, &a));
  for (PetscInt i = first; i < last; i++) a[i - first] = PetscSinReal((PetscReal)(i + 1));
  PetscCall(VecRestoreArrayWrite(r, &a));
  PetscFunctionReturn(0);
}

/*
   Removes the forces f on nodes that only slack links hold: `left`, the stiffness times some displacements, is exactly zero there. Overwrites left:
   0 at these nodes, else 1. Collective on structure
*/
PetscErrorCode LatinPathLoose_Private(LatinStructure structure, Vec left, Vec f)
{
  const PetscInt dim = structure->dim;
  PetscScalar   *a;
  Vec            local;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &local));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, left, local));
  PetscCall(VecGetArray(local, &a));
  for (PetscInt i = 0; i < structure->vertices; i++) {
    PetscScalar held = 0.0;

    for (PetscInt c = 0; c < dim; c++)
      if (a[dim * i + c] != 0.0) held = 1.0;
    for (PetscInt c = 0; c < dim; c++) a[dim * i + c] = held;
  }
  PetscCall(VecRestoreArray(local, &a));
  PetscCall(DMLocalToGlobal(structure->dm, local, INSERT_VALUES, left));
  PetscCall(DMRestoreLocalVector(structure->dm, &local));
  PetscCall(VecPointwiseMult(f, f, left));
  PetscFunctionReturn(0);
}

/*
   Returns in *struts whether any link that may turn can bear compression, and in *floors (or NULL) whether any link keeps its direction, as floors do.
   Collective on structure
*/
PetscErrorCode LatinPathStruts_Private(LatinStructure structure, PetscBool *struts, PetscBool *floors)
{
  PetscMPIInt any[2] = {0, 0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (LatinStructureKeeps(structure, l)) any[1] = 1;
    else if (structure->law[l] != LATIN_LAW_CABLE && structure->law[l] != LATIN_LAW_INEXTENSIBLE) any[0] = 1;
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, any, 2, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  *struts = (PetscBool)any[0];
  if (floors) *floors = (PetscBool)any[1];
  PetscFunctionReturn(0);
}
