#include "localsolvers/latinlocalsolvers.h"

/*
   The MatSolverType LATIN_CHOLESKY of sequential matrices: CHOLMOD's supernodal Cholesky, which PETSc has too, with what
   it lacks: the nodes are ordered, not the degrees of freedom; some rows may be kept to the last (MatFactorSetSchurIS()),
   and give their Schur complement; the solve comes in its two halves as well, with the kept rows between them. One
   elimination of the inside of a subdomain so serves all that is done on its interfaces.

   MatSolve() where rows are kept: their couplings are left out, they have their diagonal alone.
*/

#if LATIN_CHOLMOD

  #include <petsc/private/matimpl.h>
  #include <cholmod.h>
  #if defined(_OPENMP)
    #include <omp.h>
  #endif

  #if defined(PETSC_USE_64BIT_INDICES)
    #define CHOLMOD(name)  cholmod_l_##name
    #define CHOLMOD_NUMBER CHOLMOD_LONG
  #else
    #define CHOLMOD(name)  cholmod_##name
    #define CHOLMOD_NUMBER CHOLMOD_INT
  #endif

  #define LATIN_CHOLESKY_FULL 0.25 /* share of entries from which no order is looked for */

typedef struct {
  cholmod_common  common;
  cholmod_factor *L;
  cholmod_dense  *X, *E;    /* work: right-hand sides in the order of elimination, and what the kernels ask for */
  PetscInt        n, kept;  /* the last rows in the order of elimination are kept */
  PetscBool      *keep;     /* [n] */
  PetscReal      *diagonal; /* [kept] of the matrix */
} LatinSupernodes;

/* A symmetric matrix as CHOLMOD sees it: of both triangles it reads one */
static void LatinCholeskyWrap(PetscInt n, const PetscInt i[], const PetscInt j[], const PetscScalar a[], cholmod_sparse *A)
{
  *A = (cholmod_sparse){.nrow   = (size_t)n,
                        .ncol   = (size_t)n,
                        .nzmax  = (size_t)i[n],
                        .p      = (void *)i,
                        .i      = (void *)j,
                        .x      = (void *)a,
                        .stype  = 1,
                        .itype  = CHOLMOD_NUMBER,
                        .xtype  = a ? CHOLMOD_REAL : CHOLMOD_PATTERN,
                        .dtype  = CHOLMOD_DOUBLE,
                        .packed = 1};
}

/* The supernodes for an order of elimination; without one, for minimum degree, or, of a matrix that is nearly full, for the order as it is */
static PetscErrorCode LatinCholeskyAnalyze_Private(LatinSupernodes *data, cholmod_sparse *A, PetscInt order[], PetscBool postorder)
{
  cholmod_common *common = &data->common;

  PetscFunctionBegin;
  common->nmethods           = 1;
  common->method[0].ordering = order ? CHOLMOD_GIVEN : (double)A->nzmax > LATIN_CHOLESKY_FULL * (double)A->nrow * (double)A->ncol ? CHOLMOD_NATURAL : CHOLMOD_AMD;
  common->postorder          = postorder;
  common->supernodal         = postorder && data->kept ? CHOLMOD_SIMPLICIAL : CHOLMOD_SUPERNODAL;
  data->L                    = CHOLMOD(analyze_p)(A, order, NULL, 0, common);
  PetscCheck(data->L, PETSC_COMM_SELF, PETSC_ERR_LIB, "CHOLMOD could not analyse a matrix of %" PetscInt_FMT " rows (status %d)", data->n, common->status);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyNumeric_Private(Mat F, Mat A, const MatFactorInfo *info);

static PetscErrorCode LatinCholeskySymbolic_Private(Mat F, Mat A, IS perm, const MatFactorInfo *info)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;
  const PetscInt  *i, *j;
  PetscInt         n, bs, *order = NULL;
  PetscBool        done;
  cholmod_sparse   pattern;

  PetscFunctionBegin;
  PetscCall(MatGetBlockSize(A, &bs));
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Factorisation %s needs a matrix of type seqaij", LATIN_CHOLESKY);
  LatinCholeskyWrap(n, i, j, NULL, &pattern);
  PetscCall(CHOLMOD(free_factor)(&data->L, &data->common) ? 0 : PETSC_ERR_LIB);
  if (data->kept || (n > LATIN_LARGE && i[n] < LATIN_CHOLESKY_FULL * n * n)) {
    PetscCall(PetscMalloc1(n, &order));
    PetscCall(LatinOrderNodes_Private(bs, n, i, j, data->keep, order));
  }
  PetscCall(LatinCholeskyAnalyze_Private(data, &pattern, order, PETSC_TRUE));
  if (data->kept) { /* postorder moves what is kept: its rows go back to the end, each after those that it depends on as before */
    const PetscInt *post = (const PetscInt *)data->L->Perm;
    PetscInt        at   = 0;

    for (PetscInt r = 0; r < n; r++)
      if (!data->keep[post[r]]) order[at++] = post[r];
    for (PetscInt r = 0; r < n; r++)
      if (data->keep[r]) order[at++] = r;
    PetscCall(CHOLMOD(free_factor)(&data->L, &data->common) ? 0 : PETSC_ERR_LIB);
    PetscCall(LatinCholeskyAnalyze_Private(data, &pattern, order, PETSC_FALSE));
  }
  PetscCall(PetscFree(order));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  F->ops->choleskyfactornumeric = LatinCholeskyNumeric_Private;
  PetscFunctionReturn(0);
}

/* One supernode's part of the factor of the kept rows goes to T (kept x kept), and becomes that of the identity */
static void LatinCholeskyTake(LatinSupernodes *data, size_t supernode, PetscReal T[])
{
  const cholmod_factor *L     = data->L;
  const PetscInt       *super = (const PetscInt *)L->super, *pi = (const PetscInt *)L->pi, *px = (const PetscInt *)L->px, *rows = (const PetscInt *)L->s + pi[supernode];
  const PetscInt        inside = data->n - data->kept, height = pi[supernode + 1] - pi[supernode];
  PetscReal            *x = (PetscReal *)L->x + px[supernode];

  for (PetscInt column = PetscMax(super[supernode], inside); column < super[supernode + 1]; column++)
    for (PetscInt i = column - super[supernode]; i < height; i++) {
      PetscReal *entry = x + i + (size_t)height * (size_t)(column - super[supernode]);

      T[(size_t)(rows[i] - inside) + (size_t)data->kept * (size_t)(column - inside)] = *entry;
      *entry                                                                         = rows[i] == column ? 1.0 : 0.0;
    }
}

/* The Schur complement T T^t of the kept rows, less what their diagonal was made larger by. What is left of the factor are the other rows */
static PetscErrorCode LatinCholeskySchur_Private(Mat F)
{
  LatinSupernodes  *data = (LatinSupernodes *)F->data;
  const PetscScalar one = 1.0, zero = 0.0;
  const PetscInt    m = data->kept;
  PetscBLASInt      bm;
  PetscReal        *T;
  PetscScalar      *S;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(m, &bm));
  if (!F->schur) PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, m, m, NULL, &F->schur)); /* given away */
  PetscCall(PetscCalloc1((size_t)m * (size_t)m, &T));
  for (size_t s = 0; s < data->L->nsuper; s++)
    if (((const PetscInt *)data->L->super)[s + 1] > data->n - m) LatinCholeskyTake(data, s, T);
  PetscCall(MatDenseGetArray(F->schur, &S));
  PetscCallBLAS("BLASsyrk", BLASsyrk_("L", "N", &bm, &bm, &one, T, &bm, &zero, S, &bm));
  for (PetscInt j = 0; j < m; j++) {
    S[(size_t)j * (size_t)(m + 1)] -= data->diagonal[j];
    for (PetscInt i = 0; i < j; i++) S[(size_t)i + (size_t)m * (size_t)j] = S[(size_t)j + (size_t)m * (size_t)i];
  }
  PetscCall(MatDenseRestoreArray(F->schur, &S));
  PetscCall(PetscFree(T));
  PetscFunctionReturn(0);
}

/*
   The values, on the one core of the rank: CHOLMOD starts four threads whatever OMP_NUM_THREADS says, and on two cores they
   take twice the time of one, most of it waiting for each other (tensegrity-grid 100, network 20000)
*/
static PetscErrorCode LatinCholeskyFactorize_Private(LatinSupernodes *data, PetscInt i[], PetscInt j[], PetscScalar a[])
{
  cholmod_sparse A;
  #if defined(_OPENMP)
  const int levels = omp_get_max_active_levels();

  omp_set_max_active_levels(0);
  #endif
  LatinCholeskyWrap(data->n, i, j, a, &A);
  CHOLMOD(factorize)(&A, data->L, &data->common);
  #if defined(_OPENMP)
  omp_set_max_active_levels(levels);
  #endif
  return 0;
}

static PetscErrorCode LatinCholeskyNumeric_Private(Mat F, Mat A, const MatFactorInfo *info)
{
  LatinSupernodes   *data = (LatinSupernodes *)F->data;
  const PetscInt    *i, *j;
  const PetscScalar *values;
  PetscScalar       *a = NULL;
  PetscInt           n;
  PetscBool          done;

  PetscFunctionBegin;
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscCall(MatSeqAIJGetArrayRead(A, &values));
  if (data->kept) { /* twice the diagonal on the kept rows, so that a floating subdomain has a factor as well */
    PetscCall(PetscMalloc1(i[n], &a));
    PetscCall(PetscArraycpy(a, values, i[n]));
    for (PetscInt r = 0, at = 0; r < n; r++) {
      if (!data->keep[r]) continue;
      data->diagonal[at] = 1.0;
      for (PetscInt k = i[r]; k < i[r + 1]; k++) {
        if (j[k] != r) continue;
        if (a[k] > 0.0) data->diagonal[at] = a[k];
        a[k] += data->diagonal[at];
      }
      at++;
    }
  }
  PetscCall(LatinCholeskyFactorize_Private(data, (PetscInt *)i, (PetscInt *)j, a ? a : (PetscScalar *)values));
  PetscCall(PetscFree(a));
  PetscCall(MatSeqAIJRestoreArrayRead(A, &values));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  F->factorerrortype = data->common.status == CHOLMOD_OUT_OF_MEMORY || data->common.status == CHOLMOD_TOO_LARGE ? MAT_FACTOR_OUTMEMORY : data->L->minor < (size_t)data->n ? MAT_FACTOR_NUMERIC_ZEROPIVOT : MAT_FACTOR_NOERROR;
  if (F->factorerrortype) PetscFunctionReturn(0);
  PetscCall(PetscLogFlops(data->common.fl));
  if (data->kept) PetscCall(LatinCholeskySchur_Private(F));
  PetscCall(CHOLMOD(free_dense)(&data->X, &data->common) ? 0 : PETSC_ERR_LIB);
  PetscCall(CHOLMOD(free_dense)(&data->E, &data->common) ? 0 : PETSC_ERR_LIB);
  PetscFunctionReturn(0);
}

/* ---- solves ---- */

/* Room for so many right-hand sides */
static PetscErrorCode LatinCholeskyRoom_Private(LatinSupernodes *data, PetscInt columns)
{
  cholmod_common *common = &data->common;

  PetscFunctionBegin;
  if (data->X && data->X->ncol >= (size_t)columns) PetscFunctionReturn(0);
  PetscCall(CHOLMOD(free_dense)(&data->X, common) ? 0 : PETSC_ERR_LIB);
  PetscCall(CHOLMOD(free_dense)(&data->E, common) ? 0 : PETSC_ERR_LIB);
  data->X = CHOLMOD(allocate_dense)((size_t)data->n, (size_t)columns, (size_t)data->n, CHOLMOD_REAL, common);
  data->E = CHOLMOD(allocate_dense)(data->L->maxesize, (size_t)columns, data->L->maxesize, CHOLMOD_REAL, common);
  PetscCheck(data->X && data->E, PETSC_COMM_SELF, PETSC_ERR_MEM, "No memory for %" PetscInt_FMT " right-hand sides of %" PetscInt_FMT " rows", columns, data->n);
  PetscFunctionReturn(0);
}

/* Columns of b, ld apart, to or from the order of elimination */
static void LatinCholeskyOrder(LatinSupernodes *data, PetscBool to, PetscInt columns, PetscReal b[], size_t ld)
{
  const PetscInt *order = (const PetscInt *)data->L->Perm;

  for (PetscInt c = 0; c < columns; c++) {
    PetscReal *x = (PetscReal *)data->X->x + (size_t)data->n * (size_t)c, *y = b + ld * (size_t)c;

    if (to)
      for (PetscInt r = 0; r < data->n; r++) x[r] = y[order[r]];
    else
      for (PetscInt r = 0; r < data->n; r++) y[order[r]] = x[r];
  }
}

/* One half of the solve on the first columns of X */
static PetscErrorCode LatinCholeskyHalf_Private(LatinSupernodes *data, PetscBool forward, PetscInt columns)
{
  cholmod_dense X = *data->X, E = *data->E;

  PetscFunctionBegin;
  X.ncol = E.ncol = (size_t)columns;
  PetscCall(PetscLogFlops(2.0 * (double)data->L->xsize * columns));
  if (data->n) PetscCall((forward ? CHOLMOD(super_lsolve)(data->L, &X, &E, &data->common) : CHOLMOD(super_ltsolve)(data->L, &X, &E, &data->common)) ? 0 : PETSC_ERR_LIB);
  PetscFunctionReturn(0);
}

/* X = A^-1 B for columns, ld apart, in place */
static PetscErrorCode LatinCholeskyColumns_Private(Mat F, PetscInt columns, PetscReal b[], size_t ld)
{
  LatinSupernodes *data   = (LatinSupernodes *)F->data;
  const PetscInt   inside = data->n - data->kept;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyRoom_Private(data, PetscMin(columns, LATIN_BATCH_COLUMNS)));
  for (PetscInt first = 0; first < columns; first += LATIN_BATCH_COLUMNS) {
    const PetscInt some = PetscMin(columns - first, LATIN_BATCH_COLUMNS);
    PetscReal     *part = b + ld * (size_t)first, *X = (PetscReal *)data->X->x;

    if (data->kept) {
      for (PetscInt c = 0; c < some; c++)
        for (PetscInt r = 0, at = 0; r < data->n; r++)
          if (data->keep[r]) part[(size_t)r + ld * (size_t)c] /= data->diagonal[at++];
    }
    LatinCholeskyOrder(data, PETSC_TRUE, some, part, ld);
    PetscCall(LatinCholeskyHalf_Private(data, PETSC_TRUE, some));
    for (PetscInt c = 0; c < some && data->kept; c++) PetscCall(PetscArrayzero(X + (size_t)data->n * (size_t)c + inside, data->kept));
    PetscCall(LatinCholeskyHalf_Private(data, PETSC_FALSE, some));
    for (PetscInt c = 0; c < some && data->kept; c++) {
      const PetscInt *order = (const PetscInt *)data->L->Perm;

      for (PetscInt k = inside; k < data->n; k++) X[(size_t)k + (size_t)data->n * (size_t)c] = part[(size_t)order[k] + ld * (size_t)c];
    }
    LatinCholeskyOrder(data, PETSC_FALSE, some, part, ld);
  }
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

static PetscErrorCode LatinCholeskyInPlace_Private(Mat F, PetscBool forward, PetscReal g[])
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyRoom_Private(data, 1));
  LatinCholeskyOrder(data, PETSC_TRUE, 1, g, 0);
  PetscCall(LatinCholeskyHalf_Private(data, forward, 1));
  LatinCholeskyOrder(data, PETSC_FALSE, 1, g, 0);
  PetscFunctionReturn(0);
}

/* The first half, in place: the forces g of all rows become those on the kept rows, and what the second half needs on the others */
PetscErrorCode LatinCholeskyForward(Mat F, PetscReal g[])
{
  PetscFunctionBegin;
  PetscCall(LatinCholeskyInPlace_Private(F, PETSC_TRUE, g));
  PetscFunctionReturn(0);
}

/* The second: g, with the displacements of the kept rows in their places, becomes those of all rows */
PetscErrorCode LatinCholeskyBackward(Mat F, PetscReal g[])
{
  PetscFunctionBegin;
  PetscCall(LatinCholeskyInPlace_Private(F, PETSC_FALSE, g));
  PetscFunctionReturn(0);
}

/* Hands the Schur complement over: it may be as large as the factor, and is used once */
PetscErrorCode LatinCholeskyGiveSchur(Mat F, Mat *S)
{
  PetscFunctionBegin;
  *S       = F->schur;
  F->schur = NULL;
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
  if (ascii && data->L) PetscCall(PetscViewerASCIIPrintf(viewer, "  CHOLMOD, supernodal: %g entries, %g operations\n", data->L->is_super ? (double)data->L->xsize : 0.0, data->common.fl));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCholeskyInfo_Private(Mat F, MatInfoType flag, MatInfo *info)
{
  LatinSupernodes *data = (LatinSupernodes *)F->data;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(info, sizeof(*info)));
  info->block_size   = 1.0;
  info->nz_allocated = info->nz_used = data->L ? (PetscLogDouble)data->L->xsize : 0.0;
  info->memory                       = 8.0 * info->nz_used;
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
  CHOLMOD(free_factor)(&data->L, &data->common);
  CHOLMOD(free_dense)(&data->X, &data->common);
  CHOLMOD(free_dense)(&data->E, &data->common);
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

#else

/* This PETSc has no CHOLMOD: MatGetFactorAvailable() says so of the type */
PetscErrorCode LatinCholeskyRegister(void)
{
  return 0;
}

PetscErrorCode LatinCholeskyForward(Mat F, PetscReal g[])
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyGiveSchur(Mat F, Mat *S)
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

PetscErrorCode LatinCholeskyBackward(Mat F, PetscReal g[])
{
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_PLIB, "No factor of this type can have been made");
}

#endif
