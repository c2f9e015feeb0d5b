#include "ksp/ksplatinimpl.h"

/*
   Convergence test of KSP latin by the true residual. The interface residual is an energy norm; the 2-norm of b - A x, which users of a KSP rely on, can be
   larger by the square root of the condition number.

   1. If the interface residual meets the tolerances, b - A x must confirm it, for one product with the matrix.
   2. If b - A x is larger than the tolerances allow, the iteration goes on.
   3. If the interface residual has reached the level of rounding, the iteration restarts from the current solution, with b - A x as load (iterative
      refinement), until a restart no longer reduces b - A x.
*/

#define LATIN_RESIDUAL_NOISE 16.0        /* times eps and x: accepted rounding of x; correct solutions of the robustness suite have up to 9 */
#define LATIN_HASH           2654435761u /* 2^32 over the golden ratio, for pseudo-random signs */
#define LATIN_REFINE_GAIN    0.5         /* largest factor of a pass on b - A x after which another one follows; larger ones are due to rounding */

/*
   Computes data->allowed, the norm of b - A x that the tolerances allow, as PETSc's default test with KSP_NORM_UNPRECONDITIONED does. data->load is
   the residual of the initial guess. Collective on ksp
*/
PetscErrorCode KSPLatinAllow_Private(KSP ksp)
{
  KSP_Latin                    *data    = (KSP_Latin *)ksp->data;
  const KSPConvergedDefaultCtx *context = ksp->converged == KSPConvergedDefault ? (KSPConvergedDefaultCtx *)ksp->cnvP : NULL;
  PetscReal                     whole, first;

  PetscFunctionBegin;
  PetscCall(VecNorm(ksp->vec_rhs, NORM_2, &whole));
  PetscCall(VecNorm(data->load, NORM_2, &first));
  if (whole == 0.0 || (context && context->initialrtol)) whole = first;
  if (context && context->mininitialrtol) whole = PetscMin(whole, first);
  data->allowed = PetscMax(ksp->rtol * whole, ksp->abstol);
  PetscFunctionReturn(0);
}

/*
   Computes the level of rounding of b - A x: the norm of A times a rounding error of x with pseudo-random signs. The exact solution, rounded, has such a
   residual. Overwrites data->digits, residual. Collective on ksp
*/
static PetscErrorCode KSPLatinRounding_Private(KSP ksp, Vec x, PetscReal *norm)
{
  KSP_Latin   *data = (KSP_Latin *)ksp->data;
  Mat          A;
  PetscScalar *a;
  PetscInt     first, last;

  PetscFunctionBegin;
  PetscCall(KSPGetOperators(ksp, &A, NULL));
  PetscCall(VecCopy(x, data->digits));
  PetscCall(VecScale(data->digits, LATIN_RESIDUAL_NOISE * PETSC_MACHINE_EPSILON));
  PetscCall(VecGetOwnershipRange(data->digits, &first, &last));
  PetscCall(VecGetArray(data->digits, &a));
  for (PetscInt i = first; i < last; i++)
    if ((uint32_t)i * LATIN_HASH >> 31) a[i - first] = -a[i - first];
  PetscCall(VecRestoreArray(data->digits, &a));
  PetscCall(MatMult(A, data->digits, data->residual));
  PetscCall(VecNorm(data->residual, NORM_2, norm));
  PetscFunctionReturn(0);
}

/* Computes r = b - A x for the solution of the last pass, and its norm. Collective on ksp */
PetscErrorCode KSPLatinResidual_Private(KSP ksp, Vec r, PetscReal *norm)
{
  Mat A;

  PetscFunctionBegin;
  PetscCall(KSPGetOperators(ksp, &A, NULL));
  PetscCall(MatMult(A, ksp->vec_sol, r));
  PetscCall(VecAYPX(r, -1.0, ksp->vec_rhs));
  PetscCall(VecNorm(r, NORM_2, norm));
  PetscFunctionReturn(0);
}

/* Computes data->true_norm, the norm of b - A x after `it` iterations of this pass. Overwrites data->solution, residual. Collective on ksp */
PetscErrorCode KSPLatinTrueNorm_Private(KSP ksp, PetscInt it)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;
  Vec        residual;

  PetscFunctionBegin;
  PetscCall(KSPBuildResidual(ksp, data->solution, data->residual, &residual));
  PetscCall(VecNorm(residual, NORM_2, &data->true_norm));
  data->checked = it;
  PetscFunctionReturn(0);
}

/* Returns the predicted iterations, 1 to `it`, until b - A x meets the tolerances, at the mean rate of the interface residual after `it` iterations */
static PetscInt KSPLatinMore(const KSP_Latin *data, PetscInt it, PetscReal interface)
{
  const PetscReal more = it * PetscLogReal(data->true_norm / data->allowed) / PetscLogReal(data->scale / interface);

  return more > 1.0 ? (PetscInt)PetscCeilReal(PetscMin(more, it)) : 1;
}

/*
   Confirms or withdraws *reason of PETSc's default test, after `it` iterations of this pass with this interface residual; decides as well if it is at
   the level of rounding. Reasons of other tests of the user stay. Overwrites data->solution, residual, digits. Collective on ksp
*/
PetscErrorCode KSPLatinCheck_Private(KSP ksp, PetscInt it, PetscReal interface, KSPConvergedReason *reason)
{
  KSP_Latin      *data     = (KSP_Latin *)ksp->data;
  const PetscBool claim    = (PetscBool)(*reason > 0 && *reason != KSP_CONVERGED_ITS && ksp->converged == KSPConvergedDefault);
  const PetscBool digits   = (PetscBool)(interface > data->latin->linear.noise);
  PetscReal       rounding = 0.0;

  PetscFunctionBegin;
  if (ksp->normtype == KSP_NORM_NONE && interface == 0.0) PetscFunctionReturn(0); /* most outer KSPs compute no norm */
  if (!claim && (*reason || digits)) PetscFunctionReturn(0);
  *reason = ksp->normtype == KSP_NORM_NONE ? KSP_CONVERGED_ATOL : KSP_CONVERGED_ITERATING;
  if (*reason || (it < data->next && digits)) PetscFunctionReturn(0);
  if (data->checked != it) PetscCall(KSPLatinTrueNorm_Private(ksp, it));
  if (claim && data->true_norm > data->allowed && ksp->normtype != KSP_NORM_UNPRECONDITIONED) PetscCall(KSPLatinRounding_Private(ksp, data->solution, &rounding));
  PetscCall(PetscInfo(ksp, "iteration %" PetscInt_FMT ": |b - A x| is %g, the tolerances allow %g, rounding %g\n", ksp->its, (double)data->true_norm, (double)data->allowed, (double)rounding));
  if (data->true_norm <= PetscMax(data->allowed, rounding)) *reason = data->true_norm < ksp->abstol ? KSP_CONVERGED_ATOL : KSP_CONVERGED_RTOL;
  else if (PetscIsInfOrNanReal(data->true_norm)) *reason = KSP_DIVERGED_NANORINF;
  else if (!digits) *reason = KSP_LATIN_PASS_ENDS;
  else data->next = it + KSPLatinMore(data, it, interface);
  PetscFunctionReturn(0);
}

/*
   Prepares another pass after one with the reason KSP_LATIN_PASS_ENDS, which an outer KSP that reports convergence without a test gets here: its guess
   is the current solution, its load the residual. *again: another pass follows; else ksp->vec_sol is the better of the last two solutions. Collective
   on ksp
*/
PetscErrorCode KSPLatinRefine_Private(KSP ksp, PetscBool *again)
{
  KSP_Latin      *data   = (KSP_Latin *)ksp->data;
  const PetscReal before = data->true_before;

  PetscFunctionBegin;
  *again = PETSC_FALSE;
  if (ksp->normtype == KSP_NORM_NONE) PetscFunctionReturn(0);
  if (ksp->reason > 0 && ksp->reason != KSP_CONVERGED_ITS && ksp->converged == KSPConvergedDefault && data->before + data->checked != ksp->its) ksp->reason = KSP_LATIN_PASS_ENDS;
  if (ksp->reason != KSP_LATIN_PASS_ENDS) PetscFunctionReturn(0);
  PetscCall(KSPLatinResidual_Private(ksp, data->load, &data->true_norm));
  if (data->true_norm <= data->allowed) ksp->reason = KSP_CONVERGED_RTOL;
  else if (data->passes && !(data->true_norm <= LATIN_REFINE_GAIN * before)) {
    if (!(data->true_norm <= before)) PetscCall(VecCopy(data->guess, ksp->vec_sol));
    data->true_norm = PetscMin(data->true_norm, before);
    PetscCall(PetscInfo(ksp, "|b - A x| stagnates at %g by rounding, the tolerances allow %g\n", (double)data->true_norm, (double)data->allowed));
  } else if (ksp->its >= ksp->max_it) ksp->reason = KSP_DIVERGED_ITS;
  else {
    *again            = PETSC_TRUE;
    data->true_before = data->true_norm;
    data->before      = ksp->its;
    PetscCall(VecCopy(ksp->vec_sol, data->guess));
  }
  PetscFunctionReturn(0);
}
