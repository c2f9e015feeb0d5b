#include "error/latinerror.h"

/*
   An upper bound of the energy error of any displacement u of a linear structure, on demand. The error e = u* - u is
   continuous and vanishes on the supports, K e = r = F - B^t tau(u), and its energy norm |e|^2 = e^t K e = r^t K^-1 r is
   that of the tensions k B e, which balance r [W. Prager, J. L. Synge].

   One linear stage M^-1 (PC latin) gives tensions that balance r but for the springs of the search direction. Since M^-1
   restricts r to subdomains by a partition of unity, solves with an operator that is K plus springs on continuous
   fields, and puts displacements together by the same weights, |e|^2 <= (1 + beta) r^t M^-1 r, beta being the largest
   ratio of springs to K [the argument of J. Mandel, C. R. Dohrmann for balancing by constraints]. Iterating by conjugate
   gradients takes the factor away: with mu <= 1 / (1 + beta), the Gauss-Radau rule for r^t K^-1 r is an upper bound at
   every step, and the Gauss rule a lower one [G. H. Golub, G. Meurant; G. Meurant, P. Tichy, Numer. Algorithms 62 (2013)].
   mu is a quarter of the least Ritz value; the iteration goes on until the two rules agree, so that mu hardly matters.
   What rounding leaves is added.
*/

#define LATIN_BOUND_STEPS 200
#define LATIN_BOUND_LEAST 3    /* steps before a Ritz value is believed */
#define LATIN_BOUND_GAP   0.02 /* of the two rules, relative, for the norm */

/* Least eigenvalue of the Lanczos matrix of n steps with lengths gamma and ratios delta; work for 2 n numbers */
static PetscErrorCode LatinBoundRitz_Private(PetscInt n, const PetscReal gamma[], const PetscReal delta[], PetscReal work[], PetscReal *least)
{
  PetscReal   *diagonal = work, *side = work + n;
  PetscBLASInt size, info, one = 1;
  PetscReal    none = 0.0;

  PetscFunctionBegin;
  for (PetscInt j = 0; j < n; j++) {
    diagonal[j] = 1.0 / gamma[j] + (j ? delta[j - 1] / gamma[j - 1] : 0.0);
    side[j]     = PetscSqrtReal(delta[j]) / gamma[j];
  }
  PetscCall(PetscBLASIntCast(n, &size));
  PetscCallBLAS("LAPACKREALsteqr", LAPACKREALsteqr_("N", &size, diagonal, side, &none, &one, &none, &info));
  PetscCheck(!info, PETSC_COMM_SELF, PETSC_ERR_LIB, "LAPACK steqr failed with code %d", (int)info);
  *least = diagonal[0];
  PetscFunctionReturn(0);
}

/* The two rules after n steps: lower^2 = sum of gamma_j rho_j, upper^2 = lower^2 + what Radau adds for mu */
static void LatinBoundRules(PetscInt n, PetscReal mu, const PetscReal gamma[], const PetscReal delta[], PetscReal rho, PetscReal *lower, PetscReal *upper)
{
  PetscReal sum = 0.0, radau = 1.0 / mu;

  for (PetscInt j = 0; j < n; j++) {
    sum += gamma[j] * rho;
    rho *= delta[j];
    radau = PetscMax(radau - gamma[j], 0.0) / (mu * PetscMax(radau - gamma[j], 0.0) + delta[j]);
  }
  *lower = PetscSqrtReal(sum);
  *upper = PetscSqrtReal(sum + radau * rho);
}

/* Conjugate gradients on K e = r from e = 0, until the two rules agree; r is overwritten */
static PetscErrorCode LatinBoundIterate_Private(Mat K, PC pc, Vec r, PetscReal *upper)
{
  PetscReal gamma[LATIN_BOUND_STEPS], delta[LATIN_BOUND_STEPS], work[2 * LATIN_BOUND_STEPS], first, rho, pKp, next, lower = 0.0, least = 1.0;
  Vec       z, p, Kp;
  PetscInt  n = 0;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(r, &z));
  PetscCall(VecDuplicate(r, &Kp));
  PetscCall(PCApply(pc, r, z));
  PetscCall(VecDuplicate(r, &p));
  PetscCall(VecCopy(z, p));
  PetscCall(VecDot(r, z, &rho));
  first  = rho;
  *upper = 0.0;
  PetscCheck(!PetscIsInfOrNanScalar(rho), PetscObjectComm((PetscObject)r), PETSC_ERR_FP, "The displacements, or the loads, are not finite numbers: they have no energy bound");
  for (n = 0; rho > 0.0 && n < LATIN_BOUND_STEPS;) {
    PetscCall(MatMult(K, p, Kp));
    PetscCall(VecDot(p, Kp, &pKp));
    PetscCheck(pKp > 0.0, PetscObjectComm((PetscObject)r), PETSC_ERR_NOT_CONVERGED, "The energy bound needs a stiffness that is positive and finite, and meets the energy %g: a local solver failed, or the structure has a mechanism", (double)pKp);
    gamma[n] = rho / pKp;
    PetscCall(VecAXPY(r, -gamma[n], Kp));
    PetscCall(PCApply(pc, r, z));
    PetscCall(VecDot(r, z, &next));
    delta[n++] = PetscMax(next, 0.0) / rho;
    rho        = PetscMax(next, 0.0);
    PetscCall(VecAYPX(p, delta[n - 1], z));
    PetscCall(LatinBoundRitz_Private(n, gamma, delta, work, &least));
    LatinBoundRules(n, 0.25 * PetscMin(least, 1.0), gamma, delta, first, &lower, upper);
    if (n >= LATIN_BOUND_LEAST && *upper <= (1.0 + LATIN_BOUND_GAP) * lower) break;
  }
  PetscCall(VecDestroy(&z));
  PetscCall(VecDestroy(&p));
  PetscCall(VecDestroy(&Kp));
  PetscCheck(!PetscIsInfOrNanReal(*upper), PetscObjectComm((PetscObject)r), PETSC_ERR_NOT_CONVERGED, "The energy bound is not finite: the displacements are not, or a local solver failed");
  PetscFunctionReturn(0);
}

/* Square root of the sum of k e^2 for the displacements u and the prescribed ones, and what rounding leaves of it */
static PetscErrorCode LatinBoundNorm_Private(LatinStructure structure, Vec u, PetscReal *norm, PetscReal *rounding)
{
  const PetscInt     dim    = structure->dim;
  PetscReal          sum[2] = {0.0, 0.0};
  const PetscScalar *x;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(structure->dm, &local));
  PetscCall(LatinStructureGetLocal_Private(structure, structure->vertex_prescribed, u, local));
  PetscCall(VecGetArrayRead(local, &x));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal a = 0.0, b = 0.0;

    for (PetscInt c = 0; c < dim; c++) {
      a += structure->direction[dim * l + c] * x[dim * structure->ends[2 * l] + c];
      b += structure->direction[dim * l + c] * x[dim * structure->ends[2 * l + 1] + c];
    }
    sum[0] += structure->stiffness[l] * (a * a + b * b);
    sum[1] += structure->stiffness[l] * (b - a) * (b - a);
  }
  PetscCall(VecRestoreArrayRead(local, &x));
  PetscCall(DMRestoreLocalVector(structure->dm, &local));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  *norm     = PetscSqrtReal(sum[1]);
  *rounding = *norm * LatinRounding(sum[0], sum[1]);
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinGetEnergyBound_Private(SNES snes, PetscReal *bound, PetscReal *relative)
{
  LatinStructure structure;
  const char    *prefix;
  DM             dm;
  Vec            u, r;
  Mat            K;
  PC             pc;
  PetscBool      bars  = PETSC_TRUE;
  PetscReal      upper = 0.0, norm = 0.0, rounding = 0.0;

  PetscFunctionBegin;
  PetscCall(SNESGetDM(snes, &dm));
  PetscCall(LatinStructureFromDM_Private(dm, &structure));
  PetscCheck(structure, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "The energy bound needs a structure: LatinStructureAttachSNES() comes first (in Python, latinpc.Structure(...).attach(snes))");
  PetscCall(SNESGetSolution(snes, &u));
  PetscCheck(u, PetscObjectComm((PetscObject)snes), PETSC_ERR_ORDER, "The energy bound is of a solution: call SNESSolve() first");
  for (PetscInt l = 0; l < structure->links_local; l++) bars = (PetscBool)(bars && LatinLaws[structure->law[l]].smooth);
  LatinAgree(PetscObjectComm((PetscObject)snes), !bars, PETSC_ERR_SUP, "The energy bound is for linear structures, and this one has cables or compression-only links: -snes_latin_stop error estimates their error");
  PetscCall(VecDuplicate(u, &r));
  PetscCall(SNESComputeFunction(snes, u, r));
  PetscCall(DMCreateMatrix(dm, &K));
  PetscCall(LatinStructureComputeJacobian(structure, u, K));
  PetscCall(PCCreate(PetscObjectComm((PetscObject)snes), &pc));
  PetscCall(PetscObjectSetOptions((PetscObject)pc, ((PetscObject)snes)->options));
  PetscCall(SNESGetOptionsPrefix(snes, &prefix));
  PetscCall(PCSetOptionsPrefix(pc, prefix));
  PetscCall(PCAppendOptionsPrefix(pc, "latin_bound_"));
  PetscCall(PCSetType(pc, PCLATIN));
  PetscCall(PCSetOperators(pc, K, K));
  PetscCall(PCSetUp(pc));
  PetscCall(LatinBoundIterate_Private(K, pc, r, &upper));
  PetscCall(LatinBoundNorm_Private(structure, u, &norm, &rounding));
  upper += rounding;
  if (bound) *bound = upper;
  if (relative) *relative = upper < norm ? upper / (norm - upper) : upper > 0.0 ? INFINITY : 0.0;
  PetscCall(PCDestroy(&pc));
  PetscCall(MatDestroy(&K));
  PetscCall(VecDestroy(&r));
  PetscFunctionReturn(0);
}

/*@C
  LatinGetEnergyBound - An upper bound of the error of a solution in the energy norm, for linear structures.

  Collective on snes

  Input Parameter:
. snes - of any type, after a solve; its DM is that of a structure of bars only

  Output Parameters:
+ bound    - of |u* - u|, the square root of the sum of k (e* - e)^2 over all links; may be NULL
- relative - of the same over |u*|; may be NULL

  Level: intermediate

  Note:
  It costs the set-up of a `PCLATIN` and some ten linear stages. The relative bound is infinite while the error may be
  as large as the solution.

.seealso: `SNESLatinGetEstimates()`, `LatinStructureComputeErrors()`
@*/
PetscErrorCode LatinGetEnergyBound(SNES snes, PetscReal *bound, PetscReal *relative)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 1);
  LatinWatch(PetscObjectComm((PetscObject)snes), LatinGetEnergyBound_Private(snes, bound, relative));
  PetscFunctionReturn(0);
}
