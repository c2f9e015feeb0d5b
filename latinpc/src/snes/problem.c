#include "snes/sneslatinimpl.h"

/* The problem of a solve of SNES latin: structure or frame, operators, state, loads and reference, residual; and solutions that are zero to rounding. */

#define LATIN_SELF_STRESS 64.0 /* times eps and the norm of the tensions as drawn: rounding of their sums at nodes */

/*
   Restores the initial operators and penalties before a solve from rest, and the initial search parameter after a failed solve. With those of the
   last solve the path may lead to another equilibrium, or to none. Collective on snes
*/
static PetscErrorCode SNESLatinRestore_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscReal   size  = 1.0;

  PetscFunctionBegin;
  if (!(large->frame ? large->renewals && !large->frame->original->base : data->latin->tuning != 1.0 && !data->has_state) || SNESLatinWarm(data)) PetscFunctionReturn(0);
  if (snes->vec_sol) PetscCall(VecNorm(snes->vec_sol, NORM_INFINITY, &size));
  if (size > 0.0) PetscFunctionReturn(0);
  if (large->frame) { /* operators keep their pattern */
    PetscCall(LatinFramePenalty_Private(large->frame));
    PetscCall(LatinFrameRenew_Private(large->frame, NULL, LATIN_FRAME_DRAWN));
    large->renewals = 0;
  } else PetscCall(LatinParameterTune_Private(data->latin, 1.0 / data->latin->tuning));
  PetscFunctionReturn(0);
}

/* Sets *problem to the structure, or with geometry prestress or large to its frame (structure/frame.c). Collective on snes */
PetscErrorCode SNESLatinFrame_Private(SNES snes, LatinStructure structure, LatinStructure *problem)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;

  PetscFunctionBegin;
  if (large->given && !structure->base) PetscCall(LatinStructureSetGeometry(structure, large->geometry));
  if (large->frame && large->frame->original != structure) PetscCall(LatinStructureDestroy(&large->frame));
  *problem = structure;
  if (!structure->span) {
    PetscCall(LatinStructureDestroy(&large->frame));
    PetscCall(SNESLatinRestore_Private(snes));
    PetscFunctionReturn(0);
  }
  if (large->frame) {
    PetscCall(LatinFrameFollow_Private(large->frame));
    PetscCall(SNESLatinRestore_Private(snes));
  } else PetscCall(LatinFrameCreate_Private(structure, &large->frame));
  if (large->frame->spring && !SNESLatinWarm(data)) PetscCall(LatinFrameSprings_Private(large->frame, PETSC_TRUE));
  *problem = large->frame;
  PetscFunctionReturn(0);
}

/* Destroys what depends on the old structure: states, inner SNES, multipliers */
PetscErrorCode SNESLatinResetState_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESLatinOuterReset_Private(snes));
  PetscCall(SNESDestroy(&data->newton.snes));
  PetscCall(PetscFree3(data->newton.penalty, data->newton.multiplier, data->newton.tension));
  PetscCall(VecDestroy(&data->large.path.solution));
  PetscCall(PetscFree(data->large.path.held));
  PetscCall(VecDestroy(&data->z));
  PetscCall(VecDestroy(&data->z_before));
  PetscCall(PetscFree(data->reference_copy));
  data->has_before = PETSC_FALSE;
  data->has_state  = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Updates the operators after changes of the structure, and creates the state if its length has changed. Collective on snes */
PetscErrorCode SNESLatinSetUpState_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  if (data->z) { /* new laws or a new partition invalidate the state */
    PetscObjectState state;

    PetscCall(LatinParameterLoads_Private(latin));
    PetscCall(PetscObjectStateGet((PetscObject)latin->sub.structure, &state));
    if (!latin->set_up || state != latin->structure_state || latin->stale) PetscCall(SNESLatinResetState_Private(snes));
  }
  PetscCall(SNESLatinCreateOuter_Private(snes)); /* first: the user's options of the inner SNES are read before the set-up */
  PetscCall(LatinSetUp_Private(latin));
  if (!data->z) PetscCall(LatinCreateState_Private(&latin->linear, &data->z));
  PetscFunctionReturn(0);
}

/* Copies the reference displacements to the subdomains. Collective on snes */
PetscErrorCode SNESLatinCopyReference_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;
  PetscInt    n, m;

  PetscFunctionBegin;
  PetscCheck(data->stop != LATIN_STOP_REFERENCE || data->reference, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER,
             "-snes_latin_stop reference needs reference displacements: call SNESLatinSetReference() (in Python, latinpc.set_reference(snes, u); on the command line, --reference)");
  if (!data->reference) PetscFunctionReturn(0);
  PetscCall(VecGetSize(data->reference, &n));
  PetscCall(VecGetSize(latin->sub.structure->load, &m));
  PetscCheck(n == m, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_SIZ, "The reference has %" PetscInt_FMT " entries, the structure %" PetscInt_FMT " free degrees of freedom", n, m);
  PetscCall(LatinStructureCheckVec_Private(latin->sub.structure, data->reference));
  if (!data->reference_copy) PetscCall(PetscMalloc1(latin->sub.structure->dim * latin->sub.copies, &data->reference_copy));
  PetscCall(PetscArraycpy(data->reference_copy, latin->sub.prescribed, latin->sub.structure->dim * latin->sub.copies));
  PetscCall(LatinDistribute_Private(&latin->sub, data->reference, data->reference_copy));
  PetscFunctionReturn(0);
}

/* F(x) = b: adds b to the loads. Collective on snes */
PetscErrorCode SNESLatinLoad_Private(SNES snes)
{
  Latin latin = ((SNES_Latin *)snes->data)->latin;
  Vec   load;

  PetscFunctionBegin;
  if (!snes->vec_rhs) PetscFunctionReturn(0);
  PetscCall(VecDuplicate(latin->sub.structure->load, &load));
  PetscCall(LatinStructureLoads_Private(latin->sub.structure, snes->vec_rhs, load));
  PetscCall(LatinLinearSetLoads(&latin->linear, load));
  PetscCall(VecDestroy(&load));
  latin->load_state = -1;
  PetscFunctionReturn(0);
}

/* Computes the l2 norm of the loads at free degrees of freedom. Collective on snes */
PetscErrorCode SNESLatinLoads_Private(SNES snes, PetscReal *norm)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->latin->sub.structure;
  Vec                  load;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &load));
  PetscCall(LatinStructureLoads_Private(structure, snes->vec_rhs, load));
  PetscCall(VecNorm(load, NORM_2, norm));
  PetscCall(DMRestoreGlobalVector(structure->dm, &load));
  PetscFunctionReturn(0);
}

/* Computes the l2 norm of what moves the structure: the loads, or without any the tensions as drawn. Collective on snes */
PetscErrorCode SNESLatinDrive_Private(SNES snes, PetscReal *norm)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinLoads_Private(snes, norm));
  if (!(*norm > 0.0)) PetscCall(LatinStructureDrawn_Private(((SNES_Latin *)snes->data)->latin->sub.structure, norm));
  PetscFunctionReturn(0);
}

/*
   Returns in *rests whether the drawing is in equilibrium, but for rounding: its tensions balance the loads, with `more`, and rigid links bear
   nothing and are within their gaps. Not if rounding hides the loads. Collective on structure
*/
static PetscErrorCode LatinDrawnRests_Private(LatinStructure structure, Vec more, PetscBool *rests)
{
  PetscReal bearing[2] = {0.0, 0.0}, left, loads, *tension; /* squared tensions; 1 if a rigid link would bear */
  Vec       u, r;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &u));
  PetscCall(DMGetGlobalVector(structure->dm, &r));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(VecZeroEntries(u));
  PetscCall(LatinStructureStrains_Private(structure, u, tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal strain = tension[l];

    if (LatinLaws[structure->law[l]].rigid && structure->law[l] != LATIN_LAW_TANGENT && LatinLawSign(structure->law[l]) * strain > 0.0) bearing[1] = 1.0;
    tension[l] = LatinStructureTension(structure, NULL, l, strain);
    bearing[0] += PetscSqr(tension[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, bearing, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinStructureLoads_Private(structure, more, r));
  PetscCall(VecNorm(r, NORM_2, &loads));
  PetscCall(LatinStructureForces_Private(structure, tension, u, structure->load, r));
  if (more) PetscCall(VecAXPY(r, -1.0, more));
  PetscCall(VecNorm(r, NORM_2, &left));
  bearing[0] = LATIN_SELF_STRESS * PETSC_MACHINE_EPSILON * PetscSqrtReal(bearing[0]);
  *rests     = (PetscBool)(left <= bearing[0] && bearing[1] == 0.0 && (loads == 0.0 || loads > bearing[0]));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(DMRestoreGlobalVector(structure->dm, &r));
  PetscCall(DMRestoreGlobalVector(structure->dm, &u));
  PetscFunctionReturn(0);
}

/*
   Returns in *rests whether displacements of this l2 norm are only rounding of a self-stress, and have no accurate digit: the drawing is in
   equilibrium, and they are below the rounding of coordinates. Not for rigid links, whose tensions are unknown, nor in a time step. Collective on
   structure
*/
PetscErrorCode LatinSelfStress_Private(LatinStructure structure, Vec more, PetscReal moved, PetscBool *rests)
{
  PetscReal least;

  PetscFunctionBegin;
  *rests = PETSC_FALSE;
  if (structure->rigid_law >= 0 || structure->ground) PetscFunctionReturn(0);
  PetscCall(LatinEquilibriumPoint_Private(structure, &least));
  if (moved <= least) PetscCall(LatinDrawnRests_Private(structure, more, rests));
  PetscFunctionReturn(0);
}

/*
   Starts the solve at zero displacements if the drawing is in equilibrium without loads. From the last state or a guess, displacements would decrease
   to the least numbers, as zero has no relative accuracy; from the initial state they may drift along slack links. Not with turning links, which may
   have other equilibria, nor in a time step. Collective on snes
*/
PetscErrorCode SNESLatinAtRest_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->latin->sub.structure;
  PetscReal      loads;
  PetscBool      rests = PETSC_FALSE;

  PetscFunctionBegin;
  if (structure->span || structure->ground || data->large.frame) PetscFunctionReturn(0);
  PetscCall(SNESLatinLoads_Private(snes, &loads));
  if (loads == 0.0) PetscCall(LatinDrawnRests_Private(structure, snes->vec_rhs, &rests));
  if (!rests) PetscFunctionReturn(0);
  PetscCall(VecZeroEntries(snes->vec_sol));
  data->guess     = PETSC_TRUE;
  data->has_state = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Computes the function, the nodal unbalance, at the solution vector, and its norm. Collective on snes */
PetscErrorCode SNESLatinBalance_Private(SNES snes)
{
  SNES_Latin    *data = (SNES_Latin *)snes->data;
  LatinStructure structure;

  PetscFunctionBegin;
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  if (data->stop == LATIN_STOP_RESIDUAL) PetscCall(SNESComputeFunction(snes, snes->vec_sol, snes->vec_func));
  else PetscCall(LatinSolverUnbalance_Private(snes, structure, snes->vec_sol, snes->vec_func));
  PetscCall(VecNorm(snes->vec_func, NORM_2, &data->residual));
  snes->norm    = data->residual;
  data->current = data->latin->linear.applications;
  PetscFunctionReturn(0);
}

/* Computes the solution vector, the mean displacements of the subdomains, and the function, their nodal unbalance, once per linear stage. Collective on snes */
PetscErrorCode SNESLatinResidual_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  if (data->current == data->latin->linear.applications) PetscFunctionReturn(0);
  PetscCall(LatinAverage_Private(&data->latin->linear, snes->vec_sol));
  PetscCall(LatinReturnTensions_Private(&data->latin->linear));
  PetscCall(SNESLatinBalance_Private(snes));
  PetscFunctionReturn(0);
}
