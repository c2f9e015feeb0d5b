/*
   The two stages of an iteration: linear (sections 3.2 and 5) and local (section 3.3); and the fixed-point map z -> G(z), a linear stage and then a
   local stage.
*/
#ifndef LATINSTAGES_H
#define LATINSTAGES_H

#include "coarse/latincoarse.h"
#include <math.h> /* INFINITY: that of PETSc is a large number */

/* ---- linear stage (stages/linear.c, stages/homogenise.c): operators of the subdomains and work arrays ---- */
/* Entry of K_rC, see stages/homogenise.c */
typedef struct {
  PetscInt  row, primal; /* row, relative to the first one of the subdomain; position among its primal dofs */
  PetscReal value;
} LatinCoupling;

/* Coarse basis of a subdomain: Phi of stages/homogenise.c in all its rows or, if its factor keeps the primal rows, V_m in rows of interfaces */
typedef struct {
  PetscInt   rows, *row; /* number of rows; [rows] rows of V_m, relative to the first one of the subdomain, increasing; none for Phi */
  PetscReal *a;          /* [rows] x coarse dofs (macro ones for V_m), column-major */
} LatinPhi;

typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinDirections *dir;
  const LatinMacro      *macro;
  const LatinBatches    *batches;
  LatinSpectral         *spectral; /* local low-energy fields, whose inverses the set-up takes */
  LatinCoarse           *coarse;
  LatinLocalSolvers     *solvers;
  PetscBool              substructures; /* whether all interface dofs are coarse dofs: see stages/substructures.c; no Phi */
  PetscBool              released;      /* whether the entries of the operators of substructures have been released */
  /* whether forces are nonzero, and displacements are read, at nodes of several subdomains alone; set by the caller */
  PetscBool shared;
  PetscBool precise; /* whether to condense in double precision, as the coarse problem is too soft for single */
  /* stored once for equal subdomains, indexed by subdomain */
  PetscInt        *rc_first, *rc_last; /* [subdomains] range of the entries of K_rC in rc */
  LatinCoupling   *rc;
  LatinHomogenised stiffness;
  LatinPhi        *Phi;          /* [subdomains] */
  PetscReal       *some;         /* work: a vector in the rows of a Phi with row[] */
  PetscBool       *keeps;        /* [batches] whether the factor keeps the primal rows, whose Schur complement it gives */
  PetscReal      **inverse;      /* [batches] dense inverse of the operator under zero coarse displacements; NULL: the solver is used */
  PetscReal       *g;            /* [copies * bs] right-hand side of a linear stage; free work space after it */
  PetscReal       *U;            /* [copies * bs] displacements, the sum of the increments of all linear stages */
  PetscReal       *pull;         /* [sides] forces of the search direction, D times the micro part of U */
  PetscReal       *load;         /* [copies * bs] loads F, shared equally by the copies of a node */
  PetscReal       *unassigned_u; /* [unassigned_count] displacements of the dofs in no subdomain under the loads */
  PetscReal       *spring;       /* [copies * bs] diagonal search directions, part of K_E */
  PetscReal       *lambda;       /* work: macro forces of one subdomain */
  PetscReal       *work;         /* work: two blocks of vectors on an interface, with a column for each subdomain of a run of equal ones */
  PetscReal       *outgoing;     /* [sides] work: values sent to the mates */
  PetscReal       *tension;      /* [nonsmooth] tensions tau_hat of the last local stage; NULL: no link is rigid */
  /* [links] strains of links with large rotations, at the first part of each, in the last local stage of a static solve; NULL: there are none */
  PetscReal *strain;
  /* [links_local of the structure] tensions of rigid links, set by LatinReturnTensions_Private(); NULL: no link is rigid */
  PetscReal *rigid_tension;
  PetscBool  corrected;    /* whether the next stage solves for the residual of this one, which may so be inexact */
  PetscBool  failed;       /* whether an inner solver has failed since this was cleared */
  PetscInt   solves;       /* number of linear stages since the set-up */
  PetscReal  seconds;      /* their time in seconds */
  PetscInt   applications; /* number of evaluations of G since this was reset */
  PetscReal  energy;       /* energy of the increment of the last linear stage, for factors that keep the primal rows */
  /* square of the error of that stage in the energy norm, from factors in single precision and an inexact coarse solve */
  PetscReal solve_error;
  /* measured by the last local stage */
  PetscReal indicator; /* distance of the two stages, relative to the square root of the energy of elongations under tension */
  PetscReal distance;  /* distance of the two stages, square root of an energy */
  PetscReal noise;     /* level of rounding of the distance */
} LatinLinear;
PETSC_INTERN PetscErrorCode LatinLinearSetUp(LatinLinear *);
PETSC_INTERN PetscErrorCode LatinHomogeniseSetUp(LatinLinear *);
PETSC_INTERN PetscBool      LatinHomogeniseInverts(const LatinLinear *, PetscInt which);
PETSC_INTERN PetscErrorCode LatinLinearSetLoads(LatinLinear *, Vec load);
PETSC_INTERN PetscErrorCode LatinLinearApply(LatinLinear *, PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinLinearExpand(LatinLinear *, PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinLinearReset(LatinLinear *);

/* ---- linear stage if all interfaces are primal (stages/substructures.c) ---- */
PETSC_INTERN PetscErrorCode       LatinSubstructuresFactor(const LatinLinear *, PetscInt batch, Mat *);
PETSC_INTERN LatinEntriesCallback LatinSubstructuresCallback(LatinLinear *);
PETSC_INTERN PetscErrorCode       LatinSubstructuresStiffness(LatinLinear *);
PETSC_INTERN PetscErrorCode       LatinSubstructuresStiffnessAgain(LatinLinear *, PetscInt s, PetscReal H[]);
PETSC_INTERN PetscErrorCode       LatinSubstructuresFill(LatinLinear *);
PETSC_INTERN PetscErrorCode       LatinSubstructuresContraction(LatinLinear *, PetscReal *contraction);
PETSC_INTERN PetscErrorCode       LatinSubstructuresForward(LatinLinear *, PetscInt which);
PETSC_INTERN PetscErrorCode       LatinSubstructuresBackward(LatinLinear *, PetscInt which, PetscReal U[]);
PETSC_INTERN PetscErrorCode       LatinLinearRelocalise_Private(LatinLinear *, PetscInt s, PetscBool kept);

/* ---- local stage (stages/local.c, stages/locallinks.c, stages/localcontacts.c, stages/localturning.c) ---- */
PETSC_INTERN PetscErrorCode LatinGatherForces_Private(LatinLinear *, const PetscReal z[]);
PETSC_INTERN PetscErrorCode LatinLocalStage_Private(LatinLinear *, const PetscReal z[], PetscReal Gz[]);
PETSC_INTERN PetscErrorCode LatinPullFaces_Private(LatinLinear *);
PETSC_INTERN void           LatinLinkStageGeneral(const LatinLinear *, const PetscReal state[], PetscReal next[], PetscReal sum[3]);
PETSC_INTERN void           LatinTurningStage(const LatinLinear *, const PetscReal state[], PetscReal next[], PetscReal sum[3]);
PETSC_INTERN void           LatinTurningState(const LatinLinear *, PetscReal state[]);
PETSC_INTERN void           LatinSweepForces(const LatinLinear *, const PetscReal z[]);
PETSC_INTERN void           LatinSweepStage(const LatinLinear *, const PetscReal z[], PetscReal next[], PetscReal sum[3]);

/* ---- fixed-point map (stages/fixedpointmap.c): z = (sides, nonsmooth links); updates U and the indicator ---- */
PETSC_INTERN PetscErrorCode LatinCreateState_Private(const LatinLinear *, Vec *);
PETSC_INTERN PetscErrorCode LatinInitialState_Private(LatinLinear *, Vec);
PETSC_INTERN PetscErrorCode LatinApply_Private(LatinLinear *, Vec z, Vec Gz);
PETSC_INTERN PetscErrorCode LatinErrors_Private(const LatinLinear *, const PetscReal reference[], PetscReal *l2, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinAverage_Private(LatinLinear *, Vec u);
PETSC_INTERN PetscErrorCode LatinReturnTensions_Private(LatinLinear *);

#endif
