#include "latinimpl.h"

/*
   Errors found by one rank must end the call on all of them, or the others would wait in the next collective
   call for ever. Every rank raises the message of the lowest rank that found something.
*/
PetscErrorCode LatinAgree_Private(MPI_Comm comm, PetscBool bad, PetscErrorCode code, const char message[])
{
  PetscMPIInt rank, size, mine, first;
  char        text[512];

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  mine = bad ? rank : size;
  PetscCallMPI(MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, comm));
  if (first == size) PetscFunctionReturn(0);
  PetscCall(PetscStrncpy(text, message, sizeof(text)));
  PetscCallMPI(MPI_Bcast(text, (PetscMPIInt)sizeof(text), MPI_CHAR, first, comm));
  SETERRQ(comm, code, "%s", text);
}
