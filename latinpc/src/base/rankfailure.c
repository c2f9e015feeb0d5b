#include "rankfailure.h"
#include <stdlib.h>

/*
   Errors that a rank can foresee are agreed on (base/collective.c). Others, such as memory that runs out inside a library,
   strike one rank alone and leave the others waiting in a collective call, which nothing can call back. So a rank that
   leaves a solver with an error waits for the others to do so; when they do not come it ends the program.

   PETSc's own handler prints an error on the first rank and lets the others sleep where they are, so that they would not come.
   So ranks wait for each other before it: a rank that raises an error in a method of a solver, which is not one that each rank
   raises by itself to be agreed on (LatinEach()).
*/

#define LATIN_WATCH_SECONDS 10.0 /* seconds that a rank with an error waits for the others */

static PetscMPIInt key      = MPI_KEYVAL_INVALID; /* a communicator's duplicate, on which nothing else happens */
static PetscInt    depth    = 0;                  /* of watched calls within watched calls: the outermost one waits */
static PetscInt    handlers = 0;                  /* of methods within methods: the outermost one has a handler */
static PetscInt    apart    = 0;                  /* of calls that each rank makes by itself */
static PetscBool   met      = PETSC_FALSE;        /* all ranks have raised the error */
static MPI_Comm    meeting  = MPI_COMM_NULL;      /* of the outermost method */

static int MPIAPI LatinWatchDelete_Private(MPI_Comm comm, PetscMPIInt keyval, void *value, void *context)
{
  MPI_Comm *watch = (MPI_Comm *)value;
  int       ierr  = MPI_Comm_free(watch);

  free(watch);
  return ierr;
}

/* Called where comm is used for the first time. Collective on comm */
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
  watch = (MPI_Comm *)malloc(sizeof(*watch)); /* outlives what PETSc counts */
  PetscCheck(watch, PETSC_COMM_SELF, PETSC_ERR_MEM, "No memory for a communicator");
  PetscCallMPI(MPI_Comm_dup(comm, watch));
  PetscCallMPI(MPI_Comm_set_attr(comm, key, watch));
  PetscFunctionReturn(0);
}

/* The key goes once the last communicator that it is on does */
PetscErrorCode LatinWatchFinalize_Private(void)
{
  PetscFunctionBegin;
  if (key != MPI_KEYVAL_INVALID) PetscCallMPI(MPI_Comm_free_keyval(&key));
  PetscFunctionReturn(0);
}

/* Returns the error, none or one that has struck all ranks of comm; another ends the program */
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
  (void)PetscErrorMessage(ierr, &meaning, (void *)&message); /* char *, const or not, by version */
  (void)PetscFPrintf(PETSC_COMM_SELF, PETSC_STDERR, "latin: an error of one rank, and the others wait for it: the program ends. The error: %s: %s\n", meaning ? meaning : "unknown", message ? message : "");
  MPI_Abort(comm, (int)ierr);
  return ierr;
}

void LatinWatchBegin_Private(void)
{
  if (!depth++) met = PETSC_FALSE;
}

void LatinWatchApart_Private(PetscInt by)
{
  apart += by;
}

/* Waits where an error is raised, and hands it on */
static PetscErrorCode LatinWatchHandler_Private(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode ierr, PetscErrorType type, const char *message, void *ctx)
{
  PetscErrorCode same = ierr;

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

/* The handler of a method that is collective on comm, there or gone */
PetscErrorCode LatinWatchMeet_Private(MPI_Comm comm, PetscBool begins)
{
  PetscFunctionBegin;
  if (begins && !handlers++) {
    const PetscErrorCode ierr = PetscPushErrorHandler(LatinWatchHandler_Private, NULL); /* which takes memory */

    meeting = comm;
    if (ierr) handlers--;
    PetscCall(LatinWatchWait_Private(comm, ierr));
  } else if (!begins && !--handlers) PetscCall(PetscPopErrorHandler());
  PetscFunctionReturn(0);
}

PetscErrorCode LatinWatchEnd_Private(MPI_Comm comm, PetscErrorCode ierr)
{
  return --depth ? ierr : LatinWatchWait_Private(comm, ierr);
}
