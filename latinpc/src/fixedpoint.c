#include "sneslatinimpl.h"
#include <petsc/private/snesimpl.h>

/*
   The article's iteration as a fixed-point problem z = G(z), given to an inner SNES of the user's choice (prefix
   -snes_latin_outer_): nrichardson is the plain iteration of section 3.3, anderson and others accelerate it. Its function
   is z - G(z), its convergence test that of SNES latin. For G itself see latin.c.
*/

/* F(z) = z - G(z), one linear and one local stage */
PetscErrorCode SNESLatinFixedPoint_Private(SNES outer, Vec z, Vec F, void *ctx)
{
  SNES_Latin *data  = (SNES_Latin *)((SNES)ctx)->data;
  Latin       latin = data->latin;
  PetscInt    k;

  PetscFunctionBegin;
  PetscCall(LatinApply_Private(latin, z, F));
  PetscCall(LatinBalanceObserve_Private(latin, z, F, &data->balance));
  PetscCall(VecAYPX(F, -1.0, z));
  if (latin->failed) PetscCall(SNESSetFunctionDomainError(outer));
  if (data->stop == LATIN_STOP_ERROR) PetscCall(LatinEstimateUpdate_Private(latin, data->target, &data->estimate));
  k = latin->applications - 1;
  if (k < data->history_size) {
    data->indicator[k] = latin->indicator;
    data->estimates[k] = data->estimate.value;
    if (data->reference) PetscCall(LatinErrors_Private(latin, data->reference_copy, &data->error_l2[k], &data->error_energy[k]));
    data->done = k + 1;
  }
  PetscFunctionReturn(0);
}

/* The nodal unbalance of the mean displacements, which become the solution vector */
PetscErrorCode SNESLatinResidual_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(LatinAverage_Private(data->latin, snes->vec_sol));
  PetscCall(LatinSubstructureReturn_Private(data->latin));
  PetscCall(SNESComputeFunction(snes, snes->vec_sol, snes->vec_func));
  PetscCall(VecNorm(snes->vec_func, NORM_2, &data->residual));
  PetscFunctionReturn(0);
}

/* Displacements larger than the structure are a solution if forces balance. To be called where the iteration has converged */
static PetscErrorCode SNESLatinProve_Private(SNES snes, SNESConvergedReason *reason)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   due = PETSC_FALSE, balances = PETSC_TRUE;

  PetscFunctionBegin;
  PetscCall(LatinProofIsDue_Private(data->latin, &due));
  if (!due) PetscFunctionReturn(0);
  PetscCall(SNESLatinResidual_Private(snes));
  PetscCall(LatinProofBalances_Private(data->latin->links, snes->vec_sol, snes->vec_rhs, snes->vec_func, &balances));
  if (!balances) *reason = SNES_DIVERGED_DTOL;
  PetscFunctionReturn(0);
}

/* Is it time for Newton's method: no progress, a divergence, or a convergence that proves nothing? */
static PetscBool SNESLatinStalls_Private(SNES_Latin *data, PetscReal norm, PetscReal stol, PetscReal rtol, SNESConvergedReason reason)
{
  const PetscReal target  = data->stop == LATIN_STOP_ERROR ? data->target : data->stop == LATIN_STOP_RESIDUAL ? rtol * data->first_residual : stol;
  const PetscBool stalled = LatinRescueStalled(&data->rescue, norm, target);

  if (!data->rescue.able || data->rescue.called || !(target > 0.0)) return PETSC_FALSE;
  if (reason > 0) return data->rescue.contrast;
  if (reason == SNES_DIVERGED_INNER) return data->rescue.contrast; /* rounding, which Newton's method meets too unless stiffnesses are its cause */
  return reason < 0 ? (PetscBool)(reason != SNES_DIVERGED_LINEAR_SOLVE) : stalled;
}

/* Has the iteration ended by rounding, not because what was asked for is reached? Newton's method has digits left */
static PetscBool SNESLatinRests_Private(const SNES_Latin *data, SNESConvergedReason reason)
{
  const PetscBool rests = (PetscBool)(data->latin->distance <= data->latin->noise);

  if (data->stop == LATIN_STOP_ERROR) return (PetscBool)(data->estimate.rounding && !data->estimate.energy && reason == SNES_DIVERGED_INNER);
  if (data->stop == LATIN_STOP_RESIDUAL) return (PetscBool)(rests && reason == SNES_CONVERGED_SNORM_RELATIVE);
  return (PetscBool)(rests && reason > 0 && data->stop == LATIN_STOP_INDICATOR);
}

/*
   The convergence test of the inner SNES decides for both. The reasons keep the meaning of PETSc's manual: the
   indicator is the relative length of the step that the next iteration would make (SNORM), the residual stop is on
   the function that the user gave (FNORM).
*/
PetscErrorCode SNESLatinConverged_Private(SNES outer, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  SNES        snes  = (SNES)ctx;
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;
  PetscReal   norm  = latin->indicator;

  PetscFunctionBegin;
  (void)outer;
  (void)it;
  (void)xnorm;
  (void)snorm;
  *reason = SNES_CONVERGED_ITERATING;
  if (data->tested == latin->applications) PetscFunctionReturn(0);
  data->tested = latin->applications;
  if (data->first_distance < 0.0) data->first_distance = latin->distance;
  if (data->stop == LATIN_STOP_RESIDUAL) {
    PetscCall(SNESLatinResidual_Private(snes));
    norm = data->residual;
  } else if (data->stop == LATIN_STOP_REFERENCE && data->done) norm = data->error_l2[data->done - 1];
  else if (data->stop == LATIN_STOP_ERROR) {
    if (data->estimate.value <= data->target || data->estimate.rounding) {
      PetscCall(SNESLatinResidual_Private(snes));
      PetscCall(LatinEstimateDoubt_Private(latin, data->target, snes->vec_sol, snes->vec_func, &data->estimate));
      if (data->done) data->estimates[data->done - 1] = data->estimate.value;
    }
    norm = data->estimate.value;
  }
  snes->iter = latin->applications;
  snes->norm = norm;
  PetscCall(SNESLogConvergenceHistory(snes, norm, 0));
  PetscCall(SNESMonitor(snes, snes->iter, norm));

  if (PetscIsInfOrNanReal(norm) || PetscIsInfOrNanReal(fnorm)) *reason = SNES_DIVERGED_FUNCTION_NANORINF;
  else if (latin->failed) *reason = SNES_DIVERGED_LINEAR_SOLVE;
  else if (data->stop == LATIN_STOP_RESIDUAL) {
    if (norm <= snes->abstol) *reason = SNES_CONVERGED_FNORM_ABS;
    else if (norm <= snes->rtol * data->first_residual) *reason = SNES_CONVERGED_FNORM_RELATIVE;
    else if (latin->distance <= latin->noise) *reason = SNES_CONVERGED_SNORM_RELATIVE; /* a fixed point: nothing more can change */
  } else if (data->stop == LATIN_STOP_ERROR) {
    if (norm <= data->target) *reason = SNES_CONVERGED_SNORM_RELATIVE;
    else if (data->estimate.rounding) {
      *reason = SNES_DIVERGED_INNER; /* the inner solvers are not accurate enough for more */
      PetscCall(PetscInfo(snes, "The error asked for, %g, is below what rounding leaves on this structure, about %g\n", (double)data->target, (double)data->estimate.floor));
    }
  } else if (norm <= snes->stol || latin->distance <= latin->noise) *reason = SNES_CONVERGED_SNORM_RELATIVE;
  if (data->handed && SNESLatinRests_Private(data, *reason)) *reason = SNES_CONVERGED_ITS;
  if (!*reason && data->handed && latin->indicator <= data->polish.start) *reason = SNES_CONVERGED_ITS;
  if (!*reason && snes->divtol > 0.0 && latin->distance > snes->divtol * data->first_distance) *reason = SNES_DIVERGED_DTOL;
  if (*reason > 0 && *reason != SNES_CONVERGED_ITS) PetscCall(SNESLatinProve_Private(snes, reason));
  if (SNESLatinStalls_Private(data, norm, snes->stol, snes->rtol, *reason)) {
    data->rescue.called = PETSC_TRUE;
    *reason             = SNES_CONVERGED_ITS;
  }
  if (!*reason && latin->applications >= snes->max_its) *reason = SNES_DIVERGED_MAX_IT;
  if (!*reason || *reason == SNES_DIVERGED_DTOL) {
    PetscBool due;

    PetscCall(LatinBalanceDue_Private(latin, norm, (PetscBool)(*reason == SNES_DIVERGED_DTOL), &data->balance, &due));
    if (due) *reason = SNES_CONVERGED_ITS;
  }
  PetscFunctionReturn(0);
}

/*
   The inner SNES and its defaults, which the user's options override: Anderson of depth 10, for structures with rigid
   laws with restarts, for it is slowed down there by differences from before links changed between taut and slack; and
   for nrichardson the full step that is the article's iteration. PETSc has no setter for the depth, only an option, so the default goes
   in through an options database of our own; the user's is not touched.
*/
static PetscErrorCode SNESLatinOuterType_Private(SNES snes, const char type[])
{
  SNES_Latin    *data = (SNES_Latin *)snes->data;
  PetscBool      set;
  PetscOptions   defaults;
  SNESLineSearch search;

  PetscFunctionBegin;
  PetscCall(SNESSetType(data->outer, type));
  PetscCall(PetscStrcmp(type, SNESNRICHARDSON, &set));
  if (set) {
    PetscCall(SNESGetLineSearch(data->outer, &search));
    PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHNONE));
  }
  PetscCall(PetscStrcmp(type, SNESANDERSON, &set));
  if (set) {
    /* the type's own options only, and none of them printed: SNESSetFromOptions() would mark all as printed for -help */
    PetscCall(PetscOptionsCreate(&defaults));
    PetscCall(PetscOptionsSetValue(defaults, "-latin_defaults_snes_anderson_m", "10"));
    if (data->outer_rigid) {
      PetscCall(PetscOptionsSetValue(defaults, "-latin_defaults_snes_anderson_restart_type", "periodic"));
      PetscCall(PetscOptionsSetValue(defaults, "-latin_defaults_snes_anderson_restart", "30"));
    }
    PetscCall(PetscOptionsPush(defaults));
    PetscOptionsBegin(PetscObjectComm((PetscObject)snes), "latin_defaults_", "LATIN defaults", NULL);
    PetscCall((*data->outer->ops->setfromoptions)(data->outer, PetscOptionsObject));
    PetscOptionsEnd();
    PetscCall(PetscOptionsPop());
    PetscCall(PetscOptionsDestroy(&defaults));
  }
  PetscFunctionReturn(0);
}

/* Reads the options of the inner SNES, as often as those of snes are read; another type comes with its own defaults */
PetscErrorCode SNESLatinOuterOptions_Private(SNES snes)
{
  SNES_Latin  *data    = (SNES_Latin *)snes->data;
  PetscOptions options = ((PetscObject)snes)->options;
  const char  *prefix;
  char         type[64];
  PetscBool    set, same;

  PetscFunctionBegin;
  PetscCall(SNESGetOptionsPrefix(data->outer, &prefix));
  PetscCall(PetscOptionsGetString(options, prefix, "-snes_type", type, sizeof(type), &set));
  if (!set) PetscCall(PetscStrncpy(type, ((PetscObject)data->outer)->type_name ? ((PetscObject)data->outer)->type_name : SNESANDERSON, sizeof(type)));
  PetscCall(PetscObjectTypeCompare((PetscObject)data->outer, type, &same));
  if (!same) PetscCall(SNESLatinOuterType_Private(snes, type));
  PetscCall(PetscObjectSetOptions((PetscObject)data->outer, options));
  PetscCall(SNESSetFromOptions(data->outer));
  PetscFunctionReturn(0);
}

PetscErrorCode SNESLatinCreateOuter_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  const char *prefix;
  LatinLinks  links;

  PetscFunctionBegin;
  if (data->outer) PetscFunctionReturn(0);
  PetscCall(SNESLatinFindLinks_Private(snes, &links));
  data->outer_rigid = (PetscBool)(links && links->rigid_law >= 0);
  PetscCall(SNESCreate(PetscObjectComm((PetscObject)snes), &data->outer));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)data->outer, (PetscObject)snes, 1));
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(SNESSetOptionsPrefix(data->outer, prefix));
  PetscCall(SNESAppendOptionsPrefix(data->outer, "snes_latin_outer_"));
  PetscCall(SNESLatinOuterOptions_Private(snes));
  PetscFunctionReturn(0);
}
