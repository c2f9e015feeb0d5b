#include "error/latinerror.h"

/*
   Tensions between bounds, by the primal-dual interior-point method of S. Mehrotra:

     B^t (t + R x) = f,   x = B d + e0 - c t,   x = sum over bounds of -sign s,   y = sign (t - bound) >= 0,   s >= 0,   s y = 0.

   Each bound on the tension t of a link has two unknowns: the distance y of t from the bound, and the elongation s of the link at the bound. c:
   compliance of the link; R: stiffness of bars beside all links. The number of steps hardly depends on the size of the structure. A step takes one
   factorisation of B^t (R + W) B with W > 0 and two solves: no link delays the others, and no node is loose. Tensions are regularised [M. P.
   Friedlander, D. Orban], which bounds W and does not change the solution.

   A step (LatinPrimalDualIterate_Private): weights W; operator; predictor step and the mean product to aim at; corrector step; its length. If a solve fails,
   tensions are regularised more.
*/

#define LATIN_PRIMAL_DUAL_LENGTH 0.995 /* step length, relative to the longest step with all s and y >= 0 */
#define LATIN_PRIMAL_DUAL_POWER  3     /* exponent of the reduction of the mean product by the predictor step, at which the corrector step aims */
#define LATIN_PRIMAL_DUAL_RISE   2.0   /* largest growth of the mean product in a step: near a singular operator a short step ends far from all paths */
#define LATIN_PRIMAL_DUAL_GROWS  100.0 /* growth of the regularisation after a failed solve */
#define LATIN_SLIP_LENGTH        0.95  /* step length with friction, where the path bends, unless the mean product falls by more in the step */
#define LATIN_SLIP_POWER         1     /* exponent with friction */
#define LATIN_SLIP_FOLLOW        3     /* exponent of c->follow: the mean product stays while friction bounds follow slowly */

/* Computes the bounds on the tensions relative to the least tensions t between them (links that always pull load the structure), and c->count. Collective */
static PetscErrorCode LatinPrimalDualBounds_Private(LatinPrimalDual *c)
{
  PetscFunctionBegin;
  c->count = (PetscReal)c->slips;
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal bound[2] = {0.0, 0.0}; /* 0: tangential parts of contacts, see error/slip.c */

    if (LatinPrimalDualFollows(c, l)) bound[0] = -(bound[1] = INFINITY);
    else if (c->structure->law[l] != LATIN_LAW_TANGENT) LatinLinkBounds(c->structure, l, bound);
    c->t[l] = PetscMin(PetscMax(0.0, bound[0]), bound[1]);
    for (PetscInt i = 0; i < 2; i++) c->side[l][i].bound = bound[i] - c->t[l];
    for (PetscInt i = 0; i < 2; i++) c->count += LatinBoundAt(c, l, i) ? 1.0 : 0.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &c->count, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  PetscFunctionReturn(0);
}

/* Allocates vectors and arrays, zero, and computes the bounds on the tensions. f: loads and `more`, less the least tensions; d = 0. Collective */
PetscErrorCode LatinPrimalDualCreate_Private(LatinPrimalDual *c, Vec more)
{
  const DM dm = c->structure->dm;

  PetscFunctionBegin;
  c->n = c->structure->links_local;
  PetscCall(PetscCalloc7(c->n, &c->x, c->n, &c->dx, c->n, &c->t, c->n, &c->dt, c->n, &c->w, c->n, &c->rhs, c->n, &c->side));
  PetscCall(PetscCalloc1(c->n, &c->give));
  PetscCall(DMGetGlobalVector(dm, &c->f));
  PetscCall(DMGetGlobalVector(dm, &c->d));
  PetscCall(DMGetGlobalVector(dm, &c->r));
  PetscCall(DMGetGlobalVector(dm, &c->dd));
  PetscCall(LatinSlipsCreate_Private(c));
  PetscCall(LatinPrimalDualBounds_Private(c));
  PetscCall(LatinStructureLoads_Private(c->structure, more, c->f));
  PetscCall(VecZeroEntries(c->d));
  PetscCall(LatinStructureForces_Private(c->structure, c->t, c->d, NULL, c->r));
  PetscCall(VecAXPY(c->f, -1.0, c->r));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinPrimalDualDestroy_Private(LatinPrimalDual *c)
{
  const DM dm = c->structure->dm;

  PetscFunctionBegin;
  PetscCall(DMRestoreGlobalVector(dm, &c->dd));
  PetscCall(DMRestoreGlobalVector(dm, &c->r));
  PetscCall(DMRestoreGlobalVector(dm, &c->d));
  PetscCall(DMRestoreGlobalVector(dm, &c->f));
  PetscCall(PetscFree(c->give));
  PetscCall(PetscFree(c->slip));
  PetscCall(PetscFree7(c->x, c->dx, c->t, c->dt, c->w, c->rhs, c->side));
  PetscFunctionReturn(0);
}

/* Solves dd = A^-1 b. Collective */
PetscErrorCode LatinPrimalDualSolve_Private(LatinPrimalDual *c, Vec b, PetscBool *failed)
{
  KSPConvergedReason reason;
  PetscInt           stages;

  PetscFunctionBegin;
  if (c->singular) *failed = PETSC_TRUE;
  if (c->singular) PetscFunctionReturn(0);
  PetscCall(KSPSolve(c->ksp, b, c->dd));
  PetscCall(KSPGetConvergedReason(c->ksp, &reason));
  PetscCall(KSPGetIterationNumber(c->ksp, &stages));
  c->stages += stages;
  if (reason < 0) *failed = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Adds to the diagonal of A its rounding, for grains held only by each other have no other stiffness near a solution. Collective */
static PetscErrorCode LatinPrimalDualShift_Private(LatinPrimalDual *c)
{
  Vec diagonal;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(c->structure->dm, &diagonal));
  PetscCall(MatGetDiagonal(c->A, diagonal));
  PetscCall(VecScale(diagonal, LATIN_MECHANISM));
  PetscCall(MatDiagonalSet(c->A, diagonal, ADD_VALUES));
  PetscCall(DMRestoreGlobalVector(c->structure->dm, &diagonal));
  PetscFunctionReturn(0);
}

/*
   Computes A = B^t (R + W) B, which the next solve factors. With friction A is assembled, and factored here. slips: with the tangent stiffnesses of
   contacts. Collective
*/
PetscErrorCode LatinPrimalDualOperator_Private(LatinPrimalDual *c, PetscBool slips)
{
  LatinFactorStatus status = {.ierr = 0};
  PetscBool         failed;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) c->rhs[l] = c->reference + PetscMax(c->w[l], c->floor);
  if (c->structure->has_friction) {
    PetscCall(MatZeroEntries(c->A));
    if (slips) PetscCall(LatinSlipsAdd_Private(c, c->A));
    PetscCall(LatinStructureAssemble_Private(c->structure, c->rhs, c->A));
    PetscCall(LatinPrimalDualShift_Private(c));
  } else PetscCall(LatinTangentGive_Private(c->structure, c->rhs, c->A));
  PetscCall(KSPSetOperators(c->ksp, c->A, c->A));
  if (!c->structure->has_friction) PetscFunctionReturn(0);
  PetscCall(LatinFactorTry_Private(c->ksp, c->A, &status));
  failed = LatinFactorFailed(&status);
  PetscCall(MPIU_Allreduce(&failed, &c->singular, 1, LATIN_MPI_BOOL, MPI_LOR, PetscObjectComm((PetscObject)c->structure)));
  PetscFunctionReturn(0);
}

/* Computes x = B d + e0 - c t; only B d if stiffnesses do not matter (R > 0). Collective */
PetscErrorCode LatinPrimalDualElongations_Private(LatinPrimalDual *c)
{
  PetscFunctionBegin;
  if (c->reference > 0.0) PetscCall(LatinStructureElongations_Private(c->structure, NULL, c->d, c->x));
  else PetscCall(LatinStructureStrains_Private(c->structure, c->d, c->x));
  for (PetscInt l = 0; l < c->n; l++) c->x[l] -= c->give[l] * c->t[l];
  PetscFunctionReturn(0);
}

/*
   Computes a step: the predictor step, towards s y = 0, or the corrector step (`corrects`), towards s y = mean, with the second-order term ds dy of
   the predictor. Collective
*/
static PetscErrorCode LatinPrimalDualStep_Private(LatinPrimalDual *c, PetscBool corrects, PetscReal mean, PetscBool *failed)
{
  PetscFunctionBegin;
  /* dt = W (x - sum of sign rhs / y + dx); W dx is added after the solve */
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal x = c->x[l];

    for (PetscInt i = 0; i < 2; i++) {
      LatinBound *at = LatinBoundAt(c, l, i);

      if (!at) continue;
      at->rhs = corrects ? LatinBoundSign(i) * at->ds * c->dt[l] - mean : 0.0;
      x -= LatinBoundSign(i) * at->rhs / at->y;
    }
    c->dx[l] = LatinPrimalDualFollows(c, l) ? LatinStructureTension(c->structure, NULL, l, c->x[l]) - c->t[l] : c->w[l] * x;
  }
  LatinSlipsBegin(c, corrects, mean, c->dx);
  PetscCall(PetscArraycpy(c->dt, c->dx, c->n));
  for (PetscInt l = 0; l < c->n; l++) c->dx[l] += c->reference * c->x[l] + c->t[l];
  PetscCall(LatinStructureForces_Private(c->structure, c->dx, c->d, NULL, c->r));
  PetscCall(VecAYPX(c->r, -1.0, c->f));
  PetscCall(LatinPrimalDualSolve_Private(c, c->r, failed));
  PetscCall(LatinStructureElongations_Private(c->structure, NULL, c->dd, c->dx));
  for (PetscInt l = 0; l < c->n; l++) {
    c->dt[l] += c->w[l] * c->dx[l];
    for (PetscInt i = 0; i < 2; i++) {
      LatinBound *at = LatinBoundAt(c, l, i);

      if (at) at->ds = -at->s - (at->rhs + LatinBoundSign(i) * at->s * c->dt[l]) / at->y;
    }
  }
  LatinSlipsEnd(c);
  PetscFunctionReturn(0);
}

/* Computes the mean complementarity product after a step of this length. Collective */
PetscErrorCode LatinPrimalDualMean_Private(const LatinPrimalDual *c, PetscReal length, PetscReal *mean)
{
  PetscReal sum = LatinSlipsProducts(c, length);

  PetscFunctionBegin;
  for (PetscInt k = 0; k < 2 * c->n; k++) {
    const LatinBound *at = LatinBoundAt(c, k / 2, k % 2);

    if (at) sum += (at->s + length * at->ds) * (at->y + length * LatinBoundSign(k % 2) * c->dt[k / 2]);
  }
  PetscCall(MPIU_Allreduce(&sum, mean, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  *mean /= c->count;
  PetscFunctionReturn(0);
}

/* Computes the step length: `back` times the longest step that keeps all s and y >= 0, at most 1. Collective */
static PetscErrorCode LatinPrimalDualLength_Private(LatinPrimalDual *c, PetscReal back, PetscReal *length)
{
  PetscFunctionBegin;
  *length = 1.0 / back;
  for (PetscInt k = 0; k < 2 * c->n; k++) {
    const LatinBound *at = LatinBoundAt(c, k / 2, k % 2);
    const PetscReal   dy = LatinBoundSign(k % 2) * c->dt[k / 2];

    if (at && at->ds < 0.0) *length = PetscMin(*length, -at->s / at->ds);
    if (at && dy < 0.0) *length = PetscMin(*length, -at->y / dy);
  }
  LatinSlipsLength(c, length);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, length, 1, MPIU_REAL, MPIU_MIN, PetscObjectComm((PetscObject)c->structure)));
  *length *= back;
  PetscFunctionReturn(0);
}

/*
   Shortens the step until the mean product grows by no more than LATIN_PRIMAL_DUAL_RISE in it, to zero if need be, as the products may be rounding, and
   updates c->mean. Collective
*/
static PetscErrorCode LatinPrimalDualBounded_Private(LatinPrimalDual *c)
{
  const PetscReal most = LATIN_PRIMAL_DUAL_RISE * c->mean;

  PetscFunctionBegin;
  PetscCall(LatinPrimalDualMean_Private(c, c->length, &c->mean));
  while (c->mean > most && c->length > 0.0) {
    c->length *= 0.5;
    PetscCall(LatinPrimalDualMean_Private(c, c->length, &c->mean));
  }
  PetscFunctionReturn(0);
}

/* Computes the weights W of links and the tangent stiffnesses of contacts. Not collective */
static void LatinPrimalDualWeights(LatinPrimalDual *c)
{
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal give = c->give[l] + c->regularisation;

    for (PetscInt i = 0; i < 2; i++) give += LatinBoundAt(c, l, i) ? c->side[l][i].s / c->side[l][i].y : 0.0;
    c->w[l] = c->side[l][0].bound == c->side[l][1].bound ? 0.0 : 1.0 / give; /* the tension is constant */
    if (LatinPrimalDualFollows(c, l)) c->w[l] = LatinStructureTangent(c->structure, l, c->x[l]);
  }
  LatinSlipsWeights(c);
}

/* Computes *aim, the mean product at which the corrector step aims, by the predictor step. Collective */
static PetscErrorCode LatinPrimalDualPredict_Private(LatinPrimalDual *c, PetscReal *aim, PetscBool *failed)
{
  const PetscBool slips = c->structure->has_friction;
  PetscReal       length, after;

  PetscFunctionBegin;
  *aim = c->mean;
  PetscCall(LatinPrimalDualStep_Private(c, PETSC_FALSE, 0.0, failed));
  if (*failed) PetscFunctionReturn(0);
  PetscCall(LatinPrimalDualLength_Private(c, 1.0, &length));
  PetscCall(LatinPrimalDualMean_Private(c, length, &after));
  *aim = c->mean * PetscPowRealInt(PetscMin(1.0, after / c->mean), slips ? LATIN_SLIP_POWER : LATIN_PRIMAL_DUAL_POWER);
  if (slips) *aim = c->mean + PetscPowRealInt(c->follow, LATIN_SLIP_FOLLOW) * (*aim - c->mean);
  *aim = PetscMax(c->least, *aim);
  PetscFunctionReturn(0);
}

/* Computes the next step: weights W, predictor, corrector. Collective */
static PetscErrorCode LatinPrimalDualDirection_Private(LatinPrimalDual *c, PetscReal *aim, PetscBool *failed)
{
  PetscFunctionBegin;
  LatinPrimalDualWeights(c);
  PetscCall(LatinPrimalDualOperator_Private(c, PETSC_TRUE));
  PetscCall(LatinPrimalDualPredict_Private(c, aim, failed));
  if (!*failed) PetscCall(LatinPrimalDualStep_Private(c, PETSC_TRUE, *aim, failed));
  PetscFunctionReturn(0);
}

/* Takes an interior-point step: updates d, t, s, y, x and the mean complementarity product. Collective */
PetscErrorCode LatinPrimalDualIterate_Private(LatinPrimalDual *c, PetscBool *failed)
{
  PetscReal aim, back = LATIN_PRIMAL_DUAL_LENGTH;

  PetscFunctionBegin;
  PetscCall(LatinPrimalDualDirection_Private(c, &aim, failed));
  while (*failed && c->regularisation < c->softest) { /* the operator is singular to rounding */
    *failed = PETSC_FALSE;
    c->regularisation *= LATIN_PRIMAL_DUAL_GROWS;
    PetscCall(LatinPrimalDualDirection_Private(c, &aim, failed));
  }
  if (*failed) PetscFunctionReturn(0);
  if (c->structure->has_friction) back = PetscMin(back, PetscMax(LATIN_SLIP_LENGTH, 1.0 - aim / c->mean));
  PetscCall(LatinPrimalDualLength_Private(c, back, &c->length));
  PetscCall(LatinPrimalDualBounded_Private(c));
  PetscCall(VecAXPY(c->d, c->length, c->dd));
  for (PetscInt l = 0; l < c->n; l++) {
    c->t[l] += c->length * c->dt[l];
    for (PetscInt i = 0; i < 2; i++) {
      LatinBound *at = LatinBoundAt(c, l, i);

      if (!at) continue;
      at->s += c->length * at->ds;
      at->y += c->length * LatinBoundSign(i) * c->dt[l];
    }
  }
  c->unbalance *= 1.0 - c->length;
  PetscCall(LatinPrimalDualElongations_Private(c));
  LatinSlipsMove(c);
  if (c->structure->has_friction) PetscCall(LatinPrimalDualMean_Private(c, 0.0, &c->mean)); /* contacts may have moved into their cones */
  PetscFunctionReturn(0);
}
