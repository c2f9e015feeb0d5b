"""Paths of equilibria: units, parts that snap through, and what an error leaves behind."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import turning
from petsc4py import PETSc
from turning import catenary, hanging, net, random_net, simplex, solve, von_mises

import latinpc
from latinpc.bench.extremes import drawn
from latinpc.scenes import make

CHAIN = hanging(
    np.column_stack([np.linspace(0.0, 8.0, 13), np.zeros(13)]),
    np.column_stack([np.arange(12), np.arange(1, 13)]),
    10.0 / 12.0,
    [0, 12],
    -5.0,
) | {"law": "inextensible", "stiffness": 0.0}  # fmt: skip
STRUCTURES = {
    "saddle": net(6, 1.0, [10.0, 0.0, -300.0]),
    "simplex": simplex(300.0),
    "random": random_net(2),
    "catenary": catenary()[0],
    "chain": CHAIN,
    "truss below its limit point": von_mises(0.9 * turning.von_mises_limit()),
    "truss above it": von_mises(2.0 * turning.von_mises_limit()),
}


@pytest.mark.parametrize("name", STRUCTURES)
def test_units_change_nothing(name):
    """Forces of nanonewtons and giganewtons, lengths of millimetres and kilometres: no floor has a unit."""
    plain = solve(STRUCTURES[name], error=1e-9)
    for force, length in ((1e-9, 1.0), (1e9, 1.0), (1.0, 1e-3), (1.0, 1e3), (1e-9, 1e3), (1e9, 1e-3)):
        other = solve(turning.scaled(STRUCTURES[name], force, length), error=1e-9)
        assert other.reason == plain.reason
        assert other.borne == pytest.approx(plain.borne, rel=1e-3)
        far = np.linalg.norm(other.displacements / length - plain.displacements)
        assert far < 1e-9 * np.linalg.norm(plain.displacements)
        assert np.linalg.norm(other.tensions / force - plain.tensions) < 1e-8 * np.linalg.norm(plain.tensions)


@pytest.mark.parametrize("part", [0.9, 2.0, 20.0])
def test_a_small_part_that_snaps_through_beside_a_large_net(part):
    """The net moves further than the truss does in its snap: that of each node counts, not that of all together."""
    result = solve(turning.hidden(part), error=1e-9)
    deflection = -result.displacements[-1, 1]
    assert result.converged == (part < 1.0)
    if result.converged:
        assert deflection == pytest.approx(turning.von_mises_deflection(part * turning.von_mises_limit()), rel=1e-8)
    else:
        assert deflection < turning.HEIGHT
        assert 0.99 < part * result.borne <= 1.0


def shallow(height, times):
    """A truss two metres wide, so high, under so many times its limit load, downward, where it may hang."""
    y = np.linspace(0.0, abs(height), 100001)
    limit = (2e4 * (np.hypot(1.0, height) - np.hypot(1.0, y)) * y / np.hypot(1.0, y)).max()
    return latinpc.Structure(
        [[-1, 0], [1, 0], [0, height]], [[0, 2], [1, 2]], "bar", stiffness=1e4, fixed=[[1, 1], [1, 1], [0, 0]],
        load=[[0, 0], [0, 0], [0, -times * limit]], geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("times", [3e3, 9e3, 3e4, 1e5])
@pytest.mark.parametrize("height", [0.2, 0.02, 0.005])
def test_a_snap_under_a_small_part_of_the_loads(height, times):
    """Refused at the limit point, to a thousandth of itself, as a snap; what sags stiffens as much, and bears them."""
    found, sagging = shallow(height, times).solve(), shallow(-height, times).solve()
    assert not found.converged
    assert 1 - 1e-3 < times * found.report["load_factor"] <= 1.0
    assert any("snaps through" in text for text in found.notices)
    assert sagging.converged


def test_a_cable_that_tightens_at_once():
    """Soft until a gap of 1e-8 m closes: a structure that stiffens has not snapped through."""
    structure = {"nodes": [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 1.0]], "links": [[0, 1], [2, 1], [1, 3]]}
    structure |= {"law": ["bar", "cable", "bar"], "stiffness": [1.0, 1e5, 1.0], "initial_elongation": [0.0, -1e-8, 0.0]}
    structure |= {"fixed": [[True, True], [False, False], [True, True], [True, True]]}
    result = solve(structure | {"load": [[0.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]}, error=1e-9)
    assert result.converged
    assert -result.displacements[1, 0] == pytest.approx((1.0 + 1e5 * 1e-8) / (1.0 + 1e5), rel=1e-6)


@pytest.mark.parametrize("gap", [0.01, 0.3, 0.7])
@pytest.mark.parametrize("stiffness", [1e2, 1e6])
def test_a_cable_that_tightens_on_the_way(stiffness, gap):
    """No increment of the loads is small enough for the tangent stiffness of before to hold: that is no limit point."""
    nodes = np.array([[0, 0], [-100, 0], [0, 100], [0, -100], [-10, 0]], dtype=float)
    load = np.zeros((5, 2))
    load[0, 0] = 1.0
    structure = latinpc.Structure(
        nodes,
        [[0, 1], [0, 2], [0, 3], [0, 4]],
        ["bar", "bar", "bar", "cable"],
        [1.0, 10.0, 10.0, stiffness],
        fixed=np.repeat(np.arange(5)[:, None] > 0, 2, axis=1),
        load=load,
        geometry="large",
        initial_elongation=np.array([0.0, 0.0, 0.0, -gap]),
    )
    result = structure.solve(error=1e-8)
    assert result.converged
    moved = (1.0 + stiffness * gap) / (1.0 + stiffness)  # what the bars across bear as they turn by 0.01 is below 1e-6
    assert result.displacements[0] == pytest.approx([moved, 0.0], rel=1e-5, abs=1e-12)
    assert result.tensions[3] == pytest.approx(stiffness * (result.displacements[0, 0] - gap), rel=1e-6)


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks_see_what_snaps_through(ranks_for, ranks):
    """The path ends at the same load."""
    found = ranks_for(ranks, "turning", "snaps")
    assert found["reason"] == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    assert 0.99 < 20.0 * found["borne"] <= 1.0
    assert abs(found["last"]) < turning.HEIGHT


def least(structure, u):
    """The least eigenvalue of the tangent stiffness (N/m)."""
    tangent = structure.dm.createMat()
    structure.jacobian(u, tangent)
    return np.linalg.eigvalsh(tangent.convert("dense").getDenseArray())[0]


@pytest.mark.parametrize("load", [49.0, 55.0, 75.0, 200.0])
def test_a_column_under_loads_that_grow_in_one_vector(load):
    """The last solution is the guess: straight, it is an equilibrium under any load, and unstable beyond 50 N."""
    column = latinpc.Structure(**turning.column(2, 40.0), geometry="large")
    snes, u = column.create_snes(), column.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    column.set_load(column.load * load / 40.0)
    snes.solve(None, u)
    assert (snes.getConvergedReason() > 0) == (load < 50.0)
    assert least(column, u) > 0.0
    assert latinpc.path(snes)["borne"] == pytest.approx(min(1.0, 50.0 / load), abs=3e-4)
    assert latinpc.path(snes)["renewals"] < 25  # branches are sought as well


def test_a_guess_that_is_unstable_is_left():
    """A column that a guess holds straight beyond its critical load: the path starts from no loads."""
    column = latinpc.Structure(**turning.column(2, 75.0), geometry="large")
    snes, u = column.create_snes(), column.create_vec()
    straight = np.zeros((4, 2))
    straight[1:3, 1] = -75.0 / 1e6, -2 * 75.0 / 1e6
    column.set_displacements(straight, u)
    snes.solve(None, u)
    assert snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    assert latinpc.path(snes)["borne"] == pytest.approx(50.0 / 75.0, abs=5e-4)
    assert least(column, u) > 0.0


def test_a_truss_does_not_snap_through_from_a_guess():
    """From half of the load that it bears to all but a little of it there are equilibria on its side."""
    limit = turning.von_mises_limit()
    truss = latinpc.Structure(**von_mises(0.5 * limit), geometry="large")
    snes, u = truss.create_snes(), truss.create_vec()
    snes.solve(None, u)
    truss.set_load(truss.load * (0.995 / 0.5))
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert -truss.displacements(u)[2, 1] == pytest.approx(turning.von_mises_deflection(0.995 * limit), rel=1e-4)


def test_a_mast_from_a_guess_next_to_its_limit_point():
    """Newton's method ended in an unstable equilibrium next to the path, which ends at 0.57864 of the loads."""
    mast = latinpc.Structure.from_scene(make("mast", load=20000.0))
    whole = mast.load.copy()
    snes, u = mast.create_snes(), mast.create_vec()
    for part in (0.5782, 0.57852, 0.57855, 0.579):
        mast.set_load(whole * part)
        snes.solve(None, u)
        assert (snes.getConvergedReason() > 0) == (part < 0.57864)
        assert least(mast, u) > 0.0
        assert 0.578 < part * latinpc.path(snes)["borne"] < 0.57864


def test_an_error_leaves_nothing_behind():
    """A monitor that raises in the middle of a path: right-hand side and solver are as before."""
    s = latinpc.Structure(**von_mises(0.5 * turning.von_mises_limit()), geometry="large")
    snes, b = s.create_snes(), s.create_vec()
    b.set(0.0)
    told = []

    def monitor(_snes, it, _norm):
        told.append(it)
        if it > 0 and len(told) < 5:
            raise RuntimeError("enough")

    snes.setMonitor(monitor)
    for _ in range(2):
        # PETSc locks the solution while monitors run, and an error leaves it locked: a new one each time.
        with pytest.raises(RuntimeError) as raised:
            snes.solve(b, s.create_vec())
        # Newer versions of petsc4py wrap what a monitor raises.
        assert "enough" in f"{raised.value}\n{raised.value.__cause__}"
        del raised  # its traceback holds the SNES
    u = s.create_vec()
    snes.solve(b, u)
    assert snes.getConvergedReason() > 0
    exact = turning.von_mises_deflection(0.5 * turning.von_mises_limit())
    assert -s.displacements(u)[2, 1] == pytest.approx(exact, rel=1e-4)
    snes.destroy()
    assert b.refcount == 1


def test_a_snap_to_where_a_tower_is_soft():
    """At 0.8741 of the loads a cable slackens, and no equilibrium is near: the next one is 7.6 times softer."""
    tower = latinpc.Structure.from_scene(drawn.draw(818103, 16, "large").scene)
    snes, u = tower.create_snes(), tower.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    assert latinpc.path(snes)["borne"] == pytest.approx(0.8741, abs=2e-4)


def test_the_iteration_alone_names_no_limit_point():
    """Bars in compression disturb it: where it ends says nothing of the structure, which bears the whole loads."""
    scene = drawn.draw(34003, 5, "large").scene
    s = latinpc.Structure.from_scene(scene)
    assert s.solve().converged
    found = s.solve(options={"snes_latin_newton": "never", "snes_latin_error": 1e-6})
    assert (found.converged, found.report["reason"]) == (False, "DIVERGED_MAX_IT")
    part = found.report["load_factor"]
    assert 0.0 < part < 1.0
    assert found.notices == [f"the solve ended before the whole loads: displacements are those of {part:.4g} of them"]
    held = latinpc.Structure.from_scene(replace(scene, load=part * scene.load)).solve(error=1e-8)
    assert np.linalg.norm(found.displacements - held.displacements) < 1e-4 * np.linalg.norm(held.displacements)


@pytest.mark.parametrize("name", ["mast", "tower", "bridge"])
@pytest.mark.parametrize("stop", [{"snes_stol": 1e-13}, {"snes_latin_stop": "residual", "snes_rtol": 1e-12}])
def test_a_tolerance_below_rounding_is_no_buckling(name, stop):
    """The solve ends there or at rounding, with the displacements and under all the loads."""
    scene = make(name)
    plain = scene.solve()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tight = scene.solve(options=stop)
    assert tight.report["reason"] in ("CONVERGED_SNORM_RELATIVE", "CONVERGED_FNORM_RELATIVE", "DIVERGED_INNER")
    assert tight.report["residual_norm"] < 1e-6 * np.linalg.norm(scene.load)
    assert tight.iterations < 500
    assert np.linalg.norm(tight.displacements - plain.displacements) < 1e-3 * np.linalg.norm(plain.displacements)


@pytest.mark.parametrize("straight", [False, True])
def test_a_chain_of_bars_hangs_as_one_of_cables(straight):
    """Where bars as cables all pull it is their least energy. 400 took seconds; straight ones were refused."""
    x = np.linspace(0.0, 200.0, 401)
    nodes = np.column_stack([x, 0.0 * x if straight else -22.0 * (1.0 - (x / 100.0 - 1.0) ** 2)])
    links = np.column_stack([np.arange(400), np.arange(1, 401)])
    fixed = np.zeros(nodes.shape, bool)
    fixed[[0, -1]] = True
    load = np.where(fixed, 0.0, [0.0, -30.0])
    given = {"fixed": fixed, "load": load, "EA": 3e7, "initial_elongation": -0.015 if straight else 0.0}
    bars, cables = (
        latinpc.Structure(nodes, links, law, **given, geometry="large").solve(error=1e-8) for law in ("bar", "cable")
    )
    assert bars.converged and cables.converged and bars.iterations < 1000
    assert bars.tensions.min() > 0.0
    far = np.abs(bars.displacements - cables.displacements).max()
    assert far < 1e-7 * np.abs(cables.displacements).max()
    assert np.abs(bars.tensions - cables.tensions).max() < 1e-7 * cables.tensions.max()


def the_tower_of_twelve_stages():
    random = np.random.default_rng(132)
    tower = make("tower", stages=12, prestress=12e3, load=227.6, wind=153.4, torque=807.0)
    return replace(tower, load=tower.load * (1.0 + 0.3 * random.standard_normal(tower.load.shape)))


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning", "ignore::latinpc.ConvergenceWarning")
@pytest.mark.parametrize(
    "tower",
    [
        pytest.param(the_tower_of_twelve_stages(), id="which whole steps of Newton's method reach"),
        pytest.param(
            make("tower", stages=13, struts=5, prestress=309.0, load=11.5, wind=1.92, torque=308.0),
            id="two and a half times as soft",
        ),
    ],
)
def test_a_limit_point_beside_another_branch_is_that_of_small_increments(tower):
    """Another equilibrium bears all loads of these towers; from zero none leads there: the path ends under half."""
    at_once = tower.solve()
    net = latinpc.Structure.from_scene(tower)
    snes, u = net.create_snes(), net.create_vec()
    latinpc.set_warm_start(snes, "last")
    for part in np.arange(1, 251) / 250.0:
        net.set_load(part * tower.load)
        snes.solve(None, u)
        if snes.getConvergedReason() < 0:
            break
    assert at_once.converged == (snes.getConvergedReason() > 0)
    assert at_once.report["load_factor"] == pytest.approx(part * latinpc.path(snes)["borne"], abs=1e-3)
    assert np.linalg.norm(at_once.displacements) == pytest.approx(u.norm(), rel=1e-2)


def test_increments_stay_as_long_on_a_smooth_path():
    """A tower of 12 stages: if each increment is tested before it is solved for, they shrink, with 62 set-ups."""
    structure = latinpc.Structure.from_scene(make("tower", stages=12), PETSc.COMM_SELF)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert latinpc.path(snes)["renewals"] < 52
