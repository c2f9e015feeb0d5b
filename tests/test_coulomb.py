"""Coulomb friction in chains of contacts: an interior-point method without an energy."""

import re
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


TURNS = [(32, 2, 0.6, 4), (32, 2, 0.9, 1), (32, 2, 0.9, 6), (48, 2, 0.3, 0), (8, 3, 0.6, 0), (10, 3, 0.9, 1)]


def turning(side, dim, friction, seed):
    """Make one of TURNS."""
    return make("packing", law="friction", side=side, dim=dim, friction=friction, seed=seed)


def test_paths_that_turn_back():
    """Newton's path alone finds none: friction bounds follow slowly, and grains slide to another equilibrium."""
    scenes = [turning(*values) for values in TURNS]
    found = [solve(scene, max_it=2000) for scene in scenes]
    solved = [pair for pair in zip(scenes, found, strict=True) if pair[1].reason > 0]
    assert len(solved) >= len(TURNS) - 1  # rounding decides
    assert max(missed(scene, each.u, each.tensions) for scene, each in solved) < 1e-5


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
    best = solve(scene, error=1e-10)
    assert best.reason > 0
    assert far(found.tensions, best.tensions) < error


@pytest.mark.parametrize("error", [1e-8, 1e-10])
@pytest.mark.parametrize("name", ["spheres", "rough spheres"])
def test_errors_next_to_rounding(name, error):
    """Products of tensions and elongations are rounding then, of either sign."""
    scene = rubbing(name)
    found = solve(scene, error=error)
    assert found.reason > 0
    assert found.estimated_error <= error
    assert missed(scene, found.u, found.tensions) < 10 * error


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


def overlapped(angles, gaps, friction):
    """Make a grain without load among walls, some of which it overlaps: there is room to move away from them."""
    n = len(angles)
    turn = np.radians(angles)
    normal = np.column_stack([np.cos(turn), np.sin(turn)])
    frames = np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)
    fixed = np.ones((n + 1, 2), bool)
    fixed[0] = False
    return Scene(
        name="overlapped", nodes=np.vstack([np.zeros((1, 2)), normal]), fixed=fixed, load=np.zeros((n + 1, 2)),
        links=np.repeat([[0, wall + 1] for wall in range(n)], 2, axis=0), law=[Law.FRICTION, Law.TANGENT] * n,
        stiffness=[0.0] * (2 * n), initial_elongation=np.column_stack([gaps, np.zeros(n)]).ravel(),
        friction=np.column_stack([friction, np.zeros(n)]).ravel(), direction=frames.reshape(-1, 2),
    )  # fmt: skip


@pytest.mark.parametrize("units", [2.0**-30, 1.0, 2.0**30])
@pytest.mark.parametrize(
    ("angles", "gaps", "friction"),
    [
        ((75, 45, 195), (0.023, 0.003, -0.003), (0.0, 0.3, 0.3)),
        ((300, 225, 90, 0), (0.020, -0.003, -0.008, 0.016), (0.3, 0.3, 0.3, 0.0)),
        ((180, 195, 315), (-0.009, 0.026, -0.001), (0.3, 0.9, 0.6)),
    ],
)
def test_where_nothing_bears(angles, gaps, friction, units):
    """No load: all contacts open or touch, and tensions vanish, to which errors and work cannot be compared.

    Friction does not lock the grain between the walls that it overlaps: then none of the paths may leave them.
    """
    scene = overlapped(angles, units * np.array(gaps), friction)
    found = solve(replace(scene, nodes=units * scene.nodes))
    assert found.reason > 0
    x = scene.initial_elongation[::2] - scene.directions[::2] @ found.u[0]
    assert x.min() > -1e-8 * units
    assert np.abs(found.tensions).max() < 1e-12


def test_what_friction_holds_does_not_move():
    """Displacements are rounding, whose own error is no matter: contacts that touch bear the loads, bars nothing."""
    nodes = np.array([
        [0.18, -0.83, 1.5], [0.13, 0.91, 1.16], [0.08, 0.65, -0.15], [-0.62, 0.38, 0.77], [0.13, 1.91, 1.16],
        [0.08, -0.35, -0.15], [-0.42, -0.33, 0.86], [-1.0, 0.67, 0.89], [0.98, -0.83, 0.66], [0.33, 2.13, 1.17],
        [-0.41, 2.01, 1.23], [-0.66, -0.08, 1.56],
    ])  # fmt: skip
    touch = np.array([[1, 3], [1, 4], [2, 5], [0, 1], [0, 6]])
    bars = np.array([[0, 7], [1, 8], [2, 9], [2, 10], [2, 11]])
    along = nodes[touch[:, 1]] - nodes[touch[:, 0]]
    frames = np.linalg.qr(np.stack([along, *np.eye(3)[[0, 1]].repeat(5, 0).reshape(2, 5, 3)], axis=2))[0]
    frames *= np.sign((frames[:, :, 0] * along).sum(axis=1))[:, None, None]
    fixed = np.ones(nodes.shape, bool)
    fixed[:3] = False
    load = np.zeros(nodes.shape)
    load[1:3] = [-0.61, -1.88, -1.62], [0.61, -0.44, -2.9]
    scene = Scene(
        name="held", nodes=nodes, fixed=fixed, load=load, links=np.vstack([touch.repeat(3, 0), bars]),
        law=[Law.FRICTION, Law.TANGENT, Law.TANGENT] * 5 + [Law.BAR, Law.CABLE] + [Law.COMPRESSION_ONLY] * 3,
        stiffness=[0.0] * 15 + [1812.0, 5.0, 38.0, 2.0, 8.0], friction=[1e3, 0.0, 0.0] * 5 + [0.0] * 5,
        initial_elongation=[0.0] * 15 + [0.005, 0.012, 0.006, 0.009, 0.017],
        direction=np.vstack([frames.transpose(0, 2, 1).reshape(-1, 3), np.zeros((5, 3))]),
    )  # fmt: skip
    found = solve(scene)
    assert found.reason > 0
    assert np.abs(found.u).max() < 1e-12
    assert missed(scene, found.u, found.tensions) < 1e-8


SHORT = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import petsc4py
petsc4py.init([*sys.argv, "-info"])
from test_coulomb import overlapped, solve
solve(overlapped((285, 315, 30, 225, 15), (-0.011, 0.019, -0.007, -0.007, -0.005), (0.9, 0.3, 0.3, 0.6, 0.9)))
"""


def test_no_step_leaves_the_cones(mpirun):
    """Past the apex of a cone, or across it by cancellation: steps of no length would be all that is left."""
    lengths = [float(x) for x in re.findall(r"length ([\d.e+-]+), bounds", mpirun(1, SHORT, alone=True).stdout)]
    assert len(lengths) > 10
    assert min(lengths) > 1e-12


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


TURN = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from test_coulomb import TURNS, missed, turning
solved = 0
for values in TURNS[:3]:
    scene = turning(*values)
    structure = latinpc.Structure.from_scene(scene)
    snes = structure.create_snes()
    snes.setFromOptions()
    snes.setTolerances(max_it=2000)
    u = structure.create_vec()
    snes.solve(None, u)
    moved, tensions = structure.displacements(u), latinpc.tensions(snes)
    if snes.getConvergedReason() > 0:
        solved += 1
        assert missed(scene, moved, tensions) < 1e-5
assert solved >= 2
"""


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_paths_that_turn_back_on_ranks(ranks, mpirun):
    mpirun(ranks, TURN)


def test_grains_that_hold_no_one_else():
    """At the end they have no stiffness beside that of their contacts but rounding: steps were of any length."""
    scene = make("packing", law="friction", side=64, friction=0.05, seed=1)
    found = solve(scene)
    assert found.reason > 0
    assert found.iterations < 300
    assert missed(scene, found.u, found.tensions) < 1e-5
