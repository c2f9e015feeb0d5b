"""The cases: each is one thing driven to its extreme, with the outcome that is expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from latinpc.scenes import Law, Scene, make

from .case import SUBDOMAINS, Case
from .case import options as _options

# ---- structures ------------------------------------------------------------------------------


def network(law=None, **changes):
    """Make 216 unknowns in 3D, bars and prestressed cables; `law` makes all links alike."""
    scene = make("network", nodes=100)
    if law is not None:
        changes["law"] = np.full(len(scene.links), law)
    return replace(scene, **changes)


def grid(**options):
    """Make the article's grid of 4 x 4 modules, 165 unknowns, as METIS cuts it."""
    return make("tensegrity-grid", modules=4, partition="metis", **options)


def contrast(factor, across, law=None):
    """Make some links `factor` times as stiff, at random or in half of the structure; self-stress is kept."""
    scene = network(law)
    middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
    chosen = middle > np.median(middle) if across else np.random.default_rng(3).random(len(middle)) < 0.3
    stiffness = np.where(chosen, factor * scene.stiffness, scene.stiffness)
    return replace(
        scene, stiffness=stiffness, initial_elongation=scene.initial_elongation * scene.stiffness / stiffness
    )


def chain(count):
    """Make bars in a row, held at one end, pulled at the other: as ill-conditioned as its square is large."""
    nodes = np.arange(count + 1.0)[:, None]
    fixed, load = np.zeros((count + 1, 1), bool), np.zeros((count + 1, 1))
    fixed[0], load[-1] = True, 1.0
    links = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    return Scene(name="chain", nodes=nodes, links=links, law=np.zeros(count, int), stiffness=np.full(count, 1e3),
                 fixed=fixed, load=load)  # fmt: skip


def chain_solution(scene):
    """Each bar bears the force: displacements grow by F / k from bar to bar, rounded once."""
    return (np.arange(len(scene.nodes)) / scene.stiffness[0])[:, None]


def star(count):
    """Make one node held by many prestressed cables from all around, pulled sideways."""
    angle = 2 * np.pi * np.arange(count) / count
    nodes = np.vstack([np.zeros(2), np.column_stack([np.cos(angle), np.sin(angle)])])
    links = np.column_stack([np.zeros(count, int), np.arange(1, count + 1)])
    fixed, load = np.ones((count + 1, 2), bool), np.zeros((count + 1, 2))
    fixed[0], load[0] = False, [1.0, 0.3]
    return Scene(name="star", nodes=nodes, links=links, law=np.full(count, Law.CABLE), stiffness=np.full(count, 1e3),
                 initial_elongation=np.full(count, 1e-5), fixed=fixed, load=load)  # fmt: skip


def complete(count):
    """Make a bar or a cable between any two of some random nodes in 3D."""
    rng = np.random.default_rng(1)
    nodes = rng.random((count, 3))
    links = np.column_stack(np.triu_indices(count, 1))
    fixed = np.zeros((count, 3), bool)
    fixed[:4] = True
    law = np.where(rng.random(len(links)) < 0.5, Law.CABLE, Law.BAR)
    return Scene(name="complete", nodes=nodes, links=links, law=law, stiffness=np.full(len(links), 1e3),
                 initial_elongation=np.full(len(links), 1e-4), fixed=fixed,
                 load=np.where(fixed, 0.0, rng.normal(size=(count, 3))))  # fmt: skip


def two_apart(held):
    """Make two networks that nothing joins, the second one held or not."""
    one = network()
    far = one.nodes + [100.0, 0.0, 0.0]
    fixed = np.vstack([one.fixed, one.fixed if held else np.zeros_like(one.fixed)])
    stack = {
        name: np.concatenate([getattr(one, name)] * 2) for name in ("law", "stiffness", "initial_elongation", "load")
    }
    links = np.vstack([one.links, one.links + len(one.nodes)])
    return Scene(name="two", nodes=np.vstack([one.nodes, far]), links=links, fixed=fixed, **stack)  # fmt: skip


def close_nodes(distance):
    """Make a network with one node doubled at a small distance, links of constant EA: the short one is very stiff."""
    scene = network(Law.BAR)
    node = int(np.flatnonzero(~scene.fixed.any(axis=1))[0])
    size = np.ptp(scene.nodes, axis=0).max()
    beside = scene.nodes[node] + [distance * size, 0.0, 0.0]
    links, twin = scene.links.copy(), len(scene.nodes)
    ends = np.flatnonzero((links == node).any(axis=1))
    extra = links[ends].copy()  # the twin has links of its own to all the neighbours
    extra[extra == node] = twin
    stiffness = np.concatenate([scene.stiffness, scene.stiffness[ends], [1e7 / (distance * size)]])
    count = len(ends) + 1
    return Scene(
        name="close", nodes=np.vstack([scene.nodes, beside]), links=np.vstack([links, extra, [[node, twin]]]),
        law=np.zeros(len(stiffness), int), stiffness=stiffness,
        initial_elongation=np.concatenate([scene.initial_elongation, np.zeros(count)]),
        fixed=np.vstack([scene.fixed, [[False] * 3]]), load=np.vstack([scene.load, scene.load[node]]),
    )  # fmt: skip


def hung(force):
    """Make a node under two cables, pushed up by a force: no equilibrium."""
    return Scene(name="hung", nodes=[[-1.0, 1.0], [1.0, 1.0], [0.0, 0.0]], links=[[0, 2], [1, 2]], law=[1, 1],
                 stiffness=[1e3, 1e3], initial_elongation=[1e-3, 1e-3], fixed=[[1, 1], [1, 1], [0, 0]],
                 load=[[0, 0], [0, 0], [0, force]])  # fmt: skip


def hinged(count):
    """Make triangles in a row, each hung from two anchors, that share one node with the next: a subdomain each."""
    x = np.arange(count + 1.0)
    low, top = np.column_stack([x, 0 * x]), np.column_stack([x[:-1] + 0.5, 0 * x[:-1] + 0.8])
    anchors = np.vstack([top + [-0.3, 1.0], top + [0.3, 1.0]])
    i = np.arange(count)
    above = count + 1 + i
    ends = [(i, i + 1), (i, above), (i + 1, above), (above, above + count), (above, above + 2 * count)]
    links = np.vstack([np.column_stack(pair) for pair in ends])
    nodes = np.vstack([low, top, anchors])
    fixed = np.zeros(nodes.shape, bool)
    fixed[0] = fixed[-2 * count :] = True
    weight = np.random.default_rng(2).uniform(-1.5, [0.0, -0.5], nodes.shape)  # downwards, and a wind
    load = np.where(fixed, 0.0, weight)
    law = np.repeat([Law.BAR, Law.BAR, Law.BAR, Law.CABLE, Law.CABLE], count)
    return Scene(name="hinged", nodes=nodes, links=links, law=law, stiffness=np.full(len(links), 1e3),
                 initial_elongation=np.where(law == Law.CABLE, 1e-2, 0.0), fixed=fixed, load=load,
                 subdomain=np.tile(i, 5))  # fmt: skip


def slackened(share):
    """Make a network with a share of the cables, chosen at random, too long to be reached by any load."""
    scene = network()
    cables = np.flatnonzero(scene.law == Law.CABLE)
    chosen = np.random.default_rng(4).permutation(cables)[: round(share * len(cables))]
    scene.initial_elongation[chosen] = -1.0
    return scene


def girder(uplift, cells=12, height=2):
    """Make a girder of bars hung from a cable at each upper node; an uplift of 1 turns it about the first cable."""
    y, x = (axis.ravel() for axis in np.meshgrid(np.arange(height + 1), np.arange(cells + 1), indexing="ij"))
    number = np.arange(len(x)).reshape(height + 1, cells + 1)
    pairs = ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]), (number[:-1, :-1], number[1:, 1:]),
             (number[:-1, 1:], number[1:, :-1]))  # fmt: skip
    bars = np.vstack([np.stack(pair, axis=2).reshape(-1, 2) for pair in pairs])
    upper = number[-1]
    nodes = np.vstack([np.column_stack([x, y]), np.column_stack([x[upper], y[upper] + 8])]).astype(float)
    links = np.vstack([bars, np.column_stack([upper, len(x) + np.arange(len(upper))])])
    cable = np.arange(len(links)) >= len(bars)
    fixed = np.zeros(nodes.shape, bool)
    fixed[0, 0] = True
    fixed[len(x) :] = True
    load = np.zeros(nodes.shape)
    load[: len(x), 1] = -1e4
    up = np.where(np.arange(len(nodes)) < len(x), 0.5 + nodes[:, 0] / cells, 0.0)
    load[:, 1] += uplift * up * (1e4 * x.sum()) / (up[: len(x)] @ x)  # moments about the first cable
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    return Scene(name="girder", nodes=nodes, links=links, law=np.where(cable, Law.CABLE, Law.BAR),
                 stiffness=6.5e7 / length, fixed=fixed, load=load)  # fmt: skip


MIXED = (
    "nodes in mm", "a component in mm", "loads in kN",
    "initial elongations in mm", "stiffnesses in kN/mm", "one half in kN and mm",
)  # fmt: skip


def mixed(what):
    """Make the network with a part of its data in other units than newtons and metres."""
    scene = network()
    half = scene.nodes[scene.links].mean(axis=1)[:, 0] > np.median(scene.nodes[:, 0])
    units = np.where(half, [[1e-6], [1e3]], 1.0)
    changes = {
        "nodes in mm": {"nodes": 1e3 * scene.nodes},
        "a component in mm": {"nodes": scene.nodes * [1.0, 1.0, 1e3]},
        "loads in kN": {"load": 1e-3 * scene.load},
        "initial elongations in mm": {"initial_elongation": 1e3 * scene.initial_elongation},
        "stiffnesses in kN/mm": {"stiffness": 1e-6 * scene.stiffness},
        "one half in kN and mm": {
            "stiffness": scene.stiffness * units[0],
            "initial_elongation": scene.initial_elongation * units[1],
        },
    }
    return replace(scene, **changes[what])


def in_units(length, force):
    """Make the article's grid in other units."""
    scene = grid()
    return replace(scene, nodes=scene.nodes * length, stiffness=scene.stiffness * force / length,
                   initial_elongation=scene.initial_elongation * length, load=scene.load * force)  # fmt: skip


# ---- the catalogue ---------------------------------------------------------------------------


def cases():
    """Return all cases, group by group."""
    return [*_stiffness(), *_directions(), *_loads(), *_geometry(), *_partitions(), *_topology(), *_ranks()]


def _stiffness():
    for law, what in ((Law.BAR, "bars"), (None, "cables")):
        for across, where in ((False, "between links"), (True, "in one half")):
            for power in (2, -2, 4, -4, 8, -8, 12, -12, 14, -14):
                # 1e14 leaves two digits of the soft links next to stiff ones: a refusal is right too; and where
                # rounding of the stiff links hides more than a hundredth of the loads
                hides = abs(power) == 14 or (power == 12 and law is None and not across)
                yield Case("stiffness", f"{what}, contrast 1e{power} {where}",
                           lambda power=power, across=across, law=law: contrast(10.0**power, across, law),
                           "either" if hides else "right", _options())  # fmt: skip
    for power in (4, 8, 12, 14):
        yield Case("stiffness", f"contrast 1e{power} between subdomains", lambda power=power: by_subdomain(10.0**power),
                   "right" if power < 14 else "either", _options())  # fmt: skip


def by_subdomain(factor):
    """Make every other subdomain `factor` times as stiff, cables with the same self-stress."""
    scene = network()
    place = scene.nodes[scene.links].mean(axis=1)[:, 0]
    part = np.searchsorted(np.quantile(place, np.arange(1, SUBDOMAINS) / SUBDOMAINS), place)
    stiffness = np.where(part % 2, factor * scene.stiffness, scene.stiffness)
    initial_elongation = scene.initial_elongation * scene.stiffness / stiffness
    return replace(scene, stiffness=stiffness, initial_elongation=initial_elongation, subdomain=part)


def blocks():
    """Make four blocks of 4 x 4 modules, with interfaces that have more than macro fields."""
    return make("tensegrity-grid", modules=8, subdomains=4)


def _directions():
    for power in (2, -2, 4, -4, 6, -6, 8, -8):
        yield Case("direction", f"1e{power} times the self-tuned one", blocks,
                   options=_options(snes_latin_direction_value=10.0**power, snes_latin_subdomains=4))  # fmt: skip


def _loads():
    for make_scene, what in ((grid, "grid"), (network, "network")):
        for power in (-14, -8, -4, 2, 4, 8, 14):

            def loaded(power=power, make_scene=make_scene):
                scene = make_scene()
                return replace(scene, load=scene.load * 10.0**power)

            # rounding of the prestress hides the least loads, and what they move; large loads leave so many cables
            # slack that there may be no equilibrium
            expected = "right" if -14 < power < 0 else "either"
            yield Case("load", f"{what}, 1e{power} times the nominal", loaded, expected, _options())
    for factor in (2, 5, 10, 20):
        yield Case("load", f"grid, {factor} times the nominal", lambda factor=factor: (
            replace(grid(), load=grid().load * factor)), "either", _options())  # fmt: skip
    for factor in (0.0, 1e-6, 1e3, 1e6):
        yield Case("prestress", f"network, {factor:g} times the nominal", lambda factor=factor: (
            network(initial_elongation=factor * network().initial_elongation)),
            "right" if factor else "either", _options())  # fmt: skip
    yield Case("slack", "no cable", lambda: grid(slack=0.0), options=_options())
    yield Case("slack", "a quarter of the cables", lambda: grid(slack=0.25), options=_options())
    for share in (0.5, 0.99):
        yield Case("slack", f"{100 * share:g} % of the cables, whatever the load", lambda share=share: slackened(share),
                   "either", _options())  # fmt: skip
    for uplift in (0.5, 0.9, 0.99, 1 - 1e-6, 1 + 1e-6, 1.01, 2.0):
        yield Case("slack", f"{uplift:.7g} of the load that turns a girder over", lambda uplift=uplift: girder(uplift),
                   "right" if uplift < 1.0 else "refused", _options())  # fmt: skip
    yield Case("slack", "all cables", lambda: network(
        initial_elongation=np.where(network().law == Law.CABLE, -1.0, 0.0)), "either", _options())  # fmt: skip
    yield Case("slack", "a node flies away", lambda: hung(1.0), "refused", _options(snes_latin_subdomains=2))
    yield Case("slack", "a node barely held", lambda: hung(-1e-9), options=_options(snes_latin_subdomains=2))
    yield Case("load", "none", lambda: network(load=0.0 * network().load), options=_options())
    yield Case("load", "none, no prestress", lambda: network(
        load=0.0 * network().load,
        initial_elongation=0.0 * network().initial_elongation), options=_options())  # fmt: skip


def _geometry():
    for length, force, what in ((1e3, 1e-3, "mm and kN"), (1e3, 1.0, "mm and N"), (1e-6, 1e6, "1e-6 and 1e6"),
                                (1e9, 1e-9, "1e9 and 1e-9"), (1e-9, 1e9, "1e-9 and 1e9")):  # fmt: skip
        yield Case("units", what, lambda length=length, force=force: in_units(length, force), options=_options())
    for what in MIXED:  # wrong data may leave no equilibrium
        yield Case("units", f"{what}, all else in N and m", lambda what=what: mixed(what),
                   "right" if what in MIXED[:3] else "either", _options())  # fmt: skip
    for shift in (1e4, 1e8, 1e12):
        yield Case("origin", f"{shift:g} m away", lambda shift=shift: replace(grid(), nodes=grid().nodes + shift),
                   "right" if shift < 1e12 else "either", _options())  # fmt: skip
    for distance in (1e-3, 1e-6, 1e-9, 1e-12, 1e-14):
        yield Case("close nodes", f"{distance:g} of the size", lambda distance=distance: close_nodes(distance),
                   options=_options())  # fmt: skip


def _partitions():
    links = len(network().links)
    yield Case("partition", "one subdomain", network, options=_options(snes_latin_subdomains=1))
    yield Case(
        "partition",
        "one link a subdomain",
        lambda: network(subdomain=np.arange(links)),
        options=_options(snes_latin_subdomains=links),
    )
    yield Case("partition", "bars, one link a subdomain", lambda: network(Law.BAR, subdomain=np.arange(links)),
               options=_options(snes_latin_subdomains=links))  # fmt: skip
    yield Case("partition", "interfaces of one node", lambda: hinged(24), options=_options(snes_latin_subdomains=24))
    yield Case("partition", "links dealt at random", lambda: network(
        subdomain=np.random.default_rng(0).permutation(np.arange(links) % 8)), options=_options())  # fmt: skip
    yield Case("partition", "more subdomains than links", network, "refused", _options(snes_latin_subdomains=links + 1))
    yield Case("partition", "2,000 subdomains, 4,800 links", lambda: make("lattice", nx=40, ny=30, partition="metis"),
               options=_options(snes_latin_subdomains=2000))  # fmt: skip


def _topology():
    for count in (10**3, 10**5, 10**6):
        yield Case("chain", f"{count:,} bars", lambda count=count: chain(count), options=_options(
            snes_latin_subdomains=max(8, count // 1000)), solution=chain_solution)  # fmt: skip
    yield Case("star", "500 cables at one node", lambda: star(500), options=_options())
    yield Case("complete graph", "30 nodes", lambda: complete(30), options=_options())
    yield Case("disconnected", "both held", lambda: two_apart(True), options=_options())
    yield Case("disconnected", "one not held", lambda: two_apart(False), "refused", _options())
    free = np.zeros_like(network().fixed)
    yield Case("supports", "none", lambda: network(fixed=free), "refused", _options())
    yield Case("supports", "all nodes prescribed", lambda: network(
        fixed=np.ones_like(network().fixed), load=0 * network().load), options=_options())  # fmt: skip


def _ranks():
    for ranks in (2, 4, 8, 16):
        yield Case("ranks", f"{ranks}, 8 subdomains", network, options=_options(), ranks=ranks)
    yield Case("ranks", "6, two links", lambda: hung(-1.0), options=_options(snes_latin_subdomains=2), ranks=6)
    yield Case("ranks", "4, one subdomain", network, options=_options(snes_latin_subdomains=1), ranks=4)
