/* KSP latin (ksp/ksplatin.c), its operator (ksp/interfaceoperator.c), and its convergence test by the true residual (ksp/trueresidual.c) */
#ifndef KSPLATINIMPL_H
#define KSPLATINIMPL_H

#include "core/latinimpl.h"
#include <petsc/private/kspimpl.h>

typedef struct {
  Latin            latin;
  KSP              outer;                      /* solves for the interface data */
  Mat              A;                          /* its operator */
  Vec              b, y;                       /* its right-hand side, scaled to norm 1, and solution */
  PetscReal        scale;                      /* norm of b before scaling: interface residual of the initial guess */
  PetscReal        rhs_norm;                   /* reference of the relative tolerance; 0: the first residual */
  Vec              guess, load;                /* initial guess of the pass, and its residual */
  Vec              solution, residual, digits; /* work */
  PetscInt         logged;                     /* last iteration shown to monitors; -1: none */
  PetscInt         passes, before;             /* number of passes (solves of the outer KSP) before this one; their iterations */
  PetscInt         checked, next;              /* iterations of this pass: that of x in `solution`, -1: none; earliest one of the next check */
  PetscReal        allowed, true_norm;         /* norms of b - A x: that the tolerances allow; that of the last check */
  PetscReal        true_before;                /* norm of b - A x after the last pass */
  PetscObjectId    id[3];                      /* preconditioning matrix and coordinates of the last set-up; matrix of its last check */
  PetscObjectState state[3];                   /* the same */
} KSP_Latin;

/* Reason of a pass that has reached the level of rounding, and of an outer KSP that breaks down: KSPLatinRefine_Private() makes another pass, or none */
#define KSP_LATIN_PASS_ENDS KSP_DIVERGED_BREAKDOWN

/* ksp/interfaceoperator.c; y: variables whose Euclidean norm is the energy norm */
PETSC_INTERN PetscErrorCode LatinReflectionApply_Private(LatinLinear *, Vec y, Vec out);
PETSC_INTERN PetscErrorCode LatinReflectionSolution_Private(LatinLinear *, Vec y, Vec u);
/* ksp/trueresidual.c */
PETSC_INTERN PetscErrorCode KSPLatinAllow_Private(KSP);
PETSC_INTERN PetscErrorCode KSPLatinResidual_Private(KSP, Vec r, PetscReal *norm);
PETSC_INTERN PetscErrorCode KSPLatinTrueNorm_Private(KSP, PetscInt it);
PETSC_INTERN PetscErrorCode KSPLatinCheck_Private(KSP, PetscInt it, PetscReal interface, KSPConvergedReason *);
PETSC_INTERN PetscErrorCode KSPLatinRefine_Private(KSP, PetscBool *again);

#endif
