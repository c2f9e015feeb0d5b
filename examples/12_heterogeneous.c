/*
   Heat through a heterogeneous square: Poisson's equation in 2D on a DMDA whose matrix is a MATIS, coefficients that jump
   by `-contrast`, one preconditioner or two side by side, and no word of latinpc.

     mpicc examples/12_heterogeneous.c -o 12_heterogeneous $(pkg-config --cflags --libs PETSc) -lm
     mpirun -n 2 ./12_heterogeneous -dll_append latinpc/liblatinpc.so -pc_type latin -other_pc_type bddc
     mpirun -n 4 ./12_heterogeneous -cells 48 -pattern inclusions -dll_append latinpc/liblatinpc.so -pc_type latin -other_pc_type bddc
     mpirun -n 4 ./12_heterogeneous -pattern random -dll_append latinpc/liblatinpc.so -pc_type latin -pc_latin_modes_local 0

   A square of bilinear elements is held at temperatures 0 on its side x = 0 and 1 on the opposite one. `-pattern` says
   which elements conduct `-contrast` times (1e6) as well as the others: channels across the square, inclusions, or each
   by a random power of it. At the end the heat that enters must be that of the energy, and both solvers must find the same.
*/
#include <petscdmda.h>
#include <petscksp.h>

static const char *const Patterns[] = {"channels", "inclusions", "random", "Pattern", "", NULL};

/* Conductivity of the element whose lower left corner is node (i, j) */
static PetscReal Conductivity(PetscInt pattern, PetscReal contrast, PetscInt i, PetscInt j)
{
  const PetscReal wave = 43758.5453 * PetscSinReal(12.9898 * i + 78.233 * j);

  if (pattern == 0) return j % 8 == 3 || (i % 8 == 5 && j % 16 > 8) ? contrast : 1.0;
  if (pattern == 1) return i % 5 < 3 && j % 5 < 3 ? contrast : 1.0;
  return PetscPowReal(contrast, wave - PetscFloorReal(wave));
}

/* Solves with the options of a prefix; flow: the heat by its energy, and as it enters at the held unknowns */
static PetscErrorCode Solve(const char prefix[], Mat A, Mat whole, Vec b, Vec u, PetscInt n, const PetscInt held[], PetscReal flow[2], PetscBool *converged)
{
  KSP                ksp;
  PC                 pc;
  PCType             type;
  KSPConvergedReason reason;
  PetscInt           iterations, start;
  PetscLogDouble     begin, middle, end;
  const PetscScalar *a;
  Vec                heat;

  PetscFunctionBeginUser;
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &ksp));
  PetscCall(KSPSetOptionsPrefix(ksp, prefix));
  PetscCall(KSPSetOperators(ksp, A, A));
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetNormType(ksp, KSP_NORM_NATURAL)); /* the energy norm does not mind jumps */
  PetscCall(KSPSetTolerances(ksp, 1e-8, PETSC_DEFAULT, PETSC_DEFAULT, 500));
  PetscCall(KSPSetFromOptions(ksp));
  PetscCall(PetscTime(&begin));
  PetscCall(KSPSetUp(ksp));
  PetscCall(PetscTime(&middle));
  PetscCall(KSPSolve(ksp, b, u));
  PetscCall(PetscTime(&end));
  PetscCall(KSPGetIterationNumber(ksp, &iterations));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCGetType(pc, &type));

  PetscCall(VecDuplicate(b, &heat));
  PetscCall(MatMult(whole, u, heat));
  PetscCall(VecDot(u, heat, &flow[0])); /* between temperatures 0 and 1, the energy is the heat */
  PetscCall(VecGetOwnershipRange(b, &start, NULL));
  PetscCall(VecGetArrayRead(heat, &a));
  flow[1] = 0.0;
  for (PetscInt i = 0; i < n; i++)
    if (PetscRealPart(a[held[i] - start]) > 0.0) flow[1] += PetscRealPart(a[held[i] - start]);
  PetscCall(VecRestoreArrayRead(heat, &a));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, flow + 1, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  *converged = (PetscBool)(reason > 0);
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%-6s %3" PetscInt_FMT " iterations, %s; set-up %.3f s, solve %.3f s; heat %.8g\n", type, iterations, KSPConvergedReasons[reason], middle - begin, end - middle, (double)flow[0]));
  PetscCall(VecDestroy(&heat));
  PetscCall(KSPDestroy(&ksp));
  PetscFunctionReturn(0);
}

int main(int argc, char **argv)
{
  /* bilinear functions on a square of any size; corners as DMDAGetElements() has them */
  const PetscScalar K[4][4] = {
    {4,  -1, -2, -1},
    {-1, 4,  -1, -2},
    {-2, -1, 4,  -1},
    {-1, -2, -1, 4 }
  };
  PetscInt           cells = 32, elements, corners, n = 0, m, start, *held;
  const PetscInt    *element;
  PetscEnum          pattern  = (PetscEnum)0;
  PetscReal          contrast = 1e6, flow[2], other[2];
  PetscScalar        scaled[4][4];
  const PetscScalar *x;
  PetscBool          two = PETSC_FALSE, converged, wrong;
  DM                 da;
  Vec                b, u, coordinates, local;
  Mat                A, whole;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "Poisson's equation with coefficients that jump, in a MATIS\n"));
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-cells", &cells, NULL));
  PetscCall(PetscOptionsGetReal(NULL, NULL, "-contrast", &contrast, NULL));
  PetscCall(PetscOptionsGetEnum(NULL, NULL, "-pattern", Patterns, &pattern, NULL));
  PetscCall(PetscOptionsHasName(NULL, "other_", "-pc_type", &two));
  PetscCall(DMDACreate2d(PETSC_COMM_WORLD, DM_BOUNDARY_NONE, DM_BOUNDARY_NONE, DMDA_STENCIL_BOX, cells + 1, cells + 1, PETSC_DECIDE, PETSC_DECIDE, 1, 1, NULL, NULL, &da));
  PetscCall(DMSetMatType(da, MATIS));
  PetscCall(DMSetFromOptions(da));
  PetscCall(DMSetUp(da));
  PetscCall(DMDASetElementType(da, DMDA_ELEMENT_Q1));
  PetscCall(DMDASetUniformCoordinates(da, 0.0, cells, 0.0, cells, 0.0, 0.0));
  PetscCall(DMCreateMatrix(da, &A));
  PetscCall(DMCreateGlobalVector(da, &b));
  PetscCall(VecDuplicate(b, &u));

  /* the elements of this rank */
  PetscCall(DMGetCoordinatesLocal(da, &local));
  PetscCall(VecGetArrayRead(local, &x));
  PetscCall(DMDAGetElements(da, &elements, &corners, &element));
  for (PetscInt e = 0; e < elements; e++) {
    const PetscScalar *at    = x + 2 * element[4 * e];
    const PetscReal    scale = Conductivity((PetscInt)pattern, contrast, (PetscInt)(PetscRealPart(at[0]) + 0.5), (PetscInt)(PetscRealPart(at[1]) + 0.5)) / 6.0;

    for (PetscInt i = 0; i < 16; i++) scaled[i / 4][i % 4] = scale * K[i / 4][i % 4];
    PetscCall(MatSetValuesLocal(A, 4, element + 4 * e, 4, element + 4 * e, &scaled[0][0], ADD_VALUES));
  }
  PetscCall(DMDARestoreElements(da, &elements, &corners, &element));
  PetscCall(VecRestoreArrayRead(local, &x));
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatDuplicate(A, MAT_COPY_VALUES, &whole)); /* as it is without the temperatures that are held, for the heat that flows there */

  /* temperatures 0 and 1 on two sides */
  PetscCall(DMGetCoordinates(da, &coordinates));
  PetscCall(VecGetLocalSize(b, &m));
  PetscCall(VecGetOwnershipRange(b, &start, NULL));
  PetscCall(PetscMalloc1(m, &held));
  PetscCall(VecGetArrayRead(coordinates, &x));
  for (PetscInt i = 0; i < m; i++) {
    const PetscReal side = PetscRealPart(x[2 * i]) / cells;

    if (side > 0.0 && side < 1.0) continue;
    PetscCall(VecSetValue(u, start + i, side, INSERT_VALUES));
    held[n++] = start + i;
  }
  PetscCall(VecRestoreArrayRead(coordinates, &x));
  PetscCall(VecAssemblyBegin(u));
  PetscCall(VecAssemblyEnd(u));
  PetscCall(MatMult(A, u, b)); /* what they do to the others */
  PetscCall(VecScale(b, -1.0));
  PetscCall(VecGetArrayRead(u, &x));
  for (PetscInt i = 0; i < n; i++) PetscCall(VecSetValue(b, held[i], x[held[i] - start], INSERT_VALUES));
  PetscCall(VecRestoreArrayRead(u, &x));
  PetscCall(VecAssemblyBegin(b));
  PetscCall(VecAssemblyEnd(b));
  PetscCall(MatZeroRowsColumns(A, n, held, 1.0, NULL, NULL));

  PetscCall(Solve(NULL, A, whole, b, u, n, held, flow, &converged));
  wrong = (PetscBool)(!converged || PetscAbsReal(flow[0] - flow[1]) > 1e-2 * flow[0]);
  if (two) {
    PetscCall(Solve("other_", A, whole, b, u, n, held, other, &converged));
    if (!converged || PetscAbsReal(other[0] - flow[0]) > 1e-6 * flow[0]) wrong = PETSC_TRUE;
  }

  PetscCall(PetscFree(held));
  PetscCall(MatDestroy(&whole));
  PetscCall(MatDestroy(&A));
  PetscCall(VecDestroy(&b));
  PetscCall(VecDestroy(&u));
  PetscCall(DMDestroy(&da));
  PetscCall(PetscFinalize());
  return (int)wrong;
}
