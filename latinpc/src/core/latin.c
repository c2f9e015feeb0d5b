#include "core/latinimpl.h"

/*
   The core object: the order of set-up, what is built anew when something has changed. The solver types are shells
   around it.
*/

static PetscErrorCode LatinDestroy_Object(Latin *latin)
{
  return LatinDestroy_Private(latin);
}

/* Each stage reads those below it */
static void LatinConnect(Latin latin)
{
  latin->inter    = (LatinInterfaces){.sub = &latin->sub};
  latin->dir      = (LatinDirections){.sub = &latin->sub, .inter = &latin->inter};
  latin->spectral = (LatinSpectral){.sub = &latin->sub, .inter = &latin->inter, .dir = &latin->dir};
  latin->macro    = (LatinMacro){.sub = &latin->sub, .inter = &latin->inter, .dir = &latin->dir, .spectral = &latin->spectral};
  latin->coarse   = (LatinCoarse){.sub = &latin->sub, .inter = &latin->inter, .macro = &latin->macro};
  latin->linear   = (LatinLinear){.sub = &latin->sub, .inter = &latin->inter, .dir = &latin->dir, .macro = &latin->macro, .batches = &latin->batches, .coarse = &latin->coarse, .solvers = &latin->solvers};
}

PetscErrorCode LatinCreate_Private(MPI_Comm comm, Latin *newlatin)
{
  Latin latin;

  PetscFunctionBegin;
  PetscCall(PetscHeaderCreate(latin, LATIN_CLASSID, "Latin", "LATIN domain decomposition", "Latin", comm, LatinDestroy_Object, LatinView_Private));
  PetscCall(LatinWatchCreate_Private(PetscObjectComm((PetscObject)latin)));
  LatinConnect(latin);
  latin->sub.object    = (PetscObject)latin;
  latin->sub.scale     = 1.0;
  latin->tuning        = 1.0;
  latin->inter.variant = LATIN_VARIANT_CORNER;
  latin->dir.type      = LATIN_DIRECTION_SCHUR;
  *newlatin            = latin;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSetStructure_Private(Latin latin, LatinStructure structure)
{
  PetscFunctionBegin;
  if (structure == latin->sub.structure) PetscFunctionReturn(0);
  PetscCall(PetscObjectReference((PetscObject)structure));
  PetscCall(LatinReset_Private(latin));
  PetscCall(MatDestroy(&latin->sub.matrix));
  PetscCall(LatinStructureDestroy(&latin->sub.structure));
  PetscCall(PetscFree(latin->sub.link_stiffness));
  latin->tuning        = 1.0;
  latin->sub.structure = structure;
  PetscFunctionReturn(0);
}

/* The stiffnesses that the structure has given its links, and of rigid links the search parameters. Collective on latin */
static PetscErrorCode LatinSetStiffness_Private(Latin latin)
{
  const LatinStructure structure = latin->sub.structure;
  PetscObjectState     state;

  PetscFunctionBegin;
  PetscCall(PetscObjectStateGet((PetscObject)structure, &state));
  if (latin->tuning_state != state) latin->tuning = 1.0;
  if (!latin->sub.link_stiffness) PetscCall(PetscMalloc1(structure->links_local, &latin->sub.link_stiffness));
  PetscCall(LatinStructureStiffness_Private(structure, latin->sub.link_stiffness));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (LatinStructureTuned(structure, l)) latin->sub.link_stiffness[l] *= latin->tuning;
  PetscFunctionReturn(0);
}

/* The tangent stiffnesses of the structure in the matrix P, which may be another one's: then those of taut links. Collective on latin */
PetscErrorCode LatinSetTangent_Private(Latin latin, Mat P)
{
  const PetscInt     n = latin->sub.structure->links_local;
  const PetscScalar *k;
  Vec                tangent;

  PetscFunctionBegin;
  PetscCall(LatinSetStiffness_Private(latin));
  PetscCall(LatinTangentFind_Private(latin->sub.structure, P, &tangent));
  if (!tangent) PetscFunctionReturn(0);
  PetscCall(VecGetArrayRead(tangent, &k));
  PetscCall(PetscArraycpy(latin->sub.link_stiffness, k, n));
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscFunctionReturn(0);
}

/*
   The structure that a PC or a KSP (family "pc", "ksp") works on: given to it, or to its DM or to that of its
   matrix A, which may be NULL; NULL for a MATIS without one. Collective on solver.
*/
PetscErrorCode LatinFindStructure_Private(PetscObject solver, const char family[], LatinStructure given, DM dm, Mat A, LatinStructure *structure)
{
  PetscBool   matis = PETSC_FALSE, isksp;
  LatinLevel *level = NULL;

  PetscFunctionBegin;
  *structure = given;
  if (!*structure) PetscCall(LatinStructureFromDM_Private(dm, structure));
  if (!*structure && A) {
    PetscCall(MatGetDM(A, &dm));
    PetscCall(LatinStructureFromDM_Private(dm, structure));
    PetscCall(PetscObjectTypeCompare((PetscObject)A, MATIS, &matis));
    PetscCall(LatinLevelOf_Private(A, &level));
  }
  PetscCall(PetscStrcmp(family, "ksp", &isksp));
  PetscCheck(*structure || matis || level, PetscObjectComm(solver), PETSC_ERR_ORDER,
             "-%s_type latin has no structure to work on: call LatinStructureAttach%s(), or build the matrix from the DM of a structure (LatinStructureCreate(), LatinStructureAttachSNES()); or assemble it as a MATIS (-dm_mat_type is, -mat_type is)",
             family, isksp ? "KSP" : "PC");
  PetscFunctionReturn(0);
}

/* A MATIS instead of links, whatever has been known before is forgotten */
PetscErrorCode LatinSetMatrix_Private(Latin latin, Mat A)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectReference((PetscObject)A));
  PetscCall(LatinReset_Private(latin));
  PetscCall(LatinStructureDestroy(&latin->sub.structure));
  PetscCall(MatDestroy(&latin->sub.matrix));
  latin->sub.matrix = A;
  PetscFunctionReturn(0);
}

/* The stages above the subdomains, in order */
static PetscErrorCode LatinSetUpStages_Private(Latin latin)
{
  LatinLocalSolvers *solvers = &latin->solvers;
  PetscInt          *pattern, *width;

  PetscFunctionBegin;
  PetscCall(LatinInterfaceSetUp(&latin->inter));
  PetscCall(LatinDirectionSetUp(&latin->dir));
  latin->spectral.without = (PetscBool)(latin->inter.variant != LATIN_VARIANT_CORNER);
  PetscCall(LatinSpectralSetUp(&latin->spectral));
  PetscCall(LatinMacroSetUp(&latin->macro));
  PetscCall(LatinCoarseNumber(&latin->coarse));
  PetscCall(PetscMalloc1(latin->sub.n, &pattern));
  PetscCall(LatinRepeats_Private(&latin->inter, &latin->dir, &latin->macro, pattern));
  PetscCall(PetscMalloc1(latin->sub.n, &width));
  for (PetscInt s = 0; s < latin->sub.n; s++) width[s] = latin->coarse.offset[s + 1] - latin->coarse.offset[s];
  PetscCall(LatinBatchesSetUp(&latin->sub, pattern, width, &latin->batches));
  PetscCall(PetscFree(width));
  PetscCall(LatinMacroShare_Private(&latin->macro, pattern));
  PetscCall(LatinLinearSetUp(&latin->linear));
  PetscCall(LatinFactorAgree_Private(latin, &solvers->status, solvers->n ? &latin->batches.batch[solvers->last] : NULL, "local"));
  PetscCall(LatinHomogeniseSetUp(&latin->linear));
  PetscCall(LatinCoarseSetUp(&latin->coarse, &latin->linear.stiffness));
  PetscCall(LatinFactorAgree_Private(latin, &latin->coarse.status, NULL, "coarse"));
  PetscFunctionReturn(0);
}

/* Builds everything for a matrix that has changed; one that has not is not handed to this. Collective on latin */
static PetscErrorCode LatinSetUpMatrix_Private(Latin latin)
{
  PetscFunctionBegin;
  LatinAgree(PetscObjectComm((PetscObject)latin), latin->partition.subdomains, PETSC_ERR_ARG_INCOMP, "The subdomains of a MATIS are its local matrices: leave out -%ssubdomains", LatinPrefix(&latin->sub));
  PetscCall(PetscLogEventBegin(LATIN_SetUp, latin, 0, 0, 0));
  PetscCall(LatinReset_Private(latin));
  PetscCall(LatinSubdomainsSetUp_Matrix(&latin->sub));
  /* a direction that is asked for needs the whole operator */
  if (latin->sub.preconditions && latin->dir.type == LATIN_DIRECTION_AUTO && latin->inter.variant != LATIN_VARIANT_PUBLISHED) PetscCall(LatinInteriorSetUp(&latin->sub, &latin->interior));
  PetscCall(LatinSetUpStages_Private(latin));
  PetscCall(PetscLogEventEnd(LATIN_SetUp, latin, 0, 0, 0));
  latin->set_up = PETSC_TRUE;
  latin->stale  = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/*
   Builds what has changed since the last call: everything for new links or laws, right-hand sides for new loads and
   initial elongations.
*/
PetscErrorCode LatinSetUp_Private(Latin latin)
{
  LatinStructure   structure = latin->sub.structure;
  PetscObjectState state;
  PetscInt        *of_link, count;

  PetscFunctionBegin;
  if (latin->sub.matrix) {
    PetscCall(LatinSetUpMatrix_Private(latin));
    PetscFunctionReturn(0);
  }
  PetscCheck(structure, PetscObjectComm((PetscObject)latin), PETSC_ERR_ORDER,
             "Type latin has no structure to work on: build one with LatinStructureCreate() and call LatinStructureAttachSNES() (or LatinStructureAttachPC(), or set its DM on the solver)");
  PetscCheck(structure->set_up, PetscObjectComm((PetscObject)latin), PETSC_ERR_ORDER, "The structure is not set up: call LatinStructureSetUp()");
  PetscCall(PetscObjectStateGet((PetscObject)structure, &state));
  if (latin->set_up && (latin->stale || state != latin->structure_state)) PetscCall(LatinReset_Private(latin));
  if (!latin->set_up) {
    PetscCall(PetscLogEventBegin(LATIN_SetUp, latin, 0, 0, 0));
    PetscCall(LatinReset_Private(latin)); /* what an earlier attempt that ended in an error may have left */
    if (!latin->sub.tangent) PetscCall(LatinSetStiffness_Private(latin));
    latin->partition.corners = (PetscBool)(latin->inter.variant == LATIN_VARIANT_CORNER || latin->inter.variant == LATIN_VARIANT_PUBLISHED);
    PetscCall(PetscMalloc1(structure->links_local, &of_link));
    PetscCall(LatinPartition_Private(structure, &latin->partition, of_link, &count));
    PetscCall(LatinSubdomainsSetUp(&latin->sub, of_link, count));
    PetscCall(LatinSetUpStages_Private(latin));
    PetscCall(LatinLinearSetLoads(&latin->linear, structure->load));
    PetscCall(PetscLogEventEnd(LATIN_SetUp, latin, 0, 0, 0));
    latin->set_up = PETSC_TRUE;
  } else if (latin->load_state != structure->load_state || latin->e0_state != structure->e0_state) {
    PetscCall(LatinSubdomainsRefresh(&latin->sub));
    PetscCall(LatinLinearSetLoads(&latin->linear, structure->load));
  }
  latin->stale           = PETSC_FALSE;
  latin->structure_state = state;
  latin->load_state      = structure->load_state;
  latin->e0_state        = structure->e0_state;
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
  PetscCall(LatinInteriorReset(&latin->interior));
  PetscCall(LatinSubdomainsReset(&latin->sub));
  latin->set_up = PETSC_FALSE;
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
  PetscCall(LatinReset_Private(*latin));
  PetscCall(PetscFree((*latin)->sub.link_stiffness));
  PetscCall(LatinStructureDestroy(&(*latin)->sub.structure));
  PetscCall(MatDestroy(&(*latin)->sub.matrix));
  PetscCall(LatinUnknownsReset_Private(&(*latin)->sub.known));
  PetscCall(PetscFree((*latin)->partition.given));
  PetscCall(PetscHeaderDestroy(latin));
  PetscFunctionReturn(0);
}
