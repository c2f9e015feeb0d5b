#include "interfaces/latininterfaces.h"

/*
   Local low-energy fields of subdomains without interior unknowns, as in coarse problems of substructures. The operator K of such a subdomain is dense,
   on its interfaces. Let A and B be the blocks of both sides' operators on one interface, and v a displacement there, which deluxe scaling splits
   between both sides.

     rest of both sides fixed: the split has the energy v^t N v, N = A (A + B)^-1 B, the parallel sum of A and B;
     rest of both sides free: the least energy is v^t P v, P^-1 = (K^-1)_ff + (K'^-1)_ff, P the parallel sum of Schur complements.

   The preconditioner is as good as the largest lambda of N v = lambda P v is small, as in adaptive BDDC. So eigenvectors of large lambda become macro,
   with forces N v: the fields are (A + B)^-1 N v. Steps:

   1. The inverse of each K, kept regular by the springs of the search direction, and its blocks on interfaces.
   2. P^-1 of each interface, the sum of both sides' blocks.
   3. The eigenproblem, of the size of one interface.
*/

/*
   Computes G, the inverse of the operator of subdomain s with its springs; rows and columns of held dofs are zero. NULL if the subdomain has a
   mechanism, which the set-up of the linear stage reports. *firm: the diagonals of operator and inverse prove that it has none
*/
static PetscErrorCode LatinFaceInverse_Private(const LatinSpectral *spectral, PetscInt s, const PetscBool held[], PetscReal **G, PetscBool *firm)
{
  const LatinInterfaces *inter = spectral->inter;
  const PetscInt         top = spectral->sub->node_offset[s], rows = spectral->sub->node_offset[s + 1] - top;
  const size_t           n         = (size_t)rows;
  PetscBool              mechanism = PETSC_FALSE;
  PetscInt              *position;
  PetscReal             *A, *diagonal, most = 0.0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(rows, &position, rows, &diagonal));
  PetscCall(PetscMalloc1(n * n, &A));
  for (PetscInt i = 0; i < rows; i++) position[i] = held[top + i] ? -1 : i;
  LatinOperatorDense(spectral->sub, s, rows, position, A);
  for (size_t i = 0; i < n; i++)
    if (held[top + (PetscInt)i]) A[i + n * i] = 1.0;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt       *dof  = inter->side_dof + face->side_first;
    const PetscInt        at = spectral->dir->matrix_first[f], m = face->side_last - face->side_first;
    const PetscReal      *D;

    if (at < 0) continue; /* no rows, no matrix */
    D = spectral->dir->matrix + at;
    for (PetscInt j = 0; j < m; j++)
      for (PetscInt i = 0; i < m; i++) A[(size_t)(dof[i] - top) + n * (size_t)(dof[j] - top)] += *D++;
  }
  for (size_t i = 0; i < n; i++) diagonal[i] = A[i + n * i];
  PetscCall(LatinSPDInverse_Private(rows, A, &mechanism));
  for (size_t i = 0; i < n; i++) most = PetscMax(most, diagonal[i] * A[i + n * i]);
  *firm = (PetscBool)(!mechanism && LATIN_MECHANISM * most * (PetscReal)n < 1.0);
  for (size_t i = 0; i < n; i++)
    if (held[top + (PetscInt)i]) A[i + n * i] = 0.0;
  if (mechanism) PetscCall(PetscFree(A));
  *G = A;
  PetscCall(PetscFree2(position, diagonal));
  PetscFunctionReturn(0);
}

/* Copies the diagonal block of G on each interface f to C + first[f]; zeros if G is NULL */
static void LatinFaceCompliance(const LatinSpectral *spectral, PetscInt s, const PetscReal G[], const size_t first[], PetscReal C[])
{
  const LatinInterfaces *inter = spectral->inter;
  const PetscInt         top   = spectral->sub->node_offset[s];
  const size_t           n     = (size_t)(spectral->sub->node_offset[s + 1] - top);

  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt       *dof  = inter->side_dof + face->side_first;
    PetscReal            *to   = C + first[f];

    for (PetscInt j = 0, m = face->side_last - face->side_first; j < m; j++)
      for (PetscInt i = 0; i < m; i++) *to++ = G ? G[(size_t)(dof[i] - top) + n * (size_t)(dof[j] - top)] : 0.0;
  }
}

/*
   Computes the eigenvectors with lambda > least, of the LATIN_SPECTRAL_MOST largest lambda at most: the *modes columns of V from *first on.

     Q NULL: A v = lambda v, V is n x PetscMin(n, LATIN_SPECTRAL_MOST)
     else:   A v = lambda P v with Q = P^-1, V is n x n; no modes if Q is not positive definite

   Overwrites A and Q, n x n. *bad: LAPACK did not converge
*/
PetscErrorCode LatinSpectralEigen_Private(PetscInt n, PetscReal least, PetscScalar A[], PetscScalar Q[], PetscScalar V[], PetscInt *first, PetscInt *modes, PetscBool *bad)
{
  const PetscReal unused = 0.0, tolerance = 0.0, most = PETSC_MAX_REAL;
  PetscBLASInt    bn, lwork, kind = 3, found = 0, from, info, *iwork, *fail;
  PetscScalar    *work;
  PetscReal      *w;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(n, &bn));
  PetscCall(PetscBLASIntCast(40 * n, &lwork));
  from = PetscMax(bn - LATIN_SPECTRAL_MOST, 0) + 1;
  PetscCall(PetscMalloc4(lwork, &work, n, &w, 5 * n, &iwork, n, &fail));
  if (Q) PetscCallBLAS("LAPACKsygvx", LAPACKsygvx_(&kind, "V", "V", "L", &bn, A, &bn, Q, &bn, &least, &most, &from, &bn, &tolerance, &found, w, V, &bn, work, &lwork, iwork, fail, &info));
  else PetscCallBLAS("LAPACKsyevx", LAPACKsyevx_("V", "I", "L", &bn, A, &bn, &unused, &unused, &from, &bn, &tolerance, &found, w, V, &bn, work, &lwork, iwork, fail, &info));
  if (info && info <= bn) *bad = PETSC_TRUE;
  if (info) found = 0;
  *first = PetscMax((PetscInt)found - LATIN_SPECTRAL_MOST, 0);
  while (*first < found && !(w[*first] > least)) ++*first;
  *modes = (PetscInt)found - *first;
  PetscCall(PetscFree4(work, w, iwork, fail));
  PetscFunctionReturn(0);
}

/*
   Computes the fields of interface f with lambda > least: columns of length 1, rows weighted by sqrt(d). Overwrites Q = P^-1. *bad: LAPACK did not
   converge
*/
static PetscErrorCode LatinFaceFields_Private(LatinSpectral *spectral, PetscInt f, PetscReal least, PetscScalar Q[], PetscBool *bad)
{
  const LatinInterface  *face = &spectral->inter->interface[f];
  const LatinDirections *dir  = spectral->dir;
  const PetscInt         rows = face->side_last - face->side_first;
  const PetscReal       *D = dir->matrix + dir->matrix_first[f], *W = D + 2 * rows * rows;
  const PetscScalar      one = 1.0, zero = 0.0, minus = -1.0, scale = 2.0 / LatinDirectionFraction(dir);
  PetscBLASInt           n, modes;
  PetscInt               first, count;
  PetscScalar           *X, *N, *V;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(rows, &n));
  PetscCall(PetscMalloc3(rows * rows, &X, rows * rows, &N, rows * rows, &V));
  PetscCall(PetscArraycpy(X, W, rows * rows)); /* (A + B)^-1 N = W - W W, A + B = scale D */
  PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &n, &n, &n, &minus, W, &n, W, &n, &one, X, &n));
  PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &n, &n, &n, &scale, D, &n, X, &n, &zero, N, &n));
  PetscCall(LatinSpectralEigen_Private(rows, least, N, Q, V, &first, &count, bad));
  PetscCall(PetscBLASIntCast(count, &modes));
  PetscCall(PetscMalloc1(rows * count, &spectral->field[f]));
  if (count) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &n, &modes, &n, &one, X, &n, V + rows * first, &n, &zero, spectral->field[f], &n));
  for (PetscInt j = 0; j < count; j++) {
    PetscScalar *field = spectral->field[f] + rows * j;
    PetscReal    norm  = 0.0;

    for (PetscInt r = 0; r < rows; r++) field[r] *= PetscSqrtReal(dir->d[face->side_first + r]);
    for (PetscInt r = 0; r < rows; r++) norm += PetscSqr(field[r]);
    for (PetscInt r = 0; r < rows; r++) field[r] /= PetscSqrtReal(norm);
  }
  spectral->count[f] = count;
  PetscCall(PetscLogFlops((4.0 + 13.0 / 3.0) * rows * rows * rows));
  PetscCall(PetscFree3(X, N, V));
  PetscFunctionReturn(0);
}

/*
   Computes the fields of all interfaces, each on the side of the lower subdomain. held[copies]: primal and prescribed dofs. Keeps the inverses in
   spectral->inverse if they serve as local solvers. *bad: LAPACK did not converge. Collective on sub->object
*/
PetscErrorCode LatinSpectralFaces_Private(LatinSpectral *spectral, const PetscBool held[], PetscReal threshold, PetscBool *bad)
{
  const LatinInterfaces *inter = spectral->inter;
  PetscInt              *columns, *theirs;
  size_t                *first, *from;
  const PetscReal      **mine;
  PetscReal             *C, *mate;
  PetscBool              kept;

  PetscFunctionBegin;
  PetscCall(PetscMalloc5(inter->count, &columns, inter->count, &theirs, inter->count + 1, &first, inter->count + 1, &from, inter->count, &mine));
  first[0] = 0;
  for (PetscInt f = 0; f < inter->count; f++) first[f + 1] = first[f] + PetscSqr((size_t)(inter->interface[f].side_last - inter->interface[f].side_first));
  PetscCall(PetscMalloc1(first[inter->count], &C));
  PetscCall(LatinSolverIsDefault_Private(spectral->sub->object, "local", &kept));
  PetscCall(PetscCalloc1(spectral->sub->n, &spectral->inverse));
  for (PetscInt s = 0; s < spectral->sub->n; s++) {
    PetscReal *G;
    PetscBool  firm = PETSC_FALSE;

    PetscCall(LatinFaceInverse_Private(spectral, s, held, &G, &firm));
    LatinFaceCompliance(spectral, s, G, first, C);
    if (kept && firm) spectral->inverse[s] = G;
    else PetscCall(PetscFree(G));
  }
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];

    columns[f] = spectral->sub->first + face->sub < face->neighbour ? 0 : face->side_last - face->side_first;
    mine[f]    = C + first[f];
  }
  PetscCall(LatinMateColumns_Private(inter, columns, mine, theirs, from, &mate));
  for (PetscInt f = 0; f < inter->count && !*bad; f++) {
    for (size_t i = from[f]; i < from[f + 1]; i++) C[first[f] + i - from[f]] += mate[i];
    if (theirs[f]) PetscCall(LatinFaceFields_Private(spectral, f, 1.0 / (LATIN_SPECTRAL_FACE * threshold), C + first[f], bad));
  }
  PetscCall(PetscFree(C));
  PetscCall(PetscFree(mate));
  PetscCall(PetscFree5(columns, theirs, first, from, mine));
  PetscFunctionReturn(0);
}
