#include "snes/sneslatinimpl.h"
#include <petsctao.h>

/*
   Minimises the potential energy by Newton's method in a trust region (PETSc's TAO). Its conjugate gradients follow negative curvature
   to the edge of the region [T. Steihaug 1983]. The path of the loads starts at this minimum if the drawing is no stable state. If the
   iterates move away from the drawing without bound, the structure has no stable state.

   The unknowns are displacements over the size of the structure, each scaled by the root of the stiffness of the links at its node: units,
   rotations and subdomains do not change the result. There is no other preconditioner at first, whose subdomains would shape the trust region. But in a narrow valley
   in which cables slacken and tighten steps then become too short: last the operators of Newton's method precondition, which let steps be as long as links give.

   If the loads are small beside the stiffness, the energy has a narrow valley, in which all steps are short. Where loads pull bars tight these are solved
   for as cables, whose energy is convex (snes/largeconvex.c). Else larger loads lead to the same
   state but for elongations: the descent begins with these, and reduces them.
*/

#define LATIN_DESCENT_RADIUS  0.1                           /* of the size of the structure: the first step */
#define LATIN_DESCENT_BALANCE LatinByPrecision(1e-12, 1e-5) /* of the stiffness times the size: forces that are left; Newton's method goes on from there */
#define LATIN_DESCENT_RTOL    1e-3                          /* of a linear solve */
#define LATIN_DESCENT_SOON    30                            /* steps in which the loads themselves lead somewhere, or too slowly; with 200 rotations and units change which state towers find */
#define LATIN_DESCENT_STEPS   1000                          /* most steps under heavier loads, and as these fall */
#define LATIN_DESCENT_HEAVY   0.1                           /* of the stiffness times the size: the heaviest loads */
#define LATIN_DESCENT_LIGHTER 10.0                          /* times as light as the ones before: the next loads */
#define LATIN_DESCENT_AWAY    0.05                          /* of the size of the structure: further from where a descent is to stay near it snaps through */

typedef struct {
  SNES           snes;
  LatinStructure structure;
  Vec            load, weight; /* the loads, those of snes included; what an unknown is as displacement: the size times the root of the mean stiffness over that at the node */
  Vec            u, more;      /* work vectors */
  PetscReal      force, size;  /* the mean stiffness times the size of the structure; this */
  PetscReal      times;        /* the loads act */
  PetscBool      near;         /* it is to stay near where it begins, with the operators there */
  PC             pc;           /* these operators */
  Vec            start;        /* where it begins */
  PetscInt       most;         /* steps */
  PetscBool      tried;        /* heavier loads have been */
  PetscBool      renews;       /* the operators are made anew for each step */
} LatinDescent;

/* Weights of the displacements of each node, the mean stiffness. Collective on descent->structure */
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
  PetscCall(VecShift(descent->weight, PETSC_MACHINE_EPSILON * mean)); /* nodes without links */
  PetscCall(VecPow(descent->weight, -0.5));
  PetscCall(VecScale(descent->weight, descent->size * PetscSqrtReal(mean)));
  PetscFunctionReturn(0);
}

/* The energy over the mean stiffness times the square of the size, and its gradient */
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
  *energy = (*energy + PetscRealPart(work)) / (descent->force * descent->size);
  PetscCall(LatinTurningResidual_Private(structure, NULL, descent->u, gradient));
  PetscCall(VecAXPY(gradient, 1.0, descent->more));
  PetscCall(VecPointwiseMult(gradient, gradient, descent->weight));
  PetscCall(VecScale(gradient, 1.0 / (descent->force * descent->size)));
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
  PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY)); /* without the weights of the last step */
  PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatDiagonalScale(A, descent->weight, descent->weight));
  PetscCall(MatScale(A, 1.0 / (descent->force * descent->size)));
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
  if (left <= LATIN_DESCENT_BALANCE) PetscCall(TaoSetConvergedReason(tao, TAO_CONVERGED_GATOL));
  else if (far > LATIN_LARGE_NOWHERE || away > LATIN_DESCENT_AWAY * descent->size) PetscCall(TaoSetConvergedReason(tao, TAO_DIVERGED_USER));
  else if (it >= descent->most) PetscCall(TaoSetConvergedReason(tao, TAO_DIVERGED_MAXITS));
  else if (it && radius <= PETSC_MACHINE_EPSILON) PetscCall(TaoSetConvergedReason(tao, TAO_CONVERGED_STEPTOL));
  else PetscCall(TaoSetConvergedReason(tao, TAO_CONTINUE_ITERATING));
  PetscFunctionReturn(0);
}

/* What of TAO options alone set: the first radius is the one given, and energies are compared down to their rounding. Collective on tao */
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

/* The operators of Newton's method, in the unknowns of the descent */
static PetscErrorCode LatinDescentPrecondition_Private(PC pc, Vec r, Vec z)
{
  LatinDescent *descent;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(pc, &descent));
  PetscCall(VecPointwiseDivide(descent->u, r, descent->weight));
  PetscCall(PCApply(descent->pc, descent->u, z));
  PetscCall(VecPointwiseDivide(z, z, descent->weight));
  PetscCall(VecScale(z, descent->force * descent->size));
  PetscFunctionReturn(0);
}

/* These operators precondition the linear solves, and give the trust region its norm. Collective on tao */
static PetscErrorCode LatinDescentOperators_Private(LatinDescent *descent, Tao tao)
{
  KSP ksp;
  PC  pc;

  PetscFunctionBegin;
  PetscCall(TaoGetKSP(tao, &ksp));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetContext(pc, descent));
  PetscCall(PCShellSetApply(pc, LatinDescentPrecondition_Private));
  PetscFunctionReturn(0);
}

/* TAO and what it needs. Collective on snes */
static PetscErrorCode LatinDescentCreate_Private(SNES snes, LatinDescent *descent, Vec x, Tao *tao)
{
  KSP ksp;
  PC  pc;
  Mat A;

  PetscFunctionBegin;
  PetscCall(LatinTurningMatCreate_Private(descent->structure, &A));
  PetscCall(TaoCreate(PetscObjectComm((PetscObject)snes), tao));
  PetscCall(TaoSetType(*tao, TAONTR));
  PetscCall(TaoSetSolution(*tao, x));
  PetscCall(TaoSetObjectiveAndGradient(*tao, NULL, LatinDescentEnergy_Private, descent));
  PetscCall(TaoSetHessian(*tao, A, A, LatinDescentTangent_Private, descent));
  PetscCall(PetscObjectDereference((PetscObject)A));
  PetscCall(TaoSetConvergenceTest(*tao, LatinDescentConverged_Private, descent));
  PetscCall(TaoSetInitialTrustRegionRadius(*tao, LATIN_DESCENT_RADIUS));
  PetscCall(LatinDescentOptions_Private(*tao, snes));
  PetscCall(TaoGetKSP(*tao, &ksp));
  PetscCall(KSPSetType(ksp, KSPSTCG));
  PetscCall(KSPSetTolerances(ksp, LATIN_DESCENT_RTOL, 0.0, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCNONE));
  if (descent->near) PetscCall(LatinDescentOperators_Private(descent, *tao));
  PetscFunctionReturn(0);
}

/* Is the energy under the loads themselves higher at x than at the start? */
static PetscErrorCode LatinDescentUp_Private(Tao tao, LatinDescent *descent, Vec start, Vec x, PetscBool *up)
{
  PetscReal from, to;
  Vec       g;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(x, &g));
  PetscCall(LatinDescentEnergy_Private(tao, start, &from, g, descent));
  PetscCall(LatinDescentEnergy_Private(tao, x, &to, g, descent));
  PetscCall(VecDestroy(&g));
  *up = (PetscBool)(to > from);
  PetscFunctionReturn(0);
}

/*
   Down the energy from x. Where the loads themselves take too long, and do not pull all links tight, heavier ones are tried, if any, the heaviest first, and lighter ones
   where these lead away; from what is found they fall. Heavier ones may have snapped the structure through: where that is up the energy, the loads themselves get as many steps. Where these do
   not suffice, or nothing is found as loads fall, they get as many with operators made anew for each. heaviest: 0 without loads. *reason: of the last descent. Collective on snes
*/
static PetscErrorCode LatinDescentRun_Private(SNES snes, Tao tao, LatinDescent *descent, PetscReal heaviest, Vec x, TaoConvergedReason *reason)
{
  PetscBool first = PETSC_TRUE, falls = PETSC_FALSE, done = PETSC_FALSE, taut = PETSC_FALSE, again = PETSC_FALSE;
  PetscInt  steps;
  Vec       start;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(x, &start));
  PetscCall(VecCopy(x, start));
  descent->times = 1.0;
  descent->most  = descent->near || heaviest <= 1.0 ? LATIN_DESCENT_STEPS : LATIN_DESCENT_SOON;
  while (!done) {
    if (descent->times > 1.0) descent->tried = PETSC_TRUE;
    PetscCall(TaoSolve(tao));
    PetscCall(TaoGetConvergedReason(tao, reason));
    PetscCall(TaoGetIterationNumber(tao, &steps));
    PetscCall(PetscInfo(snes, "Down the energy, %g times the loads: %s after %" PetscInt_FMT " steps\n", (double)descent->times, TaoConvergedReasons[*reason], steps));
    if (first && heaviest > 0.0 && *reason == TAO_DIVERGED_MAXITS && !descent->near) PetscCall(SNESLatinLargeTaut_Private(snes, descent->u, &taut));
    if (taut) {
      PetscCall(VecPointwiseDivide(x, descent->u, descent->weight));
      *reason = TAO_CONVERGED_USER;
      break;
    }
    done = (PetscBool)(first ? *reason != TAO_DIVERGED_MAXITS || heaviest <= 1.0 : descent->times == 1.0 || (falls && *reason < 0));
    if (done && heaviest > 0.0 && !descent->near && !descent->renews) {
      descent->renews = (PetscBool)(*reason == TAO_DIVERGED_MAXITS || (*reason < 0 && descent->times > 1.0));
      if (descent->renews) PetscCall(LatinDescentOperators_Private(descent, tao));
      else if (*reason > 0 && !first && !again) PetscCall(LatinDescentUp_Private(tao, descent, start, x, &again));
      else again = PETSC_FALSE;
      done = (PetscBool) !(again || descent->renews);
      if (!done) PetscCall(VecCopy(start, x));
      if (!done) descent->times = 1.0;
    }
    if (*reason > 0) falls = PETSC_TRUE;
    else PetscCall(VecCopy(start, x));
    descent->times = PetscMax(1.0, first ? heaviest : descent->times / LATIN_DESCENT_LIGHTER);
    descent->most  = LATIN_DESCENT_STEPS;
    first          = PETSC_FALSE;
  }
  PetscCall(VecDestroy(&start));
  PetscFunctionReturn(0);
}

/* From u down to a state in balance under the loads of snes, if *rests; else u stays. near: it is to stay near u, with the operators there are. *heavier: heavier loads may lead there; these are the same for every part of the loads, and tried once. Collective on snes */
PetscErrorCode SNESLatinLargeDescend_Private(SNES snes, PetscBool near, PetscBool *heavier, Vec u, PetscBool *rests)
{
  const LatinLarge  *large   = &((SNES_Latin *)snes->data)->large;
  LatinDescent       descent = {.snes = snes, .structure = large->frame->turns, .size = large->size, .near = near};
  PetscReal          loads;
  TaoConvergedReason reason;
  Tao                tao;
  Vec                x;
  KSP                ksp;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(u, &x));
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
  PetscCall(VecPointwiseMult(x, descent.load, descent.weight));
  PetscCall(VecNorm(x, NORM_2, &loads));
  PetscCall(VecPointwiseDivide(x, u, descent.weight));
  PetscCall(LatinDescentCreate_Private(snes, &descent, x, &tao));
  PetscCall(LatinDescentRun_Private(snes, tao, &descent, !(loads > 0.0) ? 0.0 : *heavier ? LATIN_DESCENT_HEAVY * descent.force * descent.size / loads : 1.0, x, &reason));
  PetscCall(VecPointwiseMult(u, descent.weight, x));
  *rests = (PetscBool)(reason > 0);
  if (descent.tried) *heavier = PETSC_FALSE;
  PetscCall(TaoDestroy(&tao));
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&descent.start));
  PetscCall(VecDestroy(&descent.u));
  PetscCall(VecDestroy(&descent.more));
  PetscCall(VecDestroy(&descent.weight));
  PetscCall(VecDestroy(&descent.load));
  PetscFunctionReturn(0);
}
