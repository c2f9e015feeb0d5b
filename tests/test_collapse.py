"""Structures without an equilibrium: the proof of it, what it costs, and that solvable ones have none."""

import ast
from dataclasses import replace

import numpy as np
import pytest
from petsc4py import PETSc
from scipy.optimize import linprog, nnls
from support import grid, latin, lattice, solve

import latinpc
from latinpc.bench.extremes.drawn import draw
from latinpc.bench.extremes.rating import judge
from latinpc.bench.peers.qp import kinematics
from latinpc.scenes import Law, make

Reason = PETSc.SNES.ConvergedReason
BOTH, COMPRESSION = (Law.BAR,), (Law.COMPRESSION_ONLY, Law.CONTACT)


def cables(scene, share, seed=0):
    """Make a share of the links cables that are slack at rest under any pressure, and take the prestress off."""
    chosen = np.random.default_rng(seed).random(len(scene.links)) < share
    return replace(scene, law=np.where(chosen, Law.CABLE, scene.law), initial_elongation=0 * scene.initial_elongation)


def kind(name, **how):
    """Make structures of several kinds."""
    return {"network": lambda: replace(make("network", nodes=150, **how), subdomain=None), "lattice": lattice,
            "grid": grid, "net": lambda: replace(make("net", side=6), subdomain=None),
            "chain": lambda: replace(make("chain", links=24), subdomain=None)}[name]()  # fmt: skip


def has_equilibrium(scene, loads=None):
    """Ask a linear program for tensions that their laws admit and that bear the loads."""
    B, _ = kinematics(scene)
    force = (scene.load if loads is None else loads)[~scene.fixed]
    bounds = [(None, None) if law in BOTH else (None, 0) if law in COMPRESSION else (0, None) for law in scene.law]
    found = linprog(np.zeros(len(bounds)), A_eq=B.T, b_eq=force / np.abs(force).max(), bounds=bounds, method="highs")
    assert found.status in (0, 2)
    return found.status == 0


def ended(scene, **options):
    """How SNES latin ends: reason, nodes that nothing holds, linear stages and what is among them."""
    with latin(scene, **options) as run:
        run.snes.solve(None, run.structure.create_vec())
        return (run.snes.getConvergedReason(), latinpc.unsupported_nodes(run.snes), run.snes.getIterationNumber(),
                run.snes.getLinearSolveIterations(), len(latinpc.history(run.snes)["indicator"]))  # fmt: skip


@pytest.mark.parametrize("name", ["network", "lattice", "grid", "net", "chain"])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_refusal_is_right(name, share, turned):
    """With the loads and against them: what a linear program says, in few linear stages."""
    scene = kind(name)
    scene = cables(scene, share) if name not in ("net", "chain") else scene
    scene = replace(scene, load=-scene.load) if turned else scene
    if (scene.law == Law.BAR).all():
        return
    reason, (count, nodes), iterations, _, _ = ended(scene)
    assert (reason > 0) == has_equilibrium(scene)
    if reason < 0:
        assert reason == Reason.DIVERGED_DTOL
        assert count >= len(nodes) > 0
        assert iterations < 250


def borne(seed, share):
    """Make a network with loads of random admissible tensions, of which half of those of the cables are zero."""
    rng = np.random.default_rng(seed)
    scene = cables(kind("network"), share, seed)
    tension = 10.0 ** rng.uniform(-6, 0, len(scene.links)) * np.where(
        scene.law == Law.BAR, rng.choice([-1, 1], len(scene.links)), rng.random(len(scene.links)) < 0.5
    )
    load = np.zeros(scene.nodes.shape)
    load[~scene.fixed] = 1e3 * kinematics(scene)[0].T @ tension
    return replace(scene, load=load)


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_loads_that_tensions_bear_are_not_refused(seed, share):
    """There is an equilibrium, though cables alone do not tell its displacements."""
    reason, told, _, _, _ = ended(borne(seed, share))
    assert reason > 0 or (reason == Reason.DIVERGED_MAX_IT and share == 1.0)
    assert told == (0, []) or reason < 0


def test_the_refusal_does_not_depend_on_units():
    """Loads, stiffnesses and lengths a million times as large: the same nodes by the same iterations, about."""
    scene = cables(kind("network"), 0.6)
    first = ended(scene)
    assert first[0] == Reason.DIVERGED_DTOL
    for load, stiffness, length in ((1e6, 1, 1), (1, 1e6, 1), (1, 1, 1e6), (1e-6, 1e6, 1e-6)):
        scaled = replace(scene, load=load * scene.load, stiffness=stiffness * scene.stiffness,
                         nodes=length * scene.nodes)  # fmt: skip
        other = ended(scaled)
        assert other[:2] == first[:2]
        assert abs(other[2] - first[2]) < 10


RANKS = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
import numpy as np
from latinpc.scenes import Law, make
scene = make("network", nodes=150)
scene.subdomain = None
scene.law[np.random.default_rng(0).random(len(scene.links)) < 0.6] = Law.CABLE
scene.initial_elongation[:] = 0.0
structure = latinpc.Structure.from_scene(scene)
snes = structure.create_snes()
snes.setFromOptions()
snes.solve(None, structure.create_vec())
found = latinpc.unsupported_nodes(snes)
if structure.comm.rank == 0:
    open(sys.argv[1], "w").write(f"{snes.getConvergedReason()} {found}")
"""


def test_ranks_agree(mpirun, tmp_path):
    """On 1, 2 and 4 ranks: the same nodes."""
    found = []
    for ranks in (1, 2, 4):
        mpirun(ranks, RANKS, tmp_path / f"{ranks}", "-snes_latin_subdomains", 4)
        found.append((tmp_path / f"{ranks}").read_text())
    assert found[0].startswith(str(Reason.DIVERGED_DTOL))
    assert found[0] == found[1] == found[2]


def loose(scene):
    """Nodes whose own links do not bear their load, by non-negative least squares."""
    found, at = [], [[] for _ in scene.nodes]
    for (first, second), law, along in zip(scene.links, scene.law, scene.directions, strict=True):
        for end, pull in ((first, along), (second, -along)):
            at[end] += [] if law in COMPRESSION else [pull]
            at[end] += [-pull] if law in (*BOTH, *COMPRESSION) else []
    for node, load in enumerate(scene.load):
        free = ~scene.fixed[node]
        if load[free].any() and nnls(np.array(at[node]).T[free], -load[free])[1] > 1e-9 * np.linalg.norm(load):
            found.append(node)
    return found


def parts(nodes, seed):
    """Make a network cut loose that has bars again at all nodes that their own links do not hold."""
    scene = cables(replace(make("network", nodes=nodes, seed=seed), subdomain=None), 0.6, seed)
    bars = np.isin(scene.links, loose(scene)).any(axis=1)
    return replace(scene, law=np.where(bars, Law.BAR, scene.law))


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_a_node_by_itself(dim):
    """One free node, fixed in some directions or none: refused where its links do not bear its load."""
    rng = np.random.default_rng(dim)
    laws, ends = [Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY], set()
    for _ in range(60):
        m = int(rng.integers(dim + 1, 8))
        fixed = np.ones((m + 1, dim), bool)
        fixed[0] = rng.random(dim) < 0.2
        fixed[0, 0] = False
        scene = replace(
            make("chain", links=2), name="node", nodes=np.vstack([np.zeros(dim), rng.normal(size=(m, dim))]),
            links=np.column_stack([np.zeros(m, int), np.arange(1, m + 1)])[:, :: rng.choice([-1, 1])],
            law=rng.choice(laws, m, p=[0.1, 0.5, 0.4]), stiffness=10.0 ** rng.uniform(2, 4, m), direction=None,
            initial_elongation=np.zeros(m), fixed=fixed, prescribed=np.zeros((m + 1, dim)), subdomain=None,
            load=np.where(fixed, 0.0, rng.normal(size=(m + 1, dim))), metadata={},
        )  # fmt: skip
        reason, told, _, _, _ = ended(scene)
        assert (reason > 0) == (not loose(scene)) == has_equilibrium(scene)
        assert told == ((0, []) if reason > 0 else (1, [0]))
        ends.add(reason > 0)
    assert len(ends) == 2


@pytest.mark.parametrize("name", ["network", "grid"])
def test_loose_nodes_are_refused_without_a_factorisation(name):
    """Those that linear programs of single nodes find, by no iteration of Newton's method."""
    scene = cables(kind(name), 0.7, 5)
    found = loose(scene)
    reason, (count, nodes), _, linear, _ = ended(scene)
    assert reason == Reason.DIVERGED_DTOL
    assert linear == 0
    assert (count, nodes) == (len(found), found[:8])


def patches(scene):
    """Nodes of loose patches, a node and those at its links with all others held, by non-negative least squares."""
    at, moves = [[] for _ in scene.nodes], set()
    B, _ = kinematics(scene)
    column = np.full(scene.fixed.shape, -1)
    column[~scene.fixed] = np.arange(B.shape[1])
    rows = [B[:, column[node][column[node] >= 0]].nonzero()[0] for node in range(len(scene.nodes))]
    for first, second in scene.links:
        at[first].append(second)
        at[second].append(first)
    for node, beside in enumerate(at):
        unknowns = column[[node, *beside]]
        nodes = np.repeat([node, *beside], unknowns.shape[1])[unknowns.ravel() >= 0]
        unknowns = unknowns[unknowns >= 0]
        links = np.unique(np.concatenate([rows[near] for near in (node, *beside)]))
        pulls, load = B[links][:, unknowns].toarray(), scene.load[~scene.fixed][unknowns]
        pulls = np.vstack([pulls, -pulls[np.isin(scene.law[links], BOTH)]])
        tension, left = nnls(pulls.T, load, maxiter=1000)
        if left > 1e-9 * np.linalg.norm(load):
            d = load - pulls.T @ tension
            moves |= set(nodes[np.abs(d) > 1e-6 * np.abs(d).max()].tolist())
    return moves


def test_a_patch_that_is_loose():
    """No node is loose by itself: a linear program says the same of the structure, and few iterations find a patch."""
    scene = parts(300, 102)
    assert not loose(scene)
    assert not has_equilibrium(scene)
    reason, (count, nodes), iterations, _, _ = ended(scene)
    assert reason == Reason.DIVERGED_DTOL
    assert 0 < count == len(nodes)
    assert set(nodes) <= patches(scene)
    assert iterations < 80


def test_patches_that_hold_prove_nothing():
    """A network that is loose as a whole: the interior-point method moves more nodes than patches have."""
    scene = parts(300, 207)
    assert not loose(scene)
    assert not patches(scene)
    assert not has_equilibrium(scene)
    reason, (count, _), iterations, _, _ = ended(scene)
    assert reason == Reason.DIVERGED_DTOL
    assert count > 20
    assert iterations < 200


def test_ranks_find_patches(mpirun, tmp_path):
    """On one rank and on three, which have all links of most nodes: nodes of loose patches."""
    scene = parts(300, 102)
    moves = patches(scene)
    np.save(tmp_path / "law.npy", scene.law)
    program = RANKS.replace("nodes=150", "nodes=300, seed=102").replace(
        "scene.law[np.random.default_rng(0).random(len(scene.links)) < 0.6] = Law.CABLE",
        "scene.law[:] = np.load(sys.argv[1] + '.npy')",
    )
    for ranks in (1, 3):
        (tmp_path / f"{ranks}.npy").write_bytes((tmp_path / "law.npy").read_bytes())
        mpirun(ranks, program, tmp_path / f"{ranks}", "-snes_latin_subdomains", 3)
        reason, count, nodes = (tmp_path / f"{ranks}").read_text().split(" ", 2)
        assert reason == str(Reason.DIVERGED_DTOL)
        assert set(ast.literal_eval(f"{count} {nodes}")[1]) <= moves


@pytest.mark.parametrize(("load", "refused"), [(1.0, True), (1e-13, False)])
def test_a_load_less_than_the_tensions_beside_it_proves_nothing(load, refused):
    """Cables whose tension, from elsewhere, holds a node by an angle of 1e-12; the structure beside has no end soon."""
    scene = borne(0, 1.0)
    scene = replace(scene, load=scene.load / np.abs(scene.load).max())
    n = len(scene.nodes)
    more = [
        [-1, -1e-12, 0],
        [0, 0, 0],
        [1, -1e-12, 0],
        [0, 1, 0],
    ]  # a chain of three nodes, and a cable up from the middle
    fixed = np.ones((4, 3), bool)
    fixed[1, :2] = fixed[2, 0] = False
    force = np.zeros((4, 3))
    force[1, 1], force[2, 0] = load, 1.0
    links = n + np.array([[0, 1], [1, 2], [1, 3]])
    fields = {name: getattr(scene, name) for name in ("stiffness", "initial_elongation")}
    scene = replace(
        scene, nodes=np.vstack([scene.nodes, more]), links=np.vstack([scene.links, links]),
        law=np.append(scene.law, [Law.CABLE] * 3), fixed=np.vstack([scene.fixed, fixed]),
        prescribed=np.vstack([scene.prescribed, 0.0 * force]), load=np.vstack([scene.load, force]),
        **{name: np.append(field, np.full(3, np.median(field))) for name, field in fields.items()},
    )  # fmt: skip
    reason, (_, nodes), _, _, _ = ended(scene, max_it=400)
    assert (reason == Reason.DIVERGED_DTOL) == refused
    assert (n + 1 in nodes) == refused


def test_the_number_of_steps_hardly_depends_on_the_size():
    """From 800 to 6,500 unknowns: no 200 steps of Newton's method."""
    for nodes in (300, 2400):
        scene = cables(replace(make("network", nodes=nodes), subdomain=None), 0.6)
        reason, _, iterations, linear, stages = ended(scene)
        assert reason == Reason.DIVERGED_DTOL
        assert iterations == stages + linear
        assert iterations < 200


def test_iterations_of_newtons_method_that_fails_are_counted():
    """Linear iterations of a method that has not solved the problem are among those reported, and limited."""
    scene = borne(5, 1.0)
    _, _, iterations, linear, stages = ended(scene)
    assert linear > 200
    assert iterations == stages + linear
    reason, _, fewer, linear, stages = ended(scene, max_it=150)
    assert reason == Reason.DIVERGED_MAX_IT
    assert fewer == stages + linear
    assert 150 <= fewer < 300  # interior-point steps, and a linear solve, go to their end


def test_a_step_on_a_mechanism_is_made_again_with_a_larger_floor():
    """Taut links that are a mechanism to rounding, a structure of contacts: the next operator is another one."""
    drawn = draw(31, 467)
    assert drawn.family == "rigid"
    assert not has_equilibrium(drawn.scene)
    reason, (count, _), iterations, _, _ = ended(drawn.scene)
    assert reason == Reason.DIVERGED_DTOL
    assert count
    assert iterations < 500


@pytest.mark.parametrize("number", [18, 104, 135, 793, 2430, 2557])
def test_loads_that_exceed_collapse_by_little_beside_prestress_are_refused(number):
    """By 1e-6 to 1e-4 of loads that are small beside prestress: operators of the tangent show the soft mode."""
    scene = draw(272727, number, "collapse").scene
    assert not has_equilibrium(scene)
    reason, (count, nodes), iterations, _, _ = ended(scene)
    assert reason == Reason.DIVERGED_DTOL
    assert count and nodes
    assert iterations < 500


def test_equal_steps_are_no_error():
    """Next to collapse steps may creep back along a soft mode from far out, each of them small beside the way to go."""
    result = solve(draw(20261130, 4722).scene)
    assert result.reason > 0
    assert abs(result.u).max() < 3e-6


def test_a_soft_node_that_creeps_behind_stiffer_ones():
    """The forces of stiff links hide that of a node which goes on to a cable: one small step proves nothing."""
    assert judge(draw(855470730, 7926), {})["verdict"] in ("right", "unsolved")  # as factors are rounded


def test_links_that_yield_bear_what_they_yield_at():
    """Bars that bear a force without resisting: loads beyond it are refused, and only these."""
    from latinpc.bench.extremes.rigid import tabulated

    for factor, solvable in ((1.0, True), (1e-3, True), (0.0, False)):
        result = solve(tabulated(factor))
        assert (result.reason > 0) == solvable


def test_other_solvers_that_diverge_say_nothing_of_the_structure():
    """Nonlinear Richardson without a preconditioner: its residual grows on a structure that stands."""
    scene = make("lattice")
    with pytest.warns(latinpc.ConvergenceWarning, match=r"the unbalanced forces grow without end \(DIVERGED_DTOL\)"):
        found = scene.solve(options={"snes_type": "nrichardson"})
    assert found.report["reason"] == "DIVERGED_DTOL" and scene.solve().converged
