#include "structure/structureimpl.h"

/*
   Vectors of a structure, with their products by B and B^t. DM global vectors have the free displacement components; local ones, all components of the
   vertices of this rank; arrays of the caller, all components of its nodes on this rank.
*/

PetscErrorCode LatinStructureCheckSetUp_Private(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(structure, LATIN_STRUCTURE_CLASSID, 1);
  PetscCheck(structure->set_up, PetscObjectComm((PetscObject)structure), PETSC_ERR_ORDER, "The structure is not set up: call LatinStructureSetUp() after laws, supports and loads");
  PetscFunctionReturn(0);
}

/* Checks that solver and structure have the same ranks: else communication would crash or deadlock. Not collective */
PetscErrorCode LatinStructureCheckComm_Private(LatinStructure structure, PetscObject solver)
{
  const MPI_Comm comm = PetscObjectComm((PetscObject)structure), other = PetscObjectComm(solver);
  PetscMPIInt    same, size, size_other;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_compare(comm, other, &same));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCallMPI(MPI_Comm_size(other, &size_other));
  PetscCheck(same == MPI_IDENT || same == MPI_CONGRUENT, PETSC_COMM_SELF, PETSC_ERR_ARG_NOTSAMECOMM, "The communicator of the %s has %d ranks, that of the structure %d, or other ones: create both on the same communicator", solver->class_name,
             size_other, size);
  PetscFunctionReturn(0);
}

/* Checks that u has the layout of the structure's DM, as its entries are accessed directly. Collective on structure */
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

/* Checks that J is a matrix from the structure's DM. Collective on structure */
PetscErrorCode LatinStructureCheckMat_Private(LatinStructure structure, Mat J)
{
  ISLocalToGlobalMapping map;
  PetscInt               n, m;

  PetscFunctionBegin;
  PetscCall(MatGetLocalToGlobalMapping(J, &map, NULL));
  PetscCall(MatGetSize(J, &n, NULL));
  PetscCall(VecGetSize(structure->load, &m));
  PetscCheck(map && n == m, PetscObjectComm((PetscObject)structure), PETSC_ERR_ARG_WRONG, "The matrix does not belong to this structure: make it with DMCreateMatrix() on its DM");
  PetscFunctionReturn(0);
}

/* Checks that the array is not NULL, unless this rank has no such nodes or links. kind: "Node" or "Link"; what: noun for the message. Collective on comm */
PetscErrorCode LatinCheckArray_Private(MPI_Comm comm, const char kind[], PetscInt start, PetscInt n, const void *array, const char what[])
{
  PetscFunctionBegin;
  LatinAgree(comm, n > 0 && !array, PETSC_ERR_ARG_NULL, "%s %" PetscInt_FMT " needs %s, but the array is NULL", kind, start, what);
  PetscFunctionReturn(0);
}

/* Checks that values, `each` per node or link, are finite, and >= 0 unless `negative` ones are allowed. Collective on comm */
PetscErrorCode LatinCheckNumbers_Private(MPI_Comm comm, const char kind[], PetscInt start, PetscInt n, PetscInt each, const PetscReal value[], PetscBool negative, const char what[])
{
  PetscInt bad = -1;

  PetscFunctionBegin;
  PetscCall(LatinCheckArray_Private(comm, kind, start, n, value, what));
  for (PetscInt i = 0; i < n * each && bad < 0; i++)
    if (PetscIsInfOrNanReal(value[i]) || (!negative && value[i] < 0.0)) bad = i;
  LatinAgree(comm, bad >= 0, negative ? PETSC_ERR_FP : PETSC_ERR_ARG_OUTOFRANGE, "%s %" PetscInt_FMT " has %s that is not a finite number%s: %g", kind, start + bad / each, what, negative ? "" : ", zero or more", (double)value[bad]);
  PetscFunctionReturn(0);
}

/* Sets v, a DM global vector, from values of this rank's nodes, [nodes_local][dim], in the caller's numbering. Collective on structure */
PetscErrorCode LatinStructureNodalVec_Private(LatinStructure structure, const PetscReal values[], Vec v)
{
  PetscFunctionBegin;
  PetscCall(VecSetOption(v, VEC_IGNORE_NEGATIVE_INDICES, PETSC_TRUE));
  PetscCall(VecSetValues(v, structure->nodes_local * structure->dim, structure->global_dof, values, INSERT_VALUES));
  PetscCall(VecAssemblyBegin(v));
  PetscCall(VecAssemblyEnd(v));
  PetscFunctionReturn(0);
}

/* Sets v to the loads, plus additional ones `more` (or NULL). Collective on structure */
PetscErrorCode LatinStructureLoads_Private(LatinStructure structure, Vec more, Vec v)
{
  PetscFunctionBegin;
  PetscCall(VecCopy(structure->load, v));
  if (more) PetscCall(VecAXPY(v, 1.0, more));
  PetscFunctionReturn(0);
}

/* Sets local to the displacements u of the vertices, with prescribed ones `held`, [vertices][dim]; NULL: zero. Collective on structure */
PetscErrorCode LatinStructureGetLocal_Private(LatinStructure structure, const PetscReal held[], Vec u, Vec local)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayWrite(local, &a));
  if (held) PetscCall(PetscArraycpy(a, held, structure->vertices * structure->dim));
  else PetscCall(PetscArrayzero(a, structure->vertices * structure->dim));
  PetscCall(VecRestoreArrayWrite(local, &a));
  PetscCall(DMGlobalToLocal(structure->dm, u, INSERT_VALUES, local));
  PetscFunctionReturn(0);
}

/* Gets a, [vertices][dim]: displacements u, with prescribed ones `held`, NULL: zero. Read only, until LatinStructureClose_Private(). Collective on structure */
PetscErrorCode LatinStructureOpen_Private(LatinStructure structure, const PetscReal held[], Vec u, Vec *local, const PetscScalar **a)
{
  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, local));
  PetscCall(LatinStructureGetLocal_Private(structure, held, u, *local));
  PetscCall(VecGetArrayRead(*local, a));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinStructureClose_Private(LatinStructure structure, Vec *local, const PetscScalar **a)
{
  PetscFunctionBegin;
  PetscCall(VecRestoreArrayRead(*local, a));
  PetscCall(DMRestoreLocalVector(structure->dm, local));
  PetscFunctionReturn(0);
}

/* Gets f, [vertices][dim]: zero, to add forces to, until LatinStructureCloseForces_Private(). Not collective */
PetscErrorCode LatinStructureOpenForces_Private(LatinStructure structure, Vec *local, PetscScalar **f)
{
  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, local));
  PetscCall(VecZeroEntries(*local));
  PetscCall(VecGetArray(*local, f));
  PetscFunctionReturn(0);
}

/* Computes r = f + G u - load, summed over the ranks; G: springs to the ground; u and load may be NULL. Collective on structure */
PetscErrorCode LatinStructureCloseForces_Private(LatinStructure structure, Vec *local, PetscScalar **f, Vec u, Vec load, Vec r)
{
  PetscFunctionBegin;
  PetscCall(VecRestoreArray(*local, f));
  if (structure->ground && u) PetscCall(VecPointwiseMult(r, structure->ground, u));
  else PetscCall(VecZeroEntries(r));
  if (load) PetscCall(VecAXPY(r, -1.0, load));
  PetscCall(DMLocalToGlobal(structure->dm, *local, ADD_VALUES, r));
  PetscCall(DMRestoreLocalVector(structure->dm, local));
  PetscFunctionReturn(0);
}

/* Computes elongations e = B u, [links_local]; held: prescribed displacements, [vertices][dim], NULL: zero. Collective on structure */
PetscErrorCode LatinStructureElongations_Private(LatinStructure structure, const PetscReal held[], Vec u, PetscReal e[])
{
  Vec                local;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, held, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) e[l] = LatinStructureElongation(structure, l, a);
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(PetscLogFlops(3.0 * structure->dim * structure->links_local));
  PetscFunctionReturn(0);
}

/* Computes strains x = B u + e0, [links_local]. Collective on structure */
PetscErrorCode LatinStructureStrains_Private(LatinStructure structure, Vec u, PetscReal x[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureElongations_Private(structure, structure->vertex_prescribed, u, x));
  for (PetscInt l = 0; l < structure->links_local; l++) x[l] += structure->e0[l];
  PetscFunctionReturn(0);
}

/* Computes r = B^t tension + G u - load; G: springs to the ground; load may be NULL. Collective on structure */
PetscErrorCode LatinStructureForces_Private(LatinStructure structure, const PetscReal tension[], Vec u, Vec load, Vec r)
{
  Vec          local;
  PetscScalar *f;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpenForces_Private(structure, &local, &f));
  for (PetscInt l = 0; l < structure->links_local; l++) LatinStructureAddForce(structure, l, tension[l], f);
  PetscCall(LatinStructureCloseForces_Private(structure, &local, &f, u, load, r));
  PetscCall(PetscLogFlops(3.0 * structure->dim * structure->links_local));
  PetscFunctionReturn(0);
}

/* Computes u^t D v for a diagonal D; NULL: 0. Collective on u */
PetscErrorCode LatinDiagonalProduct_Private(Vec D, Vec u, Vec v, PetscReal *product)
{
  PetscScalar dot = 0.0;
  Vec         w;

  PetscFunctionBegin;
  if (D) {
    PetscCall(VecDuplicate(u, &w));
    PetscCall(VecPointwiseMult(w, D, u));
    PetscCall(VecDot(w, v, &dot));
    PetscCall(VecDestroy(&w));
  }
  *product = PetscRealPart(dot);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureGetDisplacements_Private(LatinStructure structure, Vec u, PetscReal displacement[])
{
  Vec                local;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(displacement, structure->prescribed, structure->nodes_local * structure->dim));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, structure->dim, MPIU_SCALAR, a, displacement, MPI_REPLACE));
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetDisplacements - Displacements of this rank's nodes, [nodes_local][dim] in the caller's numbering, prescribed ones included, from a DM global vector.

  Collective on structure

  Input Parameters:
+ structure - set up
- u         - displacements, a DM global vector

  Output Parameter:
. displacement - [nodes_local][dim] lengths

  Level: beginner

.seealso: `LatinStructureSetDisplacements()`, `LatinStructureGetTensions()`
@*/
PetscErrorCode LatinStructureGetDisplacements(LatinStructure structure, Vec u, PetscReal displacement[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureGetDisplacements_Private(structure, u, displacement));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureSetDisplacements - Fills a DM global vector from displacements [nodes_local][dim] in the caller's numbering, ignored where prescribed.

  Collective on structure

  Input Parameters:
+ structure    - set up
- displacement - [nodes_local][dim] lengths

  Output Parameter:
. u - DM global vector, overwritten

  Level: intermediate

.seealso: `LatinStructureGetDisplacements()`
@*/
PetscErrorCode LatinStructureSetDisplacements(LatinStructure structure, const PetscReal displacement[], Vec u)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(LatinStructureNodalVec_Private(structure, displacement, u));
  PetscFunctionReturn(0);
}
