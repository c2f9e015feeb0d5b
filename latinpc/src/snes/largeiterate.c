#include "snes/sneslatinimpl.h"

/*
   The iteration if links turn by large angles (snes/large.c). After each linear stage SNESLatinLargeDecide_Private chooses: go on, make new operators,
   hand over to Newton's method, or end. If Newton's method fails, the iteration goes on until its error is a hundredth of that.
*/

#define LATIN_LARGE_FAR  0.01                          /* factor on the error at which Newton's method is tried again after it has failed */
#define LATIN_LARGE_REST LatinByPrecision(2e-11, 1e-3) /* indicator below which stages may be rounding */
#define LATIN_LARGE_IDLE 10                            /* stages in a row that do not halve the measure of the stop: they are rounding */
/*
   linear stages without halving the measure of the stop after which a time step ends. Steps of masts, towers and bridges that never converge take a fifth
   of the time; of many steps, two that took 6,000 and 10,000 stages are lost
*/
#define LATIN_LARGE_PATIENCE 500

/*
   Returns whether new operators at the present displacements pay: more linear stages are left, at the rate of the last window, than a set-up costs.
   goal: the measure at the end, or where Newton's method takes over. To be called once per stage. Not collective
*/
static PetscBool LatinLargeDue(LatinLargeProgress *progress, PetscReal cost, PetscReal measure, PetscReal goal)
{
  PetscReal gain, left;

  progress->least = PetscMin(progress->least, measure);
  if (++progress->stages < progress->window) return PETSC_FALSE;
  gain             = PetscLogReal(progress->before / progress->least);
  left             = PetscLogReal(progress->least / goal);
  progress->before = PetscMin(progress->before, progress->least);
  progress->least  = PETSC_MAX_REAL;
  progress->stages = 0;
  return (PetscBool)(left > 0.0 && progress->window * left > cost * gain);
}

/* Returns whether the changes are rounding: stages change little and do not halve the measure of the stop. Once per stage */
static PetscBool LatinLargeIdles(LatinLargeProgress *progress, PetscReal measure, PetscReal indicator)
{
  progress->idle = indicator <= LATIN_LARGE_REST && measure > 0.5 * progress->lowest ? progress->idle + 1 : 0;
  if (!progress->idle) progress->lowest = measure;
  return (PetscBool)(progress->idle >= LATIN_LARGE_IDLE);
}

/* Returns whether a time step is given up: one that is long beside the periods may have no solution that can be found. Once per stage */
static PetscBool LatinLargeGivesUp(LatinLargeProgress *progress, PetscReal measure, PetscInt stage)
{
  if (measure <= 0.5 * progress->half) {
    progress->half   = measure;
    progress->halved = stage;
  }
  return (PetscBool)(stage - progress->halved >= LATIN_LARGE_PATIENCE);
}

/* Whether the iteration has ended: failed, at the target, at rounding, or where Newton's method finishes it; else LATIN_NEXT_CONTINUE. Collective on snes */
static PetscErrorCode SNESLatinLargeEnds_Private(SNES snes, PetscReal measure, PetscReal target, LatinNext *next)
{
  SNES_Latin        *data   = (SNES_Latin *)snes->data;
  LatinLarge        *large  = &data->large;
  const LatinLinear *linear = &data->latin->linear;
  const PetscBool    rests  = (PetscBool)(linear->distance <= linear->noise);

  PetscFunctionBegin;
  if (linear->failed) *next = LATIN_NEXT_FAILED;
  else if (PetscIsInfOrNanReal(measure)) *next = LATIN_NEXT_NOT_FINITE;
  else if (SNESLatinUserTest(snes)) *next = LATIN_NEXT_CONTINUE; /* the user's test decides */
  else if (SNESLatinLargeProves(data)) *next = measure <= large->near || rests ? LATIN_NEXT_NEWTON_FINISH : LATIN_NEXT_CONTINUE;
  else if (measure <= target) *next = data->stop == LATIN_STOP_RESIDUAL ? LATIN_NEXT_CONVERGED_FNORM : LATIN_NEXT_CONVERGED;
  else if (rests) *next = SNESLatinEstimates(data) ? LATIN_NEXT_ROUNDING : LATIN_NEXT_CONVERGED;
  else if (LatinLargeIdles(&large->progress, measure, linear->indicator)) *next = LATIN_NEXT_ROUNDING;
  if (*next != LATIN_NEXT_CONVERGED || !SNESLatinEstimates(data)) PetscFunctionReturn(0);
  PetscCall(SNESLatinResidual_Private(snes));
  if (data->residual > large->balance) *next = LATIN_NEXT_CONTINUE;
  PetscFunctionReturn(0);
}

/* Decides what follows this linear stage. Collective on snes */
static PetscErrorCode SNESLatinLargeDecide_Private(SNES snes, PetscReal measure, PetscReal target, LatinNext *next)
{
  SNES_Latin        *data   = (SNES_Latin *)snes->data;
  LatinLarge        *large  = &data->large;
  const LatinLinear *linear = &data->latin->linear;
  const PetscReal    goal   = SNESLatinLargeProves(data) ? large->near : SNESLatinUserTest(snes) ? 0.0 : target;

  PetscFunctionBegin;
  if (*next == LATIN_NEXT_CONTINUE) PetscCall(SNESLatinLargeEnds_Private(snes, measure, target, next));
  if (*next != LATIN_NEXT_CONTINUE) PetscFunctionReturn(0);
  if (snes->divtol > 0.0 && linear->distance > snes->divtol * data->first_distance) *next = LATIN_NEXT_DIVERGED;
  else if (SNESLatinStagesLeft(snes) <= 0 || linear->applications >= large->last) *next = LATIN_NEXT_MAX_IT;
  else if (large->frame->original->midpoint && LatinLargeGivesUp(&large->progress, measure, linear->applications)) *next = LATIN_NEXT_MAX_IT;
  else if (LatinLargeDue(&large->progress, large->cost, measure, goal)) *next = LATIN_NEXT_REBUILD;
  PetscFunctionReturn(0);
}

/*
   Runs Newton's method after the iteration. If it fails, the iteration goes on with new operators, to a smaller error. *done: the solve has ended.
   Collective on snes
*/
static PetscErrorCode SNESLatinLargeProve_Private(SNES snes, PetscBool *done)
{
  SNES_Latin     *data     = (SNES_Latin *)snes->data;
  LatinLarge     *large    = &data->large;
  const PetscBool rests    = (PetscBool)(data->latin->linear.distance <= data->latin->linear.noise);
  const PetscInt  renewals = large->renewals;
  PetscBool       far;

  PetscFunctionBegin;
  PetscCall(LatinAverage_Private(&data->latin->linear, snes->vec_sol));
  large->iteration_error[0] = large->iteration_error[1] = 0.0;
  large->iterated                                       = PETSC_TRUE;
  PetscCall(SNESLatinLargeFinish_Private(snes, PETSC_TRUE, PETSC_TRUE, done));
  large->iterated = PETSC_FALSE;
  if (!*done && large->newton_failed) PetscCall(SNESLatinLargeConvex_Private(snes, PETSC_FALSE, done));
  if (*done) PetscFunctionReturn(0);
  if (large->renewals > renewals || !large->frame->original->midpoint) PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_PRESENT));
  data->current        = -1;
  large->newton_failed = PETSC_TRUE;
  large->near *= LATIN_LARGE_FAR;
  PetscCall(PetscInfo(snes, "Newton's method is given up: its first step was %g, of the tensions %g; the iteration goes on to %g\n", (double)large->iteration_error[0], (double)large->iteration_error[1], (double)large->near));
  if (!rests) PetscFunctionReturn(0); /* the iteration rests where Newton's method finds no solution */
  PetscCall(LatinEquilibriumFar_Private(large->frame->original, snes->vec_sol, &far));
  far        = (PetscBool)(far || large->frame->original->rigid_law >= 0);                                                    /* incompatible rigid links repel each other */
  data->next = large->run.unstable || (far && large->run.force > large->balance) ? LATIN_NEXT_DIVERGED : LATIN_NEXT_ROUNDING; /* diverging displacements rest nowhere */
  *done      = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Solves for the present loads from the state z. Collective on snes */
PetscErrorCode SNESLatinLargeIterate_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscBool   done  = PETSC_FALSE, rests;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeBalance_Private(snes));
  PetscCall(SNESLatinLargeRests_Private(snes, &rests));
  if (rests && SNESLatinLargeProves(data)) PetscCall(SNESLatinLargeFinish_Private(snes, PETSC_FALSE, PETSC_FALSE, &done));
  while (!done) {
    PetscCall(SNESLatinLargeState_Private(snes));
    PetscCall(SNESLatinIterate_Private(snes, SNESLatinLargeDecide_Private));
    if (data->next == LATIN_NEXT_REBUILD) {
      PetscCall(LatinAverage_Private(&data->latin->linear, snes->vec_sol));
      if (large->newton_failed) PetscCall(SNESLatinLargeConvex_Private(snes, PETSC_FALSE, &done));
      if (done) break;
      if (!large->renewals || large->newton_failed || !SNESLatinLargeProves(data)) PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_PRESENT));
      else PetscCall(SNESLatinLargeProve_Private(snes, &done));
    } else if (data->next == LATIN_NEXT_NEWTON_FINISH) PetscCall(SNESLatinLargeProve_Private(snes, &done));
    else done = PETSC_TRUE;
  }
  PetscFunctionReturn(0);
}
