#include "snes/sneslatinimpl.h"

/*
   Newton's method after the iteration of SNES latin. Linear solves: conjugate gradients with PC latin on the tangent stiffness.

   Finish: proves an error, or continues if rounding ends the iteration too early. The active set (the taut links) is nearly that
   of the solution, and for a fixed active set a Newton step is exact: its length is the error before the step, and the relative
   residual of the linear solve times that is the error after it. The preconditioner reuses the operators of SNES latin, with all
   links taut. These overestimate the stiffness of soft modes of the taut links, next to collapse for example. So a small
   structure has a preconditioner of the tangent stiffness here as well: it takes milliseconds.

   Stall: a linear stage treats every link as a spring of its ascent direction l = k. If a slack link is much stiffer than the
   structure around it, or if only soft slack links hold the structure, displacements hardly move from one stage to the next:
   the number of stages is about the ratio of the stiffnesses. Here the preconditioner is built from the tangent stiffness, which
   excludes slack links, and is rebuilt when the active set has changed.

   The energy is convex, so that a line search makes the method converge from any start. Linear solves are inexact: they stop at
   the requested error; while the active set changes, at two digits at most (-ksp_rtol of the inner KSP).
*/

#define LATIN_NEWTON_STAGES      300                          /* most linear stages predicted: with more, the iteration stalls */
#define LATIN_NEWTON_WINDOW      20                           /* linear stages over which the contraction rate is measured */
#define LATIN_NEWTON_CONTRAST    1e6                          /* ratio of stiffnesses beyond which a small change of the displacements proves no convergence */
#define LATIN_NEWTON_RTOL        1e-2                         /* rtol of a linear solve while the active set changes */
#define LATIN_NEWTON_PROOF       0.5                          /* relative residual of a linear solve below which its iterate measures the error */
#define LATIN_NEWTON_FLOOR       LatinByPrecision(1e-8, 1e-5) /* tangent stiffness of a slack link, relative to the least stiffness: avoids a singular tangent stiffness */
#define LATIN_NEWTON_LINEAR      500                          /* most iterations of a linear solve; with a quarter two cases of the catalogue are refused */
#define LATIN_NEWTON_STEPS       200                          /* most steps; with half as many a case of the catalogue is refused */
#define LATIN_NEWTON_FULL        12                           /* full steps before the line search: if they converge, they do so soon */
#define LATIN_NEWTON_SLOW        4                            /* first step after which other methods follow if it changes more than half as many links as the one before; not in time steps without rigid links, where full steps are faster */
#define LATIN_NEWTON_GAIN        0.5                          /* with a fixed active set, a step that reduces the error by less than this shows rounding */
#define LATIN_NEWTON_SAFETY_MOST 1e8                          /* largest safety factor on the relative residual of a linear solve */
#define LATIN_NEWTON_OWN         3000                         /* most unknowns for which it finishes with a preconditioner of the tangent stiffness: without, six in 3,000 structures next to collapse were wrong, and one in 3,000 with rigid links */
#define LATIN_NEWTON_GRAINS      40000                        /* most links of grains with friction for which the interior-point method follows: with more it seldom ends, and 200 of its steps take as long as the iteration */

/* Resets the counters before the first linear stage of a solve, and decides when Newton's method may be used. Collective on structure */
PetscErrorCode LatinNewtonStart_Private(LatinNewton *newton, LatinStructure structure)
{
  PetscReal least, most;
  PetscInt  links = 0;
  PetscBool own   = PETSC_FALSE;

  PetscFunctionBegin;
  newton->iterations = newton->steps = newton->stages = 0;
  newton->last                                        = PETSC_MAX_INT;
  PetscCall(PetscMemzero(&newton->found, sizeof(newton->found)));
  for (PetscInt i = 0; i < 3; i++) newton->least[i] = PETSC_MAX_REAL;
  PetscCall(LatinStructureStiffnessRange_Private(structure, &least, &most));
  if (structure->rubs && !(most > 0.0)) links = structure->links_global;
  newton->stall             = (PetscBool)(newton->type != LATIN_NEWTON_NEVER && links <= LATIN_NEWTON_GRAINS);
  newton->grains            = (PetscBool)(structure->rubs && !(most > 0.0));
  newton->collapse_searched = PETSC_FALSE;
  newton->own_laws          = (PetscBool)(structure->own_laws && !structure->ground && !structure->rubs);
  PetscCall(LatinNewtonOwn_Private(structure, &own));
  newton->finish   = (PetscBool)(newton->stall && (structure->rigid_law < 0 || (own && !structure->rubs)));
  newton->most     = LATIN_NEWTON_STAGES;
  newton->contrast = (PetscBool)(most > LATIN_NEWTON_CONTRAST * least && !structure->rubs); /* with friction Newton's method may fail although there is an equilibrium */
  PetscFunctionReturn(0);
}

/*
   Does the iteration stall? It does if the contraction rate of the last two windows predicts more than newton->most linear stages.
   Call once a stage with the measure of the stop and its target.
*/
PetscBool LatinNewtonStalled(LatinNewton *newton, PetscReal measure, PetscReal target)
{
  const PetscReal before = newton->least[2];
  PetscReal       now;

  newton->least[0] = PetscMin(newton->least[0], measure);
  if (++newton->iterations % LATIN_NEWTON_WINDOW) return PETSC_FALSE;
  now              = PetscMin(newton->least[0], newton->least[1]);
  newton->least[2] = newton->least[1];
  newton->least[1] = newton->least[0];
  newton->least[0] = PETSC_MAX_REAL;
  if (!(before < PETSC_MAX_REAL) || !(target > 0.0)) return PETSC_FALSE;
  return (PetscBool)(2 * LATIN_NEWTON_WINDOW * PetscLogReal(now / target) > newton->most * PetscLogReal(before / now));
}

/*
   Convergence test of the linear solves: inexact Newton. Stops at the rtol, or with operators of the iteration once the error left in the step is below
   the target and the residual below newton->balance. That error is estimated from the relative residual: with PC latin the natural
   norm of CG is about the energy norm. The residual is tested here because another Newton step would build its Krylov space anew.
*/
static PetscErrorCode LatinNewtonLinear_Private(KSP ksp, PetscInt it, PetscReal rnorm, KSPConvergedReason *reason, void *ctx)
{
  LatinNewton *newton = (LatinNewton *)ctx;
  PetscReal    rtol, size;
  Vec          step, r;

  PetscFunctionBegin;
  *reason = KSP_CONVERGED_ITERATING;
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  if (!it) newton->first = rnorm;
  newton->left = newton->first > 0.0 ? rnorm / newton->first : 0.0;
  if (PetscIsInfOrNanReal(rnorm)) *reason = KSP_DIVERGED_NANORINF;
  else if (newton->left <= rtol) *reason = KSP_CONVERGED_RTOL;
  else if (it >= newton->stages_left) *reason = KSP_DIVERGED_ITS;
  if (*reason || newton->tangent || newton->left > LATIN_NEWTON_PROOF) PetscFunctionReturn(0);
  PetscCall(KSPBuildSolution(ksp, NULL, &step));
  PetscCall(VecNorm(step, NORM_2, &size));
  if (newton->safety * newton->left * PetscMax(size, newton->known * newton->size) > newton->target * newton->size) PetscFunctionReturn(0);
  PetscCall(KSPBuildResidual(ksp, NULL, NULL, &r));
  PetscCall(VecNorm(r, NORM_2, &size));
  PetscCall(VecDestroy(&r));
  if (size <= newton->balance) *reason = KSP_CONVERGED_RTOL;
  PetscFunctionReturn(0);
}

/* If u is larger than the structure, that is nearly a mechanism, and a small unbalance proves nothing: *claims becomes false. Collective on newton->structure */
static PetscErrorCode LatinNewtonNear_Private(LatinNewton *newton, Vec u, PetscReal fnorm, PetscBool *claims)
{
  PetscBool far;

  PetscFunctionBegin;
  if (!newton->proves || fnorm <= LATIN_NEWTON_FAR * newton->drive) PetscFunctionReturn(0);
  PetscCall(LatinEquilibriumFar_Private(newton->structure, u, &far));
  if (far) *claims = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Does the unbalance at u contradict convergence? The unbalance may be rounding alone. Collective on snes */
static PetscErrorCode LatinNewtonCheck_Private(SNES snes, LatinNewton *newton, Vec u, PetscReal fnorm, PetscBool *claims, LatinEquilibrium *found)
{
  Vec r, more;

  PetscFunctionBegin;
  PetscCall(SNESGetFunction(snes, &r, NULL, NULL));
  PetscCall(SNESGetRhs(snes, &more));
  PetscCall(LatinEquilibriumCheck_Private(newton->latin, u, r, more, newton->target, newton->energy, PETSC_FALSE, found));
  PetscCall(LatinNewtonNear_Private(newton, u, fnorm, claims));
  PetscFunctionReturn(0);
}

/* Does a correction, by one more linear stage, contradict convergence? Then its ratio to the target raises newton->safety, which tightens the linear solves. Collective on snes */
static PetscErrorCode LatinNewtonCorrect_Private(SNES snes, LatinNewton *newton, Vec u, PetscBool *claims)
{
  PetscReal error, times;
  Vec       r;

  PetscFunctionBegin;
  PetscCall(SNESGetFunction(snes, &r, NULL, NULL));
  PetscCall(LatinNewtonCorrection_Private(newton, u, r, &error, &newton->tensions));
  newton->error = PetscMax(newton->error, error);
  times         = PetscMax(error / newton->target, newton->tensions / newton->tension_target);
  if (times <= 1.0) PetscFunctionReturn(0);
  *claims        = PETSC_FALSE;
  newton->safety = PetscMin(PetscMax(times, 2.0) * newton->safety, LATIN_NEWTON_SAFETY_MOST);
  PetscFunctionReturn(0);
}

/* Verifies by the unbalance and by a correction that u has converged (*claims), or as far as rounding allows (*rounding). doubtful: only an unbalance that is all rounding proves it. Collective on snes */
static PetscErrorCode LatinNewtonProve_Private(SNES snes, LatinNewton *newton, Vec u, PetscReal fnorm, PetscBool doubtful, PetscBool *rounding, PetscBool *claims)
{
  LatinEquilibrium found;

  PetscFunctionBegin;
  PetscCall(LatinNewtonCheck_Private(snes, newton, u, fnorm, claims, &found));
  if (newton->tangent) {
    *rounding = (PetscBool)((*rounding || (*claims && newton->error <= LATIN_NEWTON_REST && found.error <= newton->target)) && found.balanced);
    *claims   = (PetscBool)(*claims && PetscMax(found.error, found.forces) <= newton->target && (!doubtful || found.balanced)); /* a node with a small load may hang on slack links alone: not converged */
  }
  newton->tensions = found.forces;
  if (*claims && newton->proves && !found.balanced) PetscCall(LatinNewtonCorrect_Private(snes, newton, u, claims));
  PetscFunctionReturn(0);
}

/*
   Are there statically admissible tensions, inside the friction cones? If *held, `bears` returns them, for all links. The problem
   of the cones has its own operators; its steps and linear stages count as Newton's. Collective on latin
*/
PetscErrorCode LatinNewtonCones_Private(Latin latin, LatinNewton *newton, Vec more, PetscReal bears[], PetscBool *held)
{
  LatinEquilibrium *found = &newton->found;
  PetscInt          steps, stages;
  LatinStructure    cones;
  KSP               ksp;
  PC                pc;
  Mat               A;

  PetscFunctionBegin;
  *held = PETSC_FALSE;
  PetscCall(LatinConesCreate_Private(latin->sub.structure, &cones));
  PetscCall(LatinEquilibriumPatches_Private(cones, more, found));
  if (found->verdict != LATIN_UNBOUNDED) {
    PetscCall(KSPCreate(PetscObjectComm((PetscObject)cones), &ksp));
    PetscCall(KSPSetType(ksp, KSPCG));
    PetscCall(KSPSetNormType(ksp, KSP_NORM_NATURAL));
    PetscCall(KSPSetTolerances(ksp, LATIN_NEWTON_TIGHT, PETSC_DEFAULT, PETSC_MAX_REAL, LATIN_NEWTON_LINEAR));
    PetscCall(KSPGetPC(ksp, &pc));
    PetscCall(PCSetType(pc, PCLATIN));
    PetscCall(PCLatinFollow_Private(pc, latin));
    PetscCall(LatinStructureAttachPC(cones, pc));
    PetscCall(PCLatinCorrected_Private(pc, PETSC_TRUE));
    PetscCall(LatinTangentCreate_Private(cones, &A));
    PetscCall(LatinEquilibriumCollapse_Private(cones, ksp, A, more, newton->limit - newton->stages, bears, &steps, &stages, held, found));
    newton->steps += steps;
    newton->stages += stages;
    if (*held) LatinConesTensions(cones, bears);
    PetscCall(MatDestroy(&A));
    PetscCall(KSPDestroy(&ksp));
  }
  PetscCall(LatinStructureDestroy(&cones));
  PetscFunctionReturn(0);
}

/*
   Searches for a collapse: no equilibrium. Once a solve, if Newton's method converges slowly and has linear stages left; counts as its
   steps. Needs PC latin: the operators have no entries for other preconditioners. Collective on newton->snes
*/
static PetscErrorCode LatinNewtonCollapse_Private(LatinNewton *newton, Vec more)
{
  PetscInt  steps, stages;
  PetscBool latin, held;
  KSP       ksp;
  PC        pc;
  Mat       A;

  PetscFunctionBegin;
  PetscCall(SNESGetKSP(newton->snes, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &latin));
  if (newton->collapse_searched || !newton->tangent || !latin || newton->stages_left <= 0) PetscFunctionReturn(0);
  newton->collapse_searched = PETSC_TRUE;
  PetscCall(LatinEquilibriumPatches_Private(newton->structure, more, &newton->found));
  if (newton->found.verdict == LATIN_UNBOUNDED) PetscFunctionReturn(0);
  PetscCall(KSPSetTolerances(ksp, LATIN_NEWTON_TIGHT, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(SNESGetJacobian(newton->snes, &A, NULL, NULL, NULL));
  PetscCall(LatinEquilibriumCollapse_Private(newton->structure, ksp, A, more, newton->stages_left, NULL, &steps, &stages, &held, &newton->found));
  newton->held = (PetscBool)((held || newton->structure->ground) && !newton->structure->own_laws); /* masses bear any loads */
  newton->steps += steps;
  newton->stages += stages;
  newton->changes = 1; /* rebuild the tangent stiffness, which this has overwritten */
  PetscFunctionReturn(0);
}

/* Length of the last step, relative to u after it, in the l2 and energy norms. Collective on snes */
static PetscErrorCode LatinNewtonStep_Private(SNES snes, LatinNewton *newton, Vec u, PetscReal *l2, PetscReal *energy)
{
  Vec step, before;

  PetscFunctionBegin;
  PetscCall(SNESGetSolutionUpdate(snes, &step));
  PetscCall(DMGetGlobalVector(newton->structure->dm, &before));
  PetscCall(VecWAXPY(before, 1.0, step, u));
  PetscCall(LatinStructureComputeErrors(newton->structure, before, u, l2, energy));
  PetscCall(DMRestoreGlobalVector(newton->structure->dm, &before));
  PetscFunctionReturn(0);
}

/* Convergence test. The error after a step is its length times the relative residual of the linear solve if the active set is unchanged, else its length */
static PetscErrorCode LatinNewtonConverged_Private(SNES snes, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  LatinNewton   *newton = (LatinNewton *)ctx;
  PetscReal      before = newton->error, lambda = 1.0, energy;
  PetscInt       changes, most, stages;
  PetscBool      rounding, claims, rests, slow, unexplained = PETSC_FALSE; /* the residual along the step is still larger than the linear solve explains */
  PetscBool      confirmed = PETSC_TRUE;                                   /* two small steps in a row, if forces of stiff links hide those of soft ones */
  Vec            u;
  KSP            ksp;
  Mat            P;
  SNESLineSearch search;

  PetscFunctionBegin;
  *reason = PetscIsInfOrNanReal(fnorm) || PetscIsInfOrNanReal(snorm) ? SNES_DIVERGED_FUNCTION_NANORINF : SNES_CONVERGED_ITERATING;
  if (*reason) PetscFunctionReturn(0);
  PetscCall(SNESGetKSP(snes, &ksp));
  PetscCall(SNESGetSolution(snes, &u));
  PetscCall(SNESGetTolerances(snes, NULL, NULL, NULL, &most, NULL));
  PetscCall(SNESGetLinearSolveIterations(snes, &stages));
  newton->stages_left = newton->limit - newton->stages - stages;
  if (!it) {
    changes       = newton->linear ? 0 : 1;
    newton->small = 0;
  } else {
    PetscCall(SNESGetJacobian(snes, NULL, &P, NULL, NULL));
    PetscCall(LatinTangentChanges_Private(newton->structure, u, newton->floor, P, &changes));
    PetscCall(SNESGetLineSearch(snes, &search));
    PetscCall(SNESLineSearchGetLambda(search, &lambda));
    if (PetscAbsReal((PetscReal)(lambda - 1.0)) > LATIN_NEWTON_RTOL) changes = PetscMax(changes, 1); /* a shortened step: links have changed along it */
    newton->error = xnorm > 0.0 ? snorm / xnorm : 0.0;
    if (newton->energy) PetscCall(LatinNewtonStep_Private(snes, newton, u, &energy, &newton->error));
    if (!changes && !newton->tangent) newton->error = PetscMax(newton->error, newton->known) * PetscMin(1.0, newton->safety * newton->left); /* with contrasts of stiffness only a step of no length is a proof */
    newton->known = changes ? 0.0 : newton->error;
    unexplained   = (PetscBool)(newton->tangent && !newton->structure->penalty && newton->error > LATIN_NEWTON_REST &&
                              newton->slope > LATIN_NEWTON_RTOL); /* unless it is rounding; without it 2 of 150 nearly straight cables, and 1 of 150 structures with contrasts, are refused */
    newton->small = newton->error <= newton->target && newton->error <= PetscMax(newton->small ? before : PETSC_MAX_REAL, LATIN_NEWTON_REST) ? newton->small + 1 : 0;
    confirmed     = (PetscBool)(!newton->tangent || !newton->contrast || newton->structure->penalty || newton->small > 1 ||
                            newton->error <= LATIN_NEWTON_REST); /* the next linear solve sees the forces of soft links: a node that creeps behind stiff ones needs it (tests/test_collapse.py) */
    if (newton->reference) PetscCall(LatinStructureComputeErrors(newton->structure, u, newton->reference, &newton->error, &energy));
  }
  rounding = (PetscBool)(it > 1 && !changes && !unexplained && !newton->changes && newton->error > LATIN_NEWTON_GAIN * before && newton->left < LATIN_NEWTON_RTOL); /* no error reduction with a fixed active set */
  claims   = (PetscBool)(it && confirmed && ((newton->tangent && !newton->structure->penalty) || !changes || newton->error <= LATIN_NEWTON_REST) && newton->error <= newton->target && fnorm <= newton->balance);
  if (claims && newton->structure->penalty) PetscCall(LatinNewtonNear_Private(newton, u, fnorm, &claims));
  if ((rounding || claims) && (newton->tangent || newton->proves) && !newton->structure->penalty) PetscCall(LatinNewtonProve_Private(snes, newton, u, fnorm, (PetscBool)(changes || unexplained), &rounding, &claims));
  PetscCall(LatinSelfStress_Private(newton->structure, snes->vec_rhs, it ? xnorm : PETSC_MAX_REAL, &rests));
  if (fnorm <= newton->residual) *reason = SNES_CONVERGED_FNORM_RELATIVE;
  else if (rests || claims || rounding) *reason = SNES_CONVERGED_SNORM_RELATIVE;
  else if (it >= most || newton->stages_left <= 0) *reason = SNES_DIVERGED_MAX_IT;
  PetscCall(PetscInfo(snes, "step %" PetscInt_FMT ": %" PetscInt_FMT " links have changed, estimated error %g of %g\n", it, changes, (double)newton->error, (double)newton->target));
  slow            = (PetscBool)(it == LATIN_NEWTON_FULL || (it >= LATIN_NEWTON_SLOW && 2 * changes > newton->changes && (newton->structure->penalty || !newton->structure->ground)));
  newton->changes = changes;
  if (slow && !*reason) PetscCall(LatinNewtonCollapse_Private(newton, snes->vec_rhs));
  if (it == LATIN_NEWTON_FULL && !newton->tangent && !*reason) *reason = SNES_DIVERGED_MAX_IT; /* the solution is not near: it begins again with the tangent stiffness */
  if (newton->held && !*reason) *reason = SNES_DIVERGED_INNER;                                 /* it begins again where the interior-point method ends */
  if (newton->found.verdict == LATIN_UNBOUNDED) *reason = SNES_DIVERGED_DTOL;
  PetscCall(KSPSetTolerances(ksp, changes || newton->tangent ? newton->rtol : LATIN_NEWTON_TIGHT, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  newton->left = 0.0; /* direct solvers do not call the test that sets it */
  newton->size = PetscMax(newton->size, xnorm);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinNewtonJacobian_Private(SNES snes, Vec u, Mat A, Mat P, void *ctx)
{
  LatinNewton *newton = (LatinNewton *)ctx;
  PetscInt     done;
  Vec          tangent;

  PetscFunctionBegin;
  (void)P;
  PetscCall(SNESGetIterationNumber(snes, &done));
  if (done && !newton->changes) PetscFunctionReturn(0); /* active set unchanged: reuse operator and preconditioner */
  PetscCall(LatinTangentCompute_Private(newton->structure, u, newton->floor, A, &tangent));
  PetscFunctionReturn(0);
}

/* Line search: LATIN_NEWTON_FULL full steps, then the minimum of the energy along each step, since the active set cycles. Not full steps with laws of the user: they go far where links yield, and their rounding stays; nor from the end of the interior-point method. */
static PetscErrorCode LatinNewtonSearch_Private(SNESLineSearch search, void *ctx)
{
  LatinNewton *newton = (LatinNewton *)ctx;
  PetscReal    length = 1.0;
  PetscScalar  before, after;
  PetscInt     done;
  SNES         snes;
  Vec          u, f, step;

  PetscFunctionBegin;
  PetscCall(SNESLineSearchGetSNES(search, &snes));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(SNESLineSearchGetVecs(search, &u, &f, &step, NULL, NULL));
  PetscCall(SNESGetIterationNumber(snes, &done));
  PetscCall(VecDot(f, step, &before));
  if (newton->own_laws || newton->near || done >= LATIN_NEWTON_FULL) PetscCall(LatinStructureSearch_Private(newton->structure, u, step, snes->vec_rhs, &length));
  PetscCall(VecAXPY(u, -length, step));
  PetscCall(VecScale(step, length)); /* its norm is that of the shortened step */
  PetscCall(SNESLineSearchSetLambda(search, length));
  PetscCall(SNESComputeFunction(snes, u, f));
  PetscCall(VecDot(f, step, &after));
  newton->slope = PetscRealPart(before) > 0.0 ? PetscRealPart(after) / (length * PetscRealPart(before)) : 0.0;
  PetscCall(SNESLineSearchComputeNorms(search));
  PetscFunctionReturn(0);
}

/*
   Does Newton's method finish with a preconditioner of the tangent stiffness? Motions do not need it, since masses make all modes stiff;
   except with both rigid and elastic links, where nothing else detects slowly converging tensions. Collective on structure
*/
PetscErrorCode LatinNewtonOwn_Private(LatinStructure structure, PetscBool *own)
{
  PetscBool elastic = PETSC_FALSE;
  PetscInt  unknowns;

  PetscFunctionBegin;
  PetscCall(VecGetSize(structure->load, &unknowns));
  *own = (PetscBool)(unknowns <= LATIN_NEWTON_OWN && !(structure->ground && structure->rigid_law < 0));
  if (!*own || !structure->ground) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++) elastic = (PetscBool)(elastic || !LatinLaws[structure->law[l]].rigid);
  PetscCall(MPIU_Allreduce(&elastic, own, 1, LATIN_MPI_BOOL, MPI_LOR, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}

/* An inner SNES, prefix -snes_latin_newton_: Newton's method with PC latin, natural norm of CG. Its options are not read yet. Collective on snes */
PetscErrorCode SNESLatinInner_Private(SNES snes, PetscErrorCode (*apply)(SNESLineSearch, void *), void *ctx, KSPType type, SNES *newinner)
{
  SNESLineSearch search;
  const char    *prefix;
  char           given[64] = SNESNEWTONLS;
  PetscBool      is, cg;
  SNES           inner;
  KSP            ksp;
  PC             pc;

  PetscFunctionBegin;
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(PetscOptionsGetString(((PetscObject)snes)->options, prefix, "-snes_latin_newton_snes_type", given, sizeof(given), NULL));
  PetscCall(PetscStrInList(given, "newtonls,newtontr,newtontrdc", ',', &is));
  PetscCheck(is, PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP, "-snes_latin_newton_snes_type %s is not Newton's method: take newtonls, newtontr or newtontrdc", given);
  PetscCall(SNESCreate(PetscObjectComm((PetscObject)snes), &inner));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)inner, (PetscObject)snes, 1));
  PetscCall(SNESSetOptionsPrefix(inner, prefix));
  PetscCall(SNESAppendOptionsPrefix(inner, "snes_latin_newton_"));
  PetscCall(PetscObjectSetOptions((PetscObject)inner, ((PetscObject)snes)->options));
  PetscCall(SNESSetType(inner, SNESNEWTONLS));
  PetscCall(SNESGetLineSearch(inner, &search));
  PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHSHELL));
  PetscCall(SNESLineSearchShellSetApply(search, apply, ctx));
  PetscCall(SNESGetKSP(inner, &ksp));
  PetscCall(KSPSetType(ksp, type));
  PetscCall(PetscStrcmp(type, KSPCG, &cg));
  if (cg) PetscCall(KSPSetNormType(ksp, KSP_NORM_NATURAL));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCLATIN));
  *newinner = inner;
  PetscFunctionReturn(0);
}

/* Reads the options of the inner SNES; other KSPs than CG have no natural norm. Collective on inner */
PetscErrorCode SNESLatinInnerOptions_Private(SNES inner, PetscBool *cg)
{
  KSP ksp;

  PetscFunctionBegin;
  PetscCall(SNESSetFromOptions(inner));
  PetscCall(SNESGetKSP(inner, &ksp));
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPCG, cg));
  if (!*cg) PetscCall(KSPSetNormType(ksp, KSP_NORM_DEFAULT));
  PetscFunctionReturn(0);
}

/* The inner SNES, prefix -snes_latin_newton_; `tangent`: preconditioner of the tangent stiffness. Collective on snes */
PetscErrorCode LatinNewtonCreate_Private(SNES snes, Latin latin, PetscBool tangent, LatinNewton *newton)
{
  SNES      inner;
  KSP       ksp;
  PC        pc;
  Mat       A;
  PetscBool is, cg;

  PetscFunctionBegin;
  if (newton->tangent != tangent) PetscCall(SNESDestroy(&newton->snes));
  newton->tangent = tangent;
  if (newton->snes) PetscFunctionReturn(0);
  PetscCall(SNESLatinInner_Private(snes, LatinNewtonSearch_Private, newton, KSPCG, &inner));
  PetscCall(SNESSetTolerances(inner, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, LATIN_NEWTON_STEPS, PETSC_DEFAULT));
  PetscCall(SNESGetKSP(inner, &ksp));
  PetscCall(KSPSetTolerances(ksp, tangent ? LATIN_NEWTON_TIGHT : LATIN_NEWTON_RTOL, PETSC_DEFAULT, PETSC_MAX_REAL, LATIN_NEWTON_LINEAR));
  PetscCall(KSPGetPC(ksp, &pc));
  if (tangent) PetscCall(PCLatinFollow_Private(pc, latin));
  else PetscCall(PCLatinShare_Private(pc, latin));
  PetscCall(SNESLatinInnerOptions_Private(inner, &cg));
  PetscCall(SNESSetConvergenceTest(inner, LatinNewtonConverged_Private, newton, NULL));
  PetscCall(KSPGetTolerances(ksp, &newton->rtol, NULL, NULL, NULL));
  PetscCall(KSPSetConvergenceTest(ksp, LatinNewtonLinear_Private, newton, NULL));
  /* matrix-free tangent stiffness for PC latin, which needs no entries */
  PetscCall(LatinStructureAttachSNES(newton->structure, inner));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  newton->snes = inner;
  if (!is) PetscFunctionReturn(0);
  PetscCall(PCLatinCorrected_Private(pc, cg));
  PetscCall(LatinTangentCreate_Private(newton->structure, &A));
  PetscCall(SNESSetJacobian(inner, A, A, LatinNewtonJacobian_Private, newton));
  PetscCall(MatDestroy(&A));
  PetscFunctionReturn(0);
}

/* Solves from the initial guess u, known to the relative error `known` (0: not known). u is undefined if the reason is negative. Collective on snes */
PetscErrorCode LatinNewtonSolve_Private(SNES snes, LatinNewton *newton, PetscReal known, Vec u, SNESConvergedReason *reason)
{
  const PetscBool own_laws = newton->own_laws;
  PetscReal       least, most;
  KSP             ksp;
  Vec             start = NULL;

  PetscFunctionBegin;
  PetscCall(LatinStructureStiffnessRange_Private(newton->structure, &least, &most));
  newton->floor             = newton->tangent ? PetscMax(LATIN_NEWTON_FLOOR * least, LATIN_NEWTON_FLOOR_GREATEST * most) : 0.0; /* 0 without a stall: no mechanism is near, and a step is exact */
  newton->linear            = (PetscBool)!newton->latin->sub.nonsmooth_global;
  newton->error             = newton->latin->linear.indicator;
  newton->known             = known;
  newton->left              = 0.0;
  newton->safety            = 1.0;
  newton->tensions          = -1.0;
  newton->collapse_searched = newton->held = newton->near = PETSC_FALSE;
  PetscCall(PetscMemzero(&newton->found, sizeof(newton->found)));
  PetscCall(VecNorm(u, NORM_2, &newton->size));
  PetscCall(SNESGetKSP(newton->snes, &ksp));
  PetscCall(KSPSetTolerances(ksp, newton->rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  if (own_laws) {
    PetscCall(DMGetGlobalVector(newton->structure->dm, &start));
    PetscCall(VecCopy(u, start));
  }
  PetscCall(LatinMultipliersSolve_Private(snes, newton, u, reason));
  if (*reason < 0 && own_laws && newton->structure->penalty && newton->found.verdict != LATIN_UNBOUNDED &&
      newton->found.verdict != LATIN_JAMMED) { /* rigid links close one by one along searched steps, many at once along full ones: else two of 964 loads that tables bear are refused */
    PetscCall(VecCopy(start, u));
    PetscCall(LatinMultipliersStart_Private(newton));
    newton->own_laws = PETSC_FALSE;
    PetscCall(LatinMultipliersSolve_Private(snes, newton, u, reason));
    newton->own_laws = own_laws;
  }
  if (own_laws) PetscCall(DMRestoreGlobalVector(newton->structure->dm, &start));
  if (*reason < 0 && newton->found.verdict != LATIN_JAMMED) PetscCall(LatinNewtonCollapse_Private(newton, snes->vec_rhs));
  if (newton->held) {
    newton->held = PETSC_FALSE;
    newton->near = (PetscBool)!newton->structure->penalty;
    PetscCall(LatinNewtonConvex_Private(newton, snes->vec_rhs, u));
    PetscCall(LatinMultipliersSolve_Private(snes, newton, u, reason));
  }
  PetscFunctionReturn(0);
}
