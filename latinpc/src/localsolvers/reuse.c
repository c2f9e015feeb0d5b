#include "localsolvers/latinlocalsolvers.h"

/*
   New values in matrices of an old pattern: their solvers take them over with the symbolic phase, which is the order of
   elimination and the structure of the factor. Patterns are compared entry by entry, so that no one has to promise that they are the same.
*/

/* Has the matrix, of one rank, these rows? */
PetscErrorCode LatinSameRows_Private(Mat K, PetscInt rows, const PetscInt i[], const PetscInt j[], PetscBool *same)
{
  const PetscInt *ki, *kj;
  PetscInt        n;
  PetscBool       done;

  PetscFunctionBegin;
  PetscCall(MatGetRowIJ(K, 0, PETSC_FALSE, PETSC_FALSE, &n, &ki, &kj, &done));
  PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_PLIB, "The rows of a matrix cannot be read");
  *same = (PetscBool)(n == rows && ki[n] == i[rows]);
  if (*same) PetscCall(PetscArraycmp(ki, i, rows + 1, same));
  if (*same) PetscCall(PetscArraycmp(kj, j, i[rows], same));
  PetscCall(MatRestoreRowIJ(K, 0, PETSC_FALSE, PETSC_FALSE, &n, &ki, &kj, &done));
  PetscFunctionReturn(0);
}

/* Gives a batch, whose rows and kept rows are there, a solver that was kept for the same ones; its matrix takes the values */
PetscErrorCode LatinLocalSolversRecall_Private(LatinLocalSolvers *solvers, PetscInt i, PetscBool *found)
{
  LatinSparse *rows = &solvers->rows[i];
  PetscScalar *a;

  PetscFunctionBegin;
  *found = PETSC_FALSE;
  for (PetscInt k = 0; k < solvers->retired && !*found; k++) {
    LatinRetired *old = &solvers->before[(i + k) % solvers->retired]; /* as a rule it has the number that it had */

    if (!old->ksp || old->rows.bs != rows->bs || !old->kept != !solvers->rest[i]) continue;
    PetscCall(LatinSameRows_Private(old->K, rows->rows, rows->i, rows->j, found));
    if (*found && old->kept) PetscCall(ISEqual(old->kept, solvers->rest[i], found));
    if (!*found) continue;
    PetscCall(MatSeqAIJGetArrayWrite(old->K, &a));
    PetscCall(PetscArraycpy(a, rows->a, rows->i[rows->rows]));
    PetscCall(MatSeqAIJRestoreArrayWrite(old->K, &a));
    PetscCall(LatinSparseReset_Private(rows));
    PetscCall(ISDestroy(&solvers->rest[i]));
    *rows            = old->rows;
    solvers->K[i]    = old->K;
    solvers->ksp[i]  = old->ksp;
    solvers->rest[i] = old->kept;
    PetscCall(PetscMemzero(old, sizeof(*old)));
    PetscCall(KSPSetOperators(solvers->ksp[i], solvers->K[i], solvers->K[i]));
  }
  PetscFunctionReturn(0);
}
