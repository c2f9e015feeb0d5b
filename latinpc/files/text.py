"""Read text files line by line, and say what is wrong in them: the file, the line, and what was expected."""

from __future__ import annotations

import difflib
import re
import sys
import unicodedata

LOOKALIKE = re.compile("[\u00a0\u2000-\u2015\u202f\u2060\u2212\ufeff]")  # minus, hyphens and spaces that ASCII has not
POINT = re.compile(r"(?<![\w.])[-+]?(?:\.\d+|\d+\.(?!\d))(?:[eE][-+]?\d+)?")  # a number with a bare point
TEXT = re.compile(r"\"[^\"]*\"|'[^']*'")


def wrong(path, row, what, expected):
    """Raise a ValueError that names a file, its line (None: the whole), what is there, and what was expected."""
    place = f"{path}: " if row is None else f"{path}, line {row}: "
    raise ValueError(f"{place}{what}{lookalike(what)}; expected {expected}")


def lookalike(text):
    """Return the name of a character that looks like a minus, a hyphen or a space and is none, for messages."""
    found = LOOKALIKE.search(text)
    return f" (with U+{ord(found[0]):04X}, {unicodedata.name(found[0]).lower()})" if found else ""


def nearest(word, known, cutoff=0.5):
    """Return what a message on an unknown key says of the known ones; of words of our own only near ones are meant."""
    return meant(word, known, cutoff) or f"; known: {', '.join(sorted(known)) or 'none'}"


def meant(word, known, cutoff=0.5):
    """Return what a message on an unknown word says of the known one that is near, or nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return f" (do you mean '{close[0]}'?)" if close else ""


def points(line):
    """Return what a message says of a line with a number such as .5 or 1., which TOML does not know, or nothing."""
    found = POINT.search(TEXT.sub("", line).partition("#")[0])
    return f" ({found[0]}: TOML asks for a digit on both sides of the point)" if found else ""


def read_text(path):
    """Return the text of a file; ValueError where it is none."""
    try:
        with open(path, encoding="utf-8-sig", newline=None) as file:
            text = file.read()
    except UnicodeDecodeError as error:
        wrong(path, None, f"byte {error.start} is no text in UTF-8", "a text file; save it again as UTF-8")
    if "\0" in text:
        wrong(path, text[: text.index("\0")].count("\n") + 1, "holds a zero byte", "a text file")
    return text


def numbered_lines(path, continued=None):
    """Yield the number and the text of each line; lines that end in `continued` go on in the next one."""
    begun, whole = 0, ""
    for row, line in enumerate(read_text(path).split("\n"), 1):
        begun = begun or row
        whole += line
        if continued and line.endswith(continued):
            whole = whole[: -len(continued)] + " "
            continue
        yield begun, whole
        begun, whole = 0, ""
    if whole:
        yield begun, whole


def finite(word):
    """Return a word as a finite number, or None."""
    try:
        number = float(word)
    except ValueError:
        return None
    return number if abs(number) <= sys.float_info.max else None
