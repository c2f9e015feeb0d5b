"""Write the Fortran module from latinpc.h, as the build does: python packaging/fortran_module.py latinpc.F90.

A subroutine for each function, in PETSc's manner: the same arguments, then the error code. Those that need more than
C's arguments in turn, such as texts, are in latinpc.F90.in.
"""

import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
HEADER = HERE.parent / "latinpc" / "include" / "latinpc.h"
OBJECTS = ("SNES", "KSP", "TS", "PC", "DM", "IS", "Mat", "Vec")  # of PETSc: their component v is C's pointer
OURS = ("LatinStructure", "Latin")
NUMBERS = ("PetscInt", "PetscReal", "PetscBool")
# input arrays that C takes as NULL
OPTIONAL = {
    ("LatinStructureSetLaws", "e0"),
    ("LatinStructureSetSupports", "prescribed"),
    ("LatinStructureSetPrescribed", "prescribed"),
    ("LatinStructureSetInitialElongations", "e0"),
    ("LatinSetPartition", "subdomain"),
}
UNNAMED = {"Latin": "method", "PetscInt": "n"}  # names of arguments, where their type does not say it
OUTER = ("SNESLatinGetOuter", "KSPLatinGetOuter")
FUNCTION = re.compile(r"^PETSC_EXTERN PetscErrorCode (\w+)\((.*)\);", re.MULTILINE)
ARGUMENT = re.compile(r"(const )?(\w+) ?(\*?)(?:const )?(\w*)(\[\])?$")
ENUMERATION = re.compile(r"typedef enum \{([^{}]*)\} (\w+);")
STRUCTURE = re.compile(r"typedef struct \{([^{}]*)\} (LatinStatistics|LatinCost);")
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def enumerators(text):
    """Return the values of all enumerations as parameters."""
    lines = []
    for body, name in ENUMERATION.findall(text):
        names = [word.strip() for word in COMMENT.sub("", body).split(",")]
        lines += [f"  ! {name}", f"  integer, parameter :: {names[0]} = 0, &"]
        lines += [f"    {word} = {k}, &" for k, word in enumerate(names[1:], 1)]
        lines[-1] = lines[-1].removesuffix(", &")
    return lines


def types(text):
    """Return the structures that functions fill."""
    lines = []
    for body, name in STRUCTURE.findall(text):
        lines += [f"  type, bind(C) :: {name}"]
        for member in COMMENT.sub("", body).split(";")[:-1]:
            kind, names = member.strip().removeprefix("const ").split(maxsplit=1)
            lines += [
                f"    type(c_ptr) :: {names[1:]}" if kind == "char" else f"    {kind} :: {' '.join(names.split())}"
            ]
        lines += ["  end type", ""]
    return lines[:-1]


class Argument:
    """An argument of C: its declarations in the subroutine and in the interface of C, and how it is passed on."""

    def __init__(self, function, text, enumerations):
        const, kind, pointer, name, array = ARGUMENT.match(text.strip()).groups()
        name = name or UNNAMED.get(kind, kind.removeprefix("Latin").removesuffix("Type").lower())
        name = "outer" if pointer and function in OUTER else name
        self.name, self.passed, self.before = name, name, []
        if kind == "char":
            self.ours, self.theirs = f"character(len=*), intent(in) :: {name}", f"character(kind=c_char) :: {name}(*)"
            self.passed = f"trim({name})//c_null_char"
        elif const and pointer and array:  # an array of the library, as long as the count before it
            self.ours, self.theirs = f"{kind}, pointer, intent(out) :: {name}(:)", f"type(c_ptr) :: {name}"
            self.passed, self.before = f"p_{name}", [f"type(c_ptr) :: p_{name}"]
        elif array:
            omitted = ", optional" if (function, name) in OPTIONAL else ""
            self.ours = f"{kind}, intent({'in' if const else 'out'}){omitted} :: {name}(*)"
            self.theirs = f"{kind}{omitted} :: {name}(*)"
        elif kind in OBJECTS + OURS:
            intent = "in" if not pointer else "inout" if function.endswith("Destroy") else "out"
            self.ours = f"{f'type({kind})' if kind in OURS else kind}, intent({intent}) :: {name}"
            address = "type(c_ptr)" if kind in OURS else "PetscFortranAddr"
            self.theirs, self.passed = f"{address}{'' if pointer else ', value'} :: {name}", f"{name}%v"
        elif kind in NUMBERS and not pointer:
            self.ours, self.theirs = f"{kind}, intent(in) :: {name}", f"{kind}, value :: {name}"
        elif kind in NUMBERS:
            self.ours, self.theirs = f"{kind}, intent(out) :: {name}", f"{kind} :: {name}"
        elif kind in enumerations:
            self.ours = f"integer, intent({'out' if pointer else 'in'}) :: {name}"
            self.theirs = f"integer(c_int){'' if pointer else ', value'} :: {name}"
        elif pointer:  # a structure
            self.ours, self.theirs = f"type({kind}), intent(out) :: {name}", f"type({kind}) :: {name}"
        else:
            raise ValueError(f"{function}: no counterpart in Fortran of {text.strip()}: write it in latinpc.F90.in")


def subroutine(function, arguments, enumerations):
    """Return the lines of a subroutine that calls the function of C."""
    found = [] if arguments == "void" else [Argument(function, text, enumerations) for text in arguments.split(",")]
    names, count, after = ", ".join(argument.name for argument in found), None, []
    for argument in found:
        if argument.passed.startswith("p_"):
            after += [f"    call c_f_pointer({argument.passed}, {argument.name}, [{count}])"]
        elif argument.ours.startswith("PetscInt, intent(out)"):
            count = argument.name
    return [
        f"  subroutine {function}({names}{', ' if names else ''}ierr)",
        *(f"    {argument.ours}" for argument in found),
        "    PetscErrorCode, intent(out) :: ierr",
        *(f"    {line}" for argument in found for line in argument.before),
        "    interface",
        f'      function c({names}) bind(C, name="{function}") result(ierr)',
        "        import",
        *(f"        {argument.theirs}" for argument in found),
        "        integer(c_int) :: ierr",
        "      end function",
        "    end interface",
        "",
        f"    ierr = c({', '.join(argument.passed for argument in found)})",
        *after,
        "  end subroutine",
        "",
    ]


def module():
    """Return the text of the module."""
    text, frame = HEADER.read_text(), (HERE / "latinpc.F90.in").read_text()
    enumerations = {name for _, name in ENUMERATION.findall(text)}
    written = set(re.findall(r"subroutine (\w+)\(|interface (\w+)|(LatinGetStatistics)", frame))
    written = {name for names in written for name in names} | {"LatinGetStatisticsOfSize"}
    lines = []
    for function, arguments in FUNCTION.findall(text):
        lines += subroutine(function, arguments, enumerations) if function not in written else []
    for mark, block in (("ENUMERATORS", enumerators(text)), ("TYPES", types(text)), ("SUBROUTINES", lines[:-1])):
        frame = frame.replace(f"  !{mark}", "\n".join(block))
    return frame


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(module())
