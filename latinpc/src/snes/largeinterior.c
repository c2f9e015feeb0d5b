#include "snes/sneslatinimpl.h"

/*
   Where all links are cables, some of them inextensible, or contacts the energy is least: a convex problem. The method of
   multipliers (snes/largerigid.c) ends it from near its solution; from afar, among thousands of cables that become taut and slack by turns,
   its Newton's method goes to and fro. So an interior point method [S. Mehrotra 1992] goes there first, in 10 to 20 linear solves whatever the size. A cable
   of length L has h = (L^2 - |r|^2) / 2, a link that keeps its direction its gap h; with force densities g (tension over
   length; of such a link its force) and slacks s,

     sum of g r = load on each node,  s = h,  g s = mu,  g > 0,  s > 0,  mu -> 0.

   A cable of the stiffness k is longer, L / (1 - g / k), which adds g times half the derivative of the square of that to s, in what
   follows. Without dg and ds Newton's step has the stiffness g 1 + (g / s) r r^t of each cable: it is the tangent stiffness of a
   spring g + (g / s) R^2 that bears g R, so that operators and conjugate gradients are those of cables. No cable is slack on the way.
*/

#define LATIN_INTERIOR_MOST    60   /* steps: 10 to 20 where there is an equilibrium */
#define LATIN_INTERIOR_SMALL   1e-8 /* of tensions times lengths: products of tensions and gaps from where the method of multipliers changes few cables */
#define LATIN_INTERIOR_AIM     0.3  /* of these products: where lengths and balance follow later no smaller ones are wanted, whose linear systems are next to singular */
#define LATIN_INTERIOR_LEFT    1e-4 /* the same of lengths missed and forces without balance: they fall with the products, until these make linear systems singular */
#define LATIN_INTERIOR_BACK    0.99 /* of the way to where a force density or a slack vanishes */
#define LATIN_INTERIOR_FIRST   0.1  /* slacks at first, of L^2 */
#define LATIN_INTERIOR_FLOOR   1e-6 /* of the mean tension over length: force densities at least in the linear systems, for nodes that slack cables alone hold */
#define LATIN_INTERIOR_STILL   1e-6 /* a part of a step that is no step */
#define LATIN_INTERIOR_RTOL    1e-8 /* of a linear solve: what it leaves grows by g / s, a stiffness, in the forces of the next point */
#define LATIN_INTERIOR_PENALTY 1e3  /* times the mean tension over length: the penalty afterwards */

typedef struct {
  LatinStructure structure;
  PetscReal     *g, *s, *dg, *ds, *h, *add, *tension; /* [links_local]; add: dg where displacements stay */
  PetscReal     *span[2], *x[2];                      /* from node to node, and strains: at u, and after the step */
  PetscBool     *held;                                /* between prescribed displacements: bears nothing, and is as if it had room */
  PetscReal      length, force;                       /* mean length of the cables, mean load of a node */
  PetscReal      gap, whole;                          /* sums of g s, and of g L^2 */
  Vec            at, step, r;
} LatinInterior;

/* A force density that a cable of the natural length L cannot exceed: its stiffness */
static PetscReal LatinInteriorMost(const LatinInterior *point, PetscInt l)
{
  return LatinLaws[point->structure->law[l]].rigid ? PETSC_INFINITY : point->structure->stiffness[l];
}

/* |r|^2 at u */
static PetscReal LatinInteriorSquare(const LatinInterior *point, PetscInt l)
{
  const PetscInt dim    = point->structure->dim;
  PetscReal      square = 0.0;

  for (PetscInt c = 0; c < dim; c++) square += PetscSqr(point->span[0][dim * l + c]);
  return square;
}

/* Tension of a force density */
static PetscReal LatinInteriorTension(const LatinInterior *point, PetscInt l, PetscReal g)
{
  return g * (LatinStructureKeeps(point->structure, l) ? LatinLawSign(point->structure->law[l]) : PetscSqrtReal(LatinInteriorSquare(point, l)));
}

/* What s and h are compared with */
static PetscReal LatinInteriorUnit(const LatinInterior *point, PetscInt l)
{
  return LatinStructureKeeps(point->structure, l) ? point->length : PetscSqr(PetscSqrtReal(LatinInteriorSquare(point, l)) - point->x[0][l]);
}

/* Links that no free displacement moves. Collective on structure */
static PetscErrorCode LatinInteriorHeld_Private(LatinInterior *point)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;
  const PetscScalar   *free;
  Vec                  local;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &local));
  PetscCall(VecSet(point->at, 1.0));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, point->at, local));
  PetscCall(VecGetArrayRead(local, &free));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    point->held[l] = PETSC_TRUE;
    for (PetscInt i = 0; i < 2 * dim; i++)
      if (PetscRealPart(free[dim * structure->ends[2 * l + i / dim] + i % dim]) != 0.0) point->held[l] = PETSC_FALSE;
  }
  PetscCall(VecRestoreArrayRead(local, &free));
  PetscCall(DMRestoreLocalVector(structure->dm, &local));
  PetscFunctionReturn(0);
}

/* The stretched length of a cable, squared, less L^2; rate: half the derivative by g of this */
static PetscReal LatinInteriorStretch(const LatinInterior *point, PetscInt l, PetscReal *rate)
{
  const PetscReal part = point->g[l] / LatinInteriorMost(point, l), square = LatinInteriorUnit(point, l) / PetscSqr(1.0 - part);

  *rate = part > 0.0 ? square / (LatinInteriorMost(point, l) * (1.0 - part)) : 0.0;
  return square * part * (2.0 - part);
}

/* s, and what g times the rate of the stretched length adds: without it a cable of the law that has no stretch */
static PetscReal LatinInteriorSlack(const LatinInterior *point, PetscInt l)
{
  PetscReal rate;

  (void)LatinInteriorStretch(point, l, &rate);
  return point->s[l] + point->g[l] * rate;
}

/* Tension over length, a mean of the cables */
static PetscReal LatinInteriorMean(const LatinInterior *point)
{
  return point->whole / ((PetscReal)point->structure->links_global * PetscSqr(point->length));
}

/* Spans, strains and h at u. Collective on structure */
static PetscErrorCode LatinInteriorMeasure_Private(LatinInterior *point, Vec u)
{
  const LatinStructure structure = point->structure;

  PetscFunctionBegin;
  PetscCall(LatinTurningMove_Private(structure, u, point->span[0], point->x[0]));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal x = point->x[0][l];
    PetscReal       rate;

    point->h[l] = point->held[l]                      ? LatinInteriorUnit(point, l)
                  : LatinStructureKeeps(structure, l) ? -LatinLawSign(structure->law[l]) * x
                                                      : -0.5 * x * (2.0 * PetscSqrtReal(LatinInteriorSquare(point, l)) - x) + 0.5 * LatinInteriorStretch(point, l, &rate);
  }
  PetscFunctionReturn(0);
}

/* The change of h by the step, to first order */
static PetscReal LatinInteriorChange(const LatinInterior *point, PetscInt l)
{
  const PetscInt dim    = point->structure->dim;
  PetscReal      change = 0.0;

  if (LatinStructureKeeps(point->structure, l)) return -LatinLawSign(point->structure->law[l]) * (point->x[1][l] - point->x[0][l]);
  for (PetscInt c = 0; c < dim; c++) change -= point->span[0][dim * l + c] * (point->span[1][dim * l + c] - point->span[0][dim * l + c]);
  return change;
}

/* The forces without balance of the tensions at u. Collective on snes */
static PetscErrorCode LatinInteriorForces_Private(SNES snes, LatinInterior *point, Vec u)
{
  PetscFunctionBegin;
  PetscCall(LatinTurningResidual_Private(point->structure, point->tension, u, point->r));
  if (snes->vec_rhs) PetscCall(VecAXPY(point->r, -1.0, snes->vec_rhs));
  PetscFunctionReturn(0);
}

/* The first force densities and slacks; *suits: there are cables that turn, of positive length, and loads. Collective on snes */
static PetscErrorCode LatinInteriorStart_Private(SNES snes, LatinInterior *point, Vec u, PetscBool *suits)
{
  const LatinStructure structure = point->structure;
  PetscReal            sum[2] = {0.0, 0.0}, load, least = PETSC_MAX_REAL;

  PetscFunctionBegin;
  PetscCall(LatinInteriorHeld_Private(point));
  PetscCall(LatinInteriorMeasure_Private(point, u));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (LatinStructureKeeps(structure, l)) continue;
    least = PetscMin(least, PetscSqrtReal(LatinInteriorSquare(point, l)) - point->x[0][l]);
    sum[0] += PetscSqrtReal(LatinInteriorUnit(point, l));
    sum[1] += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &least, 1, MPIU_REAL, MPIU_MIN, PetscObjectComm((PetscObject)structure)));
  PetscCall(PetscArrayzero(point->tension, structure->links_local));
  PetscCall(LatinInteriorForces_Private(snes, point, u));
  PetscCall(VecNorm(point->r, NORM_2, &load));
  *suits        = (PetscBool)(least > 0.0 && sum[0] > 0.0 && load > 0.0);
  point->length = sum[0] / PetscMax(sum[1], 1.0);
  point->force  = load / PetscSqrtReal((PetscReal)structure->nodes_global);
  for (PetscInt l = 0; l < structure->links_local && *suits; l++) {
    point->s[l] = PetscMax(point->h[l], LATIN_INTERIOR_FIRST * LatinInteriorUnit(point, l));
    point->g[l] = LatinStructureKeeps(structure, l) ? point->force : PetscMin(0.5 * LatinInteriorMost(point, l), point->force / point->length);
  }
  PetscFunctionReturn(0);
}

/* Is this point near enough? Sets the sums. Collective on snes */
static PetscErrorCode LatinInteriorNear_Private(SNES snes, LatinInterior *point, Vec u, PetscBool *near)
{
  const LatinStructure structure = point->structure;
  PetscReal            sum[2] = {0.0, 0.0}, missed = 0.0, left;

  PetscFunctionBegin;
  PetscCall(LatinInteriorMeasure_Private(point, u));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    sum[0] += point->g[l] * point->s[l];
    sum[1] += point->g[l] * LatinInteriorUnit(point, l);
    missed            = PetscMax(missed, PetscAbsReal(point->s[l] - point->h[l]) / LatinInteriorUnit(point, l));
    point->tension[l] = LatinInteriorTension(point, l, point->g[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &missed, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  PetscCall(LatinInteriorForces_Private(snes, point, u));
  PetscCall(VecNorm(point->r, NORM_2, &left));
  left /= point->force * PetscSqrtReal((PetscReal)structure->nodes_global);
  point->gap   = sum[0];
  point->whole = sum[1];
  *near        = (PetscBool)(sum[0] <= LATIN_INTERIOR_SMALL * sum[1] && missed <= LATIN_INTERIOR_LEFT && left <= LATIN_INTERIOR_LEFT);
  PetscCall(PetscInfo(snes, "Interior point: products of tensions and gaps %g, lengths missed %g, forces without balance %g, relative\n", (double)(sum[0] / sum[1]), (double)missed, (double)left));
  PetscFunctionReturn(0);
}

/* The linear solver of this point, with operators of its stiffness. Collective on snes */
static PetscErrorCode LatinInteriorOperators_Private(SNES snes, LatinInterior *point, KSP *ksp)
{
  const LatinStructure structure  = point->structure;
  const LatinStructure frame      = ((SNES_Latin *)snes->data)->large.frame;
  PetscReal           *penalty    = frame->spring;
  PetscReal           *multiplier = frame->spring + structure->links_local;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal g = PetscMax(point->g[l], LATIN_INTERIOR_FLOOR * LatinInteriorMean(point));

    penalty[l]    = (LatinStructureKeeps(structure, l) ? 0.0 : g) + g / LatinInteriorSlack(point, l) * (LatinStructureKeeps(structure, l) ? 1.0 : LatinInteriorSquare(point, l));
    multiplier[l] = LatinInteriorTension(point, l, g) - penalty[l] * point->x[0][l];
  }
  structure->penalty    = penalty;
  structure->multiplier = multiplier;
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscCall(SNESLatinLargeTangent_Private(snes, snes->vec_sol, ksp));
  structure->penalty = structure->multiplier = NULL;
  PetscFunctionReturn(0);
}

/* Newton's step to g s = mu, beyond first order by the products of the last step; mu = 0: to first order alone. Collective on snes */
static PetscErrorCode LatinInteriorStep_Private(SNES snes, LatinInterior *point, KSP ksp, PetscReal mu)
{
  const LatinStructure structure = point->structure;
  PetscInt             stages;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal target = mu > 0.0 ? mu - point->dg[l] * point->ds[l] : 0.0, g = point->g[l];

    point->add[l]     = (target - g * point->h[l]) / LatinInteriorSlack(point, l);
    point->tension[l] = LatinInteriorTension(point, l, g + point->add[l]);
  }
  PetscCall(LatinInteriorForces_Private(snes, point, snes->vec_sol));
  PetscCall(VecScale(point->r, -1.0));
  PetscCall(KSPSolve(ksp, point->r, point->step));
  PetscCall(KSPGetIterationNumber(ksp, &stages));
  ((SNES_Latin *)snes->data)->newton.stages += stages;
  PetscCall(VecWAXPY(point->at, 1.0, point->step, snes->vec_sol));
  PetscCall(LatinTurningMove_Private(structure, point->at, point->span[1], point->x[1]));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal change = LatinInteriorChange(point, l);
    PetscReal       rate;

    (void)LatinInteriorStretch(point, l, &rate);
    point->dg[l] = point->add[l] - point->g[l] / LatinInteriorSlack(point, l) * change;
    point->ds[l] = change - (point->s[l] - point->h[l]) + rate * point->dg[l];
  }
  PetscFunctionReturn(0);
}

/*
   The part of the step in which the ends of a link move against each other by its length, or by how far they are apart: more, and h, of second order in
   displacements, is far from what the step took it for. The solution is no further away than two such steps
*/
static PetscReal LatinInteriorReach(const LatinInterior *point, PetscInt l)
{
  const PetscInt dim   = point->structure->dim;
  PetscReal      moved = 0.0, reach = PetscMax(LatinInteriorUnit(point, l), LatinInteriorSquare(point, l));

  for (PetscInt c = 0; c < dim; c++) moved += PetscSqr(point->span[1][dim * l + c] - point->span[0][dim * l + c]);
  return moved > reach && !LatinStructureKeeps(point->structure, l) ? PetscSqrtReal(reach / moved) : 1.0;
}

/* The part of the step that leaves force densities and slacks positive, and the products that it leads to. Collective on snes */
static PetscErrorCode LatinInteriorPart_Private(const LatinInterior *point, PetscReal *part, PetscReal *gap)
{
  MPI_Comm comm = PetscObjectComm((PetscObject)point->structure);

  PetscFunctionBegin;
  *part = 1.0;
  *gap  = 0.0;
  for (PetscInt l = 0; l < point->structure->links_local; l++) {
    *part = PetscMin(*part, LatinInteriorReach(point, l));
    if (point->dg[l] > 0.0) *part = PetscMin(*part, LATIN_INTERIOR_BACK * (LatinInteriorMost(point, l) - point->g[l]) / point->dg[l]);
    if (point->ds[l] < 0.0) *part = PetscMin(*part, -LATIN_INTERIOR_BACK * point->s[l] / point->ds[l]);
    if (point->dg[l] < 0.0) *part = PetscMin(*part, -LATIN_INTERIOR_BACK * point->g[l] / point->dg[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, part, 1, MPIU_REAL, MPIU_MIN, comm));
  for (PetscInt l = 0; l < point->structure->links_local; l++) *gap += (point->g[l] + *part * point->dg[l]) * (point->s[l] + *part * point->ds[l]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, gap, 1, MPIU_REAL, MPIU_SUM, comm));
  PetscFunctionReturn(0);
}

/* From the solution vector on; *near: there, with the tensions. Collective on snes */
static PetscErrorCode LatinInteriorRun_Private(SNES snes, LatinInterior *point, PetscBool *near)
{
  const LatinStructure structure = point->structure;
  PetscReal            part      = 1.0, gap, mu;
  PetscReal            rtol;
  KSP                  ksp;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < LATIN_INTERIOR_MOST && part > LATIN_INTERIOR_STILL && ((SNES_Latin *)snes->data)->newton.stages < snes->max_its; k++) {
    PetscCall(LatinInteriorNear_Private(snes, point, snes->vec_sol, near));
    if (*near || PetscIsInfOrNanReal(point->gap)) break;
    PetscCall(LatinInteriorOperators_Private(snes, point, &ksp));
    PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
    PetscCall(KSPSetTolerances(ksp, LATIN_INTERIOR_RTOL, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
    PetscCall(LatinInteriorStep_Private(snes, point, ksp, 0.0));
    PetscCall(LatinInteriorPart_Private(point, &part, &gap));
    mu = PetscMax(PetscPowRealInt(gap / point->gap, 3) * point->gap, LATIN_INTERIOR_AIM * LATIN_INTERIOR_SMALL * point->whole) / (PetscReal)structure->links_global;
    PetscCall(LatinInteriorStep_Private(snes, point, ksp, mu));
    PetscCall(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
    PetscCall(LatinInteriorPart_Private(point, &part, &gap));
    PetscCall(VecAXPY(snes->vec_sol, part, point->step));
    for (PetscInt l = 0; l < structure->links_local; l++) {
      point->g[l] += part * point->dg[l];
      point->s[l] += part * point->ds[l];
    }
  }
  PetscFunctionReturn(0);
}

/* Tensions become multipliers, and their mean over length the penalty; where there is no solution all is what it was. Collective on snes */
static PetscErrorCode LatinInteriorEnd_Private(SNES snes, LatinInterior *point, PetscBool near)
{
  const LatinStructure structure = point->structure;
  const LatinStructure frame     = ((SNES_Latin *)snes->data)->large.frame;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local && near; l++) {
    frame->spring[l]                          = LATIN_INTERIOR_PENALTY * LatinInteriorMean(point);
    frame->spring[structure->links_local + l] = point->held[l] ? 0.0 : LatinInteriorTension(point, l, point->g[l]);
  }
  if (!near) PetscCall(LatinFramePenalty_Private(frame));
  structure->penalty    = frame->spring;
  structure->multiplier = frame->spring + structure->links_local;
  PetscCall(SNESLatinLargeRenew_Private(snes, near ? LATIN_FRAME_TANGENT : LATIN_FRAME_DRAWN));
  PetscFunctionReturn(0);
}

/* Displacements and multipliers near the solution, from the solution vector on; *near: they are. Collective on snes */
PetscErrorCode SNESLatinLargeInterior_Private(SNES snes, PetscBool *near)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  const PetscInt       n = structure->links_local, dim = structure->dim;
  LatinInterior        point = {.structure = structure};
  PetscBool            suits = PETSC_FALSE;
  PetscErrorCode       ierr;
  Vec                  first;

  PetscFunctionBegin;
  *near              = PETSC_FALSE;
  structure->penalty = structure->multiplier = NULL;
  PetscCall(PetscCalloc7(n, &point.g, n, &point.s, n, &point.dg, n, &point.ds, n, &point.h, n, &point.add, n, &point.tension));
  PetscCall(PetscMalloc4(dim * n, &point.span[0], dim * n, &point.span[1], n, &point.x[0], n, &point.x[1]));
  PetscCall(PetscMalloc1(n, &point.held));
  PetscCall(DMGetGlobalVector(structure->dm, &point.at));
  PetscCall(DMGetGlobalVector(structure->dm, &point.step));
  PetscCall(DMGetGlobalVector(structure->dm, &point.r));
  PetscCall(DMGetGlobalVector(structure->dm, &first));
  PetscCall(VecCopy(snes->vec_sol, first));
  structure->springs = PETSC_TRUE;
  ierr               = LatinInteriorStart_Private(snes, &point, snes->vec_sol, &suits);
  if (!ierr && suits) ierr = LatinInteriorRun_Private(snes, &point, near);
  structure->springs = PETSC_FALSE; /* after an error as well: what displacements mean is asked of the structure */
  PetscCall(ierr);
  if (suits) {
    if (!*near) PetscCall(VecCopy(first, snes->vec_sol));
    PetscCall(LatinInteriorEnd_Private(snes, &point, *near));
  }
  structure->penalty    = ((SNES_Latin *)snes->data)->large.frame->spring;
  structure->multiplier = structure->penalty + n;
  PetscCall(DMRestoreGlobalVector(structure->dm, &first));
  PetscCall(DMRestoreGlobalVector(structure->dm, &point.r));
  PetscCall(DMRestoreGlobalVector(structure->dm, &point.step));
  PetscCall(DMRestoreGlobalVector(structure->dm, &point.at));
  PetscCall(PetscFree(point.held));
  PetscCall(PetscFree4(point.span[0], point.span[1], point.x[0], point.x[1]));
  PetscCall(PetscFree7(point.g, point.s, point.dg, point.ds, point.h, point.add, point.tension));
  PetscFunctionReturn(0);
}
