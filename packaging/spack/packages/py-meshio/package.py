"""The builtin package ends at 5.0.1, which is older than numpy 2."""

from spack.package import *


class PyMeshio(PythonPackage):
    """Python library to read and write many mesh formats."""

    homepage = "https://github.com/nschloe/meshio"
    pypi = "meshio/meshio-5.3.5.tar.gz"

    license("MIT")

    version("5.3.5", sha256="f21f01abd9f29ba06ea119304b3d39e610421cfe93b9dd23362834919f87586d")

    depends_on("python@3.8:", type=("build", "run"))
    depends_on("py-setuptools@42:", type="build")
    depends_on("py-numpy@1.20:", type=("build", "run"))
    depends_on("py-rich", type=("build", "run"))
