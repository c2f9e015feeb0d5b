#include "structure/structureimpl.h"

/* Tensions, nodal unbalance (1), its derivative and the potential energy, of links with fixed directions; rotating links: structure/turning.c. */

/* Computes the tensions at u, [links_local]. rigid: tensions of rigid links, NULL: zero. Collective on structure */
PetscErrorCode LatinStructureTensions_Private(LatinStructure structure, const PetscReal rigid[], Vec u, PetscReal tension[])
{
  PetscFunctionBegin;
  if (structure->geometry == LATIN_GEOMETRY_LARGE) {
    PetscCall(LatinTurningTensions_Private(structure, rigid, u, tension));
    PetscFunctionReturn(0);
  }
  PetscCall(LatinStructureStrains_Private(structure, u, tension));
  for (PetscInt l = 0; l < structure->links_local; l++) tension[l] = LatinStructureTension(structure, rigid, l, tension[l]);
  PetscFunctionReturn(0);
}

/* Computes the l2 norm of the tensions of elastic links without free displacements. Collective on structure */
PetscErrorCode LatinStructureDrawn_Private(LatinStructure structure, PetscReal *norm)
{
  PetscReal sum = 0.0, *tension;
  Vec       u;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &u));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(VecZeroEntries(u));
  PetscCall(LatinStructureTensions_Private(structure, NULL, u, tension));
  for (PetscInt l = 0; l < structure->links_local; l++) sum += LatinLaws[structure->law[l]].rigid ? 0.0 : PetscSqr(tension[l]);
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(DMRestoreGlobalVector(structure->dm, &u));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *norm = PetscSqrtReal(sum);
  PetscFunctionReturn(0);
}

/* Computes the unbalance r = B^t tau - F (1) at u. rigid: tensions of rigid links, NULL: zero. Collective on structure */
PetscErrorCode LatinStructureResidual_Private(LatinStructure structure, const PetscReal rigid[], Vec u, Vec r)
{
  PetscReal *tension;

  PetscFunctionBegin;
  PetscCall(LatinInterrupt_Private());
  if (structure->span) {
    PetscCall(LatinTurningResidual_Private(structure, rigid, u, r));
    PetscFunctionReturn(0);
  }
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinStructureTensions_Private(structure, rigid, u, tension));
  PetscCall(LatinStructureForces_Private(structure, tension, u, structure->load, r));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeResidual - Computes the nodal unbalance r = B^t tau - F (1) at the free degrees of freedom.

  Collective on structure

  Input Parameters:
+ structure - set up
- u         - displacements, a DM global vector

  Output Parameter:
. r - forces, a DM global vector, overwritten

  Level: intermediate

  Note:
  Tensions of rigid links are not a function of the displacements: a structure with such links has no residual. Use
  `SNESComputeFunction()` of SNES latin, with the tensions of its last solve.

.seealso: `LatinStructureComputeJacobian()`, `LatinStructureComputeEnergy()`
@*/
PetscErrorCode LatinStructureComputeResidual(LatinStructure structure, Vec u, Vec r)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCheck(structure->rigid_law < 0, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP,
             "The unbalance needs the tensions of links of the rigid law %s, which are not a function of the displacements: call SNESComputeFunction() on the SNES latin that has solved for them", LatinLaws[structure->rigid_law].name);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureResidual_Private(structure, NULL, u, r));
  PetscFunctionReturn(0);
}

/* Adds k b_i^t b_j to J; b_i and b_j: rows of B of links i and j, with the same end nodes; i = j: of one link. Not collective */
PetscErrorCode LatinStructureAddLinks_Private(LatinStructure structure, PetscInt i, PetscInt j, PetscReal k, Mat J)
{
  const PetscInt dim = structure->dim;
  PetscReal      b[2][6];
  PetscInt       row[6];
  PetscScalar    block[36];

  PetscFunctionBegin;
  for (PetscInt c = 0; c < 2 * dim; c++) {
    row[c] = dim * structure->ends[2 * i + c / dim] + c % dim;
    for (PetscInt side = 0; side < 2; side++) b[side][c] = (c < dim ? -1.0 : 1.0) * structure->direction[dim * (side ? j : i) + c % dim];
  }
  for (PetscInt c = 0; c < 4 * dim * dim; c++) block[c] = k * b[0][c / (2 * dim)] * b[1][c % (2 * dim)];
  PetscCall(MatSetValuesLocal(J, 2 * dim, row, 2 * dim, row, block, ADD_VALUES));
  PetscFunctionReturn(0);
}

/* Adds B^t k B and the springs to the ground to J, and assembles it. k: [links_local]. Collective on structure */
PetscErrorCode LatinStructureAssemble_Private(LatinStructure structure, const PetscReal k[], Mat J)
{
  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) PetscCall(LatinStructureAddLinks_Private(structure, l, l, k[l], J));
  PetscCall(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  if (structure->ground) PetscCall(MatDiagonalSet(J, structure->ground, ADD_VALUES));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureComputeJacobian_Private(LatinStructure structure, Vec u, Mat J)
{
  Vec                tangent;
  const PetscScalar *k;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckRigid_Private(structure, "The tangent stiffness, that is Newton's method,"));
  PetscCall(LatinStructureCheckMat_Private(structure, J));
  if (structure->span) {
    PetscCall(LatinTurningJacobian_Private(structure, u, J));
    PetscFunctionReturn(0);
  }
  PetscCall(LatinTangentCompute_Private(structure, u, 0.0, J, &tangent));
  PetscCall(VecGetArrayRead(tangent, &k));
  PetscCall(MatZeroEntries(J));
  PetscCall(LatinStructureAssemble_Private(structure, k, J));
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscCall(MatSetOption(J, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(J, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeJacobian - Computes the tangent stiffness J = B^t k_t B, a generalised derivative of the unbalance at u; k_t: tangent stiffnesses of the links.

  Collective on structure

  Input Parameters:
+ structure - set up
- u         - displacements, a DM global vector

  Output Parameter:
. J - force/length, overwritten

  Level: intermediate

  Note:
  Create J by `DMCreateMatrix()`: AIJ, or MATIS with -dm_mat_type is.

.seealso: `LatinStructureComputeResidual()`, `LatinStructureComputeGeometricStiffness()`
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
  PetscReal  *x, sum = 0.0, ground;
  PetscScalar work;

  PetscFunctionBegin;
  if (structure->span) {
    PetscCall(LatinTurningEnergy_Private(structure, u, energy));
    PetscFunctionReturn(0);
  }
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(LatinStructureStrains_Private(structure, u, x));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const LatinLaw *law = &LatinLaws[structure->law[l]];

    if (!law->rigid) sum += law->energy(structure->stiffness[l], x[l], law->ctx);
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(MPIU_Allreduce(&sum, energy, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(VecDot(structure->load, u, &work));
  PetscCall(LatinDiagonalProduct_Private(structure->ground, u, u, &ground));
  *energy += 0.5 * ground - PetscRealPart(work);
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeEnergy - Computes the potential energy: strain energy of the links minus the work of the loads.

  Collective on structure

  Input Parameters:
+ structure - set up
- u         - displacements, a DM global vector

  Output Parameter:
. energy - force times length, over all ranks

  Level: intermediate

  Note:
  Links of a rigid law have no strain energy.

.seealso: `LatinStructureComputeResidual()`, `LatinStructureComputeKineticEnergy()`
@*/
PetscErrorCode LatinStructureComputeEnergy(LatinStructure structure, Vec u, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscAssertPointer(energy, 3);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureComputeEnergy_Private(structure, u, energy));
  PetscFunctionReturn(0);
}
