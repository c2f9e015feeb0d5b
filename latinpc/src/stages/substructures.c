#include "base/room.h"
#include "stages/latinstages.h"

/*
   Substructuring: all interfaces are primal and the local solver is the default. The interior of each subdomain is eliminated once; H is its Schur
   complement on the interfaces. A linear stage is one solve:

   1. Forward substitution condenses the forces on the interfaces.
   2. The coarse problem gives the displacements there.
   3. Backward substitution gives those of the interior.

   No dense matrix is kept: H is added to the coarse matrix. The same substitutions serve subdomains with macro fields whose factors keep the primal
   rows.
*/

/* Gets the factor F of a batch. Borrowed */
PetscErrorCode LatinSubstructuresFactor(const LatinLinear *linear, PetscInt batch, Mat *F)
{
  PC pc;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(linear->solvers->ksp[batch], &pc));
  PetscCall(PCFactorGetMatrix(pc, F));
  PetscFunctionReturn(0);
}

/*
   Computes the condensed forces of the subdomains of a batch whose factor keeps the primal rows, q = (y, g_C - V_C^t g_r) + H (y, 0) with y = V_m^t g:
   forward substitution, in place of g, gives g_C - V_C^t g_r in the primal rows. Adds to linear->energy
*/
PetscErrorCode LatinSubstructuresForward(LatinLinear *linear, PetscInt which)
{
  const LatinSubdomains *sub    = linear->sub;
  const LatinInterfaces *inter  = linear->inter;
  const LatinBatch      *batch  = &linear->batches->batch[which];
  LatinCoarse           *coarse = linear->coarse;
  const PetscScalar      one = 1.0, zero = 0.0;
  const PetscBLASInt     inc = 1;
  PetscBLASInt           rows, macros, cols;
  Mat                    F;

  PetscFunctionBegin;
  PetscCall(LatinSubstructuresFactor(linear, which, &F));
  for (PetscInt m = 0; m < batch->members; m++) {
    const PetscInt  s = batch->sub[m], top = sub->bs * sub->node_offset[s];
    const LatinPhi *Phi = &linear->Phi[s];
    PetscReal      *q   = coarse->q + coarse->offset[s];

    for (PetscInt i = top; i < sub->bs * sub->node_offset[s + 1]; i++)
      if (sub->fixed[i]) linear->g[i] = 0.0;
    PetscCall(PetscBLASIntCast(Phi->rows, &rows));
    PetscCall(PetscBLASIntCast(coarse->macro_count[s], &macros));
    PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
    for (PetscInt r = 0; r < Phi->rows; r++) linear->some[r] = linear->g[top + Phi->row[r]];
    if (macros) PetscCallBLAS("BLASgemv", BLASgemv_("T", &rows, &macros, &one, Phi->a, &rows, linear->some, &inc, &zero, q, &inc));
    PetscCall(PetscArraycpy(linear->lambda, q, macros));
    PetscCall(LatinCholeskyForward(F, linear->g + top, &linear->energy));
    for (PetscInt p = inter->primal_offset[s]; p < inter->primal_offset[s + 1]; p++) q[macros + p - inter->primal_offset[s]] = linear->g[inter->primal_dof[p]];
    if (macros) PetscCallBLAS("BLASgemv", BLASgemv_("N", &cols, &macros, &one, linear->stiffness.H + linear->stiffness.h_offset[s], &cols, linear->lambda, &inc, &one, q, &inc));
    PetscCall(PetscLogFlops(2.0 * macros * ((PetscLogDouble)rows + cols)));
  }
  PetscFunctionReturn(0);
}

/*
   Adds to g of subdomain s the forces of its coarse displacements: D R lambda, with macro forces lambda (not if `kept`: V_m lambda is added later), and
   -K_rC u_C. Sets u_C in primal rows
*/
PetscErrorCode LatinLinearRelocalise_Private(LatinLinear *linear, PetscInt s, PetscBool kept)
{
  const LatinSubdomains *sub    = linear->sub;
  const LatinInterfaces *inter  = linear->inter;
  LatinCoarse           *coarse = linear->coarse;
  const PetscReal       *u = coarse->u + coarse->offset[s], *q = coarse->q + coarse->offset[s], *uc = u + coarse->macro_count[s];
  PetscReal             *g = linear->g + linear->sub->bs * sub->node_offset[s], *lambda = linear->lambda;
  const PetscScalar      one = 1.0, zero = 0.0;
  const PetscBLASInt     inc = 1;
  PetscBLASInt           macros, cols;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(coarse->macro_count[s], &macros));
  PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
  if (macros) {
    /* the first rows of H are (T^-1 - 1, -T^-1 N) */
    PetscCallBLAS("BLASgemv", BLASgemv_("N", &macros, &cols, &one, linear->stiffness.H + linear->stiffness.h_offset[s], &cols, u, &inc, &zero, lambda, &inc));
    for (PetscInt i = 0; i < macros; i++) lambda[i] += u[i] - q[i];
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1] && !kept; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscReal      *lf   = lambda + linear->macro->of[f].at;

      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        const PetscReal *row   = LatinMacroDualRow(linear->macro, f, k);
        PetscReal        force = 0.0;

        for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) force += row[j] * lf[j];
        linear->g[inter->side_dof[k]] += force;
      }
    }
  }
  PetscCall(PetscLogFlops(2.0 * macros * (macros ? coarse->offset[s + 1] - coarse->offset[s] : 0) + 2.0 * (linear->rc_last[s] - linear->rc_first[s])));
  for (PetscInt p = linear->rc_first[s]; p < linear->rc_last[s]; p++) g[linear->rc[p].row] -= linear->rc[p].value * uc[linear->rc[p].primal];
  for (PetscInt p = linear->inter->primal_offset[s]; p < linear->inter->primal_offset[s + 1]; p++) linear->g[linear->inter->primal_dof[p]] = uc[p - linear->inter->primal_offset[s]];
  PetscFunctionReturn(0);
}

/* Performs relocalisation and local solves of such a batch: backward substitution, plus V_m lambda on the interfaces. Adds to U and linear->energy */
PetscErrorCode LatinSubstructuresBackward(LatinLinear *linear, PetscInt which, PetscReal U[])
{
  const LatinSubdomains *sub   = linear->sub;
  const LatinBatch      *batch = &linear->batches->batch[which];
  const PetscScalar      one = 1.0, zero = 0.0;
  const PetscBLASInt     inc = 1;
  PetscBLASInt           rows, macros;
  Mat                    F;

  PetscFunctionBegin;
  PetscCall(LatinSubstructuresFactor(linear, which, &F));
  for (PetscInt m = 0; m < batch->members; m++) {
    const PetscInt  s = batch->sub[m], top = sub->bs * sub->node_offset[s];
    const LatinPhi *Phi = &linear->Phi[s];

    PetscCall(LatinLinearRelocalise_Private(linear, s, PETSC_TRUE));
    for (PetscInt p = linear->coarse->offset[s]; p < linear->coarse->offset[s + 1]; p++) linear->energy += linear->coarse->q[p] * linear->coarse->u[p];
    PetscCall(LatinCholeskyBackward(F, linear->g + top, &linear->energy));
    for (PetscInt i = top; i < sub->bs * sub->node_offset[s + 1]; i++) U[i] += sub->fixed[i] ? 0.0 : linear->g[i];
    PetscCall(PetscBLASIntCast(Phi->rows, &rows));
    PetscCall(PetscBLASIntCast(linear->coarse->macro_count[s], &macros));
    if (!macros) continue;
    PetscCallBLAS("BLASgemv", BLASgemv_("N", &rows, &macros, &one, Phi->a, &rows, linear->lambda, &inc, &zero, linear->some, &inc));
    for (PetscInt r = 0; r < Phi->rows; r++) U[top + Phi->row[r]] += linear->some[r];
    PetscCall(PetscLogFlops(2.0 * macros * (PetscLogDouble)rows));
  }
  PetscFunctionReturn(0);
}

/*
   Measures the contraction of a linear stage with factors in single precision: the factor by which one solve reduces the error in the energy norm, the
   larger one of two solves in a row, for forces that excite all displacements. Rounding affects soft displacements most, and a mechanism entirely: a
   small factor proves that there is none. The error of an iterative coarse solve is small beside it. Overwrites linear->g and the coarse vectors.
   Collective on sub->object
*/
PetscErrorCode LatinSubstructuresContraction(LatinLinear *linear, PetscReal *contraction)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         n   = sub->bs * sub->copies;
  PetscReal             *left, *U, *f, before = 0.0, after;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(n, &left, n, &U, n, &f));
  PetscCall(LatinOperatorDiagonal(sub, left));
  for (PetscInt i = 0; i < n; i++) left[i] = PetscSqrtReal(left[i]) * PetscSinReal(1.0 + 12.9898 * (PetscReal)(i % 100003));
  *contraction = PETSC_SMALL;
  for (PetscInt k = 0; k < 3; k++) {
    PetscCall(PetscArraycpy(linear->g, left, n));
    PetscCall(PetscArrayzero(U, n));
    linear->energy = 0.0;
    for (PetscInt b = 0; b < linear->batches->n; b++) PetscCall(LatinSubstructuresForward(linear, b));
    PetscCall(LatinCoarseSolve(linear->coarse, PetscSqr(LATIN_ROUNDED_CONTRACTION)));
    for (PetscInt b = 0; b < linear->batches->n; b++) PetscCall(LatinSubstructuresBackward(linear, b, U));
    PetscCall(MPIU_Allreduce(&linear->energy, &after, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm(sub->object)));
    if (k) *contraction = before > 0.0 && after >= 0.0 ? PetscMax(*contraction, PetscSqrtReal(after / before)) : 1.0;
    before = after;
    PetscCall(LatinOperatorMult(sub, U, f));
    for (PetscInt i = 0; i < n; i++) left[i] -= f[i];
  }
  PetscCall(PetscInfo(sub->object, "factors in single precision: a stage reduces the error by a factor of %g\n", (double)*contraction));
  PetscCall(PetscFree3(left, U, f));
  PetscFunctionReturn(0);
}

/*
   Releases the entries of the operators, which only factorisations read and LatinSubstructuresFill() computes again. Column indices are kept if another
   set-up may compare them with its own
*/
static void LatinSubstructuresRelease(LatinLinear *linear)
{
  if (linear->sub->dense) return; /* the matrix belongs to the caller, who may change it */
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const LatinSparse *K = &linear->solvers->rows[b];

    LatinRoomRelease(K->a, (size_t)K->i[K->rows] * sizeof(*K->a));
    if (!linear->sub->preconditions && !linear->sub->part) LatinRoomRelease(K->j, (size_t)K->i[K->rows] * sizeof(*K->j));
  }
  linear->released = PETSC_TRUE;
}

/* Computes released entries again, before others read them */
PetscErrorCode LatinSubstructuresFill(LatinLinear *linear)
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n && linear->released; b++) {
    LatinSparse *K = &linear->solvers->rows[b], again;

    PetscCall(LatinDirectionMatrix(linear->dir, linear->batches->batch[b].sub[0], linear->spring, &again));
    PetscCheck(again.i[K->rows] == K->i[K->rows], PETSC_COMM_SELF, PETSC_ERR_PLIB, "The operator of batch %" PetscInt_FMT " has changed", b);
    PetscCall(PetscArraycpy(K->a, again.a, K->i[K->rows]));
    PetscCall(PetscArraycpy(K->j, again.j, K->i[K->rows]));
    PetscCall(LatinSparseReset_Private(&again));
  }
  linear->released = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Callback of the factorisation: releases the entries of its operator, or (again) computes them, see LatinEntriesCallback */
static PetscErrorCode LatinSubstructuresEntries_Private(void *owner, PetscBool again)
{
  LatinLinear *linear = (LatinLinear *)owner;

  PetscFunctionBegin;
  if (again) PetscCall(LatinSubstructuresFill(linear));
  else LatinSubstructuresRelease(linear);
  PetscFunctionReturn(0);
}

/*
   Returns the callback that releases the entries during the factorisation: those of a single sparse operator. Of several, the others are still needed;
   a dense one belongs to the caller
*/
LatinEntriesCallback LatinSubstructuresCallback(LatinLinear *linear)
{
  const PetscBool releases = (PetscBool)(linear->substructures && linear->batches->n == 1 && !linear->sub->dense);

  return (LatinEntriesCallback){.call = releases ? LatinSubstructuresEntries_Private : NULL, .owner = linear};
}

/*
   Gets H of all batches from their factors. A single batch gives the Schur complement of its factor without a copy, as it may be as large as the
   factor; a single subdomain its lower triangle
*/
PetscErrorCode LatinSubstructuresStiffness(LatinLinear *linear)
{
  size_t room = 0;
  Mat    F;

  PetscFunctionBegin;
  if (linear->batches->n == 1) {
    PetscCall(LatinSubstructuresFactor(linear, 0, &F));
    LatinSubstructuresRelease(linear);
    linear->stiffness.lower = (PetscBool)(linear->sub->n == 1);
    if (linear->stiffness.lower) PetscCall(LatinCholeskyTakeLower(F, &linear->stiffness.H));
    else PetscCall(LatinCholeskyTakeSchur(F, &linear->stiffness.H));
    PetscFunctionReturn(0);
  }
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const PetscInt s = linear->batches->batch[b].sub[0];

    room += PetscSqr((size_t)(linear->coarse->offset[s + 1] - linear->coarse->offset[s]));
  }
  PetscCall(PetscMalloc1(room, &linear->stiffness.H));
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const PetscInt s = linear->batches->batch[b].sub[0], m = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
    PetscReal     *S;

    PetscCall(LatinSubstructuresFactor(linear, b, &F));
    PetscCall(LatinCholeskyTakeSchur(F, &S));
    PetscCall(PetscArraycpy(linear->stiffness.H + linear->stiffness.h_offset[s], S, (size_t)m * (size_t)m));
    PetscCall(PetscFree(S));
  }
  LatinSubstructuresRelease(linear);
  PetscFunctionReturn(0);
}

/* Computes H of subdomain s again, which was freed after the coarse assembly: factors the operator once more */
PetscErrorCode LatinSubstructuresStiffnessAgain(LatinLinear *linear, PetscInt s, PetscReal H[])
{
  const PetscInt  m     = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
  const PetscBool empty = linear->released;
  PetscInt        b     = 0;
  PetscReal      *S;
  MatFactorInfo   info;
  Mat             F;

  PetscFunctionBegin;
  while (linear->batches->batch[b].sub[0] != linear->batches->pattern[s]) b++;
  PetscCall(LatinSubstructuresFactor(linear, b, &F));
  PetscCall(LatinSubstructuresFill(linear));
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorNumeric(F, linear->solvers->K[b], &info));
  PetscCall(LatinCholeskyTakeSchur(F, &S));
  PetscCall(PetscArraycpy(H, S, (size_t)m * (size_t)m));
  PetscCall(PetscFree(S));
  if (empty) LatinSubstructuresRelease(linear);
  PetscFunctionReturn(0);
}
