"""Links that turn: tangents, closed forms, an independent Newton's method, partitions, ranks, and what is refused."""

import sys

import numpy as np
import pytest
import turning
from motions import EVENTS, counts
from petsc4py import PETSc
from scipy.optimize import root
from support import logged
from turning import catenary, column, net, random_net, simplex, solve, von_mises

import latinpc
from latinpc.runs.solve import solve as run
from latinpc.scenes import Scene, make

NETS = {
    "flat": (10, 0.0, [0.0, 0.0, -500.0], None, 0.502210193820),
    "saddle": (10, 2.0, [0.0, 0.0, -500.0], 1.63586214690, 0.236856213531),
    "wide saddle": (30, 6.0, [20.0, 0.0, -50.0], 5.20657888792, 0.249810227159),
}


# ---- residual, tangent, energy -------------------------------------------------------------------
@pytest.mark.parametrize("geometry", ["prestress", "large"])
@pytest.mark.parametrize("structure", [simplex(30.0), von_mises(10.0), random_net(3)], ids=["simplex", "bars", "net"])
def test_residual_and_tangent_are_derivatives_of_the_energy(structure, geometry):
    """Central differences, along random directions, at random displacements."""
    s = latinpc.Structure(**structure, geometry=geometry)
    rng = np.random.default_rng(1)
    u, v, r, Jv = (s.create_vec() for _ in range(4))
    u.setArray(0.05 * rng.normal(size=u.getLocalSize()))
    v.setArray(rng.normal(size=u.getLocalSize()))
    J = s.dm.createMat()
    s.residual(u, r)
    s.jacobian(u, J)
    J.mult(v, Jv)
    h = 1e-6
    left, right, a, b = u.copy(), u.copy(), r.copy(), r.copy()
    left.axpy(-h, v)
    right.axpy(h, v)
    assert (s.energy(right) - s.energy(left)) / (2 * h) == pytest.approx(r.dot(v), rel=1e-6)
    s.residual(left, a)
    s.residual(right, b)
    assert np.allclose((b.array - a.array) / (2 * h), Jv.array, rtol=0.0, atol=1e-6 * abs(Jv.array).max())


@pytest.mark.parametrize("geometry", ["prestress", "large"])
@pytest.mark.parametrize("structure", [simplex(30.0), von_mises(10.0)], ids=["simplex", "bars"])
def test_the_tangent_to_ten_digits(structure, geometry):
    """Central differences of the residual, extrapolated twice, where no cable slackens."""
    s = latinpc.Structure(**structure, geometry=geometry)
    rng = np.random.default_rng(4)
    u, r, Jv = (s.create_vec() for _ in range(3))
    at, along = 2e-3 * rng.normal(size=u.getLocalSize()), rng.normal(size=u.getLocalSize())
    J, v = s.dm.createMat(), u.copy()
    u.setArray(at)
    v.setArray(along)
    s.jacobian(u, J)
    J.mult(v, Jv)

    def slope(h):
        sides = []
        for sign in (h, -h):
            u.setArray(at + sign * along)
            s.residual(u, r)
            sides.append(r.getArray().copy())
        return (sides[0] - sides[1]) / (2.0 * h)

    one, two, three = (slope(h) for h in (1e-3, 5e-4, 2.5e-4))
    found = (64.0 * three - 20.0 * two + one) / 45.0
    assert np.abs(found - Jv.array).max() < 1e-10 * np.abs(Jv.array).max()


def test_the_tangent_as_drawn_is_that_of_prestress():
    """Small angles are the limit of large ones."""
    structure = simplex(0.0)
    matrices = []
    for geometry in ("prestress", "large"):
        s = latinpc.Structure(**structure, geometry=geometry)
        J = s.dm.createMat()
        s.jacobian(s.create_vec(), J)
        matrices.append(J.convert("dense").getDenseArray().copy())
    assert np.allclose(*matrices, rtol=0.0, atol=1e-12 * abs(matrices[0]).max())
    assert np.linalg.eigvalsh(matrices[0]).min() > 0.0  # held by its prestress alone


def test_rotated_structures_move_alike():
    """Nothing depends on the axes."""
    structure = net(6, 1.0, [10.0, 5.0, -300.0])
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = {**structure, "nodes": structure["nodes"] @ Q.T, "load": structure["load"] @ Q.T}
    plain, rotated = solve(structure, error=1e-11), solve(turned, error=1e-11)
    assert np.allclose(rotated.displacements, plain.displacements @ Q.T, rtol=0.0, atol=1e-10)
    assert np.allclose(rotated.tensions, plain.tensions, rtol=0.0, atol=1e-6)


# ---- solutions ------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", NETS)
def test_known_nets(name):
    """The largest displacement of the first one as another program has it (corotational trusses)."""
    cells, rise, load, norm, largest = NETS[name]
    result = solve(net(cells, rise, load), error=1e-10)
    assert result.converged
    assert abs(result.displacements).max() == pytest.approx(largest, rel=0.0, abs=1e-9)
    if norm:
        assert np.linalg.norm(result.displacements) == pytest.approx(norm, rel=0.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_random_nets(seed):
    """Slack cables, several tensions and stiffnesses: Newton's method with increments, in numpy."""
    structure = random_net(seed)
    result = solve(structure, error=1e-10)
    reference = turning.newton(structure)
    assert result.converged
    assert np.linalg.norm(result.displacements - reference) < 1e-9 * np.linalg.norm(reference)


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", ["flat", "saddle"])
def test_the_error_asked_for_is_met(name, error):
    """The true one."""
    cells, rise, load, _, _ = NETS[name]
    structure = net(cells, rise, load)
    exact = solve(structure, error=1e-12).displacements
    result = solve(structure, error=error)
    assert result.converged
    assert np.linalg.norm(result.displacements - exact) <= error * np.linalg.norm(exact)


@pytest.mark.parametrize("part", [0.3, 0.9, 0.99])
def test_von_mises_truss_below_its_limit_point(part):
    """Not the equilibrium beyond the snap, which bears the same load."""
    limit = turning.von_mises_limit()
    result = solve(von_mises(part * limit), error=1e-11)
    assert result.converged
    assert -result.displacements[2, 1] == pytest.approx(turning.von_mises_deflection(part * limit), rel=1e-10)


@pytest.mark.parametrize("part", [1.02, 2.0, 8.0, 20.0, 1000.0])
def test_von_mises_truss_above_its_limit_point(part):
    """No equilibrium follows: the reason says so, and the displacements are those of a load that it bears."""
    result = solve(von_mises(part * turning.von_mises_limit()))
    assert result.reason == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    assert 0.0 < -result.displacements[2, 1] < turning.von_mises_deflection(turning.von_mises_limit() * (1 - 1e-12))


def test_a_user_may_choose_the_equilibrium_beyond_the_snap():
    """A solution vector that is not zero is the initial guess."""
    load = 0.5 * turning.von_mises_limit()
    beyond = np.zeros((3, 2))
    beyond[2, 1] = -0.65
    result = solve(von_mises(load), error=1e-10, guess=beyond)
    assert result.converged
    assert result.displacements[2, 1] < -0.6


@pytest.mark.parametrize("moment", [0.0, 10.0, 300.0, 3000.0, -100.0])
def test_simplex_under_torsion(moment):
    """Three struts and nine cables, a mechanism but for its prestress."""
    structure = simplex(moment)
    result = solve(structure, error=1e-11)
    reference = turning.newton(structure)
    assert result.converged
    assert np.linalg.norm(result.displacements - reference) <= 1e-10 * max(np.linalg.norm(reference), 1e-3)


@pytest.mark.parametrize("moment", [10.0, 300.0, 3000.0])
def test_simplex_under_torsion_by_its_symmetry(moment):
    """Radius, angle and height of the upper triangle are all that is unknown: their energy is stationary."""
    structure = simplex(moment)
    nodes, links = structure["nodes"], structure["links"][[3, 6, 9]]  # of the upper ring, a vertical cable, a strut
    prestress = structure["prestress"][[3, 6, 9]]
    natural = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1) - prestress / 1e5

    def upper(q):
        angle = np.arctan2(nodes[3:, 1], nodes[3:, 0]) + q[1]
        return np.column_stack([q[0] * np.cos(angle), q[0] * np.sin(angle), np.full(3, q[2])])

    def slope(q):
        turn, moved = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), np.vstack([nodes[:3], upper(q)])
        r = np.diff(moved[links], axis=1)[:, 0]
        size = np.linalg.norm(r, axis=1)
        f = (np.maximum(1e5 * (size - natural), [0.0, 0.0, -np.inf]) / size)[:, None] * r
        change = lambda x: np.array([x * [1.0, 1.0, 0.0] / q[0], turn @ x, [0.0, 0.0, 1.0]])  # noqa: E731
        slopes = sum(change(moved[b]) @ f[m] - (a > 2) * change(moved[a]) @ f[m] for m, (a, b) in enumerate(links))
        return slopes - moment / 3.0 * np.array([np.sin(q[1]), q[0] * np.cos(q[1]), 0.0])

    found = root(slope, [1.0, 0.0, 1.0], tol=1e-14)
    result = solve(structure, error=1e-12)
    assert result.converged
    assert np.abs(slope(found.x)).max() < 1e-8
    assert np.abs(nodes[3:] + result.displacements[3:] - upper(found.x)).max() < 1e-10


@pytest.mark.filterwarnings("ignore:no stable equilibrium", "ignore:not converged")
@pytest.mark.parametrize(("bars", "critical"), [(2, 50.0), (4, 100.0 / (4.0 * np.sin(3.0 * np.pi / 8.0) ** 2))])
def test_a_straight_column_buckles(bars, critical):
    """Hinged bars between springs of 100 N/m: straight it is in balance under any load, and that is no solution."""
    for part, holds in ((0.98, True), (1.02, False), (2.0, False)):
        result = latinpc.Structure(**column(bars, part * critical), geometry="large").solve(raise_on_failure=False)
        assert result.converged == holds
        assert abs(result.displacements[:, 0]).max() < 2e-5  # rounding, next to the critical load
        if holds:
            continue
        text = next(text for text in result.notices if "buckles" in text)
        borne = float(text.split("that of ")[1].split(" of the loads")[0])
        assert (1.0 - 0.02 * part) / part < borne < 1.0 / part
        assert sorted(map(int, text.split("its mode: ")[1].split(", "))) == list(range(1, bars))


@pytest.mark.filterwarnings("ignore:no stable equilibrium", "ignore:not converged", "ignore:no equilibrium")
def test_snap_through_and_short_chains_say_so():
    """The load factor and the nodes; lengths that no displacement meets."""
    made = latinpc.Structure(**von_mises(1.5 * turning.von_mises_limit()), geometry="large")
    result = made.solve(raise_on_failure=False)
    (text,) = (text for text in result.notices if "buckles" in text)
    assert 0.63 < float(text.split("that of ")[1].split(" of the loads")[0]) < 2.0 / 3.0
    assert text.endswith("its mode: 2")
    structure, _ = catenary(5)
    structure |= {"law": "inextensible", "stiffness": 0.0, "initial_elongation": 0.05}
    result = latinpc.Structure(**structure, geometry="large").solve(raise_on_failure=False)
    assert "no equilibrium: the lengths of inextensible cables are incompatible" in result.notices


@pytest.mark.parametrize("law", ["cable", "bar"])
def test_elastic_catenary(law):
    """The horizontal part of all tensions is one, the other follows from the weights. Drawn as a mechanism."""
    structure, exact = catenary()
    result = solve(structure | {"law": law}, error=1e-12)
    assert result.converged
    assert np.allclose(result.displacements, exact, rtol=0.0, atol=1e-10 * abs(exact).max())


@pytest.mark.parametrize("seed", range(3))
def test_prestress_in_balance_is_at_rest(seed):
    """A flat net turned into a slanted plane, without loads: rounding of its forces moves nothing."""
    structure = net(8, 0.0, [0.0, 0.0, 0.0])
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    result = solve(structure | {"nodes": structure["nodes"] @ Q.T})
    assert result.converged and result.iterations < 5
    assert abs(result.displacements).max() < 1e-12
    assert np.allclose(result.tensions, 1000.0, rtol=1e-9)


def test_one_dimension_and_two():
    """A chain of cables in a row, in 1D and in the plane."""
    for dim in (1, 2):
        nodes = np.zeros((4, dim))
        nodes[:, 0] = range(4)
        fixed = np.zeros((4, dim), bool)
        fixed[[0, 3]] = True
        load = np.zeros((4, dim))
        load[1, 0] = 30.0
        structure = {"nodes": nodes, "links": [[0, 1], [1, 2], [2, 3]], "law": "cable", "stiffness": 100.0}
        structure |= {"prestress": 50.0, "fixed": fixed, "load": load}
        result = solve(structure, error=1e-10)
        assert result.converged
        assert np.allclose(result.displacements[1:3, 0], [0.2, 0.1], rtol=0.0, atol=1e-9)


# ---- prestress ------------------------------------------------------------------------------------
def test_prestress_is_linear_and_exact():
    """A flat net under small loads: a membrane of stiffness T / l, in closed form a linear system."""
    structure = net(6, 0.0, [0.0, 0.0, -5.0])
    result = solve(structure, error=1e-10, geometry="prestress")
    free = ~structure["fixed"][:, 2]
    K = np.zeros((len(free), len(free)))
    for a, b in structure["links"]:
        K[np.ix_([a, b], [a, b])] += 1000.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    exact = np.linalg.solve(K[np.ix_(free, free)], structure["load"][free, 2])
    assert result.converged
    assert np.allclose(result.displacements[free, 2], exact, rtol=1e-10)


def test_small_loads_make_prestress_and_large_agree():
    """The relative difference falls with the loads."""
    far = []
    for scale in (0.02, 0.002):
        structure = net(6, 0.0, [20.0 * scale, 0.0, -100.0 * scale])
        small, large = (solve(structure, error=1e-10, geometry=g).displacements for g in ("prestress", "large"))
        far.append(np.linalg.norm(small - large) / np.linalg.norm(large))
    assert far[1] < 0.1 * far[0] < 2e-4


# ---- partitions, ranks, other solvers ----------------------------------------------------------------
@pytest.mark.parametrize("variant", ["primal", "macro", "corner", "none", "published", "auto"])
@pytest.mark.parametrize("name", ["flat", "saddle"])
def test_subdomains_change_nothing(name, variant):
    """METIS cuts the links, and the parts of one stay together."""
    cells, rise, load, _, largest = NETS[name]
    result = solve(net(cells, rise, load), error=1e-9, variant=variant, subdomains=6)
    assert result.converged
    assert abs(result.displacements).max() == pytest.approx(largest, rel=1e-8)
    assert sorted(set(result.subdomain)) == list(range(6))


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("variant", ["auto", "macro"])
def test_ranks_change_nothing(ranks_for, ranks, variant):
    """The same displacements and tensions on any number of ranks."""
    found = ranks_for(ranks, "turning", variant)
    assert found["reason"] > 0
    assert found["largest"] == pytest.approx(NETS["saddle"][4], rel=1e-8)
    assert found["norm"] == pytest.approx(NETS["saddle"][3], rel=1e-8)


def test_newtons_method_on_the_same_object(options):
    """Residual and Jacobian of a SNES are those of the displaced structure."""
    cells, rise, load, _, largest = NETS["flat"]
    s = latinpc.Structure(**net(cells, rise, load), geometry="large")
    options("-snes_type", "newtonls", "-pc_type", "lu", "-snes_rtol", "1e-12")
    snes = s.create_snes()
    snes.setFromOptions()
    u = s.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert abs(s.displacements(u)).max() == pytest.approx(largest, rel=1e-8)


# ---- how many linear stages ---------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "most"), [("flat", 25), ("saddle", 60), ("wide saddle", 60)])
def test_linear_stages_to_four_digits(name, most):
    """With one set of operators where no cable slackens, and with at most three where some do."""
    cells, rise, load, _, _ = NETS[name]
    structure = net(cells, rise, load)
    exact = solve(structure, error=1e-10).displacements
    result = solve(structure, reference=exact, stop="reference", stol=1e-4)
    assert result.converged
    assert result.iterations <= most
    assert result.renewals <= (0 if name == "flat" else 2)


@pytest.mark.parametrize(("name", "most", "renewals"), [("flat", 25, 1), ("saddle", 60, 2), ("wide saddle", 60, 3)])
def test_linear_stages_of_a_proved_error(name, most, renewals):
    """With the default stop: those of Newton's method count, and of tensions the error is met as well."""
    cells, rise, load, _, _ = NETS[name]
    structure = net(cells, rise, load)
    exact, result = solve(structure, error=1e-10), solve(structure)
    assert result.converged
    assert result.iterations <= most and result.renewals <= renewals
    for one, other in ((result.displacements, exact.displacements), (result.tensions, exact.tensions)):
        assert np.linalg.norm(one - other) < 1e-4 * np.linalg.norm(other)


@pytest.mark.parametrize(
    ("name", "options", "most", "renewals"),
    [
        ("saddle", {"side": 20}, 60, 2),
        ("saddle", {"side": 30, "prestress": 100.0, "load": 10.0}, 70, 4),
        ("saddle", {"side": 60, "prestress": 1000.0, "load": 5.0, "wind": 50.0}, 220, 10),
        ("hypar", {"side": 20, "load": 200.0}, 25, 2),
        ("tower", {}, 60, 2),
        ("bridge", {}, 60, 3),
        ("mast", {}, 25, 2),
        ("mast", {"wind": 200.0}, 400, 35),
        ("bridge", {"panels": 400, "prestress": 1e7}, 20, 3),
        ("tower", {"stages": 12}, 900, 100),
        ("tower", {"stages": 40, "struts": 6}, 2500, 250),
    ],
)
def test_linear_stages_of_scenes(name, options, most, renewals):
    """Guys that slacken halve the stiffness of a mast; a front of them creeps over it; towers take increments."""
    s = latinpc.Structure.from_scene(make(name, **options))
    snes, u = s.create_snes(), s.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert snes.getIterationNumber() <= most
    assert latinpc.path(snes)["renewals"] <= renewals
    assert 0.0 <= latinpc.tension_error(snes) <= 1e-4
    exact = s.create_vec()
    snes = s.create_snes()
    latinpc.set_error(snes, 1e-10)
    snes.solve(None, exact)
    exact.axpy(-1.0, u)
    assert exact.norm() < 1e-4 * u.norm()


@pytest.mark.parametrize("error", [1e-6, 1e-9, 1e-12])
def test_small_errors_where_a_front_creeps(error):
    """Newton's method is tried again however little error its first step has shown to be needed."""
    s = latinpc.Structure.from_scene(make("saddle", side=60, prestress=1000.0, load=5.0, wind=50.0))
    snes, u = s.create_snes(), s.create_vec()
    latinpc.set_error(snes, error)
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert snes.getIterationNumber() <= 300
    assert latinpc.path(snes)["renewals"] <= 12


def test_operators_serve_the_next_load():
    """Loads that change do not build anything again."""
    structure = net(8, 0.0, [0.0, 0.0, -100.0])
    s = latinpc.Structure(**structure, geometry="large")
    snes, u = s.create_snes(), s.create_vec()
    for scale in (1.0, 1.2):
        s.set_load(scale * structure["load"])
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        exact = turning.newton({**structure, "load": scale * structure["load"]})
        assert np.linalg.norm(s.displacements(u) - exact) < 1e-4 * np.linalg.norm(exact)


@pytest.mark.parametrize("variant", ["primal", "corner"])
def test_operators_made_anew_keep_what_does_not_turn(variant):
    """Counted by PETSc's log: subdomains and interfaces are made once, and so is the order of elimination."""
    structure = net(12, 2.0, [30.0, 0.0, -300.0], tension=200.0)
    exact = turning.newton(structure)
    with logged():
        before = np.array(counts())
        result = solve(structure, subdomains=4, variant=variant)
        seen = dict(zip(EVENTS, counts() - before))
    assert np.linalg.norm(result.displacements - exact) < 1e-4 * np.linalg.norm(exact)
    assert seen["LatinSetUp"] == result.renewals + 1 >= 3
    assert seen["LatinSubdomains"] == seen["LatinInterface"] == 1
    assert seen["MatCholFctrSym"] * seen["LatinSetUp"] == seen["MatCholFctrNum"]


# ---- options and errors -----------------------------------------------------------------------------
def test_the_option_sets_the_geometry(options):
    """Of the structure, for all that is asked of it afterwards."""
    cells, rise, load, _, largest = NETS["flat"]
    options("-snes_latin_geometry", "large", "-snes_latin_error", "1e-10")
    s = latinpc.Structure(**net(cells, rise, load))
    snes, u = s.create_snes(), s.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert abs(s.displacements(u)).max() == pytest.approx(largest, rel=0.0, abs=1e-9)
    assert s.tensions(u).min() > 1000.0


def test_a_mechanism_that_prestress_holds_names_the_option():
    """The refusal of small displacements says what to take."""
    with pytest.raises(PETSc.Error) as error:
        solve(net(6, 0.0, [0.0, 0.0, -5.0]), geometry="linear")
    assert "the geometry prestress or large (-snes_latin_geometry)" in latinpc.error_message(error.value)
    structure = net(6, 0.0, [0.0, 0.0, -5.0]) | {"prestress": None}
    with pytest.raises(PETSc.Error) as error:
        solve(structure, geometry="linear")
    assert "geometry prestress" not in latinpc.error_message(error.value)
    assert "take the geometry large (-snes_latin_geometry)" in latinpc.error_message(error.value)  # it hangs


def test_what_does_not_turn_is_refused():
    """Directions of their own at small angles, the energy stop, digits, states of solves in files."""
    plain = net(4, 0.0, [0.0, 0.0, -5.0])
    direction = np.zeros((len(plain["links"]), 3))
    direction[5] = [0.0, 0.0, 1.0]
    with pytest.raises(PETSc.Error) as error:
        latinpc.Structure(**plain, direction=direction, geometry="prestress")
    assert "Link 5 has a direction of its own" in latinpc.error_message(error.value)
    with pytest.raises(ValueError, match="geometry must be one of linear, prestress, large"):
        latinpc.Structure(**plain, geometry="small")
    with pytest.raises(PETSc.Error) as error:
        solve(plain, stop="energy")
    assert "take the stop error" in latinpc.error_message(error.value)
    s = latinpc.Structure(**plain, geometry="large")
    snes, u = s.create_snes(), s.create_vec()
    snes.solve(None, u)
    with pytest.raises(PETSc.Error) as error:
        latinpc.digits(snes)
    assert "the geometry of the structure is large" in latinpc.error_message(error.value)


def test_a_run_says_where_small_displacements_do_not_hold():
    """Once, by the angles of links and the size of displacements."""
    for scale, far in ((1.0, True), (0.01, False)):
        structure = net(10, 0.0, [0.0, 0.0, -500.0 * scale])
        arrays = {name: structure[name] for name in ("nodes", "links", "law", "stiffness", "fixed", "load")}
        scene = Scene(name="net", **arrays, initial_elongation=structure["prestress"] / structure["stiffness"])
        result = run(scene, structure=latinpc.Structure(**structure, geometry="prestress"))
        assert result.converged
        assert any("take -snes_latin_geometry large" in notice for notice in result.notices) == far
    result = run(scene, structure=latinpc.Structure(**structure, geometry="large"))
    assert result.converged and not result.notices


def test_a_view_says_what_was_done(tmp_path):
    """Geometry, operators made anew, and the part of the loads that is borne."""
    s = latinpc.Structure(**von_mises(2.0 * turning.von_mises_limit()), geometry="large")
    snes, u = s.create_snes(), s.create_vec()
    snes.solve(None, u)
    viewer = PETSc.Viewer().createASCII(str(tmp_path / "view"))
    snes.view(viewer)
    viewer.flush()
    text = (tmp_path / "view").read_text()
    assert "geometry large: operators rebuilt" in text
    assert 0.45 < float(text.split("times; ")[1].split(" of the loads borne")[0]) <= 0.5


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
