#include "structure/structureimpl.h"

/* Vectors of a structure: DM global vectors hold the free displacement components, local ones those of the vertices here, caller's arrays those of the nodes given. */

PetscErrorCode LatinStructureCheckSetUp_Private(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCheck(structure->set_up, PetscObjectComm((PetscObject)structure), PETSC_ERR_ORDER, "The structure is not set up: call LatinStructureSetUp() after laws, supports and loads");
  PetscFunctionReturn(0);
}

/* A displacement must be a vector of the structure's DM: its entries are addressed directly */
PetscErrorCode LatinStructureCheckVec_Private(LatinStructure structure, Vec u)
{
  PetscInt n, m, all, whole;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckSetUp_Private(structure));
  PetscValidHeaderSpecific(u, VEC_CLASSID, 2);
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetLocalSize(structure->load, &m));
  PetscCall(VecGetSize(u, &all));
  PetscCall(VecGetSize(structure->load, &whole));
  LatinAgree(PetscObjectComm((PetscObject)structure), n != m || all != whole, PETSC_ERR_ARG_SIZ,
             "The vector has %" PetscInt_FMT " entries on a rank where the structure has %" PetscInt_FMT " free degrees of freedom; make it with DMCreateGlobalVector() on the DM of the structure", n, m);
  PetscFunctionReturn(0);
}

/* Values of this rank's nodes, [nodes_local][dim], at the free degrees of freedom of a DM global vector; each node's owner in the caller's numbering has its entries */
PetscErrorCode LatinStructureNodalVec_Private(LatinStructure structure, const PetscReal values[], Vec v)
{
  PetscFunctionBegin;
  PetscCall(VecSetOption(v, VEC_IGNORE_NEGATIVE_INDICES, PETSC_TRUE));
  PetscCall(VecSetValues(v, structure->nodes_local * structure->dim, structure->global_dof, values, INSERT_VALUES));
  PetscCall(VecAssemblyBegin(v));
  PetscCall(VecAssemblyEnd(v));
  PetscFunctionReturn(0);
}

/* F at the free degrees of freedom */
PetscErrorCode LatinStructureLoadVec_Private(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureNodalVec_Private(structure, structure->force, structure->load));
  PetscFunctionReturn(0);
}

/* Displacements of the DM's vertices, the prescribed ones included */
PetscErrorCode LatinStructureGetLocal_Private(LatinStructure structure, Vec u, Vec local)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayWrite(local, &a));
  PetscCall(PetscArraycpy(a, structure->vertex_prescribed, structure->vertices * structure->dim));
  PetscCall(VecRestoreArrayWrite(local, &a));
  PetscCall(DMGlobalToLocalBegin(structure->dm, u, INSERT_VALUES, local));
  PetscCall(DMGlobalToLocalEnd(structure->dm, u, INSERT_VALUES, local));
  PetscFunctionReturn(0);
}

/* Elongations of the links of this rank */
PetscErrorCode LatinStructureElongations_Private(LatinStructure structure, Vec u, PetscReal e[])
{
  Vec                ul;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) e[l] = LatinStructureElongation(structure, l, a);
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureGetDisplacements_Private(LatinStructure structure, Vec u, PetscReal displacement[])
{
  const PetscInt     n = structure->nodes_local * structure->dim;
  PetscSF            sf;
  PetscInt          *remote, *local, m = 0;
  PetscLayout        map;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(displacement, structure->prescribed, n));
  PetscCall(PetscMalloc2(n, &remote, n, &local));
  for (PetscInt i = 0; i < n; i++)
    if (structure->global_dof[i] >= 0) {
      remote[m]  = structure->global_dof[i];
      local[m++] = i;
    }
  PetscCall(VecGetLayout(u, &map));
  PetscCall(PetscSFCreate(PetscObjectComm((PetscObject)structure), &sf));
  PetscCall(PetscSFSetGraphLayout(sf, map, m, local, PETSC_COPY_VALUES, remote));
  PetscCall(VecGetArrayRead(u, &a));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_SCALAR, a, displacement));
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree2(remote, local));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetDisplacements - Displacements of this rank's nodes in the caller's numbering, prescribed ones included.

  Collective on structure

  Input Parameters:
+ structure - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. displacement - [nodes_local][dim], a length

  Level: beginner
@*/
PetscErrorCode LatinStructureGetDisplacements(LatinStructure structure, Vec u, PetscReal displacement[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureGetDisplacements_Private(structure, u, displacement));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetDisplacements - Fills a DM global vector from displacements in the caller's numbering.

  Collective on structure

  Input Parameters:
+ structure        - the structure
- displacement - [nodes_local][dim], ignored where prescribed

  Output Parameter:
. u - a DM global vector

  Level: intermediate
@*/
PetscErrorCode LatinStructureSetDisplacements(LatinStructure structure, const PetscReal displacement[], Vec u)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(VecSetOption(u, VEC_IGNORE_NEGATIVE_INDICES, PETSC_TRUE));
  PetscCall(VecSetValues(u, structure->nodes_local * structure->dim, structure->global_dof, displacement, INSERT_VALUES));
  PetscCall(VecAssemblyBegin(u));
  PetscCall(VecAssemblyEnd(u));
  PetscFunctionReturn(0);
}
