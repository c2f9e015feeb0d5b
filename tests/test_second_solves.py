"""SNES latin used again: other loads, guesses, options, prefixes, types, warm starts, two solvers on one structure."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import PLAIN, far, grid, irregular, latin, lattice, network, settled, solve

import latinpc
from latinpc.options import default_options
from latinpc.scenes import make

REASON = PETSc.SNES.ConvergedReason


@pytest.mark.parametrize("make", [grid, irregular])
def test_other_loads_and_initial_elongations_need_no_new_set_up(make):
    """New load, new initial_elongation, and back: each answer right, the operators the same objects throughout."""
    scene = make()
    cases = [
        scene,
        replace(scene, load=0.5 * scene.load),
        replace(scene, initial_elongation=1.3 * scene.initial_elongation),
        scene,
    ]
    with latin(scene, stol=1e-10, max_it=2000) as run:
        run.snes.setUp()
        u, solvers = run.structure.create_vec(), [latinpc.local_ksp(run.snes), latinpc.coarse_ksp(run.snes)]
        states = [ksp.getOperators()[0].stateGet() for ksp in solvers]
        for case in cases:
            run.structure.set_load(case.load)
            run.structure.set_initial_elongation(case.initial_elongation)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            assert far(run.structure.displacements(u), oracle.newton(case)) < 1e-7
        assert solvers == [latinpc.local_ksp(run.snes), latinpc.coarse_ksp(run.snes)]
        assert states == [ksp.getOperators()[0].stateGet() for ksp in solvers]


@pytest.mark.parametrize("variant", ["macro", "corner"])
@pytest.mark.parametrize("make", [grid, irregular, network, lattice])
def test_a_solution_is_its_own_initial_guess(make, variant):
    """From the solution one linear stage, which changes nothing; from near it fewer than from the prestressed state."""
    scene = make()
    exact = oracle.newton(scene)
    with latin(scene, variant=variant, stop="indicator") as run:
        u, counts = run.structure.create_vec(), []
        for guess in (0.0 * exact, 1.001 * exact, exact):
            run.structure.set_displacements(guess, u)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            counts.append(run.snes.getIterationNumber())
        assert counts[2] == 1
        assert counts[1] < counts[0]
        assert latinpc.history(run.snes)["indicator"][0] < 1e-9
        assert far(run.structure.displacements(u), exact) < 1e-9


def test_a_guess_that_is_far_off_does_not_matter():
    """It costs iterations, and the solution is the same; zero is the prestressed state, whatever was solved before."""
    with latin(grid(), stol=1e-8) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        first, count = u.copy(), run.snes.getIterationNumber()
        u.scale(1e3)
        run.snes.solve(None, u)
        assert run.snes.getConvergedReason() > 0
        assert (u - first).norm() <= 1e-6 * first.norm()
        u.zeroEntries()
        run.snes.solve(None, u)
        assert run.snes.getIterationNumber() == count
        assert np.array_equal(u, first)


def test_a_guess_with_settled_supports_more_load_and_the_residual_stop():
    """The guess is of the free displacements, loads are those of the solve, and rtol is relative to its residual."""
    scene = settled(network())
    extra = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    with latin(scene, stop="residual", rtol=1e-6, atol=1e-7) as run:
        u, b, r = (run.structure.create_vec() for _ in range(3))
        run.structure.set_displacements(extra, b)
        run.structure.set_displacements(0.9 * oracle.newton(replace(scene, load=scene.load + extra)), u)
        run.structure.residual(u, r)
        before = (r - b).norm()
        run.snes.solve(b, u)
        assert run.snes.getConvergedReason() == REASON.CONVERGED_FNORM_RELATIVE
        run.structure.residual(u, r)
        assert (r - b).norm() <= 1e-6 * before
        run.snes.setTolerances(atol=2 * run.snes.getFunctionNorm())
        run.snes.solve(b, u)
        assert run.snes.getConvergedReason() == REASON.CONVERGED_FNORM_ABS
        assert run.snes.getIterationNumber() == 0


def test_as_a_nonlinear_preconditioner():
    """-npc_snes_type latin: each goes on from the current displacements, and improves them."""
    scene = grid()
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    options = {"snes_type": "ngmres", "npc_snes_type": "latin", "npc_snes_max_it": 3, "snes_rtol": 1e-8}
    with default_options(options | {"snes_max_it": 60, "snes_npc_side": "right"}):
        snes = structure.create_snes()
        snes.setType("ngmres")
        snes.setFromOptions()
    norms = []
    snes.setMonitor(lambda _, iteration, norm: norms.append(norm))
    u = structure.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert norms[-1] <= 1e-8 * norms[0]
    assert snes.getNPC().getType() == "latin"
    assert far(structure.displacements(u), oracle.newton(scene)) < 1e-6


def test_a_prefix_reaches_all_inner_solvers():
    """setOptionsPrefix() before or after options were read: outer, Newton, local and coarse solvers, digits."""
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    inner = {"outer_snes_type": "ngmres", "stop": "error", "newton_ksp_type": "minres"}
    for late in (False, True):
        snes = PETSc.SNES().create(PETSc.COMM_SELF)
        if late:
            snes.setType("latin")
            snes.setFromOptions()
        snes.setOptionsPrefix("a_")
        structure.attach(snes)
        latins = {f"a_snes_latin_{key}": value for key, value in inner.items()}
        ksps = {"a_snes_latin_local_ksp_type": "gmres", "a_snes_latin_coarse_ksp_type": "fgmres"}
        with default_options({"a_snes_type": "latin", "a_snes_stol": 1e-9} | latins | ksps):
            snes.setFromOptions()
            snes.solve(None, structure.create_vec())
        assert snes.getConvergedReason() > 0
        assert snes.getLinearSolveIterations() > 0
        assert latinpc.outer_snes(snes).getType() == "ngmres"
        assert latinpc.local_ksp(snes).getType() == "gmres"
        assert latinpc.coarse_ksp(snes).getType() == "fgmres"
        with default_options({"a_latin_digits_ksp_max_it": 1}), pytest.raises(PETSc.Error, match="ksp_monitor"):
            latinpc.digits(snes)


def test_a_type_of_the_inner_snes_set_in_code():
    """As by the option, defaults included, and it stays when the structure is set up anew."""
    by_option = solve(grid(), **PLAIN)
    with latin(grid()) as run:
        outer = latinpc.outer_snes(run.snes)
        outer.setType("nrichardson")
        for load in (1.0, 2.0):
            run.structure.set_load(load * grid().load)
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert latinpc.outer_snes(run.snes) == outer and outer.getType() == "nrichardson"
            if load == 1.0:
                assert run.snes.getIterationNumber() == by_option.iterations
                assert np.array_equal(run.structure.displacements(u), by_option.u)
            with default_options({"snes_latin_variant": "macro"}):  # all is built anew
                run.snes.setFromOptions()


def test_setters_do_what_options_do():
    """Stop, error and Newton's method in code give the bits that the options give."""
    scene = irregular()
    for options, setters in (
        ({"stop": "energy", "error": 1e-5}, [("stop", "energy"), ("error", 1e-5)]),
        ({"stop": "residual"}, [("stop", "residual")]),
        ({"newton": "never", "stop": "error"}, [("newton", "never"), ("stop", "error")]),
    ):
        by_option = solve(scene, **options)
        with latin(scene, **({"stol": 1e-9} if "stol" in options else {})) as run:
            for name, *values in setters:
                getattr(latinpc, f"set_{name}")(run.snes, *values)
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert run.snes.getIterationNumber() == by_option.iterations
            assert np.array_equal(run.structure.displacements(u), by_option.u)


def test_warm_start_uses_the_state_of_the_last_solve():
    """By option a solve goes on from the state of the one before: after a small change of load it is shorter."""
    scene = grid()
    with latin(scene, stol=1e-8, warm_start="last") as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        cold = run.snes.getIterationNumber()
        run.snes.solve(None, u)
        assert run.snes.getIterationNumber() <= 2
        run.structure.set_load(1.001 * scene.load)
        run.snes.solve(None, u)
        assert run.snes.getIterationNumber() < cold
        assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=1.001 * scene.load))) < 1e-6


@pytest.mark.parametrize("variant", ["primal", "macro"])
@pytest.mark.parametrize("law", ["contact", "friction"])
def test_a_warm_start_goes_on_from_where_newton_ended(law, variant):
    """The interior-point method finds what the iteration does not: the next solve of the same loads starts there."""
    scene = make("packing", law=law, side=20)
    if law == "contact":
        scene = replace(scene, subdomain=4 * np.arange(len(scene.links)) // len(scene.links))
    with latin(scene, error=1e-6, warm_start="last", variant=variant) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        assert run.snes.getConvergedReason() > 0
        assert run.snes.getLinearSolveIterations() > 20
        first = latinpc.tensions(run.snes)
        run.snes.solve(None, u)
        assert run.snes.getConvergedReason() > 0
        assert run.snes.getIterationNumber() <= 6
        assert np.allclose(latinpc.tensions(run.snes), first, rtol=0, atol=1e-9 * np.abs(first).max())


def test_right_hand_side_is_more_load():
    """F(x) = b: the vector of a solve is added to the loads of the structure, for that solve only."""
    scene = settled(network())
    extra = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    with latin(scene, stol=1e-10, max_it=2000) as run:
        u, b = run.structure.create_vec(), run.structure.create_vec()
        run.structure.set_displacements(extra, b)
        for rhs, load in ((b, scene.load + extra), (None, scene.load), (2 * b, scene.load + 2 * extra)):
            run.snes.solve(rhs, u)
            assert run.snes.getConvergedReason() > 0
            assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=load))) < 1e-7


def test_options_read_again_rebuild():
    """Another variant or direction after a solve is what the next solve uses."""
    scene = grid()
    with latin(scene, max_it=4, stol=0, **PLAIN) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        for options in (
            {"variant": "macro"},
            {"variant": "published"},
            {"direction": "scalar"},
            {"direction": "scalar", "direction_value": 1e6},
        ):
            with default_options({f"snes_latin_{key}": value for key, value in options.items()}):
                run.snes.setFromOptions()
                u.zeroEntries()
                run.snes.solve(None, u)
            assert far(run.structure.displacements(u), solve(scene, max_it=4, stol=0, **options, **PLAIN).u) < 1e-9
            latinpc.set_variant(run.snes, "corner")
            latinpc.set_direction(run.snes, "schur")


def test_reset_builds_anew():
    """After SNESReset() the same object solves again, to the same bits."""
    with latin(irregular()) as run:
        u, v = run.structure.create_vec(), run.structure.create_vec()
        run.snes.solve(None, u)
        run.snes.reset()
        run.structure.attach(run.snes)
        run.snes.solve(None, v)
        assert (u - v).norm() == 0.0


def test_two_solvers_share_a_structure():
    """Two solvers of different variants on one structure do not disturb each other."""
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    solvers, found = {"macro": structure.create_snes(), "none": structure.create_snes()}, {}
    for variant, snes in solvers.items():
        with default_options({"snes_latin_variant": variant, "snes_stol": 1e-9}):
            snes.setFromOptions()
            snes.setUp()
    for variant in ("macro", "none", "macro"):
        found[variant] = structure.create_vec()
        solvers[variant].solve(None, found[variant])
    assert [latinpc.statistics(snes)["weak_dofs"] for snes in solvers.values()] == [24, 0]
    assert (found["macro"] - found["none"]).norm() < 1e-6 * found["none"].norm()


@pytest.mark.parametrize("cut", [1, 2])
@pytest.mark.parametrize("cable", ["inextensible", "cable", "bar"])
def test_large_displacements_from_rest_are_those_of_a_new_solver(cable, cut):
    """Begun with operators and penalties of the last solve, it had found other equilibria, or none."""
    nodes = [[0.0, 0.0], [4.0, 0.0], [1.0, -1.0], [2.2, -1.2], [3.0, -0.8], [2.0, 1.0]]
    links = [[0, 2], [2, 3], [3, 4], [4, 1], [2, 5], [3, 5], [4, 5]]
    structure = latinpc.Structure(
        nodes, links, [cable] * 4 + ["bar"] * 3, [0.0 if cable == "inextensible" else 50.0] * 4 + [20.0] * 3,
        fixed=np.arange(6)[:, None] < [2, 2], geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip
    down = np.where(structure.fixed, 0.0, [0.3, -1.0])

    def end(snes, load):
        u = structure.create_vec()
        structure.set_load(load)
        snes.solve(None, u)
        return snes.getConvergedReason(), snes.getIterationNumber(), *structure.displacements(u).ravel()

    with default_options({"snes_latin_subdomains": cut, "snes_latin_error": 1e-8}):
        used, new = structure.create_snes(), structure.create_snes()
        for snes in (used, new):
            snes.setFromOptions()
        truth = end(new, down)
        assert truth[0] > 0
        for before in (down, 3.0 * down, 0.0 * down):
            end(used, before)
            assert end(used, down) == truth
        used.reset()
        assert end(used, down) == truth


@pytest.mark.parametrize(("law", "seed"), [("bar", 30), ("cable", 123), ("inextensible", 87), ("inextensible", 148)])
def test_a_path_after_another_is_that_of_a_new_solver(law, seed):
    """Six nodes in a square, two held: linear solves had been as accurate as the last step of the solve before."""
    rng = np.random.default_rng(seed)
    nodes = rng.uniform(0.0, 1.0, (6, 2))
    links = np.array([(i, j) for i in range(6) for j in range(i) if rng.random() < 0.6])
    fixed = np.arange(6)[:, None] < [2, 2]
    laws = rng.choice(["bar"] if law == "bar" else ["bar", law], len(links))
    load = np.where(fixed, 0.0, 50.0 * rng.normal(size=fixed.shape))
    between = ~fixed[links].all(axis=(1, 2))
    laws, links = laws[between], links[between]

    def end(parts):
        structure = latinpc.Structure(
            nodes, links, laws, np.where(laws == "inextensible", 0.0, 1e4), fixed=fixed, geometry="large",
            comm=PETSc.COMM_SELF,
        )  # fmt: skip
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        for part in parts:
            u.set(0.0)
            structure.set_load(part * load)
            snes.solve(None, u)
        return snes.getConvergedReason(), snes.getIterationNumber(), *structure.displacements(u).ravel()

    assert end([-1.0, 1.0]) == end([1.0])


@pytest.mark.parametrize("how", ["set_geometry", "option"])
def test_a_geometry_that_is_refused_changes_nothing(how):
    """The structure had kept it: later solves were refused as well, or crashed."""
    structure = latinpc.Structure(
        [[0, 0], [1, 0], [0.5, 1]], [[0, 2], [1, 2], [0, 2]], ["bar", "bar", "inextensible"], [1.0, 1.0, 0.0],
        fixed=[[1, 1], [1, 1], [0, 0]], load=[[0, 0], [0, 0], [0.01, -0.01]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    for geometry in ("linear", "large", "linear"):
        structure.set_geometry(geometry)
        snes, u, v = structure.create_snes(), structure.create_vec(), structure.create_vec()
        snes.solve(None, u)
        with pytest.raises(PETSc.Error if how == "set_geometry" else latinpc.SolveError, match="Geometry prestress"):
            if how == "option":
                structure.solve(options={"snes_latin_geometry": "prestress"})
            structure.set_geometry("prestress")
        assert structure.geometry == geometry
        snes.solve(None, v)
        assert snes.getConvergedReason() > 0 and np.array_equal(u, v)
        assert structure.solve().report["reason"].startswith("CONVERGED")


@pytest.mark.parametrize(
    "law, elongation, said",
    [
        ("friction", 0.0, "not part of a complete contact"),
        ("cable", np.nan, "an initial elongation"),
        ("cable", 9.0, "its length without"),
    ],
)
def test_laws_that_are_refused_change_nothing(law, elongation, said):
    """The structure had kept the new laws: later solves had another result, were refused, or crashed."""
    structure = latinpc.Structure(
        [[0, 0], [1, 0], [0.5, 1]], [[0, 2], [1, 2], [0, 2]], ["bar", "bar", "cable"], [1.0, 1.0, 5.0],
        fixed=[[1, 1], [1, 1], [0, 0]], load=[[0, 0], [0, 0], [0.01, -0.01]], comm=PETSc.COMM_SELF, geometry="large",
    )  # fmt: skip
    snes, u, v = structure.create_snes(), structure.create_vec(), structure.create_vec()
    snes.solve(None, u)
    with pytest.raises(PETSc.Error, match=said):
        structure._handle.set_laws(
            np.full(3, latinpc.Law[law.upper()]), np.array([1.0, 1.0, 2.0]), np.full(3, elongation)
        )
    snes.solve(None, v)
    assert snes.getConvergedReason() > 0 and np.array_equal(u, v)


@pytest.mark.filterwarnings(
    "ignore:contacts that bear", "ignore:no equilibrium", "ignore:not converged", "ignore:links join"
)
def test_friction_after_loads_that_nothing_bears_is_that_of_a_new_solver():
    """Two nodes on a floor, tied by bars: the search parameter of the collapse had led the next loads nowhere."""
    floor, up, east, north, none = [0.0, 0.0, 0.0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 0]
    far = [2.0, 0.6, 0.0]
    pair = latinpc.Structure(
        [floor, floor, far, far], [[0, 1]] * 3 + [[2, 3]] * 3 + [[3, 1], [1, 3], [1, 2], [1, 2]],
        [*["friction", "tangent", "tangent"] * 2, "bar", "compression_only", "bar", "inextensible"],
        [0.0] * 6 + [4.0, 0.46, 1.9, 0.0], initial_elongation=[0.0] * 9 + [-0.02],
        direction=[up, east, north] * 2 + [none] * 4, friction=[0.54] * 3 + [0.65] * 7,
        fixed=[[1] * 3, [0] * 3] * 2, comm=PETSc.COMM_SELF,
    )  # fmt: skip
    snes = pair.create_snes()
    slides = [floor, [0.54, -0.42, -0.054], floor, [-0.28, -0.27, -0.72]]
    rests = [floor, [0.23, -0.18, -0.91], floor, [0.52, -0.11, -0.6]]
    for load, stands in ((slides, False), (rests, True)):
        pair.set_load(load)
        snes.solve(None, pair.create_vec())
        new = pair.solve()
        assert (snes.getConvergedReason() > 0) == new.converged == stands
        assert snes.getIterationNumber() == new.iterations
        assert np.array_equal(latinpc.tensions(snes), new.tensions)


@pytest.mark.parametrize("how", ["last", "extrapolate"])
@pytest.mark.parametrize("law", ["bar", "cable"])
def test_a_warm_start_ends_where_loads_are_taken_away(law, how):
    """Rounding of the last solve is more than all there is of this one, and had been taken for its error."""
    n = 7
    x, held = np.arange(n) + 0.1 * np.sin(np.arange(n)), np.isin(np.arange(n), [0, n - 1])
    load = np.where(held, 0.0, 0.1 * np.cos(np.arange(n)))[:, None]
    row = latinpc.Structure(
        x[:, None], [[i, i + 1] for i in range(n - 1)], [law] * (n - 2) + ["bar"], 1.0 + 0.3 * np.arange(n - 1),
        fixed=held[:, None], load=load, comm=PETSc.COMM_SELF,
    )  # fmt: skip
    with default_options({"snes_latin_subdomains": 3, "snes_latin_warm_start": how}):
        snes, u = row.create_snes(), row.create_vec()
        snes.setFromOptions()
    for part in (1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 1e-9, 0.0):
        row.set_load(part * load)
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        forces = row.create_vec()
        row.residual(u, forces)
        assert forces.norm() <= 1e-2 * part * np.linalg.norm(load) + 1e-15


@pytest.mark.parametrize("warm", ["none", "last", "extrapolate"])
@pytest.mark.parametrize("law", ["bar", "cable", "inextensible"])
def test_without_its_loads_a_structure_is_at_rest_at_once(law, warm):
    """The last solution had shrunk from stage to stage to the least numbers, 60 stages, as nothing has no digits."""
    fixed, load = np.zeros((5, 2)), np.zeros((5, 2))
    fixed[:2], load[2:] = 1, [[3.0, -20.0], [-1.0, -30.0], [2.0, -10.0]]
    frame = latinpc.Structure(
        [[0.0, 0.0], [3.0, 0.0], [1.0, 1.0], [2.0, 1.1], [1.5, 2.0]],
        [[0, 2], [1, 2], [0, 3], [1, 3], [2, 4], [3, 4], [2, 3], [1, 4]], ["bar", "bar", "bar", law] * 2,
        [1e5, 1e5, 1e5, 0.0 if law == "inextensible" else 1e5] * 2, fixed=fixed, comm=PETSc.COMM_SELF,
    )  # fmt: skip
    with default_options({"snes_latin_warm_start": warm}):
        snes, u = frame.create_snes(), frame.create_vec()
        snes.setFromOptions()
    for part in (1.0, 0.5, 0.0, 0.0, 0.2, 0.0):
        frame.set_load(part * load)
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        assert part > 0.0 or (snes.getIterationNumber() == 1 and not u.norm() and not latinpc.tensions(snes).any())


@pytest.mark.parametrize("warm", ["none", "last", "extrapolate"])
def test_a_load_after_one_that_nothing_bears_starts_from_rest(warm):
    """A bar that yields under pressure: its node has gone far when it is pulled again, which is no second collapse."""
    law = latinpc.register_table([-2.0, -1.0, 0.0], [-0.01, -0.01, 0.0])
    structure = latinpc.Structure([[0.0], [1.0]], [[0, 1]], law, 0.0, fixed=[[1], [0]], comm=PETSc.COMM_SELF)
    with default_options({"snes_latin_warm_start": warm}):
        snes = structure.create_snes()
        snes.setFromOptions()
    u = structure.create_vec()
    for force, borne in ((0.02, True), (-0.06, False), (0.02, True)):
        structure.set_load([[0.0], [force]])
        snes.solve(None, u)
        assert (snes.getConvergedReason() > 0) == borne
        assert not borne or u.getArray()[0] == pytest.approx(force / 0.01, rel=1e-9)
