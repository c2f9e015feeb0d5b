#include "base/compat.h"
#include <latinpc.h>

/*
   What the Fortran module (packaging/latinpc.F90.in) needs beside the functions of latinpc.h: a communicator of Fortran, and no memory
   that only C can free.
*/

PETSC_EXTERN PetscErrorCode LatinStructureCreateFortran(MPI_Fint, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *);
PETSC_EXTERN PetscErrorCode LatinStateLoadFortran(PetscObject solver, Vec u, const char file[]);

PetscErrorCode LatinStructureCreateFortran(MPI_Fint comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *structure)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCreate(MPI_Comm_f2c(comm), dim, nodes_local, nodes_global, coordinates, links_local, link_nodes, structure));
  PetscFunctionReturn(0);
}

/* The note of the caller is left out */
PetscErrorCode LatinStateLoadFortran(PetscObject solver, Vec u, const char file[])
{
  PetscInt n;
  char    *note;

  PetscFunctionBegin;
  PetscCall(LatinStateLoad(solver, u, file, &n, &note));
  PetscCall(PetscFree(note));
  PetscFunctionReturn(0);
}
