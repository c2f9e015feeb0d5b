#include "snes/largepath.h"

/*
   Follows the equilibrium while loads and prescribed displacements (snes/largesupports.c) grow together from zero. Structures of cables
   alone need no path: their energy is convex, and the equilibrium unique. A link that bears compression may snap through; a solve for the
   whole loads may then end beyond the snap.

   The first target is the whole path. For each target:

   1. Prediction (LatinPathFar_Private): if the first step of Newton's method, taken from the prediction of the tangent stiffness, is many
      times as long as that prediction, the increment is halved without a solve. One as long as the last one is solved for.
   2. Solution (LatinPathSolve_Private): Newton's method. It takes a few steps on a smooth path and fails if many cables change. Then the
      interior-point method takes over, which needs as many steps for a large increment as for a small one. From then on the largest
      increments are solved first.
   3. Comparison with the predictions of the tangent stiffness at both ends (snes/largecompare.c): whether a path leads there.
   4. The increment is halved if the comparison fails, if no equilibrium is found, or if its tangent stiffness is not positive definite.
      Equilibria found for larger increments are kept and compared again from closer states, so no load is solved for twice; one that is
      again further away than a path can lead is on another path and is dropped. Increments below the least, which is relative to the
      part of the path behind, show a limit point or a critical load.

   A warm start continues from the last equilibrium, a guess from the loads that it bears (snes/largestart.c).
*/

#define LATIN_PATH_CURVE     3.0  /* largest ratio of the rates at the ends to the mean rate for which a cubic curve does not overshoot */
#define LATIN_PATH_CORRECTED 30.0 /* largest first Newton step from the prediction, relative to the predicted displacements; 10 and 100 take as many set-ups */

/*
   Chooses *guess, the displacements at which Newton's method starts for the nearest target: the tangent prediction if supports move; a
   point of the cubic curve between path->u and the next known equilibrium if the rates at both ends are such that the curve does not
   overshoot [F. N. Fritsch, R. E. Carlson 1980]; else path->u. Overwrites path->step. Collective on snes
*/
static PetscErrorCode LatinPathGuess_Private(SNES snes, const LatinPath *path, Vec *guess)
{
  LatinLarge            *large  = &((SNES_Latin *)snes->data)->large;
  const LatinPathTarget *target = &path->target[path->targets - 1], *next = target - 1;
  PetscReal              h, s, moved;

  PetscFunctionBegin;
  *guess = large->path.supports.moves ? path->step : path->u;
  if (large->path.supports.moves) PetscCall(SNESLatinSupportsAhead_Private(snes, path->u, path->ahead, target->part - large->path.reached, path->step));
  if (large->path.supports.moves || path->targets < 2 || !next->u || next->other) PetscFunctionReturn(0);
  h = next->part - large->path.reached;
  s = (target->part - large->path.reached) / h;
  PetscCall(VecWAXPY(path->step, -1.0, path->u, next->u));
  PetscCall(VecNorm(path->step, NORM_2, &moved));
  if (h * PetscMax(path->far, next->far) > LATIN_PATH_CURVE * moved) PetscFunctionReturn(0);
  PetscCall(VecAYPX(path->step, s * s * (3.0 - 2.0 * s), path->u));
  PetscCall(VecAXPY(path->step, h * s * (1.0 - s) * (1.0 - s), path->ahead));
  PetscCall(VecAXPY(path->step, h * s * s * (s - 1.0), next->ahead));
  *guess                  = path->step;
  large->guess.between[0] = path->u;
  large->guess.between[1] = next->u;
  large->guess.part       = s;
  PetscCall(PetscInfo(path->u, "%g of the path: sought on the curve to what is known at %g\n", (double)target->part, (double)next->part));
  PetscFunctionReturn(0);
}

/* Solves for the nearest target from u. Collective on snes */
static PetscErrorCode LatinPathSolve_Private(SNES snes, LatinPath *path, Vec u, PetscBool *found)
{
  SNES_Latin      *data   = (SNES_Latin *)snes->data;
  LatinPathTarget *target = &path->target[path->targets - 1];
  PetscBool        inside = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeFrom_Private(snes, u, PETSC_TRUE, &inside));
  if (inside) path->kinks = PETSC_TRUE;
  *found = (PetscBool)(data->next != LATIN_NEXT_GIVEN && LatinNextSolved(data->next));
  if (!*found) PetscCall(VecDestroy(&target->u));
  else {
    if (!target->u) PetscCall(VecDuplicate(u, &target->u));
    PetscCall(VecCopy(snes->vec_sol, target->u));
  }
  PetscFunctionReturn(0);
}

/*
   Sets target->passed: whether the nearest target is too far from path->u for Newton's method (step 1 of the file). Overwrites path->step.
   Collective on snes
*/
static PetscErrorCode LatinPathFar_Private(SNES snes, LatinPath *path)
{
  LatinPathTarget *target = &path->target[path->targets - 1];
  const PetscReal  more   = target->part - ((SNES_Latin *)snes->data)->large.path.reached;
  PetscReal        corrected, none = LATIN_LARGE_NONE * ((SNES_Latin *)snes->data)->large.size; /* rounding, if loads do not change */

  PetscFunctionBegin;
  target->passed = PETSC_FALSE;
  if (path->far == 0.0) PetscFunctionReturn(0);                                                                                      /* the path has started under the whole loads */
  if (path->kinks || more <= PetscMax(LATIN_PATH_STIFFENS, (1.0 + PETSC_SQRT_MACHINE_EPSILON) * path->last)) PetscFunctionReturn(0); /* just before a cable tightens the prediction is too large for any increment */
  PetscCall(VecWAXPY(path->step, more, path->ahead, path->u));
  PetscCall(SNESLatinLargeCorrect_Private(snes, path->u, path->step, &corrected));
  /* PETSC_MAX_REAL: forces on nodes that slack links leave free, which go along where these tighten */
  target->passed = (PetscBool)(corrected < PETSC_MAX_REAL && corrected > PetscMax(LATIN_PATH_CORRECTED * more * path->far, none));
  PetscFunctionReturn(0);
}

/*
   Computes the tangent prediction at the equilibrium of the target, with the present operators, and whether this is stable. If not, a
   stable one is sought once beside it. Collective on snes
*/
static PetscErrorCode LatinPathSee_Private(SNES snes, LatinPath *path, LatinPathTarget *target)
{
  PetscBool again = PETSC_TRUE;

  PetscFunctionBegin;
  if (!target->ahead) PetscCall(VecDuplicate(target->u, &target->ahead));
  for (PetscInt k = 0; k < 2 && again; k++) {
    PetscCall(LatinPathRate_Private(snes, path, target->u, target->ahead, &target->far));
    target->stable = (PetscBool)(target->far < PETSC_MAX_REAL);
    if (target->stable) PetscCall(LatinPathStable_Private(snes, path, target->u, &target->stable));
    again = (PetscBool)(!target->stable && !k);
    if (again) PetscCall(LatinPathSettle_Private(snes, path, target, &again));
  }
  PetscFunctionReturn(0);
}

/*
   Tries the increment from path->u to the nearest target. *smaller: 1 if the path continues from the target, else the factor for the next
   increment. A target solved for before, from further away, is only compared again. Collective on snes
*/
static PetscErrorCode LatinPathIncrement_Private(SNES snes, LatinPath *path, PetscReal *smaller)
{
  LatinLarge      *large  = &((SNES_Latin *)snes->data)->large;
  LatinPathTarget *target = &path->target[path->targets - 1];
  const PetscBool  known  = (PetscBool) !!target->u;
  PetscBool        found  = PETSC_TRUE;
  Vec              guess  = path->u;

  PetscFunctionBegin;
  *smaller = 0.5;
  if (path->far == PETSC_MAX_REAL) PetscFunctionReturn(0);
  PetscCall(LatinPathLoad_Private(snes, path, target->part));
  if (!known) {
    PetscCall(LatinPathFar_Private(snes, path));
    if (target->passed) PetscFunctionReturn(0);
    PetscCall(LatinPathGuess_Private(snes, path, &guess));
    PetscCall(LatinPathSolve_Private(snes, path, guess, &found));
    large->guess.between[0] = large->guess.between[1] = NULL;
    if (!found) PetscFunctionReturn(0);
    PetscCall(LatinPathSee_Private(snes, path, target));
  }
  PetscCall(LatinPathCompare_Private(snes, path, target, smaller));
  if (!target->stable) *smaller = PetscMin(0.5, *smaller);
  if (target->other && known) PetscCall(VecDestroy(&target->u)); /* on another path, seen from closer by as well */
  if (*smaller < 1.0) PetscFunctionReturn(0);
  if (known && path->targets == 1) { /* end of the path: operators and error estimates belong there */
    PetscCall(VecCopy(target->u, snes->vec_sol));
    PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
    PetscCall(LatinPathSolve_Private(snes, path, target->u, &found));
    *smaller = found ? 1.0 : 0.5;
    if (!found) PetscFunctionReturn(0);
  }
  PetscCall(VecCopy(target->u, path->u));
  PetscCall(VecCopy(target->ahead, path->ahead));
  path->far = target->far;
  PetscFunctionReturn(0);
}

/* Adds a target before the nearest one, at most half as far away. Not collective */
static void LatinPathCloser(LatinPath *path, PetscReal part)
{
  path->target[path->targets++] = (LatinPathTarget){.part = part};
}

/* Removes the nearest target */
static PetscErrorCode LatinPathReached_Private(LatinPath *path)
{
  LatinPathTarget *target = &path->target[--path->targets];

  PetscFunctionBegin;
  PetscCall(VecDestroy(&target->u));
  PetscCall(VecDestroy(&target->ahead));
  PetscFunctionReturn(0);
}

/* Ends the path at a limit point or an unstable state: names the nodes that move on. Overwrites path->step. Collective on snes */
static PetscErrorCode LatinPathLimit_Private(SNES snes, const LatinPath *path)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(PetscInfo(snes, "No equilibrium follows that of %g of the path: it is a limit point, or unstable\n", (double)data->large.path.reached));
  data->next = LATIN_NEXT_DIVERGED;
  PetscCall(SNESLatinSupportsAt_Private(snes, data->large.path.reached));
  PetscCall(LatinPathForces_Private(path->step));
  PetscCall(LatinPathMode_Private(snes, path->u, path->step));
  PetscCall(LatinEquilibriumMoved_Private(data->large.frame->original, path->step, &data->found));
  PetscFunctionReturn(0);
}

/* Follows the path in increments from path->u, until its end or until none is accepted. Collective on snes */
static PetscErrorCode LatinPathIncrements_Private(SNES snes, LatinPath *path)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscReal   smaller;

  PetscFunctionBegin;
  while (path->targets) PetscCall(LatinPathReached_Private(path));
  if (large->path.reached < 1.0) LatinPathCloser(path, 1.0);
  while (path->targets && SNESLatinStagesLeft(snes) > 0) {
    while (path->kinks && path->targets > 1 && path->target[path->targets - 2].passed) PetscCall(LatinPathReached_Private(path));
    LatinPathTarget *target = &path->target[path->targets - 1];
    const PetscReal  more   = target->part - large->path.reached;

    if (more < LatinPathLeast(large->path.reached)) break;
    PetscCall(LatinPathIncrement_Private(snes, path, &smaller));
    if (data->next == LATIN_NEXT_GIVEN) PetscFunctionReturn(0);
    if (smaller < 1.0) LatinPathCloser(path, large->path.reached + smaller * more);
    else {
      path->last          = more;
      large->path.reached = target->part;
      PetscCall(LatinPathReached_Private(path));
    }
  }
  PetscFunctionReturn(0);
}

/*
   Restarts a path that does not leave an unloaded state held only by links at kinks of their laws: seeks a start under loads, as for a
   mechanism. If there is none, path->u stays. Collective on snes
*/
static PetscErrorCode LatinPathAnew_Private(SNES snes, LatinPath *path, PetscBool *starts)
{
  LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  Vec         u;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(large->frame->original->dm, &u));
  PetscCall(VecCopy(path->u, u));
  PetscCall(LatinPathLoaded_Private(snes, path, starts));
  if (*starts) large->path.branch = -1.0;
  else {
    PetscCall(VecCopy(u, path->u));
    PetscCall(SNESLatinSupportsFrom_Private(snes, NULL));
  }
  PetscCall(DMRestoreGlobalVector(large->frame->original->dm, &u));
  PetscFunctionReturn(0);
}

/* Follows the path with its branches from path->u. from: path->u is a stable equilibrium. Collective on snes */
static PetscErrorCode LatinPathFollow_Private(SNES snes, LatinPath *path, PetscBool from)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   goes;

  PetscFunctionBegin;
  if (from && path->unloaded && data->newton.type != LATIN_NEWTON_NEVER) PetscCall(LatinPathPanels_Private(snes, path, &goes));
  goes = from;
  while (goes) {
    if (from) PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &path->far));
    PetscCall(LatinPathIncrements_Private(snes, path));
    if (data->next == LATIN_NEXT_GIVEN || !path->targets) PetscFunctionReturn(0);
    goes = from = PETSC_FALSE;
    if (SNESLatinStagesLeft(snes) > 0 && data->newton.type != LATIN_NEWTON_NEVER) {
      if (!path->unloaded || data->large.path.reached > 0.0) PetscCall(LatinPathPanels_Private(snes, path, &goes));
      if (!goes) PetscCall(LatinPathBranch_Private(snes, path, &goes));
    }
    if (!goes && path->unloaded && path->slackens && data->large.path.reached == 0.0) {
      PetscCall(LatinPathAnew_Private(snes, path, &from));
      goes = from;
    }
  }
  PetscCall(VecCopy(path->u, snes->vec_sol));
  data->next = LATIN_NEXT_MAX_IT;
  /* without Newton's method a path may end before a limit point, since bars in compression disturb the iteration */
  if (SNESLatinStagesLeft(snes) > 0 && data->newton.type != LATIN_NEWTON_NEVER) PetscCall(LatinPathLimit_Private(snes, path));
  PetscFunctionReturn(0);
}

/*
   Computes *reached, the part of the loads that the displacements bear: the loads at the end of the path projected on the whole loads, at
   most the part of the prescribed displacements. On entry: the part of the path. Collective on snes
*/
static PetscErrorCode LatinPathBorne_Private(SNES snes, const LatinPath *path, PetscReal *reached)
{
  PetscScalar both, whole;
  PetscReal   moved; /* part of the prescribed displacements */

  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsEnd_Private(snes, *reached, &moved));
  PetscCall(VecDot(path->first, path->whole, &both));
  PetscCall(VecDot(path->whole, path->whole, &whole));
  if (PetscRealPart(whole) > 0.0) *reached = PetscMin(*reached + (1.0 - *reached) * PetscRealPart(both / whole), moved);
  else if (moved < PETSC_MAX_REAL) *reached = moved;
  if (PetscAbsReal(*reached) <= PETSC_SQRT_MACHINE_EPSILON) *reached = 0.0; /* rounding: less than any increment */
  PetscFunctionReturn(0);
}

/*
   Returns in *follows whether the solve follows a path: if links bear compression, so that the equilibrium need not be unique. Not in time steps; not for
   stops that compare with an iterate; not from the state of a warm start without a path. Collective on snes
*/
static PetscErrorCode LatinPathFollowed_Private(SNES snes, PetscBool *follows)
{
  const SNES_Latin    *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->original;
  const PetscBool      other     = (PetscBool)(data->stop == LATIN_STOP_REFERENCE || SNESLatinUserTest(snes) || (SNESLatinWarm(data) && !data->large.path.solution));

  PetscFunctionBegin;
  *follows = PETSC_FALSE;
  PetscCall(LatinPathStruts_Private(structure, follows, NULL));
  if (structure->midpoint || other) *follows = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Solves for the whole loads at once. Collective on snes */
static PetscErrorCode LatinPathAtOnce_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   done;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeIterate_Private(snes));
  if (data->next == LATIN_NEXT_DIVERGED || data->next == LATIN_NEXT_NOT_FINITE) PetscCall(SNESLatinLargeConvex_Private(snes, PETSC_TRUE, &done));
  data->large.path.reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
  PetscCall(VecDestroy(&data->large.path.solution));
  PetscFunctionReturn(0);
}

/* Solves along a path of the loads if links bear compression, else at once. Starts from the state z. Collective on snes */
PetscErrorCode SNESLatinLargeRun_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinLarge    *large     = &data->large;
  LatinStructure structure = large->frame->original;
  Vec            rhs       = snes->vec_rhs, work[6];
  LatinStopType  stop      = data->stop;
  PetscBool      follows, from = PETSC_FALSE;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCall(LatinPathFollowed_Private(snes, &follows));
  if (!follows) {
    if (structure->midpoint && SNESLatinLargeProves(data)) PetscCall(SNESLatinLargeStep_Private(snes));
    else PetscCall(LatinPathAtOnce_Private(snes));
    PetscFunctionReturn(0);
  }
  for (PetscInt i = 0; i < 6; i++) PetscCall(DMGetGlobalVector(structure->dm, &work[i]));
  LatinPath path = {.first = work[0], .whole = work[1], .u = work[2], .ahead = work[3], .more = work[4], .step = work[5], .far = PETSC_MAX_REAL, .heavier = PETSC_TRUE};
  /* Newton's method follows the path; it needs the error as stop */
  if (data->newton.type != LATIN_NEWTON_NEVER && !SNESLatinEstimates(data)) data->stop = LATIN_STOP_ERROR;
  ierr = LatinPathStart_Private(snes, &path, &from);
  if (!ierr) ierr = LatinPathFollow_Private(snes, &path, from);
  if (!ierr) ierr = SNESLatinLargeStop_Private(snes, stop);
  data->stop = stop;
  while (path.targets) PetscCall(LatinPathReached_Private(&path));
  snes->vec_rhs = rhs; /* after an error as well: path->more is a work vector, which the SNES must not destroy */
  if (!ierr) ierr = LatinPathBorne_Private(snes, &path, &large->path.reached);
  PetscCall(LatinSupportsReset_Private(large));
  for (PetscInt i = 0; i < 6; i++) PetscCall(DMRestoreGlobalVector(structure->dm, &work[i]));
  PetscCall(ierr);
  if (!large->path.solution) PetscCall(VecDuplicate(snes->vec_sol, &large->path.solution));
  PetscCall(VecCopy(snes->vec_sol, large->path.solution));
  PetscCall(SNESLatinBalance_Private(snes));
  PetscFunctionReturn(0);
}
