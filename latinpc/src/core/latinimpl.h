/*
   The method as one object: options, stages, and the states of the structure for which they were set up. Equation numbers are those of the article
   cited in latinpc.h.
*/
#ifndef LATINIMPL_H
#define LATINIMPL_H

#include "partition/latinpartition.h"
#include "stages/latinstages.h"
#include <petsc/private/pcimpl.h>

struct _p_Latin {
  PETSCHEADER(int);
  LatinPartitionRequest partition;
  LatinVariant          variant; /* option, maybe auto; the variant in use is inter.variant */
  LatinPrecision        precision;
  LatinSubdomains       sub;
  LatinInterfaces       inter;
  LatinDirections       dir;
  LatinSpectral         spectral;
  LatinMacro            macro;
  LatinCoarse           coarse;
  LatinBatches          batches;
  LatinLocalSolvers     solvers;
  LatinLinear           linear;
  PetscReal             tuning;        /* factor on the automatic search parameters of rigid links (structure/rigidlaws.c) */
  PetscObjectState      tuning_state;  /* state of the structure when `tuning` was set */
  PetscReal             rigid_scale;   /* those of links without elastic neighbours and masses, by loads at a set-up; kept until LatinScaleFar() */
  PetscReal             setup_seconds; /* time of the last set-up on this rank */
  PetscBool             set_up;
  PetscBool             tuned;                                             /* only search parameters have changed: subdomains and interfaces stay */
  PetscBool             renews;                                            /* the next set-up is for other values of the same pattern */
  PetscBool             stale;                                             /* options have changed since the last set-up */
  PetscObjectState      load_state, e0_state, held_state, structure_state; /* states of the structure at the last set-up */
};

/* largest ratio, either way, of loads over gaps to those of the search parameters, that keeps these */
#define LATIN_SCALE_FAR 16.0

/* Whether loads over gaps, of this scale, are far from `made`, those of the search parameters in use */
static inline PetscBool LatinScaleFar(PetscReal scale, PetscReal made)
{
  return (PetscBool)(scale > LATIN_SCALE_FAR * made || made > LATIN_SCALE_FAR * scale);
}

/* ---- core/latin.c ---- */
PETSC_INTERN PetscErrorCode LatinCreate_Private(MPI_Comm, Latin *);
PETSC_INTERN PetscErrorCode LatinSetProblem_Private(Latin, LatinStructure, Mat);
PETSC_INTERN PetscErrorCode LatinSetStiffness_Private(Latin, Mat);
PETSC_INTERN PetscErrorCode LatinSetUp_Private(Latin);
PETSC_INTERN PetscErrorCode LatinReset_Private(Latin);
PETSC_INTERN PetscErrorCode LatinDestroy_Private(Latin *);
/* ---- core/solver.c ---- */
PETSC_INTERN PetscErrorCode LatinCheckType_Private(PetscObject solver);
PETSC_INTERN PetscErrorCode LatinSetPrefix_Private(Latin, PetscObject solver);
PETSC_INTERN PetscErrorCode LatinAttach_Private(Latin, PetscObject solver, LatinStructure);
PETSC_INTERN PetscErrorCode LatinSetCoordinates_Private(PC, PetscInt dim, PetscInt nodes, PetscReal x[]);
PETSC_INTERN PetscErrorCode LatinSetUpOperator_Private(Latin, PetscObject solver, PC, DM);
/* ---- core/options.c ---- */
PETSC_INTERN PetscErrorCode LatinSetFromOptions_Private(Latin, PetscObject solver);
/* ---- core/results.c ---- */
PETSC_INTERN PetscErrorCode LatinCheckSetUp_Private(Latin);
/* ---- core/view.c ---- */
PETSC_INTERN PetscErrorCode LatinView_Private(Latin, PetscViewer);
/* ---- core/mechanism.c ---- */
PETSC_INTERN PetscErrorCode LatinFactorAgree_Private(Latin, LatinFactorStatus *, const LatinBatch *, const char name[]);

#endif
