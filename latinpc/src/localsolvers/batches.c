#include "localsolvers/latinlocalsolvers.h"

/*
   Solvers of the subdomains. In a structure of repeated modules many subdomains have bitwise the same operator: it is
   factored and condensed once, and solved with all their right-hand sides together, which is bound by arithmetic, not by
   memory.
*/

/* Returns the number of consecutive subdomains in a batch from member m on, at most LATIN_BATCH_COLUMNS: their data are columns of one array */
PetscInt LatinBatchRun(const LatinBatch *batch, PetscInt m)
{
  PetscInt n = 1;

  while (n < LATIN_BATCH_COLUMNS && m + n < batch->members && batch->sub[m + n] == batch->sub[m] + n) n++;
  return n;
}

/* Creates a batch for each different operator; pattern[s]: first subdomain with the operator of s. Takes ownership of pattern */
PetscErrorCode LatinBatchesSetUp(const LatinSubdomains *sub, PetscInt pattern[], LatinBatches *batches)
{
  PetscInt *count, *index;

  PetscFunctionBegin;
  batches->pattern = pattern;
  PetscCall(PetscCalloc2(sub->n, &count, sub->n, &index));
  for (PetscInt s = 0; s < sub->n; s++)
    if (!count[pattern[s]]++) index[s] = batches->n++;
  PetscCall(PetscCalloc1(batches->n, &batches->batch));
  for (PetscInt s = 0; s < sub->n; s++) {
    LatinBatch *batch = &batches->batch[index[pattern[s]]];

    if (pattern[s] == s) {
      PetscCall(PetscMalloc1(count[s], &batch->sub));
      batch->rows = sub->bs * (sub->node_offset[s + 1] - sub->node_offset[s]);
    }
    batch->sub[batch->members++] = s;
  }
  PetscCall(PetscFree2(count, index));
  PetscCall(PetscInfo(sub->object, "%" PetscInt_FMT " subdomains here, %" PetscInt_FMT " different operators\n", sub->n, batches->n));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinBatchesReset(LatinBatches *batches)
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < batches->n; b++) PetscCall(PetscFree(batches->batch[b].sub));
  PetscCall(PetscFree(batches->batch));
  PetscCall(PetscFree(batches->pattern));
  batches->n = 0;
  PetscFunctionReturn(0);
}

/* ---- solvers ---- */

/* Allocates the rows of each batch, which the caller fills before LatinLocalSolversSetUp() */
PetscErrorCode LatinLocalSolversCreate(const LatinSubdomains *sub, const LatinBatches *batches, LatinLocalSolvers *solvers)
{
  const PetscInt n = batches->n;

  PetscFunctionBegin;
  solvers->sub     = sub;
  solvers->batches = batches;
  solvers->n       = n;
  PetscCall(PetscCalloc6(n, &solvers->rows, n, &solvers->K, n, &solvers->B, n, &solvers->X, n, &solvers->ksp, n, &solvers->rest));
  PetscFunctionReturn(0);
}

/* Destroys retired solvers that this set-up has not reused */
static PetscErrorCode LatinLocalSolversForget_Private(LatinLocalSolvers *solvers)
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solvers->retired; i++) {
    PetscCall(KSPDestroy(&solvers->before[i].ksp));
    PetscCall(MatDestroy(&solvers->before[i].K));
    PetscCall(ISDestroy(&solvers->before[i].kept));
    PetscCall(LatinSparseReset_Private(&solvers->before[i].rows));
  }
  PetscCall(PetscFree(solvers->before));
  solvers->retired = 0;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLocalSolversDestroy(LatinLocalSolvers *solvers)
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solvers->n; i++) {
    PetscCall(KSPDestroy(&solvers->ksp[i]));
    PetscCall(MatDestroy(&solvers->K[i]));
    PetscCall(MatDestroy(&solvers->B[i]));
    PetscCall(MatDestroy(&solvers->X[i]));
    PetscCall(ISDestroy(&solvers->rest[i]));
    PetscCall(LatinSparseReset_Private(&solvers->rows[i]));
  }
  PetscCall(PetscFree6(solvers->rows, solvers->K, solvers->B, solvers->X, solvers->ksp, solvers->rest));
  solvers->n = 0;
  PetscCall(LatinLocalSolversForget_Private(solvers));
  PetscFunctionReturn(0);
}

/* Retires the matrices and solvers of this set-up for reuse by the next one, and destroys the rest */
PetscErrorCode LatinLocalSolversRetire(LatinLocalSolvers *solvers)
{
  const PetscInt n = solvers->n;
  LatinRetired  *before;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(n, &before));
  for (PetscInt i = 0; i < n; i++) {
    if (!solvers->ksp[i]) continue; /* the set-up failed before this batch */
    before[i] = (LatinRetired){.rows = solvers->rows[i], .K = solvers->K[i], .ksp = solvers->ksp[i], .kept = solvers->rest[i]};
    PetscCall(PetscMemzero(&solvers->rows[i], sizeof(solvers->rows[i])));
    solvers->K[i]    = NULL;
    solvers->ksp[i]  = NULL;
    solvers->rest[i] = NULL;
  }
  PetscCall(LatinLocalSolversDestroy(solvers));
  solvers->before  = before;
  solvers->retired = n;
  PetscFunctionReturn(0);
}

/* Sets solvers->rest[i], the rows of batch i of the Schur complement, which its factor orders last */
static PetscErrorCode LatinLocalKeep_Private(LatinLocalSolvers *solvers, PetscInt i)
{
  const PetscInt s = solvers->batches->batch[i].sub[0], top = solvers->sub->bs * solvers->sub->node_offset[s];
  PetscInt       n, *rows;

  PetscFunctionBegin;
  n = solvers->kept && (!solvers->keeps || solvers->keeps[i]) ? solvers->kept_offset[s + 1] - solvers->kept_offset[s] : 0;
  if (!n) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(n, &rows));
  for (PetscInt k = 0; k < n; k++) rows[k] = solvers->kept[solvers->kept_offset[s] + k] - top;
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, rows, PETSC_OWN_POINTER, &solvers->rest[i]));
  PetscFunctionReturn(0);
}

/* Composes the coordinates of the nodes of a batch on its matrix, for nested dissection */
static PetscErrorCode LatinLocalPlaces_Private(const LatinLocalSolvers *solvers, PetscInt i)
{
  const LatinSubdomains *sub   = solvers->sub;
  const PetscInt         first = sub->node_offset[solvers->batches->batch[i].sub[0]], dim = sub->dim, n = dim * solvers->batches->batch[i].rows / sub->bs;
  PetscScalar           *x;
  Vec                    places;

  PetscFunctionBegin;
  if (!dim || !sub->x) PetscFunctionReturn(0);
  PetscCall(VecCreateSeq(PETSC_COMM_SELF, n, &places));
  PetscCall(VecSetBlockSize(places, dim));
  PetscCall(VecGetArrayWrite(places, &x));
  for (PetscInt k = 0; k < n; k++) x[k] = sub->x[dim * first + k];
  PetscCall(VecRestoreArrayWrite(places, &x));
  PetscCall(PetscObjectCompose((PetscObject)solvers->K[i], LATIN_PLACES, (PetscObject)places));
  PetscCall(VecDestroy(&places));
  PetscFunctionReturn(0);
}

/* Creates the matrix of a batch, and its solver from the options */
static PetscErrorCode LatinLocalCreate_Private(LatinLocalSolvers *solvers, PetscInt i, const char name[], PetscBool once)
{
  const LatinSparse *rows  = &solvers->rows[i];
  PetscObject        order = NULL;
  PC                 pc;
  Mat                F;

  PetscFunctionBegin;
  PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, rows->rows, rows->rows, rows->i, rows->j, rows->a, &solvers->K[i]));
  PetscCall(MatSetOption(solvers->K[i], MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(solvers->K[i], MAT_SPD, PETSC_TRUE));
  if (solvers->like) PetscCall(PetscObjectQuery((PetscObject)solvers->like->K[i], LATIN_ORDER, &order));
  if (order) PetscCall(PetscObjectCompose((PetscObject)solvers->K[i], LATIN_ORDER, order));
  else PetscCall(LatinLocalPlaces_Private(solvers, i));
  PetscCall(LatinSolverCreate_Private(PETSC_COMM_SELF, solvers->sub->object, name, &solvers->ksp[i]));
  PetscCall(KSPGetPC(solvers->ksp[i], &pc));
  PetscCall(LatinDirectSolver_Private(pc, solvers->K[i], LATIN_CHOLESKY));
  PetscCall(KSPSetOperators(solvers->ksp[i], solvers->K[i], solvers->K[i]));
  PetscCall(KSPSetFromOptions(solvers->ksp[i]));
  PetscCall(LatinSolverDefaults_Private(solvers->ksp[i], once));
  PetscCall(MatSetBlockSize(solvers->K[i], solvers->sub->bs));
  if (!solvers->rest[i]) PetscFunctionReturn(0);
  PetscCall(PCFactorSetUpMatSolverType(pc));
  PetscCall(PCFactorGetMatrix(pc, &F));
  PetscCall(MatFactorSetSchurIS(F, solvers->rest[i]));
  PetscCall(LatinCholeskySetLower(F));
  PetscFunctionReturn(0);
}

/* Passes the callback of the owner of the entries to the factor of a batch with a Schur complement */
static PetscErrorCode LatinLocalCallback_Private(LatinLocalSolvers *solvers, PetscInt i)
{
  PC  pc;
  Mat F;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(solvers->ksp[i], &pc));
  PetscCall(PCFactorGetMatrix(pc, &F));
  PetscCall(LatinCholeskySetCallback(F, solvers->callback));
  PetscFunctionReturn(0);
}

/*
   Gets a precision of the factor of batch i that needs no test, nor the matrix a search for mechanisms. *accepted: there is one, lowest. Any precision
   suffices to precondition Newton's method; without the clamped rows, the matrix of solvers->like is softer
*/
static PetscErrorCode LatinLocalAccepted_Private(const LatinLocalSolvers *solvers, PetscInt i, LatinArithmetic *lowest, PetscBool *accepted)
{
  const PetscBool tangent = LatinSubdomainsTangent(solvers->sub);
  PC              pc;

  PetscFunctionBegin;
  *lowest   = LATIN_SINGLE;
  *accepted = (PetscBool)(tangent || (solvers->like && solvers->like->direct));
  if (tangent || !*accepted) PetscFunctionReturn(0);
  PetscCall(KSPGetPC(solvers->like->ksp[i], &pc));
  PetscCall(LatinCholeskyPrecision(pc, lowest));
  PetscFunctionReturn(0);
}

/*
   Creates or reuses matrices and solvers, and factors them. name: "local" or "interior", the prefix of the options; once: a preconditioner that is not
   a factorisation is applied once. solvers->status: a failure on this rank
*/
PetscErrorCode LatinLocalSolversSetUp(LatinLocalSolvers *solvers, const char name[], PetscBool once)
{
  const LatinArithmetic precision[] = {LATIN_DOUBLE, LATIN_SINGLE, LATIN_BY_SIZE}; /* of a LatinPrecision */

  PetscFunctionBegin;
  solvers->direct   = PETSC_TRUE;
  solvers->rounding = 0.0;
  PetscCall(PetscMemzero(&solvers->status, sizeof(solvers->status)));
  solvers->status.staged = (PetscBool)!solvers->keeps;
  solvers->status.tried  = LatinSubdomainsTried(solvers->sub);
  for (PetscInt i = 0; i < solvers->n && !LatinFactorFailed(&solvers->status); i++) {
    LatinArithmetic lowest;
    PetscBool       found, accepted;
    PC              pc;

    if (!solvers->rows[i].i) continue; /* no solver: the caller uses a dense inverse */
    PetscCall(LatinLocalKeep_Private(solvers, i));
    PetscCall(LatinLocalSolversRecall_Private(solvers, i, &found));
    if (!found) PetscCall(LatinLocalCreate_Private(solvers, i, name, once));
    if (solvers->rest[i]) PetscCall(LatinLocalCallback_Private(solvers, i));
    PetscCall(LatinLocalAccepted_Private(solvers, i, &lowest, &accepted));
    PetscCall(KSPGetPC(solvers->ksp[i], &pc));
    if (found || solvers->precision != LATIN_PRECISION_DOUBLE) PetscCall(LatinCholeskyRound(pc, precision[solvers->precision]));
    PetscCall(LatinFactor_Private(solvers->ksp[i], solvers->K[i], solvers->rest[i], NULL, accepted ? &lowest : NULL, &solvers->status));
    PetscCall(PetscObjectCompose((PetscObject)solvers->K[i], LATIN_PLACES, NULL));
    solvers->rounding = PetscMax(solvers->rounding, solvers->status.rounding);
    solvers->last     = i;
    PetscCall(LatinSolverDirect_Private(solvers->ksp[i], &solvers->direct));
  }
  PetscCall(LatinLocalSolversForget_Private(solvers));
  PetscFunctionReturn(0);
}

/*
   Factors again: all batches, as their Schur complements have been given away; those of the lowest precision of any rank in the next higher one.
   solvers->status: a failure on this rank. Collective on sub->object
*/
PetscErrorCode LatinLocalSolversRefine(LatinLocalSolvers *solvers)
{
  PetscMPIInt lowest = LATIN_DOUBLE;
  PC          pc;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < solvers->n; i++) {
    LatinArithmetic precision;

    PetscCall(KSPGetPC(solvers->ksp[i], &pc));
    PetscCall(LatinCholeskyPrecision(pc, &precision));
    lowest = PetscMax(lowest, (PetscMPIInt)precision);
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &lowest, 1, MPI_INT, MPI_MAX, PetscObjectComm(solvers->sub->object)));
  solvers->rounding = 0.0;
  for (PetscInt i = 0; i < solvers->n && !LatinFactorFailed(&solvers->status); i++) {
    PetscCall(LatinFactorRefine_Private(solvers->ksp[i], solvers->K[i], solvers->rest[i], (LatinArithmetic)lowest, &solvers->status));
    solvers->rounding = PetscMax(solvers->rounding, solvers->status.rounding);
    solvers->last     = i;
  }
  PetscFunctionReturn(0);
}

/* Computes U = K^-1 g on the copies of the subdomains of batch i */
PetscErrorCode LatinLocalSolve_Private(LatinLocalSolvers *solvers, PetscInt i, const PetscReal g[], PetscReal U[])
{
  const LatinSubdomains *sub     = solvers->sub;
  const LatinBatch      *batch   = &solvers->batches->batch[i];
  const PetscInt         columns = PetscMin(batch->members, LATIN_BATCH_COLUMNS);
  const size_t           rows    = (size_t)batch->rows;
  PetscScalar           *b;
  const PetscScalar     *x;

  PetscFunctionBegin;
  if (!solvers->B[i]) {
    PetscCall(LatinDenseCreate_Private(batch->rows, columns, &solvers->B[i]));
    PetscCall(LatinDenseCreate_Private(batch->rows, columns, &solvers->X[i]));
  }
  for (PetscInt first = 0; first < batch->members; first += columns) {
    const PetscInt last = PetscMin(first + columns, batch->members);

    PetscCall(MatDenseGetArray(solvers->B[i], &b));
    for (PetscInt m = first; m < last; m++) PetscCall(PetscArraycpy(b + rows * (size_t)(m - first), g + sub->bs * sub->node_offset[batch->sub[m]], rows));
    PetscCall(MatDenseRestoreArray(solvers->B[i], &b));
    PetscCall(KSPMatSolve(solvers->ksp[i], solvers->B[i], solvers->X[i]));
    PetscCall(LatinSolverNote_Private(solvers->ksp[i], sub->preconditions, &solvers->failed));
    PetscCall(MatDenseGetArrayRead(solvers->X[i], &x));
    for (PetscInt m = first; m < last; m++) PetscCall(PetscArraycpy(U + sub->bs * sub->node_offset[batch->sub[m]], x + rows * (size_t)(m - first), rows));
    PetscCall(MatDenseRestoreArrayRead(solvers->X[i], &x));
  }
  PetscFunctionReturn(0);
}

/* Computes U = K^-1 g for all subdomains on this rank */
PetscErrorCode LatinLocalSolveAll(LatinLocalSolvers *solvers, const PetscReal g[], PetscReal U[])
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solvers->n; i++) PetscCall(LatinLocalSolve_Private(solvers, i, g, U));
  PetscFunctionReturn(0);
}
