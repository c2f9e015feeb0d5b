"""Work and precision: the time that each method and each choice of options needs for an error from 1e-1 to 1e-10.

Every curve is one process: each point a whole solve, set-up included, stopped at the first iterate below the
accuracy, as in `latinpc.bench.compare`.
"""

from __future__ import annotations

import statistics
from dataclasses import dataclass, field, replace

from latinpc.scenes import make

from . import peers
from .compare import describe, suited
from .peers.launch import Bench, Failed

ACCURACIES = tuple(10.0**-k for k in range(1, 11))
UNBALANCE = "largest unbalance"  #: label of the last row, where displacements give the forces

_OUTER = "snes_latin_outer_snes_type"
_DEPTH = "snes_latin_outer_snes_anderson_m"
_COARSE = "snes_latin_coarse_"
_LOCAL = "snes_latin_local_"


@dataclass(frozen=True)
class Choice:
    """One curve: a method and options that replace its own.

    Parameters
    ----------
    label : str
    method : str
        One of `latinpc.bench.peers.METHODS`.
    options : dict
        PETSc options without the leading dash.
    block : int, optional
        Modules along a side of a subdomain, on the regular grids.
    """

    label: str
    method: str = "latin"
    options: dict = field(default_factory=dict)
    block: int | None = None


def _latin(label, **options):
    return Choice(label, options={f"snes_latin_{name}": value for name, value in options.items()})


DEFAULT = Choice("default")

#: Methods that are choices of a knob already, or that say nothing on one rank.
APART = ("latin-macro", "latin-rigid", "newton-bddc")

#: The knobs: each is a panel of the picture. Every one begins with the default.
KNOBS = {
    "methods": tuple(Choice(name, name) for name in peers.DEFAULT if name not in APART),
    "variant": (DEFAULT, _latin("macro", variant="macro"), _latin("none", variant="none"),
                _latin("published", variant="published"), _latin("rigid macro fields", modes="rigid")),
    "direction": (DEFAULT, _latin("schur / 2", direction_value=0.5), _latin("schur × 2", direction_value=2),
                  *(_latin(name, direction=name) for name in ("block", "diagonal", "scalar"))),
    "acceleration": (
        DEFAULT,
        *(Choice(f"anderson {m}", options={_OUTER: "anderson", _DEPTH: m}) for m in (5, 20, 30)),
        Choice("plain", options={_OUTER: "nrichardson"}),
        Choice("ngmres", options={_OUTER: "ngmres"}),
    ),
    "subdomain size": tuple(Choice(f"{b} × {b} modules", block=b) for b in (4, 2, 3, 6, 8)),
    "local and coarse solver": (
        DEFAULT,
        Choice("local mumps", options={f"{_LOCAL}pc_factor_mat_solver_type": "mumps"}),
        Choice("local petsc", options={f"{_LOCAL}pc_factor_mat_solver_type": "petsc"}),
        Choice("local cg, icc, 1e-6", options={f"{_LOCAL}ksp_type": "cg", f"{_LOCAL}ksp_rtol": 1e-6,
                                               f"{_LOCAL}pc_type": "icc"}),
        Choice("coarse cholmod", options={f"{_COARSE}pc_factor_mat_solver_type": "cholmod"}),
        *(Choice(f"coarse low rank {drop}", options={f"{_COARSE}mat_mumps_icntl_35": 2,
                                                     f"{_COARSE}mat_mumps_cntl_7": drop}) for drop in ("1e-6", "1e-3")),
        *(Choice(f"coarse cg, {pc}, 1e-2", options={f"{_COARSE}ksp_type": "cg", f"{_COARSE}ksp_rtol": 1e-2,
                                                    f"{_COARSE}pc_type": pc}) for pc in ("gamg", "icc")),
    ),
    "newton-latin": (
        DEFAULT, Choice("kept, 1e-2", "newton-latin"),
        *(Choice(f"kept, {rtol}", "newton-latin", {"ksp_rtol": rtol}) for rtol in ("1e-1", "1e-3")),
        Choice("built at each step, 1e-2", "newton-latin", {"snes_lag_preconditioner": 1}),
        Choice("Eisenstat-Walker", "newton-latin", {"snes_ksp_ew": 1, "snes_ksp_ew_version": 3}),
    ),
}  # fmt: skip


def knobs_of(scene, names=None):
    """Return the knobs that a scene has: those that change its partition are for the regular grids.

    Elsewhere METIS makes the subdomains, and their size is a number of links. Methods that do not take the geometry are
    left out.
    """
    unknown = [name for name in names or () if name not in KNOBS]
    if unknown:
        raise ValueError(f"unknown knob '{unknown[0]}': choose from {', '.join(KNOBS)}")
    knobs = {name: KNOBS[name] for name in names or KNOBS}
    if scene.geometry != "linear":
        known = {"latin", *suited(scene)}
        knobs = {name: tuple(choice for choice in knob if choice.method in known) for name, knob in knobs.items()}
        knobs = {name: knob for name, knob in knobs.items() if knob != (DEFAULT,)}
    size = "subdomain size"
    if size in knobs:
        modules = scene.metadata.get("modules") if scene.metadata.get("partition") == "regular" else None
        if modules:
            knobs[size] = tuple(choice for choice in KNOBS[size] if modules % choice.block == 0)
        elif scene.subdomain is None:
            sizes = (64, 128, 256, 512, 1024)
            counts = ((links, -(-len(scene.links) // links)) for links in sizes)
            knobs[size] = (DEFAULT, *(_latin(f"{links} links", subdomains=count) for links, count in counts))
        else:
            del knobs[size]
    return knobs


def _divided(scene, block):
    """Return the same regular grid with subdomains of that many modules along a side."""
    known = scene.metadata
    options = {key: known[key] for key in ("modules", "module")} | {"load": known["load_per_node"]}
    parts = make(scene.name, subdomains=(known["modules"] // block) ** 2, **options).subdomain
    return replace(scene, subdomain=parts)


def tradeoff(scene, knobs=None, accuracies=ACCURACIES, repeat=3, timeout=180.0, user_options=(), progress=None):
    """Measure the curves of a scene.

    Parameters
    ----------
    scene : Scene
    knobs : sequence of str, optional
        Names of `KNOBS`; all of them by default.
    accuracies : sequence of float
    repeat : int
        Runs of each point, of which the median is taken; those of a second and more are fewer.
    timeout : float
        For one curve (s).
    user_options : sequence of (str, str or None)
        PETSc options that replace those of the curves.
    progress : callable, optional
        Called with a sentence.

    Returns
    -------
    dict
        That of `latinpc.bench.compare.describe`, and accuracies, repeat, reference, and curves: each with knob, label,
        method, options, reason (of a failure) and points. A point has accuracy, setup_seconds, solve_seconds,
        peak_memory_bytes, iterations, error_l2, error_energy, error_tension (of the tensions, relative l2 norm),
        largest_unbalance (the largest unbalanced force on a node, N), and front: whether no point of any curve
        is both quicker and more accurate.
    """
    say = progress or (lambda text: None)
    knobs = knobs_of(scene, knobs)
    curves, known = [], {}
    with Bench(scene, timeout=timeout, user_options=user_options) as bench:
        say(f"{scene.name}: reference")
        about = bench.make_reference(min(accuracies))
        for knob, choices in knobs.items():
            for choice in choices:
                say(f"{scene.name}: {knob}, {choice.label}")
                block = choice.block if choice is not choices[0] else None  # the first is the default
                key = (choice.method, tuple(sorted(choice.options.items())), block)
                if key not in known:
                    known[key] = _curve(bench, scene, choice, block, accuracies, repeat)
                curves.append({"knob": knob, "label": choice.label, **known[key]})
    mark_front(curves)
    return {
        **describe(scene),
        "accuracies": list(accuracies),
        "repeat": repeat,
        "reference": about,
        "curves": curves,
    }


def _curve(bench, scene, choice, block, accuracies, repeat):
    curve = {"method": choice.method, "options": choice.options, "reason": None, "points": []}
    try:
        task = {"method": choice.method, "options": choice.options, "accuracies": list(accuracies)}
        if block is not None:
            task["scene"] = bench.add_scene(f"block{block}", _divided(scene, block))
        answer = bench.run(do="sweep", repeat=repeat, **task)
    except Failed as error:
        return curve | {"reason": str(error)}
    curve["points"] = [_point(point) for point in answer["points"]]
    return curve


def _point(point):
    runs = point["runs"]
    keys = (
        "setup_seconds", "solve_seconds", "peak_memory_bytes", "iterations", "error_l2", "error_energy",
        "error_tension", "largest_unbalance",
    )  # fmt: skip
    known = {key: [run[key] for run in runs if run[key] is not None] for key in keys}
    return {"accuracy": point["accuracy"]} | {key: statistics.median(x) if x else None for key, x in known.items()}


def seconds(point):
    """Return the time of a point, set-up included."""
    return point["setup_seconds"] + point["solve_seconds"]


def mark_front(curves):
    """Give every point its `front`: whether no point is both quicker and at least as accurate."""
    points = [point for curve in curves for point in curve["points"]]
    for point in points:
        point["front"] = not any(
            seconds(other) < seconds(point) and other["error_l2"] <= point["error_l2"] for other in points
        )


def layout(document):
    """Return the header and the rows of a table, as text: the quickest choice for each accuracy and knob."""
    from latinpc.results.units import quantity

    header, rows = ["knob", "choice", "memory", *(f"{accuracy:.0e}" for accuracy in document["accuracies"])], []
    for curve in document["curves"]:
        at = {point["accuracy"]: quantity(seconds(point), "s") for point in curve["points"]}
        memory = max((point["peak_memory_bytes"] for point in curve["points"]), default=None)
        cells = [curve["knob"], curve["label"], quantity(memory, "B") if memory else "-"]
        cells += [at.get(accuracy, "-") for accuracy in document["accuracies"]]
        rows.append([*cells[:-1], f"{cells[-1]}  {curve['reason']}"] if curve["reason"] else cells)
    return header, rows + _forces(document)


def _forces(document):
    """Return rows on what the default leaves of the forces at each accuracy of the displacements."""
    from latinpc.results.units import quantity

    curve = next((curve for curve in document["curves"] if curve["label"] == DEFAULT.label), document["curves"][0])
    at = {point["accuracy"]: point for point in curve["points"]}
    rows = []
    for label, key, text in (
        ("error of the tensions", "error_tension", "{:.0e}".format),
        (UNBALANCE, "largest_unbalance", lambda value: quantity(value, "N")),
    ):
        found = [at.get(accuracy, {}).get(key) for accuracy in document["accuracies"]]
        if any(value is not None for value in found):  # displacements alone do not give the forces of rigid links
            rows.append([label, curve["label"], "", *("-" if value is None else text(value) for value in found)])
    return rows
