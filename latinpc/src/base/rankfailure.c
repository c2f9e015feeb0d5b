#include "rankfailure.h"
#include <stdlib.h>

/*
   Errors on one rank alone. LatinAgree() (base/collective.c) makes foreseen errors collective. Others, such as lack of memory inside a library, may be
   raised on one rank alone, while the others wait in a collective call that cannot be cancelled. So a rank that leaves a solver with an error waits in a
   barrier for the others; after LATIN_WATCH_SECONDS it ends the program.

   PETSc's error handler prints on the first rank and lets the others sleep, so that they would not reach the barrier. So ranks enter the barrier before
   this handler, when an error is raised; not inside LatinEach(), where a single rank may raise an error.
*/

#define LATIN_WATCH_SECONDS 10.0 /* time, s, that a rank with an error waits for the others */

static PetscMPIInt    key     = MPI_KEYVAL_INVALID; /* attribute of a communicator: its duplicate, for the barrier alone */
static PetscInt       depth   = 0;                  /* nesting of watched calls: the outermost one installs the handler, and waits */
static PetscInt       apart   = 0;                  /* nesting of LatinEach() */
static PetscBool      handles = PETSC_FALSE;        /* whether the handler is installed */
static PetscErrorCode lacks;                        /* error of its installation */
static PetscBool      met     = PETSC_FALSE;        /* whether the barrier of this error has been passed */
static MPI_Comm       meeting = MPI_COMM_NULL;      /* communicator of the outermost call */

/* Frees the duplicate of a communicator that is freed */
static int MPIAPI LatinWatchDelete_Private(MPI_Comm comm, PetscMPIInt keyval, void *value, void *context)
{
  MPI_Comm *watch = (MPI_Comm *)value;
  int       ierr  = MPI_Comm_free(watch);

  free(watch);
  return ierr;
}

/* Attaches a duplicate to comm, unless it has one or a single rank. Collective on comm */
PetscErrorCode LatinWatchCreate_Private(MPI_Comm comm)
{
  MPI_Comm   *watch;
  PetscMPIInt size;
  int         there;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size == 1) PetscFunctionReturn(0);
  if (key == MPI_KEYVAL_INVALID) PetscCallMPI(MPI_Comm_create_keyval(MPI_COMM_NULL_COPY_FN, LatinWatchDelete_Private, &key, NULL));
  PetscCallMPI(MPI_Comm_get_attr(comm, key, &watch, &there));
  if (there) PetscFunctionReturn(0);
  watch = (MPI_Comm *)malloc(sizeof(*watch)); /* not PetscMalloc1(): it may live longer than PETSc */
  PetscCheck(watch, PETSC_COMM_SELF, PETSC_ERR_MEM, "No memory for a communicator");
  PetscCallMPI(MPI_Comm_dup(comm, watch));
  PetscCallMPI(MPI_Comm_set_attr(comm, key, watch));
  PetscFunctionReturn(0);
}

/* Frees the key; MPI deletes it after the last communicator that has it */
PetscErrorCode LatinWatchFinalize_Private(void)
{
  PetscFunctionBegin;
  if (key != MPI_KEYVAL_INVALID) PetscCallMPI(MPI_Comm_free_keyval(&key));
  PetscFunctionReturn(0);
}

/* Waits for the other ranks of comm if there is an error; returns it if all have one. Ends the program if they do not come within LATIN_WATCH_SECONDS */
PetscErrorCode LatinWatchWait_Private(MPI_Comm comm, PetscErrorCode ierr)
{
  MPI_Comm   *watch;
  MPI_Request request;
  int         there = 0, done = 0;
  char       *message = NULL;
  const char *meaning = NULL;
  double      start;

  if (!ierr || met || key == MPI_KEYVAL_INVALID) return ierr;
  if (MPI_Comm_get_attr(comm, key, &watch, &there) || !there) return ierr;
  if (MPI_Ibarrier(*watch, &request)) return ierr;
  start = MPI_Wtime();
  while (MPI_Wtime() < start + LATIN_WATCH_SECONDS) {
    if (MPI_Test(&request, &done, MPI_STATUS_IGNORE) || done) return ierr;
    (void)PetscSleep(0.001);
  }
  (void)PetscErrorMessage(ierr, &meaning, (void *)&message); /* a char *, const in some versions of PETSc */
  (void)PetscFPrintf(PETSC_COMM_SELF, PETSC_STDERR, "latin: error on one rank while the others wait in a collective call: the program ends. The error: %s%s%s\n",
                     meaning ? meaning : "none of PETSc, such as an exception in a Python function that only this rank has raised", message ? ": " : "", message ? message : "");
  MPI_Abort(comm, (int)ierr);
  return ierr;
}

/* Begins (by 1) or ends (by -1) a call in which a single rank may raise an error */
void LatinWatchApart_Private(PetscInt by)
{
  apart += by;
}

/* The error handler: waits for the other ranks, then calls the handler below it */
static PetscErrorCode LatinWatchHandler_Private(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode ierr, PetscErrorType type, const char *message, void *ctx)
{
  PetscErrorCode same = ierr;

  PetscFunctionBegin; /* PetscError() pops a function from PETSc's stack, and runs twice for this error: the second time it pops this one */
  (void)ctx;
  if (type == PETSC_ERROR_INITIAL && !met && !apart) {
    (void)LatinWatchWait_Private(meeting, ierr);
    met = PETSC_TRUE;
  }
  (void)PetscPopErrorHandler();
  same = PetscError(comm, line, function, file, ierr, type, "%s", message ? message : "");
  (void)PetscPushErrorHandler(LatinWatchHandler_Private, NULL);
  return same;
}

/* Begins a watched call on comm */
void LatinWatchBegin_Private(MPI_Comm comm)
{
  if (depth++) return;
  met     = PETSC_FALSE;
  meeting = comm;
  lacks   = (PetscErrorCode)0;
  if (key == MPI_KEYVAL_INVALID) return;                            /* no communicator of several ranks yet */
  lacks   = PetscPushErrorHandler(LatinWatchHandler_Private, NULL); /* allocates memory: may fail on one rank */
  handles = (PetscBool)!lacks;
}

/* Ends a watched call on comm that has returned ierr; returns the error of the call */
PetscErrorCode LatinWatchEnd_Private(MPI_Comm comm, PetscErrorCode ierr)
{
  if (--depth) return ierr;
  if (handles) (void)PetscPopErrorHandler();
  handles = PETSC_FALSE;
  return LatinWatchWait_Private(comm, ierr ? ierr : lacks);
}
