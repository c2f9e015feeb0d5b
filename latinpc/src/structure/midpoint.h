/*
   Energy-momentum scheme of a link that rotates in a time step, from r0 to r1 = r0 + 2 d: the implicit midpoint rule with the mean force of the step
   [J. C. Simo, N. Tarnow; O. Gonzalez]. With W the energy of the law, R = |r|, and x the strain,

     f(d) = g (r0 + d),  g = 2 tau / (R0 + R1),  tau = (W(x1) - W(x0)) / (x1 - x0).

   Its work in the step is tau (R1 - R0) = W(x1) - W(x0), for any step and law: energy is conserved. Its direction is that of r0 + r1: angular
   momentum is conserved. The unknown d is half the change of r; r0, at the start of the step, replaces the drawn configuration.

   Local stage. With the search direction E, as in structure/turning.h, r0 + d = (g + E)^-1 w: the only unknown is R1, the root of

     |2 (g(R1) + E)^-1 w - r0| - R1 = 0,

   whose left side decreases, as g increases with R1. A link of constant direction n has f(d) = tau n, with the same work.
*/
#ifndef LATINMIDPOINT_H
#define LATINMIDPOINT_H

#include "structure/laws.h"

/* times eps and the energies: rounding of W(x1) - W(x0). The mean of the end tensions, if it does this work to rounding, is tau: no cancellation */
#define LATIN_MIDPOINT_NOISE 16.0

/* Returns the mean tension tau between the strains x0 and x1; slope: its derivative with respect to x1 */
static inline PetscReal LatinMidpointTension(const LatinLaw *law, PetscReal k, PetscReal x0, PetscReal x1, PetscReal *slope)
{
  const PetscReal t1 = law->tension(k, x1, law->ctx), mean = 0.5 * (law->tension(k, x0, law->ctx) + t1), d = x1 - x0;
  const PetscReal w0 = law->energy(k, x0, law->ctx), w1 = law->energy(k, x1, law->ctx);

  if (PetscAbsReal(w1 - w0 - mean * d) <= LATIN_MIDPOINT_NOISE * PETSC_MACHINE_EPSILON * (PetscAbsReal(w0) + PetscAbsReal(w1))) {
    *slope = 0.5 * law->tangent(k, x1, law->ctx);
    return mean;
  }
  *slope = (t1 - (w1 - w0) / d) / d;
  return (w1 - w0) / d;
}

/* Returns g; S: R0 + R1; slope: derivative of g with respect to R1 */
static inline PetscReal LatinMidpointForce(const LatinLaw *law, PetscReal k, PetscReal x0, PetscReal x1, PetscReal S, PetscReal *slope)
{
  const PetscReal tension = LatinMidpointTension(law, k, x0, x1, slope);

  *slope = 2.0 * (*slope - tension / S) / S;
  return 2.0 * tension / S;
}

/*
   Local stage of a link of constant direction: returns its length R, the root of tau + k R = w. tau: tension(R - natural); in a time step, R0 not NULL,
   the mean tension from R0 to 2 R - R0. R: initial guess. Newton's method within a bracket, which exists as the slope of the left side is at least k
*/
static inline PetscReal LatinLawLength(const LatinLaw *law, PetscReal stiffness, PetscReal natural, PetscReal k, PetscReal w, const PetscReal *R0, PetscReal R)
{
  PetscReal low = -PETSC_MAX_REAL, high = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < LATIN_ROOT_MOST; i++) {
    PetscReal slope, next, g = k * R - w;

    if (R0) g += LatinMidpointTension(law, stiffness, *R0 - natural, 2.0 * R - *R0 - natural, &slope);
    else g += law->tension(stiffness, R - natural, law->ctx);
    if (g == 0.0) break;
    if (g > 0.0) {
      high = R;
      low  = PetscMax(low, R - g / k);
    } else {
      low  = R;
      high = PetscMin(high, R - g / k);
    }
    next = R - g / (k + (R0 ? 2.0 * slope : law->tangent(stiffness, R - natural, law->ctx)));
    if (PetscAbsReal(next - R) <= 2.0 * PETSC_MACHINE_EPSILON * PetscAbsReal(R)) return next;
    R = next > low && next < high ? next : 0.5 * (low + high);
  }
  return R;
}

/* Local stage of one link */
typedef struct {
  const LatinLaw *law;
  PetscInt        dim;
  PetscReal       stiffness, natural; /* k and L of the law */
  PetscReal       k, c;               /* search direction E: of the first component, of the others */
  PetscReal       w[3], r0[3], R0;    /* right-hand side; vector and length at the start of the step */
} LatinMidpoint;

/* Solves the local stage of a link; returns g. r: set to r0 + d */
static inline PetscReal LatinMidpointSolve(const LatinMidpoint *link, PetscReal r[])
{
  PetscReal low = 0.0, high = PETSC_MAX_REAL, R = link->R0, g = 0.0;

  for (PetscInt i = 0; i < LATIN_ROOT_MOST; i++) {
    PetscReal size = 0.0, fall = 0.0, slope, next;

    g = LatinMidpointForce(link->law, link->stiffness, link->R0 - link->natural, R - link->natural, link->R0 + R, &slope);
    for (PetscInt c = 0; c < link->dim; c++) {
      const PetscReal all = g + (c ? link->c : link->k);

      r[c] = all > 0.0 ? link->w[c] / all : 0.0;
      size += PetscSqr(2.0 * r[c] - link->r0[c]);
      fall += all > 0.0 ? 2.0 * (2.0 * r[c] - link->r0[c]) * r[c] / all : 0.0;
    }
    size = PetscSqrtReal(size);
    if (!(g + PetscMin(link->k, link->c) > 0.0) || size > R) low = R; /* left of the root */
    else high = R;
    next = size > 0.0 ? R + (size - R) / (1.0 + slope * fall / size) : -1.0;
    if (PetscAbsReal(next - R) <= 4.0 * PETSC_MACHINE_EPSILON * R) break;
    if (!(next > low && next < high)) next = high < PETSC_MAX_REAL ? 0.5 * (low + high) : 2.0 * R + PetscAbsReal(link->natural);
    R = next;
  }
  return g;
}

#endif
