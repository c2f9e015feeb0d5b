! A net of three cables in Fortran.
!
!   mpif90 -ffree-line-length-0 latinpc/include/latinpc.F90 examples/01_net.F90 -o 01_net $(pkg-config --cflags --libs PETSc) -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc
!   ./01_net
!   mpirun -n 2 ./01_net -snes_latin_subdomains 3 -snes_latin_monitor
!
! The module latinpc has the functions of latinpc.h, in PETSc's manner. What the net is: see 01_net.c.

program net
#include <petsc/finclude/petscsnes.h>
  use latinpc
  implicit none
  PetscInt, parameter :: dim = 2, all = 4, law(3) = LATIN_LAW_CABLE, ends(6) = [0, 3, 1, 3, 2, 3]
  PetscReal, parameter :: x(8) = [-1, 1, 1, 1, 0, -1, 0, 0], stiffness(3) = 1d4
  PetscReal, parameter :: force(8) = [0, 0, 0, 0, 0, 0, 0, -10]
  PetscBool, parameter :: fixed(8) = [.true., .true., .true., .true., .true., .true., .false., .false.]
  PetscReal :: displacement(8)
  PetscInt :: nodes, links
  PetscMPIInt :: rank
  PetscErrorCode :: ierr
  type(LatinStructure) :: structure
  SNES :: solver
  Vec :: u

  PetscCallA(PetscInitialize(ierr))
  PetscCallMPIA(MPI_Comm_rank(PETSC_COMM_WORLD, rank, ierr))
  nodes = merge(4, 0, rank == 0)  ! the first rank gives the whole net
  links = merge(3, 0, rank == 0)
  PetscCallA(LatinInitializePackage(ierr))
  PetscCallA(LatinStructureCreate(PETSC_COMM_WORLD, dim, nodes, all, x, links, ends, structure, ierr))
  PetscCallA(LatinStructureSetLaws(structure, law, stiffness, ierr=ierr))  ! without initial elongations
  PetscCallA(LatinStructureSetSupports(structure, fixed, ierr=ierr))
  PetscCallA(LatinStructureSetLoads(structure, force, ierr))
  PetscCallA(LatinStructureSetUp(structure, ierr))

  PetscCallA(SNESCreate(PETSC_COMM_WORLD, solver, ierr))
  PetscCallA(LatinStructureAttachSNES(structure, solver, ierr))
  PetscCallA(SNESSetType(solver, SNESLATIN, ierr))
  PetscCallA(SNESSetFromOptions(solver, ierr))
  PetscCallA(SNESSolve(solver, PETSC_NULL_VEC, PETSC_NULL_VEC, ierr))
  PetscCallA(SNESGetSolution(solver, u, ierr))
  PetscCallA(LatinStructureGetDisplacements(structure, u, displacement, ierr))
  if (rank == 0) then
    print "(a, f0.4, a)", "the weight sinks by ", -1e3 * displacement(8), " mm"
    if (abs(displacement(8) + 1d-3) >= 1d-7) error stop
  end if
  PetscCallA(SNESDestroy(solver, ierr))
  PetscCallA(LatinStructureDestroy(structure, ierr))
  PetscCallA(PetscFinalize(ierr))
end program
