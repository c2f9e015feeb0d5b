"""Large displacements from a drawn configuration where laws have their kinks, and laws that yield."""

import numpy as np
import pytest

import latinpc


def chain(laws, stiffness, load):
    """Return links one beside the other from node to node of a line, the last node held."""
    count = len(laws) + 1
    nodes = np.column_stack([np.arange(count), np.zeros(count)]).astype(float)
    links = [[i, i + 1] for i, law in enumerate(laws) for _ in law]
    fixed = np.column_stack([np.arange(count) == count - 1, np.ones(count, bool)])
    return latinpc.Structure(
        nodes, links, [law for laws_here in laws for law in laws_here], [k for here in stiffness for k in here],
        fixed=fixed, load=np.column_stack([load, np.zeros(count)]), geometry="large",
    )  # fmt: skip


@pytest.mark.parametrize("load", [1.0, -1.0])
def test_a_structure_twenty_times_stiffer_than_as_drawn(load):
    """Of a bar beside a strut and a cable either stiffens at once, which had been taken for a snap."""
    structure = chain([("bar", "compression_only", "cable")] * 3, [(1e2, 2e3, 2e3)] * 3, [load, 0.0, 0.0, 0.0])
    found = structure.solve(error=1e-8)
    assert found.converged
    assert found.displacements[0, 0] == pytest.approx(3.0 * load / 2.1e3, rel=1e-6)


@pytest.mark.parametrize("load", [0.2, -0.2])
@pytest.mark.parametrize("tension", [[-20.0, 0.0, 1.0], [-1.0, 0.0, 20.0]])
def test_a_law_twenty_times_softer_than_as_drawn(tension, load):
    """A table whose slope at rest is that of the other side."""
    table = latinpc.register_table([-1.0, 0.0, 1.0], tension)
    found = chain([(table,), (table,)], [(0.0,), (0.0,)], [load, 0.0, 0.0]).solve(error=1e-8)
    soft = (tension[2] == 1.0) == (load < 0.0)
    assert found.converged
    assert found.displacements[0, 0] == pytest.approx(2.0 * load / (1.0 if soft else 20.0), rel=1e-6)


def test_inextensible_cables_between_supports_alone():
    """Nothing moves them, and cables beside them stretch: the solve had ended with an error on newtonls."""
    nodes = np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 1.0], [3.0, 3.0], [2.0, 0.0]])
    links, fixed, load = [[0, 1], [0, 2], [1, 3], [0, 4], [2, 1]], np.zeros((5, 2), bool), np.zeros((5, 2))
    fixed[[0, 2]] = True
    load[[1, 3, 4]] = [[2.0, -2.0], [2.0, 0.0], [2.0, 0.0]]
    law = ["cable", "inextensible", "cable", "cable", "cable"]
    found = latinpc.Structure(nodes, links, law, 26.0, fixed=fixed, load=load, geometry="large").solve(error=1e-6)
    without = latinpc.Structure(nodes, [links[0], *links[2:]], "cable", 26.0, fixed=fixed, load=load, geometry="large")
    assert found.converged
    assert found.displacements == pytest.approx(without.solve(error=1e-6).displacements, abs=1e-4)
    assert found.balance.force < 1e-4


def yields(bars, load, **more):
    """Return a chain of bars of 1 m that yield at 1 N, from a support on."""
    table = latinpc.register_table([-0.02, -0.01, 0.01, 0.02], [-1.0, -1.0, 1.0, 1.0], name="yields")
    nodes = np.column_stack([np.zeros(bars + 1), np.arange(bars + 1)])
    fixed, loads = np.zeros((bars + 1, 2), bool), np.zeros((bars + 1, 2))
    fixed[0], loads[-1] = True, load
    links = np.column_stack([np.arange(bars), np.arange(1, bars + 1)])
    return latinpc.Structure(nodes, links, table, 0.0, fixed=fixed, load=loads, geometry="large", **more)


@pytest.mark.parametrize(
    ("load", "part"), [([0.0, -14.0], 0.0), ([0.0, 14.0], 1.0 / 14.0), ([9.0, -14.0], 1.0 / 16.64)]
)
def test_bars_that_yield_bear_what_they_yield_at(load, part):
    """More than that ended with displacements of 1e155 m. A bar that is pushed along itself is unstable."""
    found = yields(1, load).solve()
    assert not found.converged
    assert found.report["load_factor"] == pytest.approx(part, rel=2e-3)
    assert np.isfinite(found.displacements).all()


def test_struts_that_bear_nothing_as_drawn_have_no_stiffness_at_all():
    """What names the nodes that move had divided by zero."""
    strut = latinpc.Structure(
        [[0.0, 0.0], [1.0, 0.0]], [[0, 1]], "compression_only", 1e3, fixed=[[1, 1], [0, 0]], geometry="large"
    )
    found = strut.solve()
    assert not found.converged
    assert any("mechanism" in notice and notice.endswith("1") for notice in found.notices)


def test_no_claim_of_yielding_chains_that_leap_away():
    """Displacements of 1e98 Gm with unbalanced forces were claimed, or said to be those of an eighth of the loads."""
    nodes = [
        [2.278009426262819, 2.4985532598656572, 1.0455321851287631],
        [2.16630268911014, 2.2138024918286576, 1.789532249875649],
        [0.7792826688167682, 1.6526610534115835, 2.382798607149544],
        [1.5515446647970532, 2.5636133091978355, 2.1523414661311095],
        [1.7280497704373299, 1.308868951597851, 0.4227793385320259],
    ]
    table = latinpc.register_table([-0.02, -0.01, 0.01, 0.02], [-1.0, -1.0, 1.0, 1.0], name="yields")
    stiffens = latinpc.register_table([-1.0, 0.0, 0.1, 0.3], [0.0, 0.0, 1.0, 9.0], name="stiffens")
    load = [
        [-0.15881902221462604, 0.08718746553565629, 0.07810317501901487],
        [0.32987784947105603, -0.1108125111123436, 0.0968757038956923],
        [0.3818660117464003, -0.05722841634947369, -0.027085338661717126],
        [-0.03352021454238973, 0.12442248180862449, -0.11353509582885699],
        [0.0, 0.0, 0.0],
    ]
    elongation = [-0.018031411444920258, 0.41851303251421834, 0.02661788090647325, 0.2879404998679627]
    found = latinpc.Structure(
        nodes,
        [[0, 1], [0, 2], [1, 3], [3, 4]],
        [table, stiffens, table, table],
        166.72283247797606,
        fixed=[[0] * 3] * 4 + [[1] * 3],
        load=load,
        initial_elongation=elongation,
        geometry="large",
    ).solve(error=1e-6)
    assert np.abs(found.displacements).max() < 100.0
    assert not found.converged or found.balance.force < 1e-2


def test_a_link_that_tightens_between_increments():
    """Ten thousandfold, where little else holds the node: increments are not made so small that none follows."""
    tightens = (
        [-0.01981795, 0.00173331, 0.0205314, 0.02344549],
        [-7.08783981e-4, 7.37117065e-5, 7.37117065e-5, 3.79155466e-2],
    )
    found = latinpc.Structure(
        [[1.01488394, 1.42692716], [0.59375557, 1.1770515], [0.80347093, 1.54387636]], [[0, 1], [0, 2], [1, 2]],
        latinpc.register_table(*tightens, name="tightens"), 0.0, fixed=[[1, 1], [0, 0], [1, 1]],
        load=[[0.0, 0.0], [1.9123e-4, -7.3741e-4], [0.0, 0.0]],
        initial_elongation=[-0.00029683, 0.05244218, -0.00029683], geometry="large",
    ).solve()  # fmt: skip
    assert found.converged
