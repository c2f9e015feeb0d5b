/*
   Multifrontal sparse Cholesky (Duff and Reid 1983, Liu 1992). Columns with the same rows, a supernode, are eliminated together in one dense matrix,
   the front. Its update of the other rows is its contribution block, which is assembled into its parent in the assembly tree: the front that eliminates
   the first of these rows. The last rows in the order of elimination may be kept: the updates of all
   fronts turn their block of the matrix into their Schur complement.

   The linear stage solves for increments, and so corrects an inaccurate factor as it goes (iterative refinement: Carson and Higham 2018). A factor in
   single precision halves the memory and the time of a solve. Rounded from double, it leaves an error in energy of the order of 6e-8 sqrt(condition of
   K), accurate enough for any structure that is no mechanism. Computed in single precision, in half the time, it leaves 6e-8 times the condition.
*/
#ifndef LATINFRONTS_H
#define LATINFRONTS_H

#include "localsolvers/latinlocalsolvers.h"
#include <float.h>

typedef struct {
  PetscInt        n, kept, fronts;
  const PetscInt *order;           /* [n] order of elimination; borrowed, as the three lists that follow */
  const PetscInt *first;           /* [fronts + 1] range of the columns of each front, in the order of elimination */
  const PetscInt *row_first, *row; /* [fronts + 1] range of its rows in row[]: increasing places in the order of elimination, its own columns first */
  PetscInt       *columns;         /* [fronts] number of columns that are eliminated: not those of kept rows */
  /* [fronts] number of rows below these that later fronts eliminate, the columns of the contribution block; kept rows come after them */
  PetscInt       *later;
  PetscInt       *child, *sibling; /* [fronts] assembly tree, as linked lists of children; -1: none */
  PetscBool      *odd;             /* [fronts] whether its depth in the tree is odd */
  size_t         *panel;           /* [fronts + 1] start of the columns of each front in the factor, see LatinPanelAt() */
  PetscInt        late;            /* first front of the last rows (LATIN_FRONT_LAST): there fronts are large and memory is at its peak */
  size_t          stack, peak;     /* most entries of contribution blocks that wait at the same time; with the panel of the front at hand */
  size_t          reach;           /* entries of the factor while panels that are not yet packed are in their places */
  PetscInt        tallest;         /* rows of the tallest front */
  PetscLogDouble  operations;      /* additions and multiplications of the factorisation */
  LatinArithmetic precision;       /* precision of the factor */
  /* in this precision: panels; right-hand sides in the order of elimination; room for one front */
  void    *factor, *x, *work;
  PetscInt room; /* number of right-hand sides in x and work */
} LatinFronts;

/* columns of a panel of a front, stored from the same row on: what is above the diagonal is left out but for their own block */
#define LATIN_FRONT_PANEL        64
#define LATIN_CONTRIBUTION_PANEL 256 /* columns of a panel of a contribution block: wide enough for fast products of blocks */

/*
   Returns the position of the panel whose first column is c. Columns are stored by panels of `wide`, one after the other, each from its diagonal on and
   column-major
*/
static inline size_t LatinPanelAt(PetscInt wide, PetscInt height, PetscInt c)
{
  return (size_t)c * (size_t)height - (size_t)c * (size_t)(c - PetscMin(c, wide)) / 2;
}

/* Returns the first column of the last panel */
static inline PetscInt LatinPanelLast(PetscInt wide, PetscInt columns)
{
  return columns ? (columns - 1) / wide * wide : 0;
}

/* Returns the position of column c, minus its first row: add a row to get the position of an entry */
static inline size_t LatinPanelColumnAt(PetscInt wide, PetscInt height, PetscInt c)
{
  const PetscInt first = c / wide * wide;

  return LatinPanelAt(wide, height, first) + (size_t)(height - first) * (size_t)(c - first) - (size_t)first;
}

/* Returns the number of entries of the first `columns` columns */
static inline size_t LatinPanelSize(PetscInt wide, PetscInt height, PetscInt columns)
{
  const PetscInt last = LatinPanelLast(wide, columns);

  return LatinPanelAt(wide, height, last) + (size_t)(height - last) * (size_t)(columns - last);
}

/* Whether single precision holds this pivot, and quotients by it */
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
