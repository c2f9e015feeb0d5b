#include "partition/latinpartition.h"
#include <stdlib.h>

/*
   Partition of links from a partition of nodes. A link goes to the subdomain of its nodes; all links between two subdomains go to one of them, so that
   only nodes of the other one are shared. In pieces, the rank of the lower subdomain decides: it has all these links.
*/

/* Returns the number of end nodes in a minus that in b, of `count` links key[] between subdomains a and b. seen[v] == stamp marks counted nodes */
static PetscInt LatinFollowSides(const LatinCut *cut, const PetscInt of_node[], PetscInt a, PetscInt count, const LatinKey key[], PetscInt stamp, PetscInt seen[])
{
  PetscInt more = 0;

  for (PetscInt i = 0; i < 2 * count; i++) {
    const PetscInt v = cut->ends[2 * key[i / 2].number + i % 2];

    if (seen[v] == stamp) continue;
    seen[v] = stamp;
    more += of_node[v] == a ? 1 : -1;
  }
  return more;
}

/*
   Sets part[links]. Links between two subdomains go to the one with more nodes on them, as the nodes of the other are shared; for balance the smaller
   subdomain is favoured. Until they are assigned, links count half in either. part[l]: -1 if another rank decides. Collective on cut->comm
*/
PetscErrorCode LatinFollow_Private(const LatinCut *cut, const PetscInt of_node[], PetscInt part[])
{
  LatinKey   *key;
  PetscInt   *size, *seen, n = 0; /* size: in half links */
  PetscMPIInt rank, ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(cut->comm, &rank));
  PetscCallMPI(MPI_Comm_size(cut->comm, &ranks));
  PetscCall(PetscMalloc1(cut->links, &key));
  PetscCall(PetscCalloc2(cut->parts, &size, cut->nodes, &seen));
  for (PetscInt l = 0; l < cut->links; l++) {
    const PetscInt a = of_node[cut->ends[2 * l]], b = of_node[cut->ends[2 * l + 1]];

    part[l] = -1;
    if (LatinPieceRank(PetscMin(a, b), cut->parts, ranks) != rank) continue;
    size[a]++;
    size[b]++;
    part[l] = a;
    if (a == b) continue;
    key[n].hash     = ((uint64_t)PetscMin(a, b) << 32) + (uint64_t)PetscMax(a, b);
    key[n++].number = l;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, size, (PetscMPIInt)cut->parts, MPIU_INT, MPI_SUM, cut->comm));
  if (n) qsort(key, (size_t)n, sizeof(*key), LatinKeyCompare);
  for (PetscInt i = 0, last; i < n; i = last) {
    const PetscInt a = (PetscInt)(key[i].hash >> 32), b = (PetscInt)(key[i].hash & 0xffffffff);
    PetscInt       to;

    for (last = i; last < n && key[last].hash == key[i].hash; last++) continue;
    /* real: integers could overflow */
    to = LatinFollowSides(cut, of_node, a, last - i, key + i, i + 1, seen) >= 2.0 * (PetscReal)(last - i) * (PetscReal)(size[a] - size[b]) / cut->mean ? a : b;
    for (PetscInt k = i; k < last; k++) part[key[k].number] = to;
    size[a] += to == a ? last - i : i - last;
    size[b] += to == b ? last - i : i - last;
  }
  PetscCall(PetscFree(key));
  PetscCall(PetscFree2(size, seen));
  PetscFunctionReturn(0);
}
