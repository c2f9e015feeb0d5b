/*
   Path of the loads with large displacements: its start (snes/largestart.c), its increments (snes/largepath.c), its branches
   (snes/largebranch.c). A position on the path is a part of it: 0 at its start, 1 under the whole loads.
*/
#ifndef LARGEPATH_H
#define LARGEPATH_H

#include "snes/sneslatinimpl.h"

#define LATIN_PATH_STIFFENS 1e-3 /* part of the path: in smaller increments a structure may stiffen at once, as where a cable tightens */
#define LATIN_PATH_LEAST    1e-4 /* least increment, relative to the part of the path behind: if it fails, the path has met a limit point */
#define LATIN_PATH_SMALL    1e-8 /* part of the path: no increment is less. A structure that loads hold may stiffen at once at the start */
#define LATIN_PATH_TARGETS  32   /* most targets at once: each increment is at most half the one before, and none below LATIN_PATH_SMALL */

/*
   Target: a part of the path for which an equilibrium is sought.

     part:   position on the path
     far:    l2 norm of ahead
     u:      equilibrium found there, or NULL
     ahead:  displacements by which the whole path would move u, by the tangent stiffness at u
     stable: the tangent stiffness at u is positive definite
     other:  u is further away than the path can lead: it is on another path
     passed: too far away for Newton's method, so that it was not solved for
*/
typedef struct {
  PetscReal part, far;
  Vec       u, ahead;
  PetscBool stable, other, passed;
} LatinPathTarget;

/*
   Path of the loads from `first` to `whole`.

     u:       last equilibrium on the path
     ahead:   displacements by which the whole path would move u, by the tangent stiffness at u
     target:  [targets], the nearest last
     kinks:   an increment has needed the interior-point method
     heavier: a descent under heavier loads has not been tried yet
     more, step: work vectors
*/
typedef struct {
  Vec             first, whole, u, ahead, more, step;
  PetscReal       far;  /* l2 norm of ahead; PETSC_MAX_REAL: the tangent stiffness at u is not positive definite */
  PetscReal       last; /* length of the last increment, 0 before the first */
  LatinPathTarget target[LATIN_PATH_TARGETS];
  PetscInt        targets;
  PetscBool       kinks, heavier;
  PetscBool       unloaded; /* the path starts without loads */
  PetscBool       slackens; /* only links at kinks of their laws hold the unloaded state where the path starts */
} LatinPath;

/* Returns the least increment, as a part of the path, from a position on it */
static inline PetscReal LatinPathLeast(PetscReal reached)
{
  return PetscMax(LATIN_PATH_SMALL, LATIN_PATH_LEAST * reached);
}

/* snes/largestart.c */
PETSC_INTERN PetscErrorCode LatinPathLoad_Private(SNES, const LatinPath *, PetscReal part);
PETSC_INTERN PetscErrorCode LatinPathRate_Private(SNES, const LatinPath *, Vec u, Vec rate, PetscReal *far);
PETSC_INTERN PetscErrorCode LatinPathStable_Private(SNES, const LatinPath *, Vec u, PetscBool *stable);
PETSC_INTERN PetscErrorCode LatinPathStart_Private(SNES, LatinPath *, PetscBool *from);
PETSC_INTERN PetscErrorCode LatinPathLoaded_Private(SNES, LatinPath *, PetscBool *starts);
/* snes/largekinks.c */
PETSC_INTERN PetscErrorCode LatinPathStiffer_Private(LatinStructure, const PetscReal a[], const PetscReal b[], PetscBool *stiffer);
PETSC_INTERN PetscErrorCode LatinPathTightens_Private(SNES, Vec u, Vec v, PetscBool *tightens);
/* snes/largecompare.c */
PETSC_INTERN PetscErrorCode LatinPathCompare_Private(SNES, const LatinPath *, LatinPathTarget *, PetscReal *smaller);
/* snes/largepanels.c */
PETSC_INTERN PetscErrorCode LatinPathPanels_Private(SNES, LatinPath *, PetscBool *goes);
/* snes/largebranch.c */
PETSC_INTERN PetscErrorCode LatinPathDown_Private(SNES, const LatinPath *, Vec u, PetscReal part, Vec v, PetscBool *stable);
PETSC_INTERN PetscErrorCode LatinPathNear_Private(SNES, const LatinPath *, PetscReal part, Vec v, PetscBool *stable);
PETSC_INTERN PetscErrorCode LatinPathBranch_Private(SNES, LatinPath *, PetscBool *goes);
PETSC_INTERN PetscErrorCode LatinPathSettle_Private(SNES, LatinPath *, LatinPathTarget *, PetscBool *settles);

#endif
