"""Each tuning constant of the C code at a quarter to four times its value: what it costs, and why it is what it is.

    python benchmarks/constants.py                  all, half an hour: results/constants.json and constants.md
    python benchmarks/constants.py LATIN_JUMP ...   some of them
    python benchmarks/constants.py --page           the page alone, from what has been measured

The repository is copied to a temporary folder and built there. Each value is put into the source, the library is built,
the scenes of the constant are run in a fresh process, and the value is put back. Values and counts are in
constants_table.py, those of the second table in constants_others.py and the files that it takes in, the scenes in
constant_scenes.py.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from queue import SimpleQueue

sys.path.insert(0, str(Path(__file__).resolve().parent))

from constants_others import OTHERS
from constants_table import TUNING

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
RESULT, PAGE = HERE / "results" / "constants.json", HERE / "constants.md"
FACTORS = (0.25, 0.5, 2.0, 4.0)
LEFT_OUT = (".git", ".venv*", "build", "demo", "figures", "__pycache__", "*.so", ".pytest_cache")
NONE = "–"
#: A definition: what precedes the value; the value, of double precision where there are two; the rest.
VALUE = r"(#\s*define {name}\s+(?:LatinByPrecision\()?)(\((?:[^()]|\([^()]*\))*\)|[^\s,()]+)"


# ---- the sources ---------------------------------------------------------------------------------
@cache
def sources(folder):
    """Return the files below latinpc/src, and their texts."""
    return {file.relative_to(folder): file.read_text() for file in sorted(folder.rglob("*.[ch]"))}


def definition(source, name):
    """Return the file of a constant below latinpc/src, and its value as it is written."""
    for file, text in sources(source).items():
        match = name in text and re.search(VALUE.format(name=name), text)
        if match:
            return file, match[2]
    raise SystemExit(f"{name} is not defined below {source}")


def number(value, text):
    """Write a value as a whole number where the constant is one."""
    return str(max(1, round(value))) if re.fullmatch(r"\d+", text) else f"{value:g}" if value % 1 else f"{value:.1f}"


def values(name, text):
    """Return the four other values of a constant, as they are written."""
    given = TUNING[name].values or [factor * float(text) for factor in FACTORS]
    return [number(value, text) for value in given]


class Copy:
    """A copy of the repository with a build of its own."""

    def __init__(self, folder):
        self.root = Path(folder) / "latinpc"
        self.references = Path(folder).parent / "references"
        self.references.mkdir(exist_ok=True)
        shutil.copytree(ROOT, self.root, ignore=shutil.ignore_patterns(*LEFT_OUT))
        self.source, self.build = self.root / "latinpc" / "src", self.root / "build"
        configure = ["cmake", "-S", self.root / "latinpc", "-B", self.build, "-G", "Ninja", "-DLATINPC_INPLACE=ON"]
        self.run([*configure, f"-DPython_EXECUTABLE={sys.executable}"], check=True)
        self.run(["cmake", "--build", self.build], check=True)

    def run(self, command, **more):
        """Run a command in the copy, whose modules come first."""
        environment = {**os.environ, "PYTHONPATH": str(self.root), "OMP_NUM_THREADS": "1"}
        return subprocess.run(command, cwd=self.root, env=environment, capture_output=True, text=True, **more)

    def count(self, scenes):
        """Return what is counted on each scene; a crash ends its process, and a new one goes on behind the scene."""
        found, left = {}, list(scenes)
        program = self.root / "benchmarks" / "constant_scenes.py"
        while left:
            command = [sys.executable, program, self.references, *left]
            try:
                lines = self.run(command, timeout=60 + 20 * len(left)).stdout
            except subprocess.TimeoutExpired as error:
                lines = (error.stdout or b"").decode()
            told = dict(json.loads(line) for line in lines.splitlines() if line.startswith("["))
            found |= told
            left = left[len(told) :]
            if left:
                found[left.pop(0)] = NONE
        return found

    def change(self, name, value, scenes):
        """Count with another value of a constant."""
        file = self.source / definition(self.source, name)[0]
        before = file.read_text()
        after = re.sub(VALUE.format(name=name), lambda match: match[1] + value, before, count=1)
        try:
            file.write_text(after)
            built = self.run(["cmake", "--build", self.build]).returncode == 0
            return self.count(scenes) if built else dict.fromkeys(scenes, NONE)
        finally:
            file.write_text(before)


def measure(names, copies, keep):
    """Count for each constant and value; `keep` is called with what is found."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "references").mkdir()
        free = SimpleQueue()
        for k in range(copies):
            free.put(Copy(Path(folder) / str(k)))
        first = free.get()
        base = first.count(sorted({scene for name in names for scene in TUNING[name].scenes}))
        free.put(first)

        def one(name):
            text = definition(ROOT / "latinpc" / "src", name)[1]
            counts = {text: {scene: base[scene] for scene in TUNING[name].scenes}}
            copy = free.get()
            try:
                for value in values(name, text):
                    if value not in counts:
                        counts[value] = copy.change(name, value, TUNING[name].scenes)
            finally:
                free.put(copy)
            keep(name, {"value": text, "counts": counts})

        with ThreadPoolExecutor(copies) as pool:
            list(pool.map(one, names))


# ---- the page ------------------------------------------------------------------------------------
def tuning_table(found):
    """Return the lines of the table of the tuning constants; scenes on which nothing changes are not shown."""
    lines = [
        "| constant | decides | counted on | 1/4 | 1/2 | as it is | 2 | 4 | so |",
        "| " + " | ".join(["---"] * 9) + " |",
    ]
    for name, about in TUNING.items():
        file, text = definition(ROOT / "latinpc" / "src", name)
        result = found.get(name)
        counts = result["counts"] if result else {}
        scenes = [s for s in about.scenes if len({each.get(s) for each in counts.values()}) > 1]
        same = [s for s in about.scenes if counts and s not in scenes]
        cells = []
        order = [*values(name, text)[:2], text, *values(name, text)[2:]]
        for value in order:
            shown = "<br>".join(counts.get(value, {}).get(s, "") for s in scenes)
            cells.append((f"*{value}*<br>" if about.values and value != text else "") + shown)
        on = "<br>".join(scenes) + (("<br>" if scenes else "") + f"unchanged: {'; '.join(same)}" if same else "")
        label = f"`{name}` {text} {about.unit}<br>`{file}`"
        lines.append(f"| {label} | {about.decides} | {on} | " + " | ".join(cells) + f" | {about.so} |")
    return lines


def others_table():
    """Return the lines of the table of the other constants."""
    lines = ["| constant | value | unit | why |", "| --- | --- | --- | --- |"]
    for name, (unit, why) in OTHERS.items():
        file, text = definition(ROOT / "latinpc" / "src", name)
        lines.append(f"| `{name}`<br>`{file}` | {text} | {unit} | {why} |")
    return lines


def unlisted():
    """Return the constants of the C code that neither table has; macros that are code are none."""
    names = set()
    for text in sources(ROOT / "latinpc" / "src").values():
        names |= set(re.findall(r"#\s*define (LATIN_[A-Z_]+)[ \t]+(?=[\d.(]|LatinByPrecision|PETSC_MAX)", text))
    return sorted(names - set(TUNING) - set(OTHERS))


def write(found):
    """Fill in the page."""
    page = PAGE.read_text()
    for table, lines in (("tuning", tuning_table(found)), ("others", others_table())):
        pattern = re.compile(rf"(<!-- {table} -->\n).*?(<!-- end -->)", re.DOTALL)
        page = pattern.sub(lambda match, lines=lines: match[1] + "\n".join(lines) + "\n" + match[2], page)
    PAGE.write_text(page)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="constants; all by default")
    parser.add_argument("--page", action="store_true", help="write the page from what has been measured")
    parser.add_argument("--missing", action="store_true", help="leave out the constants that have a result")
    parser.add_argument("--copies", type=int, default=2, help="copies that build and run side by side")
    given = parser.parse_args()
    found = json.loads(RESULT.read_text()) if RESULT.exists() else {}

    def keep(name, result):
        found[name] = result
        print(name, *result["counts"].items(), sep="\n  ", flush=True)
        RESULT.write_text(json.dumps(found, indent=1, sort_keys=True, ensure_ascii=False) + "\n")

    names = [name for name in given.names or TUNING if not (given.missing and name in found)]
    if names and not given.page:
        measure(names, given.copies, keep)
    write(found)
    if unlisted():
        print("In neither table:", *unlisted())


if __name__ == "__main__":
    main()
