#include "latinimpl.h"

/*
   What a structure gives a solver: its DM, nodal unbalance (1) and the derivative of it.
*/

static PetscErrorCode LatinLinksCheckSetUp_Private(LatinLinks links)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  PetscCheck(links->set_up, PetscObjectComm((PetscObject)links), PETSC_ERR_ORDER, "The structure is not set up: call LatinLinksSetUp() after laws, supports and loads");
  PetscFunctionReturn(0);
}

/* A displacement must be a vector of the structure's DM: its entries are addressed directly */
PetscErrorCode LatinLinksCheckVec_Private(LatinLinks links, Vec u)
{
  PetscInt n, m, all, whole;

  PetscFunctionBegin;
  PetscCall(LatinLinksCheckSetUp_Private(links));
  PetscValidHeaderSpecific(u, VEC_CLASSID, 2);
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetLocalSize(links->load, &m));
  PetscCall(VecGetSize(u, &all));
  PetscCall(VecGetSize(links->load, &whole));
  LatinAgree(PetscObjectComm((PetscObject)links), n != m || all != whole, PETSC_ERR_ARG_SIZ,
             "The vector has %" PetscInt_FMT " entries on a rank where the structure has %" PetscInt_FMT " free degrees of freedom; make it with DMCreateGlobalVector() on the DM of the structure", n, m);
  PetscFunctionReturn(0);
}

/* Values of this rank's nodes, [nodes_local][dim], at the free degrees of freedom of a DM global vector; each node's owner in the caller's numbering knows its entries */
PetscErrorCode LatinLinksNodalVec_Private(LatinLinks links, const PetscReal values[], Vec v)
{
  PetscFunctionBegin;
  PetscCall(VecSetOption(v, VEC_IGNORE_NEGATIVE_INDICES, PETSC_TRUE));
  PetscCall(VecSetValues(v, links->nodes_local * links->dim, links->global_dof, values, INSERT_VALUES));
  PetscCall(VecAssemblyBegin(v));
  PetscCall(VecAssemblyEnd(v));
  PetscFunctionReturn(0);
}

/* F at the free degrees of freedom */
PetscErrorCode LatinLinksLoadVec_Private(LatinLinks links)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksNodalVec_Private(links, links->force, links->load));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksCreateSection_Private(LatinLinks links, const PetscBool vfixed[], PetscInt vstart)
{
  const PetscInt dim = links->dim;
  PetscSection   section;

  PetscFunctionBegin;
  PetscCall(PetscSectionCreate(PetscObjectComm((PetscObject)links), &section));
  PetscCall(PetscSectionSetNumFields(section, 1));
  PetscCall(PetscSectionSetFieldName(section, 0, "displacement"));
  PetscCall(PetscSectionSetFieldComponents(section, 0, dim));
  PetscCall(PetscSectionSetChart(section, 0, vstart + links->vertices));
  for (PetscInt v = 0; v < links->vertices; v++) {
    PetscInt constrained = 0;

    for (PetscInt c = 0; c < dim; c++) constrained += vfixed[dim * v + c] ? 1 : 0;
    PetscCall(PetscSectionSetDof(section, vstart + v, dim));
    PetscCall(PetscSectionSetFieldDof(section, vstart + v, 0, dim));
    PetscCall(PetscSectionSetConstraintDof(section, vstart + v, constrained));
    PetscCall(PetscSectionSetFieldConstraintDof(section, vstart + v, 0, constrained));
  }
  PetscCall(PetscSectionSetUp(section));
  for (PetscInt v = 0; v < links->vertices; v++) {
    PetscInt list[3], n = 0;

    for (PetscInt c = 0; c < dim; c++)
      if (vfixed[dim * v + c]) list[n++] = c;
    PetscCall(PetscSectionSetConstraintIndices(section, vstart + v, list));
    PetscCall(PetscSectionSetFieldConstraintIndices(section, vstart + v, 0, list));
  }
  PetscCall(DMSetLocalSection(links->dm, section));
  PetscCall(DMCreateDS(links->dm)); /* SNES asks for one in later versions of PETSc */
  PetscCall(PetscSectionDestroy(&section));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksSetUp_Private(LatinLinks links)
{
  PetscInt     dim, n, vstart, vend, bad = -1;
  PetscBool   *vfixed;
  PetscInt    *vdof;
  PetscSection global;

  PetscFunctionBegin;
  dim = links->dim;
  n   = links->nodes_local * dim;
  for (PetscInt l = 0; l < links->links_local && bad < 0; l++)
    if (!(links->stiffness[l] > 0.0) && !LatinLaws[links->law[l]].rigid) bad = l;
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_ORDER, "Link %" PetscInt_FMT " has no stiffness: call LatinLinksSetLaws() before LatinLinksSetUp()", links->links_start + bad);
  bad = -1;
  for (PetscInt l = 0; l < links->links_local && bad < 0; l++) {
    PetscReal unit[3];

    if (!LatinUnitVector(dim, links->direction + dim * l, unit)) bad = l;
  }
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_ARG_WRONG,
             "Link %" PetscInt_FMT " has no length: its nodes %" PetscInt_FMT " and %" PetscInt_FMT " lie at the same point; merge the nodes, remove the link, or, for a contact, give its direction with LatinLinksSetDirections()",
             links->links_start + bad, links->nodes[2 * bad], links->nodes[2 * bad + 1]);
  PetscCall(LatinLinksSetUpRigid_Private(links));
  PetscCall(DMPlexGetDepthStratum(links->dm, 0, &vstart, &vend));
  if (!links->vertices) vstart = 0;
  PetscCall(PetscMalloc2(dim * links->vertices, &vfixed, dim * links->vertices, &vdof));
  PetscCall(PetscMalloc1(dim * links->vertices, &links->vertex_prescribed));
  PetscCall(LatinSFBcast_Private(links->vertex_sf, dim, LATIN_MPI_BOOL, links->fixed, vfixed));
  PetscCall(LatinSFBcast_Private(links->vertex_sf, dim, MPIU_REAL, links->prescribed, links->vertex_prescribed));
  PetscCall(LatinLinksCreateSection_Private(links, vfixed, vstart));

  /* numbers of the free degrees of freedom, brought to the caller's nodes; all copies of a vertex agree on them */
  PetscCall(DMGetGlobalSection(links->dm, &global));
  for (PetscInt v = 0; v < links->vertices; v++) {
    PetscInt offset, k = 0;

    PetscCall(PetscSectionGetOffset(global, vstart + v, &offset));
    if (offset < 0) offset = -(offset + 1);
    for (PetscInt c = 0; c < dim; c++) vdof[dim * v + c] = vfixed[dim * v + c] ? -1 : offset + k++;
  }
  PetscCall(PetscMalloc1(n, &links->global_dof));
  for (PetscInt i = 0; i < n; i++) links->global_dof[i] = -1;
  PetscCall(LatinSFReduce_Private(links->vertex_sf, dim, MPIU_INT, vdof, links->global_dof, MPI_REPLACE));
  PetscCall(PetscFree2(vfixed, vdof));
  bad = -1;
  for (PetscInt i = 0; i < n && bad < 0; i++)
    if (!links->fixed[i] && links->global_dof[i] < 0) bad = i;
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_ARG_WRONGSTATE, "Node %" PetscInt_FMT " is free in direction %" PetscInt_FMT " but no link reaches it; remove it or prescribe its displacement", links->nodes_start + bad / dim,
             bad % dim);
  PetscCall(DMCreateGlobalVector(links->dm, &links->load));
  PetscCall(LatinLinksLoadVec_Private(links));
  PetscCall(LatinLinksKnowDM_Private(links));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetUp - Prepares the DM of a structure once laws, supports and loads are given.

  Collective on links

  Level: beginner

  Note:
  Raises `PETSC_ERR_ARG_WRONGSTATE` for a node with a free displacement that no link reaches, on every rank.
@*/
PetscErrorCode LatinLinksSetUp(LatinLinks links)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  if (links->set_up) PetscFunctionReturn(0);
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksSetUp_Private(links));
  links->set_up = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* The DM knows the structure without owning it: the structure owns the DM */
PetscErrorCode LatinLinksKnowDM_Private(LatinLinks links)
{
  PetscContainer container;

  PetscFunctionBegin;
  PetscCall(PetscContainerCreate(PetscObjectComm((PetscObject)links), &container));
  PetscCall(PetscContainerSetPointer(container, links));
  PetscCall(PetscObjectCompose((PetscObject)links->dm, "LatinLinks", (PetscObject)container));
  PetscCall(PetscContainerDestroy(&container));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLinksFromDM_Private(DM dm, LatinLinks *links)
{
  PetscContainer container;

  PetscFunctionBegin;
  *links = NULL;
  if (!dm) PetscFunctionReturn(0);
  PetscCall(PetscObjectQuery((PetscObject)dm, "LatinLinks", (PetscObject *)&container));
  if (container) PetscCall(PetscContainerGetPointer(container, (void **)links));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksGetDM - The DMPLEX of a structure, whose global vectors hold the free displacement components.

  Not collective; the reference is borrowed

  Level: beginner
@*/
PetscErrorCode LatinLinksGetDM(LatinLinks links, DM *dm)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  *dm = links->dm;
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksGetSizes - Dimension, numbers of nodes and links over all ranks, and of free degrees of freedom.

  Not collective

  Level: beginner
@*/
PetscErrorCode LatinLinksGetSizes(LatinLinks links, PetscInt *dim, PetscInt *nodes, PetscInt *nlinks, PetscInt *free_dofs)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckSetUp_Private(links));
  if (dim) *dim = links->dim;
  if (nodes) *nodes = links->nodes_global;
  if (nlinks) *nlinks = links->links_global;
  if (free_dofs) PetscCall(VecGetSize(links->load, free_dofs));
  PetscFunctionReturn(0);
}

/* Displacements of the DM's vertices, the prescribed ones included */
PetscErrorCode LatinLinksGetLocal_Private(LatinLinks links, Vec u, Vec local)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayWrite(local, &a));
  PetscCall(PetscArraycpy(a, links->vertex_prescribed, links->vertices * links->dim));
  PetscCall(VecRestoreArrayWrite(local, &a));
  PetscCall(DMGlobalToLocalBegin(links->dm, u, INSERT_VALUES, local));
  PetscCall(DMGlobalToLocalEnd(links->dm, u, INSERT_VALUES, local));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksComputeResidual_Private(LatinLinks links, Vec u, Vec r)
{
  Vec                ul, rl;
  const PetscScalar *a;
  PetscScalar       *f;
  PetscInt           dim;

  PetscFunctionBegin;
  dim = links->dim;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(DMGetLocalVector(links->dm, &rl));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecZeroEntries(rl));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArray(rl, &f));
  for (PetscInt l = 0; l < links->links_local; l++) LatinLinksAddForce(links, l, LatinLinksTension(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l]), f);
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(VecRestoreArray(rl, &f));
  PetscCall(VecCopy(links->load, r));
  PetscCall(VecScale(r, -1.0));
  if (links->ground) PetscCall(LatinLinksAddGround_Private(links, u, r));
  PetscCall(DMLocalToGlobalBegin(links->dm, rl, ADD_VALUES, r));
  PetscCall(DMLocalToGlobalEnd(links->dm, rl, ADD_VALUES, r));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(DMRestoreLocalVector(links->dm, &rl));
  PetscCall(PetscLogFlops(links->links_local * (5.0 * dim + 4.0)));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksComputeResidual - The nodal unbalance B^t tau - F at the free degrees of freedom, (1).

  Collective on links

  Input Parameters:
+ links - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. r - unbalance, a DM global vector

  Level: intermediate

  Note:
  Tensions of links of a rigid law are no function of the displacements: they are those of the last solve by SNES latin.
@*/
PetscErrorCode LatinLinksComputeResidual(LatinLinks links, Vec u, Vec r)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksComputeResidual_Private(links, u, r));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksComputeJacobian_Private(LatinLinks links, Vec u, Mat J)
{
  ISLocalToGlobalMapping map;
  PetscInt               n, m;
  Vec                    ul;
  const PetscScalar     *a;
  PetscInt               dim;

  PetscFunctionBegin;
  PetscCall(LatinLinksCheckRigid_Private(links, "The tangent stiffness, that is Newton's method,"));
  PetscCall(MatGetLocalToGlobalMapping(J, &map, NULL));
  PetscCall(MatGetSize(J, &n, NULL));
  PetscCall(VecGetSize(links->load, &m));
  PetscCheck(map && n == m, PetscObjectComm((PetscObject)links), PETSC_ERR_ARG_WRONG, "The matrix does not belong to this structure: make it with DMCreateMatrix() on its DM");
  dim = links->dim;
  if (!links->tangent) PetscCall(PetscMalloc1(links->links_local, &links->tangent));
  PetscCall(MatZeroEntries(J));
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal  x = LatinLinksElongation(links, l, a) + links->prestrain[l];
    const PetscReal  k = LatinLinksTangent(links, l, x);
    const PetscReal *n = links->direction + dim * l;
    PetscInt         row[6];
    PetscScalar      block[36];

    links->tangent[l] = k;
    for (PetscInt c = 0; c < dim; c++) {
      row[c]       = dim * links->ends[2 * l] + c;
      row[dim + c] = dim * links->ends[2 * l + 1] + c;
      for (PetscInt b = 0; b < dim; b++) {
        const PetscScalar v = k * n[c] * n[b];

        block[c * 2 * dim + b]               = v;
        block[c * 2 * dim + dim + b]         = -v;
        block[(dim + c) * 2 * dim + b]       = -v;
        block[(dim + c) * 2 * dim + dim + b] = v;
      }
    }
    PetscCall(MatSetValuesLocal(J, 2 * dim, row, 2 * dim, row, block, ADD_VALUES));
  }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  if (links->ground) PetscCall(MatDiagonalSet(J, links->ground, ADD_VALUES));
  PetscCall(MatSetOption(J, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(J, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksComputeJacobian - The generalised derivative B^t k_t B of the unbalance, k_t the tangent stiffness of each link.

  Collective on links

  Input Parameters:
+ links - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. J - a matrix from `DMCreateMatrix()`: AIJ, or MATIS after -dm_mat_type is

  Level: intermediate
@*/
PetscErrorCode LatinLinksComputeJacobian(LatinLinks links, Vec u, Mat J)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksComputeJacobian_Private(links, u, J));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksFunction_SNES(SNES snes, Vec u, Vec r, void *ctx)
{
  LatinLinks links = (LatinLinks)ctx;
  PetscBool  islatin;

  PetscFunctionBegin;
  if (links->rigid_law >= 0) { /* the residual that only SNES latin makes small */
    PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESLATIN, &islatin));
    if (!islatin) PetscCall(LatinLinksCheckRigid_Private(links, ((PetscObject)snes)->type_name ? ((PetscObject)snes)->type_name : "SNES"));
  }
  PetscCall(LatinLinksComputeResidual(links, u, r));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksJacobian_SNES(SNES snes, Vec u, Mat J, Mat P, void *ctx)
{
  (void)snes;
  PetscFunctionBegin;
  PetscCall(LatinLinksComputeJacobian((LatinLinks)ctx, u, P));
  if (J != P) {
    PetscCall(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksObjective_SNES(SNES snes, Vec u, PetscReal *energy, void *ctx)
{
  (void)snes;
  return LatinLinksComputeEnergy((LatinLinks)ctx, u, energy);
}

/*@C
  LatinLinksAttachSNES - Gives a SNES the DM, the residual, the Jacobian and the energy of a structure.

  Collective on snes; the SNES keeps the structure alive. Another structure in the place of one resets the SNES

  Level: beginner

  Note:
  Any SNES type then solves the same object: `-snes_type latin`, or `-snes_type newtonls` with any `-pc_type`.
@*/
PetscErrorCode LatinLinksAttachSNES(LatinLinks links, SNES snes)
{
  LatinLinks before;

  PetscFunctionBegin;
  PetscCall(LatinLinksCheckSetUp_Private(links));
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 2);
  PetscCall(PetscObjectQuery((PetscObject)snes, "LatinLinks", (PetscObject *)&before));
  if (before && before != links) PetscCall(SNESReset(snes)); /* it is set up for another structure */
  PetscCall(SNESSetDM(snes, links->dm));
  PetscCall(SNESSetFunction(snes, NULL, LatinLinksFunction_SNES, links));
  PetscCall(SNESSetJacobian(snes, NULL, NULL, LatinLinksJacobian_SNES, links));
  PetscCall(SNESSetObjective(snes, LatinLinksObjective_SNES, links));
  PetscCall(PetscObjectCompose((PetscObject)snes, "LatinLinks", (PetscObject)links));
  PetscFunctionReturn(0);
}
