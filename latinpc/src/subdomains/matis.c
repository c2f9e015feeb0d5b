#include "subdomains/localmatrix.h"

/*
   Substructuring of a MATIS: a subdomain is the local matrix of a rank, or a part of it (subdomains/matisparts.c). Each dof is a node with one
   component. So scalar problems, blocks, several fields and partly constrained nodes are no special cases.

   1. Isolated unknowns, coupled to no other, as after MatZeroRowsColumns(), belong to no subdomain: the preconditioner divides by their diagonal.
   2. Each part of the local matrix becomes a subdomain. It has no copy of an unknown whose rows are zero there.
   3. The entries of its rows are copied, and mirrored where they are sums.
   4. The copies get data of the unknowns; springs are added if the matrix has a null space.
*/

/* Computes sub->unassigned_inverse, the inverse diagonal of isolated unknowns. Collective on sub->object */
PetscErrorCode LatinMatrixIsolated_Private(LatinSubdomains *sub, const LatinLocalMatrix *local)
{
  PetscReal *diagonal, *sum;
  PetscSF    sf;

  PetscFunctionBegin;
  PetscCall(PetscCalloc2(local->rows, &diagonal, sub->nodes_local, &sum));
  for (PetscInt r = 0; r < local->rows; r++)
    for (PetscInt k = local->i[r]; k < local->i[r + 1] && sub->row_copy[r] == LATIN_ROW_ISOLATED; k++)
      if (local->j[k] == r) diagonal[r] = local->a[k];
  PetscCall(LatinSFFetch_Private(PetscObjectComm(sub->object), sub->nodes_local, local->rows, local->global, &sf));
  PetscCall(LatinSFReduce_Private(sf, 1, MPIU_REAL, diagonal, sum, MPI_SUM));
  PetscCall(PetscSFDestroy(&sf));
  /* a row of zeros: any number serves */
  for (PetscInt k = 0; k < sub->unassigned_count; k++) sub->unassigned_inverse[k] = sum[sub->unassigned[k]] != 0.0 ? 1.0 / sum[sub->unassigned[k]] : 1.0;
  PetscCall(PetscFree2(diagonal, sum));
  PetscFunctionReturn(0);
}

/*
   Finds isolated unknowns. kept[row]: whether a local row has a copy; sub->row_copy[row]: LATIN_ROW_ISOLATED if its unknown is isolated on all ranks,
   else -1. Sets sub->unassigned. Collective on sub->object
*/
static PetscErrorCode LatinMatrixUnknowns_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, PetscBool kept[])
{
  PetscInt *coupled, *all;
  PetscSF   sf;

  PetscFunctionBegin;
  PetscCall(PetscCalloc2(local->rows, &coupled, sub->nodes_local, &all));
  for (PetscInt r = 0; r < local->rows; r++) {
    kept[r] = PETSC_FALSE;
    for (PetscInt k = local->i[r]; k < local->i[r + 1]; k++) {
      if (local->a[k] == 0.0) continue;
      kept[r] = PETSC_TRUE;
      if (local->j[k] != r) coupled[r] = 1;
    }
  }
  PetscCall(LatinSFFetch_Private(PetscObjectComm(sub->object), sub->nodes_local, local->rows, local->global, &sf));
  PetscCall(LatinSFReduce_Private(sf, 1, MPIU_INT, coupled, all, MPI_MAX));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, all, coupled));
  PetscCall(PetscSFDestroy(&sf));
  for (PetscInt r = 0; r < local->rows; r++) {
    sub->row_copy[r] = coupled[r] ? -1 : LATIN_ROW_ISOLATED;
    kept[r]          = (PetscBool)(kept[r] && coupled[r]);
  }
  for (PetscInt i = 0; i < sub->nodes_local; i++) sub->unassigned_count += all[i] ? 0 : 1;
  PetscCall(PetscMalloc2(sub->unassigned_count, &sub->unassigned, sub->unassigned_count, &sub->unassigned_inverse));
  for (PetscInt i = 0, k = 0; i < sub->nodes_local; i++)
    if (!all[i]) sub->unassigned[k++] = i;
  PetscCall(PetscFree2(coupled, all));
  PetscCall(LatinMatrixIsolated_Private(sub, local));
  PetscFunctionReturn(0);
}

/*
   Makes the copies, part by part, in each by global number; all rows of an unknown in a part have one. sub->row_copy[row]: copy of a local row;
   row[*rows]: rows with a copy, sorted by copies
*/
static PetscErrorCode LatinMatrixCopies_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, const PetscInt part[], PetscInt *rows, PetscInt row[])
{
  PetscInt *next, *global, *at = sub->row_copy;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(sub->n + 2, &next));
  for (PetscInt r = 0; r < local->rows; r++)
    if (part[r] >= 0) next[part[r] + 2]++;
  for (PetscInt s = 0; s < sub->n; s++) next[s + 2] += next[s + 1];
  *rows = next[sub->n + 1];
  PetscCall(PetscMalloc1(*rows, &global));
  PetscCall(PetscMalloc1(sub->n + 1, &sub->node_offset));
  for (PetscInt r = 0; r < local->rows; r++) {
    if (part[r] < 0) continue;
    global[next[part[r] + 1]] = local->global[r];
    row[next[part[r] + 1]++]  = r;
  }
  sub->copies = 0;
  for (PetscInt s = 0, k = 0; s < sub->n; s++) {
    const PetscInt first = k;

    sub->node_offset[s] = sub->copies;
    PetscCall(PetscSortIntWithArray(next[s + 1] - first, global + first, row + first));
    for (; k < next[s + 1]; k++) at[row[k]] = k > first && global[k] == global[k - 1] ? sub->copies - 1 : sub->copies++;
  }
  sub->node_offset[sub->n] = sub->copies;
  sub->sums                = (PetscBool)(sub->copies < *rows);
  PetscCall(PetscMalloc2(sub->copies, &sub->node, 0, &sub->ends));
  for (PetscInt k = 0; k < *rows; k++) sub->node[at[row[k]]] = global[k];
  PetscCall(PetscFree(global));
  PetscCall(PetscFree(next));
  PetscFunctionReturn(0);
}

/* Sums consecutive entries of the same column; returns the new number of entries */
static PetscInt LatinMatrixSums(PetscInt n, PetscInt column[], PetscReal value[])
{
  PetscInt last = -1;

  for (PetscInt k = 0; k < n; k++)
    if (last >= 0 && column[k] == column[last]) value[last] += value[k];
    else {
      column[++last] = column[k];
      value[last]    = value[k];
    }
  return last + 1;
}

/* Copies entries above the diagonal to those below it: sums in another order differ by rounding, and one of two may vanish */
PetscErrorCode LatinMatrixMirror_Private(LatinSubdomains *sub)
{
  PetscInt *next;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->copies, &next));
  PetscCall(PetscArraycpy(next, sub->ki, sub->copies));
  for (PetscInt i = 0; i < sub->copies; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++)
      if (sub->kj[k] > i) sub->ka[next[sub->kj[k]]++] = sub->ka[k];
  PetscCall(PetscFree(next));
  PetscFunctionReturn(0);
}

/*
   Makes the compressed rows of the operators; at[row]: copy of a local row. Entries are kept if neither they nor their transposed ones are zero: METIS
   needs a symmetric graph, and rounding may leave one of the two
*/
static PetscErrorCode LatinMatrixRows_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, const PetscInt at[], PetscInt rows, const PetscInt row[])
{
  PetscInt next = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->copies + 1, &sub->ki));
  if (local->mirrored && sub->preconditions && !sub->known.kernels && sub->n == 1 && sub->copies == local->rows) {
    PetscCall(PetscObjectReference((PetscObject)local->K));
    sub->dense   = local->K;
    sub->dense_a = local->a;
    PetscCall(PetscMalloc1(sub->copies, &sub->dense_row));
    PetscCall(PetscArraycpy(sub->dense_row, row, sub->copies));
    for (PetscInt i = 0; i <= sub->copies; i++) sub->ki[i] = sub->copies * i;
    PetscFunctionReturn(0);
  }
  PetscCall(PetscMalloc2(local->i[local->rows], &sub->kj, local->i[local->rows], &sub->ka));
  sub->ki[0] = 0;
  for (PetscInt i = 0; i < sub->copies; i++) {
    const PetscInt first = sub->ki[i];
    PetscInt       n     = first;

    for (; next < rows && at[row[next]] == i; next++)
      for (PetscInt k = local->i[row[next]]; k < local->i[row[next] + 1]; k++) {
        PetscReal across = 0.0;

        if (local->a[k] != 0.0) PetscCall(LatinLocalMatrixAcross_Private(local, row[next], k, &across));
        if (across == 0.0 || at[local->j[k]] < 0) continue;
        sub->kj[n]   = at[local->j[k]];
        sub->ka[n++] = local->a[k];
      }
    PetscCall(PetscSortIntWithScalarArray(n - first, sub->kj + first, sub->ka + first));
    sub->ki[i + 1] = first + (sub->sums ? LatinMatrixSums(n - first, sub->kj + first, sub->ka + first) : n - first);
  }
  if (sub->sums) PetscCall(LatinMatrixMirror_Private(sub));
  PetscCall(PetscMalloc1(sub->copies, &sub->kd));
  for (PetscInt i = 0; i < sub->copies; i++) {
    PetscInt diagonal;

    PetscCall(PetscFindInt(i, sub->ki[i + 1] - sub->ki[i], sub->kj + sub->ki[i], &diagonal));
    sub->kd[i] = diagonal < 0 ? -1 : sub->ki[i] + diagonal;
  }
  PetscFunctionReturn(0);
}

/* Creates scatters from vectors of the matrix to copies; gets coordinates, fields and near null space at the copies. Collective on sub->object */
static PetscErrorCode LatinMatrixData_Private(LatinSubdomains *sub)
{
  const LatinUnknowns *known = &sub->known;
  const PetscInt       n     = sub->copies;
  const PetscInt      *degree;

  PetscFunctionBegin;
  PetscCall(LatinSFFetch_Private(PetscObjectComm(sub->object), sub->nodes_local, n, sub->node, &sub->node_sf));
  PetscCall(PetscObjectReference((PetscObject)sub->node_sf));
  sub->dof_sf = sub->node_sf;
  PetscCall(PetscMalloc5(sub->dim * n, &sub->x, n, &sub->fixed, n, &sub->prescribed, n, &sub->multiplicity, n, &sub->global_dof));
  PetscCall(PetscMalloc2(n, &sub->field, known->nears * n, &sub->near));
  PetscCall(PetscArrayzero(sub->fixed, n));
  PetscCall(PetscArrayzero(sub->prescribed, n));
  PetscCall(PetscArraycpy(sub->global_dof, sub->node, n));
  if (sub->dim) PetscCall(LatinSFBcast_Private(sub->node_sf, sub->dim, MPIU_REAL, known->x, sub->x));
  PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_INT, known->field, sub->field));
  for (PetscInt k = 0; k < known->nears; k++) PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_REAL, known->near + sub->nodes_local * k, sub->near + n * k));
  PetscCall(PetscSFComputeDegreeBegin(sub->node_sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sub->node_sf, &degree));
  PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_INT, degree, sub->multiplicity));
  PetscFunctionReturn(0);
}

/* Copies the vectors of the null space to v, [kernels][rows], with a largest entry of one; isolated unknowns zero. Collective on sub->object */
static PetscErrorCode LatinMatrixHoldVectors_Private(const LatinSubdomains *sub, PetscReal v[])
{
  const PetscInt rows = sub->nodes_local, n = sub->known.kernels;
  PetscReal     *largest;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(n, &largest));
  for (PetscInt i = 0; i < n * rows; i++) largest[i / rows] = PetscMax(largest[i / rows], PetscAbsReal(sub->known.kernel[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, largest, (PetscMPIInt)n, MPIU_REAL, MPIU_MAX, PetscObjectComm(sub->object)));
  for (PetscInt i = 0; i < n * rows; i++) v[i] = largest[i / rows] > 0.0 ? sub->known.kernel[i] / largest[i / rows] : 0.0;
  for (PetscInt k = 0; k < sub->unassigned_count; k++)
    for (PetscInt j = 0; j < n; j++) v[rows * j + sub->unassigned[k]] = 0.0;
  PetscCall(PetscFree(largest));
  PetscFunctionReturn(0);
}

/*
   Finds the largest entry of the vectors that are not taken, times the weight of its row: *largest, of vector *which, in row *at here, -1: of another rank.
   pivot: entries of all vectors in that row. Collective on sub->object
*/
static PetscErrorCode LatinMatrixHoldPivot_Private(const LatinSubdomains *sub, const PetscScalar weight[], const PetscReal v[], const PetscBool taken[], PetscInt *which, PetscInt *at, PetscReal *largest, PetscReal pivot[])
{
  MPI_Comm       comm = PetscObjectComm(sub->object);
  const PetscInt rows = sub->nodes_local, n = sub->known.kernels;
  struct {
    PetscReal   value;
    PetscMPIInt rank;
  } mine = {0.0, 0}, best;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &mine.rank));
  *at = -1;
  for (PetscInt i = 0; i < n * rows; i++) {
    const PetscReal value = PetscRealPart(weight[i % rows]) * PetscAbsReal(v[i]);

    if (taken[i / rows] || !(value > mine.value)) continue;
    mine.value = value;
    *which     = i / rows;
    *at        = i % rows;
  }
  PetscCallMPI(MPI_Allreduce(&mine, &best, 1, LatinByPrecision(MPI_DOUBLE_INT, MPI_FLOAT_INT), MPI_MAXLOC, comm));
  *largest = best.value;
  if (best.rank != mine.rank) *at = -1;
  for (PetscInt k = 0; k < n && *at >= 0; k++) pivot[k] = v[rows * k + *at];
  PetscCallMPI(MPI_Bcast(pivot, (PetscMPIInt)n, MPIU_REAL, best.rank, comm));
  PetscCallMPI(MPI_Bcast(which, 1, MPIU_INT, best.rank, comm));
  PetscFunctionReturn(0);
}

/*
   Adds springs to a singular matrix A with null space N, which is preconditioned as A + E a E^t: one spring for each vector of N, on unknowns E such
   that N^t E is regular, as stiff as their diagonal entries. Gaussian elimination with full pivoting chooses the largest entries of N, each times the
   root of its stiffness: springs on soft unknowns let stiff parts move far, whose rounding is forces. It ends at rounding: vectors may depend on others
   if they move isolated unknowns, and a spring more would hold what is free. For a right-hand side orthogonal to N the springs carry no force, so that the
   solution is one of A; the spectrum on the complement of N is the same. Collective on sub->object
*/
PetscErrorCode LatinMatrixHold_Private(LatinSubdomains *sub)
{
  const PetscInt     rows = sub->nodes_local, n = sub->known.kernels;
  PetscReal         *v, *pivot, stiffest, largest;
  PetscInt          *held, *copy, at, which = 0;
  PetscBool         *taken;
  Vec                root;
  const PetscScalar *weight;

  PetscFunctionBegin;
  if (!n) PetscFunctionReturn(0);
  PetscCall(MatCreateVecs(sub->matrix, NULL, &root));
  PetscCall(MatGetDiagonal(sub->matrix, root));
  PetscCall(VecSqrtAbs(root));
  PetscCall(VecNorm(root, NORM_INFINITY, &stiffest));
  PetscCall(VecGetArrayRead(root, &weight));
  PetscCall(PetscMalloc4(n * rows, &v, n, &pivot, rows, &held, sub->copies, &copy));
  PetscCall(PetscCalloc1(n, &taken));
  PetscCall(PetscArrayzero(held, rows));
  PetscCall(LatinMatrixHoldVectors_Private(sub, v));
  while (PETSC_TRUE) {
    PetscCall(LatinMatrixHoldPivot_Private(sub, weight, v, taken, &which, &at, &largest, pivot));
    if (!(largest > PETSC_SQRT_MACHINE_EPSILON * stiffest)) break;
    taken[which] = PETSC_TRUE;
    if (at >= 0) held[at] = 1;
    for (PetscInt i = 0; i < n * rows; i++)
      if (!taken[i / rows]) v[i] -= v[rows * which + i % rows] * (pivot[i / rows] / pivot[which]);
  }
  PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_INT, held, copy));
  for (PetscInt i = 0; i < sub->copies; i++)
    if (copy[i] && sub->kd[i] >= 0) sub->ka[sub->kd[i]] *= 2.0;
  PetscCall(VecRestoreArrayRead(root, &weight));
  PetscCall(VecDestroy(&root));
  PetscCall(PetscFree(taken));
  PetscCall(PetscFree4(v, pivot, held, copy));
  PetscFunctionReturn(0);
}

/* Makes the subdomains from the local matrices of sub->matrix. Collective on sub->object */
PetscErrorCode LatinSubdomainsSetUp_Matrix(LatinSubdomains *sub)
{
  MPI_Comm         comm = PetscObjectComm(sub->object);
  LatinLocalMatrix local;
  PetscMPIInt      size;
  PetscBool       *kept;
  PetscInt        *part, *row, rows = 0;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Subdomains, sub->object, 0, 0, 0));
  sub->dim    = sub->known.dim;
  sub->bs     = 1;
  sub->fields = sub->known.fields;
  sub->nears  = sub->known.nears;
  PetscCall(MatGetLocalSize(sub->matrix, &sub->nodes_local, NULL));
  PetscCall(LatinLocalMatrixGet_Private(sub->matrix, &local));
  sub->rows = local.rows;
  PetscCall(PetscMalloc1(local.rows, &sub->row_copy));
  PetscCall(PetscMalloc3(local.rows, &kept, local.rows, &part, local.rows, &row));
  PetscCall(LatinMatrixUnknowns_Private(sub, &local, kept));
  PetscCall(LatinLocalMatrixSymmetric_Private(sub->matrix, &local, sub->row_copy));
  PetscCall(LatinMatrixParts_Private(sub, &local, kept, part));
  PetscCall(LatinMatrixCopies_Private(sub, &local, part, &rows, row));
  PetscCall(LatinMatrixRows_Private(sub, &local, sub->row_copy, rows, row));
  PetscCall(PetscFree3(kept, part, row));
  PetscCall(LatinLocalMatrixRestore_Private(&local));
  PetscCall(LatinMatrixData_Private(sub));
  PetscCall(LatinMatrixHold_Private(sub));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscCalloc1(size + 1, &sub->rank_first));
  PetscCallMPI(MPI_Allgather(&sub->n, 1, MPIU_INT, sub->rank_first + 1, 1, MPIU_INT, comm));
  for (PetscMPIInt r = 0; r < size; r++) sub->rank_first[r + 1] += sub->rank_first[r];
  sub->count = sub->rank_first[size];
  PetscCallMPI(MPI_Scan(&sub->n, &sub->first, 1, MPIU_INT, MPI_SUM, comm));
  sub->first -= sub->n;
  PetscCall(PetscLogEventEnd(LATIN_Subdomains, sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}
