/*
   A net of three cables in C.

     mpicc examples/01_net.c -o 01_net $(pkg-config --cflags --libs PETSc) -Ilatinpc/include -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc
     ./01_net
     mpirun -n 2 ./01_net -snes_latin_subdomains 3 -snes_latin_monitor

   A weight hangs from two cables at right angles; a third one ties it to the ground. The weight sinks, the tie
   becomes slack and carries nothing, so each of the other two carries F / sqrt(2) and the weight sinks by F / k:
   1 mm here. Were the tie a bar, it would be half of that.

   Where latinpc is installed, python -c "import latinpc; print(latinpc.get_include(), latinpc.get_library())" tells the
   two folders. The same in Python: 01_net.py.
*/
#include <latinpc.h>
#include <petscdm.h>

int main(int argc, char **argv)
{
  const PetscReal nodes[]     = {-1, 1, 1, 1, 0, -1, 0, 0};
  const PetscInt  ends[]      = {0, 3, 1, 3, 2, 3};
  const PetscInt  law[]       = {LATIN_LAW_CABLE, LATIN_LAW_CABLE, LATIN_LAW_CABLE};
  const PetscReal stiffness[] = {1e4, 1e4, 1e4}; /* N/m */
  const PetscBool fixed[]     = {PETSC_TRUE, PETSC_TRUE, PETSC_TRUE, PETSC_TRUE, PETSC_TRUE, PETSC_TRUE, PETSC_FALSE, PETSC_FALSE};
  const PetscReal force[]     = {0, 0, 0, 0, 0, 0, 0, -10}; /* N */
  PetscReal       displacement[8], tension[3];
  PetscInt        iterations, wrong = 0;
  PetscMPIInt     rank;
  LatinStructure  net;
  SNES            snes;
  DM              dm;
  Vec             u;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "A net of three cables\n"));
  PetscCall(LatinInitializePackage());
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));

  /* the first rank gives all nodes and links, the others none: the solver shares them out */
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 2, rank ? 0 : 4, 4, nodes, rank ? 0 : 3, ends, &net));
  PetscCall(LatinStructureSetLaws(net, law, stiffness, NULL));
  PetscCall(LatinStructureSetSupports(net, fixed, NULL));
  PetscCall(LatinStructureSetLoads(net, force));
  PetscCall(LatinStructureSetUp(net));

  PetscCall(SNESCreate(PETSC_COMM_WORLD, &snes));
  PetscCall(LatinStructureAttachSNES(net, snes));
  PetscCall(SNESSetType(snes, SNESLATIN));
  PetscCall(SNESSetFromOptions(snes));
  PetscCall(LatinStructureGetDM(net, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(SNESSolve(snes, NULL, u));

  PetscCall(LatinStructureGetDisplacements(net, u, displacement)); /* each rank gets back what it gave */
  PetscCall(SNESLatinGetTensions(snes, tension));
  PetscCall(SNESGetIterationNumber(snes, &iterations));
  if (!rank) {
    PetscCall(PetscPrintf(PETSC_COMM_SELF, "the weight sinks by %.4f mm\n", -1e3 * displacement[7]));
    PetscCall(PetscPrintf(PETSC_COMM_SELF, "tensions %.2f, %.2f, %.2f N after %" PetscInt_FMT " iterations\n", tension[0], tension[1], tension[2], iterations));
    wrong = PetscAbsReal(displacement[7] + 1e-3) < 1e-7 ? 0 : 1;
  }
  PetscCall(VecDestroy(&u));
  PetscCall(SNESDestroy(&snes));
  PetscCall(LatinStructureDestroy(&net));
  PetscCall(PetscFinalize());
  return wrong;
}
