/*
   Cholesky factorisation of the columns of a front, by panels; included once for each precision, as localsolvers/frontkernels.h, which
   defines FRONT_REAL, FRONT_BLAS() and FRONT().
*/

/* Updates columns y and z by some columns X before them: the coefficients of two by four stay in registers */
LATIN_INLINE void FRONT(LatinPanelTake)(const PetscInt some, PetscInt rows, size_t height, const FRONT_REAL L[], const FRONT_REAL X[], FRONT_REAL y[restrict], FRONT_REAL z[restrict])
{
  FRONT_REAL l[4], m[4];

  for (PetscInt k = 0; k < some; k++) {
    l[k] = L[(size_t)k * height];
    m[k] = L[(size_t)k * height + 1];
  }
  _Pragma("omp simd") for (PetscInt i = 0; i < rows; i++)
  {
    FRONT_REAL s = y[i], t = z[i];

    _Pragma("GCC unroll 4") for (PetscInt k = 0; k < some; k++)
    {
      s -= l[k] * X[(size_t)k * height + (size_t)i];
      t -= m[k] * X[(size_t)k * height + (size_t)i];
    }
    y[i] = s;
    z[i] = t;
  }
}

/* Computes B = B L^-t for the rows of a panel below its triangle, in blocks that fit the first-level cache */
static LATIN_CLONES void FRONT(LatinPanelBelow)(PetscInt rows, PetscInt wide, const FRONT_REAL L[], size_t height, FRONT_REAL B[])
{
  FRONT_REAL none[LATIN_PANEL_ROWS] = {0}; /* partner of the last column if their number is odd */

  for (PetscInt r = 0; r < rows; r += LATIN_PANEL_ROWS) {
    const PetscInt some = PetscMin(LATIN_PANEL_ROWS, rows - r);
    FRONT_REAL    *X    = B + r;

    for (PetscInt c = 0; c < wide; c += 2) {
      const FRONT_REAL *l = L + c, *d = l + height * (size_t)c;
      FRONT_REAL       *y = X + height * (size_t)c, *z = c + 1 < wide ? y + height : none;
      FRONT_REAL        p = 1 / d[0], q = z == none ? 0 : 1 / d[height + 1], s = d[1];
      PetscInt          k = 0;

      for (; k + 4 <= c; k += 4) FRONT(LatinPanelTake)(4, some, height, l + height * (size_t)k, X + height * (size_t)k, y, z);
      if (k < c) FRONT(LatinPanelTake)(2, some, height, l + height * (size_t)k, X + height * (size_t)k, y, z);
      _Pragma("omp simd") for (PetscInt i = 0; i < some; i++)
      {
        y[i] *= p;
        z[i] = (z[i] - s * y[i]) * q;
      }
    }
  }
}

/* Factors one panel, with `below` rows below its triangle. Returns PETSC_FALSE if it is not positive definite */
static PetscBool FRONT(LatinPanel)(PetscBLASInt wide, PetscBLASInt below, FRONT_REAL panel[], PetscBLASInt ld)
{
  const FRONT_REAL one = 1;
  PetscBLASInt     info;

  FRONT_BLAS(potrf)("L", &wide, panel, &ld, &info);
  if (info || !(panel[(size_t)(wide - 1) * (size_t)(ld + 1)] > 0.0)) return PETSC_FALSE; /* refuses NaN */
  /* with vectors of 512 bits trsm of OpenBLAS takes as long as three products of that size; with shorter ones it is faster than this kernel */
  if (LatinClonesWide()) FRONT(LatinPanelBelow)(below, wide, panel, (size_t)ld, panel + wide);
  else if (below) FRONT_BLAS(trsm)("R", "L", "T", "N", &below, &wide, &one, panel, &ld, panel + wide, &ld);
  return PETSC_TRUE;
}

/*
   Factors the columns of a front, row r of column c at ld * c + r, by recursive halving down to panels. Returns PETSC_FALSE if they are not positive
   definite
*/
static PetscBool FRONT(LatinPanels)(PetscBLASInt columns, PetscBLASInt height, FRONT_REAL front[], PetscBLASInt ld)
{
  const FRONT_REAL   minus = -1, one = 1;
  const PetscBLASInt half = (columns / 2 + LATIN_FRONT_PANEL - 1) / LATIN_FRONT_PANEL * LATIN_FRONT_PANEL, rest = columns - half, below = height - columns;
  FRONT_REAL        *later = front + (size_t)half * (size_t)(ld + 1);

  if (columns <= LATIN_FRONT_PANEL) return FRONT(LatinPanel)(columns, below, front, ld);
  if (!FRONT(LatinPanels)(half, height, front, ld)) return PETSC_FALSE;
  FRONT_BLAS(syrk)("L", "N", &rest, &half, &minus, front + half, &ld, &one, later, &ld);
  if (below) FRONT_BLAS(gemm)("N", "T", &below, &rest, &half, &minus, front + columns, &ld, front + half, &ld, &one, later + rest, &ld);
  return FRONT(LatinPanels)(rest, height - half, later, ld);
}
