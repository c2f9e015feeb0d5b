#include "error/latinerror.h"

/*
   Do the loads exceed the limit load? Statically admissible tensions balance the loads, B^t tau = F, between the bounds of the laws:
   cables only pull, and a link that yields bears no more than its yield tension. On a displacement d they do the work tau.B d = F.d, so that
   F.d is at most D(d), the sum over links of the elongation times the bound on that side (upper bound theorem of limit analysis). A link
   without a bound there must not stretch: it resists at any amplitude. By the lemma of J. Farkas admissible tensions exist if and only if
   F.d <= D(d) for all such d. If F.d > D(d) there is no equilibrium: the structure collapses along d. Without links that yield D = 0, and
   d is a mechanism. Stiffnesses, gaps and prestress do not matter.

   d minimises |B d|^2 / 2 + D(d) - F.d: it is the one nearest to the displacement of the reference structure, whose links are all bars of
   one stiffness. d = 0 if and only if there is an equilibrium. The interior-point method of S. Mehrotra computes d, with two unknowns at each
   bound of a link: the distance y > 0 of its tension from the bound, and the elongation s > 0 that it has there. The number of steps hardly
   depends on the size of the structure; a step takes one factorisation of B^t (1 + W) B and two solves. Tensions are regularised
   [M. P. Friedlander, D. Orban]: this bounds W and includes bars.

   By rounding, d stretches the links that resist by some v. An equilibrium has F.d <= D(d) + |tau| |v|, so that its tensions are at least
   (F.d - D(d)) / |v| times those of the reference structure. Beyond LATIN_COLLAPSE_TENSION this counts as a proof.
*/

#define LATIN_COLLAPSE_STEPS                60                            /* most steps */
#define LATIN_COLLAPSE_REGULARISATION       LatinByPrecision(1e-10, 1e-4) /* initial compliance of a link that resists, relative to the reference structure; at 100 times as much some large networks do not converge */
#define LATIN_COLLAPSE_REGULARISATION_GROWS 100.0                         /* times that after a failed solve: the operator is singular to rounding */
#define LATIN_COLLAPSE_START                10.0                          /* initial tensions and elongations at bounds, relative to the reference tensions: steps are short with smaller ones */
#define LATIN_COLLAPSE_LENGTH               0.995                         /* step length, relative to the longest step with all s and y >= 0 */
#define LATIN_COLLAPSE_ROUNDING             8.0                           /* times eps, of the largest displacement: rounding of an elongation */

/* A bound on the tension of a link: the lower one, side 0, or the upper one */
typedef struct {
  PetscReal bound; /* infinite where the link resists */
  PetscReal y, s;  /* distance of the tension from it; elongation while the tension is there: one of both vanishes */
  PetscReal ds, rhs;
} LatinCollapseSide;

typedef struct {
  LatinStructure structure;
  KSP            ksp;
  Mat            A;              /* B^t (1 + W) B */
  Vec            f, d;           /* loads, scaled to reference tensions of norm 1; displacements */
  Vec            r, dd;          /* unbalance; step of d */
  PetscInt       n;              /* links here */
  PetscReal      count;          /* finite bounds, on all ranks */
  PetscReal      links;          /* all links, on all ranks */
  PetscReal      scale;          /* of the loads */
  PetscReal      regularisation; /* compliance of a link that resists */
  PetscReal      unbalance;      /* relative to the initial one */
  PetscInt       stages;
  PetscReal     *x, *dx;        /* [n] elongations, their steps */
  PetscReal     *t, *dt;        /* [n] tensions */
  PetscReal     *w, *rhs;       /* [n] weights of links; work */
  LatinCollapseSide (*side)[2]; /* [n] */
} LatinCollapse;

static inline PetscReal LatinCollapseSign(PetscInt side)
{
  return side ? -1.0 : 1.0;
}

/* The side of a link, NULL if it has no bound there, or if its tension is constant */
static inline LatinCollapseSide *LatinCollapseAt(const LatinCollapse *c, PetscInt l, PetscInt side)
{
  return PetscIsInfReal(c->side[l][side].bound) || c->side[l][0].bound == c->side[l][1].bound ? NULL : &c->side[l][side];
}

/* Bounds on the tensions, less the least tensions t between them: links that always pull load the structure. Their number. Collective */
static PetscErrorCode LatinCollapseBounds_Private(LatinCollapse *c)
{
  PetscReal sum[2] = {0.0, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal bound[2];

    LatinLinkBounds(c->structure, l, bound);
    c->t[l] = PetscMin(PetscMax(0.0, bound[0]), bound[1]);
    for (PetscInt i = 0; i < 2; i++) c->side[l][i].bound = bound[i] - c->t[l];
    for (PetscInt i = 0; i < 2; i++) sum[0] += LatinCollapseAt(c, l, i) ? 1.0 : 0.0;
    sum[1] += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  c->count = sum[0];
  c->links = sum[1];
  PetscFunctionReturn(0);
}

/* dd = A^-1 b. Collective */
static PetscErrorCode LatinCollapseSolve_Private(LatinCollapse *c, Vec b, PetscBool *failed)
{
  KSPConvergedReason reason;
  PetscInt           stages;

  PetscFunctionBegin;
  PetscCall(KSPSolve(c->ksp, b, c->dd));
  PetscCall(KSPGetConvergedReason(c->ksp, &reason));
  PetscCall(KSPGetIterationNumber(c->ksp, &stages));
  c->stages += stages;
  if (reason < 0) *failed = PETSC_TRUE;
  PetscFunctionReturn(0);
}

/* Assembles A = B^t (1 + W) B; the next solve factors it. Collective */
static PetscErrorCode LatinCollapseOperator_Private(LatinCollapse *c)
{
  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) c->rhs[l] = 1.0 + c->w[l];
  PetscCall(LatinTangentGive_Private(c->structure, c->rhs, c->A));
  PetscCall(KSPSetOperators(c->ksp, c->A, c->A));
  PetscFunctionReturn(0);
}

/* Initial point: scales the loads f, and the bounds with them, to tensions of norm 1 in the reference structure; sets t, s and y. Collective */
static PetscErrorCode LatinCollapseStart_Private(LatinCollapse *c, PetscBool *failed)
{
  PetscScalar work;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(c->w, c->n));
  PetscCall(LatinCollapseOperator_Private(c));
  PetscCall(LatinCollapseSolve_Private(c, c->f, failed));
  PetscCall(VecDot(c->f, c->dd, &work));
  if (!(PetscRealPart(work) > 0.0)) *failed = PETSC_TRUE;
  if (*failed) PetscFunctionReturn(0);
  c->scale = 1.0 / PetscSqrtReal(PetscRealPart(work));
  PetscCall(VecScale(c->f, c->scale));
  c->unbalance = 1.0;
  for (PetscInt l = 0; l < c->n; l++) {
    LatinCollapseSide *lower, *upper;
    PetscReal          inside = LATIN_COLLAPSE_START / PetscSqrtReal(c->links);

    for (PetscInt i = 0; i < 2; i++) c->side[l][i].bound *= c->scale;
    inside  = PetscMin(inside, 0.5 * (c->side[l][1].bound - c->side[l][0].bound));
    c->t[l] = PetscMin(PetscMax(0.0, c->side[l][0].bound + inside), c->side[l][1].bound - inside);
    lower   = LatinCollapseAt(c, l, 0);
    upper   = LatinCollapseAt(c, l, 1);
    if (lower) lower->y = c->t[l] - lower->bound;
    if (upper) upper->y = upper->bound - c->t[l];
    for (PetscInt i = 0; i < 2; i++) c->side[l][i].s = LatinCollapseAt(c, l, i) ? PetscSqr(LATIN_COLLAPSE_START) / (c->links * c->side[l][i].y) : 0.0;
  }
  PetscFunctionReturn(0);
}

/* Predictor step, towards complementarity s y = 0; corrector step (`corrects`), towards s y = mean, with the second-order term ds dy of the predictor. Collective */
static PetscErrorCode LatinCollapseStep_Private(LatinCollapse *c, PetscBool corrects, PetscReal mean, PetscBool *failed)
{
  PetscFunctionBegin;
  /* dt = W (x - sum of sign rhs / y + dx); W dx is added after the solve */
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal x = c->x[l];

    for (PetscInt i = 0; i < 2; i++) {
      LatinCollapseSide *at = LatinCollapseAt(c, l, i);

      if (!at) continue;
      at->rhs = corrects ? LatinCollapseSign(i) * at->ds * c->dt[l] - mean : 0.0;
      x -= LatinCollapseSign(i) * at->rhs / at->y;
    }
    c->dx[l] = c->w[l] * x;
  }
  PetscCall(PetscArraycpy(c->dt, c->dx, c->n));
  for (PetscInt l = 0; l < c->n; l++) c->dx[l] += c->x[l] + c->t[l];
  PetscCall(LatinStructureForces_Private(c->structure, c->dx, c->d, NULL, c->r));
  PetscCall(VecAYPX(c->r, -1.0, c->f));
  PetscCall(LatinCollapseSolve_Private(c, c->r, failed));
  PetscCall(LatinStructureElongations_Private(c->structure, NULL, c->dd, c->dx));
  for (PetscInt l = 0; l < c->n; l++) {
    c->dt[l] += c->w[l] * c->dx[l];
    for (PetscInt i = 0; i < 2; i++) {
      LatinCollapseSide *at = LatinCollapseAt(c, l, i);

      if (at) at->ds = -at->s - (at->rhs + LatinCollapseSign(i) * at->s * c->dt[l]) / at->y;
    }
  }
  PetscFunctionReturn(0);
}

/* Step length: `back` times the longest step that keeps all s and y >= 0, at most 1; mean complementarity product after the step. Collective */
static PetscErrorCode LatinCollapseLength_Private(LatinCollapse *c, PetscReal back, PetscReal *length, PetscReal *mean)
{
  const MPI_Comm comm = PetscObjectComm((PetscObject)c->structure);
  PetscReal      sum  = 0.0;

  PetscFunctionBegin;
  *length = 1.0 / back;
  for (PetscInt k = 0; k < 2 * c->n; k++) {
    const LatinCollapseSide *at = LatinCollapseAt(c, k / 2, k % 2);
    const PetscReal          dy = LatinCollapseSign(k % 2) * c->dt[k / 2];

    if (at && at->ds < 0.0) *length = PetscMin(*length, -at->s / at->ds);
    if (at && dy < 0.0) *length = PetscMin(*length, -at->y / dy);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, length, 1, MPIU_REAL, MPIU_MIN, comm));
  *length *= back;
  for (PetscInt k = 0; k < 2 * c->n; k++) {
    const LatinCollapseSide *at = LatinCollapseAt(c, k / 2, k % 2);

    if (at) sum += (at->s + *length * at->ds) * (at->y + *length * LatinCollapseSign(k % 2) * c->dt[k / 2]);
  }
  PetscCall(MPIU_Allreduce(&sum, mean, 1, MPIU_REAL, MPIU_SUM, comm));
  *mean /= c->count;
  PetscFunctionReturn(0);
}

/* An interior-point step: weights W, predictor, corrector; updates d, t, s, y, x and the mean complementarity product. Collective */
static PetscErrorCode LatinCollapseIterate_Private(LatinCollapse *c, PetscReal *mean, PetscBool *failed)
{
  PetscReal length, after;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal give = c->regularisation;

    for (PetscInt i = 0; i < 2; i++) give += LatinCollapseAt(c, l, i) ? c->side[l][i].s / c->side[l][i].y : 0.0;
    c->w[l] = c->side[l][0].bound == c->side[l][1].bound ? 0.0 : 1.0 / give; /* a tension that is constant */
  }
  PetscCall(LatinCollapseOperator_Private(c));
  PetscCall(LatinCollapseStep_Private(c, PETSC_FALSE, 0.0, failed));
  if (*failed) PetscFunctionReturn(0);
  PetscCall(LatinCollapseLength_Private(c, 1.0, &length, &after));
  PetscCall(LatinCollapseStep_Private(c, PETSC_TRUE, *mean * PetscPowRealInt(after / *mean, 3), failed));
  if (*failed) PetscFunctionReturn(0);
  PetscCall(LatinCollapseLength_Private(c, LATIN_COLLAPSE_LENGTH, &length, mean));
  PetscCall(VecAXPY(c->d, length, c->dd));
  for (PetscInt l = 0; l < c->n; l++) {
    c->t[l] += length * c->dt[l];
    for (PetscInt i = 0; i < 2; i++) {
      LatinCollapseSide *at = LatinCollapseAt(c, l, i);

      if (!at) continue;
      at->s += length * at->ds;
      at->y += length * LatinCollapseSign(i) * c->dt[l];
    }
  }
  c->unbalance *= 1.0 - length;
  PetscCall(LatinStructureElongations_Private(c->structure, NULL, c->d, c->x));
  PetscFunctionReturn(0);
}

/* *proof: the loads do more work on d than the bounds of the tensions allow; *held: d = 0 to tolerance, there is an equilibrium. Collective */
static PetscErrorCode LatinCollapseProof_Private(LatinCollapse *c, PetscInt step, PetscBool *proof, PetscBool *held)
{
  PetscReal   sum[4] = {0.0, 0.0, 0.0, 0.0}, beyond, most; /* squared elongations: those that links resist, all; work of the tensions at their bounds, what is too little beside it or its rounding */
  PetscScalar push;

  PetscFunctionBegin;
  PetscCall(VecNorm(c->d, NORM_INFINITY, &most));
  for (PetscInt l = 0; l < c->n; l++) {
    const PetscReal bound = c->side[l][c->x[l] > 0.0].bound;

    sum[1] += PetscSqr(c->x[l]);
    if (PetscIsInfReal(bound)) sum[0] += PetscSqr(c->x[l]);
    else {
      sum[2] += bound * c->x[l];
      sum[3] += PetscAbsReal(bound) * (LATIN_COLLAPSE_HELD * PetscAbsReal(c->x[l]) + LATIN_COLLAPSE_ROUNDING * PETSC_MACHINE_EPSILON * most);
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  PetscCall(VecDot(c->f, c->d, &push));
  beyond = PetscRealPart(push) - sum[2];
  *held  = (PetscBool)(c->unbalance <= LATIN_COLLAPSE_HELD && PetscSqrtReal(sum[1]) <= LATIN_COLLAPSE_HELD);
  *proof = (PetscBool)(beyond > sum[3] && LatinCollapseProves(beyond, 0.0, sum[0], sum[1]));
  PetscCall(PetscInfo(c->structure, "step %" PetscInt_FMT ": work of the loads %g, of links that yield %g, tensions of others at least %g times those of bars\n", step, (double)PetscRealPart(push), (double)sum[2],
                      (double)(sum[0] > 0.0 ? beyond / PetscSqrtReal(sum[0]) : INFINITY)));
  PetscFunctionReturn(0);
}

/* Interior-point steps to a proof or an equilibrium. bears: NULL, or [n], set to statically admissible tensions if *held. Collective */
static PetscErrorCode LatinCollapseRun_Private(LatinCollapse *c, PetscReal bears[], PetscInt *steps, PetscBool *held, LatinEquilibrium *found)
{
  PetscBool failed = PETSC_FALSE, proof = PETSC_FALSE;
  PetscReal mean;

  PetscFunctionBegin;
  c->regularisation = LATIN_COLLAPSE_REGULARISATION;
  PetscCall(LatinCollapseStart_Private(c, &failed));
  mean = PetscSqr(LATIN_COLLAPSE_START) / c->links;
  for (*steps = 0; *steps < LATIN_COLLAPSE_STEPS && !failed && !proof && !*held;) {
    PetscCall(LatinCollapseIterate_Private(c, &mean, &failed));
    ++*steps;
    if (!failed) PetscCall(LatinCollapseProof_Private(c, *steps, &proof, held));
    else failed = (PetscBool)((c->regularisation *= LATIN_COLLAPSE_REGULARISATION_GROWS) >= 1.0);
  }
  if (proof) PetscCall(LatinEquilibriumMoved_Private(c->structure, c->d, found));
  for (PetscInt l = 0; l < c->n && *held && bears; l++) bears[l] = c->t[l] / c->scale;
  PetscFunctionReturn(0);
}

/*
   Sets the verdict LATIN_UNBOUNDED if it proves that there is no equilibrium; else *found is unchanged. `ksp` solves with A, a tangent
   stiffness of LatinTangentCreate_Private(), whose values it overwrites. `more`: an additional load, or NULL. *steps and *stages: number of
   factorisations and of linear iterations. *held: statically admissible tensions exist; bears: NULL, or [links_local], these tensions, of links that do not yield.
   Collective on structure
*/
PetscErrorCode LatinEquilibriumCollapse_Private(LatinStructure structure, KSP ksp, Mat A, Vec more, PetscReal bears[], PetscInt *steps, PetscInt *stages, PetscBool *held, LatinEquilibrium *found)
{
  LatinCollapse c = {.structure = structure, .ksp = ksp, .A = A, .n = structure->links_local};

  PetscFunctionBegin;
  *steps = *stages = 0;
  *held            = PETSC_FALSE;
  if (structure->ground || structure->rubs || structure->span) PetscFunctionReturn(0); /* a time step always has a solution; contacts with friction have no energy, see LatinConesCreate_Private() */
  PetscCall(PetscCalloc7(c.n, &c.x, c.n, &c.dx, c.n, &c.t, c.n, &c.dt, c.n, &c.w, c.n, &c.rhs, c.n, &c.side));
  PetscCall(LatinCollapseBounds_Private(&c));
  if (c.count > 0.0) {
    PetscCall(DMGetGlobalVector(structure->dm, &c.f));
    PetscCall(DMGetGlobalVector(structure->dm, &c.d));
    PetscCall(DMGetGlobalVector(structure->dm, &c.r));
    PetscCall(DMGetGlobalVector(structure->dm, &c.dd));
    PetscCall(VecCopy(structure->load, c.f));
    if (more) PetscCall(VecAXPY(c.f, 1.0, more));
    PetscCall(VecZeroEntries(c.d));
    PetscCall(LatinStructureForces_Private(structure, c.t, c.d, NULL, c.r));
    PetscCall(VecAXPY(c.f, -1.0, c.r));
    PetscCall(LatinCollapseRun_Private(&c, bears, steps, held, found));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.dd));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.r));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.d));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.f));
  }
  *stages = c.stages;
  PetscCall(PetscFree7(c.x, c.dx, c.t, c.dt, c.w, c.rhs, c.side));
  PetscFunctionReturn(0);
}
