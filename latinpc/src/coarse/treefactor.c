#include "coarse/tree.h"
#include <petsc/private/matimpl.h>

/* The MatSolverType LATIN_TREE: the factor of coarse/tree.h as a Mat. It factors a MATIS whose local matrices have all rows that their ranks own. */

/* Gets the local matrix K of A, which the caller destroys. *release: a shell composed with A (LATIN_TREE_RELEASED) has replaced it */
static PetscErrorCode LatinTreePart_Mat(Mat A, Mat *K, PetscBool *release)
{
  PetscObjectState state;
  Mat              local, shell;

  PetscFunctionBegin;
  PetscCall(MatISGetLocalMat(A, &local));
  *K = local;
  PetscCall(PetscObjectReference((PetscObject)local));
  PetscCall(MatISRestoreLocalMat(A, &local));
  PetscCall(PetscObjectQuery((PetscObject)A, LATIN_TREE_RELEASED, (PetscObject *)&shell));
  *release = (PetscBool)(shell != NULL);
  if (!shell) PetscFunctionReturn(0);
  PetscCall(PetscObjectStateGet((PetscObject)A, &state));
  PetscCall(MatISSetLocalMat(A, shell));
  PetscCall(PetscObjectStateSet((PetscObject)A, state)); /* keep the factor */
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeNumeric_Mat(Mat F, Mat A, const MatFactorInfo *info)
{
  PetscBool bad, rounded = PETSC_FALSE;
  Mat       K = NULL;

  PetscFunctionBegin;
  PetscCall(LatinTreePart_Mat(A, &K, &rounded));
  PetscCall(LatinTreeFactor_Private((LatinTree *)F->data, rounded, K, &bad));
  F->factorerrortype = bad ? MAT_FACTOR_NUMERIC_ZEROPIVOT : MAT_FACTOR_NOERROR;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeSymbolic_Mat(Mat F, Mat A, IS perm, const MatFactorInfo *info)
{
  ISLocalToGlobalMapping map;

  PetscFunctionBegin;
  PetscCall(LatinTreeReset_Private((LatinTree *)F->data));
  PetscCall(MatISGetLocalToGlobalMapping(A, &map, NULL));
  PetscCall(LatinTreePlan_Private(map, A->rmap, (LatinTree *)F->data));
  F->ops->choleskyfactornumeric = LatinTreeNumeric_Mat;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeSolve_Mat(Mat F, Vec b, Vec x)
{
  const PetscScalar *in;
  PetscScalar       *out;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(b, &in));
  PetscCall(VecGetArrayWrite(x, &out));
  PetscCall(LatinTreeSolve_Private((LatinTree *)F->data, in, out));
  PetscCall(VecRestoreArrayWrite(x, &out));
  PetscCall(VecRestoreArrayRead(b, &in));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeView_Mat(Mat F, PetscViewer viewer)
{
  const LatinTreeCost *cost = &((LatinTree *)F->data)->cost;
  PetscBool            ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "  fronts of the ranks, joined in pairs: %g entries, of these %g one after the other, %g operations, of these %g; largest front %g rows; at most %g messages of a rank in a solve\n", (double)cost->entries,
                                   (double)cost->path_entries, (double)cost->operations, (double)cost->path_operations, (double)cost->most, (double)cost->messages));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  predicted for the set-up and %d solves: %.2g s, by a factorisation that all ranks share %.2g s\n", LATIN_TREE_STAGES, (double)cost->seconds, (double)cost->shared));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeInfo_Mat(Mat F, MatInfoType flag, MatInfo *info)
{
  const LatinTree  *tree  = (const LatinTree *)F->data;
  const LatinJoint *joint = tree->joint;
  PetscLogDouble    used[2];
  MatInfo           part = {.nz_used = 0.0, .memory = 0.0};

  PetscFunctionBegin;
  if (tree->part) PetscCall(MatGetInfo(tree->part, MAT_LOCAL, &part));
  used[0] = part.nz_used + (joint && joint->front.panel ? (PetscLogDouble)joint->front.panel[1] : 0.0);
  used[1] = part.memory + (joint && joint->front.panel ? (PetscLogDouble)joint->front.panel[1] * (joint->front.precision == LATIN_DOUBLE ? sizeof(double) : sizeof(float)) : 0.0);
  if (flag != MAT_LOCAL) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, used, 2, MPI_DOUBLE, flag == MAT_GLOBAL_MAX ? MPI_MAX : MPI_SUM, PetscObjectComm((PetscObject)F)));
  PetscCall(PetscMemzero(info, sizeof(*info)));
  info->block_size   = 1.0;
  info->nz_allocated = info->nz_used = used[0];
  info->memory                       = used[1];
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeDestroy_Mat(Mat F)
{
  PetscFunctionBegin;
  PetscCall(LatinTreeReset_Private((LatinTree *)F->data));
  PetscCall(PetscFree(F->data));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeCreate_Mat(Mat A, MatFactorType type, Mat *factor)
{
  LatinTree *tree;
  PetscInt   n;
  Mat        F;

  PetscFunctionBegin;
  PetscCall(MatGetLocalSize(A, &n, NULL));
  PetscCall(PetscNew(&tree));
  tree->comm = MPI_COMM_NULL;
  PetscCall(LatinFactorShell_Private(PetscObjectComm((PetscObject)A), n, LATIN_TREE, tree, &F));
  F->ops->choleskyfactorsymbolic = LatinTreeSymbolic_Mat;
  F->ops->solve                  = LatinTreeSolve_Mat;
  F->ops->view                   = LatinTreeView_Mat;
  F->ops->getinfo                = LatinTreeInfo_Mat;
  F->ops->destroy                = LatinTreeDestroy_Mat;
  *factor                        = F;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinTreeRegister(void)
{
  PetscFunctionBegin;
  PetscCall(MatSolverTypeRegister(LATIN_TREE, MATIS, MAT_FACTOR_CHOLESKY, LatinTreeCreate_Mat));
  PetscFunctionReturn(0);
}
