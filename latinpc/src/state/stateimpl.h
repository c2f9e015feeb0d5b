/*
   States of solvers: what a state is made of (state/state.c), its file (state/statefile.c), and HDF5 (state/statehdf5.c).
*/
#ifndef LATINSTATEIMPL_H
#define LATINSTATEIMPL_H

#include "snes/sneslatinimpl.h"

/* What all ranks have in common; members of 64 bits, which the head of a file holds by name */
typedef struct {
  long     format, integer_bytes, real_bytes, ranks, motion;
  uint64_t structure;
  long     numbers, note_bytes;
  double   time, time_step, shift; /* 1 / h^2 of a motion */
  double   tuning;                 /* of the search parameters of rigid links */
  long     steps, started, solutions;
  long     bytes; /* of the file */
  uint64_t sum;   /* of its bytes */
  long     hdf5;  /* not in the head: the other format than PETSc's binary one */
} LatinStateHead;

#define LATIN_STATE_HEAD 512 /* bytes */
typedef struct {
  const char *name;
  enum { LATIN_LINE_INTEGER, LATIN_LINE_REAL, LATIN_LINE_HASH } kind;
  size_t at; /* in LatinStateHead */
} LatinStateLine;
PETSC_INTERN const LatinStateLine LatinStateLines[];

/* The numbers of this rank, counted, gathered or handed out, always in the same order; all ranks have the same parts */
#define LATIN_STATE_PARTS 16
typedef struct {
  const char *name;
  PetscInt    n, width; /* numbers on this rank, numbers in a row */
  PetscBool   integer;  /* they are to be written as what they are; such parts are not read */
} LatinPart;
typedef struct {
  PetscReal *data; /* NULL: count */
  PetscInt   n;
  PetscBool  load;
  PetscInt   parts;
  LatinPart  part[LATIN_STATE_PARTS];
} LatinPack;

/* A format, of one rank: its viewer for the parts, the caller's note, and the end, where the file is NULL after an error or a load */
typedef struct {
  PetscErrorCode (*open)(const char file[], const LatinStateHead *, PetscBool load, PetscViewer *);
  PetscErrorCode (*note)(PetscViewer, PetscBool load, PetscInt n, char note[]);
  PetscErrorCode (*close)(PetscViewer *, const char file[]);
} LatinStateFormat;
PETSC_INTERN const LatinStateFormat *const LatinStateHDF5; /* NULL: a PETSc without HDF5 */

/* Adds what a state depends on */
static inline void LatinStateHash(uint64_t *hash, size_t n, const void *data)
{
  uint64_t both[2] = {*hash, data ? LatinHash(n, data) : 0};

  *hash = LatinHash(sizeof(both), both);
}

PETSC_INTERN PetscErrorCode LatinStateFormat_Private(MPI_Comm, const char file[], LatinStateHead *);
PETSC_INTERN PetscErrorCode LatinStateWrite_Private(MPI_Comm, const char file[], LatinStateHead *, LatinPack *state, LatinPack *show, char note[]);
PETSC_INTERN PetscErrorCode LatinStateReadHead_Private(MPI_Comm, const char file[], LatinStateHead *);
PETSC_INTERN PetscErrorCode LatinStateRead_Private(MPI_Comm, const char file[], LatinStateHead *, LatinPack *, char note[]);

#endif
