"""What is unique in nets and granulates, and what is not: two ways to one solution, or to two."""

from dataclasses import replace

import numpy as np
import pytest
from support import solve
from test_classes import apart, balance, strain

from latinpc.scenes import Law, make


def ends(name, stol=1e-11, **options):
    """Two solutions of one problem, reached on two ways: another partition, another search parameter."""
    scene = make(name, **options)
    rigid = np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT, Law.FRICTION, Law.TANGENT))
    size = np.abs(scene.load).max() / (np.abs(scene.initial_elongation).max() or 1e-3)
    other = replace(scene, stiffness=np.where(rigid, size / 2, scene.stiffness), subdomain=0 * scene.subdomain)
    found = [solve(each, stol=stol, max_it=30000, variant="corner") for each in (scene, other)]
    assert all(one.reason > 0 for one in found)
    assert all(balance(scene, one.tensions) < 1e-6 for one in found)
    return scene, *found


def test_net():
    """Displacements and tensions."""
    _, one, other = ends("net", side=8)
    assert apart(one.u, other.u) < 1e-7
    assert apart(one.tensions, other.tensions) < 1e-7


def test_rigid_grains_in_general_position():
    """Tensions and the work of the loads; not where grains lie that bear nothing."""
    scene, one, other = ends("packing", side=10, subdomains=4)
    assert apart(one.tensions, other.tensions) < 1e-7
    assert (one.u * scene.load).sum() == pytest.approx((other.u * scene.load).sum(), rel=1e-8)
    assert apart(one.u, other.u) > 1e-3


def test_rigid_grains_that_all_touch():
    """Displacements, which are none; not the tensions, of which only the balance is left."""
    scene, one, other = ends("packing", side=8, disorder=0.0, subdomains=4)
    assert max(np.abs(one.u).max(), np.abs(other.u).max()) < 1e-9
    assert apart(one.tensions, other.tensions) > 1e-3
    assert (one.tensions <= 0).all() and (other.tensions <= 0).all()


def test_elastic_grains():
    """Tensions, so the shortening of contacts that bear, and the work; not where grains lie that bear."""
    scene = make("packing", side=10, law="elastic", subdomains=4)
    one, other = (solve(scene, stol=1e-11, max_it=30000, **way) for way in ({}, {"direction": "diagonal"}))
    assert apart(one.tensions, other.tensions) < 1e-7
    bears = one.tensions < -1e-6 * abs(one.tensions).max()  # of less rounding decides whether it bears at all
    assert apart(strain(scene, one.u)[bears], strain(scene, other.u)[bears]) < 1e-7
    assert (one.u * scene.load).sum() == pytest.approx((other.u * scene.load).sum(), rel=1e-8)
    grains = np.unique(scene.links[bears])
    assert apart(one.u[grains], other.u[grains]) > 1e-3


@pytest.mark.parametrize("disorder", [0.0, 1e-3])
def test_friction(disorder):
    """Nothing, by any theorem: other tensions where all grains touch. Both ends meet Coulomb's law."""
    scene, one, other = ends("packing", side=8, law="friction", disorder=disorder, subdomains=4, stol=1e-9)
    if disorder == 0.0:
        assert apart(one.tensions, other.tensions) > 1e-3
    for found in (one, other):
        normal, tangent = found.tensions[::2], found.tensions[1::2]
        assert (np.abs(tangent) <= 0.3 * -normal * (1 + 1e-9)).all()
        assert np.abs(strain(scene, found.u)[::2] * normal).max() < 1e-6


def test_hanging_net_is_a_cylinder_over_the_catenary():
    """Rows of hanging chains, tied across by cables without tension: each row in the tensions of the closed form."""
    chain, rows = make("chain", links=16), 4
    n, m = len(chain.nodes), len(chain.links)
    nodes = np.vstack([np.column_stack([chain.nodes, np.full(n, 0.1 * row)]) for row in range(rows)])
    ties = np.array([[n * row + i, n * row + n + i] for row in range(rows - 1) for i in range(1, n - 1)])
    fixed = np.vstack([np.column_stack([chain.fixed, np.ones(n, bool)]) for _ in range(rows)])
    net = replace(
        chain,
        nodes=nodes,
        links=np.vstack([chain.links + n * row for row in range(rows)] + [ties]),
        law=np.append(np.tile(chain.law, rows), np.full(len(ties), Law.INEXTENSIBLE)),
        stiffness=np.append(np.tile(chain.stiffness, rows), np.zeros(len(ties))),
        initial_elongation=np.append(np.tile(chain.initial_elongation, rows), np.zeros(len(ties))),
        fixed=fixed,
        prescribed=np.zeros(nodes.shape),
        load=np.vstack([np.column_stack([chain.load, np.zeros(n)]) for _ in range(rows)]),
        subdomain=np.append(np.repeat(np.arange(rows), m), ties[:, 0] // n),
        direction=np.vstack(
            [np.column_stack([chain.directions, np.zeros(m)])] * rows + [nodes[ties[:, 1]] - nodes[ties[:, 0]]]
        ),
    )
    found = solve(net, stol=1e-12, max_it=20000)
    assert found.reason > 0
    closed = np.array(chain.metadata["tensions"])
    cables = found.tensions[: rows * m].reshape(rows, m)[:, chain.law == Law.INEXTENSIBLE]
    assert cables == pytest.approx(np.tile(closed, (rows, 1)), rel=1e-8)
    assert np.abs(found.u).max() < 1e-9
