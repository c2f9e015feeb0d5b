"""Dependencies of the package, for scikit-build-core: the petsc4py that the compiled part is built with, and no other.

The compiled part fits one minor version of PETSc. A wheel therefore requires the petsc4py of that version; a source
distribution any that latinpc can be built with.
"""

import os
import re
import subprocess
import sys

__all__ = ["dynamic_metadata", "dynamic_wheel", "requirement"]

ASK = "import petsc4py; print(petsc4py.__version__)"


def requirement():
    """Return the requirement of petsc4py: that of the interpreter that builds, as CMakeLists.txt asks it."""
    # pip's build isolation hides the petsc4py of the caller by PYTHONPATH
    for environment in (os.environ, {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}):
        answer = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, env=environment)
        match = re.match(r"(\d+\.\d+)\.", answer.stdout)
        if answer.returncode == 0 and match:
            return f"petsc4py=={match.group(1)}.*"
    return "petsc4py>=3.18"


def dynamic_metadata(field, settings):
    """Return the dependencies: those of pyproject.toml, and petsc4py."""
    if field != "dependencies":
        raise ValueError(f"only dependencies are dynamic, not {field}")
    return [requirement(), *settings["requirements"]]


def dynamic_wheel(field, settings):
    """Say that the dependencies of a wheel may differ from those of its source distribution."""
    return field == "dependencies"
