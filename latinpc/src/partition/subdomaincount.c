#include "partition/latinpartition.h"

/*
   How many subdomains METIS is to make when nobody says: the number that makes the work of a whole solve least. Small
   subdomains make the coarse problem large, large ones their own factors. In numbers moved:

     set-up      condensation: for each subdomain and coarse displacement that it touches a solve, 4 x entries of its
                 factor, in dense kernels; coarse problem: LATIN_SIZE_ROW for each row, and (entries of the row)^2 in
                 dense kernels
     iteration   4 x entries of the subdomains' factors, and of the coarse one

   What the links cost does not depend on their subdomain. The entries were counted by MUMPS (INFOG(29), RINFOG(3)) on
   partitions into 64 to 1024 links a subdomain: lattices (plane), 24 and 48 modules a side (flat: in space, but only a few
   links thick), networks of 1000 and 4000 nodes (solid); the formulas fit within a third. Iterations to an error of 1e-4
   grew by 1.15, as a mean, where subdomains doubled. LATIN_SIZE_ROW was timed, against the numbers that an iteration moves
   in the same time: ordering and assembling do not show as operations.
*/

#define LATIN_SIZE_LEAST      64.0
#define LATIN_SIZE_THICK      4.0  /* links across a structure that is not flat */
#define LATIN_SIZE_ITERATIONS 25.0 /* with 256 links a subdomain */
#define LATIN_SIZE_GROWTH     0.2
#define LATIN_SIZE_DENSE      5.0   /* operations of a dense kernel for one number moved */
#define LATIN_SIZE_ROW        4.5e4 /* to order and assemble a row of the coarse problem */

typedef struct {
  PetscReal coarse, half;  /* coarse displacements a subdomain: coarse m / (m + half) */
  PetscReal factor, power; /* entries of a subdomain's factor: factor (m / 256)^power */
  PetscReal most;          /* links a subdomain beyond which iterations grow faster, or were not counted */
} LatinWork;

static const LatinWork LatinWorkPlane = {19.5, 24.0, 2300.0, 1.55, 1024.0};
static const LatinWork LatinWorkFlat  = {40.0, 40.0, 3000.0, 1.7, 512.0};
static const LatinWork LatinWorkSolid = {95.0, 175.0, 2700.0, 1.75, 1024.0};

/* Directions in which the links' middles spread over more than a few links */
static PetscErrorCode LatinSpread_Private(const LatinCut *cut, PetscInt *wide)
{
  const PetscInt dim     = cut->dim;
  PetscReal      mean[3] = {0.0, 0.0, 0.0}, a[9], w[3], work[32], length = 0.0;
  PetscBLASInt   bn, lwork = 32, info;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < cut->links; l++) {
    const PetscReal *x = cut->x + dim * cut->ends[2 * l], *y = cut->x + dim * cut->ends[2 * l + 1];
    PetscReal        square = 0.0;

    for (PetscInt c = 0; c < dim; c++) {
      mean[c] += (x[c] + y[c]) / (2.0 * cut->links);
      square += PetscSqr(y[c] - x[c]);
    }
    length += PetscSqrtReal(square) / cut->links;
  }
  PetscCall(PetscArrayzero(a, 9));
  for (PetscInt l = 0; l < cut->links; l++) {
    const PetscReal *x = cut->x + dim * cut->ends[2 * l], *y = cut->x + dim * cut->ends[2 * l + 1];

    for (PetscInt c = 0; c < dim; c++)
      for (PetscInt b = 0; b < dim; b++) a[dim * c + b] += ((x[c] + y[c]) / 2.0 - mean[c]) * ((x[b] + y[b]) / 2.0 - mean[b]) / (PetscSqr(length) * cut->links);
  }
  PetscCall(PetscBLASIntCast(dim, &bn));
  PetscCallBLAS("LAPACKsyev", LAPACKsyev_("N", "U", &bn, a, &bn, w, work, &lwork, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK could not find the extents of the structure (info %d)", (int)info);
  *wide = 0;
  for (PetscInt c = 0; c < dim; c++) /* a bar of length L has the second moment L^2 / 12 */
    if (12.0 * w[c] > PetscSqr(LATIN_SIZE_THICK)) (*wide)++;
  PetscFunctionReturn(0);
}

/* Numbers moved by a whole solve with m links a subdomain */
static PetscReal LatinWorkOf(const LatinWork *work, PetscBool solid, PetscReal links, PetscReal m)
{
  const PetscReal parts      = PetscMax(1.0, links / m);
  const PetscReal iterations = LATIN_SIZE_ITERATIONS * PetscPowReal(m / 256.0, LATIN_SIZE_GROWTH);
  const PetscReal factor     = work->factor * PetscPowReal(m / 256.0, work->power);
  const PetscReal c          = work->coarse * m / (m + work->half);
  const PetscReal row        = c * PetscMax(1.0, solid ? 1.1 * PetscSqrtReal(parts) : PetscLog2Real(parts)); /* nested dissection */

  return parts * 4.0 * factor * (2.0 * c / LATIN_SIZE_DENSE + iterations) + parts * c * (LATIN_SIZE_ROW + PetscSqr(row) / LATIN_SIZE_DENSE + 4.0 * row * iterations);
}

PetscErrorCode LatinSubdomainCount_Private(const LatinCut *cut, PetscInt *parts)
{
  PetscReal        best = PETSC_MAX_REAL, size = LATIN_SIZE_LEAST;
  PetscInt         wide = 0;
  PetscBool        solid;
  const LatinWork *work;

  PetscFunctionBegin;
  PetscCall(LatinSpread_Private(cut, &wide));
  solid = (PetscBool)(wide > 2);
  work  = cut->dim < 3 ? &LatinWorkPlane : (solid ? &LatinWorkSolid : &LatinWorkFlat);
  for (PetscReal m = LATIN_SIZE_LEAST; m < 1.1 * work->most; m *= PETSC_SQRT2) {
    const PetscReal moved = LatinWorkOf(work, solid, (PetscReal)cut->links, m);

    if (moved < best) {
      best = moved;
      size = m;
    }
  }
  *parts = (PetscInt)PetscCeilReal((PetscReal)cut->links / size);
  PetscFunctionReturn(0);
}
