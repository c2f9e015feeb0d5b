#include "pc/pclatinimpl.h"

/*
   PC latin: one linear stage from the zero state as a symmetric positive definite preconditioner, for the structure's
   tangent stiffness matrix, or for a MATIS. Residuals go to the subdomains, and displacements come back, with the same weights; the
   interiors of the subdomains are eliminated exactly before and after, so that only interface errors remain. The form
   is that of balancing domain decomposition by constraints; the springs of the LATIN search direction make the local
   problems regular where a subdomain has mechanisms of its own.
*/

/* The rows and columns of K_E at inner nodes; springs and primal dofs are on interfaces only, so they play no part */
static PetscErrorCode PCLatinInterior_Private(PC pc)
{
  PC_Latin          *data  = (PC_Latin *)pc->data;
  Latin              latin = data->latin;
  LatinLocalSolvers *whole = &latin->solvers, *interior = &data->interior;
  const PetscInt     bs = latin->sub.bs;

  PetscFunctionBegin;
  PetscCall(LatinLocalSolversCreate(&latin->sub, &latin->batches, interior));
  if (latin->interior) interior->n = 0; /* eliminated already */
  for (PetscInt i = 0; i < interior->n; i++) {
    const LatinBatch *batch = &latin->batches.batch[i];
    const PetscInt    n     = batch->row[batch->patterns];
    PetscInt          nz    = 0;

    PetscCall(PetscMalloc1(n + 1, &interior->ci[i]));
    PetscCall(PetscMalloc1(whole->ci[i][n], &interior->cj[i]));
    PetscCall(PetscMalloc1(whole->ci[i][n], &interior->ca[i]));
    for (PetscInt p = 0; p < batch->patterns; p++) {
      const PetscInt shift = bs * latin->sub.node_offset[batch->sub[p]] - batch->row[p];

      for (PetscInt row = batch->row[p]; row < batch->row[p + 1]; row++) {
        interior->ci[i][row] = nz;
        if (!data->inner[(row + shift) / bs]) {
          interior->cj[i][nz]   = row;
          interior->ca[i][nz++] = 1.0;
          continue;
        }
        for (PetscInt k = whole->ci[i][row]; k < whole->ci[i][row + 1]; k++) {
          if (!data->inner[(whole->cj[i][k] + shift) / bs]) continue;
          interior->cj[i][nz]   = whole->cj[i][k];
          interior->ca[i][nz++] = whole->ca[i][k];
        }
      }
    }
    interior->ci[i][n] = nz;
  }
  PetscCall(LatinLocalSolversSetUp(interior, "interior", latin->inter.primal_index));
  PetscCall(LatinFactorAgree_Private(latin, &interior->status, interior->n ? &latin->batches.batch[interior->last] : NULL, "interior"));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCReset_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  if (data->latin && !data->shared) PetscCall(LatinReset_Private(data->latin));
  PetscCall(LatinLocalSolversDestroy(&data->interior));
  PetscCall(VecDestroy(&data->work));
  PetscCall(PetscFree(data->inner));
  PetscCall(PetscFree5(data->weight, data->b, data->v, data->f, data->force));
  PetscCall(PetscFree(data->side));
  data->built = PETSC_FALSE;
  PetscFunctionReturn(0);
}

static PetscErrorCode PCLatinSetUpLatin_Private(PC pc)
{
  PC_Latin      *data = (PC_Latin *)pc->data;
  LatinStructure structure;
  DM             dm = pc->dm;

  PetscFunctionBegin;
  PetscCall(LatinFindStructure_Private((PetscObject)pc, "pc", data->structure, pc->dm, pc->pmat, &structure));
  PetscCall(PCReset_Latin(pc));
  if (structure) {
    PetscCall(LatinSetStructure_Private(data->latin, structure));
    PetscCall(LatinSetTangent_Private(data->latin, pc->pmat));
  } else {
    PetscCall(LatinSetMatrix_Private(data->latin, pc->pmat));
    if (!dm) PetscCall(MatGetDM(pc->pmat, &dm));
    PetscCall(LatinUnknownsSetUp_Private(pc->pmat, dm, data->dim, data->nodes, data->x, &data->latin->sub.known));
  }
  PetscCall(LatinSetPrefix_Private(data->latin, (PetscObject)pc));
  data->latin->dir.share = PCLatinSchurWeights(data->latin);
  PetscCall(LatinSetUp_Private(data->latin));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCSetUp_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;
  PetscInt  n;

  PetscFunctionBegin;
  if (data->shared && data->built) PetscFunctionReturn(0);
  if (data->shared) PetscCall(PCReset_Latin(pc));
  else PetscCall(PCLatinSetUpLatin_Private(pc));
  n = data->latin->sub.bs * data->latin->sub.copies;
  PetscCall(PetscMalloc5(n, &data->weight, n, &data->b, n, &data->v, n, &data->f, n, &data->force));
  PetscCall(PetscMalloc1(data->latin->sub.copies, &data->inner));
  PetscCall(PetscMalloc1(3 * data->latin->inter.sides, &data->side));
  if (data->latin->sub.structure) PetscCall(VecDuplicate(data->latin->sub.structure->load, &data->work));
  else PetscCall(MatCreateVecs(pc->pmat, &data->work, NULL));
  PetscCall(PCLatinWeights_Private(pc));
  if (!data->shared) PetscCall(PCLatinInterior_Private(pc));
  data->inexact.asymmetry = PetscMax(data->interior.inexact.asymmetry, PetscMax(data->latin->solvers.inexact.asymmetry, data->latin->coarse.inexact.asymmetry));
  data->inexact.variation = PetscMax(data->interior.inexact.variation, PetscMax(data->latin->solvers.inexact.variation, data->latin->coarse.inexact.variation));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &data->inexact, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)pc)));
  data->built = PETSC_TRUE;
  PetscFunctionReturn(0);
}

static PetscErrorCode PCPreSolve_Latin(PC pc, KSP ksp, Vec b, Vec x)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(LatinInexactCheck_Private(LatinPrefix(&data->latin->sub), ksp, &data->inexact));
  PetscFunctionReturn(0);
}

/* v = interior solution for the forces f at inner nodes; zero at the others */
static PetscErrorCode PCLatinInteriorSolve_Private(PC pc, const PetscReal f[])
{
  PC_Latin      *data = (PC_Latin *)pc->data;
  const PetscInt bs = data->latin->sub.bs, n = bs * data->latin->sub.copies;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < n; i++) data->b[i] = data->inner[i / bs] && !data->latin->sub.fixed[i] ? f[i] : 0.0;
  PetscCall(LatinLocalSolveAll(&data->interior, data->b, data->v));
  if (data->interior.failed) data->latin->linear.failed = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* What an inner solver that has failed on this rank leaves is no number: the next norm of a Krylov method shows it to all ranks, and its reason names the preconditioner */
static void PCLatinFail(PC pc, PetscReal copy[])
{
  PC_Latin *data = (PC_Latin *)pc->data;

  if (!data->latin->linear.failed) return;
  for (PetscInt i = 0; i < data->latin->sub.bs * data->latin->sub.copies; i++) copy[i] = INFINITY;
  pc->failedreason = PC_SUBPC_ERROR;
}

/*
   With the operators of a SNES latin, on which slack links are taut, no elimination of the interiors is exact: the
   linear stage alone, weighted before and after, takes a few more iterations of half the cost.
*/
static PetscErrorCode PCApply_Latin_Shared(PC pc, Vec x, Vec y)
{
  PC_Latin      *data  = (PC_Latin *)pc->data;
  Latin          latin = data->latin;
  const PetscInt n     = latin->sub.bs * latin->sub.copies;

  PetscFunctionBegin;
  latin->linear.failed = data->interior.failed = PETSC_FALSE;
  PetscCall(PetscArrayzero(data->f, n));
  PetscCall(LatinDistribute_Private(&latin->sub, x, data->f));
  for (PetscInt i = 0; i < n; i++) latin->linear.g[i] = data->weight[i] * data->f[i];
  PetscCall(PetscArrayzero(data->v, n));
  PetscCall(LatinLinearApply(&latin->linear, data->v));
  for (PetscInt i = 0; i < n; i++) data->v[i] = data->weight[i] * data->v[i];
  PCLatinFail(pc, data->v);
  PetscCall(PCLatinSum_Private(latin, data->v, y));
  PetscFunctionReturn(0);
}

/*
   With B the solver of the interiors, W the weights and L the linear stage: B + (1 - B K) W L W^t (1 - K B), which is
   symmetric positive definite if B is, approximate or not. Where B is exact what W and L make of the interiors cancels.
*/
static PetscErrorCode PCApply_Latin(PC pc, Vec x, Vec y)
{
  PC_Latin *data  = (PC_Latin *)pc->data;
  Latin     latin = data->latin;
  PetscInt  bs, n;

  PetscFunctionBegin;
  if (latin->stale) PetscCall(PCSetUp_Latin(pc));
  bs                   = latin->sub.bs;
  n                    = bs * latin->sub.copies;
  latin->linear.failed = data->interior.failed = PETSC_FALSE;
  /* forces left on the interfaces once the interiors are in equilibrium */
  PetscCall(PetscArrayzero(data->force, n));
  PetscCall(LatinDistribute_Private(&latin->sub, x, data->force));
  if (latin->interior) PetscCall(LatinInteriorForces(latin->interior, &latin->sub, x, data->f, &latin->linear.failed));
  else {
    PetscCall(PCLatinInteriorSolve_Private(pc, data->force));
    PetscCall(LatinOperatorMult(&latin->sub, data->v, data->f));
  }
  PetscCall(PCLatinSum_Private(latin, data->f, data->work));
  PetscCall(VecAYPX(data->work, -1.0, x));
  /* linear stage for the weighted forces, weighted mean of its displacements */
  PetscCall(LatinDistribute_Private(&latin->sub, data->work, data->f));
  PetscCall(PCLatinWeigh_Private(pc, PETSC_TRUE, data->f, latin->linear.g));
  PetscCall(PetscArrayzero(data->v, n));
  PetscCall(LatinLinearApply(&latin->linear, data->v));
  PetscCall(PCLatinWeigh_Private(pc, PETSC_FALSE, data->v, data->f));
  PetscCall(PCLatinSum_Private(latin, data->f, data->work));
  /* interiors in equilibrium with the given forces and these displacements */
  PetscCall(LatinDistribute_Private(&latin->sub, data->work, data->v));
  if (latin->interior) {
    PetscCall(LatinInteriorExtend(latin->interior, data->v, data->work, &latin->linear.failed));
    PetscCall(PetscArrayzero(data->v, n));
  } else {
    for (PetscInt i = 0; i < n; i++)
      if (data->inner[i / bs] && data->interior.direct) data->v[i] = 0.0;
    PetscCall(LatinOperatorMult(&latin->sub, data->v, data->f));
    for (PetscInt i = 0; i < n; i++) data->f[i] = data->force[i] - data->f[i];
    PetscCall(PCLatinInteriorSolve_Private(pc, data->f));
  }
  PCLatinFail(pc, data->v);
  PetscCall(PCLatinSum_Private(latin, data->v, y));
  PetscCall(VecAXPY(y, 1.0, data->work));
  PetscCall(LatinUnassigned_Private(&latin->sub, x, y));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCSetUp_Latin_Watched(PC pc)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)pc), PCSetUp_Latin(pc));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCApply_Latin_Watched(PC pc, Vec x, Vec y)
{
  PetscFunctionBegin;
  LatinWatch(PetscObjectComm((PetscObject)pc), PCApply_Latin(pc, x, y));
  PetscFunctionReturn(0);
}

PetscErrorCode PCSetFromOptions_Latin(PC pc, LatinOptionItems PetscOptionsObject)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  if (!data->shared) PetscCall(LatinSetFromOptions_Private(data->latin, (PetscObject)pc));
  if (data->latin->stale) pc->setupcalled = 0; /* built again at the next PCSetUp() */
  PetscFunctionReturn(0);
}

static PetscErrorCode PCView_Latin(PC pc, PetscViewer viewer)
{
  PC_Latin *data = (PC_Latin *)pc->data;
  PetscBool ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "weights of the copies of a node: %s\n", data->latin->dir.share ? "Schur complements where there are, else stiffness" : "stiffness"));
  if (data->latin->set_up && data->latin->sub.matrix) PetscCall(PetscViewerASCIIPrintf(viewer, "insides of subdomains: %s\n", data->latin->interior ? "eliminated first on this rank" : "part of the subdomains on this rank"));
  PetscCall(LatinView_Private(data->latin, viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCDestroy_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(PCReset_Latin(pc));
  PetscCall(LatinDestroy_Private(&data->latin));
  PetscCall(LatinStructureDestroy(&data->structure));
  PetscCall(PetscFree(data->x));
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", NULL));
  PetscCall(PetscFree(pc->data));
  PetscFunctionReturn(0);
}

/* Coordinates of the nodes of a matrix that comes without a structure */
static PetscErrorCode PCSetCoordinates_Latin(PC pc, PetscInt dim, PetscInt nodes, PetscReal x[])
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCheck(dim >= 1 && dim <= 3, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_OUTOFRANGE, "Nodes have 1, 2 or 3 coordinates, not %" PetscInt_FMT, dim);
  PetscCall(PetscFree(data->x));
  PetscCall(PetscMalloc1(dim * nodes, &data->x));
  PetscCall(PetscArraycpy(data->x, x, dim * nodes));
  data->dim       = dim;
  data->nodes     = nodes;
  pc->setupcalled = 0;
  PetscFunctionReturn(0);
}

/* Gives a PC latin of its own the choices of a SNES latin: subdomains, coarse space, search direction. Collective on pc */
PetscErrorCode PCLatinFollow_Private(PC pc, Latin latin)
{
  Latin own = ((PC_Latin *)pc->data)->latin;

  PetscFunctionBegin;
  PetscCall(LatinSetVariant(own, latin->inter.variant));
  PetscCall(LatinSetModes(own, latin->macro.type, PETSC_DEFAULT));
  PetscCall(LatinSetDirection(own, latin->dir.type, 0.0));
  PetscCall(LatinSetSubdomains(own, latin->sub.count ? latin->sub.count : latin->partition.subdomains));
  PetscCall(LatinSetPartition(own, latin->partition.links, latin->partition.given));
  PetscCall(LatinSetStructure_Private(own, latin->sub.structure));
  PetscCall(LatinStructureAttachPC(latin->sub.structure, pc));
  PetscFunctionReturn(0);
}

/* Makes a PC latin of the decomposition of a SNES latin, whose operators have all links taut. Collective on pc */
PetscErrorCode PCLatinShare_Private(PC pc, Latin latin)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(PetscObjectReference((PetscObject)latin));
  PetscCall(LatinDestroy_Private(&data->latin));
  data->latin             = latin;
  data->shared            = PETSC_TRUE;
  pc->ops->apply          = PCApply_Latin_Shared;
  pc->ops->applytranspose = PCApply_Latin_Shared;
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureAttachPC - Gives the structure to a preconditioner of type latin.

  Collective on pc

  Level: intermediate

  Note:
  Not needed when the matrix comes from the DM of the structure.
@*/
PetscErrorCode LatinStructureAttachPC(LatinStructure structure, PC pc)
{
  PC_Latin *data;
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 1);
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_WRONG, "The PC is not of type latin: call PCSetType(pc, PCLATIN) first");
  data = (PC_Latin *)pc->data;
  if (structure != data->structure) pc->setupcalled = 0; /* built again at the next PCSetUp() */
  PetscCall(LatinStructureReference(structure));
  PetscCall(LatinStructureDestroy(&data->structure));
  data->structure = structure;
  PetscFunctionReturn(0);
}

/*@C
  PCLatinGetLatin - The decomposition behind a preconditioner of type latin.

  Not collective; the reference is borrowed

  Level: intermediate
@*/
PetscErrorCode PCLatinGetLatin(PC pc, Latin *latin)
{
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 1);
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_WRONG, "The PC is not of type latin");
  *latin = ((PC_Latin *)pc->data)->latin;
  PetscFunctionReturn(0);
}

/*MC
  PCLATIN - one linear stage of the LATIN method as a symmetric positive definite preconditioner for CG

  Options Database Keys:
+ -pc_latin_variant <none,macro,corner,published> - coarse treatment of weak interfaces
. -pc_latin_modes_local <0>                    - local low-energy fields of low-energy subdomains, eigenvalues below this
. -pc_latin_subdomains <n>                     - number of subdomains
. -pc_latin_direction <auto>                   - springs that keep the local problems regular
. -pc_latin_local_, -pc_latin_interior_        - prefixes of the KSPs of the subdomains
- -pc_latin_coarse_                            - prefix of the KSP of the coarse problem, for example -pc_latin_coarse_pc_type latin

  Level: beginner

  Note:
  Approximate solvers that are applied once leave it linear, symmetric and positive definite if they are so; inner
  iterations do not, and need a flexible method such as `KSPFCG` or `KSPFGMRES`.

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
  pc->ops->presolve       = PCPreSolve_Latin;
  pc->ops->reset          = PCReset_Latin;
  pc->ops->destroy        = PCDestroy_Latin;
  pc->ops->setfromoptions = PCSetFromOptions_Latin;
  pc->ops->view           = PCView_Latin;
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", PCSetCoordinates_Latin));
  PetscCall(LatinCreate_Private(PetscObjectComm((PetscObject)pc), &data->latin));
  data->latin->sub.tangent       = PETSC_TRUE;
  data->latin->sub.preconditions = PETSC_TRUE;
  data->latin->dir.type          = LATIN_DIRECTION_AUTO;
  PetscFunctionReturn(0);
}
