/*
   Multifrontal sparse Cholesky (Duff and Reid 1983, Liu 1992). Columns with the same rows, a supernode, are eliminated together in
   one dense matrix, the front. What this leaves on its other rows is its contribution block, which is assembled into its parent in
   the assembly tree: the front that eliminates the first of these rows. The last rows in the order of elimination may be kept: what
   all fronts leave on them is their Schur complement.

   The linear stage solves for increments, and so corrects an inaccurate factor as it goes (iterative refinement: Carson and Higham
   2018). A factor in single precision halves the memory and the time of a solve. Rounded from double, it leaves an error in energy of
   the order of 6e-8 sqrt(condition of K), which serves any structure that is no mechanism; computed in single, 6e-8 condition, in
   half the time.
*/
#ifndef LATINFRONTS_H
#define LATINFRONTS_H

#include "localsolvers/latinlocalsolvers.h"
#include <float.h>

typedef struct {
  PetscInt        n, kept, fronts;
  const PetscInt *order;             /* [n] order of elimination, of others, as the three lists that follow */
  const PetscInt *first;             /* [fronts + 1] columns of a front, */
  const PetscInt *row_first, *row;   /* and its rows, in the order of elimination, increasing, its own columns first */
  PetscInt       *columns;           /* [fronts] that are eliminated: not those of kept rows */
  PetscInt       *later;             /* [fronts] rows below these that later fronts eliminate, the columns of the contribution block; kept rows come after them */
  PetscInt       *child, *sibling;   /* [fronts] the assembly tree, as linked lists of children; -1: none */
  PetscBool      *odd;               /* [fronts] is its depth in the tree odd? */
  size_t         *panel;             /* [fronts + 1] where the columns of a front are in the factor: see LatinPanelAt() */
  PetscInt        late;              /* the first front of the last rows: there fronts are large and memory is at its peak */
  size_t          stack, peak;       /* entries of the contribution blocks that wait at the same time, at most; with the panel of the front at hand */
  size_t          reach;             /* entries of the factor while panels that are not yet packed are in their places */
  PetscInt        tallest;           /* rows of the tallest front */
  PetscLogDouble  operations;        /* additions and multiplications of the factorisation */
  LatinArithmetic precision;         /* of the factor that is there */
  void           *factor, *x, *work; /* of that precision: the panels, right-hand sides in the order of elimination, room for one front */
  PetscInt        room;              /* right-hand sides in x and work */
} LatinFronts;

#define LATIN_FRONT_PANEL        64  /* columns of a front that are stored from the same row on: what lies above the diagonal is left out but for their own block */
#define LATIN_CONTRIBUTION_PANEL 256 /* columns of a contribution block that are stored from the same row on: as wide as products of blocks are quick */

/* Columns are stored by panels of so many, one after the other, each from its diagonal on and column-major: where the panel begins whose first column is c */
static inline size_t LatinPanelAt(PetscInt wide, PetscInt height, PetscInt c)
{
  return (size_t)c * (size_t)height - (size_t)c * (size_t)(c - PetscMin(c, wide)) / 2;
}

/* The first column of the last one */
static inline PetscInt LatinPanelLast(PetscInt wide, PetscInt columns)
{
  return columns ? (columns - 1) / wide * wide : 0;
}

/* Where column c is, less its first row */
static inline size_t LatinPanelColumnAt(PetscInt wide, PetscInt height, PetscInt c)
{
  const PetscInt first = c / wide * wide;

  return LatinPanelAt(wide, height, first) + (size_t)(height - first) * (size_t)(c - first) - (size_t)first;
}

/* How much so many columns take */
static inline size_t LatinPanelSize(PetscInt wide, PetscInt height, PetscInt columns)
{
  const PetscInt last = LatinPanelLast(wide, columns);

  return LatinPanelAt(wide, height, last) + (size_t)(height - last) * (size_t)(columns - last);
}

/* Can single precision hold this pivot, and what it divides? */
static inline PetscBool LatinFrontPivot(double pivot)
{
  return (PetscBool)(pivot > 1e10 * FLT_MIN && pivot < 1e-10 * FLT_MAX);
}

PETSC_INTERN PetscErrorCode LatinFrontsCreate(PetscInt n, PetscInt kept, PetscInt fronts, const PetscInt order[], const PetscInt first[], const PetscInt row_first[], const PetscInt row[], LatinFronts *);
PETSC_INTERN PetscErrorCode LatinFrontsFactor(LatinFronts *, LatinArithmetic, const PetscInt i[], const PetscInt j[], const PetscScalar a[], LatinEntriesCallback, PetscReal S[], PetscInt *bad);
PETSC_INTERN PetscErrorCode LatinFrontsFill(LatinFronts *, LatinArithmetic, PetscReal L[]);
PETSC_INTERN PetscErrorCode LatinFrontsSolve(LatinFronts *, PetscBool forward, PetscBool backward, PetscInt columns, PetscReal b[], size_t ld, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinFrontsSolveSome(LatinFronts *, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[]);
PETSC_INTERN PetscErrorCode LatinFrontsSolveLanes(LatinFronts *, float x[], PetscReal energy[], PetscReal square[]);
PETSC_INTERN PetscErrorCode LatinFrontsDestroy(LatinFronts *);

#endif
