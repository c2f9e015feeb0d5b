/*
   Errors on one rank alone in a collective call: they end the program, instead of a deadlock (base/rankfailure.c).
*/
#ifndef LATINRANKFAILURE_H
#define LATINRANKFAILURE_H

#include <petscsys.h>

PETSC_INTERN PetscErrorCode LatinWatchCreate_Private(MPI_Comm);
PETSC_INTERN PetscErrorCode LatinWatchFinalize_Private(void);
PETSC_INTERN PetscErrorCode LatinWatchWait_Private(MPI_Comm, PetscErrorCode);
PETSC_INTERN void           LatinWatchBegin_Private(MPI_Comm);
PETSC_INTERN PetscErrorCode LatinWatchEnd_Private(MPI_Comm, PetscErrorCode);

/*
   Makes a collective call; an error that is not raised on all ranks of comm ends the program. Ranks synchronise on an error before PETSc's handler prints
   it, as this handler lets all ranks but the first sleep
*/
#define LatinWatch(comm, ...) PetscCall((LatinWatchBegin_Private(comm), LatinWatchEnd_Private(comm, __VA_ARGS__)))

/* Defines method_Watched(), which makes such a call of a method that is collective on its object */
#define LatinWatched(method, Type) \
  static PetscErrorCode method##_Watched(Type object) \
  { \
    PetscFunctionBegin; \
    LatinWatch(PetscObjectComm((PetscObject)object), method(object)); \
    PetscFunctionReturn(0); \
  }

#endif
