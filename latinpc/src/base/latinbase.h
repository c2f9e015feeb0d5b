/*
   What every room uses: the numbers of this precision, the classes and the log events that package.c registers.
*/
#ifndef LATINBASE_H
#define LATINBASE_H

#include <petscsys.h>
#include <math.h> /* INFINITY: that of PETSc is a large number */

#if defined(PETSC_USE_COMPLEX)
  #error "latinpc needs a PETSc with real scalars: structures have real displacements"
#endif

/* A number that stands for rounding, in double and in single precision */
#if defined(PETSC_USE_REAL_SINGLE)
  #define LatinByPrecision(in_double, in_single) in_single
#else
  #define LatinByPrecision(in_double, in_single) in_double
#endif

/* A part of a whole, of which neither is negative: without end of nothing, unless it is nothing as well */
static inline PetscReal LatinRatio(PetscReal part, PetscReal whole)
{
  return whole > 0.0 ? part / whole : part == 0.0 && whole == 0.0 ? 0.0 : INFINITY; /* of no number as well */
}

PETSC_INTERN PetscClassId  LATIN_CLASSID, LATIN_STRUCTURE_CLASSID;
PETSC_INTERN PetscLogEvent LATIN_SetUp, LATIN_Partition, LATIN_Subdomains, LATIN_Interface, LATIN_Direction, LATIN_Macro, LATIN_Spectral, LATIN_Linear, LATIN_Coarse, LATIN_Local, LATIN_Condense, LATIN_Estimate, LATIN_Cases;

PETSC_INTERN PetscErrorCode LatinRegisterClasses_Private(void);
/* The solver types, which register.c hands in when the library is loaded */
PETSC_INTERN PetscErrorCode (*LatinTypesRegister_Private)(void);

#endif
