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
  PetscFunctionReturn(0);
}

/*@C
  LatinInitializePackage - Registers the TS, SNES, KSP and PC types latin, their classes and log events. May be called again.

  Not collective; after PetscInitialize()

  Level: beginner
@*/
PetscErrorCode LatinInitializePackage(void)
{
  PetscFunctionBegin;
  if (initialized) PetscFunctionReturn(0);
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
