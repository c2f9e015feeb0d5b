"""Print lines, tables and reports; show progress on a terminal."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import sys

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from latinpc.results.atomic import atomic


def open_console(stderr=False):
    """Return a console that styles a terminal and leaves a pipe plain, with whole lines.

    Ranks of Open MPI print plain lines as well: it gives them a terminal even where their output goes to a file.
    """
    stream = sys.stderr if stderr else sys.stdout
    plain = "OMPI_COMM_WORLD_SIZE" in os.environ and "FORCE_COLOR" not in os.environ
    force = False if plain else None
    return Console(file=stream, highlight=False, force_terminal=force, soft_wrap=plain or not stream.isatty())


def print_lines(console, title, pairs):
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


def print_table(title, content, left=(0,), bold=(), note=None):
    """Print a table: aligned text in a pipe, ruled on a terminal.

    Parameters
    ----------
    title : str
    content : (list of str, list of list of str)
        Header and rows.
    left : collection of int
        Columns of words, -1 for the last one; those of numbers are set flush right.
    bold : (int, str), optional
        Rows with that word in that column stand out.
    note : str, optional
        Below the table.
    """
    header, rows = content
    left = [column % len(header) for column in left]
    console = open_console()
    console.print(f"[bold]{escape(title)}[/bold]")
    if console.is_terminal:
        table = Table(*header)
        for number, column in enumerate(table.columns):
            column.justify = "left" if number in left else "right"
        for row in rows:
            table.add_row(*map(escape, row), style="bold" if bold and row[bold[0]] == bold[1] else None)
        console.print(table)
    else:
        widths = [max(len(row[column]) for row in (header, *rows)) for column in range(len(header))]
        for row in (header, *rows):
            cells = [cell.ljust(width) if column in left else cell.rjust(width)
                     for column, (cell, width) in enumerate(zip(row, widths))]  # fmt: skip
            console.print(escape("  ".join(cells).rstrip()))
    if note:
        console.print(escape(note))


@contextlib.contextmanager
def progress(comm, quiet):
    """Yield a function that shows a sentence while the work lasts: on a terminal only, on rank 0."""
    console = open_console(stderr=True)
    if quiet or comm.rank or not console.is_terminal:
        yield None
        return
    with console.status("") as status:
        yield lambda text: status.update(escape(text))


def write_json(path, report):
    """Write a report, whole or not at all; '-' prints it."""
    text = json.dumps(report, indent=2, allow_nan=False) + "\n"
    if str(path) == "-":
        click.echo(text, nl=False)
        return
    with atomic(path) as temporary:
        pathlib.Path(temporary).write_text(text, encoding="utf-8")
