#include "core/latinimpl.h"
#include <petsctime.h>

/*
   The core object: the order of the set-up, and what a change rebuilds. The solver types are shells around it. The set-up computes

   1. stiffnesses of links, subdomains (section 2.1) and the variant, if it is auto;
   2. interfaces (section 3.1), micro search directions (26), (27), local low-energy fields, macro fields (section 3.2);
   3. numbers of the coarse unknowns, and batches of equal subdomains;
   4. operators of the subdomains and their factors (28), homogenised stiffnesses (29), (51), and the coarse problem;
   5. where factors are in single precision, their accuracy: if it is too low, part of 4. again.
*/

static const char citation[] = "@article{AlartDureisseix2008,\n"
                               "  author  = {Pierre Alart and David Dureisseix},\n"
                               "  title   = {A scalable multiscale {LATIN} method adapted to nonsmooth discrete media},\n"
                               "  journal = {Computer Methods in Applied Mechanics and Engineering},\n"
                               "  volume  = {197},\n"
                               "  number  = {5},\n"
                               "  pages   = {319--331},\n"
                               "  year    = {2008},\n"
                               "  doi     = {10.1016/j.cma.2007.05.002}\n"
                               "}\n";
static PetscBool  cited      = PETSC_FALSE;

PetscErrorCode LatinCreate_Private(MPI_Comm comm, Latin *newlatin)
{
  Latin latin;

  PetscFunctionBegin;
  PetscCall(PetscHeaderCreate(latin, LATIN_CLASSID, "Latin", "LATIN domain decomposition", "Latin", comm, LatinDestroy_Private, LatinView_Private));
  PetscCall(LatinWatchCreate_Private(PetscObjectComm((PetscObject)latin)));
  /* each stage has pointers to those that it reads */
  latin->sub      = (LatinSubdomains){.object = (PetscObject)latin};
  latin->variant  = LATIN_VARIANT_CORNER;
  latin->inter    = (LatinInterfaces){.sub = &latin->sub};
  latin->dir      = (LatinDirections){.sub = &latin->sub, .inter = &latin->inter, .type = LATIN_DIRECTION_SCHUR};
  latin->spectral = (LatinSpectral){.sub = &latin->sub, .inter = &latin->inter, .dir = &latin->dir, .threshold = PETSC_DEFAULT};
  latin->macro    = (LatinMacro){.sub = &latin->sub, .inter = &latin->inter, .dir = &latin->dir, .spectral = &latin->spectral};
  latin->coarse   = (LatinCoarse){.sub = &latin->sub, .inter = &latin->inter, .macro = &latin->macro};
  latin->linear   = (LatinLinear){.sub = &latin->sub, .inter = &latin->inter, .dir = &latin->dir, .macro = &latin->macro, .spectral = &latin->spectral, .batches = &latin->batches, .coarse = &latin->coarse, .solvers = &latin->solvers};
  latin->tuning   = 1.0;
  *newlatin       = latin;
  PetscFunctionReturn(0);
}

/* Sets the problem: a structure, or a MATIS, the other NULL. Another problem resets latin. Collective on latin */
PetscErrorCode LatinSetProblem_Private(Latin latin, LatinStructure structure, Mat matrix)
{
  PetscFunctionBegin;
  if (structure == latin->sub.structure && matrix == latin->sub.matrix) PetscFunctionReturn(0);
  PetscCall(PetscObjectReference((PetscObject)structure));
  PetscCall(PetscObjectReference((PetscObject)matrix));
  PetscCall(LatinReset_Private(latin));
  PetscCall(LatinStructureDestroy(&latin->sub.structure));
  PetscCall(MatDestroy(&latin->sub.matrix));
  PetscCall(PetscFree(latin->sub.link_stiffness));
  latin->tuning        = 1.0;
  latin->sub.structure = structure;
  latin->sub.matrix    = matrix;
  PetscFunctionReturn(0);
}

/*
   Sets sub.link_stiffness: the tangent stiffnesses composed on the matrix P, if P is not NULL and has them; else the stiffnesses of the links, of rigid
   ones their automatic search parameters. Collective on latin
*/
PetscErrorCode LatinSetStiffness_Private(Latin latin, Mat P)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscScalar   *k;
  PetscReal            scale = 0.0;
  PetscObjectState     state;
  Vec                  tangent = NULL;

  PetscFunctionBegin;
  PetscCall(PetscObjectStateGet((PetscObject)structure, &state));
  if (latin->tuning_state != state) {
    latin->tuning      = 1.0;
    latin->rigid_scale = 0.0;
  }
  latin->tuning_state = state;
  if (structure->rigid_law >= 0) PetscCall(LatinStructureRigidScale_Private(structure, &scale));
  if (LatinScaleFar(scale, latin->rigid_scale)) latin->rigid_scale = scale;
  if (!latin->sub.link_stiffness) PetscCall(PetscMalloc1(structure->links_local, &latin->sub.link_stiffness));
  PetscCall(LatinStructureStiffness_Private(structure, latin->rigid_scale, latin->sub.link_stiffness));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (LatinLaws[structure->law[l]].rigid) latin->sub.link_stiffness[l] *= latin->tuning;
  if (P) PetscCall(LatinTangentFind_Private(structure, P, &tangent));
  if (!tangent) PetscFunctionReturn(0);
  PetscCall(VecGetArrayRead(tangent, &k));
  PetscCall(PetscArraycpy(latin->sub.link_stiffness, k, structure->links_local));
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscFunctionReturn(0);
}

#define LATIN_REPEATS 8 /* least number of subdomains per different one at which corner takes less time than primal */

/* Whether the user has set an option of strong interfaces */
static PetscBool LatinTunesInterfaces(Latin latin)
{
  return (PetscBool)(latin->dir.type != LATIN_DIRECTION_SCHUR || latin->dir.value > 0.0 || latin->macro.type != LATIN_MODES_AFFINE || latin->spectral.threshold > 0.0);
}

/*
   Sets inter.variant, and chooses it for auto. If subdomains repeat, micro quantities on interfaces cost next to nothing and keep the coarse problem
   small: corner. Else all interfaces in the coarse problem take less time: primal. Measured times of corner and primal: tensegrity-grid 200 in 2500 equal
   blocks 1.4 and 3.6 s; tensegrity-grid 100 cut by METIS into 313 subdomains 2.1 and 1.7 s, into 16 4.2 and 1.2 s. Collective on latin
*/
static PetscErrorCode LatinSetUpVariant_Private(Latin latin)
{
  PetscInt *same, counts[2] = {0, latin->sub.n};

  PetscFunctionBegin;
  latin->inter.variant = latin->variant;
  if (latin->variant != LATIN_VARIANT_AUTO) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(latin->sub.n, &same));
  PetscCall(LatinRepeatsOperators_Private(&latin->inter, same));
  for (PetscInt s = 0; s < latin->sub.n; s++) counts[0] += same[s] == s ? 1 : 0;
  PetscCall(PetscFree(same));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)latin)));
  latin->inter.variant = LatinTunesInterfaces(latin) || LATIN_REPEATS * counts[0] <= counts[1] ? LATIN_VARIANT_CORNER : LATIN_VARIANT_PRIMAL;
  PetscFunctionReturn(0);
}

/* Creates the subdomains: of a structure by its partition, of a MATIS by its local matrices. Collective on latin */
static PetscErrorCode LatinSetUpSubdomains_Private(Latin latin)
{
  const LatinVariant variant   = latin->variant;
  LatinStructure     structure = latin->sub.structure;
  PetscInt          *of_link, count;

  PetscFunctionBegin;
  if (latin->sub.matrix) {
    latin->sub.wanted = latin->partition.subdomains;
    PetscCall(LatinSubdomainsSetUp_Matrix(&latin->sub));
    PetscFunctionReturn(0);
  }
  if (!latin->sub.tangent) PetscCall(LatinSetStiffness_Private(latin, NULL));
  latin->partition.primal  = (PetscBool)(variant == LATIN_VARIANT_PRIMAL || (variant == LATIN_VARIANT_AUTO && !LatinTunesInterfaces(latin)));
  latin->partition.corners = (PetscBool)(variant == LATIN_VARIANT_CORNER || variant == LATIN_VARIANT_PUBLISHED || (variant == LATIN_VARIANT_AUTO && !latin->partition.primal));
  latin->partition.prefix  = LatinPrefix(&latin->sub);
  PetscCall(PetscMalloc1(structure->links_local, &of_link));
  if (structure->original) { /* all parts of a link go to the same subdomain */
    const PetscInt parts = structure->dim;

    PetscCall(LatinPartition_Private(structure->original, &latin->partition, of_link, &count));
    for (PetscInt l = structure->links_local - 1; l >= 0; l--) of_link[l] = of_link[l / parts];
  } else PetscCall(LatinPartition_Private(structure, &latin->partition, of_link, &count));
  PetscCall(LatinSubdomainsSetUp(&latin->sub, of_link, count));
  PetscFunctionReturn(0);
}

/* Sets whether the coarse factor is provisional: factors of substructures are in single precision on any rank. Collective on latin */
static PetscErrorCode LatinSetUpProvisional_Private(Latin latin)
{
  PetscReal rounding = latin->linear.substructures ? latin->solvers.rounding : 0.0;

  PetscFunctionBegin;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &rounding, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
  latin->coarse.status.provisional = (PetscBool)(rounding > 0.0);
  PetscFunctionReturn(0);
}

/*
   Tests factors of substructures in single precision: accepts them if a linear stage contracts the error enough; else factors again in a higher
   precision, and renews the coarse problem. Raises the error of a failed coarse factorisation. Collective on latin
*/
static PetscErrorCode LatinSetUpPrecision_Private(Latin latin)
{
  LatinLocalSolvers *solvers = &latin->solvers;
  LatinCoarse       *coarse  = &latin->coarse;

  PetscFunctionBegin;
  while (coarse->ksp && coarse->status.provisional) {
    PetscReal failed = LatinFactorFailed(&coarse->status) ? 1.0 : 0.0, left = 1.0;

    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &failed, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
    if (!(failed > 0.0)) PetscCall(LatinSubstructuresContraction(&latin->linear, &left));
    solvers->rounding = left;
    if (left < LATIN_ROUNDED_CONTRACTION) break;
    PetscCall(LatinCoarseRelease(coarse));
    PetscCall(LatinSubstructuresFill(&latin->linear));
    PetscCall(LatinLocalSolversRefine(solvers));
    PetscCall(LatinFactorAgree_Private(latin, &solvers->status, solvers->n ? &latin->batches.batch[solvers->last] : NULL, "local"));
    PetscCall(LatinSubstructuresStiffness(&latin->linear));
    PetscCall(LatinSetUpProvisional_Private(latin));
    PetscCall(LatinCoarseRenew(coarse, &latin->linear.stiffness));
  }
  PetscCall(LatinFactorAgree_Private(latin, &coarse->status, NULL, "coarse"));
  PetscFunctionReturn(0);
}

/* Sets up the solvers of the subdomains and their homogenised stiffnesses. Collective on latin */
static PetscErrorCode LatinSetUpLinear_Private(Latin latin)
{
  LatinLocalSolvers *solvers = &latin->solvers;

  PetscFunctionBegin;
  solvers->precision = latin->precision;
  PetscCall(LatinLinearSetUp(&latin->linear));
  PetscCall(LatinFactorAgree_Private(latin, &solvers->status, solvers->n ? &latin->batches.batch[solvers->last] : NULL, "local"));
  PetscCall(LatinHomogeniseSetUp(&latin->linear));
  PetscFunctionReturn(0);
}

/*
   Tests the coarse matrix if subdomains are condensed in single precision. Their energies cancel in it, their rounding errors do not. If its softest
   displacement is less than the contraction by the factors, repeats the linear stage's set-up in double precision. Collective on latin
*/
static PetscErrorCode LatinSetUpSoft_Private(Latin latin)
{
  LatinLocalSolvers *solvers = &latin->solvers;
  PetscReal          most[2] = {latin->linear.substructures ? 0.0 : solvers->rounding, -latin->coarse.status.softest};

  PetscFunctionBegin;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
  PetscCall(PetscInfo(latin, "condensed to %g, softest coarse displacement %g\n", (double)most[0], (double)-most[1]));
  if (!latin->coarse.ksp || !(most[0] > -most[1])) PetscFunctionReturn(0);
  latin->linear.precise = PETSC_TRUE;
  PetscCall(LatinLinearReset(&latin->linear));
  PetscCall(LatinLocalSolversRetire(solvers));
  PetscCall(LatinSetUpLinear_Private(latin));
  PetscCall(LatinCoarseRenew(&latin->coarse, &latin->linear.stiffness));
  PetscFunctionReturn(0);
}

/* Sets up all that follows the subdomains, in order. kept: the interfaces exist. Collective on latin */
static PetscErrorCode LatinSetUpStages_Private(Latin latin, PetscBool kept)
{
  PetscInt *pattern;

  PetscFunctionBegin;
  if (!kept) PetscCall(LatinInterfaceSetUp(&latin->inter));
  PetscCall(LatinDirectionSetUp(&latin->dir));
  PetscCall(LatinSpectralSetUp(&latin->spectral));
  PetscCall(LatinSchurReset_Private(&latin->dir));
  PetscCall(LatinMacroSetUp(&latin->macro));
  PetscCall(LatinCoarseNumber(&latin->coarse));
  PetscCall(PetscMalloc1(latin->sub.n, &pattern));
  PetscCall(LatinRepeats_Private(&latin->inter, &latin->dir, &latin->macro, pattern));
  PetscCall(LatinBatchesSetUp(&latin->sub, pattern, &latin->batches));
  PetscCall(LatinMacroShare_Private(&latin->macro, pattern));
  if (latin->inter.condensed) latin->linear.precise = PETSC_TRUE; /* condensed matrices are too soft for single precision */
  PetscCall(LatinSetUpLinear_Private(latin));
  PetscCall(LatinSetUpProvisional_Private(latin));
  PetscCall(LatinCoarseSetUp(&latin->coarse, &latin->linear.stiffness));
  PetscCall(LatinSetUpSoft_Private(latin));
  PetscCall(LatinSetUpPrecision_Private(latin));
  PetscFunctionReturn(0);
}

/* Resets what depends on the values of the operators. Matrices and solvers are set aside for the next set-up, which reuses those of the same pattern */
static PetscErrorCode LatinRetire_Private(Latin latin)
{
  PetscFunctionBegin;
  PetscCall(LatinCoarseRetire(&latin->coarse));
  PetscCall(LatinLinearReset(&latin->linear));
  PetscCall(LatinLocalSolversRetire(&latin->solvers));
  PetscCall(LatinBatchesReset(&latin->batches));
  PetscCall(LatinMacroReset(&latin->macro));
  PetscCall(LatinSpectralReset(&latin->spectral));
  PetscCall(LatinDirectionReset(&latin->dir));
  PetscFunctionReturn(0);
}

/* What a set-up rebuilds; each includes those before it */
typedef enum {
  LATIN_REBUILD_NOTHING,
  LATIN_REBUILD_LOADS,     /* right-hand sides: after new loads, initial elongations and prescribed displacements */
  LATIN_REBUILD_OPERATORS, /* operators on the same subdomains and interfaces: after other values, search parameters and rotations of the parts of links */
  LATIN_REBUILD_ALL        /* after new options or laws, or an error; for a matrix unless latin->renews */
} LatinRebuild;

/* Returns what the changes since the last set-up require. state: that of the structure */
static LatinRebuild LatinChanges(Latin latin, PetscObjectState state)
{
  const LatinStructure structure = latin->sub.structure;

  if (!latin->set_up || (latin->stale && !latin->tuned)) return LATIN_REBUILD_ALL;
  if (!structure) return latin->renews ? LATIN_REBUILD_OPERATORS : LATIN_REBUILD_ALL;
  /* laws have changed, or only the parts of links have rotated (structure/frame.c) */
  if (state != latin->structure_state) return structure->original && latin->structure_state >= structure->parts_state ? LATIN_REBUILD_OPERATORS : LATIN_REBUILD_ALL;
  if (latin->renews || latin->tuned) return LATIN_REBUILD_OPERATORS;
  if (latin->held_state != structure->held_state || latin->load_state != structure->load_state || latin->e0_state != structure->e0_state) return LATIN_REBUILD_LOADS;
  return LATIN_REBUILD_NOTHING;
}

/* Sets up all operators. Subdomains and interfaces are kept by LATIN_REBUILD_OPERATORS, unless a matrix or auto has changed them. Collective on latin */
static PetscErrorCode LatinSetUpOperators_Private(Latin latin, LatinRebuild rebuild)
{
  const LatinVariant variant = latin->inter.variant;
  PetscBool          kept    = (PetscBool)(rebuild == LATIN_REBUILD_OPERATORS);
  PetscLogDouble     start, end;
  PetscErrorCode     ierr;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_SetUp, latin, 0, 0, 0));
  PetscCall(PetscTime(&start));
  latin->set_up = PETSC_FALSE; /* after an error the next set-up rebuilds everything */
  if (kept) {
    PetscCall(LatinRetire_Private(latin));
    if (latin->sub.matrix) PetscCall(LatinSubdomainsRefresh_Matrix(&latin->sub, &kept));
    else {
      if (!latin->sub.tangent) PetscCall(LatinSetStiffness_Private(latin, NULL));
      PetscCall(LatinSubdomainsRefresh(&latin->sub));
    }
  } else PetscCall(LatinReset_Private(latin));
  if (!kept) {
    PetscCall(LatinSubdomainsReset(&latin->sub));
    PetscCall(LatinSetUpSubdomains_Private(latin));
  }
  PetscCall(LatinSetUpVariant_Private(latin));
  if (latin->inter.variant != variant) kept = PETSC_FALSE;
  if (!kept) PetscCall(LatinInterfaceReset(&latin->inter));
  ierr = LatinSetUpStages_Private(latin, kept); /* an error that the caller may turn into a failure: events must end */
  PetscCall(PetscTime(&end));
  latin->setup_seconds = end - start;
  PetscCall(PetscLogEventEnd(LATIN_SetUp, latin, 0, 0, 0));
  PetscCall(ierr);
  PetscFunctionReturn(0);
}

/* Checks that the options of the method are the same on all ranks. Collective on latin */
static PetscErrorCode LatinSameOptions_Private(Latin latin)
{
  const char *const names[LATIN_SAME_MOST] = {"subdomains", "partitioner", "variant", "modes", "modes_local", "direction", "direction_value", "precision"};
  const PetscReal   values[LATIN_SAME_MOST] =
    {(PetscReal)latin->partition.subdomains, (PetscReal)latin->partition.partitioner, (PetscReal)latin->variant, (PetscReal)latin->macro.type, latin->spectral.threshold, (PetscReal)latin->dir.type, latin->dir.value, (PetscReal)latin->precision};

  PetscFunctionBegin;
  PetscCall(LatinSame_Private(PetscObjectComm((PetscObject)latin), LATIN_SAME_MOST, values, LatinPrefix(&latin->sub), names));
  PetscFunctionReturn(0);
}

/* Sets latin up, or rebuilds what changes since the last set-up require. Collective on latin */
PetscErrorCode LatinSetUp_Private(Latin latin)
{
  LatinStructure   structure = latin->sub.structure;
  PetscObjectState state     = 0;
  LatinRebuild     rebuild;

  PetscFunctionBegin;
  PetscCall(PetscCitationsRegister(citation, &cited));
  PetscCall(LatinSameOptions_Private(latin));
  if (structure) PetscCall(PetscObjectStateGet((PetscObject)structure, &state));
  rebuild = LatinChanges(latin, state);
  if (rebuild == LATIN_REBUILD_NOTHING) PetscFunctionReturn(0);
  if (rebuild == LATIN_REBUILD_LOADS) PetscCall(LatinSubdomainsRefresh(&latin->sub));
  else PetscCall(LatinSetUpOperators_Private(latin, rebuild));
  if (structure) {
    if (latin->held_state != structure->held_state) PetscCall(LatinSFBcast_Private(latin->sub.node_sf, latin->sub.dim, MPIU_REAL, structure->prescribed, latin->sub.prescribed));
    PetscCall(LatinLinearSetLoads(&latin->linear, structure->load));
    latin->load_state = structure->load_state;
    latin->e0_state   = structure->e0_state;
    latin->held_state = structure->held_state;
  }
  latin->set_up = PETSC_TRUE;
  latin->stale = latin->tuned = PETSC_FALSE;
  latin->structure_state      = state;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinReset_Private(Latin latin)
{
  PetscFunctionBegin;
  PetscCall(LatinCoarseReset(&latin->coarse));
  PetscCall(LatinLinearReset(&latin->linear));
  PetscCall(LatinLocalSolversDestroy(&latin->solvers));
  PetscCall(LatinBatchesReset(&latin->batches));
  PetscCall(LatinMacroReset(&latin->macro));
  PetscCall(LatinSpectralReset(&latin->spectral));
  PetscCall(LatinDirectionReset(&latin->dir));
  PetscCall(LatinInterfaceReset(&latin->inter));
  PetscCall(LatinSubdomainsReset(&latin->sub));
  latin->set_up = latin->linear.precise = PETSC_FALSE;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDestroy_Private(Latin *latin)
{
  PetscFunctionBegin;
  if (!*latin) PetscFunctionReturn(0);
  if (--((PetscObject)(*latin))->refct > 0) {
    *latin = NULL;
    PetscFunctionReturn(0);
  }
  PetscCall(LatinSetProblem_Private(*latin, NULL, NULL));
  PetscCall(LatinUnknownsReset_Private(&(*latin)->sub.known));
  PetscCall(PetscFree((*latin)->partition.given));
  PetscCall(PetscHeaderDestroy(latin));
  PetscFunctionReturn(0);
}
