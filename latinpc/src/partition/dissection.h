/* Geometric nested dissection (partition/dissection.c) */
#ifndef LATINDISSECTION_H
#define LATINDISSECTION_H

#include "base/latinbase.h"
#include <metis.h>

/*
   largest excess of a half over the mean, in thousandths: the rank of the smaller half waits for the other. With the 200 of METIS halves differ by up
   to 9 %, and interfaces are 4 % smaller
*/
#define LATIN_HALVES_BALANCE 10

PETSC_INTERN PetscErrorCode LatinDissect_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t position[], PetscBool *done);
PETSC_INTERN PetscErrorCode LatinDissectHalves_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t half[], PetscBool *done);

#endif
