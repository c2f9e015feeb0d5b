"""The C library, for C and Fortran, from the clone that this file is in: nothing is published.

spack repo add packaging/spack
spack install latinpc           # what is committed on the branch main of the clone
spack dev-build latinpc@0.1.0   # the files as they are
"""

import os

from spack.package import *


class Latinpc(CMakePackage):
    """C library: multiscale LATIN domain decomposition for structures of links."""

    git = f"file://{os.path.realpath(__file__).rsplit(os.sep, 5)[0]}"

    license("BSD-2-Clause")

    version("0.1.0", branch="main")

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
