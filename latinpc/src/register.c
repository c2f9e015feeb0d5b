#define _GNU_SOURCE /* dladdr */
#include "core/latinimpl.h"
#include <petsc/private/snesimpl.h>
#include <petscts.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

/*
   Registration of the solver types with PETSc, whichever door the library comes in by.
*/

PETSC_EXTERN PetscErrorCode SNESCreate_Latin(SNES);
PETSC_EXTERN PetscErrorCode PCCreate_Latin(PC);
PETSC_EXTERN PetscErrorCode KSPCreate_Latin(KSP);
PETSC_EXTERN PetscErrorCode TSCreate_Latin(TS);
PETSC_EXTERN PetscErrorCode PetscDLLibraryRegister_latinpc(void);

static PetscErrorCode LatinFinalizePackage(void)
{
  PetscFunctionBegin;
  PetscCall(LatinLawsFinalize_Private());
  PetscCall(LatinWatchFinalize_Private());
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinRegisterTypes(void)
{
  PetscFunctionBegin;
  PetscCall(SNESRegister(SNESLATIN, SNESCreate_Latin));
  PetscCall(PCRegister(PCLATIN, PCCreate_Latin));
  PetscCall(KSPRegister(KSPLATIN, KSPCreate_Latin));
  PetscCall(TSRegister(TSLATIN, TSCreate_Latin));
  PetscCall(MatOrderingRegister(LATIN_ORDERING, LatinOrdering));
  PetscCall(LatinCholeskyRegister());
  PetscCall(LatinTreeRegister());
  PetscCall(PetscRegisterFinalize(LatinFinalizePackage));
  PetscFunctionReturn(0);
}

/*@C
  LatinInitializePackage - Registers the TS, SNES, KSP and PC types latin, their classes and log events. May be called again.

  Not collective; after PetscInitialize(). Fails where the PETSc that runs is unlike the one that this was compiled for

  Level: beginner

  Note:
  `LatinStructureCreate()` and `LatinLawRegister()` do the same.
@*/
PetscErrorCode LatinInitializePackage(void)
{
  PetscFunctionBegin;
  PetscCall(LatinRegisterClasses_Private());
  PetscFunctionReturn(0);
}

/* The entry point that -dll_append looks for in a file called liblatinpc.so */
PetscErrorCode PetscDLLibraryRegister_latinpc(void)
{
  PetscFunctionBegin;
  PetscCall(LatinInitializePackage());
  PetscFunctionReturn(0);
}

/* The loader runs this function: objects, which lie below the types, register them when they are created */
__attribute__((constructor)) static void LatinOfferTypes(void)
{
  LatinTypesRegister_Private = LatinRegisterTypes;
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
