#include "collective.h"
#include <petsc/private/petscimpl.h>

/*
   Raises on all ranks the error of the lowest rank with one, if any; mine: that of this rank, or 0. An error on one rank must end the call on all, or the
   others deadlock in the next collective call. Collective on comm
*/
PetscErrorCode LatinAgree_Private(MPI_Comm comm, PetscErrorCode mine, const char message[])
{
  PetscMPIInt rank, size, first, code = (PetscMPIInt)mine;
  char        text[512];

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  first = mine ? rank : size;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, comm));
  if (first == size) PetscFunctionReturn(0);
  PetscCall(PetscStrncpy(text, message, sizeof(text)));
  PetscCallMPI(MPI_Bcast(&code, 1, MPI_INT, first, comm));
  PetscCallMPI(MPI_Bcast(text, (PetscMPIInt)sizeof(text), MPI_CHAR, first, comm));
  SETERRQ(comm, (PetscErrorCode)code, "%s", text);
}

/* LatinAgree_Private() for an error that PETSc has raised, with its message; ends LatinWatchApart_Private(). Collective on comm */
PetscErrorCode LatinAgreeError_Private(MPI_Comm comm, PetscErrorCode mine)
{
  char *message = NULL;

  PetscFunctionBegin;
  LatinWatchApart_Private(-1);
  if (mine) PetscCall(PetscErrorMessage(mine, NULL, (void *)&message)); /* a char *, const in some versions of PETSc */
  PetscCall(LatinAgree_Private(comm, mine, message ? message : ""));
  PetscFunctionReturn(0);
}

/*
   Checks that n settings are the same on all ranks, which would else deadlock in collective calls. prefix, name: of their options. Collective on comm
*/
PetscErrorCode LatinSame_Private(MPI_Comm comm, PetscInt n, const PetscReal value[], const char prefix[], const char *const name[])
{
  PetscReal most[2 * LATIN_SAME_MOST]; /* each value, and its negative */

  PetscFunctionBegin;
  for (PetscInt i = 0; i < n; i++) {
    most[2 * i]     = value[i];
    most[2 * i + 1] = -value[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, (PetscMPIInt)(2 * n), MPIU_REAL, MPIU_MAX, comm));
  for (PetscInt i = 0; i < n; i++) PetscCheck(most[2 * i] == -most[2 * i + 1], comm, PETSC_ERR_ARG_INCOMP, "Ranks differ in -%s%s, or in what its function sets: give every rank the same", prefix, name[i]);
  PetscFunctionReturn(0);
}

/* Checks that choice is a value, from 0 on, of an enumeration. names: its values, then its name and its prefix, then NULL. Logically collective on object */
PetscErrorCode LatinCheckChoice_Private(PetscObject object, const char *const names[], int choice)
{
  int n = 0;

  PetscFunctionBegin;
  PetscValidLogicalCollectiveInt(object, choice, 2);
  while (names[n + 2]) n++;
  PetscCheck(choice >= 0 && choice < n, PetscObjectComm(object), PETSC_ERR_ARG_OUTOFRANGE, "There is no choice %d: take one of %s", choice, names[n]);
  PetscFunctionReturn(0);
}

/* Creates the type of n units per point of a PetscSF; n = 1: the unit itself, as a PetscSF needs it. Not collective */
static PetscErrorCode LatinType_Private(PetscInt n, MPI_Datatype unit, MPI_Datatype *type)
{
  PetscFunctionBegin;
  *type = unit;
  if (n > 1) {
    PetscCallMPI(MPI_Type_contiguous((PetscMPIInt)n, unit, type));
    PetscCallMPI(MPI_Type_commit(type));
  }
  PetscFunctionReturn(0);
}

/* Broadcasts n units from each root to its leaves. Collective on sf */
PetscErrorCode LatinSFBcast_Private(PetscSF sf, PetscInt n, MPI_Datatype unit, const void *root, void *leaf)
{
  MPI_Datatype type;

  PetscFunctionBegin;
  PetscCall(LatinType_Private(n, unit, &type));
  PetscCall(PetscSFBcastBegin(sf, type, root, leaf, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(sf, type, root, leaf, MPI_REPLACE));
  if (n > 1) PetscCallMPI(MPI_Type_free(&type));
  PetscFunctionReturn(0);
}

/* Reduces n units of each leaf to its root. Collective on sf */
PetscErrorCode LatinSFReduce_Private(PetscSF sf, PetscInt n, MPI_Datatype unit, const void *leaf, void *root, MPI_Op op)
{
  MPI_Datatype type;

  PetscFunctionBegin;
  PetscCall(LatinType_Private(n, unit, &type));
  PetscCall(PetscSFReduceBegin(sf, type, leaf, root, op));
  PetscCall(PetscSFReduceEnd(sf, type, leaf, root, op));
  if (n > 1) PetscCallMPI(MPI_Type_free(&type));
  PetscFunctionReturn(0);
}

/* Creates an SF from a distributed array, `roots` entries of it on this rank, to leaves: the entries of these global numbers. Collective on comm */
PetscErrorCode LatinSFFetch_Private(MPI_Comm comm, PetscInt roots, PetscInt leaves, const PetscInt number[], PetscSF *sf)
{
  PetscLayout map;

  PetscFunctionBegin;
  PetscCall(PetscLayoutCreateFromSizes(comm, roots, PETSC_DETERMINE, 1, &map));
  PetscCall(PetscSFCreate(comm, sf));
  PetscCall(PetscSFSetGraphLayout(*sf, map, leaves, NULL, PETSC_COPY_VALUES, number));
  PetscCall(PetscLayoutDestroy(&map));
  PetscFunctionReturn(0);
}

/* Replaces an SF by a duplicate without buffers: PetscSF keeps two arrays for each MPI type that it has sent. Collective on sf */
PetscErrorCode LatinSFFresh_Private(PetscSF *sf)
{
  PetscSF fresh;

  PetscFunctionBegin;
  PetscCall(PetscSFDuplicate(*sf, PETSCSF_DUPLICATE_GRAPH, &fresh));
  PetscCall(PetscSFDestroy(sf));
  *sf = fresh;
  PetscFunctionReturn(0);
}
