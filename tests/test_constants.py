"""Every constant of the C code has its row in benchmarks/constants.md, with the value and the file that it has."""

import importlib
import re
import sys
from collections import Counter

import pytest
from conftest import ROOT

SOURCES = ROOT / "latinpc" / "src"
PAGE = (ROOT / "benchmarks" / "constants.md").read_text()
WORDS = Counter(re.findall(r"\b\w*LATIN_\w+", "".join(file.read_text() for file in SOURCES.rglob("*.[ch]"))))


@pytest.fixture(scope="module")
def constants():
    """The program that writes the page."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    yield importlib.import_module("constants")
    sys.path.remove(str(ROOT / "benchmarks"))


def test_every_constant_has_a_row(constants):
    assert constants.unlisted() == []


def test_rows_have_the_values_of_the_sources(constants):
    for line in constants.others_table():
        assert line in PAGE, "python benchmarks/constants.py --page writes the page again"


def test_measured_rows_are_those_of_the_sources(constants):
    for name, about in constants.TUNING.items():
        file, text = constants.definition(SOURCES, name)
        assert f"`{name}` {text} {about.unit}<br>`{file}`" in PAGE, "measure it again: python benchmarks/constants.py"


def test_every_constant_is_used(constants):
    for name in (*constants.TUNING, *constants.OTHERS):
        assert WORDS[name] > 1, name
