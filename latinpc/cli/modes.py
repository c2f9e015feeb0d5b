"""``latinpc modes``: natural frequencies and buckling factors of a solved scene; a table, pictures, files."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace

import click
import numpy as np

import latinpc
from latinpc.results.atomic import check_writable
from latinpc.results.units import counted
from latinpc.runs.solve import solve

from .mechanism import mechanism_explained
from .printing import open_console, print_lines, print_table, progress, write_json
from .ranks import NOT_CONVERGED, on_root
from .scenes import SceneCommand, check_node_mass, open_scene, scene_options


@click.command("modes", cls=SceneCommand)
@click.argument("scene", metavar="SCENE|FILE")
@scene_options
@click.option("--number", type=int, default=6, show_default=True, metavar="N", help="Number of modes, the lowest ones.")
@click.option("--buckling", is_flag=True, help="Factors of the loads, not frequencies (-snes_latin_geometry large).")
@click.option("--drawn", is_flag=True, help="Modes of the structure as drawn, without loads; nothing is solved.")
@click.option("--node-mass", type=float, metavar="M", help="Mass of each node (kg), in place of the scene's.")
@click.option("--json", "json_file", metavar="FILE", help="Write the table; '-' prints it and nothing else.")
@click.option("--output", metavar="FILE.vtu", help="Write the shapes for ParaView.")
@click.option("--picture", metavar="FILE", help="Draw the modes, at most nine: .png, .pdf or .svg.")
@click.option("--gif", metavar="FILE.gif", help="Write a period of one mode as an animation.")
@click.option("--mode", type=int, metavar="N", help="The mode of --gif, counted from 1. Default: 1.")
@click.option("--quiet", is_flag=True, help="Print only notices and errors.")
@click.pass_obj
def modes(comm, scene, number, buckling, drawn, node_mass, json_file, output, picture, gif, mode, quiet, **options):
    """Compute natural frequencies or buckling factors.

    Small motions, or linear buckling, of a scene or a file under its loads.

    The state is solved for first, then SLEPc computes the modes at its tangent stiffness, in which slack cables have no
    part. Options with a single dash go to PETSc: -snes_latin_geometry large for structures that prestress holds,
    -modes_eps_tol and its like for SLEPc. The exit code is 0 when the state and all modes have converged.
    """
    alone = json_file == "-"
    quiet = quiet or alone
    if mode is not None and gif is None:
        raise ValueError("--mode is for animations: give --gif")
    mode = 1 if mode is None else mode
    files = {"json": None if alone else json_file, "output": output, "picture": picture, "gif": gif}
    if buckling and node_mass is not None:
        raise ValueError("--node-mass is for frequencies: leave out --buckling")
    if drawn and not buckling:
        on_root(comm, _refuse_loads, scene, options)
    scene = on_root(comm, _prepare, scene, node_mass, files, number, mode, options)
    with progress(comm, quiet) as say:
        if say is not None:
            say(f"{scene.name}: solving, then {number} modes")
        with mechanism_explained(comm, scene), warnings.catch_warnings():
            warnings.simplefilter("ignore", latinpc.LatinWarning)  # notices are printed in the end
            converged, found = _compute(scene, number, buckling, drawn, options)
    on_root(comm, _write, found, files | {"json": json_file}, mode)
    if comm.rank == 0:
        for notice in found.notices:
            print(f"latinpc: {notice}", file=sys.stderr)
        if not quiet:
            _print(found, [path for kind, path in files.items() if path is not None and (kind == "json" or len(found))])
        if not converged:
            print("latinpc: not converged: the modes are those of the last iterate", file=sys.stderr)
    return 0 if converged and found.complete else NOT_CONVERGED


def _prepare(name, node_mass, files, number, mode, options):
    """Refuse results that could not be written, and open the scene; on one rank."""
    kinds = {"output": (".vtu",), "picture": (".png", ".pdf", ".svg"), "gif": (".gif",)}
    for kind, path in files.items():
        if path is not None:
            check_writable(path, kinds.get(kind))
    if number < 1:
        raise ValueError(f"--number {number}: at least one mode is asked for")
    if not 1 <= mode <= number:
        raise ValueError(f"--mode {mode}: choose one of the modes from 1 to {number}")
    scene = open_scene(name, options, files.values())
    if node_mass is None:
        return scene
    check_node_mass(node_mass)
    return replace(scene, mass=np.full(len(scene.nodes), node_mass))


def _refuse_loads(name, options):
    """Refuse a load case of loads alone, which frequencies as drawn do not have; on one rank."""
    if options["case"] is not None:
        cases = {case.name: case.parts for case in open_scene(name, options | {"case": None}).cases}
        if not any(part is not None for part in cases.get(options["case"], (None, True))[1:]):
            raise ValueError(
                f"--case {options['case']}: it has loads alone, and --drawn is without loads; leave one out"
            )


def _compute(scene, number, buckling, drawn, options):
    """Return whether the state has converged, and its modes; collective."""
    try:
        if drawn:
            structure = latinpc.Structure.from_scene(scene)
            return True, latinpc.modes(structure, number, buckling=buckling)
        state = solve(scene, subdomains=options["subdomains"] if scene.subdomain is None else None)
        found = state.modes(number, buckling=buckling)
        found.notices = [*state.notices, *found.notices]
        return state.converged, found
    except ImportError as error:
        raise ValueError(str(error)) from error


def _write(found, files, mode):
    """Write the files; on one rank."""
    if files["gif"] is not None and mode > max(len(found), 1):
        raise ValueError(f"--mode {mode}: there are only {len(found)} modes")
    if files["json"] is not None:
        write_json(files["json"], found.to_dict())
    if not len(found):
        return
    if files["output"] is not None or files["picture"] is not None:
        from latinpc.results.drawing import save
        from latinpc.results.vtk import write_modes

        if files["output"] is not None:
            write_modes(files["output"], found)
        if files["picture"] is not None:
            save(found.plot(), files["picture"])
    if files["gif"] is not None:
        found.animate(files["gif"], mode - 1)


def _print(found, written):
    """Print the table of modes."""
    header = ["mode", "load factor" if found.buckling else "frequency", "nodes that move most"]
    rows = [
        [str(mode + 1), found.label(mode).removeprefix("factor "), found.structure.node_names(found.movers(mode))]
        for mode in range(len(found))
    ]
    kind = "buckling" if found.buckling else "vibration"
    unknowns, slack = counted(found.structure.sizes.free_dofs, "unknown"), counted(int(found.slack.sum()), "link")
    title = f"{found.structure.name}: modes of {kind}, {unknowns}, {slack} slack"
    if rows:
        print_table(title, (header, rows), left=(-1,))
    if written:
        print_lines(open_console(), "files", [("written", ", ".join(map(str, written)))])
