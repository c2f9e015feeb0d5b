#include "subdomains/localmatrix.h"

/*
   New values of a MATIS with the sparsity pattern of the last set-up. Subdomains and copies are kept if a new set-up would make
   the same ones. This depends on the pattern of nonzero values, which is compared entry by entry.
*/

/* New values of the operators */
typedef struct {
  PetscInt  *place; /* [copies] 1 + position of the entry of the current row in this column; those of other rows are outside its range */
  PetscBool *has;   /* [entries] whether an entry has a value, if values are summed */
  PetscInt   left;  /* number of entries without a value yet */
  PetscBool  same;  /* the pattern is the same */
  PetscBool  check; /* symmetry must be checked entry by entry */
} LatinValues;

/* Whether row r, which no subdomain has, has no entries but the diagonal one of an isolated unknown */
static PetscBool LatinValuesIsolated(const LatinSubdomains *sub, const LatinLocalMatrix *local, PetscInt r)
{
  for (PetscInt k = local->i[r]; k < local->i[r + 1]; k++)
    if (local->a[k] != 0.0 && (sub->row_copy[r] != LATIN_ROW_ISOLATED || local->j[k] != r)) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Stores a value of entry e, or adds it to those that it has */
static void LatinValuesStore(LatinSubdomains *sub, LatinValues *values, PetscInt e, PetscReal value)
{
  const PetscBool more = (PetscBool)(sub->sums && values->has[e]);

  sub->ka[e] = more ? sub->ka[e] + value : value;
  if (sub->sums) values->has[e] = PETSC_TRUE;
  if (!more) values->left--;
}

/* Copies the values of row r into those of its copy */
static PetscErrorCode LatinValuesRow_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, PetscInt r, LatinValues *values)
{
  const PetscInt *copy = sub->row_copy, first = sub->ki[copy[r]], last = sub->ki[copy[r] + 1];

  PetscFunctionBegin;
  for (PetscInt k = first; k < last; k++) values->place[sub->kj[k]] = k + 1;
  for (PetscInt k = local->i[r]; k < local->i[r + 1]; k++) {
    const PetscInt at     = copy[local->j[k]];
    PetscReal      across = 0.0;

    if (local->a[k] == 0.0) continue;
    if (at >= 0 && values->place[at] > first && values->place[at] <= last) LatinValuesStore(sub, values, values->place[at] - 1, local->a[k]);
    else {
      if (at >= 0) PetscCall(LatinLocalMatrixAcross_Private(local, r, k, &across));
      if (across != 0.0) values->same = PETSC_FALSE;
      values->check = PETSC_TRUE;
    }
  }
  PetscFunctionReturn(0);
}

/* Copies the new values into the rows of the operators. *same: the pattern is the same here; *check: symmetry must be checked entry by entry */
static PetscErrorCode LatinMatrixValues_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, PetscBool *same, PetscBool *check)
{
  LatinValues values = {.left = sub->ki[sub->copies], .same = (PetscBool)(local->rows == sub->rows && !sub->dense), .check = *check};

  PetscFunctionBegin;
  PetscCall(PetscCalloc2(sub->copies, &values.place, sub->sums ? values.left : 0, &values.has));
  for (PetscInt r = 0; r < local->rows && values.same; r++) {
    if (sub->row_copy[r] >= 0) PetscCall(LatinValuesRow_Private(sub, local, r, &values));
    else values.same = LatinValuesIsolated(sub, local, r);
  }
  if (values.left) values.same = PETSC_FALSE;
  if (sub->sums) {
    values.check = PETSC_TRUE;
    if (values.same) PetscCall(LatinMatrixMirror_Private(sub));
  }
  PetscCall(PetscFree2(values.place, values.has));
  *same  = values.same;
  *check = values.check;
  PetscFunctionReturn(0);
}

/* Sets *symmetric: whether the operators are finite and symmetric. The entries of a column below the diagonal are in the order of the rows above it */
static PetscErrorCode LatinMatrixIsSymmetric_Private(const LatinSubdomains *sub, PetscBool *symmetric)
{
  const PetscInt  *ki = sub->ki, *kj = sub->kj;
  const PetscReal *ka = sub->ka;
  PetscReal       *largest, finite = 0.0;
  PetscInt        *next;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(sub->copies, &next, sub->copies, &largest));
  PetscCall(PetscArraycpy(next, ki, sub->copies));
  for (PetscInt i = 0; i < sub->copies; i++) {
    PetscReal most = 0.0;

    for (PetscInt k = ki[i]; k < ki[i + 1]; k++) {
      most = PetscMax(most, PetscAbsReal(ka[k]));
      finite += 0.0 * ka[k];
    }
    largest[i] = most;
  }
  *symmetric = (PetscBool)(finite == 0.0); /* NaN otherwise */
  for (PetscInt i = 0; i < sub->copies; i++)
    for (PetscInt k = ki[i + 1] - 1; k >= ki[i] && kj[k] > i; k--) {
      const PetscInt j = kj[k];

      if (PetscAbsReal(ka[k] - ka[next[j]++]) > LATIN_MATRIX_ASYMMETRY * PetscMax(largest[i], largest[j])) *symmetric = PETSC_FALSE;
    }
  PetscCall(PetscFree2(next, largest));
  PetscFunctionReturn(0);
}

/* Updates the near null space at the copies; *same: coordinates and fields are those of the last set-up. Collective on sub->object */
static PetscErrorCode LatinMatrixKnown_Private(LatinSubdomains *sub, PetscBool *same)
{
  const LatinUnknowns *known = &sub->known;
  const PetscInt       n     = sub->copies;
  PetscReal           *x;
  PetscInt            *field;
  PetscBool            equal;

  PetscFunctionBegin;
  *same = PETSC_FALSE;
  if (sub->dim != known->dim || sub->fields != known->fields || sub->nears != known->nears) PetscFunctionReturn(0); /* on all ranks */
  PetscCall(PetscMalloc2(sub->dim * n, &x, n, &field));
  if (sub->dim) PetscCall(LatinSFBcast_Private(sub->node_sf, sub->dim, MPIU_REAL, known->x, x));
  PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_INT, known->field, field));
  for (PetscInt k = 0; k < known->nears; k++) PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_REAL, known->near + sub->nodes_local * k, sub->near + n * k));
  PetscCall(PetscArraycmp(x, sub->x, sub->dim * n, same));
  PetscCall(PetscArraycmp(field, sub->field, n, &equal));
  *same = (PetscBool)(*same && equal);
  PetscCall(PetscFree2(x, field));
  PetscFunctionReturn(0);
}

/*
   Copies new values from sub->matrix. *same: subdomains and copies remain valid on all ranks; otherwise their data is undefined and a new set-up is
   needed. Collective on sub->object
*/
PetscErrorCode LatinSubdomainsRefresh_Matrix(LatinSubdomains *sub, PetscBool *same)
{
  MPI_Comm         comm = PetscObjectComm(sub->object);
  LatinLocalMatrix local;
  PetscBool        pattern = PETSC_FALSE, places, check = PETSC_FALSE, known, symmetric;
  PetscInt         any[3];

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Subdomains, sub->object, 0, 0, 0));
  PetscCall(LatinLocalMatrixGet_Private(sub->matrix, &local));
  PetscCall(LatinMatrixKnown_Private(sub, &places));
  PetscCall(LatinMatrixValues_Private(sub, &local, &pattern, &check));
  PetscCall(MatIsSymmetricKnown(sub->matrix, &known, &symmetric));
  if (known && !symmetric) check = PETSC_TRUE;
  if (pattern && !check) {
    PetscCall(LatinMatrixIsSymmetric_Private(sub, &symmetric));
    check = (PetscBool)!symmetric;
  }
  any[0] = pattern && places ? 0 : 1;
  any[1] = check ? 1 : 0;
  any[2] = sub->unassigned_count;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 3, MPIU_INT, MPI_MAX, comm));
  *same = (PetscBool)!any[0];
  if (any[1] && *same) PetscCall(LatinLocalMatrixSymmetric_Private(sub->matrix, &local, sub->row_copy));
  if (any[2] && *same) PetscCall(LatinMatrixIsolated_Private(sub, &local));
  PetscCall(LatinLocalMatrixRestore_Private(&local));
  if (*same) PetscCall(LatinMatrixHold_Private(sub));
  PetscCall(PetscLogEventEnd(LATIN_Subdomains, sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}
