/* Nested dissection of nodes whose places are known (localsolvers/dissection.c) */
#ifndef LATINDISSECTION_H
#define LATINDISSECTION_H

#include "localsolvers/latinlocalsolvers.h"
#include <metis.h>

PETSC_INTERN PetscErrorCode LatinDissect_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t position[], PetscBool *done);

#endif
