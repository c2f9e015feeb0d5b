/*
   A structure given in pieces by all ranks, and the preconditioner behind a PCSHELL, for a program that insists on one.

     mpicc examples/05_shell.c -o 05_shell $(pkg-config --cflags --libs PETSc) -Ilatinpc/include -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc -lm
     ./05_shell
     mpirun -n 2 ./05_shell -bays 200 -pc_latin_subdomains 20 -ksp_monitor

   A cantilever truss of square bays with one diagonal each, pulled down at its end. Each rank makes its own bays: their
   nodes, numbered one rank after the other, and their links, which may end at a node of the next rank. The truss is
   statically determinate, so the deflection of its end is known: the sum over the links of (tension)^2 / (k F). Its
   interfaces are pairs of nodes, which the macro displacements hold entirely: CG needs one iteration.
*/
#include <latinpc.h>
#include <petscdm.h>

int main(int argc, char **argv)
{
  const PetscReal stiffness = 1e6, force = 1.0; /* N/m, N */
  PetscReal      *x, *load, *k, *displacement, expected = 0.0, deflection;
  PetscInt       *ends, *law, bays = 100, first, last, nodes, links = 0, iterations, wrong = 0;
  PetscBool      *fixed;
  PetscMPIInt     rank, size;
  LatinStructure  truss;
  DM              dm;
  Mat             K;
  Vec             u, b;
  KSP             ksp;
  PC              pc;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "A cantilever truss\n"));
  PetscCall(LatinInitializePackage());
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-bays", &bays, NULL));

  /* node 2 i is at (i, 0), node 2 i + 1 at (i, 1); this rank makes the pairs first..last - 1 and the bays behind them */
  first = rank * (bays + 1) / size;
  last  = (rank + 1) * (bays + 1) / size;
  nodes = 2 * (last - first);
  PetscCall(PetscCalloc6(2 * nodes, &x, 2 * nodes, &fixed, 2 * nodes, &load, 4 * nodes, &ends, 2 * nodes, &law, 2 * nodes, &k));
  for (PetscInt i = first; i < last; i++) {
    const PetscInt a = 2 * (i - first), pairs[4][2] = {
                                          {2 * i,     2 * i + 1},
                                          {2 * i,     2 * i + 2},
                                          {2 * i + 1, 2 * i + 3},
                                          {2 * i + 1, 2 * i + 2}
    };
    const PetscReal moment = bays - i; /* of the unit force about the bay's left edge */

    x[2 * a] = x[2 * a + 2] = i;
    x[2 * a + 3]            = 1.0;
    for (PetscInt c = 0; c < 4; c++) fixed[2 * a + c] = i ? PETSC_FALSE : PETSC_TRUE;
    if (i == bays) load[2 * a + 1] = -force;
    /* vertical (not between the supports), lower and upper chord, diagonal that falls away from the wall */
    for (PetscInt l = i ? 0 : 1; l < (i < bays ? 4 : 1); l++, links++) {
      ends[2 * links]     = pairs[l][0];
      ends[2 * links + 1] = pairs[l][1];
      law[links]          = LATIN_LAW_BAR;
      k[links]            = stiffness;
    }
    /* squares of the tensions: vertical 1 (0 at the end), chords by the moments about both edges of the bay, diagonal 2 */
    if (i && i < bays) expected += 1.0;
    if (i < bays) expected += PetscSqr(moment) + PetscSqr(moment - 1.0) + 2.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &expected, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 2, nodes, PETSC_DETERMINE, x, links, ends, &truss));
  PetscCall(LatinStructureSetLaws(truss, law, k, NULL));
  PetscCall(LatinStructureSetSupports(truss, fixed, NULL));
  PetscCall(LatinStructureSetLoads(truss, load));
  PetscCall(LatinStructureSetUp(truss));

  /* K u = b with b = - r(0) */
  PetscCall(LatinStructureGetDM(truss, &dm));
  PetscCall(DMCreateMatrix(dm, &K));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(VecDuplicate(u, &b));
  PetscCall(LatinStructureComputeJacobian(truss, u, K));
  PetscCall(LatinStructureComputeResidual(truss, u, b));
  PetscCall(VecScale(b, -1.0));
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &ksp));
  PetscCall(KSPSetOperators(ksp, K, K));
  PetscCall(KSPSetType(ksp, KSPCG));
  PetscCall(KSPSetTolerances(ksp, 1e-8, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetLatin(pc));
  PetscCall(KSPSetFromOptions(ksp));
  PetscCall(KSPSolve(ksp, b, u));
  PetscCall(KSPGetIterationNumber(ksp, &iterations));

  PetscCall(PetscMalloc1(2 * nodes, &displacement));
  PetscCall(LatinStructureGetDisplacements(truss, u, displacement)); /* of this rank's nodes */
  if (rank == size - 1) {
    expected *= force / stiffness;
    deflection = -displacement[2 * nodes - 3];
    wrong      = PetscAbsReal(deflection / expected - 1.0) < 1e-6 ? 0 : 1;
    PetscCall(PetscPrintf(PETSC_COMM_SELF, "the end sinks by %.6f m, expected %.6f m; %" PetscInt_FMT " iterations\n", (double)deflection, (double)expected, iterations));
  }
  PetscCall(PetscFree(displacement));
  PetscCall(PetscFree6(x, fixed, load, ends, law, k));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(MatDestroy(&K));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&b));
  PetscCall(LatinStructureDestroy(&truss));
  PetscCall(PetscFinalize());
  return wrong;
}
