#include "structure/structureimpl.h"

/* Nodal unbalance (1), its derivative, and the potential energy. */

/* With the tensions `rigid` of the rigid links, NULL for none */
PetscErrorCode LatinStructureResidual_Private(LatinStructure structure, const PetscReal rigid[], Vec u, Vec r)
{
  Vec                ul, rl;
  const PetscScalar *a;
  PetscScalar       *f;
  PetscInt           dim;

  PetscFunctionBegin;
  dim = structure->dim;
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(DMGetLocalVector(structure->dm, &rl));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecZeroEntries(rl));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArray(rl, &f));
  for (PetscInt l = 0; l < structure->links_local; l++) LatinStructureAddForce(structure, l, LatinStructureTension(structure, rigid, l, LatinStructureElongation(structure, l, a) + structure->e0[l]), f);
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(VecRestoreArray(rl, &f));
  PetscCall(VecCopy(structure->load, r));
  PetscCall(VecScale(r, -1.0));
  if (structure->ground) PetscCall(LatinStructureAddGround_Private(structure, u, r));
  PetscCall(DMLocalToGlobalBegin(structure->dm, rl, ADD_VALUES, r));
  PetscCall(DMLocalToGlobalEnd(structure->dm, rl, ADD_VALUES, r));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscCall(DMRestoreLocalVector(structure->dm, &rl));
  PetscCall(PetscLogFlops(structure->links_local * (5.0 * dim + 4.0)));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeResidual - The nodal unbalance B^t tau - F at the free degrees of freedom, (1).

  Collective on structure

  Input Parameters:
+ structure - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. r - unbalance, a DM global vector

  Level: intermediate

  Note:
  Tensions of links of a rigid law are no function of the displacements: a structure with such links has no residual of
  its own. SNES latin has one, with the tensions of its last solve: `SNESComputeFunction()`.
@*/
PetscErrorCode LatinStructureComputeResidual(LatinStructure structure, Vec u, Vec r)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCheck(structure->rigid_law < 0, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP,
             "The unbalance takes the tensions of links of the rigid law %s, which are no function of the displacements: call SNESComputeFunction() on the SNES latin that has solved for them", LatinLaws[structure->rigid_law].name);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureResidual_Private(structure, NULL, u, r));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureComputeJacobian_Private(LatinStructure structure, Vec u, Mat J)
{
  ISLocalToGlobalMapping map;
  PetscInt               n, m;
  Vec                    tangent;
  const PetscScalar     *k;
  PetscInt               dim;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckRigid_Private(structure, "The tangent stiffness, that is Newton's method,"));
  PetscCall(MatGetLocalToGlobalMapping(J, &map, NULL));
  PetscCall(MatGetSize(J, &n, NULL));
  PetscCall(VecGetSize(structure->load, &m));
  PetscCheck(map && n == m, PetscObjectComm((PetscObject)structure), PETSC_ERR_ARG_WRONG, "The matrix does not belong to this structure: make it with DMCreateMatrix() on its DM");
  dim = structure->dim;
  PetscCall(LatinTangentCompute_Private(structure, u, 0.0, J, &tangent));
  PetscCall(MatZeroEntries(J));
  PetscCall(VecGetArrayRead(tangent, &k));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal *n = structure->direction + dim * l;
    PetscInt         row[6];
    PetscScalar      block[36];

    for (PetscInt c = 0; c < dim; c++) {
      row[c]       = dim * structure->ends[2 * l] + c;
      row[dim + c] = dim * structure->ends[2 * l + 1] + c;
      for (PetscInt b = 0; b < dim; b++) {
        const PetscScalar v = k[l] * n[c] * n[b];

        block[c * 2 * dim + b]               = v;
        block[c * 2 * dim + dim + b]         = -v;
        block[(dim + c) * 2 * dim + b]       = -v;
        block[(dim + c) * 2 * dim + dim + b] = v;
      }
    }
    PetscCall(MatSetValuesLocal(J, 2 * dim, row, 2 * dim, row, block, ADD_VALUES));
  }
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscCall(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  if (structure->ground) PetscCall(MatDiagonalSet(J, structure->ground, ADD_VALUES));
  PetscCall(MatSetOption(J, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(J, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeJacobian - The generalised derivative B^t k_t B of the unbalance, k_t the tangent stiffness of each link.

  Collective on structure

  Input Parameters:
+ structure - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. J - a matrix from `DMCreateMatrix()`: AIJ, or MATIS after -dm_mat_type is

  Level: intermediate
@*/
PetscErrorCode LatinStructureComputeJacobian(LatinStructure structure, Vec u, Mat J)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureComputeJacobian_Private(structure, u, J));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureComputeEnergy_Private(LatinStructure structure, Vec u, PetscReal *energy)
{
  Vec                ul;
  const PetscScalar *a;
  PetscReal          sum = 0.0, total;
  PetscScalar        work;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const LatinLaw *law = &LatinLaws[structure->law[l]];

    if (!law->rigid) sum += law->energy(structure->stiffness[l], LatinStructureElongation(structure, l, a) + structure->e0[l], law->ctx);
  }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscCall(MPIU_Allreduce(&sum, &total, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(VecDot(structure->load, u, &work));
  *energy = total - work;
  if (structure->ground) {
    PetscCall(LatinStructureGroundEnergy_Private(structure, u, &sum));
    *energy += sum;
  }
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeEnergy - The potential energy: strain energy of the links less the work of the loads.

  Collective on structure

  Level: intermediate

  Note:
  Links of a rigid law store none.
@*/
PetscErrorCode LatinStructureComputeEnergy(LatinStructure structure, Vec u, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureComputeEnergy_Private(structure, u, energy));
  PetscFunctionReturn(0);
}
