#include "localsolvers/latinlocalsolvers.h"

/*
   The MatSolverType LATIN_CHOLESKY of sequential matrices: Cholesky by fronts (localsolvers/fronts.c), of CHOLMOD's symbolic
   analysis. Beside CHOLMOD's own factorisation, which takes as long on one thread: it orders nodes, not degrees of freedom;
   the factor may be in single precision; some rows may be kept to the last (MatFactorSetSchurIS()), and give their Schur
   complement; the solve comes in its two halves as well, with the kept rows between them. One elimination of the inside of a
   subdomain so serves all that is done on its interfaces.

   MatSolve() where rows are kept: their couplings are left out, they have their diagonal alone.
*/

#if LATIN_CHOLMOD

  #include <petsc/private/matimpl.h>
  #include "localsolvers/fronts.h"
  #include <cholmod.h>

  #if defined(PETSC_USE_64BIT_INDICES)
    #define CHOLMOD(name)  cholmod_l_##name
    #define CHOLMOD_NUMBER CHOLMOD_LONG
  #else
    #define CHOLMOD(name)  cholmod_##name
    #define CHOLMOD_NUMBER CHOLMOD_INT
  #endif

  #define LATIN_CHOLESKY_FULL    0.25 /* share of entries from which no order is looked for */
  #define LATIN_CHOLESKY_COUPLED 1.1  /* times the entries of fields apart from each other: from there on elimination fills the blocks of the nodes, which are then analysed whole. Structures: 1.2 (lattice), 1.5 (grid) to 3 */

typedef struct {
  cholmod_common  common;
  cholmod_factor *L;                           /* of the symbolic analysis, while that is under way */
  PetscInt       *order, *first, *begin, *row; /* what the fronts need of it */
  LatinFronts     fronts;
  PetscInt        n, kept;   /* the last rows in the order of elimination are kept */
  PetscBool      *keep;      /* [n] */
  LatinArithmetic precision; /* that is asked for */
  PetscReal      *diagonal;  /* [kept] of the matrix */
} LatinSupernodes;

/* The pattern of a symmetric matrix as CHOLMOD sees it: of both triangles it reads one */
static void LatinCholeskyWrap(PetscInt n, const PetscInt i[], const PetscInt j[], cholmod_sparse *A)
{
  *A = (cholmod_sparse){.nrow = (size_t)n, .ncol = (size_t)n, .nzmax = (size_t)i[n], .p = (void *)i, .i = (void *)j, .stype = 1, .itype = CHOLMOD_NUMBER, .xtype = CHOLMOD_PATTERN, .dtype = CHOLMOD_DOUBLE, .packed = 1};
}

/* The supernodes for an order of elimination; without one, for minimum degree, or, of a matrix that is nearly full, for the order as it is */
static PetscErrorCode LatinCholeskyAnalyze_Private(LatinSupernodes *data, cholmod_sparse *A, PetscInt order[], PetscBool postorder)
{
  cholmod_common *common = &data->common;

  PetscFunctionBegin;
  PetscCall(CHOLMOD(free_factor)(&data->L, &data->common) ? 0 : PETSC_ERR_LIB);
  common->nmethods           = 1;
  common->method[0].ordering = order ? CHOLMOD_GIVEN : (double)A->nzmax > LATIN_CHOLESKY_FULL * (double)A->nrow * (double)A->ncol ? CHOLMOD_NATURAL : CHOLMOD_AMD;
  common->postorder          = postorder;
  common->supernodal         = postorder && data->kept ? CHOLMOD_SIMPLICIAL : CHOLMOD_SUPERNODAL;
  data->L                    = CHOLMOD(analyze_p)(A, order, NULL, 0, common);
  PetscCheck(data->L, PETSC_COMM_SELF, PETSC_ERR_LIB, "CHOLMOD could not analyse a matrix of %" PetscInt_FMT " rows (status %d)", data->n, common->status);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyReset_Private(LatinSupernodes *data)
{
  PetscFunctionBegin;
  PetscCall(LatinFrontsDestroy(&data->fronts));
  PetscCall(PetscFree4(data->order, data->first, data->begin, data->row));
  PetscFunctionReturn(0);
}

/* The fronts of the supernodes that are there, whose columns are nodes of bs rows each */
static PetscErrorCode LatinCholeskyFronts_Private(LatinSupernodes *data, PetscInt bs)
{
  const PetscInt *perm = (const PetscInt *)data->L->Perm, *super = (const PetscInt *)data->L->super, *begin = (const PetscInt *)data->L->pi, *row = (const PetscInt *)data->L->s;
  const PetscInt  fronts = (PetscInt)data->L->nsuper, entries = begin[fronts];

  PetscFunctionBegin;
  PetscCall(LatinCholeskyReset_Private(data));
  PetscCall(PetscMalloc4(data->n, &data->order, fronts + 1, &data->first, fronts + 1, &data->begin, bs * entries, &data->row));
  for (PetscInt r = 0; r < data->n; r++) data->order[r] = bs * perm[r / bs] + r % bs;
  for (PetscInt f = 0; f <= fronts; f++) {
    data->first[f] = bs * super[f];
    data->begin[f] = bs * begin[f];
  }
  for (PetscInt r = 0; r < bs * entries; r++) data->row[r] = bs * row[r / bs] + r % bs;
  PetscCall(CHOLMOD(free_factor)(&data->L, &data->common) ? 0 : PETSC_ERR_LIB);
  PetscCall(LatinFrontsCreate(data->n, data->kept, fronts, data->order, data->first, data->begin, data->row, &data->fronts));
  PetscFunctionReturn(0);
}

/* By nodes, whose graph has up to bs^2 times fewer entries, where elimination couples all the unknowns of two nodes: *done. Else nothing */
static PetscErrorCode LatinCholeskyNodes_Private(LatinSupernodes *data, PetscInt bs, const PetscInt i[], const PetscInt j[], PetscInt order[], PetscBool *done)
{
  const PetscInt nodes = data->n / bs;
  size_t         relaxed[3];
  PetscInt      *first, *list;
  cholmod_sparse pattern;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(nodes + 1, &first));
  PetscCall(LatinOrderingNodes_Private(bs, nodes, i, j, first, &list));
  *done = (PetscBool)(i[data->n] > LATIN_CHOLESKY_COUPLED * bs * first[nodes]);
  if (*done) {
    for (PetscInt k = 0; k < nodes; k++) order[k] = order[bs * k] / bs;
    for (PetscInt k = 0; k < 3; k++) {
      relaxed[k]             = data->common.nrelax[k];
      data->common.nrelax[k] = relaxed[k] / (size_t)bs; /* columns, which are nodes here */
    }
    LatinCholeskyWrap(nodes, first, list, &pattern);
    PetscCall(LatinCholeskyAnalyze_Private(data, &pattern, order, PETSC_TRUE));
    for (PetscInt k = 0; k < 3; k++) data->common.nrelax[k] = relaxed[k];
    PetscCall(LatinCholeskyFronts_Private(data, bs));
  }
  PetscCall(PetscFree(first));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(0);
}

/* By rows. order: NULL, or an order of elimination with what is kept at the end */
static PetscErrorCode LatinCholeskyRows_Private(LatinSupernodes *data, const PetscInt i[], const PetscInt j[], PetscInt order[])
{
  cholmod_sparse pattern;

  PetscFunctionBegin;
  LatinCholeskyWrap(data->n, i, j, &pattern);
  PetscCall(LatinCholeskyAnalyze_Private(data, &pattern, order, PETSC_TRUE));
  if (data->kept) { /* postorder moves what is kept: its rows go back to the end, each after those that it depends on as before */
    const PetscInt *post = (const PetscInt *)data->L->Perm;
    PetscInt        at   = 0;

    for (PetscInt r = 0; r < data->n; r++)
      if (!data->keep[post[r]]) order[at++] = post[r];
    for (PetscInt r = 0; r < data->n; r++)
      if (data->keep[r]) order[at++] = r;
    PetscCall(LatinCholeskyAnalyze_Private(data, &pattern, order, PETSC_FALSE));
  }
  PetscCall(LatinCholeskyFronts_Private(data, 1));
  PetscFunctionReturn(0);
}

/* An order of elimination of the nodes, *order[n], or NULL where that of CHOLMOD will do; kept with the matrix, and taken from it where it has one already */
static PetscErrorCode LatinCholeskyOrder_Private(const LatinSupernodes *data, Mat A, PetscInt n, const PetscInt i[], const PetscInt j[], PetscInt **order)
{
  const PetscInt *before;
  PetscInt        bs;
  IS              is;

  PetscFunctionBegin;
  *order = NULL;
  if (!data->kept && (n <= LATIN_LARGE || i[n] >= LATIN_CHOLESKY_FULL * n * n)) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(n, order));
  PetscCall(PetscObjectQuery((PetscObject)A, LATIN_ORDER, (PetscObject *)&is));
  if (is && !data->kept) {
    PetscCall(ISGetIndices(is, &before));
    PetscCall(PetscArraycpy(*order, before, n));
    PetscCall(ISRestoreIndices(is, &before));
    PetscFunctionReturn(0);
  }
  PetscCall(MatGetBlockSize(A, &bs));
  PetscCall(LatinOrderNodes_Private(bs, n, i, j, data->keep, *order));
  if (data->kept) PetscFunctionReturn(0);
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, *order, PETSC_COPY_VALUES, &is));
  PetscCall(PetscObjectCompose((PetscObject)A, LATIN_ORDER, (PetscObject)is));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyNumeric_Private(Mat F, Mat A, const MatFactorInfo *info);

static PetscErrorCode LatinCholeskySymbolic_Private(Mat F, Mat A, IS perm, const MatFactorInfo *info)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;
  const PetscInt  *i, *j;
  PetscInt         n, bs, *order;
  PetscBool        done, nodes = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Factorisation %s needs a matrix of type seqaij", LATIN_CHOLESKY);
  PetscCall(MatGetBlockSize(A, &bs));
  PetscCall(LatinCholeskyOrder_Private(data, A, n, i, j, &order));
  if (order && !data->kept && bs > 1) PetscCall(LatinCholeskyNodes_Private(data, bs, i, j, order, &nodes));
  if (!nodes) PetscCall(LatinCholeskyRows_Private(data, i, j, order));
  PetscCall(PetscFree(order));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  F->ops->choleskyfactornumeric = LatinCholeskyNumeric_Private;
  PetscFunctionReturn(0);
}

/* What a solve takes for the kept rows alone */
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

static PetscErrorCode LatinCholeskyNumeric_Private(Mat F, Mat A, const MatFactorInfo *info)
{
  LatinSupernodes   *data = (LatinSupernodes *)F->data;
  const PetscInt    *i, *j, m = data->kept;
  const PetscScalar *a;
  PetscScalar       *S = NULL;
  PetscInt           n, bad;
  PetscBool          done;

  PetscFunctionBegin;
  if (m) {
    if (!F->schur) PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, m, m, NULL, &F->schur)); /* given away */
    PetscCall(MatDenseGetArray(F->schur, &S));
  }
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscCall(MatSeqAIJGetArrayRead(A, &a));
  LatinCholeskyDiagonal(data, i, j, a);
  PetscCall(LatinFrontsFactor(&data->fronts, data->precision, i, j, a, S, &bad));
  PetscCall(MatSeqAIJRestoreArrayRead(A, &a));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  for (PetscInt c = 0; c < m; c++)
    for (PetscInt r = 0; r < c; r++) S[(size_t)r + (size_t)m * (size_t)c] = S[(size_t)c + (size_t)m * (size_t)r];
  if (m) PetscCall(MatDenseRestoreArray(F->schur, &S));
  F->factorerrortype = bad < 0 ? MAT_FACTOR_NOERROR : MAT_FACTOR_NUMERIC_ZEROPIVOT;
  PetscCall(PetscLogFlops(data->fronts.operations));
  PetscFunctionReturn(0);
}

/* ---- solves ---- */

/* X = A^-1 B for columns, ld apart, in place */
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

/* The first half, in place: the forces g of all rows become those on the kept rows, and what the second half needs on the others. Adds the energy of the solution with the kept rows held */
PetscErrorCode LatinCholeskyForward(Mat F, PetscReal g[], PetscReal *energy)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  if (data->kept) PetscCall(LatinFrontsSolve(&data->fronts, PETSC_TRUE, PETSC_FALSE, 1, g, 0, energy));
  PetscFunctionReturn(0);
}

/* The second: g, with the displacements of the kept rows in their places, becomes those of all rows. Where no row is kept it is all of the solve */
PetscErrorCode LatinCholeskyBackward(Mat F, PetscReal g[], PetscReal *energy)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(LatinFrontsSolve(&data->fronts, (PetscBool)!data->kept, PETSC_TRUE, 1, g, 0, energy));
  PetscFunctionReturn(0);
}

/* All of the solve for right-hand sides beside each other, see LatinFrontsSolveLanes(); no row is kept */
PetscErrorCode LatinCholeskySolveLanes(Mat F, const PetscInt at[], const PetscReal scale[], const PetscReal b[], PetscReal x[])
{
  PetscFunctionBegin;
  PetscCall(LatinFrontsSolveLanes(&((LatinSupernodes *)F->data)->fronts, at, scale, b, x));
  PetscFunctionReturn(0);
}

/* Hands the Schur complement over, S (kept x kept, column-major): it may be as large as the factor, and is used once */
PetscErrorCode LatinCholeskyGiveSchur(Mat F, PetscReal S[])
{
  const LatinSupernodes *data = (const LatinSupernodes *)F->data;
  const PetscScalar     *s;

  PetscFunctionBegin;
  PetscCall(MatDenseGetArrayRead(F->schur, &s));
  PetscCall(PetscArraycpy(S, s, (size_t)data->kept * (size_t)data->kept));
  PetscCall(MatDenseRestoreArrayRead(F->schur, &s));
  PetscCall(MatDestroy(&F->schur));
  PetscFunctionReturn(0);
}

/* Lets the factor that a PCCHOLESKY is to make be of single precision; large: if it is large. MatSolverType is LATIN_CHOLESKY */
PetscErrorCode LatinCholeskyRound(PC pc, PetscBool large)
{
  Mat F;

  PetscFunctionBegin;
  PetscCall(PCFactorSetUpMatSolverType(pc));
  PetscCall(PCFactorGetMatrix(pc, &F));
  ((LatinSupernodes *)F->data)->precision = large ? LATIN_BY_SIZE : LATIN_SINGLE;
  PetscFunctionReturn(0);
}

/* The factor of any PC if it is one of this type, else NULL */
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

/* Is it in single precision? */
PetscErrorCode LatinCholeskyRounded(PC pc, PetscBool *rounded)
{
  LatinSupernodes *data;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyFind_Private(pc, &data));
  *rounded = (PetscBool)(data && data->fronts.precision != LATIN_DOUBLE);
  PetscFunctionReturn(0);
}

/* Additions and multiplications that it takes, and its size; 0: it is another one */
PetscErrorCode LatinCholeskyCost(PC pc, PetscReal *operations, PetscReal *bytes)
{
  LatinSupernodes *data;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyFind_Private(pc, &data));
  *operations = data ? (PetscReal)data->fronts.operations : 0.0;
  *bytes      = data ? (PetscReal)data->fronts.panel[data->fronts.fronts] * (data->fronts.precision != LATIN_DOUBLE ? 4.0 : 8.0) : 0.0;
  PetscFunctionReturn(0);
}

/* Makes the factor of A once more, in the next higher precision */
PetscErrorCode LatinCholeskyRefine(PC pc, Mat A)
{
  MatFactorInfo    info;
  LatinSupernodes *data;
  Mat              F;

  PetscFunctionBegin;
  PetscCall(PCFactorGetMatrix(pc, &F));
  data            = (LatinSupernodes *)F->data;
  data->precision = data->fronts.precision - 1;
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorNumeric(F, A, &info));
  PetscFunctionReturn(0);
}

/* ---- the object ---- */

/* Rows that are kept; F->schur is their Schur complement once F is a factor */
static PetscErrorCode LatinCholeskyKeep_Private(Mat F, IS is)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;
  const PetscInt  *rows;

  PetscFunctionBegin;
  PetscCall(ISGetLocalSize(is, &data->kept));
  PetscCall(ISGetIndices(is, &rows));
  PetscCall(PetscArrayzero(data->keep, data->n));
  for (PetscInt k = 0; k < data->kept; k++) data->keep[rows[k]] = PETSC_TRUE;
  PetscCall(ISRestoreIndices(is, &rows));
  PetscCall(PetscFree(data->diagonal));
  PetscCall(PetscMalloc1(data->kept, &data->diagonal));
  PetscCall(MatDestroy(&F->schur));
  PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, data->kept, data->kept, NULL, &F->schur));
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

static PetscErrorCode LatinCholeskyType_Private(Mat F, MatSolverType *type)
{
  PetscFunctionBegin;
  *type = LATIN_CHOLESKY;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyDestroy_Private(Mat F)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyReset_Private(data));
  CHOLMOD(free_factor)(&data->L, &data->common);
  CHOLMOD(finish)(&data->common);
  PetscCall(PetscFree(data->keep));
  PetscCall(PetscFree(data->diagonal));
  PetscCall(PetscObjectComposeFunction((PetscObject)F, "MatFactorGetSolverType_C", NULL));
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
  PetscCall(MatCreate(PETSC_COMM_SELF, &F));
  PetscCall(MatSetSizes(F, n, n, n, n));
  PetscCall(PetscStrallocpy(LATIN_CHOLESKY, &((PetscObject)F)->type_name));
  PetscCall(MatSetUp(F));
  PetscCall(PetscNew(&data));
  PetscCall(PetscCalloc1(n, &data->keep));
  data->n = n;
  CHOLMOD(start)(&data->common);
  data->common.error_handler     = NULL; /* failures are read off */
  data->common.print             = 0;
  data->common.final_ll          = 1;
  F->data                        = data;
  F->ops->choleskyfactorsymbolic = LatinCholeskySymbolic_Private;
  F->ops->solve                  = LatinCholeskySolve_Private;
  F->ops->matsolve               = LatinCholeskyMatSolve_Private;
  F->ops->view                   = LatinCholeskyView_Private;
  F->ops->getinfo                = LatinCholeskyInfo_Private;
  F->ops->destroy                = LatinCholeskyDestroy_Private;
  F->factortype                  = type;
  F->assembled = F->preallocated = PETSC_TRUE;
  PetscCall(PetscFree(F->solvertype));
  PetscCall(PetscStrallocpy(LATIN_CHOLESKY, &F->solvertype));
  PetscCall(PetscObjectComposeFunction((PetscObject)F, "MatFactorGetSolverType_C", LatinCholeskyType_Private));
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
