"""The small scenes of constants.py, and what is counted on each of them.

python benchmarks/constant_scenes.py FOLDER NAME...     a line of JSON for each scene: its name and the count

FOLDER keeps the reference solutions. A count is a text: linear stages or iterations, with "!" where the result is
wrong, and "–" where there is none.
"""

import json
import os
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import coarse_spaces
import slack
from petsc4py import PETSc

import latinpc
from latinpc.bench.extremes import catalogue, motions, rigid
from latinpc.bench.peers.reference import by_newton
from latinpc.options import default_options
from latinpc.runs.motion import move
from latinpc.runs.solve import solve
from latinpc.scenes import Law, make

NONE = "–"
ROOT = Path(__file__).resolve().parents[1]
RANKS = ["mpirun", "--oversubscribe", "-n"]
ENVIRONMENT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1",
               "OMPI_MCA_hwloc_base_binding_policy": "none", **os.environ}  # fmt: skip


# ---- structures ----------------------------------------------------------------------------------
def cut(scene, parts):
    """Return a scene that METIS cuts, and the option that says into how many subdomains."""
    return replace(scene, subdomain=None), {"snes_latin_subdomains": parts}


def contrast(factor, across=False):
    """Return a network of which some links are `factor` times as stiff, the self-stress kept (tests/test_newton.py)."""
    scene = make("network", nodes=100)
    middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
    chosen = np.random.default_rng(3).random(len(scene.links)) < 0.3
    chosen = middle > np.median(scene.nodes[:, 0]) if across else chosen
    stiffness = np.where(chosen, factor * scene.stiffness, scene.stiffness)
    e0 = scene.initial_elongation * scene.stiffness / stiffness
    return cut(replace(scene, stiffness=stiffness, initial_elongation=e0), 8)


def loaded(name, factor, **size):
    """Return a scene under so many times its load: its cables slacken."""
    scene = make(name, **size)
    return replace(scene, load=factor * scene.load), {}


def relieved(factor):
    """Return the girder of slack.py under an uplift; from the factor 1 on it has no equilibrium."""
    scene, uplift = slack.girder()
    return replace(scene, load=scene.load + factor * uplift), {}


def bars(name, **size):
    """Return a linear structure."""
    scene = make(name, **size)
    return replace(scene, law=np.full(len(scene.links), Law.BAR))


GRID = partial(make, "tensegrity-grid", modules=24)
STRUCTURES = {
    "grid": lambda: (GRID(), {}),
    "grid cut": lambda: cut(GRID(), 36),
    "truss": lambda: (make("truss-grid", modules=24), {}),
    "truss cut": lambda: cut(make("truss-grid", modules=24), 36),
    "network": lambda: cut(make("network", nodes=1000), 12),
    "network 2000": lambda: cut(make("network", nodes=2000), 12),
    "lattice": lambda: (make("lattice", nx=64, ny=32), {}),
    "lattice cut": lambda: cut(make("lattice", nx=64, ny=32), 40),
    "lattice x 5": lambda: loaded("lattice", 5.0),
    "lattice x 100": lambda: loaded("lattice", 100.0),
    "lattice x 1e4": lambda: loaded("lattice", 1e4),
    "grid x 100": lambda: loaded("tensegrity-grid", 100.0, modules=24),
    "girder 0.9": lambda: relieved(0.9),
    "girder 0.99": lambda: relieved(0.99),
    "girder 0.999": lambda: relieved(0.999),
    **{f"contrast {f:g}": partial(contrast, f) for f in (1e-8, 1e-4, 1e4, 1e5, 1e6, 1e7, 1e8)},
    **{f"halves {f:g}": partial(contrast, f, True) for f in (1e-8, 1e8)},
}


def reference(name, scene, folder):
    """Return the solution by Newton's method to rounding, made once with the constants as they are."""
    file = Path(folder) / f"{name}.npy"
    if not file.exists():
        try:
            u = by_newton(scene, 1e-10)[0]
        except (RuntimeError, PETSc.Error):
            u = np.zeros(0)
        np.save(file, u)
    u = np.load(file)
    return u if u.size else None


def relative(u, exact):
    """Return the relative l2 error."""
    return float(np.linalg.norm(u - exact) / np.linalg.norm(exact))


# ---- counts --------------------------------------------------------------------------------------
def stages(name, folder, accuracy=1e-4, **options):
    """Linear stages of SNES latin to a true l2 error, without Newton's method."""
    scene, more = STRUCTURES[name]()
    exact = reference(name, scene, folder)
    structure = latinpc.Structure.from_scene(scene)
    bare = {"snes_latin_newton": "never", "snes_max_it": 300, "snes_latin_stop": "reference", "snes_stol": accuracy}
    with default_options({**bare, **more, **options}):
        snes, u, v = structure.create_snes(), structure.create_vec(), structure.create_vec()
        structure.set_displacements(exact, v)
        latinpc.set_reference(snes, v)
        snes.setFromOptions()
        snes.solve(None, u)
    return str(snes.getIterationNumber()) if snes.reason > 0 else NONE


def modes(name, folder, accuracy=1e-4, **options):
    """Linear stages as above, and the unknowns of the coarse problem."""
    scene, more = STRUCTURES[name]()
    count = stages(name, folder, accuracy, **options)
    structure = latinpc.Structure.from_scene(scene)
    with default_options({**more, **options}):
        snes = structure.create_snes()
        snes.setFromOptions()
        snes.setUp()
    return f"{count} ({latinpc.statistics(snes)['coarse_size']})"


def proved(name, folder, accuracy, **options):
    """Linear stages and iterations of Newton's method of -snes_latin_stop error; "!": the true error is larger."""
    scene, more = STRUCTURES[name]()
    exact = reference(name, scene, folder)
    stop = {"snes_latin_stop": "error", "snes_latin_error": accuracy, "snes_max_it": 2000}
    result = solve(scene, {**stop, **more, **options})
    report = result.report
    if not report["converged"]:
        return NONE
    text = f"{report['iterations'] - report['linear_iterations']}+{report['linear_iterations']}"
    return text + ("!" if exact is not None and relative(result.displacements, exact) > accuracy else "")


def caution(name, folder):
    """The largest ratio of the estimated error to the true one, and the least, after the fifth linear stage."""
    scene, more = STRUCTURES[name]()
    structure = latinpc.Structure.from_scene(scene)
    options = {"snes_latin_stop": "error", "snes_latin_error": 1e-10, "snes_latin_newton": "never", "snes_max_it": 60}
    with default_options({**options, **more}):
        snes, u, v = structure.create_snes(), structure.create_vec(), structure.create_vec()
        structure.set_displacements(reference(name, scene, folder), v)
        latinpc.set_reference(snes, v)
        snes.setFromOptions()
        snes.solve(None, u)
    past = latinpc.history(snes)
    ratio = past["estimate"][5:] / past["error_l2"][5:]
    return f"{ratio.min():.2g}..{ratio.max():.2g}"


def granulate(make_scene, parts=4, **options):
    """Linear stages of SNES latin on rigid links."""
    scene = replace(make_scene(), subdomain=None)
    report = solve(scene, {"snes_latin_subdomains": parts, "snes_max_it": 3000, **options}).report
    return str(report["iterations"]) if report["converged"] else NONE


def granulates(make_scene, sides, seeds=5, **options):
    """Linear stages on packings of several seeds together; those that fail count the 3000 stages they may take."""
    counts = [
        granulate(partial(make_scene, side=side, seed=seed), **options) for side in sides for seed in range(seeds)
    ]
    failed = counts.count(NONE)
    return str(sum(3000 if count == NONE else int(count) for count in counts)) + (f" ({failed} fail)" if failed else "")


def verdict(make_scene, expected, parts=4, **options):
    """Linear stages and iterations of Newton's method until SNES latin ends; "!": not as expected."""
    scene = make_scene()
    stop = {"snes_latin_stop": "error", "snes_latin_error": 1e-6, "snes_max_it": 2000}
    stop |= {"snes_latin_subdomains": parts} if scene.subdomain is None else {}
    structure = latinpc.Structure.from_scene(scene)
    with default_options({**stop, **options}):
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        snes.solve(None, u)
    jammed, loose = latinpc.jammed_links(snes)[0], latinpc.unsupported_nodes(snes)[0]
    if expected == "jammed":
        right = snes.reason < 0 and jammed > 0
    elif expected == "loose":
        right = snes.reason < 0 and loose > 0
    elif expected == "no rest":
        right = snes.reason < 0
    else:
        right = snes.reason > 0 and not jammed and not loose
        if callable(expected) and right:
            right = relative(structure.displacements(u), expected(scene)) < 3e-6
    linear = snes.getLinearSolveIterations()
    return f"{snes.getIterationNumber() - linear}+{linear}" + ("" if right else "!")


def extremes(suite, folder):
    """Linear stages of the small cases of the robustness suite, those refused, and those that end in another way.

    The first run, with the constants as they are, keeps its solutions: another way is a verdict or a solution other
    than there.
    """
    stages, refused, other = 0, 0, 0
    for case in suite.cases():
        try:
            scene = case.make()
        except ValueError:
            continue
        if case.ranks > 1 or len(scene.links) > 3000 or "contrast 1e14" in case.name:
            continue
        limit = {"snes_max_it": 2000}
        try:
            if case.steps:
                result = move(scene, case.steps, None, {**case.options, **limit}, every=0)
                u, count = result.frames[-1].displacements, sum(result.report["iterations"])
            else:
                result = solve(scene, {**case.options, **limit})
                u, count = result.displacements, result.report["iterations"]
            u = u if result.converged else np.zeros(0)
        except PETSc.Error:
            u, count = np.zeros(0), 0
        file = Path(folder) / f"{suite.__name__} {case.group} {case.name}.npy".replace("/", " over ")
        if not file.exists():
            np.save(file, u)
        first = np.load(file)
        stages, refused = stages + count, refused + (not u.size)
        if u.size != first.size or (u.size and np.linalg.norm(u - first) > 3e-6 * np.linalg.norm(first)):
            other += 1
    return f"{stages} ({refused} refused" + (f", {other} other)" if other else ")")


def motion(name, steps, step=None, **size):
    """Linear stages of a whole motion, and the energy that is left of the largest kinetic one, in percent."""
    report = move(make(name, **size), steps, step).report
    kinetic, potential = np.array(report["kinetic_energy"]), np.array(report["potential_energy"])
    whole = kinetic + potential
    left = 100.0 * (1.0 - (whole[0] - whole[-1]) / kinetic.max())
    return f"{sum(report['iterations'])} ({left:.1f} %)" if report["converged"] else NONE


def preconditioned(name, kind):
    """Iterations of conjugate gradients with PC latin, or of KSP latin, to a true energy error of 1e-8."""
    system = coarse_spaces.System(coarse_spaces.scene_of(name, 36))
    count, size = system.count(kind, 36 if name.endswith("metis") else 0, "affine", "corner")
    return f"{count or NONE} ({size})"


def on_ranks(ranks, program):
    """Return the last line that a program prints; it must not see that MPI has started in this process."""
    done = subprocess.run([*RANKS, str(ranks), *program], env=ENVIRONMENT, capture_output=True, text=True, timeout=120)
    if done.returncode or not done.stdout:
        raise RuntimeError(done.stderr[-2000:])
    return done.stdout.splitlines()[-1]


def matis(*arguments, ranks=4):
    """Iterations on a MATIS of four ranks to a residual of 1e-8, and the unknowns of the coarse problem."""
    program = [sys.executable, str(ROOT / "tests" / "matis_program.py"), *map(str, arguments)]
    found = json.loads(on_ranks(ranks, program))
    coarse = f" ({found['coarse']})" if "coarse" in found else ""
    return f"{found['iterations']}{coarse}" if found["reason"] > 0 else NONE


def partition(name, folder):
    """Linear stages to a true error of 1e-4, unknowns of the coarse problem, largest subdomain over the mean."""
    scene, more = STRUCTURES[name]()
    structure = latinpc.Structure.from_scene(scene)
    with default_options(more):
        snes = structure.create_snes()
        snes.setFromOptions()
        snes.setUp()
    links = np.bincount(latinpc.subdomain_of_links(snes))
    size = latinpc.statistics(snes)
    return f"{stages(name, folder)} ({size['coarse_size']}; {links.max() / links.mean():.2f})"


def crumbs(links):
    """Linear stages, subdomains and unknowns of the coarse problem, with so few links a subdomain."""
    scene = replace(make("lattice", nx=16, ny=8), subdomain=None)
    parts = len(scene.links) // links
    report = solve(scene, {"snes_latin_subdomains": parts, "snes_max_it": 500}).report
    size = report["strong_macro_dofs"] + report["weak_dofs"]
    return f"{report['iterations'] if report['converged'] else NONE} ({report['subdomains']}; {size})"


def inexact(name, folder):
    """Linear stages to an indicator of 1e-9, and the true error, with conjugate gradients inside the subdomains."""
    scene, more = STRUCTURES[name]()
    exact = reference(name, scene, folder)
    local = {"snes_latin_local_ksp_type": "cg", "snes_latin_local_pc_type": "icc", "snes_latin_newton": "never"}
    result = solve(scene, {**more, **local, "snes_stol": 1e-9, "snes_max_it": 300})
    return f"{result.report['iterations']} ({relative(result.displacements, exact):.1e})"


def work(name):
    """Subdomains that two ranks make by themselves, and the entries that a solve moves, in millions."""
    return on_ranks(2, [sys.executable, __file__, "--work", name])


def work_of_ranks(name):
    """Print the above, on each rank: entries of the factors times linear stages to an indicator of 1e-5."""
    scene = replace(STRUCTURES[name]()[0], subdomain=None)
    structure = latinpc.Structure.from_scene(scene)
    coarse = {"snes_latin_coarse_pc_type": "cholesky", "snes_latin_coarse_pc_factor_mat_solver_type": "mumps"}
    coarse["snes_latin_variant"] = "corner"  # the default has one subdomain a rank
    with default_options(coarse):
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        snes.solve(None, u)
    comm = PETSc.COMM_WORLD.tompi4py()
    count, kept = latinpc.statistics(snes)["subdomains"], {}
    for i in range(count):
        try:
            ksp = latinpc.local_ksp(snes, i)
        except (PETSc.Error, IndexError, ValueError):
            break
        kept[ksp.handle] = ksp
    local = sum(k.getPC().getFactorMatrix().getInfo()["nz_used"] for k in kept.values())
    local = comm.allreduce(local)
    whole = local + latinpc.coarse_ksp(snes).getPC().getFactorMatrix().getInfo()["nz_used"]
    if comm.rank == 0:
        print(f"{count} ({whole * snes.getIterationNumber() / 1e6:.1f} M)", flush=True)


def rounding(name):
    """The error that rounding leaves, over the mean of many samples, as `latinpc.digits` says."""
    scene, more = STRUCTURES[name]()
    structure = latinpc.Structure.from_scene(scene)
    with default_options(more):
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        snes.solve(None, u)
    return f"{latinpc.digits(snes)['rounding']:.1e}"


def bound(scene, after):
    """The upper bound of the energy error after some linear stages, over the error."""
    structure = latinpc.Structure.from_scene(scene)
    options = {"snes_max_it": after, "snes_stol": 0.0, "snes_latin_newton": "never"}
    options |= {"snes_latin_subdomains": 8} if scene.subdomain is None else {}
    with default_options(options):
        snes, u, v = structure.create_snes(), structure.create_vec(), structure.create_vec()
        structure.set_displacements(by_newton(scene, 1e-10)[0], v)
        latinpc.set_reference(snes, v)
        snes.setFromOptions()
        snes.solve(None, u)
    return f"{latinpc.energy_bound(snes)[1] / latinpc.history(snes)['error_energy'][-1]:.4f}"


def flown(scene):
    """Return the solution of a row of nodes."""
    return rigid.row_solution(scene)


ELASTIC = ("--problem", "elasticity", "-pc_type", "latin")
SPECTRAL = {"snes_latin_modes_local": 0.05}
packing = partial(make, "packing")

#: Name of a scene: what is counted on it.
SCENES = {
    **{name: partial(stages, name) for name in ("grid", "grid cut", "truss", "truss cut", "network", "network 2000",
                                                "lattice", "lattice cut")},
    **{f"{name}, coarse": partial(modes, name) for name in ("grid cut", "truss cut", "network", "lattice cut")},
    **{f"{name}, low-energy modes": partial(modes, name, **SPECTRAL)
       for name in ("grid cut", "network", "lattice cut")},
    **{f"{name}, diagonal": partial(stages, name, snes_latin_direction="diagonal")
       for name in ("grid", "grid cut", "network", "lattice cut")},
    **{f"{name} to {accuracy:.0e}": partial(proved, name, accuracy=accuracy)
       for name in ("grid", "grid cut", "network", "lattice") for accuracy in (1e-4, 1e-8)},
    **{f"{name} to 1e-04": partial(proved, name, accuracy=1e-4)
       for name in STRUCTURES if any(c.isdigit() for c in name) and name != "network 2000"},
    "network to 1e-14": partial(proved, "network", accuracy=1e-14),
    "contrast 1e+06 to 1e-10": partial(proved, "contrast 1e+06", accuracy=1e-10),
    **{f"estimate over error, {name}": partial(caution, name) for name in ("grid", "grid cut", "network", "lattice")},
    "net": lambda: granulate(partial(make, "net", side=16)),
    "discs": lambda: granulate(partial(packing, side=14)),
    "spheres": lambda: granulate(partial(packing, side=5, dim=3)),
    "discs with friction": lambda: granulate(partial(packing, side=10, law="friction")),
    "10 friction packings": lambda: granulates(partial(packing, law="friction"), (10, 12), snes_stol=1e-6),
    "5 large friction packings": lambda: granulates(partial(packing, law="friction"), (16,)),
    "10 packings": lambda: granulates(packing, (14, 16)),
    "chain": lambda: granulate(partial(make, "chain")),
    "arch": lambda: granulate(partial(make, "arch", blocks=31, push=0.1)),
    "hung truss": lambda: granulate(partial(make, "hung-truss")),
    **{f"hung girder {f:g}": partial(granulate, partial(rigid.stiffened, f, False)) for f in (1e-8, 1e-4, 1e4, 1e8)},
    "hung girder, half 1e+08": lambda: granulate(partial(rigid.stiffened, 1e8, True)),
    "20 without room": lambda: verdict(partial(rigid.between, -1e-3, 1.0, 20), "jammed"),
    "20 without room, no load": lambda: verdict(partial(rigid.between, -1e-3, 0.0, 20), "jammed"),
    "20 with just room": lambda: verdict(partial(rigid.between, 0.0, 1.0, 20), "rest"),
    "net at rest": lambda: verdict(rigid.net, "rest"),
    "row that flies": lambda: verdict(partial(rigid.row, Law.CONTACT, np.full(8, 0.01), -1.0), "loose"),
    "light last grain": lambda: verdict(
        partial(rigid.row, Law.CONTACT, np.full(8, 0.01), np.append(np.ones(7), 0.1)), flown),
    "very light last grain": lambda: verdict(
        partial(rigid.row, Law.CONTACT, np.full(8, 0.01), np.append(np.ones(7), 1e-3)), "loose"),
    "small load on grains": lambda: verdict(partial(rigid.packing, 5, load=1e-6, law="elastic"), "rest"),
    "uplift 0.99": lambda: verdict(lambda: relieved(0.99)[0], "rest"),
    "uplift 0.999": lambda: verdict(lambda: relieved(0.999)[0], "rest"),
    "uplift 1.01": lambda: verdict(lambda: relieved(1.01)[0], "no rest"),
    "uplift 1.5": lambda: verdict(lambda: relieved(1.5)[0], "no rest"),
    "slack lattice, rest": lambda: verdict(lambda: loaded("lattice", 1e4)[0], "rest"),
    **{f"extremes, {suite.__name__.split('.')[-1]}": partial(extremes, suite) for suite in (catalogue, rigid, motions)},
    "bouncing chain": lambda: motion("bouncing-chain", 400),
    "mass on grid": lambda: motion("impact-grid", 60, modules=8),
    "mass on tower": lambda: motion("impact-tower", 100, levels=12),
    **{f"CG, {name}": partial(preconditioned, name, "cg") for name in coarse_spaces.SCENES},
    **{f"KSP latin, {name}": partial(preconditioned, name, "latin") for name in coarse_spaces.SCENES},
    "MATIS elasticity": lambda: matis(*ELASTIC),
    "MATIS elasticity 40": lambda: matis(*ELASTIC, "--cells", 40),
    "MATIS elasticity 64": lambda: matis(*ELASTIC, "--cells", 64),
    "MATIS elasticity 3D": lambda: matis(*ELASTIC, "--dim", 3, "--blocks", "2,2,1"),
    **{f"MATIS {jump} {f:g}": partial(matis, *ELASTIC, "--cells", 24, "--jump", jump, "--contrast", f)
       for jump in ("inside", "across", "random") for f in (1e2, 1e6)},
    "MATIS inside 40": lambda: matis(*ELASTIC, "--cells", 24, "--jump", "inside", "--contrast", 40),
    "MATIS inside 3D": lambda: matis(*ELASTIC, "--dim", 3, "--cells", 10, "--blocks", "2,2,1", "--jump", "inside"),
    "MATIS Poisson": lambda: matis("--cells", 24, "--jump", "inside", "-pc_type", "latin"),
    **{f"KSP latin MATIS {jump}": partial(matis, "--problem", "elasticity", "--cells", 24, "--jump", jump,
                                          "-ksp_type", "latin", "-pc_type", "none") for jump in ("inside", "random")},
    **{f"{name}, parts": partial(partition, name) for name in ("grid cut", "truss cut", "network", "lattice cut")},
    **{f"{links} links a part": partial(crumbs, links) for links in (2, 6, 12, 24, 48)},
    **{f"{name}, CG inside": partial(inexact, name) for name in ("grid cut", "network")},
    **{f"two ranks, {name}": partial(work, name) for name in ("grid", "network", "network 2000", "lattice")},
    **{f"rounding, {name}": partial(rounding, name) for name in ("grid", "network", "lattice")},
    "bound, truss": lambda: bound(make("truss-grid", modules=8), 10),
    "bound, lattice": lambda: bound(bars("lattice"), 10),
    "bound, network": lambda: bound(replace(bars("network", nodes=400), subdomain=None), 10),
}  # fmt: skip
FOLDER = (stages, modes, proved, caution, partition, inexact, extremes)


def main():
    folder, *names = sys.argv[1:]
    if folder == "--work":
        work_of_ranks(*names)
        return
    if not Path(latinpc.__file__).is_relative_to(ROOT):
        raise SystemExit(f"latinpc comes from {latinpc.__file__}, not from {ROOT}")
    for name in names:
        scene = SCENES[name]
        needs = isinstance(scene, partial) and scene.func in FOLDER
        try:
            found = scene(folder=folder) if needs else scene()
        except (PETSc.Error, RuntimeError, ValueError, IndexError, subprocess.TimeoutExpired) as error:
            print(name, error, file=sys.stderr)
            found = NONE
        print(json.dumps([name, found]), flush=True)


if __name__ == "__main__":
    main()
