#include "interfaces/latininterfaces.h"

/*
   The subdomains at each node, gathered at every copy of it, and tables of all pairs of them.
*/

/* Creates the SF whose leaves are entries offset[i] to offset[i + 1] of each copy i, and whose roots are those of its node at the owner, from at[2 * i] on */
static PetscErrorCode LatinInterfaceTables_Private(const LatinSubdomains *sub, const PetscInt offset[], const PetscInt at[], PetscInt roots, PetscSF *sf)
{
  const PetscSFNode *where;
  PetscSFNode       *remote;

  PetscFunctionBegin;
  PetscCall(PetscSFGetGraph(sub->node_sf, NULL, NULL, NULL, &where));
  PetscCall(PetscMalloc1(offset[sub->copies], &remote));
  for (PetscInt i = 0; i < sub->copies; i++)
    for (PetscInt j = offset[i]; j < offset[i + 1]; j++) {
      remote[j].rank  = where[i].rank;
      remote[j].index = at[2 * i] + j - offset[i];
    }
  PetscCall(PetscSFCreate(PetscObjectComm(sub->object), sf));
  PetscCall(PetscSFSetGraph(*sf, roots, offset[sub->copies], NULL, PETSC_OWN_POINTER, remote, PETSC_OWN_POINTER));
  PetscFunctionReturn(0);
}

/* Fails if the tables of pairs have more entries than a PetscInt can count. Collective on sub->object */
static PetscErrorCode LatinInterfaceCheckTables_Private(const LatinSubdomains *sub, const PetscInt degree[])
{
  PetscReal sizes[2] = {0.0, 0.0}; /* entries on this rank of the tables of owned nodes, of copies */
  PetscInt  most     = 0;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < sub->nodes_local; i++) sizes[0] += PetscSqr((PetscReal)degree[i]);
  for (PetscInt i = 0; i < sub->copies; i++) {
    sizes[1] += PetscSqr((PetscReal)sub->multiplicity[i]);
    if (sub->multiplicity[i] > sub->multiplicity[most]) most = i;
  }
  LatinAgree(PetscObjectComm(sub->object), PetscMax(sizes[0], sizes[1]) > (PetscReal)PETSC_MAX_INT, PETSC_ERR_SUP,
             "%" PetscInt_FMT " subdomains share node %" PetscInt_FMT ": the list of their pairs has more entries than this PETSc can count. Make fewer subdomains, or build PETSc with 64-bit indices", sub->copies ? sub->multiplicity[most] : -1,
             sub->copies ? sub->node[most] : -1);
  PetscFunctionReturn(0);
}

/*
   Sets share_list, the subdomains at each shared node, increasing, at every copy of it, and position. Creates table_sf. Nodes without a free component
   do not count as shared. Collective on sub->object
*/
PetscErrorCode LatinInterfaceShares_Private(LatinInterfaces *inter)
{
  const LatinSubdomains *sub   = inter->sub;
  const PetscInt         roots = sub->nodes_local;
  const PetscInt        *degree;
  PetscSF                sf;
  PetscInt              *mine, *all, *root, *leaf, entries = 0, tables = 0, gathered = 0, squares = 0;

  PetscFunctionBegin;
  PetscCall(PetscSFComputeDegreeBegin(sub->node_sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sub->node_sf, &degree));
  PetscCall(LatinInterfaceCheckTables_Private(sub, degree));
  PetscCall(PetscMalloc2(2 * roots, &root, 2 * sub->copies, &leaf));
  for (PetscInt i = 0; i < roots; i++) {
    root[2 * i]     = gathered;
    root[2 * i + 1] = squares;
    gathered += degree[i];
    squares += degree[i] * degree[i];
  }
  PetscCall(PetscMalloc2(sub->copies, &mine, gathered, &all));
  for (PetscInt s = 0; s < sub->n; s++)
    for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++) mine[i] = sub->first + s;
  PetscCall(PetscSFGatherBegin(sub->node_sf, MPIU_INT, mine, all));
  PetscCall(PetscSFGatherEnd(sub->node_sf, MPIU_INT, mine, all));
  for (PetscInt i = 0; i < roots; i++) PetscCall(PetscSortInt(degree[i], all + root[2 * i]));
  PetscCall(LatinSFBcast_Private(sub->node_sf, 2, MPIU_INT, root, leaf));

  PetscCall(PetscMalloc2(sub->copies + 1, &inter->share_offset, sub->copies + 1, &inter->table_offset));
  for (PetscInt i = 0; i < sub->copies; i++) {
    const PetscInt m = sub->multiplicity[i] > 1 && LatinNodeFree(sub, i) ? sub->multiplicity[i] : 0;

    inter->share_offset[i] = entries;
    inter->table_offset[i] = tables;
    entries += m;
    tables += m * m;
  }
  inter->share_offset[sub->copies] = entries;
  inter->table_offset[sub->copies] = tables;

  PetscCall(PetscMalloc1(entries, &inter->share_list));
  PetscCall(LatinInterfaceTables_Private(sub, inter->share_offset, leaf, gathered, &sf));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, all, inter->share_list));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(LatinInterfaceTables_Private(sub, inter->table_offset, leaf + 1, squares, &inter->table_sf));
  PetscCall(PetscFree2(mine, all));
  PetscCall(PetscFree2(root, leaf));

  PetscCall(PetscMalloc1(sub->copies, &inter->position));
  for (PetscInt s = 0; s < sub->n; s++)
    for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++) {
      inter->position[i] = 0;
      while (inter->share_offset[i] + inter->position[i] < inter->share_offset[i + 1] && inter->share_list[inter->share_offset[i] + inter->position[i]] < sub->first + s) inter->position[i]++;
    }
  PetscFunctionReturn(0);
}

/* Gathers the rows of tables at all copies. Each copy has filled its own row with nonnegative numbers; the others are zero. Collective on sub->object */
PetscErrorCode LatinInterfaceExchange_Private(const LatinInterfaces *inter, PetscInt table[])
{
  PetscInt *root, roots;

  PetscFunctionBegin;
  PetscCall(PetscSFGetGraph(inter->table_sf, &roots, NULL, NULL, NULL));
  PetscCall(PetscCalloc1(roots, &root));
  PetscCall(LatinSFReduce_Private(inter->table_sf, 1, MPIU_INT, table, root, MPI_MAX));
  PetscCall(LatinSFBcast_Private(inter->table_sf, 1, MPIU_INT, root, table));
  PetscCall(PetscFree(root));
  PetscFunctionReturn(0);
}
