#ifndef LATIN_TURNED_H
#define LATIN_TURNED_H
/* What the files on links that turn with the displacements share: one link (structure/turning.c) */
#include "structure/structureimpl.h"

/* One link as displacements turn it */
typedef struct {
  PetscReal d[3], n[3]; /* n: direction in which the tension acts */
  PetscReal size;       /* R, or as drawn */
  PetscReal x;          /* strain */
  PetscReal tension;    /* tau */
  PetscReal across;     /* tau / R, or t0 / l: stiffness at right angles to n */
  PetscReal change[3];  /* derivative of the tension by d, less that of its part across n */
} LatinTurned;

/* Link l at the displacements a of the vertices. `rigid`: tensions of rigid links, NULL where there are none, or where they are taken for springs */
PETSC_INTERN void LatinTurnedLink(LatinStructure, const PetscReal rigid[], PetscInt l, const PetscScalar a[], LatinTurned *);
/* Displacements of the vertices, which LatinTurnedLink() reads; `held`: the prescribed ones, NULL: zero. Collective on the structure */
PETSC_INTERN PetscErrorCode LatinTurnedOpen_Private(LatinStructure, const PetscReal held[], Vec u, Vec *local, const PetscScalar **a);
PETSC_INTERN PetscErrorCode LatinTurnedClose_Private(LatinStructure, Vec *local, const PetscScalar **a);

#endif
