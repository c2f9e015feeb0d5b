#include "pc/pclatinimpl.h"

/*
   Weights of the copies of a node, a partition of unity, for forces and for the average of displacements. If the search direction has the Schur
   complements of both sides of an interface, these are the weights (deluxe scaling, of least energy); else the diagonals of the operators are (stiffness
   scaling).
*/

#define LATIN_WEIGHT_LEAST LatinByPrecision(1e-12, 1e-5) /* stiffness added to that of each copy, relative to the largest one */

/* Computes data->weight of the stiffness scaling: diagonal entry of a copy over the sum at its node. Overwrites data->work, f. Collective on pc */
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
  /* weights must sum to 1 at nodes where no copy has a stiffness */
  for (PetscInt i = 0; i < bs * sub->copies; i++) stiffness[i] += LATIN_WEIGHT_LEAST * (largest > 0.0 ? largest : 1.0);
  PetscCall(LatinSum_Private(sub, stiffness, data->work));
  PetscCall(PetscArrayzero(data->f, bs * sub->copies));
  PetscCall(LatinDistribute_Private(sub, data->work, data->f));
  for (PetscInt i = 0; i < bs * sub->copies; i++) data->weight[i] = sub->fixed[i] ? 0.0 : stiffness[i] / data->f[i];
  PetscFunctionReturn(0);
}

/*
   Computes part: weights times `whole`, forces or displacements of the copies; in interiors, whose weights are 1, zero if solved exactly. Overwrites
   data->side
*/
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
