#include "coarse/latincoarse.h"

/*
   Nested condensation of the coarse problem (52). Neighbouring subdomains form groups. The coarse dofs of a group that no other subdomain has, its
   interior, are eliminated; the groups are the elements of a smaller coarse problem; and so on, level by level. Groups of equal subdomains in equal
   arrangement share one dense factor and are solved together, by blocks of right-hand sides, as in localsolvers/batches.c. If groups do not repeat, a
   sparse direct solver does the same elimination better, and nothing is grouped.

   For one group, with i the interior dofs, b the others, and K the sum of the operators of its members:

     set-up: K_ii = L L^t,   Z = K_bi L^-t,   S = K_bb - Z Z^t, the operator of the group;
     down:   v = L^-1 q_i, and the forces on b become q_b - Z v;
     up:     u_i = L^-t (v - Z^t u_b).
*/

#define LATIN_GROUPS        3                                            /* elements along a side of a group; of 2, 3, 4, 6 the least set-up time and memory */
#define LATIN_GROUP_FULL    (LATIN_GROUPS * LATIN_GROUPS * LATIN_GROUPS) /* most elements of a group on a regular grid */
#define LATIN_GROUP_CELLS   1e5                                          /* most cells of the grid along each side, more than the 3^8 of LATIN_GROUP_LEVELS */
#define LATIN_GROUP_EDGE    1e-3                                         /* shift of corners, in cells: rounding moves none into the cell below */
#define LATIN_GROUP_REPEAT  0.6                                          /* largest share of different groups; with more a sparse solver does less work */
#define LATIN_GROUP_COLUMNS 64                                           /* groups solved together: right-hand sides stay in cache */
/* most interior dofs of a group, for a dense factor of 19 MB; sparse factors of larger groups take fewer operations */
#define LATIN_GROUP_INTERIOR 1536
/* least pivot, relative to the stiffness before condensation; below, a mechanism is suspected, nothing is condensed, and the coarse solver decides */
#define LATIN_GROUP_PIVOT LatinByPrecision(1e-11, 1e-5)

/*
   Sets place[s] to the cell of the lowest corner of subdomain s in a grid of median subdomain size. The digits to base LATIN_GROUPS of its three
   coordinates are interleaved: without the last three digits it is the cell of a group.
*/
static PetscErrorCode LatinGroupsPlaces_Private(const LatinSubdomains *sub, uint64_t place[])
{
  PetscReal *low, *extent;
  uint64_t   unit = 1;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(place, sub->n));
  PetscCall(PetscMalloc2(sub->n, &low, sub->n, &extent));
  for (PetscInt c = 0; c < sub->dim && sub->n; c++, unit *= LATIN_GROUPS) {
    PetscReal least = PETSC_MAX_REAL, most = PETSC_MIN_REAL, size;

    for (PetscInt s = 0; s < sub->n; s++) {
      PetscReal high = PETSC_MIN_REAL;

      low[s] = PETSC_MAX_REAL;
      for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++) {
        low[s] = PetscMin(low[s], sub->x[sub->dim * i + c]);
        high   = PetscMax(high, sub->x[sub->dim * i + c]);
      }
      extent[s] = high - low[s];
      least     = PetscMin(least, low[s]);
      most      = PetscMax(most, low[s]);
    }
    PetscCall(PetscSortReal(sub->n, extent));
    size = PetscMax(extent[sub->n / 2], (most - least) / LATIN_GROUP_CELLS); /* subdomains may have zero extent */
    for (PetscInt s = 0; s < sub->n && size > 0.0; s++)
      for (uint64_t cell = (uint64_t)((low[s] - least) / size + LATIN_GROUP_EDGE), digit = unit; cell; cell /= LATIN_GROUPS, digit *= LATIN_GROUP_FULL) place[s] += cell % LATIN_GROUPS * digit;
  }
  PetscCall(PetscFree2(low, extent));
  PetscFunctionReturn(0);
}

/*
   Computes the stiffness of subdomain s, of this diagonal, and of its springs in each macro displacement: whole = R^t diag(K) R + 1. It bounds the
   rounding of H + 1 = T^-1, see stages/homogenise.c: springs much softer than the subdomain lose digits
*/
static void LatinGroupsMacros(const LatinCoarse *coarse, PetscInt s, const PetscReal diagonal[], PetscReal whole[])
{
  const LatinInterfaces *inter = coarse->inter;
  const LatinMacro      *macro = coarse->macro;

  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinFaceModes *of = &macro->of[f];
    const PetscReal      *R  = macro->basis + of->first;

    for (PetscInt i = 0; i < of->modes; i++) whole[of->at + i] = 1.0;
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++, R += of->modes)
      for (PetscInt i = 0; i < of->modes; i++) whole[of->at + i] += PetscSqr(R[i]) * diagonal[inter->side_dof[k]];
  }
}

/* Sets fine->whole, the stiffness of each coarse dof before condensation. A stiffness of the size of its rounding is a mechanism */
static PetscErrorCode LatinGroupsWhole_Private(const LatinCoarse *coarse, const LatinElements *fine)
{
  const LatinSubdomains *sub   = coarse->sub;
  const LatinInterfaces *inter = coarse->inter;
  PetscReal             *diagonal;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(sub->bs * sub->copies, &diagonal));
  PetscCall(LatinOperatorDiagonal(sub, diagonal));
  for (PetscInt s = 0; s < fine->n; s++) {
    PetscReal *whole = fine->whole + fine->offset[s];

    LatinGroupsMacros(coarse, s, diagonal, whole);
    whole += coarse->macro_count[s];
    for (PetscInt i = inter->primal_offset[s]; i < inter->primal_offset[s + 1]; i++) *whole++ = diagonal[inter->primal_dof[i]];
  }
  PetscCall(PetscFree(diagonal));
  PetscFunctionReturn(0);
}

/*
   Makes the subdomains the finest elements. *dofs: number of local coarse dofs, owned ones first, then ghosts; *sf: coarse dofs of all ranks -> these.
   Collective on sub->object
*/
static PetscErrorCode LatinGroupsFinest_Private(LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscInt *dofs, PetscSF *sf)
{
  const PetscInt n = coarse->sub->n, entries = coarse->offset[n];
  LatinElements *fine = &coarse->top;
  PetscInt      *number, start, own, ghosts = 0;

  PetscFunctionBegin;
  *fine = (LatinElements){.n = n, .offset = coarse->offset, .pattern = stiffness->pattern, .h_offset = stiffness->h_offset, .H = stiffness->H, .q = coarse->q, .u = coarse->u};
  PetscCall(PetscLayoutGetRange(coarse->map, &start, NULL));
  PetscCall(PetscLayoutGetLocalSize(coarse->map, &own));
  PetscCall(PetscMalloc3(entries, &fine->dof, n, &fine->place, entries, &fine->whole));
  PetscCall(LatinGroupsWhole_Private(coarse, fine));
  PetscCall(PetscMalloc1(own + entries, &number));
  for (PetscInt d = 0; d < own; d++) number[d] = start + d;
  for (PetscInt i = 0; i < entries; i++)
    if (coarse->global[i] < start || coarse->global[i] >= start + own) number[own + ghosts++] = coarse->global[i];
  PetscCall(PetscSortRemoveDupsInt(&ghosts, number + own));
  for (PetscInt i = 0; i < entries; i++) {
    fine->dof[i] = coarse->global[i] - start;
    if (fine->dof[i] >= 0 && fine->dof[i] < own) continue;
    PetscCall(PetscFindInt(coarse->global[i], ghosts, number + own, &fine->dof[i]));
    fine->dof[i] += own;
  }
  *dofs = own + ghosts;
  PetscCall(PetscSFCreate(PetscObjectComm(coarse->sub->object), sf));
  PetscCall(PetscSFSetGraphLayout(*sf, coarse->map, *dofs, NULL, PETSC_COPY_VALUES, number));
  PetscCall(PetscFree(number));
  PetscCall(LatinGroupsPlaces_Private(coarse->sub, fine->place));
  for (PetscInt s = 0; s < n; s++) fine->patterns += fine->pattern[s] == s ? 1 : 0;
  PetscFunctionReturn(0);
}

/* Forms groups: elements in the same cell of a grid that is LATIN_GROUPS times as coarse */
static PetscErrorCode LatinGroupsGroup_Private(LatinGroupLevel *level)
{
  const LatinElements *fine = &level->fine;
  LatinKey            *key;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(fine->n, &key));
  PetscCall(PetscMalloc3(fine->n, &level->group, fine->n, &level->member, fine->offset[fine->n], &level->slot));
  for (PetscInt s = 0; s < fine->n; s++) key[s] = (LatinKey){.hash = fine->place[s] / LATIN_GROUP_FULL, .number = s};
  qsort(key, (size_t)fine->n, sizeof(*key), LatinKeyCompare);
  for (PetscInt s = 0; s < fine->n; s++) {
    level->member[s] = key[s].number;
    if (!s || key[s].hash != key[s - 1].hash) level->group[level->coarse.n++].first = s;
    level->group[level->coarse.n - 1].last = s + 1;
  }
  PetscCall(PetscFree(key));
  PetscFunctionReturn(0);
}

/*
   Numbers the dofs of each group in slot[], interior ones first, then the others, each in the order of the members, so that equal groups have equal
   numbers. ranks[dofs]: number of ranks that have each dof
*/
static PetscErrorCode LatinGroupsNumber_Private(LatinGroupLevel *level, PetscInt dofs, const PetscInt ranks[])
{
  const LatinElements *fine = &level->fine;
  const PetscInt       none = -1, several = level->coarse.n;
  PetscInt            *owner, *number, count = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(dofs, &owner, dofs, &number));
  for (PetscInt d = 0; d < dofs; d++) {
    owner[d]  = ranks[d] > 1 ? several : none;
    number[d] = -1;
  }
  for (PetscInt g = 0; g < level->coarse.n; g++)
    for (PetscInt m = level->group[g].first; m < level->group[g].last; m++)
      for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) owner[fine->dof[i]] = owner[fine->dof[i]] == none || owner[fine->dof[i]] == g ? g : several;
  for (PetscInt g = 0; g < level->coarse.n; g++) {
    LatinGroup    *group = &level->group[g];
    const PetscInt start = count; /* lower numbers are of other groups */

    for (PetscInt boundary = 0; boundary < 2; boundary++) {
      for (PetscInt m = group->first; m < group->last; m++)
        for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) {
          const PetscInt d = fine->dof[i];

          if ((owner[d] != g) != boundary) continue;
          if (number[d] < start) number[d] = count++;
          level->slot[i] = number[d] - start;
        }
      if (!boundary) group->interior = count - start;
    }
    group->rows = count - start;
  }
  PetscCall(PetscFree2(owner, number));
  PetscFunctionReturn(0);
}

/* Appends the data that determines the operator of group g to a stream: equal members in equal arrangement make equal groups */
static PetscErrorCode LatinGroupsStream_Private(const void *ctx, PetscInt g, LatinStream *stream)
{
  const LatinGroupLevel *level = (const LatinGroupLevel *)ctx;
  const LatinElements   *fine  = &level->fine;

  PetscFunctionBegin;
  PetscCall(LatinStreamAdd_Private(stream, &level->group[g].interior, sizeof(PetscInt)));
  for (PetscInt m = level->group[g].first; m < level->group[g].last; m++) {
    const PetscInt s = level->member[m];

    PetscCall(LatinStreamAdd_Private(stream, &fine->pattern[s], sizeof(PetscInt)));
    PetscCall(LatinStreamAdd_Private(stream, level->slot + fine->offset[s], (size_t)(fine->offset[s + 1] - fine->offset[s]) * sizeof(PetscInt)));
  }
  PetscFunctionReturn(0);
}

/* Sorts the groups, equal ones consecutive. *kept: they repeat enough, and are small enough for dense factors */
static PetscErrorCode LatinGroupsCompare_Private(LatinGroupLevel *level, PetscBool *kept)
{
  LatinElements *coarse  = &level->coarse;
  LatinGroup    *group   = level->group;
  PetscInt       largest = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(coarse->n + 1, &coarse->offset, coarse->n, &coarse->pattern, coarse->n, &coarse->h_offset));
  PetscCall(LatinStreamCompare_Private(coarse->n, LatinGroupsStream_Private, level, coarse->pattern));
  for (PetscInt g = 0; g < coarse->n; g++) group[g].key = (LatinKey){.hash = (uint64_t)coarse->pattern[g], .number = g};
  qsort(group, (size_t)coarse->n, sizeof(*group), LatinKeyCompare); /* by pattern */
  for (PetscInt g = 0; g < coarse->n; g++) {
    coarse->pattern[g] = g && group[g].key.hash == group[g - 1].key.hash ? coarse->pattern[g - 1] : g;
    coarse->patterns += coarse->pattern[g] == g ? 1 : 0;
    largest = PetscMax(largest, group[g].interior);
  }
  *kept = (PetscBool)(coarse->patterns <= LATIN_GROUP_REPEAT * coarse->n && largest > 0 && largest <= LATIN_GROUP_INTERIOR);
  PetscFunctionReturn(0);
}

/* Computes L with Z below it, and S, of one group. Clears *kept if a mechanism is suspected */
static PetscErrorCode LatinGroupsFactor_Private(LatinGroupLevel *level, PetscInt g, PetscBool *kept)
{
  const LatinElements *fine  = &level->fine;
  const LatinGroup    *group = &level->group[g];
  const PetscInt       n = group->interior, rows = group->rows;
  PetscReal           *K, *whole, *S = level->coarse.H + level->coarse.h_offset[g];
  PetscBool            bad = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(PetscCalloc2(rows * rows, &K, rows, &whole));
  for (PetscInt m = group->first; m < group->last; m++) {
    const PetscInt   s = level->member[m], size = fine->offset[s + 1] - fine->offset[s], *slot = level->slot + fine->offset[s];
    const PetscReal *H = fine->H + fine->h_offset[s];

    for (PetscInt j = 0; j < size; j++)
      for (PetscInt i = 0; i < size; i++) K[slot[i] + rows * slot[j]] += H[i + size * j];
    for (PetscInt i = 0; i < size; i++) whole[slot[i]] += fine->whole[fine->offset[s] + i];
  }
  PetscCall(LatinSchur_Private(rows, n, K, &bad));
  for (PetscInt i = 0; i < n; i++) bad = (PetscBool)(bad || !(PetscSqr(K[i + rows * i]) > LATIN_GROUP_PIVOT * whole[i]));
  PetscCall(PetscArraycpy(level->L + group->l_offset, K, rows * n));
  for (PetscInt j = n; j < rows; j++)
    for (PetscInt i = n; i < rows; i++) *S++ = i < j ? K[j + rows * i] : K[i + rows * j]; /* K has its lower triangle alone */
  if (bad) *kept = PETSC_FALSE;
  PetscCall(PetscFree2(K, whole));
  PetscFunctionReturn(0);
}

/*
   Makes the groups elements, without their interior dofs. slot[] becomes a position in x: interior dofs of all groups, then the others. Clears *kept if
   a mechanism is suspected
*/
static PetscErrorCode LatinGroupsElements_Private(LatinGroupLevel *level, PetscBool *kept)
{
  const LatinElements *fine     = &level->fine;
  LatinElements       *coarse   = &level->coarse;
  PetscInt             interior = 0, left;
  size_t               l = 0, h = 0;

  PetscFunctionBegin;
  coarse->offset[0] = 0;
  for (PetscInt g = 0; g < coarse->n; g++) {
    LatinGroup    *group = &level->group[g];
    const PetscInt b = group->rows - group->interior, p = coarse->pattern[g];

    coarse->offset[g + 1] = coarse->offset[g] + b;
    coarse->h_offset[g]   = p == g ? h : coarse->h_offset[p];
    group->l_offset       = p == g ? l : level->group[p].l_offset;
    interior += group->interior;
    if (p != g) continue;
    h += (size_t)b * (size_t)b;
    l += (size_t)group->rows * (size_t)group->interior;
  }
  left = coarse->offset[coarse->n];
  PetscCall(PetscMalloc2(l, &level->L, interior + left, &level->x));
  PetscCall(PetscMalloc4(left, &coarse->dof, coarse->n, &coarse->place, left, &coarse->whole, h, &coarse->H));
  PetscCall(PetscArrayzero(coarse->whole, left));
  coarse->q = coarse->u = level->x + interior;
  for (PetscInt g = 0, v = 0; g < coarse->n && *kept; v += level->group[g++].interior) {
    const LatinGroup *group = &level->group[g];

    if (coarse->pattern[g] == g) PetscCall(LatinGroupsFactor_Private(level, g, kept));
    coarse->place[g] = fine->place[level->member[group->first]] / LATIN_GROUP_FULL;
    for (PetscInt m = group->first; m < group->last; m++)
      for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) {
        const PetscInt other = coarse->offset[g] + level->slot[i] - group->interior;

        if (level->slot[i] >= group->interior) {
          coarse->dof[other] = fine->dof[i];
          coarse->whole[other] += fine->whole[i];
        }
        level->slot[i] = level->slot[i] < group->interior ? v + level->slot[i] : interior + other;
      }
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGroupsLevelReset_Private(LatinGroupLevel *level)
{
  PetscFunctionBegin;
  PetscCall(PetscFree3(level->group, level->member, level->slot));
  PetscCall(PetscFree3(level->coarse.offset, level->coarse.pattern, level->coarse.h_offset));
  PetscCall(PetscFree2(level->L, level->x));
  PetscCall(PetscFree4(level->coarse.dof, level->coarse.place, level->coarse.whole, level->coarse.H));
  PetscCall(PetscMemzero(level, sizeof(*level)));
  PetscFunctionReturn(0);
}

/*
   Sets coarse->tree: whether the multifrontal solver of coarse/tree.h factors the coarse matrix. Yes if it is dense, as of few subdomains, to factor it
   once, not on each rank; and if the predicted time is not much longer than that of MUMPS, to save memory. Not if options choose the solver, or without
   our factorisation of a rank's part. Collective on sub->object
*/
static PetscErrorCode LatinGroupsTree_Private(LatinCoarse *coarse, PetscLayout map)
{
  const LatinElements *top     = &coarse->top;
  MPI_Comm             comm    = PetscObjectComm(coarse->sub->object);
  PetscReal            entries = 0.0;
  PetscInt            *number, n = top->offset[top->n];
  PetscMPIInt          size;
  PetscBool            ours;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(MatSolverTypeGet(LATIN_CHOLESKY, MATSEQAIJ, MAT_FACTOR_CHOLESKY, NULL, &ours, NULL));
  coarse->tree = PETSC_FALSE;
  if (!ours || size == 1 || coarse->chosen || coarse->iterative || !coarse->top_size) PetscFunctionReturn(0);
  for (PetscInt s = 0; s < top->n; s++) entries += PetscSqr((PetscReal)(top->offset[s + 1] - top->offset[s]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &entries, 1, MPIU_REAL, MPIU_SUM, comm));
  coarse->tree = (PetscBool)(entries >= PetscSqr((PetscReal)coarse->top_size));
  if (coarse->tree) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(n, &number));
  PetscCall(PetscArraycpy(number, coarse->top_global, n));
  PetscCall(PetscSortRemoveDupsInt(&n, number));
  PetscCall(LatinTreePays(comm, top->n, n, number, map, &coarse->tree));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

/*
   Numbers the coarse dofs of the top elements, the rows of A, and creates their scatter and coarse->whole. number[dofs]: work space. Collective on
   sub->object
*/
static PetscErrorCode LatinGroupsTop_Private(LatinCoarse *coarse, PetscSF sf, PetscInt dofs, PetscInt number[])
{
  const LatinElements *top     = &coarse->top;
  const PetscInt       entries = top->offset[top->n];
  MPI_Comm             comm    = PetscObjectComm(coarse->sub->object);
  PetscInt            *root, own, start;
  PetscScalar         *whole;
  PetscLayout          map;

  PetscFunctionBegin;
  PetscCall(PetscLayoutGetLocalSize(coarse->map, &own));
  PetscCall(PetscCalloc1(own, &root));
  PetscCall(PetscArrayzero(number, dofs));
  for (PetscInt i = 0; i < entries; i++) number[top->dof[i]] = 1;
  PetscCall(LatinSFReduce_Private(sf, 1, MPIU_INT, number, root, MPI_MAX));
  coarse->top_local = 0;
  for (PetscInt i = 0; i < own; i++) coarse->top_local += root[i];
  PetscCall(PetscLayoutCreateFromSizes(comm, coarse->top_local, PETSC_DETERMINE, 1, &map));
  PetscCall(PetscLayoutGetSize(map, &coarse->top_size));
  PetscCall(PetscLayoutGetRange(map, &start, NULL));
  for (PetscInt i = 0; i < own; i++) root[i] = root[i] ? start++ : -1;
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, root, number));
  PetscCall(PetscMalloc1(entries, &coarse->top_global));
  for (PetscInt i = 0; i < entries; i++) coarse->top_global[i] = number[top->dof[i]];
  PetscCall(PetscFree(root));
  PetscCall(LatinGroupsTree_Private(coarse, map));
  PetscCall(PetscSFCreate(comm, &coarse->top_sf));
  PetscCall(PetscSFSetGraphLayout(coarse->top_sf, map, entries, NULL, PETSC_COPY_VALUES, coarse->top_global));
  PetscCall(PetscSFSetUp(coarse->top_sf));
  PetscCall(PetscLayoutDestroy(&map));
  PetscCall(VecCreateMPI(comm, coarse->top_local, coarse->top_size, &coarse->whole));
  PetscCall(VecZeroEntries(coarse->whole));
  PetscCall(VecGetArray(coarse->whole, &whole));
  PetscCall(LatinSFReduce_Private(coarse->top_sf, 1, MPIU_REAL, top->whole, whole, MPI_SUM));
  PetscCall(VecRestoreArray(coarse->whole, &whole));
  PetscFunctionReturn(0);
}

/*
   Sets coarse->top, the elements of the problem of the coarse KSP: groups (if `groups`), or the subdomains themselves. Levels are added as long as
   groups repeat, are small enough for dense factors and are not singular. Collective on sub->object
*/
PetscErrorCode LatinGroupsSetUp(LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscBool groups)
{
  const PetscInt *degree;
  PetscInt       *ranks, dofs = 0;
  LatinElements  *top = &coarse->top;
  PetscSF         sf;

  PetscFunctionBegin;
  PetscCall(LatinGroupsFinest_Private(coarse, stiffness, &dofs, &sf));
  PetscCall(PetscMalloc1(dofs, &ranks));
  PetscCall(PetscSFComputeDegreeBegin(sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sf, &degree));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, degree, ranks));
  while (groups && coarse->levels < LATIN_GROUP_LEVELS && 2 * top->patterns < top->n) { /* without equal members there are no equal groups */
    LatinGroupLevel *level = &coarse->level[coarse->levels];

    level->fine = *top;
    PetscCall(LatinGroupsGroup_Private(level));
    PetscCall(LatinGroupsNumber_Private(level, dofs, ranks));
    PetscCall(LatinGroupsCompare_Private(level, &groups));
    if (groups) PetscCall(LatinGroupsElements_Private(level, &groups));
    if (groups) {
      coarse->levels++;
      *top = level->coarse;
      PetscCall(PetscInfo(coarse->sub->object, "nested condensation, level %" PetscInt_FMT ": %" PetscInt_FMT " groups, %" PetscInt_FMT " different\n", coarse->levels, top->n, top->patterns));
    } else PetscCall(LatinGroupsLevelReset_Private(level));
  }
  PetscCall(LatinGroupsTop_Private(coarse, sf, dofs, ranks));
  PetscCall(PetscFree(ranks));
  PetscCall(PetscSFDestroy(&sf));
  PetscFunctionReturn(0);
}

/* Frees data of the set-up: operators of groups, dofs and places of groups and subdomains */
PetscErrorCode LatinGroupsFinish(LatinCoarse *coarse)
{
  LatinElements *finest = coarse->levels ? &coarse->level[0].fine : &coarse->top;

  PetscFunctionBegin;
  PetscCall(PetscFree3(finest->dof, finest->place, finest->whole));
  coarse->top.whole = NULL;
  for (PetscInt k = 0; k < coarse->levels; k++) PetscCall(PetscFree4(coarse->level[k].coarse.dof, coarse->level[k].coarse.place, coarse->level[k].coarse.whole, coarse->level[k].coarse.H));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinGroupsReset(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  for (PetscInt k = 0; k < coarse->levels; k++) PetscCall(LatinGroupsLevelReset_Private(&coarse->level[k]));
  coarse->levels = 0;
  PetscCall(PetscFree(coarse->top_global));
  PetscCall(PetscSFDestroy(&coarse->top_sf));
  PetscFunctionReturn(0);
}

/* Condenses the forces fine.q to coarse.q, or (up) computes fine.u from coarse.u. Blocks of equal groups together */
static PetscErrorCode LatinGroupsLevelPass_Private(LatinGroupLevel *level, PetscBool up)
{
  const LatinElements *fine = &level->fine, *coarse = &level->coarse;
  const PetscScalar    one = 1.0, minus = -1.0;
  PetscReal           *v = level->x;
  PetscBLASInt         rows, n, b, columns;

  PetscFunctionBegin;
  if (!up) {
    PetscCall(PetscArrayzero(level->x, coarse->q + coarse->offset[coarse->n] - level->x));
    for (PetscInt i = 0; i < fine->offset[fine->n]; i++) level->x[level->slot[i]] += fine->q[i];
  }
  for (PetscInt g = 0, next = 0; g < coarse->n; g = next) {
    const PetscReal *L = level->L + level->group[g].l_offset, *Z = L + level->group[g].interior;
    PetscReal       *w = coarse->u + coarse->offset[g];

    while (next < coarse->n && next < g + LATIN_GROUP_COLUMNS && coarse->pattern[next] == coarse->pattern[g]) next++;
    PetscCall(PetscBLASIntCast(level->group[g].rows, &rows));
    PetscCall(PetscBLASIntCast(level->group[g].interior, &n));
    PetscCall(PetscBLASIntCast(next - g, &columns));
    b = rows - n;
    if (!n) continue;
    if (up && b) PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &n, &columns, &b, &minus, Z, &rows, w, &b, &one, v, &n));
    PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", up ? "T" : "N", "N", &n, &columns, &one, L, &rows, v, &n));
    if (!up && b) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &b, &columns, &n, &minus, Z, &rows, v, &n, &one, w, &b));
    PetscCall(PetscLogFlops((PetscLogDouble)columns * n * ((PetscLogDouble)n + 2.0 * b)));
    v += n * columns;
  }
  for (PetscInt i = 0; i < fine->offset[fine->n] && up; i++) fine->u[i] = level->x[level->slot[i]];
  PetscFunctionReturn(0);
}

/*
   Condenses coarse->q to top.q, or (up) computes coarse->u from top.u by back substitution. A pass up needs a pass down before, with coarse->q = 0 to
   prolong top.u alone
*/
PetscErrorCode LatinGroupsPass(LatinCoarse *coarse, PetscBool up)
{
  PetscFunctionBegin;
  for (PetscInt k = 0; k < coarse->levels; k++) PetscCall(LatinGroupsLevelPass_Private(&coarse->level[up ? coarse->levels - 1 - k : k], up));
  PetscFunctionReturn(0);
}
