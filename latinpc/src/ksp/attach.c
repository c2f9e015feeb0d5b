#include "ksp/ksplatinimpl.h"

/* Setter and getters of KSP latin: its structure, its decomposition, its outer KSP. */

/*@C
  LatinStructureAttachKSP - Sets the structure of a KSP and its PC, for a matrix that does not come from the DM of the structure.

  Collective on ksp

  Input Parameters:
+ structure - set up
- ksp       - of any type, on the communicator of the structure

  Level: intermediate

  Note:
  Call it before or after `KSPSetType()` and `KSPSetFromOptions()`. Types other than latin ignore it.

.seealso: `LatinStructureAttachSNES()`, `LatinStructureAttachPC()`, `LatinStructureAttachTS()`
@*/
PetscErrorCode LatinStructureAttachKSP(LatinStructure structure, KSP ksp)
{
  PetscBool is;
  PC        pc;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(ksp, KSP_CLASSID, 2);
  PetscCall(PetscObjectTypeCompare((PetscObject)ksp, KSPLATIN, &is));
  PetscCall(LatinAttach_Private(is ? ((KSP_Latin *)ksp->data)->latin : NULL, (PetscObject)ksp, structure));
  if (is && ((KSP_Latin *)ksp->data)->latin->stale) ksp->setupstage = KSP_SETUP_NEW; /* built again at the next KSPSetUp() */
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(LatinStructureAttachPC(structure, pc));
  PetscFunctionReturn(0);
}

/*@C
  KSPLatinGetLatin - Gets the decomposition of a KSP of type latin.

  Not collective; the reference is borrowed

  Input Parameter:
. ksp - of type latin

  Output Parameter:
. latin - the decomposition

  Level: intermediate

.seealso: `SNESLatinGetLatin()`, `PCLatinGetLatin()`
@*/
PetscErrorCode KSPLatinGetLatin(KSP ksp, Latin *latin)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(ksp, KSP_CLASSID, 1);
  PetscCall(LatinCheckType_Private((PetscObject)ksp));
  PetscAssertPointer(latin, 2);
  *latin = ((KSP_Latin *)ksp->data)->latin;
  PetscFunctionReturn(0);
}

/*@C
  KSPLatinGetOuter - Gets the KSP that solves for the interface data; its options prefix is that of ksp, followed by ksp_latin_outer_.

  Not collective; the reference is borrowed

  Input Parameter:
. ksp - of type latin

  Output Parameter:
. outer - the KSP for the interface data

  Level: advanced

  Note:
  After `KSPSetUp()` its operator is that of ksp/interfaceoperator.c, in variables whose Euclidean norm is the energy norm of the
  search direction.

.seealso: `LatinGetLocalKSP()`, `LatinGetCoarseKSP()`
@*/
PetscErrorCode KSPLatinGetOuter(KSP ksp, KSP *outer)
{
  PetscFunctionBegin;
  PetscValidHeaderSpecific(ksp, KSP_CLASSID, 1);
  PetscCall(LatinCheckType_Private((PetscObject)ksp));
  PetscAssertPointer(outer, 2);
  *outer = ((KSP_Latin *)ksp->data)->outer;
  PetscFunctionReturn(0);
}
