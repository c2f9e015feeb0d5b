#include "localsolvers/dissection.h"

/*
   Nested dissection of nodes whose places are known [M. T. Heath, P. Raghavan 1995]. A part is cut by a plane at right angles to
   one of a few directions, that with the smallest separator for its balance: one pass over the links counts those of all planes of a
   direction. METIS refines the one that is taken, and CAMD orders what is left by minimum degree, separators last.
   Directions aslant give the diamonds that nets of squares want.

   Places may tell nothing about links, as in a net that is rolled up. So METIS looks for a separator of the whole as well: where that is
   much smaller, it is to order the nodes.
*/

#if LATIN_CAMD
  #include <camd.h>

  #define LATIN_DISSECTION_LEAF  100  /* nodes that are ordered by minimum degree: with 50 and 200 operations differ by 1 % */
  #define LATIN_DISSECTION_CUTS  128  /* slices of a direction: with 32 to 256 operations differ by 2 % */
  #define LATIN_DISSECTION_LEAST 0.3  /* share of the nodes on either side: 0.2 is no different, with 0.4 a vault takes 5 % more operations */
  #define LATIN_DISSECTION_THIN  0.5  /* extent along an axis, of the largest one, from which on directions have a part along it */
  #define LATIN_DISSECTION_WORSE 1.25 /* times the separator that METIS finds of the whole */

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
  const PetscReal *x;                                                                  /* [n][dim] */
  idx_t           *start, *list;                                                       /* neighbours of each node, both ways */
  idx_t           *node;                                                               /* [n] parts, one after the other */
  idx_t           *slice;                                                              /* [n] of a direction */
  idx_t           *side;                                                               /* [n] 1 and 2: halves of the part that is cut, 3: its separator, 0: elsewhere */
  LatinCamd       *set, sets;                                                          /* [n] those whose order CAMD keeps */
  idx_t           *place, *part_start, *part_list, *part_side, *part_free, *part_size; /* of a part, for METIS */
} LatinDissection;

/* Nodes below slice `at` of a direction are on side 1, the separator is on side `on` */
typedef struct {
  const PetscReal *along;
  PetscReal        low, scale; /* of slices */
  PetscReal        value;      /* size of the separator for its balance: the least is best */
  idx_t            at, on;
} LatinPlane;

static inline PetscReal LatinAlong(const LatinDissection *d, const PetscReal along[3], idx_t v)
{
  PetscReal sum = 0.0;

  for (PetscInt c = 0; c < d->dim; c++) sum += along[c] * d->x[d->dim * v + c];
  return sum;
}

static inline idx_t LatinSlice(const LatinDissection *d, const LatinPlane *plane, idx_t v)
{
  return (idx_t)PetscMin((PetscReal)(LATIN_DISSECTION_CUTS - 1), (LatinAlong(d, plane->along, v) - plane->low) * plane->scale);
}

/* The best plane of a direction for the nodes of a part, whose sides are not 0, if it is better than *best */
static void LatinSweep(const LatinDissection *d, idx_t n, const idx_t node[], const PetscReal along[3], LatinPlane *best)
{
  PetscInt   below[LATIN_DISSECTION_CUTS + 1] = {0}, left[LATIN_DISSECTION_CUTS + 1] = {0}, right[LATIN_DISSECTION_CUTS + 1] = {0}, nodes = 0, on[2] = {0, 0};
  PetscReal  high  = -PETSC_MAX_REAL;
  LatinPlane plane = {.along = along, .low = PETSC_MAX_REAL};

  for (idx_t i = 0; i < n; i++) {
    const PetscReal at = LatinAlong(d, along, node[i]);

    plane.low = PetscMin(plane.low, at);
    high      = PetscMax(high, at);
  }
  if (!(high > plane.low)) return;
  plane.scale = LATIN_DISSECTION_CUTS / (high - plane.low);
  for (idx_t i = 0; i < n; i++) below[(d->slice[node[i]] = LatinSlice(d, &plane, node[i])) + 1]++;
  for (idx_t i = 0; i < n; i++) { /* a node is in the separator of the planes between it and its farthest neighbour */
    const idx_t at  = d->slice[node[i]];
    idx_t       low = at, high = at;

    for (idx_t k = d->start[node[i]]; k < d->start[node[i] + 1]; k++) {
      if (!d->side[d->list[k]]) continue;
      low  = PetscMin(low, d->slice[d->list[k]]);
      high = PetscMax(high, d->slice[d->list[k]]);
    }
    left[at + 1]++;
    left[high + 1]--;
    right[low + 1]++;
    right[at + 1]--;
  }
  for (plane.at = 1; plane.at < LATIN_DISSECTION_CUTS; plane.at++) {
    PetscReal share;

    nodes += below[plane.at];
    on[0] += left[plane.at];
    on[1] += right[plane.at];
    share = (PetscReal)nodes / (PetscReal)n;
    if (share < LATIN_DISSECTION_LEAST || share > 1.0 - LATIN_DISSECTION_LEAST) continue;
    plane.on    = on[0] <= on[1] ? 1 : 2;
    plane.value = (PetscReal)on[plane.on - 1] / (4.0 * share * (1.0 - share));
    if (plane.value < best->value) *best = plane;
  }
}

/* METIS moves nodes of a part between its sides and the separator */
static PetscErrorCode LatinRefine_Private(LatinDissection *d, idx_t n, const idx_t node[])
{
  idx_t used = 0;
  int   status;

  PetscFunctionBegin;
  for (idx_t i = 0; i < n; i++) d->place[node[i]] = i;
  for (idx_t i = 0; i < n; i++) {
    d->part_start[i] = used;
    for (idx_t k = d->start[node[i]]; k < d->start[node[i] + 1]; k++)
      if (d->side[d->list[k]]) d->part_list[used++] = d->place[d->list[k]];
    d->part_side[i] = d->side[node[i]] - 1;
    d->part_free[i] = -1; /* to be moved to either side */
    d->part_size[i] = 1;
  }
  d->part_start[n] = used;
  status           = METIS_NodeRefine(n, d->part_start, d->part_size, d->part_list, d->part_side, d->part_free, 1.2F);
  PetscCheck(status == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not refine a separator (status %d)", status);
  for (idx_t i = 0; i < n; i++) d->side[node[i]] = d->part_side[i] + 1;
  PetscFunctionReturn(0);
}

/* Cuts a part: its nodes are those of side 1, of side 2, and of the separator then, count[] of each. No nodes on a side: it is not to be cut */
static PetscErrorCode LatinCut_Private(LatinDissection *d, idx_t n, idx_t node[], idx_t count[3])
{
  PetscReal  low[3] = {PETSC_MAX_REAL, PETSC_MAX_REAL, PETSC_MAX_REAL}, high[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL}, extent = 0.0;
  LatinPlane best = {.value = PETSC_MAX_REAL};

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(count, 3));
  for (idx_t i = 0; i < n; i++) {
    d->side[node[i]] = 1;
    for (PetscInt c = 0; c < d->dim; c++) {
      low[c]  = PetscMin(low[c], d->x[d->dim * node[i] + c]);
      high[c] = PetscMax(high[c], d->x[d->dim * node[i] + c]);
    }
  }
  for (PetscInt c = 0; c < d->dim; c++) extent = PetscMax(extent, high[c] - low[c]);
  for (size_t k = 0; k < sizeof(LatinDirections) / sizeof(*LatinDirections); k++) {
    PetscBool thin = PETSC_FALSE;

    for (PetscInt c = 0; c < 3; c++) thin = (PetscBool)(thin || (LatinDirections[k][c] != 0.0 && (c >= d->dim || high[c] - low[c] < LATIN_DISSECTION_THIN * extent)));
    if (!thin) LatinSweep(d, n, node, LatinDirections[k], &best);
  }
  if (best.along) {
    for (idx_t i = 0; i < n; i++) d->side[node[i]] = LatinSlice(d, &best, node[i]) < best.at ? 1 : 2;
    for (idx_t i = 0; i < n; i++)
      for (idx_t k = d->start[node[i]]; k < d->start[node[i] + 1] && d->side[node[i]] == best.on; k++)
        if (d->side[d->list[k]] == 3 - best.on) d->side[node[i]] = 3;
    PetscCall(LatinRefine_Private(d, n, node));
    for (idx_t i = 0; i < n; i++) count[d->side[node[i]] - 1]++;
  }
  if (count[0] && count[1]) {
    idx_t at[3] = {0, count[0], count[0] + count[1]};

    for (idx_t i = 0; i < n; i++) d->part_list[at[d->side[node[i]] - 1]++] = node[i];
    PetscCall(PetscArraycpy(node, d->part_list, n));
  }
  for (idx_t i = 0; i < n; i++) d->side[node[i]] = 0;
  PetscFunctionReturn(0);
}

static void LatinSet(LatinDissection *d, idx_t n, const idx_t node[])
{
  for (idx_t i = 0; i < n; i++) d->set[node[i]] = d->sets;
  if (n) d->sets++;
}

/* The sets of a part, which is cut already if count is given */
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

/* Has METIS no separator of all nodes that is much smaller? */
static PetscErrorCode LatinDissectionServes_Private(const LatinDissection *d, idx_t n, const idx_t count[3], PetscBool *serves)
{
  idx_t options[METIS_NOPTIONS], nodes = n, size;
  int   status;

  PetscFunctionBegin;
  *serves = (PetscBool)(count[0] && count[1]);
  if (!*serves) PetscFunctionReturn(0);
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_NITER] = 1;
  status                      = METIS_ComputeVertexSeparator(&nodes, d->start, d->list, NULL, options, &size, d->part_side);
  PetscCheck(status == METIS_OK, PETSC_COMM_SELF, PETSC_ERR_LIB, "METIS could not find a separator of the nodes of a matrix (status %d)", status);
  *serves = (PetscBool)((PetscReal)count[2] <= LATIN_DISSECTION_WORSE * (PetscReal)size);
  PetscFunctionReturn(0);
}

/*
   The order of elimination of n nodes at x [n][dim], whose neighbours are list[start[i]] to list[start[i + 1] - 1], both ways:
   position[i] of each. *done: false where METIS is to order them
*/
PetscErrorCode LatinDissect_Private(PetscInt dim, idx_t n, idx_t start[], idx_t list[], const PetscReal x[], idx_t position[], PetscBool *done)
{
  LatinDissection d = {.dim = dim, .x = x, .start = start, .list = list};
  double          control[CAMD_CONTROL], info[CAMD_INFO];
  idx_t           count[3];
  LatinCamd      *order;
  int             status;

  PetscFunctionBegin;
  PetscCall(PetscMalloc6(n, &d.node, n, &d.slice, n, &d.side, n, &d.place, n, &d.set, n, &order));
  PetscCall(PetscMalloc5(n + 1, &d.part_start, start[n] + n, &d.part_list, n, &d.part_side, n, &d.part_free, n, &d.part_size));
  for (idx_t i = 0; i < n; i++) d.node[i] = i;
  PetscCall(LatinCut_Private(&d, n, d.node, count));
  PetscCall(LatinDissectionServes_Private(&d, n, count, done));
  if (*done) {
    PetscCall(LatinDissectPart_Private(&d, n, d.node, count));
    camd_defaults(control);
    status = (int)LATIN_CAMD_ORDER(n, start, list, order, control, info, d.set);
    PetscCheck(status == CAMD_OK || status == CAMD_OK_BUT_JUMBLED, PETSC_COMM_SELF, PETSC_ERR_LIB, "CAMD could not order the nodes of a matrix (status %d)", status);
    for (idx_t i = 0; i < n; i++) position[order[i]] = i;
  }
  PetscCall(PetscFree5(d.part_start, d.part_list, d.part_side, d.part_free, d.part_size));
  PetscCall(PetscFree6(d.node, d.slice, d.side, d.place, d.set, order));
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

#endif
