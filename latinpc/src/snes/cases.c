#include "snes/sneslatinimpl.h"
#include "cases/latincases.h"

/* Many load cases at once (cases/cases.c), to what this SNES would solve each of them to */

#define LATIN_CASE_TIGHT  LatinByPrecision(1e-9, 1e-4) /* of the loads: forces that a case of a small structure may leave without balance; next to collapse they show a soft mode */
#define LATIN_CASE_STAGES 100                          /* of a case: more, and Newton's method with operators of its own takes fewer */

/* Is the structure such that its cases can be solved side by side, and does nothing that was asked of this SNES need its own iteration? */
static PetscErrorCode SNESLatinCasesSuit_Private(SNES snes, LatinStructure structure, PetscBool *suit)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscMPIInt ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)snes), &ranks));
  PetscCall(LatinNewtonStart_Private(&data->newton, structure));
  *suit = (PetscBool)(ranks == 1 && data->newton.finish && !data->newton.contrast && !structure->general && !structure->ground && !structure->span);
  *suit = (PetscBool)(*suit && (data->asked == LATIN_STOP_ERROR || (data->asked == LATIN_STOP_AUTO && !SNESLatinStolGiven(snes))));
  *suit = (PetscBool)(*suit && data->warm == LATIN_WARM_START_NONE && !data->reference && !(data->large.given && data->large.geometry != LATIN_GEOMETRY_LINEAR));
  *suit = (PetscBool)(*suit && !data->monitor && !snes->numbermonitors && !snes->conv_hist && !(snes->ops->converged && snes->ops->converged != SNESConvergedDefault));
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSolveCases - Solves load cases of a structure on one rank side by side, with one factor and one sweep over the links for all of them.

  Not collective: the SNES and its structure are of one rank; on several, each solves cases of its own on a structure of its own

  Input Parameters:
+ snes       - of type latin, with its structure, options set
. n          - number of cases
. load       - of each case, forces [nodes][dim] beside those of the structure (N), NULL: none
. prescribed - displacements [nodes][dim] of fixed directions beside its own (m), NULL: none
- e0         - changes of the initial elongations [links] (m), NULL: none

  Output Parameters:
+ displacement - of each case, room for [nodes][dim] (m)
. tension      - room for [links] (N)
- stages       - solves with the factor that each case has taken; negative: it is not solved, and `SNESSolve()` is to be called with its actions

  Level: intermediate

  Notes:
  The result of a case is known to what `SNESSolve()` asks for: the estimated errors of displacements and tensions and the forces
  without balance. It does not depend on the other cases.

  No case is solved on several ranks, with links other than bars, cables and compression-only ones, with large displacements or
  prestress in the geometry, with stiffnesses that differ by more than a million, or where a monitor, a convergence
  test, a reference, a warm start, another stop than `LATIN_STOP_ERROR`, or `LATIN_NEWTON_NEVER` was given, or by a PETSc
  without CHOLMOD.

.seealso: `SNESLatinSetError()`, `SNESLatinSetTensionError()`, `SNESLatinSetBalance()`
@*/
PetscErrorCode SNESLatinSolveCases(SNES snes, PetscInt n, const PetscReal *const load[], const PetscReal *const prescribed[], const PetscReal *const e0[], PetscReal *const displacement[], PetscReal *const tension[], PetscInt stages[])
{
  SNES_Latin    *data;
  LatinStructure structure;
  LatinCaseGoal  goal;
  LatinCase     *one;
  PetscReal      size, held;
  PetscBool      suit = PETSC_FALSE, small;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  PetscCheck(structure, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "The SNES has no structure: give it one with LatinStructureAttachSNES()");
  PetscCall(SNESLatinCasesSuit_Private(snes, structure, &suit));
  for (PetscInt i = 0; i < n; i++) stages[i] = -1;
  if (!suit) PetscFunctionReturn(0);
  PetscCall(LatinStructureSize_Private(structure, &size, &held));
  goal = (LatinCaseGoal){.error = data->target, .tensions = SNESLatinTensionTarget(data), .balance = data->balance, .unbalance = SNESLatinUnbalance(data), .far = size, .most = PetscMin(snes->max_its, LATIN_CASE_STAGES)};
  PetscCall(LatinNewtonOwn_Private(structure, &small));
  if (small) goal.balance = PetscMin(goal.balance, LATIN_CASE_TIGHT); /* what does not get there is left to Newton's method, whose operators show the mode */
  PetscCall(PetscMalloc1(n, &one));
  for (PetscInt i = 0; i < n; i++) one[i] = (LatinCase){.load = load[i], .prescribed = prescribed[i], .e0 = e0[i], .displacement = displacement[i], .tension = tension[i]};
  PetscCall(LatinCasesSolve_Private(structure, &goal, n, one));
  for (PetscInt i = 0; i < n; i++) stages[i] = one[i].stages;
  PetscCall(PetscFree(one));
  PetscFunctionReturn(0);
}
