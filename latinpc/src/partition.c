#include "latinimpl.h"
#include <metis.h>

#define METIS_SMALL_PART 16 /* links per subdomain */

/*
   Which subdomain each link belongs to: the caller's partition, a DMLabel, or METIS on the dual graph of the links
   (vertices: links; edges: pairs of links with a common node).
*/

/* The links' dual graph from the end nodes of all links; coincident links share two nodes but one edge */
static PetscErrorCode LatinDualGraph_Private(PetscInt nodes, PetscInt n, const PetscInt ends[], idx_t **xadj, idx_t **adjncy, PetscBool *overflow)
{
  PetscInt  *offset, *incident, *seen;
  PetscInt64 edges = 0;
  idx_t     *xa, *adj = NULL;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(nodes + 2, &offset));
  PetscCall(PetscMalloc2(2 * n, &incident, n, &seen));
  for (PetscInt i = 0; i < 2 * n; i++) offset[ends[i] + 2]++;
  for (PetscInt i = 0; i < nodes; i++) offset[i + 2] += offset[i + 1];
  for (PetscInt i = 0; i < 2 * n; i++) incident[offset[ends[i] + 1]++] = i / 2;
  PetscCall(PetscMalloc1(n + 1, &xa));
  *overflow = PETSC_FALSE;
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt i = 0; i < n; i++) seen[i] = -1;
    edges = 0;
    for (PetscInt l = 0; l < n; l++) {
      xa[l]   = (idx_t)edges;
      seen[l] = l;
      for (PetscInt s = 0; s < 2; s++) {
        const PetscInt v = ends[2 * l + s];

        for (PetscInt j = offset[v]; j < offset[v + 1]; j++) {
          const PetscInt m = incident[j];

          if (seen[m] == l) continue;
          seen[m] = l;
          if (pass) adj[edges] = (idx_t)m;
          edges++;
        }
      }
    }
    xa[n] = (idx_t)edges;
    if ((PetscInt64)(idx_t)edges != edges) {
      *overflow = PETSC_TRUE;
      break;
    }
    if (!pass) PetscCall(PetscMalloc1((size_t)PetscMax(edges, 1), &adj));
  }
  PetscCall(PetscFree(offset));
  PetscCall(PetscFree2(incident, seen));
  *xadj   = xa;
  *adjncy = adj;
  PetscFunctionReturn(0);
}

/* METIS is sequential: rank 0 partitions all links and hands the parts back; parts that METIS leaves empty are closed up */
static PetscErrorCode LatinPartitionMetis_Private(Latin latin, PetscInt parts)
{
  LatinLinks         links = latin->links;
  LatinSubstructure *sub   = &latin->sub;
  MPI_Comm           comm  = PetscObjectComm((PetscObject)latin);
  PetscMPIInt        rank, size, *counts = NULL, *displs = NULL, mine;
  PetscInt          *all = NULL, *part = NULL, total = links->links_global, used = 0;
  int                status   = METIS_OK;
  PetscBool          overflow = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  LatinAgree(comm, (PetscReal)total * 2 > (PetscReal)PETSC_MPI_INT_MAX, PETSC_ERR_SUP, "METIS on one rank cannot take %" PetscInt_FMT " links: give a partition with LatinLinksSetSubdomains()", total);
  PetscCall(PetscMPIIntCast(2 * links->links_local, &mine));
  if (!rank) {
    PetscCall(PetscMalloc2(size, &counts, size, &displs));
    PetscCall(PetscMalloc2(2 * total, &all, total, &part));
  }
  PetscCallMPI(MPI_Gather(&mine, 1, MPI_INT, counts, 1, MPI_INT, 0, comm));
  if (!rank) {
    displs[0] = 0;
    for (PetscMPIInt r = 1; r < size; r++) displs[r] = displs[r - 1] + counts[r - 1];
  }
  PetscCallMPI(MPI_Gatherv(links->nodes, mine, MPIU_INT, all, counts, displs, MPIU_INT, 0, comm));
  if (!rank) {
    idx_t *xadj = NULL, *adjncy = NULL, *mpart, options[METIS_NOPTIONS], nvtxs = (idx_t)total, ncon = 1, nparts = (idx_t)parts, cut;

    PetscCall(LatinDualGraph_Private(links->nodes_global, total, all, &xadj, &adjncy, &overflow));
    if (!overflow) {
      PetscInt *newnumber;

      PetscCall(PetscMalloc1(total, &mpart));
      METIS_SetDefaultOptions(options);
      options[METIS_OPTION_SEED]      = 1; /* the same partition at every run */
      options[METIS_OPTION_NUMBERING] = 0;
      /* k-way refinement leaves parts empty when they are to be small; bisection does not */
      if (total < METIS_SMALL_PART * parts) status = METIS_PartGraphRecursive(&nvtxs, &ncon, xadj, adjncy, NULL, NULL, NULL, &nparts, NULL, NULL, options, &cut, mpart);
      else status = METIS_PartGraphKway(&nvtxs, &ncon, xadj, adjncy, NULL, NULL, NULL, &nparts, NULL, NULL, options, &cut, mpart);
      if (status == METIS_OK) {
        PetscCall(PetscMalloc1(parts, &newnumber));
        for (PetscInt p = 0; p < parts; p++) newnumber[p] = -1;
        for (PetscInt l = 0; l < total; l++) newnumber[mpart[l]] = 0;
        for (PetscInt p = 0; p < parts; p++)
          if (newnumber[p] == 0) newnumber[p] = used++;
        for (PetscInt l = 0; l < total; l++) part[l] = newnumber[mpart[l]];
        PetscCall(PetscFree(newnumber));
      }
      PetscCall(PetscFree(mpart));
    }
    PetscCall(PetscFree(xadj));
    PetscCall(PetscFree(adjncy));
    for (PetscMPIInt r = 0; r < size; r++) {
      counts[r] /= 2;
      displs[r] /= 2;
    }
  }
  LatinAgree(comm, overflow, PETSC_ERR_SUP, "The links' dual graph has more edges than this METIS can number: give a partition with LatinLinksSetSubdomains()");
  LatinAgree(comm, status != METIS_OK, PETSC_ERR_LIB, "METIS could not partition %" PetscInt_FMT " links into %" PetscInt_FMT " subdomains (METIS status %d)", total, parts, status);
  PetscCallMPI(MPI_Bcast(&used, 1, MPIU_INT, 0, comm));
  PetscCallMPI(MPI_Scatterv(part, counts, displs, MPIU_INT, sub->of_link, mine / 2, MPIU_INT, 0, comm));
  sub->count = used;
  PetscCall(PetscFree2(counts, displs));
  PetscCall(PetscFree2(all, part));
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
    PetscInt parts = latin->subdomains ? latin->subdomains : (links->links_global + latin->links_per_subdomain - 1) / latin->links_per_subdomain;

    given      = PETSC_FALSE;
    sub->count = parts;
    if (parts == 1) PetscCall(PetscArrayzero(sub->of_link, links->links_local));
    else if (parts == links->links_global) {
      for (PetscInt l = 0; l < links->links_local; l++) sub->of_link[l] = links->links_start + l;
    } else PetscCall(LatinPartitionMetis_Private(latin, parts));
  }
  if (given) {
    LatinAgree(comm, latin->subdomains && latin->subdomains != sub->count, PETSC_ERR_ARG_INCOMP, "The given partition has %" PetscInt_FMT " subdomains, not the %" PetscInt_FMT " asked for: leave out one of the two", sub->count, latin->subdomains);
    PetscCall(LatinPartitionCheck_Private(latin));
  }
  PetscFunctionReturn(0);
}
