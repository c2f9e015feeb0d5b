#include "snes/largepath.h"

/* Kinks of laws on a path: links nearer to a kink, as between slack and taut, than the requested error have two stiffnesses. */

/*
   Computes the stiffnesses of the links at u. A link nearer to a kink of its law than `near`, or than the requested error, gets that of its stiffer
   side, which holds states within that error, or of its softer side. loose: LATIN_SLACK for links at nodes that slack links leave free.
   Collective on snes
*/
PetscErrorCode LatinPathSlopes_Private(SNES snes, Vec u, PetscReal near, PetscBool stiffer, PetscBool loose, PetscReal slope[])
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->original;
  PetscReal            size, *at;

  PetscFunctionBegin;
  PetscCall(VecNorm(u, NORM_INFINITY, &size));
  near = PetscMax(near, PetscMax(data->target * size, LATIN_LARGE_NONE * data->large.size));
  PetscCall(PetscMalloc1(2 * structure->links_local, &at));
  PetscCall(LatinTurningAhead_Private(structure, u, NULL, u, 0.0, at, at + structure->links_local));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal x = at[structure->links_local + l], below = LatinStructureTangent(structure, l, x - near), above = LatinStructureTangent(structure, l, x + near);

    slope[l] = stiffer ? PetscMax(below, above) : PetscMin(below, above);
  }
  PetscCall(PetscFree(at));
  if (loose) PetscCall(LatinPathSlack_Private(structure, u, near, slope));
  PetscFunctionReturn(0);
}

/* Returns in *stiffer whether any link has a larger stiffness in b than in a, [links_local] each. Collective on structure */
PetscErrorCode LatinPathStiffer_Private(LatinStructure structure, const PetscReal a[], const PetscReal b[], PetscBool *stiffer)
{
  PetscMPIInt any = 0;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (b[l] > a[l]) any = 1;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  *stiffer = (PetscBool)any;
  PetscFunctionReturn(0);
}

/* Returns in *tightens whether any link is stiffer at v than at u, as a slack cable that becomes taut. Collective on snes */
PetscErrorCode LatinPathTightens_Private(SNES snes, Vec u, Vec v, PetscBool *tightens)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  const PetscInt       n         = structure->links_local;
  PetscReal           *slope;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(2 * n + 1, &slope)); /* not NULL without links either */
  PetscCall(LatinPathSlopes_Private(snes, u, 0.0, PETSC_TRUE, PETSC_FALSE, slope));
  PetscCall(LatinPathSlopes_Private(snes, v, 0.0, PETSC_TRUE, PETSC_FALSE, slope + n));
  PetscCall(LatinPathStiffer_Private(structure, slope, slope + n, tightens));
  PetscCall(PetscFree(slope));
  PetscFunctionReturn(0);
}
