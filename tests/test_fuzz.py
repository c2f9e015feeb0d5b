"""Input from strangers: mutated files, options and arrays end in a clear error or a structure, in bounded memory.

A run makes 400 inputs of each kind, always the same ones; ``pytest -m slow tests/test_fuzz.py`` makes 25,000, or as
many as ``LATINPC_FUZZ`` in the environment says.
"""

import os
import random
import re
import resource
import string
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc
from test_files import MSH, MSH_4, TOML

import latinpc
from latinpc.scenes.scene import Scene

MANY = int(os.environ.get("LATINPC_FUZZ", "25000"))
MEMORY = 2**31  # bytes that an input of some kilobytes may not take
NUMBERS = [
    "0",
    "-1",
    "1e15",
    "1000000000000000",
    "999999999",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "true",
    "'",
    '"',
    "[]",
    "{}",
    "1.5",
    "[[",
    "\0",
]
EXPECTED = (ValueError, OSError)


@contextmanager
def opened(paths):
    """Record the files that are opened meanwhile."""
    on = [True]

    def hook(event, arguments):
        if on[0] and event in ("open", "os.system", "subprocess.Popen", "os.exec", "exec", "compile", "import"):
            paths.append((event, arguments))

    sys.addaudithook(hook)
    try:
        yield
    finally:
        on[0] = False


def mutated(rng, text):
    """Change a text here and there: characters, words, lines; cut it; repeat parts of it."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        lines = text.split("\n")
        at = rng.randrange(len(lines))
        words = lines[at].split(" ")
        what = rng.randrange(12)
        if what == 0:
            words[rng.randrange(len(words))] = rng.choice(NUMBERS)
        elif what == 1:
            words[rng.randrange(len(words))] = "".join(rng.choices(string.printable, k=rng.randrange(6)))
        elif what == 2:
            del lines[at]
        elif what == 3:
            lines.insert(at, rng.choice(lines))
        elif what == 4:
            words.append(rng.choice(NUMBERS))
        if what in (0, 1, 4):
            lines[at] = " ".join(words)
        text = "\n".join(lines)
        if what == 5 and text:
            k = rng.randrange(len(text))
            text = text[:k] + chr(rng.choice((0, 10, 34, 45, 57, 255, 0x20AC))) + text[k + 1 :]
        elif what >= 8:  # a value in place of another one
            values = list(re.finditer(r"-?\d+(\.\d+)?|\[[^\]\n]*\]|\"[^\"\n]*\"", text))
            if values:
                old, new = rng.choice(values), rng.choice(values).group() if rng.random() < 0.6 else rng.choice(NUMBERS)
                text = text[: old.start()] + new + text[old.end() :]
        elif what == 6:
            text = text[: rng.randrange(len(text) + 1)]
        elif what == 7:
            k = rng.randrange(len(text) + 1)
            text = text[:k] + text[max(0, k - rng.randrange(60)) :]
    return text


def read(folder, mesh, description):
    """Read a mutated pair of files: a scene, or an error that names one of them."""
    (folder / "a.msh").write_text(mesh, errors="surrogatepass")
    (folder / "a.toml").write_text(description, errors="surrogatepass")
    try:
        scene = latinpc.read(folder / "a.msh")
    except EXPECTED as error:
        assert str(error), (mesh, description)
        return False
    assert isinstance(scene, Scene)
    assert np.isfinite(scene.nodes).all() and scene.links.max(initial=0) < len(scene.nodes)
    return True


def fuzz_files(rng, count, folder):
    more = 'title = "a"\ndim = 2\n' + TOML + "[masses.bars]\nline = 0.5\n[velocities.top]\nvelocity = [0.1, 0.2]\n"
    more += '[[case]]\nname = "b"\n[case.loads.top]\nforce = [1.0, 2.0]\n'
    more += "[case.settlements.feet]\ndisplacement = [0.0, 0.1]\n"
    more += "[case.elongations.bars]\ntemperature = 3.0\nexpansion = 1e-5\n[[case]]\ncombine = { b = 1.35 }\n"
    seeds = [(MSH, more), (MSH, TOML), (MSH_4, TOML)] + [
        ((ROOT / "examples" / f"{name}.msh").read_text(), (ROOT / "examples" / f"{name}.toml").read_text())
        for name in ("footbridge", "tower")
    ]
    good, paths = 0, []
    with opened(paths):
        for _ in range(count):
            mesh, description = rng.choice(seeds[:3] if rng.random() < 0.9 else seeds)
            if rng.random() < 0.5:
                mesh = mutated(rng, mesh)
            else:
                description = mutated(rng, description)
            good += read(folder, mesh, description)
    assert good > count / 50
    outside = {
        (event, str(what[0]))
        for event, what in paths
        if event not in ("compile", "exec", "import") and not str(what[0]).startswith(str(folder))
    }
    assert not {
        pair
        for pair in outside
        if not pair[1].endswith((".py", ".pyc", ".so"))
        and not pair[1].isdigit()
        and not pair[1].startswith(("/proc", sys.prefix, "/usr/lib"))
    }, outside


def fuzz_options(rng, count, folder):
    """Options files go through PETSc's own reader, into a database of their own."""
    seeds = [path.read_text() for path in sorted((ROOT / "options").glob("*.opts"))]
    for _ in range(count):
        (folder / "o.opts").write_text(mutated(rng, rng.choice(seeds)), errors="surrogatepass")
        database = PETSc.Options().create()
        try:
            database.insertString(f"-options_file {folder / 'o.opts'}")
        except PETSc.Error as error:
            assert str(error)
            for file in Path("/proc/self/fd").iterdir():  # PETSc leaves a file open that it could not read
                if file.is_symlink() and str(file.readlink()).startswith(str(folder / "o.opts")):
                    os.close(int(file.name))
        finally:
            database.destroy()


def fuzz_arrays(rng, count, folder):
    """Arrays of wrong shapes, kinds and values, to the structure that Python takes."""
    del folder
    good = 0
    for _ in range(count):
        n, m, dim = rng.randrange(1, 6), rng.randrange(0, 8), rng.randrange(1, 5)
        random_ = np.random.default_rng(rng.randrange(2**32))
        given = {
            "nodes": random_.normal(size=(n, dim)),
            "links": random_.integers(0, n, (m, 2)),
            "law": random_.integers(0, 3, m),
            "stiffness": random_.uniform(0.1, 2, m),
            "fixed": random_.random((n, dim)) < 0.5,
            "load": random_.normal(size=(n, dim)),
            "initial_elongation": random_.normal(size=m),
        }
        for _ in range(rng.randrange(3)):
            name = rng.choice(sorted(given))
            array = np.asarray(given[name]) if not isinstance(given[name], list) else np.zeros(0)
            what = rng.randrange(7)
            with suppress(ValueError, IndexError, TypeError):  # no such array
                if what == 0 and array.size and array.dtype.kind in "if":
                    array = array.copy()
                    array.ravel()[rng.randrange(array.size)] = rng.choice(
                        (-1, 2**31, 2**62) if array.dtype.kind == "i" else (np.nan, np.inf, -1.0, 1e308)
                    )
                elif what == 1:
                    array = array[..., :-1]
                elif what == 2:
                    array = array[None]
                elif what == 3:
                    array = array.astype(object)
                elif what == 4:
                    array = array.astype(str)
                elif what == 5:
                    array = array.astype(complex)
                else:
                    array = rng.choice((None, "cable", 7, [], {}, [[1, 2], [3]], np.zeros((0, 3))))
            given[name] = array
        try:
            structure = latinpc.Structure(given.pop("nodes"), given.pop("links"), comm=PETSc.COMM_SELF, **given)
            good += 1
            assert structure.sizes.links == len(structure.tensions(structure.create_vec()))
        except (*EXPECTED, TypeError) as error:
            assert str(error)
        except PETSc.Error as error:
            assert latinpc.error_message(error)
    assert good > count / 100


KINDS = {"files": fuzz_files, "options": fuzz_options, "arrays": fuzz_arrays}


@pytest.mark.parametrize("kind", KINDS)
def test_mutated_input(kind, tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    KINDS[kind](random.Random(0), 400, tmp_path)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MEMORY


@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("kind", KINDS)
def test_much_mutated_input(kind, tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    KINDS[kind](random.Random(), MANY * (2 if kind == "files" else 1), tmp_path)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MEMORY


@pytest.mark.parametrize("count", ["1000000000000000", "3000000000"])
@pytest.mark.parametrize("section", ["nodes", "elements", "tag"])
def test_hostile_sizes_are_refused(section, count, tmp_path):
    """A head that announces more than there is, or a node of an enormous number, takes no memory."""
    where = {"nodes": "$Nodes\n4", "elements": "$Elements\n6", "tag": "\n40 9 9 0"}[section]
    mesh = MSH.replace(where, {"tag": f"\n{count} 9 9 0"}.get(section, where[:-1] + count))
    assert mesh != MSH
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        read(tmp_path, mesh, TOML)
    finally:
        assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < 2**30


def test_deep_nesting_is_refused(tmp_path):
    assert not read(tmp_path, MSH, TOML + "title = " + "[" * 100_000)
    assert not read(tmp_path, MSH, TOML + "title = " + "9" * 100_000)
