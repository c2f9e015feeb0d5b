#include "snes/sneslatinimpl.h"

/*
   The search parameter l of contacts with friction, changed where the iteration stalls. It weighs tensions against gaps:
   too small, and tensions creep while gaps move to and fro; too large, and it is the other way round. So the two should
   change by as much from one local stage to the next, |change of tau_hat| = l |change of e_hat|. What grains with friction
   need is not known before (from 1/4 to 8 times what structure/rigidlaws.c chooses), and nothing else is guaranteed to end a stall.

   Another l is another operator: all is built again. Where no link has a stiffness, and no mass stands behind a node, all
   operators are proportional to l, and the state is written anew for the same tensions and displacements: the iteration goes
   on. Factors are powers of two, which round nothing, and are the same on any number of ranks.

   Beside elastic links l should be the stiffness that the structure shows to its rigid links. That of the neighbours, which
   structure/rigidlaws.c takes, may be far from it where stiffnesses differ much. The linear stages show it: from one to the next the
   tensions of the rigid links change by what this stiffness makes of the changes of their elongations. Where it is far
   from l, and the iteration has not come to an end soon, the solve starts anew with another l.
*/

#define LATIN_PARAMETER_WINDOW 30   /* linear stages at first, as many as between two restarts of Anderson's acceleration */
#define LATIN_PARAMETER_GAIN   0.5  /* an indicator that has not fallen by this since the last but so many windows stalls */
#define LATIN_PARAMETER_MOST   4.0  /* largest change at once */
#define LATIN_PARAMETER_FAR    16.0 /* no further than this from where it started */
#define LATIN_PARAMETER_OFF    32.0 /* by so much a search parameter may differ from the stiffness that the structure shows */
#define LATIN_PARAMETER_RANGE  1e10 /* from where it started: a structure that falls shows less and less stiffness, and operators made of it are a mechanism to rounding */
#define LATIN_PARAMETER_AGAIN  3    /* times that the operators are made anew */

static void LatinParameterClear(LatinParameter *parameter)
{
  parameter->seen = 0;
  for (PetscInt i = 0; i <= LATIN_PARAMETER_PAST; i++) parameter->least[i] = PETSC_MAX_REAL;
  parameter->sum[0] = parameter->sum[1] = 0.0;
}

/* Before the first linear stage of a solve. Collective on latin */
PetscErrorCode LatinParameterStart_Private(Latin latin, LatinParameter *parameter)
{
  const LatinStructure structure = latin->sub.structure;
  PetscInt             kinds     = 0; /* of links here: elastic, rigid with a search parameter of ours, rigid with the user's */

  PetscFunctionBegin;
  LatinParameterClear(parameter);
  parameter->window = LATIN_PARAMETER_WINDOW;
  parameter->again  = 0;
  parameter->alone = parameter->beside = PETSC_FALSE;
  if (structure->rigid_law < 0 || structure->ground) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (!LatinLaws[structure->law[l]].rigid) kinds |= 1;
    else kinds |= LatinStructureTuned(structure, l) ? 2 : 4;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &kinds, 1, MPIU_INT, MPI_BOR, PetscObjectComm((PetscObject)latin)));
  parameter->alone  = (PetscBool)(structure->rubs && kinds == 2);
  parameter->beside = (PetscBool)((kinds & 3) == 3);
  if (!(parameter->alone || parameter->beside)) PetscFunctionReturn(0);
  PetscCall(PetscFree2(parameter->tension, parameter->stretch));
  PetscCall(PetscMalloc2(latin->sub.nonsmooth, &parameter->tension, latin->sub.nonsmooth, &parameter->stretch));
  PetscFunctionReturn(0);
}

/*
   After the two stages from z to Gz: how much tensions and l times elongations have changed, beside the distance of the
   stages. Those of the local stage, tau_hat and tau_hat - Gz; where other links have a stiffness those of the linear stage,
   of which tau + l e is 2 tau_hat - Gz, and tau - l e is z
*/
PetscErrorCode LatinParameterObserve_Private(Latin latin, Vec z, Vec Gz, LatinParameter *parameter)
{
  const LatinSubdomains *sub   = &latin->sub;
  const PetscReal        scale = PetscSqr(latin->linear.distance);
  const PetscScalar     *a, *g;

  PetscFunctionBegin;
  if (!(parameter->alone || parameter->beside) || !(scale > 0.0)) PetscFunctionReturn(0);
  PetscCall(VecGetArrayRead(z, &a));
  PetscCall(VecGetArrayRead(Gz, &g));
  for (PetscInt i = 0; i < sub->nonsmooth; i++) {
    const PetscInt  at = latin->inter.sides + i;
    const PetscReal l = sub->stiffness[sub->nonsmooth_link[i]], y = 2.0 * latin->linear.tension[i] - g[at];
    const PetscReal tension = parameter->alone ? latin->linear.tension[i] : 0.5 * (y + a[at]), stretch = parameter->alone ? latin->linear.tension[i] - g[at] : 0.5 * (y - a[at]);

    if (!LatinLaws[sub->law[sub->nonsmooth_link[i]]].rigid) continue;
    if (parameter->seen) {
      parameter->sum[0] += PetscSqr(tension - parameter->tension[i]) / (l * scale);
      parameter->sum[1] += PetscSqr(stretch - parameter->stretch[i]) / (l * scale);
    }
    parameter->tension[i] = tension;
    parameter->stretch[i] = stretch;
  }
  PetscCall(VecRestoreArrayRead(Gz, &g));
  PetscCall(VecRestoreArrayRead(z, &a));
  PetscFunctionReturn(0);
}

/* The stiffness that the structure shows to its rigid links, beside l; far from it, all is to be built again */
static PetscErrorCode LatinParameterShown_Private(Latin latin, LatinParameter *parameter, LatinNext *next)
{
  PetscReal sum[2], shown;

  PetscFunctionBegin;
  if (++parameter->seen < parameter->window && *next != LATIN_NEXT_DIVERGED) PetscFunctionReturn(0);
  PetscCall(MPIU_Allreduce(parameter->sum, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  parameter->beside = PETSC_FALSE;
  if (!(sum[0] > 0.0 && sum[1] > 0.0)) PetscFunctionReturn(0);
  shown = PetscSqrtReal(sum[0] / sum[1]);
  if (shown < LATIN_PARAMETER_OFF && shown > 1.0 / LATIN_PARAMETER_OFF) PetscFunctionReturn(0);
  if (!(shown * latin->tuning < LATIN_PARAMETER_RANGE && shown * latin->tuning > 1.0 / LATIN_PARAMETER_RANGE)) PetscFunctionReturn(0);
  parameter->factor = PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(shown)));
  parameter->beside = (PetscBool)(++parameter->again < LATIN_PARAMETER_AGAIN);
  LatinParameterClear(parameter);
  *next = LATIN_NEXT_REBUILD;
  PetscFunctionReturn(0);
}

/* Is it time for another parameter? Then *next says how; else it stays. To be called once a stage with what the stop is on. Collective on latin */
PetscErrorCode LatinParameterDue_Private(Latin latin, PetscReal measure, LatinParameter *parameter, LatinNext *next)
{
  PetscReal sum[2], *least = parameter->least, now, before;

  PetscFunctionBegin;
  if (parameter->beside) PetscCall(LatinParameterShown_Private(latin, parameter, next));
  if (!parameter->alone) PetscFunctionReturn(0);
  least[0] = PetscMin(least[0], measure);
  if (++parameter->seen % parameter->window) PetscFunctionReturn(0);
  now = before = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < LATIN_PARAMETER_PAST; i++) {
    if (i < LATIN_PARAMETER_PAST / 2) now = PetscMin(now, least[i]);
    else before = PetscMin(before, least[i]);
  }
  PetscCall(MPIU_Allreduce(parameter->sum, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  if (parameter->seen >= LATIN_PARAMETER_PAST * parameter->window && now > LATIN_PARAMETER_GAIN * before && sum[0] > 0.0 && sum[1] > 0.0) {
    const PetscReal wanted = PetscPowReal(sum[0] / sum[1], 0.25); /* half of the way, on a logarithmic scale */

    parameter->factor = PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(PetscMin(LATIN_PARAMETER_MOST, PetscMax(1.0 / LATIN_PARAMETER_MOST, wanted)))));
    if (parameter->factor != 1.0 && parameter->factor * latin->tuning <= LATIN_PARAMETER_FAR && parameter->factor * latin->tuning >= 1.0 / LATIN_PARAMETER_FAR) {
      LatinParameterClear(parameter);
      parameter->window += parameter->window / 2; /* an indicator in another unit takes its time */
      *next = LATIN_NEXT_REBUILD;
      PetscFunctionReturn(0);
    }
  }
  for (PetscInt i = LATIN_PARAMETER_PAST - 1; i > 0; i--) least[i] = least[i - 1];
  least[0]          = PETSC_MAX_REAL;
  parameter->sum[0] = parameter->sum[1] = 0.0;
  PetscFunctionReturn(0);
}

/* The state z, of which F = z - G(z) has just been computed, for l times the factor: the same forces, elongations and displacements. Collective on latin */
PetscErrorCode LatinParameterState_Private(Latin latin, Vec z, Vec F, PetscReal factor)
{
  const PetscReal   *pull  = latin->linear.pull;
  const PetscInt     sides = latin->inter.sides;
  const PetscScalar *f;
  PetscScalar       *a;

  PetscFunctionBegin;
  PetscCall(VecGetArray(z, &a));
  PetscCall(VecGetArrayRead(F, &f));
  for (PetscInt k = 0; k < sides; k++) a[k] = a[k] - 0.5 * f[k] - pull[k] + factor * (pull[k] - 0.5 * f[k]); /* F_hat + factor d U_hat */
  for (PetscInt i = 0; i < latin->sub.nonsmooth; i++) {
    const PetscReal tension = latin->linear.tension[i];

    a[sides + i] = tension - factor * (tension - (a[sides + i] - f[sides + i]));
  }
  PetscCall(VecRestoreArrayRead(F, &f));
  PetscCall(VecRestoreArray(z, &a));
  PetscFunctionReturn(0);
}

/* Search parameters that are ours, times the factor, for all that is to be built again. Collective on latin */
PetscErrorCode LatinParameterTune_Private(Latin latin, PetscReal factor)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectStateGet((PetscObject)latin->sub.structure, &latin->tuning_state));
  latin->tuning *= factor;
  latin->stale = PETSC_TRUE;
  PetscCall(PetscInfo(latin, "The search parameter of rigid links becomes %g times what it was\n", (double)factor));
  PetscFunctionReturn(0);
}
