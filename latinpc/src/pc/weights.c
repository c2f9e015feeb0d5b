#include "pc/pclatinimpl.h"

/*
   How the copies of a node share its force, and how their displacements are averaged: so that it costs least energy, by
   the Schur complements of the two sides of an interface, where the search direction has them; elsewhere in proportion to
   the diagonal of their operators.
*/

#define LATIN_WEIGHT_LEAST LatinByPrecision(1e-12, 1e-5) /* of the largest stiffness: what a copy without stiffness counts */

/* The part of each copy in its node, in proportion to the stiffness (diagonal of its operator) */
PetscErrorCode PCLatinWeights_Private(PC pc)
{
  PC_Latin              *data      = (PC_Latin *)pc->data;
  Latin                  latin     = data->latin;
  const LatinSubdomains *sub       = &latin->sub;
  const PetscInt         bs        = sub->bs;
  PetscReal             *stiffness = latin->linear.g, largest = 0.0;

  PetscFunctionBegin;
  PetscCall(LatinOperatorDiagonal(sub, stiffness));
  for (PetscInt i = 0; i < bs * sub->copies; i++) largest = PetscMax(largest, stiffness[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &largest, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)pc)));
  /* a copy without stiffness keeps a part of its node, or nobody would move it where no copy has any */
  for (PetscInt i = 0; i < bs * sub->copies; i++) stiffness[i] += LATIN_WEIGHT_LEAST * (largest > 0.0 ? largest : 1.0);
  PetscCall(LatinSum_Private(sub, stiffness, data->work));
  PetscCall(PetscArrayzero(data->f, bs * sub->copies));
  PetscCall(LatinDistribute_Private(sub, data->work, data->f));
  for (PetscInt i = 0; i < bs * sub->copies; i++) data->weight[i] = sub->fixed[i] ? 0.0 : stiffness[i] / data->f[i];
  PetscFunctionReturn(0);
}

/* Each copy's part of forces, or of displacements; inside subdomains the whole, or nothing where the interiors are solved exactly */
PetscErrorCode PCLatinWeigh_Private(PC pc, PetscBool forces, const PetscReal whole[], PetscReal part[])
{
  PC_Latin              *data  = (PC_Latin *)pc->data;
  Latin                  latin = data->latin;
  const LatinInterfaces *inter = &latin->inter;
  const PetscInt         bs    = latin->sub.bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * latin->sub.copies; i++) part[i] = (PCLatinInner(latin, i / bs) && data->interior.direct) || latin->sub.fixed[i] ? 0.0 : data->weight[i] * whole[i];
  for (PetscInt f = 0; f < inter->count && LatinDirectionIsDeluxe(&latin->dir); f++) {
    const LatinInterface *face = &inter->interface[f];

    if (latin->dir.matrix_first[f] < 0) continue;
    for (PetscInt k = face->side_first; k < face->side_last; k++) data->side[k - face->side_first] = whole[inter->side_dof[k]];
    PetscCall(LatinDirectionDeluxe(&latin->dir, f, forces, data->side, data->side + inter->sides));
    for (PetscInt k = face->side_first; k < face->side_last; k++) part[inter->side_dof[k]] = data->side[k - face->side_first];
  }
  PetscFunctionReturn(0);
}
