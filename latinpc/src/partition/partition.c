#include "partition/latinpartition.h"

/*
   Which subdomain each link belongs to: the caller's partition, or METIS (partition/metis.c), whose cuts are repaired
   (partition/repair.c).
*/

/* What each rank has of a whole array on rank 0, where the arrays are not NULL; free with PetscFree2(counts, starts) */
static PetscErrorCode LatinPieces_Private(MPI_Comm comm, PetscInt n, PetscMPIInt *count, PetscMPIInt *counts[], PetscMPIInt *starts[])
{
  PetscMPIInt rank, size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMPIIntCast(n, count));
  *counts = *starts = NULL;
  if (!rank) PetscCall(PetscCalloc2(size, counts, size, starts));
  PetscCallMPI(MPI_Gather(count, 1, MPI_INT, *counts, 1, MPI_INT, 0, comm));
  for (PetscMPIInt r = 1; r < size && !rank; r++) (*starts)[r] = (*starts)[r - 1] + (*counts)[r - 1];
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGather_Private(MPI_Comm comm, PetscInt n, MPI_Datatype type, const void *mine, void *all)
{
  PetscMPIInt count, *counts, *starts;

  PetscFunctionBegin;
  PetscCall(LatinPieces_Private(comm, n, &count, &counts, &starts));
  PetscCallMPI(MPI_Gatherv(mine, count, type, all, counts, starts, type, 0, comm));
  PetscCall(PetscFree2(counts, starts));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinScatter_Private(MPI_Comm comm, PetscInt n, MPI_Datatype type, const void *all, void *mine)
{
  PetscMPIInt count, *counts, *starts;

  PetscFunctionBegin;
  PetscCall(LatinPieces_Private(comm, n, &count, &counts, &starts));
  PetscCallMPI(MPI_Scatterv(all, counts, starts, type, mine, count, type, 0, comm));
  PetscCall(PetscFree2(counts, starts));
  PetscFunctionReturn(0);
}

/* METIS is sequential: rank 0 partitions all links and hands the parts back. 0 parts: as many as cost least */
static PetscErrorCode LatinPartitionMetis_Private(LatinStructure structure, const LatinPartitionRequest *request, PetscInt parts, PetscInt of_link[], PetscInt *count)
{
  MPI_Comm        comm = PetscObjectComm((PetscObject)structure);
  LatinCut        cut  = {.dim = structure->dim, .nodes = structure->nodes_global, .links = structure->links_global, .parts = parts};
  PetscMPIInt     rank;
  PetscInt       *part     = NULL;
  const PetscReal largest  = PetscMax(PetscMax(2, cut.dim) * (PetscReal)cut.links, cut.dim * (PetscReal)cut.nodes);
  int             status   = 0;
  PetscBool       overflow = PETSC_FALSE, failed = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  LatinAgree(comm, largest > (PetscReal)PETSC_MPI_INT_MAX, PETSC_ERR_SUP, "METIS on one rank cannot take %" PetscInt_FMT " links: give a partition with LatinSetPartition()", cut.links);
  if (!rank) {
    PetscCall(PetscMalloc4(2 * cut.links, &cut.ends, cut.dim * cut.nodes, &cut.x, cut.dim * cut.links, &cut.direction, cut.dim * cut.nodes, &cut.fixed));
    PetscCall(PetscMalloc1(cut.links, &part));
  }
  PetscCall(LatinGather_Private(comm, 2 * structure->links_local, MPIU_INT, structure->nodes, cut.ends));
  PetscCall(LatinGather_Private(comm, cut.dim * structure->nodes_local, MPIU_REAL, structure->x, cut.x));
  PetscCall(LatinGather_Private(comm, cut.dim * structure->links_local, MPIU_REAL, structure->direction, cut.direction));
  PetscCall(LatinGather_Private(comm, cut.dim * structure->nodes_local, LATIN_MPI_BOOL, structure->fixed, cut.fixed));
  if (!rank) {
    if (!cut.parts) PetscCall(LatinSubdomainCount_Private(&cut, &cut.parts));
    cut.corners = request->corners;
    PetscCall(LatinMetis_Private(&cut, part, &failed, &status, &overflow));
    if (!overflow && !failed) PetscCall(LatinRepair_Private(&cut, part));
  }
  LatinAgree(comm, overflow, PETSC_ERR_SUP, "The links' dual graph has more edges than this METIS can number: give a partition with LatinSetPartition()");
  LatinAgree(comm, failed, PETSC_ERR_LIB, "METIS could not partition %" PetscInt_FMT " links into %" PetscInt_FMT " subdomains (METIS status %d)", cut.links, cut.parts, status);
  *count = cut.parts;
  PetscCallMPI(MPI_Bcast(count, 1, MPIU_INT, 0, comm));
  PetscCall(LatinScatter_Private(comm, structure->links_local, MPIU_INT, part, of_link));
  PetscCall(PetscFree4(cut.ends, cut.x, cut.direction, cut.fixed));
  PetscCall(PetscFree(part));
  PetscFunctionReturn(0);
}

/* Every number from 0 to count - 1 must have a link, or a subdomain would be empty */
static PetscErrorCode LatinPartitionCheck_Private(LatinStructure structure, const PetscInt of_link[], PetscInt count)
{
  MPI_Comm  comm = PetscObjectComm((PetscObject)structure);
  PetscInt *links, empty = -1;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(count, &links));
  for (PetscInt l = 0; l < structure->links_local; l++) links[of_link[l]] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, links, (PetscMPIInt)count, MPIU_INT, MPI_MAX, comm));
  for (PetscInt s = 0; s < count && empty < 0; s++)
    if (!links[s]) empty = s;
  PetscCall(PetscFree(links));
  LatinAgree(comm, empty >= 0, PETSC_ERR_ARG_WRONG, "Subdomain %" PetscInt_FMT " of the given partition has no link; number the subdomains from 0 to %" PetscInt_FMT " without gaps", empty, count - 1);
  PetscFunctionReturn(0);
}

/* The parts of a contact with friction stay together: they go where its normal part is. Collective on structure */
static PetscErrorCode LatinPartitionContacts_Private(LatinStructure structure, PetscBool given, PetscInt of_link[], PetscInt *count)
{
  MPI_Comm  comm = PetscObjectComm((PetscObject)structure);
  PetscInt *number, used = 0, cut = -1;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (structure->law[l] != LATIN_LAW_TANGENT || of_link[l] == of_link[l - 1]) continue;
    if (cut < 0) cut = l;
    of_link[l] = of_link[l - 1];
  }
  LatinAgree(comm, given && cut >= 0, PETSC_ERR_ARG_WRONG, "The given partition cuts the contact with friction that link %" PetscInt_FMT " is part of: put all its links into one subdomain", structure->links_start + cut);
  if (given) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(*count, &number));
  for (PetscInt l = 0; l < structure->links_local; l++) number[of_link[l]] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, number, (PetscMPIInt)*count, MPIU_INT, MPI_MAX, comm));
  for (PetscInt s = 0; s < *count; s++) number[s] = number[s] ? used++ : -1; /* some may have lost all their links */
  for (PetscInt l = 0; l < structure->links_local; l++) of_link[l] = number[of_link[l]];
  *count = used;
  PetscCall(PetscFree(number));
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
  PetscCall(LatinPartitionCheck_Private(structure, of_link, *count));
  PetscFunctionReturn(0);
}

/* The subdomain of each link of the caller on this rank, and the number of subdomains. Collective on structure */
PetscErrorCode LatinPartition_Private(LatinStructure structure, const LatinPartitionRequest *request, PetscInt of_link[], PetscInt *count)
{
  MPI_Comm        comm  = PetscObjectComm((PetscObject)structure);
  PetscInt        links = request->links, any;
  const PetscInt *given = request->given;
  IS              is    = NULL;

  PetscFunctionBegin;
  LatinAgree(comm, request->subdomains > structure->links_global, PETSC_ERR_ARG_OUTOFRANGE, "Cannot make %" PetscInt_FMT " subdomains of %" PetscInt_FMT " links: ask for at most as many subdomains as links", request->subdomains,
             structure->links_global);
  any = given ? 1 : 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_MAX, comm));
  if (!any) PetscCall(PetscObjectQuery((PetscObject)(structure->base ? structure->base->dm : structure->dm), "subdomains", (PetscObject *)&is));
  if (is) {
    PetscCall(ISGetLocalSize(is, &links));
    PetscCall(ISGetIndices(is, &given));
  }
  if (any || is) PetscCall(LatinPartitionGiven_Private(structure, links, given, of_link, count));
  else if (request->subdomains == structure->links_global) {
    for (PetscInt l = 0; l < structure->links_local; l++) of_link[l] = structure->links_start + l;
    *count = request->subdomains;
  } else PetscCall(LatinPartitionMetis_Private(structure, request, request->subdomains, of_link, count));
  if (is) PetscCall(ISRestoreIndices(is, &given));
  LatinAgree(comm, (any || is) && request->subdomains && request->subdomains != *count, PETSC_ERR_ARG_INCOMP, "The given partition has %" PetscInt_FMT " subdomains, not the %" PetscInt_FMT " asked for: leave out one of the two", *count,
             request->subdomains);
  if (structure->rubs) PetscCall(LatinPartitionContacts_Private(structure, (PetscBool)(any || is), of_link, count));
  PetscFunctionReturn(0);
}
