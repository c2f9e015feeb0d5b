#ifndef LATIN_TURNED_H
#define LATIN_TURNED_H
/* State of a rotating link (structure/turning.c) */
#include "structure/structureimpl.h"

/* One link in the displaced configuration */
typedef struct {
  PetscReal d[3], n[3]; /* displacement of the second end minus that of the first; unit vector of the tension */
  PetscReal size;       /* current length R; geometry prestress: length as drawn; fixed direction: 0 */
  PetscReal x;          /* strain */
  PetscReal tension;    /* tau */
  PetscReal across;     /* geometric stiffness at right angles to n: tau / R, or t0 / l; fixed direction: 0 */
  PetscReal change[3];  /* derivative of the tension by d, minus across n; set in time steps alone */
} LatinTurned;

/* Computes link l at the vertex displacements a. rigid: tensions of rigid links, NULL if there are none or they are springs */
PETSC_INTERN void           LatinTurnedLink(LatinStructure, const PetscReal rigid[], PetscInt l, const PetscScalar a[], LatinTurned *);
PETSC_INTERN PetscErrorCode LatinTurnedAdd_Private(LatinStructure, PetscInt l, const PetscReal k[], Mat);

#endif
