"""Structures, partitions and short ways to run the solver that several test files share."""

from __future__ import annotations

import itertools
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import oracle
from petsc4py import PETSc

import latinpc
from latinpc.options import default_options
from latinpc.scenes import Law, Scene, make

VARIANTS = ("none", "macro", "corner")
ALL_VARIANTS = (*VARIANTS, "published")
PLAIN = {"outer_snes_type": "nrichardson"}
ROUNDING = 1e-10
HDF5 = b"H5Fopen" in Path(latinpc.__file__).with_name("liblatinpc.so").read_bytes()
STATES = ("state", "state.h5") if HDF5 else ("state",)  # files in PETSc's binary format, and in HDF5
SNES_OWN = ("max_it", "stol", "rtol", "atol", "divergence_tolerance", "monitor", "view")


# ---- structures ------------------------------------------------------------------------------
def grid(kind="tensegrity", modules=6, subdomains=9, **how):
    """Small grid of the article: nine blocks of 2 x 2 modules have every kind of node."""
    return make(f"{kind}-grid", modules=modules, subdomains=subdomains, **how)


def irregular(kind="tensegrity", modules=8, parts=6, seed=1, **how):
    """Make a grid whose partition cuts through the modules."""
    return cut(make(f"{kind}-grid", modules=modules, partition="metis", **how), parts, seed)


def network(nodes=140, parts=6, seed=3, **how):
    """Random network with an irregular partition."""
    return cut(make("network", nodes=nodes, seed=seed, **how), parts, seed)


def lattice(nx=8, ny=4, subdomains=8, **how):
    """Two-dimensional lattice in square blocks."""
    return make("lattice", nx=nx, ny=ny, subdomains=subdomains, **how)


def chain(links=24, parts=4, law=Law.BAR, stiffness=1000.0, load=1.5):
    """Links in a row, held at both ends, the right one pulled; loads towards the right."""
    n = links + 1
    fixed = np.zeros((n, 1), bool)
    fixed[[0, -1]] = True
    return Scene(
        name="chain",
        nodes=np.arange(float(n))[:, None],
        links=np.column_stack([np.arange(links), np.arange(1, n)]),
        law=np.full(links, law),
        stiffness=stiffness * (1.0 + np.arange(links) % 3),
        initial_elongation=np.full(links, 0.01),
        fixed=fixed,
        prescribed=np.where(np.arange(n) == links, 0.2, 0.0)[:, None],
        load=np.where(fixed, 0.0, load),
        subdomain=np.arange(links) * parts // links,
    )


def cut(scene, parts, seed=0):
    """Share the links out by the nearest of some random points: an irregular partition without METIS."""
    middle = scene.nodes[scene.links].mean(axis=1)
    points = middle[np.random.default_rng(seed).choice(len(middle), parts, replace=False)]
    distance = np.linalg.norm(middle[:, None] - points, axis=2)
    return with_partition(scene, distance.argmin(axis=1))


def with_partition(scene, subdomain):
    """Make the same structure with another partition, numbered without gaps."""
    return replace(scene, subdomain=np.unique(subdomain, return_inverse=True)[1])


def settled(scene, size=1e-3, seed=0):
    """Make the same structure with random displacements of its supports (m)."""
    moved = np.random.default_rng(seed).uniform(-size, size, scene.nodes.shape)
    return replace(scene, prescribed=np.where(scene.fixed, moved, 0.0))


def on_rails(scene, share=0.15, seed=0):
    """Make the same structure with some components of some more nodes prescribed: rails and tables."""
    held = np.random.default_rng(seed).random(scene.nodes.shape) < share
    return replace(scene, fixed=scene.fixed | held, load=np.where(held, 0.0, scene.load))


# ---- the solver ------------------------------------------------------------------------------
@contextmanager
def latin(scene, _structure=None, **options):
    """Give a SNES latin with these options, `-snes_latin_` left out: ``latin(scene, variant="macro", max_it=3)``."""
    structure = _structure or latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options({("snes_" if key in SNES_OWN else "snes_latin_") + key: v for key, v in options.items()}):
        snes = structure.create_snes()
        snes.setFromOptions()
        try:
            yield SimpleNamespace(snes=snes, structure=structure)
        finally:
            snes.destroy()


def solve(scene, _reference=None, _structure=None, **options):
    """Run SNES latin: displacements (n, dim), reason, iterations, history, statistics and tensions."""
    with latin(scene, _structure, **options) as run:
        if _reference is not None:
            given = run.structure.create_vec()
            run.structure.set_displacements(_reference, given)
            latinpc.set_reference(run.snes, given)
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        return SimpleNamespace(
            u=run.structure.displacements(u),
            reason=run.snes.getConvergedReason(),
            iterations=run.snes.getIterationNumber(),
            history=SimpleNamespace(**latinpc.history(run.snes)),
            statistics=latinpc.statistics(run.snes),
            tensions=latinpc.tensions(run.snes),
            estimated_error=latinpc.estimated_error(run.snes),
        )


def statistics(scene, **options):
    """Size of the decomposition, nothing solved."""
    with latin(scene, **options) as run:
        run.snes.setUp()
        return latinpc.statistics(run.snes)


def oracle_options(options):
    """Options of the oracle for those of the solver."""
    ours = {"variant": "corner", "direction": "schur", "direction_value": 0.0}
    ours |= {key: options[key] for key in ours if key in options}
    ours["value"] = ours.pop("direction_value")
    return ours


def far(a, b):
    """Largest difference relative to the largest displacement."""
    return np.abs(a - b).max() / np.abs(b).max()


def unbalance(scene, u):
    """Largest nodal unbalance B^t tau - F at free dofs, relative to the forces that meet there."""
    b, e_d = oracle.kinematics(scene)
    tau = oracle.tension(scene, b @ np.where(scene.fixed, 0.0, u).ravel() + e_d)
    r = (b.T @ tau).reshape(u.shape) - scene.load
    return np.abs(np.where(scene.fixed, 0.0, r)).max() / (abs(b).T @ abs(tau)).max()


_STAGES = itertools.count()


@contextmanager
def logged():
    """Count events in a stage of its own: PETSc counts no event again in a stage where an error has cut it short."""
    PETSc.Log.begin()
    stage = PETSc.Log.Stage(f"test {next(_STAGES)}")
    stage.push()
    try:
        yield
    finally:
        stage.pop()
