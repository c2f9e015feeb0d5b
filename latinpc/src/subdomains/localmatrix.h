/*
   The local matrix of a MATIS, source of the operators of its subdomains (subdomains/matis.c, subdomains/matisvalues.c).
*/
#ifndef LATINLOCALMATRIX_H
#define LATINLOCALMATRIX_H

#include "subdomains/latinsubdomains.h"

/* largest difference of two transposed entries, relative to the largest entry of their rows; assembly in another order leaves 1e-15 */
#define LATIN_MATRIX_ASYMMETRY LatinByPrecision(1e-8, 1e-4)

enum { LATIN_ROW_ISOLATED = -2 }; /* in place of a copy: the unknown of a local row is isolated, coupled to no other */

/* The local matrix by compressed rows, and the global numbers of its rows */
typedef struct {
  Mat                    K;
  ISLocalToGlobalMapping map;
  PetscInt               rows;
  const PetscInt        *i, *j, *global;
  const PetscScalar     *a;
  PetscBool              mirrored;       /* whether it is dense and symmetric to the bit */
  PetscInt              *first, *column; /* of a mirrored matrix: i and j */
} LatinLocalMatrix;

PETSC_INTERN PetscErrorCode LatinLocalMatrixGet_Private(Mat, LatinLocalMatrix *);
PETSC_INTERN PetscErrorCode LatinLocalMatrixRestore_Private(LatinLocalMatrix *);
PETSC_INTERN PetscErrorCode LatinLocalMatrixAcross_Private(const LatinLocalMatrix *, PetscInt row, PetscInt k, PetscReal *);
PETSC_INTERN PetscErrorCode LatinLocalMatrixSymmetric_Private(Mat, const LatinLocalMatrix *, const PetscInt row_copy[]);
PETSC_INTERN PetscErrorCode LatinMatrixParts_Private(LatinSubdomains *, const LatinLocalMatrix *, const PetscBool kept[], PetscInt part[]);
PETSC_INTERN PetscErrorCode LatinMatrixIsolated_Private(LatinSubdomains *, const LatinLocalMatrix *);
PETSC_INTERN PetscErrorCode LatinMatrixMirror_Private(LatinSubdomains *);
PETSC_INTERN PetscErrorCode LatinMatrixHold_Private(LatinSubdomains *);

#endif
