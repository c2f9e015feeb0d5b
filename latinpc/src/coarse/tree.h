/* Cholesky factorisation of a matrix of which each rank has a part, by fronts of ranks that join in pairs. */
#ifndef LATINTREE_H
#define LATINTREE_H

#include "coarse/latincoarse.h"
#include "localsolvers/fronts.h"

#define LATIN_TREE_STAGES 50 /* linear stages, of one solve each, for a factorisation, in the predicted time; grids take 22 to 50 */

/* Cost of a factor. An operation is an addition and a multiplication */
typedef struct {
  PetscReal operations, entries;           /* operations and entries of the factor, of all ranks, without rows that one rank alone has */
  PetscReal path_operations, path_entries; /* the same along the longest path of joints, which come one after the other */
  PetscReal path_messages;                 /* messages along the longest path in half a solve */
  PetscReal most, messages;                /* rows of the largest front; most messages that a rank sends in a solve */
  /* predicted time of the set-up and LATIN_TREE_STAGES solves: by the tree; by a factorisation that all ranks share */
  PetscReal seconds, shared;
} LatinTreeCost;

/* Joint: front of two groups of ranks */
typedef struct {
  /* ranks with the contribution blocks of the two groups; rank that takes the contribution block of this joint, -1: none */
  PetscMPIInt from[2], to;
  PetscInt    level; /* level of the graph in which the two groups are paired, from 1; joints above have higher levels */
  /* number of unknowns of each group, in the order in which this joint and those above eliminate them */
  PetscInt     n[2];
  PetscInt    *at;              /* [n[0] + n[1]] rows of these unknowns in the front, which ascend in each group */
  PetscInt     rows, interior;  /* number of rows of the front; of interior ones, first, which no rank outside the two groups has */
  PetscInt    *order, first[2]; /* [rows] identity, and range of all rows: lists of the front for LatinFrontsCreate() */
  LatinFronts  front;           /* L of the interior rows, Z of the others below */
  PetscScalar *x;               /* [rows] work */
} LatinJoint;

typedef struct {
  MPI_Comm    comm; /* communicator of this factor alone */
  PetscMPIInt rank;
  PetscInt    n;     /* number of rows of the part of this rank */
  PetscInt   *owned; /* [n] positions of the rows in this rank's share of a vector; -1: owned by another rank */
  /* number of shared rows, which other ranks have too; [rest] these rows, in the order in which joints eliminate them */
  PetscInt      rest, *row;
  Mat           part;  /* factor of the part, with the shared rows last; NULL: all rows are shared */
  PetscMPIInt   to;    /* rank that has the joint of the part, perhaps this one; -1: nothing is shared */
  LatinJoint   *joint; /* joint on this rank; NULL: none */
  PetscScalar  *g, *w; /* work: [n]; [most rows that are sent] */
  LatinTreeCost cost;
} LatinTree;

PETSC_INTERN PetscErrorCode LatinTreePlan_Private(ISLocalToGlobalMapping, PetscLayout, LatinTree *);
PETSC_INTERN PetscErrorCode LatinTreeFactor_Private(LatinTree *, PetscBool rounded, Mat K, PetscBool *bad);
PETSC_INTERN PetscErrorCode LatinTreeSolve_Private(LatinTree *, const PetscScalar b[], PetscScalar x[]);
PETSC_INTERN PetscErrorCode LatinTreeReset_Private(LatinTree *);

#endif
