"""Natural frequencies and buckling factors: closed forms, dense references, ranks, and what is refused."""

import json
import sys
import types
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import turning
from command import latinpc as command
from conftest import run
from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

try:
    from slepc4py import SLEPc  # noqa: F401
except ImportError:
    slepc = pytest.mark.skip(reason="SLEPc is not installed")
else:
    slepc = pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")

LATINPC = Path(sys.executable).parent / "latinpc"


def string(nodes=10, tension=1000.0, length=0.5, mass=0.3, stiffness=1e9):
    """Masses on a cable of high stiffness, taut between two supports, in the plane."""
    places = np.zeros((nodes + 2, 2))
    places[:, 0] = length * np.arange(nodes + 2)
    fixed = np.zeros((nodes + 2, 2), bool)
    fixed[[0, -1]] = True
    links = np.column_stack([np.arange(nodes + 1), np.arange(1, nodes + 2)])
    structure = {"nodes": places, "links": links, "law": "cable", "stiffness": stiffness, "prestress": tension}
    return structure | {"fixed": fixed, "mass": mass, "geometry": "large"}


def string_frequencies(nodes=10, tension=1000.0, length=0.5, mass=0.3):
    """Of the masses across the string (Lagrange): 1/pi sqrt(T / m l) sin(k pi / 2 (n + 1)), in Hz."""
    k = np.arange(1, nodes + 1)
    return np.sqrt(tension / (mass * length)) / np.pi * np.sin(0.5 * np.pi * k / (nodes + 1))


def slack_net(mass=20.0):
    """Return a saddle under snow that leaves some cables slack, solved."""
    structure = turning.net(8, 1.6, [30.0, 0.0, -500.0])
    return latinpc.Structure(**structure, geometry="large", mass=mass, name="saddle").solve(error=1e-9)


def arrays(structure, u, tensions, tangents):
    """Elastic and geometric stiffness in numpy, all degrees of freedom, of a displaced structure."""
    count, dim = structure.nodes.shape
    elastic, geometric = np.zeros((2, count, dim, count, dim))
    line = np.diff((structure.nodes + u)[structure.links], axis=1)[:, 0]
    for m, (a, b) in enumerate(structure.links):
        size = np.linalg.norm(line[m])
        nn = np.outer(line[m], line[m]) / size**2
        for p, q, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
            elastic[p, :, q] += sign * tangents[m] * nn
            geometric[p, :, q] += sign * tensions[m] / size * (np.eye(dim) - nn)
    free = ~structure.fixed.ravel()
    return [K.reshape(count * dim, -1)[np.ix_(free, free)] for K in (elastic, geometric)]


def dense(matrix):
    return matrix.convert("dense").getDenseArray().copy()


# ---- matrices -------------------------------------------------------------------------------------------
def test_the_tangent_is_elastic_and_geometric_stiffness():
    """At a state with slack cables: what the library has, beside sums over the links in numpy."""
    result = slack_net()
    s = result.structure
    assert 0 < result.slack.sum() < len(s.links) / 2
    u, G = s.create_vec(), s.dm.createMat()
    s.set_displacements(result.displacements, u)
    elastic, geometric = arrays(s, result.displacements, result.tensions, np.where(result.slack, 0.0, s.stiffness))
    s.geometric_stiffness(u, result.tensions, G)
    size = abs(elastic).max()
    assert np.allclose(dense(G), geometric, rtol=0.0, atol=1e-12 * size)
    assert np.allclose(dense(result.tangent()), elastic + geometric, rtol=0.0, atol=1e-12 * size)


@pytest.mark.parametrize("geometry", ["prestress", "large"])
def test_rates_of_tensions_are_their_derivative(geometry):
    """Central differences along a random direction, zero in slack cables."""
    s = latinpc.Structure(**turning.random_net(2), geometry=geometry)
    rng = np.random.default_rng(0)
    u, v = s.create_vec(), s.create_vec()
    u.setArray(0.05 * rng.normal(size=u.getLocalSize()))
    v.setArray(rng.normal(size=u.getLocalSize()))
    rates = s.tension_rates(u, v)
    left, right = u.copy(), u.copy()
    left.axpy(-1e-7, v)
    right.axpy(1e-7, v)
    by_differences = (s.tensions(right) - s.tensions(left)) / 2e-7
    assert np.allclose(rates, by_differences, rtol=0.0, atol=1e-6 * abs(rates).max())
    assert (rates[s.tensions(u) == 0.0] == 0.0).all() and (rates == 0.0).any()


def test_links_that_keep_their_direction_have_no_geometric_stiffness():
    """The error says what to set."""
    s = latinpc.Structure(**turning.von_mises(1.0))
    with pytest.raises(PETSc.Error) as error:
        s.geometric_stiffness(s.create_vec(), 1.0, s.dm.createMat())
    assert "take -snes_latin_geometry prestress, or large" in latinpc.error_message(error.value)
    s.set_geometry("large")
    with pytest.raises(PETSc.Error) as error:
        s.geometric_stiffness(s.create_vec(), 1.0, PETSc.Mat().createAIJ(5, nnz=1))
    assert "does not belong to this structure" in latinpc.error_message(error.value)


# ---- frequencies -----------------------------------------------------------------------------------------
@slepc
@pytest.mark.parametrize("geometry", ["prestress", "large"])
def test_vibrating_string(geometry):
    """All ten modes across it, in closed form; those along it lie far above."""
    structure = latinpc.Structure(**string() | {"geometry": geometry})
    shape = np.sin(np.arange(1, 11) * np.pi / 11)
    for state in (structure, structure.solve(error=1e-8)):
        found = latinpc.modes(state, 10)
        assert np.allclose(found.frequencies, string_frequencies(), rtol=1e-9)
        assert abs(found.shapes[:, :, 0]).max() < 1e-6
        assert np.allclose(abs(found.shapes[0, 1:-1, 1]), shape / shape.max())
        assert not found.mechanisms.any() and max(found.residuals) < 1e-7
    assert latinpc.modes(structure, 50).frequencies.shape == (20,)  # all there are


@slepc
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks_change_no_mode(mpirun, ranks):
    """The string, and the factors of a saddle of bars."""
    found = json.loads(mpirun(ranks, __file__).stdout)
    assert np.allclose(found["string"], string_frequencies()[:6], rtol=1e-9)
    one = latinpc.Structure(**bars(), geometry="large").solve(error=1e-10).modes(4, buckling=True)
    assert np.allclose(found["factors"], one.factors, rtol=1e-7)


@slepc
@pytest.mark.parametrize("mass", [20.0, "random", "some"])
def test_partly_slack_net_beside_dense_matrices(mass):
    """Masses that differ, and nodes that have none."""
    result = slack_net()
    s, rng = result.structure, np.random.default_rng(0)
    masses = rng.uniform(1.0, 50.0, len(s.nodes)) if mass != 20.0 else np.full(len(s.nodes), mass)
    if mass == "some":
        masses[rng.random(len(masses)) < 0.7] = 0.0
    s.set_mass(masses)
    found = result.modes(8)
    elastic, geometric = arrays(s, result.displacements, result.tensions, np.where(result.slack, 0.0, s.stiffness))
    diagonal = np.repeat(masses[:, None], 3, axis=1)[~s.fixed]
    inverse = scipy.linalg.eigh(np.diag(diagonal), elastic + geometric, eigvals_only=True)[::-1]  # 1 / omega^2
    assert np.allclose((2.0 * np.pi * found.frequencies) ** 2, 1.0 / inverse[:8], rtol=1e-7)


@slepc
def test_prestress_stiffness_of_the_simplex_mechanism():
    """Rigid links leave it one motion: the upper triangle turns by 1 and sinks by 1/2.

    The stress energy of this motion is 9 q of the triangle's force density, over the masses 3 m (1 + 1/4).
    """
    misses = []
    for stiffness in (1e5, 1e6, 1e7):
        structure = turning.simplex(0.0) | {"stiffness": stiffness}
        density = structure["prestress"][3] / np.sqrt(3.0)
        found = latinpc.modes(latinpc.Structure(**structure, geometry="large", mass=2.0), 1)
        assert np.allclose(abs(found.shapes[0, 3:, 2]), np.sqrt(0.2), rtol=2e3 / stiffness)
        misses.append(1.0 - (2.0 * np.pi * found.frequencies[0]) ** 2 / (2.4 * density / 2.0))
    assert np.allclose(misses, 2.64e-3 * np.array([1.0, 0.1, 0.01]), rtol=0.02)  # of the first order in T / EA


@slepc
def test_mechanisms_are_named():
    """One of the simplex without the stiffness of its prestress, and none with it."""
    structure = turning.simplex(0.0) | {"mass": 2.0}
    with pytest.warns(
        latinpc.LatinWarning, match="1 mechanism, modes of no stiffness, at nodes 3, 4, 5; prestress holds"
    ):
        found = latinpc.modes(latinpc.Structure(**structure), 3)
    assert list(found.mechanisms) == [True, False, False]
    assert found.frequencies[0] == 0.0 and "0 Hz, mechanism" in str(found)
    assert not latinpc.modes(latinpc.Structure(**structure, geometry="prestress"), 3).mechanisms.any()
    free = latinpc.Structure([[0.0, 0.0], [1.0, 0.0]], [[0, 1]], "bar", 1e3, mass=1.0)  # two shifts, a rotation
    assert list(latinpc.modes(free, 4).mechanisms) == [True, True, True, False]
    assert latinpc.modes(free, 4).notices[0].startswith("3 mechanisms, modes of no stiffness")
    assert latinpc.modes(free, 2).notices[0].startswith("at least 2 mechanisms, modes of no stiffness")
    assert latinpc.modes(free, 4).frequencies[3] == pytest.approx(np.sqrt(2e3) / (2.0 * np.pi))


@slepc
@pytest.mark.filterwarnings("ignore:.*mechanism")
def test_residuals_of_mechanisms_are_small():
    """Nodes that slack cables do not hold have values of zero, to which no residual is relative; JSON takes all."""
    structure = turning.net(3, 1.0, [0.0, 0.0, 0.0]) | {"prestress": 0.0, "mass": 1.0}
    cables = len(structure["links"])
    structure |= {"stiffness": np.full(cables, 1e6), "initial_elongation": np.full(cables, -1e-3)}
    structure.pop("prestress")
    structure.pop("EA", None)
    free = latinpc.Structure([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]], [[0, 1], [1, 2], [0, 2]], "bar", 1e3, mass=1.0)
    for found in (latinpc.modes(latinpc.Structure(**structure), 6), latinpc.modes(free, 6)):
        assert found.mechanisms[:3].all()
        assert found.residuals.max() < 1e-5
        json.dumps(found.to_dict(), allow_nan=False)
    dense = 1e3 * np.linalg.eigvalsh(sum(np.outer(row, row) for row in triangle()))
    assert np.allclose(found.values[3:], dense[3:], rtol=1e-10)


def triangle():
    """Elongations of the three bars of a triangle, as rows."""
    x, rows = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]), np.zeros((3, 3, 2))
    for row, (a, b) in zip(rows, [(0, 1), (1, 2), (0, 2)]):
        row[b] = (x[b] - x[a]) / np.linalg.norm(x[b] - x[a])
        row[a] = -row[b]
    return rows.reshape(3, 6)


@slepc
def test_states_that_are_not_stable_say_so():
    """The simplex whose cables push and whose struts pull."""
    structure = turning.simplex(0.0)
    structure |= {"prestress": -structure["prestress"], "law": "bar", "mass": 2.0}
    with pytest.warns(latinpc.LatinWarning, match="the state is not stable: 1 mode has a negative stiffness"):
        found = latinpc.modes(latinpc.Structure(**structure, geometry="large"), 3)
    assert found.frequencies[0] < 0.0 < found.frequencies[1]
    assert "unstable" in found.label(0)


# ---- factors ---------------------------------------------------------------------------------------------
def bars(load=-40.0):
    """A saddle of bars under a load that it bears."""
    structure = turning.net(6, 1.8, [0.0, 0.0, load])
    return structure | {"law": "bar", "name": "saddle of bars"}


@slepc
def test_von_mises_truss_as_drawn():
    """The linearised load of the snap: 2 k sin^2 a l sin a / cos^2 a, of a unit load."""
    s = latinpc.Structure(**turning.von_mises(1.0), geometry="large")
    length = np.hypot(1.0, turning.HEIGHT)
    sine, cosine = turning.HEIGHT / length, 1.0 / length
    found = latinpc.modes(s, 2, buckling=True)
    snap = 2.0 * turning.STIFFNESS * length * sine**3 / cosine**2
    aside = 2.0 * turning.STIFFNESS * length * cosine**2 / sine
    assert np.allclose(found.factors, [snap, aside], rtol=1e-9)
    assert np.allclose(abs(found.shapes[0, 2]), [0.0, 1.0], atol=1e-8)
    doubled = latinpc.modes(s, 1, buckling=True, load=2.0 * s.load)
    assert doubled.factors[0] == pytest.approx(0.5 * snap, rel=1e-9)


@slepc
@pytest.mark.parametrize("part", [0.1, 0.5, 0.9, 0.999])
def test_von_mises_truss_under_load(part):
    """At equilibrium, in closed form; one at the limit point."""
    load = part * turning.von_mises_limit()
    found = latinpc.Structure(**turning.von_mises(load), geometry="large").solve(error=1e-12).modes(1, buckling=True)
    z, k = turning.HEIGHT - turning.von_mises_deflection(load), turning.STIFFNESS
    size = np.hypot(1.0, z)
    sine, cosine, tension = z / size, 1.0 / size, k * (size - np.hypot(1.0, turning.HEIGHT))
    tangent = 2.0 * (k * sine**2 + tension / size * cosine**2)
    assert found.factors[0] == pytest.approx(1.0 + tangent**2 * size / (2.0 * k * sine * cosine**2 * load), rel=1e-8)
    assert found.factors[0] > 1.0 and (part < 0.99 or found.factors[0] < 1.01)


@slepc
@pytest.mark.parametrize("law", ["bar", "mixed"])
def test_factors_make_the_tangent_singular(law):
    """A saddle of bars, or of bars and cables of which some are slack: K + mu G beside dense matrices."""
    structure = bars(-100.0 if law == "bar" else -400.0)
    if law == "mixed":
        structure["law"] = np.where(np.arange(len(structure["links"])) % 3, "bar", "cable")
    result = latinpc.Structure(**structure, geometry="large").solve(error=1e-10)
    s = result.structure
    assert result.slack.any() == (law == "mixed")
    found = result.modes(5, buckling=True)
    assert len(found) == 5 and (found.factors > 1.0).all()
    tangents = np.where(result.slack, 0.0, s.stiffness)
    elastic, geometric = arrays(s, result.displacements, result.tensions, tangents)
    K, moved = elastic + geometric, np.zeros(s.nodes.shape)
    moved[~s.fixed] = np.linalg.solve(K, s.load[~s.fixed])
    line = np.diff((s.nodes + result.displacements)[s.links], axis=1)[:, 0]
    along = np.einsum("ij,ij->i", line, np.diff(moved[s.links], axis=1)[:, 0]) / np.linalg.norm(line, axis=1)
    G = arrays(s, result.displacements, tangents * along, tangents)[1]
    inverse = scipy.linalg.eigh(G, K, eigvals_only=True)  # -1 / mu
    assert np.allclose(found.factors, 1.0 - 1.0 / inverse[:5], rtol=1e-6)


def tower(load):
    """A simplex of three struts that cables hold, those between the levels links 3 to 5; a load on each upper node."""
    turn = 2.0 * np.pi * np.arange(3) / 3.0
    levels = ((0.0, turn), (2.0, turn + 5.0 * np.pi / 6.0))
    nodes = np.vstack([np.column_stack([np.cos(at), np.sin(at), np.full(3, z)]) for z, at in levels])
    struts, cables = ([[i, 3 + (i + k) % 3] for i in range(3)] for k in (0, 2))
    links = np.array([*struts, *cables, [3, 4], [4, 5], [5, 3]])
    lengths = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1)
    up = np.repeat([0.0, 1.0], 3)[:, None]
    return latinpc.Structure(
        nodes, links, ["bar"] * 3 + ["cable"] * 6, EA=np.repeat([5e6, 5e5], [3, 6]), geometry="large",
        prestress=3e3 * lengths * np.repeat([-1.0, 1.0, 1.0 / np.sqrt(3.0)], 3),
        fixed=np.repeat(up == 0.0, 3, axis=1), load=up * [0.0, 0.0, -load],
    )  # fmt: skip


@slepc
def test_links_that_slacken_before_the_least_factor_are_named():
    """Steep cables of a simplex go slack under its loads, and it buckles there, at half of its least factor."""
    state = tower(60e3).solve(error=1e-10)
    with pytest.warns(latinpc.LatinWarning, match=r"slacken links 3, 4, 5 at a factor of about 1.16, below the least"):
        found = state.modes(2, buckling=True)
    assert found.factors[0] > 2.6
    assert tower(1.14 * 60e3).solve().converged
    with pytest.warns(latinpc.ConvergenceWarning):
        beyond = tower(1.16 * 60e3).solve()
    assert 1.14 < 1.16 * beyond.report["load_factor"] < 1.155


@slepc
def test_loads_that_stiffen_have_no_factor():
    """Snow on a net of cables pulls all that are taut."""
    with pytest.warns(latinpc.LatinWarning, match="no positive factor"):
        found = slack_net().modes(3, buckling=True)
    assert len(found) == 0


# ---- what is refused ---------------------------------------------------------------------------------------
@slepc
def test_misuse_is_named():
    """Masses, loads, geometry, rigid links, a mechanism, the wrong kind of value."""
    s = latinpc.Structure(**turning.von_mises(1.0))
    with pytest.raises(ValueError, match="frequencies need masses: give mass"):
        latinpc.modes(s)
    with pytest.raises(ValueError, match="geometry is linear: take geometry='large'"):
        latinpc.modes(s, buckling=True)
    with pytest.raises(ValueError, match="at least one mode"):
        latinpc.modes(s, 0)
    large = latinpc.Structure(**turning.von_mises(0.0), geometry="large", mass=[1.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="no loads for a factor to multiply"):
        latinpc.modes(large, buckling=True)
    with pytest.raises(ValueError, match=r"load must have the shape \(3, 2\)"):
        latinpc.modes(large, buckling=True, load=[0.0, 1.0])
    with pytest.raises(ValueError, match=r"node 2 \(\[nan  ?0\.?\]\) has an entry of load that is not finite"):
        latinpc.modes(large, buckling=True, load=[[0.0, 0.0], [0.0, 0.0], [np.nan, 0.0]])
    with pytest.raises(ValueError, match="load is for buckling"):
        latinpc.modes(large, load=np.zeros((3, 2)))
    with pytest.raises(ValueError, match=r"latinpc.Structure.from_scene\(scene\)"):
        latinpc.modes(make("net"))
    with pytest.raises(ValueError, match="no node that is free has a mass"):
        latinpc.modes(large)
    rigid = latinpc.Structure(**turning.von_mises(1.0) | {"law": "inextensible"}, mass=1.0)
    with pytest.raises(latinpc.SolveError, match="the rigid law inextensible"):
        latinpc.modes(rigid)
    row = latinpc.Structure([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2]], "bar", 1e3, geometry="large",
                            fixed=[[1, 1], [0, 0], [1, 1]], load=[[0, 0], [1, 0], [0, 0]], mass=1.0)  # fmt: skip
    with pytest.raises(latinpc.SolveError, match="the state is a mechanism, most at node 1"):
        latinpc.modes(row, buckling=True)
    found = latinpc.modes(row, 1)
    with pytest.raises(ValueError, match="take buckling=True"):
        found.factors  # noqa: B018
    with pytest.raises(ValueError, match="have factors, not frequencies"):
        latinpc.modes(latinpc.Structure(**turning.von_mises(1.0), geometry="large"), buckling=True).frequencies  # noqa: B018


def test_without_slepc_the_error_says_what_to_install(monkeypatch):
    """In Python."""
    monkeypatch.setitem(sys.modules, "slepc4py", None)
    with pytest.raises(ImportError, match="apt install python3-slepc4py libslepc-real-dev"):
        latinpc.modes(latinpc.Structure(**string()))


def test_slepc_of_another_petsc_is_not_loaded(monkeypatch):
    """It can end the process: two libraries of PETSc in one."""
    monkeypatch.setitem(sys.modules, "slepc4py", types.SimpleNamespace(__version__="2.3.1"))
    with pytest.raises(ImportError, match=r"apt install python3-slepc4py .*\(slepc4py 2\.3\.1 is there, PETSc is 3\."):
        latinpc.modes(latinpc.Structure(**string()))


def test_without_slepc_the_command_says_what_to_install(tmp_path):
    """And ends with 2."""
    (tmp_path / "slepc4py.py").write_text("raise ImportError('hidden')")
    path = {"PYTHONPATH": str(tmp_path)}
    ended = run([LATINPC, "modes", "lattice", "--drawn", "--node-mass", "1"], check=False, env=path)
    assert ended.returncode == 2 and "apt install python3-slepc4py" in ended.stderr


# ---- pictures and the command line -----------------------------------------------------------------------------
@slepc
def test_command(tmp_path):
    """Table, JSON, shapes for ParaView, picture and animation."""
    import meshio
    from PIL import Image

    words = (
        "net --side 6 --law cable --node-mass 10 --number 4 --json m.json --output m.vtu --picture m.png --gif m.gif"
    )
    ended = run([LATINPC, "modes", *words.split()], cwd=tmp_path)
    assert "frequency" in ended.stdout and "slack" in ended.stdout and not ended.stderr
    report = json.loads((tmp_path / "m.json").read_text())
    assert len(report["frequencies"]) == 4 and report["frequencies"] == sorted(report["frequencies"])
    assert f"{report['frequencies'][0]:#.5g} Hz" in ended.stdout
    mesh = meshio.read(tmp_path / "m.vtu")
    assert np.linalg.norm(mesh.point_data["mode_4"], axis=1).max() == pytest.approx(1.0)
    assert Image.open(tmp_path / "m.png").size[0] > 1000
    with Image.open(tmp_path / "m.gif") as gif:
        assert gif.n_frames > 10


@slepc
def test_command_of_buckling_and_drawn_states():
    """Options of PETSc reach the geometry; bad ones end with 2."""
    grid = ["tensegrity-grid", "--modules", "4"]
    ended = run(
        [LATINPC, "modes", *grid, "--buckling", "--number", "2", "--json", "-", "-snes_latin_geometry", "large"]
    )
    assert json.loads(ended.stdout)["factors"][0] > 1.0
    ended = run([LATINPC, "modes", *grid, "--drawn", "--node-mass", "5", "-snes_latin_geometry", "large"])
    assert "0 links slack" in ended.stdout
    ended = run([LATINPC, "modes", "saddle", "--buckling"])
    assert "no positive factor" in ended.stderr and not ended.stdout  # no table without rows
    warnings.simplefilter("default", ImportWarning)
    filters = list(warnings.filters)
    for words, said in (
        ((), "need masses"),
        (("--buckling",), "take geometry='large'"),
        (("--number", "0"), "at least one mode"),
        (("--mode", "9", "--gif", "a.gif"), "choose one of the modes from 1 to 6"),
        (("--gif", "a.png"), "cannot write '.png'"),
        (("--buckling", "--node-mass", "2"), "--node-mass is for frequencies: leave out --buckling"),
    ):
        assert said in command("modes", *grid, *words, code=2).stderr
    assert warnings.filters == filters  # of whoever calls the command


@slepc
def test_modes_that_have_not_converged_are_missing():
    """The command ends with 1, as of a state that has not converged."""
    few = {"modes_eps_max_it": 1, "modes_eps_ncv": 14}
    net = replace(make("net", side=10, law="cable"), mass=10.0).solve()
    assert net.modes(12).complete
    with pytest.warns(latinpc.LatinWarning, match="0 of 12 modes have converged: raise -modes_eps_max_it"):
        assert not net.modes(12, options=few).complete
    words = "net --side 10 --law cable --node-mass 10 --number 12 -modes_eps_max_it 1 -modes_eps_ncv 14"
    assert "0 of 12 modes have converged" in command("modes", *words.split(), code=1).stderr


@slepc
def test_files_that_have_not_been_written_are_not_said_to_be(tmp_path):
    """Without a factor there is nothing to draw; a mode that is not there is refused before the files."""
    picture, table = tmp_path / "m.png", tmp_path / "m.json"
    words = "modes", "saddle", "--buckling", "--picture", picture, "--json", table
    said = command(*words).stdout
    assert str(table.name) in said and "m.png" not in said and not picture.exists()
    words = "lattice", "--nx", "2", "--ny", "2", "--drawn", "--node-mass", "1", "--number", "90", "--picture", picture
    ended = command("modes", *words, "--gif", tmp_path / "m.gif", "--mode", "80", code=2)
    assert "--mode 80: there are only" in ended.stderr and not picture.exists()


@slepc
def test_cases_of_loads_do_not_act_on_frequencies_as_drawn(tmp_path):
    (tmp_path / "nodes.csv").write_text("node,x,fix,mass\na,0,x,\nb,1,,2\n")
    (tmp_path / "members.csv").write_text("start,end,EA\na,b,1e3\n")
    cases = "[[case]]\nname = 'wind'\n[case.loads.all]\nforce = [1.0]\n"
    cases += "[[case]]\nname = 'warm'\n[case.elongations.members]\nstrain = 1e-3\n"
    (tmp_path / "bar.toml").write_text(cases)
    said = "--case wind: it has loads alone, and --drawn is without loads"
    assert said in command("modes", tmp_path, "--drawn", "--case", "wind", code=2).stderr
    command("modes", tmp_path, "--drawn", "--case", "warm")
    assert "no [[case]] has the name 'cold'" in command("modes", tmp_path, "--drawn", "--case", "cold", code=2).stderr


@slepc
def test_pictures_in_one_and_two_dimensions(tmp_path):
    """A chain along x, and the string."""
    chain = latinpc.Structure([[0.0], [1.0], [2.0]], [[0, 1], [1, 2]], "bar", 1e3, fixed=[[1], [0], [0]], mass=1.0)
    for s in (chain, latinpc.Structure(**string())):
        found = latinpc.modes(s, 12)
        found.plot().savefig(tmp_path / "modes.png")
        found.animate(tmp_path / "mode.gif", 1)
        figure = found.plot()
        assert len(found.plot(1).axes) == 2 and len(figure.axes) == min(len(found), 9) + 1  # the key of the colours
        assert {"does not move", "moves most"} <= {text.get_text() for text in figure.texts}


if __name__ == "__main__":
    vibration = latinpc.modes(latinpc.Structure(**string()), 6)
    buckling = latinpc.Structure(**bars(), geometry="large").solve(error=1e-10).modes(4, buckling=True)
    if PETSc.COMM_WORLD.rank == 0:
        print(json.dumps({"string": vibration.frequencies.tolist(), "factors": buckling.factors.tolist()}))


def test_options_that_nothing_reads_are_named():
    """Also one of ours that is misspelt, as by a solve."""
    structure = latinpc.Structure([[0.0], [1.0]], [[0, 1]], "bar", 1e3, fixed=[[1], [0]], mass=1.0)
    with pytest.warns(latinpc.LatinWarning, match="no solver has read -modes_eps_toll: misspelt"):
        found = latinpc.modes(structure, 1, options={"modes_eps_toll": 1e-9, "-modes_eps_max_it": 99})
    assert len(found.notices) == 1
    with pytest.raises(ValueError, match="do you mean -snes_latin_error"):
        latinpc.modes(structure, 1, options={"snes_latn_error": 1e-9})
