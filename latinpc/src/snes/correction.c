#include "snes/sneslatinimpl.h"

/*
   How far displacements are from the solution, by one correction of conjugate gradients on their tangent stiffness K: with w
   the answer of the preconditioner to the forces r that are without balance, it is (w.r / w.K w) w. The residual alone
   hides a soft mode, which the preconditioner takes for as stiff as with all links taut: but once the linear solve has done
   away with the others, r is mostly this mode, and so is w. Next to collapse the taut links are nearly a mechanism, and
   nothing resists what is left.
*/

#define LATIN_CORRECTION_SAFETY 3.0 /* on the error that one correction shows: of tensions it is 0.3 to 1 times the true one on scenes of all kinds */

/* The sums over links and springs to the ground that a correction is measured by */
typedef struct {
  PetscReal work, tension, all, energy; /* w.K w; squares of the tensions that w makes, and of all tensions; k e^2 of all strains */
} LatinCorrectionSums;

/* Collective on structure */
static PetscErrorCode LatinCorrectionSums_Private(LatinStructure structure, Vec u, Vec w, LatinCorrectionSums *sum)
{
  PetscReal *x, *d, held;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(sum, sizeof(*sum)));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &d));
  PetscCall(LatinStructureStrains_Private(structure, u, x));
  PetscCall(LatinStructureElongations_Private(structure, NULL, w, d)); /* no change where prescribed */
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

/* The correction relative to displacements u, in the norm of the stop, and to their tensions; r: what they leave without balance. Collective on newton->snes */
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
  if (*error > 0.0) *error *= part; /* not zero times what is without end */
  PetscCall(PetscInfo(newton->snes, "A correction would change displacements by %g and tensions by %g\n", (double)*error, (double)*tensions));
  PetscFunctionReturn(0);
}
