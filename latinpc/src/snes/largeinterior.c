#include "snes/sneslatinimpl.h"

/*
   Newton's method where links turn far and many change between taut and slack: a primal-dual interior-point method [S. J. Wright 1997], with
   Mehrotra's predictor and corrector and Gondzio's corrections. A unilateral link has its tension t >= 0 and its slack s >= 0, a length, as
   unknowns of their own. A cable of the natural length L, the stiffness k and the vector r from node to node is W = L + t / k long where it is taut:

     sum of t / W r = load on each node,  s = (W^2 - |r|^2) / (2 L),  t s = mu,

   and mu falls to zero. 1 / k = 0 where it is inextensible. The squares of lengths are smooth where nodes of slack cables meet, |r| = 0. A
   contact has t n and s = t / k - x instead. The tangent stiffness of a link is smooth as well, so that no cable changes
   to and fro, and tensions go ahead of the displacements as in snes/largenewton.c: a link that turns has its strain wrong by the square of the
   angle, which one step corrects. No link holds up the others: 10 to 20 steps do, for few links and for many. In each the operators
   are those of its tangent stiffness, for which a few conjugate gradient iterations do.

   Where steps are small Newton's method takes over, and proves; where there are inextensible cables the method of multipliers does
   (snes/largerigid.c). A tangent that is not positive definite before shows that the loads lead past a limit point: a tower found an equilibrium
   upside down.
*/

#define LATIN_INTERIOR_MOST    60   /* steps: grids of tensegrity modules take 12 to 20 */
#define LATIN_INTERIOR_BACK    0.99 /* of the way to where a tension or a slack would vanish */
#define LATIN_INTERIOR_CENTRE  1e-4 /* the mean product falls by no more than that in a step */
#define LATIN_INTERIOR_SPREAD  10.0 /* products further than that from their mean are drawn to it by corrections */
#define LATIN_INTERIOR_CORRECT 2    /* most corrections; each is a solve with the operators there are */
#define LATIN_INTERIOR_ENOUGH  0.9  /* a step of that part needs none: with 1 linear stages are a quarter more */
#define LATIN_INTERIOR_SHORT   1e-6 /* steps shorter than that part lead nowhere */
#define LATIN_INTERIOR_STEP    1e-4 /* a step relative to the displacements from which on Newton's method is tried; with 1e-3 it fails on grids */
#define LATIN_INTERIOR_AGAIN   0.1  /* where it has failed it is tried again when steps are so much smaller */
#define LATIN_INTERIOR_SMALL   1e-9 /* of tensions times lengths: products from where the method of multipliers changes few cables */
#define LATIN_INTERIOR_AIM     0.3  /* of these products: where lengths and balance follow later no smaller ones are wanted, whose linear systems are next to singular */
#define LATIN_INTERIOR_FIRST   0.1  /* of the length: slacks at first of links that do not stretch */
#define LATIN_INTERIOR_NONE    1e-6 /* of the length as drawn: natural lengths that are none */
#define LATIN_INTERIOR_FLOOR   1e-6 /* of the mean tension: what links bear at least in the linear systems, for nodes that slack cables alone hold, */
#define LATIN_INTERIOR_DIGITS  10.0 /* times LATIN_MECHANISM, and of the largest stiffness times length: a factor takes less for a mechanism */

/* All of [links_local] but n */
typedef struct {
  LatinStructure structure;
  PetscReal     *n;            /* [dim] r / L, or where squares of lengths do not count the direction */
  PetscReal     *length, *far; /* natural length; how far a step may move the ends against each other */
  PetscReal     *give;         /* 1 / k */
  PetscReal     *part, *bend;  /* L / W and 1 / W, or 1 and 0 */
  PetscReal     *gap;          /* what s is to be */
  PetscReal     *t, *s;        /* tension and slack; s = 0: not unilateral */
  PetscReal     *slope, *tau;  /* stiffness and tension of the tangent */
  PetscReal     *v, *trial;    /* what t s is to be; with corrections */
  PetscReal     *dt, *ds;      /* of a step */
  PetscBool     *held;         /* between prescribed displacements */
  Vec            du, r, other; /* of a step, its right-hand side; another step */
  PetscReal      links, whole; /* unilateral links on all ranks; sum of tensions times lengths, one that keeps its direction as long as the structure: contacts or springs that bear all the loads would leave none */
  PetscReal      mean, reach;  /* of t s; part of the step that moves no link too far */
  PetscReal      force;        /* a tension */
  PetscBool      rigid;        /* there are links that do not stretch */
  PetscBool      unstable;     /* the tangent of this step is not positive definite */
} LatinInterior;

/* Is it the law of link l that it bears nothing beyond a strain? A rigid link that nothing moves bears nothing at all, a cable next to no length long always pulls */
static PetscBool LatinInteriorUnilateral(const LatinInterior *point, PetscInt l)
{
  const LatinStructure structure = point->structure;
  const LatinLawType   law       = structure->law[l];
  PetscReal            length    = 0.0;

  if (LatinLaws[law].rigid) return (PetscBool)(structure->penalty || !point->held[l]);
  for (PetscInt c = 0; c < structure->dim; c++) length += PetscSqr(structure->span[structure->dim * l + c]);
  length = PetscSqrtReal(length);
  if (law == LATIN_LAW_CABLE && !LatinStructureKeeps(structure, l) && length - structure->e0[l] <= LATIN_INTERIOR_NONE * length) return PETSC_FALSE;
  return (PetscBool)(law == LATIN_LAW_CABLE || law == LATIN_LAW_COMPRESSION_ONLY);
}

static PetscReal LatinInteriorSign(const LatinInterior *point, PetscInt l)
{
  return LatinInteriorUnilateral(point, l) ? LatinLawSign(point->structure->law[l]) : 1.0;
}

/* How much its tension grows with its strain */
static PetscReal LatinInteriorStiffness(const LatinInterior *point, PetscInt l, PetscReal t)
{
  return point->s[l] > 0.0 ? t / (point->s[l] + point->give[l] * t / point->part[l]) : point->slope[l];
}

/* Directions, gaps, and the tangent of links that are not unilateral, at u. Collective on structure */
static PetscErrorCode LatinInteriorMeasure_Private(LatinInterior *point, Vec u)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;

  PetscFunctionBegin;
  PetscCall(LatinTurningMove_Private(structure, structure->vertex_prescribed, u, point->n, point->gap));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscBool rigid = LatinLaws[structure->law[l]].rigid, keeps = LatinStructureKeeps(structure, l), one = LatinInteriorUnilateral(point, l);
    const PetscReal give = !rigid ? 1.0 / structure->stiffness[l] : structure->penalty ? 1.0 / structure->penalty[l] : 0.0, sign = LatinInteriorSign(point, l);
    const PetscReal x = point->gap[l] + (one && rigid && structure->penalty ? structure->multiplier[l] * give : 0.0);
    PetscReal      *n = point->n + dim * l, size = 0.0, length, whole;

    for (PetscInt c = 0; c < dim; c++) size += PetscSqr(n[c]);
    size             = PetscSqrtReal(size);
    length           = size - x;
    whole            = length + sign * give * point->t[l];
    point->length[l] = length;
    point->far[l]    = keeps ? PETSC_MAX_REAL : PetscMax(size, PetscAbsReal(length));
    point->give[l]   = give;
    point->part[l]   = 1.0;
    point->bend[l]   = 0.0;
    point->gap[l]    = give * point->t[l] - sign * x;
    if (keeps) PetscCall(PetscArraycpy(n, structure->direction + dim * l, dim));
    else if (one && length > 0.0 && whole > 0.0) {
      for (PetscInt c = 0; c < dim; c++) n[c] /= length;
      point->part[l] = length / whole;
      point->bend[l] = 1.0 / whole;
      point->gap[l] *= 0.5 * (whole + size) / length;
    } else (void)LatinUnitVector(dim, n, n);
    if (one) continue;
    point->slope[l] = rigid ? 0.0 : LatinStructureTangent(structure, l, x);
    point->t[l]     = rigid ? 0.0 : LatinStructureTension(structure, NULL, l, x);
  }
  PetscFunctionReturn(0);
}

/* Links that no free displacement moves. Collective on structure */
static PetscErrorCode LatinInteriorHeld_Private(LatinInterior *point)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;
  const PetscScalar   *free;
  Vec                  local;

  PetscFunctionBegin;
  PetscCall(VecSet(point->du, 1.0));
  PetscCall(LatinStructureOpen_Private(structure, NULL, point->du, &local, &free));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    point->held[l] = PETSC_TRUE;
    for (PetscInt i = 0; i < 2 * dim; i++)
      if (PetscRealPart(free[dim * structure->ends[2 * l + i / dim] + i % dim]) != 0.0) point->held[l] = PETSC_FALSE;
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &free));
  PetscFunctionReturn(0);
}

/* The mean product of tension and slack `part` of a step ahead. Collective on structure */
static PetscErrorCode LatinInteriorMean_Private(const LatinInterior *point, PetscReal part, PetscReal *mean)
{
  const LatinStructure structure = point->structure;

  PetscFunctionBegin;
  *mean = 0.0;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (point->s[l] > 0.0) *mean += (point->t[l] + part * point->dt[l]) * (point->s[l] + part * point->ds[l]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, mean, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *mean /= point->links;
  PetscFunctionReturn(0);
}

/* Changes of the strains by the step du, as links stand, into ds, and the part of it that moves the ends of no link too far. Collective on structure */
static PetscErrorCode LatinInteriorStrains_Private(LatinInterior *point)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;
  const PetscScalar   *a;
  Vec                  local;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, NULL, point->du, &local, &a)); /* no change where prescribed */
  point->reach = 1.0;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal moved = 0.0;

    point->ds[l] = 0.0;
    for (PetscInt c = 0; c < dim; c++) {
      const PetscReal d = PetscRealPart(a[dim * structure->ends[2 * l + 1] + c] - a[dim * structure->ends[2 * l] + c]);

      point->ds[l] += point->n[dim * l + c] * d;
      moved += d * d;
    }
    point->ds[l] *= LatinInteriorSign(point, l);
    if (PetscSqrtReal(moved) > point->far[l]) point->reach = PetscMin(point->reach, point->far[l] / PetscSqrtReal(moved));
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscFunctionReturn(0);
}

/* Unbalanced forces of the tensions a step ahead. Collective on snes */
static PetscErrorCode LatinInteriorForces_Private(SNES snes, const LatinInterior *point)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;
  PetscReal           *f;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  for (PetscInt i = 0; i < dim * structure->links_local; i++) {
    const PetscInt l = i / dim;

    f[i] = LatinInteriorSign(point, l) * point->part[l] * (point->t[l] + point->part[l] * point->dt[l]) * point->n[i];
  }
  PetscCall(LatinTurningForces_Private(structure, f, snes->vec_sol, structure->load, point->r));
  PetscCall(DMRestoreWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  if (snes->vec_rhs) PetscCall(VecAXPY(point->r, -1.0, snes->vec_rhs));
  PetscFunctionReturn(0);
}

/* The step to products v: du, dt, ds. Collective on snes */
static PetscErrorCode LatinInteriorStep_Private(SNES snes, KSP ksp, const PetscReal v[], LatinInterior *point)
{
  SNES_Latin        *data = (SNES_Latin *)snes->data;
  const PetscInt     n    = point->structure->links_local;
  KSPConvergedReason reason;
  PetscInt           its;
  PC                 pc;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < n; l++) { /* dt without the part of du */
    point->dt[l] = point->s[l] > 0.0 ? (v[l] - point->t[l] * point->gap[l]) / (point->s[l] + point->give[l] * point->t[l] / point->part[l]) : 0.0;
  }
  PetscCall(LatinInteriorForces_Private(snes, point));
  PetscCall(VecScale(point->r, -1.0));
  PetscCall(KSPSolve(ksp, point->r, point->du));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(KSPGetIterationNumber(ksp, &its));
  data->newton.stages += its;
  if (reason == KSP_DIVERGED_INDEFINITE_MAT) { /* downhill all the same: the operators leave compression out */
    point->unstable = PETSC_TRUE;
    PetscCall(KSPGetPC(ksp, &pc));
    PetscCall(PCApply(pc, point->r, point->du));
    data->newton.stages++;
  }
  PetscCall(LatinInteriorStrains_Private(point));
  for (PetscInt l = 0; l < n; l++) {
    const PetscReal dx = point->ds[l];

    point->dt[l] += LatinInteriorStiffness(point, l, point->t[l]) * dx;
    point->ds[l] = point->s[l] > 0.0 ? point->give[l] / point->part[l] * point->dt[l] - dx - point->s[l] + point->gap[l] : 0.0;
  }
  PetscFunctionReturn(0);
}

/* How much of a step leaves tensions and slacks positive, and moves no link too far. Collective on structure */
static PetscErrorCode LatinInteriorPart_Private(const LatinInterior *point, PetscReal *part)
{
  PetscFunctionBegin;
  *part = point->reach;
  for (PetscInt l = 0; l < point->structure->links_local; l++) {
    if (point->s[l] == 0.0) continue;
    if (point->dt[l] < 0.0) *part = PetscMin(*part, -LATIN_INTERIOR_BACK * point->t[l] / point->dt[l]);
    if (point->ds[l] < 0.0) *part = PetscMin(*part, -LATIN_INTERIOR_BACK * point->s[l] / point->ds[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, part, 1, MPIU_REAL, MPIU_MIN, PetscObjectComm((PetscObject)point->structure)));
  PetscFunctionReturn(0);
}

/* Corrections draw products to their mean, as long as the step becomes longer. Collective on snes */
static PetscErrorCode LatinInteriorCorrect_Private(SNES snes, KSP ksp, PetscReal target, LatinInterior *point, PetscReal *part)
{
  const LatinStructure structure = point->structure;
  const PetscInt       n         = structure->links_local;
  PetscReal           *dt, *ds, longer;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, n, MPIU_REAL, &dt));
  PetscCall(DMGetWorkArray(structure->dm, n, MPIU_REAL, &ds));
  for (PetscInt k = 0; k < LATIN_INTERIOR_CORRECT && *part < LATIN_INTERIOR_ENOUGH; k++) {
    const PetscReal at = PetscMin(1.0, 1.5 * *part + 0.3);

    for (PetscInt l = 0; l < n; l++) {
      const PetscReal product = (point->t[l] + at * point->dt[l]) * (point->s[l] + at * point->ds[l]);

      point->trial[l] = point->v[l];
      if (product * LATIN_INTERIOR_SPREAD < target) point->trial[l] += target / LATIN_INTERIOR_SPREAD - product;
      else if (product > LATIN_INTERIOR_SPREAD * target) point->trial[l] += LATIN_INTERIOR_SPREAD * PetscMax(target - product / LATIN_INTERIOR_SPREAD, -target);
    }
    PetscCall(PetscArraycpy(dt, point->dt, n));
    PetscCall(PetscArraycpy(ds, point->ds, n));
    PetscCall(VecCopy(point->du, point->other));
    PetscCall(LatinInteriorStep_Private(snes, ksp, point->trial, point));
    PetscCall(LatinInteriorPart_Private(point, &longer));
    if (longer <= 1.01 * *part) {
      PetscCall(PetscArraycpy(point->dt, dt, n));
      PetscCall(PetscArraycpy(point->ds, ds, n));
      PetscCall(VecCopy(point->other, point->du));
      break;
    }
    PetscCall(PetscArraycpy(point->v, point->trial, n));
    *part = longer;
  }
  PetscCall(DMRestoreWorkArray(structure->dm, n, MPIU_REAL, &ds));
  PetscCall(DMRestoreWorkArray(structure->dm, n, MPIU_REAL, &dt));
  PetscFunctionReturn(0);
}

/* The step: to products of zero, which shows how far these can fall, then to what they are to be. Collective on snes */
static PetscErrorCode LatinInteriorDirection_Private(SNES snes, KSP ksp, LatinInterior *point, PetscReal *part)
{
  PetscReal ahead, target;

  PetscFunctionBegin;
  point->unstable = PETSC_FALSE;
  PetscCall(LatinInteriorMean_Private(point, 0.0, &point->mean));
  PetscCall(PetscArrayzero(point->v, point->structure->links_local));
  PetscCall(LatinInteriorStep_Private(snes, ksp, point->v, point));
  PetscCall(LatinInteriorPart_Private(point, part));
  if (!(point->mean > 0.0)) PetscFunctionReturn(0);
  PetscCall(LatinInteriorMean_Private(point, *part, &ahead));
  ahead  = PetscMin(1.0, ahead / point->mean);
  target = point->mean * PetscMax(ahead * ahead * ahead, LATIN_INTERIOR_CENTRE);
  if (point->rigid) target = PetscMax(target, LATIN_INTERIOR_AIM * LATIN_INTERIOR_SMALL * point->whole / point->links);
  for (PetscInt l = 0; l < point->structure->links_local; l++) point->v[l] = target - PetscSqr(*part) * point->dt[l] * point->ds[l];
  PetscCall(LatinInteriorStep_Private(snes, ksp, point->v, point));
  PetscCall(LatinInteriorPart_Private(point, part));
  PetscCall(LatinInteriorCorrect_Private(snes, ksp, target, point, part));
  PetscFunctionReturn(0);
}

/* Operators and Jacobian of stiffnesses and tensions of the tangent. Collective on snes */
static PetscErrorCode LatinInteriorTangent_Private(SNES snes, LatinInterior *point, KSP *ksp)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;
  PetscReal            sum[2] = {0.0, 0.0}, most = 0.0, least;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    sum[1] += PetscAbsReal(point->t[l]) * (LatinStructureKeeps(structure, l) ? ((SNES_Latin *)snes->data)->large.size : point->length[l]);
    if (point->s[l] == 0.0) continue;
    most = PetscMax(most, LatinInteriorStiffness(point, l, point->t[l]) * (LatinStructureKeeps(structure, l) ? 0.0 : point->length[l]));
    sum[0] += point->t[l];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)snes)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)snes)));
  point->whole = sum[1];
  least        = PetscMax(LATIN_INTERIOR_FLOOR * sum[0] / point->links, LATIN_INTERIOR_DIGITS * LATIN_MECHANISM * most);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal t = PetscMax(point->t[l], least), sign = LatinInteriorSign(point, l);
    PetscReal       square = 0.0;

    if (point->s[l] == 0.0) continue;
    for (PetscInt c = 0; c < dim; c++) square += PetscSqr(point->n[dim * l + c]);
    point->slope[l] = square * PetscSqr(point->part[l]) * LatinInteriorStiffness(point, l, t) + sign * point->bend[l] * t;
    point->tau[l]   = sign * point->part[l] * t * PetscSqrtReal(square);
  }
  structure->slope = point->slope;
  structure->ahead = point->tau;
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscCall(SNESLatinLargeTangent_Private(snes, snes->vec_sol, ksp));
  structure->slope = structure->ahead = NULL;
  PetscFunctionReturn(0);
}

/* A tension to start with: of those that there are, and of the loads that they leave on a node. Collective on snes */
static PetscErrorCode LatinInteriorForce_Private(SNES snes, LatinInterior *point)
{
  const LatinStructure structure = point->structure;
  PetscReal            left, sum = 0.0;

  PetscFunctionBegin;
  PetscCall(LatinTurningTensions_Private(structure, NULL, snes->vec_sol, point->tau));
  PetscCall(LatinTurningResidual_Private(structure, point->tau, snes->vec_sol, point->r));
  if (snes->vec_rhs) PetscCall(VecAXPY(point->r, -1.0, snes->vec_rhs));
  PetscCall(VecNorm(point->r, NORM_2, &left));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (LatinInteriorUnilateral(point, l)) sum += PetscSqr(point->tau[l]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)snes)));
  point->force = PetscSqrtReal(sum / PetscMax(point->links, 1.0) + left * left / (PetscReal)structure->nodes_global);
  PetscFunctionReturn(0);
}

/*
   Tensions and slacks at the displacements in the solution vector. Beside links that bear tension and compression, t s = force^2 / k of elastic ones.
   Without such links force densities and slacks are alike: the start may be far, with few taut links or none. So they are where some links do not
   stretch, whose products t s would be far from those of others. *suits: there are unilateral links and forces, and lengths are positive. Collective on snes
*/
static PetscErrorCode LatinInteriorStart_Private(SNES snes, LatinInterior *point, PetscBool *suits)
{
  const LatinStructure structure = point->structure;
  PetscReal            sum[3] = {0.0, 0.0, 0.0}, least = PETSC_MAX_REAL;
  PetscMPIInt          rigid = 0;
  PetscBool            both  = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinPathStruts_Private(structure, &both, NULL));
  PetscCall(LatinInteriorHeld_Private(point));
  PetscCall(LatinInteriorMeasure_Private(point, snes->vec_sol));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (LatinInteriorUnilateral(point, l)) sum[0] += 1.0;
    if (point->give[l] == 0.0) rigid = 1; /* between supports as well: Newton's method has no stiffness of it */
    if (LatinStructureKeeps(structure, l)) continue;
    least = PetscMin(least, point->length[l]);
    sum[1] += point->length[l];
    sum[2] += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &least, 1, MPIU_REAL, MPIU_MIN, PetscObjectComm((PetscObject)structure)));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &rigid, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  point->links = sum[0];
  point->rigid = (PetscBool)rigid;
  PetscCall(LatinInteriorForce_Private(snes, point));
  *suits = (PetscBool)(point->links > 0.0 && point->force > 0.0 && (!point->rigid || (least > 0.0 && sum[2] > 0.0)));
  for (PetscInt l = 0; l < structure->links_local && *suits; l++) {
    const PetscReal mean = sum[1] / PetscMax(sum[2], 1.0), ratio = LatinStructureKeeps(structure, l) ? 1.0 : point->length[l] / mean;

    if (!LatinInteriorUnilateral(point, l)) continue;
    if (point->rigid || !(both || structure->penalty)) {
      point->t[l] = point->force * ratio;
      point->s[l] = PetscMax(point->gap[l], LATIN_INTERIOR_FIRST * ratio * mean);
    } else {
      const PetscReal y = point->gap[l] / point->give[l], more = 0.5 * (PetscAbsReal(y) + PetscSqrtReal(y * y + 4.0 * PetscSqr(point->force)));

      point->t[l] = y < 0.0 ? more : PetscSqr(point->force) / more;
      point->s[l] = point->give[l] * (y < 0.0 ? PetscSqr(point->force) / more : more);
    }
  }
  PetscFunctionReturn(0);
}

/* The error of the tensions after `part` of a step: what it changed, times the fall of the products, which the tensions of self-stresses follow. Collective on structure */
static PetscErrorCode LatinInteriorLeft_Private(LatinInterior *point, PetscReal part, PetscReal *left)
{
  const PetscReal before = point->mean;
  PetscReal       sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  PetscCall(LatinInteriorMean_Private(point, 0.0, &point->mean));
  for (PetscInt l = 0; l < point->structure->links_local; l++) {
    sum[0] += PetscSqr(part * point->dt[l]);
    sum[1] += PetscSqr(point->t[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)point->structure)));
  *left = PetscSqrtReal(LatinRatio(sum[0], sum[1])) * LatinRatio(point->mean, before);
  PetscFunctionReturn(0);
}

/* Steps until one is small. Collective on snes */
static PetscErrorCode LatinInteriorRun_Private(SNES snes, LatinInterior *point, PetscBool *done)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscReal   near  = LATIN_INTERIOR_STEP, part, step, size;
  Vec         u     = snes->vec_sol;
  KSP         ksp;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < LATIN_INTERIOR_MOST && !*done && SNESLatinStagesLeft(snes) > 0; k++) {
    PetscCall(LatinInteriorMeasure_Private(point, u));
    PetscCall(LatinInteriorTangent_Private(snes, point, &ksp));
    PetscCall(LatinInteriorDirection_Private(snes, ksp, point, &part));
    PetscCall(VecAXPY(u, part, point->du));
    for (PetscInt l = 0; l < point->structure->links_local; l++) {
      if (point->s[l] == 0.0) point->tau[l] += part * (point->t[l] + point->dt[l] - point->tau[l]);
      point->t[l] += part * point->dt[l];
      point->s[l] += part * point->ds[l];
    }
    PetscCall(VecNorm(point->du, NORM_2, &step));
    PetscCall(VecNorm(u, NORM_2, &size));
    PetscCall(PetscInfo(snes, "Interior point, step %" PetscInt_FMT ": %g of %g, displacements %g; product of tension and slack %g%s\n", k, (double)part, (double)step, (double)size, (double)point->mean, point->unstable ? ", unstable" : ""));
    if (PetscIsInfOrNanReal(size) || part < LATIN_INTERIOR_SHORT) break;
    if (point->unstable && !point->rigid && step > large->near * size) break; /* on its way past a limit point; where steps are small it is the node of a cable that slackens */
    if (point->rigid) {                                                       /* displacements of nodes that slack cables alone hold never settle */
      PetscCall(LatinInteriorLeft_Private(point, part, &data->estimate.tensions));
      *done = (PetscBool)(part >= LATIN_INTERIOR_ENOUGH && point->mean * point->links <= LATIN_INTERIOR_SMALL * point->whole);
    }
    if (point->rigid || step > near * size) continue;
    PetscCall(SNESLatinLargeFinish_Private(snes, PETSC_FALSE, PETSC_TRUE, done));
    near *= LATIN_INTERIOR_AGAIN;
  }
  PetscFunctionReturn(0);
}

/*
   From the displacements in the solution vector to the solution, whose error is proved: then *done. With links that do not stretch to where
   the method of multipliers ends it from: their tensions then are in `tension`, the error of these is the estimated one. Collective on snes
*/
PetscErrorCode SNESLatinLargeInterior_Private(SNES snes, PetscReal tension[], PetscBool *done)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->turns;
  const PetscInt       n         = structure->links_local;
  LatinInterior        point     = {.structure = structure};
  PetscBool            suits     = PETSC_FALSE;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(PetscCalloc7(structure->dim * n, &point.n, n, &point.length, n, &point.far, n, &point.give, n, &point.part, n, &point.bend, n, &point.gap));
  PetscCall(PetscCalloc7(n, &point.t, n, &point.s, n, &point.v, n, &point.trial, n, &point.dt, n, &point.ds, n, &point.held));
  PetscCall(PetscMalloc2(n + 1, &point.slope, n + 1, &point.tau)); /* never NULL */
  PetscCall(VecDuplicate(snes->vec_sol, &point.du));
  PetscCall(VecDuplicate(snes->vec_sol, &point.r));
  PetscCall(VecDuplicate(snes->vec_sol, &point.other));
  PetscCall(LatinInteriorStart_Private(snes, &point, &suits));
  if (suits) PetscCall(LatinInteriorRun_Private(snes, &point, done));
  for (PetscInt l = 0; l < n && tension; l++) tension[l] = LatinInteriorSign(&point, l) * point.t[l];
  PetscCall(VecDestroy(&point.du));
  PetscCall(VecDestroy(&point.r));
  PetscCall(VecDestroy(&point.other));
  PetscCall(PetscFree2(point.slope, point.tau));
  PetscCall(PetscFree7(point.t, point.s, point.v, point.trial, point.dt, point.ds, point.held));
  PetscCall(PetscFree7(point.n, point.length, point.far, point.give, point.part, point.bend, point.gap));
  PetscFunctionReturn(0);
}
