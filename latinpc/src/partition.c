#include "latinimpl.h"

/*
   Which subdomain each link belongs to: the caller's partition, a DMLabel, or METIS (metis.c), whose cuts are repaired
   (repair.c).
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
static PetscErrorCode LatinPartitionMetis_Private(Latin latin, PetscInt parts)
{
  LatinLinks         links = latin->links;
  LatinSubstructure *sub   = &latin->sub;
  MPI_Comm           comm  = PetscObjectComm((PetscObject)latin);
  LatinCut           cut   = {.dim = links->dim, .nodes = links->nodes_global, .links = links->links_global, .parts = parts};
  PetscMPIInt        rank;
  PetscInt          *part     = NULL;
  const PetscReal    largest  = PetscMax(PetscMax(2, cut.dim) * (PetscReal)cut.links, cut.dim * (PetscReal)cut.nodes);
  int                status   = 0;
  PetscBool          overflow = PETSC_FALSE, failed = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  LatinAgree(comm, largest > (PetscReal)PETSC_MPI_INT_MAX, PETSC_ERR_SUP, "METIS on one rank cannot take %" PetscInt_FMT " links: give a partition with LatinLinksSetSubdomains()", cut.links);
  if (!rank) {
    PetscCall(PetscMalloc4(2 * cut.links, &cut.ends, cut.dim * cut.nodes, &cut.x, cut.dim * cut.links, &cut.direction, cut.dim * cut.nodes, &cut.fixed));
    PetscCall(PetscMalloc1(cut.links, &part));
  }
  PetscCall(LatinGather_Private(comm, 2 * links->links_local, MPIU_INT, links->nodes, cut.ends));
  PetscCall(LatinGather_Private(comm, cut.dim * links->nodes_local, MPIU_REAL, links->x, cut.x));
  PetscCall(LatinGather_Private(comm, cut.dim * links->links_local, MPIU_REAL, links->direction, cut.direction));
  PetscCall(LatinGather_Private(comm, cut.dim * links->nodes_local, LATIN_MPI_BOOL, links->fixed, cut.fixed));
  if (!rank) {
    if (!cut.parts) PetscCall(LatinSubdomainCount_Private(&cut, &cut.parts));
    cut.corners = (PetscBool)(latin->promote && latin->variant == LATIN_VARIANT_CORNER);
    PetscCall(LatinMetis_Private(&cut, part, &failed, &status, &overflow));
    if (!overflow && !failed && latin->repair) PetscCall(LatinRepair_Private(&cut, part));
  }
  LatinAgree(comm, overflow, PETSC_ERR_SUP, "The links' dual graph has more edges than this METIS can number: give a partition with LatinLinksSetSubdomains()");
  LatinAgree(comm, failed, PETSC_ERR_LIB, "METIS could not partition %" PetscInt_FMT " links into %" PetscInt_FMT " subdomains (METIS status %d)", cut.links, cut.parts, status);
  sub->count = cut.parts;
  PetscCallMPI(MPI_Bcast(&sub->count, 1, MPIU_INT, 0, comm));
  PetscCall(LatinScatter_Private(comm, links->links_local, MPIU_INT, part, sub->of_link));
  PetscCall(PetscFree4(cut.ends, cut.x, cut.direction, cut.fixed));
  PetscCall(PetscFree(part));
  PetscFunctionReturn(0);
}

/* Every number from 0 to count - 1 must have a link, or a subdomain would be empty */
static PetscErrorCode LatinPartitionCheck_Private(Latin latin)
{
  MPI_Comm       comm  = PetscObjectComm((PetscObject)latin);
  const PetscInt count = latin->sub.count;
  PetscInt      *links, empty = -1;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(count, &links));
  for (PetscInt l = 0; l < latin->links->links_local; l++) links[latin->sub.of_link[l]] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, links, (PetscMPIInt)count, MPIU_INT, MPI_MAX, comm));
  for (PetscInt s = 0; s < count && empty < 0; s++)
    if (!links[s]) empty = s;
  PetscCall(PetscFree(links));
  LatinAgree(comm, empty >= 0, PETSC_ERR_ARG_WRONG, "Subdomain %" PetscInt_FMT " of the given partition has no link; number the subdomains from 0 to %" PetscInt_FMT " without gaps", empty, count - 1);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinPartitionLabel_Private(Latin latin, DMLabel label)
{
  LatinLinks links = latin->links;
  PetscInt   bad = -1, last = -1;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++) {
    PetscCall(DMLabelGetValue(label, l, &latin->sub.of_link[l]));
    if (bad < 0 && (latin->sub.of_link[l] < 0 || latin->sub.of_link[l] >= links->links_global)) bad = l;
    last = PetscMax(last, latin->sub.of_link[l]);
  }
  LatinAgree(PetscObjectComm((PetscObject)latin), bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "The label \"subdomain\" gives link %" PetscInt_FMT " the value %" PetscInt_FMT "; give every link a number between 0 and %" PetscInt_FMT, links->links_start + bad,
             latin->sub.of_link[bad], links->links_global - 1);
  PetscCall(MPIU_Allreduce(&last, &latin->sub.count, 1, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)latin)));
  latin->sub.count++;
  PetscFunctionReturn(0);
}

/* The parts of a contact with friction stay together: they go where its normal part is. Collective on latin */
static PetscErrorCode LatinPartitionContacts_Private(Latin latin, PetscBool given)
{
  LatinLinks         links = latin->links;
  LatinSubstructure *sub   = &latin->sub;
  MPI_Comm           comm  = PetscObjectComm((PetscObject)latin);
  PetscInt          *number, used = 0, cut = -1;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++) {
    if (links->law[l] != LATIN_LAW_TANGENT || sub->of_link[l] == sub->of_link[l - 1]) continue;
    if (cut < 0) cut = l;
    sub->of_link[l] = sub->of_link[l - 1];
  }
  LatinAgree(comm, given && cut >= 0, PETSC_ERR_ARG_WRONG, "The given partition cuts the contact with friction that link %" PetscInt_FMT " is part of: put all its links into one subdomain", links->links_start + cut);
  if (given) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(sub->count, &number));
  for (PetscInt l = 0; l < links->links_local; l++) number[sub->of_link[l]] = 1;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, number, (PetscMPIInt)sub->count, MPIU_INT, MPI_MAX, comm));
  for (PetscInt s = 0; s < sub->count; s++) number[s] = number[s] ? used++ : -1; /* some may have lost all their links */
  for (PetscInt l = 0; l < links->links_local; l++) sub->of_link[l] = number[sub->of_link[l]];
  sub->count = used;
  PetscCall(PetscFree(number));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinPartition_Private(Latin latin)
{
  LatinLinks         links = latin->links;
  LatinSubstructure *sub   = &latin->sub;
  MPI_Comm           comm  = PetscObjectComm((PetscObject)latin);
  DMLabel            label;
  PetscBool          given = PETSC_TRUE;

  PetscFunctionBegin;
  LatinAgree(comm, latin->subdomains > links->links_global, PETSC_ERR_ARG_OUTOFRANGE, "Cannot make %" PetscInt_FMT " subdomains of %" PetscInt_FMT " links: ask for at most as many subdomains as links", latin->subdomains, links->links_global);
  PetscCall(PetscMalloc1(links->links_local, &sub->of_link));
  PetscCall(DMGetLabel(links->dm, "subdomain", &label));
  if (links->subdomain_count) {
    PetscCall(PetscArraycpy(sub->of_link, links->subdomain, links->links_local));
    sub->count = links->subdomain_count;
  } else if (label) {
    PetscCall(LatinPartitionLabel_Private(latin, label));
  } else {
    PetscInt parts = latin->subdomains;

    if (!parts && latin->links_per_subdomain) parts = (links->links_global + latin->links_per_subdomain - 1) / latin->links_per_subdomain;

    given      = PETSC_FALSE;
    sub->count = parts;
    if (parts == links->links_global) {
      for (PetscInt l = 0; l < links->links_local; l++) sub->of_link[l] = links->links_start + l;
    } else PetscCall(LatinPartitionMetis_Private(latin, parts));
  }
  if (given) {
    LatinAgree(comm, latin->subdomains && latin->subdomains != sub->count, PETSC_ERR_ARG_INCOMP, "The given partition has %" PetscInt_FMT " subdomains, not the %" PetscInt_FMT " asked for: leave out one of the two", sub->count, latin->subdomains);
    PetscCall(LatinPartitionCheck_Private(latin));
  }
  if (links->rubs) PetscCall(LatinPartitionContacts_Private(latin, given));
  PetscFunctionReturn(0);
}
