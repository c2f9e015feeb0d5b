#include "core/latinimpl.h"

/*
   What a factorisation that fails says of the structure: a displacement changes the length of no link, a mechanism. A
   subdomain's matrix has springs on its interfaces and its primal dofs held, so it is singular only when the structure
   has a mechanism inside that subdomain; the coarse matrix is singular when the structure has one that reaches the
   interfaces.
*/

/* Displacements of the copies for an eigenvector of a batch's matrix, or (batch NULL) of the coarse matrix */
static PetscErrorCode LatinMechanismField_Private(Latin latin, Vec v, const LatinBatch *batch, PetscReal field[])
{
  const LatinSubdomains *sub = &latin->sub;
  const PetscInt         bs  = sub->bs;
  const PetscScalar     *a;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(field, bs * sub->copies));
  if (batch) {
    PetscCall(VecGetArrayRead(v, &a));
    for (PetscInt p = 0; p < batch->patterns; p++) PetscCall(PetscArraycpy(field + bs * sub->node_offset[batch->sub[p]], a + batch->row[p], batch->row[p + 1] - batch->row[p]));
    PetscCall(VecRestoreArrayRead(v, &a));
  } else {
    PetscCall(LatinCoarseExpand_Private(&latin->coarse, v));
    for (PetscInt s = 0; s < sub->n; s++) {
      const PetscInt   rows = bs * (sub->node_offset[s + 1] - sub->node_offset[s]), first = bs * sub->node_offset[s];
      const PetscReal *u = latin->coarse.u + latin->coarse.offset[s], *phi = latin->linear.Phi + latin->linear.phi_offset[s];

      for (PetscInt r = 0; r < rows; r++) {
        const PetscInt primal = latin->inter.primal_index[first + r];

        field[first + r] = primal >= 0 ? u[latin->coarse.macro_count[s] + primal] : 0.0;
        for (PetscInt k = 0; k < latin->coarse.offset[s + 1] - latin->coarse.offset[s] && primal < 0; k++) field[first + r] += phi[r + (size_t)rows * (size_t)k] * u[k];
      }
    }
  }
  PetscFunctionReturn(0);
}

/* Soft links count as none beside links that are stiffer by more than the digits of a number: what to add to the message */
static PetscErrorCode LatinMechanismDoubt_Private(Latin latin, char doubt[], size_t size)
{
  PetscReal least = 1.0, most = 1.0;

  PetscFunctionBegin;
  if (latin->sub.structure) PetscCall(LatinStructureStiffnessRange_Private(latin->sub.structure, &least, &most));
  doubt[0] = '\0';
  if (LATIN_MECHANISM * most > 1e-3 * least) PetscCall(PetscSNPrintf(doubt, size, ", or only such links as rounding hides: stiffnesses differ by a factor of %.0e (from %g to %g)", (double)(most / least), (double)least, (double)most));
  PetscFunctionReturn(0);
}

/* Ends in an error that names some of the nodes that a mechanism moves most; field may be NULL on ranks that have none */
static PetscErrorCode LatinMechanismReport_Private(Latin latin, const PetscReal field[], PetscBool here)
{
  const LatinSubdomains *sub        = &latin->sub;
  const PetscInt         bs         = latin->sub.bs;
  PetscReal              largest    = 0.0, all;
  char                   names[256] = "", doubt[256];
  PetscInt               list[64], named = 0;
  size_t                 used = 0;

  PetscFunctionBegin;
  for (PetscInt i = 0; here && i < bs * sub->copies; i++)
    if (!sub->fixed[i] && !PetscIsInfOrNanReal(field[i])) largest = PetscMax(largest, PetscAbsReal(field[i]));
  PetscCall(MPIU_Allreduce(&largest, &all, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)latin)));
  for (PetscInt i = 0; here && i < sub->copies && named < 64; i++) {
    PetscReal size = 0.0;

    for (PetscInt c = 0; c < bs; c++)
      if (!sub->fixed[bs * i + c]) size = PetscMax(size, PetscAbsReal(field[bs * i + c]));
    if (size >= 0.5 * all && size > 0.0) list[named++] = sub->node[i];
  }
  PetscCall(PetscSortRemoveDupsInt(&named, list));
  for (PetscInt i = 0; i < PetscMin(named, 8); i++) {
    PetscCall(PetscSNPrintf(names + used, sizeof(names) - used, "%s%" PetscInt_FMT, i ? ", " : "", list[i]));
    PetscCall(PetscStrlen(names, &used));
  }
  LatinAgree(PetscObjectComm((PetscObject)latin), named > 0 && latin->sub.matrix, PETSC_ERR_MAT_CH_ZRPVT,
             "The matrix is singular, or not positive definite. Unknowns of the field that shows it: %s%s. Prescribe more unknowns, or give the kernel with MatSetNullSpace()", names, named > 8 ? " and others" : "");
  PetscCall(LatinMechanismDoubt_Private(latin, doubt, sizeof(doubt)));
  LatinAgree(PetscObjectComm((PetscObject)latin), named > 0, PETSC_ERR_MAT_CH_ZRPVT,
             "The structure has a mechanism: it can move without any link changing its length%s. Nodes that move (counted from 0): %s%s. Prescribe displacements there or add links", doubt, names, named > 8 ? " and others" : "");
  SETERRQ(PetscObjectComm((PetscObject)latin), PETSC_ERR_MAT_CH_ZRPVT, "The structure has a mechanism: it can move without any link changing its length%s. Prescribe more displacements or add links", doubt);
}

/*
   Ends in the same error on every rank when a factorisation failed on any of them, naming nodes where a mechanism is
   the cause; destroys status->mode. batch is that of the failure, NULL for the coarse problem. Collective on latin.
*/
PetscErrorCode LatinFactorAgree_Private(Latin latin, LatinFactorStatus *status, const LatinBatch *batch, const char name[])
{
  MPI_Comm       comm = PetscObjectComm((PetscObject)latin);
  PetscReal     *field;
  PetscErrorCode ierr;
  PetscMPIInt    mine = status->mechanism ? 1 : 0, any;

  PetscFunctionBegin;
  LatinAgree(comm, (status->ierr || status->failed) && !status->mechanism, status->ierr ? status->ierr : PETSC_ERR_LIB, "Setting up the %s solver failed (PETSc error %d, PC failure %d); its options start with -%s%s_", name, (int)status->ierr,
             (int)status->failed, ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "", name);
  PetscCallMPI(MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, comm));
  if (!any) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(latin->sub.bs * latin->sub.copies, &field));
  if (status->mode) PetscCall(LatinMechanismField_Private(latin, status->mode, batch, field));
  ierr = LatinMechanismReport_Private(latin, field, (PetscBool)(status->mode != NULL));
  PetscCall(VecDestroy(&status->mode));
  PetscCall(PetscFree(field));
  PetscCall(ierr);
  PetscFunctionReturn(0);
}
