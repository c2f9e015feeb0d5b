#define _GNU_SOURCE /* dladdr */
#include "latinimpl.h"
#include <petsc/private/snesimpl.h>
#include <petscts.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

/*
   Registration with PETSc: class identifiers, log events and the solver types, whichever door the library comes in by.
*/

PetscClassId  LATIN_CLASSID, LATIN_LINKS_CLASSID;
PetscLogEvent LATIN_SetUp, LATIN_Substructure, LATIN_Interface, LATIN_Direction, LATIN_Macro, LATIN_Floppy, LATIN_Linear, LATIN_Coarse, LATIN_Local, LATIN_Condense, LATIN_Estimate;

PETSC_EXTERN PetscErrorCode SNESCreate_Latin(SNES);
PETSC_EXTERN PetscErrorCode PCCreate_Latin(PC);
PETSC_EXTERN PetscErrorCode KSPCreate_Latin(KSP);
PETSC_EXTERN PetscErrorCode TSCreate_Latin(TS);
PETSC_EXTERN PetscErrorCode PetscDLLibraryRegister_latinpc(void);

static PetscBool initialized = PETSC_FALSE;

static PetscErrorCode LatinFinalizePackage(void)
{
  PetscFunctionBegin;
  initialized = PETSC_FALSE;
  PetscCall(LatinLawsFinalize_Private());
  PetscCall(LatinWatchFinalize_Private());
  PetscFunctionReturn(0);
}

/* What makes two PETSc unlike each other for a library that is compiled for one of them */
typedef struct {
  int           major, minor, release;
  size_t        integer; /* bytes of a PetscInt */
  PetscDataType real, scalar;
} LatinPetsc;

static PetscErrorCode LatinPetscDescribe(const LatinPetsc *petsc, char text[], size_t n)
{
  PetscFunctionBegin;
  PetscCall(PetscSNPrintf(text, n, "PETSc %d.%d%s with PetscInt of %d bits, PetscReal %s and PetscScalar %s", petsc->major, petsc->minor, petsc->release ? "" : " in development", 8 * (int)petsc->integer, PetscDataTypes[petsc->real],
                          PetscDataTypes[petsc->scalar]));
  PetscFunctionReturn(0);
}

/*
   The functions that we call are those of the PETSc that the program has brought, whichever it is: the loader goes by
   names, and they are the same in all of them. So that one is asked what it is, in ways that do not depend on the
   answer: a PetscInt may have four bytes or eight, a PetscBool one or four.
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
  union
  {
    PetscBool yes;
    int32_t   wide;
  } known = {.wide = 0};

  PetscFunctionBegin;
  PetscCall(PetscDataTypeGetSize(PETSC_INT, &found.integer));
  PetscCall(PetscDataTypeFromString("real", &found.real, &known.yes));
  PetscCall(PetscDataTypeFromString("scalar", &found.scalar, &known.yes));
  PetscCall(PetscGetVersionNumber(&major.integer, &minor.integer, NULL, &release.integer));
  found.major   = found.integer == 4 ? (int)major.narrow : (int)major.wide;
  found.minor   = found.integer == 4 ? (int)minor.narrow : (int)minor.wide;
  found.release = found.integer == 4 ? (int)release.narrow : (int)release.wide;
  if (found.major == built.major && found.minor == built.minor && found.release == built.release && found.integer == built.integer && found.real == built.real && found.scalar == built.scalar) PetscFunctionReturn(0);
  PetscCall(LatinPetscDescribe(&built, ours, sizeof(ours)));
  PetscCall(LatinPetscDescribe(&found, its, sizeof(its)));
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_LIB, "liblatinpc was compiled for %s, but runs with %s: build it again with the PETSc of this program (pip install --no-build-isolation --force-reinstall . where petsc4py uses that PETSc)", ours, its);
}

/*@C
  LatinInitializePackage - Registers the TS, SNES, KSP and PC types latin, their classes and log events. May be called again.

  Not collective; after PetscInitialize(). Fails where the PETSc that runs is unlike the one that this was compiled for

  Level: beginner
@*/
PetscErrorCode LatinInitializePackage(void)
{
  PetscFunctionBegin;
  if (initialized) PetscFunctionReturn(0);
  PetscCall(LatinCheckPetsc());
  initialized = PETSC_TRUE;
  PetscCall(PetscClassIdRegister("Latin", &LATIN_CLASSID));
  PetscCall(PetscClassIdRegister("LatinLinks", &LATIN_LINKS_CLASSID));
  PetscCall(PetscLogEventRegister("LatinSetUp", LATIN_CLASSID, &LATIN_SetUp));
  PetscCall(PetscLogEventRegister("LatinSubstruct", LATIN_CLASSID, &LATIN_Substructure));
  PetscCall(PetscLogEventRegister("LatinInterface", LATIN_CLASSID, &LATIN_Interface));
  PetscCall(PetscLogEventRegister("LatinDirection", LATIN_CLASSID, &LATIN_Direction));
  PetscCall(PetscLogEventRegister("LatinFloppy", LATIN_CLASSID, &LATIN_Floppy));
  PetscCall(PetscLogEventRegister("LatinMacro", LATIN_CLASSID, &LATIN_Macro));
  PetscCall(PetscLogEventRegister("LatinLinear", LATIN_CLASSID, &LATIN_Linear));
  PetscCall(PetscLogEventRegister("LatinCondense", LATIN_CLASSID, &LATIN_Condense));
  PetscCall(PetscLogEventRegister("LatinEstimate", LATIN_CLASSID, &LATIN_Estimate));
  PetscCall(PetscLogEventRegister("LatinCoarse", LATIN_CLASSID, &LATIN_Coarse));
  PetscCall(PetscLogEventRegister("LatinLocal", LATIN_CLASSID, &LATIN_Local));
  PetscCall(SNESRegister(SNESLATIN, SNESCreate_Latin));
  PetscCall(PCRegister(PCLATIN, PCCreate_Latin));
  PetscCall(KSPRegister(KSPLATIN, KSPCreate_Latin));
  PetscCall(TSRegister(TSLATIN, TSCreate_Latin));
  PetscCall(PetscRegisterFinalize(LatinFinalizePackage));
  PetscFunctionReturn(0);
}

/* The entry point that -dll_append looks for in a file called liblatinpc.so */
PetscErrorCode PetscDLLibraryRegister_latinpc(void)
{
  PetscFunctionBegin;
  PetscCall(LatinInitializePackage());
  PetscFunctionReturn(0);
}

/*
   PETSc derives the name of that entry point from the name of the file and says nothing when there is none: a renamed
   library would load and register nothing. The loader runs this function in any case. Before MPI starts we are linked
   to the program, not appended, and the name of the file does not matter.
*/
__attribute__((constructor)) static void LatinCheckLibraryName(void)
{
  Dl_info     info;
  const char *base;
  int         running = 0, rank = 0;

  if (MPI_Initialized(&running) || !running) return;
  if (!dladdr((void *)PetscDLLibraryRegister_latinpc, &info) || !info.dli_fname) return;
  base = strrchr(info.dli_fname, '/');
  base = base ? base + 1 : info.dli_fname;
  if (!strncmp(base, "lib", 3)) base += 3;
  if (!strncmp(base, "latinpc.so", 10)) return;
  (void)MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (!rank)
    fprintf(
      stderr,
      "liblatinpc: loaded as %s. PETSc finds the solver types of a library by the name of its file, and this one must be called liblatinpc.so: no type \"latin\" has been registered. Give the file its name back, or append a symbolic link called liblatinpc.so, and run again.\n",
      info.dli_fname);
}
