"""The command line: ``latinpc solve | cases | form | modes | scenes | paper | compare | tradeoff | extremes | info``.

Options with two dashes are ours. Options with one dash are PETSc's and go to its options database untouched; one that
no solver knows, or has read in the end, is bad input. Under
``mpirun`` only rank 0 prints and writes. Exit codes: 0 converged, 1 not converged, 2 bad input.
"""

from __future__ import annotations

import difflib
import os
import signal
import sys
import traceback

import click
from mpi4py import MPI
from petsc4py import PETSc

import latinpc
from latinpc.options import OPTIONS, unknown_options
from latinpc.results.unread import unread
from latinpc.runs.checkpoint import Interrupted

from .arguments import insert_petsc_options, split_arguments
from .cases import cases
from .form import form
from .info import info
from .measure import compare, extremes, tradeoff
from .modes import modes
from .paper import paper
from .ranks import BAD_INPUT, gather_or_abort, printing_on, sentence
from .scenes import scenes
from .solve import solve_command

ANY_OPTION = "--any-option"
#: Commands that read the options; others give them to processes of their own
READING = ("solve", "cases", "form", "modes")


@click.group(context_settings={"help_option_names": ["--help"]})
@click.version_option(latinpc.__version__, prog_name="latinpc")
def commands():
    """Solve structures of bars, cables and contacts by the multiscale LATIN method.

    Options with two dashes belong to latinpc. Options with one dash belong to PETSc, for instance -snes_monitor,
    -snes_type newtonls or -snes_latin_variant macro; -help lists them. A misspelt one ends the command with exit code
    2, unless --any-option is given.
    """


for _command in (solve_command, cases, form, modes, scenes, paper, compare, tradeoff, extremes, info):
    commands.add_command(_command)


def main(arguments=None):
    """Run the command line and exit with its code; collective."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends us quietly, not by PETSc's handler
    _open_streams()
    ours, petsc = split_arguments(sys.argv[1:] if arguments is None else list(arguments))
    comm = MPI.COMM_WORLD.Dup()  # of our own, so that waiting after an error meets no other message
    with printing_on(comm.rank == 0):
        code = _run(comm, ours, petsc)
        sys.stdout.flush()
    sys.exit(code)


def _open_streams():
    """Let a closed stream take what is printed, and one that has no sign for a character print another."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")


def _two_dashes(command, given):
    """Return the end of a sentence on options of PETSc's where one of ours has nearly their name."""
    ours = [option[2:] for parameter in commands.commands[command].params for option in parameter.opts]
    meant = [name for one in given for name in difflib.get_close_matches(one.replace("_", "-"), ours, 1, 0.8)]
    return f"; with two dashes there is {', '.join(f'--{name}' for name in meant)}" if meant else ""


def _interrupted():
    print("\nlatinpc: interrupted", file=sys.stderr)
    return 130


def _run(comm, ours, petsc):
    try:
        given = insert_petsc_options(petsc)
        stops = ANY_OPTION not in ours
        ours = [word for word in ours if word != ANY_OPTION]
        if stops and (unknown := unknown_options()):
            PETSc.Options().setValue("options_left", False)  # newer PETSc would say the same once more
            raise ValueError(f"{'; '.join(unknown)} ({ANY_OPTION} goes on)")
        code = commands.main(args=ours, prog_name="latinpc", standalone_mode=False, obj=comm) or 0
        stray = unread(PETSc.COMM_WORLD, given) if ours[:1] and ours[0] in READING and "--help" not in ours else []
        for text in stray:
            print(f"latinpc: {text}{_two_dashes(ours[0], given)}", file=sys.stderr)
        return code or (BAD_INPUT if stray and stops else 0)
    except click.ClickException as error:
        error.show()
        if isinstance(error, click.NoSuchOption) and (key := error.option_name.strip("-").replace("-", "_")) in OPTIONS:
            click.echo(f"It is an option of PETSc's, with one dash: -snes_latin_{key}", err=True)
        if isinstance(error, click.MissingParameter) and any(value for _, value in petsc):
            click.echo("A word after a PETSc option is its value: put SCENE before the options.", err=True)
        return BAD_INPUT
    except (click.Abort, KeyboardInterrupt):
        return _interrupted()
    except Interrupted as error:
        print(f"latinpc: {error}", file=sys.stderr)
        return error.code
    except Exception as error:
        if isinstance(error.__cause__, KeyboardInterrupt):  # with later versions of petsc4py
            return _interrupted()
        expected = isinstance(error, (ValueError, OSError, RuntimeError, MemoryError, PETSc.Error))
        text = sentence(error)
        print(f"latinpc: {text}" if expected else traceback.format_exc(), file=sys.stderr)
        gather_or_abort(comm, text)
        return BAD_INPUT
