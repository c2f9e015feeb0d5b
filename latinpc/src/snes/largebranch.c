#include "snes/largepath.h"

/*
   Branches of the path of the loads. If no increment follows, either of these may be the cause:

   - Two crossed cables of a panel slacken together and leave the symmetric panel unstable. It shears a little until one of them tightens,
     and the path goes on.
   - A symmetric structure buckles to one side or the other. The path ends and the caller is informed, who chooses a side by loads or an
     imperfection.
   - The structure snaps through: no branch.

   To distinguish them, two stable states are sought by descents from the last stable equilibrium, disturbed along its softest mode: under
   slightly more loads, and under a part of these. Displacements along a branch grow from zero with the loads, or as their root. A
   snap-through leads equally far under both, and no less far under the smaller loads of the try before.
*/

#define LATIN_BRANCH_AHEAD    (16.0 * LATIN_PATH_LEAST) /* part of the path: step onto a branch */
#define LATIN_BRANCH_LESS     4.0                       /* divisor of this step for the second state, which shows the kind of branch */
#define LATIN_BRANCH_NEARER   0.75                      /* largest ratio of both distances on a branch: they grow as the loads (1/4) or as their root (1/2) */
#define LATIN_BRANCH_LINEAR   0.35                      /* the same of a panel that shears, between 1/4 and the 1/2 of buckling */
#define LATIN_BRANCH_TRIES    3                         /* most lengths of the step if links are at kinks of their laws */
#define LATIN_BRANCH_FURTHER  8.0                       /* ratio of these lengths; in short steps rounding hides the direction in which the energy falls */
#define LATIN_BRANCH_POWER    8                         /* iterations of the power method */
#define LATIN_BRANCH_NOTHING  1e-2                      /* a stiffness below this part of the whole one is zero to the power method */
#define LATIN_BRANCH_DISTURBS 1e-6                      /* disturbance along the mode, relative to the size, beside the predicted displacement */

/* Descends from v to an equilibrium under that part of the path; *stable: found, in v, and stable. Overwrites path->step. Collective on snes */
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

/* Computes the softest mode at path->u, of length 1. Collective on snes */
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
   Finds in *kinks whether links are nearer to a kink of their law than the requested error. If so, computes the mode that loses most
   stiffness on their softer sides, of length 1: with K the tangent stiffness (stiffer sides) and K' that of the softer sides, the
   eigenvector of the largest mu in (K - K') x = mu K x, by the power method. Sets path->slackens: K' is nearly zero in that mode.
   Collective on snes
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
  PetscCall(PetscMalloc1(structure->links_local + 1, &slope)); /* not NULL without links either */
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

/*
   Seeks a stable equilibrium v near path->u along the mode, `more` of the path further. *beside: its largest displacement of a node from
   path->u; PETSC_MAX_REAL: none. Overwrites path->step. Collective on snes
*/
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
   Returns in *begins whether a branch begins at path->u along the mode; then v is on it, `more` of the path further.

     past:    distance of the nearest state in the try before; 0: none
     *linear: displacements grow as the loads, as of a panel that shears, not as their root, as in buckling
     *far:    distance of v from path->u; PETSC_MAX_REAL: none

   Collective on snes
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

/*
   Replaces an unstable equilibrium of the nearest target by a stable one beside it, if *settles. Only after a panel has sheared: the
   symmetric state is then unstable. Collective on snes
*/
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

/*
   Seeks a branch at path->u, from which no increment follows. *goes: a panel shears, and path->u is now on its branch. If a stable branch
   begins because the structure buckles, sets large->branch. Collective on snes
*/
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
