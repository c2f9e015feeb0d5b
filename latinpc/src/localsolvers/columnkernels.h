/*
   Triangular solves with the columns of a panel and one right-hand side b, [height]; included once for each precision, as localsolvers/frontkernels.h.
   Kernels take 8 columns at a time, which registers hold, or the 3 of a node, and whole vectors of rows. These read beyond the last row by less than
   LATIN_LINE bytes: there the factor has finite numbers, and b zeros before backward substitution; forward substitution overwrites them. Numbers of
   columns are constants, so that loops unroll.
*/

typedef FRONT_REAL FRONT(LatinStrip) __attribute__((vector_size(LATIN_LINE), aligned(sizeof(FRONT_REAL)), may_alias));
typedef FRONT_REAL FRONT(LatinHalf) __attribute__((vector_size(LATIN_LINE / 2), may_alias));
typedef FRONT_REAL FRONT(LatinQuarter) __attribute__((vector_size(LATIN_LINE / 4), may_alias));

/* Returns the sum of the entries of a vector */
LATIN_INLINE FRONT_REAL FRONT(LatinStripSum)(FRONT(LatinStrip) strip)
{
  union
  {
    FRONT(LatinStrip) whole;
    FRONT(LatinHalf) part[2];
  } halves = {strip};
  union
  {
    FRONT(LatinHalf) whole;
    FRONT(LatinQuarter) part[2];
  } quarters               = {halves.part[0] + halves.part[1]};
  FRONT(LatinQuarter) four = quarters.part[0] + quarters.part[1];
  FRONT_REAL sum           = 0;

  for (size_t k = 0; k < LATIN_LINE / 4 / sizeof(FRONT_REAL); k++) sum += four[k];
  return sum;
}

/* Forward substitution with some columns, and update of the rows below */
LATIN_INLINE void FRONT(LatinColumnsForward)(const PetscInt columns, PetscInt height, size_t ld, const FRONT_REAL L[], FRONT_REAL b[])
{
  FRONT_REAL x[LATIN_FRONT_ROWS];

  _Pragma("GCC unroll 8") for (PetscInt c = 0; c < columns; c++)
  {
    FRONT_REAL left = b[c];

    _Pragma("GCC unroll 8") for (PetscInt k = 0; k < c; k++) left -= L[ld * (size_t)k + (size_t)c] * x[k];
    b[c] = x[c] = left / L[ld * (size_t)c + (size_t)c];
  }
  for (PetscInt r = columns; r < height; r += LATIN_LINE / (PetscInt)sizeof(FRONT_REAL)) {
    FRONT(LatinStrip) *rows = (FRONT(LatinStrip) *)(b + r), left = *rows;

    _Pragma("GCC unroll 8") for (PetscInt c = 0; c < columns; c++)
    {
      const FRONT_REAL *column = L + ld * (size_t)c + (size_t)r;

      __builtin_prefetch((const char *)column + LATIN_FRONT_AHEAD, 0, 2);
      left -= *(const FRONT(LatinStrip) *)column * x[c];
    }
    *rows = left;
  }
}

/* Backward substitution with some columns; the rows below are known */
LATIN_INLINE void FRONT(LatinColumnsBackward)(const PetscInt columns, PetscInt height, size_t ld, const FRONT_REAL L[], FRONT_REAL b[])
{
  FRONT(LatinStrip) sum[LATIN_FRONT_ROWS] = {{0}};

  for (PetscInt r = columns; r < height; r += LATIN_LINE / (PetscInt)sizeof(FRONT_REAL)) {
    const FRONT(LatinStrip) rows = *(const FRONT(LatinStrip) *)(b + r);

    _Pragma("GCC unroll 8") for (PetscInt c = 0; c < columns; c++)
    {
      const FRONT_REAL *column = L + ld * (size_t)c + (size_t)r;

      __builtin_prefetch((const char *)column - LATIN_FRONT_AHEAD, 0, 2);
      sum[c] += *(const FRONT(LatinStrip) *)column * rows;
    }
  }
  _Pragma("GCC unroll 8") for (PetscInt c = columns - 1; c >= 0; c--)
  {
    FRONT_REAL left = b[c] - FRONT(LatinStripSum)(sum[c]);

    _Pragma("GCC unroll 8") for (PetscInt k = c + 1; k < columns; k++) left -= L[ld * (size_t)c + (size_t)k] * b[k];
    b[c] = left / L[ld * (size_t)c + (size_t)c];
  }
}

static LATIN_CLONES void FRONT(LatinPanelForward)(PetscInt own, PetscInt height, const FRONT_REAL L[], FRONT_REAL b[])
{
  const size_t ld = (size_t)height;

  for (; own >= 8; own -= 8, height -= 8, b += 8, L += 8 * (ld + 1)) FRONT(LatinColumnsForward)(8, height, ld, L, b);
  for (; own >= 3; own -= 3, height -= 3, b += 3, L += 3 * (ld + 1)) FRONT(LatinColumnsForward)(3, height, ld, L, b);
  for (; own >= 1; own--, height--, b++, L += ld + 1) FRONT(LatinColumnsForward)(1, height, ld, L, b);
}

static LATIN_CLONES void FRONT(LatinPanelBackward)(PetscInt own, PetscInt height, const FRONT_REAL L[], FRONT_REAL b[])
{
  const size_t ld = (size_t)height;
  PetscInt     c  = own;

  for (; c >= 8; c -= 8) FRONT(LatinColumnsBackward)(8, height - c + 8, ld, L + (size_t)(c - 8) * (ld + 1), b + c - 8);
  for (; c >= 3; c -= 3) FRONT(LatinColumnsBackward)(3, height - c + 3, ld, L + (size_t)(c - 3) * (ld + 1), b + c - 3);
  for (; c >= 1; c--) FRONT(LatinColumnsBackward)(1, height - c + 1, ld, L + (size_t)(c - 1) * (ld + 1), b + c - 1);
}
