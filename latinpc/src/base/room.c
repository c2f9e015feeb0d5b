#include "base/room.h"
#include <stdlib.h>
#if defined(__GLIBC__)
  #include <malloc.h>
#endif
#if defined(__linux__)
  #include <sys/mman.h>
  #include <time.h>
#endif

#define LATIN_SMALL_PAGE 4096

#if defined(MADV_HUGEPAGE)
/* Processor time in which so many bytes are there, a large page or small ones */
static PetscReal LatinPageTime(char *room, int advice)
{
  struct timespec start = {0}, end = {0};

  (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
  (void)madvise(room, LATIN_PAGE, advice);
  for (PetscInt b = 0; b < LATIN_PAGE; b += LATIN_SMALL_PAGE) room[b] = 0;
  (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
  return (PetscReal)(end.tv_sec - start.tv_sec) + 1e-9 * (PetscReal)(end.tv_nsec - start.tv_nsec);
}

/*
   Large pages, until one is there later than small ones would be. So it is on virtual machines that give free memory back to
   their host, which they do by large pages: the next one waits for the host, as long as it takes to read it a hundred times
*/
static void LatinRoomPages(char *room, size_t bytes)
{
  const PetscReal small = LatinPageTime(room, MADV_NOHUGEPAGE);
  size_t          at    = LATIN_PAGE;

  while (at + LATIN_PAGE <= bytes && LatinPageTime(room + at, MADV_HUGEPAGE) <= small) at += LATIN_PAGE;
  if (at < bytes) (void)madvise(room + at, bytes - at, MADV_NOHUGEPAGE);
}
#endif

/* Room for what is read from end to end, or all over; the first `early` bytes may be there at once, in large pages, the others once they are written */
PetscErrorCode LatinRoomCreate_Private(size_t bytes, size_t early, void **room)
{
  PetscFunctionBegin;
  *room = NULL;
  if (!bytes) bytes = 1;
  PetscCheck(!posix_memalign(room, bytes < LATIN_PAGE ? LATIN_LINE : LATIN_PAGE, bytes), PETSC_COMM_SELF, PETSC_ERR_MEM, "No room for %g bytes", (double)bytes);
#if defined(MADV_HUGEPAGE)
  if (early >= 2 * LATIN_PAGE) LatinRoomPages((char *)*room, early);
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

/*
   After so many bytes have been freed: pages without anything go back to the system. The C library does so by itself, but not
   in a process with SuperLU_DIST, as that of a PETSc that has it: what is freed would stay beside what comes later
*/
void LatinRoomReturn(size_t bytes)
{
#if defined(__GLIBC__)
  if (bytes >= 2 * LATIN_PAGE) (void)malloc_trim(0);
#endif
}

/* The pages that these bytes fill go back to the system, and read as zeros until they are written again: from first to last, which is none where the system does not take them */
static void LatinRoomGo(char *room, size_t bytes, char **first, char **last)
{
  *first = *last = room;
#if defined(MADV_DONTNEED)
  {
    char *start = room + (LATIN_SMALL_PAGE - (size_t)room % LATIN_SMALL_PAGE) % LATIN_SMALL_PAGE, *end = room + bytes - ((size_t)room + bytes) % LATIN_SMALL_PAGE;

    if (end <= start || madvise(start, (size_t)(end - start), MADV_DONTNEED)) return;
    *first = start;
    *last  = end;
  }
#endif
}

/* Nobody reads these bytes any more, which any part of memory may be */
void LatinRoomEmpty(void *room, size_t bytes)
{
  char *first, *last;

  LatinRoomGo((char *)room, bytes, &first, &last);
}

/* Zeros, in pages that are there once they are written */
void LatinRoomZero(void *room, size_t bytes)
{
  char *start = (char *)room, *first = start, *last = start;

  if (!bytes) return;
  if (bytes >= LATIN_PAGE) LatinRoomGo(start, bytes, &first, &last);
  memset(start, 0, (size_t)(first - start));
  memset(last, 0, (size_t)(start + bytes - last));
}
