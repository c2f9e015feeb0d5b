"""Load cases with large displacements: which equilibrium they find, what one says that is refused or fails."""

import re

import numpy as np
import pytest
import turning
from petsc4py import PETSc

import latinpc
from latinpc import Case
from latinpc.results.caselist import rows

LIMIT = turning.von_mises_limit()


def truss(comm=PETSc.COMM_SELF):
    return latinpc.Structure(**turning.von_mises(0.0), geometry="large", comm=comm)


def down(part):
    """A load on the apex, of that part of the limit load."""
    return Case(f"{part:g}", load=[[0.0, 0.0], [0.0, 0.0], [0.0, -part * LIMIT]])


def test_a_case_past_a_limit_point_says_so():
    """Load factor, mode and reason as of a single solve; reactions and displacements are those of a part."""
    with pytest.warns(latinpc.LatinWarning) as warned:
        found = latinpc.solve_cases(truss(), [down(1.5)])
    texts = [str(warning.message) for warning in warned]
    (text,) = (text for text in found.notices if "buckles" in text)
    assert text.startswith("case 1.5: no stable equilibrium follows that of 0.66") and text.endswith("its mode: 2")
    assert text in texts and texts[-1] == "not converged: 1.5: DIVERGED_DTOL"
    assert issubclass(warned[-1].category, latinpc.ConvergenceWarning)
    factor = found.report["cases"][0]["load_factor"]
    assert 0.63 < factor < 2.0 / 3.0
    assert rows(found)[0][-1] == f"DIVERGED_DTOL at {factor:.4g} of its loads"
    alone = found.actions[0].applied(found.scene).solve(comm=PETSc.COMM_SELF)
    assert alone.report["load_factor"] == factor
    assert found.reactions[0] == pytest.approx(alone.reactions, rel=1e-12)
    assert found.reactions[0].sum(axis=0) == pytest.approx([0.0, 1.5 * factor * LIMIT], rel=1e-6)
    assert f"case {alone.notices[0]}".replace("case ", "case 1.5: ") in found.notices


def test_a_case_that_collapses_names_its_nodes():
    """Small displacements: a cable that is pushed holds nothing."""
    structure = latinpc.Structure([[0.0], [1.0]], [[0, 1]], "cable", 100.0, fixed=[[1], [0]], comm=PETSc.COMM_SELF)
    with pytest.warns(latinpc.ConvergenceWarning, match="not converged: push: DIVERGED_DTOL"):
        found = latinpc.solve_cases(structure, [Case("push", load=[[0], [-1.0]]), Case("pull", load=[[0], [1.0]])])
    assert any(text.startswith("case push: no equilibrium") for text in found.notices)
    assert not any(text.startswith("case pull") for text in found.notices)


@pytest.mark.filterwarnings("ignore:case far")
def test_the_case_that_moves_farthest_says_that_links_turn():
    """With small displacements."""
    structure = latinpc.Structure(
        [[0, 0], [1, 0], [1, -1]], [[0, 1], [2, 1]], "bar", 10.0, fixed=[[1, 1], [0, 0], [1, 1]], comm=PETSc.COMM_SELF
    )
    cases = [Case(name, load=[[0, 0], [0, force], [0, 0]]) for name, force in (("near", 0.1), ("far", 10.0))]
    (text,) = latinpc.solve_cases(structure, cases).notices
    assert text.startswith("case far: links turn by up to 45 degrees")
    assert not latinpc.solve_cases(structure, cases[:1]).notices


RANKS = """
import warnings
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
from test_cases_large import down, truss
import latinpc
warnings.simplefilter("ignore")
found = latinpc.solve_cases(truss(PETSc.COMM_WORLD), [down(1.5), down(0.5)])
assert [case["converged"] for case in found.report["cases"]] == [False, True]
assert found.notices[0].startswith("case 1.5: no stable equilibrium"), found.notices
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks_say_the_same(mpirun, ranks):
    mpirun(ranks, f"import sys\nsys.path.insert(0, {str(turning.__file__.rsplit('/', 1)[0])!r})\n{RANKS}")


@pytest.mark.filterwarnings("ignore:case 1.5", "ignore:not converged")
@pytest.mark.parametrize("order", [(0.5, 0.9, 1.5), (1.5, 0.9, 0.5)])
def test_other_cases_do_not_lead_past_a_limit_point(order):
    """Loads lead from zero, not from the equilibrium of another case: as each case by itself."""
    found = latinpc.solve_cases(truss(), [down(part) for part in order], {"snes_latin_error": 1e-10})
    for part, row, u in zip(order, found.report["cases"], found.displacements):
        assert row["converged"] == (part < 1.0)
        if part < 1.0:
            assert -u[2, 1] == pytest.approx(turning.von_mises_deflection(part * LIMIT), rel=1e-9)


def test_other_cases_do_not_lead_struts_of_geometry_prestress_astray():
    """What is drawn buckles: a load decides to which side, or rounding if it is small, not the order of the cases."""
    structure = latinpc.Structure(**turning.struts(0.0), geometry="prestress", comm=PETSc.COMM_SELF)
    loads = np.array([5.0, -1.0, 0.1, 1.0, -0.5, -4.0])
    alone = latinpc.Structure(**turning.struts(loads[2]), geometry="prestress", comm=PETSc.COMM_SELF).solve()
    side = np.where(np.arange(6) == 2, np.sign(alone.displacements[1, 1]), np.sign(loads))
    for order in (range(6), range(5, -1, -1), (2, 4, 1, 3, 0, 5)):
        cases = [Case(str(i), load=turning.struts(loads[i])["load"]) for i in order]
        found = latinpc.solve_cases(structure, cases)
        assert found.converged and not found.notices
        assert (np.sign(found.displacements[:, 1, 1]) == side[list(order)]).all()


def test_cables_alone_start_from_other_cases():
    """They have one equilibrium: fewer stages in all than each case by itself."""
    scene = latinpc.scenes.Scene.from_structure(
        latinpc.Structure(**turning.net(6, 1.0, [0.0, 0.0, -200.0]), geometry="large", comm=PETSc.COMM_SELF)
    )
    cases = [Case(f"{part}", load=part * scene.load) for part in (0.0, 0.05, 0.1, 0.15)]
    found = latinpc.solve_cases(scene, cases, {"snes_latin_error": 1e-6}, comm=PETSc.COMM_SELF)
    alone = [case.applied(scene).solve(comm=PETSc.COMM_SELF, error=1e-6) for case in cases]
    assert sum(row["iterations"] for row in found.report["cases"]) < sum(result.iterations for result in alone)
    for u, result in zip(found.displacements, alone):
        assert np.linalg.norm(u - result.displacements) < 1e-5 * np.linalg.norm(result.displacements)


def test_what_is_refused_of_a_case_names_it():
    """The gap of an inextensible cable between supports, which the settlements of one case open."""
    tied = latinpc.Structure(
        [[0, 0], [1, 0], [0.5, 1]], [[0, 2], [1, 2], [0, 1]], ["bar", "bar", "inextensible"], [1.0, 1.0, 0.0],
        fixed=[[1, 1], [1, 1], [0, 0]], load=[[0, 0], [0, 0], [0.01, -0.01]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    near, apart = (Case(name, prescribed=[[0, 0], [x, 0], [0, 0]]) for name, x in (("near", -0.1), ("apart", 0.1)))
    said = r"^case apart: Link 2 \(inextensible\) has prescribed displacements"
    with pytest.raises(latinpc.LatinError, match=said):
        latinpc.solve_cases(tied, [apart])
    truth = near.applied(latinpc.scenes.Scene.from_structure(tied)).solve()
    with pytest.warns(latinpc.ConvergenceWarning, match="^not converged: apart: REFUSED; again: REFUSED$"):
        found = latinpc.solve_cases(tied, [apart, near, apart.named("again"), near.named("nearer")])
    assert [row["reason"] == "REFUSED" for row in found.report["cases"]] == [True, False, True, False]
    assert np.isnan(found.displacements[[0, 2]]).all() and np.isnan(found.tensions[[0, 2]]).all()
    assert re.search(r"^apart +0( +not known){4}  REFUSED$", str(found), re.MULTILINE)
    assert np.isfinite(found.reaction_envelope()[:2]).all() and "nan" not in str(found)
    assert found.to_dict()["cases"][0]["highest"] is None
    assert len(found.notices) == 2 and all(
        re.match(said.replace("apart", "(apart|again)"), text) for text in found.notices
    )
    for number in (1, 3):
        assert np.array_equal(found.displacements[number], truth.displacements)
        assert np.array_equal(found.tensions[number], truth.tensions)
    assert np.array_equal(found.envelope()[1], truth.tensions)
