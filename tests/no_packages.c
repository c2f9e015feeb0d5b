/*
   Preloaded (LD_PRELOAD), makes PETSc look as if it had been built without MUMPS, CHOLMOD and other packages.
*/
#define _GNU_SOURCE
#include <dlfcn.h>
#include <petscmat.h>

PetscErrorCode MatSolverTypeGet(MatSolverType type, MatType mattype, MatFactorType factor, PetscBool *package, PetscBool *matrix, PetscErrorCode (**create)(Mat, MatFactorType, Mat *))
{
  PetscErrorCode (*next)(MatSolverType, MatType, MatFactorType, PetscBool *, PetscBool *, PetscErrorCode (**)(Mat, MatFactorType, Mat *));
  PetscBool own = PETSC_TRUE;

  PetscFunctionBegin;
  if (package) *package = PETSC_FALSE;
  if (matrix) *matrix = PETSC_FALSE;
  if (create) *create = NULL;
  if (type) PetscCall(PetscStrcmp(type, MATSOLVERPETSC, &own));
  if (!own) PetscFunctionReturn(0);
  *(void **)&next = dlsym(RTLD_NEXT, "MatSolverTypeGet");
  PetscCall(next(MATSOLVERPETSC, mattype, factor, package, matrix, create));
  PetscFunctionReturn(0);
}
