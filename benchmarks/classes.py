"""Every problem class of section 2, (13) to (20), beside a solution that no part of the plugin computed.

python benchmarks/classes.py                  writes the table of examples/classes/README.md

References: sparse LU and eigenmodes (scipy), Lemke's pivots and nonnegative least squares (NNLS; tests/lcp.py),
Clarabel, the simplex method (HiGHS), closed forms, paths of Newton's method in numpy. A difference is that of the
vectors that are unique, relative to the reference, in the l2 norm.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.linalg
from scipy import sparse
from scipy.sparse.linalg import spsolve

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import lcp  # noqa: E402
from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.bench.extremes.corotational import Corotational  # noqa: E402
from latinpc.bench.peers.qp import kinematics  # noqa: E402
from latinpc.options import default_options  # noqa: E402
from latinpc.scenes import Law, make  # noqa: E402

EXACT = {"snes_stol": 1e-12, "snes_max_it": 30000}
AGREE = 1e-8


@dataclass
class Row:
    """A line of the table: how far apart the quantities named are."""

    equations: str
    what: str
    scene: str
    reference: str
    unique: dict


def apart(a, b):
    """Distance relative to the second."""
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def words(scene, options):
    """The command line's words for a scene's options."""
    return f"latinpc solve {scene} " + " ".join(
        f"--{key.replace('_', '-')} {str(value).lower() if isinstance(value, bool) else value}"
        for key, value in options.items()
    )


def static(name, **options):
    """Solve a scene to rounding: the command that does so, scene, displacements and tensions."""
    scene = make(name, **options)
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options(EXACT):
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0, name
    return (
        f"`{words(name, options)} -snes_stol 1e-12 -snes_max_it 30000`",
        scene,
        structure.displacements(u),
        latinpc.tensions(snes),
    )


def steps(scene, h, n=1, **options):
    """Make n time steps from the scene's velocities: displacements, velocities and mean tensions of the last step."""
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    u, v = structure.create_vec(), structure.create_vec()
    structure.set_displacements(scene.velocity, v)
    with default_options(EXACT | options):
        ts = structure.create_ts(u, v)
        ts.setTimeStep(h)
        ts.setMaxSteps(n)
        ts.setFromOptions()
        for _ in range(n):
            ts.step()
    still = np.where(scene.fixed, 0.0, 1.0)
    tension = latinpc.step_tensions(ts) if ts.getType() == "latin" else None
    return still * structure.displacements(u), still * structure.displacements(v), tension


def thrown(scene, mass=20.0, speed=1.0, **changes):
    """The scene with masses and random velocities, without loads."""
    rng = np.random.default_rng(0)
    velocity = np.where(scene.fixed, 0.0, rng.normal(scale=speed, size=scene.nodes.shape))
    masses = mass * rng.uniform(0.5, 1.5, len(scene.nodes))
    return replace(scene, mass=masses, velocity=velocity, load=np.zeros(scene.load.shape), **changes)


def floating(scene):
    """The scene without supports."""
    free = np.zeros_like(scene.fixed)
    return replace(scene, fixed=free, prescribed=np.zeros(free.shape), load=np.zeros(free.shape))


# ---- statics -------------------------------------------------------------------------------------
def truss():
    """(13), by a sparse factorisation."""
    command, scene, u, _ = static("truss-grid", modules=6, subdomains=9)
    B, e_d = kinematics(scene)
    k = sparse.diags(scene.stiffness)
    known = spsolve((B.T @ k @ B).tocsc(), scene.load[~scene.fixed] - B.T @ (k @ (e_d + scene.initial_elongation)))
    return Row("(13)", "truss", command, "sparse LU", {"displacements": apart(u[~scene.fixed], known)})


def hung_truss():
    """(15), by the quadratic program."""
    command, scene, u, tension = static("hung-truss", load=2e3, seed=2)
    known = lcp.program(scene)
    unique = {"displacements": apart(u, known[0]), "tensions": apart(tension, known[1])}
    return Row("(15)", "truss hung on inextensible cables", command, "Clarabel", unique)


def net():
    """(3), K_b singular but for the stiffness across the cables, by the quadratic program."""
    command, scene, u, tension = static("net", side=10, subdomains=4)
    known = lcp.program(scene)
    unique = {"displacements": apart(u, known[0]), "tensions": apart(tension, known[1])}
    return Row("(3)", "net", command, "Clarabel", unique)


def chain():
    """The hanging chain, by the polygon of forces."""
    command, scene, _, tension = static("chain", links=64)
    known = np.array(scene.metadata["tensions"])
    return Row("(3)", "hanging chain", command, "closed form", {"tensions": apart(tension[::2], known)})


def grains():
    """Rigid contacts alone, K_b = 0, by the linear program."""
    command, scene, u, tension = static("packing", side=12, subdomains=4)
    known = lcp.linear_program(scene)
    work, other = (u * scene.load).sum(), (known[0] * scene.load).sum()
    unique = {"tensions": apart(tension, known[1]), "work of the loads": abs(work / other - 1)}
    return Row("(3), K_b = 0", "granulate", command, "HiGHS, simplex", unique)


def tensegrity():
    """(18), (19) by Lemke's method."""
    command, scene, u, tension = static("tensegrity-grid", modules=3, subdomains=9, slack=0.15)
    cable, length, known = lcp.tensegrity(scene)
    B, e_d = kinematics(scene)
    corrected = tension[cable] / scene.stiffness[cable] - (B @ u[~scene.fixed] + e_d + scene.initial_elongation)[cable]
    unique = {"corrected lengths": apart(corrected, length), "tensions": apart(tension[cable], known)}
    return Row("(18), (19)", "tensegrity", command, "Lemke", unique)


# ---- large displacements -------------------------------------------------------------------------
def large(what, name, **options):
    """Links that turn as far as they go: Newton's method in numpy on a path of growing loads, forces in long double."""
    scene = make(name, **options)
    with default_options({"snes_latin_error": 1e-11}):
        result = scene.solve(comm=PETSc.COMM_SELF)
    assert result.converged, name
    equations = Corotational(scene)
    known = equations.follow()
    assert known.factor == 1.0, name
    tension = equations.state(known.displacements.astype(np.longdouble))[2].astype(float)
    unique = {"displacements": apart(result.displacements, known.displacements)}
    unique["tensions"] = apart(result.tensions, tension)
    return Row("displaced", what, f"`{words(name, options)} -snes_latin_error 1e-11`", "numpy, long double", unique)


# ---- one step, and many --------------------------------------------------------------------------
def smooth_motion():
    """(14): the scheme's closed form, mode by mode, of a truss that rings."""
    scene = thrown(make("truss-grid", modules=4, subdomains=4))
    h, n, free = 1e-4, 50, ~scene.fixed
    B, _ = kinematics(scene)
    mass = np.broadcast_to(scene.mass[:, None], scene.nodes.shape)[free]
    omega2, modes = scipy.linalg.eigh((B.T @ sparse.diags(scene.stiffness) @ B).toarray(), np.diag(mass))
    omega = np.sqrt(np.maximum(omega2, 0.0))
    # prestress is balanced: with q = 0 at rest, z = q' + i omega q obeys z+ (1 - i omega h) = z
    rest = -np.linalg.solve(
        (B.T @ sparse.diags(scene.stiffness) @ B).toarray(), B.T @ (scene.stiffness * scene.initial_elongation)
    )
    z = modes.T @ (mass * scene.velocity[free]) - 1j * omega * (modes.T @ (mass * rest))
    z = z / (1.0 - 1j * omega * h) ** n
    known = modes @ z.real, rest + modes @ (z.imag / omega)
    u, v, _ = steps(scene, h, n)
    unique = {"velocities": apart(v[free], known[0]), "displacements": apart(u[free], known[1])}
    return Row(
        "(14)", "motion of a truss", "truss grid, 4 x 4 modules, thrown, 50 steps of TS latin", "eigenmodes", unique
    )


def step_row(equations, what, where, scene, h=1e-3):
    """One step, by least squares on the Delassus operator: (16), (17), or (20) where cables are extensible."""
    known = lcp.step(scene, h)
    _, v, tension = steps(scene, h)
    unique = {"velocities": apart(v[~scene.fixed], known.velocity)}
    if known.regular:
        unique["impulses"] = apart(h * tension[known.unilateral], known.impulse)
    assert 0 < np.count_nonzero(known.impulse) < len(known.impulse), "nothing to decide"
    return Row(equations, what, f"{where}, thrown, a step of TS latin", "NNLS", unique)


def inextensible(scene, bars=True):
    """The scene with inextensible cables, all taut, and its bars, or cables in their place."""
    law = np.where((scene.law == Law.CABLE) | (not bars), Law.INEXTENSIBLE, scene.law)
    bar = law == Law.BAR
    return replace(
        scene,
        law=law,
        initial_elongation=np.where(bar, scene.initial_elongation, 0.0),
        stiffness=np.where(bar, scene.stiffness, 0.0),
    )


def rows():
    """All rows, in the order of the equations."""
    grid = floating(make("tensegrity-grid", modules=2, subdomains=4))
    yield truss()
    yield smooth_motion()
    yield hung_truss()
    modules = "tensegrity grid, 2 x 2 modules, no support"
    yield step_row("(16), (17)", "shock of bars and inextensible cables", modules, thrown(inextensible(grid)))
    cables = "the same links, all inextensible cables"
    yield step_row("(16), W", "shock of a net of cables alone", cables, thrown(inextensible(grid, bars=False)))
    discs = thrown(make("packing", side=7, disorder=0.0))
    yield step_row("(16), W", "shock of grains that touch", "7 x 7 discs, rigid contacts", discs)
    yield net()
    yield chain()
    yield grains()
    yield tensegrity()
    yield step_row("(20)", "motion of a tensegrity", modules, thrown(grid, speed=3.0))
    yield large("saddle, a tenth of its cables slack", "saddle", side=8)
    yield large("hypar with edge cables", "hypar", load=300.0)
    yield large("guyed mast, guys behind the wind hang", "mast", wind=200.0)
    yield large("tower of prisms", "tower", stages=5)
    yield large("tensegrity bridge", "bridge", panels=10)


def table(found):
    """Lines of the table of the page."""
    yield "| equations | what | scene | reference | largest relative difference |"
    yield "| --- | --- | --- | --- | --- |"
    for row in found:
        apart = ", ".join(f"{name} {value:.0e}" for name, value in row.unique.items())
        yield f"| {row.equations} | {row.what} | {row.scene} | {row.reference} | {apart} |"


def main():
    """Put the table into the page, between its marks."""
    found = list(rows())
    page = ROOT / "examples" / "classes" / "README.md"
    before, _, rest = page.read_text().partition("<!-- rows -->\n")
    page.write_text("\n".join([before + "<!-- rows -->", *table(found), rest[rest.index("<!-- end -->") :]]))
    print(*table(found), sep="\n")
    assert all(value < AGREE for row in found for value in row.unique.values())


if __name__ == "__main__":
    main()
