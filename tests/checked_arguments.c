/*
   What a PETSc with its own checks (--with-debugging) finds in arguments of ours, as in those of PETSc: names each call that is not
   refused. On one rank: no handle, no array, no room for results. On several: values that differ, without which ranks would wait.
*/
#include <latinpc.h>
#include <petscdm.h>

static int refused;

#define Refused(...) \
  do { \
    PetscErrorCode ierr_; \
    PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL)); \
    ierr_ = __VA_ARGS__; \
    PetscCall(PetscPopErrorHandler()); \
    if (ierr_) refused++; \
    else PetscCall(PetscPrintf(PETSC_COMM_WORLD, "not refused: %s\n", #__VA_ARGS__)); \
  } while (0)

static PetscErrorCode Differ(PetscMPIInt rank, LatinStructure chain, SNES snes, Latin latin, Vec u)
{
  const PetscReal x[6]    = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0};
  const PetscInt  ends[2] = {0, 1};
  LatinStructure  other;

  PetscFunctionBegin;
  Refused(LatinStructureCreate(PETSC_COMM_WORLD, rank ? 3 : 1, 2, PETSC_DETERMINE, x, 1, ends, &other));
  Refused(LatinStructureSetGeometry(chain, rank ? LATIN_GEOMETRY_LARGE : LATIN_GEOMETRY_LINEAR));
  Refused(LatinSetVariant(latin, rank ? LATIN_VARIANT_CORNER : LATIN_VARIANT_PRIMAL));
  Refused(LatinSetModes(latin, rank ? LATIN_MODES_RIGID : LATIN_MODES_AFFINE, 0.0));
  Refused(LatinSetModes(latin, LATIN_MODES_AFFINE, rank));
  Refused(LatinSetDirection(latin, rank ? LATIN_DIRECTION_SCALAR : LATIN_DIRECTION_BLOCK, 0.0));
  Refused(LatinSetDirection(latin, LATIN_DIRECTION_SCALAR, 1.0 + rank));
  Refused(LatinSetPrecision(latin, rank ? LATIN_PRECISION_SINGLE : LATIN_PRECISION_DOUBLE));
  Refused(LatinSetPartitioner(latin, rank ? LATIN_PARTITIONER_METIS : LATIN_PARTITIONER_PARALLEL));
  Refused(LatinSetSubdomains(latin, 1 + rank));
  Refused(SNESLatinSetStop(snes, rank ? LATIN_STOP_RESIDUAL : LATIN_STOP_ERROR));
  Refused(SNESLatinSetError(snes, rank ? 1e-2 : 1e-4));
  Refused(SNESLatinSetTensionError(snes, rank ? 1e-2 : 1e-4));
  Refused(SNESLatinSetBalance(snes, rank ? 1e-2 : 1e-4));
  Refused(SNESLatinSetLargestUnbalance(snes, rank));
  Refused(SNESLatinSetNewton(snes, rank ? LATIN_NEWTON_NEVER : LATIN_NEWTON_AUTO));
  Refused(SNESLatinSetWarmStart(snes, rank ? LATIN_WARM_START_LAST : LATIN_WARM_START_NONE));
  Refused(SNESLatinSetReference(snes, rank ? NULL : u));
  PetscFunctionReturn(0);
}

static PetscErrorCode NoHandles(Vec u)
{
  PetscReal       x[4]     = {0.0};
  PetscInt        law[1]   = {0}, n;
  PetscBool       fixed[2] = {PETSC_FALSE, PETSC_FALSE};
  LatinStatistics statistics;
  LatinCost       cost;
  LatinStopType   stop;
  LatinVariant    variant;
  Latin           latin;
  KSP             ksp;
  SNES            outer;
  DM              dm;

  PetscFunctionBegin;
  Refused(LatinStructureSetLaws(NULL, law, x, x));
  Refused(LatinStructureSetDirections(NULL, x));
  Refused(LatinStructureSetFriction(NULL, x));
  Refused(LatinStructureSetPrestress(NULL, x));
  Refused(LatinStructureSetSupports(NULL, fixed, x));
  Refused(LatinStructureSetPrescribed(NULL, x));
  Refused(LatinStructureSetLoads(NULL, x));
  Refused(LatinStructureSetMass(NULL, x));
  Refused(LatinStructureSetUp(NULL));
  Refused(LatinStructureGetDM(NULL, &dm));
  Refused(LatinStructureGetSizes(NULL, &n, NULL, NULL, NULL));
  Refused(LatinStructureGetLaws(NULL, &n, NULL, NULL, NULL));
  Refused(LatinStructureGetDirections(NULL, &n, NULL));
  Refused(LatinStructureGetFriction(NULL, &n, NULL));
  Refused(LatinStructureGetSupports(NULL, &n, NULL, NULL));
  Refused(LatinStructureGetLoads(NULL, &n, NULL));
  Refused(LatinStructureGetMass(NULL, &n, NULL));
  Refused(LatinStructureComputeResidual(NULL, u, u));
  Refused(LatinGetStatistics(NULL, &statistics));
  Refused(LatinGetCost(NULL, &cost));
  Refused(LatinGetLocalKSP(NULL, 0, &ksp));
  Refused(LatinGetVariant(NULL, &variant));
  Refused(LatinGetModes(NULL, NULL, NULL));
  Refused(LatinGetDirection(NULL, NULL, NULL));
  Refused(LatinGetPartition(NULL, &n, NULL));
  Refused(SNESLatinGetStop(NULL, &stop));
  Refused(SNESLatinGetLatin(NULL, &latin));
  Refused(SNESLatinGetOuter(NULL, &outer));
  Refused(SNESLatinGetTensions(NULL, x));
  Refused(PCShellSetLatin(NULL));
  PetscFunctionReturn(0);
}

static PetscErrorCode NoArrays(LatinStructure chain)
{
  const PetscReal x[2]    = {0.0, 1.0};
  const PetscInt  ends[2] = {0, 1};
  LatinStructure  other;
  PetscInt        law;

  PetscFunctionBegin;
  Refused(LatinLawRegister(NULL, NULL, NULL));
  Refused(LatinLawRegister("law", NULL, &law));
  Refused(LatinLawRegisterTable("law", 2, NULL, NULL, &law));
  Refused(LatinLawRegisterTable("law", 2, x, x, NULL));
  Refused(LatinStructureCreate(PETSC_COMM_WORLD, 1, 2, 2, NULL, 1, ends, &other));
  Refused(LatinStructureCreate(PETSC_COMM_WORLD, 1, 2, 2, x, 1, NULL, &other));
  Refused(LatinStructureSetLaws(chain, NULL, x, NULL));
  Refused(LatinStructureSetLaws(chain, ends, NULL, NULL));
  Refused(LatinStructureSetPrestress(chain, NULL));
  Refused(LatinStructureSetLoads(chain, NULL));
  Refused(LatinStructureSetMass(chain, NULL));
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 1, 2, 2, x, 1, ends, &other));
  Refused(LatinStructureSetSupports(other, NULL, NULL));
  Refused(LatinStructureSetDirections(other, NULL));
  Refused(LatinStructureSetFriction(other, NULL));
  PetscCall(LatinStructureDestroy(&other));
  PetscFunctionReturn(0);
}

static PetscErrorCode NoRoom(LatinStructure chain, SNES snes, Latin latin, Vec u)
{
  const PetscReal *const none[1] = {NULL};
  PetscReal *const       room[1] = {NULL};
  PetscInt               stages[1];
  KSP                    ksp;
  PC                     pc;

  PetscFunctionBegin;
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &ksp));
  PetscCall(KSPSetType(ksp, KSPLATIN));
  PetscCall(PCCreate(PETSC_COMM_WORLD, &pc));
  PetscCall(PCSetType(pc, PCLATIN));
  Refused(LatinLawGetName(0, NULL));
  Refused(LatinLawGetStiffness(0, NULL));
  Refused(LatinLawGetTension(0, 1.0, 1.0, NULL));
  Refused(LatinStructureDestroy(NULL));
  Refused(LatinStructureGetGeometry(chain, NULL));
  Refused(LatinStructureGetDM(chain, NULL));
  Refused(LatinStructureComputeEnergy(chain, u, NULL));
  Refused(LatinStructureComputeKineticEnergy(chain, u, NULL));
  Refused(LatinStructureComputeErrors(chain, u, u, NULL, NULL));
  Refused(LatinStructureGetTensions(chain, u, NULL));
  Refused(SNESLatinGetLatin(snes, NULL));
  Refused(SNESLatinGetStop(snes, NULL));
  Refused(SNESLatinGetError(snes, NULL));
  Refused(SNESLatinGetTensionError(snes, NULL));
  Refused(SNESLatinGetBalance(snes, NULL));
  Refused(SNESLatinGetLargestUnbalance(snes, NULL));
  Refused(SNESLatinGetNewton(snes, NULL));
  Refused(SNESLatinGetReference(snes, NULL));
  Refused(SNESLatinGetWarmStart(snes, NULL));
  Refused(SNESLatinSolveCases(snes, 1, none, none, none, NULL, NULL, NULL));
  Refused(SNESLatinSolveCases(snes, 1, none, none, none, room, room, stages));
  Refused(SNESLatinSolveCases(snes, -1, NULL, NULL, NULL, NULL, NULL, NULL));
  Refused(SNESLatinGetTensionEstimate(snes, NULL));
  Refused(SNESLatinGetTensions(snes, NULL));
  Refused(SNESLatinGetOuter(snes, NULL));
  Refused(LatinStateSave((PetscObject)snes, u, NULL, 0, NULL));
  Refused(LatinStateLoad((PetscObject)snes, u, "no such state", NULL, NULL));
  Refused(KSPLatinGetLatin(ksp, NULL));
  Refused(KSPLatinGetOuter(ksp, NULL));
  Refused(PCLatinGetLatin(pc, NULL));
  Refused(LatinGetLocalKSP(latin, 0, NULL));
  Refused(LatinGetCoarseKSP(latin, NULL));
  Refused(LatinGetCost(latin, NULL));
  Refused(LatinGetPartitioner(latin, NULL));
  Refused(LatinGetVariant(latin, NULL));
  Refused(LatinGetPrecision(latin, NULL));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(PCDestroy(&pc));
  PetscFunctionReturn(0);
}

int main(int argc, char **argv)
{
  const PetscInt  law[1]       = {LATIN_LAW_BAR};
  const PetscReal stiffness[1] = {1.0};
  LatinStructure  chain;
  Latin           latin;
  SNES            snes;
  Vec             u;
  DM              dm;
  PetscMPIInt     rank, size;
  PetscInt        ends[2];
  PetscReal       x[2], force[2] = {0.0, 1.0};
  PetscBool       fixed[2] = {PETSC_FALSE, PETSC_FALSE};

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  x[0]    = rank + 0.0;
  x[1]    = rank + 1.0;
  ends[0] = rank;
  ends[1] = rank + 1;
  if (!rank) fixed[0] = PETSC_TRUE;
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 1, rank ? 1 : 2, PETSC_DETERMINE, rank ? x + 1 : x, 1, ends, &chain));
  PetscCall(LatinStructureSetLaws(chain, law, stiffness, NULL));
  PetscCall(LatinStructureSetSupports(chain, fixed, NULL));
  PetscCall(LatinStructureSetLoads(chain, force));
  PetscCall(LatinStructureSetUp(chain));
  PetscCall(LatinStructureGetDM(chain, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(SNESCreate(PETSC_COMM_WORLD, &snes));
  PetscCall(LatinStructureAttachSNES(chain, snes));
  PetscCall(SNESSetType(snes, SNESLATIN));
  PetscCall(SNESLatinGetLatin(snes, &latin));
  if (size > 1) PetscCall(Differ(rank, chain, snes, latin, u));
  PetscCall(SNESSolve(snes, NULL, u)); /* nothing of it has stayed */
  if (size == 1) {
    PetscCall(NoHandles(u));
    PetscCall(NoArrays(chain));
    PetscCall(NoRoom(chain, snes, latin, u));
  }
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%d calls refused\n", refused));
  PetscCall(SNESDestroy(&snes));
  PetscCall(VecDestroy(&u));
  PetscCall(LatinStructureDestroy(&chain));
  PetscCall(PetscFinalize());
  return 0;
}
