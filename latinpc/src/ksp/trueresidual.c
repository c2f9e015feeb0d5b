#include "ksp/ksplatinimpl.h"

/*
   When KSP latin may claim convergence. The interface residual that its test sees is an energy norm: b - A x in the 2-norm,
   which users of a KSP rely on, can be larger by the square root of the condition number. So each claim is compared with
   b - A x, for one product with the matrix. Where that is larger than the tolerances allow, the iteration goes on; where
   the interface data have no digits left, it starts again from the solution found, with b - A x as load.
*/

#define LATIN_RESIDUAL_NOISE 16.0        /* eps, of x; solutions of the robustness suite that are right leave up to 9 */
#define LATIN_HASH           2654435761u /* 2^32 over the golden ratio: scatters the signs of neighbours */
#define LATIN_REFINE_GAIN    0.5         /* part of b - A x that a pass may leave to be worth another one: of more, rounding is the cause */

/* The norm of b - A x that the tolerances allow, as PETSc's default test has it with KSP_NORM_UNPRECONDITIONED. data->load is the residual of the initial guess. Collective on ksp */
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
   What rounding leaves of b - A x: the norm of A times the last digits of x, here of random sign. The solution itself,
   rounded, has such a residual. Collective on ksp
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

/* Iterations until the interface residual, which has fallen to `norm` in `it`, falls by so much more at this rate: at least one, at most as many again */
static PetscInt KSPLatinMore(const KSP_Latin *data, PetscInt it, PetscReal norm)
{
  const PetscReal more = it * PetscLogReal(data->left / data->allowed) / PetscLogReal(data->scale / norm);

  return more > 1.0 ? (PetscInt)PetscCeilReal(PetscMin(more, it)) : 1;
}

/*
   After `it` iterations of this pass, which leave the interface residual `norm`: is *reason, a claim of PETSc's default
   test, true? The same for interface data without digits. A test of the user's is left to decide. Collective on ksp
*/
PetscErrorCode KSPLatinCheck_Private(KSP ksp, PetscInt it, PetscReal norm, KSPConvergedReason *reason)
{
  KSP_Latin      *data     = (KSP_Latin *)ksp->data;
  const PetscBool claim    = (PetscBool)(*reason > 0 && *reason != KSP_CONVERGED_ITS && ksp->converged == KSPConvergedDefault);
  const PetscBool digits   = (PetscBool)(norm > data->latin->linear.noise);
  PetscReal       rounding = 0.0;
  Vec             residual;

  PetscFunctionBegin;
  if (!claim && (*reason || digits)) PetscFunctionReturn(0);
  *reason = ksp->normtype == KSP_NORM_NONE ? KSP_CONVERGED_ATOL : KSP_CONVERGED_ITERATING;
  if (*reason || (it < data->next && digits)) PetscFunctionReturn(0);
  if (data->checked != it) {
    PetscCall(KSPBuildResidual(ksp, data->solution, data->residual, &residual));
    PetscCall(VecNorm(residual, NORM_2, &data->left));
    data->checked = it;
  }
  if (claim && data->left > data->allowed && ksp->normtype != KSP_NORM_UNPRECONDITIONED) PetscCall(KSPLatinRounding_Private(ksp, data->solution, &rounding));
  PetscCall(PetscInfo(ksp, "iteration %" PetscInt_FMT ": |b - A x| is %g, the tolerances allow %g, rounding %g\n", ksp->its, (double)data->left, (double)data->allowed, (double)rounding));
  if (data->left <= PetscMax(data->allowed, rounding)) *reason = data->left < ksp->abstol ? KSP_CONVERGED_ATOL : KSP_CONVERGED_RTOL;
  else if (PetscIsInfOrNanReal(data->left)) *reason = KSP_DIVERGED_NANORINF;
  else if (!digits) *reason = KSP_DIVERGED_BREAKDOWN;
  else data->next = it + KSPLatinMore(data, it, norm);
  PetscFunctionReturn(0);
}

/*
   After a pass that has broken down, for want of digits or by the outer KSP's own judgement: another one from there may find
   more. Its guess is the solution of this one, its load the residual. An outer KSP that has ended well without being
   tested is taken to have broken down. Collective on ksp
*/
PetscErrorCode KSPLatinRefine_Private(KSP ksp, PetscBool *again)
{
  KSP_Latin      *data   = (KSP_Latin *)ksp->data;
  const PetscReal before = data->left_before;
  Mat             A;

  PetscFunctionBegin;
  *again = PETSC_FALSE;
  if (ksp->normtype == KSP_NORM_NONE) PetscFunctionReturn(0);
  if (ksp->reason > 0 && ksp->reason != KSP_CONVERGED_ITS && ksp->converged == KSPConvergedDefault && data->before + data->checked != ksp->its) ksp->reason = KSP_DIVERGED_BREAKDOWN;
  if (ksp->reason != KSP_DIVERGED_BREAKDOWN) PetscFunctionReturn(0);
  PetscCall(KSPGetOperators(ksp, &A, NULL));
  PetscCall(MatMult(A, ksp->vec_sol, data->load));
  PetscCall(VecAYPX(data->load, -1.0, ksp->vec_rhs));
  PetscCall(VecNorm(data->load, NORM_2, &data->left));
  if (data->left <= data->allowed) ksp->reason = KSP_CONVERGED_RTOL;
  else if (data->passes && !(data->left <= LATIN_REFINE_GAIN * before)) {
    if (!(data->left <= before)) PetscCall(VecCopy(data->guess, ksp->vec_sol));
    data->left = PetscMin(data->left, before);
    PetscCall(PetscInfo(ksp, "Rounding leaves |b - A x| at %g, the tolerances allow %g\n", (double)data->left, (double)data->allowed));
  } else if (ksp->its >= ksp->max_it) ksp->reason = KSP_DIVERGED_ITS;
  else {
    *again            = PETSC_TRUE;
    data->left_before = data->left;
    data->before      = ksp->its;
    PetscCall(VecCopy(ksp->vec_sol, data->guess));
  }
  PetscFunctionReturn(0);
}
