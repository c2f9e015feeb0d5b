#include "localsolvers/latinlocalsolvers.h"

/*
   The MatSolverType LATIN_CHOLESKY of sequential matrices: multifrontal Cholesky (localsolvers/fronts.c) with CHOLMOD's symbolic analysis
   (localsolvers/analysis.c). CHOLMOD's own factorisation takes as long on one thread. This one orders nodes, not dofs; the factor may be in single
   precision; some rows may be kept to the last (MatFactorSetSchurIS()) and give their Schur complement; and the halves of a solve can be called one by
   one, with the kept rows between them. So one elimination of the interior of a subdomain serves all that is done on its interfaces.

   If rows are kept, MatSolve() leaves out their couplings: it divides them by their diagonal alone.
*/

#if LATIN_CHOLMOD

  #include <petsc/private/matimpl.h>
  #include "localsolvers/supernodes.h"

/* Sets the diagonal by which MatSolve() divides the kept rows; 1 if an entry is not positive */
static void LatinCholeskyDiagonal(LatinSupernodes *data, const PetscInt i[], const PetscInt j[], const PetscScalar a[])
{
  for (PetscInt r = 0, at = 0; r < data->n; r++) {
    if (!data->keep[r]) continue;
    data->diagonal[at] = 1.0;
    for (PetscInt k = i[r]; k < i[r + 1]; k++)
      if (j[k] == r && a[k] > 0.0) data->diagonal[at] = a[k];
    at++;
  }
}

/* Extracts the requested rows and columns from the Schur complement of all kept rows, in place: lower triangles, one column after the other */
static PetscErrorCode LatinCholeskyExtract_Private(const LatinSupernodes *data, PetscScalar S[])
{
  const PetscInt m = data->schur_rows;
  PetscInt      *at;

  PetscFunctionBegin;
  if (m == data->kept) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(m, &at));
  for (PetscInt row = 0, k = 0, c = 0; c < m; row++) {
    if (data->schur_row[c] == row) at[c++] = k;
    if (data->keep[row]) k++;
  }
  for (PetscInt c = 0; c < m; c++)
    for (PetscInt r = c; r < m; r++) S[LatinLowerAt(m, c) + (size_t)r] = S[LatinLowerAt(data->kept, at[c]) + (size_t)at[r]];
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyNumeric_Private(Mat F, Mat A, const MatFactorInfo *info)
{
  LatinSupernodes   *data = (LatinSupernodes *)F->data;
  const PetscInt    *i, *j;
  const PetscScalar *a;
  PetscInt           n, bad;
  PetscBool          done;

  PetscFunctionBegin;
  PetscCall(MatDestroy(&F->schur));
  PetscCall(PetscFree(data->schur));
  /* the upper half is not touched before the work space of the fronts is freed */
  PetscCall(PetscMalloc1((size_t)data->kept * (size_t)data->kept, &data->schur));
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscCall(MatSeqAIJGetArrayRead(A, &a));
  LatinCholeskyDiagonal(data, i, j, a);
  PetscCall(LatinFrontsFactor(&data->fronts, data->precision, i, j, a, data->callback, data->schur, &bad));
  if (!data->lower) PetscCall(LatinCholeskyExtract_Private(data, data->schur));
  if (!data->lower) LatinLowerMirror(data->schur_rows, data->schur);
  if (data->schur_rows && !data->lower) PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, data->schur_rows, data->schur_rows, data->schur, &F->schur));
  PetscCall(MatSeqAIJRestoreArrayRead(A, &a));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  F->factorerrortype = bad < 0 ? MAT_FACTOR_NOERROR : MAT_FACTOR_NUMERIC_ZEROPIVOT;
  PetscCall(PetscLogFlops(data->fronts.operations));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskySymbolic_Private(Mat F, Mat A, IS perm, const MatFactorInfo *info)
{
  PetscFunctionBegin;
  PetscCall(LatinSupernodesAnalyze((LatinSupernodes *)F->data, A));
  PetscCall(PetscObjectCompose((PetscObject)A, LATIN_PLACES, NULL)); /* coordinates only serve to compute the order */
  F->ops->choleskyfactornumeric = LatinCholeskyNumeric_Private;
  PetscFunctionReturn(0);
}

/* ---- solves ---- */

/* Computes X = A^-1 B in place, for columns that are ld apart */
static PetscErrorCode LatinCholeskyColumns_Private(Mat F, PetscInt columns, PetscReal b[], size_t ld)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  for (PetscInt c = 0; c < columns && data->kept; c++)
    for (PetscInt r = 0, at = 0; r < data->n; r++)
      if (data->keep[r]) b[(size_t)r + ld * (size_t)c] /= data->diagonal[at++];
  PetscCall(LatinFrontsSolve(&data->fronts, PETSC_TRUE, PETSC_TRUE, columns, b, ld, NULL));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskySolve_Private(Mat F, Vec b, Vec x)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecCopy(b, x));
  PetscCall(VecGetArray(x, &a));
  PetscCall(LatinCholeskyColumns_Private(F, 1, a, 0));
  PetscCall(VecRestoreArray(x, &a));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyMatSolve_Private(Mat F, Mat B, Mat X)
{
  PetscInt     columns, ld;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(MatCopy(B, X, SAME_NONZERO_PATTERN));
  PetscCall(MatGetSize(X, NULL, &columns));
  PetscCall(MatDenseGetLDA(X, &ld));
  PetscCall(MatDenseGetArray(X, &a));
  PetscCall(LatinCholeskyColumns_Private(F, columns, a, (size_t)ld));
  PetscCall(MatDenseRestoreArray(X, &a));
  PetscFunctionReturn(0);
}

/*
   Performs the first half of a solve, in place: the forces g of all rows become those on the kept rows, and intermediate values for the second half on the
   others. Adds the energy of the solution with the kept rows held to *energy
*/
PetscErrorCode LatinCholeskyForward(Mat F, PetscReal g[], PetscReal *energy)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  if (data->kept) PetscCall(LatinFrontsSolve(&data->fronts, PETSC_TRUE, PETSC_FALSE, 1, g, 0, energy));
  PetscFunctionReturn(0);
}

/* Performs the second half: g, with the displacements of the kept rows in their places, becomes those of all rows. If no row is kept, it does the whole solve */
PetscErrorCode LatinCholeskyBackward(Mat F, PetscReal g[], PetscReal *energy)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(LatinFrontsSolve(&data->fronts, (PetscBool)!data->kept, PETSC_TRUE, 1, g, 0, energy));
  PetscFunctionReturn(0);
}

/* Gets the order of elimination: row order[r] of the matrix comes r-th. Borrowed from F */
PetscErrorCode LatinCholeskyOrder(Mat F, const PetscInt *order[])
{
  PetscFunctionBegin;
  *order = ((LatinSupernodes *)F->data)->order;
  PetscFunctionReturn(0);
}

/* Solves for right-hand sides that are zero but in some rows, and reads the solution there, see LatinFrontsSolveSome() */
PetscErrorCode LatinCholeskySolveSome(Mat F, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[])
{
  PetscFunctionBegin;
  PetscCall(LatinFrontsSolveSome(&((LatinSupernodes *)F->data)->fronts, rows, row, columns, b));
  PetscFunctionReturn(0);
}

/* Solves for interleaved right-hand sides, see LatinFrontsSolveLanes(); no row is kept */
PetscErrorCode LatinCholeskySolveLanes(Mat F, float x[], PetscReal energy[], PetscReal square[])
{
  PetscFunctionBegin;
  PetscCall(LatinFrontsSolveLanes(&((LatinSupernodes *)F->data)->fronts, x, energy, square));
  PetscFunctionReturn(0);
}

/* Stores the lower triangle of the Schur complement alone, without F->schur, until it is taken over: half of the memory */
PetscErrorCode LatinCholeskySetLower(Mat F)
{
  PetscFunctionBegin;
  ((LatinSupernodes *)F->data)->lower = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Sets the callback that releases the entries of the matrix, see LatinEntriesCallback */
PetscErrorCode LatinCholeskySetCallback(Mat F, LatinEntriesCallback callback)
{
  PetscFunctionBegin;
  ((LatinSupernodes *)F->data)->callback = callback;
  PetscFunctionReturn(0);
}

/*
   Gives the lower triangle *S of the Schur complement, of the requested rows, see LatinLowerAt(), to the caller, who frees it: it may be as large as
   the factor, and is used once. The array has room for both triangles
*/
PetscErrorCode LatinCholeskyTakeLower(Mat F, PetscReal **S)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  if (data->schur) PetscCall(LatinCholeskyExtract_Private(data, data->schur));
  *S          = data->schur;
  data->schur = NULL;
  PetscFunctionReturn(0);
}

/* The same with both triangles, column-major */
PetscErrorCode LatinCholeskyTakeSchur(Mat F, PetscReal **S)
{
  PetscFunctionBegin;
  PetscCall(LatinCholeskyTakeLower(F, S));
  if (*S) LatinLowerMirror(((LatinSupernodes *)F->data)->schur_rows, *S);
  PetscFunctionReturn(0);
}

/* Gets the factor of a PC if it is of this type, else NULL */
static PetscErrorCode LatinCholeskyFind_Private(PC pc, LatinSupernodes **data)
{
  MatSolverType type = NULL;
  PetscBool     ours = PETSC_FALSE, cholesky;
  Mat           F;

  PetscFunctionBegin;
  *data = NULL;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  if (!cholesky) PetscFunctionReturn(0);
  PetscCall(PCFactorGetMatSolverType(pc, &type));
  if (type) PetscCall(PetscStrcmp(type, LATIN_CHOLESKY, &ours));
  if (!ours) PetscFunctionReturn(0);
  PetscCall(PCFactorGetMatrix(pc, &F));
  *data = (LatinSupernodes *)F->data;
  PetscFunctionReturn(0);
}

/* Requests the precision of a factor, if it is of this type */
PetscErrorCode LatinCholeskyRound(PC pc, LatinArithmetic precision)
{
  LatinSupernodes *data;
  PetscBool        cholesky;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCCHOLESKY, &cholesky));
  if (cholesky) PetscCall(PCFactorSetUpMatSolverType(pc)); /* options may choose another package */
  PetscCall(LatinCholeskyFind_Private(pc, &data));
  if (data) data->precision = precision;
  PetscFunctionReturn(0);
}

/* Gets the precision of a factor; double if it is not of this type */
PetscErrorCode LatinCholeskyPrecision(PC pc, LatinArithmetic *precision)
{
  LatinSupernodes *data;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyFind_Private(pc, &data));
  *precision = data ? data->fronts.precision : LATIN_DOUBLE;
  PetscFunctionReturn(0);
}

/* Computes b^t A^-1 b with the kept rows held, by the first half of the solve, which overwrites b */
PetscErrorCode LatinCholeskyEnergy(PC pc, Vec b, PetscReal *energy)
{
  LatinSupernodes *data;
  PetscScalar     *a;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyFind_Private(pc, &data));
  PetscCheck(data, PETSC_COMM_SELF, PETSC_ERR_PLIB, "The factor is not of type %s", LATIN_CHOLESKY);
  *energy = 0.0;
  PetscCall(VecGetArray(b, &a));
  PetscCall(LatinFrontsSolve(&data->fronts, PETSC_TRUE, PETSC_FALSE, 1, a, 0, energy));
  PetscCall(VecRestoreArray(b, &a));
  PetscFunctionReturn(0);
}

/* Gets the additions and multiplications of a factorisation, and the bytes of the factor; 0 if it is not of this type */
PetscErrorCode LatinCholeskyCost(PC pc, PetscReal *operations, PetscReal *bytes)
{
  LatinSupernodes *data;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyFind_Private(pc, &data));
  *operations = data ? (PetscReal)data->fronts.operations : 0.0;
  *bytes      = data ? (PetscReal)data->fronts.panel[data->fronts.fronts] * (data->fronts.precision != LATIN_DOUBLE ? 4.0 : 8.0) : 0.0;
  PetscFunctionReturn(0);
}

/* Factors A again in this precision */
PetscErrorCode LatinCholeskyAgain(PC pc, Mat A, LatinArithmetic precision)
{
  MatFactorInfo    info;
  LatinSupernodes *data;
  Mat              F;

  PetscFunctionBegin;
  PetscCall(PCFactorGetMatrix(pc, &F));
  data            = (LatinSupernodes *)F->data;
  data->precision = precision;
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorNumeric(F, A, &info));
  PetscFunctionReturn(0);
}

/* ---- the object ---- */

/* Sets the rows that are kept; F->schur is their Schur complement once F is a factor */
static PetscErrorCode LatinCholeskyKeep_Private(Mat F, IS is)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;
  const PetscInt  *rows;

  PetscFunctionBegin;
  PetscCall(ISGetLocalSize(is, &data->schur_rows));
  PetscCall(ISGetIndices(is, &rows));
  PetscCall(PetscFree(data->schur_row));
  PetscCall(PetscMalloc1(data->schur_rows, &data->schur_row));
  PetscCall(PetscArraycpy(data->schur_row, rows, data->schur_rows));
  PetscCall(ISRestoreIndices(is, &rows));
  PetscCall(PetscSortInt(data->schur_rows, data->schur_row));
  PetscCall(MatDestroy(&F->schur)); /* one without entries: PETSc tests whether there is one */
  PetscCall(MatCreate(PETSC_COMM_SELF, &F->schur));
  PetscCall(MatSetSizes(F->schur, data->schur_rows, data->schur_rows, data->schur_rows, data->schur_rows));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyView_Private(Mat F, PetscViewer viewer)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;
  PetscBool        ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (ascii && data->fronts.fronts)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  Cholesky by fronts: %g entries in %s precision, %g operations\n", (double)data->fronts.panel[data->fronts.fronts], data->fronts.precision ? "single" : "double", data->fronts.operations));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyInfo_Private(Mat F, MatInfoType flag, MatInfo *info)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(info, sizeof(*info)));
  info->block_size   = 1.0;
  info->nz_allocated = info->nz_used = data->fronts.panel ? (PetscLogDouble)data->fronts.panel[data->fronts.fronts] : 0.0;
  info->memory                       = (data->fronts.precision ? 4.0 : 8.0) * info->nz_used;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyDestroy_Private(Mat F)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(LatinSupernodesReset(data));
  CHOLMOD(free_factor)(&data->L, &data->common);
  CHOLMOD(finish)(&data->common);
  PetscCall(PetscFree(data->keep));
  PetscCall(PetscFree(data->schur_row));
  PetscCall(PetscFree(data->diagonal));
  PetscCall(MatDestroy(&F->schur));
  PetscCall(PetscFree(data->schur));
  PetscCall(PetscObjectComposeFunction((PetscObject)F, "MatFactorSetSchurIS_C", NULL));
  PetscCall(PetscFree(F->data));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyCreate_Private(Mat A, MatFactorType type, Mat *factor)
{
  LatinSupernodes *data;
  Mat              F;
  PetscInt         n;

  PetscFunctionBegin;
  PetscCall(MatGetSize(A, &n, NULL));
  PetscCall(PetscNew(&data));
  PetscCall(PetscCalloc1(n, &data->keep));
  data->n = n;
  CHOLMOD(start)(&data->common);
  data->common.error_handler = NULL; /* failures are read from the status */
  data->common.print         = 0;
  data->common.final_ll      = 1;
  PetscCall(LatinFactorShell_Private(PETSC_COMM_SELF, n, LATIN_CHOLESKY, data, &F));
  F->ops->choleskyfactorsymbolic = LatinCholeskySymbolic_Private;
  F->ops->solve                  = LatinCholeskySolve_Private;
  F->ops->matsolve               = LatinCholeskyMatSolve_Private;
  F->ops->view                   = LatinCholeskyView_Private;
  F->ops->getinfo                = LatinCholeskyInfo_Private;
  F->ops->destroy                = LatinCholeskyDestroy_Private;
  PetscCall(PetscObjectComposeFunction((PetscObject)F, "MatFactorSetSchurIS_C", LatinCholeskyKeep_Private));
  *factor = F;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCholeskyRegister(void)
{
  PetscFunctionBegin;
  PetscCall(MatSolverTypeRegister(LATIN_CHOLESKY, MATSEQAIJ, MAT_FACTOR_CHOLESKY, LatinCholeskyCreate_Private));
  PetscFunctionReturn(0);
}

#endif
