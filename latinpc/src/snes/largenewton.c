#include "snes/sneslatinimpl.h"

/*
   Newton's method where links turn far, by conjugate gradients on the tangent stiffness, with the operators of the iteration as
   preconditioner. Tensions go ahead of the displacements [D. Magisano, L. Leonetti, G. Garcea 2017]: the part of the tangent stiffness that
   is due to them has those of the strains that the last step was to make, and not those of the lengths that it has made, which a bar that turns
   by a few degrees has wrong by more than it bears. So steps are taken whole. At the solution both are the same. A slack cable keeps a stiffness in
   proportion to the step, which a chain that falls until it hangs needs.

   After the iteration strains are unknowns of their own: laws go on as straight lines from the strains that the last step was to make, at first those of
   the last local stage, so that these say which cables are slack, and not the lengths. No cable changes to and fro as it turns, and nets half of whose cables change take a few whole
   steps. Where many have changed since, operators are made anew: each takes a linear iteration at most, and all together longer than a set-up.

   The unbalanced forces after a step, in the norm of the operators, say how much of the step is left as error: they are
   linear in the error, as the step is. A field that these operators have as stiffer than it is shows less in that norm, by the least
   eigenvalue that the linear solve has seen; in time steps, whose tangents are not symmetric, by the least singular value. Cables that change between taut and slack leave more, so that the step must be small itself. Where it
   takes stiffness from links the operators have them as too stiff, and one more is taken: a front of cables that slacken one after the other goes on
   by steps of one length, while each leaves a thousandth of its forces. The error of the tensions is that part of their change, or what they miss of those ahead.
*/

#define LATIN_LARGE_STEPS   50   /* most steps */
#define LATIN_LARGE_LEAST   4    /* iterations of a linear solve near the solution, and one for each link that has changed, or twice the digits: a soft field shows late; a tower claimed a fiftieth of its error, a net in the wind a four-hundredth */
#define LATIN_LARGE_CHANGES 100  /* links that have another stiffness than in the operators, each of which takes an iteration of a linear solve at most */
#define LATIN_LARGE_LONG    20   /* iterations with one set of operators, in time steps as many as a set-up takes: a linear solve that is cut after 5 fails with weak interfaces */
#define LATIN_LARGE_STALE   0.5  /* on a path, iterations after which new operators are made, relative to a set-up: with 0.25 half of the iterations and twice the set-ups, in the same time */
#define LATIN_LARGE_RTOL    1e-2 /* of a linear solve; less is lost to the next step */
#define LATIN_LARGE_FINER   0.1  /* times that along a path, far from the solution: next to a limit point soft displacements are lost else */
#define LATIN_LARGE_STEP    2.0  /* a step so much larger than the displacements after it leads astray; with 1 a bridge takes twice the set-ups, without limit a truss snaps through */
#define LATIN_LARGE_PROOF   4.0  /* times the error asked for: a larger step is not worth a linear stage that shows what it leaves */
#define LATIN_LARGE_SHRINK  0.5  /* a step leaves less than this part of the error before it, or it meets rounding */
#define LATIN_LARGE_ROUND   10.0 /* times what rounding leaves: steps that do */
#define LATIN_LARGE_NOISE   64.0 /* times eps, of the norm of the tensions, each by the size over its length: rounding of forces */
#define LATIN_LARGE_PREDICT 500  /* most iterations of the linear solve that shows how far an increment of the loads moves a structure */
#define LATIN_LARGE_FIRM    10.0 /* times LATIN_MECHANISM, of the largest stiffness: a stiffness that is less is what rounding makes of none */

/* The norm of the residual r that the linear solver has: by default sqrt(r^t K^-1 r) with K the operators of the iteration. Collective on newton */
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
  large->proofs++;
  PetscFunctionReturn(0);
}

/* A linear solve ends at its tolerance, or when it has taken so many iterations */
static PetscErrorCode LatinLargeLinear_Private(KSP ksp, PetscInt it, PetscReal rnorm, KSPConvergedReason *reason, void *ctx)
{
  LatinLarge     *large = (LatinLarge *)ctx;
  const PetscBool near  = (PetscBool)(large->frame->turns->hold <= LATIN_LARGE_HOLD * large->near);
  PetscReal       rtol, part = near || large->frame->turns->midpoint ? 1.0 : LATIN_LARGE_FINER;

  PetscFunctionBegin;
  *reason = KSP_CONVERGED_ITERATING;
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  if (near && it < LATIN_LARGE_LEAST + large->changed) part = rtol;
  if (!it) large->first = rnorm;
  if (PetscIsInfOrNanReal(rnorm)) *reason = KSP_DIVERGED_NANORINF;
  else if (rnorm <= part * rtol * large->first) *reason = KSP_CONVERGED_RTOL;
  else if (it >= large->limit) *reason = KSP_DIVERGED_ITS;
  PetscFunctionReturn(0);
}

/* Root mean square differences of tensions a - b relative to those of b, none where without loads b are what rounding of the lengths makes. Collective on large->frame */
static PetscErrorCode LatinLargeDifference_Private(const LatinLarge *large, const PetscReal a[], const PetscReal b[], PetscReal *difference)
{
  const LatinStructure structure = large->frame->turns;
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

/* What a step to u, where r is left, leaves as error of displacements and of tensions, relative. Collective on newton */
static PetscErrorCode LatinLargeError_Private(SNES newton, LatinLarge *large, PetscReal step, Vec u, Vec r, PetscReal *error, PetscReal *tensions)
{
  const LatinStructure structure = large->frame->turns;
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
  part   = left < large->first ? LATIN_LARGE_SAFETY * left / (large->first - left) : PETSC_MAX_REAL; /* steps that leave so much of the error, added up */
  *error = part * step;
  if (type == KSP_NORM_PRECONDITIONED && moved > 0.0) *error = PetscMax(*error, LATIN_LARGE_SAFETY * left / moved); /* of displacements: soft nodes, as those without mass, may hide in that part what others miss */
  *error    = PetscMin(1.0, *error);
  *tensions = 0.0;
  if (!large->ahead) PetscFunctionReturn(0);
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinTurningTensions_Private(structure, NULL, u, tension));
  PetscCall(LatinLargeDifference_Private(large, large->ahead, tension, tensions));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  *tensions = PetscMin(1.0, PetscMax(*tensions, part * large->stretch));
  PetscFunctionReturn(0);
}

/* The unbalanced forces of the laws themselves at u, and their norm. Collective on newton */
static PetscErrorCode LatinLargeUnbalance_Private(SNES newton, LatinLarge *large, Vec u, Vec r, PetscReal *norm)
{
  const LatinStructure   structure = large->frame->turns;
  const PetscReal *const strain    = structure->strain;

  PetscFunctionBegin;
  structure->strain = NULL;
  PetscCall(SNESComputeFunction(newton, u, r));
  structure->strain = strain;
  PetscCall(VecNorm(r, NORM_2, norm));
  PetscFunctionReturn(0);
}

/* After a step, of a part of the displacements: does it end the method? Collective on newton */
static PetscErrorCode LatinLargeStep_Private(SNES newton, SNES snes, PetscInt it, PetscReal step, SNESConvergedReason *reason)
{
  SNES_Latin        *data   = (SNES_Latin *)snes->data;
  LatinLarge        *large  = &data->large;
  const PetscReal    before = it > 1 ? large->error : PETSC_MAX_REAL;
  PetscReal          tensions, fnorm;
  PetscBool          small = (PetscBool)(step <= LATIN_LARGE_PROOF * data->target), far;
  KSPConvergedReason linear;
  PetscInt           stages, last;
  KSP                ksp;
  Vec                r, u;

  PetscFunctionBegin;
  PetscCall(SNESGetSolution(newton, &u));
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(LatinLargeUnbalance_Private(newton, large, u, r, &fnorm));
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPGetConvergedReason(ksp, &linear));
  PetscCall(SNESGetLinearSolveIterations(newton, &stages));
  PetscCall(KSPGetIterationNumber(ksp, &last));
  large->force = fnorm;
  large->error = tensions = step;
  if (it == 1) {
    large->first_step[0] = linear > 0 ? step : 1.0;
    large->first_step[1] = large->stretch;
  }
  if (small && (linear > 0 || linear == KSP_DIVERGED_ITS)) PetscCall(LatinLargeError_Private(newton, large, step, u, r, &large->error, &tensions)); /* else PETSc has no singular values of the last iteration */
  else if (small) large->error = tensions = 1.0;
  PetscCall(LatinEquilibriumFar_Private(large->frame->turns, u, &far));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscCall(PetscInfo(snes, "Newton's method, step %" PetscInt_FMT ": %g, estimated error %g of %g, of tensions %g, unbalanced forces %g of %g\n", it, (double)step, (double)large->error, (double)data->target, (double)tensions, (double)fnorm,
                      (double)large->balance));
  if (large->frame->turns->strain) PetscCall(LatinFrameChanged_Private(large->frame, large->frame->turns->strain, &large->changed));
  data->estimate.tensions   = large->ahead ? tensions : -1.0;
  large->frame->turns->hold = (large->frame->turns->strain ? LATIN_LARGE_HELD : LATIN_LARGE_HOLD) * PetscMin(1.0, step);
  if (linear == KSP_DIVERGED_INDEFINITE_MAT) *reason = SNES_DIVERGED_LINEAR_SOLVE;
  else if (it > 1 && large->ahead && step > LATIN_LARGE_STEP && fnorm > large->balance) *reason = SNES_DIVERGED_DTOL; /* it wanders */
  else if (linear > 0 && small && !large->softer && large->error <= data->target && tensions <= SNESLatinTensionTarget(data) && fnorm <= large->balance) *reason = SNES_CONVERGED_SNORM_RELATIVE;
  else if (far && fnorm > large->balance && step < LATIN_LARGE_ROUND * data->estimate.floor) *reason = SNES_DIVERGED_DTOL; /* displacements that leap away hide any step */
  else if (large->error > LATIN_LARGE_SHRINK * before && step < LATIN_LARGE_ROUND * data->estimate.floor) {
    large->error = PetscMax(step, data->estimate.floor);
    *reason      = large->error <= data->target && fnorm <= large->balance ? SNES_CONVERGED_SNORM_RELATIVE : SNES_DIVERGED_LOCAL_MIN;
  } else if (it >= LATIN_LARGE_STEPS || stages >= large->most || (large->iterated && stages + last > large->most)) *reason = SNES_DIVERGED_MAX_IT; /* another solve as long as the last one would be cut short */
  else if (large->frame->turns->strain && large->changed > LATIN_LARGE_CHANGES) *reason = SNES_DIVERGED_MAX_IT;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLargeConverged_Private(SNES newton, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  LatinLarge    *large = &((SNES_Latin *)((SNES)ctx)->data)->large;
  SNESLineSearch search;
  PetscReal      part;

  PetscFunctionBegin;
  *reason = SNES_CONVERGED_ITERATING;
  PetscCall(SNESGetLineSearch(newton, &search));
  PetscCall(SNESLineSearchGetLambda(search, &part));
  if (!it) PetscCall(VecNorm(newton->vec_sol, NORM_2, &xnorm)); /* which PETSc does not say before the first step */
  if (PetscIsInfOrNanReal(fnorm) || PetscIsInfOrNanReal(snorm)) *reason = SNES_DIVERGED_FUNCTION_NANORINF;
  else if (fnorm <= LATIN_LARGE_NOISE * PETSC_MACHINE_EPSILON * large->tension && xnorm <= LATIN_LARGE_NONE * large->size) { /* what rounding makes of a self-stress without loads */ large->error = 0.0;
    *reason                                                                                                                                                                                        = SNES_CONVERGED_FNORM_ABS;
  } else if (it) PetscCall(LatinLargeStep_Private(newton, (SNES)ctx, it, xnorm > 0.0 ? snorm / (part * xnorm) : 0.0, reason)); /* the whole step: parts of it are small also where none leads on */
  PetscFunctionReturn(0);
}

/* The tensions ahead: at u, and the change that the step, which is to be subtracted, makes; and how many links it takes stiffness from. Collective on large->frame */
static PetscErrorCode LatinLargeAhead_Private(LatinLarge *large, Vec u, Vec step)
{
  const LatinStructure structure = large->frame->turns;
  PetscReal           *tension, *strain = large->ahead + structure->links_local;

  PetscFunctionBegin;
  if (!large->ahead) PetscFunctionReturn(0);
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  for (PetscInt l = 0; l < structure->links_local; l++) tension[l] = LatinStructureTangent(structure, l, strain[l]);
  PetscCall(LatinTurningAhead_Private(structure, u, NULL, step, -1.0, large->ahead, strain));
  large->softer = 0;
  for (PetscInt l = 0; l < structure->links_local; l++) large->softer += tension[l] > LatinStructureTangent(structure, l, strain[l]) ? 1 : 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &large->softer, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinTurningTensions_Private(structure, NULL, u, tension));
  PetscCall(LatinLargeDifference_Private(large, tension, large->ahead, &large->stretch));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscFunctionReturn(0);
}

/* The whole step, where tensions go ahead of the displacements. Collective on the SNES */
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

/* The inner SNES, prefix -snes_latin_newton_. Collective on snes */
static PetscErrorCode LatinLargeCreate_Private(SNES snes, SNES *newnewton)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->turns;
  SNES           newton;
  KSP            ksp;
  PC             pc;
  Mat            A;
  PetscBool      is;

  PetscFunctionBegin;
  if (*newnewton) PetscFunctionReturn(0);
  PetscCall(SNESLatinInner_Private(snes, LatinLargeWhole_Private, snes, structure->midpoint ? KSPGMRES : KSPCG, &newton)); /* tangents of a time step are not symmetric */
  PetscCall(SNESSetMaxLinearSolveFailures(newton, PETSC_MAX_INT));                                                         /* a step that is cut short counts */
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

/* l2 norm of what rounding of coordinates multiplies: the tensions at u, each times the size of the structure over its length, for it turns the link, unless that keeps its direction; without loads also the stiffnesses times that size, for it changes lengths. Collective on snes */
static PetscErrorCode LatinLargeTension_Private(SNES snes, PetscReal *norm)
{
  const LatinLarge    *large     = &((SNES_Latin *)snes->data)->large;
  const LatinStructure structure = large->frame->turns;
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

/* Does the solution vector, of displacements that are none, leave only what rounding makes of a self-stress? A form that is found is such a state. Collective on snes */
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

/* The displacements in the solution vector are the solution, of this error. Collective on snes */
PetscErrorCode SNESLatinLargeClaim_Private(SNES snes, PetscReal error, LatinNext next)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  data->large.frame->turns->strain = NULL; /* the laws themselves again */
  data->estimate.value             = error;
  data->next                       = next;
  PetscCall(SNESLatinBalance_Private(snes));
  PetscCall(SNESLatinWatch_Private(snes, data->latin->linear.applications + data->newton.stages));
  if (data->next == LATIN_NEXT_CONTINUE) data->next = LATIN_NEXT_CONVERGED;
  PetscFunctionReturn(0);
}

/* The displacements u of all copies, which operators made anew do not have. Collective on latin */
static PetscErrorCode LatinLargeCopies_Private(Latin latin, Vec u)
{
  const LatinSubdomains *sub = &latin->sub;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++)
    if (sub->fixed[i]) latin->linear.U[i] = sub->prescribed[i];
  PetscCall(LatinDistribute_Private(sub, u, latin->linear.U));
  PetscFunctionReturn(0);
}

/* From the displacements in the solution vector to the solution, whose error is proved, unless linear iterations take longer than new operators are worth: then *done. Collective on snes */
PetscErrorCode SNESLatinLargeNewton_Private(SNES snes, PetscBool *done)
{
  SNES_Latin         *data  = (SNES_Latin *)snes->data;
  LatinLarge         *large = &data->large;
  SNESConvergedReason reason;
  KSPConvergedReason  linear;
  const PetscInt      longest = large->frame->turns->midpoint ? (PetscInt)large->cost : LATIN_LARGE_LONG;
  PetscInt            steps, stages;
  KSP                 ksp;

  PetscFunctionBegin;
  PetscCall(LatinLargeCreate_Private(snes, &data->newton.snes));
  large->error         = 1.0;
  large->first_step[0] = large->first_step[1] = 1.0;
  large->force                                = PETSC_MAX_REAL;
  large->limit                                = PetscMin(longest, SNESLatinStagesLeft(snes));
  large->most                                 = large->frame->turns->midpoint || large->frame->turns->strain ? large->limit : PetscMin(large->limit, (PetscInt)(LATIN_LARGE_STALE * large->cost));
  large->proofs                               = 0;
  large->changed = large->softer = 0;
  if (large->stateless) PetscCall(LatinLargeCopies_Private(data->latin, snes->vec_sol));
  PetscCall(LatinEstimateFloor_Private(data->latin, &data->estimate));
  PetscCall(LatinLargeTension_Private(snes, &large->tension));
  PetscCall(SNESGetKSP(data->newton.snes, &ksp));
  PetscCall(SNESSolve(data->newton.snes, snes->vec_rhs, snes->vec_sol));
  PetscCall(SNESGetConvergedReason(data->newton.snes, &reason));
  PetscCall(SNESGetIterationNumber(data->newton.snes, &steps));
  PetscCall(SNESGetLinearSolveIterations(data->newton.snes, &stages));
  data->newton.steps += steps;
  data->newton.stages += stages + large->proofs;
  PetscCall(KSPGetConvergedReason(ksp, &linear));
  large->unstable = (PetscBool)(linear == KSP_DIVERGED_INDEFINITE_MAT);
  large->slow     = (PetscBool)(reason == SNES_DIVERGED_MAX_IT || linear == KSP_DIVERGED_ITS);
  if (large->unstable) PetscCall(PetscInfo(snes, "The tangent stiffness is not positive definite\n"));
  PetscCall(PetscInfo(snes, "Newton's method ended with %s after %" PetscInt_FMT " linear iterations\n", SNESConvergedReasons[reason], stages));
  *done = (PetscBool)(reason > 0 || (reason == SNES_DIVERGED_LOCAL_MIN && (!large->frame->turns->midpoint || large->force <= large->balance)));
  if (!*done) PetscFunctionReturn(0);
  if (reason < 0) PetscCall(PetscInfo(snes, "The requested error, %g, is below what rounding leaves on this structure, about %g\n", (double)data->target, (double)large->error));
  PetscCall(SNESLatinLargeClaim_Private(snes, large->error, reason > 0 || large->frame->turns->midpoint ? LATIN_NEXT_CONVERGED : LATIN_NEXT_ROUNDING)); /* a time step is one as far as rounding lets it */
  PetscFunctionReturn(0);
}

/* A linear solver of the tangent stiffness at u; borrowed. Collective on snes */
PetscErrorCode SNESLatinLargeTangent_Private(SNES snes, Vec u, KSP *ksp)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->turns;
  PetscReal     *slope;
  Mat            A, P;

  PetscFunctionBegin;
  PetscCall(LatinLargeCreate_Private(snes, &data->newton.snes));
  PetscCall(SNESSetUp(data->newton.snes));
  PetscCall(SNESGetJacobian(data->newton.snes, &A, &P, NULL, NULL));
  if (structure->slope) PetscCall(SNESComputeJacobian(data->newton.snes, u, A, P)); /* of the interior-point method */
  else {
    PetscCall(PetscMalloc1(structure->links_local + 1, &slope)); /* never NULL */
    PetscCall(LatinPathSlopes_Private(snes, u, PETSC_TRUE, slope));
    structure->slope = slope;
    PetscCall(SNESComputeJacobian(data->newton.snes, u, A, P));
    structure->slope = NULL;
    PetscCall(PetscFree(slope));
  }
  PetscCall(SNESGetKSP(data->newton.snes, ksp));
  PetscCall(KSPSetOperators(*ksp, A, P));
  data->large.limit = LATIN_LARGE_PREDICT;
  PetscFunctionReturn(0);
}

/* The displacements `step` by a load, by the tangent stiffness at u, and their l2 norm: without bound where that is not positive definite, as of a mechanism. Collective on snes */
PetscErrorCode SNESLatinLargePredict_Private(SNES snes, Vec u, Vec load, Vec step, PetscReal *moved)
{
  KSPConvergedReason reason;
  PetscReal          rtol, force, least, most;
  KSP                ksp;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  PetscCall(KSPSetTolerances(ksp, rtol * rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT)); /* each node's, a soft one's as well */
  PetscCall(KSPSolve(ksp, load, step));
  PetscCall(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(VecNorm(step, NORM_2, moved));
  PetscCall(VecNorm(load, NORM_2, &force));
  PetscCall(LatinStructureStiffnessRange_Private(((SNES_Latin *)snes->data)->large.frame->turns, &least, &most));
  if ((reason < 0 && reason != KSP_DIVERGED_ITS) || PetscIsInfOrNanReal(*moved) || LATIN_LARGE_FIRM * LATIN_MECHANISM * most * *moved > force) *moved = PETSC_MAX_REAL;
  PetscFunctionReturn(0);
}

/* The l2 norm of the step that Newton's method would take from `ahead` with the tangent stiffness at u, the last equilibrium on a path. Overwrites ahead. Collective on snes */
PetscErrorCode SNESLatinLargeCorrect_Private(SNES snes, Vec u, Vec ahead, PetscReal *norm)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  const PetscReal   part  = large->supports.part;
  Vec               r;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(SNESComputeFunction(snes, ahead, r));
  PetscCall(SNESLatinSupportsAt_Private(snes, large->reached));
  PetscCall(SNESLatinLargePredict_Private(snes, u, r, ahead, norm));
  PetscCall(SNESLatinSupportsAt_Private(snes, part));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscFunctionReturn(0);
}
