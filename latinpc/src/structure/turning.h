/*
   Links that turn: the force on the second node of a link between ends a distance r apart, of size R, is along r, with the
   tension of its law at the strain R - L, L the natural length:

     f(r) = tau(R - L) r / R.

   Local stage. With a state s = f - E (r - r0) the search direction E = k n n^t + c (1 - n n^t) gives

     f(r) + E r = w,  w = s + 2 E d + E r0,

   d the relative displacement of the ends in the linear stage, r0 that of the drawn configuration. For rho = tau / R the parts of r
   along n and across it are w_n / (rho + k) and |w_t| / (rho + c). So R alone is unknown, a root of

     w_n^2 / (tau + k R)^2 + w_t^2 / (tau + c R)^2 = 1.

   With tau + c R > 0 the left side falls from infinity to zero, and there is one root: of two springs in a row, the law and
   the search direction, the latter is stiff enough.
*/
#ifndef LATINTURNING_H
#define LATINTURNING_H

#include "structure/laws.h"

#define LATIN_TURNING_MOST 200 /* trial lengths: a safeguard, Newton's method takes 3 to 8 */

/* What the stages of a link that turns need besides a link's: k and L of its law, the scale of the part, and 1 where it keeps its direction, else 0. A part along the unit
   vector b has the row sqrt(E_b / E) b of B: all parts have one search parameter E, and the norm of a state is its energy */
enum { LATIN_PART_STIFFNESS, LATIN_PART_NATURAL, LATIN_PART_SCALE, LATIN_PART_KEEPS, LATIN_PART };

/* The equation of one link that keeps its direction n: tau(R - L) + k R = w for the part R of r along n, the left side increasing by k at least */
static inline PetscReal LatinKeepLength(const LatinLaw *law, PetscReal stiffness, PetscReal natural, PetscReal k, PetscReal w)
{
  PetscReal R = w / k, low = -PETSC_MAX_REAL, high = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < LATIN_TURNING_MOST; i++) {
    const PetscReal g = law->tension(stiffness, R - natural, law->ctx) + k * R - w;
    PetscReal       next;

    if (g == 0.0) break;
    if (g > 0.0) {
      high = R;
      low  = PetscMax(low, R - g / k);
    } else {
      low  = R;
      high = PetscMin(high, R - g / k);
    }
    next = R - g / (law->tangent(stiffness, R - natural, law->ctx) + k);
    if (PetscAbsReal(next - R) <= 2.0 * PETSC_MACHINE_EPSILON * PetscAbsReal(R)) return next;
    R = next > low && next < high ? next : 0.5 * (low + high);
  }
  return R;
}

/* The equation of one link */
typedef struct {
  const LatinLaw *law;
  PetscReal       stiffness, natural;  /* k and L of the law */
  PetscReal       k, c, along, across; /* search direction; w_n, |w_t| */
} LatinTurn;

/* g(R) = 1 / sqrt(left side) - 1, nearly linear in R; infinite where tau + c R <= 0 */
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

/* The root R: Newton's method within a bracket */
static inline PetscReal LatinTurnLength(const LatinTurn *turn)
{
  PetscReal low = 0.0, high = PETSC_MAX_REAL, R = PetscSqrtReal(PetscSqr(turn->along / turn->k) + PetscSqr(turn->across / turn->c)); /* that of a slack cable */

  if (!(R > 0.0)) R = PetscMax(turn->natural, 0.0);
  for (PetscInt i = 0; i < LATIN_TURNING_MOST; i++) {
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
