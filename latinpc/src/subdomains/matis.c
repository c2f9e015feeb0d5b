#include "subdomains/localmatrix.h"

/*
   Substructuring of a MATIS: a subdomain is the local matrix of a rank, or a connected part of it. Every degree of
   freedom is a node with one component, so that scalar problems, blocks, several fields, and nodes of which only some
   components are free need no cases.

   Unknowns that nothing couples to others, as the rows and columns of boundary conditions that have been zeroed, belong
   to no subdomain: the preconditioner divides by their diagonal. A subdomain whose rows of an unknown are zero has no
   copy of it.
*/

/* Which local rows have a copy here, and which ones are coupled to nothing on any rank; and the unknowns of this rank that are coupled to no other, with their diagonal */
static PetscErrorCode LatinMatrixUnknowns_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, PetscBool kept[], PetscBool alone[])
{
  MPI_Comm    comm = PetscObjectComm(sub->object);
  PetscLayout map;
  PetscInt   *coupled, *all;
  PetscReal  *diagonal, *sum;
  PetscSF     sf;

  PetscFunctionBegin;
  PetscCall(PetscCalloc4(local->rows, &coupled, sub->nodes_local, &all, local->rows, &diagonal, sub->nodes_local, &sum));
  for (PetscInt r = 0; r < local->rows; r++)
    for (PetscInt k = local->i[r]; k < local->i[r + 1]; k++) {
      if (local->j[k] == r) diagonal[r] = local->a[k];
      else if (local->a[k] != 0.0) coupled[r] = 1;
    }
  for (PetscInt r = 0; r < local->rows; r++) kept[r] = (PetscBool)(coupled[r] || diagonal[r] != 0.0);
  PetscCall(MatGetLayouts(sub->matrix, &map, NULL));
  PetscCall(PetscSFCreate(comm, &sf));
  PetscCall(PetscSFSetGraphLayout(sf, map, local->rows, NULL, PETSC_COPY_VALUES, local->global));
  PetscCall(LatinSFReduce_Private(sf, 1, MPIU_INT, coupled, all, MPI_MAX));
  PetscCall(LatinSFReduce_Private(sf, 1, MPIU_REAL, diagonal, sum, MPI_SUM));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, all, coupled));
  PetscCall(PetscSFDestroy(&sf));
  for (PetscInt r = 0; r < local->rows; r++) {
    alone[r] = (PetscBool)!coupled[r];
    kept[r]  = (PetscBool)(kept[r] && coupled[r]);
  }
  for (PetscInt i = 0; i < sub->nodes_local; i++) sub->unassigned_count += all[i] ? 0 : 1;
  PetscCall(PetscMalloc2(sub->unassigned_count, &sub->unassigned, sub->unassigned_count, &sub->unassigned_inverse));
  for (PetscInt i = 0, k = 0; i < sub->nodes_local; i++) {
    if (all[i]) continue;
    sub->unassigned[k]           = i;
    sub->unassigned_inverse[k++] = sum[i] != 0.0 ? 1.0 / sum[i] : 1.0; /* a row of zeros: any number will do */
  }
  PetscCall(PetscFree4(coupled, all, diagonal, sum));
  PetscFunctionReturn(0);
}

/*
   The connected parts of the local matrix, part[row] (-1 without copy), in the order of their first rows. Unknowns of one
   block are together; one that is alone, a spring to the ground, goes with the first part.
*/
static PetscErrorCode LatinMatrixParts_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, const PetscBool kept[], PetscInt part[])
{
  PetscInt *parent, *size, *block, bs;
  PetscBool alone = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(MatGetBlockSize(sub->matrix, &bs));
  PetscCall(PetscMalloc3(local->rows, &parent, local->rows, &size, local->rows, &block));
  for (PetscInt r = 0; r < local->rows; r++) {
    parent[r] = r;
    size[r]   = 0;
    block[r]  = local->global[r] / bs;
    part[r]   = r;
  }
  for (PetscInt r = 0; r < local->rows; r++)
    for (PetscInt k = local->i[r]; k < local->i[r + 1]; k++)
      if (kept[r] && kept[local->j[k]] && local->a[k] != 0.0) LatinJoin(parent, r, local->j[k]);
  PetscCall(PetscSortIntWithArray(local->rows, block, part));
  for (PetscInt k = 0, before = -1; k < local->rows; k++) {
    if (!kept[part[k]]) continue;
    if (before >= 0 && block[before] == block[k]) LatinJoin(parent, part[before], part[k]);
    before = k;
  }
  for (PetscInt r = 0; r < local->rows; r++)
    if (kept[r]) size[LatinRoot(parent, r)]++;
  sub->n = 0;
  for (PetscInt r = 0; r < local->rows; r++) {
    if (kept[r]) alone = PETSC_TRUE;
    block[r] = size[r] > 1 ? sub->n++ : 0; /* from here on the number of a root's part */
  }
  if (alone) sub->n = PetscMax(sub->n, 1);
  for (PetscInt r = 0; r < local->rows; r++) part[r] = kept[r] ? block[LatinRoot(parent, r)] : -1;
  PetscCall(PetscFree3(parent, size, block));
  PetscFunctionReturn(0);
}

/* The copies, part by part and by global number; at[row] is the copy of a local row, LATIN_ROW_ALONE: coupled to nothing, -1: a row of zeros */
static PetscErrorCode LatinMatrixCopies_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, const PetscInt part[], const PetscBool alone[], PetscInt at[])
{
  PetscInt *row, *next;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(sub->n + 2, &next));
  for (PetscInt r = 0; r < local->rows; r++)
    if (part[r] >= 0) next[part[r] + 2]++;
  for (PetscInt s = 0; s < sub->n; s++) next[s + 2] += next[s + 1];
  sub->copies = next[sub->n + 1];
  PetscCall(PetscMalloc1(sub->copies, &row));
  PetscCall(PetscMalloc2(sub->copies, &sub->node, 0, &sub->ends));
  PetscCall(PetscMalloc1(sub->n + 1, &sub->node_offset));
  for (PetscInt r = 0; r < local->rows; r++)
    if (part[r] >= 0) {
      const PetscInt i = next[part[r] + 1]++;

      row[i]       = r;
      sub->node[i] = local->global[r];
    }
  PetscCall(PetscArraycpy(sub->node_offset, next, sub->n + 1));
  for (PetscInt s = 0; s < sub->n; s++) PetscCall(PetscSortIntWithArray(sub->node_offset[s + 1] - sub->node_offset[s], sub->node + sub->node_offset[s], row + sub->node_offset[s]));
  for (PetscInt r = 0; r < local->rows; r++) at[r] = alone[r] ? LATIN_ROW_ALONE : -1;
  for (PetscInt i = 0; i < sub->copies; i++) at[row[i]] = i;
  PetscCall(PetscMalloc1(sub->copies + 1, &sub->ki));
  if (local->mirrored && sub->preconditions && !sub->known.kernels && sub->n == 1 && sub->copies == local->rows) {
    PetscCall(PetscObjectReference((PetscObject)local->K));
    sub->dense     = local->K;
    sub->dense_a   = local->a;
    sub->dense_row = row;
    for (PetscInt i = 0; i <= sub->copies; i++) sub->ki[i] = sub->copies * i;
    PetscCall(PetscFree(next));
    PetscFunctionReturn(0);
  }
  /* the rows of the operators, of entries that are not zero on either side of the diagonal: rounding may leave one of the two, and METIS takes symmetric graphs */
  PetscCall(PetscMalloc2(local->i[local->rows], &sub->kj, local->i[local->rows], &sub->ka));
  sub->ki[0] = 0;
  for (PetscInt i = 0; i < sub->copies; i++) {
    PetscInt n = sub->ki[i];

    for (PetscInt k = local->i[row[i]]; k < local->i[row[i] + 1]; k++) {
      PetscReal across = 0.0;

      if (local->a[k] != 0.0) PetscCall(LatinLocalMatrixAcross_Private(local, row[i], k, &across));
      if (across == 0.0 || at[local->j[k]] < 0) continue;
      sub->kj[n]   = at[local->j[k]];
      sub->ka[n++] = local->a[k];
    }
    sub->ki[i + 1] = n;
    PetscCall(PetscSortIntWithScalarArray(n - sub->ki[i], sub->kj + sub->ki[i], sub->ka + sub->ki[i]));
  }
  PetscCall(PetscFree(row));
  PetscCall(PetscFree(next));
  PetscFunctionReturn(0);
}

/* What is known of the unknowns, for the copies; and the ways from the matrix's vectors to them */
static PetscErrorCode LatinMatrixData_Private(LatinSubdomains *sub)
{
  const LatinUnknowns *known = &sub->known;
  const PetscInt       n     = sub->copies;
  PetscLayout          map;
  const PetscInt      *degree;

  PetscFunctionBegin;
  PetscCall(MatGetLayouts(sub->matrix, &map, NULL));
  PetscCall(PetscSFCreate(PetscObjectComm(sub->object), &sub->node_sf));
  PetscCall(PetscSFSetGraphLayout(sub->node_sf, map, n, NULL, PETSC_COPY_VALUES, sub->node));
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

/*
   A matrix with a kernel N is preconditioned as A + E a E^t would be: as many springs as N has vectors, on unknowns E
   that no vector of the kernel leaves at rest. For a right-hand side orthogonal to N this has a solution of A, since
   N^t E is regular and the springs then carry nothing; and the same spectrum on the complement of N.
*/
PetscErrorCode LatinMatrixHold_Private(LatinSubdomains *sub)
{
  MPI_Comm       comm = PetscObjectComm(sub->object);
  const PetscInt rows = sub->nodes_local, n = sub->known.kernels;
  PetscReal     *v, *pivot;
  PetscInt      *held, *copy;
  PetscMPIInt    rank;

  PetscFunctionBegin;
  if (!n) PetscFunctionReturn(0);
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(PetscMalloc4(n * rows, &v, n, &pivot, rows, &held, sub->copies, &copy));
  PetscCall(PetscArraycpy(v, sub->known.kernel, n * rows));
  PetscCall(PetscArrayzero(held, rows));
  for (PetscInt k = 0; k < sub->unassigned_count; k++)
    for (PetscInt j = 0; j < n; j++) v[rows * j + sub->unassigned[k]] = 0.0;
  for (PetscInt j = 0; j < n; j++) { /* Gauss elimination, with the largest entry of each vector as pivot */
    PetscInt at = -1;
    struct {
      PetscReal   value;
      PetscMPIInt rank;
    } mine = {0.0, rank}, best;

    for (PetscInt i = 0; i < rows; i++)
      if (PetscAbsReal(v[rows * j + i]) > mine.value) {
        at         = i;
        mine.value = PetscAbsReal(v[rows * j + i]);
      }
    PetscCallMPI(MPI_Allreduce(&mine, &best, 1, LatinByPrecision(MPI_DOUBLE_INT, MPI_FLOAT_INT), MPI_MAXLOC, comm));
    if (!(best.value > 0.0)) continue; /* depends on those before */
    if (rank == best.rank) held[at] = 1;
    for (PetscInt k = j; k < n && rank == best.rank; k++) pivot[k] = v[rows * k + at];
    PetscCallMPI(MPI_Bcast(pivot + j, (PetscMPIInt)(n - j), MPIU_REAL, best.rank, comm));
    for (PetscInt k = j + 1; k < n; k++)
      for (PetscInt i = 0; i < rows; i++) v[rows * k + i] -= v[rows * j + i] * (pivot[k] / pivot[j]);
  }
  PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_INT, held, copy));
  for (PetscInt i = 0; i < sub->copies; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++)
      if (copy[i] && sub->kj[k] == i) sub->ka[k] *= 2.0;
  PetscCall(PetscFree4(v, pivot, held, copy));
  PetscFunctionReturn(0);
}

/* The subdomains of the local matrices of sub->matrix. Collective on sub->object */
PetscErrorCode LatinSubdomainsSetUp_Matrix(LatinSubdomains *sub)
{
  MPI_Comm         comm = PetscObjectComm(sub->object);
  LatinLocalMatrix local;
  PetscMPIInt      size;
  PetscBool       *kept, *alone;
  PetscInt        *part;

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
  PetscCall(PetscMalloc3(local.rows, &kept, local.rows, &alone, local.rows, &part));
  PetscCall(LatinMatrixUnknowns_Private(sub, &local, kept, alone));
  PetscCall(LatinLocalMatrixSymmetric_Private(sub->matrix, &local, alone));
  PetscCall(LatinMatrixParts_Private(sub, &local, kept, part));
  PetscCall(LatinMatrixCopies_Private(sub, &local, part, alone, sub->row_copy));
  PetscCall(PetscFree3(kept, alone, part));
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
