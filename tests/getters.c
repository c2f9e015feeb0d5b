/*
   What getters return: defaults, what setters and options have set, and the same after a solve. Four bars in a line, on one rank or two;
   the first rank has all links.
*/
#include <latinpc.h>
#include <petscdm.h>

static int wrong;

#define Check(...) \
  do { \
    if (!(__VA_ARGS__)) { \
      wrong++; \
      PetscCall(PetscPrintf(PETSC_COMM_SELF, "line %d, not so: %s\n", __LINE__, #__VA_ARGS__)); \
    } \
  } while (0)

#define Refused(...) \
  do { \
    PetscErrorCode ierr_; \
    PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL)); \
    ierr_ = __VA_ARGS__; \
    PetscCall(PetscPopErrorHandler()); \
    Check(ierr_); \
  } while (0)

/* Whether two arrays are equal */
#define Same(n, a, b) (!(n) || !memcmp(a, b, (size_t)(n) * sizeof((a)[0])))

/* What SNES latin has, in the order of its setters */
typedef struct {
  LatinStopType   stop;
  PetscReal       error, tensions, balance, force;
  LatinNewtonType newton;
  LatinWarmStart  warm;
} Settings;

static PetscErrorCode CheckSNES(SNES snes, Settings is)
{
  Settings found;

  PetscFunctionBeginUser;
  PetscCall(SNESLatinGetStop(snes, &found.stop));
  PetscCall(SNESLatinGetError(snes, &found.error));
  PetscCall(SNESLatinGetTensionError(snes, &found.tensions));
  PetscCall(SNESLatinGetBalance(snes, &found.balance));
  PetscCall(SNESLatinGetLargestUnbalance(snes, &found.force));
  PetscCall(SNESLatinGetNewton(snes, &found.newton));
  PetscCall(SNESLatinGetWarmStart(snes, &found.warm));
  Check(found.stop == is.stop);
  Check(found.error == is.error);
  Check(found.tensions == is.tensions);
  Check(found.balance == is.balance);
  Check(found.force == is.force);
  Check(found.newton == is.newton);
  Check(found.warm == is.warm);
  PetscFunctionReturn(0);
}

/* The same of the method */
typedef struct {
  LatinPartitioner   partitioner;
  LatinVariant       variant;
  LatinModesType     modes;
  PetscReal          threshold;
  LatinDirectionType direction;
  PetscReal          value;
  LatinPrecision     precision;
} Method;

static PetscErrorCode CheckLatin(Latin latin, Method is)
{
  Method found;

  PetscFunctionBeginUser;
  PetscCall(LatinGetPartitioner(latin, &found.partitioner));
  PetscCall(LatinGetVariant(latin, &found.variant));
  PetscCall(LatinGetModes(latin, &found.modes, &found.threshold));
  PetscCall(LatinGetDirection(latin, &found.direction, &found.value));
  PetscCall(LatinGetPrecision(latin, &found.precision));
  Check(found.partitioner == is.partitioner);
  Check(found.variant == is.variant);
  Check(found.modes == is.modes);
  Check(found.threshold == is.threshold);
  Check(found.direction == is.direction);
  Check(found.value == is.value);
  Check(found.precision == is.precision);
  PetscCall(LatinGetModes(latin, NULL, NULL));
  PetscCall(LatinGetDirection(latin, NULL, NULL));
  PetscCall(LatinGetPartition(latin, NULL, NULL));
  PetscFunctionReturn(0);
}

/* Structures: arrays of this rank */
static PetscErrorCode Structures(LatinStructure bars, PetscInt nodes, PetscInt links)
{
  const PetscInt   law[4]       = {LATIN_LAW_BAR, LATIN_LAW_CABLE, LATIN_LAW_BAR, LATIN_LAW_BAR}, *laws;
  const PetscReal  stiffness[4] = {1e3, 2e3, 3e3, 4e3}, e0[4] = {0.0, 1e-3, 2e-3, 3e-3}, tension[4] = {1.0, 2.0, 3.0, 4.0};
  const PetscReal  slanted[8] = {0.0, 0.0, 0.0, -2.0, 3.0, 4.0, 0.0, 0.0}, unit[8] = {1.0, 0.0, 0.0, -1.0, 0.6, 0.8, 1.0, 0.0};
  const PetscReal  drawn[8] = {1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0}, friction[4] = {0.1, 0.2, 0.3, 0.4}, zero[10] = {0.0};
  const PetscReal  prescribed[8] = {1e-3, 0.0, 0.0, 2e-3, 0.0, 0.0, 0.0, 0.0}, *reals[2];
  const PetscReal  force[10] = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0}, mass[5] = {1.0, 2.0, 3.0, 4.0, 5.0};
  PetscReal        settled[10];
  PetscBool        fixed[10];
  const PetscBool *held;
  PetscInt         n;

  PetscFunctionBeginUser;
  /* before anything is set */
  PetscCall(LatinStructureGetLaws(bars, &n, &laws, reals, reals + 1));
  Check(n == links && Same(n, reals[0], zero) && Same(n, reals[1], zero));
  PetscCall(LatinStructureGetDirections(bars, &n, reals));
  Check(n == 2 * links && Same(n, reals[0], drawn));
  PetscCall(LatinStructureGetFriction(bars, &n, reals));
  Check(n == 0 && !reals[0]);
  PetscCall(LatinStructureGetMass(bars, &n, reals));
  Check(n == 0 && !reals[0]);
  PetscCall(LatinStructureGetSupports(bars, &n, &held, reals));
  Check(n == 2 * nodes && Same(n, reals[0], zero));
  for (PetscInt i = 0; i < n; i++) Check(!held[i]);
  PetscCall(LatinStructureGetLoads(bars, &n, reals));
  Check(n == 2 * nodes && Same(n, reals[0], zero));

  /* as set */
  PetscCall(LatinStructureSetLaws(bars, law, stiffness, e0));
  PetscCall(LatinStructureGetLaws(bars, &n, &laws, reals, reals + 1));
  Check(n == links && Same(n, laws, law) && Same(n, reals[0], stiffness) && Same(n, reals[1], e0));
  PetscCall(LatinStructureSetPrestress(bars, tension));
  for (PetscInt l = 0; l < links; l++) Check(reals[1][l] == tension[l] / stiffness[l]);
  PetscCall(LatinStructureSetInitialElongations(bars, e0));
  PetscCall(LatinStructureGetLaws(bars, NULL, NULL, NULL, reals));
  Check(Same(links, reals[0], e0));
  PetscCall(LatinStructureSetDirections(bars, slanted));
  PetscCall(LatinStructureGetDirections(bars, &n, reals));
  Check(n == 2 * links);
  for (PetscInt i = 0; i < n; i++) Check(PetscAbsReal(reals[0][i] - unit[i]) < 10.0 * PETSC_MACHINE_EPSILON);
  PetscCall(LatinStructureSetDirections(bars, reals[0])); /* its own array */
  for (PetscInt i = 0; i < n; i++) Check(PetscAbsReal(reals[0][i] - unit[i]) < 10.0 * PETSC_MACHINE_EPSILON);
  PetscCall(LatinStructureSetDirections(bars, zero));
  Check(Same(n, reals[0], drawn));
  PetscCall(LatinStructureSetFriction(bars, friction));
  PetscCall(LatinStructureGetFriction(bars, &n, reals));
  Check(n == links && reals[0] && Same(n, reals[0], friction)); /* not NULL on a rank without links either */
  PetscCall(LatinStructureSetMass(bars, mass));
  PetscCall(LatinStructureGetMass(bars, &n, reals));
  Check(n == nodes && reals[0] && Same(n, reals[0], mass));
  for (PetscInt i = 0; i < 10; i++) fixed[i] = (PetscBool)(i % 2 || (nodes > 2 && i == 0)); /* the first node is held, the others move along the line */
  for (PetscInt i = 0; i < 10; i++) settled[i] = i < 8 && fixed[i] ? prescribed[i] : 0.0;
  PetscCall(LatinStructureSetSupports(bars, fixed, NULL));
  PetscCall(LatinStructureGetSupports(bars, &n, &held, reals));
  Check(n == 2 * nodes && Same(n, held, fixed) && Same(n, reals[0], zero));
  PetscCall(LatinStructureSetLoads(bars, force));
  PetscCall(LatinStructureGetLoads(bars, &n, reals));
  Check(n == 2 * nodes && Same(n, reals[0], force));
  PetscCall(LatinStructureSetUp(bars));
  PetscCall(LatinStructureSetPrescribed(bars, settled));
  PetscCall(LatinStructureGetSupports(bars, NULL, NULL, reals));
  Check(Same(n, reals[0], settled));
  PetscFunctionReturn(0);
}

/* Solvers: numbers and choices; those of a solve are as set after it */
static PetscErrorCode Solvers(LatinStructure bars, PetscInt links)
{
  const PetscInt subdomain[4] = {0, 0, 1, 1}, *given;
  const Settings defaults     = {LATIN_STOP_AUTO, 1e-4, 1e-4, 1e-2, 0.0, LATIN_NEWTON_AUTO, LATIN_WARM_START_NONE};
  const Settings set          = {LATIN_STOP_ERROR, 1e-3, 2e-3, 1e-1, 5.0, LATIN_NEWTON_AUTO, LATIN_WARM_START_LAST};
  const Settings options      = {LATIN_STOP_ENERGY, 1e-3, 4e-3, 2e-1, 3.0, LATIN_NEWTON_NEVER, LATIN_WARM_START_EXTRAPOLATE};
  const Method   automatic    = {LATIN_PARTITIONER_AUTO, LATIN_VARIANT_AUTO, LATIN_MODES_AFFINE, PETSC_DEFAULT, LATIN_DIRECTION_SCHUR, 0.0, LATIN_PRECISION_AUTO};
  const Method   chosen       = {LATIN_PARTITIONER_METIS, LATIN_VARIANT_CORNER, LATIN_MODES_RIGID, 0.0, LATIN_DIRECTION_BLOCK, 0.5, LATIN_PRECISION_DOUBLE};
  const Method   by_options   = {LATIN_PARTITIONER_PARALLEL, LATIN_VARIANT_MACRO, LATIN_MODES_RIGID, 0.0, LATIN_DIRECTION_SCALAR, 7.0, LATIN_PRECISION_SINGLE};
  PetscReal      tensions;
  SNES           snes;
  Latin          latin;
  Vec            u, reference;
  DM             dm;
  PetscInt       n;

  PetscFunctionBeginUser;
  PetscCall(LatinStructureGetDM(bars, &dm));
  PetscCall(DMCreateGlobalVector(dm, &u));
  PetscCall(SNESCreate(PETSC_COMM_WORLD, &snes));
  PetscCall(LatinStructureAttachSNES(bars, snes));
  PetscCall(SNESSetType(snes, SNESLATIN));
  PetscCall(SNESLatinGetLatin(snes, &latin));
  PetscCall(CheckSNES(snes, defaults));
  PetscCall(CheckLatin(latin, automatic));
  PetscCall(SNESLatinGetReference(snes, &reference));
  Check(!reference);
  PetscCall(LatinGetPartition(latin, &n, &given));
  Check(n == 0 && !given);
  PetscCall(SNESSolve(snes, NULL, u)); /* auto stays auto */
  PetscCall(CheckSNES(snes, defaults));
  PetscCall(CheckLatin(latin, automatic));

  PetscCall(SNESLatinSetError(snes, 1e-3)); /* ends auto; the error of the tensions follows */
  PetscCall(SNESLatinGetTensionError(snes, &tensions));
  Check(tensions == set.error);
  PetscCall(SNESLatinSetTensionError(snes, 2e-3));
  PetscCall(SNESLatinSetBalance(snes, 1e-1));
  PetscCall(SNESLatinSetLargestUnbalance(snes, 5.0));
  PetscCall(SNESLatinSetNewton(snes, LATIN_NEWTON_AUTO));
  PetscCall(SNESLatinSetWarmStart(snes, LATIN_WARM_START_LAST));
  PetscCall(SNESLatinSetReference(snes, u));
  PetscCall(LatinSetPartition(latin, links, subdomain));
  PetscCall(LatinSetPartitioner(latin, LATIN_PARTITIONER_METIS));
  PetscCall(LatinSetVariant(latin, LATIN_VARIANT_CORNER));
  PetscCall(LatinSetModes(latin, LATIN_MODES_RIGID, 0.0));
  PetscCall(LatinSetDirection(latin, LATIN_DIRECTION_BLOCK, 0.5));
  PetscCall(LatinSetPrecision(latin, LATIN_PRECISION_DOUBLE));
  PetscCall(LatinGetPartition(latin, &n, &given));
  PetscCall(LatinSetPartition(latin, n, given)); /* its own array */
  for (PetscInt k = 0; k < 2; k++) {
    PetscCall(CheckSNES(snes, set));
    PetscCall(CheckLatin(latin, chosen));
    PetscCall(SNESLatinGetReference(snes, &reference));
    Check(reference == u);
    PetscCall(LatinGetPartition(latin, &n, &given));
    Check(n == links && given && Same(n, given, subdomain));
    if (!k) PetscCall(SNESSolve(snes, NULL, u));
  }
  PetscCall(SNESLatinSetReference(snes, NULL));
  PetscCall(SNESLatinGetReference(snes, &reference));
  Check(!reference);
  PetscCall(LatinSetPartition(latin, 0, NULL));
  PetscCall(LatinGetPartition(latin, &n, &given));
  Check(n == 0 && !given);

  PetscCall(PetscOptionsInsertString(NULL, "-snes_latin_stop energy -snes_latin_error 1e-3 -snes_latin_tension_error 4e-3 -snes_latin_balance 2e-1 -snes_latin_largest_unbalance 3"));
  PetscCall(PetscOptionsInsertString(NULL, "-snes_latin_newton never -snes_latin_warm_start extrapolate -snes_latin_partitioner parallel -snes_latin_variant macro"));
  PetscCall(PetscOptionsInsertString(NULL, "-snes_latin_modes rigid -snes_latin_modes_local 0 -snes_latin_direction scalar -snes_latin_direction_value 7 -snes_latin_precision single"));
  PetscCall(SNESSetFromOptions(snes));
  PetscCall(CheckSNES(snes, options));
  PetscCall(CheckLatin(latin, by_options));

  PetscCall(SNESSetType(snes, SNESNEWTONLS));
  Refused(SNESLatinGetStop(snes, &(LatinStopType){LATIN_STOP_AUTO}));
  Refused(SNESLatinGetError(snes, &tensions));
  Refused(SNESLatinGetTensionError(snes, &tensions));
  Refused(SNESLatinGetBalance(snes, &tensions));
  Refused(SNESLatinGetLargestUnbalance(snes, &tensions));
  Refused(SNESLatinGetNewton(snes, &(LatinNewtonType){LATIN_NEWTON_AUTO}));
  Refused(SNESLatinGetReference(snes, &reference));
  Refused(SNESLatinGetWarmStart(snes, &(LatinWarmStart){LATIN_WARM_START_NONE}));
  PetscCall(SNESDestroy(&snes));
  PetscCall(VecDestroy(&u));
  PetscFunctionReturn(0);
}

/* Defaults of the method in a PC and in a KSP */
static PetscErrorCode Linear(void)
{
  const Method of_pc  = {LATIN_PARTITIONER_AUTO, LATIN_VARIANT_CORNER, LATIN_MODES_AFFINE, PETSC_DEFAULT, LATIN_DIRECTION_AUTO, 0.0, LATIN_PRECISION_DOUBLE};
  const Method of_ksp = {LATIN_PARTITIONER_AUTO, LATIN_VARIANT_CORNER, LATIN_MODES_AFFINE, PETSC_DEFAULT, LATIN_DIRECTION_SCHUR, 0.0, LATIN_PRECISION_DOUBLE};
  Latin        latin;
  KSP          ksp;
  PC           pc;

  PetscFunctionBeginUser;
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &ksp));
  PetscCall(KSPSetType(ksp, KSPLATIN));
  PetscCall(KSPLatinGetLatin(ksp, &latin));
  PetscCall(CheckLatin(latin, of_ksp));
  PetscCall(PCCreate(PETSC_COMM_WORLD, &pc));
  PetscCall(PCSetType(pc, PCLATIN));
  PetscCall(PCLatinGetLatin(pc, &latin));
  PetscCall(CheckLatin(latin, of_pc));
  PetscCall(KSPDestroy(&ksp));
  PetscCall(PCDestroy(&pc));
  PetscFunctionReturn(0);
}

int main(int argc, char **argv)
{
  const PetscReal x[10]   = {0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 3.0, 0.0, 4.0, 0.0};
  const PetscInt  ends[8] = {0, 1, 1, 2, 2, 3, 3, 4};
  LatinStructure  bars;
  PetscMPIInt     rank, size;
  PetscInt        nodes, links;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCall(LatinInitializePackage());
  links = rank ? 0 : 4;
  nodes = rank ? 2 : size > 1 ? 3 : 5;
  PetscCall(LatinStructureCreate(PETSC_COMM_WORLD, 2, nodes, 5, x + (rank ? 6 : 0), links, ends, &bars));
  PetscCall(Structures(bars, nodes, links));
  PetscCall(Solvers(bars, links));
  PetscCall(Linear());
  PetscCall(LatinStructureDestroy(&bars));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "all getters are called\n"));
  PetscCall(PetscFinalize());
  return wrong ? 1 : 0;
}
