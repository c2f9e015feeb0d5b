#include "sneslatinimpl.h"
#include <petsc/private/snesimpl.h>
#include <petscdmshell.h>

/*
   SNES latin: its options, its set-up, and a solve from the state that it starts from to what ends it: the iteration
   (fixedpoint.c), or Newton's method after it (polish.c, rescue.c). No mathematics of the method here: see latin.c and
   the stages that it calls.
*/

#define LATIN_HISTORY       1000000 /* linear stages whose indicator and errors are kept */
#define LATIN_RESCUE_STAGES 300     /* linear stages still to come that call for a rescue, unless an option says otherwise */
#define LATIN_DIGITS_SAFETY 2.0     /* on errors that are known to their order of magnitude */

static const char citation[] = "@article{AlartDureisseix2008,\n"
                               "  author  = {Pierre Alart and David Dureisseix},\n"
                               "  title   = {A scalable multiscale {LATIN} method adapted to nonsmooth discrete media},\n"
                               "  journal = {Computer Methods in Applied Mechanics and Engineering},\n"
                               "  volume  = {197},\n"
                               "  number  = {5},\n"
                               "  pages   = {319--331},\n"
                               "  year    = {2008},\n"
                               "  doi     = {10.1016/j.cma.2007.05.002}\n"
                               "}\n";
static PetscBool  cited      = PETSC_FALSE;

static PetscErrorCode SNESLatinMonitor_Private(SNES snes, PetscInt it, PetscReal norm, void *ctx)
{
  SNES_Latin *data   = (SNES_Latin *)snes->data;
  PetscViewer viewer = data->monitor;

  PetscFunctionBegin;
  (void)norm;
  (void)ctx;
  PetscCall(PetscViewerPushFormat(viewer, data->monitor_format));
  PetscCall(PetscViewerASCIIAddTab(viewer, ((PetscObject)snes)->tablevel));
  PetscCall(PetscViewerASCIIPrintf(viewer, "%3" PetscInt_FMT " LATIN indicator %12.6e", it, (double)data->latin->indicator));
  PetscCall(PetscViewerASCIIUseTabs(viewer, PETSC_FALSE));
  if (data->stop == LATIN_STOP_RESIDUAL) PetscCall(PetscViewerASCIIPrintf(viewer, "  residual %12.6e", (double)data->residual));
  if (data->stop == LATIN_STOP_ERROR) PetscCall(PetscViewerASCIIPrintf(viewer, "  estimated error %s %12.6e", LatinErrorNorms[data->estimate.energy], (double)data->estimate.value));
  if (data->reference && data->done) PetscCall(PetscViewerASCIIPrintf(viewer, "  error l2 %12.6e  energy %12.6e", (double)data->error_l2[data->done - 1], (double)data->error_energy[data->done - 1]));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscCall(PetscViewerASCIIUseTabs(viewer, PETSC_TRUE));
  PetscCall(PetscViewerASCIISubtractTab(viewer, ((PetscObject)snes)->tablevel));
  PetscCall(PetscViewerPopFormat(viewer));
  PetscFunctionReturn(0);
}

/* The structure of a SNES: attached, or behind its DM; NULL if there is none */
PetscErrorCode SNESLatinFindLinks_Private(SNES snes, LatinLinks *links)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)snes, "LatinLinks", (PetscObject *)links));
  if (!*links) PetscCall(LatinLinksFromDM_Private(snes->dm, links));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESSetFromOptions_Latin(SNES snes, LatinOptionItems PetscOptionsObject)
{
  SNES_Latin    *data = (SNES_Latin *)snes->data;
  const char    *prefix;
  PetscBool      set;
  LatinErrorNorm norm;

  PetscFunctionBegin;
  PetscCall(LatinSetFromOptions_Private(data->latin, PetscOptionsObject, "snes"));
  PetscOptionsHeadBegin(PetscOptionsObject, "SNES latin options");
  PetscCall(PetscOptionsEnum("-snes_latin_stop", "Stop on the LATIN indicator (-snes_stol), the residual (-snes_rtol, -snes_atol), the error against a reference (-snes_stol) or the estimated error (-snes_latin_error)", "LatinStopType",
                             LatinStopTypes, (PetscEnum)data->stop, (PetscEnum *)&data->stop, NULL));
  PetscCall(PetscOptionsReal("-snes_latin_error", "Estimated relative error of the displacements to stop at, with -snes_latin_stop error", "None", data->target, &data->target, &set));
  PetscCheck(!set || data->stop == LATIN_STOP_ERROR, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "-snes_latin_error is the target of -snes_latin_stop error, but the stop is %s: add -snes_latin_stop error",
             LatinStopTypes[data->stop]);
  PetscCheck(data->target > 0.0 && data->target < 1.0, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE, "-snes_latin_error is a relative error between 0 and 1, for example 1e-4, not %g", (double)data->target);
  norm = data->estimate.energy ? LATIN_NORM_ENERGY : LATIN_NORM_L2;
  PetscCall(PetscOptionsEnum("-snes_latin_error_norm", "Norm of that error", "LatinErrorNorm", LatinErrorNorms, (PetscEnum)norm, (PetscEnum *)&norm, &set));
  PetscCheck(!set || data->stop == LATIN_STOP_ERROR, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "-snes_latin_error_norm is the norm of -snes_latin_stop error, but the stop is %s: add -snes_latin_stop error",
             LatinStopTypes[data->stop]);
  data->estimate.energy = (PetscBool)(norm == LATIN_NORM_ENERGY);
  PetscCall(PetscOptionsBool("-snes_latin_warm_start", "Start from the state of the last solve on this object", "None", data->warm, &data->warm, NULL));
  PetscCall(PetscOptionsBool("-snes_latin_warm_extrapolate", "A warm start goes on as the last two solves did: for loads that grow in equal steps", "None", data->extrapolate, &data->extrapolate, &set));
  PetscCheck(!set || !data->extrapolate || data->warm, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "-snes_latin_warm_extrapolate is about warm starts: add -snes_latin_warm_start");
  PetscCall(PetscOptionsBool("-snes_latin_polish", "End by Newton's method, preconditioned by the same operators", "None", data->polish.on, &data->polish.on, NULL));
  PetscCall(PetscOptionsReal("-snes_latin_polish_start", "Indicator from which on Newton's method takes over", "None", data->polish.start, &data->polish.start, &set));
  PetscCheck(!set || data->polish.on, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "-snes_latin_polish_start tells when the polish begins: add -snes_latin_polish");
  PetscCall(PetscOptionsBoundedInt("-snes_latin_rescue", "Linear stages still to come from which on Newton's method takes over, 0 = never", "None", data->rescue.stages, &data->rescue.stages, NULL, 0));
  PetscCall(PetscOptionsBool("-snes_latin_balance", "Where contacts with friction stall, or rigid links beside elastic ones, change their search parameter", "None", data->balance.on, &data->balance.on, NULL));
  PetscCall(PetscOptionsViewer("-snes_latin_monitor", "Monitor the indicator, and the residual or errors where they are computed", "None", &data->monitor, &data->monitor_format, &set));
  PetscOptionsHeadEnd();
  PetscCheck(data->polish.start > 0.0 && !PetscIsInfOrNanReal(data->polish.start), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE, "-snes_latin_polish_start is %g; it is a positive number", (double)data->polish.start);
  if (set && data->monitor) PetscCall(SNESMonitorSet(snes, SNESLatinMonitor_Private, NULL, NULL));
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(PetscObjectSetOptions((PetscObject)data->latin, ((PetscObject)snes)->options));
  PetscCall(PetscObjectSetOptionsPrefix((PetscObject)data->latin, prefix));
  PetscCall(PetscObjectAppendOptionsPrefix((PetscObject)data->latin, "snes_latin_"));
  if (data->outer) PetscCall(SNESLatinOuterOptions_Private(snes));
  else PetscCall(SNESLatinCreateOuter_Private(snes));
  if (data->polish.on) PetscCall(LatinPolishCreate_Private(snes, data->latin, &data->polish));
  PetscFunctionReturn(0);
}

/* The inner SNES goes too: not every type survives a SNESReset() (qn does not), and its options are read again */
static PetscErrorCode SNESLatinResetState_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESDestroy(&data->outer));
  PetscCall(SNESDestroy(&data->polish.newton));
  PetscCall(SNESDestroy(&data->rescue.newton.newton));
  data->polish.links = data->rescue.newton.links = NULL;
  PetscCall(VecDestroy(&data->z));
  PetscCall(VecDestroy(&data->z_before));
  data->has_before = PETSC_FALSE;
  PetscCall(PetscFree(data->reference_copy));
  data->has_state = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Builds what has changed in the structure, and the fixed-point unknown when its length has */
static PetscErrorCode SNESLatinSetUpState_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;
  PetscBool   built = latin->set_up;
  DM          shell;
  Vec         F;

  PetscFunctionBegin;
  if (built) { /* new laws or a new partition take everything down */
    PetscObjectState state;

    PetscCall(PetscObjectStateGet((PetscObject)latin->links, &state));
    built = (PetscBool)(state == latin->links_state && !latin->stale);
  }
  if (!built && data->z) PetscCall(SNESLatinResetState_Private(snes));
  if (!data->z && data->outer_rigid != (latin->links->rigid_law >= 0)) PetscCall(SNESDestroy(&data->outer)); /* made before the structure was known */
  PetscCall(SNESLatinCreateOuter_Private(snes));
  PetscCall(LatinSetUp_Private(latin));
  if (!data->z) {
    PetscCall(LatinCreateState_Private(latin, &data->z));
    PetscCall(DMShellCreate(PetscObjectComm((PetscObject)snes), &shell)); /* where the inner SNES gets its work vectors from */
    PetscCall(DMShellSetGlobalVector(shell, data->z));
    PetscCall(SNESSetDM(data->outer, shell));
    PetscCall(DMDestroy(&shell));
    PetscCall(VecDuplicate(data->z, &F));
    PetscCall(SNESSetFunction(data->outer, F, SNESLatinFixedPoint_Private, snes));
    PetscCall(VecDestroy(&F));
    PetscCall(SNESSetUp(data->outer));
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESSetUp_Latin(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  LatinLinks  links;

  PetscFunctionBegin;
  PetscCall(SNESLatinFindLinks_Private(snes, &links));
  PetscCheck(links, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER,
             "-snes_type latin has no structure to work on: build one with LatinLinksCreate() and give it to this SNES with LatinLinksAttachSNES() (in Python, latinpc.Links(...).attach(snes))");
  PetscCall(LatinSetLinks_Private(data->latin, links));
  if (!((PetscObject)data->latin)->prefix) {
    const char *prefix;

    PetscCall(SNESGetOptionsPrefix(snes, &prefix));
    PetscCall(PetscObjectSetOptionsPrefix((PetscObject)data->latin, prefix));
    PetscCall(PetscObjectAppendOptionsPrefix((PetscObject)data->latin, "snes_latin_"));
  }
  PetscCall(SNESLatinCreateOuter_Private(snes));
  PetscCall(SNESLatinSetUpState_Private(snes));
  PetscFunctionReturn(0);
}

/* Room for the history, and the reference brought to the subdomains: nothing is allocated inside the iteration */
static PetscErrorCode SNESLatinPrepare_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  PetscCheck(!PetscIsInfOrNanReal(snes->stol) && !PetscIsInfOrNanReal(snes->rtol) && !PetscIsInfOrNanReal(snes->abstol) && !PetscIsNanReal(snes->divtol), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE,
             "A tolerance is not a finite number: stol %g, rtol %g, atol %g, divergence tolerance %g; give others with -snes_stol and so on, or SNESSetTolerances()", (double)snes->stol, (double)snes->rtol, (double)snes->abstol, (double)snes->divtol);
  PetscCheck(data->stop != LATIN_STOP_ERROR || latin->links->rigid_law < 0 || LatinByPrecision(PETSC_TRUE, PETSC_FALSE), PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP,
             "-snes_latin_stop error does not know the error of structures with links of the rigid law %s in single precision: take the stop indicator (-snes_stol), or a PETSc in double precision", LatinLaws[latin->links->rigid_law].name);
  if (data->history_size < PetscMin(snes->max_its, LATIN_HISTORY)) {
    PetscCall(PetscFree4(data->indicator, data->error_l2, data->error_energy, data->estimates));
    data->history_size = PetscMin(snes->max_its, LATIN_HISTORY);
    PetscCall(PetscMalloc4(data->history_size, &data->indicator, data->history_size, &data->error_l2, data->history_size, &data->error_energy, data->history_size, &data->estimates));
  }
  if (data->polish.on) PetscCall(LatinLinksCheckRigid_Private(latin->links, "The polish of SNES latin, which is Newton's method,"));
  PetscCheck(data->stop != LATIN_STOP_REFERENCE || data->reference, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "-snes_latin_stop reference needs a displacement to compare with: call SNESLatinSetReference()");
  if (data->reference) {
    PetscInt n, m;

    PetscCall(VecGetSize(data->reference, &n));
    PetscCall(VecGetSize(latin->links->load, &m));
    PetscCheck(n == m, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_SIZ, "The reference has %" PetscInt_FMT " entries, the structure %" PetscInt_FMT " free degrees of freedom", n, m);
    PetscCall(LatinLinksCheckVec_Private(latin->links, data->reference));
    if (!data->reference_copy) PetscCall(PetscMalloc1(latin->links->dim * latin->sub.copies, &data->reference_copy));
    PetscCall(PetscArraycpy(data->reference_copy, latin->sub.prescribed, latin->links->dim * latin->sub.copies));
    PetscCall(LatinDistribute_Private(latin, data->reference, data->reference_copy));
  }
  if (data->stop == LATIN_STOP_ERROR) PetscCall(LatinEstimateStart_Private(&data->estimate));
  data->done = data->tested = latin->applications = 0;
  data->first_distance                            = -1.0;
  PetscFunctionReturn(0);
}

/* The state to start from: the prestressed configuration, that of the last solve, or one step further in the same direction */
static PetscErrorCode SNESLatinStart_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   further;

  PetscFunctionBegin;
  if (!data->warm || !data->has_state) {
    PetscCall(LatinInitialState_Private(data->latin, data->z));
    data->has_before = PETSC_FALSE;
    PetscFunctionReturn(0);
  }
  if (!data->extrapolate) PetscFunctionReturn(0);
  further = data->has_before;
  if (!data->z_before) PetscCall(VecDuplicate(data->z, &data->z_before));
  if (further) { /* 2 z - z_before, and z_before takes the place of z */
    PetscCall(VecAYPX(data->z_before, -1.0, data->z));
    PetscCall(VecAXPY(data->z, 1.0, data->z_before));
    PetscCall(VecAYPX(data->z_before, -1.0, data->z));
  } else PetscCall(VecCopy(data->z, data->z_before));
  data->has_before = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* An error asked for that may be below what rounding leaves: has Newton's method reached it, as far as this precision tells? */
static PetscErrorCode SNESLatinProveDigits_Private(SNES snes, const LatinPolish *polish)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscReal   unbalance, rounding;

  PetscFunctionBegin;
  PetscCall(LatinEstimateFloor_Private(data->latin, &data->estimate));
  if (data->estimate.floor <= data->target || data->estimate.energy) PetscFunctionReturn(0);
  PetscCall(LatinGetDigits(snes, &unbalance, &rounding, NULL, NULL));
  data->estimate.floor = LATIN_DIGITS_SAFETY * PetscMax(unbalance, rounding);
  snes->norm           = PetscMax(polish->error, data->estimate.floor);
  if (snes->norm <= data->target) PetscFunctionReturn(0);
  snes->reason = SNES_DIVERGED_INNER;
  PetscCall(PetscInfo(snes, "The error asked for, %g, is below what rounding leaves on this structure, about %g\n", (double)data->target, (double)snes->norm));
  PetscFunctionReturn(0);
}

/* F(x) = b: more load */
static PetscErrorCode SNESLatinLoad_Private(SNES snes)
{
  Latin latin = ((SNES_Latin *)snes->data)->latin;
  Vec   load;

  PetscFunctionBegin;
  if (!snes->vec_rhs) PetscFunctionReturn(0);
  PetscCall(VecDuplicate(latin->links->load, &load));
  PetscCall(VecWAXPY(load, 1.0, snes->vec_rhs, latin->links->load));
  PetscCall(LatinLinearSetLoads(latin, load));
  PetscCall(VecDestroy(&load));
  latin->load_state = -1;
  PetscFunctionReturn(0);
}

/* The iteration, from the state to start from */
static PetscErrorCode SNESLatinIterate_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESLatinStart_Private(snes));
  PetscCall(SNESSetConvergenceTest(data->outer, SNESLatinConverged_Private, snes, NULL));
  PetscCall(SNESSetTolerances(data->outer, 0.0, 0.0, 0.0, snes->max_its, PETSC_MAX_INT));
  PetscCall(SNESSolve(data->outer, NULL, data->z));
  PetscCall(SNESGetConvergedReason(data->outer, &snes->reason));
  PetscFunctionReturn(0);
}

/* Newton's method from here on; where it fails the iteration goes on from where it was */
static PetscErrorCode SNESLatinPolish_Private(SNES snes, LatinPolish *polish)
{
  SNES_Latin         *data = (SNES_Latin *)snes->data;
  SNESConvergedReason reason;
  PetscBool           balances = PETSC_TRUE;

  PetscFunctionBegin;
  polish->target    = data->stop == LATIN_STOP_ERROR ? data->target : snes->stol;
  polish->residual  = data->stop == LATIN_STOP_RESIDUAL ? PetscMax(snes->abstol, snes->rtol * data->first_residual) : 0.0;
  polish->reference = data->stop == LATIN_STOP_REFERENCE ? data->reference : NULL;
  if (data->stop == LATIN_STOP_RESIDUAL) polish->target = 0.0;
  if (PetscIsInfOrNanReal(data->latin->distance) || (snes->divtol > 0.0 && data->latin->distance > snes->divtol * data->first_distance)) PetscCall(VecZeroEntries(snes->vec_sol));
  else PetscCall(LatinAverage_Private(data->latin, snes->vec_sol));
  PetscCall(LatinPolishSolve_Private(snes, data->latin, polish, snes->vec_sol, &reason));
  if (polish->own) {
    PetscCall(LatinRescueLoose_Private(&data->rescue));
    if (data->rescue.loose) {
      snes->reason = SNES_DIVERGED_DTOL;
      PetscFunctionReturn(0);
    }
  }
  data->ended = polish;
  if (reason > 0) {
    snes->reason = reason;
    PetscCall(SNESComputeFunction(snes, snes->vec_sol, snes->vec_func));
    PetscCall(VecNorm(snes->vec_func, NORM_2, &data->residual));
    snes->iter = data->latin->applications + polish->stages;
    snes->norm = data->stop == LATIN_STOP_RESIDUAL ? data->residual : polish->error;
    PetscCall(LatinProofBalances_Private(data->latin->links, snes->vec_sol, snes->vec_rhs, snes->vec_func, &balances));
    if (!balances) snes->reason = SNES_DIVERGED_DTOL;
    if (polish->own && polish->still && polish->target > 0.0) { /* a search that stands still: at a solution, or where rounding hides the way on */
      LatinEstimate doubt = {.energy = data->estimate.energy};

      PetscCall(LatinEstimateDoubt_Private(data->latin, polish->target, snes->vec_sol, snes->vec_func, &doubt));
      if (doubt.value > polish->target) {
        snes->reason = SNES_DIVERGED_LINE_SEARCH;
        PetscCall(PetscInfo(snes, "The search of Newton's method stands still where the unbalance tells of an error of %g at least\n", (double)doubt.value));
      }
    }
    if (data->stop == LATIN_STOP_ERROR) PetscCall(SNESLatinProveDigits_Private(snes, polish));
    PetscCall(SNESLogConvergenceHistory(snes, snes->norm, polish->stages));
    PetscCall(SNESMonitor(snes, snes->iter, snes->norm));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscInfo(snes, "Newton's method ended with %s: back to the iteration\n", SNESConvergedReasons[reason]));
  data->ended         = NULL;
  data->latin->failed = PETSC_FALSE;
  data->handed        = PETSC_FALSE;
  polish->steps       = 0;
  PetscCall(SNESSolve(data->outer, NULL, data->z));
  PetscCall(SNESGetConvergedReason(data->outer, &snes->reason));
  if (polish->own && data->rescue.contrast && snes->reason > 0) {
    snes->reason = SNES_DIVERGED_INNER; /* what Newton's method was to confirm it has not */
    PetscCall(PetscInfo(snes, "Stiffnesses that differ so much leave the convergence of the iteration without proof\n"));
  }
  PetscFunctionReturn(0);
}

/* Contacts with friction have stalled: the iteration goes on with another search parameter */
static PetscErrorCode SNESLatinBalance_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  Vec         F;

  PetscFunctionBegin;
  PetscCall(SNESGetFunction(data->outer, &F, NULL, NULL));
  PetscCall(SNESLatinFixedPoint_Private(data->outer, data->z, F, snes)); /* the inner SNES may have been elsewhere */
  PetscCall(LatinBalanceChange_Private(data->latin, data->z, F, &data->balance));
  if (data->stop == LATIN_STOP_ERROR) PetscCall(LatinEstimateStart_Private(&data->estimate));
  data->has_before = PETSC_FALSE;
  PetscCall(SNESSolve(data->outer, NULL, data->z));
  PetscCall(SNESGetConvergedReason(data->outer, &snes->reason));
  PetscFunctionReturn(0);
}

/* Rigid links with another search parameter beside elastic ones: all is built again, and the solve starts anew */
static PetscErrorCode SNESLatinTune_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(LatinBalanceTune_Private(data->latin->links, data->balance.factor));
  data->balance.tuned++;
  PetscCall(SNESLatinSetUpState_Private(snes));
  PetscCall(SNESLatinLoad_Private(snes));
  if (data->stop == LATIN_STOP_ERROR) PetscCall(LatinEstimateStart_Private(&data->estimate));
  data->first_distance = -1.0;
  PetscCall(LatinBalanceStart_Private(data->latin, PETSC_FALSE, &data->balance));
  PetscCall(SNESLatinIterate_Private(snes));
  PetscFunctionReturn(0);
}

/* Some stages of the plain iteration tell which links are slack: then low-energy fields without them, and a new start */
static PetscErrorCode SNESLatinAdapt_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  Vec         F;

  PetscFunctionBegin;
  PetscCall(SNESGetFunction(data->outer, &F, NULL, NULL));
  PetscCall(LatinInitialState_Private(data->latin, data->z));
  for (PetscInt k = 0; k < PetscMin(data->latin->local_slack, snes->max_its - 1); k++) {
    PetscCall(SNESLatinFixedPoint_Private(data->outer, data->z, F, snes));
    PetscCall(VecAXPY(data->z, -1.0, F));
  }
  PetscCall(LatinFloppySlack(data->latin));
  PetscCall(LatinAdapt_Private(data->latin));
  if (data->stop == LATIN_STOP_ERROR) PetscCall(LatinEstimateStart_Private(&data->estimate));
  data->has_state = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* A solve that has not converged: what links tell of the cause */
static PetscErrorCode SNESLatinBlame_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscReal   size;
  Vec         F;

  PetscFunctionBegin;
  data->held.nodes = data->held.links = 0;
  if (snes->reason > 0 || snes->reason == SNES_DIVERGED_FUNCTION_NANORINF || data->latin->failed) PetscFunctionReturn(0);
  if (data->rescue.loose) {
    data->held.nodes = data->rescue.loose;
    data->held.way   = INFINITY;
    PetscCall(PetscArraycpy(data->held.node, data->rescue.node, LATIN_LOOSE));
  } else {
    PetscCall(LatinHeld_Private(data->latin->links, snes->vec_sol, snes->vec_func, &data->held));
    PetscCall(LatinLinksSize_Private(data->latin->links, &size));
    data->held.way = PetscMin(data->held.way, size); /* an iterate that diverges proves nothing */
    PetscCall(SNESGetFunction(data->outer, &F, NULL, NULL));
    PetscCall(LatinHeldJammed_Private(data->latin, data->z, F, &data->held));
    if (data->held.links) data->held.nodes = 0;
    if (data->held.hidden && !data->held.links) {
      snes->reason         = SNES_DIVERGED_INNER;
      data->estimate.floor = 1.0;
    }
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESSolve_Latin(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  PetscCheck(!snes->xl && !snes->xu && !snes->ops->computevariablebounds, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "SNES latin does not take bounds on the unknowns: unilateral behaviour is in the laws of the links");
  PetscCall(PetscCitationsRegister(citation, &cited));
  PetscCall(SNESLatinSetUpState_Private(snes)); /* the structure may have changed since SNESSetUp() */
  PetscCall(SNESLatinLoad_Private(snes));
  PetscCall(SNESLatinPrepare_Private(snes));
  snes->reason = SNES_CONVERGED_ITERATING;
  snes->iter   = 0;
  if (data->stop == LATIN_STOP_RESIDUAL) {
    if (latin->links->multiplier) PetscCall(PetscArrayzero(latin->links->multiplier, latin->links->links_local));
    PetscCall(VecZeroEntries(snes->vec_sol)); /* where the method starts, whatever the caller's vector holds */
    PetscCall(SNESComputeFunction(snes, snes->vec_sol, snes->vec_func));
    PetscCall(VecNorm(snes->vec_func, NORM_2, &data->first_residual));
    snes->norm = data->first_residual;
    PetscCall(SNESLogConvergenceHistory(snes, snes->norm, 0));
  }
  if (LatinFloppyWaits(latin)) PetscCall(SNESLatinAdapt_Private(snes));
  data->balance.tuned = 0;
  PetscCall(LatinBalanceStart_Private(latin, (PetscBool)(data->warm && data->has_state), &data->balance));
  data->handed   = data->polish.on;
  data->ended    = NULL;
  data->residual = 0.0;
  PetscCall(LatinRescueStart_Private(&data->rescue, latin->links));
  PetscCall(SNESLatinIterate_Private(snes));
  /* at most twice: a polish that fails may leave an iteration that stalls */
  while (snes->reason == SNES_CONVERGED_ITS) {
    if (data->balance.factor != 1.0 && !data->balance.able) PetscCall(SNESLatinTune_Private(snes));
    else if (data->balance.factor != 1.0) PetscCall(SNESLatinBalance_Private(snes));
    else PetscCall(SNESLatinPolish_Private(snes, data->rescue.called ? &data->rescue.newton : &data->polish));
  }
  data->has_state = (PetscBool)(snes->reason > 0);
  if (latin->failed) snes->reason = SNES_DIVERGED_LINEAR_SOLVE;
  snes->linear_its = data->ended ? data->ended->stages : 0;
  snes->iter       = latin->applications + snes->linear_its;
  if (!data->ended && !data->rescue.loose) {
    if (snes->alwayscomputesfinalresidual || data->stop == LATIN_STOP_RESIDUAL || (snes->reason < 0 && !latin->failed)) PetscCall(SNESLatinResidual_Private(snes));
    else {
      PetscCall(LatinAverage_Private(latin, snes->vec_sol));
      PetscCall(LatinSubstructureReturn_Private(latin));
    }
  }
  if (PetscIsInfOrNanReal(data->residual)) snes->reason = SNES_DIVERGED_FUNCTION_NANORINF;
  PetscCall(SNESLatinBlame_Private(snes));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESSetUp_Latin_Watched(SNES snes)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)snes), SNESSetUp_Latin(snes));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESSolve_Latin_Watched(SNES snes)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)snes), SNESSolve_Latin(snes));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESReset_Latin(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  if (data->latin) PetscCall(LatinReset_Private(data->latin));
  PetscCall(SNESLatinResetState_Private(snes));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESDestroy_Latin(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESReset_Latin(snes));
  PetscCall(LatinDestroy_Private(&data->latin));
  PetscCall(SNESDestroy(&data->outer));
  PetscCall(VecDestroy(&data->reference));
  PetscCall(LatinEstimateDestroy_Private(&data->estimate));
  PetscCall(LatinBalanceDestroy_Private(&data->balance));
  PetscCall(PetscViewerDestroy(&data->monitor));
  PetscCall(PetscFree4(data->indicator, data->error_l2, data->error_energy, data->estimates));
  PetscCall(PetscFree(snes->data));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESView_Latin(SNES snes, PetscViewer viewer)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "stop on the %s\n", LatinStopTypes[data->stop]));
  if (data->stop == LATIN_STOP_ERROR) PetscCall(PetscViewerASCIIPrintf(viewer, "estimated error below %g in the norm %s\n", (double)data->target, LatinErrorNorms[data->estimate.energy]));
  if (data->warm) PetscCall(PetscViewerASCIIPrintf(viewer, "starts from the state of the last solve%s\n", data->extrapolate ? ", and goes on as the last two did" : ""));
  if (!data->rescue.stages) PetscCall(PetscViewerASCIIPrintf(viewer, "no rescue by Newton's method\n"));
  else if (data->rescue.stages != LATIN_RESCUE_STAGES) PetscCall(PetscViewerASCIIPrintf(viewer, "rescue by Newton's method from %" PetscInt_FMT " linear stages still to come on\n", data->rescue.stages));
  if (!data->balance.on) PetscCall(PetscViewerASCIIPrintf(viewer, "contacts that stall keep their search parameter\n"));
  if (data->done) PetscCall(PetscViewerASCIIPrintf(viewer, "last solve: %" PetscInt_FMT " linear stages, indicator %g, norm of the nodal unbalance %g\n", data->latin->applications, (double)data->indicator[data->done - 1], (double)data->residual));
  PetscCall(LatinView_Private(data->latin, viewer));
  if (data->outer) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "fixed-point solver:\n"));
    PetscCall(PetscViewerASCIIPushTab(viewer));
    PetscCall(SNESView(data->outer, viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  }
  if (data->rescue.called && data->rescue.newton.newton) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "the iteration stalled: rescue by Newton's method, %" PetscInt_FMT " steps and %" PetscInt_FMT " linear stages:\n", data->rescue.newton.steps, data->rescue.newton.stages));
    PetscCall(PetscViewerASCIIPushTab(viewer));
    PetscCall(SNESView(data->rescue.newton.newton, viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  }
  if (data->polish.on && data->polish.newton) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "polish from indicator %g on, last solve %" PetscInt_FMT " steps and %" PetscInt_FMT " linear stages:\n", (double)data->polish.start, data->polish.steps, data->polish.stages));
    PetscCall(PetscViewerASCIIPushTab(viewer));
    PetscCall(SNESView(data->polish.newton, viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  }
  PetscFunctionReturn(0);
}

/*MC
  SNESLATIN - the scalable multiscale LATIN domain decomposition method for structures of links, of which some are
  unilateral (cables that slacken, struts that lift off)

  Options Database Keys:
+ -snes_latin_variant <none,macro,corner>           - coarse treatment of weak interfaces
. -snes_latin_subdomains <n>                        - number of subdomains
. -snes_latin_modes_local <0>                       - local low-energy fields of floppy subdomains, eigenvalues below this
. -snes_latin_direction <scalar,diagonal>           - micro search direction
. -snes_latin_stop <indicator,residual,reference,error> - what is watched for convergence
. -snes_latin_error <1e-4>                          - estimated error to stop at
. -snes_latin_monitor                               - prints the indicator of each iteration
. -snes_latin_outer_snes_type <anderson,nrichardson> - acceleration, or the plain iteration
. -snes_latin_polish                                - ends by Newton's method, prefix -snes_latin_polish_
. -snes_latin_rescue <300>                           - Newton's method takes over where so many linear stages are still to come
. -snes_latin_balance                               - changes the search parameter of rigid links that stall
. -snes_latin_local_                                - prefix of the KSP of the subdomains
- -snes_latin_coarse_                               - prefix of the KSP of the coarse problem

  Level: beginner

  Notes:
  The structure comes from `LatinLinksAttachSNES()`. The iteration number counts linear stages. The initial guess is
  the prestressed configuration; the entries of the solution vector do not matter before the solve.

.seealso: `LatinLinksCreate()`, `LatinLinksAttachSNES()`, `PCLATIN`
M*/
PETSC_EXTERN PetscErrorCode SNESCreate_Latin(SNES snes)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(PetscNew(&data));
  snes->data                = (void *)data;
  snes->ops->setup          = SNESSetUp_Latin_Watched;
  snes->ops->solve          = SNESSolve_Latin_Watched;
  snes->ops->reset          = SNESReset_Latin;
  snes->ops->destroy        = SNESDestroy_Latin;
  snes->ops->setfromoptions = SNESSetFromOptions_Latin;
  snes->ops->view           = SNESView_Latin;
  snes->usesksp             = PETSC_FALSE;
  snes->usesnpc             = PETSC_FALSE;

  data->target = 1e-4;

  snes->alwayscomputesfinalresidual = PETSC_FALSE; /* a pass over the links; SNESSetAlwaysComputesFinalResidual() asks for it */
  PetscObjectParameterSetDefault(snes, max_its, 1000);
  PetscObjectParameterSetDefault(snes, stol, 1e-5);
  data->polish.start      = 1e-4;
  data->rescue.stages     = LATIN_RESCUE_STAGES;
  data->rescue.newton.own = PETSC_TRUE;
  data->balance.on        = PETSC_TRUE;
  data->balance.factor    = 1.0;
  PetscCall(LatinCreate_Private(PetscObjectComm((PetscObject)snes), &data->latin));
  PetscFunctionReturn(0);
}
