#include "latinimpl.h"

/*
   The micro search direction D of the interfaces, the same on both sides: a positive number a side degree of freedom,
   or a symmetric positive definite matrix. Self-tuned: a fraction of the mean stiffness that the two subdomains show
   at the interface, see stiffness.c. Section 6 explains why a stiffness of the subdomain is the right scale; the
   fraction is a property of the iteration, not of the units.

     scalar    the mean over the interface of the diagonal of B^t k B
     diagonal  that diagonal
     block     its block on the interface
     schur     its Schur complement on the interface
     auto      of a preconditioner of a matrix: schur on the interfaces of subdomains that have small ones only, where
               it costs next to nothing, and on those of subdomains where the coefficients jump (jumps.c), for that is
               where it saves iterations; diagonal on the others. Elsewhere schur

   A matrix is stored once for equal ones, with its Cholesky factor, D = L L^t, and the inverse of that.
   The other stages know no more of a direction than the functions of this file.
*/

#define LATIN_DIRECTION_FLOOR 0.1 /* least diagonal direction of an interface, relative to its mean */
#define LATIN_DIRECTION_LARGE 128 /* those whose matrix LAPACK factors */
#define LATIN_DIRECTION_SMALL 48  /* degrees of freedom of an interface whose Schur complement costs nothing */

/* The type; auto is left for what preconditions a matrix only */
LatinDirectionType LatinDirectionKind(Latin latin)
{
  return latin->direction == LATIN_DIRECTION_AUTO && !(latin->matrix && latin->preconditions) ? LATIN_DIRECTION_SCHUR : latin->direction;
}

/*
   What is given, or the default of the type: least iterations over many structures, regular and irregular. In a
   preconditioner the springs only keep the subdomains' operators regular; those of a matrix seldom have mechanisms.
*/
PetscReal LatinDirectionFraction(Latin latin)
{
  const PetscReal fraction[] = {0.08, 0.08, 0.25, 1.0, 1.0};

  if (latin->direction_fraction > 0.0) return latin->direction_fraction;
  if (latin->preconditions) return latin->matrix ? 0.001 : 0.1;
  return fraction[latin->direction];
}

/* The stiffness of two springs in a row, doubled: a mean in which the softer one counts */
static inline PetscReal LatinHarmonic(PetscReal a, PetscReal b)
{
  return a > 0.0 && b > 0.0 ? 2.0 * a / (1.0 + a / b) : 0.0;
}

static PetscErrorCode LatinDirectionDiagonal_Private(Latin latin, PetscReal fraction)
{
  LatinInterfaces *inter = &latin->inter;
  PetscReal       *diagonal, *mine, *mate, sum[2] = {0.0, 0.0}, fallback;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(latin->sub.bs * latin->sub.copies, &diagonal, inter->sides, &mine, inter->sides, &mate));
  PetscCall(LatinOperatorDiagonal(latin, diagonal));
  for (PetscInt k = 0; k < inter->sides; k++) mine[k] = diagonal[inter->side_dof[k]];
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, mate));
  for (PetscInt k = 0; k < inter->sides; k++) sum[0] += 0.5 * (mine[k] + mate[k]);
  sum[1] = inter->sides;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  fallback = sum[0] > 0.0 ? sum[0] / sum[1] : 1.0;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    PetscReal             mean = 0.0;

    /* the sums run over the same numbers in the same order on both sides: the results are the same to the bit */
    for (PetscInt k = face->side_first; k < face->side_last; k++) mean += 0.5 * (mine[k] + mate[k]);
    if (face->side_last > face->side_first) mean /= face->side_last - face->side_first;
    if (!(mean > 0.0)) mean = fallback; /* no link of the two subdomains pulls in these directions */
    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      /* a dof that hardly any link reaches must not lose its spring: K_E stays regular thanks to it */
      const PetscReal own = PetscMax(0.5 * (mine[k] + mate[k]), LATIN_DIRECTION_FLOOR * mean);

      latin->macro.d[k]    = fraction * (latin->direction == LATIN_DIRECTION_SCALAR ? mean : own);
      latin->macro.soft[k] = LatinHarmonic(mine[k], mate[k]);
    }
  }
  PetscCall(PetscFree3(diagonal, mine, mate));
  PetscFunctionReturn(0);
}

/* ---- matrices ---- */

/* Lower Cholesky factor in place, upper part zero. Plain loops: equal matrices give equal bits wherever they lie in memory. */
static PetscBool LatinCholesky(PetscInt n, PetscReal A[])
{
  for (PetscInt j = 0; j < n; j++) {
    for (PetscInt i = 0; i < j; i++) A[i + n * j] = 0.0;
    if (!(A[j + n * j] > 0.0) || PetscIsInfOrNanReal(A[j + n * j])) return PETSC_FALSE;
    A[j + n * j] = PetscSqrtReal(A[j + n * j]);
    for (PetscInt i = j + 1; i < n; i++) A[i + n * j] /= A[j + n * j];
    for (PetscInt k = j + 1; k < n; k++)
      for (PetscInt i = k; i < n; i++) A[i + n * k] -= A[i + n * j] * A[k + n * j];
  }
  return PETSC_TRUE;
}

/* The inverse M of a lower triangular matrix L, upper part zero */
static void LatinInvert(PetscInt n, const PetscReal L[], PetscReal M[])
{
  for (PetscInt j = 0; j < n; j++) {
    PetscReal *v = M + n * j;

    for (PetscInt i = 0; i < n; i++) v[i] = i == j ? 1.0 : 0.0;
    for (PetscInt k = j; k < n; k++) {
      v[k] /= L[k + n * k];
      for (PetscInt i = k + 1; i < n; i++) v[i] -= L[i + n * k] * v[k];
    }
  }
}

/* The same two of a large matrix, whose place in memory matters less than blocks that fit the cache */
static PetscErrorCode LatinFactorLarge_Private(PetscInt rows, PetscReal L[], PetscReal M[], PetscBool *bad)
{
  const PetscScalar one = 1.0;
  PetscBLASInt      n, info = 0;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(rows, &n));
  for (PetscInt j = 0; j < rows; j++)
    for (PetscInt i = 0; i < j; i++) L[i + rows * j] = 0.0;
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &n, L, &n, &info));
  PetscCall(PetscArrayzero(M, rows * rows));
  for (PetscInt j = 0; j < rows; j++) M[j + rows * j] = 1.0;
  if (!info) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "N", "N", &n, &n, &one, L, &n, M, &n));
  if (info) *bad = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Factors the matrices D + first[f], each different one once */
static PetscErrorCode LatinDirectionFactor_Private(Latin latin, const PetscReal D[], const size_t first[], PetscBool *bad)
{
  LatinInterfaces *inter = &latin->inter;
  PetscInt        *pattern, used = 0;
  size_t          *bytes;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(inter->count, &pattern, inter->count + 1, &bytes));
  for (PetscInt f = 0; f <= inter->count; f++) bytes[f] = first[f] * sizeof(*D);
  PetscCall(LatinFindEqual(inter->count, bytes, D, pattern));
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];

    if (first[f + 1] == first[f]) face->matrix_first = -1;
    else if (pattern[f] != f) face->matrix_first = inter->interface[pattern[f]].matrix_first;
    else {
      face->matrix_first = used;
      used += 3 * (PetscInt)(first[f + 1] - first[f]);
    }
  }
  PetscCall(PetscMalloc1(used + 1, &latin->macro.matrix)); /* not NULL on a rank without interfaces either */
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face   = &inter->interface[f];
    const PetscInt        rows   = face->side_last - face->side_first;
    PetscReal            *matrix = latin->macro.matrix + PetscMax(face->matrix_first, 0);

    if (face->matrix_first < 0 || pattern[f] != f) continue;
    for (PetscInt copy = 0; copy < 2; copy++) PetscCall(PetscArraycpy(matrix + copy * rows * rows, D + first[f], rows * rows));
    if (rows > LATIN_DIRECTION_LARGE) PetscCall(LatinFactorLarge_Private(rows, matrix + rows * rows, matrix + 2 * rows * rows, bad));
    else if (!LatinCholesky(rows, matrix + rows * rows)) *bad = PETSC_TRUE;
    else LatinInvert(rows, matrix + rows * rows, matrix + 2 * rows * rows);
  }
  PetscCall(PetscFree2(pattern, bytes));
  PetscFunctionReturn(0);
}

#define LATIN_DIRECTION_COLUMNS 16 /* exchanged together */

/* D + first[f], the mean of the two sides' matrices S + from[f], exchanged by some columns at a time; and what of them is kept in vectors */
static PetscErrorCode LatinDirectionMean_Private(Latin latin, PetscReal fraction, const PetscReal S[], const size_t from[], const size_t first[], PetscReal D[])
{
  const PetscInt   columns = LATIN_DIRECTION_COLUMNS;
  LatinInterfaces *inter   = &latin->inter;
  PetscInt         widest  = 0;
  PetscReal       *mine, *mate;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++)
    if (first[f + 1] > first[f]) widest = PetscMax(widest, inter->interface[f].side_last - inter->interface[f].side_first);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)latin)));
  PetscCall(PetscCalloc2(columns * inter->sides, &mine, columns * inter->sides, &mate));
  for (PetscInt j = 0; j < widest; j += columns) {
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscInt        rows = face->side_last - face->side_first;

      for (PetscInt c = j; c < PetscMin(j + columns, rows) && first[f + 1] > first[f]; c++)
        for (PetscInt r = 0; r < rows; r++) mine[columns * (face->side_first + r) + c - j] = S[from[f] + (size_t)r + (size_t)rows * (size_t)c];
    }
    PetscCall(LatinSFBcast_Private(inter->mate_sf, columns, MPIU_REAL, mine, mate));
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscInt        rows = face->side_last - face->side_first;

      for (PetscInt c = j; c < PetscMin(j + columns, rows) && first[f + 1] > first[f]; c++) {
        const PetscReal *a = mine + columns * face->side_first + c - j, *b = mate + columns * face->side_first + c - j;
        PetscReal       *column = D + first[f] + (size_t)rows * (size_t)c;

        for (PetscInt r = 0; r < rows; r++) column[r] = fraction * 0.5 * (a[columns * r] + b[columns * r]);
        latin->macro.d[face->side_first + c]    = column[c];
        latin->macro.soft[face->side_first + c] = LatinHarmonic(a[columns * c], b[columns * c]);
      }
    }
  }
  PetscCall(PetscFree2(mine, mate));
  PetscFunctionReturn(0);
}

/* The interfaces with whole[f] */
static PetscErrorCode LatinDirectionMatrix_Private(Latin latin, PetscReal fraction, const PetscBool whole[])
{
  LatinInterfaces *inter = &latin->inter;
  size_t          *from, *first;
  PetscReal       *S, *D;
  PetscBool        bad = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(inter->count, &from, inter->count + 1, &first));
  PetscCall(LatinStiffnessFaces_Private(latin, whole, from, &S));
  first[0] = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    const size_t rows = (size_t)(inter->interface[f].side_last - inter->interface[f].side_first);

    first[f + 1] = first[f] + (whole[f] ? rows * rows : 0);
  }
  PetscCall(PetscMalloc1(first[inter->count], &D));
  PetscCall(LatinDirectionMean_Private(latin, fraction, S, from, first, D));
  if (latin->share) {
    PetscCall(PetscMalloc1(inter->count, &latin->macro.own_first));
    PetscCall(PetscArraycpy(latin->macro.own_first, from, inter->count));
    latin->macro.own  = S;
    latin->macro.mean = 0.5 * fraction;
  } else PetscCall(PetscFree(S));
  PetscCall(LatinDirectionFactor_Private(latin, D, first, &bad));
  PetscCall(PetscFree(D));
  PetscCall(PetscFree2(from, first));
  LatinAgree(PetscObjectComm((PetscObject)latin), bad, PETSC_ERR_MAT_CH_ZRPVT, "The search direction %s of an interface is not positive definite to rounding; choose another -%sdirection, e.g. diagonal", LatinDirectionTypes[latin->direction],
             ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "");
  PetscFunctionReturn(0);
}

/*
   whole[f] of type auto: interfaces of subdomains where coefficients jump, or of two subdomains all of whose interfaces
   are small, or which have been condensed on them. A subdomain with matrices on some of its interfaces alone pays for them without saving an iteration.
   Collective on latin.
*/
static PetscErrorCode LatinDirectionAuto_Private(Latin latin, PetscBool whole[])
{
  LatinInterfaces *inter = &latin->inter;
  PetscInt        *mine, *mate;

  PetscFunctionBegin;
  PetscCall(LatinJumpsFaces_Private(latin, whole));
  PetscCall(PetscMalloc2(inter->sides, &mine, inter->sides, &mate));
  for (PetscInt s = 0; s < latin->sub.n; s++) {
    PetscInt largest = 0;

    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) largest = PetscMax(largest, inter->interface[f].side_last - inter->interface[f].side_first);
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++)
      for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) mine[k] = latin->interior || largest <= LATIN_DIRECTION_SMALL ? 1 : 0;
  }
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_INT, mine, mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    if (face->side_last > face->side_first && mine[face->side_first] && mate[face->side_first]) whole[f] = PETSC_TRUE;
  }
  PetscCall(PetscFree2(mine, mate));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDirectionSetUp(Latin latin)
{
  const LatinDirectionType kind     = LatinDirectionKind(latin);
  const PetscReal          fraction = LatinDirectionFraction(latin);
  LatinInterfaces         *inter    = &latin->inter;
  PetscBool               *whole;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Direction, latin, 0, 0, 0));
  PetscCall(PetscMalloc1(inter->count, &whole));
  for (PetscInt f = 0; f < inter->count; f++) {
    inter->interface[f].matrix_first = -1;
    whole[f]                         = (PetscBool)(latin->direction_scalar == 0.0 && (kind == LATIN_DIRECTION_BLOCK || kind == LATIN_DIRECTION_SCHUR));
  }
  PetscCall(PetscMalloc1(inter->sides, &latin->macro.d));
  PetscCall(PetscMalloc1(inter->sides, &latin->macro.soft));
  if (latin->direction_scalar > 0.0) {
    for (PetscInt k = 0; k < inter->sides; k++) latin->macro.d[k] = latin->macro.soft[k] = latin->direction_scalar;
  } else if (kind != LATIN_DIRECTION_BLOCK && kind != LATIN_DIRECTION_SCHUR) PetscCall(LatinDirectionDiagonal_Private(latin, fraction));
  if (kind == LATIN_DIRECTION_AUTO && latin->direction_scalar == 0.0) PetscCall(LatinDirectionAuto_Private(latin, whole));
  latin->macro.whole = 0;
  for (PetscInt f = 0; f < inter->count; f++) { latin->macro.whole += whole[f] && latin->sub.first + inter->interface[f].sub < inter->interface[f].neighbour ? 1 : 0; }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &latin->macro.whole, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)latin)));
  if (latin->macro.whole) PetscCall(LatinDirectionMatrix_Private(latin, fraction, whole));
  PetscCall(PetscFree(whole));
  PetscCall(PetscLogEventEnd(LATIN_Direction, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDirectionReset(Latin latin)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(latin->macro.d));
  PetscCall(PetscFree(latin->macro.soft));
  PetscCall(PetscFree(latin->macro.matrix));
  PetscCall(PetscFree(latin->macro.own));
  PetscCall(PetscFree(latin->macro.own_first));
  PetscCall(PetscFree(latin->macro.like));
  PetscFunctionReturn(0);
}

/* ---- what the other stages do with a direction: arguments are n vectors on the side dofs of one interface, ld apart ---- */

/* Y = A X with a square matrix; a call of BLAS would cost more than one short product */
static PetscErrorCode LatinMultiply_Private(PetscInt rows, PetscInt n, const PetscReal A[], const PetscReal x[], PetscInt ldx, PetscReal y[], PetscInt ldy)
{
  const PetscScalar one = 1.0, zero = 0.0;
  PetscBLASInt      br, bn, bx, by;

  PetscFunctionBegin;
  if (n == 1 && rows < 64) {
    for (PetscInt r = 0; r < rows; r++) y[r] = 0.0;
    for (PetscInt k = 0; k < rows; k++)
      for (PetscInt r = 0; r < rows; r++) y[r] += A[r + rows * k] * x[k];
    PetscFunctionReturn(0);
  }
  PetscCall(PetscBLASIntCast(rows, &br));
  PetscCall(PetscBLASIntCast(n, &bn));
  PetscCall(PetscBLASIntCast(ldx, &bx));
  PetscCall(PetscBLASIntCast(ldy, &by));
  if (rows) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &br, &bn, &br, &one, A, &br, x, &bx, &zero, y, &by));
  PetscFunctionReturn(0);
}

/* Y = D X */
PetscErrorCode LatinDirectionApply(Latin latin, const LatinInterface *face, PetscInt n, const PetscReal x[], PetscInt ldx, PetscReal y[], PetscInt ldy)
{
  const PetscInt   rows = face->side_last - face->side_first;
  const PetscReal *d    = latin->macro.d + face->side_first;

  PetscFunctionBegin;
  if (face->matrix_first >= 0) PetscCall(LatinMultiply_Private(rows, n, latin->macro.matrix + face->matrix_first, x, ldx, y, ldy));
  else {
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt r = 0; r < rows; r++) y[ldy * k + r] = d[r] * x[ldx * k + r];
  }
  PetscFunctionReturn(0);
}

/* sum += (a - b)^t D^-1 (a - b) / 4 of all columns: with a - b = 2 D v, the energy v^t D v */
PetscErrorCode LatinDirectionEnergy(Latin latin, const LatinInterface *face, PetscInt n, const PetscReal a[], const PetscReal b[], PetscInt ld, PetscReal *sum)
{
  const PetscInt   rows = face->side_last - face->side_first;
  const PetscReal *d    = latin->macro.d + face->side_first;
  PetscReal       *v = latin->direction_work, *w = v + rows * n, energy = 0.0;

  PetscFunctionBegin;
  if (face->matrix_first < 0) {
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt r = 0; r < rows; r++) energy += PetscSqr(a[ld * k + r] - b[ld * k + r]) / d[r];
  } else {
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt r = 0; r < rows; r++) v[rows * k + r] = a[ld * k + r] - b[ld * k + r];
    PetscCall(LatinMultiply_Private(rows, n, latin->macro.matrix + face->matrix_first + 2 * rows * rows, v, rows, w, rows));
    for (PetscInt r = 0; r < rows * n; r++) energy += w[r] * w[r];
  }
  *sum += 0.25 * energy;
  PetscFunctionReturn(0);
}

/* Springs that a diagonal direction puts on the copies, part of K_E (28) */
PetscErrorCode LatinDirectionSprings_Private(Latin latin, PetscReal spring[])
{
  LatinInterfaces *inter = &latin->inter;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(spring, latin->sub.bs * latin->sub.copies));
  for (PetscInt f = 0; f < inter->count; f++)
    if (inter->interface[f].matrix_first < 0)
      for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) spring[inter->side_dof[k]] += latin->macro.d[k];
  PetscFunctionReturn(0);
}

/* Row r of the matrix of an interface, contiguous for it is symmetric: what the springs of a matrix direction put in K_E */
void LatinDirectionRow(Latin latin, const LatinInterface *face, PetscInt r, const PetscReal *row[])
{
  *row = latin->macro.matrix + face->matrix_first + r * (face->side_last - face->side_first);
}

/*
   The part W x of displacements x, or W^t x of forces, that this side of interface f has in it: W = (S + S')^-1 S from
   the stiffnesses of both sides, so that W + W' = 1. Of all means it is the one that costs least energy. Work space: twice the dofs of the interface.
*/
PetscErrorCode LatinDirectionShare(Latin latin, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[])
{
  const LatinInterface *face = &latin->inter.interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  const PetscReal      *S = latin->macro.own + latin->macro.own_first[f], *M = latin->macro.matrix + face->matrix_first + 2 * rows * rows;
  PetscReal            *y = work, *z = work + rows;
  const PetscScalar     one = 1.0, zero = 0.0, mean = latin->macro.mean;
  const PetscBLASInt    inc = 1;
  PetscBLASInt          n;

  PetscFunctionBegin;
  if (!rows) PetscFunctionReturn(0);
  PetscCall(PetscBLASIntCast(rows, &n));
  if (!forces) {
    PetscCallBLAS("BLASgemv", BLASgemv_("N", &n, &n, &one, S, &n, x, &inc, &zero, y, &inc));
    PetscCall(PetscArraycpy(x, y, rows));
  }
  /* D^-1 = M^t M, where D = L L^t and M = L^-1 */
  PetscCallBLAS("BLASgemv", BLASgemv_("N", &n, &n, &one, M, &n, x, &inc, &zero, y, &inc));
  PetscCallBLAS("BLASgemv", BLASgemv_("T", &n, &n, &mean, M, &n, y, &inc, &zero, z, &inc));
  if (forces) PetscCallBLAS("BLASgemv", BLASgemv_("N", &n, &n, &one, S, &n, z, &inc, &zero, x, &inc));
  else PetscCall(PetscArraycpy(x, z, rows));
  PetscFunctionReturn(0);
}

/* Makes the columns of R, orthonormal in the diagonal of a matrix direction, orthonormal in the matrix, with the same span */
PetscErrorCode LatinDirectionNormalise(Latin latin, const LatinInterface *face, PetscInt modes, PetscReal R[])
{
  const PetscInt     rows = face->side_last - face->side_first;
  const PetscScalar  one = 1.0, zero = 0.0;
  const PetscBLASInt inc = 1;
  PetscReal         *W, *G;
  PetscBLASInt       n, m;

  PetscFunctionBegin;
  if (face->matrix_first < 0 || !modes) PetscFunctionReturn(0);
  PetscCall(PetscBLASIntCast(rows, &n));
  PetscCall(PetscBLASIntCast(modes, &m));
  PetscCall(PetscMalloc2(rows * modes, &W, modes * modes, &G));
  for (PetscInt pass = 0; pass < 2; pass++) { /* twice: orthonormal to rounding though the first Gram matrix be ill-conditioned */
    PetscCall(PetscArraycpy(W, R, rows * modes));
    for (PetscInt j = 0; j < modes; j++) PetscCallBLAS("BLAStrmv", BLAStrmv_("L", "T", "N", &n, latin->macro.matrix + face->matrix_first + rows * rows, &n, W + rows * j, &inc));
    PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &m, &m, &n, &one, W, &n, W, &n, &zero, G, &m));
    PetscCheck(LatinCholesky(modes, G), PETSC_COMM_SELF, PETSC_ERR_PLIB, "The macro modes of an interface are dependent in its search direction");
    PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &n, &m, &one, G, &m, R, &n));
  }
  PetscCall(PetscFree2(W, G));
  PetscFunctionReturn(0);
}
