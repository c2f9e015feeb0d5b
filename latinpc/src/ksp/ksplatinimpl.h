/* KSP latin (ksp/ksplatin.c), the iteration as an operator (ksp/interfaceoperator.c), when it may claim convergence (ksp/trueresidual.c) */
#ifndef KSPLATINIMPL_H
#define KSPLATINIMPL_H

#include "core/latinimpl.h"
#include <petsc/private/kspimpl.h>

typedef struct {
  Latin            latin;
  KSP              outer;                      /* solves for the interface data */
  Mat              A;                          /* its operator */
  Vec              b, y;                       /* its right-hand side, of norm 1, and solution */
  PetscReal        scale;                      /* what b has been divided by: the interface residual of the initial guess */
  PetscReal        rhs_norm;                   /* what a relative tolerance refers to, 0: to the first residual */
  Vec              guess, load;                /* initial guess, its residual */
  Vec              solution, residual, digits; /* work */
  PetscInt         logged;                     /* iterations that monitors have seen */
  PetscInt         passes, before;             /* solves of the outer KSP before this one, and their iterations */
  PetscInt         checked, next;              /* iterations of this pass after which solution holds x (-1: not yet), and at which the next check may come */
  PetscReal        allowed, left;              /* norm of b - A x that the tolerances allow, and that of the last check */
  PetscReal        left_before;                /* that of the pass before */
  PetscObjectId    matrix;
  PetscObjectState matrix_state; /* what the operators were built for */
} KSP_Latin;

/* y in variables whose norm is the energy norm */
PETSC_INTERN PetscErrorCode LatinReflectionApply_Private(LatinLinear *, Vec y, Vec out);
PETSC_INTERN PetscErrorCode LatinReflectionSolution_Private(LatinLinear *, Vec y, Vec u);
/* ksp/trueresidual.c */
PETSC_INTERN PetscErrorCode KSPLatinAllow_Private(KSP);
PETSC_INTERN PetscErrorCode KSPLatinCheck_Private(KSP, PetscInt it, PetscReal norm, KSPConvergedReason *);
PETSC_INTERN PetscErrorCode KSPLatinRefine_Private(KSP, PetscBool *again);

#endif
