#include "coarse/tree.h"

/*
   How the fronts of the ranks are joined. Every rank makes the same plan:

   1. Ranks are the vertices of a graph, whose edges are as heavy as the number of unknowns that two ranks share.
   2. The heaviest edges that do not meet pair ranks; a pair is a vertex of the next graph; and so on, until no two share anything.
   3. A group of ranks has one joint less than ranks, so each rank gets one at most. The higher a joint, the larger is its front: it goes to a rank that
      shares few unknowns, and so has a small factor of its part.
   4. An unknown is eliminated at the level of the graph where all ranks that have it are in one group: no joint above has it.
   5. Lists of unknowns go the way that fronts will go: so the rows of each front are known, and its cost.
*/

#define LATIN_TREE_RATE      5e9  /* additions and multiplications of dense blocks, a second; the choice of the solver alone depends on it */
#define LATIN_TREE_BANDWIDTH 1e10 /* bytes of a factor that a core reads in a second */
#define LATIN_TREE_LATENCY   2e-6 /* seconds of a message */
/* messages of a rank in a solve that all ranks share, for each doubling of the ranks; MUMPS: 18 to 55 on 4, 40 to 88 on 8 ranks */
#define LATIN_TREE_MESSAGES 10
/* efficiency of the ranks in a factorisation that all share; MUMPS: 0.46 to 0.65, before ranks wait for each other */
#define LATIN_TREE_SHARE 0.25
/* most time that the tree may take, relative to that, for its memory: on 16 ranks MUMPS makes the peak of a rank 1.7 to 2.4 times as large */
#define LATIN_TREE_LONGER  2.0
#define LATIN_TREE_SURFACE 1.5 /* times the unknowns on the surface of a cube of elements: elements that share more lie apart */

typedef struct {
  PetscInt a, b, shared; /* two ranks a < b, and the number of unknowns that they share */
} LatinEdge;

/* Shared unknown, sorted in the order in which joints eliminate them: level of the joint, global number, row in the part */
typedef struct {
  PetscInt level, number, row;
} LatinShared;

static int LatinEdgeHeavier(const void *p, const void *q)
{
  const LatinEdge *e = (const LatinEdge *)p, *f = (const LatinEdge *)q;

  if (e->shared != f->shared) return e->shared > f->shared ? -1 : 1;
  if (e->a != f->a) return e->a < f->a ? -1 : 1;
  return e->b < f->b ? -1 : e->b > f->b;
}

static int LatinEdgeCompare(const void *p, const void *q)
{
  const LatinEdge *e = (const LatinEdge *)p, *f = (const LatinEdge *)q;

  if (e->a != f->a) return e->a < f->a ? -1 : 1;
  return e->b < f->b ? -1 : e->b > f->b;
}

static int LatinSharedCompare(const void *p, const void *q)
{
  const LatinShared *a = (const LatinShared *)p, *b = (const LatinShared *)q;

  if (a->level != b->level) return a->level < b->level ? -1 : 1;
  return a->number < b->number ? -1 : a->number > b->number;
}

/* Gathers all edges on every rank. Collective on map */
static PetscErrorCode LatinTreeGraph_Private(ISLocalToGlobalMapping map, PetscInt *edges, LatinEdge **edge)
{
  MPI_Comm    comm = PetscObjectComm((PetscObject)map);
  PetscMPIInt rank, size, mine = 0, all = 0, *count, *start;
  PetscInt    near, *procs, *shared, **rows;
  LatinEdge  *own;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(ISLocalToGlobalMappingGetInfo(map, &near, &procs, &shared, &rows));
  PetscCall(PetscMalloc3(near, &own, size, &count, size, &start));
  for (PetscInt p = 0; p < near; p++)
    if (procs[p] > rank) own[mine++] = (LatinEdge){.a = rank, .b = procs[p], .shared = shared[p]};
  PetscCall(ISLocalToGlobalMappingRestoreInfo(map, &near, &procs, &shared, &rows));
  mine *= 3;
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_INT, count, 1, MPI_INT, comm));
  for (PetscMPIInt r = 0; r < size; r++) {
    start[r] = all;
    all += count[r];
  }
  *edges = all / 3;
  PetscCall(PetscMalloc1(*edges, edge));
  PetscCallMPI(MPI_Allgatherv(own, mine, MPIU_INT, *edge, count, start, MPIU_INT, comm));
  PetscCall(PetscFree3(own, count, start));
  PetscFunctionReturn(0);
}

/*
   Joins two groups, named by their lowest ranks a < b, at one of their two ranks without a joint: the one that shares more. has[]: rank with the front
   of a group; idle[]: its rank without a joint
*/
static PetscErrorCode LatinTreeMeet_Private(LatinTree *tree, PetscInt level, PetscInt a, PetscInt b, const PetscInt shared[], PetscMPIInt has[], PetscMPIInt idle[])
{
  const PetscBool   first = (PetscBool)(shared[idle[a]] >= shared[idle[b]]);
  const PetscMPIInt at = idle[first ? a : b], other = idle[first ? b : a];

  PetscFunctionBegin;
  if (has[a] == tree->rank || has[b] == tree->rank) *(tree->joint ? &tree->joint->to : &tree->to) = at;
  if (at == tree->rank) {
    PetscCall(PetscNew(&tree->joint));
    *tree->joint = (LatinJoint){
      .from = {has[a], has[b]},
        .to = -1, .level = level
    };
  }
  has[a]  = at;
  idle[a] = other;
  PetscFunctionReturn(0);
}

/* Contracts the edges: those of groups that have joined become one, in order; to[]: lowest rank of the new group, -1: not joined. Returns their number */
static PetscInt LatinTreeContract(PetscInt edges, LatinEdge edge[], const PetscInt to[])
{
  PetscInt kept = 0;

  for (PetscInt e = 0; e < edges; e++) {
    const PetscInt a = to[edge[e].a] < 0 ? edge[e].a : to[edge[e].a], b = to[edge[e].b] < 0 ? edge[e].b : to[edge[e].b];

    edge[e] = (LatinEdge){.a = PetscMin(a, b), .b = PetscMax(a, b), .shared = edge[e].shared};
  }
  qsort(edge, (size_t)edges, sizeof(*edge), LatinEdgeCompare);
  for (PetscInt e = 0; e < edges; e++) {
    if (edge[e].a == edge[e].b) continue;
    if (kept && !LatinEdgeCompare(&edge[kept - 1], &edge[e])) edge[kept - 1].shared += edge[e].shared;
    else edge[kept++] = edge[e];
  }
  return kept;
}

/*
   Finds the joint of this rank, and the ranks that take its part and the contribution block of its joint. met[]: level at which it gets into one group
   with each other rank, 0: never
*/
static PetscErrorCode LatinTreePair_Private(LatinTree *tree, PetscInt edges, LatinEdge edge[], PetscInt met[])
{
  PetscMPIInt size, *has, *idle;
  PetscInt   *to, *group, *shared;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(tree->comm, &size));
  PetscCall(PetscMalloc4(size, &to, size, &group, size, &has, size, &idle));
  PetscCall(PetscCalloc1(size, &shared));
  for (PetscInt e = 0; e < edges; e++) {
    shared[edge[e].a] += edge[e].shared;
    shared[edge[e].b] += edge[e].shared;
  }
  for (PetscMPIInt r = 0; r < size; r++) group[r] = has[r] = idle[r] = r;
  tree->to = -1;
  for (PetscInt level = 1; edges; edges = LatinTreeContract(edges, edge, to), level++) {
    for (PetscMPIInt r = 0; r < size; r++) to[r] = -1;
    qsort(edge, (size_t)edges, sizeof(*edge), LatinEdgeHeavier);
    for (PetscInt e = 0; e < edges; e++) {
      if (to[edge[e].a] >= 0 || to[edge[e].b] >= 0) continue;
      to[edge[e].a] = to[edge[e].b] = edge[e].a;
      PetscCall(LatinTreeMeet_Private(tree, level, edge[e].a, edge[e].b, shared, has, idle));
    }
    for (PetscMPIInt r = 0; r < size; r++)
      if (to[group[r]] >= 0) group[r] = to[group[r]];
    for (PetscMPIInt r = 0; r < size; r++)
      if (!met[r] && r != tree->rank && group[r] == group[tree->rank]) met[r] = level;
  }
  PetscCall(PetscFree(shared));
  PetscCall(PetscFree4(to, group, has, idle));
  PetscFunctionReturn(0);
}

/* Sets the level at which each row of the part of this rank is eliminated; 0 if no other rank has it. level[n] is zero before. Collective on map */
static PetscErrorCode LatinTreeLevels_Private(ISLocalToGlobalMapping map, const PetscInt met[], PetscInt level[])
{
  PetscInt near, *procs, *shared, **rows;

  PetscFunctionBegin;
  PetscCall(ISLocalToGlobalMappingGetInfo(map, &near, &procs, &shared, &rows));
  for (PetscInt p = 0; p < near; p++)
    for (PetscInt k = 0; k < shared[p]; k++) level[rows[p][k]] = PetscMax(level[rows[p][k]], met[procs[p]]);
  PetscCall(ISLocalToGlobalMappingRestoreInfo(map, &near, &procs, &shared, &rows));
  PetscFunctionReturn(0);
}

/* Sets tree->owned, tree->rest and tree->row from the rows of the part. *list: the shared ones, which the caller frees. Collective on tree->comm */
static PetscErrorCode LatinTreeRows_Private(LatinTree *tree, ISLocalToGlobalMapping map, PetscLayout layout, const PetscInt level[], LatinShared **list)
{
  const PetscInt *number;
  PetscInt        owned = 0, *sorted;
  PetscMPIInt     wrong = 0;
  LatinShared    *l;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(tree->n, &tree->owned, tree->n, &tree->row));
  PetscCall(PetscMalloc1(tree->n, list));
  PetscCall(PetscMalloc1(tree->n, &sorted));
  l = *list;
  PetscCall(ISLocalToGlobalMappingGetIndices(map, &number));
  for (PetscInt r = 0; r < tree->n; r++) {
    const PetscBool own = (PetscBool)(number[r] >= layout->rstart && number[r] < layout->rend);

    tree->owned[r] = own ? number[r] - layout->rstart : -1;
    owned += own ? 1 : 0;
    sorted[r] = number[r];
    if (level[r]) l[tree->rest++] = (LatinShared){.level = level[r], .number = number[r], .row = r};
  }
  PetscCall(ISLocalToGlobalMappingRestoreIndices(map, &number));
  PetscCall(PetscSortInt(tree->n, sorted));
  for (PetscInt r = 0; r < tree->n; r++)
    if (sorted[r] < 0 || (r && sorted[r] == sorted[r - 1])) wrong = 1;
  PetscCall(PetscFree(sorted));
  if (tree->rest) qsort(l, (size_t)tree->rest, sizeof(*l), LatinSharedCompare);
  for (PetscInt i = 0; i < tree->rest; i++) tree->row[i] = l[i].row;
  if (owned != layout->n) wrong = 1;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &wrong, 1, MPI_INT, MPI_MAX, tree->comm));
  PetscCheck(!wrong, tree->comm, PETSC_ERR_SUP, LATIN_TREE ": a rank owns rows that its local matrix does not have, or has one twice; use another solver of the matrix");
  PetscFunctionReturn(0);
}

/* Sets the rows of a joint from the lists of its groups, which are freed. *list: the rows */
static PetscErrorCode LatinJointMerge_Private(LatinJoint *joint, LatinShared *lists[2], LatinShared **list)
{
  const PetscInt m = joint->n[0], t = joint->n[1];

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(m + t, list));
  PetscCall(PetscMalloc1(m + t, &joint->at));
  for (PetscInt i = 0, k = 0; i < m || k < t; joint->rows++) {
    const int          order = k == t ? -1 : i == m ? 1 : LatinSharedCompare(&lists[0][i], &lists[1][k]);
    const LatinShared *next  = order > 0 ? &lists[1][k] : &lists[0][i];

    (*list)[joint->rows] = *next;
    joint->interior += next->level == joint->level ? 1 : 0;
    if (order <= 0) joint->at[i++] = joint->rows;
    if (order >= 0) joint->at[m + k++] = joint->rows;
  }
  PetscCall(PetscFree(lists[0]));
  PetscCall(PetscFree(lists[1]));
  PetscFunctionReturn(0);
}

/* Adds the cost of a joint, which comes after the costs of[] of both groups. path: operations, entries, messages along the longest path */
static void LatinJointCost(const LatinJoint *joint, PetscReal of[2][3], PetscReal path[3], LatinTreeCost *cost)
{
  const PetscReal in = (PetscReal)joint->interior, out = (PetscReal)(joint->rows - joint->interior);
  const PetscReal operations = in * (in * in / 6.0 + in * out / 2.0 + out * out / 2.0), entries = in * (in / 2.0 + out);

  path[0] = PetscMax(of[0][0], of[1][0]) + operations;
  path[1] = PetscMax(of[0][1], of[1][1]) + entries;
  path[2] = PetscMax(of[0][2], of[1][2]) + 1.0;
  cost->operations += operations;
  cost->entries += entries;
  cost->most = PetscMax(cost->most, (PetscReal)joint->rows);
}

/* Sums the cost over all ranks and predicts the times. path: that of this rank. Collective on tree->comm */
static PetscErrorCode LatinTreeCost_Private(LatinTree *tree, const PetscReal path[3])
{
  PetscReal      sum[2] = {tree->cost.operations, tree->cost.entries}, sent = tree->to >= 0 && tree->to != tree->rank ? 1.0 : 0.0, most[5];
  LatinTreeCost *cost = &tree->cost;
  PetscMPIInt    ranks;
  PetscReal      power;

  PetscFunctionBegin;
  if (tree->joint) sent += (tree->joint->from[0] != tree->rank ? 1.0 : 0.0) + (tree->joint->from[1] != tree->rank ? 1.0 : 0.0) + (tree->joint->to >= 0 ? 1.0 : 0.0);
  for (PetscInt k = 0; k < 3; k++) most[k] = path[k];
  most[3] = tree->cost.most;
  most[4] = sent;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, tree->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 5, MPIU_REAL, MPIU_MAX, tree->comm));
  PetscCallMPI(MPI_Comm_size(tree->comm, &ranks));
  power         = PetscMax(1.0, LATIN_TREE_SHARE * ranks);
  *cost         = (LatinTreeCost){.operations = sum[0], .entries = sum[1], .path_operations = most[0], .path_entries = most[1], .path_messages = most[2], .most = most[3], .messages = most[4]};
  cost->seconds = cost->path_operations / LATIN_TREE_RATE + LATIN_TREE_STAGES * (16.0 * cost->path_entries / LATIN_TREE_BANDWIDTH + 2.0 * cost->path_messages * LATIN_TREE_LATENCY);
  cost->shared  = cost->operations / (power * LATIN_TREE_RATE) + LATIN_TREE_STAGES * (16.0 * cost->entries / (power * LATIN_TREE_BANDWIDTH) + LATIN_TREE_MESSAGES * PetscLog2Real((PetscReal)ranks) * LATIN_TREE_LATENCY);
  PetscFunctionReturn(0);
}

/* Sends a list of unknowns, with the cost that they have taken, to another rank */
static PetscErrorCode LatinTreeSend_Private(const LatinTree *tree, PetscMPIInt to, PetscInt n, const LatinShared list[], const PetscReal path[3])
{
  PetscMPIInt length;

  PetscFunctionBegin;
  if (to < 0) PetscFunctionReturn(0);
  PetscCall(PetscMPIIntCast(3 * n, &length));
  PetscCallMPI(MPI_Send(&n, 1, MPIU_INT, to, 0, tree->comm));
  PetscCallMPI(MPI_Send(path, 3, MPIU_REAL, to, 0, tree->comm));
  PetscCallMPI(MPI_Send(list, length, MPIU_INT, to, 0, tree->comm));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinTreeReceive_Private(const LatinTree *tree, PetscMPIInt from, PetscInt *n, LatinShared **list, PetscReal path[3])
{
  PetscMPIInt length;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Recv(n, 1, MPIU_INT, from, 0, tree->comm, MPI_STATUS_IGNORE));
  PetscCallMPI(MPI_Recv(path, 3, MPIU_REAL, from, 0, tree->comm, MPI_STATUS_IGNORE));
  PetscCall(PetscMalloc1(*n, list));
  PetscCall(PetscMPIIntCast(3 * *n, &length));
  PetscCallMPI(MPI_Recv(*list, length, MPIU_INT, from, 0, tree->comm, MPI_STATUS_IGNORE));
  PetscFunctionReturn(0);
}

/* Sets the rows of the joint, in the order of elimination, and the cost, of all ranks. Takes over the list of the part. Collective on tree->comm */
static PetscErrorCode LatinTreeLists_Private(LatinTree *tree, LatinShared *list)
{
  PetscReal    path[3] = {0.0, 0.0, 0.0}, of[2][3] = {{0.0}};
  PetscInt     widest   = tree->rest;
  LatinShared *lists[2] = {NULL, NULL}, *rows;

  PetscFunctionBegin;
  if (tree->to != tree->rank) {
    PetscCall(LatinTreeSend_Private(tree, tree->to, tree->rest, list, path));
    PetscCall(PetscFree(list));
  }
  if (tree->joint) {
    LatinJoint *joint = tree->joint;

    for (PetscInt k = 0; k < 2; k++) {
      if (joint->from[k] == tree->rank) {
        joint->n[k] = tree->rest;
        lists[k]    = list;
      } else PetscCall(LatinTreeReceive_Private(tree, joint->from[k], &joint->n[k], &lists[k], of[k]));
    }
    PetscCall(LatinJointMerge_Private(joint, lists, &rows));
    LatinJointCost(joint, of, path, &tree->cost);
    PetscCall(LatinTreeSend_Private(tree, joint->to, joint->rows - joint->interior, rows + joint->interior, path));
    PetscCall(PetscFree(rows));
    PetscCall(PetscMalloc1(joint->rows, &joint->x));
    widest = PetscMax(widest, joint->rows);
  }
  PetscCall(PetscMalloc2(tree->n, &tree->g, widest, &tree->w));
  PetscCall(LatinTreeCost_Private(tree, path));
  PetscFunctionReturn(0);
}

/* Makes the plan for parts with rows `map` of a matrix with row layout `layout`. Collective on map */
PetscErrorCode LatinTreePlan_Private(ISLocalToGlobalMapping map, PetscLayout layout, LatinTree *tree)
{
  PetscInt     edges = 0, *level, *met;
  PetscMPIInt  size;
  LatinEdge   *edge;
  LatinShared *list;

  PetscFunctionBegin;
  *tree = (LatinTree){0};
  PetscCallMPI(MPI_Comm_dup(PetscObjectComm((PetscObject)map), &tree->comm));
  PetscCall(ISLocalToGlobalMappingGetSize(map, &tree->n));
  PetscCallMPI(MPI_Comm_rank(tree->comm, &tree->rank));
  PetscCallMPI(MPI_Comm_size(tree->comm, &size));
  PetscCall(PetscCalloc2(tree->n, &level, size, &met));
  PetscCall(LatinTreeGraph_Private(map, &edges, &edge));
  PetscCall(LatinTreePair_Private(tree, edges, edge, met));
  PetscCall(PetscFree(edge));
  PetscCall(LatinTreeLevels_Private(map, met, level));
  PetscCall(LatinTreeRows_Private(tree, map, layout, level, &list));
  PetscCall(PetscFree2(level, met));
  PetscCall(LatinTreeLists_Private(tree, list));
  PetscFunctionReturn(0);
}

/*
   Finds whether the elements of a rank lie apart from each other, so that its fronts are nearly those of a dense matrix. A cube of m elements shares a part
   m^(-1/3) of its unknowns with others. Collective on map
*/
static PetscErrorCode LatinTreeApart_Private(ISLocalToGlobalMapping map, PetscInt rows, PetscInt elements, PetscBool *apart)
{
  MPI_Comm    comm   = PetscObjectComm((PetscObject)map);
  PetscReal   sum[2] = {0.0, (PetscReal)elements}; /* unknowns of one rank alone; elements */
  PetscInt    n, *ranks;
  PetscMPIInt size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(ISLocalToGlobalMappingGetNodeInfo(map, &n, &ranks, NULL));
  for (PetscInt i = 0; i < n; i++) sum[0] += ranks[i] == 1 ? 1.0 : 0.0;
  PetscCall(ISLocalToGlobalMappingRestoreNodeInfo(map, &n, &ranks, NULL));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, comm));
  *apart = (PetscBool)((PetscReal)rows - sum[0] > LATIN_TREE_SURFACE * PetscPowReal(sum[1] / (PetscReal)size, -1.0 / 3.0) * (PetscReal)rows);
  PetscCall(PetscInfo(map, "coarse problem: %g of %" PetscInt_FMT " unknowns belong to one rank alone\n", (double)sum[0], rows));
  PetscFunctionReturn(0);
}

/*
   Sets *pays: whether the elements of a rank lie together, and the tree takes, by prediction, at most LATIN_TREE_LONGER times as long as a factorisation
   that all ranks share. elements: their number on this rank; number[n]: rows of the part of this rank; there is no matrix yet. Collective on comm
*/
PetscErrorCode LatinTreePays(MPI_Comm comm, PetscInt elements, PetscInt n, const PetscInt number[], PetscLayout layout, PetscBool *pays)
{
  ISLocalToGlobalMapping map;
  LatinTree              tree;
  PetscBool              apart = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(ISLocalToGlobalMappingCreate(comm, 1, n, number, PETSC_USE_POINTER, &map));
  PetscCall(LatinTreeApart_Private(map, layout->N, elements, &apart));
  *pays = (PetscBool)!apart;
  if (*pays) {
    PetscCall(LatinTreePlan_Private(map, layout, &tree));
    *pays = (PetscBool)(tree.cost.seconds <= LATIN_TREE_LONGER * tree.cost.shared);
    PetscCall(PetscInfo(map, "coarse problem, predicted: fronts of the ranks %g s, a factorisation by all ranks %g s\n", (double)tree.cost.seconds, (double)tree.cost.shared));
    PetscCall(LatinTreeReset_Private(&tree));
  }
  PetscCall(ISLocalToGlobalMappingDestroy(&map));
  PetscFunctionReturn(0);
}
