#include "snes/sneslatinimpl.h"

/*
   Initial guess of Newton's method if contacts open and cables slacken in chains: one that opens closes others, and Newton's method changes half of
   them in each step. The energy is convex, and the interior-point method of error/primaldual.c takes 15 to 60 steps for 1,000 to 80,000 contacts. At
   its end the taut and closed links are known: one or two Newton steps follow, which prove the errors.

   In statics the search for a collapse runs before: this method would not end if the structure did not bear the loads. In time steps masses bear
   them.
*/

#define LATIN_CONVEX_STEPS          100                          /* most steps */
#define LATIN_CONVEX_REGULARISATION LatinByPrecision(1e-7, 1e-3) /* compliance of rigid links, relative to that of their search parameters; with more, tensions creep */

/* Computes the weights W of the initial point, and compliances. *firm: greatest search parameter of a rigid link, 0: none. Collective */
PetscErrorCode LatinConvexWeights_Private(LatinPrimalDual *c, const PetscReal stiffness[], PetscReal *firm)
{
  PetscReal most = 0.0;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    const PetscBool rigid = LatinLaws[c->structure->law[l]].rigid;

    c->w[l]    = stiffness[l];
    c->give[l] = rigid || LatinPrimalDualFollows(c, l) ? 0.0 : 1.0 / c->w[l];
    most       = PetscMax(most, rigid ? c->w[l] : 0.0);
  }
  PetscCall(MPIU_Allreduce(&most, firm, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)c->structure)));
  c->regularisation = *firm > 0.0 ? LATIN_CONVEX_REGULARISATION / *firm : 0.0;
  PetscFunctionReturn(0);
}

/* Computes the initial point: all links are bars of weights W; tensions and elongations at bounds get at least their mean size. Collective */
PetscErrorCode LatinConvexStart_Private(LatinPrimalDual *c, PetscBool *failed)
{
  PetscReal sum[2] = {0.0, 0.0}; /* squares of tensions and elongations of unilateral links */

  PetscFunctionBegin;
  PetscCall(VecZeroEntries(c->d));
  PetscCall(LatinPrimalDualOperator_Private(c, PETSC_FALSE));
  PetscCall(LatinStructureStrains_Private(c->structure, c->d, c->x));
  for (PetscInt l = 0; l < c->n; l++) c->t[l] = c->w[l] * c->x[l];
  PetscCall(LatinStructureForces_Private(c->structure, c->t, c->d, NULL, c->r));
  PetscCall(VecAYPX(c->r, -1.0, c->f));
  PetscCall(LatinPrimalDualSolve_Private(c, c->r, failed));
  PetscCall(VecCopy(c->dd, c->d));
  PetscCall(LatinStructureStrains_Private(c->structure, c->d, c->x));
  for (PetscInt l = 0; l < c->n; l++) {
    c->t[l] = c->structure->law[l] == LATIN_LAW_TANGENT ? 0.0 : c->w[l] * c->x[l];
    if (!LatinBoundAt(c, l, 0) && !LatinBoundAt(c, l, 1)) continue;
    sum[0] += PetscSqr(c->t[l]);
    sum[1] += PetscSqr(c->x[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  for (PetscInt k = 0; k < 2; k++) c->inside[k] = PetscSqrtReal(sum[k] / c->count);
  if (!(c->inside[0] > 0.0) || !(c->inside[1] > 0.0)) *failed = PETSC_TRUE;
  for (PetscInt k = 0; k < 2 * c->n; k++) {
    const PetscInt l = k / 2, sign = (PetscInt)LatinBoundSign(k % 2);
    LatinBound    *at = LatinBoundAt(c, l, k % 2);

    if (!at) continue;
    at->y   = PetscMax(sign * c->t[l], c->inside[0]);
    at->s   = PetscMax(-sign * c->x[l], c->inside[1]);
    c->t[l] = sign * at->y;
  }
  LatinSlipsStart(c);
  PetscCall(LatinPrimalDualMean_Private(c, 0.0, &c->mean));
  c->unbalance = 1.0;
  for (PetscInt l = 0; l < c->n; l++) c->x[l] -= c->give[l] * c->t[l];
  PetscFunctionReturn(0);
}

/* Computes *left, the distance from the solution: the larger of the products s y, relative to the work, and the relative unbalance. Collective */
static PetscErrorCode LatinConvexLeft_Private(LatinPrimalDual *c, PetscInt step, PetscReal *left)
{
  PetscReal   sum = 0.0, work;
  PetscScalar push;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) sum += PetscAbsReal(c->t[l] * (c->x[l] + c->give[l] * c->t[l]));
  PetscCall(MPIU_Allreduce(&sum, &work, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  PetscCall(VecDot(c->f, c->d, &push));
  work += PetscAbsScalar(push);
  *left = PetscMax(c->mean * c->count / work, c->unbalance);
  PetscCall(PetscInfo(c->structure, "step %" PetscInt_FMT " of length %g: products %g of the work, unbalance %g\n", step, (double)c->length, (double)(c->mean * c->count / work), (double)c->unbalance));
  PetscFunctionReturn(0);
}

/*
   Solves to rounding: sets u to the displacements and newton->multiplier to the tensions of rigid links; if it fails, both are unchanged. more: an
   additional load, or NULL. Its steps and linear stages count as Newton's. Not for tables, laws of the user or friction. Collective on newton->snes
*/
PetscErrorCode LatinNewtonConvex_Private(LatinNewton *newton, Vec more, Vec u)
{
  const LatinStructure structure = newton->structure;
  LatinPrimalDual      c         = {.structure = structure};
  PetscBool            failed    = PETSC_FALSE;
  PetscReal            left      = PETSC_MAX_REAL, firm;

  PetscFunctionBegin;
  PetscCall(SNESGetKSP(newton->snes, &c.ksp));
  PetscCall(LatinPrimalDualCreate_Private(&c, more));
  if (c.count > 0.0) {
    PetscCall(SNESGetJacobian(newton->snes, &c.A, NULL, NULL, NULL));
    PetscCall(KSPSetTolerances(c.ksp, LATIN_NEWTON_TIGHT, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
    PetscCall(LatinConvexWeights_Private(&c, newton->latin->sub.link_stiffness, &firm));
    c.softest = c.regularisation / LATIN_CONVEX_REGULARISATION;
    c.floor   = newton->floor;
    PetscCall(LatinConvexStart_Private(&c, &failed));
    for (PetscInt k = 0; k < LATIN_CONVEX_STEPS && !failed && left > LATIN_CONVEX_GAP && c.stages < newton->stages_left; k++) {
      PetscCall(LatinPrimalDualIterate_Private(&c, &failed));
      newton->steps++;
      if (!failed) PetscCall(LatinConvexLeft_Private(&c, k, &left));
    }
    newton->stages += c.stages;
    newton->changes = 1; /* the tangent stiffness has been overwritten */
  }
  if (left <= LATIN_CONVEX_GAP) PetscCall(VecCopy(c.d, u));
  for (PetscInt l = 0; l < c.n && left <= LATIN_CONVEX_GAP && structure->penalty; l++)
    if (LatinLaws[structure->law[l]].rigid) newton->multiplier[l] = c.t[l];
  PetscCall(LatinPrimalDualDestroy_Private(&c));
  PetscFunctionReturn(0);
}
