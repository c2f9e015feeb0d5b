#include "core/latinimpl.h"

/* Cost of a decomposition: predicted for its factors, by symbolic analysis; measured for set-up and linear stages. */

/*@C
  LatinGetCost - Gets how the number of subdomains was chosen, the predicted cost of their factors, and measured times of set-up and linear stages.

  Collective on latin

  Input Parameter:
. latin - after its set-up

  Output Parameter:
. cost - struct, overwritten

  Level: intermediate

  Note:
  Additions and multiplications count as one operation each. Operations and bytes are sums over the factors of all subdomains; equal
  subdomains on a rank share a factor. They are 0 with local solvers other than the default. A linear stage reads the factors twice. Seconds
  are those of the slowest rank.

.seealso: `LatinGetStatistics()`
@*/
PetscErrorCode LatinGetCost(Latin latin, LatinCost *cost)
{
  MPI_Comm  comm   = PetscObjectComm((PetscObject)latin);
  PetscReal sum[2] = {0.0, 0.0}, seconds[2];

  PetscFunctionBegin;
  PetscCall(LatinCheckSetUp_Private(latin));
  PetscAssertPointer(cost, 2);
  for (PetscInt b = 0; b < latin->solvers.n; b++) {
    PetscReal operations, bytes;
    PC        pc;

    if (!latin->solvers.ksp[b]) continue; /* a dense inverse */
    PetscCall(KSPGetPC(latin->solvers.ksp[b], &pc));
    PetscCall(LatinCholeskyCost(pc, &operations, &bytes));
    sum[0] += operations;
    sum[1] += bytes;
  }
  seconds[0] = latin->setup_seconds;
  seconds[1] = latin->linear.seconds;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, seconds, 2, MPIU_REAL, MPIU_MAX, comm));
  *cost = (LatinCost){
    .choice            = latin->sub.matrix ? "one for each local matrix" : latin->partition.choice,
    .factor_operations = sum[0],
    .factor_bytes      = sum[1],
    .setup_seconds     = seconds[0],
    .linear_stages     = latin->linear.solves,
    .stage_seconds     = latin->linear.solves ? seconds[1] / latin->linear.solves : 0.0,
  };
  PetscFunctionReturn(0);
}
