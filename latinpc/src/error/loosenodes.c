#include "error/latinerror.h"

/*
   Nodes that nothing holds by themselves: with all others in their places, a displacement v of the node along which its load
   pushes and that no link resists, however far it goes. It is a proof that there is no equilibrium, see error/collapse.c.

   The links of a node span the space, or the set-up would have found a mechanism of taut links, as a rule. So such v are a cone with an
   edge, and if the load pushes along any of them it does along one of its rays, which are orthogonal to two links. Directions in which the node
   is fixed, and those that a structure in the plane lacks, count as bars.

   Irregular structures that are loose are so at single nodes first, and these are found by a sweep over the links. Where only
   several nodes together are loose nothing is found: see error/loosepatches.c.
*/

#define LATIN_LOOSE_FAR   10.0 /* times the size of the structure: displacements that no equilibrium has */
#define LATIN_LOOSE_LINKS 64   /* of a node: the time grows with their square, and few rays are left beside more */

/* A link at one of its nodes; reals only, since they travel as one message */
typedef struct {
  PetscReal n[3]; /* how a displacement of this node stretches it */
  PetscReal way;  /* in which it resists */
} LatinHalf;

/* Sums over the links h of a node that moves by v: squares of the elongations that they resist, and of all */
static void LatinLooseResisted(PetscInt m, const LatinHalf h[], const PetscReal v[], PetscReal most, PetscReal *resisted, PetscReal *all)
{
  *resisted = *all = 0.0;
  for (PetscInt i = 0; i < m && *resisted <= most; i++) {
    const PetscReal x = h[i].n[0] * v[0] + h[i].n[1] * v[1] + h[i].n[2] * v[2];

    *all += x * x;
    if (((PetscInt)h[i].way & (x > 0.0 ? LATIN_WAY_TRACTION : LATIN_WAY_COMPRESSION))) *resisted += x * x;
  }
}

/* The norm of the tensions that bear the load f where all links of the node are bars; 0 where they do not hold it */
static PetscReal LatinLooseTension(PetscInt m, const LatinHalf h[], const PetscReal f[])
{
  PetscReal A[3][3] = {{0.0}}, y[3], det, sum = 0.0, trace = 0.0;

  for (PetscInt i = 0; i < m; i++)
    for (PetscInt c = 0; c < 3; c++)
      for (PetscInt d = 0; d < 3; d++) A[c][d] += h[i].n[c] * h[i].n[d];
  for (PetscInt c = 0; c < 3; c++) {
    const PetscReal *a = A[(c + 1) % 3], *b = A[(c + 2) % 3];

    trace += A[c][c];
    y[c] = 0.0;
    for (PetscInt d = 0; d < 3; d++) y[c] += f[d] * (a[(d + 1) % 3] * b[(d + 2) % 3] - a[(d + 2) % 3] * b[(d + 1) % 3]);
  }
  det = A[0][0] * (A[1][1] * A[2][2] - A[1][2] * A[2][1]) - A[0][1] * (A[1][0] * A[2][2] - A[1][2] * A[2][0]) + A[0][2] * (A[1][0] * A[2][1] - A[1][1] * A[2][0]);
  if (det <= PETSC_SQRT_MACHINE_EPSILON * trace * trace * trace) return 0.0;
  for (PetscInt c = 0; c < 3; c++) sum += f[c] * y[c] / det; /* the matrix is symmetric, and so are its cofactors */
  return PetscSqrtReal(PetscMax(0.0, sum));
}

/* Is a node loose under the load f, in a structure with this largest load? Its ray v then, of length 1 */
static PetscBool LatinNodeLoose(PetscInt m, const LatinHalf h[], const PetscReal f[], PetscReal largest, PetscReal v[])
{
  const PetscReal tension = LatinLooseTension(m, h, f);

  for (PetscInt i = 0; i < m && tension > 0.0; i++)
    for (PetscInt j = 0; j < i; j++) {
      const PetscReal *a = h[i].n, *b = h[j].n;
      PetscReal        size, push, resisted, all;

      for (PetscInt c = 0; c < 3; c++) v[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
      size = PetscSqrtReal(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
      push = f[0] * v[0] + f[1] * v[1] + f[2] * v[2];
      if (size <= PETSC_SQRT_MACHINE_EPSILON) continue; /* two links in a row */
      if (push < 0.0) size = -size;
      for (PetscInt c = 0; c < 3; c++) v[c] /= size;
      push /= size;
      LatinLooseResisted(m, h, v, PetscSqr(push / (LATIN_COLLAPSE_TENSION * tension)), &resisted, &all);
      if (LatinCollapseProves(push / tension, largest / tension, resisted, all)) return PETSC_TRUE;
    }
  return PETSC_FALSE;
}

/* The links at the nodes of this rank, those of node i from first[i] on. The caller frees both. Collective on structure */
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
    if (bears) mine[i].way = LATIN_WAY_BOTH; /* along a displacement that does not stretch it what it bears does no work */
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

/* The displacements of loose nodes, [nodes_local][dim], from their loads, which these take the place of; how many there are here */
static PetscErrorCode LatinLooseFind_Private(LatinStructure structure, const PetscInt first[], const LatinHalf half[], PetscReal largest, PetscReal load[], PetscInt *count)
{
  const PetscInt dim = structure->dim;
  LatinHalf      h[LATIN_LOOSE_LINKS + 3];

  PetscFunctionBegin;
  *count = 0;
  for (PetscInt i = 0; i < structure->nodes_local; i++) {
    PetscReal f[3] = {0.0, 0.0, 0.0}, v[3];
    PetscInt  m    = first[i + 1] - first[i];
    PetscBool loose;

    if (m > LATIN_LOOSE_LINKS) m = 0;
    PetscCall(PetscArraycpy(h, half + first[i], m));
    for (PetscInt c = 0; c < 3; c++) {
      const PetscBool open = (PetscBool)(c < dim && !structure->fixed[dim * i + c]);

      if (open) f[c] = load[dim * i + c];
      else {
        PetscCall(PetscMemzero(&h[m], sizeof(*h)));
        h[m].n[c]  = 1.0;
        h[m++].way = LATIN_WAY_BOTH;
      }
    }
    loose = (PetscBool)((f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0) && LatinNodeLoose(m, h, f, largest, v));
    for (PetscInt c = 0; c < dim; c++) load[dim * i + c] = loose ? v[c] : 0.0;
    if (loose) ++*count;
  }
  PetscFunctionReturn(0);
}

/*
   The verdict is LATIN_UNBOUNDED where nodes are loose by themselves, with these nodes, and u is where they go, far beyond the
   structure; else both stay. `more` is a load beside that of the structure, or NULL. Collective on structure
*/
PetscErrorCode LatinEquilibriumNodes_Private(LatinStructure structure, Vec more, Vec u, LatinEquilibrium *found)
{
  PetscReal  size, prescribed, largest;
  PetscReal *load;
  PetscInt  *first, count;
  LatinHalf *half;
  Vec        step;

  PetscFunctionBegin;
  if (structure->ground || structure->rubs || structure->span) PetscFunctionReturn(0); /* as in error/collapse.c */
  PetscCall(PetscMalloc2(structure->nodes_local + 1, &first, structure->dim * structure->nodes_local, &load));
  PetscCall(LatinLooseGather_Private(structure, first, &half));
  PetscCall(DMGetGlobalVector(structure->dm, &step));
  PetscCall(VecCopy(structure->load, step));
  if (more) PetscCall(VecAXPY(step, 1.0, more));
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
  PetscCall(PetscInfo(structure, "%" PetscInt_FMT " nodes are loose by themselves\n", count));
  PetscCall(DMRestoreGlobalVector(structure->dm, &step));
  PetscCall(PetscFree2(first, load));
  PetscCall(PetscFree(half));
  PetscFunctionReturn(0);
}
