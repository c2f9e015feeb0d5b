#include "core/latinimpl.h"

/* View of the method, by -snes_view, -ksp_view and -pc_view. */

/* Views the last local solver of the first rank, and the coarse solver. Collective on viewer */
static PetscErrorCode LatinViewSolvers_Private(Latin latin, const LatinStatistics *stats, PetscViewer viewer)
{
  PetscViewer sub;
  PetscMPIInt rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(PetscObjectComm((PetscObject)latin), &rank));
  PetscCall(PetscViewerASCIIPrintf(viewer, "local solvers of the first rank: %" PetscInt_FMT " for %" PetscInt_FMT " subdomains (equal ones share), the last:\n", latin->solvers.n, latin->sub.n));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(PetscViewerGetSubViewer(viewer, PETSC_COMM_SELF, &sub));
  PetscCall(PetscViewerASCIIPushTab(sub));
  if (!rank && latin->solvers.n) {
    const KSP ksp = latin->solvers.ksp[latin->solvers.n - 1];

    if (ksp) PetscCall(KSPView(ksp, sub));
    else PetscCall(PetscViewerASCIIPrintf(sub, "dense inverse\n"));
  }
  PetscCall(PetscViewerASCIIPopTab(sub));
  PetscCall(PetscViewerRestoreSubViewer(viewer, PETSC_COMM_SELF, &sub));
  PetscCall(PetscViewerFlush(viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  if (!latin->coarse.ksp) PetscFunctionReturn(0);
  if (stats->coarse_levels) PetscCall(PetscViewerASCIIPrintf(viewer, "coarse solver, %" PetscInt_FMT " displacements after %" PetscInt_FMT " levels of repeated groups:\n", stats->coarse_size, stats->coarse_levels));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "coarse solver:\n"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(KSPView(latin->coarse.ksp, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(0);
}

/* Prints predicted and measured cost. Collective on viewer */
static PetscErrorCode LatinViewCost_Private(Latin latin, PetscViewer viewer)
{
  LatinCost cost;

  PetscFunctionBegin;
  PetscCall(LatinGetCost(latin, &cost));
  PetscCall(PetscViewerASCIIPrintf(viewer, "number of subdomains: %s\n", cost.choice));
  if (cost.factor_bytes > 0.0) PetscCall(PetscViewerASCIIPrintf(viewer, "predicted: %.2g operations to factor subdomains; a linear stage reads their factors, %.3g MB, twice\n", (double)cost.factor_operations, (double)cost.factor_bytes / 1e6));
  PetscCall(PetscViewerASCIIPrintf(viewer, "measured: set-up %.3g s, %" PetscInt_FMT " linear stages of %.3g s each\n", (double)cost.setup_seconds, cost.linear_stages, (double)cost.stage_seconds));
  PetscFunctionReturn(0);
}

/* Prints the search direction of strong interfaces */
static PetscErrorCode LatinViewDirection_Private(Latin latin, PetscViewer viewer)
{
  PetscFunctionBegin;
  if (latin->dir.type == LATIN_DIRECTION_SCALAR && latin->dir.value > 0.0) PetscCall(PetscViewerASCIIPrintf(viewer, "search direction: scalar, d = %g given\n", (double)latin->dir.value));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "search direction: %s, self-tuned to %g of the interface stiffness\n", LatinDirectionTypes[latin->dir.type], (double)LatinDirectionFraction(&latin->dir)));
  PetscFunctionReturn(0);
}

/* Prints what is chosen before the set-up. primal: the coarse problem has all interfaces */
static PetscErrorCode LatinViewMethod_Private(Latin latin, PetscBool primal, PetscViewer viewer)
{
  const LatinVariant variant = latin->set_up ? latin->inter.variant : latin->variant;
  const char        *fields = latin->macro.type == LATIN_MODES_RIGID ? ", rigid macro fields" : ", affine macro fields", *weights = "stiffness";

  PetscFunctionBegin;
  PetscCall(PetscViewerASCIIPrintf(viewer, "variant %s%s%s\n", LatinVariants[variant], variant != latin->variant ? ", chosen by auto" : "", primal ? "" : fields));
  if (!primal) PetscCall(LatinViewDirection_Private(latin, viewer));
  if (!latin->sub.preconditions) PetscFunctionReturn(0);
  if (LatinDirectionIsDeluxe(&latin->dir)) weights = LatinDirectionCondensed(&latin->dir) ? "blocks of the operators on interfaces" : "Schur complements where there are, else stiffness";
  PetscCall(PetscViewerASCIIPrintf(viewer, "weights of the copies of a node: %s\n", weights));
  PetscFunctionReturn(0);
}

/* Prints the structure or the matrix. Collective on viewer */
static PetscErrorCode LatinViewProblem_Private(Latin latin, PetscViewer viewer)
{
  char     where[32] = "no coordinates";
  PetscInt rows;

  PetscFunctionBegin;
  if (latin->sub.structure) {
    PetscCall(PetscObjectView((PetscObject)latin->sub.structure, viewer));
    PetscFunctionReturn(0);
  }
  PetscCall(MatGetSize(latin->sub.matrix, &rows, NULL));
  if (latin->sub.dim) PetscCall(PetscSNPrintf(where, sizeof(where), "coordinates in %" PetscInt_FMT "D", latin->sub.dim));
  PetscCall(PetscViewerASCIIPrintf(viewer, "matrix: %" PetscInt_FMT " unknowns in %" PetscInt_FMT " fields, %s, %" PetscInt_FMT " near null vectors\n", rows, latin->sub.fields, where, latin->sub.nears));
  PetscFunctionReturn(0);
}

/* Prints subdomains, search directions and the coarse problem. Collective on viewer */
static PetscErrorCode LatinViewSizes_Private(Latin latin, PetscBool primal, const LatinStatistics *stats, PetscViewer viewer)
{
  PetscReal links, dofs, ranks;

  PetscFunctionBegin;
  PetscCall(PetscViewerASCIIPrintf(viewer, "subdomains: %" PetscInt_FMT "; interfaces: %" PetscInt_FMT " strong, %" PetscInt_FMT " weak\n", stats->subdomains, stats->strong_interfaces, stats->weak_interfaces));
  PetscCall(LatinSubdomainsBalance_Private(&latin->sub, &links, &dofs, &ranks));
  PetscCall(PetscViewerASCIIPrintf(viewer, "largest over mean: subdomains %.2f in %s, %.2f in degrees of freedom; ranks %.2f in cost\n", (double)links, latin->sub.structure ? "links" : "entries", (double)dofs, (double)ranks));
  if (!primal) PetscCall(PetscViewerASCIIPrintf(viewer, "search direction values: min %g, mean %g, max %g\n", (double)stats->direction_min, (double)stats->direction_mean, (double)stats->direction_max));
  PetscCall(PetscViewerASCIIPrintf(viewer, "coarse problem: %" PetscInt_FMT " macro displacements, %" PetscInt_FMT " primal ones; fixed-point unknown: %" PetscInt_FMT " numbers\n", stats->strong_macro_dofs, stats->weak_dofs, stats->state_size));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinView_Private(Latin latin, PetscViewer viewer)
{
  const PetscBool primal = (PetscBool)(latin->variant == LATIN_VARIANT_PRIMAL || (latin->set_up && latin->inter.variant == LATIN_VARIANT_PRIMAL));
  LatinStatistics stats;
  PetscBool       ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(LatinViewMethod_Private(latin, primal, viewer));
  if (!latin->set_up) PetscFunctionReturn(0);
  if (LatinDirectionKind(&latin->dir) == LATIN_DIRECTION_AUTO)
    PetscCall(PetscViewerASCIIPrintf(viewer, "search direction: a %s on %" PetscInt_FMT " interfaces, diagonal on the others\n", LatinDirectionCondensed(&latin->dir) ? "block" : "Schur complement", latin->dir.matrices));
  PetscCall(LatinGetStatistics(latin, &stats));
  PetscCall(LatinViewProblem_Private(latin, viewer));
  PetscCall(LatinViewSizes_Private(latin, primal, &stats, viewer));
  PetscCall(LatinViewCost_Private(latin, viewer));
  if (LatinSpectralThreshold(&latin->spectral) > 0.0)
    PetscCall(PetscViewerASCIIPrintf(viewer, "local low-energy fields below %g: %" PetscInt_FMT " low-energy subdomains, at most %" PetscInt_FMT " modes in one, %" PetscInt_FMT " of the macro displacements\n",
                                     (double)LatinSpectralThreshold(&latin->spectral), stats.low_energy_subdomains, stats.local_modes_max, stats.local_macro_dofs));
  PetscCall(LatinViewSolvers_Private(latin, &stats, viewer));
  PetscFunctionReturn(0);
}
