/* Error of displacements: estimates, bounds, proofs of equilibrium or of none. */
#ifndef LATINERROR_H
#define LATINERROR_H

#include "core/latinimpl.h"

/*
   Relative rounding error of a displacement field, in the l2 and in the energy norm.

     ends:   energy of links whose ends move alone, sum of k (n u)^2
     stored: energy of the links

   The rounding of nodal forces is random: eps times the tensions that links would have if each end moved alone. The error of the displacements that
   it causes grows with the square root of ends / stored, the effective condition number of this field. Measured: eps times 0.3 to 4 times the root on
   grids of 12 to 200 modules and on lattices.
*/
static inline PetscReal LatinRounding(PetscReal ends, PetscReal stored)
{
  return PETSC_MACHINE_EPSILON * (1e3 + (stored > 0.0 ? 8.0 * PetscSqrtReal(ends / stored) : 0.0));
}

/* ---- estimated error of the displacements (error/estimate.c) ---- */
typedef struct {
  PetscBool  energy;   /* error in the energy norm, not in the l2 norm */
  PetscInt   count;    /* iterates of this solve */
  PetscInt   stride;   /* every stride-th iterate is stored */
  PetscInt   stored;   /* iterates stored */
  PetscInt   width;    /* numbers stored per iterate: sketches of its fields with their squared norms, noise of tensions, distance of its stages */
  PetscReal *sketch;   /* [window][width] */
  PetscReal *part;     /* [width] work array: sums of this rank */
  PetscReal  ratio[2]; /* errors of the fields relative to the distance of the stages, at the last stored iterate */
  PetscReal  tensions; /* estimated relative error of the tensions of the last iterate or of the solution; -1: unknown */
  PetscReal  strict;   /* ratio of the tolerances of displacements and tensions */
  PetscReal  value;    /* estimated relative error of the last iterate: the larger one of displacements and of tensions times `strict` */
  PetscReal  floor;    /* rounding error of the displacements */
  PetscBool  rounding; /* rounding prevents the target: the floor is above it and has been reached */
} LatinEstimate;
PETSC_INTERN PetscErrorCode LatinEstimateStart_Private(Latin, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateFloor_Private(Latin, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateUpdate_Private(Latin, PetscReal target, LatinEstimate *);

/* ---- forces and their rounding at the nodes (error/nodalbalance.c) ---- */
/* Sums over the links at a node, of all ranks; reals only: they are sent as one message */
typedef struct {
  PetscReal vertices;       /* vertices of the DM at this node, on all ranks */
  PetscReal u[3], r[3];     /* free displacements, unbalance B^t tau(u) - F */
  PetscReal load[3];        /* loads */
  PetscReal ground[3];      /* springs to the ground */
  PetscReal stiffness[3];   /* row sums of |B|^t k |B|, at least those of the tangent stiffness */
  PetscReal rounding[3];    /* rounding of the forces, over eps */
  PetscReal translation[9]; /* upper bounds of |K t_c|, t_c the translation of all free displacements; in motions */
  PetscReal tangent[3];     /* |K u| of links that certainly bear; in motions */
  PetscReal tension;        /* sum of |tau| */
  PetscReal rigid[3];       /* sum of the forces of rigid links at free components: their self-stress, which is arbitrary, cancels */
  PetscReal bearing;        /* sum of |tau| of elastic links, plus the norm of rigid[] */
  PetscReal gaps;           /* rounding of the tensions, gaps included, over eps */
  PetscReal held, hides;    /* along the displacement of the node: twice u.K u of links that bear; work of their rounding */
  PetscReal turns;          /* work of tensions with rounded directions along it, over eps */
  PetscReal slack;          /* minus the work of links whose state is uncertain, to be added to r.u */
  PetscReal closed[2];      /* number of such links strained by the displacement of the node; by its opposite */
  PetscReal resistance;     /* 1 / displacement of the node at which its links balance r */
} LatinNode;

typedef struct {
  Latin     latin;
  PetscReal gap;                           /* greatest distance by which a rigid link misses its gap */
  struct {                                 /* sums over all links; reals only: they are sent as one message */
    PetscReal energy;                      /* k e^2 */
    PetscReal work;                        /* |tau e|, e with prescribed displacements set to zero */
    PetscReal bearing_gaps, bearing_moves; /* squared gaps of rigid links that bear or miss their gap, squares of their tau / l */
  } sum;
} LatinNodalBalance;
typedef void                LatinNodeVisit(const LatinNode *, PetscInt number, void *ctx); /* number: global */
PETSC_INTERN PetscErrorCode LatinNodalBalance_Private(Latin, Vec u, Vec r, Vec more, PetscReal target, LatinNodeVisit *, void *ctx, LatinNodalBalance *);

/* ---- whether displacements are an equilibrium (error/equilibrium.c) ---- */
#define LATIN_LISTED 8 /* most nodes, or links, listed */
typedef enum {
  LATIN_EQUILIBRIUM,    /* the error shown by the unbalance is below the target */
  LATIN_NOT_YET,        /* the error shown by the unbalance is above the target */
  LATIN_BELOW_ROUNDING, /* the same, and rounding prevents a better solution */
  LATIN_UNBOUNDED,      /* no equilibrium: loads move `nodes` without bound, or the structure as a mechanism (no node) */
  LATIN_JAMMED          /* no equilibrium: no displacement satisfies the gaps of the rigid `links` together */
} LatinVerdict;

typedef struct {
  LatinVerdict verdict;
  PetscReal    error;              /* lower bound of the relative error of the displacements */
  PetscReal    blur;               /* relative error of the displacements due to rounded directions of tensions */
  PetscReal    unbalance;          /* unbalance beyond rounding, l2 norm, relative to the loads, or without loads to the tensions */
  PetscReal    left;               /* the same, a force */
  PetscReal    rounding;           /* upper bound of the rounding of the unbalance, relative to the loads */
  PetscReal    forces;             /* unbalance with rounding, relative to the forces of links and loads at nodes: relative error of the tensions */
  PetscReal    missed;             /* error by missed gaps of rigid links and by unheld nodes, relative to the l2 norm of the displacements */
  PetscBool    balanced;           /* the unbalance is rounding only */
  PetscBool    at_rest;            /* a motion at rest: rounding of the forces moves the structure by more than the target error */
  PetscBool    still;              /* nothing moves: rounding of the forces at each node moves it farther */
  PetscInt     nodes;              /* unheld nodes, on all ranks */
  PetscInt     node[LATIN_LISTED]; /* the lowest of their global numbers */
  PetscReal    distance;           /* distance by which they move until a link stops them */
  PetscBool    slides;             /* with friction: the nodes slide or fall without end, along a way that need not be the only one (snes/slides.c) */
  PetscInt     hidden;             /* unheld nodes whose loads are below the rounding of the forces there */
  PetscInt     links;              /* jammed rigid links, on all ranks */
  PetscInt     link[LATIN_LISTED];
} LatinEquilibrium;

/* Returns whether it is known why there is no equilibrium, or none was found: links that jam, or nodes that move without end */
static inline PetscBool LatinEquilibriumExplained(const LatinEquilibrium *found)
{
  return (PetscBool)(found->verdict == LATIN_JAMMED || (found->verdict == LATIN_UNBOUNDED && found->nodes && (found->slides || found->distance == INFINITY)));
}

PETSC_INTERN PetscErrorCode LatinEquilibriumPoint_Private(LatinStructure, PetscReal *least);
PETSC_INTERN PetscErrorCode LatinEquilibriumFar_Private(LatinStructure, Vec u, PetscBool *);
PETSC_INTERN PetscErrorCode LatinEquilibriumCheck_Private(Latin, Vec u, Vec r, Vec more, PetscReal target, PetscBool energy, PetscBool rests, PetscBool strict, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumMoved_Private(LatinStructure, Vec step, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumMechanism_Private(LatinStructure, Vec step, Vec r, Vec more, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinList_Private(MPI_Comm, PetscInt count, PetscInt mine[], PetscInt *total, PetscInt list[]);
PETSC_INTERN PetscErrorCode LatinStructureSize_Private(LatinStructure, PetscReal *size, PetscReal *prescribed);
/* error/jammed.c */
PETSC_INTERN PetscErrorCode LatinEquilibriumFarkas_Private(LatinStructure, Vec u, PetscBool stays, PetscReal dtau[], LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumHeld_Private(LatinStructure, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumJammed_Private(Latin, Vec z, Vec work, LatinEquilibrium *);

/* ---- proofs that there is no equilibrium (error/loosenodes.c, error/loosepatches.c, error/collapse.c) ---- */
#define LATIN_COLLAPSE_TENSION LatinByPrecision(1e10, 1e4)  /* tensions of an equilibrium that rounding would destroy, relative to those of bars */
#define LATIN_COLLAPSE_HELD    LatinByPrecision(1e-7, 1e-4) /* elongations of d that count as zero, relative to those of bars */

/*
   Whether a proof of no equilibrium is possible. Not in time steps, which always have a solution, nor for contacts with friction, which have no
   energy (see LatinConesCreate_Private()), nor for turning links, as proofs are for directions as drawn
*/
static inline PetscBool LatinCollapseMay(const LatinStructure structure)
{
  return (PetscBool) !(structure->ground || structure->has_friction || structure->span);
}

/*
   Whether d proves that loads have no equilibrium.

     push:          work of the loads F.d, loads scaled to tensions of norm 1 if all links are bars
     resisted, all: squared elongations that links resist, and all
     beside:        largest load of the structure, in the same scale, whose tensions may pass through the same links
*/
static inline PetscBool LatinCollapseProves(PetscReal push, PetscReal beside, PetscReal resisted, PetscReal all)
{
  return (PetscBool)(push > LATIN_COLLAPSE_HELD * PetscSqrtReal(all) && push > LATIN_COLLAPSE_TENSION * PetscMax(1.0, beside) * PetscSqrtReal(resisted));
}

/* Elongations that a link resists: none, lengthening, shortening (unilateral), both (bilateral) */
enum { LATIN_WAY_NONE, LATIN_WAY_TRACTION, LATIN_WAY_COMPRESSION, LATIN_WAY_BOTH };

/*
   Computes the bounds of the tension of link l at any elongation: -infinity or infinity where it resists, else its yield tension. Parts across a
   strut, bars with negative stiffness in geometry prestress, count as resisting: they may balance any force
*/
static inline void LatinLinkBounds(const LatinStructure structure, PetscInt l, PetscReal bound[2])
{
  const LatinLaw *law = &LatinLaws[structure->law[l]];

  for (PetscInt side = 0; side < 2; side++) {
    const PetscReal far = side ? LATIN_FAR : -LATIN_FAR;

    if (law->rigid) bound[side] = far * LatinLawSign(structure->law[l]) > 0.0 ? far * INFINITY : 0.0;
    else bound[side] = law->tangent(structure->stiffness[l], far, law->ctx) != 0.0 ? far * INFINITY : law->tension(structure->stiffness[l], far, law->ctx);
  }
}

/* Returns the LATIN_WAY_ in which link l resists large elongations. *bears: it has a constant tension there, as a link that yields */
static inline PetscInt LatinLinkWay(const LatinStructure structure, PetscInt l, PetscBool *bears)
{
  PetscInt  way = LATIN_WAY_NONE;
  PetscReal bound[2];

  *bears = PETSC_FALSE;
  LatinLinkBounds(structure, l, bound);
  for (PetscInt side = 0; side < 2; side++) {
    if (PetscIsInfReal(bound[side])) way |= side ? LATIN_WAY_TRACTION : LATIN_WAY_COMPRESSION;
    else if (bound[side] != 0.0) *bears = PETSC_TRUE;
  }
  return way;
}

/* ---- interior-point method for tensions between bounds (error/primaldual.c) ---- */
/* Bound on the tension of a link: the lower one, side 0, or the upper one */
typedef struct {
  PetscReal bound; /* infinite if the link resists */
  PetscReal y, s;  /* distance of the tension from the bound; elongation at the bound. One of both vanishes */
  PetscReal ds, rhs;
} LatinBound;

#define LATIN_SLIP_SHORT 0.1 /* steps shorter than this are short: the path turns back, or the point is at a boundary */

/* Contact with friction: S, its steps, and its tangent stiffness (error/slip.c) */
typedef struct {
  PetscInt  link;          /* number of its normal part */
  PetscReal bound, dbound; /* friction bound X_0, which follows mu y */
  PetscReal S[3], dS[3];   /* rate of slip or opening, minus the tangential elongations */
  PetscReal rhs;           /* right-hand side of X.S */
  PetscReal inverse[4], tangent[9];
} LatinSlip;

typedef struct {
  LatinStructure structure;
  KSP            ksp;
  Mat            A;              /* B^t (R + W) B; with friction assembled, and not symmetric */
  Vec            f, d;           /* loads; displacements */
  Vec            r, dd;          /* unbalance; step of d */
  PetscInt       n;              /* links of this rank */
  PetscReal      count;          /* finite bounds and contacts that may slip, on all ranks */
  PetscReal      scale;          /* factor on the loads */
  PetscReal      reference;      /* R */
  PetscReal      regularisation; /* initial compliance of links that resist, besides c */
  PetscReal      softest;        /* bound on it after failed solves */
  PetscReal      floor;          /* least W in A */
  PetscReal      unbalance;      /* unbalance relative to the initial one */
  PetscReal      length;         /* length of the last step */
  PetscReal      mean;           /* mean complementarity product of a bound or a contact */
  PetscReal      least;          /* least mean product that steps aim at */
  PetscReal      inside[2];      /* mean sizes of tensions y and elongations s of unilateral links at the initial point */
  PetscBool      singular;       /* A could not be factored */
  PetscInt       stages;
  PetscReal      follow;  /* part by which friction bounds follow mu y in a step, 1: at once (snes/coulomb.c) */
  PetscReal     *x, *dx;  /* [n] elongations, their steps */
  PetscReal     *t, *dt;  /* [n] tensions */
  PetscReal     *w, *rhs; /* [n] weights of links; work */
  PetscReal     *give;    /* [n] c */
  LatinBound (*side)[2];  /* [n] */
  PetscInt   slips;       /* contacts with friction of this rank */
  LatinSlip *slip;        /* [slips] */
} LatinPrimalDual;

/* Whether link l follows a table or a law of the user, linearised in each step. With friction only; else yield tensions are bounds */
static inline PetscBool LatinPrimalDualFollows(const LatinPrimalDual *c, PetscInt l)
{
  return (PetscBool)(c->structure->has_friction && c->structure->law[l] > LATIN_LAW_TANGENT);
}

static inline PetscReal LatinBoundSign(PetscInt side)
{
  return side ? -1.0 : 1.0;
}

/* Whether link l is the normal part of a contact that may slip */
static inline PetscBool LatinSlipMay(const LatinPrimalDual *c, PetscInt l)
{
  return (PetscBool)(c->structure->law[l] == LATIN_LAW_FRICTION && c->structure->friction[l] > 0.0 && c->structure->dim > 1);
}

/* Returns the bound on a side of link l. NULL: none there, or the tension is constant */
static inline LatinBound *LatinBoundAt(const LatinPrimalDual *c, PetscInt l, PetscInt side)
{
  return PetscIsInfReal(c->side[l][side].bound) || c->side[l][0].bound == c->side[l][1].bound ? NULL : &c->side[l][side];
}

PETSC_INTERN PetscErrorCode LatinPrimalDualCreate_Private(LatinPrimalDual *, Vec more);
PETSC_INTERN PetscErrorCode LatinPrimalDualDestroy_Private(LatinPrimalDual *);
PETSC_INTERN PetscErrorCode LatinPrimalDualSolve_Private(LatinPrimalDual *, Vec b, PetscBool *failed);
PETSC_INTERN PetscErrorCode LatinPrimalDualOperator_Private(LatinPrimalDual *, PetscBool slips);
PETSC_INTERN PetscErrorCode LatinPrimalDualElongations_Private(LatinPrimalDual *);
PETSC_INTERN PetscErrorCode LatinPrimalDualMean_Private(const LatinPrimalDual *, PetscReal length, PetscReal *mean);
PETSC_INTERN PetscErrorCode LatinPrimalDualIterate_Private(LatinPrimalDual *, PetscBool *failed);
PETSC_INTERN PetscErrorCode LatinSlipsCreate_Private(LatinPrimalDual *);
PETSC_INTERN void           LatinSlipsStart(LatinPrimalDual *);
PETSC_INTERN void           LatinSlipsWeights(LatinPrimalDual *);
PETSC_INTERN void           LatinSlipsBegin(LatinPrimalDual *, PetscBool corrects, PetscReal mean, PetscReal step[]);
PETSC_INTERN void           LatinSlipsEnd(LatinPrimalDual *);
PETSC_INTERN void           LatinSlipsLength(const LatinPrimalDual *, PetscReal *length);
PETSC_INTERN PetscReal      LatinSlipsProducts(const LatinPrimalDual *, PetscReal length);
PETSC_INTERN PetscReal      LatinSlipsLag(const LatinPrimalDual *);
PETSC_INTERN void           LatinSlipsMove(LatinPrimalDual *);
PETSC_INTERN PetscErrorCode LatinSlipsAdd_Private(const LatinPrimalDual *, Mat);

/* Active-set method of error/cone.c: n unknowns, a basis of links */
enum { LATIN_CONE_SLACK, LATIN_CONE_BASIS, LATIN_CONE_SPANNED };

typedef struct {
  PetscInt   n, basis;     /* unknowns; links in the basis */
  PetscReal *row;          /* [links][n] */
  PetscReal *q, *part;     /* [n][n] QR factors of the rows of the basis: orthonormal vectors, coefficients */
  PetscReal *r;            /* [n] residual of the load */
  PetscReal *along;        /* [n] components of the load along q */
  PetscReal *t, *next;     /* [n] tensions of the basis: feasible, least-squares */
  PetscInt  *link, *state; /* [n] links in the basis; [links] LATIN_CONE_ state */
} LatinCone;
PETSC_INTERN void      LatinConeProject(LatinCone *, PetscInt n, PetscInt links, PetscInt both, const PetscReal f[], PetscBool *bears);
PETSC_INTERN PetscBool LatinConeProves(LatinCone *, PetscInt links, PetscInt both, const PetscReal f[], PetscReal largest, PetscReal A[]);

PETSC_INTERN PetscErrorCode LatinEquilibriumCollapse_Private(LatinStructure, KSP, Mat, Vec more, PetscInt most, PetscReal bears[], PetscInt *steps, PetscInt *stages, PetscBool *held, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumNodes_Private(LatinStructure, Vec more, Vec u, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumPatches_Private(LatinStructure, Vec more, LatinEquilibrium *);

/* Raises the estimate to the error shown by the unbalance: the estimate compares iterates and misses the error of a state that creeps */
static inline void LatinEstimateLearn(const LatinEquilibrium *found, PetscReal target, LatinEstimate *estimate)
{
  if (found->error <= target) return;
  estimate->value    = PetscMax(estimate->value, found->error);
  estimate->rounding = (PetscBool)(found->verdict == LATIN_BELOW_ROUNDING);
  if (estimate->rounding) estimate->floor = estimate->value;
}

#endif
