#include "error/latinerror.h"

/*
   Loose nodes: mechanisms of a single node, all others fixed. A displacement v of the node that no link resists at any amplitude, and on which its
   load does work, proves that there is no equilibrium, see error/collapse.c.

   The load of the node is projected on the cone of forces that its links can bear (error/cone.c).

   Irregular structures without equilibrium usually have loose nodes, which one sweep over the links finds. For mechanisms of several nodes see
   error/loosepatches.c. Both searches are needed: without that of nodes refusals take 1.3 to 2.7 times as long and list fewer nodes; that of patches,
   at a stall in its place, doubles the time of structures that hold (benchmarks/refusals.py, seeds 101, 102).
*/

#define LATIN_LOOSE_FAR   10.0 /* displacements that no equilibrium has, relative to the size of the structure */
#define LATIN_LOOSE_LINKS 64   /* most links of a node */

/* A link at one of its nodes; reals only: it is sent as one message */
typedef struct {
  PetscReal n[3]; /* gradient of its elongation by the displacement of this node */
  PetscReal way;  /* LATIN_WAY_ in which it resists */
} LatinHalf;

/* Projection of the load of one node */
typedef struct {
  LatinCone cone;
  PetscReal row[3 * LATIN_LOOSE_LINKS], q[9], part[9], r[3], along[3], t[3], next[3], A[9];
  PetscInt  link[3], state[LATIN_LOOSE_LINKS];
} LatinLoose;

/* Returns whether a node of m links is loose. load: [dim], replaced by the mechanism, a unit vector, or by zero. largest: largest load of the structure */
static PetscBool LatinNodeLoose(LatinLoose *loose, PetscInt dim, const PetscBool fixed[], PetscInt m, const LatinHalf h[], PetscReal largest, PetscReal load[])
{
  PetscInt  open[3], n = 0, rows = 0, both = 0;
  PetscBool bears;
  PetscReal f[3];

  for (PetscInt c = 0; c < dim; c++) {
    if (!fixed[c]) f[n] = load[c];
    if (!fixed[c]) open[n++] = c;
    load[c] = 0.0;
  }
  if (m > LATIN_LOOSE_LINKS) return PETSC_FALSE;
  for (PetscInt pass = 0; pass < 2; pass++) { /* bilateral links first */
    for (PetscInt i = 0; i < m; i++) {
      const PetscInt way = (PetscInt)h[i].way;

      if (way == LATIN_WAY_NONE || (way == LATIN_WAY_BOTH) == pass) continue;
      for (PetscInt k = 0; k < n; k++) loose->row[n * rows + k] = way == LATIN_WAY_COMPRESSION ? -h[i].n[open[k]] : h[i].n[open[k]];
      rows++;
    }
    if (!pass) both = rows;
  }
  LatinConeProject(&loose->cone, n, rows, both, f, &bears);
  if (bears || !LatinConeProves(&loose->cone, rows, both, f, largest, loose->A)) return PETSC_FALSE;
  for (PetscInt k = 0; k < n; k++) load[open[k]] = loose->r[k];
  return PETSC_TRUE;
}

/* Gathers the links at the nodes of this rank, those of node i from first[i] on. The caller frees *half. Collective on structure */
static PetscErrorCode LatinLooseGather_Private(LatinStructure structure, PetscInt first[], LatinHalf **half)
{
  const PetscInt     n = structure->links_local, dim = structure->dim;
  const PetscInt    *degree;
  const PetscSFNode *root;
  PetscSFNode       *to;
  LatinHalf         *mine;
  MPI_Datatype       type;
  PetscSF            sf;

  PetscFunctionBegin;
  PetscCall(PetscSFGetGraph(structure->vertex_sf, NULL, NULL, NULL, &root));
  PetscCall(PetscMalloc1(2 * n, &to));
  PetscCall(PetscCalloc1(2 * n, &mine));
  for (PetscInt i = 0; i < 2 * n; i++) {
    PetscBool bears;

    to[i]       = root[structure->ends[i]];
    mine[i].way = (PetscReal)LatinLinkWay(structure, i / 2, &bears);
    if (bears) mine[i].way = LATIN_WAY_BOTH; /* its tension does no work on displacements that do not stretch it */
    for (PetscInt c = 0; c < dim; c++) mine[i].n[c] = (i % 2 ? 1.0 : -1.0) * structure->direction[dim * (i / 2) + c];
  }
  PetscCall(PetscSFCreate(PetscObjectComm((PetscObject)structure), &sf));
  PetscCall(PetscSFSetGraph(sf, structure->nodes_local, 2 * n, NULL, PETSC_OWN_POINTER, to, PETSC_OWN_POINTER));
  PetscCall(PetscSFComputeDegreeBegin(sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sf, &degree));
  first[0] = 0;
  for (PetscInt i = 0; i < structure->nodes_local; i++) first[i + 1] = first[i] + degree[i];
  PetscCall(PetscMalloc1(first[structure->nodes_local], half));
  PetscCallMPI(MPI_Type_contiguous(sizeof(LatinHalf) / sizeof(PetscReal), MPIU_REAL, &type));
  PetscCallMPI(MPI_Type_commit(&type));
  PetscCall(PetscSFGatherBegin(sf, type, mine, *half));
  PetscCall(PetscSFGatherEnd(sf, type, mine, *half));
  PetscCallMPI(MPI_Type_free(&type));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree(mine));
  PetscFunctionReturn(0);
}

/* Replaces the loads, [nodes_local][dim], by the mechanisms of loose nodes, zero at others. count: loose nodes of this rank */
static PetscErrorCode LatinLooseFind_Private(LatinStructure structure, const PetscInt first[], const LatinHalf half[], PetscReal largest, PetscReal load[], PetscInt *count)
{
  const PetscInt dim = structure->dim;
  LatinLoose    *loose;

  PetscFunctionBegin;
  *count = 0;
  PetscCall(PetscNew(&loose));
  loose->cone = (LatinCone){.row = loose->row, .q = loose->q, .part = loose->part, .r = loose->r, .along = loose->along, .t = loose->t, .next = loose->next, .link = loose->link, .state = loose->state};
  for (PetscInt i = 0; i < structure->nodes_local; i++)
    if (LatinNodeLoose(loose, dim, structure->fixed + dim * i, first[i + 1] - first[i], half + first[i], largest, load + dim * i)) ++*count;
  PetscCall(PetscFree(loose));
  PetscFunctionReturn(0);
}

/*
   Sets the verdict LATIN_UNBOUNDED with the loose nodes, if any, and u to a displacement along their mechanisms, far beyond the size of the
   structure; else both are unchanged. `more`: an additional load, or NULL. Collective on structure
*/
PetscErrorCode LatinEquilibriumNodes_Private(LatinStructure structure, Vec more, Vec u, LatinEquilibrium *found)
{
  PetscReal  size, prescribed, largest;
  PetscReal *load;
  PetscInt  *first, count;
  LatinHalf *half;
  Vec        step;

  PetscFunctionBegin;
  if (!LatinCollapseMay(structure)) PetscFunctionReturn(0);
  PetscCall(PetscMalloc2(structure->nodes_local + 1, &first, structure->dim * structure->nodes_local, &load));
  PetscCall(LatinLooseGather_Private(structure, first, &half));
  PetscCall(DMGetGlobalVector(structure->dm, &step));
  PetscCall(LatinStructureLoads_Private(structure, more, step));
  PetscCall(VecNorm(step, NORM_INFINITY, &largest));
  PetscCall(LatinStructureGetDisplacements(structure, step, load));
  PetscCall(LatinLooseFind_Private(structure, first, half, largest, load, &count));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &count, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinStructureNodalVec_Private(structure, load, step));
  if (count) {
    PetscCall(LatinEquilibriumMoved_Private(structure, step, found));
    PetscCall(LatinStructureSize_Private(structure, &size, &prescribed));
    PetscCall(VecCopy(step, u));
    PetscCall(VecScale(u, LATIN_LOOSE_FAR * PetscMax(size, prescribed)));
  }
  PetscCall(PetscInfo(structure, "%" PetscInt_FMT " loose nodes\n", count));
  PetscCall(DMRestoreGlobalVector(structure->dm, &step));
  PetscCall(PetscFree2(first, load));
  PetscCall(PetscFree(half));
  PetscFunctionReturn(0);
}
