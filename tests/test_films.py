"""Films of motions: what they show, on one scale, and that drawing what moves alone changes no pixel."""

import matplotlib
import numpy as np
import pytest
from PIL import Image

from latinpc.results.film import Film, draw_motion
from latinpc.results.look import Scale, force_look
from latinpc.runs.history import History
from latinpc.runs.motion import move
from latinpc.scenes import Law, make


def written(figure):
    """Return all texts of a figure."""
    return " | ".join(text.get_text() for text in figure.findobj(matplotlib.text.Text))


def test_a_film_shows_supports_masses_and_scales(tmp_path, monkeypatch):
    motion, texts, image = move(make("impact-tower", levels=3, subdomains=1), 4, every=2), [], Film.image
    monkeypatch.setattr(Film, "image", lambda one, moves: texts.append(written(one.figure)) or image(one, moves))
    draw_motion(motion, tmp_path / "a.gif", amplification=7.0)
    assert len(texts) == Image.open(tmp_path / "a.gif").n_frames == 3
    for word in ("mass 200 kg", "pin (3)", "drawn × 7", "x (m)", "z (m)", "slack cable", "t = "):
        assert all(word in text for text in texts), word
    assert len(set(texts)) == 3  # each has its time
    bar = np.array(Image.open(tmp_path / "a.gif").convert("RGB"))[70:220, 647]
    assert len(np.unique(bar, axis=0)) > 20  # no bands


@pytest.mark.parametrize("name", ["impact-tower", "bouncing-chain"])
def test_frames_of_a_film_are_those_of_whole_figures(name):
    """What moves is drawn upon a picture of what stays: no pixel differs."""
    motion = move(make(name, **{"impact-tower": {"levels": 2}, "bouncing-chain": {"links": 4}}[name]), 40, every=20)
    film = Film(motion)
    for frame in motion.frames:
        moves = film.add(frame)
        film.figure.canvas.draw()
        whole = np.array(film.figure.canvas.buffer_rgba())
        film.image(moves)
        assert np.array_equal(np.asarray(film.figure.canvas.buffer_rgba()), whole)


def test_films_show_the_loads_that_act():
    """On one scale: half of the load has arrows of half the length, at the nodes where they have moved."""
    scene = make("lattice", nx=6, ny=3)
    motion = move(scene, 4, 1e-3, mass=10.0, every=1, history=History([0.0, 4e-3], [0.0, 1.0]))
    film, loaded = Film(motion, 1.0), np.flatnonzero(scene.load.any(axis=1))
    for frame, factor in zip(motion.frames, (0.0, 0.25, 0.5, 0.75, 1.0)):
        assert frame.load == pytest.approx(factor * scene.load)
        shafts = film.arrows(frame)[: len(loaded)]
        assert len(shafts) == (len(loaded) if factor else 0)
        if factor:
            longest = factor * np.linalg.norm(np.diff(film.arrows(motion.frames[-1]), axis=1), axis=2).max()
            assert np.linalg.norm(np.diff(shafts, axis=1), axis=2).max() == pytest.approx(longest)
            ends = (scene.nodes + frame.displacements)[loaded]
            assert np.isclose(shafts, ends[:, None]).all(axis=2).any(axis=1).all()
    film.add(motion.frames[0])
    assert f"load ({len(loaded)}), largest" in written(film.figure)


def test_contacts_that_bear_rounding_are_not_dashed():
    """Dashes are as long as lines are wide: those of a width of rounding have no end, and drawing had none."""
    tensions = np.array([-1e-15, -1.0, 0.0])
    _, widths, styles = force_look(np.full(3, Law.CONTACT), tensions, tensions > -1e-9, Scale(tensions))
    assert list(widths > 0.0) == [False, True, False]
    assert all(dashes is None for _, dashes in styles)
