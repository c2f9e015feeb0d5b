"""Scenes on the command line: options, opening, and ``latinpc scenes``."""

from __future__ import annotations

import inspect
import os
import re

import click
from rich.markup import escape

from latinpc.files.gmsh import read_scene
from latinpc.scenes import SCENES, make

from .printing import open_console


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


def scene_options(command):
    """Give a command one option for each parameter of any scene."""
    kinds, texts = {}, {}
    for name, generator in SCENES.items():
        for parameter, kind, _, text in parameters(generator):
            kinds.setdefault(parameter, kind)
            said = texts.setdefault(parameter, {})
            text = text or next(iter(said), "")  # truss-grid refers to tensegrity-grid
            said.setdefault(text, []).append(name)
    for parameter, said in reversed(texts.items()):
        kind = kinds[parameter]
        metavar = {int: "N", float: "X", bool: "BOOL", str: "NAME"}[kind]
        text = "; ".join(f"{text} [{', '.join(names)}]" for text, names in said.items())
        named = f"--{parameter.replace('_', '-')}"
        command = click.option(named, parameter, cls=SceneOption, type=kind, metavar=metavar, help=text)(command)
    return command


class SceneOption(click.Option):
    """An option of a scene; help lists it apart."""


class SceneCommand(click.Command):
    """A command on a scene: its help lists the options of the scenes last."""

    def format_options(self, ctx, formatter):
        """Write the options in two sections."""
        for title, chosen in (("Options", False), ("Options of scenes", True)):
            shown = [option for option in self.get_params(ctx) if isinstance(option, SceneOption) == chosen]
            records = [record for option in shown if (record := option.get_help_record(ctx)) is not None]
            with formatter.section(title):
                formatter.write_dl(records)


def open_scene(name, options):
    """Read or make the scene; on one rank."""
    if name.lower().endswith(".msh") or (name not in SCENES and os.path.exists(name)):
        given = [key for key, value in options.items() if value is not None and key != "subdomains"]
        if given:
            raise ValueError(f"--{given[0].replace('_', '-')} has no meaning for a file")
        return read_scene(name)
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
    console.print("Or a Gmsh file NAME.msh with NAME.toml beside it.")
