#include "localsolvers/latinlocalsolvers.h"

/* Stubs of localsolvers/cholesky.c for a PETSc without CHOLMOD. */

#if !LATIN_CHOLMOD

/* Nothing to register: MatGetFactorAvailable() returns false for the type */
PetscErrorCode LatinCholeskyRegister(void)
{
  return 0;
}

PetscErrorCode LatinCholeskyForward(Mat F, PetscReal g[], PetscReal *energy)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyOrder(Mat F, const PetscInt *order[])
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskySolveLanes(Mat F, float x[], PetscReal energy[], PetscReal square[])
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskySolveSome(Mat F, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[])
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskySetLower(Mat F)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskySetCallback(Mat F, LatinEntriesCallback callback)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyTakeLower(Mat F, PetscReal **S)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyTakeSchur(Mat F, PetscReal **S)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyBackward(Mat F, PetscReal g[], PetscReal *energy)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

/* Asked of any PC: a factor of another type keeps its precision */
PetscErrorCode LatinCholeskyRound(PC pc, LatinArithmetic precision)
{
  return 0;
}

PetscErrorCode LatinCholeskyAgain(PC pc, Mat A, LatinArithmetic precision)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyEnergy(PC pc, Vec b, PetscReal *energy)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyPrecision(PC pc, LatinArithmetic *precision)
{
  *precision = LATIN_DOUBLE;
  return 0;
}

PetscErrorCode LatinCholeskyCost(PC pc, PetscReal *operations, PetscReal *bytes)
{
  *operations = *bytes = 0.0;
  return 0;
}

#endif
