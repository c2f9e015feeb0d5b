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
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import latinpc

from . import io
from .checkpoint import Interrupted, Keeper
from .scenes import SCENES, make
from .scenes.scene import UNILATERAL, Law
from .solvers import has_package

NOT_CONVERGED, BAD_INPUT = 1, 2
#: What `latinpc.digits` tells, in the words of the summary
DIGITS = {"unbalance": "unbalance", "rounding": "rounding", "places": "that of coordinates", "values": "of other data"}
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


# ---- printing --------------------------------------------------------------------------------


def _console(stderr=False):
    """Return a console that styles a terminal and leaves a pipe plain, with whole lines."""
    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, highlight=False, soft_wrap=not stream.isatty())


def _lines(console, title, pairs):
    """Print a title and aligned lines of (label, text), folded on a terminal only."""
    console.print(f"[bold]{escape(title)}[/bold]")
    if not console.is_terminal:
        for label, text in pairs:
            console.print(escape(f"  {label:<15}{text}"))
        return
    grid = Table.grid(padding=(0, 1))
    for label, text in pairs:
        grid.add_row(f" [cyan]{label:<14}[/cyan]", escape(text))
    console.print(grid)


@contextlib.contextmanager
def _progress(comm, quiet):
    """Yield a function that shows a sentence while the work lasts: on a terminal only, on rank 0."""
    console = _console(stderr=True)
    if quiet or comm.rank or not console.is_terminal:
        yield None
        return
    with console.status("") as status:
        yield lambda text: status.update(escape(text))


def quantity(value, unit, digits=3):
    """Return a number with its unit, scaled to be readable; '0 N' for nothing."""
    from .pictures import scaled

    if value is None or not np.isfinite(value):
        return "not known"
    divisor, scaled_unit = scaled(abs(value), unit) if abs(value) >= 1e-12 else (1.0, unit)
    return f"{value / divisor if abs(value) >= 1e-12 else 0.0:.{digits}g} {scaled_unit}"


def summary(result):
    """Return the lines of (label, text) that tell what was solved and how it went."""
    scene, report = result.scene, result.report
    laws = ", ".join(
        f"{count:,} {law.plural if count != 1 else law.name.lower()}"
        for law in Law
        if (count := int(np.count_nonzero(scene.law == law)))
    )
    lines = [("structure", f"{len(scene.nodes):,} nodes, {report['links']:,} links ({laws}) in {scene.dim}D")]
    ranks = f"{report['ranks']} rank{'s' if report['ranks'] > 1 else ''}"
    lines.append(("unknowns", f"{report['free_dofs']:,} free of {report['dofs']:,}, on {ranks}"))
    if report["subdomains"]:
        lines.append(
            (
                "decomposition",
                f"{report['subdomains']:,} subdomains, {report['strong_interfaces']:,} strong and"
                f" {report['weak_interfaces']:,} weak interfaces; coarse problem"
                f" {report['strong_macro_dofs']:,} + {report['weak_dofs']:,}",
            )
        )
    measured = "".join(f", {name} {report[name]:.1e}" for name in ("indicator", "residual") if report[name] is not None)
    lines.append(("solver", f"{report['solver']}: {report['iterations']} iterations, {report['reason']}{measured}"))
    if report["estimated_error"] is not None:
        norm = report["options"].get("snes_latin_error_norm", "l2")
        lines.append(("accuracy", f"estimated error {report['estimated_error']:.1e} ({norm})"))
    if report["error_l2"] is not None:
        energy = f", {report['error_energy']:.1e} (energy)" if report["error_energy"] is not None else ""
        lines.append(("error", f"{report['error_l2']:.1e} (l2){energy} against Newton's method"))
    if report["digits"] is not None:
        lines.append(("digits", _digits(report["digits"])))
    lines += _mechanics(scene, result)
    memory = quantity(report["peak_memory_bytes"], "B")
    seconds = [quantity(report[key], "s") for key in ("setup_seconds", "solve_seconds")]
    lines.append(("time", f"set-up {seconds[0]}, solve {seconds[1]}; memory {memory}"))
    return lines


def _digits(lost):
    """Tell how many digits of the displacements there are, and what limits them."""
    moved = np.sqrt(sum(part**2 for part in lost.values()))
    known = f"{max(0.0, -np.log10(max(moved, np.finfo(float).eps / 2))):.1f}" if np.isfinite(moved) else "none"
    return f"{known}: " + ", ".join(f"{text} {lost[key]:.0e}" for key, text in DIGITS.items())


def _mechanics(scene, result):
    size = np.linalg.norm(result.displacements, axis=1)
    if not (np.isfinite(size).all() and np.isfinite(result.tensions).all()):
        return [("displacement", "the last iterate is not finite")]
    node = int(size.argmax())
    place = ", ".join(f"{value:.4g}" for value in scene.nodes[node])
    vector = ", ".join(f"{value:.3g}" for value in result.displacements[node] * 1e3)
    lines = [("displacement", f"largest {quantity(size[node], 'm')} at ({place}) m: ({vector}) mm")]
    low, high = result.tensions.min(), result.tensions.max()
    text = f"from {quantity(low, 'N')} to {quantity(high, 'N')} (compression negative)"
    if np.isin(scene.law, UNILATERAL).any():
        share = f"{100 * result.report['slack_fraction']:.3g} %"
        touch = np.isin(scene.law, (Law.CONTACT, Law.FRICTION)).any()
        text += f"; {share} of the contacts open" if touch else f"; {share} of the cables and struts slack"
    return [*lines, ("tension", text)]


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
    console, known = _console(), {}
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
        with _progress(comm, quiet or monitored) as say:
            result = _move(scene, steps, step, count, node_mass, every, say, output, picture, keeper)
        return _report(comm, result, _write_motion, _summary_of_motion, json_file, output, picture, quiet)
    with _progress(comm, quiet or monitored) as say:
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
            _lines(_console(), result.scene.name, lines + ([("written", ", ".join(written))] if written else []))
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


def _summary_of_motion(result):
    """Return the lines of (label, text) that tell what moved and how it went."""
    scene, report, last = result.scene, result.report, result.frames[-1]
    lines = [("structure", f"{len(scene.nodes):,} nodes, {report['links']:,} links in {scene.dim}D")]
    ranks = f"{report['ranks']} rank{'s' if report['ranks'] > 1 else ''}"
    lines.append(("unknowns", f"{report['free_dofs']:,} free of {report['dofs']:,}, on {ranks}"))
    if report["subdomains"]:
        lines.append(("decomposition", f"{report['subdomains']:,} subdomains"))
    lines.append(("motion", f"{report['steps']} steps of {quantity(report['step'], 's')}, {report['reason']}"))
    if report["iterations"]:
        most = max(report["iterations"])
        lines.append(
            ("solver", f"{report['solver']}: {report['iterations_mean']:.1f} iterations a step, at most {most}")
        )
    kinetic, potential = report["kinetic_energy"], report["potential_energy"]
    if kinetic and None not in (kinetic[-1], potential[-1]):
        text = [quantity(a + b, "J") for a, b in ((kinetic[0], potential[0]), (kinetic[-1], potential[-1]))]
        lines.append(("energy", f"{text[0]} at the start, {text[1]} at the end"))
    size = np.linalg.norm(last.displacements, axis=1)
    if np.isfinite(size).all():
        lines.append(("displacement", f"at the end, at most {quantity(size.max(), 'm')}"))
    if report["active"]:
        lines.append(("active links", f"{report['active'][-1]:,} at the end, at most {max(report['active']):,}"))
    per_step = report["seconds"] / max(report["steps"], 1)
    memory = quantity(report["peak_memory_bytes"], "B")
    lines.append(("time", f"{quantity(report['seconds'], 's')}, {quantity(per_step, 's')} a step; memory {memory}"))
    return lines


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
    with _progress(comm, alone) as say:
        result = article.table(int(what), subdomains, outer=outer, corners=corners, direction=direction, progress=say)
    if json_file is not None:
        on_root(comm, write_json, json_file, result)
    if comm.rank == 0 and not alone:
        _print_table(article.layout(result), f"Table {what}. {article.CAPTIONS[int(what)]}")
        if what != "3":
            print(article.NOTE)
    missed = [row for row in result.get("rows", []) if None in row["iterations"].values()]
    for row in missed:
        print(f"latinpc: {row['subdomains']} subdomains, {row['variant']}: {row['reason']}", file=sys.stderr)
    return NOT_CONVERGED if missed or not result.get("same", True) else 0


def _print_table(content, title):
    header, rows = content
    console = _console()
    console.print(f"[bold]{escape(title)}[/bold]")
    if console.is_terminal:
        table = Table(*header)
        for column in table.columns[2:]:
            column.justify = "right"
        for row in rows:
            table.add_row(*(escape(cell) for cell in row), style="bold" if row[1] == "ours" else None)
        console.print(table)
        return
    widths = [max(len(row[column]) for row in (header, *rows)) for column in range(len(header))]
    for row in (header, *rows):
        cells = [cell.ljust(width) if column < 2 else cell.rjust(width)
                 for column, (cell, width) in enumerate(zip(row, widths))]  # fmt: skip
        console.print(escape("  ".join(cells).rstrip()))


def _figure(comm, number, subdomains, json_file, picture):
    from . import paper as article

    with _progress(comm, json_file == "-") as say:
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
        _lines(_console(), f"Figure {number}", [*summary(result), ("written", str(picture))])
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
    _lines(_console(), "latinpc info", lines)


from . import cli_measure  # noqa: E402, F401  more commands, which need what stands above
