/*
   Errors of one rank in a collective call end the program.
*/
#ifndef LATINRANKFAILURE_H
#define LATINRANKFAILURE_H

#include <petscsys.h>

PETSC_INTERN PetscErrorCode LatinWatchCreate_Private(MPI_Comm);
PETSC_INTERN PetscErrorCode LatinWatchFinalize_Private(void);
PETSC_INTERN PetscErrorCode LatinWatchWait_Private(MPI_Comm, PetscErrorCode);
PETSC_INTERN void           LatinWatchBegin_Private(void);
PETSC_INTERN PetscErrorCode LatinWatchEnd_Private(MPI_Comm, PetscErrorCode);

/* Runs a collective call; an error that has not struck every rank of comm ends the program */
#define LatinWatch(comm, ...) \
  do { \
    PetscErrorCode latin_ierr_; \
    LatinWatchBegin_Private(); \
    latin_ierr_ = __VA_ARGS__; \
    latin_ierr_ = LatinWatchEnd_Private(comm, latin_ierr_); \
    PetscCall(latin_ierr_); \
  } while (0)

#endif
