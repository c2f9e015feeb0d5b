#include "snes/sneslatinimpl.h"

/*
   Newton's method where links turn by large angles. Its linear solver is conjugate gradients on the tangent stiffness (GMRES in time steps), preconditioned
   by the operators of the iteration.

   Tensions ahead of the displacements [D. Magisano, L. Leonetti, G. Garcea 2017]: the geometric part of the tangent stiffness has the tensions of the
   linearised strains that the last step predicted, not those of the actual lengths. The length of a bar that turns by a few degrees is wrong by more than
   what it bears. So whole steps are taken. At the solution both tensions agree. A slack cable keeps a stiffness in proportion to the step: a falling chain
   needs it.

   After the iteration, strains are separate unknowns: laws continue as straight lines from the strains predicted by the last step, at first those of the
   last local stage. So these strains, not the lengths, decide which cables are slack. No cable alternates between taut and slack as it turns; nets with half
   of their cables changing need a few whole steps. New operators are made once many links have changed: each costs up to a linear iteration.

   Error after a step (LatinLargeError_Private):
   - Displacements: the norm of the unbalanced forces in the operators, relative to that before the step, is the part of the step that remains as error: both
     are linear in it. Fields that the operators make too stiff are underestimated, by no more than the least eigenvalue seen by the linear solve (least
     singular value in time steps, whose tangents are not symmetric).
   - Cables that change between taut and slack add error, so the step itself must be small. If it softens links, their operators are too stiff, and one more
     step is taken: a front of slackening cables advances in steps of equal length, each of which leaves a thousandth of its forces.
   - Tensions: the same part of their change, or their difference from the tensions ahead.
*/

#define LATIN_LARGE_STEPS   50   /* most steps of one run */
#define LATIN_LARGE_LEAST   4    /* iterations of a linear solve near the solution, at least, and 1 per changed link; fewer: a net claimed 1/400 of its error */
#define LATIN_LARGE_CHANGES 100  /* links whose stiffness differs from the operators from which on new ones are made; each costs up to one linear iteration */
#define LATIN_LARGE_LONG    20   /* most linear iterations with one set of operators, in time steps the cost of a set-up; 5: fails with weak interfaces */
#define LATIN_LARGE_STALE   0.5  /* the same along a path, relative to the cost of a set-up; 0.25: half the iterations, twice the set-ups, equal time */
#define LATIN_LARGE_RTOL    1e-2 /* rtol of a linear solve; a smaller one gains nothing after the next step */
#define LATIN_LARGE_FINER   0.1  /* factor on this rtol along a path, far from the solution; without it soft displacements are lost next to a limit point */
#define LATIN_LARGE_STEP    2.0  /* divergence: step relative to the displacements after it; 1: a bridge takes twice the set-ups, none: a truss snaps through */
#define LATIN_LARGE_PROOF   4.0  /* largest step whose error is computed, relative to the requested error; larger ones are not worth the linear stage */
#define LATIN_LARGE_SHRINK  0.5  /* a step leaves less than this part of the error before it, or has met rounding */
#define LATIN_LARGE_ROUND   10.0 /* steps below this multiple of the rounding error may be rounding */
#define LATIN_LARGE_NOISE   64.0 /* rounding of forces: times eps and the norm of the tensions, each times size over length */
#define LATIN_LARGE_PREDICT 500  /* most iterations of the linear solve for a tangent prediction */

/* Computes the norm of the residual r that the linear solver uses: by default sqrt(r^t K^-1 r), K the operators of the iteration. Collective on newton */
static PetscErrorCode LatinLargeNorm_Private(SNES newton, LatinLarge *large, Vec r, PetscReal *norm)
{
  KSPNormType type;
  PetscScalar product;
  KSP         ksp;
  PC          pc;
  Vec         w;

  PetscFunctionBegin;
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPGetNormType(ksp, &type));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(DMGetGlobalVector(large->frame->dm, &w));
  if (type == KSP_NORM_UNPRECONDITIONED) PetscCall(VecCopy(r, w));
  else PetscCall(PCApply(pc, r, w));
  PetscCall(VecDot(type == KSP_NORM_NATURAL ? r : w, w, &product));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &w));
  *norm = PetscSqrtReal(PetscAbsReal(PetscRealPart(product)));
  large->run.proofs++;
  PetscFunctionReturn(0);
}

/* Ends a linear solve at its tolerance, tighter far from the solution along a path and in the first iterations near it, or after large->run.limit iterations */
static PetscErrorCode LatinLargeLinear_Private(KSP ksp, PetscInt it, PetscReal rnorm, KSPConvergedReason *reason, void *ctx)
{
  LatinLarge     *large = (LatinLarge *)ctx;
  const PetscBool near  = (PetscBool)(large->frame->original->hold <= LATIN_LARGE_HOLD * large->near);
  PetscReal       rtol, part = near || large->frame->original->midpoint ? 1.0 : LATIN_LARGE_FINER;

  PetscFunctionBegin;
  *reason = KSP_CONVERGED_ITERATING;
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  if (near && it < LATIN_LARGE_LEAST + large->run.changed) part = rtol;
  if (!it) large->run.first = rnorm;
  if (PetscIsInfOrNanReal(rnorm)) *reason = KSP_DIVERGED_NANORINF;
  else if (rnorm <= part * rtol * large->run.first) *reason = KSP_CONVERGED_RTOL;
  else if (it >= large->run.limit) *reason = KSP_DIVERGED_ITS;
  PetscFunctionReturn(0);
}

/*
   Computes the root mean square of the differences of tensions a - b relative to b; 0 if without loads b are rounding errors of the
   lengths. Collective on large->frame
*/
static PetscErrorCode LatinLargeDifference_Private(const LatinLarge *large, const PetscReal a[], const PetscReal b[], PetscReal *difference)
{
  const LatinStructure structure = large->frame->original;
  PetscReal            sum[3]    = {0.0, 0.0, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    sum[0] += PetscSqr(a[l] - b[l]);
    sum[1] += PetscSqr(b[l]);
    for (PetscInt c = 0; c < structure->dim && !(large->loads > 0.0); c++) sum[2] += PetscSqr(structure->stiffness[l] * structure->span[structure->dim * l + c]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *difference = sum[1] > PetscSqr(LATIN_LARGE_NOISE * PETSC_MACHINE_EPSILON) * sum[2] ? PetscSqrtReal(sum[0] / sum[1]) : 0.0;
  PetscFunctionReturn(0);
}

/*
   Estimates the relative errors of displacements and tensions after a step to u, with the residual r there. step: its length relative to
   the displacements. Collective on newton
*/
static PetscErrorCode LatinLargeError_Private(SNES newton, LatinLarge *large, PetscReal step, Vec u, Vec r, PetscReal *error, PetscReal *tensions)
{
  const LatinStructure structure = large->frame->original;
  PetscReal           *tension, norm = 0.0, most, least = 1.0, left, part, moved;
  KSPNormType          type;
  KSP                  ksp;

  PetscFunctionBegin;
  PetscCall(LatinLargeNorm_Private(newton, large, r, &norm));
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPComputeExtremeSingularValues(ksp, &most, &least));
  PetscCall(KSPGetNormType(ksp, &type));
  PetscCall(VecNorm(u, NORM_2, &moved));
  left   = least > 0.0 ? norm / PetscMin(1.0, least) : PETSC_MAX_REAL;
  part   = left < large->run.first ? LATIN_LARGE_SAFETY * left / (large->run.first - left) : PETSC_MAX_REAL; /* sum of the geometric series of the next steps */
  *error = part * step;
  /* an absolute bound as well: soft nodes, as those without mass, may hide the error of others in the relative one */
  if (type == KSP_NORM_PRECONDITIONED && moved > 0.0) *error = PetscMax(*error, LATIN_LARGE_SAFETY * left / moved);
  *error    = PetscMin(1.0, *error);
  *tensions = 0.0;
  if (!large->ahead) PetscFunctionReturn(0);
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinTurningTensions_Private(structure, NULL, u, tension));
  PetscCall(LatinLargeDifference_Private(large, large->ahead, tension, tensions));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  *tensions = PetscMin(1.0, PetscMax(*tensions, part * large->run.stretch));
  PetscFunctionReturn(0);
}

/* Computes the unbalanced forces r at u with the laws themselves, not their straight lines, and their norm. Collective on newton */
static PetscErrorCode LatinLargeUnbalance_Private(SNES newton, LatinLarge *large, Vec u, Vec r, PetscReal *norm)
{
  const LatinStructure   structure = large->frame->original;
  const PetscReal *const strain    = structure->strain;

  PetscFunctionBegin;
  structure->strain = NULL;
  PetscCall(SNESComputeFunction(newton, u, r));
  structure->strain = strain;
  PetscCall(VecNorm(r, NORM_2, norm));
  PetscFunctionReturn(0);
}

/* Result of a step */
typedef struct {
  PetscInt           it;
  PetscReal          length;       /* relative to the displacements after it */
  PetscReal          floor;        /* rounding error of these, at least that of the coordinates */
  PetscReal          before;       /* error after the step before */
  PetscReal          tensions;     /* estimated error of the tensions */
  PetscBool          small;        /* so that its error is estimated */
  PetscBool          far;          /* displacements are larger than the structure */
  KSPConvergedReason linear;       /* of the linear solve */
  PetscInt           stages, last; /* linear iterations: of all steps, of this one */
} LatinLargeSeen;

/* Estimates the errors after a step. Collective on newton */
static PetscErrorCode LatinLargeMeasure_Private(SNES newton, SNES snes, LatinLargeSeen *seen)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  LatinLarge          *large     = &data->large;
  LatinLargeRun       *run       = &large->run;
  const LatinStructure structure = large->frame->original;
  KSP                  ksp;
  Vec                  r, u;

  PetscFunctionBegin;
  PetscCall(SNESGetSolution(newton, &u));
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(LatinLargeUnbalance_Private(newton, large, u, r, &run->force));
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPGetConvergedReason(ksp, &seen->linear));
  PetscCall(SNESGetLinearSolveIterations(newton, &seen->stages));
  PetscCall(KSPGetIterationNumber(ksp, &seen->last));
  seen->before = seen->it > 1 ? run->error : PETSC_MAX_REAL;
  seen->small  = (PetscBool)(seen->length <= LATIN_LARGE_PROOF * data->target);
  run->error = seen->tensions = seen->length;
  if (seen->it == 1) {
    run->first_step[0] = seen->linear > 0 ? seen->length : 1.0;
    run->first_step[1] = run->stretch;
  }
  /* in other cases PETSc has no singular values of the last iteration */
  if (seen->small && (seen->linear > 0 || seen->linear == KSP_DIVERGED_ITS)) PetscCall(LatinLargeError_Private(newton, large, seen->length, u, r, &run->error, &seen->tensions));
  else if (seen->small) run->error = seen->tensions = 1.0;
  PetscCall(LatinEquilibriumFar_Private(structure, u, &seen->far));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscCall(PetscInfo(snes, "Newton's method, step %" PetscInt_FMT ": %g, estimated error %g of %g, of tensions %g, unbalanced forces %g of %g\n", seen->it, (double)seen->length, (double)run->error, (double)data->target, (double)seen->tensions,
                      (double)run->force, (double)large->balance));
  if (structure->strain) PetscCall(LatinFrameChanged_Private(large->frame, structure->strain, &run->changed));
  data->estimate.tensions = large->ahead ? seen->tensions : -1.0;
  PetscFunctionReturn(0);
}

/* Returns how Newton's method ends after a step; large->run.error: of the displacements there */
static SNESConvergedReason LatinLargeReason(const SNES_Latin *data, LatinLarge *large, const LatinLargeSeen *seen)
{
  LatinLargeRun  *run        = &large->run;
  const PetscBool unbalanced = (PetscBool)(run->force > large->balance);
  const PetscBool rounding   = (PetscBool)(seen->length < LATIN_LARGE_ROUND * seen->floor); /* the step may be rounding */
  const PetscBool small      = (PetscBool)(run->error <= data->target && seen->tensions <= SNESLatinTensionTarget(data));

  if (seen->linear == KSP_DIVERGED_INDEFINITE_MAT) return SNES_DIVERGED_LINEAR_SOLVE;
  if (seen->it > 1 && large->ahead && seen->length > LATIN_LARGE_STEP && unbalanced) return SNES_DIVERGED_DTOL;
  if (seen->linear > 0 && seen->small && !run->softer && small && run->force <= large->balance) return SNES_CONVERGED_SNORM_RELATIVE;
  if (seen->far && unbalanced && rounding) return SNES_DIVERGED_DTOL; /* large displacements make any relative step small */
  if (rounding && run->error > LATIN_LARGE_SHRINK * seen->before) {
    run->error = PetscMax(seen->length, seen->floor);
    return run->error <= data->target && run->force <= large->balance ? SNES_CONVERGED_SNORM_RELATIVE : SNES_DIVERGED_LOCAL_MIN;
  }
  if (seen->it >= LATIN_LARGE_STEPS || seen->stages >= run->most) return SNES_DIVERGED_MAX_IT;
  if (large->iterated && seen->stages + seen->last > run->most) return SNES_DIVERGED_MAX_IT; /* another solve as long as the last one would be cut short */
  if (large->frame->original->strain && run->changed > LATIN_LARGE_CHANGES) return SNES_DIVERGED_MAX_IT;
  return SNES_CONVERGED_ITERATING;
}

static PetscErrorCode LatinLargeConverged_Private(SNES newton, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  SNES_Latin          *data      = (SNES_Latin *)((SNES)ctx)->data;
  LatinLarge          *large     = &data->large;
  const LatinStructure structure = large->frame->original;
  LatinLargeSeen       seen      = {.it = it};
  SNESLineSearch       search;
  PetscReal            part;
  PetscInt             n;
  PetscBool            rests;

  PetscFunctionBegin;
  *reason = SNES_CONVERGED_ITERATING;
  PetscCall(SNESGetLineSearch(newton, &search));
  PetscCall(SNESLineSearchGetLambda(search, &part));
  if (!it) PetscCall(VecNorm(newton->vec_sol, NORM_2, &xnorm)); /* PETSc passes 0 before the first step */
  rests = (PetscBool)(fnorm <= LATIN_LARGE_NOISE * PETSC_MACHINE_EPSILON * large->run.tension && xnorm <= LATIN_LARGE_NONE * large->size);
  if (PetscIsInfOrNanReal(fnorm) || PetscIsInfOrNanReal(snorm)) *reason = SNES_DIVERGED_FUNCTION_NANORINF;
  else if (rests) { /* the unbalanced forces are rounding of a self-stress */ large->run.error = 0.0;
    *reason                                                                                    = SNES_CONVERGED_FNORM_ABS;
  }
  if (*reason || !it) PetscFunctionReturn(0);
  seen.length = xnorm > 0.0 ? snorm / (part * xnorm) : 0.0; /* of the whole step: a damped one is small without convergence as well */
  PetscCall(VecGetSize(newton->vec_sol, &n));
  seen.floor = data->estimate.floor;
  if (xnorm > 0.0) seen.floor = PetscMax(seen.floor, PETSC_MACHINE_EPSILON * large->size * PetscSqrtReal((PetscReal)n) / xnorm);
  PetscCall(LatinLargeMeasure_Private(newton, (SNES)ctx, &seen));
  structure->hold = (structure->strain ? LATIN_LARGE_HELD : LATIN_LARGE_HOLD) * PetscMin(1.0, seen.length);
  *reason         = LatinLargeReason(data, large, &seen);
  PetscFunctionReturn(0);
}

/*
   Updates the tensions ahead: those at u plus the change predicted by the step, which is subtracted from u. Counts the links that it
   softens, large->run.softer. Collective on large->frame
*/
static PetscErrorCode LatinLargeAhead_Private(LatinLarge *large, Vec u, Vec step)
{
  const LatinStructure structure = large->frame->original;
  PetscReal           *tension, *strain = large->ahead + structure->links_local;

  PetscFunctionBegin;
  if (!large->ahead) PetscFunctionReturn(0);
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  for (PetscInt l = 0; l < structure->links_local; l++) tension[l] = LatinStructureTangent(structure, l, strain[l]);
  PetscCall(LatinTurningAhead_Private(structure, u, NULL, step, -1.0, large->ahead, strain));
  large->run.softer = 0;
  for (PetscInt l = 0; l < structure->links_local; l++) large->run.softer += tension[l] > LatinStructureTangent(structure, l, strain[l]) ? 1 : 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &large->run.softer, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinTurningTensions_Private(structure, NULL, u, tension));
  PetscCall(LatinLargeDifference_Private(large, tension, large->ahead, &large->run.stretch));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscFunctionReturn(0);
}

/* Line search: takes the whole step and updates the tensions ahead of the displacements. Collective on the SNES */
static PetscErrorCode LatinLargeWhole_Private(SNESLineSearch search, void *ctx)
{
  SNES newton;
  Vec  u, f, step;

  PetscFunctionBegin;
  PetscCall(SNESLineSearchGetSNES(search, &newton));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(SNESLineSearchGetVecs(search, &u, &f, &step, NULL, NULL));
  PetscCall(LatinLargeAhead_Private(&((SNES_Latin *)((SNES)ctx)->data)->large, u, step));
  PetscCall(VecAXPY(u, -1.0, step));
  PetscCall(SNESComputeFunction(newton, u, f));
  PetscCall(SNESLineSearchSetLambda(search, 1.0));
  PetscCall(SNESLineSearchComputeNorms(search));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLargeJacobian_Private(SNES newton, Vec u, Mat A, Mat P, void *ctx)
{
  PetscFunctionBegin;
  (void)newton;
  (void)P;
  PetscCall(LatinTurningMatCompute_Private((LatinStructure)ctx, u, A));
  PetscFunctionReturn(0);
}

/* Creates the inner SNES, prefix -snes_latin_newton_, unless there is one. Collective on snes */
static PetscErrorCode LatinLargeCreate_Private(SNES snes, SNES *newnewton)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->original;
  SNES           newton;
  KSP            ksp;
  PC             pc;
  Mat            A;
  PetscBool      is;

  PetscFunctionBegin;
  if (*newnewton) PetscFunctionReturn(0);
  /* tangents of a time step are not symmetric */
  PetscCall(SNESLatinInner_Private(snes, LatinLargeWhole_Private, snes, structure->midpoint ? KSPGMRES : KSPCG, &newton));
  PetscCall(SNESSetMaxLinearSolveFailures(newton, PETSC_MAX_INT)); /* a linear solve cut short still gives a step */
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPSetTolerances(ksp, LATIN_LARGE_RTOL, PETSC_DEFAULT, PETSC_MAX_REAL, LATIN_LARGE_PREDICT));
  PetscCall(KSPSetComputeSingularValues(ksp, PETSC_TRUE));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCLatinShare_Private(pc, data->latin));
  PetscCall(SNESLatinInnerOptions_Private(newton, &is));
  PetscCall(SNESSetConvergenceTest(newton, LatinLargeConverged_Private, snes, NULL));
  PetscCall(KSPSetConvergenceTest(ksp, LatinLargeLinear_Private, &data->large, NULL));
  PetscCall(LatinStructureAttachSNES(structure, newton));
  *newnewton = newton;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  if (!is) PetscFunctionReturn(0);
  PetscCall(LatinTurningMatCreate_Private(structure, &A));
  PetscCall(SNESSetJacobian(newton, A, A, LatinLargeJacobian_Private, structure));
  PetscCall(MatDestroy(&A));
  PetscFunctionReturn(0);
}

/*
   Computes the l2 norm of what rounding of coordinates multiplies: the tensions at u, each times size over length, since rounding turns the
   link (unless it keeps its direction); without loads also stiffness times size, since rounding changes lengths. Collective on snes
*/
static PetscErrorCode LatinLargeTension_Private(SNES snes, PetscReal *norm)
{
  const LatinLarge    *large     = &((SNES_Latin *)snes->data)->large;
  const LatinStructure structure = large->frame->original;
  const PetscInt       dim       = structure->dim;
  PetscReal           *tension, loads;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinTurningTensions_Private(structure, NULL, snes->vec_sol, tension));
  PetscCall(SNESLatinLoads_Private(snes, &loads));
  *norm = 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal square = 0.0;

    for (PetscInt c = 0; c < dim; c++) square += PetscSqr(structure->span[dim * l + c]);
    if (!(loads > 0.0) && !LatinLaws[structure->law[l]].rigid) *norm += PetscSqr(structure->stiffness[l] * large->size);
    *norm += PetscSqr(tension[l]) * (1.0 + (LatinStructureKeeps(structure, l) ? 0.0 : PetscSqr(large->size) / square));
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, norm, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *norm = PetscSqrtReal(*norm);
  PetscFunctionReturn(0);
}

/*
   Returns in *rests whether the solution vector is zero but for rounding and leaves only rounding errors of a self-stress, as at a form
   found before. Collective on snes
*/
PetscErrorCode SNESLatinLargeRests_Private(SNES snes, PetscBool *rests)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  PetscReal         left, moved, tension;
  Vec               r;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(SNESComputeFunction(snes, snes->vec_sol, r));
  PetscCall(VecNorm(r, NORM_2, &left));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscCall(VecNorm(snes->vec_sol, NORM_2, &moved));
  PetscCall(LatinLargeTension_Private(snes, &tension));
  *rests = (PetscBool)(left <= LATIN_LARGE_NOISE * PETSC_MACHINE_EPSILON * tension && moved <= LATIN_LARGE_NONE * large->size);
  PetscFunctionReturn(0);
}

/* Accepts the displacements in the solution vector as solution with this error. Collective on snes */
PetscErrorCode SNESLatinLargeClaim_Private(SNES snes, PetscReal error, LatinNext next)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  data->large.frame->original->strain = NULL; /* the laws themselves, not their straight lines */
  data->estimate.value                = error;
  data->next                          = next;
  PetscCall(SNESLatinBalance_Private(snes));
  PetscCall(SNESLatinWatch_Private(snes, data->latin->linear.applications + data->newton.stages));
  if (data->next == LATIN_NEXT_CONTINUE) data->next = LATIN_NEXT_CONVERGED;
  PetscFunctionReturn(0);
}

/* Copies the displacements u to all copies of the nodes; operators made anew do not have them. Collective on latin */
static PetscErrorCode LatinLargeCopies_Private(Latin latin, Vec u)
{
  const LatinSubdomains *sub = &latin->sub;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++)
    if (sub->fixed[i]) latin->linear.U[i] = sub->prescribed[i];
  PetscCall(LatinDistribute_Private(sub, u, latin->linear.U));
  PetscFunctionReturn(0);
}

/*
   Runs Newton's method from the displacements in the solution vector with the present operators. *done: the error is proved, or rounding
   prevents more. Else it failed, or linear iterations cost more than new operators (large->run.slow). Collective on snes
*/
PetscErrorCode SNESLatinLargeNewton_Private(SNES snes, PetscBool *done)
{
  SNES_Latin         *data  = (SNES_Latin *)snes->data;
  LatinLarge         *large = &data->large;
  LatinLargeRun      *run   = &large->run;
  SNESConvergedReason reason;
  KSPConvergedReason  linear;
  const PetscInt      longest = large->frame->original->midpoint ? (PetscInt)large->cost : LATIN_LARGE_LONG;
  PetscInt            steps, stages;
  KSP                 ksp;

  PetscFunctionBegin;
  PetscCall(LatinLargeCreate_Private(snes, &data->newton.snes));
  run->error         = 1.0;
  run->first_step[0] = run->first_step[1] = 1.0;
  run->force                              = PETSC_MAX_REAL;
  run->limit                              = PetscMin(longest, SNESLatinStagesLeft(snes));
  run->most                               = large->frame->original->midpoint || large->frame->original->strain ? run->limit : PetscMin(run->limit, (PetscInt)(LATIN_LARGE_STALE * large->cost));
  run->proofs                             = 0;
  run->changed = run->softer = 0;
  if (large->stateless) PetscCall(LatinLargeCopies_Private(data->latin, snes->vec_sol));
  PetscCall(LatinEstimateFloor_Private(data->latin, &data->estimate));
  PetscCall(LatinLargeTension_Private(snes, &run->tension));
  PetscCall(SNESGetKSP(data->newton.snes, &ksp));
  PetscCall(SNESSolve(data->newton.snes, snes->vec_rhs, snes->vec_sol));
  PetscCall(SNESGetConvergedReason(data->newton.snes, &reason));
  PetscCall(SNESGetIterationNumber(data->newton.snes, &steps));
  PetscCall(SNESGetLinearSolveIterations(data->newton.snes, &stages));
  data->newton.steps += steps;
  data->newton.stages += stages + run->proofs;
  PetscCall(KSPGetConvergedReason(ksp, &linear));
  run->unstable = (PetscBool)(linear == KSP_DIVERGED_INDEFINITE_MAT);
  run->slow     = (PetscBool)(reason == SNES_DIVERGED_MAX_IT || linear == KSP_DIVERGED_ITS);
  if (run->unstable) PetscCall(PetscInfo(snes, "The tangent stiffness is not positive definite\n"));
  PetscCall(PetscInfo(snes, "Newton's method ended with %s after %" PetscInt_FMT " linear iterations\n", SNESConvergedReasons[reason], stages));
  *done = (PetscBool)(reason > 0 || (reason == SNES_DIVERGED_LOCAL_MIN && (!large->frame->original->midpoint || run->force <= large->balance)));
  if (!*done) PetscFunctionReturn(0);
  if (reason < 0) PetscCall(PetscInfo(snes, "The requested error, %g, is below what rounding leaves on this structure, about %g\n", (double)data->target, (double)run->error));
  /* a time step counts as converged at rounding */
  PetscCall(SNESLatinLargeClaim_Private(snes, run->error, reason > 0 || large->frame->original->midpoint ? LATIN_NEXT_CONVERGED : LATIN_NEXT_ROUNDING));
  PetscFunctionReturn(0);
}

/* Returns a linear solver of the tangent stiffness at u, borrowed. Links at kinks of their laws count with their stiffer sides. Collective on snes */
PetscErrorCode SNESLatinLargeTangent_Private(SNES snes, Vec u, KSP *ksp)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->original;
  PetscReal     *slope;
  Mat            A, P;

  PetscFunctionBegin;
  PetscCall(LatinLargeCreate_Private(snes, &data->newton.snes));
  PetscCall(SNESSetUp(data->newton.snes));
  PetscCall(SNESGetJacobian(data->newton.snes, &A, &P, NULL, NULL));
  if (structure->slope) PetscCall(SNESComputeJacobian(data->newton.snes, u, A, P)); /* stiffnesses of the interior-point method */
  else {
    PetscCall(PetscMalloc1(structure->links_local + 1, &slope)); /* not NULL without links either */
    PetscCall(LatinPathSlopes_Private(snes, u, 0.0, PETSC_TRUE, PETSC_TRUE, slope));
    structure->slope = slope;
    PetscCall(SNESComputeJacobian(data->newton.snes, u, A, P));
    structure->slope = NULL;
    PetscCall(PetscFree(slope));
  }
  PetscCall(SNESGetKSP(data->newton.snes, ksp));
  PetscCall(KSPSetOperators(*ksp, A, P));
  data->large.run.limit = LATIN_LARGE_PREDICT;
  PetscFunctionReturn(0);
}
