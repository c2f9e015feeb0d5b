/* The path of the loads with large displacements: where it starts (snes/largestart.c), its increments (snes/largepath.c), where it branches (snes/largebranch.c) */
#ifndef LARGEPATH_H
#define LARGEPATH_H

#include "snes/sneslatinimpl.h"

#define LATIN_PATH_STIFFENS 1e-3 /* increments of the loads: in smaller ones a structure may stiffen as it will, for cables that tighten */
#define LATIN_PATH_LEAST    1e-4 /* increments of the loads: smaller ones show a limit point */
#define LATIN_PATH_TARGETS  16   /* each at most half as far as the one before, and none closer than the least increment */

/* A target: a part of the path, the equilibrium u there that was found, or NULL, and by how much the whole path would move it by the tangent stiffness, l2 norm `far`; `stable`: u is; `other`: u is further than any path leads, on another one; `passed`: too far to be sought */
typedef struct {
  PetscReal part, far;
  Vec       u, ahead;
  PetscBool stable, other, passed;
} LatinPathTarget;

/* A path: loads that grow from `first` to `whole`, an equilibrium u on it; by how much the whole path would move it by the tangent stiffness there; work vectors; targets, the nearest last; an increment has taken the interior-point method; heavier loads may still lead to a start */
typedef struct {
  Vec             first, whole, u, ahead, more, step;
  PetscReal       far;    /* l2 norm of ahead */
  PetscReal       failed; /* the least increment from u that Newton's method failed at */
  LatinPathTarget target[LATIN_PATH_TARGETS];
  PetscInt        targets;
  PetscBool       kinks, heavier;
  PetscBool       unloaded; /* it starts without loads */
  PetscBool       slackens; /* no increment follows u, which links at their kinks alone hold */
} LatinPath;

/* snes/largestart.c */
PETSC_INTERN PetscErrorCode LatinPathLoad_Private(SNES, const LatinPath *, PetscReal part);
PETSC_INTERN PetscErrorCode LatinPathRate_Private(SNES, const LatinPath *, Vec u, Vec rate, PetscReal *far);
PETSC_INTERN PetscErrorCode LatinPathStable_Private(SNES, const LatinPath *, Vec u, PetscBool *stable);
PETSC_INTERN PetscErrorCode LatinPathStart_Private(SNES, LatinPath *, PetscBool *from);
PETSC_INTERN PetscErrorCode LatinPathLoaded_Private(SNES, LatinPath *, PetscBool *starts);
/* snes/largekinks.c */
PETSC_INTERN PetscErrorCode LatinPathTightens_Private(SNES, Vec u, Vec v, PetscBool *tightens);
/* snes/largebranch.c */
PETSC_INTERN PetscErrorCode LatinPathBranch_Private(SNES, LatinPath *, PetscBool *goes);
PETSC_INTERN PetscErrorCode LatinPathSettle_Private(SNES, LatinPath *, LatinPathTarget *, PetscBool *settles);

#endif
