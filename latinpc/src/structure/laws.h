/*
   Constitutive laws. The strain variable is x = e + e0. The local stage meets the law along the ascent direction
   (tau_hat - tau) + l (e_hat - e) = 0, that is tau_hat + l e_hat = y with y = tau + l e, and returns the descent datum
   s = tau_hat - l e_hat, which is all that the linear stage (26) needs; tau_hat is (y + s) / 2.

   Elastic laws have l = k. Rigid ones have no stiffness of their own: there, k is the ascent direction and nothing else,
   and the tension is no function of the strain.

   Unilateral laws come in pairs: sign is 1 for those that bear traction (cable, inextensible), -1 for their mirror images
   that bear compression (compression-only, contact). The relations stand here once, for the table of laws and for the
   sweep over equal subdomains, where they become vector instructions.
*/
#ifndef LATINLAWS_H
#define LATINLAWS_H

#include "latinpc.h"

/* A bar (2) */
static inline PetscReal LatinBarTension(PetscReal k, PetscReal x)
{
  return k * x;
}

static inline PetscReal LatinBarEnergy(PetscReal k, PetscReal x)
{
  return 0.5 * k * x * x;
}

/* tau_hat = k (e_hat + e0), so tau_hat - k e_hat does not depend on the state */
static inline PetscReal LatinBarLocal(PetscReal k, PetscReal e0)
{
  return k * e0;
}

/* (4), equivalent to the complementarity (5): as a bar when taut, otherwise slack. With e0 > 0 and sign -1, an elastic contact with that gap */
static inline PetscReal LatinUnilateralTension(PetscReal sign, PetscReal k, PetscReal x)
{
  return sign * x > 0.0 ? LatinBarTension(k, x) : 0.0;
}

static inline PetscReal LatinUnilateralTangent(PetscReal sign, PetscReal k, PetscReal x)
{
  return sign * x > 0.0 ? k : 0.0;
}

static inline PetscReal LatinUnilateralEnergy(PetscReal sign, PetscReal k, PetscReal x)
{
  return sign * x > 0.0 ? LatinBarEnergy(k, x) : 0.0;
}

/* Taut: tau_hat = (y + k e0) / 2. Slack: tau_hat = 0, k e_hat = y */
static inline PetscReal LatinUnilateralLocal(PetscReal sign, PetscReal k, PetscReal e0, PetscReal y)
{
  const PetscReal taut = LatinBarLocal(k, e0);

  return sign * (y + taut) > 0.0 ? taut : -y;
}

/* (3): 0 <= -sign x, sign tau >= 0, one of them zero. tau_hat: taut, e_hat = -e0; slack, no tension */
static inline PetscReal LatinRigidTension(PetscReal sign, PetscReal l, PetscReal e0, PetscReal y)
{
  const PetscReal r = y + l * e0;

  return sign * r > 0.0 ? r : 0.0;
}

static inline PetscReal LatinRigidLocal(PetscReal sign, PetscReal l, PetscReal e0, PetscReal y)
{
  return LatinRigidTension(sign, l, e0, y) != 0.0 ? y + 2.0 * l * e0 : -y;
}

/* ---- the table of laws (structure/laws.c), and what is added to it (structure/userlaws.c) ---- */
typedef struct {
  const char *name;
  const char *cure;                                                      /* what to take for a rigid law where a stiffness is needed */
  PetscBool   smooth;                                                    /* a linear law carries no state */
  PetscBool   rigid;                                                     /* the tension is no function of the strain: no tension, tangent, energy */
  PetscReal   stiffness;                                                 /* its own, where a link is given none; 0: it has none */
  PetscReal (*tension)(PetscReal k, PetscReal x, void *ctx);             /* tau for the strain x = e + e0 */
  PetscReal (*tangent)(PetscReal k, PetscReal x, void *ctx);             /* an element of the generalised derivative */
  PetscReal (*energy)(PetscReal k, PetscReal x, void *ctx);              /* the convex potential whose derivative is the tension */
  PetscReal (*local)(PetscReal l, PetscReal e0, PetscReal y, void *ctx); /* local stage: y = tau + l e gives tau_hat - l e_hat; NULL: from the tension */
  void *ctx;
} LatinLaw;
#define LATIN_LAWS_MAX 64 /* laws in the table, the built-in ones included */
PETSC_INTERN LatinLaw       LatinLaws[];
PETSC_INTERN PetscInt       LatinLawCount;
PETSC_INTERN PetscReal      LatinLawLocal(PetscInt law, PetscReal l, PetscReal e0, PetscReal y);
PETSC_INTERN PetscErrorCode LatinLawsFinalize_Private(void);

/* The sign of a unilateral law of the table */
static inline PetscReal LatinLawSign(PetscInt law)
{
  return law == LATIN_LAW_COMPRESSION_ONLY || law == LATIN_LAW_CONTACT || law == LATIN_LAW_FRICTION ? -1.0 : 1.0;
}

#endif
