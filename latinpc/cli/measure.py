"""Commands that measure: ``latinpc compare``, ``latinpc tradeoff`` and ``latinpc extremes``."""

from __future__ import annotations

import click
from petsc4py import PETSc

from latinpc.results.atomic import check_writable

from .arguments import Command, List
from .printing import print_table, progress, write_json
from .ranks import NOT_CONVERGED
from .scenes import SceneCommand, open_scene, scene_options

LOOKS = {"left": (0, -1), "bold": (0, "latin")}  # of tables with words in the first and the last column


def _ready(comm, scene, json_file, picture, options):
    """Refuse what cannot be written or run; open the scene."""
    if comm.size > 1:
        raise ValueError("this command starts its own processes: run it without mpirun, with --ranks")
    for path, suffixes in ((None if json_file == "-" else json_file, None), (picture, (".png", ".pdf", ".svg"))):
        if path is not None:
            check_writable(path, suffixes)
    return open_scene(scene, options, [json_file, picture])


@click.command(cls=SceneCommand)
@click.argument("scene", metavar="SCENE|FILE")
@scene_options
@click.option(
    "--methods",
    type=List(str, "latin,newton-mumps"),
    metavar="A,B,...",
    help="Methods of latinpc.bench.peers. Default: all that suit the scene.",
)
@click.option("--accuracy", type=float, default=1e-4, show_default=True, help="Relative l2 error to reach.")
@click.option(
    "--repeat", type=int, default=3, show_default=True, help="Timed runs of each method; the table shows medians."
)
@click.option("--ranks", type=int, default=1, show_default=True, help="MPI ranks of the PETSc methods.")
@click.option("--timeout", type=float, default=600.0, show_default=True, help="Limit for one process (s).")
@click.option("--against", type=click.Choice(["auto", "newton", "latin"]), default="auto", show_default=True,
              help="Method of the reference; auto: latin where Newton's method fails.")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the measurements; '-' prints them and nothing else.")
@click.option("--picture", metavar="FILE.png", help="Draw times and memory.")
@click.pass_obj
def compare(comm, scene, methods, accuracy, repeat, ranks, timeout, against, json_file, picture, **options):
    """Compare solvers on a scene: time, memory, error.

    Each run is a process of its own. Options with a single dash replace those of every PETSc method.
    """
    from latinpc.bench import compare as peers

    scene = _ready(comm, scene, json_file, picture, options)
    with progress(comm, json_file == "-") as say:
        document = peers.compare(
            scene, methods, accuracy, repeat, ranks, timeout, against,
            list(PETSc.Options().getAll().items()), say,
        )  # fmt: skip
    if json_file is not None:
        write_json(json_file, document)
    if picture is not None:
        from latinpc.bench.figures import bars

        bars(document, picture)
    if json_file != "-":
        title = f"{document['scene']}: {document['free_dofs']:,} free dofs, to a relative l2 error of {accuracy:g}"
        print_table(title, peers.layout(document), **LOOKS, note=document["note"] + peers.against(document))
    return 0 if all(row["converged"] for row in document["rows"] if row["method"] in peers.OURS) else NOT_CONVERGED


@click.command(cls=SceneCommand)
@click.argument("scene", metavar="SCENE|FILE")
@scene_options
@click.option(
    "--knobs",
    type=List(str, "variant,direction"),
    metavar="A,B,...",
    help="Groups of choices. Default: all of latinpc.bench.tradeoff.KNOBS.",
)
@click.option(
    "--accuracies",
    type=List(float, "1e-2,1e-4"),
    metavar="1e-2,1e-4,...",
    help="Relative l2 errors. Default: 1e-1 to 1e-10.",
)
@click.option("--repeat", type=int, default=3, show_default=True, help="Runs of each point; the table shows medians.")
@click.option("--timeout", type=float, default=180.0, show_default=True, help="Limit for one curve (s).")
@click.option("--json", "json_file", metavar="FILE", help="Write the measurements; '-' prints them and nothing else.")
@click.option("--picture", metavar="FILE.png", help="Draw time against error, one panel for each group.")
@click.pass_obj
def tradeoff(comm, scene, knobs, accuracies, repeat, timeout, json_file, picture, **options):
    """Measure the time for each accuracy, by method and by option."""
    from latinpc.bench import tradeoff as measure

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
        from latinpc.bench.figures import diagrams

        diagrams(document, picture)
    if json_file != "-":
        title = f"{document['scene']}: {document['free_dofs']:,} free dofs, time to a relative l2 error, with set-up"
        table, note = measure.layout(document), "The error is that of the displacements."
        if table[1][-1][0] == measure.UNBALANCE:
            note += f" Forces: {measure.DEFAULT.label} at the same accuracies."
        print_table(title, table, note=note, **LOOKS)
    ours = [curve for curve in document["curves"] if curve["label"] == measure.DEFAULT.label]
    return 0 if all(curve["points"] for curve in ours) else NOT_CONVERGED


def _random(comm, count, seed, family, json_file):
    """Solve random structures; print the rates, or write the outcomes."""
    from latinpc.bench.extremes import rates, turning
    from latinpc.bench.extremes.drawn import LARGE

    if family not in (None, *rates.FAMILIES):
        raise ValueError(f"--family {family}: choose from {', '.join(rates.FAMILIES)}")
    if json_file is not None and json_file != "-":
        check_writable(json_file, None)
    with progress(comm, json_file == "-") as say:
        document = rates.run(count, seed, PETSc.Options().getAll(), family, say)
    if json_file is not None:
        write_json(json_file, document)
    bad = [one for one in document["outcomes"] if one["verdict"] in rates.BAD]
    if json_file != "-":
        right = f"relative errors below {rates.SLACK * rates.ASKED:g}"
        if family in LARGE:
            right = f"unbalanced forces below {turning.UNBALANCED:g} of the loads, stable, on the path of the loads"
        title = f"{count:,} random structures, seed {seed}; right: {right}"
        numbers = ", ".join(f"{one['number']} ({one['verdict']})" for one in bad[:10])
        print_table(title, rates.layout(document), left=(0,), note=f"bad: {numbers}" if bad else "")
    return NOT_CONVERGED if bad else 0


@click.command(cls=Command)
@click.option("--group", "groups", multiple=True, metavar="NAME", help="Run this group only; may be repeated.")
@click.option("--random", "count", type=click.IntRange(1), metavar="N", help="Solve N random structures instead.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the random structures.")
@click.option("--family", metavar="NAME", help="Random structures of this family only.")
@click.option("--json", "json_file", metavar="FILE", help="Write the outcomes; '-' prints them and nothing else.")
@click.pass_obj
def extremes(comm, groups, count, seed, family, json_file):
    """Run the robustness suite, or solve random structures.

    Cases at extremes: stiffness contrasts, search directions, loads, prestress, units, origins, partitions, chains,
    ranks, rigid links, motions, matrices of finite elements. Each case runs in its own process and ends as right,
    refused (with a reason) or wrong. References are exact where possible.

    Random structures (--random) have the families statics, collapse (near the limit load), rigid, friction and motion.
    Loads go down to 1e-9 of what the stiffnesses bear, stiffness ratios up to 1e9. An equilibrium in 200 digits is the
    reference for displacements and tensions; with friction its existence may be unknown. The rate of solved
    structures counts those with an equilibrium.

    --family large draws structures with large displacements, held by prestress; --family cables those that are built:
    bridges, roofs, guyed masts, braced frames. An independent code checks balance, stability, and the path of
    equilibria from zero loads.
    """
    from latinpc.bench import extremes as catalogue

    if comm.size > 1:
        raise ValueError("this command starts its own processes: run it without mpirun")
    if count:
        if groups:
            raise ValueError("--group chooses cases of the suite; random structures have a --family")
        return _random(comm, count, seed, family, json_file)
    if family is not None or seed:
        raise ValueError("--family and --seed are of random structures: add --random N")
    chosen = catalogue.cases()
    known = list(dict.fromkeys(case.group for case in chosen))
    for group in groups:
        if group not in known:
            raise ValueError(f"--group {group}: choose from {', '.join(known)}")
    if json_file is not None and json_file != "-":
        check_writable(json_file, None)
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
