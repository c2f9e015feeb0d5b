/* Nested dissection of nodes whose places are known (partition/dissection.c) */
#ifndef LATINDISSECTION_H
#define LATINDISSECTION_H

#include "base/latinbase.h"
#include <metis.h>

#define LATIN_HALVES_BALANCE 10 /* thousandths that the larger half may have beyond the mean, for which the other rank waits: with the 200 of METIS halves differ by up to 9 %, with interfaces 4 % smaller */

PETSC_INTERN PetscErrorCode LatinDissect_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t position[], PetscBool *done);
PETSC_INTERN PetscErrorCode LatinDissectHalves_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t half[], PetscBool *done);

#endif
