#include "error/latinerror.h"

/* Jammed rigid links: gaps and prescribed displacements that no displacements satisfy together. */

#define LATIN_JAM_STAGES 100 /* damped linear stages after which growing tensions are a self-stress; 25 find all jams tried */

/*
   Tests for jammed rigid links: no kinematically admissible displacement exists. Their tensions grow without bound, by the same self-stress dtau from
   one stage of the damped iteration, or of the method of multipliers, to the next: B^t dtau = 0. All admissible strains x have dtau . x = dtau . (e0
   + B u) <= 0 [J. Farkas]. So there are none if dtau . e0 > 0 by more than B^t dtau can balance on displacements of the size of the structure or of
   u. Then the verdict is LATIN_JAMMED; else *found is unchanged.

     stays: the missed gaps do not depend on the stiffness of the links; then the work alone suffices, unless a tension decreases, which ends at zero
     dtau:  [links_local] increments; sets those of elastic links, and of the sign that the law does not admit, to zero

   Collective on structure
*/
PetscErrorCode LatinEquilibriumFarkas_Private(LatinStructure structure, Vec u, PetscBool stays, PetscReal dtau[], LatinEquilibrium *found)
{
  /* work on gaps and prescribed displacements, sum of absolute works; largest increase and decrease of tensions */
  PetscReal sum[2] = {0.0, 0.0}, most[2] = {0.0, 0.0}, size, prescribed, moved, left, *x;
  PetscInt  mine[LATIN_LISTED], count    = 0;
  Vec       forces;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &forces));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(VecZeroEntries(forces));
  PetscCall(LatinStructureStrains_Private(structure, forces, x)); /* e0 and prescribed displacements only */
  for (PetscInt l = 0; l < structure->links_local; l++) {
    /* friction prevents no displacement */
    const PetscReal sign = LatinLawSign(structure->law[l]), grows = LatinLaws[structure->law[l]].rigid && structure->law[l] != LATIN_LAW_TANGENT ? sign * dtau[l] : 0.0;

    dtau[l] = sign * PetscMax(0.0, grows);
    sum[0] += dtau[l] * x[l];
    sum[1] += PetscAbsReal(dtau[l] * x[l]);
    most[0] = PetscMax(most[0], grows);
    most[1] = PetscMax(most[1], -grows);
  }
  PetscCall(LatinStructureForces_Private(structure, dtau, forces, NULL, forces)); /* without the springs of a time step, as forces are zero */
  PetscCall(VecNorm(forces, NORM_2, &left));
  PetscCall(VecNorm(u, NORM_2, &moved));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(DMRestoreGlobalVector(structure->dm, &forces));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
  if (stays && most[1] <= PETSC_SQRT_MACHINE_EPSILON * most[0]) left = 0.0;
  if (!(sum[0] > PetscMax(moved, size) * left + PETSC_SQRT_MACHINE_EPSILON * sum[1])) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (PetscAbsReal(dtau[l]) <= PETSC_SQRT_MACHINE_EPSILON * most[0]) continue; /* all of them prove it */
    if (count < LATIN_LISTED) mine[count] = structure->links_start + l;
    count++;
  }
  PetscCall(LatinList_Private(PetscObjectComm((PetscObject)structure), count, mine, &found->links, found->link));
  if (found->links) found->verdict = LATIN_JAMMED;
  PetscFunctionReturn(0);
}

/*
   Checks before a solve that supports do not jam rigid links between them: an error, but in a time step, which may fail, the verdict LATIN_JAMMED.
   Collective on structure
*/
PetscErrorCode LatinEquilibriumHeld_Private(LatinStructure structure, LatinEquilibrium *found)
{
  PetscInt jam[LATIN_LISTED];

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckHeld_Private(structure, jam));
  if (!structure->ground) PetscFunctionReturn(0);
  PetscCall(LatinList_Private(PetscObjectComm((PetscObject)structure), jam[0] >= 0, jam, &found->links, found->link));
  if (found->links) found->verdict = LATIN_JAMMED;
  PetscFunctionReturn(0);
}

/*
   Runs damped stages from the initial state, and tests their last increment of tensions for a jam: verdict LATIN_JAMMED, else *found is unchanged. z,
   work: states, overwritten. Overwrites linear.U; restores the tensions of rigid links. Collective on latin
*/
PetscErrorCode LatinEquilibriumJammed_Private(Latin latin, Vec z, Vec work, LatinEquilibrium *found)
{
  LatinStructure structure    = latin->sub.structure;
  const PetscInt applications = latin->linear.applications;
  PetscReal     *before, *dtau;
  Vec            u;

  PetscFunctionBegin;
  if (structure->rigid_law < 0 || (structure->has_friction && !structure->ground)) PetscFunctionReturn(0);
  PetscCall(PetscMalloc2(structure->links_local, &before, structure->links_local, &dtau));
  PetscCall(PetscArraycpy(before, latin->linear.rigid_tension, structure->links_local));
  PetscCall(LatinInitialState_Private(&latin->linear, z));
  for (PetscInt k = 0; k < LATIN_JAM_STAGES && !latin->linear.failed; k++) {
    if (k == LATIN_JAM_STAGES - 1) {
      PetscCall(LatinReturnTensions_Private(&latin->linear));
      PetscCall(PetscArraycpy(dtau, latin->linear.rigid_tension, structure->links_local));
    }
    PetscCall(LatinApply_Private(&latin->linear, z, work));
    PetscCall(VecAXPBY(z, 0.5, 0.5, work)); /* damped, or tensions would oscillate */
  }
  PetscCall(DMGetGlobalVector(structure->dm, &u));
  PetscCall(LatinAverage_Private(&latin->linear, u));
  PetscCall(LatinReturnTensions_Private(&latin->linear));
  for (PetscInt l = 0; l < structure->links_local; l++) dtau[l] = latin->linear.rigid_tension[l] - dtau[l];
  if (!latin->linear.failed) PetscCall(LatinEquilibriumFarkas_Private(structure, u, PETSC_FALSE, dtau, found));
  PetscCall(DMRestoreGlobalVector(structure->dm, &u));
  PetscCall(PetscArraycpy(latin->linear.rigid_tension, before, structure->links_local));
  PetscCall(PetscFree2(before, dtau));
  latin->linear.applications = applications;
  PetscFunctionReturn(0);
}
