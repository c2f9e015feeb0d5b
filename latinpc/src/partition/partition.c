#include "partition/latinpartition.h"

/*
   Which subdomain each link belongs to: the caller's partition, or METIS (partition/metis.c), whose cuts are repaired
   (partition/repair.c).
*/

/* All of an array on rank 0: *sf takes what each rank has there, and back. Collective on comm */
static PetscErrorCode LatinOnFirstRank_Private(MPI_Comm comm, PetscInt local, PetscInt global, PetscSF *sf)
{
  PetscLayout map;

  PetscFunctionBegin;
  PetscCall(PetscLayoutCreateFromSizes(comm, local, global, 1, &map));
  PetscCall(PetscSFCreate(comm, sf));
  PetscCall(PetscSFSetGraphWithPattern(*sf, map, PETSCSF_PATTERN_GATHER));
  PetscCall(PetscLayoutDestroy(&map));
  PetscFunctionReturn(0);
}

/* The structure on rank 0 */
static PetscErrorCode LatinCutCreate_Private(LatinStructure structure, PetscSF links, LatinCut *cut)
{
  const PetscInt dim = cut->dim = structure->dim;
  PetscMPIInt    rank;
  PetscSF        nodes;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(PetscObjectComm((PetscObject)structure), &rank));
  cut->nodes = rank ? 0 : structure->nodes_global;
  cut->links = rank ? 0 : structure->links_global;
  PetscCall(PetscMalloc4(2 * cut->links, &cut->ends, dim * cut->nodes, &cut->x, dim * cut->links, &cut->direction, dim * cut->nodes, &cut->fixed));
  PetscCall(PetscCalloc2(cut->nodes + 2, &cut->offset, 2 * cut->links, &cut->incident));
  PetscCall(LatinOnFirstRank_Private(PetscObjectComm((PetscObject)structure), structure->nodes_local, structure->nodes_global, &nodes));
  PetscCall(LatinSFBcast_Private(links, 2, MPIU_INT, structure->nodes, cut->ends));
  PetscCall(LatinSFBcast_Private(links, dim, MPIU_REAL, structure->direction, cut->direction));
  PetscCall(LatinSFBcast_Private(nodes, dim, MPIU_REAL, structure->x, cut->x));
  PetscCall(LatinSFBcast_Private(nodes, dim, LATIN_MPI_BOOL, structure->fixed, cut->fixed));
  PetscCall(PetscSFDestroy(&nodes));
  for (PetscInt i = 0; i < 2 * cut->links; i++) cut->offset[cut->ends[i] + 2]++;
  for (PetscInt v = 0; v < cut->nodes; v++) cut->offset[v + 2] += cut->offset[v + 1];
  for (PetscInt i = 0; i < 2 * cut->links; i++) cut->incident[cut->offset[cut->ends[i] + 1]++] = i / 2;
  PetscFunctionReturn(0);
}

/* METIS is sequential: rank 0 partitions all links and hands the parts back. 0 parts: as many as cost least */
static PetscErrorCode LatinPartitionMetis_Private(LatinStructure structure, const LatinPartitionRequest *request, PetscInt of_link[], PetscInt *count)
{
  MPI_Comm        comm = PetscObjectComm((PetscObject)structure);
  LatinCut        cut  = {.corners = request->corners, .parts = request->subdomains};
  PetscInt       *part;
  const PetscReal largest = PetscMax(4 * (PetscReal)structure->links_global, structure->dim * (PetscReal)structure->nodes_global); /* entries of a graph, and of coordinates */
  PetscMPIInt     ranks;
  int             failed = 0;
  PetscSF         sf;

  PetscFunctionBegin;
  LatinAgree(comm, largest > (PetscReal)PETSC_MPI_INT_MAX, PETSC_ERR_SUP, "METIS on one rank cannot take %" PetscInt_FMT " links: give a partition with LatinSetPartition()", structure->links_global);
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  PetscCall(LatinOnFirstRank_Private(comm, structure->links_local, structure->links_global, &sf));
  PetscCall(LatinCutCreate_Private(structure, sf, &cut));
  PetscCall(PetscMalloc1(cut.links, &part));
  if (cut.links) {
    if (!cut.parts) cut.parts = LatinSubdomainCount(&cut, ranks, request->primal);
    PetscCall(LatinMetis_Private(&cut, part, &failed));
    if (!failed) PetscCall(LatinRepair_Private(&cut, part));
  }
  LatinAgree(comm, failed, PETSC_ERR_LIB, "METIS could not partition %" PetscInt_FMT " links into %" PetscInt_FMT " subdomains (METIS status %d)", cut.links, cut.parts, failed);
  *count = cut.parts;
  PetscCallMPI(MPI_Bcast(count, 1, MPIU_INT, 0, comm));
  PetscCall(LatinSFReduce_Private(sf, 1, MPIU_INT, part, of_link, MPI_REPLACE));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree4(cut.ends, cut.x, cut.direction, cut.fixed));
  PetscCall(PetscFree2(cut.offset, cut.incident));
  PetscCall(PetscFree(part));
  PetscFunctionReturn(0);
}

/* Subdomains without links: an error in a given partition, closed up in another. Collective on structure */
static PetscErrorCode LatinPartitionNumber_Private(LatinStructure structure, PetscBool given, PetscInt of_link[], PetscInt *count)
{
  MPI_Comm  comm = PetscObjectComm((PetscObject)structure);
  PetscInt *number, used = 0, empty = -1;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(*count, &number));
  for (PetscInt l = 0; l < structure->links_local; l++) number[of_link[l]] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, number, (PetscMPIInt)*count, MPIU_INT, MPI_MAX, comm));
  for (PetscInt s = 0; s < *count; s++) {
    if (!number[s] && empty < 0) empty = s;
    number[s] = number[s] ? used++ : -1;
  }
  LatinAgree(comm, given && empty >= 0, PETSC_ERR_ARG_WRONG, "Subdomain %" PetscInt_FMT " of the given partition has no link; number the subdomains from 0 to %" PetscInt_FMT " without gaps", empty, *count - 1);
  for (PetscInt l = 0; l < structure->links_local; l++) of_link[l] = number[of_link[l]];
  *count = used;
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

/* The parts of a contact with friction stay together: they go where its normal part is. Collective on structure */
static PetscErrorCode LatinPartitionContacts_Private(LatinStructure structure, PetscBool given, PetscInt of_link[])
{
  PetscInt cut = -1;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (structure->law[l] != LATIN_LAW_TANGENT || of_link[l] == of_link[l - 1]) continue;
    if (cut < 0) cut = l;
    of_link[l] = of_link[l - 1];
  }
  LatinAgree(PetscObjectComm((PetscObject)structure), given && cut >= 0, PETSC_ERR_ARG_WRONG, "The given partition cuts the contact with friction that link %" PetscInt_FMT " is part of: put all its links into one subdomain",
             structure->links_start + cut);
  PetscFunctionReturn(0);
}

/* The caller's partition: of the solver, or of all solvers on the DM */
static PetscErrorCode LatinPartitionGiven_Private(LatinStructure structure, PetscInt links, const PetscInt given[], PetscInt of_link[], PetscInt *count)
{
  MPI_Comm comm = PetscObjectComm((PetscObject)structure);
  PetscInt bad = -1, last = -1;

  PetscFunctionBegin;
  LatinAgree(comm, links != structure->links_local, PETSC_ERR_ARG_SIZ, "The given partition has the subdomains of %" PetscInt_FMT " links on a rank that has %" PetscInt_FMT ": give each link of the structure one, on all ranks", links,
             structure->links_local);
  for (PetscInt l = 0; l < links; l++) {
    of_link[l] = given[l];
    if (bad < 0 && (given[l] < 0 || given[l] >= structure->links_global)) bad = l;
    last = PetscMax(last, given[l]);
  }
  LatinAgree(comm, bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " is in subdomain %" PetscInt_FMT "; subdomains are numbered from 0, and there are at most as many as links (%" PetscInt_FMT ")", structure->links_start + bad, of_link[bad],
             structure->links_global);
  PetscCall(MPIU_Allreduce(&last, count, 1, MPIU_INT, MPI_MAX, comm));
  (*count)++;
  PetscFunctionReturn(0);
}

/* The subdomain of each link of the caller on this rank, and the number of subdomains. Collective on structure */
PetscErrorCode LatinPartition_Private(LatinStructure structure, LatinPartitionRequest *request, PetscInt of_link[], PetscInt *count)
{
  MPI_Comm        comm  = PetscObjectComm((PetscObject)structure);
  PetscInt        links = request->links, known;
  const PetscInt *given = request->given;
  PetscMPIInt     ranks;
  IS              is = NULL;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Partition, structure, 0, 0, 0));
  LatinAgree(comm, request->subdomains > structure->links_global, PETSC_ERR_ARG_OUTOFRANGE, "Cannot make %" PetscInt_FMT " subdomains of %" PetscInt_FMT " links: ask for at most as many subdomains as links", request->subdomains,
             structure->links_global);
  known = given ? 1 : 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &known, 1, MPIU_INT, MPI_MAX, comm));
  if (!known) PetscCall(PetscObjectQuery((PetscObject)(structure->base ? structure->base->dm : structure->dm), "subdomains", (PetscObject *)&is));
  if (is) {
    known = 1;
    PetscCall(ISGetLocalSize(is, &links));
    PetscCall(ISGetIndices(is, &given));
  }
  if (known) PetscCall(LatinPartitionGiven_Private(structure, links, given, of_link, count));
  else if (request->subdomains == structure->links_global) {
    for (PetscInt l = 0; l < structure->links_local; l++) of_link[l] = structure->links_start + l;
    *count = request->subdomains;
  } else PetscCall(LatinPartitionMetis_Private(structure, request, of_link, count));
  if (is) PetscCall(ISRestoreIndices(is, &given));
  if (structure->rubs) PetscCall(LatinPartitionContacts_Private(structure, (PetscBool)known, of_link));
  PetscCall(LatinPartitionNumber_Private(structure, (PetscBool)known, of_link, count));
  LatinAgree(comm, known && request->subdomains && request->subdomains != *count, PETSC_ERR_ARG_INCOMP, "The given partition has %" PetscInt_FMT " subdomains, not the %" PetscInt_FMT " asked for: leave out one of the two", *count,
             request->subdomains);
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  request->choice = known ? "given" : request->subdomains ? "asked for" : ranks == 1 ? "one factor costs least" : request->primal ? "one a rank costs least" : "of the size that costs least";
  PetscCall(PetscLogEventEnd(LATIN_Partition, structure, 0, 0, 0));
  PetscFunctionReturn(0);
}
