/* Memory of large arrays (base/room.c) */
#ifndef LATINROOM_H
#define LATINROOM_H

#include "base/latinbase.h"

#define LATIN_PAGE 2097152 /* bytes of a huge page */
#define LATIN_LINE 64      /* bytes of a cache line, and of the longest vector registers */

PETSC_INTERN PetscErrorCode LatinRoomCreate_Private(size_t bytes, size_t early, void **);
PETSC_INTERN PetscErrorCode LatinRoomDestroy_Private(void **);
PETSC_INTERN void           LatinRoomTrim(size_t bytes);
PETSC_INTERN void           LatinRoomRelease(void *room, size_t bytes);
PETSC_INTERN void           LatinRoomZero(void *room, size_t bytes);

#endif
