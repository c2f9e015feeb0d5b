"""Structures that are not held, in two subdomains, whose springs hold them in the local problems: mechanisms."""

import numpy as np
import pytest

import latinpc
from latinpc.scenes import Law

CELLS = 8
LINEAR = [{"ksp_type": "cg", "pc_type": "latin"}, {"ksp_type": "latin"}]
NONLINEAR = [
    {"snes_latin_variant": variant, "snes_latin_direction": direction}
    for variant in ("corner", "macro", "none")
    for direction in ("scalar", "diagonal", "schur")
]


def strip(cells=CELLS, held=False):
    """Draw a braced strip two cells wide, of which x of one node is fixed, or both components of one end."""
    number = np.arange(3 * (cells + 1)).reshape(-1, 3)
    links = [(number[i, j], number[i + 1, j]) for i in range(cells) for j in range(3)]
    links += [(number[i, j], number[i, j + 1]) for i in range(cells + 1) for j in range(2)]
    links += [(number[i, j], number[i + 1, j + 1]) for i in range(cells) for j in range(2)]
    links += [(number[i, j + 1], number[i + 1, j]) for i in range(cells) for j in range(2)]
    links = np.array(links)
    nodes = np.stack(np.divmod(np.arange(number.size), 3), 1).astype(float)
    fixed, load = np.zeros(nodes.shape, bool), np.zeros(nodes.shape)
    fixed[0, 0], load[-1, 1] = True, -1.0
    if held:
        fixed[:3] = True
    half = (links.min(1) // 3 >= cells // 2).astype(int)
    return latinpc.Structure(nodes, links, Law.BAR, 1e3, fixed=fixed, load=load, subdomain=half)


@pytest.mark.parametrize("options", LINEAR + NONLINEAR, ids=lambda one: " ".join(one.values()))
def test_a_free_strip_is_a_mechanism(options):
    """The springs of the search direction are soft: what they hold alone is lost in the rounding of the strip."""
    linear = {"snes_type": "ksponly"} if "ksp_type" in options else {}
    with pytest.raises(latinpc.SolveError, match="The structure has a mechanism"):
        strip().solve(options=linear | options)
    assert strip(held=True).solve(options=linear | options).converged


@pytest.mark.parametrize("options", NONLINEAR, ids=lambda one: " ".join(one.values()))
def test_a_slender_strip_is_none(options):
    """A cantilever a hundred times as long as wide: its tip is some 1e-6 times as stiff as a link."""
    whole = strip(200, held=True)
    found = whole.solve(error=1e-8, options=options)
    assert found.converged
    direct = whole.solve(options={"snes_type": "newtonls", "pc_type": "lu"})
    assert np.allclose(found.displacements, direct.displacements, rtol=0, atol=1e-6 * abs(direct.displacements).max())
