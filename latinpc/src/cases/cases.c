#include "cases/latincases.h"

/*
   Nonlinear preconditioned conjugate gradients (J. W. Daniel 1967) for the energy of bars, cables and compression-only links, which is convex and piecewise
   quadratic. Preconditioner: the factor of the stiffness with all links taut. A stage of all lanes:

   1. The residual r = F - B^t tau at u, and the preconditioned residual w.
   2. With the tangent stiffness K at u, the errors are estimated by the correction (w.r / w.K w) w (snes/correction.c), divided by 1 - q: the sum of the
      corrections to come, at the slowest rate q of their energy norm so far. As w is computed anyway, this takes no stage of its own. A case is solved
      when these errors of displacements and tensions are small, and r relative to loads and tensions.
   3. Newton's step in the plane of w and the last direction, by directions that are conjugate under K.

   Without slack links the first step is the solution. Once no link changes between taut and slack, this is the CG of Newton's method without restarts.
   The caller solves the cases that fail here by other methods.
*/

#define LATIN_CASE_SAFETY 16.0 /* safety factor of the error estimate, which underestimates soft modes */
#define LATIN_CASE_PAST   4    /* least number of stages over which a rate of convergence is measured */
#define LATIN_CASE_RATE   0.98 /* largest rate q, and that after the first stage */

typedef struct {
  LatinStructure structure;
  LatinCaseLanes lanes;
  PetscInt      *place;                   /* [nodes][dim] row of each displacement component */
  PetscInt      *link;                    /* [links] of each link of the lanes, its number in the structure */
  PetscReal      loads[LATIN_CASE_LANES]; /* l2 norm of the loads */
  PetscReal     *pushed;                  /* [most stages + 1][lanes] w.r of each stage, over scale squared */
  LatinCase     *one[LATIN_CASE_LANES];   /* case of each lane, NULL: empty */
  Mat            K, F;                    /* stiffness with all links taut, its factor */
  KSP            ksp;
} LatinCases;

/* ---- data common to all cases ---- */

/* Factors the stiffness with all links taut. *fails: no usable factor */
static PetscErrorCode LatinCasesFactor_Private(LatinCases *cases, PetscBool *fails)
{
  LatinFactorStatus status = {.rounding = 0.0};
  PetscBool         ours;
  PC                pc;

  PetscFunctionBegin;
  PetscCall(DMCreateMatrix(cases->structure->dm, &cases->K));
  PetscCall(MatConvert(cases->K, MATAIJ, MAT_INPLACE_MATRIX, &cases->K)); /* overrides -dm_mat_type */
  PetscCall(MatGetFactorAvailable(cases->K, LATIN_CHOLESKY, MAT_FACTOR_CHOLESKY, &ours));
  *fails = (PetscBool)!ours; /* factors of other packages do not solve for lanes */
  if (*fails) PetscFunctionReturn(0);
  PetscCall(LatinStructureAssemble_Private(cases->structure, cases->structure->stiffness, cases->K));
  PetscCall(MatSetOption(cases->K, MAT_SPD, PETSC_TRUE));
  PetscCall(KSPCreate(PETSC_COMM_SELF, &cases->ksp));
  PetscCall(KSPSetType(cases->ksp, KSPPREONLY));
  PetscCall(KSPSetOperators(cases->ksp, cases->K, cases->K));
  PetscCall(KSPGetPC(cases->ksp, &pc));
  PetscCall(LatinDirectSolver_Private(pc, cases->K, LATIN_CHOLESKY));
  PetscCall(LatinCholeskyRound(pc, LATIN_ROUNDED));
  PetscCall(LatinFactor_Private(cases->ksp, cases->K, NULL, NULL, NULL, &status));
  PetscCall(VecDestroy(&status.mode));
  *fails = LatinFactorFailed(&status);
  if (!*fails) PetscCall(PCFactorGetMatrix(pc, &cases->F));
  PetscFunctionReturn(0);
}

/* Computes place, the rows: free components in the order of the factor, then prescribed ones */
static PetscErrorCode LatinCasesRows_Private(LatinCases *cases)
{
  const LatinStructure structure = cases->structure;
  const PetscInt      *order;
  PetscInt            *back, held;

  PetscFunctionBegin;
  PetscCall(MatGetSize(cases->K, &cases->lanes.free, NULL));
  held = cases->lanes.free;
  PetscCall(LatinCholeskyOrder(cases->F, &order));
  PetscCall(PetscMalloc1(cases->lanes.free, &back));
  for (PetscInt i = 0; i < cases->lanes.free; i++) back[order[i]] = i;
  for (PetscInt i = 0; i < cases->lanes.rows; i++) cases->place[i] = structure->global_dof[i] < 0 ? held++ : back[structure->global_dof[i]];
  PetscCall(PetscFree(back));
  PetscFunctionReturn(0);
}

/* Sets the links of the lanes, sorted by the first of their rows */
static PetscErrorCode LatinCasesLinks_Private(LatinCases *cases)
{
  const LatinStructure structure = cases->structure;
  LatinCaseLanes      *lanes     = &cases->lanes;
  PetscInt             dim       = lanes->dim, *first;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(lanes->links, &first));
  for (PetscInt l = 0; l < lanes->links; l++) {
    first[l]       = PetscMin(cases->place[dim * structure->nodes[2 * l]], cases->place[dim * structure->nodes[2 * l + 1]]);
    cases->link[l] = l;
  }
  PetscCall(PetscSortIntWithArray(lanes->links, first, cases->link));
  PetscCall(PetscFree(first));
  for (PetscInt k = 0; k < lanes->links; k++) {
    const PetscInt l = cases->link[k];

    for (PetscInt c = 0; c < 2 * dim; c++) lanes->row[2 * dim * k + c] = cases->place[dim * structure->nodes[2 * l + c / dim] + c % dim];
    for (PetscInt c = 0; c < dim; c++) lanes->direction[dim * k + c] = structure->direction[dim * l + c];
    lanes->stiffness[k] = structure->stiffness[l];
    lanes->sign[k]      = structure->law[l] == LATIN_LAW_BAR ? 0.0 : LatinLawSign(structure->law[l]);
  }
  PetscFunctionReturn(0);
}

/* Allocates and zeros the arrays of the lanes */
static PetscErrorCode LatinCasesRoom_Private(LatinCaseLanes *lanes)
{
  const size_t n = LATIN_CASE_LANES * (size_t)lanes->rows, m = LATIN_CASE_LANES * (size_t)lanes->links;
  const size_t bytes = (3 * n + m) * sizeof(PetscReal) + (2 * n + m) * sizeof(float);

  PetscFunctionBegin;
  PetscCall(LatinRoomCreate_Private(bytes, bytes, &lanes->room));
  memset(lanes->room, 0, bytes);
  lanes->load    = (PetscReal *)lanes->room;
  lanes->u       = lanes->load + n;
  lanes->r       = lanes->u + n;
  lanes->e0      = lanes->r + n;
  lanes->w       = (float *)(lanes->e0 + m);
  lanes->p       = lanes->w + n;
  lanes->tangent = lanes->p + n;
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) lanes->scale[w] = 1.0;
  PetscFunctionReturn(0);
}

/* Creates what all cases share. *fails: no usable factor; the caller destroys the cases all the same */
static PetscErrorCode LatinCasesCreate_Private(LatinStructure structure, PetscInt most, LatinCases *cases, PetscBool *fails)
{
  LatinCaseLanes *lanes = &cases->lanes;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(cases, sizeof(*cases)));
  cases->structure = structure;
  lanes->dim       = structure->dim;
  lanes->rows      = structure->dim * structure->nodes_local;
  lanes->links     = structure->links_local;
  PetscCall(LatinCasesFactor_Private(cases, fails));
  if (*fails) PetscFunctionReturn(0);
  PetscCall(PetscMalloc5(lanes->rows, &cases->place, lanes->links, &cases->link, 2 * lanes->dim * lanes->links, &lanes->row, lanes->dim * lanes->links, &lanes->direction, 2 * lanes->links, &lanes->stiffness));
  lanes->sign = lanes->stiffness + lanes->links;
  PetscCall(PetscCalloc1(LATIN_CASE_LANES * (most + 1), &cases->pushed));
  PetscCall(LatinCasesRows_Private(cases));
  PetscCall(LatinCasesLinks_Private(cases));
  PetscCall(LatinCasesRoom_Private(lanes));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCasesDestroy_Private(LatinCases *cases)
{
  LatinCaseLanes *lanes = &cases->lanes;

  PetscFunctionBegin;
  PetscCall(KSPDestroy(&cases->ksp));
  PetscCall(MatDestroy(&cases->K));
  PetscCall(PetscFree5(cases->place, cases->link, lanes->row, lanes->direction, lanes->stiffness));
  PetscCall(PetscFree(cases->pushed));
  PetscCall(LatinRoomDestroy_Private(&lanes->room));
  PetscFunctionReturn(0);
}

/* ---- a lane, w ---- */

/* Starts a case in a lane, from displacements zero where they are free; one NULL: empties the lane */
static void LatinCasesStart(LatinCases *cases, PetscInt w, LatinCase *one)
{
  const LatinStructure structure = cases->structure;
  LatinCaseLanes      *lanes     = &cases->lanes;
  const PetscBool      fails     = (PetscBool)(cases->one[w] && cases->one[w]->stages < 0);
  PetscReal            sum = 0.0, most = 0.0;

  cases->one[w] = one;
  lanes->uu[w]  = 0.0;
  for (PetscInt i = 0; i < lanes->rows; i++) {
    const size_t    at   = LATIN_CASE_LANES * (size_t)cases->place[i] + (size_t)w;
    const PetscBool free = (PetscBool)(structure->global_dof[i] >= 0);

    lanes->load[at] = one && free ? structure->force[i] + (one->load ? one->load[i] : 0.0) : 0.0;
    lanes->u[at]    = one && !free ? structure->prescribed[i] + (one->prescribed ? one->prescribed[i] : 0.0) : 0.0;
    if (fails) lanes->p[at] = 0.0; /* may be NaN; other values do not matter, as beta is 0 in the first step */
    sum += PetscSqr(lanes->load[at]);
    most = PetscMax(most, PetscAbsReal(lanes->load[at]));
  }
  for (PetscInt k = 0; k < lanes->links; k++) {
    const PetscInt l = cases->link[k];

    lanes->e0[LATIN_CASE_LANES * (size_t)k + (size_t)w] = one ? structure->e0[l] + (one->e0 ? one->e0[l] : 0.0) : 0.0;
  }
  cases->loads[w] = most > 0.0 && most < LATIN_LEAST ? INFINITY : PetscSqrtReal(sum); /* INFINITY: squares of the loads underflow; not solved here */
}

/* Copies displacements and tensions of a lane to its case. Returns whether free displacements are larger than `far` */
static PetscBool LatinCasesGive(const LatinCases *cases, PetscInt w, PetscReal far)
{
  const LatinStructure  structure = cases->structure;
  const LatinCaseLanes *lanes     = &cases->lanes;
  const PetscInt        dim       = lanes->dim;
  LatinCase            *one       = cases->one[w];
  PetscReal             most      = 0.0;

  for (PetscInt i = 0; i < lanes->rows; i++) {
    one->displacement[i] = lanes->u[LATIN_CASE_LANES * (size_t)cases->place[i] + (size_t)w];
    if (structure->global_dof[i] >= 0) most = PetscMax(most, PetscAbsReal(one->displacement[i]));
  }
  for (PetscInt l = 0; l < lanes->links; l++) {
    const PetscReal *n = structure->direction + dim * l, *from = one->displacement + dim * structure->nodes[2 * l], *to = one->displacement + dim * structure->nodes[2 * l + 1];
    PetscReal        x = structure->e0[l] + (one->e0 ? one->e0[l] : 0.0);

    for (PetscInt c = 0; c < dim; c++) x += n[c] * (to[c] - from[c]);
    one->tension[l] = LatinStructureTension(structure, NULL, l, x);
  }
  return (PetscBool)(most > far);
}

/* ---- a stage ---- */

/* Returns the slowest rate of convergence of a lane's corrections in the energy norm, over LATIN_CASE_PAST or more stages that end with the last one */
static PetscReal LatinCasesRate(const LatinCases *cases, PetscInt w)
{
  const PetscInt   last = cases->one[w]->stages - 1, first = PetscMin(last, LATIN_CASE_PAST);
  const PetscReal *pushed = cases->pushed + w;
  PetscReal        rate   = 0.0;

  for (PetscInt k = PetscMax(first, 1); k <= last; k++) rate = PetscMax(rate, PetscPowReal(pushed[LATIN_CASE_LANES * last] / pushed[LATIN_CASE_LANES * (last - k)], 0.5 / (PetscReal)k));
  return last ? PetscMin(rate, LATIN_CASE_RATE) : LATIN_CASE_RATE;
}

/* Whether the case of a lane is solved. Sets its error estimates */
static PetscBool LatinCasesSolved(const LatinCases *cases, const LatinCaseGoal *goal, PetscInt w)
{
  const LatinCaseLanes *lanes = &cases->lanes;
  LatinCase            *one   = cases->one[w];
  const PetscReal       part = LATIN_CASE_SAFETY * lanes->scale[w] * lanes->rw[w] / lanes->wkw[w] / (1.0 - LatinCasesRate(cases, w)), left = lanes->scale[w] * PetscSqrtReal(lanes->rr[w]), tension = PetscSqrtReal(lanes->all[w]);
  PetscReal             balance = goal->unbalance;

  if (PetscIsInfOrNanReal(cases->loads[w])) return PETSC_FALSE;
  if (left == 0.0) {
    one->error = one->tensions = one->unbalance = 0.0;
    return PETSC_TRUE;
  }
  if (cases->loads[w] > 0.0) balance = PetscMin(balance, goal->balance * cases->loads[w]);
  if (tension > 0.0) balance = PetscMin(balance, goal->error * tension);
  one->error     = part * PetscSqrtReal(lanes->ww[w] / lanes->uu[w]);
  one->tensions  = tension > 0.0 ? part * PetscSqrtReal(lanes->tension[w]) / tension : 0.0;
  one->unbalance = cases->loads[w] > 0.0 ? left / cases->loads[w] : 0.0;
  return (PetscBool)(lanes->wkw[w] > 0.0 && one->error <= goal->error && one->tensions <= goal->tensions && left <= balance);
}

/*
   Sets the step of a lane, alpha (w + beta p): w is made conjugate to p under the tangent stiffness; a step along p is added if r has a component there,
   as after links have changed. If this is not a descent direction, the step is along w, which always is
*/
static void LatinCasesStep(LatinCaseLanes *lanes, PetscInt w, PetscBool first)
{
  const PetscReal old = lanes->pkp[w] > 0.0 && !first ? lanes->wkp[w] / lanes->pkp[w] : 0.0, bend = lanes->wkw[w] - old * lanes->wkp[w], pushed = lanes->rw[w] - old * lanes->rp[w];

  if (first || !(pushed > 0.0) || !(bend > 0.0)) {
    lanes->alpha[w] = first ? 1.0 : lanes->rw[w] / lanes->wkw[w]; /* first step: 1, as no link may be taut yet */
    lanes->beta[w]  = 0.0;
    return;
  }
  lanes->alpha[w] = pushed / bend;
  lanes->beta[w]  = -old + (lanes->pkp[w] > 0.0 ? lanes->rp[w] / lanes->pkp[w] / lanes->alpha[w] : 0.0);
}

/* Sets the step of each lane after the sweeps of a stage; ends[w]: its case is solved or given up, with stages -1 */
static void LatinCasesDecide(LatinCases *cases, const LatinCaseGoal *goal, PetscBool ends[])
{
  LatinCaseLanes *lanes = &cases->lanes;

  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
    LatinCase *one = cases->one[w];

    ends[w]         = PETSC_FALSE;
    lanes->alpha[w] = lanes->beta[w] = 0.0;
    if (!one) continue;
    cases->pushed[LATIN_CASE_LANES * one->stages++ + w] = lanes->rw[w];
    ends[w]                                             = LatinCasesSolved(cases, goal, w);
    if (ends[w]) {
      if (LatinCasesGive(cases, w, goal->far)) one->stages = -1;
      continue;
    }
    LatinCasesStep(lanes, w, (PetscBool)(one->stages == 1));
    if (one->stages < goal->most && lanes->alpha[w] > 0.0 && !PetscIsInfOrNanReal(lanes->alpha[w])) continue; /* false for NaN */
    lanes->alpha[w] = lanes->beta[w] = 0.0;
    ends[w]                          = PETSC_TRUE;
    one->stages                      = -1;
  }
}

/* Takes one stage of all lanes; ends[w]: the case of this lane has ended */
static PetscErrorCode LatinCasesStage_Private(LatinCases *cases, const LatinCaseGoal *goal, PetscBool ends[])
{
  LatinCaseLanes *lanes = &cases->lanes;

  PetscFunctionBegin;
  LatinCasesForces(lanes);
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
    if (!cases->one[w] || cases->one[w]->stages) continue;
    lanes->scale[w] = cases->loads[w] + PetscSqrtReal(lanes->all[w]);
    if (!(lanes->scale[w] > 0.0)) lanes->scale[w] = 1.0;
  }
  LatinCasesRound(lanes);
  PetscCall(LatinCholeskySolveLanes(cases->F, lanes->w, lanes->rw, lanes->ww));
  LatinCasesResistance(lanes);
  LatinCasesDecide(cases, goal, ends);
  LatinCasesMove(lanes);
  PetscFunctionReturn(0);
}

/*
   Solves n cases of a structure on one rank, which is set up and has bars, cables and compression-only links of fixed directions alone. A case that is
   not solved has negative stages and undefined results
*/
PetscErrorCode LatinCasesSolve_Private(LatinStructure structure, const LatinCaseGoal *goal, PetscInt n, LatinCase one[])
{
  PetscInt   next = 0, busy = 0;
  PetscBool  fails = PETSC_FALSE, ends[LATIN_CASE_LANES];
  LatinCases cases;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Cases, structure, 0, 0, 0));
  for (PetscInt i = 0; i < n; i++) one[i].stages = -1;
  PetscCall(LatinCasesCreate_Private(structure, goal->most, &cases, &fails));
  for (PetscInt w = 0; w < LATIN_CASE_LANES && next < n && !fails; w++, busy++) {
    one[next].stages = 0;
    LatinCasesStart(&cases, w, &one[next++]);
  }
  while (busy) {
    PetscCall(LatinCasesStage_Private(&cases, goal, ends));
    for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
      if (!ends[w]) continue;
      if (next < n) one[next].stages = 0;
      else busy--;
      LatinCasesStart(&cases, w, next < n ? &one[next] : NULL);
      if (next < n) next++;
    }
  }
  PetscCall(LatinCasesDestroy_Private(&cases));
  PetscCall(PetscLogEventEnd(LATIN_Cases, structure, 0, 0, 0));
  PetscFunctionReturn(0);
}
