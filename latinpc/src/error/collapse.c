#include "error/latinerror.h"

/*
   Search for a collapse: whether the loads exceed the limit load. Statically admissible tensions balance the loads, B^t tau = F, between the bounds
   of the laws: cables only pull, and a link that yields bears no more than its yield tension. On a displacement d they do the work tau.B d = F.d, so
   F.d is at most D(d), the sum over links of the elongation times the bound on that side (upper bound theorem of limit analysis). A link without a
   bound there must not stretch: it resists at any amplitude. By the lemma of J. Farkas admissible tensions exist if and only if F.d <= D(d) for all
   such d. If F.d > D(d), the structure collapses along d. Without links that yield D = 0, and d is a mechanism. Stiffnesses, gaps and prestress do
   not matter.

   1. d minimises |B d|^2 / 2 + D(d) - F.d: it is nearest to the displacement of the reference structure, whose links are all bars of one stiffness. d
      = 0 if and only if there is an equilibrium. The method of error/primaldual.c computes d, with R = 1 and c = 0.
   2. By rounding, d stretches the links that resist by some v. An equilibrium has F.d <= D(d) + |tau| |v|, so its tensions are at least (F.d - D(d))
      / |v| times those of the reference structure. Beyond LATIN_COLLAPSE_TENSION this counts as a proof that there is none.
*/

#define LATIN_COLLAPSE_STEPS 60 /* most steps */
/* initial compliance of links that resist, relative to the reference structure; at 100 times as much some large networks do not converge */
#define LATIN_COLLAPSE_REGULARISATION LatinByPrecision(1e-10, 1e-4)
/* initial tensions and elongations at bounds, relative to the reference tensions; with smaller ones steps are short */
#define LATIN_COLLAPSE_START    10.0
#define LATIN_COLLAPSE_ROUNDING 8.0 /* times eps and the largest displacement: rounding of an elongation */

/* Computes the initial point: scales the loads f, and the bounds with them, to tensions of norm 1 in the reference structure; sets t, s and y. Collective */
static PetscErrorCode LatinCollapseStart_Private(LatinPrimalDual *c, PetscBool *failed)
{
  PetscScalar work;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(c->w, c->n));
  PetscCall(LatinPrimalDualOperator_Private(c, PETSC_FALSE));
  PetscCall(LatinPrimalDualSolve_Private(c, c->f, failed));
  PetscCall(VecDot(c->f, c->dd, &work));
  if (!(PetscRealPart(work) > 0.0)) *failed = PETSC_TRUE;
  if (*failed) PetscFunctionReturn(0);
  c->scale = 1.0 / PetscSqrtReal(PetscRealPart(work));
  PetscCall(VecScale(c->f, c->scale));
  c->unbalance = 1.0;
  for (PetscInt l = 0; l < c->n; l++) {
    LatinBound *lower, *upper;
    PetscReal   inside = LATIN_COLLAPSE_START / PetscSqrtReal((PetscReal)c->structure->links_global);

    for (PetscInt i = 0; i < 2; i++) c->side[l][i].bound *= c->scale;
    inside  = PetscMin(inside, 0.5 * (c->side[l][1].bound - c->side[l][0].bound));
    c->t[l] = PetscMin(PetscMax(0.0, c->side[l][0].bound + inside), c->side[l][1].bound - inside);
    lower   = LatinBoundAt(c, l, 0);
    upper   = LatinBoundAt(c, l, 1);
    if (lower) lower->y = c->t[l] - lower->bound;
    if (upper) upper->y = upper->bound - c->t[l];
    for (PetscInt i = 0; i < 2; i++) c->side[l][i].s = LatinBoundAt(c, l, i) ? PetscSqr(LATIN_COLLAPSE_START) / (c->structure->links_global * c->side[l][i].y) : 0.0;
  }
  PetscFunctionReturn(0);
}

/*
   Tests the point. *proof: the loads do more work on d than the bounds of the tensions allow; *held: d = 0 to tolerance, so there is an equilibrium.
   Collective
*/
static PetscErrorCode LatinCollapseProof_Private(LatinPrimalDual *c, PetscInt step, PetscBool *proof, PetscBool *held)
{
  PetscReal   sum[4] = {0.0, 0.0, 0.0, 0.0}, beyond, most; /* squared elongations that links resist, and all; work of tensions at bounds, its uncertainty */
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

/* Takes interior-point steps to a proof or an equilibrium. bears: NULL, or [n], set to statically admissible tensions if *held. Collective */
static PetscErrorCode LatinCollapseRun_Private(LatinPrimalDual *c, PetscInt most, PetscReal bears[], PetscInt *steps, PetscBool *held, LatinEquilibrium *found)
{
  PetscBool failed = PETSC_FALSE, proof = PETSC_FALSE;

  PetscFunctionBegin;
  c->softest        = 1.0;
  c->regularisation = LATIN_COLLAPSE_REGULARISATION;
  PetscCall(LatinCollapseStart_Private(c, &failed));
  c->mean = PetscSqr(LATIN_COLLAPSE_START) / c->structure->links_global;
  for (*steps = 0; *steps < LATIN_COLLAPSE_STEPS && c->stages < most && !failed && !proof && !*held;) {
    PetscCall(LatinPrimalDualIterate_Private(c, &failed));
    ++*steps;
    if (!failed) PetscCall(LatinCollapseProof_Private(c, *steps, &proof, held));
  }
  if (proof) PetscCall(LatinEquilibriumMoved_Private(c->structure, c->d, found));
  for (PetscInt l = 0; l < c->n && *held && bears; l++) bears[l] = c->t[l] / c->scale;
  PetscFunctionReturn(0);
}

/*
   Sets the verdict LATIN_UNBOUNDED if there is provably no equilibrium; else *found is unchanged.

     ksp:            solves with A, a tangent stiffness of LatinTangentCreate_Private(), whose values are overwritten
     more:           an additional load, or NULL
     most:           most linear iterations
     steps, stages:  number of factorisations and of linear iterations
     held:           statically admissible tensions exist
     bears:          NULL, or [links_local], these tensions of links that do not yield

   Collective on structure
*/
PetscErrorCode LatinEquilibriumCollapse_Private(LatinStructure structure, KSP ksp, Mat A, Vec more, PetscInt most, PetscReal bears[], PetscInt *steps, PetscInt *stages, PetscBool *held, LatinEquilibrium *found)
{
  LatinPrimalDual c = {.structure = structure, .ksp = ksp, .A = A, .reference = 1.0};

  PetscFunctionBegin;
  *steps = *stages = 0;
  *held            = PETSC_FALSE;
  if (!LatinCollapseMay(structure)) PetscFunctionReturn(0);
  PetscCall(LatinPrimalDualCreate_Private(&c, more));
  if (c.count > 0.0) PetscCall(LatinCollapseRun_Private(&c, most, bears, steps, held, found));
  *stages = c.stages;
  PetscCall(LatinPrimalDualDestroy_Private(&c));
  PetscFunctionReturn(0);
}
