#include "stages/latinstages.h"
#include "structure/midpoint.h"
#include "structure/turning.h"

/*
   Local stage of links with large rotations (structure/turning.h, structure/frame.c): dim consecutive links are the parts of one link, the one along it
   first. A part of scale a has the strain a r_c, the tension f_c / a, r_c and f_c components of the vector r between the ends and of the force, and the
   search parameter E a^2 on components.
*/

/* Solves the law for r and f, given w = f + E a^2 r */
static void LatinTurningSolve(const LatinSubdomains *sub, PetscInt dim, PetscInt l, PetscReal E, const PetscReal w[], PetscReal r[], PetscReal f[])
{
  const PetscReal *part = sub->part + LATIN_PART * l, k = E * PetscSqr(part[LATIN_PART_SCALE]), c = dim > 1 ? E * PetscSqr(part[LATIN_PART + LATIN_PART_SCALE]) : k;
  PetscReal        across = 0.0, R, rho;
  LatinTurn        turn   = {.law = &LatinLaws[sub->law[l]], .stiffness = part[LATIN_PART_STIFFNESS], .natural = part[LATIN_PART_NATURAL], .k = k, .c = c, .along = PetscAbsReal(w[0])};

  for (PetscInt i = 1; i < dim; i++) across += PetscSqr(w[i]);
  turn.across = PetscSqrtReal(across);
  R           = LatinTurnLength(&turn);
  rho         = R > 0.0 ? turn.law->tension(turn.stiffness, R - turn.natural, turn.law->ctx) / R : 0.0;
  for (PetscInt i = 0; i < dim; i++) {
    r[i] = R > 0.0 ? w[i] / (rho + (i ? c : k)) : 0.0;
    f[i] = R > 0.0 ? rho * r[i] : w[i];
  }
}

/* The same in a time step, for the mean r and the mean force f (structure/midpoint.h) */
static void LatinTurningMean(const LatinSubdomains *sub, PetscInt dim, PetscInt l, PetscReal E, const PetscReal w[], PetscReal r[], PetscReal f[])
{
  const PetscReal *part = sub->part + LATIN_PART * l;
  LatinMidpoint    link = {.law = &LatinLaws[sub->law[l]], .dim = dim, .stiffness = part[LATIN_PART_STIFFNESS], .natural = part[LATIN_PART_NATURAL], .k = E * PetscSqr(part[LATIN_PART_SCALE])};
  PetscReal        g;

  link.c = dim > 1 ? E * PetscSqr(part[LATIN_PART + LATIN_PART_SCALE]) : link.k;
  for (PetscInt c = 0; c < dim; c++) {
    link.w[c]  = w[c];
    link.r0[c] = sub->e0[l + c] / part[LATIN_PART * c + LATIN_PART_SCALE];
    link.R0 += PetscSqr(link.r0[c]);
  }
  link.R0 = PetscSqrtReal(link.R0);
  g       = LatinMidpointSolve(&link, r);
  for (PetscInt c = 0; c < dim; c++) f[c] = g * r[c];
}

/* Computes f, the force of r or, in a time step, the mean force of a mean r */
static void LatinTurningForce(const LatinSubdomains *sub, PetscBool midpoint, PetscInt dim, PetscInt l, const PetscReal r[], PetscReal f[])
{
  const PetscReal *part = sub->part + LATIN_PART * l, k = part[LATIN_PART_STIFFNESS], natural = part[LATIN_PART_NATURAL];
  const LatinLaw  *law = &LatinLaws[sub->law[l]];
  PetscReal        R = 0.0, R0 = 0.0, R1 = 0.0, slope, rho;

  if (part[LATIN_PART_KEEPS] > 0.0) {
    R0   = sub->e0[l] / part[LATIN_PART_SCALE];
    f[0] = midpoint ? LatinMidpointTension(law, k, R0 - natural, 2.0 * r[0] - R0 - natural, &slope) : law->tension(k, r[0] - natural, law->ctx);
    for (PetscInt c = 1; c < dim; c++) f[c] = 0.0;
    return;
  }
  for (PetscInt c = 0; c < dim; c++) {
    const PetscReal r0 = sub->e0[l + c] / part[LATIN_PART * c + LATIN_PART_SCALE];

    R += PetscSqr(r[c]);
    R0 += PetscSqr(r0);
    R1 += PetscSqr(2.0 * r[c] - r0);
  }
  R  = PetscSqrtReal(R);
  R0 = PetscSqrtReal(R0);
  R1 = PetscSqrtReal(R1);
  if (midpoint) rho = LatinMidpointForce(law, k, R0 - natural, R1 - natural, R0 + R1, &slope);
  else rho = R > 0.0 ? law->tension(k, R - natural, law->ctx) / R : 0.0;
  for (PetscInt c = 0; c < dim; c++) f[c] = rho * r[c];
}

/* Solves the law of a link that keeps its direction for r and f, given w */
static void LatinTurningKeep(const LatinSubdomains *sub, PetscBool midpoint, PetscInt dim, PetscInt l, PetscReal E, const PetscReal w[], PetscReal r[], PetscReal f[])
{
  const PetscReal *part = sub->part + LATIN_PART * l, stiffness = part[LATIN_PART_STIFFNESS], natural = part[LATIN_PART_NATURAL], k = E * PetscSqr(part[LATIN_PART_SCALE]);
  const PetscReal  R0  = sub->e0[l] / part[LATIN_PART_SCALE];
  const LatinLaw  *law = &LatinLaws[sub->law[l]];

  r[0] = LatinLawLength(law, stiffness, natural, k, w[0], midpoint ? &R0 : NULL, midpoint ? R0 : w[0] / k);
  for (PetscInt c = 1; c < dim; c++) r[c] = w[c] / (E * PetscSqr(part[LATIN_PART * c + LATIN_PART_SCALE]));
  LatinTurningForce(sub, midpoint, dim, l, r, f);
}

/* Returns the length of r; of a link that keeps its direction the component along it */
static PetscReal LatinTurningLength(const LatinSubdomains *sub, PetscInt dim, PetscInt l, const PetscReal r[])
{
  PetscReal R = 0.0;

  if (sub->part[LATIN_PART * l + LATIN_PART_KEEPS] > 0.0) return r[0];
  for (PetscInt c = 0; c < dim; c++) R += PetscSqr(r[c]);
  return PetscSqrtReal(R);
}

/*
   Performs the local stage of all links here. Adds to sum: the squared distance; the energy of relative displacements of the ends in the search direction;
   the same plus that of the tensions. Sets linear->strain in a static solve
*/
void LatinTurningStage(const LatinLinear *linear, const PetscReal state[], PetscReal next[], PetscReal sum[3])
{
  const LatinSubdomains *sub      = linear->sub;
  const PetscInt         dim      = sub->dim;
  const PetscBool        midpoint = sub->structure->original->midpoint;

  for (PetscInt l = 0; l < sub->links; l += dim) {
    const PetscReal E    = sub->stiffness[l];
    const PetscInt  i    = sub->state[l];
    PetscReal       e[3] = {0.0, 0.0, 0.0}, w[3], r[3], f[3];

    if (i < 0) continue; /* no state: both ends are prescribed */
    for (PetscInt c = 0; c < dim; c++) {
      e[c] = LatinElongation(sub, dim, l + c, linear->U);
      w[c] = (state[i + c] + E * (2.0 * e[c] + sub->e0[l + c])) * sub->part[LATIN_PART * (l + c) + LATIN_PART_SCALE];
    }
    if (sub->part[LATIN_PART * l + LATIN_PART_KEEPS] > 0.0) LatinTurningKeep(sub, midpoint, dim, l, E, w, r, f);
    else if (midpoint) LatinTurningMean(sub, dim, l, E, w, r, f);
    else LatinTurningSolve(sub, dim, l, E, w, r, f);
    if (!midpoint) linear->strain[l] = LatinTurningLength(sub, dim, l, r) - sub->part[LATIN_PART * l + LATIN_PART_NATURAL];
    for (PetscInt c = 0; c < dim; c++) {
      const PetscReal a = sub->part[LATIN_PART * (l + c) + LATIN_PART_SCALE], tension = f[c] / a;

      next[i + c] = tension - E * (a * r[c] - sub->e0[l + c]);
      sum[0] += PetscSqr(next[i + c] - state[i + c]) / (4.0 * E);
      sum[1] += E * PetscSqr(e[c]);
      sum[2] += E * PetscSqr(e[c]) + PetscSqr(tension) / E;
    }
  }
}

/* Computes the states s = f(r) - E (r - r0) under the displacements linear->U */
void LatinTurningState(const LatinLinear *linear, PetscReal state[])
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         dim = sub->dim;

  for (PetscInt l = 0; l < sub->links; l += dim) {
    const PetscReal *part = sub->part + LATIN_PART * l;
    PetscReal        e[3] = {0.0, 0.0, 0.0}, r[3], f[3];

    if (sub->state[l] < 0) continue;
    for (PetscInt c = 0; c < dim; c++) {
      e[c] = LatinElongation(sub, dim, l + c, linear->U);
      r[c] = (e[c] + sub->e0[l + c]) / part[LATIN_PART * c + LATIN_PART_SCALE];
    }
    LatinTurningForce(sub, sub->structure->original->midpoint, dim, l, r, f);
    for (PetscInt c = 0; c < dim; c++) state[sub->state[l + c]] = f[c] / part[LATIN_PART * c + LATIN_PART_SCALE] - sub->stiffness[l] * e[c];
  }
}
