#include "coarse/latincoarse.h"

/*
   Nested condensation of the coarse problem (52). Neighbouring subdomains are put into groups, the coarse
   displacements that no subdomain outside a group touches are eliminated, and the groups become the elements of a
   smaller coarse problem; again, level by level. Groups that are made of equal subdomains in equal arrangement share
   one dense factor and are solved together: memory traffic becomes arithmetic, as in localsolvers/batches.c. Where groups are all
   different a sparse direct solver does the same elimination better, and nothing is grouped.

   For one group, with i the interior dofs, b the others, and K the sum of its members' operators:

     K_ii = L L^t,   Z = K_bi L^-t,   S = K_bb - Z Z^t, the operator of the group;
     down: v = L^-1 q_i, and the forces on b are q_b - Z v;   up: u_i = L^-t (v - Z^t u_b).
*/

#define LATIN_GROUPS         3                             /* elements a side of a group; of 2, 3, 4, 6 the least set-up and memory */
#define LATIN_GROUP_CELLS    1e5                           /* of the grid that finds the groups, along each side: enough for any structure */
#define LATIN_GROUP_COLUMNS  64                            /* groups solved together: right-hand sides stay in cache */
#define LATIN_GROUP_INTERIOR 1536                          /* largest dense factor: a sparse one of a larger group does less work */
#define LATIN_GROUP_PIVOT    LatinByPrecision(1e-11, 1e-5) /* below it, relative to the diagonal, a mechanism is suspected: the coarse solver decides */

/* Where subdomains are: the cells of their lowest corners in a grid as fine as typical ones */
static PetscErrorCode LatinGroupsCells_Private(const LatinSubdomains *sub, PetscInt cell[])
{
  PetscReal *low, *extent;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(cell, 3 * sub->n));
  PetscCall(PetscMalloc2(sub->n, &low, sub->n, &extent));
  for (PetscInt c = 0; c < sub->dim && sub->n; c++) {
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
    size = PetscMax(extent[sub->n / 2], (most - least) / LATIN_GROUP_CELLS); /* subdomains may have no extent */
    for (PetscInt s = 0; s < sub->n && size > 0.0; s++) cell[3 * s + c] = (PetscInt)((low[s] - least) / size + 1e-3);
  }
  PetscCall(PetscFree2(low, extent));
  PetscFunctionReturn(0);
}

/* The subdomains as elements. Their coarse dofs are numbered here from 0; sf: all coarse dofs -> those here. Collective */
static PetscErrorCode LatinGroupsFinest_Private(LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscInt *dofs, PetscSF *sf)
{
  const PetscInt n = coarse->sub->n, entries = coarse->offset[n];
  LatinElements *fine = &coarse->top;
  PetscInt      *number;

  PetscFunctionBegin;
  *fine = (LatinElements){.n = n, .offset = coarse->offset, .pattern = stiffness->pattern, .h_offset = stiffness->h_offset, .H = stiffness->H, .q = coarse->q, .u = coarse->u};
  PetscCall(PetscMalloc2(entries, &fine->dof, 3 * n, &fine->cell));
  PetscCall(LatinGroupsCells_Private(coarse->sub, fine->cell));
  PetscCall(PetscMalloc1(entries, &number));
  PetscCall(PetscArraycpy(number, coarse->global, entries));
  *dofs = entries;
  PetscCall(PetscSortRemoveDupsInt(dofs, number));
  for (PetscInt i = 0; i < entries; i++) PetscCall(PetscFindInt(coarse->global[i], *dofs, number, &fine->dof[i]));
  PetscCall(PetscSFCreate(PetscObjectComm(coarse->sub->object), sf));
  PetscCall(PetscSFSetGraphLayout(*sf, coarse->map, *dofs, NULL, PETSC_COPY_VALUES, number));
  PetscCall(PetscSFSetUp(*sf));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

/* Groups: elements whose cells are one of a grid LATIN_GROUPS times as coarse */
static PetscErrorCode LatinGroupsGroup_Private(LatinGroupLevel *level)
{
  const LatinElements *fine = &level->fine;
  LatinKey            *key;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(fine->n, &key));
  PetscCall(PetscMalloc3(fine->n, &level->group, fine->n, &level->member, fine->offset[fine->n], &level->slot));
  for (PetscInt s = 0; s < fine->n; s++) {
    key[s].hash   = 0;
    key[s].number = s;
    for (PetscInt c = 0; c < 3; c++) key[s].hash = (key[s].hash << 20) + (uint64_t)(fine->cell[3 * s + c] / LATIN_GROUPS);
  }
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
   The dofs of each group: interior ones first, each kind in the order in which the members bring them, so that equal
   groups number them alike. ranks[]: how many ranks have each dof
*/
static PetscErrorCode LatinGroupsNumber_Private(LatinGroupLevel *level, PetscInt dofs, const PetscInt ranks[])
{
  const LatinElements *fine = &level->fine;
  const PetscInt       none = -1, several = level->coarse.n;
  PetscInt            *owner, *seen, *number;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(dofs, &owner, dofs, &seen, dofs, &number)); /* the group of a dof; the last one that numbered it, and its number there */
  for (PetscInt d = 0; d < dofs; d++) {
    owner[d] = ranks[d] > 1 ? several : none;
    seen[d]  = none;
  }
  for (PetscInt g = 0; g < level->coarse.n; g++)
    for (PetscInt m = level->group[g].first; m < level->group[g].last; m++)
      for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) owner[fine->dof[i]] = owner[fine->dof[i]] == none || owner[fine->dof[i]] == g ? g : several;
  for (PetscInt g = 0; g < level->coarse.n; g++) {
    LatinGroup *group = &level->group[g];

    group->rows = 0;
    for (PetscInt pass = 0; pass < 2; pass++) {
      for (PetscInt m = group->first; m < group->last; m++)
        for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) {
          const PetscInt d = fine->dof[i];

          if ((owner[d] == g) != (pass == 0)) continue;
          if (seen[d] != g) number[d] = group->rows++;
          seen[d]        = g;
          level->slot[i] = number[d];
        }
      if (!pass) group->interior = group->rows;
    }
  }
  PetscCall(PetscFree3(owner, seen, number));
  PetscFunctionReturn(0);
}

/* What a group is made of: equal members in equal arrangement make equal groups */
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

/* Sorts the groups, so that equal ones follow each other; *patterns: how many are different */
static PetscErrorCode LatinGroupsCompare_Private(LatinGroupLevel *level, PetscInt *patterns)
{
  const PetscInt n = level->coarse.n;
  LatinGroup    *group;
  LatinKey      *key;
  PetscInt      *pattern;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(n + 1, &level->coarse.offset, n, &level->coarse.pattern, n, &level->coarse.h_offset));
  pattern = level->coarse.pattern;
  PetscCall(PetscMalloc2(n, &group, n, &key));
  PetscCall(LatinStreamCompare_Private(n, LatinGroupsStream_Private, level, pattern));
  for (PetscInt g = 0; g < n; g++) {
    group[g]      = level->group[g];
    key[g].hash   = (uint64_t)pattern[g];
    key[g].number = g;
  }
  qsort(key, (size_t)n, sizeof(*key), LatinKeyCompare);
  *patterns = 0;
  for (PetscInt g = 0; g < n; g++) {
    level->group[g] = group[key[g].number];
    pattern[g]      = g && key[g].hash == key[g - 1].hash ? pattern[g - 1] : g;
    *patterns += pattern[g] == g ? 1 : 0;
  }
  PetscCall(PetscFree2(group, key));
  PetscFunctionReturn(0);
}

/* The groups as elements, without their interior dofs; room for operators, factors and forces */
static PetscErrorCode LatinGroupsElements_Private(LatinGroupLevel *level)
{
  const LatinElements *fine   = &level->fine;
  LatinElements       *coarse = &level->coarse;
  size_t               l = 0, h = 0, v = 0;

  PetscFunctionBegin;
  coarse->offset[0] = 0;
  for (PetscInt g = 0; g < coarse->n; g++) {
    LatinGroup    *group = &level->group[g];
    const PetscInt b = group->rows - group->interior, p = coarse->pattern[g];

    coarse->offset[g + 1] = coarse->offset[g] + b;
    coarse->h_offset[g]   = p == g ? h : coarse->h_offset[p];
    group->l_offset       = p == g ? l : level->group[p].l_offset;
    v += (size_t)group->interior;
    if (p != g) continue;
    h += (size_t)b * (size_t)b;
    l += (size_t)group->rows * (size_t)group->interior;
  }
  PetscCall(PetscMalloc2(l, &level->L, v, &level->v));
  PetscCall(PetscMalloc1(h, &coarse->H));
  PetscCall(PetscMalloc2(coarse->offset[coarse->n], &coarse->q, coarse->offset[coarse->n], &coarse->u));
  PetscCall(PetscMalloc2(coarse->offset[coarse->n], &coarse->dof, 3 * coarse->n, &coarse->cell));
  for (PetscInt g = 0; g < coarse->n; g++) {
    const LatinGroup *group = &level->group[g];

    for (PetscInt c = 0; c < 3; c++) coarse->cell[3 * g + c] = fine->cell[3 * level->member[group->first] + c] / LATIN_GROUPS;
    for (PetscInt m = group->first; m < group->last; m++)
      for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++)
        if (level->slot[i] >= group->interior) coarse->dof[coarse->offset[g] + level->slot[i] - group->interior] = fine->dof[i];
  }
  PetscFunctionReturn(0);
}

/* L with Z below it, and S of one group */
static PetscErrorCode LatinGroupsFactor_Private(LatinGroupLevel *level, PetscInt g, PetscBool *bad)
{
  const LatinElements *fine  = &level->fine;
  const LatinGroup    *group = &level->group[g];
  const PetscInt       n = group->interior, rows = group->rows;
  PetscReal           *K, *S                     = level->coarse.H + level->coarse.h_offset[g], *diagonal;

  PetscFunctionBegin;
  PetscCall(PetscCalloc2(rows * rows, &K, n, &diagonal));
  for (PetscInt m = group->first; m < group->last; m++) {
    const PetscInt   s = level->member[m], size = fine->offset[s + 1] - fine->offset[s], *slot = level->slot + fine->offset[s];
    const PetscReal *H = fine->H + fine->h_offset[s];

    for (PetscInt j = 0; j < size; j++)
      for (PetscInt i = 0; i < size; i++) K[slot[i] + rows * slot[j]] += H[i + size * j];
  }
  for (PetscInt i = 0; i < n; i++) diagonal[i] = K[i + rows * i];
  PetscCall(LatinSchur_Private(rows, n, K, bad));
  for (PetscInt i = 0; i < n; i++)
    if (!(PetscSqr(K[i + rows * i]) > LATIN_GROUP_PIVOT * diagonal[i])) *bad = PETSC_TRUE;
  PetscCall(PetscArraycpy(level->L + group->l_offset, K, rows * n));
  for (PetscInt j = n; j < rows; j++)
    for (PetscInt i = n; i < rows; i++) *S++ = i < j ? K[j + rows * i] : K[i + rows * j]; /* the upper half is not set */
  PetscCall(PetscFree2(K, diagonal));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGroupsLevelReset_Private(LatinGroupLevel *level)
{
  PetscFunctionBegin;
  PetscCall(PetscFree3(level->group, level->member, level->slot));
  PetscCall(PetscFree3(level->coarse.offset, level->coarse.pattern, level->coarse.h_offset));
  PetscCall(PetscFree2(level->L, level->v));
  PetscCall(PetscFree(level->coarse.H));
  PetscCall(PetscFree2(level->coarse.q, level->coarse.u));
  PetscCall(PetscFree2(level->coarse.dof, level->coarse.cell));
  PetscCall(PetscMemzero(level, sizeof(*level)));
  PetscFunctionReturn(0);
}

/* One more level on top of the last; not kept when groups do not repeat, are too large for dense factors, or are singular */
static PetscErrorCode LatinGroupsLevelSetUp_Private(LatinCoarse *coarse, PetscInt dofs, const PetscInt ranks[], PetscBool *kept)
{
  LatinGroupLevel     *level    = &coarse->level[coarse->levels];
  const LatinElements *fine     = &coarse->top;
  PetscInt             patterns = 0, largest = 0;
  PetscBool            bad = PETSC_FALSE;

  PetscFunctionBegin;
  *kept = PETSC_FALSE;
  for (PetscInt s = 0; s < fine->n; s++) patterns += fine->pattern[s] == s ? 1 : 0;
  if (2 * patterns >= fine->n) PetscFunctionReturn(0); /* equal groups are made of equal members */
  level->fine = *fine;
  PetscCall(LatinGroupsGroup_Private(level));
  PetscCall(LatinGroupsNumber_Private(level, dofs, ranks));
  PetscCall(LatinGroupsCompare_Private(level, &patterns));
  for (PetscInt g = 0; g < level->coarse.n; g++) largest = PetscMax(largest, level->group[g].interior);
  *kept = (PetscBool)(5 * patterns <= 3 * level->coarse.n && largest > 0 && largest <= LATIN_GROUP_INTERIOR);
  if (*kept) PetscCall(LatinGroupsElements_Private(level));
  for (PetscInt g = 0; g < level->coarse.n && *kept; g++) {
    if (level->coarse.pattern[g] == g) PetscCall(LatinGroupsFactor_Private(level, g, &bad));
    if (bad) *kept = PETSC_FALSE;
  }
  if (*kept) {
    coarse->levels++;
    coarse->top = level->coarse;
    PetscCall(PetscInfo(coarse->sub->object, "nested condensation, level %" PetscInt_FMT ": %" PetscInt_FMT " groups, %" PetscInt_FMT " different\n", coarse->levels, level->coarse.n, patterns));
  } else PetscCall(LatinGroupsLevelReset_Private(level));
  PetscFunctionReturn(0);
}

/* Numbers for the coarse displacements that are left, and where they are found; number[]: work space for the dofs here. Collective */
static PetscErrorCode LatinGroupsTop_Private(LatinCoarse *coarse, PetscSF sf, PetscInt dofs, PetscInt number[])
{
  const LatinElements *top     = &coarse->top;
  const PetscInt       entries = top->offset[top->n];
  MPI_Comm             comm    = PetscObjectComm(coarse->sub->object);
  PetscInt            *root, own, start;
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
  PetscCall(PetscSFCreate(comm, &coarse->top_sf));
  PetscCall(PetscSFSetGraphLayout(coarse->top_sf, map, entries, NULL, PETSC_COPY_VALUES, coarse->top_global));
  PetscCall(PetscSFSetUp(coarse->top_sf));
  PetscCall(PetscLayoutDestroy(&map));
  PetscFunctionReturn(0);
}

/* Sets coarse.top, the elements of the coarse problem that the coarse KSP solves: groups, or the subdomains themselves. Collective */
PetscErrorCode LatinGroupsSetUp(LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscBool groups)
{
  const PetscInt *degree;
  PetscInt       *ranks, dofs;
  LatinElements   finest;
  PetscSF         sf;

  PetscFunctionBegin;
  PetscCall(LatinGroupsFinest_Private(coarse, stiffness, &dofs, &sf));
  finest = coarse->top;
  PetscCall(PetscMalloc1(dofs, &ranks));
  PetscCall(PetscSFComputeDegreeBegin(sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sf, &degree));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, degree, ranks));
  while (groups && coarse->levels < LATIN_GROUP_LEVELS) PetscCall(LatinGroupsLevelSetUp_Private(coarse, dofs, ranks, &groups));
  PetscCall(LatinGroupsTop_Private(coarse, sf, dofs, ranks));
  PetscCall(PetscFree(ranks));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree2(finest.dof, finest.cell));
  PetscFunctionReturn(0);
}

/* What only the set-up needs: operators of the groups */
PetscErrorCode LatinGroupsFinish(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  for (PetscInt k = 0; k < coarse->levels; k++) {
    PetscCall(PetscFree(coarse->level[k].coarse.H));
    PetscCall(PetscFree2(coarse->level[k].coarse.dof, coarse->level[k].coarse.cell));
  }
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

/* Between the dofs of a group's members and columns of its interior and its other dofs: q added down, u copied up */
static void LatinGroupsMove(const LatinGroupLevel *level, PetscInt g, PetscBool up, PetscReal interior[], PetscReal others[])
{
  const LatinElements *fine = &level->fine;
  const PetscInt       n    = level->group[g].interior;

  for (PetscInt m = level->group[g].first; m < level->group[g].last; m++)
    for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) {
      PetscReal *at = level->slot[i] < n ? interior + level->slot[i] : others + level->slot[i] - n;

      if (up) fine->u[i] = *at;
      else *at += fine->q[i];
    }
}

/* From forces on the members' dofs to forces on the groups', or from the groups' displacements back: equal groups together */
static PetscErrorCode LatinGroupsPass_Private(LatinGroupLevel *level, PetscBool up)
{
  const LatinElements *coarse = &level->coarse;
  const PetscScalar    one = 1.0, minus = -1.0;
  PetscReal           *v = level->v;
  PetscBLASInt         rows, n, b, columns;

  PetscFunctionBegin;
  for (PetscInt g = 0, next = 0; g < coarse->n; g = next) {
    const PetscReal *L = level->L + level->group[g].l_offset, *Z = L + level->group[g].interior;
    PetscReal       *w = (up ? coarse->u : coarse->q) + coarse->offset[g];

    while (next < coarse->n && next < g + LATIN_GROUP_COLUMNS && coarse->pattern[next] == coarse->pattern[g]) next++;
    PetscCall(PetscBLASIntCast(level->group[g].rows, &rows));
    PetscCall(PetscBLASIntCast(level->group[g].interior, &n));
    PetscCall(PetscBLASIntCast(next - g, &columns));
    b = rows - n;
    if (up) {
      if (n && b) PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &n, &columns, &b, &minus, Z, &rows, w, &b, &one, v, &n));
      if (n) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "T", "N", &n, &columns, &one, L, &rows, v, &n));
      for (PetscInt k = 0; k < columns; k++) LatinGroupsMove(level, g + k, up, v + n * k, w + b * k);
    } else {
      PetscCall(PetscArrayzero(v, n * columns));
      PetscCall(PetscArrayzero(w, b * columns));
      for (PetscInt k = 0; k < columns; k++) LatinGroupsMove(level, g + k, up, v + n * k, w + b * k);
      if (n) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "N", "N", &n, &columns, &one, L, &rows, v, &n));
      if (n && b) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &b, &columns, &n, &minus, Z, &rows, v, &n, &one, w, &b));
    }
    v += n * columns;
  }
  PetscFunctionReturn(0);
}

/* coarse.q to top.q, by elimination */
PetscErrorCode LatinGroupsDown(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  for (PetscInt k = 0; k < coarse->levels; k++) PetscCall(LatinGroupsPass_Private(&coarse->level[k], PETSC_FALSE));
  PetscFunctionReturn(0);
}

/* top.u to coarse.u, by substitution; LatinGroupsDown() came before, with forces of zero where only top.u acts */
PetscErrorCode LatinGroupsUp(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  for (PetscInt k = coarse->levels - 1; k >= 0; k--) PetscCall(LatinGroupsPass_Private(&coarse->level[k], PETSC_TRUE));
  PetscFunctionReturn(0);
}
