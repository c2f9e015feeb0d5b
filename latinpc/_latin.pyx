# cython: language_level=3, embedsignature=True
"""Glue between petsc4py and liblatinpc: one call of the C library a function, every error code checked.

Arrays are those of this rank, contiguous, of PETSc's types; `latinpc.structure` makes them so.
"""

from cpython.exc cimport PyErr_Occurred
from cpython.pycapsule cimport PyCapsule_GetName, PyCapsule_GetPointer
from petsc4py.PETSc cimport DM, IS, KSP, Mat, PC, SNES, TS, Object, Vec
from petsc4py.PETSc cimport PetscIS, PetscKSP, PetscMat, PetscObject, PetscSNES
from petsc4py.PETSc cimport MPI_Comm, GetComm, GetCommDefault

import numpy as np
from petsc4py import PETSc

from latinpc.errors import of_library


# petsc4py's own function, which gives the exception PETSc's messages: its C header and its .pxd exclude each other
ctypedef int (*SetError)(PetscErrorCode)
cdef object capsule = PETSc.__pyx_capi__["PyPetscError_Set"]
cdef SetError set_error = <SetError>PyCapsule_GetPointer(capsule, PyCapsule_GetName(capsule))


cdef inline int CHKERR(PetscErrorCode ierr) except -1:
    """Raise what a C call reports: a Python exception of a callback as it is, else a LatinError."""
    return 0 if ierr == 0 else fail(ierr)


cdef int fail(PetscErrorCode ierr) except -1:
    if PyErr_Occurred() != NULL:
        return -1
    try:
        petsc_error(ierr)
    except PETSc.Error as reported:
        raise of_library(reported) from None


cdef int petsc_error(PetscErrorCode ierr) except -1:
    set_error(ierr)
    return -1


cdef object own(Object wrapper, void *handle):
    """Fill a petsc4py object with a handle that the library gives away."""
    wrapper.obj[0] = <PetscObject>handle
    return wrapper


cdef object keep(Object wrapper, void *handle):
    """Fill a petsc4py object with a handle that the library keeps, and count the new reference."""
    CHKERR(PetscObjectReference(<PetscObject>handle))
    return own(wrapper, handle)


cdef const PetscInt *integers(object array) except? NULL:
    return <const PetscInt *><size_t>array.ctypes.data


cdef const PetscReal *reals(object array) except? NULL:
    return <const PetscReal *><size_t>array.ctypes.data


# ---- versions -----------------------------------------------------------------------------------------

VERSION = (LATINPC_VERSION_MAJOR, LATINPC_VERSION_MINOR, LATINPC_VERSION_SUBMINOR)
"""Version of liblatinpc's header."""

PETSC_VERSION = (PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR)
"""Version of the PETSc whose headers this module was compiled with."""


BOOL_SIZE = sizeof(PetscBool)
"""Bytes of a PetscBool: an enumeration in earlier versions of PETSc, a C bool in later ones."""


def initialized():
    """Tell whether the PETSc that liblatinpc is linked with has been initialised."""
    cdef PetscBool yes = 0
    CHKERR(PetscInitialized(&yes))
    return bool(yes)


def initialize_package():
    """Register the types ``latin`` with PETSc."""
    CHKERR(LatinInitializePackage())


cdef PetscErrorCode check_signals() noexcept with gil:
    """Run Python's handlers of the signals that came during a call of C: that of Ctrl-C raises KeyboardInterrupt."""
    return LATIN_ERR_PYTHON if PyErr_CheckSignals() else 0


def keep_communicator(comm):
    """Keep PETSc's own duplicate of a communicator until the end of PETSc; collective, the first time."""
    CHKERR(LatinKeepComm(GetComm(comm, GetCommDefault())))


def interruptible():
    """Let signals end solves. On several ranks they could not all see one: there the launcher ends them all."""
    CHKERR(LatinSetInterrupt(check_signals))


def option_used(name):
    """Return whether PETSc has read an option of its database."""
    cdef PetscBool used = 0
    CHKERR(PetscOptionsUsed(NULL, name.encode(), &used))
    return bool(used)


# ---- laws -----------------------------------------------------------------------------------------------

def register_law(name, tension, tangent, energy, local, context):
    """Register a law from the addresses of C functions, 0 for none; return its number."""
    cdef LatinLawFunctions functions
    cdef PetscInt law = -1
    functions.tension = <void *><size_t>tension
    functions.tangent = <void *><size_t>tangent
    functions.energy = <void *><size_t>energy
    functions.local = <void *><size_t>local
    functions.ctx = <void *><size_t>context
    CHKERR(LatinLawRegister(name.encode(), &functions, &law))
    return law


def register_table(name, elongation, tension):
    """Register a piecewise linear law; return its number."""
    cdef PetscInt law = -1
    CHKERR(LatinLawRegisterTable(name.encode(), len(elongation), reals(elongation), reals(tension), &law))
    return law


def law_names():
    """Return the names of all laws, in the order of their numbers."""
    cdef const char *name = NULL
    names = []
    while True:
        CHKERR(LatinLawGetName(len(names), &name))
        if name == NULL:
            return names
        names.append(name.decode())


def law_stiffness(law):
    """Return the stiffness that links of a law have where none is given; 0: none."""
    cdef PetscReal stiffness = 0
    CHKERR(LatinLawGetStiffness(law, &stiffness))
    return stiffness


def law_tensions(law, stiffness, strain):
    """Return the tensions of links of a law that is not rigid, from arrays of stiffnesses and of strains e + e0."""
    cdef PetscReal tension = 0
    found = np.empty(len(strain))
    for link in range(len(strain)):
        CHKERR(LatinLawGetTension(law, stiffness[link], strain[link], &tension))
        found[link] = tension
    return found


include "_structure.pxi"


# ---- solvers --------------------------------------------------------------------------------------------

cdef Latin core(Object solver) except NULL:
    """Return the method inside a SNES, KSP or PC of type latin."""
    cdef Latin latin = NULL
    if isinstance(solver, PETSc.SNES):
        CHKERR(SNESLatinGetLatin((<SNES>solver).snes, &latin))
    elif isinstance(solver, PETSc.KSP):
        CHKERR(KSPLatinGetLatin((<KSP>solver).ksp, &latin))
    elif isinstance(solver, PETSc.PC):
        CHKERR(PCLatinGetLatin((<PC>solver).pc, &latin))
    else:
        raise TypeError(f"expected a petsc4py SNES, KSP or PC of type latin, got {type(solver).__name__}")
    return latin


def set_partition(Object solver not None, subdomain):
    """Give every link of this rank its subdomain."""
    CHKERR(LatinSetPartition(core(solver), len(subdomain), integers(subdomain)))


def set_subdomains(Object solver not None, PetscInt subdomains):
    """Choose the number of subdomains."""
    CHKERR(LatinSetSubdomains(core(solver), subdomains))


def set_partitioner(Object solver not None, int partitioner):
    """Choose who makes a partition."""
    CHKERR(LatinSetPartitioner(core(solver), partitioner))


def set_variant(Object solver not None, int variant):
    """Choose the coarse treatment of weak interfaces."""
    CHKERR(LatinSetVariant(core(solver), variant))


def set_modes(Object solver not None, int modes, PetscReal threshold):
    """Choose the macro fields of strong interfaces and the threshold of local ones."""
    CHKERR(LatinSetModes(core(solver), modes, threshold))


def set_direction(Object solver not None, int direction, PetscReal value):
    """Choose the search direction of the interfaces."""
    CHKERR(LatinSetDirection(core(solver), direction, value))


def set_precision(Object solver not None, int precision):
    """Choose the precision of factors that linear stages correct."""
    CHKERR(LatinSetPrecision(core(solver), precision))


def statistics(Object solver not None):
    """Return the fields of ``LatinStatistics``."""
    cdef LatinStatistics s
    CHKERR(LatinGetStatistics(core(solver), &s))
    return s


def cost(Object solver not None):
    """Return the fields of ``LatinCost``."""
    cdef LatinCost c
    CHKERR(LatinGetCost(core(solver), &c))
    return {**c, "choice": c.choice.decode()}


def subdomains(Object solver not None):
    """Return the number of subdomains of this rank and the number of its first one."""
    cdef PetscInt count = 0, first = 0
    CHKERR(LatinGetSubdomains(core(solver), &count, &first))
    return count, first


def subdomain_is(Object solver not None, PetscInt i):
    """Return the unknowns of a subdomain."""
    cdef PetscIS iset = NULL
    CHKERR(LatinGetSubdomainIS(core(solver), i, &iset))
    return own(PETSc.IS(), iset)


def macro_stiffness(Object solver not None, PetscInt i):
    """Return the macro stiffness of a subdomain."""
    cdef PetscMat mat = NULL
    CHKERR(LatinGetMacroStiffness(core(solver), i, &mat))
    return own(PETSc.Mat(), mat)


def subdomain_of_links(Object solver not None, out):
    """Write the subdomain of every link of this rank into ``out``."""
    CHKERR(LatinGetSubdomainOfLinks(core(solver), <PetscInt *>integers(out)))


def node_classes(Object solver not None, out):
    """Write the class of every node of this rank into ``out``."""
    CHKERR(LatinGetNodeClasses(core(solver), <PetscInt *>integers(out)))


def local_ksp(Object solver not None, PetscInt i=0):
    """Return the KSP of the subdomains."""
    cdef PetscKSP ksp = NULL
    CHKERR(LatinGetLocalKSP(core(solver), i, &ksp))
    return keep(PETSc.KSP(), ksp)


def coarse_ksp(Object solver not None):
    """Return the KSP of the coarse problem, None where there is none."""
    cdef PetscKSP ksp = NULL
    CHKERR(LatinGetCoarseKSP(core(solver), &ksp))
    return None if ksp is NULL else keep(PETSc.KSP(), ksp)


def outer_snes(SNES snes not None):
    """Return the SNES that iterates the fixed-point map."""
    cdef PetscSNES outer = NULL
    CHKERR(SNESLatinGetOuter(snes.snes, &outer))
    return keep(PETSc.SNES(), outer)


def outer_ksp(KSP ksp not None):
    """Return the KSP that solves for the interface data."""
    cdef PetscKSP outer = NULL
    CHKERR(KSPLatinGetOuter(ksp.ksp, &outer))
    return keep(PETSc.KSP(), outer)


def tensions(SNES snes not None, out):
    """Write the tensions of this rank's links at the solution into ``out``."""
    CHKERR(SNESLatinGetTensions(snes.snes, <PetscReal *>reals(out)))


def step_tensions(TS ts not None, out):
    """Write the mean tensions of this rank's links during the last step into ``out``."""
    CHKERR(TSLatinGetTensions(ts.ts, <PetscReal *>reals(out)))


def step_cause(TS ts not None):
    """Return why the last step has not converged, and what to change."""
    cdef char cause[600]
    CHKERR(TSLatinGetCause(ts.ts, sizeof(cause), cause))
    return cause.decode()


def solve_cases(SNES snes not None, load, prescribed, elongation, displacement, tension, stages):
    """Solve load cases side by side: lists of arrays, None where there is none; fills the last three."""
    cdef PetscInt i, n = len(load)
    pointers = np.zeros((5, max(n, 1)), dtype=np.uintp)
    for row, arrays in zip(pointers, (load, prescribed, elongation, displacement, tension)):
        row[:n] = [0 if array is None else array.ctypes.data for array in arrays]
    cdef size_t at = pointers.ctypes.data, apart = pointers.strides[0]
    CHKERR(SNESLatinSolveCases(snes.snes, n, <const PetscReal **>at, <const PetscReal **>(at + apart),
                               <const PetscReal **>(at + 2 * apart), <PetscReal **>(at + 3 * apart),
                               <PetscReal **>(at + 4 * apart), <PetscInt *>integers(stages)))


def set_stop(SNES snes not None, int stop):
    """Set what must become small."""
    CHKERR(SNESLatinSetStop(snes.snes, <LatinStopType>stop))


def set_estimated_error(SNES snes not None, PetscReal error):
    """Set the estimated error to stop at."""
    CHKERR(SNESLatinSetError(snes.snes, error))


def set_tension_error(SNES snes not None, PetscReal error):
    """Set the estimated error of the tensions to stop at."""
    CHKERR(SNESLatinSetTensionError(snes.snes, error))


def tension_error(SNES snes not None):
    """Return the estimated error of the tensions, negative where it is not known."""
    cdef PetscReal error = 0
    CHKERR(SNESLatinGetTensionEstimate(snes.snes, &error))
    return error


def set_balance(SNES snes not None, PetscReal balance):
    """Set the largest unbalanced forces at convergence."""
    CHKERR(SNESLatinSetBalance(snes.snes, balance))


def set_largest_unbalance(SNES snes not None, PetscReal force):
    """Set the largest unbalanced force on a node at convergence."""
    CHKERR(SNESLatinSetLargestUnbalance(snes.snes, force))


def set_warm_start(SNES snes not None, int warm):
    """Set where a solve starts."""
    CHKERR(SNESLatinSetWarmStart(snes.snes, <LatinWarmStart>warm))


def set_newton(SNES snes not None, int newton):
    """Set when Newton's method takes over."""
    CHKERR(SNESLatinSetNewton(snes.snes, <LatinNewtonType>newton))


def set_reference(SNES snes not None, Vec reference):
    """Give the displacement that errors are measured against."""
    CHKERR(SNESLatinSetReference(snes.snes, reference.vec if reference is not None else NULL))


cdef object copy(const PetscReal *values, PetscInt n):
    out = np.empty(n if values != NULL else 0)
    cdef PetscInt i
    for i in range(out.size):
        out[i] = values[i]
    return out


def history(SNES snes not None):
    """Return indicator, l2 error and energy error per iteration; empty where not measured."""
    cdef PetscInt n = 0
    cdef const PetscReal *indicator = NULL
    cdef const PetscReal *error_l2 = NULL
    cdef const PetscReal *error_energy = NULL
    CHKERR(SNESLatinGetHistory(snes.snes, &n, &indicator, &error_l2, &error_energy))
    return copy(indicator, n), copy(error_l2, n), copy(error_energy, n)


def estimates(SNES snes not None):
    """Return the estimated error per iteration, empty where not estimated, that of the solution, and what rounding leaves."""
    cdef PetscInt n = 0
    cdef const PetscReal *estimate = NULL
    cdef PetscReal last = 0, least = 0
    CHKERR(SNESLatinGetEstimates(snes.snes, &n, &estimate, &last, &least))
    return copy(estimate, n), last, least


def path(SNES snes not None):
    """Return how often operators were made anew, the part of the loads that is borne, whether a branch begins there."""
    cdef PetscInt renewals = 0
    cdef PetscReal borne = 0
    cdef PetscBool branch = <PetscBool>0
    CHKERR(SNESLatinGetPath(snes.snes, &renewals, &borne))
    CHKERR(SNESLatinGetBranch(snes.snes, &branch))
    return renewals, borne, bool(branch)


def unsupported_nodes(SNES snes not None):
    """Return how many nodes nothing holds, some of them, and how far they are from a support."""
    cdef PetscInt count = 0, listed = 0, i
    cdef const PetscInt *node = NULL
    cdef PetscReal way = 0
    CHKERR(SNESLatinGetUnsupportedNodes(snes.snes, &count, &listed, &node, &way))
    return count, [node[i] for i in range(listed)], way


def jammed_links(SNES snes not None):
    """Return how many rigid links no displacement meets together, and some of them."""
    cdef PetscInt count = 0, listed = 0, i
    cdef const PetscInt *link = NULL
    CHKERR(SNESLatinGetJammedLinks(snes.snes, &count, &listed, &link))
    return count, [link[i] for i in range(listed)]


def energy_bound(SNES snes not None):
    """Return the bound of the error in the energy norm, and of the relative error."""
    cdef PetscReal bound = 0, relative = 0
    CHKERR(LatinGetEnergyBound(snes.snes, &bound, &relative))
    return bound, relative


def digits(SNES snes not None):
    """Return what the unbalance, and what the rounding of arithmetic, coordinates and other data move."""
    cdef PetscReal unbalance = 0, rounding = 0, places = 0, values = 0
    CHKERR(LatinGetDigits(snes.snes, &unbalance, &rounding, &places, &values))
    return {"unbalance": unbalance, "rounding": rounding, "places": places, "values": values}


def save_state(Object solver not None, Vec u, path, note):
    """Write the state of a SNES or a TS."""
    CHKERR(LatinStateSave(solver.obj[0], u.vec if u is not None else NULL, path, len(note), note))


def load_state(Object solver not None, Vec u, path):
    """Read the state of a SNES or a TS; return the note."""
    cdef PetscInt n = 0
    cdef char *note = NULL
    try:
        CHKERR(LatinStateLoad(solver.obj[0], u.vec if u is not None else NULL, path, &n, &note))
        return note[:n]
    finally:
        PetscFree(note)


def pcshell_set_latin(PC pc not None):
    """Make a PCSHELL apply the preconditioner latin."""
    CHKERR(PCShellSetLatin(pc.pc))
