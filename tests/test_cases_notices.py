"""What load cases say of each of them: displacements that are too large, and cases that are refused."""

import numpy as np
import pytest
from petsc4py import PETSc
from test_cases import row

import latinpc
from latinpc import Case
from latinpc.scenes.scene import Scene


def net(n=6, geometry="linear"):
    """A flat net of cables in tension of 1 kN, held at its rim."""
    x, y = np.meshgrid(range(n), range(n), indexing="ij")
    nodes = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    place = np.arange(n * n).reshape(n, n)
    links = np.concatenate([
        np.column_stack([place[:-1].ravel(), place[1:].ravel()]),
        np.column_stack([place[:, :-1].ravel(), place[:, 1:].ravel()]),
    ])  # fmt: skip
    rim = (nodes[:, :2] == 0).any(axis=1) | (nodes[:, :2] == n - 1).any(axis=1)
    fixed = np.repeat(rim[:, None], 3, axis=1)
    return latinpc.Structure(
        nodes, links, "cable", EA=1e6, prestress=1e3, fixed=fixed, geometry=geometry, comm=PETSc.COMM_SELF
    )


def down(name, force, structure):
    return Case(name, load=np.where(structure.fixed, 0.0, [0.0, 0.0, -force]))


def test_every_case_that_moves_too_far_is_named():
    """Not only the one that moves farthest, whose own displacements may be of a kind that is no fault."""
    structure = net(geometry="prestress")
    sinks = Case("ground sinks", prescribed=np.where(structure.fixed, [0.0, 0.0, -2.0], 0.0))
    cases = [sinks, down("snow", 400.0, structure), down("dust", 1.0, structure), down("sand", 300.0, structure)]
    with pytest.warns(latinpc.LatinWarning):
        found = latinpc.solve_cases(structure, cases)
    assert found.converged
    (turns,) = (text for text in found.notices if "links turn" in text)
    assert turns.startswith("case snow: links turn by up to") and turns.endswith("(likewise sand)")
    (moves,) = (text for text in found.notices if text.startswith("case ground sinks: nodes move by 0.28"))
    assert "likewise" not in moves


def test_of_many_cases_some_are_named():
    structure = net(geometry="prestress")
    with pytest.warns(latinpc.LatinWarning):
        found = latinpc.solve_cases(structure, [down(f"case {k}", 300.0 + k, structure) for k in range(20)])
    (turns,) = (text for text in found.notices if "links turn" in text)
    assert turns.startswith("case case 19: ") and turns.endswith("case 12, case 11 and 11 more)")


def test_each_says_what_it_says_alone():
    structure = net(geometry="prestress")
    case = down("snow", 400.0, structure)
    with pytest.warns(latinpc.LatinWarning):
        alone = case.applied(Scene.from_structure(structure)).solve(comm=PETSc.COMM_SELF)
        found = latinpc.solve_cases(structure, [case, down("dust", 1.0, structure)])
    assert [f"case snow: {text}" for text in alone.notices] == found.notices


def test_displacements_beyond_the_structure_are_named():
    structure = net(geometry="large")
    with pytest.warns(latinpc.LatinWarning, match="case far: node .* moves by .*, farther than the structure is large"):
        latinpc.solve_cases(
            structure,
            [Case("far", prescribed=np.where(structure.fixed, [0.0, 0.0, -50.0], 0.0)), down("a", 1.0, structure)],
        )


def test_a_case_that_is_refused_does_not_take_the_others_with_it():
    """A strut between two cables that hold it; its strain when warmed counts as prestress, by which it buckles."""
    nodes = [[0.0, 0.0], [0.0, 1.0], [-1.0, 1.0], [1.0, 1.0]]
    structure = latinpc.Structure(
        nodes, [[0, 1], [1, 2], [1, 3]], ["bar", "cable", "cable"], EA=[1e6, 1e3, 1e3], prestress=[0.0, 10.0, 10.0],
        fixed=[[1, 1], [0, 0], [1, 1], [1, 1]], load=[[0, 0], [0.1, 0.0], [0, 0], [0, 0]], geometry="prestress",
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    warm = Case("warm", initial_elongation=[-1e-2, 0.0, 0.0])
    wind = Case("wind", load=[[0, 0], [0.1, 0.0], [0, 0], [0, 0]])
    with pytest.warns(latinpc.LatinWarning):
        found = latinpc.solve_cases(structure, [warm, wind])
    assert found.report["cases"][0]["reason"] == "REFUSED"
    assert [case["converged"] for case in found.report["cases"]] == [False, True]
    assert np.isnan(found.displacements[0]).all()
    (text,) = (text for text in found.notices if text.startswith("case warm: "))
    assert "its prestress makes it buckle" in text and text.endswith("take -snes_latin_geometry large")
    alone = latinpc.solve_cases(structure, [wind])
    assert found.tensions[1] == pytest.approx(alone.tensions[0], rel=1e-9)


def test_options_that_nothing_reads_are_named():
    with pytest.warns(latinpc.LatinWarning, match="no solver has read -snes_max_itt: misspelt"):
        found = latinpc.solve_cases(row(), [Case("a"), Case("b")], {"snes_max_itt": 3, "snes_max_it": 30})
    assert len(found.notices) == 1


@pytest.mark.parametrize("solver", ["ksponly", "ksptransposeonly"])
def test_one_linear_step_for_each_case_is_said(solver):
    """Its results are wrong where cables slacken, also where reactions happen to balance the loads."""
    structure = net(geometry="prestress")
    options = {"snes_type": solver, "pc_type": "lu"}
    with pytest.warns(latinpc.LatinWarning, match=f"^{solver} makes one linear step: it does not follow cables"):
        found = latinpc.solve_cases(structure, [down("dust", 1.0, structure)], options=options)
    assert found.converged and found.notices[0].startswith(solver)
