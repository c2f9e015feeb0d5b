"""Load the compiled part, check that its PETSc is that of petsc4py, and initialise it."""

from petsc4py import PETSc

try:
    from latinpc import _latin
except ImportError as error:
    raise ImportError(
        f"the compiled part of latinpc cannot be loaded ({error}). In a source tree run `make build`; elsewhere "
        "run `pip install .` with the petsc4py that is to be used."
    ) from error

__all__ = ["_latin"]


def _check_petsc():
    """Refuse a PETSc that is not the one that latinpc was built with."""
    built, found = _latin.PETSC_VERSION, PETSc.Sys.getVersion()
    cure = "build latinpc again with this petsc4py (`make build`, or `pip install --force-reinstall .`)"
    if built[:2] != tuple(found[:2]):
        text = [".".join(map(str, version)) for version in (built, found)]
        raise ImportError(f"latinpc was built with PETSc {text[0]}, petsc4py brings PETSc {text[1]}: {cure}")
    if not _latin.initialized():
        raise ImportError(f"latinpc is linked with another PETSc library than petsc4py: {cure}")


_check_petsc()
_latin.initialize_package()
if PETSc.COMM_WORLD.size == 1:
    _latin.interruptible()
