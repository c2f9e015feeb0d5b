#include "subdomains/localmatrix.h"

/*
   New values of a MATIS with the sparsity pattern of the last set-up. Subdomains and copies are kept if a new set-up would make
   the same ones. This depends on the pattern of nonzero values, which is compared entry by entry.
*/

/* Copies the new values into the rows of the operators. *same: the pattern is the same here; *check: symmetry must be checked entry by entry */
static PetscErrorCode LatinMatrixValues_Private(LatinSubdomains *sub, const LatinLocalMatrix *local, PetscBool *same, PetscBool *check)
{
  const PetscInt *ki = sub->ki, *kj = sub->kj, *copy = sub->row_copy;
  PetscReal      *ka = sub->ka;
  /* [copies] 1 + position of the entry of the current row in this column; number of entries without a value yet */
  PetscInt  *place, left = ki[sub->copies];
  PetscBool *has;

  PetscFunctionBegin;
  *same = (PetscBool)(local->rows == sub->rows && !sub->dense);
  PetscCall(PetscCalloc2(sub->copies, &place, sub->sums ? left : 0, &has));
  for (PetscInt r = 0; r < local->rows && *same; r++) {
    const PetscInt i = copy[r], first = i < 0 ? 0 : ki[i], last = i < 0 ? 0 : ki[i + 1], end = local->i[r + 1];

    for (PetscInt k = first; k < last; k++) place[kj[k]] = k + 1;
    for (PetscInt k = local->i[r]; k < end; k++) {
      const PetscInt  column = local->j[k], at = copy[column];
      const PetscReal value  = local->a[k];
      PetscReal       across = 0.0;

      if (value == 0.0) continue;
      if (i < 0) *same = (PetscBool)(*same && i == LATIN_ROW_ISOLATED && column == r);
      else if (at >= 0 && place[at] > first && place[at] <= last) {
        /* positions of other rows in place[] are outside first..last */
        const PetscInt  e    = place[at] - 1;
        const PetscBool more = (PetscBool)(sub->sums && has[e]);

        ka[e] = more ? ka[e] + value : value;
        if (sub->sums) has[e] = PETSC_TRUE;
        if (!more) left--;
      } else {
        if (at >= 0) PetscCall(LatinLocalMatrixAcross_Private(local, r, k, &across));
        *same  = (PetscBool)(*same && across == 0.0);
        *check = PETSC_TRUE;
      }
    }
  }
  if (left) *same = PETSC_FALSE;
  if (sub->sums) {
    *check = PETSC_TRUE;
    if (*same) PetscCall(LatinMatrixMirror_Private(sub));
  }
  PetscCall(PetscFree2(place, has));
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
  PetscBool        pattern, places, check = PETSC_FALSE, known, symmetric;
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
