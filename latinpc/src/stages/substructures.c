#include "stages/latinstages.h"

/*
   Substructures: where all interfaces are primal and the local solver is the default, the inside of a subdomain is
   eliminated once. Its Schur complement is H, and a linear stage takes one solve in two halves: forces of the inside go
   to the interfaces, the coarse problem gives the displacements there, those of the inside follow. Nothing dense is
   kept but H.
*/

PetscErrorCode LatinSubstructuresAre(const LatinLinear *linear, PetscBool *are)
{
  PetscFunctionBegin;
  *are = PETSC_FALSE;
  if (linear->inter->variant == LATIN_VARIANT_PRIMAL) PetscCall(LatinSolverIsDefault_Private(linear->sub->object, "local", are));
  PetscFunctionReturn(0);
}

/* The factor of a batch */
static PetscErrorCode LatinSubstructuresFactor_Private(const LatinLinear *linear, PetscInt batch, Mat *F)
{
  PC pc;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(linear->solvers->ksp[batch], &pc));
  PetscCall(PCFactorGetMatrix(pc, F));
  PetscFunctionReturn(0);
}

/* H of all batches */
PetscErrorCode LatinSubstructuresStiffness(LatinLinear *linear)
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const PetscInt     s = linear->batches->batch[b].sub[0], m = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
    const PetscScalar *S;
    Mat                F, dense;

    if (!m) continue;
    PetscCall(LatinSubstructuresFactor_Private(linear, b, &F));
    PetscCall(LatinCholeskyGiveSchur(F, &dense));
    PetscCall(MatDenseGetArrayRead(dense, &S));
    PetscCall(PetscArraycpy(linear->stiffness.H + linear->stiffness.h_offset[s], S, (size_t)m * (size_t)m));
    PetscCall(MatDenseRestoreArrayRead(dense, &S));
    PetscCall(MatDestroy(&dense));
  }
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
    PetscCall(LatinSubstructuresFactor_Private(linear, b, &F));
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
    PetscCall(LatinSubstructuresFactor_Private(linear, b, &F));
    for (PetscInt m = 0; m < linear->batches->batch[b].members; m++) PetscCall(LatinCholeskyBackward(F, linear->g + sub->bs * sub->node_offset[linear->batches->batch[b].sub[m]], &linear->energy));
  }
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++) U[i] += linear->g[i];
  linear->rounded = PetscSqr(linear->solvers->rounding) * linear->energy;
  PetscFunctionReturn(0);
}
