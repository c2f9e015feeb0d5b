#include "structure/turned.h"

/* For linear buckling: geometric stiffness of given tensions, and derivative of the tensions along displacements. */

/* Checks that the geometry has rotations of links. Collective on structure */
static PetscErrorCode LatinGeometricCheck_Private(LatinStructure structure)
{
  PetscFunctionBegin;
  PetscCheck(structure->span, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP, "The geometric stiffness needs rotations of links, and the geometry of the structure is linear: take -snes_latin_geometry prestress, or large");
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureComputeGeometricStiffness_Private(LatinStructure structure, Vec u, const PetscReal tension[], Mat G)
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(LatinGeometricCheck_Private(structure));
  PetscCall(LatinStructureCheckMat_Private(structure, G));
  PetscCall(MatZeroEntries(G));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal   k[9];
    LatinTurned link;

    LatinTurnedLink(structure, NULL, l, a, &link);
    if (!(link.size > 0.0)) continue; /* none, as in the tangent: the ends coincide, or the direction is fixed */
    for (PetscInt i = 0; i < dim * dim; i++) k[i] = tension[l] / link.size * ((i / dim == i % dim ? 1.0 : 0.0) - link.n[i / dim] * link.n[i % dim]);
    PetscCall(LatinTurnedAdd_Private(structure, l, k, G));
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(MatAssemblyBegin(G, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(G, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(G, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(G, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeGeometricStiffness - Computes the geometric stiffness of given tensions: the sum over all links of tau / R (1 - n n^t), R and n the
  length and the direction of a link, in the displaced configuration if displacements are large, else in the drawn one.

  Collective on structure

  Input Parameters:
+ u       - displacements, a DM global vector
- tension - tau of this rank's links, [links_local] in the caller's numbering, positive in tension

  Output Parameter:
. G - overwritten; from `DMCreateMatrix()` on the DM of the structure

  Level: intermediate

  Note:
  G is linear in the tensions; it may be indefinite if some are compressive. With the tensions at u it is the geometric part of the
  tangent stiffness of `LatinStructureComputeJacobian()`.

.seealso: `LatinStructureComputeJacobian()`, `LatinStructureGetTensions()`, `LatinStructureSetGeometry()`
@*/
PetscErrorCode LatinStructureComputeGeometricStiffness(LatinStructure structure, Vec u, const PetscReal tension[], Mat G)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureComputeGeometricStiffness_Private(structure, u, tension, G));
  PetscFunctionReturn(0);
}

/*
   Computes f = G v; G: minus the geometric stiffness of the compressive tensions at u, positive semidefinite; and springs to the ground. Collective
   on structure
*/
PetscErrorCode LatinTurningPressed_Private(LatinStructure structure, Vec u, Vec v, Vec f)
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a, *b;
  PetscReal         *across;
  Vec                at, along;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &across));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &at, &a));
  PetscCall(LatinStructureOpen_Private(structure, NULL, v, &along, &b)); /* zero where prescribed */
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscScalar *va = b + dim * structure->ends[2 * l], *vb = b + dim * structure->ends[2 * l + 1];
    PetscReal          stretch = 0.0;
    LatinTurned        link;

    LatinTurnedLink(structure, NULL, l, a, &link);
    for (PetscInt c = 0; c < dim; c++) stretch += link.n[c] * PetscRealPart(vb[c] - va[c]);
    for (PetscInt c = 0; c < dim; c++) across[dim * l + c] = PetscMax(0.0, -link.across) * (PetscRealPart(vb[c] - va[c]) - stretch * link.n[c]);
  }
  PetscCall(LatinStructureClose_Private(structure, &along, &b));
  PetscCall(LatinStructureClose_Private(structure, &at, &a));
  PetscCall(LatinTurningForces_Private(structure, across, v, NULL, f));
  PetscCall(DMRestoreWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &across));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureGetTensionRates_Private(LatinStructure structure, Vec u, Vec v, PetscReal rate[])
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a, *b;
  Vec                at, along;

  PetscFunctionBegin;
  PetscCall(LatinGeometricCheck_Private(structure));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &at, &a));
  PetscCall(LatinStructureOpen_Private(structure, NULL, v, &along, &b)); /* zero where prescribed */
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscScalar *va = b + dim * structure->ends[2 * l], *vb = b + dim * structure->ends[2 * l + 1];
    LatinTurned        link;

    LatinTurnedLink(structure, NULL, l, a, &link);
    rate[l] = 0.0;
    for (PetscInt c = 0; c < dim; c++) rate[l] += link.n[c] * PetscRealPart(vb[c] - va[c]);
    rate[l] *= LatinStructureTangent(structure, l, link.x);
  }
  PetscCall(LatinStructureClose_Private(structure, &along, &b));
  PetscCall(LatinStructureClose_Private(structure, &at, &a));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetTensionRates - Computes the derivative of the tensions at u along v, k_t n . (v_2 - v_1); zero in slack links.

  Collective on structure

  Input Parameters:
. u, v - displacements, DM global vectors

  Output Parameter:
. rate - forces, of this rank's links, [links_local] in the caller's numbering

  Level: intermediate

.seealso: `LatinStructureGetTensions()`, `LatinStructureComputeGeometricStiffness()`
@*/
PetscErrorCode LatinStructureGetTensionRates(LatinStructure structure, Vec u, Vec v, PetscReal rate[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(LatinStructureCheckVec_Private(structure, v));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureGetTensionRates_Private(structure, u, v, rate));
  PetscFunctionReturn(0);
}
