#include "structure/structureimpl.h"
#include <petsc/private/dmimpl.h>

/*
   Structures of section 2.1: creation, laws, directions and friction; supports and loads are in structure/actions.c, the DMPLEX is in
   structure/setup.c. The caller's nodes and links keep the caller's numbering; vertex_sf maps these nodes to the DM's vertices.
*/

static PetscErrorCode LatinStructureView_Private(LatinStructure structure, PetscViewer viewer)
{
  PetscBool ascii;
  PetscInt  free_dofs = 0;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  if (structure->load) PetscCall(VecGetSize(structure->load, &free_dofs));
  PetscCall(
    PetscViewerASCIIPrintf(viewer, "structure: %" PetscInt_FMT " nodes in %" PetscInt_FMT "D, %" PetscInt_FMT " links, %" PetscInt_FMT " free degrees of freedom\n", structure->nodes_global, structure->dim, structure->links_global, free_dofs));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureDestroy - Frees a structure.

  Collective on structure

  Level: beginner

.seealso: `LatinStructureCreate()`
@*/
PetscErrorCode LatinStructureDestroy(LatinStructure *structure)
{
  LatinStructure l;

  PetscFunctionBegin;
  PetscAssertPointer(structure, 1);
  if (!*structure) PetscFunctionReturn(0);
  PetscValidHeaderSpecific(*structure, LATIN_STRUCTURE_CLASSID, 1);
  l = *structure;
  if (--((PetscObject)l)->refct > 0) {
    *structure = NULL;
    PetscFunctionReturn(0);
  }
  if (l->base) { /* a time step, which borrows the rest from its base */
    PetscCall(PetscFree5(l->e0, l->prescribed, l->vertex_prescribed, l->held, l->vertex_held));
    PetscCall(VecDestroy(&l->ground));
    PetscCall(LatinStructureDestroy(&l->base));
  } else if (l->original) { /* a frame: the same */
    PetscCall(PetscFree6(l->nodes, l->ends, l->law, l->stiffness, l->e0, l->direction));
    PetscCall(PetscFree(l->part));
    PetscCall(PetscFree(l->spring));
    PetscCall(VecDestroy(&l->ground));
  } else if (l->cones_of) PetscCall(PetscFree2(l->law, l->direction));
  else {
    PetscCall(PetscFree5(l->x, l->prescribed, l->force, l->fixed, l->global_dof));
    PetscCall(PetscFree6(l->nodes, l->ends, l->law, l->stiffness, l->e0, l->direction));
    PetscCall(PetscFree(l->vertex_prescribed));
    PetscCall(PetscFree(l->mass));
    PetscCall(PetscFree(l->keeps));
    PetscCall(PetscFree(l->friction));
    PetscCall(VecDestroy(&l->inertia));
    PetscCall(PetscSFDestroy(&l->vertex_sf));
    PetscCall(PetscSFDestroy(&l->shared_sf));
    PetscCall(PetscFree(l->shared_vertex));
  }
  PetscCall(PetscFree(l->span));
  PetscCall(VecDestroy(&l->load));
  if (l->dm) { /* others may have references to the DM */
    PetscCall(PetscObjectCompose((PetscObject)l->dm, "LatinStructure", NULL));
    PetscCall(PetscObjectDestroy(&l->dm->dmsnes));
  }
  PetscCall(DMDestroy(&l->dm));
  PetscCall(LatinStructureDestroy(&l->original));
  PetscCall(LatinStructureDestroy(&l->cones_of));
  PetscCall(PetscHeaderDestroy(structure));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureCreate_Private(MPI_Comm comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *newlinks)
{
  const PetscInt n = dim * nodes_local;
  LatinStructure l;
  PetscInt       in[2] = {nodes_local, links_local}, out[2], start[2], bad = -1, self = -1;
  PetscInt       first     = dim;
  PetscReal      counts[2] = {nodes_local, links_local};

  PetscFunctionBegin;
  PetscCall(LatinRegisterClasses_Private());
  LatinAgree(comm, dim < 1 || dim > 3, PETSC_ERR_ARG_OUTOFRANGE, "A structure has 1, 2 or 3 dimensions, not %" PetscInt_FMT, dim);
  PetscCallMPI(MPI_Bcast(&first, 1, MPIU_INT, 0, comm));
  LatinAgree(comm, dim != first, PETSC_ERR_ARG_WRONG, "A rank gives %" PetscInt_FMT " dimensions, and the first rank %" PetscInt_FMT ": a structure has the same on all ranks", dim, first);
  LatinAgree(comm, nodes_local < 0 || links_local < 0, PETSC_ERR_ARG_OUTOFRANGE, "A rank gives %" PetscInt_FMT " nodes and %" PetscInt_FMT " links; numbers of them are not negative", nodes_local, links_local);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_REAL, MPIU_SUM, comm)); /* sums of integers could overflow */
  PetscCheck(dim * counts[0] <= (PetscReal)PETSC_MAX_INT && PetscMax(dim, 2) * counts[1] <= (PetscReal)PETSC_MAX_INT, comm, PETSC_ERR_ARG_OUTOFRANGE,
             "%.0f nodes and %.0f links in %" PetscInt_FMT "D are more than PETSc's integers of %d bits can number: take a PETSc configured --with-64-bit-indices", (double)counts[0], (double)counts[1], dim, (int)(8 * sizeof(PetscInt)));
  PetscCall(MPIU_Allreduce(in, out, 2, MPIU_INT, MPI_SUM, comm));
  PetscCallMPI(MPI_Scan(in, start, 2, MPIU_INT, MPI_SUM, comm));
  LatinAgree(comm, nodes_global != PETSC_DETERMINE && nodes_global != out[0], PETSC_ERR_ARG_SIZ, "The ranks give %" PetscInt_FMT " nodes in all, not the %" PetscInt_FMT " announced", out[0], nodes_global);
  LatinAgree(comm, out[1] == 0, PETSC_ERR_ARG_SIZ, "The structure has no link: there is nothing to solve");
  PetscCall(LatinCheckArray_Private(comm, "Link", start[1] - links_local, links_local, link_nodes, "two nodes"));
  for (PetscInt i = 0; i < links_local; i++) {
    const PetscInt a = link_nodes[2 * i], b = link_nodes[2 * i + 1];

    if (bad < 0 && (PetscMin(a, b) < 0 || PetscMax(a, b) >= out[0])) bad = i;
    if (self < 0 && a == b) self = i;
  }
  LatinAgree(comm, bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " joins nodes %" PetscInt_FMT " and %" PetscInt_FMT ", but the nodes are numbered from 0 to %" PetscInt_FMT, start[1] - links_local + bad, link_nodes[2 * bad],
             link_nodes[2 * bad + 1], out[0] - 1);
  LatinAgree(comm, self >= 0, PETSC_ERR_ARG_WRONG, "Link %" PetscInt_FMT " joins node %" PetscInt_FMT " to itself; remove it", start[1] - links_local + self, link_nodes[2 * self]);
  PetscCall(LatinCheckNumbers_Private(comm, "Node", start[0] - nodes_local, nodes_local, dim, coordinates, PETSC_TRUE, "a coordinate"));
  PetscCall(PetscHeaderCreate(l, LATIN_STRUCTURE_CLASSID, "LatinStructure", "Structure of links", "Latin", comm, LatinStructureDestroy, LatinStructureView_Private));
  l->dim          = dim;
  l->nodes_local  = nodes_local;
  l->links_local  = links_local;
  l->nodes_global = out[0];
  l->links_global = out[1];
  l->nodes_start  = start[0] - nodes_local;
  l->links_start  = start[1] - links_local;
  l->rigid_law    = -1;
  PetscCall(LatinWatchCreate_Private(PetscObjectComm((PetscObject)l)));
  PetscCall(PetscCalloc5(n, &l->x, n, &l->prescribed, n, &l->force, n, &l->fixed, n, &l->global_dof));
  PetscCall(PetscCalloc6(2 * links_local, &l->nodes, 2 * links_local, &l->ends, links_local, &l->law, links_local, &l->stiffness, links_local, &l->e0, dim * links_local, &l->direction));
  PetscCall(PetscArraycpy(l->x, coordinates, n));
  PetscCall(PetscArraycpy(l->nodes, link_nodes, 2 * links_local));
  PetscCall(LatinStructureCreateMesh_Private(l));
  *newlinks = l;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureCreate - Creates a structure of nodes joined by links.

  Collective on comm

  Input Parameters:
+ dim          - number of displacement components of a node: 1, 2 or 3
. nodes_local  - number of nodes given by this rank; nodes are numbered rank by rank
. nodes_global - number of all nodes, or `PETSC_DETERMINE`
. coordinates  - [nodes_local][dim], a length
. links_local  - number of links given by this rank
- link_nodes   - [links_local][2] numbers of the end nodes, counted from 0 over all ranks

  Level: beginner

  Notes:
  Raises `PETSC_ERR_ARG_OUTOFRANGE` for a link whose node does not exist and `PETSC_ERR_ARG_WRONG` for a link that
  joins a node to itself, on every rank. A link whose nodes lie at the same point needs `LatinStructureSetDirections()`.

.seealso: `LatinStructureSetLaws()`, `LatinStructureSetSupports()`, `LatinStructureSetLoads()`, `LatinStructureSetUp()`, `LatinStructureDestroy()`
@*/
PetscErrorCode LatinStructureCreate(MPI_Comm comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *newlinks)
{
  PetscFunctionBegin;
  PetscCheck(newlinks, comm, PETSC_ERR_ARG_NULL, "newlinks is NULL: it must point to the new structure");
  PetscCall(LatinWatchCreate_Private(comm));
  LatinWatch(comm, LatinStructureCreate_Private(comm, dim, nodes_local, nodes_global, coordinates, links_local, link_nodes, newlinks));
  PetscFunctionReturn(0);
}

/* Stores laws, stiffnesses and initial elongations, and checks them against the geometry; the numbers of the laws are valid. Collective on structure */
static PetscErrorCode LatinStructureKeepLaws_Private(LatinStructure structure, const PetscInt law[], const PetscReal stiffness[], const PetscReal e0[])
{
  PetscInt kinds[4] = {0, 0, 0, 0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (LatinLaws[law[l]].rigid) kinds[0] = PetscMax(kinds[0], LATIN_LAW_TANGENT + 1 - law[l]); /* the maximum is that of the first rigid law in the table */
    if (law[l] > LATIN_LAW_COMPRESSION_ONLY) kinds[1] = 1;
    if (law[l] == LATIN_LAW_FRICTION || law[l] == LATIN_LAW_TANGENT) kinds[2] = 1;
    if (law[l] > LATIN_LAW_TANGENT) kinds[3] = PetscMax(kinds[3], law[l]);
    structure->law[l]       = law[l];
    structure->stiffness[l] = stiffness[l] > 0.0 ? stiffness[l] : LatinLaws[law[l]].stiffness;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, kinds, 4, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  structure->rigid_law    = kinds[0] ? LATIN_LAW_TANGENT + 1 - kinds[0] : -1;
  structure->general      = (PetscBool)(kinds[1] > 0);
  structure->has_friction = (PetscBool)(kinds[2] > 0);
  structure->own_laws     = (PetscBool)(kinds[3] > 0);
  if (structure->own_laws) PetscCall(LatinLawsSame_Private(PetscObjectComm((PetscObject)structure), kinds[3]));
  PetscCall(PetscObjectStateIncrease((PetscObject)structure));
  PetscCall(LatinStructureSetInitialElongations(structure, e0));
  if (structure->set_up) {
    PetscCall(LatinStructureCheckContacts_Private(structure));
    PetscCall(LatinTurningSetUp_Private(structure));
  }
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetLaws - Sets the constitutive laws (2), (3), (4) of the links of this rank.

  Collective on structure

  Input Parameters:
+ law       - [links_local] `LatinLawType`, or number from `LatinLawRegister()` or `LatinLawRegisterTable()`
. stiffness - [links_local] k, force/length, positive; of a rigid law the search parameter l, 0: automatic; of a table
  0: its own stiffness
- e0        - [links_local] initial elongations, lengths, or NULL for zero; k e0 is the tension in the prestressed configuration; of
  a contact e0 is the gap

  Level: beginner

.seealso: `LatinStructureGetLaws()`
@*/
PetscErrorCode LatinStructureSetLaws(LatinStructure structure, const PetscInt law[], const PetscReal stiffness[], const PetscReal e0[])
{
  MPI_Comm       comm;
  PetscInt       n, badlaw = -1, badk = -1, *laws;
  PetscReal     *stiffnesses, *elongations;
  PetscErrorCode refused;
  char           list[256] = "0 (bar)";
  size_t         length;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  comm = PetscObjectComm((PetscObject)structure);
  n    = structure->links_local;
  PetscCall(LatinCheckArray_Private(comm, "Link", structure->links_start, n, law, "a law"));
  PetscCall(LatinCheckArray_Private(comm, "Link", structure->links_start, n, stiffness, "a stiffness"));
  for (PetscInt l = 0; l < n; l++) {
    const PetscBool known = (PetscBool)(law[l] >= 0 && law[l] < LatinLawCount);

    if (badlaw < 0 && !known) badlaw = l;
    if (badk < 0 && (PetscIsInfOrNanReal(stiffness[l]) || (!(stiffness[l] > 0.0) && !(stiffness[l] == 0.0 && known && (LatinLaws[law[l]].rigid || LatinLaws[law[l]].stiffness > 0.0))))) badk = l;
  }
  for (PetscInt i = 1; i < LatinLawCount && badlaw >= 0; i++) {
    PetscCall(PetscStrlen(list, &length));
    PetscCall(PetscSNPrintf(list + length, sizeof(list) - length, ", %" PetscInt_FMT " (%s)", i, LatinLaws[i].name));
  }
  LatinAgree(comm, badlaw >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " has law %" PetscInt_FMT "; the laws are %s", structure->links_start + badlaw, law[badlaw], list);
  LatinAgree(comm, badk >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " has stiffness %g; a stiffness is a positive finite number of force/length", structure->links_start + badk, (double)stiffness[badk]);
  PetscCall(PetscMalloc3(n, &laws, n, &stiffnesses, n, &elongations));
  PetscCall(PetscArraycpy(laws, structure->law, n));
  PetscCall(PetscArraycpy(stiffnesses, structure->stiffness, n));
  PetscCall(PetscArraycpy(elongations, structure->e0, n));
  PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL)); /* PETSc's own handler would let ranks sleep that are needed below */
  refused = LatinStructureKeepLaws_Private(structure, law, stiffness, e0);
  PetscCall(PetscPopErrorHandler());
  if (refused) PetscCall(LatinStructureKeepLaws_Private(structure, laws, stiffnesses, elongations)); /* restores the structure */
  PetscCall(PetscFree3(laws, stiffnesses, elongations));
  LatinEach(comm, refused);
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetLaws - Gets the constitutive laws of the links of this rank.

  Not collective; the arrays are borrowed, read-only

  Input Parameter:
. structure - the structure

  Output Parameters:
+ n         - number of links of this rank
. law       - [n] `LatinLawType`, or number of a registered law
. stiffness - [n] k, force/length; 0 before `LatinStructureSetLaws()`; of a rigid law the search parameter, 0: automatic
- e0        - [n] initial elongations, lengths

  Level: beginner

  Notes:
  Pass NULL for what is not needed. A table set with stiffness 0 has its own stiffness. Initial elongations are those of the last call of
  `LatinStructureSetLaws()`, `LatinStructureSetInitialElongations()` or `LatinStructureSetPrestress()`.

.seealso: `LatinStructureSetLaws()`, `LatinStructureSetInitialElongations()`, `LatinStructureSetPrestress()`
@*/
PetscErrorCode LatinStructureGetLaws(LatinStructure structure, PetscInt *n, const PetscInt *law[], const PetscReal *stiffness[], const PetscReal *e0[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (n) *n = structure->links_local;
  if (law) *law = structure->law;
  if (stiffness) *stiffness = structure->stiffness;
  if (e0) *e0 = structure->e0;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetDirections - Sets directions of links, [links_local][dim], other than from their first to their second node.

  Collective on structure; before `LatinStructureSetUp()`

  Input Parameters:
+ structure - not set up yet
- direction - [links_local][dim], zero: from the coordinates of the nodes

  Level: intermediate

  Notes:
  The elongation of a link is the displacement of its second node along its direction, minus that of the first one.
  Directions may have any length. They are for contacts of nodes at the same point, tangential parts of contacts, and the
  transverse stiffness of taut cables.

.seealso: `LatinStructureGetDirections()`
@*/
PetscErrorCode LatinStructureSetDirections(LatinStructure structure, const PetscReal direction[])
{
  PetscInt   dim;
  PetscReal *given;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  dim = structure->dim;
  PetscCheck(!structure->set_up, PetscObjectComm((PetscObject)structure), PETSC_ERR_ORDER, "Directions must be given before LatinStructureSetUp()");
  PetscCall(LatinCheckNumbers_Private(PetscObjectComm((PetscObject)structure), "Link", structure->links_start, structure->links_local, dim, direction, PETSC_TRUE, "a direction"));
  PetscCall(PetscMalloc1(dim * structure->links_local, &given));
  PetscCall(PetscArraycpy(given, direction, dim * structure->links_local)); /* it may be the array of LatinStructureGetDirections() */
  PetscCall(LatinStructureDirections_Private(structure));
  for (PetscInt l = 0; l < structure->links_local; l++) (void)LatinUnitVector(dim, given + dim * l, structure->direction + dim * l);
  PetscCall(PetscFree(given));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetDirections - Gets the directions of the links of this rank.

  Not collective; the array is borrowed, read-only

  Input Parameter:
. structure - the structure

  Output Parameters:
+ n         - length of the array: dim times the number of links of this rank
- direction - [links_local][dim] unit vectors; zero if the nodes are at the same point and no direction is set

  Level: intermediate

  Note:
  Pass NULL for what is not needed.

.seealso: `LatinStructureSetDirections()`
@*/
PetscErrorCode LatinStructureGetDirections(LatinStructure structure, PetscInt *n, const PetscReal *direction[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (n) *n = structure->dim * structure->links_local;
  if (direction) *direction = structure->direction;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetFriction - Sets the coefficients of friction of the contacts of this rank.

  Collective on structure; before `LatinStructureSetUp()`

  Input Parameters:
+ structure   - not set up yet
- coefficient - [links_local] Coulomb coefficients, not negative; used at links of law friction only

  Level: intermediate

.seealso: `LatinStructureGetFriction()`
@*/
PetscErrorCode LatinStructureSetFriction(LatinStructure structure, const PetscReal coefficient[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCheck(!structure->set_up, PetscObjectComm((PetscObject)structure), PETSC_ERR_ORDER, "Coefficients of friction must be given before LatinStructureSetUp()");
  PetscCall(LatinCheckNumbers_Private(PetscObjectComm((PetscObject)structure), "Link", structure->links_start, structure->links_local, 1, coefficient, PETSC_FALSE, "a coefficient of friction"));
  if (!structure->friction) PetscCall(PetscMalloc1(structure->links_local + 1, &structure->friction)); /* + 1: not NULL on a rank without links */
  PetscCall(PetscArraycpy(structure->friction, coefficient, structure->links_local));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetFriction - Gets the coefficients of friction of the contacts of this rank.

  Not collective; the array is borrowed, read-only

  Input Parameter:
. structure - the structure

  Output Parameters:
+ n           - number of links of this rank; 0 if no coefficients are set
- coefficient - [n] Coulomb coefficients; NULL if none are set

  Level: intermediate

  Note:
  Pass NULL for what is not needed.

.seealso: `LatinStructureSetFriction()`
@*/
PetscErrorCode LatinStructureGetFriction(LatinStructure structure, PetscInt *n, const PetscReal *coefficient[])
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (n) *n = structure->friction ? structure->links_local : 0;
  if (coefficient) *coefficient = structure->friction;
  PetscFunctionReturn(0);
}
