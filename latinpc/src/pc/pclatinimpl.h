/* PC latin (pc/pclatin.c), the weights of the copies of a node (pc/weights.c) */
#ifndef PCLATINIMPL_H
#define PCLATINIMPL_H

#include "core/latinimpl.h"

typedef struct {
  Latin             latin;
  PetscBool         shared;        /* latin is that of a SNES latin, which builds it and has the options */
  PetscBool         corrected;     /* conjugate gradients around it, of the structure itself, solve for what a coarse iteration leaves */
  PetscBool         yields;        /* a mechanism is a failure of the preconditioner, not an error */
  PetscBool         stage;         /* the linear stage alone: all links are taut, or there is no interface but in the coarse problem, and it is exact, or no interior */
  PetscBool         built;         /* what follows is there, though a rank without subdomains has none */
  PetscBool         chosen;        /* options have been read since the set-up: they may name other solvers */
  PetscReal        *weight;        /* [copies * bs] partition of unity */
  PetscReal        *side;          /* [2 * sides] work */
  LatinLocalSolvers interior;      /* stiffness of the interiors, identity elsewhere; none where a linear stage is all */
  PetscReal        *v, *f, *force; /* [copies * bs] work */
  Vec               work;          /* DM global vector */
} PC_Latin;

PETSC_INTERN PetscErrorCode PCLatinWeights_Private(PC);
PETSC_INTERN PetscErrorCode PCLatinWeigh_Private(PC, PetscBool forces, const PetscReal whole[], PetscReal part[]);

/* Does the node of a copy belong to one subdomain? */
static inline PetscBool PCLatinInner(const Latin latin, PetscInt copy)
{
  return (PetscBool)(latin->inter.share_offset[copy] == latin->inter.share_offset[copy + 1]);
}

#endif
