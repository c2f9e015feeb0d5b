"""The problem classes of section 2, each against a solution that no part of the plugin computed.

What is unique, and so compared: displacements and tensions where an elastic part holds every node (13), (15), (18),
in the net and the chain; in a granulate of rigid grains the tensions, for gaps in general position, and the work of
the loads, but not the displacements of grains that bear nothing; with friction neither, so the law itself is checked.
"""

import re
import sys

import numpy as np
import pytest
from conftest import ROOT, run
from lcp import lemke, linear_program, program, tensegrity
from scipy import sparse
from scipy.sparse.linalg import spsolve
from support import solve

import latinpc
from latinpc.bench.peers.qp import kinematics
from latinpc.runs.reference import reference_solution
from latinpc.scenes import Law, make

sys.path.insert(0, str(ROOT / "benchmarks"))
from classes import rows, table

EXACT = {"stol": 1e-12, "max_it": 20000}
AGREE = 1e-8


def apart(a, b):
    """Distance relative to the second."""
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def balance(scene, tensions):
    """Largest nodal unbalance B^t tau - F relative to the largest load."""
    B, _ = kinematics(scene)
    return np.abs(B.T @ tensions - scene.load[~scene.fixed]).max() / np.abs(scene.load).max()


def strain(scene, u):
    """Elongation and initial_elongation, e + e0 (m)."""
    B, e_d = kinematics(scene)
    return B @ u[~scene.fixed] + e_d + scene.initial_elongation


# ---- (13) ------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["truss-grid", "lattice"])
def test_truss(name):
    """(13): K U = F - B^t k e0, by a sparse factorisation."""
    scene = make(name, **({"modules": 6, "subdomains": 9} if name == "truss-grid" else {"nx": 16, "ny": 8}))
    scene.law[:] = Law.BAR
    B, e_d = kinematics(scene)
    k = sparse.diags(scene.stiffness)
    u = spsolve((B.T @ k @ B).tocsc(), scene.load[~scene.fixed] - B.T @ (k @ (e_d + scene.initial_elongation)))
    found = solve(scene, **EXACT)
    assert found.reason > 0
    assert apart(found.u[~scene.fixed], u) < AGREE


# ---- (15) ------------------------------------------------------------------------------------
@pytest.mark.parametrize(("load", "taut"), [(10.0, 0), (2e3, 3), (1e5, 7)])
def test_truss_on_inextensible_cables(load, taut):
    """(15): displacements and tensions of the quadratic program, with none, some, and all of the cables taut."""
    scene = make("hung-truss", load=load, seed=2)
    u, tension = program(scene)
    found = solve(scene, **EXACT)
    assert found.reason > 0
    assert apart(found.u, u) < AGREE
    assert apart(found.tensions, tension) < AGREE
    assert np.count_nonzero(found.tensions[scene.law == Law.INEXTENSIBLE]) == taut


# ---- (18), (19) ------------------------------------------------------------------------------
def test_tensegrity_as_complementarity_problem():
    """(18), (19): corrected elongations and tensions of the cables by Lemke's method, displacements by the QP."""
    scene = make("tensegrity-grid", modules=3, subdomains=9, slack=0.15)
    cable, length, tension = tensegrity(scene)
    assert 0 < np.count_nonzero(length) < len(length) / 2
    found = solve(scene, **EXACT)
    assert found.reason > 0
    assert apart(found.tensions[cable], tension) < AGREE
    corrected = (found.tensions / scene.stiffness - strain(scene, found.u))[cable]
    assert apart(corrected, length) < AGREE
    u, _ = program(scene)
    assert apart(found.u, u) < AGREE


# ---- all of them, in a table -----------------------------------------------------------------
def test_every_class_of_the_table_agrees_with_its_reference():
    """(13) to (20): the rows of the page agree to 1e-8 in what is unique, and the page has these rows."""
    found = list(rows())
    for row in found:
        assert max(row.unique.values()) < AGREE, row
    page = (ROOT / "examples" / "classes" / "README.md").read_text()
    lines = page.split("<!-- rows -->\n")[1].split("\n<!-- end -->")[0].splitlines()
    assert [line.rsplit("|", 2)[0] for line in lines] == [line.rsplit("|", 2)[0] for line in table(found)]
    assert {"(13)", "(14)", "(15)", "(16), (17)", "(16), W", "(18), (19)", "(20)"} <= {row.equations for row in found}


# ---- nets ------------------------------------------------------------------------------------
@pytest.mark.parametrize("law", ["inextensible", "cable"])
def test_net(law):
    """A fishing net whose meshes go slack: displacements and tensions of the quadratic program."""
    scene = make("net", side=10, law=law, subdomains=4)
    u, tension = program(scene)
    found = solve(scene, **EXACT)
    assert found.reason > 0
    assert apart(found.u, u) < AGREE
    assert apart(found.tensions, tension) < AGREE
    mesh = found.tensions[::3]
    assert (mesh >= 0).all()
    assert 0.02 < np.mean(mesh == 0) < 0.5


def test_net_at_rest_is_where_force_densities_put_it():
    """Without catch and current nothing moves, and tension over length is the same in all cables."""
    scene = make("net", side=12, catch=0.0, current=0.0)
    found = solve(scene, **EXACT)
    assert np.abs(found.u).max() < 1e-9
    assert found.tensions[::3] / scene.lengths[::3] == pytest.approx(100.0, rel=1e-8)


@pytest.mark.parametrize("upside_down", [False, True])
def test_chain_and_arch_are_the_catenary(upside_down):
    """No displacement and the tensions of hanging links; with more links, those of the catenary, to second order."""
    errors = []
    for links in (16, 32, 64):
        scene = make("chain", links=links, upside_down=upside_down)
        K = kinematics(scene)[0][scene.law == Law.BAR]
        assert np.linalg.matrix_rank(K.toarray()) < (~scene.fixed).sum(), "K_b is to be singular"
        found = solve(scene, subdomains=4, **EXACT)
        assert found.reason > 0
        assert np.abs(found.u).max() < 1e-10
        assert found.tensions[::2] == pytest.approx(np.array(scene.metadata["tensions"]), rel=1e-10)
        # closed form: y = a cosh(x / a), length 2 a sinh(span / 2 a), tension = weight a cosh(x / a) / length
        low, high = 0.05, 10.0
        for _ in range(100):
            a = (low + high) / 2
            low, high = (a, high) if 2 * a * np.sinh(0.5 / a) > 1.5 else (low, a)
        middle = scene.nodes[scene.links[::2], 0].mean(axis=1) - 0.5
        errors.append(np.abs(np.abs(found.tensions[::2]) - a * np.cosh(middle / a) / 1.5).max())
        sag = np.abs(scene.nodes[:, 1]).max()
        assert sag == pytest.approx(a * (np.cosh(0.5 / a) - 1), rel=2.0 / links**2)
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.2)


def test_pulled_chain():
    """A pull that is not that of the shape: displacements of the quadratic program, with K_b singular."""
    scene = make("chain", links=24, pull=0.3)
    u, tension = program(scene)
    found = solve(scene, subdomains=3, **EXACT)
    assert apart(found.u, u) < AGREE
    assert apart(found.tensions, tension) < AGREE


# ---- granulates ------------------------------------------------------------------------------
@pytest.mark.parametrize(("dim", "side", "parts"), [(2, 12, 4), (3, 7, 8)])
def test_rigid_grains(dim, side, parts):
    """Only contacts, K_b = 0: tensions and work of the linear program; grains that bear nothing may lie anywhere."""
    scene = make("packing", dim=dim, side=side, subdomains=parts)
    u, tension = linear_program(scene)
    found = solve(scene, stol=1e-11, max_it=20000)
    assert found.reason > 0
    assert apart(found.tensions, tension) < AGREE
    assert (found.u * scene.load).sum() == pytest.approx((u * scene.load).sum(), rel=AGREE)
    gap = strain(scene, found.u)
    assert gap.min() > -1e-9 * np.abs(found.u).max()
    assert np.abs(gap * found.tensions).max() < 1e-8 * np.abs(found.tensions).max() * np.abs(found.u).max()
    # no self-stress among the contacts that bear: that is why their tensions are unique
    rows = kinematics(scene)[0][tension < -1e-6].toarray()
    assert np.linalg.matrix_rank(rows) == len(rows)


def test_elastic_grains():
    """The same grains with elastic contacts: the quadratic program has one solution for the grains that touch."""
    scene = make("packing", side=10, law="elastic", subdomains=4)
    found, newton = solve(scene, **EXACT), program_of_struts(scene)
    assert found.reason > 0
    assert apart(found.tensions, newton) < AGREE


def program_of_struts(scene):
    """Tensions of elastic contacts: those that touch by Lemke's method, then linear algebra for these."""
    B, e_d = kinematics(scene)
    B, k, force = B.toarray(), scene.stiffness[0], scene.load[~scene.fixed]
    rest = scene.initial_elongation + e_d
    soft = 1e-9 * k  # a foundation that does not show holds grains that touch nothing
    tension, _ = lemke((B @ B.T + 1e-9 * np.eye(len(B))), (B @ force + soft * rest) / np.abs(force).max())
    touch = tension > 0
    bears = k * B[touch].T @ B[touch]
    u = np.linalg.lstsq(bears, force - k * B[touch].T @ rest[touch], rcond=1e-12)[0]
    return np.where(touch, k * (B @ u + rest), 0.0)


@pytest.mark.parametrize("dim", [2, 3])
def test_grains_with_friction(dim):
    """Tensions are not unique; balance, Coulomb's cone and complementarity hold for those that are found."""
    scene = make("packing", dim=dim, side=10 if dim == 2 else 6, law="friction", subdomains=2**dim)
    found = solve(scene, stol=1e-11, max_it=20000)
    assert found.reason > 0
    normal, tangent = found.tensions[::dim], found.tensions.reshape(-1, dim)[:, 1:]
    assert balance(scene, found.tensions) < 1e-7
    assert (normal <= 0).all()
    assert (np.linalg.norm(tangent, axis=1) <= 0.3 * -normal * (1 + 1e-12)).all()
    gap = strain(scene, found.u)[::dim]
    assert gap.min() > -1e-9
    assert np.abs(gap * normal).max() < 1e-7
    slips = np.linalg.norm(tangent, axis=1) > 0.3 * -normal * (1 - 1e-7)
    assert 0.5 < slips[normal < 0].mean() < 1.0
    moved = strain(scene, found.u).reshape(-1, dim)[:, 1:]
    along = np.einsum("ij,ij->i", moved, tangent)
    against = np.linalg.norm(moved, axis=1) * np.linalg.norm(tangent, axis=1)
    assert along == pytest.approx(against, abs=1e-6)


def test_grains_without_friction_as_contacts_with_none():
    """With mu = 0 the contacts with friction are plain contacts: the same tensions as the linear program."""
    scene = make("packing", side=8, law="friction", friction=0.0)
    plain = make("packing", side=8)
    _, tension = linear_program(plain)
    found = solve(scene, stol=1e-11, max_it=30000)
    assert found.reason > 0
    assert apart(found.tensions[::2], tension) < AGREE
    assert not found.tensions[1::2].any()


# ---- an arch of blocks -------------------------------------------------------------------------
def thrust_limits(scene, friction):
    """Least and greatest horizontal thrust of all forces that balance the loads within the cones: statics alone."""
    from scipy.optimize import linprog

    B, _ = kinematics(scene)
    m = len(scene.law)
    normal, tangent = np.flatnonzero(scene.law == Law.FRICTION), np.flatnonzero(scene.law == Law.TANGENT)
    cone = sparse.lil_matrix((2 * len(normal), m))
    for row, (n, t) in enumerate(zip(normal, tangent)):
        cone[2 * row, t], cone[2 * row, n] = 1.0, friction  # tau_t <= mu |tau_n|
        cone[2 * row + 1, t], cone[2 * row + 1, n] = -1.0, friction
    bounds = [(None, 0.0) if law == Law.FRICTION else (None, None) for law in scene.law]
    horizontal = reaction(scene)
    size = np.abs(scene.load).max()
    ways = [
        linprog(sign * horizontal, A_ub=cone.tocsr(), b_ub=np.zeros(2 * len(normal)), A_eq=B.T,
                b_eq=scene.load[~scene.fixed] / size, bounds=bounds)
        for sign in (1, -1)
    ]  # fmt: skip
    assert ways[0].status == 0
    return ways[0].fun * size, -ways[1].fun * size


def reaction(scene):
    """Coefficients of the horizontal force of the left abutment on the arch."""
    left = scene.fixed[:, 0] & (scene.nodes[:, 0] < 0)
    at = left[scene.links].any(axis=1)
    return np.where(at, -scene.directions[:, 0], 0.0)


@pytest.mark.parametrize("push", [0.0, 0.1])
def test_arch_of_blocks(push):
    """Balance, Coulomb's law at every joint, and a thrust between those that statics allows."""
    scene = make("arch", push=push)
    found = solve(scene, stol=1e-12, max_it=5000, subdomains=3)
    assert found.reason > 0
    assert balance(scene, found.tensions) < 1e-7
    normal, tangent = found.tensions[scene.law == Law.FRICTION], found.tensions[scene.law == Law.TANGENT]
    assert (normal <= 0).all()
    assert (np.abs(tangent) <= 0.6 * -normal * (1 + 1e-12)).all()
    gap = strain(scene, found.u)[scene.law == Law.FRICTION]
    assert gap.min() > -1e-12
    assert np.abs(gap * normal).max() < 1e-10 * 1e4
    low, high = thrust_limits(scene, 0.6)
    thrust = reaction(scene) @ found.tensions
    assert low - 1e-3 <= thrust <= high + 1e-3
    assert low < high


def test_arch_that_is_too_thin_falls():
    """Below a thickness of 0.107 of the radius no forces balance the weight: the iteration must not say otherwise."""
    thin = solve(make("arch", thickness=0.08), max_it=300)
    assert thin.reason < 0
    thick = solve(make("arch", thickness=0.13), max_it=300)
    assert thick.reason > 0


# ---- large ones, against each other --------------------------------------------------------------
@pytest.mark.slow
def test_large_nets_agree():
    """1,100 cables, elastic: SNES latin and Newton's method; inextensible: blocks and METIS."""
    scene = make("net", side=24, law="cable")
    structure = latinpc.Structure.from_scene(scene)
    found = solve(scene, _structure=structure, stol=1e-6, max_it=6000)
    assert found.reason > 0
    assert apart(found.tensions, structure.tensions(reference_solution(structure))) < 1e-2
    one, other = (solve(make("net", side=24, partition=way), stol=1e-9, max_it=6000) for way in ("regular", "metis"))
    assert one.reason > 0
    assert other.reason > 0
    assert apart(one.tensions, other.tensions) < 1e-4


@pytest.mark.slow
def test_large_packings_agree():
    """2,800 contacts: the tensions do not depend on the partition, and are those of the simplex method."""
    scenes = [make("packing", side=32, partition=way) for way in ("regular", "metis")]
    _, tension = linear_program(scenes[0])
    for scene in scenes:
        found = solve(scene, stol=1e-7, max_it=20000)
        assert found.reason > 0
        assert apart(found.tensions, tension) < 1e-4


# ---- the pages ---------------------------------------------------------------------------------
PAGES = sorted((ROOT / "examples" / "classes").glob("*.md"))
LINES = [line for page in PAGES for line in page.read_text().splitlines() if line.startswith("latinpc ")]


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_commands_of_the_pages(line, tmp_path):
    """Every command of the pages on the problem classes converges, and draws the picture that it names."""
    words = line.replace("options/", f"{ROOT}/options/").split()[1:]
    done = run(
        [sys.executable, "-P", "-c", "from latinpc.cli import main; main()", *words],
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT)},
    )
    assert "converged" in done.stdout and "not converged" not in done.stdout
    for picture in (word for word in words if word.endswith(".png")):
        assert (tmp_path / picture).stat().st_size > 0
        assert (ROOT / "examples" / "classes" / picture).exists()


def test_pages_show_their_pictures():
    """Each page exists, and so does every picture that it shows."""
    assert len(PAGES) >= 5
    for page in PAGES:
        for picture in re.findall(r"!\[.*?\]\((.*?)\)", page.read_text()):
            assert (page.parent / picture).exists(), f"{page.name}: {picture}"
