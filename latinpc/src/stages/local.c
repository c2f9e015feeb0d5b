#include "stages/latinstages.h"

/*
   Local stage of section 3.3, explicit and pointwise, written for the data that the linear stage needs:

     interfaces  the conditions (23) along the ascent direction give each side the datum F_hat + d U_hat equal to d U - F of its mate; with (27),
                 F = z - d U on the micro space, the new datum is 2 d U - z of the mate;
     links       with the law and the ascent direction l = k, y = tau + l e = s + 2 l e determines the new datum s = tau_hat - l e_hat, see
                 structure/laws.c.

   The distance between the two stages measures convergence: on a side z_new - z = 2 d (U_hat - U), on a link s_new - s = -2 l (e_hat - e). The
   indicator is that distance in the energy norm of the search directions, relative to the energy of elongations under tension, so that rigid motions
   and slack links do not make it small.
*/

/* level of rounding of the distance, 45 eps, relative to the square root of the energy of the structure, prestress included */
#define LATIN_NOISE LatinByPrecision(1e-14, 3e-7)

/*
   Computes pull, the forces D (1 - R R^t D) U of the search direction, on the micro part of U alone, of interface f in a run of n equal subdomains,
   `apart` entries from one to the next. The macro part is computed from U of this side: the coarse displacement differs from it by rounding, which
   would accumulate in z.
*/
static PetscErrorCode LatinPull_Private(LatinLinear *linear, PetscInt f, PetscInt n, PetscInt apart)
{
  const LatinInterface *face = &linear->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first, modes = linear->macro->of[f].modes;
  const PetscInt       *dof   = linear->inter->side_dof + face->side_first;
  const PetscReal      *basis = linear->macro->basis + linear->macro->of[f].first, *dual = linear->macro->dual + linear->macro->of[f].first;
  const PetscScalar     one = 1.0, zero = 0.0, minus = -1.0;
  PetscReal            *v = linear->work, *w = v + rows * n, *pull = linear->pull + face->side_first;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < n; k++)
    for (PetscInt r = 0; r < rows; r++) v[rows * k + r] = linear->U[dof[apart * k + r]];
  if (n == 1) LatinMacroMicro(linear->macro, f, PETSC_FALSE, v, w);
  else if (modes) {
    PetscBLASInt br, bm, bn;

    PetscCall(PetscBLASIntCast(rows, &br));
    PetscCall(PetscBLASIntCast(modes, &bm));
    PetscCall(PetscBLASIntCast(n, &bn));
    PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &bm, &bn, &br, &one, dual, &bm, v, &br, &zero, w, &bm));
    PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &br, &bn, &bm, &minus, basis, &bm, w, &bm, &one, v, &br));
  }
  PetscCall(LatinDirectionApply(linear->dir, f, n, v, rows, pull, apart));
  PetscFunctionReturn(0);
}

/*
   Sweeps over the interfaces of all subdomains here, runs of equal subdomains together. sum NULL: computes linear->pull; else adds the squared distance
   of z and next to *sum.
*/
static PetscErrorCode LatinSweepFaces_Private(LatinLinear *linear, const PetscReal z[], const PetscReal next[], PetscReal *sum)
{
  const LatinInterfaces *inter = linear->inter;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const LatinBatch *batch = &linear->batches->batch[b];
    PetscInt          n     = 1;

    for (PetscInt m = 0; m < batch->members; m += n) {
      const PetscInt first = inter->offset[batch->sub[m]], last = inter->offset[batch->sub[m] + 1];
      const PetscInt apart = first < last ? inter->interface[last - 1].side_last - inter->interface[first].side_first : 0;

      n = LatinBatchRun(batch, m);
      for (PetscInt f = first; f < last; f++) {
        if (sum) PetscCall(LatinDirectionEnergy(linear->dir, f, n, next + inter->interface[f].side_first, z + inter->interface[f].side_first, apart, linear->work, sum));
        else PetscCall(LatinPull_Private(linear, f, n, apart));
      }
    }
  }
  PetscFunctionReturn(0);
}

/*
   Computes the residual g = F - B^t (s + l e) - G U + C^t (z - D U) of the last displacements U in the state z, with tensions and interface forces from
   (26) and (27), and springs to the ground G, if any. The linear stage solves for the increment of the displacements, so that errors of rounding and of
   inexact solvers decrease with it (iterative refinement).
*/
PetscErrorCode LatinGatherForces_Private(LatinLinear *linear, const PetscReal z[])
{
  const LatinInterfaces *inter = linear->inter;
  PetscReal             *g     = linear->g;

  PetscFunctionBegin;
  LatinSweepForces(linear, z + inter->sides);
  for (PetscInt k = 0; k < inter->sides; k++) g[inter->side_dof[k]] += z[k] - linear->pull[k];
  for (PetscInt i = 0; linear->sub->ground && i < linear->sub->dim * linear->sub->copies; i++) g[i] -= linear->sub->ground[i] * linear->U[i];
  PetscFunctionReturn(0);
}

/* Computes linear->pull, D times the micro part of U, on all interfaces here */
PetscErrorCode LatinPullFaces_Private(LatinLinear *linear)
{
  PetscFunctionBegin;
  PetscCall(LatinSweepFaces_Private(linear, NULL, NULL, NULL));
  PetscFunctionReturn(0);
}

/* Computes Gz, the data after the local stage, and the indicator, the distance and its noise. Collective on sub->object */
PetscErrorCode LatinLocalStage_Private(LatinLinear *linear, const PetscReal z[], PetscReal Gz[])
{
  const LatinInterfaces *inter  = linear->inter;
  PetscReal              sum[5] = {0.0, 0.0, 0.0, 0.0, 4.0 * linear->solve_error}, total[5];

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Local, linear->sub->object, 0, 0, 0));
  PetscCall(LatinPullFaces_Private(linear));
  for (PetscInt k = 0; k < inter->sides; k++) linear->outgoing[k] = 2.0 * linear->pull[k] - z[k];
  PetscCall(PetscSFBcastBegin(inter->mate_sf, MPIU_REAL, linear->outgoing, Gz, MPI_REPLACE));
  if (linear->sub->part) LatinTurningStage(linear, z + inter->sides, Gz + inter->sides, sum);
  else if (linear->sub->structure->general) LatinLinkStageGeneral(linear, z + inter->sides, Gz + inter->sides, sum);
  else LatinSweepStage(linear, z + inter->sides, Gz + inter->sides, sum);
  PetscCall(PetscSFBcastEnd(inter->mate_sf, MPIU_REAL, linear->outgoing, Gz, MPI_REPLACE));
  PetscCall(LatinSweepFaces_Private(linear, z, Gz, &sum[0]));
  for (PetscInt i = 0; linear->sub->ground && i < linear->sub->dim * linear->sub->copies; i++) sum[1] += linear->sub->ground[i] * linear->U[i] * linear->U[i];
  PetscCall(PetscLogFlops(4.0 * inter->sides + (7.0 * linear->sub->dim + 12.0) * linear->sub->links)); /* of links approximate: laws differ */
  sum[3] = linear->failed ? 1.0 : 0.0;                                                                 /* a failure on one rank counts on all */
  PetscCall(MPIU_Allreduce(sum, total, 5, MPIU_REAL, MPIU_SUM, PetscObjectComm(linear->sub->object)));
  linear->failed = (PetscBool)(total[3] > 0.0);
  total[0] += total[4]; /* the error of an inexact linear stage adds to the distance */
  linear->noise     = LATIN_NOISE * PetscSqrtReal(PetscMax(total[1], total[2]));
  linear->distance  = PetscSqrtReal(total[0]);
  linear->indicator = total[1] > 0.0 ? PetscSqrtReal(total[0] / total[1]) : linear->distance;
  /* infinite, even if only the energy overflows: the quotient would seem small */
  if (PetscIsInfOrNanReal(total[0]) || PetscIsInfOrNanReal(total[1])) linear->indicator = INFINITY;
  PetscCall(PetscLogEventEnd(LATIN_Local, linear->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}
