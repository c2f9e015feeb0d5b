#define _GNU_SOURCE /* dladdr */
#include "core/latinimpl.h"
#include <petsc/private/snesimpl.h>
#include <petscts.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

/*
   Registration of the solver types with PETSc: by -dll_append of liblatinpc.so, by LatinInitializePackage(), or with the first object that is created.
*/

PETSC_EXTERN PetscErrorCode SNESCreate_Latin(SNES);
PETSC_EXTERN PetscErrorCode PCCreate_Latin(PC);
PETSC_EXTERN PetscErrorCode KSPCreate_Latin(KSP);
PETSC_EXTERN PetscErrorCode TSCreate_Latin(TS);
PETSC_EXTERN PetscErrorCode PetscDLLibraryRegister_latinpc(void);

/* Frees registered laws, and the key of the communicators, at PetscFinalize() */
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

  Not collective; after PetscInitialize(). Fails if the PETSc that runs is unlike the one at compile time

  Level: beginner

  Note:
  `LatinStructureCreate()` and `LatinLawRegister()` do the same.

.seealso: `SNESLATIN`, `KSPLATIN`, `PCLATIN`, `TSLATIN`
@*/
PetscErrorCode LatinInitializePackage(void)
{
  PetscFunctionBegin;
  PetscCall(LatinRegisterClasses_Private());
  PetscFunctionReturn(0);
}

/* The entry point that -dll_append calls in a file called liblatinpc.so */
PetscErrorCode PetscDLLibraryRegister_latinpc(void)
{
  PetscFunctionBegin;
  PetscCall(LatinInitializePackage());
  PetscFunctionReturn(0);
}

/* Run by the loader: gives base/package.c, which does not depend on the types, the function that registers them */
__attribute__((constructor)) static void LatinOfferTypes(void)
{
  LatinTypesRegister_Private = LatinRegisterTypes;
}

/*
   Run by the loader: warns if -dll_append loads a renamed library. PETSc derives the name of the entry point from the name of the file and gives no message
   if there is none: the library would load and register nothing. Before MPI starts, the library is linked to the program, not appended, and the name of
   its file does not matter.
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
