#include "snes/largepath.h"

/*
   Structures that only links at kinks of their laws hold, such as panels with crossed cables without prestress. Compression makes both cables
   of a panel slacken at once, and leaves the symmetric panel unstable: it shears until one of them is taut. Displacements are proportional to
   small loads then, but the energy falls from the symmetric state to the stable one by the cube of the loads only: under small loads no
   descent finds the way, and under none a path begins. So

   1. such structures are found: without the links at kinks they are mechanisms;
   2. a stable state is sought under heavier loads, down the energy from the present state, disturbed;
   3. its displacements, in proportion to the loads, are the initial guess under lighter ones, down to the loads sought.

   Where a path has begun, and such links slacken on the way, states must approach the present one in proportion to the loads, or they are
   beyond a snap (snes/largebranch.c). The path goes on from the nearest of them.
*/

#define LATIN_PANELS_HEAVY   1e-2 /* displacements that the tangent stiffness predicts of the heaviest loads, relative to the size */
#define LATIN_PANELS_LIGHTER 0.3  /* ratio of successive loads; its square root after a failure */
#define LATIN_PANELS_CLOSE   0.8  /* a ratio beyond this, and the next search begins at the present state again */
#define LATIN_PANELS_LINEAR  1.4  /* largest ratio of displacements to those in proportion to the loads */
#define LATIN_PANELS_STATES  2    /* comparisons that show proportion: between two states beyond different snaps it may be chance */
#define LATIN_PANELS_DISTURB 1e-6 /* disturbance of the state that a search begins at, relative to the displacements that its tangent stiffness predicts */
#define LATIN_PANELS_BRANCH  1e-2 /* part of the path: largest step onto a branch */

/* The last stable state of a search */
typedef struct {
  Vec       u;
  PetscReal part;   /* of the path, between path->u and the state; 0: none */
  PetscInt  linear; /* number of comparisons in succession that have shown displacements in proportion to the loads */
} LatinPanelState;

/* Returns in *slackens whether path->u is a mechanism if links nearer to a kink than `near` are on the softer side. Overwrites path->step and path->more. Collective on snes */
static PetscErrorCode LatinPanelsSlacken_Private(SNES snes, LatinPath *path, PetscReal near, PetscBool *slackens)
{
  LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  const PetscInt n         = structure->links_local;
  PetscBool      any;
  PetscReal      moved = 0.0, *slope;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(2 * n + 1, &slope)); /* never NULL */
  PetscCall(LatinPathSlopes_Private(snes, path->u, near, PETSC_FALSE, PETSC_FALSE, slope));
  PetscCall(LatinPathSlopes_Private(snes, path->u, near, PETSC_TRUE, PETSC_FALSE, slope + n));
  PetscCall(LatinPathStiffer_Private(structure, slope, slope + n, &any));
  if (any) {
    PetscCall(LatinPathForces_Private(path->step));
    LatinStructurePrescribe(structure, NULL, NULL, slope);
    PetscCall(SNESLatinLargePredict_Private(snes, path->u, path->step, path->more, &moved));
    LatinStructurePrescribe(structure, NULL, NULL, NULL);
  }
  *slackens = (PetscBool)(moved == PETSC_MAX_REAL);
  PetscCall(PetscFree(slope));
  PetscFunctionReturn(0);
}

/*
   Seeks a stable state that part of the path beyond path->u: from the last state, in proportion to the loads, or if there is none, from
   path->u, disturbed. If one is found, it is the last state. far: displacements of the whole path by the tangent stiffness at path->u.
   Overwrites v and path->step. Collective on snes
*/
static PetscErrorCode LatinPanelsSeek_Private(SNES snes, LatinPath *path, PetscReal far, PetscReal part, Vec v, LatinPanelState *last, PetscBool *found)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  const PetscReal   ratio = last->part > 0.0 ? part / last->part : 0.0;
  PetscReal         size, moved;

  PetscFunctionBegin;
  if (ratio > 0.0) PetscCall(VecWAXPY(v, -1.0, path->u, last->u));
  else PetscCall(LatinPathForces_Private(v));
  PetscCall(VecNorm(v, NORM_INFINITY, &size));
  PetscCall(VecAYPX(v, ratio > 0.0 ? ratio : LATIN_PANELS_DISTURB * part * far / size, path->u));
  if (ratio > 0.0) PetscCall(LatinPathNear_Private(snes, path, large->path.reached + part, v, found));
  else PetscCall(LatinPathDown_Private(snes, path, path->u, large->path.reached + part, v, found));
  PetscCall(VecWAXPY(path->step, -1.0, path->u, v));
  PetscCall(VecNorm(path->step, NORM_INFINITY, &moved));
  PetscCall(PetscInfo(snes, "Links at kinks alone hold the structure at %g of the path: %s %g of it further, %g away\n", (double)large->path.reached, *found ? "a stable state" : "none", (double)part, (double)moved));
  last->linear = *found && ratio > 0.0 && ratio <= 1.01 * LATIN_PANELS_LIGHTER && moved <= LATIN_PANELS_LINEAR * ratio * size ? last->linear + 1 : 0;
  if (!*found) PetscFunctionReturn(0);
  PetscCall(VecCopy(v, last->u));
  last->part = part;
  PetscFunctionReturn(0);
}

/* Seeks stable states under ever lighter loads, until one is the next of the path, if *goes. far: displacements of the whole path by the tangent stiffness at path->u. Collective on snes */
static PetscErrorCode LatinPanelsRun_Private(SNES snes, LatinPath *path, PetscReal far, LatinPanelState *last, Vec v, PetscBool *goes)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  const PetscBool   start = (PetscBool)(path->unloaded && large->path.reached == 0.0);
  const PetscReal   end = start ? 1.0 : PetscMin(LATIN_PANELS_BRANCH, 1.0 - large->path.reached), least = PetscMin(LATIN_PATH_STIFFENS, end);
  PetscReal         part = LATIN_PANELS_HEAVY * large->size / far, lighter = LATIN_PANELS_LIGHTER;
  PetscBool         found;

  PetscFunctionBegin;
  if (large->path.supports.moves) part = PetscMin(end, part);
  while (!*goes && SNESLatinStagesLeft(snes) > 0 && part >= least) {
    PetscCall(LatinPanelsSeek_Private(snes, path, far, part, v, last, &found));
    *goes = (PetscBool)(found && part <= end && (start || last->linear >= LATIN_PANELS_STATES));
    if (found || last->part == 0.0) lighter = LATIN_PANELS_LIGHTER;
    else lighter = PetscSqrtReal(lighter);
    if (lighter > LATIN_PANELS_CLOSE) {
      last->part = 0.0;
      lighter    = LATIN_PANELS_LIGHTER;
    }
    if (last->part > 0.0) part = last->part;
    part = start && part > end ? PetscMax(end, lighter * part) : lighter * part;
  }
  PetscFunctionReturn(0);
}

/*
   Goes on from path->u, if *goes, where links at kinks alone hold it: path->u is the next state of the path then. At the start of a path,
   without loads, path->slackens says whether they do. Collective on snes
*/
PetscErrorCode LatinPathPanels_Private(SNES snes, LatinPath *path, PetscBool *goes)
{
  LatinLarge     *large = &((SNES_Latin *)snes->data)->large;
  LatinPanelState last  = {.part = 0.0};
  PetscReal       far;
  PetscBool       slackens = PETSC_FALSE;
  Vec             v;

  PetscFunctionBegin;
  *goes = PETSC_FALSE;
  PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &path->far));
  PetscCall(VecNorm(path->ahead, NORM_INFINITY, &far));
  if (path->far < PETSC_MAX_REAL && far > 0.0) PetscCall(LatinPanelsSlacken_Private(snes, path, large->path.reached > 0.0 ? LATIN_PATH_STIFFENS * far : 0.0, &slackens));
  if (large->path.reached == 0.0) path->slackens = slackens;
  if (!slackens) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(large->frame->original->dm, &last.u));
  PetscCall(DMGetGlobalVector(large->frame->original->dm, &v));
  PetscCall(LatinPanelsRun_Private(snes, path, far, &last, v, goes));
  if (*goes) {
    PetscCall(VecCopy(last.u, path->u));
    PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &path->far));
    large->path.reached += last.part;
    large->path.sheared = PETSC_TRUE;
  }
  PetscCall(DMRestoreGlobalVector(large->frame->original->dm, &v));
  PetscCall(DMRestoreGlobalVector(large->frame->original->dm, &last.u));
  PetscFunctionReturn(0);
}
