"""Separate PETSc's options from ours, and read lists."""

from __future__ import annotations

import pathlib

import click
from petsc4py import PETSc

#: Help of --preset
PRESETS = (
    "Options of a ready-made set: fast (displacements to 1e-2, forces for a first look), balanced (1e-4),"
    " accurate (1e-8), and others."
)


def is_petsc_option(token):
    """Return whether a word is a PETSc option: a dash and a letter, not two dashes, no negative number, not -v."""
    return len(token) > 1 and token[0] == "-" and token[1].isalpha() and token != "-v"


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


#: Options that PETSc reads when it starts or ends, not its solvers
OF_PETSC = (
    "citations", "cuda", "debug", "device", "fp_trap", "get_", "help", "hip", "info", "log", "malloc", "memory", "mpi",
    "nox", "objects", "on_error", "options", "saws", "start_in", "use_gpu", "version", "x_",
)  # fmt: skip


#: Of these, options that do nothing once PETSc has started
OF_ITS_START = (
    "debugger",
    "device",
    "fp_trap",
    "info",
    "log_all",
    "log_trace",
    "malloc",
    "mpi_linear",
    "on_error",
    "start_in",
)


def insert_petsc_options(options):
    """Put options into PETSc's database; PETSc is initialised already, so logging starts here.

    Returns
    -------
    list of str
        Those that are for solvers, files of options included.
    """
    database = PETSc.Options()
    before = database.getAll()
    for name, value in options:
        if name.startswith(OF_ITS_START):
            more = f" {value}" if value else ""
            raise ValueError(f'PETSc reads -{name} only when it starts: set PETSC_OPTIONS="-{name}{more}"')
        if name == "options_file":
            if not value or not pathlib.Path(value).is_file():
                raise FileNotFoundError(f"-options_file {value or ''}: no such file")
            database.insertString(f"-options_file {value}")
        else:
            database.setValue(name, value)
    if any(name.startswith("log_view") for name, _ in options):
        PETSc.Log.begin()
    return [name for name in database.getAll() if name not in before and not name.startswith(OF_PETSC)]


class Command(click.Command):
    """A command that refuses an option given twice unless it may be repeated: the last one would win."""

    def parse_args(self, ctx, args):
        """Look at the order of what is given, then parse."""
        order = self.make_parser(ctx).parse_args(list(args))[2]
        once = [option for option in order if isinstance(option, click.Option) and not option.multiple]
        twice = next((option for option in once if not option.is_flag and once.count(option) > 1), None)
        if twice is not None:
            raise ValueError(f"{twice.opts[0]} is given twice; keep one")
        return super().parse_args(ctx, args)


class List(click.ParamType):
    """A comma-separated list, such as 9,16,25.

    Parameters
    ----------
    kind : type
        Of the items.
    example : str
        For messages.
    """

    name = "list"

    def __init__(self, kind, example):
        self.kind, self.example = kind, example

    def convert(self, value, param, ctx):
        """Return a tuple of items."""
        try:
            return tuple(self.kind(word.strip()) for word in value.split(",") if word.strip())
        except ValueError:
            self.fail(f"{value!r} is not a list such as {self.example}", param, ctx)
