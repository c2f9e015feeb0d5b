#include "structure/structureimpl.h"

/*
   Upper bound of the limit load with friction. Each contact becomes rigid contacts without friction along the edges of a polyhedral cone around the
   Coulomb cone, one in place of each of its parts. In 2D this is the Coulomb cone itself; in 3D it has three faces, which touch the Coulomb cone. If
   these links cannot bear the loads, friction cannot: their mechanism proves a collapse (error/collapse.c). If they can, this proves no equilibrium:
   the friction of the cones is associated, that is slip opens the contact.
*/

/* Computes the unit vectors of the edges, [dim][dim], from those of the parts of a contact: along n + mu t, t in the plane of the contact */
static void LatinConesEdges(PetscInt dim, PetscReal friction, const PetscReal part[], PetscReal edge[])
{
  static const PetscReal around[2][3][2] = {
    {{1.0, 0.0}, {-1.0, 0.0}},
    {{2.0, 0.0}, {-1.0, 1.7320508075688772}, {-1.0, -1.7320508075688772}}
  };

  for (PetscInt k = 0; k < dim && dim > 1; k++) {
    const PetscReal *t = around[dim - 2][k], size = PetscSqrtReal(1.0 + PetscSqr(friction) * (PetscSqr(t[0]) + PetscSqr(t[1])));

    for (PetscInt c = 0; c < dim; c++) {
      edge[dim * k + c] = part[c] / size;
      for (PetscInt j = 1; j < dim; j++) edge[dim * k + c] += friction / size * t[j - 1] * part[dim * j + c];
    }
  }
}

/* Creates the cones of `base`, a structure that is set up, of linear geometry, no time step. Collective on base */
PetscErrorCode LatinConesCreate_Private(LatinStructure base, LatinStructure *newcones)
{
  const PetscInt dim = base->dim;
  LatinStructure cones;

  PetscFunctionBegin;
  PetscCall(LatinStructureDerive_Private(base, "Cones of contacts with friction", &cones));
  cones->cones_of          = base;
  cones->has_friction      = PETSC_FALSE;
  cones->rigid_law         = LATIN_LAW_CONTACT;
  cones->prescribed        = base->prescribed;
  cones->vertex_prescribed = base->vertex_prescribed;
  cones->e0                = base->e0;
  cones->load              = base->load;
  PetscCall(PetscObjectReference((PetscObject)cones->load));
  PetscCall(PetscMalloc2(base->links_local, &cones->law, dim * base->links_local, &cones->direction));
  PetscCall(PetscArraycpy(cones->law, base->law, base->links_local));
  PetscCall(PetscArraycpy(cones->direction, base->direction, dim * base->links_local));
  for (PetscInt l = 0; l < base->links_local; l++) {
    if (base->law[l] == LATIN_LAW_FRICTION) LatinConesEdges(dim, base->friction[l], base->direction + dim * l, cones->direction + dim * l);
    if (base->law[l] == LATIN_LAW_FRICTION || base->law[l] == LATIN_LAW_TANGENT) cones->law[l] = LATIN_LAW_CONTACT;
  }
  *newcones = cones;
  PetscFunctionReturn(0);
}

/* Replaces tensions of edges, [links_local], by those of the parts of the contacts */
void LatinConesTensions(LatinStructure cones, PetscReal tension[])
{
  const LatinStructure base = cones->cones_of;
  const PetscInt       dim  = base->dim;

  for (PetscInt l = 0; l < base->links_local; l++) {
    PetscReal force[3] = {0.0, 0.0, 0.0};

    if (base->law[l] != LATIN_LAW_FRICTION) continue;
    for (PetscInt i = 0; i < dim * dim; i++) force[i % dim] += tension[l + i / dim] * cones->direction[dim * l + i];
    for (PetscInt k = 0; k < dim; k++) {
      tension[l + k] = 0.0;
      for (PetscInt c = 0; c < dim; c++) tension[l + k] += force[c] * base->direction[dim * (l + k) + c];
    }
  }
}
