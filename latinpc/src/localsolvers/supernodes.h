/*
   Data of a factor of localsolvers/cholesky.c: rows of the Schur complement, and the fronts from the symbolic analysis by CHOLMOD
   (localsolvers/analysis.c).
*/
#ifndef LATINSUPERNODES_H
#define LATINSUPERNODES_H

#include "localsolvers/fronts.h"
#include <cholmod.h>

#if defined(PETSC_USE_64BIT_INDICES)
  #define CHOLMOD(name)  cholmod_l_##name
  #define CHOLMOD_NUMBER CHOLMOD_LONG
#else
  #define CHOLMOD(name)  cholmod_##name
  #define CHOLMOD_NUMBER CHOLMOD_INT
#endif

typedef struct {
  cholmod_common       common;
  cholmod_factor      *L;                           /* during the symbolic analysis only */
  PetscInt            *order, *first, *begin, *row; /* results of the analysis, lists of the fronts: see LatinFronts */
  LatinFronts          fronts;
  PetscInt             n, kept;                /* number of rows; of kept ones, the last in the order of elimination */
  PetscBool           *keep;                   /* [n] whether a row is kept: those of the Schur complement, and uncoupled rows of their nodes */
  PetscInt             schur_rows, *schur_row; /* number of rows of the Schur complement; [schur_rows] these, ascending */
  LatinArithmetic      precision;              /* requested precision */
  PetscReal           *diagonal;               /* [kept] diagonal entries of the matrix */
  PetscReal           *schur;                  /* entries of F->schur, or (lower) its lower triangle alone; NULL once the caller has taken it */
  PetscBool            lower;
  LatinEntriesCallback callback; /* callback that releases the entries of the matrix */
} LatinSupernodes;

PETSC_INTERN PetscErrorCode LatinSupernodesAnalyze(LatinSupernodes *, Mat);
PETSC_INTERN PetscErrorCode LatinSupernodesReset(LatinSupernodes *);

#endif
