#include "snes/sneslatinimpl.h"

/*
   Rigid links in Newton's method: the method of multipliers [M. R. Hestenes; M. J. D. Powell; R. T. Rockafellar]. A rigid
   link of strain x bears max(0, lambda + r x), or min where it bears compression: with a penalty stiffness r it is a unilateral spring, and
   Newton's method solves for the displacements. What it then bears is its next lambda. At the solution lambda is its tension and
   x its gap, whatever r; the larger r beside the stiffness around the link, the fewer times this takes. Where gaps jam, the tensions grow without end.

   A contact with friction starts from lambda = 0, for those of an iterate that has diverged lie outside of its cone. With
   friction there is no energy, and whole steps of Newton's method may end nowhere: they start from problems that have one, see
   LatinMultipliersCoulomb_Private() and structure/frictionsprings.c.
*/

#define LATIN_PENALTY          1e3  /* times the search parameter of the link, at first */
#define LATIN_PENALTY_GROWS    10.0 /* by so much where tensions change by more than a tenth of what they did before */
#define LATIN_PENALTY_REST     64.0 /* times eps: displacements that change by less do so by rounding, which the penalty makes tensions of */
#define LATIN_PENALTY_MOST     1e9  /* times the search parameter: more, and rounding hides what soft links bear */
#define LATIN_MULTIPLIER_TIMES 30   /* most problems with springs */
#define LATIN_MULTIPLIER_STEPS 400  /* most steps of Newton's method for all of them */

#define LATIN_FLOOR_GROWS 1e3 /* what slack links keep of their stiffness, where a step finds a mechanism */
#define LATIN_FLOOR_TIMES 3

/* Rigid links become springs, which bear what the iteration has left them. Collective on latin */
PetscErrorCode LatinMultipliersStart_Private(Latin latin, LatinNewton *newton)
{
  LatinStructure structure = latin->sub.structure;

  PetscFunctionBegin;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  /* penalty and bound are not NULL on a rank without links: that would say that there are none */
  if (!newton->penalty) PetscCall(PetscMalloc4(structure->links_local + 1, &newton->penalty, structure->links_local, &newton->multiplier, structure->links_local, &newton->tension, structure->links_local + 1, &newton->bound));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal tension = latin->linear.rigid_tension[l];

    newton->penalty[l]    = LatinLaws[structure->law[l]].rigid ? LATIN_PENALTY * latin->sub.link_stiffness[l] : 0.0;
    newton->multiplier[l] = LatinLaws[structure->law[l]].rigid && !structure->rubs && !PetscIsInfOrNanReal(tension) ? tension : 0.0;
  }
  structure->penalty    = newton->penalty;
  structure->multiplier = newton->multiplier;
  PetscFunctionReturn(0);
}

/*
   The tensions of the springs at u become the multipliers. What is missed of gaps shrinks to K / (K + r) of itself each time, where K is what resists beside
   the links. *done: displacements, since `before`, and tensions, beside all of them or the loads, have changed by no more than the error asked for, and will not by more at
   this rate. Where gaps jam K is without end, and newton->found says so. grown: the penalty, times the search parameter. Collective on structure
*/
static PetscErrorCode LatinMultipliersUpdate_Private(LatinNewton *newton, Vec u, Vec before, PetscReal grown, PetscReal *change, PetscReal *moved, PetscBool *done)
{
  const LatinStructure structure = newton->structure;
  PetscReal            sum[4]    = {0.0, 0.0, 0.0, 0.0}, size, least, closes; /* squares of changes and of tensions, of missed gaps and of what they are rounded with */
  PetscBool            misses, stays;

  PetscFunctionBegin;
  PetscCall(LatinStructureTensions_Private(structure, NULL, u, newton->tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal last = newton->multiplier[l];

    if (!LatinLaws[structure->law[l]].rigid) continue;
    newton->multiplier[l] = newton->tension[l];
    newton->tension[l] -= last;
    sum[0] += PetscSqr(newton->tension[l]);
    sum[1] += PetscSqr(newton->multiplier[l]);
    sum[2] += PetscSqr(newton->tension[l] / newton->penalty[l]);
    if (newton->multiplier[l] != 0.0) sum[3] += PetscSqr(structure->e0[l]) + PetscSqr(newton->multiplier[l] / newton->penalty[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(VecAXPY(before, -1.0, u));
  PetscCall(VecNorm(before, NORM_2, moved));
  PetscCall(VecNorm(u, NORM_2, &size));
  PetscCall(VecCopy(u, before));
  PetscCall(LatinEquilibriumPoint_Private(structure, &least));
  misses      = (PetscBool)(sum[2] > PetscSqr(LATIN_PENALTY_REST * PETSC_MACHINE_EPSILON) * (PetscSqr(size) + sum[3]));
  closes      = !misses ? 1.0 : newton->gap > 0.0 ? 1.0 - PetscSqrtReal(sum[2] / newton->gap) : 0.0;
  stays       = (PetscBool)(misses && newton->gap > 0.0 && *moved > 0.0 && PetscAbsReal(closes) <= grown * PETSC_MACHINE_EPSILON);
  newton->gap = sum[2];
  if (misses && *change > PetscMin(newton->target, newton->tension_target)) closes = 0.0;                                                                                                    /* what is slow has not shown yet */
  *change          = sum[0] > 0.0 ? PetscSqrtReal(sum[0] / PetscMax(PetscMax(sum[1], sum[0]), PetscSqr(newton->loads))) : 0.0;                                                               /* beside loads tensions may be rounding */
  *done            = (PetscBool)(*moved <= PetscMax(newton->target * size, least) && *change * PetscMax(closes, 1.0 - closes) <= closes * PetscMin(newton->target, newton->tension_target)); /* what is to come, at this rate */
  newton->tensions = *change;
  if (!structure->rubs && !structure->ground) PetscCall(LatinEquilibriumFarkas_Private(structure, u, *done, stays, newton->tension, &newton->found)); /* rigid links of a time step have no gaps, or do not bear */
  *moved = size > 0.0 ? *moved / size : 0.0;
  PetscCall(PetscInfo(structure, "Tensions of rigid links change by %g of themselves, displacements by %g\n", (double)*change, (double)*moved));
  PetscFunctionReturn(0);
}

/* One problem with springs, to forces without balance of this norm. Collective on snes */
static PetscErrorCode LatinMultipliersProblem_Private(SNES snes, LatinNewton *newton, PetscReal balance, Vec u, SNESConvergedReason *reason)
{
  const PetscReal kept = newton->balance;
  PetscInt        steps, stages;

  PetscFunctionBegin;
  newton->balance = balance;
  PetscCall(SNESSolve(newton->snes, snes->vec_rhs, u));
  PetscCall(SNESGetConvergedReason(newton->snes, reason));
  PetscCall(SNESGetIterationNumber(newton->snes, &steps));
  PetscCall(SNESGetLinearSolveIterations(newton->snes, &stages));
  newton->steps += steps;
  newton->stages += stages;
  newton->balance = kept;
  PetscFunctionReturn(0);
}

/* Bounds of the friction: none; or what the normal parts allow that bear `tension`, and half of the way there where there was a bound */
static void LatinMultipliersBound(LatinNewton *newton, const PetscReal tension[])
{
  const LatinStructure structure = newton->structure;

  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal allowed = tension && structure->law[l] == LATIN_LAW_FRICTION ? -structure->friction[l] * tension[l] : 0.0;

    newton->bound[l] = !tension ? PETSC_MAX_REAL : newton->sticks ? allowed : 0.5 * (newton->bound[l] + allowed);
  }
  structure->bound = newton->bound;
  newton->sticks   = (PetscBool)!tension;
}

/* Bounds so low that nothing holds the structure become twice what they were, and the greatest one of all at least: from above each problem is held. Collective on structure */
static PetscErrorCode LatinMultipliersRaise_Private(LatinNewton *newton)
{
  const LatinStructure structure = newton->structure;
  PetscReal            most      = 0.0;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (structure->law[l] == LATIN_LAW_FRICTION) most = PetscMax(most, newton->bound[l]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  for (PetscInt l = 0; l < structure->links_local; l++) newton->bound[l] = PetscMax(2.0 * newton->bound[l], most);
  PetscFunctionReturn(0);
}

/* Have the springs of the present problem an energy? Coulomb's friction has none */
PetscBool LatinMultipliersEnergy(const LatinNewton *newton)
{
  return (PetscBool)(!newton->structure->rubs || newton->structure->bound);
}

/*
   The problem of Coulomb's friction, for which whole steps of Newton's method end soon if they end at all. They start from the
   problem of contacts that stick where they touch, whose energy is convex; and where they do not end once more from the one
   whose friction has the bounds of the last tensions, which may hold less than Coulomb's friction does. Collective on snes
*/
static PetscErrorCode LatinMultipliersCoulomb_Private(SNES snes, LatinNewton *newton, PetscBool first, Vec u, SNESConvergedReason *reason)
{
  LatinStructure structure = newton->structure;
  PetscBool      raised    = PETSC_FALSE;
  Vec            convex;

  PetscFunctionBegin;
  newton->sticks = PETSC_TRUE;
  if (first) {
    LatinMultipliersBound(newton, NULL);
    PetscCall(LatinMultipliersProblem_Private(snes, newton, PETSC_MAX_REAL, u, reason));
    if (*reason < 0) PetscFunctionReturn(0);
  }
  PetscCall(DMGetGlobalVector(structure->dm, &convex));
  do {
    PetscCall(VecCopy(u, convex));
    structure->bound = NULL;
    PetscCall(LatinMultipliersProblem_Private(snes, newton, newton->balance, u, reason));
    if (*reason > 0) break;
    PetscCall(VecCopy(convex, u));
    PetscCall(LatinStructureTensions_Private(structure, NULL, u, newton->tension));
    LatinMultipliersBound(newton, newton->tension);
    PetscCall(LatinMultipliersProblem_Private(snes, newton, PETSC_MAX_REAL, u, reason));
    if (*reason < 0 && !raised) {
      PetscCall(VecCopy(convex, u));
      PetscCall(LatinMultipliersRaise_Private(newton));
      PetscCall(LatinMultipliersProblem_Private(snes, newton, PETSC_MAX_REAL, u, reason));
      raised = PETSC_TRUE;
    }
  } while (*reason > 0 && newton->steps - newton->before < LATIN_MULTIPLIER_STEPS);
  if (structure->bound) *reason = SNES_DIVERGED_MAX_IT;
  newton->sticks = PETSC_FALSE;
  PetscCall(DMRestoreGlobalVector(structure->dm, &convex));
  PetscFunctionReturn(0);
}

/* Newton's method for one set of multipliers after the other. Collective on snes */
PetscErrorCode LatinMultipliersSolve_Private(SNES snes, LatinNewton *newton, Vec u, SNESConvergedReason *reason)
{
  PetscBool done = PETSC_FALSE, first = PETSC_TRUE;
  PetscReal grown = LATIN_PENALTY, most = LATIN_PENALTY_MOST, change = PETSC_MAX_REAL, moved = 1.0, factor, last;
  PetscInt  raised = 0;
  Vec       before;

  PetscFunctionBegin;
  newton->before = newton->steps;
  newton->sticks = PETSC_FALSE;
  newton->gap    = 0.0;
  PetscCall(DMGetGlobalVector(newton->structure->dm, &before));
  PetscCall(VecCopy(u, before));
  for (PetscInt k = 0; k < LATIN_MULTIPLIER_TIMES && newton->steps - newton->before < LATIN_MULTIPLIER_STEPS && !done; k++) {
    if (newton->structure->rubs) PetscCall(LatinMultipliersCoulomb_Private(snes, newton, first, u, reason));
    else PetscCall(LatinMultipliersProblem_Private(snes, newton, newton->balance, u, reason));
    if (*reason == SNES_DIVERGED_LINEAR_SOLVE && newton->tangent && raised++ < LATIN_FLOOR_TIMES) { /* the taut links of a step are a mechanism to rounding */
      newton->floor *= LATIN_FLOOR_GROWS;
      PetscCall(VecCopy(before, u));
      continue;
    }
    first = PETSC_FALSE;
    done  = (PetscBool)(*reason < 0 || newton->structure->rigid_law < 0);
    last  = change;
    if (!done) PetscCall(LatinMultipliersUpdate_Private(newton, u, before, grown, &change, &moved, &done));
    if (newton->found.verdict == LATIN_JAMMED) {
      *reason = SNES_DIVERGED_DTOL;
      done    = PETSC_TRUE;
    }
    if (done || change <= last / LATIN_PENALTY_GROWS) continue;
    factor = LATIN_PENALTY_GROWS;
    if (moved <= LATIN_PENALTY_REST * PETSC_MACHINE_EPSILON) { /* they change by rounding of the displacements alone */
      factor = 1.0 / LATIN_PENALTY_GROWS;
      most   = grown * factor;
    } else if (grown * factor > most) continue;
    grown *= factor;
    for (PetscInt l = 0; l < newton->structure->links_local; l++) newton->penalty[l] *= factor;
  }
  if (!done) *reason = SNES_DIVERGED_MAX_IT;
  PetscCall(DMRestoreGlobalVector(newton->structure->dm, &before));
  PetscFunctionReturn(0);
}

/* Rigid links bear their multipliers, and are rigid again */
PetscErrorCode LatinMultipliersEnd_Private(Latin latin, LatinNewton *newton, PetscBool solved)
{
  LatinStructure structure = latin->sub.structure;

  PetscFunctionBegin;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  if (solved) PetscCall(PetscArraycpy(latin->linear.rigid_tension, newton->multiplier, structure->links_local));
  structure->penalty = structure->multiplier = structure->bound = NULL;
  PetscFunctionReturn(0);
}
