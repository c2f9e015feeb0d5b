#include "snes/sneslatinimpl.h"

/*
   Grains: structures of rigid links alone, with friction. If all gaps are closed as drawn, statically admissible tensions inside the friction cones
   are a solution: nothing moves, so no contact slips, as between walls that press with the least friction that holds (tests/test_friction_notices.py).
   Without such tensions the structure collapses (structure/frictioncones.c).
*/

/*
   Returns in *collapsed whether a structure with friction has collapsed: displacements are larger than the structure, and forces do not balance.
   Collective on snes
*/
PetscErrorCode SNESLatinCollapsed_Private(SNES snes, PetscBool *collapsed)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  PetscReal            loads;

  PetscFunctionBegin;
  *collapsed = PETSC_FALSE;
  if (!structure->has_friction || structure->ground) PetscFunctionReturn(0);
  PetscCall(SNESLatinResidual_Private(snes));
  PetscCall(SNESLatinLoads_Private(snes, &loads));
  if (data->residual > data->target * loads) PetscCall(LatinEquilibriumFar_Private(structure, snes->vec_sol, collapsed));
  PetscFunctionReturn(0);
}

/* Returns in *closed whether all gaps are closed at zero displacements, with supports as prescribed. Collective on structure */
static PetscErrorCode LatinGrainsClosed_Private(LatinStructure structure, PetscBool *closed)
{
  PetscReal *x;
  Vec        zero;

  PetscFunctionBegin;
  *closed = PETSC_TRUE;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(DMGetGlobalVector(structure->dm, &zero));
  PetscCall(VecZeroEntries(zero));
  PetscCall(LatinStructureStrains_Private(structure, zero, x));
  for (PetscInt l = 0; l < structure->links_local; l++) *closed = (PetscBool)(*closed && x[l] == 0.0);
  PetscCall(DMRestoreGlobalVector(structure->dm, &zero));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &x));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, closed, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}

/*
   Returns in *hold whether tensions are inside the friction cones, to `part` of the largest tension. In space the edges of the polyhedral cones of
   LatinConesCreate_Private() are outside. Collective on structure
*/
static PetscErrorCode LatinGrainsHold_Private(LatinStructure structure, PetscReal part, const PetscReal tension[], PetscBool *hold)
{
  const PetscInt dim    = structure->dim;
  PetscReal      sum[2] = {0.0, 0.0}; /* largest tension; largest distance from a friction cone */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal rub = 0.0;

    sum[0] = PetscMax(sum[0], PetscAbsReal(tension[l]));
    if (structure->law[l] != LATIN_LAW_FRICTION) continue;
    for (PetscInt c = 1; c < dim; c++) rub += PetscSqr(tension[l + c]);
    sum[1] = PetscMax(sum[1], PetscSqrtReal(rub) + structure->friction[l] * tension[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  *hold = (PetscBool)(sum[1] <= part * sum[0]);
  PetscFunctionReturn(0);
}

/* Accepts tensions at zero displacements as solution, if their unbalance is below the requested errors. Collective on snes */
static PetscErrorCode SNESLatinGrainsRest_Private(SNES snes, const PetscReal bears[], LatinNext *next)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscReal   loads;

  PetscFunctionBegin;
  PetscCall(VecZeroEntries(snes->vec_sol));
  PetscCall(PetscArraycpy(data->latin->linear.rigid_tension, bears, data->latin->sub.structure->links_local));
  PetscCall(SNESLatinBalance_Private(snes));
  PetscCall(SNESLatinLoads_Private(snes, &loads));
  if (data->residual <= PetscMin(data->target, SNESLatinTensionTarget(data)) * loads) {
    *next                   = LATIN_NEXT_CONVERGED;
    data->estimate.value    = 0.0;
    data->estimate.tensions = data->residual / loads;
  } else data->current = -1; /* recompute the mean displacements */
  PetscFunctionReturn(0);
}

/*
   Searches once per solve for tensions inside the friction cones. *next: LATIN_NEXT_DIVERGED without equilibrium, LATIN_NEXT_CONVERGED if the
   tensions are a solution at zero displacements; else unchanged. Collective on snes
*/
PetscErrorCode SNESLatinAdmissible_Private(SNES snes, LatinNext *next)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  PetscBool            held, closed = PETSC_FALSE;
  PetscReal           *bears;

  PetscFunctionBegin;
  if (structure->ground || data->newton.collapse_searched) PetscFunctionReturn(0);
  data->newton.limit             = SNESLatinStageLimit(snes) - data->latin->linear.applications;
  data->newton.collapse_searched = PETSC_TRUE;
  if (data->newton.grains) PetscCall(LatinGrainsClosed_Private(structure, &closed));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &bears));
  PetscCall(LatinNewtonCones_Private(data->latin, &data->newton, snes->vec_rhs, bears, &held));
  if (held && closed) PetscCall(LatinGrainsHold_Private(structure, data->target, bears, &held));
  if (data->newton.found.verdict == LATIN_UNBOUNDED) {
    data->found = data->newton.found;
    *next       = LATIN_NEXT_DIVERGED;
  } else if (held && closed && SNESLatinEstimates(data)) PetscCall(SNESLatinGrainsRest_Private(snes, bears, next));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &bears));
  PetscFunctionReturn(0);
}

/* Runs the same search at the end of a failed solve, or if grains have collapsed. Collective on snes */
PetscErrorCode SNESLatinGrains_Private(SNES snes, LatinNext *next)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  PetscBool            due       = (PetscBool)(*next == LATIN_NEXT_DIVERGED || (*next == LATIN_NEXT_MAX_IT && SNESLatinStageLimit(snes) >= LATIN_JAM_LEAST));

  PetscFunctionBegin;
  if (!structure->has_friction || data->newton.type == LATIN_NEWTON_NEVER || data->newton.collapse_searched) PetscFunctionReturn(0);
  if (data->newton.grains && *next == LATIN_NEXT_CONTINUE && data->latin->linear.applications % LATIN_COLLAPSE_WINDOW == 0) PetscCall(SNESLatinCollapsed_Private(snes, &due));
  if (due) PetscCall(SNESLatinAdmissible_Private(snes, next));
  PetscFunctionReturn(0);
}
