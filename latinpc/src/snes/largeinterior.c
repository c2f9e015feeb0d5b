#include "snes/sneslatinimpl.h"

/*
   Newton's method if links turn by large angles and many change between taut and slack: a primal-dual interior-point method [S. J. Wright 1997] with
   Mehrotra's predictor and corrector and Gondzio's corrections. Unknowns of a unilateral link are its tension t >= 0 and its slack s >= 0, a length. A
   cable of natural length L, stiffness k and vector r from node to node has the length W = L + t / k where it is taut:

     sum of t / W r = load on each node,  s = (W^2 - |r|^2) / (2 L),  t s = mu,

   and mu falls to zero. 1 / k = 0 if it is inextensible. Squares of lengths are smooth at |r| = 0 as well, where nodes of slack cables meet. A contact
   has t n and s = t / k - x instead. The tangent stiffness of a link is smooth, so that no cable alternates between taut and slack; tensions go ahead of
   the displacements as in snes/largenewton.c. 10 to 20 steps suffice for few links and for many, each with new operators of its tangent stiffness and a
   few iterations.

   When steps are small Newton's method takes over and proves the error; with inextensible cables, the method of multipliers (snes/largerigid.c). A
   tangent that is not positive definite before that shows that the loads lead past a limit point: a tower found an equilibrium upside down.
*/

#define LATIN_INTERIOR_MOST    60    /* most steps; grids of tensegrity modules take 12 to 20 */
#define LATIN_INTERIOR_BACK    0.99  /* part of the way to where a tension or a slack would vanish */
#define LATIN_INTERIOR_CENTRE  1e-4  /* least factor on the mean product t s in a step */
#define LATIN_INTERIOR_SPREAD  10.0  /* corrections draw products towards their mean if they differ from it by more than this factor */
#define LATIN_INTERIOR_CORRECT 2     /* most corrections per step; each is a solve with the present operators */
#define LATIN_INTERIOR_ENOUGH  0.9   /* no corrections if a step can be taken to at least this part; 1: a quarter more linear stages */
#define LATIN_INTERIOR_SHORT   1e-6  /* least part of a step; shorter ones make no progress */
#define LATIN_INTERIOR_STEP    1e-4  /* relative step below which Newton's method is tried; 1e-3: it fails on grids */
#define LATIN_INTERIOR_AGAIN   0.1   /* factor on this step after it has failed */
#define LATIN_INTERIOR_SMALL   1e-9  /* sum of the products t s, relative to tensions times lengths, at which the method of multipliers takes over */
#define LATIN_INTERIOR_LEAST   1e-18 /* mean product, relative to the first, below which no step helps: rounding */
#define LATIN_INTERIOR_AIM     0.3   /* least mean product, relative to those: smaller ones, while lengths and balance lag, make systems nearly singular */
#define LATIN_INTERIOR_FIRST   0.1   /* initial slack of inextensible links, relative to their length */
#define LATIN_INTERIOR_NONE    1e-6  /* natural lengths below this part of the drawn length count as zero */
#define LATIN_INTERIOR_FLOOR   1e-6  /* least tension in the linear systems, relative to the mean, for nodes held by slack cables only, */
#define LATIN_INTERIOR_DIGITS  10.0  /* and relative to LATIN_MECHANISM times the largest stiffness times length: less is a mechanism to the factorisation */

/* Arrays are of [links_local], n of [links_local][dim] */
typedef struct {
  LatinStructure structure;
  PetscReal     *n;            /* r / L, or the unit vector where lengths are not squared */
  PetscReal     *length, *far; /* natural length; most relative displacement of the ends in a step */
  PetscReal     *give;         /* 1 / k */
  PetscReal     *part, *bend;  /* L / W and 1 / W, or 1 and 0 */
  PetscReal     *gap;          /* value of s at the present displacements and tensions */
  PetscReal     *t, *s;        /* tension; slack, 0: not unilateral */
  PetscReal     *slope, *tau;  /* stiffness and tension of the link in the tangent stiffness */
  PetscReal     *v, *trial;    /* target of t s; the same with a correction */
  PetscReal     *dt, *ds;      /* changes of t and s in a step */
  PetscBool     *held;         /* between prescribed displacements: no free displacement moves the link */
  Vec            du, r, other; /* step of the displacements; its right-hand side; copy of the step */
  PetscReal      links, whole; /* unilateral links on all ranks; sum of tension times length, or times size if the direction is fixed */
  PetscReal      mean, reach;  /* mean of t s; largest part of the step that moves no link too far */
  PetscReal      force;        /* initial tension */
  PetscBool      rigid;        /* there are inextensible links or contacts */
  PetscBool      unstable;     /* the tangent stiffness of this step is not positive definite */
} LatinInterior;

/* Returns whether link l is unilateral. Not: rigid links that no displacement moves, and cables of natural length zero, which always pull */
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

/* Returns the stiffness dt/dx of link l at the tension t */
static PetscReal LatinInteriorStiffness(const LatinInterior *point, PetscInt l, PetscReal t)
{
  return point->s[l] > 0.0 ? t / (point->s[l] + point->give[l] * t / point->part[l]) : point->slope[l];
}

/* Computes directions and gaps at u, and stiffness and tension of links that are not unilateral. Collective on structure */
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

/* Finds the links that no free displacement moves. Overwrites point->du. Collective on structure */
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

/* Computes the mean of t s after `part` of the step. Collective on structure */
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

/* Computes the changes of the strains by the step du, into ds, and point->reach. Collective on structure */
static PetscErrorCode LatinInteriorStrains_Private(LatinInterior *point)
{
  const LatinStructure structure = point->structure;
  const PetscInt       dim       = structure->dim;
  const PetscScalar   *a;
  Vec                  local;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpen_Private(structure, NULL, point->du, &local, &a)); /* zero at prescribed nodes */
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

/* Computes the unbalanced forces with the tensions after the step, into point->r. Collective on snes */
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

/* Computes the step du, dt, ds to the products t s = v. Collective on snes */
static PetscErrorCode LatinInteriorStep_Private(SNES snes, KSP ksp, const PetscReal v[], LatinInterior *point)
{
  SNES_Latin        *data = (SNES_Latin *)snes->data;
  const PetscInt     n    = point->structure->links_local;
  KSPConvergedReason reason;
  PetscInt           its;
  PC                 pc;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < n; l++) { /* without the part of du */
    point->dt[l] = point->s[l] > 0.0 ? (v[l] - point->t[l] * point->gap[l]) / (point->s[l] + point->give[l] * point->t[l] / point->part[l]) : 0.0;
  }
  PetscCall(LatinInteriorForces_Private(snes, point));
  PetscCall(VecScale(point->r, -1.0));
  PetscCall(KSPSolve(ksp, point->r, point->du));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(KSPGetIterationNumber(ksp, &its));
  data->newton.stages += its;
  if (reason == KSP_DIVERGED_INDEFINITE_MAT) { /* the operators, without compression, still give a descent direction */
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

/* Computes the largest part of the step that leaves tensions and slacks positive and moves no link too far. Collective on structure */
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

/* Corrects the step, drawing products t s towards the target, while this lengthens the step. Collective on snes */
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

/* Computes the step: first to products of zero (predictor), to see how far they can fall, then to their target (corrector). Collective on snes */
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

/* Makes operators and Jacobian of the present stiffnesses and tensions. Collective on snes */
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
  LatinStructurePrescribe(structure, point->tau, NULL, point->slope);
  PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscCall(SNESLatinLargeTangent_Private(snes, snes->vec_sol, ksp));
  LatinStructurePrescribe(structure, NULL, NULL, NULL);
  PetscFunctionReturn(0);
}

/* Computes point->force, the initial tension, from the present tensions and unbalanced forces. Collective on snes */
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
   Initialises tensions and slacks at the displacements in the solution vector. With links that bear tension and compression, t s = force^2 / k of
   elastic links. Without them, or with rigid links, whose products would differ much from the others, all tensions per length and slacks are alike: the
   solution may be far. *suits: there are unilateral links and forces, and lengths are positive. Collective on snes
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
    if (point->give[l] == 0.0) rigid = 1; /* between supports as well: infinite stiffness in Newton's method */
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

/*
   Estimates the relative error of the tensions after `part` of a step: their change times the decrease of the products, as for self-stresses.
   Collective on structure
*/
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

/* Takes steps until one is small, then hands over. Collective on snes */
static PetscErrorCode LatinInteriorRun_Private(SNES snes, LatinInterior *point, PetscBool *done)
{
  SNES_Latin *data  = (SNES_Latin *)snes->data;
  LatinLarge *large = &data->large;
  PetscReal   near = LATIN_INTERIOR_STEP, first = 0.0, part, step, size;
  Vec         u = snes->vec_sol;
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
    if (!k) first = point->mean;
    if (PetscIsInfOrNanReal(size) || part < LATIN_INTERIOR_SHORT || point->mean < LATIN_INTERIOR_LEAST * first) break;
    if (point->unstable && !point->rigid && step > large->near * size) break; /* past a limit point. In small steps the cause is a node of a slackening cable */
    if (point->rigid) {                                                       /* not the displacements: nodes held by slack cables only never settle */
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
   Solves from the displacements in the solution vector. *done: the error is proved; with rigid links, near enough for the method of multipliers, to
   which `tension` and their estimated error are passed. tension: [links_local], or NULL. Collective on snes
*/
PetscErrorCode SNESLatinLargeInterior_Private(SNES snes, PetscReal tension[], PetscBool *done)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  const PetscInt       n         = structure->links_local;
  LatinInterior        point     = {.structure = structure};
  PetscBool            suits     = PETSC_FALSE;

  PetscFunctionBegin;
  *done = PETSC_FALSE;
  PetscCall(PetscCalloc7(structure->dim * n, &point.n, n, &point.length, n, &point.far, n, &point.give, n, &point.part, n, &point.bend, n, &point.gap));
  PetscCall(PetscCalloc7(n, &point.t, n, &point.s, n, &point.v, n, &point.trial, n, &point.dt, n, &point.ds, n, &point.held));
  PetscCall(PetscMalloc2(n + 1, &point.slope, n + 1, &point.tau)); /* not NULL without links either */
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
