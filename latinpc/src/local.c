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

#define LATIN_NOISE LatinByPrecision(1e-14, 3e-7) /* relative to the energy of the structure, prestress included: below it nothing can be told apart */

/*
   The forces D (1 - R R^t D) U of the search direction on one side of an interface and of those equal to it in the n
   subdomains that follow, `apart` entries further each: from the micro part of the displacements alone. The macro part
   is taken from this side: it is the coarse displacement but for rounding, which would add up in z without an end.
*/
static PetscErrorCode LatinPull_Private(Latin latin, const LatinInterface *face, PetscInt n, PetscInt apart)
{
  const PetscInt    rows = face->side_last - face->side_first, modes = face->modes;
  const PetscInt   *dof   = latin->inter.side_dof + face->side_first;
  const PetscReal  *basis = latin->macro.basis + face->basis_first, *dual = latin->macro.dual + face->basis_first;
  const PetscScalar one = 1.0, zero = 0.0, minus = -1.0;
  PetscReal        *v = latin->direction_work, *w = v + rows * n, *pull = latin->linear.pull + face->side_first;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < n; k++)
    for (PetscInt r = 0; r < rows; r++) v[rows * k + r] = latin->linear.U[dof[apart * k + r]];
  if (modes && n == 1) {
    for (PetscInt j = 0; j < modes; j++) w[j] = 0.0;
    for (PetscInt r = 0; r < rows; r++)
      for (PetscInt j = 0; j < modes; j++) w[j] += dual[modes * r + j] * v[r];
    for (PetscInt r = 0; r < rows; r++)
      for (PetscInt j = 0; j < modes; j++) v[r] -= basis[modes * r + j] * w[j];
  } else if (modes) {
    PetscBLASInt br, bm, bn;

    PetscCall(PetscBLASIntCast(rows, &br));
    PetscCall(PetscBLASIntCast(modes, &bm));
    PetscCall(PetscBLASIntCast(n, &bn));
    PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &bm, &bn, &br, &one, dual, &bm, v, &br, &zero, w, &bm));
    PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &br, &bn, &bm, &minus, basis, &bm, w, &bm, &one, v, &br));
  }
  PetscCall(LatinDirectionApply(latin, face, n, v, rows, pull, apart));
  PetscFunctionReturn(0);
}

/*
   The interfaces of all subdomains here, equal subdomains that follow each other together. Without sum: the forces of
   the search direction; with sum: adds to it the squares of the distance of z and next.
*/
static PetscErrorCode LatinSweepFaces_Private(Latin latin, const PetscReal z[], const PetscReal next[], PetscReal *sum)
{
  LatinInterfaces *inter = &latin->inter;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < latin->linear.blocks.n; b++) {
    const LatinBatch *batch = &latin->linear.blocks.batch[b];
    PetscInt          n     = 1;

    for (PetscInt m = 0; m < batch->patterns * batch->members; m += n) {
      const PetscInt first = inter->offset[batch->sub[m]], last = inter->offset[batch->sub[m] + 1];
      const PetscInt apart = first < last ? inter->interface[last - 1].side_last - inter->interface[first].side_first : 0;

      n = LatinBatchRun(batch, m);
      for (PetscInt f = first; f < last; f++) {
        const LatinInterface *face = &inter->interface[f];

        if (sum) PetscCall(LatinDirectionEnergy(latin, face, n, next + face->side_first, z + face->side_first, apart, sum));
        else PetscCall(LatinPull_Private(latin, face, n, apart));
      }
    }
  }
  PetscFunctionReturn(0);
}

/*
   g = F - B^t (s + l e) - G U + C^t (z - D U), G the springs to the ground if there are any: what the displacements of
   the last linear stage leave unbalanced in the state z, with the tensions and the interface forces of (26) and (27).
   The linear stage then solves for the change of the displacements, and what it rounds, or leaves to an inexact solver,
   is small with that change.
*/
PetscErrorCode LatinGatherForces_Private(Latin latin, const PetscReal z[])
{
  LatinInterfaces *inter = &latin->inter;
  PetscReal       *g     = latin->linear.g;

  PetscFunctionBegin;
  LatinSweepForces(latin, z + inter->sides);
  for (PetscInt k = 0; k < inter->sides; k++) g[inter->side_dof[k]] += z[k] - latin->linear.pull[k];
  for (PetscInt i = 0; latin->sub.ground && i < latin->links->dim * latin->sub.copies; i++) g[i] -= latin->sub.ground[i] * latin->linear.U[i];
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLocalStage_Private(Latin latin, const PetscReal z[], PetscReal Gz[])
{
  LatinInterfaces *inter  = &latin->inter;
  PetscReal        sum[4] = {0.0, 0.0, 0.0, 0.0}, total[4];

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Local, latin, 0, 0, 0));
  PetscCall(LatinSweepFaces_Private(latin, z, NULL, NULL));
  for (PetscInt k = 0; k < inter->sides; k++) latin->outgoing[k] = 2.0 * latin->linear.pull[k] - z[k];
  PetscCall(PetscSFBcastBegin(inter->mate_sf, MPIU_REAL, latin->outgoing, Gz, MPI_REPLACE));
  if (latin->links->general) LatinLinkStageGeneral(latin, z + inter->sides, Gz + inter->sides, sum);
  else LatinSweepStage(latin, z + inter->sides, Gz + inter->sides, sum);
  PetscCall(PetscSFBcastEnd(inter->mate_sf, MPIU_REAL, latin->outgoing, Gz, MPI_REPLACE));
  PetscCall(LatinSweepFaces_Private(latin, z, Gz, &sum[0]));
  for (PetscInt i = 0; latin->sub.ground && i < latin->links->dim * latin->sub.copies; i++) sum[1] += latin->sub.ground[i] * latin->linear.U[i] * latin->linear.U[i];
  sum[3] = latin->failed ? 1.0 : 0.0; /* a local solver that failed on one rank has failed on all */
  PetscCall(MPIU_Allreduce(sum, total, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  latin->failed    = (PetscBool)(total[3] > 0.0);
  latin->noise     = LATIN_NOISE * PetscSqrtReal(PetscMax(total[1], total[2]));
  latin->distance  = PetscSqrtReal(total[0]);
  latin->indicator = total[1] > 0.0 ? PetscSqrtReal(total[0] / total[1]) : latin->distance;
  /* where there is no interface no distance tells; and beside an energy that overflows any distance would seem small */
  if (PetscIsInfOrNanReal(total[0]) || PetscIsInfOrNanReal(total[1])) latin->indicator = INFINITY;
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
    sum[0] += PetscSqr(U[i] / latin->scale - reference[i]);
    sum[1] += PetscSqr(reference[i]);
  }
  for (PetscInt l = 0; l < sub->links; l++) {
    const PetscReal r = LatinElongation(sub, dim, l, reference);

    sum[2] += sub->stiffness[l] * PetscSqr(LatinElongation(sub, dim, l, U) / latin->scale - r);
    sum[3] += sub->stiffness[l] * PetscSqr(r);
  }
  PetscCall(MPIU_Allreduce(sum, total, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  *l2     = PetscSqrtReal(total[1] > 0.0 ? total[0] / total[1] : total[0]);
  *energy = PetscSqrtReal(total[3] > 0.0 ? total[2] / total[3] : total[2]);
  PetscFunctionReturn(0);
}
