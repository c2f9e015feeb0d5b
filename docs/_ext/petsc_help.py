"""Directives that run our commands while the site is built.

`petsc-help` makes a table of our options, as ``latinpc solve ... -help`` prints them. Its options are `command`, the
words after ``latinpc``, and `prefix`, that of the options to list. `command-help` shows what ``--help`` prints.
"""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

from latinpc.options import INNER_PREFIXES

LINE = re.compile(r"^ +-(\w+):? ?(?:<(?:now )?(?:.*?) : (?:formerly )?(.*?)>)?:? ?(.*)$")
MEANING = re.compile(r"^(?P<text>.*?)(?: \(choose one of\) (?P<values>.*?))?(?: \((?P<setter>\w+)\))?$")


def printed(words):
    """Return what a command prints; its first word is ``latinpc``."""
    words = [str(Path(sys.executable).parent / words[0]), *words[1:]]
    return subprocess.run(words, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]).stdout


class CommandHelp(SphinxDirective):
    """Show what a command prints with ``--help``."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self):
        """Return the title and the text."""
        words = shlex.split(self.arguments[0])
        text = printed([*words, "--help"])
        block = nodes.literal_block(text, text, language="none")
        section = nodes.section(ids=[nodes.make_id(" ".join(words))])
        section += [nodes.title("", " ".join(words)), block]
        return [section]


class PetscHelp(SphinxDirective):
    """Run a command with ``-help`` and list the options of a prefix."""

    option_spec: ClassVar = {"command": directives.unchanged_required, "prefix": directives.unchanged_required}

    def run(self):
        """Return the table."""
        head = ["| option | default | values | what | C function |", "| --- | --- | --- | --- | --- |"]
        return self.parse_text_to_nodes("\n".join([*head, *self._rows().values()]))

    def _rows(self):
        words = ["latinpc", *shlex.split(self.options["command"]), "-help"]
        prefix, rows = self.options["prefix"], {}
        for line in printed(words).splitlines():
            match = LINE.match(line)
            if not match or not match[1].startswith(prefix):
                continue
            if match[1][len(prefix) :].startswith(tuple(INNER_PREFIXES)):
                continue
            meaning = MEANING.match(match[3])
            values = ", ".join(f"`{value}`" for value in (meaning["values"] or "").split())
            setter = f"`{meaning['setter']}()`" if meaning["setter"] not in (None, "None") else ""
            cells = (f"`-{match[1]}`", f"`{match[2]}`" if match[2] else "", values, meaning["text"], setter)
            rows[match[1]] = f"| {' | '.join(cells)} |"  # of a viewer the last line says what it shows
        if not rows:
            raise self.error(f"{shlex.join(words)} lists no option -{prefix}*")
        return rows


def setup(app):
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    app.add_directive("petsc-help", PetscHelp)
    return {"parallel_read_safe": True}
