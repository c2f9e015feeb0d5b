"""Coulomb friction in chains of contacts: an interior-point method without an energy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from support import far, latin, solve

import latinpc
from latinpc.bench.extremes.conditions import missed
from latinpc.scenes import Law, Scene, make

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the tolerances are of double precision")

CHAINS = {
    "discs": {"side": 20},
    "more discs": {"side": 40},
    "rough discs": {"side": 20, "friction": 0.9},
    "spheres": {"side": 8, "dim": 3},
    "rough spheres": {"side": 8, "dim": 3, "seed": 2, "friction": 0.9},
    "METIS": {"side": 24, "partition": "metis", "seed": 1},
    "one subdomain": {"side": 24, "subdomains": 1, "seed": 2},
}


def rubbing(name):
    """Make a packing of CHAINS."""
    return make("packing", law="friction", **CHAINS[name])


@pytest.mark.parametrize("name", CHAINS)
def test_chains_of_contacts_with_friction_are_found(name):
    """Balance, gaps, cones, and friction against the slip, at the default stop."""
    scene = rubbing(name)
    found = solve(scene)
    assert found.reason > 0
    assert found.iterations < 400
    assert missed(scene, found.u, found.tensions) < 1e-5


@pytest.mark.parametrize("name", ["discs", "METIS"])
def test_contacts_stick_slip_and_open(name):
    """All three are there in numbers: the tests above are of none alone."""
    scene = rubbing(name)
    found = solve(scene)
    normal = found.tensions.reshape(-1, scene.dim)[:, 0]
    rub = np.linalg.norm(found.tensions.reshape(-1, scene.dim)[:, 1:], axis=1)
    slips = rub >= 0.999 * scene.friction[:: scene.dim] * -normal
    for kind in (normal == 0.0, (normal < 0.0) & slips, (normal < 0.0) & ~slips):
        assert kind.sum() > 10


@pytest.mark.parametrize("error", [1e-6, 1e-9])
def test_smaller_errors(error):
    """The tensions are unique here; discs between two opposite forces slide on at no cost."""
    scene = rubbing("discs")
    found = solve(scene, error=error)
    assert found.reason > 0
    assert missed(scene, found.u, found.tensions) < 10 * error
    assert far(found.tensions, solve(scene, error=1e-10).tensions) < error


@pytest.mark.parametrize("units", [2.0**-30, 2.0**30])
def test_units_of_force_change_no_step(units):
    scene = rubbing("discs")
    one, other = solve(scene), solve(replace(scene, load=units * scene.load))
    assert other.iterations == one.iterations
    assert far(other.tensions, units * one.tensions) < 1e-6


STRAIN, TENSION = [-1.0, 0.0, 1e-3, 1.0], [-1e4, 0.0, 10.0, 20.0]


def tied(scene):
    """Tie some discs to a wall by cables, bars, and links that yield: links, laws, directions."""
    free = np.flatnonzero(~scene.fixed.any(axis=1))[::20]
    wall = np.flatnonzero(scene.fixed.all(axis=1))[: len(free)]
    links = np.column_stack([wall, free[: len(wall)]])
    along = scene.nodes[links[:, 1]] - scene.nodes[links[:, 0]]
    laws = [Law.CABLE, Law.BAR, latinpc.register_table(STRAIN, TENSION)]
    return links, np.resize(laws, len(links)).astype(int), along / np.linalg.norm(along, axis=1)[:, None]


def test_beside_cables_bars_and_links_that_yield():
    """These have the tensions of their laws, which with the loads balance contacts by Coulomb's law."""
    scene = rubbing("discs")
    ties, law, along = tied(scene)
    k = np.where(law == law.max(), 0.0, 1e4)
    result = latinpc.Structure(
        scene.nodes,
        np.vstack([scene.links, ties]),
        law=np.append(scene.law, law),
        stiffness=np.append(scene.stiffness, k),
        initial_elongation=np.append(scene.initial_elongation, np.full(len(ties), 1e-3)),
        direction=np.vstack([scene.directions, along]),
        friction=np.append(scene.friction, np.zeros(len(ties))),
        fixed=scene.fixed,
        load=scene.load,
    ).solve()
    assert result.converged
    u, tensions = result.displacements, result.tensions[len(scene.links) :]
    x = 1e-3 + ((u[ties[:, 1]] - u[ties[:, 0]]) * along).sum(axis=1)
    expected = np.select(
        [law == Law.CABLE, law == Law.BAR], [k * np.maximum(x, 0.0), k * x], np.interp(x, STRAIN, TENSION)
    )
    assert np.ptp(x) > 2e-3
    assert np.abs(tensions - expected).max() < 1e-6 * np.abs(tensions).max()
    load = scene.load.copy()
    for end, sign in ((0, 1.0), (1, -1.0)):
        np.add.at(load, ties[:, end], sign * tensions[:, None] * along)
    assert missed(replace(scene, load=load), u, result.tensions[: len(scene.links)]) < 1e-5


def wedged(friction):
    """Make a grain between two walls that it touches, and a load that presses it onto a floor."""
    nodes = np.array([[0.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    links = np.repeat([[0, 1], [0, 2], [0, 3]], 2, axis=0)
    normal = np.repeat(nodes[[1, 2, 3]], 2, axis=0)
    normal[1::2] = np.column_stack([-normal[1::2, 1], normal[1::2, 0]])
    fixed = np.ones((5, 2), bool)
    fixed[0] = False
    load = np.zeros((5, 2))
    load[0] = 0.0, -100.0
    return Scene(
        name="wedged", nodes=nodes, fixed=fixed, load=load, links=np.vstack([links, [[0, 4]]]),
        law=[Law.FRICTION, Law.TANGENT] * 3 + [Law.CABLE], stiffness=[0.0] * 6 + [1e4],
        initial_elongation=[0.0] * 4 + [1e-3, 0.0, 0.0], friction=[friction, 0.0] * 3 + [0.0],
        direction=np.vstack([normal, [[0.0, 1.0]]]),
    )  # fmt: skip


def test_no_self_stress_where_none_is_needed():
    """Two walls may squeeze the grain by any force: it is the least one that holds."""
    scene = wedged(0.3)
    found = solve(scene)
    assert found.reason > 0
    assert missed(scene, found.u, found.tensions) < 1e-8
    assert np.abs(found.tensions[[0, 2]]).max() < 200.0


def test_the_limit_of_stages_is_kept():
    scene = rubbing("discs")
    for limit in (40, 60, 80, 100):
        found = solve(scene, max_it=limit)
        assert found.iterations <= limit + 4
        assert found.reason == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT


def test_its_solver_has_a_prefix(capfd):
    """Its options are read; what is no solver is PETSc's error."""
    given = PETSc.Options()
    given["snes_latin_friction_ksp_converged_reason"] = None
    try:
        assert solve(rubbing("discs")).reason > 0
        assert "Linear snes_latin_friction_ solve converged" in capfd.readouterr().out
        given["snes_latin_friction_pc_type"] = "no_such_solver"
        with pytest.raises(PETSc.Error):
            solve(rubbing("discs"))
    finally:
        for name in ("pc_type", "ksp_converged_reason"):
            del given["snes_latin_friction_" + name]


def test_the_view_has_its_steps(capfd):
    given = PETSc.Options()
    given["snes_view"] = None
    try:
        assert solve(rubbing("discs")).reason > 0
    finally:
        del given["snes_view"]
    assert "interior-point methods for contacts with friction: last solve" in capfd.readouterr().out


def test_a_solver_solves_again():
    """A reused solver, with other gaps, finds what a new one does."""
    scene = rubbing("discs")
    with latin(scene) as run:
        for gaps in (1.0, 1.1, 1.0):
            run.structure.set_initial_elongation(gaps * scene.initial_elongation)
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            fresh = solve(replace(scene, initial_elongation=gaps * scene.initial_elongation))
            assert far(latinpc.tensions(run.snes), fresh.tensions) < 1e-6


RANKS = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import numpy as np
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from test_coulomb import rubbing
for name in ("discs", "spheres"):
    structure = latinpc.Structure.from_scene(rubbing(name))
    snes = structure.create_snes()
    snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    found = latinpc.tensions(snes)
    if structure.comm.rank == 0:
        np.save(sys.argv[1] + "-" + name + ".npy", found)
"""


def test_ranks_do_not_matter(mpirun, tmp_path):
    """Two and four ranks find what one does."""
    for ranks in (1, 2, 4):
        mpirun(ranks, RANKS, tmp_path / f"u{ranks}")
    for name in ("discs", "spheres"):
        one, two, four = (np.load(tmp_path / f"u{ranks}-{name}.npy") for ranks in (1, 2, 4))
        assert far(two, one) < 1e-6
        assert far(four, one) < 1e-6
