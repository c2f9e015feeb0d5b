#include "latinimpl.h"

/* What displacements of a structure mean: energy, distances, and values of nodes and links in the caller's numbering. */

static PetscErrorCode LatinLinksComputeEnergy_Private(LatinLinks links, Vec u, PetscReal *energy)
{
  Vec                ul;
  const PetscScalar *a;
  PetscReal          sum = 0.0, total;
  PetscScalar        work;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const LatinLaw *law = &LatinLaws[links->law[l]];

    if (!law->rigid) sum += law->energy(links->stiffness[l], LatinLinksElongation(links, l, a) + links->prestrain[l], law->ctx);
  }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(MPIU_Allreduce(&sum, &total, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  PetscCall(VecDot(links->load, u, &work));
  *energy = total - work;
  if (links->ground) {
    PetscCall(LatinLinksGroundEnergy_Private(links, u, &sum));
    *energy += sum;
  }
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksComputeEnergy - The potential energy: strain energy of the links less the work of the loads.

  Collective on links

  Level: intermediate

  Note:
  Links of a rigid law store none.
@*/
PetscErrorCode LatinLinksComputeEnergy(LatinLinks links, Vec u, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksComputeEnergy_Private(links, u, energy));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksComputeErrors_Private(LatinLinks links, Vec u, Vec reference, PetscReal *l2, PetscReal *energy)
{
  Vec                ul, vl, d;
  const PetscScalar *a, *b;
  PetscReal          sum[2] = {0.0, 0.0}, total[2], dn, rn;

  PetscFunctionBegin;
  PetscCall(VecDuplicate(u, &d));
  PetscCall(VecWAXPY(d, -1.0, reference, u));
  PetscCall(VecNorm(d, NORM_2, &dn));
  PetscCall(VecNorm(reference, NORM_2, &rn));
  PetscCall(VecDestroy(&d));
  *l2 = rn > 0.0 ? dn / rn : dn;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(DMGetLocalVector(links->dm, &vl));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(LatinLinksGetLocal_Private(links, reference, vl));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArrayRead(vl, &b));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal e = LatinLinksElongation(links, l, a), r = LatinLinksElongation(links, l, b);

    sum[0] += links->stiffness[l] * PetscSqr(e - r);
    sum[1] += links->stiffness[l] * PetscSqr(r);
  }
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(VecRestoreArrayRead(vl, &b));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(DMRestoreLocalVector(links->dm, &vl));
  PetscCall(MPIU_Allreduce(sum, total, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  *energy = PetscSqrtReal(total[1] > 0.0 ? total[0] / total[1] : total[0]);
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksComputeErrors - Relative distance of two displacement fields.

  Collective on links

  Input Parameters:
+ links     - the structure
. u         - displacements
- reference - displacements to compare with

  Output Parameters:
+ l2     - |u - reference| / |reference|
- energy - the same in the norm sqrt(sum of k e^2) of the elongations, all links counted as taut

  Level: intermediate

  Note:
  For a zero reference the distances are absolute.
@*/
PetscErrorCode LatinLinksComputeErrors(LatinLinks links, Vec u, Vec reference, PetscReal *l2, PetscReal *energy)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  PetscCall(LatinLinksCheckVec_Private(links, reference));
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksComputeErrors_Private(links, u, reference, l2, energy));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksGetDisplacements_Private(LatinLinks links, Vec u, PetscReal displacement[])
{
  const PetscInt     n = links->nodes_local * links->dim;
  PetscSF            sf;
  PetscInt          *remote, *local, m = 0;
  PetscLayout        map;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(displacement, links->prescribed, n));
  PetscCall(PetscMalloc2(n, &remote, n, &local));
  for (PetscInt i = 0; i < n; i++)
    if (links->global_dof[i] >= 0) {
      remote[m]  = links->global_dof[i];
      local[m++] = i;
    }
  PetscCall(VecGetLayout(u, &map));
  PetscCall(PetscSFCreate(PetscObjectComm((PetscObject)links), &sf));
  PetscCall(PetscSFSetGraphLayout(sf, map, m, local, PETSC_COPY_VALUES, remote));
  PetscCall(VecGetArrayRead(u, &a));
  PetscCall(LatinSFBcast_Private(sf, 1, MPIU_SCALAR, a, displacement));
  PetscCall(VecRestoreArrayRead(u, &a));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree2(remote, local));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksGetDisplacements - Displacements of this rank's nodes in the caller's numbering, prescribed ones included.

  Collective on links

  Input Parameters:
+ links - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. displacement - [nodes_local][dim], a length

  Level: beginner
@*/
PetscErrorCode LatinLinksGetDisplacements(LatinLinks links, Vec u, PetscReal displacement[])
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksGetDisplacements_Private(links, u, displacement));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetDisplacements - Fills a DM global vector from displacements in the caller's numbering.

  Collective on links

  Input Parameters:
+ links        - the structure
- displacement - [nodes_local][dim], ignored where prescribed

  Output Parameter:
. u - a DM global vector

  Level: intermediate
@*/
PetscErrorCode LatinLinksSetDisplacements(LatinLinks links, const PetscReal displacement[], Vec u)
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  PetscCall(VecSetOption(u, VEC_IGNORE_NEGATIVE_INDICES, PETSC_TRUE));
  PetscCall(VecSetValues(u, links->nodes_local * links->dim, links->global_dof, displacement, INSERT_VALUES));
  PetscCall(VecAssemblyBegin(u));
  PetscCall(VecAssemblyEnd(u));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinLinksGetTensions_Private(LatinLinks links, Vec u, PetscReal tension[])
{
  Vec                ul;
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  for (PetscInt l = 0; l < links->links_local; l++) tension[l] = LatinLinksTension(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l]);
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksGetTensions - Tensions of this rank's links under given displacements, in the caller's numbering.

  Collective on links

  Input Parameters:
+ links - the structure
- u     - displacements, a DM global vector

  Output Parameter:
. tension - [links_local], a force, positive in traction; of links of a rigid law that of the last solve by SNES latin

  Level: beginner
@*/
PetscErrorCode LatinLinksGetTensions(LatinLinks links, Vec u, PetscReal tension[])
{
  PetscFunctionBegin;
  PetscCall(LatinLinksCheckVec_Private(links, u));
  LatinWatch(PetscObjectComm((PetscObject)links), LatinLinksGetTensions_Private(links, u, tension));
  PetscFunctionReturn(0);
}
