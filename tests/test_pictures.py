"""Pictures: they are drawn for every kind of structure, quickly, and say the truth."""

import time

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from latinpc.bench import paper_figures
from latinpc.results import pictures
from latinpc.results.units import scaled
from latinpc.scenes import make
from latinpc.scenes.scene import Law, Scene


@pytest.fixture
def drawn(monkeypatch):
    """The texts of the figures that were saved."""
    texts = []
    save = Figure.savefig

    def spy(figure, *arguments, **named):
        texts.append(" | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text)))
        return save(figure, *arguments, **named)

    monkeypatch.setattr(Figure, "savefig", spy)
    return texts


def _seen(path):
    """Return the share of the picture that is not white."""
    pixels = matplotlib.image.imread(path)[:, :, :3]
    assert min(pixels.shape[:2]) > 600
    return (pixels.min(axis=2) < 0.9).mean()


def _row(dim):
    nodes = np.zeros((4, dim))
    nodes[:, 0] = range(4)
    if dim > 1:
        nodes[1:3, 1] = 1.0
    return Scene("row", nodes, np.array([[0, 1], [1, 2], [2, 3]]), np.array([0, 1, 2]), np.ones(3))


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_any_dimension(tmp_path, drawn, dim, suffix):
    scene = _row(dim)
    path = tmp_path / f"row{suffix}"
    moved = 0.01 * np.ones((4, dim))
    pictures.draw_structure(scene, moved, np.array([-2e3, 0.0, -1.0]), np.array([0, 0, 1]), path)
    assert path.stat().st_size > 1000
    assert "slack cable (100 %)" in drawn[0] and "slack compression-only link (0 %)" in drawn[0]
    assert "Compression (kN)" in drawn[0] and "2 subdomains" in drawn[0]
    assert "Tension" not in drawn[0]  # nothing is in tension


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_open_contacts_have_no_width(tmp_path, drawn, suffix):
    scene = _row(2)
    scene.law[:] = Law.CONTACT
    path = tmp_path / f"row{suffix}"
    pictures.draw_structure(scene, np.zeros((4, 2)), np.array([-2e3, 0.0, 0.0]), path=path)
    assert path.stat().st_size > 1000 and "66.7 % are open" in drawn[0]


def test_nothing_moves_and_nothing_is_loaded(tmp_path, drawn):
    scene = _row(2)
    pictures.draw_structure(scene, np.zeros((4, 2)), np.zeros(3), None, tmp_path / "still.png")
    assert "largest displacement 0 m" in drawn[0]
    assert _seen(tmp_path / "still.png") > 0.001


def test_scales():
    assert scaled(2500.0, "N") == (1e3, "kN")
    assert scaled(0.02, "m") == (1e-3, "mm")
    assert scaled(0.0, "m") == (1.0, "m")
    for value, rounded in ((7.3, 5.0), (2.0, 2.0), (0.19, 0.1), (1234.0, 1000.0)):
        assert pictures.round_factor(value) == pytest.approx(rounded)


@pytest.fixture(scope="module")
def grid():
    """The article's largest grid, with invented results: 36,864 links."""
    scene = make("tensegrity-grid", modules=48, subdomains=144)
    x, y = scene.nodes[:, 0] / 48, scene.nodes[:, 1] / 48
    u = np.zeros_like(scene.nodes)
    u[:, 2] = -np.sin(np.pi * x) * (1 + y)
    middle = np.sin(np.pi * scene.nodes[scene.links].mean(axis=1)[:, 0] / 48)
    tension = np.where(scene.law == Law.BAR, -4e3, 3e3 * np.maximum(middle - 0.3, 0.0) + 0 * middle)
    return scene, u, tension


def test_article_figures_are_quick(grid, tmp_path, drawn):
    scene, u, tension = grid
    start = time.process_time()
    paper_figures.draw_figure_8(scene, u, tmp_path / "fig8.png")
    paper_figures.draw_figure_9(scene, tension, tmp_path / "fig9.png")
    pictures.draw_structure(scene, u, tension, scene.subdomain, tmp_path / "grid.png")
    assert time.process_time() - start < 20.0
    assert "Vertical displacement (m)" in drawn[0] and "drawn × 2" in drawn[0]
    assert "Compression in bars (kN)" in drawn[1] and "Tension in cables (kN)" in drawn[1]
    assert "of the cables slack" in drawn[1]
    for name in ("fig8.png", "fig9.png", "grid.png"):
        assert _seen(tmp_path / name) > 0.05
