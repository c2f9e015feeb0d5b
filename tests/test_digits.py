"""Digits of a solution: the unbalance tells its error, roundings what they move; Newton's method reaches them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import chain, far, grid, irregular, latin, lattice, network, on_rails, settled

import latinpc
from latinpc import cli
from latinpc.bench.extremes.catalogue import close_nodes
from latinpc.scenes import Law

UNIT = np.finfo(float).eps / 2
SCENES = {
    "tensegrity": grid,
    "irregular": lambda: settled(irregular()),
    "network": lambda: on_rails(network()),
    "lattice": lambda: settled(lattice(), size=1e-4),
    "cables in a row": lambda: chain(law=Law.CABLE),
    "far from the origin": lambda: replace(network(), nodes=network().nodes + 1e4),
    "close nodes": lambda: close_nodes(1e-6),
}


def row(links):
    """Make bars in a row, held at one end and pulled at the other."""
    scene = chain(links, parts=8)
    fixed, load = np.zeros_like(scene.fixed), np.zeros_like(scene.load)
    fixed[0], load[-1] = True, 1.0
    return replace(scene, fixed=fixed, load=load, prescribed=0 * load, initial_elongation=np.zeros(links))


def relative(scene, changed, u):
    """Difference of free displacements over the norm of the second ones."""
    return np.linalg.norm(np.where(scene.fixed, 0.0, changed - u)) / np.linalg.norm(np.where(scene.fixed, 0.0, u))


def digits(scene, **options):
    """Solve to rounding unless told otherwise: displacements, and what moves them."""
    with latin(scene, **{"stol": 1e-14, "max_it": 300} | options) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        return run.structure.displacements(u), latinpc.digits(run.snes)


def around(scene):
    """Dense matrices at the solution: B, tangent stiffnesses, elongations, inverse of K, displacements to 20 digits."""
    b = oracle.kinematics(replace(scene, fixed=np.zeros_like(scene.fixed), prescribed=0.0 * scene.nodes))[0].toarray()
    free = ~scene.fixed.ravel()
    full = np.where(scene.fixed, scene.prescribed, oracle.newton(scene)).ravel().astype(np.longdouble)
    for _ in range(4):  # corrections of the unbalance, in extended precision
        x = b @ full + scene.initial_elongation
        taut = (
            (scene.law == Law.BAR)
            | ((scene.law == Law.CABLE) & (x > 0))
            | ((scene.law == Law.COMPRESSION_ONLY) & (x < 0))
        )
        k = np.where(taut, scene.stiffness, 0.0)
        inverse = np.linalg.inv((b.T @ (k[:, None] * b))[np.ix_(free, free)])
        full[free] += inverse @ (scene.load.ravel() - b.T @ (k * x))[free].astype(float)
    return b, k, x.astype(float), inverse, full.reshape(scene.nodes.shape)


def expected(scene):
    """Root mean squares of what independent roundings move, column by column of the inverse tangent stiffness."""
    b, k, x, inverse, full = around(scene)
    full, free, dim = full.astype(float), ~scene.fixed.ravel(), scene.dim
    size, tau = np.linalg.norm(full.ravel()[free]), k * x

    def norm(*columns):
        moved = inverse @ np.hstack(columns)[free]
        return UNIT * np.sqrt((moved**2).sum()) / size

    rounding = k * (np.abs(b) @ np.abs(full.ravel()) + np.abs(scene.initial_elongation)) + np.abs(tau)
    turns = []
    for end in (0, 1):
        for c in range(dim):
            place = scene.nodes[scene.links[:, end], c]
            apart = scene.nodes[scene.links[:, 1]] - scene.nodes[scene.links[:, 0]]
            length = np.linalg.norm(apart, axis=1, keepdims=True)
            n = apart / length
            turn = place[:, None] * (np.eye(dim)[c] - n[:, [c]] * n) / length
            shift = full[scene.links[:, 1]] - full[scene.links[:, 0]]
            columns = b.T * (k * (turn * shift).sum(axis=1))
            for end2, sign in ((0, -1.0), (1, 1.0)):
                for d in range(dim):
                    columns[dim * scene.links[:, end2] + d, np.arange(len(k))] += sign * tau * turn[:, d]
            turns.append(columns)
    return {
        "rounding": norm(b.T * rounding),
        "places": norm(*turns),
        "values": norm(
            b.T * tau, b.T * (k * scene.initial_elongation), np.diag(np.where(scene.fixed, 0, scene.load).ravel())
        ),
    }


# ---- what they say ---------------------------------------------------------------------------
@pytest.mark.parametrize("name", SCENES)
def test_unbalance_is_the_error(name):
    """Far from rounding and near to it, as long as no link is still to change."""
    scene = SCENES[name]()
    exact = around(scene)[-1]
    for stop in ({"stol": 1e-6}, {"stol": 1e-9}, {}):
        u, found = digits(scene, outer_snes_type="nrichardson", max_it=1000, **stop)
        error = relative(scene, u, exact)
        assert found["unbalance"] == pytest.approx(error, rel=0.1, abs=10 * found["rounding"])


@pytest.mark.parametrize("name", SCENES)
def test_roundings_are_root_mean_squares(name):
    """Three samples, where one soft displacement may weigh most: within a factor of three of all columns."""
    scene = SCENES[name]()
    found, true = digits(scene)[1], expected(scene)
    for kind, value in true.items():
        assert value / 3 <= found[kind] <= 3 * value + 1e-3 * UNIT, kind


def test_coordinates_that_are_rounded_move_the_solution_so_far():
    """Forty kilometres away: the digits that a translation to there and back costs."""
    scene = network()
    shifted = (scene.nodes + 4e4) - 4e4
    change = relative(scene, oracle.newton(replace(scene, nodes=shifted)), oracle.newton(scene))
    told = digits(replace(scene, nodes=scene.nodes + 4e4))[1]["places"]
    assert 0.2 < change / told < 3.0


# ---- what Newton's method makes of them -------------------------------------------------------------
@pytest.mark.parametrize("scene", [row(400), close_nodes(1e-6)], ids=["chain", "close nodes"])
def test_newtons_method_reaches_rounding_where_the_iteration_does_not(scene):
    plain, left = digits(scene, newton="never")
    assert left["unbalance"] > 20 * left["rounding"]
    finished, left = digits(scene, stop="error", error=1e-15)
    exact = around(scene)[-1]
    assert relative(scene, finished, exact) < 4 * left["rounding"] < 0.1 * relative(scene, plain, exact)


def test_error_stop_beyond_the_iteration():
    """1e-14 is below what the iteration reaches on this grid: alone it says so, Newton's method gets there."""
    scene = grid()
    exact = oracle.newton(scene)
    stop = {"stop": "error", "error": 1e-14}
    with latin(scene, **stop, newton="never") as run:
        run.snes.solve(None, run.structure.create_vec())
        assert run.snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_INNER
    for error, reason in ((1e-14, "CONVERGED_SNORM_RELATIVE"), (1e-17, "DIVERGED_INNER")):
        with latin(scene, **stop | {"error": error}) as run:
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() == getattr(PETSc.SNES.ConvergedReason, reason)
            assert latinpc.estimated_error(run.snes) < 1e-14
            assert far(run.structure.displacements(u), exact) < 2e-14


# ---- what must not matter --------------------------------------------------------------------
def test_ranks_do_not_matter(mpirun, tmp_path):
    program = f"""
import json, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import latinpc
from support import irregular, latin
structure = latinpc.Structure.from_scene(irregular())
with latin(irregular(), structure, stol=1e-7) as run:
    run.snes.solve(None, structure.create_vec())
    found = latinpc.digits(run.snes)
    if structure.comm.rank == 0:
        json.dump(found, open(sys.argv[1], "w"))
"""
    found = []
    for ranks in (1, 3):
        mpirun(ranks, program, tmp_path / f"{ranks}.json")
        found.append(json.loads((tmp_path / f"{ranks}.json").read_text()))
    assert found[0] == pytest.approx(found[1], rel=1e-3)


# ---- what is told ----------------------------------------------------------------------------
def test_the_command_tells_digits(capsys):
    words = ["solve", "tensegrity-grid", "--modules", "4", "--digits"]
    with pytest.raises(SystemExit, match="0"):
        cli.main(words)
    told = next(line for line in capsys.readouterr().out.splitlines() if "digits" in line)
    number = float(told.split()[1].rstrip(":"))
    parts = [float(part.split()[-1]) for part in told.split(":")[1].split(",")]
    assert number == pytest.approx(-np.log10(np.linalg.norm(parts)), abs=0.2)  # parts have one digit
    with pytest.raises(SystemExit, match="0"):
        cli.main([*words, "--load", "0"])  # nothing moves but by rounding
    assert " none: unbalance" in capsys.readouterr().out


def test_where_the_nodes_of_a_given_direction_are():
    """Rounded coordinates do not turn such a link, however near its nodes are to each other, or at one place."""
    found = []
    for apart in (1.0, 1e-11, 0.0):
        structure = latinpc.Structure(
            [[0, 1e3], [1, 1e3], [1, 1e3 + apart], [1, 1e3 - 1]], [[0, 1], [1, 2], [3, 1]], "bar", 1e3,
            direction=[[0, 0], [1, 0], [0, 0]], fixed=[[1, 1], [0, 0], [1, 1], [1, 1]],
            load=[[0, 0], [5, -3], [0, 0], [0, 0]], comm=PETSc.COMM_SELF,
        )  # fmt: skip
        snes = structure.create_snes()
        snes.solve(None, structure.create_vec())
        found.append(latinpc.digits(snes)["places"])
        snes.destroy()
    assert found == pytest.approx([found[0]] * 3, rel=1e-6)
    assert found[0] < 1e-14


# ---- misuse ----------------------------------------------------------------------------------
def test_solution_structure_and_tangent_must_be_there():
    with latin(grid()) as run:
        run.snes.setUp()
        with pytest.raises(PETSc.Error) as caught:
            latinpc.digits(run.snes)
        assert "call SNESSolve() first" in latinpc.error_message(caught.value)
    with pytest.raises(PETSc.Error) as caught:
        latinpc.digits(PETSc.SNES().create(PETSc.COMM_SELF))
    assert "attach" in latinpc.error_message(caught.value)
    rigid = replace(
        chain(), law=np.full(24, Law.INEXTENSIBLE), stiffness=np.zeros(24), initial_elongation=np.full(24, -0.01)
    )
    with latin(rigid, max_it=3) as run:
        run.snes.solve(None, run.structure.create_vec())
        with pytest.raises(PETSc.Error) as caught:
            latinpc.digits(run.snes)
    assert "inextensible" in latinpc.error_message(caught.value)
