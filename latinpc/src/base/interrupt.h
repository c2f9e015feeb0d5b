/* Interruption of long solves (base/interrupt.c) */
#ifndef LATININTERRUPT_H
#define LATININTERRUPT_H

#include <petscsys.h>

PETSC_INTERN PetscErrorCode LatinInterrupt_Private(void);

#endif
