"""Pictures: they are drawn for every kind of structure, quickly, and say the truth."""

import time

import matplotlib.image
import numpy as np
import pytest
from conftest import ROOT
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from test_cli import latinpc as command
from test_files import MSH, TOML

import latinpc
from latinpc.bench import paper_figures
from latinpc.results import drawing, look, modepictures, pictures, symbols
from latinpc.results.drawing import STAMP_COLOUR, SUPPORT_COLOUR, _pixels
from latinpc.results.film import draw_motion
from latinpc.results.look import SLACK_COLOUR, Scale
from latinpc.results.mechanism import free_motion
from latinpc.results.units import counted, number, quantity, scaled, share
from latinpc.runs.motion import move
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


def _written(figure):
    """Return all texts of a figure."""
    return " | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text))


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
    assert "slack cable (100 %)" in drawn[0] and "slack compression-only link" not in drawn[0]
    assert "Force (kN), compression negative" in drawn[0] and "2 subdomains" in drawn[0]


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_open_contacts_have_no_width(tmp_path, drawn, suffix):
    scene = _row(2)
    scene.law[:] = Law.CONTACT
    path = tmp_path / f"row{suffix}"
    pictures.draw_structure(scene, np.zeros((4, 2)), np.array([-2e3, 0.0, 0.0]), path=path)
    assert path.stat().st_size > 1000 and "66.7 % are open" in drawn[0]


def test_contacts_at_one_place_are_discs():
    """The forces between the blocks of an arch, lines of no length, were not seen."""
    result = latinpc.scenes.make("arch", blocks=5).solve()
    touch = result.structure.law == Law.FRICTION
    figure = result.plot()
    (discs,) = (found for found in figure.axes[0].collections if isinstance(found, PathCollection))
    push = -result.tensions[touch]
    assert push.max() > 0.0 and np.allclose(discs.get_sizes() / discs.get_sizes().max(), (push / push.max()) ** 2)
    corners = result.structure.nodes[result.structure.links[touch, 0]]
    assert np.allclose(discs.get_offsets(), corners, atol=0.2 * np.ptp(corners))
    (key,) = (line for line in figure.legends[0].get_lines() if line.get_marker() == "o")
    assert key.get_linestyle() == "None"
    apart = latinpc.scenes.make("packing", side=4).solve().plot()
    assert not any(isinstance(found, PathCollection) for found in apart.axes[0].collections)


def test_links_without_force_are_grey(drawn, tmp_path):
    scale = look.Scale(np.array([2e3, -1e-9]))
    colours = scale.colours([2e3, 1.0, -1e-9, 0.0])
    grey = matplotlib.colors.to_rgba(look.IDLE_COLOUR)
    assert [tuple(colour) == grey for colour in colours] == [False, False, True, True]
    assert not (scale.map().colors == grey).all(axis=1).any()
    pictures.draw_structure(_row(2), np.zeros((4, 2)), np.array([-1e-9, 2e3, -1.0]), path=tmp_path / "row.png")
    assert "no force (1)" in drawn[0] and "slack" not in drawn[0]


@pytest.mark.parametrize("length", [4.2, 7.3, 50.0])
def test_ticks_are_at_round_numbers(length):
    points = np.array([[0.0, 0.0], [length, 0.3 * length]])
    axes = drawing.axes_2d(drawing.new_figure(8, 5), [0.1, 0.1, 0.8, 0.8], points)
    steps = np.concatenate([np.diff(axes.get_xticks()), np.diff(axes.get_yticks())])
    for step in steps:
        assert any(
            np.isclose(step / 10.0 ** np.floor(np.log10(step) + 1e-9), round_one) for round_one in (1, 2, 2.5, 5)
        )


@pytest.mark.parametrize("width", [1.0, 3.0, 6.0])
def test_labels_of_short_edges_are_apart_from_their_ticks(width):
    """As of a long and narrow bridge."""
    figure = drawing.new_figure(12.0, 7.2)
    axes = drawing.axes_for(figure, pictures.MAIN_3D, np.array([[-1.0, 0.0, -8.0], [49.0, width, 3.0]]))
    drawing.label_axes(figure, axes)
    figure.canvas.draw()
    (label,) = (text for text in figure.texts if text.get_text() == "y (m)")
    ticks = [tick.label1 for tick in axes.yaxis.majorTicks]
    assert ticks and not any(label.get_window_extent().overlaps(tick.get_window_extent()) for tick in ticks)


@pytest.mark.parametrize("size", [(12.0, 7.2), (8.0, 4.8)])
@pytest.mark.parametrize("extent", [(2.0, 2.0, 7.0), (50.0, 2.0, 1.0), (1.0, 50.0, 20.0), (9.0, 9.0, 9.0)])
def test_labels_of_axes_are_inside_the_picture(extent, size):
    """Those below a tower were cut."""
    figure = drawing.new_figure(*size)
    axes = drawing.axes_for(figure, pictures.MAIN_3D, np.array([[0.0, 0.0, 0.0], extent]))
    drawing.label_axes(figure, axes)
    figure.canvas.draw()
    drawn = [text.get_window_extent() for text in figure.texts]
    assert len(drawn) == 3 and all(figure.bbox.fully_containsx(x) for box in drawn for x in (box.x0, box.x1))
    assert all(figure.bbox.fully_containsy(y) for box in drawn for y in (box.y0, box.y1))


def test_nothing_moves_and_nothing_is_loaded(tmp_path, drawn):
    scene = _row(2)
    pictures.draw_structure(scene, np.zeros((4, 2)), np.zeros(3), None, tmp_path / "still.png")
    assert "largest displacement 0 m" in drawn[0]
    assert _seen(tmp_path / "still.png") > 0.001


def test_rounding_is_not_made_visible():
    """A chain that hangs as it was drawn moved by 1e-16 m, and its picture was a zigzag."""
    nodes = np.array([[0.0, 0.0], [3.0, 0.0]])
    assert pictures.amplification_of(nodes, 2e-16) == 1.0
    assert pictures.amplification_of(nodes, 2e-6) == pytest.approx(1e5)
    with pytest.raises(ValueError, match="a finite number, not inf"):
        pictures.amplification_of(nodes, 2e-6, np.inf)
    with pytest.raises(ValueError, match="a finite number, not 'x'"):
        pictures.amplification_of(nodes, 2e-6, "x")


def test_large_displacements_are_not_drawn_smaller():
    """A tower that buckles was drawn at half its displacements, a shape in which it is not in balance."""
    nodes = np.array([[0.0, 0.0], [3.0, 0.0]])
    assert pictures.amplification_of(nodes, 1.0) == 0.2
    assert pictures.amplification_of(nodes, 1.0, geometry="large") == 1.0
    assert pictures.amplification_of(nodes, 1.0, 0.5, "large") == 0.5
    given = {"nodes": [[-1, 0], [1, 0], [0, 0]], "links": [[0, 2], [1, 2]], "law": "cable", "stiffness": 1e3}
    held = {"fixed": [[1, 1], [1, 1], [0, 0]], "load": [[0, 0], [0, 0], [0, -1e3]], "geometry": "large"}
    result = latinpc.Structure(**given, **held).solve()
    assert abs(result.displacements).max() > 0.5
    assert "drawn × 1" in _written(result.plot())
    assert "drawn × 0.2" in _written(result.plot(amplification=0.2))


def test_scales():
    assert scaled(2500.0, "N") == (1e3, "kN")
    assert scaled(0.02, "m") == (1e-3, "mm")
    assert scaled(0.0, "m") == (1.0, "m")
    assert quantity(999.7, "N") == "1 kN" and quantity(999.4, "N") == "999 N" and quantity(-1e3, "N") == "-1 kN"
    assert quantity(999.97, "s", 4) == "1 ks"
    assert counted(1, "subdomain") == "1 subdomain" and counted(2500, "subdomain") == "2,500 subdomains"
    assert [number(value) for value in (123456.0, 1000.0, 0.5, 1.23e-5)] == ["123,000", "1,000", "0.5", "0.0000123"]
    assert [share(part) for part in (0.0, 1e-9, 1.9e-4, 0.5)] == ["0 %", "less than 0.0001 %", "0.019 %", "50 %"]
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


# ---- supports, loads, numbers ----------------------------------------------------------------


def square(law="bar", diagonal=True, **changes):
    """A square of four bars on two pins, with a diagonal or as a mechanism."""
    links = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]][: 5 if diagonal else 4]
    given = {"law": ["bar"] * 4 + [law] * diagonal, "stiffness": 1e6, "fixed": [[1, 1], [1, 1], [0, 0], [0, 0]]}
    given |= {"load": [[0, 0], [0, 0], [-5.0, 0], [0, 0]], "name": "square"} | changes
    return latinpc.Structure([[0, 0], [1, 0], [1, 1], [0, 1]], links, **given)


def test_all_supports_of_a_net_are_on_the_canvas():
    """All 36 were to be seen, and 31 were: axes in perspective cut what lies outside their own square."""
    scene = make("net", side=10)
    figure = pictures.structure_figure(scene, np.zeros_like(scene.nodes), np.ones(len(scene.links)))
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
    dark = np.abs(pixels - [int(SUPPORT_COLOUR[i : i + 2], 16) for i in (1, 3, 5)]).max(axis=2) < 8
    stands = symbols.supports(scene.fixed, scene.nodes, scene.links[pictures.drawn_links(scene)])
    assert len(stands) == 1 and len(stands[0].nodes) == 36
    for feet in stands[0].triangles.reshape(6, 36, 3, 3).mean(axis=(0, 2)):  # the middle of each
        x, y = _pixels(figure.axes[0], [feet])[0]
        row, column = round(dark.shape[0] - y), round(x)
        assert dark[row - 8 : row + 9, column - 8 : column + 9].any(), feet


def test_supports_are_pins_and_rollers_at_their_nodes():
    fixed = np.array([[1, 1], [0, 1], [0, 0], [1, 0]], bool)
    nodes, links = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]]), np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    pin, roller = symbols.supports(fixed, nodes, links)
    assert pin.filled and list(pin.nodes) == [0] and not roller.filled and list(roller.nodes) == [1, 3]
    for symbol in (pin, roller):
        assert np.allclose(symbol.triangles[:, 0], nodes[symbol.nodes])  # their tips
    foot = roller.lines.mean(axis=1) - nodes[roller.nodes]
    assert np.allclose(np.abs(foot) > 1e-12, [[False, True], [True, False]])  # across their plates
    assert (foot.sum(axis=1) < 0.0).all()  # away from the structure: below, and at the left
    assert (pin.triangles[0, 1:, 1] < 0.0).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_arrows_are_as_long_as_their_forces(dim):
    nodes = np.eye(4, dim) * 3.0
    links = np.array([[0, 1], [1, 2], [2, 3]])
    force = np.zeros((4, dim))
    force[0, 0], force[2, 1] = 4.0, -1.0
    lines, acting = symbols.arrows(force, nodes, links)
    assert list(acting) == [0, 2]
    shafts = np.diff(lines[:2], axis=1)[:, 0]
    assert np.linalg.norm(shafts[0]) == pytest.approx(4.0 * np.linalg.norm(shafts[1]))
    assert shafts[0, 0] > 0.0 > shafts[1, 1] and len(lines) == 2 * (1 + 2 * (dim - 1))
    ends = lines[:2].reshape(-1, dim)
    assert all(np.linalg.norm(ends - nodes[node], axis=1).min() < 1e-12 for node in acting)


def test_many_arrows_cover_no_more_of_the_structure():
    """Their lengths together grow with the root of their number: a load on each node does not hide the links."""

    def total(count):
        nodes = np.column_stack([np.arange(count), np.zeros(count)]).astype(float)
        links = np.column_stack([np.arange(count - 1), np.arange(1, count)])
        lines, acting = symbols.arrows(np.tile([0.0, -1.0], (count, 1)), nodes, links)
        assert len(acting) == count
        return np.linalg.norm(np.diff(lines[:count], axis=1)[:, 0], axis=1).sum()

    assert total(symbols.CROWD) == pytest.approx(symbols.CROWD * symbols.ARROW_OF_LINK)  # few are as long as ever
    assert total(4 * symbols.CROWD) == pytest.approx(2 * total(symbols.CROWD))


def test_one_scale_for_tension_and_compression():
    """The strength of a colour follows the size of a force, whatever its sign and the others of that sign."""
    scale = Scale(np.array([-10.0, 0.0]), np.array([40.0]))
    low, half, full = scale.colours([-10.0, -40.0, 40.0])
    alone = Scale(np.array([-10.0])).colours([-10.0])[0]
    assert not np.allclose(low, alone) and np.allclose(half, alone)
    assert full[2] > full[0] and half[0] > half[2]  # cool, warm
    assert scale.map().N == 512 and np.allclose(scale.map()(1.0), full) and scale.low == -10.0


def test_an_envelope_shows_the_tension_of_cables_that_are_slack_in_another_case():
    """Two cables of which one is slack in each case, a bar, and a cable that is too long in both."""
    row = latinpc.Structure(
        [[0.0], [1.0], [2.0]], [[0, 1], [1, 2], [0, 1], [1, 2]], ["cable", "cable", "bar", "cable"], 1e6,
        fixed=[[1], [0], [1]], initial_elongation=[0.0, 0.0, 0.0, -1.0],
    )  # fmt: skip
    cases = [latinpc.Case(name, load=[[0.0], [load], [0.0]]) for name, load in (("right", 1e3), ("left", -2e3))]
    found = latinpc.solve_cases(row, cases)
    assert found.slack.T.tolist() == [[False, True], [True, False], [False, False], [True, True]]
    figure = found.plot()
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert {"slack in all cases (1)", "slack in some case (2)"} < set(texts)
    lines = next(one for one in figure.axes[0].collections if isinstance(one, LineCollection))
    colours, scale = lines.get_colors(), Scale(*found.envelope()[:2])
    assert np.allclose(colours[:3], scale.colours(found.tensions.max(axis=0)[:3]))
    assert np.allclose(colours[3], to_rgba(SLACK_COLOUR))
    assert [pattern is not None for _, pattern in lines.get_linestyle()] == [True, True, False, False]
    one = latinpc.solve_cases(row, cases[:1]).plot()
    assert "slack in some" not in str([text.get_text() for legend in one.legends for text in legend.get_texts()])


def test_a_structure_is_drawn_as_given_with_numbers():
    structure = square("cable")
    text = _written(structure.plot())
    for word in ("square", "bar (4)", "cable (1)", "pin (2)", "load (1), largest 5 N", "x (m)"):
        assert word in text, word
    assert [f" {number} " in f" {text} " for number in range(5)] == [True] * 5
    assert _written(structure.plot(numbers=False)).count(" | ") < text.count(" | ")
    assert structure.plot()._repr_png_().startswith(b"\x89PNG")  # notebooks show it without pyplot
    assert "link" in _written(square().solve().plot(numbers=True))
    assert make("net", side=4).plot() is not None


# ---- what is no equilibrium ------------------------------------------------------------------


def test_a_free_motion_changes_no_length():
    """Of the motions of a mechanism the loads choose; a structure that resists has none, however slender it is."""
    rng = np.random.default_rng(3)
    nodes = np.column_stack([np.repeat(np.arange(6.0), 2), np.tile([0.0, 1.0], 6)]) + 0.05 * rng.normal(size=(12, 2))
    links = [[2 * i, 2 * i + 1] for i in range(6)] + [[2 * i + j, 2 * i + 2 + j] for i in range(5) for j in (0, 1)]
    fixed = np.zeros((12, 2), bool)
    fixed[0] = fixed[10] = True
    scene = Scene("frame", nodes, np.array(links), np.zeros(16, int), np.geomspace(1.0, 1e9, 16), fixed=fixed)
    scene.load[5] = [0.0, -3.0]
    motion = free_motion(scene)
    relative = motion[scene.links[:, 1]] - motion[scene.links[:, 0]]
    assert np.abs(np.einsum("ij,ij->i", relative, scene.directions)).max() < 1e-9
    assert np.linalg.norm(motion, axis=1).max() == pytest.approx(1.0) and not motion[fixed].any()
    assert (scene.load * motion).sum() > 0.1 * 3.0  # the way that the load pushes
    assert free_motion(make("lattice", nx=200, ny=2, partition="metis")) is None
    assert square().free_motion() is None


def test_a_picture_is_written_by_its_figure():
    """A path, in place of the figure to draw into, had ended in an AttributeError."""
    for thing in (square(), square().solve()):
        with pytest.raises(TypeError, match=r"not 'net\.png'; plot\(\)\.savefig\(path\) writes a picture"):
            thing.plot("net.png")


def test_mechanism_and_collapse_are_drawn_as_such():
    text = _written(square(diagonal=False).plot(mechanism=True))
    assert "MECHANISM" in text and "nodes that move: 2, 3" in text
    with pytest.raises(ValueError, match="no mechanism"):
        square().plot(mechanism=True)
    with pytest.warns(latinpc.ConvergenceWarning):
        result = square("cable").solve()
    assert np.allclose(result.free_motion, [[0, 0], [0, 0], [-1, 0], [-1, 0]], atol=1e-9)
    text = _written(result.plot())
    assert "COLLAPSE" in text and "motion of slack links" in text and "motion that no link resists" in text
    proved = [notice for notice in result.notices if notice.startswith("no equilibrium: ")]
    assert proved and proved[0] in text and "nodes that move" not in text  # the same nodes
    with pytest.warns(latinpc.ConvergenceWarning):
        cable = latinpc.Structure([[0.0], [1.0]], [[0, 1]], "cable", 1.0, fixed=[[1], [0]], load=[[0], [-1.0]]).solve()
    text = _written(cable.plot())
    assert "motion of slack links" in text and "motion that no link resists" not in text and "red" not in text
    held = square("cable", load=[[0, 0], [0, 0], [5.0, 0], [0, 0]]).solve()
    assert held.free_motion is None and "COLLAPSE" not in _written(held.plot())


def test_a_small_part_that_moves_fills_the_picture():
    """A rod on one node of a lattice: it, its surroundings, and where that is; nothing else is red."""
    scene = make("lattice", nx=40, ny=28)
    node = int(np.linalg.norm(scene.nodes - scene.nodes.mean(axis=0), axis=1).argmin())
    rod = np.vstack([scene.nodes, scene.nodes[node] + 0.01 * np.ptp(scene.nodes, axis=0)])
    fixed = np.vstack([scene.fixed, np.zeros((1, scene.dim), bool)])
    links = np.vstack([scene.links, [node, len(scene.nodes)]])
    hung = Scene("hung", rod, links, np.append(scene.law, Law.BAR), np.append(scene.stiffness, 1e6), fixed=fixed)
    motion = free_motion(hung)
    assert np.flatnonzero(np.linalg.norm(motion, axis=1) > 0.5).tolist() == [len(scene.nodes)]
    figure = hung.plot(mechanism=True)
    text = _written(figure)
    assert f"nodes that move: {len(scene.nodes)}" in text and "where that is" in text and "MECHANISM" in text
    main, corner = figure.axes[0], figure.axes[-1]
    assert np.ptp(main.get_xlim()) < 0.2 * np.ptp(corner.get_xlim())
    counts = [len(lines.get_segments()) for axes in (main, corner) for lines in axes.collections
              if isinstance(lines, LineCollection) and to_hex(lines.get_colors()[0]) == STAMP_COLOUR]  # fmt: skip
    assert counts[0] == counts[-1] == 1


def test_what_does_not_move_is_faint():
    """Half of a frame sways: the other half is not drawn twice."""
    nodes = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
    links = [[0, 3], [1, 4], [3, 4], [0, 4], [4, 5], [2, 5]]
    fixed = np.array([[1, 1], [1, 1], [0, 1], [0, 0], [0, 0], [0, 0]], bool)
    frame = Scene("frame", np.array(nodes, float), links, "bar", 1e6, fixed=fixed)
    figure = frame.plot(mechanism=True)
    red = [lines for lines in figure.axes[0].collections
           if isinstance(lines, LineCollection) and to_hex(lines.get_colors()[0]) == STAMP_COLOUR]  # fmt: skip
    assert [len(lines.get_segments()) for lines in red] == [1]


def test_what_has_not_converged_has_a_stamp():
    scene = make("tensegrity-grid", modules=4)
    with pytest.warns(latinpc.ConvergenceWarning):
        result = scene.solve(options={"snes_max_it": 1, "snes_stol": 1e-14})
    text = _written(result.plot())
    assert "NOT CONVERGED" in text and "iterations that -snes_max_it allows were not enough" in text
    assert "NOT CONVERGED" not in _written(scene.solve().plot())


def test_command_draws_the_motion_of_a_mechanism(tmp_path):
    (tmp_path / "frame.msh").write_text(MSH)
    moved = TOML.replace("[supports.feet]", "[supports.top]").replace("[loads.top]", "[loads.feet]")
    (tmp_path / "frame.toml").write_text(moved)
    said = command("solve", "frame.msh", "--picture", "f.png", code=2, cwd=tmp_path).stderr
    assert "f.png shows the motion that no link resists" in said and "mechanism" in said
    assert _seen(tmp_path / "f.png") > 0.005


@pytest.mark.parametrize(
    "arguments", [["--amplify", "50"], ["--amplify", "nan", "--html", "a.html"], ["--num-steps", 3, "--html", "a.html"]]
)
def test_command_refuses_pictures_without_meaning(arguments, tmp_path):
    scene = ["bouncing-chain"] if "--num-steps" in arguments else [ROOT / "examples" / "tower.msh"]
    said = command("solve", *scene, *arguments, code=2, cwd=tmp_path).stderr
    assert "pictures" in said or "statics" in said or "--amplify nan: displacements are multiplied by a finite" in said


@pytest.mark.filterwarnings("ignore:nodes move", "ignore:not converged")
def test_names_with_dollars_are_drawn_as_they_are(tmp_path):
    """They are no formulas."""
    name = r"cost $\no such$ 5"
    scene = latinpc.scenes.Scene(
        name, [[0.0, 0.0], [1.0, 0.0]], [[0, 1]], "bar", 1e3, fixed=[[1, 1], [0, 1]], load=[[0, 0], [1.0, 0]],
        mass=[1.0, 1.0], time_step=1e-3,
    )  # fmt: skip
    case = latinpc.Case(r"$\no$", load=[[0, 0], [1.0, 0]])
    modes = latinpc.modes(latinpc.Structure.from_scene(scene), 1)
    for thing in (scene, scene.solve(), latinpc.solve_cases(scene, [case], {"snes_max_it": 0}), modes):
        thing.plot().savefig(tmp_path / "a.png")
    modes.animate(tmp_path / "a.gif")
    draw_motion(move(scene, 1), tmp_path / "a.gif")


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_the_link_that_moves_most_has_the_colour_of_the_key():
    """One end of every link that moves is held: the mean of both ends is half of the most."""
    pytest.importorskip("slepc4py")
    fan = {"nodes": [[-1, 0], [0, 0], [1, 0], [0, 1]], "links": [[0, 3], [1, 3], [2, 3]], "law": "bar", "EA": 1e6}
    modes = latinpc.Structure(**fan, fixed=[[1, 1], [1, 1], [1, 1], [0, 0]], mass=1.0).solve().modes(1)
    found = [lines.get_colors() for lines in modes.plot().axes[0].collections]
    bright = matplotlib.colormaps[modepictures.COLOURS](modepictures.BRIGHTEST)
    assert any(np.allclose(colours, bright, atol=0.01) for colours in found)
