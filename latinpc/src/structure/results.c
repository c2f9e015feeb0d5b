#include "structure/structureimpl.h"

/* Results at given displacements: errors, tensions, number of active links. */

static PetscErrorCode LatinStructureComputeErrors_Private(LatinStructure structure, Vec u, Vec reference, PetscReal *l2, PetscReal *energy)
{
  Vec              d;
  PetscReal        sum[2] = {0.0, 0.0}, dn, rn, *k, *e, *r;
  const PetscReal *held   = structure->vertex_prescribed;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(u, &d));
  PetscCall(VecWAXPY(d, -1.0, reference, u));
  PetscCall(VecNorm(d, NORM_2, &dn));
  PetscCall(VecNorm(reference, NORM_2, &rn));
  PetscCall(VecDestroy(&d));
  *l2 = rn > 0.0 ? dn / rn : dn;
  PetscCall(PetscMalloc3(structure->links_local, &k, structure->links_local, &e, structure->links_local, &r));
  PetscCall(LatinStructureStiffness_Private(structure, 0.0, k));
  PetscCall(LatinStructureElongations_Private(structure, held, u, e));
  PetscCall(LatinStructureElongations_Private(structure, held, reference, r));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    sum[0] += k[l] * PetscSqr(e[l] - r[l]);
    sum[1] += k[l] * PetscSqr(r[l]);
  }
  PetscCall(PetscFree3(k, e, r));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *energy = PetscSqrtReal(sum[1] > 0.0 ? sum[0] / sum[1] : sum[0]);
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureComputeErrors - Computes the relative distance of displacements u from a reference; absolute if the reference is zero.

  Collective on structure

  Output Parameters:
+ l2     - |u - reference| / |reference|
- energy - the same in the norm sqrt(sum of k e^2) of the elongations, all links counted as taut

  Level: intermediate

.seealso: `SNESLatinSetReference()`, `LatinStructureComputeEnergy()`
@*/
PetscErrorCode LatinStructureComputeErrors(LatinStructure structure, Vec u, Vec reference, PetscReal *l2, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(LatinStructureCheckVec_Private(structure, reference));
  PetscAssertPointer(l2, 4);
  PetscAssertPointer(energy, 5);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureComputeErrors_Private(structure, u, reference, l2, energy));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureGetTensions - Tensions of this rank's links at displacements u, [links_local] in the caller's numbering, positive in tension.

  Collective on structure

  Input Parameters:
+ structure - set up
- u         - displacements, a DM global vector

  Output Parameter:
. tension - [links_local] forces

  Level: beginner

  Note:
  Tensions of rigid links are not a function of the displacements: `SNESLatinGetTensions()` returns those of a solve.

.seealso: `SNESLatinGetTensions()`, `LatinStructureGetDisplacements()`
@*/
PetscErrorCode LatinStructureGetTensions(LatinStructure structure, Vec u, PetscReal tension[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  if (structure->links_local) PetscAssertPointer(tension, 3);
  PetscCheck(structure->rigid_law < 0, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP,
             "Tensions of links of the rigid law %s are not a function of the displacements: call SNESLatinGetTensions() on the SNES latin that has solved for them (in Python, latinpc.tensions(snes))", LatinLaws[structure->rigid_law].name);
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureTensions_Private(structure, NULL, u, tension));
  PetscFunctionReturn(0);
}

/* Counts unilateral links (all but bars), and active ones, whose tension is not zero. rigid: tensions of rigid links. Collective on structure */
PetscErrorCode LatinStructureCountActive_Private(LatinStructure structure, const PetscReal rigid[], Vec u, PetscInt *active, PetscInt *unilateral)
{
  PetscReal *tension;
  PetscInt   n[2] = {0, 0};

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinStructureTensions_Private(structure, rigid, u, tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (LatinLaws[structure->law[l]].smooth) continue;
    n[1]++;
    if (tension[l] != 0.0) n[0]++;
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, n, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  *active     = n[0];
  *unilateral = n[1];
  PetscFunctionReturn(0);
}
