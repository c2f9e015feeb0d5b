/*
   The method as one object: options, stages, and the states for which they were set up. Equation numbers are those of the
   article named in latinpc.h.
*/
#ifndef LATINIMPL_H
#define LATINIMPL_H

#include "partition/latinpartition.h"
#include "stages/latinstages.h"
#include <petsc/private/pcimpl.h>

struct _p_Latin {
  PETSCHEADER(int);
  LatinPartitionRequest partition;
  LatinVariant          variant; /* option; the variant in use is in inter */
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
  PetscReal             tuning;       /* factor on the automatic search parameters of rigid links of structure/rigidlaws.c */
  PetscObjectState      tuning_state; /* of the structure when `tuning` was set */
  PetscReal             rigid_scale;  /* of those parameters without elastic neighbours; of the loads at the first set-up, until these are far from it */
  PetscReal             setup_seconds;
  PetscBool             set_up;
  PetscBool             tuned;                                             /* search parameters alone are new: subdomains and interfaces stay */
  PetscBool             renews;                                            /* operators of the next set-up may have the same pattern: keep what depends on the pattern alone */
  PetscBool             stale;                                             /* options have changed since the set-up */
  PetscObjectState      load_state, e0_state, held_state, structure_state; /* of the structure at the last set-up */
};

#define LATIN_PARAMETER_FAR 16.0 /* largest factor of all changes of search parameters together, rigid links alone; of loads over gaps that keep them */

/* Are loads over gaps, of this scale, far from those that a search parameter was made for? */
static inline PetscBool LatinScaleFar(PetscReal scale, PetscReal made)
{
  return (PetscBool)(scale > LATIN_PARAMETER_FAR * made || made > LATIN_PARAMETER_FAR * scale);
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
