"""Blocks that slide or tip without end, although forces inside their friction cones balance the loads."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from test_friction import bearing

import latinpc
from latinpc.bench.extremes.conditions import missed
from latinpc.scenes import Law, Scene

pytestmark = [
    pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the tolerances are of double precision"),
    pytest.mark.filterwarnings("ignore::latinpc.LatinWarning"),
]


def columns(count, rows, friction, width, push, gap=0.0):
    """Make columns of blocks, with gaps between them, under their weights and a part `push` of these sideways."""
    nodes, links, law, frames = [], [], [], []

    def touch(a, b, normal):
        links.extend([[a, b]] * 2)
        law.extend([Law.FRICTION, Law.TANGENT])
        frames.extend([normal, (-normal[1], normal[0])])

    for column, row in np.ndindex(count, rows):
        first, left = len(nodes), column * width
        nodes.extend([(left + x, row + y) for y in (0.0, 1.0) for x in (0.0, width)])
        links.extend([first + a, first + b] for a in range(4) for b in range(a + 1, 4))
        law.extend([Law.BAR] * 6)
        frames.extend([(0.0, 0.0)] * 6)
    free = len(nodes)
    for column, row in np.ndindex(count, rows):
        first = 4 * (rows * column + row)
        for k in (0, 1):
            if row == 0:
                nodes.append(nodes[first + k])
            touch(first - 2 + k if row else len(nodes) - 1, first + k, (0.0, 1.0))
            if column:
                touch(first - 4 * rows + 1 + 2 * k, first + 2 * k, (1.0, 0.0))
    law, fixed = np.array(law), np.arange(len(nodes))[:, None].repeat(2, axis=1) >= free
    beside = (law == Law.FRICTION) & (np.array(frames)[:, 0] == 1.0)
    return Scene(
        name="columns", nodes=nodes, links=links, law=law, stiffness=np.where(law == Law.BAR, 1e8, 0.0),
        direction=frames, friction=np.where(law == Law.FRICTION, friction, 0.0), fixed=fixed,
        initial_elongation=np.where(beside, gap, 0.0), load=np.where(fixed, 0.0, 2500.0 * np.array([push, -1.0])),
    )  # fmt: skip


def limit(count, rows, friction, width):
    """Return the largest push for which forces in the cones balance the loads."""
    still, pushed = (columns(count, rows, friction, width, push) for push in (0.0, 1.0))
    return bearing(still, pushed.load - still.load)


@pytest.mark.parametrize(
    ("count", "rows", "friction", "width", "part"),
    [(2, 3, 0.6, 0.5, 0.8), (3, 3, 0.6, 0.8, 0.9), (3, 3, 0.8, 0.5, 0.97), (3, 4, 0.4, 0.5, 0.97)],
)
def test_what_slides_without_end_is_named(count, rows, friction, width, part):
    """The upper blocks of the first column tip over; the iteration alone creeps until all its stages are spent."""
    shape = count, rows, friction, width
    scene = columns(*shape, part * limit(*shape))
    found = latinpc.Structure.from_scene(scene).solve()
    assert found.report["reason"] == "DIVERGED_DTOL"
    assert found.report["iterations"] < 4000
    nodes = ", ".join(str(node) for node in range(4 * rows - 6, 4 * rows))
    assert found.notices[0].startswith(f"contacts that bear do not hold nodes {nodes}, ")


@pytest.mark.parametrize("units", [2.0**-20, 2.0**20])
def test_units_of_force_do_not_matter(units):
    scene = columns(3, 3, 0.6, 0.8, 0.34)
    scene = replace(scene, load=units * scene.load, stiffness=units * scene.stiffness)
    found = latinpc.Structure.from_scene(scene).solve()
    assert found.report["reason"] == "DIVERGED_DTOL"
    assert found.notices[0].startswith("contacts that bear do not hold node")  # MUMPS rounds anew in each run


CLOSE = [(2, 4, 0.9, 0.6), (2, 6, 0.7, 0.7), (3, 4, 0.6, 0.8)]
SLOW = [(3, 6, 0.4, 0.9), (2, 6, 0.7, 0.7), (2, 5, 0.5, 0.6)]


@pytest.mark.parametrize(
    ("shapes", "gap", "most"),
    [(CLOSE, 1e-2, 5000), (SLOW, 0.0, 5000)],
    ids=["gaps that close on the way", "slow modes"],
)
def test_slides_of_many_stages(shapes, gap, most):
    """Blocks slide for thousands of stages until they touch, or come to their motion slowly."""
    found = [latinpc.Structure.from_scene(columns(*shape, 0.9 * limit(*shape), gap)).solve().report for shape in shapes]
    assert all(report["reason"].startswith("DIVERGED") for report in found)
    soon = [report for report in found if report["reason"] == "DIVERGED_DTOL" and report["iterations"] < most]
    assert len(soon) >= 2  # rounding decides


@pytest.mark.parametrize(("friction", "part"), [(0.4, 0.5), (0.8, 0.5)])
def test_what_friction_holds_stands(friction, part):
    shape = 3, 3, friction, 0.8
    scene = columns(*shape, part * limit(*shape))
    found = latinpc.Structure.from_scene(scene).solve()
    assert found.converged
    assert missed(scene, found.displacements, found.tensions) < 1e-4


RANKS = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from test_slides import columns
found = latinpc.Structure.from_scene(columns(3, 3, 0.6, 0.8, 0.34)).solve()
assert found.report["reason"] == "DIVERGED_DTOL"
assert found.notices[0].startswith("contacts that bear do not hold node")  # MUMPS rounds anew in each run
"""


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_ranks_do_not_matter(ranks, mpirun):
    mpirun(ranks, RANKS)
