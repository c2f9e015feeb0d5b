#include "base/compat.h"
#include <latinpc.h>

/*
   Functions of the Fortran module (packaging/latinpc.F90.in) in place of those of latinpc.h: with a communicator of Fortran; without memory that only C
   can free.
*/

PETSC_EXTERN PetscErrorCode LatinStructureCreateFortran(MPI_Fint, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *);
PETSC_EXTERN PetscErrorCode LatinStateLoadFortran(PetscObject solver, Vec u, const char file[]);

PetscErrorCode LatinStructureCreateFortran(MPI_Fint comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *structure)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureCreate(MPI_Comm_f2c(comm), dim, nodes_local, nodes_global, coordinates, links_local, link_nodes, structure));
  PetscFunctionReturn(0);
}

/* LatinStateLoad() without the note of the caller */
PetscErrorCode LatinStateLoadFortran(PetscObject solver, Vec u, const char file[])
{
  PetscInt n;
  char    *note;

  PetscFunctionBegin;
  PetscCall(LatinStateLoad(solver, u, file, &n, &note));
  PetscCall(PetscFree(note));
  PetscFunctionReturn(0);
}
