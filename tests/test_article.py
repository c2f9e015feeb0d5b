"""The article's tables, and what must be reached on them: counts exactly, iterations within their bounds.

The quick tests take the smaller sizes; `make test-all` takes every size, up to 144 subdomains.
"""

from dataclasses import replace

import pytest
from petsc4py import PETSc
from support import VARIANTS, solve, statistics

import latinpc
from latinpc.bench import paper
from latinpc.runs.reference import reference_solution
from latinpc.scenes import make

QUICK = (9, 16, 36)
SIZES = [QUICK, pytest.param(paper.SUBDOMAINS, marks=pytest.mark.slow)]

#: Plain iterations to 1e-3 and 1e-4, d = 7.0e6 N/m, corners as published, by number of subdomains
TENSEGRITY = {
    "macro": {9: (35, 49), 16: (36, 48), 25: (39, 52), 36: (40, 54), 64: (44, 58), 100: (46, 62), 144: (48, 64)},
    "corner": {9: (35, 49), 16: (36, 48), 25: (40, 52), 36: (40, 54), 64: (44, 58), 100: (46, 62), 144: (48, 64)},
}

#: subdomains: modules, macro dofs, weak dofs of variant macro, of variant corner
TABLE_3 = {9: (144, 108, 24, 12), 16: (256, 216, 54, 27), 36: (576, 540, 150, 75), 144: (2304, 2376, 726, 363)}


@pytest.mark.parametrize("subdomains", TABLE_3)
def test_table_3(subdomains):
    """Modules and coarse unknowns, exactly."""
    modules, macro_dofs, *weak_dofs = TABLE_3[subdomains]
    scene = make("truss-grid", modules=round(modules**0.5), subdomains=subdomains)
    for variant, expected in zip(("macro", "corner"), weak_dofs):
        found = statistics(scene, variant=variant)
        assert (found["strong_macro_dofs"], found["weak_dofs"]) == (macro_dofs, expected)


@pytest.mark.parametrize("sizes", SIZES)
def test_table_4_as_published(sizes):
    """Truss, springs on the corners: at most 31 iterations to 1e-4 at every size, both variants."""
    rows = paper.table(4, sizes, published=True)["rows"]
    assert len(rows) == 2 * len(sizes)
    assert all(row["settled"]["1e-4"] <= 31 for row in rows)


@pytest.mark.parametrize("sizes", SIZES)
def test_table_4_with_free_corners(sizes):
    """Truss, the default corners: at most 17."""
    rows = [row for row in paper.table(4, sizes)["rows"] if row["variant"] == "corner"]
    assert [row["subdomains"] for row in rows] == list(sizes)
    assert all(row["settled"]["1e-4"] <= 17 for row in rows)


@pytest.mark.parametrize("sizes", SIZES)
def test_table_6_as_published(sizes):
    """Tensegrity, springs on the corners: within 5 % of what the slow implementation has counted."""
    for row in paper.table(6, sizes, published=True)["rows"]:
        expected = TENSEGRITY[row["variant"]][row["subdomains"]]
        assert (row["iterations"]["1e-3"], row["iterations"]["1e-4"]) == pytest.approx(expected, rel=0.05)
        assert row["slack"] == pytest.approx(0.09, abs=0.006)


@pytest.mark.parametrize("sizes", SIZES)
def test_table_6_with_free_corners(sizes):
    """Tensegrity, the default corners: at most 27 iterations to 1e-3 and 38 to 1e-4."""
    rows = [row for row in paper.table(6, sizes)["rows"] if row["variant"] == "corner"]
    assert len(rows) == len(sizes)
    assert all(row["settled"]["1e-3"] <= 27 and row["settled"]["1e-4"] <= 38 for row in rows)


@pytest.mark.parametrize("subdomains", [16, pytest.param(144, marks=pytest.mark.slow)])
def test_table_7_is_a_valley(subdomains):
    """Iterations fall with the direction down to a half or a quarter of the guess, then rise."""
    rows = paper.table(7, (subdomains,), published=True)["rows"]
    for accuracy in ("1e-3", "1e-4"):
        counts = [row["settled"][accuracy] for row in rows]
        bottom = counts.index(min(counts))
        assert bottom in (2, 3)
        assert counts[: bottom + 1] == sorted(counts[: bottom + 1], reverse=True)
        assert counts[bottom:] == sorted(counts[bottom:])


@pytest.mark.parametrize("sizes", SIZES)
def test_acceleration_at_every_size(sizes):
    """All defaults: tensegrity to 1e-3 in at most 15 and to 1e-4 in at most 21 linear stages."""
    rows = [row for row in paper.table(6, sizes, outer="anderson")["rows"] if row["variant"] == "corner"]
    assert len(rows) == len(sizes)
    assert all(row["settled"]["1e-3"] <= 15 and row["settled"]["1e-4"] <= 21 for row in rows)


# ---- irregular partitions --------------------------------------------------------------------
def counts_to(scene, parts, accuracy=1e-3):
    """Iterations of the three variants on a partition by METIS, to an l2 error; all must get there."""
    structure = latinpc.Structure.from_scene(replace(scene, subdomain=None), comm=PETSc.COMM_SELF)
    whole = structure.displacements(reference_solution(structure))
    found = []
    for variant in VARIANTS:
        options = {"variant": variant, "subdomains": parts, "stop": "reference", "stol": accuracy, "max_it": 1000}
        result = solve(scene, _reference=whole, _structure=structure, **options)
        assert result.reason == PETSc.SNES.ConvergedReason.CONVERGED_SNORM_RELATIVE, (variant, result.reason)
        assert result.statistics["subdomains"] == parts
        found.append(result.iterations)
    return found


def tell(capsys, what, found):
    """Put the counts in the output of the tests, also of those that pass."""
    with capsys.disabled():
        print(f"\n{what}: " + ", ".join(f"{variant} {count}" for variant, count in zip(VARIANTS, found)), end=" ")


@pytest.mark.parametrize(
    ("kind", "modules", "parts"),
    [
        ("truss", 12, 9),
        ("tensegrity", 12, 9),
        ("tensegrity", 10, 7),
        pytest.param("truss", 24, 36, marks=pytest.mark.slow),
        pytest.param("tensegrity", 24, 36, marks=pytest.mark.slow),
        pytest.param("tensegrity", 48, 144, marks=pytest.mark.slow),
    ],
)
def test_metis_on_the_grid(kind, modules, parts, capsys):
    """A partition that cuts through the modules: every variant converges, and with corners in hardly more steps."""
    found = counts_to(make(f"{kind}-grid", modules=modules, partition="metis"), parts)
    tell(capsys, f"{kind} {modules}x{modules}, {parts} parts by METIS", found)
    assert found[VARIANTS.index("corner")] <= 40


@pytest.mark.parametrize("seed", range(20))
def test_networks(seed, capsys):
    """Random networks cut by METIS: every variant converges, whatever the seed."""
    found = counts_to(make("network", nodes=200, seed=seed), 8)
    tell(capsys, f"network of seed {seed}, 8 parts by METIS", found)
    assert max(found) <= 100
