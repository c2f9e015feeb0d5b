"""Coarse spaces side by side: iterations do not depend on the machine, those of the results must not grow."""

import importlib.util
import json

import pytest
from conftest import ROOT

spec = importlib.util.spec_from_file_location("coarse_spaces", ROOT / "benchmarks" / "coarse_spaces.py")
benchmark = importlib.util.module_from_spec(spec)
spec.loader.exec_module(benchmark)

KEPT = json.loads(benchmark.RESULT.read_text())
BOTH, MACRO = "both, 4.4", "macro only, 4.1"


@pytest.mark.parametrize("name", benchmark.SCENES)
def test_iterations_do_not_grow(name):
    kept = KEPT["spaces"][name]["16"]
    for space, found in benchmark.spaces(name, 16).items():
        # another METIS cuts in other places
        assert abs(found["coarse"] - kept[space]["coarse"]) <= (0.15 * found["coarse"] if name.endswith("metis") else 0)
        for solver in ("ksp", "cg"):
            slack = 5 if name.endswith("metis") else 1
            assert found[solver] <= 1.1 * kept[space][solver] + slack, (space, solver)


@pytest.mark.parametrize("name", benchmark.SCENES)
def test_both_scale(name):
    """The default coarse space is flat from 16 to 400 subdomains, and no worse than macro fields alone."""
    sizes = KEPT["spaces"][name]
    for solver in ("ksp", "cg"):
        counts = [found[BOTH][solver] for found in sizes.values()]
        assert max(counts) <= 1.25 * min(counts)
        for found in sizes.values():
            assert found[BOTH][solver] <= (found[MACRO][solver] or 300) + 1


@pytest.mark.slow
def test_iterations_do_not_grow_with_subdomains():
    for space, found in benchmark.spaces("truss-grid", 144, (BOTH, MACRO)).items():
        assert found["ksp"] <= KEPT["spaces"]["truss-grid"]["144"][space]["ksp"] + 1


def test_page_is_that_of_the_results():
    page = benchmark.PAGE.read_text()
    for lines in benchmark.tables(KEPT).values():
        assert "\n".join(lines) in page
