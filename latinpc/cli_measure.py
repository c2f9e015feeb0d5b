"""The commands that measure: ``latinpc compare``, ``latinpc tradeoff`` and ``latinpc extremes``."""

from __future__ import annotations

import click
from petsc4py import PETSc

from . import io
from .cli import NOT_CONVERGED, _open_scene, _scene_options, commands, write_json
from .printing import print_table, progress

LOOKS = {"left": (0, -1), "bold": (0, "latin")}  # of tables with words in the first and the last column


class _Words(click.ParamType):
    """A list of names or numbers, such as latin,newton-mumps."""

    name = "list"

    def __init__(self, kind=str):
        self.kind = kind

    def convert(self, value, param, ctx):
        try:
            return tuple(self.kind(word.strip()) for word in value.split(",") if word.strip())
        except ValueError:
            self.fail(f"{value!r} is not a list of numbers such as 1e-2,1e-4", param, ctx)


def _ready(comm, scene, json_file, picture, options):
    """Refuse what cannot be written or run, and open the scene."""
    if comm.size > 1:
        raise ValueError("this command starts its own processes: run it without mpirun, with --ranks")
    for path, suffixes in ((None if json_file == "-" else json_file, None), (picture, (".png", ".pdf", ".svg"))):
        if path is not None:
            io.check_writable(path, suffixes)
    return _open_scene(scene, options)


@commands.command()
@click.argument("scene", metavar="SCENE|FILE.msh")
@_scene_options
@click.option(
    "--methods", type=_Words(), metavar="A,B,...", help="By default all that suit the scene; see latinpc.peers.METHODS."
)
@click.option("--accuracy", type=float, default=1e-4, show_default=True, help="Relative l2 error to reach.")
@click.option("--repeat", type=int, default=3, show_default=True, help="Timed runs of each method; medians are shown.")
@click.option("--ranks", type=int, default=1, show_default=True, help="Ranks of the PETSc methods.")
@click.option("--timeout", type=float, default=600.0, show_default=True, help="Seconds that one process may take.")
@click.option("--against", type=click.Choice(["auto", "newton", "latin"]), default="auto", show_default=True,
              help="The reference; auto takes latin where Newton's method fails.")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the measurements; '-' prints them alone.")
@click.option("--picture", metavar="FILE.png", help="Draw times and memory.")
@click.pass_obj
def compare(comm, scene, methods, accuracy, repeat, ranks, timeout, against, json_file, picture, **options):
    """Solve a scene by several methods, each in a process of its own, and show times, memory and errors.

    Options with a single dash replace those of every PETSc method.
    """
    from . import compare as peers

    scene = _ready(comm, scene, json_file, picture, options)
    with progress(comm, json_file == "-") as say:
        document = peers.compare(
            scene, methods, accuracy, repeat, ranks, timeout, against,
            list(PETSc.Options().getAll().items()), say,
        )  # fmt: skip
    if json_file is not None:
        write_json(json_file, document)
    if picture is not None:
        from .figures import bars

        bars(document, picture)
    if json_file != "-":
        title = f"{document['scene']}: {document['free_dofs']:,} free dofs, to a relative l2 error of {accuracy:g}"
        print_table(title, peers.layout(document), **LOOKS, note=document["note"] + peers.against(document))
    return 0 if all(row["converged"] for row in document["rows"] if row["method"] in peers.OURS) else NOT_CONVERGED


@commands.command()
@click.argument("scene", metavar="SCENE|FILE.msh")
@_scene_options
@click.option("--knobs", type=_Words(), metavar="A,B,...", help="By default all; see latinpc.tradeoff.KNOBS.")
@click.option("--accuracies", type=_Words(float), metavar="1e-2,1e-4,...", help="By default 1e-1 to 1e-10.")
@click.option("--repeat", type=int, default=3, show_default=True, help="Runs of each point; medians are shown.")
@click.option("--timeout", type=float, default=180.0, show_default=True, help="Seconds that one curve may take.")
@click.option("--json", "json_file", metavar="FILE", help="Write the measurements; '-' prints them alone.")
@click.option("--picture", metavar="FILE.png", help="Draw time against error, one panel for each knob.")
@click.pass_obj
def tradeoff(comm, scene, knobs, accuracies, repeat, timeout, json_file, picture, **options):
    """Measure what accuracy costs, by method and by option: work-precision diagrams of a scene."""
    from . import tradeoff as measure

    scene = _ready(comm, scene, json_file, picture, options)
    accuracies = accuracies or measure.ACCURACIES
    if not all(0 < accuracy < 1 for accuracy in accuracies) or repeat < 1:
        raise ValueError("--accuracies lie between 0 and 1, and --repeat is at least 1")
    with progress(comm, json_file == "-") as say:
        document = measure.tradeoff(
            scene, knobs, sorted(accuracies, reverse=True), repeat, timeout,
            list(PETSc.Options().getAll().items()), say,
        )  # fmt: skip
    if json_file is not None:
        write_json(json_file, document)
    if picture is not None:
        from .figures import diagrams

        diagrams(document, picture)
    if json_file != "-":
        title = f"{document['scene']}: {document['free_dofs']:,} free dofs, time to a relative l2 error, with set-up"
        print_table(title, measure.layout(document), **LOOKS)
    ours = [curve for curve in document["curves"] if curve["label"] == measure.DEFAULT.label]
    return 0 if all(curve["points"] for curve in ours) else NOT_CONVERGED


@commands.command()
@click.option("--group", "groups", multiple=True, metavar="NAME", help="Only the cases of this group; may be repeated.")
@click.option("--json", "json_file", metavar="FILE", help="Write the outcomes; '-' prints them alone.")
@click.pass_obj
def extremes(comm, groups, json_file):
    """Drive the solver to its extremes, and tell what was right, refused or wrong.

    Stiffness contrasts, search directions, loads, prestress, units, origins, partitions, chains, ranks, rigid links,
    motions, matrices of finite elements: each case in a process of its own, its error against a solution in exact
    arithmetic where that is possible.
    """
    from . import extremes as catalogue

    if comm.size > 1:
        raise ValueError("this command starts its own processes: run it without mpirun")
    chosen = catalogue.cases()
    known = list(dict.fromkeys(case.group for case in chosen))
    for group in groups:
        if group not in known:
            raise ValueError(f"--group {group}: choose from {', '.join(known)}")
    if json_file is not None and json_file != "-":
        io.check_writable(json_file, None)
    chosen = [case for case in chosen if not groups or case.group in groups]
    with progress(comm, json_file == "-") as say:
        document = catalogue.run_all(chosen, say)
    if json_file is not None:
        write_json(json_file, document)
    if json_file != "-":
        counts = ", ".join(f"{count} {verdict}" for verdict, count in document["counts"].items() if count)
        title = (
            f"{len(chosen)} case{'s' if len(chosen) > 1 else ''}, to a relative l2 error of {document['accuracy']:g}"
        )
        share = f"of the cases with a solution {100 * (document['converged'] or 0):.0f} % are right"
        print_table(title, catalogue.layout(document), left=(0, 1, 2, -1), note=f"{counts}; {share}")
    return NOT_CONVERGED if any(document["counts"][verdict] for verdict in catalogue.BAD) else 0
