#include "base/room.h"
#include "stages/latinstages.h"

/*
   Substructuring: all interfaces are primal and the local solver is the default. The interior of each subdomain is eliminated
   once; H is its Schur complement on the interfaces. A linear stage is one solve: forward substitution condenses the forces
   on the interfaces, the coarse problem gives the displacements there, backward substitution those of the interior.
   No dense matrix is kept: H is added to the coarse matrix.
*/

PetscErrorCode LatinSubstructuresFactor(const LatinLinear *linear, PetscInt batch, Mat *F)
{
  PC pc;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(linear->solvers->ksp[batch], &pc));
  PetscCall(PCFactorGetMatrix(pc, F));
  PetscFunctionReturn(0);
}

/*
   Measures the contraction of a linear stage with factors in single precision: the factor by which one solve reduces the error in the
   energy norm, the larger one of two solves in a row, for forces that excite all displacements. Rounding affects soft displacements
   most, and a mechanism entirely: a small factor proves that there is none. The error of an iterative coarse solve is small
   beside it. Collective on sub->object
*/
PetscErrorCode LatinSubstructuresContraction(LatinLinear *linear, PetscReal *contraction)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         n   = sub->bs * sub->copies;
  PetscReal             *b, *U, *f, before = 0.0, after;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(n, &b, n, &U, n, &f));
  PetscCall(LatinOperatorDiagonal(sub, b));
  for (PetscInt i = 0; i < n; i++) b[i] = PetscSqrtReal(b[i]) * PetscSinReal(1.0 + 12.9898 * (PetscReal)(i % 100003));
  *contraction = PETSC_SMALL;
  for (PetscInt k = 0; k < 3; k++) {
    PetscCall(PetscArraycpy(linear->g, b, n));
    PetscCall(PetscArrayzero(U, n));
    PetscCall(LatinSubstructuresForward(linear));
    PetscCall(LatinCoarseSolve(linear->coarse, PetscSqr(LATIN_ROUNDED_CONTRACTION)));
    PetscCall(LatinSubstructuresBackward(linear, U));
    PetscCall(MPIU_Allreduce(&linear->energy, &after, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm(sub->object)));
    if (k) *contraction = before > 0.0 && after >= 0.0 ? PetscMax(*contraction, PetscSqrtReal(after / before)) : 1.0;
    before = after;
    PetscCall(LatinOperatorMult(sub, U, f));
    for (PetscInt i = 0; i < n; i++) b[i] -= f[i];
  }
  PetscCall(PetscInfo(sub->object, "factors in single precision: a stage reduces the error by a factor of %g\n", (double)*contraction));
  PetscCall(PetscFree3(b, U, f));
  PetscFunctionReturn(0);
}

/* Releases the entries of the operators, which only factorisations read and LatinSubstructuresFill() computes again. Column indices are kept if another set-up may compare them with its own */
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

/* Computes the entries again, before others read them */
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

/* Callback of the factorisation: releases the entries of its operator, or computes them again, see LatinEntriesCallback */
static PetscErrorCode LatinSubstructuresEntries_Private(void *owner, PetscBool again)
{
  LatinLinear *linear = (LatinLinear *)owner;

  PetscFunctionBegin;
  if (again) PetscCall(LatinSubstructuresFill(linear));
  else LatinSubstructuresRelease(linear);
  PetscFunctionReturn(0);
}

/* The entries that may be released during the factorisation: those of a single sparse operator. Of several, the others are still needed; a dense one belongs to the caller */
LatinEntriesCallback LatinSubstructuresCallback(LatinLinear *linear)
{
  const PetscBool releases = (PetscBool)(linear->substructures && linear->batches->n == 1 && !linear->sub->dense);

  return (LatinEntriesCallback){.call = releases ? LatinSubstructuresEntries_Private : NULL, .owner = linear};
}

/* H of all batches. A single batch gives the Schur complement of its factor without a copy, as it may be as large as the factor; a single subdomain its lower triangle */
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

/* H of subdomain s, which was freed after the coarse assembly: factors the operator once more */
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

/* Forward substitution in place of the forces g, and the condensed forces q */
PetscErrorCode LatinSubstructuresForward(LatinLinear *linear)
{
  const LatinSubdomains *sub   = linear->sub;
  const LatinInterfaces *inter = linear->inter;
  Mat                    F;

  PetscFunctionBegin;
  linear->energy = 0.0;
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++)
    if (sub->fixed[i]) linear->g[i] = 0.0;
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    PetscCall(LatinSubstructuresFactor(linear, b, &F));
    for (PetscInt m = 0; m < linear->batches->batch[b].members; m++) PetscCall(LatinCholeskyForward(F, linear->g + sub->bs * sub->node_offset[linear->batches->batch[b].sub[m]], &linear->energy));
  }
  for (PetscInt p = 0; p < inter->primal_offset[sub->n]; p++) linear->coarse->q[p] = linear->g[inter->primal_dof[p]];
  PetscFunctionReturn(0);
}

/* Backward substitution from the coarse displacements: adds the increment to U */
PetscErrorCode LatinSubstructuresBackward(LatinLinear *linear, PetscReal U[])
{
  const LatinSubdomains *sub   = linear->sub;
  const LatinInterfaces *inter = linear->inter;
  Mat                    F;

  PetscFunctionBegin;
  for (PetscInt p = 0; p < inter->primal_offset[sub->n]; p++) {
    linear->g[inter->primal_dof[p]] = linear->coarse->u[p];
    linear->energy += linear->coarse->q[p] * linear->coarse->u[p];
  }
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    PetscCall(LatinSubstructuresFactor(linear, b, &F));
    for (PetscInt m = 0; m < linear->batches->batch[b].members; m++) PetscCall(LatinCholeskyBackward(F, linear->g + sub->bs * sub->node_offset[linear->batches->batch[b].sub[m]], &linear->energy));
  }
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++) U[i] += linear->g[i];
  linear->solve_error = (PetscSqr(linear->solvers->rounding) + PetscSqr(linear->coarse->contraction)) * linear->energy;
  PetscFunctionReturn(0);
}
