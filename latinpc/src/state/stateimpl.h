/*
   Checkpoints of solvers: the items of a state (state/state.c), its file (state/statefile.c), the atomic replacement of an older file (state/newfile.c),
   and the functions of the Fortran module (state/fortran.c).
*/
#ifndef LATINSTATEIMPL_H
#define LATINSTATEIMPL_H

#include "snes/sneslatinimpl.h"
#include <stdio.h>
#include <sys/stat.h>

/* The header of a file, the same on all ranks, in the order of LatinStateNames; integers as doubles are exact up to 2^53 */
typedef struct {
  double format, integer_bytes, real_bytes, ranks, motion, structure, note_bytes;
  double time, time_step, shift;    /* 1 / h^2 of a motion */
  double tuning, rigid_scale;       /* of the search parameters of rigid links */
  double steps, started, solutions; /* solutions: number of last solves whose fixed-point unknowns are stored */
  double hdf5, sum;                 /* 1: HDF5, 0: PETSc's binary format; checksum of the file */
} LatinStateHead;

/* The items of a state: distributed vectors, the same ones on all ranks */
#define LATIN_STATE_ITEMS 24 /* most items of a state */
#define LATIN_STATE_KIND  3  /* entries of kind */
typedef struct {
  SNES           snes; /* of a motion: the SNES of its TS */
  TS             ts;   /* NULL in statics */
  Vec            u;    /* displacements */
  LatinStructure structure;
  PetscBool      latin;                  /* the SNES is of type latin */
  PetscReal      kind[LATIN_STATE_KIND]; /* large rotations in statics: LatinFrameType; 1: there is a last path; hash of e0 here */
  PetscInt       items, reals;           /* number of items; those after the first `reals` are written as integers, not read */
  struct {
    const char *name;
    Vec         v;
  } item[LATIN_STATE_ITEMS];
} LatinState;

/* Returns the hash, of 53 bits and so exact in a double, of n bytes (data NULL: none) and the hash `before` */
static inline uint64_t LatinStateHash(uint64_t before, size_t n, const void *data)
{
  uint64_t both[2] = {before, data ? LatinHash(n, data) : 0};

  return LatinHash(sizeof(both), both) >> 11;
}

/* ---- atomic replacement of a file (state/newfile.c) ---- */
typedef struct {
  char   target[PETSC_MAX_PATH_LEN];    /* final name */
  char   temporary[PETSC_MAX_PATH_LEN]; /* name until then */
  mode_t mode;                          /* mode of the older file, 0: none */
  FILE  *stream;                        /* the open temporary file, NULL: none */
} LatinFile;

PETSC_INTERN const char    *LatinFileRefused(const char file[], mode_t *);
PETSC_INTERN PetscErrorCode LatinFileBegin_Private(const char file[], LatinFile *);
PETSC_INTERN PetscErrorCode LatinFileEnd_Private(LatinFile *, PetscBool written);

/* ---- the file of a state (state/statefile.c) ---- */
PETSC_INTERN PetscErrorCode LatinStateTransfer_Private(MPI_Comm, const char file[], LatinFile *, const LatinStateHead *, LatinState *);
PETSC_INTERN PetscErrorCode LatinStateWrite_Private(MPI_Comm, const char file[], LatinStateHead *, LatinState *, const char note[]);
PETSC_INTERN PetscErrorCode LatinStateReadHead_Private(MPI_Comm, const char file[], LatinStateHead *, char **note);

#endif
