"""The Python package with its own copy of the C library, from the clone that this file is in.

spack repo add packaging/spack
spack install py-latinpc           # what is committed on the branch main of the clone
spack dev-build py-latinpc@0.1.0   # the files as they are
"""

import os

from spack.package import *


class PyLatinpc(PythonPackage):
    """Multiscale LATIN domain decomposition for structures of links, as PETSc solver types."""

    git = f"file://{os.path.realpath(__file__).rsplit(os.sep, 5)[0]}"

    license("BSD-2-Clause")

    version("0.1.0", branch="main")

    depends_on("c", type="build")
    depends_on("python@3.11:", type=("build", "run"))
    depends_on("py-scikit-build-core@0.10:", type="build")
    depends_on("py-cython@0.29.32:", type="build")
    depends_on("cmake@3.20:", type="build")
    depends_on("ninja", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("mpi")
    depends_on("metis@5:")
    depends_on("petsc@3.18:3.26+mpi+metis~complex")
    depends_on("py-petsc4py@3.18:3.26", type=("build", "run"))
    depends_on("py-mpi4py@3.1:", type=("build", "run"))
    depends_on("py-numpy@1.24:", type=("build", "run"))
    depends_on("py-click@8.1:", type="run")
    depends_on("py-rich@13.7:", type="run")
    depends_on("py-meshio@5.3.5:", type="run")
    depends_on("py-matplotlib@3.8:", type="run")
