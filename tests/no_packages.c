/*
   Preloaded (LD_PRELOAD), makes PETSc look as if it had been built without MUMPS, CHOLMOD and other packages.
*/
#include <petscmat.h>
#include <string.h>

PetscErrorCode MatGetFactorAvailable(Mat A, MatSolverType type, MatFactorType factor, PetscBool *available)
{
  PetscErrorCode (*create)(Mat, MatFactorType, Mat *) = NULL;
  MatType mattype;

  PetscFunctionBegin;
  *available = PETSC_FALSE;
  if (type && strcmp(type, MATSOLVERPETSC)) PetscFunctionReturn(0);
  PetscCall(MatGetType(A, &mattype));
  PetscCall(MatSolverTypeGet(type, mattype, factor, NULL, NULL, &create));
  *available = create ? PETSC_TRUE : PETSC_FALSE;
  PetscFunctionReturn(0);
}
