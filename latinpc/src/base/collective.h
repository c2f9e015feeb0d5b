/*
   Collective errors, and communication by PetscSF.
*/
#ifndef LATINCOLLECTIVE_H
#define LATINCOLLECTIVE_H

#include <petscsf.h>

PETSC_INTERN PetscErrorCode LatinAgree_Private(MPI_Comm, PetscErrorCode mine, const char message[]);
PETSC_INTERN PetscErrorCode LatinAgreeError_Private(MPI_Comm, PetscErrorCode mine);
PETSC_INTERN PetscErrorCode LatinCheckChoice_Private(PetscObject, const char *const names[], int choice);
#define LATIN_SAME_MOST 8 /* most settings of a check */
PETSC_INTERN PetscErrorCode LatinSame_Private(MPI_Comm, PetscInt n, const PetscReal value[], const char prefix[], const char *const name[]);
PETSC_INTERN PetscErrorCode LatinSFBcast_Private(PetscSF, PetscInt n, MPI_Datatype, const void *root, void *leaf);
PETSC_INTERN PetscErrorCode LatinSFReduce_Private(PetscSF, PetscInt n, MPI_Datatype, const void *leaf, void *root, MPI_Op);
PETSC_INTERN PetscErrorCode LatinSFFetch_Private(MPI_Comm, PetscInt roots, PetscInt leaves, const PetscInt number[], PetscSF *);
PETSC_INTERN PetscErrorCode LatinSFFresh_Private(PetscSF *);

PETSC_INTERN void LatinWatchApart_Private(PetscInt by); /* base/rankfailure.c */

/* If `bad` holds on any rank of comm, raises the error and the message of the lowest such rank on all. Collective on comm */
#define LatinAgree(comm, bad, code, ...) \
  do { \
    char latin_message_[512] = ""; \
    if (bad) PetscCall(PetscSNPrintf(latin_message_, sizeof(latin_message_), __VA_ARGS__)); \
    PetscCall(LatinAgree_Private(comm, (bad) ? code : (PetscErrorCode)0, latin_message_)); \
  } while (0)

/* Makes a call that is not collective; raises the error of the lowest rank with one on all, with its message. Collective on comm */
#define LatinEach(comm, ...) PetscCall((LatinWatchApart_Private(1), LatinAgreeError_Private(comm, __VA_ARGS__)))

#endif
