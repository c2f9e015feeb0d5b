"""Motions of links that turn: energy and momenta stay, whatever the structure and the step."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from large_motions import free, motion, shaken, wheel
from test_properties import EXAMPLES

import latinpc


@st.composite
def structures(draw):
    """Points anywhere, bars, cables and struts that bear compression alone between them, masses and velocities."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    dim, count = draw(st.sampled_from([2, 3])), draw(st.integers(2, 9))
    nodes = rng.normal(size=(count, dim))
    pairs = np.array([(a, b) for a in range(count) for b in range(a + 1, count)])
    links = pairs[np.unique(rng.integers(0, len(pairs), 2 * count))]
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    law = rng.choice(["bar", "cable", "compression_only"], len(links))
    stiffness = 10.0 ** rng.uniform(1.0, 4.0, len(links))
    used = np.isin(np.arange(count), links)
    structure = {
        "nodes": nodes,
        "links": links,
        "law": list(law),
        "stiffness": stiffness,
        "mass": rng.uniform(0.5, 2.0, count),
    }
    structure["initial_elongation"] = rng.uniform(-0.2, 0.1, len(links)) * length
    structure["fixed"] = np.zeros(nodes.shape, bool)
    if draw(st.booleans()):
        structure["fixed"][links[0, 0]] = True
    load = draw(st.sampled_from([0.0, 1.0])) * rng.normal(size=nodes.shape)
    structure["load"] = np.where(structure["fixed"] | ~used[:, None], 0.0, load)
    return structure, 10.0 ** rng.uniform(-1.0, 1.0) * rng.normal(size=nodes.shape), 10.0 ** rng.uniform(-3.0, -1.0)


@settings(max_examples=max(EXAMPLES // 4, 20), deadline=None, suppress_health_check=list(HealthCheck))
@given(structures())
def test_energy_and_momenta_of_random_structures(drawn):
    """They stay, whatever the structure and the step; momenta where nothing holds or loads it."""
    structure, v, h = drawn
    with motion(structure, h, v=v, snes_latin_error=1e-11) as it:
        it.ts.setErrorIfStepFails(False)
        stiff = np.asarray(structure["stiffness"])
        for _ in range(5):
            energy, momenta, speed = it.energy, it.momenta, it.v
            it.step()
            if it.ts.getSNES().getConvergedReason() <= 0:
                return
            size = abs(energy) + (it.mass * speed**2).sum() + (stiff * structure["initial_elongation"] ** 2).sum()
            assert abs(it.energy - energy) < 1e-7 * size
            if not structure["fixed"].any() and not structure["load"].any():
                whole = (it.mass * abs(speed)).sum() * (1.0 + np.abs(it.nodes + it.u).max())
                assert np.abs(it.momenta - momenta).max() < 1e-8 * whole


def test_few_steps_of_random_structures_fail():
    """What the test above passes over."""
    failed = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        nodes = rng.normal(size=(7, 3))
        links = np.array([(a, b) for a in range(7) for b in range(a + 1, 7)])[rng.permutation(21)[:14]]
        length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
        law = list(rng.choice(["bar", "cable"], 14))
        structure = free(nodes, links, law, 10.0 ** rng.uniform(1.0, 4.0, 14), rng.uniform(0.5, 2.0, 7))
        structure["initial_elongation"] = rng.uniform(-0.2, 0.1, 14) * length
        with motion(structure, 10.0 ** rng.uniform(-3.0, -1.0), v=5.0 * rng.normal(size=(7, 3))) as it:
            it.ts.setErrorIfStepFails(False)
            it.step(5)
            failed += it.ts.getSNES().getConvergedReason() <= 0
    assert failed <= 1


def test_energy_stays_by_a_table():
    """A bar that softens, in a wheel that turns and shakes."""
    law = latinpc.register_table([-1.0, -0.01, 0.01, 1.0], [-298.0, -100.0, 100.0, 298.0], "softening bar")
    structure = wheel(stiffness=1e4) | {"law": law}
    v = 3.0 * np.column_stack([-structure["nodes"][:, 1], structure["nodes"][:, 0]])
    v += np.random.default_rng(1).normal(size=v.shape)
    with motion(structure, 0.01, v=v, snes_latin_error=1e-10) as it:
        energy, momenta = it.energy, it.momenta
        it.step(60)
        assert it.energy == pytest.approx(energy, rel=1e-7)
        assert it.momenta == pytest.approx(momenta, abs=1e-6 * abs(momenta).max())
        stretch = np.linalg.norm(np.diff((it.nodes + it.u)[structure["links"]], axis=1)[:, 0], axis=1)
        assert (
            abs(stretch / np.linalg.norm(np.diff(it.nodes[structure["links"]], axis=1)[:, 0], axis=1) - 1.0).max()
            > 0.01
        )


@pytest.mark.parametrize(("stiffness", "h"), [(1e4, 0.01), (1e6, 0.05)])
def test_a_wheel_turns(stiffness, h):
    """By half a radian a step, stiff as it may be: operators follow where they no longer serve."""
    structure = wheel(stiffness=stiffness)
    v = 10.0 * np.column_stack([-structure["nodes"][:, 1], structure["nodes"][:, 0]]) + [1.0, 0.0]
    with motion(structure, h, v=v, snes_latin_subdomains=3) as it:
        energy, momenta = it.energy, it.momenta
        it.step(100)
        assert it.energy == pytest.approx(energy, rel=1e-5)
        assert it.momenta == pytest.approx(momenta, abs=1e-5 * abs(momenta).max())


def test_rotated_structures_move_alike():
    """Nothing depends on the axes."""
    structure, v = shaken()
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = structure | {"nodes": structure["nodes"] @ Q.T, "load": structure["load"] @ Q.T}
    with motion(structure, 0.005, v=v) as plain, motion(turned, 0.005, v=v @ Q.T) as rotated:
        assert np.abs(rotated.step(10).u - plain.step(10).u @ Q.T).max() < 1e-6
