/*
   Rotating links: r is the vector between the ends of a link, of length R. The force on the second node acts along r, with the
   tension of the law at the strain R - L, where L is the natural length:

     f(r) = tau(R - L) r / R.

   Local stage. With a state s = f - E (r - r0) the search direction E = k n n^t + c (1 - n n^t) gives

     f(r) + E r = w,  w = s + 2 E d + E r0,

   where d is the relative displacement of the ends in the linear stage, and r0 is r as drawn. With rho = tau / R the components of r along n and
   across it are w_n / (rho + k) and |w_t| / (rho + c). So R is the only unknown, a root of

     w_n^2 / (tau + k R)^2 + w_t^2 / (tau + c R)^2 = 1.

   Where tau + k R > 0 and tau + c R > 0, the left side decreases from infinity to zero: the root is unique.
*/
#ifndef LATINTURNING_H
#define LATINTURNING_H

#include "structure/laws.h"

/*
   Data of a part of a rotating link: k and L of its law; its scale; 1 if the link has a fixed direction, else 0. A part along the unit vector b with the
   search parameter E_b has the row sqrt(E_b / E) b of B, its scale times b: so all parts have the same E, and the norm of a state is its energy
*/
enum { LATIN_PART_STIFFNESS, LATIN_PART_NATURAL, LATIN_PART_SCALE, LATIN_PART_KEEPS, LATIN_PART };

/* The equation for R of one link */
typedef struct {
  const LatinLaw *law;
  PetscReal       stiffness, natural;  /* k and L of the law */
  PetscReal       k, c, along, across; /* search direction E; w_n, |w_t| */
} LatinTurn;

/* Returns g(R) = 1 / sqrt(left side) - 1, nearly linear in R, or -1 where tau + k R <= 0 or tau + c R <= 0; slope: its derivative, or 0 */
static inline PetscReal LatinTurnMiss(const LatinTurn *turn, PetscReal R, PetscReal *slope)
{
  const PetscReal x = R - turn->natural, t = turn->law->tension(turn->stiffness, x, turn->law->ctx), dt = turn->law->tangent(turn->stiffness, x, turn->law->ctx);
  const PetscReal A = t + turn->k * R, C = t + turn->c * R;
  PetscReal       a, c, h;

  *slope = 0.0;
  if (!(A > 0.0) || !(C > 0.0)) return -1.0; /* left of the root */
  a = turn->along / A;
  c = turn->across / C;
  h = a * a + c * c;
  if (!(h > 0.0)) return PETSC_MAX_REAL;
  *slope = (a * a * (dt + turn->k) / A + c * c * (dt + turn->c) / C) / (h * PetscSqrtReal(h));
  return 1.0 / PetscSqrtReal(h) - 1.0;
}

/* Returns the root R, by Newton's method within a bracket */
static inline PetscReal LatinTurnLength(const LatinTurn *turn)
{
  PetscReal low = 0.0, high = PETSC_MAX_REAL, R = PetscSqrtReal(PetscSqr(turn->along / turn->k) + PetscSqr(turn->across / turn->c)); /* initial guess: the length of a slack cable */

  if (!(R > 0.0)) R = PetscMax(turn->natural, 0.0);
  for (PetscInt i = 0; i < LATIN_ROOT_MOST; i++) {
    PetscReal slope, miss = LatinTurnMiss(turn, R, &slope), next;

    if (miss < 0.0) low = R;
    else high = R;
    next = slope > 0.0 ? R - miss / slope : -1.0;
    if (PetscAbsReal(next - R) <= 2.0 * PETSC_MACHINE_EPSILON * R) return next;
    if (!(next > low && next < high)) next = high < PETSC_MAX_REAL ? 0.5 * (low + high) : 2.0 * R + PetscAbsReal(turn->natural);
    R = next;
  }
  return R;
}

#endif
