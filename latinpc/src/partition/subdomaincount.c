#include "partition/latinpartition.h"

/*
   The default number of subdomains.

   One rank: 1. METIS partitions structures without repetition; there, one factor of the whole structure costs less time and
   memory than factors of subdomains and of their coarse problem, and takes fewer iterations. Set-up and solve to an indicator
   of 1e-5, with 1 subdomain and with those of the sizes below: network of 20,000 nodes 3.8 and 9.3 s; of 150,000 nodes and
   650,000 links, 60 and 289 s, 4.9 and 9.0 GB.

   Several ranks: small subdomains have a large coarse problem, large ones large factors. If all interfaces are primal, as by
   default, one for each rank. The other variants take the size with the fewest entries of factors times linear
   stages over plane, flat and solid structures: benchmarks/constants.md.
*/

#define LATIN_SIZE_LINKS 724 /* links of a subdomain, on several ranks: fewest entries of factors times linear stages over plane, flat and solid structures */
/* least links of a subdomain of a rank, if interfaces are primal; else a structure of more links has two subdomains or more */
#define LATIN_SIZE_LEAST 64

/* Sets *count to the default number of subdomains. Collective on structure */
PetscErrorCode LatinSubdomainCount(LatinStructure structure, PetscBool primal, PetscInt *count)
{
  const PetscInt links = structure->links_global;
  PetscMPIInt    ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)structure), &ranks));
  if (ranks == 1) *count = 1;
  else if (primal) *count = PetscMax(PetscMin(ranks, links / LATIN_SIZE_LEAST), 1);
  else *count = PetscMax((links - 1) / LATIN_SIZE_LINKS + 1, links > LATIN_SIZE_LEAST ? 2 : 1);
  PetscFunctionReturn(0);
}
