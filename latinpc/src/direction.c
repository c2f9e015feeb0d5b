#include "latinimpl.h"

/*
   The micro search direction d of the interfaces, one positive number a side degree of freedom, the same on both
   sides. Self-tuned: a fraction of the stiffness that the two subdomains show at the interface (the diagonal of
   B^t k B), averaged over the interface for `scalar`. Section 6 explains why a stiffness of the subdomain is the right
   scale; the fraction is a property of the iteration, not of the units.
*/

static PetscErrorCode LatinDirectionDiagonal_Private(Latin latin, PetscReal diagonal[])
{
  LatinSubstructure *sub = &latin->sub;
  const PetscInt     dim = latin->links->dim;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(diagonal, dim * sub->copies));
  for (PetscInt l = 0; l < sub->links; l++)
    for (PetscInt c = 0; c < dim; c++) {
      const PetscReal v = sub->stiffness[l] * PetscSqr(sub->direction[dim * l + c]);

      diagonal[dim * sub->ends[2 * l] + c] += v;
      diagonal[dim * sub->ends[2 * l + 1] + c] += v;
    }
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDirectionSetUp(Latin latin)
{
  LatinSubstructure *sub   = &latin->sub;
  LatinInterfaces   *inter = &latin->inter;
  PetscReal         *diagonal, *mine, *mate, sum[2] = {0.0, 0.0}, fallback;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Direction, latin, 0, 0, 0));
  PetscCall(PetscMalloc1(inter->sides, &latin->macro.d));
  if (latin->direction_scalar > 0.0) {
    for (PetscInt k = 0; k < inter->sides; k++) latin->macro.d[k] = latin->direction_scalar;
  } else {
    PetscCall(PetscMalloc3(latin->links->dim * sub->copies, &diagonal, inter->sides, &mine, inter->sides, &mate));
    PetscCall(LatinDirectionDiagonal_Private(latin, diagonal));
    for (PetscInt k = 0; k < inter->sides; k++) mine[k] = diagonal[inter->side_dof[k]];
    PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, mate));
    for (PetscInt k = 0; k < inter->sides; k++) sum[0] += 0.5 * (mine[k] + mate[k]);
    sum[1] = inter->sides;
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
    fallback = sum[0] > 0.0 ? sum[0] / sum[1] : 1.0;
    for (PetscInt f = 0; f < inter->count; f++) {
      const LatinInterface *face = &inter->interface[f];
      PetscReal             mean = 0.0;

      /* the sums run over the same numbers in the same order on both sides: the results are the same to the bit */
      for (PetscInt k = face->side_first; k < face->side_last; k++) mean += 0.5 * (mine[k] + mate[k]);
      if (face->side_last > face->side_first) mean /= face->side_last - face->side_first;
      if (!(mean > 0.0)) mean = fallback; /* no link of the two subdomains pulls in these directions */
      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        /* a dof that hardly any link reaches must not lose its spring: K_E stays regular thanks to it */
        const PetscReal own = PetscMax(0.5 * (mine[k] + mate[k]), 0.1 * mean);

        latin->macro.d[k] = latin->direction_fraction * (latin->direction == LATIN_DIRECTION_DIAGONAL ? own : mean);
      }
    }
    PetscCall(PetscFree3(diagonal, mine, mate));
  }
  PetscCall(PetscLogEventEnd(LATIN_Direction, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}
