#include "sneslatinimpl.h"

/*
   The search parameter l of contacts with friction, changed where the iteration stalls. It weighs tensions against gaps:
   too small, and tensions creep while gaps move to and fro; too large, and it is the other way round. So the two should
   change by as much from one local stage to the next, |change of tau_hat| = l |change of e_hat|. What grains with friction
   need is not known before (from 1/4 to 8 times what rigid.c chooses), and nothing else is guaranteed to end a stall.

   Where no link has a stiffness, and no mass stands behind a node, all operators are proportional to l: another l is
   another unit of length. So nothing is built again. Displacements, gaps and prescribed displacements of the subdomains
   are latin->scale times those of the structure, l stays what it is, and the state is written anew for the same tensions
   and elongations. Factors are powers of two, which round nothing, and are the same on any number of ranks.

   Beside elastic links l should be the stiffness that the structure shows to its rigid links. That of the neighbours, which
   rigid.c takes, may be far from it where stiffnesses differ much. The linear stages tell it: from one to the next the
   tensions of the rigid links change by what this stiffness makes of the changes of their elongations. Where it is far
   from l, and the iteration has not come to an end soon, all is built again with another l, and the solve starts anew.
*/

#define LATIN_BALANCE_WINDOW 30   /* linear stages at first, as many as between two restarts of Anderson's acceleration */
#define LATIN_BALANCE_GAIN   0.5  /* an indicator that has not fallen by this since the last but so many windows stalls */
#define LATIN_BALANCE_MOST   4.0  /* largest change at once */
#define LATIN_BALANCE_FAR    16.0 /* no further than this from where it started */
#define LATIN_BALANCE_OFF    32.0 /* by so much a search parameter may differ from the stiffness that the structure shows */
#define LATIN_BALANCE_NEAR   1e3  /* times the stiffnesses of elastic links: no search parameter beyond */
#define LATIN_BALANCE_AGAIN  3    /* times that the operators are made anew */

static void LatinRescale(Latin latin, PetscReal factor)
{
  const PetscInt n = latin->sub.bs * latin->sub.copies;

  for (PetscInt i = 0; i < n; i++) {
    latin->linear.U[i] *= factor;
    latin->sub.prescribed[i] *= factor;
  }
  for (PetscInt k = 0; k < latin->inter.sides; k++) latin->linear.pull[k] *= factor;
  for (PetscInt l = 0; l < latin->sub.links; l++) latin->sub.prestrain[l] *= factor;
  latin->scale *= factor;
}

static void LatinBalanceClear(LatinBalance *balance)
{
  balance->seen   = 0;
  balance->factor = 1.0;
  for (PetscInt i = 0; i <= LATIN_BALANCE_PAST; i++) balance->least[i] = PETSC_MAX_REAL;
  balance->sum[0] = balance->sum[1] = 0.0;
}

/* Before the first linear stage of a solve, which goes on from the state of the last one if `warm`. Collective on latin */
PetscErrorCode LatinBalanceStart_Private(Latin latin, PetscBool warm, LatinBalance *balance)
{
  const LatinLinks links = latin->links;
  PetscInt         kinds = 0; /* of links here: elastic, rigid with a search parameter of ours */

  PetscFunctionBegin;
  LatinBalanceClear(balance);
  balance->window = LATIN_BALANCE_WINDOW;
  balance->able = balance->tunes = PETSC_FALSE;
  if (!warm) LatinRescale(latin, 1.0 / latin->scale);
  if (!balance->on || links->rigid_law < 0 || links->ground) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < links->links_local; l++) {
    if (!LatinLaws[links->law[l]].rigid) kinds |= 1;
    else if (links->tuned[l]) kinds |= 2;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &kinds, 1, MPIU_INT, MPI_BOR, PetscObjectComm((PetscObject)latin)));
  balance->able  = (PetscBool)(links->rubs && !(kinds & 1));
  balance->tunes = (PetscBool)(kinds == 3 && balance->tuned < LATIN_BALANCE_AGAIN);
  if (!(balance->able || balance->tunes) || balance->size == latin->sub.nonsmooth) PetscFunctionReturn(0);
  PetscCall(PetscFree2(balance->tension, balance->stretch));
  PetscCall(PetscMalloc2(latin->sub.nonsmooth, &balance->tension, latin->sub.nonsmooth, &balance->stretch));
  balance->size = latin->sub.nonsmooth;
  PetscFunctionReturn(0);
}

/*
   After the two stages from z to Gz: how much tensions and l times elongations have changed, beside the distance of the
   stages. Those of the local stage, tau_hat and tau_hat - Gz; where other links have a stiffness those of the linear stage,
   of which tau + l e is 2 tau_hat - Gz, and tau - l e is z
*/
PetscErrorCode LatinBalanceObserve_Private(Latin latin, Vec z, Vec Gz, LatinBalance *balance)
{
  const LatinSubstructure *sub   = &latin->sub;
  const PetscReal          scale = PetscSqr(latin->distance);
  const PetscScalar       *a, *g;

  PetscFunctionBegin;
  if (!(balance->able || balance->tunes) || !(scale > 0.0)) PetscFunctionReturn(0);
  PetscCall(VecGetArrayRead(z, &a));
  PetscCall(VecGetArrayRead(Gz, &g));
  for (PetscInt i = 0; i < sub->nonsmooth; i++) {
    const PetscInt  at = latin->inter.sides + i;
    const PetscReal l = sub->stiffness[sub->nonsmooth_link[i]], y = 2.0 * sub->tension[i] - g[at];
    const PetscReal tension = balance->able ? sub->tension[i] : 0.5 * (y + a[at]), stretch = balance->able ? sub->tension[i] - g[at] : 0.5 * (y - a[at]);

    if (!LatinLaws[sub->law[sub->nonsmooth_link[i]]].rigid) continue;
    if (balance->seen) {
      balance->sum[0] += PetscSqr(tension - balance->tension[i]) / (l * scale);
      balance->sum[1] += PetscSqr(stretch - balance->stretch[i]) / (l * scale);
    }
    balance->tension[i] = tension;
    balance->stretch[i] = stretch;
  }
  PetscCall(VecRestoreArrayRead(Gz, &g));
  PetscCall(VecRestoreArrayRead(z, &a));
  PetscFunctionReturn(0);
}

/* A factor of the search parameters that leaves them near the stiffnesses of elastic links: tensions that grow without end show any. Collective on links */
static PetscErrorCode LatinBalanceBound_Private(LatinLinks links, PetscReal *factor)
{
  PetscReal range[4] = {-PETSC_MAX_REAL, 0.0, -PETSC_MAX_REAL, 0.0}; /* -least and most of elastic links, and of those parameters */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++) {
    PetscReal *of = range + (links->tuned[l] ? 2 : 0);

    if (LatinLaws[links->law[l]].rigid && !links->tuned[l]) continue; /* the user's parameter */
    of[0] = PetscMax(of[0], -links->stiffness[l]);
    of[1] = PetscMax(of[1], links->stiffness[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, range, 4, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)links)));
  while (*factor * range[3] > LATIN_BALANCE_NEAR * range[1]) *factor *= 0.5;
  while (-*factor * range[2] * LATIN_BALANCE_NEAR < -range[0]) *factor *= 2.0;
  PetscFunctionReturn(0);
}

/* The stiffness that the structure shows to its rigid links, beside l */
static PetscErrorCode LatinBalanceShown_Private(Latin latin, PetscBool diverges, LatinBalance *balance, PetscBool *due)
{
  PetscReal sum[2], shown;

  PetscFunctionBegin;
  if (++balance->seen < balance->window && !diverges) PetscFunctionReturn(0);
  PetscCall(MPIU_Allreduce(balance->sum, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  balance->tunes = PETSC_FALSE;
  if (!(sum[0] > 0.0 && sum[1] > 0.0)) PetscFunctionReturn(0);
  shown = PetscSqrtReal(sum[0] / sum[1]);
  if (shown < LATIN_BALANCE_OFF && shown > 1.0 / LATIN_BALANCE_OFF) PetscFunctionReturn(0);
  balance->factor = PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(shown)));
  PetscCall(LatinBalanceBound_Private(latin->links, &balance->factor));
  *due = (PetscBool)(balance->factor != 1.0);
  PetscFunctionReturn(0);
}

/* Is it time for another parameter? To be called once a stage with what the stop is on; the factor is kept. Collective on latin */
PetscErrorCode LatinBalanceDue_Private(Latin latin, PetscReal measure, PetscBool diverges, LatinBalance *balance, PetscBool *due)
{
  PetscReal sum[2], *least = balance->least, now, before;

  PetscFunctionBegin;
  *due = PETSC_FALSE;
  if (balance->tunes) PetscCall(LatinBalanceShown_Private(latin, diverges, balance, due));
  if (!balance->able) PetscFunctionReturn(0);
  least[0] = PetscMin(least[0], measure);
  if (++balance->seen % balance->window) PetscFunctionReturn(0);
  now = before = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < LATIN_BALANCE_PAST; i++) {
    if (i < LATIN_BALANCE_PAST / 2) now = PetscMin(now, least[i]);
    else before = PetscMin(before, least[i]);
  }
  PetscCall(MPIU_Allreduce(balance->sum, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  if (balance->seen >= LATIN_BALANCE_PAST * balance->window && now > LATIN_BALANCE_GAIN * before && sum[0] > 0.0 && sum[1] > 0.0) {
    const PetscReal wanted = PetscPowReal(sum[0] / sum[1], 0.25); /* half of the way, on a logarithmic scale */

    balance->factor = PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(PetscMin(LATIN_BALANCE_MOST, PetscMax(1.0 / LATIN_BALANCE_MOST, wanted)))));
    if (balance->factor * latin->scale > LATIN_BALANCE_FAR || balance->factor * latin->scale < 1.0 / LATIN_BALANCE_FAR) balance->factor = 1.0;
    *due = (PetscBool)(balance->factor != 1.0);
  }
  for (PetscInt i = LATIN_BALANCE_PAST - 1; i > 0; i--) least[i] = least[i - 1];
  least[0]        = PETSC_MAX_REAL;
  balance->sum[0] = balance->sum[1] = 0.0;
  PetscFunctionReturn(0);
}

/* The state z, of which F = z - G(z) has just been computed, for l times the factor: the same forces, elongations and displacements. Collective on latin */
PetscErrorCode LatinBalanceChange_Private(Latin latin, Vec z, Vec F, LatinBalance *balance)
{
  const PetscReal    factor = balance->factor, *pull = latin->linear.pull;
  const PetscInt     sides = latin->inter.sides;
  const PetscScalar *f;
  PetscScalar       *a;

  PetscFunctionBegin;
  PetscCall(VecGetArray(z, &a));
  PetscCall(VecGetArrayRead(F, &f));
  for (PetscInt k = 0; k < sides; k++) a[k] = a[k] - 0.5 * f[k] - pull[k] + factor * (pull[k] - 0.5 * f[k]); /* F_hat + factor d U_hat */
  for (PetscInt i = 0; i < latin->sub.nonsmooth; i++) {
    const PetscReal tension = latin->sub.tension[i];

    a[sides + i] = tension - factor * (tension - (a[sides + i] - f[sides + i]));
  }
  PetscCall(VecRestoreArrayRead(F, &f));
  PetscCall(VecRestoreArray(z, &a));
  LatinRescale(latin, factor);
  PetscCall(PetscInfo(latin, "The iteration stalls: the search parameter of rigid links is %g times that of the start\n", (double)latin->scale));
  LatinBalanceClear(balance);
  balance->window += balance->window / 2; /* an indicator in another unit takes its time */
  PetscFunctionReturn(0);
}

/* Search parameters that are ours, times the factor, for all that is to be built again. Collective on links */
PetscErrorCode LatinBalanceTune_Private(LatinLinks links, PetscReal factor)
{
  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++)
    if (links->tuned[l]) links->stiffness[l] *= factor;
  links->tuning *= factor;
  PetscCall(PetscObjectStateIncrease((PetscObject)links));
  PetscCall(PetscInfo(links, "The search parameter of rigid links becomes %g times what it was, as the structure has shown\n", (double)factor));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinBalanceDestroy_Private(LatinBalance *balance)
{
  PetscFunctionBegin;
  PetscCall(PetscFree2(balance->tension, balance->stretch));
  PetscFunctionReturn(0);
}
