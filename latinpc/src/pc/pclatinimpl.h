/* PC latin (pc/pclatin.c), and the weights of the copies of a node (pc/weights.c) */
#ifndef PCLATINIMPL_H
#define PCLATINIMPL_H

#include "core/latinimpl.h"

typedef struct {
  Latin             latin;
  PetscBool         shared;        /* latin belongs to a SNES latin, which sets it up and reads its options */
  PetscBool         corrected;     /* the Krylov method corrects the error of coarse iterations: they may stop early */
  PetscBool         yields;        /* a mechanism is a failure of the preconditioner, not an error */
  PetscObjectId     renewed;       /* the matrix of the last set-up that has succeeded, 0: none since a reset; its next one is for new values */
  PetscBool         stage;         /* the linear stage alone is applied: shared, or exact, or without interiors */
  PetscBool         built;         /* the members below exist, if empty on a rank without subdomains */
  PetscBool         chosen;        /* options have been read since the set-up: they may select other solvers */
  PetscReal        *weight;        /* [copies * bs] partition of unity */
  PetscReal        *side;          /* [2][sides] work */
  LatinLocalSolvers interior;      /* solvers of the interiors, with identity rows elsewhere; none if `stage` */
  PetscReal        *v, *f, *force; /* [copies * bs] work */
  Vec               work;          /* DM global vector */
  MatNullSpace      kernel;        /* of a singular matrix, else NULL */
  Vec               range;         /* the argument without its part in the kernel */
} PC_Latin;

PETSC_INTERN PetscErrorCode PCLatinWeights_Private(PC);
PETSC_INTERN PetscErrorCode PCLatinWeigh_Private(PC, PetscBool forces, const PetscReal whole[], PetscReal part[]);

/* Whether the node of a copy is inside a subdomain, on no interface */
static inline PetscBool PCLatinInner(const Latin latin, PetscInt copy)
{
  return (PetscBool)(latin->inter.share_offset[copy] == latin->inter.share_offset[copy + 1]);
}

#endif
