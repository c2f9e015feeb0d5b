#include "sneslatinimpl.h"

#define LATIN_DRIFT_NOISE 64.0 /* times the machine's, of the forces that meet at the nodes */

/* All free displacements of one component, 1 each. Collective on links */
static PetscErrorCode LatinDriftTranslation_Private(LatinLinks links, PetscInt component, Vec t)
{
  Vec          moved;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &moved));
  PetscCall(VecGetArrayWrite(moved, &a));
  for (PetscInt i = 0; i < links->dim * links->vertices; i++) a[i] = i % links->dim == component ? 1.0 : 0.0;
  PetscCall(VecRestoreArrayWrite(moved, &a));
  PetscCall(DMLocalToGlobalBegin(links->dm, moved, INSERT_VALUES, t));
  PetscCall(DMLocalToGlobalEnd(links->dm, moved, INSERT_VALUES, t));
  PetscCall(DMRestoreLocalVector(links->dm, &moved));
  PetscFunctionReturn(0);
}

/*
   |G t + B^t k B t| at most, whichever links are slack; or, with displacements u, of those that bear something there and
   would do so at an error of `target`, relative: a link whose slackness is within that error may hold nothing.
   Collective on links
*/
static PetscErrorCode LatinDriftStiffness_Private(LatinLinks links, Vec t, Vec u, PetscReal target, Vec stiff)
{
  const PetscInt     dim = links->dim;
  Vec                moved, local, forces;
  const PetscScalar *m, *a = NULL;
  PetscScalar       *f;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &moved));
  PetscCall(DMGetLocalVector(links->dm, &local));
  PetscCall(DMGetLocalVector(links->dm, &forces));
  PetscCall(VecZeroEntries(moved)); /* what is held stays */
  PetscCall(DMGlobalToLocalBegin(links->dm, t, INSERT_VALUES, moved));
  PetscCall(DMGlobalToLocalEnd(links->dm, t, INSERT_VALUES, moved));
  if (u) PetscCall(LatinLinksGetLocal_Private(links, u, local));
  PetscCall(VecZeroEntries(forces));
  PetscCall(VecGetArrayRead(moved, &m));
  PetscCall(VecGetArrayRead(local, &a));
  PetscCall(VecGetArray(forces, &f));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal *n = links->direction + dim * l, e = PetscAbsReal(LatinLinksElongation(links, l, m));
    const PetscInt  *to = links->ends + 2 * l;
    PetscReal        k  = links->stiffness[l];

    if (u && !LatinLaws[links->law[l]].rigid) {
      const PetscReal x    = LatinLinksElongation(links, l, a) + links->prestrain[l];
      PetscReal       most = PetscAbsReal(links->prestrain[l]);

      for (PetscInt c = 0; c < dim; c++) most += PetscAbsReal(n[c]) * (PetscAbsScalar(a[dim * to[0] + c]) + PetscAbsScalar(a[dim * to[1] + c]));
      k = PetscMin(LatinLinksTangent(links, l, x - target * most), LatinLinksTangent(links, l, x + target * most));
    }
    for (PetscInt i = 0; i < 2 * dim; i++) f[dim * to[i / dim] + i % dim] += k * PetscAbsReal(n[i % dim]) * e;
  }
  PetscCall(VecRestoreArray(forces, &f));
  PetscCall(VecRestoreArrayRead(local, &a));
  PetscCall(VecRestoreArrayRead(moved, &m));
  PetscCall(VecPointwiseMult(stiff, links->ground, t));
  PetscCall(VecAbs(stiff));
  PetscCall(DMLocalToGlobalBegin(links->dm, forces, ADD_VALUES, stiff));
  PetscCall(DMLocalToGlobalEnd(links->dm, forces, ADD_VALUES, stiff));
  PetscCall(DMRestoreLocalVector(links->dm, &forces));
  PetscCall(DMRestoreLocalVector(links->dm, &local));
  PetscCall(DMRestoreLocalVector(links->dm, &moved));
  PetscFunctionReturn(0);
}

/* |t.r| / |K t| for one displacement t, less what rounding makes of it, where that is more than *drift. Collective on t */
static PetscErrorCode LatinDriftUpdate_Private(Vec t, Vec stiff, Vec r, Vec noise, PetscReal *drift)
{
  const PetscScalar *a, *b;
  PetscScalar        left;
  PetscReal          held, rounding = 0.0;
  PetscInt           n;

  PetscFunctionBegin;
  PetscCall(VecNorm(stiff, NORM_2, &held));
  PetscCall(VecDot(t, r, &left));
  PetscCall(VecGetLocalSize(t, &n));
  PetscCall(VecGetArrayRead(t, &a));
  PetscCall(VecGetArrayRead(noise, &b));
  for (PetscInt i = 0; i < n; i++) rounding += PetscAbsScalar(a[i]) * PetscRealPart(b[i]);
  PetscCall(VecRestoreArrayRead(noise, &b));
  PetscCall(VecRestoreArrayRead(t, &a));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &rounding, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)t)));
  if (held > 0.0) *drift = PetscMax(*drift, (PetscAbsScalar(left) - LATIN_DRIFT_NOISE * PETSC_MACHINE_EPSILON * rounding) / held);
  PetscFunctionReturn(0);
}

/*
   How far a structure in motion is out of place as a whole, at least, where its nodes are left with the unbalance r. Masses
   alone may hold it, and M / h^2 is soft beside links: such an error hardly shows in the distance of the two stages, nor in
   the unbalance of a node held against the stiffness there. With the translation t of all free displacements of one component
   t.r = t.K e for the error e, so that |e| >= |t.r| / |K t|. Links that hold t make that small. The same with the
   displacements u themselves for t: parts that fly, while a contact which they have left still pushes a little.
   Collective on links
*/
PetscErrorCode LatinDrift_Private(LatinLinks links, PetscReal target, Vec u, Vec r, Vec noise, PetscReal *drift)
{
  Vec t, stiff;

  PetscFunctionBegin;
  *drift = 0.0;
  PetscCall(DMGetGlobalVector(links->dm, &t));
  PetscCall(DMGetGlobalVector(links->dm, &stiff));
  for (PetscInt c = 0; c < links->dim; c++) {
    PetscCall(LatinDriftTranslation_Private(links, c, t));
    PetscCall(LatinDriftStiffness_Private(links, t, NULL, 0.0, stiff));
    PetscCall(LatinDriftUpdate_Private(t, stiff, r, noise, drift));
  }
  PetscCall(LatinDriftStiffness_Private(links, u, u, target, stiff));
  PetscCall(LatinDriftUpdate_Private(u, stiff, r, noise, drift));
  PetscCall(DMRestoreGlobalVector(links->dm, &stiff));
  PetscCall(DMRestoreGlobalVector(links->dm, &t));
  PetscFunctionReturn(0);
}

/*
   How far the tensions of rigid links are from balance, relative to them: displacements that hardly move tell nothing of
   them. An error of the displacements of `target`, relative, explains as much of the unbalance r as elastic links and masses
   make of it; the rest is theirs. Collective on links
*/
PetscErrorCode LatinDriftTensions_Private(LatinLinks links, PetscReal target, Vec u, Vec r, Vec noise, PetscReal *missed)
{
  const PetscInt     dim = links->dim;
  Vec                explained, borne, local[2];
  const PetscScalar *f, *t, *d, *b;
  PetscScalar       *g[2];
  PetscReal          sum[2] = {0.0, 0.0}, size;
  PetscInt           n;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(DMGetLocalVector(links->dm, &local[i]));
    PetscCall(VecZeroEntries(local[i]));
    PetscCall(VecGetArray(local[i], &g[i]));
  }
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal *n     = links->direction + dim * l;
    const PetscBool  rigid = LatinLaws[links->law[l]].rigid;
    PetscReal        all   = 0.0;

    for (PetscInt c = 0; c < dim; c++) all += PetscAbsReal(n[c]);
    for (PetscInt i = 0; i < 2 * dim; i++) g[rigid][dim * links->ends[2 * l + i / dim] + i % dim] += PetscAbsReal(n[i % dim]) * (rigid ? PetscAbsReal(links->multiplier[l]) : 2.0 * links->stiffness[l] * all);
  }
  PetscCall(DMGetGlobalVector(links->dm, &explained));
  PetscCall(DMGetGlobalVector(links->dm, &borne));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(VecRestoreArray(local[i], &g[i]));
    PetscCall(VecZeroEntries(i ? borne : explained));
    PetscCall(DMLocalToGlobalBegin(links->dm, local[i], ADD_VALUES, i ? borne : explained));
    PetscCall(DMLocalToGlobalEnd(links->dm, local[i], ADD_VALUES, i ? borne : explained));
    PetscCall(DMRestoreLocalVector(links->dm, &local[i]));
  }
  if (links->ground) PetscCall(VecAXPY(explained, 1.0, links->ground));
  PetscCall(VecNorm(u, NORM_2, &size));
  PetscCall(VecGetLocalSize(r, &n));
  PetscCall(VecGetArrayRead(r, &f));
  PetscCall(VecGetArrayRead(noise, &t));
  PetscCall(VecGetArrayRead(explained, &d));
  PetscCall(VecGetArrayRead(borne, &b));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal left = PetscAbsScalar(f[i]) - LATIN_DRIFT_NOISE * PETSC_MACHINE_EPSILON * PetscRealPart(t[i]) - target * size * PetscRealPart(d[i]);

    if (PetscRealPart(b[i]) > 0.0) sum[0] += PetscSqr(PetscMax(left, 0.0));
    sum[1] += PetscSqr(PetscRealPart(b[i]));
  }
  PetscCall(VecRestoreArrayRead(borne, &b));
  PetscCall(VecRestoreArrayRead(explained, &d));
  PetscCall(VecRestoreArrayRead(noise, &t));
  PetscCall(VecRestoreArrayRead(r, &f));
  PetscCall(DMRestoreGlobalVector(links->dm, &borne));
  PetscCall(DMRestoreGlobalVector(links->dm, &explained));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  *missed = sum[1] > 0.0 ? PetscSqrtReal(sum[0] / sum[1]) : 0.0;
  PetscFunctionReturn(0);
}
