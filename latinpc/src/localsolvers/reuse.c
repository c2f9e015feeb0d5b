#include "localsolvers/latinlocalsolvers.h"

/*
   Reuse of solvers for new values in matrices of the same pattern, with their symbolic factorisation: order of elimination and structure of the factor.
   Patterns are compared entry by entry, so that the caller need not promise that they are equal.
*/

/* Sets *same: whether the sequential matrix K has this pattern */
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

/* Assembles the rows of batch i (springs, no blocks) into the retired rows of the same number. *done: the pattern is the same; else nothing */
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

/*
   Finds a retired solver with the rows and kept rows of batch i, and copies the new values to its matrix, unless they are there. *found: it becomes the
   solver of the batch
*/
PetscErrorCode LatinLocalSolversRecall_Private(LatinLocalSolvers *solvers, PetscInt i, PetscBool *found)
{
  LatinSparse *rows = &solvers->rows[i];
  PetscScalar *a;

  PetscFunctionBegin;
  *found = PETSC_FALSE;
  for (PetscInt k = 0; k < solvers->retired && !*found; k++) {
    LatinRetired *old = &solvers->before[(i + k) % solvers->retired]; /* usually that of the same number */

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
