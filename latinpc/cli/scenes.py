"""Scenes on the command line: options, opening, and ``latinpc scenes``."""

from __future__ import annotations

import inspect
import os
import pathlib
import re
import sys
from dataclasses import replace

import click
from petsc4py import PETSc
from rich.markup import escape

from latinpc.files.reading import FORMATS, READERS, read, sources
from latinpc.files.text import finite
from latinpc.geometry import known_geometry
from latinpc.scenes import SCENES, make

from .arguments import Command
from .printing import open_console

#: Options of files: parameter of `latinpc.files.reading.read` -> option, what it takes, help. With more than one value
#: they may be repeated; GROUP= restricts a value to the lines of a group.
FILES = {
    "scale": ("--scale", "X", "Length unit of the file (m), such as 0.001 for mm"),
    "merge": ("--merge", "X", "Merge points closer than this (m)"),
    "rise": ("--raise", "X", "Raise a flat drawing to a vault: height of the crown over the longer side"),
    "brace": ("--brace", "X", "Make two layers this far apart (m), with posts and crossed cables"),
    "law": ("--law", "[GROUP=]NAME", "Law of lines without one"),
    "EA": ("--EA", "[GROUP=]X", "Axial stiffness of lines without one (N)"),
    "prestress": ("--prestress", "[GROUP=]X", "Tension before loading (N), of lines without one"),
    "support": (
        "--support",
        "WHERE[:AXES]",
        "Hold nodes: a group, a node, all, or conditions such as z=min or 'x>=2,y<1'",
    ),
    "load": ("--load", "z=X[,..][:WHERE]", "Force on each node (N), such as z=-1000 or x=50:deck"),
    "self_weight": ("--self-weight", "[GROUP=]X", "Weight along lines (N/m), downwards"),
    "case": ("--case", "NAME", "Load case of the TOML file to solve; latinpc cases solves all"),
}
SINGLE = {"scale": float, "merge": float, "rise": float, "brace": float, "case": str}
NUMBERS = ("EA", "prestress", "self_weight")  # by group


def parameters(generator):
    """Return (name, kind, default, help) of the options of a scene, from its signature and docstring.

    The help is the first sentence of the docstring, with the choices of a set such as {'regular', 'metis'}.
    """
    documentation = inspect.getdoc(generator) or ""
    found = []
    for name, parameter in inspect.signature(generator).parameters.items():
        kind = next((kind for kind in (int, float, bool) if str(parameter.annotation).startswith(kind.__name__)), str)
        match = re.search(rf"^{name} : (.*)\n((?:    .*\n?)+)", documentation, re.MULTILINE)
        text = re.split(r"(?<=[.;]) |; ", " ".join(match.group(2).split()))[0].rstrip(".;") if match else ""
        choices = re.findall(r"'(\w+)'", match.group(1)) if match else []
        text += f": {', '.join(choices)}" if choices else ""
        found.append((name, kind, parameter.default, text))
    return found


def file_options(command, of_scenes=None):
    """Give a command the options of files; of those that scenes have too, with the help of these."""
    for parameter, (option, metavar, text) in reversed(FILES.items()):
        said = (of_scenes or {}).get(parameter, {})
        more = "".join(f"; {text} [{', '.join(names)}]" for text, names in said.items())
        how = {"type": SINGLE[parameter]} if parameter in SINGLE else {"multiple": True}
        how["hidden"] = parameter == "case" and of_scenes is None  # latinpc cases takes all
        command = click.option(option, parameter, cls=FileOption, metavar=metavar, help=text + more, **how)(command)
    return command


def scene_options(command):
    """Give a command one option for each parameter of any scene and of files."""
    kinds, texts = {}, {}
    for name, generator in SCENES.items():
        for parameter, kind, _, text in parameters(generator):
            kinds.setdefault(parameter, kind)
            said = texts.setdefault(parameter, {})
            text = text or next(iter(said), "")  # truss-grid refers to tensegrity-grid
            said.setdefault(text, []).append(name)
    command = file_options(command, texts)
    for parameter, said in reversed(texts.items()):
        if parameter in FILES:
            continue
        kind = kinds[parameter]
        metavar = {int: "N", float: "X", bool: "BOOL", str: "NAME"}[kind]
        text = "; ".join(f"{text} [{', '.join(names)}]" for text, names in said.items())
        named = f"--{parameter.replace('_', '-')}"
        command = click.option(named, parameter, cls=SceneOption, type=kind, metavar=metavar, help=text)(command)
    return command


class SceneOption(click.Option):
    """An option of a scene; help lists it apart."""


class FileOption(click.Option):
    """An option of files; help lists it apart."""


class SceneCommand(Command):
    """A command on a scene: its help lists the options of files and of scenes last."""

    def format_options(self, ctx, formatter):
        """Write the options in three sections."""
        for title, kind in (("Options", None), ("Options of files", FileOption), ("Options of scenes", SceneOption)):
            shown = [
                option
                for option in self.get_params(ctx)
                if (isinstance(option, kind) if kind else not isinstance(option, (FileOption, SceneOption)))
            ]
            records = [record for option in shown if (record := option.get_help_record(ctx)) is not None]
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def open_scene(name, options, written=(), read=()):
    """Read or make the scene, of the geometry that an option gives; on one rank.

    Refuse files to be written, None or ``"-"`` left out, that are the same, or one of those that are read: of the scene
    or others.
    """
    _check_apart([path for path in written if path not in (None, "-")], [*_sources(name), *filter(None, read)])
    scene = _opened(name, options)
    geometry = PETSc.Options().getString("snes_latin_geometry", scene.geometry).lower()
    try:
        known_geometry(geometry)
    except ValueError as error:
        raise ValueError(f"-snes_latin_geometry {geometry}: {error}") from None
    return scene if geometry == scene.geometry else replace(scene, geometry=geometry)


def check_node_mass(mass):
    """Refuse a mass of all nodes that is none."""
    if not 0.0 <= mass < float("inf"):
        raise ValueError(f"--node-mass {mass:g}: a mass is a finite number of kg, not negative")


def _is_file(name):
    return name not in SCENES and (os.path.exists(name) or os.path.splitext(name)[1])


def _sources(name):
    """Return the files that the scene is read from, none where it is not there or made."""
    return sources(name) if _is_file(name) and os.path.exists(name) else []


def _check_apart(written, read):
    """Refuse files to be written that are the same, or that are read."""
    known = {os.path.realpath(path): "is read" for path in read}
    for path in written:
        place = os.path.realpath(path)
        if place in known:
            raise ValueError(f"{path}: {known[place]}, and cannot be written too; give another name")
        known[place] = "is written already"


def _opened(name, options):
    given = {key: value for key, value in options.items() if value not in (None, ())}
    if given.get("subdomains", 1) < 1:
        raise ValueError(f"--subdomains {given['subdomains']}: give 1 or more")
    if _is_file(name):
        beyond = [key for key in given if key not in FILES and key != "subdomains"]
        if beyond:
            takes = ", ".join(option for option, *_ in FILES.values())
            raise ValueError(f"--{beyond[0].replace('_', '-')} has no meaning for a file, which takes {takes}")
        return read(name, **{key: _of_file(key, value) for key, value in given.items() if key in FILES})
    if name not in SCENES:
        there = sorted(str(path) for path in _beside(name))
        meant = f"; here is {', '.join(there)}" if there else ""
        raise ValueError(f"unknown scene '{name}': choose from {', '.join(SCENES)}, or give a file: {FORMATS}{meant}")
    if pathlib.Path(name, "nodes.csv").exists():
        print(f"latinpc: {name} is the built-in scene; the folder of that name is ./{name}", file=sys.stderr)
    known = {parameter: kind for parameter, kind, *_ in parameters(SCENES[name])}
    for key in given:
        if key not in known and key != "subdomains":
            option = FILES[key][0] if key in FILES else f"--{key.replace('_', '-')}"
            takes = ", ".join(f"--{other.replace('_', '-')}" for other in known)
            raise ValueError(f"{option} has no meaning for the scene {name}, which takes {takes}")
    return make(name, **{key: _of_scene(key, known[key], given[key]) for key in known if key in given})


def _beside(name):
    """Return the files of this folder that a name without a suffix may mean."""
    stem = re.compile(rf"{re.escape(name)}([-_ ](nodes|members))?")
    return [path for path in pathlib.Path().iterdir() if path.suffix.lower() in READERS and stem.fullmatch(path.stem)]


def _of_file(key, value):
    """Return what `latinpc.files.reading.read` takes: of repeated options texts, or values by group."""
    if key in SINGLE or key in ("support", "load"):
        return value
    found = {}
    for text in value:
        group, separator, word = text.rpartition("=")
        group = group if separator else None
        word = finite(word) if key in NUMBERS else word
        if word is None:
            raise ValueError(f"{FILES[key][0]} {text}: write a number, or GROUP=number")
        if group in found:
            raise ValueError(f"{FILES[key][0]} {text}: given twice")
        found[group] = word
    return found


def _of_scene(key, kind, value):
    """Return the value of an option that scenes share with files."""
    if key not in FILES:
        return value
    number = finite(value[0]) if kind is float else value[0]
    if len(value) > 1 or number is None:
        raise ValueError(
            f"{FILES[key][0]} {' '.join(value)}: a scene takes one {'number' if kind is float else 'name'}"
        )
    return number


@click.command()
def scenes():
    """List the built-in scenes and their options."""
    console, known = open_console(), {}
    for name, generator in SCENES.items():
        console.print(f"[bold]{name}[/bold]  {escape(inspect.getdoc(generator).splitlines()[0])}")
        for parameter, _, default, text in parameters(generator):
            text = known[parameter] = text or known.get(parameter, "")  # a twin scene refers to its sibling
            said = "" if default is None else f" (default {default})"
            console.print(f"  [cyan]--{parameter.replace('_', '-'):<13}[/cyan]{escape(text + said)}")
    console.print(escape(f"Or a file: {FORMATS}."))
