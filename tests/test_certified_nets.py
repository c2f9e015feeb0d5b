"""Large displacements of cable nets minimise a convex energy: held against a cone program, whose dual proves a bound.

With natural lengths L and elongations s of the cables, positions x and loads F,

    minimise  sum 1/2 k s^2 - F x   subject to   |x_b - x_a| <= L + s,  s >= 0,

a second-order cone program. Any feasible point of its dual bounds the energy of every equilibrium from below. Of cables
that cannot stretch s is zero, and the multipliers of the cones are the tensions.
"""

import numpy as np
import pytest
import scipy.sparse
import turning

import latinpc

clarabel = pytest.importorskip("clarabel")  # in the extra dev of pyproject.toml


def program(structure):
    """Solve the cone program; return positions, tensions, and the values of the program and of its dual.

    Forces are in units of the largest tension that a cable would have if stretched by a thousandth, or of the largest
    load where no cable stretches, lengths in those of the longest cable.
    """
    nodes, links, k = structure.nodes, structure.links, structure.stiffness
    natural = structure.lengths - structure.initial_elongation
    rigid = bool((structure.law == latinpc.Law.INEXTENSIBLE).all())
    length, force = natural.max(), abs(structure.load).max() if rigid else (1e-3 * k * natural).max()
    free = ~structure.fixed.ravel()
    n, m, dim = int(free.sum()), len(links), nodes.shape[1]
    number = np.full(nodes.size, -1)
    number[free] = np.arange(n)
    rows, columns, values, right = [], [], [], np.zeros(m * (dim + 2))
    for link, (a, b) in enumerate(links):
        top = m + link * (dim + 1)
        rows, columns, values = [*rows, link, top], [*columns, n + link, n + link], [*values, -1.0, -1.0]
        right[top] = natural[link] / length
        for axis in range(dim):
            for node, sign in ((b, 1.0), (a, -1.0)):
                at = number[dim * node + axis]
                if at >= 0:
                    rows, columns, values = [*rows, top + 1 + axis], [*columns, at], [*values, -sign]
                else:
                    right[top + 1 + axis] += sign * nodes[node, axis] / length
    A = scipy.sparse.csc_matrix((values, (rows, columns)), shape=(len(right), n + m))
    P = scipy.sparse.diags(np.concatenate([np.zeros(n), 0.0 * k if rigid else k * length / force])).tocsc()
    q = np.concatenate([-structure.load.ravel()[free] / force, np.zeros(m)])
    cones = [clarabel.ZeroConeT(m) if rigid else clarabel.NonnegativeConeT(m)] + [
        clarabel.SecondOrderConeT(dim + 1)
    ] * m
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    found = clarabel.DefaultSolver(P, q, A, right, cones, settings).solve()
    assert "Solved" in str(found.status)
    x = nodes.copy()
    x[~structure.fixed] = length * np.asarray(found.x[:n])
    tensions = force * np.asarray(found.z[m :: dim + 1])
    shift = (structure.load * np.where(structure.fixed, 0.0, nodes)).sum()  # energies are of displacements
    return x, tensions, length * force * found.obj_val + shift, length * force * found.obj_val_dual + shift


def slack_form():
    """Return a form whose cables have been shortened at random, under snow."""
    drawn, rng = turning.net(8, 1.5, [0.0, 0.0, 0.0]), np.random.default_rng(0)
    given = {key: drawn[key] for key in ("nodes", "links", "fixed")}
    density = 1000.0 * 10.0 ** rng.uniform(-0.5, 0.5, len(drawn["links"]))
    natural = latinpc.form_find(**given, density=density, EA=1e6).natural_lengths * rng.uniform(
        0.97, 1.01, len(density)
    )
    form = latinpc.form_find(**given, density=density, natural_length=natural, EA=1e6)
    form.structure.set_load(np.where(given["fixed"], 0.0, [0.0, 50.0, -500.0]))
    return form.structure


def hung_net():
    """Return a flat net without prestress on longer cables: a mechanism as drawn, which hangs under its loads."""
    drawn = turning.net(6, 0.0, [5.0, 0.0, -100.0])
    return latinpc.Structure(**drawn | {"prestress": None, "initial_elongation": -0.05}, geometry="large")


NETS = {
    "flat": lambda: latinpc.Structure(**turning.net(10, 0.0, [0.0, 0.0, -500.0]), geometry="large"),
    "saddle, some slack": lambda: latinpc.Structure(**turning.net(10, 2.0, [0.0, 0.0, -500.0]), geometry="large"),
    "large saddle": lambda: latinpc.Structure(**turning.net(20, 4.0, [20.0, 0.0, -50.0]), geometry="large"),
    "catenary": lambda: latinpc.Structure(**turning.catenary()[0], geometry="large"),
    "form, some slack": slack_form,
    "hung": hung_net,
} | {
    f"random {seed}": lambda seed=seed: latinpc.Structure(**turning.random_net(seed), geometry="large")
    for seed in range(4)
}


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("name", NETS)
def test_energies_are_least(name):
    """Within 1e-7 of the bound, with its tensions and positions."""
    structure = NETS[name]()
    result = structure.solve(error=1e-9)
    assert result.converged
    u = structure.create_vec()
    structure.set_displacements(result.displacements, u)
    energy = structure.energy(u)
    x, tensions, value, bound = program(structure)
    assert result.slack.any() or "slack" not in name
    scale = abs(energy)
    assert energy - bound <= 1e-7 * scale  # no lower energy exists
    assert bound <= energy + 1e-7 * scale and abs(value - bound) <= 1e-7 * scale  # as far as the program is solved
    assert np.allclose(result.tensions, tensions, rtol=0.0, atol=1e-3 * tensions.max())
    assert np.allclose(structure.nodes + result.displacements, x, rtol=0.0, atol=1e-3 * abs(result.displacements).max())


def test_the_bound_would_show_a_wrong_result():
    """Displacements that are off by a thousandth leave an energy above it."""
    structure = NETS["saddle, some slack"]()
    result, u = structure.solve(error=1e-9), structure.create_vec()
    structure.set_displacements(1.001 * result.displacements, u)
    assert structure.energy(u) - program(structure)[3] > 1e-7 * abs(structure.energy(u))


# ---- cables that cannot stretch ---------------------------------------------------------------------
def rigid_net(seed, cells=None, most=1.3):
    """Return a net whose cables are 1 to `most` times longer than drawn, some supports left out, under random loads."""
    rng = np.random.default_rng(seed)
    drawn = turning.net(cells or int(rng.integers(3, 9)), rng.choice([0.0, 2.0]), [0.0, 0.0, 0.0])
    nodes, links, fixed = (drawn[key] for key in ("nodes", "links", "fixed"))
    if seed % 3 == 1:
        some = fixed[:, 0] & (rng.random(len(nodes)) < 0.7)
        fixed = np.repeat(some[:, None], 3, axis=1)
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    load = rng.normal(size=nodes.shape) * 30.0 - [0.0, 0.0, 100.0]
    structure = {"nodes": nodes, "links": links, "fixed": fixed, "load": np.where(fixed, 0.0, load), "stiffness": 0.0}
    longer = length * rng.uniform(0.0, most - 1.0, len(length))
    return latinpc.Structure(**structure, law="inextensible", initial_elongation=-longer, geometry="large")


RIGID = [*range(6), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 50))]


def certify(structure, result):
    """Energies within 1e-7 of the bound, no cable too long, tensions of the program."""
    assert result.converged
    x, tensions, _, bound = program(structure)
    at = structure.nodes + result.displacements
    r = np.linalg.norm(np.diff(at[structure.links], axis=1)[:, 0], axis=1)
    natural = structure.lengths - structure.initial_elongation
    scale = (result.tensions * r).sum()
    assert (r - natural).max() <= 1e-8 * natural.max()
    assert result.tensions.min() >= 0.0
    assert -(structure.load * result.displacements).sum() - bound <= 1e-7 * scale
    assert np.allclose(result.tensions, tensions, rtol=0.0, atol=1e-4 * tensions.max())
    assert np.allclose(at, x, rtol=0.0, atol=1e-4 * abs(result.displacements).max())


@pytest.mark.parametrize("seed", RIGID)
def test_inextensible_nets(seed):
    """Of any size and shape, taut and slack."""
    structure = rigid_net(seed)
    result = structure.solve(error=1e-9)
    certify(structure, result)


def test_a_large_inextensible_net():
    """Tensions of fifty loads, hundreds of cables that become taut and slack: it takes as many steps as a small one."""
    structure = rigid_net(0, 20)
    result = structure.solve(error=1e-8)
    certify(structure, result)
    assert 0.05 < result.slack.mean() < 0.5
    assert result.iterations < 400


def test_beside_cables_that_stretch():
    """A fifth of the cables stretches: at once near the solution as well, whatever their stiffness."""
    rigid = rigid_net(2, 8)
    stretches = np.random.default_rng(2).random(len(rigid.links)) < 0.2
    given = {key: getattr(rigid, key) for key in ("nodes", "links", "fixed", "load", "initial_elongation")}
    law, stiffness = np.where(stretches, "cable", "inextensible").tolist(), np.where(stretches, 1e5, 0.0)
    result = latinpc.Structure(**given, law=law, stiffness=stiffness, geometry="large").solve(error=1e-9)
    assert result.converged
    assert result.iterations < 100
    r = np.diff((rigid.nodes + result.displacements)[rigid.links], axis=1)[:, 0]
    size, t = np.linalg.norm(r, axis=1), result.tensions
    x = size - rigid.lengths + rigid.initial_elongation
    assert np.allclose(t[stretches], 1e5 * np.maximum(x[stretches], 0.0), rtol=0.0, atol=1e-7 * t.max())
    assert x[~stretches].max() < 1e-8 and np.abs(x * t)[~stretches].max() < 1e-8 * t.max()
    left = np.array(rigid.load)
    np.add.at(left, rigid.links[:, 0], (t / size)[:, None] * r)
    np.add.at(left, rigid.links[:, 1], -(t / size)[:, None] * r)
    assert np.abs(left[~rigid.fixed]).max() < 1e-8 * t.max()
