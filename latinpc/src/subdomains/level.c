#include "subdomains/latinsubdomains.h"

/* The groups of subdomains that a coarse matrix carries, which a solver of type latin takes for the subdomains of that matrix. */

static const char LatinLevelName[] = "LatinLevel";

/* The caller keeps the level longer than A uses it */
PetscErrorCode LatinLevelAttach_Private(LatinLevel *level, Mat A)
{
  PetscContainer container;

  PetscFunctionBegin;
  PetscCall(PetscContainerCreate(PetscObjectComm((PetscObject)A), &container));
  PetscCall(PetscContainerSetPointer(container, level));
  PetscCall(PetscObjectCompose((PetscObject)A, LatinLevelName, (PetscObject)container));
  PetscCall(PetscContainerDestroy(&container));
  PetscFunctionReturn(0);
}

/* The level of a coarse matrix that has groups, or NULL */
PetscErrorCode LatinLevelOf_Private(Mat A, LatinLevel **level)
{
  PetscContainer container;

  PetscFunctionBegin;
  *level = NULL;
  PetscCall(PetscObjectQuery((PetscObject)A, LatinLevelName, (PetscObject *)&container));
  if (container) PetscCall(PetscContainerGetPointer(container, (void **)level));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinUnknownsReset_Private(LatinUnknowns *known)
{
  PetscFunctionBegin;
  if (!known->borrowed) {
    PetscCall(PetscFree(known->x));
    PetscCall(PetscFree(known->field));
    PetscCall(PetscFree(known->near));
    PetscCall(PetscFree(known->kernel));
    PetscCall(PetscFree(known->trace));
  }
  PetscCall(PetscMemzero(known, sizeof(*known)));
  PetscFunctionReturn(0);
}

/* A is the coarse matrix, or NULL: whoever keeps it longer finds no groups on it */
PetscErrorCode LatinLevelReset_Private(LatinLevel *level, Mat A)
{
  PetscFunctionBegin;
  if (A) PetscCall(PetscObjectCompose((PetscObject)A, LatinLevelName, NULL));
  PetscCall(LatinUnknownsReset_Private(&level->known));
  PetscCall(MatDestroy(&level->K));
  PetscCall(ISLocalToGlobalMappingDestroy(&level->map));
  PetscCall(PetscFree(level->part));
  PetscFunctionReturn(0);
}
