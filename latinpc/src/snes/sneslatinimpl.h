/* SNES latin: the solver around the fixed-point map G of stages/fixedpointmap.c. Iteration and stops, Newton's method, large displacements. */
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
/* Decides what follows a linear stage, from the measure of the stop and its target */
typedef PetscErrorCode (*LatinDecide)(SNES, PetscReal measure, PetscReal target, LatinNext *);

static inline PetscBool LatinNextConverged(LatinNext next)
{
  return (PetscBool)(next >= LATIN_NEXT_CONVERGED && next <= LATIN_NEXT_CONVERGED_FNORM_ABS);
}

/* Whether a solve has found an equilibrium, to the target or as far as rounding allows */
static inline PetscBool LatinNextSolved(LatinNext next)
{
  return (PetscBool)(LatinNextConverged(next) || next == LATIN_NEXT_ROUNDING);
}

/* ---- Newton's method after the iteration (snes/newton.c) ---- */
#define LATIN_JAM_LEAST       100  /* least -snes_max_it for the search for jammed links and lost digits: fewer stages show neither */
#define LATIN_COLLAPSE_WINDOW 20   /* linear stages between two tests for a collapse */
#define LATIN_NEWTON_FAR      1e-7 /* largest unbalance of displacements larger than the structure, relative to loads, or else tensions as drawn */

typedef struct {
  LatinNewtonType type;
  /* when it takes over, in this solve */
  PetscBool finish, stall; /* to finish near the solution; on a stall */
  PetscBool grains;        /* rigid links alone, with friction (snes/grains.c) */
  PetscBool contrast;      /* large contrast of stiffnesses: convergence of the iteration needs a proof */
  PetscInt  iterations;    /* linear stages of the iteration in this solve */
  PetscInt  most;          /* most linear stages predicted: with more, the iteration stalls */
  PetscInt  last;          /* most linear stages of this solve */
  PetscInt  slides;        /* linear stages after which the search for endless slides is due (snes/slides.c) */
  PetscReal least[3];      /* least measure of this window of stages and of the last two */
  /* how it runs */
  SNES           snes;              /* NULL before the first time */
  PetscBool      tangent;           /* preconditioner from the tangent stiffness, not from the operators of the iteration */
  Latin          latin;             /* borrowed */
  LatinStructure structure;         /* borrowed: another one needs another SNES */
  Vec            reference;         /* borrowed: reference solution of the stop, or NULL */
  PetscReal      target, residual;  /* where to stop: relative error of the displacements; residual norm */
  PetscReal      tension_target;    /* where to stop: relative error of the tensions */
  PetscReal      balance, loads;    /* largest residual norm with that error; norm of the loads */
  PetscReal      unbalance;         /* residual norm after the last step */
  PetscReal      drive;             /* norm of the loads, or without loads of the tensions as drawn */
  PetscBool      energy;            /* error in the energy norm, else l2 */
  PetscReal      size;              /* l2 norm of the displacements */
  PetscReal      rtol;              /* rtol of a linear solve while links change */
  PetscReal      first, left;       /* of a linear solve: initial residual norm, relative residual */
  PetscReal      floor;             /* least tangent stiffness of a link */
  PetscInt       small;             /* successive steps below the requested error that do not grow */
  PetscReal      slope;             /* slope of the energy at the end of the last step, relative to its start */
  PetscBool      proves;            /* convergence needs an a posteriori error below the target (snes/correction.c) */
  PetscReal      safety;            /* safety factor on the relative residual, from the ratio of a posteriori error and target */
  PetscReal      gap;               /* sum of squared gap errors of rigid links with tension */
  PetscReal      tensions;          /* estimated error of the tensions, relative; -1: not estimated */
  PetscReal      error;             /* estimated or measured error of the last step */
  PetscReal      known;             /* known relative error of the displacements before a step; 0: none */
  PetscBool      linear;            /* all laws are linear */
  PetscBool      own_laws;          /* tables or laws of the user, which may yield; in statics without friction */
  PetscInt       changes;           /* links that the last step has changed */
  PetscInt       steps, stages;     /* of this solve: Newton steps, linear stages */
  PetscInt       limit;             /* most linear stages of Newton's method */
  PetscInt       stages_left;       /* linear stages left of this limit */
  PetscBool      collapse_searched; /* the search for a collapse is done, in this solve */
  PetscBool      held;              /* result of this search: the structure bears the loads */
  /*
     the initial guess is the end of the interior-point method: line searches from the first step on. With rigid links full steps: searches lose 3 of
     190 packings and nets
  */
  PetscBool        near;
  LatinEquilibrium found; /* verdict of this search; without an equilibrium also the nodes that move */
  /* rigid links as springs (snes/multipliers.c), [links_local of the structure]; NULL before the first time */
  PetscReal *penalty, *multiplier, *tension;
} LatinNewton;
#define LATIN_NEWTON_RTOL   1e-2                         /* rtol of a linear solve while the active set changes */
#define LATIN_NEWTON_FULL   12                           /* full steps before the line search; if they converge, they do so soon */
#define LATIN_NEWTON_LINEAR 500                          /* most iterations of a linear solve; a quarter: two cases of the catalogue are refused */
#define LATIN_NEWTON_TIGHT  LatinByPrecision(1e-9, 1e-5) /* rtol if stiffnesses differ: forces of stiff links must not hide those of soft ones */
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
/* end of the interior-point methods: sum of the products s y relative to the work of tensions and loads; without friction also the relative unbalance */
#define LATIN_CONVEX_GAP            LatinByPrecision(1e-12, 1e-6)
#define LATIN_NEWTON_FLOOR_GREATEST (3.0 * LATIN_MECHANISM)        /* least tangent stiffness of a link, relative to the greatest; less is rounding */
#define LATIN_NEWTON_REST           (64.0 * PETSC_MACHINE_EPSILON) /* relative change of displacements, or of the forces of a time step, that is rounding */
PETSC_INTERN PetscErrorCode LatinStepRests_Private(LatinStructure, Vec moved, PetscReal tensions, PetscBool *);
PETSC_INTERN PetscErrorCode LatinMultipliersStart_Private(LatinNewton *);
PETSC_INTERN PetscErrorCode LatinMultipliersSolve_Private(SNES, LatinNewton *, Vec u, SNESConvergedReason *);
PETSC_INTERN PetscErrorCode LatinMultipliersEnd_Private(LatinNewton *, PetscBool solved);
PETSC_INTERN PetscErrorCode PCLatinShare_Private(PC, Latin);
PETSC_INTERN PetscErrorCode PCLatinFollow_Private(PC, Latin);
PETSC_INTERN PetscErrorCode PCLatinCorrected_Private(PC, PetscBool corrected);

/* ---- adaptive search parameter of rigid links (snes/searchparameter.c) ---- */
typedef struct {
  PetscBool  adapts;            /* the parameter may still change */
  PetscInt   again;             /* changes in this solve */
  PetscInt   stages;            /* linear stages with this parameter */
  PetscReal  sum[2];            /* squared changes of tensions and of elongations, on this rank */
  PetscReal *tension, *stretch; /* [nonsmooth] of the last linear stage: tau, l e */
  PetscReal  factor;            /* next parameter, relative to the current one */
} LatinParameter;
PETSC_INTERN PetscErrorCode LatinParameterStart_Private(Latin, LatinParameter *);
PETSC_INTERN PetscErrorCode LatinParameterObserve_Private(Latin, Vec z, Vec Gz, LatinParameter *);
PETSC_INTERN PetscErrorCode LatinParameterDue_Private(Latin, LatinParameter *, LatinNext *);
PETSC_INTERN PetscErrorCode LatinParameterRestore_Private(Latin, PetscReal tuning, PetscReal scale);
PETSC_INTERN PetscErrorCode LatinParameterLoads_Private(Latin);
PETSC_INTERN PetscErrorCode LatinParameterTune_Private(Latin, PetscReal factor);

/* ---- large displacements: frame and course of a solve (snes/large.c, snes/largeiterate.c, snes/largenewton.c, snes/largepath.c) ---- */
#define LATIN_LARGE_HOLD   0.3  /* stiffness of slack cables per relative step, relative to the mean tension over length; 0.1 and 1: masts take more stages */
#define LATIN_LARGE_HELD   0.03 /* the same with linearised laws; 0.01: saddles of 200 and 300 meshes take up to twice the set-ups or seven times the stages */
#define LATIN_LARGE_SAFETY 4.0  /* safety factor on the error after a step */
#define LATIN_LARGE_NONE   1e-9 /* displacements, relative to the size of the structure, that count as zero */
/* Moving supports along a load path (snes/largesupports.c) */
typedef struct {
  PetscBool  moves;                       /* supports move; else the members below are unset */
  PetscReal  part;                        /* current position on the path, 0 to 1 */
  PetscReal *given, *moved;               /* [nodes_local][dim] prescribed displacements; their change since the start of the path */
  PetscReal *vertex_given, *vertex_moved; /* [vertices][dim] the same */
} LatinSupports;
/* Progress of the iteration (snes/largeiterate.c) */
typedef struct {
  PetscInt  stages, window; /* linear stages in this window; stages of a window */
  PetscReal least, before;  /* least measure of this window and of the last one */
  PetscInt  idle;           /* successive linear stages that change little and do not halve the measure of the stop */
  PetscReal lowest;         /* the measure before the `idle` stages */
  PetscReal half;           /* the measure when it was last halved */
  PetscInt  halved;         /* linear stage of that */
} LatinLargeProgress;
/* Tensions and strains at the start of Newton's method, if not those of the displacements; two equilibria, or given ones */
typedef struct {
  Vec        between[2]; /* equilibria between which they are interpolated, or NULL; strains of an interpolated guess are wrong by the rotations */
  PetscReal  part;       /* position between them: 0 the first, 1 the second */
  PetscReal *start;      /* [2][links_local of the structure] given ones, or NULL */
} LatinLargeGuess;
/* A run of Newton's method (snes/largenewton.c) */
typedef struct {
  PetscReal tension;         /* norm of what rounding of coordinates multiplies, see LatinLargeTension_Private() */
  PetscInt  limit, most;     /* most linear iterations: of a solve; of the run */
  PetscReal first;           /* initial residual norm of a linear solve */
  PetscReal error;           /* estimated error after a step */
  PetscReal force;           /* residual norm after a step, with the laws themselves */
  PetscReal stretch;         /* relative change of the tensions by a step */
  PetscReal first_step[2];   /* first step: relative length, relative change of the tensions */
  PetscInt  changed, softer; /* links, after the last step: of other stiffness than in the operators; softened by this step */
  PetscInt  proofs;          /* linear stages spent on the norms of residuals that prove an error */
  PetscBool slow;            /* it has reached its iteration limit */
  PetscBool unstable;        /* the tangent stiffness is not positive definite */
} LatinLargeRun;
/* The path of the loads (snes/largepath.c) */
typedef struct {
  PetscReal     reached;  /* part of the loads at the present equilibrium */
  PetscReal     branch;   /* part of the loads at which a stable branch begins, by buckling; negative: unknown */
  PetscBool     sheared;  /* the path has passed a panel whose crossed cables slackened together */
  Vec           solution; /* displacements at the end of the last path */
  PetscReal    *held;     /* prescribed displacements there, [nodes_local][dim] */
  LatinSupports supports;
} LatinLargePath;
typedef struct {
  LatinStructure frame;    /* replaces the structure in the iteration (structure/frame.c); NULL: geometry linear */
  PetscBool      given;    /* the geometry is set by an option */
  LatinGeometry  geometry; /* that geometry */
  /* of this solve: the problem and its goal */
  PetscReal size;           /* size of the structure */
  PetscReal loads, balance; /* norm of the loads; largest residual norm at convergence */
  PetscInt  last;           /* number of the last linear stage allowed for these loads */
  /* operators */
  PetscReal cost;      /* cost of a set-up, in linear stages */
  PetscInt  renewals;  /* set-ups at other displacements */
  PetscBool stateless; /* they are of the tangent stiffness: the state z is not that of the solution vector */
  /* from the iteration to Newton's method */
  PetscReal  near;               /* estimated error below which it is tried */
  PetscBool  iterated;           /* it starts from the last iterate */
  PetscReal  iteration_error[2]; /* its first step from there: error of the displacements, of the tensions */
  PetscBool  newton_failed;      /* it has failed; it is tried again nearer to the solution only */
  PetscBool  inside_failed;      /* the interior-point method of links that only pull or push has failed; it is not tried again */
  PetscReal *ahead;              /* [2][links_local of the structure] tensions ahead of the displacements, and their linearised strains; NULL in time steps */

  LatinLargeProgress progress;
  LatinLargeGuess    guess;
  LatinLargeRun      run;
  LatinLargePath     path;
} LatinLarge;

/* ---- SNES latin ---- */
#define LATIN_STOL  1e-5 /* default of -snes_stol, for the indicator */
#define LATIN_ERROR 1e-4 /* default estimated error to stop at */
typedef struct {
  Latin             latin;
  SNES              outer;          /* solves z - G(z) = 0 */
  char              outer_type[64]; /* type whose defaults are set */
  PetscBool         outer_rigid;    /* with those of structures with rigid laws */
  Vec               z;
  LatinStopType     requested, stop; /* the requested stop; that of this solve */
  PetscBool         given;           /* -snes_stol is given */
  PetscReal         target;          /* estimated error to stop at */
  PetscBool         chosen;          /* the target is the user's */
  PetscReal         tension_target;  /* estimated error of the tensions to stop at, or PETSC_DEFAULT */
  PetscReal         balance;         /* unbalance to stop at, relative to the loads */
  PetscReal         unbalance;       /* unbalance to stop at, a force; 0: any */
  LatinEstimate     estimate;
  PetscBool         guess; /* the solution vector is the initial guess of this solve */
  LatinWarmStart    warm;
  PetscBool         warm_chosen; /* it is the user's */
  PetscBool         has_state;   /* the last solve has converged */
  Vec               z_before;    /* final state of the solve before the last one; NULL or unset without has_before */
  PetscBool         has_before;
  Vec               reference; /* reference displacements, or NULL */
  PetscReal        *reference_copy;
  PetscInt          history_size, done;
  PetscReal        *indicator, *error_l2, *error_energy, *estimates; /* [history_size] per linear stage; [done] filled */
  PetscReal         first_distance, first_residual, residual;
  PetscBool         leapt;   /* the last distance exceeded the divergence tolerance */
  PetscInt          tested;  /* number of the last linear stage tested */
  PetscInt          current; /* number of the linear stage at which the solution vector and its residual were computed, -1: never */
  LatinNext         next;
  LatinDecide       decide;
  LatinNewton       newton;
  LatinLarge        large;
  LatinEquilibrium  found; /* last verdict on the displacements */
  LatinParameter    parameter;
  PetscViewer       monitor;
  PetscViewerFormat monitor_format;
} SNES_Latin;
/* Whether the geometry is large: the frame has parts with rotating directions */
static inline PetscBool SNESLatinLarge(const SNES_Latin *data)
{
  return (PetscBool)(data->large.frame && data->large.frame->part);
}
/* Most linear stages: each is an iteration and an evaluation of the function */
static inline PetscInt SNESLatinStageLimit(SNES snes)
{
  return snes->max_funcs < 0 ? snes->max_its : PetscMin(snes->max_its, snes->max_funcs);
}
/* Linear stages left, for the iteration and Newton's method together */
static inline PetscInt SNESLatinStagesLeft(SNES snes)
{
  const SNES_Latin *data = (SNES_Latin *)snes->data;

  return SNESLatinStageLimit(snes) - data->latin->linear.applications - data->newton.stages;
}
/* Estimated error of the tensions to stop at */
static inline PetscReal SNESLatinTensionTarget(const SNES_Latin *data)
{
  return data->tension_target > 0.0 ? data->tension_target : data->target;
}
/* Whether the stop needs an estimate of the error */
static inline PetscBool SNESLatinEstimates(const SNES_Latin *data)
{
  return (PetscBool)(data->stop == LATIN_STOP_ERROR || data->stop == LATIN_STOP_ENERGY);
}
/* Whether Newton's method follows the iteration, with large displacements */
static inline PetscBool SNESLatinLargeProves(const SNES_Latin *data)
{
  return (PetscBool)(SNESLatinEstimates(data) && data->newton.type != LATIN_NEWTON_NEVER);
}
/* Whether the solve starts from the state of the last one */
static inline PetscBool SNESLatinWarm(const SNES_Latin *data)
{
  return (PetscBool)(data->warm && data->has_state);
}
/* Whether missed gaps of a time step at rest count, unless nothing moves: Newton's method, which is more accurate, can take over */
static inline PetscBool SNESLatinStrict(const SNES_Latin *data)
{
  return data->newton.stall;
}
/* Whether the user has given a step tolerance */
static inline PetscBool SNESLatinStolGiven(SNES snes)
{
  return (PetscBool)(((SNES_Latin *)snes->data)->given || snes->stol != LATIN_STOL);
}
/*
   Whether convergence needs balance relative to the loads. Not with PETSc's tolerances, which then decide alone, and not in motions, where inertia
   balances loads
*/
static inline PetscBool SNESLatinBalances(SNES snes)
{
  const SNES_Latin *data = (SNES_Latin *)snes->data;

  return (PetscBool)(!data->latin->sub.structure->ground && (data->requested == LATIN_STOP_AUTO ? !SNESLatinStolGiven(snes) : SNESLatinEstimates(data)));
}

/* Unbalance to stop at, a force */
static inline PetscReal SNESLatinUnbalance(const SNES_Latin *data)
{
  return data->unbalance > 0.0 ? data->unbalance : PETSC_MAX_REAL;
}

/* Unbalance to stop at under loads of this l2 norm, a force */
static inline PetscReal SNESLatinBalanceForce(const SNES_Latin *data, PetscReal loads)
{
  return PetscMin(loads > 0.0 ? data->balance * loads : PETSC_MAX_REAL, SNESLatinUnbalance(data));
}

/* Whether the unbalance of the last check is larger than requested */
static inline PetscBool SNESLatinUnbalanced(const SNES_Latin *data)
{
  return (PetscBool)(data->found.unbalance > data->balance || data->found.left > SNESLatinUnbalance(data));
}

/* Residual norm to stop at, with the stop on the residual */
static inline PetscReal SNESLatinResidualTarget(SNES snes)
{
  return PetscMax(snes->abstol, snes->rtol * ((SNES_Latin *)snes->data)->first_residual);
}

/*
   Whether the residual exceeds the stop on the residual, and rounding. Only in statics without rigid links, whose SNES has another function, nonzero
   at the solution
*/
static inline PetscBool SNESLatinLeft(SNES snes, PetscReal loads)
{
  const SNES_Latin    *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;

  return (PetscBool)(data->stop == LATIN_STOP_RESIDUAL && structure->rigid_law < 0 && !structure->ground && !data->found.balanced && data->residual > PetscMax(SNESLatinResidualTarget(snes), data->found.rounding * loads));
}

#define LATIN_STEP_ERROR 10.0 /* with the stop on the indicator: largest error shown by unbalance or gaps, relative to -snes_stol */

/* Largest error that unbalance or missed gaps may show with the stop on the indicator */
static inline PetscReal SNESLatinShown(PetscReal stol)
{
  return PetscMax(LATIN_STEP_ERROR * stol, PETSC_SQRT_MACHINE_EPSILON);
}

#define LATIN_LARGE_NOWHERE 1e3 /* displacements, relative to the size of the structure, from which on a solve diverges */

#define LATIN_UNBALANCE_ROUNDING LatinByPrecision(1e-2, 10.0) /* largest rounding bound of the unbalance, relative to the loads; 20 to 110 times the rounding */

/* Whether large displacements make the unbalance rounding only. Then the solve ends with LATIN_NEXT_ROUNDING, without an accurate digit */
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
PETSC_INTERN PetscErrorCode      SNESLatinSlides_Private(SNES, LatinNext *);
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
/* from given displacements (snes/largefrom.c) */
PETSC_INTERN PetscErrorCode SNESLatinLargeProof_Private(SNES, Vec u, PetscBool *done);
PETSC_INTERN PetscErrorCode SNESLatinLargeStep_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinLargeStop_Private(SNES, LatinStopType);
PETSC_INTERN PetscErrorCode SNESLatinLargeFrom_Private(SNES, Vec u, PetscBool near, PetscBool *inside);
/* displacements of nodes on a path (snes/largenodes.c) */
/*
   largest displacement of a node relative to the prediction of the tangent stiffness at the start: the limit at a fold, where force is a parabola of
   displacement
*/
#define LATIN_PATH_FAR 2.0
PETSC_INTERN PetscErrorCode LatinPathNodes_Private(LatinStructure, Vec moved, Vec other, Vec middle, PetscReal little, PetscBool *within);
PETSC_INTERN PetscErrorCode LatinPathBetween_Private(LatinStructure, Vec mean, Vec ahead, Vec back, PetscReal little, PetscBool *within);
PETSC_INTERN PetscErrorCode LatinPathLoose_Private(LatinStructure, Vec left, Vec f);
PETSC_INTERN PetscErrorCode LatinPathStruts_Private(LatinStructure, PetscBool *struts, PetscBool *floors);
PETSC_INTERN PetscErrorCode LatinPathForces_Private(Vec r);
PETSC_INTERN PetscErrorCode LatinPathMode_Private(SNES, Vec u, Vec mode);                                                                /* snes/largemode.c */
PETSC_INTERN PetscErrorCode LatinPathSlopes_Private(SNES, Vec u, PetscReal near, PetscBool stiffer, PetscBool loose, PetscReal slope[]); /* snes/largekinks.c */
PETSC_INTERN PetscErrorCode LatinPathSlack_Private(LatinStructure, Vec u, PetscReal near, PetscReal slope[]);                            /* snes/largeslack.c */
PETSC_INTERN PetscErrorCode SNESLatinLargeDescend_Private(SNES, PetscBool near, PetscBool *heavier, Vec u, PetscBool *rests);            /* snes/largedescent.c */
/* moving supports (snes/largesupports.c) */
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
/* snes/settings.c */
PETSC_INTERN PetscErrorCode SNESLatinCheck_Private(SNES);
/* snes/options.c */
PETSC_INTERN PetscErrorCode SNESSetFromOptions_Latin(SNES, LatinOptionItems);
/* snes/results.c */
PETSC_INTERN PetscErrorCode SNESLatinRigidTensions_Private(SNES, const PetscReal *rigid[]);
PETSC_INTERN PetscErrorCode SNESView_Latin(SNES, PetscViewer);

/* ---- TS latin (ts/tslatin.c, state/) ---- */
typedef struct {
  LatinStructure step;               /* borrowed: the structure of a time step */
  Vec            w;                  /* h v+ */
  Vec            u_before, v_before; /* start of the last step, with events only */
  PetscBool      started;            /* w is that of a completed step */
  PetscBool      moved;              /* supports of this rank have moved since the start */
  PetscBool      again;              /* a reset follows a motion */
  PetscInt       iterations;
  PetscReal      whole, end; /* of a step that has failed and is made in shorter ones: its length, 0 if there is none, and the time of its end */
} TS_Latin;

PETSC_INTERN PetscReal LatinStepNext(TS, PetscReal next);

#endif
