#!/usr/bin/env python3
"""Check the order of the sources: a folder includes, calls and imports only what lies below it.

    floors.py [c] [python]           fail on the violations (default: both)
    floors.py --report [c] [python]  print the violations and the sizes, exit 0

C: a file includes headers of its own folder and of folders below. A function of another file is called only from the
same folder or from above. Files of one folder do not call each other in a circle. Nothing below `core` reads the
members of `struct _p_Latin`. Python: the same with imports, wherever they stand in a module, but for those of type
hints (`if TYPE_CHECKING:`). Both: no file is longer than 500 lines, no function longer than 60 (the docstring of a
Python function is not counted); of Cython and of tests, the lengths of files alone.
"""

import argparse
import ast
import itertools
import re
import sys
from pathlib import Path

# Lowest first; folders of one line do not depend on each other
C_FLOORS = [
    ["base"],
    ["structure"],
    ["partition", "subdomains"],
    ["localsolvers"],
    ["interfaces", "cases"],
    ["coarse"],
    ["stages"],
    ["core"],
    ["pc"],
    ["ksp", "error"],
    ["snes"],
    ["ts", "state"],
    ["register.c"],
]
PYTHON_FLOORS = [
    ["errors"],
    ["laws", "_latin", "numbering"],
    ["arrays", "blas", "library", "geometry", "options"],
    ["checks", "userlaws", "actions", "equations", "accuracy", "solvers", "settings"],
    ["results"],
    ["structure"],
    ["scenes"],
    ["distributed"],
    ["files"],
    ["forms"],
    ["runs"],
    ["__init__"],
    ["bench"],
    ["cli"],
    ["__main__"],
]
FILE_LINES, FUNCTION_LINES = 500, 60

WORD = re.compile(r"[A-Za-z_]\w*")


class Floors:
    """The order of folders, and what violates it.

    Parameters
    ----------
    levels : list of list of str
        Folders, lowest first.
    """

    def __init__(self, levels):
        self.level = {name: i for i, names in enumerate(levels) for name in names}
        self.faults, self.edges, self.inside = [], {}, {}
        self.lines = self.files = 0

    def use(self, source, target, where, what):
        """Record that one file uses another; each of both is a pair (folder, file)."""
        (a, user), (b, used) = source, target
        if a == b:
            if user != used:
                self.inside.setdefault(a, {}).setdefault(user, {}).setdefault(used, what)
            return
        self.edges.setdefault(a, set()).add(b)
        if a not in self.level or b not in self.level:
            return
        if self.level[b] >= self.level[a]:
            relation = "beside" if self.level[a] == self.level[b] else "above"
            self.faults.append(f"{where}: {what}, and {b} lies {relation} {a}")

    def folder(self, name, where):
        """Check that a folder has a place in the order."""
        if name not in self.level:
            self.faults.append(f"{where}: {name} has no place in the list of floors (.ci/floors.py)")

    def size(self, where, lines, functions):
        """Check the length of a file and of its functions, which are triples (name, line, lines)."""
        self.lines += lines
        self.files += 1
        if lines > FILE_LINES:
            self.faults.append(f"{where}: {lines} lines, more than {FILE_LINES}")
        for name, line, count in functions:
            if count > FUNCTION_LINES:
                self.faults.append(f"{where}:{line}: {name} has {count} lines, more than {FUNCTION_LINES}")

    def circles(self):
        """Find a circle of files in each folder, and record it."""
        for folder, graph in self.inside.items():
            for group in components(graph):
                if len(group) > 1:
                    path = circle(graph, group)
                    steps = [f"{a} {graph[a][b]} [{b}]" for a, b in itertools.pairwise(path)]
                    self.faults.append(f"{folder}: circle among {', '.join(sorted(group))}: " + "; ".join(steps))

    def height(self):
        """Folders of the longest chain, lowest first; folders that depend on each other count one by one."""
        groups = components({a: {b: "" for b in sorted(used)} for a, used in self.edges.items()})
        chain = {}
        for group in groups:  # what a group depends on comes before it
            below = [chain[b] for a in group for b in self.edges.get(a, ()) if b not in group]
            longest = max(below, key=len, default=[]) + sorted(group)
            chain |= {name: longest for name in group}
        return max(chain.values(), key=len, default=[])


def components(graph):
    """Strongly connected components (Tarjan), each after those that it leads to."""
    index, low, stack, out = {}, {}, [], []

    def visit(a):
        index[a] = low[a] = len(index)
        stack.append(a)
        for b in graph.get(a, ()):
            if b not in index:
                visit(b)
            if b in stack:
                low[a] = min(low[a], low[b])
        if low[a] == index[a]:
            cut = stack.index(a)
            out.append(stack[cut:])
            del stack[cut:]

    for a in sorted(graph):
        if a not in index:
            visit(a)
    return out


def circle(graph, group):
    """Shortest path in a component from its first file back to it."""
    start = min(group)
    before, todo = {}, [start]
    for a in todo:
        for b in graph.get(a, ()):
            if b in group and b not in before:
                before[b] = a
                todo.append(b)
    path = [start, before[start]]
    while path[-1] != start:
        path.append(before[path[-1]])
    return path[::-1]


# ---- C ---------------------------------------------------------------------------------------------------------------


class CFile:
    """What a C file defines and uses.

    Clang-format puts the braces of a function, and of nothing else, alone into the first column.
    """

    def __init__(self, root, path):
        self.path = path
        parts = path.relative_to(root).parts
        self.folder = parts[0] if len(parts) > 1 or parts[0] == "register.c" else "core"
        self.name = "/".join(parts)
        raw = path.read_text()
        text = re.sub(r'"(?:\\.|[^"\\\n])*"|/\*.*?\*/|//[^\n]*', self.comment, raw, flags=re.S)
        self.includes = [
            (i, m.group(1))
            for i, line in enumerate(text.split("\n"), 1)
            if (m := re.match(r'\s*#\s*include\s+"([^"]+)"', line))
        ]
        self.text = re.sub(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\])+\'', '""', text)
        self.lines = self.text.split("\n")
        self.count = raw.count("\n")
        self.functions = list(self.find_functions())

    @staticmethod
    def comment(match):
        """Keep a string, replace a comment by blanks."""
        return match.group() if match.group()[0] == '"' else re.sub(r"[^\n]", " ", match.group())

    def find_functions(self):
        """Functions with a body: name, first and last line (from 1), static or not."""
        for i, line in enumerate(self.lines):
            if line.rstrip() != "{":
                continue
            first = i
            while first > 0 and self.lines[first - 1].strip() and self.lines[first - 1].rstrip()[-1] not in ";}\\":
                if self.lines[first - 1].startswith("#"):
                    break
                first -= 1
            signature = " ".join(self.lines[first:i])
            name = re.search(r"(\w+)\s*\(", signature)
            last = next((j for j in range(i, len(self.lines)) if self.lines[j].startswith("}")), len(self.lines) - 1)
            if name:
                yield name.group(1), first + 1, last + 1, bool(re.search(r"\bstatic\b", signature))

    def uses(self):
        """Words of the file: word -> first line."""
        found = {}
        for i, line in enumerate(self.lines, 1):
            for word in WORD.findall(line):
                found.setdefault(word, i)
        return found

    def pieces(self):
        """Macros and inline functions of a header: name -> words of it, with their lines."""
        out, i = {}, 0
        for name, first, last, _ in self.functions:
            out[name] = {w: n for n in range(last, first - 1, -1) for w in WORD.findall(self.lines[n - 1])}
        while i < len(self.lines):
            start = i
            while self.lines[i].endswith("\\") and i + 1 < len(self.lines):
                i += 1
            if macro := re.match(r"\s*#\s*define\s+(\w+)", self.lines[start]):
                words = {w: n + 1 for n in range(i, start - 1, -1) for w in WORD.findall(self.lines[n])}
                out[macro.group(1)] = words
            i += 1
        return out


def expand(words, pieces):
    """Words of a file with those of the macros and inline functions that it uses."""
    found, todo = dict(words), list(words)
    while todo:
        word = todo.pop()
        for inner in pieces.get(word, ()):
            if inner not in found:
                found[inner] = found[word]
                todo.append(inner)
    return found


def check_c(root):
    """Read all sources under latinpc/src."""
    floors, source = Floors(C_FLOORS), root / "latinpc/src"
    files = [CFile(source, path) for path in sorted(source.rglob("*.[ch]"))]
    headers = {f.name: f for f in files if f.name.endswith(".h")}
    pieces = {}
    for header in headers.values():
        pieces |= header.pieces()
    owner = {}
    for f in files:
        if f.name.endswith(".c"):
            owner |= {name: f for name, _, _, static in f.functions if not static}
    for f in files:
        where = str(f.path.relative_to(root))
        floors.folder(f.folder, where)
        if f.name != "register.c" and "/" not in f.name:
            floors.faults.append(f"{where}: belongs into a folder; counted as core")
        floors.size(where, f.count, [(name, first, last - first + 1) for name, first, last, _ in f.functions])
        check_includes(floors, f, headers, where)
        check_calls(floors, f, owner, pieces, where)
        check_members(floors, f, where)
    floors.circles()
    return floors


def check_includes(floors, f, headers, where):
    """Headers of the same folder or below."""
    for line, name in f.includes:
        target = headers.get(name) or headers.get(f"{f.folder}/{name}")
        if target:
            floors.use((f.folder, f.name), (target.folder, target.name), f"{where}:{line}", f"includes {target.name}")


def check_calls(floors, f, owner, pieces, where):
    """Functions of the same folder or below; what an inline function or a macro calls, its user calls."""
    words = f.uses()
    if f.name.endswith(".h"):
        words = {w: n for piece in f.pieces().values() for w, n in piece.items()}
        defined = {name for name, *_ in f.functions}
    else:
        defined = {name for name, *_ in f.functions}
        words = expand(words, pieces)
    for word, line in words.items():
        target = owner.get(word)
        if target and target is not f and word not in defined:
            if f.name.endswith(".h") and target.folder == f.folder:
                continue  # a file that expands the macro is charged with the call
            floors.use((f.folder, f.name), (target.folder, target.name), f"{where}:{line}", f"calls {word}")


def check_members(floors, f, where):
    """Nothing below core reads members of the solver's struct."""
    if floors.level.get(f.folder, 99) >= floors.level["core"]:
        return
    names = {"latin"} | set(re.findall(r"\bLatin\s+(\w+)", f.text))
    member = re.compile(rf"\b(?:{'|'.join(sorted(names))})->\w+|\b_p_Latin\b")
    hits = [(i, m.group()) for i, line in enumerate(f.lines, 1) for m in [member.search(line)] if m]
    if hits:
        floors.faults.append(f"{where}:{hits[0][0]}: reads {hits[0][1]} below core (on {len(hits)} lines)")


# ---- Python ----------------------------------------------------------------------------------------------------------


def check_python(root):
    """Read all modules of the package."""
    floors, package = Floors(PYTHON_FLOORS), root / "latinpc"
    paths = [p for p in sorted(package.rglob("*.py")) if "__pycache__" not in p.parts]
    modules = {module_name(package, path): path for path in paths}
    for path in (*package.glob("*.p[xy][dix]"), *root.glob("tests/*.py")):  # their lengths alone
        if (lines := path.read_text().count("\n")) > FILE_LINES:
            floors.faults.append(f"{path.relative_to(root)}: {lines} lines, more than {FILE_LINES}")
        if path.suffix == ".pyx":
            modules[module_name(package, path)] = None
    for name, path in modules.items():
        if path is None:  # compiled: the bottom
            continue
        where, text = str(path.relative_to(root)), path.read_text()
        tree = ast.parse(text)
        floor = python_floor(name)
        floors.folder(floor, where)
        floors.size(where, text.count("\n"), list(python_functions(tree)))
        for line, target in imports(tree, name, path.name == "__init__.py", modules):
            used = (python_floor(target), target)
            floors.use((floor, name), used, f"{where}:{line}", f"imports {target}")
    floors.circles()
    return floors


def module_name(package, path):
    """Dotted name of a file."""
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def python_floor(module):
    """Name of a module's place in the list of floors."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def python_functions(tree):
    """Functions of a module: name, line, number of lines without the docstring."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            count, first = node.end_lineno - node.lineno + 1, node.body[0]
            if ast.get_docstring(node, clean=False) is not None:
                count -= first.end_lineno - first.lineno + 1
            yield node.name, node.lineno, count


def imports(tree, module, is_package, modules):
    """Modules of this package that a module imports when it runs, with the lines."""
    hints = {
        below
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", None) == "TYPE_CHECKING"
        for part in node.body
        for below in ast.walk(part)
    }
    for node in ast.walk(tree):
        if node in hints:
            continue
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".") if is_package else module.split(".")[:-1]
                parts = parts[: len(parts) - node.level + 1]
                base = ".".join(parts + ([node.module] if node.module else []))
            targets = [f"{base}.{alias.name}" if f"{base}.{alias.name}" in modules else base for alias in node.names]
        else:
            continue
        for target in targets:
            if target in modules:
                yield node.lineno, target


# ---- results ---------------------------------------------------------------------------------------------------------


def main():
    """Run the checks of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="c|python", help="languages to check (default: both)")
    parser.add_argument("--report", action="store_true", help="print violations and sizes, exit 0")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[1], help="tree to check")
    args = parser.parse_args()
    checks = {"c": check_c, "python": check_python}
    if unknown := set(args.parts) - set(checks):
        parser.error(f"unknown part: {', '.join(sorted(unknown))}")
    failed = False
    for part in args.parts or list(checks):
        floors = checks[part](args.root)
        failed |= bool(floors.faults)
        for fault in floors.faults:
            print(fault)
        if args.report:
            chain = [name for name in floors.height() if name not in ("register.c", "__init__")]
            print(
                f"{part}: {floors.files} files, {floors.lines} lines, {len(floors.faults)} violations, "
                f"{len(chain)} floors ({' < '.join(chain)})\n"
            )
    return 1 if failed and not args.report else 0


if __name__ == "__main__":
    sys.exit(main())
