"""Only what the scene requires: what a structure, or an option, does not use is not built."""

import re
from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import chain, grid, irregular, latin, lattice, logged

import latinpc
from latinpc.scenes import Law, make

# name: scene, options, parts that it builds
SCENES = {
    "bars, 2D, one subdomain": (lambda: bars(whole(lattice())), {}, ()),
    "bars, 2D, many": (lambda: bars(lattice()), {}, ("coarse",)),
    "bars, 1D, many": (lambda: chain(), {}, ("coarse",)),
    "bars, 3D, many": (lambda: grid("truss"), {}, ("coarse",)),
    "cables, 1D, one subdomain": (lambda: chain(parts=1, law=Law.CABLE), {}, ("links",)),
    "cables, 1D, many": (lambda: chain(law=Law.CABLE), {}, ("coarse", "links")),
    "cables, 3D, one subdomain": (lambda: grid(subdomains=1), {}, ("links",)),
    "cables, 3D, many": (lambda: grid(), {}, ("coarse", "links")),
    "rigid cables, many": (lambda: make("net", side=8, subdomains=4), {}, ("coarse", "links")),
    "stop on the error": (grid, {"stop": "error"}, ("coarse", "links", "estimate")),
    "local fields": (irregular, {"modes_local": 1}, ("coarse", "links", "local fields")),
    "polish": (grid, {"polish": True}, ("coarse", "links", "Newton", "second method")),
    "reference": (grid, {}, ("coarse", "links", "errors")),
    "rescue, many": (lambda: stiff(grid()), {"max_it": 3000}, ("coarse", "links", "Newton", "second method")),
}


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


def measured(name, path):
    """Solve in a stage of its own and tell what has been built."""
    make_scene, options, _ = SCENES[name]
    scene = make_scene()
    reference = oracle.newton(scene) if name == "reference" else None
    with logged(), latin(scene, **options) as run:
        if reference is not None:
            given = run.links.create_vec()
            run.links.set_displacements(reference, given)
            latinpc.set_reference(run.snes, given)
        run.snes.solve(None, run.links.create_vec())
        assert run.snes.getConvergedReason() > 0
        events = {e: PETSc.Log.Event(f"Latin{e}").getPerfInfo()["count"] for e in ("Floppy", "Coarse", "Estimate")}
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
        "local fields": events["Floppy"] > 0,
        "errors": len(history["error_l2"]) > 0,
        "Newton": int(objects["SNES"]) > 2,  # beside SNES latin and the one that iterates
        "second method": int(objects["Latin"]) > 1,
    }
    return tuple(part for part, there in parts.items() if there), sizes, scene


def state_of_bars(scene, options):
    """Size of the state when all links are bars: that of the interfaces."""
    with logged(), latin(bars(scene), **options) as run:
        run.snes.setUp()
        return latinpc.statistics(run.snes)["state_size"]


@pytest.mark.parametrize("name", SCENES)
def test_only_what_is_required_is_built(name, tmp_path):
    parts, sizes, scene = measured(name, tmp_path / "log")
    assert sorted(parts) == sorted(SCENES[name][2])
    if sizes["subdomains"] == 1:
        assert sizes["state_size"] <= np.count_nonzero(scene.law != Law.BAR)
        assert sizes["micro_sides"] == sizes["coarse_size"] == 0
