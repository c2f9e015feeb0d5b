#include "snes/sneslatinimpl.h"

/*
   Rigid links in Newton's method: the method of multipliers [M. R. Hestenes; M. J. D. Powell; R. T. Rockafellar]. A rigid link of
   strain x has the tension max(0, lambda + r x), or min if it bears compression: a unilateral spring of penalty stiffness r and
   multiplier lambda. Newton's method solves for the displacements with fixed multipliers; the tensions of the springs are the next
   multipliers. At the solution lambda is the tension and x the gap, for any r. The larger r relative to the stiffness around the link, the
   fewer updates. With incompatible gaps (jammed links) the tensions grow without bound.
   With friction there is no energy, and another method: snes/coulomb.c.
*/

#define LATIN_PENALTY          1e3  /* initial penalty, relative to the search parameter of the link */
#define LATIN_PENALTY_GROWS    10.0 /* growth of the penalty, if the change of the tensions has not fallen to a tenth */
#define LATIN_PENALTY_MOST     1e9  /* largest penalty, relative to the search parameter; with more, rounding hides the tensions of soft links */
#define LATIN_MULTIPLIER_TIMES 30   /* most updates of the multipliers */

#define LATIN_FLOOR_GROWS 1e3 /* growth of the tangent stiffness of slack links (newton->floor) after a singular linear solve */
#define LATIN_FLOOR_TIMES 3   /* most such growths */

/* Replaces rigid links by springs; the tensions of the iteration become the multipliers. Not collective */
PetscErrorCode LatinMultipliersStart_Private(LatinNewton *newton)
{
  LatinStructure structure = newton->structure;

  PetscFunctionBegin;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  /* penalty must not be NULL on a rank without links: NULL means none */
  if (!newton->penalty) PetscCall(PetscMalloc3(structure->links_local + 1, &newton->penalty, structure->links_local, &newton->multiplier, structure->links_local, &newton->tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal tension = newton->latin->linear.rigid_tension[l];

    newton->penalty[l]    = LatinLaws[structure->law[l]].rigid ? LATIN_PENALTY * newton->latin->sub.link_stiffness[l] : 0.0;
    newton->multiplier[l] = LatinLaws[structure->law[l]].rigid && !PetscIsInfOrNanReal(tension) ? tension : 0.0;
  }
  structure->penalty    = newton->penalty;
  structure->multiplier = newton->multiplier;
  PetscFunctionReturn(0);
}

/*
   Returns in *rests whether a change of the displacements in a time step is rounding: its inertia forces are below the rounding of the tensions, of
   this l2 norm. Masses at rest have no other measure. Collective on structure
*/
PetscErrorCode LatinStepRests_Private(LatinStructure structure, Vec moved, PetscReal tensions, PetscBool *rests)
{
  PetscReal inertia;
  Vec       forces;

  PetscFunctionBegin;
  *rests = PETSC_FALSE;
  if (!structure->ground) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &forces));
  PetscCall(VecPointwiseMult(forces, structure->ground, moved));
  PetscCall(VecNorm(forces, NORM_2, &inertia));
  PetscCall(DMRestoreGlobalVector(structure->dm, &forces));
  *rests = (PetscBool)(inertia <= LATIN_NEWTON_REST * tensions);
  PetscFunctionReturn(0);
}

/*
   Makes many updates at once, if each changes the tensions by the same amount and no displacement: up to the first tension that becomes zero. So boxes
   of grains that shear too far are found to be jammed (tests/test_equilibrium.py).
   newton->tension: change by the last update. Collective on newton->structure
*/
static PetscErrorCode LatinMultipliersLeap_Private(LatinNewton *newton)
{
  const LatinStructure structure = newton->structure;
  PetscReal            most = 0.0, updates = PETSC_MAX_REAL;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (LatinLaws[structure->law[l]].rigid) most = PetscMax(most, PetscAbsReal(newton->tension[l]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal less = -LatinLawSign(structure->law[l]) * newton->tension[l];

    if (LatinLaws[structure->law[l]].rigid && less > PETSC_SQRT_MACHINE_EPSILON * most) updates = PetscMin(updates, PetscAbsReal(newton->multiplier[l]) / less);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &updates, 1, MPIU_REAL, MPIU_MIN, PetscObjectComm((PetscObject)structure)));
  if (!(updates > 1.0 && updates < PETSC_MAX_REAL)) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (LatinLaws[structure->law[l]].rigid) newton->multiplier[l] += updates * newton->tension[l];
  PetscCall(PetscInfo(structure, "The tensions change by the same each time: %g updates at once\n", (double)updates));
  PetscFunctionReturn(0);
}

/* Sums of squares over rigid links, of a multiplier update */
typedef struct {
  PetscReal changes, tensions; /* of the tensions; the tensions */
  PetscReal gaps, terms;       /* gap errors; terms of the gaps, which rounding multiplies */
} LatinMultiplierSums;

/* Sets the multipliers to the tensions of the springs at u, and newton->tension to their changes. Collective on newton->structure */
static PetscErrorCode LatinMultipliersRenew_Private(LatinNewton *newton, Vec u, LatinMultiplierSums *sum)
{
  const LatinStructure structure = newton->structure;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(sum, sizeof(*sum)));
  PetscCall(LatinStructureTensions_Private(structure, NULL, u, newton->tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal last = newton->multiplier[l];

    if (!LatinLaws[structure->law[l]].rigid) continue;
    newton->multiplier[l] = newton->tension[l];
    newton->tension[l] -= last;
    sum->changes += PetscSqr(newton->tension[l]);
    sum->tensions += PetscSqr(newton->multiplier[l]);
    sum->gaps += PetscSqr(newton->tension[l] / newton->penalty[l]);
    if (newton->multiplier[l] != 0.0) sum->terms += PetscSqr(structure->e0[l]) + PetscSqr(newton->multiplier[l] / newton->penalty[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}

/*
   Multiplier update. It reduces the gap errors by the factor K / (K + r), with K the stiffness of the structure around the links.

   *done: the changes of displacements (since `before`) and of tensions (relative to all tensions or to the loads) are below the requested errors, and
   so are their extrapolations at the measured rate. With incompatible gaps K is infinite: newton->found reports jammed links. grown: penalty relative
   to the search parameter. Overwrites before by u. Collective on structure
*/
static PetscErrorCode LatinMultipliersUpdate_Private(LatinNewton *newton, Vec u, Vec before, PetscReal grown, PetscReal *change, PetscBool *done)
{
  const LatinStructure structure = newton->structure;
  const PetscReal      target    = PetscMin(newton->target, newton->tension_target);
  PetscReal            size, least, moved, closes = 1.0; /* closes: part of the gap errors that this update has removed */
  PetscBool            misses, stays, rests;
  LatinMultiplierSums  sum;

  PetscFunctionBegin;
  PetscCall(LatinMultipliersRenew_Private(newton, u, &sum));
  PetscCall(VecAXPY(before, -1.0, u));
  PetscCall(VecNorm(before, NORM_2, &moved));
  PetscCall(LatinStepRests_Private(structure, before, PetscSqrtReal(sum.tensions), &rests));
  PetscCall(VecNorm(u, NORM_2, &size));
  PetscCall(VecCopy(u, before));
  PetscCall(LatinEquilibriumPoint_Private(structure, &least));
  misses = (PetscBool)(sum.gaps > PetscSqr(LATIN_NEWTON_REST) * (PetscSqr(size) + sum.terms));
  if (misses) closes = newton->gap > 0.0 ? 1.0 - PetscSqrtReal(sum.gaps / newton->gap) : 0.0;
  stays       = (PetscBool)(misses && newton->gap > 0.0 && moved > 0.0 && PetscAbsReal(closes) <= grown * PETSC_MACHINE_EPSILON);
  newton->gap = sum.gaps;
  if (misses && *change > target) closes = 0.0; /* too early to see tensions that converge slowly */
  /* relative to the loads as well: small tensions may be rounding */
  *change          = sum.changes > 0.0 ? PetscSqrtReal(sum.changes / PetscMax(PetscMax(sum.tensions, sum.changes), PetscSqr(newton->loads))) : 0.0;
  *done            = (PetscBool)((rests || moved <= PetscMax(newton->target * size, least)) && *change * PetscMax(closes, 1.0 - closes) <= closes * target); /* extrapolated change */
  newton->tensions = *change;
  if (stays && !*done) PetscCall(LatinMultipliersLeap_Private(newton));
  PetscCall(LatinEquilibriumFarkas_Private(structure, u, stays, newton->tension, &newton->found));
  PetscCall(PetscInfo(structure, "Multiplier update: relative change of the tensions of rigid links %g, of the displacements %g\n", (double)*change, (double)(size > 0.0 ? moved / size : 0.0)));
  PetscFunctionReturn(0);
}

/* Runs Newton's method with fixed multipliers. Collective on snes */
static PetscErrorCode LatinMultipliersProblem_Private(SNES snes, LatinNewton *newton, Vec u, SNESConvergedReason *reason)
{
  PetscInt steps, stages;

  PetscFunctionBegin;
  PetscCall(SNESSolve(newton->snes, snes->vec_rhs, u));
  PetscCall(SNESGetConvergedReason(newton->snes, reason));
  PetscCall(SNESGetIterationNumber(newton->snes, &steps));
  PetscCall(SNESGetLinearSolveIterations(newton->snes, &stages));
  newton->steps += steps;
  newton->stages += stages;
  newton->stages_left = newton->limit - newton->stages;
  PetscFunctionReturn(0);
}

/* Solves by multiplier updates: Newton's method, new multipliers, new penalty. Collective on snes */
PetscErrorCode LatinMultipliersSolve_Private(SNES snes, LatinNewton *newton, Vec u, SNESConvergedReason *reason)
{
  PetscBool done  = PETSC_FALSE;
  PetscReal grown = LATIN_PENALTY, change = PETSC_MAX_REAL, last;
  PetscInt  raised = 0;
  Vec       before;

  PetscFunctionBegin;
  newton->gap = 0.0;
  PetscCall(DMGetGlobalVector(newton->structure->dm, &before));
  PetscCall(VecCopy(u, before));
  for (PetscInt k = 0; k < LATIN_MULTIPLIER_TIMES && !done; k++) {
    PetscCall(LatinMultipliersProblem_Private(snes, newton, u, reason));
    if (*reason == SNES_DIVERGED_LINEAR_SOLVE && newton->tangent && raised++ < LATIN_FLOOR_TIMES) { /* singular: the taut links are a mechanism to rounding */
      newton->floor *= LATIN_FLOOR_GROWS;
      PetscCall(VecCopy(before, u));
      continue;
    }
    done = (PetscBool)(*reason < 0 || newton->structure->rigid_law < 0);
    last = change;
    if (!done) PetscCall(LatinMultipliersUpdate_Private(newton, u, before, grown, &change, &done));
    if (newton->found.verdict == LATIN_JAMMED) {
      *reason = SNES_DIVERGED_DTOL;
      done    = PETSC_TRUE;
    }
    if (done || change <= last / LATIN_PENALTY_GROWS) continue;
    if (grown * LATIN_PENALTY_GROWS > LATIN_PENALTY_MOST) continue;
    grown *= LATIN_PENALTY_GROWS;
    for (PetscInt l = 0; l < newton->structure->links_local; l++) newton->penalty[l] *= LATIN_PENALTY_GROWS;
  }
  if (!done) *reason = SNES_DIVERGED_MAX_IT;
  PetscCall(DMRestoreGlobalVector(newton->structure->dm, &before));
  PetscFunctionReturn(0);
}

/* Makes links rigid again. solved: their tensions become the multipliers. Not collective */
PetscErrorCode LatinMultipliersEnd_Private(LatinNewton *newton, PetscBool solved)
{
  LatinStructure structure = newton->structure;

  PetscFunctionBegin;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  if (solved) PetscCall(PetscArraycpy(newton->latin->linear.rigid_tension, newton->multiplier, structure->links_local));
  structure->penalty = structure->multiplier = NULL;
  PetscFunctionReturn(0);
}
