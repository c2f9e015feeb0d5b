/*
   What the factorisation of localsolvers/cholesky.c is made of: rows that are kept, and the fronts that CHOLMOD's symbolic
   analysis (localsolvers/analysis.c) gives.
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
  cholmod_common  common;
  cholmod_factor *L;                           /* of the symbolic analysis, while that is under way */
  PetscInt       *order, *first, *begin, *row; /* what the fronts need of it */
  LatinFronts     fronts;
  PetscInt        n, kept;     /* the last rows in the order of elimination are kept: */
  PetscBool      *keep;        /* [n] those asked for, and others of their nodes that are coupled to nothing */
  PetscInt        asked, *ask; /* [asked] rows of the Schur complement, ascending */
  LatinArithmetic precision;   /* that is asked for */
  PetscReal      *diagonal;    /* [kept] of the matrix */
  PetscReal      *schur;       /* of F->schur, until it is given away; its lower triangle if it is for that alone */
  PetscBool       gives;
  LatinSpending   spending; /* of the entries of the matrix */
} LatinSupernodes;

PETSC_INTERN PetscErrorCode LatinSupernodesAnalyze(LatinSupernodes *, Mat);
PETSC_INTERN PetscErrorCode LatinSupernodesReset(LatinSupernodes *);

#endif
