#include "structure/turning.h"
#include "subdomains/latinsubdomains.h"

/*
   Substructuring, section 3.1: links, not nodes, are partitioned, so that laws are inside subdomains.

   1. Subdomains are assigned to ranks, each a block of consecutive ones.
   2. Links go to the ranks of their subdomains.
   3. Each subdomain gets copies of its nodes, with their data.
   4. Links with a state are numbered.
*/

#define LATIN_FACTOR_POWER 1.5 /* exponent of the growth of the entries of a factor with the links of a subdomain */

/* Assigns subdomains to ranks, balanced by cost: in the prefix sum of costs, the midpoint of a subdomain determines its rank. Collective on sub->object */
static PetscErrorCode LatinSubdomainsDeal_Private(LatinSubdomains *sub)
{
  MPI_Comm    comm = PetscObjectComm(sub->object);
  PetscMPIInt size, rank, last = 0;
  PetscInt   *links;
  PetscReal   whole = 0.0, sum = 0.0;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(PetscCalloc1(sub->count, &links));
  for (PetscInt l = 0; l < sub->structure->links_local; l++) links[sub->of_link[l]]++;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, links, (PetscMPIInt)sub->count, MPIU_INT, MPI_SUM, comm));
  for (PetscInt s = 0; s < sub->count; s++) whole += PetscPowReal((PetscReal)links[s], LATIN_FACTOR_POWER);
  PetscCall(PetscCalloc1(size + 1, &sub->rank_first));
  for (PetscInt s = 0; s < sub->count; s++) {
    const PetscReal cost = PetscPowReal((PetscReal)links[s], LATIN_FACTOR_POWER);

    while (last < size - 1 && (sum + 0.5 * cost) * size > whole * (1.0 + PETSC_SMALL) * (last + 1)) sub->rank_first[++last] = s;
    sum += cost;
  }
  while (last < size) sub->rank_first[++last] = sub->count;
  PetscCall(PetscFree(links));
  sub->first = sub->rank_first[rank];
  sub->n     = sub->rank_first[rank + 1] - sub->first;
  PetscFunctionReturn(0);
}

/* Measures the load balance, maximum over mean: links (entries of a matrix) and free dofs of subdomains, cost of ranks as above. Collective on sub->object */
PetscErrorCode LatinSubdomainsBalance_Private(const LatinSubdomains *sub, PetscReal *links, PetscReal *dofs, PetscReal *ranks)
{
  MPI_Comm       comm   = PetscObjectComm(sub->object);
  const PetscInt bs     = sub->bs;
  PetscReal      sum[3] = {0.0, 0.0, 0.0}, most[3] = {0.0, 0.0, 0.0};
  PetscMPIInt    size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscReal n = (PetscReal)(sub->ki ? sub->ki[sub->node_offset[s + 1]] - sub->ki[sub->node_offset[s]] : sub->link_offset[s + 1] - sub->link_offset[s]);
    PetscInt        m = 0;

    for (PetscInt i = bs * sub->node_offset[s]; i < bs * sub->node_offset[s + 1]; i++) m += sub->fixed[i] ? 0 : 1;
    sum[0] += n;
    sum[1] += m;
    sum[2] += PetscPowReal(n, LATIN_FACTOR_POWER);
    most[0] = PetscMax(most[0], n);
    most[1] = PetscMax(most[1], (PetscReal)m);
  }
  most[2] = sum[2];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 3, MPIU_REAL, MPIU_MAX, comm));
  *links = sum[0] > 0.0 ? most[0] * sub->count / sum[0] : 1.0;
  *dofs  = sum[1] > 0.0 ? most[1] * sub->count / sum[1] : 1.0;
  *ranks = sum[2] > 0.0 ? most[2] * size / sum[2] : 1.0;
  PetscFunctionReturn(0);
}

/* Creates link_sf: the links here, by subdomain, in each by global number. Collective on sub->object */
static PetscErrorCode LatinSubdomainsLinks_Private(LatinSubdomains *sub)
{
  const LatinStructure structure = sub->structure;
  const PetscInt       n         = structure->links_local;
  PetscMPIInt          size;
  PetscInt            *rank, *subdomain, *next, *order;
  const PetscInt      *number;
  IS                   to, arrived;
  PetscSF              sf;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm(sub->object), &size));
  PetscCall(PetscMalloc1(n, &rank));
  for (PetscInt l = 0; l < n; l++) rank[l] = LatinSubdomainRank(sub, size, sub->of_link[l]);
  PetscCall(ISCreateGeneral(PetscObjectComm(sub->object), n, rank, PETSC_OWN_POINTER, &to));
  PetscCall(ISBuildTwoSided(to, NULL, &arrived));
  PetscCall(ISSort(arrived));
  PetscCall(ISGetLocalSize(arrived, &sub->links));
  PetscCall(ISGetIndices(arrived, &number));
  PetscCall(PetscMalloc3(sub->links, &subdomain, sub->links, &order, sub->n, &next));
  PetscCall(LatinSFFetch_Private(PetscObjectComm(sub->object), n, sub->links, number, &sf));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_INT, sub->of_link, subdomain));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscCalloc1(sub->n + 1, &sub->link_offset));
  for (PetscInt l = 0; l < sub->links; l++) sub->link_offset[subdomain[l] - sub->first + 1]++;
  for (PetscInt s = 0; s < sub->n; s++) {
    next[s] = sub->link_offset[s];
    sub->link_offset[s + 1] += sub->link_offset[s];
  }
  for (PetscInt l = 0; l < sub->links; l++) order[next[subdomain[l] - sub->first]++] = number[l];
  PetscCall(LatinSFFetch_Private(PetscObjectComm(sub->object), n, sub->links, order, &sub->link_sf));
  PetscCall(PetscFree3(subdomain, order, next));
  PetscCall(ISRestoreIndices(arrived, &number));
  PetscCall(ISDestroy(&arrived));
  PetscCall(ISDestroy(&to));
  PetscFunctionReturn(0);
}

/* Makes the copies: the nodes of the links of each subdomain, by increasing number. Collective on sub->object */
static PetscErrorCode LatinSubdomainsCopies_Private(LatinSubdomains *sub)
{
  PetscInt *node; /* nodes of link ends, subdomain by subdomain; then copies, which overwrite nodes that have been read */

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(2 * sub->links, &sub->ends));
  PetscCall(PetscMalloc1(sub->n + 1, &sub->node_offset));
  PetscCall(PetscMalloc1(2 * sub->links, &node));
  PetscCall(LatinSFBcast_Private(sub->link_sf, 2, MPIU_INT, sub->structure->nodes, node));
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt first = 2 * sub->link_offset[s], last = 2 * sub->link_offset[s + 1];
    PetscInt       count;

    sub->node_offset[s] = sub->copies;
    PetscCall(LatinPlaces_Private(last - first, node + first, &count, node + sub->copies, sub->ends + first));
    for (PetscInt i = first; i < last; i++) sub->ends[i] += sub->copies;
    sub->copies += count;
  }
  sub->node_offset[sub->n] = sub->copies;
  PetscCall(PetscMalloc1(sub->copies, &sub->node));
  PetscCall(PetscArraycpy(sub->node, node, sub->copies));
  PetscCall(PetscFree(node));
  PetscFunctionReturn(0);
}

/* Lists masses without links, which are in no subdomain: a spring to the ground alone holds them. Collective on sub->object */
static PetscErrorCode LatinSubdomainsUnassigned_Private(LatinSubdomains *sub)
{
  const PetscInt    *degree;
  const PetscScalar *ground;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(sub->structure->ground, &n));
  PetscCall(PetscSFComputeDegreeBegin(sub->dof_sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sub->dof_sf, &degree));
  for (PetscInt i = 0; i < n; i++) sub->unassigned_count += degree[i] ? 0 : 1;
  PetscCall(PetscMalloc2(sub->unassigned_count, &sub->unassigned, sub->unassigned_count, &sub->unassigned_inverse));
  PetscCall(VecGetArrayRead(sub->structure->ground, &ground));
  for (PetscInt i = 0, k = 0; i < n; i++) {
    if (degree[i]) continue;
    sub->unassigned[k]           = i;
    sub->unassigned_inverse[k++] = 1.0 / PetscRealPart(ground[i]);
  }
  PetscCall(VecRestoreArrayRead(sub->structure->ground, &ground));
  PetscFunctionReturn(0);
}

/* Creates scatters from nodes of the structure and from vectors of the DM to copies; gets node data at the copies. Collective on sub->object */
static PetscErrorCode LatinSubdomainsNodeData_Private(LatinSubdomains *sub)
{
  LatinStructure  structure = sub->structure;
  const PetscInt  dim = structure->dim, n = sub->copies;
  PetscLayout     map;
  const PetscInt *degree;
  PetscInt       *remote, *local, m = 0;

  PetscFunctionBegin;
  PetscCall(LatinSFFetch_Private(PetscObjectComm(sub->object), structure->nodes_local, n, sub->node, &sub->node_sf));
  PetscCall(PetscMalloc5(dim * n, &sub->x, dim * n, &sub->fixed, dim * n, &sub->prescribed, n, &sub->multiplicity, dim * n, &sub->global_dof));
  PetscCall(LatinSFBcast_Private(sub->node_sf, dim, MPIU_REAL, structure->x, sub->x));
  PetscCall(LatinSFBcast_Private(sub->node_sf, dim, LATIN_MPI_BOOL, structure->fixed, sub->fixed));
  PetscCall(LatinSFBcast_Private(sub->node_sf, dim, MPIU_REAL, structure->prescribed, sub->prescribed));
  PetscCall(LatinSFBcast_Private(sub->node_sf, dim, MPIU_INT, structure->global_dof, sub->global_dof));
  PetscCall(PetscSFComputeDegreeBegin(sub->node_sf, &degree));
  PetscCall(PetscSFComputeDegreeEnd(sub->node_sf, &degree));
  PetscCall(LatinSFBcast_Private(sub->node_sf, 1, MPIU_INT, degree, sub->multiplicity));

  PetscCall(PetscMalloc2(dim * n, &remote, dim * n, &local));
  for (PetscInt i = 0; i < dim * n; i++)
    if (!sub->fixed[i]) {
      remote[m]  = sub->global_dof[i];
      local[m++] = i;
    }
  PetscCall(VecGetLayout(structure->load, &map));
  PetscCall(PetscSFCreate(PetscObjectComm(sub->object), &sub->dof_sf));
  PetscCall(PetscSFSetGraphLayout(sub->dof_sf, map, m, local, PETSC_COPY_VALUES, remote));
  PetscCall(PetscFree2(remote, local));
  PetscCall(LatinStructureCheckFreeUnlinked_Private(structure));
  if (structure->free_unlinked >= 0) PetscCall(LatinSubdomainsUnassigned_Private(sub));
  if (structure->ground) {
    PetscCall(PetscCalloc1(dim * n, &sub->ground));
    PetscCall(LatinDistribute_Private(sub, structure->ground, sub->ground));
    for (PetscInt i = 0; i < dim * n; i++) sub->ground[i] /= sub->multiplicity[i / dim];
  }
  PetscFunctionReturn(0);
}

/* Scatters values of the links with a state to the links of the structure, 0 to the others. Collective on sub->object */
PetscErrorCode LatinSubdomainsReturn_Private(const LatinSubdomains *sub, const PetscReal state[], PetscReal value[])
{
  PetscReal *here;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(sub->links, &here));
  for (PetscInt i = 0; i < sub->nonsmooth; i++) here[sub->nonsmooth_link[i]] = state[i];
  PetscCall(LatinSFReduce_Private(sub->link_sf, 1, MPIU_REAL, here, value, MPI_REPLACE));
  PetscCall(PetscFree(here));
  PetscFunctionReturn(0);
}

/* Whether link l has an end with a free component. Otherwise it acts on no unknown, and a state would only add noise */
static PetscBool LatinSubdomainsMoves(const LatinSubdomains *sub, PetscInt l)
{
  const PetscInt dim = sub->structure->dim;

  for (PetscInt s = 0; s < 2; s++)
    for (PetscInt c = 0; c < dim; c++)
      if (!sub->fixed[dim * sub->ends[2 * l + s] + c]) return PETSC_TRUE;
  return PETSC_FALSE;
}

/*
   Sets the ascent directions of the local stages: stiffnesses; of rigid links the search parameters of the caller, or else automatic ones. Collective
   on sub->object
*/
static PetscErrorCode LatinSubdomainsAscents_Private(LatinSubdomains *sub)
{
  LatinStructure structure = sub->structure;
  PetscReal     *k;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &k));
  for (PetscInt l = 0; l < structure->links_local; l++) k[l] = LatinLaws[structure->law[l]].rigid && !LatinStructureTuned(structure, l) && !sub->tangent ? structure->stiffness[l] : sub->link_stiffness[l];
  PetscCall(LatinSFBcast_Private(sub->link_sf, 1, MPIU_REAL, k, sub->stiffness));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &k));
  PetscFunctionReturn(0);
}

/* Updates link data that may change without a new partition: initial elongations, stiffnesses, data of links with large rotations. Collective on sub->object */
PetscErrorCode LatinSubdomainsRefresh(LatinSubdomains *sub)
{
  LatinStructure structure = sub->structure;

  PetscFunctionBegin;
  PetscCall(LatinSubdomainsAscents_Private(sub));
  PetscCall(LatinSFBcast_Private(sub->link_sf, 1, MPIU_REAL, structure->e0, sub->e0));
  if (sub->part) {
    PetscCall(LatinSFBcast_Private(sub->link_sf, structure->dim, MPIU_REAL, structure->direction, sub->direction));
    PetscCall(LatinSFBcast_Private(sub->link_sf, LATIN_PART, MPIU_REAL, structure->part, sub->part));
  }
  /* gaps of rigid links may be infinite; links that act on no unknown must not give infinite forces */
  if (structure->rigid_law >= 0)
    for (PetscInt l = 0; l < sub->links; l++)
      if (LatinLaws[sub->law[l]].rigid && !LatinSubdomainsMoves(sub, l)) sub->e0[l] = 0.0;
  PetscFunctionReturn(0);
}

/* Sets up the subdomains from a partition: of_link[links_local of the structure], which they take over, and count. Collective on sub->object */
PetscErrorCode LatinSubdomainsSetUp(LatinSubdomains *sub, PetscInt of_link[], PetscInt count)
{
  LatinStructure structure = sub->structure;
  PetscInt       nodes, free;

  PetscFunctionBegin;
  PetscCall(LatinStructureGetSizes(structure, NULL, &nodes, NULL, &free));
  PetscCheck(structure->ground || !nodes || free < structure->dim * nodes, PetscObjectComm(sub->object), PETSC_ERR_MAT_CH_ZRPVT,
             "Nothing is supported: no displacement of any node is prescribed, so that the structure moves as a whole. Prescribe displacements");
  PetscCall(PetscLogEventBegin(LATIN_Subdomains, sub->object, 0, 0, 0));
  sub->dim = sub->bs = sub->fields = structure->dim;
  sub->nodes_local                 = structure->nodes_local;
  sub->of_link                     = of_link;
  sub->count                       = count;
  PetscCall(LatinSubdomainsDeal_Private(sub));
  PetscCall(LatinSubdomainsLinks_Private(sub));
  PetscCall(LatinSubdomainsCopies_Private(sub));
  PetscCall(LatinSubdomainsNodeData_Private(sub));
  PetscCall(PetscMalloc4(structure->dim * sub->links, &sub->direction, sub->links, &sub->stiffness, sub->links, &sub->e0, sub->links, &sub->law));
  PetscCall(LatinSFBcast_Private(sub->link_sf, structure->dim, MPIU_REAL, structure->direction, sub->direction));
  PetscCall(LatinSFBcast_Private(sub->link_sf, 1, MPIU_INT, structure->law, sub->law));
  if (structure->part) PetscCall(PetscMalloc1(LATIN_PART * sub->links + 1, &sub->part)); /* + 1: not NULL, even without links here */
  PetscCall(LatinSubdomainsRefresh(sub));
  if (structure->has_friction) {
    PetscCall(PetscMalloc1(sub->links, &sub->friction));
    PetscCall(LatinSFBcast_Private(sub->link_sf, 1, MPIU_REAL, structure->friction, sub->friction));
  }
  PetscCall(LatinSFFresh_Private(&sub->link_sf));
  PetscCall(LatinSFFresh_Private(&sub->node_sf));
  /* linearised operators: no link has a state */
  PetscCall(PetscMalloc3(sub->tangent ? 0 : sub->links, &sub->nonsmooth_link, sub->links, &sub->state, sub->n + 1, &sub->state_first));
  sub->nonsmooth = 0;
  for (PetscInt s = 0; s < sub->n; s++) {
    sub->state_first[s] = sub->nonsmooth;
    for (PetscInt l = sub->link_offset[s]; l < sub->link_offset[s + 1]; l++) {
      sub->state[l] = !sub->tangent && (sub->part || !LatinLaws[sub->law[l]].smooth) && LatinSubdomainsMoves(sub, l) ? sub->nonsmooth : -1;
      if (sub->state[l] >= 0) sub->nonsmooth_link[sub->nonsmooth++] = l;
    }
  }
  sub->state_first[sub->n] = sub->nonsmooth;
  PetscCall(MPIU_Allreduce(&sub->nonsmooth, &sub->nonsmooth_global, 1, MPIU_INT, MPI_SUM, PetscObjectComm(sub->object)));
  PetscCall(PetscLogEventEnd(LATIN_Subdomains, sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinSubdomainsReset(LatinSubdomains *sub)
{
  PetscFunctionBegin;
  PetscCall(PetscFree(sub->of_link));
  PetscCall(PetscFree(sub->rank_first));
  PetscCall(PetscFree(sub->link_offset));
  PetscCall(PetscFree(sub->node_offset));
  PetscCall(PetscFree(sub->node));
  PetscCall(PetscFree(sub->ends));
  PetscCall(PetscFree5(sub->x, sub->fixed, sub->prescribed, sub->multiplicity, sub->global_dof));
  PetscCall(PetscFree(sub->ground));
  PetscCall(PetscFree4(sub->direction, sub->stiffness, sub->e0, sub->law));
  PetscCall(PetscFree3(sub->nonsmooth_link, sub->state, sub->state_first));
  PetscCall(PetscFree(sub->part));
  PetscCall(PetscFree(sub->friction));
  PetscCall(PetscFree2(sub->field, sub->near));
  PetscCall(PetscFree(sub->ki));
  PetscCall(PetscFree2(sub->kj, sub->ka));
  PetscCall(PetscFree(sub->kd));
  PetscCall(MatDestroy(&sub->dense));
  PetscCall(PetscFree(sub->dense_row));
  PetscCall(PetscFree(sub->row_copy));
  PetscCall(PetscFree2(sub->unassigned, sub->unassigned_inverse));
  PetscCall(PetscSFDestroy(&sub->link_sf));
  PetscCall(PetscSFDestroy(&sub->node_sf));
  PetscCall(PetscSFDestroy(&sub->dof_sf));
  PetscCall(PetscMemzero(&sub->dim, sizeof(*sub) - offsetof(LatinSubdomains, dim)));
  PetscFunctionReturn(0);
}

/*
   Copies the entries of a global vector, of the DM or of the matrix, to free components of copy[copies * bs]; the others are unchanged. Collective on
   sub->object
*/
PetscErrorCode LatinDistribute_Private(const LatinSubdomains *sub, Vec u, PetscReal copy[])
{
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(u, &a));
  PetscCall(LatinSFBcast_Private(sub->dof_sf, 1, MPIU_SCALAR, a, copy));
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscFunctionReturn(0);
}

/* Computes u, sums over the copies on all ranks; zero at unknowns in no subdomain. Collective on sub->object */
PetscErrorCode LatinSum_Private(const LatinSubdomains *sub, const PetscReal copy[], Vec u)
{
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecZeroEntries(u));
  PetscCall(VecGetArray(u, &a));
  PetscCall(LatinSFReduce_Private(sub->dof_sf, 1, MPIU_SCALAR, copy, a, MPI_SUM));
  PetscCall(VecRestoreArray(u, &a));
  PetscFunctionReturn(0);
}

/* Solves for the unknowns in no subdomain: y = x over their diagonal; other entries of y are unchanged */
PetscErrorCode LatinUnassigned_Private(const LatinSubdomains *sub, Vec x, Vec y)
{
  const PetscScalar *a;
  PetscScalar       *b;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(x, &a));
  PetscCall(VecGetArray(y, &b));
  for (PetscInt k = 0; k < sub->unassigned_count; k++) b[sub->unassigned[k]] = sub->unassigned_inverse[k] * a[sub->unassigned[k]];
  PetscCall(VecRestoreArray(y, &b));
  PetscCall(VecRestoreArrayRead(x, &a));
  PetscFunctionReturn(0);
}
