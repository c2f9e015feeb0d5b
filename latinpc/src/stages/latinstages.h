/*
   The two stages of an iteration: linear (sections 3.2 and 5) and local (section 3.3), and the fixed-point map z -> G(z)
   that they make together.
*/
#ifndef LATINSTAGES_H
#define LATINSTAGES_H

#include "coarse/latincoarse.h"
#include <math.h> /* INFINITY: that of PETSc is a large number */

/* ---- linear stage (stages/linear.c, stages/homogenise.c): operators of the subdomains, and what a stage works on ---- */
/* An entry of K_rC */
typedef struct {
  PetscInt  row, primal; /* from the subdomain's first row; position in its primal list */
  PetscReal value;
} LatinCoupling;

/* Displacements for unit coarse displacements in all rows of a subdomain or, where its factor keeps the primal ones, for unit macro forces with these held, in the rows of interfaces */
typedef struct {
  PetscInt   rows, *row; /* from its first one, increasing, where they are some */
  PetscReal *a;          /* rows x coarse or macro, column-major */
} LatinPhi;

typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinDirections *dir;
  const LatinMacro      *macro;
  const LatinBatches    *batches;
  LatinSpectral         *spectral; /* gives its inverses away */
  LatinCoarse           *coarse;
  LatinLocalSolvers     *solvers;
  PetscBool              substructures; /* all that is on interfaces is in the coarse problem, and Phi is not kept */
  PetscBool              empty;         /* values of their operators have gone once factors were there */
  PetscBool              shared;        /* given: forces, and displacements that are read, are at nodes of several subdomains */
  PetscBool              precise;       /* the coarse problem is too soft for subdomains condensed in single precision */
  /* the following are stored once for each pattern, and found by subdomain */
  PetscInt        *rc_first, *rc_last; /* [subdomains] coupling of the other dofs with the primal ones */
  LatinCoupling   *rc;
  LatinHomogenised stiffness;
  LatinPhi        *Phi;           /* [subdomains] */
  PetscReal       *some;          /* work: the rows of one Phi that are some */
  PetscBool       *keeps;         /* [batches] does the factor keep the primal rows to the last? */
  PetscReal      **inverse;       /* [batches] displacements for unit forces with the coarse ones held, dense; NULL: from the solver */
  PetscReal       *g;             /* [copies * bs] forces of a linear stage, work space after it */
  PetscReal       *U;             /* [copies * bs] displacements, the sum of those of all linear stages */
  PetscReal       *pull;          /* [sides] forces of the search direction, D times the micro part of U */
  PetscReal       *load;          /* [copies * bs] F, shared among the copies of a node */
  PetscReal       *alone;         /* [unassigned_count] displacements of what is in no subdomain, for the loads */
  PetscReal       *spring;        /* [copies * bs] springs of the search direction, part of K */
  PetscReal       *lambda;        /* work: macro forces of one subdomain */
  PetscReal       *tile;          /* work: displacements and forces of LATIN_LANES equal subdomains, see stages/locallinks.c */
  PetscReal       *work;          /* work: two blocks of vectors on an interface, one for each subdomain that is treated together */
  PetscReal       *outgoing;      /* [sides] work: the data that the mates receive */
  PetscReal       *tension;       /* [nonsmooth] tau_hat of the last local stage; NULL if no link is rigid */
  PetscReal       *strain;        /* [links] of links that turn, at the first part of each, in the last local stage of a static solve; NULL if none does */
  PetscReal       *rigid_tension; /* [links_local of the structure] tensions of rigid links, of the last LatinReturnTensions_Private(); NULL if there are none */
  PetscBool        corrected;     /* stages follow each other, each of which solves for what the one before has left */
  PetscBool        failed;        /* an inner solver failed since this was cleared */
  PetscInt         solves;        /* linear stages since the set-up */
  PetscReal        seconds;       /* that these have taken */
  PetscInt         applications;  /* linear stages done since the last reset of the counter */
  PetscReal        energy;        /* of the change that the last linear stage made, where all interfaces are primal */
  PetscReal        rounded;       /* square of what that stage, in single precision or with a coarse iteration that ends early, leaves to the next, in energy */
  /* of the last local stage */
  PetscReal indicator; /* distance of the two stages, relative */
  PetscReal distance;  /* the same, not divided: square root of an energy */
  PetscReal noise;     /* what rounding alone leaves of it */
} LatinLinear;
PETSC_INTERN PetscErrorCode LatinLinearSetUp(LatinLinear *);
PETSC_INTERN PetscErrorCode LatinHomogeniseSetUp(LatinLinear *);
PETSC_INTERN PetscBool      LatinHomogeniseInverts(const LatinLinear *, PetscInt which);
PETSC_INTERN PetscErrorCode LatinLinearSetLoads(LatinLinear *, Vec load);
PETSC_INTERN PetscErrorCode LatinLinearApply(LatinLinear *, PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinLinearExpand(LatinLinear *, PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinLinearReset(LatinLinear *);

/* ---- the same where all interfaces are primal (stages/substructures.c) ---- */
PETSC_INTERN PetscErrorCode LatinSubstructuresAre(const LatinLinear *, PetscBool *);
PETSC_INTERN PetscErrorCode LatinSubstructuresFactor(const LatinLinear *, PetscInt batch, Mat *);
PETSC_INTERN LatinSpending  LatinSubstructuresSpending(LatinLinear *);
PETSC_INTERN PetscErrorCode LatinSubstructuresStiffness(LatinLinear *);
PETSC_INTERN PetscErrorCode LatinSubstructuresStiffnessAgain(LatinLinear *, PetscInt s, PetscReal H[]);
PETSC_INTERN PetscErrorCode LatinSubstructuresFill(LatinLinear *);
PETSC_INTERN PetscErrorCode LatinSubstructuresLeft(LatinLinear *, PetscReal *left);
PETSC_INTERN PetscErrorCode LatinSubstructuresForward(LatinLinear *);
PETSC_INTERN PetscErrorCode LatinSubstructuresBackward(LatinLinear *, PetscReal U[]);

/* ---- local stage (stages/local.c, stages/locallinks.c, stages/localcontacts.c, stages/localturning.c) ---- */
PETSC_INTERN PetscErrorCode LatinGatherForces_Private(LatinLinear *, const PetscReal z[]);
PETSC_INTERN PetscErrorCode LatinLocalStage_Private(LatinLinear *, const PetscReal z[], PetscReal Gz[]);
PETSC_INTERN PetscErrorCode LatinPullFaces_Private(LatinLinear *);
PETSC_INTERN void           LatinLinkStageGeneral(const LatinLinear *, const PetscReal state[], PetscReal next[], PetscReal sum[3]);
PETSC_INTERN void           LatinTurningStage(const LatinLinear *, const PetscReal state[], PetscReal next[], PetscReal sum[3]);
PETSC_INTERN void           LatinTurningState(const LatinLinear *, PetscReal state[]);
PETSC_INTERN void           LatinSweepForces(const LatinLinear *, const PetscReal z[]);
PETSC_INTERN void           LatinSweepStage(const LatinLinear *, const PetscReal z[], PetscReal next[], PetscReal sum[3]);

/* ---- fixed-point map (stages/fixedpointmap.c): z = (sides, nonsmooth links); leaves U and the indicator behind ---- */
PETSC_INTERN PetscErrorCode LatinCreateState_Private(const LatinLinear *, Vec *);
PETSC_INTERN PetscErrorCode LatinInitialState_Private(LatinLinear *, Vec);
PETSC_INTERN PetscErrorCode LatinApply_Private(LatinLinear *, Vec z, Vec Gz);
PETSC_INTERN PetscErrorCode LatinErrors_Private(const LatinLinear *, const PetscReal reference[], PetscReal *l2, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinAverage_Private(LatinLinear *, Vec u);
PETSC_INTERN PetscErrorCode LatinReturnTensions_Private(LatinLinear *);

#endif
