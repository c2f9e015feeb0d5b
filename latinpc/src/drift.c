#include "sneslatinimpl.h"

#define LATIN_DRIFT_NOISE 64.0 /* times the machine's, of the forces that meet at the nodes */

/* The vector t of all free displacements of one component, and |G t + B^t k B t| at most, whichever links are slack. Collective on links */
static PetscErrorCode LatinDriftStiffness_Private(LatinLinks links, PetscInt component, Vec t, Vec stiff)
{
  const PetscInt     dim = links->dim;
  Vec                moved, forces;
  const PetscScalar *a;
  PetscScalar       *f;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &moved));
  PetscCall(DMGetLocalVector(links->dm, &forces));
  PetscCall(VecGetArrayWrite(moved, &f));
  for (PetscInt i = 0; i < dim * links->vertices; i++) f[i] = i % dim == component ? 1.0 : 0.0;
  PetscCall(VecRestoreArrayWrite(moved, &f));
  PetscCall(DMLocalToGlobalBegin(links->dm, moved, INSERT_VALUES, t));
  PetscCall(DMLocalToGlobalEnd(links->dm, moved, INSERT_VALUES, t));
  PetscCall(VecZeroEntries(moved)); /* what is held stays */
  PetscCall(DMGlobalToLocalBegin(links->dm, t, INSERT_VALUES, moved));
  PetscCall(DMGlobalToLocalEnd(links->dm, t, INSERT_VALUES, moved));
  PetscCall(VecZeroEntries(forces));
  PetscCall(VecGetArrayRead(moved, &a));
  PetscCall(VecGetArray(forces, &f));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal *n = links->direction + dim * l, k = links->stiffness[l] > 0.0 ? links->stiffness[l] : LatinLaws[links->law[l]].stiffness;
    const PetscInt  *to = links->ends + 2 * l;
    const PetscReal  e  = n[component] * PetscRealPart(a[dim * to[1] + component] - a[dim * to[0] + component]);

    for (PetscInt i = 0; i < 2 * dim && e != 0.0; i++) f[dim * to[i / dim] + i % dim] += k * PetscAbsReal(n[i % dim] * e);
  }
  PetscCall(VecRestoreArray(forces, &f));
  PetscCall(VecRestoreArrayRead(moved, &a));
  PetscCall(VecPointwiseMult(stiff, links->ground, t));
  PetscCall(DMLocalToGlobalBegin(links->dm, forces, ADD_VALUES, stiff));
  PetscCall(DMLocalToGlobalEnd(links->dm, forces, ADD_VALUES, stiff));
  PetscCall(DMRestoreLocalVector(links->dm, &forces));
  PetscCall(DMRestoreLocalVector(links->dm, &moved));
  PetscFunctionReturn(0);
}

/*
   How far a structure in motion is out of place as a whole, at least, where its nodes are left with the unbalance r. Masses
   alone may hold it, and M / h^2 is soft beside links: such an error hardly shows in the distance of the two stages, nor in
   the unbalance of a node held against the stiffness there. With the translation t of all free displacements of one component
   t.r = t.K e for the error e, so that |e| >= |t.r| / |K t|. Links that hold t make that small. Collective on links
*/
PetscErrorCode LatinDrift_Private(LatinLinks links, Vec r, Vec noise, PetscReal *drift)
{
  Vec t, stiff;

  PetscFunctionBegin;
  *drift = 0.0;
  PetscCall(DMGetGlobalVector(links->dm, &t));
  PetscCall(DMGetGlobalVector(links->dm, &stiff));
  for (PetscInt c = 0; c < links->dim; c++) {
    PetscScalar left, rounding;
    PetscReal   held;

    PetscCall(LatinDriftStiffness_Private(links, c, t, stiff));
    PetscCall(VecNorm(stiff, NORM_2, &held));
    PetscCall(VecDot(t, r, &left));
    PetscCall(VecDot(t, noise, &rounding));
    if (held > 0.0) *drift = PetscMax(*drift, (PetscAbsScalar(left) - LATIN_DRIFT_NOISE * PETSC_MACHINE_EPSILON * PetscRealPart(rounding)) / held);
  }
  PetscCall(DMRestoreGlobalVector(links->dm, &stiff));
  PetscCall(DMRestoreGlobalVector(links->dm, &t));
  PetscFunctionReturn(0);
}
