#include "base/room.h"
#include <stdlib.h>
#if defined(__GLIBC__)
  #include <malloc.h>
#endif
#if defined(__linux__)
  #include <sys/mman.h>
  #include <time.h>
#endif

/* Memory of large arrays: aligned to cache lines, in huge pages if these are fast; return of unused pages to the system. */

#define LATIN_SMALL_PAGE 4096 /* bytes of a page */

#if defined(MADV_HUGEPAGE)
/* Returns the processor time, s, of the page faults of LATIN_PAGE bytes, as a huge page or as small ones */
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
   Touches huge pages until the fault of one takes longer than those of small pages; the rest gets small pages. Faults are slow on virtual machines that
   return free memory to their host by huge pages: they wait for the host, a hundred times as long as reading the page takes
*/
static void LatinRoomHugePages(char *room, size_t bytes)
{
  const PetscReal small = LatinPageTime(room, MADV_NOHUGEPAGE);
  size_t          at    = LATIN_PAGE;

  while (at + LATIN_PAGE <= bytes && LatinPageTime(room + at, MADV_HUGEPAGE) <= small) at += LATIN_PAGE;
  if (at < bytes) (void)madvise(room + at, bytes - at, MADV_NOHUGEPAGE);
}
#endif

/* Allocates a large array. Its first `early` bytes may be touched at once, in huge pages; the others are at their first use */
PetscErrorCode LatinRoomCreate_Private(size_t bytes, size_t early, void **room)
{
  PetscFunctionBegin;
  *room = NULL;
  if (!bytes) bytes = 1;
  PetscCheck(!posix_memalign(room, bytes < LATIN_PAGE ? LATIN_LINE : LATIN_PAGE, bytes), PETSC_COMM_SELF, PETSC_ERR_MEM, "No room for %g bytes", (double)bytes);
#if defined(MADV_HUGEPAGE)
  if (early >= 2 * LATIN_PAGE) LatinRoomHugePages((char *)*room, early);
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
   Returns free pages to the system after `bytes` bytes have been freed. The C library does so by itself, but not in a process with SuperLU_DIST, which
   PETSc may include: freed memory would add to later peaks
*/
void LatinRoomTrim(size_t bytes)
{
#if defined(__GLIBC__)
  if (bytes >= 2 * LATIN_PAGE) (void)malloc_trim(0);
#endif
}

/* Discards whole pages inside these bytes, which then read as zeros. *first to *last: the discarded bytes, none if the system refuses */
static void LatinRoomDiscard(char *room, size_t bytes, char **first, char **last)
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

/* Returns a part of an array that is no longer needed to the system; it may be written again */
void LatinRoomRelease(void *room, size_t bytes)
{
  char *first, *last;

  LatinRoomDiscard((char *)room, bytes, &first, &last);
}

/* Zeros bytes, large parts by discarding their pages */
void LatinRoomZero(void *room, size_t bytes)
{
  char *start = (char *)room, *first = start, *last = start;

  if (!bytes) return;
  if (bytes >= LATIN_PAGE) LatinRoomDiscard(start, bytes, &first, &last);
  memset(start, 0, (size_t)(first - start));
  memset(last, 0, (size_t)(start + bytes - last));
}
