#ifndef LATIN_FAILEDSTEP_H
#define LATIN_FAILEDSTEP_H

#include "snes/sneslatinimpl.h"
#include <petsc/private/tsimpl.h>

/* Raises the error of a step that its SNES has not solved. Collective on ts */
PETSC_INTERN PetscErrorCode TSLatinFailed_Private(TS, LatinStructure step, SNES);

#endif
