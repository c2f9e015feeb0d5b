#include "pc/pclatinimpl.h"

/* PC latin inside a PCSHELL, for programs that can use a PCSHELL alone. */

/* Resets the inner PC if the size of the matrix has changed: KSPReset() does not reach a PC inside a PCSHELL. Collective on shell */
static PetscErrorCode PCShellLatinForget_Private(PC shell, PC inner)
{
  PetscInt  m, n;
  PetscBool other;

  PetscFunctionBegin;
  if (!inner->pmat) PetscFunctionReturn(0);
  PetscCall(MatGetLocalSize(inner->pmat, &m, NULL));
  PetscCall(MatGetLocalSize(shell->pmat, &n, NULL));
  other = (PetscBool)(m != n);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &other, 1, LATIN_MPI_BOOL, MPI_LOR, PetscObjectComm((PetscObject)shell)));
  if (other) PetscCall(PCReset(inner));
  PetscFunctionReturn(0);
}

/* Composes on the inner PC what is composed on the shell by this name. Collective on shell */
static PetscErrorCode PCShellLatinPass_Private(PC shell, PC inner, const char name[])
{
  PetscObject now, before;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)shell, name, &now));
  PetscCall(PetscObjectQuery((PetscObject)inner, name, &before));
  if (now == before) PetscFunctionReturn(0);
  PetscCall(PetscObjectCompose((PetscObject)inner, name, now));
  inner->setupcalled = 0;
  PetscFunctionReturn(0);
}

static PetscErrorCode PCShellLatinSetUp_Private(PC shell)
{
  PC    inner;
  Latin latin;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCShellLatinForget_Private(shell, inner));
  PetscCall(PCShellLatinPass_Private(shell, inner, "LatinCoordinates"));
  PetscCall(PCShellLatinPass_Private(shell, inner, "LatinStructure"));
  PetscCall(PCSetOperators(inner, shell->mat, shell->pmat));
  if (shell->dm) PetscCall(PCSetDM(inner, shell->dm));
  PetscCall(PCSetOptionsPrefix(inner, ((PetscObject)shell)->prefix));
  PetscCall(PetscObjectSetOptions((PetscObject)inner, ((PetscObject)shell)->options));
  /* not PCSetFromOptions(): -pc_type shell would make the inner PC a shell */
  PetscCall(PCLatinGetLatin(inner, &latin));
  PetscCall(LatinSetFromOptions_Private(latin, (PetscObject)inner));
  PetscCall(PCSetUp(inner));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCShellLatinApply_Private(PC shell, Vec x, Vec y)
{
  PC inner;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCApply(inner, x, y));
  PetscFunctionReturn(0);
}

static PetscErrorCode PCShellLatinView_Private(PC shell, PetscViewer viewer)
{
  PC inner;

  PetscFunctionBegin;
  PetscCall(PCShellGetContext(shell, &inner));
  PetscCall(PCView(inner, viewer));
  PetscFunctionReturn(0);
}

/*@C
  PCShellSetLatin - Makes a `PCSHELL` act as a `PCLATIN`, with the same options.

  Collective on pc

  Level: intermediate

.seealso: `LatinStructureAttachPC()`, `PCLATIN`
@*/
PetscErrorCode PCShellSetLatin(PC pc)
{
  PC        inner;
  PetscBool is;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(pc, PC_CLASSID, 1);
  PetscCall(LatinRegisterClasses_Private());
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCSHELL, &is));
  PetscCheck(is, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_WRONG, "The PC is not of type shell: call PCSetType(pc, PCSHELL) first");
  PetscCall(PCCreate(PetscObjectComm((PetscObject)pc), &inner));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)inner, (PetscObject)pc, 1));
  PetscCall(PCSetType(inner, PCLATIN));
  PetscCall(PCShellSetContext(pc, inner));
  PetscCall(PetscObjectCompose((PetscObject)pc, "PCLatin", (PetscObject)inner)); /* lives as long as pc */
  PetscCall(PCDestroy(&inner));
  PetscCall(PCShellSetName(pc, "latin"));
  PetscCall(PCShellSetSetUp(pc, PCShellLatinSetUp_Private));
  PetscCall(PCShellSetApply(pc, PCShellLatinApply_Private));
  PetscCall(PCShellSetApplyTranspose(pc, PCShellLatinApply_Private));
  PetscCall(PCShellSetView(pc, PCShellLatinView_Private));
  PetscCall(PetscObjectComposeFunction((PetscObject)pc, "PCSetCoordinates_C", LatinSetCoordinates_Private));
  pc->setupcalled = 0; /* it may be set up as another shell */
  PetscFunctionReturn(0);
}
