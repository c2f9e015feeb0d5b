"""What the command line prints: lines, tables, and what was solved in a few words."""

from __future__ import annotations

import contextlib
import sys

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .scenes.scene import UNILATERAL, Law

#: What `latinpc.digits` tells, in the words of the summary
DIGITS = {"unbalance": "unbalance", "rounding": "rounding", "places": "that of coordinates", "values": "of other data"}


def open_console(stderr=False):
    """Return a console that styles a terminal and leaves a pipe plain, with whole lines."""
    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, highlight=False, soft_wrap=not stream.isatty())


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
    lost = {key: np.inf if part is None else part for key, part in lost.items()}  # nothing moves to compare with
    moved = np.sqrt(sum(part**2 for part in lost.values()))
    known = f"{-np.log10(max(moved, np.finfo(float).eps / 2)):.1f}" if moved < 1.0 else "none"
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


def summary_of_motion(result):
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
