#include "latinimpl.h"

/*
   Constitutive laws. The strain variable is x = e + e0. The local stage meets the law along the ascent
   direction (tau_hat - tau) + l (e_hat - e) = 0 with l = k, that is tau_hat + k e_hat = y with y = tau + k e,
   and returns the descent datum tau_hat - k e_hat, which is all that the linear stage (26) needs.
*/
const char *const LatinLawTypes[] = {"bar", "cable", "strut", "LatinLawType", "LATIN_LAW_", NULL};

static PetscReal LatinLawTension_Bar(PetscReal k, PetscReal x)
{
  return k * x;
}

static PetscReal LatinLawTangent_Bar(PetscReal k, PetscReal x)
{
  (void)x;
  return k;
}

static PetscReal LatinLawEnergy_Bar(PetscReal k, PetscReal x)
{
  return 0.5 * k * x * x;
}

/* tau_hat = k (e_hat + e0), so tau_hat - k e_hat does not depend on the state */
static PetscReal LatinLawLocal_Bar(PetscReal k, PetscReal e0, PetscReal y)
{
  (void)y;
  return k * e0;
}

/* (4), equivalent to the complementarity (5): taut as a bar when stretched, otherwise slack */
static PetscReal LatinLawTension_Cable(PetscReal k, PetscReal x)
{
  return x > 0.0 ? k * x : 0.0;
}

static PetscReal LatinLawTangent_Cable(PetscReal k, PetscReal x)
{
  return x > 0.0 ? k : 0.0;
}

static PetscReal LatinLawEnergy_Cable(PetscReal k, PetscReal x)
{
  return x > 0.0 ? 0.5 * k * x * x : 0.0;
}

/* Taut: tau_hat = (y + k e0) / 2 > 0. Slack: tau_hat = 0, k e_hat = y. */
static PetscReal LatinLawLocal_Cable(PetscReal k, PetscReal e0, PetscReal y)
{
  return y + k * e0 > 0.0 ? k * e0 : -y;
}

/* The mirror image of a cable: carries compression only */
static PetscReal LatinLawTension_Strut(PetscReal k, PetscReal x)
{
  return x < 0.0 ? k * x : 0.0;
}

static PetscReal LatinLawTangent_Strut(PetscReal k, PetscReal x)
{
  return x < 0.0 ? k : 0.0;
}

static PetscReal LatinLawEnergy_Strut(PetscReal k, PetscReal x)
{
  return x < 0.0 ? 0.5 * k * x * x : 0.0;
}

static PetscReal LatinLawLocal_Strut(PetscReal k, PetscReal e0, PetscReal y)
{
  return y + k * e0 < 0.0 ? k * e0 : -y;
}

/* In the order of LatinLawType */
const LatinLaw LatinLaws[] = {
  {"bar",   PETSC_TRUE,  LatinLawTension_Bar,   LatinLawTangent_Bar,   LatinLawEnergy_Bar,   LatinLawLocal_Bar  },
  {"cable", PETSC_FALSE, LatinLawTension_Cable, LatinLawTangent_Cable, LatinLawEnergy_Cable, LatinLawLocal_Cable},
  {"strut", PETSC_FALSE, LatinLawTension_Strut, LatinLawTangent_Strut, LatinLawEnergy_Strut, LatinLawLocal_Strut}
};
const PetscInt LatinLawCount = 3;
