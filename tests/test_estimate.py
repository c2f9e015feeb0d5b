"""The estimated error: safe, not wasteful, the same whatever the units and the number of ranks; rounding; misuse."""

import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import oracle
import pytest
from conftest import run
from petsc4py import PETSc
from random_structures import Draw
from support import PLAIN, VARIANTS, chain, far, grid, irregular, lattice, network, solve

import latinpc
from latinpc.bench.peers.reference import by_newton
from latinpc.scenes import make

REASON = PETSc.SNES.ConvergedReason
COMMAND = [sys.executable, "-P", "-c", "from latinpc.cli import main; main()"]
STOP = {"stop": "error"}
STOPS = {"l2": "error", "energy": "energy"}


def slow_global_field():
    """A partition whose variant without weak coupling leaves a slow global field, which the indicator does not see."""
    return irregular(kind="truss", modules=12, parts=16)


SCENES = {"grid": grid, "irregular": irregular, "network": network, "lattice": lattice, "slow": slow_global_field}


PROOF = 4.0  # times the error asked for: an estimate from which on Newton's method proves the error


def error(scene, u, reference, norm):
    """Relative error of displacements, in the l2 or in the energy norm."""
    if norm == "l2":
        return np.linalg.norm(u - reference) / np.linalg.norm(reference)
    b, _ = oracle.kinematics(scene)
    e, exact = (np.sqrt(scene.stiffness) * (b @ x.ravel()) for x in (u, reference))
    return np.linalg.norm(e - exact) / np.linalg.norm(exact)


# ---- what it promises ------------------------------------------------------------------------
@pytest.mark.parametrize("norm", ["l2", "energy"])
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_stop_meets_the_error(name, variant, norm):
    """The true error is below the target, which is proved as soon as an estimate is near it."""
    scene = SCENES[name]()
    target = 1e-4
    result = solve(scene, variant=variant, error=target, stop=STOPS[norm])
    estimate = result.history.estimate
    assert result.reason == REASON.CONVERGED_SNORM_RELATIVE
    assert len(estimate) < result.iterations  # the proof takes some as well
    assert estimate[-1] <= PROOF * target < estimate[:-1].min()
    assert error(scene, result.u, oracle.newton(scene), norm) <= target
    assert 0.0 < result.estimated_error <= target


@pytest.mark.parametrize("outer", [{}, PLAIN], ids=["anderson", "plain"])
@pytest.mark.parametrize("name", SCENES)
def test_estimate_is_above_the_error_and_near_it(name, outer):
    """At nearly all iterates the estimate is no smaller than the error, and as a rule not much greater."""
    scene = SCENES[name]()
    history = solve(scene, oracle.newton(scene), error=1e-8, variant="corner", **STOP, **outer).history
    ratio = (history.estimate / history.error_l2)[2:][history.error_l2[2:] > 1e-9]  # the reference is not better
    assert np.mean(ratio >= 1.0) > 0.95
    assert ratio.min() > 1.0 / 3.0
    assert np.median(ratio) < 30.0


def test_nothing_is_known_before_the_third_iterate():
    history = solve(grid(), error=1e-4, **STOP).history
    assert (history.estimate[:2] == 1.0).all()
    assert history.estimate[2] != 1.0


def test_without_the_stop_there_is_no_estimate():
    assert len(solve(grid(), stop="indicator").history.estimate) == 0
    assert len(solve(grid(), stol=1e-5).history.estimate) == 0  # a step tolerance that is given is the indicator's
    assert len(solve(grid()).history.estimate) > 0


def test_estimate_starts_afresh_with_each_solve():
    """A second solve on the same object from the same start makes the same estimates."""
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    first, second = (solve(grid(), _structure=structure, **STOP).history.estimate for _ in range(2))
    assert (first == second).all()


# ---- what must not matter --------------------------------------------------------------------
def test_units_do_not_matter():
    """Forces in kN, displacements in mm: the estimates are relative."""
    scene = irregular()
    other = make("tensegrity-grid", modules=8, partition="metis")
    scaled = other.__class__(
        **{
            **scene.__dict__,
            "stiffness": scene.stiffness * 1e-6,
            "initial_elongation": scene.initial_elongation * 1e3,
            "nodes": scene.nodes * 1e3,
            "load": scene.load * 1e-3,
        }
    )
    for norm in ("l2", "energy"):
        estimates = [solve(s, stop=STOPS[norm], **PLAIN).history.estimate for s in (scene, scaled)]
        assert estimates[0] == pytest.approx(estimates[1], rel=1e-6)


def test_ranks_do_not_matter(mpirun, tmp_path):
    """The same estimates on one rank and on three."""
    program = """
        import json, sys
        sys.path.insert(0, {tests!r})
        import latinpc
        from support import irregular, latin
        stop, file = sys.argv[1:3]
        structure = latinpc.Structure.from_scene(irregular())
        with latin(irregular(), structure, stop=stop, outer_snes_type="nrichardson") as run:
            run.snes.solve(None, structure.create_vec())
            if structure.comm.rank == 0:
                json.dump(latinpc.history(run.snes)["estimate"].tolist(), open(file, "w"))
        """
    program = "\n".join(line[8:] for line in program.splitlines()).format(tests=str(Path(__file__).parent))
    for norm in ("l2", "energy"):
        found = []
        for ranks in (1, 3):
            file = tmp_path / f"{norm}{ranks}.json"
            mpirun(ranks, program, STOPS[norm], file)
            found.append(json.loads(file.read_text()))
        assert found[0] == pytest.approx(found[1], rel=1e-6)


# ---- rounding --------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["grid", "lattice"])
def test_target_below_rounding_does_not_converge(name):
    """The reason says that there is no more, long before the maximum of iterations."""
    scene = SCENES[name]()
    result = solve(scene, error=1e-16, max_it=5000, **STOP)
    assert result.reason == REASON.DIVERGED_INNER
    assert len(result.history.indicator) < 200
    assert result.iterations < 500  # those of Newton's method among them
    assert 1e-16 < result.estimated_error < 1e-13
    assert error(scene, result.u, by_newton(scene, 1e-12)[0], "l2") < 1e-11


def test_structure_that_one_linear_stage_solves():
    """One subdomain of bars: the first iterate is exact but for rounding; one more stage proves it."""
    scene = chain(parts=1)
    result = solve(scene, error=1e-8, **STOP)
    assert result.reason > 0
    assert result.iterations == 2
    assert result.history.estimate[-1] < 1e-9
    assert far(result.u, oracle.newton(scene)) < 1e-9


# ---- misuse, and what the user sees ------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "cure"),
    [
        ({"error": 1e-3, "stop": "indicator"}, "add -snes_latin_stop error"),
        ({"error": 0.0, **STOP}, "1e-4"),
        ({"error": 2.0, **STOP}, "1e-4"),
    ],
)
def test_misuse_is_told(options, cure):
    with pytest.raises(PETSc.Error) as caught:
        solve(grid(), **options)
    assert cure in latinpc.error_message(caught.value)


def told(line):
    return run([*COMMAND, *shlex.split(line)], check=False)


@pytest.mark.parametrize("asked", [1e-2, 1e-4])
def test_struts_of_geometry_prestress(asked):
    """They take from the stiffness across them: the estimate in the energy norm had been mere rounding."""
    scene = make("network", nodes=400)
    structure = latinpc.Structure.from_scene(scene)
    geometry = {"snes_latin_geometry": "prestress"}
    truth = scene.solve(options=geometry, error=1e-11)
    options = {"snes_latin_stop": "energy", "snes_latin_error": asked, "snes_latin_newton": "never"}
    found = scene.solve(options=options | geometry)
    assert found.converged

    def energy(displacements):
        along = np.diff(displacements[structure.links], axis=1)[:, 0]
        return structure.stiffness @ np.einsum("ij,ij->i", along, structure.directions) ** 2

    true = np.sqrt(energy(found.displacements - truth.displacements) / energy(truth.displacements))
    assert 0.01 * asked < found.estimated_error <= asked
    assert true < 2.5 * found.estimated_error


def test_command_line_tells_the_estimate():
    result = told("solve tensegrity-grid --modules 8 -snes_latin_stop error -snes_latin_error 1e-3 -snes_latin_monitor")
    assert result.returncode == 0
    assert "estimated error l2" in result.stdout
    assert "accuracy       estimated error" in result.stdout


def test_command_line_tells_that_rounding_is_in_the_way():
    result = told("solve tensegrity-grid --modules 8 -snes_latin_stop error -snes_latin_error 1e-15")
    assert result.returncode == 1
    assert "below the rounding error" in result.stderr


def test_rounding_is_not_told_where_it_is_far_below_the_error(recwarn):
    """Three nodes that links without loads leave nearly free: 1e-4 is asked for, and rounding is 2e-13."""
    for seed in range(320, 340):  # which of them end by rounding depends on it, and so on the BLAS
        scene = Draw(dim=3, nodes=3, extra=3, parts=1, slack=1.0, skeleton=False, settled=True, seed=seed).scene()
        result = replace(scene, load=0.0 * scene.load).solve(comm=PETSc.COMM_SELF)
        assert not any("rounding error" in text for text in result.notices)
