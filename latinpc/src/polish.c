#include "sneslatinimpl.h"
#include <petsc/private/snesimpl.h>

/*
   Newton's method after the iteration of SNES latin, for two ends.

   Polish: Newton's method from the displacements of SNES latin on, once its indicator is small. The taut links of these
   displacements are nearly those of the solution, and a step of Newton's method is exact for given taut links: what is
   left is mostly one linear problem, which conjugate gradients solve in fewer linear stages than the fixed-point
   iteration. The preconditioner is PC latin on the operators that SNES latin has built already.

   Rescue (rescue.c): where the iteration stalls, because a slack link is far stiffer or softer than what surrounds it,
   Newton's method takes over with a PC latin of its own on the tangent stiffness, built anew when links have changed.
   The energy is convex, and a search for its least along each step makes the method converge from anywhere.

   A solve goes no further than its step deserves: while links still change between taut and slack, two digits (-ksp_rtol
   of the inner KSP); once none has changed, all that are missing.
*/

#define LATIN_POLISH_RTOL   1e-2                         /* of a linear solve whose step changes the taut links */
#define LATIN_POLISH_SAFETY 0.3                          /* the last solve aims at this part of the target */
#define LATIN_POLISH_LEAST  LatinByPrecision(1e-9, 1e-5) /* least tolerance of a linear solve: below, rounding */
#define LATIN_RESCUE_RTOL   LatinByPrecision(1e-9, 1e-5) /* forces of stiff links must not hide those of soft ones; and a solve costs less than its preconditioner */
#define LATIN_RESCUE_FLOOR  LatinByPrecision(1e-8, 1e-5) /* what a slack link keeps of the least stiffness, so that no mechanism ends the search */
#define LATIN_RESCUE_LINEAR 500                          /* most iterations of a solve: more, and it is no rescue */
#define LATIN_RESCUE_STEPS  200                          /* most steps */
#define LATIN_RESCUE_STILL  10                           /* a search that stands still may meet rounding, or a link that is just taut: then it does so again and again */
#define LATIN_RESCUE_KICK   3                            /* then a whole step is taken, to search from elsewhere: not where rounding of stiff links hides how the energy of soft ones falls */
#define LATIN_RESCUE_FULL   12                           /* steps that are taken whole: they end soon if they end at all */

/*
   The error left after a step is the part of it that the linear solver has left over when no link has changed, and
   the step itself otherwise. With PC latin the natural norm of CG is that of the energy, about.
*/
static PetscErrorCode LatinPolishConverged_Private(SNES newton, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *reason, void *ctx)
{
  LatinPolish   *polish = (LatinPolish *)ctx;
  PetscReal      before = polish->error, lambda = 1.0, rtol;
  PetscInt       changes, most;
  Vec            u;
  KSP            ksp;
  SNESLineSearch search;

  PetscFunctionBegin;
  *reason = SNES_CONVERGED_ITERATING;
  if (PetscIsInfOrNanReal(fnorm) || PetscIsInfOrNanReal(snorm)) {
    *reason = SNES_DIVERGED_FUNCTION_NANORINF;
    PetscFunctionReturn(0);
  }
  PetscCall(SNESGetKSP(newton, &ksp));
  PetscCall(SNESGetSolution(newton, &u));
  PetscCall(SNESGetTolerances(newton, NULL, NULL, NULL, &most, NULL));
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  if (!it) {
    changes       = polish->linear ? 0 : 1;
    polish->still = 0;
  } else {
    PetscCall(LatinLinksCountChanges_Private(polish->links, u, polish->floor, &changes));
    PetscCall(SNESGetLineSearch(newton, &search));
    PetscCall(SNESLineSearchGetLambda(search, &lambda));
    if (PetscAbsReal((PetscReal)(lambda - 1.0)) > LATIN_POLISH_RTOL) changes = PetscMax(changes, 1); /* not the whole step, for links have changed on the way */
    polish->error = xnorm > 0.0 ? snorm / xnorm : 0.0;
    if (lambda < 1.0 - LATIN_POLISH_RTOL && polish->error <= polish->target) polish->still++;
    else if (polish->still != LATIN_RESCUE_KICK) polish->still = 0;
    else polish->still = polish->error <= polish->target ? 0 : LATIN_RESCUE_KICK + 1; /* from there on no more of them until the search moves */
    if (!changes && !polish->own) polish->error *= rtol;                              /* where forces differ by orders, only a step that moves nothing proves anything */
    if (polish->reference) PetscCall(LatinLinksComputeErrors(polish->links, u, polish->reference, &polish->error, &polish->energy));
  }
  polish->changes = changes;
  if (fnorm <= polish->residual) *reason = SNES_CONVERGED_FNORM_RELATIVE;
  else if (it && polish->error <= polish->target && (!polish->still || polish->still > LATIN_RESCUE_STILL)) *reason = SNES_CONVERGED_SNORM_RELATIVE;
  else if (it > 1 && !changes && polish->error > 0.5 * before && rtol < polish->rtol) *reason = SNES_CONVERGED_SNORM_RELATIVE; /* rounding: a step that was to bring digits has brought none */
  else if (it && !polish->own && polish->error > 1e3 * PetscMax(1.0, polish->start)) *reason = SNES_DIVERGED_DTOL;
  else if (it >= most) *reason = SNES_DIVERGED_MAX_IT;
  rtol = changes || polish->own ? polish->rtol : PetscMin(polish->rtol, PetscMax(LATIN_POLISH_LEAST, LATIN_POLISH_SAFETY * polish->target / polish->error));
  PetscCall(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(PetscInfo(newton, "step %" PetscInt_FMT ": %" PetscInt_FMT " links have changed, estimated error %g, next linear tolerance %g\n", it, changes, (double)polish->error, (double)rtol));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPolishMult_Private(Mat A, Vec x, Vec y)
{
  LatinPolish *polish;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(A, &polish));
  PetscCall(LatinLinksMultTangent_Private(polish->links, x, y));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPolishJacobian_Private(SNES newton, Vec u, Mat A, Mat P, void *ctx)
{
  PetscInt done;

  PetscFunctionBegin;
  (void)P;
  PetscCall(SNESGetIterationNumber(newton, &done));
  if (done && !((LatinPolish *)ctx)->changes) PetscFunctionReturn(0); /* the same operator, and preconditioner */
  PetscCall(LatinLinksSetTangent_Private(((LatinPolish *)ctx)->links, u, ((LatinPolish *)ctx)->floor));
  PetscCall(PetscObjectStateIncrease((PetscObject)A));
  PetscFunctionReturn(0);
}

/* The structure's residual and, for PC latin, which needs no entries, its tangent stiffness as an operator */
static PetscErrorCode LatinPolishAttach_Private(LatinPolish *polish)
{
  PetscBool latin;
  PetscInt  n;
  KSP       ksp;
  PC        pc;
  Mat       A;

  PetscFunctionBegin;
  PetscCall(LatinLinksAttachSNES(polish->links, polish->newton));
  PetscCall(SNESGetKSP(polish->newton, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &latin));
  if (!latin) PetscFunctionReturn(0);
  PetscCall(VecGetLocalSize(polish->links->load, &n));
  PetscCall(MatCreateShell(PetscObjectComm((PetscObject)polish->newton), n, n, PETSC_DETERMINE, PETSC_DETERMINE, polish, &A));
  PetscCall(MatShellSetOperation(A, MATOP_MULT, (void (*)(void))LatinPolishMult_Private));
  PetscCall(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(SNESSetJacobian(polish->newton, A, A, LatinPolishJacobian_Private, polish));
  PetscCall(MatDestroy(&A));
  PetscFunctionReturn(0);
}

/* Whole steps at first; when they have not ended, links change to and fro, and only the least energy along each step leads on */
static PetscErrorCode LatinRescueSearch_Private(SNESLineSearch search, void *ctx)
{
  LatinPolish *polish = (LatinPolish *)ctx;
  PetscReal    length = 1.0;
  PetscInt     done;
  SNES         newton;
  Vec          u, f, step;

  PetscFunctionBegin;
  PetscCall(SNESLineSearchGetSNES(search, &newton));
  PetscCall(SNESLineSearchSetReason(search, SNES_LINESEARCH_SUCCEEDED));
  PetscCall(SNESLineSearchGetVecs(search, &u, &f, &step, NULL, NULL));
  PetscCall(SNESGetIterationNumber(newton, &done));
  if (done >= LATIN_RESCUE_FULL && polish->still != LATIN_RESCUE_KICK) PetscCall(LatinLinksSearch_Private(polish->links, u, step, newton->vec_rhs, &length));
  PetscCall(VecAXPY(u, -length, step));
  PetscCall(VecScale(step, length)); /* the norm of the step is that of what was taken */
  PetscCall(SNESLineSearchSetLambda(search, length));
  PetscCall(SNESComputeFunction(newton, u, f));
  PetscCall(SNESLineSearchComputeNorms(search));
  PetscFunctionReturn(0);
}

/* The inner SNES, prefix -snes_latin_polish_ or -snes_latin_rescue_: full steps, as they end in a few iterations, or a search; CG with PC latin. Collective on snes */
PetscErrorCode LatinPolishCreate_Private(SNES snes, Latin latin, LatinPolish *polish)
{
  SNESLineSearch search;
  const char    *prefix;
  KSP            ksp;
  PC             pc;
  PetscBool      cg;

  PetscFunctionBegin;
  if (polish->newton) PetscFunctionReturn(0);
  PetscCall(SNESCreate(PetscObjectComm((PetscObject)snes), &polish->newton));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)polish->newton, (PetscObject)snes, 1));
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(SNESSetOptionsPrefix(polish->newton, prefix));
  PetscCall(SNESAppendOptionsPrefix(polish->newton, polish->own ? "snes_latin_rescue_" : "snes_latin_polish_"));
  PetscCall(PetscObjectSetOptions((PetscObject)polish->newton, ((PetscObject)snes)->options));
  PetscCall(SNESSetType(polish->newton, SNESNEWTONLS));
  if (polish->own) PetscCall(SNESSetTolerances(polish->newton, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, LATIN_RESCUE_STEPS, PETSC_DEFAULT));
  PetscCall(SNESGetLineSearch(polish->newton, &search));
  PetscCall(SNESLineSearchSetType(search, polish->own ? SNESLINESEARCHSHELL : SNESLINESEARCHNONE));
  if (polish->own) PetscCall(SNESLineSearchShellSetApply(search, LatinRescueSearch_Private, polish));
  PetscCall(SNESGetKSP(polish->newton, &ksp));
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetNormType(ksp, KSP_NORM_NATURAL));
  PetscCall(KSPSetTolerances(ksp, polish->own ? LATIN_RESCUE_RTOL : LATIN_POLISH_RTOL, PETSC_DEFAULT, polish->own ? PETSC_MAX_REAL : PETSC_DEFAULT, polish->own ? LATIN_RESCUE_LINEAR : 2000));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCLATIN));
  if (polish->own) PetscCall(PCLatinFollow_Private(pc, latin));
  else PetscCall(PCLatinShare_Private(pc, latin));
  PetscCall(SNESSetFromOptions(polish->newton));
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPCG, &cg));
  if (!cg) PetscCall(KSPSetNormType(ksp, KSP_NORM_DEFAULT));
  PetscCall(SNESSetConvergenceTest(polish->newton, LatinPolishConverged_Private, polish, NULL));
  PetscCall(KSPGetTolerances(ksp, &polish->rtol, NULL, NULL, NULL));
  PetscFunctionReturn(0);
}

/* From the displacements u to those of the solution. u is worthless when the reason is negative. Collective on snes */
PetscErrorCode LatinPolishSolve_Private(SNES snes, Latin latin, LatinPolish *polish, Vec u, SNESConvergedReason *reason)
{
  PetscInt  nonsmooth = latin->sub.nonsmooth;
  PetscReal least;
  KSP       ksp;

  PetscFunctionBegin;
  PetscCall(LatinPolishCreate_Private(snes, latin, polish));
  PetscCall(LatinLinksStiffnessRange_Private(latin->links, &least, NULL));
  polish->floor = polish->own ? LATIN_RESCUE_FLOOR * least : 0.0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &nonsmooth, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)snes)));
  if (polish->links != latin->links) {
    polish->links = latin->links;
    PetscCall(LatinPolishAttach_Private(polish));
  }
  polish->linear = (PetscBool)!nonsmooth;
  polish->error  = latin->indicator;
  PetscCall(SNESGetKSP(polish->newton, &ksp));
  PetscCall(KSPSetTolerances(ksp, polish->rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(SNESSolve(polish->newton, snes->vec_rhs, u));
  PetscCall(SNESGetConvergedReason(polish->newton, reason));
  PetscCall(SNESGetIterationNumber(polish->newton, &polish->steps));
  PetscCall(SNESGetLinearSolveIterations(polish->newton, &polish->stages));
  PetscFunctionReturn(0);
}
