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

/*
   Returns the tension over length of link l in the tangent stiffness, that of the tensions ahead if there are any, else `across`. k: its stiffness along
   n. Coincident nodes, size = 0: a link whose energy is quadratic in its length, as in the interior-point method, is equally stiff in all directions
*/
static inline PetscReal LatinTurnedAcross(LatinStructure structure, PetscInt l, PetscReal size, PetscReal k, PetscReal across)
{
  if (!structure->ahead || LatinStructureKeeps(structure, l)) return across;
  if (size > 0.0) return structure->ahead[l] / size;
  return structure->slope ? k : 0.0;
}

#endif
