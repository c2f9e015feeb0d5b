/* KSP latin (ksp/ksplatin.c), the iteration as an operator (ksp/interfaceoperator.c) */
#ifndef KSPLATINIMPL_H
#define KSPLATINIMPL_H

#include "core/latinimpl.h"
#include <petsc/private/kspimpl.h>

typedef struct {
  Latin            latin;
  KSP              outer;              /* solves for the interface data */
  Mat              A;                  /* its operator */
  Vec              b, y;               /* its right-hand side, of norm 1, and solution */
  PetscReal        scale;              /* what b has been divided by: the interface residual of the initial guess */
  PetscReal        rhs_norm;           /* what a relative tolerance refers to, 0: to the first residual */
  Vec              guess, load;        /* initial guess, its residual */
  Vec              solution, residual; /* work */
  PetscInt         logged;             /* iterations that monitors have seen */
  PetscObjectId    matrix;
  PetscObjectState matrix_state; /* what the operators were built for */
} KSP_Latin;

/* y in variables whose norm is the energy norm */
PETSC_INTERN PetscErrorCode LatinReflectionApply_Private(LatinLinear *, Vec y, Vec out);
PETSC_INTERN PetscErrorCode LatinReflectionSolution_Private(LatinLinear *, Vec y, Vec u);

#endif
