#include "latinimpl.h"

/*
   Local stage of section 3.3, explicit and pointwise, written for the data that the linear stage needs:

   interfaces  the conditions (23) along the ascent direction give each side the datum F_hat + d U_hat equal to
               d U - F of its mate; with (27), F = z - d U on the micro space, the new datum is 2 d U - z of the mate;
   links       the law along the ascent direction l = k: y = tau + l e = s + 2 l e decides the new datum
               s = tau_hat - l e_hat, see laws.c.

   The distance between the two stages measures convergence: on a side z_new - z = 2 d (U_hat - U), on a link
   s_new - s = -2 l (e_hat - e). The indicator is that distance in the energy of the search directions, relative to
   the energy of the elongations that carry tension, which neither rigid motions nor slack links blow up.
*/

#define LATIN_NOISE 1e-14 /* relative to the energy of the structure, prestress included: below it nothing can be told apart */

/*
   The forces D (1 - R R^t D) U of the search direction on one side of an interface, from the micro part of the
   displacements alone. The macro part is taken from this side: it is the coarse displacement but for rounding, which
   would add up in z without an end.
*/
static PetscErrorCode LatinPull_Private(Latin latin, const LatinInterface *face)
{
  const PetscInt rows = face->side_last - face->side_first;
  PetscReal     *v = latin->direction_work, *pull = latin->linear.pull + face->side_first;

  PetscFunctionBegin;
  for (PetscInt r = 0; r < rows; r++) v[r] = latin->linear.U[latin->inter.side_dof[face->side_first + r]];
  if (face->modes) {
    PetscReal *w = latin->linear.lambda;

    PetscCall(LatinDirectionApply(latin, face, v, pull));
    for (PetscInt j = 0; j < face->modes; j++) w[j] = 0.0;
    for (PetscInt r = 0; r < rows; r++) {
      const PetscReal *row = LatinMacroRow(&latin->macro, face, face->side_first + r);

      for (PetscInt j = 0; j < face->modes; j++) w[j] += row[j] * pull[r];
    }
    for (PetscInt r = 0; r < rows; r++) {
      const PetscReal *row = LatinMacroRow(&latin->macro, face, face->side_first + r);

      for (PetscInt j = 0; j < face->modes; j++) v[r] -= row[j] * w[j];
    }
  }
  PetscCall(LatinDirectionApply(latin, face, v, pull));
  PetscFunctionReturn(0);
}

/*
   g = F - B^t (s + l e) + C^t (z - D U): what the displacements of the last linear stage leave unbalanced in the state
   z, with the tensions and the interface forces of (26) and (27). The linear stage then solves for the change of the
   displacements, and what it rounds, or leaves to an inexact solver, is small with that change.
*/
PetscErrorCode LatinGatherForces_Private(Latin latin, const PetscReal z[])
{
  LatinInterfaces *inter = &latin->inter;
  PetscReal       *g     = latin->linear.g;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(g, latin->linear.load, latin->links->dim * latin->sub.copies));
  LatinSweepForces(latin, z + inter->sides);
  for (PetscInt k = 0; k < inter->sides; k++) g[inter->side_dof[k]] += z[k] - latin->linear.pull[k];
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLocalStage_Private(Latin latin, const PetscReal z[], PetscReal Gz[])
{
  LatinInterfaces *inter  = &latin->inter;
  PetscReal        sum[4] = {0.0, 0.0, 0.0, 0.0}, total[4];

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Local, latin, 0, 0, 0));
  for (PetscInt f = 0; f < inter->count; f++) PetscCall(LatinPull_Private(latin, &inter->interface[f]));
  for (PetscInt k = 0; k < inter->sides; k++) latin->outgoing[k] = 2.0 * latin->linear.pull[k] - z[k];
  PetscCall(PetscSFBcastBegin(inter->mate_sf, MPIU_REAL, latin->outgoing, Gz, MPI_REPLACE));
  if (latin->links->general) LatinLinkStageGeneral(latin, z + inter->sides, Gz + inter->sides, sum);
  else LatinSweepStage(latin, z + inter->sides, Gz + inter->sides, sum);
  PetscCall(PetscSFBcastEnd(inter->mate_sf, MPIU_REAL, latin->outgoing, Gz, MPI_REPLACE));
  for (PetscInt f = 0; f < inter->count; f++) PetscCall(LatinDirectionEnergy(latin, &inter->interface[f], Gz + inter->interface[f].side_first, z + inter->interface[f].side_first, &sum[0]));
  sum[3] = latin->failed ? 1.0 : 0.0; /* a local solver that failed on one rank has failed on all */
  PetscCall(MPIU_Allreduce(sum, total, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  latin->failed    = (PetscBool)(total[3] > 0.0);
  latin->noise     = LATIN_NOISE * PetscSqrtReal(PetscMax(total[1], total[2]));
  latin->distance  = PetscSqrtReal(total[0]);
  latin->indicator = total[1] > 0.0 ? PetscSqrtReal(total[0] / total[1]) : latin->distance;
  PetscCall(PetscLogEventEnd(LATIN_Local, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Errors of the displacements of all subdomains against a reference given for the copies; total = |difference|^2, |reference|^2 twice */
PetscErrorCode LatinErrors_Private(Latin latin, const PetscReal reference[], PetscReal *l2, PetscReal *energy)
{
  LatinSubstructure *sub    = &latin->sub;
  const PetscInt     dim    = latin->links->dim;
  const PetscReal   *U      = latin->linear.U;
  PetscReal          sum[4] = {0.0, 0.0, 0.0, 0.0}, total[4];

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
  PetscCall(MPIU_Allreduce(sum, total, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  *l2     = PetscSqrtReal(total[1] > 0.0 ? total[0] / total[1] : total[0]);
  *energy = PetscSqrtReal(total[3] > 0.0 ? total[2] / total[3] : total[2]);
  PetscFunctionReturn(0);
}
