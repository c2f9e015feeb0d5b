#include "cases/latincases.h"

/*
   Conjugate gradients for the energy of a structure of bars, cables and compression-only links, which is convex and
   piecewise quadratic: E. Polak and G. Ribiere's directions, of the answers w = K^-1 r of the factor of the stiffness K with
   all links taut, and Newton's step along each. Without slack links the first step is the solution; as soon as links no
   longer change they are the conjugate gradients of Newton's method, without a start anew for each of its steps.

   A case is solved when the forces r that are without balance are small beside loads and tensions, and so is the error of
   displacements and of tensions. That is the correction that r asks for, (w.r / w.K w) w with the tangent stiffness
   (snes/correction.c), over 1 - q, the sum of those that would follow at the slowest rate q that the energy of the
   corrections has shown. As w is computed anyway, the proof costs no stage of its own. What is not solved so is left to the caller.
*/

#define LATIN_CASE_SAFETY 16.0 /* on the error that a correction shows: it hides soft modes */
#define LATIN_CASE_PAST   4    /* stages over which a rate of convergence is measured, at least */
#define LATIN_CASE_RATE   0.98 /* no rate above it is believed */

typedef struct {
  LatinStructure structure;
  LatinCaseLinks links;
  PetscInt       dofs, rows;
  PetscInt      *row;                     /* [rows] of K: the entry of the node arrays */
  PetscReal     *load, *before;           /* [nodes][dim][lanes] loads, forces without balance one stage ago */
  PetscReal      loads[LATIN_CASE_LANES]; /* norm of the loads */
  PetscReal      size[LATIN_CASE_LANES];  /* norm of the displacements */
  PetscReal     *pushed;                  /* [most stages of a case + 1][lanes] w.r of each stage of the case */
  LatinCase     *lane[LATIN_CASE_LANES];  /* NULL: empty */
  Mat            K, F;
  KSP            ksp;
} LatinCases;

/* ---- what all cases share ---- */

/* The factor of the stiffness with all links taut; *fails: there is none that serves */
static PetscErrorCode LatinCasesFactor_Private(LatinCases *cases, PetscBool *fails)
{
  LatinFactorStatus status = {.rounding = 0.0};
  PC                pc;

  PetscFunctionBegin;
  PetscCall(DMCreateMatrix(cases->structure->dm, &cases->K));
  PetscCall(MatConvert(cases->K, MATAIJ, MAT_INPLACE_MATRIX, &cases->K)); /* whatever -dm_mat_type says */
  PetscCall(LatinStructureAssemble_Private(cases->structure, cases->structure->stiffness, cases->K));
  PetscCall(MatSetOption(cases->K, MAT_SPD, PETSC_TRUE));
  PetscCall(KSPCreate(PETSC_COMM_SELF, &cases->ksp));
  PetscCall(KSPSetType(cases->ksp, KSPPREONLY));
  PetscCall(KSPSetOperators(cases->ksp, cases->K, cases->K));
  PetscCall(KSPGetPC(cases->ksp, &pc));
  PetscCall(LatinDirectSolver_Private(pc, cases->K, LATIN_CHOLESKY));
  PetscCall(LatinCholeskyRound(pc, PETSC_TRUE));
  PetscCall(LatinFactor_Private(cases->ksp, cases->K, NULL, NULL, PETSC_FALSE, &status));
  PetscCall(VecDestroy(&status.mode));
  *fails = LatinFactorFailed(&status);
  if (!*fails) PetscCall(PCFactorGetMatrix(pc, &cases->F));
  PetscFunctionReturn(0);
}

/* Laws, numbering, and empty lanes */
static PetscErrorCode LatinCasesCreate_Private(LatinStructure structure, PetscInt most, LatinCases *cases)
{
  LatinCaseLinks *links = &cases->links;
  size_t          n, m;

  PetscFunctionBegin;
  PetscCall(PetscMemzero(cases, sizeof(*cases)));
  cases->structure = structure;
  cases->dofs      = structure->dim * structure->nodes_local;
  links->dim       = structure->dim;
  links->links     = structure->links_local;
  links->ends      = structure->nodes;
  links->direction = structure->direction;
  links->stiffness = structure->stiffness;
  n                = LATIN_CASE_LANES * (size_t)cases->dofs;
  m                = LATIN_CASE_LANES * (size_t)links->links;
  PetscCall(PetscMalloc2(cases->dofs, &cases->row, links->links, &links->sign));
  PetscCall(PetscCalloc6(n, &links->u, n, &links->w, n, &links->p, n, &links->r, n, &cases->load, n, &cases->before));
  PetscCall(PetscCalloc3(m, &links->e0, m, &links->tangent, LATIN_CASE_LANES * most, &cases->pushed));
  for (PetscInt l = 0; l < links->links; l++) links->sign[l] = structure->law[l] == LATIN_LAW_BAR ? 0.0 : LatinLawSign(structure->law[l]);
  for (PetscInt i = 0; i < cases->dofs; i++) {
    if (structure->global_dof[i] < 0) continue;
    cases->row[structure->global_dof[i]] = i;
    cases->rows++;
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinCasesDestroy_Private(LatinCases *cases)
{
  LatinCaseLinks *links = &cases->links;

  PetscFunctionBegin;
  PetscCall(KSPDestroy(&cases->ksp));
  PetscCall(MatDestroy(&cases->K));
  PetscCall(PetscFree2(cases->row, links->sign));
  PetscCall(PetscFree6(links->u, links->w, links->p, links->r, cases->load, cases->before));
  PetscCall(PetscFree3(links->e0, links->tangent, cases->pushed));
  PetscFunctionReturn(0);
}

/* ---- a lane ---- */

/* The actions of a case, and no displacement but those prescribed; one NULL empties the lane */
static void LatinCasesStart(LatinCases *cases, PetscInt w, LatinCase *one)
{
  const LatinStructure structure = cases->structure;
  LatinCaseLinks      *links     = &cases->links;
  PetscReal            sum       = 0.0;

  cases->lane[w] = one;
  cases->size[w] = 0.0;
  for (PetscInt i = 0, at = w; i < cases->dofs; i++, at += LATIN_CASE_LANES) {
    const PetscBool free = (PetscBool)(structure->global_dof[i] >= 0);

    cases->load[at] = one && free ? structure->force[i] + (one->load ? one->load[i] : 0.0) : 0.0;
    links->u[at]    = one && !free ? structure->prescribed[i] + (one->prescribed ? one->prescribed[i] : 0.0) : 0.0;
    links->p[at] = links->r[at] = links->w[at] = 0.0;
    sum += PetscSqr(cases->load[at]);
  }
  for (PetscInt l = 0, at = w; l < links->links; l++, at += LATIN_CASE_LANES) links->e0[at] = one ? structure->e0[l] + (one->e0 ? one->e0[l] : 0.0) : 0.0;
  cases->loads[w] = PetscSqrtReal(sum);
}

/* Displacements and tensions of a lane to its case, and whether they are larger than the structure */
static PetscBool LatinCasesGive(const LatinCases *cases, PetscInt w, PetscReal far)
{
  const LatinCaseLinks *links = &cases->links;
  const PetscInt        dim   = links->dim;
  LatinCase            *one   = cases->lane[w];
  PetscReal             most  = 0.0;

  for (PetscInt i = 0; i < cases->dofs; i++) {
    one->displacement[i] = links->u[LATIN_CASE_LANES * i + w];
    if (cases->structure->global_dof[i] >= 0) most = PetscMax(most, PetscAbsReal(one->displacement[i]));
  }
  for (PetscInt l = 0; l < links->links; l++) {
    const PetscReal *n = links->direction + dim * l, *from = one->displacement + dim * links->ends[2 * l], *to = one->displacement + dim * links->ends[2 * l + 1];
    PetscReal        x = links->e0[LATIN_CASE_LANES * l + w];

    for (PetscInt c = 0; c < dim; c++) x += n[c] * (to[c] - from[c]);
    one->tension[l] = LatinStructureTension(cases->structure, NULL, l, x);
  }
  return (PetscBool)(most > far);
}

/* ---- a stage ---- */

/* Sums over the rows of K of every lane */
typedef struct {
  PetscReal rr[LATIN_CASE_LANES], rw[LATIN_CASE_LANES], ww[LATIN_CASE_LANES], bw[LATIN_CASE_LANES], rp[LATIN_CASE_LANES], uu[LATIN_CASE_LANES];
} LatinCaseSums;

/* Norms of the forces without balance, by which the solves scale them */
static void LatinCasesNorms(const LatinCases *cases, LatinCaseSums *sum, PetscReal scale[])
{
  PetscReal rr[LATIN_CASE_LANES] = {0.0};

  for (PetscInt i = 0; i < cases->dofs; i++) {
    const PetscReal *r = cases->links.r + LATIN_CASE_LANES * i;

    if (cases->structure->global_dof[i] < 0) continue;
    for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) rr[w] += r[w] * r[w];
  }
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) sum->rr[w] = rr[w];
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) scale[w] = rr[w] > 0.0 ? PetscSqrtReal(rr[w]) : 1.0;
}

/* The other sums; held entries of w and p are zero */
static void LatinCasesSums(const LatinCases *cases, LatinCaseSums *sum)
{
  PetscReal rw[LATIN_CASE_LANES] = {0.0}, ww[LATIN_CASE_LANES] = {0.0}, bw[LATIN_CASE_LANES] = {0.0}, rp[LATIN_CASE_LANES] = {0.0};

  for (PetscInt i = 0; i < cases->dofs; i++) {
    const PetscReal *r = cases->links.r + LATIN_CASE_LANES * i, *a = cases->links.w + LATIN_CASE_LANES * i, *p = cases->links.p + LATIN_CASE_LANES * i, *b = cases->before + LATIN_CASE_LANES * i;

    for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
      rw[w] += r[w] * a[w];
      ww[w] += a[w] * a[w];
      bw[w] += b[w] * a[w];
      rp[w] += r[w] * p[w];
    }
  }
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
    sum->rw[w] = rw[w];
    sum->ww[w] = ww[w];
    sum->bw[w] = bw[w];
    sum->rp[w] = rp[w];
  }
}

/* p = w + beta p, u += alpha p, and the norm of u */
static void LatinCasesMove(LatinCases *cases, const PetscReal alpha[])
{
  PetscReal sum[LATIN_CASE_LANES] = {0.0};

  for (PetscInt i = 0; i < cases->dofs; i++) {
    PetscReal *u = cases->links.u + LATIN_CASE_LANES * i, *a = cases->links.w + LATIN_CASE_LANES * i, *p = cases->links.p + LATIN_CASE_LANES * i;

    if (cases->structure->global_dof[i] < 0) continue;
    for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
      p[w] = a[w] + cases->links.beta[w] * p[w];
      u[w] += alpha[w] * p[w];
      sum[w] += u[w] * u[w];
    }
  }
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) cases->size[w] = PetscSqrtReal(sum[w]);
}

/* The slowest rate at which the energy norm of the corrections of a lane has come down to what it is, from any stage before the last few */
static PetscReal LatinCasesRate(const LatinCases *cases, PetscInt w)
{
  const PetscInt   last = cases->lane[w]->stages - 1, first = PetscMin(last, LATIN_CASE_PAST);
  const PetscReal *pushed = cases->pushed + w;
  PetscReal        rate   = 0.0;

  for (PetscInt k = PetscMax(first, 1); k <= last; k++) rate = PetscMax(rate, PetscPowReal(pushed[LATIN_CASE_LANES * last] / pushed[LATIN_CASE_LANES * (last - k)], 0.5 / (PetscReal)k));
  return last ? PetscMin(rate, LATIN_CASE_RATE) : LATIN_CASE_RATE;
}

/* Is the case of a lane solved? Notes what its displacements are known to be worth */
static PetscBool LatinCasesSolved(const LatinCases *cases, const LatinCaseGoal *goal, const LatinCaseSums *sum, PetscInt w)
{
  const LatinCaseLinks *links = &cases->links;
  LatinCase            *one   = cases->lane[w];
  const PetscReal       part = LATIN_CASE_SAFETY * sum->rw[w] / links->work[w] / (1.0 - LatinCasesRate(cases, w)), left = PetscSqrtReal(sum->rr[w]), tension = PetscSqrtReal(links->all[w]);
  PetscReal             balance = goal->unbalance;

  if (left == 0.0) {
    one->error = one->tensions = one->unbalance = 0.0;
    return PETSC_TRUE;
  }
  if (cases->loads[w] > 0.0) balance = PetscMin(balance, goal->balance * cases->loads[w]);
  if (tension > 0.0) balance = PetscMin(balance, goal->error * tension);
  one->error     = part * PetscSqrtReal(sum->ww[w]) / cases->size[w];
  one->tensions  = tension > 0.0 ? part * PetscSqrtReal(links->tension[w]) / tension : 0.0;
  one->unbalance = cases->loads[w] > 0.0 ? left / cases->loads[w] : 0.0;
  return (PetscBool)(links->work[w] > 0.0 && one->error <= goal->error && one->tensions <= goal->tensions && left <= balance);
}

/* A stage more of each lane, and how much of its last direction is in the next one */
static void LatinCasesTurn(LatinCases *cases, const LatinCaseSums *sum)
{
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
    PetscReal *pushed = cases->lane[w] ? cases->pushed + LATIN_CASE_LANES * cases->lane[w]->stages++ + w : NULL;

    if (pushed) *pushed = sum->rw[w];
    cases->links.beta[w] = pushed && cases->lane[w]->stages > 1 && pushed[-LATIN_CASE_LANES] > 0.0 ? PetscMax(0.0, (sum->rw[w] - sum->bw[w]) / pushed[-LATIN_CASE_LANES]) : 0.0;
  }
}

/* The decisions after the sweeps of a stage: the length of the step of each lane, and which lanes are solved or given up */
static void LatinCasesDecide(LatinCases *cases, const LatinCaseGoal *goal, const LatinCaseSums *sum, PetscReal alpha[], PetscBool ends[])
{
  for (PetscInt w = 0; w < LATIN_CASE_LANES; w++) {
    LatinCase *one    = cases->lane[w];
    PetscReal  pushed = sum->rw[w] + cases->links.beta[w] * sum->rp[w], bend = cases->links.bend[w];

    ends[w]  = PETSC_FALSE;
    alpha[w] = 0.0;
    if (!one) continue;
    ends[w] = LatinCasesSolved(cases, goal, sum, w);
    if (ends[w]) {
      if (LatinCasesGive(cases, w, goal->far)) one->stages = -1;
      continue;
    }
    if (!(pushed > 0.0)) { /* links have changed so much that this direction leads up: the correction never does */
      cases->links.beta[w] = 0.0;
      pushed               = sum->rw[w];
      bend                 = cases->links.work[w];
    }
    alpha[w] = one->stages == 1 ? 1.0 : pushed / bend;                                          /* where no link is taut yet, the loads say which are to be */
    if (one->stages < goal->most && alpha[w] > 0.0 && !PetscIsInfOrNanReal(alpha[w])) continue; /* false where there are numbers no more */
    alpha[w]    = 0.0;
    ends[w]     = PETSC_TRUE;
    one->stages = -1;
  }
}

/* One stage of all lanes; ends[w]: the case of this lane has ended */
static PetscErrorCode LatinCasesStage_Private(LatinCases *cases, const LatinCaseGoal *goal, PetscBool ends[])
{
  LatinCaseLinks *links = &cases->links;
  PetscReal       scale[LATIN_CASE_LANES], alpha[LATIN_CASE_LANES], *r = cases->before;
  LatinCaseSums   sum;

  PetscFunctionBegin;
  cases->before = links->r;
  links->r      = r;
  PetscCall(PetscArraycpy(r, cases->load, LATIN_CASE_LANES * (size_t)cases->dofs));
  LatinCasesForces(links);
  LatinCasesNorms(cases, &sum, scale);
  PetscCall(LatinCholeskySolveLanes(cases->F, cases->row, scale, r, links->w));
  LatinCasesSums(cases, &sum);
  LatinCasesTurn(cases, &sum);
  LatinCasesResistance(links);
  LatinCasesDecide(cases, goal, &sum, alpha, ends);
  LatinCasesMove(cases, alpha);
  PetscFunctionReturn(0);
}

/*
   Solves n cases of a structure on one rank that is set up, whose laws are bars, cables and compression-only links and whose
   links keep their direction. The stages of a case that is left unsolved are negative, and nothing of it is written
*/
PetscErrorCode LatinCasesSolve_Private(LatinStructure structure, const LatinCaseGoal *goal, PetscInt n, LatinCase one[])
{
  PetscInt   next = 0, busy = 0;
  PetscBool  fails, ends[LATIN_CASE_LANES];
  LatinCases cases;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Cases, structure, 0, 0, 0));
  for (PetscInt i = 0; i < n; i++) one[i].stages = -1;
  PetscCall(LatinCasesCreate_Private(structure, goal->most, &cases));
  PetscCall(LatinCasesFactor_Private(&cases, &fails));
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
