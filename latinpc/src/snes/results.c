#include "snes/sneslatinimpl.h"

/* Results of SNES latin: inner solvers, history, error estimates, diagnosis, tensions, view */

/*@C
  SNESLatinGetLatin - Gets the decomposition of a SNES of type latin, for `LatinGetStatistics()` and other getters.

  Not collective; the reference is borrowed

  Input Parameter:
. snes - of type latin

  Output Parameter:
. latin - the decomposition

  Level: intermediate

.seealso: `KSPLatinGetLatin()`, `PCLatinGetLatin()`
@*/
PetscErrorCode SNESLatinGetLatin(SNES snes, Latin *latin)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(latin, 2);
  *latin = ((SNES_Latin *)snes->data)->latin;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetHistory - Gets indicator and errors of the last solve, one value per linear stage.

  Not collective; the arrays are borrowed

  Output Parameters:
+ n            - number of linear stages
. indicator    - relative distance of the two stages
. error_l2     - relative l2 error of the displacements of all subdomains, NULL without reference
- error_energy - relative energy error, NULL without reference

  Level: intermediate

.seealso: `SNESLatinGetEstimates()`, `SNESLatinSetStop()`
@*/
PetscErrorCode SNESLatinGetHistory(SNES snes, PetscInt *n, const PetscReal *indicator[], const PetscReal *error_l2[], const PetscReal *error_energy[])
{
  SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  if (n) *n = data->done;
  if (indicator) *indicator = data->indicator;
  if (error_l2) *error_l2 = data->reference ? data->error_l2 : NULL;
  if (error_energy) *error_energy = data->reference ? data->error_energy : NULL;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetEstimates - Gets the estimated errors of the last solve, and the smallest error that rounding allows.

  Not collective; the array is borrowed

  Output Parameters:
+ n        - number of linear stages
. estimate - relative error after each of them, NULL without `LATIN_STOP_ERROR` or `LATIN_STOP_ENERGY`
. last     - relative error of the solution, which Newton's method may have improved; 0 without these stops
- floor    - estimate of the smallest error that rounding allows on this structure; 0: unknown

  Level: intermediate

.seealso: `SNESLatinGetHistory()`
@*/
PetscErrorCode SNESLatinGetEstimates(SNES snes, PetscInt *n, const PetscReal *estimate[], PetscReal *last, PetscReal *floor)
{
  SNES_Latin *data;
  PetscBool   stop;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  stop = SNESLatinEstimates(data);
  if (n) *n = data->done;
  if (estimate) *estimate = stop ? data->estimates : NULL;
  if (last) *last = stop ? data->estimate.value : 0.0;
  if (floor) *floor = data->estimate.floor;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetTensionEstimate - Gets the estimated error of the tensions of the last solve.

  Not collective

  Output Parameter:
. error - relative, l2 norm over all links; negative: not estimated, as with other stops than `LATIN_STOP_ERROR`, `LATIN_STOP_ENERGY` and auto, and in motions without rigid links

  Level: intermediate

.seealso: `SNESLatinSetTensionError()`, `SNESLatinGetEstimates()`
@*/
PetscErrorCode SNESLatinGetTensionEstimate(SNES snes, PetscReal *error)
{
  const SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(error, 2);
  data   = (SNES_Latin *)snes->data;
  *error = SNESLatinEstimates(data) ? data->estimate.tensions : -1.0;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetPath - Gets statistics of the last solve with large displacements.

  Not collective

  Output Parameters:
+ renewals - number of rebuilds of the operators at displaced configurations
- borne    - part of the loads and of the prescribed displacements of which the solution is the equilibrium: 1, or less if the path has no stable equilibrium beyond this part

  Level: intermediate

.seealso: `LatinStructureSetGeometry()`
@*/
PetscErrorCode SNESLatinGetPath(SNES snes, PetscInt *renewals, PetscReal *borne)
{
  const SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  PetscCheck(SNESLatinLarge(data), PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "There is no path of large displacements: set -snes_latin_geometry large and solve first");
  if (renewals) *renewals = data->large.renewals;
  if (borne) *borne = data->large.path.reached;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetBranch - Gets whether a stable branch begins where the path of the last solve with large displacements has ended.

  Not collective

  Output Parameter:
. begins - the structure buckles to one side or the other, and bears more there: a small load, or an imperfection, leads along

  Level: intermediate

.seealso: `SNESLatinGetPath()`, `SNESLatinGetUnsupportedNodes()`
@*/
PetscErrorCode SNESLatinGetBranch(SNES snes, PetscBool *begins)
{
  const SNES_Latin *data;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  data = (SNES_Latin *)snes->data;
  PetscCheck(SNESLatinLarge(data), PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "There is no path of large displacements: set -snes_latin_geometry large and solve first");
  PetscAssertPointer(begins, 2);
  *begins = (PetscBool)(data->large.path.branch >= 0.0 && data->large.path.reached < 1.0);
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetUnsupportedNodes - Gets the unsupported nodes after a solve without convergence: loads move them, and no link resists.

  Not collective; the array is borrowed

  Output Parameters:
+ count    - number of nodes; 0 if the solve has converged, or if they are unknown
. listed   - number of nodes listed, at most 8
. node     - global numbers
- distance - distance to links that would stop them, a length; infinite: Newton's method has proved that no link stops them

  Level: intermediate

  Note:
  With large displacements: the nodes that move most in the buckling or snap-through mode of the last stable equilibrium; none if
  the structure as drawn is unstable. Nodes that move towards a support converge slowly if their loads are small relative to the
  stiffness of slack links or to the search parameter of rigid links.

.seealso: `SNESLatinGetHistory()`, `SNESLatinGetJammedLinks()`
@*/
PetscErrorCode SNESLatinGetUnsupportedNodes(SNES snes, PetscInt *count, PetscInt *listed, const PetscInt *node[], PetscReal *distance)
{
  LatinEquilibrium *found;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  found = &((SNES_Latin *)snes->data)->found;
  if (count) *count = found->nodes;
  if (listed) *listed = PetscMin(found->nodes, LATIN_LISTED);
  if (node) *node = found->node;
  if (distance) *distance = found->nodes ? found->distance : 0.0;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetJammedLinks - Gets the rigid links with incompatible gaps, after a solve without convergence.

  Not collective; the array is borrowed

  Output Parameters:
+ count  - number of links; 0 if the solve has converged, or if they are unknown
. listed - number of links listed, at most 8
- link   - global numbers

  Level: intermediate

  Note:
  For example inextensible cables that are too short, or contacts without enough room. Their tensions grow without bound, towards a self-stress.

.seealso: `SNESLatinGetUnsupportedNodes()`
@*/
PetscErrorCode SNESLatinGetJammedLinks(SNES snes, PetscInt *count, PetscInt *listed, const PetscInt *link[])
{
  LatinEquilibrium *found;

  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  found = &((SNES_Latin *)snes->data)->found;
  if (count) *count = found->links;
  if (listed) *listed = PetscMin(found->links, LATIN_LISTED);
  if (link) *link = found->link;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetTensions - Gets the tensions of this rank's links at the solution of the last solve, in the caller's numbering.

  Collective on snes

  Output Parameter:
. tension - [links_local], a force, positive in traction: of elastic links by their law at the displacements, of rigid links as computed by the solve

  Level: beginner

  Note:
  A SNES of another type has no rigid links: same result as `LatinStructureGetTensions()` at its solution.

.seealso: `LatinStructureGetTensions()`, `TSLatinGetTensions()`
@*/
PetscErrorCode SNESLatinGetTensions(SNES snes, PetscReal tension[])
{
  Vec            u;
  LatinStructure structure;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 1);
  PetscCall(SNESGetSolution(snes, &u));
  PetscCall(SNESLatinFindStructure_Private(snes, &structure));
  PetscCheck(structure, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "The solver has no structure: give it one with LatinStructureAttachSNES() (in Python, latinpc.Structure(...).attach(snes))");
  PetscCheck(u, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "There is no solution yet: call SNESSolve() first");
  if (structure->links_local) PetscAssertPointer(tension, 2);
  PetscCall(LatinSolverTensions_Private(snes, structure, u, tension));
  PetscFunctionReturn(0);
}

/* Gets the tensions of rigid links; composed with the SNES as LatinRigidTensions_C, for structure/attach.c. Not collective */
PetscErrorCode SNESLatinRigidTensions_Private(SNES snes, const PetscReal *rigid[])
{
  const SNES_Latin    *data  = (SNES_Latin *)snes->data;
  const LatinStructure frame = data->large.frame;

  PetscFunctionBegin;
  *rigid = !frame ? data->latin->linear.rigid_tension : frame->spring ? frame->spring + frame->original->links_local : NULL;
  PetscFunctionReturn(0);
}

/*@C
  SNESLatinGetOuter - Gets the inner SNES that solves z - G(z) = 0, with G the fixed-point map.

  Collective on snes when called first; the reference is borrowed

  Input Parameter:
. snes - of type latin

  Output Parameter:
. outer - the inner SNES

  Level: advanced

.seealso: `LatinGetLocalKSP()`, `LatinGetCoarseKSP()`
@*/
PetscErrorCode SNESLatinGetOuter(SNES snes, SNES *outer)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinCheck_Private(snes));
  PetscAssertPointer(outer, 2);
  PetscCall(SNESLatinCreateOuter_Private(snes));
  *outer = ((SNES_Latin *)snes->data)->outer;
  PetscFunctionReturn(0);
}

PetscErrorCode SNESView_Latin(SNES snes, PetscViewer viewer)
{
  SNES_Latin  *data   = (SNES_Latin *)snes->data;
  LatinNewton *newton = &data->newton;
  PetscBool    ascii;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "stop on the %s%s\n", LatinStopTypes[data->stop], data->requested == LATIN_STOP_AUTO ? ", chosen by auto" : ""));
  if (SNESLatinEstimates(data)) PetscCall(PetscViewerASCIIPrintf(viewer, "estimated error below %g in the %s norm\n", (double)data->target, data->estimate.energy ? "energy" : "l2"));
  if (data->latin->sub.structure && SNESLatinBalances(snes)) PetscCall(PetscViewerASCIIPrintf(viewer, "unbalanced forces below %g of the loads\n", (double)data->balance));
  if (data->unbalance > 0.0) PetscCall(PetscViewerASCIIPrintf(viewer, "unbalanced force on a node below %g\n", (double)data->unbalance));
  PetscCall(PetscViewerASCIIPrintf(viewer, "warm start: %s\n", LatinWarmStarts[data->warm]));
  PetscCall(PetscViewerASCIIPrintf(viewer, "Newton's method: %s\n", LatinNewtonTypes[newton->type]));
  if (data->done)
    PetscCall(PetscViewerASCIIPrintf(viewer, "last solve: %" PetscInt_FMT " linear stages, indicator %g, norm of the nodal unbalance %g\n", data->latin->linear.applications, (double)data->indicator[data->done - 1], (double)data->residual));
  if (snes->reason && SNESLatinLarge(data)) PetscCall(PetscViewerASCIIPrintf(viewer, "geometry large: operators rebuilt %" PetscInt_FMT " times; %g of the loads borne\n", data->large.renewals, (double)data->large.path.reached));
  else if (data->large.frame) PetscCall(PetscViewerASCIIPrintf(viewer, "geometry %s\n", LatinGeometries[data->large.frame->original->geometry]));
  PetscCall(LatinView_Private(data->latin, viewer));
  if (data->outer) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "fixed-point solver: SNES of type %s, options -%s\n", ((PetscObject)data->outer)->type_name, ((PetscObject)data->outer)->prefix));
    PetscTryTypeMethod(data->outer, view, viewer); /* not SNESView(), which reports it as not set up: its vectors are freed after each solve */
  }
  if (newton->snes && newton->steps) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "Newton's method %s, last solve %" PetscInt_FMT " steps and %" PetscInt_FMT " linear stages:\n", newton->tangent ? "by operators of the tangent stiffness" : "by the operators of the iteration",
                                     newton->steps, newton->stages));
    PetscCall(PetscViewerASCIIPushTab(viewer));
    PetscCall(SNESView(newton->snes, viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  } else if (newton->steps) PetscCall(PetscViewerASCIIPrintf(viewer, "interior-point methods for contacts with friction: last solve %" PetscInt_FMT " steps and %" PetscInt_FMT " linear stages\n", newton->steps, newton->stages));
  PetscFunctionReturn(0);
}
