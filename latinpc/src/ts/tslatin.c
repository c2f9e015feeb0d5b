#include "snes/sneslatinimpl.h"
#include <petsc/private/tsimpl.h>

/*
   TS latin: the implicit Euler scheme (8) of section 2.2 in velocities and impulses, of first order, for motions with velocity jumps. With large
   displacements it is the implicit midpoint rule of structure/midpoint.h, solved for half a step, to the midpoint. A step of length h from (u, v):

   1. The step as a static problem (structure/timestep.c), whose operators depend on h alone.
   2. Its solution w by the SNES of the TS: w = h v+; midpoint rule: w = h (v + v+) / 4.
   3. u and v at the end: u + w, w / h; midpoint rule: u + 2 w, 4 w / h - v.
*/

/* default error of a step with large displacements: the midpoint rule conserves energy up to the errors of all steps, which add up */
#define TS_LATIN_ERROR LatinByPrecision(1e-8, 1e-4)

/* Computes the residual F = M a + B^t tau - loads, for PETSc's own integrators of second order */
static PetscErrorCode LatinStructureFunction_TS(TS ts, PetscReal t, Vec u, Vec v, Vec a, Vec F, void *ctx)
{
  LatinStructure base = ((LatinStructure)ctx)->base;
  Vec            f;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckRigid_Private(base, "An integrator other than -ts_type latin"));
  PetscCall(LatinStructureInertia_Private(base));
  PetscCall(DMGetGlobalVector(base->dm, &f));
  PetscCall(LatinStructureComputeResidual(base, u, f));
  PetscCall(VecPointwiseMult(F, base->inertia, a));
  PetscCall(VecAXPY(F, 1.0, f));
  PetscCall(DMRestoreGlobalVector(base->dm, &f));
  PetscFunctionReturn(0);
}

/* Computes its Jacobian shift_a M + B^t k_t B */
static PetscErrorCode LatinStructureJacobian_TS(TS ts, PetscReal t, Vec u, Vec v, Vec a, PetscReal shift_v, PetscReal shift_a, Mat J, Mat P, void *ctx)
{
  LatinStructure step = (LatinStructure)ctx;

  PetscFunctionBegin;
  PetscCall(LatinStepShift_Private(step, shift_a));
  PetscCall(LatinStructureJacobian_SNES(NULL, u, J, P, step));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureAttachTS_Private(LatinStructure structure, TS ts)
{
  LatinStructure step;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckComm_Private(structure, (PetscObject)ts));
  PetscCall(PetscObjectQuery((PetscObject)ts, "LatinStructure", (PetscObject *)&step));
  if (step && step->base == structure) PetscFunctionReturn(0);
  if (step) PetscCall(TSReset(ts)); /* its set-up and solution belong to another structure */
  PetscCall(LatinStepCheck_Private(structure));
  PetscCall(LatinStructureInertia_Private(structure));
  PetscCall(LatinStepCreate_Private(structure, &step));
  PetscCall(TSSetDM(ts, step->dm));
  PetscCall(TSSetI2Function(ts, NULL, LatinStructureFunction_TS, step));
  PetscCall(TSSetI2Jacobian(ts, NULL, NULL, LatinStructureJacobian_TS, step));
  PetscCall(PetscObjectCompose((PetscObject)ts, "LatinStructure", (PetscObject)step));
  PetscCall(PetscObjectDereference((PetscObject)step));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureAttachTS - Attaches the equation of motion of a structure to a TS: M a + B^t tau = F.

  Collective on ts; the TS keeps a reference to the structure. Attaching another structure resets the TS

  Input Parameters:
+ structure - set up, with masses
- ts        - of any type, on the communicator of the structure

  Level: beginner

  Notes:
  Use `-ts_type latin` for shocks, `-ts_type alpha2` or PETSc's other integrators of second order for smooth motions. Set
  initial displacements and velocities with `TS2SetSolution()`, vectors from the DM of the structure. For loads that change with
  time, call `LatinStructureSetLoads()` in a function given to `TSSetPreStep()`; for moving supports, call
  `LatinStructureSetPrescribed()` there with their positions at the end of the step. With `-ts_type latin` supports move during
  the step, and with them rigid links.

.seealso: `LatinStructureSetMass()`, `TSLATIN`
@*/
PetscErrorCode LatinStructureAttachTS(LatinStructure structure, TS ts)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscValidHeaderSpecific(ts, TS_CLASSID, 2);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureAttachTS_Private(structure, ts));
  PetscFunctionReturn(0);
}

/* Sets the defaults of time steps of a SNES latin, unless the user has chosen: the initial state, and no divergence tolerance, as a step has a solution */
static PetscErrorCode TSLatinDefaults_Private(SNES snes)
{
  PetscBool latin, given;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &latin));
  if (!latin) PetscFunctionReturn(0);
  if (!((SNES_Latin *)snes->data)->warm_chosen) ((SNES_Latin *)snes->data)->warm = LATIN_WARM_START_EXTRAPOLATE;
  PetscCall(PetscOptionsHasName(((PetscObject)snes)->options, ((PetscObject)snes)->prefix, "-snes_divergence_tolerance", &given));
  if (!given && snes->divtol == (PetscReal)LATIN_PETSC_DIVTOL) PetscCall(SNESSetDivergenceTolerance(snes, PETSC_UNLIMITED));
  PetscFunctionReturn(0);
}

/* Gets data->step, the structure of a step (NULL: none attached), and the SNES, of type latin unless another type is set. Collective on ts */
static PetscErrorCode TSLatinFind_Private(TS ts, SNES *snes)
{
  TS_Latin *data = (TS_Latin *)ts->data;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)ts, "LatinStructure", (PetscObject *)&data->step));
  PetscCall(TSGetSNES(ts, snes));
  if (!((PetscObject)*snes)->type_name) PetscCall(SNESSetType(*snes, SNESLATIN));
  PetscCall(TSLatinDefaults_Private(*snes));
  PetscFunctionReturn(0);
}

/* Copies a geometry option of the SNES to the structure, and sets the default error of a step. Collective on snes */
static PetscErrorCode TSLatinGeometry_Private(LatinStructure step, SNES snes)
{
  PetscBool latin;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &latin));
  if (latin && ((SNES_Latin *)snes->data)->large.given) PetscCall(LatinStructureSetGeometry(step->base, ((SNES_Latin *)snes->data)->large.geometry));
  PetscCall(LatinStepCheck_Private(step->base));
  if (latin && !((SNES_Latin *)snes->data)->chosen) ((SNES_Latin *)snes->data)->target = step->base->geometry == LATIN_GEOMETRY_LARGE ? TS_LATIN_ERROR : LATIN_ERROR;
  PetscCall(LatinStepLength_Private(step, -1.0));
  PetscFunctionReturn(0);
}

/* Checks that the adaptor needs no error estimate: without one it would repeat the step for ever. Any adaptor shortens a failed step. Collective on ts */
static PetscErrorCode TSLatinAdapt_Private(TS ts)
{
  TSAdapt   adapt;
  PetscBool is;

  PetscFunctionBegin;
  PetscCall(TSGetAdapt(ts, &adapt));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)adapt, &is, TSADAPTBASIC, TSADAPTDSP, TSADAPTGLEE, ""));
  PetscCheck(!is, PetscObjectComm((PetscObject)ts), PETSC_ERR_SUP, "-ts_adapt_type %s needs an error estimate of steps, and TS latin has none: remove it, and set the length with -ts_dt; failed steps are shortened with any adaptor",
             ((PetscObject)adapt)->type_name);
  PetscFunctionReturn(0);
}

static PetscErrorCode TSSetUp_Latin(TS ts)
{
  TS_Latin *data = (TS_Latin *)ts->data;
  SNES      snes;

  PetscFunctionBegin;
  PetscCall(TSLatinFind_Private(ts, &snes));
  PetscCheck(data->step, PetscObjectComm((PetscObject)ts), PETSC_ERR_ORDER,
             "-ts_type latin has no structure to work on: build one with LatinStructureCreate() and give it to this TS with LatinStructureAttachTS() (in Python, latinpc.Structure(...).attach(ts))");
  PetscCall(TSLatinAdapt_Private(ts));
  PetscCall(TSLatinGeometry_Private(data->step, snes));
  if (!ts->vec_dot) PetscCall(VecDuplicate(ts->vec_sol, &ts->vec_dot)); /* initially at rest */
  if (!data->w) PetscCall(VecDuplicate(ts->vec_sol, &data->w));
  PetscCall(LatinStructureAttachSNES(data->step, snes));
  if (data->again) PetscCall(LatinStepMade_Private(data->step, NULL)); /* after TSReset() another motion starts from the present supports */
  data->again = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Raises the error of a failed step. Collective on ts */
static PetscErrorCode TSLatinFailed_Private(TS ts, SNES snes)
{
  char                cause[600];
  SNESConvergedReason reason;

  PetscFunctionBegin;
  PetscCall(SNESGetConvergedReason(snes, &reason));
  PetscCall(TSLatinGetCause(ts, sizeof(cause), cause));
  SETERRQ(PetscObjectComm((PetscObject)ts), PETSC_ERR_NOT_CONVERGED, "Step %" PetscInt_FMT ", from %g to %g, has not converged: %s. %s", ts->steps + 1, (double)ts->ptime, (double)(ts->ptime + ts->time_step), SNESConvergedReasons[reason], cause);
}

/* Stores the start of a step, if there are events, which return to it. Collective on ts */
static PetscErrorCode TSLatinKeep_Private(TS ts)
{
  TS_Latin *data = (TS_Latin *)ts->data;

  PetscFunctionBegin;
  if (!ts->event) PetscFunctionReturn(0);
  if (!data->u_before) {
    PetscCall(VecDuplicate(ts->vec_sol, &data->u_before));
    PetscCall(VecDuplicate(ts->vec_dot, &data->v_before));
  }
  PetscCall(VecCopy(ts->vec_sol, data->u_before));
  PetscCall(VecCopy(ts->vec_dot, data->v_before));
  PetscFunctionReturn(0);
}

/* Returns to the start of the last step, for events. Collective on ts */
static PetscErrorCode TSRollBack_Latin(TS ts)
{
  TS_Latin *data = (TS_Latin *)ts->data;

  PetscFunctionBegin;
  PetscCheck(data->u_before, PetscObjectComm((PetscObject)ts), PETSC_ERR_SUP, "TSRollBack() of TS latin is for TSSetEventHandler(): without one no step is kept");
  PetscCall(VecCopy(data->u_before, ts->vec_sol));
  PetscCall(VecCopy(data->v_before, ts->vec_dot));
  PetscCall(LatinStepBack_Private(data->step));
  if (ts->steps == 1) data->moved = PETSC_FALSE; /* as before the first step */
  PetscFunctionReturn(0);
}

/* Checks the start of a motion, and takes over changes of the geometry since the last step. Collective on ts */
static PetscErrorCode TSLatinPrepare_Private(TS ts, SNES snes)
{
  TS_Latin       *data     = (TS_Latin *)ts->data;
  const PetscBool midpoint = data->step->midpoint;

  PetscFunctionBegin;
  if (!ts->steps && data->started) LatinAgree(PetscObjectComm((PetscObject)ts), data->moved, PETSC_ERR_ORDER, "Supports have moved in the last motion of this TS: before another one call TSReset(), with the supports where it starts");
  PetscCall(TSLatinGeometry_Private(data->step, snes));
  if (data->step->midpoint != midpoint) PetscCall(LatinStructureAttachSNES(data->step, snes)); /* another objective for line searches */
  PetscFunctionReturn(0);
}

/* Returns the length of the step that the SNES has solved, or of its half (midpoint rule), as it is in the operators: not changed by rounding */
static PetscReal TSLatinLength(const TS_Latin *data)
{
  return 1.0 / PetscSqrtReal(data->step->shift);
}

/* Solves a step of the present length, or its half (midpoint rule): data->w. Collective on ts */
static PetscErrorCode TSLatinSolve_Private(TS ts, SNES snes)
{
  TS_Latin       *data = (TS_Latin *)ts->data;
  const PetscBool half = (PetscBool)(data->step->base->geometry == LATIN_GEOMETRY_LARGE);
  PetscBool       latin;
  PetscInt        linear;

  PetscFunctionBegin;
  PetscCall(LatinStepStart_Private(data->step, (half ? 0.5 : 1.0) * ts->time_step, ts->vec_sol, ts->vec_dot));
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &latin));
  PetscCall(VecAXPBY(data->w, latin && !half ? 0.0 : TSLatinLength(data), 0.0, ts->vec_dot)); /* initial guess: constant velocity; SNES latin has its last states */
  if (latin && half) ((SNES_Latin *)snes->data)->has_state = PETSC_FALSE;                     /* links have turned since the last state */
  PetscCall(SNESSolve(snes, NULL, data->w));
  PetscCall(SNESGetIterationNumber(snes, &data->iterations));
  PetscCall(SNESGetLinearSolveIterations(snes, &linear));
  ts->snes_its += data->iterations;
  ts->ksp_its += linear;
  PetscFunctionReturn(0);
}

/* Sets displacements and velocities at the end of the step (3 in the comment of the file). Collective on ts */
static PetscErrorCode TSLatinEnd_Private(TS ts)
{
  TS_Latin       *data = (TS_Latin *)ts->data;
  const PetscReal part = data->step->midpoint ? 0.5 : 1.0, h = TSLatinLength(data);

  PetscFunctionBegin;
  data->started = PETSC_TRUE;
  PetscCall(LatinStepMade_Private(data->step, &data->moved));
  PetscCall(VecAXPY(ts->vec_sol, 1.0 / part, data->w));
  PetscCall(VecAXPBY(ts->vec_dot, 1.0 / (part * h), 1.0 - 1.0 / part, data->w));
  PetscFunctionReturn(0);
}

/* Takes a step; repeats it while the adaptor shortens it. Collective on ts */
static PetscErrorCode TSStep_Latin(TS ts)
{
  TS_Latin *data = (TS_Latin *)ts->data;
  PetscReal next = ts->time_step, first = ts->time_step;
  PetscBool accept     = PETSC_FALSE;
  PetscInt  rejections = 0;
  SNES      snes;

  PetscFunctionBegin;
  PetscCall(TSGetSNES(ts, &snes));
  PetscCall(TSLatinPrepare_Private(ts, snes));
  while (!ts->reason && !accept) {
    PetscCall(TSPreStage(ts, ts->ptime + ts->time_step));
    PetscCall(TSLatinSolve_Private(ts, snes));
    PetscCall(TSPostStage(ts, ts->ptime + ts->time_step, 0, &data->w));
    PetscCall(TSAdaptCheckStage(ts->adapt, ts, ts->ptime + ts->time_step, ts->vec_sol, &accept)); /* shortens the step after a failed solve */
    if (accept) PetscCall(TSAdaptChoose(ts->adapt, ts, ts->time_step, NULL, &next, &accept));
    if (accept) break;
    ts->reject++;
    if (!ts->reason && ++rejections > ts->max_reject && ts->max_reject >= 0) ts->reason = TS_DIVERGED_STEP_REJECTED;
  }
  if (ts->reason == TS_DIVERGED_NONLINEAR_SOLVE && ts->errorifstepfailed) PetscCall(TSLatinFailed_Private(ts, snes));
  if (ts->reason) PetscFunctionReturn(0);
  PetscCall(TSLatinKeep_Private(ts));
  PetscCall(TSLatinEnd_Private(ts));
  if (ts->time_step < first && !(data->whole > 0.0)) data->end = ts->ptime + (data->whole = first);
  ts->ptime += ts->time_step;
  ts->time_step = LatinStepNext(ts, next);
  PetscFunctionReturn(0);
}

LatinWatched(TSSetUp_Latin, TS)
LatinWatched(TSStep_Latin, TS)

/* Interpolates linearly in the step: constant velocity */
static PetscErrorCode TSInterpolate_Latin(TS ts, PetscReal t, Vec u)
{
  TS_Latin *data = (TS_Latin *)ts->data;

  PetscFunctionBegin;
  if (data->started && data->step->midpoint) PetscCall(VecWAXPY(u, (t - ts->ptime) * PetscSqrtReal(data->step->shift), data->w, ts->vec_sol));
  else PetscCall(VecWAXPY(u, t - ts->ptime, ts->vec_dot, ts->vec_sol));
  PetscFunctionReturn(0);
}

/* Prints energies, iterations of the SNES and the number of active unilateral links of a step. Collective on ts */
static PetscErrorCode TSMonitor_Latin(TS ts, PetscInt steps, PetscReal t, Vec u, void *ctx)
{
  PetscViewerAndFormat *vf   = (PetscViewerAndFormat *)ctx;
  TS_Latin             *data = (TS_Latin *)ts->data;
  PetscReal             kinetic, potential;
  PetscInt              active, unilateral;
  PetscBool             latin;
  SNES                  snes;
  const PetscReal      *rigid;
  char                  solved[128] = "";

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)ts, TSLATIN, &latin));
  if (steps < 0 || !latin) PetscFunctionReturn(0); /* a repetition of the last step; the type has changed since */
  PetscCall(LatinStructureComputeKineticEnergy(data->step->base, ts->vec_dot, &kinetic));
  PetscCall(LatinStructureComputeEnergy(data->step->base, u, &potential));
  if (steps && data->started) {
    PetscCall(TSGetSNES(ts, &snes));
    PetscCall(LatinSolverRigid_Private(snes, data->step, &rigid));
    PetscCall(LatinStructureCountActive_Private(data->step, rigid, data->w, &active, &unilateral));
    PetscCall(PetscSNPrintf(solved, sizeof(solved), "  iterations %" PetscInt_FMT "  active links %" PetscInt_FMT " of %" PetscInt_FMT, data->iterations, active, unilateral));
  }
  PetscCall(PetscViewerPushFormat(vf->viewer, vf->format));
  PetscCall(PetscViewerASCIIAddTab(vf->viewer, ((PetscObject)ts)->tablevel));
  PetscCall(PetscViewerASCIIPrintf(vf->viewer, "%3" PetscInt_FMT " t %-10g  energy: kinetic %12.6e  potential %13.6e  sum %13.6e%s\n", steps, (double)t, (double)kinetic, (double)potential, (double)(kinetic + potential), solved));
  PetscCall(PetscViewerASCIISubtractTab(vf->viewer, ((PetscObject)ts)->tablevel));
  PetscCall(PetscViewerPopFormat(vf->viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode TSSetFromOptions_Latin(TS ts, LatinOptionItems PetscOptionsObject)
{
  PetscViewerAndFormat *vf;
  PetscViewerFormat     format;
  PetscViewer           viewer;
  PetscBool             set;
  SNES                  snes;

  PetscFunctionBegin;
  PetscOptionsHeadBegin(PetscOptionsObject, "TS latin options");
  PetscCall(PetscOptionsViewer("-ts_latin_monitor", "Monitor energies, iterations and active links of each step", "None", &viewer, &format, &set));
  PetscOptionsHeadEnd();
  if (set) {
    PetscCall(PetscViewerAndFormatCreate(viewer, format, &vf));
    PetscCall(PetscViewerDestroy(&viewer));
    PetscCall(TSMonitorSet(ts, TSMonitor_Latin, vf, (PetscCtxDestroyFn *)PetscViewerAndFormatDestroy));
  }
  PetscCall(TSLatinFind_Private(ts, &snes)); /* sets the default type before the options of the SNES are read */
  PetscFunctionReturn(0);
}

static PetscErrorCode TSReset_Latin(TS ts)
{
  TS_Latin *data = (TS_Latin *)ts->data;

  PetscFunctionBegin;
  PetscCall(VecDestroy(&data->w));
  PetscCall(VecDestroy(&data->u_before));
  PetscCall(VecDestroy(&data->v_before));
  data->again   = data->started;
  data->started = data->moved = PETSC_FALSE;
  data->whole                 = 0.0;
  data->step                  = NULL; /* borrowed: another structure may replace it */
  PetscFunctionReturn(0);
}

/* Gives the SNES the equations of the TS again, for another type of TS. Collective on ts */
static PetscErrorCode TSLatinLeave_Private(TS ts)
{
  PetscBool latin;

  PetscFunctionBegin;
  PetscCall(SNESReset(ts->snes));
  PetscCall(PetscObjectCompose((PetscObject)ts->snes, "LatinStructure", NULL));
  PetscCall(SNESSetFunction(ts->snes, NULL, SNESTSFormFunction, ts));
  PetscCall(SNESSetJacobian(ts->snes, NULL, NULL, SNESTSFormJacobian, ts));
  PetscCall(LatinNoObjective_Private(ts->snes));
  PetscCall(PetscObjectTypeCompare((PetscObject)ts->snes, SNESLATIN, &latin));
  if (!latin) PetscFunctionReturn(0);
  PetscCall(SNESSetType(ts->snes, SNESNEWTONLS));
  PetscCall(SNESSetDivergenceTolerance(ts->snes, LATIN_PETSC_DIVTOL));
  PetscFunctionReturn(0);
}

static PetscErrorCode TSDestroy_Latin(TS ts)
{
  PetscFunctionBegin;
  PetscCall(TSReset_Latin(ts));
  if (ts->snes && ((PetscObject)ts)->refct > 0) PetscCall(TSLatinLeave_Private(ts)); /* the TS lives: its type changes */
  PetscCall(PetscFree(ts->data));
  PetscFunctionReturn(0);
}

static PetscErrorCode TSView_Latin(TS ts, PetscViewer viewer)
{
  TS_Latin *data = (TS_Latin *)ts->data;
  PetscBool ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "%s\n", data->step && data->step->midpoint ? "implicit midpoint rule with mean forces: conserves energy" : "implicit Euler in velocities and impulses"));
  if (data->step) PetscCall(PetscObjectView((PetscObject)data->step->base, viewer));
  PetscFunctionReturn(0);
}

/*@C
  TSLatinGetTensions - Gets the mean tensions of this rank's links during the last step, impulse over length of the step.

  Collective on ts

  Input Parameter:
. ts - of type latin

  Output Parameter:
. tension - [links_local], a force, positive in tension

  Level: intermediate

  Note:
  These are the tensions at the end of the step or, where velocities jump, impulses over its length. With large displacements they are
  those of the mean force, at the midpoint of the step. Before the first step they are those of the initial displacements, zero in
  rigid links.

.seealso: `TSLATIN`, `LatinStructureGetTensions()`
@*/
PetscErrorCode TSLatinGetTensions(TS ts, PetscReal tension[])
{
  TS_Latin *data;
  PetscBool latin;
  SNES      snes;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(ts, TS_CLASSID, 1);
  data = (TS_Latin *)ts->data;
  PetscCall(PetscObjectTypeCompare((PetscObject)ts, TSLATIN, &latin));
  PetscCheck(latin, PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_WRONG, "The TS is not of type latin: use LatinStructureGetTensions() with the displacements (in Python, latinpc.Structure.tensions(u))");
  PetscCall(TSLatinFind_Private(ts, &snes));
  PetscCheck(data->step && ts->vec_sol, PetscObjectComm((PetscObject)ts), PETSC_ERR_ORDER, "There is no motion yet: call LatinStructureAttachTS() and TS2SetSolution() first (in Python, latinpc.Structure(...).create_ts())");
  if (data->started) PetscCall(LatinSolverTensions_Private(snes, data->step, data->w, tension));
  else LatinWatch(PetscObjectComm((PetscObject)ts), LatinStructureTensions_Private(data->step->base, NULL, ts->vec_sol, tension));
  PetscFunctionReturn(0);
}

/*MC
  TSLATIN - Implicit Euler scheme in velocities and impulses for structures of links with masses (section 2.2)

  Options Database Keys:
+ -ts_latin_monitor  - print energies, iterations and active links of each step
. -ts_dt <h>         - length of a step; constant, as there is no error estimate for -ts_adapt_type, but shorter after a failed step
. -ts_max_steps <n>  - number of steps
- -snes_type <latin> - solver of a step; latin extrapolates its initial state from the last steps

  Level: beginner

  Notes:
  Attach the structure with `LatinStructureAttachTS()`; set displacements and velocities with `TS2SetSolution()` (default: at
  rest). The scheme is of first order: it damps vibrations faster than a step, and allows velocity jumps. Steps of the same length reuse
  all operators and factors. A structure with masses needs no supports, and every step has a solution if all nodes have masses:
  SNES latin has no divergence tolerance unless the program or an option sets one.

  `TSSetEventHandler()` repeats steps with another length, for which PETSc does not call the function of `TSSetPreStep()`: give loads
  and supports that change in one of `TSSetPreStage()`. Before another motion with the same TS call `TSReset()`.

  Large displacements of elastic links (`LATIN_GEOMETRY_LARGE`): the scheme is the implicit midpoint rule with mean forces, of second
  order, which conserves energy and momenta. Each step starts from the last velocity, whatever `SNESLatinSetWarmStart()` says, and is
  solved to an error of 1e-8 unless `SNESLatinSetError()` is called.

.seealso: `LatinStructureSetMass()`, `SNESLATIN`
M*/
PETSC_EXTERN PetscErrorCode TSCreate_Latin(TS ts)
{
  TS_Latin *data;

  PetscFunctionBegin;
  PetscCall(PetscNew(&data));
  ts->data                = (void *)data;
  ts->ops->setup          = TSSetUp_Latin_Watched;
  ts->ops->step           = TSStep_Latin_Watched;
  ts->ops->interpolate    = TSInterpolate_Latin;
  ts->ops->rollback       = TSRollBack_Latin;
  ts->ops->reset          = TSReset_Latin;
  ts->ops->destroy        = TSDestroy_Latin;
  ts->ops->setfromoptions = TSSetFromOptions_Latin;
  ts->ops->view           = TSView_Latin;
  ts->usessnes            = PETSC_TRUE;
  ts->default_adapt_type  = TSADAPTNONE;
  if (ts->exact_final_time == TS_EXACTFINALTIME_UNSPECIFIED) ts->exact_final_time = TS_EXACTFINALTIME_MATCHSTEP;
  PetscFunctionReturn(0);
}
