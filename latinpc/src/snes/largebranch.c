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
   snap-through leads equally far under both. The first cause is sought before (snes/largepanels.c).
*/

#define LATIN_BRANCH_DISTURB 1e-6 /* disturbance of the state that a descent begins at, along the mode, relative to the size */
#define LATIN_BRANCH_AHEAD   16.0 /* step onto a branch, in least increments */
#define LATIN_BRANCH_LESS    4.0  /* divisor of this step for the second state, which shows the kind of branch */
#define LATIN_BRANCH_NEARER  0.75 /* largest ratio of both distances on a branch: they grow as the loads (1/4) or as their root (1/2) */
#define LATIN_BRANCH_LINEAR  0.35 /* the same of a panel that shears, between 1/4 and the 1/2 of buckling */

/* Operators at u, for the loads of that part of the path. Collective on snes */
static PetscErrorCode LatinBranchOperators_Private(SNES snes, const LatinPath *path, Vec u, PetscReal part)
{
  PetscFunctionBegin;
  PetscCall(VecCopy(u, snes->vec_sol));
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscCall(LatinPathLoad_Private(snes, path, part));
  PetscFunctionReturn(0);
}

/* Solves from v. *stable: it converges, to a stable equilibrium, which is in v then. Overwrites path->step. Collective on snes */
static PetscErrorCode LatinBranchSolve_Private(SNES snes, const LatinPath *path, Vec v, PetscBool *stable)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinLargeFrom_Private(snes, v, PETSC_TRUE, NULL));
  *stable = LatinNextConverged(((SNES_Latin *)snes->data)->next);
  if (*stable) PetscCall(LatinPathStable_Private(snes, path, snes->vec_sol, stable));
  if (*stable) PetscCall(VecCopy(snes->vec_sol, v));
  PetscFunctionReturn(0);
}

/* Descends from v to an equilibrium under that part of the path, with operators at u; *stable: found, in v, and stable. Overwrites path->step. Collective on snes */
PetscErrorCode LatinPathDown_Private(SNES snes, const LatinPath *path, Vec u, PetscReal part, Vec v, PetscBool *stable)
{
  PetscBool heavier = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinBranchOperators_Private(snes, path, u, part));
  PetscCall(SNESLatinLargeDescend_Private(snes, PETSC_TRUE, &heavier, v, stable));
  if (*stable) PetscCall(LatinBranchSolve_Private(snes, path, v, stable));
  PetscFunctionReturn(0);
}

/* The same, from a guess v that is near that equilibrium: a descent only if a solve does not find it. Collective on snes */
PetscErrorCode LatinPathNear_Private(SNES snes, const LatinPath *path, PetscReal part, Vec v, PetscBool *stable)
{
  PetscFunctionBegin;
  PetscCall(LatinBranchOperators_Private(snes, path, v, part));
  PetscCall(LatinBranchSolve_Private(snes, path, v, stable));
  if (!*stable) PetscCall(LatinPathDown_Private(snes, path, v, part, v, stable));
  PetscFunctionReturn(0);
}

/* Computes the softest mode at path->u, of length 1. Collective on snes */
static PetscErrorCode LatinBranchMode_Private(SNES snes, const LatinPath *path, Vec mode)
{
  PetscFunctionBegin;
  PetscCall(SNESLatinSupportsAt_Private(snes, ((SNES_Latin *)snes->data)->large.path.reached));
  PetscCall(LatinPathForces_Private(mode));
  PetscCall(LatinPathMode_Private(snes, path->u, mode));
  PetscCall(VecNormalize(mode, NULL));
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
  PetscCall(VecAXPY(v, more * path->far + LATIN_BRANCH_DISTURB * ((SNES_Latin *)snes->data)->large.size, mode));
  PetscCall(LatinPathDown_Private(snes, path, path->u, ((SNES_Latin *)snes->data)->large.path.reached + more, v, &stable));
  if (!stable) PetscFunctionReturn(0);
  PetscCall(VecWAXPY(path->step, -1.0, path->u, v));
  PetscCall(VecNorm(path->step, NORM_INFINITY, beside));
  PetscFunctionReturn(0);
}

/*
   Returns in *begins whether a branch begins at path->u along the mode; then v is on it, `more` of the path further.

   *linear: displacements grow as the loads, as of a panel that shears, not as their root, as in buckling. Collective on snes
*/
static PetscErrorCode LatinBranchBegins_Private(SNES snes, LatinPath *path, Vec mode, PetscReal more, Vec v, PetscBool *begins, PetscBool *linear)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  PetscReal         less, beside = PETSC_MAX_REAL;

  PetscFunctionBegin;
  PetscCall(LatinBranchSeek_Private(snes, path, mode, more / LATIN_BRANCH_LESS, v, &less));
  if (less < PETSC_MAX_REAL) PetscCall(LatinBranchSeek_Private(snes, path, mode, more, v, &beside));
  *linear = (PetscBool)(less <= LATIN_BRANCH_LINEAR * beside && less * LATIN_BRANCH_LESS * LATIN_BRANCH_LESS >= beside * LATIN_BRANCH_LINEAR);
  *begins = (PetscBool)(beside < PETSC_MAX_REAL && less <= LATIN_BRANCH_NEARER * beside);
  PetscCall(PetscInfo(snes, "Beyond %g of the path a stable equilibrium is %g from there, under less loads %g: %s\n", (double)large->path.reached, (double)beside, (double)less, *begins ? "a branch" : "none follows"));
  PetscFunctionReturn(0);
}

/*
   Replaces an unstable equilibrium of the nearest target by a stable one beside it, if *settles. Only after a panel has sheared: the
   symmetric state is then unstable. Without, 80 braced towers take a fifth more iterations. Collective on snes
*/
PetscErrorCode LatinPathSettle_Private(SNES snes, LatinPath *path, LatinPathTarget *target, PetscBool *settles)
{
  const LatinLarge *large = &((SNES_Latin *)snes->data)->large;
  const PetscReal   more  = target->part - large->path.reached;
  Vec               v;

  PetscFunctionBegin;
  *settles = PETSC_FALSE;
  if (!large->path.sheared || path->far == PETSC_MAX_REAL) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(large->frame->original->dm, &v));
  PetscCall(LatinBranchMode_Private(snes, path, v));
  PetscCall(VecAYPX(v, PetscMin(more, LATIN_BRANCH_AHEAD * LATIN_PATH_LEAST) * path->far + LATIN_BRANCH_DISTURB * large->size, target->u));
  PetscCall(LatinPathDown_Private(snes, path, path->u, target->part, v, settles));
  if (*settles) PetscCall(VecCopy(v, target->u));
  PetscCall(DMRestoreGlobalVector(large->frame->original->dm, &v));
  PetscFunctionReturn(0);
}

/*
   Seeks a branch at path->u, from which no increment follows. *goes: a panel shears, and path->u is now on its branch. If a stable branch
   begins because the structure buckles, sets large->path.branch. Collective on snes
*/
PetscErrorCode LatinPathBranch_Private(SNES snes, LatinPath *path, PetscBool *goes)
{
  LatinLarge *large  = &((SNES_Latin *)snes->data)->large;
  PetscBool   linear = PETSC_FALSE, begins = PETSC_FALSE;
  PetscReal   more = PetscMin(LATIN_BRANCH_AHEAD * LatinPathLeast(large->path.reached), 1.0 - large->path.reached);
  Vec         v, mode;

  PetscFunctionBegin;
  *goes = PETSC_FALSE;
  if (path->far == PETSC_MAX_REAL) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(large->frame->original->dm, &v));
  PetscCall(DMGetGlobalVector(large->frame->original->dm, &mode));
  PetscCall(LatinBranchMode_Private(snes, path, mode));
  PetscCall(LatinBranchBegins_Private(snes, path, mode, more, v, &begins, &linear));
  *goes = (PetscBool)(begins && linear);
  if (begins && !*goes) large->path.branch = large->path.reached;
  if (*goes) {
    PetscCall(VecCopy(v, path->u));
    PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &path->far));
    large->path.reached += more;
    large->path.sheared = PETSC_TRUE;
  }
  PetscCall(DMRestoreGlobalVector(large->frame->original->dm, &mode));
  PetscCall(DMRestoreGlobalVector(large->frame->original->dm, &v));
  PetscFunctionReturn(0);
}
