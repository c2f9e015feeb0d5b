# What _latin.pyx uses of PETSc and of latinpc.h.

from petsc4py.PETSc cimport MPI_Comm
from petsc4py.PETSc cimport PetscDM, PetscIS, PetscKSP, PetscMat, PetscObject, PetscPC, PetscSNES, PetscTS, PetscVec


cdef extern from *:
    ctypedef int PetscErrorCode
    ctypedef long PetscInt
    ctypedef double PetscReal
    ctypedef bint PetscBool "PetscBool"
    int PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR
    PetscErrorCode PetscInitialized(PetscBool *)
    PetscErrorCode PetscFinalized(PetscBool *)
    PetscErrorCode PetscObjectReference(PetscObject)
    PetscErrorCode PetscFree(void *)
    PetscErrorCode PetscOptionsUsed(void *, const char[], PetscBool *)

cdef extern from *:
    """
    /* petsc4py's code of a Python exception, a name in later versions of PETSc alone */
    #define LATIN_ERR_PYTHON ((PetscErrorCode)(PETSC_ERR_MAX_VALUE > 101 ? 101 : -1))
    """
    PetscErrorCode LATIN_ERR_PYTHON

cdef extern from *:
    """
    /*
       PETSc's own duplicate of a communicator goes with the last object there, and the next object makes another one, collectively. Python frees what an
       error or a cycle holds at other times on other ranks, which would then wait for each other. So one duplicate stays until PetscFinalize()
    */
    typedef struct LatinKept_ {
      MPI_Comm           comm;
      struct LatinKept_ *next;
    } LatinKept;
    static LatinKept *kept = NULL;

    static PetscErrorCode LatinKeepNone(void)
    {
      PetscFunctionBegin;
      while (kept) {
        LatinKept *one = kept;

        kept = one->next;
        PetscCall(PetscCommDestroy(&one->comm));
        PetscCall(PetscFree(one));
      }
      PetscFunctionReturn(0);
    }

    /* Keeps PETSc's duplicate of comm, unless it is kept. Its allocations, which may fail on one rank, come after the collective calls */
    static PetscErrorCode LatinKeepNew(MPI_Comm comm, PetscBool *there)
    {
      LatinKept     *one = kept;
      MPI_Comm       petsc;
      PetscErrorCode ierr;

      PetscFunctionBegin;
      *there = PETSC_FALSE;
      PetscCall(PetscCommDuplicate(comm, &petsc, NULL));
      while (one && one->comm != petsc) one = one->next;
      if (one) {
        *there = PETSC_TRUE;
        PetscCall(PetscCommDestroy(&petsc));
        PetscFunctionReturn(0);
      }
      ierr = kept ? (PetscErrorCode)0 : PetscRegisterFinalize(LatinKeepNone);
      if (!ierr) ierr = PetscNew(&one);
      if (ierr) (void)PetscCommDestroy(&petsc);
      PetscCall(ierr);
      one->comm = petsc;
      one->next = kept;
      kept      = one;
      PetscFunctionReturn(0);
    }

    /* All ranks keep it or none: an error of one is an error of all. Collective on comm */
    static PetscErrorCode LatinKeepComm(MPI_Comm comm)
    {
      PetscBool      there;
      PetscMPIInt    size, worst;
      PetscErrorCode ierr;

      PetscFunctionBegin;
      PetscCallMPI(MPI_Comm_size(comm, &size));
      if (size == 1) PetscFunctionReturn(0);
      ierr = LatinKeepNew(comm, &there);
      if (there) PetscFunctionReturn(0);
      worst = (PetscMPIInt)ierr;
      PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &worst, 1, MPI_INT, MPI_MAX, comm));
      if (worst && !ierr) {
        LatinKept *one = kept;

        kept = one->next;
        PetscCall(PetscCommDestroy(&one->comm));
        PetscCall(PetscFree(one));
      }
      PetscCall(ierr);
      PetscCheck(!worst, PETSC_COMM_SELF, (PetscErrorCode)worst, "Another rank has failed to keep a communicator");
      PetscFunctionReturn(0);
    }
    """
    PetscErrorCode LatinKeepComm(MPI_Comm)

cdef extern from "Python.h":
    int PyErr_CheckSignals()  # the exception stays pending, for petsc4py to raise

cdef extern from "latinpc.h":
    int LATINPC_VERSION_MAJOR, LATINPC_VERSION_MINOR, LATINPC_VERSION_SUBMINOR

    struct _p_LatinStructure
    ctypedef _p_LatinStructure *LatinStructure
    struct _p_Latin
    ctypedef _p_Latin *Latin

    ctypedef struct LatinStatistics:
        PetscInt subdomains
        PetscInt strong_interfaces
        PetscInt weak_interfaces
        PetscInt strong_macro_dofs
        PetscInt weak_dofs
        PetscInt coarse_size, coarse_levels
        PetscInt local_macro_dofs
        PetscInt low_energy_subdomains
        PetscInt local_modes_max
        PetscInt micro_sides
        PetscInt state_size
        PetscReal direction_min
        PetscReal direction_mean
        PetscReal direction_max

    ctypedef struct LatinCost:
        const char *choice
        PetscReal factor_operations
        PetscReal factor_bytes
        PetscReal setup_seconds
        PetscInt linear_stages
        PetscReal stage_seconds

    ctypedef PetscErrorCode LatinInterruptFn() noexcept
    PetscErrorCode LatinSetInterrupt(LatinInterruptFn *)
    PetscErrorCode LatinInitializePackage()

    ctypedef struct LatinLawFunctions:  # functions of C, known here by their addresses only
        void *tension
        void *tangent
        void *energy
        void *local
        void *ctx

    PetscErrorCode LatinLawRegister(const char *, const LatinLawFunctions *, PetscInt *)
    PetscErrorCode LatinLawRegisterTable(const char *, PetscInt, const PetscReal *, const PetscReal *, PetscInt *)
    PetscErrorCode LatinLawGetName(PetscInt, const char **)
    PetscErrorCode LatinLawGetStiffness(PetscInt, PetscReal *)
    PetscErrorCode LatinLawGetTension(PetscInt, PetscReal, PetscReal, PetscReal *)

    PetscErrorCode LatinStructureCreate(MPI_Comm, PetscInt, PetscInt, PetscInt, const PetscReal *, PetscInt, const PetscInt *, LatinStructure *)
    PetscErrorCode LatinStructureSetLaws(LatinStructure, const PetscInt *, const PetscReal *, const PetscReal *)
    PetscErrorCode LatinStructureSetDirections(LatinStructure, const PetscReal *)
    PetscErrorCode LatinStructureSetFriction(LatinStructure, const PetscReal *)
    PetscErrorCode LatinStructureSetSupports(LatinStructure, const PetscBool *, const PetscReal *)
    PetscErrorCode LatinStructureSetPrescribed(LatinStructure, const PetscReal *)
    PetscErrorCode LatinStructureSetLoads(LatinStructure, const PetscReal *)
    PetscErrorCode LatinStructureSetInitialElongations(LatinStructure, const PetscReal *)
    PetscErrorCode LatinStructureSetPrestress(LatinStructure, const PetscReal *)
    PetscErrorCode LatinStructureSetMass(LatinStructure, const PetscReal *)
    ctypedef enum LatinGeometry:
        pass
    PetscErrorCode LatinStructureSetGeometry(LatinStructure, LatinGeometry)
    PetscErrorCode LatinStructureGetGeometry(LatinStructure, LatinGeometry *)
    PetscErrorCode LatinStructureSetUp(LatinStructure)
    PetscErrorCode LatinStructureGetDM(LatinStructure, PetscDM *)
    PetscErrorCode LatinStructureAttachSNES(LatinStructure, PetscSNES)
    PetscErrorCode LatinStructureAttachTS(LatinStructure, PetscTS)
    PetscErrorCode LatinStructureGetSizes(LatinStructure, PetscInt *, PetscInt *, PetscInt *, PetscInt *)
    PetscErrorCode LatinStructureComputeResidual(LatinStructure, PetscVec, PetscVec)
    PetscErrorCode LatinStructureComputeJacobian(LatinStructure, PetscVec, PetscMat)
    PetscErrorCode LatinStructureComputeGeometricStiffness(LatinStructure, PetscVec, const PetscReal *, PetscMat)
    PetscErrorCode LatinStructureComputeEnergy(LatinStructure, PetscVec, PetscReal *)
    PetscErrorCode LatinStructureComputeKineticEnergy(LatinStructure, PetscVec, PetscReal *)
    PetscErrorCode LatinStructureComputeErrors(LatinStructure, PetscVec, PetscVec, PetscReal *, PetscReal *)
    PetscErrorCode LatinStructureGetDisplacements(LatinStructure, PetscVec, PetscReal *)
    PetscErrorCode LatinStructureGetTensions(LatinStructure, PetscVec, PetscReal *)
    PetscErrorCode LatinStructureGetTensionRates(LatinStructure, PetscVec, PetscVec, PetscReal *)
    PetscErrorCode LatinStructureSetDisplacements(LatinStructure, const PetscReal *, PetscVec)
    PetscErrorCode LatinStructureDestroy(LatinStructure *)

    PetscErrorCode SNESLatinGetLatin(PetscSNES, Latin *)
    ctypedef enum LatinStopType:
        pass
    ctypedef enum LatinWarmStart:
        pass
    ctypedef enum LatinNewtonType:
        pass
    PetscErrorCode SNESLatinSetStop(PetscSNES, LatinStopType)
    PetscErrorCode SNESLatinSetTensionError(PetscSNES, PetscReal)
    PetscErrorCode SNESLatinGetTensionEstimate(PetscSNES, PetscReal *)
    PetscErrorCode SNESLatinSetBalance(PetscSNES, PetscReal)
    PetscErrorCode SNESLatinSetLargestUnbalance(PetscSNES, PetscReal)
    PetscErrorCode SNESLatinSetError(PetscSNES, PetscReal)
    PetscErrorCode SNESLatinSetNewton(PetscSNES, LatinNewtonType)
    PetscErrorCode SNESLatinSetReference(PetscSNES, PetscVec)
    PetscErrorCode SNESLatinSetWarmStart(PetscSNES, LatinWarmStart)
    PetscErrorCode SNESLatinSolveCases(PetscSNES, PetscInt, const PetscReal **, const PetscReal **, const PetscReal **, PetscReal **, PetscReal **, PetscInt *)
    PetscErrorCode SNESLatinGetHistory(PetscSNES, PetscInt *, const PetscReal **, const PetscReal **, const PetscReal **)
    PetscErrorCode SNESLatinGetPath(PetscSNES, PetscInt *, PetscReal *)
    PetscErrorCode SNESLatinGetBranch(PetscSNES, PetscBool *)
    PetscErrorCode SNESLatinGetUnsupportedNodes(PetscSNES, PetscInt *, PetscInt *, const PetscInt **, PetscReal *)
    PetscErrorCode SNESLatinGetJammedLinks(PetscSNES, PetscInt *, PetscInt *, const PetscInt **)
    PetscErrorCode SNESLatinGetEstimates(PetscSNES, PetscInt *, const PetscReal **, PetscReal *, PetscReal *)
    PetscErrorCode LatinStateSave(PetscObject, PetscVec, const char *, PetscInt, const char *)
    PetscErrorCode LatinStateLoad(PetscObject, PetscVec, const char *, PetscInt *, char **)
    PetscErrorCode LatinGetEnergyBound(PetscSNES, PetscReal *, PetscReal *)
    PetscErrorCode LatinGetDigits(PetscSNES, PetscReal *, PetscReal *, PetscReal *, PetscReal *)
    PetscErrorCode SNESLatinGetTensions(PetscSNES, PetscReal *)
    PetscErrorCode SNESLatinGetOuter(PetscSNES, PetscSNES *)
    PetscErrorCode KSPLatinGetLatin(PetscKSP, Latin *)
    PetscErrorCode LatinStructureAttachKSP(LatinStructure, PetscKSP)
    PetscErrorCode KSPLatinGetOuter(PetscKSP, PetscKSP *)
    PetscErrorCode TSLatinGetTensions(PetscTS, PetscReal *)
    PetscErrorCode TSLatinGetCause(PetscTS, size_t, char *)
    PetscErrorCode PCLatinGetLatin(PetscPC, Latin *)
    PetscErrorCode LatinStructureAttachPC(LatinStructure, PetscPC)
    PetscErrorCode PCShellSetLatin(PetscPC)

    PetscErrorCode LatinSetPartition(Latin, PetscInt, const PetscInt *)
    PetscErrorCode LatinSetSubdomains(Latin, PetscInt)
    PetscErrorCode LatinSetPartitioner(Latin, int)
    PetscErrorCode LatinSetVariant(Latin, int)
    PetscErrorCode LatinSetModes(Latin, int, PetscReal)
    PetscErrorCode LatinSetDirection(Latin, int, PetscReal)
    PetscErrorCode LatinSetPrecision(Latin, int)
    PetscErrorCode LatinGetLocalKSP(Latin, PetscInt, PetscKSP *)
    PetscErrorCode LatinGetCoarseKSP(Latin, PetscKSP *)
    PetscErrorCode LatinGetCost(Latin, LatinCost *)
    PetscErrorCode LatinGetStatistics(Latin, LatinStatistics *)
    PetscErrorCode LatinGetSubdomains(Latin, PetscInt *, PetscInt *)
    PetscErrorCode LatinGetSubdomainIS(Latin, PetscInt, PetscIS *)
    PetscErrorCode LatinGetSubdomainOfLinks(Latin, PetscInt *)
    PetscErrorCode LatinGetNodeClasses(Latin, PetscInt *)
    PetscErrorCode LatinGetMacroStiffness(Latin, PetscInt, PetscMat *)
