"""What valgrind has written of our code: `make test VALGRIND=1` gives every process a log of its own.

Python, Open MPI and the libraries that PETSc loads have reports of their own, and who may load them is not known
beforehand. So a report counts when its stack passes through our library, or through a C or Fortran program of a test or
an example; what comes from elsewhere nonetheless is suppressed in valgrind.supp.
"""

import re
import sys
from pathlib import Path

PREFIX = re.compile(r"^==\d+== ?", re.MULTILINE)
FRAME = re.compile(r"^   (?:at|by) 0x", re.MULTILINE)
OURS = re.compile(r"latinpc/src/|/liblatinpc\.so|/_latin\.\w|: (?:main|MAIN__) \((?!in /usr/)")


def reports(log, start=0):
    """The reports on our code in a log from a byte on, and where the next ones begin."""
    with open(log, errors="replace") as file:
        file.seek(start)
        text = file.read()
        end = file.tell()
    blocks = re.split(r"\n(?: *\n)+", PREFIX.sub("", text))
    return [block for block in blocks if FRAME.search(block) and OURS.search(block)], end


def reports_below(folder):
    """The reports on our code in all logs of a folder, each with its log."""
    return [f"{log}\n{report}" for log in sorted(Path(folder).rglob("*.log")) for report in reports(log)[0]]


if __name__ == "__main__":
    found = reports_below(sys.argv[1])
    print(*found, sep="\n\n")
    print(f"valgrind: {len(found)} reports on our code by {len(list(Path(sys.argv[1]).rglob('*.log')))} processes")
    sys.exit(bool(found))
