#include "stages/latinstages.h"

/* The fixed-point map z -> G(z) of section 3.3, a linear stage and then a local stage; its state z and its displacements. */

/* Creates a state: side dofs, then nonsmooth links. Collective on sub->object */
PetscErrorCode LatinCreateState_Private(const LatinLinear *linear, Vec *z)
{
  PetscFunctionBegin;
  PetscCall(VecCreate(PetscObjectComm(linear->sub->object), z));
  PetscCall(VecSetSizes(*z, linear->inter->sides + linear->sub->nonsmooth, PETSC_DETERMINE));
  PetscCall(VecSetType(*z, VECSTANDARD));
  PetscCall(PetscObjectSetName((PetscObject)*z, "LATIN state"));
  PetscFunctionReturn(0);
}

/*
   Sets the state of the prestressed configuration: zero on interfaces, nonsmooth links taut under their prestrain, rigid links without tension,
   displacements zero but for prescribed ones.
*/
PetscErrorCode LatinInitialState_Private(LatinLinear *linear, Vec z)
{
  const LatinSubdomains *sub = linear->sub;
  PetscScalar           *a;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(linear->U, sub->prescribed, linear->sub->bs * sub->copies));
  PetscCall(PetscArrayzero(linear->pull, linear->inter->sides));
  PetscCall(VecGetArrayWrite(z, &a));
  for (PetscInt k = 0; k < linear->inter->sides; k++) a[k] = 0.0;
  for (PetscInt i = 0; i < sub->nonsmooth; i++) {
    const PetscInt  l   = sub->nonsmooth_link[i];
    const LatinLaw *law = &LatinLaws[sub->law[l]];

    if (sub->law[l] <= LATIN_LAW_COMPRESSION_ONLY) a[linear->inter->sides + i] = sub->stiffness[l] * sub->e0[l];
    else a[linear->inter->sides + i] = law->rigid ? 0.0 : law->tension(sub->stiffness[l], sub->e0[l], law->ctx);
  }
  if (linear->rigid_tension) PetscCall(PetscArrayzero(linear->rigid_tension, sub->structure->links_local));
  PetscCall(VecRestoreArrayWrite(z, &a));
  PetscFunctionReturn(0);
}

/*
   Computes Gz = G(z): linear stage, local stage. Updates the displacements linear->U and the indicator. G depends on z alone: linear->U on entry is the
   initial guess of the linear stage, which solves for an increment. Collective on sub->object
*/
PetscErrorCode LatinApply_Private(LatinLinear *linear, Vec z, Vec Gz)
{
  const PetscScalar *a;
  PetscScalar       *b;

  PetscFunctionBegin;
  linear->failed    = PETSC_FALSE;
  linear->corrected = PETSC_TRUE;
  PetscCall(VecGetArrayRead(z, &a));
  PetscCall(VecGetArrayWrite(Gz, &b));
  PetscCall(LatinGatherForces_Private(linear, a));
  PetscCall(LatinLinearApply(linear, linear->U));
  linear->corrected = PETSC_FALSE;
  PetscCall(LatinLocalStage_Private(linear, a, b));
  PetscCall(VecRestoreArrayRead(z, &a));
  PetscCall(VecRestoreArrayWrite(Gz, &b));
  linear->applications++;
  PetscFunctionReturn(0);
}

/*
   Computes u, the mean displacement of the copies of each node and the displacements of dofs in no subdomain. Overwrites linear->g. Collective on
   sub->object
*/
PetscErrorCode LatinAverage_Private(LatinLinear *linear, Vec u)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         bs  = sub->bs;
  PetscReal             *w   = linear->g; /* free as work space between linear stages */
  PetscScalar           *a;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) w[i] = linear->U[i] / sub->multiplicity[i / bs];
  PetscCall(LatinSum_Private(sub, w, u));
  PetscCall(VecGetArray(u, &a));
  for (PetscInt k = 0; k < sub->unassigned_count; k++) a[sub->unassigned[k]] = linear->unassigned_u[k];
  PetscCall(VecRestoreArray(u, &a));
  PetscFunctionReturn(0);
}

/*
   Computes the relative errors of the displacements linear->U from a reference on copies, in the Euclidean and the energy norm; absolute if the
   reference is zero. Collective on sub->object
*/
PetscErrorCode LatinErrors_Private(const LatinLinear *linear, const PetscReal reference[], PetscReal *l2, PetscReal *energy)
{
  const LatinSubdomains *sub    = linear->sub;
  const PetscInt         dim    = linear->sub->dim;
  const PetscReal       *U      = linear->U;
  PetscReal              sum[4] = {0.0, 0.0, 0.0, 0.0}, total[4];

  PetscFunctionBegin;
  for (PetscInt i = 0; i < dim * sub->copies; i++) {
    sum[0] += PetscSqr(U[i] - reference[i]);
    sum[1] += PetscSqr(reference[i]);
  }
  for (PetscInt l = 0; l < sub->links; l++) {
    const PetscReal r = LatinElongation(sub, dim, l, reference);

    sum[2] += sub->stiffness[l] * PetscSqr(LatinElongation(sub, dim, l, U) - r);
    sum[3] += sub->stiffness[l] * PetscSqr(r);
  }
  PetscCall(MPIU_Allreduce(sum, total, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm(linear->sub->object)));
  *l2     = PetscSqrtReal(total[1] > 0.0 ? total[0] / total[1] : total[0]);
  *energy = PetscSqrtReal(total[3] > 0.0 ? total[2] / total[3] : total[2]);
  PetscFunctionReturn(0);
}

/* Scatters the tensions of rigid links of the last local stage to the links of the structure. Collective on sub->object */
PetscErrorCode LatinReturnTensions_Private(LatinLinear *linear)
{
  PetscFunctionBegin;
  if (linear->sub->structure && linear->sub->structure->rigid_law >= 0) PetscCall(LatinSubdomainsReturn_Private(linear->sub, linear->tension, linear->rigid_tension));
  PetscFunctionReturn(0);
}
