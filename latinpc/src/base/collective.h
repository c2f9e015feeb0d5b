/*
   Errors and communication that every rank reaches.
*/
#ifndef LATINCOLLECTIVE_H
#define LATINCOLLECTIVE_H

#include <petscsf.h>

PETSC_INTERN PetscErrorCode LatinAgree_Private(MPI_Comm, PetscErrorCode mine, const char message[]);
PETSC_INTERN PetscErrorCode LatinAgreeError_Private(MPI_Comm, PetscErrorCode mine);
PETSC_INTERN PetscErrorCode LatinSFBcast_Private(PetscSF, PetscInt n, MPI_Datatype, const void *root, void *leaf);
PETSC_INTERN PetscErrorCode LatinSFReduce_Private(PetscSF, PetscInt n, MPI_Datatype, const void *leaf, void *root, MPI_Op);
PETSC_INTERN PetscErrorCode LatinSFFresh_Private(PetscSF *);

PETSC_INTERN void LatinWatchApart_Private(PetscInt by); /* base/rankfailure.c */

/* Ends in the same error on every rank of comm when `bad` holds on any of them, with the message of the lowest such rank */
#define LatinAgree(comm, bad, code, ...) \
  do { \
    char latin_message_[512] = ""; \
    if (bad) PetscCall(PetscSNPrintf(latin_message_, sizeof(latin_message_), __VA_ARGS__)); \
    PetscCall(LatinAgree_Private(comm, (bad) ? code : (PetscErrorCode)0, latin_message_)); \
  } while (0)

/* Runs what each rank does by itself; an error of any rank becomes one of all, with its message. Collective on comm */
#define LatinEach(comm, ...) PetscCall((LatinWatchApart_Private(1), LatinAgreeError_Private(comm, __VA_ARGS__)))

#endif
