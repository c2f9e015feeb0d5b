#include "snes/sneslatinimpl.h"

/*
   After each linear stage of SNES latin (SNESLatinConverged_Private):

   1. Measure of the stop (SNESLatinMeasure_Private).
   2. Monitors and the user's convergence test (SNESLatinWatch_Private).
   3. Decision what follows: the next stage, Newton's method, another search parameter, or the end (SNESLatinDecide_Private).
*/

/*
   estimated error, relative to the requested one, at which Newton's method takes over. From 2 to 8 linear stages and its iterations together are
   about equal; 16 misses the error
*/
#define LATIN_PROOF_EARLY 4.0

/* Returns PETSc's reason for the end of a solve: SNES_CONVERGED_ITERATING if it continues, or if snes->reason is already set (LATIN_NEXT_GIVEN) */
SNESConvergedReason SNESLatinReason(LatinNext next)
{
  static const SNESConvergedReason reason[LATIN_NEXT_GIVEN + 1] = {
    [LATIN_NEXT_CONVERGED]           = SNES_CONVERGED_SNORM_RELATIVE, /* the indicator is the relative length of the next step */
    [LATIN_NEXT_CONVERGED_FNORM]     = SNES_CONVERGED_FNORM_RELATIVE,
    [LATIN_NEXT_CONVERGED_FNORM_ABS] = SNES_CONVERGED_FNORM_ABS,
    [LATIN_NEXT_ROUNDING]            = SNES_DIVERGED_INNER, /* the inner solvers are not accurate enough for more */
    [LATIN_NEXT_DIVERGED]            = SNES_DIVERGED_DTOL,
    [LATIN_NEXT_LINE_SEARCH]         = SNES_DIVERGED_LINE_SEARCH,
    [LATIN_NEXT_MAX_IT]              = SNES_DIVERGED_MAX_IT,
    [LATIN_NEXT_FAILED]              = SNES_DIVERGED_LINEAR_SOLVE,
    [LATIN_NEXT_NOT_FINITE]          = SNES_DIVERGED_FUNCTION_NANORINF,
  };

  return reason[next];
}

/* Returns whether the user has set a convergence test, which replaces the stop */
PetscBool SNESLatinUserTest(SNES snes)
{
  return (PetscBool)(snes->ops->converged && snes->ops->converged != SNESConvergedDefault);
}

/* Returns whether monitors, history, test or update need the solution and the norm of the function during the iteration */
PetscBool SNESLatinWatched(SNES snes)
{
  return (PetscBool)(SNESLatinUserTest(snes) || snes->numbermonitors || snes->conv_hist || snes->ops->update);
}

/* Runs monitors, history and the user's test on the solution and the norm of the function; without them neither is computed. Collective on snes */
PetscErrorCode SNESLatinWatch_Private(SNES snes, PetscInt it)
{
  SNES_Latin         *data   = (SNES_Latin *)snes->data;
  const PetscBool     tests  = SNESLatinUserTest(snes);
  SNESConvergedReason reason = SNES_CONVERGED_ITERATING;
  PetscReal           xnorm, snorm = 0.0;

  PetscFunctionBegin;
  snes->iter = it;
  if (!SNESLatinWatched(snes)) PetscFunctionReturn(0);
  if (tests && it) PetscCall(VecCopy(snes->vec_sol, snes->vec_sol_update));
  PetscCall(SNESLatinResidual_Private(snes));
  PetscCall(SNESLogConvergenceHistory(snes, data->residual, 0));
  PetscCall(SNESMonitor(snes, it, data->residual));
  if (!tests) PetscFunctionReturn(0);
  if (it) {
    PetscCall(VecAYPX(snes->vec_sol_update, -1.0, snes->vec_sol));
    PetscCall(VecNorm(snes->vec_sol_update, NORM_2, &snorm));
  }
  PetscCall(VecNorm(snes->vec_sol, NORM_2, &xnorm));
  PetscCall((*snes->ops->converged)(snes, it, xnorm, snorm, data->residual, &reason, snes->cnvP));
  if (!reason) PetscFunctionReturn(0);
  snes->reason = reason;
  data->next   = LATIN_NEXT_GIVEN;
  PetscFunctionReturn(0);
}

/*
   Prepares the first stage: finds whether there is an initial guess, and computes the initial unbalance if a monitor or a test needs it. The stop on
   the residual is relative to that or to the loads, whichever is less: an unbalance small beside the prestress may be large beside the loads.
   Collective on snes
*/
PetscErrorCode SNESLatinFirst_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   warm = SNESLatinWarm(data);
  PetscReal   size, loads;

  PetscFunctionBegin;
  data->guess = PETSC_FALSE;
  if (!warm) {
    PetscCall(VecNorm(snes->vec_sol, NORM_1, &size)); /* a sum is not a number on all ranks where one entry is not, a maximum is on some */
    data->guess = (PetscBool)(size > 0.0);
    if (PetscIsInfOrNanReal(size)) data->next = LATIN_NEXT_NOT_FINITE;
  }
  if (data->next == LATIN_NEXT_CONTINUE) PetscCall(SNESLatinAtRest_Private(snes));
  warm = SNESLatinWarm(data);
  if (data->next || (data->stop != LATIN_STOP_RESIDUAL && !SNESLatinWatched(snes))) PetscFunctionReturn(0);
  if (data->stop == LATIN_STOP_RESIDUAL) warm = PETSC_FALSE;
  if (data->latin->linear.rigid_tension && !warm) PetscCall(PetscArrayzero(data->latin->linear.rigid_tension, data->latin->sub.structure->links_local));
  if (!data->guess && !warm) PetscCall(VecZeroEntries(snes->vec_sol)); /* monitors of a warm start see the last solution, which the caller still has */
  PetscCall(SNESLatinBalance_Private(snes));
  data->first_residual = data->residual;
  PetscCall(SNESLatinLoads_Private(snes, &loads));
  if (loads > 0.0) data->first_residual = PetscMin(data->first_residual, loads);
  PetscCall(SNESLatinWatch_Private(snes, 0));
  if (data->next == LATIN_NEXT_CONTINUE && data->stop == LATIN_STOP_RESIDUAL && data->residual <= snes->abstol && data->latin->sub.structure->rigid_law < 0) data->next = LATIN_NEXT_CONVERGED_FNORM_ABS;
  if (data->next == LATIN_NEXT_CONTINUE) PetscTryTypeMethod(snes, update, 0);
  PetscFunctionReturn(0);
}

/* Prints the indicator, and residual or errors if computed */
static PetscErrorCode SNESLatinMonitor_Private(SNES snes)
{
  SNES_Latin *data   = (SNES_Latin *)snes->data;
  PetscViewer viewer = data->monitor;

  PetscFunctionBegin;
  if (!viewer) PetscFunctionReturn(0);
  PetscCall(PetscViewerPushFormat(viewer, data->monitor_format));
  PetscCall(PetscViewerASCIIAddTab(viewer, ((PetscObject)snes)->tablevel));
  PetscCall(PetscViewerASCIIPrintf(viewer, "%3" PetscInt_FMT " LATIN indicator %12.6e", data->latin->linear.applications, (double)data->latin->linear.indicator));
  PetscCall(PetscViewerASCIIUseTabs(viewer, PETSC_FALSE));
  if (data->stop == LATIN_STOP_RESIDUAL) PetscCall(PetscViewerASCIIPrintf(viewer, "  residual %12.6e", (double)data->residual));
  if (SNESLatinEstimates(data)) PetscCall(PetscViewerASCIIPrintf(viewer, "  estimated error %s %12.6e", data->estimate.energy ? "energy" : "l2", (double)data->estimate.value));
  if (data->reference && data->done) PetscCall(PetscViewerASCIIPrintf(viewer, "  error l2 %12.6e  energy %12.6e", (double)data->error_l2[data->done - 1], (double)data->error_energy[data->done - 1]));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscCall(PetscViewerASCIIUseTabs(viewer, PETSC_TRUE));
  PetscCall(PetscViewerASCIISubtractTab(viewer, ((PetscObject)snes)->tablevel));
  PetscCall(PetscViewerPopFormat(viewer));
  PetscFunctionReturn(0);
}

/* Computes the measure of the stop and its target. Once the estimated error is below the target, the unbalance corrects it. Collective on snes */
static PetscErrorCode SNESLatinMeasure_Private(SNES snes, PetscReal *measure, PetscReal *target)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  *measure = latin->linear.indicator;
  *target  = SNESLatinUserTest(snes) ? 0.0 : snes->stol;
  if (data->stop == LATIN_STOP_RESIDUAL) {
    PetscCall(SNESLatinResidual_Private(snes));
    *measure = data->residual;
    *target  = SNESLatinResidualTarget(snes);
  } else if (data->stop == LATIN_STOP_REFERENCE && data->done) *measure = data->error_l2[data->done - 1];
  else if (SNESLatinEstimates(data)) {
    if (!SNESLatinLarge(data) && (data->estimate.value <= data->target || data->estimate.rounding)) {
      PetscCall(SNESLatinResidual_Private(snes));
      PetscCall(LatinEquilibriumCheck_Private(latin, snes->vec_sol, snes->vec_func, snes->vec_rhs, data->target, data->estimate.energy, (PetscBool)(latin->linear.distance <= latin->linear.noise), SNESLatinStrict(data), &data->found));
      LatinEstimateLearn(&data->found, data->target, &data->estimate);
      if (data->done) data->estimates[data->done - 1] = data->estimate.value;
    }
    *measure = data->estimate.value;
    *target  = data->target;
  }
  PetscFunctionReturn(0);
}

/* Returns whether the target is reached, or all change is rounding */
static LatinNext SNESLatinReached(SNES snes, PetscReal measure, PetscReal target)
{
  const SNES_Latin *data     = (SNES_Latin *)snes->data;
  const PetscBool   residual = (PetscBool)(data->stop == LATIN_STOP_RESIDUAL);

  if (SNESLatinUserTest(snes)) return LATIN_NEXT_CONTINUE;
  if (residual && measure <= snes->abstol) return LATIN_NEXT_CONVERGED_FNORM_ABS;
  if (measure <= target) return residual ? LATIN_NEXT_CONVERGED_FNORM : LATIN_NEXT_CONVERGED;
  if (SNESLatinEstimates(data)) return data->estimate.rounding ? LATIN_NEXT_ROUNDING : LATIN_NEXT_CONTINUE;
  return data->latin->linear.distance <= data->latin->linear.noise ? LATIN_NEXT_CONVERGED : LATIN_NEXT_CONTINUE;
}

/*
   Returns whether Newton's method finishes the solve. Its step measures the error: it proves convergence, which an estimate does not, and continues
   if rounding ends the iteration before the target
*/
static PetscBool SNESLatinFinishes(const SNES_Latin *data, PetscReal measure, PetscReal target, LatinNext next)
{
  if (!data->newton.finish || data->newton.contrast || !(target > 0.0)) return PETSC_FALSE;
  if (SNESLatinEstimates(data)) return (PetscBool)((next == LATIN_NEXT_CONTINUE && measure <= LATIN_PROOF_EARLY * target) || next == LATIN_NEXT_CONVERGED || (next == LATIN_NEXT_ROUNDING && data->estimate.rounding));
  return (PetscBool)(next == LATIN_NEXT_CONVERGED && data->stop != LATIN_STOP_REFERENCE && measure > target);
}

/* Returns whether Newton's method takes over: on a stall, on divergence, or if convergence is unproven */
static PetscBool SNESLatinStalls(const SNES_Latin *data, PetscBool stalled, PetscReal target, LatinNext next)
{
  if (!data->newton.stall || !(target > 0.0)) return PETSC_FALSE;
  if (next == LATIN_NEXT_CONTINUE) return stalled;
  if (next == LATIN_NEXT_DIVERGED || next == LATIN_NEXT_NOT_FINITE) return PETSC_TRUE;
  if (next == LATIN_NEXT_FAILED || next == LATIN_NEXT_GIVEN) return PETSC_FALSE;
  /* multipliers close gaps more accurately; not in statics, where coordinates round gaps */
  if (next == LATIN_NEXT_ROUNDING && data->latin->sub.structure->ground && data->found.missed > target) return PETSC_TRUE;
  return data->newton.contrast; /* rounding limits Newton's method as well, unless contrasts of stiffness cause it */
}

/* What a converged iterate must prove, by the stop */
typedef struct {
  PetscBool far;     /* displacements are larger than the structure: a solution only if forces balance */
  PetscBool balance; /* the unbalance is small relative to the loads: one that is small beside stiffnesses alone allows any displacement of slack links */
  PetscBool step;    /* stop on the indicator: the unbalance shows no larger error of the displacements than `target` */
  PetscBool forces;  /* nor of the tensions */
  PetscBool gaps;    /* rigid links meet their gaps, which the residual does not contain */
  PetscReal target;
  PetscReal loads, drive; /* norms of the loads; of the forces that drive a far iterate */
} LatinProof;

/*
   Returns what follows a converged iterate after the check data->found: `next` if it is proved; else the end, if no stage can improve it, or another
   stage
*/
static LatinNext SNESLatinProved(SNES snes, const LatinProof *proof, LatinNext next)
{
  SNES_Latin             *data  = (SNES_Latin *)snes->data;
  const LatinEquilibrium *found = &data->found;
  const PetscBool         rests = (PetscBool)(data->latin->linear.distance <= data->latin->linear.noise); /* stages change nothing beyond rounding */

  if (found->verdict == LATIN_UNBOUNDED) return LATIN_NEXT_DIVERGED;
  if (SNESLatinUnbalanceRounded(snes)) {
    data->estimate.floor = 1.0;
    return LATIN_NEXT_ROUNDING;
  }
  if (!rests && proof->far && proof->balance && data->residual > LATIN_NEWTON_FAR * proof->drive) return LATIN_NEXT_CONTINUE;
  if (!rests && proof->step && found->verdict != LATIN_EQUILIBRIUM) return LATIN_NEXT_CONTINUE;
  if (SNESLatinLeft(snes, proof->loads)) return LATIN_NEXT_ROUNDING;
  if ((proof->balance && SNESLatinUnbalanced(data)) || (proof->forces && found->forces > proof->target) || (proof->gaps && found->missed > proof->target)) return rests ? LATIN_NEXT_ROUNDING : LATIN_NEXT_CONTINUE;
  return next;
}

/* Checks that a converged iterate is an equilibrium, else changes *next. Collective on snes */
static PetscErrorCode SNESLatinProve_Private(SNES snes, LatinNext *next)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  const PetscBool      residual  = (PetscBool)(!structure->ground && data->stop == LATIN_STOP_RESIDUAL);
  LatinProof           proof     = {.balance = SNESLatinBalances(snes)};

  PetscFunctionBegin;
  proof.step   = (PetscBool)(!proof.balance && data->stop == LATIN_STOP_INDICATOR);
  proof.forces = (PetscBool)(proof.balance || proof.step);
  proof.gaps   = (PetscBool)(proof.forces || (residual && structure->rigid_law >= 0));
  proof.target = proof.step ? SNESLatinShown(snes->stol) : data->target;
  PetscCall(SNESLatinResidual_Private(snes));
  PetscCall(SNESLatinLoads_Private(snes, &proof.loads));
  PetscCall(LatinEquilibriumFar_Private(structure, snes->vec_sol, &proof.far));
  if (!proof.far && !proof.forces && !residual && !(data->newton.contrast && structure->ground)) PetscFunctionReturn(0); /* a motion at rest needs no proof */
  PetscCall(LatinEquilibriumCheck_Private(data->latin, snes->vec_sol, snes->vec_func, snes->vec_rhs, proof.target, data->estimate.energy, PETSC_FALSE, SNESLatinStrict(data), &data->found));
  if (proof.far) PetscCall(SNESLatinDrive_Private(snes, &proof.drive));
  *next = SNESLatinProved(snes, &proof, *next);
  PetscFunctionReturn(0);
}

/*
   Returns whether the distance of the stages exceeds -snes_divergence_tolerance twice in a row, or once if Newton's method can take over. A single
   excess is a jump of the Anderson acceleration, which the next stages correct: if one counts, 1 of 900 random structures with friction is lost, in 7 %
   fewer stages
*/
static PetscBool SNESLatinGrows(SNES snes)
{
  SNES_Latin     *data  = (SNES_Latin *)snes->data;
  const PetscBool leapt = data->leapt;

  data->leapt = (PetscBool)(snes->divtol > 0.0 && data->latin->linear.distance > snes->divtol * data->first_distance);
  return (PetscBool)(data->leapt && (leapt || data->newton.stall));
}

/*
   Decides what follows this linear stage. Each step changes the decision of those before it as listed; CONVERGED stands for all three. So the order
   matters: convergence that is not proved, and divergence, are left to Newton's method, and divergence after that to other search parameters

     failure              any                             -> FAILED, NOT_FINITE
     stop                 CONTINUE                        -> CONVERGED, ROUNDING
     Newton to finish     CONTINUE, CONVERGED, ROUNDING   -> NEWTON_FINISH
     growth               CONTINUE                        -> DIVERGED
     proof                CONVERGED                       -> CONTINUE, ROUNDING, DIVERGED
     Newton on a stall    any but FAILED, GIVEN, _FINISH  -> NEWTON_STALL
     limit of stages      CONTINUE                        -> MAX_IT
     search parameter     CONTINUE, DIVERGED              -> REBUILD
     grains               CONTINUE, DIVERGED, MAX_IT      -> CONVERGED, DIVERGED
     endless slides       CONTINUE, DIVERGED              -> DIVERGED

   Collective on snes
*/
PetscErrorCode SNESLatinDecide_Private(SNES snes, PetscReal measure, PetscReal target, LatinNext *next)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;
  PetscBool   stalled;

  PetscFunctionBegin;
  if (latin->linear.failed) *next = LATIN_NEXT_FAILED; /* tested first, as the measure may be no number */
  else if (PetscIsInfOrNanReal(measure)) *next = LATIN_NEXT_NOT_FINITE;
  else if (*next == LATIN_NEXT_CONTINUE) *next = SNESLatinReached(snes, measure, target);
  if (*next == LATIN_NEXT_ROUNDING) PetscCall(PetscInfo(snes, "The requested error, %g, is below the rounding error of this structure, about %g\n", (double)data->target, (double)data->estimate.floor));
  if (!SNESLatinUserTest(snes) && SNESLatinFinishes(data, measure, target, *next)) *next = LATIN_NEXT_NEWTON_FINISH;
  if (*next == LATIN_NEXT_CONTINUE && SNESLatinGrows(snes)) *next = LATIN_NEXT_DIVERGED;
  if (LatinNextConverged(*next)) PetscCall(SNESLatinProve_Private(snes, next));
  stalled = LatinNewtonStalled(&data->newton, measure, target);
  if (SNESLatinStalls(data, stalled, target, *next)) *next = LATIN_NEXT_NEWTON_STALL;
  if (*next == LATIN_NEXT_CONTINUE && (SNESLatinStagesLeft(snes) <= 0 || latin->linear.applications >= data->newton.last)) *next = LATIN_NEXT_MAX_IT;
  if (*next == LATIN_NEXT_CONTINUE || *next == LATIN_NEXT_DIVERGED) PetscCall(LatinParameterDue_Private(latin, &data->parameter, next));
  if (!SNESLatinUserTest(snes)) PetscCall(SNESLatinGrains_Private(snes, next));
  if (!SNESLatinUserTest(snes)) PetscCall(SNESLatinSlides_Private(snes, next));
  PetscFunctionReturn(0);
}

/*
   Returns in *again whether this linear stage has been tested already: the acceleration may test a stage twice. The first stage sets the distance to
   which divergence is relative. Not collective
*/
static PetscErrorCode SNESLatinTested_Private(SNES snes, PetscBool *again)
{
  SNES_Latin        *data   = (SNES_Latin *)snes->data;
  const LatinLinear *linear = &data->latin->linear;

  PetscFunctionBegin;
  *again = (PetscBool)(data->tested == linear->applications);
  if (*again) PetscFunctionReturn(0);
  data->tested = linear->applications;
  if (data->first_distance < 0.0) data->first_distance = linear->distance;
  PetscFunctionReturn(0);
}

/* Convergence test of the inner SNES, once per linear stage */
static PetscErrorCode SNESLatinConverged_Private(SNES outer, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  SNES        snes = (SNES)ctx;
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscReal   measure, target;
  PetscBool   again;

  PetscFunctionBegin;
  *reason = SNES_CONVERGED_ITERATING;
  PetscCall(SNESLatinTested_Private(snes, &again));
  if (again) PetscFunctionReturn(0);
  PetscCall(SNESLatinMeasure_Private(snes, &measure, &target));
  PetscCall(SNESLatinWatch_Private(snes, data->latin->linear.applications));
  PetscCall(SNESLatinMonitor_Private(snes));
  PetscCall(data->decide(snes, PetscIsInfOrNanReal(fnorm) ? fnorm : measure, target, &data->next));
  if (data->next == LATIN_NEXT_CONTINUE) {
    PetscTryTypeMethod(snes, update, snes->iter);
    PetscFunctionReturn(0);
  }
  *reason = SNESLatinReason(data->next);
  if (!*reason) *reason = SNES_CONVERGED_ITS; /* stops the inner SNES; data->next has the reason */
  PetscFunctionReturn(0);
}

/* Iterates from the state z until `decide` ends it, or the inner SNES does. Collective on snes */
PetscErrorCode SNESLatinIterate_Private(SNES snes, LatinDecide decide)
{
  SNES_Latin         *data = (SNES_Latin *)snes->data;
  SNESConvergedReason reason;

  PetscFunctionBegin;
  data->next   = LATIN_NEXT_CONTINUE;
  data->decide = decide;
  PetscCall(SNESLatinOuterSetUp_Private(snes));
  PetscCall(SNESSetConvergenceTest(data->outer, SNESLatinConverged_Private, snes, NULL));
  PetscCall(SNESSetTolerances(data->outer, 0.0, 0.0, 0.0, SNESLatinStageLimit(snes), PETSC_MAX_INT));
  PetscCall(SNESSolve(data->outer, NULL, data->z));
  PetscCall(SNESGetConvergedReason(data->outer, &reason));
  if (data->next != LATIN_NEXT_CONTINUE) PetscFunctionReturn(0);
  /* a line search may find no step */
  data->next   = reason == SNES_DIVERGED_FUNCTION_NANORINF ? LATIN_NEXT_NOT_FINITE : data->newton.stall && decide == SNESLatinDecide_Private ? LATIN_NEXT_NEWTON_STALL : LATIN_NEXT_GIVEN;
  snes->reason = reason;
  PetscFunctionReturn(0);
}
