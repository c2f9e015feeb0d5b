#include "partition/dissection.h"

/*
   Geometric nested dissection (Heath and Raghavan 1995):

   1. A part is bisected by a plane normal to one of a few directions: the one with the smallest separator, weighted by its balance. One pass over the
      edges counts the separators of all planes of a direction. Diagonal directions give diamond-shaped parts, the best ones of square grids.
   2. METIS refines the separator; both sides are bisected in turn.
   3. CAMD orders the nodes of each part by minimum degree, separators last.

   Coordinates may not reflect the graph, as in a net that is rolled up. Then a level set of the graph distance is a smaller separator than any plane,
   and METIS orders the graph instead.
*/

#if LATIN_CAMD
  #include <camd.h>

  #define LATIN_DISSECTION_LEAF  100 /* nodes of the largest part that is not bisected; with 50 and 200 operations differ by 1 % */
  #define LATIN_DISSECTION_CUTS  128 /* slices of a direction, with a candidate plane between any two; with 32 to 256 operations differ by 2 % */
  #define LATIN_DISSECTION_LEAST 0.3 /* least share of the nodes on either side; 0.2 is no different, with 0.4 a vault takes 5 % more operations */
  /* least extent along an axis, relative to the largest, for directions with a component along it; 0.25 takes longer for the same */
  #define LATIN_DISSECTION_THIN 0.5
  /* weight of imbalance between ranks, which wait for each other (1 elsewhere): halves of 49 and 51 % count as much as a separator 2 % larger */
  #define LATIN_DISSECTION_HALVES 50.0

  #if IDXTYPEWIDTH == 64
    #define LATIN_CAMD_ORDER camd_l_order
typedef SuiteSparse_long LatinCamd;
  #else
    #define LATIN_CAMD_ORDER camd_order
typedef int LatinCamd;
  #endif

static const PetscReal LatinDirections[][3] = {
  {1.0, 0.0,  0.0 },
  {0.0, 1.0,  0.0 },
  {0.0, 0.0,  1.0 },
  {1.0, 1.0,  0.0 },
  {1.0, -1.0, 0.0 },
  {1.0, 0.0,  1.0 },
  {1.0, 0.0,  -1.0},
  {0.0, 1.0,  1.0 },
  {0.0, 1.0,  -1.0}
};

typedef struct {
  PetscInt         dim;
  PetscReal        balance;                /* weight of imbalance in the choice of a plane */
  float            larger;                 /* largest size of a side over the mean that METIS may make */
  const PetscReal *x;                      /* [n][dim] coordinates */
  idx_t           *start, *list;           /* [n + 1], [start[n]] adjacency lists of the graph, symmetric */
  idx_t           *node;                   /* [n] nodes, sorted by parts */
  idx_t           *place;                  /* [n] local number of a node in the part at hand; -1: not in it */
  LatinCamd       *set, sets;              /* [n] constraint set of each node, and their number; CAMD orders one set after the other */
  idx_t           *part_start, *part_list; /* adjacency lists within the part, by local numbers as all that follows */
  /* [n] side 0 or 1, or separator 2; two arguments of METIS; slice of each node */
  idx_t     *part_side, *part_free, *part_size, *slice;
  PetscReal *along; /* [n] coordinate in the direction at hand */
} LatinDissection;

/* Plane: nodes below slice `at` of a direction are on side 0; nodes of side `on` with neighbours on the other side are the separator */
typedef struct {
  const PetscReal *along;
  PetscReal        low, scale; /* coordinate of the first slice, slices a unit of length */
  PetscReal        value;      /* size of the separator times the penalty of imbalance; the best plane has the least */
  idx_t            at, on;
} LatinPlane;

/* Computes d->along, the coordinates of the nodes of a part in a direction */
static void LatinAlong(LatinDissection *d, idx_t n, const idx_t node[], const PetscReal along[3])
{
  for (idx_t i = 0; i < n; i++) {
    d->along[i] = 0.0;
    for (PetscInt c = 0; c < d->dim; c++) d->along[i] += along[c] * d->x[d->dim * node[i] + c];
  }
}

/* Returns the slice of local node i */
static inline idx_t LatinSlice(const LatinDissection *d, const LatinPlane *plane, idx_t i)
{
  return (idx_t)PetscMin((PetscReal)(LATIN_DISSECTION_CUTS - 1), (d->along[i] - plane->low) * plane->scale);
}

/* Makes the adjacency lists within a part */
static void LatinPart(LatinDissection *d, idx_t n, const idx_t node[])
{
  idx_t used = 0;

  for (idx_t i = 0; i < n; i++) d->place[node[i]] = i;
  for (idx_t i = 0; i < n; i++) {
    d->part_start[i] = used;
    for (idx_t k = d->start[node[i]]; k < d->start[node[i] + 1]; k++)
      if (d->place[d->list[k]] >= 0) d->part_list[used++] = d->place[d->list[k]];
  }
  d->part_start[n] = used;
  for (idx_t i = 0; i < n; i++) d->place[node[i]] = -1;
}

/* Finds the best plane of a direction for the nodes of a part, if it is better than *best */
static void LatinSweep(LatinDissection *d, idx_t n, const idx_t node[], const PetscReal along[3], LatinPlane *best)
{
  PetscInt   below[LATIN_DISSECTION_CUTS + 1] = {0}, left[LATIN_DISSECTION_CUTS + 1] = {0}, right[LATIN_DISSECTION_CUTS + 1] = {0}, nodes = 0, on[2] = {0, 0};
  PetscReal  high  = -PETSC_MAX_REAL;
  LatinPlane plane = {.along = along, .low = PETSC_MAX_REAL};

  LatinAlong(d, n, node, along);
  for (idx_t i = 0; i < n; i++) {
    plane.low = PetscMin(plane.low, d->along[i]);
    high      = PetscMax(high, d->along[i]);
  }
  if (!(high > plane.low)) return;
  plane.scale = LATIN_DISSECTION_CUTS / (high - plane.low);
  for (idx_t i = 0; i < n; i++) below[(d->slice[i] = LatinSlice(d, &plane, i)) + 1]++;
  for (idx_t i = 0; i < n; i++) { /* a node is in the separators of all planes between it and its farthest neighbour */
    const idx_t at    = d->slice[i];
    idx_t       first = at, last = at;

    for (idx_t k = d->part_start[i]; k < d->part_start[i + 1]; k++) {
      first = PetscMin(first, d->slice[d->part_list[k]]);
      last  = PetscMax(last, d->slice[d->part_list[k]]);
    }
    left[at + 1]++;
    left[last + 1]--;
    right[first + 1]++;
    right[at + 1]--;
  }
  for (plane.at = 1; plane.at < LATIN_DISSECTION_CUTS; plane.at++) {
    PetscReal share;

    nodes += below[plane.at];
    on[0] += left[plane.at];
    on[1] += right[plane.at];
    share = (PetscReal)nodes / (PetscReal)n;
    if (share < LATIN_DISSECTION_LEAST || share > 1.0 - LATIN_DISSECTION_LEAST) continue;
    plane.on    = on[0] <= on[1] ? 0 : 1;
    plane.value = (PetscReal)on[plane.on] * (1.0 + d->balance * (1.0 / (4.0 * share * (1.0 - share)) - 1.0));
    if (plane.value < best->value) *best = plane;
  }
}

/* Computes the sides and the separator of a plane in d->part_side, refined by METIS */
static PetscErrorCode LatinSides_Private(LatinDissection *d, idx_t n, const idx_t node[], const LatinPlane *plane)
{
  int status;

  PetscFunctionBegin;
  LatinAlong(d, n, node, plane->along);
  for (idx_t i = 0; i < n; i++) {
    d->part_side[i] = LatinSlice(d, plane, i) < plane->at ? 0 : 1;
    d->part_free[i] = -1; /* METIS may move it to either side */
    d->part_size[i] = 1;
  }
  for (idx_t i = 0; i < n; i++)
    for (idx_t k = d->part_start[i]; k < d->part_start[i + 1] && d->part_side[i] == plane->on; k++)
      if (d->part_side[d->part_list[k]] == 1 - plane->on) d->part_side[i] = 2;
  status = METIS_NodeRefine(n, d->part_start, d->part_size, d->part_list, d->part_side, d->part_free, d->larger);
  PetscCheck(status == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not refine a separator (status %d)", status);
  PetscFunctionReturn(0);
}

/* Bisects a part: sorts its nodes into side 0, side 1 and separator, count[] of each. No bisection found: count[] is zero on a side */
static PetscErrorCode LatinCut_Private(LatinDissection *d, idx_t n, idx_t node[], idx_t count[3])
{
  PetscReal  low[3] = {PETSC_MAX_REAL, PETSC_MAX_REAL, PETSC_MAX_REAL}, high[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL}, extent = 0.0;
  LatinPlane best = {.value = PETSC_MAX_REAL};

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(count, 3));
  for (idx_t i = 0; i < n; i++)
    for (PetscInt c = 0; c < d->dim; c++) {
      low[c]  = PetscMin(low[c], d->x[d->dim * node[i] + c]);
      high[c] = PetscMax(high[c], d->x[d->dim * node[i] + c]);
    }
  for (PetscInt c = 0; c < d->dim; c++) extent = PetscMax(extent, high[c] - low[c]);
  LatinPart(d, n, node);
  for (size_t k = 0; k < sizeof(LatinDirections) / sizeof(*LatinDirections); k++) {
    PetscBool thin = PETSC_FALSE;

    for (PetscInt c = 0; c < 3; c++) thin = (PetscBool)(thin || (LatinDirections[k][c] != 0.0 && (c >= d->dim || high[c] - low[c] < LATIN_DISSECTION_THIN * extent)));
    if (!thin) LatinSweep(d, n, node, LatinDirections[k], &best);
  }
  if (!best.along) PetscFunctionReturn(0);
  PetscCall(LatinSides_Private(d, n, node, &best));
  for (idx_t i = 0; i < n; i++) count[d->part_side[i]]++;
  if (count[0] && count[1]) {
    idx_t at[3] = {0, count[0], count[0] + count[1]};

    for (idx_t i = 0; i < n; i++) d->part_list[at[d->part_side[i]]++] = node[i];
    PetscCall(PetscArraycpy(node, d->part_list, n));
  }
  PetscFunctionReturn(0);
}

/* Makes these nodes the next constraint set of CAMD */
static void LatinSet(LatinDissection *d, idx_t n, const idx_t node[])
{
  for (idx_t i = 0; i < n; i++) d->set[node[i]] = d->sets;
  if (n) d->sets++;
}

/* Bisects a part recursively and makes its constraint sets. cut: NULL, or count[] of the first bisection, made already */
static PetscErrorCode LatinDissectPart_Private(LatinDissection *d, idx_t n, idx_t node[], const idx_t cut[3])
{
  idx_t count[3] = {0, 0, 0};

  PetscFunctionBegin;
  if (cut) PetscCall(PetscArraycpy(count, cut, 3));
  else if (n > LATIN_DISSECTION_LEAF) PetscCall(LatinCut_Private(d, n, node, count));
  if (count[0] && count[1]) {
    PetscCall(LatinDissectPart_Private(d, count[0], node, NULL));
    PetscCall(LatinDissectPart_Private(d, count[1], node + count[0], NULL));
    LatinSet(d, count[2], node + count[0] + count[1]);
  } else LatinSet(d, n, node);
  PetscFunctionReturn(0);
}

/*
   Returns the size of the smallest balanced level set of a breadth-first search from a peripheral node. It is 1.4 times the separator of METIS on grids
   and networks, and no larger than that on elongated graphs. The levels of connected components follow each other
*/
static idx_t LatinLevel(LatinDissection *d, idx_t n)
{
  idx_t      *far = d->slice, *queue = d->part_list, best = n;
  const idx_t least = (idx_t)(LATIN_DISSECTION_LEAST * (PetscReal)n);

  for (PetscInt pass = 0; pass < 2; pass++) { /* from any node, then from the last one, which is peripheral */
    const idx_t from = pass ? queue[n - 1] : 0;
    idx_t       used = 0, other = 0;

    for (idx_t i = 0; i < n; i++) far[i] = -1;
    far[queue[used++] = from] = 0;
    for (idx_t i = 0; i < n; i++) {
      if (i == used) {
        while (far[other] >= 0) other++;
        far[queue[used++] = other] = far[queue[i - 1]] + 1;
      }
      for (idx_t k = d->start[queue[i]]; k < d->start[queue[i] + 1]; k++)
        if (far[d->list[k]] < 0) far[queue[used++] = d->list[k]] = far[queue[i]] + 1;
    }
  }
  for (idx_t first = 0, end; first < n; first = end) {
    for (end = first; end < n && far[queue[end]] == far[queue[first]];) end++;
    if (first >= least && n - end >= least) best = PetscMin(best, end - first);
  }
  return best;
}

static PetscErrorCode LatinDissectionCreate_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], LatinDissection *d)
{
  PetscFunctionBegin;
  *d = (LatinDissection){.dim = dim, .balance = 1.0, .larger = 1.2F, .x = x, .start = start, .list = list};
  PetscCall(PetscMalloc4(n, &d->node, n, &d->place, n, &d->set, n, &d->along));
  PetscCall(PetscMalloc6(n + 1, &d->part_start, start[n] + n, &d->part_list, n, &d->part_side, n, &d->part_free, n, &d->part_size, n, &d->slice));
  for (idx_t i = 0; i < n; i++) {
    d->node[i]  = i;
    d->place[i] = -1;
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDissectionDestroy_Private(LatinDissection *d)
{
  PetscFunctionBegin;
  PetscCall(PetscFree6(d->part_start, d->part_list, d->part_side, d->part_free, d->part_size, d->slice));
  PetscCall(PetscFree4(d->node, d->place, d->set, d->along));
  PetscFunctionReturn(0);
}

/* Makes the first bisection. *serves: coordinates reflect the graph, that is, the separator is no larger than a level set */
static PetscErrorCode LatinDissectWhole_Private(LatinDissection *d, idx_t n, idx_t count[3], PetscBool *serves)
{
  PetscFunctionBegin;
  PetscCall(LatinCut_Private(d, n, d->node, count));
  *serves = (PetscBool)(count[0] && count[1] && count[2] <= LatinLevel(d, n));
  PetscFunctionReturn(0);
}

/*
   Computes position[n], a fill-reducing order of n nodes at x [n][dim] with symmetric adjacency lists list[start[i]] to list[start[i + 1] - 1]. *done:
   false if METIS must order them
*/
PetscErrorCode LatinDissect_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t position[], PetscBool *done)
{
  LatinDissection d;
  double          control[CAMD_CONTROL], info[CAMD_INFO];
  idx_t           count[3];
  LatinCamd      *order;
  int             status;

  PetscFunctionBegin;
  PetscCall(LatinDissectionCreate_Private(dim, n, start, list, x, &d));
  PetscCall(LatinDissectWhole_Private(&d, n, count, done));
  if (*done) {
    PetscCall(LatinDissectPart_Private(&d, n, d.node, count));
    PetscCall(PetscMalloc1(n, &order));
    camd_defaults(control);
    status = (int)LATIN_CAMD_ORDER(n, start, list, order, control, info, d.set);
    PetscCheck(status == CAMD_OK || status == CAMD_OK_BUT_JUMBLED, PETSC_COMM_SELF, PETSC_ERR_LIB, "CAMD could not order the nodes of a matrix (status %d)", status);
    for (idx_t i = 0; i < n; i++) position[order[i]] = i;
    PetscCall(PetscFree(order));
  }
  PetscCall(LatinDissectionDestroy_Private(&d));
  PetscFunctionReturn(0);
}

/* Computes half[n]: balanced sides 0 and 1, separator 2. *done: false if METIS must find them */
PetscErrorCode LatinDissectHalves_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t half[], PetscBool *done)
{
  LatinDissection d;
  idx_t           count[3];

  PetscFunctionBegin;
  PetscCall(LatinDissectionCreate_Private(dim, n, start, list, x, &d));
  d.balance = LATIN_DISSECTION_HALVES;
  d.larger  = 1.0F + LATIN_HALVES_BALANCE / 1000.0F;
  PetscCall(LatinDissectWhole_Private(&d, n, count, done));
  for (idx_t i = 0; i < n; i++) half[d.node[i]] = i < count[0] ? 0 : i < count[0] + count[1] ? 1 : 2;
  PetscCall(LatinDissectionDestroy_Private(&d));
  PetscFunctionReturn(0);
}

#else

PetscErrorCode LatinDissect_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t position[], PetscBool *done)
{
  PetscFunctionBegin;
  (void)dim, (void)n, (void)start, (void)list, (void)x, (void)position;
  *done = PETSC_FALSE;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinDissectHalves_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t half[], PetscBool *done)
{
  PetscFunctionBegin;
  PetscCall(LatinDissect_Private(dim, n, start, list, x, half, done));
  PetscFunctionReturn(0);
}

#endif
