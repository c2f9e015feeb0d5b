#include "snes/sneslatinimpl.h"

/*
   Contacts with Coulomb friction, by the interior-point method of error/primaldual.c and error/slip.c. Without an energy the path to the solution may
   turn back, most often with much friction: then Newton steps become short. From there the friction bounds b follow mu y at a finite pace, as in
   db / dtime = mu y(b) - b, where y(b) is the solution with fixed bounds: a convex problem, without turns. A step of this motion takes a pseudo time,
   the pace, by the implicit Euler scheme [C. T. Kelley, D. E. Keyes: pseudo-transient continuation]. Long steps make the pace faster, short ones slower.
   Beyond a fastest pace bounds follow at once, and steps are those of Newton's method again. Grains so leave an equilibrium that ceases to exist, and
   slide to another one. The motion may fail to come to rest.
*/

#define LATIN_COULOMB_STEPS     1000                          /* most steps */
#define LATIN_COULOMB_LONG      0.5                           /* steps longer than this are long; shorter than LATIN_SLIP_SHORT short */
#define LATIN_COULOMB_PATIENCE  3                             /* successive short steps of Newton's method that show that the path turns back */
#define LATIN_COULOMB_PACE      1.0                           /* first pace, in the time in which bounds would follow by the difference mu y - b */
#define LATIN_COULOMB_SLOWER    0.5                           /* factor on the pace after a short step, */
#define LATIN_COULOMB_FASTER    1.5                           /* and after a long one */
#define LATIN_COULOMB_FASTEST   20.0                          /* greatest pace; beyond, bounds follow at once */
#define LATIN_COULOMB_REFINED   2                             /* solves for the least tensions: the first and refinement */
#define LATIN_COULOMB_FLOOR     LatinByPrecision(1e-10, 1e-5) /* stiffness left in links, relative to their search parameters: holds grains without force */
#define LATIN_COULOMB_CREEPS    10                            /* most steps that only creep: displacements change while tensions are constant */
#define LATIN_COULOMB_GAP_LEAST LatinByPrecision(1e-20, 1e-8) /* least final gap; LATIN_CONVEX_GAP falls to the squared requested error, if that is less */
#define LATIN_COULOMB_LEAST     1e-3                          /* least target of the products, relative to that gap; with less, the point sticks to bounds */

/* State of a run */
typedef struct {
  PetscReal pace;           /* infinite: Newton's method */
  PetscInt  shorts, creeps; /* successive short steps; steps that only creep */
} LatinCoulomb;

/* Creates the assembled operator and its LU factors, prefix -snes_latin_friction_. Collective on snes */
static PetscErrorCode LatinCoulombCreate_Private(SNES snes, LatinPrimalDual *c)
{
  const Latin latin = ((SNES_Latin *)snes->data)->latin;
  PC          pc;

  PetscFunctionBegin;
  PetscCall(DMCreateMatrix(c->structure->dm, &c->A));
  PetscCall(MatConvert(c->A, MATAIJ, MAT_INPLACE_MATRIX, &c->A)); /* overrides -dm_mat_type */
  PetscCall(LatinSolverCreate_Private(PetscObjectComm((PetscObject)snes), (PetscObject)latin, "friction", &c->ksp));
  PetscCall(KSPGetPC(c->ksp, &pc));
  PetscCall(LatinDirectLU_Private(pc, c->A));
  PetscCall(KSPSetFromOptions(c->ksp));
  PetscFunctionReturn(0);
}

/*
   Checks whether the point is a solution: products and unbalance are small, and the last step changed displacements and tensions by less than the
   requested errors. If displacements creep while tensions are constant, the point is one of a continuum of solutions: grains without forces, or that
   slide along two opposite ones; if tensions creep while nothing moves, of another one: self-stresses. *creeps: number of such steps, except those in
   which displacements or tensions halve, which lead to rest. Collective
*/
static PetscErrorCode LatinCoulombDone_Private(LatinPrimalDual *c, LatinNewton *newton, Vec more, PetscInt *creeps, PetscBool *done)
{
  PetscReal   sum[4] = {0.0, 0.0, 0.0, LatinSlipsLag(c)}, moved, size, least, work, left, goal, unbalance, most; /* sums: squared changes of tensions, squared tensions, work, squared lag of friction bounds */
  PetscScalar push;
  PetscBool   rests, still, same, creep;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n; l++) {
    const PetscReal strain = c->x[l] + c->give[l] * c->t[l];

    sum[0] += PetscSqr(c->dt[l]);
    sum[1] += PetscSqr(c->t[l]);
    sum[2] += PetscAbsReal(c->t[l] * strain);
    /* elastic links at a kink of their law have other tensions in the interior */
    c->dx[l] = LatinLaws[c->structure->law[l]].rigid ? c->t[l] : LatinStructureTension(c->structure, NULL, l, strain);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)c->structure)));
  sum[1] = PetscMax(sum[1], PetscSqr(PETSC_MACHINE_EPSILON * c->inside[0]) * c->count);      /* without tensions: rounding of those of the initial point, */
  sum[2] = PetscMax(sum[2], PETSC_MACHINE_EPSILON * c->inside[0] * c->inside[1] * c->count); /* and of their work */
  PetscCall(LatinStructureForces_Private(c->structure, c->dx, c->d, c->structure->load, c->r));
  if (more) PetscCall(VecAXPY(c->r, -1.0, more));
  PetscCall(VecNorm(c->r, NORM_2, &unbalance));
  PetscCall(VecDot(c->f, c->d, &push));
  PetscCall(VecNorm(c->dd, NORM_2, &moved));
  PetscCall(VecNorm(c->d, NORM_2, &size));
  PetscCall(LatinEquilibriumPoint_Private(c->structure, &least));
  PetscCall(LatinStepRests_Private(c->structure, c->dd, PetscSqrtReal(sum[1]), &rests));
  newton->error    = size > 0.0 ? moved / size : 0.0;
  newton->tensions = sum[1] > 0.0 ? PetscSqrtReal((sum[0] + sum[3]) / sum[1]) : 0.0;
  work             = sum[2] + PetscAbsScalar(push);
  left             = c->mean * c->count / work;
  goal             = PetscMin(LATIN_CONVEX_GAP, PetscMax(PetscSqr(newton->target), LATIN_COULOMB_GAP_LEAST));
  c->least         = LATIN_COULOMB_LEAST * goal * work / c->count;
  most             = PetscMax(PetscMin(newton->balance, newton->tension_target * PetscSqrtReal(sum[1])), LATIN_NEWTON_REST * PetscSqrtReal(sum[1]));
  *done            = PETSC_FALSE;
  still            = (PetscBool)(moved <= PetscMax(newton->target * size, least) || rests);
  same             = (PetscBool)(newton->tensions <= newton->tension_target);
  creep            = (PetscBool)(still != same && moved <= size && newton->tensions <= 1.0 && sum[3] <= PetscSqr(newton->tension_target) * sum[1]);
  if (c->follow == 1.0 && left <= goal && unbalance <= most) *done = (PetscBool)((still && same) || (creep && ++*creeps > LATIN_COULOMB_CREEPS));
  if (*done && size <= least && moved > newton->target * size) PetscCall(VecZeroEntries(c->d)); /* nothing moves */
  if (*done) newton->error = PetscMin(newton->error, PetscSqrtReal(left));
  PetscCall(PetscInfo(c->structure, "length %g, bounds follow by %g: products %g of the work, unbalance %g of %g, displacements change by %g, tensions by %g\n", (double)c->length, (double)c->follow, (double)left, (double)unbalance, (double)most,
                      (double)newton->error, (double)newton->tensions));
  PetscFunctionReturn(0);
}

/* Chooses the pace after a step. Not collective */
static void LatinCoulombPace(LatinPrimalDual *c, LatinCoulomb *run)
{
  const PetscBool newton = PetscIsInfReal(run->pace);

  run->shorts = c->length < LATIN_SLIP_SHORT ? run->shorts + 1 : 0;
  if (newton && run->shorts >= LATIN_COULOMB_PATIENCE) run->pace = LATIN_COULOMB_PACE;
  else if (!newton && run->shorts) run->pace *= LATIN_COULOMB_SLOWER;
  else if (c->length > LATIN_COULOMB_LONG) run->pace *= LATIN_COULOMB_FASTER;
  if (run->pace > LATIN_COULOMB_FASTEST) run->pace = INFINITY;
  c->follow = PetscIsInfReal(run->pace) ? 1.0 : run->pace / (1.0 + run->pace);
}

/* Takes steps until a solution or a limit. Collective */
static PetscErrorCode LatinCoulombRun_Private(LatinPrimalDual *c, LatinNewton *newton, Vec more, PetscBool *done)
{
  LatinCoulomb run    = {.pace = INFINITY};
  PetscBool    failed = PETSC_FALSE;
  PetscReal    firm;

  PetscFunctionBegin;
  PetscCall(LatinConvexWeights_Private(c, newton->latin->sub.link_stiffness, &firm));
  c->floor = LATIN_COULOMB_FLOOR * firm;
  PetscCall(LatinConvexStart_Private(c, &failed));
  for (PetscInt k = 0; k < LATIN_COULOMB_STEPS && !failed && !*done && c->stages < newton->limit - newton->stages; k++) {
    PetscCall(LatinPrimalDualIterate_Private(c, &failed));
    newton->steps++;
    if (failed) continue;
    c->mean = PetscMax(c->mean, c->least); /* less is rounding, of either sign */
    PetscCall(LatinCoulombDone_Private(c, newton, more, &run.creeps, done));
    if (!*done) LatinCoulombPace(c, &run);
  }
  PetscFunctionReturn(0);
}

/* Returns whether the rigid link l is open: its tension is small beside its elongation. Not collective */
static PetscBool LatinCoulombOpen(const LatinPrimalDual *c, PetscInt l, PetscReal stiffness)
{
  for (PetscInt i = 0; i < 2; i++) {
    const LatinBound *at = LatinBoundAt(c, l, i);

    if (at && at->y < stiffness * at->s) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/*
   Computes the weights c->w of the bars that determine the least tensions: closed links without slip get their search parameters, all others none.
   Open links get no tension. A contact slips if its rate is large beside the distance of its tension from the cone: it keeps its normal tension, and
   its tangential one moves to the cone, however small both are. Not collective
*/
static void LatinCoulombStates(LatinPrimalDual *c, const PetscReal stiffness[])
{
  const LatinStructure structure = c->structure;

  for (PetscInt l = 0; l < c->n; l++) {
    const PetscBool rigid = LatinLaws[structure->law[l]].rigid;

    c->w[l] = 0.0;
    if (structure->law[l] == LATIN_LAW_TANGENT || !rigid) continue;
    if (!LatinCoulombOpen(c, l, stiffness[l])) c->w[l] = stiffness[l];
    else c->t[l] = 0.0;
    for (PetscInt i = 1; i < structure->dim && structure->law[l] == LATIN_LAW_FRICTION; i++) {
      c->t[l + i] = c->w[l] > 0.0 ? c->t[l + i] : 0.0;
      c->w[l + i] = 0.0;
    }
    l += structure->law[l] == LATIN_LAW_FRICTION ? structure->dim - 1 : 0;
  }
  for (PetscInt k = 0; k < c->slips; k++) {
    const PetscInt l   = c->slip[k].link;
    PetscReal      rub = 0.0;

    for (PetscInt i = 1; i < structure->dim; i++) rub += PetscSqr(c->t[l + i]);
    rub = PetscSqrtReal(rub);
    if (stiffness[l] * c->slip[k].S[0] > -structure->friction[l] * c->t[l] - rub) {
      c->w[l] = 0.0;
      for (PetscInt i = 1; i < structure->dim && rub > 0.0; i++) c->t[l + i] *= -structure->friction[l] * c->t[l] / rub;
    }
    for (PetscInt i = 1; i < structure->dim; i++) c->w[l + i] = c->w[l];
  }
}

/*
   Removes self-stresses from the tensions of closed links; the interior-point method leaves them as large as at its start. The least tensions that
   balance the same forces, relative to their search parameters, replace them if they are compressive and inside the friction cones. Not in a time
   step, where masses would bear a part of the forces. Collective
*/
static PetscErrorCode LatinCoulombLeast_Private(LatinPrimalDual *c, const PetscReal stiffness[])
{
  const LatinStructure structure = c->structure;
  PetscBool            failed = PETSC_FALSE, admissible = PETSC_TRUE;

  PetscFunctionBegin;
  LatinCoulombStates(c, stiffness);
  if (structure->ground) PetscFunctionReturn(0);
  PetscCall(LatinPrimalDualOperator_Private(c, PETSC_FALSE));
  PetscCall(PetscArrayzero(c->dx, c->n));
  for (PetscInt k = 0; k < LATIN_COULOMB_REFINED; k++) { /* refinement removes what the floor leaves */
    for (PetscInt l = 0; l < c->n; l++) c->dt[l] = c->w[l] > 0.0 ? c->t[l] - c->w[l] * c->dx[l] : 0.0;
    PetscCall(VecZeroEntries(c->dd));
    PetscCall(LatinStructureForces_Private(structure, c->dt, c->dd, NULL, c->r));
    PetscCall(LatinPrimalDualSolve_Private(c, c->r, &failed));
    PetscCall(LatinStructureElongations_Private(structure, NULL, c->dd, c->dt));
    for (PetscInt l = 0; l < c->n; l++) c->dx[l] += c->dt[l];
  }
  for (PetscInt l = 0; l < c->n; l++) {
    PetscReal rub = 0.0;

    c->dt[l] = c->w[l] > 0.0 ? c->w[l] * c->dx[l] : c->t[l];
    if (!(c->w[l] > 0.0) || structure->law[l] == LATIN_LAW_TANGENT) continue;
    if (LatinLawSign(structure->law[l]) * c->dt[l] < 0.0) admissible = PETSC_FALSE;
    for (PetscInt i = 1; i < structure->dim && structure->law[l] == LATIN_LAW_FRICTION; i++) rub += PetscSqr(c->w[l + i] * c->dx[l + i]);
    if (PetscSqrtReal(rub) > -structure->friction[l] * c->dt[l] && structure->law[l] == LATIN_LAW_FRICTION) admissible = PETSC_FALSE;
  }
  admissible = (PetscBool)(admissible && !failed);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &admissible, 1, LATIN_MPI_BOOL, MPI_LAND, PetscObjectComm((PetscObject)structure)));
  if (admissible) PetscCall(PetscArraycpy(c->t, c->dt, c->n));
  PetscFunctionReturn(0);
}

/*
   Solves by the interior-point method, after the search for tensions inside the friction cones, which proves that there is no equilibrium or that the
   loads are borne. If the reason is negative, displacements and tensions of rigid links are unchanged. data->next: an end of the solve if the search
   has found one. Collective on snes
*/
PetscErrorCode SNESLatinCoulomb_Private(SNES snes, SNESConvergedReason *reason)
{
  SNES_Latin          *data      = (SNES_Latin *)snes->data;
  const LatinStructure structure = data->latin->sub.structure;
  const PetscReal     *stiffness = data->latin->sub.link_stiffness;
  LatinPrimalDual      c         = {.structure = structure, .follow = 1.0};
  PetscBool            done      = PETSC_FALSE;

  PetscFunctionBegin;
  *reason = SNES_DIVERGED_MAX_IT;
  PetscCall(SNESLatinOuterForget_Private(snes));
  PetscCall(SNESLatinAdmissible_Private(snes, &data->next));
  if (data->next == LATIN_NEXT_DIVERGED || data->next == LATIN_NEXT_CONVERGED) PetscFunctionReturn(0);
  data->newton.balance = SNESLatinBalances(snes) ? SNESLatinBalanceForce(data, data->newton.loads) : PETSC_MAX_REAL;
  PetscCall(LatinCoulombCreate_Private(snes, &c));
  PetscCall(LatinPrimalDualCreate_Private(&c, snes->vec_rhs));
  PetscCall(LatinCoulombRun_Private(&c, &data->newton, snes->vec_rhs, &done));
  data->newton.stages += c.stages;
  if (done) {
    *reason = SNES_CONVERGED_SNORM_RELATIVE;
    PetscCall(VecCopy(c.d, snes->vec_sol));
    PetscCall(LatinCoulombLeast_Private(&c, stiffness));
    for (PetscInt l = 0; l < c.n; l++)
      if (LatinLaws[structure->law[l]].rigid) data->latin->linear.rigid_tension[l] = c.t[l];
  }
  PetscCall(LatinPrimalDualDestroy_Private(&c));
  PetscCall(KSPDestroy(&c.ksp));
  PetscCall(MatDestroy(&c.A));
  PetscFunctionReturn(0);
}
