#include "structure/laws.h"

/* The table of built-in laws: the functions of structure/laws.h with one signature */

const char *const LatinLawTypes[] = {"bar", "cable", "compression_only", "inextensible", "contact", "friction", "tangent", "LatinLawType", "LATIN_LAW_", NULL};

static PetscReal LatinLawTension_Bar(PetscReal k, PetscReal x, void *ctx)
{
  return LatinBarTension(k, x);
}

static PetscReal LatinLawTangent_Bar(PetscReal k, PetscReal x, void *ctx)
{
  return k;
}

static PetscReal LatinLawEnergy_Bar(PetscReal k, PetscReal x, void *ctx)
{
  return LatinBarEnergy(k, x);
}

static PetscReal LatinLawLocal_Bar(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  return LatinBarLocal(k, e0);
}

/* The context of unilateral laws is their sign */
static PetscReal traction = 1.0, compression = -1.0;

static PetscReal LatinLawTension_Unilateral(PetscReal k, PetscReal x, void *sign)
{
  return LatinUnilateralTension(*(const PetscReal *)sign, k, x);
}

static PetscReal LatinLawTangent_Unilateral(PetscReal k, PetscReal x, void *sign)
{
  return LatinUnilateralTangent(*(const PetscReal *)sign, k, x);
}

static PetscReal LatinLawEnergy_Unilateral(PetscReal k, PetscReal x, void *sign)
{
  return LatinUnilateralEnergy(*(const PetscReal *)sign, k, x);
}

static PetscReal LatinLawLocal_Unilateral(PetscReal k, PetscReal e0, PetscReal y, void *sign)
{
  return LatinUnilateralLocal(*(const PetscReal *)sign, k, e0, y);
}

static PetscReal LatinLawLocal_Rigid(PetscReal l, PetscReal e0, PetscReal y, void *sign)
{
  return LatinRigidLocal(*(const PetscReal *)sign, l, e0, y);
}

/* In the order of LatinLawType. Parts of contacts with friction depend on each other: their local stage is in stages/localcontacts.c */
LatinLaw LatinBuiltInLaws[] = {
  {.name = "bar", .smooth = PETSC_TRUE, .tension = LatinLawTension_Bar, .tangent = LatinLawTangent_Bar, .energy = LatinLawEnergy_Bar, .local = LatinLawLocal_Bar},
  {.name = "cable", .tension = LatinLawTension_Unilateral, .tangent = LatinLawTangent_Unilateral, .energy = LatinLawEnergy_Unilateral, .local = LatinLawLocal_Unilateral, .ctx = &traction},
  {.name = "compression_only", .tension = LatinLawTension_Unilateral, .tangent = LatinLawTangent_Unilateral, .energy = LatinLawEnergy_Unilateral, .local = LatinLawLocal_Unilateral, .ctx = &compression},
  {.name = "inextensible", .rigid = PETSC_TRUE, .cure = "the extensible law cable with a large stiffness", .local = LatinLawLocal_Rigid, .ctx = &traction},
  {.name = "contact", .rigid = PETSC_TRUE, .cure = "the elastic law compression_only with a large stiffness", .local = LatinLawLocal_Rigid, .ctx = &compression},
  {.name = "friction", .rigid = PETSC_TRUE, .cure = "the elastic laws compression_only and bar", .local = LatinLawLocal_Rigid, .ctx = &compression},
  {.name = "tangent", .rigid = PETSC_TRUE, .cure = "the elastic laws compression_only and bar", .local = LatinLawLocal_Bar}
};
LatinLaw *LatinLaws     = LatinBuiltInLaws;
PetscInt  LatinLawCount = LATIN_LAW_TANGENT + 1;
