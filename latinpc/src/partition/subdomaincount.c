#include "partition/latinpartition.h"

/*
   How many subdomains METIS is to make when nobody says.

   On one rank one: METIS is for structures that repeat nothing, and one factor of everything costs less time and memory
   than the factors of subdomains and of their coarse problem; iterations are fewer as well. Set-up and solve to an
   indicator of 1e-5 beside what the sizes below make: network of 20,000 nodes 3.8 and 9.3 s; of 150,000 nodes, with 650,000
   links, 60 and 289 s, 4.9 and 9.0 GB.

   On more ranks small subdomains make the coarse problem large, large ones their own factors. The least work of a whole
   solve, in numbers moved, was at these links per subdomain from 1,000 links to
   10 million: entries of factors and of the coarse problem were counted by MUMPS on 64 to 1024 links a subdomain of lattices
   (plane), of grids of 24 and 48 modules a side (flat: in space, but only a few links thick) and of networks of 1000 and
   4000 nodes (solid); iterations to an error of 1e-4 grew by 1.15, as a mean, where subdomains doubled.
*/

#define LATIN_SIZE_PLANE 724  /* links a subdomain on several ranks, of a plane structure; what others take: benchmarks/constants.md */
#define LATIN_SIZE_FLAT  512  /* of a flat one in space */
#define LATIN_SIZE_SOLID 1024 /* of any other one */
#define LATIN_SIZE_LEAST 64   /* a structure of more links has two subdomains */
#define LATIN_SIZE_THICK 4.0  /* links across a structure that is not flat */

/* Do the links' middles spread over more than a few links in all three directions? Collective on structure */
static PetscErrorCode LatinSolid_Private(LatinStructure structure, PetscBool *solid)
{
  MPI_Comm           comm   = PetscObjectComm((PetscObject)structure);
  const PetscReal    m      = (PetscReal)structure->links_global;
  PetscReal          sum[4] = {0.0, 0.0, 0.0, 0.0}, a[9] = {0.0}; /* middle, and length */
  Vec                coordinates;
  const PetscScalar *at;

  PetscFunctionBegin;
  *solid = PETSC_FALSE;
  if (structure->dim < 3) PetscFunctionReturn(0);
  PetscCall(DMGetCoordinatesLocal(structure->base ? structure->base->dm : structure->dm, &coordinates));
  PetscCall(VecGetArrayRead(coordinates, &at));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscScalar *x = at + 3 * structure->ends[2 * l], *y = at + 3 * structure->ends[2 * l + 1];

    for (PetscInt c = 0; c < 3; c++) sum[c] += (x[c] + y[c]) / (2.0 * m);
    sum[3] += PetscSqrtReal(PetscSqr(y[0] - x[0]) + PetscSqr(y[1] - x[1]) + PetscSqr(y[2] - x[2])) / m;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, comm));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscScalar *x = at + 3 * structure->ends[2 * l], *y = at + 3 * structure->ends[2 * l + 1];

    for (PetscInt c = 0; c < 9; c++) a[c] += ((x[c / 3] + y[c / 3]) / 2.0 - sum[c / 3]) * ((x[c % 3] + y[c % 3]) / 2.0 - sum[c % 3]) / (PetscSqr(sum[3]) * m);
  }
  PetscCall(VecRestoreArrayRead(coordinates, &at));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, a, 9, MPIU_REAL, MPIU_SUM, comm));
  /* a bar of length L has the second moment L^2 / 12: are all principal ones larger? */
  for (PetscInt c = 0; c < 3; c++) a[4 * c] -= PetscSqr(LATIN_SIZE_THICK) / 12.0;
  *solid = LatinCholesky(3, a);
  PetscFunctionReturn(0);
}

/* Collective on structure */
PetscErrorCode LatinSubdomainCount(LatinStructure structure, PetscBool primal, PetscInt *count)
{
  const PetscInt links = structure->links_global;
  PetscInt       size  = LATIN_SIZE_PLANE;
  PetscBool      solid;
  PetscMPIInt    ranks;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)structure), &ranks));
  PetscCall(LatinSolid_Private(structure, &solid));
  if (structure->dim == 3) size = solid ? LATIN_SIZE_SOLID : LATIN_SIZE_FLAT;
  if (ranks == 1) *count = 1;
  else if (primal) *count = PetscMax(PetscMin(ranks, links / LATIN_SIZE_LEAST), 1);
  else *count = PetscMax(links / size + (links % size ? 1 : 0), links > LATIN_SIZE_LEAST ? 2 : 1);
  PetscFunctionReturn(0);
}
