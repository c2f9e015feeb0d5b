#include "partition/latinpartition.h"

/*
   How many subdomains METIS is to make when nobody says.

   On one rank one: METIS is for structures that repeat nothing, and one factor of everything costs less time and memory
   than the factors of subdomains and of their coarse problem; iterations are fewer as well. Set-up and solve to an
   indicator of 1e-5 beside what the sizes below make: network of 20,000 nodes 3.8 and 9.3 s; of 150,000 nodes, with 650,000
   links, 60 and 289 s, 4.9 and 9.0 GB.

   On more ranks small subdomains make the coarse problem large, large ones their own factors. Where each rank has one, as by
   default, there is no choice; the other variants take the size at which a whole solve moves the fewest numbers, entries of
   factors times linear stages, of plane, flat and solid structures: benchmarks/constants.md.
*/

#define LATIN_SIZE_LINKS 724 /* links a subdomain on several ranks */
#define LATIN_SIZE_LEAST 64  /* a structure of more links has two subdomains */

/* Collective on structure */
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
