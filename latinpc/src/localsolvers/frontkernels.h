/*
   The arithmetic of fronts in one precision: included once for each, with FRONT_REAL the type, FRONT_BLAS(name) the kernel
   and FRONT(name) a name of that precision.
*/

extern void FRONT_BLAS(potrf)(const char *, const PetscBLASInt *, FRONT_REAL *, const PetscBLASInt *, PetscBLASInt *);
extern void FRONT_BLAS(trsm)(const char *, const char *, const char *, const char *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, FRONT_REAL *, const PetscBLASInt *);
extern void FRONT_BLAS(gemm)(const char *, const char *, const PetscBLASInt *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *,
                             FRONT_REAL *, const PetscBLASInt *);

extern void FRONT_BLAS(syrk)(const char *, const char *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *, FRONT_REAL *, const PetscBLASInt *);

#include "localsolvers/panelkernels.h"
#include "localsolvers/columnkernels.h"

/* ---- the factor ---- */

/* Work space of a factorisation. The front at hand is the one that is being eliminated */
typedef struct {
  /* contribution blocks that wait for their parents, at both ends; between these, if the factor is rounded, the columns of the front at hand */
  FRONT_REAL *stack;
  size_t      size; /* entries of stack */
  /* [tallest][LATIN_BATCH_COLUMNS] some columns of the update of the Schur complement by a front */
  FRONT_REAL *some;
  /* [fronts] start of the contribution block of each front in the stack; entries in use at its two ends */
  size_t   *block, top[2];
  PetscInt *place; /* [n] place of each row in the order of elimination */
  /*
     [n] positions of rows in the front at hand; [tallest] positions of the rows of a child there; [tallest] end of the run of consecutive ones that
     each is in
  */
  PetscInt *at, *to, *end;
  PetscBool rounded; /* whether the factor is in lower precision than the arithmetic */
} FRONT(LatinFrontsWork);

/* Assembles the columns of the matrix that front f eliminates */
static void FRONT(LatinFrontEntries)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, const LatinEntries *entries, FRONT_REAL panel[])
{
  const PetscInt height = F->row_first[f + 1] - F->row_first[f];

  for (PetscInt c = 0; c < F->columns[f]; c++, panel += height) {
    const PetscInt own = F->order[F->first[f] + c];

    for (PetscInt k = entries->i[own]; k < entries->i[own + 1]; k++) {
      const PetscInt place = work->place[entries->j[k]];

      if (place >= F->first[f] + c) panel[work->at[place]] += (FRONT_REAL)entries->a[k];
    }
  }
}

/*
   Adds columns first to last - 1 of a contribution block of n rows, lower triangle, to rows and columns to[] of a matrix a of this height, or (half) of
   a contribution block of that many rows: extend-add. Rows r to end[r] - 1 are consecutive there
*/
static LATIN_CLONES void FRONT(LatinExtendAdd)(PetscInt n, PetscInt first, PetscInt last, const PetscInt to[], const PetscInt end[], const FRONT_REAL block[], PetscInt height, PetscBool half, FRONT_REAL a[])
{
  for (PetscInt k = first; k < last; k++) {
    const FRONT_REAL *from   = block + LatinPanelColumnAt(LATIN_CONTRIBUTION_PANEL, n, k);
    FRONT_REAL       *column = a + (half ? LatinPanelColumnAt(LATIN_CONTRIBUTION_PANEL, height, to[k]) : (size_t)height * (size_t)to[k]);

    for (PetscInt r = k; r < n; r = end[r]) {
      FRONT_REAL *gets = column + to[r] - r;

      _Pragma("omp simd") for (PetscInt i = r; i < end[r]; i++) gets[i] += from[i];
    }
  }
}

/*
   Assembles the contribution block of child c into columns first to last - 1 of front f: into its panel, or (U not NULL) into its own contribution
   block. once: releases the memory that has been read
*/
static void FRONT(LatinFrontAssembleChild)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, PetscInt c, PetscInt first, PetscInt last, PetscBool once, FRONT_REAL panel[], FRONT_REAL U[])
{
  const PetscInt n = LatinFrontBelow(F, c), later = F->later[c], height = F->row_first[f + 1] - F->row_first[f], columns = F->columns[f], *row = F->row + F->row_first[c] + F->columns[c];
  FRONT_REAL    *block = work->stack + work->block[c];
  PetscInt      *to = work->to, from = 0, end;

  for (PetscInt r = 0; r < n; r++) to[r] = work->at[row[r]] - (U ? columns : 0);
  while (from < later && work->at[row[from]] < first) from++;
  for (end = from; end < later && work->at[row[end]] < last;) end++;
  for (PetscInt r = n - 1; r >= from; r--) work->end[r] = r + 1 < n && to[r + 1] == to[r] + 1 ? work->end[r + 1] : r + 1;
  FRONT(LatinExtendAdd)(n, from, end, to, work->end, block, U ? height - columns : height, (PetscBool)(U != NULL), U ? U : panel);
  if (once) LatinRoomRelease(block + LatinPanelSize(LATIN_CONTRIBUTION_PANEL, n, from), (LatinPanelSize(LATIN_CONTRIBUTION_PANEL, n, end) - LatinPanelSize(LATIN_CONTRIBUTION_PANEL, n, from)) * sizeof(*block));
}

/* The same for all children; if memory is released, a panel of columns at a time */
static void FRONT(LatinFrontAssemble)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, PetscInt first, PetscInt last, PetscBool once, FRONT_REAL panel[], FRONT_REAL U[])
{
  for (PetscInt next; first < last; first = next) {
    next = once ? PetscMin(first + LATIN_FRONT_PANEL, last) : last;
    for (PetscInt c = F->child[f]; c >= 0; c = F->sibling[c]) FRONT(LatinFrontAssembleChild)(F, work, f, c, first, next, once, panel, U);
  }
}

/*
   Computes columns first to last - 1 of the contribution block U = -Z Z^t, each from its diagonal on. If a front eliminates few columns, gemm on
   blocks, which fills those on the diagonal, is faster than syrk
*/
static void FRONT(LatinFrontContribution)(PetscBLASInt columns, PetscBLASInt first, PetscBLASInt last, PetscBLASInt below, const FRONT_REAL Z[], PetscBLASInt height, FRONT_REAL U[])
{
  const FRONT_REAL minus = -1, zero = 0;
  const PetscBool  few = (PetscBool)(columns <= LATIN_FRONT_PANEL);

  for (PetscBLASInt c = first, wide; c < last; c += wide) {
    const PetscBLASInt rows = below - c, ld = below - c / LATIN_CONTRIBUTION_PANEL * LATIN_CONTRIBUTION_PANEL, next = few ? 0 : PetscMin(LATIN_CONTRIBUTION_PANEL, last - c), others = rows - next;
    FRONT_REAL        *to = U + LatinPanelColumnAt(LATIN_CONTRIBUTION_PANEL, below, c) + c;

    wide = few ? PetscMin(LATIN_FRONT_BLOCK, last - c) : next;
    if (next) FRONT_BLAS(syrk)("L", "N", &wide, &columns, &minus, Z + c, &height, &zero, to, &ld);
    if (others) FRONT_BLAS(gemm)("N", "T", &others, &wide, &columns, &minus, Z + c + next, &height, Z + c, &height, &zero, to + next, &ld);
  }
}

/*
   Eliminates the columns of front f: its panel becomes that of the factor, and U its contribution block, to which those of its children are added.
   once: releases the memory that has been read. Returns PETSC_FALSE if the columns are not positive definite
*/
static PetscBool FRONT(LatinFrontEliminate)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, PetscBool once, FRONT_REAL panel[], FRONT_REAL U[])
{
  const PetscBLASInt columns = (PetscBLASInt)F->columns[f], below = (PetscBLASInt)LatinFrontBelow(F, f), height = columns + below, later = (PetscBLASInt)F->later[f];

  if (!FRONT(LatinPanels)(columns, height, panel, height)) return PETSC_FALSE;
  for (PetscBLASInt first = 0, last; first < later; first = last) {
    last = once ? PetscMin(first + LATIN_CONTRIBUTION_PANEL, later) : later;
    FRONT(LatinFrontContribution)(columns, first, last, below, panel + columns, height, U);
    FRONT(LatinFrontAssemble)(F, work, f, columns + first, columns + last, once, NULL, U);
  }
  return PETSC_TRUE;
}

/*
   Stores the columns of a front in the factor: rounded, or else packed where they are. Zeros go above the diagonal, as kernels read whole vectors.
   once: releases the memory that has been read. Returns PETSC_FALSE if single precision cannot hold a pivot
*/
static LATIN_CLONES PetscBool FRONT(LatinFrontStore)(const LatinFronts *F, PetscInt f, PetscBool rounded, PetscBool once, FRONT_REAL panel[])
{
  const PetscInt height = F->row_first[f + 1] - F->row_first[f], columns = F->columns[f];

  for (PetscInt c = 0; c < columns; c++) {
    const PetscInt    first = c / LATIN_FRONT_PANEL * LATIN_FRONT_PANEL, rows = height - first;
    const size_t      at   = F->panel[f] + LatinPanelAt(LATIN_FRONT_PANEL, height, first) + (size_t)(c - first) * (size_t)rows;
    const FRONT_REAL *from = panel + (size_t)height * (size_t)c + first, pivot = from[c - first];

    if (rounded) {
      float *to = (float *)F->factor + at;

      for (PetscInt r = 0; r < c - first; r++) to[r] = 0.0F;
      _Pragma("omp simd") for (PetscInt r = c - first; r < rows; r++) to[r] = (float)from[r];
      if (!LatinFrontPivot((double)pivot)) return PETSC_FALSE;
    } else {
      FRONT_REAL *to = (FRONT_REAL *)F->factor + at;

      if (first) memmove(to, from, (size_t)rows * sizeof(*from));
      for (PetscInt r = 0; r < c - first; r++) to[r] = 0;
    }
    if (once && c + 1 == first + LATIN_FRONT_PANEL) LatinRoomRelease(panel + (size_t)height * (size_t)first, (size_t)height * LATIN_FRONT_PANEL * sizeof(*panel));
  }
  return PETSC_TRUE;
}

/* Subtracts the update of front f from the Schur complement S of the kept rows, some columns at a time */
static void FRONT(LatinFrontSchur)(const LatinFronts *F, const FRONT(LatinFrontsWork) * work, PetscInt f, const FRONT_REAL panel[], PetscReal S[])
{
  const FRONT_REAL   one = 1, zero = 0;
  const PetscInt     inside = F->n - F->kept, below = LatinFrontBelow(F, f), *row = F->row + F->row_first[f] + F->columns[f];
  const PetscBLASInt own = (PetscBLASInt)F->columns[f], height = own + (PetscBLASInt)below;

  for (PetscInt first = F->later[f]; first < below; first += LATIN_BATCH_COLUMNS) {
    const PetscBLASInt rows = (PetscBLASInt)(below - first), columns = PetscMin(LATIN_BATCH_COLUMNS, rows);
    const FRONT_REAL  *Z = panel + own + first, *block = work->some;

    FRONT_BLAS(gemm)("N", "T", &rows, &columns, &own, &one, Z, &height, Z, &height, &zero, work->some, &rows);
    for (PetscInt c = first; c < first + columns; c++, block += rows) {
      PetscReal *to = S + LatinLowerAt(F->kept, row[c] - inside);

      for (PetscInt r = c; r < below; r++) to[row[r] - inside] -= block[r - first];
    }
  }
}

/* Returns the number of free entries of the stack, between its two ends */
static size_t FRONT(LatinStackFree)(const FRONT(LatinFrontsWork) * work)
{
  return work->size - work->top[0] - work->top[1];
}

/* Returns where the contribution block of front f is put: on the end of the stack for its depth */
static size_t FRONT(LatinStackPlace)(const LatinFronts *F, const FRONT(LatinFrontsWork) * work, PetscInt f)
{
  return F->odd[f] ? work->size - work->top[1] - LatinContributionEntries(F, f) : work->top[0];
}

/* Takes the contribution blocks of the children of front f from one end of the stack, and keeps its own on the other */
static void FRONT(LatinStackExchange)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f)
{
  for (PetscInt c = F->child[f]; c >= 0; c = F->sibling[c]) work->top[!F->odd[f]] -= LatinContributionEntries(F, c);
  work->top[F->odd[f]] += LatinContributionEntries(F, f);
}

/* Returns where the columns of front f are eliminated: in the factor or, if this is rounded, in the free room of the stack beside the contribution block */
static FRONT_REAL *FRONT(LatinFrontPanel)(const LatinFronts *F, const FRONT(LatinFrontsWork) * work, PetscInt f)
{
  if (!work->rounded) return (FRONT_REAL *)F->factor + F->panel[f];
  return work->stack + work->top[0] + (F->odd[f] ? 0 : LatinContributionEntries(F, f));
}

/* Whether front f, of these entries, is so late and large that memory is at its peak: pages that have been read are released before others are written */
static PetscBool FRONT(LatinFrontLarge)(const LatinFronts *F, const FRONT(LatinFrontsWork) * work, PetscInt f, size_t entries)
{
  if (!work->rounded || !F->kept || f < F->late || 2 * entries * sizeof(FRONT_REAL) < LATIN_PAGE) return PETSC_FALSE;
  return (PetscBool)(2 * (work->top[0] + work->top[1] + LatinContributionEntries(F, f) + entries) > work->size);
}

/* Assembles, eliminates and stores front f, whose children are done. Returns PETSC_FALSE if it is not positive definite */
static PetscBool FRONT(LatinFrontFactor)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, const LatinEntries *entries, PetscReal S[])
{
  const PetscInt  height = F->row_first[f + 1] - F->row_first[f], *row = F->row + F->row_first[f];
  const size_t    size  = (size_t)height * (size_t)F->columns[f];
  const PetscBool large = FRONT(LatinFrontLarge)(F, work, f, size);
  FRONT_REAL     *panel = FRONT(LatinFrontPanel)(F, work, f);

  work->block[f] = FRONT(LatinStackPlace)(F, work, f);
  if (large) LatinRoomZero(work->stack + work->top[0], FRONT(LatinStackFree)(work) * sizeof(*panel));
  else memset(panel, 0, size * sizeof(*panel));
  for (PetscInt r = 0; r < height; r++) work->at[row[r]] = r;
  FRONT(LatinFrontAssemble)(F, work, f, 0, F->columns[f], large, panel, NULL);
  FRONT(LatinFrontEntries)(F, work, f, entries, panel);
  if (!FRONT(LatinFrontEliminate)(F, work, f, large, panel, work->stack + work->block[f])) return PETSC_FALSE;
  FRONT(LatinStackExchange)(F, work, f);
  FRONT(LatinFrontSchur)(F, work, f, panel, S);
  return FRONT(LatinFrontStore)(F, f, work->rounded, large, panel);
}

/* Eliminates all fronts. *bad: a row in the first front that is not positive definite */
static PetscErrorCode FRONT(LatinFrontsEliminate)(LatinFronts *F, FRONT(LatinFrontsWork) * work, LatinEntriesCallback callback, LatinEntries *entries, PetscReal S[], PetscInt *bad)
{
  PetscFunctionBegin;
  for (PetscInt f = 0; f < F->fronts && *bad < 0; f++) {
    if (callback.call && F->columns[f] && F->n - F->kept - F->first[f] <= entries->rows) {
      entries->rows /= 2;
      LatinRoomRelease(work->stack + work->top[0], FRONT(LatinStackFree)(work) * sizeof(*work->stack));
      PetscCall(LatinEntriesRelease_Private(F, F->first[f], work->place, callback, entries));
    }
    if (F->columns[f] && !FRONT(LatinFrontFactor)(F, work, f, entries, S)) *bad = F->order[F->first[f]];
  }
  /* the block of the kept rows itself */
  for (PetscInt c = 0, inside = F->n - F->kept; c < F->kept; c++)
    for (PetscInt own = F->order[inside + c], k = entries->i[own]; k < entries->i[own + 1]; k++)
      if (work->place[entries->j[k]] >= inside + c) S[LatinLowerAt(F->kept, c) + (size_t)(work->place[entries->j[k]] - inside)] += entries->a[k];
  PetscFunctionReturn(0);
}

/* Factors the matrix, see LatinFrontsFactor() */
static PetscErrorCode FRONT(LatinFrontsFactor)(LatinFronts *F, const PetscInt i[], const PetscInt j[], const PetscScalar a[], LatinEntriesCallback callback, PetscReal S[], PetscInt *bad)
{
  LatinEntries entries = {.i = i, .j = j, .a = a, .rows = (F->n - F->kept) / 2};
  FRONT(LatinFrontsWork)
  work = {
    .top = {0, 0},
      .rounded = (PetscBool)(F->precision == LATIN_ROUNDED)
  };

  PetscFunctionBegin;
  work.size = work.rounded ? F->peak : F->stack;
  PetscCall(PetscMalloc1(work.size, &work.stack));
  PetscCall(PetscMalloc1(F->kept ? (size_t)F->tallest * LATIN_BATCH_COLUMNS : 0, &work.some));
  PetscCall(PetscMalloc5(F->fronts, &work.block, F->n, &work.place, F->n, &work.at, F->tallest, &work.to, F->tallest, &work.end));
  for (PetscInt r = 0; r < F->n; r++) work.place[F->order[r]] = r;
  PetscCall(FRONT(LatinFrontsEliminate)(F, &work, callback, &entries, S, bad));
  PetscCall(LatinEntriesFree_Private(&entries));
  PetscCall(PetscFree5(work.block, work.place, work.at, work.to, work.end));
  PetscCall(PetscFree(work.some));
  PetscCall(PetscFree(work.stack));
  PetscFunctionReturn(0);
}

/* ---- solves ---- */

/* Performs one half of the solve for one right-hand side at front f, in place; it reads the panels once, as they are stored */
static void FRONT(LatinFrontColumn)(const LatinFronts *F, PetscInt f, PetscBool forward)
{
  const PetscInt   *row = F->row + F->row_first[f], own = F->columns[f], height = F->row_first[f + 1] - F->row_first[f];
  const FRONT_REAL *panel = (const FRONT_REAL *)F->factor + F->panel[f];
  FRONT_REAL       *x = (FRONT_REAL *)F->x, *b = (FRONT_REAL *)F->work;

  for (PetscInt r = 0; r < own; r++) b[r] = x[F->first[f] + r];
  for (PetscInt r = own; r < height; r++) b[r] = x[row[r]];
  memset(b + height, 0, LATIN_LINE);
  for (PetscInt c = 0; c < own && forward; c += LATIN_FRONT_PANEL) FRONT(LatinPanelForward)(PetscMin(LATIN_FRONT_PANEL, own - c), height - c, panel + LatinPanelAt(LATIN_FRONT_PANEL, height, c), b + c);
  for (PetscInt c = LatinPanelLast(LATIN_FRONT_PANEL, own); c >= 0 && !forward; c -= LATIN_FRONT_PANEL) FRONT(LatinPanelBackward)(PetscMin(LATIN_FRONT_PANEL, own - c), height - c, panel + LatinPanelAt(LATIN_FRONT_PANEL, height, c), b + c);
  for (PetscInt r = 0; r < own; r++) x[F->first[f] + r] = b[r];
  for (PetscInt r = own; r < height && forward; r++) x[row[r]] = b[r];
}

/* Whether the rows that front f eliminates are zero in all right-hand sides */
static PetscBool FRONT(LatinFrontIdle)(const LatinFronts *F, PetscInt f, PetscBLASInt columns)
{
  const FRONT_REAL *x = (const FRONT_REAL *)F->x + (size_t)F->first[f] * (size_t)columns;

  for (size_t k = 0, entries = (size_t)F->columns[f] * (size_t)columns; k < entries; k++)
    if (x[k] != 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

/*
   Computes x = L^-1 x for the rows of the panel of front f that begins with its column c, and updates the rows below. Several right-hand sides are
   stored row by row, so that each row of a front is gathered as one vector
*/
static LATIN_CLONES void FRONT(LatinFrontForward)(const LatinFronts *F, PetscInt f, PetscInt c, PetscBLASInt columns)
{
  const PetscBLASInt own = (PetscBLASInt)PetscMin(LATIN_FRONT_PANEL, F->columns[f] - c), height = (PetscBLASInt)(F->row_first[f + 1] - F->row_first[f] - c), below = height - own;
  const PetscInt    *row   = F->row + F->row_first[f] + c + own;
  const FRONT_REAL  *panel = (const FRONT_REAL *)F->factor + F->panel[f] + LatinPanelAt(LATIN_FRONT_PANEL, height + c, c), one = 1, zero = 0;
  FRONT_REAL        *x = (FRONT_REAL *)F->x + (size_t)(F->first[f] + c) * (size_t)columns, *work = (FRONT_REAL *)F->work;

  FRONT_BLAS(trsm)("R", "L", "T", "N", &columns, &own, &one, panel, &height, x, &columns);
  if (!below) return;
  FRONT_BLAS(gemm)("N", "T", &columns, &below, &own, &one, x, &columns, panel + own, &height, &zero, work, &columns);
  for (PetscBLASInt r = 0; r < below; r++, work += columns) {
    x = (FRONT_REAL *)F->x + (size_t)row[r] * (size_t)columns;
    _Pragma("omp simd") for (PetscBLASInt k = 0; k < columns; k++) x[k] -= work[k];
  }
}

/* Computes x = L^-t x for these rows, once those below are known */
static void FRONT(LatinFrontBackward)(const LatinFronts *F, PetscInt f, PetscInt c, PetscBLASInt columns)
{
  const PetscBLASInt own = (PetscBLASInt)PetscMin(LATIN_FRONT_PANEL, F->columns[f] - c), height = (PetscBLASInt)(F->row_first[f + 1] - F->row_first[f] - c), below = height - own;
  const PetscInt    *row   = F->row + F->row_first[f] + c + own;
  const FRONT_REAL  *panel = (const FRONT_REAL *)F->factor + F->panel[f] + LatinPanelAt(LATIN_FRONT_PANEL, height + c, c), one = 1, minus = -1;
  FRONT_REAL        *x = (FRONT_REAL *)F->x, *work = (FRONT_REAL *)F->work;

  for (PetscBLASInt r = 0; r < below; r++) memcpy(work + (size_t)columns * (size_t)r, x + (size_t)columns * (size_t)row[r], (size_t)columns * sizeof(*x));
  x += (size_t)(F->first[f] + c) * (size_t)columns;
  if (below) FRONT_BLAS(gemm)("N", "N", &columns, &own, &below, &minus, work, &columns, panel + own, &height, &one, x, &columns);
  FRONT_BLAS(trsm)("R", "L", "N", "N", &columns, &own, &one, panel, &height, x, &columns);
}

/*
   Copies the first rows of the right-hand sides to x, in the order of elimination, each column divided by its largest entry there, scale[c]; the others
   are zero
*/
static void FRONT(LatinFrontsTake)(LatinFronts *F, PetscInt rows, PetscInt columns, const PetscReal b[], size_t ld, PetscReal scale[])
{
  FRONT_REAL *x = (FRONT_REAL *)F->x;

  for (PetscInt c = 0; c < columns; c++) {
    const PetscReal *column = b + ld * (size_t)c;

    scale[c] = 0.0;
    for (PetscInt r = 0; r < rows; r++) scale[c] = PetscMax(scale[c], PetscAbsReal(column[F->order[r]]));
    if (!(scale[c] > 0.0)) scale[c] = 1.0;
  }
  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt c = 0; c < columns; c++) x[(size_t)r * (size_t)columns + (size_t)c] = (FRONT_REAL)(b[(size_t)F->order[r] + ld * (size_t)c] / scale[c]);
  memset(x + (size_t)rows * (size_t)columns, 0, (size_t)(F->n - rows) * (size_t)columns * sizeof(*x));
}

/*
   Stores the rows that are not kept in b; in the forward half, adds the kept ones to b. Returns, over rows that are not kept, the sum of old entries of
   b times new ones (all) or of the squares of new ones
*/
static PetscReal FRONT(LatinFrontsGive)(const LatinFronts *F, PetscBool forward, PetscBool all, PetscInt columns, PetscReal b[], size_t ld, const PetscReal scale[])
{
  const PetscInt    inside = F->n - F->kept;
  const FRONT_REAL *x      = (const FRONT_REAL *)F->x;
  PetscReal         sum    = 0.0;

  for (PetscInt r = 0; r < (forward ? F->n : inside); r++)
    for (PetscInt c = 0; c < columns; c++) {
      PetscReal      *entry = b + (size_t)F->order[r] + ld * (size_t)c;
      const PetscReal now   = scale[c] * (PetscReal)x[(size_t)r * (size_t)columns + (size_t)c];

      if (r < inside) {
        sum += now * (all ? *entry : now);
        *entry = now;
      } else *entry += now;
    }
  return sum;
}

/* Applies L^-1 of all fronts, or of those that are reached, unless all right-hand sides are zero there */
static void FRONT(LatinFrontsForward)(const LatinFronts *F, const PetscBool reached[], PetscInt columns)
{
  for (PetscInt f = 0; f < F->fronts; f++) {
    if (reached && !reached[f]) continue;
    if (FRONT(LatinFrontIdle)(F, f, (PetscBLASInt)columns)) continue;
    if (columns == 1) FRONT(LatinFrontColumn)(F, f, PETSC_TRUE);
    else
      for (PetscInt c = 0; c < F->columns[f]; c += LATIN_FRONT_PANEL) FRONT(LatinFrontForward)(F, f, c, (PetscBLASInt)columns);
  }
}

/* Applies L^-t of all fronts, or of those that are reached */
static void FRONT(LatinFrontsBackward)(const LatinFronts *F, const PetscBool reached[], PetscInt columns)
{
  for (PetscInt f = F->fronts - 1; f >= 0; f--) {
    if (reached && !reached[f]) continue;
    if (columns == 1) FRONT(LatinFrontColumn)(F, f, PETSC_FALSE);
    else
      for (PetscInt c = LatinPanelLast(LATIN_FRONT_PANEL, F->columns[f]); c >= 0 && F->columns[f]; c -= LATIN_FRONT_PANEL) FRONT(LatinFrontBackward)(F, f, c, (PetscBLASInt)columns);
  }
}

/*
   Performs one or both halves of the solve, see LatinFrontsSolve(). Each column is scaled to largest entry 1, which any precision holds. Entries on kept
   rows are not rounded: forces on interfaces do not vanish as the iteration converges
*/
static void FRONT(LatinFrontsHalves)(LatinFronts *F, PetscBool forward, PetscBool backward, PetscInt columns, PetscReal b[], size_t ld, PetscReal *energy)
{
  const PetscInt inside = F->n - F->kept;
  PetscReal      scale[LATIN_BATCH_COLUMNS], sum;

  FRONT(LatinFrontsTake)(F, forward ? inside : F->n, columns, b, ld, scale);
  if (forward) FRONT(LatinFrontsForward)(F, NULL, columns);
  if (forward && backward) memset((FRONT_REAL *)F->x + (size_t)inside * (size_t)columns, 0, (size_t)F->kept * (size_t)columns * sizeof(FRONT_REAL));
  if (backward) FRONT(LatinFrontsBackward)(F, NULL, columns);
  sum = FRONT(LatinFrontsGive)(F, forward, backward, columns, b, ld, scale);
  if (energy && forward) *energy += sum;
}

/* Copies the entries of x in places first to last - 1 of the order of elimination to b, see LatinFrontsSome() */
static void FRONT(LatinFrontsSomeGive)(const LatinFronts *F, PetscInt first, PetscInt last, PetscInt rows, const PetscInt at[], PetscInt columns, const PetscReal scale[], PetscReal b[])
{
  const FRONT_REAL *x = (const FRONT_REAL *)F->x;

  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt c = 0; c < columns && at[r] >= first && at[r] < last; c++) b[(size_t)r + (size_t)rows * (size_t)c] = scale[c] * (PetscReal)x[(size_t)at[r] * (size_t)columns + (size_t)c];
}

/* Solves for some rows, see LatinFrontsSolveSome(): b (rows x columns) are the entries of the rows in places at[] of the order of elimination */
static void FRONT(LatinFrontsSome)(LatinFronts *F, const PetscBool reached[], PetscInt rows, const PetscInt at[], PetscInt columns, PetscReal b[])
{
  const PetscInt inside = F->n - F->kept;
  const size_t   wide   = (size_t)columns;
  FRONT_REAL    *x      = (FRONT_REAL *)F->x;
  PetscReal      scale[LATIN_BATCH_COLUMNS];

  for (PetscInt f = 0; f < F->fronts; f++)
    if (reached[f]) memset(x + (size_t)F->first[f] * wide, 0, (size_t)F->columns[f] * wide * sizeof(*x));
  memset(x + (size_t)inside * wide, 0, (size_t)F->kept * wide * sizeof(*x));
  for (PetscInt c = 0; c < columns; c++) {
    const PetscReal *column = b + (size_t)rows * (size_t)c;

    scale[c] = 0.0;
    for (PetscInt r = 0; r < rows; r++) scale[c] = PetscMax(scale[c], PetscAbsReal(column[r]));
    if (!(scale[c] > 0.0)) scale[c] = 1.0;
  }
  for (PetscInt r = 0; r < rows; r++)
    for (PetscInt c = 0; c < columns; c++) x[(size_t)at[r] * wide + (size_t)c] = (FRONT_REAL)(b[(size_t)r + (size_t)rows * (size_t)c] / scale[c]);
  FRONT(LatinFrontsForward)(F, reached, columns);
  FRONT(LatinFrontsSomeGive)(F, inside, F->n, rows, at, columns, scale, b);
  memset(x + (size_t)inside * wide, 0, (size_t)F->kept * wide * sizeof(*x));
  FRONT(LatinFrontsBackward)(F, reached, columns);
  FRONT(LatinFrontsSomeGive)(F, 0, inside, rows, at, columns, scale, b);
}
