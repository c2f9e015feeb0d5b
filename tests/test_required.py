"""Only what the scene requires: what a structure, or an option, does not use is not built."""

import re
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import oracle
import pytest
from conftest import LOGS, ROOT
from motions import heavy, motion
from petsc4py import PETSc
from support import SNES_OWN, chain, grid, irregular, latin, lattice, logged

import latinpc
from latinpc.scenes import Law, make


def grains():
    """Discs with friction, pressed together."""
    return make("packing", law="friction", side=8, subdomains=4)


CHEAP = {"stop": "indicator"}
# name: scene, options, parts that it builds
SCENES = {
    "bars, 2D, one subdomain": (lambda: bars(whole(lattice())), {}, ()),
    "bars, 2D, many": (lambda: bars(lattice()), {}, ("coarse",)),
    "bars, 1D, many": (lambda: chain(), {}, ("coarse",)),
    "bars, 3D, many": (lambda: grid("truss"), {}, ("coarse",)),
    "cables, 1D, one subdomain": (lambda: chain(parts=1, law=Law.CABLE), CHEAP, ("links",)),
    "cables, 1D, many": (lambda: chain(law=Law.CABLE), CHEAP, ("coarse", "links")),
    "cables, 3D, one subdomain": (lambda: grid(subdomains=1), CHEAP, ("links",)),
    "cables, 3D, many": (lambda: grid(), CHEAP, ("coarse", "links")),
    "the default stop": (grid, {}, ("coarse", "links", "estimate", "Newton", "second method")),
    "rigid cables, many": (lambda: make("net", side=8, subdomains=4), CHEAP, ("coarse", "links")),
    "rigid cables, the default stop": (
        lambda: make("net", side=6, subdomains=4),
        {},
        ("coarse", "links", "estimate", "Newton", "second method"),
    ),
    "stop on the error": (grid, {"stop": "error"}, ("coarse", "links", "estimate", "Newton", "second method")),
    "local fields": (irregular, {"modes_local": 1, **CHEAP}, ("coarse", "links", "local fields")),
    "reference": (grid, CHEAP, ("coarse", "links", "errors")),
    "Newton, many": (lambda: stiff(grid()), {"max_it": 3000, **CHEAP}, ("coarse", "links", "Newton", "second method")),
    "friction, many": (grains, {"stol": 0.1}, ("coarse", "links")),
    "links that turn": (
        lambda: make("saddle", side=6),
        {},
        ("estimate", "Newton", "second method", "links that turn"),  # bars are in the state as well
    ),
    "bars, motion": (lambda: heavy(bars(lattice())), {}, ("coarse", "motion")),
    "cables, motion, one subdomain": (lambda: heavy(grid(subdomains=1), mass=20.0), CHEAP, ("links", "motion")),
    "cables, motion": (lambda: heavy(grid(), mass=20.0), CHEAP, ("coarse", "links", "motion")),
    "contacts, motion": (lambda: make("bouncing-chain"), CHEAP, ("coarse", "links", "motion")),
    "contacts, motion, the default stop": (
        lambda: make("bouncing-chain"),
        {},
        ("coarse", "links", "motion", "estimate", "Newton", "second method"),
    ),
}
STEP = 1e-4


def bars(scene):
    """Make all links bars."""
    stiffness = np.where(scene.stiffness > 0.0, scene.stiffness, 1.0)
    return replace(scene, law=np.zeros_like(scene.law), stiffness=stiffness)


def whole(scene):
    """Leave it in one piece."""
    return replace(scene, subdomain=np.zeros_like(scene.law))


def stiff(scene):
    """Make cables so stiff that Newton's method is needed to confirm a solution."""
    return replace(scene, stiffness=np.where(np.arange(len(scene.links)) % 97 == 5, 1e8, 1.0) * scene.stiffness)


@contextmanager
def solver(scene, options):
    """Give the SNES of a structure, or of its motion, and what solves once, or makes two steps."""
    if scene.mass is None:
        with latin(scene, **options) as run:
            u = run.structure.create_vec()
            yield SimpleNamespace(snes=run.snes, structure=run.structure, go=lambda: run.snes.solve(None, u))
        return
    options = {("snes_" if key in SNES_OWN else "snes_latin_") + key: value for key, value in options.items()}
    with motion(scene, scene.time_step or STEP, **options) as run:
        yield SimpleNamespace(snes=run.ts.getSNES(), structure=run.structure, go=lambda: run.step(2))


def measured(name, path):
    """Solve in a stage of its own and tell what has been built."""
    make_scene, options, _ = SCENES[name]
    scene = make_scene()
    reference = oracle.newton(scene) if name == "reference" else None
    with logged(), solver(scene, options) as run:
        if reference is not None:
            given = run.structure.create_vec()
            run.structure.set_displacements(reference, given)
            latinpc.set_reference(run.snes, given)
        run.go()
        assert run.snes.getConvergedReason() > 0
        events = {e: PETSc.Log.Event(f"Latin{e}").getPerfInfo()["count"] for e in ("Spectral", "Coarse", "Estimate")}
        viewer = PETSc.Viewer().createASCII(str(path), comm=PETSc.COMM_SELF)
        PETSc.Log.view(viewer)
        viewer.destroy()
        for _ in range(2):  # the view has left all stages: the main one, and one for `logged` to leave
            PETSc.Log.Stage("Main Stage").push()
        history, sizes = latinpc.history(run.snes), latinpc.statistics(run.snes)
        coarse = bool(latinpc.coarse_ksp(run.snes))
    objects = dict(re.findall(r"^ +(\S.*?) +(\d+) +\d+\D*$", path.read_text().split("Event Stage")[-1], re.MULTILINE))
    assert coarse == (events["Coarse"] > 0) == (sizes["coarse_size"] > 0)
    assert (len(history["estimate"]) > 0) == (events["Estimate"] > 0)
    parts = {
        "coarse": coarse,
        "links": sizes["state_size"] > state_of_bars(scene, options),
        "estimate": events["Estimate"] > 0,
        "local fields": events["Spectral"] > 0,
        "errors": len(history["error_l2"]) > 0,
        "Newton": int(objects["SNES"]) > 2,  # beside SNES latin and the one that iterates
        "second method": int(objects["Latin"]) > 1,
        # a step, or the parts of links that turn, are a structure of their own
        "motion": int(objects["LatinStructure"]) > 1 and scene.mass is not None,
        "links that turn": int(objects["LatinStructure"]) > 1 and scene.mass is None,
    }
    return tuple(part for part, there in parts.items() if there), sizes, scene


def state_of_bars(scene, options):
    """Size of the state when all links are bars: that of the interfaces."""
    with logged(), solver(bars(scene), options) as run:
        if scene.mass is None:
            run.snes.setUp()
        else:
            run.go()
        return latinpc.statistics(run.snes)["state_size"]


@pytest.mark.parametrize("name", SCENES)
def test_only_what_is_required_is_built(name, tmp_path):
    parts, sizes, scene = measured(name, tmp_path / "log")
    assert sorted(parts) == sorted(SCENES[name][2])
    if sizes["subdomains"] == 1:
        parts_of_links = scene.dim * len(scene.links) if "links that turn" in parts else np.count_nonzero(scene.law)
        assert sizes["state_size"] <= parts_of_links
        assert sizes["micro_sides"] == sizes["coarse_size"] == 0


# ---- memory ------------------------------------------------------------------------------

MEMORY = """
import sys
import petsc4py
petsc4py.init(sys.argv)
sys.path.insert(0, sys.argv[1])
from test_required import SCENES, solver
make_scene, options, _ = SCENES[sys.argv[2]]
with solver(make_scene(), options) as run:
    run.go()
"""
# the files, or functions in them, that take memory for a part
PARTS = {
    "coarse": ["interfaces/searchdirection", "interfaces/interfacestiffness", "coarse/groups"],
    "estimate": ["error/estimate"],
    "local fields": ["interfaces/spectralmodes"],
    "second method": ["pc/pclatin"],
    "rigid links": ["structure/rigidlaws: LatinStructureStiffness_Private"],
    "friction": ["structure/structure: LatinStructureSetFriction"],
    "motion": ["structure/timestep", "ts/tslatin"],
    "laws of the user's": ["structure/userlaws"],
    "levels": ["coarse/nearnullspace"],
    "search parameter": ["snes/searchparameter"],
    "links that turn": [
        "structure/turning",
        "structure/turningtangent",
        "structure/frame",
        "snes/large",
        "snes/largenewton",
        "snes/largepath",
        "snes/largesupports",
        "snes/largeinterior",
        "snes/largerigid",
    ],
}
BEYOND = {
    "rigid cables, many": ["rigid links", "search parameter"],
    "rigid cables, the default stop": ["rigid links", "search parameter"],
    "friction, many": ["rigid links", "friction"],
    "contacts, motion": ["rigid links"],
    "contacts, motion, the default stop": ["rigid links"],
}
SHOWN_ELSEWHERE = ("links", "errors", "Newton")  # in the state, the history, and by objects of PETSc
QUICK = ("bars, 2D, many", "friction, many", "contacts, motion")


def functions(where):
    """Return the functions that a file of C defines, or the one that is named: `file: function`."""
    file, _, one = where.partition(": ")
    source = (ROOT / "latinpc" / "src" / f"{file}.c").read_text()
    defined = set(re.findall(r"^[a-zA-Z][\w ]*[ *](\w+)\(", source, re.M)) - {"LatinInitializePackage"}
    assert not one or one in defined
    return {one} if one else defined


@pytest.mark.skipif(bool(LOGS), reason="PETSc leaves memory to valgrind")
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SCENES]
)
def test_what_is_not_required_takes_no_memory(mpirun, name):
    """PETSc's own log of bytes by function: none of a part that the scene does not use, some of each that it does."""
    out = mpirun(1, MEMORY, Path(__file__).parent, name, "-malloc_debug", "-malloc_view", timeout=300).stdout
    took = set(re.findall(r"^\[0\] \d+ \d+ (\w+)\(\)", out, re.M))
    assert any(function.startswith("LatinStructure") for function in took)
    used = {part for part, files in PARTS.items() if took & set().union(*map(functions, files))}
    assert used == {*SCENES[name][2], *BEYOND.get(name, [])} - set(SHOWN_ELSEWHERE)
