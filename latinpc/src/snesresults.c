#include "sneslatinimpl.h"
#include <petsc/private/snesimpl.h>

/* What the users of SNES latin ask of it and tell it, besides options */

static PetscErrorCode SNESLatinCheck_Private(SNES snes)
{
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 1);
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONG, "The SNES is of type %s, not latin", ((PetscObject)snes)->type_name ? ((PetscObject)snes)->type_name : "(not set)");
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetLatin - The decomposition behind a SNES of type latin, for `LatinGetStatistics()` and its like.

  Not collective; the reference is borrowed

  Level: intermediate
@*/
PetscErrorCode SNESLatinGetLatin(SNES snes, Latin *latin)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  *latin = ((SNES_Latin *)snes->data)->latin;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetReference - Gives a displacement against which the error of every iterate is measured.

  Collective on snes

  Input Parameters:
+ snes      - of type latin
- reference - a DM global vector, or NULL for none

  Level: intermediate

.seealso: `SNESLatinGetHistory()`
@*/
PetscErrorCode SNESLatinSetReference(SNES snes, Vec reference)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  if (reference) PetscCall(PetscObjectReference((PetscObject)reference));
  PetscCall(VecDestroy(&data->reference));
  data->reference = reference;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinSetWarmStart - Whether a solve starts from the state of the last one with this SNES.

  Logically collective on snes

  Input Parameters:
+ snes        - of type latin
. warm        - start from the state where the last solve converged
- extrapolate - go on as the last two solves did

  Options Database Keys:
+ -snes_latin_warm_start <false>       - the first
- -snes_latin_warm_extrapolate <false> - the second

  Level: intermediate
@*/
PetscErrorCode SNESLatinSetWarmStart(SNES snes, PetscBool warm, PetscBool extrapolate)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data              = (SNES_Latin *)snes->data;
  data->warm        = warm;
  data->extrapolate = extrapolate;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetHistory - Indicator and errors of the last solve, one number per linear stage.

  Not collective; the arrays are borrowed

  Output Parameters:
+ n            - number of linear stages
. indicator    - relative distance of the two stages
. error_l2     - relative l2 error of the displacements of all subdomains, NULL without reference
- error_energy - relative energy error, NULL without reference

  Level: intermediate
@*/
PetscErrorCode SNESLatinGetHistory(SNES snes, PetscInt *n, const PetscReal *indicator[], const PetscReal *error_l2[], const PetscReal *error_energy[])
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  if (n) *n = data->done;
  if (indicator) *indicator = data->indicator;
  if (error_l2) *error_l2 = data->reference ? data->error_l2 : NULL;
  if (error_energy) *error_energy = data->reference ? data->error_energy : NULL;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetEstimates - Estimated errors of the last solve, one number per linear stage, and what rounding leaves.

  Not collective; the array is borrowed

  Output Parameters:
+ n        - number of linear stages
. estimate - relative error in the norm of `-snes_latin_error_norm`, NULL without `-snes_latin_stop error`
- floor    - the smallest error that rounding allows on this structure, an estimate, too; 0 when unknown

  Level: intermediate

.seealso: `SNESLatinGetHistory()`
@*/
PetscErrorCode SNESLatinGetEstimates(SNES snes, PetscInt *n, const PetscReal *estimate[], PetscReal *floor)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  if (n) *n = data->done;
  if (estimate) *estimate = data->stop == LATIN_STOP_ERROR ? data->estimates : NULL;
  if (floor) *floor = data->estimate.floor;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetLooseNodes - The nodes that nothing holds where the last solve has not converged: loads move them, and no link resists.

  Not collective; the array is borrowed

  Output Parameters:
+ count  - how many they are; 0 when the solve has converged, or nothing is known
. listed - how many of them are listed, at most 8
. node   - global numbers
- way    - how far they are from links that would stop them, a length; infinite: Newton's method has shown that loads move them without end

  Level: intermediate

  Note:
  Nodes on their way to a support take long where their loads are small beside the stiffness of slack links, or beside the
  search parameter of rigid ones.

.seealso: `SNESLatinGetHistory()`, `SNESLatinGetJammedLinks()`
@*/
PetscErrorCode SNESLatinGetLooseNodes(SNES snes, PetscInt *count, PetscInt *listed, const PetscInt *node[], PetscReal *way)
{
  LatinHeld *held;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  held = &((SNES_Latin *)snes->data)->held;
  if (count) *count = held->nodes;
  if (listed) *listed = PetscMin(held->nodes, LATIN_LOOSE);
  if (node) *node = held->node;
  if (way) *way = held->nodes ? held->way : 0.0;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetJammedLinks - The rigid links whose gaps no displacement meets together, where the last solve has not converged.

  Not collective; the array is borrowed

  Output Parameters:
+ count  - how many they are; 0 when the solve has converged, or nothing is known
. listed - how many of them are listed, at most 8
- link   - global numbers

  Level: intermediate

  Note:
  Inextensible cables that are too short, contacts without room: their tensions grow for ever, towards a self-stress.

.seealso: `SNESLatinGetLooseNodes()`
@*/
PetscErrorCode SNESLatinGetJammedLinks(SNES snes, PetscInt *count, PetscInt *listed, const PetscInt *link[])
{
  LatinHeld *held;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  held = &((SNES_Latin *)snes->data)->held;
  if (count) *count = held->links;
  if (listed) *listed = PetscMin(held->links, LATIN_LOOSE);
  if (link) *link = held->link;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetOuter - The inner SNES that iterates on the fixed-point map.

  Collective on snes when called first; the reference is borrowed

  Level: advanced
@*/
PetscErrorCode SNESLatinGetOuter(SNES snes, SNES *outer)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscCall(SNESLatinCreateOuter_Private(snes));
  *outer = ((SNES_Latin *)snes->data)->outer;
  PetscFunctionReturn(0);
}
