"""Rigid laws (3), contacts with friction, tables and the user's laws: against brute force, alone and in a structure."""

import ctypes

import numpy as np
import pytest
from petsc4py import PETSc
from support import latin, solve

import latinpc
from latinpc.scenes import Law, Scene

RNG = np.random.default_rng(7)


def spring(law, rest=None, *, k=1000.0, dim=1, load=0.0, search=0.0, direction=None, friction=None, **more):
    """Hang a node on springs k in all directions and on links of one law to a fixed node, all in one subdomain."""
    rows = 1 if direction is None else len(direction)
    links = [[2 + c, 1] for c in range(dim)] + [[0, 1]] * rows
    far = 5.0 * np.eye(dim)
    return Scene(
        name="spring",
        nodes=np.vstack([np.zeros((1, dim)), np.eye(1, dim), np.eye(1, dim) - far]),
        links=links,
        law=[Law.BAR] * dim + list(np.atleast_1d(law)),
        stiffness=[k] * dim + [search] * rows,
        initial_elongation=np.append(np.zeros(dim), np.zeros(rows) if rest is None else rest),
        fixed=np.arange(2 + dim)[:, None] != np.full(dim, 1),
        load=np.eye(2 + dim)[1][:, None] * np.atleast_1d(load),
        direction=None if direction is None else np.vstack([np.zeros((dim, dim)), direction]),
        friction=None if friction is None else np.full(dim + rows, friction),
        subdomain=np.zeros(dim + rows, int),
        **more,
    )


def scan(energy, low=-1.0, high=1.0):
    """Minimise a convex function of one variable on ever finer grids."""
    for _ in range(12):
        x = np.linspace(low, high, 401)
        best = np.argmin([energy(value) for value in x])
        low, high = x[max(best - 1, 0)], x[min(best + 1, 400)]
    return 0.5 * (low + high)


# ---- one link against a spring ---------------------------------------------------------------
@pytest.mark.parametrize("search", [0.0, 3.0, 1e3, 3e5])
@pytest.mark.parametrize(("law", "sign"), [(Law.INEXTENSIBLE, 1.0), (Law.CONTACT, -1.0)])
def test_rigid_link_against_a_spring(law, sign, search):
    """(3) and its mirror image by exhaustion, whatever the search parameter is."""
    for load, rest in RNG.uniform(-1, 1, (20, 2)) * [500.0, 0.3]:
        found = solve(spring(law, rest, load=load, search=search), stol=1e-14)
        allowed = lambda u: sign * (u + rest) <= 0.0  # noqa: B023, E731
        u = scan(lambda u: 500.0 * u * u - load * u if allowed(u) else 1e9 * abs(u + rest) + 1e6)  # noqa: B023
        assert found.reason > 0
        assert found.u[1, 0] == pytest.approx(u, abs=1e-7)
        assert found.tensions[1] == pytest.approx(load - 1000.0 * found.u[1, 0], abs=1e-6)
        # complementary to rounding: one of the two is zero
        assert sign * found.tensions[1] >= 0.0
        assert sign * (found.u[1, 0] + rest) <= 1e-10
        assert found.tensions[1] * (found.u[1, 0] + rest) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("gap", [0.0, 0.02, -0.03])
def test_contact_with_friction_is_coulombs(dim, gap):
    """Open, sticking or slipping as Coulomb's law says; slipping, friction is at its bound and against the slip."""
    mu, k, seen, rng = 0.4, 1000.0, set(), np.random.default_rng(dim)  # loads do not depend on which tests ran before
    for _ in range(60):
        frame = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
        load = frame.T @ (rng.uniform(-60, 60, dim) * np.where(np.arange(dim), rng.choice([0.1, 1.0]), 1.0))
        scene = spring(
            [Law.FRICTION] + [Law.TANGENT] * (dim - 1),
            np.eye(1, dim)[0] * gap,
            dim=dim,
            load=load,
            direction=frame,
            friction=mu,
        )
        found = solve(scene, stol=1e-14)
        assert found.reason > 0
        u, tau = frame @ found.u[1], found.tensions[dim:]
        rest = frame @ load - k * u  # what the contact carries: normal part, then tangential parts
        assert tau == pytest.approx(rest, abs=1e-7)
        assert tau[0] <= 0.0
        assert u[0] + gap >= -1e-12
        assert tau[0] * (u[0] + gap) == pytest.approx(0.0, abs=1e-9)
        slip, friction = u[1:], tau[1:]
        assert np.linalg.norm(friction) <= mu * -tau[0] * (1 + 1e-12)
        if tau[0] == 0.0:
            seen.add("open")
        elif np.linalg.norm(friction) < mu * -tau[0] * (1 - 1e-9):
            seen.add("sticks")
            assert slip == pytest.approx(0.0, abs=1e-12)
        else:
            seen.add("slips")
            assert friction @ slip == pytest.approx(np.linalg.norm(friction) * np.linalg.norm(slip), abs=1e-9)
    assert seen == {"open", "sticks", "slips"}


POINTS = np.array([[-0.3, -40.0], [-0.1, -40.0], [0.0, 0.0], [0.05, 100.0], [0.2, 130.0]])


def test_table_is_followed_between_and_beyond_its_points():
    """The tension of a table is numpy's interpolation, goes on beyond the ends, and is the slope of a convex energy."""
    law = latinpc.register_table(*POINTS.T)
    assert latinpc.register_table(*POINTS.T) == law
    link = latinpc.Structure([[0.0], [1.0]], [[0, 1]], law, 0.0, fixed=[[1], [0]], comm=PETSc.COMM_SELF)
    u, jacobian = link.create_vec(), link.dm.createMat()

    def at(call, x):
        u.set(x)
        return call(u)

    for x in np.linspace(-0.3, 0.2, 37):
        assert at(link.tensions, x)[0] == pytest.approx(np.interp(x, *POINTS.T), abs=1e-11)
    assert at(link.tensions, 0.3)[0] == pytest.approx(150.0)
    assert at(link.tensions, -0.5)[0] == pytest.approx(-40.0)
    for x in (-0.4, -0.2, -0.05, 0.02, 0.1, 0.4):
        slope = (at(link.energy, x + 1e-6) - at(link.energy, x - 1e-6)) / 2e-6
        assert slope == pytest.approx(at(link.tensions, x)[0], rel=1e-6)
        u.set(x)
        link.jacobian(u, jacobian)
        tangent = (at(link.tensions, x + 1e-6)[0] - at(link.tensions, x - 1e-6)[0]) / 2e-6
        assert jacobian.getValue(0, 0) == pytest.approx(tangent, rel=1e-6, abs=1e-6)
    scaled = latinpc.Structure([[0.0], [1.0]], [[0, 1]], law, 500.0, fixed=[[1], [0]], comm=PETSc.COMM_SELF)
    u.set(0.1)
    assert scaled.tensions(u)[0] == pytest.approx(np.interp(0.1, *POINTS.T) * 500.0 / 2000.0)


def test_table_against_a_spring():
    """The local stage of a table solves the pointwise problem: minimum of the energy by exhaustion."""

    def energy(x):
        grid = np.linspace(0.0, x, 2001)
        tension = np.interp(grid, *POINTS.T)
        return np.sum((tension[1:] + tension[:-1]) / 2 * np.diff(grid))

    for load, rest in RNG.uniform(-1, 1, (6, 2)) * [150.0, 0.05]:
        scene = spring(len(Law), rest, load=load, tables=[POINTS.T])
        found = solve(scene, stol=1e-14)
        u = scan(lambda u: 500.0 * u * u - load * u + energy(u + rest), -0.24, 0.14)  # noqa: B023
        assert found.u[1, 0] == pytest.approx(u, abs=1e-5)
        assert found.tensions[1] == pytest.approx(np.interp(found.u[1, 0] + rest, *POINTS.T), abs=1e-9)
        assert found.tensions[1] + 1000.0 * found.u[1, 0] == pytest.approx(load, abs=1e-7)


HARDENING = r"""
/* tau = k (x + x^3), and without context a bar; the arguments are those of latinpc.h */
#include <stddef.h>
double tension(double k, double x, void *c) { return c ? k * (x + x * x * x * *(double *)c) : k * x; }
double tangent(double k, double x, void *c) { return c ? k * (1 + 3 * x * x * *(double *)c) : k; }
double energy(double k, double x, void *c) { return k * (x * x / 2 + (c ? x * x * x * x / 4 * *(double *)c : 0)); }
double local(double k, double e0, double y, void *c) { (void)y; (void)c; return k * e0; }
"""


@pytest.fixture(scope="module")
def hardening(tmp_path_factory):
    """Functions in C that know nothing of latinpc, by ctypes."""
    from conftest import run

    folder = tmp_path_factory.mktemp("law")
    (folder / "law.c").write_text(HARDENING)
    run(["mpicc", "-shared", "-fPIC", folder / "law.c", "-o", folder / "law.so"])
    return ctypes.CDLL(str(folder / "law.so"))


def test_law_of_the_users_own(hardening):
    """A law in C without a local stage of its own: a cubic against a spring, and Newton's method on the same object."""
    factor = ctypes.c_double(30.0)
    law = latinpc.register_law(
        "hardening", hardening.tension, hardening.tangent, hardening.energy, context=ctypes.addressof(factor)
    )
    nodes, held = [[0.0], [1.0], [2.0]], [[1], [0], [1]]
    for load in (-150.0, 0.0, 40.0, 900.0):
        structure = latinpc.Structure(
            nodes, [[0, 1], [1, 2]], [law, 0], 1000.0, initial_elongation=0.02, fixed=held, load=[[0], [load], [0]],
            comm=PETSc.COMM_SELF,
        )  # fmt: skip
        roots = np.roots([1000.0 * 30.0, 0.0, 2000.0, -(load + 1000.0 * 2 * 0.02)])  # in x = u + 0.02
        expected = roots[np.abs(roots.imag) < 1e-9].real[0] - 0.02
        u = structure.create_vec()
        for kind in ("latin", "newtonls"):
            snes = structure.create_snes()
            snes.setType(kind)
            snes.setTolerances(rtol=1e-14, atol=1e-14, stol=1e-14)
            u.set(0.0)
            snes.solve(None, u)
            assert structure.displacements(u)[1, 0] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_law_with_a_local_stage_of_its_own(hardening):
    """A bar, given as the user's law with its local stage, is a bar."""
    h = hardening
    address = ctypes.cast(h.local, ctypes.c_void_p).value
    law = latinpc.register_law("mine", h.tension, h.tangent, h.energy, local=address)
    mine, bar = (solve(spring(Law.BAR, 0.1, k=1000.0, search=700.0, load=30.0)) for _ in range(2))
    scene = spring(Law.BAR, 0.1, k=1000.0, search=700.0, load=30.0)
    structure = latinpc.Structure(
        scene.nodes, scene.links, [0, law], scene.stiffness, scene.initial_elongation, scene.fixed, load=scene.load,
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    mine = solve(scene, _structure=structure, stol=1e-14)
    assert mine.u == pytest.approx(bar.u, rel=1e-12)


@pytest.mark.parametrize("beside", [Law.CABLE, Law.COMPRESSION_ONLY])
def test_a_support_pulls_a_node_that_a_touching_contact_holds(beside):
    """The node stays where it is: its displacement and the missed gap are rounding, which is no error."""
    structure = latinpc.Structure(
        [[0.0], [1.0], [3.0]], [[0, 2], [1, 2], [1, 2]], [Law.BAR, Law.CONTACT, beside], [1.0, 0.0, 1.0],
        fixed=[[1], [1], [0]], prescribed=[[-0.25], [0.0], [0.0]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    result = structure.solve()
    assert result.converged, result.reason
    assert abs(result.displacements[2, 0]) < 1e-15
    assert result.tensions == pytest.approx([0.25, -0.25, 0.0], abs=1e-15)


# ---- search parameter --------------------------------------------------------------------------
def hung(stiffness=0.0):
    """Truss in the plane on inextensible cables (15): a lattice whose diagonals and hangers carry tension only."""
    from latinpc.scenes import make

    base = make("lattice", nx=8, ny=4, subdomains=8)
    rigid = np.random.default_rng(1).random(len(base.links)) < 0.15
    law = np.where(rigid & (base.law == Law.CABLE), Law.INEXTENSIBLE, base.law)
    k = np.where(law == Law.INEXTENSIBLE, stiffness, base.stiffness)
    return Scene(
        "hung", base.nodes, base.links, law, k, 0 * k, base.fixed, load=base.load * 30, subdomain=base.subdomain
    )


def test_search_parameter_changes_the_way_and_not_the_end():
    """Parameters over six decades lead to one solution; the self-tuned one is within reason of the best."""
    tuned = solve(hung(), stol=1e-11, max_it=3000)
    assert tuned.reason > 0
    best = tuned.iterations
    for l in 10.0 ** np.arange(5, 10):  # noqa: E741
        other = solve(hung(l), stol=1e-11, max_it=3000)
        assert other.reason > 0
        assert other.u == pytest.approx(tuned.u, abs=1e-8 * np.abs(tuned.u).max())
        best = min(best, other.iterations)
    assert tuned.iterations <= 2 * best


@pytest.mark.parametrize(
    ("name", "how"),
    [("packing", {"side": 8, "subdomains": 4}), ("packing", {"side": 5, "law": "friction"}), ("net", {"side": 6}),
     ("packing", {"side": 6, "law": "friction", "disorder": 0.0})],
)  # fmt: skip
def test_units_and_origin_do_not_matter(name, how):
    """In mm and kN, far from the origin: as many iterations, and the same forces."""
    from latinpc.scenes import make

    here, there = make(name, **how), make(name, **how)
    there.nodes = (there.nodes + 4096.0) * 1024.0  # exact in binary
    there.initial_elongation, there.load, there.stiffness = (
        there.initial_elongation * 1024,
        there.load / 1024,
        there.stiffness / 1024**2,
    )
    one, other = (solve(scene, stol=1e-6, max_it=2000) for scene in (here, there))
    assert one.reason > 0
    assert abs(one.iterations - other.iterations) <= 0.05 * one.iterations
    assert other.tensions * 1024 == pytest.approx(one.tensions, abs=1e-4 * np.abs(one.tensions).max())


def test_parts_of_a_contact_share_their_search_parameter():
    """What is given for the tangential parts does not matter: that of the normal part holds for all."""
    scene = spring([Law.FRICTION, Law.TANGENT], [0.0, 0.0], dim=2, load=[10.0, -30.0], direction=np.eye(2)[::-1],
                   friction=0.2)  # fmt: skip
    one = solve(scene, stol=1e-13)
    scene.stiffness[2:] = [50.0, 9999.0]
    other = solve(scene, stol=1e-13)
    assert one.u == pytest.approx(other.u, abs=1e-12)
    assert one.tensions == pytest.approx(other.tensions, abs=1e-8)
    assert abs(one.tensions[3]) == pytest.approx(0.2 * 30.0)


# ---- misuse ------------------------------------------------------------------------------------
def refused(call):
    """Return the sentence of a PETSc error."""
    with pytest.raises(PETSc.Error) as caught:
        call()
    return latinpc.error_message(caught.value)


@pytest.mark.parametrize("kind", ["newtonls", "ngmres", "nrichardson"])
def test_newton_refuses_rigid_laws_by_name(kind):
    """Every other SNES says which law it cannot do, and what to do instead."""
    with latin(spring(Law.INEXTENSIBLE, 0.0, load=1.0)) as run:
        run.snes.setType(kind)
        words = refused(lambda: run.snes.solve(None, run.structure.create_vec()))
    assert "inextensible" in words and "-snes_type latin" in words and "cable" in words


def contact_with(**changes):
    """One contact with friction, spoiled."""
    given = {"nodes": [[0.0, 0.0], [0.0, 0.0]], "links": [[0, 1], [0, 1]], "law": [5, 6], "stiffness": 0.0,
             "fixed": [[1, 1], [0, 0]], "direction": [[0.0, 1.0], [1.0, 0.0]], "friction": 0.3} | changes  # fmt: skip
    return latinpc.Structure(**given, comm=PETSc.COMM_SELF)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"law": [5, 5]}, "followed by 1 of law tangent"),
        ({"law": [6, 5]}, "Link 0 is not part of a complete contact"),
        ({"links": [[0, 1], [1, 0]]}, "same two nodes in the same order"),
        ({"direction": [[0.0, 1.0], [1.0, 1.0]]}, "not orthogonal"),
        ({"friction": None}, "no coefficient"),
    ],
)
def test_contacts_must_be_whole(changes, words):
    """Groups, frames and coefficients that do not fit are refused with the cure."""
    assert words in refused(lambda: contact_with(**changes))


def test_contacts_are_not_cut_by_a_partition():
    """A partition given by the user that separates the parts is refused; METIS never makes one."""
    structure = contact_with(subdomain=[0, 1])
    assert "cuts the contact" in refused(lambda: structure.create_snes().solve(None, structure.create_vec()))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"direction": None}, "no direction is given"),
        ({"friction": -0.1}, "friction that is negative"),
        ({"direction": [[0.0, np.nan], [1.0, 0.0]]}, "not finite"),
        ({"law": [0, 0]}, "positive stiffness"),
    ],
)
def test_arrays_of_contacts_are_checked(changes, words):
    """What Python can see is a ValueError that names the link."""
    with pytest.raises(ValueError, match=words):
        contact_with(**changes)


@pytest.mark.parametrize(
    ("strain", "tension", "words"),
    [
        ([0.0, 1.0], [0.0, -1.0], "must not decrease"),
        ([0.0, 0.0], [0.0, 1.0], "elongations of the law table must increase"),
        ([0.0], [1.0], "two or more"),
        ([0.0, 1.0], [0.0, 0.0], "has no tension anywhere"),
        ([0.0, np.inf], [0.0, 1.0], "finite"),
    ],
)
def test_tables_are_checked(strain, tension, words):
    """A table that is no monotone law is refused."""
    assert words in refused(lambda: latinpc.register_table(strain, tension))


def test_law_in_python(hardening):
    """The same functions in Python, wrapped by ctypes, give the same displacements as those in C."""
    kind = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_void_p)
    python = [
        kind(lambda k, x, c: k * (x + 30.0 * x**3)),
        kind(lambda k, x, c: k * (1 + 90.0 * x**2)),
        kind(lambda k, x, c: k * (x**2 / 2 + 30.0 * x**4 / 4)),
    ]
    factor = ctypes.c_double(30.0)
    c = [getattr(hardening, name) for name in ("tension", "tangent", "energy")]
    laws = latinpc.register_law("python", *python), latinpc.register_law("c", *c, context=ctypes.addressof(factor))
    found = []
    for law in laws:
        structure = latinpc.Structure(
            [[0.0], [1.0], [2.0]], [[0, 1], [1, 2]], [law, 0], 1000.0, initial_elongation=0.02, fixed=[[1], [0], [1]],
            load=[[0], [900.0], [0]], comm=PETSc.COMM_SELF,
        )  # fmt: skip
        u, snes = structure.create_vec(), structure.create_snes()
        snes.setTolerances(stol=1e-14)
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        found.append(structure.displacements(u)[1, 0])
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    assert found[0] > 0.1


def test_a_python_function_alone_is_no_law():
    """A Python function has no address; the message says what does."""
    with pytest.raises(TypeError, match="addresses"):
        latinpc.register_law("python", lambda k, x, c: k * x, 0, 0)


def test_memory_of_elastic_structures():
    """Nothing is kept for laws that a structure does not have."""
    words = "no rigid law: no tensions kept, whatever the displacement"
    scene = spring(Law.CABLE, 0.1, search=500.0, load=3.0)
    with latin(scene) as run:
        u = run.structure.create_vec()
        before = run.structure.tensions(u)
        run.snes.solve(None, u)
        u.set(0.0)
        assert (run.structure.tensions(u) == before).all(), words


PARALLEL = """
import sys, petsc4py
petsc4py.init(sys.argv)
import numpy as np
from petsc4py import PETSc
import latinpc
from latinpc.scenes import Law

rng = np.random.default_rng(5)
n = 7  # blocks side by side in a row between walls, touching with friction, each on springs
nodes = np.vstack([np.column_stack([np.arange(n + 2.0), np.zeros(n + 2)]), rng.uniform(-1, n, (2 * n, 2)) + [0, 9]])
contacts = np.repeat([[i, i + 1] for i in range(n + 1)], 2, axis=0)
springs = np.array([[1 + i, n + 2 + 2 * i + j] for i in range(n) for j in range(2)])
links = np.vstack([contacts, springs])
law = np.append(np.tile([Law.FRICTION, Law.TANGENT], n + 1), np.zeros(2 * n, int))
direction = np.vstack([np.tile([[1.0, 0], [0, 1]], (n + 1, 1)), np.zeros((2 * n, 2))])
fixed = np.ones(nodes.shape, bool)
fixed[1 : n + 1] = False
load = np.where(fixed, 0, rng.uniform(-80, 80, nodes.shape))
gap = np.where(law == Law.FRICTION, 0.02, 0.0)
structure = latinpc.Structure(nodes, links, law, np.where(law == 0, 1e3, 0), gap, fixed, load=load, direction=direction,
                          friction=0.3)
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
tau = latinpc.tensions(snes)
r = u.duplicate()
snes.computeFunction(u, r)
part = latinpc.subdomain_of_links(snes)
norm = r.norm()
if PETSc.COMM_WORLD.rank == 0:
    assert norm < 1e-6, norm
    assert (part[0 : 2 * n + 2 : 2] == part[1 : 2 * n + 2 : 2]).all(), "a contact was cut"
    assert snes.getConvergedReason() > 0
    print("tensions", *np.round(tau, 6) + 0.0)
"""


def test_contacts_on_several_ranks(mpirun):
    """The same tensions on 1, 2 and 3 ranks, as METIS cuts; residuals with the tensions of rigid links are small."""
    ways = ("-snes_stol", "1e-12", "-snes_latin_subdomains", "5")
    found = [mpirun(ranks, PARALLEL, *ways).stdout for ranks in (1, 2, 3)]
    numbers = [np.array(out.split("tensions")[1].split(), float) for out in found]
    assert numbers[0] == pytest.approx(numbers[1], abs=2e-6)
    assert numbers[0] == pytest.approx(numbers[2], abs=2e-6)
    assert np.count_nonzero(numbers[0][:16:2]) not in (0, 8)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_loads_that_come_after_the_structure(unit):
    """The search parameters are those of the loads that there are: as many stages, where they had been 10,000."""
    n, rng = 6, np.random.default_rng(3)
    bow = np.sin(np.pi * np.arange(n) / (n - 1))
    nodes = np.array([[i, j, -0.1 * bow[i] * bow[j]] for i in range(n) for j in range(n)])
    ends = np.array([[n * i + j, n * i + j + 1] for i in range(1, n - 1) for j in range(n - 1)])
    ends = np.vstack([ends, [[n * i + j, n * i + j + n] for i in range(n - 1) for j in range(1, n - 1)]])
    ends = np.vstack([ends, [[n * i + j, n * i + j + n + 1] for i in range(n - 1) for j in range(n - 1)]])
    inner = np.array([0 < i < n - 1 and 0 < j < n - 1 for i in range(n) for j in range(n)])
    along = np.diff(nodes[ends], axis=1)[:, 0]
    pull = 1e3 * rng.random(len(ends))[:, None] * along / np.linalg.norm(along, axis=1)[:, None]
    load = np.zeros_like(nodes)  # borne by these tensions
    np.add.at(load, ends[:, 0], -pull)
    np.add.at(load, ends[:, 1], pull)
    load[~inner] = 0.0
    stages = []
    for first in (load, 0.0 * load, 1e4 * load):
        structure = latinpc.Structure(
            unit * nodes, ends, "inextensible", 0.0, initial_elongation=-1e-3 * unit,
            fixed=np.repeat(~inner[:, None], 3, axis=1), load=first, comm=PETSc.COMM_SELF,
        )  # fmt: skip
        structure.set_load(load)
        snes = structure.create_snes()
        snes.setFromOptions()
        snes.solve(None, structure.create_vec())
        assert snes.getConvergedReason() > 0
        stages.append(snes.getIterationNumber())
        snes.destroy()
    assert stages[0] == stages[1] == stages[2] < 1000
