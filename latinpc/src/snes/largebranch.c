#include "snes/largepath.h"

/*
   Where the path of the loads branches. Crossed cables of a panel that slacken together leave the symmetric panel unstable: it shears a little until one of
   them tightens, and the path goes on. A symmetric structure that buckles goes on to one side or the other: the path ends, and the caller is told, who
   chooses a side by loads or an imperfection. Both are sought down the energy, from the last stable equilibrium, disturbed, under slightly more loads, and
   under a part of these. Along a branch displacements grow from none with the loads; a snap-through leads equally far under either, and no less far under the loads of the try before.
*/

#define LATIN_BRANCH_AHEAD    (16.0 * LATIN_PATH_LEAST) /* of the loads: the step onto a branch */
#define LATIN_BRANCH_LESS     4.0                       /* times less of them show whether it is one: displacements along branches grow as fast as the loads, or as their root */
#define LATIN_BRANCH_NEARER   0.75                      /* times as far, at most, with less */
#define LATIN_BRANCH_LINEAR   0.35                      /* times as far, at most, of a panel that shears: a quarter; what buckles goes half as far */
#define LATIN_BRANCH_TRIES    3                         /* steps tried where cables are at their kinks, */
#define LATIN_BRANCH_FURTHER  8.0                       /* each so many times as long: under few loads rounding hides which way the energy falls */
#define LATIN_BRANCH_POWER    8                         /* steps of the power method */
#define LATIN_BRANCH_NOTHING  1e-2                      /* of the stiffness: what the power method leaves of none */
#define LATIN_BRANCH_DISTURBS 1e-6                      /* of the size of the structure, beside the displacements ahead: how far along the mode a descent begins */

/* From v down the energy to a stable equilibrium under that part of the path, if *stable. Overwrites path->step. Collective on snes */
static PetscErrorCode LatinBranchSettle_Private(SNES snes, LatinPath *path, PetscReal part, Vec v, PetscBool *stable)
{
  SNES_Latin *data    = (SNES_Latin *)snes->data;
  PetscBool   heavier = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(VecCopy(path->u, snes->vec_sol));
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscCall(LatinPathLoad_Private(snes, path, part));
  PetscCall(SNESLatinLargeDescend_Private(snes, PETSC_TRUE, &heavier, v, stable));
  if (!*stable) PetscFunctionReturn(0);
  PetscCall(SNESLatinLargeFrom_Private(snes, v, PETSC_TRUE, NULL));
  *stable = LatinNextConverged(data->next);
  PetscCall(VecCopy(snes->vec_sol, v));
  if (*stable) PetscCall(LatinPathStable_Private(snes, path, v, stable));
  PetscFunctionReturn(0);
}

/* The direction in which path->u is softest, of length 1. Collective on snes */
static PetscErrorCode LatinBranchMode_Private(SNES snes, const LatinPath *path, Vec mode)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsAt_Private(snes, ((SNES_Latin *)snes->data)->large.reached));
  PetscCall(LatinPathForces_Private(mode));
  PetscCall(LatinPathMode_Private(snes, path->u, mode));
  PetscCall(VecNormalize(mode, NULL));
  PetscFunctionReturn(0);
}

/*
   Are links nearer to a kink than the error asked for? Then the direction in which path->u is softest with their softer sides: K the tangent stiffness,
   K - D that of the softer sides, the largest mu in D x = mu K x, by the power method; of length 1. path->slackens: softer sides leave next to nothing of the
   stiffness in it. Collective on snes
*/
static PetscErrorCode LatinBranchKinks_Private(SNES snes, LatinPath *path, Vec mode, PetscBool *kinks)
{
  LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  PetscReal      moved = 0.0, drop = 1.0, force, *slope;
  PetscScalar    whole, less;
  KSP            ksp;
  Mat            K, softer;
  Vec            f, g;

  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsAt_Private(snes, ((SNES_Latin *)snes->data)->large.reached));
  PetscCall(DMGetGlobalVector(structure->dm, &f));
  PetscCall(DMGetGlobalVector(structure->dm, &g));
  PetscCall(LatinTurningMatCreate_Private(structure, &softer));
  PetscCall(PetscMalloc1(structure->links_local + 1, &slope)); /* never NULL */
  PetscCall(LatinPathSlopes_Private(snes, path->u, PETSC_FALSE, slope));
  structure->slope = slope;
  PetscCall(LatinTurningMatCompute_Private(structure, path->u, softer));
  structure->slope = NULL;
  PetscCall(PetscFree(slope));
  PetscCall(SNESLatinLargeTangent_Private(snes, path->u, &ksp));
  PetscCall(KSPGetOperators(ksp, &K, NULL));
  PetscCall(LatinPathForces_Private(mode));
  for (PetscInt k = 0; k < LATIN_BRANCH_POWER && drop > 0.0 && moved < PETSC_MAX_REAL; k++) {
    PetscCall(VecNormalize(mode, NULL));
    PetscCall(MatMult(K, mode, f));
    PetscCall(MatMult(softer, mode, g));
    PetscCall(VecNorm(f, NORM_2, &force));
    PetscCall(VecDot(mode, f, &whole));
    PetscCall(VecDot(mode, g, &less));
    path->slackens = (PetscBool)(PetscRealPart(less) <= LATIN_BRANCH_NOTHING * PetscRealPart(whole));
    PetscCall(VecAXPY(f, -1.0, g));
    PetscCall(VecNorm(f, NORM_2, &drop));
    if (drop <= PETSC_SQRT_MACHINE_EPSILON * force) drop = 0.0;
    else PetscCall(SNESLatinLargePredict_Private(snes, path->u, f, mode, &moved));
  }
  *kinks = (PetscBool)(drop > 0.0);
  PetscCall(VecNormalize(mode, NULL));
  PetscCall(MatDestroy(&softer));
  PetscCall(DMRestoreGlobalVector(structure->dm, &g));
  PetscCall(DMRestoreGlobalVector(structure->dm, &f));
  PetscFunctionReturn(0);
}

/* A stable equilibrium v, sought along the mode, under `more` of the path, and how far from path->u, by the node that is farthest: without bound if there is none. Collective on snes */
static PetscErrorCode LatinBranchSeek_Private(SNES snes, LatinPath *path, Vec mode, PetscReal more, Vec v, PetscReal *beside)
{
  PetscBool stable;

  PetscFunctionBegin;
  *beside = PETSC_MAX_REAL;
  PetscCall(VecWAXPY(v, more, path->ahead, path->u));
  PetscCall(VecAXPY(v, more * path->far + LATIN_BRANCH_DISTURBS * ((SNES_Latin *)snes->data)->large.size, mode));
  PetscCall(LatinBranchSettle_Private(snes, path, ((SNES_Latin *)snes->data)->large.reached + more, v, &stable));
  if (!stable) PetscFunctionReturn(0);
  PetscCall(VecWAXPY(path->step, -1.0, path->u, v));
  PetscCall(VecNorm(path->step, NORM_INFINITY, beside));
  PetscFunctionReturn(0);
}

/*
   Does a branch begin at path->u, along the mode? Then v is on it, under `more` of the path; *linear: displacements grow as the loads, as of a panel that shears, not as their root, as of what buckles.
   past: how far it was under the loads of the last try, 0: not found. *far: how far it is, without bound if there is none. Collective on snes
*/
static PetscErrorCode LatinBranchBegins_Private(SNES snes, LatinPath *path, Vec mode, PetscReal more, PetscReal past, Vec v, PetscBool *begins, PetscBool *linear, PetscReal *far)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  PetscReal         less, beside = PETSC_MAX_REAL;

  PetscFunctionBegin;
  PetscCall(LatinBranchSeek_Private(snes, path, mode, more / LATIN_BRANCH_LESS, v, &less));
  if (less < PETSC_MAX_REAL) PetscCall(LatinBranchSeek_Private(snes, path, mode, more, v, &beside));
  *linear = (PetscBool)(less <= LATIN_BRANCH_LINEAR * beside && less * LATIN_BRANCH_LESS * LATIN_BRANCH_LESS >= beside * LATIN_BRANCH_LINEAR);
  *begins = (PetscBool)(beside < PETSC_MAX_REAL && less <= LATIN_BRANCH_NEARER * beside && past <= LATIN_BRANCH_NEARER * less);
  *far    = beside;
  PetscCall(PetscInfo(snes, "Beyond %g of the path a stable equilibrium is %g from there, under less loads %g: %s\n", (double)large->reached, (double)beside, (double)less, *begins ? "a branch" : "none follows"));
  PetscFunctionReturn(0);
}

/* Once such a panel has sheared: from an unstable equilibrium found for the nearest target, as on the side that is symmetric, to a stable one, if *settles. Collective on snes */
PetscErrorCode LatinPathSettle_Private(SNES snes, LatinPath *path, LatinPathTarget *target, PetscBool *settles)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  const PetscReal   more  = target->part - large->reached;
  PetscBool         kinks;
  Vec               v;

  PetscFunctionBegin;
  *settles = PETSC_FALSE;
  if (!large->sheared || path->far == PETSC_MAX_REAL) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(large->frame->turns->dm, &v));
  PetscCall(LatinBranchKinks_Private(snes, path, v, &kinks));
  if (!kinks) PetscCall(LatinBranchMode_Private(snes, path, v));
  PetscCall(VecAYPX(v, PetscMin(more, LATIN_BRANCH_AHEAD) * path->far + LATIN_BRANCH_DISTURBS * large->size, target->u));
  PetscCall(LatinBranchSettle_Private(snes, path, target->part, v, settles));
  if (*settles) PetscCall(VecCopy(v, target->u));
  PetscCall(DMRestoreGlobalVector(large->frame->turns->dm, &v));
  PetscFunctionReturn(0);
}

/* Where no increment follows path->u: on where a panel shears, if *goes; large->branch where it buckles, and a stable branch begins. Collective on snes */
PetscErrorCode LatinPathBranch_Private(SNES snes, LatinPath *path, PetscBool *goes)
{
  LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  PetscBool   kinks, linear = PETSC_FALSE, begins = PETSC_FALSE;
  PetscReal   more = 0.0, past = 0.0, far = PETSC_MAX_REAL;
  Vec         v, mode[2];

  PetscFunctionBegin;
  *goes = PETSC_FALSE;
  if (path->far == PETSC_MAX_REAL) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(large->frame->turns->dm, &v));
  for (PetscInt i = 0; i < 2; i++) PetscCall(DMGetGlobalVector(large->frame->turns->dm, &mode[i]));
  PetscCall(LatinBranchKinks_Private(snes, path, mode[0], &kinks));
  PetscCall(LatinBranchMode_Private(snes, path, mode[1]));
  for (PetscInt k = 0; k < (kinks ? LATIN_BRANCH_TRIES : 1) && !begins && more < 1.0 - large->reached; k++) {
    PetscReal nearest = PETSC_MAX_REAL;

    more = PetscMin(k ? LATIN_BRANCH_FURTHER * more : LATIN_BRANCH_AHEAD, 1.0 - large->reached);
    for (PetscInt i = kinks ? 0 : 1; i < 2 && !begins; i++) {
      PetscCall(LatinBranchBegins_Private(snes, path, mode[i], more, past, v, &begins, &linear, &far));
      if (k) begins = (PetscBool)(begins && linear);
      nearest = PetscMin(nearest, far);
    }
    past = nearest < PETSC_MAX_REAL ? nearest : 0.0;
  }
  *goes = (PetscBool)(begins && linear);
  if (begins && !*goes) large->branch = large->reached;
  if (*goes) {
    PetscCall(VecCopy(v, path->u));
    PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &path->far));
    large->reached += more;
    large->sheared = PETSC_TRUE;
    path->failed   = PETSC_MAX_REAL;
  }
  for (PetscInt i = 0; i < 2; i++) PetscCall(DMRestoreGlobalVector(large->frame->turns->dm, &mode[i]));
  PetscCall(DMRestoreGlobalVector(large->frame->turns->dm, &v));
  PetscFunctionReturn(0);
}
