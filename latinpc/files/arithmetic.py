"""Work out arithmetic that stands in scripts, without running them: numbers, names, + - * / **, and functions."""

from __future__ import annotations

import ast
import math

REAL = "sqrt sin cos tan asin acos atan atan2 exp log log10 radians hypot"
FUNCTIONS = {name: getattr(math, name) for name in REAL.split()}
FUNCTIONS |= {"pow": pow, "abs": abs, "fabs": abs, "int": int, "float": float, "double": float}
MODULES = ("math", "np", "numpy")
CONSTANTS = {"pi": math.pi}
LARGEST = 1e300


class NotPlain(ValueError):
    """What stands there is no plain arithmetic."""


def evaluate(text, names=None):
    """Return the number that an expression of Tcl is worth; its quotient of whole numbers is a whole number."""
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise NotPlain(f"'{text.strip()[:60]}' is no arithmetic") from None
    return value(tree.body, names or {}, whole=True)


def value(node, names, whole=False):
    """Return the value of a node of a syntax tree: a number, a text, or a list of them.

    Parameters
    ----------
    node : ast.AST
    names : dict
        Values of names.
    whole : bool
        Divide whole numbers as Tcl does.
    """
    try:
        return _value(node, names, whole)
    except (ArithmeticError, TypeError, ValueError, RecursionError) as error:
        if isinstance(error, NotPlain):
            raise
        raise NotPlain(str(error)) from None


def _value(node, names, whole):
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float, str)):
        return node.value
    if isinstance(node, ast.Name) and (node.id in names or node.id in CONSTANTS):
        return names.get(node.id, CONSTANTS.get(node.id))
    if isinstance(node, ast.Attribute) and ast.unparse(node.value) in MODULES and node.attr in CONSTANTS:
        return CONSTANTS[node.attr]
    if isinstance(node, (ast.List, ast.Tuple)):
        return [_value(item, names, whole) for item in node.elts]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.UAdd, ast.USub)):
        number = _number(node.operand, names, whole)
        return -number if isinstance(node.op, ast.USub) else number
    if isinstance(node, ast.BinOp):
        return _bounded(_combined(node.op, _number(node.left, names, whole), _number(node.right, names, whole), whole))
    if isinstance(node, ast.Call) and not node.keywords:
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", None)
        base = getattr(getattr(node.func, "value", None), "id", None)
        if called in FUNCTIONS and (base is None or base in MODULES):
            numbers = [_number(item, names, whole) for item in node.args]
            return _bounded(FUNCTIONS[called](*(numbers if called == "abs" else map(float, numbers))))
    what = ast.unparse(node)
    raise NotPlain(f"'{what[:60]}' is no number, known name or arithmetic")


def _number(node, names, whole):
    number = _value(node, names, whole)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        raise NotPlain(f"{number!r} is no number")
    return number


def _combined(operator, a, b, whole):
    """Return what a binary operator makes of two numbers."""
    if isinstance(operator, ast.Add):
        return a + b
    if isinstance(operator, ast.Sub):
        return a - b
    if isinstance(operator, ast.Mult):
        return a * b
    if isinstance(operator, ast.Div):
        return a // b if whole and isinstance(a, int) and isinstance(b, int) else a / b
    if isinstance(operator, ast.Pow):
        power = float(a) ** float(b)
        exact = isinstance(a, int) and isinstance(b, int) and not isinstance(power, complex) and power.is_integer()
        return int(power) if exact else power
    raise NotPlain(f"the operator {type(operator).__name__} is not known")


def _bounded(number):
    """Return a real number that is not too large to go on with."""
    if isinstance(number, complex) or not abs(number) <= LARGEST:
        raise NotPlain("a number that is too large, or not real")
    return number
