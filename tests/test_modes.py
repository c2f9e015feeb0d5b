"""Macro fields of the strong interfaces: affine (section 3.2), or rigid."""

import numpy as np
import oracle
import pytest
from bases import rigid_modes
from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

SCENES = {
    "grid": lambda: make("tensegrity-grid", modules=8, subdomains=4),
    "irregular": lambda: make("network", nodes=150, seed=1),
    "2D": lambda: make("lattice", nx=8, ny=4, subdomains=2),
}


def solve(scene, options, **more):
    """SNES latin on a scene with its own options; METIS makes the partition of a scene that has none."""
    structure = latinpc.Structure.from_scene(scene)
    snes = structure.create_snes()
    snes.setOptionsPrefix("modes_")
    options.update({f"modes_snes_{key}": value for key, value in more.items()})
    snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    return snes, structure.displacements(u)


@pytest.fixture
def database():
    """PETSc's options, emptied of ours afterwards."""
    options = PETSc.Options()
    given = {}
    yield type(
        "Database", (), {"update": lambda self, d: (given.update(d), [options.setValue(*i) for i in d.items()])}
    )()
    for key in given:
        options.delValue(key)


@pytest.mark.parametrize("variant", ["none", "macro", "corner"])
@pytest.mark.parametrize("name", SCENES)
def test_iterates_are_the_oracles(name, variant, database):
    """Plain iterations with rigid macro fields agree with the oracle to rounding."""
    scene = SCENES[name]()
    more = {} if scene.subdomain is not None else {"latin_subdomains": 5}
    more |= {"latin_modes": "rigid", "latin_variant": variant}
    snes, u = solve(scene, database, max_it=5, latin_outer_snes_type="nrichardson", **more)
    scene.subdomain = latinpc.subdomain_of_links(snes)
    history = oracle.latin_history(scene, 5, modes=rigid_modes, variant=variant)
    assert np.allclose(latinpc.history(snes)["indicator"], history.indicator, rtol=1e-9)
    assert np.abs(u - history.iterates[-1].reshape(u.shape)).max() < 1e-10 * np.abs(u).max()


@pytest.mark.parametrize("name", SCENES)
def test_both_kinds_find_the_same_displacements(name, database):
    """The macro fields change the way to the solution and the size of the coarse problem, not the solution."""
    more = {} if name != "irregular" else {"latin_subdomains": 5}
    found = {}
    for modes in ("affine", "rigid"):
        snes, u = solve(SCENES[name](), database, latin_modes=modes, latin_variant="corner", stol=1e-9, **more)
        assert snes.reason > 0
        found[modes] = u, latinpc.statistics(snes)["strong_macro_dofs"]
    difference = found["affine"][0] - found["rigid"][0]
    assert np.abs(difference).max() < 1e-6 * np.abs(found["affine"][0]).max()
    assert found["rigid"][1] < found["affine"][1]


def test_rigid_motions_of_a_floating_subdomain_cost_nothing(database):
    """Rigid fields contain the rigid motions: six zero eigenvalues at least of the homogenised stiffness."""
    snes, _ = solve(make("tensegrity-grid", modules=12, module="modified", subdomains=9), database, latin_modes="rigid")
    values = np.linalg.eigvalsh(latinpc.macro_stiffness(snes, 4).getDenseArray())
    assert values[0] > -1e-9 * values[-1]
    assert np.count_nonzero(values < 1e-9 * values[-1]) == 6
