#include "snes/sneslatinimpl.h"

/* Settings of SNES latin: setters and getters */

const char *const LatinStopTypes[]   = {"indicator", "residual", "reference", "error", "energy", "auto", "LatinStopType", "LATIN_STOP_", NULL};
const char *const LatinWarmStarts[]  = {"none", "last", "extrapolate", "LatinWarmStart", "LATIN_WARM_START_", NULL};
const char *const LatinNewtonTypes[] = {"auto", "never", "LatinNewtonType", "LATIN_NEWTON_", NULL};

PetscErrorCode SNESLatinCheck_Private(SNES snes)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 1);
  PetscCall(LatinCheckType_Private((PetscObject)snes));
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetStop - Sets the convergence criterion.

  Logically collective on snes

  Input Parameters:
+ snes - of type latin
- stop - `LATIN_STOP_INDICATOR`: the relative distance of the two stages of an iteration is below the step tolerance of
         `SNESSetTolerances()`, and the unbalance shows no error of ten times that; `LATIN_STOP_RESIDUAL`: the nodal unbalance is
         below the relative or absolute tolerance, and rigid links meet their gaps;
         `LATIN_STOP_REFERENCE`: the error relative to `SNESLatinSetReference()` is below the step tolerance;
         `LATIN_STOP_ERROR`, `LATIN_STOP_ENERGY`: the estimated error of the displacements, in the l2 norm or in the energy
         norm, is below that of `SNESLatinSetError()`; `LATIN_STOP_AUTO`, the default: `LATIN_STOP_ERROR`, or
         `LATIN_STOP_INDICATOR` if a step tolerance other than the default is given, for bars alone in one coarse problem,
         and for rigid links in single precision

  Options Database Key:
. -snes_latin_stop <indicator,residual,reference,error,energy,auto> - the stop

  Level: beginner

  Note:
  A test given to `SNESSetConvergenceTest()` replaces all of them.

.seealso: `SNESLATIN`, `SNESLatinSetError()`, `SNESLatinSetReference()`, `SNESLatinGetStop()`
@*/
PetscErrorCode SNESLatinSetStop(SNES snes, LatinStopType stop)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscCall(LatinCheckChoice_Private((PetscObject)snes, LatinStopTypes, (int)stop));
  data                  = (SNES_Latin *)snes->data;
  data->requested       = stop;
  data->stop            = stop == LATIN_STOP_AUTO ? LATIN_STOP_ERROR : stop;
  data->estimate.energy = (PetscBool)(stop == LATIN_STOP_ENERGY);
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetStop - Gets the convergence criterion.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. stop - as set, `LATIN_STOP_AUTO` by default; after `SNESLatinSetError()` `LATIN_STOP_ERROR` in its place

  Level: beginner

.seealso: `SNESLATIN`, `SNESLatinSetStop()`
@*/
PetscErrorCode SNESLatinGetStop(SNES snes, LatinStopType *stop)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(stop, 2);
  *stop = ((SNES_Latin *)snes->data)->requested;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetError - Sets the estimated error to stop at with `LATIN_STOP_ERROR` or `LATIN_STOP_ENERGY`.

  Logically collective on snes

  Input Parameters:
+ snes  - of type latin
- error - relative error of the displacements, between 0 and 1

  Options Database Key:
. -snes_latin_error <1e-4> - the error

  Level: beginner

.seealso: `SNESLATIN`, `SNESLatinSetStop()`, `SNESLatinGetEstimates()`, `SNESLatinGetError()`
@*/
PetscErrorCode SNESLatinSetError(SNES snes, PetscReal error)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscValidLogicalCollectiveReal(snes, error, 2);
  PetscCheck(error > 0.0 && error < 1.0, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE, "-snes_latin_error is a relative error between 0 and 1, for example 1e-4, not %g", (double)error);
  data = (SNES_Latin *)snes->data;
  if (data->requested == LATIN_STOP_AUTO) PetscCall(SNESLatinSetStop(snes, LATIN_STOP_ERROR)); /* also with a step tolerance */
  data->target = error;
  data->chosen = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetError - Gets the estimated error to stop at with `LATIN_STOP_ERROR` or `LATIN_STOP_ENERGY`.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. error - relative error of the displacements, 1e-4 by default, 1e-8 in motions with large displacements

  Level: beginner

.seealso: `SNESLATIN`, `SNESLatinSetError()`, `SNESLatinGetEstimates()`
@*/
PetscErrorCode SNESLatinGetError(SNES snes, PetscReal *error)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(error, 2);
  *error = ((SNES_Latin *)snes->data)->target;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetTensionError - Sets the estimated error of the tensions to stop at with `LATIN_STOP_ERROR` or `LATIN_STOP_ENERGY`, in addition to that of the displacements.

  Logically collective on snes

  Input Parameters:
+ snes  - of type latin
- error - relative error of the tensions, l2 norm over all links, positive; `PETSC_DEFAULT`: that of the displacements. 1e30: any

  Options Database Key:
. -snes_latin_tension_error <1e-4> - the error

  Level: intermediate

  Note:
  Applies under the conditions of `SNESLatinSetBalance()`, and so not in the time steps of a motion.

.seealso: `SNESLATIN`, `SNESLatinSetError()`, `SNESLatinGetTensionEstimate()`, `SNESLatinGetTensionError()`
@*/
PetscErrorCode SNESLatinSetTensionError(SNES snes, PetscReal error)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscValidLogicalCollectiveReal(snes, error, 2);
  PetscCheck((error > 0.0 && !PetscIsInfOrNanReal(error)) || error == (PetscReal)PETSC_DEFAULT, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE,
             "-snes_latin_tension_error is a relative error, positive and finite, for example 1e-3, not %g", (double)error);
  ((SNES_Latin *)snes->data)->tension_target = error;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetTensionError - Gets the estimated error of the tensions to stop at.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. error - relative error of the tensions, by default that of `SNESLatinGetError()`

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinSetTensionError()`, `SNESLatinGetTensionEstimate()`
@*/
PetscErrorCode SNESLatinGetTensionError(SNES snes, PetscReal *error)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(error, 2);
  *error = SNESLatinTensionTarget((SNES_Latin *)snes->data);
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetBalance - Sets the largest unbalanced forces at convergence, in addition to the convergence criterion.

  Logically collective on snes

  Input Parameters:
+ snes    - of type latin
- balance - nodal unbalance relative to the loads, l2 norms; without loads relative to the tensions at the nodes. Positive; 1e30: any

  Options Database Key:
. -snes_latin_balance <1e-2> - the unbalance

  Level: intermediate

  Note:
  Applies to the stops auto, error and energy, and not to the time steps of a motion. With auto and a step tolerance the option is an
  error, and the value has no effect. An unbalance that is rounding is accepted.

.seealso: `SNESLATIN`, `SNESLatinSetStop()`, `SNESLatinSetError()`, `SNESLatinSetLargestUnbalance()`, `SNESLatinGetBalance()`
@*/
PetscErrorCode SNESLatinSetBalance(SNES snes, PetscReal balance)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscValidLogicalCollectiveReal(snes, balance, 2);
  PetscCheck(balance > 0.0 && !PetscIsInfOrNanReal(balance), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE, "-snes_latin_balance is the largest unbalance relative to the loads, positive and finite, for example 1e-2, not %g",
             (double)balance);
  ((SNES_Latin *)snes->data)->balance = balance;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetBalance - Gets the largest unbalanced forces at convergence.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. balance - nodal unbalance relative to the loads, 1e-2 by default

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinSetBalance()`, `LatinGetDigits()`
@*/
PetscErrorCode SNESLatinGetBalance(SNES snes, PetscReal *balance)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(balance, 2);
  *balance = ((SNES_Latin *)snes->data)->balance;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetLargestUnbalance - Sets the largest unbalanced force on a node at convergence, in addition to `SNESLatinSetBalance()`.

  Logically collective on snes

  Input Parameters:
+ snes  - of type latin
- force - bound on the unbalanced force of each node; 0: any

  Options Database Key:
. -snes_latin_largest_unbalance <0> - the force

  Level: intermediate

  Note:
  The bound is applied to the l2 norm over all nodes. An unbalance that is rounding is accepted. An error with other stops than auto, error
  and energy, with a step tolerance and auto, and in the time steps of motions: these do not test the balance.

.seealso: `SNESLATIN`, `SNESLatinSetBalance()`, `SNESLatinGetLargestUnbalance()`
@*/
PetscErrorCode SNESLatinSetLargestUnbalance(SNES snes, PetscReal force)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscValidLogicalCollectiveReal(snes, force, 2);
  PetscCheck(force >= 0.0 && !PetscIsInfOrNanReal(force), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE, "-snes_latin_largest_unbalance is the largest unbalanced force on a node, for example 1 (N), or 0 for any, not %g",
             (double)force);
  ((SNES_Latin *)snes->data)->unbalance = force;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetLargestUnbalance - Gets the largest unbalanced force on a node at convergence.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. force - bound on the unbalanced force of each node; 0, the default: any

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinSetLargestUnbalance()`
@*/
PetscErrorCode SNESLatinGetLargestUnbalance(SNES snes, PetscReal *force)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(force, 2);
  *force = ((SNES_Latin *)snes->data)->unbalance;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetNewton - Sets when Newton's method takes over from the iteration.

  Logically collective on snes

  Input Parameters:
+ snes - of type latin
- type - `LATIN_NEWTON_AUTO`: if the iteration stalls or diverges, if rounding ends it too early, and to prove an error
         (`LATIN_STOP_ERROR`, `LATIN_STOP_ENERGY`, or stiffnesses that differ by orders of magnitude); `LATIN_NEWTON_NEVER`

  Options Database Keys:
+ -snes_latin_newton <auto,never> - the choice
- -snes_latin_newton_             - prefix of its SNES

  Level: intermediate

  Note:
  If Newton's method fails, the iteration continues. The preconditioner is built from the operators of the iteration; after a stall and
  for structures of up to 3,000 unknowns from the tangent stiffness. Rigid links are treated by the method of multipliers, which
  proves no error. Contacts with friction have a nonsymmetric tangent stiffness: GMRES replaces CG.

.seealso: `SNESLATIN`, `SNESLatinGetNewton()`
@*/
PetscErrorCode SNESLatinSetNewton(SNES snes, LatinNewtonType type)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscCall(LatinCheckChoice_Private((PetscObject)snes, LatinNewtonTypes, (int)type));
  ((SNES_Latin *)snes->data)->newton.type = type;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetNewton - Gets when Newton's method takes over from the iteration.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. type - `LATIN_NEWTON_AUTO`, the default, or `LATIN_NEWTON_NEVER`

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinSetNewton()`
@*/
PetscErrorCode SNESLatinGetNewton(SNES snes, LatinNewtonType *type)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(type, 2);
  *type = ((SNES_Latin *)snes->data)->newton.type;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetReference - Sets reference displacements, relative to which the error of every iterate is computed.

  Collective on snes

  Input Parameters:
+ snes      - of type latin
- reference - a DM global vector, or NULL for none

  Level: intermediate

.seealso: `SNESLatinGetHistory()`, `SNESLatinSetStop()`, `SNESLatinGetReference()`
@*/
PetscErrorCode SNESLatinSetReference(SNES snes, Vec reference)
{
  const PetscBool given = (PetscBool)(reference != NULL);
  SNES_Latin     *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscValidLogicalCollectiveBool(snes, given, 2);
  if (given) PetscValidHeaderSpecific(reference, VEC_CLASSID, 2);
  data = (SNES_Latin *)snes->data;
  if (reference) PetscCall(PetscObjectReference((PetscObject)reference));
  PetscCall(VecDestroy(&data->reference));
  data->reference = reference;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetReference - Gets the reference displacements.

  Not collective; the reference is borrowed

  Input Parameter:
. snes - of type latin

  Output Parameter:
. reference - a DM global vector, or NULL, the default

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinSetReference()`
@*/
PetscErrorCode SNESLatinGetReference(SNES snes, Vec *reference)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(reference, 2);
  *reference = ((SNES_Latin *)snes->data)->reference;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetWarmStart - Sets the initial state of a solve after a converged solve with this SNES.

  Logically collective on snes

  Input Parameters:
+ snes - of type latin
- warm - `LATIN_WARM_START_NONE`: from the displacements in the solution vector; `LATIN_WARM_START_LAST`: from the state where the
         last solve converged, regardless of the solution vector; `LATIN_WARM_START_EXTRAPOLATE`: the states of the last two
         solves extrapolated, for loads that change in equal steps

  Options Database Key:
. -snes_latin_warm_start <none,last,extrapolate> - the choice

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinGetWarmStart()`
@*/
PetscErrorCode SNESLatinSetWarmStart(SNES snes, LatinWarmStart warm)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscCall(LatinCheckChoice_Private((PetscObject)snes, LatinWarmStarts, (int)warm));
  ((SNES_Latin *)snes->data)->warm        = warm;
  ((SNES_Latin *)snes->data)->warm_chosen = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetWarmStart - Gets the initial state of a solve after a converged one.

  Not collective

  Input Parameter:
. snes - of type latin

  Output Parameter:
. warm - as set; by default `LATIN_WARM_START_NONE`, in a TS of type latin `LATIN_WARM_START_EXTRAPOLATE`

  Level: intermediate

.seealso: `SNESLATIN`, `SNESLatinSetWarmStart()`
@*/
PetscErrorCode SNESLatinGetWarmStart(SNES snes, LatinWarmStart *warm)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(warm, 2);
  *warm = ((SNES_Latin *)snes->data)->warm;
  PetscFunctionReturn(0);
}
