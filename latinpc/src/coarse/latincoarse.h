/*
   The coarse problem (30), (52): numbering, condensation of repeated groups, matrix, near null space, solver.
*/
#ifndef LATINCOARSE_H
#define LATINCOARSE_H

#include "interfaces/latininterfaces.h"

/* ---- condensation of repeated groups of subdomains (coarse/groups.c) ---- */
#define LATIN_GROUP_LEVELS 8 /* most levels of groups: 3^8 subdomains along each side */

/* Elements of the coarse problem: subdomains or groups of them. Equal ones share an operator */
typedef struct {
  PetscInt   n, patterns; /* number of elements; of different ones */
  PetscInt  *offset;      /* [n + 1] range of the coarse dofs of each element */
  PetscInt  *dof;         /* [offset[n]] local numbers of the coarse dofs */
  PetscInt  *pattern;     /* [n] first element equal to each */
  size_t    *h_offset;    /* [n] position in H */
  PetscReal *H;           /* operators, column-major, one for each different element */
  uint64_t  *place;       /* [n] cell of each element in a grid of their size, see coarse/groups.c */
  /* [offset[n]] stiffness of each dof before condensation, the scale of its rounding; set-up only */
  PetscReal *whole;
  PetscReal *q, *u; /* [offset[n]] forces and displacements, element by element */
} LatinElements;

typedef struct {
  LatinKey key;            /* sort key */
  PetscInt first, last;    /* its members: member[first..last) */
  PetscInt interior, rows; /* number of interior dofs, which are eliminated; of all dofs */
  size_t   l_offset;       /* position in L */
} LatinGroup;

typedef struct {
  LatinElements fine, coarse; /* members; groups, equal ones consecutive */
  LatinGroup   *group;        /* [coarse.n] */
  PetscInt     *member;       /* [fine.n] members, sorted by groups */
  PetscInt     *slot;         /* [fine.offset[fine.n]] number of each dof in its group, interior ones first; after the set-up, its position in x */
  PetscReal    *L;            /* of each different group L and Z below it, column-major, rows x interior */
  PetscReal    *x;            /* work: interior dofs of all groups, then coarse.q and coarse.u, which are one array */
} LatinGroupLevel;

/* ---- coarse problem (coarse/numbering.c, coarse/assembly.c, coarse/nearnullspace.c, coarse/coarse.c) ---- */
typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinMacro      *macro;
  /* kept by LatinCoarseRetire(), for a set-up whose matrix has the same pattern */
  Mat A;
  KSP ksp;
  /* whether options choose a PC or its package; an iterative solver; a solver for a MATIS */
  PetscBool chosen, iterative, unassembled;
  PetscBool second_level;   /* whether the solver is PC latin, a second level */
  PetscBool loose;          /* whether the tolerance of an iterative solver is ours, as no option sets its type or tolerance */
  Mat       part;           /* local matrix of this rank, if A is a MATIS or of one rank; else NULL */
  PetscInt  parts, *number; /* number of rows of the local matrix; [parts] their numbers in A */
  /* numbering */
  PetscLayout     map;                         /* layout of all coarse dofs */
  const PetscInt *rank_start;                  /* [ranks + 1] ranges of map */
  PetscInt        primal_local, primal_global; /* number of primal dofs numbered by this rank, after its macro modes; of all ranks */
  PetscInt       *offset;                      /* [subdomains + 1] range of the coarse dofs of each subdomain: macro modes, then primal dofs */
  PetscInt       *macro_count;                 /* [subdomains] number of macro modes */
  PetscInt       *global;                      /* [offset[n]] global numbers of these dofs */
  PetscInt        widest;                      /* most coarse dofs of a subdomain on this rank */
  PetscReal      *q, *u;                       /* [offset[n]] condensed forces and coarse displacements of a linear stage, subdomain by subdomain */
  /* matrix and solver */
  Vec rhs, sol;
  /* stiffness of each row of A before condensation, the scale of its rounding; set-up only */
  Vec               whole;
  PetscInt          levels; /* number of levels of condensed groups */
  LatinGroupLevel   level[LATIN_GROUP_LEVELS];
  LatinElements     top;                 /* elements of A: subdomains or groups of them */
  PetscInt          top_local, top_size; /* number of rows of A: of this rank, of all */
  PetscBool         tree;                /* whether A is a MATIS for the multifrontal solver of coarse/tree.h */
  PetscInt         *top_global;          /* [top.offset[top.n]] row of A of each dof of the elements */
  PetscBool         upper;               /* whether A stores its upper triangle alone (MATSBAIJ), which serves a factorisation */
  PetscSF           top_sf;              /* coarse vector -> dofs of the elements on this rank */
  PetscReal        *x;                   /* [top_local][dim] coordinates of the rows of A, for iterative solvers */
  LatinFactorStatus status;              /* result of the set-up */
  PetscBool         failed;              /* whether a solve has failed since this was cleared */
  PetscReal         contraction;         /* tolerance of the last solve, in the energy norm; 0: accurate */
} LatinCoarse;

/* Homogenised stiffnesses H (51) of the subdomains, once for equal ones */
typedef struct {
  PetscInt  *pattern;  /* [subdomains] first equal subdomain; borrowed */
  size_t    *h_offset; /* [subdomains] position in H */
  PetscReal *H;        /* column-major */
  PetscBool  once;     /* whether only the coarse matrix needs H: its assembly frees H */
  PetscBool  lower;    /* whether H is the packed lower triangle of a single subdomain, see LatinLowerAt(), in an array with room for all of it */
} LatinHomogenised;

/* Contribution of a rank to the coarse matrix: symmetric, compressed rows, ascending columns */
typedef struct {
  PetscInt     rows, *i, *j;
  PetscScalar *a;
} LatinCoarsePart;

/*
   relative tolerance of an iterative coarse solver in the energy norm, if the next linear stage or an outer CG corrects its error; 0.01 takes as many
   stages, and 1.5 to 1.8 times the steps
*/
#define LATIN_COARSE_CONTRACTION 0.1

#define LATIN_COARSE_KEPT 1500 /* most rows (18 MB) of a parallel matrix that is kept after its factorisation, for products of monitors */

/* ---- Cholesky of a matrix in parts, by fronts that ranks join in pairs (coarse/tree.h, treeplan.c, treecholesky.c, treefactor.c) ---- */
#define LATIN_TREE "latintree" /* a MatSolverType */
/*
   key of an object composed with a MATIS: the shell that replaces its local matrix once the factorisation has read it. The factor is provisional, and
   may be rounded
*/
#define LATIN_TREE_RELEASED "LatinTreeReleased"
PETSC_INTERN PetscErrorCode LatinTreeRegister(void);
PETSC_INTERN PetscErrorCode LatinTreePays(MPI_Comm, PetscInt elements, PetscInt n, const PetscInt number[], PetscLayout, PetscBool *);

PETSC_INTERN PetscErrorCode LatinCoarseNumber(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinCoarseSetUp(LatinCoarse *, LatinHomogenised *);
PETSC_INTERN PetscErrorCode LatinCoarseRelease(LatinCoarse *);
PETSC_INTERN PetscErrorCode LatinCoarseRenew(LatinCoarse *, LatinHomogenised *);
PETSC_INTERN PetscErrorCode LatinCoarseSolve(LatinCoarse *, PetscReal contraction);
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
