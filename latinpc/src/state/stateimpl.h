/*
   States of solvers: what a state is made of (state/state.c), its file (state/statefile.c), and how that replaces an older
   one (state/newfile.c).
*/
#ifndef LATINSTATEIMPL_H
#define LATINSTATEIMPL_H

#include "snes/sneslatinimpl.h"
#include <stdio.h>
#include <sys/stat.h>

/* What all ranks have in common, in the order of LatinStateNames; integers are exact up to 2^53 */
typedef struct {
  double format, integer_bytes, real_bytes, ranks, motion, structure, note_bytes;
  double time, time_step, shift; /* 1 / h^2 of a motion */
  double tuning;                 /* of the search parameters of rigid links */
  double steps, started, solutions;
  double hdf5, sum; /* of the file: 1 unless it is PETSc's binary format; of its bytes */
} LatinStateHead;

/* What each rank has, the same items on all of them */
#define LATIN_STATE_ITEMS 24 /* items of a state; an assertion counts them */
#define LATIN_STATE_KIND  2
typedef struct {
  SNES           snes; /* of a motion: that of its steps */
  TS             ts;   /* NULL in statics */
  Vec            u;    /* displacements */
  LatinStructure structure;
  PetscBool      latin;                  /* the SNES is of type latin */
  PetscReal      kind[LATIN_STATE_KIND]; /* where links turn, in statics: how operators have been made; is there a last path? */
  PetscInt       items, reals;           /* those behind the reals are written as integers, and not read */
  struct {
    const char *name;
    Vec         v;
  } item[LATIN_STATE_ITEMS];
} LatinState;

/* 53 bits, as many as a number of the head holds, with what else they depend on */
static inline uint64_t LatinStateHash(uint64_t before, size_t n, const void *data)
{
  uint64_t both[2] = {before, data ? LatinHash(n, data) : 0};

  return LatinHash(sizeof(both), both) >> 11;
}

/* ---- a file that replaces another one (state/newfile.c) ---- */
typedef struct {
  char   target[PETSC_MAX_PATH_LEN];    /* the name that it takes */
  char   temporary[PETSC_MAX_PATH_LEN]; /* the name that it has until then */
  mode_t mode;                          /* of the older one, 0: there is none */
  FILE  *stream;
} LatinFile;

PETSC_INTERN const char    *LatinFileRefused(const char file[], mode_t *);
PETSC_INTERN PetscErrorCode LatinFileBegin_Private(const char file[], LatinFile *);
PETSC_INTERN PetscErrorCode LatinFileEnd_Private(LatinFile *, PetscBool written);

/* ---- the file of a state (state/statefile.c) ---- */
PETSC_INTERN PetscErrorCode LatinStateTransfer_Private(MPI_Comm, const char file[], LatinFile *, const LatinStateHead *, LatinState *);
PETSC_INTERN PetscErrorCode LatinStateWrite_Private(MPI_Comm, const char file[], LatinStateHead *, LatinState *, const char note[]);
PETSC_INTERN PetscErrorCode LatinStateReadHead_Private(MPI_Comm, const char file[], LatinStateHead *, char **note);

#endif
