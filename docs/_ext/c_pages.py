"""Manual pages of public C functions and of solver types, from the comments above them in the sources, as Markdown."""

import re
from pathlib import Path

C = Path(__file__).parents[2] / "latinpc"
PAGE = re.compile(r"/\*@C?\n  (\w+) - (.*?)@\*/\nPetscErrorCode (\w+)\((.*?)\)$", re.DOTALL | re.MULTILINE)
TYPE = re.compile(r"/\*MC\n  (\w+) - (.*?)M\*/", re.DOTALL)
SYNOPSIS = re.compile(r"  Synopsis:\n  PetscErrorCode \w+\((.*)\)\n\n")
EXTERN = re.compile(r"^PETSC_EXTERN PetscErrorCode (\w+)\(", re.MULTILINE)
ITEM = re.compile(r"^[+.-] (.*?) +- (.*)$")
TITLE = re.compile(r"^(Input|Output|Input/Output) Parameters?:$|^Options Database Keys?:$|^Notes?:$|^Level: \w+$")


def public_functions():
    """Return the public functions in the order of the header.

    Returns
    -------
    dict
        Name of the page -> arguments and text; None for a function without a page. A page with a synopsis is that of a
        macro, which calls the function below it.
    """
    pages = {}
    for path in sorted((C / "src").glob("**/*.c")):
        for name, text, function, arguments in PAGE.findall(path.read_text()):
            macro = SYNOPSIS.search(text)
            arguments = macro[1] if macro else " ".join(arguments.split())
            pages[function] = (name, (arguments, SYNOPSIS.sub("", text)))
    header = (C / "include" / "latinpc.h").read_text()
    return dict(pages.get(name, (name, None)) for name in EXTERN.findall(header))


def solver_types():
    """Return the manual pages of solver types: name -> no arguments, and text."""
    texts = [path.read_text() for path in sorted((C / "src").glob("**/*.c"))]
    return {name: (None, text) for source in texts for name, text in TYPE.findall(source)}


def markdown(name, arguments, text, known):
    """Return a manual page as Markdown."""

    def linked(line):
        return re.sub(r"`(\w+)\(\)`", lambda m: f"{{c:func}}`{m[1]}`" if m[1] in known else m[0], line)

    head = f"{{c:macro}} {name}" if arguments is None else f"{{c:function}} PetscErrorCode {name}({arguments})"
    lines, seealso = [f"````{head}", ""], ""
    for line in text.split("\n"):
        line = re.sub(r"(?<=\w)(\*)(?=\s|$)", r"\\*", line.removeprefix("  ").rstrip())
        item = ITEM.match(line)
        if line.startswith("Level:"):
            continue
        if line.startswith(".seealso:"):
            seealso = linked(line.removeprefix(".seealso:").strip())
        elif TITLE.match(line):
            lines += ["", f"**{line.removesuffix(':')}**", ""]
        elif item:
            lines.append(f"- `{item[1]}`: {linked(item[2])}")
        elif line.startswith("         ") and lines[-1].startswith("- "):
            lines[-1] += " " + linked(line.strip())
        else:
            lines.append(linked(line.strip()))
    if seealso:
        lines += ["", f"See also {seealso}"]
    return "\n".join([*lines, "````", ""])
