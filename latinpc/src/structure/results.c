#include "structure/structureimpl.h"

/* What displacements of a structure mean: energy, distances, and values of nodes and links in the caller's numbering. */

static PetscErrorCode LatinStructureComputeErrors_Private(LatinStructure structure, Vec u, Vec reference, PetscReal *l2, PetscReal *energy)
{
  Vec                ul, vl, d;
  const PetscScalar *a, *b;
  PetscReal          sum[2] = {0.0, 0.0}, total[2], dn, rn, *k;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(u, &d));
  PetscCall(VecWAXPY(d, -1.0, reference, u));
  PetscCall(VecNorm(d, NORM_2, &dn));
  PetscCall(VecNorm(reference, NORM_2, &rn));
  PetscCall(VecDestroy(&d));
  *l2 = rn > 0.0 ? dn / rn : dn;
  PetscCall(PetscMalloc1(structure->links_local, &k));
  PetscCall(LatinStructureStiffness_Private(structure, k));
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(DMGetLocalVector(structure->dm, &vl));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(LatinStructureGetLocal_Private(structure, reference, vl));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArrayRead(vl, &b));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal e = LatinStructureElongation(structure, l, a), r = LatinStructureElongation(structure, l, b);

    sum[0] += k[l] * PetscSqr(e - r);
    sum[1] += k[l] * PetscSqr(r);
  }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(VecRestoreArrayRead(vl, &b));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscCall(DMRestoreLocalVector(structure->dm, &vl));
  PetscCall(PetscFree(k));
  PetscCall(MPIU_Allreduce(sum, total, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *energy = PetscSqrtReal(total[1] > 0.0 ? total[0] / total[1] : total[0]);
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeErrors - Relative distance of two displacement fields.

  Collective on structure

  Input Parameters:
+ structure     - the structure
. u         - displacements
- reference - displacements to compare with

  Output Parameters:
+ l2     - |u - reference| / |reference|
- energy - the same in the norm sqrt(sum of k e^2) of the elongations, all links counted as taut

  Level: intermediate

  Note:
  For a zero reference the distances are absolute.
@*/
PetscErrorCode LatinStructureComputeErrors(LatinStructure structure, Vec u, Vec reference, PetscReal *l2, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(LatinStructureCheckVec_Private(structure, reference));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureComputeErrors_Private(structure, u, reference, l2, energy));
  PetscFunctionReturn(0);
}

/* With the tensions `rigid` of the rigid links, NULL for none */
PetscErrorCode LatinStructureTensions_Private(LatinStructure structure, const PetscReal rigid[], Vec u, PetscReal tension[])
{
  Vec                ul;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) tension[l] = LatinStructureTension(structure, rigid, l, LatinStructureElongation(structure, l, a) + structure->e0[l]);
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetTensions - Tensions of this rank's links under given displacements, in the caller's numbering.

  Collective on structure

  Input Parameters:
+ structure - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. tension - [links_local], a force, positive in traction

  Level: beginner

  Note:
  Tensions of links of a rigid law are no function of the displacements: `SNESLatinGetTensions()` has those of a solve.

.seealso: `SNESLatinGetTensions()`, `TSLatinGetTensions()`
@*/
PetscErrorCode LatinStructureGetTensions(LatinStructure structure, Vec u, PetscReal tension[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCheck(structure->rigid_law < 0, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP,
             "Tensions of links of the rigid law %s are no function of the displacements: call SNESLatinGetTensions() on the SNES latin that has solved for them (in Python, latinpc.tensions(snes))", LatinLaws[structure->rigid_law].name);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureTensions_Private(structure, NULL, u, tension));
  PetscFunctionReturn(0);
}

/* How many links can be slack, and how many of them bear something */
PetscErrorCode LatinStructureCountActive_Private(LatinStructure structure, const PetscReal rigid[], Vec u, PetscInt *active, PetscInt *unilateral)
{
  Vec                ul;
  const PetscScalar *a;
  PetscInt           n[2] = {0, 0};

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (!LatinLaws[structure->law[l]].smooth) {
      n[1]++;
      if (LatinStructureTension(structure, rigid, l, LatinStructureElongation(structure, l, a) + structure->e0[l]) != 0.0) n[0]++;
    }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, n, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  *active     = n[0];
  *unilateral = n[1];
  PetscFunctionReturn(0);
}
