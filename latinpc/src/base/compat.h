/*
   Changes of PETSc's interface between 3.18 and the newest release, in the order of versions. The sources are written for the newest PETSc; this file
   defines the names that earlier ones lack, so that no other file depends on the version.
*/
#ifndef LATINCOMPAT_H
#define LATINCOMPAT_H

#include <petscsnes.h>

/* 3.20 */
#if PETSC_VERSION_LT(3, 20, 0)
  #define PetscAssertPointer(pointer, place) PetscValidPointer(pointer, place)
#endif

/* 3.21 */
#if PETSC_VERSION_LT(3, 21, 0)
  #define SNESLineSearchShellSetApply(search, apply, ctx) SNESLineSearchShellSetUserFunc(search, apply, ctx)
#endif

#define LATIN_PETSC_DIVTOL 1e4 /* default of PETSc's -snes_divergence_tolerance */

/*
   3.22: defaults of a type do not override values of the user; PETSC_UNLIMITED replaces -1. Earlier versions only store whether the user has set any
   tolerance: one that equals PETSc's default then counts as not set
*/
#if PETSC_VERSION_LT(3, 22, 0)
  #define LATIN_PETSC_max_its   50
  #define LATIN_PETSC_max_funcs 10000
  #define LATIN_PETSC_stol      LatinByPrecision(1e-8, 1e-5)
  #define PetscObjectParameterSetDefault(snes, name, value) \
    do { \
      if (!(snes)->tolerancesset || (snes)->name == (LATIN_PETSC_##name)) (snes)->name = (value); \
    } while (0)
  #define PETSC_UNLIMITED (-1)
#endif

/* 3.23: PetscOptionItems is a pointer itself; PetscCtxDestroyFn */
#if PETSC_VERSION_LT(3, 23, 0)
typedef PetscOptionItems *LatinOptionItems;
typedef PetscErrorCode    PetscCtxDestroyFn(void **);
#else
typedef PetscOptionItems LatinOptionItems;
#endif

/* 3.24: PetscBool is a C bool, no longer an enumeration */
#if PETSC_VERSION_LT(3, 24, 0)
  #define LATIN_MPI_BOOL MPIU_BOOL
#else
  #define LATIN_MPI_BOOL MPI_C_BOOL
#endif

/* 3.25 */
#if PETSC_VERSION_LT(3, 25, 0)
  #define SNES_DIVERGED_FUNCTION_NANORINF SNES_DIVERGED_FNORM_NAN
#endif

/* 3.26 */
#if PETSC_VERSION_LT(3, 26, 0)
  #define KSPOrthogonalizationSetCGSRefinementType(ksp, type) KSPGMRESSetCGSRefinementType(ksp, type)
  #define KSP_ORTHOGONALIZATION_CGS_REFINE_IFNEEDED           KSP_GMRES_CGS_REFINE_IFNEEDED
#endif

#endif
