#include "coarse/latincoarse.h"
#include <petsc/private/matimpl.h>

/*
   The MatSolverType LATIN_DENSE of dense matrices of several ranks: Cholesky by blocks of columns, which the ranks
   eliminate in turn. The owner of a block factors it and hands it to all others, who need it for their own later blocks;
   so that in the end every rank has the whole factor, and a solve takes one message to each: the right-hand side.

   A matrix shares out its rows, which are columns as well, for it is symmetric. Blocks of the ranks take turns in the order of
   elimination, so that all have work to the end; nothing is moved for it.
*/

#define LATIN_DENSE_BLOCK 64 /* columns of a block: more leave the other ranks waiting for it, fewer are more messages */

typedef struct {
  PetscInt     n, blocks; /* rows */
  PetscInt    *first;     /* [blocks + 1] place of a block in the order of elimination, */
  PetscInt    *column;    /* [blocks] its first column in the matrix, */
  PetscMPIInt *owner;     /* [blocks] and the rank that has it */
  size_t      *panel;     /* [blocks + 1] where it is in the factor: all rows from its own ones on, column-major */
  PetscScalar *L, *x, *all;
  PetscMPIInt *count, *start; /* [ranks] rows of each rank */
} LatinPanels;

static PetscErrorCode LatinDenseReset_Private(LatinPanels *data)
{
  PetscFunctionBegin;
  PetscCall(PetscFree4(data->first, data->column, data->owner, data->panel));
  PetscCall(PetscFree2(data->count, data->start));
  PetscCall(PetscFree3(data->L, data->x, data->all));
  PetscFunctionReturn(0);
}

static inline PetscBLASInt LatinPanelColumns(const LatinPanels *data, PetscInt b)
{
  return (PetscBLASInt)(data->first[b + 1] - data->first[b]);
}

static inline PetscBLASInt LatinPanelHeight(const LatinPanels *data, PetscInt b)
{
  return (PetscBLASInt)(data->n - data->first[b]);
}

/* The blocks of this rank, from its rows a of the matrix */
static void LatinPanelsFill(LatinPanels *data, PetscMPIInt rank, PetscInt start, const PetscScalar a[], size_t lda)
{
  for (PetscInt b = 0; b < data->blocks; b++) {
    const size_t height = (size_t)LatinPanelHeight(data, b);

    if (data->owner[b] != rank) continue;
    for (PetscInt d = b; d < data->blocks; d++)
      for (PetscInt r = 0; r < LatinPanelColumns(data, d); r++) {
        const PetscScalar *from = a + (data->column[b] - start) + lda * (size_t)(data->column[d] + r);
        PetscScalar       *to   = data->L + data->panel[b] + (data->first[d] - data->first[b]) + r;

        for (PetscInt c = 0; c < LatinPanelColumns(data, b); c++) to[height * (size_t)c] = from[c];
      }
  }
}

/* Eliminates block b, which then is that of the factor; its first entry is not a number where that is not positive definite */
static PetscErrorCode LatinPanelEliminate_Private(LatinPanels *data, PetscInt b)
{
  const PetscScalar  one = 1.0;
  const PetscBLASInt own = LatinPanelColumns(data, b), height = LatinPanelHeight(data, b), below = height - own;
  PetscScalar       *panel = data->L + data->panel[b];
  PetscBLASInt       info;

  PetscFunctionBegin;
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &own, panel, &height, &info));
  if (info) panel[0] = NAN;
  else if (below) PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &below, &own, &one, panel, &height, panel + own, &height));
  PetscFunctionReturn(0);
}

/* What the elimination of block b leaves on block c */
static PetscErrorCode LatinPanelUpdate_Private(LatinPanels *data, PetscInt b, PetscInt c)
{
  const PetscScalar  one = 1.0, minus = -1.0, *P = data->L + data->panel[b] + (data->first[c] - data->first[b]);
  const PetscBLASInt columns = LatinPanelColumns(data, c), height = LatinPanelHeight(data, c), inner = LatinPanelColumns(data, b), ld = LatinPanelHeight(data, b);

  PetscFunctionBegin;
  PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &height, &columns, &inner, &minus, P, &ld, P, &ld, &one, data->L + data->panel[c], &height));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDenseNumeric_Private(Mat F, Mat A, const MatFactorInfo *info)
{
  LatinPanels       *data = (LatinPanels *)F->data;
  MPI_Comm           comm = PetscObjectComm((PetscObject)F);
  PetscMPIInt        rank, length, ranks;
  PetscInt           lda;
  Mat                local;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(MatDenseGetLocalMatrix(A, &local));
  PetscCall(MatDenseGetLDA(local, &lda));
  PetscCall(MatDenseGetArrayRead(local, &a));
  LatinPanelsFill(data, rank, A->rmap->rstart, a, (size_t)lda);
  PetscCall(MatDenseRestoreArrayRead(local, &a));
  F->factorerrortype = MAT_FACTOR_NOERROR;
  for (PetscInt b = 0; b < data->blocks; b++) {
    if (data->owner[b] == rank) PetscCall(LatinPanelEliminate_Private(data, b));
    PetscCall(PetscMPIIntCast((PetscInt)(data->panel[b + 1] - data->panel[b]), &length));
    PetscCallMPI(MPI_Bcast(data->L + data->panel[b], length, MPIU_SCALAR, data->owner[b], comm));
    if (PetscIsInfOrNanScalar(data->L[data->panel[b]])) { /* on all ranks */
      F->factorerrortype = MAT_FACTOR_NUMERIC_ZEROPIVOT;
      break;
    }
    for (PetscInt c = b + 1; c < data->blocks; c++)
      if (data->owner[c] == rank) PetscCall(LatinPanelUpdate_Private(data, b, c));
  }
  PetscCall(PetscLogFlops(PetscPowReal((PetscReal)data->n, 3.0) / (3.0 * ranks)));
  PetscFunctionReturn(0);
}

/* The blocks in the order of elimination: the first one of each rank, the second ones, and so on */
static PetscErrorCode LatinDenseSymbolic_Private(Mat F, Mat A, IS perm, const MatFactorInfo *info)
{
  LatinPanels    *data = (LatinPanels *)F->data;
  const PetscInt *range;
  PetscInt        most = 0, at = 0;
  PetscMPIInt     ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)F), &ranks));
  PetscCall(PetscLayoutGetRanges(A->rmap, &range));
  PetscCall(LatinDenseReset_Private(data));
  data->n      = A->rmap->N;
  data->blocks = 0;
  PetscCall(PetscMalloc2(ranks, &data->count, ranks, &data->start));
  for (PetscMPIInt r = 0; r < ranks; r++) {
    const PetscInt blocks = (range[r + 1] - range[r] + LATIN_DENSE_BLOCK - 1) / LATIN_DENSE_BLOCK;

    PetscCall(PetscMPIIntCast(range[r], &data->start[r]));
    PetscCall(PetscMPIIntCast(range[r + 1] - range[r], &data->count[r]));
    data->blocks += blocks;
    most = PetscMax(most, blocks);
  }
  PetscCall(PetscMalloc4(data->blocks + 1, &data->first, data->blocks, &data->column, data->blocks, &data->owner, data->blocks + 1, &data->panel));
  data->first[0] = 0;
  data->panel[0] = 0;
  for (PetscInt k = 0, b = 0; k < most; k++)
    for (PetscMPIInt r = 0; r < ranks; r++) {
      const PetscInt column = range[r] + LATIN_DENSE_BLOCK * k, width = PetscMin(range[r + 1] - column, LATIN_DENSE_BLOCK);

      if (width <= 0) continue;
      data->owner[b]     = r;
      data->column[b]    = column;
      data->panel[b + 1] = data->panel[b] + (size_t)(data->n - at) * (size_t)width;
      data->first[++b]   = at += width;
    }
  PetscCall(PetscMalloc3(data->panel[data->blocks], &data->L, data->n, &data->x, data->n, &data->all));
  F->ops->choleskyfactornumeric = LatinDenseNumeric_Private;
  PetscFunctionReturn(0);
}

/* All of the solve, in the order of elimination, in place */
static PetscErrorCode LatinPanelsSolve_Private(LatinPanels *data, PetscScalar x[])
{
  const PetscScalar  one = 1.0, minus = -1.0;
  const PetscBLASInt inc = 1;

  PetscFunctionBegin;
  for (PetscInt pass = 0; pass < 2; pass++)
    for (PetscInt k = 0; k < data->blocks; k++) {
      const PetscInt     b   = pass ? data->blocks - 1 - k : k;
      const PetscBLASInt own = LatinPanelColumns(data, b), height = LatinPanelHeight(data, b), below = height - own;
      const PetscScalar *panel = data->L + data->panel[b];
      PetscScalar       *y = x + data->first[b], *rest = y + own;

      if (pass && below) PetscCallBLAS("BLASgemv", BLASgemv_("T", &below, &own, &minus, panel + own, &height, rest, &inc, &one, y, &inc));
      PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", pass ? "T" : "N", "N", &own, &inc, &one, panel, &height, y, &own));
      if (!pass && below) PetscCallBLAS("BLASgemv", BLASgemv_("N", &below, &own, &minus, panel + own, &height, y, &inc, &one, rest, &inc));
    }
  PetscCall(PetscLogFlops(4.0 * (double)data->panel[data->blocks]));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDenseSolve_MPI(Mat F, Vec b, Vec x)
{
  LatinPanels       *data = (LatinPanels *)F->data;
  const PetscScalar *in;
  PetscScalar       *out;
  PetscInt           start, end;
  PetscMPIInt        length;

  PetscFunctionBegin;
  PetscCall(VecGetOwnershipRange(b, &start, &end));
  PetscCall(PetscMPIIntCast(end - start, &length));
  PetscCall(VecGetArrayRead(b, &in));
  PetscCallMPI(MPI_Allgatherv(in, length, MPIU_SCALAR, data->all, data->count, data->start, MPIU_SCALAR, PetscObjectComm((PetscObject)F)));
  PetscCall(VecRestoreArrayRead(b, &in));
  for (PetscInt k = 0; k < data->blocks; k++) PetscCall(PetscArraycpy(data->x + data->first[k], data->all + data->column[k], LatinPanelColumns(data, k)));
  PetscCall(LatinPanelsSolve_Private(data, data->x));
  PetscCall(VecGetArrayWrite(x, &out));
  for (PetscInt k = 0; k < data->blocks; k++)
    if (data->column[k] >= start && data->column[k] < end) PetscCall(PetscArraycpy(out + data->column[k] - start, data->x + data->first[k], LatinPanelColumns(data, k)));
  PetscCall(VecRestoreArrayWrite(x, &out));
  PetscFunctionReturn(0);
}

/* ---- the object ---- */

static PetscErrorCode LatinDenseView_Private(Mat F, PetscViewer viewer)
{
  PetscBool ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (ascii) PetscCall(PetscViewerASCIIPrintf(viewer, "  dense Cholesky by blocks of %d columns, the factor on every rank\n", LATIN_DENSE_BLOCK));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDenseInfo_Private(Mat F, MatInfoType flag, MatInfo *info)
{
  LatinPanels *data = (LatinPanels *)F->data;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(info, sizeof(*info)));
  info->block_size   = 1.0;
  info->nz_allocated = info->nz_used = data->panel ? (PetscLogDouble)data->panel[data->blocks] : 0.0;
  info->memory                       = (PetscLogDouble)sizeof(PetscScalar) * info->nz_used;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDenseType_Private(Mat F, MatSolverType *type)
{
  PetscFunctionBegin;
  *type = LATIN_DENSE;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDenseDestroy_Private(Mat F)
{
  PetscFunctionBegin;
  PetscCall(LatinDenseReset_Private((LatinPanels *)F->data));
  PetscCall(PetscObjectComposeFunction((PetscObject)F, "MatFactorGetSolverType_C", NULL));
  PetscCall(PetscFree(F->data));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDenseCreate_MPI(Mat A, MatFactorType type, Mat *factor)
{
  LatinPanels *data;
  PetscInt     n;
  Mat          F;

  PetscFunctionBegin;
  PetscCall(MatGetLocalSize(A, &n, NULL));
  PetscCall(MatCreate(PetscObjectComm((PetscObject)A), &F));
  PetscCall(MatSetSizes(F, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(PetscStrallocpy(LATIN_DENSE, &((PetscObject)F)->type_name));
  PetscCall(MatSetUp(F));
  PetscCall(PetscNew(&data));
  F->data                        = data;
  F->ops->choleskyfactorsymbolic = LatinDenseSymbolic_Private;
  F->ops->solve                  = LatinDenseSolve_MPI;
  F->ops->view                   = LatinDenseView_Private;
  F->ops->getinfo                = LatinDenseInfo_Private;
  F->ops->destroy                = LatinDenseDestroy_Private;
  F->factortype                  = type;
  F->assembled = F->preallocated = PETSC_TRUE;
  PetscCall(PetscFree(F->solvertype));
  PetscCall(PetscStrallocpy(LATIN_DENSE, &F->solvertype));
  PetscCall(PetscObjectComposeFunction((PetscObject)F, "MatFactorGetSolverType_C", LatinDenseType_Private));
  *factor = F;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDenseRegister(void)
{
  PetscFunctionBegin;
  PetscCall(MatSolverTypeRegister(LATIN_DENSE, MATMPIDENSE, MAT_FACTOR_CHOLESKY, LatinDenseCreate_MPI));
  PetscFunctionReturn(0);
}
