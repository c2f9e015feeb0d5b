#include "interfaces/latininterfaces.h"

/* Exchange between the two sides of an interface in the set-up. Iterations exchange one number for each side dof, by mate_sf itself. */

#define LATIN_MATE_COLUMNS 16 /* vectors exchanged in one message: the work space is 16 numbers a side dof */

/* Sets theirs[f] to mine[] of the mate of interface side f, 0 without side dofs. mine and theirs may be the same array. Collective on sub->object */
PetscErrorCode LatinMateNumbers_Private(const LatinInterfaces *inter, const PetscInt mine[], PetscInt theirs[])
{
  PetscInt *out, *in;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(inter->sides, &out, inter->sides, &in));
  for (PetscInt f = 0; f < inter->count; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) out[k] = mine[f];
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_INT, out, in));
  for (PetscInt f = 0; f < inter->count; f++) theirs[f] = inter->interface[f].side_last > inter->interface[f].side_first ? in[inter->interface[f].side_first] : 0;
  PetscCall(PetscFree2(out, in));
  PetscFunctionReturn(0);
}

/*
   Sends columns[f] vectors on the side dofs of each interface side, mine[f], to its mate. Receives theirs[f] vectors in *mate + first[f],
   first[count + 1]. All are column-major. The caller frees *mate. Collective on sub->object
*/
PetscErrorCode LatinMateColumns_Private(const LatinInterfaces *inter, const PetscInt columns[], const PetscReal *const mine[], PetscInt theirs[], size_t first[], PetscReal **mate)
{
  const PetscInt together = LATIN_MATE_COLUMNS;
  PetscInt       widest   = 0;
  PetscReal     *out, *in;

  PetscFunctionBegin;
  PetscCall(LatinMateNumbers_Private(inter, columns, theirs));
  first[0] = 0;
  for (PetscInt f = 0; f < inter->count; f++) {
    first[f + 1] = first[f] + (size_t)(inter->interface[f].side_last - inter->interface[f].side_first) * (size_t)theirs[f];
    widest       = PetscMax(widest, columns[f]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_INT, MPI_MAX, PetscObjectComm(inter->sub->object)));
  PetscCall(PetscMalloc1(first[inter->count], mate));
  PetscCall(PetscCalloc2(together * inter->sides, &out, together * inter->sides, &in));
  for (PetscInt j = 0; j < widest; j += together) {
    for (PetscInt f = 0; f < inter->count; f++) {
      const PetscInt top = inter->interface[f].side_first, rows = inter->interface[f].side_last - top;

      for (PetscInt c = j; c < PetscMin(j + together, columns[f]); c++)
        for (PetscInt r = 0; r < rows; r++) out[together * (top + r) + c - j] = mine[f][(size_t)r + (size_t)rows * (size_t)c];
    }
    PetscCall(LatinSFBcast_Private(inter->mate_sf, together, MPIU_REAL, out, in));
    for (PetscInt f = 0; f < inter->count; f++) {
      const PetscInt top = inter->interface[f].side_first, rows = inter->interface[f].side_last - top;

      for (PetscInt c = j; c < PetscMin(j + together, theirs[f]); c++)
        for (PetscInt r = 0; r < rows; r++) (*mate)[first[f] + (size_t)r + (size_t)rows * (size_t)c] = in[together * (top + r) + c - j];
    }
  }
  PetscCall(PetscFree2(out, in));
  PetscFunctionReturn(0);
}
