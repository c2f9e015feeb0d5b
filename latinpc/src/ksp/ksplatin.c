#include "ksp/ksplatinimpl.h"

/*
   KSP latin: the iteration on interface data for linear operators, given to an inner KSP of the user's choice (prefix
   -ksp_latin_outer_): richardson is the plain iteration of the article, gmres its acceleration, minres and symmlq work
   on the symmetric form. The system is solved for the correction of the initial guess, with the residual as load. No
   mathematics of the method here: see ksp/interfaceoperator.c.
*/

static const char citation[] = "@article{AlartDureisseix2008,\n"
                               "  author  = {Pierre Alart and David Dureisseix},\n"
                               "  title   = {A scalable multiscale {LATIN} method adapted to nonsmooth discrete media},\n"
                               "  journal = {Computer Methods in Applied Mechanics and Engineering},\n"
                               "  volume  = {197},\n"
                               "  number  = {5},\n"
                               "  pages   = {319--331},\n"
                               "  year    = {2008},\n"
                               "  doi     = {10.1016/j.cma.2007.05.002}\n"
                               "}\n";
static PetscBool  cited      = PETSC_FALSE;

static PetscErrorCode KSPLatinMult_Private(Mat A, Vec x, Vec y)
{
  KSP                ksp;
  KSP_Latin         *data;
  const PetscScalar *a;
  PetscScalar       *b;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(A, &ksp));
  data = (KSP_Latin *)ksp->data;
  PetscCall(VecGetArrayRead(x, &a));
  PetscCall(VecGetArrayWrite(y, &b));
  PetscCall(LatinReflectionApply_Private(&data->latin->linear, PETSC_FALSE, a, data->symmetric, b));
  if (data->latin->linear.failed && data->latin->inter.sides) b[0] = INFINITY; /* seen by all ranks in the next norm, or at the end */
  PetscCall(VecRestoreArrayRead(x, &a));
  PetscCall(VecRestoreArrayWrite(y, &b));
  PetscFunctionReturn(0);
}

/* x = guess + displacements for the load and the data y, which belong to the load divided by scale */
static PetscErrorCode KSPLatinDisplacements_Private(KSP ksp, Vec y, Vec x)
{
  KSP_Latin   *data = (KSP_Latin *)ksp->data;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(y, (const PetscScalar **)&a));
  PetscCall(LatinReflectionSolution_Private(&data->latin->linear, a, x));
  PetscCall(VecRestoreArrayRead(y, (const PetscScalar **)&a));
  PetscCall(VecScale(x, data->scale));
  PetscCall(LatinUnassigned_Private(&data->latin->sub, data->load, x));
  if (data->guess) PetscCall(VecAXPY(x, 1.0, data->guess));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPBuildSolution_Latin(KSP ksp, Vec v, Vec *V)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;
  Vec        y;

  PetscFunctionBegin;
  if (data->iterating) {
    if (!v) v = data->work[0];
    PetscCall(KSPBuildSolution(data->outer, NULL, &y));
    PetscCall(KSPLatinDisplacements_Private(ksp, y, v));
    if (V) *V = v;
  } else if (v) {
    PetscCall(VecCopy(ksp->vec_sol, v));
    if (V) *V = v;
  } else *V = ksp->vec_sol;
  PetscFunctionReturn(0);
}

/* ---- convergence: the test of the KSP that the user holds decides, its monitors see what it tests ---- */

/*
   The default test compares with the norm of the first residual, or of the right-hand side when there is a guess. Ours is
   the norm that the right-hand side has where norms are measured: the first residual is not that of zero displacements.
*/
static PetscErrorCode KSPLatinTest_Private(KSP ksp, PetscInt it, PetscReal norm, KSPConvergedReason *reason)
{
  KSP_Latin              *data = (KSP_Latin *)ksp->data;
  const PetscBool         ours = (PetscBool)(!it && data->rhs_norm > 0.0 && ksp->converged == KSPConvergedDefault), zero = ksp->guess_zero;
  KSPConvergedDefaultCtx *context = (KSPConvergedDefaultCtx *)ksp->cnvP;

  PetscFunctionBegin;
  if (ours) ksp->guess_zero = PETSC_TRUE; /* or it would apply the PC of this KSP to the right-hand side */
  PetscCall((*ksp->converged)(ksp, it, norm, reason, ksp->cnvP));
  ksp->guess_zero = zero;
  if (!ours || context->initialrtol) PetscFunctionReturn(0);
  ksp->rnorm0 = PetscMax(data->rhs_norm, norm); /* what divergence is measured from: the first residual may be far above */
  ksp->ttol   = PetscMax(ksp->rtol * (context->mininitialrtol ? PetscMin(data->rhs_norm, norm) : data->rhs_norm), ksp->abstol);
  *reason     = norm <= ksp->ttol ? KSP_CONVERGED_RTOL : KSP_CONVERGED_ITERATING;
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPLatinConverged_Private(KSP outer, PetscInt it, PetscReal rnorm, KSPConvergedReason *reason, void *ctx)
{
  KSP        ksp  = (KSP)ctx;
  KSP_Latin *data = (KSP_Latin *)ksp->data;
  PetscReal  norm = rnorm * data->scale;

  PetscFunctionBegin;
  if (ksp->normtype == KSP_NORM_NONE) norm = 0.0;
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED) {
    Vec residual;

    PetscCall(KSPBuildResidual(ksp, data->work[0], data->work[1], &residual));
    PetscCall(VecNorm(residual, NORM_2, &norm));
  }
  ksp->its   = it;
  ksp->rnorm = norm;
  if (it > data->logged) { /* restarts test an iteration again */
    data->logged = it;
    PetscCall(KSPLogResidualHistory(ksp, norm));
    PetscCall(KSPMonitor(ksp, it, norm));
  }
  PetscCall(KSPLatinTest_Private(ksp, it, norm, reason));
  if (!*reason && rnorm * data->scale <= data->latin->linear.noise) *reason = KSP_CONVERGED_ATOL;
  if (!*reason && it >= ksp->max_it) *reason = KSP_DIVERGED_ITS;
  PetscFunctionReturn(0);
}

/* ---- set-up ---- */

static PetscErrorCode KSPLatinResetState_Private(KSP ksp)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  PetscCall(KSPReset(data->outer));
  PetscCall(MatDestroy(&data->A));
  PetscCall(VecDestroy(&data->b));
  PetscCall(VecDestroy(&data->y));
  PetscCall(VecDestroy(&data->guess));
  PetscCall(VecDestroy(&data->load));
  for (PetscInt i = 0; i < 2; i++) PetscCall(VecDestroy(&data->work[i]));
  data->matrix = 0;
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPSetUp_Latin(KSP ksp)
{
  KSP_Latin       *data = (KSP_Latin *)ksp->data;
  Mat              A, P;
  LatinStructure   structure;
  PetscObjectId    id;
  PetscObjectState state;

  PetscFunctionBegin;
  PetscCall(PetscCitationsRegister(citation, &cited));
  PetscCall(KSPGetOperators(ksp, &A, &P));
  PetscCall(LatinFindStructure_Private((PetscObject)ksp, "ksp", data->structure, ksp->dm, P, &structure));
  PetscCall(PetscObjectGetId((PetscObject)P, &id));
  PetscCall(PetscObjectStateGet((PetscObject)P, &state));
  if (data->A && structure == data->latin->sub.structure && !data->latin->stale && id == data->matrix && state == data->matrix_state) PetscFunctionReturn(0);
  PetscCall(KSPLatinResetState_Private(ksp));
  PetscCall(LatinReset_Private(data->latin));
  if (structure) {
    PetscCall(LatinSetStructure_Private(data->latin, structure));
    PetscCall(LatinSetTangent_Private(data->latin, P));
  } else PetscCall(KSPLatinSetMatrix_Private(ksp, P));
  PetscCall(MatCreateVecs(P, &data->work[0], &data->work[1]));
  PetscCall(LatinSetPrefix_Private(data->latin, (PetscObject)ksp));
  PetscCall(LatinSetUp_Private(data->latin));
  PetscCall(KSPLatinCheckMatrix_Private(ksp, A));
  PetscCall(LatinCreateState_Private(&data->latin->linear, &data->y));
  PetscCall(VecDuplicate(data->y, &data->b));
  PetscCall(MatCreateShell(PetscObjectComm((PetscObject)ksp), data->latin->inter.sides, data->latin->inter.sides, PETSC_DETERMINE, PETSC_DETERMINE, ksp, &data->A));
  PetscCall(MatShellSetOperation(data->A, MATOP_MULT, (void (*)(void))KSPLatinMult_Private));
  PetscCall(KSPSetOperators(data->outer, data->A, data->A));
  data->matrix       = id;
  data->matrix_state = state;
  PetscFunctionReturn(0);
}

/* ---- solve ---- */

/* The loads of the linear stage, and the interface data that they make: b and its norm */
static PetscErrorCode KSPLatinLoad_Private(KSP ksp, Vec load, PetscReal *norm)
{
  KSP_Latin   *data = (KSP_Latin *)ksp->data;
  PetscScalar *b;

  PetscFunctionBegin;
  PetscCall(LatinLinearSetLoads(&data->latin->linear, load));
  PetscCall(VecGetArrayWrite(data->b, &b));
  PetscCall(LatinReflectionApply_Private(&data->latin->linear, PETSC_TRUE, NULL, data->symmetric, b));
  PetscCall(VecRestoreArrayWrite(data->b, &b));
  PetscCall(VecNorm(data->b, NORM_2, norm));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPSolve_Latin(KSP ksp)
{
  KSP_Latin   *data = (KSP_Latin *)ksp->data;
  PetscBool    definite;
  PetscInt     failed;
  MatNullSpace kernel;
  Mat          A;

  PetscFunctionBegin;
  if (data->latin->stale) PetscCall(KSPSetUp_Latin(ksp));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)data->outer, &data->symmetric, KSPMINRES, KSPSYMMLQ, ""));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)data->outer, &definite, KSPCG, KSPFCG, KSPPIPECG, KSPGROPPCG, ""));
  PetscCheck(!definite, PetscObjectComm((PetscObject)ksp), PETSC_ERR_SUP,
             "The interface operator of KSP latin is symmetric but indefinite: instead of conjugate gradients take -ksp_latin_outer_ksp_type minres, or gmres, or conjugate gradients for the displacements with -ksp_type cg -pc_type latin");
  PetscCall(MatSetOption(data->A, MAT_SYMMETRIC, data->symmetric));
  PetscCall(KSPGetOperators(ksp, &A, NULL));
  PetscCall(VecDestroy(&data->guess));
  PetscCall(VecDestroy(&data->load));
  data->rhs_norm             = 0.0;
  data->latin->linear.failed = PETSC_FALSE;
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED) PetscCall(VecNorm(ksp->vec_rhs, NORM_2, &data->rhs_norm));
  if (ksp->guess_zero) {
    PetscCall(PetscObjectReference((PetscObject)ksp->vec_rhs));
    data->load = ksp->vec_rhs;
  } else {
    PetscCall(VecDuplicate(ksp->vec_sol, &data->guess));
    PetscCall(VecCopy(ksp->vec_sol, data->guess));
    if (ksp->normtype == KSP_NORM_PRECONDITIONED) PetscCall(KSPLatinLoad_Private(ksp, ksp->vec_rhs, &data->rhs_norm));
    PetscCall(VecDuplicate(ksp->vec_rhs, &data->load));
    PetscCall(MatMult(A, data->guess, data->load));
    PetscCall(VecAYPX(data->load, -1.0, ksp->vec_rhs));
  }
  PetscCall(KSPLatinLoad_Private(ksp, data->load, &data->scale));
  if (data->scale <= data->latin->linear.noise) { /* the first linear stage has found it all */
    PetscCall(VecZeroEntries(data->b));
    data->scale = 1.0;
  } else if (!PetscIsInfOrNanReal(data->scale)) {
    const PetscInt n = data->latin->sub.bs * data->latin->sub.copies;

    /* no Krylov method shall meet numbers of the user's units */
    PetscCall(VecScale(data->b, 1.0 / data->scale));
    for (PetscInt i = 0; i < n; i++) data->latin->linear.load[i] /= data->scale;
  }
  data->logged    = -1;
  data->iterating = PETSC_TRUE;
  PetscCall(KSPSetNormType(data->outer, ksp->normtype == KSP_NORM_NONE ? KSP_NORM_NONE : KSP_NORM_DEFAULT));
  PetscCall(KSPSetTolerances(data->outer, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, PetscMax(ksp->max_it, 1)));
  PetscCall(KSPSolve(data->outer, data->b, data->y));
  data->iterating = PETSC_FALSE;
  PetscCall(KSPGetIterationNumber(data->outer, &ksp->its));
  PetscCall(KSPGetConvergedReason(data->outer, &ksp->reason));
  PetscCall(KSPLatinDisplacements_Private(ksp, data->y, ksp->vec_sol));
  failed = data->latin->linear.failed ? 1 : 0; /* in the first stage or the last, which no norm has seen, or on a rank without interfaces */
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &failed, 1, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)ksp)));
  if (failed) ksp->reason = KSP_DIVERGED_PC_FAILED;
  else if (ksp->reason > 0 && PetscIsInfOrNanReal(data->latin->linear.noise)) ksp->reason = KSP_DIVERGED_NANORINF; /* the energy overflows: nothing has been compared with anything */
  PetscCall(MatGetNullSpace(A, &kernel));
  if (kernel) PetscCall(MatNullSpaceRemove(kernel, ksp->vec_sol));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPSetUp_Latin_Watched(KSP ksp)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)ksp), KSPSetUp_Latin(ksp));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPSolve_Latin_Watched(KSP ksp)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)ksp), KSPSolve_Latin(ksp));
  PetscFunctionReturn(0);
}

/* ---- the object ---- */

static PetscErrorCode KSPSetFromOptions_Latin(KSP ksp, LatinOptionItems PetscOptionsObject)
{
  KSP_Latin  *data = (KSP_Latin *)ksp->data;
  const char *prefix;
  char        type[64] = "";

  PetscFunctionBegin;
  PetscCall(LatinSetFromOptions_Private(data->latin, (PetscObject)ksp));
  PetscCall(KSPGetOptionsPrefix(ksp, &prefix));
  PetscCall(PetscOptionsGetString(((PetscObject)ksp)->options, prefix, "-pc_type", type, sizeof(type), NULL));
  PetscCheck(!type[0] || !strcmp(type, PCNONE), PetscObjectComm((PetscObject)ksp), PETSC_ERR_ARG_INCOMP, "-ksp_type latin takes no preconditioner, but -pc_type is %s: leave it out, or use it with another KSP, for example -ksp_type cg -pc_type latin",
             type);
  if (data->latin->stale) ksp->setupstage = KSP_SETUP_NEW; /* built again at the next KSPSetUp() */
  PetscCall(PetscObjectSetOptions((PetscObject)data->outer, ((PetscObject)ksp)->options));
  PetscCall(KSPSetOptionsPrefix(data->outer, prefix));
  PetscCall(KSPAppendOptionsPrefix(data->outer, "ksp_latin_outer_"));
  PetscCall(KSPSetFromOptions(data->outer));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPReset_Latin(KSP ksp)
{
  KSP_Latin *data = (KSP_Latin *)ksp->data;

  PetscFunctionBegin;
  PetscCall(KSPLatinResetState_Private(ksp));
  PetscCall(LatinReset_Private(data->latin));
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
  PetscCall(LatinStructureDestroy(&data->structure));
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
  PetscCall(PetscViewerASCIIPrintf(viewer, "solver of the interface data:\n"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(KSPView(data->outer, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode KSPLatinCheckType_Private(KSP ksp)
{
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(ksp, KSP_CLASSID, 1);
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPLATIN, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)ksp), PETSC_ERR_ARG_WRONG, "The KSP is not of type latin: call KSPSetType(ksp, KSPLATIN) first");
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureAttachKSP - Gives the structure to a KSP of type latin.

  Collective on ksp

  Level: intermediate

  Note:
  Not needed when the matrix comes from the DM of the structure.
@*/
PetscErrorCode LatinStructureAttachKSP(LatinStructure structure, KSP ksp)
{
  KSP_Latin *data;

  PetscFunctionBegin;
  PetscCall(KSPLatinCheckType_Private(ksp));
  data = (KSP_Latin *)ksp->data;
  if (structure != data->structure) ksp->setupstage = KSP_SETUP_NEW; /* built again at the next KSPSetUp() */
  PetscCall(LatinStructureReference(structure));
  PetscCall(LatinStructureDestroy(&data->structure));
  data->structure = structure;
  PetscFunctionReturn(0);
}

/*@C
  KSPLatinGetLatin - The decomposition behind a KSP of type latin.

  Not collective; the reference is borrowed

  Level: intermediate
@*/
PetscErrorCode KSPLatinGetLatin(KSP ksp, Latin *latin)
{
  PetscFunctionBegin;
  PetscCall(KSPLatinCheckType_Private(ksp));
  *latin = ((KSP_Latin *)ksp->data)->latin;
  PetscFunctionReturn(0);
}

/*@C
  KSPLatinGetOuter - The KSP that solves for the interface data, options prefix ksp_latin_outer_ behind that of ksp.

  Not collective; the reference is borrowed

  Level: advanced

  Note:
  After `KSPSetUp()` its operator is that of ksp/interfaceoperator.c, in variables whose Euclidean norm is the energy norm of the
  search direction.
@*/
PetscErrorCode KSPLatinGetOuter(KSP ksp, KSP *outer)
{
  PetscFunctionBegin;
  PetscCall(KSPLatinCheckType_Private(ksp));
  *outer = ((KSP_Latin *)ksp->data)->outer;
  PetscFunctionReturn(0);
}

/*MC
  KSPLATIN - the substructured LATIN iteration for symmetric positive definite matrices: to PC latin what `KSPFETIDP`
  is to `PCBDDC`

  Options Database Keys:
+ -ksp_latin_modes <affine,rigid,none>         - macro fields of the strong interfaces
. -ksp_latin_subdomains <n>                    - number of subdomains
. -ksp_latin_direction <schur>                 - micro search direction
. -ksp_latin_outer_ksp_type <gmres,richardson,minres> - accelerated, plain, or on the symmetric form
. -ksp_latin_outer_                            - prefix of that KSP
. -ksp_latin_local_                            - prefix of the KSP of the subdomains
- -ksp_latin_coarse_                           - prefix of the KSP of the coarse problem

  Level: intermediate

  Notes:
  An iteration is one linear stage: one solve of each subdomain and one coarse solve; there is no product with the
  matrix and no elimination of interiors. Two more stages begin and end a solve.

  The norm that monitors show and the convergence test sees is, with KSP_NORM_PRECONDITIONED (the default), that of the
  interface residual, the distance of two iterates in the energy norm of the search direction; with
  KSP_NORM_UNPRECONDITIONED that of b - A x, which costs one linear stage and one product more an iteration.

  The matrix is the tangent stiffness of a structure, or a `MATIS`. The PC of this KSP is none; `PCSetCoordinates()` on it
  says where the unknowns of a `MATIS` are.

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
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", KSPLatinSetCoordinates_Private));
  PetscCall(LatinCreate_Private(PetscObjectComm((PetscObject)ksp), &data->latin));
  data->latin->sub.tangent = PETSC_TRUE;
  PetscCall(KSPCreate(PetscObjectComm((PetscObject)ksp), &data->outer));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)data->outer, (PetscObject)ksp, 1));
  PetscCall(KSPSetType(data->outer, KSPGMRES));
  PetscCall(KSPGMRESSetRestart(data->outer, 100));                                                             /* interface vectors are short */
  PetscCall(KSPOrthogonalizationSetCGSRefinementType(data->outer, KSP_ORTHOGONALIZATION_CGS_REFINE_IFNEEDED)); /* or vectors of matrices whose coefficients jump are orthogonal no longer, and the residual stands still */
  PetscCall(KSPGetPC(data->outer, &pc));
  PetscCall(PCSetType(pc, PCNONE));
  PetscCall(KSPSetConvergenceTest(data->outer, KSPLatinConverged_Private, ksp, NULL));
  PetscFunctionReturn(0);
}
