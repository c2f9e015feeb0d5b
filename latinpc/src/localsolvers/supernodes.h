/*
   Data of the factorisation of localsolvers/cholesky.c: rows of the Schur complement, and the fronts from the symbolic analysis
   by CHOLMOD (localsolvers/analysis.c).
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
  PetscInt            *order, *first, *begin, *row; /* its results for the fronts */
  LatinFronts          fronts;
  PetscInt             n, kept;                /* rows; kept ones, the last in the order of elimination */
  PetscBool           *keep;                   /* [n] kept: rows of the Schur complement, and uncoupled rows of their nodes */
  PetscInt             schur_rows, *schur_row; /* [schur_rows] rows of the Schur complement, ascending */
  LatinArithmetic      precision;              /* requested */
  PetscReal           *diagonal;               /* [kept] of the matrix */
  PetscReal           *schur;                  /* entries of F->schur, or (lower) its lower triangle alone; NULL once it is taken over */
  PetscBool            lower;
  LatinEntriesCallback callback; /* releases the entries of the matrix */
} LatinSupernodes;

PETSC_INTERN PetscErrorCode LatinSupernodesAnalyze(LatinSupernodes *, Mat);
PETSC_INTERN PetscErrorCode LatinSupernodesReset(LatinSupernodes *);

#endif
