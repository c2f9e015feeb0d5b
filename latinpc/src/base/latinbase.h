/*
   Common to all folders: constants of the precision; classes and log events, which base/package.c registers.
*/
#ifndef LATINBASE_H
#define LATINBASE_H

#include <petscsys.h>
#include <math.h> /* INFINITY: that of PETSc is a large number */

#if defined(PETSC_USE_COMPLEX)
  #error "latinpc needs a PETSc with real scalars: structures have real displacements"
#endif

/* A constant that depends on rounding, in double and in single precision */
#if defined(PETSC_USE_REAL_SINGLE)
  #define LatinByPrecision(in_double, in_single) in_single
#else
  #define LatinByPrecision(in_double, in_single) in_double
#endif

#define LATIN_LEAST LatinByPrecision(1e-146, 1e-15) /* least number whose square has all its digits */

/* Returns part / whole, neither of them negative; 0 / 0 = 0; else infinity if whole is 0 or NaN */
static inline PetscReal LatinRatio(PetscReal part, PetscReal whole)
{
  return whole > 0.0 ? part / whole : part == 0.0 && whole == 0.0 ? 0.0 : INFINITY;
}

PETSC_INTERN PetscClassId  LATIN_CLASSID, LATIN_STRUCTURE_CLASSID;
PETSC_INTERN PetscLogEvent LATIN_SetUp, LATIN_Partition, LATIN_Subdomains, LATIN_Interface, LATIN_Direction, LATIN_Macro, LATIN_Spectral, LATIN_Linear, LATIN_Coarse, LATIN_Local, LATIN_Condense, LATIN_Estimate, LATIN_Cases;

PETSC_INTERN PetscErrorCode LatinRegisterClasses_Private(void);
/* Registers the solver types; set by register.c when the library is loaded, NULL: none */
PETSC_INTERN PetscErrorCode (*LatinTypesRegister_Private)(void);

#endif
