#include "error/latinerror.h"

/*
   Is there no equilibrium? The tensions of one bear the loads, B^t tau = F, and cables only pull [J. Farkas]: so the loads
   do no work on displacements d that no link resists, however far they go: B d is zero at bars, not positive at cables and
   inextensible cables, not negative at links in compression. Where there are such d with F.d > 0 there is no equilibrium,
   and the structure follows them; stiffnesses, gaps and prestress play no part.

   d is sought as the displacement nearest to that of the structure whose links are all bars of one stiffness: the least of
   |B d|^2 / 2 - F.d for these d, which is zero if and only if there is an equilibrium. The interior-point method finds it
   [S. Mehrotra], with steps that keep cables slack, s = -B d > 0, and whose number hardly depends on the size of the
   structure: each takes one factorisation of B^t (1 + W) B and two solves. Tensions are regularised [M. P. Friedlander, D. Orban], so that W
   is bounded and bars need no other treatment.

   What rounding leaves of the resistance v of the links along d is compared: an equilibrium has F.d <= |tau| |v|, so that its tensions
   are at least F.d / |v| times those that the loads cause where all links are bars. From a number on that is a proof.
*/

#define LATIN_COLLAPSE_STEPS  60                            /* most steps */
#define LATIN_COLLAPSE_SOFT   LatinByPrecision(1e-10, 1e-4) /* compliance of a link that resists, beside that of the metric, at first; with a hundred times as much some large networks take no end */
#define LATIN_COLLAPSE_SOFTER 100.0                         /* times that, where the operator is a mechanism to rounding */
#define LATIN_COLLAPSE_START  10.0                          /* slack and tensions at first, beside those of bars: nearer to zero steps are short */
#define LATIN_COLLAPSE_BACK   0.995                         /* part of the way to where a cable would become taut */

typedef struct {
  LatinStructure structure;
  KSP            ksp;
  Mat            A;     /* B^t (1 + W) B */
  Vec            f, d;  /* loads, in the norm of the metric; displacements */
  Vec            r, dd; /* what is without balance, and a step */
  PetscInt       n;     /* links here */
  PetscReal      count; /* links of one way, on all ranks */
  PetscReal      links; /* all that displacements stretch, on all ranks */
  PetscReal      scale; /* of the loads */
  PetscReal      soft;  /* compliance of a link that resists */
  PetscReal      left;  /* part of the first unbalance that is left */
  PetscInt       stages;
  char          *way;     /* [n] */
  PetscReal     *x, *dx;  /* [n] elongations, positive where a link of one way would resist; their steps */
  PetscReal     *s, *ds;  /* [n] slack of links of one way */
  PetscReal     *t, *dt;  /* [n] tensions */
  PetscReal     *w, *rhs; /* [n] weights of links; work */
} LatinCollapse;

static inline PetscBool LatinCollapseOne(const LatinCollapse *c, PetscInt l)
{
  return (PetscBool)(c->way[l] == LATIN_WAY_TRACTION || c->way[l] == LATIN_WAY_COMPRESSION);
}

/* Which way does a link resist far out? *known is false where it bears a force without resisting, as one that yields */
static PetscErrorCode LatinCollapseWays_Private(LatinCollapse *c, PetscBool *known)
{
  const LatinStructure structure = c->structure;
  PetscReal            sum[3]    = {0.0, 0.0, 0.0}; /* links that bear without resisting, links of one way, all */

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    PetscBool bears;

    c->way[l] = LATIN_WAY_NONE;
    c->way[l] = (char)LatinLinkWay(structure, l, &bears);
    if (bears) sum[0] += 1.0;
    if (LatinCollapseOne(c, l)) sum[1] += 1.0;
    sum[2] += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  c->count = sum[1];
  c->links = sum[2];
  *known   = (PetscBool)(sum[0] == 0.0);
  PetscFunctionReturn(0);
}

/* x = the elongations of displacements, positive where a link of one way would resist. Collective */
static PetscErrorCode LatinCollapseElongations_Private(LatinCollapse *c, Vec d, PetscReal x[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureElongations_Private(c->structure, NULL, d, x));
  for (PetscInt l = 0; l < c->n; l++)
    if (c->way[l] == LATIN_WAY_COMPRESSION) x[l] = -x[l];
  PetscFunctionReturn(0);
}

/* r = B^t t, the forces of these tensions, which are lost. Collective */
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

/* The operator of these weights, 1 + W, and its factors at the next solve. Collective */
static PetscErrorCode LatinCollapseOperator_Private(LatinCollapse *c)
{
  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) c->rhs[l] = 1.0 + c->w[l];
  PetscCall(LatinTangentGive_Private(c->structure, c->rhs, c->A));
  PetscCall(KSPSetOperators(c->ksp, c->A, c->A));
  PetscFunctionReturn(0);
}

/* Displacements and tensions where all links are bars: they make the loads f, whose tensions have the norm 1, and what slack and tensions start from. Collective */
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
  c->left = 1.0;
  for (PetscInt l = 0; l < c->n; l++) c->s[l] = c->t[l] = LatinCollapseOne(c, l) ? LATIN_COLLAPSE_START / PetscSqrtReal(c->links) : 0.0;
  PetscFunctionReturn(0);
}

/* The step towards products s t of zero; the one that corrects it goes towards this mean, with what the product of the changes adds. Collective */
static PetscErrorCode LatinCollapseStep_Private(LatinCollapse *c, PetscBool corrects, PetscReal mean, PetscBool *failed)
{
  PetscFunctionBegin;
  /* dt = W (x - wanted / t + dx), of which dx is still to come */
  for (PetscInt l = 0; l < c->n; l++) {
    const PetscReal wanted = corrects && LatinCollapseOne(c, l) ? c->ds[l] * c->dt[l] - mean : 0.0;

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
    if (LatinCollapseOne(c, l)) c->ds[l] = -c->s[l] - (c->rhs[l] + c->s[l] * c->dt[l]) / c->t[l];
  }
  PetscFunctionReturn(0);
}

/* How long the step may be, and the mean product after a part of it. Collective */
static PetscErrorCode LatinCollapseLength_Private(LatinCollapse *c, PetscReal back, PetscReal *length, PetscReal *mean)
{
  const MPI_Comm comm = PetscObjectComm((PetscObject)c->structure);
  PetscReal      sum  = 0.0;

  PetscFunctionBegin;
  *length = 1.0 / back;
  for (PetscInt l = 0; l < c->n; l++) {
    if (!LatinCollapseOne(c, l)) continue;
    if (c->ds[l] < 0.0) *length = PetscMin(*length, -c->s[l] / c->ds[l]);
    if (c->dt[l] < 0.0) *length = PetscMin(*length, -c->t[l] / c->dt[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, length, 1, MPIU_REAL, MPIU_MIN, comm));
  *length *= back;
  for (PetscInt l = 0; l < c->n; l++) sum += LatinCollapseOne(c, l) ? (c->s[l] + *length * c->ds[l]) * (c->t[l] + *length * c->dt[l]) : 0.0;
  PetscCall(MPIU_Allreduce(&sum, mean, 1, MPIU_REAL, MPIU_SUM, comm));
  *mean /= c->count;
  PetscFunctionReturn(0);
}

/* Weights, and a step towards slack and tensions whose products are alike and small. Collective */
static PetscErrorCode LatinCollapseIterate_Private(LatinCollapse *c, PetscReal *mean, PetscBool *failed)
{
  PetscReal length, after;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    c->w[l]  = c->way[l] == LATIN_WAY_NONE ? 0.0 : 1.0 / ((LatinCollapseOne(c, l) ? c->s[l] / c->t[l] : 0.0) + c->soft);
    c->ds[l] = c->dt[l] = 0.0;
  }
  PetscCall(LatinCollapseOperator_Private(c));
  PetscCall(LatinCollapseStep_Private(c, PETSC_FALSE, 0.0, failed));
  if (*failed) PetscFunctionReturn(0);
  PetscCall(LatinCollapseLength_Private(c, 1.0, &length, &after));
  PetscCall(LatinCollapseStep_Private(c, PETSC_TRUE, *mean * PetscPowRealInt(after / *mean, 3), failed));
  if (*failed) PetscFunctionReturn(0);
  PetscCall(LatinCollapseLength_Private(c, LATIN_COLLAPSE_BACK, &length, mean));
  PetscCall(VecAXPY(c->d, length, c->dd));
  for (PetscInt l = 0; l < c->n; l++) {
    c->t[l] += length * c->dt[l];
    if (LatinCollapseOne(c, l)) c->s[l] += length * c->ds[l];
  }
  c->left *= 1.0 - length;
  PetscCall(LatinCollapseElongations_Private(c, c->d, c->x));
  PetscFunctionReturn(0);
}

/* *proof: the loads push along d, and nothing resists; *held: d is none. Collective */
static PetscErrorCode LatinCollapseProof_Private(LatinCollapse *c, PetscInt step, PetscBool *proof, PetscBool *held)
{
  PetscReal   sum[2] = {0.0, 0.0}; /* squares of the elongations that links resist, and of all */
  PetscScalar push;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    if (c->way[l] == LATIN_WAY_BOTH || (c->x[l] > 0.0 && c->way[l] != LATIN_WAY_NONE)) sum[0] += PetscSqr(c->x[l]);
    sum[1] += PetscSqr(c->x[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  PetscCall(VecDot(c->f, c->d, &push));
  *held  = (PetscBool)(c->left <= LATIN_COLLAPSE_HELD && PetscSqrtReal(sum[1]) <= LATIN_COLLAPSE_HELD);
  *proof = LatinCollapseProves(PetscRealPart(push), 0.0, sum[0], sum[1]);
  PetscCall(
    PetscInfo(c->structure, "step %" PetscInt_FMT ": the loads push by %g, and tensions are %g times those of bars at least\n", step, (double)PetscRealPart(push), (double)(sum[0] > 0.0 ? PetscRealPart(push) / PetscSqrtReal(sum[0]) : INFINITY)));
  PetscFunctionReturn(0);
}

/* bears: NULL, or the tensions that bear the loads where *held, [n] */
static PetscErrorCode LatinCollapseRun_Private(LatinCollapse *c, PetscReal bears[], PetscInt *steps, PetscBool *held, LatinEquilibrium *found)
{
  PetscBool failed = PETSC_FALSE, proof = PETSC_FALSE;
  PetscReal mean;

  PetscFunctionBegin;
  c->soft = LATIN_COLLAPSE_SOFT;
  PetscCall(LatinCollapseStart_Private(c, &failed));
  mean = PetscSqr(LATIN_COLLAPSE_START) / c->links;
  for (*steps = 0; *steps < LATIN_COLLAPSE_STEPS && !failed && !proof && !*held;) {
    PetscCall(LatinCollapseIterate_Private(c, &mean, &failed));
    ++*steps;
    if (!failed) PetscCall(LatinCollapseProof_Private(c, *steps, &proof, held));
    else failed = (PetscBool)((c->soft *= LATIN_COLLAPSE_SOFTER) >= 1.0);
  }
  if (proof) PetscCall(LatinEquilibriumMoved_Private(c->structure, c->d, found));
  for (PetscInt l = 0; l < c->n && *held && bears; l++) bears[l] = (c->way[l] == LATIN_WAY_COMPRESSION ? -1.0 : 1.0) * c->t[l] / c->scale;
  PetscFunctionReturn(0);
}

/*
   The verdict is LATIN_UNBOUNDED where a proof is found that there is no equilibrium; else *found stays. `ksp` solves with
   the tangent stiffness A of a structure, of LatinTangentCreate_Private(), whose stiffnesses are lost. `more` is a load beside that of the structure, or NULL;
   *steps and *stages: what it has taken, factorisations and linear iterations. *held: tensions bear the loads, these, if they are asked for, [links_local]. Collective on structure
*/
PetscErrorCode LatinEquilibriumCollapse_Private(LatinStructure structure, KSP ksp, Mat A, Vec more, PetscReal bears[], PetscInt *steps, PetscInt *stages, PetscBool *held, LatinEquilibrium *found)
{
  LatinCollapse c     = {.structure = structure, .ksp = ksp, .A = A, .n = structure->links_local};
  PetscBool     known = PETSC_FALSE;

  PetscFunctionBegin;
  *steps = *stages = 0;
  *held            = PETSC_FALSE;
  if (structure->ground || structure->rubs || structure->span) PetscFunctionReturn(0); /* a step of a motion has its solution; contacts with friction have no energy: LatinConesCreate_Private() */
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
