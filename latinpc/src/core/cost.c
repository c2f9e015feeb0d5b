#include "core/latinimpl.h"

/* What a decomposition costs: predicted, of its factors, by their analysis; and measured. */

/*@C
  LatinGetCost - Why there are so many subdomains, what their factors take, and what set-up and linear stages have taken.

  Collective on latin

  Level: intermediate

  Note:
  Operations, of additions and multiplications each, and bytes are those of the factors of all subdomains, of which equal ones on a rank share one: known of the default local
  solver, 0 of others. A linear stage reads the factors twice. Seconds are those of the slowest rank.
@*/
PetscErrorCode LatinGetCost(Latin latin, LatinCost *cost)
{
  MPI_Comm  comm   = PetscObjectComm((PetscObject)latin);
  PetscReal sum[2] = {0.0, 0.0}, seconds[2];

  PetscFunctionBegin;
  PetscValidHeaderSpecific(latin, LATIN_CLASSID, 1);
  PetscCheck(latin->set_up, comm, PETSC_ERR_ORDER, "The decomposition does not exist yet: call SNESSetUp() or PCSetUp() first");
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
