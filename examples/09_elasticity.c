/*
   Elasticity in 3D in the manner of PETSc's tutorials: a DMDA whose matrix is a MATIS, and no word of latinpc.

     mpicc examples/09_elasticity.c -o 09_elasticity $(pkg-config --cflags --libs PETSc) -lm
     mpirun -n 2 ./09_elasticity -dll_append latinpc/liblatinpc.so -pc_type latin -ksp_converged_reason
     mpirun -n 8 ./09_elasticity -cells 6 -stiff 1e6 -dll_append latinpc/liblatinpc.so -pc_type latin -ksp_view
     mpirun -n 2 ./09_elasticity -pc_type bddc

   A cube of trilinear elements is held on its face x = 0 and bears its own weight; the elements of every third layer
   are `-stiff` times as stiff as the others. Each rank's local matrix is that of its own elements; PC latin takes the
   coordinates from the DM. At the end the equilibrium is checked: the supports bear the whole weight.
*/
#include <petscdmda.h>
#include <petscksp.h>

/* Stiffness of an element of unit size, 24 x 24, Young's modulus 1, Poisson's ratio 0.3; corners as DMDAGetElements() has them */
static void Stiffness(PetscScalar K[24][24])
{
  const PetscInt corner[8][3] = {
    {0, 0, 0},
    {1, 0, 0},
    {1, 1, 0},
    {0, 1, 0},
    {0, 0, 1},
    {1, 0, 1},
    {1, 1, 1},
    {0, 1, 1}
  };
  const PetscReal nu = 0.3, lambda = nu / (1.0 + nu) / (1.0 - 2.0 * nu), mu = 0.5 / (1.0 + nu), half = 0.5 / PetscSqrtReal(3.0);

  for (PetscInt i = 0; i < 24 * 24; i++) K[i / 24][i % 24] = 0.0;
  for (PetscInt point = 0; point < 8; point++) {
    PetscReal slope[8][3];

    for (PetscInt a = 0; a < 8; a++)
      for (PetscInt c = 0; c < 3; c++) {
        slope[a][c] = corner[a][c] ? 1.0 : -1.0;
        for (PetscInt b = 0; b < 3; b++) {
          const PetscReal x = 0.5 + (corner[point][b] ? half : -half);

          if (b != c) slope[a][c] *= corner[a][b] ? x : 1.0 - x;
        }
      }
    for (PetscInt a = 0; a < 8; a++)
      for (PetscInt b = 0; b < 8; b++) {
        PetscReal dot = 0.0;

        for (PetscInt c = 0; c < 3; c++) dot += slope[a][c] * slope[b][c];
        for (PetscInt c = 0; c < 3; c++)
          for (PetscInt d = 0; d < 3; d++) K[3 * a + c][3 * b + d] += (lambda * slope[a][c] * slope[b][d] + mu * slope[a][d] * slope[b][c] + (c == d ? mu * dot : 0.0)) / 8.0;
      }
  }
}

int main(int argc, char **argv)
{
  PetscInt           cells = 6, elements, corners, n = 0, m, iterations, wrong, *held;
  const PetscInt    *element;
  PetscReal          stiff = 1.0, weight, borne[3] = {0.0, 0.0, 0.0};
  PetscScalar        K[24][24], scaled[24][24], force[24];
  const PetscScalar *x, *a;
  DM                 da;
  Vec                b, u, load, coordinates, local;
  Mat                A, whole;
  KSP                ksp;
  KSPConvergedReason reason;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "Elasticity in 3D in a MATIS\n"));
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-cells", &cells, NULL));
  PetscCall(PetscOptionsGetReal(NULL, NULL, "-stiff", &stiff, NULL));
  PetscCall(DMDACreate3d(PETSC_COMM_WORLD, DM_BOUNDARY_NONE, DM_BOUNDARY_NONE, DM_BOUNDARY_NONE, DMDA_STENCIL_BOX, cells + 1, cells + 1, cells + 1, PETSC_DECIDE, PETSC_DECIDE, PETSC_DECIDE, 3, 1, NULL, NULL, NULL, &da));
  PetscCall(DMSetMatType(da, MATIS));
  PetscCall(DMSetFromOptions(da));
  PetscCall(DMSetUp(da));
  PetscCall(DMDASetElementType(da, DMDA_ELEMENT_Q1));
  PetscCall(DMDASetUniformCoordinates(da, 0.0, cells, 0.0, cells, 0.0, cells));
  PetscCall(DMCreateMatrix(da, &A));
  PetscCall(DMCreateGlobalVector(da, &b));
  PetscCall(VecDuplicate(b, &u));

  /* the elements of this rank, and the weight of each, an eighth on each of its corners */
  Stiffness(K);
  PetscCall(DMGetCoordinatesLocal(da, &local));
  PetscCall(VecGetArrayRead(local, &x));
  PetscCall(DMDAGetElements(da, &elements, &corners, &element));
  for (PetscInt e = 0; e < elements; e++) {
    const PetscReal y     = PetscRealPart(x[3 * element[8 * e] + 1]);
    const PetscReal scale = (PetscInt)(y + 0.5) % 3 == 1 ? stiff : 1.0;

    for (PetscInt i = 0; i < 24 * 24; i++) scaled[i / 24][i % 24] = scale * K[i / 24][i % 24];
    for (PetscInt i = 0; i < 24; i++) force[i] = i % 3 == 2 ? -0.125 : 0.0;
    PetscCall(MatSetValuesBlockedLocal(A, 8, element + 8 * e, 8, element + 8 * e, &scaled[0][0], ADD_VALUES));
    PetscCall(VecSetValuesBlockedLocal(b, 8, element + 8 * e, force, ADD_VALUES));
  }
  PetscCall(DMDARestoreElements(da, &elements, &corners, &element));
  PetscCall(VecRestoreArrayRead(local, &x));
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscCall(VecAssemblyBegin(b));
  PetscCall(VecAssemblyEnd(b));
  PetscCall(MatDuplicate(A, MAT_COPY_VALUES, &whole)); /* without the supports, for their reactions */
  PetscCall(VecDuplicate(b, &load));
  PetscCall(VecCopy(b, load));

  /* the face x = 0 is held */
  PetscCall(DMGetCoordinates(da, &coordinates));
  PetscCall(VecGetLocalSize(coordinates, &m));
  PetscCall(VecGetOwnershipRange(coordinates, &iterations, NULL));
  PetscCall(PetscMalloc1(m, &held));
  PetscCall(VecGetArrayRead(coordinates, &x));
  for (PetscInt i = 0; i < m; i++)
    if (PetscRealPart(x[3 * (i / 3)]) == 0.0) held[n++] = iterations + i;
  PetscCall(VecRestoreArrayRead(coordinates, &x));
  PetscCall(MatZeroRowsColumns(A, n, held, 1.0, u, b));

  PetscCall(KSPCreate(PETSC_COMM_WORLD, &ksp));
  PetscCall(KSPSetOperators(ksp, A, A));
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetTolerances(ksp, 1e-8, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSetFromOptions(ksp));
  PetscCall(KSPSolve(ksp, b, u));
  PetscCall(KSPGetIterationNumber(ksp, &iterations));
  PetscCall(KSPGetConvergedReason(ksp, &reason));

  /* reactions: what the stiffness leaves of the load at the held nodes */
  PetscCall(MatMult(whole, u, b));
  PetscCall(VecAXPY(b, -1.0, load));
  PetscCall(VecGetOwnershipRange(b, &m, NULL));
  PetscCall(VecGetArrayRead(b, &a));
  for (PetscInt i = 0; i < n; i++) borne[held[i] % 3] += PetscRealPart(a[held[i] - m]);
  PetscCall(VecRestoreArrayRead(b, &a));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, borne, 3, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  weight = (PetscReal)(cells * cells * cells);
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%" PetscInt_FMT " iterations; the supports bear %.6f of the weight\n", iterations, (double)(borne[2] / weight)));
  wrong = reason < 0 || PetscAbsReal(borne[2] / weight - 1.0) > 1e-5;

  PetscCall(PetscFree(held));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(MatDestroy(&whole));
  PetscCall(MatDestroy(&A));
  PetscCall(VecDestroy(&load));
  PetscCall(VecDestroy(&b));
  PetscCall(VecDestroy(&u));
  PetscCall(DMDestroy(&da));
  PetscCall(PetscFinalize());
  return (int)wrong;
}
