/*
   Preloaded (LD_PRELOAD), lets liblatinpc believe that another PETSc runs: LATINPC_PETSC is int64, single, complex,
   newer or development. Everybody else hears the truth.
*/
#define _GNU_SOURCE
#include <dlfcn.h>
#include <petscsys.h>
#include <stdint.h>
#include <string.h>

static int Asked(const char what[], void *caller)
{
  const char *asked = getenv("LATINPC_PETSC");
  Dl_info     info;

  return asked && !strcmp(asked, what) && dladdr(caller, &info) && strstr(info.dli_fname, "liblatinpc");
}

PetscErrorCode PetscDataTypeGetSize(PetscDataType type, size_t *size)
{
  PetscErrorCode (*real)(PetscDataType, size_t *);

  if (type == PETSC_INT && Asked("int64", __builtin_return_address(0))) {
    *size = 8;
    return 0;
  }
  *(void **)&real = dlsym(RTLD_NEXT, "PetscDataTypeGetSize");
  return real(type, size);
}

PetscErrorCode PetscDataTypeFromString(const char name[], PetscDataType *type, PetscBool *found)
{
  PetscErrorCode (*real)(const char[], PetscDataType *, PetscBool *);
  const int as_single = Asked("single", __builtin_return_address(0)), as_complex = Asked("complex", __builtin_return_address(0));

  *(void **)&real = dlsym(RTLD_NEXT, "PetscDataTypeFromString");
  PetscCall(real(name, type, found));
  if (as_single) *type = PETSC_FLOAT;
  if (as_complex && !strcmp(name, "scalar")) *type = PETSC_COMPLEX;
  return 0;
}

PetscErrorCode PetscGetVersionNumber(PetscInt *major, PetscInt *minor, PetscInt *subminor, PetscInt *release)
{
  PetscErrorCode (*real)(PetscInt *, PetscInt *, PetscInt *, PetscInt *);
  const int as_newer = Asked("newer", __builtin_return_address(0)), as_development = Asked("development", __builtin_return_address(0));

  /* as a PETSc with 64-bit indices does: eight bytes each */
  if (Asked("int64", __builtin_return_address(0))) {
    *(int64_t *)major   = PETSC_VERSION_MAJOR;
    *(int64_t *)minor   = PETSC_VERSION_MINOR;
    *(int64_t *)release = PETSC_VERSION_RELEASE;
    return 0;
  }
  *(void **)&real = dlsym(RTLD_NEXT, "PetscGetVersionNumber");
  PetscCall(real(major, minor, subminor, release));
  if (as_newer) ++*minor;
  if (as_development) *release = 0;
  return 0;
}
