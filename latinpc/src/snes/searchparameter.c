#include "snes/sneslatinimpl.h"

/*
   Adapts the search parameter l of rigid links beside elastic ones. It should be the stiffness of the structure at its rigid links.
   structure/rigidlaws.c takes the stiffness of the neighbours, which may be far from it if stiffnesses differ much. The linear stages measure it: the
   ratio of the changes of tensions and of elongations of the rigid links from one stage to the next. If it is far from l after a window of stages, the
   solve restarts with another l. Factors are powers of two, which cause no rounding and are the same on any number of ranks.
*/

#define LATIN_PARAMETER_WINDOW 30   /* linear stages before a measurement: as many as between two restarts of the Anderson acceleration */
#define LATIN_PARAMETER_OFF    32.0 /* largest ratio of search parameter and measured stiffness without a change */
/* largest factor of all changes together: the measured stiffness of a collapsing structure falls until operators are singular to rounding */
#define LATIN_PARAMETER_RANGE 1e10
#define LATIN_PARAMETER_AGAIN 3 /* most changes */

/* Resets the data of a solve, and finds out whether l may be adapted. Collective on latin */
PetscErrorCode LatinParameterStart_Private(Latin latin, LatinParameter *parameter)
{
  const LatinStructure structure = latin->sub.structure;
  PetscInt             kinds     = 0; /* bits: elastic links (1), rigid links with an automatic search parameter (2) */

  PetscFunctionBegin;
  parameter->stages = parameter->again = 0;
  parameter->sum[0] = parameter->sum[1] = 0.0;
  parameter->adapts                     = PETSC_FALSE;
  if (structure->rigid_law < 0 || structure->ground) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (!LatinLaws[structure->law[l]].rigid) kinds |= 1;
    else if (LatinStructureTuned(structure, l)) kinds |= 2;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &kinds, 1, MPIU_INT, MPI_BOR, PetscObjectComm((PetscObject)latin)));
  parameter->adapts = (PetscBool)(kinds == 3);
  if (!parameter->adapts) PetscFunctionReturn(0);
  PetscCall(PetscFree2(parameter->tension, parameter->stretch));
  PetscCall(PetscMalloc2(latin->sub.nonsmooth, &parameter->tension, latin->sub.nonsmooth, &parameter->stretch));
  PetscFunctionReturn(0);
}

/*
   Adds the squared changes of tensions and of l times elongations by the linear stage from z to Gz, relative to the distance of the stages, from
   tau + l e = 2 tau_hat - Gz and tau - l e = z. Not collective
*/
PetscErrorCode LatinParameterObserve_Private(Latin latin, Vec z, Vec Gz, LatinParameter *parameter)
{
  const LatinSubdomains *sub   = &latin->sub;
  const PetscReal        scale = PetscSqr(latin->linear.distance);
  const PetscScalar     *a, *g;

  PetscFunctionBegin;
  if (!parameter->adapts || !(scale > 0.0)) PetscFunctionReturn(0);
  PetscCall(VecGetArrayRead(z, &a));
  PetscCall(VecGetArrayRead(Gz, &g));
  for (PetscInt i = 0; i < sub->nonsmooth; i++) {
    const PetscInt  at = latin->inter.sides + i;
    const PetscReal l = sub->stiffness[sub->nonsmooth_link[i]], y = 2.0 * latin->linear.tension[i] - g[at];
    const PetscReal tension = 0.5 * (y + a[at]), stretch = 0.5 * (y - a[at]);

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

/*
   Measures the stiffness at rigid links, relative to l. If it is far from 1, *next becomes LATIN_NEXT_REBUILD. To be called once per stage. Collective on
   latin
*/
PetscErrorCode LatinParameterDue_Private(Latin latin, LatinParameter *parameter, LatinNext *next)
{
  PetscReal sum[2], shown;

  PetscFunctionBegin;
  if (!parameter->adapts || (++parameter->stages < LATIN_PARAMETER_WINDOW && *next != LATIN_NEXT_DIVERGED)) PetscFunctionReturn(0);
  PetscCall(MPIU_Allreduce(parameter->sum, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  parameter->adapts = PETSC_FALSE;
  if (!(sum[0] > 0.0 && sum[1] > 0.0)) PetscFunctionReturn(0);
  shown = PetscSqrtReal(sum[0] / sum[1]);
  if (shown < LATIN_PARAMETER_OFF && shown > 1.0 / LATIN_PARAMETER_OFF) PetscFunctionReturn(0);
  if (!(shown * latin->tuning < LATIN_PARAMETER_RANGE && shown * latin->tuning > 1.0 / LATIN_PARAMETER_RANGE)) PetscFunctionReturn(0);
  parameter->factor = PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(shown)));
  parameter->adapts = (PetscBool)(++parameter->again < LATIN_PARAMETER_AGAIN);
  parameter->stages = 0;
  parameter->sum[0] = parameter->sum[1] = 0.0;
  *next                                 = LATIN_NEXT_REBUILD;
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
