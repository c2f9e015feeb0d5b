"""Where the iteration stalls Newton's method takes over; without an equilibrium the nodes that fly away are named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from random_structures import Draw
from support import far, grid, irregular, latin, solve, unbalance

import latinpc
from latinpc.scenes import Law, Scene, make

REASON = PETSc.SNES.ConvergedReason


def contrast(factor, across=False):
    """Make a network of which some links are `factor` times as stiff, the self-stress kept."""
    scene = make("network", nodes=100)
    if across:
        middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
        chosen = middle > np.median(scene.nodes[:, 0])
    else:
        chosen = np.random.default_rng(3).random(len(scene.links)) < 0.3
    stiffness = np.where(chosen, factor * scene.stiffness, scene.stiffness)
    return replace(scene, stiffness=stiffness, prestrain=scene.prestrain * scene.stiffness / stiffness)


@pytest.mark.parametrize("factor", [1e4, 1e8, 1e-4, 1e-8])
@pytest.mark.parametrize("across", [False, True])
def test_contrasts_between_links(across, factor):
    """Stiff or soft links, inside subdomains or in half of them: every node is in balance, every law is met."""
    scene = contrast(factor, across)
    result = solve(scene, subdomains=8, stol=1e-8, max_it=1000)
    assert result.reason > 0
    assert unbalance(scene, result.u) < 1e-6
    assert result.iterations < 300


def test_the_iteration_alone_stalls():
    """What is rescued needs it: without, the same structure is far from its solution after 500 linear stages."""
    scene = contrast(1e6)
    rescued = solve(scene, subdomains=8, stol=1e-8)
    alone = solve(scene, subdomains=8, stol=1e-8, rescue=0, max_it=500)
    assert alone.reason == REASON.DIVERGED_MAX_IT
    assert rescued.reason > 0
    assert far(alone.u, rescued.u) > 1e-2


@pytest.mark.parametrize("make_scene", [grid, irregular])
def test_is_not_called_where_the_iteration_converges(make_scene):
    """Scenes of like stiffnesses: the same iterates with and without, bit for bit, and nothing is built for it."""
    scene = make_scene()
    runs = [solve(scene, stol=1e-7, rescue=stages) for stages in (300, 0)]
    assert runs[0].iterations == runs[1].iterations == len(runs[0].history.indicator)
    assert (runs[0].u == runs[1].u).all()


def test_a_slow_iteration_is_handed_over():
    """A search direction far off the mark: the plain iteration would need thousands of stages."""
    scene = grid()
    off = {"direction": "scalar", "direction_fraction": 1e4, "outer_snes_type": "nrichardson", "stol": 1e-8}
    result = solve(scene, max_it=3000, **off)
    assert result.reason > 0
    assert result.iterations < 300
    assert far(result.u, oracle.newton(scene)) < 1e-7


def hung(force, nodes=3):
    """Make nodes that hang under two cables each, the last one pushed by a force."""
    anchors = [[x, 1.0] for k in range(nodes) for x in (10.0 * k - 1.0, 10.0 * k + 1.0)]
    points = anchors + [[10.0 * k, 0.0] for k in range(nodes)]
    links = [[2 * k + s, 2 * nodes + k] for k in range(nodes) for s in (0, 1)]
    load = np.zeros((3 * nodes, 2))
    load[2 * nodes :, 1] = -1.0
    load[-1, 1] = force
    return Scene(
        name="hung", nodes=points, links=links, law=[Law.CABLE] * len(links), stiffness=np.full(len(links), 1e3),
        fixed=[[True, True]] * len(anchors) + [[False, False]] * nodes, load=load, subdomain=np.arange(len(links)) % 2,
    )  # fmt: skip


@pytest.mark.parametrize("force", [1e-3, 1.0, 1e4])
def test_nodes_that_fly_away_are_named(force):
    """Pushed up, a node has no equilibrium: the reason says so, and the node is named."""
    with latin(hung(force), stol=1e-8) as run:
        run.snes.solve(None, run.links.create_vec())
        assert run.snes.getConvergedReason() == REASON.DIVERGED_DTOL
        assert latinpc.loose_nodes(run.snes) == (1, [8])
    with latin(hung(-force), stol=1e-8) as run:
        run.snes.solve(None, run.links.create_vec())
        assert run.snes.getConvergedReason() > 0
        assert latinpc.loose_nodes(run.snes) == (0, [])


def test_no_convergence_without_proof():
    """Where stiffnesses differ by orders and Newton's method may not finish, convergence is not claimed."""
    scene = contrast(1e12, across=True)
    result = solve(scene, subdomains=8, stop="error", error=1e-6, rescue_snes_max_it=1, max_it=1000)
    assert result.reason < 0


NO_EQUILIBRIUM = {
    "a rescue rests far away": (
        Draw(dim=3, nodes=11, extra=20, parts=3, cut="random", slack=0.0, skeleton=False, settled=True,
             prestrained=True, length=-2, force=-1, seed=64352),
        {"variant": "corner", "direction": "block", "promote": False},
    ),
    "an acceleration leaps": (
        Draw(dim=1, nodes=11, extra=9, parts=4, cut="blocks", slack=0.3, skeleton=False, settled=False,
             prestrained=False, rails=True, length=2, force=0, seed=159),
        {"variant": "macro", "direction": "schur", "modes": "rigid", "promote": False, "outer_snes_type": "ngmres"},
    ),
    "parts part": (
        Draw(dim=3, nodes=9, extra=0, parts=5, cut="random", slack=1.0, skeleton=False, settled=True,
             prestrained=False, rails=False, length=0, force=-3, seed=182),
        {"variant": "macro", "direction": "block", "modes": "rigid", "promote": False,
         "outer_snes_type": "nrichardson"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("rescue", [300, 0])
@pytest.mark.parametrize("case", [*list(NO_EQUILIBRIUM)[:-1], pytest.param("parts part", marks=pytest.mark.slow)])
def test_displacements_beyond_measure_are_no_solution(case, rescue):
    """A step that is small beside the way that nodes have drifted ends no solve: the loads still work on them."""
    draw, chosen = NO_EQUILIBRIUM[case]
    result = solve(draw.scene(), stop="error", error=1e-7, max_it=3000, rescue=rescue, **chosen)
    assert result.reason < 0


@pytest.mark.parametrize("stol", [1e-2, 1e-8])
@pytest.mark.parametrize("load", [1e8, 1e14])
def test_large_displacements_may_be_a_solution(load, stol):
    """A load of any size on a structure that holds it: the displacements are larger than it, and are found."""
    scene = irregular()
    scene = replace(scene, load=load * scene.load, prestrain=load * scene.prestrain)
    result = solve(scene, stol=stol)
    assert np.abs(result.u).max() > np.linalg.norm(np.ptp(scene.nodes, axis=0))
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 3.0 * stol


def test_a_polish_that_fails_before_a_rescue():
    """The iteration goes on after a polish that may take no step, stalls, and is rescued: no convergence in between."""
    scene = contrast(1e4)
    result = solve(
        scene, subdomains=8, stol=1e-9, polish=True, polish_start=1.0, polish_snes_max_it=1, polish_ksp_rtol=0.9
    )
    assert result.reason > 0
    assert unbalance(scene, result.u) < 1e-6


PROGRAM = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import numpy as np
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from test_rescue import contrast, hung
for name, scene in (("contrast", contrast(1e6)), ("hung", hung(1.0))):
    PETSc.Options()["snes_latin_subdomains"] = 8 if name == "contrast" else 2
    links = latinpc.Links.from_scene(scene)
    snes = links.create_snes()
    snes.setTolerances(stol=1e-8)
    snes.setFromOptions()
    u = links.create_vec()
    snes.solve(None, u)
    found = links.displacements(u)
    if links.comm.rank == 0:
        np.save(sys.argv[1] + "-" + name + ".npy", found)
    assert (snes.getConvergedReason() > 0) == (name == "contrast")
    assert latinpc.loose_nodes(snes) == ((0, []) if name == "contrast" else (1, [8]))
"""


def test_two_ranks(mpirun, tmp_path):
    """The number of ranks changes nothing but rounding, and every rank knows the nodes."""
    found = []
    for ranks in (1, 2):
        mpirun(ranks, PROGRAM, tmp_path / f"u{ranks}")
        found.append(np.load(tmp_path / f"u{ranks}-contrast.npy"))
    assert far(found[0], found[1]) < 1e-9


def test_misuse():
    """A negative number of stages is refused."""
    with pytest.raises(PETSc.Error) as caught:
        solve(grid(), rescue=-1)
    assert "less than allowed bound 0" in latinpc.error_message(caught.value)


def test_gaps_that_will_close_are_no_mechanism():
    """Grains between open gaps fall without resistance at first: the iteration is to find where they stop."""
    result = solve(make("packing", side=24, law="elastic", subdomains=4), stol=1e-4, rescue=30)
    assert result.reason > 0
