#include "fingerprint.h"
#include <stdlib.h>
#include <string.h>

/*
   Search for equal objects. Objects equal to the bit are computed once: a structure of repeated modules has few different interfaces, subdomains and groups
   of them. Objects are sorted by the hashes of their data; of those with equal hashes the data are compared.
*/

/* Returns a hash of n bytes: FNV-1a by words of 8 bytes, with high bits mixed into low ones */
uint64_t LatinHash(size_t n, const void *data)
{
  const unsigned char *bytes = (const unsigned char *)data;
  uint64_t             hash  = 1469598103934665603u;

  for (size_t i = 0; i + sizeof(uint64_t) <= n; i += sizeof(uint64_t)) {
    uint64_t word;

    memcpy(&word, bytes + i, sizeof(word));
    hash = (hash ^ word) * 1099511628211u;
    hash ^= hash >> 29;
  }
  for (size_t i = n - n % sizeof(uint64_t); i < n; i++) hash = (hash ^ bytes[i]) * 1099511628211u;
  return hash;
}

int LatinKeyCompare(const void *pa, const void *pb)
{
  const LatinKey *a = (const LatinKey *)pa, *b = (const LatinKey *)pb;

  if (a->hash != b->hash) return a->hash < b->hash ? -1 : 1;
  return a->number < b->number ? -1 : (a->number > b->number ? 1 : 0);
}

/* Appends n bytes to the stream, to be written to *room, which is valid until the next call */
PetscErrorCode LatinStreamRoom_Private(LatinStream *stream, size_t n, unsigned char **room)
{
  PetscFunctionBegin;
  if (stream->used + n > stream->size) {
    unsigned char *larger;

    stream->size = 2 * (stream->used + n);
    PetscCall(PetscMalloc1(stream->size, &larger));
    if (stream->used) PetscCall(PetscMemcpy(larger, stream->bytes, stream->used));
    PetscCall(PetscFree(stream->bytes));
    stream->bytes = larger;
  }
  *room = stream->bytes + stream->used;
  stream->used += n;
  PetscFunctionReturn(0);
}

/* Appends n bytes of data to the stream */
PetscErrorCode LatinStreamAdd_Private(LatinStream *stream, const void *data, size_t n)
{
  unsigned char *room = NULL;

  PetscFunctionBegin;
  PetscCall(LatinStreamRoom_Private(stream, n, &room));
  PetscCall(PetscMemcpy(room, data, n));
  PetscFunctionReturn(0);
}

/* Computes pattern, [n]: of each object i, the first one whose stream equals that of i. make() writes the stream of one object */
PetscErrorCode LatinStreamCompare_Private(PetscInt n, PetscErrorCode (*make)(const void *ctx, PetscInt i, LatinStream *), const void *ctx, PetscInt pattern[])
{
  LatinStream a = {NULL, 0, 0}, b = {NULL, 0, 0};
  LatinKey   *key;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(n, &key));
  for (PetscInt i = 0; i < n; i++) {
    a.used = 0;
    if (n > 1) PetscCall(make(ctx, i, &a));
    key[i].hash   = LatinHash(a.used, a.bytes);
    key[i].number = i;
    pattern[i]    = i;
  }
  if (n > 1) qsort(key, (size_t)n, sizeof(*key), LatinKeyCompare);
  for (PetscInt i = 0; i < n;) {
    PetscInt j = i + 1;

    a.used = 0;
    if (j < n && key[j].hash == key[i].hash) PetscCall(make(ctx, key[i].number, &a));
    for (; j < n && key[j].hash == key[i].hash; j++) {
      PetscBool same;

      b.used = 0;
      PetscCall(make(ctx, key[j].number, &b));
      if (a.used != b.used) continue; /* a hash collision: pattern[] stays the object itself */
      PetscCall(PetscMemcmp(a.bytes, b.bytes, a.used, &same));
      if (same) pattern[key[j].number] = key[i].number;
    }
    i = j;
  }
  PetscCall(PetscFree(key));
  PetscCall(PetscFree(a.bytes));
  PetscCall(PetscFree(b.bytes));
  PetscFunctionReturn(0);
}

/* Records of bytes: record i is bytes first[i] to first[i + 1] */
typedef struct {
  const size_t *first;
  const char   *bytes;
} LatinRecords;

static PetscErrorCode LatinRecordStream_Private(const void *ctx, PetscInt i, LatinStream *stream)
{
  const LatinRecords *records = (const LatinRecords *)ctx;

  PetscFunctionBegin;
  PetscCall(LatinStreamAdd_Private(stream, records->bytes + records->first[i], records->first[i + 1] - records->first[i]));
  PetscFunctionReturn(0);
}

/* Computes pattern, [n]: of each record i, bytes first[i] to first[i + 1] of data, the first record equal to it */
PetscErrorCode LatinFindEqual(PetscInt n, const size_t first[], const void *data, PetscInt pattern[])
{
  const LatinRecords records = {first, (const char *)data};

  PetscFunctionBegin;
  PetscCall(LatinStreamCompare_Private(n, LatinRecordStream_Private, &records, pattern));
  PetscFunctionReturn(0);
}

/*
   Computes list, [*count]: the different ones of n numbers, ascending; place, [n]: index of each number in list. list has room for n, and may be
   number itself
*/
PetscErrorCode LatinPlaces_Private(PetscInt n, const PetscInt number[], PetscInt *count, PetscInt list[], PetscInt place[])
{
  PetscInt low = n ? PETSC_MAX_INT : 0, high = -1, *table;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < n; i++) {
    low  = PetscMin(low, number[i]);
    high = PetscMax(high, number[i]);
  }
  *count = n;
  if (high - low >= 2 * n) { /* sparse numbers: sort, as a table from low to high would be too long */
    PetscCall(PetscMalloc1(n, &table));
    PetscCall(PetscArraycpy(table, number, n));
    PetscCall(PetscSortRemoveDupsInt(count, table));
    for (PetscInt i = 0; i < n; i++) PetscCall(PetscFindInt(number[i], *count, table, &place[i]));
    PetscCall(PetscArraycpy(list, table, *count));
  } else { /* counting sort is faster */
    PetscCall(PetscCalloc1(high - low + 1, &table));
    for (PetscInt i = 0; i < n; i++) table[number[i] - low] = 1;
    *count = 0;
    for (PetscInt k = 0; k <= high - low; k++) table[k] = table[k] ? (*count)++ : -1;
    for (PetscInt i = 0; i < n; i++) place[i] = table[number[i] - low];
    for (PetscInt k = 0; k <= high - low; k++)
      if (table[k] >= 0) list[table[k]] = low + k;
  }
  PetscCall(PetscFree(table));
  PetscFunctionReturn(0);
}
