/*
   Triangular solves for LATIN_FRONT_LANES interleaved right-hand sides, [rows][lanes]; included once for each precision, as
   localsolvers/frontkernels.h. A row of all lanes is a vector type, which the compiler splits into registers. Some rows of a
   front at a time stay in registers, and each entry of the factor is read once. Numbers of rows are constants, so that loops
   unroll.
*/

typedef FRONT_REAL FRONT(LatinLanes) __attribute__((vector_size(LATIN_FRONT_LANES * sizeof(FRONT_REAL)), aligned(LATIN_LINE), may_alias));

/* Adds L[i, c] y[c], over all columns c, to s[i] of some rows */
LATIN_INLINE void FRONT(LatinLanesRows)(const PetscInt rows, PetscInt columns, const FRONT_REAL L[], size_t height, const FRONT(LatinLanes) y[], FRONT(LatinLanes) s[])
{
  for (PetscInt c = 0; c < columns; c++, L += height) { _Pragma("GCC unroll 8") for (PetscInt i = 0; i < rows; i++) s[i] += L[i] * y[c]; }
}

/* Forward substitution of rows r to r + rows - 1 that a front eliminates. Adds their squares to *energy */
LATIN_INLINE void FRONT(LatinLanesEliminate)(const PetscInt rows, PetscInt r, const FRONT_REAL L[], size_t height, FRONT(LatinLanes) y[], LatinLanesSum *energy)
{
  FRONT(LatinLanes) s[LATIN_FRONT_ROWS] = {{0}};

  FRONT(LatinLanesRows)(rows, r, L + r, height, y, s);
  L += (size_t)r * (height + 1);
  _Pragma("GCC unroll 8") for (PetscInt i = 0; i < rows; i++)
  {
    FRONT(LatinLanes) left = y[r + i] - s[i];

    _Pragma("GCC unroll 8") for (PetscInt k = 0; k < i; k++) left -= L[(size_t)k * height + (size_t)i] * y[r + k];
    left *= (FRONT_REAL)1 / L[(size_t)i * (height + 1)];
    LATIN_LANES_SQUARE(energy, left);
    y[r + i] = left;
  }
}

/* Updates rows r to r + rows - 1 below the eliminated ones */
LATIN_INLINE void FRONT(LatinLanesBelow)(const PetscInt rows, PetscInt r, PetscInt own, const FRONT_REAL L[], size_t height, const PetscInt row[], const FRONT(LatinLanes) y[], FRONT(LatinLanes) x[])
{
  FRONT(LatinLanes) s[LATIN_FRONT_ROWS] = {{0}};

  FRONT(LatinLanesRows)(rows, own, L + r, height, y, s);
  _Pragma("GCC unroll 8") for (PetscInt i = 0; i < rows; i++) x[row[r + i]] -= s[i];
}

/* Forward substitution with the panel of front f that begins with its column `at`, and update of the rows below */
LATIN_INLINE void FRONT(LatinLanesForward)(const LatinFronts *F, PetscInt f, PetscInt at, FRONT(LatinLanes) x[], LatinLanesSum *energy)
{
  const PetscInt   *row = F->row + F->row_first[f] + at, own = PetscMin(LATIN_FRONT_PANEL, F->columns[f] - at), height = F->row_first[f + 1] - F->row_first[f] - at;
  const FRONT_REAL *L  = (const FRONT_REAL *)F->factor + F->panel[f] + LatinPanelAt(LATIN_FRONT_PANEL, height + at, at);
  FRONT(LatinLanes) *y = x + F->first[f] + at;
  PetscInt r           = 0;

  for (; r + 4 <= own; r += 4) FRONT(LatinLanesEliminate)(4, r, L, (size_t)height, y, energy);
  for (; r < own; r++) FRONT(LatinLanesEliminate)(1, r, L, (size_t)height, y, energy);
  for (; r + 8 <= height; r += 8) FRONT(LatinLanesBelow)(8, r, own, L, (size_t)height, row, y, x);
  for (; r + 3 <= height; r += 3) FRONT(LatinLanesBelow)(3, r, own, L, (size_t)height, row, y, x);
  for (; r < height; r++) FRONT(LatinLanesBelow)(1, r, own, L, (size_t)height, row, y, x);
}

/* Backward substitution of rows c to c + rows - 1 that a front eliminates. Adds their squares to *square */
LATIN_INLINE void FRONT(LatinLanesReturn)(const PetscInt rows, PetscInt c, PetscInt own, const FRONT_REAL L[], size_t height, const PetscInt row[], FRONT(LatinLanes) y[], const FRONT(LatinLanes) x[], LatinLanesSum *square)
{
  FRONT(LatinLanes) s[LATIN_FRONT_ROWS] = {{0}};

  L += (size_t)c * height;
  for (PetscInt r = c + rows; r < own; r++) { _Pragma("GCC unroll 8") for (PetscInt i = 0; i < rows; i++) s[i] += L[(size_t)i * height + (size_t)r] * y[r]; }
  for (size_t r = (size_t)own; r < height; r++) { _Pragma("GCC unroll 8") for (PetscInt i = 0; i < rows; i++) s[i] += L[(size_t)i * height + r] * x[row[r]]; }
  L += c;
  _Pragma("GCC unroll 8") for (PetscInt i = rows - 1; i >= 0; i--)
  {
    FRONT(LatinLanes) left = y[c + i] - s[i];

    _Pragma("GCC unroll 8") for (PetscInt k = i + 1; k < rows; k++) left -= L[(size_t)i * height + (size_t)k] * y[c + k];
    left *= (FRONT_REAL)1 / L[(size_t)i * (height + 1)];
    LATIN_LANES_SQUARE(square, left);
    y[c + i] = left;
  }
}

/* Backward substitution with this panel; the rows below are known */
LATIN_INLINE void FRONT(LatinLanesBackward)(const LatinFronts *F, PetscInt f, PetscInt at, FRONT(LatinLanes) x[], LatinLanesSum *square)
{
  const PetscInt   *row = F->row + F->row_first[f] + at, own = PetscMin(LATIN_FRONT_PANEL, F->columns[f] - at), height = F->row_first[f + 1] - F->row_first[f] - at;
  const FRONT_REAL *L  = (const FRONT_REAL *)F->factor + F->panel[f] + LatinPanelAt(LATIN_FRONT_PANEL, height + at, at);
  FRONT(LatinLanes) *y = x + F->first[f] + at;
  PetscInt c           = own;

  for (; c >= 8; c -= 8) FRONT(LatinLanesReturn)(8, c - 8, own, L, (size_t)height, row, y, x, square);
  for (; c >= 3; c -= 3) FRONT(LatinLanesReturn)(3, c - 3, own, L, (size_t)height, row, y, x, square);
  for (; c > 0; c--) FRONT(LatinLanesReturn)(1, c - 1, own, L, (size_t)height, row, y, x, square);
}

/* Prefetches the panels of a front during the solve with another one */
LATIN_INLINE void FRONT(LatinLanesFetch)(const LatinFronts *F, PetscInt f)
{
  const FRONT_REAL *L = (const FRONT_REAL *)F->factor;

  for (size_t k = F->panel[f]; k < F->panel[f + 1]; k += LATIN_LINE / sizeof(*L)) __builtin_prefetch(L + k, 0, 2);
}

/* See LatinFrontsSolveLanes() */
LATIN_CLONES static void FRONT(LatinFrontsLanes)(LatinFronts *F, FRONT(LatinLanes) x[], LatinLanesSum *energy, LatinLanesSum *square)
{
  for (PetscInt f = 0; f < F->fronts; f++) {
    if (f + 1 < F->fronts) FRONT(LatinLanesFetch)(F, f + 1);
    for (PetscInt at = 0; at < F->columns[f]; at += LATIN_FRONT_PANEL) FRONT(LatinLanesForward)(F, f, at, x, energy);
  }
  for (PetscInt f = F->fronts - 1; f >= 0; f--) {
    if (f) FRONT(LatinLanesFetch)(F, f - 1);
    for (PetscInt at = LatinPanelLast(LATIN_FRONT_PANEL, F->columns[f]); at >= 0; at -= LATIN_FRONT_PANEL) FRONT(LatinLanesBackward)(F, f, at, x, square);
  }
}
