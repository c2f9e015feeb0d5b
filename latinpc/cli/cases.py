"""``latinpc cases``: solve all load cases of a file on one set-up; a table, the envelope, a picture of it."""

from __future__ import annotations

import sys
import warnings

import click

from latinpc.options import preset_files, preset_options
from latinpc.results.atomic import check_writable
from latinpc.results.caselist import HEADER, extremes, rows, title
from latinpc.results.notices import LatinWarning
from latinpc.results.units import quantity
from latinpc.runs.cases import failed, solve_cases

from .arguments import PRESETS
from .mechanism import mechanism_explained
from .printing import open_console, print_lines, print_table, progress, write_json
from .ranks import NOT_CONVERGED, on_root
from .scenes import SceneCommand, file_options, open_scene


@click.command("cases", cls=SceneCommand)
@click.argument("scene", metavar="FILE")
@file_options
@click.option("--json", "json_file", metavar="FILE", help="Write the report; '-' prints it and nothing else.")
@click.option("--csv", "csv_file", metavar="FILE.csv", help="Write lowest and highest force of each link, slack cases.")
@click.option("--reactions", metavar="FILE.csv", help="Write the reactions of each case, lowest and highest.")
@click.option("--picture", metavar="FILE.png", help="Draw the envelope: greatest tension, greatest compression.")
@click.option("--subdomains", type=int, metavar="N", help="Number of subdomains.")
@click.option("--preset", type=click.Choice(sorted(preset_files())), metavar="NAME", help=PRESETS)
@click.option("--quiet", is_flag=True, help="Print only notices and errors.")
@click.pass_obj
def cases(comm, scene, json_file, csv_file, reactions, picture, preset, quiet, **options):
    """Solve the load cases of a file.

    The tables [[case]] of its TOML file define them. All cases share one set-up; slack links are found for each case.
    The exit code is 0 when all cases have converged.
    """
    alone = json_file == "-"
    quiet = quiet or alone
    settings = None if preset is None else on_root(comm, preset_options, preset)
    files = ((None if alone else json_file, None), (csv_file, (".csv",)), (reactions, (".csv",)))
    files += ((picture, (".png", ".pdf", ".svg")),)
    scene = on_root(comm, _prepare, scene, files, options)
    with progress(comm, quiet) as say, warnings.catch_warnings():
        warnings.simplefilter("ignore", LatinWarning)  # notices are printed in the end
        with mechanism_explained(comm, scene):
            result = solve_cases(
                scene,
                options=settings,
                subdomains=options["subdomains"] if scene.subdomain is None else None,
                each_case=None if say is None else lambda number, name: say(f"{scene.name}: case {number + 1}, {name}"),
            )
    on_root(comm, _write, result, json_file, csv_file, reactions, picture)
    if comm.rank == 0:
        for notice in result.notices:
            print(f"latinpc: {notice}", file=sys.stderr)
        if not quiet:
            _print(result, [path for path, _ in files if path is not None])
        if not result.converged:
            print(f"latinpc: not converged: {'; '.join(failed(result))}", file=sys.stderr)
    return 0 if result.converged else NOT_CONVERGED


def _prepare(scene, files, options):
    """Refuse results that could not be written, and open the scene; on one rank."""
    for path, suffixes in files:
        if path is not None:
            check_writable(path, suffixes)
    if options["case"] is not None:
        raise ValueError("--case is for latinpc solve; latinpc cases solves all")
    return open_scene(scene, options, [path for path, _ in files])


def _write(result, json_file, csv_file, reactions, picture):
    """Write the files; on one rank."""
    if json_file is not None:
        write_json(json_file, result.to_dict())
    if csv_file is not None or reactions is not None or picture is not None:
        from latinpc.results.envelope import draw_envelope, write_envelope, write_reactions

        if csv_file is not None:
            write_envelope(csv_file, result)
        if reactions is not None:
            write_reactions(reactions, result)
        if picture is not None and result.good.any():
            draw_envelope(result, picture)


def _print(result, written):
    """Print the table of the cases, and the envelope."""
    print_table(title(result), (list(HEADER), rows(result)), left=(0, -1))
    lines = [*extremes(result), ("time", f"one set-up and all solves {quantity(result.report['seconds'], 's')}")]
    lines += [("written", ", ".join(map(str, written)))] if written else []
    print_lines(open_console(), "envelope", lines)
