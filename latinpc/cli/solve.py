"""``latinpc solve``: solve or move a scene, write the results, print a summary."""

from __future__ import annotations

import math
import sys

import click
import numpy as np
from petsc4py import PETSc

from latinpc.files.history import read_history
from latinpc.files.text import nearest
from latinpc.options import preset_files, preset_options
from latinpc.results.atomic import check_readable, check_writable
from latinpc.results.cad import check_ezdxf
from latinpc.results.summary import summary, summary_of_motion
from latinpc.results.vtk import frames_folder, write_pvd, write_vtu
from latinpc.runs.checkpoint import Keeper
from latinpc.runs.history import History
from latinpc.runs.motion import move
from latinpc.runs.solve import solve
from latinpc.solvers import has_package, iterating

from .arguments import PRESETS
from .mechanism import mechanism_explained
from .printing import open_console, print_lines, progress, write_json
from .ranks import NOT_CONVERGED, on_root
from .scenes import SceneCommand, check_node_mass, open_scene, scene_options

#: Options of a run, not of the scene
RUN = (
    "reference", "digits", "num_steps", "time_step", "output_every", "node_mass", "increments", "checkpoint",
    "checkpoint_every", "restart", "from_equilibrium", "history",
)  # fmt: skip


@click.command("solve", cls=SceneCommand)
@click.argument("scene", metavar="SCENE|FILE")
@scene_options
@click.option("--reference", is_flag=True, help="Report errors against a solution by Newton's method.")
@click.option("--digits", is_flag=True, help="Report how many digits are accurate, and what limits them.")
@click.option("--json", "json_file", metavar="FILE", help="Write the report; '-' prints it and nothing else.")
@click.option(
    "--output", multiple=True, metavar="FILE",
    help="Write results for ParaView: .vtu, or .pvd for a motion; .dxf for CAD. May be repeated.",
)  # fmt: skip
@click.option("--picture", metavar="FILE", help="Draw the deformed structure: .png, .pdf, .svg, or .gif for a motion.")
@click.option("--html", metavar="FILE", help="Write an interactive figure for a browser: one .html file.")
@click.option(
    "--amplify", type=float, metavar="X", help="Amplification of displacements in pictures. Default: automatic."
)
@click.option(
    "--csv", nargs=2, metavar="MEMBERS NODES", help="Write members and nodes: two .csv files; of a motion, over time."
)
@click.option("--preset", type=click.Choice(sorted(preset_files())), metavar="NAME", help=PRESETS)
@click.option("--quiet", is_flag=True, help="Print only notices and errors.")
@click.option("-v", "--verbose", is_flag=True, help="Also print subdomains, norms, PETSc's types and reasons.")
@click.option("--num-steps", type=int, metavar="N", help="Make N time steps (-ts_type latin). The scene needs masses.")
@click.option("--time-step", type=float, metavar="H", help="Time step (s). Default: that of the scene.")
@click.option(
    "--from-equilibrium", is_flag=True, help="Start a motion from the equilibrium of the loads, not as drawn."
)
@click.option(
    "--history",
    metavar="FILE",
    help="Loads of a motion vary: a table (.csv) of time and factor. With --case: what acts in that case alone.",
)
@click.option(
    "--output-every", type=int, metavar="N", help="Write every Nth state of a motion. Default: about 100 in all."
)
@click.option("--node-mass", type=float, metavar="M", help="Mass of each node (kg), in place of the scene's.")
@click.option(
    "--increments", type=int, metavar="N", help="Apply loads and prescribed displacements in N equal increments."
)
@click.option("--checkpoint", metavar="FILE", help="Save the state after increments or steps (.h5, .hdf5: HDF5).")
@click.option("--checkpoint-every", type=int, metavar="N", help="Save every Nth of them. Default: 1.")
@click.option("--restart", metavar="FILE", help="Continue from a saved state, with the same options and ranks.")
@click.pass_obj
def solve_command(comm, scene, json_file, output, picture, html, amplify, csv, preset, quiet, verbose, **options):
    """Solve a scene or a file.

    The solver is -snes_type latin; with --num-steps it is -ts_type latin. Options with a single dash go to PETSc, for
    instance -snes_monitor -snes_latin_variant macro.
    """
    alone = json_file == "-"
    quiet = quiet or alone
    run = {name: options.pop(name) for name in RUN}
    _check(**run)
    moves = run["num_steps"] is not None
    run["options"] = None if preset is None else on_root(comm, preset_options, preset)
    keeper = _keeper(comm, run)
    _check_files(moves, (*output, picture, *(csv or ())), picture, html, amplify, run["output_every"])
    files = {"json": json_file, "output": output, "picture": picture, "html": html, "members": None, "nodes": None}
    files |= dict(zip(("members", "nodes"), csv or ()))
    scene, run["history"] = on_root(comm, _prepare, scene, moves, files, options, run)
    count = options.get("subdomains") if scene.subdomain is None else None
    if count is not None and count > len(scene.links):
        raise ValueError(f"--subdomains {count}: there are {len(scene.links)} links, at least one for each subdomain")
    monitored = any("monitor" in name for name in PETSc.Options().getAll())
    with progress(comm, quiet or monitored) as say:
        if moves:
            result = _move(scene, count, run, say, (*output, picture, *(csv or ())), keeper)
        else:
            with mechanism_explained(comm, scene, picture):
                result = _solve(scene, count, run, say, keeper)
    return _report(comm, result, files, amplify, (quiet, verbose))


def _check(
    reference, digits, num_steps, time_step, output_every, node_mass, increments, checkpoint, checkpoint_every, restart,
    from_equilibrium, history,
):  # fmt: skip
    """Refuse options that do not go together."""
    for value, name in (
        (time_step, "time-step"), (output_every, "output-every"), (node_mass, "node-mass"), (history, "history"),
        (from_equilibrium or None, "from-equilibrium"),
    ):  # fmt: skip
        if value is not None and num_steps is None:
            raise ValueError(f"--{name} is for a motion: give the number of steps with --num-steps")
    if node_mass is not None:
        check_node_mass(node_mass)
    if num_steps is not None:
        if reference:
            raise ValueError("--reference is for statics; compare motions with -snes_type newtonls")
        if digits:
            raise ValueError("--digits is for statics: leave out --num-steps")
        if increments is not None:
            raise ValueError("--increments is for statics: leave out --num-steps")
    elif (checkpoint or restart) and increments is None:
        raise ValueError("--checkpoint and --restart need --increments or --num-steps: states are saved between them")
    if checkpoint_every is not None and checkpoint is None:
        raise ValueError("--checkpoint-every needs the name of a file: --checkpoint FILE")


def _check_files(moves, files, picture, html, amplify, output_every):
    """Refuse options of files that do not go together."""
    if html is not None and moves:
        raise ValueError("--html is for statics: leave out --num-steps")
    if amplify is not None and picture is None and html is None:
        raise ValueError("--amplify is for pictures: give --picture or --html")
    if amplify is not None and not math.isfinite(amplify):
        raise ValueError(f"--amplify {amplify}: displacements are multiplied by a finite number")
    if output_every is not None and not _films(files):
        raise ValueError("--output-every is for the states of a motion: give --output FILE.pvd, a .gif or --csv")
    if output_every is not None and output_every < 1:
        raise ValueError(f"--output-every {output_every}: every Nth state is written, N at least 1")


def _films(files):
    """Return whether one of the files is of many states."""
    return any(path.lower().endswith((".pvd", ".gif", ".csv")) for path in files if path is not None)


def _keeper(comm, run):
    """Return what saves the states of a run; collective."""
    checkpoint, every, restart = run["checkpoint"], run["checkpoint_every"], run["restart"]
    if restart is not None:
        on_root(comm, check_readable, restart)
    if checkpoint is not None:
        on_root(comm, check_writable, checkpoint)
        if str(checkpoint).endswith(".gz"):
            raise ValueError(
                f"--checkpoint {checkpoint}: PETSc takes .gz files for compressed ones; use another suffix"
            )
        if str(checkpoint).lower().endswith((".h5", ".hdf5")) and not has_package("hdf5"):
            raise ValueError(
                f"--checkpoint {checkpoint}: this PETSc has no HDF5; use another suffix for PETSc's format"
            )
    return Keeper(comm, checkpoint, 1 if every is None else every, restart)


def _each(files):
    """Return (kind, path) of the files to be written."""
    pairs = [*files.items(), *(("output", path) for path in files["output"])]
    return [(kind, path) for kind, path in pairs if isinstance(path, str)]


def _prepare(scene, moves, files, options, run):
    """Open the scene and the history; refuse results that could not be written before any work is done; on one rank."""
    kinds = {
        "output": (".pvd", ".vtu") if moves else (".vtu", ".dxf"),
        "picture": (".gif", ".png", ".pdf", ".svg") if moves else (".png", ".pdf", ".svg"),
        "html": (".html",),
        "members": (".csv",),
        "nodes": (".csv",),
    }
    for kind, path in _each(files):
        if path != "-":
            check_writable(path, kinds.get(kind))
            check_ezdxf(path)
        if path.lower().endswith(".pvd"):
            frames_folder(path)
    history, checkpoint, restart = run["history"], run["checkpoint"], run["restart"]
    name = options.pop("case") if history is not None else None  # which acts besides the scene
    read = (history, None if restart == checkpoint else restart)  # a run may go on in its own file
    scene = open_scene(scene, options, [checkpoint, *(path for _, path in _each(files))], read)
    if history is not None:
        history = History(*read_history(history), _case_of(scene, name))
    if scene.velocity is not None and not moves:
        raise ValueError(f"{scene.name} moves: give the number of time steps with --num-steps")
    return scene, history


def _case_of(scene, name):
    """Return the load case of a name; None without one."""
    cases = {case.name: case for case in scene.cases}
    if name is not None and name not in cases:
        raise ValueError(f"--case {name}: {scene.name} has no load case of this name{nearest(name, cases)}")
    return cases.get(name)


def _solve(scene, subdomains, run, say, keeper):
    """Solve; show the iterations; collective."""
    if say is not None:
        say(f"{scene.name}: setting up")

    def monitor(_, iteration, norm):
        say(f"{scene.name}: iteration {iteration}, {norm:.2e}")

    return solve(
        scene,
        run["options"],
        subdomains=subdomains,
        reference=run["reference"],
        digits=run["digits"],
        increments=1 if run["increments"] is None else run["increments"],
        keeper=keeper,
        before_solve=None if say is None else lambda snes: iterating(snes).setMonitor(monitor),
    )


def _move(scene, subdomains, run, say, files, keeper):
    """Make the time steps; show them; collective."""

    def monitor(step, time):
        steps = f" of {run['num_steps']}" if step <= run["num_steps"] else ""  # shorter ones may take the place of some
        say(f"{scene.name}: step {step}{steps}, {time:.4g} s")

    return move(
        scene,
        run["num_steps"],
        run["time_step"],
        run["options"],
        subdomains=subdomains,
        mass=run["node_mass"],
        every=run["output_every"] if _films(files) else 0,
        keeper=keeper,
        each_step=None if say is None else monitor,
        from_equilibrium=run["from_equilibrium"],
        history=run["history"],
    )


def _report(comm, result, files, amplify, manner):
    """Write the files, print, and return the exit code; collective."""
    moves, (quiet, verbose) = hasattr(result, "frames"), manner
    on_root(comm, _write_motion if moves else _write, result, files, amplify)
    if comm.rank == 0:
        for notice in result.notices:
            print(f"latinpc: {notice}", file=sys.stderr)
        if not quiet:
            lines = (summary_of_motion if moves else summary)(result, verbose)
            written = [path for _, path in _each(files)]
            lines += [("written", ", ".join(written))] if written else []
            print_lines(open_console(), result.report["scene"], lines)
        if not result.converged:
            reason = result.report["reason"] if moves else result.reason
            print(f"latinpc: not converged: {reason}", file=sys.stderr)
    return 0 if result.converged else NOT_CONVERGED


def _write_motion(result, files, amplify):
    """Write the files; on one rank. When a step does not converge, the states before it are written."""
    last, picture = result.frames[-1], files["picture"]
    if files["json"] is not None:
        write_json(files["json"], result.report)
    for output in files["output"]:
        if output.lower().endswith(".pvd"):
            write_pvd(output, result)
        else:
            arrays = (last.displacements, last.tensions, result.subdomain, result.node_class, last.velocities)
            write_vtu(output, result.scene, *arrays)
    if files["members"] is not None:
        result.to_csv(files["members"], files["nodes"])
    if picture is not None and str(picture).lower().endswith(".gif"):
        from latinpc.results.film import draw_motion

        draw_motion(result, picture, amplify)
    elif picture is not None:
        from latinpc.results.pictures import draw_structure

        stamp = {} if result.converged else {"word": "NOT CONVERGED", "reason": result.report["reason"]}
        arrays = (last.displacements, last.tensions, result.subdomain)
        how = {"amplification": amplify, "geometry": result.scene.geometry, "load": last.load}
        draw_structure(result.scene, *arrays, picture, **how, **stamp)


def _write(result, files, amplify):
    """Write the files; on one rank. Without convergence the last iterate is written."""
    if files["json"] is not None:
        write_json(files["json"], result.to_dict())
    for output in files["output"]:
        (result.to_dxf if output.lower().endswith(".dxf") else result.to_vtu)(output)
    if files["members"] is not None:
        result.to_csv(files["members"], files["nodes"])
    for kind in ("picture", "html"):
        if files[kind] is None:
            continue
        if not (np.isfinite(result.displacements).all() and np.isfinite(result.tensions).all()):
            result.notices.append(f"{files[kind]} is not drawn: the last iterate is not finite")
        elif kind == "html":
            result.to_html(files[kind], amplify)
        else:
            from latinpc.results.drawing import save

            save(result.plot(amplification=amplify), files[kind])
