#include "structure/structureimpl.h"

/*
   Contacts with friction in Newton's method with multipliers, where rigid links are springs (snes/multipliers.c). With y = lambda + r x
   of all parts of a contact, the normal tension is tau_n = min(y_n, 0), and the tangential one is y_t, projected to s y_t / |y_t| if
   it exceeds the bound s:

     given              Tresca friction: the tensions have a convex energy, and the line search of Newton's method converges;
     mu |tau_n|         Coulomb friction: no energy, and a tangent stiffness that is not symmetric, since the bound of a slipping
                        contact changes with its normal strain, by -mu r x_n.

   If a contact slips along w = y_t / |y_t|, the tangent stiffness of its tangential parts is (r s / |y_t|) (1 - w w^t). Its
   diagonal is the stiffness of the links, which the preconditioner has; the operator adds the rest.
*/

/* Bound s of a contact with the normal tension tau_n */
static inline PetscReal LatinFrictionBound(LatinStructure structure, PetscInt l, PetscReal normal)
{
  return structure->bound ? structure->bound[l] : -structure->friction[l] * normal;
}

/* l2 norm over the tangential parts of the contact that starts at link l */
static inline PetscReal LatinFrictionSize(LatinStructure structure, PetscInt l, const PetscReal part[])
{
  PetscReal sum = 0.0;

  for (PetscInt c = 1; c < structure->dim; c++) sum += PetscSqr(part[l + c]);
  return PetscSqrtReal(sum);
}

/* Projects the tangential tensions y_t of contacts to s y_t / |y_t| if they exceed their bound s; tension: of all links */
void LatinFrictionCap(LatinStructure structure, PetscReal tension[])
{
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal size = structure->law[l] == LATIN_LAW_FRICTION ? LatinFrictionSize(structure, l, tension) : 0.0;
    const PetscReal most = structure->law[l] == LATIN_LAW_FRICTION ? LatinFrictionBound(structure, l, tension[l]) : 0.0;

    for (PetscInt c = 1; c < structure->dim && size > most; c++) tension[l + c] *= most / size;
  }
}

/*
   Replaces the strains x of tangential parts by their tangent stiffnesses. slip: r s / |y_t| at the normal part of each contact, w at
   the tangential ones; w = 0 at contacts that stick or are open
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

/* Adds the off-diagonal part of the tangent stiffness of friction, for elongations e, to the tensions k e */
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
