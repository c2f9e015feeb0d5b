#include "interfaces/latininterfaces.h"

/*
   Local low-energy fields, beyond the article: an adaptive coarse space, as in GenEO. A partition that cuts through modules leaves subdomains with
   low-energy modes: motions of almost no energy with the corners held, which the affine fields of the interfaces do not contain. Only the search
   direction d resists them, and the iteration converges slowly. So they become macro. For each such subdomain, with S_E its Schur complement on its
   interfaces, primal dofs held,

     S_E v = lambda d v,  lambda below a threshold.

   The springs of d are part of K_E. So the code computes the large eigenvalues 1 / (1 + lambda) of the compliance

     d^1/2 (S_E + d)^-1 d^1/2 = d^1/2 C K_E^-1 C^t d^1/2,

   which exists even if S_E has mechanisms. The modes of both subdomains are restricted to each interface and complete its macro basis
   (LatinSpectralExtend()).

   Subdomains of a matrix have low-energy modes where its coefficients jump: a stiff part that reaches an interface through a soft one. There the
   springs are half the harmonic mean of both sides' stiffnesses, whatever d is: a subdomain that is softer than its neighbour as a whole has no
   low-energy modes for that reason alone. Thin subdomains have low-energy modes in bending. If the threshold is automatic, only subdomains are searched
   that are thin or whose coefficients jump next to an interface.

   Subdomains without interior have fields of each interface in place of these (interfaces/facemodes.c).

   The eigenproblem is solved densely: eigenvectors for a sixth of the dofs of an interface or more are needed, most of one multiple eigenvalue. Block
   Lanczos needs a basis of three times as many vectors, and took 1.7 times as long at 3,726 dofs.
*/

/* least part of the norm of a field that is orthogonal to the macro basis; with 0.05, a tenth fewer iterations and up to 15 % more coarse unknowns */
#define LATIN_SPECTRAL_SIZE 0.1
/* the same for fields of interfaces/facemodes.c, whose small parts may decide; with 0.1, 96 steps of a second level instead of 68 */
#define LATIN_SPECTRAL_FACE_SIZE 1e-3
/* springs of subdomains of a matrix, relative to the harmonic mean of the stiffnesses of both sides; from 1 on nearly the whole interface is macro */
#define LATIN_SPECTRAL_SOFT 0.5
/* largest thickness of a thin subdomain, relative to its extent: a plate of 1/80 takes 7 iterations instead of 38, one of 1/40 7 instead of 19 */
#define LATIN_SPECTRAL_THIN         0.1
#define LATIN_SPECTRAL_ITERATION    1.3 /* default threshold of KSP latin for a matrix with coefficient jumps; at twice the value nothing is left to iterate */
#define LATIN_SPECTRAL_PRECONDITION 1.0 /* the same of PC latin; random jumps of 1e6 take 8 iterations instead of 19 */

/* Returns the threshold: set by the user, or automatic: for coefficient jumps of a matrix, 0 otherwise */
PetscReal LatinSpectralThreshold(const LatinSpectral *spectral)
{
  if (spectral->threshold >= 0.0) return spectral->threshold;
  if (!spectral->sub->matrix || spectral->inter->variant != LATIN_VARIANT_CORNER) return 0.0;
  return spectral->sub->preconditions ? LATIN_SPECTRAL_PRECONDITION : LATIN_SPECTRAL_ITERATION;
}

/* Scales the columns of C to the norms that the modes have on interface f in the springs, which are not d for a matrix */
static void LatinSpectralRescale(LatinSpectral *spectral, PetscInt f, PetscInt n, PetscInt modes, const PetscScalar mode[], const PetscInt position[], PetscScalar C[])
{
  const LatinInterface *face = &spectral->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first, top = spectral->sub->bs * spectral->sub->node_offset[face->sub];

  for (PetscInt j = 0; j < modes; j++) {
    PetscReal in_springs = 0.0, in_d = 0.0;

    for (PetscInt r = 0; r < rows; r++) {
      const PetscInt p = position[spectral->inter->side_dof[face->side_first + r] - top];

      in_springs += p < 0 ? 0.0 : PetscSqr(mode[p + (size_t)n * (size_t)j]);
      in_d += PetscSqr(C[r + rows * j]);
    }
    for (PetscInt r = 0; r < rows && in_d > 0.0; r++) C[r + rows * j] *= PetscSqrtReal(in_springs / in_d);
  }
}

/*
   Computes the fields of one side of interface f: the modes, [n] rows, at position[dof], restricted to it, rows weighted by sqrt(d), without small or
   dependent ones (SVD). weight[n]: root of the spring of each row
*/
static PetscErrorCode LatinSpectralCut_Private(LatinSpectral *spectral, PetscInt f, PetscInt n, PetscInt modes, const PetscScalar mode[], const PetscInt position[], const PetscReal weight[])
{
  const LatinInterface *face = &spectral->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first, top = spectral->sub->bs * spectral->sub->node_offset[face->sub];
  PetscInt              count = 0;
  PetscReal            *scale;
  PetscScalar          *C, *right;

  PetscFunctionBegin;
  if (!face->strong || !rows || !modes) PetscFunctionReturn(0);
  PetscCall(PetscMalloc3(modes * modes, &right, modes, &scale, rows * modes, &C));
  for (PetscInt j = 0; j < modes; j++)
    for (PetscInt r = 0; r < rows; r++) {
      const PetscInt p = position[spectral->inter->side_dof[face->side_first + r] - top];

      C[r + rows * j] = p < 0 ? 0.0 : mode[p + (size_t)n * (size_t)j] * PetscSqrtReal(spectral->dir->d[face->side_first + r]) / weight[p];
    }
  if (spectral->sub->matrix) LatinSpectralRescale(spectral, f, n, modes, mode, position, C);
  PetscCall(LatinSVD_Private(rows, modes, C, scale, right));
  while (count < PetscMin(modes, rows) && scale[count] > LATIN_SPECTRAL_SIZE) count++;
  for (PetscInt j = 0; j < count; j++) scale[j] = 1.0; /* keep the norms of the columns */
  PetscCall(PetscMalloc1(rows * count, &spectral->field[f]));
  LatinCombine_Private(rows, modes, count, C, right, scale, spectral->field[f]);
  spectral->count[f] = count;
  PetscCall(PetscFree3(right, scale, C));
  PetscFunctionReturn(0);
}

/*
   Computes G (n x n), the Schur complement of subdomain s with its springs on its dofs dof[n] with springs; position[row]: inverse of dof, -1: none.
   The Schur complement of the search direction is reused, unless a row of it is neither held nor on a spring. *bad: not positive definite
*/
static PetscErrorCode LatinSpectralStiffness_Private(LatinSpectral *spectral, PetscInt s, const PetscReal spring[], const PetscBool held[], PetscInt n, const PetscInt dof[], const PetscInt position[], PetscScalar G[], PetscBool *bad)
{
  const LatinSchur *schur = spectral->dir->schur ? &spectral->dir->schur[s] : NULL;
  const PetscInt    top   = spectral->sub->bs * spectral->sub->node_offset[s];
  const PetscInt    rows  = spectral->sub->bs * spectral->sub->node_offset[s + 1] - top;
  PetscBool         has = (PetscBool)(schur && schur->S), whole = (PetscBool)(spectral->sub->ki != NULL);
  LatinSparse       K;

  PetscFunctionBegin;
  for (PetscInt i = 0; whole && i < rows; i++) whole = (PetscBool)(position[i] >= 0 || held[top + i]);
  if (whole) { /* no interior */
    LatinOperatorDense(spectral->sub, s, n, position, G);
    for (PetscInt i = 0; i < n; i++) G[(size_t)i * ((size_t)n + 1)] += spring[top + dof[i]];
    PetscFunctionReturn(0);
  }
  for (PetscInt j = 0; has && j < schur->n; j++) has = (PetscBool)(position[schur->row[j]] >= 0 || held[top + schur->row[j]]);
  if (!has) {
    PetscCall(LatinSparseCreate_Private(spectral->sub, s, spring, held, 0, NULL, &K));
    PetscCall(LatinEliminate_Private(&K, n, dof, G, bad));
    PetscCall(LatinSparseReset_Private(&K));
    PetscFunctionReturn(0);
  }
  for (PetscInt j = 0; j < schur->n; j++) {
    const PetscInt column = position[schur->row[j]];

    for (PetscInt i = 0; i < schur->n && column >= 0; i++)
      if (position[schur->row[i]] >= 0) G[(size_t)position[schur->row[i]] + (size_t)n * (size_t)column] = schur->S[(size_t)i + (size_t)schur->n * (size_t)j];
  }
  for (PetscInt i = 0; i < n; i++) G[(size_t)i * ((size_t)n + 1)] += spring[top + dof[i]];
  PetscFunctionReturn(0);
}

/*
   Finds the low-energy modes of subdomain s and restricts them to its interfaces. held[]: primal and prescribed dofs. A mechanism yields no modes: the
   set-up of the linear stage reports it. *bad: LAPACK did not converge
*/
static PetscErrorCode LatinSpectralSubdomain_Private(LatinSpectral *spectral, PetscInt s, const PetscReal spring[], const PetscBool held[], PetscBool *bad)
{
  const LatinInterfaces *inter = spectral->inter;
  const PetscInt         bs = spectral->sub->bs, top = bs * spectral->sub->node_offset[s], rows = bs * spectral->sub->node_offset[s + 1] - top;
  PetscInt              *dof, *position, n = 0, modes = 0, mode = 0, columns;
  PetscReal             *weight;
  PetscScalar           *G, *V;
  PetscBool              mechanism = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(rows, &dof, rows, &position, rows, &weight));
  for (PetscInt i = 0; i < rows; i++) {
    position[i] = -1;
    if (spring[top + i] == 0.0 || held[top + i]) continue;
    position[i] = n;
    weight[n]   = PetscSqrtReal(spring[top + i]);
    dof[n++]    = i;
  }
  if (!n) {
    PetscCall(PetscFree3(dof, position, weight));
    PetscFunctionReturn(0); /* a whole structure, or an interface of primal and prescribed dofs alone, has no fields */
  }
  columns = PetscMin(n, LATIN_SPECTRAL_MOST);
  PetscCall(PetscMalloc2((size_t)n * (size_t)n, &G, (size_t)n * (size_t)columns, &V));
  PetscCall(LatinSpectralStiffness_Private(spectral, s, spring, held, n, dof, position, G, &mechanism));
  PetscCall(LatinSPDInverse_Private(n, G, &mechanism));
  for (PetscInt j = 0; j < n; j++)
    for (PetscInt i = 0; i < n; i++) G[i + (size_t)n * (size_t)j] *= weight[i] * weight[j];
  if (!mechanism) PetscCall(LatinSpectralEigen_Private(n, 1.0 / (1.0 + LatinSpectralThreshold(spectral)), G, NULL, V, &mode, &modes, bad));
  spectral->modes[s] = modes;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) PetscCall(LatinSpectralCut_Private(spectral, f, n, modes, V + (size_t)n * (size_t)mode, position, weight));
  PetscCall(PetscFree2(G, V));
  PetscCall(PetscFree3(dof, position, weight));
  PetscFunctionReturn(0);
}

/* Exchanges the fields of each interface: both sides get those of both, those of the lower subdomain first. Collective on sub->object */
static PetscErrorCode LatinSpectralExchange_Private(LatinSpectral *spectral)
{
  const LatinInterfaces *inter = spectral->inter;
  PetscInt              *theirs;
  size_t                *first;
  PetscReal             *mate;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(inter->count, &theirs, inter->count + 1, &first));
  PetscCall(LatinMateColumns_Private(inter, spectral->count, (const PetscReal *const *)spectral->field, theirs, first, &mate));
  for (PetscInt f = 0; f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first, own = rows * spectral->count[f], other = rows * theirs[f];
    const PetscBool       lower = (PetscBool)(spectral->sub->first + face->sub < face->neighbour);
    PetscScalar          *field;

    if (!other) continue;
    PetscCall(PetscMalloc1(own + other, &field));
    PetscCall(PetscArraycpy(field + (lower ? 0 : other), spectral->field[f], own));
    PetscCall(PetscArraycpy(field + (lower ? own : 0), mate + first[f], other));
    PetscCall(PetscFree(spectral->field[f]));
    spectral->field[f] = field;
    spectral->count[f] += theirs[f];
  }
  PetscCall(PetscFree(mate));
  PetscCall(PetscFree2(theirs, first));
  PetscFunctionReturn(0);
}

/* Copies the fields of subdomain `from` to the equal one `to` */
static PetscErrorCode LatinSpectralCopy_Private(LatinSpectral *spectral, PetscInt from, PetscInt to)
{
  const LatinInterfaces *inter = spectral->inter;

  PetscFunctionBegin;
  spectral->modes[to] = spectral->modes[from];
  for (PetscInt f = inter->offset[from], g = inter->offset[to]; f < inter->offset[from + 1]; f++, g++) {
    const PetscInt n = spectral->count[f] * (inter->interface[f].side_last - inter->interface[f].side_first);

    spectral->count[g] = spectral->count[f];
    if (!n) continue;
    PetscCall(PetscMalloc1(n, &spectral->field[g]));
    PetscCall(PetscArraycpy(spectral->field[g], spectral->field[f], n));
  }
  PetscFunctionReturn(0);
}

/* Sets is[s]: whether subdomain s of a matrix is searched if the threshold is automatic */
static PetscErrorCode LatinSpectralChoose_Private(const LatinSpectral *spectral, PetscBool is[])
{
  const LatinSubdomains *sub = spectral->sub;
  PetscInt              *copy;

  PetscFunctionBegin;
  PetscCall(LatinJumps_Private(spectral->inter, is));
  if (sub->fields != sub->dim || sub->dim < 2) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(sub->copies, &copy));
  for (PetscInt i = 0; i < sub->copies; i++) copy[i] = i;
  for (PetscInt s = 0; s < sub->n; s++) {
    LatinFrame frame;

    PetscCall(LatinInterfaceFrame_Private(sub, sub->node_offset[s + 1] - sub->node_offset[s], copy + sub->node_offset[s], &frame));
    if (frame.size > 0.0 && frame.thickness < LATIN_SPECTRAL_THIN) is[s] = PETSC_TRUE;
  }
  PetscCall(PetscFree(copy));
  PetscFunctionReturn(0);
}

/* Computes the local low-energy fields of all interfaces, for LatinMacroSetUp(). Collective on sub->object */
PetscErrorCode LatinSpectralSetUp(LatinSpectral *spectral)
{
  const LatinSubdomains *sub   = spectral->sub;
  const LatinInterfaces *inter = spectral->inter;
  PetscReal             *spring;
  PetscInt              *pattern;
  PetscBool             *is, *held, any = PETSC_FALSE, bad = PETSC_FALSE;

  PetscFunctionBegin;
  if (LatinSpectralThreshold(spectral) == 0.0) PetscFunctionReturn(0);
  PetscCall(PetscLogEventBegin(LATIN_Spectral, spectral->sub->object, 0, 0, 0));
  PetscCall(PetscCalloc3(inter->count, &spectral->count, inter->count, &spectral->field, sub->n, &spectral->modes));
  PetscCall(PetscMalloc4(sub->bs * sub->copies, &spring, sub->bs * sub->copies, &held, sub->n, &pattern, sub->n, &is));
  PetscCall(PetscArrayzero(spring, sub->bs * sub->copies));
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++) held[i] = (PetscBool)(sub->fixed[i] || inter->component[i / sub->bs] >= 0);
  for (PetscInt k = 0; k < inter->sides; k++) spring[inter->side_dof[k]] += spectral->sub->matrix ? LATIN_SPECTRAL_SOFT * spectral->dir->harmonic[k] : spectral->dir->d[k];
  for (PetscInt s = 0; s < sub->n; s++) is[s] = PETSC_TRUE;
  if (LatinDirectionCondensed(spectral->dir)) {
    PetscCall(LatinSpectralFaces_Private(spectral, held, LatinSpectralThreshold(spectral), &bad));
    for (PetscInt s = 0; s < sub->n; s++) is[s] = PETSC_FALSE;
  } else if (spectral->threshold < 0.0) PetscCall(LatinSpectralChoose_Private(spectral, is));
  for (PetscInt s = 0; s < sub->n; s++) any = (PetscBool)(any || is[s]);
  if (any) PetscCall(LatinRepeats_Private(inter, spectral->dir, NULL, pattern));
  for (PetscInt s = 0; s < sub->n; s++) {
    if (!is[s]) continue;
    if (pattern[s] == s) PetscCall(LatinSpectralSubdomain_Private(spectral, s, spring, held, &bad));
    else PetscCall(LatinSpectralCopy_Private(spectral, pattern[s], s));
  }
  PetscCall(PetscFree4(spring, held, pattern, is));
  LatinAgree(PetscObjectComm(spectral->sub->object), bad, PETSC_ERR_CONV_FAILED, "The local low-energy fields of a subdomain could not be computed; switch them off with -%smodes_local 0", LatinPrefix(sub));
  PetscCall(LatinSpectralExchange_Private(spectral));
  for (PetscInt f = 0; f < inter->count && LatinDirectionCondensed(spectral->dir); f++) spectral->modes[inter->interface[f].sub] += spectral->count[f];
  PetscCall(PetscLogEventEnd(LATIN_Spectral, spectral->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/*
   Completes the orthonormal fields F of interface f (rows x *fields, rows weighted by sqrt(d)) by its local fields: these are made orthogonal to F, and
   their singular vectors of large singular values appended. F has room for them
*/
PetscErrorCode LatinSpectralExtend(const LatinSpectral *spectral, PetscInt f, PetscInt rows, PetscInt *fields, PetscScalar F[])
{
  const PetscInt  count = spectral->count ? spectral->count[f] : 0, m = *fields;
  const PetscReal size = LatinDirectionCondensed(spectral->dir) ? LATIN_SPECTRAL_FACE_SIZE : LATIN_SPECTRAL_SIZE;
  PetscInt        kept = 0;
  PetscReal      *scale;
  PetscScalar    *C, *right;

  PetscFunctionBegin;
  if (!count) PetscFunctionReturn(0);
  PetscCall(PetscMalloc3(count * count, &right, count, &scale, rows * count, &C));
  PetscCall(PetscArraycpy(C, spectral->field[f], rows * count));
  for (PetscInt twice = 0; twice < 2; twice++)
    for (PetscInt j = 0; j < count; j++)
      for (PetscInt i = 0; i < m; i++) {
        PetscScalar dot = 0.0;

        for (PetscInt r = 0; r < rows; r++) dot += F[r + rows * i] * C[r + rows * j];
        for (PetscInt r = 0; r < rows; r++) C[r + rows * j] -= F[r + rows * i] * dot;
      }
  PetscCall(LatinSVD_Private(rows, count, C, scale, right));
  while (kept < PetscMin(count, rows - m) && scale[kept] > size) kept++;
  LatinCombine_Private(rows, count, kept, C, right, scale, F + rows * m);
  *fields += kept;
  PetscCall(PetscFree3(right, scale, C));
  PetscFunctionReturn(0);
}

/* Counts the subdomains with low-energy modes; *most: most modes of a subdomain. Collective on sub->object */
PetscErrorCode LatinSpectralStatistics_Private(const LatinSpectral *spectral, PetscInt *subdomains, PetscInt *most)
{
  PetscInt n = 0, largest = 0;

  PetscFunctionBegin;
  for (PetscInt s = 0; s < spectral->sub->n && spectral->modes; s++) {
    n += spectral->modes[s] > 0 ? 1 : 0;
    largest = PetscMax(largest, spectral->modes[s]);
  }
  PetscCall(MPIU_Allreduce(&n, subdomains, 1, MPIU_INT, MPI_SUM, PetscObjectComm(spectral->sub->object)));
  PetscCall(MPIU_Allreduce(&largest, most, 1, MPIU_INT, MPI_MAX, PetscObjectComm(spectral->sub->object)));
  PetscFunctionReturn(0);
}

/* Frees the inverses that the linear stage has not taken */
PetscErrorCode LatinSpectralFreeInverses(LatinSpectral *spectral)
{
  PetscFunctionBegin;
  for (PetscInt s = 0; s < spectral->sub->n && spectral->inverse; s++) PetscCall(PetscFree(spectral->inverse[s]));
  PetscCall(PetscFree(spectral->inverse));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSpectralReset(LatinSpectral *spectral)
{
  PetscFunctionBegin;
  for (PetscInt f = 0; f < spectral->inter->count && spectral->field; f++) PetscCall(PetscFree(spectral->field[f]));
  PetscCall(LatinSpectralFreeInverses(spectral));
  PetscCall(PetscFree3(spectral->count, spectral->field, spectral->modes));
  PetscFunctionReturn(0);
}
