"""What PETSc reports of an error, as the sentence that says what is wrong and how to mend it."""

import re

from petsc4py import PETSc

#: Codes of PETSc's, PETSC_ERR_ARG_WRONG and so on, which have no names in petsc4py
ARG_WRONG, ARG_OUTOFRANGE, ARG_WRONGSTATE, ARG_INCOMP, MAT_CH_ZRPVT = 62, 63, 73, 75, 81


class LatinError(PETSc.Error):
    """An error that the library reports: its text is the sentence, ``trace`` is PETSc's list of C functions."""

    def __init__(self, ierr: int, said: str = "", trace: str = "") -> None:
        super().__init__(ierr)
        self.said, self.trace = said, trace

    def __str__(self) -> str:
        return self.said

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.ierr}, {self.said!r})"


def of_library(error: PETSc.Error) -> LatinError:
    """Return an error of petsc4py's with the sentence for its text; not collective.

    That of petsc4py has it at the end of a list of C functions, and changes it with PETSc's next error.
    """
    return LatinError(error.ierr, error_message(error), str(error))


def raise_cause(error: BaseException) -> None:
    """Raise what Ctrl-C or a callback has raised: later versions of petsc4py raise an error of PETSc's from it."""
    if isinstance(error, PETSc.Error) and error.__cause__ is not None:
        raise error.__cause__


def error_message(error: BaseException) -> str:
    """Return the sentence of an error that PETSc reports, without its list of C functions; not collective.

    Parameters
    ----------
    error : Exception
        A ``petsc4py.PETSc.Error``, or any other exception, whose text is returned as it is.

    Returns
    -------
    str

    Raises
    ------
    BaseException
        That of `raise_cause`.
    """
    raise_cause(error)
    if isinstance(error, PETSc.Error):
        for line in reversed(str(error).splitlines()[1:]):
            said = re.sub(r"^\[ *\d+\] ", "", line)
            if not re.search(r"\w\(\) (at|line) ", said):
                return _option_of(said.strip())
    return str(error)


def _option_of(said: str) -> str:
    """Return what PETSc says of a value that is no number, with the option that has it."""
    refused = re.match(r"Input string (\S+) has no (numeric|integer) value", said)
    named = [name for name, value in PETSc.Options().getAll().items() if refused and value == refused[1]]
    if not named:
        return said
    kind = "an integer" if refused[2] == "integer" else "a number"
    return f"-{' or -'.join(named)} is {kind}, not {refused[1]}"
