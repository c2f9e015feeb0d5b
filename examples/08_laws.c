/*
   A law of one's own in C: a rubber band, beside an inextensible cable.

     mpicc examples/08_laws.c -o 08_laws $(pkg-config --cflags --libs PETSc) -Ilatinpc/include -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc -lm
     ./08_laws
     mpirun -n 2 ./08_laws -snes_monitor

   A weight hangs on a rubber band, tau = k (x + x^3 / a^2) with a = 0.1 m, and on a cable that is 0.2 m too long and does
   not stretch. The band is drawn out until the cable is taut: by 0.2 m, whatever is more than its tension there the cable
   carries. Contacts with friction and laws from points: 08_laws.py.
*/
#include <latinpc.h>
#include <petscdm.h>

#define SQUARE(x) ((x) * (x))

static PetscReal tension(PetscReal k, PetscReal x, void *a)
{
  return k * (x + x * SQUARE(x / *(PetscReal *)a));
}

static PetscReal tangent(PetscReal k, PetscReal x, void *a)
{
  return k * (1.0 + 3.0 * SQUARE(x / *(PetscReal *)a));
}

static PetscReal energy(PetscReal k, PetscReal x, void *a)
{
  return k * (0.5 * x * x + 0.25 * SQUARE(x * x / *(PetscReal *)a));
}

int main(int argc, char **argv)
{
  const PetscReal   nodes[]     = {0, 1};
  const PetscInt    ends[]      = {0, 1, 0, 1};
  const PetscReal   stiffness[] = {10, 0}; /* N/m; 0: the solver's choice */
  const PetscReal   e0[]        = {0, -0.2};
  const PetscBool   fixed[]     = {PETSC_TRUE, PETSC_FALSE};
  const PetscReal   force[]     = {0, 50}; /* N, downwards as the only axis */
  PetscReal         a           = 0.1, displacement[2], carried[2];
  LatinLawFunctions band        = {.tension = tension, .tangent = tangent, .energy = energy, .ctx = &a}; /* its local stage is solved for */
  PetscInt          law[2], wrong = 0;
  PetscMPIInt       rank;
  LatinStructure    pair;
  SNES              snes;
  DM                dm;
  Vec               u;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "A law of one's own\n"));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCall(LatinLawRegister("band", &band, &law[0])); /* on every rank */
  law[1] = LATIN_LAW_INEXTENSIBLE;
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 1, rank ? 0 : 2, 2, nodes, rank ? 0 : 2, ends, &pair));
  PetscCall(LatinStructureSetLaws(pair, law, stiffness, e0));
  PetscCall(LatinStructureSetSupports(pair, fixed, NULL));
  PetscCall(LatinStructureSetLoads(pair, force));
  PetscCall(LatinStructureSetUp(pair));

  PetscCall(SNESCreate(PETSC_COMM_WORLD, &snes));
  PetscCall(LatinStructureAttachSNES(pair, snes));
  PetscCall(SNESSetType(snes, SNESLATIN));
  PetscCall(SNESSetTolerances(snes, PETSC_DEFAULT, PETSC_DEFAULT, 1e-12, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(SNESSetFromOptions(snes));
  PetscCall(LatinStructureGetDM(pair, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(SNESSolve(snes, NULL, u));
  PetscCall(LatinStructureGetDisplacements(pair, u, displacement));
  PetscCall(SNESLatinGetTensions(snes, carried));
  if (!rank) {
    PetscCall(PetscPrintf(PETSC_COMM_SELF, "the weight sinks by %.4f m; the band carries %.3f N, the cable %.3f N\n", displacement[1], carried[0], carried[1]));
    wrong = PetscAbsReal(displacement[1] - 0.2) < 1e-9 && PetscAbsReal(carried[1] - 40.0) < 1e-6 ? 0 : 1;
  }
  PetscCall(VecDestroy(&u));
  PetscCall(SNESDestroy(&snes));
  PetscCall(LatinStructureDestroy(&pair));
  PetscCall(PetscFinalize());
  return wrong;
}
