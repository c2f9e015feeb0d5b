/*
   A PETSc program that knows nothing of latinpc: a chain of n springs held at its ends, assembled spring by
   spring, every solver chosen on the command line.

     mpicc plain_ksp.c -o plain_ksp $(pkg-config --cflags --libs PETSc)
     mpirun -n 2 ./plain_ksp -n 40 -mat_type is -dll_append latinpc/liblatinpc.so -pc_type latin -ksp_monitor
*/
#include <petscksp.h>

int main(int argc, char **argv)
{
  PetscInt               n = 40, first, last, touched, count, *nodes;
  PetscMPIInt            rank, size;
  ISLocalToGlobalMapping map;
  Mat                    A;
  Vec                    x, b;
  KSP                    ksp;
  KSPConvergedReason     reason;
  PetscReal              error;
  char                   mat_type[64] = MATAIJ;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "A chain of springs\n"));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-n", &n, NULL));
  PetscCall(PetscOptionsGetString(NULL, NULL, "-mat_type", mat_type, sizeof(mat_type), NULL));

  /* spring s joins the masses s - 1 and s; this rank assembles the springs first..last - 1 of the n + 1, so that it
     touches the masses touched..last - 1, and shares its first and last ones with its neighbours */
  first   = rank * (n + 1) / size;
  last    = (rank + 1) * (n + 1) / size;
  touched = PetscMax(first - 1, 0);
  count   = PetscMin(last, n) - touched;
  PetscCall(PetscMalloc1(count, &nodes));
  for (PetscInt i = 0; i < count; i++) nodes[i] = touched + i;
  PetscCall(ISLocalToGlobalMappingCreate(PETSC_COMM_WORLD, 1, count, nodes, PETSC_OWN_POINTER, &map));
  PetscCall(MatCreate(PETSC_COMM_WORLD, &A));
  PetscCall(MatSetSizes(A, PETSC_DECIDE, PETSC_DECIDE, n, n));
  PetscCall(MatSetType(A, mat_type));
  PetscCall(MatSetLocalToGlobalMapping(A, map, map));
  PetscCall(MatSeqAIJSetPreallocation(A, 3, NULL));
  PetscCall(MatMPIAIJSetPreallocation(A, 3, NULL, 2, NULL));
  PetscCall(MatISSetPreallocation(A, 3, NULL, 2, NULL));
  for (PetscInt s = first; s < last; s++) {
    /* a negative index is passed over: the walls do not move */
    const PetscInt    ends[2]      = {s > 0 ? s - 1 - touched : -1, s < n ? s - touched : -1};
    const PetscScalar stiffness[4] = {1.0, -1.0, -1.0, 1.0};

    PetscCall(MatSetValuesLocal(A, 2, ends, 2, ends, stiffness, ADD_VALUES));
  }
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(A, MAT_SPD, PETSC_TRUE));

  /* b = A 1, so that the answer is known */
  PetscCall(MatCreateVecs(A, &x, &b));
  PetscCall(VecSet(x, 1.0));
  PetscCall(MatMult(A, x, b));
  PetscCall(VecSet(x, 0.0));
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &ksp));
  PetscCall(KSPSetOperators(ksp, A, A));
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetFromOptions(ksp));
  PetscCall(KSPSolve(ksp, b, x));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(VecShift(x, -1.0));
  PetscCall(VecNorm(x, NORM_INFINITY, &error));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%s, error %.1e\n", KSPConvergedReasons[reason], (double)error));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&b));
  PetscCall(MatDestroy(&A));
  PetscCall(ISLocalToGlobalMappingDestroy(&map));
  PetscCall(PetscFinalize());
  return reason > 0 ? 0 : 1;
}
