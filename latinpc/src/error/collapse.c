#include "error/latinerror.h"

/*
   Do the loads exceed the limit load? Statically admissible tensions balance the loads, B^t tau = F, with the signs that the laws
   allow: cables only pull. A mechanism is a displacement d that no link resists at any amplitude: B d = 0 at bars, B d <= 0 at
   cables and inextensible cables, B d >= 0 at links in compression. By the lemma of J. Farkas admissible tensions exist if and only if
   F.d <= 0 for all mechanisms. A mechanism with F.d > 0 proves that there is no equilibrium: the structure collapses along d.
   Stiffnesses, gaps and prestress do not matter.

   d minimises |B d|^2 / 2 - F.d over the mechanisms: it is the one nearest to the displacement of the reference structure, whose links
   are all bars of one stiffness. d = 0 if and only if there is an equilibrium. The interior-point method of S. Mehrotra computes d, with
   slacks s = -B d > 0 at cables. Its number of steps hardly depends on the size of the structure; a step takes one factorisation of
   B^t (1 + W) B and two solves. Tensions are regularised [M. P. Friedlander, D. Orban]: this bounds W and includes bars.

   By rounding, d stretches the links that resist by some v. An equilibrium has F.d <= |tau| |v|, so that its tensions are at least
   F.d / |v| times those of the reference structure. Beyond LATIN_COLLAPSE_TENSION this counts as a proof.
*/

#define LATIN_COLLAPSE_STEPS                60                            /* most steps */
#define LATIN_COLLAPSE_REGULARISATION       LatinByPrecision(1e-10, 1e-4) /* initial compliance of a link that resists, relative to the reference structure; at 100 times as much some large networks do not converge */
#define LATIN_COLLAPSE_REGULARISATION_GROWS 100.0                         /* times that after a failed solve: the operator is singular to rounding */
#define LATIN_COLLAPSE_START                10.0                          /* initial slacks and tensions, relative to the reference tensions: steps are short with smaller ones */
#define LATIN_COLLAPSE_LENGTH               0.995                         /* step length, relative to the longest step with slacks and tensions >= 0 */

typedef struct {
  LatinStructure structure;
  KSP            ksp;
  Mat            A;              /* B^t (1 + W) B */
  Vec            f, d;           /* loads, scaled to reference tensions of norm 1; displacements */
  Vec            r, dd;          /* unbalance; step of d */
  PetscInt       n;              /* links here */
  PetscReal      count;          /* unilateral links, on all ranks */
  PetscReal      links;          /* all links, on all ranks */
  PetscReal      scale;          /* of the loads */
  PetscReal      regularisation; /* compliance of a link that resists */
  PetscReal      unbalance;      /* relative to the initial one */
  PetscInt       stages;
  char          *way;     /* [n] LATIN_WAY_ of each link */
  PetscReal     *x, *dx;  /* [n] elongations, positive if a unilateral link resists; their steps */
  PetscReal     *s, *ds;  /* [n] slacks of unilateral links */
  PetscReal     *t, *dt;  /* [n] tensions */
  PetscReal     *w, *rhs; /* [n] weights of links; work */
} LatinCollapse;

static inline PetscBool LatinCollapseUnilateral(const LatinCollapse *c, PetscInt l)
{
  return (PetscBool)(c->way[l] == LATIN_WAY_TRACTION || c->way[l] == LATIN_WAY_COMPRESSION);
}

/* Sets c->way, the sign of the resistance of each link at large elongations. *known is false if a link has tension without stiffness there, as one that yields. Collective */
static PetscErrorCode LatinCollapseWays_Private(LatinCollapse *c, PetscBool *known)
{
  const LatinStructure structure = c->structure;
  PetscReal            sum[3]    = {0.0, 0.0, 0.0}; /* links with tension but no stiffness, unilateral links, all */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    PetscBool bears;

    c->way[l] = LATIN_WAY_NONE;
    c->way[l] = (char)LatinLinkWay(structure, l, &bears);
    if (bears) sum[0] += 1.0;
    if (LatinCollapseUnilateral(c, l)) sum[1] += 1.0;
    sum[2] += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  c->count = sum[1];
  c->links = sum[2];
  *known   = (PetscBool)(sum[0] == 0.0);
  PetscFunctionReturn(0);
}

/* x = elongations B d, positive if a unilateral link resists. Collective */
static PetscErrorCode LatinCollapseElongations_Private(LatinCollapse *c, Vec d, PetscReal x[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureElongations_Private(c->structure, NULL, d, x));
  for (PetscInt l = 0; l < c->n; l++)
    if (c->way[l] == LATIN_WAY_COMPRESSION) x[l] = -x[l];
  PetscFunctionReturn(0);
}

/* r = B^t t; overwrites t. Collective */
static PetscErrorCode LatinCollapseForces_Private(LatinCollapse *c, PetscReal t[], Vec r)
{
  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++)
    if (c->way[l] == LATIN_WAY_COMPRESSION) t[l] = -t[l];
  PetscCall(LatinStructureForces_Private(c->structure, t, c->d, NULL, r));
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

/* Initial point: scales the loads f to tensions of norm 1 in the reference structure, and sets slacks and tensions. Collective */
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
  PetscCall(VecZeroEntries(c->d));
  c->unbalance = 1.0;
  for (PetscInt l = 0; l < c->n; l++) c->s[l] = c->t[l] = LatinCollapseUnilateral(c, l) ? LATIN_COLLAPSE_START / PetscSqrtReal(c->links) : 0.0;
  PetscFunctionReturn(0);
}

/* Predictor step, towards complementarity s t = 0; corrector step (`corrects`), towards s t = mean, with the second-order term ds dt of the predictor. Collective */
static PetscErrorCode LatinCollapseStep_Private(LatinCollapse *c, PetscBool corrects, PetscReal mean, PetscBool *failed)
{
  PetscFunctionBegin;
  /* dt = W (x - wanted / t + dx); W dx is added after the solve */
  for (PetscInt l = 0; l < c->n; l++) {
    const PetscReal wanted = corrects && LatinCollapseUnilateral(c, l) ? c->ds[l] * c->dt[l] - mean : 0.0;

    c->rhs[l] = wanted;
    c->dx[l]  = c->w[l] * (c->x[l] - (wanted != 0.0 ? wanted / c->t[l] : 0.0));
  }
  PetscCall(PetscArraycpy(c->dt, c->dx, c->n));
  for (PetscInt l = 0; l < c->n; l++) c->dx[l] += c->x[l] + c->t[l];
  PetscCall(LatinCollapseForces_Private(c, c->dx, c->r));
  PetscCall(VecAYPX(c->r, -1.0, c->f));
  PetscCall(LatinCollapseSolve_Private(c, c->r, failed));
  PetscCall(LatinCollapseElongations_Private(c, c->dd, c->dx));
  for (PetscInt l = 0; l < c->n; l++) {
    c->dt[l] += c->w[l] * c->dx[l];
    if (LatinCollapseUnilateral(c, l)) c->ds[l] = -c->s[l] - (c->rhs[l] + c->s[l] * c->dt[l]) / c->t[l];
  }
  PetscFunctionReturn(0);
}

/* Step length: `back` times the longest step that keeps slacks and tensions >= 0, at most 1; mean complementarity product after the step. Collective */
static PetscErrorCode LatinCollapseLength_Private(LatinCollapse *c, PetscReal back, PetscReal *length, PetscReal *mean)
{
  const MPI_Comm comm = PetscObjectComm((PetscObject)c->structure);
  PetscReal      sum  = 0.0;

  PetscFunctionBegin;
  *length = 1.0 / back;
  for (PetscInt l = 0; l < c->n; l++) {
    if (!LatinCollapseUnilateral(c, l)) continue;
    if (c->ds[l] < 0.0) *length = PetscMin(*length, -c->s[l] / c->ds[l]);
    if (c->dt[l] < 0.0) *length = PetscMin(*length, -c->t[l] / c->dt[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, length, 1, MPIU_REAL, MPIU_MIN, comm));
  *length *= back;
  for (PetscInt l = 0; l < c->n; l++) sum += LatinCollapseUnilateral(c, l) ? (c->s[l] + *length * c->ds[l]) * (c->t[l] + *length * c->dt[l]) : 0.0;
  PetscCall(MPIU_Allreduce(&sum, mean, 1, MPIU_REAL, MPIU_SUM, comm));
  *mean /= c->count;
  PetscFunctionReturn(0);
}

/* An interior-point step: weights W, predictor, corrector; updates d, t, s, x and the mean complementarity product. Collective */
static PetscErrorCode LatinCollapseIterate_Private(LatinCollapse *c, PetscReal *mean, PetscBool *failed)
{
  PetscReal length, after;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    c->w[l]  = c->way[l] == LATIN_WAY_NONE ? 0.0 : 1.0 / ((LatinCollapseUnilateral(c, l) ? c->s[l] / c->t[l] : 0.0) + c->regularisation);
    c->ds[l] = c->dt[l] = 0.0;
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
    if (LatinCollapseUnilateral(c, l)) c->s[l] += length * c->ds[l];
  }
  c->unbalance *= 1.0 - length;
  PetscCall(LatinCollapseElongations_Private(c, c->d, c->x));
  PetscFunctionReturn(0);
}

/* *proof: d is a mechanism with F.d > 0; *held: d = 0 to tolerance, there is an equilibrium. Collective */
static PetscErrorCode LatinCollapseProof_Private(LatinCollapse *c, PetscInt step, PetscBool *proof, PetscBool *held)
{
  PetscReal   sum[2] = {0.0, 0.0}; /* squared elongations: those that links resist, all */
  PetscScalar push;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    if (c->way[l] == LATIN_WAY_BOTH || (c->x[l] > 0.0 && c->way[l] != LATIN_WAY_NONE)) sum[0] += PetscSqr(c->x[l]);
    sum[1] += PetscSqr(c->x[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  PetscCall(VecDot(c->f, c->d, &push));
  *held  = (PetscBool)(c->unbalance <= LATIN_COLLAPSE_HELD && PetscSqrtReal(sum[1]) <= LATIN_COLLAPSE_HELD);
  *proof = LatinCollapseProves(PetscRealPart(push), 0.0, sum[0], sum[1]);
  PetscCall(PetscInfo(c->structure, "step %" PetscInt_FMT ": work of the loads %g, tensions at least %g times those of bars\n", step, (double)PetscRealPart(push), (double)(sum[0] > 0.0 ? PetscRealPart(push) / PetscSqrtReal(sum[0]) : INFINITY)));
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
  for (PetscInt l = 0; l < c->n && *held && bears; l++) bears[l] = (c->way[l] == LATIN_WAY_COMPRESSION ? -1.0 : 1.0) * c->t[l] / c->scale;
  PetscFunctionReturn(0);
}

/*
   Sets the verdict LATIN_UNBOUNDED if it proves that there is no equilibrium; else *found is unchanged. `ksp` solves with A, a tangent
   stiffness of LatinTangentCreate_Private(), whose values it overwrites. `more`: an additional load, or NULL. *steps and *stages: number of
   factorisations and of linear iterations. *held: statically admissible tensions exist; bears: NULL, or [links_local], these tensions.
   Collective on structure
*/
PetscErrorCode LatinEquilibriumCollapse_Private(LatinStructure structure, KSP ksp, Mat A, Vec more, PetscReal bears[], PetscInt *steps, PetscInt *stages, PetscBool *held, LatinEquilibrium *found)
{
  LatinCollapse c     = {.structure = structure, .ksp = ksp, .A = A, .n = structure->links_local};
  PetscBool     known = PETSC_FALSE;

  PetscFunctionBegin;
  *steps = *stages = 0;
  *held            = PETSC_FALSE;
  if (structure->ground || structure->rubs || structure->span) PetscFunctionReturn(0); /* a time step always has a solution; contacts with friction have no energy, see LatinConesCreate_Private() */
  PetscCall(PetscMalloc1(c.n, &c.way));
  PetscCall(PetscCalloc4(c.n, &c.x, c.n, &c.dx, c.n, &c.s, c.n, &c.ds));
  PetscCall(PetscMalloc4(c.n, &c.t, c.n, &c.dt, c.n, &c.w, c.n, &c.rhs));
  PetscCall(LatinCollapseWays_Private(&c, &known));
  if (known && c.count > 0.0) {
    PetscCall(DMGetGlobalVector(structure->dm, &c.f));
    PetscCall(DMGetGlobalVector(structure->dm, &c.d));
    PetscCall(DMGetGlobalVector(structure->dm, &c.r));
    PetscCall(DMGetGlobalVector(structure->dm, &c.dd));
    PetscCall(VecCopy(structure->load, c.f));
    if (more) PetscCall(VecAXPY(c.f, 1.0, more));
    PetscCall(LatinCollapseRun_Private(&c, bears, steps, held, found));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.dd));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.r));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.d));
    PetscCall(DMRestoreGlobalVector(structure->dm, &c.f));
  }
  *stages = c.stages;
  PetscCall(PetscFree4(c.t, c.dt, c.w, c.rhs));
  PetscCall(PetscFree4(c.x, c.dx, c.s, c.ds));
  PetscCall(PetscFree(c.way));
  PetscFunctionReturn(0);
}
