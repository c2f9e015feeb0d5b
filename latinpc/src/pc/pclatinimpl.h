/*
   PC latin (pc/pclatin.c), the weights of the copies of a node (pc/weights.c).
*/
#ifndef PCLATINIMPL_H
#define PCLATINIMPL_H

#include "core/latinimpl.h"
#include <petsc/private/pcimpl.h>

typedef struct {
  Latin             latin;
  LatinStructure    structure;  /* given by LatinStructureAttachPC(), or NULL */
  PetscBool         shared;     /* latin is that of a SNES latin, which builds it and has the options */
  PetscReal        *weight;     /* [copies * bs] partition of unity */
  PetscReal        *side;       /* [3 * sides] work */
  PetscBool        *inner;      /* [copies] the node belongs to one subdomain */
  PetscBool         built;      /* these are there, though a rank without subdomains has none */
  PetscInt          dim, nodes; /* coordinates given by PCSetCoordinates(), dim 0: none */
  PetscReal        *x;
  LatinInexact      inexact;           /* of the inner solvers, on all ranks */
  LatinLocalSolvers interior;          /* stiffness of the interiors, identity elsewhere */
  PetscReal        *b, *v, *f, *force; /* [copies * bs] work */
  Vec               work;              /* DM global vector */
} PC_Latin;

PETSC_INTERN PetscErrorCode PCLatinSum_Private(Latin, const PetscReal copy[], Vec);
PETSC_INTERN PetscErrorCode PCLatinWeights_Private(PC);
PETSC_INTERN PetscErrorCode PCLatinWeigh_Private(PC, PetscBool forces, const PetscReal whole[], PetscReal part[]);
PETSC_INTERN PetscBool      PCLatinSchurWeights(const Latin);
PETSC_INTERN PetscErrorCode PCSetFromOptions_Latin(PC, LatinOptionItems);

#endif
