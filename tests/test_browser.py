"""Structures for notebooks and browsers: what they show, and that the file needs nothing else."""

import re
import shutil

import numpy as np
import pytest
from conftest import ROOT, run
from PIL import Image
from test_cli import latinpc as command
from test_pictures import square

from latinpc.results import browser
from latinpc.scenes import make

graph = pytest.importorskip("plotly.graph_objects", exc_type=ImportError)
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
ALONE = [
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--window-size=1200,900", "--virtual-time-budget=8000",
]  # fmt: skip


def _trace(figure, start):
    return next(trace for trace in figure.data if trace.name.startswith(start))


def test_a_result_shows_forces_where_nodes_have_moved():
    result = make("net", side=6).solve()
    figure = result.interactive(amplification=3.0)
    names = [trace.name for trace in figure.data if trace.showlegend]
    assert any(name.startswith("pin (20)") for name in names) and any(name.startswith("load (25)") for name in names)
    shape = result.structure.nodes + 3.0 * result.displacements
    nodes = _trace(figure, "nodes")
    assert np.allclose(np.column_stack([nodes.x, nodes.y, nodes.z]), shape)
    taut = _trace(figure, "inextensible cable (")
    along = (result.structure.law == 3) & ~result.slack
    assert np.allclose(np.array(taut.line.color)[::3] * 1.0, result.tensions[along] / 1.0)
    assert taut.line.showscale and "drawn × 3" in figure.layout.title.text
    said = _trace(figure, "links").text
    assert len(said) == 60 and said[0].startswith("link 0: inextensible cable, ")  # drag acts across them


def test_a_structure_shows_its_laws_and_lies_flat():
    figure = square("cable").interactive()
    assert {"bar (4)", "cable (1)", "pin (2)"} <= {trace.name for trace in figure.data}
    assert figure.layout.scene.camera.projection.type == "orthographic"
    assert not np.any(_trace(figure, "nodes").z)


def test_what_has_not_converged_says_so():
    with pytest.warns(UserWarning, match="not converged"):
        result = square("cable").solve()
    figure = result.interactive()
    assert "COLLAPSE" in figure.layout.title.text and "largest displacement" not in figure.layout.title.text
    nodes = _trace(figure, "nodes")
    assert nodes.x[3] < 0.0 and np.allclose(nodes.x, np.add([0, 1, 1, 0], [0, 0, nodes.x[3], nodes.x[3]]))
    with pytest.warns(UserWarning, match="not converged"):
        result = make("tensegrity-grid", modules=4).solve(options={"snes_max_it": 1, "snes_stol": 1e-14})
    assert "NOT CONVERGED" in result.interactive().layout.title.text


def test_without_plotly_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "plotly.graph_objects", None)
    monkeypatch.setitem(__import__("sys").modules, "plotly", None)
    with pytest.raises(RuntimeError, match=r"latinpc\[interactive\]"):
        browser.interactive_figure(square())


def test_command_writes_one_file(tmp_path):
    text = command("solve", ROOT / "examples" / "tower.msh", "--html", "tower.html", cwd=tmp_path).stdout
    page = (tmp_path / "tower.html").read_text(encoding="utf-8")
    assert "tower.html" in text and "Plotly.newPlot" in page
    assert not re.search(r"<(script|link)[^>]*(src|href)=", page)  # nothing is fetched


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_a_browser_draws_it(tmp_path):
    """The canvas has the colours of forces and the legend its texts."""
    make("net", side=6).solve().to_html(tmp_path / "net.html")
    page = (tmp_path / "net.html").as_uri()
    chromium = [CHROMIUM, *ALONE, f"--user-data-dir={tmp_path / 'profile'}"]
    dom = run([*chromium, "--dump-dom", page], leaks=False).stdout
    for word in ("<canvas", "inextensible cable", "pin (20)", "Tension (N)"):
        assert word in dom, word
    run([*chromium, f"--screenshot={tmp_path / 'net.png'}", page], leaks=False)
    pixels = np.asarray(Image.open(tmp_path / "net.png").convert("RGB")).astype(int)[:, :900]
    red, green, blue = np.moveaxis(pixels, 2, 0)
    assert np.count_nonzero((blue > red + 60) & (blue > 100)) > 300  # cables in tension
    assert np.count_nonzero((green > red + 60) & (green > blue + 20)) > 50  # loads
