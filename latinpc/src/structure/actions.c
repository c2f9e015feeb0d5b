#include "structure/structureimpl.h"

/* Actions on structures of section 2.1: initial elongations of links, supports, loads */

/*@C
  LatinStructureSetInitialElongations - Changes the initial elongations e0 of the links of this rank, [links_local], lengths, or NULL for none.

  Collective on structure; no operator is rebuilt for it

  Input Parameters:
+ structure - with laws
- e0        - [links_local] lengths, or NULL for zero

  Level: intermediate

.seealso: `LatinStructureGetLaws()`
@*/
PetscErrorCode LatinStructureSetInitialElongations(LatinStructure structure, const PetscReal e0[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCall(LatinCheckNumbers_Private(PetscObjectComm((PetscObject)structure), "Link", structure->links_start, e0 ? structure->links_local : 0, 1, e0, PETSC_TRUE, "an initial elongation"));
  if (structure->set_up && structure->keeps) PetscCall(LatinTurningNatural_Private(structure, e0));
  if (e0) PetscCall(PetscArraycpy(structure->e0, e0, structure->links_local));
  else PetscCall(PetscArrayzero(structure->e0, structure->links_local));
  structure->e0_state++;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetPrestress - Sets the tensions T, [links_local], of the links of this rank in the prestressed configuration: e0 = T / k.

  Collective on structure; after `LatinStructureSetLaws()`

  Input Parameters:
+ structure - with laws
- prestress - [links_local] forces T

  Level: intermediate

  Note:
  T is any force for bars, >= 0 for cables, <= 0 for compression-only links, 0 for other laws.

.seealso: `LatinStructureGetLaws()`
@*/
PetscErrorCode LatinStructureSetPrestress(LatinStructure structure, const PetscReal prestress[])
{
  PetscInt   law = 0, bad = -1;
  PetscBool  known = PETSC_TRUE;
  PetscReal *e0;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCall(LatinCheckArray_Private(PetscObjectComm((PetscObject)structure), "Link", structure->links_start, structure->links_local, prestress, "a prestress"));
  PetscCall(PetscCalloc1(structure->links_local, &e0));
  for (PetscInt l = 0; l < structure->links_local && bad < 0; l++) {
    const PetscReal k = structure->stiffness[l], T = prestress[l];

    law   = structure->law[l];
    known = (PetscBool)(k > 0.0 || LatinLaws[law].rigid);
    if (known && T == 0.0) continue;
    if (known && law <= LATIN_LAW_COMPRESSION_ONLY && !PetscIsInfOrNanReal(T / k) && LatinLaws[law].tension(k, T / k, LatinLaws[law].ctx) != 0.0) e0[l] = T / k;
    else bad = l;
  }
  LatinAgree(PetscObjectComm((PetscObject)structure), bad >= 0 && !known, PETSC_ERR_ORDER, "Link %" PetscInt_FMT " has no stiffness: call LatinStructureSetLaws() before LatinStructureSetPrestress()", structure->links_start + bad);
  LatinAgree(PetscObjectComm((PetscObject)structure), bad >= 0, PETSC_ERR_ARG_OUTOFRANGE,
             "Link %" PetscInt_FMT " has the prestress %g and the law %s: bars take any finite force, cables one that is not negative, compression-only links one that is not positive", structure->links_start + bad, (double)prestress[bad],
             LatinLaws[law].name);
  PetscCall(LatinStructureSetInitialElongations(structure, e0));
  PetscCall(PetscFree(e0));
  PetscFunctionReturn(0);
}

/* Checks and stores prescribed displacements of fixed components. Collective on structure */
static PetscErrorCode LatinStructurePrescribe_Private(LatinStructure structure, const PetscBool fixed[], const PetscReal prescribed[])
{
  const PetscInt n = structure->dim * structure->nodes_local;
  PetscReal     *value;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n, &value));
  for (PetscInt i = 0; i < n; i++) value[i] = fixed[i] && prescribed ? prescribed[i] : 0.0;
  PetscCall(LatinCheckNumbers_Private(PetscObjectComm((PetscObject)structure), "Node", structure->nodes_start, structure->nodes_local, structure->dim, value, PETSC_TRUE, "a prescribed displacement"));
  PetscCall(PetscArraycpy(structure->prescribed, value, n));
  PetscCall(PetscFree(value));
  structure->held_state++;
  if (structure->set_up) PetscCall(LatinSFBcast_Private(structure->vertex_sf, structure->dim, MPIU_REAL, structure->prescribed, structure->vertex_prescribed));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetSupports - Prescribes displacement components of the nodes of this rank.

  Collective on structure; before `LatinStructureSetUp()`

  Input Parameters:
+ structure  - not set up yet
. fixed      - [nodes_local][dim] whether a component is prescribed
- prescribed - [nodes_local][dim] prescribed displacements, lengths, or NULL for zero

  Level: beginner

.seealso: `LatinStructureGetSupports()`
@*/
PetscErrorCode LatinStructureSetSupports(LatinStructure structure, const PetscBool fixed[], const PetscReal prescribed[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCheck(!structure->set_up, PetscObjectComm((PetscObject)structure), PETSC_ERR_ORDER, "Supports must be given before LatinStructureSetUp(); LatinStructureSetPrescribed() changes their displacements after it");
  PetscCall(LatinCheckArray_Private(PetscObjectComm((PetscObject)structure), "Node", structure->nodes_start, structure->nodes_local, fixed, "its supports, or none"));
  PetscCall(LatinStructurePrescribe_Private(structure, fixed, prescribed));
  PetscCall(PetscArraycpy(structure->fixed, fixed, structure->dim * structure->nodes_local));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetSupports - Gets which displacement components of the nodes of this rank are prescribed, and their displacements.

  Not collective; the arrays are borrowed, read-only

  Input Parameter:
. structure - the structure

  Output Parameters:
+ n          - length of the arrays: dim times the number of nodes of this rank
. fixed      - [nodes_local][dim] whether a component is prescribed; by default none is
- prescribed - [nodes_local][dim] prescribed displacements, lengths; zero where the displacement is free

  Level: beginner

  Notes:
  Pass NULL for what is not needed. Displacements are those of the last call of `LatinStructureSetSupports()` or
  `LatinStructureSetPrescribed()`; during a solve with large displacements a part of them.

.seealso: `LatinStructureSetSupports()`, `LatinStructureSetPrescribed()`
@*/
PetscErrorCode LatinStructureGetSupports(LatinStructure structure, PetscInt *n, const PetscBool *fixed[], const PetscReal *prescribed[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (n) *n = structure->dim * structure->nodes_local;
  if (fixed) *fixed = structure->fixed;
  if (prescribed) *prescribed = structure->prescribed;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetPrescribed - Changes the displacements prescribed by `LatinStructureSetSupports()`, for settlements and moving supports.

  Collective on structure; may be called again after `LatinStructureSetUp()`, no operator is rebuilt for it

  Input Parameter:
. prescribed - [nodes_local][dim] lengths, ignored where the displacement is free, or NULL for zero

  Level: intermediate

.seealso: `LatinStructureGetSupports()`
@*/
PetscErrorCode LatinStructureSetPrescribed(LatinStructure structure, const PetscReal prescribed[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCall(LatinStructurePrescribe_Private(structure, structure->fixed, prescribed));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetLoads - Sets the external forces F, [nodes_local][dim], on the nodes of this rank (1).

  Collective on structure; may be called again after `LatinStructureSetUp()`, no operator is rebuilt for it

  Input Parameters:
+ structure - the structure
- force     - [nodes_local][dim] forces F

  Level: beginner

  Note:
  They are ignored where the displacement is prescribed.

.seealso: `LatinStructureGetLoads()`
@*/
PetscErrorCode LatinStructureSetLoads(LatinStructure structure, const PetscReal force[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCall(LatinCheckNumbers_Private(PetscObjectComm((PetscObject)structure), "Node", structure->nodes_start, structure->nodes_local, structure->dim, force, PETSC_TRUE, "a load"));
  PetscCall(PetscArraycpy(structure->force, force, structure->nodes_local * structure->dim));
  structure->load_state++;
  if (structure->set_up) PetscCall(LatinStructureNodalVec_Private(structure, structure->force, structure->load));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetLoads - Gets the external forces on the nodes of this rank.

  Not collective; the array is borrowed, read-only

  Input Parameter:
. structure - the structure

  Output Parameters:
+ n     - length of the array: dim times the number of nodes of this rank
- force - [nodes_local][dim] forces F; zero by default

  Level: beginner

  Note:
  Pass NULL for what is not needed.

.seealso: `LatinStructureSetLoads()`
@*/
PetscErrorCode LatinStructureGetLoads(LatinStructure structure, PetscInt *n, const PetscReal *force[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (n) *n = structure->dim * structure->nodes_local;
  if (force) *force = structure->force;
  PetscFunctionReturn(0);
}
