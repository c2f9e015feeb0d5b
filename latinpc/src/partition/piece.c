#include "partition/latinpartition.h"

/*
   The piece of the structure that a rank works on: the nodes of its subdomains, layer 0, and their neighbours, layer 1 of the halo, with all links at
   either; the other ends of these are layer 2. Arrays are as long as the piece; data comes from the ranks that own it (partition/directory.c).
*/

/* Sorts *n numbers, removes duplicates and those in the sorted list out[m] */
static PetscErrorCode LatinPieceWithout_Private(PetscInt *n, PetscInt number[], PetscInt m, const PetscInt out[])
{
  PetscInt kept = 0;

  PetscFunctionBegin;
  PetscCall(PetscSortRemoveDupsInt(n, number));
  for (PetscInt i = 0, k = 0; i < *n; i++) {
    while (k < m && out[k] < number[i]) k++;
    if (k == m || out[k] != number[i]) number[kept++] = number[i];
  }
  *n = kept;
  PetscFunctionReturn(0);
}

/* Creates *link, the global numbers of the links at n nodes node[] of any rank, ascending, without duplicates. Collective on structure */
static PetscErrorCode LatinPieceLinks_Private(LatinStructure structure, const LatinDirectory *directory, PetscInt n, const PetscInt node[], PetscInt *links, PetscInt **link)
{
  MPI_Comm           comm = PetscObjectComm((PetscObject)structure);
  const PetscSFNode *at;
  PetscSFNode       *from;
  PetscInt          *all, *mine, k = 0;
  PetscSF            nodes, lists;

  PetscFunctionBegin;
  PetscCall(LatinSFFetch_Private(comm, structure->nodes_local, n, node, &nodes));
  PetscCall(PetscMalloc2(2 * structure->nodes_local, &all, 2 * n, &mine));
  for (PetscInt v = 0; v < structure->nodes_local; v++) {
    all[2 * v]     = directory->offset[v];
    all[2 * v + 1] = directory->offset[v + 1];
  }
  PetscCall(LatinSFBcast_Private(nodes, 2, MPIU_INT, all, mine));
  PetscCall(PetscSFGetGraph(nodes, NULL, NULL, NULL, &at));
  *links = 0;
  for (PetscInt i = 0; i < n; i++) *links += mine[2 * i + 1] - mine[2 * i];
  PetscCall(PetscMalloc1(*links, &from));
  PetscCall(PetscMalloc1(*links, link));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = mine[2 * i]; j < mine[2 * i + 1]; j++) {
      from[k].rank    = at[i].rank;
      from[k++].index = j;
    }
  PetscCall(PetscSFCreate(comm, &lists));
  PetscCall(PetscSFSetGraph(lists, directory->offset[structure->nodes_local], *links, NULL, PETSC_OWN_POINTER, from, PETSC_OWN_POINTER));
  PetscCall(LatinSFBcast_Private(lists, 1, MPIU_INT, directory->incident, *link));
  PetscCall(PetscSFDestroy(&lists));
  PetscCall(PetscSFDestroy(&nodes));
  PetscCall(PetscFree2(all, mine));
  PetscCall(PetscSortRemoveDupsInt(links, *link));
  PetscFunctionReturn(0);
}

/* Creates *own, the global numbers of the nodes of the subdomains of this rank, ascending. Collective on structure */
static PetscErrorCode LatinPieceOwn_Private(LatinStructure structure, PetscInt parts, const PetscInt of_node[], IS *own)
{
  MPI_Comm    comm = PetscObjectComm((PetscObject)structure);
  PetscMPIInt size;
  PetscInt   *rank;
  IS          to;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMalloc1(structure->nodes_local, &rank));
  for (PetscInt v = 0; v < structure->nodes_local; v++) rank[v] = LatinPieceRank(of_node[v], parts, size);
  PetscCall(ISCreateGeneral(comm, structure->nodes_local, rank, PETSC_OWN_POINTER, &to));
  PetscCall(ISBuildTwoSided(to, NULL, own));
  PetscCall(ISDestroy(&to));
  PetscCall(ISSort(*own));
  PetscFunctionReturn(0);
}

/* Creates *ghost, layer 1 of the halo, which are the neighbours of the own nodes, and *link, the links at both. Collective on structure */
static PetscErrorCode LatinPieceGrow_Private(LatinStructure structure, const LatinDirectory *directory, PetscInt n, const PetscInt own[], PetscInt *around, PetscInt **ghost, PetscInt *links, PetscInt **link)
{
  PetscInt near, more, *first, *second;
  PetscSF  sf;

  PetscFunctionBegin;
  PetscCall(LatinPieceLinks_Private(structure, directory, n, own, &near, &first));
  PetscCall(LatinSFFetch_Private(PetscObjectComm((PetscObject)structure), structure->links_local, near, first, &sf));
  *around = 2 * near;
  PetscCall(PetscMalloc1(*around, ghost));
  PetscCall(LatinSFBcast_Private(sf, 2, MPIU_INT, structure->nodes, *ghost));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(LatinPieceWithout_Private(around, *ghost, n, own));
  PetscCall(LatinPieceLinks_Private(structure, directory, *around, *ghost, &more, &second));
  *links = near + more;
  PetscCall(PetscMalloc1(*links, link));
  PetscCall(PetscArraycpy(*link, first, near));
  PetscCall(PetscArraycpy(*link + near, second, more));
  PetscCall(PetscSortRemoveDupsInt(links, *link));
  PetscCall(PetscFree(first));
  PetscCall(PetscFree(second));
  PetscFunctionReturn(0);
}

/* Lists the links at each node, ascending */
PetscErrorCode LatinCutIncidence_Private(LatinCut *cut)
{
  PetscFunctionBegin;
  PetscCall(PetscCalloc2(cut->nodes + 2, &cut->offset, 2 * cut->links, &cut->incident));
  for (PetscInt i = 0; i < 2 * cut->links; i++) cut->offset[cut->ends[i] + 2]++;
  for (PetscInt v = 0; v < cut->nodes; v++) cut->offset[v + 2] += cut->offset[v + 1];
  for (PetscInt i = 0; i < 2 * cut->links; i++) cut->incident[cut->offset[cut->ends[i] + 1]++] = i / 2;
  PetscFunctionReturn(0);
}

/* Lists the nodes of the piece: global numbers and layers. Makes the ends of links local numbers */
static PetscErrorCode LatinPieceNodes_Private(LatinCut *cut, PetscInt n, const PetscInt own[], PetscInt m, const PetscInt ghost[])
{
  PetscFunctionBegin;
  PetscCall(PetscMalloc1(2 * cut->links, &cut->number));
  PetscCall(LatinPlaces_Private(2 * cut->links, cut->ends, &cut->nodes, cut->number, cut->ends));
  PetscCall(PetscRealloc((size_t)cut->nodes * sizeof(*cut->number), &cut->number));
  PetscCall(PetscMalloc2(cut->nodes, &cut->of_node, cut->nodes, &cut->layer));
  for (PetscInt v = 0, i = 0, j = 0; v < cut->nodes; v++) {
    while (i < n && own[i] < cut->number[v]) i++;
    while (j < m && ghost[j] < cut->number[v]) j++;
    cut->layer[v] = i < n && own[i] == cut->number[v] ? 0 : j < m && ghost[j] == cut->number[v] ? 1 : 2;
  }
  PetscFunctionReturn(0);
}

/* Creates the piece of this rank, from the subdomains of_node[nodes_local] of the nodes of the structure. Collective on structure */
PetscErrorCode LatinPieceCreate_Private(LatinStructure structure, const LatinDirectory *directory, const PetscInt of_node[], LatinCut *cut)
{
  MPI_Comm        comm = PetscObjectComm((PetscObject)structure);
  const PetscInt *own;
  PetscInt        n, around, *ghost, *link;
  IS              is;

  PetscFunctionBegin;
  cut->comm = comm;
  cut->dim  = structure->dim;
  PetscCall(LatinPieceOwn_Private(structure, cut->parts, of_node, &is));
  PetscCall(ISGetLocalSize(is, &n));
  PetscCall(ISGetIndices(is, &own));
  PetscCall(LatinPieceGrow_Private(structure, directory, n, own, &around, &ghost, &cut->links, &link));
  PetscCall(LatinSFFetch_Private(comm, structure->links_local, cut->links, link, &cut->link_sf));
  PetscCall(PetscFree(link));
  PetscCall(PetscMalloc2(2 * cut->links, &cut->ends, cut->dim * cut->links, &cut->direction));
  PetscCall(LatinSFBcast_Private(cut->link_sf, 2, MPIU_INT, structure->nodes, cut->ends));
  PetscCall(LatinSFBcast_Private(cut->link_sf, cut->dim, MPIU_REAL, structure->direction, cut->direction));
  PetscCall(LatinPieceNodes_Private(cut, n, own, around, ghost));
  PetscCall(PetscFree(ghost));
  PetscCall(ISRestoreIndices(is, &own));
  PetscCall(ISDestroy(&is));
  PetscCall(LatinSFFetch_Private(comm, structure->nodes_local, cut->nodes, cut->number, &cut->node_sf));
  PetscCall(PetscFree(cut->number));
  PetscCall(PetscMalloc1(cut->dim * cut->nodes, &cut->fixed));
  PetscCall(LatinSFBcast_Private(cut->node_sf, cut->dim, LATIN_MPI_BOOL, structure->fixed, cut->fixed));
  PetscCall(LatinSFBcast_Private(cut->node_sf, 1, MPIU_INT, of_node, cut->of_node));
  PetscCall(LatinCutIncidence_Private(cut));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCutDestroy_Private(LatinCut *cut)
{
  PetscFunctionBegin;
  PetscCall(PetscSFDestroy(&cut->link_sf));
  PetscCall(PetscSFDestroy(&cut->node_sf));
  PetscCall(PetscFree2(cut->ends, cut->direction));
  PetscCall(PetscFree2(cut->offset, cut->incident));
  PetscCall(PetscFree2(cut->of_node, cut->layer));
  PetscCall(PetscFree(cut->number));
  PetscCall(PetscFree(cut->fixed));
  PetscFunctionReturn(0);
}
