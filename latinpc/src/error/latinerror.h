/*
   What is known of the error of displacements: estimates, bounds, and whether they are an equilibrium. Floor 9: above the
   core, below the solvers that ask for it.
*/
#ifndef LATINERROR_H
#define LATINERROR_H

#include "core/latinimpl.h"

/*
   What rounding leaves of a displacement field, relative, in the l2 and in the energy norm. Forces of nodes are wrong by
   eps times what the links would bear if each end moved alone, at random; the field that they cause grows with the root
   of the ratio of what the links would then store, sum of k (n u)^2, to what they store: the condition number that this
   field sees. Measured: eps times 0.3 to 4 times the root on grids of 12 to 200 modules and on lattices.
*/
static inline PetscReal LatinRounding(PetscReal ends, PetscReal stored)
{
  return PETSC_MACHINE_EPSILON * (1e3 + (stored > 0.0 ? 8.0 * PetscSqrtReal(ends / stored) : 0.0));
}

/* ---- estimated error of the displacements (error/estimate.c) ---- */
typedef struct {
  PetscBool  energy;   /* of the energy norm, not of the l2 norm */
  PetscInt   count;    /* iterates seen in this solve */
  PetscInt   stride;   /* every so many of them is kept */
  PetscInt   stored;   /* those kept */
  PetscInt   width;    /* numbers kept of each: projections of its fields and their squared norms, distance of its stages */
  PetscReal *sketch;   /* [window][width] */
  PetscReal *part;     /* [width] work: what this rank adds */
  PetscReal  ratio[2]; /* of the errors of the fields to the distance of the stages, at the last iterate kept */
  PetscReal  tensions; /* estimated error of the tensions, relative, of the last iterate or of the solution; -1: not known */
  PetscReal  strict;   /* times the error asked for of the tensions, that of the displacements */
  PetscReal  value;    /* relative, of the last iterate: the larger one of displacements and tensions of rigid links */
  PetscReal  floor;    /* what rounding leaves of it */
  PetscBool  rounding; /* the floor has been reached, above the target */
} LatinEstimate;
PETSC_INTERN PetscErrorCode LatinEstimateStart_Private(Latin, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateFloor_Private(Latin, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateUpdate_Private(Latin, PetscReal target, LatinEstimate *);

/* ---- forces and their rounding at the nodes (error/nodalbalance.c) ---- */
/* Sums over the links that meet at a node, of all ranks; reals only, since they travel as one message */
typedef struct {
  PetscReal vertices;       /* of the DM that the node is on its ranks */
  PetscReal u[3], r[3];     /* free displacements, and the forces that they leave without balance */
  PetscReal load[3];        /* loads */
  PetscReal ground[3];      /* springs to the ground */
  PetscReal stiffness[3];   /* row sums of |B|^t k |B|, at least those of the tangent stiffness */
  PetscReal rounding[3];    /* times eps: of the forces */
  PetscReal translation[9]; /* |K t_c| for the translation t_c of all free displacements, at most; in motions */
  PetscReal tangent[3];     /* |K u|, of links that certainly bear; in motions */
  PetscReal tension;        /* sum of |tau| */
  PetscReal rigid[3];       /* sum of the forces of rigid links, whose self-stress loads nothing and may be any */
  PetscReal bearing;        /* its size, and |tau| of elastic links */
  PetscReal gaps;           /* times eps: rounding of the tensions, gaps included */
  PetscReal held, hides;    /* along its displacement: twice the work of links that bear, and that of their rounding */
  PetscReal turns;          /* times eps: the part of it that rounded directions of tensions make */
  PetscReal slack;          /* the work to be taken off r.u: of the tensions of links that may bear or not */
  PetscReal closed[2];      /* such links which its displacement, and the way back, would strain */
  PetscReal resistance;     /* 1 / displacement of the node at which its links hold the force without balance */
} LatinNode;

typedef struct {
  Latin     latin;
  PetscReal gap;                           /* greatest distance by which a rigid link misses its gap */
  struct {                                 /* over all links; reals only, since they travel as one message */
    PetscReal energy;                      /* of k e^2 */
    PetscReal work;                        /* of |tau e|, prescribed displacements taken for zero */
    PetscReal bearing_gaps, bearing_moves; /* squares of the gaps of rigid links that bear, or should, and of their tau / l */
  } sum;
} LatinNodalBalance;
typedef void                LatinNodeVisit(const LatinNode *, PetscInt number, void *ctx); /* number: global */
PETSC_INTERN PetscErrorCode LatinNodalBalance_Private(Latin, Vec u, Vec r, Vec more, PetscReal target, LatinNodeVisit *, void *ctx, LatinNodalBalance *);

/* ---- are displacements an equilibrium? (error/equilibrium.c) ---- */
#define LATIN_LISTED 8 /* nodes, or links, that are named */
typedef enum {
  LATIN_EQUILIBRIUM,    /* as far as forces show */
  LATIN_NOT_YET,        /* forces show an error above the target */
  LATIN_BELOW_ROUNDING, /* the same, and rounding hides the way to the target */
  LATIN_UNBOUNDED,      /* no equilibrium: loads move `nodes` without end, or it moves away as a mechanism (no node) */
  LATIN_JAMMED          /* no equilibrium: no displacement meets the gaps of the rigid `links` together */
} LatinVerdict;

typedef struct {
  LatinVerdict verdict;
  PetscReal    error;              /* the displacements are wrong by this at least, relative */
  PetscReal    blur;               /* of the displacements: what rounded directions of tensions move nodes along theirs */
  PetscReal    unbalance;          /* forces without balance beyond rounding, l2 norm, relative to the loads; where there are none, to the tensions */
  PetscReal    left;               /* the same as a force */
  PetscReal    rounding;           /* forces that rounding hides, relative to the loads */
  PetscReal    forces;             /* all forces without balance, relative to those of links and loads at the nodes: tensions are wrong by so much */
  PetscReal    missed;             /* by how much rigid links miss their gaps, relative to the l2 norm of the displacements */
  PetscBool    balanced;           /* but for rounding, nothing is without balance */
  PetscBool    still;              /* a step of a motion has come to rest: rounding of the forces moves more than the error asked for */
  PetscInt     nodes;              /* that nothing holds, on all ranks */
  PetscInt     node[LATIN_LISTED]; /* some of them, global numbers */
  PetscReal    distance;           /* that they move until a link holds them, a length */
  PetscInt     hidden;             /* nodes whose loads are less than the rounding of the forces there */
  PetscInt     links;              /* rigid links that are jammed, on all ranks */
  PetscInt     link[LATIN_LISTED];
} LatinEquilibrium;
PETSC_INTERN PetscErrorCode LatinEquilibriumPoint_Private(LatinStructure, PetscReal *least);
PETSC_INTERN PetscErrorCode LatinEquilibriumFar_Private(LatinStructure, Vec u, PetscBool *);
PETSC_INTERN PetscErrorCode LatinEquilibriumCheck_Private(Latin, Vec u, Vec r, Vec more, PetscReal target, PetscBool energy, PetscBool rests, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumMoved_Private(LatinStructure, Vec step, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumMechanism_Private(LatinStructure, Vec step, Vec r, Vec more, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumFarkas_Private(LatinStructure, Vec u, PetscBool claims, PetscBool stays, PetscReal dtau[], LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumJammed_Private(Latin, Vec z, Vec work, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinStructureSize_Private(LatinStructure, PetscReal *size, PetscReal *prescribed);

/* ---- is there none? (error/loosenodes.c, error/loosepatches.c, error/collapse.c) ---- */
#define LATIN_COLLAPSE_TENSION LatinByPrecision(1e10, 1e4)  /* times the tensions of bars: no equilibrium that rounding leaves anything of has so large ones */
#define LATIN_COLLAPSE_HELD    LatinByPrecision(1e-7, 1e-4) /* of the displacements of bars: what is left of d beside them is none */

/*
   Do loads whose tensions have the norm 1 where all links are bars prove by the push F.d that they have no equilibrium? Squares of the elongations that links
   resist, and of all; beside: the largest load of the structure, since what it causes passes through links that other loads are nothing for
*/
static inline PetscBool LatinCollapseProves(PetscReal push, PetscReal beside, PetscReal resisted, PetscReal all)
{
  return (PetscBool)(push > LATIN_COLLAPSE_HELD * PetscSqrtReal(all) && push > LATIN_COLLAPSE_TENSION * PetscMax(1.0, beside) * PetscSqrtReal(resisted));
}

/* A link resists in traction, in compression, both ways, or not at all */
enum { LATIN_WAY_NONE, LATIN_WAY_TRACTION, LATIN_WAY_COMPRESSION, LATIN_WAY_BOTH };

/* Which way does a link resist far out? *bears: it has a force where it does not resist, as one that yields */
static inline PetscInt LatinLinkWay(const LatinStructure structure, PetscInt l, PetscBool *bears)
{
  const LatinLaw *law = &LatinLaws[structure->law[l]];
  PetscInt        way = LATIN_WAY_NONE;

  *bears = PETSC_FALSE;
  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt  of  = side ? LATIN_WAY_COMPRESSION : LATIN_WAY_TRACTION;
    const PetscReal far = side ? -LATIN_FAR : LATIN_FAR;

    if (law->rigid) way |= far * LatinLawSign(structure->law[l]) > 0.0 ? of : 0;
    else if (law->tangent(structure->stiffness[l], far, law->ctx) > 0.0) way |= of;
    else if (law->tension(structure->stiffness[l], far, law->ctx) != 0.0) *bears = PETSC_TRUE;
  }
  return way;
}

/* What a few links bear of a load (error/cone.c). Room for n unknowns and some links */
enum { LATIN_CONE_SLACK, LATIN_CONE_BEARS, LATIN_CONE_SPANNED };

typedef struct {
  PetscInt   n, bears;     /* unknowns; links that bear */
  PetscReal *row;          /* [links][n] */
  PetscReal *q, *part;     /* [n][n] orthonormal basis of the rows of the links that bear, and these rows in it */
  PetscReal *r;            /* [n] what is left of the load */
  PetscReal *along;        /* [n] of the load, along the basis */
  PetscReal *t, *next;     /* [n] tensions of the links that bear, and those that leave the least */
  PetscInt  *link, *state; /* [n] those that bear; [links] */
} LatinCone;
PETSC_INTERN void LatinConeProject(LatinCone *, PetscInt n, PetscInt links, PetscInt both, const PetscReal f[], PetscBool *bears);

PETSC_INTERN PetscErrorCode LatinEquilibriumCollapse_Private(LatinStructure, KSP, Mat, Vec more, PetscReal bears[], PetscInt *steps, PetscInt *stages, PetscBool *held, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumNodes_Private(LatinStructure, Vec more, Vec u, LatinEquilibrium *);
PETSC_INTERN PetscErrorCode LatinEquilibriumPatches_Private(LatinStructure, Vec more, LatinEquilibrium *);

/* An estimate compares iterates: displacements that rest while a state creeps look like those of a solution. Forces show otherwise */
static inline void LatinEstimateLearn(const LatinEquilibrium *found, PetscReal target, LatinEstimate *estimate)
{
  if (found->error <= target) return;
  estimate->value    = PetscMax(estimate->value, found->error);
  estimate->rounding = (PetscBool)(found->verdict == LATIN_BELOW_ROUNDING);
  if (estimate->rounding) estimate->floor = estimate->value;
}

#endif
