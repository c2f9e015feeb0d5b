#include "partition/latinpartition.h"

/*
   The subdomain of each link, from

     the caller's partition;
     METIS on one rank (partition/metis.c), repaired (partition/repair.c), or bisection for two subdomains with a primal interface;
     PT-Scotch or ParMETIS on all ranks if the structure is large (partition/pieces.c).

   Then all parts of a contact with friction go to one subdomain, and empty subdomains are removed.
*/

/* Creates *sf: entries of a distributed array -> all of it on rank 0. Collective on comm */
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

/* Gathers the structure on rank 0. Collective on structure */
static PetscErrorCode LatinCutCreate_Private(LatinStructure structure, LatinCut *cut)
{
  MPI_Comm       comm = PetscObjectComm((PetscObject)structure);
  const PetscInt dim = cut->dim = structure->dim;
  PetscMPIInt    rank;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  cut->comm  = PETSC_COMM_SELF;
  cut->nodes = rank ? 0 : structure->nodes_global;
  cut->links = rank ? 0 : structure->links_global;
  PetscCall(PetscMalloc2(2 * cut->links, &cut->ends, dim * cut->links, &cut->direction));
  PetscCall(PetscMalloc1(dim * cut->nodes, &cut->fixed));
  PetscCall(LatinOnFirstRank_Private(comm, structure->links_local, structure->links_global, &cut->link_sf));
  PetscCall(LatinOnFirstRank_Private(comm, structure->nodes_local, structure->nodes_global, &cut->node_sf));
  PetscCall(LatinSFBcast_Private(cut->link_sf, 2, MPIU_INT, structure->nodes, cut->ends));
  PetscCall(LatinSFBcast_Private(cut->link_sf, dim, MPIU_REAL, structure->direction, cut->direction));
  PetscCall(LatinSFBcast_Private(cut->node_sf, dim, LATIN_MPI_BOOL, structure->fixed, cut->fixed));
  PetscCall(LatinCutIncidence_Private(cut));
  PetscFunctionReturn(0);
}

/*
   Partitions all links on rank 0, as METIS is sequential, or bisects them for two subdomains with a primal interface, and scatters the result.
   Collective on structure
*/
static PetscErrorCode LatinPartitionMetis_Private(LatinStructure structure, const LatinPartitionRequest *request, PetscInt parts, PetscInt of_link[])
{
  MPI_Comm        comm   = PetscObjectComm((PetscObject)structure);
  const PetscBool halves = (PetscBool)(parts == 2 && request->primal);
  LatinCut        cut    = {.corners = request->corners, .parts = parts, .mean = (PetscReal)structure->links_global / (PetscReal)parts};
  PetscReal      *x;
  PetscInt       *part;
  int             failed = 0;

  PetscFunctionBegin;
  PetscCall(LatinCutCreate_Private(structure, &cut));
  PetscCall(PetscMalloc2(cut.links, &part, halves ? cut.dim * cut.nodes : 0, &x));
  if (halves) PetscCall(LatinSFBcast_Private(cut.node_sf, cut.dim, MPIU_REAL, (structure->base ? structure->base : structure)->x, x));
  if (cut.links && halves) PetscCall(LatinHalves_Private(&cut, x, part, &failed));
  else if (cut.links) {
    PetscCall(LatinMetis_Private(&cut, part, &failed));
    if (!failed) PetscCall(LatinRepairWhole_Private(&cut, part));
  }
  LatinAgree(comm, failed, PETSC_ERR_LIB, "METIS could not partition %" PetscInt_FMT " links into %" PetscInt_FMT " subdomains (METIS status %d)", cut.links, cut.parts, failed);
  PetscCall(LatinSFReduce_Private(cut.link_sf, 1, MPIU_INT, part, of_link, MPI_REPLACE));
  PetscCall(LatinCutDestroy_Private(&cut));
  PetscCall(PetscFree2(part, x));
  PetscFunctionReturn(0);
}

/* Whether METIS can take the graph with its 32-bit integers */
static PetscBool LatinPartitionTakes(LatinStructure structure)
{
  /* entries of a graph, and of coordinates */
  const PetscReal largest = PetscMax(4 * (PetscReal)structure->links_global, structure->dim * (PetscReal)structure->nodes_global);

  return (PetscBool)(largest <= (PetscReal)PETSC_MPI_INT_MAX);
}

#define LATIN_METIS_ALONE 1000000 /* most links for one rank on more than LATIN_METIS_RANKS ranks: their graph takes 94 MB */
/* most ranks for METIS on one rank whatever the links: their graph takes as much memory as the subdomains of an eighth of them */
#define LATIN_METIS_RANKS 8

/* Sets *pieces: whether the partition is parallel. METIS on one rank is faster as long as that rank has the memory */
static PetscErrorCode LatinPartitionInPieces_Private(LatinStructure structure, LatinPartitioner partitioner, PetscBool *pieces)
{
  PetscMPIInt size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)structure), &size));
  *pieces = (PetscBool)(size > LATIN_METIS_RANKS && structure->links_global > LATIN_METIS_ALONE);
  if (size > 1 && !LatinPartitionTakes(structure)) *pieces = PETSC_TRUE;
  if (partitioner != LATIN_PARTITIONER_AUTO) *pieces = (PetscBool)(partitioner == LATIN_PARTITIONER_PARALLEL);
#if !defined(LATIN_MATPARTITIONING)
  PetscCheck(partitioner != LATIN_PARTITIONER_PARALLEL, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP, "This PETSc has neither PT-Scotch nor ParMETIS: choose another partitioner than parallel, or configure PETSc --with-ptscotch");
  *pieces = PETSC_FALSE;
#endif
  PetscFunctionReturn(0);
}

/* Makes a partition; sets the number of subdomains if it is automatic. Collective on structure */
static PetscErrorCode LatinPartitionMake_Private(LatinStructure structure, const LatinPartitionRequest *request, PetscInt of_link[], PetscInt *count)
{
  PetscBool pieces = PETSC_FALSE;

  PetscFunctionBegin;
  *count = request->subdomains;
  if (!*count) PetscCall(LatinSubdomainCount(structure, request->primal, count));
  PetscCall(LatinPartitionInPieces_Private(structure, request->partitioner, &pieces));
  if (*count == 1) PetscCall(PetscArrayzero(of_link, structure->links_local));
  else if (pieces && *count <= structure->nodes_global) PetscCall(LatinPieces_Private(structure, request, *count, of_link));
  else {
    PetscCheck(LatinPartitionTakes(structure), PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP,
               "METIS on one rank cannot take %" PetscInt_FMT " links: give a partition with LatinSetPartition() (in Python, latinpc.Structure(..., subdomain=...)), or take several ranks and a PETSc with PT-Scotch or ParMETIS",
               structure->links_global);
    PetscCall(LatinPartitionMetis_Private(structure, request, *count, of_link));
  }
  PetscFunctionReturn(0);
}

/* Removes empty subdomains and renumbers the others. In a given partition they are an error. Collective on structure */
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

/* Assigns all parts of a contact with friction to the subdomain of its normal part. Collective on structure */
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

/* Checks and copies the partition given to the solver, or to the DM for all solvers. Collective on structure */
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

/* Computes of_link[links_local], the subdomain of each link, and their number *count. Collective on structure */
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
  if (!known && !request->whole) PetscCall(PetscObjectQuery((PetscObject)(structure->base ? structure->base->dm : structure->dm), "subdomains", (PetscObject *)&is));
  if (is) {
    known = 1;
    PetscCall(ISGetLocalSize(is, &links));
    PetscCall(ISGetIndices(is, &given));
  }
  if (known) PetscCall(LatinPartitionGiven_Private(structure, links, given, of_link, count));
  else if (request->subdomains == structure->links_global) {
    for (PetscInt l = 0; l < structure->links_local; l++) of_link[l] = structure->links_start + l;
    *count = request->subdomains;
  } else PetscCall(LatinPartitionMake_Private(structure, request, of_link, count));
  if (is) PetscCall(ISRestoreIndices(is, &given));
  if (structure->has_friction) PetscCall(LatinPartitionContacts_Private(structure, (PetscBool)known, of_link));
  PetscCall(LatinPartitionNumber_Private(structure, (PetscBool)known, of_link, count));
  LatinAgree(comm, known && request->subdomains && request->subdomains != *count, PETSC_ERR_ARG_INCOMP, "The given partition has %" PetscInt_FMT " subdomains, not the %" PetscInt_FMT " asked for: leave out one of the two", *count,
             request->subdomains);
  PetscCallMPI(MPI_Comm_size(comm, &ranks));
  request->choice = known                 ? "given"
                    : request->whole      ? "one factor, as those of subdomains differ"
                    : request->subdomains ? "set by the user"
                    : ranks == 1          ? "automatic, one factor is cheapest"
                    : request->primal     ? "automatic, one for each rank"
                                          : "automatic, of the cheapest size";
  PetscCall(PetscLogEventEnd(LATIN_Partition, structure, 0, 0, 0));
  PetscFunctionReturn(0);
}
