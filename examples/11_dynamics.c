/*
   A weight on a slack rope that cannot stretch: it falls, the rope jerks taut, and the weight hangs still.

     mpicc examples/11_dynamics.c -o 11_dynamics $(pkg-config --cflags --libs PETSc) -Ilatinpc/include -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc -lm
     ./11_dynamics
     ./11_dynamics -ts_latin_monitor -weights 3
     mpirun -n 2 ./11_dynamics -weights 8 -snes_latin_subdomains 2 -snes_stol 1e-7

   A hook, ropes and weights in a row below it, along one coordinate; every rope is slack by 2 cm. The weights fall freely
   until a rope is taut; the shock takes their velocity away, and in the end all hang still. Each rope is then taut, and
   bears the weights below it: that is known.
*/
#include <latinpc.h>
#include <petscdm.h>

int main(int argc, char **argv)
{
  const PetscReal gravity = 9.81, slack = 0.02; /* m/s2, m */
  PetscReal      *x, *load, *mass, *k, *e0, *tension, worst = 0.0;
  PetscInt       *ends, *law, weights = 5, first, last, nodes, links, wrong;
  PetscBool      *fixed;
  PetscMPIInt     rank, size;
  LatinStructure  ropes;
  DM              dm;
  Vec             u, v;
  TS              ts;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "Weights on slack ropes\n"));
  PetscCall(LatinInitializePackage());
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-weights", &weights, NULL));

  /* node 0 is the hook, node i the weight below rope i - 1; this rank gives the nodes first..last - 1 and the ropes above them */
  first = rank * (weights + 1) / size;
  last  = (rank + 1) * (weights + 1) / size;
  nodes = last - first;
  links = 0;
  PetscCall(PetscCalloc5(nodes, &x, nodes, &load, nodes, &mass, nodes, &fixed, nodes, &k));
  PetscCall(PetscCalloc4(2 * nodes, &ends, nodes, &law, nodes, &e0, nodes, &tension));
  for (PetscInt i = first; i < last; i++) {
    x[i - first]     = i;
    fixed[i - first] = i ? PETSC_FALSE : PETSC_TRUE;
    mass[i - first]  = 1.0;
    load[i - first]  = gravity; /* downwards along x */
    if (!i) continue;
    ends[2 * links]     = i - 1;
    ends[2 * links + 1] = i;
    law[links]          = LATIN_LAW_INEXTENSIBLE;
    e0[links++]         = -slack;
  }
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 1, nodes, PETSC_DETERMINE, x, links, ends, &ropes));
  PetscCall(LatinStructureSetLaws(ropes, law, k, e0)); /* no stiffness: the search parameter is left to the library */
  PetscCall(LatinStructureSetSupports(ropes, fixed, NULL));
  PetscCall(LatinStructureSetLoads(ropes, load));
  PetscCall(LatinStructureSetMass(ropes, mass));
  PetscCall(LatinStructureSetUp(ropes));

  PetscCall(LatinStructureGetDM(ropes, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(VecDuplicate(u, &v));
  PetscCall(TSCreate(PETSC_COMM_WORLD, &ts));
  PetscCall(LatinStructureAttachTS(ropes, ts));
  PetscCall(TSSetType(ts, TSLATIN));
  PetscCall(TS2SetSolution(ts, u, v)); /* at rest */
  PetscCall(TSSetTimeStep(ts, 5e-3));
  PetscCall(TSSetMaxSteps(ts, 100));
  PetscCall(TSSetFromOptions(ts));
  PetscCall(TSSolve(ts, u));

  PetscCall(TSLatinGetTensions(ts, tension)); /* of this rank's ropes */
  for (PetscInt l = 0; l < links; l++) worst = PetscMax(worst, PetscAbsReal(tension[l] / (gravity * (weights - ends[2 * l])) - 1.0));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &worst, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  wrong = worst < 1e-3 ? 0 : 1;
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "the ropes bear the weights below them, relative error %.0e\n", (double)worst));

  PetscCall(PetscFree4(ends, law, e0, tension));
  PetscCall(PetscFree5(x, load, mass, fixed, k));
  PetscCall(TSDestroy(&ts));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&v));
  PetscCall(LatinStructureDestroy(&ropes));
  PetscCall(PetscFinalize());
  return wrong ? 1 : 0;
}
