/*
   The coarse problem (30), (52): numbers of its unknowns, condensation of repeated groups, matrix, solver, what it carries for other solvers.
*/
#ifndef LATINCOARSE_H
#define LATINCOARSE_H

#include "interfaces/latininterfaces.h"

/* ---- condensation of repeated groups of subdomains (coarse/groups.c) ---- */
#define LATIN_GROUP_LEVELS 8 /* 3^8 subdomains a side */

/* Subdomains, or groups of them, seen from the coarse problem; equal ones share an operator */
typedef struct {
  PetscInt   n, patterns; /* how many, and how many different */
  PetscInt  *offset;      /* [n + 1] coarse dofs of each element */
  PetscInt  *dof;         /* [offset[n]] their numbers on this rank */
  PetscInt  *pattern;     /* [n] the first element equal to each */
  size_t    *h_offset;    /* [n] into H */
  PetscReal *H;           /* operators, column-major, one for each pattern */
  uint64_t  *place;       /* [n] cells of a grid as fine as they are, see coarse/groups.c */
  PetscReal *whole;       /* [offset[n]] stiffness of each dof before anything was condensed; for the set-up alone */
  PetscReal *q, *u;       /* [offset[n]] forces and displacements, element by element */
} LatinElements;

typedef struct {
  LatinKey key;            /* by which they are sorted */
  PetscInt first, last;    /* members: from, and up to but not with */
  PetscInt interior, rows; /* dofs that are eliminated, all dofs */
  size_t   l_offset;       /* into L */
} LatinGroup;

typedef struct {
  LatinElements fine, coarse; /* what the groups are made of; the groups, equal ones one after the other */
  LatinGroup   *group;        /* [coarse.n] */
  PetscInt     *member;       /* [fine.n] by group */
  PetscInt     *slot;         /* [fine.offset[fine.n]] dof of the group: interior ones, then those of coarse; in the end, its place in x */
  PetscReal    *L;            /* of each pattern, [rows][interior]: L, and Z below it */
  PetscReal    *x;            /* forces on the interior dofs of all groups, and what they become; then coarse.q, which coarse.u takes the place of */
} LatinGroupLevel;

/* ---- coarse problem (coarse/numbering.c, coarse/assembly.c, coarse/nearnullspace.c, coarse/coarse.c) ---- */
typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinMacro      *macro;
  /* kept by LatinCoarseRetire(), for a set-up whose matrix has the same pattern */
  Mat       A;
  KSP       ksp;
  PetscBool chosen, iterative, apart; /* what the options of ksp choose: anything; an iteration; one that takes the part of each rank by itself */
  PetscBool second;                   /* that is a PC latin */
  PetscBool loose;                    /* the tolerance of an iteration is ours */
  Mat       part;                     /* of this rank, where it is all of A or stays by itself; else NULL */
  PetscInt  parts, *number;           /* [parts] the rows of A that this rank has a part of */
  /* numbers */
  PetscLayout     map;                         /* of all coarse dofs */
  const PetscInt *rank_start;                  /* [ranks + 1] its ranges: global number of each rank's first one */
  PetscInt        primal_local, primal_global; /* primal displacements numbered by this rank, after its macro modes; all */
  PetscInt       *offset;                      /* [subdomains + 1] coarse dofs of each subdomain: macro modes, then primal dofs */
  PetscInt       *macro_count;                 /* [subdomains] how many of them are macro modes */
  PetscInt       *global;                      /* [offset[n]] their global numbers */
  PetscInt        widest;                      /* most coarse dofs of a subdomain here */
  PetscReal      *q, *u;                       /* [offset[n]] condensed forces and coarse displacements of one linear stage, subdomain by subdomain */
  /* matrix and solver */
  Vec               rhs, sol;
  Vec               whole;  /* stiffness of each row of A before anything was condensed; for the set-up alone */
  PetscInt          levels; /* of condensed groups */
  LatinGroupLevel   level[LATIN_GROUP_LEVELS];
  LatinElements     top;                 /* elements of A: subdomains, or groups of them */
  PetscInt          top_local, top_size; /* rows of A: of this rank, all */
  PetscBool         tree;                /* A is in parts, whose fronts the ranks join */
  PetscInt         *top_global;          /* [top.offset[top.n]] rows of A */
  PetscBool         upper;               /* A has its upper triangle alone, which is all that a factorisation takes */
  PetscSF           top_sf;              /* coarse vector -> dofs of the elements here */
  PetscReal        *x;                   /* [top_local][dim] where the unknowns are; not for direct solvers */
  LatinFactorStatus status;              /* of the set-up */
  PetscBool         failed;              /* a solve failed since this was cleared */
  PetscReal         contraction;         /* of a displacement, in energy: what the last solve has left, on purpose */
} LatinCoarse;

/* The homogenised stiffnesses (51) of the subdomains, once for equal ones */
typedef struct {
  PetscInt  *pattern;  /* [subdomains] borrowed: the subdomain that represents it */
  size_t    *h_offset; /* [subdomains] into H */
  PetscReal *H;        /* column-major */
  PetscBool  once;     /* nothing but the coarse matrix needs H, and frees it */
  PetscBool  lower;    /* H is the lower triangle of the only one, see LatinLowerAt(), with room for both */
} LatinHomogenised;

/* Rows of a symmetric matrix, their columns ascending */
typedef struct {
  PetscInt     rows, *i, *j;
  PetscScalar *a;
} LatinCoarsePart;

#define LATIN_COARSE_CONTRACTION 0.1 /* of a displacement, in energy: what an iteration leaves to the next linear stage, or to the conjugate gradients around it */

#define LATIN_REDUNDANT 1500 /* most rows of a parallel matrix that every rank factors by itself */

/* ---- Cholesky of a matrix in parts, by fronts that ranks join in pairs (coarse/tree.h, treeplan.c, treecholesky.c, treefactor.c) ---- */
#define LATIN_TREE       "latintree"      /* a MatSolverType */
#define LATIN_TREE_SPENT "LatinTreeSpent" /* what a MATIS carries the local matrix by that is to be left of it: its factor is provisional, and may be rounded */
PETSC_INTERN PetscErrorCode LatinTreeRegister(void);
PETSC_INTERN PetscErrorCode LatinTreePays(MPI_Comm, PetscInt n, const PetscInt number[], PetscLayout, PetscBool *);

PETSC_INTERN PetscErrorCode LatinCoarseNumber(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinCoarseSetUp(LatinCoarse *, LatinHomogenised *);
PETSC_INTERN PetscErrorCode LatinCoarseRelease(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinCoarseRenew(LatinCoarse *, LatinHomogenised *);
PETSC_INTERN PetscErrorCode LatinCoarseSolve(LatinCoarse *, PetscReal left);
PETSC_INTERN PetscErrorCode LatinCoarseExpand_Private(LatinCoarse *, Vec);
PETSC_INTERN PetscErrorCode LatinCoarseReset(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinCoarseRetire(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinRowsSum_Private(PetscLayout, const PetscInt number[], LatinCoarsePart *, PetscBool upper, Mat *);
PETSC_INTERN PetscErrorCode LatinCoarsePartFree_Private(LatinCoarsePart *);
PETSC_INTERN PetscErrorCode LatinCoarseAssemble_Private(LatinCoarse *, LatinHomogenised *, PetscBool *same);
PETSC_INTERN PetscErrorCode LatinCoarseNear_Private(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinGroupsSetUp(LatinCoarse *, const LatinHomogenised *, PetscBool groups);
PETSC_INTERN PetscErrorCode LatinGroupsFinish(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinGroupsReset(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinGroupsPass(LatinCoarse *, PetscBool up);

#endif
