#include "ksp/ksplatinimpl.h"

/*
   KSP latin: the iteration on interface data for linear operators (ksp/interfaceoperator.c), solved by an outer KSP of the user's choice, with the prefix
   -ksp_latin_outer_: richardson is the iteration of the article, gmres its acceleration. A solve:

   1. The residual of the initial guess becomes the load of the linear stage: the unknown is the correction of the guess.
   2. A pass: the outer KSP solves for the interface data; a linear stage gives the displacements.
   3. While b - A x is too large and the outer KSP is at the level of rounding, another pass from the current solution (ksp/trueresidual.c).
*/

#define LATIN_SAME_MATRIX LatinByPrecision(1e-8, 1e-4) /* largest relative difference, by rounding, of two products with the same matrix */

static PetscErrorCode KSPLatinMult_Private(Mat A, Vec x, Vec y)
{
  KSP ksp;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(A, &ksp));
  PetscCall(LatinReflectionApply_Private(&((KSP_Latin *)ksp->data)->latin->linear, x, y));
  PetscFunctionReturn(0);
}

/* Computes x = guess + scale times the displacements under the scaled loads and data y. Collective on ksp */
static PetscErrorCode KSPLatinDisplacements_Private(KSP ksp, Vec y, Vec x)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  PetscCall(LatinReflectionSolution_Private(&data->latin->linear, y, x));
  PetscCall(VecScale(x, data->scale));
  PetscCall(VecAXPY(x, 1.0, data->guess));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPBuildSolution_Latin(KSP ksp, Vec v, Vec *V)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;
  Vec        y;

  PetscFunctionBegin;
  if (ksp->reason) {
    PetscCall(KSPBuildSolutionDefault(ksp, v, V));
    PetscFunctionReturn(0);
  }
  *V = v ? v : data->solution;
  PetscCall(KSPBuildSolution(data->outer, NULL, &y));
  PetscCall(KSPLatinDisplacements_Private(ksp, y, *V));
  PetscFunctionReturn(0);
}

/*
   Calls the test of KSP latin, which the user may set, unless it is PETSc's default test at the first iteration. That is relative to the first residual,
   which is not that of zero displacements, or with a nonzero guess to the PC of the right-hand side. Here both are data->rhs_norm, the norm of the
   right-hand side in the variables of the residuals: sets the references that the default test reads at later iterations. Collective on ksp
*/
static PetscErrorCode KSPLatinTest_Private(KSP ksp, PetscReal norm, KSPConvergedReason *reason)
{
  const KSP_Latin              *data    = (KSP_Latin *)ksp->data;
  const KSPConvergedDefaultCtx *context = ksp->converged == KSPConvergedDefault ? (KSPConvergedDefaultCtx *)ksp->cnvP : NULL;
  const PetscReal               whole   = data->rhs_norm;

  PetscFunctionBegin;
  if (ksp->its || !context || context->initialrtol || !(whole > 0.0)) {
    PetscCall((*ksp->converged)(ksp, ksp->its, norm, reason, ksp->cnvP));
    PetscFunctionReturn(0);
  }
  ksp->rnorm0 = PetscMax(whole, norm); /* of the divergence tolerance: the first residual may be much larger */
  ksp->ttol   = PetscMax(ksp->rtol * (context->mininitialrtol ? PetscMin(whole, norm) : whole), ksp->abstol);
  *reason     = norm <= ksp->ttol ? KSP_CONVERGED_RTOL : KSP_CONVERGED_ITERATING;
  PetscFunctionReturn(0);
}

/*
   Convergence test of the outer KSP: monitors and test of KSP latin, with the norm of its norm type; then the true residual. rnorm: interface residual
   over data->scale. Collective on ksp
*/
static PetscErrorCode KSPLatinConverged_Private(KSP outer, PetscInt it, PetscReal rnorm, KSPConvergedReason *reason, void *ctx)
{
  KSP             ksp       = (KSP)ctx;
  KSP_Latin      *data      = (KSP_Latin *)ksp->data;
  const PetscReal interface = rnorm * data->scale;
  PetscReal       norm      = ksp->normtype == KSP_NORM_NONE ? 0.0 : interface;

  PetscFunctionBegin;
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED) {
    PetscCall(KSPLatinTrueNorm_Private(ksp, it));
    norm = data->true_norm;
  }
  ksp->its   = data->before + it;
  ksp->rnorm = norm;
  if (ksp->its > data->logged) { /* restarts repeat an iteration */
    data->logged = ksp->its;
    PetscCall(KSPLogResidualHistory(ksp, norm));
    PetscCall(KSPMonitor(ksp, ksp->its, norm));
  }
  if (it || !data->passes) PetscCall(KSPLatinTest_Private(ksp, norm, reason)); /* a pass begins where the last one has been tested */
  PetscCall(KSPLatinCheck_Private(ksp, it, interface, reason));
  if (!*reason && ksp->its >= ksp->max_it) *reason = KSP_DIVERGED_ITS;
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPReset_Latin(KSP ksp)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  PetscCall(KSPReset(data->outer));
  PetscCall(MatDestroy(&data->A));
  PetscCall(VecDestroy(&data->b));
  PetscCall(VecDestroy(&data->y));
  PetscCall(LatinReset_Private(data->latin));
  PetscFunctionReturn(0);
}

/*
   Checks that A is the sum of the operators of the subdomains, which this solver uses in place of its matrix: by the product with a random vector, unless
   the subdomains are those of this matrix. Overwrites data->solution, residual. Collective on ksp
*/
static PetscErrorCode KSPLatinCheckMatrix_Private(KSP ksp, Mat A)
{
  KSP_Latin             *data = (KSP_Latin *)ksp->data;
  const LatinSubdomains *sub  = &data->latin->sub;
  PetscReal             *v = data->latin->linear.U, *f = data->latin->linear.g, norm, difference;
  PetscScalar           *a;
  Vec                    x;

  PetscFunctionBegin;
  if (A == sub->matrix) PetscFunctionReturn(0);
  PetscCall(VecDuplicate(data->solution, &x));
  PetscCall(VecSetRandom(x, NULL));
  PetscCall(MatMult(A, x, data->residual));
  PetscCall(VecNorm(data->residual, NORM_2, &norm));
  if (sub->matrix) PetscCall(MatMult(sub->matrix, x, data->solution));
  else {
    PetscCall(PetscArrayzero(v, sub->bs * sub->copies));
    PetscCall(LatinDistribute_Private(sub, x, v));
    PetscCall(LatinOperatorMult(sub, v, f));
    PetscCall(LatinSum_Private(sub, f, data->solution));
    PetscCall(VecGetArray(data->residual, &a));
    for (PetscInt k = 0; k < sub->unassigned_count; k++) a[sub->unassigned[k]] = 0.0; /* rows of nodes without links */
    PetscCall(VecRestoreArray(data->residual, &a));
  }
  PetscCall(VecDestroy(&x));
  PetscCall(VecAXPY(data->residual, -1.0, data->solution));
  PetscCall(VecNorm(data->residual, NORM_2, &difference));
  PetscCheck(difference <= LATIN_SAME_MATRIX * norm, PetscObjectComm((PetscObject)ksp), PETSC_ERR_ARG_INCOMP, "The matrix of -ksp_type latin is not %s: they differ by %g, relative. Another matrix can be solved with -ksp_type cg -pc_type latin",
             sub->structure ? "the tangent stiffness of its structure (LatinStructureComputeJacobian())" : "the MATIS that it is set up from", norm > 0.0 ? (double)(difference / norm) : (double)difference);
  PetscFunctionReturn(0);
}

/* Checks the size of the solution vector, which PETSc checks too late. Not if there is no matrix, an error found later. Collective on ksp */
static PetscErrorCode KSPLatinCheckVec_Private(KSP ksp)
{
  PetscInt n, m;

  PetscFunctionBegin;
  if (!ksp->vec_sol || !ksp->pc->pmat) PetscFunctionReturn(0);
  PetscCall(VecGetLocalSize(ksp->vec_sol, &n));
  PetscCall(MatGetLocalSize(ksp->pc->pmat, NULL, &m));
  LatinAgree(PetscObjectComm((PetscObject)ksp), m >= 0 && n != m, PETSC_ERR_ARG_SIZ, "The solution vector has %" PetscInt_FMT " entries on a rank where the matrix has %" PetscInt_FMT " columns; make it with MatCreateVecs()", n, m);
  PetscFunctionReturn(0);
}

/* Finds whether this is another object (or NULL) than at the last call for place i, or has changed since. Not collective */
static PetscErrorCode KSPLatinChanged_Private(KSP_Latin *data, PetscInt i, PetscObject object, PetscBool *changed)
{
  PetscObjectId    id    = 0;
  PetscObjectState state = 0;

  PetscFunctionBegin;
  if (object) {
    PetscCall(PetscObjectGetId(object, &id));
    PetscCall(PetscObjectStateGet(object, &state));
  }
  *changed       = (PetscBool)(id != data->id[i] || state != data->state[i]);
  data->id[i]    = id;
  data->state[i] = state;
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPSetUp_Latin(KSP ksp)
{
  KSP_Latin  *data = (KSP_Latin *)ksp->data;
  Mat         A, P;
  PetscObject coordinates;
  PetscBool   changed[3];

  PetscFunctionBegin;
  PetscCall(KSPLatinCheckVec_Private(ksp));
  PetscCall(KSPGetOperators(ksp, &A, &P));
  PetscCall(PetscObjectQuery((PetscObject)ksp->pc, "LatinCoordinates", &coordinates));
  PetscCall(KSPLatinChanged_Private(data, 0, (PetscObject)P, &changed[0]));
  PetscCall(KSPLatinChanged_Private(data, 1, coordinates, &changed[1]));
  PetscCall(KSPLatinChanged_Private(data, 2, (PetscObject)A, &changed[2]));
  if (data->A && !data->latin->stale && !changed[0] && !changed[1]) {
    if (!changed[2]) PetscFunctionReturn(0);
    data->id[2] = 0; /* after an error it is checked again */
    PetscCall(KSPLatinCheckMatrix_Private(ksp, A));
    PetscCall(KSPLatinChanged_Private(data, 2, (PetscObject)A, &changed[2]));
    PetscFunctionReturn(0);
  }
  PetscCall(KSPReset_Latin(ksp));
  PetscCall(LatinSetUpOperator_Private(data->latin, (PetscObject)ksp, ksp->pc, ksp->dm));
  PetscCall(KSPSetWorkVecs(ksp, 5));
  data->guess    = ksp->work[0];
  data->load     = ksp->work[1];
  data->solution = ksp->work[2];
  data->residual = ksp->work[3];
  data->digits   = ksp->work[4];
  PetscCall(KSPLatinCheckMatrix_Private(ksp, A));
  PetscCall(MatCreateShell(PetscObjectComm((PetscObject)ksp), data->latin->inter.sides, data->latin->inter.sides, PETSC_DETERMINE, PETSC_DETERMINE, ksp, &data->A));
  PetscCall(MatShellSetOperation(data->A, MATOP_MULT, (void (*)(void))KSPLatinMult_Private));
  PetscCall(MatCreateVecs(data->A, &data->y, &data->b));
  PetscCall(KSPSetOperators(data->outer, data->A, data->A));
  PetscFunctionReturn(0);
}

/* Sets the loads of the linear stage, and data->b to their right-hand side, with its norm. Collective on ksp */
static PetscErrorCode KSPLatinLoad_Private(KSP ksp, Vec load, PetscReal *norm)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  PetscCall(LatinLinearSetLoads(&data->latin->linear, load));
  PetscCall(LatinReflectionApply_Private(&data->latin->linear, NULL, data->b));
  PetscCall(VecNorm(data->b, NORM_2, norm));
  PetscFunctionReturn(0);
}

/* Takes a pass: the outer KSP solves for the correction of data->guess with data->load. Sets ksp->vec_sol, its and reason. Collective on ksp */
static PetscErrorCode KSPLatinPass_Private(KSP ksp)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  PetscCall(KSPLatinLoad_Private(ksp, data->load, &data->scale));
  if (data->scale <= data->latin->linear.noise) { /* the first linear stage has found the solution */
    PetscCall(VecZeroEntries(data->b));
    data->scale = 1.0;
  } else if (!PetscIsInfOrNanReal(data->scale)) {
    const PetscInt n = data->latin->sub.bs * data->latin->sub.copies;

    /* scaled: Krylov methods must not depend on the user's units */
    PetscCall(VecScale(data->b, 1.0 / data->scale));
    for (PetscInt i = 0; i < n; i++) data->latin->linear.load[i] /= data->scale;
    for (PetscInt k = 0; k < data->latin->sub.unassigned_count; k++) data->latin->linear.unassigned_u[k] /= data->scale;
  }
  ksp->reason   = KSP_CONVERGED_ITERATING; /* not that of the last pass */
  data->checked = -1;
  data->next    = 0;
  PetscCall(KSPSetTolerances(data->outer, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, PetscMax(ksp->max_it - data->before, 1)));
  PetscCall(KSPSolve(data->outer, data->b, data->y));
  PetscCall(KSPGetIterationNumber(data->outer, &ksp->its));
  PetscCall(KSPGetConvergedReason(data->outer, &ksp->reason));
  if (data->checked == ksp->its) PetscCall(VecCopy(data->solution, ksp->vec_sol));
  else PetscCall(KSPLatinDisplacements_Private(ksp, data->y, ksp->vec_sol));
  ksp->its += data->before;
  PetscFunctionReturn(0);
}

/*
   Calls monitors and the test of the user if the first linear stage has found the solution, as with one subdomain: the outer KSP tests nothing.
   Collective on ksp
*/
static PetscErrorCode KSPLatinAtOnce_Private(KSP ksp)
{
  KSP_Latin         *data   = (KSP_Latin *)ksp->data;
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;

  PetscFunctionBegin;
  ksp->rnorm = 0.0;
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED) PetscCall(KSPLatinResidual_Private(ksp, data->residual, &ksp->rnorm));
  PetscCall(KSPLogResidualHistory(ksp, ksp->rnorm));
  PetscCall(KSPMonitor(ksp, ksp->its, ksp->rnorm));
  if (ksp->converged != KSPConvergedDefault) PetscCall((*ksp->converged)(ksp, ksp->its, ksp->rnorm, &reason, ksp->cnvP));
  if (reason) ksp->reason = reason;
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPSolve_Latin(KSP ksp)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;
  PetscBool  symmetric, again = PETSC_TRUE;
  PetscInt   failed;
  Mat        A;

  PetscFunctionBegin;
  PetscCall(KSPSetUp_Latin(ksp)); /* PETSc sets up the PC alone if the matrix has changed */
  PetscCall(PetscObjectTypeCompareAny((PetscObject)data->outer, &symmetric, KSPCG, KSPFCG, KSPPIPECG, KSPGROPPCG, KSPMINRES, KSPSYMMLQ, ""));
  PetscCheck(!symmetric, PetscObjectComm((PetscObject)ksp), PETSC_ERR_SUP,
             "The interface operator of KSP latin is not symmetric: instead of %s use -ksp_latin_outer_ksp_type gmres, or bcgs, or conjugate gradients for the displacements with -ksp_type cg -pc_type latin", ((PetscObject)data->outer)->type_name);
  PetscCall(KSPGetOperators(ksp, &A, NULL));
  data->rhs_norm             = 0.0;
  data->latin->linear.failed = PETSC_FALSE;
  data->passes = data->before = 0;
  data->logged                = -1;
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED) PetscCall(VecNorm(ksp->vec_rhs, NORM_2, &data->rhs_norm));
  PetscCall(VecCopy(ksp->vec_rhs, data->load));
  if (ksp->guess_zero) PetscCall(VecZeroEntries(data->guess));
  else {
    PetscCall(VecCopy(ksp->vec_sol, data->guess));
    if (ksp->normtype == KSP_NORM_PRECONDITIONED) PetscCall(KSPLatinLoad_Private(ksp, ksp->vec_rhs, &data->rhs_norm));
    PetscCall(MatMult(A, data->guess, data->residual));
    PetscCall(VecAXPY(data->load, -1.0, data->residual));
  }
  PetscCall(KSPLatinAllow_Private(ksp));
  PetscCall(KSPSetNormType(data->outer, ksp->normtype == KSP_NORM_NONE ? KSP_NORM_NONE : KSP_NORM_DEFAULT));
  for (; again; data->passes++) {
    PetscCall(KSPLatinPass_Private(ksp));
    PetscCall(KSPLatinRefine_Private(ksp, &again));
  }
  if (data->logged < 0) PetscCall(KSPLatinAtOnce_Private(ksp));
  failed = data->latin->linear.failed ? 1 : 0; /* no norm shows failures in the first or the last stage, or on a rank without interfaces */
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &failed, 1, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)ksp)));
  if (failed) ksp->reason = KSP_DIVERGED_PC_FAILED;
  else if (ksp->reason > 0 && PetscIsInfOrNanReal(data->latin->linear.noise)) ksp->reason = KSP_DIVERGED_NANORINF; /* the energy overflows: no test was valid */
  PetscCall(KSP_RemoveNullSpace(ksp, ksp->vec_sol));
  PetscFunctionReturn(0);
}

LatinWatched(KSPSetUp_Latin, KSP)
LatinWatched(KSPSolve_Latin, KSP)

static PetscErrorCode KSPSetFromOptions_Latin(KSP ksp, LatinOptionItems PetscOptionsObject)
{
  KSP_Latin  *data     = (KSP_Latin *)ksp->data;
  const char *prefix   = ((PetscObject)ksp)->prefix;
  char        type[64] = "";

  PetscFunctionBegin;
  PetscCall(LatinSetFromOptions_Private(data->latin, (PetscObject)ksp));
  PetscCall(PetscOptionsGetString(((PetscObject)ksp)->options, prefix, "-pc_type", type, sizeof(type), NULL));
  PetscCheck(!type[0] || !strcmp(type, PCNONE), PetscObjectComm((PetscObject)ksp), PETSC_ERR_ARG_INCOMP, "-ksp_type latin takes no preconditioner, but -pc_type is %s: remove it, or use it with another KSP, for example -ksp_type cg -pc_type latin",
             type);
  if (data->latin->stale) ksp->setupstage = KSP_SETUP_NEW; /* the next KSPSetUp() builds it again */
  PetscCall(PetscObjectSetOptions((PetscObject)data->outer, ((PetscObject)ksp)->options));
  PetscCall(KSPSetOptionsPrefix(data->outer, prefix));
  PetscCall(KSPAppendOptionsPrefix(data->outer, "ksp_latin_outer_"));
  PetscCall(KSPSetFromOptions(data->outer));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPDestroy_Latin(KSP ksp)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  if (ksp->pc) PetscCall(PetscObjectComposeFunction((PetscObject)ksp->pc, "PCSetCoordinates_C", NULL));
  PetscCall(KSPReset_Latin(ksp));
  PetscCall(KSPDestroy(&data->outer));
  PetscCall(LatinDestroy_Private(&data->latin));
  PetscCall(PetscFree(ksp->data));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPView_Latin(KSP ksp, PetscViewer viewer)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;
  PetscBool  ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(LatinView_Private(data->latin, viewer));
  if (ksp->reason == KSP_DIVERGED_BREAKDOWN) PetscCall(PetscViewerASCIIPrintf(viewer, "last solve: |b - A x| stagnates at %g by rounding, the tolerances allow %g\n", (double)data->true_norm, (double)data->allowed));
  PetscCall(PetscViewerASCIIPrintf(viewer, "solver of the interface data:\n"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(KSPView(data->outer, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(0);
}

/*MC
  KSPLATIN - The LATIN iteration on interface data alone, for symmetric positive definite matrices: to PC latin what `KSPFETIDP` is to `PCBDDC`

  Options Database Keys:
+ -ksp_latin_modes <affine>         - macro fields of strong interfaces: affine, rigid
. -ksp_latin_modes_local <-2>       - local low-energy fields in the coarse space, eigenvalues below this; 0: none, -2: automatic
. -ksp_latin_subdomains <0>         - number of subdomains, 0: automatic
. -ksp_latin_partitioner <auto>     - metis on one rank, parallel on all, or auto; not of a MATIS
. -ksp_latin_direction <schur>      - micro search direction: scalar, diagonal, block, schur, auto
. -ksp_latin_outer_ksp_type <gmres> - acceleration, or richardson, the plain iteration
. -ksp_latin_outer_                 - prefix of that KSP
. -ksp_latin_local_                 - prefix of the KSP of the subdomains
- -ksp_latin_coarse_                - prefix of the KSP of the coarse problem

  Level: intermediate

  Notes:
  An iteration is one linear stage: one solve of each subdomain and one coarse solve, without products with the matrix and
  without elimination of interiors. A solve begins and ends with one more stage.

  The norm of monitors and of the convergence test is, with KSP_NORM_PRECONDITIONED (the default), that of the interface
  residual: the distance of two iterates in the energy norm of the search direction. With KSP_NORM_UNPRECONDITIONED it is
  that of b - A x, for one more linear stage and one more product an iteration.

  With either norm, PETSc's default test reports convergence only if the 2-norm of b - A x also meets the tolerances,
  max(rtol |b|, atol), or is of the size of the rounding of x. It is computed when the interface residual meets the
  tolerances; if it is too large, the iteration goes on. When the interface residual reaches the level of rounding, the solve restarts
  from the current solution, with b - A x as load. It ends with KSP_DIVERGED_BREAKDOWN if a restart does not halve b - A x;
  `KSPView()` shows its norm. KSP_NORM_UNPRECONDITIONED makes no allowance for rounding.

  The matrix is the tangent stiffness of a structure, or a `MATIS`. The PC of this KSP is none; `PCSetCoordinates()` on it
  sets the coordinates of the unknowns of a `MATIS`.

.seealso: `LatinStructureAttachKSP()`, `KSPLatinGetLatin()`, `KSPLatinGetOuter()`, `PCLATIN`, `SNESLATIN`
M*/
PETSC_EXTERN PetscErrorCode KSPCreate_Latin(KSP ksp)
{
  KSP_Latin *data;
  PC         pc;

  PetscFunctionBegin;
  PetscCall(PetscNew(&data));
  ksp->data                = (void *)data;
  ksp->ops->setup          = KSPSetUp_Latin_Watched;
  ksp->ops->solve          = KSPSolve_Latin_Watched;
  ksp->ops->reset          = KSPReset_Latin;
  ksp->ops->destroy        = KSPDestroy_Latin;
  ksp->ops->setfromoptions = KSPSetFromOptions_Latin;
  ksp->ops->view           = KSPView_Latin;
  ksp->ops->buildsolution  = KSPBuildSolution_Latin;
  ksp->ops->buildresidual  = KSPBuildResidualDefault;
  ksp->setupnewmatrix      = PETSC_TRUE;
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_PRECONDITIONED, PC_LEFT, 3));
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_UNPRECONDITIONED, PC_LEFT, 2));
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_NONE, PC_LEFT, 1));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCNONE));
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", LatinSetCoordinates_Private));
  PetscCall(LatinCreate_Private(PetscObjectComm((PetscObject)ksp), &data->latin));
  data->latin->sub.tangent = PETSC_TRUE;
  PetscCall(KSPCreate(PetscObjectComm((PetscObject)ksp), &data->outer));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)data->outer, (PetscObject)ksp, 1));
  PetscCall(KSPSetType(data->outer, KSPGMRES));
  PetscCall(KSPGMRESSetRestart(data->outer, 100)); /* interface vectors are short */
  /* else, if coefficients of the matrix jump, orthogonality is lost and the residual stagnates */
  PetscCall(KSPOrthogonalizationSetCGSRefinementType(data->outer, KSP_ORTHOGONALIZATION_CGS_REFINE_IFNEEDED));
  PetscCall(KSPGetPC(data->outer, &pc));
  PetscCall(PCSetType(pc, PCNONE));
  PetscCall(KSPSetConvergenceTest(data->outer, KSPLatinConverged_Private, ksp, NULL));
  PetscFunctionReturn(0);
}
