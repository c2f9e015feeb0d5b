"""The site: every public name has its place in the reference, and the README is short."""

import importlib
import re
import sys

import pytest
from conftest import ROOT

import latinpc

DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))
c_pages = importlib.import_module("c_pages")


def test_readme_is_short_and_shows_a_picture():
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 130
    pictures = re.findall(r"!\[[^\]]+\]\((.*?)\)", text)
    assert pictures and all((ROOT / path).stat().st_size > 10000 for path in pictures)


def test_public_names_are_in_the_reference():
    page = (DOCS / "reference" / "python.md").read_text()
    listed = set(re.findall(r"^\.\. auto\w+:: (?:latinpc\.)?(\w+)$", page, re.MULTILINE))  # scenes, the module, as well
    assert set(latinpc.__all__) <= listed
    assert {generator.__name__ for generator in latinpc.scenes.SCENES.values()} <= set(latinpc.scenes.__all__)


def test_public_functions_in_c_have_a_manual_page():
    functions = c_pages.public_functions()
    assert len(functions) > 60
    assert [name for name, page in functions.items() if page is None] == []


def test_each_function_in_c_is_in_one_section():
    page = (DOCS / "reference" / "c.md").read_text()
    sections = re.findall(r"\{manual-pages\} (.*)", page)
    for name in c_pages.public_functions():
        assert len([names for names in sections if re.fullmatch(names, name)]) == 1, name


def test_manual_pages_list_arguments():
    for name, (arguments, text) in c_pages.public_functions().items():
        names = re.findall(r"(\w+)(?:\[\])*(?:,|$)", arguments)
        listed = re.findall(r"^[+.-] (\w+) +- ", text.partition("Options Database")[0], re.MULTILINE)
        assert listed or len(names) < 2, name
        assert set(listed) <= set(names), (name, set(listed) - set(names))


def test_manual_pages_lead_to_others():
    functions = c_pages.public_functions()
    known = functions.keys() | c_pages.solver_types().keys()
    for name, (_, text) in functions.items():
        others = re.findall(r"`(\w*Latin\w*(?=\(\))|\w+LATIN)", text.partition("\n.seealso: ")[2])
        assert others and name not in others and set(others) <= known, (name, others)


def test_manual_pages_become_markdown():
    functions = c_pages.public_functions()
    text = c_pages.markdown("LatinSetDirection", *functions["LatinSetDirection"], functions)
    assert (
        "{c:function} PetscErrorCode LatinSetDirection(Latin latin, LatinDirectionType type, PetscReal value)" in text
    )
    assert "- `type`: approximation of the stiffness" in text
    assert "of interfaces, is between 1e-10 and 1e10" in text.replace("\n", " ")  # an item of two lines
    assert "Level" not in text
    macro = c_pages.markdown("LatinGetStatistics", *functions["LatinGetStatistics"], functions)
    assert "LatinGetStatistics(Latin latin, LatinStatistics *statistics)" in macro and "Synopsis" not in macro


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_pages_have_one_title(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    assert text.startswith("# ")
    assert len(re.findall(r"^# ", text, re.MULTILINE)) == 1
