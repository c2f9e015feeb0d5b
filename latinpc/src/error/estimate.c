#include "error/latinerror.h"

/*
   A posteriori estimate of the error of the displacements, from the iterates alone. It uses two facts:

   - the error of an earlier iterate is about its distance to the present one, once that is much better;
   - near the solution the map z -> z - G(z) is linear: the ratio of the error of an iterate to the distance between its two
     stages (stages/local.c) depends on its slow and fast modes, and changes slowly.

   So the largest ratio of the last iterates, times the present distance, estimates the present error:
   max_j |U_j - U_k| / distance_j * distance_k. The window must cover the slowest modes: it is the later half of all
   iterates, of which at least 32 are stored, evenly spaced. A safety factor is calibrated on one set of structures
   (benchmarks/effectivity.py) and tested on another. Modes that creep without effect on the distance of the stages, as those
   of links about to slacken, need extrapolation [A. C. Aitken]: steps that decrease by a rate q sum up to q / (1 - q) times
   the last one. The rate of the distance of the stages counts as well if it is larger, and at the first iterates alone: of 1,374 stops of 180 random
   structures (benchmarks/effectivity.py, seed 11) 6 miss the target, 8 without it, 11 without the first iterates either.

   Distances are computed from random projections (sketches) of the displacements, a few hundred numbers instead of
   millions: each degree of freedom is added to one entry of the sketch, with a random sign, which preserves distances to
   sqrt(1 / (2 ROWS)) [M. Charikar, K. Chen, M. Farach-Colton: count sketch]. Entry and sign are a hash of the place of the
   degree of freedom in its subdomain, so that they do not depend on the number of ranks.
*/

#define LATIN_ESTIMATE_ROWS   256  /* entries of a sketch; distances are accurate to 1 / sqrt(2 ROWS), 4 % */
#define LATIN_ESTIMATE_BITS   9    /* random bits per degree of freedom: its entry, of 2^8, and its sign */
#define LATIN_ESTIMATE_SHARE  6    /* degrees of freedom that share a hash of 64 bits */
#define LATIN_ESTIMATE_WINDOW 64   /* most iterates stored; even, as half of them are dropped when it is full */
#define LATIN_ESTIMATE_STEP   4    /* least number of iterates between those of the extrapolation */
#define LATIN_ESTIMATE_RATE   0.98 /* upper bound of the rate of the extrapolation */
#define LATIN_ESTIMATE_NOISE  64.0 /* times eps, the displacements of the ends of a link and its search parameter: rounding of its tension */
/* iterates before the first estimate; one more with rigid links, else a warm start whose error has a slow mode seems converged */
#define LATIN_ESTIMATE_FIRST 3
#define LATIN_ESTIMATE_EARLY 10.0 /* safety factor of the first iterates is 1 + this / iterates, as their window is short */

/* safety factor of motions with rigid links, whose unbalance is not checked: masses are soft springs, whose slow modes appear late */
#define LATIN_ESTIMATE_MOVING 10.0

static const PetscReal LatinEstimateSafety[] = {1.8, 4.0}; /* l2 norm, energy norm */

/* Returns the number of fields with an estimate: displacements, and with rigid links tensions, which displacements do not determine */
static inline PetscInt LatinEstimateFields(Latin latin)
{
  return latin->sub.structure->rigid_law < 0 ? 1 : 2;
}

PetscErrorCode LatinEstimateStart_Private(Latin latin, LatinEstimate *estimate)
{
  const PetscInt width = LatinEstimateFields(latin) * (LATIN_ESTIMATE_ROWS + 1) + 2;

  PetscFunctionBegin;
  if (width != estimate->width) {
    PetscCall(PetscFree2(estimate->sketch, estimate->part));
    PetscCall(PetscMalloc2((LATIN_ESTIMATE_WINDOW + 1) * width, &estimate->sketch, width, &estimate->part));
    estimate->width = width;
  }
  estimate->count = estimate->stored = 0;
  estimate->stride                   = 1;
  estimate->value                    = 1.0;
  estimate->tensions                 = -1.0;
  estimate->floor                    = 0.0;
  PetscFunctionReturn(0);
}

/* Adds v to the entry of a sketch and with the sign given by random bits, and v^2 to the squared norm behind the sketch */
static inline void LatinEstimateAdd(PetscReal sketch[], uint64_t bits, PetscReal v)
{
  sketch[(bits >> 1) % LATIN_ESTIMATE_ROWS] += bits & 1 ? v : -v;
  sketch[LATIN_ESTIMATE_ROWS] += v * v;
}

/* Returns the hash of a place in a subdomain */
static inline uint64_t LatinEstimateBits(PetscInt subdomain, PetscInt place)
{
  return LatinMix(((uint64_t)subdomain << 32) ^ (uint64_t)place) >> 1;
}

/* Adds the displacements of this rank to a sketch. Negative stiffness across struts, in geometry prestress, counts as positive */
static void LatinEstimateSketch(Latin latin, PetscBool energy, PetscReal sketch[])
{
  const LatinSubdomains *sub = &latin->sub;
  const PetscInt         dim = latin->sub.structure->dim;
  const PetscReal       *U   = latin->linear.U;

  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt first = energy ? sub->link_offset[s] : dim * sub->node_offset[s], last = energy ? sub->link_offset[s + 1] : dim * sub->node_offset[s + 1];

    for (PetscInt i = first; i < last;) {
      uint64_t bits = LatinEstimateBits(sub->first + s, (i - first) / LATIN_ESTIMATE_SHARE);

      for (PetscInt c = 0; c < LATIN_ESTIMATE_SHARE && i < last; c++, i++, bits >>= LATIN_ESTIMATE_BITS) LatinEstimateAdd(sketch, bits, energy ? PetscSqrtReal(PetscAbsReal(sub->stiffness[i])) * LatinElongation(sub, dim, i, U) : U[i]);
    }
  }
}

/* Adds the tensions to a sketch, if there are rigid links; behind the norm is their squared rounding */
static void LatinEstimateTensions(Latin latin, PetscReal sketch[])
{
  const LatinSubdomains *sub = &latin->sub;
  const PetscInt         dim = latin->sub.structure->dim;

  for (PetscInt l = 0, s = 0; l < sub->links; l++) {
    const PetscInt   a = dim * sub->ends[2 * l], b = dim * sub->ends[2 * l + 1];
    const PetscReal *U    = latin->linear.U;
    PetscReal        ends = 0.0, held = 0.0;

    while (l >= sub->link_offset[s + 1]) s++;
    LatinEstimateAdd(sketch, LatinEstimateBits(sub->first + s, l - sub->link_offset[s]), sub->state[l] >= 0 ? latin->linear.tension[sub->state[l]] : sub->stiffness[l] * (sub->e0[l] + LatinElongation(sub, dim, l, U)));
    for (PetscInt c = 0; c < dim; c++) ends += PetscAbsReal(sub->direction[dim * l + c]) * (PetscAbsReal(U[a + c]) + PetscAbsReal(U[b + c]));
    for (PetscInt c = 0; c < dim && sub->ground; c++) held += PetscAbsReal(sub->direction[dim * l + c]) * (sub->ground[a + c] * PetscAbsReal(U[a + c]) + sub->ground[b + c] * PetscAbsReal(U[b + c])); /* at heavy nodes */
    sketch[LATIN_ESTIMATE_ROWS + 1] += PetscSqr(LATIN_ESTIMATE_NOISE * PETSC_MACHINE_EPSILON * (sub->stiffness[l] * ends + held));
  }
}

/*
   Computes estimate->floor, the rounding error of the displacements. Without loads and with strains below rounding, supports have moved the structure
   as a rigid body: no digits are lost. Collective on latin
*/
PetscErrorCode LatinEstimateFloor_Private(Latin latin, LatinEstimate *estimate)
{
  const LatinSubdomains *sub    = &latin->sub;
  const PetscInt         dim    = latin->sub.structure->dim;
  const PetscReal       *U      = latin->linear.U;
  PetscReal              sum[3] = {0.0, 0.0, 0.0}; /* squares: displacements of ends and strains, in energy; loads */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < sub->links; l++) {
    const PetscReal *n = sub->direction + dim * l, *ua = U + dim * sub->ends[2 * l], *ub = U + dim * sub->ends[2 * l + 1];
    const PetscReal  tension = LatinLaws[sub->law[l]].rigid && sub->state[l] >= 0 ? latin->linear.tension[sub->state[l]] : 0.0;
    PetscReal        a = 0.0, b = 0.0;

    if (LatinLaws[sub->law[l]].rigid && tension == 0.0) continue;
    for (PetscInt c = 0; c < dim; c++) {
      a += n[c] * ua[c];
      b += n[c] * ub[c];
    }
    if (tension != 0.0) sum[1] += tension * tension / sub->stiffness[l]; /* the tension of a rigid link counts like a strain */
    sum[0] += sub->stiffness[l] * (a * a + b * b);
    sum[1] += sub->stiffness[l] * (b - a) * (b - a);
  }
  for (PetscInt i = 0; sub->ground && i < dim * sub->copies; i++) { /* masses of a motion */
    sum[0] += sub->ground[i] * U[i] * U[i];
    sum[1] += sub->ground[i] * U[i] * U[i];
  }
  for (PetscInt i = 0; i < dim * sub->copies; i++) sum[2] += PetscSqr(latin->linear.load[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  estimate->floor = LatinRounding(sum[0], sum[2] > 0.0 || sum[1] > PetscSqr(LATIN_ESTIMATE_NOISE * PETSC_MACHINE_EPSILON) * sum[0] ? sum[1] : 0.0);
  PetscFunctionReturn(0);
}

/* Returns the distance of the stages of the stored iterate i, stored behind its sketches */
static inline PetscReal LatinEstimateDistance(const LatinEstimate *estimate, PetscInt i)
{
  return estimate->sketch[(i + 1) * estimate->width - 1];
}

/* Returns the distance of a field between two stored iterates */
static PetscReal LatinEstimateFar(const LatinEstimate *estimate, PetscInt field, PetscInt i, PetscInt j)
{
  const PetscReal *a = estimate->sketch + i * estimate->width + field * (LATIN_ESTIMATE_ROWS + 1), *b = a + (j - i) * estimate->width;
  PetscReal        sum = 0.0;

  for (PetscInt r = 0; r < LATIN_ESTIMATE_ROWS; r++) sum += PetscSqr(a[r] - b[r]);
  return PetscSqrtReal(sum);
}

/* Returns the estimated relative error of a field of the last stored iterate */
static PetscReal LatinEstimateField(const LatinEstimate *estimate, PetscInt field)
{
  const PetscInt  last = estimate->stored - 1, first = last / 2;
  const PetscInt  step  = PetscMax(1, LATIN_ESTIMATE_STEP / estimate->stride);
  const PetscReal norm  = PetscSqrtReal(estimate->sketch[last * estimate->width + field * (LATIN_ESTIMATE_ROWS + 1) + LATIN_ESTIMATE_ROWS]);
  const PetscReal noise = field ? PetscSqrtReal(estimate->sketch[(last + 1) * estimate->width - 2]) : 0.0;
  PetscReal       worst = 0.0, error, before, now, rate;

  if (field && norm <= noise) return 0.0; /* tensions are rounding only */
  for (PetscInt i = first; i < last; i++) {
    if (LatinEstimateDistance(estimate, i) > 0.0) worst = PetscMax(worst, (LatinEstimateFar(estimate, field, i, last) - noise) / LatinEstimateDistance(estimate, i));
  }
  error = LatinEstimateSafety[estimate->energy] * (1.0 + LATIN_ESTIMATE_EARLY / estimate->count) * worst * LatinEstimateDistance(estimate, last);
  if (last >= 2 * step) {
    before = LatinEstimateFar(estimate, field, last - 2 * step, last - step);
    now    = PetscMax(0.0, LatinEstimateFar(estimate, field, last - step, last) - noise);
    rate   = before > 0.0 ? now / before : 0.0;
    if (LatinEstimateDistance(estimate, last - step) > 0.0) rate = PetscMax(rate, LatinEstimateDistance(estimate, last) / LatinEstimateDistance(estimate, last - step));
    rate  = PetscMin(rate, LATIN_ESTIMATE_RATE);
    error = PetscMax(error, LatinEstimateSafety[estimate->energy] * now * rate / (1.0 - rate));
  } else if (last && LatinEstimateDistance(estimate, last - 1) > 0.0) { /* too few iterates to extrapolate: by the rate of the distance of the stages */
    rate = PetscMin(LatinEstimateDistance(estimate, last) / LatinEstimateDistance(estimate, last - 1), LATIN_ESTIMATE_RATE);
    error /= 1.0 - rate;
  }
  return norm > 0.0 ? error / norm : error;
}

/* Stores the sketches of this iterate; drops every other iterate when the window is full. Collective on latin */
static PetscErrorCode LatinEstimateStore_Private(Latin latin, LatinEstimate *estimate)
{
  const PetscInt width = estimate->width;
  PetscReal     *mine  = estimate->sketch + estimate->stored * width;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(estimate->part, width));
  LatinEstimateSketch(latin, estimate->energy, estimate->part);
  if (LatinEstimateFields(latin) > 1) LatinEstimateTensions(latin, estimate->part + LATIN_ESTIMATE_ROWS + 1);
  PetscCall(MPIU_Allreduce(estimate->part, mine, width - 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  mine[width - 1] = latin->linear.distance;
  estimate->stored++;
  for (PetscInt f = 0; f < LatinEstimateFields(latin); f++) {
    estimate->ratio[f] = LatinEstimateField(estimate, f);
    if (latin->sub.structure->ground && LatinEstimateFields(latin) > 1) estimate->ratio[f] *= LATIN_ESTIMATE_MOVING;
    if (latin->linear.distance > 0.0) estimate->ratio[f] /= latin->linear.distance;
  }
  if (estimate->stored <= LATIN_ESTIMATE_WINDOW) PetscFunctionReturn(0);
  for (PetscInt i = 1; 2 * i < estimate->stored; i++) PetscCall(PetscArraycpy(estimate->sketch + i * width, estimate->sketch + 2 * i * width, width));
  estimate->stored = (estimate->stored + 1) / 2;
  estimate->stride *= 2;
  PetscFunctionReturn(0);
}

/*
   Updates the estimated relative errors of the displacements, and of the tensions of rigid links, after an application of the fixed-point map.
   They are 1 at the first few iterates. `rounding` is set when the error reaches a floor of rounding above the target.
   Collective on latin
*/
PetscErrorCode LatinEstimateUpdate_Private(Latin latin, PetscReal target, LatinEstimate *estimate)
{
  const PetscInt k = estimate->count++, first = LATIN_ESTIMATE_FIRST - 2 + LatinEstimateFields(latin);

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Estimate, latin, 0, 0, 0));
  if (k % estimate->stride == 0) PetscCall(LatinEstimateStore_Private(latin, estimate));
  if (k % estimate->stride == 0) PetscCall(PetscLogFlops(estimate->energy ? (4.0 * latin->sub.dim + 3.0) * latin->sub.links : 1.0 * latin->sub.bs * latin->sub.copies));
  estimate->value = k < first ? 1.0 : estimate->ratio[0] * latin->linear.distance;
  if (LatinEstimateFields(latin) > 1) {
    estimate->tensions = k < first ? 1.0 : estimate->ratio[1] * latin->linear.distance;
    estimate->value    = PetscMax(estimate->value, estimate->strict * estimate->tensions);
  }
  if (k == first || (k > first && estimate->value <= PetscMax(target, estimate->floor))) PetscCall(LatinEstimateFloor_Private(latin, estimate));
  if (latin->linear.distance <= latin->linear.noise) {
    PetscCall(LatinEstimateFloor_Private(latin, estimate));
    estimate->value = 0.0; /* a fixed point */
    if (LatinEstimateFields(latin) > 1) estimate->tensions = 0.0;
  }
  estimate->rounding = (PetscBool)(estimate->floor > target && estimate->value <= estimate->floor);
  estimate->value    = PetscMax(estimate->value, estimate->floor);
  PetscCall(PetscLogEventEnd(LATIN_Estimate, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}
