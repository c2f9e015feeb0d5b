#include "stages/latinstages.h"
#include "structure/midpoint.h"
#include "structure/turning.h"

/*
   Local stage of links that turn far (structure/turning.h, structure/frame.c): the parts of a link are dim consecutive links here, the one
   along it first. With the scales a of the parts, the strain of a part is a times a component of r, its tension the component of the
   force over a, and its search parameter E a^2 on components.
*/

/* Components of r, from those of w = f + E r, and rho = tau / R */
static PetscReal LatinTurningSolve(const LatinSubdomains *sub, PetscInt dim, PetscInt l, PetscReal E, const PetscReal w[], PetscReal r[])
{
  const PetscReal *part = sub->part + LATIN_PART * l, k = E * PetscSqr(part[LATIN_PART_SCALE]), c = dim > 1 ? E * PetscSqr(part[LATIN_PART + LATIN_PART_SCALE]) : k;
  PetscReal        across = 0.0, R, rho;
  LatinTurn        turn   = {.law = &LatinLaws[sub->law[l]], .stiffness = part[LATIN_PART_STIFFNESS], .natural = part[LATIN_PART_NATURAL], .k = k, .c = c, .along = PetscAbsReal(w[0])};

  for (PetscInt i = 1; i < dim; i++) across += PetscSqr(w[i]);
  turn.across = PetscSqrtReal(across);
  R           = LatinTurnLength(&turn);
  rho         = turn.law->tension(turn.stiffness, R - turn.natural, turn.law->ctx) / R;
  for (PetscInt i = 0; i < dim; i++) r[i] = w[i] / (rho + (i ? c : k));
  return rho;
}

/* The same during a time step: components of r0 + d, and g (structure/midpoint.h) */
static PetscReal LatinTurningMean(const LatinSubdomains *sub, PetscInt dim, PetscInt l, PetscReal E, const PetscReal w[], PetscReal r[])
{
  const PetscReal *part = sub->part + LATIN_PART * l;
  LatinMidpoint    link = {.law = &LatinLaws[sub->law[l]], .dim = dim, .stiffness = part[LATIN_PART_STIFFNESS], .natural = part[LATIN_PART_NATURAL], .k = E * PetscSqr(part[LATIN_PART_SCALE])};

  link.c = dim > 1 ? E * PetscSqr(part[LATIN_PART + LATIN_PART_SCALE]) : link.k;
  for (PetscInt c = 0; c < dim; c++) {
    link.w[c]  = w[c];
    link.r0[c] = sub->e0[l + c] / part[LATIN_PART * c + LATIN_PART_SCALE];
    link.R0 += PetscSqr(link.r0[c]);
  }
  link.R0 = PetscSqrtReal(link.R0);
  return LatinMidpointSolve(&link, r);
}

/* rho = tau / R of the vector r0 + d, by its components, or the g of a time step */
static PetscReal LatinTurningRho(const LatinSubdomains *sub, PetscBool midpoint, PetscInt dim, PetscInt l, const PetscReal r[])
{
  const PetscReal *part = sub->part + LATIN_PART * l, k = part[LATIN_PART_STIFFNESS], natural = part[LATIN_PART_NATURAL];
  const LatinLaw  *law = &LatinLaws[sub->law[l]];
  PetscReal        R = 0.0, R0 = 0.0, R1 = 0.0, slope;

  for (PetscInt c = 0; c < dim; c++) {
    const PetscReal r0 = sub->e0[l + c] / part[LATIN_PART * c + LATIN_PART_SCALE];

    R += PetscSqr(r[c]);
    R0 += PetscSqr(r0);
    R1 += PetscSqr(2.0 * r[c] - r0);
  }
  R  = PetscSqrtReal(R);
  R0 = PetscSqrtReal(R0);
  R1 = PetscSqrtReal(R1);
  if (midpoint) return LatinMidpointForce(law, k, R0 - natural, R1 - natural, R0 + R1, &slope);
  return R > 0.0 ? law->tension(k, R - natural, law->ctx) / R : 0.0;
}

/* The local stage of all links here; sum as in stages/local.c: squares of the distance, and of displacements of the ends that the search direction resists, without and with those of the drawn configuration */
void LatinTurningStage(const LatinLinear *linear, const PetscReal state[], PetscReal next[], PetscReal sum[3])
{
  const LatinSubdomains *sub      = linear->sub;
  const PetscInt         dim      = sub->dim;
  const PetscBool        midpoint = sub->structure->turns->midpoint;

  for (PetscInt l = 0; l < sub->links; l += dim) {
    const PetscReal E    = sub->stiffness[l];
    const PetscInt  i    = sub->state[l];
    PetscReal       e[3] = {0.0, 0.0, 0.0}, w[3], r[3], rho;

    if (i < 0) continue; /* between prescribed nodes */
    for (PetscInt c = 0; c < dim; c++) {
      e[c] = LatinElongation(sub, dim, l + c, linear->U);
      w[c] = (state[i + c] + E * (2.0 * e[c] + sub->e0[l + c])) * sub->part[LATIN_PART * (l + c) + LATIN_PART_SCALE];
    }
    rho = midpoint ? LatinTurningMean(sub, dim, l, E, w, r) : LatinTurningSolve(sub, dim, l, E, w, r);
    for (PetscInt c = 0; c < dim; c++) {
      const PetscReal a = sub->part[LATIN_PART * (l + c) + LATIN_PART_SCALE], f = rho * r[c] / a;

      next[i + c] = f - E * (a * r[c] - sub->e0[l + c]);
      sum[0] += PetscSqr(next[i + c] - state[i + c]) / (4.0 * E);
      sum[1] += E * PetscSqr(e[c]);
      sum[2] += E * PetscSqr(e[c]) + PetscSqr(f) / E;
    }
  }
}

/* The states s = f(r) - E (r - r0) of the displacements linear.U */
void LatinTurningState(const LatinLinear *linear, PetscReal state[])
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         dim = sub->dim;

  for (PetscInt l = 0; l < sub->links; l += dim) {
    const PetscReal *part = sub->part + LATIN_PART * l;
    PetscReal        e[3] = {0.0, 0.0, 0.0}, r[3], rho;

    if (sub->state[l] < 0) continue;
    for (PetscInt c = 0; c < dim; c++) {
      e[c] = LatinElongation(sub, dim, l + c, linear->U);
      r[c] = (e[c] + sub->e0[l + c]) / part[LATIN_PART * c + LATIN_PART_SCALE];
    }
    rho = LatinTurningRho(sub, sub->structure->turns->midpoint, dim, l, r);
    for (PetscInt c = 0; c < dim; c++) state[sub->state[l + c]] = rho * (e[c] + sub->e0[l + c]) / PetscSqr(part[LATIN_PART * c + LATIN_PART_SCALE]) - sub->stiffness[l] * e[c];
  }
}
