#include "snes/sneslatinimpl.h"

/*
   SNES latin: set-up and solve. The course of a solve (SNESLatinSolve_Private):

   1. Problem, operators, initial state (snes/problem.c).
   2. Iteration (snes/fixedpoint.c, snes/convergence.c).
   3. Newton's method (snes/takeover.c), or another search parameter (snes/searchparameter.c), and the iteration again. With large displacements
      snes/large.c instead of 2. and 3.
   4. If a solve from a guess or a warm start fails: again from rest.
   5. Reason and diagnosis.

   The equations are in stages/ and coarse/ (docs/developers.md).
*/

#define LATIN_HISTORY 1000000 /* most linear stages in the history of indicator and errors: 32 MB */

static PetscErrorCode SNESSetUp_Latin(SNES snes)
{
  SNES_Latin    *data = (SNES_Latin *)snes->data;
  LatinStructure structure;

  PetscFunctionBegin;
  snes->reason = SNES_CONVERGED_ITERATING; /* after an error no reason of an earlier solve remains */
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  PetscCheck(structure, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER,
             "-snes_type latin has no structure to work on: build one with LatinStructureCreate() and give it to this SNES with LatinStructureAttachSNES() (in Python, latinpc.Structure(...).attach(snes))");
  PetscCall(SNESLatinFollowDM_Private(snes, structure));
  PetscCall(SNESLatinFrame_Private(snes, structure, &structure));
  PetscCall(LatinSetProblem_Private(data->latin, structure, NULL));
  PetscCall(LatinSetPrefix_Private(data->latin, (PetscObject)snes));
  PetscCall(SNESLatinSetUpState_Private(snes));
  PetscCall(SNESLatinOuterSetUp_Private(snes)); /* allocates before the iteration */
  PetscFunctionReturn(0);
}

/*
   Resolves the stop auto. The indicator: if a step tolerance is given, if the problem is linear (there it shows the error), or with rigid links in
   single precision. Else the error
*/
static void SNESLatinChooseStop(SNES snes)
{
  SNES_Latin     *data   = (SNES_Latin *)snes->data;
  const Latin     latin  = data->latin;
  const PetscBool linear = (PetscBool)(!latin->sub.nonsmooth_global && latin->inter.variant == LATIN_VARIANT_PRIMAL);

  if (data->requested == LATIN_STOP_AUTO) data->stop = SNESLatinStolGiven(snes) || linear || (latin->sub.structure->rigid_law >= 0 && LatinByPrecision(PETSC_FALSE, PETSC_TRUE)) ? LATIN_STOP_INDICATOR : LATIN_STOP_ERROR;
}

/* Checks that the options of a solve are the same on all ranks. Collective on snes */
static PetscErrorCode SNESLatinSameOptions_Private(SNES snes)
{
  const SNES_Latin *data     = (SNES_Latin *)snes->data;
  const char *const names[]  = {"stop", "error", "tension_error", "balance", "largest_unbalance", "warm_start", "newton"};
  const PetscReal   values[] = {(PetscReal)data->requested, data->target, data->tension_target, data->balance, data->unbalance, (PetscReal)data->warm, (PetscReal)data->newton.type};

  PetscFunctionBegin;
  PetscCall(LatinSame_Private(PetscObjectComm((PetscObject)snes), PETSC_STATIC_ARRAY_LENGTH(values), values, LatinPrefix(&data->latin->sub), names));
  PetscFunctionReturn(0);
}

/* Checks that tolerances are numbers, and the same on all ranks. Collective on snes */
static PetscErrorCode SNESLatinCheckTolerances_Private(SNES snes)
{
  const char *const names[]  = {"stol", "rtol", "atol", "divergence_tolerance", "max_it"};
  const PetscReal   values[] = {snes->stol, snes->rtol, snes->abstol, snes->divtol, (PetscReal)snes->max_its};
  char              prefix[128];

  PetscFunctionBegin;
  PetscCheck(!PetscIsInfOrNanReal(snes->stol) && !PetscIsInfOrNanReal(snes->rtol) && !PetscIsInfOrNanReal(snes->abstol) && !PetscIsNanReal(snes->divtol), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_OUTOFRANGE,
             "A tolerance is not a finite number: stol %g, rtol %g, atol %g, divergence tolerance %g; give others with -snes_stol and so on, or SNESSetTolerances()", (double)snes->stol, (double)snes->rtol, (double)snes->abstol, (double)snes->divtol);
  PetscCall(PetscSNPrintf(prefix, sizeof(prefix), "%ssnes_", ((PetscObject)snes)->prefix ? ((PetscObject)snes)->prefix : ""));
  PetscCall(LatinSame_Private(PetscObjectComm((PetscObject)snes), PETSC_STATIC_ARRAY_LENGTH(values), values, prefix, names));
  PetscFunctionReturn(0);
}

/* Prepares a solve: checks options, allocates the history, resets counters. Collective on snes */
static PetscErrorCode SNESLatinPrepare_Private(SNES snes)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  Latin       latin = data->latin;

  PetscFunctionBegin;
  PetscCall(SNESLatinSameOptions_Private(snes));
  PetscCall(SNESLatinCheckTolerances_Private(snes));
  SNESLatinChooseStop(snes);
  PetscCheck(SNESLatinUnbalance(data) == PETSC_MAX_REAL || SNESLatinBalances(snes), PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE,
             "-snes_latin_largest_unbalance belongs to statics with -snes_latin_stop auto, error or energy, without -snes_stol: leave one of them out; the stop residual has -snes_atol");
  PetscCheck(data->tension_target <= 0.0 || data->newton.type != LATIN_NEWTON_NEVER || latin->sub.structure->rigid_law >= 0, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE,
             "-snes_latin_tension_error needs Newton's method, which estimates the error of the tensions of elastic links: leave out -snes_latin_newton never");
  PetscCheck(!SNESLatinEstimates(data) || latin->sub.structure->rigid_law < 0 || LatinByPrecision(PETSC_TRUE, PETSC_FALSE), PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP,
             "-snes_latin_stop error does not estimate the error of structures with links of the rigid law %s in single precision: take the stop indicator (-snes_stol), or a PETSc in double precision",
             LatinLaws[latin->sub.structure->rigid_law].name);
  if (data->history_size < PetscMin(snes->max_its, LATIN_HISTORY)) {
    PetscCall(PetscFree4(data->indicator, data->error_l2, data->error_energy, data->estimates));
    data->history_size = PetscMin(snes->max_its, LATIN_HISTORY);
    PetscCall(PetscMalloc4(data->history_size, &data->indicator, data->history_size, &data->error_l2, data->history_size, &data->error_energy, data->history_size, &data->estimates));
  }
  PetscCall(SNESLatinCopyReference_Private(snes));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateStart_Private(data->latin, &data->estimate));
  data->estimate.strict = data->target / SNESLatinTensionTarget(data);
  PetscCall(PetscMemzero(&data->found, sizeof(data->found)));
  PetscCall(LatinEquilibriumHeld_Private(SNESLatinLarge(data) ? data->large.frame->original : latin->sub.structure, &data->found));
  PetscCall(LatinNewtonStart_Private(&data->newton, latin->sub.structure));
  PetscCall(LatinParameterStart_Private(latin, &data->parameter));
  PetscCall(SNESLatinLargeStart_Private(snes));
  data->done = data->tested = latin->linear.applications = 0;
  data->current                                          = -1;
  data->first_distance                                   = -1.0;
  data->leapt                                            = PETSC_FALSE;
  data->residual                                         = 0.0;
  data->next                                             = data->found.verdict == LATIN_JAMMED ? LATIN_NEXT_DIVERGED : LATIN_NEXT_CONTINUE;
  PetscFunctionReturn(0);
}

/* Rebuilds the operators with another search parameter of rigid links, and restarts. Collective on snes */
static PetscErrorCode SNESLatinRebuild_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(LatinParameterTune_Private(data->latin, data->parameter.factor));
  PetscCall(SNESLatinSetUpState_Private(snes));
  PetscCall(SNESLatinCopyReference_Private(snes));
  PetscCall(SNESLatinLoad_Private(snes));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateStart_Private(data->latin, &data->estimate));
  data->guess          = PETSC_FALSE;
  data->first_distance = -1.0;
  PetscCall(SNESLatinStart_Private(snes));
  PetscCall(SNESLatinIterate_Private(snes, SNESLatinDecide_Private));
  PetscFunctionReturn(0);
}

/*
   Raises the estimates of a solve without convergence to the errors that the unbalance shows: estimates compare iterates and may be too small. With
   friction the unbalance is compared with the loads, as tensions of a diverged iterate may be far larger. Collective on snes
*/
static PetscErrorCode SNESLatinLift_Private(SNES snes)
{
  SNES_Latin             *data     = (SNES_Latin *)snes->data;
  const LatinEquilibrium *found    = &data->found;
  LatinEstimate          *estimate = &data->estimate;
  PetscReal               loads;

  PetscFunctionBegin;
  if (!SNESLatinEstimates(data)) PetscFunctionReturn(0);
  PetscCall(SNESLatinBalance_Private(snes)); /* with the tensions after the diagnosis */
  PetscCall(SNESLatinLoads_Private(snes, &loads));
  estimate->value = PetscMax(estimate->value, found->error);
  if (estimate->tensions < 0.0) PetscFunctionReturn(0);
  estimate->tensions = PetscMax(estimate->tensions, PetscMax(found->forces, found->unbalance));
  if (data->latin->sub.structure->has_friction && loads > 0.0) estimate->tensions = PetscMax(estimate->tensions, data->residual / loads);
  PetscFunctionReturn(0);
}

/* Diagnoses a solve without convergence: unsupported nodes, jammed links, rounding. Collective on snes */
static PetscErrorCode SNESLatinDiagnose_Private(SNES snes)
{
  SNES_Latin       *data  = (SNES_Latin *)snes->data;
  LatinEquilibrium *found = &data->found;
  PetscReal         size;
  PetscBool         collapsed;
  Vec               F;

  PetscFunctionBegin;
  if (SNESLatinLarge(data) || !data->latin->linear.applications) PetscFunctionReturn(0);
  if (snes->reason > 0 || data->next == LATIN_NEXT_NOT_FINITE || data->latin->linear.failed) found->nodes = found->links = 0;
  else if (!LatinEquilibriumExplained(found)) {
    PetscCall(LatinEquilibriumCheck_Private(data->latin, snes->vec_sol, snes->vec_func, snes->vec_rhs, data->target, data->estimate.energy, PETSC_FALSE, PETSC_FALSE, found));
    PetscCall(LatinStructureSize_Private(data->latin->sub.structure, &size, NULL));
    /* a diverged iterate does not prove an infinite distance (test_a_table_that_will_yield_bears_what_is_below_its_limit) */
    found->distance = PetscMin(found->distance, size);
    PetscCall(SNESLatinCollapsed_Private(snes, &collapsed));
    /* a collapse, whose large displacements round the unbalance: 2 of 150 structures with friction and contrasts */
    if (collapsed && data->next == LATIN_NEXT_ROUNDING) data->next = LATIN_NEXT_DIVERGED;
    if (SNESLatinStageLimit(snes) >= LATIN_JAM_LEAST) {
      PetscCall(VecDuplicate(data->z, &F));
      PetscCall(LatinEquilibriumJammed_Private(data->latin, data->z, F, found));
      PetscCall(VecDestroy(&F));
    }
    if (found->links) found->nodes = 0;
    else if (found->hidden && !collapsed && SNESLatinStageLimit(snes) >= LATIN_JAM_LEAST) {
      data->next           = LATIN_NEXT_ROUNDING;
      data->estimate.floor = 1.0;
    }
  }
  if (snes->reason < 0) PetscCall(SNESLatinLift_Private(snes));
  PetscFunctionReturn(0);
}

/* Runs iteration and Newton's method until data->next is an end. Collective on snes */
static PetscErrorCode SNESLatinRun_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESLatinFirst_Private(snes));
  if (data->next == LATIN_NEXT_CONTINUE && SNESLatinStageLimit(snes) <= 0) data->next = LATIN_NEXT_MAX_IT;
  if (data->next != LATIN_NEXT_CONTINUE) PetscFunctionReturn(0);
  PetscCall(SNESLatinStart_Private(snes));
  if (SNESLatinLarge(data)) {
    PetscCall(SNESLatinLargeRigid_Private(snes));
    PetscCall(SNESLatinLargeState_Private(snes)); /* for a warm start */
    PetscFunctionReturn(0);
  }
  PetscCall(SNESLatinIterate_Private(snes, SNESLatinDecide_Private));
  while (data->next >= LATIN_NEXT_NEWTON_FINISH && data->next <= LATIN_NEXT_REBUILD) {
    if (data->next == LATIN_NEXT_REBUILD) PetscCall(SNESLatinRebuild_Private(snes));
    else PetscCall(SNESLatinNewton_Private(snes, (PetscBool)(data->next == LATIN_NEXT_NEWTON_STALL)));
  }
  PetscFunctionReturn(0);
}

/*
   Returns in *vanishes whether loads or displacements are so small that their squares underflow, and norms are zero. Not in a time step: a motion
   comes to rest. Collective on snes
*/
static PetscErrorCode SNESLatinVanishes_Private(SNES snes, PetscBool *vanishes)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->latin->sub.structure;
  PetscReal            load, beside = 0.0, moved;

  PetscFunctionBegin;
  *vanishes = PETSC_FALSE;
  if (structure->ground) PetscFunctionReturn(0);
  PetscCall(VecNorm(structure->load, NORM_INFINITY, &load));
  if (snes->vec_rhs) PetscCall(VecNorm(snes->vec_rhs, NORM_INFINITY, &beside));
  PetscCall(VecNorm(snes->vec_sol, NORM_INFINITY, &moved));
  load      = PetscMax(load, beside);
  *vanishes = (PetscBool)((load > 0.0 && load < LATIN_LEAST) || (moved > 0.0 && moved < LATIN_LEAST));
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESLatinSolve_Private(SNES snes)
{
  SNES_Latin    *data  = (SNES_Latin *)snes->data;
  Latin          latin = data->latin;
  LatinStructure structure;
  PetscBool      vanishes = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCheck(!snes->xl && !snes->xu && !snes->ops->computevariablebounds, PetscObjectComm((PetscObject)snes), PETSC_ERR_ARG_WRONGSTATE, "SNES latin does not take bounds on the unknowns: unilateral behaviour is in the laws of the links");
  PetscCall(SNESLatinFindStructure_Private(snes, &structure)); /* may have changed since SNESSetUp() */
  PetscCall(SNESLatinFollowDM_Private(snes, structure));
  PetscCall(LatinStructureCheckVec_Private(structure, snes->vec_sol));
  if (snes->vec_rhs) PetscCall(LatinStructureCheckVec_Private(structure, snes->vec_rhs));
  PetscCall(SNESLatinFrame_Private(snes, structure, &structure));
  PetscCall(LatinSetProblem_Private(latin, structure, NULL));
  PetscCall(SNESLatinSetUpState_Private(snes));
  PetscCall(SNESLatinLoad_Private(snes));
  PetscCall(SNESLatinPrepare_Private(snes));
  PetscCall(SNESLatinRun_Private(snes));
  /* the start may be far from the solution: again from rest */
  if ((data->next == LATIN_NEXT_ROUNDING || data->next == LATIN_NEXT_DIVERGED) && (data->guess || SNESLatinWarm(data)) && !data->large.frame) {
    data->has_state = PETSC_FALSE;
    PetscCall(VecZeroEntries(snes->vec_sol));
    PetscCall(SNESLatinPrepare_Private(snes));
    PetscCall(SNESLatinRun_Private(snes));
  }
  PetscCall(SNESLatinVanishes_Private(snes, &vanishes));
  if (vanishes && LatinNextConverged(data->next)) data->next = LATIN_NEXT_ROUNDING;
  if (latin->linear.failed) data->next = LATIN_NEXT_FAILED;
  snes->linear_its = data->newton.stages;
  snes->iter       = latin->linear.applications + snes->linear_its;
  if (data->current < 0 && !latin->linear.applications) PetscCall(SNESLatinBalance_Private(snes)); /* of the guess, as no stage has run */
  else if (data->current < 0 || !latin->linear.failed) PetscCall(SNESLatinResidual_Private(snes));
  if (PetscIsInfOrNanReal(data->residual)) data->next = LATIN_NEXT_NOT_FINITE;
  if (data->next != LATIN_NEXT_GIVEN) snes->reason = SNESLatinReason(data->next);
  data->has_state = (PetscBool)(snes->reason > 0);
  PetscCall(SNESLatinDiagnose_Private(snes));
  if (data->next != LATIN_NEXT_GIVEN) snes->reason = SNESLatinReason(data->next);
  if (data->next == LATIN_NEXT_MAX_IT && SNESLatinStageLimit(snes) < PetscMin(snes->max_its, snes->iter + 1)) snes->reason = SNES_DIVERGED_FUNCTION_COUNT;
  if (data->next == LATIN_NEXT_ROUNDING && data->estimate.floor <= data->target) data->estimate.floor = 0.0; /* rounding did not end the solve */
  PetscFunctionReturn(0);
}

/* Removes from a structure the borrowed data of a solve that an error has ended */
static void LatinForget(LatinStructure structure)
{
  if (!structure) return;
  LatinStructurePrescribe(structure, NULL, NULL, NULL);
  structure->penalty = structure->multiplier = NULL;
}

static PetscErrorCode SNESSolve_Latin(SNES snes)
{
  SNES_Latin    *data = (SNES_Latin *)snes->data;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  snes->reason = SNES_CONVERGED_ITERATING; /* as in the set-up */
  ierr         = SNESLatinSolve_Private(snes);
  if (ierr) {
    LatinForget(data->latin->sub.structure);
    LatinForget(data->large.frame ? data->large.frame->original : NULL);
  }
  PetscCall(ierr);
  PetscFunctionReturn(0);
}

LatinWatched(SNESSetUp_Latin, SNES)
LatinWatched(SNESSolve_Latin, SNES)

static PetscErrorCode SNESReset_Latin(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  if (data->latin) PetscCall(LatinReset_Private(data->latin));
  PetscCall(SNESLatinResetState_Private(snes));
  PetscCall(PetscFree(data->large.ahead)); /* remains after an error */
  PetscFunctionReturn(0);
}

static PetscErrorCode SNESDestroy_Latin(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(SNESReset_Latin(snes));
  PetscCall(LatinDestroy_Private(&data->latin));
  PetscCall(LatinStructureDestroy(&data->large.frame));
  PetscCall(SNESDestroy(&data->outer));
  PetscCall(VecDestroy(&data->reference));
  PetscCall(PetscFree2(data->estimate.sketch, data->estimate.part));
  PetscCall(PetscFree2(data->parameter.tension, data->parameter.stretch));
  PetscCall(PetscViewerDestroy(&data->monitor));
  PetscCall(PetscFree4(data->indicator, data->error_l2, data->error_energy, data->estimates));
  PetscCall(PetscObjectComposeFunction((PetscObject)snes, "LatinRigidTensions_C", NULL));
  PetscCall(PetscFree(snes->data));
  PetscFunctionReturn(0);
}

/*MC
  SNESLATIN - the scalable multiscale LATIN domain decomposition method for structures of links, of which some are
  unilateral (cables that slacken, contacts that open)

  Options Database Keys:
+ -snes_latin_variant <auto>                    - interface unknowns of the coarse problem: all (primal), corners, weak interfaces (macro), none, published; auto: primal, or corner if most subdomains are repeated
. -snes_latin_subdomains <0>                    - number of subdomains, 0: automatic
. -snes_latin_partitioner <auto>                - metis on one rank, parallel on all, or auto
. -snes_latin_modes <affine>                    - macro fields of strong interfaces: affine, rigid
. -snes_latin_modes_local <-2>                  - local low-energy fields in the coarse space, eigenvalues below this; 0: none, -2: automatic
. -snes_latin_direction <schur>                 - micro search direction: scalar, diagonal, block, schur, auto
. -snes_latin_direction_value <0>               - stiffness of the direction scalar, of others a fraction of the interface stiffness; 0: automatic
. -snes_latin_precision <auto>                  - precision of factors: double, single, or auto: single for large ones if accurate enough
. -snes_latin_geometry <linear>                 - rotation of links by displacements: linear (none), prestress (small), large
. -snes_latin_stop <auto>                       - convergence criterion: indicator, residual, reference, error, energy; auto: the error, or the indicator if -snes_stol is given
. -snes_latin_error <0.0001>                    - estimated error of the displacements to stop at
. -snes_latin_tension_error                     - estimated error of the tensions to stop at, by default that of the displacements
. -snes_latin_balance <0.01>                    - unbalanced forces to stop at, relative to the loads
. -snes_latin_largest_unbalance <0>              - unbalanced force on a node to stop at, 0: any
. -snes_latin_warm_start <none>                 - initial state: solution vector (none), last state (last), the last two extrapolated (extrapolate)
. -snes_latin_newton <auto>                      - Newton's method on stagnation and to prove an error (auto), or never
. -snes_latin_monitor                           - prints the indicator of each linear stage
. -snes_latin_outer_snes_type <anderson>        - Anderson acceleration, or nrichardson, the plain fixed-point iteration
. -snes_latin_newton_                           - prefix of the SNES of Newton's method
. -snes_latin_friction_                         - prefix of the KSP of contacts with friction, LU by default
. -snes_latin_local_                            - prefix of the KSP of the subdomains
. -snes_latin_coarse_                           - prefix of the KSP of the coarse problem
. -snes_stol <1e-05>                            - tolerance of the indicator
. -snes_max_it <10000>                           - most linear stages
- -snes_max_funcs                                - the same, with SNES_DIVERGED_FUNCTION_COUNT; by default unlimited

  Level: beginner

  Notes:
  The structure comes from `LatinStructureAttachSNES()`. The iteration number counts linear stages.

  A nonzero solution vector is the initial guess, unless the solve starts warm: the initial tensions of links follow from their laws
  (zero in rigid links), those of interfaces balance the subdomains. A zero solution vector means the prestressed configuration.

  As a nonlinear preconditioner (`-npc_snes_type latin -npc_snes_max_it 3`) or in a `SNESCOMPOSITE` the SNES takes `-snes_max_it` linear
  stages from the displacements given, and ends with SNES_DIVERGED_MAX_IT, which the outer SNES accepts. Newton's method with
  `-snes_npc_side left` needs `-pc_type none`: PETSc has no matrix of the preconditioned function.

  `SNESGetFunctionNorm()` and `-snes_monitor` give the norm of the function, the nodal unbalance. During the iteration it and the
  solution are computed only for a monitor, a history, or the user's test or update. `-snes_latin_monitor` prints the indicator.
  A test given to `SNESSetConvergenceTest()` replaces the stop. A function given to `SNESSetUpdate()` is called before each linear
  stage; its changes take effect in the next solve. `-snes_rtol` and `-snes_atol` apply to `-snes_latin_stop residual` alone. There is no
  Jacobian that `-snes_lag_jacobian` could keep; that of Newton's method has `-snes_latin_newton_snes_lag_jacobian`.

.seealso: `LatinStructureCreate()`, `LatinStructureAttachSNES()`, `PCLATIN`
M*/
PETSC_EXTERN PetscErrorCode SNESCreate_Latin(SNES snes)
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(PetscNew(&data));
  snes->data                = (void *)data;
  snes->ops->setup          = SNESSetUp_Latin_Watched;
  snes->ops->solve          = SNESSolve_Latin_Watched;
  snes->ops->reset          = SNESReset_Latin;
  snes->ops->destroy        = SNESDestroy_Latin;
  snes->ops->setfromoptions = SNESSetFromOptions_Latin;
  snes->ops->view           = SNESView_Latin;
  snes->usesksp             = PETSC_FALSE;
  snes->usesnpc             = PETSC_FALSE;

  data->target         = LATIN_ERROR;
  data->tension_target = (PetscReal)PETSC_DEFAULT;
  data->balance        = 1e-2;
  data->requested      = LATIN_STOP_AUTO;
  data->stop           = LATIN_STOP_ERROR;

  PetscObjectParameterSetDefault(snes, max_its, 10000);
  PetscObjectParameterSetDefault(snes, max_funcs, PETSC_UNLIMITED);
  PetscObjectParameterSetDefault(snes, stol, LATIN_STOL);
  PetscCall(LatinCreate_Private(PetscObjectComm((PetscObject)snes), &data->latin));
  PetscCall(LatinSetVariant(data->latin, LATIN_VARIANT_AUTO));
  PetscCall(LatinSetPrecision(data->latin, LATIN_PRECISION_AUTO));
  PetscCall(PetscObjectComposeFunction((PetscObject)snes, "LatinRigidTensions_C", SNESLatinRigidTensions_Private));
  PetscFunctionReturn(0);
}
