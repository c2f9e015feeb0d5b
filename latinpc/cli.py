"""The command line: ``latinpc scenes | solve | paper | compare | tradeoff | extremes | info``.

A double dash is ours; a single dash is PETSc's and goes to its options database untouched. Under ``mpirun``
only rank 0 prints and writes. Exit codes: 0 converged, 1 not converged, 2 bad input.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import pathlib
import re
import signal
import sys
import time
import traceback

import click
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from rich.markup import escape

import latinpc

from . import io
from .checkpoint import Interrupted, Keeper
from .printing import open_console, print_lines, print_table, progress, summary, summary_of_motion
from .scenes import SCENES, make
from .solvers import has_package

NOT_CONVERGED, BAD_INPUT = 1, 2
GATHERING_SECONDS = 10.0  # how long a rank that failed waits for the others to fail too


# ---- PETSc's share of the command line -------------------------------------------------------


def is_petsc_option(token):
    """Tell a PETSc option (a dash and a letter) from ours (two dashes) and from a negative number."""
    return len(token) > 1 and token[0] == "-" and token[1].isalpha()


def split_arguments(arguments):
    """Separate our arguments from PETSc's.

    As in PETSc, the word after an option is its value unless it is an option itself.

    Returns
    -------
    ours : list of str
    petsc : list of (str, str or None)
        Name without the dash, and value.
    """
    ours, petsc, position = [], [], 0
    while position < len(arguments):
        token = arguments[position]
        position += 1
        if not is_petsc_option(token):
            ours.append(token)
            continue
        value = None
        if position < len(arguments):
            following = arguments[position]
            if not is_petsc_option(following) and not following.startswith("--"):
                value = following
                position += 1
        petsc.append((token[1:], value))
    return ours, petsc


def insert_petsc_options(options):
    """Put options into PETSc's database; PETSc is initialised already, so logging is started by hand."""
    database = PETSc.Options()
    for name, value in options:
        if name == "options_file":
            if not value or not pathlib.Path(value).is_file():
                raise FileNotFoundError(f"-options_file {value or ''}: no such file")
            database.insertString(f"-options_file {value}")
        else:
            database.setValue(name, value)
    if any(name.startswith("log_view") for name, _ in options):
        PETSc.Log.begin()


# ---- several ranks ---------------------------------------------------------------------------


def on_root(comm, function, *arguments, **named):
    """Call a function on rank 0; every rank gets its result, or raises its error. Collective."""
    outcome = None
    if comm.rank == 0:
        try:
            outcome = (function(*arguments, **named), None)
        except Exception as error:  # whatever it is, the other ranks must not wait for a result
            outcome = (None, error)
    value, error = comm.bcast(outcome)
    if error is not None:
        raise error
    return value


def _gather_or_abort(comm, sentence):
    """Wait until every rank has failed as this one has; end the run when some have not."""
    if comm.size == 1:
        return
    request, deadline = comm.Ibarrier(), time.monotonic() + GATHERING_SECONDS
    while not request.Test():
        if time.monotonic() > deadline:
            print(f"latinpc: rank {comm.rank}: {sentence}", file=sys.__stderr__, flush=True)
            comm.Abort(BAD_INPUT)
        time.sleep(0.01)


@contextlib.contextmanager
def _printing_on(root):
    """Silence Python's output on the other ranks."""
    if root:
        yield
        return
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        yield


def _sentence(error):
    """Return one readable line for an error."""
    text = latinpc.error_message(error) if isinstance(error, PETSc.Error) else str(error)
    if isinstance(error, OSError) and error.filename:
        text = f"{error.filename}: {error.strerror}"
    return " ".join(text.split()) or type(error).__name__


def main(arguments=None):
    """Run the command line; collective. Returns nothing: it leaves by `sys.exit`."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends us quietly, not by PETSc's handler
    ours, petsc = split_arguments(sys.argv[1:] if arguments is None else list(arguments))
    comm = MPI.COMM_WORLD.Dup()  # of our own, so that waiting after an error meets no other message
    with _printing_on(comm.rank == 0):
        code = _run(comm, ours, petsc)
        sys.stdout.flush()
    sys.exit(code)


def _run(comm, ours, petsc):
    try:
        insert_petsc_options(petsc)
        return commands.main(args=ours, prog_name="latinpc", standalone_mode=False, obj=comm) or 0
    except click.ClickException as error:
        error.show()
        if isinstance(error, click.MissingParameter) and any(value for _, value in petsc):
            click.echo("A word after a PETSc option is its value: put SCENE before the options.", err=True)
        return BAD_INPUT
    except (click.Abort, KeyboardInterrupt):
        return 130
    except Interrupted as error:
        print(f"latinpc: {error}", file=sys.stderr)
        return error.code
    except Exception as error:
        expected = isinstance(error, (ValueError, OSError, RuntimeError, MemoryError, PETSc.Error))
        text = _sentence(error)
        print(f"latinpc: {text}" if expected else traceback.format_exc(), file=sys.stderr)
        _gather_or_abort(comm, text)
        return BAD_INPUT


# ---- commands --------------------------------------------------------------------------------


@click.group(context_settings={"help_option_names": ["--help"]})
@click.version_option(latinpc.__version__, prog_name="latinpc")
def commands():
    """Structures of bars and cables by the multiscale LATIN method, as a PETSc solver.

    Options with a double dash are latinpc's; those with a single dash are PETSc's, such as -snes_monitor,
    -snes_type newtonls or -snes_latin_variant macro; -help lists them.
    """


def _parameters(generator):
    """Return (name, kind, default, help) of the options of a scene, from its signature and docstring."""
    documentation = inspect.getdoc(generator) or ""
    found = []
    for name, parameter in inspect.signature(generator).parameters.items():
        kind = next((kind for kind in (int, float, bool) if str(parameter.annotation).startswith(kind.__name__)), str)
        match = re.search(rf"^{name} : .*\n((?:    .*\n?)+)", documentation, re.MULTILINE)
        text = " ".join(match.group(1).split()) if match else ""
        found.append((name, kind, parameter.default, re.split(r"(?<=[.;]) |; ", text)[0].rstrip(".;")))
    return found


def _scene_options(command):
    """Give a command one option for each parameter of any scene."""
    merged = {}
    for name, generator in SCENES.items():
        for parameter, kind, _, text in _parameters(generator):
            merged.setdefault(parameter, (kind, text, []))[2].append(name)
    for parameter, (kind, text, names) in reversed(merged.items()):
        where = "" if len(names) == len(SCENES) else f"  [{', '.join(names)}]"
        option = click.option(f"--{parameter.replace('_', '-')}", parameter, type=kind, help=text + where)
        command = option(command)
    return command


@commands.command()
@click.pass_obj
def scenes(comm):
    """List the scenes and their options."""
    console, known = open_console(), {}
    for name, generator in SCENES.items():
        console.print(f"[bold]{name}[/bold]  {escape(inspect.getdoc(generator).splitlines()[0])}")
        for parameter, _, default, text in _parameters(generator):
            text = known[parameter] = text or known.get(parameter, "")  # a twin scene refers to its sibling
            said = "" if default is None else f" (default {default})"
            console.print(f"  [cyan]--{parameter.replace('_', '-'):<13}[/cyan]{escape(text + said)}")
    console.print("Or a Gmsh file, NAME.msh, with NAME.toml beside it.")


def _open_scene(name, options):
    """Read or make the scene; on one rank."""
    if name.lower().endswith(".msh") or (name not in SCENES and os.path.exists(name)):
        given = [key for key, value in options.items() if value is not None and key != "subdomains"]
        if given:
            raise ValueError(f"--{given[0].replace('_', '-')} has no meaning for a file")
        return io.read_scene(name)
    if name not in SCENES:
        known = ", ".join(SCENES)
        raise ValueError(f"unknown scene '{name}': choose from {known}, or give a Gmsh file NAME.msh")
    known = inspect.signature(SCENES[name]).parameters
    given = {key: value for key, value in options.items() if value is not None}
    for key in given:
        if key not in known and key != "subdomains":
            takes = ", ".join(f"--{other.replace('_', '-')}" for other in known)
            raise ValueError(f"--{key.replace('_', '-')} has no meaning for the scene {name}, which takes {takes}")
    return make(name, **{key: value for key, value in given.items() if key in known})


def _prepare(scene, json_file, output, picture, options):
    """Open the scene and refuse results that could not be written, before any work is done; on one rank."""
    moves = options.pop("steps", None) is not None
    kinds = ((".pvd", ".vtu"), (".gif", ".png", ".pdf", ".svg")) if moves else ((".vtu",), (".png", ".pdf", ".svg"))
    for path, suffixes in ((json_file, None), *zip((output, picture), kinds)):
        if path is not None:
            io.check_writable(path, suffixes)
    scene = _open_scene(scene, options)
    if scene.velocity is not None and not moves:
        raise ValueError(f"{scene.name} moves: say for how many steps with --steps")
    return scene


def write_json(path, report):
    """Write a report, whole or not at all; '-' prints it."""
    text = json.dumps(report, indent=2, allow_nan=False) + "\n"
    if str(path) == "-":
        click.echo(text, nl=False)
        return
    with io.atomic(path) as temporary:
        pathlib.Path(temporary).write_text(text, encoding="utf-8")


@commands.command("solve")
@click.argument("scene", metavar="SCENE|FILE.msh")
@_scene_options
@click.option("--reference", is_flag=True, help="Compute a reference by Newton's method, and the errors.")
@click.option("--digits", is_flag=True, help="Tell how many digits of the displacements are right, and why.")
@click.option("--json", "json_file", metavar="FILE", help="Write the report; '-' prints it alone.")
@click.option("--output", metavar="FILE", help="Write for ParaView: a .vtu file, of a motion also a .pvd.")
@click.option(
    "--picture", metavar="FILE", help="Draw the deformed structure: .png, .pdf or .svg, of a motion also .gif."
)
@click.option("--quiet", is_flag=True, help="Print nothing but notices.")
@click.option(
    "--steps", type=int, metavar="N", help="Make N time steps with -ts_type latin; the scene must have masses."
)
@click.option("--step", type=float, metavar="H", help="Length of a step (s); by default what the scene suggests.")
@click.option("--every", type=int, metavar="N", help="Write a state each N steps; by default a hundred of them.")
@click.option("--node-mass", type=float, metavar="M", help="Mass of each node (kg), for a scene that has none.")
@click.option("--increments", type=int, metavar="N", help="Let the loads grow in N equal increments.")
@click.option("--checkpoint", metavar="FILE", help="Keep the state after increments or steps; *.h5, *.hdf5: in HDF5.")
@click.option("--checkpoint-every", type=int, metavar="N", help="Write it after each N of them (default 1).")
@click.option("--restart", metavar="FILE", help="Go on from a state, with the options and ranks that it had.")
@click.pass_obj
def solve_command(
    comm, scene, reference, digits, json_file, output, picture, quiet, steps, step, every, node_mass, increments,
    checkpoint, checkpoint_every, restart, **options
):  # fmt: skip
    """Solve a scene or a Gmsh file, by default with -snes_type latin; with --steps, move it with -ts_type latin.

    Options with a single dash go to PETSc, for instance -snes_monitor -snes_latin_variant macro.
    """
    from .solve import solve

    alone = json_file == "-"
    quiet = quiet or alone
    for value, name in ((step, "step"), (every, "every"), (node_mass, "node-mass")):
        if value is not None and steps is None:
            raise ValueError(f"--{name} is for a motion: say for how many steps with --steps")
    if reference and steps is not None:
        raise ValueError("--reference is for statics; compare motions with -snes_type newtonls")
    if digits and steps is not None:
        raise ValueError("--digits is for statics: leave out --steps")
    keeper = _keeper(comm, steps, increments, checkpoint, checkpoint_every, restart)
    scene = on_root(comm, _prepare, scene, None if alone else json_file, output, picture, options | {"steps": steps})
    count = options.get("subdomains") if scene.subdomain is None else None
    if count is not None and not 1 <= count <= len(scene.links):
        raise ValueError(f"--subdomains {count}: there are {len(scene.links)} links, at least one for each subdomain")
    monitored = any("monitor" in name for name in PETSc.Options().getAll())
    if steps is not None:
        with progress(comm, quiet or monitored) as say:
            result = _move(scene, steps, step, count, node_mass, every, say, output, picture, keeper)
        return _report(comm, result, _write_motion, summary_of_motion, json_file, output, picture, quiet)
    with progress(comm, quiet or monitored) as say:
        if say is not None:
            say(f"{scene.name}: setting up")
        result = solve(
            scene,
            subdomains=count,
            reference=reference,
            digits=digits,
            increments=1 if increments is None else increments,
            keeper=keeper,
            before_solve=None if say is None else lambda snes: snes.setMonitor(
                lambda _, iteration, norm: say(f"{scene.name}: iteration {iteration}, {norm:.2e}")
            ),
        )  # fmt: skip
    return _report(comm, result, _write, summary, json_file, output, picture, quiet)


def _keeper(comm, steps, increments, checkpoint, every, restart):
    """Return what keeps the states of a run, after a look at its options."""
    if increments is not None and steps is not None:
        raise ValueError("--increments is for statics: a motion goes by --steps")
    if (checkpoint or restart) and steps is None and increments is None:
        raise ValueError("a state is kept between load increments or time steps: ask for --increments or --steps")
    if every is not None and checkpoint is None:
        raise ValueError("--checkpoint-every needs the name of a file: --checkpoint FILE")
    if checkpoint is not None:
        on_root(comm, io.check_writable, checkpoint)
        if str(checkpoint).lower().endswith((".h5", ".hdf5")) and not has_package("hdf5"):
            raise ValueError(
                f"--checkpoint {checkpoint}: this PETSc has no HDF5; another name makes a file in PETSc's own format"
            )
    return Keeper(comm, checkpoint, 1 if every is None else every, restart)


def _report(comm, result, write, summary, json_file, output, picture, quiet):
    """Write the files asked for, print, and return the exit code."""
    on_root(comm, write, result, json_file, output, picture)
    if comm.rank == 0:
        for notice in result.notices:
            print(f"latinpc: {notice}", file=sys.stderr)
        if not quiet:
            lines = summary(result)
            written = [str(path) for path in (json_file, output, picture) if path is not None]
            print_lines(
                open_console(), result.scene.name, lines + ([("written", ", ".join(written))] if written else [])
            )
        if not result.converged:
            print(f"latinpc: not converged: {result.report['reason']}", file=sys.stderr)
    return 0 if result.converged else NOT_CONVERGED


def _move(scene, steps, step, count, node_mass, every, say, output, picture, keeper):
    from .motion import move

    films = any(str(path).lower().endswith((".pvd", ".gif")) for path in (output, picture) if path is not None)
    return move(
        scene,
        steps,
        step,
        subdomains=count,
        mass=node_mass,
        every=every if films else 0,
        keeper=keeper,
        each_step=None if say is None else lambda k, t: say(f"{scene.name}: step {k} of {steps}, {t:.4g} s"),
    )


def _write_motion(result, json_file, output, picture):
    """Write the files asked for; on one rank. What was reached is kept when a step does not converge."""
    last = result.frames[-1]
    if json_file is not None:
        write_json(json_file, result.report)
    if output is not None and str(output).lower().endswith(".pvd"):
        io.write_pvd(output, result)
    elif output is not None:
        arrays = (last.displacements, last.tensions, result.subdomain, result.node_class, last.velocities)
        io.write_vtu(output, result.scene, *arrays)
    if picture is not None:
        from .pictures import draw_motion, draw_structure

        if str(picture).lower().endswith(".gif"):
            draw_motion(result, picture)
        else:
            draw_structure(result.scene, last.displacements, last.tensions, result.subdomain, picture)


def _write(result, json_file, output, picture):
    """Write the files asked for; on one rank. The last iterate is kept when there is no convergence."""
    if json_file is not None:
        write_json(json_file, result.report)
    if output is not None:
        io.write_vtu(output, result.scene, result.displacements, result.tensions, result.subdomain, result.node_class)
    if picture is not None:
        from .pictures import draw_structure

        if np.isfinite(result.displacements).all() and np.isfinite(result.tensions).all():
            draw_structure(result.scene, result.displacements, result.tensions, result.subdomain, picture)
        else:
            result.notices.append(f"{picture} is not drawn: the last iterate is not finite")


class _Sizes(click.ParamType):
    """A list of whole numbers, such as 9,16,25."""

    name = "numbers"

    def convert(self, value, param, ctx):
        try:
            return tuple(int(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not a list of whole numbers such as 9,16,25", param, ctx)


@commands.command()
@click.argument("what", type=click.Choice(["3", "4", "5", "6", "7", "fig8", "fig9"]))
@click.option("--subdomains", type=_Sizes(), help="Sizes, squares such as 9,16,25; by default the article's.")
@click.option("--json", "json_file", metavar="FILE", help="Write ours and the article's; '-' prints them alone.")
@click.option("--picture", metavar="FILE.png", help="Where to draw a figure (default fig8.png, fig9.png).")
@click.option("--outer", type=click.Choice(["richardson", "anderson"]), default="richardson", show_default=True,
              help="The article's plain iteration, or its acceleration.")  # fmt: skip
@click.option("--corners", type=click.Choice(["free", "published"]), default="free", show_default=True,
              help="'published' keeps micro springs on corner nodes, as in equation (28).")  # fmt: skip
@click.option("--direction", type=float, metavar="D",
              help="Search direction in N/m, 0 for self-tuned (default 7e6; self-tuned with anderson).")  # fmt: skip
@click.pass_obj
def paper(comm, what, subdomains, json_file, picture, outer, corners, direction):
    """Compute a table or a figure of the article, and show it beside the article's."""
    from . import paper as article

    alone = json_file == "-"
    is_figure = what.startswith("fig")
    if is_figure and picture is None:
        picture = f"{what}.png"
    if picture is not None and not is_figure:
        raise ValueError("--picture is for fig8 and fig9")
    for path, suffixes in ((None if alone else json_file, None), (picture, (".png", ".pdf", ".svg"))):
        if path is not None:
            on_root(comm, io.check_writable, path, suffixes)
    if is_figure:
        return _figure(comm, int(what[3:]), subdomains, json_file, picture)
    with progress(comm, alone) as say:
        result = article.table(int(what), subdomains, outer=outer, corners=corners, direction=direction, progress=say)
    if json_file is not None:
        on_root(comm, write_json, json_file, result)
    if comm.rank == 0 and not alone:
        print_table(
            f"Table {what}. {article.CAPTIONS[int(what)]}", article.layout(result), left=(0, 1), bold=(1, "ours")
        )
        if what != "3":
            print(article.NOTE)
    missed = [row for row in result.get("rows", []) if None in row["iterations"].values()]
    for row in missed:
        print(f"latinpc: {row['subdomains']} subdomains, {row['variant']}: {row['reason']}", file=sys.stderr)
    return NOT_CONVERGED if missed or not result.get("same", True) else 0


def _figure(comm, number, subdomains, json_file, picture):
    from . import paper as article

    with progress(comm, json_file == "-") as say:
        result = article.figure(number, subdomains=(subdomains or (144,))[0], progress=say)

    def draw():
        from . import pictures

        if json_file is not None:
            write_json(json_file, {"figure": number, "picture": str(picture), **result.report})
        if number == 8:
            pictures.draw_figure_8(result.scene, result.displacements, picture)
        else:
            pictures.draw_figure_9(result.scene, result.tensions, picture)

    on_root(comm, draw)
    if comm.rank == 0 and json_file != "-":
        print_lines(open_console(), f"Figure {number}", [*summary(result), ("written", str(picture))])
    return 0 if result.converged else NOT_CONVERGED


@commands.command()
@click.pass_obj
def info(comm):
    """Show versions, what this PETSc has, and where the library is for -dll_append."""
    from .solve import versions

    version, vendor = versions(), MPI.get_vendor()
    library = latinpc.get_library()
    packages = {"MUMPS": "mumps", "CHOLMOD": "suitesparse", "hypre": "hypre", "SuperLU_DIST": "superlu_dist"}
    here = {name: has_package(package) for name, package in packages.items()}
    config = __import__("petsc4py").get_config()
    lines = [
        ("latinpc", version["latinpc"]),
        ("PETSc", f"{version['petsc']}, {np.dtype(PETSc.ScalarType).name}, {np.dtype(PETSc.IntType).name} indices"),
        ("PETSC_DIR", os.pathsep.join(filter(None, (config.get("PETSC_DIR"), config.get("PETSC_ARCH"))))),
        ("petsc4py", version["petsc4py"]),
        ("MPI", f"{vendor[0]} {'.'.join(map(str, vendor[1]))}, mpi4py {version['mpi4py']}; run on {comm.size}"),
        ("Python", f"{version['python']}, numpy {version['numpy']}"),
        *((name, "yes" if there else "no") for name, there in here.items()),
        ("METIS", "yes, the library is linked with it"),
        ("library", library if os.path.exists(library) else f"{library} (missing: run make build)"),
        ("in programs", f"./program -dll_append {library} -snes_type latin"),
    ]
    print_lines(open_console(), "latinpc info", lines)


from . import cli_measure  # noqa: E402, F401  more commands, which need what stands above
