"""Solves with friction that end without an equilibrium: the result says why where that is certain."""

import numpy as np
import pytest

import latinpc

UNCERTAIN = "contacts with friction: neither an equilibrium nor convergence is certain"
FALLS = "no equilibrium: neither links nor friction hold node 1"
pytestmark = pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")


def discs(count, closed, law="friction", **more):
    """Make discs in a row on a floor, with gaps of 0.1 between them and two walls, of which the right one closes in."""
    parts = ["friction", "tangent"] if law == "friction" else ["contact"]
    rows, gaps = len(parts), count + 1
    nodes = [[float(i), 0.0] for i in range(count + 2)] + [[float(i), -1.0] for i in range(1, count + 1)]
    pairs = [[i, i + 1] for i in range(gaps)] + [[gaps + i, i] for i in range(1, count + 1)]
    normals = [[[1, 0], [0, 1]]] * gaps + [[[0, 1], [1, 0]]] * count
    fixed, prescribed, load = np.ones((3, 2 * count + 2, 2))
    fixed[1:gaps] = 0
    prescribed[:] = load[:] = 0
    prescribed[gaps, 0] = -closed
    load[1:gaps, 1] = -1.0
    reach = np.repeat([0.1] * gaps + [0.0] * count, rows) * np.tile([1.0, 0.0][:rows], gaps + count)
    return latinpc.Structure(
        nodes, np.repeat(pairs, rows, axis=0), parts * (gaps + count), 0.0, reach, fixed, prescribed, load,
        friction=0.3 * (rows > 1), direction=np.concatenate([normal[:rows] for normal in normals]), **more,
    )  # fmt: skip


def slope(friction, angle=0.1, **more):
    normal, along = [-np.sin(angle), np.cos(angle)], [np.cos(angle), np.sin(angle)]
    given = {"nodes": [[0, 0], [0, 0]], "links": [[0, 1]] * 2, "law": ["friction", "tangent"], "stiffness": 0.0}
    given |= {"fixed": [[1, 1], [0, 0]], "load": [[0, 0], [0, -10.0]], "direction": [normal, along]}
    return latinpc.Structure(**(given | more), friction=friction)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("law", ["contact", "friction"])
def test_gaps_that_contradict_each_other_are_named(count, law):
    """Friction has no part in it: the words are those for contacts without."""
    assert discs(count, 0.15, law).solve().converged
    result = discs(count, 0.5, law).solve()
    rows = 1 + (law == "friction")
    links = ", ".join(str(rows * i) for i in range(count + 1))
    assert not result.converged
    assert result.notices == [f"no equilibrium: the gaps of the rigid links {links} are incompatible"]


def test_gaps_that_fit_are_not_blamed():
    """A solve that is cut off says as little as before."""
    result = discs(3, 0.35).solve(options={"snes_max_it": 1, "snes_latin_newton": "never"})
    assert not result.converged and not any("incompatible" in text for text in result.notices)


@pytest.mark.parametrize("friction", [0.0, 1e-12, 1e-6, 0.05, 0.099])
def test_what_slides_down_a_slope_is_named(friction):
    """However small friction is."""
    result = slope(friction).solve()
    assert result.report["reason"] == "DIVERGED_DTOL" and result.notices == [FALLS]


def test_a_spring_that_holds_is_seen():
    """Along a slope without friction."""
    spring = {"nodes": [[0, 0], [0, 0], [1, 0]], "links": [[0, 1]] * 2 + [[2, 1]], "fixed": [[1, 1], [0, 0], [1, 1]]}
    spring |= {
        "law": ["friction", "tangent", "bar"],
        "stiffness": [0.0, 0.0, 1e3],
        "load": [[0, 0], [0, -10.0], [0, 0]],
    }
    spring["direction"] = [[-0.6, 0.8], [0.8, 0.6], [0, 0]]
    assert slope(0.0, **spring).solve().converged


JAMMED = """
import sys
sys.path.insert(0, sys.argv[1])
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from test_friction_notices import FALLS, discs, slope
whole = discs(3, 0.5)
own = slice(None) if PETSc.COMM_WORLD.rank else slice(0)
names = "nodes links law stiffness initial_elongation fixed prescribed load direction friction".split()
part = latinpc.LocalStructure(**{name: getattr(whole, name)[own] for name in names})
for structure in (whole, part):
    assert structure.solve().notices == ["no equilibrium: the gaps of the rigid links 0, 2, 4, 6 are incompatible"]
assert slope(0.0).solve().notices == [FALLS]
"""


def test_ranks_say_the_same(mpirun, request):
    """Also where one of them has no link."""
    mpirun(2, JAMMED, request.path.parent, timeout=60)


def test_walls_that_press_hold_with_the_least_friction():
    """Rigid walls may press as hard as it takes."""
    walls = {
        "nodes": [[-1, 0], [1, 0], [0, 0]],
        "links": [[0, 2]] * 2 + [[2, 1]] * 2,
        "law": ["friction", "tangent"] * 2,
    }
    walls |= {
        "fixed": [[1, 1], [1, 1], [0, 0]],
        "load": [[0, 0], [0, 0], [0, -10.0]],
        "direction": [[1, 0], [0, 1]] * 2,
    }
    assert slope(1e-12, **walls).solve().converged
    (text,) = slope(0.0, **walls).solve().notices
    assert text == FALLS.replace("1", "2")
