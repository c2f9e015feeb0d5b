"""Supports that move with large displacements: along the same path as the loads."""

from dataclasses import replace

import numpy as np
import pytest
import turning
from petsc4py import PETSc
from turning import von_mises

import latinpc
from latinpc.bench.extremes.corotational import Corotational
from latinpc.options import default_options
from latinpc.runs.solve import solve
from latinpc.scenes import Scene, make

LIMIT = turning.von_mises_limit()


def truss(part, along, down=0.0):
    """Two bars that lean on each other, under a part of the limit load; the second foot moves."""
    given = von_mises(part * LIMIT) | {"prescribed": [[0.0, 0.0], [along, -down], [0.0, 0.0]]}
    return Scene(name="truss", **given, geometry="large")


def settled(name, foot, moved, **options):
    """A scene one of whose supports moves."""
    scene = make(name, **options)
    prescribed = np.zeros(scene.nodes.shape)
    prescribed[np.flatnonzero(scene.fixed.all(axis=1))[foot]] = moved
    return replace(scene, prescribed=prescribed)


FOLLOWED = {
    "truss": lambda: truss(0.9, -0.3),
    "mast": lambda: settled("mast", 1, [0.0, 0.0, -0.2]),
    "guy": lambda: settled("mast", 0, [0.0, 0.0, -0.02]),
    "tower": lambda: settled("tower", 0, [0.0, 0.0, -0.2]),
    "bridge": lambda: settled("bridge", 1, [0.3, 0.0, -0.3]),
    "net": lambda: settled("saddle", 0, [0.0, 0.0, 0.3]),
}


@pytest.mark.parametrize("name", FOLLOWED)
@pytest.mark.parametrize("subdomains", [1, 5])
def test_loads_and_supports_along_one_path(name, subdomains):
    """The equilibrium of an independent path in small increments; the truss had snapped through."""
    scene = FOLLOWED[name]()
    subdomains = min(subdomains, len(scene.links))
    exact = Corotational(scene).follow()
    result = scene.solve(error=1e-8, options={"snes_latin_subdomains": subdomains})
    assert exact.factor == 1.0
    assert result.converged
    assert np.abs(result.displacements - exact.displacements).max() < 1e-7 * np.abs(exact.displacements).max()


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("load", [0.5, 0.0])
def test_a_support_moves_to_a_limit_point(load):
    """It ends there, with the last stable state: its supports are those of the part that is borne."""
    scene = truss(load, 0.2)
    path = Corotational(scene).follow()
    result = scene.solve(error=1e-8)
    factor = result.report["load_factor"]
    assert result.converged == (load == 0.0) == path.follows
    assert factor == pytest.approx(path.factor, abs=2e-4)
    assert result.displacements[1] == pytest.approx([0.2 * factor, 0.0], rel=1e-12)
    assert result.balance.force < 1e-6
    assert result.structure.prescribed == pytest.approx(scene.prescribed)
    at = Corotational(replace(scene, load=factor * scene.load, prescribed=factor * scene.prescribed))
    u = at.newton(result.displacements.astype(np.longdouble))
    assert np.abs(result.displacements - u).max() < 1e-6
    assert at.stable(u)
    if load:
        assert "no stable equilibrium follows" in result.reason
        assert any(f"that of {factor:.4g} of the loads" in text for text in result.notices)


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_units_and_turns_change_nothing():
    """Of a tower whose foot settles, and of a truss that ends at a limit point."""
    for scene in (settled("tower", 0, [0.0, 0.0, -0.2]), truss(0.5, 0.2)):
        plain = scene.solve(error=1e-9)
        dim = scene.nodes.shape[1]
        turn = np.linalg.qr(np.random.default_rng(1).normal(size=(dim, dim)))[0]
        whole = scene.fixed.all(axis=1) == scene.fixed.any(axis=1)
        assert whole.all()
        turned = {key: getattr(scene, key) @ turn.T for key in ("nodes", "load", "prescribed")}
        other = replace(scene, **turned).solve(error=1e-9)
        assert other.report["load_factor"] == pytest.approx(plain.report["load_factor"], abs=1e-9)
        assert other.displacements @ turn == pytest.approx(plain.displacements, rel=1e-6, abs=1e-7)
        for force, length in ((1e-9, 1e3), (1e9, 1e-3)):
            units = {"nodes": length, "prescribed": length, "initial_elongation": length, "load": force}
            units["stiffness"] = force / length
            scaled = replace(scene, **{key: getattr(scene, key) * by for key, by in units.items()})
            other = scaled.solve(error=1e-9)
            assert other.report["load_factor"] == pytest.approx(plain.report["load_factor"], abs=1e-9)
            assert other.displacements / length == pytest.approx(plain.displacements, rel=1e-6, abs=1e-7)


def job():
    """Solve for a tower, and for a truss that ends at a limit point, on any number of ranks (`jobs.py`)."""
    found = {}
    for name, scene in (("tower", settled("tower", 0, [0.0, 0.0, -0.2])), ("truss", truss(0.5, 0.2))):
        structure = latinpc.Structure.from_scene(scene)
        with default_options({"snes_latin_error": 1e-8}):
            snes, u = structure.create_snes(), structure.create_vec()
            snes.setFromOptions()
        snes.solve(None, u)
        found[name] = [int(snes.getConvergedReason()), latinpc.path(snes)["borne"], u.norm()]
    return found


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_find_the_same(ranks_for, ranks):
    """A stable equilibrium, and a limit point."""
    one, many = job(), ranks_for(ranks, "test_large_supports")
    for name, (reason, borne, size) in one.items():
        assert many[name][0] == reason
        assert many[name][1:] == pytest.approx([borne, size], rel=1e-7)


def series(warm):
    """A truss under half of its limit load whose foot moves on from solve to solve; the last step is too far."""
    structure = latinpc.Structure.from_scene(truss(0.5, 0.0))
    with default_options({"snes_latin_error": 1e-10} | ({"snes_latin_warm_start": "last"} if warm else {})):
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
    for along in (0.0, 0.01, 0.02, 0.2):
        structure.set_prescribed([[0.0, 0.0], [along, 0.0], [0.0, 0.0]])
        snes.solve(None, u)
        yield along, snes, structure, u


@pytest.mark.parametrize("warm", [True, False])
def test_supports_go_on_from_the_last_solution(warm):
    """With a warm start, or with the last solution as the guess; the loads stay."""
    for along, snes, structure, u in series(warm):
        path = Corotational(truss(0.5, along)).follow()
        if along < 0.2:
            assert snes.getConvergedReason() > 0
            assert latinpc.path(snes)["borne"] == 1.0
            assert np.abs(structure.displacements(u) - path.displacements).max() < 1e-8
        else:
            assert snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
            borne = latinpc.path(snes)["borne"]
            assert 0.02 < 0.2 * borne < 0.2
            last = Corotational(truss(0.5, 0.2 * borne))
            structure.set_prescribed([[0.0, 0.0], [0.2 * borne, 0.0], [0.0, 0.0]])
            v = structure.displacements(u).astype(np.longdouble)
            assert np.abs(last.newton(v) - v).max() < 1e-6
            assert last.stable(v)


def test_an_error_leaves_supports_where_they_are_given():
    """A monitor that raises in the middle of a path."""
    structure = latinpc.Structure.from_scene(truss(0.9, -0.3))
    snes, u, told = structure.create_snes(), structure.create_vec(), []

    def monitor(_snes, it, _norm):
        told.append(structure.displacements(structure.create_vec())[1, 0])
        if it > 0:
            raise RuntimeError("enough")

    snes.setMonitor(monitor)
    with pytest.raises(RuntimeError):
        snes.solve(None, u)
    assert len(told) > 1
    assert structure.displacements(structure.create_vec())[1, 0] == -0.3


def test_increments_move_supports_too():
    """The first of four has a quarter of them: it is the whole of a scene with a quarter of all."""
    scene = truss(0.1, -0.2)
    report = solve(scene, increments=4, options={"snes_latin_error": 1e-8}).report
    factors, moved = np.array(report["load_path"]).T
    assert factors == pytest.approx([0.25, 0.5, 0.75, 1.0])
    for factor, most in zip(factors, moved):
        exact = Corotational(replace(scene, load=factor * scene.load, prescribed=factor * scene.prescribed)).follow()
        assert most == pytest.approx(np.linalg.norm(exact.displacements, axis=1).max(), rel=1e-7)
