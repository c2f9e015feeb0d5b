#include "partition/latinpartition.h"

/*
   Repair of a partition by local search. Graph partitioners ignore directions: the links of a subdomain at a node may span fewer directions than all
   links of the node. Each missing direction is a mechanism of the subdomain, and mechanisms slow down the iteration. Links move between the subdomains
   of one of their nodes while this decreases the sum over nodes of the cost

     node of one subdomain   0
     of two                  1 + directions missing in either of them
     of three or more        1 if it is a corner, which the coarse problem holds; else subdomains - 1 + directions missing

   A move takes one link, or all links of a subdomain at a node; at nodes of very many links only these. It changes the cost at the ends of its links
   alone. The cost is an integer: sweeps over nodes with changed neighbours end when no move is left.

   In a piece of a structure (partition/pieces.c) moves may not touch nodes of other ranks, nor disconnect a subdomain.
*/

#define LATIN_REPAIR_SOFT    1e-2 /* least pivot that counts as a direction, for links of stiffness 1 */
#define LATIN_REPAIR_BALANCE 0.25 /* largest deviation of a subdomain from the mean number of links; with less more iterations, more is not used */
/* links of a node above which they no longer move one by one, which takes their number squared: wheels of 8,000 spokes 0.5 s instead of 3.4 */
#define LATIN_REPAIR_HUB   100
#define LATIN_REPAIR_REACH 64 /* most nodes visited in the search for a path round removed links, which leads through neighbours of neighbours */

typedef struct {
  const LatinCut  *cut;
  const PetscBool *mine; /* [nodes] whether moves may touch a node; NULL: all, and subdomains may become disconnected */
  PetscInt        *part;
  PetscInt        *give, *take;           /* [parts] links that each subdomain may lose and gain */
  PetscInt        *whole, *cost;          /* [nodes] number of directions that all links span, -1: not computed; current cost */
  PetscBool       *due;                   /* [nodes] whether a node is still to be visited */
  PetscInt        *seen, stamp;           /* [nodes] seen[v] == stamp: touched by the move at hand */
  PetscInt        *reached, *queue;       /* work: [nodes], [LATIN_REPAIR_REACH] breadth-first search round a move */
  PetscInt        *touched, *move, *here; /* work: nodes and links of a move; subdomains at a node */
} LatinRepair;

/* Returns the numerical rank of a symmetric positive semidefinite matrix of unit directions, by Cholesky with diagonal pivoting */
static PetscInt LatinRepairRank(PetscInt dim, PetscReal a[3][3])
{
  PetscBool done[3] = {PETSC_FALSE, PETSC_FALSE, PETSC_FALSE};

  for (PetscInt rank = 0; rank < dim; rank++) {
    PetscInt p = -1;

    for (PetscInt c = 0; c < dim; c++)
      if (!done[c] && (p < 0 || a[c][c] > a[p][p])) p = c;
    if (a[p][p] <= LATIN_REPAIR_SOFT) return rank;
    done[p] = PETSC_TRUE;
    for (PetscInt c = 0; c < dim; c++)
      for (PetscInt b = 0; b < dim; b++)
        if (!done[c] && !done[b]) a[c][b] -= a[c][p] * a[b][p] / a[p][p];
  }
  return dim;
}

/* Returns the number of free directions that the links of subdomain `part` span at node v; part < 0: those of all links */
static PetscInt LatinRepairHeld(const LatinRepair *repair, PetscInt v, PetscInt part)
{
  const LatinCut *cut     = repair->cut;
  const PetscInt  dim     = cut->dim;
  PetscReal       a[3][3] = {{0.0}};

  for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
    const PetscInt   l = cut->incident[j];
    const PetscReal *n = cut->direction + dim * l;

    if (part >= 0 && repair->part[l] != part) continue;
    for (PetscInt c = 0; c < dim; c++)
      for (PetscInt b = 0; b < dim; b++)
        if (!cut->fixed[dim * v + c] && !cut->fixed[dim * v + b]) a[c][b] += n[c] * n[b];
  }
  return LatinRepairRank(dim, a);
}

/* Lists the subdomains at a node, in the order of its links; returns their number */
static PetscInt LatinRepairParts(const LatinRepair *repair, PetscInt v, PetscInt parts[])
{
  PetscInt n = 0;

  for (PetscInt j = repair->cut->offset[v]; j < repair->cut->offset[v + 1]; j++) {
    PetscInt i = 0;

    while (i < n && parts[i] != repair->part[repair->cut->incident[j]]) i++;
    if (i == n) parts[n++] = repair->part[repair->cut->incident[j]];
  }
  return n;
}

/* Returns the cost of a node, see above */
static PetscInt LatinRepairCost(const LatinRepair *repair, PetscInt v)
{
  PetscInt *parts = repair->here, n = LatinRepairParts(repair, v, parts), cost = n - 1;

  if (n == 1) return 0;
  if (n > 2 && repair->cut->corners) return 1;
  if (repair->whole[v] < 0) repair->whole[v] = LatinRepairHeld(repair, v, -1);
  for (PetscInt i = 0; i < n; i++) cost += PetscMax(0, repair->whole[v] - LatinRepairHeld(repair, v, parts[i]));
  return cost;
}

/* Lists the end nodes of n links in touched[], without duplicates; returns their number */
static PetscInt LatinRepairTouched(LatinRepair *repair, PetscInt n, const PetscInt move[])
{
  PetscInt count = 0;

  repair->stamp++;
  for (PetscInt i = 0; i < 2 * n; i++) {
    const PetscInt v = repair->cut->ends[2 * move[i / 2] + i % 2];

    if (repair->seen[v] == repair->stamp) continue;
    repair->seen[v]          = repair->stamp;
    repair->touched[count++] = v;
  }
  return count;
}

/*
   Whether subdomain `from` is still connected without the links of a move: a breadth-first search between the `count` touched nodes that it still has,
   of LATIN_REPAIR_REACH nodes at most; longer paths are not found
*/
static PetscBool LatinRepairHoldsTogether(const LatinRepair *repair, PetscInt from, PetscInt count)
{
  const LatinCut *cut   = repair->cut;
  PetscInt       *queue = repair->queue, goals = 0, n = 0;

  for (PetscInt i = 0; i < count; i++) {
    const PetscInt v = repair->touched[i];

    for (PetscInt j = cut->offset[v]; j < cut->offset[v + 1]; j++) {
      if (repair->part[cut->incident[j]] != from) continue;
      repair->reached[v] = -repair->stamp; /* a goal */
      if (!n) queue[n++] = v;
      goals++;
      break;
    }
  }
  if (n) repair->reached[queue[0]] = repair->stamp;
  for (PetscInt i = 0; i < n && goals > 1; i++)
    for (PetscInt j = cut->offset[queue[i]]; j < cut->offset[queue[i] + 1] && goals > 1; j++) {
      const PetscInt l = cut->incident[j], w = cut->ends[2 * l] + cut->ends[2 * l + 1] - queue[i];

      if (repair->part[l] != from || !repair->mine[w] || repair->reached[w] == repair->stamp) continue;
      if (repair->reached[w] == -repair->stamp) goals--;
      repair->reached[w] = repair->stamp;
      if (n < LATIN_REPAIR_REACH) queue[n++] = w;
    }
  return (PetscBool)(goals <= 1);
}

/* Returns the decrease of the cost if n links move to subdomain `to`; 0 if it is at most `least` or the move is not allowed */
static PetscInt LatinRepairGain(LatinRepair *repair, PetscInt n, const PetscInt move[], PetscInt to, PetscInt least)
{
  const PetscInt from = repair->part[move[0]];
  PetscInt       count, gain = 0;

  if (n > repair->give[from] || n > repair->take[to]) return 0;
  count = LatinRepairTouched(repair, n, move);
  for (PetscInt i = 0; i < count; i++) {
    if (repair->mine && !repair->mine[repair->touched[i]]) return 0;
    gain += repair->cost[repair->touched[i]];
  }
  if (gain <= least) return 0;
  for (PetscInt i = 0; i < n; i++) repair->part[move[i]] = to;
  for (PetscInt i = 0; i < count && gain > least; i++) gain -= LatinRepairCost(repair, repair->touched[i]);
  if (repair->mine && gain > least && !LatinRepairHoldsTogether(repair, from, count)) gain = 0;
  for (PetscInt i = 0; i < n; i++) repair->part[move[i]] = from;
  return gain;
}

/* Finds the best move at a node: returns the number of its links best[], 0: none; *to: their new subdomain */
static PetscInt LatinRepairBest(LatinRepair *repair, PetscInt v, const PetscInt parts[], PetscInt n, PetscInt best[], PetscInt *to)
{
  const PetscBool hub  = (PetscBool)(repair->cut->offset[v + 1] - repair->cut->offset[v] > LATIN_REPAIR_HUB);
  PetscInt        most = 0, count = 0;

  for (PetscInt i = 0; i < n; i++) {
    PetscInt m = 0;

    for (PetscInt j = repair->cut->offset[v]; j < repair->cut->offset[v + 1]; j++)
      if (repair->part[repair->cut->incident[j]] == parts[i]) repair->move[m++] = repair->cut->incident[j];
    for (PetscInt k = 0; k < n; k++)
      for (PetscInt single = m > 1 ? -1 : 0; k != i && single < (hub && m > 1 ? 0 : m); single++) {
        const PetscInt *move = single < 0 ? repair->move : repair->move + single, size = single < 0 ? m : 1;
        const PetscInt  gain = LatinRepairGain(repair, size, move, parts[k], most);

        if (gain <= most) continue;
        most  = gain;
        count = size;
        *to   = parts[k];
        for (PetscInt j = 0; j < size; j++) best[j] = move[j];
      }
  }
  return count;
}

/* Makes the best move at a node, if any, and marks its neighbourhood as due */
static PetscBool LatinRepairNode(LatinRepair *repair, PetscInt v, PetscInt parts[], PetscInt best[])
{
  PetscInt n = LatinRepairParts(repair, v, parts), to = -1;

  n = n > 1 ? LatinRepairBest(repair, v, parts, n, best, &to) : 0;
  if (!n) return PETSC_FALSE;
  repair->give[repair->part[best[0]]] -= n;
  repair->take[repair->part[best[0]]] += n;
  repair->give[to] += n;
  repair->take[to] -= n;
  for (PetscInt i = 0; i < n; i++) repair->part[best[i]] = to;
  n = LatinRepairTouched(repair, n, best);
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt w = repair->touched[i];

    repair->cost[w] = LatinRepairCost(repair, w);
    for (PetscInt j = repair->cut->offset[w]; j < repair->cut->offset[w + 1]; j++)
      for (PetscInt s = 0; s < 2; s++) repair->due[repair->cut->ends[2 * repair->cut->incident[j] + s]] = PETSC_TRUE;
  }
  return PETSC_TRUE;
}

/* Sets the smallest and largest number of links of a subdomain */
void LatinRepairBounds(const LatinCut *cut, PetscInt *least, PetscInt *most)
{
  *least = PetscMax(1, (PetscInt)PetscCeilReal((1.0 - LATIN_REPAIR_BALANCE) * cut->mean));
  *most  = (PetscInt)((1.0 + LATIN_REPAIR_BALANCE) * cut->mean);
}

/*
   Moves links between the subdomains part[links]. Overwrites give[parts] and take[parts], the links that each may lose and gain. mine[nodes]: whether
   moves may touch a node, all of whose links are here; NULL: all. *moves: number of moves
*/
PetscErrorCode LatinRepair_Private(const LatinCut *cut, const PetscBool mine[], PetscInt give[], PetscInt take[], PetscInt part[], PetscInt *moves)
{
  LatinRepair repair = {.cut = cut, .mine = mine, .part = part, .give = give, .take = take};
  PetscInt   *best, *parts, widest = 1;
  PetscBool   moved = PETSC_TRUE;

  PetscFunctionBegin;
  *moves = 0;
  for (PetscInt v = 0; v < cut->nodes; v++) widest = PetscMax(widest, cut->offset[v + 1] - cut->offset[v]);
  PetscCall(PetscCalloc5(cut->nodes, &repair.due, cut->nodes, &repair.seen, cut->nodes, &repair.whole, cut->nodes, &repair.cost, mine ? cut->nodes : 0, &repair.reached));
  PetscCall(PetscMalloc6(widest + 1, &repair.touched, widest, &repair.move, widest, &repair.here, widest, &best, widest, &parts, LATIN_REPAIR_REACH, &repair.queue));
  for (PetscInt v = 0; v < cut->nodes; v++) {
    if (mine && !mine[v]) continue;
    repair.whole[v] = -1;
    repair.cost[v]  = LatinRepairCost(&repair, v);
    repair.due[v]   = PETSC_TRUE;
  }
  while (moved) {
    moved = PETSC_FALSE;
    for (PetscInt v = 0; v < cut->nodes; v++) {
      if (!repair.due[v]) continue;
      repair.due[v] = PETSC_FALSE;
      if (mine && !mine[v]) continue;
      if (LatinRepairNode(&repair, v, parts, best)) {
        moved = PETSC_TRUE;
        (*moves)++;
      }
    }
  }
  PetscCall(PetscFree6(repair.touched, repair.move, repair.here, best, parts, repair.queue));
  PetscCall(PetscFree5(repair.due, repair.seen, repair.whole, repair.cost, repair.reached));
  PetscFunctionReturn(0);
}

/* The same with the whole structure on one rank; no subdomain becomes empty */
PetscErrorCode LatinRepairWhole_Private(const LatinCut *cut, PetscInt part[])
{
  PetscInt *give, *take, least, most, moves;

  PetscFunctionBegin;
  LatinRepairBounds(cut, &least, &most);
  PetscCall(PetscMalloc2(cut->parts, &give, cut->parts, &take));
  for (PetscInt s = 0; s < cut->parts; s++) {
    give[s] = -least;
    take[s] = most;
  }
  for (PetscInt l = 0; l < cut->links; l++) {
    give[part[l]]++;
    take[part[l]]--;
  }
  PetscCall(LatinRepair_Private(cut, NULL, give, take, part, &moves));
  PetscCall(PetscFree2(give, take));
  PetscFunctionReturn(0);
}
