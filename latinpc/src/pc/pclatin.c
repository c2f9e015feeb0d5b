#include "pc/pclatinimpl.h"

/*
   PC latin: one linear stage (42)-(52) from the zero state, as a symmetric positive definite preconditioner of the tangent stiffness of a structure, or of
   a MATIS. With B the solver of the interiors, W the weights and L the linear stage:

   1. Elimination of the interiors (static condensation): the residual (1 - K B) x is left, on interfaces.
   2. W L W^t: the same weights distribute residuals to the copies of nodes and average their displacements.
   3. Extension to the interiors in equilibrium: B + (1 - B K) W L W^t (1 - K B).

   This is balancing domain decomposition by constraints, with the springs of the LATIN search direction, which make the local problems regular if a
   subdomain has mechanisms of its own.
*/

/* Sets up the solvers of the interiors: operators with clamped interfaces, and so without springs and primal dofs. Collective on pc */
static PetscErrorCode PCLatinInterior_Private(PC pc)
{
  PC_Latin          *data     = (PC_Latin *)pc->data;
  Latin              latin    = data->latin;
  LatinLocalSolvers *interior = &data->interior;
  const PetscInt     bs = latin->sub.bs, n = bs * latin->sub.copies;
  PetscBool         *held;

  PetscFunctionBegin;
  PetscCall(LatinLocalSolversCreate(&latin->sub, &latin->batches, interior));
  interior->like      = &latin->solvers;
  interior->precision = LATIN_PRECISION_AUTO; /* valid for any accuracy of the interiors */
  PetscCall(PetscMalloc1(n, &held));
  for (PetscInt i = 0; i < n; i++) held[i] = (PetscBool)(latin->sub.fixed[i] || !PCLatinInner(latin, i / bs));
  for (PetscInt b = 0; b < interior->n; b++) {
    PetscBool done;

    PetscCall(LatinLocalSolversRenew_Private(interior, b, latin->linear.spring, held, &done));
    if (!done) PetscCall(LatinSparseCreate_Private(&latin->sub, latin->batches.batch[b].sub[0], latin->linear.spring, held, 0, NULL, &interior->rows[b]));
  }
  PetscCall(PetscFree(held));
  PetscCall(LatinLocalSolversSetUp(interior, "interior", PETSC_TRUE));
  PetscCall(LatinFactorAgree_Private(latin, &interior->status, interior->n ? &latin->batches.batch[interior->last] : NULL, "interior"));
  PetscFunctionReturn(0);
}

/* Frees the work arrays, whose lengths depend on the set-up */
static PetscErrorCode PCLatinClear_Private(PC_Latin *data)
{
  PetscFunctionBegin;
  PetscCall(VecDestroy(&data->work));
  PetscCall(VecDestroy(&data->range));
  PetscCall(MatNullSpaceDestroy(&data->kernel));
  PetscCall(PetscFree5(data->weight, data->v, data->f, data->force, data->side));
  data->built = PETSC_FALSE;
  PetscFunctionReturn(0);
}

static PetscErrorCode PCReset_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  if (data->latin && !data->shared) PetscCall(LatinReset_Private(data->latin));
  PetscCall(LatinLocalSolversDestroy(&data->interior));
  PetscCall(PCLatinClear_Private(data));
  data->renewed = 0;
  PetscFunctionReturn(0);
}

/*
   Sets data->stage: whether the linear stage alone is applied. If all interface nodes are primal, without springs, it is exact with direct solvers. If no
   node is inside a subdomain, as in coarse problems of substructures, there are no interiors to eliminate. Collective on pc
*/
static PetscErrorCode PCLatinStageIs_Private(PC_Latin *data)
{
  const Latin            latin = data->latin;
  const LatinInterfaces *inter = &latin->inter;
  PetscBool              is[2] = {(PetscBool)(data->shared || (!inter->sides && latin->solvers.direct)), PETSC_TRUE};

  PetscFunctionBegin;
  for (PetscInt i = 0; i < latin->sub.copies && !data->shared; i++) {
    if (PCLatinInner(latin, i)) is[1] = PETSC_FALSE;
    else if (inter->component[i] < 0) is[0] = PETSC_FALSE;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, is, 2, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)latin)));
  data->stage = (PetscBool)(is[0] || is[1]);
  if (!data->stage) PetscFunctionReturn(0);
  PetscCall(LatinLocalSolversDestroy(&data->interior));
  data->interior.direct = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Gets the kernel of a singular matrix, which has been checked. Collective on pc */
static PetscErrorCode PCLatinKernel_Private(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  if (!data->latin->sub.matrix || !data->latin->sub.known.kernels) PetscFunctionReturn(0);
  PetscCall(MatGetNullSpace(data->latin->sub.matrix, &data->kernel));
  PetscCall(PetscObjectReference((PetscObject)data->kernel));
  PetscCall(VecDuplicate(data->work, &data->range));
  PetscFunctionReturn(0);
}

/* Sets up decomposition, work arrays, weights and interiors. Collective on pc */
static PetscErrorCode PCLatinBuild_Private(PC pc)
{
  PC_Latin *data  = (PC_Latin *)pc->data;
  Latin     latin = data->latin;
  PetscInt  n;

  PetscFunctionBegin;
  if (data->shared && data->built) PetscFunctionReturn(0);
  latin->renews = (PetscBool)(data->built && !data->chosen);
  if (latin->renews) {
    PetscCall(LatinLocalSolversRetire(&data->interior));
    PetscCall(PCLatinClear_Private(data));
  } else PetscCall(PCReset_Latin(pc));
  if (!data->shared) { /* with exact interior solves the stage is needed on interface nodes only */
    PetscCall(LatinSetPrefix_Private(latin, (PetscObject)pc));
    PetscCall(LatinSolverIsDefault_Private((PetscObject)latin, "interior", &latin->linear.shared));
    PetscCall(LatinSetUpOperator_Private(latin, (PetscObject)pc, pc, pc->dm));
  }
  n = latin->sub.bs * latin->sub.copies;
  PetscCall(PetscMalloc5(n, &data->weight, n, &data->v, n, &data->f, n, &data->force, 2 * latin->inter.sides, &data->side));
  PetscCall(MatCreateVecs(pc->pmat, &data->work, NULL));
  PetscCall(PCLatinKernel_Private(pc));
  PetscCall(PCLatinWeights_Private(pc));
  PetscCall(PCLatinStageIs_Private(data));
  if (!data->stage) PetscCall(PCLatinInterior_Private(pc));
  data->built  = PETSC_TRUE;
  data->chosen = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Error handler that copies the first message of an error to ctx, PETSC_MAX_PATH_LEN characters */
static PetscErrorCode PCLatinHandler_Private(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode ierr, PetscErrorType type, const char *message, void *ctx)
{
  if (type == PETSC_ERROR_INITIAL && message) (void)PetscStrncpy((char *)ctx, message, PETSC_MAX_PATH_LEN);
  return ierr;
}

/*
   Sets up. A matrix that is not positive definite is an error on all ranks, which names the cause. New values of a MATIS, in steps of Newton's method and
   of a load, make it a failure of the PC, as of PETSc's factorisations: solvers around it may shorten the step. With data->yields it always is one: in
   Newton's method taut links of an iterate may be a mechanism. Collective on pc
*/
static PetscErrorCode PCSetUp_Latin(PC pc)
{
  PC_Latin           *data                        = (PC_Latin *)pc->data;
  const PetscObjectId before                      = data->renewed;
  char                message[PETSC_MAX_PATH_LEN] = "";
  PetscObjectId       matrix;
  PetscBool           yields;
  PetscErrorCode      ierr;

  PetscFunctionBegin;
  pc->failedreason = PC_NOERROR; /* PETSc 3.18 does not reset it */
  pc->setupcalled  = 0;          /* after an error the next PCSetUp() tries again */
  PetscCall(PetscObjectGetId((PetscObject)pc->pmat, &matrix));
  yields = (PetscBool)(data->yields || (matrix == before && data->latin->sub.matrix && !pc->erroriffailure));
  if (yields) PetscCall(PetscPushErrorHandler(PCLatinHandler_Private, message));
  ierr = PCLatinBuild_Private(pc);
  if (yields) PetscCall(PetscPopErrorHandler());
  if (ierr && (!yields || (ierr != PETSC_ERR_MAT_CH_ZRPVT && ierr != PETSC_ERR_CONV_FAILED))) {
    PetscCheck(!message[0], PETSC_COMM_SELF, ierr, "%s", message);
    PetscCall(ierr);
  }
  if (ierr) {
    PetscCall(PCReset_Latin(pc));
    PetscCall(PetscInfo(pc, "%s\n", message));
    pc->failedreason = PC_FACTOR_NUMERIC_ZEROPIVOT;
  }
  data->renewed = ierr ? before : matrix;
  PetscFunctionReturn(0);
}

/* Computes data->v = B f: displacements of the interiors, zero on interfaces. Overwrites linear.g. Not collective */
static PetscErrorCode PCLatinInteriorSolve_Private(PC pc, const PetscReal f[])
{
  PC_Latin              *data = (PC_Latin *)pc->data;
  const LatinSubdomains *sub  = &data->latin->sub;
  PetscReal             *g    = data->latin->linear.g; /* work array between linear stages */

  PetscFunctionBegin;
  for (PetscInt i = 0; i < sub->bs * sub->copies; i++) g[i] = PCLatinInner(data->latin, i / sub->bs) && !sub->fixed[i] ? f[i] : 0.0;
  PetscCall(LatinLocalSolveAll(&data->interior, g, data->v));
  if (data->interior.failed) data->latin->linear.failed = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Sets copy to infinity after a failed inner solve on this rank: the next norm of the Krylov method fails on all ranks, with the reason of the PC */
static void PCLatinFail(PC pc, PetscReal copy[])
{
  PC_Latin *data = (PC_Latin *)pc->data;

  if (!data->latin->linear.failed) return;
  for (PetscInt i = 0; i < data->latin->sub.bs * data->latin->sub.copies; i++) copy[i] = INFINITY;
  pc->failedreason = PC_SUBPC_ERROR;
}

/*
   Computes data->work = (1 - K B) x, the residual on interfaces with interiors in equilibrium, and data->force, x on the copies. Overwrites v, f.
   Collective on pc
*/
static PetscErrorCode PCLatinEliminate_Private(PC pc, Vec x)
{
  PC_Latin *data  = (PC_Latin *)pc->data;
  Latin     latin = data->latin;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(data->force, latin->sub.bs * latin->sub.copies));
  PetscCall(LatinDistribute_Private(&latin->sub, x, data->force));
  PetscCall(PCLatinInteriorSolve_Private(pc, data->force));
  PetscCall(LatinOperatorMult(&latin->sub, data->v, data->f));
  PetscCall(LatinSum_Private(&latin->sub, data->f, data->work));
  PetscCall(VecAYPX(data->work, -1.0, x));
  PetscFunctionReturn(0);
}

/* Computes u = W L W^t forces, the weighted mean of the displacements of a linear stage; u may be forces. Overwrites data->v, f. Collective on pc */
static PetscErrorCode PCLatinStage_Private(PC pc, Vec forces, Vec u)
{
  PC_Latin *data  = (PC_Latin *)pc->data;
  Latin     latin = data->latin;

  PetscFunctionBegin;
  PetscCall(LatinDistribute_Private(&latin->sub, forces, data->f));
  PetscCall(PCLatinWeigh_Private(pc, PETSC_TRUE, data->f, latin->linear.g));
  PetscCall(PetscArrayzero(data->v, latin->sub.bs * latin->sub.copies));
  latin->linear.corrected = data->corrected;
  PetscCall(LatinLinearApply(&latin->linear, data->v));
  latin->linear.corrected = PETSC_FALSE;
  PetscCall(PCLatinWeigh_Private(pc, PETSC_FALSE, data->v, data->f));
  if (data->stage) PCLatinFail(pc, data->f);
  PetscCall(LatinSum_Private(&latin->sub, data->f, u));
  PetscFunctionReturn(0);
}

/* Computes y: data->work on interfaces, interiors in equilibrium with it and the forces data->force. Overwrites data->v, f. Collective on pc */
static PetscErrorCode PCLatinExtend_Private(PC pc, Vec y)
{
  PC_Latin      *data  = (PC_Latin *)pc->data;
  Latin          latin = data->latin;
  const PetscInt bs = latin->sub.bs, n = bs * latin->sub.copies;

  PetscFunctionBegin;
  PetscCall(LatinDistribute_Private(&latin->sub, data->work, data->v));
  for (PetscInt i = 0; i < n; i++)
    if (PCLatinInner(latin, i / bs) && data->interior.direct) data->v[i] = 0.0;
  PetscCall(LatinOperatorMult(&latin->sub, data->v, data->f));
  for (PetscInt i = 0; i < n; i++) data->f[i] = data->force[i] - data->f[i];
  PetscCall(PCLatinInteriorSolve_Private(pc, data->f));
  PCLatinFail(pc, data->v);
  PetscCall(LatinSum_Private(&latin->sub, data->v, y));
  PetscCall(VecAXPY(y, 1.0, data->work));
  PetscFunctionReturn(0);
}

/*
   Applies B + (1 - B K) W L W^t (1 - K B), symmetric positive definite if B is, exact or approximate. With an exact B, values of W and L in the interiors
   cancel. With data->stage, applies W L W^t alone: exact if all interface dofs are in the coarse problem. In the operators of a SNES latin slack links
   are taut, so the elimination of the interiors is never exact: W L W^t takes a few more iterations of half the cost.

   Of a singular matrix, the kernel is removed before and after: the springs that hold it (subdomains/matis.c) would answer the part of a right-hand side
   in the kernel by displacements outside it. Collective on pc
*/
static PetscErrorCode PCApply_Latin(PC pc, Vec x, Vec y)
{
  PC_Latin *data  = (PC_Latin *)pc->data;
  Latin     latin = data->latin;

  PetscFunctionBegin;
  if (latin->stale && !data->shared) {
    PetscCall(PCSetUp_Latin(pc));
    pc->setupcalled = 1; /* as PCSetUp() does */
  }
  if (!data->built) { /* after a failed set-up */
    PetscCall(VecSet(y, INFINITY));
    PetscFunctionReturn(0);
  }
  latin->linear.failed = data->interior.failed = PETSC_FALSE;
  if (data->kernel) {
    PetscCall(VecCopy(x, data->range));
    PetscCall(MatNullSpaceRemove(data->kernel, data->range));
    x = data->range;
  }
  if (data->stage) PetscCall(PCLatinStage_Private(pc, x, y));
  else {
    PetscCall(PCLatinEliminate_Private(pc, x));
    PetscCall(PCLatinStage_Private(pc, data->work, data->work));
    PetscCall(PCLatinExtend_Private(pc, y));
  }
  PetscCall(LatinUnassigned_Private(&latin->sub, x, y));
  if (data->kernel) PetscCall(MatNullSpaceRemove(data->kernel, y));
  PetscFunctionReturn(0);
}

LatinWatched(PCSetUp_Latin, PC)

static PetscErrorCode PCApply_Latin_Watched(PC pc, Vec x, Vec y)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)pc), PCApply_Latin(pc, x, y));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCSetFromOptions_Latin(PC pc, LatinOptionItems PetscOptionsObject)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  if (!data->shared) PetscCall(LatinSetFromOptions_Private(data->latin, (PetscObject)pc));
  data->chosen = PETSC_TRUE;
  if (data->latin->stale) pc->setupcalled = 0; /* the next PCSetUp() builds it again */
  PetscFunctionReturn(0);
}

static PetscErrorCode PCView_Latin(PC pc, PetscViewer viewer)
{
  PetscFunctionBegin;
  PetscCall(LatinView_Private(((PC_Latin *)pc->data)->latin, viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCDestroy_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(PCReset_Latin(pc));
  PetscCall(LatinDestroy_Private(&data->latin));
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", NULL));
  PetscCall(PetscFree(pc->data));
  PetscFunctionReturn(0);
}

/*
   Copies the options of a SNES latin (subdomains, coarse space, search direction) to a PC latin with a decomposition of its own. On one rank this has one
   subdomain: with tangent stiffnesses, no subdomains are equal. Collective on pc
*/
PetscErrorCode PCLatinFollow_Private(PC pc, Latin latin)
{
  Latin       own = ((PC_Latin *)pc->data)->latin;
  PetscMPIInt ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)pc), &ranks));
  ((PC_Latin *)pc->data)->yields = PETSC_TRUE;
  PetscCall(LatinSetVariant(own, latin->variant));
  PetscCall(LatinSetModes(own, latin->macro.type, PETSC_DEFAULT));
  PetscCall(LatinSetDirection(own, latin->dir.type, 0.0));
  own->partition.whole = (PetscBool)(ranks == 1);
  PetscCall(LatinSetSubdomains(own, ranks == 1 ? 1 : latin->sub.count ? latin->sub.count : latin->partition.subdomains));
  PetscCall(LatinSetPartition(own, latin->partition.links, ranks == 1 ? NULL : latin->partition.given));
  PetscCall(LatinStructureAttachPC(latin->sub.structure, pc));
  PetscFunctionReturn(0);
}

/* Makes a PC latin share the decomposition of a SNES latin, in whose operators all links are taut. Collective on pc */
PetscErrorCode PCLatinShare_Private(PC pc, Latin latin)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(PetscObjectReference((PetscObject)latin));
  PetscCall(LatinDestroy_Private(&data->latin));
  data->latin  = latin;
  data->shared = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Sets whether coarse iterations may stop early, as the Krylov method corrects their error; conjugate gradients take no more iterations. Not collective */
PetscErrorCode PCLatinCorrected_Private(PC pc, PetscBool corrected)
{
  PetscFunctionBegin;
  ((PC_Latin *)pc->data)->corrected = corrected;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureAttachPC - Attaches a structure to a preconditioner whose matrix does not come from the DM of the structure.

  Collective on pc

  Input Parameters:
+ structure - set up
- pc        - of any type, on the communicator of the structure

  Level: intermediate

  Note:
  Call it before or after `PCSetType()` and `PCSetFromOptions()`. Types other than latin ignore it.

.seealso: `LatinStructureAttachKSP()`, `LatinStructureAttachSNES()`, `PCShellSetLatin()`
@*/
PetscErrorCode LatinStructureAttachPC(LatinStructure structure, PC pc)
{
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 2);
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  PetscCall(LatinAttach_Private(is ? ((PC_Latin *)pc->data)->latin : NULL, (PetscObject)pc, structure));
  if (is && ((PC_Latin *)pc->data)->latin->stale) pc->setupcalled = 0; /* the next PCSetUp() builds it again */
  PetscFunctionReturn(0);
}

/*@C
  PCLatinGetLatin - Gets the decomposition of a preconditioner of type latin.

  Not collective; the reference is borrowed

  Input Parameter:
. pc - of type latin

  Output Parameter:
. latin - the decomposition

  Level: intermediate

.seealso: `SNESLatinGetLatin()`, `KSPLatinGetLatin()`
@*/
PetscErrorCode PCLatinGetLatin(PC pc, Latin *latin)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 1);
  PetscCall(LatinCheckType_Private((PetscObject)pc));
  PetscAssertPointer(latin, 2);
  *latin = ((PC_Latin *)pc->data)->latin;
  PetscFunctionReturn(0);
}

/*MC
  PCLATIN - One linear stage of the LATIN method: a symmetric positive definite preconditioner for CG, of structures of links and of
  any `MATIS`

  Options Database Keys:
+ -pc_latin_variant <corner>    - interface unknowns of the coarse problem: none, macro, corner, published, primal (a direct solver), auto
. -pc_latin_modes <affine>      - macro fields of strong interfaces: affine, rigid
. -pc_latin_modes_local <-2>    - local low-energy fields in the coarse space, eigenvalues below this; 0: none, -2: automatic
. -pc_latin_subdomains <0>      - number of subdomains, of a MATIS of those joined from its pieces; 0: automatic
. -pc_latin_partitioner <auto>  - metis on one rank, parallel on all, or auto; not of a MATIS
. -pc_latin_direction <auto>    - springs that keep the local problems regular: scalar, diagonal, block, schur, auto
. -pc_latin_local_              - prefix of the KSP of the subdomains
. -pc_latin_interior_           - prefix of the KSP of their interiors
- -pc_latin_coarse_             - prefix of the KSP of the coarse problem, for example -pc_latin_coarse_pc_type latin

  Level: beginner

  Notes:
  The matrix is the tangent stiffness of a structure (`LatinStructureAttachPC()`, or the DM of the structure), or a `MATIS`, symmetric,
  with positive semidefinite local matrices. The local matrix of a rank is one subdomain, or with `MatISSetAllowRepeated()` several.
  `PCSetCoordinates()`, a DM with coordinates, the block size and `MatSetNearNullSpace()` add to the macro fields. A singular matrix
  needs `MatSetNullSpace()`. An assembled matrix has no matrices of subdomains: it is an error.

  With approximate solvers of the interiors and of the coarse problem, applied once, the preconditioner is linear, symmetric and
  positive definite if they are. With inner iterations that stop early it is not linear: use a flexible method such as `KSPFCG` or
  `KSPFGMRES`. Solves of the subdomains are accurate.

  A matrix that is not positive definite is an error. New values of the same `MATIS` that are not are a failure of the
  preconditioner, `KSP_DIVERGED_PC_FAILED`, unless `KSPSetErrorIfNotConverged()` asks for an error.

.seealso: `SNESLATIN`, `LatinStructureAttachPC()`, `PCShellSetLatin()`
M*/
PETSC_EXTERN PetscErrorCode PCCreate_Latin(PC pc)
{
  PC_Latin *data;

  PetscFunctionBegin;
  PetscCall(PetscNew(&data));
  pc->data                = (void *)data;
  pc->ops->setup          = PCSetUp_Latin_Watched;
  pc->ops->apply          = PCApply_Latin_Watched;
  pc->ops->applytranspose = PCApply_Latin_Watched;
  pc->ops->reset          = PCReset_Latin;
  pc->ops->destroy        = PCDestroy_Latin;
  pc->ops->setfromoptions = PCSetFromOptions_Latin;
  pc->ops->view           = PCView_Latin;
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", LatinSetCoordinates_Private));
  PetscCall(LatinCreate_Private(PetscObjectComm((PetscObject)pc), &data->latin));
  data->latin->sub.tangent       = PETSC_TRUE;
  data->latin->sub.preconditions = PETSC_TRUE;
  data->latin->dir.type          = LATIN_DIRECTION_AUTO;
  PetscFunctionReturn(0);
}
