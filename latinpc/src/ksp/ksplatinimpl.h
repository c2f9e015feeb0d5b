/*
   KSP latin (ksp/ksplatin.c), the matrix that it solves with (ksp/matrix.c), the iteration as an operator (ksp/interfaceoperator.c).
*/
#ifndef KSPLATINIMPL_H
#define KSPLATINIMPL_H

#include "core/latinimpl.h"
#include <petsc/private/kspimpl.h>

typedef struct {
  Latin            latin;
  LatinStructure   structure; /* given by LatinStructureAttachKSP(), or NULL */
  KSP              outer;     /* solves for the interface data */
  Mat              A;         /* its operator */
  Vec              b, y;      /* its right-hand side, of norm 1, and solution */
  PetscBool        symmetric; /* the outer type needs the symmetric form */
  PetscReal        scale;     /* what b has been divided by: the interface residual of the initial guess */
  PetscReal        rhs_norm;  /* what a relative tolerance refers to, 0: to the first residual */
  Vec              guess;     /* initial guess, NULL for zero */
  Vec              load;      /* the right-hand side, or the residual of the guess */
  Vec              work[2];   /* of displacements and forces */
  PetscBool        iterating;
  PetscInt         logged; /* iterations that monitors have seen */
  PetscObjectId    matrix;
  PetscObjectState matrix_state; /* what the operators were built for */
} KSP_Latin;

PETSC_INTERN PetscErrorCode KSPLatinSetCoordinates_Private(PC, PetscInt dim, PetscInt nodes, PetscReal x[]);
PETSC_INTERN PetscErrorCode KSPLatinSetMatrix_Private(KSP, Mat);
PETSC_INTERN PetscErrorCode KSPLatinCheckMatrix_Private(KSP, Mat);

/* y in variables whose norm is the energy norm */
PETSC_INTERN PetscErrorCode LatinReflectionApply_Private(LatinLinear *, PetscBool loaded, const PetscReal y[], PetscBool symmetric, PetscReal out[]);
PETSC_INTERN PetscErrorCode LatinReflectionSolution_Private(LatinLinear *, const PetscReal y[], Vec u);

#endif
