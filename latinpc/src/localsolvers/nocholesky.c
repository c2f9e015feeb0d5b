#include "localsolvers/latinlocalsolvers.h"

/* Stubs of localsolvers/cholesky.c for a PETSc without CHOLMOD. */

#if !LATIN_CHOLMOD

/* Nothing to register: MatGetFactorAvailable() returns false for the type */
PetscErrorCode LatinCholeskyRegister(void)
{
  return 0;
}

  #define LatinNoFactor(function, ...) \
    PetscErrorCode function(__VA_ARGS__) \
    { \
      SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made"); \
    }
LatinNoFactor(LatinCholeskyForward, Mat F, PetscReal g[], PetscReal *energy) LatinNoFactor(LatinCholeskyOrder, Mat F, const PetscInt *order[]) LatinNoFactor(LatinCholeskySolveLanes, Mat F, float x[], PetscReal energy[], PetscReal square[])
  LatinNoFactor(LatinCholeskySolveSome, Mat F, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[]) LatinNoFactor(LatinCholeskySetLower, Mat F) LatinNoFactor(LatinCholeskySetCallback, Mat F, LatinEntriesCallback callback)
    LatinNoFactor(LatinCholeskyTakeLower, Mat F, PetscReal **S) LatinNoFactor(LatinCholeskyTakeSchur, Mat F, PetscReal **S) LatinNoFactor(LatinCholeskyBackward, Mat F, PetscReal g[], PetscReal *energy)
      LatinNoFactor(LatinCholeskyAgain, PC pc, Mat A, LatinArithmetic precision) LatinNoFactor(LatinCholeskyEnergy, PC pc, Vec b, PetscReal *energy)

  /* Called for any PC: a factor of another type keeps its precision */
  PetscErrorCode LatinCholeskyRound(PC pc, LatinArithmetic precision)
{
  return 0;
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
