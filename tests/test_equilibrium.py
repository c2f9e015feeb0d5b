"""What displacements that rest leave undone: nodes without a support, gaps that are missed, links that are jammed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc
from scipy.optimize import linprog
from scipy.spatial import Delaunay
from support import far, latin

import latinpc
from latinpc.bench.extremes.drawn import draw
from latinpc.bench.extremes.exact import solve_exactly
from latinpc.bench.extremes.rating import judge
from latinpc.bench.extremes.rigid import against, between, net, packing, row, row_solution, stiffened
from latinpc.runs.solve import solve
from latinpc.scenes import Law

Reason = PETSc.SNES.ConvergedReason
ACCURACY = 1e-6


def ended(scene, **options):
    """How SNES latin ends: displacements, reason, loose nodes, jammed links."""
    with latin(scene, **{"stop": "error", "error": ACCURACY, "subdomains": min(4, len(scene.links)), **options}) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        told = latinpc.unsupported_nodes(run.snes), latinpc.jammed_links(run.snes)
        return run.structure.displacements(u), run.snes.getConvergedReason(), *told, latinpc.rounding_floor(run.snes)


@pytest.mark.parametrize("law", [Law.CONTACT, Law.INEXTENSIBLE])
@pytest.mark.parametrize("light", [0.1, 1e-3, 1e-12])
def test_a_light_node_is_where_it_belongs_or_named(law, light):
    """The last node of a row has to get to the one before it, with next to no load beside the others'."""
    scene = row(law, np.full(8, 0.01), np.append(np.ones(7), light))
    u, reason, (count, nodes), _, _ = ended(scene)
    if reason > 0:
        assert far(u, row_solution(scene)) < 3 * ACCURACY
    else:
        assert count and 8 in nodes
    assert reason > 0 or light < 0.1


def test_stiff_contacts_under_a_small_load_are_closed_or_the_loads_are_lost_in_rounding():
    """Grains whose contacts loads shorten by 1e-5 to 1e-13 of the gaps: never at rest in the air."""
    reasons = []
    for load in (1e-6, 1e-12):
        scene = packing(5, load=load, law="elastic")
        u, reason, _, _, floor = ended(scene)
        reasons.append(reason)
        assert reason > 0 or floor > ACCURACY
        if reason > 0:
            top = scene.load[:, -1] < 0
            assert (u[top, -1] < -1e-4).all()
    assert reasons[0] > 0


@pytest.mark.parametrize("given", [{"k": 1e-12}, {"load": 1e12}, {"k": 1e-9}, {}])
def test_a_gap_that_tensions_hide(given):
    """The gap is met to the accuracy, or what rounding leaves of it is told."""
    scene = against(Law.INEXTENSIBLE, 5e-4, **given)
    u, reason, _, _, floor = ended(scene)
    if reason > 0:
        assert u[1, 0] == pytest.approx(5e-4, rel=3 * ACCURACY)
    else:
        assert reason == Reason.DIVERGED_INNER
        assert floor > ACCURACY
        assert abs(u[1, 0] / 5e-4 - 1) < 10 * floor


@pytest.mark.parametrize("load", [0.0, 1.0])
@pytest.mark.parametrize("count", [1, 20])
def test_grains_without_room_are_jammed(count, load):
    """All contacts between two walls are named; with just room, none."""
    _, reason, (loose, _), (jammed, links), _ = ended(between(-1e-3, load, count))
    assert reason < 0 and jammed == count + 1 and not loose
    assert links == list(range(min(count + 1, 8)))
    u, reason, _, jammed, _ = ended(between(0.0, load, count))
    assert reason > 0 and jammed == (0, [])
    assert np.abs(u).max() < 1e-15 * count


def sheared(seed, side=8):
    """Grains in a box, rigid contacts between neighbours with random gaps, all at rest; the upper wall moves aside."""
    draw = np.random.default_rng(seed)
    place = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1).reshape(-1, 2).astype(float)
    nodes = place + [[0.5, 0.0]] * (place[:, 1:] % 2) + draw.uniform(-0.2, 0.2, place.shape)
    corners = Delaunay(nodes).simplices
    links = np.unique(np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [0, 2]]])), axis=0)
    wall = (place == 0).any(1) | (place == side - 1).any(1)
    links = links[(np.linalg.norm(np.diff(nodes[links], axis=1), axis=2)[:, 0] < 2.0) & ~wall[links].all(1)]
    upper = (place[:, 1] == side - 1)[:, None]
    return latinpc.Structure(
        nodes, links, "contact", 0.0, initial_elongation=draw.uniform(0.0, 2e-3, len(links)),
        fixed=np.repeat(wall, 2).reshape(-1, 2), prescribed=upper * [2e-2, 0.0], load=~wall[:, None] * [0.0, -1.0],
        comm=PETSc.COMM_SELF,
    )  # fmt: skip


def has_room(structure):
    """Whether displacements exist that close no contact beyond its gap: a linear program."""
    i, j = structure.links.T
    rows, n = np.arange(len(i)), len(structure.nodes)
    B = np.zeros((len(i), n, 2))
    B[rows, j] += structure.directions
    B[rows, i] -= structure.directions
    gap = structure.initial_elongation + (B * structure.prescribed).sum((1, 2))
    free = ~structure.fixed
    return linprog(np.zeros(free.sum()), -B[:, free], gap, bounds=(None, None)).status == 0


@pytest.mark.parametrize("seed", [0, 1, 2, 8])
def test_a_box_of_grains_that_shears_too_far_is_jammed(seed):
    """The contacts that contradict each other are named, also where on the way others must first let go."""
    structure = sheared(seed)
    assert not has_room(structure)
    result = structure.solve()
    assert not result.converged and any("gaps of the rigid links" in text for text in result.notices)
    assert result.iterations < 1000


def test_a_cable_too_short_for_a_contact():
    """Two of three links contradict each other, and they are named."""
    scene = replace(against(Law.INEXTENSIBLE, 0.0, copies=2), law=[Law.BAR, Law.INEXTENSIBLE, Law.CONTACT],
                    initial_elongation=[0.0, 1e-6, -2e-6])  # fmt: skip
    _, reason, _, jammed, _ = ended(scene)
    assert reason < 0 and jammed == (2, [1, 2])


@pytest.mark.parametrize(("number", "links"), [(6598, [35, 36]), (8862, [0, 26])])
def test_gaps_that_miss_each_other_by_little_are_jammed(number, links):
    """By 3e-5 of the displacements: the method of multipliers shows tensions that grow by the same self-stress."""
    scene = draw(20261127, number).scene
    assert not solve_exactly(scene).exists
    _, reason, _, jammed, _ = ended(scene)
    assert reason < 0 and jammed == (2, links)


@pytest.mark.parametrize("number", [264, 392, 628, 639])
def test_supports_that_move_a_structure_as_a_rigid_body_are_followed(number):
    """No load acts and no link is strained: that no tension has a digit is no loss of digits."""
    scene = draw(91127, number, "rigid").scene
    u, reason, _, _, _ = ended(scene, subdomains=0)
    exact = solve_exactly(scene, unique=True)
    assert exact.exists and not scene.load.any()
    assert reason > 0
    assert not exact.unique or u == pytest.approx(exact.displacements, abs=1e-12)


def test_a_self_stress_of_rigid_links_hides_no_tension():
    """Contacts and cables side by side bear against each other what the iteration has left; others bear nothing."""
    scene = draw(6123457, 191, "rigid").scene
    result = solve(scene, {})
    assert result.converged and not scene.load.any()
    assert abs(result.tensions[scene.stiffness > 0]).max() < 1e-12


def test_a_self_stress_of_rigid_links_holds_a_node():
    """What they bear together at a node without a load is rounding, and no force that nothing resists."""
    assert solve(draw(6123457, 844, "rigid").scene, {}).converged


def test_tensions_that_make_room_for_others_show_no_jam():
    """Gaps are missed by as much from step to step, while tensions that balance the growing ones still fall to zero."""
    scene = draw(77102, 569).scene
    exact = solve_exactly(scene, unique=True)
    u, reason, _, jammed, _ = ended(scene, subdomains=0)
    assert exact.exists and exact.unique
    assert jammed == (0, [])
    assert reason < 0 or far(u, exact.displacements) < 3 * ACCURACY  # rounding decides whether it converges


def test_a_net_that_holds_is_not_jammed_where_the_iteration_is_cut_short():
    assert ended(net(), **{"max_it": 5})[3] == (0, [])


@pytest.mark.parametrize("power", [4, 8])
def test_search_parameters_become_the_stiffness_that_the_structure_shows(power):
    """Bars of very different stiffness beside rigid links: the solution in ball arithmetic."""
    scene = stiffened(10.0**power, False)
    u, reason, *_ = ended(scene)
    assert reason > 0
    assert far(u, solve_exactly(scene, u).displacements) < 3 * ACCURACY


PROGRAM = """
import json, sys
import petsc4py; petsc4py.init([sys.argv[0], "-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, {tests!r})
import numpy as np
import latinpc
from latinpc.bench.extremes import rigid
from latinpc.options import default_options
from latinpc.scenes import Law

told = []
flies = rigid.row(Law.CONTACT, np.full(8, 0.01), -1.0)
for scene in (rigid.stiffened(1e8, False), rigid.between(-1e-3, 1.0, 20), flies):
    structure = latinpc.Structure.from_scene(scene)
    with default_options({{"snes_latin_stop": "error", "snes_latin_error": 1e-6, "snes_latin_subdomains": 4}}):
        snes = structure.create_snes()
        snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    told.append([snes.getConvergedReason(), latinpc.unsupported_nodes(snes), latinpc.jammed_links(snes),
                 structure.displacements(u).tolist()])
if PETSc.COMM_WORLD.rank == 0:
    print(json.dumps(told))
"""


def test_ranks_tell_the_same(mpirun):
    """One, two and five ranks: reasons, names, and the displacements of what has converged, to what was asked for."""
    found = [json.loads(mpirun(n, PROGRAM.format(tests=str(ROOT / "tests"))).stdout) for n in (1, 2, 5)]
    for other in found[1:]:
        assert [one[:3] for one in other] == [one[:3] for one in found[0]]
        assert far(np.array(other[0][3]), np.array(found[0][0][3])) < 2e-6


@pytest.mark.parametrize("seed, number, family", [(287388365, 9898, None), (77120, 2723, "rigid")])
def test_rigid_links_that_bear_little_are_found_taut(seed, number, family):
    """The iteration creeps: its distances shrink by 1e-4 a stage, and the estimate takes that for rest."""
    assert judge(draw(seed, number, family), {})["verdict"] == "right"


def nearly_straight(law, slope, angle=0.0):
    """A node that prestress holds against its load, between links that are nearly straight; a cable is slack."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    nodes = np.array([[-1.0, slope], [0.0, 0.0], [1.0, slope], [0.2, -1.0]])
    fixed, load = np.ones((4, 2), dtype=bool), np.zeros((4, 2))
    fixed[1], load[1, 1] = False, -1e-9
    prestress = 0.5e-9 / slope * np.hypot(1.0, slope)
    return latinpc.Structure(
        nodes @ turn,
        [[0, 1], [1, 2], [1, 3]],
        [law, law, Law.CABLE],
        1.0,
        initial_elongation=[prestress, prestress, -1.0],
        fixed=fixed,
        load=load @ turn,
    ), prestress


@pytest.mark.parametrize("law", [Law.BAR, Law.CABLE])
@pytest.mark.parametrize("slope", [1e-3, 1e-4, 1e-9, 1e-10, 1e-12])
def test_a_node_that_prestress_holds_between_links_that_are_nearly_straight(slope, law):
    """It stays: prestress bears the load. The first stage throws it to the slack cable: 2 k slope^2 pushes back."""
    s, prestress = nearly_straight(law, slope)
    found = s.solve()
    assert found.converged == (slope > 1e-11)
    if found.converged:
        assert abs(found.displacements).max() <= 1e-15 * prestress / slope  # what rounding of the prestress moves


@pytest.mark.parametrize("angle", [0.3, 0.5, 1.0, 1.9])
@pytest.mark.parametrize("slope", [1e-2, 1e-3, 1e-6, 1e-7, 1e-8])
def test_the_same_in_any_direction(slope, angle):
    """Forces along two axes do not cancel to the last digit: the node stays, or moves by rounding alone."""
    s, _ = nearly_straight(Law.BAR, slope, angle)
    found = s.solve()
    assert found.converged == (slope > 1e-4)
    if found.converged:
        assert abs(found.displacements).max() <= 1e-15


@pytest.mark.parametrize("room, holds", [(1e-9, True), (0.0, True), (-2e-9, False)])
def test_gaps_that_contradict_each_other_by_far_less_than_what_moves(room, holds):
    """Two contacts in a row along an inextensible cable: tensions grow by the same self-stress without end."""
    nodes, gaps = np.array([[-1.0], [0.0], [1.0], [2.0]]), np.array([-5e-8, -3e-9])
    links, law = [[0, 1], [1, 2], [2, 3], [1, 3]], [Law.BAR, Law.CONTACT, Law.CONTACT, Law.INEXTENSIBLE]
    e0 = [0.0, *gaps, gaps.sum() - room]
    s = latinpc.Structure(
        nodes,
        links,
        law,
        [0.05, 0, 0, 0],
        e0,
        fixed=np.arange(4)[:, None] == 0,
        load=np.array([[0.0, 3e-4, 1e-4, -2e-4]]).T,
    )
    found = s.solve()
    assert found.converged or not holds
    if found.converged:  # by rounding also where the room lacks a millionth of what moves
        assert far(found.displacements, np.append(0.0, 4e-3 + np.array([0.0, 5e-8, 5.3e-8]))[:, None]) < 3e-4
    else:
        assert found.notices == ["no equilibrium: the gaps of the rigid links 1, 2, 3 are incompatible"]


@pytest.mark.parametrize("away", [1e4, 1e5, 1e7])
@pytest.mark.parametrize("gap", [1e-3, 1e-4, -1e-4])
def test_gaps_that_contradict_each_other_beside_what_moves_away(away, gap):
    """A node between two inextensible links that are too long or too short; a soft bar lets another go far away."""
    s = latinpc.Structure(
        np.arange(5.0)[:, None],
        [[0, 1], [1, 2], [2, 3], [3, 4]],
        [Law.BAR, Law.INEXTENSIBLE, Law.INEXTENSIBLE, Law.BAR],
        [1.0, 0, 0, 1e-6],
        [0.0, gap, gap, 0.0],
        fixed=[[1], [1], [0], [1], [0]],
        load=[[0], [0], [1e-3], [0], [away * 1e-6]],
    )
    found = s.solve()
    assert found.converged == (gap < 0.0)
    if found.converged:
        assert far(found.displacements[2:], np.array([[-gap], [0.0], [away]])) < 1e-12
        assert found.displacements[2, 0] == pytest.approx(-gap, rel=1e-6)
    else:
        assert "no equilibrium: the gaps of the rigid links 1, 2 are incompatible" in found.notices


@pytest.mark.parametrize("stop", [{"snes_latin_stop": "residual", "snes_rtol": 1e-10}, {"snes_stol": 1e-8}])
@pytest.mark.parametrize("load", [0.0, 1.0])
@pytest.mark.parametrize("gap", [1e-3, -1e-3])
def test_no_stop_claims_gaps_that_are_missed(load, gap, stop):
    """Forces balance at each node as soon as rigid links bear what is left; without loads they do so from the start."""
    s = latinpc.Structure(
        np.arange(4.0)[:, None],
        [[0, 1], [1, 2], [2, 3]],
        [Law.INEXTENSIBLE, Law.INEXTENSIBLE, Law.BAR],
        [0, 0, 1e3],
        [gap, gap, 0.0],
        fixed=[[1], [0], [1], [0]],
        load=[[0], [load], [0], [load]],
    )
    found = s.solve(options=stop)
    assert found.converged == (gap < 0.0)
    if found.converged:
        assert found.displacements[1, 0] == pytest.approx(-gap if load else 0.0, abs=1e-9)
        assert found.displacements[3, 0] == pytest.approx(load / 1e3, abs=1e-12)
    else:
        assert "no equilibrium: the gaps of the rigid links 0, 1 are incompatible" in found.notices


@pytest.mark.parametrize(("seed", "number"), [(32005, 93), (32005, 60), (32003, 133)])
def test_the_indicator_alone_is_no_equilibrium(seed, number):
    """Structures without one, on which the steps of the iteration become small: the nodes and gaps show it."""
    scene = draw(seed, number).scene
    assert not solve_exactly(scene).exists
    found = latinpc.Structure.from_scene(scene).solve(options={"snes_stol": 1e-8})
    assert not found.converged


@pytest.mark.parametrize("seed", [21, 34, 64])
def test_a_node_that_only_a_link_across_its_way_reaches(seed):
    """A vertical bar does not hold a node that has slid sideways by the rounding of its direction: refused before."""
    n, rng = 7, np.random.default_rng([1, seed])
    ends = []
    for k in range(n * n):
        row, column = divmod(k, n)
        ends += [[k, k + 1]] * (column < n - 1) + [[k, k + n]] * (row < n - 1)
        ends += [[k, k + n + 1], [k + 1, k + n]] * (row < n - 1 and column < n - 1)
    stiffness = 10 ** rng.uniform(2, 4, len(ends))
    cables = rng.random(len(ends)) < 0.5
    elongation = np.zeros(len(ends))
    elongation[cables] = rng.uniform(0, 1e-3, cables.sum())
    load = np.zeros((n * n, 2))
    load[-1] = [1, -2]
    tensions = []
    for angle in (0.0, np.radians(10.0)):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        structure = latinpc.Structure(
            np.array([divmod(k, n)[::-1] for k in range(n * n)]) @ turn, ends, cables.astype(int), stiffness,
            initial_elongation=elongation, fixed=[[k < n] * 2 for k in range(n * n)], load=load @ turn,
            comm=PETSc.COMM_SELF,
        )  # fmt: skip
        found = structure.solve()
        assert found.converged
        tensions.append(found.tensions)
    assert far(*tensions) < 1e-3
