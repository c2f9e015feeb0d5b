#include "snes/sneslatinimpl.h"
#include <petsctao.h>

/*
   Descent: minimises the potential energy by Newton's method in a trust region (PETSc's TAO), whose conjugate gradients follow negative
   curvature to the edge of the region [T. Steihaug 1983]. The path of the loads starts at this minimum if the drawing is not stable. If the
   iterates move away without bound, the structure has no stable state.

   Unknowns: displacements over the size of the structure, each scaled by the root of the stiffness of the links at its node. So units,
   rotations and subdomains do not affect the result.

   Preconditioner: at first none, since subdomains would shape the trust region. Last the operators of Newton's method: in a narrow valley
   in which cables slacken and tighten, steps are too short without them.

   Loads: loads that are small beside the stiffness make the energy a narrow valley, in which all steps are short. If they pull all bars
   tight, the bars are solved for as cables, whose energy is convex (snes/largeconvex.c). Else the descent begins with larger loads, which
   lead to the same state but for elongations, and reduces them (LatinDescentRun_Private).
*/

#define LATIN_DESCENT_RADIUS  0.1                           /* initial radius of the trust region, relative to the size of the structure */
#define LATIN_DESCENT_BALANCE LatinByPrecision(1e-12, 1e-5) /* unbalanced forces at the end, relative to stiffness times size; Newton's method goes on */
#define LATIN_DESCENT_FORCES  1e-9                          /* the same near the start, relative to the loads: else small loads leave a symmetric state as it is */
#define LATIN_DESCENT_RTOL    1e-3                          /* rtol of a linear solve */
#define LATIN_DESCENT_SOON    30                            /* most steps of the first descent; 200: rotations and units change which state towers find */
#define LATIN_DESCENT_STEPS   1000                          /* most steps of every other descent */
#define LATIN_DESCENT_NEAR    200                           /* most steps of a descent that should stay near its start */
#define LATIN_DESCENT_HEAVY   0.1                           /* heaviest loads, relative to stiffness times size */
#define LATIN_DESCENT_LIGHTER 10.0                          /* ratio of successive loads */
#define LATIN_DESCENT_AWAY    0.05                          /* a descent that should stay near its start may move nodes by this part of the size */

typedef struct {
  SNES           snes;
  LatinStructure structure;
  Vec            load, weight; /* loads, with those of snes; displacement per unknown: size times the root of the mean stiffness over that at the node */
  Vec            u, more;      /* work vectors */
  PetscReal      force, size;  /* mean stiffness times size, a force; size of the structure, a length */
  PetscReal      loads;        /* norm of the loads, each times the displacement of its unit unknown: a work */
  PetscReal      balance;      /* unbalanced forces at the end, relative to stiffness times size */
  PC             pc;           /* preconditioner: the operators of Newton's method; borrowed */
  PetscBool      renews;       /* these are made anew for each step */
  PetscBool      near;         /* the descent should stay near its start, preconditioned by the present operators */
  Vec            start;        /* initial displacements, with `near` */
  PetscBool      tried;        /* heavier loads have been tried */
  /* of this descent */
  Tao                tao;
  Vec                x, first; /* unknowns; initial ones */
  PetscReal          times;    /* factor on the loads */
  PetscReal          unit;     /* unit of the energy: TAO compares energies in absolute terms */
  PetscInt           most;     /* most steps */
  TaoConvergedReason reason;
} LatinDescent;

/* Computes descent->weight, the displacements of unit unknowns, and descent->force. Collective on descent->structure */
static PetscErrorCode LatinDescentWeights_Private(LatinDescent *descent)
{
  const LatinStructure structure = descent->structure;
  const PetscInt       dim       = structure->dim;
  PetscReal            mean;
  PetscScalar         *v, sum;
  PetscInt             n;
  Vec                  local;

  PetscFunctionBegin;
  PetscCall(LatinStructureOpenForces_Private(structure, &local, &v));
  for (PetscInt i = 0; i < 2 * dim * structure->links_local; i++) {
    const PetscInt l = i / (2 * dim);

    v[dim * structure->ends[i / dim] + i % dim] += LatinLaws[structure->law[l]].rigid ? structure->penalty[l] : structure->stiffness[l];
  }
  PetscCall(LatinStructureCloseForces_Private(structure, &local, &v, NULL, NULL, descent->weight));
  PetscCall(VecSum(descent->weight, &sum));
  PetscCall(VecGetSize(descent->weight, &n));
  mean           = PetscRealPart(sum) / (PetscReal)n;
  descent->force = mean * descent->size;
  PetscCall(VecShift(descent->weight, PETSC_MACHINE_EPSILON * mean)); /* for nodes without links */
  PetscCall(VecPow(descent->weight, -0.5));
  PetscCall(VecScale(descent->weight, descent->size * PetscSqrtReal(mean)));
  PetscFunctionReturn(0);
}

/* Computes the energy at x, in units of descent->unit, and its gradient. Collective on tao */
static PetscErrorCode LatinDescentEnergy_Private(Tao tao, Vec x, PetscReal *energy, Vec gradient, void *ctx)
{
  const LatinDescent *descent   = (LatinDescent *)ctx;
  LatinStructure      structure = descent->structure;
  PetscScalar         work;

  PetscFunctionBegin;
  (void)tao;
  PetscCall(VecPointwiseMult(descent->u, descent->weight, x));
  PetscCall(VecWAXPY(descent->more, -descent->times, descent->load, structure->load));
  PetscCall(LatinTurningEnergy_Private(structure, descent->u, energy));
  PetscCall(VecDot(descent->more, descent->u, &work));
  *energy = (*energy + PetscRealPart(work)) / descent->unit;
  PetscCall(LatinTurningResidual_Private(structure, NULL, descent->u, gradient));
  PetscCall(VecAXPY(gradient, 1.0, descent->more));
  PetscCall(VecPointwiseMult(gradient, gradient, descent->weight));
  PetscCall(VecScale(gradient, 1.0 / descent->unit));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDescentTangent_Private(Tao tao, Vec x, Mat A, Mat P, void *ctx)
{
  LatinDescent *descent = (LatinDescent *)ctx;
  KSP           ksp;

  PetscFunctionBegin;
  (void)tao;
  (void)P;
  PetscCall(VecPointwiseMult(descent->u, descent->weight, x));
  if (descent->renews) {
    PetscCall(VecCopy(descent->u, descent->snes->vec_sol));
    PetscCall(SNESLatinLargeRenew_Private(descent->snes, LATIN_FRAME_TANGENT));
    PetscCall(SNESLatinLargeTangent_Private(descent->snes, descent->u, &ksp));
    PetscCall(KSPGetPC(ksp, &descent->pc));
  }
  PetscCall(LatinTurningMatCompute_Private(descent->structure, descent->u, A));
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY)); /* discards the scaling of the last step */
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatDiagonalScale(A, descent->weight, descent->weight));
  PetscCall(MatScale(A, 1.0 / descent->unit));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinDescentConverged_Private(Tao tao, void *ctx)
{
  const LatinDescent *descent = (LatinDescent *)ctx;
  PetscReal           left, radius, far, away = 0.0;
  PetscInt            it;
  Vec                 x;

  PetscFunctionBegin;
  PetscCall(TaoGetSolutionStatus(tao, &it, NULL, &left, NULL, &radius, NULL));
  PetscCall(TaoGetSolution(tao, &x));
  PetscCall(VecNorm(x, NORM_2, &far));
  if (descent->near) { /* the work vectors are free between evaluations */
    PetscCall(VecPointwiseMult(descent->u, descent->weight, x));
    PetscCall(VecAXPY(descent->u, -1.0, descent->start));
    PetscCall(VecNorm(descent->u, NORM_INFINITY, &away));
  }
  if (left * descent->unit <= descent->balance * descent->force * descent->size) PetscCall(TaoSetConvergedReason(tao, TAO_CONVERGED_GATOL));
  else if (far > LATIN_LARGE_NOWHERE || away > LATIN_DESCENT_AWAY * descent->size) PetscCall(TaoSetConvergedReason(tao, TAO_DIVERGED_USER));
  else if (it >= descent->most) PetscCall(TaoSetConvergedReason(tao, TAO_DIVERGED_MAXITS));
  else if (it && radius <= PETSC_MACHINE_EPSILON) PetscCall(TaoSetConvergedReason(tao, TAO_CONVERGED_STEPTOL));
  else PetscCall(TaoSetConvergedReason(tao, TAO_CONTINUE_ITERATING));
  PetscFunctionReturn(0);
}

/*
   Sets what TAO reads from options only: the initial radius is the one given, and energies are compared down to 1e-13. The options are set
   in a database of their own. Collective on tao
*/
static PetscErrorCode LatinDescentOptions_Private(Tao tao, SNES snes)
{
  PetscOptions defaults;

  PetscFunctionBegin;
  PetscCall(PetscOptionsCreate(&defaults));
  PetscCall(PetscOptionsSetValue(defaults, "-tao_ntr_init_type", "constant"));
  PetscCall(PetscOptionsSetValue(defaults, "-tao_ntr_epsilon", "1e-13"));
  PetscCall(PetscObjectSetOptions((PetscObject)tao, defaults));
  PetscCall(TaoSetFromOptions(tao));
  PetscCall(PetscObjectSetOptions((PetscObject)tao, ((PetscObject)snes)->options));
  PetscCall(PetscOptionsDestroy(&defaults));
  PetscFunctionReturn(0);
}

/* Applies the operators of Newton's method to the unknowns of the descent */
static PetscErrorCode LatinDescentPrecondition_Private(PC pc, Vec r, Vec z)
{
  LatinDescent *descent;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(pc, &descent));
  PetscCall(VecPointwiseDivide(descent->u, r, descent->weight));
  PetscCall(PCApply(descent->pc, descent->u, z));
  PetscCall(VecPointwiseDivide(z, z, descent->weight));
  PetscCall(VecScale(z, descent->unit));
  PetscFunctionReturn(0);
}

/* Preconditions the linear solves by descent->pc, which then defines the norm of the trust region as well. Collective on descent->tao */
static PetscErrorCode LatinDescentOperators_Private(LatinDescent *descent)
{
  KSP ksp;
  PC  pc;

  PetscFunctionBegin;
  PetscCall(TaoGetKSP(descent->tao, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetContext(pc, descent));
  PetscCall(PCShellSetApply(pc, LatinDescentPrecondition_Private));
  PetscFunctionReturn(0);
}

/* Creates descent->tao. Collective on descent->snes */
static PetscErrorCode LatinDescentCreate_Private(LatinDescent *descent)
{
  KSP ksp;
  PC  pc;
  Mat A;
  Tao tao;

  PetscFunctionBegin;
  PetscCall(LatinTurningMatCreate_Private(descent->structure, &A));
  PetscCall(TaoCreate(PetscObjectComm((PetscObject)descent->snes), &tao));
  PetscCall(TaoSetType(tao, TAONTR));
  PetscCall(TaoSetSolution(tao, descent->x));
  PetscCall(TaoSetObjectiveAndGradient(tao, NULL, LatinDescentEnergy_Private, descent));
  PetscCall(TaoSetHessian(tao, A, A, LatinDescentTangent_Private, descent));
  PetscCall(PetscObjectDereference((PetscObject)A));
  PetscCall(TaoSetConvergenceTest(tao, LatinDescentConverged_Private, descent));
  PetscCall(TaoSetInitialTrustRegionRadius(tao, LATIN_DESCENT_RADIUS));
  PetscCall(LatinDescentOptions_Private(tao, descent->snes));
  PetscCall(TaoGetKSP(tao, &ksp));
  PetscCall(KSPSetType(ksp, KSPSTCG));
  PetscCall(KSPSetTolerances(ksp, LATIN_DESCENT_RTOL, 0.0, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCNONE));
  descent->tao = tao;
  if (descent->near) PetscCall(LatinDescentOperators_Private(descent));
  PetscFunctionReturn(0);
}

/*
   Sets descent->unit to the strain energy at the unknowns, or to that of the current loads if the mean stiffness held each node, whichever is larger. TAO
   accepts each step that changes the energy by less than 1e-13: in a unit that does not depend on the loads, each step under small ones. Collective on
   descent->structure
*/
static PetscErrorCode LatinDescentUnit_Private(LatinDescent *descent)
{
  const PetscReal whole = descent->force * descent->size;
  PetscScalar     work;

  PetscFunctionBegin;
  PetscCall(VecPointwiseMult(descent->u, descent->weight, descent->x));
  PetscCall(LatinTurningEnergy_Private(descent->structure, descent->u, &descent->unit));
  PetscCall(VecDot(descent->structure->load, descent->u, &work));
  descent->unit = PetscMax(descent->unit + PetscRealPart(work), PetscSqr(descent->times * descent->loads) / whole);
  if (!(descent->unit > 0.0)) descent->unit = whole;
  PetscFunctionReturn(0);
}

/* Descends from the unknowns under `times` the loads. If it fails, they are the initial ones again. Collective on descent->snes */
static PetscErrorCode LatinDescentOnce_Private(LatinDescent *descent, PetscReal times)
{
  PetscInt steps;

  PetscFunctionBegin;
  descent->times = times;
  PetscCall(LatinDescentUnit_Private(descent));
  PetscCall(TaoSolve(descent->tao));
  PetscCall(TaoGetConvergedReason(descent->tao, &descent->reason));
  PetscCall(TaoGetIterationNumber(descent->tao, &steps));
  PetscCall(PetscInfo(descent->snes, "Down the energy, %g times the loads: %s after %" PetscInt_FMT " steps\n", (double)times, TaoConvergedReasons[descent->reason], steps));
  if (descent->reason < 0) PetscCall(VecCopy(descent->first, descent->x));
  PetscFunctionReturn(0);
}

/*
   Descends under the heaviest loads, then under lighter ones while these lead nowhere; from the first state found, under ever lighter ones down to the
   loads themselves or to a failure. Collective on descent->snes
*/
static PetscErrorCode LatinDescentLighter_Private(LatinDescent *descent, PetscReal heaviest)
{
  PetscBool found = PETSC_FALSE;

  PetscFunctionBegin;
  descent->tried = PETSC_TRUE;
  PetscCall(LatinDescentOnce_Private(descent, heaviest));
  while (descent->times > 1.0 && !(found && descent->reason < 0)) {
    if (descent->reason > 0) found = PETSC_TRUE;
    PetscCall(LatinDescentOnce_Private(descent, PetscMax(1.0, descent->times / LATIN_DESCENT_LIGHTER)));
  }
  PetscFunctionReturn(0);
}

/* Returns in *up whether the energy under the current loads is higher at the unknowns than at the initial ones. Collective on descent->tao */
static PetscErrorCode LatinDescentUp_Private(LatinDescent *descent, PetscBool *up)
{
  PetscReal from, to;
  Vec       g;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(descent->x, &g));
  PetscCall(LatinDescentEnergy_Private(descent->tao, descent->first, &from, g, descent));
  PetscCall(LatinDescentEnergy_Private(descent->tao, descent->x, &to, g, descent));
  PetscCall(VecDestroy(&g));
  *up = (PetscBool)(to > from);
  PetscFunctionReturn(0);
}

/* Steps 2 to 5 of LatinDescentRun_Private, after step 1 has failed. Collective on descent->snes */
static PetscErrorCode LatinDescentFurther_Private(LatinDescent *descent, PetscReal heaviest)
{
  PetscBool taut, up = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(SNESLatinLargeTaut_Private(descent->snes, descent->u, &taut));
  if (taut) {
    PetscCall(VecPointwiseDivide(descent->x, descent->u, descent->weight));
    descent->reason = TAO_CONVERGED_USER;
    PetscFunctionReturn(0);
  }
  descent->most = LATIN_DESCENT_STEPS;
  if (heaviest > 1.0) {
    PetscCall(LatinDescentLighter_Private(descent, heaviest));
    if (descent->reason > 0) PetscCall(LatinDescentUp_Private(descent, &up));
    if (up) {
      PetscCall(VecCopy(descent->first, descent->x));
      PetscCall(LatinDescentOnce_Private(descent, 1.0));
    }
  }
  if (descent->reason == TAO_DIVERGED_MAXITS || (descent->reason < 0 && descent->times > 1.0)) {
    descent->renews = PETSC_TRUE;
    PetscCall(LatinDescentOperators_Private(descent));
    PetscCall(LatinDescentOnce_Private(descent, 1.0));
  }
  PetscFunctionReturn(0);
}

/*
   Runs the descents:

   1. Under the loads themselves; near the start no other. The next ones follow only if that takes too long.
   2. If the loads pull all bars tight: the bars are solved for as cables.
   3. Under heavier loads, which decrease.
   4. Heavier loads may have snapped the structure through. If the state found has more energy than the start: under the loads themselves, with as many
      steps as in 3.
   5. If the last one has run out of steps, or has failed under heavier loads: under the loads themselves, with operators made anew for each step.

   heaviest: heaviest factor on the loads; 0: no loads, 1: none heavier. Collective on descent->snes
*/
static PetscErrorCode LatinDescentRun_Private(LatinDescent *descent, PetscReal heaviest)
{
  PetscFunctionBegin;
  descent->most = descent->near ? LATIN_DESCENT_NEAR : heaviest <= 1.0 ? LATIN_DESCENT_STEPS : LATIN_DESCENT_SOON;
  PetscCall(LatinDescentOnce_Private(descent, 1.0));
  if (descent->reason == TAO_DIVERGED_MAXITS && heaviest > 0.0 && !descent->near) PetscCall(LatinDescentFurther_Private(descent, heaviest));
  PetscFunctionReturn(0);
}

/*
   Descends from u to a state in balance under the loads of snes. *rests: found, in u; else u is unchanged.

     near:     the state must be near u; the present operators precondition
     *heavier: on entry, heavier loads may be tried, not near u; on return, false once they have been, as they are the same for every part of the loads

   Collective on snes
*/
PetscErrorCode SNESLatinLargeDescend_Private(SNES snes, PetscBool near, PetscBool *heavier, Vec u, PetscBool *rests)
{
  const LatinLarge *large    = &((SNES_Latin *)snes->data)->large;
  LatinDescent      descent  = {.snes = snes, .structure = large->frame->original, .size = large->size, .near = near, .balance = LATIN_DESCENT_BALANCE};
  PetscReal         heaviest = 0.0, whole;
  KSP               ksp;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(u, &descent.x));
  PetscCall(VecDuplicate(u, &descent.first));
  PetscCall(VecDuplicate(u, &descent.load));
  PetscCall(VecDuplicate(u, &descent.weight));
  PetscCall(VecDuplicate(u, &descent.more));
  PetscCall(VecDuplicate(u, &descent.u));
  PetscCall(LatinDescentWeights_Private(&descent));
  if (near) {
    PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
    PetscCall(KSPGetPC(ksp, &descent.pc));
    PetscCall(VecDuplicate(u, &descent.start));
    PetscCall(VecCopy(u, descent.start));
  }
  PetscCall(LatinStructureLoads_Private(descent.structure, snes->vec_rhs, descent.load));
  PetscCall(VecPointwiseMult(descent.x, descent.load, descent.weight));
  PetscCall(VecNorm(descent.x, NORM_2, &descent.loads));
  whole = descent.force * descent.size;
  if (near) descent.balance = PetscMin(LATIN_DESCENT_BALANCE, LATIN_DESCENT_FORCES * descent.loads / whole);
  if (descent.loads > 0.0) heaviest = *heavier ? LATIN_DESCENT_HEAVY * descent.force * descent.size / descent.loads : 1.0;
  PetscCall(VecPointwiseDivide(descent.x, u, descent.weight));
  PetscCall(VecCopy(descent.x, descent.first));
  PetscCall(LatinDescentCreate_Private(&descent));
  PetscCall(LatinDescentRun_Private(&descent, heaviest));
  PetscCall(VecPointwiseMult(u, descent.weight, descent.x));
  *rests = (PetscBool)(descent.reason > 0);
  if (descent.tried) *heavier = PETSC_FALSE;
  PetscCall(TaoDestroy(&descent.tao));
  PetscCall(VecDestroy(&descent.start));
  PetscCall(VecDestroy(&descent.u));
  PetscCall(VecDestroy(&descent.more));
  PetscCall(VecDestroy(&descent.weight));
  PetscCall(VecDestroy(&descent.load));
  PetscCall(VecDestroy(&descent.first));
  PetscCall(VecDestroy(&descent.x));
  PetscFunctionReturn(0);
}
