/*
   Small vectors; dense matrices, column-major, and their factorisations.
*/
#ifndef LATINDENSE_H
#define LATINDENSE_H

#include <petscsys.h>
#include <petscblaslapack.h>

/* y = alpha A x + beta y, A symmetric, of which one triangle is read. PETSc does not declare it */
#define LatinBLASsymv_ PETSCBLAS(symv, SYMV)
BLAS_EXTERN void LatinBLASsymv_(const char *, const PetscBLASInt *, const PetscScalar *, const PetscScalar *, const PetscBLASInt *, const PetscScalar *, const PetscBLASInt *, const PetscScalar *, PetscScalar *, const PetscBLASInt *);

/* Packed lower triangle of n rows: columns one after the other, each from its diagonal on. Entry (r, c) is at LatinLowerAt(n, c) + r */
static inline size_t LatinLowerAt(PetscInt n, PetscInt c)
{
  return (size_t)c * (size_t)n - (size_t)c * (size_t)(c + 1) / 2;
}

PETSC_INTERN void           LatinLowerMirror(PetscInt n, PetscReal A[]);
PETSC_INTERN PetscBool      LatinUnitVector(PetscInt dim, const PetscReal v[], PetscReal unit[]);
PETSC_INTERN PetscErrorCode LatinSVD_Private(PetscInt rows, PetscInt modes, const PetscScalar A[], PetscReal s[], PetscScalar V[]);
PETSC_INTERN void           LatinCombine_Private(PetscInt rows, PetscInt modes, PetscInt n, const PetscScalar A[], const PetscScalar V[], const PetscReal scale[], PetscScalar out[]);
PETSC_INTERN PetscBool      LatinCholesky(PetscInt n, PetscReal A[]);
PETSC_INTERN PetscErrorCode LatinSchur_Private(PetscInt n, PetscInt inside, PetscReal A[], PetscBool *bad);
PETSC_INTERN PetscErrorCode LatinSPDInverse_Private(PetscInt n, PetscReal A[], PetscBool *bad);

#endif
