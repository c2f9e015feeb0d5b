#include "latinimpl.h"

/*
   The core object: options, order of set-up, the fixed-point map z -> G(z), views and results. The solver types in
   sneslatin.c and pclatin.c are shells around it.
*/

const char *const        LatinVariants[]       = {"none", "macro", "corner", "LatinVariant", "LATIN_VARIANT_", NULL};
const char *const        LatinModesTypes[]     = {"affine", "rigid", "none", "LatinModesType", "LATIN_MODES_", NULL};
const char *const        LatinDirectionTypes[] = {"scalar", "diagonal", "block", "schur", "auto", "LatinDirectionType", "LATIN_DIRECTION_", NULL};
const char *const        LatinStopTypes[]      = {"indicator", "residual", "reference", "error", "LatinStopType", "LATIN_STOP_", NULL};
const char *const        LatinErrorNorms[]     = {"l2", "energy", "LatinErrorNorm", "LATIN_NORM_", NULL};
static const char *const LatinCornerTypes[]    = {"free", "published", "LatinCornerType", "LATIN_CORNER_", NULL};

#define LATIN_GROUPS    3  /* width of the groups of nested.c, unless an option says otherwise */
#define LATIN_LOCAL_MAX 64 /* most local fields of a subdomain, likewise */

static PetscErrorCode LatinDestroy_Object(Latin *latin)
{
  return LatinDestroy_Private(latin);
}

PetscErrorCode LatinCreate_Private(MPI_Comm comm, Latin *newlatin)
{
  Latin latin;

  PetscFunctionBegin;
  PetscCall(LatinInitializePackage());
  PetscCall(PetscHeaderCreate(latin, LATIN_CLASSID, "Latin", "LATIN domain decomposition", "Latin", comm, LatinDestroy_Object, LatinView_Private));
  PetscCall(LatinWatchCreate_Private(PetscObjectComm((PetscObject)latin)));
  latin->variant       = LATIN_VARIANT_CORNER;
  latin->promote       = PETSC_TRUE;
  latin->repair        = PETSC_TRUE;
  latin->condense      = PETSC_TRUE;
  latin->direction     = LATIN_DIRECTION_SCHUR;
  latin->coarse_groups = LATIN_GROUPS;
  latin->local_max     = LATIN_LOCAL_MAX;
  latin->scale         = 1.0;
  *newlatin            = latin;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSetLinks_Private(Latin latin, LatinLinks links)
{
  PetscFunctionBegin;
  if (links == latin->links) PetscFunctionReturn(0);
  PetscCall(PetscObjectReference((PetscObject)links));
  PetscCall(LatinReset_Private(latin));
  PetscCall(MatDestroy(&latin->matrix));
  PetscCall(LatinLinksDestroy(&latin->links));
  latin->links = links;
  PetscFunctionReturn(0);
}

/*
   The structure that a PC or a KSP (family "pc", "ksp") works on: given to it, or known to its DM or to that of its
   matrix A, which may be NULL; NULL for a MATIS without one. Collective on solver.
*/
PetscErrorCode LatinFindLinks_Private(PetscObject solver, const char family[], LatinLinks given, DM dm, Mat A, LatinLinks *links)
{
  PetscBool   matis = PETSC_FALSE, isksp;
  LatinLevel *level = NULL;

  PetscFunctionBegin;
  *links = given;
  if (!*links) PetscCall(LatinLinksFromDM_Private(dm, links));
  if (!*links && A) {
    PetscCall(MatGetDM(A, &dm));
    PetscCall(LatinLinksFromDM_Private(dm, links));
    PetscCall(PetscObjectTypeCompare((PetscObject)A, MATIS, &matis));
    PetscCall(LatinLevelOf_Private(A, &level));
  }
  PetscCall(PetscStrcmp(family, "ksp", &isksp));
  PetscCheck(*links || matis || level, PetscObjectComm(solver), PETSC_ERR_ORDER,
             "-%s_type latin has no structure to work on: call %sLatinSetLinks(), or build the matrix from the DM of a structure (LatinLinksCreate(), LatinLinksAttachSNES()); or assemble it as a MATIS (-dm_mat_type is, -mat_type is)", family,
             isksp ? "KSP" : "PC");
  PetscFunctionReturn(0);
}

/* A MATIS instead of links, whatever has been known before is forgotten */
PetscErrorCode LatinSetMatrix_Private(Latin latin, Mat A)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectReference((PetscObject)A));
  PetscCall(LatinReset_Private(latin));
  PetscCall(LatinLinksDestroy(&latin->links));
  PetscCall(MatDestroy(&latin->matrix));
  latin->matrix = A;
  PetscFunctionReturn(0);
}

/* family is "snes", "ksp" or "pc": the options of the method are -<prefix><family>_latin_... */
PetscErrorCode LatinSetFromOptions_Private(Latin latin, LatinOptionItems PetscOptionsObject, const char family[])
{
  const struct _p_Latin before = *latin;
  PetscBool             isnes = PETSC_FALSE, isksp = PETSC_FALSE;
  PetscInt              corners = latin->published ? 1 : 0;
  PetscBool             local = PETSC_FALSE, count = PETSC_FALSE, size = PETSC_FALSE, fraction = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(PetscStrcmp(family, "snes", &isnes));
  PetscCall(PetscStrcmp(family, "ksp", &isksp));
#define LATIN_OPTION(name) (isnes ? "-snes_latin_" name : isksp ? "-ksp_latin_" name : "-pc_latin_" name)
  PetscOptionsHeadBegin(PetscOptionsObject, "LATIN domain decomposition options");
  PetscCall(PetscOptionsEnum(LATIN_OPTION("variant"), "What the coarse problem makes of weak interfaces (section 4)", "LatinVariant", LatinVariants, (PetscEnum)latin->variant, (PetscEnum *)&latin->variant, NULL));
  PetscCall(PetscOptionsEnum(LATIN_OPTION("modes"), "Macro fields of the strong interfaces (section 3.2)", "LatinModesType", LatinModesTypes, (PetscEnum)latin->modes, (PetscEnum *)&latin->modes, NULL));
  PetscCall(PetscOptionsReal(LATIN_OPTION("modes_local"), "Local low-energy fields are macro, too: eigenvalues below this, relative to d, 0 = none", "None", latin->local_threshold, &latin->local_threshold, &local));
  PetscCall(PetscOptionsRangeInt(LATIN_OPTION("modes_local_max"), "Most low-energy fields of a subdomain", "None", latin->local_max, &latin->local_max, NULL, 1, PETSC_MAX_INT));
  if (isnes) PetscCall(PetscOptionsRangeInt(LATIN_OPTION("modes_local_slack"), "Linear stages that tell which links are slack and left out of the energies, 0 = none are", "None", latin->local_slack, &latin->local_slack, NULL, 0, PETSC_MAX_INT));
  PetscCall(PetscOptionsRangeInt(LATIN_OPTION("subdomains"), "Number of subdomains, 0 = from the links per subdomain", "LatinLinksSetSubdomains", latin->subdomains, &latin->subdomains, &count, 0, PETSC_MAX_INT));
  PetscCall(PetscOptionsRangeInt(LATIN_OPTION("subdomain_links"), "Links per subdomain when no number of subdomains is given, 0 = what costs least", "LatinLinksSetSubdomains", latin->links_per_subdomain, &latin->links_per_subdomain, &size, 0,
                                 PETSC_MAX_INT));
  PetscCall(PetscOptionsBool(LATIN_OPTION("partition_repair"), "Move links between the subdomains that METIS has made until fewer nodes dangle", "None", latin->repair, &latin->repair, NULL));
  PetscCall(PetscOptionsEnum(LATIN_OPTION("direction"), "Micro search direction of the interfaces", "LatinDirectionType", LatinDirectionTypes, (PetscEnum)latin->direction, (PetscEnum *)&latin->direction, NULL));
  PetscCall(PetscOptionsReal(LATIN_OPTION("direction_scalar"), "Value of the scalar search direction d (force/length), 0 = self-tuned", "None", latin->direction_scalar, &latin->direction_scalar, NULL));
  PetscCall(PetscOptionsReal(LATIN_OPTION("direction_fraction"), "Self-tuned direction as a fraction of the interface stiffness, 0 = the default of the type", "None", latin->direction_fraction, &latin->direction_fraction, &fraction));
  PetscCall(PetscOptionsEList(LATIN_OPTION("corners"), "Micro springs on corners: dropped (free), or kept as in (28) (published)", "None", LatinCornerTypes, 2, LatinCornerTypes[corners], &corners, NULL));
  PetscCall(PetscOptionsBool(LATIN_OPTION("promote"), "Make every node of three or more subdomains a corner (variant corner)", "None", latin->promote, &latin->promote, NULL));
  PetscCall(
    PetscOptionsRangeInt(LATIN_OPTION("coarse_groups"), "Repeated groups of so many subdomains a side are condensed before the coarse problem is factored, level by level; 1: none", "None", latin->coarse_groups, &latin->coarse_groups, NULL, 1, 64));
  PetscOptionsHeadEnd();
  latin->published = (PetscBool)(corners == 1);
  if (local) latin->local_given = PETSC_TRUE;
  if (before.variant != latin->variant || before.modes != latin->modes || before.published != latin->published || before.promote != latin->promote || before.subdomains != latin->subdomains ||
      before.links_per_subdomain != latin->links_per_subdomain || before.repair != latin->repair || before.direction != latin->direction || before.direction_scalar != latin->direction_scalar ||
      before.direction_fraction != latin->direction_fraction || before.coarse_groups != latin->coarse_groups || before.local_threshold != latin->local_threshold || before.local_max != latin->local_max || before.local_slack != latin->local_slack)
    latin->stale = PETSC_TRUE;
  PetscCheck(!count || !size || !latin->subdomains || !latin->links_per_subdomain, PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_INCOMP, "%s and %s both tell how many subdomains there are: leave out one of the two", LATIN_OPTION("subdomains"),
             LATIN_OPTION("subdomain_links"));
  PetscCheck(!fraction || !(latin->direction_fraction > 0.0) || !(latin->direction_scalar > 0.0), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_INCOMP, "%s is of a self-tuned direction, but %s gives it: leave out one of the two",
             LATIN_OPTION("direction_fraction"), LATIN_OPTION("direction_scalar"));
  PetscCheck(latin->direction_scalar >= 0.0 && !PetscIsInfOrNanReal(latin->direction_scalar), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE, "%s is %g; the search direction is a positive stiffness (0 = self-tuned)",
             LATIN_OPTION("direction_scalar"), (double)latin->direction_scalar);
  PetscCheck(latin->direction_fraction >= 0.0 && !PetscIsInfOrNanReal(latin->direction_fraction), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE, "%s is %g; it is a positive number (0 = the default of the type)",
             LATIN_OPTION("direction_fraction"), (double)latin->direction_fraction);
  PetscCheck(latin->local_threshold >= 0.0 && !PetscIsInfOrNanReal(latin->local_threshold), PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_OUTOFRANGE, "%s is %g; it is a positive number (0 = no local fields)", LATIN_OPTION("modes_local"),
             (double)latin->local_threshold);
  PetscCheck(latin->local_threshold == 0.0 || latin->variant == LATIN_VARIANT_CORNER, PetscObjectComm((PetscObject)latin), PETSC_ERR_SUP, "%s wants %s corner: elsewhere the local fields of interfaces that share nodes slow the iteration down",
             LATIN_OPTION("modes_local"), LATIN_OPTION("variant"));
  PetscCheck(!latin->local_slack || latin->local_threshold > 0.0, PetscObjectComm((PetscObject)latin), PETSC_ERR_ARG_WRONG, "%s wants local fields: give their threshold with %s", LATIN_OPTION("modes_local_slack"), LATIN_OPTION("modes_local"));
#undef LATIN_OPTION
  PetscFunctionReturn(0);
}

/* Macro bases, and all that follows from them */
static PetscErrorCode LatinSetUpStage_Private(Latin latin)
{
  PetscFunctionBegin;
  PetscCall(LatinFloppySetUp(latin));
  PetscCall(LatinMacroSetUp(latin));
  PetscCall(LatinCoarseNumber(latin));
  PetscCall(LatinLinearSetUp(latin));
  PetscCall(LatinCondenseSetUp(latin));
  PetscCall(LatinCoarseSetUp(latin));
  PetscFunctionReturn(0);
}

/* Macro bases that know which links are slack (LatinFloppySlack()). Keeps the loads; states of before do not fit. Collective on latin */
PetscErrorCode LatinAdapt_Private(Latin latin)
{
  const PetscInt n = latin->sub.bs * latin->sub.copies;
  PetscReal     *load;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_SetUp, latin, 0, 0, 0));
  PetscCall(PetscMalloc1(n, &load));
  PetscCall(PetscArraycpy(load, latin->linear.load, n));
  PetscCall(LatinCoarseReset(latin));
  PetscCall(LatinLinearReset(latin));
  PetscCall(LatinMacroReset(latin));
  PetscCall(LatinFloppyReset(latin));
  latin->set_up = PETSC_FALSE;
  PetscCall(LatinSetUpStage_Private(latin));
  PetscCall(PetscArraycpy(latin->linear.load, load, n));
  PetscCall(PetscFree(load));
  latin->set_up = PETSC_TRUE;
  PetscCall(PetscLogEventEnd(LATIN_SetUp, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Builds everything for a matrix that has changed; one that has not is not handed to this. Collective on latin */
static PetscErrorCode LatinSetUpMatrix_Private(Latin latin)
{
  PetscFunctionBegin;
  LatinAgree(PetscObjectComm((PetscObject)latin), latin->subdomains || latin->links_per_subdomain, PETSC_ERR_ARG_INCOMP, "The subdomains of a MATIS are its local matrices: leave out -%ssubdomains and -%ssubdomain_links",
             ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "", ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "");
  PetscCall(PetscLogEventBegin(LATIN_SetUp, latin, 0, 0, 0));
  PetscCall(LatinReset_Private(latin));
  PetscCall(LatinSubstructureSetUp_Matrix(latin));
  PetscCall(LatinInteriorSetUp(latin));
  PetscCall(LatinInterfaceSetUp(latin));
  PetscCall(LatinDirectionSetUp(latin));
  PetscCall(LatinSetUpStage_Private(latin));
  PetscCall(PetscMalloc1(latin->inter.sides, &latin->outgoing));
  PetscCall(PetscLogEventEnd(LATIN_SetUp, latin, 0, 0, 0));
  latin->set_up = PETSC_TRUE;
  latin->stale  = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/*
   Builds what has changed since the last call: everything for new links or laws, right-hand sides for new loads and
   prestrains.
*/
PetscErrorCode LatinSetUp_Private(Latin latin)
{
  LatinLinks       links = latin->links;
  PetscObjectState state;

  PetscFunctionBegin;
  if (latin->matrix) {
    PetscCall(LatinSetUpMatrix_Private(latin));
    PetscFunctionReturn(0);
  }
  PetscCheck(links, PetscObjectComm((PetscObject)latin), PETSC_ERR_ORDER, "Type latin has no structure to work on: build one with LatinLinksCreate() and call LatinLinksAttachSNES() (or PCLatinSetLinks(), or set its DM on the solver)");
  PetscCheck(links->set_up, PetscObjectComm((PetscObject)latin), PETSC_ERR_ORDER, "The structure is not set up: call LatinLinksSetUp()");
  PetscCall(PetscObjectStateGet((PetscObject)links, &state));
  if (latin->set_up && (latin->stale || state != latin->links_state)) PetscCall(LatinReset_Private(latin));
  if (!latin->set_up) {
    PetscCall(PetscLogEventBegin(LATIN_SetUp, latin, 0, 0, 0));
    PetscCall(LatinReset_Private(latin)); /* what an earlier attempt that ended in an error may have left */
    PetscCall(LatinSubstructureSetUp(latin));
    PetscCall(LatinInterfaceSetUp(latin));
    PetscCall(LatinDirectionSetUp(latin));
    PetscCall(LatinSetUpStage_Private(latin));
    PetscCall(PetscMalloc1(latin->inter.sides, &latin->outgoing));
    PetscCall(LatinLinearSetLoads(latin, links->load));
    PetscCall(PetscLogEventEnd(LATIN_SetUp, latin, 0, 0, 0));
    latin->set_up = PETSC_TRUE;
  } else if (latin->load_state != links->load_state || latin->prestrain_state != links->prestrain_state) {
    PetscCall(LatinSubstructureRefresh(latin));
    PetscCall(LatinLinearSetLoads(latin, links->load));
  }
  latin->stale           = PETSC_FALSE;
  latin->links_state     = state;
  latin->load_state      = links->load_state;
  latin->prestrain_state = links->prestrain_state;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinReset_Private(Latin latin)
{
  PetscFunctionBegin;
  PetscCall(LatinCoarseReset(latin));
  PetscCall(LatinLinearReset(latin));
  PetscCall(LatinMacroReset(latin));
  PetscCall(LatinDirectionReset(latin));
  PetscCall(LatinFloppyReset(latin));
  PetscCall(PetscFree(latin->floppy.slack));
  latin->floppy.known = PETSC_FALSE;
  PetscCall(LatinInterfaceReset(latin));
  PetscCall(LatinInteriorReset(latin));
  PetscCall(LatinSubstructureReset(latin));
  PetscCall(PetscFree(latin->outgoing));
  PetscCall(PetscMemzero(&latin->inexact, sizeof(latin->inexact)));
  latin->set_up = PETSC_FALSE;
  latin->scale  = 1.0;
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
  PetscCall(LatinLinksDestroy(&(*latin)->links));
  PetscCall(MatDestroy(&(*latin)->matrix));
  PetscCall(LatinUnknownsReset_Private(&(*latin)->known));
  PetscCall(PetscHeaderDestroy(latin));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinView_Private(Latin latin, PetscViewer viewer)
{
  LatinStatistics stats;
  PetscReal       links, dofs, ranks;
  PetscBool       ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "variant %s, %s macro fields%s%s\n", LatinVariants[latin->variant], LatinModesTypes[latin->modes], latin->published ? ", micro springs on corners" : "",
                                   latin->promote && latin->variant == LATIN_VARIANT_CORNER ? ", nodes of three or more subdomains are corners" : ""));
  if (latin->links_per_subdomain && !latin->subdomains) PetscCall(PetscViewerASCIIPrintf(viewer, "subdomains of %" PetscInt_FMT " links\n", latin->links_per_subdomain));
  if (!latin->repair) PetscCall(PetscViewerASCIIPrintf(viewer, "the partition of METIS as it is\n"));
  if (latin->coarse_groups == 1) PetscCall(PetscViewerASCIIPrintf(viewer, "no groups of subdomains are condensed\n"));
  else if (latin->coarse_groups != LATIN_GROUPS) PetscCall(PetscViewerASCIIPrintf(viewer, "groups of %" PetscInt_FMT " subdomains a side\n", latin->coarse_groups));
  if (LatinFloppyThreshold(latin) > 0.0 && latin->local_max != LATIN_LOCAL_MAX) PetscCall(PetscViewerASCIIPrintf(viewer, "at most %" PetscInt_FMT " local fields a subdomain\n", latin->local_max));
  if (latin->direction_scalar > 0.0) PetscCall(PetscViewerASCIIPrintf(viewer, "search direction: scalar, d = %g given\n", (double)latin->direction_scalar));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "search direction: %s, self-tuned to %g of the interface stiffness\n", LatinDirectionTypes[latin->direction], (double)LatinDirectionFraction(latin)));
  if (!latin->set_up) PetscFunctionReturn(0);
  if (LatinDirectionKind(latin) == LATIN_DIRECTION_AUTO) PetscCall(PetscViewerASCIIPrintf(viewer, "search direction: a Schur complement on %" PetscInt_FMT " interfaces, diagonal on the others\n", latin->macro.whole));
  PetscCall(LatinGetStatistics(latin, &stats));
  if (latin->links) PetscCall(PetscObjectView((PetscObject)latin->links, viewer));
  else {
    char     where[32] = "no coordinates";
    PetscInt rows;

    PetscCall(MatGetSize(latin->matrix, &rows, NULL));
    if (latin->sub.dim) PetscCall(PetscSNPrintf(where, sizeof(where), "coordinates in %" PetscInt_FMT "D", latin->sub.dim));
    PetscCall(PetscViewerASCIIPrintf(viewer, "matrix: %" PetscInt_FMT " unknowns in %" PetscInt_FMT " fields, %s, %" PetscInt_FMT " near null vectors\n", rows, latin->sub.fields, where, latin->sub.nears));
  }
  PetscCall(PetscViewerASCIIPrintf(viewer, "subdomains: %" PetscInt_FMT "; interfaces: %" PetscInt_FMT " strong, %" PetscInt_FMT " weak\n", stats.subdomains, stats.strong_interfaces, stats.weak_interfaces));
  PetscCall(LatinSubstructureBalance_Private(latin, &links, &dofs, &ranks));
  PetscCall(PetscViewerASCIIPrintf(viewer, "largest over mean: subdomains %.2f in %s, %.2f in degrees of freedom; ranks %.2f in cost\n", (double)links, latin->links ? "links" : "entries", (double)dofs, (double)ranks));
  PetscCall(PetscViewerASCIIPrintf(viewer, "search direction values: min %g, mean %g, max %g\n", (double)stats.direction_min, (double)stats.direction_mean, (double)stats.direction_max));
  PetscCall(PetscViewerASCIIPrintf(viewer, "coarse problem: %" PetscInt_FMT " macro displacements, %" PetscInt_FMT " primal ones; fixed-point unknown: %" PetscInt_FMT " numbers\n", stats.strong_macro_dofs, stats.weak_dofs, stats.state_size));
  if (LatinFloppyWaits(latin)) PetscCall(PetscViewerASCIIPrintf(viewer, "local low-energy fields below %g: to come, when the first solve tells which links are slack\n", (double)LatinFloppyThreshold(latin)));
  else if (LatinFloppyThreshold(latin) > 0.0) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "local low-energy fields below %g: %" PetscInt_FMT " floppy subdomains, at most %" PetscInt_FMT " modes in one, %" PetscInt_FMT " of the macro displacements\n", (double)LatinFloppyThreshold(latin),
                                     stats.floppy_subdomains, stats.local_modes_max, stats.local_macro_dofs));
  }
  {
    PetscViewer sub;
    PetscMPIInt rank;

    PetscCallMPI(MPI_Comm_rank(PetscObjectComm((PetscObject)latin), &rank));
    PetscCall(PetscViewerASCIIPrintf(viewer, "local solvers of the first rank: %" PetscInt_FMT " for %" PetscInt_FMT " subdomains (equal ones share), the last:\n", latin->linear.solver.n, latin->sub.n));
    PetscCall(PetscViewerASCIIPushTab(viewer));
    PetscCall(PetscViewerGetSubViewer(viewer, PETSC_COMM_SELF, &sub));
    PetscCall(PetscViewerASCIIPushTab(sub));
    if (!rank && latin->linear.solver.n) PetscCall(KSPView(latin->linear.solver.ksp[latin->linear.solver.n - 1], sub));
    PetscCall(PetscViewerASCIIPopTab(sub));
    PetscCall(PetscViewerRestoreSubViewer(viewer, PETSC_COMM_SELF, &sub));
    PetscCall(PetscViewerFlush(viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  }
  if (latin->coarse.ksp) {
    if (stats.coarse_levels) PetscCall(PetscViewerASCIIPrintf(viewer, "coarse solver, %" PetscInt_FMT " displacements left by %" PetscInt_FMT " levels of repeated groups:\n", stats.coarse_size, stats.coarse_levels));
    else PetscCall(PetscViewerASCIIPrintf(viewer, "coarse solver:\n"));
    PetscCall(PetscViewerASCIIPushTab(viewer));
    if (latin->coarse.whole) {
      PetscViewer sub;

      PetscCall(PetscViewerASCIIPrintf(viewer, "each rank solves the whole, the first one with:\n"));
      PetscCall(PetscViewerGetSubViewer(viewer, PETSC_COMM_SELF, &sub));
      if (!latin->coarse.whole_rank) PetscCall(KSPView(latin->coarse.ksp, sub));
      PetscCall(PetscViewerRestoreSubViewer(viewer, PETSC_COMM_SELF, &sub));
      PetscCall(PetscViewerFlush(viewer));
    } else PetscCall(KSPView(latin->coarse.ksp, viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCreateState_Private(Latin latin, Vec *z)
{
  PetscFunctionBegin;
  PetscCall(VecCreate(PetscObjectComm((PetscObject)latin), z));
  PetscCall(VecSetSizes(*z, latin->inter.sides + latin->sub.nonsmooth, PETSC_DETERMINE));
  PetscCall(VecSetType(*z, VECSTANDARD));
  PetscCall(PetscObjectSetName((PetscObject)*z, "LATIN state"));
  PetscFunctionReturn(0);
}

/*
   The state of the prestressed configuration: no interface datum, every nonsmooth link as a taut one, rigid ones without
   tension, and no displacement but the prescribed ones.
*/
PetscErrorCode LatinInitialState_Private(Latin latin, Vec z)
{
  LatinSubstructure *sub = &latin->sub;
  PetscScalar       *a;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(latin->linear.U, sub->prescribed, latin->sub.bs * sub->copies));
  PetscCall(PetscArrayzero(latin->linear.pull, latin->inter.sides));
  PetscCall(VecGetArrayWrite(z, &a));
  for (PetscInt k = 0; k < latin->inter.sides; k++) a[k] = 0.0;
  for (PetscInt i = 0; i < sub->nonsmooth; i++) {
    const PetscInt  l   = sub->nonsmooth_link[i];
    const LatinLaw *law = &LatinLaws[sub->law[l]];

    if (sub->law[l] <= LATIN_LAW_STRUT) a[latin->inter.sides + i] = sub->stiffness[l] * sub->prestrain[l];
    else a[latin->inter.sides + i] = law->rigid ? 0.0 : law->tension(sub->stiffness[l], sub->prestrain[l], law->ctx);
  }
  if (latin->links && latin->links->multiplier) PetscCall(PetscArrayzero(latin->links->multiplier, latin->links->links_local));
  PetscCall(VecRestoreArrayWrite(z, &a));
  PetscFunctionReturn(0);
}

/*
   Gz = G(z): linear stage, local stage. Leaves the displacements of the subdomains in linear.U, and the indicator. The
   displacements before only set where the linear stage starts from.
*/
PetscErrorCode LatinApply_Private(Latin latin, Vec z, Vec Gz)
{
  const PetscScalar *a;
  PetscScalar       *b;

  PetscFunctionBegin;
  latin->failed = PETSC_FALSE;
  PetscCall(VecGetArrayRead(z, &a));
  PetscCall(VecGetArrayWrite(Gz, &b));
  PetscCall(LatinGatherForces_Private(latin, a));
  PetscCall(LatinLinearApply(latin, latin->linear.U));
  PetscCall(LatinLocalStage_Private(latin, a, b));
  PetscCall(VecRestoreArrayRead(z, &a));
  PetscCall(VecRestoreArrayWrite(Gz, &b));
  latin->applications++;
  PetscFunctionReturn(0);
}

/* One displacement for the copies of a node: their mean */
PetscErrorCode LatinAverage_Private(Latin latin, Vec u)
{
  LatinSubstructure *sub = &latin->sub;
  const PetscInt     bs  = sub->bs;
  PetscReal         *w   = latin->linear.g; /* free as work space between linear stages */
  PetscScalar       *a;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < bs * sub->copies; i++) w[i] = latin->linear.U[i] / (latin->scale * sub->multiplicity[i / bs]);
  PetscCall(VecZeroEntries(u));
  PetscCall(VecGetArray(u, &a));
  PetscCall(LatinSFReduce_Private(sub->dof_sf, 1, MPIU_SCALAR, w, a, MPI_SUM));
  PetscCall(VecRestoreArray(u, &a));
  PetscFunctionReturn(0);
}

/* The entries of a DM global vector at the free components of the copies; the others are left alone */
PetscErrorCode LatinDistribute_Private(Latin latin, Vec u, PetscReal copy[])
{
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(u, &a));
  PetscCall(LatinSFBcast_Private(latin->sub.dof_sf, 1, MPIU_SCALAR, a, copy));
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscFunctionReturn(0);
}
