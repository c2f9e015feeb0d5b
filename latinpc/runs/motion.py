"""Make time steps of a scene with masses: what ``latinpc solve SCENE --num-steps N`` and the benchmarks call."""

from __future__ import annotations

import operator
import time
from dataclasses import dataclass, field, replace

import numpy as np
from petsc4py import PETSc

from latinpc import solvers
from latinpc.arrays import alike, communicator
from latinpc.geometry import extent
from latinpc.laws import RIGID, UNILATERAL, Law
from latinpc.options import default_options, given_options, subdomain_options, unknown_options
from latinpc.results import tables
from latinpc.results.mechanics import elongations, slack
from latinpc.results.notices import SolveError, errors_as_given, one_step
from latinpc.results.report import DECOMPOSITION, plain, problem, reason_name
from latinpc.results.solve import attach_linear, gather
from latinpc.results.summary import summary_of_motion
from latinpc.results.units import quantity
from latinpc.scenes.scene import Scene
from latinpc.structure import Structure

from .checkpoint import Keeper
from .history import Acting
from .report import environment

GROWN = 0.1  # of the energy that has become kinetic, above which a growing energy is told
UNBALANCED = 1e-3  # of the largest force: what massless nodes may start with, and what holds none of them
CLOSED = 1e-4  # of the flight of a step: LATIN_STEP_CLOSED, gaps that count as closed
NAMED = 6  # nodes in a sentence, at most
FRAMES = 100  # states kept of a motion, at most, by default


@dataclass
class Frame:
    """The state after a step; arrays are whole, in the scene's numbering."""

    step: int
    time: float  #: s
    displacements: np.ndarray  #: (n, dim), m
    velocities: np.ndarray  #: (n, dim), m/s
    tensions: np.ndarray  #: (m,), N: impulses over the length of the step
    initial_elongation: np.ndarray  #: (m,), m
    load: np.ndarray  #: (n, dim), N: what acts at that time


@dataclass
class Motion:
    """A scene that has moved; the same on every rank."""

    scene: Scene
    report: dict  #: JSON-able, with the keys that `move` lists
    frames: list = field(default_factory=list)
    subdomain: np.ndarray | None = None  #: (m,), as the solver has it
    node_class: np.ndarray | None = None  #: (n,), 0 interior, 1 strong, 2 weak interface, 3 corner
    notices: list = field(default_factory=list)  #: sentences the user should read

    def __repr__(self) -> str:
        lines = [*summary_of_motion(self), *(("notice", text) for text in self.notices)]
        return "\n".join([self.scene.name, *(f"  {label:<15}{text}" for label, text in lines)])

    @property
    def converged(self):
        """Whether all steps have converged."""
        return self.report["converged"]

    @property
    def members(self):
        """Links over time, a structured array: step, time (s), link, start, end, tension (N), slack; names and groups.

        And the gap (m) where there are contacts. A row for each link of each frame; all as in `latinpc.Result.members`.
        """
        return tables.motion_members(self)

    @property
    def nodes(self):
        """Nodes over time, a structured array: step, time (s), node, displacement_x ... (m), velocity_x ... (m/s).

        A row for each node of each frame; names and groups as in `latinpc.Result.nodes`.
        """
        return tables.motion_nodes(self)

    def to_csv(self, members, nodes=None):
        """Write `members`, and `nodes` where a file for them is named, into CSV files; call it on one rank."""
        tables.write_csv(members, self.members)
        if nodes is not None:
            tables.write_csv(nodes, self.nodes)


def move(
    scene, steps, step=None, options=None, *, subdomains=None, mass=None, every=None, comm=None, each_step=None,
    keeper=None, from_equilibrium=False, history=None,
):  # fmt: skip
    """Make time steps with the TS that the options name, `latin` by default; collective.

    Parameters
    ----------
    scene : Scene
        The same on every rank; it starts as drawn, with its velocities.
    steps : int
        Number of steps.
    step : float, optional
        Length of a step (s); that of the scene when not given. The option -ts_dt, from PETSc 3.25 on
        -ts_time_step, comes before both.
    options : dict, optional
        PETSc options without the leading dash, used where the user has not set them.
    subdomains : int, optional
        Number of subdomains that METIS makes when the scene has no partition.
    mass : float, optional
        Of every node (kg), in place of the scene's.
    every : int, optional
        Keep every Nth state as a frame; 0 keeps the last one only. By default about a hundred in all.
    comm : communicator, optional
    each_step : callable, optional
        Called after each step with its number and its time.
    keeper : Keeper, optional
        Saves the state between steps; after a restart, frames start there.
    from_equilibrium : bool
        Start from the equilibrium of what acts at the start, not as drawn.
    history : latinpc.runs.history.History, optional
        How actions vary with time; those of the scene stay.

    Returns
    -------
    Motion
        Its report has the keys scene, scene_options, dofs, free_dofs, links, ranks, subdomains, strong_interfaces,
        weak_interfaces, strong_macro_dofs, weak_dofs, solver, steps, step, time, converged, reason, iterations (of each
        step), iterations_mean, kinetic_energy and potential_energy (at the start and after each step), active (links
        that can be slack and are not, after each step), from_equilibrium, history (times and factors),
        first_step_seconds (with the set-up), seconds, peak_memory_bytes, versions, options. What does not apply is
        None.

    Raises
    ------
    ValueError, LatinError
        On every rank. A step that does not converge is no error: see ``report["reason"]``. An equilibrium to start
        from that is not found is one.
    """
    comm, step = communicator(comm), scene.time_step if step is None else step
    same = {"steps": steps, "step": step, "mass": mass, "every": every, "options": options, "subdomains": subdomains}
    alike(comm.tompi4py(), **same, from_equilibrium=from_equilibrium, history=history)
    if mass is not None:
        scene = replace(scene, mass=np.full(len(scene.nodes), float(mass)))
    if scene.mass is None:
        raise ValueError(f"the scene {scene.name} has no masses: give mass, in kg (on the command line --node-mass)")
    if step is None:
        raise ValueError(f"the scene {scene.name} has no time step: give step, in s (on the command line --time-step)")
    steps = _whole(steps, "steps")
    if steps < 1:
        raise ValueError(f"a motion needs at least one step, not {steps} (--num-steps)")
    _check_length(step, "--time-step")
    every = max(-(-steps // FRAMES), 1) if every is None else _whole(every, "every")
    if every < 0:
        raise ValueError(f"every is {every}: every Nth state is kept, N at least 1, or 0 for the last one only")
    structure = Structure.from_scene(scene, comm)
    keeper = keeper or Keeper(comm.tompi4py())
    settings = keeper.options | given_options(options) | subdomain_options(subdomains)
    u, v = structure.create_vec(), structure.create_vec()
    if scene.velocity is not None:
        structure.set_displacements(scene.velocity, v)
    with default_options(settings), errors_as_given(structure):
        acting = None
        if history is not None:
            acting = Acting(structure, scene, history)
            acting.set(PETSc.Options().getReal("ts_init_time", 0.0))  # where the TS finds the supports
            scene = acting.whole
        notices = _balance(structure, u) if from_equilibrium and not keeper.restarts else []
        ts = structure.create_ts(u, v)
        try:
            ts.setTimeStep(step)
            ts.setMaxSteps(steps)
            ts.setErrorIfStepFails(False)
            ts.setFromOptions()
            _check_length(ts.getTimeStep(), "-ts_dt")
            _ends(ts, steps)
            if acting is not None:
                ts.setPreStep(acting.before_step)
            recorder = _Recorder(scene, structure, ts, steps, every, each_step, keeper, acting)
            motion = _move(recorder, ts.getTimeStep(), from_equilibrium)
            motion.notices = notices + motion.notices
            return motion
        finally:
            ts.destroy()


def _ends(ts, steps):
    """Let the time end the motion, not the number of steps, if options allow shorter ones in place of failed ones."""
    given = PETSc.Options()
    if given.hasName("ts_max_snes_failures") and not given.hasName("ts_max_steps") and not given.hasName("ts_max_time"):
        ts.setMaxTime(ts.getTime() + steps * ts.getTimeStep())
        ts.setMaxSteps(np.iinfo(PETSc.IntType).max)
        ts.setExactFinalTime(PETSc.TS.ExactFinalTime.MATCHSTEP)


def _whole(number, name):
    """Return a number of steps."""
    try:
        return operator.index(number)
    except TypeError:
        raise ValueError(f"{name} must be a whole number of steps, not {number!r}") from None


def _check_length(step, option):
    """Refuse a length of a step (s) that is none."""
    if not 0.0 < step < np.inf:
        raise ValueError(f"a time step has the length {step} s; it must be positive and finite: change {option}")


def _balance(structure, u):
    """Write the displacements of equilibrium under what now acts into u; return what is to be said of them."""
    snes = structure.create_snes()
    try:
        snes.setFromOptions()
        core = attach_linear(structure, snes)
        snes.solve(None, u)
        found = gather(structure, snes, core, u)
    finally:
        snes.destroy()
    if not found.converged:
        said = "; ".join([found.reason, *found.notices])
        raise SolveError(f"no equilibrium has been found to start from: not converged: {said}")
    return [f"equilibrium at the start: {notice}" for notice in found.notices]


class _Recorder:
    """Records of a motion: energies, iterations and active links of each step, and the frames.

    Parameters are those of `move`. Methods are collective.
    """

    def __init__(self, scene, structure, ts, steps, every, each_step, keeper, acting):
        self.scene, self.structure, self.ts, self.keeper, self.acting = scene, structure, ts, keeper, acting
        self.past = {"iterations": [], "kinetic_energy": [], "potential_energy": [], "active": []}
        self.frames = []
        self.first_end = None  # clock after the first step
        self.seconds = 0.0  # spent here, not on the motion
        self._speeds = 0.0  # of supports, in the last step that has converged
        self._steps, self._every, self._each_step = steps, every, each_step
        self._unilateral = np.isin(scene.law, UNILATERAL)

    def _tensions(self, u):
        return solvers.step_tensions(self.ts) if self.ts.getType() == "latin" else self.structure.tensions(u)

    def add_frame(self, number):
        """Keep the state after a step."""
        if self.acting is not None:
            self.acting.set(self.ts.getTime())  # a step that has failed has moved the supports
        u, v = self.ts.getSolution2()
        tensions = self._tensions(u)
        velocities = np.where(self.scene.fixed, self._speeds, self.structure.displacements(v))
        moved, acts = self.structure.displacements(u), (self.structure.initial_elongation, self.structure.load)
        self.frames.append(Frame(number, self.ts.getTime(), moved, velocities, tensions, *acts))

    def record(self, number):
        """Record a step, or the start as number 0."""
        start = time.perf_counter()
        if number == 1:
            self.first_end = start
        if self.acting is not None:
            self.acting.set(self.ts.getTime())
            self._speeds = self.acting.speeds(self.ts.getTime()) if number else 0.0
        u, v = self.ts.getSolution2()
        if number:
            self.past["iterations"].append(self.ts.getSNES().getIterationNumber())
        self.past["kinetic_energy"].append(self.structure.kinetic_energy(v))
        self.past["potential_energy"].append(self.structure.energy(u))
        if number and self._unilateral.any():
            loose = slack(self.scene, self._tensions(u))
            self.past["active"].append(int(np.count_nonzero(self._unilateral & ~loose)))
        if number == self._steps or (self._every and number % self._every == 0):
            self.add_frame(number)
        if self._each_step is not None:
            self._each_step(number, self.ts.getTime())
        self.seconds += time.perf_counter() - start

    def after_step(self, ts):
        """Record a step and keep its state; for ``ts.setPostStep``."""
        number = ts.getStepNumber()
        if number == len(self.past["iterations"]):  # the step has failed
            return
        self.record(number)
        if self.keeper.step(ts, number, self.past):
            ts.setConvergedReason(PETSc.TS.ConvergedReason.CONVERGED_USER)


def _move(recorder, step, from_equilibrium):
    """Make the steps and report; collective."""
    scene, structure, ts, keeper = recorder.scene, recorder.structure, recorder.ts, recorder.keeper
    comm, snes = structure.comm.tompi4py(), ts.getSNES()
    acting = recorder.acting
    history = None if acting is None else [acting.history.times.tolist(), acting.history.factors.tolist()]
    keeper.about(scene, length_of_a_step=step, history_of_loads=history, start_from_equilibrium=from_equilibrium)
    ts.setPostStep(recorder.after_step)
    if ts.getType() == "latin":
        ts.setUp()  # a geometry that an option gives is that of the structure from here on
    done, kept = keeper.resume(ts)
    recorder.past |= kept
    notices = unknown_options() + _left(ts, done)
    if not done:
        notices += _thrown(scene) + _massless(structure, ts) + _closed(structure, ts)
        recorder.record(0)
    recorder.seconds = 0.0
    comm.barrier()
    start = time.perf_counter()
    with keeper.watching(snes):
        ts.solve(ts.getSolution2()[0])
    keeper.check()
    comm.barrier()
    duration = time.perf_counter() - start - recorder.seconds
    if not recorder.frames or recorder.frames[-1].step != ts.getStepNumber():
        recorder.add_frame(ts.getStepNumber())
    is_latin = snes.getType() == "latin"
    statistics = solvers.statistics(snes) if is_latin else {}
    reason, iterations = ts.getConvergedReason(), recorder.past["iterations"]
    report = {
        **problem(structure),
        "scene_options": scene.metadata,
        "solver": f"{ts.getType()} + {snes.getType()}" + ("" if is_latin else f" + {snes.getKSP().getPC().getType()}"),
        **{key: statistics.get(key) for key in DECOMPOSITION},
        "steps": ts.getStepNumber(),
        "step": step,
        "time": ts.getTime(),
        "converged": reason > 0,
        "reason": reason_name(PETSc.TS.ConvergedReason, reason),
        **recorder.past,
        "from_equilibrium": from_equilibrium,
        "history": history,
        "iterations_mean": float(np.mean(iterations)) if iterations else None,
        "first_step_seconds": recorder.first_end - start if recorder.first_end is not None else None,
        "seconds": duration,
        **environment(comm),
    }
    turns = structure.geometry
    return Motion(
        scene=scene if turns == scene.geometry else replace(scene, geometry=turns),
        report=plain(report),
        frames=recorder.frames,
        subdomain=solvers.subdomain_of_links(snes) if is_latin else scene.subdomain,
        node_class=solvers.node_classes(snes) if is_latin else None,
        notices=notices
        + one_step(snes, structure)
        + ([] if acting is not None else _grown(ts, report, structure))
        + ([] if reason > 0 else [_failed(ts, structure)]),
    )


def _left(ts, done):
    """Return a sentence where the state after so many steps is the end of the motion; refuse one beyond it."""
    start, end, steps = ts.getTime(), ts.getMaxTime(), ts.getMaxSteps()
    if end < start or (not done and end == start):
        raise ValueError(f"a motion from {start:g} s to {end:g} s has no step: check -ts_max_time")
    if done > steps:
        raise ValueError(
            f"the state is that after step {done}, and the motion has {steps} in all: give more steps than {done}"
            " (--num-steps)"
        )
    if done == steps or end == start:
        return [f"no step is left: the state is that after step {done}, the last one"]
    return []


def _grown(ts, report, structure):
    """Return a sentence where energy has come from nowhere, by more than rounding: loads and supports stay."""
    energy = np.add(report["kinetic_energy"], report["potential_energy"])
    growth, moved = energy.max() - energy[0], energy[0] - min(report["potential_energy"])
    forces = np.abs(structure.load).sum() + structure.stiffness @ np.abs(structure.initial_elongation)
    rounding = np.finfo(float).eps * forces * np.linalg.norm(extent(structure))  # of what is at rest
    if not growth > GROWN * moved + np.finfo(float).eps ** 0.5 * np.abs(energy[0]) + rounding:
        return []
    cure = "take shorter steps" + ("" if ts.getType() == "latin" else ", or -ts_type latin, which does not let it")
    return [f"the energy has grown from {quantity(energy[0], 'J')} to {quantity(energy.max(), 'J')} by itself: {cure}"]


def _thrown(scene):
    """Return a sentence on nodes that start with a velocity and have no mass to keep it."""
    if scene.velocity is None:
        return []
    nodes = np.flatnonzero(scene.velocity.any(axis=1) & (scene.mass == 0.0))
    if not len(nodes):
        return []
    named = scene.some_nodes(nodes[:NAMED], len(nodes) > NAMED)
    it = "it has no mass: give it" if len(nodes) == 1 else "they have no mass: give them"
    return [f"the initial velocity of {named} moves nothing, as {it} one"]


def _closed(structure, ts):
    """Return a sentence on gaps that the first step takes for closed ones: those that are small beside its flight.

    The flight is how far elastic links, loads and velocities would move nodes without rigid links.
    """
    normal = np.isin(structure.law, RIGID) & (structure.law != Law.TANGENT)
    if ts.getType() != "latin" or structure.geometry == "large" or not normal.any():
        return []
    u, v = (structure.displacements(vector) for vector in ts.getSolution2())
    h, free = ts.getTimeStep(), ~structure.fixed & (structure.mass > 0.0)[:, None]
    pull = solvers.step_tensions(ts)[:, None]  # before the first step, zero of rigid links
    force = structure.load.copy()
    np.add.at(force, structure.links[:, 0], pull * structure.directions)
    np.subtract.at(force, structure.links[:, 1], pull * structure.directions)
    inverse = np.divide(1.0, structure.mass, where=structure.mass > 0.0, out=np.zeros(len(u)))[:, None]
    flight = np.abs(np.where(free, h * v + h**2 * force * inverse, 0.0)).max()
    x = elongations(structure, u) + structure.initial_elongation
    gap = np.where(structure.law == Law.INEXTENSIBLE, -x, x)
    links = np.flatnonzero(normal & (gap > CLOSED * np.abs(u).max()) & (gap > 0.0) & (gap <= CLOSED * flight))
    if not len(links):
        return []
    named, one = structure.some_links(links[:NAMED], len(links) > NAMED), len(links) == 1
    return [
        f"the gap{'' if one else 's'} of {named}, up to {quantity(gap[links].max(), 'm')}, count{'s' if one else ''} as"
        f" closed in the first step: without rigid links nodes would move by {quantity(flight, 'm')} in it; take"
        " shorter steps"
    ]


def _massless(structure, ts):
    """Return a sentence on masses of held nodes alone, or on nodes without mass that swing for ever about balance."""
    if not (structure.mass > 0.0)[~structure.fixed.all(axis=1)].any():
        return ["masses are on held nodes alone: each step is an equilibrium; give nodes that move a mass"]
    if ts.getType() != "latin" or structure.geometry != "large" or np.all(structure.mass > 0.0):
        return []
    u, v = ts.getSolution2()[0], structure.create_vec()
    structure.residual(u, v)
    left = np.linalg.norm(np.where(structure.fixed, 0.0, structure.displacements(v)), axis=1)
    left[structure.mass > 0.0] = 0.0
    v.destroy()
    largest = max(np.abs(structure.tensions(u)).max(), np.linalg.norm(structure.load, axis=1).max())
    nodes = np.flatnonzero(left > UNBALANCED * largest)
    if not len(nodes):
        return []
    named = structure.node_names(nodes[:NAMED], len(nodes) > NAMED)
    return [
        f"nodes without mass start out of balance, by up to {quantity(left.max(), 'N')}, and swing about it for ever,"
        f" as nothing is damped: {named}; start from displacements in balance (--from-equilibrium), or give them"
        " a mass"
    ]


def _failed(ts, structure):
    """Return a sentence on a step that has not converged."""
    start, reason = ts.getTime(), ts.getSNES().getConvergedReason()
    end = quantity(start + ts.getTimeStep(), "s", 6)
    step = f"step {ts.getStepNumber() + 1}, from {quantity(start, 's', 6)} to {end}"
    cause = structure.counted_as_given(solvers.step_cause(ts))
    return (
        f"{step}, has not converged: {reason_name(PETSc.SNES.ConvergedReason, reason)}. {_idle(ts, structure)}{cause}"
    )


def _idle(ts, structure):
    """Return a sentence on nodes without mass whose links bear next to nothing where a step begins."""
    if structure.geometry != "large":  # elsewhere the cause names nodes that links do not hold
        return ""
    tensions = np.abs(structure.tensions(ts.getSolution2()[0]))
    idle = (structure.mass == 0.0) & ~structure.fixed.all(axis=1)
    idle[structure.links[tensions > UNBALANCED * tensions.max()]] = False
    nodes = np.flatnonzero(idle)
    if not len(nodes):
        return ""
    named = structure.some_nodes(nodes[:NAMED], len(nodes) > NAMED)
    return f"As it begins, links bear next to nothing at {named}, without mass: a small mass there helps. "
