#include "snes/sneslatinimpl.h"

/*
   Newton's method after the iteration of SNES latin. Linear solves: conjugate gradients with PC latin on the tangent stiffness. Its convergence tests
   are in snes/newtontests.c.

   Finish: proves an error, or continues if rounding ends the iteration too early. The active set (the taut links) is nearly that of the solution. For
   a fixed active set a Newton step is exact: its length is the error before the step, and that times the relative residual of the linear solve is the
   error after it. The preconditioner reuses the operators of SNES latin, with all links taut. These overestimate the stiffness of soft modes of the
   taut links, next to collapse for example. So small structures get a preconditioner of the tangent stiffness here as well, which takes milliseconds.

   Stall: a linear stage treats every link as a spring of its ascent direction l = k. If a slack link is much stiffer than the structure around it, or
   if only soft slack links hold the structure, displacements hardly move from one stage to the next: the number of stages is about the ratio of the
   stiffnesses. Here the preconditioner is built from the tangent stiffness, which excludes slack links, and is rebuilt when the active set has
   changed.

   The energy is convex, so that a line search makes the method converge from any start. Linear solves are inexact: they end at the requested error;
   while the active set changes, at two digits at most (-ksp_rtol of the inner KSP).
*/

#define LATIN_NEWTON_STAGES   300                          /* the iteration stalls if more linear stages than this are predicted */
#define LATIN_NEWTON_WINDOW   20                           /* linear stages over which the contraction rate is measured */
#define LATIN_NEWTON_CONTRAST 1e6                          /* ratio of stiffnesses above which a small change of the displacements does not prove convergence */
#define LATIN_NEWTON_FLOOR    LatinByPrecision(1e-8, 1e-5) /* tangent stiffness of slack links, relative to the least stiffness: keeps it regular */
#define LATIN_NEWTON_STEPS    200                          /* most steps; half as many: a case of the catalogue is refused */
/*
   most unknowns for a preconditioner of the tangent stiffness at the finish. Without it 6 in 3,000 structures next to collapse were wrong, and 1 in
   3,000 with rigid links
*/
#define LATIN_NEWTON_OWN 3000
/* most links of grains with friction at rest for the interior-point method; with more it seldom ends, and 200 of its steps take as long as the iteration.
   In a time step masses keep the grains apart, and it ends in some 40 */
#define LATIN_NEWTON_GRAINS 40000

/* Resets the counters before the first linear stage of a solve, and decides when Newton's method may be used. Collective on structure */
PetscErrorCode LatinNewtonStart_Private(LatinNewton *newton, LatinStructure structure)
{
  PetscReal least, most;
  PetscInt  links = 0;
  PetscBool own   = PETSC_FALSE;

  PetscFunctionBegin;
  newton->iterations = newton->steps = newton->stages = 0;
  newton->last = newton->slides = PETSC_MAX_INT;
  PetscCall(PetscMemzero(&newton->found, sizeof(newton->found)));
  for (PetscInt i = 0; i < 3; i++) newton->least[i] = PETSC_MAX_REAL;
  PetscCall(LatinStructureStiffnessRange_Private(structure, &least, &most));
  if (structure->has_friction && !structure->ground && !(most > 0.0)) links = structure->links_global;
  newton->stall             = (PetscBool)(newton->type != LATIN_NEWTON_NEVER && links <= LATIN_NEWTON_GRAINS);
  newton->grains            = (PetscBool)(structure->has_friction && !(most > 0.0));
  newton->collapse_searched = PETSC_FALSE;
  newton->own_laws          = (PetscBool)(structure->own_laws && !structure->ground && !structure->has_friction);
  PetscCall(LatinNewtonOwn_Private(structure, &own));
  newton->finish   = (PetscBool)(newton->stall && (structure->rigid_law < 0 || (own && !structure->has_friction)));
  newton->most     = LATIN_NEWTON_STAGES;
  newton->contrast = (PetscBool)(most > LATIN_NEWTON_CONTRAST * least && !structure->has_friction); /* with friction Newton's method may fail although there is an equilibrium */
  PetscFunctionReturn(0);
}

/*
   Returns whether the iteration stalls: the contraction rate of the last two windows predicts more than newton->most linear stages. To be called once
   per stage with the measure of the stop and its target
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

/*
   Line search: LATIN_NEWTON_FULL full steps, then the minimum of the energy along each step, since the active set may cycle. The minimum from the
   first step on with laws of the user, where full steps go far and leave rounding errors, and from the end of the interior-point method
*/
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
   Returns in *own whether Newton's method finishes with a preconditioner of the tangent stiffness. Not in motions, whose masses make all modes stiff,
   unless there are both rigid and elastic links: nothing else detects slowly converging tensions. Collective on structure
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

/*
   Creates an inner SNES, prefix -snes_latin_newton_: Newton's method with PC latin, and the natural norm in CG. Does not read its options. apply,
   ctx: its line search. Collective on snes
*/
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

/* Creates the inner SNES, prefix -snes_latin_newton_, unless there is one. tangent: preconditioner from the tangent stiffness. Collective on snes */
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

/* Resets the results of the last run, and sets what depends on the initial guess u. known: its relative error, 0: not known. Collective on newton->structure */
static PetscErrorCode LatinNewtonBegin_Private(LatinNewton *newton, PetscReal known, Vec u)
{
  PetscReal least, most;
  KSP       ksp;

  PetscFunctionBegin;
  PetscCall(LatinStructureStiffnessRange_Private(newton->structure, &least, &most));
  /* 0 without a stall: no mechanism is near, and steps are exact */
  newton->floor             = newton->tangent ? PetscMax(LATIN_NEWTON_FLOOR * least, LATIN_NEWTON_FLOOR_GREATEST * most) : 0.0;
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
  PetscFunctionReturn(0);
}

/*
   Solves by Newton's method, with multipliers of rigid links. If links of tables beside rigid links fail: again with full steps, as searches close
   rigid links one by one. Of 1,200 random structures of tables, bars and rigid links 357 converge, without 342. Collective on snes
*/
static PetscErrorCode LatinNewtonRun_Private(SNES snes, LatinNewton *newton, Vec u, SNESConvergedReason *reason)
{
  const PetscBool both = (PetscBool)(newton->own_laws && newton->structure->penalty);
  Vec             start;

  PetscFunctionBegin;
  if (both) {
    PetscCall(DMGetGlobalVector(newton->structure->dm, &start));
    PetscCall(VecCopy(u, start));
  }
  PetscCall(LatinMultipliersSolve_Private(snes, newton, u, reason));
  if (!both) PetscFunctionReturn(0);
  if (*reason < 0 && newton->found.verdict != LATIN_UNBOUNDED && newton->found.verdict != LATIN_JAMMED) {
    PetscCall(VecCopy(start, u));
    PetscCall(LatinMultipliersStart_Private(newton));
    newton->own_laws = PETSC_FALSE;
    PetscCall(LatinMultipliersSolve_Private(snes, newton, u, reason));
    newton->own_laws = PETSC_TRUE;
  }
  PetscCall(DMRestoreGlobalVector(newton->structure->dm, &start));
  PetscFunctionReturn(0);
}

/*
   Solves from the initial guess u. After a failure the search for a collapse follows. If it finds that the structure bears the loads, an interior-point
   method leads Newton's method to the solution.

   known: relative error of u, 0: not known. u is undefined if the reason is negative. Collective on snes
*/
PetscErrorCode LatinNewtonSolve_Private(SNES snes, LatinNewton *newton, PetscReal known, Vec u, SNESConvergedReason *reason)
{
  PetscFunctionBegin;
  PetscCall(LatinNewtonBegin_Private(newton, known, u));
  PetscCall(LatinNewtonRun_Private(snes, newton, u, reason));
  if (*reason < 0 && newton->found.verdict != LATIN_JAMMED) PetscCall(LatinNewtonCollapse_Private(newton, snes->vec_rhs));
  if (newton->held) {
    newton->held = PETSC_FALSE;
    newton->near = (PetscBool)!newton->structure->penalty;
    PetscCall(LatinNewtonConvex_Private(newton, snes->vec_rhs, u));
    PetscCall(LatinMultipliersSolve_Private(snes, newton, u, reason));
  }
  PetscFunctionReturn(0);
}
