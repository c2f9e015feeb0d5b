"""What programs change between solves, errors in the middle of one, and other types in the place of ours."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc
from latinpc.library import _latin
from latinpc.options import default_options

LU = {"ksp_type": "preonly", "pc_type": "lu"}


def net(law="cable", initial_elongation=0.002, load=(3.0, -5.0), side=6, **more):
    """Squares of bars with crossed links, held below, pulled at a corner."""
    at = np.arange(side * side).reshape(side, side)
    edges = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:]), (at[:-1, :-1], at[1:, 1:]), (at[:-1, 1:], at[1:, :-1])]
    links = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in edges])
    bars = 2 * side * (side - 1)
    nodes = np.stack([np.arange(side * side) % side, np.arange(side * side) // side], 1).astype(float)
    forces = np.zeros_like(nodes)
    forces[-1] = load
    e0 = np.where(
        np.arange(len(links)) < bars, 0.0 if law == "inextensible" else initial_elongation, initial_elongation
    )
    return latinpc.Structure(
        nodes, links, ["bar"] * bars + [law] * (len(links) - bars), 1000.0, initial_elongation=e0,
        fixed=np.repeat(nodes[:, 1:] == 0.0, 2, 1), load=forces, comm=PETSc.COMM_SELF, **more,
    )  # fmt: skip


def solved(structure, b=None, **options):
    """SNES after a solve with these options, and the displacements."""
    with default_options(options):
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        snes.solve(b, u)
    return snes, u


# ---- errors in the middle ------------------------------------------------------------------------
class Stop(Exception):
    """Raised by a monitor, as Ctrl-C is."""


def hung():
    """A chain that does not stretch, with large displacements."""
    x = np.arange(5.0)
    return latinpc.Structure(
        np.stack([x, 0.06 * x * (x - 4.0)], 1), [[i, i + 1] for i in range(4)], "inextensible", 0.0,
        fixed=[[i in (0, 4)] * 2 for i in range(5)], load=[[0.1, -1.0 - 0.3 * i] for i in range(5)], geometry="large",
        comm=PETSc.COMM_SELF,
    )  # fmt: skip


INNER = {"snes_latin_newton_snes_type": "anderson"}  # refused where Newton's method takes over


@pytest.mark.parametrize("make", [hung, lambda: net("inextensible", -0.01)], ids=["a monitor, large", "Newton, linear"])
def test_a_solve_that_an_error_ends_leaves_the_structure_as_it_was(make):
    """Springs stand for cables that do not stretch in the middle of a solve, and are gone after an error."""
    structure = make()
    first, u = solved(structure)

    def interrupt(_snes, it, _norm):
        if it:
            raise Stop

    with default_options({} if structure.geometry == "large" else INNER):
        snes = structure.create_snes()
        if structure.geometry == "large":
            snes.setMonitor(interrupt)
        snes.setFromOptions()
        with pytest.raises((Stop, PETSc.Error)):
            snes.solve(None, structure.create_vec())
    snes.destroy()
    again, v = solved(structure)
    assert again.getIterationNumber() == first.getIterationNumber()
    assert (u.getArray() == v.getArray()).all()


@pytest.mark.parametrize("where", ["set-up", "iteration"])
def test_a_solve_that_an_error_ends_has_not_converged(where):
    """The reason had stayed that of the solve before."""
    structure = net()
    snes, u = solved(structure)
    assert snes.getConvergedReason() > 0
    u.set(0.0)
    if where == "set-up":
        snes.reset()
        latinpc.set_subdomains(snes, 1000)
        with pytest.raises(PETSc.Error, match="1000 subdomains"):
            snes.solve(None, u)
    else:

        def interrupt(_snes, _it, _norm):
            raise Stop

        snes.setMonitor(interrupt)
        with pytest.raises((Stop, PETSc.Error)):
            snes.solve(None, u)
    assert snes.getConvergedReason() == 0


def test_prescribed_displacements_that_are_no_numbers_change_nothing():
    """They are refused before they are stored, for callers in C as well."""
    structure = net()
    _, u = solved(structure)
    with pytest.raises(PETSc.Error):
        structure._handle.set_prescribed(np.full(structure.nodes.shape, np.nan))
    _, v = solved(structure)
    assert (u.getArray() == v.getArray()).all()


def test_a_guess_that_is_no_number_comes_back_as_it_was():
    structure = net()
    snes, u = structure.create_snes(), structure.create_vec()
    u.set(np.nan)
    snes.setFromOptions()
    try:
        snes.solve(None, u)
    except PETSc.Error as error:
        assert error.ierr == 72  # PETSc with its own checks looks at the guess first
        return
    assert snes.getConvergedReason() == -4  # its name depends on the version of petsc4py
    assert np.isnan(u.getArray()).all() and np.isnan(snes.getFunctionNorm())


# ---- what PETSc's own types find -----------------------------------------------------------------
@pytest.mark.parametrize("kind", ["newtonls", "newtontr"])
def test_line_searches_see_the_right_hand_side(kind):
    """F(u) = b with PETSc's defaults: the objective of the line search has the work of b in it."""
    structure = net()
    b = structure.create_vec()
    b.setArray(np.linspace(-2.0, 2.0, b.getLocalSize()))
    _, u = solved(structure, b, snes_latin_error=1e-9)
    snes, v = solved(structure, b, snes_type=kind, **LU)
    assert snes.getConvergedReason() > 0
    assert (u - v).norm() < 1e-6 * u.norm()


def test_the_inner_newton_method_takes_any_preconditioner_with_rigid_links():
    structure = net("inextensible", initial_elongation=-0.01)
    _, u = solved(structure)
    snes, v = solved(structure, snes_latin_newton_pc_type="lu")
    assert snes.getConvergedReason() > 0
    assert (u - v).norm() < 1e-6 * u.norm()


@pytest.mark.parametrize("geometry", ["linear", "large"])
def test_the_inner_newton_method_takes_options_that_are_corrected(geometry):
    """After one of them has been refused."""
    structure = net(geometry=geometry)
    snes, u = structure.create_snes(), structure.create_vec()
    options = {"snes_latin_error": 1e-10, "snes_latin_newton_ksp_type": "gmres"}
    with default_options(options | {"snes_latin_newton_snes_type": "qn"}):
        snes.setFromOptions()
        with pytest.raises(PETSc.Error, match="qn is not Newton's method: take newtonls"):
            snes.solve(None, u)
    with default_options(options):
        snes.setFromOptions()
        snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    _, reference = solved(structure, snes_latin_error=1e-10)
    assert u.getArray() == pytest.approx(reference.getArray(), abs=1e-9)


def test_updates_are_called_in_load_cases():
    """A case whose SNES has an update is solved by itself, as one with monitors is."""
    structure, seen = net(), []
    snes = structure.create_snes()
    snes.setFromOptions()
    snes.setUpdate(lambda snes, step: seen.append(step))
    stages = np.zeros(2, PETSc.IntType)
    displacements, tensions = [np.zeros((36, 2)) for _ in stages], [np.zeros(len(structure.links)) for _ in stages]
    loads = tuple(part * structure.load for part in (1.0, 0.5))
    _latin.solve_cases(snes, loads, (None, None), (None, None), displacements, tensions, stages)
    assert seen or list(stages) == [-1, -1]


def test_another_dm_is_another_structure():
    one, other = net(), net(load=(4.0, 1.0))
    _, expected = solved(other)
    snes, _ = solved(one)
    snes.setDM(other.dm)
    u = other.create_vec()
    snes.solve(None, u)
    assert (u - expected).norm() < 1e-9 * expected.norm()


def test_a_structure_of_another_size_is_attached_after_its_dm():
    """The SNES is set up for the one before: its vectors are too large."""
    one, other = net(), net(side=4)
    _, expected = solved(other)
    snes, _ = solved(one)
    snes.setDM(other.dm)
    other.attach(snes)
    u = other.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0 and (u - expected).norm() < 1e-9 * expected.norm()


def test_tolerances_set_before_the_type_leave_its_other_defaults():
    """The stop stays the error, unless a step tolerance is given."""
    structure = net()
    found = []
    for early in (False, True):
        snes = PETSc.SNES().create(comm=PETSc.COMM_SELF)
        structure.attach(snes)
        if early:
            snes.setTolerances(max_it=5000)
        snes.setType("latin")
        if not early:
            snes.setTolerances(max_it=5000)
        snes.setFromOptions()
        snes.solve(None, structure.create_vec())
        found.append((snes.getIterationNumber(), snes.getTolerances()))
    assert found[0] == found[1] and found[0][1][3] == 5000


def test_no_stage_is_taken_where_none_is_allowed():
    snes, u = solved(net(), snes_max_it=0)
    assert snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
    assert snes.getIterationNumber() == 0 and u.norm() == 0.0


def test_monitors_of_a_warm_start_begin_at_the_last_solution():
    structure, seen = net(), []
    with default_options({"snes_latin_warm_start": "last"}):
        snes = structure.create_snes()
        snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    last = snes.getFunctionNorm()
    snes.setMonitor(lambda _snes, _it, norm: seen.append(norm))
    snes.solve(None, u)
    assert seen[0] == pytest.approx(last)


# ---- KSP latin -----------------------------------------------------------------------------------
def tangent(structure):
    """Tangent stiffness as drawn."""
    J = structure.dm.createMat()
    structure.jacobian(structure.create_vec(), J)
    return J


@pytest.mark.parametrize("norm", ["PRECONDITIONED", "NONE"])
def test_a_matrix_that_is_not_the_one_of_the_set_up_is_refused(norm):
    """A changes while P stays: as at the first solve, and as often as it is tried."""
    structure = net("bar")
    J = tangent(structure)
    b, x = structure.create_vec(), structure.create_vec()
    b.set(1.0)
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    structure.attach(ksp)
    ksp.setType("latin")
    ksp.setOperators(J)
    ksp.setNormType(getattr(PETSc.KSP.NormType, norm))
    ksp.setFromOptions()
    ksp.solve(b, x)
    ksp.setOperators(2.0 * J, J)
    for _ in range(2):
        with pytest.raises(PETSc.Error):
            ksp.solve(b, x)
    ksp.setOperators(J.copy(), J)
    ksp.solve(b, x)
    assert ksp.getConvergedReason() > 0


# ---- motions -------------------------------------------------------------------------------------
def moving(structure, h=0.01, **options):
    """TS at rest, its displacements and velocities."""
    u, v = structure.create_vec(), structure.create_vec()
    with default_options(options):
        ts = structure.create_ts(u, v)
        ts.setTimeStep(h)
        ts.setMaxTime(100.0)
        ts.setFromOptions()
    return ts, u, v


def move(ts, u, steps):
    """Go on to this number of steps."""
    ts.setMaxSteps(steps)
    ts.solve(u)
    return u.getArray().copy()


def test_snes_latin_does_not_pretend_to_solve_other_integrators():
    """Their equations are not those of the structure."""
    ts, u, _ = moving(net(mass=1.0), ts_type="alpha2", snes_type="latin")
    with pytest.raises(PETSc.Error):
        move(ts, u, 2)


def test_another_type_after_ours_solves_its_own_equations():
    """Three steps of TS latin, then three of alpha2, as one that never was of type latin takes them from there."""
    structure = net(mass=1.0)
    ts, u, v = moving(structure, **LU)
    move(ts, u, 3)
    there, fast = u.copy(), v.copy()
    ts.setType("alpha2")
    found = move(ts, u, 6)
    assert ts.getSNES().getType() == "newtonls"
    other, w, z = moving(structure, ts_type="alpha2", **LU)
    there.copy(w)
    fast.copy(z)
    assert found == pytest.approx(move(other, w, 3), rel=1e-6, abs=1e-9)


def test_monitors_survive_changes_of_options_and_type(capfd):
    ts, u, _ = moving(net(mass=1.0), ts_latin_monitor="", **LU)
    move(ts, u, 2)
    ts.setFromOptions()
    move(ts, u, 3)
    ts.setType("alpha2")
    move(ts, u, 5)
    steps = [int(line.split()[0]) for line in capfd.readouterr().out.splitlines() if "energy: kinetic" in line]
    assert steps == [0, 1, 2, 2, 3]


def test_views_after_another_structure_are_of_that_one(capfd):
    ts, _, _ = moving(net(mass=1.0), **LU)
    ts.setUp()
    net(mass=1.0, side=4).attach(ts)
    ts.view()
    assert "structure" not in capfd.readouterr().out


def on_a_floor():
    """A mass on a floor that moves up, and the TS of it."""
    structure = latinpc.Structure(
        [[0, 0], [0, 1.0]], [[0, 1]], "contact", 0.0, fixed=[[1, 1], [1, 0]], load=[[0, 0], [0, -1.0]], mass=[0, 1.0],
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    ts, u, v = moving(structure)
    ts.setPreStep(lambda ts: structure.set_prescribed([[0.0, 0.01 * (ts.getStepNumber() + 1)], [0.0, 0.0]]))

    def again():
        u.set(0.0)
        v.set(0.0)
        structure.set_prescribed(np.zeros((2, 2)))
        ts.setSolution2(u, v)
        ts.setTime(0.0)
        ts.setStepNumber(0)
        return move(ts, u, 5)

    return ts, again


def test_a_motion_begins_again_after_a_reset():
    """Supports start where they are then; without a reset they would start where the last motion has left them."""
    ts, again = on_a_floor()
    first = again()
    assert first == pytest.approx(0.05)
    with pytest.raises(PETSc.Error):
        again()
    ts.reset()
    assert again() == pytest.approx(first, rel=1e-12)


def test_mean_forces_have_no_potential_on_the_same_ts():
    """Linear displacements, then large ones with Newton's method of PETSc: the line search forgets the energy."""
    structure = net(mass=1.0)
    ts, u, v = moving(structure, h=0.05, snes_type="newtonls", **LU)
    move(ts, u, 3)
    structure.set_geometry("large")
    ts.reset()
    u.set(0.0)
    v.set(0.0)
    ts.setSolution2(u, v)
    ts.setTime(0.0)
    ts.setStepNumber(0)
    found = move(ts, u, 3)
    other, w, _ = moving(structure, h=0.05, snes_type="newtonls", **LU)
    assert found == pytest.approx(move(other, w, 3), rel=1e-9)


@pytest.mark.parametrize("geometry", ["linear", "large"])
def test_events_go_back_and_meet_their_time(geometry):
    """A step ends at the event; the motion is that of steps of the same lengths."""
    structure = net(mass=1.0, geometry=geometry)
    ts, u, _ = moving(structure)
    times, lengths = [], [0.0]

    def when(_ts, t, _u, values):
        values[0] = t - 0.035

    ts.setEventHandler([0], [False], when, lambda _ts, _events, t, _u, _forward: times.append(t))
    ts.setMonitor(lambda _ts, _step, t, _u: lengths.append(t) if t > lengths[-1] else None)
    found = move(ts, u, 8)
    assert times == [pytest.approx(0.035)]
    other, w, _ = moving(structure)
    for step, h in enumerate(np.diff(lengths)):
        other.setTimeStep(h)
        move(other, w, step + 1)
    assert found == pytest.approx(w.getArray(), rel=1e-4, abs=1e-7)


@pytest.mark.filterwarnings("ignore:links turn")
def test_a_geometry_among_the_options_is_that_of_one_solve():
    """The result keeps it, the structure does not."""

    def frame(**more):
        return latinpc.Structure(
            [[-1, 0], [1, 0], [0, -0.1]], [[0, 2], [1, 2]], "bar", 1e3, fixed=[[1, 1], [1, 1], [0, 0]],
            load=[[0, 0], [0, 0], [0, -20.0]], mass=1.0, comm=PETSc.COMM_SELF, **more,
        )  # fmt: skip

    structure, other = frame(), frame(geometry="large").solve()
    small, large = structure.solve(), structure.solve(options={"snes_latin_geometry": "large"})
    assert structure.geometry == small.geometry == "linear" and large.geometry == "large"
    assert np.array_equal(structure.solve().displacements, small.displacements)
    assert large.tangent().norm() == pytest.approx(other.tangent().norm())
    assert large.modes(2).values == pytest.approx(other.modes(2).values)
    assert len(large.modes(buckling=True)) == len(other.modes(buckling=True)) and structure.geometry == "linear"
    with pytest.raises(latinpc.SolveError):
        structure.solve(options={"snes_latin_geometry": "large", "snes_latin_stop": "energy"})
    assert structure.geometry == "linear"


def test_a_path_that_ends_leaves_the_loads_as_they_were(monkeypatch):
    """Also where what is asked of its last equilibrium fails."""
    structure = latinpc.Structure(
        [[-1, 0], [1, 0], [0, 0.1]], [[0, 2], [1, 2]], "bar", 1e3, fixed=[[1, 1], [1, 1], [0, 1]],
        prescribed=[[0, 0], [0, 0], [0, 0.01]], load=[[0, 0], [0, 0], [1e3, 0]], geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip
    load, prescribed = structure.load, structure.prescribed
    monkeypatch.setattr("latinpc.results.limit.solvers.path", lambda snes: {"borne": 0.5, "branch": False})
    monkeypatch.setattr("latinpc.results.solve.softest", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        structure.solve(options={"snes_max_it": 0})
    assert np.array_equal(structure.load, load) and np.array_equal(structure.prescribed, prescribed)
