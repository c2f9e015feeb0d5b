#include "base/room.h"
#include "stages/latinstages.h"

/*
   Substructures: where all interfaces are primal and the local solver is the default, the inside of a subdomain is
   eliminated once. Its Schur complement is H, and a linear stage takes one solve in two halves: forces of the inside go
   to the interfaces, the coarse problem gives the displacements there, those of the inside follow. Nothing dense is
   kept: H goes into the coarse matrix.
*/

PetscErrorCode LatinSubstructuresAre(const LatinLinear *linear, PetscBool *are)
{
  PetscFunctionBegin;
  *are = PETSC_FALSE;
  if (linear->inter->variant == LATIN_VARIANT_PRIMAL) PetscCall(LatinSolverIsDefault_Private(linear->sub->object, "local", are));
  PetscFunctionReturn(0);
}

/* The factor of a batch */
PetscErrorCode LatinSubstructuresFactor(const LatinLinear *linear, PetscInt batch, Mat *F)
{
  PC pc;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(linear->solvers->ksp[batch], &pc));
  PetscCall(PCFactorGetMatrix(pc, F));
  PetscFunctionReturn(0);
}

/*
   What a stage leaves to the next one, in energy, where factors are in single precision: the largest share of two in a row, for
   forces in which all displacements have a part. Soft displacements are what rounding disturbs most, and one that costs nothing
   it disturbs entirely: where little is left there is no mechanism. What a coarse iteration leaves is small beside it. Collective on sub->object
*/
PetscErrorCode LatinSubstructuresLeft(LatinLinear *linear, PetscReal *left)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         n   = sub->bs * sub->copies;
  PetscReal             *b, *U, *f, before = 0.0, after;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(n, &b, n, &U, n, &f));
  PetscCall(LatinOperatorDiagonal(sub, b));
  for (PetscInt i = 0; i < n; i++) b[i] = PetscSqrtReal(b[i]) * PetscSinReal(1.0 + 12.9898 * (PetscReal)(i % 100003));
  *left = PETSC_SMALL;
  for (PetscInt k = 0; k < 3; k++) {
    PetscCall(PetscArraycpy(linear->g, b, n));
    PetscCall(PetscArrayzero(U, n));
    PetscCall(LatinSubstructuresForward(linear));
    PetscCall(LatinCoarseSolve(linear->coarse, PetscSqr(LATIN_ROUNDED_LEFT)));
    PetscCall(LatinSubstructuresBackward(linear, U));
    PetscCall(MPIU_Allreduce(&linear->energy, &after, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm(sub->object)));
    if (k) *left = before > 0.0 && after >= 0.0 ? PetscMax(*left, PetscSqrtReal(after / before)) : 1.0;
    before = after;
    PetscCall(LatinOperatorMult(sub, U, f));
    for (PetscInt i = 0; i < n; i++) b[i] -= f[i];
  }
  PetscCall(PetscInfo(sub->object, "factors in single precision: a stage leaves %g to the next\n", (double)*left));
  PetscCall(PetscFree3(b, U, f));
  PetscFunctionReturn(0);
}

/* Entries of the operators, which their factorisations alone read: they go, where they can be made again. Not their columns where another set-up follows, which looks whether it has the same */
static void LatinSubstructuresEmpty(LatinLinear *linear)
{
  if (linear->sub->dense) return; /* the caller's, who may change it */
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const LatinSparse *K = &linear->solvers->rows[b];

    LatinRoomEmpty(K->a, (size_t)K->i[K->rows] * sizeof(*K->a));
    if (!linear->sub->preconditions && !linear->sub->part) LatinRoomEmpty(K->j, (size_t)K->i[K->rows] * sizeof(*K->j));
  }
  linear->empty = PETSC_TRUE;
}

/* Before others read them */
PetscErrorCode LatinSubstructuresFill(LatinLinear *linear)
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n && linear->empty; b++) {
    LatinSparse *K = &linear->solvers->rows[b], again;

    PetscCall(LatinDirectionMatrix(linear->dir, linear->batches->batch[b].sub[0], linear->spring, &again));
    PetscCheck(again.i[K->rows] == K->i[K->rows], PETSC_COMM_SELF, PETSC_ERR_PLIB, "The operator of batch %" PetscInt_FMT " is no longer what it was", b);
    PetscCall(PetscArraycpy(K->a, again.a, K->i[K->rows]));
    PetscCall(PetscArraycpy(K->j, again.j, K->i[K->rows]));
    PetscCall(LatinSparseReset_Private(&again));
  }
  linear->empty = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* The factorisation of the only operator tells when its entries may go, and where it is made again when it needs them, see LatinSpending */
static PetscErrorCode LatinSubstructuresSpend_Private(void *owner, PetscBool again)
{
  LatinLinear *linear = (LatinLinear *)owner;

  PetscFunctionBegin;
  if (again) PetscCall(LatinSubstructuresFill(linear));
  else LatinSubstructuresEmpty(linear);
  PetscFunctionReturn(0);
}

/* What may go of the operators while they are factored: of several the others are still to be read, and a dense one is the caller's */
LatinSpending LatinSubstructuresSpending(LatinLinear *linear)
{
  const PetscBool spends = (PetscBool)(linear->substructures && linear->batches->n == 1 && !linear->sub->dense);

  return (LatinSpending){.tell = spends ? LatinSubstructuresSpend_Private : NULL, .owner = linear};
}

/* H of all batches; of a single one that of its factor, which may be as large as the factor itself, without a copy, and of a single subdomain its lower triangle */
PetscErrorCode LatinSubstructuresStiffness(LatinLinear *linear)
{
  size_t room = 0;
  Mat    F;

  PetscFunctionBegin;
  if (linear->batches->n == 1) {
    PetscCall(LatinSubstructuresFactor(linear, 0, &F));
    LatinSubstructuresEmpty(linear);
    linear->stiffness.lower = (PetscBool)(linear->sub->n == 1);
    if (linear->stiffness.lower) PetscCall(LatinCholeskyGiveLower(F, &linear->stiffness.H));
    else PetscCall(LatinCholeskyGiveSchur(F, &linear->stiffness.H));
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
    PetscCall(LatinCholeskyGiveSchur(F, &S));
    PetscCall(PetscArraycpy(linear->stiffness.H + linear->stiffness.h_offset[s], S, (size_t)m * (size_t)m));
    PetscCall(PetscFree(S));
  }
  LatinSubstructuresEmpty(linear);
  PetscFunctionReturn(0);
}

/* H of subdomain s, which has gone into the coarse matrix: its factor is made once more */
PetscErrorCode LatinSubstructuresStiffnessAgain(LatinLinear *linear, PetscInt s, PetscReal H[])
{
  const PetscInt  m     = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
  const PetscBool empty = linear->empty;
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
  PetscCall(LatinCholeskyGiveSchur(F, &S));
  PetscCall(PetscArraycpy(H, S, (size_t)m * (size_t)m));
  PetscCall(PetscFree(S));
  if (empty) LatinSubstructuresEmpty(linear);
  PetscFunctionReturn(0);
}

/* The first half, in place of the forces g, and the forces on the coarse dofs */
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

/* The second half, with the coarse displacements: adds to U */
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
  linear->rounded = (PetscSqr(linear->solvers->rounding) + PetscSqr(linear->coarse->left)) * linear->energy;
  PetscFunctionReturn(0);
}
