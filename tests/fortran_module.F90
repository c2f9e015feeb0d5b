! Calls the functions of the Fortran module, each kind of argument among them; every rank checks what it gets.

module laws
  use, intrinsic :: iso_c_binding
#include <petsc/finclude/petscsys.h>
  use petscsys
  implicit none
  integer :: questions = 0
contains
  ! whether the program ends a solve
  function interrupted() bind(C)
    integer(c_int) :: interrupted
    questions = questions + 1
    interrupted = 0
  end function
  ! a cable that bears twice as much, as a law of the user
  function tension(k, x, ctx) bind(C)
    PetscReal, value :: k, x
    type(c_ptr), value :: ctx
    PetscReal :: tension
    tension = 2 * k * max(x, 0d0)
  end function
  function tangent(k, x, ctx) bind(C)
    PetscReal, value :: k, x
    type(c_ptr), value :: ctx
    PetscReal :: tangent
    tangent = merge(2 * k, 0d0, x > 0)
  end function
  function energy(k, x, ctx) bind(C)
    PetscReal, value :: k, x
    type(c_ptr), value :: ctx
    PetscReal :: energy
    energy = k * max(x, 0d0)**2
  end function
end module

program fortran_module
#include <petsc/finclude/petscts.h>
  use latinpc
  use laws
  implicit none
  ! three cables, their ends clamped, hold a node that a weight pulls down by 10 N; a table is a fourth link beside the third
  PetscInt, parameter :: dim = 2, all = 4, ends(8) = [0, 3, 1, 3, 2, 3, 2, 3], cases = 2, points = 3, steps = 4, cable = LATIN_LAW_CABLE
  PetscReal, parameter :: x(8) = [-1, 1, 1, 1, 0, -1, 0, 0], stiffness(4) = 1d4, force(8) = [0, 0, 0, 0, 0, 0, 0, -10]
  PetscReal, parameter :: elongation(3) = [-1, 0, 1], force_of_table(3) = [0, 0, 1000], mass(4) = [0, 0, 0, 1], step = 1d-3
  integer, parameter :: of_links(4) = [0, 1, 2, 2]
  PetscBool, parameter :: fixed(8) = [.true., .true., .true., .true., .true., .true., .false., .false.]
  PetscReal :: displacement(8), tensions(4), work, l2, in_energy, last, floor, k, half
  PetscReal :: load(8, 2), moved(8, 2), forces(4, 2)
  PetscReal, pointer :: indicator(:), error_l2(:), error_energy(:), estimate(:), as_set(:), e0(:)
  PetscInt, pointer :: listed_nodes(:), laws_set(:)
  PetscBool, pointer :: fixed_set(:)
  PetscInt :: nodes, links, law(4), own, table, sizes(4), n, count, listed, stages(2), of_link(4), first
  PetscMPIInt :: rank
  PetscErrorCode :: ierr
  PetscBool :: wrong
  character(len=600) :: name, cause
  integer :: geometry, stop_set, direction
  type(LatinStructure) :: structure, alone
  type(Latin) :: method
  type(LatinLawFunctions) :: functions
  type(LatinStatistics) :: statistics
  type(LatinCost) :: cost
  SNES :: solver, outer
  KSP :: coarse
  TS :: motion
  DM :: grid
  Vec :: u, v, r

  PetscCallA(PetscInitialize(ierr))
  PetscCallMPIA(MPI_Comm_rank(PETSC_COMM_WORLD, rank, ierr))
  PetscCallA(LatinInitializePackage(ierr))
  functions%tension = c_funloc(tension)
  functions%tangent = c_funloc(tangent)
  functions%energy = c_funloc(energy)
  PetscCallA(LatinLawRegister("doubled", functions, own, ierr))
  PetscCallA(LatinLawRegisterTable("rope", points, elongation, force_of_table, table, ierr))
  PetscCallA(LatinLawGetName(own, name, ierr))
  call check(name == "doubled", "the name of a law")
  half = 0.5d0
  PetscCallA(LatinLawGetTension(own, stiffness(1), half, work, ierr))
  call check(work == 1d4, "a function of the user")

  nodes = merge(4, 0, rank == 0)
  links = merge(4, 0, rank == 0)
  law = [own, own, own, table]
  PetscCallA(LatinStructureCreate(PETSC_COMM_WORLD, dim, nodes, all, x, links, ends, structure, ierr))
  PetscCallA(PetscOptionsHasName(PETSC_NULL_OPTIONS, PETSC_NULL_CHARACTER, "-without_laws", wrong, ierr))
  if (wrong) then
    PetscCallA(LatinStructureSetUp(structure, ierr))
  end if
  PetscCallA(LatinStructureSetLaws(structure, law, [5d3, 5d3, 5d3, 0d0], ierr=ierr))
  PetscCallA(LatinStructureSetSupports(structure, fixed, ierr=ierr))
  PetscCallA(LatinStructureSetLoads(structure, force, ierr))
  PetscCallA(LatinStructureSetMass(structure, mass, ierr))
  PetscCallA(LatinStructureSetGeometry(structure, LATIN_GEOMETRY_LINEAR, ierr))
  PetscCallA(LatinStructureSetUp(structure, ierr))
  PetscCallA(LatinStructureGetSizes(structure, sizes(1), sizes(2), sizes(3), sizes(4), ierr))
  call check(all_are(sizes, [2, 4, 4, 2]), "sizes")
  PetscCallA(LatinStructureGetGeometry(structure, geometry, ierr))
  call check(geometry == LATIN_GEOMETRY_LINEAR, "geometry")
  PetscCallA(LatinStructureGetLaws(structure, n, laws_set, as_set, e0, ierr))
  if (rank == 0) call check(n == links .and. all_are(laws_set, int(law(:n))) .and. size(as_set) == n .and. .not. any(e0 /= 0), "laws as set")
  PetscCallA(LatinStructureGetSupports(structure, n, fixed_set, as_set, ierr))
  if (rank == 0) call check(n == 2 * nodes .and. .not. any(fixed_set .neqv. fixed(:n)) .and. .not. any(as_set /= 0), "supports as set")
  PetscCallA(LatinStructureGetLoads(structure, n, as_set, ierr))
  if (rank == 0) call check(n == 2 * nodes .and. .not. any(as_set /= force(:n)), "loads as set")
  PetscCallA(LatinStructureGetMass(structure, n, as_set, ierr))
  if (rank == 0) call check(n == nodes .and. .not. any(as_set /= mass(:n)), "masses as set")
  PetscCallA(LatinStructureGetFriction(structure, n, as_set, ierr))
  call check(n == 0 .and. .not. associated(as_set), "no coefficients of friction")

  PetscCallA(SNESCreate(PETSC_COMM_WORLD, solver, ierr))
  PetscCallA(LatinStructureAttachSNES(structure, solver, ierr))
  PetscCallA(SNESSetType(solver, SNESLATIN, ierr))
  PetscCallA(SNESLatinSetStop(solver, LATIN_STOP_ERROR, ierr))
  k = 1d-6
  PetscCallA(SNESLatinSetError(solver, k, ierr))
  PetscCallA(SNESLatinGetStop(solver, stop_set, ierr))
  PetscCallA(SNESLatinGetError(solver, work, ierr))
  call check(stop_set == LATIN_STOP_ERROR .and. work == k, "stop as set")
  PetscCallA(SNESLatinGetLatin(solver, method, ierr))
  PetscCallA(LatinSetPartition(method, links, of_links, ierr))
  PetscCallA(LatinGetPartition(method, n, listed_nodes, ierr))
  if (rank == 0) call check(n == links .and. all_are(listed_nodes, of_links(:n)), "partition as set")
  PetscCallA(LatinGetDirection(method, direction, work, ierr))
  call check(direction == LATIN_DIRECTION_SCHUR .and. work == 0, "search direction by default")
  PetscCallA(SNESSetFromOptions(solver, ierr))
  PetscCallA(LatinSetInterrupt(c_funloc(interrupted), ierr))
  PetscCallA(SNESSolve(solver, PETSC_NULL_VEC, PETSC_NULL_VEC, ierr))
  call check(questions > 0, "a function that may end a solve")
  PetscCallA(LatinSetInterrupt(c_null_funptr, ierr))
  PetscCallA(SNESGetSolution(solver, u, ierr))
  PetscCallA(LatinStructureGetDisplacements(structure, u, displacement, ierr))
  PetscCallA(LatinStructureGetTensions(structure, u, tensions, ierr))
  if (rank == 0) call check(near(displacement(8), -1d-3), "displacements")  ! 10 N over 1e4 N/m in two cables at 45 degrees
  if (rank == 0) call check(near(tensions(1), 10 / sqrt(2d0)) .and. tensions(3) == 0, "tensions")
  PetscCallA(VecDuplicate(u, r, ierr))
  PetscCallA(LatinStructureComputeResidual(structure, u, r, ierr))
  PetscCallA(VecNorm(r, NORM_2, work, ierr))
  call check(work < 1d-5, "residual")
  PetscCallA(LatinStructureComputeEnergy(structure, u, work, ierr))
  call check(near(work, -0.5d-2), "energy")  ! half the work of the load, less all of it
  PetscCallA(LatinStructureComputeErrors(structure, u, u, l2, in_energy, ierr))
  call check(l2 == 0 .and. in_energy == 0, "errors")
  PetscCallA(LatinGetDigits(solver, work, floor, l2, in_energy, ierr))
  call check(work >= 0 .and. work < 1e-5, "digits")

  PetscCallA(SNESLatinGetHistory(solver, n, indicator, error_l2, error_energy, ierr))
  call check(n > 0 .and. size(indicator) == n .and. indicator(1) > 0, "history")
  PetscCallA(SNESLatinGetEstimates(solver, n, estimate, last, floor, ierr))
  call check(size(estimate) == n .and. last <= 1d-6 .and. last >= 0, "estimates")
  PetscCallA(SNESLatinGetUnsupportedNodes(solver, count, listed, listed_nodes, work, ierr))
  call check(count == 0 .and. size(listed_nodes) == listed, "unsupported nodes")
  PetscCallA(SNESLatinGetOuter(solver, outer, ierr))
  PetscCallA(SNESGetType(outer, name, ierr))
  call check(name == "anderson", "the inner SNES")
  PetscCallA(LatinGetCoarseKSP(method, coarse, ierr))
  PetscCallA(LatinGetStatistics(method, statistics, ierr))
  call check(statistics%subdomains == 3 .and. statistics%state_size > 0 .and. statistics%direction_max >= statistics%direction_min, "statistics")
  PetscCallA(LatinGetCost(method, cost, ierr))
  call check(cost%setup_seconds > 0 .and. cost%linear_stages > 0, "cost")
  PetscCallA(LatinGetSubdomains(method, n, first, ierr))
  call check(n >= 0 .and. n <= 3 .and. first >= 0, "subdomains")
  of_link = -1
  PetscCallA(LatinGetSubdomainOfLinks(method, of_link, ierr))
  if (rank == 0) call check(all_are(of_link, of_links), "subdomains of links")

  PetscCallA(LatinStateSave(solver, u, "fortran.state", ierr))
  PetscCallA(VecSet(u, 0d0, ierr))
  PetscCallA(LatinStateLoad(solver, u, "fortran.state", ierr))
  PetscCallA(LatinStructureGetDisplacements(structure, u, displacement, ierr))
  if (rank == 0) call check(near(displacement(8), -1d-3), "state")

  PetscCallA(SNESDestroy(solver, ierr))

  ! load cases: a structure of cables for each rank
  PetscCallA(LatinStructureCreate(PETSC_COMM_SELF, dim, all, all, x, all, ends, alone, ierr))
  PetscCallA(LatinStructureSetLaws(alone, [(cable, n=1, 4)], stiffness, ierr=ierr))
  PetscCallA(LatinStructureSetSupports(alone, fixed, ierr=ierr))
  PetscCallA(LatinStructureSetUp(alone, ierr))
  PetscCallA(SNESCreate(PETSC_COMM_SELF, solver, ierr))
  PetscCallA(LatinStructureAttachSNES(alone, solver, ierr))
  PetscCallA(SNESSetType(solver, SNESLATIN, ierr))
  load(:, 1) = force
  load(:, 2) = 3 * force
  PetscCallA(PetscOptionsHasName(PETSC_NULL_OPTIONS, PETSC_NULL_CHARACTER, "-one_load", wrong, ierr))
  if (wrong) then
    PetscCallA(SNESLatinSolveCases(solver, cases, load=load(:, :1), displacement=moved, tension=forces, stages=stages, ierr=ierr))
  end if
  PetscCallA(SNESLatinSolveCases(solver, cases, load=load, displacement=moved, tension=forces, stages=stages, ierr=ierr))
  call check(minval(stages) > 0, "stages of cases")
  call check(near(moved(8, 1), -1d-3) .and. near(moved(8, 2), -3d-3) .and. near(forces(1, 2), 30 / sqrt(2d0)), "cases")
  PetscCallA(SNESDestroy(solver, ierr))
  PetscCallA(LatinStructureDestroy(alone, ierr))

  PetscCallA(TSCreate(PETSC_COMM_WORLD, motion, ierr))
  PetscCallA(LatinStructureAttachTS(structure, motion, ierr))
  PetscCallA(TSSetType(motion, TSLATIN, ierr))
  PetscCallA(LatinStructureGetDM(structure, grid, ierr))
  PetscCallA(DMCreateGlobalVector(grid, u, ierr))
  PetscCallA(VecDuplicate(u, v, ierr))
  PetscCallA(TS2SetSolution(motion, u, v, ierr))
  PetscCallA(TSSetTimeStep(motion, step, ierr))
  PetscCallA(TSSetMaxSteps(motion, steps, ierr))
  PetscCallA(TSSetExactFinalTime(motion, TS_EXACTFINALTIME_STEPOVER, ierr))
  PetscCallA(TSSetFromOptions(motion, ierr))
  PetscCallA(TSSolve(motion, u, ierr))
  PetscCallA(TSLatinGetCause(motion, cause, ierr))
  call check(cause == "", "the cause of a step that has converged: "//cause)
  PetscCallA(LatinStructureGetDisplacements(structure, u, displacement, ierr))
  if (rank == 0) call check(displacement(8) < 0 .and. displacement(8) > -1d-3, "a motion")
  PetscCallA(TSLatinGetTensions(motion, tensions, ierr))
  if (rank == 0) call check(tensions(1) > 0, "tensions of a motion")
  PetscCallA(LatinStructureComputeKineticEnergy(structure, v, work, ierr))
  call check(work > 0, "kinetic energy")
  PetscCallA(TSDestroy(motion, ierr))
  PetscCallA(VecDestroy(u, ierr))
  PetscCallA(VecDestroy(v, ierr))
  PetscCallA(VecDestroy(r, ierr))
  PetscCallA(LatinStructureDestroy(structure, ierr))
  call check(.not. c_associated(structure%v), "destroyed")
  if (rank == 0) print "(a)", "all right"
  PetscCallA(PetscFinalize(ierr))

contains

  logical function near(a, b)
    PetscReal, intent(in) :: a
    double precision, intent(in) :: b
    near = abs(a - b) <= 1d-5 * abs(b)
  end function

  logical function all_are(a, b)
    PetscInt, intent(in) :: a(:)
    integer, intent(in) :: b(:)
    all_are = sum(abs(a - b)) == 0
  end function

  subroutine check(right, what)
    logical, intent(in) :: right
    character(len=*), intent(in) :: what
    if (right) return
    print "(2a)", "wrong: ", what
    error stop
  end subroutine
end program
