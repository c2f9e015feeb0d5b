#include "structure/laws.h"

/* The table of laws: those of structure/laws.h as functions of one form */

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

static PetscReal LatinLawTension_Cable(PetscReal k, PetscReal x, void *ctx)
{
  return LatinUnilateralTension(1.0, k, x);
}

static PetscReal LatinLawTangent_Cable(PetscReal k, PetscReal x, void *ctx)
{
  return LatinUnilateralTangent(1.0, k, x);
}

static PetscReal LatinLawEnergy_Cable(PetscReal k, PetscReal x, void *ctx)
{
  return LatinUnilateralEnergy(1.0, k, x);
}

static PetscReal LatinLawLocal_Cable(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  return LatinUnilateralLocal(1.0, k, e0, y);
}

static PetscReal LatinLawTension_CompressionOnly(PetscReal k, PetscReal x, void *ctx)
{
  return LatinUnilateralTension(-1.0, k, x);
}

static PetscReal LatinLawTangent_CompressionOnly(PetscReal k, PetscReal x, void *ctx)
{
  return LatinUnilateralTangent(-1.0, k, x);
}

static PetscReal LatinLawEnergy_CompressionOnly(PetscReal k, PetscReal x, void *ctx)
{
  return LatinUnilateralEnergy(-1.0, k, x);
}

static PetscReal LatinLawLocal_CompressionOnly(PetscReal k, PetscReal e0, PetscReal y, void *ctx)
{
  return LatinUnilateralLocal(-1.0, k, e0, y);
}

static PetscReal LatinLawLocal_Inextensible(PetscReal l, PetscReal e0, PetscReal y, void *ctx)
{
  return LatinRigidLocal(1.0, l, e0, y);
}

static PetscReal LatinLawLocal_Contact(PetscReal l, PetscReal e0, PetscReal y, void *ctx)
{
  return LatinRigidLocal(-1.0, l, e0, y);
}

/* In the order of LatinLawType, then what is registered. The tangential parts of a contact with friction have no law of their own: stages/localcontacts.c */
LatinLaw LatinLaws[LATIN_LAWS_MAX] = {
  {.name = "bar", .smooth = PETSC_TRUE, .tension = LatinLawTension_Bar, .tangent = LatinLawTangent_Bar, .energy = LatinLawEnergy_Bar, .local = LatinLawLocal_Bar},
  {.name = "cable", .tension = LatinLawTension_Cable, .tangent = LatinLawTangent_Cable, .energy = LatinLawEnergy_Cable, .local = LatinLawLocal_Cable},
  {.name = "compression_only", .tension = LatinLawTension_CompressionOnly, .tangent = LatinLawTangent_CompressionOnly, .energy = LatinLawEnergy_CompressionOnly, .local = LatinLawLocal_CompressionOnly},
  {.name = "inextensible", .rigid = PETSC_TRUE, .cure = "the extensible law cable with a large stiffness", .local = LatinLawLocal_Inextensible},
  {.name = "contact", .rigid = PETSC_TRUE, .cure = "the elastic law compression_only with a large stiffness", .local = LatinLawLocal_Contact},
  {.name = "friction", .rigid = PETSC_TRUE, .cure = "the elastic laws compression_only and bar", .local = LatinLawLocal_Contact},
  {.name = "tangent", .rigid = PETSC_TRUE, .cure = "the elastic laws compression_only and bar", .local = LatinLawLocal_Bar}
};
PetscInt LatinLawCount = LATIN_LAW_TANGENT + 1;
