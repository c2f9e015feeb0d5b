# Part of _latin.pyx: the C library's LatinStructure.

cdef class StructureHandle:
    """Owner of a C ``LatinStructure``."""

    cdef LatinStructure handle

    def __cinit__(self):
        self.handle = NULL

    def __dealloc__(self):
        cdef PetscBool over = 0
        PetscFinalized(&over)
        if self.handle != NULL and not over:
            LatinStructureDestroy(&self.handle)

    def create(self, comm, nodes_global, coordinates, links):
        """Make the structure from this rank's nodes ``(n, dim)`` and links ``(m, 2)``."""
        CHKERR(LatinStructureCreate(GetComm(comm, GetCommDefault()), coordinates.shape[1], coordinates.shape[0],
                                nodes_global, reals(coordinates), links.shape[0], integers(links), &self.handle))

    def set_laws(self, law, stiffness, initial_elongation):
        """Give every link of this rank its law, stiffness and initial_elongation."""
        CHKERR(LatinStructureSetLaws(self.handle, integers(law), reals(stiffness), reals(initial_elongation)))

    def set_directions(self, direction):
        """Give links of this rank a direction of their own, zero where it is that of their nodes."""
        CHKERR(LatinStructureSetDirections(self.handle, reals(direction)))

    def set_friction(self, friction):
        """Give every link of this rank its coefficient of friction."""
        CHKERR(LatinStructureSetFriction(self.handle, reals(friction)))

    def set_supports(self, fixed, prescribed):
        """Clamp degrees of freedom of this rank's nodes; ``fixed`` holds integers of PetscBool's size."""
        CHKERR(LatinStructureSetSupports(self.handle, <const PetscBool *><size_t>fixed.ctypes.data, reals(prescribed)))

    def set_prescribed(self, prescribed):
        """Change the displacements of clamped degrees of freedom of this rank's nodes."""
        CHKERR(LatinStructureSetPrescribed(self.handle, reals(prescribed)))

    def set_loads(self, force):
        """Load this rank's nodes."""
        CHKERR(LatinStructureSetLoads(self.handle, reals(force)))

    def set_initial_elongation(self, initial_elongation):
        """Change the initial_elongation of this rank's links."""
        CHKERR(LatinStructureSetInitialElongations(self.handle, reals(initial_elongation)))

    def set_prestress(self, prestress):
        """Give this rank's links tensions in place of initial elongations."""
        CHKERR(LatinStructureSetPrestress(self.handle, reals(prestress)))

    def set_mass(self, mass):
        """Give this rank's nodes their masses."""
        CHKERR(LatinStructureSetMass(self.handle, reals(mass)))

    def set_geometry(self, int geometry):
        """Choose how displacements turn links."""
        CHKERR(LatinStructureSetGeometry(self.handle, <LatinGeometry>geometry))

    def geometry(self):
        """Return how displacements turn links."""
        cdef LatinGeometry geometry
        CHKERR(LatinStructureGetGeometry(self.handle, &geometry))
        return <int>geometry

    def setup(self):
        """Distribute the structure and number its unknowns."""
        CHKERR(LatinStructureSetUp(self.handle))

    def dm(self):
        """Return the DMPLEX of the structure."""
        cdef PetscDM dm = NULL
        CHKERR(LatinStructureGetDM(self.handle, &dm))
        return keep(PETSc.DMPlex(), dm)

    def attach(self, SNES snes not None):
        """Give a SNES the DM, the residual and the Jacobian of the structure."""
        CHKERR(LatinStructureAttachSNES(self.handle, snes.snes))

    def attach_ts(self, TS ts not None):
        """Give a TS the DM and the motion of the structure."""
        CHKERR(LatinStructureAttachTS(self.handle, ts.ts))

    def set_pc(self, PC pc not None):
        """Give a PC the structure."""
        CHKERR(LatinStructureAttachPC(self.handle, pc.pc))

    def set_ksp(self, KSP ksp not None):
        """Give a KSP and its PC the structure."""
        CHKERR(LatinStructureAttachKSP(self.handle, ksp.ksp))

    def sizes(self):
        """Return dimension, nodes, links and free degrees of freedom of the whole structure."""
        cdef PetscInt dim = 0, nodes = 0, links = 0, free_dofs = 0
        CHKERR(LatinStructureGetSizes(self.handle, &dim, &nodes, &links, &free_dofs))
        return dim, nodes, links, free_dofs

    def residual(self, Vec u not None, Vec r not None):
        """Compute the nodal unbalance."""
        CHKERR(LatinStructureComputeResidual(self.handle, u.vec, r.vec))

    def jacobian(self, Vec u not None, Mat J not None):
        """Compute the tangent stiffness."""
        CHKERR(LatinStructureComputeJacobian(self.handle, u.vec, J.mat))

    def geometric_stiffness(self, Vec u not None, tension, Mat G not None):
        """Compute the geometric stiffness of tensions of this rank's links."""
        CHKERR(LatinStructureComputeGeometricStiffness(self.handle, u.vec, reals(tension), G.mat))

    def energy(self, Vec u not None):
        """Compute the potential energy."""
        cdef PetscReal energy = 0
        CHKERR(LatinStructureComputeEnergy(self.handle, u.vec, &energy))
        return energy

    def kinetic_energy(self, Vec v not None):
        """Compute the kinetic energy."""
        cdef PetscReal energy = 0
        CHKERR(LatinStructureComputeKineticEnergy(self.handle, v.vec, &energy))
        return energy

    def errors(self, Vec u not None, Vec reference not None):
        """Compute the relative l2 and energy errors."""
        cdef PetscReal l2 = 0, energy = 0
        CHKERR(LatinStructureComputeErrors(self.handle, u.vec, reference.vec, &l2, &energy))
        return l2, energy

    def displacements(self, Vec u not None, out):
        """Write the displacements of this rank's nodes into ``out``."""
        CHKERR(LatinStructureGetDisplacements(self.handle, u.vec, <PetscReal *>reals(out)))

    def tensions(self, Vec u not None, out):
        """Write the tensions of this rank's links into ``out``."""
        CHKERR(LatinStructureGetTensions(self.handle, u.vec, <PetscReal *>reals(out)))

    def tension_rates(self, Vec u not None, Vec v not None, out):
        """Write the derivative of the tensions of this rank's links along ``v`` into ``out``."""
        CHKERR(LatinStructureGetTensionRates(self.handle, u.vec, v.vec, <PetscReal *>reals(out)))

    def set_displacements(self, displacement, Vec u not None):
        """Write the displacements of this rank's nodes into the free unknowns of ``u``."""
        CHKERR(LatinStructureSetDisplacements(self.handle, reals(displacement), u.vec))
