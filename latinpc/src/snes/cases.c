#include "snes/sneslatinimpl.h"
#include "cases/latincases.h"

/* Many load cases at once (cases/cases.c), to the accuracy of SNESSolve() */

#define LATIN_CASE_TIGHT  LatinByPrecision(1e-9, 1e-4) /* largest unbalance of a case of a small structure, relative to the loads: shows soft modes */
#define LATIN_CASE_STAGES 100                          /* most solves of a case; Newton's method with the tangent stiffness then takes fewer */

/* Returns in *suit whether structure and options allow cases side by side. Options of the iteration, such as monitors, do not */
static PetscErrorCode SNESLatinCasesSuit_Private(SNES snes, LatinStructure structure, PetscBool *suit)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscMPIInt ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)snes), &ranks));
  PetscCall(LatinNewtonStart_Private(&data->newton, structure));
  *suit = (PetscBool)(ranks == 1 && data->newton.finish && !data->newton.contrast && !structure->general && !structure->ground && !structure->span);
  *suit = (PetscBool)(*suit && (data->requested == LATIN_STOP_ERROR || (data->requested == LATIN_STOP_AUTO && !SNESLatinStolGiven(snes))));
  *suit = (PetscBool)(*suit && data->warm == LATIN_WARM_START_NONE && !data->reference && !(data->large.given && data->large.geometry != LATIN_GEOMETRY_LINEAR));
  *suit = (PetscBool)(*suit && !data->monitor && !SNESLatinWatched(snes));
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSolveCases - Solves load cases of a structure on one rank side by side, with one factor and one sweep over the links for all of them.

  Not collective: SNES and structure have one rank; several ranks each solve their own cases of their own structure

  Input Parameters:
+ snes       - of type latin, with its structure, options set
. n          - number of cases
. load       - of each case, forces [nodes][dim] in addition to those of the structure (N), NULL: none
. prescribed - displacements [nodes][dim] of fixed directions in addition to those of the structure (m), NULL: none
- e0         - changes of the initial elongations [links] (m), NULL: none

  Output Parameters:
+ displacement - of each case, room for [nodes][dim] (m)
. tension      - room for [links] (N)
- stages       - number of solves with the factor for each case; negative: not solved, call `SNESSolve()` with its actions

  Level: intermediate

  Notes:
  The result of a case has the accuracy of `SNESSolve()`: estimated errors of displacements and tensions, unbalance. It does not
  depend on the other cases.

  Not supported (no case is solved): several ranks; links other than bars, cables and compression-only ones; large displacements or
  prestress in the geometry; stiffnesses that differ by more than a million; a monitor, a convergence test, a reference, a warm
  start, another stop than `LATIN_STOP_ERROR`, or `LATIN_NEWTON_NEVER`; a PETSc without CHOLMOD.

.seealso: `SNESLatinSetError()`, `SNESLatinSetTensionError()`, `SNESLatinSetBalance()`
@*/
PetscErrorCode SNESLatinSolveCases(SNES snes, PetscInt n, const PetscReal *const load[], const PetscReal *const prescribed[], const PetscReal *const e0[], PetscReal *const displacement[], PetscReal *const tension[], PetscInt stages[])
{
  SNES_Latin    *data;
  LatinStructure structure;
  LatinCaseGoal  goal;
  LatinCase     *one;
  PetscReal      size;
  PetscBool      suit = PETSC_FALSE, small;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscCheck(n >= 0, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE, "%" PetscInt_FMT " load cases: their number is not negative", n);
  if (n) {
    PetscAssertPointer(displacement, 6);
    PetscAssertPointer(tension, 7);
    PetscAssertPointer(stages, 8);
  }
  data = (SNES_Latin *)snes->data;
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  PetscCheck(structure, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "The SNES has no structure: give it one with LatinStructureAttachSNES() (in Python, latinpc.Structure(...).attach(snes))");
  PetscCall(SNESLatinCasesSuit_Private(snes, structure, &suit));
  for (PetscInt i = 0; i < n; i++) stages[i] = -1;
  if (!suit) PetscFunctionReturn(0);
  PetscCall(LatinStructureSize_Private(structure, &size, NULL));
  goal = (LatinCaseGoal){.error = data->target, .tensions = SNESLatinTensionTarget(data), .balance = data->balance, .unbalance = SNESLatinUnbalance(data), .far = size, .most = PetscMin(SNESLatinStageLimit(snes), LATIN_CASE_STAGES)};
  PetscCall(LatinNewtonOwn_Private(structure, &small));
  if (small) goal.balance = PetscMin(goal.balance, LATIN_CASE_TIGHT); /* cases above this go to Newton's method, whose tangent stiffness shows soft modes */
  for (PetscInt i = 0; i < n; i++) PetscCheck(displacement[i] && tension[i], PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_NULL, "Load case %" PetscInt_FMT " has no room for its results: its displacement or its tension is NULL", i);
  PetscCall(PetscMalloc1(n, &one));
  for (PetscInt i = 0; i < n; i++) one[i] = (LatinCase){.load = load ? load[i] : NULL, .prescribed = prescribed ? prescribed[i] : NULL, .e0 = e0 ? e0[i] : NULL, .displacement = displacement[i], .tension = tension[i]};
  PetscCall(LatinCasesSolve_Private(structure, &goal, n, one));
  for (PetscInt i = 0; i < n; i++) stages[i] = one[i].stages;
  PetscCall(PetscFree(one));
  PetscFunctionReturn(0);
}
