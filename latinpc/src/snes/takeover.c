#include "snes/sneslatinimpl.h"

/*
   Newton's method (snes/newton.c), or with friction the interior-point method (snes/coulomb.c), after the iteration of SNES latin:

   1. Goal: errors and unbalance to reach (SNESLatinNewtonGoal_Private, SNESLatinNewtonBalance_Private).
   2. Start: the iterate, or zero (SNESLatinNewtonGuess_Private).
   3. Run (SNESLatinNewtonRun_Private).
   4. Acceptance, by the unbalance and the digits (SNESLatinFinished_Private, SNESLatinProveDigits_Private); else the iteration continues.
*/

#define LATIN_DIGITS_SAFETY 2.0 /* safety factor on errors known to their order of magnitude */
/* most linear stages after a failure of Newton's method without rigid links, or of the interior-point method in a time step; usually there is no solution */
#define LATIN_NEWTON_AFTER 1000
#define LATIN_SLIDES_AFTER 1000 /* linear stages after such a failure with friction in statics, before the search for endless slides (snes/slides.c) */

/* Checks whether the precision allows the requested error; else the solve ends with LATIN_NEXT_ROUNDING. Collective on snes */
static PetscErrorCode SNESLatinProveDigits_Private(SNES snes)
{
  SNES_Latin     *data  = (SNES_Latin *)snes->data;
  const PetscBool rigid = (PetscBool)(data->latin->sub.structure->rigid_law >= 0); /* LatinGetDigits() needs tensions as functions of displacements */
  const PetscBool small = (PetscBool)(data->newton.error <= data->target);
  PetscReal       unbalance, rounding, size, least;

  PetscFunctionBegin;
  if (!SNESLatinEstimates(data)) PetscFunctionReturn(0);
  PetscCall(VecNorm(snes->vec_sol, NORM_2, &size));
  PetscCall(LatinEquilibriumPoint_Private(data->latin->sub.structure, &least));
  if (size <= least && (rigid || data->found.balanced)) PetscFunctionReturn(0); /* nothing moves */
  PetscCall(LatinEstimateFloor_Private(data->latin, &data->estimate));
  data->estimate.value = data->newton.error;
  if (data->estimate.energy || data->large.frame) PetscFunctionReturn(0);
  if (rigid && (small || data->next == LATIN_NEXT_CONVERGED_FNORM)) PetscFunctionReturn(0);
  if (small && PetscMax(data->estimate.floor, LATIN_DIGITS_SAFETY * data->found.blur) <= data->target) PetscFunctionReturn(0);
  if (!rigid) PetscCall(LatinGetDigits(snes, &unbalance, &rounding, NULL, NULL));
  /* the remaining stiffness of slack links hides soft nodes */
  data->estimate.floor = rigid ? data->newton.error : LATIN_DIGITS_SAFETY * PetscMax(PetscMax(unbalance, rounding), data->found.blur);
  data->estimate.value = small ? PetscMax(data->newton.error, data->estimate.floor) : data->estimate.floor; /* the length of a step is the error before it */
  if (data->estimate.value <= data->target || data->latin->sub.structure->ground) PetscFunctionReturn(0);   /* a time step of a motion converges as far as rounding allows */
  data->next = LATIN_NEXT_ROUNDING;
  PetscCall(PetscInfo(snes, "The requested error, %g, is below the rounding error of this structure, about %g\n", (double)data->target, (double)data->estimate.value));
  PetscFunctionReturn(0);
}

/* Accepts the displacements of Newton's method, unless the unbalance contradicts them: then *done is false. Collective on snes */
static PetscErrorCode SNESLatinFinished_Private(SNES snes, SNESConvergedReason reason, PetscBool *done)
{
  SNES_Latin     *data   = (SNES_Latin *)snes->data;
  const PetscBool rigid  = (PetscBool)(data->latin->sub.structure->rigid_law >= 0);
  LatinNewton    *newton = &data->newton;
  PetscReal       size;
  PetscBool       shown, left, missed, rests;

  PetscFunctionBegin;
  *done = PETSC_TRUE;
  PetscCall(VecNorm(snes->vec_sol, NORM_2, &size));
  PetscCall(LatinSelfStress_Private(data->latin->sub.structure, snes->vec_rhs, size, &rests));
  if (rests) PetscCall(VecZeroEntries(snes->vec_sol));
  data->next = reason == SNES_CONVERGED_FNORM_RELATIVE ? LATIN_NEXT_CONVERGED_FNORM : LATIN_NEXT_CONVERGED;
  PetscCall(SNESLatinBalance_Private(snes));
  PetscCall(LatinEquilibriumCheck_Private(data->latin, snes->vec_sol, snes->vec_func, snes->vec_rhs, newton->target, data->estimate.energy, PETSC_FALSE, PETSC_FALSE, &data->found));
  if (rests) {
    data->found   = (LatinEquilibrium){.verdict = LATIN_EQUILIBRIUM, .balanced = PETSC_TRUE};
    newton->error = newton->tensions = 0.0;
  }
  data->estimate.tensions = newton->proves ? PetscMax(newton->tensions, data->found.forces) : -1.0;
  shown                   = (PetscBool)(SNESLatinEstimates(data) && data->found.error > newton->target);
  left                    = (PetscBool)(rigid && SNESLatinBalances(snes) && SNESLatinUnbalanced(data));
  missed                  = (PetscBool)(rigid && data->stop == LATIN_STOP_INDICATOR && data->found.missed > SNESLatinShown(newton->target));
  if (SNESLatinLeft(snes, newton->loads)) data->next = LATIN_NEXT_ROUNDING;
  if (data->found.verdict == LATIN_UNBOUNDED) data->next = LATIN_NEXT_DIVERGED;
  else if (shown || left || missed) *done = PETSC_FALSE;
  if (!*done) PetscCall(PetscInfo(snes, "Newton's method rejected: the unbalance shows an error of at least %g\n", (double)data->found.error)); /* a linear solve has missed a soft mode */
  if (!*done) PetscFunctionReturn(0);
  if (LatinNextConverged(data->next) && SNESLatinUnbalanceRounded(snes)) {
    data->next           = LATIN_NEXT_ROUNDING;
    data->estimate.floor = 1.0;
  }
  if (LatinNextConverged(data->next)) PetscCall(SNESLatinProveDigits_Private(snes));
  PetscCall(SNESLatinWatch_Private(snes, data->latin->linear.applications + newton->stages));
  PetscFunctionReturn(0);
}

/*
   Computes the largest unbalance at convergence, from the loads; with operators of the iteration or without loads also from the tensions, whose error
   it bounds. own: preconditioner of the tangent stiffness. Collective on snes
*/
static PetscErrorCode SNESLatinNewtonBalance_Private(SNES snes, PetscBool own, PetscReal *balance)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  PetscReal            sum       = 0.0, *tension;

  PetscFunctionBegin;
  *balance = PETSC_MAX_REAL;
  if (!SNESLatinBalances(snes) || structure->rigid_law >= 0) PetscFunctionReturn(0); /* the springs of rigid links cause more rounding than their tensions */
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinStructureTensions_Private(structure, NULL, snes->vec_sol, tension));
  for (PetscInt l = 0; l < structure->links_local; l++) sum += PetscSqr(tension[l]);
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)snes)));
  *balance = SNESLatinBalanceForce(data, data->newton.loads);
  if (sum > 0.0 && !own) *balance = PetscMin(*balance, data->target * PetscSqrtReal(sum));
  PetscFunctionReturn(0);
}

/*
   Sets the initial guess of Newton's method: the iterate, or zero if that has a smaller unbalance, or if links yield and the iterate is far away.
   From the iterate alone nodes that prestress holds between nearly straight links are not found (tests/test_equilibrium.py). Collective on snes
*/
static PetscErrorCode SNESLatinNewtonGuess_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->latin->sub.structure;
  PetscReal     *rigid     = data->latin->linear.rigid_tension, rest;
  PetscBool      far       = PETSC_FALSE;
  Vec            zero, r;

  PetscFunctionBegin;
  PetscCall(SNESLatinResidual_Private(snes));
  PetscCall(DMGetGlobalVector(structure->dm, &zero));
  PetscCall(DMGetGlobalVector(structure->dm, &r));
  PetscCall(VecZeroEntries(zero));
  PetscCall(LatinStructureResidual_Private(structure, NULL, zero, r));
  if (snes->vec_rhs) PetscCall(VecAXPY(r, -1.0, snes->vec_rhs));
  PetscCall(VecNorm(r, NORM_2, &rest));
  PetscCall(DMRestoreGlobalVector(structure->dm, &r));
  PetscCall(DMRestoreGlobalVector(structure->dm, &zero));
  /* on plateaus of laws the unbalance is small at any distance */
  if (data->newton.own_laws) PetscCall(LatinEquilibriumFar_Private(structure, snes->vec_sol, &far));
  if (data->residual <= rest && !far) PetscFunctionReturn(0);
  PetscCall(VecZeroEntries(snes->vec_sol));
  if (rigid) PetscCall(PetscArrayzero(rigid, structure->links_local));
  PetscFunctionReturn(0);
}

/* Sets what Newton's method must reach. Collective on snes */
static PetscErrorCode SNESLatinNewtonGoal_Private(SNES snes)
{
  SNES_Latin  *data   = (SNES_Latin *)snes->data;
  LatinNewton *newton = &data->newton;

  PetscFunctionBegin;
  newton->latin          = data->latin;
  newton->structure      = data->latin->sub.structure;
  newton->target         = SNESLatinEstimates(data) ? data->target : data->stop == LATIN_STOP_RESIDUAL ? 0.0 : snes->stol;
  newton->residual       = data->stop == LATIN_STOP_RESIDUAL ? SNESLatinResidualTarget(snes) : 0.0;
  newton->energy         = data->estimate.energy;
  newton->tension_target = SNESLatinTensionTarget(data);
  newton->proves         = (PetscBool)(SNESLatinBalances(snes) && newton->target > 0.0);
  newton->limit          = SNESLatinStageLimit(snes) - data->latin->linear.applications;
  newton->reference      = data->stop == LATIN_STOP_REFERENCE ? data->reference : NULL;
  PetscCall(SNESLatinLoads_Private(snes, &newton->loads));
  if (newton->proves) PetscCall(SNESLatinDrive_Private(snes, &newton->drive));
  PetscFunctionReturn(0);
}

/* Runs Newton's method from the displacements of the iteration. own: with preconditioners of the tangent stiffness. Collective on snes */
static PetscErrorCode SNESLatinNewtonRun_Private(SNES snes, PetscBool stall, PetscBool own, SNESConvergedReason *reason)
{
  SNES_Latin  *data   = (SNES_Latin *)snes->data;
  LatinNewton *newton = &data->newton;
  Vec          step, r;

  PetscFunctionBegin;
  if (stall) PetscCall(SNESLatinNewtonGuess_Private(snes));
  else PetscCall(SNESLatinResidual_Private(snes)); /* the estimated error is small: start from these displacements and tensions of rigid links */
  PetscCall(SNESLatinOuterForget_Private(snes));
  PetscCall(SNESLatinNewtonBalance_Private(snes, own, &newton->balance));
  PetscCall(LatinMultipliersStart_Private(newton));
  PetscCall(LatinNewtonCreate_Private(snes, data->latin, own, newton));
  PetscCall(LatinNewtonSolve_Private(snes, newton, stall || !SNESLatinEstimates(data) ? 0.0 : data->estimate.value, snes->vec_sol, reason));
  data->found = newton->found;
  PetscCall(SNESGetSolutionUpdate(newton->snes, &step));
  PetscCall(SNESGetFunction(newton->snes, &r, NULL, NULL));
  if (step && !data->found.verdict) PetscCall(LatinEquilibriumMechanism_Private(data->latin->sub.structure, step, r, snes->vec_rhs, &data->found));
  PetscCall(LatinMultipliersEnd_Private(newton, (PetscBool)(*reason > 0)));
  if (data->found.verdict == LATIN_UNBOUNDED || data->found.verdict == LATIN_JAMMED) data->next = LATIN_NEXT_DIVERGED;
  PetscFunctionReturn(0);
}

/* Whether single nodes prove that there is no equilibrium: the solve ends. Collective on snes */
static PetscErrorCode SNESLatinNewtonHopeless_Private(SNES snes, PetscBool *hopeless)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(&data->found, sizeof(data->found))); /* a verdict on an iterate proves nothing */
  PetscCall(LatinEquilibriumNodes_Private(data->latin->sub.structure, snes->vec_rhs, snes->vec_sol, &data->found));
  *hopeless = (PetscBool)(data->found.verdict == LATIN_UNBOUNDED);
  if (!*hopeless) PetscFunctionReturn(0);
  PetscCall(SNESLatinBalance_Private(snes));
  data->next = LATIN_NEXT_DIVERGED;
  PetscFunctionReturn(0);
}

/* Continues after Newton's method has failed: with the tangent stiffness (newton->stall), or the iteration from its last state. Collective on snes */
static PetscErrorCode SNESLatinNewtonFailed_Private(SNES snes, PetscBool own, SNESConvergedReason reason)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  const PetscBool      elastic   = (PetscBool)(structure->rigid_law < 0);
  LatinNewton         *newton    = &data->newton;

  PetscFunctionBegin;
  PetscCall(PetscInfo(snes, "Newton's method ended with %s\n", SNESConvergedReasons[reason]));
  newton->finish = PETSC_FALSE;
  if ((own && elastic) || (structure->has_friction && structure->ground)) newton->last = data->latin->linear.applications + LATIN_NEWTON_AFTER;
  if (structure->has_friction && !structure->ground) newton->slides = data->latin->linear.applications + LATIN_SLIDES_AFTER;
  data->current = -1;
  data->next    = LATIN_NEXT_NEWTON_STALL;
  if (newton->stall) PetscFunctionReturn(0);
  PetscCall(SNESLatinIterate_Private(snes, SNESLatinDecide_Private));
  if (!(newton->contrast || (SNESLatinEstimates(data) && elastic)) || !LatinNextConverged(data->next)) PetscFunctionReturn(0);
  data->next = SNESLatinStagesLeft(snes) > 0 ? LATIN_NEXT_ROUNDING : LATIN_NEXT_MAX_IT; /* unproven: Newton's method has failed, or had no stages left */
  PetscCall(PetscInfo(snes, "Convergence of the iteration unproven: Newton's method has failed\n"));
  PetscFunctionReturn(0);
}

/*
   Runs Newton's method after the iteration, or with friction the interior-point method. If it fails with operators of the iteration, it restarts with
   the tangent stiffness; if that fails, the iteration continues from its last state. Collective on snes
*/
PetscErrorCode SNESLatinNewton_Private(SNES snes, PetscBool stall)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  PetscBool            own = PETSC_TRUE, done = PETSC_FALSE;
  SNESConvergedReason  reason;

  PetscFunctionBegin;
  if (stall) PetscCall(SNESLatinNewtonHopeless_Private(snes, &done));
  else PetscCall(LatinNewtonOwn_Private(structure, &own));
  if (done) PetscFunctionReturn(0);
  if (own) data->newton.stall = PETSC_FALSE;
  PetscCall(SNESLatinNewtonGoal_Private(snes));
  if (structure->has_friction) PetscCall(SNESLatinCoulomb_Private(snes, &reason));
  else PetscCall(SNESLatinNewtonRun_Private(snes, stall, own, &reason));
  if (data->next == LATIN_NEXT_DIVERGED || data->next == LATIN_NEXT_CONVERGED) PetscFunctionReturn(0);
  if (reason > 0) PetscCall(SNESLatinFinished_Private(snes, reason, &done));
  if (!done) {
    PetscCall(SNESLatinNewtonFailed_Private(snes, own, reason));
    PetscFunctionReturn(0);
  }
  /* a warm start begins at the solution. Not where rounding hides motion: light parts that move beside heavy ones at rest, as a truss in flight */
  if (data->warm && LatinNextConverged(data->next) && (!data->found.at_rest || data->found.still) && structure->rigid_law >= 0) PetscCall(SNESLatinGuess_Private(snes, snes->vec_sol, data->latin->linear.rigid_tension, data->z));
  PetscFunctionReturn(0);
}
