"""Newton's method finishes a solve, or takes over where the iteration stalls; nodes without support are named."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from random_structures import Draw
from support import chain, far, grid, irregular, latin, lattice, network, on_rails, settled, solve, unbalance

import latinpc
from latinpc.scenes import Law, Scene, make

REASON = PETSc.SNES.ConvergedReason

PROVED = {"stop": "error", "error": 1e-9, "max_it": 1000}


def bars():
    """Make a structure where no link becomes slack."""
    return grid("truss")


@pytest.mark.parametrize("variant", ["none", "macro", "corner"])
@pytest.mark.parametrize("make", [grid, irregular, network, lattice, bars, chain])
def test_ends_where_newton_ends(make, variant):
    """An error is proved: the displacements are as near to Newton's."""
    scene = make()
    result = solve(scene, variant=variant, **PROVED)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-8
    assert unbalance(scene, result.u) < 1e-6


@pytest.mark.parametrize("change", [settled, on_rails])
def test_prescribed_displacements(change):
    """Supports that move, and nodes held in some directions only."""
    scene = change(irregular())
    result = solve(scene, **PROVED)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-8


@pytest.mark.parametrize("make", [grid, irregular, network, lattice])
@pytest.mark.parametrize("stop", ["error", "energy"])
def test_a_proof_costs_few_linear_stages(make, stop):
    """Beside the iteration that an estimate alone ends."""
    scene = make()
    alone, proved = (solve(scene, stop=stop, error=1e-6, newton=when).iterations for when in ("never", "auto"))
    assert proved <= alone + 5


def test_linear_structures_take_one_solve():
    """Without a link that can become slack one Newton step reaches the tolerance."""
    with latin(bars(), **PROVED) as run:
        run.snes.solve(None, run.structure.create_vec())
        assert run.snes.getConvergedReason() > 0
        stages = run.snes.getLinearSolveIterations()
        assert 0 < stages < 25
        assert run.snes.getIterationNumber() == stages + len(latinpc.history(run.snes)["indicator"])


def test_a_cable_at_its_threshold():
    """A cable that is neither taut nor slack: zero strain in the solution, both tangents are right."""
    scene = chain(law=Law.BAR)
    u = oracle.newton(scene)
    b, e_d = oracle.kinematics(scene)
    strain = b @ np.where(scene.fixed, 0.0, u).ravel() + e_d
    law, initial_elongation, load = scene.law.copy(), scene.initial_elongation.copy(), scene.load.copy()
    law[7], initial_elongation[7] = Law.CABLE, -strain[7]
    tension = scene.stiffness[7] * (strain[7] + scene.initial_elongation[7])
    load[scene.links[7]] += np.array([[-tension], [tension]]) * np.array([[-1.0], [1.0]]) * [[-1.0], [-1.0]]
    degenerate = replace(scene, law=law, initial_elongation=initial_elongation, load=load)
    result = solve(degenerate, **PROVED)
    assert result.reason > 0
    assert far(result.u, oracle.newton(degenerate)) < 1e-8


def test_extra_load_of_one_solve():
    """F(x) = b reaches Newton's method too."""
    scene = network()
    extra = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    with latin(scene, **PROVED) as run:
        u, b = run.structure.create_vec(), run.structure.create_vec()
        run.structure.set_displacements(extra, b)
        run.snes.solve(b, u)
        assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=scene.load + extra))) < 1e-8


@pytest.mark.parametrize("stop", ["residual", "reference", "indicator"])
def test_other_stops(stop):
    """The nodal unbalance, the error against a reference, or the indicator, where the iteration is slow."""
    scene = contrast(1e6)
    reference = oracle.newton(scene)
    tolerance = {"residual": {"rtol": 1e-9}, "reference": {"stol": 1e-9}, "indicator": {"stol": 1e-9}}[stop]
    result = solve(scene, _reference=reference, subdomains=8, stop=stop, max_it=1000, **tolerance)
    assert result.reason > 0
    assert result.iterations > len(result.history.indicator)
    assert far(result.u, reference) < 1e-7


def test_iteration_goes_on_where_newton_fails():
    """Newton's method that may take no step leaves the work to the iteration, and the solution is the same."""
    scene = irregular()
    result = solve(scene, newton_snes_max_it=1, newton_ksp_rtol=0.9, **PROVED)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-7


def test_another_preconditioner():
    """Options reach the inner objects: a direct solver in place of ours, then a matrix is assembled."""
    scene = irregular()
    result = solve(scene, newton_ksp_type="preonly", newton_pc_type="cholesky", **PROVED)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-8


def test_new_load_and_new_initial_elongation():
    """The same object again, after a new load and after a new initial_elongation: nothing is built again."""
    scene = irregular()
    with latin(scene, **PROVED) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        for now in (
            replace(scene, load=0.5 * scene.load),
            replace(scene, initial_elongation=0.8 * scene.initial_elongation),
        ):
            run.structure.set_load(now.load)
            run.structure.set_initial_elongation(now.initial_elongation)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            assert far(run.structure.displacements(u), oracle.newton(now)) < 1e-8


FINISH = """
import sys
import numpy as np
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from latinpc.scenes import make
scene = make("tensegrity-grid", modules=8)
structure = latinpc.Structure.from_scene(scene)
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
assert snes.getConvergedReason() > 0
found = structure.displacements(u)
if structure.comm.rank == 0:
    np.save(sys.argv[1], found)
"""


def test_two_ranks_finish(mpirun, tmp_path):
    """The number of ranks changes nothing but rounding."""
    found = []
    for ranks in (1, 2):
        path = tmp_path / f"u{ranks}.npy"
        mpirun(ranks, FINISH, path, "-snes_latin_stop", "error", "-snes_latin_error", "1e-11")
        found.append(np.load(path))
    assert far(found[0], found[1]) < 1e-9


# ---- where the iteration stalls ----------------------------------------------------------------
def contrast(factor, across=False):
    """Make a network of which some links are `factor` times as stiff, the self-stress kept."""
    scene = make("network", nodes=100)
    if across:
        middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
        chosen = middle > np.median(scene.nodes[:, 0])
    else:
        chosen = np.random.default_rng(3).random(len(scene.links)) < 0.3
    stiffness = np.where(chosen, factor * scene.stiffness, scene.stiffness)
    return replace(
        scene, stiffness=stiffness, initial_elongation=scene.initial_elongation * scene.stiffness / stiffness
    )


@pytest.mark.parametrize("factor", [1e4, 1e8, 1e-4, 1e-8])
@pytest.mark.parametrize("across", [False, True])
def test_contrasts_between_links(across, factor):
    """Stiff or soft links, inside subdomains or in half of them: every node is in balance, every law is met."""
    scene = contrast(factor, across)
    result = solve(scene, subdomains=8, stol=1e-8, max_it=1000)
    assert result.reason > 0
    assert unbalance(scene, result.u) < 1e-6
    assert result.iterations < 300


@pytest.mark.parametrize("factor", [1e6, 1e10])
def test_an_indicator_proves_nothing_beside_stiff_links(factor):
    """The soft half moves little from stage to stage, so that the indicator is small: Newton's method follows."""
    scene = contrast(factor, across=True)
    result = solve(scene, stop="indicator", stol=1e-4)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-6


def test_the_iteration_alone_stalls():
    """Newton's method is needed: without, the same structure is far from its solution after 500 linear stages."""
    scene = contrast(1e6)
    helped = solve(scene, subdomains=8, stol=1e-8)
    alone = solve(scene, subdomains=8, stol=1e-8, newton="never", max_it=500)
    assert alone.reason == REASON.DIVERGED_MAX_IT
    assert helped.reason > 0
    assert far(alone.u, helped.u) > 1e-2


@pytest.mark.parametrize("limit", [11, 12])
def test_a_limit_of_stages_leaves_none_for_a_proof(limit):
    """-snes_max_it reached: no search for a collapse, whose stages are the same again and more."""
    result = solve(make("network", nodes=200), max_it=limit)
    assert result.reason == REASON.DIVERGED_MAX_IT
    assert result.iterations <= limit + 1


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_a_linear_solve_ends_at_the_limit_of_stages():
    """-snes_max_it counts the iterations of a linear solve of Newton's method as it goes on: here it takes hundreds."""
    scene = make("tensegrity-grid", modules=24)
    result = solve(replace(scene, load=1e4 * scene.load), max_it=100)
    assert result.reason == REASON.DIVERGED_MAX_IT
    assert result.iterations <= 101


@pytest.mark.parametrize("make_scene", [grid, irregular])
def test_is_not_called_where_the_iteration_converges(make_scene):
    """Scenes of like stiffnesses: the same iterates with and without, bit for bit, and nothing is built for it."""
    scene = make_scene()
    runs = [solve(scene, stol=1e-7, newton=when) for when in ("auto", "never")]
    assert runs[0].iterations == runs[1].iterations == len(runs[0].history.indicator)
    assert (runs[0].u == runs[1].u).all()


def test_a_slow_iteration_is_handed_over():
    """A search direction far off the mark: the plain iteration would need thousands of stages."""
    scene = grid()
    off = {"direction": "diagonal", "direction_value": 1e4, "outer_snes_type": "nrichardson", "stol": 1e-8}
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
        run.snes.solve(None, run.structure.create_vec())
        assert run.snes.getConvergedReason() == REASON.DIVERGED_DTOL
        assert latinpc.unsupported_nodes(run.snes) == (1, [8])
    with latin(hung(-force), stol=1e-8) as run:
        run.snes.solve(None, run.structure.create_vec())
        assert run.snes.getConvergedReason() > 0
        assert latinpc.unsupported_nodes(run.snes) == (0, [])


def test_no_convergence_without_proof():
    """Where stiffnesses differ by orders and Newton's method may not finish, convergence is not claimed."""
    scene = contrast(1e12, across=True)
    result = solve(scene, subdomains=8, stop="error", error=1e-6, newton_snes_max_it=1, max_it=1000)
    assert result.reason < 0


NO_EQUILIBRIUM = {
    "Newton's method rests far away": (
        Draw(dim=3, nodes=11, extra=20, parts=3, cut="random", slack=0.0, skeleton=False, settled=True,
             prestressed=True, length=-2, force=-1, seed=64352),
        {"variant": "corner", "direction": "block"},
    ),
    "an acceleration leaps": (
        Draw(dim=1, nodes=11, extra=9, parts=4, cut="blocks", slack=0.3, skeleton=False, settled=False,
             prestressed=False, rails=True, length=2, force=0, seed=159),
        {"variant": "macro", "direction": "schur", "modes": "rigid", "outer_snes_type": "ngmres"},
    ),
    "parts part": (
        Draw(dim=3, nodes=9, extra=0, parts=5, cut="random", slack=1.0, skeleton=False, settled=True,
             prestressed=False, rails=False, length=0, force=-3, seed=182),
        {"variant": "macro", "direction": "block", "modes": "rigid",
         "outer_snes_type": "nrichardson"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("newton", ["auto", "never"])
@pytest.mark.parametrize("case", [*list(NO_EQUILIBRIUM)[:-1], pytest.param("parts part", marks=pytest.mark.slow)])
def test_displacements_beyond_measure_are_no_solution(case, newton):
    """A step that is small beside the way that nodes have drifted ends no solve: the loads still work on them."""
    draw, chosen = NO_EQUILIBRIUM[case]
    result = solve(draw.scene(), stop="error", error=1e-7, max_it=3000, newton=newton, **chosen)
    assert result.reason < 0


@pytest.mark.parametrize("stol", [1e-2, 1e-8])
@pytest.mark.parametrize("load", [1e8, 1e14])
def test_large_displacements_may_be_a_solution(load, stol):
    """A load of any size on a structure that holds it: the displacements are larger than it, and are found."""
    scene = irregular()
    scene = replace(scene, load=load * scene.load, initial_elongation=load * scene.initial_elongation)
    result = solve(scene, stol=stol)
    assert np.abs(result.u).max() > np.linalg.norm(np.ptp(scene.nodes, axis=0))
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 3.0 * stol


STALL = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import numpy as np
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from test_newton import contrast, hung
for name, scene in (("contrast", contrast(1e6)), ("hung", hung(1.0))):
    PETSc.Options()["snes_latin_subdomains"] = 8 if name == "contrast" else 2
    structure = latinpc.Structure.from_scene(scene)
    snes = structure.create_snes()
    snes.setTolerances(stol=1e-8)
    snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    found = structure.displacements(u)
    if structure.comm.rank == 0:
        np.save(sys.argv[1] + "-" + name + ".npy", found)
    assert (snes.getConvergedReason() > 0) == (name == "contrast")
    assert latinpc.unsupported_nodes(snes) == ((0, []) if name == "contrast" else (1, [8]))
"""


def test_two_ranks_stall(mpirun, tmp_path):
    """The number of ranks changes nothing but rounding, and every rank knows the nodes."""
    found = []
    for ranks in (1, 2):
        mpirun(ranks, STALL, tmp_path / f"u{ranks}")
        found.append(np.load(tmp_path / f"u{ranks}-contrast.npy"))
    assert far(found[0], found[1]) < 1e-9


def test_an_unknown_choice_is_refused():
    """By options with PETSc's own words, in Python with the names that there are."""
    with pytest.raises(PETSc.Error):
        solve(grid(), newton="sometimes")
    with latin(grid()) as run, pytest.raises(ValueError, match="never"):
        latinpc.set_newton(run.snes, "sometimes")


def test_gaps_that_will_close_are_no_mechanism():
    """Grains between open gaps fall without resistance at first: Newton's method is to find where they stop."""
    scene = make("packing", side=8, law="elastic", subdomains=4)
    with latin(scene, stol=1e-4, outer_snes_type="nrichardson") as run:  # which is slow: it hands over while they fall
        run.snes.solve(None, run.structure.create_vec())
        assert run.snes.getConvergedReason() > 0
        assert run.snes.getLinearSolveIterations() > 0


@pytest.mark.parametrize("error", [1e-4, 1e-8])
@pytest.mark.parametrize("force", 10.0 ** np.arange(3, -7, -1))
def test_a_load_that_is_small_beside_the_slack(force, error):
    """One node between two cables that are slack at rest: one of them must bear the load, however small."""
    scene = Scene(
        name="window", nodes=[[0.0], [1.0], [-1.6]], links=[[0, 1], [0, 2]], law=[Law.CABLE] * 2,
        stiffness=[1e6, 1e6], initial_elongation=[0.001, -0.003], fixed=[[False], [True], [True]],
        load=[[force], [0.0], [0.0]], subdomain=[0, 0],
    )  # fmt: skip
    result = solve(scene, stop="error", error=error)
    assert result.reason > 0
    assert far(result.u, np.array([[0.003 + force / 1e6], [0.0], [0.0]])) <= error


def test_taut_links_that_leave_a_mechanism_end_no_solve():
    """Links 1e8 times as stiff as others are slack at times: a step of Newton's method then meets a mechanism."""
    nodes = [[0.342, 0.013], [0.115, 0.802], [-0.108, 1.981], [0.907, -0.147], [1.315, 1.196], [0.975, 2.060]]
    links = [[0, 1], [1, 2], [0, 3], [1, 3], [0, 4], [1, 4], [2, 4], [3, 4], [1, 5], [2, 5], [4, 5]]
    load = np.zeros((6, 2))
    load[3:] = [[1.9e-5, -7.5e-5], [-2.4e-4, -6e-6], [-2.5e-5, -8.3e-5]]
    scene = Scene(
        name="hidden", nodes=nodes, links=links, law=[2, 2, 1, 0, 2, 2, 0, 0, 0, 2, 0],
        stiffness=np.where(np.isin(np.arange(11), (2, 6, 7, 9)), 1e7, 0.1), load=load,
        fixed=np.repeat([True, False], 3)[:, None] * [True, True], subdomain=np.zeros(11, int),
    )  # fmt: skip
    result = solve(scene, stop="error", error=1e-8)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-7


def test_an_estimate_is_no_proof():
    """Of a structure on which the estimated error is a thirteenth of the true one."""
    draw = Draw(dim=3, nodes=11, extra=0, parts=2, cut="random", slack=0.0, seed=15103)
    chosen = {"direction": "scalar", "modes": "affine", "outer_snes_type": "ngmres", "variant": "corner"}
    result = solve(draw.scene(), stop="error", error=1e-7, max_it=3000, **chosen)
    assert result.reason > 0
    assert far(result.u, oracle.newton(draw.scene())) < 1e-7


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_no_vector_is_left_behind(mpirun, ranks, tmp_path):
    """As many are destroyed as have been made, though the last steps look at residuals again and again."""
    log = tmp_path / "log"
    program = (
        "import petsc4py, sys\npetsc4py.init(sys.argv)\nimport latinpc\nfrom latinpc.scenes import make\n"
        "for _ in range(2):\n    make('tensegrity-grid', modules=32, partition='metis').solve()\n"
    )
    mpirun(ranks, program, "-log_view", f":{log}", alone=True)
    made, destroyed = re.search(r"^ *Vector +(\d+) +(\d+)", log.read_text(), re.MULTILINE).groups()
    assert int(made) > 50
    assert made == destroyed
