#include "base/room.h"
#include <stdlib.h>
#if defined(__linux__)
  #include <sys/mman.h>
#endif

#define LATIN_PAGE 2097152 /* bytes of a large page */

/* Room in large pages where there are: for what is read from end to end, or all over */
PetscErrorCode LatinRoomCreate_Private(size_t bytes, void **room)
{
  PetscFunctionBegin;
  *room = NULL;
  if (!bytes) bytes = 1;
  PetscCheck(!posix_memalign(room, bytes < LATIN_PAGE ? LATIN_LINE : LATIN_PAGE, bytes), PETSC_COMM_SELF, PETSC_ERR_MEM, "No room for %g bytes", (double)bytes);
#if defined(MADV_HUGEPAGE)
  if (bytes >= LATIN_PAGE) (void)madvise(*room, bytes, MADV_HUGEPAGE);
#endif
  PetscFunctionReturn(0);
}

PetscErrorCode LatinRoomDestroy_Private(void **room)
{
  PetscFunctionBegin;
  free(*room);
  *room = NULL;
  PetscFunctionReturn(0);
}
