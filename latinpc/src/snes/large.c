#include "snes/sneslatinimpl.h"

/*
   Solves where links turn by large angles (structure/turning.h, structure/frame.c): operators, and when Newton's method runs. The course of
   a solve (snes/largeiterate.c):

   1. The iteration, with operators made once. 2. The iteration with operators made at the present displacements, if the remaining linear
   stages would cost more than that set-up. 3. Newton's method with the exact tangent stiffness (snes/largenewton.c), which proves the
   error: near the solution, or if step 2 would be needed again. 4. If Newton's method stagnates, the iteration again. This happens if a
   front of slackening cables moves over a net link by link; then a Newton step only measures the error of the iteration.

   Two parts of Newton's method for small displacements are not used: its line search on the energy, and the slack links detected on the
   drawn configuration.
*/

#define LATIN_LARGE_NEAR       2e-2 /* estimated relative error below which Newton's method is tried */
#define LATIN_LARGE_WINDOW     8    /* linear stages over which progress is measured; 12: a few more stages in all, 6: progress is underestimated */
#define LATIN_LARGE_GROW       2    /* factor on it after a set-up; 1: half as many set-ups again on small saddles, 4: twice the stages on large ones */
#define LATIN_LARGE_MOST       40   /* most set-ups of the tangent stiffness for Newton's method; it needs 1 to 30 */
#define LATIN_LARGE_COST       30   /* cost of a set-up in linear stages: in time steps, and where the solvers do not report their cost */
#define LATIN_LARGE_FIXED      5.0  /* cost of a set-up in linear stages, apart from the operations of the factorisation */
#define LATIN_LARGE_RATE       0.2  /* the same per operation on a byte of the factors: 7 to 18 stages in all on saddles, 34 on a network of 8,000 nodes */
#define LATIN_LARGE_STAGNATION 3    /* set-ups within which Newton's method must halve the unbalanced forces; else it stagnates */
#define LATIN_LARGE_CREEPS     0.9  /* the same along a path, where the solution may be far: part of the unbalanced forces that may remain */

/* Starts the first of windows of `window` stages */
static void LatinLargeWindow(LatinLargeProgress *progress, PetscInt window)
{
  progress->idle   = 0;
  progress->lowest = PETSC_MAX_REAL;
  progress->window = window;
  progress->stages = 0;
  progress->least  = PETSC_MAX_REAL;
  progress->before = 1.0;
}

/* Checks the stop and resets the data of a solve, before its first linear stage. Collective on snes */
PetscErrorCode SNESLatinLargeStart_Private(SNES snes)
{
  SNES_Latin    *data  = (SNES_Latin *)snes->data;
  LatinLarge    *large = &data->large;
  LatinStructure structure;
  LatinCost      cost;

  PetscFunctionBegin;
  if (!SNESLatinLarge(data)) PetscFunctionReturn(0);
  structure = large->frame->original;
  PetscCheck(data->stop != LATIN_STOP_ENERGY, PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP, "-snes_latin_stop energy is for links that keep their direction: take the stop error where they turn far (-snes_latin_geometry large)");
  PetscCheck(data->stop != LATIN_STOP_REFERENCE || !data->large.frame->spring, PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP,
             "-snes_latin_stop reference does not see what inextensible cables of large displacements are still to bear: take the stop error, or the indicator");
  PetscCall(LatinStructureSize_Private(structure, &large->size, NULL));
  PetscCall(PetscFree(large->ahead));
  structure->hold        = 0.0;
  large->renewals        = 0;
  large->path.reached    = 0.0;
  large->path.branch     = -1.0;
  large->path.sheared    = PETSC_FALSE;
  large->last            = PETSC_MAX_INT;
  large->near            = LATIN_LARGE_NEAR;
  large->progress.half   = PETSC_MAX_REAL;
  large->progress.halved = 0;
  large->run.unstable = large->newton_failed = large->inside_failed = large->stateless = large->iterated = PETSC_FALSE;
  LatinLargeWindow(&large->progress, LATIN_LARGE_WINDOW);
  PetscCall(LatinGetCost(data->latin, &cost));
  large->cost = cost.factor_bytes > 0.0 && !structure->midpoint ? LATIN_LARGE_FIXED + LATIN_LARGE_RATE * cost.factor_operations / cost.factor_bytes : LATIN_LARGE_COST;
  PetscFunctionReturn(0);
}

/* Computes the state z of the displacements in the solution vector, if the operators were made for Newton's method, which needs no state. Collective on snes */
PetscErrorCode SNESLatinLargeState_Private(SNES snes)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  if (!data->large.stateless) PetscFunctionReturn(0);
  PetscCall(SNESLatinStart_Private(snes));
  data->large.stateless = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/*
   Makes the operators at the displacements in the solution vector. If the tangent stiffness is not positive definite in a subdomain, which
   it may still be in the structure, operators without the negative part (LATIN_FRAME_FIRM) replace it; Newton's method detects an unstable
   structure. Collective on snes
*/
static PetscErrorCode LatinLargeOperators_Private(SNES snes, LatinFrameType type)
{
  LatinStructure frame = ((SNES_Latin *)snes->data)->large.frame;
  PetscErrorCode ierr  = PETSC_ERR_MAT_CH_ZRPVT; /* the same on all ranks */

  PetscFunctionBegin;
  if (type == LATIN_FRAME_TANGENT) {
    PetscCall(LatinFrameRenew_Private(frame, snes->vec_sol, type));
    PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
    ierr = SNESLatinSetUpState_Private(snes);
    PetscCall(PetscPopErrorHandler());
    if (ierr != PETSC_ERR_MAT_CH_ZRPVT) PetscCall(ierr);
  }
  if (!ierr) PetscFunctionReturn(0);
  PetscCall(LatinFrameRenew_Private(frame, snes->vec_sol, type == LATIN_FRAME_TANGENT ? LATIN_FRAME_FIRM : type));
  PetscCall(SNESLatinSetUpState_Private(snes));
  PetscFunctionReturn(0);
}

/* Makes the operators at the displacements in the solution vector, and their state unless they are for Newton's method. Collective on snes */
PetscErrorCode SNESLatinLargeRenew_Private(SNES snes, LatinFrameType type)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  /* without Newton's method longer windows: the iteration must converge alone */
  PetscInt applications = data->latin->linear.applications, grows = SNESLatinLargeProves(data) ? LATIN_LARGE_GROW : LATIN_LARGE_GROW * LATIN_LARGE_GROW;

  PetscFunctionBegin;
  PetscCall(LatinLargeOperators_Private(snes, type));
  PetscCall(SNESLatinCopyReference_Private(snes));
  PetscCall(SNESLatinLoad_Private(snes));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateStart_Private(data->latin, &data->estimate));
  data->latin->linear.applications = applications;
  data->guess                      = PETSC_TRUE;
  data->first_distance             = -1.0;
  data->large.stateless            = PETSC_TRUE;
  if (type == LATIN_FRAME_TANGENT) grows = 1;
  else PetscCall(SNESLatinLargeState_Private(snes));
  data->large.renewals++;
  LatinLargeWindow(&data->large.progress, grows * PetscMin(data->large.progress.window, PETSC_MAX_INT / grows));
  PetscCall(PetscInfo(snes, "After %" PetscInt_FMT " linear stages: operators at the present displacements\n", applications));
  PetscFunctionReturn(0);
}

/* Computes the largest norm of the unbalanced forces at convergence: relative to the loads, or in statics without any to the tensions as drawn. Collective on snes */
PetscErrorCode SNESLatinLargeBalance_Private(SNES snes)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->original;
  PetscReal            drive;

  PetscFunctionBegin;
  PetscCall(SNESLatinLoads_Private(snes, &data->large.loads));
  drive = data->large.loads;
  if (!(drive > 0.0) && !structure->midpoint) PetscCall(LatinStructureDrawn_Private(structure, &drive));
  data->large.balance = SNESLatinBalanceForce(data, drive);
  PetscFunctionReturn(0);
}

/*
   Interpolates strains and tensions between those of two equilibria, once: the pair is forgotten. Without, a soft tower goes to another branch
   (tests/test_large_paths.py). none: displacements to be multiplied by zero. Collective on large->frame
*/
static PetscErrorCode LatinLargeBetween_Private(LatinLarge *large, Vec none)
{
  const LatinStructure structure = large->frame->original;
  PetscReal           *strain    = large->ahead + structure->links_local, *tension, *other;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &other));
  PetscCall(LatinTurningAhead_Private(structure, large->guess.between[0], NULL, none, 0.0, large->ahead, strain));
  PetscCall(LatinTurningAhead_Private(structure, large->guess.between[1], NULL, none, 0.0, tension, other));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    large->ahead[l] += large->guess.part * (tension[l] - large->ahead[l]);
    strain[l] += large->guess.part * (other[l] - strain[l]);
  }
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &other));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  large->guess.between[0] = large->guess.between[1] = NULL;
  PetscFunctionReturn(0);
}

/*
   Sets the strains to those of the last local stage, and tensions to match. They are nearly in balance, whereas the displacements still
   leave up to half of the cables of a net slack that bear little. Strains of links between prescribed nodes stay. Collective on snes
*/
static PetscErrorCode SNESLatinLargeStrains_Private(SNES snes, PetscReal tension[], PetscReal strain[])
{
  SNES_Latin            *data  = (SNES_Latin *)snes->data;
  const LatinStructure   frame = data->large.frame, structure = frame->original;
  const LatinSubdomains *sub = &data->latin->sub;
  PetscReal             *part, *here;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(frame->links_local, &part, sub->links, &here));
  for (PetscInt i = 0; i < frame->links_local; i++) part[i] = strain[i / frame->dim];
  PetscCall(LatinSFBcast_Private(sub->link_sf, 1, MPIU_REAL, part, here));
  for (PetscInt i = 0; i < sub->links; i++)
    if (sub->state[i] >= 0) here[i] = data->latin->linear.strain[i];
  PetscCall(LatinSFReduce_Private(sub->link_sf, 1, MPIU_REAL, here, part, MPI_REPLACE));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    strain[l]  = part[frame->dim * l];
    tension[l] = LatinStructureTension(structure, NULL, l, strain[l]);
  }
  PetscCall(PetscFree2(part, here));
  PetscFunctionReturn(0);
}

/*
   Initialises the tensions that go ahead of the displacements (snes/largenewton.c). near: laws become straight lines at these strains;
   after the iteration the strains are those of its last local stage. Collective on snes
*/
static PetscErrorCode SNESLatinLargeAhead_Private(SNES snes, PetscBool near)
{
  LatinLarge          *large     = &((SNES_Latin *)snes->data)->large;
  const LatinStructure structure = large->frame->original;

  PetscFunctionBegin;
  if (structure->midpoint) PetscFunctionReturn(0);                        /* the mean force of a time step has its own tangent */
  PetscCall(PetscMalloc1(2 * structure->links_local + 1, &large->ahead)); /* not NULL without links either */
  PetscCall(LatinTurningAhead_Private(structure, snes->vec_sol, NULL, snes->vec_sol, 0.0, large->ahead, large->ahead + structure->links_local));
  if (large->guess.between[0]) PetscCall(LatinLargeBetween_Private(large, snes->vec_sol));
  if (large->guess.start) PetscCall(PetscArraycpy(large->ahead, large->guess.start, 2 * structure->links_local));
  PetscCall(PetscFree(large->guess.start));
  /* not with inextensible cables, whose law in the frame differs */
  if (large->iterated && !large->frame->spring) PetscCall(SNESLatinLargeStrains_Private(snes, large->ahead, large->ahead + structure->links_local));
  LatinStructurePrescribe(structure, large->ahead, near ? large->ahead + structure->links_local : NULL, NULL);
  structure->hold = near ? LATIN_LARGE_HELD * large->near : LATIN_LARGE_HOLD;
  PetscFunctionReturn(0);
}

/*
   Returns whether Newton's method stagnates: over the last LATIN_LARGE_STAGNATION set-ups the least unbalanced force has not fallen enough.
   k: number of this set-up; least: least unbalanced force after each of the last ones, updated. Not collective
*/
static PetscBool LatinLargeStagnates(const LatinLarge *large, PetscInt k, PetscReal least[])
{
  const PetscReal now    = PetscIsInfOrNanReal(large->run.force) ? PETSC_MAX_REAL : large->run.force;
  const PetscReal part   = large->frame->original->strain || large->frame->original->midpoint ? 0.5 : LATIN_LARGE_CREEPS;
  PetscReal      *here   = &least[k % LATIN_LARGE_STAGNATION];
  const PetscReal before = k < LATIN_LARGE_STAGNATION ? PETSC_MAX_REAL : *here;

  *here = k ? PetscMin(now, least[(k - 1) % LATIN_LARGE_STAGNATION]) : now;
  return (PetscBool)(*here > PetscMax(part * before, large->balance));
}

/* Computes the norm of the unbalanced forces at the displacements u, with tensions of these displacements. Collective on snes */
static PetscErrorCode LatinLargeForces_Private(SNES snes, Vec u, PetscReal *left)
{
  Vec r;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(((SNES_Latin *)snes->data)->large.frame->dm, &r));
  PetscCall(SNESComputeFunction(snes, u, r));
  PetscCall(VecNorm(r, NORM_2, left));
  PetscCall(DMRestoreGlobalVector(((SNES_Latin *)snes->data)->large.frame->dm, &r));
  PetscFunctionReturn(0);
}

/* Whether the first step of Newton's method proves the iterate from which it started, with unbalanced forces of norm `left` */
static PetscBool LatinLargeMeasured(const SNES_Latin *data, PetscReal left)
{
  const LatinLarge *large = &data->large;

  if (large->run.unstable || !(left <= large->balance)) return PETSC_FALSE;
  return (PetscBool)(LATIN_LARGE_SAFETY * large->iteration_error[0] <= data->target && LATIN_LARGE_SAFETY * large->iteration_error[1] <= SNESLatinTensionTarget(data));
}

/*
   Runs Newton's method with operators of the tangent stiffness, and makes new ones whenever linear iterations cost more than a set-up,
   until it converges or stagnates. measures: it starts at the iterate u with unbalanced forces of norm `left`; its first step then measures
   the error of u, which is accepted if small. Collective on snes
*/
static PetscErrorCode LatinLargeTangents_Private(SNES snes, Vec u, PetscBool measures, PetscReal left, PetscBool *done)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscInt    steps;
  PetscReal   least[LATIN_LARGE_STAGNATION], far;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < LATIN_LARGE_MOST && !*done && large->run.slow && SNESLatinStagesLeft(snes) > 0; k++) {
    PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
    PetscCall(SNESLatinLargeNewton_Private(snes, done));
    if (*done) break;
    if (!k && measures) {
      PetscCall(PetscArraycpy(large->iteration_error, large->run.first_step, 2));
      if (LatinLargeMeasured(data, left)) {
        PetscCall(VecCopy(u, snes->vec_sol));
        data->estimate.tensions = LATIN_LARGE_SAFETY * large->iteration_error[1];
        PetscCall(SNESLatinLargeClaim_Private(snes, LATIN_LARGE_SAFETY * large->iteration_error[0], LATIN_NEXT_CONVERGED));
        *done = PETSC_TRUE;
        break;
      }
    }
    PetscCall(SNESGetIterationNumber(data->newton.snes, &steps));
    if (!steps || LatinLargeStagnates(large, k, least)) break; /* without a step the next operators would be the same */
    if (large->frame->original->midpoint) continue;            /* the mean forces of a time step may balance far away */
    PetscCall(VecNorm(snes->vec_sol, NORM_INFINITY, &far));
    if (!(far <= LATIN_LARGE_NOWHERE * large->size)) break; /* operators there are those of a mechanism */
  }
  PetscFunctionReturn(0);
}

/*
   Runs Newton's method from the displacements in the solution vector.

   near: near the solution, with operators of the tangent stiffness; its first step measures the error of the iteration, which is all that
   is gained if a front of changing cables creeps over a net. Else with the present operators first. renews: new operators once it has cost
   as much as a set-up. *done: converged. If not, the solution vector is restored; after the iteration it keeps the Newton iterate if the
   steps became smaller.

   Collective on snes
*/
PetscErrorCode SNESLatinLargeFinish_Private(SNES snes, PetscBool renews, PetscBool near, PetscBool *done)
{
  LatinLarge    *large     = &((SNES_Latin *)snes->data)->large;
  LatinStructure structure = large->frame->original;
  PetscBool      measures;
  PetscReal      left = PETSC_MAX_REAL;
  Vec            u;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeBalance_Private(snes));
  PetscCall(DMGetGlobalVector(large->frame->dm, &u));
  PetscCall(VecCopy(snes->vec_sol, u));
  if (near) PetscCall(LatinLargeForces_Private(snes, u, &left));
  PetscCall(SNESLatinLargeAhead_Private(snes, near));
  *done           = PETSC_FALSE;
  large->run.slow = (PetscBool)(near && !structure->midpoint && large->frame->made < LATIN_FRAME_TANGENT);
  measures        = large->run.slow;
  if (!large->run.slow) PetscCall(SNESLatinLargeNewton_Private(snes, done));
  if (renews) PetscCall(LatinLargeTangents_Private(snes, u, measures, left, done));
  LatinStructurePrescribe(structure, NULL, NULL, NULL);
  large->run.changed = 0;
  PetscCall(PetscFree(large->ahead));
  if (!*done && !(large->iterated && measures && !large->run.unstable && large->run.first_step[0] < large->iteration_error[0])) PetscCall(VecCopy(u, snes->vec_sol));
  PetscCall(DMRestoreGlobalVector(large->frame->dm, &u));
  PetscFunctionReturn(0);
}
