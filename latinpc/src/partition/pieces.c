#include "partition/latinpartition.h"

/*
   Parallel partition. No array is longer than a piece or the number of subdomains.

   1. The distributed graph of the nodes is partitioned (partition/directory.c).
   2. Each rank fetches the piece of its subdomains (partition/piece.c) and makes them connected (partition/connect.c), until none moves.
   3. Links between subdomains are assigned (partition/follow.c).
   4. The result is repaired (partition/repair.c).

   Ranks repair at the same time, each in a region of its own: nodes next to several ranks belong to the lowest of these in even rounds, to the highest
   in odd ones. So gains are exact, and the cost decreases until two rounds move no link.
*/

/*
   Copies changes given[links] of subdomains, -1: unchanged, to the links of the structure, of_link[local], and to all pieces, part[links]. Collective
   on structure
*/
static PetscErrorCode LatinPiecesShare_Private(const LatinCut *cut, PetscInt local, const PetscInt given[], PetscInt of_link[], PetscInt part[])
{
  PetscInt *here;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(local, &here));
  for (PetscInt l = 0; l < local; l++) here[l] = -1;
  PetscCall(LatinSFReduce_Private(cut->link_sf, 1, MPIU_INT, given, here, MPI_MAX));
  for (PetscInt l = 0; l < local; l++)
    if (here[l] >= 0) of_link[l] = here[l];
  PetscCall(PetscFree(here));
  PetscCall(LatinSFBcast_Private(cut->link_sf, 1, MPIU_INT, of_link, part));
  PetscFunctionReturn(0);
}

/* Sets mine[v]: whether this rank may move links at node v: in layers 0 and 1, if it is the lowest, or highest, rank of the node and its neighbours */
static PetscErrorCode LatinPiecesRegion_Private(const LatinCut *cut, PetscBool highest, PetscBool mine[])
{
  PetscMPIInt rank, size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(cut->comm, &rank));
  PetscCallMPI(MPI_Comm_size(cut->comm, &size));
  for (PetscInt v = 0; v < cut->nodes; v++) {
    PetscMPIInt extreme = LatinPieceRank(cut->of_node[v], cut->parts, size);

    for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1] && cut->layer[v] < 2; j++) {
      const PetscInt    l     = cut->incident[j];
      const PetscMPIInt other = LatinPieceRank(cut->of_node[cut->ends[2 * l] + cut->ends[2 * l + 1] - v], cut->parts, size);

      extreme = highest ? PetscMax(extreme, other) : PetscMin(extreme, other);
    }
    mine[v] = (PetscBool)(cut->layer[v] < 2 && extreme == rank);
  }
  PetscFunctionReturn(0);
}

/*
   Computes give[s] and take[s], the links that subdomain s may lose and gain on this rank: an equal share for each rank that may move its links.
   Collective on structure
*/
static PetscErrorCode LatinPiecesRoom_Private(const LatinCut *cut, PetscInt local, const PetscInt of_link[], const PetscBool mine[], const PetscInt part[], PetscInt give[], PetscInt take[])
{
  PetscInt least, most, *ranks = take;

  PetscFunctionBegin;
  LatinRepairBounds(cut, &least, &most);
  PetscCall(PetscArrayzero(give, cut->parts));
  PetscCall(PetscArrayzero(ranks, cut->parts));
  for (PetscInt l = 0; l < local; l++) give[of_link[l]]++;
  for (PetscInt l = 0; l < cut->links; l++)
    if (mine[cut->ends[2 * l]] || mine[cut->ends[2 * l + 1]]) ranks[part[l]] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, give, (PetscMPIInt)cut->parts, MPIU_INT, MPI_SUM, cut->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, ranks, (PetscMPIInt)cut->parts, MPIU_INT, MPI_SUM, cut->comm));
  for (PetscInt s = 0; s < cut->parts; s++) {
    const PetscInt size = give[s], share = PetscMax(ranks[s], 1);

    give[s] = PetscMax(size - least, 0) / share;
    take[s] = PetscMax(most - size, 0) / share;
  }
  PetscFunctionReturn(0);
}

/* Repairs in rounds, until two in a row move no link. Collective on structure */
static PetscErrorCode LatinPiecesRepair_Private(const LatinCut *cut, PetscInt local, PetscInt of_link[], PetscInt part[])
{
  PetscInt  *give, *take, *given, idle = 0;
  PetscBool *mine;

  PetscFunctionBegin;
  PetscCall(PetscMalloc4(cut->parts, &give, cut->parts, &take, cut->links, &given, cut->nodes, &mine));
  for (PetscInt round = 0; idle < 2; round++) {
    PetscInt moves;

    PetscCall(LatinPiecesRegion_Private(cut, (PetscBool)(round % 2), mine));
    PetscCall(LatinPiecesRoom_Private(cut, local, of_link, mine, part, give, take));
    PetscCall(PetscArraycpy(given, part, cut->links));
    PetscCall(LatinRepair_Private(cut, mine, give, take, given, &moves));
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &moves, 1, MPIU_INT, MPI_SUM, cut->comm));
    idle = moves ? 0 : idle + 1;
    for (PetscInt l = 0; l < cut->links; l++)
      if (given[l] == part[l]) given[l] = -1;
    PetscCall(LatinPiecesShare_Private(cut, local, given, of_link, part));
  }
  PetscCall(PetscFree4(give, take, given, mine));
  PetscFunctionReturn(0);
}

/* Partitions the links into `parts` subdomains, some of which may be empty. Collective on structure */
PetscErrorCode LatinPieces_Private(LatinStructure structure, const LatinPartitionRequest *request, PetscInt parts, PetscInt of_link[])
{
  const PetscInt local     = structure->nodes_local;
  LatinDirectory directory = {0};
  LatinCut       cut       = {0};
  PetscInt      *of_node, *part, *given, moved;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(local, &of_node));
  PetscCall(LatinDirectoryCreate_Private(structure, &directory));
  PetscCall(LatinGraphPartition_Private(structure, &directory, request->prefix, parts, of_node));
  do {
    PetscCall(LatinCutDestroy_Private(&cut));
    cut = (LatinCut){.parts = parts, .mean = (PetscReal)structure->links_global / (PetscReal)parts, .corners = request->corners};
    PetscCall(LatinPieceCreate_Private(structure, &directory, of_node, &cut));
    PetscCall(LatinConnect_Private(&cut, local, of_node, &moved));
  } while (moved);
  PetscCall(LatinDirectoryDestroy_Private(&directory));
  PetscCall(PetscFree(of_node));
  PetscCall(PetscMalloc2(cut.links, &part, cut.links, &given));
  PetscCall(LatinFollow_Private(&cut, cut.of_node, given));
  PetscCall(LatinPiecesShare_Private(&cut, structure->links_local, given, of_link, part));
  PetscCall(LatinPiecesRepair_Private(&cut, structure->links_local, of_link, part));
  PetscCall(PetscFree2(part, given));
  PetscCall(LatinCutDestroy_Private(&cut));
  PetscFunctionReturn(0);
}
