#include "localsolvers/latinlocalsolvers.h"

/*
   Symbolic analysis of a sparse matrix, by CHOLMOD, if possible of the graph of nodes, which has up to bs^2 times fewer entries than that of the rows:

   1. The kept rows.
   2. The order of elimination (localsolvers/ordering.c), kept rows at its end.
   3. The supernodes, which become fronts (localsolvers/fronts.c).
*/

#if LATIN_CHOLMOD

  #include "localsolvers/supernodes.h"

  #define LATIN_CHOLESKY_FULL 0.25 /* share of nonzero entries from which a factor is full, whatever the order: none is computed */
  /*
     entries relative to those of bs fields apart from each other, from which elimination fills the blocks of nodes, which are then analysed as wholes.
     Structures: 1.2 (lattice), 1.5 (grid) to 3 (network)
  */
  #define LATIN_CHOLESKY_COUPLED 1.1

/* Wraps the pattern of a symmetric matrix for CHOLMOD, which reads one of both triangles */
static void LatinCholeskyWrap(PetscInt n, const PetscInt i[], const PetscInt j[], cholmod_sparse *A)
{
  *A = (cholmod_sparse){.nrow = (size_t)n, .ncol = (size_t)n, .nzmax = (size_t)i[n], .p = (void *)i, .i = (void *)j, .stype = 1, .itype = CHOLMOD_NUMBER, .xtype = CHOLMOD_PATTERN, .dtype = CHOLMOD_DOUBLE, .packed = 1};
}

/* Analyses A for an order of elimination; NULL: for the natural order. Sets data->L */
static PetscErrorCode LatinCholeskyAnalyze_Private(LatinSupernodes *data, cholmod_sparse *A, PetscInt order[], PetscBool postorder)
{
  cholmod_common *common = &data->common;

  PetscFunctionBegin;
  PetscCall(CHOLMOD(free_factor)(&data->L, &data->common) ? 0 : PETSC_ERR_LIB);
  common->nmethods           = 1;
  common->method[0].ordering = order ? CHOLMOD_GIVEN : CHOLMOD_NATURAL;
  common->postorder          = postorder;
  common->supernodal         = postorder && data->kept ? CHOLMOD_SIMPLICIAL : CHOLMOD_SUPERNODAL;
  data->L                    = CHOLMOD(analyze_p)(A, order, NULL, 0, common);
  PetscCheck(data->L, PETSC_COMM_SELF, PETSC_ERR_LIB, "CHOLMOD could not analyse a matrix of %" PetscInt_FMT " rows (status %d)", data->n, common->status);
  PetscFunctionReturn(0);
}

/* Finds the supernodes for an order of elimination with the kept rows, or nodes, at the end. keep: NULL, or whether each is kept. Overwrites order */
static PetscErrorCode LatinCholeskySupernodes_Private(LatinSupernodes *data, cholmod_sparse *A, const PetscBool keep[], PetscInt order[])
{
  const PetscInt *post, n = (PetscInt)A->nrow;
  PetscInt        at = 0;

  PetscFunctionBegin;
  PetscCall(LatinCholeskyAnalyze_Private(data, A, order, PETSC_TRUE));
  if (!keep) PetscFunctionReturn(0);
  /* postorder moves kept rows: they go back to the end, each after those on which it depends */
  post = (const PetscInt *)data->L->Perm;
  for (PetscInt r = 0; r < n; r++)
    if (!keep[post[r]]) order[at++] = post[r];
  for (PetscInt r = 0; r < n; r++)
    if (keep[r]) order[at++] = r;
  PetscCall(LatinCholeskyAnalyze_Private(data, A, order, PETSC_FALSE));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSupernodesReset(LatinSupernodes *data)
{
  PetscFunctionBegin;
  PetscCall(LatinFrontsDestroy(&data->fronts));
  PetscCall(PetscFree4(data->order, data->first, data->begin, data->row));
  PetscFunctionReturn(0);
}

/* Creates the fronts from the supernodes data->L, whose columns are nodes of bs rows each. Frees data->L */
static PetscErrorCode LatinCholeskyFronts_Private(LatinSupernodes *data, PetscInt bs)
{
  const PetscInt *super = (const PetscInt *)data->L->super, *begin = (const PetscInt *)data->L->pi, fronts = (PetscInt)data->L->nsuper, entries = begin[fronts];
  const PetscInt *perm = (const PetscInt *)data->L->Perm, *row = (const PetscInt *)data->L->s;

  PetscFunctionBegin;
  PetscCall(LatinSupernodesReset(data));
  PetscCall(PetscMalloc4(data->n, &data->order, fronts + 1, &data->first, fronts + 1, &data->begin, bs * entries, &data->row));
  for (PetscInt r = 0; r < data->n; r++) data->order[r] = bs * perm[r / bs] + r % bs;
  for (PetscInt f = 0; f <= fronts; f++) {
    data->first[f] = bs * super[f];
    data->begin[f] = bs * begin[f];
  }
  for (PetscInt r = 0; r < bs * entries; r++) data->row[r] = bs * row[r / bs] + r % bs;
  PetscCall(CHOLMOD(free_factor)(&data->L, &data->common) ? 0 : PETSC_ERR_LIB);
  PetscCall(CHOLMOD(free_work)(&data->common) ? 0 : PETSC_ERR_LIB);
  PetscCall(LatinFrontsCreate(data->n, data->kept, fronts, data->order, data->first, data->begin, data->row, &data->fronts));
  PetscFunctionReturn(0);
}

/* Analyses the graph of the nodes, if elimination couples all unknowns of two nodes (*done); else nothing. Overwrites order */
static PetscErrorCode LatinCholeskyNodes_Private(LatinSupernodes *data, PetscInt bs, const PetscInt i[], const PetscInt j[], PetscInt order[], PetscBool *done)
{
  const PetscInt nodes = data->n / bs;
  size_t         relaxed[3];
  PetscInt      *first, *list;
  PetscBool     *keep;
  cholmod_sparse pattern;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(nodes + 1, &first, nodes, &keep));
  PetscCall(LatinOrderingNodes_Private(bs, nodes, i, j, first, &list));
  *done = (PetscBool)(i[data->n] > LATIN_CHOLESKY_COUPLED * bs * first[nodes]);
  if (*done) {
    for (PetscInt k = 0; k < nodes; k++) {
      order[k] = order[bs * k] / bs;
      keep[k]  = data->keep[bs * k];
    }
    for (PetscInt k = 0; k < 3; k++) {
      relaxed[k]             = data->common.nrelax[k];
      data->common.nrelax[k] = relaxed[k] / (size_t)bs; /* numbers of columns, which are nodes here */
    }
    LatinCholeskyWrap(nodes, first, list, &pattern);
    PetscCall(LatinCholeskySupernodes_Private(data, &pattern, data->kept ? keep : NULL, order));
    for (PetscInt k = 0; k < 3; k++) data->common.nrelax[k] = relaxed[k];
    PetscCall(LatinCholeskyFronts_Private(data, bs));
  }
  PetscCall(PetscFree2(first, keep));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(0);
}

/* Analyses the rows. order: NULL, or an order of elimination with kept rows at the end; overwritten */
static PetscErrorCode LatinCholeskyRows_Private(LatinSupernodes *data, const PetscInt i[], const PetscInt j[], PetscInt order[])
{
  cholmod_sparse pattern;

  PetscFunctionBegin;
  LatinCholeskyWrap(data->n, i, j, &pattern);
  PetscCall(LatinCholeskySupernodes_Private(data, &pattern, data->kept ? data->keep : NULL, order));
  PetscCall(LatinCholeskyFronts_Private(data, 1));
  PetscFunctionReturn(0);
}

/*
   Creates an order of elimination *order[n], composed on the matrix, or copies the one composed on it; NULL if the matrix is nearly full. The caller
   frees it
*/
static PetscErrorCode LatinCholeskyOrder_Private(const LatinSupernodes *data, Mat A, PetscInt n, const PetscInt i[], const PetscInt j[], PetscInt **order)
{
  const PetscInt *before;
  IS              is;

  PetscFunctionBegin;
  *order = NULL;
  if (!data->kept && i[n] >= LATIN_CHOLESKY_FULL * n * n) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(n, order));
  PetscCall(PetscObjectQuery((PetscObject)A, LATIN_ORDER, (PetscObject *)&is));
  if (is && !data->kept) {
    PetscCall(ISGetIndices(is, &before));
    PetscCall(PetscArraycpy(*order, before, n));
    PetscCall(ISRestoreIndices(is, &before));
    PetscFunctionReturn(0);
  }
  PetscCall(LatinOrderNodes_Private(A, n, i, j, data->keep, *order));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, *order, PETSC_COPY_VALUES, &is));
  PetscCall(PetscObjectCompose((PetscObject)A, LATIN_ORDER, (PetscObject)is));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(0);
}

/*
   Marks the kept rows: the requested ones, and those of their nodes that are coupled to nothing, as prescribed displacements are. *whole: whether each
   node of bs rows is then kept as a whole, or not at all
*/
static PetscErrorCode LatinCholeskyKept_Private(LatinSupernodes *data, PetscInt bs, const PetscInt i[], const PetscInt j[], PetscBool *whole)
{
  PetscFunctionBegin;
  *whole     = PETSC_TRUE;
  data->kept = data->schur_rows;
  PetscCall(PetscArrayzero(data->keep, data->n));
  for (PetscInt k = 0; k < data->schur_rows; k++) data->keep[data->schur_row[k]] = PETSC_TRUE;
  for (PetscInt k = 0; k < data->schur_rows; k++)
    for (PetscInt node = data->schur_row[k] / bs, r = bs * node; r < bs * (node + 1); r++) {
      if (data->keep[r]) continue;
      if (i[r + 1] - i[r] > 1 || (i[r + 1] > i[r] && j[i[r]] != r)) *whole = PETSC_FALSE;
      else {
        data->keep[r] = PETSC_TRUE;
        data->kept++;
      }
    }
  PetscCall(PetscFree(data->diagonal));
  PetscCall(PetscMalloc1(data->kept, &data->diagonal));
  PetscFunctionReturn(0);
}

/* Computes the fronts of the factor of A, for the requested rows of the Schur complement */
PetscErrorCode LatinSupernodesAnalyze(LatinSupernodes *data, Mat A)
{
  const PetscInt *i, *j;
  PetscInt        n, bs, *order;
  PetscBool       done, whole, nodes = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(MatGetRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "Factorisation %s needs a matrix of type seqaij", LATIN_CHOLESKY);
  PetscCall(MatGetBlockSize(A, &bs));
  PetscCall(LatinCholeskyKept_Private(data, bs, i, j, &whole));
  PetscCall(LatinCholeskyOrder_Private(data, A, n, i, j, &order));
  if (order && whole && bs > 1) PetscCall(LatinCholeskyNodes_Private(data, bs, i, j, order, &nodes));
  if (!nodes) PetscCall(LatinCholeskyRows_Private(data, i, j, order));
  PetscCall(PetscFree(order));
  PetscCall(MatRestoreRowIJ(A, 0, PETSC_FALSE, PETSC_FALSE, &n, &i, &j, &done));
  PetscFunctionReturn(0);
}

#endif
