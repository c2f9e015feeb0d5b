"""Links that yield or harden, as tables: a linear program says which loads are borne, and balance that they are."""

import ctypes
import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from scipy.optimize import linprog

import latinpc
from latinpc.bench.peers.qp import kinematics
from latinpc.results import mechanics
from latinpc.scenes import Law, Scene

BAR, CABLE, FIRST = int(Law.BAR), int(Law.CABLE), len(Law)
TIES, CONTACT = int(Law.INEXTENSIBLE), int(Law.CONTACT)
TABLES = (
    ([-2.0, -1.0, 1.0, 2.0], [-1.0, -1.0, 1.0, 1.0]),  # yields
    ([-2.0, -1.0, 0.0, 1.3, 2.3], [-1.001, -1.0, 0.0, 1.5, 1.501]),  # hardens a little
    ([-1.0, 0.0, 0.2, 1.0], [0.0, 0.0, 1.0, 1.0]),  # a cable that yields
    ([-0.2, -0.1, 0.0, 1.0], [-3.0, -3.0, 0.0, 0.0]),  # a support that is crushed
    ([-2.0, -0.5, 0.5, 2.0], [-1.0, 0.0, 0.0, 1.0]),  # a gap
    ([-1.0, 0.0, 0.1, 0.5, 0.6], [-1.0, 0.0, 0.5, 0.5, 2.0]),  # a plateau
    ([-1.0, -0.5, 0.5, 1.0], [0.2, 0.2, 0.8, 0.8]),  # always pulls
)
BOUNDS = ((-1.0, 1.0), (None, None), (0.0, 1.0), (-3.0, 0.0), (None, None), (None, None), (0.2, 0.8))


def drawn(seed):
    """Make points in a plane, each joined to its nearest ones by links of three of the laws."""
    rng = np.random.default_rng(seed)
    count = int(rng.choice([5, 8, 16, 30]))
    nodes = rng.uniform(0.0, np.sqrt(count), (count, 2))
    near = np.linalg.norm(nodes[:, None] - nodes, axis=-1).argsort(axis=1)[:, 1 : int(rng.integers(4, 6))]
    links = np.unique(np.sort([(i, j) for i in range(count) for j in near[i]], axis=1), axis=0)
    laws = rng.choice([BAR, CABLE, *range(FIRST, FIRST + len(TABLES))], 3, replace=False)
    law = rng.choice(laws, len(links))
    fixed = np.zeros((count, 2), bool)
    fixed[rng.choice(count, 2 + count // 6, replace=False)] = True
    load = np.where(fixed, 0.0, rng.normal(size=(count, 2)))
    return Scene(
        name="yielding", nodes=nodes, links=links, law=law, stiffness=np.where(law < FIRST, 1.0, 0.0), fixed=fixed,
        initial_elongation=rng.choice([0.0, 0.3]) * rng.normal(size=len(links)), load=load, tables=TABLES,
    )  # fmt: skip


def beside_rigid(scene):
    """Replace some of the links by cables that cannot stretch, or by contacts, slack as drawn."""
    rng = np.random.default_rng(len(scene.links))
    rigid = rng.choice([0, TIES, CONTACT], len(scene.links), p=[0.6, 0.2, 0.2])
    gap = rng.choice([0.0, 0.1]) * rng.random(len(rigid)) * np.where(rigid == TIES, -1.0, 1.0)
    return replace(
        scene, law=np.where(rigid, rigid, scene.law), stiffness=np.where(rigid, 0.0, scene.stiffness),
        initial_elongation=np.where(rigid, gap, scene.initial_elongation),
    )  # fmt: skip


def limits(scene):
    """Return the least and the greatest factor of the loads that tensions between their bounds balance, None: none."""
    B, _ = kinematics(scene)
    A = np.column_stack([B.T.toarray(), -scene.load[~scene.fixed]])
    of = {BAR: (None, None), CABLE: (0.0, None), TIES: (0.0, None), CONTACT: (None, 0.0)}
    bounds = [of[law] if law < FIRST else BOUNDS[law - FIRST] for law in scene.law] + [(None, None)]
    found = []
    for sign in (1.0, -1.0):
        program = linprog([0.0] * len(scene.law) + [sign], A_eq=A, b_eq=np.zeros(len(A)), bounds=bounds)
        if program.status == 2:
            return None
        found.append(program.x[-1] if program.status == 0 else -sign * np.inf)
    return found


def cases(seeds, rigid):
    """Yield structures with loads near their limits on both sides: number, structure, whether they are borne."""
    for seed in seeds:
        scene = beside_rigid(drawn(seed)) if rigid else drawn(seed)
        if np.linalg.matrix_rank(kinematics(scene)[0].toarray()) < (~scene.fixed).sum():
            continue
        ends = limits(scene)
        for part in (0.5, 0.9, 0.999, 1.001, 1.1, 3.0):
            least, most = ends or (0.0, 1.0)
            if not np.isfinite(most) or most - least < 1e-9:
                continue  # no limit on this side, or one load alone
            factor = (least if np.isfinite(least) else min(0.0, 2.0 * most)) * (1.0 - part) + most * part
            if abs(factor) < 1e-6:  # no load
                continue
            yield seed, part, replace(scene, load=factor * scene.load), ends is not None and part < 1.0


def tensions(scene, elongation):
    """Return what points say, and straight lines beyond them."""
    x = elongation + scene.initial_elongation
    found = np.where(scene.law == CABLE, np.maximum(x, 0.0), x)
    for i, (at, force) in enumerate(TABLES):
        own = scene.law == FIRST + i
        low, high = np.polyfit(at[:2], force[:2], 1), np.polyfit(at[-2:], force[-2:], 1)
        ends = [x[own] < at[0], x[own] > at[-1]]
        found[own] = np.select(ends, [np.polyval(low, x[own]), np.polyval(high, x[own])], np.interp(x[own], at, force))
    return found


def mistakes(seeds, comm, rigid=False):
    """Solve; return what is wrong: loads that are borne and refused, and what is called an equilibrium and is none."""
    found, count = [], 0
    for seed, part, scene, borne in cases(seeds, rigid):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # displacements are large beside the structure
            result = latinpc.Structure.from_scene(scene, comm=comm).solve()
        if comm.rank:
            continue
        count += 1
        refused = any(text.startswith("no equilibrium") for text in result.notices)
        if borne and result.converged:
            B, _ = kinematics(scene)
            force = scene.load[~scene.fixed]
            moved = mechanics.elongations(scene, result.displacements)
            stiff = np.isin(scene.law, (TIES, CONTACT))
            own = np.where(stiff, result.tensions, tensions(scene, moved))
            beyond = np.where(scene.law == TIES, 1.0, -1.0) * (moved + scene.initial_elongation)
            kept = beyond[stiff].max(initial=0.0) <= 1e-3 * abs(moved).max()
            balanced = kept and np.linalg.norm(B.T @ own - force) <= 1e-2 * np.linalg.norm(force)
            if not balanced or abs(own - result.tensions).max() > 1e-6 * abs(own).max():
                found.append([seed, part, "wrong"])
        elif borne or result.converged or not refused:
            found.append([seed, part, result.reason])
    return count, found


def test_what_is_borne_is_solved_and_what_is_not_collapses():
    count, found = mistakes(range(60), PETSc.COMM_SELF)
    assert count > 150
    assert not found


def test_the_same_beside_rigid_links():
    seeds = [*range(60), 207, 366]  # these two need full steps of Newton's method after searched ones
    count, found = mistakes(seeds, PETSc.COMM_SELF, rigid=True)
    assert count > 100
    assert not found


PROGRAM = """
import json, sys
sys.path.insert(0, sys.argv[2])
from petsc4py import PETSc
from test_yielding import mistakes
found = mistakes(range(100, 120), PETSc.COMM_WORLD)
if not PETSc.COMM_WORLD.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_the_same_on_ranks(mpirun, tmp_path, ranks):
    mpirun(ranks, PROGRAM, tmp_path / "found.json", Path(__file__).parent)
    count, found = json.loads((tmp_path / "found.json").read_text())
    assert count > 50
    assert not found


CALL = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_void_p)
SATURATES = [  # tension, tangent, energy; they live as long as the structures
    CALL(lambda k, x, context: k * np.tanh(x)),
    CALL(lambda k, x, context: k * (1.0 - np.tanh(x) ** 2)),
    CALL(lambda k, x, context: k * np.logaddexp(x, -x)),
]


@pytest.mark.filterwarnings("ignore")  # displacements are large beside the structure
@pytest.mark.parametrize(("load", "borne"), [(29.9, True), (30.1, False)])
def test_a_law_of_the_user_that_yields(load, borne):
    """Two links in parallel on each side, which bear at most 10 and 5 N."""
    law = latinpc.register_law("saturates", *SATURATES)
    found = latinpc.Structure(
        [[0.0], [1.0], [2.0]], [[0, 1], [0, 1], [1, 2], [1, 2]], law, [10.0, 5.0, 10.0, 5.0], fixed=[[1], [0], [1]],
        load=[[0.0], [load], [0.0]], comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert found.converged == borne
    assert borne != ("no equilibrium: links that are slack or yield no longer hold node 1" in found.notices)


@pytest.mark.filterwarnings("ignore")  # displacements are large beside the structure
@pytest.mark.parametrize(("load", "borne"), [(21.998, True), (22.002, False)])
def test_a_link_that_yields_beside_a_contact(load, borne):
    """Next to the limit each step is as long as the last one, and soon short beside the displacements."""
    yields = latinpc.register_table([-0.6, 0.0, 0.6, 1.2], [0.0, 0.0, 22.0, 22.0], "yields beside a contact")
    found = latinpc.Structure(
        [[1.1], [2.9], [0.8]], [[0, 1], [0, 2], [1, 2]], ["compression_only", "contact", yields], [3.6, 0.0, 0.0],
        initial_elongation=[0.07, 1.9, -0.17], fixed=[[0], [1], [0]], load=[[8.6], [0.0], [-load]],
        comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert found.converged == borne
    named = ("no equilibrium", "rounding hides what the loads do")  # 5e-5 beyond the limit rounding may come first
    assert borne != any(text.startswith(named) for text in found.notices)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("restart", [5, 10, 15, 30])
def test_displacements_whose_rounding_hides_what_pulls(restart):
    """A spring that always pulls by 1 N draws node 2 to node 1 and past it, without end: 2e11 m had been a solution."""
    yields = latinpc.register_table([-2e-3, -1e-3, 1e-3, 2e-3], [-10.0, -10.0, 10.0, 10.0], "either way")
    pulls = latinpc.register_table([0.0, 5e-3, 6e-3], [1.0, 1.0, 20.0], "always by 1 N")
    found = latinpc.Structure(
        [[0.24174456902758065], [0.20161583165966335], [0.5383890195201254]], [[1, 2], [0, 1], [0, 2]],
        [pulls, yields, "inextensible"], [0.0, 0.0, 7986.07148267472], fixed=[[1], [0], [0]],
        initial_elongation=[0.0011197229232780322, 0.0020498296968591303, -0.0006470725743820861],
        comm=PETSc.COMM_SELF,
    ).solve(options={"snes_latin_outer_snes_anderson_restart": restart})  # fmt: skip
    assert not found.converged
