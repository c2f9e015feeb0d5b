#include "sneslatinimpl.h"

/*
   What holds of a solution and not of displacements that drift away. A structure without equilibrium goes on for ever, and
   slower and slower beside the way that it has come: any measure of the last step relative to the whole becomes small.
   But the forces at the nodes do no work on the displacements of an equilibrium, r . u = 0, while along a mechanism the
   loads work and nothing resists. Their work is compared with that of the tensions and that of the loads, so that neither
   units nor stiffnesses matter.
*/

#define LATIN_PROOF         0.5  /* part of the work that tensions do not balance: near 0 at a solution of any accuracy, 1 in free fall */
#define LATIN_PROOF_CANCELS 0.03 /* part of the works by themselves below which their sum is not told from 0 */

/*
   The part of the work of tensions and loads on the displacements u that the unbalance r leaves; `more` is a load beside
   that of the structure, or NULL. Works that cancel are no measure: a structure that only a prestrain deforms has none.
   Collective on links
*/
static PetscErrorCode LatinProofWork_Private(LatinLinks links, Vec u, Vec more, Vec r, PetscReal *part)
{
  Vec                ul, vl, loads;
  const PetscScalar *a, *b;
  PetscScalar        left = 0.0, pushed = 0.0;
  PetscReal          sum[2] = {0.0, 0.0}, size = 0.0, all; /* work of the tensions, and of each by itself */

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &ul));
  PetscCall(DMGetLocalVector(links->dm, &vl));
  PetscCall(LatinLinksGetLocal_Private(links, u, ul));
  PetscCall(VecZeroEntries(vl)); /* forces do work where nothing is prescribed */
  PetscCall(DMGlobalToLocalBegin(links->dm, u, INSERT_VALUES, vl));
  PetscCall(DMGlobalToLocalEnd(links->dm, u, INSERT_VALUES, vl));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArrayRead(vl, &b));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal work = LatinLinksTension(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l]) * LatinLinksElongation(links, l, b);

    sum[0] += work;
    sum[1] += PetscAbsReal(work);
  }
  PetscCall(VecRestoreArrayRead(vl, &b));
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &vl));
  PetscCall(DMRestoreLocalVector(links->dm, &ul));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  PetscCall(DMGetGlobalVector(links->dm, &loads));
  PetscCall(VecZeroEntries(loads));
  if (links->ground) PetscCall(LatinLinksAddGround_Private(links, u, loads));
  PetscCall(VecAXPY(loads, -1.0, links->load));
  if (more) PetscCall(VecAXPY(loads, -1.0, more));
  PetscCall(VecPointwiseMult(loads, loads, u));
  PetscCall(VecSum(loads, &pushed));
  PetscCall(VecNorm(loads, NORM_1, &size));
  PetscCall(DMRestoreGlobalVector(links->dm, &loads));
  PetscCall(VecDot(r, u, &left));
  all   = PetscAbsReal(sum[0]) + PetscAbsScalar(pushed) + LATIN_PROOF_CANCELS * (sum[1] + size);
  *part = all > 0.0 ? PetscAbsScalar(left) / all : 0.0;
  PetscFunctionReturn(0);
}

/* Do the displacements u, with the unbalance r, belong to an equilibrium? `more` is a load beside that of the structure, or NULL. Collective on links */
PetscErrorCode LatinProofBalances_Private(LatinLinks links, Vec u, Vec more, Vec r, PetscBool *balances)
{
  PetscReal part = 0.0;

  PetscFunctionBegin;
  PetscCall(LatinProofWork_Private(links, u, more, r, &part));
  *balances = (PetscBool)(part <= LATIN_PROOF);
  if (!*balances) PetscCall(PetscInfo(links, "Tensions and loads at rest leave %g of their work without balance: there may be no equilibrium\n", (double)part));
  PetscFunctionReturn(0);
}

/* The size of a structure: the diagonal of the box around its nodes. Collective on links */
PetscErrorCode LatinLinksSize_Private(LatinLinks links, PetscReal *size)
{
  const PetscInt dim = links->dim;
  PetscReal      most[6], sum = 0.0; /* -lowest and highest coordinates */

  PetscFunctionBegin;
  for (PetscInt k = 0; k < 6; k++) most[k] = -PETSC_MAX_REAL;
  for (PetscInt i = 0; i < dim * links->nodes_local; i++) {
    most[2 * (i % dim)]     = PetscMax(most[2 * (i % dim)], -links->x[i]);
    most[2 * (i % dim) + 1] = PetscMax(most[2 * (i % dim) + 1], links->x[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 6, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)links)));
  for (PetscInt c = 0; c < dim; c++) sum += PetscSqr(most[2 * c] + most[2 * c + 1]);
  *size = PetscSqrtReal(sum);
  PetscFunctionReturn(0);
}

/* Are displacements larger than the structure and than what is prescribed? The theory is of small ones, so that few solutions need a proof. Collective on latin */
PetscErrorCode LatinProofIsDue_Private(Latin latin, PetscBool *due)
{
  const LatinLinks links   = latin->links;
  PetscReal        most[2] = {0.0, 0.0}, size; /* prescribed displacement, displacement */

  PetscFunctionBegin;
  for (PetscInt i = 0; i < links->dim * links->nodes_local; i++)
    if (links->fixed[i]) most[0] = PetscMax(most[0], PetscAbsReal(links->prescribed[i]));
  for (PetscInt i = 0; i < latin->sub.bs * latin->sub.copies; i++) most[1] = PetscMax(most[1], PetscAbsReal(latin->linear.U[i]) / latin->scale);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
  PetscCall(LatinLinksSize_Private(links, &size));
  *due = (PetscBool)(most[1] > PetscMax(size, most[0]));
  PetscFunctionReturn(0);
}
