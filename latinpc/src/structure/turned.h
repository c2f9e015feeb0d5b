#ifndef LATIN_TURNED_H
#define LATIN_TURNED_H
/* A link that rotates with the displacements, for turning*.c (structure/turning.c) */
#include "structure/structureimpl.h"

/* One link in the displaced configuration */
typedef struct {
  PetscReal d[3], n[3]; /* relative displacement of the ends; unit vector of the tension */
  PetscReal size;       /* current length R; geometry prestress: length as drawn */
  PetscReal x;          /* strain */
  PetscReal tension;    /* tau */
  PetscReal across;     /* geometric stiffness at right angles to n: tau / R, or t0 / l */
  PetscReal change[3];  /* derivative of the tension by d, less across n */
} LatinTurned;

/* Link l at the displacements a of the vertices. `rigid`: tensions of rigid links, NULL without rigid links, or if they are springs */
PETSC_INTERN void           LatinTurnedLink(LatinStructure, const PetscReal rigid[], PetscInt l, const PetscScalar a[], LatinTurned *);
PETSC_INTERN PetscErrorCode LatinTurnedAdd_Private(LatinStructure, PetscInt l, const PetscReal k[], Mat);

#endif
