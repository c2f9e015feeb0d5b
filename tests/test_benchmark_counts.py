"""Iterations do not depend on the machine: those of benchmarks/results/counts.json must not grow."""

import importlib.util
import json

import pytest
from conftest import ROOT

spec = importlib.util.spec_from_file_location("benchmark", ROOT / "benchmarks" / "run.py")
benchmark = importlib.util.module_from_spec(spec)
spec.loader.exec_module(benchmark)

KEPT = json.loads((ROOT / "benchmarks" / "results" / "counts.json").read_text())
ROUNDING = 1  # another BLAS or METIS may end one iteration later
SIZES = [name for name in KEPT if name.startswith(("tensegrity", "truss")) and "metis" not in name]


def test_every_count_is_kept():
    assert list(KEPT) == list(benchmark.COUNTED)
    assert all(value is not None for found in KEPT.values() for value in found.values())


@pytest.mark.parametrize("name", [name for name in benchmark.COUNTED if not name.endswith("96")])
def test_iterations_do_not_grow(name):
    for accuracy, value in benchmark.count(name).items():
        assert value is not None and value <= KEPT[name][accuracy] + ROUNDING, f"{name} to {accuracy}"


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in benchmark.COUNTED if name.endswith("96")])
def test_iterations_do_not_grow_large(name):
    test_iterations_do_not_grow(name)


@pytest.mark.parametrize("kind", ["tensegrity-grid", "truss-grid"])
def test_iterations_hardly_depend_on_the_number_of_subdomains(kind):
    for accuracy in KEPT[f"{kind} 12"]:
        counts = [KEPT[name][accuracy] for name in SIZES if name.startswith(kind)]
        assert max(counts) <= 1.35 * counts[0] + ROUNDING, (accuracy, counts)
