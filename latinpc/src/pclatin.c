#include "latinimpl.h"
#include <petsc/private/pcimpl.h>

/*
   PC latin: one linear stage from the zero state as a symmetric positive definite preconditioner, for the structure's
   tangent stiffness matrix, or for a MATIS. Residuals go to the subdomains, and displacements come back, with the same weights; the
   interiors of the subdomains are eliminated exactly before and after, so that only interface errors remain. The form
   is that of balancing domain decomposition by constraints; the springs of the LATIN search direction make the local
   problems regular where a subdomain has mechanisms of its own.
*/

typedef enum { WEIGHTS_STIFFNESS, WEIGHTS_MULTIPLICITY, WEIGHTS_SCHUR } LatinWeightsType;
static const char *const LatinWeightsTypes[] = {"stiffness", "multiplicity", "schur", "LatinWeightsType", "WEIGHTS_", NULL};

typedef struct {
  Latin            latin;
  LatinLinks       links;  /* given by PCLatinSetLinks(), or NULL */
  PetscBool        shared; /* latin is that of a SNES latin, which builds it and has the options */
  LatinWeightsType weights;
  PetscBool        weights_given; /* by an option, not by default */
  PetscReal       *weight;        /* [copies * bs] partition of unity */
  PetscReal       *side;          /* [3 * sides] work */
  PetscBool       *inner;         /* [copies] the node belongs to one subdomain */
  PetscBool        built;         /* these are there, though a rank without subdomains has none */
  PetscInt         dim, nodes;    /* coordinates given by PCSetCoordinates(), dim 0: none */
  PetscReal       *x;
  LatinInexact     inexact;           /* of the inner solvers, on all ranks */
  LatinBlockSolver interior;          /* stiffness of the interiors, identity elsewhere */
  PetscReal       *b, *v, *f, *force; /* [copies * bs] work */
  Vec              work;              /* DM global vector */
} PC_Latin;

/* Adds the copies' values up in a DM global vector */
static PetscErrorCode PCLatinSum_Private(Latin latin, const PetscReal copy[], Vec u)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecZeroEntries(u));
  PetscCall(VecGetArray(u, &a));
  PetscCall(LatinSFReduce_Private(latin->sub.dof_sf, 1, MPIU_SCALAR, copy, a, MPI_SUM));
  PetscCall(VecRestoreArray(u, &a));
  PetscFunctionReturn(0);
}

/* The part of each copy in its node: equal parts, or in proportion to the stiffness (diagonal of its operator); weights from Schur complements are so of corners, and of interfaces whose search direction is diagonal */
static PetscErrorCode PCLatinWeights_Private(PC pc)
{
  PC_Latin          *data  = (PC_Latin *)pc->data;
  Latin              latin = data->latin;
  LatinSubstructure *sub   = &latin->sub;
  const PetscInt     bs    = latin->sub.bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) data->b[i] = 1.0;
  if (data->weights != WEIGHTS_MULTIPLICITY) {
    PetscReal largest = 0.0;

    PetscCall(LatinOperatorDiagonal(latin, data->b));
    for (PetscInt i = 0; i < bs * sub->copies; i++) largest = PetscMax(largest, data->b[i]);
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &largest, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)pc)));
    /* a copy without stiffness keeps a part of its node, or nobody would move it where no copy has any */
    for (PetscInt i = 0; i < bs * sub->copies; i++) data->b[i] += LatinByPrecision(1e-12, 1e-5) * (largest > 0.0 ? largest : 1.0);
  }
  PetscCall(PCLatinSum_Private(latin, data->b, data->work));
  PetscCall(PetscArrayzero(data->f, bs * sub->copies));
  PetscCall(LatinDistribute_Private(latin, data->work, data->f));
  for (PetscInt i = 0; i < bs * sub->copies; i++) data->weight[i] = sub->fixed[i] ? 0.0 : data->b[i] / data->f[i];
  for (PetscInt i = 0; i < sub->copies; i++) data->inner[i] = (PetscBool)(latin->inter.share_offset[i] == latin->inter.share_offset[i + 1]);
  PetscFunctionReturn(0);
}

/* The rows and columns of K_E at inner nodes; springs and primal dofs are on interfaces only, so they play no part */
static PetscErrorCode PCLatinInterior_Private(PC pc)
{
  PC_Latin         *data  = (PC_Latin *)pc->data;
  Latin             latin = data->latin;
  LatinBlockSolver *whole = &latin->linear.solver, *interior = &data->interior;
  const PetscInt    bs = latin->sub.bs;

  PetscFunctionBegin;
  PetscCall(LatinBlockSolverCreate(latin, interior));
  if (latin->interior) interior->n = 0; /* eliminated already */
  for (PetscInt i = 0; i < interior->n; i++) {
    const LatinBatch *batch = &latin->linear.blocks.batch[i];
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
  PetscCall(LatinBlockSolverSetUp(latin, interior, "interior"));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCReset_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  if (data->latin && !data->shared) PetscCall(LatinReset_Private(data->latin));
  PetscCall(LatinBlockSolverDestroy(&data->interior));
  PetscCall(VecDestroy(&data->work));
  PetscCall(PetscFree(data->inner));
  PetscCall(PetscFree5(data->weight, data->b, data->v, data->f, data->force));
  PetscCall(PetscFree(data->side));
  data->built = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Weights from the Schur complements want one interface a side dof, and a direction that has both sides' complements */
static PetscErrorCode PCLatinShares_Private(PC pc)
{
  PC_Latin       *data  = (PC_Latin *)pc->data;
  Latin           latin = data->latin;
  const PetscBool schur = (PetscBool)(latin->direction_scalar == 0.0 && (latin->direction == LATIN_DIRECTION_SCHUR || latin->direction == LATIN_DIRECTION_AUTO));
  const PetscBool fit   = (PetscBool)(latin->variant == LATIN_VARIANT_CORNER && latin->promote && !latin->published && schur);
  const char     *prefix;

  PetscFunctionBegin;
  PetscCall(PCGetOptionsPrefix(pc, &prefix));
  prefix = prefix ? prefix : "";
  if (!data->weights_given) data->weights = latin->matrix && fit ? WEIGHTS_SCHUR : WEIGHTS_STIFFNESS;
  PetscCheck(data->weights != WEIGHTS_SCHUR || fit, PetscObjectComm((PetscObject)pc), PETSC_ERR_SUP,
             "-%spc_latin_weights schur wants variant corner, promoted corners without springs, and -%spc_latin_direction schur: leave those options alone, or choose weights stiffness", prefix, prefix);
  latin->share = (PetscBool)(data->weights == WEIGHTS_SCHUR);
  PetscFunctionReturn(0);
}

static PetscErrorCode PCLatinSetUpLatin_Private(PC pc)
{
  PC_Latin   *data = (PC_Latin *)pc->data;
  LatinLinks  links;
  const char *prefix;
  DM          dm = pc->dm;

  PetscFunctionBegin;
  PetscCall(LatinFindLinks_Private((PetscObject)pc, "pc", data->links, pc->dm, pc->pmat, &links));
  PetscCall(PCReset_Latin(pc));
  if (links) PetscCall(LatinSetLinks_Private(data->latin, links));
  else {
    PetscCall(LatinSetMatrix_Private(data->latin, pc->pmat));
    if (!dm) PetscCall(MatGetDM(pc->pmat, &dm));
    PetscCall(LatinUnknownsSetUp_Private(pc->pmat, dm, data->dim, data->nodes, data->x, &data->latin->known));
  }
  PetscCall(PCGetOptionsPrefix(pc, &prefix));
  PetscCall(PetscObjectSetOptionsPrefix((PetscObject)data->latin, prefix));
  PetscCall(PetscObjectAppendOptionsPrefix((PetscObject)data->latin, "pc_latin_"));
  PetscCall(PCLatinShares_Private(pc));
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
  if (data->latin->links) PetscCall(VecDuplicate(data->latin->links->load, &data->work));
  else PetscCall(MatCreateVecs(pc->pmat, &data->work, NULL));
  PetscCall(PCLatinWeights_Private(pc));
  if (!data->shared) PetscCall(PCLatinInterior_Private(pc));
  data->inexact = data->latin->inexact;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &data->inexact, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)pc)));
  data->built = PETSC_TRUE;
  PetscFunctionReturn(0);
}

static PetscErrorCode PCPreSolve_Latin(PC pc, KSP ksp, Vec b, Vec x)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(LatinInexactCheck_Private(data->latin, ksp, &data->inexact));
  PetscFunctionReturn(0);
}

/* v = interior solution for the forces f at inner nodes; zero at the others */
static PetscErrorCode PCLatinInteriorSolve_Private(PC pc, const PetscReal f[])
{
  PC_Latin      *data = (PC_Latin *)pc->data;
  const PetscInt bs = data->latin->sub.bs, n = bs * data->latin->sub.copies;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < n; i++) data->b[i] = data->inner[i / bs] && !data->latin->sub.fixed[i] ? f[i] : 0.0;
  PetscCall(LatinBlockSolve(data->latin, &data->interior, data->b, data->v));
  PetscFunctionReturn(0);
}

/* What an inner solver that has failed on this rank leaves is no number: the next norm of a Krylov method tells all ranks, and its reason names the preconditioner */
static void PCLatinFail(PC pc, PetscReal copy[])
{
  PC_Latin *data = (PC_Latin *)pc->data;

  if (!data->latin->failed) return;
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
  latin->failed = PETSC_FALSE;
  PetscCall(PetscArrayzero(data->f, n));
  PetscCall(LatinDistribute_Private(latin, x, data->f));
  for (PetscInt i = 0; i < n; i++) latin->linear.g[i] = data->weight[i] * data->f[i];
  PetscCall(PetscArrayzero(data->v, n));
  PetscCall(LatinLinearApply(latin, data->v));
  for (PetscInt i = 0; i < n; i++) data->v[i] = data->weight[i] * data->v[i];
  PCLatinFail(pc, data->v);
  PetscCall(PCLatinSum_Private(latin, data->v, y));
  PetscFunctionReturn(0);
}

/* Each copy's part of forces, or of displacements; inside subdomains the whole, or nothing where the interiors are solved exactly */
static PetscErrorCode PCLatinWeigh_Private(PC pc, PetscBool forces, const PetscReal whole[], PetscReal part[])
{
  PC_Latin        *data  = (PC_Latin *)pc->data;
  Latin            latin = data->latin;
  LatinInterfaces *inter = &latin->inter;
  const PetscInt   bs    = latin->sub.bs;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * latin->sub.copies; i++) part[i] = (data->inner[i / bs] && data->interior.direct) || latin->sub.fixed[i] ? 0.0 : data->weight[i] * whole[i];
  for (PetscInt f = 0; f < inter->count && data->weights == WEIGHTS_SCHUR; f++) {
    const LatinInterface *face = &inter->interface[f];

    if (face->matrix_first < 0) continue;
    for (PetscInt k = face->side_first; k < face->side_last; k++) data->side[k - face->side_first] = whole[inter->side_dof[k]];
    PetscCall(LatinDirectionShare(latin, f, forces, data->side, data->side + inter->sides));
    for (PetscInt k = face->side_first; k < face->side_last; k++) part[inter->side_dof[k]] = data->side[k - face->side_first];
  }
  PetscFunctionReturn(0);
}

/*
   With B the solver of the interiors, W the weights and L the linear stage: B + (1 - B K) W L W^t (1 - K B), which is
   symmetric positive definite if B is, approximate or not. Where B is exact what W and L make of the interiors cancels.
*/
static PetscErrorCode PCApply_Latin(PC pc, Vec x, Vec y)
{
  PC_Latin      *data  = (PC_Latin *)pc->data;
  Latin          latin = data->latin;
  const PetscInt bs = latin->sub.bs, n = bs * latin->sub.copies;

  PetscFunctionBegin;
  latin->failed = PETSC_FALSE;
  /* forces left on the interfaces once the interiors are in equilibrium */
  PetscCall(PetscArrayzero(data->force, n));
  PetscCall(LatinDistribute_Private(latin, x, data->force));
  if (latin->interior) PetscCall(LatinInteriorForces(latin, x, data->f));
  else {
    PetscCall(PCLatinInteriorSolve_Private(pc, data->force));
    PetscCall(LatinOperatorMult(latin, data->v, data->f));
  }
  PetscCall(PCLatinSum_Private(latin, data->f, data->work));
  PetscCall(VecAYPX(data->work, -1.0, x));
  /* linear stage for the weighted forces, weighted mean of its displacements */
  PetscCall(LatinDistribute_Private(latin, data->work, data->f));
  PetscCall(PCLatinWeigh_Private(pc, PETSC_TRUE, data->f, latin->linear.g));
  PetscCall(PetscArrayzero(data->v, n));
  PetscCall(LatinLinearApply(latin, data->v));
  PetscCall(PCLatinWeigh_Private(pc, PETSC_FALSE, data->v, data->f));
  PetscCall(PCLatinSum_Private(latin, data->f, data->work));
  /* interiors in equilibrium with the given forces and these displacements */
  PetscCall(LatinDistribute_Private(latin, data->work, data->v));
  if (latin->interior) {
    PetscCall(LatinInteriorExtend(latin, data->v, data->work));
    PetscCall(PetscArrayzero(data->v, n));
  } else {
    for (PetscInt i = 0; i < n; i++)
      if (data->inner[i / bs] && data->interior.direct) data->v[i] = 0.0;
    PetscCall(LatinOperatorMult(latin, data->v, data->f));
    for (PetscInt i = 0; i < n; i++) data->f[i] = data->force[i] - data->f[i];
    PetscCall(PCLatinInteriorSolve_Private(pc, data->f));
  }
  PCLatinFail(pc, data->v);
  PetscCall(PCLatinSum_Private(latin, data->v, y));
  PetscCall(VecAXPY(y, 1.0, data->work));
  PetscCall(LatinLoose_Private(latin, x, y));
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

static PetscErrorCode PCSetFromOptions_Latin(PC pc, LatinOptionItems PetscOptionsObject)
{
  PC_Latin *data  = (PC_Latin *)pc->data;
  PetscBool given = PETSC_FALSE;

  PetscFunctionBegin;
  if (!data->shared) PetscCall(LatinSetFromOptions_Private(data->latin, PetscOptionsObject, "pc"));
  if (data->latin->stale) pc->setupcalled = 0; /* built again at the next PCSetUp() */
  PetscOptionsHeadBegin(PetscOptionsObject, "PC latin options");
  PetscCall(PetscOptionsEnum("-pc_latin_weights", "Weights of the copies of a node", "None", LatinWeightsTypes, (PetscEnum)data->weights, (PetscEnum *)&data->weights, &given));
  if (!data->shared) {
    const PetscBool before = data->latin->condense;

    PetscCall(PetscOptionsBool("-pc_latin_condense", "Eliminate the inside of a subdomain first, where that pays; then one factor serves it", "None", before, &data->latin->condense, NULL));
    if (before != data->latin->condense) pc->setupcalled = 0;
  }
  PetscOptionsHeadEnd();
  if (given) data->weights_given = PETSC_TRUE;
  if (!data->shared) PetscCall(PetscObjectSetOptions((PetscObject)data->latin, ((PetscObject)pc)->options));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCView_Latin(PC pc, PetscViewer viewer)
{
  PC_Latin *data = (PC_Latin *)pc->data;
  PetscBool ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "weights of the copies of a node: %s\n", LatinWeightsTypes[data->weights]));
  if (!data->latin->condense) PetscCall(PetscViewerASCIIPrintf(viewer, "the insides of subdomains are not eliminated first\n"));
  PetscCall(LatinView_Private(data->latin, viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCDestroy_Latin(PC pc)
{
  PC_Latin *data = (PC_Latin *)pc->data;

  PetscFunctionBegin;
  PetscCall(PCReset_Latin(pc));
  PetscCall(LatinDestroy_Private(&data->latin));
  PetscCall(LatinLinksDestroy(&data->links));
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
  own->variant             = latin->variant;
  own->modes               = latin->modes;
  own->promote             = latin->promote;
  own->subdomains          = latin->sub.count ? latin->sub.count : latin->subdomains;
  own->links_per_subdomain = latin->links_per_subdomain;
  own->repair              = latin->repair;
  own->direction           = latin->direction;
  PetscCall(LatinSetLinks_Private(own, latin->links));
  PetscCall(PCLatinSetLinks(pc, latin->links));
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
  PCLatinSetLinks - Gives the structure to a preconditioner of type latin.

  Collective on pc

  Level: intermediate

  Note:
  Not needed when the matrix comes from the DM of the structure.
@*/
PetscErrorCode PCLatinSetLinks(PC pc, LatinLinks links)
{
  PC_Latin *data;
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 1);
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLATIN, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_WRONG, "The PC is not of type latin: call PCSetType(pc, PCLATIN) first");
  data = (PC_Latin *)pc->data;
  if (links != data->links) pc->setupcalled = 0; /* built again at the next PCSetUp() */
  PetscCall(LatinLinksReference(links));
  PetscCall(LatinLinksDestroy(&data->links));
  data->links = links;
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
+ -pc_latin_variant <none,macro,corner>        - coarse treatment of weak interfaces
. -pc_latin_modes_local <0>                    - local low-energy fields of floppy subdomains, eigenvalues below this
. -pc_latin_subdomains <n>                     - number of subdomains
. -pc_latin_weights <stiffness,multiplicity,schur> - how residuals are shared among the copies of a node
. -pc_latin_direction <auto>                   - springs that keep the local problems regular
. -pc_latin_local_, -pc_latin_interior_        - prefixes of the KSPs of the subdomains
- -pc_latin_coarse_                            - prefix of the KSP of the coarse problem, for example -pc_latin_coarse_pc_type latin

  Level: beginner

  Note:
  Approximate solvers that are applied once leave it linear, symmetric and positive definite if they are so; inner
  iterations do not, and want a flexible method such as `KSPFCG` or `KSPFGMRES`.

.seealso: `SNESLATIN`, `PCLatinSetLinks()`, `PCShellSetLatin()`
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
  data->latin->tangent       = PETSC_TRUE;
  data->latin->preconditions = PETSC_TRUE;
  data->latin->direction     = LATIN_DIRECTION_AUTO;
  PetscFunctionReturn(0);
}

/* ---- PCSHELL: the same behind a shell, for programs that insist on one ---- */

static PetscErrorCode PCShellLatinSetUp_Private(PC shell)
{
  PC          inner;
  Mat         A, P;
  DM          dm;
  const char *prefix;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCGetOperators(shell, &A, &P));
  PetscCall(PCSetOperators(inner, A, P));
  PetscCall(PCGetDM(shell, &dm));
  if (dm) PetscCall(PCSetDM(inner, dm));
  PetscCall(PCGetOptionsPrefix(shell, &prefix));
  PetscCall(PCSetOptionsPrefix(inner, prefix));
  PetscCall(PCSetType(inner, PCLATIN));
  /* not PCSetFromOptions(): -pc_type shell would turn the inner one into a shell too */
  PetscObjectOptionsBegin((PetscObject)inner);
  PetscCall(PCSetFromOptions_Latin(inner, PetscOptionsObject));
  PetscOptionsEnd();
  PetscCall(PCSetUp(inner));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCShellLatinApply_Private(PC shell, Vec x, Vec y)
{
  PC inner;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCApply(inner, x, y));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCShellLatinView_Private(PC shell, PetscViewer viewer)
{
  PC inner;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCView(inner, viewer));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCShellLatinDestroy_Private(PC shell)
{
  PC inner;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCDestroy(&inner));
  PetscFunctionReturn(0);
}

/*@C
  PCShellSetLatin - Makes a preconditioner of type `PCSHELL` work as one of type latin, with the same options.

  Collective on pc

  Level: intermediate
@*/
PetscErrorCode PCShellSetLatin(PC pc)
{
  PC        inner;
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 1);
  PetscCall(LatinInitializePackage());
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCSHELL, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_WRONG, "The PC is not of type shell: call PCSetType(pc, PCSHELL) first");
  PetscCall(PCCreate(PetscObjectComm((PetscObject)pc), &inner));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)inner, (PetscObject)pc, 1));
  PetscCall(PCSetType(inner, PCLATIN));
  PetscCall(PCShellSetContext(pc, inner));
  PetscCall(PCShellSetName(pc, "latin"));
  PetscCall(PCShellSetSetUp(pc, PCShellLatinSetUp_Private));
  PetscCall(PCShellSetApply(pc, PCShellLatinApply_Private));
  PetscCall(PCShellSetApplyTranspose(pc, PCShellLatinApply_Private));
  PetscCall(PCShellSetView(pc, PCShellLatinView_Private));
  PetscCall(PCShellSetDestroy(pc, PCShellLatinDestroy_Private));
  PetscFunctionReturn(0);
}
