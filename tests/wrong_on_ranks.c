/* A chain of two bars a rank, held at its start, with a mistake that -wrong names: on all ranks, or on rank -on alone */
#include <latinpc.h>
#include <petscdm.h>

int main(int argc, char **argv)
{
  char           wrong[32] = "";
  PetscInt       on = -1, nodes, ends[4], law[2] = {0, 0}, n;
  PetscMPIInt    rank, size;
  PetscReal      x[6], stiffness[2] = {1.0, 1.0}, e0[2] = {0.0, 0.0}, force[3] = {0.0, 0.0, 1.0};
  PetscBool      fixed[3] = {PETSC_FALSE, PETSC_FALSE, PETSC_FALSE}, mine;
  LatinStructure chain;
  SNES           snes;
  Vec            u;
  DM             dm;
  char          *note;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(PetscOptionsGetString(NULL, NULL, "-wrong", wrong, sizeof(wrong), NULL));
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-on", &on, NULL));
  mine     = (PetscBool)(on < 0 || on == rank);
  nodes    = rank ? 2 : 3; /* the first node of rank 0 is the support */
  fixed[0] = (PetscBool)!rank;
  for (PetscInt i = 0; i < nodes; i++) x[i] = 2.0 * rank + (rank ? 1.0 : 0.0) + i;
  for (PetscInt i = 0; i < 2; i++) {
    ends[2 * i]     = 2 * rank + i;
    ends[2 * i + 1] = ends[2 * i] + 1;
  }
  if (mine && wrong[0] == 'l') ends[1] = ends[0];                                                                                                   /* link */
  if (mine && wrong[0] == 'e') e0[0] = NAN;                                                                                                         /* elongation */
  if (mine && wrong[0] == 'k') stiffness[0] = -1.0;                                                                                                 /* k */
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, wrong[0] == 'd' ? 7 : wrong[0] == 'a' ? 1 + rank : 1, nodes, PETSC_DECIDE, x, 2, ends, &chain)); /* dimension, apart */
  PetscCall(LatinStructureSetLaws(chain, mine && wrong[0] == 't' ? NULL : law, stiffness, e0));
  PetscCall(LatinStructureSetSupports(chain, fixed, NULL));
  PetscCall(LatinStructureSetLoads(chain, mine && wrong[0] == 'f' ? NULL : force));
  PetscCall(LatinStructureSetUp(chain));
  PetscCall(LatinStructureGetDM(chain, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(SNESCreate(PETSC_COMM_WORLD, &snes));
  PetscCall(LatinStructureAttachSNES(chain, snes));
  PetscCall(SNESSetType(snes, SNESLATIN));
  PetscCall(SNESSolve(snes, NULL, u));
  if (wrong[0] == 's') PetscCall(LatinStateSave((PetscObject)snes, u, "no/such/folder/state", 0, NULL));             /* save */
  if (wrong[0] == 'n') PetscCall(LatinStateSave((PetscObject)snes, u, "no/such/folder/state", mine ? -3 : 2, "no")); /* note */
  if (wrong[0] == 'r') PetscCall(LatinStateLoad((PetscObject)snes, u, "no such state", &n, &note));                  /* read */
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "nothing is wrong\n"));
  PetscCall(SNESDestroy(&snes));
  PetscCall(VecDestroy(&u));
  PetscCall(LatinStructureDestroy(&chain));
  PetscCall(PetscFinalize());
  return 0;
}
