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

/* Do the links' middles spread over more than a few links in all three directions? */
static PetscBool LatinSolid(const LatinCut *cut)
{
  PetscReal mean[3] = {0.0, 0.0, 0.0}, a[9] = {0.0}, length = 0.0;

  if (cut->dim < 3) return PETSC_FALSE;
  for (PetscInt l = 0; l < cut->links; l++) {
    const PetscReal *x = cut->x + 3 * cut->ends[2 * l], *y = cut->x + 3 * cut->ends[2 * l + 1];

    for (PetscInt c = 0; c < 3; c++) mean[c] += (x[c] + y[c]) / (2.0 * cut->links);
    length += PetscSqrtReal(PetscSqr(y[0] - x[0]) + PetscSqr(y[1] - x[1]) + PetscSqr(y[2] - x[2])) / cut->links;
  }
  for (PetscInt l = 0; l < cut->links; l++) {
    const PetscReal *x = cut->x + 3 * cut->ends[2 * l], *y = cut->x + 3 * cut->ends[2 * l + 1];

    for (PetscInt c = 0; c < 9; c++) a[c] += ((x[c / 3] + y[c / 3]) / 2.0 - mean[c / 3]) * ((x[c % 3] + y[c % 3]) / 2.0 - mean[c % 3]) / (PetscSqr(length) * cut->links);
  }
  /* a bar of length L has the second moment L^2 / 12: are all principal ones larger? */
  for (PetscInt c = 0; c < 3; c++) a[4 * c] -= PetscSqr(LATIN_SIZE_THICK) / 12.0;
  return LatinCholesky(3, a);
}

PetscInt LatinSubdomainCount(const LatinCut *cut, PetscMPIInt ranks, PetscBool primal)
{
  const PetscInt size = cut->dim < 3 ? LATIN_SIZE_PLANE : LatinSolid(cut) ? LATIN_SIZE_SOLID : LATIN_SIZE_FLAT;

  if (ranks == 1) return 1;
  if (primal) return PetscMax(PetscMin(ranks, cut->links / LATIN_SIZE_LEAST), 1);
  return PetscMax((cut->links + size - 1) / size, cut->links > LATIN_SIZE_LEAST ? 2 : 1);
}
