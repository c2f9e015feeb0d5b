! A net of three cables in Fortran.
!
!   mpif90 -ffree-line-length-0 examples/01_net.F90 -o 01_net $(pkg-config --cflags --libs PETSc) -Llatinpc -llatinpc -Wl,-rpath,$PWD/latinpc
!   ./01_net
!   mpirun -n 2 ./01_net -snes_latin_subdomains 3 -snes_latin_monitor
!
! latinpc has no Fortran module: the few functions of latinpc.h that are needed are declared here. A PETSc object
! hands its C pointer over as its component v. What the net is: see 01_net.c.

module latinpc
#include <petsc/finclude/petscsnes.h>
  use petscsnes
  use, intrinsic :: iso_c_binding
  implicit none
  type(c_ptr), bind(C, name="PETSC_COMM_WORLD") :: comm_world  ! as C sees it

  interface
    integer(c_int) function LatinInitializePackage() bind(C, name="LatinInitializePackage")
      import
    end function
    integer(c_int) function LatinStructureCreate(comm, dim, nodes_local, nodes, x, links_local, ends, links) bind(C, name="LatinStructureCreate")
      import
      type(c_ptr), value :: comm
      PetscInt, value :: dim, nodes_local, nodes, links_local
      PetscReal :: x(*)
      PetscInt :: ends(*)
      type(c_ptr) :: links
    end function
    integer(c_int) function LatinStructureSetLaws(links, law, stiffness, initial_elongation) bind(C, name="LatinStructureSetLaws")
      import
      type(c_ptr), value :: links
      PetscInt :: law(*)
      PetscReal :: stiffness(*), initial_elongation(*)
    end function
    integer(c_int) function LatinStructureSetSupports(links, fixed, prescribed) bind(C, name="LatinStructureSetSupports")
      import
      type(c_ptr), value :: links
      PetscBool :: fixed(*)
      PetscReal :: prescribed(*)
    end function
    integer(c_int) function LatinStructureSetLoads(links, force) bind(C, name="LatinStructureSetLoads")
      import
      type(c_ptr), value :: links
      PetscReal :: force(*)
    end function
    integer(c_int) function LatinStructureSetUp(links) bind(C, name="LatinStructureSetUp")
      import
      type(c_ptr), value :: links
    end function
    integer(c_int) function LatinStructureAttachSNES(links, snes) bind(C, name="LatinStructureAttachSNES")
      import
      type(c_ptr), value :: links
      PetscFortranAddr, value :: snes
    end function
    integer(c_int) function LatinStructureGetDisplacements(links, u, displacement) bind(C, name="LatinStructureGetDisplacements")
      import
      type(c_ptr), value :: links
      PetscFortranAddr, value :: u
      PetscReal :: displacement(*)
    end function
    integer(c_int) function LatinStructureDestroy(links) bind(C, name="LatinStructureDestroy")
      import
      type(c_ptr) :: links
    end function
  end interface
end module

program net
#include <petsc/finclude/petscsnes.h>
  use latinpc
  implicit none
  PetscInt, parameter :: dim = 2, all = 4, cable = 1, law(3) = cable, ends(6) = [0, 3, 1, 3, 2, 3]
  PetscReal, parameter :: x(8) = [-1, 1, 1, 1, 0, -1, 0, 0], stiffness(3) = 1d4, none(8) = 0
  PetscReal, parameter :: force(8) = [0, 0, 0, 0, 0, 0, 0, -10]
  PetscBool, parameter :: fixed(8) = [.true., .true., .true., .true., .true., .true., .false., .false.]
  PetscReal :: displacement(8)
  PetscInt :: nodes, links
  PetscMPIInt :: rank
  PetscErrorCode :: ierr
  type(c_ptr) :: structure
  SNES :: solver
  Vec :: u

  PetscCallA(PetscInitialize(ierr))
  PetscCallMPIA(MPI_Comm_rank(PETSC_COMM_WORLD, rank, ierr))
  nodes = merge(4, 0, rank == 0)  ! the first rank gives the whole net
  links = merge(3, 0, rank == 0)
  call check(LatinInitializePackage())
  call check(LatinStructureCreate(comm_world, dim, nodes, all, x, links, ends, structure))
  call check(LatinStructureSetLaws(structure, law, stiffness, none))
  call check(LatinStructureSetSupports(structure, fixed, none))
  call check(LatinStructureSetLoads(structure, force))
  call check(LatinStructureSetUp(structure))

  PetscCallA(SNESCreate(PETSC_COMM_WORLD, solver, ierr))
  call check(LatinStructureAttachSNES(structure, solver%v))
  PetscCallA(SNESSetType(solver, "latin", ierr))
  PetscCallA(SNESSetFromOptions(solver, ierr))
  PetscCallA(SNESSolve(solver, PETSC_NULL_VEC, PETSC_NULL_VEC, ierr))
  PetscCallA(SNESGetSolution(solver, u, ierr))
  call check(LatinStructureGetDisplacements(structure, u%v, displacement))
  if (rank == 0) then
    print "(a, f0.4, a)", "the weight sinks by ", -1e3 * displacement(8), " mm"
    if (abs(displacement(8) + 1d-3) >= 1d-7) error stop
  end if
  PetscCallA(SNESDestroy(solver, ierr))
  call check(LatinStructureDestroy(structure))
  PetscCallA(PetscFinalize(ierr))

contains

  subroutine check(ierr)
    integer(c_int), intent(in) :: ierr
    if (ierr /= 0) error stop
  end subroutine
end program
