/*
   A PETSc program that knows nothing of latinpc: u_i + u_i^3 / 10 balanced by a chain of springs, every solver chosen
   on the command line.

     mpicc plain_snes.c -o plain_snes $(pkg-config --cflags --libs PETSc)
     ./plain_snes -dll_append latinpc/liblatinpc.so -snes_type latin
*/
#include <petscsnes.h>

static PetscErrorCode Residual(SNES snes, Vec u, Vec r, void *ctx)
{
  const PetscScalar *x;
  PetscScalar       *f;
  PetscInt           n;

  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetArrayRead(u, &x));
  PetscCall(VecGetArray(r, &f));
  for (PetscInt i = 0; i < n; i++) f[i] = 2.0 * x[i] - (i > 0 ? x[i - 1] : 0.0) - (i < n - 1 ? x[i + 1] : 0.0) + x[i] + x[i] * x[i] * x[i] / 10.0 - 1.0;
  PetscCall(VecRestoreArrayRead(u, &x));
  PetscCall(VecRestoreArray(r, &f));
  PetscFunctionReturn(0);
}

static PetscErrorCode Jacobian(SNES snes, Vec u, Mat J, Mat P, void *ctx)
{
  const PetscScalar *x;
  PetscInt           n;

  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(u, &n));
  PetscCall(VecGetArrayRead(u, &x));
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt    columns[3] = {i - 1, i, i < n - 1 ? i + 1 : -1};
    const PetscScalar row[3]     = {-1.0, 3.0 + 0.3 * x[i] * x[i], -1.0};

    PetscCall(MatSetValues(P, 1, &i, 3, columns, row, INSERT_VALUES));
  }
  PetscCall(VecRestoreArrayRead(u, &x));
  PetscCall(MatAssemblyBegin(P, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(P, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(0);
}

int main(int argc, char **argv)
{
  PetscInt            n = 40;
  SNES                snes;
  Mat                 J;
  Vec                 u, r;
  SNESConvergedReason reason;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "A nonlinear chain of springs, on one rank\n"));
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, 3, NULL, &J));
  PetscCall(MatCreateVecs(J, &u, &r));
  PetscCall(SNESCreate(PETSC_COMM_SELF, &snes));
  PetscCall(SNESSetFunction(snes, r, Residual, NULL));
  PetscCall(SNESSetJacobian(snes, J, J, Jacobian, NULL));
  PetscCall(SNESSetFromOptions(snes));
  PetscCall(SNESSolve(snes, NULL, u));
  PetscCall(SNESGetConvergedReason(snes, &reason));
  PetscCall(PetscPrintf(PETSC_COMM_SELF, "%s\n", SNESConvergedReasons[reason]));
  PetscCall(SNESDestroy(&snes));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&r));
  PetscCall(MatDestroy(&J));
  PetscCall(PetscFinalize());
  return reason > 0 ? 0 : 1;
}
