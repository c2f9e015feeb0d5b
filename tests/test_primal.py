"""Variant primal: all interfaces in the coarse problem, so that a partition changes nothing but the work."""

import json
from pathlib import Path

import numpy as np
import oracle
import pytest
from support import PLAIN, far, grid, irregular, lattice, network, solve

SCENES = {"grid": grid, "irregular": irregular, "network": network, "lattice": lattice}


@pytest.mark.parametrize("outer", [{}, PLAIN], ids=["anderson", "plain"])
@pytest.mark.parametrize("name", SCENES)
def test_iterates_are_those_of_one_subdomain(name, outer):
    """Whatever the partition: the same iterates, so the same number of them."""
    scene = SCENES[name]()
    chosen = {"variant": "primal", "stol": 0.0, "max_it": 6, **outer}
    many = solve(scene, **chosen)
    scene.subdomain = np.zeros(len(scene.links), dtype=int)
    one = solve(scene, **chosen)
    assert one.statistics["subdomains"] == 1 < many.statistics["subdomains"]
    assert one.statistics["weak_dofs"] == 0 < many.statistics["weak_dofs"]
    assert far(many.u, one.u) < 1e-9


@pytest.mark.parametrize("parts", [4, 16, 64])
@pytest.mark.parametrize("kind", ["truss", "tensegrity"])
def test_iterations_do_not_grow_with_the_size_of_subdomains(kind, parts):
    """Large subdomains need no more iterations than small ones, unlike those of the other variants."""
    scene = grid(kind, modules=16, subdomains=parts)
    chosen = {"stop": "reference", "stol": 1e-4, "_reference": oracle.newton(scene)}
    assert solve(scene, variant="primal", **chosen).iterations <= 15
    assert solve(scene, **chosen).iterations <= (15 if parts < 64 else 1.5 * 15)


def test_a_bar_structure_is_solved_at_once():
    """There is nothing to iterate on."""
    result = solve(grid("truss"), variant="primal")
    assert result.iterations == 1
    assert far(result.u, oracle.newton(grid("truss"))) < 1e-10


def test_a_solver_of_choice_gives_the_same():
    """By the general way of the linear stage, which keeps what it condenses by."""
    scene = irregular()
    chosen = {"variant": "primal", "stol": 1e-10}
    default = solve(scene, **chosen)
    other = solve(scene, local_pc_factor_mat_solver_type="mumps", **chosen)
    assert far(default.u, other.u) < 1e-9
    assert default.iterations == other.iterations


def test_what_auto_stands_for():
    """Primal, corner where subdomains repeat or where something of strong interfaces is chosen."""

    def strong(scene, **options):
        return solve(scene, max_it=1, **options).statistics["strong_macro_dofs"]

    assert strong(irregular()) == 0
    assert strong(irregular(), direction="diagonal") > 0
    assert strong(irregular(), modes="rigid") > 0
    assert strong(grid(modules=12, subdomains=9)) == 0
    assert strong(grid(modules=24, subdomains=144)) > 0


RANKS = """
import json, sys
sys.path.insert(0, sys.argv[2])
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_type", "latin", "-snes_stol", "1e-9"])
import latinpc
from support import irregular, network
found = []
for scene in (irregular(), network(nodes=500)):
    scene.subdomain = None
    structure = latinpc.Structure.from_scene(scene)
    snes = structure.create_snes()
    snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    stats = latinpc.statistics(snes)
    found.append([snes.getIterationNumber(), stats["subdomains"], structure.displacements(u).ravel().tolist()])
    rank = structure.comm.rank
if not rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


def test_ranks_change_nothing(mpirun, tmp_path):
    """One subdomain a rank by default, and the iteration of one."""
    found = {}
    for ranks in (1, 2, 4):
        mpirun(ranks, RANKS, tmp_path / f"{ranks}.json", Path(__file__).parent)
        found[ranks] = json.loads((tmp_path / f"{ranks}.json").read_text())
        for one, many in zip(found[1], found[ranks], strict=True):
            assert many[1] == ranks
            assert abs(many[0] - one[0]) <= 1
            assert far(np.array(many[2]), np.array(one[2])) < 1e-7
