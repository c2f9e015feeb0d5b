#include "structure/structureimpl.h"

/* Springs between the nodes and the ground, which stand for masses in a time step. */

/* Adds the forces of the springs to the ground, G u */
PetscErrorCode LatinStructureAddGround_Private(LatinStructure structure, Vec u, Vec r)
{
  const PetscScalar *g, *a;
  PetscScalar       *f;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetArrayRead(structure->ground, &g));
  PetscCall(VecGetArrayRead(u, &a));
  PetscCall(VecGetArray(r, &f));
  for (PetscInt i = 0; i < n; i++) f[i] += g[i] * a[i];
  PetscCall(VecRestoreArray(r, &f));
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscCall(VecRestoreArrayRead(structure->ground, &g));
  PetscFunctionReturn(0);
}

/* 1/2 u^t D u for a diagonal D */
PetscErrorCode LatinDiagonalEnergy_Private(Vec D, Vec u, PetscReal *energy)
{
  const PetscScalar *d, *a;
  PetscReal          sum = 0.0;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetArrayRead(D, &d));
  PetscCall(VecGetArrayRead(u, &a));
  for (PetscInt i = 0; i < n; i++) sum += 0.5 * d[i] * a[i] * a[i];
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscCall(VecRestoreArrayRead(D, &d));
  PetscCall(MPIU_Allreduce(&sum, energy, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)u)));
  PetscFunctionReturn(0);
}

/* What the springs to the ground store */
PetscErrorCode LatinStructureGroundEnergy_Private(LatinStructure structure, Vec u, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinDiagonalEnergy_Private(structure->ground, u, energy));
  PetscFunctionReturn(0);
}
