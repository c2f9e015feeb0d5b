#include "error/latinerror.h"

/*
   An estimate of the error of the displacements while the true ones are not known. Two facts carry it:

   - the error of an earlier iterate is its distance to the present one, once that is much better;
   - near the solution the map z -> z - G(z) is linear, so that the errors of the iterates are to the distances between
     their two stages (stages/local.c) as the operator's slow and fast fields decide. That ratio changes slowly.

   So the largest ratio among the last iterates, times the present distance, estimates the present error:
   max_j |U_j - U_k| / distance_j * distance_k. The window must be longer than the slowest fields take to show: the later
   half of the iterates, as long as they are not too many. A factor calibrated on one set of structures
   (benchmarks/effectivity.py) and tested on another makes it safe. A field that creeps without showing in the distance
   of the stages, as links about to slacken do, is caught by extrapolation [A. C. Aitken]: steps that shrink by a rate q
   sum up to q / (1 - q) times the last one.

   Distances are those of random projections of the displacements, a few hundred numbers instead of millions: each
   degree of freedom is added to one number of the sketch, with a random sign, which keeps distances to
   sqrt(1 / (2 ROWS)) [M. Charikar, K. Chen, M. Farach-Colton: count sketch]. Number and sign follow from the place of the
   degree of freedom in its subdomain, so that they do not depend on the number of ranks.
*/

#define LATIN_ESTIMATE_ROWS   256  /* numbers of a sketch: distances to 1 / sqrt(2 ROWS), 4 % */
#define LATIN_ESTIMATE_BITS   9    /* of an entry: its row, of 2^8, and its sign */
#define LATIN_ESTIMATE_SHARE  6    /* entries that share 64 bits */
#define LATIN_ESTIMATE_WINDOW 32   /* iterates: 8 forget slow fields, 64 change nothing */
#define LATIN_ESTIMATE_SHORT  4    /* at least so many earlier iterates, where there are */
#define LATIN_ESTIMATE_STEP   4    /* iterates between those that are extrapolated */
#define LATIN_ESTIMATE_RATE   0.98 /* no rate above it is believed */
#define LATIN_ESTIMATE_EARLY  10.0 /* more caution at the first iterates, which have a short past */

static const PetscReal LatinEstimateSafety[] = {1.8, 4.0}; /* l2 norm, energy norm */

PetscErrorCode LatinEstimateStart_Private(LatinEstimate *estimate)
{
  PetscFunctionBegin;
  if (!estimate->sketch) PetscCall(PetscMalloc2((LATIN_ESTIMATE_WINDOW + 1) * (LATIN_ESTIMATE_ROWS + 1), &estimate->sketch, LATIN_ESTIMATE_ROWS + 1, &estimate->part));
  estimate->count = 0;
  estimate->value = 1.0;
  estimate->floor = 0.0;
  PetscFunctionReturn(0);
}

/* This rank's part of the sketch of the displacements, and of their squared norm behind it */
static void LatinEstimateSketch(Latin latin, PetscBool energy, PetscReal sketch[])
{
  const LatinSubdomains *sub    = &latin->sub;
  const PetscInt         dim    = latin->sub.structure->dim;
  const PetscReal       *U      = latin->linear.U;
  PetscReal              square = 0.0;

  for (PetscInt i = 0; i < LATIN_ESTIMATE_ROWS; i++) sketch[i] = 0.0;
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt first = energy ? sub->link_offset[s] : dim * sub->node_offset[s], last = energy ? sub->link_offset[s + 1] : dim * sub->node_offset[s + 1];

    for (PetscInt i = first; i < last;) {
      uint64_t bits = LatinMix(((uint64_t)(sub->first + s) << 32) ^ (uint64_t)((i - first) / LATIN_ESTIMATE_SHARE)) >> 1; /* random */

      for (PetscInt c = 0; c < LATIN_ESTIMATE_SHARE && i < last; c++, i++, bits >>= LATIN_ESTIMATE_BITS) {
        const PetscReal v = energy ? PetscSqrtReal(sub->stiffness[i]) * LatinElongation(sub, dim, i, U) : U[i];

        sketch[(bits >> 1) % LATIN_ESTIMATE_ROWS] += bits & 1 ? v : -v;
        square += v * v;
      }
    }
  }
  sketch[LATIN_ESTIMATE_ROWS] = square;
}

/* What rounding leaves of the present displacements */
PetscErrorCode LatinEstimateFloor_Private(Latin latin, LatinEstimate *estimate)
{
  const LatinSubdomains *sub    = &latin->sub;
  const PetscInt         dim    = latin->sub.structure->dim;
  const PetscReal       *U      = latin->linear.U;
  PetscReal              sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < sub->links; l++) {
    const PetscReal *n = sub->direction + dim * l, *ua = U + dim * sub->ends[2 * l], *ub = U + dim * sub->ends[2 * l + 1];
    PetscReal        a = 0.0, b = 0.0;

    for (PetscInt c = 0; c < dim; c++) {
      a += n[c] * ua[c];
      b += n[c] * ub[c];
    }
    sum[0] += sub->stiffness[l] * (a * a + b * b);
    sum[1] += sub->stiffness[l] * (b - a) * (b - a);
  }
  for (PetscInt i = 0; sub->ground && i < dim * sub->copies; i++) { /* in a motion masses hold what no link does */
    sum[0] += sub->ground[i] * U[i] * U[i];
    sum[1] += sub->ground[i] * U[i] * U[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  estimate->floor = LatinRounding(sum[0], sum[1]);
  PetscFunctionReturn(0);
}

/* The sketch of iterate k, and the distance of its stages behind it */
static inline PetscReal *LatinEstimateRow(LatinEstimate *estimate, PetscInt k)
{
  return estimate->sketch + (k % (LATIN_ESTIMATE_WINDOW + 1)) * (LATIN_ESTIMATE_ROWS + 1);
}

/* |U_j - U_k| */
static PetscReal LatinEstimateFar(LatinEstimate *estimate, PetscInt j, PetscInt k)
{
  const PetscReal *a = LatinEstimateRow(estimate, j), *b = LatinEstimateRow(estimate, k);
  PetscReal        sum = 0.0;

  for (PetscInt i = 0; i < LATIN_ESTIMATE_ROWS; i++) sum += PetscSqr(a[i] - b[i]);
  return PetscSqrtReal(sum);
}

/*
   After an application of the fixed-point map: the estimated relative error of its displacements. Before the third one
   there is nothing to say: 1. With a target below what rounding leaves, `rounding` says that this has been reached.
*/
PetscErrorCode LatinEstimateUpdate_Private(Latin latin, PetscReal target, LatinEstimate *estimate)
{
  const PetscInt k = estimate->count++, width = LATIN_ESTIMATE_ROWS + 1;
  const PetscInt first = PetscMax(PetscMax(0, k - LATIN_ESTIMATE_WINDOW), PetscMin(k / 2, k - LATIN_ESTIMATE_SHORT));
  PetscReal     *mine  = LatinEstimateRow(estimate, k);
  PetscReal      worst = 0.0, norm;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Estimate, latin, 0, 0, 0));
  LatinEstimateSketch(latin, estimate->energy, estimate->part);
  PetscCall(MPIU_Allreduce(estimate->part, mine, width, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  norm                      = PetscSqrtReal(mine[LATIN_ESTIMATE_ROWS]);
  mine[LATIN_ESTIMATE_ROWS] = latin->linear.distance;
  for (PetscInt j = first; j < k; j++) {
    const PetscReal then = LatinEstimateRow(estimate, j)[LATIN_ESTIMATE_ROWS];

    if (then > 0.0) worst = PetscMax(worst, LatinEstimateFar(estimate, j, k) / then);
  }
  estimate->value = LatinEstimateSafety[estimate->energy] * (1.0 + LATIN_ESTIMATE_EARLY / (k + 1)) * worst * latin->linear.distance;
  if (k >= 2 * LATIN_ESTIMATE_STEP) {
    const PetscReal before = LatinEstimateFar(estimate, k - 2 * LATIN_ESTIMATE_STEP, k - LATIN_ESTIMATE_STEP), last = LatinEstimateFar(estimate, k - LATIN_ESTIMATE_STEP, k);
    const PetscReal rate = before > 0.0 ? PetscMin(last / before, LATIN_ESTIMATE_RATE) : 0.0;

    estimate->value = PetscMax(estimate->value, last * rate / (1.0 - rate));
  }
  if (norm > 0.0) estimate->value /= norm;
  if (k < 2) estimate->value = 1.0;
  else if (k == 2 || estimate->value <= PetscMax(target, estimate->floor)) PetscCall(LatinEstimateFloor_Private(latin, estimate));
  if (latin->linear.distance <= latin->linear.noise) {
    PetscCall(LatinEstimateFloor_Private(latin, estimate));
    estimate->value = 0.0; /* a fixed point */
  }
  estimate->rounding = (PetscBool)(estimate->floor > target && estimate->value <= estimate->floor);
  estimate->value    = PetscMax(estimate->value, estimate->floor);
  PetscCall(PetscLogEventEnd(LATIN_Estimate, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}
