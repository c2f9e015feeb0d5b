"""What solves of structures in parts say of their results: the sentences of a solve of the whole, on every rank."""

import pytest

SAID = """
import warnings
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from latinpc.arrays import block
from latinpc.distributed.result import LocalResult
from latinpc.results.limit import unstable
from latinpc.results.loose import loose
from latinpc.results.mechanics import slack, stretches, tensions_at
from latinpc.scenes import make
comm = PETSc.COMM_WORLD.tompi4py()
warnings.simplefilter("ignore")


def part(given):
    # nodes in blocks, links too, wherever their nodes are
    return {name: np.asarray(all)[slice(*block(len(all), comm.rank, comm.size))] for name, all in given.items()}


def same(word, given, geometry="linear", **how):
    whole = latinpc.Structure(**given, geometry=geometry, comm=PETSc.COMM_SELF).solve(**how)
    own = latinpc.LocalStructure(**part(given), geometry=geometry).solve(**how)
    assert any(word in text for text in whole.notices), (word, whole.notices)
    assert sorted(own.notices) == sorted(whole.notices), (own.notices, whole.notices)
    assert own.gather().notices == own.notices
    balance = own.part().balance
    for mine, theirs in zip(balance, whole.balance):
        np.testing.assert_allclose(mine, theirs, atol=1e-9 * (np.abs(whole.load).sum() or 1.0))


def frame(load, **more):
    return {
        "nodes": [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0]], "links": [[0, 2], [1, 2]], "law": ["bar", "bar"],
        "stiffness": [1e3, 1e3], "fixed": [[1, 1], [1, 1], [0, 0]], "load": [[0.0, 0.0], [0.0, 0.0], load], **more
    }


same("links turn by up to", frame([200.0, -10.0]))
same("farther than the structure", frame([0.0, -3e4]))
same("no solve stops at -snes_rtol", frame([0.0, -10.0]), options={"snes_rtol": 1e-3})
same("tensions of the displaced links differ", frame([0.0, -100.0], prestress=[1.0, 1.0]), "prestress")
same("initial elongation of link 1 is larger", frame([0.0, -10.0], initial_elongation=[0.0, 2.0]))
flat = [[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0]]
same("no stable equilibrium follows that of", frame([0.0, -50.0], nodes=[*flat[:2], [0.0, 0.1]]), "large")
same("nodes that move most in its mode: 2", frame([0.0, -50.0], nodes=[*flat[:2], [0.0, 0.1]]), "large")
same("as drawn is unstable: its prestress", frame([1.0, 0.0], nodes=flat, prestress=[-10.0, -10.0]), "large")
hung = {
    "nodes": [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, -2.0]],
    "links": [[2, 3], [0, 3], [1, 3], [0, 2], [1, 2]], "law": ["cable", "cable", "cable", "bar", "bar"],
    "stiffness": 5 * [1e3], "initial_elongation": [-0.1, -0.1, -0.1, 0.0, 0.0],
    "fixed": [[1, 1], [1, 1], [0, 0], [0, 0]], "load": [[0.0, 0.0], [0.0, 0.0], [0.0, -10.0], [0.0, 0.0]],
}
same("leave node 3 free", hung)
stiff = hung | {"stiffness": [1e3, 1e3, 1e3, 1e14, 1e3], "initial_elongation": [0.1, -0.1, 0.0, 0.0, 0.0]}
same("stiffnesses differ by a factor of 1e+11", stiff, options={"snes_max_it": 1, "snes_latin_newton": "never"})
same("leave node 3 free", hung, "large")
# many nodes, of which links of one rank or of several hold some
scene, rng = make("network", nodes=60), np.random.default_rng(1)
given = {name: getattr(scene, name) for name in ("nodes", "links", "stiffness", "fixed")}
given["law"] = np.where(rng.random(len(scene.links)) < 0.8, 1, 0)
u = np.where(scene.fixed, 0.0, rng.normal(0.0, 1e-3, scene.nodes.shape))
for geometry in ("linear", "large"):
    given["initial_elongation"] = np.zeros(len(scene.links))
    if geometry == "large":
        given["initial_elongation"] -= np.where(rng.random(len(scene.links)) < 0.9, 0.1, 0.0)
        given["law"] = np.ones(len(scene.links), int)
    whole, own = latinpc.Structure(**given, comm=PETSc.COMM_SELF), latinpc.LocalStructure(**part(given))
    for structure in (whole, own):
        structure.set_geometry(geometry)
    tensions = tensions_at(whole, stretches(whole, u))
    report = {"converged": True, "reason": "CONVERGED_FNORM_ABS"}
    every = loose(latinpc.Result(whole, u, tensions, whole.load, report))
    mine = part({"u": u, "tensions": tensions, "none": slack(whole, tensions)})
    mine = loose(LocalResult(own, mine["u"], mine["tensions"], mine["none"], own.load, report).part())
    assert mine == every and "leave nodes" in mine[0], (mine, every)

# a strut whose cable is slack, as in test_unstable.py
strut = {
    "nodes": [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0]], "links": [[0, 1], [1, 2]], "law": ["bar", "cable"],
    "stiffness": [1e4, 1e4], "prestress": [-100.0, 10.0], "fixed": [[1, 1], [0, 0], [1, 1]],
    "load": [[0.0, 0.0], [-100.0, 10.0], [0.0, 0.0]],
}
s = latinpc.LocalStructure(**part(strut), geometry="prestress")
for down in (0.0, 0.1):
    u = s.create_vec()
    u.setArray(np.array([0.0, -down])[: u.getLocalSize()])
    said = unstable(s, u, (s.law == 1) & (down > 0.0))
    assert bool(said) == (down > 0.0), said
"""


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_parts_say_what_the_whole_says(mpirun, ranks):
    """Maxima, sums, numbers of nodes and links, and nodes held by links of several ranks."""
    mpirun(ranks, SAID)
