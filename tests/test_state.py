"""States of solvers: what goes on from one is equal to the bit to what was never interrupted."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from support import HDF5, STATES, grid, irregular, lattice

import latinpc
from latinpc.bench.extremes.rigid import stiffened
from latinpc.options import default_options
from latinpc.scenes import make

WARM = {"snes_latin_warm_start": "extrapolate"}
RAMPS = {
    "grid": (grid, {}),
    "error": (irregular, {"snes_latin_stop": "error"}),
    "floppy": (irregular, {"snes_latin_modes_local": 1, "snes_latin_direction": "diagonal"}),
    "plain": (grid, {"snes_latin_outer_snes_type": "nrichardson", "snes_latin_variant": "macro"}),
    "newton": (grid, {"snes_type": "newtonls", "pc_type": "cholesky"}),
    "one subdomain": (lambda: grid(subdomains=1), {}),
    "rigid": (lambda: make("net", side=8), {"snes_stol": 1e-3}),
    "tuned": (
        lambda: stiffened(1e4, False),
        {"snes_latin_subdomains": 8},
    ),  # other search parameters
    "stalls": (
        lambda: make("packing", side=10, law="friction", seed=2),
        {"snes_stol": 1e-6},
    ),  # the same while the state goes on
    "prestress": (lambda: make("saddle", side=8), {"snes_latin_geometry": "prestress", "snes_latin_subdomains": 4}),
    "saddle": (lambda: make("saddle", side=12, load=1500.0), {"snes_latin_subdomains": 4}),
    "iteration": (lambda: make("saddle", side=8), {"snes_latin_newton": "never", "snes_latin_stop": "indicator"}),
    "mast": (lambda: make("mast", wind=200.0), {}),
    "tower": (lambda: make("tower", load=500.0), {"snes_latin_subdomains": 3}),
    "hanging": (lambda: make("net", side=6), {"snes_latin_geometry": "large"}),
}


def shaken():
    """Make a lattice that its loads set in motion."""
    scene = lattice()
    return replace(scene, mass=np.full(len(scene.nodes), 10.0), time_step=1e-3)


SUFFIX = ".h5" if HDF5 else ""


def both(quick):
    """Cases in both formats, those in HDF5 among the slow tests but for those named."""
    return lambda names: [
        pytest.param(name, file, marks=() if file == "state" or name in quick else pytest.mark.slow)
        for name in names
        for file in STATES
    ]


MOTIONS = {
    "grid": (lambda: make("impact-grid", modules=8), {}),
    "contacts": (lambda: make("bouncing-chain"), {}),
    "newton": (shaken, {"snes_type": "newtonls", "pc_type": "cholesky"}),
}


def ramp(scene, options, first, last, path=None, comm=PETSc.COMM_SELF, end=5):
    """Load increments first to last of five, from the state in a file and to it; what is found."""
    with default_options(WARM | options):
        structure = latinpc.Structure.from_scene(scene, comm=comm)
        snes, u, counts = structure.create_snes(), structure.create_vec(), []
        snes.setFromOptions()
        if first > 1:
            counts = json.loads(latinpc.load_state(snes, path, u))
        for k in range(first, last + 1):
            structure.set_load(scene.load * (k / end))
            snes.solve(None, u)
            counts.append(snes.getIterationNumber())
        if last < end:
            latinpc.save_state(snes, path, u, json.dumps(counts).encode())
        return structure.displacements(u), latinpc.tensions(snes), counts


def motion(scene, options, first, last, path, end=12):
    """Time steps first to last."""
    with default_options(options):
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        v = structure.create_vec()
        if scene.velocity is not None:
            structure.set_displacements(scene.velocity, v)
        ts = structure.create_ts(v=v)
        ts.setTimeStep(scene.time_step)
        ts.setFromOptions()
        if first > 1:
            assert latinpc.load_state(ts, path) == b""
        ts.setMaxSteps(last)
        u, v = ts.getSolution2()
        ts.solve(u)
        assert ts.getStepNumber() == last
        if last < end:
            latinpc.save_state(ts, path)
        return structure.displacements(u), structure.displacements(v), latinpc.step_tensions(ts), ts.getTime()


def same(a, b):
    """Equal to the bit, whatever it is."""
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


@pytest.mark.parametrize(("name", "file"), both(["grid"])(RAMPS))
def test_a_ramp_goes_on_to_the_bit(name, file, tmp_path):
    make_scene, options = RAMPS[name]
    path, scene = tmp_path / file, make_scene()
    whole = ramp(scene, options, 1, 5)
    for stop in (1, 3):
        ramp(scene, options, 1, stop, path)
        assert same(ramp(scene, options, stop + 1, 5, path), whole), stop
    assert os.listdir(tmp_path) == [file]


@pytest.mark.parametrize(("name", "file"), both([])(MOTIONS))
def test_a_motion_goes_on_to_the_bit(name, file, tmp_path):
    make_scene, options = MOTIONS[name]
    path, scene = tmp_path / file, make_scene()
    whole = motion(scene, options, 1, 12, path)
    for stop in (1, 7, 12):  # from the last one on no step is left, and tensions are those of a step
        motion(scene, options, 1, stop, path, end=13)
        assert same(motion(scene, options, stop + 1, 12, path), whole), stop


PARALLEL = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import latinpc
from test_state import RAMPS, ramp, same

world, path, suffixes = PETSc.COMM_WORLD, sys.argv[2], sys.argv[3:]
for name, suffix in zip(("saddle", "tower", "grid", "error", "floppy", "rigid"), suffixes, strict=True):
    path = sys.argv[2] + suffix
    scene, options = RAMPS[name][0](), RAMPS[name][1] | {"snes_latin_coarse_pc_type": "redundant"}
    whole = ramp(scene, options, 1, 5, comm=world)
    ramp(scene, options, 1, 2, path, world)
    assert same(ramp(scene, options, 3, 5, path, world), whole), name
for wrong in (lambda: ramp(RAMPS["grid"][0](), options, 3, 5, path, world),
              lambda: ramp(scene, options, 1, 1, path + "/nowhere", world)):
    try:
        wrong()
        raise SystemExit("no error")
    except PETSc.Error as error:
        print(f"{latinpc.error_message(error)}\\n", end="", flush=True)
"""


@pytest.mark.parametrize(
    ("ranks", "suffixes"),
    [
        (2, ["", "", "", "", "", SUFFIX]),
        pytest.param(2, [SUFFIX] * 6, marks=pytest.mark.slow),
        pytest.param(3, [""] * 6, marks=pytest.mark.slow),
        pytest.param(3, [SUFFIX] * 6, marks=pytest.mark.slow),
    ],
)
def test_ranks_go_on_to_the_bit_and_fail_together(ranks, suffixes, mpirun, tmp_path):
    path = tmp_path / "state"
    said = mpirun(ranks, PARALLEL, Path(__file__).parent, path, *suffixes).stdout.splitlines()
    assert sum("is of another structure" in line for line in said) == ranks
    assert sum("cannot be written" in line for line in said) == ranks
    with pytest.raises(PETSc.Error) as error:  # the last state was of some ranks
        ramp(RAMPS["rigid"][0](), {}, 3, 5, tmp_path / f"state{suffixes[-1]}")
    assert f"is of {ranks} ranks, and these are 1: run on {ranks}" in latinpc.error_message(error.value)


EMPTY = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
from support import chain
from test_state import ramp, same

scene, options = chain(links=3, parts=3), {"snes_latin_coarse_pc_type": "redundant"}
whole = ramp(scene, options, 1, 5, comm=PETSc.COMM_WORLD)
for path in sys.argv[2:]:
    ramp(scene, options, 1, 2, path, PETSc.COMM_WORLD)
    assert same(ramp(scene, options, 3, 5, path, PETSc.COMM_WORLD), whole), path
"""


@pytest.mark.slow
def test_ranks_without_links_go_on_to_the_bit(mpirun, tmp_path):
    mpirun(7, EMPTY, Path(__file__).parent, *(tmp_path / file for file in STATES))


@pytest.mark.parametrize("file", STATES)
def test_every_bit_is_kept(file, tmp_path):
    path, rng, scene = tmp_path / file, np.random.default_rng(0), lattice()
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options({"snes_type": "newtonls", "viewer_hdf5_sp_output": True}):  # not for states
        snes = structure.create_snes()
        snes.setFromOptions()
        u, v = structure.create_vec(), structure.create_vec()
        bits = np.frombuffer(rng.bytes(8 * u.getSize()))  # not-a-numbers, too
        u[:] = np.concatenate([[-0.0, 5e-324, -np.inf, np.nan], bits])[: u.getSize()]
        for note in (b"", b"\0", bytes(range(256)) * 300 + b"\0\0"):
            latinpc.save_state(snes, path, u, note)
            assert latinpc.load_state(snes, path, v) == note
            assert u.getArray().tobytes() == v.getArray().tobytes()
    if file == "state.h5":  # its name does not matter when it is read
        path.rename(tmp_path / "state")
        assert latinpc.load_state(snes, tmp_path / "state", u) == note


@pytest.mark.skipif(not HDF5, reason="without HDF5")
def test_hdf5_shows_nodes_and_links_to_every_petsc(tmp_path):
    path, scene = tmp_path / "motion.hdf5", make("impact-grid", modules=8)
    with default_options({}):
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        v = structure.create_vec()
        structure.set_displacements(scene.velocity, v)
        ts = structure.create_ts(v=v)
        ts.setTimeStep(scene.time_step)
        ts.setMaxSteps(2)
        ts.setFromOptions()
        u, v = ts.getSolution2()
        ts.solve(u)
        latinpc.save_state(ts, path, note=b"words")
    viewer = PETSc.Viewer().createHDF5(str(path), "r", comm=PETSc.COMM_SELF)

    def read(name, value):
        value.setName(name)
        value.load(viewer)
        return value.getIndices() if isinstance(value, PETSc.IS) else value.getArray()

    def vec():
        return PETSc.Vec().create(PETSc.COMM_SELF)

    shape = scene.nodes.shape
    assert np.array_equal(read("displacement", vec()), u.getArray())
    assert np.array_equal(read("/nodes/coordinates", vec()).reshape(shape), scene.nodes)
    assert np.array_equal(read("/nodes/displacement", vec()).reshape(shape), structure.displacements(u))
    velocity = np.where(scene.fixed, 0.0, structure.displacements(v))
    assert np.array_equal(read("/nodes/velocity", vec()).reshape(shape), velocity)
    assert np.array_equal(read("/links/tension", vec()), latinpc.step_tensions(ts))
    assert np.array_equal(read("/links/nodes", PETSc.IS().create(PETSc.COMM_SELF)).reshape(-1, 2), scene.links)
    viewer.destroy()


H5PY = """
import json, sys
import h5py

with h5py.File(sys.argv[1]) as file:
    what = dict(file.attrs)
    assert what["ranks"] == 1 and what["motion"] == 0 and what["solutions"] == 2, what
    assert len(json.loads(bytes(file["note"][:, 0].tolist()))) == 2  # iterations of two increments
    nodes, links = int(sys.argv[2]), int(sys.argv[3])
    assert file["links/nodes"].shape == (links, 2) and file["links/nodes"].dtype.kind == "i"
    assert file["nodes/displacement"].shape == file["nodes/coordinates"].shape == (nodes, 3)
    assert file["rigid_tension"].shape == (links,) and file["rigid_tension"].dtype == float
with h5py.File(sys.argv[1], "a") as file:
    file["displacement"][0] = 1.0
"""


@pytest.mark.slow
@pytest.mark.skipif(not HDF5, reason="without HDF5")
def test_h5py_reads_a_state_and_what_it_changes_is_refused(mpirun, tmp_path):
    pytest.importorskip("h5py")
    path, scene = tmp_path / "state.h5", make("net", side=8)
    ramp(scene, {}, 1, 2, path)
    mpirun(1, H5PY, path, len(scene.nodes), len(scene.links))
    assert "damaged or changed" in refused(ramp, scene, {}, 3, 5, path)


def refused(call, *arguments):
    """Return the message of the error that a call ends with."""
    with pytest.raises(PETSc.Error) as error:
        call(*arguments)
    return latinpc.error_message(error.value)


def test_wrong_files_are_refused_by_name(tmp_path):
    path, scene = tmp_path / "state", grid()
    ramp(scene, {}, 1, 2, path)
    good = path.read_bytes()

    def go_on(content, options=None, other=scene):
        path.write_bytes(content)
        return refused(ramp, other, options or {}, 3, 5, path)

    assert "is not whole" in go_on(good[:-1])
    assert "is not whole" in go_on(good[:100])
    assert "is not whole" in go_on(good + b" ")
    assert "is no state of latinpc" in go_on(b"")
    assert "is no state of latinpc" in go_on(os.urandom(5000))
    assert "is not whole, or has been damaged" in go_on(good[:5000] + bytes([good[5000] ^ 1]) + good[5001:])
    assert "format 99" in go_on(good.replace(b"latinpc_state 9", b"latinpc_state 99", 1))
    for kind, size in (b"integer", np.dtype(PETSc.IntType).itemsize), (b"real", np.dtype(PETSc.RealType).itemsize):
        other = good.replace(kind + b"_bytes %d" % size, kind + b"_bytes 9", 1)
        assert f"{kind.decode()}s of 9 bytes" in go_on(other)
    assert "has been damaged or changed" in go_on(good.replace(b"ranks 1", b"ranks 4", 1))
    assert "is of another structure" in go_on(good, other=grid("truss"))
    assert "is of another structure" in go_on(good, {"snes_latin_direction": "scalar"})
    assert "is of another structure" in go_on(good, {"snes_type": "newtonls"})
    moving = make("impact-grid", modules=8)
    motion(moving, {}, 1, 2, path)
    assert "is that of a motion" in refused(ramp, scene, {}, 3, 5, path)
    path.write_bytes(good)
    assert "is that of a solve" in refused(motion, moving, {}, 3, 4, path)
    path.unlink()
    assert "No such file" in refused(ramp, scene, {}, 3, 5, path)


@pytest.mark.skipif(HDF5, reason="with HDF5")
def test_without_hdf5_another_name_is_asked_for(tmp_path):
    assert "give a name that does not end in .h5 or .hdf5" in refused(ramp, grid(), {}, 1, 2, tmp_path / "state.h5")
    assert "without HDF5" in refused(ramp, grid(), {}, 1, 2, tmp_path / "state.hdf5")


@pytest.mark.slow
@pytest.mark.skipif(not HDF5, reason="without HDF5")
def test_damaged_hdf5_is_refused_before_hdf5_sees_it(tmp_path):
    path, scene = tmp_path / "state.h5", make("net", side=3)
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    latinpc.save_state(snes, path, u, b"some words")
    good = path.read_bytes()
    assert good[:13] == b"latinpc_state" and good[512:520] == b"\x89HDF\r\n\x1a\n"
    assert good.endswith(b"some words")

    def load(content):
        path.write_bytes(content)
        return refused(latinpc.load_state, snes, path, u)

    for k in (*range(512, 520), *range(520, len(good), 61)):
        assert "has been damaged" in load(good[:k] + bytes([good[k] ^ (1 << k % 8)]) + good[k + 1 :]), k
    for k in range(20, len(good), 997):
        assert "is not whole" in load(good[:k]), k
    assert "is not whole" in load(good + b" ")
    assert "has been damaged" in load(good.replace(b"\nstarted 0\n", b"\nstarted 1\n"))
    path.write_bytes(good)
    assert latinpc.load_state(snes, path, u) == b"some words"


@pytest.mark.parametrize("options", [{}, {"snes_latin_warm_start": "last"}])
def test_another_prestress_takes_effect_after_a_state(options, tmp_path):
    """Loads, initial elongations and so prestress are those of the structure that reads the state."""

    def solved(share, write=None, read=None):
        scene = make("saddle", side=8)
        scene = replace(scene, initial_elongation=share * scene.initial_elongation)
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        with default_options({"snes_latin_geometry": "prestress", "snes_latin_subdomains": 4, **options}):
            snes, u = structure.create_snes(), structure.create_vec()
            snes.setFromOptions()
            if read:
                latinpc.load_state(snes, read, u)
            snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        if write:
            latinpc.save_state(snes, write, u)
        return structure.displacements(u)

    solved(1.0, write=tmp_path / "state")
    fresh = solved(1.3)
    assert solved(1.3, read=tmp_path / "state") == pytest.approx(fresh, abs=1e-3 * np.abs(fresh).max())


@pytest.mark.parametrize("warm", ["none", "last", "extrapolate"])
@pytest.mark.parametrize("name", ["grid", "prestress", "hanging"])
def test_other_initial_elongations_after_a_state_are_those_without_one(name, warm, tmp_path):
    """Where links turn, operators and multipliers are made anew."""
    make_scene, options = RAMPS[name]
    scene = make_scene()
    longer = (0.0, 2e-4, 1e-4)

    def solved(first):
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        with default_options({**options, "snes_latin_warm_start": warm}):
            snes, u, found = structure.create_snes(), structure.create_vec(), []
            snes.setFromOptions()
            for k in range(first, len(longer)):
                structure.set_initial_elongation(scene.initial_elongation - longer[k])
                if first == k > 0:
                    latinpc.load_state(snes, tmp_path / f"state{k}", u)
                snes.solve(None, u)
                assert snes.getConvergedReason() > 0
                found += [structure.displacements(u), latinpc.tensions(snes), snes.getIterationNumber()]
                if not first:
                    latinpc.save_state(snes, tmp_path / f"state{k + 1}", u)
        return found

    whole = solved(0)
    assert same(solved(1), whole[3:]) and same(solved(2), whole[6:])


def test_misuse_is_refused(tmp_path):
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    snes = structure.create_snes()
    assert "There is no state yet" in refused(latinpc.save_state, snes, tmp_path / "s", structure.create_vec())
    assert "give the vector" in refused(latinpc.save_state, snes, tmp_path / "s")
    assert "not that of a KSP" in refused(latinpc.save_state, snes.getKSP(), tmp_path / "s")
    moving = make("impact-grid", modules=8)
    ts = latinpc.Structure.from_scene(moving, comm=PETSc.COMM_SELF).create_ts()
    ts.setType("alpha2")
    assert "use -ts_type latin" in refused(latinpc.save_state, ts, tmp_path / "s")


FULL = """
import os, resource, sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from support import grid
from test_state import ramp, refused, same

path, scene = Path(sys.argv[2]), grid()
whole = ramp(scene, {}, 1, 5)
ramp(scene, {}, 1, 2, path)
good = path.read_bytes()
for room in (0, 100, 600, len(good) // 2, len(good) - 600, len(good) - 1):
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
    said = refused(ramp, scene, {}, 1, 3, path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert "cannot be written, an older one is unchanged" in said, said
    assert path.read_bytes() == good
    assert os.listdir(path.parent) == [path.name]
assert same(ramp(scene, {}, 3, 5, path), whole)
ramp(scene, {}, 1, 4, path)
assert same(ramp(scene, {}, 5, 5, path), whole)
"""


@pytest.mark.slow
@pytest.mark.parametrize("file", STATES)
def test_a_full_disk_loses_nothing(file, mpirun, tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    assert mpirun(1, FULL, Path(__file__).parent, folder / file).stderr == ""
