#include "base/latinbase.h"

/*
   Check of PETSc at run time; registration of classes and log events. All objects depend on this file; the solver types, which depend on the objects, are
   registered by register.c.
*/

PetscClassId  LATIN_CLASSID, LATIN_STRUCTURE_CLASSID;
PetscLogEvent LATIN_SetUp, LATIN_Partition, LATIN_Subdomains, LATIN_Interface, LATIN_Direction, LATIN_Macro, LATIN_Spectral, LATIN_Linear, LATIN_Coarse, LATIN_Local, LATIN_Condense, LATIN_Estimate, LATIN_Cases;

static PetscBool registered = PETSC_FALSE;

PetscErrorCode (*LatinTypesRegister_Private)(void) = NULL;

/* Resets at PetscFinalize(): the next PetscInitialize() registers again */
static PetscErrorCode LatinForgetClasses(void)
{
  PetscFunctionBegin;
  registered = PETSC_FALSE;
  PetscFunctionReturn(0);
}

/* Properties of PETSc that a compiled library depends on */
typedef struct {
  int           major, minor, release;
  size_t        integer; /* bytes of a PetscInt */
  PetscDataType real, scalar;
} LatinPetsc;

/* Writes the properties to text, [n] */
static PetscErrorCode LatinPetscDescribe(const LatinPetsc *petsc, char text[], size_t n)
{
  PetscFunctionBegin;
  PetscCall(PetscSNPrintf(text, n, "PETSc %d.%d%s with PetscInt of %d bits, PetscReal %s and PetscScalar %s", petsc->major, petsc->minor, petsc->release ? "" : " in development", 8 * (int)petsc->integer, PetscDataTypes[petsc->real],
                          PetscDataTypes[petsc->scalar]));
  PetscFunctionReturn(0);
}

/*
   Checks that the PETSc of the program is like the one at compile time: the loader compares names alone, which are the same in all versions. The calls here
   work with any PETSc: a PetscInt may have four bytes or eight, a PetscBool one or four.
*/
static PetscErrorCode LatinCheckPetsc(void)
{
  const LatinPetsc built = {PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_RELEASE, sizeof(PetscInt), PETSC_REAL, PETSC_SCALAR};
  LatinPetsc       found = {0, 0, 0, 0, PETSC_DATATYPE_UNKNOWN, PETSC_DATATYPE_UNKNOWN};
  char             ours[128], its[128];
  union
  {
    PetscInt integer;
    int32_t  narrow;
    int64_t  wide;
  } major = {.wide = 0}, minor = {.wide = 0}, release = {.wide = 0};
  int32_t known[1];

  PetscFunctionBegin;
  PetscCall(PetscDataTypeGetSize(PETSC_INT, &found.integer));
  PetscCall(PetscDataTypeFromString("real", &found.real, (PetscBool *)known));
  PetscCall(PetscDataTypeFromString("scalar", &found.scalar, (PetscBool *)known));
  PetscCall(PetscGetVersionNumber(&major.integer, &minor.integer, NULL, &release.integer));
  found.major   = found.integer == 4 ? (int)major.narrow : (int)major.wide;
  found.minor   = found.integer == 4 ? (int)minor.narrow : (int)minor.wide;
  found.release = found.integer == 4 ? (int)release.narrow : (int)release.wide;
  if (found.major == built.major && found.minor == built.minor && found.release == built.release && found.integer == built.integer && found.real == built.real && found.scalar == built.scalar) PetscFunctionReturn(0);
  PetscCall(LatinPetscDescribe(&built, ours, sizeof(ours)));
  PetscCall(LatinPetscDescribe(&found, its, sizeof(its)));
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_LIB, "liblatinpc was compiled for %s, but runs with %s: build it again with the PETSc of this program (pip install --no-build-isolation --force-reinstall . where petsc4py uses that PETSc)", ours, its);
}

/* Registers classes, events and solver types, once; an error if the PETSc does not fit. Not collective */
PetscErrorCode LatinRegisterClasses_Private(void)
{
  PetscFunctionBegin;
  if (registered) PetscFunctionReturn(0);
  PetscCall(LatinCheckPetsc());
  registered = PETSC_TRUE;
  PetscCall(PetscClassIdRegister("Latin", &LATIN_CLASSID));
  PetscCall(PetscClassIdRegister("LatinStructure", &LATIN_STRUCTURE_CLASSID));
  PetscCall(PetscInfoProcessClass("latin", 2, (PetscClassId[]){LATIN_CLASSID, LATIN_STRUCTURE_CLASSID})); /* -info :latin */
  PetscCall(PetscLogEventRegister("LatinSetUp", LATIN_CLASSID, &LATIN_SetUp));
  PetscCall(PetscLogEventRegister("LatinPartition", LATIN_CLASSID, &LATIN_Partition));
  PetscCall(PetscLogEventRegister("LatinSubdomains", LATIN_CLASSID, &LATIN_Subdomains));
  PetscCall(PetscLogEventRegister("LatinInterface", LATIN_CLASSID, &LATIN_Interface));
  PetscCall(PetscLogEventRegister("LatinDirection", LATIN_CLASSID, &LATIN_Direction));
  PetscCall(PetscLogEventRegister("LatinSpectral", LATIN_CLASSID, &LATIN_Spectral));
  PetscCall(PetscLogEventRegister("LatinMacro", LATIN_CLASSID, &LATIN_Macro));
  PetscCall(PetscLogEventRegister("LatinLinear", LATIN_CLASSID, &LATIN_Linear));
  PetscCall(PetscLogEventRegister("LatinCondense", LATIN_CLASSID, &LATIN_Condense));
  PetscCall(PetscLogEventRegister("LatinEstimate", LATIN_CLASSID, &LATIN_Estimate));
  PetscCall(PetscLogEventRegister("LatinCases", LATIN_CLASSID, &LATIN_Cases));
  PetscCall(PetscLogEventRegister("LatinCoarse", LATIN_CLASSID, &LATIN_Coarse));
  PetscCall(PetscLogEventRegister("LatinLocal", LATIN_CLASSID, &LATIN_Local));
  PetscCall(PetscRegisterFinalize(LatinForgetClasses));
  if (LatinTypesRegister_Private) PetscCall((*LatinTypesRegister_Private)());
  PetscFunctionReturn(0);
}
