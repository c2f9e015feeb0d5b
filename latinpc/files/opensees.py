"""Read trusses from scripts of OpenSees, in Tcl or Python, as text: nothing of a script is run.

Read are ``model``, ``node``, ``fix``, ``fixX``, ``fixY``, ``fixZ``, ``mass``, ``uniaxialMaterial`` (Elastic, ENT,
ElasticPPGap, InitStrainMaterial, InitStressMaterial), ``element truss`` and ``corotTruss``, ``timeSeries`` Linear and
Constant, ``pattern Plain``, ``load`` and ``sp``; besides ``set`` and ``[expr ...]``, or assignments and arithmetic.
Commands of the analysis are left out.
Loads are those of all patterns together, at the time 1 of Linear. A loop or a condition that makes nodes or elements is
refused: write its commands out.
"""

from __future__ import annotations

import ast
import re

from .arithmetic import NotPlain, value
from .opensees_model import BUILDING, LEFT_OUT, REFUSED, Model
from .tcl import Braced, Unbalanced, commands, substituted
from .text import read_text, wrong

BLOCKS = ("for", "foreach", "while", "if", "proc", "catch", "eval", "source", "else", "namespace")
WORDS = re.compile(rf"\b({'|'.join(sorted(BUILDING | REFUSED))})\b")
CURE = "the commands that the script makes, written out with numbers"


def read_opensees(path):
    """Read a script of OpenSees; return `Lines`. Raises ValueError with the line of the file."""
    model, text = Model(path), read_text(path)
    try:
        (_read_python if path.suffix.lower() == ".py" else _read_tcl)(path, text, model)
    except RecursionError:
        wrong(path, None, "nested too deeply", CURE)
    return model.lines()


# ---- Tcl -------------------------------------------------------------------------------------------------------------


def _read_tcl(path, text, model, names=None, row=1):
    """Read the commands of a script, or of the body of a pattern."""
    names = {} if names is None else names
    try:
        for row, words in commands(text, row):  # noqa: B020
            _tcl_command(path, row, words, model, names)
    except Unbalanced as error:
        wrong(path, error.args[0] or row, "a brace, bracket or quote is not closed", "as many closing as opening ones")


def _tcl_command(path, row, words, model, names):
    head = words[0]
    if head in BLOCKS:
        if head in ("source", "eval") or WORDS.search(" ".join(words[1:])):
            wrong(path, row, f"'{head}' is not run", CURE)
        return
    if head in LEFT_OUT:
        return
    try:
        if head == "set":
            _tcl_set(words, names)
            return
        words = [substituted(word, names) for word in words]
    except NotPlain as error:
        wrong(path, row, str(error), "a number, a name that 'set' gives a number, or arithmetic in [expr ...]")
    body = words.pop() if head == "pattern" and isinstance(words[-1], Braced) else None
    model.take(row, head, words[1:])
    if body is not None:
        _read_tcl(path, body, model, names, body.row)


def _tcl_set(words, names):
    """Give a name its value; what cannot be worked out matters only where it is used."""
    if len(words) != 3:
        return
    names.pop(words[1], None)
    try:
        names[words[1]] = str(substituted(words[2], names))
    except NotPlain:
        if re.search(r"\[\s*expr\b", words[2]) and not re.search(r"\$|\bnode\w+|\bele\w+", words[2]):
            raise


# ---- Python ----------------------------------------------------------------------------------------------------------


def _read_python(path, text, model):
    """Read the statements of a script of OpenSeesPy."""
    try:
        tree = ast.parse(text)
    except SyntaxError as error:
        wrong(path, error.lineno, f"not Python: {error.msg}", CURE)
    except (ValueError, MemoryError) as error:
        wrong(path, None, f"not Python: {error}", CURE)
    reader = _Python(path, model)
    for statement in tree.body:
        reader.take(statement)


class _Python:
    """The names that a script has given values so far, and those of the module."""

    def __init__(self, path, model):
        self.path, self.model, self.names, self.modules, self.bare = path, model, {}, set(), False

    def take(self, statement):
        """Read a statement."""
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                if "opensees" in alias.name.lower():
                    self.modules.add(alias.asname or alias.name)
        elif isinstance(statement, ast.ImportFrom):
            for alias in statement.names:
                if "opensees" in alias.name.lower():
                    self.modules.add(alias.asname or alias.name)
                self.bare |= "opensees" in (statement.module or "").lower() and alias.name not in self.modules
        elif isinstance(statement, ast.Assign):
            self._assign(statement)
        elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
            self._call(statement.value)
        elif not isinstance(statement, ast.Expr):
            for node in ast.walk(statement):
                if isinstance(node, ast.Call) and self._command(node) in BUILDING | REFUSED:
                    what = type(statement).__name__.lower().replace("functiondef", "def")
                    wrong(self.path, node.lineno, f"'{what}' is not run, and makes a '{self._command(node)}'", CURE)

    def _command(self, call):
        """Return the command of OpenSees that a call is, None if it is none."""
        if isinstance(call.func, ast.Name):
            return call.func.id if self.bare else None
        if isinstance(call.func, ast.Attribute) and ast.unparse(call.func.value) in self.modules:
            return call.func.attr
        return None

    def _assign(self, statement):
        names = [target.id for target in statement.targets if isinstance(target, ast.Name)]
        try:
            found = value(statement.value, self.names)
        except NotPlain:  # matters only where it is used
            for name in names:
                self.names.pop(name, None)
            if isinstance(statement.value, ast.Call):
                self._call(statement.value)
            return
        self.names |= dict.fromkeys(names, found)

    def _call(self, call):
        command = self._command(call)
        if command is None or (isinstance(call.func, ast.Name) and command not in BUILDING | REFUSED):
            return
        if command in LEFT_OUT:
            return
        arguments = []
        try:
            for item in call.args:
                if isinstance(item, ast.Starred):
                    several = value(item.value, self.names)
                    arguments += several if isinstance(several, list) else [several]
                else:
                    found = value(item, self.names)
                    arguments += found if isinstance(found, list) else [found]
        except NotPlain as error:
            wrong(self.path, call.lineno, str(error), "a number, a name that has been given one, or arithmetic")
        self.model.take(call.lineno, command, [str(item) for item in arguments])
