/*
   Search for equal records by hashing; disjoint sets (union-find).
*/
#ifndef LATINFINGERPRINT_H
#define LATINFINGERPRINT_H

#include <petscsys.h>

/* Hash and number of an object, to be sorted */
typedef struct {
  uint64_t hash;
  PetscInt number;
} LatinKey;

PETSC_INTERN uint64_t       LatinHash(size_t n, const void *);
PETSC_INTERN int            LatinKeyCompare(const void *, const void *); /* for qsort(): by hash, then by number */
PETSC_INTERN PetscErrorCode LatinFindEqual(PetscInt n, const size_t first[], const void *data, PetscInt pattern[]);

/* All data that an object depends on, as a stream of bytes to hash and compare */
typedef struct {
  unsigned char *bytes;
  size_t         used, size; /* bytes written, bytes allocated */
} LatinStream;
PETSC_INTERN PetscErrorCode LatinStreamRoom_Private(LatinStream *, size_t, unsigned char **);
PETSC_INTERN PetscErrorCode LatinStreamAdd_Private(LatinStream *, const void *data, size_t);
PETSC_INTERN PetscErrorCode LatinStreamCompare_Private(PetscInt n, PetscErrorCode (*make)(const void *ctx, PetscInt i, LatinStream *), const void *ctx, PetscInt pattern[]);

PETSC_INTERN PetscErrorCode LatinPlaces_Private(PetscInt n, const PetscInt number[], PetscInt *count, PetscInt list[], PetscInt place[]);

/* Mixes the bits of h: the finaliser of MurmurHash3 */
static inline uint64_t LatinMix(uint64_t h)
{
  h ^= h >> 33;
  h *= 0xff51afd7ed558ccdULL;
  h ^= h >> 33;
  h *= 0xc4ceb9fe1a85ec53ULL;
  return h ^ (h >> 33);
}

/* Disjoint sets (union-find), represented by their least members: LatinRoot() finds that of the set of i, LatinJoin() merges the sets of i and j */
static inline PetscInt LatinRoot(PetscInt parent[], PetscInt i)
{
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

static inline void LatinJoin(PetscInt parent[], PetscInt i, PetscInt j)
{
  const PetscInt a = LatinRoot(parent, i), b = LatinRoot(parent, j);

  parent[PetscMax(a, b)] = PetscMin(a, b);
}

#endif
