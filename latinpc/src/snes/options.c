#include "snes/sneslatinimpl.h"

/* Options of SNES latin, which call its setters */

/* Refuses an option that was set but is not used by this stop. Collective on snes */
static PetscErrorCode SNESLatinBelongs_Private(SNES snes, PetscBool set, const char option[], LatinStopType stop)
{
  PetscFunctionBegin;
  PetscCheck(!set || stop >= LATIN_STOP_ERROR, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "%s belongs to -snes_latin_stop error or energy, but the stop is %s: add -snes_latin_stop error", option, LatinStopTypes[stop]);
  PetscFunctionReturn(0);
}

/* Refuses it also if a step tolerance decides instead of auto. Collective on snes */
static PetscErrorCode SNESLatinTested_Private(SNES snes, PetscBool set, const char option[], LatinStopType stop)
{
  const SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESLatinBelongs_Private(snes, set, option, stop));
  PetscCheck(!set || data->requested != LATIN_STOP_AUTO || !SNESLatinStolGiven(snes), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE,
             "%s has no effect with a step tolerance (-snes_stol), which is then the only stop: leave out one of them, or add -snes_latin_error", option);
  PetscFunctionReturn(0);
}

PetscErrorCode SNESSetFromOptions_Latin(SNES snes, LatinOptionItems PetscOptionsObject)
{
  SNES_Latin       *data   = (SNES_Latin *)snes->data;
  LatinStopType     stop   = data->requested;
  LatinWarmStart    warm   = data->warm;
  LatinNewtonType   newton = data->newton.type;
  PetscReal         error = data->target, balance = data->balance;
  PetscBool         set;
  PetscViewer       viewer;
  PetscViewerFormat format;

  PetscFunctionBegin;
  PetscCall(LatinSetFromOptions_Private(data->latin, (PetscObject)snes));
  PetscOptionsHeadBegin(PetscOptionsObject, "SNES latin options");
  PetscCall(PetscOptionsEnum(
    "-snes_latin_stop",
    "Stop on the LATIN indicator (-snes_stol), the residual (-snes_rtol, -snes_atol), the error against a reference (-snes_stol), or the estimated error of the displacements or of the energy (-snes_latin_error); auto: the error and balance, or the indicator if -snes_stol is given",
    "SNESLatinSetStop", LatinStopTypes, (PetscEnum)stop, (PetscEnum *)&stop, NULL));
  PetscCall(SNESLatinSetStop(snes, stop));
  PetscCall(PetscOptionsHasName(((PetscObject)snes)->options, ((PetscObject)snes)->prefix, "-snes_stol", &data->given));
  PetscCall(PetscOptionsReal("-snes_latin_error", "Estimated relative error to stop at, with -snes_latin_stop auto, error or energy", "SNESLatinSetError", error, &error, &set));
  PetscCall(SNESLatinBelongs_Private(snes, set, "-snes_latin_error", stop));
  if (set) PetscCall(SNESLatinSetError(snes, error));
  PetscCall(PetscOptionsReal("-snes_latin_tension_error", "Estimated relative error of the tensions to stop at; by default that of the displacements", "SNESLatinSetTensionError", SNESLatinTensionTarget(data), &error, &set));
  PetscCall(SNESLatinTested_Private(snes, set, "-snes_latin_tension_error", stop));
  if (set) PetscCall(SNESLatinSetTensionError(snes, error));
  PetscCall(PetscOptionsReal("-snes_latin_balance", "Unbalanced forces to stop at, relative to the loads, with -snes_latin_stop auto, error or energy", "SNESLatinSetBalance", balance, &balance, &set));
  PetscCall(SNESLatinTested_Private(snes, set, "-snes_latin_balance", stop));
  PetscCall(SNESLatinSetBalance(snes, balance));
  PetscCall(PetscOptionsReal("-snes_latin_largest_unbalance", "Unbalanced force on a node to stop at, with -snes_latin_stop auto, error or energy; 0: any", "SNESLatinSetLargestUnbalance", data->unbalance, &error, &set));
  if (set) PetscCall(SNESLatinSetLargestUnbalance(snes, error));
  PetscCall(PetscOptionsEnum("-snes_latin_geometry", "Rotation of links: none (linear), small angles with the tensions as drawn (prestress), any (large); of the structure, for all its solvers", "LatinStructureSetGeometry", LatinGeometries,
                             (PetscEnum)data->large.geometry, (PetscEnum *)&data->large.geometry, &set));
  if (set) data->large.given = PETSC_TRUE;
  PetscCall(PetscOptionsEnum("-snes_latin_warm_start", "Start from the state of the last solve on this object, or extrapolate from the last two", "SNESLatinSetWarmStart", LatinWarmStarts, (PetscEnum)warm, (PetscEnum *)&warm, &set));
  if (set) PetscCall(SNESLatinSetWarmStart(snes, warm));
  PetscCall(PetscOptionsEnum("-snes_latin_newton", "Newton's method on stagnation and to prove an error (auto), or never", "SNESLatinSetNewton", LatinNewtonTypes, (PetscEnum)newton, (PetscEnum *)&newton, NULL));
  PetscCall(SNESLatinSetNewton(snes, newton));
  PetscCall(PetscOptionsViewer("-snes_latin_monitor", "Monitor the indicator, and the residual or errors if computed", "None", &viewer, &format, &set));
  PetscOptionsHeadEnd();
  if (set) {
    PetscCall(PetscViewerDestroy(&data->monitor));
    data->monitor        = viewer;
    data->monitor_format = format;
  }
  if (data->outer) PetscCall(SNESLatinOuterOptions_Private(snes));
  else PetscCall(SNESLatinCreateOuter_Private(snes));
  PetscCall(SNESDestroy(&data->newton.snes)); /* recreated with the current options and prefix */
  PetscFunctionReturn(0);
}
