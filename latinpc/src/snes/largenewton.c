#include "snes/sneslatinimpl.h"

/*
   Newton's method near a solution where links turn far, by conjugate gradients on the exact tangent stiffness, with the
   operators of the iteration as preconditioner. What a step leaves of the forces without balance, in the norm of these operators, says
   how much of the step is left as error: it is linear in the error, as the step is. A field that these operators have as stiff,
   and slack cables leave soft, shows little in this norm: so a step must be small itself, and no cable slack that they have as
   taut. Nor does a soft field show beside stiff ones that other operators have left, which the first step with new ones removes: then only
   the second step counts. Where cables change between taut and
   slack a whole step goes too far, and the energy, which is convex there, is least at a part of it.
*/

#define LATIN_LARGE_STEPS   50   /* most steps */
#define LATIN_LARGE_RTOL    1e-2 /* of a linear solve; less is lost to the next step */
#define LATIN_LARGE_LOOSE   0.05 /* the same where cables change between taut and slack, and a whole step would go too far */
#define LATIN_LARGE_SAFETY  4.0  /* on the error that is left */
#define LATIN_LARGE_PROOF   4.0  /* times the error asked for: a larger step proves nothing. With 1e30 one saddle of nine misses the error, by 2 */
#define LATIN_LARGE_ANEW    0.03 /* of the error asked for: a smaller first step with new operators hides no soft field; with 0.01 nets of inextensible cables take no end */
#define LATIN_LARGE_CLEAR   0.1  /* part of them that a step may leave, in that norm, for its error to count: where cables change it is more */
#define LATIN_LARGE_SHRINK  0.5  /* a step without change of cables leaves less than this part of the error before it, or it meets rounding */
#define LATIN_LARGE_ROUND   10.0 /* times what rounding leaves: steps that do */
#define LATIN_LARGE_NOISE   64.0 /* times eps, of the norm of the tensions, each by the size over its length: rounding of forces */
#define LATIN_LARGE_NONE    1e-9 /* of the size of the structure: displacements that leave no more than that are none */
#define LATIN_LARGE_SLOPE   0.5  /* of the energy at the end of a step, relative to that at its start; 0.1 once it is searched for */
#define LATIN_LARGE_PREDICT 500  /* most iterations of the linear solve that shows how far an increment of the loads moves a structure */
#define LATIN_LARGE_SEARCH  20   /* trial lengths */
#define LATIN_LARGE_INVERSE 3    /* solves that show the mode of a tangent stiffness that is nearly singular */

/* sqrt(r^t K^-1 r) for the residual r, K the operators of the iteration. Collective on newton */
static PetscErrorCode LatinLargeEnergy_Private(SNES newton, LatinLarge *large, Vec r, PetscReal *energy)
{
  KSP         ksp;
  PC          pc;
  PetscScalar product;
  PetscBool   is;

  PetscFunctionBegin;
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPGetOperatorsSet(ksp, &is, NULL));
  if (!is) { /* before the first step */
    Mat A, P;
    Vec u;

    PetscCall(SNESGetSolution(newton, &u));
    PetscCall(SNESGetJacobian(newton, &A, &P, NULL, NULL));
    PetscCall(SNESComputeJacobian(newton, u, A, P));
    PetscCall(KSPSetOperators(ksp, A, P));
  }
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetUp(pc));
  if (!large->forces) PetscCall(VecDuplicate(r, &large->forces));
  PetscCall(PCApply(pc, r, large->forces));
  PetscCall(VecDot(r, large->forces, &product));
  *energy = PetscSqrtReal(PetscAbsReal(PetscRealPart(product)));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLargeConverged_Private(SNES newton, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  SNES        snes   = (SNES)ctx;
  SNES_Latin *data   = (SNES_Latin *)snes->data;
  LatinLarge *large  = &data->large;
  PetscReal   energy = 0.0, step, before;
  PetscBool   whole;
  PetscInt    stages, slack = 0;
  KSP         ksp;
  Vec         r, u;

  PetscFunctionBegin;
  *reason = SNES_CONVERGED_ITERATING;
  if (PetscIsInfOrNanReal(fnorm) || PetscIsInfOrNanReal(snorm)) {
    *reason = SNES_DIVERGED_FUNCTION_NANORINF;
    PetscFunctionReturn(0);
  }
  PetscCall(SNESGetFunction(newton, &r, NULL, NULL));
  PetscCall(LatinLargeEnergy_Private(newton, large, r, &energy));
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(SNESGetSolution(newton, &u));
  PetscCall(LatinFrameSlack_Private(large->frame, u, LATIN_FRAME_TANGENT, &slack));
  if (fnorm <= LATIN_LARGE_NOISE * PETSC_MACHINE_EPSILON * large->tension && xnorm <= LATIN_LARGE_NONE * large->size) { /* what rounding makes of a self-stress without loads */
    large->error = 0.0;
    *reason      = SNES_CONVERGED_FNORM_ABS;
    PetscFunctionReturn(0);
  }
  if (!it && slack) *reason = SNES_DIVERGED_MAX_IT;
  if (it) {
    PetscCall(SNESGetLinearSolveIterations(newton, &stages));
    step         = xnorm > 0.0 ? snorm / xnorm : 0.0;
    before       = it > 1 ? large->error : PETSC_MAX_REAL;
    large->error = large->energy > 0.0 && large->length == 1.0 ? PetscMin(1.0, LATIN_LARGE_SAFETY * energy / large->energy) * step : step;
    PetscCall(PetscInfo(snes, "Newton's method, step %" PetscInt_FMT ": %g, estimated error %g of %g, forces without balance %g of %g\n", it, (double)step, (double)large->error, (double)data->target, (double)fnorm, (double)large->balance));
    whole = (PetscBool)(large->length == 1.0 && energy <= LATIN_LARGE_CLEAR * large->energy); /* a cable that changes leaves more */
    if ((it > 1 || !large->anew || step <= LATIN_LARGE_ANEW * data->target) && whole && large->error <= data->target && step <= LATIN_LARGE_PROOF * data->target && fnorm <= large->balance)
      *reason = slack ? SNES_DIVERGED_MAX_IT : SNES_CONVERGED_SNORM_RELATIVE;
    else if (large->error > LATIN_LARGE_SHRINK * before && step < LATIN_LARGE_ROUND * data->estimate.floor) {
      large->error = PetscMax(step, data->estimate.floor);
      *reason      = large->error <= data->target ? SNES_CONVERGED_SNORM_RELATIVE : SNES_DIVERGED_LOCAL_MIN;
    } else if (it >= LATIN_LARGE_STEPS || stages >= large->most) *reason = SNES_DIVERGED_MAX_IT;
  }
  large->energy = energy;
  PetscCall(KSPSetTolerances(ksp, large->length == 1.0 ? LATIN_LARGE_RTOL : LATIN_LARGE_LOOSE, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(0);
}

/* The whole step, or the part of it at which the energy is least: a zero of its slope, by secants within a bracket. Collective on the SNES */
static PetscErrorCode LatinLargeSearch_Private(SNESLineSearch search, void *ctx)
{
  LatinLarge *large = &((SNES_Latin *)((SNES)ctx)->data)->large;
  PetscReal   low = 0.0, high = 1.0, t = 1.0;
  PetscScalar first, here, slope[2];
  SNES        newton;
  Vec         u, f, step, at;

  PetscFunctionBegin;
  PetscCall(SNESLineSearchGetSNES(search, &newton));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(SNESLineSearchGetVecs(search, &u, &f, &step, &at, NULL));
  PetscCall(VecDot(f, step, &first));
  slope[0] = slope[1] = first;
  for (PetscInt k = 0; k < LATIN_LARGE_SEARCH; k++) {
    PetscCall(VecWAXPY(at, -t, step, u));
    PetscCall(SNESComputeFunction(newton, at, f));
    PetscCall(VecDot(f, step, &here));
    if (PetscRealPart(here * first) >= 0.0 && k == 0) break; /* the energy falls all the way */
    if (PetscAbsScalar(here) <= (k ? 0.1 : LATIN_LARGE_SLOPE) * PetscAbsScalar(first)) break;
    if (PetscRealPart(here * first) > 0.0) {
      low      = t;
      slope[0] = here;
    } else {
      high     = t;
      slope[1] = here;
    }
    t = k % 3 == 2 ? 0.5 * (low + high) : low + PetscRealPart(slope[0] / (slope[0] - slope[1])) * (high - low);
  }
  PetscCall(VecCopy(at, u));
  PetscCall(VecScale(step, t)); /* the norm of the step is that of what was taken */
  large->length = t;
  PetscCall(SNESLineSearchSetLambda(search, t));
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
  SNESLineSearch search;
  const char    *prefix;
  SNES           newton;
  KSP            ksp;
  PC             pc;
  Mat            A;
  PetscBool      is;

  PetscFunctionBegin;
  if (*newnewton) PetscFunctionReturn(0);
  PetscCall(SNESCreate(PetscObjectComm((PetscObject)snes), newnewton));
  newton = *newnewton;
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)newton, (PetscObject)snes, 1));
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(SNESSetOptionsPrefix(newton, prefix));
  PetscCall(SNESAppendOptionsPrefix(newton, "snes_latin_newton_"));
  PetscCall(PetscObjectSetOptions((PetscObject)newton, ((PetscObject)snes)->options));
  PetscCall(SNESSetType(newton, SNESNEWTONLS));
  PetscCall(SNESGetLineSearch(newton, &search));
  PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHSHELL));
  PetscCall(SNESLineSearchShellSetApply(search, LatinLargeSearch_Private, snes));
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(KSPSetType(ksp, structure->midpoint ? KSPGMRES : KSPCG)); /* tangents of a time step are not symmetric */
  if (!structure->midpoint) PetscCall(KSPSetNormType(ksp, KSP_NORM_NATURAL));
  PetscCall(KSPSetTolerances(ksp, LATIN_LARGE_RTOL, PETSC_DEFAULT, PETSC_MAX_REAL, PETSC_DEFAULT));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCLATIN));
  PetscCall(PCLatinShare_Private(pc, data->latin));
  PetscCall(SNESSetFromOptions(newton));
  PetscCall(SNESSetConvergenceTest(newton, LatinLargeConverged_Private, snes, NULL));
  PetscCall(LatinStructureAttachSNES(structure, newton));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  if (!is) PetscFunctionReturn(0);
  PetscCall(LatinTurningMatCreate_Private(structure, &A));
  PetscCall(SNESSetJacobian(newton, A, A, LatinLargeJacobian_Private, structure));
  PetscCall(MatDestroy(&A));
  PetscFunctionReturn(0);
}

/* l2 norm of the tensions at u, each times the size of the structure over its length: coordinates that are rounded turn a link by so much more. Collective on structure */
static PetscErrorCode LatinLargeTension_Private(LatinStructure structure, Vec u, PetscReal size, PetscReal *norm)
{
  const PetscInt dim = structure->dim;
  PetscReal     *tension;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinTurningTensions_Private(structure, NULL, u, tension));
  *norm = 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal square = 0.0;

    for (PetscInt c = 0; c < dim; c++) square += PetscSqr(structure->span[dim * l + c]);
    *norm += PetscSqr(tension[l]) * (1.0 + PetscSqr(size) / square);
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
  PetscReal         left, moved, size, prescribed, tension;
  Vec               r;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(large->frame->dm, &r));
  PetscCall(SNESComputeFunction(snes, snes->vec_sol, r));
  PetscCall(VecNorm(r, NORM_2, &left));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &r));
  PetscCall(VecNorm(snes->vec_sol, NORM_2, &moved));
  PetscCall(LatinStructureSize_Private(large->frame->turns, &size, &prescribed));
  PetscCall(LatinLargeTension_Private(large->frame->turns, snes->vec_sol, size, &tension));
  *rests = (PetscBool)(left <= LATIN_LARGE_NOISE * PETSC_MACHINE_EPSILON * tension && moved <= LATIN_LARGE_NONE * size);
  PetscFunctionReturn(0);
}

/* From the displacements in the solution vector to the solution, whose error is proved: then *done. `most`: linear iterations that it may take. Collective on snes */
PetscErrorCode SNESLatinLargeNewton_Private(SNES snes, PetscInt most, PetscBool *done)
{
  SNES_Latin         *data  = (SNES_Latin *)snes->data;
  LatinLarge         *large = &data->large;
  SNESConvergedReason reason;
  KSPConvergedReason  linear;
  PetscInt            steps, stages;
  PetscReal           prescribed;
  KSP                 ksp;

  PetscFunctionBegin;
  PetscCall(LatinLargeCreate_Private(snes, &data->newton.snes));
  large->error  = 1.0;
  large->most   = most;
  large->length = 0.0;
  PetscCall(LatinEstimateFloor_Private(data->latin, &data->estimate));
  PetscCall(LatinStructureSize_Private(large->frame->turns, &large->size, &prescribed));
  PetscCall(LatinLargeTension_Private(large->frame->turns, snes->vec_sol, large->size, &large->tension));
  PetscCall(SNESGetKSP(data->newton.snes, &ksp));
  PetscCall(KSPSetTolerances(ksp, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, most));
  PetscCall(SNESSolve(data->newton.snes, snes->vec_rhs, snes->vec_sol));
  PetscCall(SNESGetConvergedReason(data->newton.snes, &reason));
  PetscCall(SNESGetIterationNumber(data->newton.snes, &steps));
  PetscCall(SNESGetLinearSolveIterations(data->newton.snes, &stages));
  data->newton.steps += steps;
  data->newton.stages += stages + steps + 1; /* one more for the norm of each residual */
  PetscCall(KSPGetConvergedReason(ksp, &linear));
  large->unstable = (PetscBool)(linear == KSP_DIVERGED_INDEFINITE_MAT);
  large->slow     = (PetscBool)(reason == SNES_DIVERGED_MAX_IT || linear == KSP_DIVERGED_ITS);
  if (large->unstable) PetscCall(PetscInfo(snes, "The tangent stiffness is not positive definite\n"));
  PetscCall(PetscInfo(snes, "Newton's method ended with %s after %" PetscInt_FMT " linear iterations\n", SNESConvergedReasons[reason], stages));
  *done = (PetscBool)(reason > 0 || reason == SNES_DIVERGED_LOCAL_MIN);
  if (!*done) PetscFunctionReturn(0);
  data->estimate.value = large->error;
  data->next           = reason > 0 || large->frame->turns->midpoint ? LATIN_NEXT_CONVERGED : LATIN_NEXT_ROUNDING; /* a time step is one as far as rounding lets it */
  if (reason < 0) PetscCall(PetscInfo(snes, "The error asked for, %g, is below what rounding leaves on this structure, about %g\n", (double)data->target, (double)large->error));
  PetscCall(SNESLatinBalance_Private(snes));
  PetscCall(SNESLatinWatch_Private(snes, data->latin->linear.applications + data->newton.stages));
  if (data->next == LATIN_NEXT_CONTINUE) data->next = LATIN_NEXT_CONVERGED;
  PetscFunctionReturn(0);
}

/* A linear solver of the tangent stiffness at u; borrowed. Collective on snes */
static PetscErrorCode LatinLargeTangent_Private(SNES snes, Vec u, KSP *ksp)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  Mat         A, P;

  PetscFunctionBegin;
  PetscCall(LatinLargeCreate_Private(snes, &data->newton.snes));
  PetscCall(SNESSetUp(data->newton.snes));
  PetscCall(SNESGetJacobian(data->newton.snes, &A, &P, NULL, NULL));
  PetscCall(SNESComputeJacobian(data->newton.snes, u, A, P));
  PetscCall(SNESGetKSP(data->newton.snes, ksp));
  PetscCall(KSPSetOperators(*ksp, A, P));
  PetscCall(KSPSetTolerances(*ksp, LATIN_LARGE_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, LATIN_LARGE_PREDICT));
  PetscFunctionReturn(0);
}

/* How far a load moves the structure, by the tangent stiffness at u: the l2 norm, without bound where that is not positive definite. Collective on snes */
PetscErrorCode SNESLatinLargePredict_Private(SNES snes, Vec u, Vec load, PetscReal *moved)
{
  KSPConvergedReason reason;
  KSP                ksp;
  Vec                step;

  PetscFunctionBegin;
  PetscCall(LatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(VecDuplicate(u, &step));
  PetscCall(KSPSolve(ksp, load, step));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(VecNorm(step, NORM_2, moved));
  PetscCall(VecDestroy(&step));
  if (reason == KSP_DIVERGED_INDEFINITE_MAT || PetscIsInfOrNanReal(*moved)) *moved = PETSC_MAX_REAL;
  PetscFunctionReturn(0);
}

/* The displacements that the tangent stiffness at u resists least, by inverse iteration from `mode`. Collective on snes */
PetscErrorCode SNESLatinLargeMode_Private(SNES snes, Vec u, Vec mode)
{
  KSP ksp;
  Vec before;

  PetscFunctionBegin;
  PetscCall(LatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(VecDuplicate(u, &before));
  for (PetscInt k = 0; k < LATIN_LARGE_INVERSE; k++) {
    PetscCall(VecNormalize(mode, NULL));
    PetscCall(VecCopy(mode, before));
    PetscCall(KSPSolve(ksp, before, mode));
  }
  PetscCall(VecDestroy(&before));
  PetscFunctionReturn(0);
}
