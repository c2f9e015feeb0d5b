/*
   The arithmetic of fronts in one precision: included once for each, with FRONT_REAL the type, FRONT_BLAS(name) the kernel
   and FRONT(name) a name of that precision.
*/

extern void FRONT_BLAS(potrf)(const char *, const PetscBLASInt *, FRONT_REAL *, const PetscBLASInt *, PetscBLASInt *);
extern void FRONT_BLAS(syrk)(const char *, const char *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *, FRONT_REAL *, const PetscBLASInt *);
extern void FRONT_BLAS(trsv)(const char *, const char *, const char *, const PetscBLASInt *, const FRONT_REAL *, const PetscBLASInt *, FRONT_REAL *, const PetscBLASInt *);
extern void FRONT_BLAS(trsm)(const char *, const char *, const char *, const char *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, FRONT_REAL *, const PetscBLASInt *);
extern void FRONT_BLAS(gemv)(const char *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *, FRONT_REAL *, const PetscBLASInt *);
extern void FRONT_BLAS(gemm)(const char *, const char *, const PetscBLASInt *, const PetscBLASInt *, const PetscBLASInt *, const FRONT_REAL *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *, const PetscBLASInt *, const FRONT_REAL *,
                             FRONT_REAL *, const PetscBLASInt *);

/* ---- the factor ---- */

/* What a factorisation works on */
typedef struct {
  FRONT_REAL *stack, *panel; /* what earlier fronts left on later rows; one panel, where the factor is rounded */
  size_t     *update, top;   /* [fronts] where a front's part of the stack is, and where the stack ends */
  PetscInt   *place;         /* [n] of a row in the order of elimination */
  PetscInt   *at, *to;       /* [n] and [tallest]: rows in the front at hand */
  PetscBool   narrow;        /* the factor is of lower precision than the arithmetic */
} FRONT(LatinFrontsWork);

/* The columns of the matrix that front f eliminates */
static void FRONT(LatinFrontEntries)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, const PetscInt i[], const PetscInt j[], const PetscScalar a[], FRONT_REAL panel[])
{
  const PetscInt *row = F->row + F->row_first[f], height = F->row_first[f + 1] - F->row_first[f];

  memset(panel, 0, (F->panel[f + 1] - F->panel[f]) * sizeof(*panel));
  for (PetscInt r = 0; r < height; r++) work->at[row[r]] = r;
  for (PetscInt c = 0; c < F->columns[f]; c++, panel += height) {
    const PetscInt own = F->order[F->first[f] + c];

    for (PetscInt k = i[own]; k < i[own + 1]; k++)
      if (work->place[j[k]] >= F->first[f] + c) panel[work->at[work->place[j[k]]]] += (FRONT_REAL)a[k];
  }
}

/* Adds what child c left to the columns that front f eliminates, or (U) to what it leaves itself: below x below, lower triangle */
static void FRONT(LatinFrontAdd)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, PetscInt c, FRONT_REAL panel[], FRONT_REAL U[])
{
  const PetscInt    n = LatinFrontBelow(F, c), height = F->row_first[f + 1] - F->row_first[f], columns = F->columns[f], *row = F->row + F->row_first[c] + F->columns[c];
  const FRONT_REAL *left = work->stack + work->update[c];
  PetscInt         *to = work->to, own = 0;

  for (PetscInt r = 0; r < n; r++) to[r] = work->at[row[r]];
  while (own < n && to[own] < columns) own++;
  if (U) {
    for (PetscInt r = own; r < n; r++) to[r] -= columns;
    for (PetscInt k = own; k < n; k++) {
      FRONT_REAL *column = U + (size_t)(height - columns) * (size_t)to[k];

      for (PetscInt r = k; r < n; r++) column[to[r]] += left[(size_t)r + (size_t)n * (size_t)k];
    }
  } else {
    for (PetscInt k = 0; k < own; k++) {
      FRONT_REAL *column = panel + (size_t)height * (size_t)to[k];

      for (PetscInt r = k; r < n; r++) column[to[r]] += left[(size_t)r + (size_t)n * (size_t)k];
    }
  }
}

/* Eliminates the columns of front f: its panel becomes that of the factor, and U what it leaves */
static PetscBool FRONT(LatinFrontEliminate)(const LatinFronts *F, PetscInt f, FRONT_REAL panel[], FRONT_REAL U[])
{
  const FRONT_REAL   one = 1, minus = -1, zero = 0;
  const PetscBLASInt columns = (PetscBLASInt)F->columns[f], below = (PetscBLASInt)LatinFrontBelow(F, f), height = columns + below;
  PetscBLASInt       info;

  FRONT_BLAS(potrf)("L", &columns, panel, &height, &info);
  if (info || !(panel[(size_t)(columns - 1) * (size_t)(height + 1)] > 0.0)) return PETSC_FALSE; /* not a number is not a pivot */
  if (!below) return PETSC_TRUE;
  FRONT_BLAS(trsm)("R", "L", "T", "N", &below, &columns, &one, panel, &height, panel + columns, &height);
  FRONT_BLAS(syrk)("L", "N", &below, &columns, &minus, panel + columns, &height, &zero, U, &below);
  return PETSC_TRUE;
}

/* Rounds a panel; PETSC_FALSE if single precision cannot hold its pivots */
static PetscBool FRONT(LatinFrontRound)(const LatinFronts *F, PetscInt f, const FRONT_REAL panel[], float rounded[])
{
  const size_t height = (size_t)(F->row_first[f + 1] - F->row_first[f]), entries = F->panel[f + 1] - F->panel[f];

  for (size_t k = 0; k < entries; k++) rounded[k] = (float)panel[k];
  for (PetscInt c = 0; c < F->columns[f]; c++)
    if (!(panel[(height + 1) * (size_t)c] > 1e10 * FLT_MIN && panel[(height + 1) * (size_t)c] < 1e-10 * FLT_MAX)) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* What front f leaves goes to the kept rows, if no later front eliminates any of it, or to the stack in place of what its children left there */
static void FRONT(LatinFrontLeave)(const LatinFronts *F, FRONT(LatinFrontsWork) * work, PetscInt f, const FRONT_REAL U[], PetscReal S[])
{
  const PetscInt below = LatinFrontBelow(F, f), *row = F->row + F->row_first[f] + F->columns[f], inside = F->n - F->kept;
  size_t         low = work->top;

  for (PetscInt c = F->child[f]; c >= 0; c = F->sibling[c]) low = PetscMin(low, work->update[c]);
  work->top = work->update[f] = low;
  if (!below) return;
  if (row[0] < inside) {
    memmove(work->stack + low, U, (size_t)below * (size_t)below * sizeof(*U));
    work->top += (size_t)below * (size_t)below;
  } else {
    for (PetscInt c = 0; c < below; c++)
      for (PetscInt r = c; r < below; r++) S[(size_t)(row[r] - inside) + (size_t)F->kept * (size_t)(row[c] - inside)] += U[(size_t)r + (size_t)below * (size_t)c];
  }
}

/* The fronts one after the other; *bad becomes the row of the first pivot block that is not positive definite */
static void FRONT(LatinFrontsEliminate)(LatinFronts *F, FRONT(LatinFrontsWork) * work, const PetscInt i[], const PetscInt j[], const PetscScalar a[], PetscReal S[], PetscInt *bad)
{
  for (PetscInt f = 0; f < F->fronts && *bad < 0; f++) {
    FRONT_REAL *panel = work->narrow ? work->panel : (FRONT_REAL *)F->factor + F->panel[f], *U = work->stack + work->top;

    if (!F->columns[f]) continue;
    FRONT(LatinFrontEntries)(F, work, f, i, j, a, panel);
    for (PetscInt c = F->child[f]; c >= 0; c = F->sibling[c]) FRONT(LatinFrontAdd)(F, work, f, c, panel, NULL);
    if (!FRONT(LatinFrontEliminate)(F, f, panel, U) || (work->narrow && !FRONT(LatinFrontRound)(F, f, panel, (float *)F->factor + F->panel[f]))) *bad = F->order[F->first[f]];
    for (PetscInt c = F->child[f]; c >= 0 && *bad < 0; c = F->sibling[c]) FRONT(LatinFrontAdd)(F, work, f, c, NULL, U);
    FRONT(LatinFrontLeave)(F, work, f, U, S);
  }
  /* the block of the kept rows itself */
  for (PetscInt c = 0, inside = F->n - F->kept; c < F->kept; c++)
    for (PetscInt own = F->order[inside + c], k = i[own]; k < i[own + 1]; k++)
      if (work->place[j[k]] >= inside + c) S[(size_t)(work->place[j[k]] - inside) + (size_t)F->kept * (size_t)c] += a[k];
}

/* All of the factorisation, see LatinFrontsFactor() */
static PetscErrorCode FRONT(LatinFrontsFactor)(LatinFronts *F, const PetscInt i[], const PetscInt j[], const PetscScalar a[], PetscReal S[], PetscInt *bad)
{
  FRONT(LatinFrontsWork) work = {.top = 0, .narrow = (PetscBool)(F->precision == LATIN_ROUNDED)};

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(F->stack, &work.stack));
  PetscCall(PetscMalloc1(work.narrow ? F->widest : 0, &work.panel));
  PetscCall(PetscMalloc4(F->fronts, &work.update, F->n, &work.place, F->n, &work.at, F->tallest, &work.to));
  for (PetscInt r = 0; r < F->n; r++) work.place[F->order[r]] = r;
  FRONT(LatinFrontsEliminate)(F, &work, i, j, a, S, bad);
  PetscCall(PetscFree4(work.update, work.place, work.at, work.to));
  PetscCall(PetscFree(work.panel));
  PetscCall(PetscFree(work.stack));
  PetscFunctionReturn(0);
}

/* ---- solves ---- */

/* x = L^-1 x for the rows of front f, and what that leaves is taken from the rows below */
static void FRONT(LatinFrontForward)(const LatinFronts *F, PetscInt f, PetscBLASInt columns)
{
  const PetscInt    *row   = F->row + F->row_first[f] + F->columns[f];
  const FRONT_REAL  *panel = (const FRONT_REAL *)F->factor + F->panel[f], one = 1, zero = 0;
  const PetscBLASInt own = (PetscBLASInt)F->columns[f], height = (PetscBLASInt)(F->row_first[f + 1] - F->row_first[f]), below = height - own, n = (PetscBLASInt)F->n, inc = 1;
  FRONT_REAL        *x = (FRONT_REAL *)F->x + F->first[f], *work = (FRONT_REAL *)F->work;

  if (columns == 1) FRONT_BLAS(trsv)("L", "N", "N", &own, panel, &height, x, &inc);
  else FRONT_BLAS(trsm)("L", "L", "N", "N", &own, &columns, &one, panel, &height, x, &n);
  if (!below) return;
  if (columns == 1) FRONT_BLAS(gemv)("N", &below, &own, &one, panel + own, &height, x, &inc, &zero, work, &inc);
  else FRONT_BLAS(gemm)("N", "N", &below, &columns, &own, &one, panel + own, &height, x, &n, &zero, work, &below);
  x = (FRONT_REAL *)F->x;
  for (PetscBLASInt c = 0; c < columns; c++, x += n, work += below)
    for (PetscBLASInt r = 0; r < below; r++) x[row[r]] -= work[r];
}

/* x = L^-t x for the rows of front f, those below being known */
static void FRONT(LatinFrontBackward)(const LatinFronts *F, PetscInt f, PetscBLASInt columns)
{
  const PetscInt    *row   = F->row + F->row_first[f] + F->columns[f];
  const FRONT_REAL  *panel = (const FRONT_REAL *)F->factor + F->panel[f], one = 1, minus = -1;
  const PetscBLASInt own = (PetscBLASInt)F->columns[f], height = (PetscBLASInt)(F->row_first[f + 1] - F->row_first[f]), below = height - own, n = (PetscBLASInt)F->n, inc = 1;
  FRONT_REAL        *x = (FRONT_REAL *)F->x, *work = (FRONT_REAL *)F->work;

  for (PetscBLASInt c = 0; c < columns; c++, x += n, work += below)
    for (PetscBLASInt r = 0; r < below; r++) work[r] = x[row[r]];
  x    = (FRONT_REAL *)F->x + F->first[f];
  work = (FRONT_REAL *)F->work;
  if (below && columns == 1) FRONT_BLAS(gemv)("T", &below, &own, &minus, panel + own, &height, work, &inc, &one, x, &inc);
  else if (below) FRONT_BLAS(gemm)("T", "N", &own, &columns, &below, &minus, panel + own, &height, work, &below, &one, x, &n);
  if (columns == 1) FRONT_BLAS(trsv)("L", "T", "N", &own, panel, &height, x, &inc);
  else FRONT_BLAS(trsm)("L", "L", "T", "N", &own, &columns, &one, panel, &height, x, &n);
}

/*
   See LatinFrontsSolve(). Each column is solved as one with largest entry 1, which any precision holds. What is on kept rows
   is not rounded: forces on interfaces do not vanish as the iteration converges
*/
static void FRONT(LatinFrontsHalves)(LatinFronts *F, PetscBool forward, PetscBool backward, PetscInt columns, PetscReal b[], size_t ld, PetscReal *energy)
{
  const PetscInt inside = F->n - F->kept, loaded = forward ? inside : F->n;
  PetscReal      scale[LATIN_BATCH_COLUMNS], sum = 0.0;

  for (PetscInt c = 0; c < columns; c++) {
    FRONT_REAL *x      = (FRONT_REAL *)F->x + (size_t)F->n * (size_t)c;
    PetscReal  *column = b + ld * (size_t)c;

    scale[c] = 0.0;
    for (PetscInt r = 0; r < loaded; r++) scale[c] = PetscMax(scale[c], PetscAbsReal(column[F->order[r]]));
    if (!(scale[c] > 0.0)) scale[c] = 1.0;
    for (PetscInt r = 0; r < loaded; r++) x[r] = (FRONT_REAL)(column[F->order[r]] / scale[c]);
    for (PetscInt r = loaded; r < F->n; r++) x[r] = 0;
  }
  for (PetscInt f = 0; f < F->fronts && forward; f++)
    if (F->columns[f]) FRONT(LatinFrontForward)(F, f, (PetscBLASInt)columns);
  for (PetscInt c = 0; c < columns && forward && backward && F->kept; c++) memset((FRONT_REAL *)F->x + (size_t)F->n * (size_t)c + inside, 0, (size_t)F->kept * sizeof(FRONT_REAL));
  for (PetscInt f = F->fronts - 1; f >= 0 && backward; f--)
    if (F->columns[f]) FRONT(LatinFrontBackward)(F, f, (PetscBLASInt)columns);
  for (PetscInt c = 0; c < columns; c++) {
    const FRONT_REAL *x      = (const FRONT_REAL *)F->x + (size_t)F->n * (size_t)c;
    PetscReal        *column = b + ld * (size_t)c;

    for (PetscInt r = 0; r < inside; r++) {
      const PetscReal before = column[F->order[r]];

      column[F->order[r]] = scale[c] * (PetscReal)x[r];
      sum += column[F->order[r]] * (backward ? before : column[F->order[r]]);
    }
    for (PetscInt r = inside; r < F->n && forward; r++) column[F->order[r]] += scale[c] * (PetscReal)x[r];
  }
  if (energy && forward) *energy += sum;
}

/* ---- solves for LATIN_FRONT_LANES right-hand sides that lie beside each other, [rows][lanes] ---- */

/* The rows of front f forward, see LatinFrontForward() */
LATIN_INLINE void FRONT(LatinFrontForwardLanes)(const LatinFronts *F, PetscInt f)
{
  const PetscInt    *row   = F->row + F->row_first[f] + F->columns[f];
  const FRONT_REAL  *panel = (const FRONT_REAL *)F->factor + F->panel[f], one = 1, zero = 0;
  const PetscBLASInt own = (PetscBLASInt)F->columns[f], height = (PetscBLASInt)(F->row_first[f + 1] - F->row_first[f]), below = height - own, lanes = LATIN_FRONT_LANES;
  FRONT_REAL        *x = (FRONT_REAL *)F->x + LATIN_FRONT_LANES * (size_t)F->first[f], *work = (FRONT_REAL *)F->work;

  FRONT_BLAS(trsm)("R", "L", "T", "N", &lanes, &own, &one, panel, &height, x, &lanes);
  if (!below) return;
  FRONT_BLAS(gemm)("N", "T", &lanes, &below, &own, &one, x, &lanes, panel + own, &height, &zero, work, &lanes);
  for (PetscBLASInt r = 0; r < below; r++, work += LATIN_FRONT_LANES) {
    x = (FRONT_REAL *)F->x + LATIN_FRONT_LANES * (size_t)row[r];
    for (PetscInt w = 0; w < LATIN_FRONT_LANES; w++) x[w] -= work[w];
  }
}

/* The rows of front f backward, see LatinFrontBackward() */
LATIN_INLINE void FRONT(LatinFrontBackwardLanes)(const LatinFronts *F, PetscInt f)
{
  const PetscInt    *row   = F->row + F->row_first[f] + F->columns[f];
  const FRONT_REAL  *panel = (const FRONT_REAL *)F->factor + F->panel[f], one = 1, minus = -1;
  const PetscBLASInt own = (PetscBLASInt)F->columns[f], height = (PetscBLASInt)(F->row_first[f + 1] - F->row_first[f]), below = height - own, lanes = LATIN_FRONT_LANES;
  FRONT_REAL        *x = (FRONT_REAL *)F->x + LATIN_FRONT_LANES * (size_t)F->first[f], *work = (FRONT_REAL *)F->work;

  for (PetscBLASInt r = 0; r < below; r++) memcpy(work + LATIN_FRONT_LANES * (size_t)r, (FRONT_REAL *)F->x + LATIN_FRONT_LANES * (size_t)row[r], LATIN_FRONT_LANES * sizeof(*x));
  if (below) FRONT_BLAS(gemm)("N", "N", &lanes, &own, &below, &minus, work, &lanes, panel + own, &height, &one, x, &lanes);
  FRONT_BLAS(trsm)("R", "L", "N", "N", &lanes, &own, &one, panel, &height, x, &lanes);
}

/* See LatinFrontsSolveLanes() */
LATIN_CLONES static void FRONT(LatinFrontsLanes)(LatinFronts *F, const PetscInt at[], const PetscReal scale[], const PetscReal b[], PetscReal x[])
{
  FRONT_REAL *v = (FRONT_REAL *)F->x;

  for (PetscInt r = 0; r < F->n; r++, v += LATIN_FRONT_LANES) {
    const PetscReal *from = b + LATIN_FRONT_LANES * (size_t)at[F->order[r]];

    for (PetscInt w = 0; w < LATIN_FRONT_LANES; w++) v[w] = (FRONT_REAL)(from[w] / scale[w]);
  }
  for (PetscInt f = 0; f < F->fronts; f++) FRONT(LatinFrontForwardLanes)(F, f);
  for (PetscInt f = F->fronts - 1; f >= 0; f--) FRONT(LatinFrontBackwardLanes)(F, f);
  v = (FRONT_REAL *)F->x;
  for (PetscInt r = 0; r < F->n; r++, v += LATIN_FRONT_LANES) {
    PetscReal *to = x + LATIN_FRONT_LANES * (size_t)at[F->order[r]];

    for (PetscInt w = 0; w < LATIN_FRONT_LANES; w++) to[w] = scale[w] * (PetscReal)v[w];
  }
}
