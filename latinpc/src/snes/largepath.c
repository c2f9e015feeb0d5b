#include "snes/largepath.h"

/*
   The equilibrium to which loads and prescribed displacements (snes/largesupports.c) lead as they grow from zero, where there may be others. Of cables
   alone the energy is convex, and there is no other. A link that bears compression may snap through; then a solve for the whole loads
   may end beyond. So the displacements of each node are compared with those by the tangent stiffness at the start of an increment and at its end. Along a
   smooth path, and where a cable slackens on the way, they lie between the two, or aside by a part of their distance. Next to a limit point the end says
   nothing, and they are at most twice those at the start. Each node counts, and its direction: a truss that snaps through moves a large net but little. The
   increment is halved where a node has moved further, where no equilibrium is found, or one whose tangent stiffness is not positive definite.
   Increments that become small show a limit point, or a critical load. An equilibrium that was found from afar is compared
   again from closer by, so that no load is solved for twice, unless it is still further than any path leads: then it is on another one.

   Newton's method follows a smooth path in a few steps an increment, and far from it fails, or finds what is rejected. So where its first step from what
   the tangent stiffness says of an increment is many times as long as that, the increment is halved at once. Where so many cables change that it does
   not follow, the interior-point method does, and takes as many steps from near as from afar: then the farthest equilibrium is sought first, and Newton's
   method not tried again from the same equilibrium for larger increments.

   What the start says of a structure that is soft there and stiffens would let any snap pass; and loads far beyond a limit point move a truss to where
   it is stiff again, by as much as they would have as drawn. So no node is to stiffen by more than twice from the start of an increment to its mean,
   and from that to its end; else the increment is made smaller, unless it is small already: a cable that tightens stiffens at once, and what sags stiffens
   as the cube of its displacements. But not where no link tightens and forces fall on the way, a snap under less than the least increment. Where a cable
   slackens the structure becomes softer at once, so that displacements far smaller than those so far are never too large; but by more than twice only
   in a small one. A solve that starts warm goes on from the last equilibrium, and one from a guess from there, with the loads that it bears.
*/

#define LATIN_PATH_KINK      1e-2 /* times the displacements so far: an increment in which a cable slackens may move the structure so much */
#define LATIN_PATH_HALVES    12   /* points of an increment, each half as far as the one before: a snap may be shorter by so many powers of two */
#define LATIN_PATH_SOFT      8.0  /* times as far by the tangent stiffness at the end of a small increment at most: more, and it may have snapped to where it is soft */
#define LATIN_PATH_CURVE     3.0  /* times the displacements from one equilibrium to the next: rates at its ends up to this let a cubic curve not overshoot */
#define LATIN_PATH_CORRECTED 30.0 /* times the displacements of an increment by the tangent stiffness: the first step of Newton's method from them at most; 10 and 100 take as many set-ups */

/* Do the forces of the links along the straight way from u to v never fall on it? A truss that snaps through is seen up to some thousand times as far as it is high. Overwrites w. Collective on structure */
static PetscErrorCode LatinPathRises_Private(LatinStructure structure, Vec u, Vec v, Vec w, PetscBool *rises)
{
  PetscScalar force, further = 0.0;
  PetscReal   noise = 0.0;
  Vec         r, way;

  PetscFunctionBegin;
  *rises = PETSC_TRUE;
  PetscCall(DMGetGlobalVector(structure->dm, &r));
  PetscCall(DMGetGlobalVector(structure->dm, &way));
  PetscCall(VecWAXPY(way, -1.0, u, v));
  for (PetscInt k = 0; k < LATIN_PATH_HALVES && *rises; k++) {
    PetscCall(VecWAXPY(w, PetscPowRealInt(0.5, k), way, u));
    PetscCall(LatinTurningResidual_Private(structure, NULL, w, r));
    PetscCall(VecDot(r, way, &force));
    if (k) *rises = (PetscBool)(PetscRealPart(force - further) <= noise);
    else noise = PETSC_SQRT_MACHINE_EPSILON * PetscAbsScalar(force);
    further = force;
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &way));
  PetscCall(DMRestoreGlobalVector(structure->dm, &r));
  PetscFunctionReturn(0);
}

/*
   By how much the next increment is to be smaller: 1 where this one, to the target, has moved no node too far, nor much less or more than the tangent stiffness
   says where it starts and where it ends. Collective on snes
*/
static PetscErrorCode LatinPathMoved_Private(SNES snes, const LatinPath *path, LatinPathTarget *target, PetscReal *smaller)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  const PetscReal      more = target->part - data->large.reached, back = target->far;
  PetscReal            size, step, moved, little;
  PetscBool            within = PETSC_TRUE;
  Vec                  change; /* as for the whole path */

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(structure->dm, &change));
  PetscCall(VecWAXPY(change, -1.0, path->u, target->u));
  PetscCall(VecNorm(change, NORM_INFINITY, &step));
  PetscCall(VecScale(change, 1.0 / more));
  PetscCall(VecNorm(change, NORM_2, &moved));
  PetscCall(VecNorm(path->u, NORM_INFINITY, &size));
  little = PetscMax(LATIN_PATH_KINK * PetscMax(size, step), LATIN_LARGE_NONE * data->large.size) / more;
  PetscCall(LatinPathBetween_Private(structure, change, path->ahead, back <= (more > LATIN_PATH_STIFFENS ? LATIN_PATH_FAR : LATIN_PATH_SOFT) * path->far ? target->ahead : NULL, little, &within));
  if (!within && more <= LATIN_PATH_STIFFENS) PetscCall(LatinPathBetween_Private(structure, change, target->ahead, target->ahead, little, &within)); /* a law with its kink where the path starts: the end says it all */
  target->other = (PetscBool)(!within && moved > LATIN_PATH_FAR * PetscMax(path->far, back));
  *smaller      = within ? 1.0 : 0.5;
  if (within) {
    PetscCall(LatinPathNodes_Private(structure, path->ahead, change, NULL, little, &within));
    if (within) PetscCall(LatinPathNodes_Private(structure, change, target->ahead, NULL, little, &within));
    if (!within && more <= LATIN_PATH_STIFFENS) {
      PetscCall(LatinPathTightens_Private(snes, path->u, target->u, &within));
      if (!within) PetscCall(LatinPathRises_Private(structure, path->u, target->u, change, &within));
    }
    if (!within) *smaller = PetscMin(0.5, PetscMax(moved / path->far, LATIN_PATH_STIFFENS / more)); /* none so small that it may stiffen as it will */
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &change));
  PetscCall(PetscInfo(snes, "%g of the path: displacements change by %g, the tangent stiffness says %g, %g%s\n", (double)target->part, (double)(more * moved), (double)(more * path->far), (double)(more * back),
                      within ? "" : ", of some nodes more or less than that"));
  PetscFunctionReturn(0);
}

/*
   Where the nearest target may be, seen from the equilibrium path->u: on the cubic curve to the next one, if it has been found and both tangent stiffnesses are such
   that the curve does not overshoot [F. N. Fritsch, R. E. Carlson 1980]; else path->u. Where supports move, on the tangent. Overwrites path->step. Collective on snes
*/
static PetscErrorCode LatinPathGuess_Private(SNES snes, const LatinPath *path, Vec *guess)
{
  LatinLarge            *large  = &((SNES_Latin *)snes->data)->large;
  const LatinPathTarget *target = &path->target[path->targets - 1], *next = target - 1;
  PetscReal              h, s, moved;

  PetscFunctionBegin;
  *guess = large->supports.moves ? path->step : path->u;
  if (large->supports.moves) PetscCall(SNESLatinSupportsAhead_Private(snes, path->u, path->ahead, target->part - large->reached, path->step));
  if (large->supports.moves || path->targets < 2 || !next->u || next->other) PetscFunctionReturn(0);
  h = next->part - large->reached;
  s = (target->part - large->reached) / h;
  PetscCall(VecWAXPY(path->step, -1.0, path->u, next->u));
  PetscCall(VecNorm(path->step, NORM_2, &moved));
  if (h * PetscMax(path->far, next->far) > LATIN_PATH_CURVE * moved) PetscFunctionReturn(0);
  PetscCall(VecAYPX(path->step, s * s * (3.0 - 2.0 * s), path->u));
  PetscCall(VecAXPY(path->step, h * s * (1.0 - s) * (1.0 - s), path->ahead));
  PetscCall(VecAXPY(path->step, h * s * s * (s - 1.0), next->ahead));
  *guess            = path->step;
  large->between[0] = path->u;
  large->between[1] = next->u;
  large->part       = s;
  PetscCall(PetscInfo(path->u, "%g of the path: sought on the curve to what is known at %g\n", (double)target->part, (double)next->part));
  PetscFunctionReturn(0);
}

/* The nearest target from u: *found. Newton's method, which fails next to kinks, is not tried for a larger increment than one that it failed at. Collective on snes */
static PetscErrorCode LatinPathSolve_Private(SNES snes, LatinPath *path, Vec u, PetscBool *found)
{
  SNES_Latin      *data   = (SNES_Latin *)snes->data;
  LatinPathTarget *target = &path->target[path->targets - 1];
  const PetscReal  more   = target->part - data->large.reached;
  PetscBool        inside = (PetscBool)(!target->u && more > path->failed);

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeFrom_Private(snes, u, PETSC_TRUE, &inside));
  if (inside) path->failed = PetscMin(path->failed, more);
  if (inside) path->kinks = PETSC_TRUE;
  *found = (PetscBool)(data->next != LATIN_NEXT_GIVEN && (LatinNextConverged(data->next) || data->next == LATIN_NEXT_ROUNDING));
  if (!*found) PetscCall(VecDestroy(&target->u));
  else {
    if (!target->u) PetscCall(VecDuplicate(u, &target->u));
    PetscCall(VecCopy(snes->vec_sol, target->u));
  }
  PetscFunctionReturn(0);
}

/* Is the nearest target too far from the equilibrium path->u to be sought? Collective on snes */
static PetscErrorCode LatinPathFar_Private(SNES snes, LatinPath *path)
{
  LatinPathTarget *target = &path->target[path->targets - 1];
  const PetscReal  more   = target->part - ((SNES_Latin *)snes->data)->large.reached;
  PetscReal        corrected, none = LATIN_LARGE_NONE * ((SNES_Latin *)snes->data)->large.size; /* rounding, where nothing more acts */

  PetscFunctionBegin;
  target->passed = PETSC_FALSE;
  if (path->kinks || more <= LATIN_PATH_STIFFENS) PetscFunctionReturn(0); /* just before a cable tightens every increment is too large by the tangent stiffness there */
  PetscCall(VecWAXPY(path->step, more, path->ahead, path->u));
  PetscCall(SNESLatinLargeCorrect_Private(snes, path->u, path->step, &corrected));
  target->passed = (PetscBool)(corrected > PetscMax(LATIN_PATH_CORRECTED * more * path->far, none));
  PetscFunctionReturn(0);
}

/* The tangent prediction from the equilibrium that was found for the nearest target, and whether it is stable: once, with the operators there are. Collective on snes */
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
   An increment from the equilibrium path->u to the nearest target: the path goes on from there where *smaller is 1, else a smaller one may. What was found from further away may be seen from here to be on the path: it is not sought again. Collective on snes
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
    large->between[0] = large->between[1] = NULL;
    if (!found) PetscFunctionReturn(0);
    PetscCall(LatinPathSee_Private(snes, path, target));
  }
  PetscCall(LatinPathMoved_Private(snes, path, target, smaller));
  if (!target->stable) *smaller = PetscMin(0.5, *smaller);
  if (target->other && known) PetscCall(VecDestroy(&target->u)); /* from closer by as well */
  if (*smaller < 1.0) PetscFunctionReturn(0);
  if (known && path->targets == 1) { /* the end: operators and estimates there again */
    PetscCall(VecCopy(target->u, snes->vec_sol));
    PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
    PetscCall(LatinPathSolve_Private(snes, path, target->u, &found));
    *smaller = found ? 1.0 : 0.5;
    if (!found) PetscFunctionReturn(0);
  }
  PetscCall(VecCopy(target->u, path->u));
  PetscCall(VecCopy(target->ahead, path->ahead));
  path->failed = PETSC_MAX_REAL;
  path->far    = target->far;
  PetscFunctionReturn(0);
}

/* A new target ahead of the nearest one, at least half the way closer. Not collective */
static void LatinPathCloser(LatinPath *path, PetscReal part)
{
  path->target[path->targets++] = (LatinPathTarget){.part = part};
}

/* The nearest target is no longer one */
static PetscErrorCode LatinPathReached_Private(LatinPath *path)
{
  LatinPathTarget *target = &path->target[--path->targets];

  PetscFunctionBegin;
  PetscCall(VecDestroy(&target->u));
  PetscCall(VecDestroy(&target->ahead));
  PetscFunctionReturn(0);
}

/* No further equilibrium follows path->u: what moves on is named. Collective on snes */
static PetscErrorCode LatinPathLimit_Private(SNES snes, const LatinPath *path)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(PetscInfo(snes, "No equilibrium follows that of %g of the path: it is a limit point, or unstable\n", (double)data->large.reached));
  data->next = LATIN_NEXT_DIVERGED;
  PetscCall(SNESLatinSupportsAt_Private(snes, data->large.reached));
  PetscCall(LatinPathForces_Private(path->step));
  PetscCall(LatinPathMode_Private(snes, path->u, path->step));
  PetscCall(LatinEquilibriumMoved_Private(data->large.frame->turns, path->step, &data->found));
  PetscFunctionReturn(0);
}

/* Increments of the path from u, as far as they lead. Collective on snes */
static PetscErrorCode LatinPathIncrements_Private(SNES snes, LatinPath *path)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscReal   smaller;

  PetscFunctionBegin;
  while (path->targets) PetscCall(LatinPathReached_Private(path));
  if (large->reached < 1.0) LatinPathCloser(path, 1.0);
  while (path->targets && SNESLatinStagesLeft(snes) > 0) {
    while (path->kinks && path->targets > 1 && path->target[path->targets - 2].passed) PetscCall(LatinPathReached_Private(path));
    LatinPathTarget *target = &path->target[path->targets - 1];
    const PetscReal  more   = target->part - large->reached;

    if (more < LATIN_PATH_LEAST) break;
    PetscCall(LatinPathIncrement_Private(snes, path, &smaller));
    if (data->next == LATIN_NEXT_GIVEN) PetscFunctionReturn(0);
    if (smaller < 1.0) LatinPathCloser(path, large->reached + smaller * more);
    else {
      large->reached = target->part;
      PetscCall(LatinPathReached_Private(path));
    }
  }
  PetscFunctionReturn(0);
}

/* The path has led nowhere from what links at their kinks alone hold without loads: it starts anew as that of a mechanism, if *starts; else u stays. Collective on snes */
static PetscErrorCode LatinPathAnew_Private(SNES snes, LatinPath *path, PetscBool *starts)
{
  LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  Vec         u;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(large->frame->turns->dm, &u));
  PetscCall(VecCopy(path->u, u));
  PetscCall(LatinPathLoaded_Private(snes, path, starts));
  if (*starts) large->branch = -1.0;
  else {
    PetscCall(VecCopy(u, path->u));
    PetscCall(SNESLatinSupportsFrom_Private(snes, NULL));
  }
  PetscCall(DMRestoreGlobalVector(large->frame->turns->dm, &u));
  PetscFunctionReturn(0);
}

/* The path, from u; `from`: a stable equilibrium. Collective on snes */
static PetscErrorCode LatinPathFollow_Private(SNES snes, LatinPath *path, PetscBool from)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   goes = from;

  PetscFunctionBegin;
  while (goes) {
    if (from) PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &path->far));
    PetscCall(LatinPathIncrements_Private(snes, path));
    if (data->next == LATIN_NEXT_GIVEN || !path->targets) PetscFunctionReturn(0);
    goes = from = PETSC_FALSE;
    if (SNESLatinStagesLeft(snes) > 0 && data->newton.type != LATIN_NEWTON_NEVER) PetscCall(LatinPathBranch_Private(snes, path, &goes));
    if (!goes && path->unloaded && path->slackens && data->large.reached == 0.0) {
      PetscCall(LatinPathAnew_Private(snes, path, &from));
      goes = from;
    }
  }
  PetscCall(VecCopy(path->u, snes->vec_sol));
  data->next = LATIN_NEXT_MAX_IT;
  /* the iteration alone, which bars in compression disturb, ends before a limit point as well as at one */
  if (SNESLatinStagesLeft(snes) > 0 && data->newton.type != LATIN_NEWTON_NEVER) PetscCall(LatinPathLimit_Private(snes, path));
  PetscFunctionReturn(0);
}

/* The part of the loads that the displacements bear: those of the path so far, along its last ones. Supports have moved so far or further. Collective on snes */
static PetscErrorCode LatinPathBorne_Private(SNES snes, const LatinPath *path, PetscReal *reached)
{
  PetscScalar both, whole;
  PetscReal   moved; /* of what is prescribed */

  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsEnd_Private(snes, *reached, &moved));
  PetscCall(VecDot(path->first, path->whole, &both));
  PetscCall(VecDot(path->whole, path->whole, &whole));
  if (PetscRealPart(whole) > 0.0) *reached = PetscMin(*reached + (1.0 - *reached) * PetscRealPart(both / whole), moved);
  else if (moved < PETSC_MAX_REAL) *reached = moved;
  if (PetscAbsReal(*reached) <= PETSC_SQRT_MACHINE_EPSILON) *reached = 0.0; /* rounding: less than any increment */
  PetscFunctionReturn(0);
}

/* A solve, from the state z on. Collective on snes */
PetscErrorCode SNESLatinLargeRun_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinLarge    *large     = &data->large;
  LatinStructure structure = large->frame->turns;
  Vec            rhs       = snes->vec_rhs, work[6];
  LatinStopType  stop      = data->stop;
  PetscBool      struts = PETSC_FALSE, from = PETSC_FALSE;
  PetscErrorCode ierr;

  PetscFunctionBegin;
  PetscCall(LatinPathStruts_Private(structure, &struts, NULL));
  if (structure->midpoint && SNESLatinLargeProves(data)) {
    PetscCall(SNESLatinLargeStep_Private(snes));
    PetscFunctionReturn(0);
  }
  if (!struts || structure->midpoint || data->stop == LATIN_STOP_REFERENCE || SNESLatinUserTest(snes) || (SNESLatinWarm(data) && !large->solution)) {
    PetscCall(SNESLatinLargeIterate_Private(snes));
    if (data->next == LATIN_NEXT_DIVERGED || data->next == LATIN_NEXT_NOT_FINITE) PetscCall(SNESLatinLargeConvex_Private(snes, PETSC_TRUE, &from));
    large->reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
    PetscCall(VecDestroy(&large->solution));
    PetscFunctionReturn(0);
  }
  for (PetscInt i = 0; i < 6; i++) PetscCall(DMGetGlobalVector(structure->dm, &work[i]));
  LatinPath path = {.first = work[0], .whole = work[1], .u = work[2], .ahead = work[3], .more = work[4], .step = work[5], .far = PETSC_MAX_REAL, .failed = PETSC_MAX_REAL, .heavier = PETSC_TRUE};
  if (data->newton.type != LATIN_NEWTON_NEVER && !SNESLatinEstimates(data)) data->stop = LATIN_STOP_ERROR; /* along the path, which Newton's method follows */
  ierr = LatinPathStart_Private(snes, &path, &from);
  if (!ierr) ierr = LatinPathFollow_Private(snes, &path, from);
  if (!ierr) ierr = SNESLatinLargeStop_Private(snes, stop);
  data->stop = stop;
  while (path.targets) PetscCall(LatinPathReached_Private(&path));
  snes->vec_rhs = rhs; /* after an error as well, or the SNES would give back what it has not got */
  if (!ierr) ierr = LatinPathBorne_Private(snes, &path, &large->reached);
  PetscCall(LatinSupportsReset_Private(large));
  for (PetscInt i = 0; i < 6; i++) PetscCall(DMRestoreGlobalVector(structure->dm, &work[i]));
  PetscCall(ierr);
  if (!large->solution) PetscCall(VecDuplicate(snes->vec_sol, &large->solution));
  PetscCall(VecCopy(snes->vec_sol, large->solution));
  PetscCall(SNESLatinBalance_Private(snes));
  PetscFunctionReturn(0);
}
