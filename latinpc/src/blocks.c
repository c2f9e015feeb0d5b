#include "latinimpl.h"

/*
   Solvers of the subdomains. A structure made of repeated modules gives many subdomains the same operator, to the bit:
   it is then factored and condensed once, and solved for all of them together, which turns memory traffic into
   arithmetic. Subdomains without equal go into block diagonal matrices, some of like size in each.
*/

/* ---- which subdomains are equal ---- */

/* Room for n more bytes at the end of the stream */
PetscErrorCode LatinStreamRoom_Private(LatinStream *stream, size_t n, unsigned char **room)
{
  PetscFunctionBegin;
  if (stream->used + n > stream->size) {
    unsigned char *larger;

    stream->size = 2 * (stream->used + n);
    PetscCall(PetscMalloc1(stream->size, &larger));
    if (stream->used) PetscCall(PetscMemcpy(larger, stream->bytes, stream->used));
    PetscCall(PetscFree(stream->bytes));
    stream->bytes = larger;
  }
  *room = stream->bytes + stream->used;
  stream->used += n;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinStreamAdd_Private(LatinStream *stream, const void *data, size_t n)
{
  unsigned char *room = NULL;

  PetscFunctionBegin;
  PetscCall(LatinStreamRoom_Private(stream, n, &room));
  PetscCall(PetscMemcpy(room, data, n));
  PetscFunctionReturn(0);
}

/* The operator, and where the subdomain is held and touches others */
static PetscErrorCode LatinStreamOperator_Private(Latin latin, PetscInt s, LatinStream *stream)
{
  LatinSubstructure *sub   = &latin->sub;
  LatinInterfaces   *inter = &latin->inter;
  const PetscInt     bs = latin->sub.bs, top = sub->node_offset[s], nodes = sub->node_offset[s + 1] - top;
  unsigned char     *room = NULL;

  PetscFunctionBegin;
  PetscCall(LatinStreamAdd_Private(stream, &nodes, sizeof(nodes)));
  PetscCall(LatinStreamRoom_Private(stream, (size_t)((bs + 1) * nodes), &room));
  for (PetscInt i = top; i < top + nodes; i++) {
    *room++ = (unsigned char)((inter->component[i] >= 0 ? 1 : 0) | (inter->share_offset[i + 1] > inter->share_offset[i] ? 2 : 0));
    for (PetscInt c = 0; c < bs; c++) *room++ = sub->fixed[bs * i + c] ? 1 : 0;
  }
  PetscCall(LatinOperatorStream_Private(latin, s, stream));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;

    PetscCall(LatinStreamAdd_Private(stream, &rows, sizeof(rows)));
    PetscCall(LatinStreamRoom_Private(stream, (size_t)rows * sizeof(rows), &room));
    for (PetscInt k = face->side_first; k < face->side_last; k++, room += sizeof(rows)) {
      const PetscInt dof = inter->side_dof[k] - bs * top;

      memcpy(room, &dof, sizeof(dof));
    }
  }
  PetscFunctionReturn(0);
}

/* bases: with the search directions and the macro bases, which an earlier stage has not made yet */
static PetscErrorCode LatinStreamSubdomain_Private(Latin latin, PetscInt s, PetscBool bases, LatinStream *stream)
{
  LatinInterfaces *inter = &latin->inter;

  PetscFunctionBegin;
  stream->used = 0;
  if (bases && latin->macro.like) PetscCall(LatinStreamAdd_Private(stream, &latin->macro.like[s], sizeof(*latin->macro.like)));
  else PetscCall(LatinStreamOperator_Private(latin, s, stream));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1] && bases; f++) {
    const LatinInterface *face    = &inter->interface[f];
    const PetscInt        rows    = face->side_last - face->side_first;
    const PetscInt        head[2] = {face->modes, face->matrix_first};

    PetscCall(LatinStreamAdd_Private(stream, head, sizeof(head)));
    PetscCall(LatinStreamAdd_Private(stream, latin->macro.d + face->side_first, (size_t)rows * sizeof(PetscReal)));
    PetscCall(LatinStreamAdd_Private(stream, latin->macro.basis + face->basis_first, (size_t)(rows * face->modes) * sizeof(PetscReal)));
  }
  stream->hash = LatinHash(stream->used, stream->bytes);
  PetscFunctionReturn(0);
}

/* pattern[s]: the first subdomain equal to s */
PetscErrorCode LatinBlocksCompare_Private(Latin latin, PetscBool bases, PetscInt pattern[])
{
  const PetscInt n = latin->sub.n;
  LatinStream    a, b;
  LatinKey      *key;

  PetscFunctionBegin;
  if (n == 1) {
    pattern[0] = 0;
    PetscFunctionReturn(0);
  }
  PetscCall(PetscMemzero(&a, sizeof(a)));
  PetscCall(PetscMemzero(&b, sizeof(b)));
  PetscCall(PetscMalloc1(n, &key));
  for (PetscInt s = 0; s < n; s++) {
    PetscCall(LatinStreamSubdomain_Private(latin, s, bases, &a));
    key[s].hash   = a.hash;
    key[s].number = s;
    pattern[s]    = s;
  }
  if (n > 1) qsort(key, (size_t)n, sizeof(*key), LatinKeyCompare);
  for (PetscInt i = 0; i < n;) {
    PetscInt j = i + 1;

    if (j < n && key[j].hash == key[i].hash) PetscCall(LatinStreamSubdomain_Private(latin, key[i].number, bases, &a));
    for (; j < n && key[j].hash == key[i].hash; j++) {
      PetscBool same;

      PetscCall(LatinStreamSubdomain_Private(latin, key[j].number, bases, &b));
      if (a.used != b.used) continue; /* a different subdomain with the same hash stays on its own */
      PetscCall(PetscMemcmp(a.bytes, b.bytes, a.used, &same));
      if (same) pattern[key[j].number] = key[i].number;
    }
    i = j;
  }
  PetscCall(PetscFree(key));
  PetscCall(PetscFree(a.bytes));
  PetscCall(PetscFree(b.bytes));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinBatchCreate_Private(LatinBatch *batch, PetscInt patterns, PetscInt members)
{
  PetscFunctionBegin;
  batch->patterns = patterns;
  batch->members  = members;
  PetscCall(PetscMalloc2(patterns * members, &batch->sub, patterns + 1, &batch->row));
  PetscFunctionReturn(0);
}

/* Have the links of two equal subdomains the same laws and states in the same places? */
static PetscBool LatinBlocksAlike(const LatinSubstructure *sub, PetscInt a, PetscInt b)
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

/* Bases of equal subdomains are kept once: they are read in one place, where they stay in cache */
static PetscErrorCode LatinBlocksShareBases_Private(Latin latin)
{
  LatinInterfaces *inter   = &latin->inter;
  const PetscInt  *pattern = latin->linear.blocks.pattern;
  PetscInt         total   = 0;
  PetscReal       *basis;

  PetscFunctionBegin;
  for (PetscInt f = 0; f < inter->count; f++)
    if (pattern[inter->interface[f].sub] == inter->interface[f].sub) total += (inter->interface[f].side_last - inter->interface[f].side_first) * inter->interface[f].modes;
  PetscCall(PetscMalloc1(total, &basis));
  total = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    LatinInterface *face = &inter->interface[f];
    const PetscInt  size = (face->side_last - face->side_first) * face->modes, own = inter->offset[face->sub], other = inter->offset[pattern[face->sub]];

    if (own != other) {
      face->basis_first = inter->interface[f + other - own].basis_first; /* the pattern is the first subdomain of its kind */
      continue;
    }
    PetscCall(PetscArraycpy(basis + total, latin->macro.basis + face->basis_first, size));
    face->basis_first = total;
    total += size;
  }
  PetscCall(PetscFree(latin->macro.basis));
  latin->macro.basis = basis;
  PetscFunctionReturn(0);
}

/* How many subdomains of a batch follow each other from member m on, at most LATIN_BLOCK_COLUMNS: their data are columns of one array */
PetscInt LatinBatchRun(const LatinBatch *batch, PetscInt m)
{
  PetscInt n = 1;

  while (batch->patterns == 1 && n < LATIN_BLOCK_COLUMNS && m + n < batch->members && batch->sub[m + n] == batch->sub[m] + n) n++;
  return n;
}

/*
   One batch for each operator that several subdomains share; the others in batches of at most LATIN_BLOCK_PATTERNS, sorted
   by coarse dofs: those of a batch are condensed with as many right-hand sides as the largest of them needs.
*/
PetscErrorCode LatinBlocksSetUp(Latin latin)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinBlocks       *blocks = &latin->linear.blocks;
  PetscInt          *count, *index, *next, *list, *width, alone = 0, groups = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->n, &blocks->pattern));
  PetscCall(LatinBlocksCompare_Private(latin, PETSC_TRUE, blocks->pattern));
  PetscCall(LatinBlocksShareBases_Private(latin));
  PetscCall(PetscCalloc5(sub->n, &count, sub->n, &index, sub->n + 1, &next, sub->n, &list, sub->n, &width));
  for (PetscInt s = 0; s < sub->n; s++) count[blocks->pattern[s]]++;
  for (PetscInt s = 0; s < sub->n; s++) {
    if (count[s] > 1) index[s] = groups++;
    else if (count[s]) {
      width[alone]  = latin->coarse.offset[s + 1] - latin->coarse.offset[s];
      list[alone++] = s;
    }
  }
  PetscCall(PetscSortIntWithArray(alone, width, list));
  blocks->n = groups + (alone + LATIN_BLOCK_PATTERNS - 1) / LATIN_BLOCK_PATTERNS;
  PetscCall(PetscCalloc1(blocks->n, &blocks->batch));
  for (PetscInt s = 0; s < sub->n; s++)
    if (count[s] > 1) PetscCall(LatinBatchCreate_Private(&blocks->batch[index[s]], 1, count[s]));
  for (PetscInt b = groups, last, i = 0; b < blocks->n; b++) {
    last = (PetscInt)((PetscInt64)alone * (b - groups + 1) / (blocks->n - groups));
    PetscCall(LatinBatchCreate_Private(&blocks->batch[b], last - i, 1));
    for (; i < last; i++) index[list[i]] = b;
  }
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt b = index[blocks->pattern[s]];

    blocks->batch[b].sub[next[b]++] = s;
  }
  for (PetscInt b = 0; b < blocks->n; b++) {
    LatinBatch *batch = &blocks->batch[b];

    batch->alike = (PetscBool)(batch->patterns == 1);
    for (PetscInt m = 1; m < batch->members && batch->alike; m++) batch->alike = LatinBlocksAlike(sub, batch->sub[0], batch->sub[m]);
    batch->row[0] = 0;
    for (PetscInt p = 0; p < batch->patterns; p++) batch->row[p + 1] = batch->row[p] + latin->sub.bs * (sub->node_offset[batch->sub[p] + 1] - sub->node_offset[batch->sub[p]]);
  }
  PetscCall(PetscFree5(count, index, next, list, width));
  PetscCall(PetscInfo(latin, "%" PetscInt_FMT " subdomains here, %" PetscInt_FMT " different operators\n", sub->n, groups + alone));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinBlocksReset(Latin latin)
{
  LatinBlocks *blocks = &latin->linear.blocks;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < blocks->n; b++) PetscCall(PetscFree2(blocks->batch[b].sub, blocks->batch[b].row));
  PetscCall(PetscFree(blocks->batch));
  PetscCall(PetscFree(blocks->pattern));
  blocks->n = 0;
  PetscFunctionReturn(0);
}

/* ---- solvers ---- */

/* Room for the rows of each batch, which the caller fills before LatinBlockSolverSetUp() */
PetscErrorCode LatinBlockSolverCreate(Latin latin, LatinBlockSolver *solver)
{
  const PetscInt n = latin->linear.blocks.n;

  PetscFunctionBegin;
  solver->n = n;
  PetscCall(PetscCalloc3(n, &solver->K, n, &solver->B, n, &solver->X));
  PetscCall(PetscCalloc3(n, &solver->ksp, n, &solver->b, n, &solver->x));
  PetscCall(PetscCalloc3(n, &solver->ci, n, &solver->cj, n, &solver->ca));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinBlockSolverDestroy(LatinBlockSolver *solver)
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solver->n; i++) {
    PetscCall(KSPDestroy(&solver->ksp[i]));
    PetscCall(MatDestroy(&solver->K[i]));
    PetscCall(VecDestroy(&solver->b[i]));
    PetscCall(VecDestroy(&solver->x[i]));
    PetscCall(MatDestroy(&solver->B[i]));
    PetscCall(MatDestroy(&solver->X[i]));
    PetscCall(PetscFree(solver->ci[i]));
    PetscCall(PetscFree(solver->cj[i]));
    PetscCall(PetscFree(solver->ca[i]));
  }
  PetscCall(PetscFree3(solver->K, solver->B, solver->X));
  PetscCall(PetscFree3(solver->ksp, solver->b, solver->x));
  PetscCall(PetscFree3(solver->ci, solver->cj, solver->ca));
  solver->n = 0;
  PetscFunctionReturn(0);
}

/* The matrix of a subdomain that has been condensed on its interfaces: hardly an entry of it is zero */
static PetscErrorCode LatinBlockDense_Private(PetscInt n, const PetscInt ci[], const PetscInt cj[], const PetscReal ca[], Mat *K)
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

/* Matrices, factors and work space; name is "local" or "interior", the prefix of the options. Collective on latin */
PetscErrorCode LatinBlockSolverSetUp(Latin latin, LatinBlockSolver *solver, const char name[])
{
  const MatSolverType package = latin->interior ? MATSOLVERPETSC : MATSOLVERCHOLMOD;
  LatinFactorStatus   status  = {0, PC_NOERROR, PETSC_FALSE};
  Vec                 soft    = NULL;
  PetscInt            failed  = 0;
  const char         *prefix;
  PC                  pc;

  PetscFunctionBegin;
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
  solver->direct = PETSC_TRUE;
  for (PetscInt i = 0; i < solver->n && !status.ierr && !status.failed && !status.mechanism; i++) {
    const LatinBatch *batch = &latin->linear.blocks.batch[i];
    const PetscInt    rows = batch->row[batch->patterns], columns = PetscMin(batch->members, LATIN_BLOCK_COLUMNS);
    PetscScalar      *b, *x;
    PetscBool         direct;

    if (latin->interior) PetscCall(LatinBlockDense_Private(rows, solver->ci[i], solver->cj[i], solver->ca[i], &solver->K[i]));
    else PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, rows, rows, solver->ci[i], solver->cj[i], solver->ca[i], &solver->K[i]));
    PetscCall(MatSetOption(solver->K[i], MAT_SYMMETRIC, PETSC_TRUE));
    PetscCall(MatSetOption(solver->K[i], MAT_SPD, PETSC_TRUE));
    PetscCall(LatinDenseCreate_Private(rows, columns, &solver->B[i]));
    PetscCall(LatinDenseCreate_Private(rows, columns, &solver->X[i]));
    if (batch->members == 1) {
      PetscCall(MatDenseGetArray(solver->B[i], &b));
      PetscCall(MatDenseGetArray(solver->X[i], &x));
      PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, rows, b, &solver->b[i]));
      PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, rows, x, &solver->x[i]));
      PetscCall(MatDenseRestoreArray(solver->B[i], &b));
      PetscCall(MatDenseRestoreArray(solver->X[i], &x));
    }
    PetscCall(KSPCreate(PETSC_COMM_SELF, &solver->ksp[i]));
    PetscCall(PetscObjectIncrementTabLevel((PetscObject)solver->ksp[i], (PetscObject)latin, 1));
    PetscCall(PetscObjectSetOptions((PetscObject)solver->ksp[i], ((PetscObject)latin)->options));
    PetscCall(KSPSetOptionsPrefix(solver->ksp[i], prefix));
    PetscCall(KSPAppendOptionsPrefix(solver->ksp[i], name));
    PetscCall(KSPAppendOptionsPrefix(solver->ksp[i], "_"));
    PetscCall(KSPSetType(solver->ksp[i], KSPPREONLY));
    PetscCall(KSPGetPC(solver->ksp[i], &pc));
    PetscCall(LatinDirectSolver_Private(pc, solver->K[i], package));
    PetscCall(KSPSetOperators(solver->ksp[i], solver->K[i], solver->K[i]));
    PetscCall(KSPSetFromOptions(solver->ksp[i]));
    PetscCall(LatinSolverDefaults_Private(latin, solver->ksp[i], name, &direct));
    if (!direct) PetscCall(LatinLevelBatch_Private(latin, batch, solver->K[i]));
    PetscCall(LatinFactor_Private(solver->ksp[i], solver->K[i], package, &status, &soft));
    failed = i;
    PetscCall(LatinSolverDirect_Private(solver->ksp[i], &solver->direct));
    if (!solver->direct && latin->preconditions && !status.ierr && !status.failed && !status.mechanism && !i) PetscCall(LatinSolverTest_Private(solver->ksp[i], solver->K[i], &latin->inexact));
  }
  PetscCall(LatinFactorAgree_Private(latin, &status, soft, solver->n ? &latin->linear.blocks.batch[failed] : NULL, name));
  PetscFunctionReturn(0);
}

/* U = K^-1 g for the copy arrays of the subdomains of one batch */
PetscErrorCode LatinBlockSolveBatch_Private(Latin latin, LatinBlockSolver *solver, PetscInt i, const PetscReal g[], PetscReal U[])
{
  LatinSubstructure *sub   = &latin->sub;
  const LatinBatch  *batch = &latin->linear.blocks.batch[i];
  const PetscInt     bs = latin->sub.bs, rows = batch->row[batch->patterns], columns = PetscMin(batch->members, LATIN_BLOCK_COLUMNS);
  PetscScalar       *b;
  const PetscScalar *x;

  PetscFunctionBegin;
  for (PetscInt first = 0; first < batch->members; first += columns) {
    const PetscInt last = PetscMin(first + columns, batch->members);

    PetscCall(MatDenseGetArray(solver->B[i], &b));
    for (PetscInt m = first; m < last; m++)
      for (PetscInt p = 0; p < batch->patterns; p++) PetscCall(PetscArraycpy(b + (size_t)rows * (size_t)(m - first) + batch->row[p], g + bs * sub->node_offset[batch->sub[p + m]], batch->row[p + 1] - batch->row[p]));
    PetscCall(MatDenseRestoreArray(solver->B[i], &b));
    if (batch->members == 1) {
      PetscCall(PetscObjectStateIncrease((PetscObject)solver->b[i]));
      PetscCall(KSPSolve(solver->ksp[i], solver->b[i], solver->x[i]));
    } else PetscCall(KSPMatSolve(solver->ksp[i], solver->B[i], solver->X[i]));
    PetscCall(LatinSolverNote_Private(latin, solver->ksp[i]));
    PetscCall(MatDenseGetArrayRead(solver->X[i], &x));
    for (PetscInt m = first; m < last; m++)
      for (PetscInt p = 0; p < batch->patterns; p++) PetscCall(PetscArraycpy(U + bs * sub->node_offset[batch->sub[p + m]], x + (size_t)rows * (size_t)(m - first) + batch->row[p], batch->row[p + 1] - batch->row[p]));
    PetscCall(MatDenseRestoreArrayRead(solver->X[i], &x));
  }
  PetscFunctionReturn(0);
}

/* The same for all subdomains here */
PetscErrorCode LatinBlockSolve(Latin latin, LatinBlockSolver *solver, const PetscReal g[], PetscReal U[])
{
  PetscFunctionBegin;
  for (PetscInt i = 0; i < solver->n; i++) PetscCall(LatinBlockSolveBatch_Private(latin, solver, i, g, U));
  PetscFunctionReturn(0);
}
