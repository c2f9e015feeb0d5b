#include "snes/sneslatinimpl.h"

/*
   Rigid links in Newton's method: the method of multipliers [M. R. Hestenes; M. J. D. Powell; R. T. Rockafellar]. A rigid
   link of strain x bears max(0, lambda + r x), or min where it bears compression: with a penalty stiffness r it is a unilateral spring, and
   Newton's method solves for the displacements. What it then bears is its next lambda. At the solution lambda is its tension and
   x its gap, whatever r; the larger r beside the stiffness around the link, the fewer times this takes. Where gaps jam, the tensions grow without end.
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
  if (!newton->penalty) PetscCall(PetscMalloc3(structure->links_local, &newton->penalty, structure->links_local, &newton->multiplier, structure->links_local, &newton->tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal tension = latin->linear.rigid_tension[l];

    newton->penalty[l]    = LatinLaws[structure->law[l]].rigid ? LATIN_PENALTY * latin->sub.link_stiffness[l] : 0.0;
    newton->multiplier[l] = LatinLaws[structure->law[l]].rigid && !PetscIsInfOrNanReal(tension) ? tension : 0.0;
  }
  structure->penalty    = newton->penalty;
  structure->multiplier = newton->multiplier;
  PetscFunctionReturn(0);
}

/*
   The tensions of the springs at u become the multipliers. *done: displacements, since `before`, and tensions, beside all of them or the loads, have
   changed by no more than the error asked for. Collective on structure
*/
static PetscErrorCode LatinMultipliersUpdate_Private(LatinNewton *newton, Vec u, Vec before, PetscReal *change, PetscReal *moved, PetscBool *done)
{
  const LatinStructure structure = newton->structure;
  PetscReal            sum[2]    = {0.0, 0.0}, size, least;

  PetscFunctionBegin;
  PetscCall(LatinStructureTensions_Private(structure, NULL, u, newton->tension));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (!LatinLaws[structure->law[l]].rigid) continue;
    sum[0] += PetscSqr(newton->tension[l] - newton->multiplier[l]);
    sum[1] += PetscSqr(newton->tension[l]);
    newton->multiplier[l] = newton->tension[l];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(VecAXPY(before, -1.0, u));
  PetscCall(VecNorm(before, NORM_2, moved));
  PetscCall(VecNorm(u, NORM_2, &size));
  PetscCall(VecCopy(u, before));
  PetscCall(LatinEquilibriumPoint_Private(structure, &least));
  *change          = sum[0] > 0.0 ? PetscSqrtReal(sum[0] / PetscMax(PetscMax(sum[1], sum[0]), PetscSqr(newton->loads))) : 0.0; /* beside loads tensions may be rounding */
  *done            = (PetscBool)(*moved <= PetscMax(newton->target * size, least) && *change <= PetscMin(newton->target, newton->tension_target));
  newton->tensions = *change;
  *moved           = size > 0.0 ? *moved / size : 0.0;
  PetscCall(PetscInfo(structure, "Tensions of rigid links change by %g of themselves, displacements by %g\n", (double)*change, (double)*moved));
  PetscFunctionReturn(0);
}

/* Newton's method for one set of multipliers after the other. Collective on snes */
PetscErrorCode LatinMultipliersSolve_Private(SNES snes, LatinNewton *newton, Vec u, SNESConvergedReason *reason)
{
  PetscBool done  = PETSC_FALSE;
  PetscReal grown = LATIN_PENALTY, most = LATIN_PENALTY_MOST, change = PETSC_MAX_REAL, moved = 1.0, factor, last;
  PetscInt  steps, stages, sum = 0, raised = 0;
  Vec       before;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(newton->structure->dm, &before));
  PetscCall(VecCopy(u, before));
  for (PetscInt k = 0; k < LATIN_MULTIPLIER_TIMES && sum < LATIN_MULTIPLIER_STEPS && !done; k++) {
    PetscCall(SNESSolve(newton->snes, snes->vec_rhs, u));
    PetscCall(SNESGetConvergedReason(newton->snes, reason));
    PetscCall(SNESGetIterationNumber(newton->snes, &steps));
    PetscCall(SNESGetLinearSolveIterations(newton->snes, &stages));
    sum += steps;
    newton->steps += steps;
    newton->stages += stages;
    if (*reason == SNES_DIVERGED_LINEAR_SOLVE && newton->tangent && raised++ < LATIN_FLOOR_TIMES) { /* the taut links of a step are a mechanism to rounding */
      newton->floor *= LATIN_FLOOR_GROWS;
      PetscCall(VecCopy(before, u));
      continue;
    }
    done = (PetscBool)(*reason < 0 || newton->structure->rigid_law < 0);
    last = change;
    if (!done) PetscCall(LatinMultipliersUpdate_Private(newton, u, before, &change, &moved, &done));
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
  structure->penalty = structure->multiplier = NULL;
  PetscFunctionReturn(0);
}
