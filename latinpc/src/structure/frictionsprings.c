#include "structure/structureimpl.h"

/*
   Contacts with friction while Newton's method takes rigid links for springs (snes/multipliers.c). With y = lambda + r x of
   all parts of a contact the normal part bears tau_n = min(y_n, 0), and the tangential ones y_t, or s y_t / |y_t| where
   that is less. The bound s is either

     given              Tresca's friction: the tensions have an energy, which is convex, and Newton's method a search that ends;
     mu |tau_n|         Coulomb's friction: no energy, and a tangent stiffness that is not symmetric, since the slip pushes
                        by -mu r x_n more where the normal part does.

   Where a contact slips along w = y_t / |y_t| the tangent stiffness of its tangential parts is (r s / |y_t|) (1 - w w^t):
   the diagonal is the stiffness of the links, which the preconditioner knows; the operator has the rest.
*/

/* The bound of a contact whose normal part bears tau_n */
static inline PetscReal LatinFrictionBound(LatinStructure structure, PetscInt l, PetscReal normal)
{
  return structure->bound ? structure->bound[l] : -structure->friction[l] * normal;
}

/* The l2 norm of the tangential parts of the contact that starts at link l */
static inline PetscReal LatinFrictionSize(LatinStructure structure, PetscInt l, const PetscReal part[])
{
  PetscReal sum = 0.0;

  for (PetscInt c = 1; c < structure->dim; c++) sum += PetscSqr(part[l + c]);
  return PetscSqrtReal(sum);
}

/* Tensions of all links; those of tangential parts, y_t before, become s y_t / |y_t| where they are larger */
void LatinFrictionCap(LatinStructure structure, PetscReal tension[])
{
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal size = structure->law[l] == LATIN_LAW_FRICTION ? LatinFrictionSize(structure, l, tension) : 0.0;
    const PetscReal most = structure->law[l] == LATIN_LAW_FRICTION ? LatinFrictionBound(structure, l, tension[l]) : 0.0;

    for (PetscInt c = 1; c < structure->dim && size > most; c++) tension[l + c] *= most / size;
  }
}

/*
   The strains x of the tangential parts become their tangent stiffnesses; and the slip of each contact: r s / |y_t| at its
   normal part, w at the others; w is 0 where it sticks, or bears nothing
*/
void LatinFrictionTangents(LatinStructure structure, PetscReal x[], PetscReal slip[])
{
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal y[3], size = 0.0, most;

    slip[l] = 0.0;
    if (structure->law[l] != LATIN_LAW_FRICTION) continue;
    for (PetscInt c = 0; c < structure->dim; c++) {
      y[c] = LatinStructureSpring(structure, l + c, x[l + c]);
      if (c) size += PetscSqr(y[c]);
    }
    size    = PetscSqrtReal(size);
    most    = LatinFrictionBound(structure, l, y[0]);
    slip[l] = size > most ? structure->penalty[l] * most / size : 0.0;
    for (PetscInt c = 1; c < structure->dim; c++) {
      slip[l + c] = size > most && most > 0.0 ? y[c] / size : 0.0;
      x[l + c]    = size > most ? slip[l] * (1.0 - PetscSqr(slip[l + c])) : structure->penalty[l];
    }
    l += structure->dim - 1;
  }
}

/* Changes of the elongations, times the stiffnesses k of the links, become changes of the tensions: what the diagonal has not is added */
void LatinFrictionMult(LatinStructure structure, const PetscReal slip[], const PetscReal e[], PetscReal tension[])
{
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal along = 0.0;

    if (structure->law[l] != LATIN_LAW_FRICTION) continue;
    for (PetscInt c = 1; c < structure->dim; c++) along += slip[l + c] * e[l + c];
    for (PetscInt c = 1; c < structure->dim; c++) {
      tension[l + c] -= slip[l] * slip[l + c] * (along - slip[l + c] * e[l + c]);
      if (!structure->bound) tension[l + c] -= structure->friction[l] * slip[l + c] * tension[l];
    }
  }
}
