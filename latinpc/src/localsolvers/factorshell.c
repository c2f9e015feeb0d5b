#include "localsolvers/latinlocalsolvers.h"
#include <petsc/private/matimpl.h>

/* Creates F, the Mat of a Cholesky factor of a MatSolverType of ours, n rows on this rank, without operations yet. Takes over data. Collective on comm */

static PetscErrorCode LatinFactorType_Private(Mat F, MatSolverType *type)
{
  PetscFunctionBegin;
  *type = F->solvertype;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinFactorShell_Private(MPI_Comm comm, PetscInt n, MatSolverType type, void *data, Mat *F)
{
  PetscFunctionBegin;
  PetscCall(MatCreate(comm, F));
  PetscCall(MatSetSizes(*F, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(PetscStrallocpy(type, &((PetscObject)*F)->type_name));
  PetscCall(MatSetUp(*F));
  PetscCall(PetscFree((*F)->solvertype));
  PetscCall(PetscStrallocpy(type, &(*F)->solvertype));
  PetscCall(PetscObjectComposeFunction((PetscObject)*F, "MatFactorGetSolverType_C", LatinFactorType_Private));
  (*F)->data       = data;
  (*F)->factortype = MAT_FACTOR_CHOLESKY;
  (*F)->assembled = (*F)->preallocated = PETSC_TRUE;
  PetscFunctionReturn(0);
}
