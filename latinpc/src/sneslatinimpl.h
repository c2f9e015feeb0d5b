/*
   The solvers around the method: SNES latin, which is given the fixed-point problem of latin.c, and TS latin, which asks
   it for a solution at every step; what ends an iteration, and what takes over from it.
*/
#ifndef SNESLATINIMPL_H
#define SNESLATINIMPL_H

#include "latinimpl.h"

/* ---- error of the displacements (estimate.c, drift.c, bound.c) ---- */
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

typedef struct {
  PetscBool  energy;   /* of the energy norm, not of the l2 norm */
  PetscInt   count;    /* iterates seen in this solve */
  PetscReal *sketch;   /* [window][rows + 1] of the last iterates: projected displacements, distance of the stages */
  PetscReal *part;     /* [rows + 1] work: what this rank adds */
  PetscReal  value;    /* relative, of the last iterate */
  PetscReal  floor;    /* what rounding leaves of it */
  PetscBool  rounding; /* the floor has been reached, above the target */
} LatinEstimate;
PETSC_INTERN PetscErrorCode LatinEstimateStart_Private(LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateFloor_Private(Latin, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateUpdate_Private(Latin, PetscReal target, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateDoubt_Private(Latin, PetscReal target, Vec u, Vec r, LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinEstimateDestroy_Private(LatinEstimate *);
PETSC_INTERN PetscErrorCode LatinDriftTensions_Private(LatinLinks, PetscReal target, Vec u, Vec r, Vec noise, PetscReal *missed);
PETSC_INTERN PetscErrorCode LatinDrift_Private(LatinLinks, PetscReal target, Vec u, Vec r, Vec noise, PetscReal *drift);

/* ---- what holds of a solution and not of a drift (proof.c) ---- */
PETSC_INTERN PetscErrorCode LatinLinksSize_Private(LatinLinks, PetscReal *size);
PETSC_INTERN PetscErrorCode LatinProofIsDue_Private(Latin, PetscBool *);
PETSC_INTERN PetscErrorCode LatinProofBalances_Private(LatinLinks, Vec u, Vec more, Vec r, PetscBool *);

/* ---- what displacements that rest leave undone (held.c) ---- */
#define LATIN_LOOSE 8 /* nodes, or links, that are named */
typedef struct {
  PetscReal missed;            /* the greatest distance by which a rigid link misses its gap */
  PetscReal way;               /* how far nodes that nothing holds have to go to a support */
  PetscInt  nodes;             /* how many they are, on all ranks */
  PetscInt  node[LATIN_LOOSE]; /* some of them, global numbers */
  PetscInt  hidden;            /* nodes whose loads are less than the rounding of the forces there */
  PetscInt  links;             /* rigid links that no displacement meets together */
  PetscInt  link[LATIN_LOOSE];
} LatinHeld;
PETSC_INTERN PetscErrorCode LatinHeld_Private(LatinLinks, Vec u, Vec r, LatinHeld *);
PETSC_INTERN PetscErrorCode LatinHeldJammed_Private(Latin, Vec z, Vec work, LatinHeld *);

/* ---- Newton's method after the iteration (polish.c) ---- */
typedef struct {
  PetscBool  on;               /* asked for */
  PetscBool  own;              /* a preconditioner of its own, on the tangent */
  PetscReal  start;            /* indicator from which on */
  SNES       newton;           /* NULL before the first time */
  LatinLinks links;            /* borrowed */
  Vec        reference;        /* borrowed: stop on the error against it, or NULL */
  PetscReal  target, residual; /* relative error of the displacements, norm of the residual to stop at */
  PetscReal  rtol;             /* of a linear solve while links change */
  PetscReal  floor;            /* least tangent stiffness of a link */
  PetscReal  error, energy;    /* estimated or measured error of the last step */
  PetscBool  linear;           /* no link can become slack */
  PetscInt   changes;          /* links that the last step has changed */
  PetscInt   steps, stages;    /* of the last polish: Newton steps, linear stages */
  PetscInt   still;            /* steps in a row whose search has stood still */
} LatinPolish;
PETSC_INTERN PetscErrorCode LatinPolishCreate_Private(SNES, Latin, LatinPolish *);
PETSC_INTERN PetscErrorCode LatinPolishSolve_Private(SNES, Latin, LatinPolish *, Vec u, SNESConvergedReason *);
PETSC_INTERN PetscErrorCode PCLatinShare_Private(PC, Latin);
PETSC_INTERN PetscErrorCode PCLatinFollow_Private(PC, Latin);

/* ---- Newton's method where the iteration stalls (rescue.c) ---- */
typedef struct {
  LatinPolish newton;
  PetscInt    stages;            /* most linear stages that may still be to come, 0 = no rescue */
  PetscInt    seen;              /* linear stages of this solve */
  PetscReal   least[3];          /* least measure of this window of stages and of the last two */
  PetscBool   able;              /* wanted, and the laws allow it */
  PetscBool   contrast;          /* stiffnesses too different for an estimate of the error to be trusted */
  PetscBool   called;            /* in this solve */
  PetscInt    loose;             /* nodes that the load of the last solve moves without end, on all ranks */
  PetscInt    node[LATIN_LOOSE]; /* some of them, global numbers */
} LatinRescue;
PETSC_INTERN PetscErrorCode LatinRescueStart_Private(LatinRescue *, LatinLinks);
PETSC_INTERN PetscBool      LatinRescueStalled(LatinRescue *, PetscReal measure, PetscReal target);
PETSC_INTERN PetscErrorCode LatinRescueLoose_Private(LatinRescue *);

/* ---- the search parameter of contacts with friction where the iteration stalls (balance.c) ---- */
#define LATIN_BALANCE_PAST 4 /* windows of linear stages that tell a stall */
typedef struct {
  PetscBool  on, able;                      /* wanted; and no link has a stiffness of its own */
  PetscBool  tunes;                         /* links beside rigid ones do: these are to have the stiffness that those show */
  PetscInt   tuned;                         /* times that they were given it in this solve */
  PetscInt   seen, window;                  /* linear stages with this parameter; from one look to the next */
  PetscReal  least[LATIN_BALANCE_PAST + 1]; /* least measure of this window and of the last ones */
  PetscReal  sum[2];                        /* squares of the changes of tensions and elongations in this window, here */
  PetscReal *tension, *stretch;             /* [size] of the last local stage: tau_hat, l e_hat */
  PetscInt   size;
  PetscReal  factor; /* of the parameter wanted next, 1: it stays */
} LatinBalance;
PETSC_INTERN PetscErrorCode LatinBalanceStart_Private(Latin, PetscBool warm, LatinBalance *);
PETSC_INTERN PetscErrorCode LatinBalanceObserve_Private(Latin, Vec z, Vec Gz, LatinBalance *);
PETSC_INTERN PetscErrorCode LatinBalanceDue_Private(Latin, PetscReal measure, PetscBool diverges, LatinBalance *, PetscBool *due);
PETSC_INTERN PetscErrorCode LatinBalanceTune_Private(LatinLinks, PetscReal factor);
PETSC_INTERN PetscErrorCode LatinBalanceChange_Private(Latin, Vec z, Vec F, LatinBalance *);
PETSC_INTERN PetscErrorCode LatinBalanceDestroy_Private(LatinBalance *);

/* ---- SNES latin (sneslatin.c, fixedpoint.c, snesresults.c) ---- */
typedef struct {
  Latin             latin;
  SNES              outer;       /* solves z - G(z) = 0 */
  PetscBool         outer_rigid; /* with the defaults for structures with rigid laws */
  Vec               z;
  LatinStopType     stop;
  PetscReal         target; /* estimated error to stop at */
  LatinEstimate     estimate;
  PetscBool         warm; /* start from the state of the last solve */
  PetscBool         has_state;
  PetscBool         extrapolate; /* a warm start goes on as the last two solves did */
  Vec               z_before;    /* where the solve before the last one ended, NULL or not yet filled */
  PetscBool         has_before;
  Vec               reference; /* displacements to compare with, or NULL */
  PetscReal        *reference_copy;
  PetscInt          history_size, done;
  PetscReal        *indicator, *error_l2, *error_energy, *estimates; /* [history_size] per linear stage; [done] filled */
  PetscReal         first_distance, first_residual, residual;
  PetscInt          tested; /* linear stages that the convergence test has seen */
  LatinPolish       polish;
  LatinRescue       rescue;
  LatinHeld         held; /* why the last solve has not come to an end, where links tell */
  LatinBalance      balance;
  LatinPolish      *ended;  /* what has ended the last solve, NULL: the iteration */
  PetscBool         handed; /* the iteration has ended for the polish */
  PetscViewer       monitor;
  PetscViewerFormat monitor_format;
} SNES_Latin;
PETSC_INTERN PetscErrorCode SNESLatinCreateOuter_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinOuterOptions_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinFixedPoint_Private(SNES outer, Vec z, Vec F, void *);
PETSC_INTERN PetscErrorCode SNESLatinResidual_Private(SNES);
PETSC_INTERN PetscErrorCode SNESLatinConverged_Private(SNES outer, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm, SNESConvergedReason *, void *);
PETSC_INTERN PetscErrorCode SNESLatinFindLinks_Private(SNES, LatinLinks *);

/* ---- TS latin (dynamics.c) ---- */
typedef struct {
  LatinLinks        step;    /* borrowed: the structure as a time step sees it */
  Vec               w;       /* h v+ */
  PetscBool         started; /* w is that of a step done */
  PetscInt          iterations;
  PetscViewer       monitor;
  PetscViewerFormat monitor_format;
} TS_Latin;

#endif
