#include "latinimpl.h"

/*
   Structures of section 2.1: a DMPLEX of one-dimensional cells, the laws of the links, supports and loads.
   The caller's nodes and links keep the caller's numbering; the DM's vertices are reached through vertex_sf.
*/

static PetscErrorCode LatinLinksView_Private(LatinLinks links, PetscViewer viewer)
{
  PetscBool ascii;
  PetscInt  free_dofs = 0;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  if (links->load) PetscCall(VecGetSize(links->load, &free_dofs));
  PetscCall(PetscViewerASCIIPrintf(viewer, "structure: %" PetscInt_FMT " nodes in %" PetscInt_FMT "D, %" PetscInt_FMT " links, %" PetscInt_FMT " free degrees of freedom\n", links->nodes_global, links->dim, links->links_global, free_dofs));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksDestroy - Frees a structure.

  Collective on links

  Level: beginner
@*/
PetscErrorCode LatinLinksDestroy(LatinLinks *links)
{
  LatinLinks l;

  PetscFunctionBegin;
  if (!*links) PetscFunctionReturn(0);
  PetscValidHeaderSpecific(*links, LATIN_LINKS_CLASSID, 1);
  l = *links;
  if (--((PetscObject)l)->refct > 0) {
    *links = NULL;
    PetscFunctionReturn(0);
  }
  if (l->base) {
    PetscCall(LatinStepDestroy_Private(l));
    PetscCall(PetscHeaderDestroy(links));
    PetscFunctionReturn(0);
  }
  PetscCall(PetscFree4(l->x, l->prescribed, l->force, l->fixed));
  PetscCall(PetscFree(l->mass));
  PetscCall(VecDestroy(&l->inertia));
  PetscCall(PetscFree(l->global_dof));
  PetscCall(PetscFree5(l->nodes, l->law, l->stiffness, l->prestrain, l->direction));
  PetscCall(PetscFree(l->tangent));
  PetscCall(PetscFree(l->friction));
  PetscCall(PetscFree(l->multiplier));
  PetscCall(PetscFree(l->tuned));
  PetscCall(PetscFree(l->subdomain));
  PetscCall(PetscFree(l->ends));
  PetscCall(PetscFree(l->vertex_prescribed));
  PetscCall(PetscSFDestroy(&l->vertex_sf));
  PetscCall(VecDestroy(&l->load));
  if (l->dm) PetscCall(PetscObjectCompose((PetscObject)l->dm, "LatinLinks", NULL)); /* others may hold the DM */
  PetscCall(DMDestroy(&l->dm));
  PetscCall(PetscHeaderDestroy(links));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksReference - Counts one more owner of a structure; each calls `LatinLinksDestroy()` once.

  Not collective

  Level: advanced
@*/
PetscErrorCode LatinLinksReference(LatinLinks links)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  PetscCall(PetscObjectReference((PetscObject)links));
  PetscFunctionReturn(0);
}

/* False, and nothing is written, for a vector without length. Scaled, so that no unit of length overflows or underflows */
PetscBool LatinUnitVector(PetscInt dim, const PetscReal v[], PetscReal unit[])
{
  PetscReal scale = 0.0, length = 0.0;

  for (PetscInt c = 0; c < dim; c++) scale = PetscMax(scale, PetscAbsReal(v[c]));
  if (!(scale > 0.0)) return PETSC_FALSE;
  for (PetscInt c = 0; c < dim; c++) length += PetscSqr(v[c] / scale);
  length = PetscSqrtReal(length);
  for (PetscInt c = 0; c < dim; c++) unit[c] = v[c] / scale / length;
  return PETSC_TRUE;
}

/* Unit vectors of the links, zero for nodes at one place; the coordinates of the end nodes come through the DM's vertices */
static PetscErrorCode LatinLinksComputeDirections_Private(LatinLinks links)
{
  const PetscInt dim = links->dim;
  PetscReal     *vx;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(links->vertices * dim, &vx));
  PetscCall(LatinSFBcast_Private(links->vertex_sf, dim, MPIU_REAL, links->x, vx));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal *xa = vx + dim * links->ends[2 * l], *xb = vx + dim * links->ends[2 * l + 1];
    PetscReal        v[3] = {0.0, 0.0, 0.0};

    for (PetscInt c = 0; c < dim; c++) v[c] = xb[c] - xa[c];
    (void)LatinUnitVector(dim, v, links->direction + dim * l);
  }
  PetscCall(PetscFree(vx));
  PetscFunctionReturn(0);
}

/* The DM and where its vertices find their nodes; nodes without link are no vertices */
static PetscErrorCode LatinLinksCreateMesh_Private(LatinLinks links, MPI_Comm comm)
{
  PetscBool  *used, whole = PETSC_TRUE;
  PetscMPIInt size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscCalloc1(links->nodes_local, &used));
  for (PetscInt i = 0; i < 2 * links->links_local && size == 1; i++) used[links->nodes[i]] = PETSC_TRUE;
  for (PetscInt i = 0; i < links->nodes_local && whole; i++) whole = used[i];
  PetscCall(PetscFree(used));
  if (size > 1 || !whole) {
    PetscCall(DMPlexCreateFromCellListParallelPetsc(comm, 1, links->links_local, links->nodes_local, links->nodes_global, 2, PETSC_FALSE, links->nodes, links->dim, links->x, &links->vertex_sf, NULL, &links->dm));
    PetscFunctionReturn(0);
  }
  /* one rank, and every node is a vertex: no search */
  PetscCall(DMPlexCreateFromCellListPetsc(comm, 1, links->links_local, links->nodes_local, 2, PETSC_FALSE, links->nodes, links->dim, links->x, &links->dm));
  PetscCall(PetscSFCreate(comm, &links->vertex_sf));
  {
    PetscSFNode *remote;

    PetscCall(PetscMalloc1(links->nodes_local, &remote));
    for (PetscInt i = 0; i < links->nodes_local; i++) {
      remote[i].rank  = 0;
      remote[i].index = i;
    }
    PetscCall(PetscSFSetGraph(links->vertex_sf, links->nodes_local, links->nodes_local, NULL, PETSC_OWN_POINTER, remote, PETSC_OWN_POINTER));
  }
  PetscFunctionReturn(0);
}

/* The arrays and the mesh of a new structure of known sizes */
static PetscErrorCode LatinLinksFill_Private(LatinLinks l, MPI_Comm comm, const PetscReal coordinates[], const PetscInt link_nodes[])
{
  const PetscInt n = l->nodes_local * l->dim, m = l->links_local;
  PetscInt       vstart, vend;
  DM             cdm;

  PetscFunctionBegin;
  PetscCall(PetscCalloc4(n, &l->x, n, &l->prescribed, n, &l->force, n, &l->fixed));
  PetscCall(PetscCalloc5(2 * m, &l->nodes, m, &l->law, m, &l->stiffness, m, &l->prestrain, l->dim * m, &l->direction));
  PetscCall(PetscArraycpy(l->x, coordinates, n));
  PetscCall(PetscArraycpy(l->nodes, link_nodes, 2 * m));

  PetscCall(LatinLinksCreateMesh_Private(l, comm));
  PetscCall(PetscObjectSetName((PetscObject)l->dm, "structure"));
  PetscCall(DMGetCoordinateDM(l->dm, &cdm));
  (void)cdm;
  PetscCall(DMPlexGetDepthStratum(l->dm, 0, &vstart, &vend));
  if (!m) vstart = vend = 0;
  l->vertices = vend - vstart;
  PetscCall(PetscMalloc1(2 * m, &l->ends));
  for (PetscInt i = 0; i < m; i++) {
    const PetscInt *cone;

    PetscCall(DMPlexGetCone(l->dm, i, &cone));
    l->ends[2 * i]     = cone[0] - vstart;
    l->ends[2 * i + 1] = cone[1] - vstart;
  }
  PetscCall(LatinLinksComputeDirections_Private(l));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksCreate_Private(MPI_Comm comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinLinks *newlinks)
{
  LatinLinks l;
  PetscInt   in[2], out[2], start[2], bad = -1, notfinite = -1, self = -1;
  PetscReal  counts[2];

  PetscFunctionBegin;
  PetscCall(LatinInitializePackage());
  LatinAgree(comm, dim < 1 || dim > 3, PETSC_ERR_ARG_OUTOFRANGE, "A structure has 1, 2 or 3 dimensions, not %" PetscInt_FMT, dim);
  counts[0] = nodes_local;
  counts[1] = links_local;
  LatinAgree(comm, nodes_local < 0 || links_local < 0, PETSC_ERR_ARG_OUTOFRANGE, "A rank gives %" PetscInt_FMT " nodes and %" PetscInt_FMT " links; numbers of them are not negative", nodes_local, links_local);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_REAL, MPIU_SUM, comm)); /* sums of integers could overflow */
  PetscCheck(dim * counts[0] <= (PetscReal)PETSC_MAX_INT && PetscMax(dim, 2) * counts[1] <= (PetscReal)PETSC_MAX_INT, comm, PETSC_ERR_ARG_OUTOFRANGE,
             "%.0f nodes and %.0f links in %" PetscInt_FMT "D are more than PETSc's integers of %d bits can number: take a PETSc configured --with-64-bit-indices", (double)counts[0], (double)counts[1], dim, (int)(8 * sizeof(PetscInt)));
  in[0] = nodes_local;
  in[1] = links_local;
  PetscCall(MPIU_Allreduce(in, out, 2, MPIU_INT, MPI_SUM, comm));
  PetscCallMPI(MPI_Scan(in, start, 2, MPIU_INT, MPI_SUM, comm));
  LatinAgree(comm, nodes_global != PETSC_DETERMINE && nodes_global != out[0], PETSC_ERR_ARG_SIZ, "The ranks give %" PetscInt_FMT " nodes in all, not the %" PetscInt_FMT " announced", out[0], nodes_global);
  LatinAgree(comm, out[1] == 0, PETSC_ERR_ARG_SIZ, "The structure has no link: there is nothing to solve");
  for (PetscInt i = 0; i < links_local && bad < 0; i++)
    if (link_nodes[2 * i] < 0 || link_nodes[2 * i] >= out[0] || link_nodes[2 * i + 1] < 0 || link_nodes[2 * i + 1] >= out[0]) bad = i;
  LatinAgree(comm, bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " joins nodes %" PetscInt_FMT " and %" PetscInt_FMT ", but the nodes are numbered from 0 to %" PetscInt_FMT, start[1] - links_local + bad, link_nodes[2 * bad],
             link_nodes[2 * bad + 1], out[0] - 1);
  for (PetscInt i = 0; i < links_local && self < 0; i++)
    if (link_nodes[2 * i] == link_nodes[2 * i + 1]) self = i;
  LatinAgree(comm, self >= 0, PETSC_ERR_ARG_WRONG, "Link %" PetscInt_FMT " joins node %" PetscInt_FMT " to itself; remove it", start[1] - links_local + self, link_nodes[2 * self]);
  for (PetscInt i = 0; i < nodes_local * dim && notfinite < 0; i++)
    if (PetscIsInfOrNanReal(coordinates[i])) notfinite = i;
  LatinAgree(comm, notfinite >= 0, PETSC_ERR_FP, "Node %" PetscInt_FMT " has a coordinate that is not a finite number", start[0] - nodes_local + notfinite / dim);

  PetscCall(PetscHeaderCreate(l, LATIN_LINKS_CLASSID, "LatinLinks", "Structure of links", "Latin", comm, LatinLinksDestroy, LatinLinksView_Private));
  l->dim          = dim;
  l->nodes_local  = nodes_local;
  l->links_local  = links_local;
  l->nodes_global = out[0];
  l->links_global = out[1];
  l->nodes_start  = start[0] - nodes_local;
  l->links_start  = start[1] - links_local;
  l->rigid_law    = -1;
  PetscCall(LatinWatchCreate_Private(PetscObjectComm((PetscObject)l)));
  PetscCall(LatinLinksFill_Private(l, comm, coordinates, link_nodes));
  *newlinks = l;
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksCreate - Creates a structure of nodes joined by links.

  Collective on comm

  Input Parameters:
+ comm         - the communicator
. dim          - number of displacement components of a node: 1, 2 or 3
. nodes_local  - number of nodes given by this rank; the ranks' nodes are numbered one after the other
. nodes_global - number of all nodes, or `PETSC_DETERMINE`
. coordinates  - [nodes_local][dim], a length
. links_local  - number of links given by this rank
- link_nodes   - [links_local][2] numbers of the end nodes, counted from 0 over all ranks

  Output Parameter:
. newlinks - the structure

  Level: beginner

  Notes:
  Raises `PETSC_ERR_ARG_OUTOFRANGE` for a link whose node does not exist and `PETSC_ERR_ARG_WRONG` for a link that
  joins a node to itself, on every rank. A link whose nodes lie at the same point needs `LatinLinksSetDirections()`.

.seealso: `LatinLinksSetLaws()`, `LatinLinksSetDirections()`, `LatinLinksSetSupports()`, `LatinLinksSetLoads()`, `LatinLinksSetUp()`
@*/
PetscErrorCode LatinLinksCreate(MPI_Comm comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinLinks *newlinks)
{
  PetscFunctionBegin;
  PetscAssertPointer(newlinks, 8);
  PetscCall(LatinWatchCreate_Private(comm));
  LatinWatch(comm, LatinLinksCreate_Private(comm, dim, nodes_local, nodes_global, coordinates, links_local, link_nodes, newlinks));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetLaws - Gives each link of this rank its constitutive law (2), (3), (4).

  Collective on links

  Input Parameters:
+ links     - the structure
. law       - [links_local] a `LatinLawType` each, or what `LatinLawRegister()` and `LatinLawRegisterTable()` gave
. stiffness - [links_local] k, force/length, positive; of a rigid law the search parameter l, 0: self-tuned; 0 for the own
  stiffness of a table
- prestrain - [links_local] e0, a length, or NULL for none; k e0 is the tension in the prestressed configuration, and of
  a contact e0 is the gap

  Level: beginner

.seealso: `LatinLinksSetFriction()`, `LatinLinksSetDirections()`, `LatinLawRegister()`
@*/
PetscErrorCode LatinLinksSetLaws(LatinLinks links, const PetscInt law[], const PetscReal stiffness[], const PetscReal prestrain[])
{
  MPI_Comm comm;
  PetscInt badlaw = -1, badk = -1, kinds[3] = {-1, 0, 0};
  char     list[256] = "0 (bar)";
  size_t   length;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  comm = PetscObjectComm((PetscObject)links);
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscBool known = (PetscBool)(law[l] >= 0 && law[l] < LatinLawCount);

    if (badlaw < 0 && !known) badlaw = l;
    if (badk < 0 && (PetscIsInfOrNanReal(stiffness[l]) || (!(stiffness[l] > 0.0) && !(stiffness[l] == 0.0 && known && (LatinLaws[law[l]].rigid || LatinLaws[law[l]].stiffness > 0.0))))) badk = l;
    if (!known) continue;
    if (LatinLaws[law[l]].rigid) kinds[0] = PetscMax(kinds[0], LATIN_LAWS_MAX - law[l]); /* the first in the table speaks for all */
    if (law[l] > LATIN_LAW_STRUT) kinds[1] = 1;
    if (law[l] == LATIN_LAW_FRICTION || law[l] == LATIN_LAW_TANGENT) kinds[2] = 1;
  }
  for (PetscInt i = 1; i < LatinLawCount && badlaw >= 0; i++) {
    PetscCall(PetscStrlen(list, &length));
    PetscCall(PetscSNPrintf(list + length, sizeof(list) - length, ", %" PetscInt_FMT " (%s)", i, LatinLaws[i].name));
  }
  LatinAgree(comm, badlaw >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " has law %" PetscInt_FMT "; the laws are %s", links->links_start + badlaw, law[badlaw], list);
  LatinAgree(comm, badk >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " has stiffness %g; a stiffness is a positive finite number of force/length", links->links_start + badk, (double)stiffness[badk]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, kinds, 3, MPIU_INT, MPI_MAX, comm));
  links->rigid_law = kinds[0] < 0 ? -1 : LATIN_LAWS_MAX - kinds[0];
  links->general   = (PetscBool)(kinds[1] > 0);
  links->rubs      = (PetscBool)(kinds[2] > 0);
  if (links->rubs) PetscCall(LatinLinksCheckContacts_Private(links, law));
  PetscCall(PetscArraycpy(links->law, law, links->links_local));
  for (PetscInt l = 0; l < links->links_local; l++) links->stiffness[l] = stiffness[l] > 0.0 ? stiffness[l] : LatinLaws[law[l]].stiffness;
  PetscCall(PetscFree(links->tangent));
  PetscCall(PetscObjectStateIncrease((PetscObject)links));
  PetscCall(LatinLinksSetPrestrain(links, prestrain));
  if (links->set_up) PetscCall(LatinLinksSetUpRigid_Private(links));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetPrestrain - Changes the prestrains e0 of the links of this rank; no operator is rebuilt for it.

  Collective on links

  Input Parameters:
+ links     - the structure
- prestrain - [links_local] e0, a length, or NULL for none

  Level: intermediate
@*/
PetscErrorCode LatinLinksSetPrestrain(LatinLinks links, const PetscReal prestrain[])
{
  PetscInt bad = -1;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  if (prestrain) {
    for (PetscInt l = 0; l < links->links_local && bad < 0; l++)
      if (PetscIsInfOrNanReal(prestrain[l])) bad = l;
  }
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_FP, "Link %" PetscInt_FMT " has a prestrain that is not a finite number", links->links_start + bad);
  if (prestrain) PetscCall(PetscArraycpy(links->prestrain, prestrain, links->links_local));
  else PetscCall(PetscArrayzero(links->prestrain, links->links_local));
  links->prestrain_state++;
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetSupports - Prescribes displacement components of the nodes of this rank.

  Collective on links; before `LatinLinksSetUp()`

  Input Parameters:
+ links      - the structure
. fixed      - [nodes_local][dim] whether the component is prescribed
- prescribed - [nodes_local][dim] its value, a length, or NULL for zero

  Level: beginner
@*/
PetscErrorCode LatinLinksSetSupports(LatinLinks links, const PetscBool fixed[], const PetscReal prescribed[])
{
  const PetscInt n   = links->nodes_local * links->dim;
  PetscInt       bad = -1;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  LatinAgree(PetscObjectComm((PetscObject)links), links->set_up, PETSC_ERR_ORDER, "Supports must be given before LatinLinksSetUp()");
  for (PetscInt i = 0; i < n && bad < 0; i++)
    if (fixed[i] && prescribed && PetscIsInfOrNanReal(prescribed[i])) bad = i;
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_FP, "Node %" PetscInt_FMT " has a prescribed displacement that is not a finite number", links->nodes_start + bad / links->dim);
  PetscCall(PetscArraycpy(links->fixed, fixed, n));
  for (PetscInt i = 0; i < n; i++) links->prescribed[i] = fixed[i] && prescribed ? prescribed[i] : 0.0;
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetLoads - Sets the external forces F on the nodes of this rank (1).

  Collective on links; may be called again after `LatinLinksSetUp()`, no operator is rebuilt for it

  Input Parameters:
+ links - the structure
- force - [nodes_local][dim], ignored where the displacement is prescribed

  Level: beginner
@*/
PetscErrorCode LatinLinksSetLoads(LatinLinks links, const PetscReal force[])
{
  const PetscInt n   = links->nodes_local * links->dim;
  PetscInt       bad = -1;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  for (PetscInt i = 0; i < n && bad < 0; i++)
    if (PetscIsInfOrNanReal(force[i])) bad = i;
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_FP, "Node %" PetscInt_FMT " has a load that is not a finite number", links->nodes_start + bad / links->dim);
  PetscCall(PetscArraycpy(links->force, force, n));
  links->load_state++;
  if (links->set_up) PetscCall(LatinLinksLoadVec_Private(links));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetSubdomains - Gives the partition of the links instead of leaving it to METIS.

  Collective on links

  Input Parameters:
+ links     - the structure
- subdomain - [links_local] number of each link's subdomain, counted from 0 without gaps over all ranks, or on all ranks that have links NULL for METIS

  Level: intermediate

  Note:
  A DMLabel named "subdomain" on the DM, with a value for every link, serves the same purpose.
@*/
PetscErrorCode LatinLinksSetSubdomains(LatinLinks links, const PetscInt subdomain[])
{
  MPI_Comm comm;
  PetscInt bad = -1, last = -1, some[2] = {0, 0}; /* ranks that give subdomains, and that give none, to links that they have */

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  comm = PetscObjectComm((PetscObject)links);
  if (links->links_local) some[subdomain ? 0 : 1] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, some, 2, MPIU_INT, MPI_MAX, comm));
  PetscCheck(!some[0] || !some[1], comm, PETSC_ERR_ARG_NULL, "Some ranks give their links subdomains and others give NULL: all give them, or none does");
  PetscCall(PetscFree(links->subdomain));
  links->subdomain_count = 0;
  PetscCall(PetscObjectStateIncrease((PetscObject)links));
  if (!some[0]) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < links->links_local; l++) {
    if (bad < 0 && (subdomain[l] < 0 || subdomain[l] >= links->links_global)) bad = l;
    last = PetscMax(last, subdomain[l]);
  }
  LatinAgree(comm, bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " is in subdomain %" PetscInt_FMT "; subdomains are numbered from 0, and there are at most as many as links (%" PetscInt_FMT ")", links->links_start + bad, subdomain[bad],
             links->links_global);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &last, 1, MPIU_INT, MPI_MAX, comm));
  PetscCall(PetscMalloc1(links->links_local, &links->subdomain));
  PetscCall(PetscArraycpy(links->subdomain, subdomain, links->links_local));
  links->subdomain_count = last + 1;
  PetscFunctionReturn(0);
}
