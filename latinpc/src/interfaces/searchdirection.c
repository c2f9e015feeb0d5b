#include "interfaces/latininterfaces.h"

/*
   The micro search direction D of the interfaces, the same on both sides: a positive number for each side dof, or a symmetric positive definite matrix.
   By default, a fraction of the mean stiffness of the two subdomains at the interface, see interfaces/interfacestiffness.c. Section 6 explains why this
   is the right scale; the fraction depends on the iteration, not on units.

     scalar    the mean over the interface of the diagonal of B^t k B
     diagonal  that diagonal
     block     the diagonal block of B^t k B on the interface
     schur     the Schur complement of B^t k B on the interface
     auto      schur; but for PC latin of a matrix:
               schur between small subdomains, where it costs little, and at subdomains whose coefficients jump (interfaces/interfacejumps.c),
               where it saves iterations; diagonal on the other interfaces; block if no subdomain has an interior (interfaces/facemodes.c)

   A matrix D = L L^t is stored with L and L^-1, or, for PC latin, with its deluxe weights W (LatinDirectionDeluxe()) in place of L^-1; equal ones are
   stored once. The other stages use a direction through the functions of this file alone.
*/

#define LATIN_DIRECTION_FLOOR  0.1  /* least entry of a diagonal direction, relative to the mean of its interface; it only has to be positive */
#define LATIN_DIRECTION_MATRIX 1e-3 /* default fraction of PC latin for a matrix: it only keeps subdomains regular, which seldom have mechanisms */
#define LATIN_DIRECTION_LINKS  0.1  /* the same for links, whose subdomains have mechanisms */
/* largest product of the rows of a subdomain and its rows on interfaces, up to which Schur complements cost little; they save one iteration of eight */
#define LATIN_DIRECTION_SMALL 150000

/* Returns the type with auto resolved, but for PC latin of a matrix, which decides interface by interface */
LatinDirectionType LatinDirectionKind(const LatinDirections *dir)
{
  return dir->type == LATIN_DIRECTION_AUTO && !(dir->sub->matrix && dir->sub->preconditions) ? LATIN_DIRECTION_SCHUR : dir->type;
}

/*
   Returns the fraction set by the user, or the default of the type: least iterations over many structures, regular and irregular. In PC latin springs
   serve only to keep the operators of subdomains regular.
*/
PetscReal LatinDirectionFraction(const LatinDirections *dir)
{
  const PetscReal fraction[] = {0.08, 0.08, 0.25, 1.0, 1.0};

  if (dir->value > 0.0) return dir->value;
  if (dir->sub->preconditions) return dir->sub->matrix ? LATIN_DIRECTION_MATRIX : LATIN_DIRECTION_LINKS;
  return fraction[dir->type];
}

/* Returns the harmonic mean of two stiffnesses, ruled by the softer one */
static inline PetscReal LatinHarmonic(PetscReal a, PetscReal b)
{
  return a > 0.0 && b > 0.0 ? 2.0 * a / (1.0 + a / b) : 0.0;
}

/* Sets d of types scalar and diagonal to the fraction of the mean stiffness of both sides, and harmonic. Collective on sub->object */
static PetscErrorCode LatinDirectionDiagonal_Private(LatinDirections *dir, PetscReal fraction)
{
  const LatinInterfaces *inter = dir->inter;
  PetscReal             *diagonal, *mine, *mate, sum[2] = {0.0, 0.0}, fallback;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(dir->sub->bs * dir->sub->copies, &diagonal, inter->sides, &mine, inter->sides, &mate));
  PetscCall(LatinOperatorDiagonal(dir->sub, diagonal));
  for (PetscInt k = 0; k < inter->sides; k++) mine[k] = diagonal[inter->side_dof[k]];
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, mate));
  for (PetscInt k = 0; k < inter->sides; k++) sum[0] += 0.5 * (mine[k] + mate[k]);
  sum[1] = inter->sides;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm(dir->sub->object)));
  fallback = sum[0] > 0.0 ? sum[0] / sum[1] : 1.0;
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    PetscReal             mean = 0.0;

    /* the sums run over the same numbers in the same order on both sides: the results are the same to the bit */
    for (PetscInt k = face->side_first; k < face->side_last; k++) mean += 0.5 * (mine[k] + mate[k]);
    if (face->side_last > face->side_first) mean /= face->side_last - face->side_first;
    if (!(mean > 0.0)) mean = fallback; /* the two subdomains have no stiffness there */
    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      /* keep K_E regular at dofs of almost no stiffness */
      const PetscReal own = PetscMax(0.5 * (mine[k] + mate[k]), LATIN_DIRECTION_FLOOR * mean);

      dir->d[k]        = fraction * (dir->type == LATIN_DIRECTION_SCALAR ? mean : own);
      dir->harmonic[k] = LatinHarmonic(mine[k], mate[k]);
    }
  }
  PetscCall(PetscLogFlops(6.0 * inter->sides));
  PetscCall(PetscFree3(diagonal, mine, mate));
  PetscFunctionReturn(0);
}

/* ---- matrices ---- */

/* Factors D = L L^t in place, its upper part zero, and computes M: L^-1 or, with S, the deluxe weights `mean` D^-1 S. *bad: D is not positive definite */
static PetscErrorCode LatinDirectionInvert_Private(PetscInt rows, PetscReal L[], const PetscReal S[], PetscReal mean, PetscReal M[], PetscBool *bad)
{
  const PetscScalar one = 1.0, factor = S ? mean : 1.0;
  PetscBLASInt      n, info           = 0;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(rows, &n));
  for (PetscInt j = 0; j < rows; j++)
    for (PetscInt i = 0; i < j; i++) L[i + rows * j] = 0.0;
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &n, L, &n, &info));
  if (S) PetscCall(PetscArraycpy(M, S, rows * rows));
  else PetscCall(PetscArrayzero(M, rows * rows));
  for (PetscInt j = 0; j < rows && !S; j++) M[j + rows * j] = 1.0;
  if (!info) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "N", "N", &n, &n, &factor, L, &n, M, &n));
  if (!info && S) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "T", "N", &n, &n, &one, L, &n, M, &n));
  if (info) *bad = PETSC_TRUE;
  PetscCall(PetscLogFlops((S ? 7.0 : 4.0) / 3.0 * rows * rows * rows));
  PetscFunctionReturn(0);
}

/* Sets pattern[f] to the first interface side with the same matrix D + first[f] and, unless S is NULL, the same own stiffness S + from[f] */
static PetscErrorCode LatinDirectionPattern_Private(const LatinDirections *dir, const PetscReal D[], const size_t first[], const PetscReal S[], const size_t from[], PetscInt pattern[])
{
  const PetscInt count = dir->inter->count;
  size_t        *bytes, *pair;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(count + 1, &bytes, 2 * count, &pair));
  for (PetscInt f = 0; f <= count; f++) bytes[f] = first[f] * sizeof(*D);
  PetscCall(LatinFindEqual(count, bytes, D, pattern));
  if (S) {
    for (PetscInt f = 0; f <= count; f++) bytes[f] = 2 * (size_t)f * sizeof(*pair);
    for (PetscInt f = 0; f < count; f++) {
      pair[2 * f]     = (size_t)pattern[f];
      pair[2 * f + 1] = from[f];
    }
    PetscCall(LatinFindEqual(count, bytes, pair, pattern));
  }
  PetscCall(PetscFree2(bytes, pair));
  PetscFunctionReturn(0);
}

/* Factors the matrices D + first[f], equal ones once. If S is not NULL, computes the deluxe weights from the stiffnesses S + from[f] */
static PetscErrorCode LatinDirectionFactor_Private(LatinDirections *dir, const PetscReal D[], const size_t first[], const PetscReal S[], const size_t from[], PetscReal mean, PetscBool *bad)
{
  const LatinInterfaces *inter = dir->inter;
  PetscInt              *pattern, used = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(inter->count, &pattern));
  PetscCall(LatinDirectionPattern_Private(dir, D, first, S, from, pattern));
  for (PetscInt f = 0; f < inter->count; f++) {
    if (first[f + 1] == first[f]) dir->matrix_first[f] = -1;
    else if (pattern[f] != f) dir->matrix_first[f] = dir->matrix_first[pattern[f]];
    else {
      dir->matrix_first[f] = used;
      used += 3 * (PetscInt)(first[f + 1] - first[f]);
    }
  }
  PetscCall(PetscMalloc1(used + 1, &dir->matrix)); /* not NULL, even on a rank without interfaces */
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face   = &inter->interface[f];
    const PetscInt        rows   = face->side_last - face->side_first;
    PetscReal            *matrix = dir->matrix + PetscMax(dir->matrix_first[f], 0);

    if (dir->matrix_first[f] < 0 || pattern[f] != f) continue;
    for (PetscInt copy = 0; copy < 2; copy++) PetscCall(PetscArraycpy(matrix + copy * rows * rows, D + first[f], rows * rows));
    PetscCall(LatinDirectionInvert_Private(rows, matrix + rows * rows, S ? S + from[f] : NULL, mean, matrix + 2 * rows * rows, bad));
  }
  PetscCall(PetscFree(pattern));
  PetscFunctionReturn(0);
}

/* Computes D of the interfaces with matrices[f]: the fraction of the mean stiffness of both sides. Collective on sub->object */
static PetscErrorCode LatinDirectionMatrix_Private(LatinDirections *dir, PetscReal fraction, const PetscBool matrices[])
{
  const LatinInterfaces *inter = dir->inter;
  size_t                *from, *first;
  PetscInt              *columns, *theirs;
  const PetscReal      **mine;
  PetscReal             *S   = NULL, *D;
  PetscBool              bad = PETSC_FALSE;
  PetscErrorCode         ierr;

  PetscFunctionBegin;
  PetscCall(PetscMalloc5(inter->count, &from, inter->count + 1, &first, inter->count, &columns, inter->count, &theirs, inter->count, &mine));
  ierr = LatinStiffnessFaces_Private(dir, (PetscBool)(dir->type == LATIN_DIRECTION_BLOCK || LatinDirectionCondensed(dir)), matrices, from, &S);
  if (ierr) {
    PetscCall(PetscFree(S));
    PetscCall(PetscFree5(from, first, columns, theirs, mine));
    PetscCall(ierr);
  }
  for (PetscInt f = 0; f < inter->count; f++) {
    columns[f] = matrices[f] ? inter->interface[f].side_last - inter->interface[f].side_first : 0;
    mine[f]    = S + from[f];
  }
  PetscCall(LatinMateColumns_Private(inter, columns, mine, theirs, first, &D));
  for (PetscInt f = 0; f < inter->count; f++)
    for (size_t c = 0, rows = (size_t)columns[f]; c < rows; c++) {
      const PetscReal *a = mine[f] + rows * c;
      PetscReal       *b = D + first[f] + rows * c;

      dir->harmonic[(size_t)inter->interface[f].side_first + c] = LatinHarmonic(a[c], b[c]);
      for (size_t r = 0; r < rows; r++) b[r] = fraction * 0.5 * (a[r] + b[r]);
      dir->d[(size_t)inter->interface[f].side_first + c] = b[c];
    }
  PetscCall(LatinDirectionFactor_Private(dir, D, first, LatinDirectionIsDeluxe(dir) ? S : NULL, from, 0.5 * fraction, &bad));
  PetscCall(PetscFree(S));
  PetscCall(PetscFree(D));
  PetscCall(PetscFree5(from, first, columns, theirs, mine));
  LatinAgree(PetscObjectComm(dir->sub->object), bad, PETSC_ERR_MAT_CH_ZRPVT, "The search direction %s of an interface is not positive definite to rounding; choose another -%sdirection, e.g. diagonal", LatinDirectionTypes[dir->type],
             LatinPrefix(dir->sub));
  PetscFunctionReturn(0);
}

/*
   Chooses matrices[f] of type auto: all interfaces of subdomains whose coefficients jump, and those between two small subdomains. In a subdomain with
   jumps, matrices on some interfaces alone cost time and save no iteration. Collective on sub->object.
*/
static PetscErrorCode LatinDirectionAuto_Private(LatinDirections *dir, PetscBool matrices[])
{
  const LatinSubdomains *sub   = dir->sub;
  const LatinInterfaces *inter = dir->inter;
  PetscInt              *small, *mate;

  PetscFunctionBegin;
  PetscCall(LatinJumpsFaces_Private(inter, matrices));
  PetscCall(PetscMalloc2(inter->count, &small, inter->count, &mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    const PetscInt  s     = inter->interface[f].sub;
    const PetscReal sides = inter->interface[inter->offset[s + 1] - 1].side_last - inter->interface[inter->offset[s]].side_first;

    small[f] = sides * sub->bs * (sub->node_offset[s + 1] - sub->node_offset[s]) <= LATIN_DIRECTION_SMALL ? 1 : 0;
  }
  PetscCall(LatinMateNumbers_Private(inter, small, mate));
  for (PetscInt f = 0; f < inter->count; f++) matrices[f] = (PetscBool)(matrices[f] || (small[f] && mate[f]));
  PetscCall(PetscFree2(small, mate));
  PetscFunctionReturn(0);
}

/* Sets d to the scalar that the user gives for all interfaces, after a check against their stiffness. Collective on sub->object */
static PetscErrorCode LatinDirectionScalar_Private(LatinDirections *dir)
{
  PetscReal range[2] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL}; /* minus the least stiffness; the greatest */

  PetscFunctionBegin;
  PetscCall(LatinDirectionDiagonal_Private(dir, 1.0));
  for (PetscInt k = 0; k < dir->inter->sides; k++) {
    range[0]  = PetscMax(range[0], -dir->d[k]);
    range[1]  = PetscMax(range[1], dir->d[k]);
    dir->d[k] = dir->harmonic[k] = dir->value;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, range, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm(dir->sub->object)));
  PetscCheck(range[1] < 0.0 || (dir->value >= -range[0] / LATIN_DIRECTION_RANGE && dir->value / LATIN_DIRECTION_RANGE <= range[1]), PetscObjectComm(dir->sub->object), PETSC_ERR_ARG_OUTOFRANGE,
             "-snes_latin_direction_value, LatinSetDirection(): The direction value is %g; with the direction scalar it is a stiffness (force/length), from %g to %g beside that of the interfaces, %g to %g (0: automatic)", (double)dir->value,
             (double)(-range[0] / LATIN_DIRECTION_RANGE), (double)(range[1] * LATIN_DIRECTION_RANGE), (double)-range[0], (double)range[1]);
  PetscFunctionReturn(0);
}

/* Computes the search directions of all interfaces. Collective on sub->object */
PetscErrorCode LatinDirectionSetUp(LatinDirections *dir)
{
  const LatinDirectionType kind     = LatinDirectionKind(dir);
  const PetscReal          fraction = LatinDirectionFraction(dir);
  const LatinInterfaces   *inter    = dir->inter;
  PetscBool               *matrices;
  PetscErrorCode           ierr = 0;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Direction, dir->sub->object, 0, 0, 0));
  PetscCall(PetscMalloc1(inter->sides, &dir->d));
  PetscCall(PetscMalloc1(inter->sides, &dir->harmonic));
  if (kind == LATIN_DIRECTION_SCALAR && dir->value > 0.0) PetscCall(LatinDirectionScalar_Private(dir));
  else if (kind != LATIN_DIRECTION_BLOCK && kind != LATIN_DIRECTION_SCHUR) PetscCall(LatinDirectionDiagonal_Private(dir, fraction));
  PetscCall(PetscMalloc1(inter->count, &matrices));
  PetscCall(PetscMalloc1(inter->count, &dir->matrix_first));
  for (PetscInt f = 0; f < inter->count; f++) {
    dir->matrix_first[f] = -1;
    matrices[f]          = (PetscBool)((kind == LATIN_DIRECTION_BLOCK || kind == LATIN_DIRECTION_SCHUR || LatinDirectionCondensed(dir)) && inter->interface[f].side_last > inter->interface[f].side_first);
  }
  if (kind == LATIN_DIRECTION_AUTO && !LatinDirectionCondensed(dir)) PetscCall(LatinDirectionAuto_Private(dir, matrices));
  dir->matrices = 0;
  for (PetscInt f = 0; f < inter->count; f++) { dir->matrices += matrices[f] && dir->sub->first + inter->interface[f].sub < inter->interface[f].neighbour ? 1 : 0; }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &dir->matrices, 1, MPIU_INT, MPI_SUM, PetscObjectComm(dir->sub->object)));
  if (dir->matrices) ierr = LatinDirectionMatrix_Private(dir, fraction, matrices); /* an error that the caller may turn into a failure */
  PetscCall(PetscFree(matrices));
  PetscCall(PetscLogEventEnd(LATIN_Direction, dir->sub->object, 0, 0, 0));
  PetscCall(ierr);
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDirectionReset(LatinDirections *dir)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(dir->d));
  PetscCall(PetscFree(dir->harmonic));
  PetscCall(PetscFree(dir->matrix));
  PetscCall(PetscFree(dir->matrix_first));
  PetscCall(PetscFree(dir->like));
  PetscCall(LatinSchurReset_Private(dir));
  PetscFunctionReturn(0);
}

/* ---- operations of a direction on n vectors on the side dofs of one interface f, columns ld apart ---- */

/* Computes Y = A X with a square matrix A of `rows` rows; one short product is faster without BLAS */
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

/* Computes Y = D X */
PetscErrorCode LatinDirectionApply(const LatinDirections *dir, PetscInt f, PetscInt n, const PetscReal x[], PetscInt ldx, PetscReal y[], PetscInt ldy)
{
  const LatinInterface *face = &dir->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  const PetscReal      *d    = dir->d + face->side_first;

  PetscFunctionBegin;
  PetscCall(PetscLogFlops(dir->matrix_first[f] >= 0 ? 2.0 * rows * rows * n : 1.0 * rows * n));
  if (dir->matrix_first[f] >= 0) PetscCall(LatinMultiply_Private(rows, n, dir->matrix + dir->matrix_first[f], x, ldx, y, ldy));
  else {
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt r = 0; r < rows; r++) y[ldy * k + r] = d[r] * x[ldx * k + r];
  }
  PetscFunctionReturn(0);
}

/* Adds (a - b)^t D^-1 (a - b) / 4, over all columns, to *sum: the energy v^t D v of a - b = 2 D v. work: two blocks of n vectors */
PetscErrorCode LatinDirectionEnergy(const LatinDirections *dir, PetscInt f, PetscInt n, const PetscReal a[], const PetscReal b[], PetscInt ld, PetscReal work[], PetscReal *sum)
{
  const LatinInterface *face = &dir->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  const PetscReal      *d    = dir->d + face->side_first;
  PetscReal            *v = work, *w = v + rows * n, energy = 0.0;

  PetscFunctionBegin;
  if (dir->matrix_first[f] < 0) {
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt r = 0; r < rows; r++) energy += PetscSqr(a[ld * k + r] - b[ld * k + r]) / d[r];
  } else {
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt r = 0; r < rows; r++) v[rows * k + r] = a[ld * k + r] - b[ld * k + r];
    PetscCall(LatinMultiply_Private(rows, n, dir->matrix + dir->matrix_first[f] + 2 * rows * rows, v, rows, w, rows));
    for (PetscInt r = 0; r < rows * n; r++) energy += w[r] * w[r];
  }
  PetscCall(PetscLogFlops(dir->matrix_first[f] >= 0 ? (2.0 * rows + 3.0) * rows * n : 4.0 * rows * n));
  *sum += 0.25 * energy;
  PetscFunctionReturn(0);
}

/* Sets spring[copies * bs] to the sum of the diagonal directions at each copy, part of K_E (28) */
PetscErrorCode LatinDirectionSprings_Private(const LatinDirections *dir, PetscReal spring[])
{
  const LatinInterfaces *inter = dir->inter;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(spring, dir->sub->bs * dir->sub->copies));
  for (PetscInt f = 0; f < inter->count; f++)
    if (dir->matrix_first[f] < 0)
      for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) spring[inter->side_dof[k]] += dir->d[k];
  PetscFunctionReturn(0);
}

/* Assembles K: the operator of subdomain s with these springs and its matrix directions */
PetscErrorCode LatinDirectionMatrix(const LatinDirections *dir, PetscInt s, const PetscReal spring[], LatinSparse *K)
{
  const LatinInterfaces *inter = dir->inter;
  LatinBlock            *block;
  PetscInt               n = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(inter->offset[s + 1] - inter->offset[s], &block));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];

    if (dir->matrix_first[f] >= 0) block[n++] = (LatinBlock){.n = face->side_last - face->side_first, .dof = inter->side_dof + face->side_first, .a = dir->matrix + dir->matrix_first[f]};
  }
  PetscCall(LatinSparseCreate_Private(dir->sub, s, spring, dir->sub->fixed, n, block, K));
  PetscCall(PetscFree(block));
  PetscFunctionReturn(0);
}

/*
   Scales x on this side of interface f (deluxe scaling): displacements become W x, forces W^t x. W = (S + S')^-1 S with the stiffnesses S and S' of
   both sides is a partition of unity, W + W' = 1, and the weighted mean of least energy. work: as long as x.
*/
PetscErrorCode LatinDirectionDeluxe(const LatinDirections *dir, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[])
{
  const LatinInterface *face = &dir->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  const PetscScalar     one = 1.0, zero = 0.0;
  const PetscBLASInt    inc = 1;
  PetscBLASInt          n;

  PetscFunctionBegin;
  if (!rows) PetscFunctionReturn(0);
  PetscCall(PetscBLASIntCast(rows, &n));
  PetscCallBLAS("BLASgemv", BLASgemv_(forces ? "T" : "N", &n, &n, &one, dir->matrix + dir->matrix_first[f] + 2 * rows * rows, &n, x, &inc, &zero, work, &inc));
  PetscCall(PetscArraycpy(x, work, rows));
  PetscCall(PetscLogFlops(2.0 * rows * rows));
  PetscFunctionReturn(0);
}

/* Makes the columns of R, which are orthonormal in d, orthonormal in a matrix direction D, with the same span (Cholesky QR) */
PetscErrorCode LatinDirectionNormalise(const LatinDirections *dir, PetscInt f, PetscInt modes, PetscReal R[])
{
  const LatinInterface *face = &dir->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  const PetscScalar     one = 1.0, zero = 0.0;
  const PetscBLASInt    inc = 1;
  PetscReal            *W, *G;
  PetscBLASInt          n, m;

  PetscFunctionBegin;
  if (dir->matrix_first[f] < 0 || !modes) PetscFunctionReturn(0);
  PetscCall(PetscBLASIntCast(rows, &n));
  PetscCall(PetscBLASIntCast(modes, &m));
  PetscCall(PetscMalloc2(rows * modes, &W, modes * modes, &G));
  for (PetscInt pass = 0; pass < 2; pass++) { /* twice: orthonormal to rounding, even if the first Gram matrix is ill-conditioned */
    PetscCall(PetscArraycpy(W, R, rows * modes));
    for (PetscInt j = 0; j < modes; j++) PetscCallBLAS("BLAStrmv", BLAStrmv_("L", "T", "N", &n, dir->matrix + dir->matrix_first[f] + rows * rows, &n, W + rows * j, &inc));
    PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &m, &m, &n, &one, W, &n, W, &n, &zero, G, &m));
    PetscCheck(LatinCholesky(modes, G), PETSC_COMM_SELF, PETSC_ERR_PLIB, "The macro modes of an interface are dependent in its search direction");
    PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &n, &m, &one, G, &m, R, &n));
  }
  PetscCall(PetscLogFlops(2.0 * modes * rows * (rows + 3.0 * modes)));
  PetscCall(PetscFree2(W, G));
  PetscFunctionReturn(0);
}
