#include "coarse/latincoarse.h"

/*
   Nested condensation of the coarse problem (52). Neighbouring subdomains are put into groups, the coarse
   displacements that no subdomain outside a group touches are eliminated, and the groups become the elements of a
   smaller coarse problem; again, level by level. Groups that are made of equal subdomains in equal arrangement share
   one dense factor and are solved together: memory traffic becomes arithmetic, as in localsolvers/batches.c. Where groups are all
   different a sparse direct solver does the same elimination better, and nothing is grouped.

   For one group, with i the interior dofs, b the others, and K the sum of its members' operators:

     K_ii = L L^t,   Z = L^-1 K_ib,   S = K_bb - Z^t Z, the operator of the group;
     down: v = L^-1 q_i, and the forces on b are q_b - Z^t v;   up: u_i = L^-t (v - Z u_b).
*/

#define LATIN_GROUP_COLUMNS  64                            /* groups solved together: right-hand sides stay in cache */
#define LATIN_GROUP_INTERIOR 1536                          /* largest dense factor: a sparse one of a larger group does less work */
#define LATIN_GROUP_PIVOT    LatinByPrecision(1e-11, 1e-5) /* below it, relative to the diagonal, a mechanism is suspected: the coarse solver decides */

/* The subdomains as elements. Their coarse dofs are numbered here from 0; those of `outside` belong to other ranks as well */
static PetscErrorCode LatinGroupsFinest_Private(LatinCoarse *coarse, const LatinHomogenised *stiffness, LatinElements *fine, PetscInt *dofs, PetscBool **outside)
{
  const LatinSubdomains *sub = coarse->sub;
  const PetscInt         dim = sub->dim, entries = coarse->offset[sub->n], own = coarse->macro->modes_local + coarse->primal_local;
  PetscInt              *ghost, ghosts = 0, *all, *root, *here, start;
  PetscMPIInt            rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(PetscObjectComm(coarse->sub->object), &rank));
  start          = coarse->rank_start[rank];
  fine->n        = sub->n;
  fine->offset   = coarse->offset;
  fine->pattern  = stiffness->pattern;
  fine->h_offset = stiffness->h_offset;
  fine->H        = stiffness->H;
  fine->q        = coarse->q;
  fine->u        = coarse->u;
  PetscCall(PetscMalloc2(entries, &fine->dof, 6 * sub->n, &fine->box));
  PetscCall(PetscMalloc3(entries, &ghost, entries, &all, own, &root));
  for (PetscInt i = 0; i < entries; i++)
    if (coarse->global[i] < start || coarse->global[i] >= start + own) ghost[ghosts++] = coarse->global[i];
  PetscCall(PetscSortRemoveDupsInt(&ghosts, ghost));
  *dofs = own + ghosts;
  PetscCall(PetscCalloc1(*dofs, &here));
  PetscCall(PetscCalloc1(*dofs, outside));
  for (PetscInt i = 0; i < entries; i++) {
    fine->dof[i] = coarse->global[i] - start;
    if (fine->dof[i] < 0 || fine->dof[i] >= own) {
      PetscCall(PetscFindInt(coarse->global[i], ghosts, ghost, &fine->dof[i]));
      fine->dof[i] += own;
    }
    here[fine->dof[i]]++;
    all[i] = 1;
  }
  PetscCall(PetscArrayzero(root, own));
  PetscCall(LatinSFReduce_Private(coarse->sf, 1, MPIU_INT, all, root, MPI_SUM));
  PetscCall(LatinSFBcast_Private(coarse->sf, 1, MPIU_INT, root, all));
  for (PetscInt i = 0; i < entries; i++) (*outside)[fine->dof[i]] = (PetscBool)(all[i] != here[fine->dof[i]]);
  PetscCall(PetscFree(here));
  PetscCall(PetscFree3(ghost, all, root));

  for (PetscInt s = 0; s < sub->n; s++) {
    PetscReal *box = fine->box + 6 * s;

    for (PetscInt c = 0; c < 6; c++) box[c] = c % 3 >= dim ? 0.0 : (c < 3 ? PETSC_MAX_REAL : PETSC_MIN_REAL);
    for (PetscInt i = dim * sub->node_offset[s]; i < dim * sub->node_offset[s + 1]; i++) {
      box[i % dim]     = PetscMin(box[i % dim], sub->x[i]);
      box[3 + i % dim] = PetscMax(box[3 + i % dim], sub->x[i]);
    }
  }
  PetscFunctionReturn(0);
}

/* Groups: elements whose lowest corners lie in the same cell of a grid, `width` typical elements wide */
static PetscErrorCode LatinGroupsGroup_Private(LatinGroupLevel *level, PetscInt width)
{
  const LatinElements *fine = &level->fine;
  LatinKey            *key;
  PetscReal           *extent;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(fine->n, &key, fine->n, &extent));
  for (PetscInt s = 0; s < fine->n; s++) {
    key[s].hash   = 0;
    key[s].number = s;
  }
  for (PetscInt c = 0; c < 3; c++) {
    PetscReal low = PETSC_MAX_REAL, high = PETSC_MIN_REAL, cell;

    for (PetscInt s = 0; s < fine->n; s++) {
      extent[s] = fine->box[6 * s + 3 + c] - fine->box[6 * s + c];
      low       = PetscMin(low, fine->box[6 * s + c]);
      high      = PetscMax(high, fine->box[6 * s + c]);
    }
    if (!fine->n) break; /* a rank without subdomains */
    PetscCall(PetscSortReal(fine->n, extent));
    cell = (PetscReal)width * extent[fine->n / 2];
    if (!(cell > 1e-5 * (high - low))) cell = 1e-5 * (high - low); /* elements without extent; 100,000 cells are enough for any structure */
    for (PetscInt s = 0; s < fine->n; s++) key[s].hash = (key[s].hash << 20) + (cell > 0.0 ? (uint64_t)((fine->box[6 * s + c] - low) / cell + 1e-3) : 0);
  }
  if (fine->n) qsort(key, (size_t)fine->n, sizeof(*key), LatinKeyCompare);
  level->groups = 0;
  PetscCall(PetscMalloc3(fine->n + 1, &level->first, fine->n, &level->member, fine->n, &level->interior));
  for (PetscInt s = 0; s < fine->n; s++) {
    if (!s || key[s].hash != key[s - 1].hash) level->first[level->groups++] = s;
    level->member[s] = key[s].number;
  }
  level->first[level->groups] = fine->n;
  PetscCall(PetscFree2(key, extent));
  PetscFunctionReturn(0);
}

/*
   The dofs of each group: interior ones first, each kind in the order in which the members bring them, so that equal
   groups number them alike. They are the new elements' dofs, without the interior ones.
*/
static PetscErrorCode LatinGroupsNumber_Private(LatinGroupLevel *level, PetscInt dofs, const PetscBool outside[])
{
  const LatinElements *fine   = &level->fine;
  LatinElements       *coarse = &level->coarse;
  PetscInt            *touch, *mine, *number, entries = 0;

  PetscFunctionBegin;
  PetscCall(PetscCalloc3(dofs, &touch, dofs, &mine, dofs, &number));
  for (PetscInt i = 0; i < fine->offset[fine->n]; i++) touch[fine->dof[i]]++;
  coarse->n = level->groups;
  PetscCall(PetscMalloc1(fine->offset[fine->n], &level->slot));
  PetscCall(PetscMalloc3(coarse->n + 1, &coarse->offset, coarse->n, &coarse->pattern, coarse->n, &coarse->h_offset));
  PetscCall(PetscMalloc2(fine->offset[fine->n], &coarse->dof, 6 * coarse->n, &coarse->box));
  for (PetscInt g = 0; g < level->groups; g++) {
    PetscReal *box      = coarse->box + 6 * g;
    PetscInt   interior = 0, boundary = 0;

    coarse->offset[g] = entries;
    for (PetscInt pass = 0; pass < 3; pass++)
      for (PetscInt m = level->first[g]; m < level->first[g + 1]; m++) {
        const PetscInt s = level->member[m];

        for (PetscInt c = 0; c < 6 && !pass; c++) {
          const PetscReal x = fine->box[6 * s + c];

          if (m == level->first[g]) box[c] = x;
          else box[c] = c < 3 ? PetscMin(box[c], x) : PetscMax(box[c], x);
        }
        for (PetscInt i = fine->offset[s]; i < fine->offset[s + 1]; i++) {
          const PetscInt d = fine->dof[i];

          if (pass == 0) {
            mine[d]++;
            number[d] = -1;
          } else if (pass == 1) {
            if (number[d] >= 0) continue;
            if (mine[d] == touch[d] && !outside[d]) number[d] = interior++;
            else {
              number[d]              = boundary++;
              coarse->dof[entries++] = d;
            }
          } else level->slot[i] = number[d] + (mine[d] == touch[d] && !outside[d] ? 0 : interior);
        }
      }
    for (PetscInt m = level->first[g]; m < level->first[g + 1]; m++)
      for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) mine[fine->dof[i]] = 0;
    level->interior[g] = interior;
  }
  coarse->offset[coarse->n] = entries;
  PetscCall(PetscFree3(touch, mine, number));
  PetscFunctionReturn(0);
}

/* Groups of equal members in equal arrangement, sorted by pattern */
static PetscErrorCode LatinGroupsCompare_Private(LatinGroupLevel *level)
{
  const LatinElements *fine = &level->fine;
  PetscInt            *data, *count, n = 0;
  size_t              *first;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(level->groups + 1, &first, 2 * fine->n + fine->offset[fine->n] + level->groups, &data));
  for (PetscInt g = 0; g < level->groups; g++) {
    first[g]  = (size_t)n * sizeof(*data);
    data[n++] = level->interior[g];
    for (PetscInt m = level->first[g]; m < level->first[g + 1]; m++) {
      const PetscInt s = level->member[m];

      data[n++] = fine->pattern[s];
      data[n++] = fine->offset[s + 1] - fine->offset[s];
      for (PetscInt i = fine->offset[s]; i < fine->offset[s + 1]; i++) data[n++] = level->slot[i];
    }
  }
  first[level->groups] = (size_t)n * sizeof(*data);
  PetscCall(LatinFindEqual(level->groups, first, data, level->coarse.pattern));
  PetscCall(PetscFree2(first, data));
  level->patterns = 0;
  PetscCall(PetscCalloc1(level->groups, &count));
  for (PetscInt g = 0; g < level->groups; g++) level->patterns += count[level->coarse.pattern[g]]++ ? 0 : 1;
  PetscCall(PetscMalloc4(level->patterns + 1, &level->pattern_first, level->groups, &level->pattern_group, level->patterns, &level->l_offset, level->patterns + 1, &level->v_offset));
  level->pattern_first[0] = 0;
  for (PetscInt g = 0, p = 0; g < level->groups; g++) {
    if (level->coarse.pattern[g] != g) continue;
    level->pattern_first[p + 1] = level->pattern_first[p] + count[g];
    count[g]                    = level->pattern_first[p++]; /* from here on the next place */
  }
  for (PetscInt g = 0; g < level->groups; g++) level->pattern_group[count[level->coarse.pattern[g]]++] = g;
  PetscCall(PetscFree(count));
  PetscFunctionReturn(0);
}

/* L, Z and S of one group; K and the factors are column-major */
static PetscErrorCode LatinGroupsFactorOne_Private(LatinGroupLevel *level, PetscInt g, PetscReal L[], PetscReal Z[], PetscReal S[], PetscBool *good)
{
  const LatinElements *fine = &level->fine;
  const PetscInt       n = level->interior[g], b = level->coarse.offset[g + 1] - level->coarse.offset[g];
  const PetscScalar    one = 1.0, minus = -1.0;
  PetscReal           *diagonal;
  PetscBLASInt         bn, bb, info = 0;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(n, &bn));
  PetscCall(PetscBLASIntCast(b, &bb));
  PetscCall(PetscArrayzero(L, n * n));
  PetscCall(PetscArrayzero(Z, n * b));
  PetscCall(PetscArrayzero(S, b * b));
  for (PetscInt m = level->first[g]; m < level->first[g + 1]; m++) {
    const PetscInt   s = level->member[m], size = fine->offset[s + 1] - fine->offset[s], *slot = level->slot + fine->offset[s];
    const PetscReal *H = fine->H + fine->h_offset[s];

    for (PetscInt j = 0; j < size; j++)
      for (PetscInt i = 0; i < size; i++) {
        const PetscReal value = H[i + size * j];

        if (slot[i] < n && slot[j] < n) L[slot[i] + n * slot[j]] += value;
        else if (slot[i] < n) Z[slot[i] + n * (slot[j] - n)] += value;
        else if (slot[j] >= n) S[slot[i] - n + b * (slot[j] - n)] += value;
      }
  }
  if (!n) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(n, &diagonal));
  for (PetscInt i = 0; i < n; i++) diagonal[i] = L[i + n * i];
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &bn, L, &bn, &info));
  if (info) *good = PETSC_FALSE;
  for (PetscInt i = 0; i < n && *good; i++)
    if (!(PetscSqr(L[i + n * i]) > LATIN_GROUP_PIVOT * diagonal[i])) *good = PETSC_FALSE;
  PetscCall(PetscFree(diagonal));
  if (!*good || !b) PetscFunctionReturn(0);
  PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "N", "N", &bn, &bb, &one, L, &bn, Z, &bn));
  PetscCallBLAS("BLASsyrk", BLASsyrk_("L", "T", &bb, &bn, &minus, Z, &bn, &one, S, &bb));
  for (PetscInt j = 0; j < b; j++)
    for (PetscInt i = 0; i < j; i++) S[i + b * j] = S[j + b * i];
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGroupsFactor_Private(LatinGroupLevel *level, PetscBool *good)
{
  LatinElements *coarse = &level->coarse;
  size_t         l = 0, s = 0, v = 0;
  PetscInt       widest = 0;

  PetscFunctionBegin;
  for (PetscInt p = 0; p < level->patterns; p++) {
    const PetscInt g = level->pattern_group[level->pattern_first[p]], b = coarse->offset[g + 1] - coarse->offset[g];
    const size_t   n = (size_t)level->interior[g];

    level->l_offset[p]  = l;
    level->v_offset[p]  = v;
    coarse->h_offset[g] = s;
    l += n * (n + (size_t)b);
    s += (size_t)b * (size_t)b;
    v += n * (size_t)(level->pattern_first[p + 1] - level->pattern_first[p]);
    widest = PetscMax(widest, b);
  }
  level->v_offset[level->patterns] = v;
  for (PetscInt g = 0; g < level->groups; g++) coarse->h_offset[g] = coarse->h_offset[coarse->pattern[g]];
  PetscCall(PetscMalloc3(l, &level->L, v, &level->v, widest * LATIN_GROUP_COLUMNS, &level->work));
  PetscCall(PetscMalloc1(s, &coarse->H));
  PetscCall(PetscMalloc2(coarse->offset[coarse->n], &coarse->q, coarse->offset[coarse->n], &coarse->u));
  for (PetscInt p = 0; p < level->patterns && *good; p++) {
    const PetscInt g = level->pattern_group[level->pattern_first[p]];
    PetscReal     *L = level->L + level->l_offset[p];

    PetscCall(LatinGroupsFactorOne_Private(level, g, L, L + (size_t)level->interior[g] * (size_t)level->interior[g], coarse->H + coarse->h_offset[g], good));
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGroupsLevelReset_Private(LatinGroupLevel *level)
{
  PetscFunctionBegin;
  PetscCall(PetscFree3(level->first, level->member, level->interior));
  PetscCall(PetscFree(level->slot));
  PetscCall(PetscFree4(level->pattern_first, level->pattern_group, level->l_offset, level->v_offset));
  PetscCall(PetscFree3(level->L, level->v, level->work));
  PetscCall(PetscFree3(level->coarse.offset, level->coarse.pattern, level->coarse.h_offset));
  PetscCall(PetscFree2(level->coarse.dof, level->coarse.box));
  PetscCall(PetscFree(level->coarse.H));
  PetscCall(PetscFree2(level->coarse.q, level->coarse.u));
  PetscCall(PetscMemzero(level, sizeof(*level)));
  PetscFunctionReturn(0);
}

/* One more level on top of the last; not kept when groups do not repeat, are too large for dense factors, or are singular */
static PetscErrorCode LatinGroupsLevelSetUp_Private(LatinGroupLevel *level, const LatinElements *fine, PetscInt width, PetscInt dofs, const PetscBool outside[], PetscBool *kept)
{
  PetscInt distinct = 0, largest = 0;

  PetscFunctionBegin;
  *kept       = PETSC_FALSE;
  level->fine = *fine;
  for (PetscInt s = 0; s < fine->n; s++) distinct += fine->pattern[s] == s ? 1 : 0;
  if (2 * distinct >= fine->n) PetscFunctionReturn(0); /* equal groups are made of equal members */
  PetscCall(LatinGroupsGroup_Private(level, width));
  PetscCall(LatinGroupsNumber_Private(level, dofs, outside));
  PetscCall(LatinGroupsCompare_Private(level));
  for (PetscInt g = 0; g < level->groups; g++) largest = PetscMax(largest, level->interior[g]);
  *kept = (PetscBool)(5 * level->patterns <= 3 * level->groups && largest > 0 && largest <= LATIN_GROUP_INTERIOR);
  if (*kept) PetscCall(LatinGroupsFactor_Private(level, kept));
  if (!*kept) PetscCall(LatinGroupsLevelReset_Private(level));
  PetscFunctionReturn(0);
}

/* Numbers for the coarse displacements that are left, and where they are found */
static PetscErrorCode LatinGroupsTop_Private(LatinCoarse *coarse, const LatinElements *finest, PetscInt dofs)
{
  LatinElements *top     = &coarse->top;
  const PetscInt entries = finest->offset[finest->n], own = coarse->macro->modes_local + coarse->primal_local;
  MPI_Comm       comm = PetscObjectComm(coarse->sub->object);
  PetscInt      *leaf, *root, *left, start = 0;
  PetscLayout    map;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(entries, &leaf, own, &root, dofs, &left));
  PetscCall(PetscArrayzero(left, dofs));
  PetscCall(PetscArrayzero(root, own));
  for (PetscInt i = 0; i < top->offset[top->n]; i++) left[top->dof[i]] = 1;
  for (PetscInt i = 0; i < entries; i++) leaf[i] = left[finest->dof[i]];
  PetscCall(LatinSFReduce_Private(coarse->sf, 1, MPIU_INT, leaf, root, MPI_MAX));
  coarse->top_local = 0;
  for (PetscInt i = 0; i < own; i++) coarse->top_local += root[i];
  PetscCallMPI(MPI_Scan(&coarse->top_local, &start, 1, MPIU_INT, MPI_SUM, comm));
  start -= coarse->top_local;
  for (PetscInt i = 0; i < own; i++) root[i] = root[i] ? start++ : -1;
  PetscCall(LatinSFBcast_Private(coarse->sf, 1, MPIU_INT, root, leaf));
  for (PetscInt i = 0; i < entries; i++) left[finest->dof[i]] = leaf[i];
  PetscCall(PetscMalloc1(top->offset[top->n], &coarse->top_global));
  for (PetscInt i = 0; i < top->offset[top->n]; i++) coarse->top_global[i] = left[top->dof[i]];
  PetscCall(PetscFree3(leaf, root, left));
  PetscCall(PetscLayoutCreateFromSizes(comm, coarse->top_local, PETSC_DETERMINE, 1, &map));
  PetscCall(PetscLayoutGetSize(map, &coarse->top_size));
  PetscCall(PetscSFCreate(comm, &coarse->top_sf));
  PetscCall(PetscSFSetGraphLayout(coarse->top_sf, map, top->offset[top->n], NULL, PETSC_COPY_VALUES, coarse->top_global));
  PetscCall(PetscSFSetUp(coarse->top_sf));
  PetscCall(PetscLayoutDestroy(&map));
  PetscFunctionReturn(0);
}

/* Sets coarse.top, the elements of the coarse problem that the coarse KSP solves; width 1: the subdomains themselves. Collective */
PetscErrorCode LatinGroupsSetUp(LatinCoarse *coarse, const LatinHomogenised *stiffness, PetscInt width)
{
  PetscBool    *outside = NULL, kept = PETSC_TRUE;
  PetscInt      dofs = 0;
  LatinElements finest;

  PetscFunctionBegin;
  PetscCall(LatinGroupsFinest_Private(coarse, stiffness, &finest, &dofs, &outside));
  coarse->top = finest;
  while (width > 1 && kept && coarse->levels < LATIN_GROUP_LEVELS) {
    LatinGroupLevel *level = &coarse->level[coarse->levels];

    PetscCall(LatinGroupsLevelSetUp_Private(level, &coarse->top, width, dofs, outside, &kept));
    if (!kept) break;
    coarse->levels++;
    coarse->top = level->coarse;
    PetscCall(PetscInfo(coarse->sub->object, "nested condensation, level %" PetscInt_FMT ": %" PetscInt_FMT " groups, %" PetscInt_FMT " different\n", coarse->levels, level->groups, level->patterns));
  }
  PetscCall(LatinGroupsTop_Private(coarse, &finest, dofs));
  PetscCall(PetscFree(outside));
  PetscCall(PetscFree2(finest.dof, finest.box));
  PetscFunctionReturn(0);
}

/* What only the set-up needs: operators of the groups */
PetscErrorCode LatinGroupsFinish(LatinCoarse *coarse)
{
  PetscFunctionBegin;
  for (PetscInt k = 0; k < coarse->levels; k++) {
    PetscCall(PetscFree(coarse->level[k].coarse.H));
    PetscCall(PetscFree2(coarse->level[k].coarse.dof, coarse->level[k].coarse.box));
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

/* Between the dofs of a group's members and columns of interior and boundary dofs: q added down, u copied up */
static void LatinGroupsGather(const LatinGroupLevel *level, PetscInt g, PetscReal interior[], PetscReal boundary[])
{
  const LatinElements *fine = &level->fine;
  const PetscInt       n    = level->interior[g];

  for (PetscInt m = level->first[g]; m < level->first[g + 1]; m++)
    for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) {
      if (level->slot[i] < n) interior[level->slot[i]] += fine->q[i];
      else boundary[level->slot[i] - n] += fine->q[i];
    }
}

static void LatinGroupsScatter(const LatinGroupLevel *level, PetscInt g, const PetscReal interior[], const PetscReal boundary[])
{
  const LatinElements *fine = &level->fine;
  const PetscInt       n    = level->interior[g];

  for (PetscInt m = level->first[g]; m < level->first[g + 1]; m++)
    for (PetscInt i = fine->offset[level->member[m]]; i < fine->offset[level->member[m] + 1]; i++) fine->u[i] = level->slot[i] < n ? interior[level->slot[i]] : boundary[level->slot[i] - n];
}

/* From forces on the subdomains' coarse dofs to forces on the groups'; and from the groups' displacements back */
static PetscErrorCode LatinGroupsPass_Private(LatinGroupLevel *level, PetscBool up)
{
  const LatinElements *coarse = &level->coarse;
  const PetscScalar    one = 1.0, minus = -1.0;

  PetscFunctionBegin;
  for (PetscInt p = 0; p < level->patterns; p++) {
    const PetscInt   g0 = level->pattern_group[level->pattern_first[p]], n = level->interior[g0], b = coarse->offset[g0 + 1] - coarse->offset[g0];
    const PetscReal *L = level->L + level->l_offset[p], *Z = L + (size_t)n * (size_t)n;
    PetscBLASInt     bn, bb, columns;

    PetscCall(PetscBLASIntCast(n, &bn));
    PetscCall(PetscBLASIntCast(b, &bb));
    for (PetscInt first = level->pattern_first[p]; first < level->pattern_first[p + 1]; first += LATIN_GROUP_COLUMNS) {
      const PetscInt  last = PetscMin(first + LATIN_GROUP_COLUMNS, level->pattern_first[p + 1]);
      const PetscInt *g    = level->pattern_group + first;
      PetscReal      *v = level->v + level->v_offset[p] + (size_t)n * (size_t)(first - level->pattern_first[p]), *w = level->work;

      PetscCall(PetscBLASIntCast(last - first, &columns));
      if (up) {
        for (PetscInt k = 0; k < last - first; k++) PetscCall(PetscArraycpy(w + b * k, coarse->u + coarse->offset[g[k]], b));
        if (n && b) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &bn, &columns, &bb, &minus, Z, &bn, w, &bb, &one, v, &bn));
        if (n) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "T", "N", &bn, &columns, &one, L, &bn, v, &bn));
        for (PetscInt k = 0; k < last - first; k++) LatinGroupsScatter(level, g[k], v + (size_t)n * (size_t)k, w + b * k);
      } else {
        PetscCall(PetscArrayzero(v, n * (last - first)));
        PetscCall(PetscArrayzero(w, b * (last - first)));
        for (PetscInt k = 0; k < last - first; k++) LatinGroupsGather(level, g[k], v + (size_t)n * (size_t)k, w + b * k);
        if (n) PetscCallBLAS("BLAStrsm", BLAStrsm_("L", "L", "N", "N", &bn, &columns, &one, L, &bn, v, &bn));
        if (n && b) PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &bb, &columns, &bn, &minus, Z, &bn, v, &bn, &one, w, &bb));
        for (PetscInt k = 0; k < last - first; k++) PetscCall(PetscArraycpy(coarse->q + coarse->offset[g[k]], w + b * k, b));
      }
    }
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
