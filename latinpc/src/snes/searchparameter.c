#include "snes/sneslatinimpl.h"

/*
   Adapts the search parameter l of rigid links on stagnation.

   Rigid links alone, with friction: l weighs tensions against gaps. If it is too small, tensions converge slowly while gaps oscillate; if too
   large, the other way round. Both should change equally from one local stage to the next, |change of tau_hat| = l |change of e_hat|.
   The best l of grains with friction is unknown beforehand (1/4 to 8 times the choice of structure/rigidlaws.c), and nothing
   else is guaranteed to end a stall.

   Another l needs new operators. Without elastic links and masses all operators are proportional to l, and the state is converted to
   the same tensions and displacements: the iteration continues. Factors are powers of two, which cause no rounding and are the same on
   any number of ranks.

   Rigid links beside elastic ones: l should be the stiffness of the structure at its rigid links. structure/rigidlaws.c takes the
   stiffness of the neighbours, which may be far from it if stiffnesses differ much. The linear stages measure it: the ratio of the
   changes of tensions and of elongations of the rigid links from one stage to the next. If it is far from l after a window of stages,
   the solve restarts with another l.
*/

#define LATIN_PARAMETER_WINDOW 30   /* initial window, in linear stages: as many as between two restarts of the Anderson acceleration */
#define LATIN_PARAMETER_GAIN   0.5  /* stall: the indicator has fallen by less than this factor, windows LATIN_PARAMETER_PAST / 2 apart */
#define LATIN_PARAMETER_MOST   4.0  /* largest factor of one change */
#define LATIN_PARAMETER_OFF    32.0 /* largest ratio of search parameter and measured stiffness without a change */
/*
   largest factor of all changes together, beside elastic links: the measured stiffness of a collapsing structure falls until operators are singular
   to rounding
*/
#define LATIN_PARAMETER_RANGE 1e10
#define LATIN_PARAMETER_AGAIN 3 /* most changes beside elastic links */

static void LatinParameterClear(LatinParameter *parameter)
{
  parameter->stages = 0;
  for (PetscInt i = 0; i <= LATIN_PARAMETER_PAST; i++) parameter->least[i] = PETSC_MAX_REAL;
  parameter->sum[0] = parameter->sum[1] = 0.0;
}

/* Resets the data of a solve, and finds out whether l may be adapted. Collective on latin */
PetscErrorCode LatinParameterStart_Private(Latin latin, LatinParameter *parameter)
{
  const LatinStructure structure = latin->sub.structure;
  PetscInt             kinds     = 0; /* bits: elastic links (1), rigid links with an automatic search parameter (2), with the user's (4) */

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
  parameter->alone  = (PetscBool)(structure->has_friction && kinds == 2);
  parameter->beside = (PetscBool)((kinds & 3) == 3);
  if (!(parameter->alone || parameter->beside)) PetscFunctionReturn(0);
  PetscCall(PetscFree2(parameter->tension, parameter->stretch));
  PetscCall(PetscMalloc2(latin->sub.nonsmooth, &parameter->tension, latin->sub.nonsmooth, &parameter->stretch));
  PetscFunctionReturn(0);
}

/*
   Adds the squared changes of tensions and of l times elongations after the two stages from z to Gz, relative to the distance of the stages. Rigid
   links alone: those of the local stage, tau_hat and l e_hat = tau_hat - Gz. Beside elastic links: those of the linear stage, from tau + l e = 2
   tau_hat - Gz and tau - l e = z. Not collective
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
    if (parameter->stages) {
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

/* Measures the stiffness at rigid links beside elastic ones, relative to l. If it is far from 1, *next becomes LATIN_NEXT_REBUILD. Collective on latin */
static PetscErrorCode LatinParameterShown_Private(Latin latin, LatinParameter *parameter, LatinNext *next)
{
  PetscReal sum[2], shown;

  PetscFunctionBegin;
  if (++parameter->stages < parameter->window && *next != LATIN_NEXT_DIVERGED) PetscFunctionReturn(0);
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

/*
   Decides whether the search parameter must change; then *next becomes LATIN_NEXT_REBUILD. To be called once per stage with the measure of the stop.
   Collective on latin
*/
PetscErrorCode LatinParameterDue_Private(Latin latin, PetscReal measure, LatinParameter *parameter, LatinNext *next)
{
  PetscReal sum[2], *least = parameter->least, now, before;

  PetscFunctionBegin;
  if (parameter->beside) PetscCall(LatinParameterShown_Private(latin, parameter, next));
  if (!parameter->alone) PetscFunctionReturn(0);
  least[0] = PetscMin(least[0], measure);
  if (++parameter->stages % parameter->window) PetscFunctionReturn(0);
  now = before = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < LATIN_PARAMETER_PAST; i++) {
    if (i < LATIN_PARAMETER_PAST / 2) now = PetscMin(now, least[i]);
    else before = PetscMin(before, least[i]);
  }
  PetscCall(MPIU_Allreduce(parameter->sum, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  if (parameter->stages >= LATIN_PARAMETER_PAST * parameter->window && now > LATIN_PARAMETER_GAIN * before && sum[0] > 0.0 && sum[1] > 0.0) {
    const PetscReal wanted = PetscPowReal(sum[0] / sum[1], 0.25); /* square root of the measured ratio: half of the way on a logarithmic scale */

    parameter->factor = PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(PetscMin(LATIN_PARAMETER_MOST, PetscMax(1.0 / LATIN_PARAMETER_MOST, wanted)))));
    if (parameter->factor != 1.0 && parameter->factor * latin->tuning <= LATIN_PARAMETER_FAR && parameter->factor * latin->tuning >= 1.0 / LATIN_PARAMETER_FAR) {
      LatinParameterClear(parameter);
      parameter->window += parameter->window / 2; /* the indicator needs time to settle with another l */
      *next = LATIN_NEXT_REBUILD;
      PetscFunctionReturn(0);
    }
  }
  for (PetscInt i = LATIN_PARAMETER_PAST - 1; i > 0; i--) least[i] = least[i - 1];
  least[0]          = PETSC_MAX_REAL;
  parameter->sum[0] = parameter->sum[1] = 0.0;
  PetscFunctionReturn(0);
}

/* Converts the state z to l times the factor: same forces, elongations and displacements. F = z - G(z) must have just been computed. Collective on latin */
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

/* Multiplies automatic search parameters by the factor, and marks the operators for a rebuild. Collective on latin */
PetscErrorCode LatinParameterTune_Private(Latin latin, PetscReal factor)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectStateGet((PetscObject)latin->sub.structure, &latin->tuning_state));
  latin->tuning *= factor;
  if (!latin->stale) latin->tuned = PETSC_TRUE; /* else options have changed as well */
  latin->stale = PETSC_TRUE;
  PetscCall(PetscInfo(latin, "Search parameter of rigid links multiplied by %g\n", (double)factor));
  PetscFunctionReturn(0);
}

/* Sets the search parameters with which a state was saved, before operators are built. Collective on latin */
PetscErrorCode LatinParameterRestore_Private(Latin latin, PetscReal tuning, PetscReal scale)
{
  PetscFunctionBegin;
  if (tuning == latin->tuning && scale == latin->rigid_scale) PetscFunctionReturn(0);
  PetscCall(LatinParameterTune_Private(latin, tuning / latin->tuning));
  latin->rigid_scale = scale;
  PetscFunctionReturn(0);
}

/*
   Resets the search parameters of rigid links before a solve whose loads or gaps are of another magnitude: the iteration would not converge with
   them. Marks the operators for a rebuild. Collective on latin
*/
PetscErrorCode LatinParameterLoads_Private(Latin latin)
{
  const LatinStructure structure = latin->sub.structure;
  PetscReal            scale;

  PetscFunctionBegin;
  if (!latin->set_up || structure->rigid_law < 0 || structure->ground || (latin->load_state == structure->load_state && latin->e0_state == structure->e0_state)) PetscFunctionReturn(0);
  PetscCall(LatinStructureRigidScale_Private(structure, &scale));
  if (LatinScaleFar(scale, latin->rigid_scale)) PetscCall(LatinParameterTune_Private(latin, 1.0 / latin->tuning));
  PetscFunctionReturn(0);
}
