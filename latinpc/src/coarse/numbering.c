#include "coarse/latincoarse.h"

/*
   Global numbering of the coarse dofs (24), (37), (38): macro displacements of the strong interfaces, then displacements of the
   primal nodes. A dof is numbered by the rank that builds its macro basis, or that has the lowest subdomain of its primal component.
*/

/* Numbers the primal dofs of this rank, from 0. table[], zero before, brings 1 + number to all copies. Collective on sub->object */
static PetscErrorCode LatinCoarseNumberPrimal_Private(LatinCoarse *coarse, PetscInt table[])
{
  const LatinSubdomains *sub   = coarse->sub;
  const LatinInterfaces *inter = coarse->inter;
  const PetscInt         bs    = coarse->sub->bs;

  PetscFunctionBegin;
  coarse->primal_local = 0;
  for (PetscInt i = 0; i < sub->copies; i++) {
    const PetscInt p = inter->position[i], m = inter->share_offset[i + 1] - inter->share_offset[i];

    if (inter->component[i] < 0 || inter->component[i] != p) continue;
    table[inter->table_offset[i] + p * m + p] = 1 + coarse->primal_local;
    for (PetscInt c = 0; c < bs; c++) coarse->primal_local += sub->fixed[bs * i + c] ? 0 : 1;
  }
  PetscCall(LatinInterfaceExchange_Private(coarse->inter, table));
  PetscFunctionReturn(0);
}

/* Sets the ranges of the coarse dofs of each subdomain: macro modes, interface by interface, then primal dofs */
static PetscErrorCode LatinCoarseOffsets_Private(LatinCoarse *coarse)
{
  const LatinSubdomains *sub   = coarse->sub;
  const LatinInterfaces *inter = coarse->inter;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->n + 1, &coarse->offset));
  PetscCall(PetscMalloc1(sub->n, &coarse->macro_count));
  coarse->offset[0] = 0;
  coarse->widest    = 0;
  for (PetscInt s = 0; s < sub->n; s++) {
    coarse->macro_count[s] = 0;
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) coarse->macro_count[s] += coarse->macro->of[f].modes;
    coarse->offset[s + 1] = coarse->offset[s] + coarse->macro_count[s] + inter->primal_offset[s + 1] - inter->primal_offset[s];
    coarse->widest        = PetscMax(coarse->widest, coarse->offset[s + 1] - coarse->offset[s]);
  }
  PetscCall(PetscMalloc3(coarse->offset[sub->n], &coarse->global, coarse->offset[sub->n], &coarse->q, coarse->offset[sub->n], &coarse->u));
  PetscFunctionReturn(0);
}

/* Sets the global numbers: of each rank, its macros[] macro modes, then its primal dofs, numbered in table[] */
static void LatinCoarseGlobal(LatinCoarse *coarse, PetscMPIInt size, const PetscInt macros[], const PetscInt table[])
{
  const LatinSubdomains *sub   = coarse->sub;
  const LatinInterfaces *inter = coarse->inter;
  PetscInt               count = 0;

  for (PetscInt s = 0; s < sub->n; s++) {
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
      const PetscMPIInt owner = LatinSubdomainRank(sub, size, PetscMin(sub->first + s, inter->interface[f].neighbour));

      for (PetscInt k = 0; k < coarse->macro->of[f].modes; k++) coarse->global[count++] = coarse->rank_start[owner] + coarse->macro->of[f].number + k;
    }
    for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++) {
      const PetscInt m = inter->share_offset[i + 1] - inter->share_offset[i], leader = inter->component[i];
      PetscInt       next;
      PetscMPIInt    owner;

      if (leader < 0) continue;
      owner = LatinSubdomainRank(sub, size, inter->share_list[inter->share_offset[i] + leader]);
      next  = coarse->rank_start[owner] + macros[owner] + table[inter->table_offset[i] + leader * m + leader] - 1;
      for (PetscInt c = 0; c < sub->bs; c++)
        if (!sub->fixed[sub->bs * i + c]) coarse->global[count++] = next++;
    }
  }
}

/* Numbers the coarse dofs of the subdomains. Collective on sub->object */
PetscErrorCode LatinCoarseNumber(LatinCoarse *coarse)
{
  const LatinSubdomains *sub  = coarse->sub;
  MPI_Comm               comm = PetscObjectComm(sub->object);
  PetscInt              *table, *macros;
  PetscMPIInt            size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscCalloc1(coarse->inter->table_offset[sub->copies], &table));
  PetscCall(LatinCoarseNumberPrimal_Private(coarse, table));
  PetscCall(PetscMalloc1(size, &macros));
  PetscCall(PetscLayoutCreateFromSizes(comm, coarse->macro->modes_local + coarse->primal_local, PETSC_DETERMINE, 1, &coarse->map));
  PetscCall(PetscLayoutGetRanges(coarse->map, &coarse->rank_start));
  PetscCallMPI(MPI_Allgather(&coarse->macro->modes_local, 1, MPIU_INT, macros, 1, MPIU_INT, comm));
  coarse->primal_global = coarse->rank_start[size] - coarse->macro->modes_global;
  PetscCall(LatinCoarseOffsets_Private(coarse));
  LatinCoarseGlobal(coarse, size, macros, table);
  PetscCall(PetscFree(macros));
  PetscCall(PetscFree(table));
  PetscFunctionReturn(0);
}
