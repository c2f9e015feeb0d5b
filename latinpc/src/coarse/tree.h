/*
   Cholesky of a matrix of which each rank has a part: fronts of the ranks, joined in pairs.
*/
#ifndef LATINTREE_H
#define LATINTREE_H

#include "coarse/latincoarse.h"
#include "localsolvers/fronts.h"

#define LATIN_TREE_STAGES 50 /* solves for each factorisation, in the prediction: a linear stage has one */

/* What it takes */
typedef struct {
  PetscReal operations, entries;           /* additions and multiplications each, and entries of the factor: of all ranks, but for rows that one rank alone has, */
  PetscReal path_operations, path_entries; /* and of these what comes one after the other, */
  PetscReal path_messages;                 /* with the messages of half a solve */
  PetscReal most, messages;                /* rows of the largest front; messages that a rank sends in a solve, at most */
  PetscReal seconds, shared;               /* predicted, of the set-up and LATIN_TREE_STAGES solves: by the tree, and by a factorisation that all ranks share */
} LatinTreeCost;

/* The front of two groups of ranks that join */
typedef struct {
  PetscMPIInt  from[2], to;     /* ranks that have the contribution blocks of the two groups; the one that takes that of this joint, -1: there is none */
  PetscInt     level;           /* of the graphs in which ranks are paired, from 1 on: those of joints above are higher */
  PetscInt     n[2];            /* unknowns that the two groups bring, in the order in which this joint and those above eliminate them, */
  PetscInt    *at;              /* [n[0] + n[1]] and their rows in the front, which so ascend */
  PetscInt     rows, interior;  /* interior ones, which no further rank has, come first */
  PetscInt    *order, first[2]; /* [rows] of the front: as they are */
  LatinFronts  front;           /* L of the interior rows, Z of the others below it */
  PetscScalar *x;               /* [rows] work */
} LatinJoint;

typedef struct {
  MPI_Comm      comm; /* of this factor alone */
  PetscMPIInt   rank;
  PetscInt      n;          /* rows of the part of this rank */
  PetscInt     *owned;      /* [n] places of rows in this rank's share of a vector; -1: of another rank's */
  PetscInt      rest, *row; /* [rest] those that other ranks have as well, in the order in which joints eliminate them */
  Mat           part;       /* factor of the part, with these rows last; NULL: all rows are such */
  PetscMPIInt   to;         /* the rank that has the joint of the part, perhaps this one; -1: nothing is shared */
  LatinJoint   *joint;      /* NULL: this rank has none */
  PetscScalar  *g, *w;      /* [n] and [most rows that are sent] work */
  LatinTreeCost cost;
} LatinTree;

PETSC_INTERN PetscErrorCode LatinTreePlan_Private(ISLocalToGlobalMapping, PetscLayout, LatinTree *);
PETSC_INTERN PetscErrorCode LatinTreeFactor_Private(LatinTree *, PetscBool rounded, Mat K, PetscBool *bad);
PETSC_INTERN PetscErrorCode LatinTreeSolve_Private(LatinTree *, const PetscScalar b[], PetscScalar x[]);
PETSC_INTERN PetscErrorCode LatinTreeReset_Private(LatinTree *);

#endif
