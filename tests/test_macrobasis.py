"""Macro bases and the homogenised stiffness (29), (51) of subdomains; the traps of dependent and ill-scaled bases."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import (
    ALL_VARIANTS,
    PLAIN,
    VARIANTS,
    chain,
    far,
    grid,
    irregular,
    latin,
    lattice,
    network,
    oracle_options,
    solve,
)

import latinpc

ZERO = 1e-9  # singular values
SOFT = 1e-12  # eigenvalues: a soft motion costs the square of little


def stiffnesses(scene, **options):
    """Homogenised stiffness of every subdomain."""
    with latin(scene, **options) as run:
        run.snes.setUp()
        count = latinpc.subdomains(run.snes)[0]
        return [latinpc.macro_stiffness(run.snes, i).getDenseArray().copy() for i in range(count)]


def spectrum(h):
    """Eigenvalues relative to the largest, with every unknown in units of its own diagonal."""
    scale = np.sqrt(np.where(h.diagonal() > 0.0, h.diagonal(), 1.0))  # a primal node may hang on springs alone
    eigenvalues = np.linalg.eigvalsh(h / scale[:, None] / scale)
    return eigenvalues / eigenvalues[-1]


def nullity(h):
    """Dimension of the kernel."""
    return np.count_nonzero(spectrum(h) < SOFT)


def is_floating(scene, i):
    """No displacement of the subdomain is prescribed."""
    return not scene.fixed[scene.links[scene.subdomain == i]].any()


def rigid_motions(scene, part):
    """Translations and infinitesimal rotations of the dofs of a subdomain, as columns."""
    x = scene.nodes - scene.nodes[scene.links[part.links]].mean(axis=(0, 1))
    columns = [np.tile(axis, len(x)) for axis in np.eye(scene.dim)]
    for a in range(scene.dim):
        for b in range(a):
            turn = np.zeros_like(x)
            turn[:, a], turn[:, b] = x[:, b], -x[:, a]
            columns.append(turn.ravel())
    return np.column_stack(columns)[part.dofs]


def coarse_trace(model, i, motion):
    """Coarse displacements (macro, then primal) of motions of a subdomain."""
    part = model.parts[i]
    sides = [(s, s.local[s.pair.index(i)]) for s in model.sides if i in s.pair]
    macro = [(s.d @ s.r).T @ motion[at] for s, at in sides]
    return np.vstack([*macro, motion[part.c]])


def free_motions(model, i):
    """Motions of a subdomain that cost nothing: no link changes its length, no micro spring either."""
    part, rows = model.parts[i], []
    rows.append(np.sqrt(model.scene.stiffness[part.links])[:, None] * part.b)
    for side in (s for s in model.sides if i in s.pair):
        select = np.eye(len(part.dofs))[side.local[side.pair.index(i)]]
        micro = select - side.r @ ((side.d @ side.r).T @ select)
        rows.append(np.linalg.cholesky(side.d).T @ micro)
    values = np.linalg.svd(np.vstack(rows), compute_uv=False)
    return len(part.dofs) - np.count_nonzero(values > ZERO * values[0])


SCENES = {"grid": grid, "irregular": irregular, "network": network, "lattice": lattice, "chain": chain}


@pytest.mark.parametrize("variant", ALL_VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_homogenised_stiffness(name, variant):
    """Symmetric, positive semidefinite, and the oracle's up to the choice of an orthonormal basis."""
    scene, options = SCENES[name](), {"variant": variant}
    model = oracle.build(scene, **oracle_options(options))
    for i, h in enumerate(stiffnesses(scene, **options)):
        assert np.array_equal(h, h.T)
        assert spectrum(h)[0] > -1e-12
        theirs = model.parts[i].h
        scale = max(abs(theirs).max(), 1.0)
        assert np.linalg.eigvalsh(h) / scale == pytest.approx(np.linalg.eigvalsh(theirs) / scale, abs=1e-11)
        assert nullity(h) == free_motions(model, i)


@pytest.mark.parametrize("name", SCENES)
def test_rigid_motions_cost_nothing(name):
    """A floating subdomain of any partition moves freely: the kernel holds all its rigid motions."""
    scene = SCENES[name]()
    model, floating = oracle.build(scene), 0
    for i, h in enumerate(stiffnesses(scene)):
        if not is_floating(scene, i):
            continue
        floating += 1
        trace = coarse_trace(model, i, rigid_motions(scene, model.parts[i]))
        assert np.linalg.matrix_rank(trace, tol=1e-6 * abs(trace).max()) == {1: 1, 2: 3, 3: 6}[scene.dim]
        forces = model.parts[i].h @ trace
        assert abs(forces).max() < 1e-9 * abs(model.parts[i].h).max() * abs(trace).max()
        assert nullity(h) >= trace.shape[1]
    assert floating


@pytest.mark.parametrize("variant", VARIANTS)
def test_modified_module_has_rigid_motions_only(variant):
    """Without internal mechanism the kernel of a floating block is the six rigid motions; a clamped one has fewer."""
    scene = grid(module="modified")
    found = [nullity(h) for h in stiffnesses(scene, variant=variant)]
    for i, kernel in enumerate(found):
        assert (kernel == 6) if is_floating(scene, i) else (kernel < 6)
    assert found[4] == 6


def test_trap_3_module_of_the_article_has_a_mechanism_besides():
    """Nothing may count on six: the kernel of the middle block has a seventh motion, and the method converges."""
    scene = grid("truss")
    assert [nullity(h) for h in stiffnesses(scene)][4] == 7
    result = solve(scene, _reference=oracle.newton(scene), stol=1e-10)
    assert result.reason > 0
    assert result.history.error_l2[-1] < 1e-8


def test_preconditioner_has_the_same_stiffnesses():
    """The springs of the preconditioner are weaker, the kernel of a floating subdomain is the same."""
    scene = grid("truss", module="modified")
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    pc = PETSc.PC().create(comm=PETSc.COMM_SELF)
    pc.setType("latin")
    structure.attach(pc)
    jacobian = structure.dm.createMat()
    structure.jacobian(structure.create_vec(), jacobian)
    pc.setOperators(jacobian)
    pc.setUp()
    assert nullity(latinpc.macro_stiffness(pc, 4).getDenseArray()) == 6


def test_subdomain_that_does_not_exist_is_refused():
    """Numbers of subdomains are those of this rank, from 0."""
    with latin(grid()) as run:
        run.snes.setUp()
        for i in (-1, 9):
            with pytest.raises(PETSc.Error) as caught:
                latinpc.macro_stiffness(run.snes, i)
            assert f"Subdomain {i} of this rank does not exist" in latinpc.error_message(caught.value)


# ---- traps -----------------------------------------------------------------------------------
def worst_condition(model):
    """Largest condition number of the condensed macro operators T: infinite for dependent constraints."""
    return max(np.linalg.cond(part.a_r @ part.v_m) for part in model.parts if part.n_macro)


def converges_in_c(scene, reference, **options):
    """Whether the solver finds the displacement."""
    result = solve(scene, _reference=reference, stol=1e-7, max_it=400, **options)
    return result.reason > 0 and result.history.error_l2[-1] < 1e-4


def breaks(scene, reference, **options):
    """Whether the oracle, its cure taken away, is singular to rounding and fails to converge."""
    try:
        model = oracle.build(scene, **options)
        with np.errstate(all="ignore"):
            history = oracle.latin_history(scene, 60, reference=reference, latin=model)
    except (np.linalg.LinAlgError, RuntimeError, ValueError):  # exactly singular, or no numbers any more
        return True
    return worst_condition(model) > 1e14 and not min(history.error_l2[30:]) < 0.1


def all_micro_nodes(model, pair, _owned):
    """Choose macro nodes as if no node were a corner and none belonged to two interfaces."""
    return model.micro[pair]


@pytest.mark.parametrize("make", [irregular, network])
def test_trap_1_strong_interface_with_corners(monkeypatch, make):
    """Macro modes seen on corners depend on the corner displacements; built on the other nodes they do not."""
    scene = make()
    reference = oracle.newton(scene)
    assert worst_condition(oracle.build(scene, variant="published")) < 1e8
    assert converges_in_c(scene, reference, variant="published")
    monkeypatch.setattr(oracle, "macro_nodes", all_micro_nodes)
    assert breaks(scene, reference, variant="published")


def test_trap_2_macro_bases_independent_of_weak_interfaces(monkeypatch):
    """The same dependence for variant macro, whose weak interfaces share nodes with strong ones."""
    scene = network(parts=12)
    reference = oracle.newton(scene)
    assert worst_condition(oracle.build(scene, variant="macro")) < 1e8
    assert converges_in_c(scene, reference, variant="macro")
    monkeypatch.setattr(oracle, "macro_nodes", all_micro_nodes)
    assert breaks(scene, reference, variant="macro")


def test_trap_2_weak_interfaces_that_meet_at_a_node(monkeypatch):
    """One unknown for each weak interface is one too many where three meet; merged they are as many as needed."""
    scene = network(parts=12)
    reference = oracle.newton(scene)
    assert converges_in_c(scene, reference, variant="macro")
    monkeypatch.setattr(oracle, "primal_groups", lambda parts, weak, variant: list(weak))
    assert breaks(scene, reference, variant="macro")


def test_trap_4_modes_on_raw_coordinates_lose_rank():
    """Far from the origin the modes 1, xi, eta are one and the same unless centred; centred they stay nine."""
    scene = grid("truss", modules=4, subdomains=4)
    away = replace(scene, nodes=scene.nodes + 2.0**20)
    far_model = oracle.build(away)
    assert far_model.n_macro == oracle.build(scene).n_macro == 9 * 4
    iterate = solve(away, max_it=4, stol=0, variant="corner", **PLAIN)
    assert iterate.statistics["strong_macro_dofs"] == 9 * 4
    assert far(iterate.u, solve(scene, max_it=4, stol=0, variant="corner", **PLAIN).u) < 1e-10

    def raw(scene, nodes):
        axes = np.linalg.svd(scene.nodes[nodes] - scene.nodes[nodes].mean(axis=0))[2]
        return np.kron(np.column_stack([np.ones(len(nodes)), scene.nodes[nodes] @ axes[:2].T]), np.eye(3))

    def uncured(scene, nodes):
        return None if oracle.affine_modes(scene, nodes) is None else raw(scene, nodes)

    assert oracle.build(scene, modes=uncured).n_macro == 9 * 4
    assert oracle.build(away, modes=uncured).n_macro < 9 * 4


def test_trap_4_modes_do_not_depend_on_units():
    """Nanometres or light years: the same bases, the same iterates in proportion."""
    scene = irregular("truss", modules=6, parts=4)
    plain = solve(scene, max_it=4, stol=0, variant="corner", **PLAIN)
    for unit in (2.0**30, 2.0**-50):
        other = replace(scene, nodes=scene.nodes * unit)
        iterate = solve(other, max_it=4, stol=0, variant="corner", **PLAIN)
        assert iterate.statistics["strong_macro_dofs"] == plain.statistics["strong_macro_dofs"]
        assert far(iterate.u, plain.u) < 1e-10
