#include "interfaces/latininterfaces.h"

/* Lists the primal dofs of each subdomain: free components of its copies in a primal component of the node. */

PetscErrorCode LatinInterfacePrimal_Private(LatinInterfaces *inter)
{
  const LatinSubdomains *sub    = inter->sub;
  const PetscInt         bs     = sub->bs;
  PetscInt               primal = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->n + 1, &inter->primal_offset));
  PetscCall(PetscMalloc1(bs * sub->copies, &inter->primal_index));
  for (PetscInt i = 0; i < bs * sub->copies; i++) primal += inter->component[i / bs] >= 0 && !sub->fixed[i] ? 1 : 0;
  PetscCall(PetscMalloc1(primal, &inter->primal_dof));
  primal = 0;
  for (PetscInt s = 0; s < sub->n; s++) {
    inter->primal_offset[s] = primal;
    for (PetscInt dof = bs * sub->node_offset[s]; dof < bs * sub->node_offset[s + 1]; dof++) {
      inter->primal_index[dof] = -1;
      if (inter->component[dof / bs] < 0 || sub->fixed[dof]) continue;
      inter->primal_index[dof]    = primal - inter->primal_offset[s];
      inter->primal_dof[primal++] = dof;
    }
  }
  inter->primal_offset[sub->n] = primal;
  PetscFunctionReturn(0);
}
