"""Move a scene with masses: what ``latinpc solve SCENE --steps N`` and the benchmarks call."""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass, field, replace

import numpy as np
from petsc4py import PETSc

import latinpc

from .checkpoint import Keeper
from .io import slack
from .links import Links
from .scenes.scene import UNILATERAL, Scene
from .solve import default_options, plain, unknown_options, versions

CONTRAST = 1e3  # of masses, from which on it may be why a step does not converge
FRAMES = 100  # states kept of a motion, at most, unless told otherwise


@dataclass
class Frame:
    """The state after a step; arrays are whole, in the scene's numbering."""

    step: int
    time: float  #: s
    displacements: np.ndarray  #: (n, dim), m
    velocities: np.ndarray  #: (n, dim), m/s
    tensions: np.ndarray  #: (m,), N: impulses over the length of the step


@dataclass
class Motion:
    """A scene that has moved; the same on every rank."""

    scene: Scene
    report: dict  #: JSON-able, with the keys that `move` lists
    frames: list = field(default_factory=list)
    subdomain: np.ndarray | None = None  #: (m,), as the solver has it
    node_class: np.ndarray | None = None  #: (n,), 0 interior, 1 strong, 2 weak interface, 3 corner
    notices: list = field(default_factory=list)  #: sentences the user should read

    @property
    def converged(self):
        """Whether all steps were made."""
        return self.report["converged"]


def move(
    scene, steps, step=None, options=None, *, subdomains=None, mass=None, every=None, comm=None, each_step=None,
    keeper=None,
):  # fmt: skip
    """Make time steps with the TS that the options name, `latin` by default; collective.

    Parameters
    ----------
    scene : Scene
        The same on every rank; it starts without displacement, with its velocities.
    steps : int
        Number of steps.
    step : float, optional
        Length of a step (s); that of the scene when not given.
    options : dict, optional
        PETSc options without the leading dash, used where the user has not set them.
    subdomains : int, optional
        How many subdomains METIS makes when the scene brings no partition.
    mass : float, optional
        Of every node (kg), in place of the scene's.
    every : int, optional
        Keep a frame each so many steps; 0 keeps the last one only. By default at most a hundred are kept.
    comm : communicator, optional
    each_step : callable, optional
        Called after each step with its number and its time.
    keeper : Keeper, optional
        Keeps the state between steps; frames are kept from the restart on.

    Returns
    -------
    Motion
        Its report has the keys scene, scene_options, dofs, free_dofs, links, ranks, subdomains, strong_interfaces,
        weak_interfaces, strong_macro_dofs, weak_dofs, solver, steps, step, time, converged, reason, iterations (of each
        step), iterations_mean, kinetic_energy and potential_energy (at the start and after each step), active (links
        that can be slack and are not, after each step), first_step_seconds (with the set-up), seconds,
        peak_memory_bytes, versions, options. What does not apply is None.

    Raises
    ------
    ValueError, petsc4py.PETSc.Error
        On every rank. A step that does not converge is no error: see ``report["reason"]``.
    """
    if mass is not None:
        scene = replace(scene, mass=np.full(len(scene.nodes), float(mass)))
    if scene.mass is None:
        raise ValueError(f"the scene {scene.name} has no masses: give every node one with --mass")
    step = scene.time_step if step is None else step
    if step is None:
        raise ValueError(f"the scene {scene.name} suggests no length of a step: give it in seconds with --step")
    if steps < 1 or not 0.0 < step < np.inf:
        raise ValueError(f"a motion is at least one step of a positive length, not {steps} of {step} s")
    every = max(-(-steps // FRAMES), 1) if every is None else every
    links = Links.from_scene(scene, comm)
    keeper = keeper or Keeper(links.comm.tompi4py())
    settings = keeper.options | dict(options or {})
    if subdomains is not None:
        settings |= {"snes_latin_subdomains": subdomains, "pc_latin_subdomains": subdomains}
    v = links.create_vec()
    if scene.velocity is not None:
        links.set_displacements(scene.velocity, v)
    with default_options(settings):
        ts = links.create_ts(v=v)
        try:
            ts.setTimeStep(step)
            ts.setMaxSteps(steps)
            ts.setErrorIfStepFails(False)
            ts.setFromOptions()
            return _move(scene, links, ts, steps, step, every, each_step, keeper)
        finally:
            ts.destroy()


def _move(scene, links, ts, steps, step, every, each_step, keeper):
    comm, snes = links.comm.tompi4py(), ts.getSNES()
    u, v = ts.getSolution2()
    past = {"iterations": [], "kinetic_energy": [], "potential_energy": [], "active": []}
    keeper.about(scene, length_of_a_step=step)
    frames, clock = [], {"work": 0.0}
    unilateral = np.isin(scene.law, UNILATERAL)

    def state(number, t, x):
        tensions = latinpc.step_tensions(ts) if ts.getType() == "latin" and number else links.tensions(x)
        velocities = np.where(scene.fixed, 0.0, links.displacements(v))
        return Frame(number, t, links.displacements(x), velocities, tensions)

    def record(number, t, x):
        start = time.perf_counter()
        if number == 1:
            clock["first"] = start
        if number:
            past["iterations"].append(snes.getIterationNumber())
        past["kinetic_energy"].append(links.kinetic_energy(v))
        past["potential_energy"].append(links.energy(x))
        if number and unilateral.any():
            tensions = latinpc.step_tensions(ts) if ts.getType() == "latin" else links.tensions(x)
            past["active"].append(int(np.count_nonzero(unilateral & ~slack(scene, tensions))))
        if number == steps or (every and number % every == 0):
            frames.append(state(number, t, x))
        if each_step is not None:
            each_step(number, t)
        clock["work"] += time.perf_counter() - start

    def after_step(ts):
        number = ts.getStepNumber()
        if number == len(past["iterations"]):  # the step has failed
            return
        record(number, ts.getTime(), u)
        if keeper.step(ts, number, past):
            ts.setConvergedReason(PETSc.TS.ConvergedReason.CONVERGED_USER)

    ts.setPostStep(after_step)
    done, kept = keeper.resume(ts)
    past |= kept
    if not done:
        record(0, ts.getTime(), u)
    clock["work"] = 0.0
    comm.barrier()
    start = time.perf_counter()
    with keeper.watching(snes):
        ts.solve(u)
    keeper.check()
    comm.barrier()
    duration = time.perf_counter() - start - clock["work"]
    if not frames or frames[-1].step != ts.getStepNumber():
        frames.append(state(ts.getStepNumber(), ts.getTime(), u))
    is_latin = snes.getType() == "latin"
    statistics = latinpc.statistics(snes) if is_latin else {}
    sizes, reason = links.sizes, ts.getConvergedReason()
    names = {value: name for name, value in vars(PETSc.TS.ConvergedReason).items() if name.isupper()}
    report = {
        "scene": scene.name,
        "scene_options": scene.metadata,
        "dofs": sizes.nodes * sizes.dim,
        "free_dofs": sizes.free_dofs,
        "links": sizes.links,
        "ranks": comm.size,
        "solver": f"{ts.getType()} + {snes.getType()}" + ("" if is_latin else f" + {snes.getKSP().getPC().getType()}"),
        **{
            key: statistics.get(key)
            for key in ("subdomains", "strong_interfaces", "weak_interfaces", "strong_macro_dofs", "weak_dofs")
        },
        "steps": ts.getStepNumber(),
        "step": step,
        "time": ts.getTime(),
        "converged": reason > 0,
        "reason": names.get(reason, str(reason)),
        **past,
        "iterations_mean": float(np.mean(past["iterations"])) if past["iterations"] else None,
        "first_step_seconds": clock["first"] - start if "first" in clock else None,
        "seconds": duration,
        "peak_memory_bytes": comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024),
        "versions": versions(),
        "options": dict(PETSc.Options().getAll()),
    }
    return Motion(
        scene=scene,
        report=plain(report),
        frames=frames,
        subdomain=latinpc.subdomain_of_links(snes) if is_latin else scene.subdomain,
        node_class=latinpc.node_classes(snes) if is_latin else None,
        notices=unknown_options() + ([] if reason > 0 else _causes(ts, snes, scene.mass)),
    )


def _causes(ts, snes, mass):
    """Return a sentence on why a step has not been made, where links or masses tell."""
    names = PETSc.SNES.ConvergedReason
    why = next(
        (name for name in dir(names) if name.isupper() and getattr(names, name) == snes.getConvergedReason()), ""
    )
    text = f"step {ts.getStepNumber() + 1} has not converged: {why}"
    if snes.getType() == "latin" and snes.getConvergedReason() == names.DIVERGED_INNER:
        least = latinpc.rounding_floor(snes)
        text += f", the error asked for is below what rounding leaves of this step, about {least:.0e}"
    heavy = mass[mass > 0.0]
    if snes.getConvergedReason() == names.DIVERGED_MAX_IT and len(heavy) and heavy.max() > CONTRAST * heavy.min():
        text += (
            f"; masses differ by a factor of {heavy.max() / heavy.min():.0e}: light nodes come slowly to rest on"
            " the contacts between heavy ones"
        )
    return [text]
