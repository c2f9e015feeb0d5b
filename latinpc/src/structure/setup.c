#include "base/fingerprint.h"
#include "structure/structureimpl.h"

/*
   Set-up of the DMPLEX of a structure.

   1. From nodes and links: vertices, the mesh, owners of vertices, directions of links, vertices shared by ranks.
   2. After laws, supports and loads: checks, the section of displacements, numbers of free degrees of freedom, the load vector.
*/

/* Creates vertex_sf and ends. Vertices are the nodes of this rank's links, then this rank's nodes without links. Collective on structure */
static PetscErrorCode LatinStructureVertices_Private(LatinStructure structure)
{
  MPI_Comm        comm = PetscObjectComm((PetscObject)structure);
  const PetscInt *degree;
  PetscInt        n, all, *number;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(2 * structure->links_local, &number));
  PetscCall(LatinPlaces_Private(2 * structure->links_local, structure->nodes, &n, number, structure->ends));
  PetscCall(LatinSFFetch_Private(comm, structure->nodes_local, n, number, &structure->vertex_sf));
  PetscCall(PetscSFComputeDegreeBegin(structure->vertex_sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(structure->vertex_sf, &degree));
  for (PetscInt i = 0; i < structure->nodes_local; i++) structure->unlinked += degree[i] ? 0 : 1;
  structure->vertices = n + structure->unlinked;
  PetscCall(MPIU_Allreduce(&structure->unlinked, &all, 1, MPIU_INT, MPI_SUM, comm));
  if (all) {
    PetscCall(PetscRealloc((size_t)structure->vertices * sizeof(*number), &number));
    for (PetscInt i = 0; i < structure->nodes_local; i++)
      if (!degree[i]) number[n++] = structure->nodes_start + i;
    PetscCall(PetscSFDestroy(&structure->vertex_sf));
    PetscCall(LatinSFFetch_Private(comm, structure->nodes_local, n, number, &structure->vertex_sf));
  }
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

/* Sets the point SF of the DM: the last of the ranks of a vertex owns it. Collective on structure */
static PetscErrorCode LatinStructureOwners_Private(LatinStructure structure)
{
  const PetscInt m = structure->links_local, n = structure->vertices;
  PetscInt       ghosts = 0, *ghost;
  PetscSFNode   *owner, *vertex, *root;
  PetscMPIInt    rank, size;
  PetscSF        points;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)structure), &size));
  if (size == 1) PetscFunctionReturn(0);
  PetscCallMPI(MPI_Comm_rank(PetscObjectComm((PetscObject)structure), &rank));
  PetscCall(PetscMalloc2(structure->nodes_local, &owner, n, &vertex));
  for (PetscInt i = 0; i < structure->nodes_local; i++) owner[i] = (PetscSFNode){-1, -1};
  for (PetscInt v = 0; v < n; v++) vertex[v] = (PetscSFNode){rank, m + v};
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, 1, MPIU_2INT, vertex, owner, MPI_MAXLOC));
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, 1, MPIU_2INT, owner, vertex));
  for (PetscInt v = 0; v < n; v++) ghosts += vertex[v].rank == rank ? 0 : 1;
  PetscCall(PetscMalloc1(ghosts, &ghost));
  PetscCall(PetscMalloc1(ghosts, &root));
  for (PetscInt v = 0, k = 0; v < n; v++) {
    if (vertex[v].rank == rank) continue;
    ghost[k]  = m + v;
    root[k++] = vertex[v];
  }
  PetscCall(DMGetPointSF(structure->dm, &points));
  PetscCall(PetscSFSetGraph(points, m + n, ghosts, ghost, PETSC_OWN_POINTER, root, PETSC_OWN_POINTER));
  PetscCall(PetscFree2(owner, vertex));
  PetscFunctionReturn(0);
}

/* Creates the DM and vertex_sf. DMPlexCreateFromCellListParallelPetsc() takes three times as long on many ranks. Collective on structure */
static PetscErrorCode LatinStructureCreatePlex_Private(LatinStructure structure)
{
  PetscSF moved;

  PetscFunctionBegin;
  PetscCall(LatinStructureVertices_Private(structure));
  PetscCall(DMCreate(PetscObjectComm((PetscObject)structure), &structure->dm));
  PetscCall(DMSetType(structure->dm, DMPLEX));
  PetscCall(DMSetDimension(structure->dm, 1));
  PetscCall(DMPlexBuildFromCellList(structure->dm, structure->links_local, structure->vertices, 2, structure->ends));
  PetscCall(LatinStructureOwners_Private(structure));
  /* a copy: in one dimension, sums by an SF fail after it has moved coordinates */
  PetscCall(PetscSFDuplicate(structure->vertex_sf, PETSCSF_DUPLICATE_GRAPH, &moved));
  PetscCall(DMPlexBuildCoordinatesFromCellListParallel(structure->dm, structure->dim, moved, structure->x));
  PetscCall(PetscSFDestroy(&moved));
  PetscFunctionReturn(0);
}

/* Sets shared_vertex, the vertices shared by ranks, and shared_sf, from their owners to the other ranks. Collective on structure */
static PetscErrorCode LatinStructureShared_Private(LatinStructure structure)
{
  const PetscInt     m    = structure->links_local;
  MPI_Comm           comm = PetscObjectComm((PetscObject)structure);
  const PetscInt    *degree, *leaf;
  const PetscSFNode *root;
  PetscSFNode       *to;
  PetscInt           roots, leaves, *place, *own;
  PetscMPIInt        size;
  PetscSF            points;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size == 1) PetscFunctionReturn(0);
  PetscCall(DMGetPointSF(structure->dm, &points));
  PetscCall(PetscSFGetGraph(points, &roots, &leaves, &leaf, &root));
  PetscCall(PetscSFComputeDegreeBegin(points, &degree));
  PetscCall(PetscSFComputeDegreeEnd(points, &degree));
  PetscCall(PetscMalloc1(roots, &place));
  for (PetscInt p = 0; p < roots; p++) place[p] = p >= m && degree[p] ? 0 : -1;
  for (PetscInt k = 0; k < leaves; k++) place[leaf ? leaf[k] : k] = 0;
  for (PetscInt p = m; p < roots; p++) structure->shared += place[p] < 0 ? 0 : 1;
  PetscCall(PetscMalloc1(structure->shared, &structure->shared_vertex));
  for (PetscInt p = m, n = 0; p < roots; p++) {
    if (place[p] < 0) continue;
    place[p]                      = n;
    structure->shared_vertex[n++] = p - m;
  }
  PetscCall(PetscMalloc2(leaves, &to, leaves, &own));
  for (PetscInt k = 0; k < leaves; k++) own[k] = place[leaf ? leaf[k] : k];
  PetscCall(LatinSFBcast_Private(points, 1, MPIU_INT, place, place));
  for (PetscInt k = 0; k < leaves; k++) {
    to[k].rank  = root[k].rank;
    to[k].index = place[leaf ? leaf[k] : k];
  }
  PetscCall(PetscSFCreate(comm, &structure->shared_sf));
  PetscCall(PetscSFSetGraph(structure->shared_sf, structure->shared, leaves, own, PETSC_COPY_VALUES, to, PETSC_COPY_VALUES));
  PetscCall(PetscFree2(to, own));
  PetscCall(PetscFree(place));
  PetscFunctionReturn(0);
}

/* Computes the unit vectors of links from the coordinates of their nodes; zero if both are at the same point. Collective on structure */
PetscErrorCode LatinStructureDirections_Private(LatinStructure structure)
{
  const PetscInt     m = structure->links_local, dim = structure->dim;
  Vec                coordinates;
  const PetscScalar *x;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(structure->direction, dim * m));
  PetscCall(DMGetCoordinatesLocal(structure->dm, &coordinates));
  PetscCall(VecGetArrayRead(coordinates, &x));
  for (PetscInt l = 0; l < m; l++) {
    PetscReal v[3] = {0.0, 0.0, 0.0};

    for (PetscInt c = 0; c < dim; c++) v[c] = x[dim * structure->ends[2 * l + 1] + c] - x[dim * structure->ends[2 * l] + c];
    (void)LatinUnitVector(dim, v, structure->direction + dim * l);
  }
  PetscCall(VecRestoreArrayRead(coordinates, &x));
  PetscFunctionReturn(0);
}

/* Part 1 of the set-up: creates the DM from nodes and links. Collective on structure */
PetscErrorCode LatinStructureCreateMesh_Private(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCreatePlex_Private(structure));
  PetscCall(PetscObjectSetName((PetscObject)structure->dm, "structure"));
  PetscCall(DMPlexReorderSetDefault(structure->dm, 0)); /* vertices keep their numbers; 0: never, by a name that depends on PETSc's version */
  PetscCall(LatinStructureDirections_Private(structure));
  PetscCall(LatinStructureShared_Private(structure));
  PetscFunctionReturn(0);
}

/* Clones the DM with its sections: each solver needs its own, in which PETSc stores its callbacks. Collective on structure */
PetscErrorCode LatinStructureCloneDM_Private(LatinStructure structure, DM *dm)
{
  PetscSection section;

  PetscFunctionBegin;
  PetscCall(DMClone(structure->dm, dm));
  PetscCall(DMGetLocalSection(structure->dm, &section));
  PetscCall(DMSetLocalSection(*dm, section));
  PetscCall(DMCreateDS(*dm));
  PetscCall(DMGetGlobalSection(structure->dm, &section));
  PetscCall(DMSetGlobalSection(*dm, section)); /* else PETSc would create it again */
  PetscFunctionReturn(0);
}

/* Composes a pointer to the structure on its DM, without a reference: the structure owns the DM */
PetscErrorCode LatinStructureComposeDM_Private(LatinStructure structure)
{
  PetscContainer container;

  PetscFunctionBegin;
  PetscCall(PetscContainerCreate(PetscObjectComm((PetscObject)structure), &container));
  PetscCall(PetscContainerSetPointer(container, structure));
  PetscCall(PetscObjectCompose((PetscObject)structure->dm, "LatinStructure", (PetscObject)container));
  PetscCall(PetscContainerDestroy(&container));
  PetscFunctionReturn(0);
}

/* Sets the n constrained components of a point. PetscSectionSetConstraintIndices() of PETSc 3.18 takes another point if the chart does not begin at 0 */
static PetscErrorCode LatinSectionConstrain_Private(PetscSection section, PetscInt point, PetscInt n, const PetscInt list[])
{
  const PetscInt *of_point, *of_field;

  PetscFunctionBegin;
  if (!n) PetscFunctionReturn(0);
  PetscCall(PetscSectionGetConstraintIndices(section, point, &of_point));
  PetscCall(PetscSectionGetFieldConstraintIndices(section, point, 0, &of_field));
  PetscCall(PetscArraycpy((PetscInt *)of_point, list, n));
  PetscCall(PetscArraycpy((PetscInt *)of_field, list, n));
  PetscFunctionReturn(0);
}

/* Creates the section of displacements at the vertices, the last points of the DM. vfixed: [vertices][dim] prescribed components. Collective on structure */
static PetscErrorCode LatinStructureCreateSection_Private(LatinStructure structure, const PetscBool vfixed[])
{
  const PetscInt dim = structure->dim, vstart = structure->links_local;
  PetscSection   section;

  PetscFunctionBegin;
  PetscCall(PetscSectionCreate(PetscObjectComm((PetscObject)structure), &section));
  PetscCall(PetscSectionSetNumFields(section, 1));
  PetscCall(PetscSectionSetFieldName(section, 0, "displacement"));
  PetscCall(PetscSectionSetFieldComponents(section, 0, dim));
  PetscCall(PetscSectionSetChart(section, vstart, vstart + structure->vertices)); /* without links: they have no dofs */
  for (PetscInt v = 0; v < structure->vertices; v++) {
    PetscInt constrained = 0;

    for (PetscInt c = 0; c < dim; c++) constrained += vfixed[dim * v + c] ? 1 : 0;
    PetscCall(PetscSectionSetDof(section, vstart + v, dim));
    PetscCall(PetscSectionSetFieldDof(section, vstart + v, 0, dim));
    PetscCall(PetscSectionSetConstraintDof(section, vstart + v, constrained));
    PetscCall(PetscSectionSetFieldConstraintDof(section, vstart + v, 0, constrained));
  }
  PetscCall(PetscSectionSetUp(section));
  for (PetscInt v = 0; v < structure->vertices; v++) {
    PetscInt list[3], n = 0;

    for (PetscInt c = 0; c < dim; c++)
      if (vfixed[dim * v + c]) list[n++] = c;
    PetscCall(LatinSectionConstrain_Private(section, vstart + v, n, list));
  }
  PetscCall(DMSetLocalSection(structure->dm, section));
  PetscCall(DMCreateDS(structure->dm)); /* SNES needs one in later versions of PETSc */
  PetscCall(PetscSectionDestroy(&section));
  PetscFunctionReturn(0);
}

/* Checks that nodes without links are fixed or have a mass ([nodes_local], or NULL); sets structure->free_unlinked. Collective on structure */
PetscErrorCode LatinStructureCheckUnlinked_Private(LatinStructure structure, const PetscReal mass[])
{
  const PetscInt     dim = structure->dim;
  const PetscSFNode *root;
  PetscInt           leaves, first[2] = {PETSC_MAX_INT, PETSC_MAX_INT}; /* first free component; first one without mass */

  PetscFunctionBegin;
  PetscCall(PetscSFGetGraph(structure->vertex_sf, NULL, &leaves, NULL, &root));
  for (PetscInt k = dim * (leaves - structure->unlinked); k < dim * leaves; k++) {
    const PetscInt i = (PetscInt)root[k / dim].index, dof = dim * (structure->nodes_start + i) + k % dim;

    if (structure->fixed[dim * i + k % dim]) continue;
    first[0] = PetscMin(first[0], dof);
    if (!mass || !(mass[i] > 0.0)) first[1] = PetscMin(first[1], dof);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, first, 2, MPIU_INT, MPI_MIN, PetscObjectComm((PetscObject)structure)));
  PetscCheck(first[1] == PETSC_MAX_INT, PetscObjectComm((PetscObject)structure), PETSC_ERR_ARG_WRONGSTATE, "Node %" PetscInt_FMT " is free along %c but no link reaches it; remove it, prescribe its displacement, or, for a motion, give it a mass",
             first[1] / dim, "xyz"[first[1] % dim]);
  structure->free_unlinked = first[0] == PETSC_MAX_INT ? -1 : first[0];
  PetscFunctionReturn(0);
}

/* Checks that, in statics, no node without links is free. Collective on structure */
PetscErrorCode LatinStructureCheckFreeUnlinked_Private(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscCheck(structure->ground || structure->free_unlinked < 0, PetscObjectComm((PetscObject)structure), PETSC_ERR_ARG_WRONGSTATE,
             "Node %" PetscInt_FMT " is free along %c but no link reaches it; remove it or prescribe its displacement: a mass holds it in a motion (TS) only", structure->free_unlinked / structure->dim,
             "xyz"[structure->free_unlinked % structure->dim]);
  PetscFunctionReturn(0);
}

/* Part 2 of the set-up. Collective on structure */
static PetscErrorCode LatinStructureSetUp_Private(LatinStructure structure)
{
  const PetscInt         dim = structure->dim, n = dim * structure->nodes_local;
  MPI_Comm               comm = PetscObjectComm((PetscObject)structure);
  PetscInt               soft = -1, point = -1;
  PetscBool             *vfixed;
  const PetscInt        *vdof;
  ISLocalToGlobalMapping map;

  PetscFunctionBegin;
  for (PetscInt l = structure->links_local - 1; l >= 0; l--) {
    PetscReal unit[3];

    if (!(structure->stiffness[l] > 0.0) && !LatinLaws[structure->law[l]].rigid) soft = l;
    if (!LatinUnitVector(dim, structure->direction + dim * l, unit)) point = l;
  }
  LatinAgree(comm, soft >= 0, PETSC_ERR_ORDER, "Link %" PetscInt_FMT " has no stiffness: call LatinStructureSetLaws() before LatinStructureSetUp()", structure->links_start + soft);
  LatinAgree(comm, point >= 0, PETSC_ERR_ARG_WRONG, "Link %" PetscInt_FMT " has no length: its nodes %" PetscInt_FMT " and %" PetscInt_FMT " lie at the same point; merge the nodes, remove the link, or, for a contact, give its direction",
             structure->links_start + point, structure->nodes[2 * point], structure->nodes[2 * point + 1]);
  PetscCall(LatinStructureCheckUnlinked_Private(structure, structure->mass));
  PetscCall(LatinStructureCheckContacts_Private(structure));
  PetscCall(LatinTurningSetUp_Private(structure));
  PetscCall(PetscMalloc1(dim * structure->vertices, &vfixed));
  PetscCall(PetscMalloc1(dim * structure->vertices, &structure->vertex_prescribed));
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, dim, LATIN_MPI_BOOL, structure->fixed, vfixed));
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, dim, MPIU_REAL, structure->prescribed, structure->vertex_prescribed));
  PetscCall(LatinStructureCreateSection_Private(structure, vfixed));
  PetscCall(PetscFree(vfixed));

  /* global_dof: numbers of free dofs at the caller's nodes; all copies of a vertex have the same numbers */
  for (PetscInt i = 0; i < n; i++) structure->global_dof[i] = -1;
  PetscCall(DMGetLocalToGlobalMapping(structure->dm, &map));
  PetscCall(ISLocalToGlobalMappingGetIndices(map, &vdof));
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, dim, MPIU_INT, vdof, structure->global_dof, MPI_REPLACE));
  PetscCall(ISLocalToGlobalMappingRestoreIndices(map, &vdof));
  PetscCall(LatinSFFresh_Private(&structure->vertex_sf));
  PetscCall(DMCreateGlobalVector(structure->dm, &structure->load));
  PetscCall(LatinStructureNodalVec_Private(structure, structure->force, structure->load));
  PetscCall(LatinStructureComposeDM_Private(structure));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetUp - Sets up the DM of a structure, after laws, supports and loads.

  Collective on structure

  Level: beginner

  Note:
  Raises `PETSC_ERR_ARG_WRONGSTATE` on every rank for a node with a free displacement, without links and without mass. A node with
  a mass moves freely in a motion; solvers of statics refuse it.

.seealso: `LatinStructureCreate()`, `LatinStructureSetLaws()`, `LatinStructureSetSupports()`, `LatinStructureSetLoads()`, `LatinStructureAttachSNES()`
@*/
PetscErrorCode LatinStructureSetUp(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  if (structure->set_up) PetscFunctionReturn(0);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureSetUp_Private(structure));
  structure->set_up = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetDM - Gets the DMPLEX of a structure; its global vectors contain the free displacement components.

  Not collective; the reference is borrowed

  Input Parameter:
. structure - set up

  Output Parameter:
. dm - its DM

  Level: beginner

.seealso: `LatinStructureSetUp()`, `LatinStructureAttachSNES()`
@*/
PetscErrorCode LatinStructureGetDM(LatinStructure structure, DM *dm)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscAssertPointer(dm, 2);
  *dm = structure->dm;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetSizes - Gets the dimension and the numbers, over all ranks, of nodes, links and free degrees of freedom.

  Not collective

  Input Parameter:
. structure - set up

  Output Parameters:
+ dim       - displacement components of a node, or NULL
. nodes     - nodes of all ranks, or NULL
. nlinks    - links of all ranks, or NULL
- free_dofs - displacement components of all ranks that are not prescribed, or NULL

  Level: beginner

.seealso: `LatinStructureGetDM()`
@*/
PetscErrorCode LatinStructureGetSizes(LatinStructure structure, PetscInt *dim, PetscInt *nodes, PetscInt *nlinks, PetscInt *free_dofs)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckSetUp_Private(structure));
  if (dim) *dim = structure->dim;
  if (nodes) *nodes = structure->nodes_global;
  if (nlinks) *nlinks = structure->links_global;
  if (free_dofs) PetscCall(VecGetSize(structure->load, free_dofs));
  PetscFunctionReturn(0);
}
