#include "latinimpl.h"

/*
   Constitutive laws. The strain variable is x = e + e0. The local stage meets the law along the ascent
   direction (tau_hat - tau) + l (e_hat - e) = 0, that is tau_hat + l e_hat = y with y = tau + l e, and returns the
   descent datum s = tau_hat - l e_hat, which is all that the linear stage (26) needs; tau_hat is (y + s) / 2.

   Elastic laws have l = k. Rigid ones have no stiffness of their own: there, k is the ascent direction and nothing else,
   and the tension is no function of the strain. Other laws, tables and the user's, are in lawregister.c.
*/
const char *const LatinLawTypes[] = {"bar", "cable", "strut", "inextensible", "contact", "friction", "tangent", "LatinLawType", "LATIN_LAW_", NULL};

static PetscReal LatinLawTension_Bar(PetscReal k, PetscReal x, void *ctx)
{
  return k * x;
}

static PetscReal LatinLawTangent_Bar(PetscReal k, PetscReal x, void *ctx)
{
  return k;
}

static PetscReal LatinLawEnergy_Bar(PetscReal k, PetscReal x, void *ctx)
{
  return 0.5 * k * x * x;
}

/* tau_hat = k (e_hat + e0), so tau_hat - k e_hat does not depend on the state */
static PetscReal LatinLawLocal_Bar(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  return k * e0;
}

/* (4), equivalent to the complementarity (5): taut as a bar when stretched, otherwise slack */
static PetscReal LatinLawTension_Cable(PetscReal k, PetscReal x, void *ctx)
{
  return x > 0.0 ? k * x : 0.0;
}

static PetscReal LatinLawTangent_Cable(PetscReal k, PetscReal x, void *ctx)
{
  return x > 0.0 ? k : 0.0;
}

static PetscReal LatinLawEnergy_Cable(PetscReal k, PetscReal x, void *ctx)
{
  return x > 0.0 ? 0.5 * k * x * x : 0.0;
}

/* Taut: tau_hat = (y + k e0) / 2 > 0. Slack: tau_hat = 0, k e_hat = y. */
static PetscReal LatinLawLocal_Cable(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  return y + k * e0 > 0.0 ? k * e0 : -y;
}

/* The mirror image of a cable: carries compression only. With e0 > 0, an elastic contact with that gap */
static PetscReal LatinLawTension_Strut(PetscReal k, PetscReal x, void *ctx)
{
  return x < 0.0 ? k * x : 0.0;
}

static PetscReal LatinLawTangent_Strut(PetscReal k, PetscReal x, void *ctx)
{
  return x < 0.0 ? k : 0.0;
}

static PetscReal LatinLawEnergy_Strut(PetscReal k, PetscReal x, void *ctx)
{
  return x < 0.0 ? 0.5 * k * x * x : 0.0;
}

static PetscReal LatinLawLocal_Strut(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  return y + k * e0 < 0.0 ? k * e0 : -y;
}

/* (3): 0 <= -(e + e0), tau >= 0, one of them zero. Taut: e_hat = -e0, tau_hat = y + l e0 > 0. Slack: tau_hat = 0. */
static PetscReal LatinLawLocal_Inextensible(PetscReal l, PetscReal e0, PetscReal y, void *ctx)
{
  return y + l * e0 > 0.0 ? y + 2.0 * l * e0 : -y;
}

/* The mirror image: 0 <= e + e0, tau <= 0, one of them zero; e0 is the gap */
static PetscReal LatinLawLocal_Contact(PetscReal l, PetscReal e0, PetscReal y, void *ctx)
{
  return y + l * e0 < 0.0 ? y + 2.0 * l * e0 : -y;
}

/* In the order of LatinLawType, then what is registered. The tangential parts of a contact with friction have no law of their own: contact.c */
LatinLaw LatinLaws[LATIN_LAWS_MAX] = {
  {.name = "bar", .smooth = PETSC_TRUE, .tension = LatinLawTension_Bar, .tangent = LatinLawTangent_Bar, .energy = LatinLawEnergy_Bar, .local = LatinLawLocal_Bar},
  {.name = "cable", .tension = LatinLawTension_Cable, .tangent = LatinLawTangent_Cable, .energy = LatinLawEnergy_Cable, .local = LatinLawLocal_Cable},
  {.name = "strut", .tension = LatinLawTension_Strut, .tangent = LatinLawTangent_Strut, .energy = LatinLawEnergy_Strut, .local = LatinLawLocal_Strut},
  {.name = "inextensible", .rigid = PETSC_TRUE, .cure = "the extensible law cable with a large stiffness", .local = LatinLawLocal_Inextensible},
  {.name = "contact", .rigid = PETSC_TRUE, .cure = "the elastic law strut with a large stiffness", .local = LatinLawLocal_Contact},
  {.name = "friction", .rigid = PETSC_TRUE, .cure = "the elastic laws strut and bar", .local = LatinLawLocal_Contact},
  {.name = "tangent", .rigid = PETSC_TRUE, .cure = "the elastic laws strut and bar", .local = LatinLawLocal_Bar}
};
PetscInt LatinLawCount = LATIN_LAW_TANGENT + 1;
