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

/* The rows of a batch, of springs and no blocks, in the place of those that had its number before, if they are the same: *done */
PetscErrorCode LatinLocalSolversRenew_Private(LatinLocalSolvers *solvers, PetscInt i, const PetscReal spring[], const PetscBool held[], PetscBool *done)
{
  LatinRetired *old = i < solvers->retired ? &solvers->before[i] : NULL;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  if (!old || !old->ksp) PetscFunctionReturn(0);
  PetscCall(LatinSparseRenew_Private(solvers->sub, solvers->batches->batch[i].sub[0], spring, held, &old->rows, done));
  if (!*done) PetscFunctionReturn(0);
  solvers->rows[i] = old->rows;
  old->rows        = (LatinSparse){.i = NULL};
  PetscFunctionReturn(0);
}

/* Gives a batch, whose rows and kept rows are there, a solver that was kept for the same ones; its matrix takes the values, unless they are in it */
PetscErrorCode LatinLocalSolversRecall_Private(LatinLocalSolvers *solvers, PetscInt i, PetscBool *found)
{
  LatinSparse *rows = &solvers->rows[i];
  PetscScalar *a;

  PetscFunctionBegin;
  *found = PETSC_FALSE;
  for (PetscInt k = 0; k < solvers->retired && !*found; k++) {
    LatinRetired *old = &solvers->before[(i + k) % solvers->retired]; /* as a rule it has the number that it had */

    if (!old->ksp || (old->rows.i && old->rows.bs != rows->bs) || !old->kept != !solvers->rest[i]) continue;
    if (old->rows.i) PetscCall(LatinSameRows_Private(old->K, rows->rows, rows->i, rows->j, found));
    else *found = (PetscBool)(k == 0);
    if (*found && old->kept) PetscCall(ISEqual(old->kept, solvers->rest[i], found));
    if (!*found) continue;
    PetscCall(MatSeqAIJGetArrayWrite(old->K, &a));
    if (old->rows.i) PetscCall(PetscArraycpy(a, rows->a, rows->i[rows->rows]));
    PetscCall(MatSeqAIJRestoreArrayWrite(old->K, &a));
    if (old->rows.i) {
      PetscCall(LatinSparseReset_Private(rows));
      *rows = old->rows;
    }
    PetscCall(ISDestroy(&solvers->rest[i]));
    solvers->K[i]    = old->K;
    solvers->ksp[i]  = old->ksp;
    solvers->rest[i] = old->kept;
    PetscCall(PetscMemzero(old, sizeof(*old)));
    PetscCall(KSPSetOperators(solvers->ksp[i], solvers->K[i], solvers->K[i]));
  }
  PetscFunctionReturn(0);
}
