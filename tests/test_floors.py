"""The check of the order of folders (.ci/floors.py) finds each fault that it is there for."""

import sys

import pytest
from conftest import ROOT, run

SOUND = {
    "latinpc/src/base/base.h": "int Low(int);\n#define Twice(x) (Low(x) + Low(x))\n",
    "latinpc/src/base/low.c": '#include "base/base.h"\nint Low(int x)\n{\n  return x;\n}\n',
    "latinpc/src/core/latin.h": '#include "base/base.h"\nint High(int);\n',
    "latinpc/src/core/high.c": '#include "core/latin.h"\nint High(int x)\n{\n  return Twice(x);\n}\n',
    "latinpc/src/core/other.c": '#include "latin.h"\nint Other(int x)\n{\n  return High(x); /* Low */\n}\n',
    "latinpc/__init__.py": "from latinpc.laws import A\n",
    "latinpc/laws.py": "A = 1\nif TYPE_CHECKING:\n    from latinpc.runs.solve import B\n",
    "latinpc/runs/__init__.py": "",
    "latinpc/bench/__init__.py": "import latinpc\n",
    "latinpc/runs/solve.py": "from latinpc import laws\nfrom .report import B\n",
    "latinpc/runs/report.py": "from ..laws import A\n\nB = A\n",
}
LONG_C = "int Long(void)\n{\n" + "  Low(1);\n" * 58 + "}\n"
LONG_PYTHON = "def long():\n" + '    """Say\n    nothing."""\n' + "    pass\n" * 60

FAULTS = {
    "include upwards": ("base/low.c", '#include "core/latin.h"\n', "includes core/latin.h, and core lies above base"),
    "call upwards": ("base/low.c", "int Bad(void)\n{\n  return High(1);\n}\n", "low.c:8: calls High, and core"),
    "call upwards in a macro": ("base/base.h", "#define Bad(x) \\\n  High(x)\n", "calls High, and core lies above"),
    "call upwards in an inline function": (
        "base/base.h",
        "static inline int Bad(void)\n{\n  return High(1);\n}\n",
        "calls High, and core lies above base",
    ),
    "address of a function above": ("base/low.c", "int (*f)(int) = High;\n", "calls High, and core lies above base"),
    "call beside": ("ksp/a.c", "int K(void)\n{\n  return P();\n}\n", "calls P, and error lies beside ksp"),
    "circle of files": (
        "core/high.c",
        "int Back(void)\n{\n  return Other(1);\n}\n",
        "core: circle among core/high.c, ",
    ),
    "circle by a macro": (
        "core/latin.h",
        "#define Round(x) Other(x)\n",
        "core: circle among core/high.c, ",
    ),
    "members below core": ("base/low.c", "int Bad(Latin it)\n{\n  return it->n;\n}\n", "reads it->n below core"),
    "long function": ("base/low.c", LONG_C, "Long has 61 lines, more than 60"),
    "long file": ("base/low.c", "\n" * 500, "low.c: 505 lines, more than 500"),
    "unknown folder": ("attic/a.c", "int x;\n", "attic has no place in the list of floors"),
    "import upwards": ("laws.py", "from latinpc.runs import solve\n", "imports latinpc.runs.solve"),
    "import upwards in a function": ("laws.py", "def f():\n    import latinpc\n", "imports latinpc"),
    "relative import upwards": ("laws.py", "from .runs.report import B\n", "imports latinpc.runs.report"),
    "circle of modules": ("runs/report.py", "def f():\n    from . import solve\n", "runs: circle among"),
    "long function in Python": ("runs/report.py", LONG_PYTHON, "long has 61 lines, more than 60"),
    "long file in Cython": ("_glue.pyx", "\n" * 501, "_glue.pyx: 501 lines, more than 500"),
    "long file of tests": ("../tests/test_a.py", "\n" * 501, "test_a.py: 501 lines, more than 500"),
    "long file in Python": ("runs/report.py", "\n" * 500, "report.py: 503 lines, more than 500"),
}


def checker(folder):
    """Write sound sources; return what runs the check on them."""
    for name, text in SOUND.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return lambda *words: run([sys.executable, ROOT / ".ci" / "floors.py", "--root", folder, *words], check=False)


def test_sound_sources_pass(tmp_path):
    floors = checker(tmp_path)
    result = floors()
    assert result.returncode == 0 and not result.stdout
    text = floors("--report").stdout
    assert "c: 5 files, 19 lines, 0 violations, 2 floors (base < core)" in text
    assert "python: 6 files, 10 lines, 0 violations, 2 floors (laws < bench)" in text


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found(fault, tmp_path):
    floors = checker(tmp_path)
    name, text, sentence = FAULTS[fault]
    part = "python" if name.endswith((".py", ".pyx")) else "c"
    path = tmp_path / "latinpc" / (name if part == "python" else f"src/{name}")
    path.parent.mkdir(exist_ok=True)
    with path.open("a") as file:
        file.write(text)
    if fault == "call beside":
        (tmp_path / "latinpc/src/error").mkdir()
        (tmp_path / "latinpc/src/error/a.c").write_text("int P(void)\n{\n  return 0;\n}\n")
    if fault == "circle by a macro":
        with (tmp_path / "latinpc/src/core/high.c").open("a") as file:
            file.write("int Back(void)\n{\n  return Round(1);\n}\n")
    result = floors(part)
    assert result.returncode == 1 and sentence in result.stdout, result.stdout
    assert floors("python" if part == "c" else "c").returncode == 0
    report = floors("--report", part)
    assert report.returncode == 0 and sentence in report.stdout
