"""Structures whose tensions as drawn balance the loads: nothing moves, and that is no lack of accuracy."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc
from latinpc import Case


def stressed(seed, law="struts"):
    """A random truss with a self-stress of 10 kN, computed to rounding; None where it has none."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 12))
    nodes = rng.uniform(-5.0, 5.0, (n, 3))
    links = np.array([(i, j) for i in range(n) for j in range(i)])
    links = links[rng.permutation(len(links))[: 3 * n + 3]]
    fixed = np.zeros((n, 3), bool)
    fixed[:3] = True
    along = np.diff(nodes[links], axis=1)[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    sums = np.zeros((n, 3, len(links)))
    for link, (i, j) in enumerate(links):
        sums[i, :, link] += along[link]
        sums[j, :, link] -= along[link]
    _, values, rows = np.linalg.svd(sums[~fixed])
    if len(np.unique(links)) < n or values[-1] < 1e-2 or len(links) == len(values):
        return None
    prestress = 1e4 * rng.normal(size=len(links) - len(values)) @ rows[len(values) :]
    laws = "bar" if law == "bar" else ["cable" if t > 0.0 else "compression_only" for t in prestress]
    return {"nodes": nodes, "links": links, "law": laws, "EA": 1e6, "prestress": prestress, "fixed": fixed}


STRUCTURES = [given for given in map(stressed, range(60)) if given is not None]


@pytest.mark.parametrize("geometry", ["linear", "prestress"])
@pytest.mark.parametrize("law", ["struts", "bar"])
def test_nothing_moves_without_loads(law, geometry):
    """In 1 to 5 of 200 displacements of 1e-16 m were asked for to four digits, which rounding does not allow."""
    for given in STRUCTURES:
        laws = {"law": "bar"} if law == "bar" else {}
        found = latinpc.Structure(**given | laws, geometry=geometry, comm=PETSc.COMM_SELF).solve()
        assert found.converged and np.abs(found.displacements).max() < 1e-13
        assert found.tensions == pytest.approx(given["prestress"], rel=1e-9, abs=1e-9)
        assert found.largest_unbalance < 1e-9


def test_a_load_moves_it():
    """Ten million times less than the prestress; the response is that of bars, as no link slackens."""
    for given in STRUCTURES[:10]:
        load = np.where(given["fixed"], 0.0, 1e-3)
        bars, cables = (
            latinpc.Structure(**given | laws, load=load, comm=PETSc.COMM_SELF).solve(error=1e-8)
            for laws in ({"law": "bar"}, {})
        )
        assert cables.converged and bars.displacements.any()
        assert cables.displacements == pytest.approx(
            bars.displacements, rel=1e-4, abs=1e-6 * abs(bars.displacements).max()
        )


def test_loads_that_rounding_of_the_prestress_hides_are_not_answered_by_none():
    """Nor is what they do known to any digit."""
    for given in STRUCTURES[:10]:
        load = np.where(given["fixed"], 0.0, 1e-13)
        found = latinpc.Structure(**given, load=load, comm=PETSc.COMM_SELF).solve()
        assert not found.converged or found.displacements.any()


def test_a_guess_is_left_and_the_next_load_followed():
    given = STRUCTURES[0]
    structure = latinpc.Structure(**given, comm=PETSc.COMM_SELF)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setType("latin")
    u.set(1e-3)
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0 and u.norm() < 1e-12
    structure.set_load(np.where(given["fixed"], 0.0, 10.0))
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0 and u.norm() > 0.0


def test_the_prestress_alone_is_a_load_case():
    given = STRUCTURES[1]
    snow = Case("snow", load=np.where(given["fixed"], 0.0, -5.0))
    found = latinpc.solve_cases(
        latinpc.Structure(**given, geometry="prestress", comm=PETSc.COMM_SELF), [Case("prestress alone"), snow]
    )
    assert found.converged and np.abs(found.displacements[0]).max() < 1e-13 < np.abs(found.displacements[1]).max()


def random_net(seed, extra):
    """Nodes one by one, each hung from as many before it as it needs, and cables; all too long or short, no loads."""
    rng = np.random.default_rng(seed)
    dim = int(rng.integers(2, 4))
    n = dim + int(rng.integers(1, 8))
    nodes = rng.uniform(0.0, 3.0, (n, dim))
    links = [(int(j), i) for i in range(dim, n) for j in rng.choice(i, dim, replace=False)]
    links += [tuple(rng.choice(n, 2, replace=False)) for _ in range(extra * n)]
    lengths = np.linalg.norm(np.diff(nodes[np.array(links)], axis=1)[:, 0], axis=1)
    fixed = np.zeros((n, dim), bool)
    fixed[:dim] = True
    laws = rng.choice(["bar", "cable", "cable", "compression_only"], len(links))
    laws[dim * (n - dim) :] = "cable"
    given = {"nodes": nodes, "links": links, "law": laws, "stiffness": 1e6 / lengths, "fixed": fixed}
    return given | {"initial_elongation": rng.normal(0.0, 0.05, len(links)) * lengths}


@pytest.mark.filterwarnings("ignore")  # displacements larger than the structure, a node between slack links
@pytest.mark.parametrize("extra", [0, 1, 2])
def test_without_loads_there_is_an_equilibrium(extra):
    """The energy is convex and not negative. As many links as unknowns end without tension: no load is hidden there."""
    for seed in range(150):
        given = random_net(seed, extra)
        found = latinpc.Structure(**given, comm=PETSc.COMM_SELF).solve()
        drawn = np.abs(given["stiffness"] * given["initial_elongation"]).max()
        assert found.converged
        assert found.largest_unbalance < 1e-6 * max(drawn, np.abs(found.tensions).max())
