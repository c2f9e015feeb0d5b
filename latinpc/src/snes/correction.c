#include "snes/sneslatinimpl.h"

/*
   A posteriori error of displacements and tensions: the length of one step of preconditioned steepest descent with the tangent stiffness K, (w.r /
   w.K w) w, with the residual r and the preconditioned residual w. The residual alone hides soft modes, whose stiffness the preconditioner, with all
   links taut, overestimates. But after a linear solve has removed the other modes, r and w are mostly the soft one. Next to collapse the taut links
   are nearly a mechanism: w.K w is nearly zero and the step long.
*/

#define LATIN_CORRECTION_SAFETY 3.0 /* safety factor; one correction shows 0.3 to 1 times the true error of the tensions in all kinds of scenes */

/* Sums over links and springs to the ground */
typedef struct {
  PetscReal work, tension, all, energy; /* w.K w; squared tensions of w; squared tensions; sum of k e^2 */
} LatinCorrectionSums;

/* Computes the sums at u for the correction w. Collective on structure */
static PetscErrorCode LatinCorrectionSums_Private(LatinStructure structure, Vec u, Vec w, LatinCorrectionSums *sum)
{
  PetscReal *x, *d, held;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(sum, sizeof(*sum)));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(LatinStructureStrains_Private(structure, u, x));
  PetscCall(LatinStructureElongations_Private(structure, NULL, w, d)); /* w is zero at prescribed displacements */
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal k = LatinStructureTangent(structure, l, x[l]);

    sum->work += k * PetscSqr(d[l]);
    sum->tension += PetscSqr(k * d[l]);
    sum->all += PetscSqr(LatinStructureTension(structure, NULL, l, x[l]));
    sum->energy += structure->stiffness[l] * PetscSqr(x[l]);
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, sizeof(*sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinDiagonalProduct_Private(structure->ground, w, w, &held));
  sum->work += held;
  PetscFunctionReturn(0);
}

/*
   Estimates by a correction the errors of displacements, relative to u in the norm of the stop, and of tensions, relative to all tensions. r:
   residual at u. Collective on newton->snes
*/
PetscErrorCode LatinNewtonCorrection_Private(LatinNewton *newton, Vec u, Vec r, PetscReal *error, PetscReal *tensions)
{
  LatinCorrectionSums sum;
  PetscScalar         pushed;
  PetscReal           size, length, part;
  KSP                 ksp;
  PC                  pc;
  Vec                 w;

  PetscFunctionBegin;
  PetscCall(SNESGetKSP(newton->snes, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(DMGetGlobalVector(newton->structure->dm, &w));
  PetscCall(PCApply(pc, r, w));
  PetscCall(VecDot(w, r, &pushed));
  PetscCall(VecNorm(w, NORM_2, &length));
  PetscCall(VecNorm(u, NORM_2, &size));
  PetscCall(LatinCorrectionSums_Private(newton->structure, u, w, &sum));
  PetscCall(DMRestoreGlobalVector(newton->structure->dm, &w));
  newton->stages++;
  part      = LATIN_CORRECTION_SAFETY * (sum.work > 0.0 ? PetscAbsScalar(pushed) / sum.work : length > 0.0 ? INFINITY : 0.0);
  *error    = newton->energy ? PetscSqrtReal(LatinRatio(sum.work, sum.energy)) : LatinRatio(length, size);
  *tensions = sum.all > 0.0 ? part * PetscSqrtReal(sum.tension / sum.all) : 0.0;
  if (*error > 0.0) *error *= part; /* avoids 0 * infinity */
  PetscCall(PetscInfo(newton->snes, "A posteriori error: displacements %g, tensions %g\n", (double)*error, (double)*tensions));
  PetscFunctionReturn(0);
}
