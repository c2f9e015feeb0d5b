"""The number of ranks does not matter: same partition, same counts, same displacements, also with ranks to spare."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import MALLOC_DUMP as CHECKS
from mpi4py import MPI
from petsc4py import PETSc
from support import PLAIN, VARIANTS, chain, grid, irregular, latin, lattice, network, settled

import latinpc
from latinpc.options import default_options
from latinpc.scenes import Law

SCENES = {
    "grid": grid,
    "irregular": irregular,
    "metis": lambda: replace(settled(network(), size=3e-5), subdomain=None),
    "lattice": lattice,
    "chain": lambda: chain(links=9, parts=3, law=Law.CABLE, load=6.0),
    "three links": lambda: chain(links=3, parts=2),
    "four blocks": lambda: lattice(4, 4, subdomains=4),
}
SUBDOMAINS = {"metis": 5}
ITERATIONS = {"stol": 1e-7, "max_it": 2000}


def latin_case(scene, comm, **options):
    """What SNES latin finds, counted and measured."""
    structure = latinpc.Structure.from_scene(scene, comm=comm)
    with latin(scene, structure, **options) as run:
        u = structure.create_vec()
        run.snes.solve(None, u)
        return {
            "iterations": run.snes.getIterationNumber(),
            "reason": int(run.snes.getConvergedReason()),
            "statistics": latinpc.statistics(run.snes),
            "indicator": latinpc.history(run.snes)["indicator"].tolist(),
            "residual": run.snes.getFunctionNorm(),
            "partition": latinpc.subdomain_of_links(run.snes).tolist(),
            "classes": latinpc.node_classes(run.snes).tolist(),
            "u": structure.displacements(u).tolist(),
            "tensions": latinpc.tensions(run.snes).tolist(),
        }


KRYLOV = {
    "krylov": {"ksp_type": "cg", "pc_type": "latin"},
    "krylov on interfaces": {"ksp_type": "latin"},
    "levels": {"ksp_type": "cg", "pc_type": "latin", "pc_latin_coarse_pc_type": "latin"},
}


def krylov_case(scene, comm, what="krylov"):
    """What one Newton step with conjugate gradients and PC latin finds, or with KSP latin."""
    structure = latinpc.Structure.from_scene(scene, comm=comm)
    with default_options({"snes_type": "ksponly", "ksp_rtol": 1e-6, **KRYLOV[what]}):
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        snes.solve(None, u)
    if what == "levels":  # the subdomains of the level above are the ranks
        return {"reason": int(snes.getConvergedReason())}
    return {
        "iterations": snes.getLinearSolveIterations(),
        "reason": int(snes.getConvergedReason()),
        "u": structure.displacements(u).tolist(),
    }


def measure(comm, names=SCENES):
    """All cases on a communicator, by name."""
    found = {}
    for name in names:
        scene = SCENES[name]()
        options = {"subdomains": SUBDOMAINS[name]} if name in SUBDOMAINS else {}
        for variant in VARIANTS if name in ("grid", "metis") else ("corner",):
            found[f"{name}, {variant}"] = latin_case(scene, comm, variant=variant, **options, **ITERATIONS)
        if name in ("grid", "irregular"):
            found[f"{name}, plain"] = latin_case(scene, comm, variant="published", max_it=6, stol=0, **PLAIN)
        if name in ("irregular", "lattice"):
            for direction in ("block", "schur"):
                found[f"{name}, {direction}"] = latin_case(scene, comm, direction=direction, **ITERATIONS)
        if name in ("grid", "lattice", "three links"):  # elsewhere conjugate gradients feel the rounding
            found[f"{name}, krylov"] = krylov_case(scene, comm)
        if name == "four blocks":
            found |= {f"{name}, {what}": krylov_case(scene, comm, what) for what in KRYLOV}
            found[f"{name}, newton"] = latin_case(scene, comm, stop="error", error=1e-8)
            del found[f"{name}, newton"]["iterations"]  # conjugate gradients feel the rounding
    return found


PROGRAM = """
import json
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import test_parallel

found = test_parallel.measure(PETSc.COMM_WORLD, sys.argv[2].split(","))
texts = PETSc.COMM_WORLD.tompi4py().gather(json.dumps(found))
if PETSc.COMM_WORLD.rank == 0:
    assert all(text == texts[0] for text in texts), "the ranks tell different things"
    print(texts[0])
"""


@pytest.fixture(scope="module")
def alone():
    """What one rank finds."""
    return measure(PETSc.COMM_SELF)


@pytest.mark.parametrize("ranks", [2, 4, 7])
def test_ranks_do_not_matter(mpirun, alone, ranks):
    """Two and four ranks, and more ranks than subdomains or links: counts equal, displacements to 1e-10."""
    names = SCENES if ranks <= 4 else ("lattice", "chain", "three links", "four blocks")
    found = json.loads(mpirun(ranks, PROGRAM, Path(__file__).parent, ",".join(names)).stdout)
    assert found.keys() == {case for case in alone if case.split(", ")[0] in names}
    for name, mine in found.items():
        theirs = alone[name]
        assert mine.keys() == theirs.keys()
        for key in ("iterations", "reason", "partition", "classes"):
            assert mine.get(key) == theirs.get(key), (name, key)
        if "statistics" in mine:
            assert mine["statistics"] == pytest.approx(theirs["statistics"], rel=1e-12), name
            # a cable that hangs loose inside its subdomain is neither taut nor slack at first: rounding decides
            assert mine["indicator"] == pytest.approx(theirs["indicator"], rel=0.02), name
        for key in ("u", "tensions"):
            if key in mine:
                a, b = np.array(mine[key]), np.array(theirs[key])
                rounding = 1e-8 if "krylov" in name or "newton" in name else 1e-10
                assert abs(a - b).max() < rounding * abs(b).max(), (name, key)


def test_all_cases_converge(alone):
    """What is compared is a solution: every case ends well, but for plain ones that stop at six iterations."""
    for name, case in alone.items():
        assert case["reason"] > 0 or (name.endswith("plain") and case["iterations"] == 6), name


FAILS = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import latinpc
import support

structure = latinpc.Structure.from_scene(support.grid(), comm=PETSc.COMM_WORLD)
weak = {"coarse_ksp_type": "cg", "coarse_pc_type": "jacobi", "coarse_ksp_max_it": 3, "coarse_ksp_rtol": 1e-12}
reasons = []
for options in (weak, {"max_it": 3, "stol": 0}):
    with support.latin(None, structure, **options) as run:
        run.snes.solve(None, structure.create_vec())
        reasons.append(int(run.snes.getConvergedReason()))
reasons = PETSc.COMM_WORLD.tompi4py().gather(reasons)
if reasons:
    print(reasons)
"""


def test_ranks_agree_on_failure(mpirun):
    """A coarse solver that gives up and too few iterations have the same reason on every rank, and no rank waits."""
    out = mpirun(3, FAILS, Path(__file__).parent).stdout
    assert json.loads(out) == [[-3, -5]] * 3


RIGID = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import latinpc
import support
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("net", side=4), comm=PETSc.COMM_WORLD)
with support.latin(None, structure, stop="residual", rtol=1e-4) as run:
    run.snes.solve(None, structure.create_vec())
    reasons = PETSc.COMM_WORLD.tompi4py().gather(int(run.snes.getConvergedReason()))
if reasons:
    print(reasons)
"""


def test_ranks_without_rigid_links_agree(mpirun):
    """The first rank has all links of a small net. The stop on the residual asks for their gaps on every rank."""
    assert json.loads(mpirun(3, RIGID, Path(__file__).parent).stdout) == [3] * 3


def test_communicator_of_the_structure():
    """A structure on one rank is that rank's alone, whatever else runs."""
    structure = latinpc.Structure.from_scene(lattice(), comm=MPI.COMM_SELF)
    with latin(None, structure) as run:
        run.snes.setUp()
        assert run.snes.getComm().getSize() == 1
        assert latinpc.coarse_ksp(run.snes).getComm().getSize() == 1


DIFFERENT = """
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=3), comm=PETSc.COMM_WORLD)
rank = PETSc.COMM_WORLD.rank
settings = {
    "subdomains": lambda snes: latinpc.set_subdomains(snes, (2, 3)[rank]),
    "partitioner": lambda snes: latinpc.set_partitioner(snes, ("metis", "parallel")[rank]),
    "variant": lambda snes: latinpc.set_variant(snes, ("primal", "corner")[rank]),
    "modes": lambda snes: latinpc.set_modes(snes, ("affine", "rigid")[rank]),
    "modes_local": lambda snes: latinpc.set_modes(snes, "affine", (0.0, 0.1)[rank]),
    "direction": lambda snes: latinpc.set_direction(snes, ("schur", "block")[rank]),
    "direction_value": lambda snes: latinpc.set_direction(snes, "schur", (0.5, 2.0)[rank]),
    "precision": lambda snes: latinpc.set_precision(snes, ("single", "double")[rank]),
    "stop": lambda snes: latinpc.set_stop(snes, ("error", "indicator")[rank]),
    "error": lambda snes: latinpc.set_error(snes, (1e-2, 1e-9)[rank]),
    "newton": lambda snes: latinpc.set_newton(snes, ("auto", "never")[rank]),
    "max_it": lambda snes: snes.setTolerances(max_it=(1, 100)[rank]),
    "stol": lambda snes: snes.setTolerances(stol=(1e-1, 1e-9)[rank]),
}
for name, differ in settings.items():
    snes = structure.create_snes()
    snes.setSolution(structure.create_vec())
    try:
        differ(snes)
        snes.solve(None, snes.getSolution())
    except PETSc.Error as error:
        said = latinpc.error_message(error)
        option = f"-snes_{name}" if name in ("max_it", "stol") else f"-snes_latin_{name}"
        assert f"Ranks differ in {option}, " in said or "must be same on all processes" in said, said
        print("refused")
    snes.destroy()
"""


def test_settings_that_differ_between_ranks_are_refused(mpirun):
    """Ranks had waited for each other without end."""
    assert mpirun(2, DIFFERENT, leaks=False).stdout.count("refused") == 26


OTHER_ARRAYS = """
import sys
import numpy as np
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

rank = PETSc.COMM_WORLD.rank
same = make("lattice", nx=8, ny=4)
other = {name: make("lattice", nx=8, ny=4) for name in ("nodes", "load", "fixed")}
other["nodes"].nodes += 1e-3 * np.random.default_rng(rank).random(same.nodes.shape)
other["load"].load *= 1 + rank
other["fixed"].fixed |= rank > 0
other["links"] = make("lattice", nx=8 + rank, ny=4)
for name, scene in other.items():
    try:
        latinpc.Structure.from_scene(scene)
    except ValueError as error:
        assert f"ranks differ in {'nodes' if name == 'links' else name}: 'shape (" in str(error), error
        print("refused")
structure = latinpc.Structure.from_scene(same)
changes = {
    "load": lambda: structure.set_load((1 + rank) * same.load),
    "prescribed": lambda: structure.set_prescribed(np.where(same.fixed, 1e-3 * rank, 0.0)),
    "initial_elongation": lambda: structure.set_initial_elongation(1e-4 * rank),
    "prestress": lambda: structure.set_prestress(np.where(same.law == 1, 1.0 + rank, 0.0)),
    "mass": lambda: structure.set_mass(1.0 + rank),
    "geometry": lambda: structure.set_geometry(("linear", "large")[rank]),
    "displacement": lambda: structure.set_displacements(rank * same.load, structure.create_vec()),
    "subdomain": lambda: latinpc.set_partition(structure.create_snes(), np.arange(len(same.links)) % (2 + rank)),
}
scene = make("mast", levels=1)
given = {name: getattr(scene, name) for name in ("nodes", "links", "law", "stiffness", "fixed")}
changes["geometry "] = lambda: latinpc.Structure(**given, geometry=("large", "linear")[rank])
changes["prestress "] = lambda: latinpc.Structure(**given, prestress=(None, 0.0)[rank])
for name, change in changes.items():
    try:
        change()
    except ValueError as error:
        assert f"ranks differ in {name.strip()}: " in str(error), error
        print("refused")
lost = np.where(rank, np.nan, 1.0)  # one rank alone has what no structure may have
wrong = {
    "finite": lambda: structure.set_load(np.full(same.load.shape, lost)),
    "mass": lambda: structure.set_mass(-float(rank)),
    "shape": lambda: structure.set_initial_elongation(np.zeros(3)) if rank else structure.set_initial_elongation(0.0),
    "no length": lambda: latinpc.Structure.from_scene(make("lattice", nx=8, ny=4)) if not rank else collapsed(),
}


def collapsed():
    other = make("lattice", nx=8, ny=4)
    other.nodes[:] = 0.0
    return latinpc.Structure.from_scene(other)


for name, change in wrong.items():
    try:
        change()
    except ValueError as error:
        assert name in str(error) and "rank 1: " in str(error), error
        print("refused")
try:
    structure.set_load(np.full(same.load.shape, np.nan))
except ValueError as error:
    assert "rank" not in str(error), error  # as on one rank
    print("refused")
assert structure.solve().converged
"""


def test_arrays_that_differ_between_ranks_are_refused(mpirun):
    """Such as random numbers without a seed: each rank had taken its part of what it had."""
    assert mpirun(2, OTHER_ARRAYS).stdout.count("refused") == 38


OTHER_CALLS = """
import sys
import numpy as np
from petsc4py import PETSc
import latinpc
from latinpc.results.eigen import slepc
from latinpc.runs.history import History
from latinpc.runs.motion import move
from latinpc.runs.solve import solve
from latinpc.scenes import make

rank, two = PETSc.COMM_WORLD.rank, make("lattice", nx=4, ny=2)
tower, bridge = make("impact-tower", levels=2), latinpc.read(sys.argv[1])
structure = latinpc.Structure.from_scene(two)
net = dict(nodes=[[0, 0], [1, 0], [2, 0]], links=[[0, 1], [1, 2]], fixed=[[1, 1], [0, 0], [1, 1]], load=[[0, -1]] * 3)
calls = {
    "increments": lambda: solve(two, increments=1 + rank),
    "reference": lambda: solve(two, reference=rank == 1),
    "steps": lambda: move(tower, 2 - 2 * rank),
    "every": lambda: move(tower, 2, every=1 + rank),
    "from_equilibrium": lambda: move(tower, 2, from_equilibrium=rank == 1),
    "history": lambda: move(tower, 2, history=History([0.0], [1.0 + rank])),
    "cases": lambda: latinpc.solve_cases(bridge, bridge.cases[: 1 + rank]),
    "options": lambda: latinpc.solve_cases(bridge, options={"snes_latin_error": 1e-3 * (1 + rank)}),
    "load of case": lambda: latinpc.solve_cases(bridge, [latinpc.Case("a", load=(1 + rank) * bridge.load)]),
    "density": lambda: latinpc.form_find(**net, density=1.0 + rank),
    "error": lambda: latinpc.form_find(**net, natural_length=1.0, EA=1.0, error=1e-6 * (1 + rank)),
}
try:
    slepc()
    calls["number"] = lambda: latinpc.modes(structure, 2 + rank)
    calls["buckling"] = lambda: latinpc.modes(structure, 2, buckling=rank == 1)
except ImportError:
    print("refused " * 4)
for name, call in calls.items():
    try:
        call()
    except ValueError as error:
        assert f"ranks differ in {name}" in str(error), error
        print("refused")
try:
    latinpc.solve_cases(bridge, None if rank else [])
except ValueError as error:
    assert "rank 0: " in str(error) and "has no load case" in str(error), error
    print("refused")
assert structure.solve().converged
"""


def test_calls_that_differ_between_ranks_are_refused(mpirun):
    """Modes, load cases, forms and motions: ranks had waited for each other without end, or mixed what they had."""
    bridge = Path(__file__).parent.parent / "examples" / "footbridge.msh"
    assert mpirun(2, OTHER_CALLS, bridge).stdout.count("refused") == 28


LARGEST = """
import sys
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

said = []
for name, how in {"tensegrity-grid": {"modules": 4}, "truss-grid": {"modules": 5, "partition": "metis"}}.items():
    text = str(make(name, **how).solve(options={"snes_latin_variant": "primal"}))
    named = ("displacement", "worst member", "reactions")
    said.append([line for line in text.splitlines() if line.strip().startswith(named)])
cases = latinpc.solve_cases(latinpc.read(sys.argv[1]))
low, high = (cases.tensions[case, range(len(case))] for case in cases.envelope()[2:])
for found, extreme in ((low, cases.tensions.min(axis=0)), (high, cases.tensions.max(axis=0))):
    assert abs(found - extreme).max() <= 1e-4 * abs(extreme).max()
said.append([values.tolist() for values in (*cases.envelope()[2:], *cases.reaction_envelope()[2:])])
everyone = PETSc.COMM_WORLD.tompi4py().gather(said)  # lines of ranks may mix
if everyone:
    assert all(one == said for one in everyone), everyone
    print(said)
"""


def test_the_largest_of_alike_values_does_not_depend_on_ranks(mpirun):
    """A symmetric structure has several largest displacements, forces and reactions; cases may give the same force."""
    bridge = Path(__file__).parent.parent / "examples" / "footbridge.msh"
    said = [mpirun(ranks, LARGEST, bridge).stdout for ranks in (1, 2, 4, 5)]
    assert all(text == said[0] for text in said), said


NOT_A_NUMBER = """
import numpy as np
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure, comm = latinpc.Structure.from_scene(make("lattice", nx=6, ny=3)), PETSc.COMM_WORLD
snes, u = structure.create_snes(), structure.create_vec()
u.setArray(np.full(u.getLocalSize(), np.nan if comm.rank == comm.size - 1 else 1e-3))
snes.solve(None, u)
reasons = comm.tompi4py().gather(snes.getConvergedReason())  # lines of ranks may mix
if reasons:
    print(*reasons)
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_a_guess_that_is_not_a_number_on_one_rank_is_none_on_all(mpirun, ranks):
    """The largest of values and of what is no number is either of them, as MPI pleases."""
    checked = CHECKS and ranks == 1  # by PETSc, when one subdomain computes the function of the guess
    ended = mpirun(ranks, NOT_A_NUMBER, check=not checked)
    if checked:
        assert "not-a-number" in ended.stderr
    else:
        assert ended.stdout.split() == ranks * ["-4"]  # DIVERGED_FUNCTION_NANORINF; its name in Python changes


CULPRITS = """
import numpy as np
from petsc4py import PETSc
import latinpc

nodes = np.arange(9.0)[:, None]
links = np.vstack([np.column_stack([np.arange(8), np.arange(1, 9)]), [[0, 1], [1, 2], [0, 3]]])
fixed = np.isin(nodes, [0.0, 2.0, 3.0, 8.0])
law = np.array([*8 * ["bar"], "contact", "contact", "bar"], object)
given = dict(nodes=nodes, links=links, stiffness=1.0, fixed=fixed, load=np.where(fixed, 0.0, 1.0))
given["subdomain"] = (10 - np.arange(11)) // 3  # the last links are on the first rank
jammed = latinpc.Structure(**given, law=law, initial_elongation=np.where(law == "contact", -0.1, 0.0)).solve()
said = [" ".join(jammed.notices)]
law[[2, 10]] = "inextensible"
apart = {"prescribed": np.where(nodes == 3.0, 0.1, 0.0), "initial_elongation": np.where(np.arange(11) == 10, 0.05, 0.0)}
try:
    latinpc.Structure(**given, **apart, law=law).solve()
except latinpc.SolveError as error:
    said.append(str(error))
for one in PETSc.COMM_WORLD.tompi4py().gather(said) or []:  # lines of ranks may mix
    print(*one, sep="\\n")
"""


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_links_that_are_named_are_those_of_the_caller(mpirun, ranks):
    """With a partition of the caller's the library had counted them rank by rank; of several the worst is named."""
    said = mpirun(ranks, CULPRITS).stdout.splitlines()
    assert len(said) == 2 * ranks
    assert set(said[::2]) == {"no equilibrium: the gaps of the rigid links 8, 9 are incompatible"}
    assert all(text.startswith("Link 10 (inextensible) has prescribed displacements") for text in said[1::2])
