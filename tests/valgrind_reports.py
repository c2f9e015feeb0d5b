"""What valgrind has written of our code: `make test VALGRIND=1` gives every process a log of its own.

Python, Open MPI and the libraries that PETSc loads have reports of their own, and who may load them is not known
beforehand. So a report counts when its stack passes through our library, or through a C or Fortran program of a test or
an example; what comes from elsewhere nonetheless is suppressed in valgrind.supp.

Memory that is lost counts in programs that end well only: a function of PETSc's that returns an error leaves what it
has allocated, ours no less, and tests make many such errors.
"""

import re
import sys
from pathlib import Path

PREFIX = re.compile(r"^==\d+== ?", re.MULTILINE)
FRAME = re.compile(r"^   (?:at|by) 0x", re.MULTILINE)
LOST = re.compile(r" lost in loss record ")
OURS = re.compile(r"latinpc/src/|/liblatinpc\.so|/_latin\.\w|: (?:main|MAIN__) \((?!in /usr/)")


def reports(log, start=0, leaks=False):
    """The reports on our code in a log from a byte on, with or without lost memory, and where the next ones begin."""
    with open(log, errors="replace") as file:
        file.seek(start)
        text = file.read()
        end = file.tell()
    blocks = re.split(r"\n(?: *\n)+", PREFIX.sub("", text))
    blocks = [block for block in blocks if FRAME.search(block) and OURS.search(block)]
    return [block for block in blocks if leaks or not LOST.search(block)], end


def reports_in(folder, leaks=False):
    """The reports on our code in all logs of a folder, each with its log."""
    return [f"{log}\n{report}" for log in sorted(Path(folder).glob("*.log")) for report in reports(log, 0, leaks)[0]]


if __name__ == "__main__":
    # programs have folders of their own, whose reports have made their tests fail
    found = reports_in(sys.argv[1])
    print(*found, sep="\n\n")
    programs = len(list(Path(sys.argv[1]).glob("*/")))
    print(f"valgrind: {len(found)} reports on our code by pytest, beside {programs} programs")
    sys.exit(bool(found))
