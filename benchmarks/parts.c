/*
   Peak memory of each rank in a C program, for the parts that parts.py writes with as many ranks.

     mpirun -n 8 python benchmarks/parts.py --modules 284 --partition metis --write FOLDER
     mpicc -O2 benchmarks/parts.c -o parts $(pkg-config --cflags --libs PETSc) -Ilatinpc/include -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc
     mpirun -n 8 ./parts -parts FOLDER
*/
#include <latinpc.h>
#include <petscdm.h>
#include <stdio.h>
#include <sys/resource.h>

/* Peak resident memory of each rank so far (MB). Collective */
static PetscErrorCode PrintPeak(const char stage[])
{
  PetscMPIInt   size;
  PetscInt      peak, *all;
  struct rusage used;

  PetscFunctionBegin;
  (void)getrusage(RUSAGE_SELF, &used);
  peak = (PetscInt)(used.ru_maxrss / 1024);
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(PetscMalloc1(size, &all));
  PetscCallMPI(MPI_Allgather(&peak, 1, MPIU_INT, all, 1, MPIU_INT, PETSC_COMM_WORLD));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  %s: MB a rank", stage));
  for (PetscMPIInt r = 0; r < size; r++) PetscCall(PetscPrintf(PETSC_COMM_WORLD, " %" PetscInt_FMT, all[r]));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "\n"));
  PetscCall(PetscFree(all));
  PetscFunctionReturn(0);
}

static PetscErrorCode Read(FILE *file, size_t n, size_t size, void *to)
{
  PetscFunctionBegin;
  PetscCheck(fread(to, size, n, file) == n, PETSC_COMM_SELF, PETSC_ERR_FILE_READ, "A part is too short: write it with as many ranks, and the same PETSc");
  PetscFunctionReturn(0);
}

/* The structure, of which each rank reads its part */
static PetscErrorCode ReadStructure(const char folder[], LatinStructure *structure)
{
  char        name[PETSC_MAX_PATH_LEN];
  PetscInt    size[4], *links, *law; /* dim, nodes here, nodes of all ranks, links here */
  PetscReal  *nodes, *load, *stiffness, *e0;
  PetscBool  *fixed;
  PetscMPIInt rank, ranks;
  size_t      n, m;
  FILE       *file;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &ranks));
  PetscCall(PetscSNPrintf(name, sizeof(name), "%s/part-%d-of-%d", folder, rank, ranks));
  file = fopen(name, "rb");
  PetscCheck(file, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "There is no %s: write it by parts.py with %d ranks", name, ranks);
  PetscCall(Read(file, 4, sizeof(*size), size));
  n = (size_t)(size[0] * size[1]);
  m = (size_t)size[3];
  PetscCall(PetscMalloc7(n, &nodes, n, &load, n, &fixed, 2 * m, &links, m, &law, m, &stiffness, m, &e0));
  PetscCall(Read(file, n, sizeof(*nodes), nodes));
  PetscCall(Read(file, n, sizeof(*load), load));
  for (size_t i = 0; i < n; i++) {
    char held;

    PetscCall(Read(file, 1, 1, &held));
    fixed[i] = (PetscBool)held;
  }
  PetscCall(Read(file, 2 * m, sizeof(*links), links));
  PetscCall(Read(file, m, sizeof(*law), law));
  PetscCall(Read(file, m, sizeof(*stiffness), stiffness));
  PetscCall(Read(file, m, sizeof(*e0), e0));
  (void)fclose(file);
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, size[0], size[1], size[2], nodes, size[3], links, structure));
  PetscCall(LatinStructureSetLaws(*structure, law, stiffness, e0));
  PetscCall(LatinStructureSetSupports(*structure, fixed, NULL));
  PetscCall(LatinStructureSetLoads(*structure, load));
  PetscCall(PetscFree7(nodes, load, fixed, links, law, stiffness, e0));
  PetscCall(LatinStructureSetUp(*structure));
  PetscFunctionReturn(0);
}

int main(int argc, char **argv)
{
  char                folder[PETSC_MAX_PATH_LEN] = ".";
  PetscInt            iterations;
  LatinStructure      structure;
  SNESConvergedReason reason;
  SNES                snes;
  DM                  dm;
  Vec                 u;

  PetscCall(PetscInitialize(&argc, &argv, NULL, "Memory of a structure in parts\n"));
  PetscCall(PetscOptionsGetString(NULL, NULL, "-parts", folder, sizeof(folder), NULL));
  PetscCall(PrintPeak("libraries"));
  PetscCall(ReadStructure(folder, &structure));
  PetscCall(PrintPeak("structure"));
  PetscCall(SNESCreate(PETSC_COMM_WORLD, &snes));
  PetscCall(LatinStructureAttachSNES(structure, snes));
  PetscCall(SNESSetType(snes, SNESLATIN));
  PetscCall(SNESSetFromOptions(snes));
  PetscCall(SNESSetUp(snes));
  PetscCall(PrintPeak("set-up"));
  PetscCall(LatinStructureGetDM(structure, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(SNESSolve(snes, NULL, u));
  PetscCall(SNESGetIterationNumber(snes, &iterations));
  PetscCall(SNESGetConvergedReason(snes, &reason));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "  %" PetscInt_FMT " iterations, reason %s\n", iterations, SNESConvergedReasons[reason]));
  PetscCall(PrintPeak("solve"));
  PetscCall(VecDestroy(&u));
  PetscCall(SNESDestroy(&snes));
  PetscCall(LatinStructureDestroy(&structure));
  PetscCall(PetscFinalize());
  return 0;
}
