#include "localsolvers/fronts.h"

#include "base/room.h"
#include "base/vector.h"

/* Multifrontal Cholesky (localsolvers/fronts.h): the assembly tree, the sizes of its fronts, and the factor. */

/* one row in eight is among the last ones, whose large fronts release what has been read; for all large fronts this costs 45 ms of 1.05 s in page faults */
#define LATIN_FRONT_LAST 8

/* Returns the number of rows of front f beyond those that it eliminates */
static inline PetscInt LatinFrontBelow(const LatinFronts *F, PetscInt f)
{
  return F->row_first[f + 1] - F->row_first[f] - F->columns[f];
}

/* Returns the number of entries of its contribution block: columns of the rows that later fronts eliminate, kept rows below them */
static inline size_t LatinContributionEntries(const LatinFronts *F, PetscInt f)
{
  return LatinPanelSize(LATIN_CONTRIBUTION_PANEL, LatinFrontBelow(F, f), F->later[f]);
}

/*
   Creates the assembly tree and computes the memory that it takes. Fronts are in postorder, so that the contribution blocks that a front takes are on
   top of a stack. There are two stacks, at both ends of one array, for fronts at even and at odd depth: so a front puts its block on one while those of
   its children are on the other. order, first, row_first and row are not copied and must outlive F
*/
PetscErrorCode LatinFrontsCreate(PetscInt n, PetscInt kept, PetscInt fronts, const PetscInt order[], const PetscInt first[], const PetscInt row_first[], const PetscInt row[], LatinFronts *F)
{
  const PetscInt inside = n - kept;
  PetscInt      *owner; /* [n] front that eliminates a row */
  size_t         waiting = 0;

  PetscFunctionBegin;
  *F = (LatinFronts){.n = n, .kept = kept, .fronts = fronts, .order = order, .first = first, .row_first = row_first, .row = row};
  PetscCall(PetscMalloc6(fronts, &F->columns, fronts, &F->later, fronts, &F->child, fronts, &F->sibling, fronts, &F->odd, fronts + 1, &F->panel));
  PetscCall(PetscMalloc1(n, &owner));
  F->panel[0] = 0;
  for (PetscInt f = 0; f < fronts; f++) {
    const PetscInt height = row_first[f + 1] - row_first[f], columns = PetscMax(0, PetscMin(first[f + 1], inside) - first[f]);

    F->columns[f]   = columns;
    F->panel[f + 1] = F->panel[f] + LatinPanelSize(LATIN_FRONT_PANEL, height, columns);
    F->reach        = PetscMax(F->reach, F->panel[f] + (size_t)height * (size_t)columns);
    F->tallest      = PetscMax(F->tallest, height);
    F->child[f]     = -1;
    F->later[f]     = F->columns[f] ? height - F->columns[f] : 0;
    while (F->later[f] && row[row_first[f] + F->columns[f] + F->later[f] - 1] >= inside) F->later[f]--;
    for (PetscInt c = 0; c < F->columns[f]; c++) F->operations += PetscSqr((PetscLogDouble)(height - c));
    for (PetscInt c = first[f]; c < first[f + 1]; c++) owner[c] = f;
  }
  for (F->late = fronts; F->late && n - first[F->late - 1] <= n / LATIN_FRONT_LAST;) F->late--;
  for (PetscInt f = fronts - 1; f >= 0; f--) {
    PetscInt next;

    F->sibling[f] = -1;
    F->odd[f]     = PETSC_FALSE;
    if (!F->later[f]) continue;
    next                  = row[row_first[f] + F->columns[f]];
    F->odd[f]             = (PetscBool)!F->odd[owner[next]];
    F->sibling[f]         = F->child[owner[next]];
    F->child[owner[next]] = f;
  }
  for (PetscInt f = 0; f < fronts; f++) {
    const size_t own = LatinContributionEntries(F, f), all = waiting + own + (size_t)(row_first[f + 1] - row_first[f]) * (size_t)F->columns[f];

    F->stack = PetscMax(F->stack, waiting + own);
    F->peak  = PetscMax(F->peak, all);
    for (PetscInt c = F->child[f]; c >= 0; c = F->sibling[c]) waiting -= LatinContributionEntries(F, c);
    waiting += own;
  }
  PetscCall(PetscFree(owner));
  PetscFunctionReturn(0);
}

/* Makes a factor in this precision from panels L that were computed elsewhere. Releases the memory of L as it is read */
PetscErrorCode LatinFrontsFill(LatinFronts *F, LatinArithmetic precision, PetscReal L[])
{
  const size_t entries = F->panel[F->fronts], bytes = entries * (precision == LATIN_DOUBLE ? sizeof(double) : sizeof(float));

  PetscFunctionBegin;
  PetscCall(LatinRoomDestroy_Private(&F->factor));
  PetscCall(LatinRoomCreate_Private(bytes + LATIN_LINE, 0, &F->factor)); /* no large pages: they would be in memory beside all of L */
  F->precision = precision;
  F->room      = 0;
  for (size_t first = 0, last; first < entries; first = last) {
    last = PetscMin(first + (size_t)LATIN_FRONT_PANEL * (size_t)F->tallest, entries);
    if (precision == LATIN_DOUBLE)
      for (size_t k = first; k < last; k++) ((double *)F->factor)[k] = (double)L[k];
    else
      for (size_t k = first; k < last; k++) ((float *)F->factor)[k] = (float)L[k];
    LatinRoomRelease(L + first, (last - first) * sizeof(*L));
  }
  memset((char *)F->factor + bytes, 0, LATIN_LINE);
  PetscFunctionReturn(0);
}

/* Allocates work space for so many right-hand sides */
static PetscErrorCode LatinFrontsRoom_Private(LatinFronts *F, PetscInt columns)
{
  const size_t size = F->precision == LATIN_DOUBLE ? sizeof(double) : sizeof(float);

  PetscFunctionBegin;
  if (F->room >= columns) PetscFunctionReturn(0);
  PetscCall(LatinRoomDestroy_Private(&F->x));
  PetscCall(PetscFree(F->work));
  PetscCall(LatinRoomCreate_Private(size * (size_t)F->n * (size_t)columns, size * (size_t)F->n * (size_t)columns, &F->x));
  PetscCall(PetscMalloc(size * (size_t)F->tallest * (size_t)columns + LATIN_LINE, &F->work));
  F->room = columns;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinFrontsDestroy(LatinFronts *F)
{
  PetscFunctionBegin;
  PetscCall(PetscFree6(F->columns, F->later, F->child, F->sibling, F->odd, F->panel));
  PetscCall(LatinRoomDestroy_Private(&F->factor));
  PetscCall(LatinRoomDestroy_Private(&F->x));
  PetscCall(PetscFree(F->work));
  PetscCall(PetscMemzero(F, sizeof(*F)));
  PetscFunctionReturn(0);
}

/* Sums over rows, in more digits than single precision has */
typedef PetscReal LatinLanesSum __attribute__((vector_size(LATIN_FRONT_LANES * sizeof(PetscReal)), aligned(LATIN_LINE)));
#define LATIN_FRONT_BLOCK 32 /* columns of a contribution block that one gemm makes, if the front eliminates few; wider blocks fill more above the diagonal */
#define LATIN_PANEL_ROWS  64 /* rows of a panel that stay in the first-level cache: 32 kB with its 64 columns */
/* rows of a front that stay in registers while lanes are solved, columns for one right-hand side: eight sums keep two units for multiply-add busy */
#define LATIN_FRONT_ROWS 8
/* bytes ahead of which the factor is prefetched, as processors prefetch by themselves up to the end of a page; METIS grid of 100: 9.2 ms, without 11.5 */
#define LATIN_FRONT_AHEAD 4096
#define LATIN_LANES_SQUARE(sum, x) \
  do { \
    const LatinLanesSum wide = __builtin_convertvector(x, LatinLanesSum); \
    *(sum) += wide * wide; \
  } while (0)

/* Entries of a matrix that are still to be read. Once few rows are left, theirs are copied and the others released */
typedef struct {
  const PetscInt    *i, *j;
  const PetscScalar *a;
  PetscInt          *own_i, *own_j; /* copies to be freed, or NULL */
  PetscScalar       *own_a;
  PetscInt           rows; /* rows left at which the next copy is made: each time half of them */
} LatinEntries;

static PetscErrorCode LatinEntriesFree_Private(LatinEntries *entries)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(entries->own_i));
  PetscCall(PetscFree2(entries->own_j, entries->own_a));
  PetscFunctionReturn(0);
}

/*
   Copies the entries of rows in places from `first` on of the order of elimination, place[] of each row; of each pair across the diagonal the one that
   is read. Releases all others
*/
static PetscErrorCode LatinEntriesRelease_Private(const LatinFronts *F, PetscInt first, const PetscInt place[], LatinEntriesCallback callback, LatinEntries *entries)
{
  LatinEntries all = *entries;
  PetscInt     n   = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(F->n + 1, &entries->own_i));
  for (PetscInt pass = 0; pass < 2; pass++) { /* the first pass counts */
    n = 0;
    for (PetscInt r = 0; r < F->n; r++) {
      entries->own_i[r] = n;
      for (PetscInt k = all.i[r]; k < all.i[r + 1] && place[r] >= first; k++) {
        if (place[all.j[k]] < place[r]) continue;
        if (pass) entries->own_j[n] = all.j[k];
        if (pass) entries->own_a[n] = all.a[k];
        n++;
      }
    }
    entries->own_i[F->n] = n;
    if (!pass) PetscCall(PetscMalloc2(n, &entries->own_j, n, &entries->own_a));
  }
  entries->i = entries->own_i;
  entries->j = entries->own_j;
  entries->a = entries->own_a;
  if (all.own_i) {
    LatinRoomRelease(all.own_a, (size_t)all.i[F->n] * sizeof(*all.a));
    PetscCall(LatinEntriesFree_Private(&all));
  } else PetscCall(callback.call(callback.owner, PETSC_FALSE));
  PetscFunctionReturn(0);
}

#define FRONT_REAL       double
#define FRONT_BLAS(name) PETSC_PASTE3(d, name, PETSC_BLASLAPACK_SUFFIX_)
#define FRONT(name)      name##Double
#include "localsolvers/frontkernels.h"
#include "localsolvers/lanekernels.h"
#undef FRONT_REAL
#undef FRONT_BLAS
#undef FRONT

#define FRONT_REAL       float
#define FRONT_BLAS(name) PETSC_PASTE3(s, name, PETSC_BLASLAPACK_SUFFIX_)
#define FRONT(name)      name##Single
#include "localsolvers/frontkernels.h"
#include "localsolvers/lanekernels.h"

#define LATIN_SINGLE_ENTRIES 1e6 /* entries of a factor (8 MB) below which it stays in cache, and double precision is as fast */

/*
   Returns the precision that takes the least time. Single throughout if fronts are as tall as the separators of a solid: then arithmetic is most of the
   time, and displacements as soft as those of plates and beams are not expected. Kept rows do not count: the edge of a plate is as long as a separator
   of a solid
*/
static LatinArithmetic LatinFrontsPrecision(const LatinFronts *F)
{
  PetscBool solid;
  PetscInt  tallest = 0;

  for (PetscInt f = 0; f < F->fronts; f++) tallest = PetscMax(tallest, F->columns[f] + F->later[f]);
  solid = (PetscBool)(PetscPowReal((PetscReal)tallest, 3.0) > PetscSqr((PetscReal)F->n));
  return F->panel[F->fronts] < LATIN_SINGLE_ENTRIES ? LATIN_DOUBLE : solid ? LATIN_SINGLE : LATIN_ROUNDED;
}

/*
   Returns the bytes of the factor that are in memory from the start, in large pages. Those of the last fronts are not: their columns are whole in
   double precision beside what is kept
*/
static size_t LatinFrontsEarly(const LatinFronts *F, LatinArithmetic precision)
{
  if (precision != LATIN_ROUNDED) return F->reach * (precision == LATIN_DOUBLE ? sizeof(double) : sizeof(float));
  return F->panel[F->kept ? F->late : F->fronts] * sizeof(float);
}

/*
   Factors a matrix, given by both triangles, in this precision or, if it fails, in a higher one. S becomes the Schur complement of the kept rows, in
   the order of elimination: its lower triangle, see LatinLowerAt(). callback: releases the entries. *bad: a row in the first front that is not positive
   definite, -1: none
*/
PetscErrorCode LatinFrontsFactor(LatinFronts *F, LatinArithmetic precision, const PetscInt i[], const PetscInt j[], const PetscScalar a[], LatinEntriesCallback callback, PetscReal S[], PetscInt *bad)
{
  const LatinEntriesCallback none = {.call = NULL};

  PetscFunctionBegin;
  *bad = -1;
  if (precision == LATIN_BY_SIZE) precision = LatinFrontsPrecision(F);
  for (PetscBool again = PETSC_TRUE; again; again = (PetscBool)(*bad >= 0 && precision-- != LATIN_DOUBLE)) {
    const size_t bytes = precision == LATIN_ROUNDED ? F->panel[F->fronts] * sizeof(float) : F->reach * (precision == LATIN_DOUBLE ? sizeof(double) : sizeof(float));

    if (*bad >= 0) PetscCall(PetscInfo(NULL, "single precision does not hold the factor: row %" PetscInt_FMT "\n", *bad));
    *bad = -1;
    LatinRoomZero(S, (LatinLowerAt(F->kept, F->kept) + (size_t)F->kept) * sizeof(*S)); /* S is filled last, as fronts grow tall */
    if (!F->factor || (precision == LATIN_DOUBLE) != (F->precision == LATIN_DOUBLE)) {
      PetscCall(LatinRoomDestroy_Private(&F->factor));
      LatinRoomTrim(bytes);
      PetscCall(LatinRoomCreate_Private(bytes + LATIN_LINE, LatinFrontsEarly(F, precision), &F->factor)); /* solves read it from end to end */
      F->room = 0;
    }
    F->precision = precision;
    if (precision == LATIN_SINGLE) PetscCall(LatinFrontsFactorSingle(F, i, j, a, callback, S, bad));
    /* the check of a factor in double precision reads the matrix */
    else PetscCall(LatinFrontsFactorDouble(F, i, j, a, precision == LATIN_DOUBLE ? none : callback, S, bad));
    if (*bad >= 0 && precision != LATIN_DOUBLE && callback.call) PetscCall(callback.call(callback.owner, PETSC_TRUE));
    memset((char *)F->factor + F->panel[F->fronts] * (precision == LATIN_DOUBLE ? sizeof(double) : sizeof(float)), 0, LATIN_LINE);
  }
  /* if entries are released, a low peak matters; else the next factorisation takes the same pages */
  if (callback.call) LatinRoomTrim(F->stack * sizeof(float));
  PetscFunctionReturn(0);
}

/*
   Performs one half of the solve or both, in place, for columns that are ld apart.

     forward:   the forces b of all rows become those on the kept rows, and intermediate values for the other half on the others
     backward:  b, with the displacements of the kept rows in their places, becomes those of all rows
     both:      b becomes the displacements with those of the kept rows zero; their entries of b stay
     energy:    NULL, or the forward half adds b^t A^-1 b of the rows that are not kept
*/
PetscErrorCode LatinFrontsSolve(LatinFronts *F, PetscBool forward, PetscBool backward, PetscInt columns, PetscReal b[], size_t ld, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinFrontsRoom_Private(F, PetscMin(columns, LATIN_BATCH_COLUMNS)));
  for (PetscInt first = 0; first < columns; first += LATIN_BATCH_COLUMNS) {
    const PetscInt some = PetscMin(columns - first, LATIN_BATCH_COLUMNS);

    if (F->precision != LATIN_DOUBLE) LatinFrontsHalvesSingle(F, forward, backward, some, b + ld * (size_t)first, ld, energy);
    else LatinFrontsHalvesDouble(F, forward, backward, some, b + ld * (size_t)first, ld, energy);
  }
  PetscCall(PetscLogFlops(2.0 * ((forward ? 1.0 : 0.0) + (backward ? 1.0 : 0.0)) * (double)F->panel[F->fronts] * columns));
  PetscFunctionReturn(0);
}

/* Marks reached[], the fronts that eliminate any of the rows at[], by their places in the order of elimination, or get contributions from these */
static void LatinFrontsReach(const LatinFronts *F, PetscInt rows, const PetscInt at[], PetscBool asked[], PetscBool reached[])
{
  for (PetscInt r = 0; r < F->n; r++) asked[r] = PETSC_FALSE;
  for (PetscInt r = 0; r < rows; r++) asked[at[r]] = PETSC_TRUE;
  for (PetscInt f = 0; f < F->fronts; f++) {
    reached[f] = PETSC_FALSE;
    for (PetscInt r = F->first[f]; r < F->first[f] + F->columns[f]; r++) reached[f] = (PetscBool)(reached[f] || asked[r]);
    for (PetscInt c = F->child[f]; c >= 0; c = F->sibling[c]) reached[f] = (PetscBool)(reached[f] || reached[c]);
  }
}

/*
   Solves for right-hand sides that are zero but in some rows, in which alone the solution is asked for: their entries b (rows x columns) become those
   of the solution or, on kept rows, which are held, the forces there. Other fronts are left out
*/
PetscErrorCode LatinFrontsSolveSome(LatinFronts *F, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[])
{
  PetscInt  *place, *at;
  PetscBool *asked, *reached;

  PetscFunctionBegin;
  PetscCall(LatinFrontsRoom_Private(F, PetscMin(columns, LATIN_BATCH_COLUMNS)));
  PetscCall(PetscMalloc4(F->n, &place, rows, &at, F->n, &asked, F->fronts, &reached));
  for (PetscInt r = 0; r < F->n; r++) place[F->order[r]] = r;
  for (PetscInt r = 0; r < rows; r++) at[r] = place[row[r]];
  LatinFrontsReach(F, rows, at, asked, reached);
  for (PetscInt first = 0; first < columns; first += LATIN_BATCH_COLUMNS) {
    const PetscInt some = PetscMin(columns - first, LATIN_BATCH_COLUMNS);

    if (F->precision != LATIN_DOUBLE) LatinFrontsSomeSingle(F, reached, rows, at, some, b + (size_t)rows * (size_t)first);
    else LatinFrontsSomeDouble(F, reached, rows, at, some, b + (size_t)rows * (size_t)first);
  }
  for (PetscInt f = 0; f < F->fronts; f++)
    if (reached[f]) PetscCall(PetscLogFlops(4.0 * (double)(F->panel[f + 1] - F->panel[f]) * columns));
  PetscCall(PetscFree4(place, at, asked, reached));
  PetscFunctionReturn(0);
}

/*
   Solves in place for interleaved right-hand sides x in the order of elimination: the entry of row r and lane w is at LATIN_FRONT_LANES * r + w.
   energy: products of each right-hand side with its solution; square: squares of the solution. x is aligned to LATIN_LINE bytes. No row is kept
*/
PetscErrorCode LatinFrontsSolveLanes(LatinFronts *F, float x[], PetscReal energy[], PetscReal square[])
{
  const size_t  n      = LATIN_FRONT_LANES * (size_t)F->n;
  LatinLanesSum sum[2] = {{0}, {0}};

  PetscFunctionBegin;
  if (F->precision != LATIN_DOUBLE) LatinFrontsLanesSingle(F, (LatinLanesSingle *)x, &sum[0], &sum[1]);
  else {
    double *wide;

    PetscCall(LatinFrontsRoom_Private(F, LATIN_FRONT_LANES));
    wide = (double *)F->x;
    for (size_t i = 0; i < n; i++) wide[i] = (double)x[i];
    LatinFrontsLanesDouble(F, (LatinLanesDouble *)wide, &sum[0], &sum[1]);
    for (size_t i = 0; i < n; i++) x[i] = (float)wide[i];
  }
  for (PetscInt w = 0; w < LATIN_FRONT_LANES; w++) {
    energy[w] = sum[0][w];
    square[w] = sum[1][w];
  }
  PetscCall(PetscLogFlops(4.0 * (double)F->panel[F->fronts] * LATIN_FRONT_LANES));
  PetscFunctionReturn(0);
}
