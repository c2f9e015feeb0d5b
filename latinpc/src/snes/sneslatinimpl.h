/*
   SNES latin: the solver around the fixed-point map of core/latin.c: its iteration, stops and Newton's method.
*/
#ifndef SNESLATINIMPL_H
#define SNESLATINIMPL_H

#include "error/latinerror.h"
#include <petsc/private/snesimpl.h>

/* ---- what happens next in a solve (snes/convergence.c, snes/sneslatin.c) ---- */
typedef enum {
  LATIN_NEXT_CONTINUE,
  LATIN_NEXT_CONVERGED,           /* the measure of the stop has reached its target, or all change is rounding */
  LATIN_NEXT_CONVERGED_FNORM,     /* the unbalance has, relative to the initial one */
  LATIN_NEXT_CONVERGED_FNORM_ABS, /* the unbalance has, in absolute terms */
  LATIN_NEXT_NEWTON_FINISH,       /* Newton's method near the solution */
  LATIN_NEXT_NEWTON_STALL,        /* Newton's method, on a stall */
  LATIN_NEXT_REBUILD,             /* the iteration with other search parameters and new operators */
  LATIN_NEXT_ROUNDING,            /* end: rounding prevents the requested accuracy */
  LATIN_NEXT_DIVERGED,            /* end: no equilibrium, or divergence */
  LATIN_NEXT_LINE_SEARCH,         /* end: the line search of Newton's method stagnates */
  LATIN_NEXT_MAX_IT,              /* end: too many linear stages */
  LATIN_NEXT_FAILED,              /* end: a local or coarse solver failed */
  LATIN_NEXT_NOT_FINITE,          /* end: infinite or NaN */
  LATIN_NEXT_GIVEN                /* end: reason of the user's test or of the inner SNES */
} LatinNext;
/* What follows a linear stage, from the measure of the stop and its target */
typedef PetscErrorCode (*LatinDecide)(SNES, PetscReal measure, PetscReal target, LatinNext *);

static inline PetscBool LatinNextConverged(LatinNext next)
{
  return (PetscBool)(next >= LATIN_NEXT_CONVERGED && next <= LATIN_NEXT_CONVERGED_FNORM_ABS);
}

/* ---- Newton's method after the iteration (snes/newton.c) ---- */
#define LATIN_JAM_LEAST       100  /* least -snes_max_it for the search for jammed links and lost digits: fewer stages, of a nonlinear preconditioner, show neither */
#define LATIN_COLLAPSE_WINDOW 20   /* linear stages between two tests for a collapse of contacts with friction */
#define LATIN_COLLAPSE_GROWS  4.0  /* times the displacements that were first larger than the structure */
#define LATIN_NEWTON_FAR      1e-7 /* largest unbalance, relative to the loads, or without any to the tensions as drawn, of displacements larger than the structure */

typedef struct {
  LatinNewtonType type;
  /* when it takes over in this solve */
  PetscBool finish, stall; /* near the solution; on a stall */
  PetscBool grains;        /* rigid links alone, with friction (snes/grains.c) */
  PetscBool contrast;      /* large contrast of stiffnesses: convergence of the iteration needs a proof */
  PetscInt  iterations;    /* linear stages of the iteration in this solve */
  PetscInt  most;          /* most linear stages predicted: with more, the iteration stalls */
  PetscInt  last;          /* most linear stages of this solve */
  PetscReal least[3];      /* least measure of this window of stages and of the last two */
  /* the method */
  SNES             snes;              /* NULL before the first time */
  PetscBool        tangent;           /* preconditioner built from the tangent stiffness, not from the operators of the iteration */
  Latin            latin;             /* borrowed */
  LatinStructure   structure;         /* borrowed: another one needs another SNES */
  Vec              reference;         /* borrowed: reference solution of the stop, or NULL */
  PetscReal        target, residual;  /* relative error of the displacements, norm of the residual to stop at */
  PetscReal        tension_target;    /* relative error of the tensions to stop at */
  PetscReal        balance, loads;    /* largest residual norm with that error; norm of the loads */
  PetscReal        drive;             /* the same, or without loads of the tensions as drawn */
  PetscBool        energy;            /* error in the energy norm, else l2 */
  PetscReal        size;              /* l2 norm of the displacements */
  PetscReal        rtol;              /* rtol of a linear solve while links change */
  PetscReal        first, left;       /* of a linear solve: initial residual norm, relative residual */
  PetscReal        floor;             /* least tangent stiffness of a link */
  PetscInt         small;             /* steps in a row that are below the requested error and do not grow */
  PetscReal        slope;             /* slope of the energy along the last step at its end, relative to that at its start */
  PetscBool        proves;            /* convergence needs an a posteriori error (snes/correction.c) below the target */
  PetscReal        safety;            /* safety factor on the relative residual: ratio of a posteriori errors to the target */
  PetscReal        gap;               /* sum of squared gap errors of rigid links with tension */
  PetscReal        tensions;          /* estimated error of the tensions, relative; -1: not estimated */
  PetscReal        error;             /* estimated or measured error of the last step */
  PetscReal        known;             /* bound on the relative error of the displacements before a step; 0: not known */
  PetscBool        linear;            /* no link can become slack */
  PetscBool        own_laws;          /* tables or laws of the user, in statics without friction: they may yield */
  PetscInt         changes;           /* links that the last step has changed */
  PetscInt         steps, stages;     /* of this solve: Newton steps, linear stages */
  PetscInt         limit;             /* most linear stages of Newton's method */
  PetscInt         stages_left;       /* of these */
  PetscBool        collapse_searched; /* the search for a collapse has been done in this solve */
  PetscBool        held;              /* it has shown that the loads are borne */
  PetscBool        near;              /* the initial guess is next to the solution: full steps may leave it. With rigid links three of 190 packings and nets are lost by a search at once */
  LatinEquilibrium found;             /* its verdict; without an equilibrium the nodes that move */
  /* rigid links as springs (snes/multipliers.c), NULL before the first time: [links_local of the structure] */
  PetscReal *penalty, *multiplier, *tension;
} LatinNewton;
#define LATIN_NEWTON_RTOL   1e-2                         /* rtol of a linear solve while the active set changes */
#define LATIN_NEWTON_FULL   12                           /* full steps before the line search: if they converge, they do so soon */
#define LATIN_NEWTON_LINEAR 500                          /* most iterations of a linear solve; with a quarter two cases of the catalogue are refused */
#define LATIN_NEWTON_TIGHT  LatinByPrecision(1e-9, 1e-5) /* rtol if stiffnesses differ: forces of stiff links must not hide those of soft ones; less is rounding */
PETSC_INTERN PetscErrorCode LatinNewtonStart_Private(LatinNewton *, LatinStructure);
PETSC_INTERN PetscBool      LatinNewtonStalled(LatinNewton *, PetscReal measure, PetscReal target);
PETSC_INTERN PetscErrorCode LatinNewtonOwn_Private(LatinStructure, PetscBool *);
PETSC_INTERN PetscErrorCode SNESLatinInner_Private(SNES, PetscErrorCode (*)(SNESLineSearch, void *), void *, KSPType, SNES *);
PETSC_INTERN PetscErrorCode SNESLatinInnerOptions_Private(SNES, PetscBool *cg);
PETSC_INTERN PetscErrorCode LatinNewtonCreate_Private(SNES, Latin, PetscBool tangent, LatinNewton *);
PETSC_INTERN PetscErrorCode LatinNewtonSolve_Private(SNES, LatinNewton *, PetscReal known, Vec u, SNESConvergedReason *);
PETSC_INTERN PetscErrorCode LatinNewtonCorrection_Private(LatinNewton *, Vec u, Vec r, PetscReal *error, PetscReal *tensions);
PETSC_INTERN PetscErrorCode LatinConvexWeights_Private(LatinPrimalDual *, const PetscReal stiffness[], PetscReal *firm);
PETSC_INTERN PetscErrorCode LatinConvexStart_Private(LatinPrimalDual *, PetscBool *failed);
PETSC_INTERN PetscErrorCode LatinNewtonConvex_Private(LatinNewton *, Vec more, Vec u);
PETSC_INTERN PetscErrorCode LatinNewtonCollapse_Private(LatinNewton *, Vec more);
PETSC_INTERN PetscErrorCode LatinNewtonLinear_Private(KSP, PetscInt it, PetscReal rnorm, KSPConvergedReason *, void *);
PETSC_INTERN PetscErrorCode LatinNewtonConverged_Private(SNES, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *, void *);
PETSC_INTERN PetscErrorCode LatinNewtonCones_Private(Latin, LatinNewton *, Vec more, PetscReal bears[], PetscBool *held);
#define LATIN_CONVEX_GAP            LatinByPrecision(1e-12, 1e-6) /* of the interior-point methods: sum of the products s y relative to the work of tensions and loads, and without friction unbalance relative to the initial one, that are small enough */
#define LATIN_NEWTON_FLOOR_GREATEST (3.0 * LATIN_MECHANISM)       /* least tangent stiffness of a link, relative to the greatest stiffness: less is a mechanism to the factorisation */
#define LATIN_NEWTON_REST           (64.0 * PETSC_MACHINE_EPSILON) /* relative change of displacements, or of the forces of a time step, that is rounding */
PETSC_INTERN PetscErrorCode LatinStepRests_Private(LatinStructure, Vec moved, PetscReal tensions, PetscBool *);
PETSC_INTERN PetscErrorCode LatinMultipliersStart_Private(LatinNewton *);
PETSC_INTERN PetscErrorCode LatinMultipliersSolve_Private(SNES, LatinNewton *, Vec u, SNESConvergedReason *);
PETSC_INTERN PetscErrorCode LatinMultipliersEnd_Private(LatinNewton *, PetscBool solved);
PETSC_INTERN PetscErrorCode PCLatinShare_Private(PC, Latin);
PETSC_INTERN PetscErrorCode PCLatinFollow_Private(PC, Latin);
PETSC_INTERN PetscErrorCode PCLatinCorrected_Private(PC, PetscBool corrected);

/* ---- adaptive search parameter of rigid links (snes/searchparameter.c) ---- */
#define LATIN_PARAMETER_PAST 4 /* windows of linear stages over which a stall is detected */
typedef struct {
  PetscBool  alone;                           /* rigid links alone: the iteration continues from the converted state */
  PetscBool  beside;                          /* rigid links beside elastic ones: the parameter becomes the measured stiffness, and the solve restarts */
  PetscInt   again;                           /* changes beside elastic links in this solve */
  PetscInt   stages, window;                  /* linear stages with this parameter; stages of a window */
  PetscReal  least[LATIN_PARAMETER_PAST + 1]; /* least measure of this window and of the last ones */
  PetscReal  sum[2];                          /* squared changes of tensions and of elongations in this window, on this rank */
  PetscReal *tension, *stretch;               /* [nonsmooth] of the last local stage: tau_hat, l e_hat */
  PetscReal  factor;                          /* next parameter, relative to the current one */
} LatinParameter;
PETSC_INTERN PetscErrorCode LatinParameterStart_Private(Latin, LatinParameter *);
PETSC_INTERN PetscErrorCode LatinParameterObserve_Private(Latin, Vec z, Vec Gz, LatinParameter *);
PETSC_INTERN PetscErrorCode LatinParameterDue_Private(Latin, PetscReal measure, LatinParameter *, LatinNext *);
PETSC_INTERN PetscErrorCode LatinParameterRestore_Private(Latin, PetscReal tuning, PetscReal scale);
PETSC_INTERN PetscErrorCode LatinParameterLoads_Private(Latin);
PETSC_INTERN PetscErrorCode LatinParameterTune_Private(Latin, PetscReal factor);
PETSC_INTERN PetscErrorCode LatinParameterState_Private(Latin, Vec z, Vec F, PetscReal factor);

/* ---- large displacements: frame and course of a solve (snes/large.c, snes/largeiterate.c, snes/largenewton.c, snes/largepath.c) ---- */
#define LATIN_LARGE_HOLD   0.3  /* stiffness of slack cables, relative to the mean tension over length, per relative step; with 0.1 and 1 masts take more stages */
#define LATIN_LARGE_HELD   0.03 /* the same with linearised laws; with 0.01 saddles of 200 and 300 meshes take up to twice the set-ups, or seven times the stages */
#define LATIN_LARGE_SAFETY 4.0  /* safety factor on the error after a step */
#define LATIN_LARGE_NONE   1e-9 /* of the size of the structure: displacements that are none */
/* Moving supports along a load path (snes/largesupports.c) */
typedef struct {
  PetscBool  moves;                       /* supports move; else the members below are unset */
  PetscReal  part;                        /* current position on the path */
  PetscReal *given, *moved;               /* [nodes_local][dim] prescribed displacements; their change since the start of the path */
  PetscReal *vertex_given, *vertex_moved; /* [vertices][dim] the same */
} LatinSupports;
typedef struct {
  LatinStructure frame;    /* replaces the structure in the iteration (structure/frame.c); NULL: geometry linear */
  PetscBool      given;    /* a geometry is given by an option */
  LatinGeometry  geometry; /* that geometry */
  /* of this solve */
  PetscInt  renewals;       /* rebuilds of the operators at other displacements */
  PetscInt  stages, window; /* linear stages in this window; stages of a window */
  PetscReal least, before;  /* least measure of this window and of the last one */
  PetscInt  idle;           /* linear stages in a row that change little and do not halve the measure of the stop */
  PetscReal half;           /* the measure when it was last halved, */
  PetscInt  halved;         /* and the linear stage */
  PetscReal lowest;         /* this measure before them */
  PetscReal near;           /* estimated error below which Newton's method is tried */
  PetscReal cost;           /* cost of a set-up, in linear stages */
  PetscBool stateless;      /* operators of the tangent stiffness; the state does not yet correspond to the solution vector */
  PetscBool newton_failed;  /* Newton's method has failed: it is tried again only near the solution */
  PetscBool inside_failed;  /* so has the interior-point method of links that only pull or push: it is not tried again */
  /* of Newton's method */
  Vec        between[2];         /* two equilibria, NULL: none; initial strains are interpolated between theirs, since those of an interpolated guess are wrong by the rotations */
  PetscReal  part;               /* interpolation parameter between them: 0 the first, 1 the second */
  PetscReal *start;              /* [2][links_local of the structure] initial tensions and strains, or NULL: of the displacements, or interpolated */
  PetscReal *ahead;              /* [2][links_local of the structure] tensions ahead of the displacements, from linearised strains, and these strains; NULL in time steps */
  PetscReal  error;              /* estimated error after a step */
  PetscReal  force;              /* residual norm of the laws there */
  PetscReal  first_step[2];      /* first step of a run: length relative to the displacements, relative change of the tensions */
  PetscReal  iteration_error[2]; /* the same of the run from the last iterate of the iteration: the error of that iterate */
  PetscReal  first;              /* initial residual norm of a linear solve */
  PetscInt   limit;              /* most iterations of a linear solve */
  PetscInt   proofs;             /* linear stages spent on residual norms that prove the error of a step */
  PetscReal  stretch;            /* relative change of the tensions by a step */
  PetscReal  balance, loads;     /* largest residual norm with that error; norm of the loads */
  PetscReal  size, tension;      /* of the structure; norm of its tensions at the start */
  PetscInt   last;               /* number of the last linear stage for these loads */
  PetscReal  reached;            /* part of the loads of which the displacements are the equilibrium */
  PetscReal  branch;             /* part at which a stable branch begins where the structure buckles; negative: not known */
  PetscBool  sheared;            /* the path has gone on where crossed cables slacken together */
  Vec        solution;           /* end of the last path: displacements, */
  PetscReal *held;               /* and prescribed ones, [nodes_local][dim] */
  PetscInt   most;               /* most linear iterations */
  PetscInt   changed;            /* after its last step: links whose stiffness differs from that of the operators, */
  PetscInt   softer;             /* and links that this step has softened */
  PetscBool  iterated;           /* it starts from the last iterate of the iteration */
  PetscBool  slow;               /* the last run has reached its iteration limit */
  PetscBool  unstable;           /* the tangent stiffness is not positive definite */

  LatinSupports supports;
} LatinLarge;

/* ---- SNES latin ---- */
#define LATIN_STOL  1e-5 /* of the indicator, by default */
#define LATIN_ERROR 1e-4 /* estimated error to stop at, by default */
typedef struct {
  Latin             latin;
  SNES              outer;          /* solves z - G(z) = 0 */
  char              outer_type[64]; /* the SNES type whose defaults have been set */
  PetscBool         outer_rigid;    /* with the defaults of structures with rigid laws */
  Vec               z;
  LatinStopType     requested, stop; /* the requested stop; that of this solve */
  PetscBool         given;           /* -snes_stol is given */
  PetscReal         target;          /* estimated error to stop at */
  PetscBool         chosen;          /* target set by the user */
  PetscReal         tension_target;  /* the same for tensions, or PETSC_DEFAULT */
  PetscReal         balance;         /* unbalance to stop at, relative to the loads */
  PetscReal         unbalance;       /* unbalance to stop at, a force; 0: any */
  LatinEstimate     estimate;
  PetscBool         guess; /* the solution vector is the initial guess of this solve */
  LatinWarmStart    warm;
  PetscBool         has_state; /* the last solve has converged */
  Vec               z_before;  /* final state of the solve before the last one; NULL or unset without has_before */
  PetscBool         has_before;
  Vec               reference; /* reference displacements, or NULL */
  PetscReal        *reference_copy;
  PetscInt          history_size, done;
  PetscReal        *indicator, *error_l2, *error_energy, *estimates; /* [history_size] per linear stage; [done] filled */
  PetscReal         first_distance, first_residual, residual;
  PetscReal         far;     /* largest displacement when it was first larger than the structure, after Newton's method */
  PetscBool         leapt;   /* the last distance exceeded the divergence tolerance */
  PetscInt          tested;  /* number of the last linear stage tested */
  PetscInt          current; /* number of the linear stage at which the solution vector and its residual were computed, -1: never */
  LatinNext         next;
  LatinDecide       decide;
  LatinNewton       newton;
  LatinLarge        large;
  LatinEquilibrium  found; /* the last verdict on the displacements */
  LatinParameter    parameter;
  PetscViewer       monitor;
  PetscViewerFormat monitor_format;
} SNES_Latin;
/* Geometry large: does the frame have parts with rotating directions? */
static inline PetscBool SNESLatinLarge(const SNES_Latin *data)
{
  return (PetscBool)(data->large.frame && data->large.frame->part);
}
/* Most linear stages: they are iterations and evaluations of a function both */
static inline PetscInt SNESLatinStageLimit(SNES snes)
{
  return snes->max_funcs < 0 ? snes->max_its : PetscMin(snes->max_its, snes->max_funcs);
}
/* Linear stages that are left, of the iteration and of Newton's method */
static inline PetscInt SNESLatinStagesLeft(SNES snes)
{
  const SNES_Latin *data = (SNES_Latin *)snes->data;

  return SNESLatinStageLimit(snes) - data->latin->linear.applications - data->newton.stages;
}
/* The estimated error of the tensions to stop at */
static inline PetscReal SNESLatinTensionTarget(const SNES_Latin *data)
{
  return data->tension_target > 0.0 ? data->tension_target : data->target;
}
/* Does the stop need an estimate of the error? */
static inline PetscBool SNESLatinEstimates(const SNES_Latin *data)
{
  return (PetscBool)(data->stop == LATIN_STOP_ERROR || data->stop == LATIN_STOP_ENERGY);
}
/* Does Newton's method follow the iteration, where links turn? */
static inline PetscBool SNESLatinLargeProves(const SNES_Latin *data)
{
  return (PetscBool)(SNESLatinEstimates(data) && data->newton.type != LATIN_NEWTON_NEVER);
}
/* Does the solve start from the state of the last one? */
static inline PetscBool SNESLatinWarm(const SNES_Latin *data)
{
  return (PetscBool)(data->warm && data->has_state);
}
/* Has the user given a step tolerance? */
static inline PetscBool SNESLatinStolGiven(SNES snes)
{
  return (PetscBool)(((SNES_Latin *)snes->data)->given || snes->stol != LATIN_STOL);
}
/* Does convergence need balance relative to the loads? Not with PETSc's tolerances, which decide alone, and not in motions, where inertia balances loads */
static inline PetscBool SNESLatinBalances(SNES snes)
{
  const SNES_Latin *data = (SNES_Latin *)snes->data;

  return (PetscBool)(!data->latin->sub.structure->ground && (data->requested == LATIN_STOP_AUTO ? !SNESLatinStolGiven(snes) : SNESLatinEstimates(data)));
}

/* The unbalance to stop at, a force */
static inline PetscReal SNESLatinUnbalance(const SNES_Latin *data)
{
  return data->unbalance > 0.0 ? data->unbalance : PETSC_MAX_REAL;
}

/* The unbalance to stop at under loads of this l2 norm, a force */
static inline PetscReal SNESLatinBalanceForce(const SNES_Latin *data, PetscReal loads)
{
  return PetscMin(loads > 0.0 ? data->balance * loads : PETSC_MAX_REAL, SNESLatinUnbalance(data));
}

/* Is the unbalance of the last check larger than requested? */
static inline PetscBool SNESLatinUnbalanced(const SNES_Latin *data)
{
  return (PetscBool)(data->found.unbalance > data->balance || data->found.left > SNESLatinUnbalance(data));
}

/* The residual to stop at, with that stop */
static inline PetscReal SNESLatinResidualTarget(SNES snes)
{
  return PetscMax(snes->abstol, snes->rtol * ((SNES_Latin *)snes->data)->first_residual);
}

/* Is the residual larger than this, and than rounding makes it? Statics without rigid links: then the SNES has another function, which the solution of the structure leaves */
static inline PetscBool SNESLatinLeft(SNES snes, PetscReal loads)
{
  const SNES_Latin    *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;

  return (PetscBool)(data->stop == LATIN_STOP_RESIDUAL && structure->rigid_law < 0 && !structure->ground && !data->found.balanced && data->residual > PetscMax(SNESLatinResidualTarget(snes), data->found.rounding * loads));
}

#define LATIN_STEP_ERROR 10.0 /* error that the unbalance or missed gaps may show, relative to the stop on the indicator */

/* The error that the unbalance or missed gaps may show where the indicator is the stop */
static inline PetscReal SNESLatinShown(PetscReal stol)
{
  return PetscMax(LATIN_STEP_ERROR * stol, PETSC_SQRT_MACHINE_EPSILON);
}

#define LATIN_LARGE_NOWHERE 1e3 /* of the size of the structure: displacements that lead nowhere */

#define LATIN_UNBALANCE_ROUNDING LatinByPrecision(1e-2, 10.0) /* largest bound of the rounding of the unbalance, relative to the loads: 20 to 110 times what rounding makes */

/* Is the unbalance rounding, of large displacements? Then the solve ends with LATIN_NEXT_ROUNDING, and no digit of the error */
static inline PetscBool SNESLatinUnbalanceRounded(SNES snes)
{
  return (PetscBool)(SNESLatinBalances(snes) && ((SNES_Latin *)snes->data)->found.rounding > LATIN_UNBALANCE_ROUNDING);
}

/* snes/fixedpoint.c */
PETSC_INTERN PetscErrorCode SNESLatinCreateOuter_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinOuterOptions_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinOuterSetUp_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinOuterReset_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinOuterForget_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinFixedPoint_Private(SNES outer, Vec z, Vec F, void *);
PETSC_INTERN PetscErrorCode SNESLatinGuess_Private(SNES, Vec u, const PetscReal rigid[], Vec z);
PETSC_INTERN PetscErrorCode SNESLatinStart_Private(SNES);
/* snes/takeover.c */
PETSC_INTERN PetscErrorCode SNESLatinNewton_Private(SNES, PetscBool stall);
/* snes/convergence.c */
PETSC_INTERN SNESConvergedReason SNESLatinReason(LatinNext);
PETSC_INTERN PetscBool           SNESLatinUserTest(SNES);
PETSC_INTERN PetscBool           SNESLatinWatched(SNES);
PETSC_INTERN PetscErrorCode      SNESLatinGrains_Private(SNES, LatinNext *);
PETSC_INTERN PetscErrorCode      SNESLatinAdmissible_Private(SNES, LatinNext *);
PETSC_INTERN PetscErrorCode      SNESLatinCoulomb_Private(SNES, SNESConvergedReason *);
PETSC_INTERN PetscErrorCode      SNESLatinLoads_Private(SNES, PetscReal *norm);
PETSC_INTERN PetscErrorCode      SNESLatinDrive_Private(SNES, PetscReal *norm);
PETSC_INTERN PetscErrorCode      SNESLatinAtRest_Private(SNES);
PETSC_INTERN PetscErrorCode      LatinSelfStress_Private(LatinStructure, Vec more, PetscReal moved, PetscBool *rests);
PETSC_INTERN PetscErrorCode      SNESLatinBalance_Private(SNES);
PETSC_INTERN PetscErrorCode      SNESLatinResidual_Private(SNES);
PETSC_INTERN PetscErrorCode      SNESLatinCollapsed_Private(SNES, PetscBool *);
PETSC_INTERN PetscErrorCode      SNESLatinFirst_Private(SNES);
PETSC_INTERN PetscErrorCode      SNESLatinWatch_Private(SNES, PetscInt it);
PETSC_INTERN PetscErrorCode      SNESLatinDecide_Private(SNES, PetscReal measure, PetscReal target, LatinNext *);
PETSC_INTERN PetscErrorCode      SNESLatinIterate_Private(SNES, LatinDecide);
/* snes/problem.c */
PETSC_INTERN PetscErrorCode SNESLatinFrame_Private(SNES, LatinStructure, LatinStructure *);
PETSC_INTERN PetscErrorCode SNESLatinResetState_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinSetUpState_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinCopyReference_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLoad_Private(SNES);
/* snes/large.c, snes/largeiterate.c, snes/largenewton.c, snes/largepath.c */
PETSC_INTERN PetscErrorCode SNESLatinLargeStart_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargeFinish_Private(SNES, PetscBool renews, PetscBool near, PetscBool *done);
PETSC_INTERN PetscErrorCode SNESLatinLargeIterate_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargeRun_Private(SNES);
/* from displacements that are given (snes/largefrom.c) */
PETSC_INTERN PetscErrorCode SNESLatinLargeProof_Private(SNES, Vec u, PetscBool *done);
PETSC_INTERN PetscErrorCode SNESLatinLargeStep_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargeStop_Private(SNES, LatinStopType);
PETSC_INTERN PetscErrorCode SNESLatinLargeFrom_Private(SNES, Vec u, PetscBool near, PetscBool *inside);
/* displacements of nodes on a path (snes/largenodes.c) */
#define LATIN_PATH_FAR 2.0 /* times the displacements by the tangent stiffness at the start: the limit of a fold, where force is a parabola of displacement */
PETSC_INTERN PetscErrorCode LatinPathNodes_Private(LatinStructure, Vec moved, Vec other, Vec middle, PetscReal little, PetscBool *within);
PETSC_INTERN PetscErrorCode LatinPathBetween_Private(LatinStructure, Vec mean, Vec ahead, Vec back, PetscReal little, PetscBool *within);
PETSC_INTERN PetscErrorCode LatinPathLoose_Private(LatinStructure, Vec left, Vec f);
PETSC_INTERN PetscErrorCode LatinPathStruts_Private(LatinStructure, PetscBool *struts, PetscBool *floors);
PETSC_INTERN PetscErrorCode LatinPathForces_Private(Vec r); /* snes/largemode.c */
PETSC_INTERN PetscErrorCode LatinPathMode_Private(SNES, Vec u, Vec mode);
PETSC_INTERN PetscErrorCode LatinPathSlopes_Private(SNES, Vec u, PetscBool stiffer, PetscReal slope[]);                       /* snes/largekinks.c */
PETSC_INTERN PetscErrorCode SNESLatinLargeDescend_Private(SNES, PetscBool near, PetscBool *heavier, Vec u, PetscBool *rests); /* snes/largedescent.c */
/* supports that move (snes/largesupports.c) */
PETSC_INTERN PetscErrorCode SNESLatinSupportsFrom_Private(SNES, const PetscReal first[]);
PETSC_INTERN PetscErrorCode SNESLatinSupportsAt_Private(SNES, PetscReal part);
PETSC_INTERN PetscErrorCode SNESLatinSupportsLoad_Private(SNES, Vec u, Vec load);
PETSC_INTERN PetscErrorCode SNESLatinSupportsAhead_Private(SNES, Vec u, Vec rate, PetscReal more, Vec ahead);
PETSC_INTERN PetscErrorCode SNESLatinSupportsEnd_Private(SNES, PetscReal reached, PetscReal *borne);
PETSC_INTERN PetscErrorCode LatinSupportsReset_Private(LatinLarge *);
PETSC_INTERN PetscErrorCode SNESLatinLargeRigid_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargeBalance_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargeInterior_Private(SNES, PetscReal tension[], PetscBool *done);
PETSC_INTERN PetscErrorCode SNESLatinLargeConvex_Private(SNES, PetscBool leapt, PetscBool *done); /* snes/largedown.c */
PETSC_INTERN PetscErrorCode SNESLatinLargeTaut_Private(SNES, Vec u, PetscBool *taut);             /* snes/largeconvex.c */
PETSC_INTERN PetscErrorCode SNESLatinLargeRenew_Private(SNES, LatinFrameType);
PETSC_INTERN PetscErrorCode SNESLatinLargeCorrect_Private(SNES, Vec u, Vec ahead, PetscReal *norm);
PETSC_INTERN PetscErrorCode SNESLatinLargeState_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargePredict_Private(SNES, Vec u, Vec load, Vec step, PetscReal *moved);
PETSC_INTERN PetscErrorCode SNESLatinLargeTangent_Private(SNES, Vec u, KSP *);
PETSC_INTERN PetscErrorCode SNESLatinLargeClaim_Private(SNES, PetscReal, LatinNext);
PETSC_INTERN PetscErrorCode SNESLatinLargeNewton_Private(SNES, PetscBool *done);
PETSC_INTERN PetscErrorCode SNESLatinLargeRests_Private(SNES, PetscBool *rests);
/* snes/options.c */
PETSC_INTERN PetscErrorCode SNESLatinCheck_Private(SNES);
PETSC_INTERN PetscErrorCode SNESSetFromOptions_Latin(SNES, LatinOptionItems);
/* snes/results.c */
PETSC_INTERN PetscErrorCode SNESLatinRigidTensions_Private(SNES, const PetscReal *rigid[]);
PETSC_INTERN PetscErrorCode SNESView_Latin(SNES, PetscViewer);

/* ---- TS latin (ts/tslatin.c, state/) ---- */
typedef struct {
  LatinStructure step;               /* borrowed: the structure of a time step */
  Vec            w;                  /* h v+ */
  Vec            u_before, v_before; /* start of the last step, with events alone */
  PetscBool      started;            /* w is of a completed step */
  PetscBool      moved;              /* supports of this rank have moved since the start */
  PetscBool      again;              /* reset after a motion */
  PetscInt       iterations;
} TS_Latin;

#endif
