"""The C library, for C and Fortran. Nothing is published: build a clone of the sources.

spack repo add packaging/spack
spack dev-build latinpc@0.1.0
"""

from spack.package import *


class Latinpc(CMakePackage):
    """Multiscale LATIN domain decomposition for structures of links, as PETSc solver types: the C library."""

    license("BSD-2-Clause")

    version("0.1.0")

    depends_on("c", type="build")
    depends_on("cmake@3.20:", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("mpi")
    depends_on("metis@5:")
    depends_on("petsc@3.18:3.26+mpi+metis~complex")

    root_cmakelists_dir = "latinpc"

    def cmake_args(self):
        """Build without Python, against the PETSc of the specification."""
        return [
            self.define("LATINPC_PYTHON", False),
            self.define("PETSC_DIR", self.spec["petsc"].prefix),
            self.define("PETSC_ARCH", ""),
            self.define("MPI_C_COMPILER", self.spec["mpi"].mpicc),
        ]
