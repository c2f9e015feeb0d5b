#include "latinimpl.h"

/* What solvers need of the links at a displacement when no matrix is assembled: elongations, tangents, the search along a step */

#define LATIN_FAR              1e30 /* a strain beyond every gap */
#define LATIN_SEARCH_MOST      80   /* trial lengths */
#define LATIN_SEARCH_TOLERANCE 1e-3 /* slope at the end, relative to the first one */

/* Least and largest stiffness of all links; most may be NULL. Collective on links */
PetscErrorCode LatinLinksStiffnessRange_Private(LatinLinks links, PetscReal *least, PetscReal *most)
{
  PetscReal range[2] = {-PETSC_MAX_REAL, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++) {
    range[0] = PetscMax(range[0], -links->stiffness[l]);
    range[1] = PetscMax(range[1], links->stiffness[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, range, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)links)));
  *least = -range[0];
  if (most) *most = range[1];
  PetscFunctionReturn(0);
}

/* The tangent stiffness of each link at u, at least `floor`, without a matrix */
PetscErrorCode LatinLinksSetTangent_Private(LatinLinks links, Vec u, PetscReal floor)
{
  Vec                ul;
  const PetscScalar *a;

  PetscFunctionBegin;
  if (!links->tangent) PetscCall(PetscMalloc1(links->links_local, &links->tangent));
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++) links->tangent[l] = PetscMax(floor, LatinLinksTangent(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l]));
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscFunctionReturn(0);
}

/* y = B^t k_t B x, with the tangent stiffnesses k_t of the last Jacobian */
PetscErrorCode LatinLinksMultTangent_Private(LatinLinks links, Vec x, Vec y)
{
  const PetscInt     dim = links->dim;
  Vec                xl, yl;
  const PetscScalar *a;
  PetscScalar       *f;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &xl));
  PetscCall(DMGetLocalVector(links->dm, &yl));
  PetscCall(VecZeroEntries(xl)); /* no change where prescribed */
  PetscCall(VecZeroEntries(yl));
  PetscCall(DMGlobalToLocalBegin(links->dm, x, INSERT_VALUES, xl));
  PetscCall(DMGlobalToLocalEnd(links->dm, x, INSERT_VALUES, xl));
  PetscCall(VecGetArrayRead(xl, &a));
  PetscCall(VecGetArray(yl, &f));
  for (PetscInt l = 0; l < links->links_local; l++) LatinLinksAddForce(links, l, links->tangent[l] * LatinLinksElongation(links, l, a), f);
  PetscCall(VecRestoreArrayRead(xl, &a));
  PetscCall(VecRestoreArray(yl, &f));
  PetscCall(VecZeroEntries(y));
  if (links->ground) PetscCall(LatinLinksAddGround_Private(links, x, y));
  PetscCall(DMLocalToGlobalBegin(links->dm, yl, ADD_VALUES, y));
  PetscCall(DMLocalToGlobalEnd(links->dm, yl, ADD_VALUES, y));
  PetscCall(DMRestoreLocalVector(links->dm, &xl));
  PetscCall(DMRestoreLocalVector(links->dm, &yl));
  PetscCall(PetscLogFlops(links->links_local * (5.0 * dim + 1.0)));
  PetscFunctionReturn(0);
}

/* Twice the energy per square of the length t that u - t step stores for t without end: that of links far out. Collective on links */
PetscErrorCode LatinLinksResistFar_Private(LatinLinks links, Vec step, PetscReal *resisted)
{
  Vec                sl;
  const PetscScalar *b;
  PetscReal          sum  = 0.0;
  PetscScalar        held = 0.0;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &sl));
  PetscCall(VecZeroEntries(sl)); /* no change where prescribed */
  PetscCall(DMGlobalToLocalBegin(links->dm, step, INSERT_VALUES, sl));
  PetscCall(DMGlobalToLocalEnd(links->dm, step, INSERT_VALUES, sl));
  PetscCall(VecGetArrayRead(sl, &b));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal d = -LatinLinksElongation(links, l, b);

    sum += LatinLinksTangent(links, l, d > 0.0 ? LATIN_FAR : -LATIN_FAR) * d * d;
  }
  PetscCall(VecRestoreArrayRead(sl, &b));
  PetscCall(DMRestoreLocalVector(links->dm, &sl));
  PetscCall(MPIU_Allreduce(&sum, resisted, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  if (links->ground) {
    Vec gu;

    PetscCall(DMGetGlobalVector(links->dm, &gu));
    PetscCall(VecZeroEntries(gu));
    PetscCall(LatinLinksAddGround_Private(links, step, gu));
    PetscCall(VecDot(gu, step, &held));
    PetscCall(DMRestoreGlobalVector(links->dm, &gu));
  }
  *resisted += PetscRealPart(held);
  PetscFunctionReturn(0);
}

/* How many links have another tangent stiffness at u, at least `floor`, than in the last Jacobian */
PetscErrorCode LatinLinksCountChanges_Private(LatinLinks links, Vec u, PetscReal floor, PetscInt *changes)
{
  Vec                ul;
  const PetscScalar *a;
  PetscInt           n = 0;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++)
    if (PetscMax(floor, LatinLinksTangent(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l])) != links->tangent[l]) n++;
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(MPIU_Allreduce(&n, changes, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)links)));
  PetscFunctionReturn(0);
}

/* Elongations of the links of this rank */
PetscErrorCode LatinLinksElongations_Private(LatinLinks links, Vec u, PetscReal e[])
{
  Vec                ul;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++) e[l] = LatinLinksElongation(links, l, a);
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscFunctionReturn(0);
}

/* How many links can be slack, and how many of them bear something */
PetscErrorCode LatinLinksCountActive_Private(LatinLinks links, Vec u, PetscInt *active, PetscInt *unilateral)
{
  Vec                ul;
  const PetscScalar *a;
  PetscInt           n[2] = {0, 0};

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++)
    if (!LatinLaws[links->law[l]].smooth) {
      n[1]++;
      if (LatinLinksTension(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l]) != 0.0) n[0]++;
    }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, n, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)links)));
  *active     = n[0];
  *unilateral = n[1];
  PetscFunctionReturn(0);
}

/*
   The length t in (0, 1] at which the energy along u - t step is least, and 1 when it falls all the way; `more` is a load
   beside that of the structure, or NULL. The derivative of the energy is monotone and piecewise linear in t, so that a
   secant that never leaves its bracket ends soon. Collective on links.
*/
PetscErrorCode LatinLinksSearch_Private(LatinLinks links, Vec u, Vec step, Vec more, PetscReal *length)
{
  const PetscInt     n   = links->links_local;
  PetscReal          low = 0.0, high = 1.0, slope[2] = {0.0, 0.0}, first = 0.0, bend = 0.0, *x, *d, t = 1.0, here;
  PetscScalar        work, other = 0.0;
  Vec                ul, sl;
  const PetscScalar *a, *b;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(n, &x, n, &d));
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(DMGetLocalVector(links->dm, &sl));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecZeroEntries(sl));
  PetscCall(DMGlobalToLocalBegin(links->dm, step, INSERT_VALUES, sl));
  PetscCall(DMGlobalToLocalEnd(links->dm, step, INSERT_VALUES, sl));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArrayRead(sl, &b));
  for (PetscInt l = 0; l < n; l++) {
    x[l] = LatinLinksElongation(links, l, a) + links->prestrain[l];
    d[l] = LatinLinksElongation(links, l, b);
  }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(VecRestoreArrayRead(sl, &b));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(DMRestoreLocalVector(links->dm, &sl));
  PetscCall(VecDot(links->load, step, &work));
  if (more) PetscCall(VecDot(more, step, &other));
  if (links->ground) { /* a quadratic energy: g (u - t step)^2 / 2 */
    PetscScalar held[2];
    Vec         gu;

    PetscCall(VecDuplicate(u, &gu));
    PetscCall(VecZeroEntries(gu));
    PetscCall(LatinLinksAddGround_Private(links, u, gu));
    PetscCall(VecDot(gu, step, &held[0]));
    PetscCall(VecZeroEntries(gu));
    PetscCall(LatinLinksAddGround_Private(links, step, gu));
    PetscCall(VecDot(gu, step, &held[1]));
    PetscCall(VecDestroy(&gu));
    other -= held[0];
    bend = PetscRealPart(held[1]);
  }
  for (PetscInt k = -1; k < LATIN_SEARCH_MOST; k++) { /* first the slope at 0, then that at 1 */
    here = 0.0;
    for (PetscInt l = 0; l < n; l++) here -= LatinLinksTension(links, l, x[l] - (k < 0 ? 0.0 : t) * d[l]) * d[l];
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &here, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
    here += PetscRealPart(work + other) + (k < 0 ? 0.0 : t) * bend;
    if (k < 0) {
      slope[0] = first = here;
      continue;
    }
    if (k == 0 && (here <= 0.0 || first >= 0.0)) break; /* still falling at the end of the step; or it was never falling: rounding */
    if (PetscAbsReal(here) <= LATIN_SEARCH_TOLERANCE * PetscAbsReal(first)) break;
    if (here > 0.0) {
      high     = t;
      slope[1] = here;
    } else {
      low      = t;
      slope[0] = here;
    }
    /* the secant, or the middle every third time, when one end does not move */
    t = k % 3 == 2 ? 0.5 * (low + high) : low - slope[0] * (high - low) / (slope[1] - slope[0]);
    if (high - low <= PETSC_MACHINE_EPSILON * high) break;
  }
  PetscCall(PetscFree2(x, d));
  *length = t;
  PetscFunctionReturn(0);
}
