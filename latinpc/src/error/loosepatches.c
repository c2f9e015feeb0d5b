#include "error/latinerror.h"

/*
   Loose patches: mechanisms of a node and its neighbours, all other nodes fixed. Irregular structures of any size without equilibrium and without
   loose nodes usually have loose patches. A mechanism of a patch on which loads do work is one of the structure: it proves that there is no
   equilibrium, see error/collapse.c.

   A patch contains only nodes whose links are all on this rank; the others count as fixed.
*/

#define LATIN_PATCH_NODES 32  /* most nodes of a patch; the time grows with the third power, and networks have at most 17 */
#define LATIN_PATCH_LINKS 512 /* most links at these nodes */

typedef struct {
  LatinStructure structure;
  PetscInt      *first, *at;            /* links at vertices: those of vertex v from first[v] on */
  PetscReal     *told;                  /* [vertices][2 dim + 1] data of nodes: loads, 1 if free, number of links on all ranks */
  PetscInt      *place;                 /* [vertices] number in the patch, or -1 */
  PetscBool     *has;                   /* [links_local] in the patch */
  PetscInt       vertices, links, both; /* numbers in the patch; both: bilateral links */
  PetscInt       vertex[LATIN_PATCH_NODES];
  PetscInt       link[LATIN_PATCH_LINKS]; /* bilateral links first */
  PetscInt       unknowns;
  PetscInt       unknown[3 * LATIN_PATCH_NODES]; /* number of each displacement, -1: fixed */
  PetscReal      f[3 * LATIN_PATCH_NODES];       /* loads */
  PetscReal      largest;                        /* largest load of the structure */
  PetscReal     *A;                              /* stiffness if all links are bars */
  LatinCone      cone;
} LatinPatch;

/* Returns whether this rank has all links of a vertex, at least one */
static inline PetscBool LatinPatchWhole(const LatinPatch *p, PetscInt v)
{
  const PetscInt links = p->first[v + 1] - p->first[v];

  return (PetscBool)(links && links == (PetscInt)p->told[(2 * p->structure->dim + 1) * v + 2 * p->structure->dim]);
}

/* Gathers the links at the vertices of this rank, and the data of their nodes. Collective on structure */
static PetscErrorCode LatinPatchGather_Private(LatinPatch *p, Vec load)
{
  const LatinStructure structure = p->structure;
  const PetscInt       dim = structure->dim, width = 2 * dim + 1;
  PetscReal           *links, *here, *tell, *force;

  PetscFunctionBegin;
  PetscCall(PetscCalloc2(structure->nodes_local, &links, structure->vertices, &here));
  PetscCall(PetscMalloc2(dim * structure->nodes_local, &force, width * structure->nodes_local, &tell));
  for (PetscInt i = 0; i < 2 * structure->links_local; i++) here[structure->ends[i]] += 1.0;
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, 1, MPIU_REAL, here, links, MPI_SUM));
  PetscCall(LatinStructureGetDisplacements(structure, load, force));
  for (PetscInt i = 0; i < structure->nodes_local; i++) {
    for (PetscInt c = 0; c < dim; c++) {
      tell[width * i + c]       = structure->fixed[dim * i + c] ? 0.0 : force[dim * i + c];
      tell[width * i + dim + c] = structure->fixed[dim * i + c] ? 0.0 : 1.0;
    }
    tell[width * i + 2 * dim] = links[i];
  }
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, width, MPIU_REAL, tell, p->told));
  p->first[0] = 0;
  for (PetscInt v = 0; v < structure->vertices; v++) {
    p->first[v + 1] = p->first[v] + (PetscInt)here[v];
    here[v]         = 0.0;
  }
  for (PetscInt i = 0; i < 2 * structure->links_local; i++) {
    const PetscInt v = structure->ends[i];

    p->at[p->first[v] + (PetscInt)here[v]] = i / 2;
    here[v] += 1.0;
  }
  PetscCall(PetscFree2(force, tell));
  PetscCall(PetscFree2(links, here));
  PetscFunctionReturn(0);
}

/* Adds a vertex and its links to the patch, if all its links are here and there is room */
static void LatinPatchJoin(LatinPatch *p, PetscInt v)
{
  if (p->place[v] >= 0 || !LatinPatchWhole(p, v) || p->vertices == LATIN_PATCH_NODES || p->links + p->first[v + 1] - p->first[v] > LATIN_PATCH_LINKS) return;
  p->place[v]              = p->vertices;
  p->vertex[p->vertices++] = v;
  for (PetscInt i = p->first[v]; i < p->first[v + 1]; i++) {
    if (p->has[p->at[i]]) continue;
    p->has[p->at[i]]    = PETSC_TRUE;
    p->link[p->links++] = p->at[i];
  }
}

/* Makes the patch around a vertex, its unknowns and loads */
static void LatinPatchMake(LatinPatch *p, PetscInt centre)
{
  const PetscInt dim = p->structure->dim;

  p->vertices = p->links = p->unknowns = 0;
  LatinPatchJoin(p, centre);
  for (PetscInt i = p->first[centre]; i < p->first[centre + 1] && p->vertices; i++)
    for (PetscInt end = 0; end < 2; end++) LatinPatchJoin(p, p->structure->ends[2 * p->at[i] + end]);
  for (PetscInt k = 0; k < dim * p->vertices; k++) {
    const PetscReal *told = p->told + (2 * dim + 1) * p->vertex[k / dim];
    const PetscBool  open = (PetscBool)(told[dim + k % dim] > 0.0);

    p->unknown[k] = open ? p->unknowns : -1;
    if (open) p->f[p->unknowns++] = told[k % dim];
  }
}

/* Makes the rows of the links, bilateral ones first, without links that never resist */
static void LatinPatchRows(LatinPatch *p)
{
  const LatinStructure structure = p->structure;
  const PetscInt       dim = structure->dim, n = p->unknowns;
  PetscInt             count = 0;

  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt i = 0; i < p->links; i++) {
      const PetscInt l   = p->link[i];
      PetscReal     *row = p->cone.row + n * count;
      PetscBool      bears;
      PetscInt       way = LatinLinkWay(structure, l, &bears);

      if (bears) way = LATIN_WAY_BOTH; /* its tension does no work on displacements that do not stretch it */
      if (way == LATIN_WAY_NONE || (way == LATIN_WAY_BOTH) != !pass) continue;
      for (PetscInt j = 0; j < n; j++) row[j] = 0.0;
      for (PetscInt j = 0; j < 2 * dim; j++) {
        const PetscInt at = p->place[structure->ends[2 * l + j / dim]], k = at < 0 ? -1 : p->unknown[dim * at + j % dim];

        if (k >= 0) row[k] += ((j < dim) == (way == LATIN_WAY_COMPRESSION) ? 1.0 : -1.0) * structure->direction[dim * l + j % dim];
      }
      count++;
    }
    if (!pass) p->both = count;
  }
  for (PetscInt i = 0; i < p->links; i++) p->has[p->link[i]] = PETSC_FALSE;
  p->links = count; /* from here on the number of rows */
}

/* Adds the mechanisms of loose patches, which may overlap, to move, [vertices][dim]. count: loose patches of this rank, at most LATIN_LISTED */
static PetscErrorCode LatinPatchFind_Private(LatinPatch *p, PetscReal move[], PetscInt *count)
{
  const PetscInt dim = p->structure->dim;

  PetscFunctionBegin;
  *count = 0;
  for (PetscInt v = 0; v < p->structure->vertices && *count < LATIN_LISTED; v++) {
    PetscBool bears = PETSC_TRUE;

    LatinPatchMake(p, v);
    LatinPatchRows(p);
    if (p->unknowns) LatinConeProject(&p->cone, p->unknowns, p->links, p->both, p->f, &bears);
    if (!bears && LatinConeProves(&p->cone, p->links, p->both, p->f, p->largest, p->A)) {
      for (PetscInt k = 0; k < dim * p->vertices; k++)
        if (p->unknown[k] >= 0) move[dim * p->vertex[k / dim] + k % dim] += p->cone.r[p->unknown[k]];
      ++*count;
    }
    for (PetscInt k = 0; k < p->vertices; k++) p->place[p->vertex[k]] = -1;
  }
  PetscFunctionReturn(0);
}

/* Allocates a patch and its cone. Not collective */
static PetscErrorCode LatinPatchRoom_Private(LatinPatch *p)
{
  const LatinStructure structure = p->structure;
  const PetscInt       most      = structure->dim * LATIN_PATCH_NODES;
  LatinCone           *cone      = &p->cone;

  PetscFunctionBegin;
  PetscCall(PetscMalloc5(structure->vertices + 1, &p->first, 2 * structure->links_local, &p->at, (2 * structure->dim + 1) * structure->vertices, &p->told, structure->vertices, &p->place, most * most, &p->A));
  PetscCall(PetscCalloc1(structure->links_local, &p->has));
  PetscCall(PetscMalloc5(most * LATIN_PATCH_LINKS, &cone->row, most * most, &cone->q, most * most, &cone->part, most, &cone->r, most, &cone->along));
  PetscCall(PetscMalloc4(most, &cone->t, most, &cone->next, most, &cone->link, LATIN_PATCH_LINKS, &cone->state));
  for (PetscInt v = 0; v < structure->vertices; v++) p->place[v] = -1;
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPatchFree_Private(LatinPatch *p)
{
  PetscFunctionBegin;
  PetscCall(PetscFree4(p->cone.t, p->cone.next, p->cone.link, p->cone.state));
  PetscCall(PetscFree5(p->cone.row, p->cone.q, p->cone.part, p->cone.r, p->cone.along));
  PetscCall(PetscFree(p->has));
  PetscCall(PetscFree5(p->first, p->at, p->told, p->place, p->A));
  PetscFunctionReturn(0);
}

/* Sets the verdict LATIN_UNBOUNDED with the nodes of loose patches, if any; else *found is unchanged. `more`: an additional load, or NULL. Collective on structure */
PetscErrorCode LatinEquilibriumPatches_Private(LatinStructure structure, Vec more, LatinEquilibrium *found)
{
  const PetscInt dim = structure->dim;
  LatinPatch    *p;
  PetscReal     *move, *node;
  PetscInt       count;
  Vec            step;

  PetscFunctionBegin;
  if (!LatinCollapseMay(structure)) PetscFunctionReturn(0);
  PetscCall(PetscNew(&p));
  p->structure = structure;
  PetscCall(LatinPatchRoom_Private(p));
  PetscCall(PetscCalloc2(dim * structure->vertices, &move, dim * structure->nodes_local, &node));
  PetscCall(DMGetGlobalVector(structure->dm, &step));
  PetscCall(LatinStructureLoads_Private(structure, more, step));
  PetscCall(VecNorm(step, NORM_INFINITY, &p->largest));
  PetscCall(LatinPatchGather_Private(p, step));
  PetscCall(LatinPatchFind_Private(p, move, &count));
  /* the links of a node in a patch are all on one rank: nothing is added twice */
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, dim, MPIU_REAL, move, node, MPI_SUM));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &count, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinStructureNodalVec_Private(structure, node, step));
  if (count) PetscCall(LatinEquilibriumMoved_Private(structure, step, found));
  PetscCall(PetscInfo(structure, "%" PetscInt_FMT " loose patches\n", count));
  PetscCall(DMRestoreGlobalVector(structure->dm, &step));
  PetscCall(PetscFree2(move, node));
  PetscCall(LatinPatchFree_Private(p));
  PetscCall(PetscFree(p));
  PetscFunctionReturn(0);
}
