"""Split scripts of Tcl into commands and words, without running them."""

from __future__ import annotations

import re

from .arithmetic import NotPlain, evaluate

PLAIN = re.compile(r'[^\n;"{}\[\]$\\#]*')
NAME = re.compile(r"\$(?:\{([^}]*)\}|(\w+))")
CLOSING = {"{": "}", "[": "]"}


class Unbalanced(ValueError):
    """A brace, bracket or quote is not closed; the argument is the line."""


def commands(text, row=1):
    """Yield the line and the words of each command; a word in braces is a `Braced`, a body of commands perhaps.

    Parameters
    ----------
    text : str
    row : int
        Line of the file that the text begins on.
    """
    at = 0
    while at < len(text):
        plain = PLAIN.match(text, at).end()
        if plain == len(text) or text[plain] in "\n;":  # most lines
            words, start = text[at:plain].split(), row
            at, row = plain + 1, row + (text[plain : plain + 1] == "\n")
        elif text[at:plain].strip() == "" and text[plain] == "#":
            start, end = row, re.compile(r"(?<!\\)\n|$").search(text, plain).end()
            row += text.count("\n", at, end)
            at, words = max(end, plain + 1), []
        else:
            start = row
            words, at, row = _words(text, at, row)
        if words:
            yield start, words


class Braced(str):
    """The inside of a pair of braces, and the line it begins on."""

    row = 0


def _words(text, at, row):
    """Return the words of a command, and where the next one begins."""
    words = []
    while at < len(text) and text[at] not in "\n;":
        if text.startswith("\\\n", at):
            at, row = at + 2, row + 1
        elif text[at].isspace():
            at += 1
        else:
            end = _end(text, at, row)
            word = text[at:end]
            if word[0] == "{":
                word = Braced(word[1:-1])
                word.row = row
            elif word[0] == '"' and len(word) > 1:
                word = word[1:-1]
            words.append(word)
            row += text.count("\n", at, end)
            at = end
    return words, at + 1, row + text.startswith("\n", at)


def _end(text, at, row):
    """Return the end of the word that begins here."""
    if text[at] in "{[":
        closing, end = CLOSING[text[at]], _closed(text, at, row)
        return end if closing == "}" else _end_of_bare(text, end, row)
    if text[at] == '"':
        end = at + 1
        while end < len(text) and text[end] != '"':
            end += 2 if text[end] == "\\" else 1
        if end >= len(text):
            raise Unbalanced(row)
        return end + 1
    return _end_of_bare(text, at, row)


def _end_of_bare(text, at, row):
    while at < len(text) and not text[at].isspace() and text[at] != ";":
        if text.startswith("\\\n", at):
            break
        at = _closed(text, at, row) if text[at] == "[" or text.startswith("{", at) else at + 1
    return at


def _closed(text, at, row):
    """Return the place after the brace or bracket that closes the one here."""
    opening, closing, depth = text[at], CLOSING[text[at]], 0
    while at < len(text):
        if text[at] == "\\":
            at += 2
            continue
        depth += (text[at] == opening) - (text[at] == closing)
        at += 1
        if not depth:
            return at
    raise Unbalanced(row)


def substituted(word, names):
    """Return a word with the values of its names and of its ``[expr ...]``; raises `NotPlain`."""
    if isinstance(word, Braced) or not ("$" in word or "[" in word):
        return word
    if "[" in word:
        start = word.index("[")
        end = _closed(word, start, 0)
        inside = word[start + 1 : end - 1].strip()
        if not inside.startswith("expr"):
            raise NotPlain(f"'[{inside[:60]}]' is not worked out, only [expr ...] of arithmetic")
        return substituted(word[:start] + expression(inside[4:], names) + word[end:], names)

    def found(match):
        name = match.group(1) or match.group(2)
        if name not in names:
            raise NotPlain(f"'${name}' has no value so far")
        return names[name]

    return NAME.sub(found, word)


def expression(text, names):
    """Return the value of an expression as a word."""
    text = text.strip()
    if text[:1] in '{"' and len(text) > 1:
        text = text[1:-1]
    return repr(evaluate(substituted(text, names)))
