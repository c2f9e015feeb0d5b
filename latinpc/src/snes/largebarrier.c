#include "snes/sneslatinimpl.h"

/*
   Newton's method where links turn far and many cables slacken: a primal-dual interior-point method [S. J. Wright 1997], with Mehrotra's
   predictor and corrector and Gondzio's corrections. A unilateral link has its tension t >= 0 and its slack s >= 0 as unknowns of their own,

     t - s = k x,  t s = mu^2,

   and mu falls to zero. Its tangent stiffness k t / (t + s) is smooth, so that no cable changes to and fro, and its tension goes ahead of
   the displacements as in snes/largenewton.c: a link that turns has its strain wrong by the square of the angle, which one step corrects. No
   link holds up the others: 10 to 20 steps do, for few links and for many. In each the operators are those of its tangent
   stiffness, for which two to four conjugate gradient iterations do. Where steps are small Newton's method takes over, and proves. A
   tangent that is not positive definite before shows that the loads lead past a limit point: a tower found an equilibrium upside down.
*/

#define LATIN_BARRIER_MOST    60   /* steps: grids of tensegrity modules take 12 to 20 */
#define LATIN_BARRIER_NEAR    0.95 /* of the way to where a tension or a slack would vanish */
#define LATIN_BARRIER_CENTRE  1e-4 /* the mean product falls by no more than that in a step */
#define LATIN_BARRIER_SPREAD  10.0 /* products further than that from their mean are drawn to it by corrections */
#define LATIN_BARRIER_CORRECT 2    /* most corrections; each is a solve with the operators there are */
#define LATIN_BARRIER_SHORT   1e-3 /* steps shorter than that part lead nowhere */
#define LATIN_BARRIER_SMALL   1e-4 /* a step relative to the displacements from which on Newton's method is tried; with 1e-3 it fails on grids */
#define LATIN_BARRIER_AGAIN   0.1  /* where it has failed it is tried again when steps are so much smaller */
#define LATIN_BARRIER_TIMES   2    /* times that it gets operators of its tangent stiffness */

/* All of [links_local] but n */
typedef struct {
  PetscReal *n;            /* [dim] direction of a link */
  PetscReal *x, *k;        /* strain, positive where the link bears; stiffness of the law */
  PetscReal *t, *s;        /* tension and slack; s = 0: not unilateral */
  PetscReal *slope, *tau;  /* stiffness and tension of the tangent */
  PetscReal *v;            /* what t s is to be */
  PetscReal *dt, *ds;      /* of a step */
  PetscReal *trial;        /* v with corrections */
  Vec        du, r, other; /* of a step, its right-hand side; another step */
  PetscReal  mean;         /* of t s */
  PetscReal  links;        /* unilateral ones on all ranks */
  PetscBool  unstable;     /* the tangent of this step is not positive definite */
} LatinBarrier;

static PetscBool LatinBarrierUnilateral(LatinStructure structure, PetscInt l)
{
  return (PetscBool)(structure->law[l] == LATIN_LAW_CABLE || structure->law[l] == LATIN_LAW_COMPRESSION_ONLY || LatinLaws[structure->law[l]].rigid);
}

/* Directions, strains, and the tangent of all links at u. Collective on structure */
static PetscErrorCode LatinBarrierMeasure_Private(LatinStructure structure, Vec u, LatinBarrier *b)
{
  const PetscInt dim = structure->dim;

  PetscFunctionBegin;
  PetscCall(LatinTurningMove_Private(structure, u, b->n, b->x));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal sign  = LatinLawSign(structure->law[l]);
    const PetscBool rigid = LatinLaws[structure->law[l]].rigid;

    if (LatinStructureKeeps(structure, l)) PetscCall(PetscArraycpy(b->n + dim * l, structure->direction + dim * l, dim));
    else (void)LatinUnitVector(dim, b->n + dim * l, b->n + dim * l);
    if (!LatinBarrierUnilateral(structure, l)) {
      b->k[l] = LatinStructureTangent(structure, l, b->x[l]);
      b->t[l] = LatinStructureTension(structure, NULL, l, b->x[l]);
      continue;
    }
    b->k[l] = rigid ? structure->penalty[l] : structure->stiffness[l];
    b->x[l] = sign * (b->x[l] + (rigid ? structure->multiplier[l] / structure->penalty[l] : 0.0));
  }
  PetscFunctionReturn(0);
}

/* The mean product of tension and slack `part` of a step ahead. Collective on structure */
static PetscErrorCode LatinBarrierMean_Private(LatinStructure structure, const LatinBarrier *b, PetscReal part, PetscReal *mean)
{
  PetscFunctionBegin;
  *mean = 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (b->s[l] > 0.0) *mean += (b->t[l] + part * b->dt[l]) * (b->s[l] + part * b->ds[l]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, mean, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  if (b->links > 0.0) *mean /= b->links;
  PetscFunctionReturn(0);
}

/* Changes of the strains by a step, as links stand, into ds. Collective on structure */
static PetscErrorCode LatinBarrierStrains_Private(LatinStructure structure, Vec step, LatinBarrier *b)
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &local));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, step, local)); /* no change where prescribed */
  PetscCall(VecGetArrayRead(local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    b->ds[l] = 0.0;
    for (PetscInt c = 0; c < dim; c++) b->ds[l] += b->n[dim * l + c] * PetscRealPart(a[dim * structure->ends[2 * l + 1] + c] - a[dim * structure->ends[2 * l] + c]);
  }
  PetscCall(VecRestoreArrayRead(local, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &local));
  PetscFunctionReturn(0);
}

/* The step to products v: du, dt, ds. Collective on snes */
static PetscErrorCode LatinBarrierStep_Private(SNES snes, KSP ksp, const PetscReal v[], Vec u, LatinBarrier *b)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  const PetscInt       dim       = structure->dim;
  KSPConvergedReason   reason;
  PetscReal           *f;
  PetscInt             its;
  PC                   pc;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  for (PetscInt l = 0; l < structure->links_local; l++) { /* dt without the part of du */
    const PetscReal t = b->t[l], s = b->s[l], sign = s > 0.0 ? LatinLawSign(structure->law[l]) : 1.0;

    b->dt[l] = s > 0.0 ? (v[l] - t * s + t * (b->k[l] * b->x[l] - t + s)) / (t + s) : 0.0;
    for (PetscInt c = 0; c < dim; c++) f[dim * l + c] = sign * (t + b->dt[l]) * b->n[dim * l + c];
  }
  PetscCall(LatinTurningForces_Private(structure, f, u, structure->load, b->r));
  PetscCall(DMRestoreWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  if (snes->vec_rhs) PetscCall(VecAXPY(b->r, -1.0, snes->vec_rhs));
  PetscCall(VecScale(b->r, -1.0));
  PetscCall(KSPSolve(ksp, b->r, b->du));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(KSPGetIterationNumber(ksp, &its));
  data->newton.stages += its;
  if (reason == KSP_DIVERGED_INDEFINITE_MAT) { /* downhill all the same: the operators leave compression out */
    b->unstable = PETSC_TRUE;
    PetscCall(KSPGetPC(ksp, &pc));
    PetscCall(PCApply(pc, b->r, b->du));
    data->newton.stages++;
  }
  PetscCall(LatinBarrierStrains_Private(structure, b->du, b));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal t = b->t[l], s = b->s[l], sign = s > 0.0 ? LatinLawSign(structure->law[l]) : 1.0, dkx = sign * b->k[l] * b->ds[l];

    b->dt[l] += s > 0.0 ? t * dkx / (t + s) : dkx;
    b->ds[l] = s > 0.0 ? b->dt[l] - dkx - (b->k[l] * b->x[l] - t + s) : 0.0;
  }
  PetscFunctionReturn(0);
}

/* How much of a step leaves tensions and slacks positive. Collective on structure */
static PetscErrorCode LatinBarrierLength_Private(LatinStructure structure, const LatinBarrier *b, PetscReal *length)
{
  PetscFunctionBegin;
  *length = 1.0;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (b->s[l] == 0.0) continue;
    if (b->dt[l] < 0.0) *length = PetscMin(*length, -LATIN_BARRIER_NEAR * b->t[l] / b->dt[l]);
    if (b->ds[l] < 0.0) *length = PetscMin(*length, -LATIN_BARRIER_NEAR * b->s[l] / b->ds[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, length, 1, MPIU_REAL, MPIU_MIN, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}

/* Corrections draw products to their mean, as long as the step becomes longer. Collective on snes */
static PetscErrorCode LatinBarrierCorrect_Private(SNES snes, KSP ksp, PetscReal target, Vec u, LatinBarrier *b, PetscReal *length)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  const PetscInt       n         = structure->links_local;
  PetscReal           *dt, *ds, longer;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, n, MPIU_REAL, &dt));
  PetscCall(DMGetWorkArray(structure->dm, n, MPIU_REAL, &ds));
  for (PetscInt k = 0; k < LATIN_BARRIER_CORRECT && *length < 1.0; k++) {
    const PetscReal at = PetscMin(1.0, 1.5 * *length + 0.3);

    for (PetscInt l = 0; l < n; l++) {
      const PetscReal product = (b->t[l] + at * b->dt[l]) * (b->s[l] + at * b->ds[l]);

      b->trial[l] = b->v[l];
      if (product * LATIN_BARRIER_SPREAD < target) b->trial[l] += target / LATIN_BARRIER_SPREAD - product;
      else if (product > LATIN_BARRIER_SPREAD * target) b->trial[l] += LATIN_BARRIER_SPREAD * PetscMax(target - product / LATIN_BARRIER_SPREAD, -target);
    }
    PetscCall(PetscArraycpy(dt, b->dt, n));
    PetscCall(PetscArraycpy(ds, b->ds, n));
    PetscCall(VecCopy(b->du, b->other));
    PetscCall(LatinBarrierStep_Private(snes, ksp, b->trial, u, b));
    PetscCall(LatinBarrierLength_Private(structure, b, &longer));
    if (longer <= 1.01 * *length) {
      PetscCall(PetscArraycpy(b->dt, dt, n));
      PetscCall(PetscArraycpy(b->ds, ds, n));
      PetscCall(VecCopy(b->other, b->du));
      break;
    }
    PetscCall(PetscArraycpy(b->v, b->trial, n));
    *length = longer;
  }
  PetscCall(DMRestoreWorkArray(structure->dm, n, MPIU_REAL, &ds));
  PetscCall(DMRestoreWorkArray(structure->dm, n, MPIU_REAL, &dt));
  PetscFunctionReturn(0);
}

/* The step from u: to products of zero, which shows how far these can fall, then to what they are to be. Collective on snes */
static PetscErrorCode LatinBarrierDirection_Private(SNES snes, Vec u, LatinBarrier *b, PetscReal *length)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->large.frame->turns;
  PetscReal            ahead, centre;
  KSP                  ksp;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(LatinBarrierMean_Private(structure, b, 0.0, &b->mean));
  PetscCall(PetscArrayzero(b->v, structure->links_local));
  PetscCall(LatinBarrierStep_Private(snes, ksp, b->v, u, b));
  PetscCall(LatinBarrierLength_Private(structure, b, length));
  if (!(b->mean > 0.0)) PetscFunctionReturn(0); /* no unilateral links */
  PetscCall(LatinBarrierMean_Private(structure, b, *length, &ahead));
  centre = PetscMin(1.0, ahead / b->mean);
  centre = PetscMax(centre * centre * centre, LATIN_BARRIER_CENTRE);
  for (PetscInt l = 0; l < structure->links_local; l++) b->v[l] = centre * b->mean - PetscSqr(*length) * b->dt[l] * b->ds[l];
  PetscCall(LatinBarrierStep_Private(snes, ksp, b->v, u, b));
  PetscCall(LatinBarrierLength_Private(structure, b, length));
  PetscCall(LatinBarrierCorrect_Private(snes, ksp, centre * b->mean, u, b, length));
  PetscFunctionReturn(0);
}

/* Stiffness and tension of the tangent, which operators and Jacobian have */
static void LatinBarrierTangent(LatinStructure structure, const LatinBarrier *b)
{
  for (PetscInt l = 0; l < structure->links_local; l++) {
    b->slope[l] = b->s[l] > 0.0 ? b->k[l] * b->t[l] / (b->t[l] + b->s[l]) : b->k[l];
    if (b->s[l] > 0.0) b->tau[l] = LatinLawSign(structure->law[l]) * b->t[l];
  }
}

/* Tensions and slacks at the displacements u, of products as large as the square of the tensions that a linear step to the loads makes. Collective on snes */
static PetscErrorCode LatinBarrierStart_Private(SNES snes, Vec u, LatinBarrier *b)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  PetscReal            sum[3]    = {0.0, 0.0, 0.0}, mu;
  KSP                  ksp;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(b->s, structure->links_local));
  PetscCall(LatinBarrierMeasure_Private(structure, u, b));
  PetscCall(LatinTurningTensions_Private(structure, NULL, u, b->tau));
  PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(SNESComputeFunction(snes, u, b->r));
  PetscCall(VecScale(b->r, -1.0));
  PetscCall(KSPSolve(ksp, b->r, b->du));
  PetscCall(LatinBarrierStrains_Private(structure, b->du, b));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (!LatinBarrierUnilateral(structure, l)) continue;
    sum[0] += PetscSqr(b->tau[l] + b->k[l] * b->ds[l]);
    sum[1] += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)snes)));
  b->links = sum[1];
  mu       = sum[1] > 0.0 ? PetscMax(PetscSqrtReal(sum[0] / sum[1]), PETSC_SQRT_MACHINE_EPSILON) : 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal y = b->k[l] * b->x[l], more = 0.5 * (PetscAbsReal(y) + PetscSqrtReal(y * y + 4.0 * mu * mu));

    if (!LatinBarrierUnilateral(structure, l)) continue;
    b->t[l] = y > 0.0 ? more : mu * mu / more;
    b->s[l] = y > 0.0 ? mu * mu / more : more;
  }
  PetscFunctionReturn(0);
}

/* Steps until one is small, then Newton's method. Collective on snes */
static PetscErrorCode LatinBarrierRun_Private(SNES snes, LatinBarrier *b, PetscBool *done)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  LatinLarge          *large     = &data->large;
  const LatinStructure structure = large->frame->turns;
  PetscReal            near      = LATIN_BARRIER_SMALL, length, step, size;
  Vec                  u         = snes->vec_sol;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(LatinBarrierStart_Private(snes, u, b));
  for (PetscInt k = 0; k < LATIN_BARRIER_MOST && !*done && data->latin->linear.applications + data->newton.stages < snes->max_its; k++) {
    PetscCall(LatinBarrierMeasure_Private(structure, u, b));
    LatinBarrierTangent(structure, b);
    structure->slope = b->slope;
    structure->ahead = b->tau;
    PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
    b->unstable = PETSC_FALSE;
    PetscCall(LatinBarrierDirection_Private(snes, u, b, &length));
    structure->slope = structure->ahead = NULL;
    PetscCall(VecAXPY(u, length, b->du));
    for (PetscInt l = 0; l < structure->links_local; l++) {
      if (b->s[l] == 0.0) b->tau[l] += length * (b->t[l] + b->dt[l] - b->tau[l]);
      else {
        b->t[l] += length * b->dt[l];
        b->s[l] += length * b->ds[l];
      }
    }
    PetscCall(VecNorm(b->du, NORM_2, &step));
    PetscCall(VecNorm(u, NORM_2, &size));
    PetscCall(PetscInfo(snes, "Interior point, step %" PetscInt_FMT ": %g of %g, displacements %g; product of tension and slack %g%s\n", k, (double)length, (double)step, (double)size, (double)b->mean, b->unstable ? ", unstable" : ""));
    if (PetscIsInfOrNanReal(size) || length < LATIN_BARRIER_SHORT) break;
    if (b->unstable && step > large->near * size) break; /* on its way past a limit point; where steps are small it is the node of a cable that slackens */
    if (step > near * size) continue;
    PetscCall(SNESLatinLargeFinish_Private(snes, LATIN_BARRIER_TIMES, PETSC_TRUE, done));
    near *= LATIN_BARRIER_AGAIN;
  }
  PetscFunctionReturn(0);
}

/* From the displacements in the solution vector to the solution, whose error is proved: then *done. Collective on snes */
PetscErrorCode SNESLatinLargeBarrier_Private(SNES snes, PetscBool *done)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  const PetscInt       n         = structure->links_local;
  LatinBarrier         b;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(&b, sizeof(b)));
  PetscCall(PetscMalloc7(structure->dim * n, &b.n, n, &b.x, n, &b.k, n, &b.t, n + 1, &b.slope, n + 1, &b.tau, n, &b.v));
  PetscCall(PetscMalloc4(n, &b.s, n, &b.dt, n, &b.ds, n, &b.trial));
  PetscCall(VecDuplicate(snes->vec_sol, &b.du));
  PetscCall(VecDuplicate(snes->vec_sol, &b.r));
  PetscCall(VecDuplicate(snes->vec_sol, &b.other));
  PetscCall(LatinBarrierRun_Private(snes, &b, done));
  PetscCall(VecDestroy(&b.du));
  PetscCall(VecDestroy(&b.r));
  PetscCall(VecDestroy(&b.other));
  PetscCall(PetscFree4(b.s, b.dt, b.ds, b.trial));
  PetscCall(PetscFree7(b.n, b.x, b.k, b.t, b.slope, b.tau, b.v));
  PetscFunctionReturn(0);
}
