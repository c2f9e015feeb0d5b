"""Laws of links: bars, cables and compression-only links as (2), (4) and (5) have them, alone and in a structure."""

import ctypes

import numpy as np
import pytest
from petsc4py import PETSc
from support import latin, solve

import latinpc
from latinpc.library import _latin
from latinpc.results import mechanics
from latinpc.scenes import Law, Scene

K, E0 = 2000.0, 0.25
ELASTIC = (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY)


def link(law, initial_elongation=E0):
    """One link from a fixed node to a free one, along a line."""
    return latinpc.Structure(
        [[0.0], [1.0]],
        [[0, 1]],
        int(law),
        K,
        initial_elongation=initial_elongation,
        fixed=[[1], [0]],
        comm=PETSc.COMM_SELF,
    )


def at(structure, elongation):
    """Displacement that lengthens the link so much."""
    u = structure.create_vec()
    u.set(elongation)
    return u


def between(law, load, stiffness=(1000.0, 4000.0), initial_elongation=0.01):
    """A node pulled to the right between two links that end in fixed nodes."""
    return Scene(
        name="between",
        nodes=[[0.0], [1.0], [2.0]],
        links=[[0, 1], [1, 2]],
        law=[int(law)] * 2,
        stiffness=np.array(stiffness),
        initial_elongation=np.full(2, initial_elongation) * (-1 if law == Law.COMPRESSION_ONLY else 1),
        fixed=[[True], [False], [True]],
        load=[[0.0], [load], [0.0]],
        subdomain=[0, 1],
    )


@pytest.mark.parametrize(
    ("law", "taut"),
    [(Law.BAR, (True, True, True)), (Law.CABLE, (True, False, False)), (Law.COMPRESSION_ONLY, (False, False, True))],
)
def test_tension_is_that_of_the_law(law, taut):
    """Taut: k (e + e0); slack: zero to the bit, also at the very end of being taut."""
    structure = link(law)
    for carries, strain in zip(taut, (0.5, 0.0, -0.5)):
        tension = structure.tensions(at(structure, strain - E0))
        assert tension == (K * strain if carries else 0.0)


@pytest.mark.parametrize("law", ELASTIC)
def test_energy_is_a_convex_potential_of_the_tension(law):
    """The tension is the slope of the energy, and no chord of the energy lies below its curve."""
    structure, step = link(law), 1e-6
    for e in np.linspace(-1.0, 1.0, 9) + 0.01:
        slope = (structure.energy(at(structure, e + step)) - structure.energy(at(structure, e - step))) / (2 * step)
        assert slope == pytest.approx(structure.tensions(at(structure, e))[0], rel=1e-6, abs=1e-6)
    for a, b in np.random.default_rng(0).uniform(-1, 1, (30, 2)):
        chord = (structure.energy(at(structure, a)) + structure.energy(at(structure, b))) / 2
        assert structure.energy(at(structure, (a + b) / 2)) <= chord + 1e-12 * K


def test_strut_is_the_mirror_image_of_a_cable():
    """Opposite elongation and initial_elongation give the opposite tension and the same energy."""
    cable, strut = link(Law.CABLE), link(Law.COMPRESSION_ONLY, -E0)
    for e in (-0.7, -E0, 0.0, 0.3):
        assert strut.tensions(at(strut, -e)) == -cable.tensions(at(cable, e))
        assert strut.energy(at(strut, -e)) == cable.energy(at(cable, e))


@pytest.mark.parametrize("law", ELASTIC)
def test_tangent_is_a_slope_of_the_law(law):
    """The Jacobian has the stiffness of a taut link, none of a slack one, one of the two at the kink."""
    structure = link(law)
    jacobian = structure.dm.createMat()
    for strain in (-0.5, 0.5):
        structure.jacobian(at(structure, strain - E0), jacobian)
        carries = law == Law.BAR or (strain > 0) == (law == Law.CABLE)
        assert jacobian.getValue(0, 0) == (K if carries else 0.0)
    structure.jacobian(at(structure, -E0), jacobian)
    assert jacobian.getValue(0, 0) in (0.0, K)


@pytest.mark.parametrize("load", [-60.0, -29.0, 0.0, 5.0, 39.0, 41.0, 500.0])
def test_node_between_two_cables(load):
    """Both taut, or one slack: the solution by hand, and a slack cable carries exactly nothing."""
    (k1, k2), e0 = (1000.0, 4000.0), 0.01
    both = (load - k1 * e0 + k2 * e0) / (k1 + k2)
    expected = load / k1 - e0 if both > e0 else load / k2 + e0 if both < -e0 else both
    result = solve(between(Law.CABLE, load), stol=1e-14)
    assert result.reason > 0
    assert result.u[1, 0] == pytest.approx(expected, rel=1e-11, abs=1e-15)
    assert (result.tensions == 0.0).tolist() == [both < -e0, both > e0]
    assert (result.tensions >= 0.0).all()


def test_node_between_two_struts_mirrors_that_between_cables():
    """The mirrored structure under the opposite load moves the opposite way, with opposite tensions."""
    for load in (-60.0, 5.0, 500.0):
        cables, struts = (
            solve(between(law, f), stol=1e-14) for law, f in ((Law.CABLE, load), (Law.COMPRESSION_ONLY, -load))
        )
        assert struts.u == pytest.approx(-cables.u, rel=1e-12)
        assert struts.tensions == pytest.approx(-cables.tensions, rel=1e-12)


def test_bars_carry_no_state():
    """Without nonsmooth link and interface nothing is left to iterate on: one linear stage is the solution."""
    scene = between(Law.BAR, 7.0)
    scene.subdomain[:] = 0
    with latin(scene) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        assert latinpc.statistics(run.snes)["state_size"] == 0
        assert run.snes.getIterationNumber() == 1
        assert run.snes.getConvergedReason() > 0
        assert run.structure.displacements(u)[1, 0] == pytest.approx((7.0 + 30.0) / 5000.0, rel=1e-13)


def test_initial_elongation_out_of_reach_of_the_load_makes_cables_bars():
    """Cables that stay taut give the very iterates of bars."""
    bars, cables = (solve(between(law, 5.0), max_it=3, stol=0) for law in (Law.BAR, Law.CABLE))
    assert cables.u == pytest.approx(bars.u, rel=1e-13)


# ---- tables in results -------------------------------------------------------------------------
# of no other test: the first name of a table stays
YIELDS = ([-3e-3, -1e-3, 1e-3, 3e-3], [-10.0, -10.0, 10.0, 10.0], "yields")


def test_a_table_that_yields_is_not_said_to_be_slack():
    """A weight of 25 N on a bar that yields at 10 N: its law is named, and so is how it fails."""
    law = latinpc.register_table(*YIELDS)
    pair = dict(nodes=[[0.0], [1.0], [2.0]], links=[[0, 1], [1, 2]], law=[law, Law.CABLE], stiffness=[0.0, 5.0])
    structure = latinpc.Structure(**pair, fixed=[[1], [0], [1]], load=[[0], [25], [0]], comm=PETSc.COMM_SELF)
    with pytest.warns(latinpc.ConvergenceWarning):
        found = structure.solve()
    assert not found.converged
    assert "no equilibrium: links that are slack or yield no longer hold node 1" in found.notices
    assert "2 links (1 cable, 1 link of the law yields) in 1D" in str(found)


@pytest.mark.parametrize(("tensions", "e0"), [([2e-14, 0.0], 1e-3), ([8.0, -8.0 + 1e-13], 0.0)])
def test_forces_of_tables_that_are_rounding_balance(tensions, e0):
    """Without loads the stiffness of the table, and what it bears, say what rounding is; the structure knows both."""
    law, tensions = latinpc.register_table(*YIELDS), np.array(tensions)
    structure = latinpc.Structure(
        [[0.0], [1.0]], [[0, 1], [0, 1]], law, 0.0, e0, fixed=[[1], [0]], comm=PETSc.COMM_SELF
    )
    assert list(structure.stiffness) == [1e4, 1e4]
    assert mechanics.balance(structure, tensions, mechanics.reactions(structure, tensions)).force < 1e-2


def test_a_solve_that_is_given_up_does_not_ask_for_more_iterations():
    """A table in compression whatever its elongation pushes a node: the proof needs PC latin in Newton's method."""
    laws = [
        latinpc.register_table([-1.4, -1.1, 0.8], [-1, 0, 1]),
        latinpc.register_table([-1.5, 0.6, 0.7], [-3, -1, -1]),
    ]
    structure = latinpc.Structure(
        [[0.6, 0.2], [0.6, 1.9], [1.6, 0.0]], [[0, 2], [1, 2]], laws, 0.0, fixed=[[1, 1], [1, 1], [0, 0]],
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    with pytest.warns(latinpc.ConvergenceWarning):
        assert "no equilibrium: links that are slack or yield no longer hold node 2" in structure.solve().notices
    with pytest.warns(latinpc.ConvergenceWarning):
        found = structure.solve(options={"snes_latin_newton_pc_type": "lu"})
    assert "DIVERGED_MAX_IT" in found.reason and found.iterations < 10_000
    assert any(text.startswith("given up after") for text in found.notices)
    with pytest.warns(latinpc.ConvergenceWarning):
        found = structure.solve(options={"snes_max_it": 3})
    assert found.iterations == 3 and not any(text.startswith("given up after") for text in found.notices)


CALL = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_void_p)
CUBIC = [  # tension, tangent, energy; they live as long as the structures
    CALL(lambda k, x, context: k * (x + x**3)),
    CALL(lambda k, x, context: k * (1.0 + 3.0 * x * x)),
    CALL(lambda k, x, context: k * (x * x / 2.0 + x**4 / 4.0)),
]


def pulled():
    """Two taut links in line, of a table and of a law in Python, a bar or a cable beside them; the middle is pushed."""
    laws = [
        latinpc.register_table([-1.0, 0.0, 0.1, 1.0], [0.0, 0.0, 60.0, 100.0]),
        latinpc.register_law("cubic", *CUBIC),
    ]
    return latinpc.Structure(
        [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2], [0, 1], [1, 2]], [*laws, Law.BAR, Law.CABLE],
        [0.0, 300.0, 10.0, 20.0], initial_elongation=[0.2, 0.2, 0.1, -0.3], geometry="prestress",
        fixed=[[1, 1], [0, 0], [1, 1]], load=[[0.0, 0.0], [3.0, 5.0], [0.0, 0.0]], comm=PETSc.COMM_SELF,
    )  # fmt: skip


def test_tensions_without_the_library_are_those_of_the_library():
    structure = pulled()
    u = structure.create_vec()
    for value in (-0.5, -0.13, 0.0, 0.04, 0.7):
        u.set(value)
        elongation = mechanics.elongations(structure, structure.displacements(u))
        assert mechanics.tensions_at(structure, elongation) == pytest.approx(
            structure.tensions(u), rel=1e-13, abs=1e-13
        )


@pytest.mark.parametrize(
    ("law", "said"),
    [(int(Law.INEXTENSIBLE), "The law inextensible is rigid"), (10_000, "There is no law 10000"), (-1, "no law -1")],
)
def test_a_law_without_a_tension_of_its_own_is_refused(law, said):
    with pytest.raises(PETSc.Error, match=said):
        _latin.law_tensions(law, [1.0], [0.5])


def test_reactions_balance_where_tables_resist_turning():
    """With geometry prestress links push their supports sideways by their tensions as drawn, whatever their law."""
    found = pulled().solve()
    assert found.converged
    assert found.reactions.sum(axis=0) == pytest.approx([-3.0, -5.0], rel=1e-9)
    assert found.balance.moment < 1e-9
    assert not any("do not balance" in text for text in found.notices)


@pytest.mark.filterwarnings("ignore")  # the accuracy may be out of reach
def test_a_table_that_will_yield_bears_what_is_below_its_limit():
    """A node strays along the slack part of its table, which bears 5 N before it yields: 0.02 N prove no collapse."""
    laws = [
        latinpc.register_table([-2.0, -1.0, 1.0, 2.0], [-10.0, -10.0, 10.0, 10.0]),
        Law.INEXTENSIBLE,
        latinpc.register_table([-1.0, 0.0, 1.0], [-1000.0, 0.0, 1.0]),
        latinpc.register_table([-1.0, 0.0, 1.0, 3.0], [0.0, 0.0, 5.0, 5.0]),
        latinpc.register_table([-0.64, -0.237, 0.0, 0.257, 0.536, 1.2], [-36.7, -28.41, -28.36, 0.0, 0.0, 0.158]),
    ]
    structure = latinpc.Structure(
        np.array([[2.71, 4.91, 6.18, 1.98, -0.19, 4.13, 1.2]]).T, [[1, 3], [2, 4], [0, 5], [1, 6], [3, 5]], laws,
        [0.0, 0.0, 0.0, 0.0, 7.763], initial_elongation=[0.1013, -0.8012, 0.01334, 0.0, 0.2589],
        fixed=np.array([[1, 1, 1, 0, 0, 0, 0]]).T, prescribed=np.array([[-0.274, -0.022, -0.0465, 0, 0, 0, 0]]).T,
        load=np.array([[0.0, 0.0, 0.0, 0.2, -0.05, -0.7, -0.02]]).T, subdomain=[0] * 5, comm=PETSc.COMM_SELF,
    )  # fmt: skip
    found = structure.solve()
    assert not any(text.startswith("no equilibrium") for text in found.notices)
    assert found.displacements[6, 0] == pytest.approx(-0.022 - 0.02 / 5.0, rel=1e-6)


def test_a_process_takes_as_many_tables_as_a_study_has():
    """Yield forces one by one: each structure has its own table, the first one still after a hundred others."""
    yields = np.linspace(10.0, 20.0, 101)
    laws = [latinpc.register_table([-2e-3, -1e-3, 1e-3, 2e-3], [-limit, -limit, limit, limit]) for limit in yields]
    assert len(set(laws)) == len(yields)
    for law, limit in zip(laws, yields, strict=True):
        alone = latinpc.Structure([[0.0], [1.0]], [[0, 1]], law, 0.0, fixed=[[1], [0]], load=[[0.0], [5.0]])
        assert alone.solve().displacements[1, 0] == pytest.approx(5e-3 / limit, rel=1e-9)


OTHER_LAWS = """
from petsc4py import PETSc
import latinpc

rank = PETSc.COMM_WORLD.rank
for points in ([-1.0, 0.0, 1.0 + rank], [-1.0, 0.0, 7.0])[: 2 if rank else 1]:
    law = latinpc.register_table(points, [-2.0, 0.0, 3.0])
laws = (latinpc.Law.BAR, law) if rank else (law, latinpc.Law.BAR)
for law in laws:
    try:
        latinpc.LocalStructure([[float(rank)]], [[0, 1]], law, 1.0, fixed=[[rank == 0]])
    except latinpc.LatinError as error:
        print("other points" if "other points" in str(error) else "not all" if "not all ranks" in str(error) else error)
"""


def test_laws_that_only_some_ranks_know_are_refused(mpirun):
    """Solvers move links between ranks: the others had called what is not there."""
    said = mpirun(2, OTHER_LAWS, alone=True).stdout  # lines of ranks may mix
    assert [said.count(words) for words in ("not all", "other points")] == [2, 2]
