/*
   The local matrix of a MATIS, from which the rows of the operators of its subdomains come (subdomains/matis.c, subdomains/matisvalues.c).
*/
#ifndef LATINLOCALMATRIX_H
#define LATINLOCALMATRIX_H

#include "subdomains/latinsubdomains.h"

#define LATIN_MATRIX_ASYMMETRY LatinByPrecision(1e-8, 1e-4) /* of two entries, relative to the largest ones of their rows */

enum { LATIN_ROW_ALONE = -2 }; /* not a copy: a local row that is coupled to nothing */

/* The local matrix, by rows, and where its rows are in the global numbering */
typedef struct {
  Mat                    K;
  ISLocalToGlobalMapping map;
  PetscInt               rows;
  const PetscInt        *i, *j, *global;
  const PetscScalar     *a;
  PetscBool              mirrored;       /* a dense matrix whose entries are those across the diagonal, to the bit */
  PetscInt              *first, *column; /* its rows */
} LatinLocalMatrix;

PETSC_INTERN PetscErrorCode LatinLocalMatrixGet_Private(Mat, LatinLocalMatrix *);
PETSC_INTERN PetscErrorCode LatinLocalMatrixRestore_Private(LatinLocalMatrix *);
PETSC_INTERN PetscErrorCode LatinLocalMatrixAcross_Private(const LatinLocalMatrix *, PetscInt row, PetscInt k, PetscReal *);
PETSC_INTERN PetscErrorCode LatinLocalMatrixSymmetric_Private(Mat, const LatinLocalMatrix *, const PetscBool alone[]);
PETSC_INTERN PetscErrorCode LatinMatrixParts_Private(LatinSubdomains *, const LatinLocalMatrix *, const PetscBool kept[], PetscInt part[]);
PETSC_INTERN PetscErrorCode LatinMatrixMirror_Private(LatinSubdomains *);
PETSC_INTERN PetscErrorCode LatinMatrixHold_Private(LatinSubdomains *);

#endif
