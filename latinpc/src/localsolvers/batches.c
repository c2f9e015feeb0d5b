#include "localsolvers/latinlocalsolvers.h"

/*
   Solvers of the subdomains. A structure made of repeated modules gives many subdomains the same operator, to the bit:
   it is then factored and condensed once, and solved for all of them together, which turns memory traffic into
   arithmetic. Subdomains without equal go into block diagonal matrices, some of like size in each.
*/

static PetscErrorCode LatinBatchCreate_Private(LatinBatch *batch, PetscInt patterns, PetscInt members)
{
  PetscFunctionBegin;
  batch->patterns = patterns;
  batch->members  = members;
  PetscCall(PetscMalloc2(patterns * members, &batch->sub, patterns + 1, &batch->row));
  PetscFunctionReturn(0);
}

/* Have the links of two equal subdomains the same laws and states in the same places? */
static PetscBool LatinBatchesAlike(const LatinSubdomains *sub, PetscInt a, PetscInt b)
{
  PetscInt shift, state;

  if (sub->ki) return PETSC_TRUE; /* a matrix has no links */
  shift = sub->link_offset[b] - sub->link_offset[a];
  state = sub->state_first[b] - sub->state_first[a];
  for (PetscInt l = sub->link_offset[a]; l < sub->link_offset[a + 1]; l++) {
    if (sub->state[l] < 0 && sub->state[l + shift] < 0) continue;
    if (sub->state[l] + state != sub->state[l + shift] || sub->law[l] != sub->law[l + shift]) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* How many subdomains of a batch follow each other from member m on, at most LATIN_BATCH_COLUMNS: their data are columns of one array */
PetscInt LatinBatchRun(const LatinBatch *batch, PetscInt m)
{
  PetscInt n = 1;

  while (batch->patterns == 1 && n < LATIN_BATCH_COLUMNS && m + n < batch->members && batch->sub[m + n] == batch->sub[m] + n) n++;
  return n;
}

/*
   One batch for each operator that several subdomains share, pattern[s] the first of them; the others in batches of at
   most LATIN_BATCH_PATTERNS, sorted by their right-hand sides, column[s] to column[s + 1]: those of a batch are condensed
   with as many as any of them needs. Takes pattern over.
*/
PetscErrorCode LatinBatchesSetUp(const LatinSubdomains *sub, PetscInt pattern[], const PetscInt column[], LatinBatches *batches)
{
  PetscInt *count, *index, *next, *list, *wide, alone = 0, groups = 0;

  PetscFunctionBegin;
  batches->pattern = pattern;
  PetscCall(PetscCalloc5(sub->n, &count, sub->n, &index, sub->n + 1, &next, sub->n, &list, sub->n, &wide));
  for (PetscInt s = 0; s < sub->n; s++) count[pattern[s]]++;
  for (PetscInt s = 0; s < sub->n; s++) {
    if (count[s] > 1) index[s] = groups++;
    else if (count[s]) {
      wide[alone]   = column[s + 1] - column[s];
      list[alone++] = s;
    }
  }
  PetscCall(PetscSortIntWithArray(alone, wide, list));
  batches->n = groups + (alone + LATIN_BATCH_PATTERNS - 1) / LATIN_BATCH_PATTERNS;
  PetscCall(PetscCalloc1(batches->n, &batches->batch));
  for (PetscInt s = 0; s < sub->n; s++)
    if (count[s] > 1) PetscCall(LatinBatchCreate_Private(&batches->batch[index[s]], 1, count[s]));
  for (PetscInt b = groups, last, i = 0; b < batches->n; b++) {
    last = (PetscInt)((PetscInt64)alone * (b - groups + 1) / (batches->n - groups));
    PetscCall(LatinBatchCreate_Private(&batches->batch[b], last - i, 1));
    for (; i < last; i++) index[list[i]] = b;
  }
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt b = index[pattern[s]];

    batches->batch[b].sub[next[b]++] = s;
  }
  for (PetscInt b = 0; b < batches->n; b++) {
    LatinBatch *batch = &batches->batch[b];

    batch->alike = (PetscBool)(batch->patterns == 1);
    for (PetscInt m = 1; m < batch->members && batch->alike; m++) batch->alike = LatinBatchesAlike(sub, batch->sub[0], batch->sub[m]);
    batch->row[0] = 0;
    for (PetscInt p = 0; p < batch->patterns; p++) batch->row[p + 1] = batch->row[p] + sub->bs * (sub->node_offset[batch->sub[p] + 1] - sub->node_offset[batch->sub[p]]);
  }
  PetscCall(PetscFree5(count, index, next, list, wide));
  PetscCall(PetscInfo(sub->object, "%" PetscInt_FMT " subdomains here, %" PetscInt_FMT " different operators\n", sub->n, groups + alone));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinBatchesReset(LatinBatches *batches)
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < batches->n; b++) PetscCall(PetscFree2(batches->batch[b].sub, batches->batch[b].row));
  PetscCall(PetscFree(batches->batch));
  PetscCall(PetscFree(batches->pattern));
  batches->n = 0;
  PetscFunctionReturn(0);
}

/* ---- solvers ---- */

/* Room for the rows of each batch, which the caller fills before LatinLocalSolversSetUp() */
PetscErrorCode LatinLocalSolversCreate(const LatinSubdomains *sub, const LatinBatches *batches, LatinLocalSolvers *solvers)
{
  const PetscInt n = batches->n;

  PetscFunctionBegin;
  solvers->sub     = sub;
  solvers->batches = batches;
  solvers->n       = n;
  PetscCall(PetscCalloc3(n, &solvers->K, n, &solvers->B, n, &solvers->X));
  PetscCall(PetscCalloc3(n, &solvers->ksp, n, &solvers->b, n, &solvers->x));
  PetscCall(PetscCalloc3(n, &solvers->ci, n, &solvers->cj, n, &solvers->ca));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLocalSolversDestroy(LatinLocalSolvers *solvers)
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solvers->n; i++) {
    PetscCall(KSPDestroy(&solvers->ksp[i]));
    PetscCall(MatDestroy(&solvers->K[i]));
    PetscCall(VecDestroy(&solvers->b[i]));
    PetscCall(VecDestroy(&solvers->x[i]));
    PetscCall(MatDestroy(&solvers->B[i]));
    PetscCall(MatDestroy(&solvers->X[i]));
    PetscCall(PetscFree(solvers->ci[i]));
    PetscCall(PetscFree(solvers->cj[i]));
    PetscCall(PetscFree(solvers->ca[i]));
  }
  PetscCall(PetscFree3(solvers->K, solvers->B, solvers->X));
  PetscCall(PetscFree3(solvers->ksp, solvers->b, solvers->x));
  PetscCall(PetscFree3(solvers->ci, solvers->cj, solvers->ca));
  solvers->n = 0;
  PetscFunctionReturn(0);
}

/* The matrix of a subdomain that has been condensed on its interfaces: hardly an entry of it is zero */
static PetscErrorCode LatinLocalDense_Private(PetscInt n, const PetscInt ci[], const PetscInt cj[], const PetscReal ca[], Mat *K)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinDenseCreate_Private(n, n, K));
  PetscCall(MatDenseGetArrayWrite(*K, &a));
  PetscCall(PetscArrayzero(a, n * n));
  for (PetscInt r = 0; r < n; r++)
    for (PetscInt k = ci[r]; k < ci[r + 1]; k++) a[cj[k] + n * r] = ca[k]; /* symmetric */
  PetscCall(MatDenseRestoreArrayWrite(*K, &a));
  PetscFunctionReturn(0);
}

/* The matrix of a batch, and work space for some of its members */
static PetscErrorCode LatinLocalMatrix_Private(LatinLocalSolvers *solvers, PetscInt i)
{
  const LatinBatch *batch = &solvers->batches->batch[i];
  const PetscInt    rows = batch->row[batch->patterns], columns = PetscMin(batch->members, LATIN_BATCH_COLUMNS);
  PetscScalar      *b, *x;

  PetscFunctionBegin;
  if (LatinSubdomainsCondensed(solvers->sub)) PetscCall(LatinLocalDense_Private(rows, solvers->ci[i], solvers->cj[i], solvers->ca[i], &solvers->K[i]));
  else PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, rows, rows, solvers->ci[i], solvers->cj[i], solvers->ca[i], &solvers->K[i]));
  PetscCall(MatSetOption(solvers->K[i], MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(solvers->K[i], MAT_SPD, PETSC_TRUE));
  PetscCall(LatinDenseCreate_Private(rows, columns, &solvers->B[i]));
  PetscCall(LatinDenseCreate_Private(rows, columns, &solvers->X[i]));
  if (batch->members > 1) PetscFunctionReturn(0);
  PetscCall(MatDenseGetArray(solvers->B[i], &b));
  PetscCall(MatDenseGetArray(solvers->X[i], &x));
  PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, rows, b, &solvers->b[i]));
  PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, rows, x, &solvers->x[i]));
  PetscCall(MatDenseRestoreArray(solvers->B[i], &b));
  PetscCall(MatDenseRestoreArray(solvers->X[i], &x));
  PetscFunctionReturn(0);
}

/*
   Matrices, factors and work space; name is "local" or "interior", the prefix of the options; once: a preconditioner that
   is no factorisation is applied once. solvers->status says how it ended on this rank.
*/
PetscErrorCode LatinLocalSolversSetUp(LatinLocalSolvers *solvers, const char name[], PetscBool once)
{
  const LatinSubdomains *sub     = solvers->sub;
  const MatSolverType    package = LatinSubdomainsCondensed(sub) ? MATSOLVERPETSC : MATSOLVERCHOLMOD;

  PetscFunctionBegin;
  solvers->direct = PETSC_TRUE;
  PetscCall(PetscMemzero(&solvers->status, sizeof(solvers->status)));
  for (PetscInt i = 0; i < solvers->n && !LatinFactorFailed(&solvers->status); i++) {
    PC pc;

    PetscCall(LatinLocalMatrix_Private(solvers, i));
    PetscCall(LatinSolverCreate_Private(PETSC_COMM_SELF, sub->object, name, &solvers->ksp[i]));
    PetscCall(KSPGetPC(solvers->ksp[i], &pc));
    PetscCall(LatinDirectSolver_Private(pc, solvers->K[i], package));
    PetscCall(KSPSetOperators(solvers->ksp[i], solvers->K[i], solvers->K[i]));
    PetscCall(KSPSetFromOptions(solvers->ksp[i]));
    PetscCall(LatinSolverDefaults_Private(solvers->ksp[i], once));
    PetscCall(MatSetBlockSize(solvers->K[i], sub->bs));
    solvers->status.large = PETSC_FALSE;
    for (PetscInt p = 0; p < solvers->batches->batch[i].patterns; p++) solvers->status.large = (PetscBool)(solvers->status.large || solvers->batches->batch[i].row[p + 1] - solvers->batches->batch[i].row[p] > LATIN_LARGE);
    PetscCall(LatinFactor_Private(solvers->ksp[i], solvers->K[i], package, &solvers->status));
    solvers->last = i;
    PetscCall(LatinSolverDirect_Private(solvers->ksp[i], &solvers->direct));
  }
  PetscFunctionReturn(0);
}

/* U = K^-1 g for the copy arrays of the subdomains of one batch */
PetscErrorCode LatinLocalSolve_Private(LatinLocalSolvers *solvers, PetscInt i, const PetscReal g[], PetscReal U[])
{
  const LatinSubdomains *sub   = solvers->sub;
  const LatinBatch      *batch = &solvers->batches->batch[i];
  const PetscInt         bs = solvers->sub->bs, rows = batch->row[batch->patterns], columns = PetscMin(batch->members, LATIN_BATCH_COLUMNS);
  PetscScalar           *b;
  const PetscScalar     *x;

  PetscFunctionBegin;
  for (PetscInt first = 0; first < batch->members; first += columns) {
    const PetscInt last = PetscMin(first + columns, batch->members);

    PetscCall(MatDenseGetArray(solvers->B[i], &b));
    for (PetscInt m = first; m < last; m++)
      for (PetscInt p = 0; p < batch->patterns; p++) PetscCall(PetscArraycpy(b + (size_t)rows * (size_t)(m - first) + batch->row[p], g + bs * sub->node_offset[batch->sub[p + m]], batch->row[p + 1] - batch->row[p]));
    PetscCall(MatDenseRestoreArray(solvers->B[i], &b));
    if (batch->members == 1) {
      PetscCall(PetscObjectStateIncrease((PetscObject)solvers->b[i]));
      PetscCall(KSPSolve(solvers->ksp[i], solvers->b[i], solvers->x[i]));
    } else PetscCall(KSPMatSolve(solvers->ksp[i], solvers->B[i], solvers->X[i]));
    PetscCall(LatinSolverNote_Private(solvers->ksp[i], sub->preconditions, &solvers->failed));
    PetscCall(MatDenseGetArrayRead(solvers->X[i], &x));
    for (PetscInt m = first; m < last; m++)
      for (PetscInt p = 0; p < batch->patterns; p++) PetscCall(PetscArraycpy(U + bs * sub->node_offset[batch->sub[p + m]], x + (size_t)rows * (size_t)(m - first) + batch->row[p], batch->row[p + 1] - batch->row[p]));
    PetscCall(MatDenseRestoreArrayRead(solvers->X[i], &x));
  }
  PetscFunctionReturn(0);
}

/* The same for all subdomains here */
PetscErrorCode LatinLocalSolveAll(LatinLocalSolvers *solvers, const PetscReal g[], PetscReal U[])
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solvers->n; i++) PetscCall(LatinLocalSolve_Private(solvers, i, g, U));
  PetscFunctionReturn(0);
}
