#include "structure/structureimpl.h"

/* Structures that solvers get in place of another one, their base: a time step, a frame, cones. */

/* Copies the members that a structure has in common with its base: from dim to keeps */
void LatinStructureCopyMembers(LatinStructure structure, LatinStructure base)
{
  const size_t first = offsetof(struct _p_LatinStructure, dim), last = offsetof(struct _p_LatinStructure, prescribed);

  memcpy((char *)structure + first, (char *)base + first, last - first);
}

/*
   Creates a structure with a reference to its base, which is set up, the members of LatinStructureCopyMembers(), and a DM, by which solvers find it.
   Collective on base
*/
PetscErrorCode LatinStructureDerive_Private(LatinStructure base, const char description[], LatinStructure *newstructure)
{
  LatinStructure structure;

  PetscFunctionBegin;
  PetscCall(PetscHeaderCreate(structure, LATIN_STRUCTURE_CLASSID, "LatinStructure", description, "Latin", PetscObjectComm((PetscObject)base), LatinStructureDestroy, ((PetscObject)base)->bops->view));
  PetscCall(PetscObjectReference((PetscObject)base));
  LatinStructureCopyMembers(structure, base);
  PetscCall(LatinStructureCloneDM_Private(base, &structure->dm));
  PetscCall(LatinStructureComposeDM_Private(structure));
  *newstructure = structure;
  PetscFunctionReturn(0);
}
