/*
   Constitutive laws of the strain x = e + e0. The local stage intersects the law with the ascent direction (tau_hat - tau) + l (e_hat - e) = 0, that
   is tau_hat + l e_hat = y with y = tau + l e. It returns the descent datum s = tau_hat - l e_hat, the only input of the linear stage (26); tau_hat is
   (y + s) / 2.

   Elastic laws have l = k. Rigid laws have no stiffness: their k is the ascent direction alone, and their tension is not a function of the strain.

   Unilateral laws come in pairs: sign is 1 for traction (cable, inextensible), -1 for compression (compression only, contact). The functions are
   inlined in the table of laws, and in the sweep over equal subdomains, which the compiler vectorises.
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

/* (4), equivalent to the complementarity (5): that of a bar if taut, else zero. With e0 > 0 and sign -1, an elastic contact with the gap e0 */
static inline PetscReal LatinUnilateralTension(PetscReal sign, PetscReal k, PetscReal x)
{
  return sign * x > 0.0 ? LatinBarTension(k, x) : 0.0;
}

static inline PetscReal LatinUnilateralTangent(PetscReal sign, PetscReal k, PetscReal x)
{
  return sign * x >= 0.0 ? k : 0.0;
}

static inline PetscReal LatinUnilateralEnergy(PetscReal sign, PetscReal k, PetscReal x)
{
  return sign * x > 0.0 ? LatinBarEnergy(k, x) : 0.0;
}

/* Taut: tau_hat = (y + k e0) / 2, s = k e0. Slack: tau_hat = 0, k e_hat = y, s = -y */
static inline PetscReal LatinUnilateralLocal(PetscReal sign, PetscReal k, PetscReal e0, PetscReal y)
{
  const PetscReal taut = LatinBarLocal(k, e0);

  return sign * (y + taut) > 0.0 ? taut : -y;
}

/* tau_hat of (3): -sign x >= 0, sign tau >= 0, one of them zero. Taut: e_hat = -e0, tau_hat = y + l e0. Slack: tau_hat = 0 */
static inline PetscReal LatinRigidTension(PetscReal sign, PetscReal l, PetscReal e0, PetscReal y)
{
  const PetscReal r = y + l * e0;

  return sign * r > 0.0 ? r : 0.0;
}

static inline PetscReal LatinRigidLocal(PetscReal sign, PetscReal l, PetscReal e0, PetscReal y)
{
  return LatinRigidTension(sign, l, e0, y) != 0.0 ? y + 2.0 * l * e0 : -y;
}

/* ---- the table of laws (structure/laws.c), with registered ones (structure/userlaws.c) ---- */
typedef struct {
  const char *name;
  const char *cure;                                                      /* elastic replacement of a rigid law, for error messages */
  PetscBool   smooth;                                                    /* whether the law is linear: no state in the local stage */
  PetscBool   rigid;                                                     /* whether the tension is no function of the strain: NULL tension, tangent, energy */
  PetscReal   stiffness;                                                 /* default stiffness of links, force/length; 0: none */
  PetscReal (*tension)(PetscReal k, PetscReal x, void *ctx);             /* tau at the strain x = e + e0 */
  PetscReal (*tangent)(PetscReal k, PetscReal x, void *ctx);             /* an element of the generalised derivative */
  PetscReal (*energy)(PetscReal k, PetscReal x, void *ctx);              /* the convex potential whose derivative is the tension */
  PetscReal (*local)(PetscReal l, PetscReal e0, PetscReal y, void *ctx); /* local stage: y = tau + l e gives tau_hat - l e_hat; NULL: from the tension */
  void *ctx;
} LatinLaw;
#define LATIN_ROOT_MOST 200 /* most steps of Newton's method with bisection in the local stage of a link; measured: 2 on average, 20 at most */
PETSC_INTERN LatinLaw       LatinBuiltInLaws[];
PETSC_INTERN LatinLaw      *LatinLaws; /* the built-in laws, or a copy followed by the registered ones, which moves when it grows */
PETSC_INTERN PetscInt       LatinLawCount;
PETSC_INTERN PetscReal      LatinLawLocal(PetscInt law, PetscReal l, PetscReal e0, PetscReal y);
PETSC_INTERN PetscInt       LatinLawPoints(PetscInt law, const PetscReal *strain[], const PetscReal *tension[]);
PETSC_INTERN PetscErrorCode LatinLawsSame_Private(MPI_Comm, PetscInt last);
PETSC_INTERN PetscErrorCode LatinLawsFinalize_Private(void);

/* Returns the sign of a built-in unilateral law */
static inline PetscReal LatinLawSign(PetscInt law)
{
  return law == LATIN_LAW_COMPRESSION_ONLY || law == LATIN_LAW_CONTACT || law == LATIN_LAW_FRICTION ? -1.0 : 1.0;
}

#endif
