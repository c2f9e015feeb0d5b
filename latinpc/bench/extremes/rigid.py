"""The cases of the other laws: rigid links, contacts with friction, elastic contacts, tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from latinpc.scenes import Law, Scene, make

from .case import SUBDOMAINS, Case, options

# ---- structures ------------------------------------------------------------------------------


def girder(**changes):
    """Make 66 unknowns: a girder of bars that hangs from five inextensible cables, a little too long."""
    return replace(make("hung-truss", nx=12, ny=2, cables=5, seed=2), **{"subdomain": None, **changes})


def stiffened(factor, half):
    """Make some bars of the girder `factor` times as stiff, at random or in one half; its cables have no stiffness."""
    scene = girder()
    middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
    chosen = middle > np.median(middle) if half else np.random.default_rng(3).random(len(middle)) < 0.3
    return replace(scene, stiffness=np.where(chosen, factor * scene.stiffness, scene.stiffness))


def net(factor=1.0):
    """Make a fishing net of inextensible cables, of which some go slack, under `factor` times its catch and current."""
    scene = make("net", side=6)
    return replace(scene, subdomain=None, load=factor * scene.load)


def row(law, gaps, weights):
    """Make nodes below each other that hang from a hook (inextensible), or on each other on a table (contact)."""
    gaps, weights = np.broadcast_arrays(gaps, weights)
    count = len(gaps)
    sign = 1.0 if law in (Law.CONTACT, Law.COMPRESSION_ONLY) else -1.0
    fixed = np.arange(count + 1)[:, None] == 0
    load = np.append(0.0, -weights)[:, None]
    return Scene(name="row", nodes=sign * np.arange(count + 1.0)[:, None], fixed=fixed, load=load,
                 links=np.column_stack([np.arange(count), np.arange(1, count + 1)]), law=np.full(count, law),
                 stiffness=np.full(count, 1e3 if law == Law.COMPRESSION_ONLY else 0.0),
                 initial_elongation=sign * gaps)  # fmt: skip


def row_solution(scene):
    """Each node goes down by the gaps above or below it, and by what the weights on them shorten elastic ones."""
    elastic = np.cumsum(scene.load[::-1, 0])[::-1][1:] / np.where(
        scene.law == Law.COMPRESSION_ONLY, scene.stiffness, np.inf
    )
    return np.append(0.0, np.cumsum(elastic - np.abs(scene.initial_elongation)))[:, None]


def against(law, gap, k=1e3, load=1.0, copies=1):
    """Make a node on a spring that a load pulls, or pushes, until rigid links stop it."""
    sign = 1.0 if law == Law.INEXTENSIBLE else -1.0
    gaps = np.broadcast_to(gap, copies)
    load = [[0.0], [sign * load], [0.0]]
    return Scene(name="against", nodes=[[0.0], [1.0], [2.0]], load=load, links=[[2, 1]] + [[0, 1]] * copies,
                 law=[Law.BAR] + [law] * copies, stiffness=[k] + [0.0] * copies,
                 initial_elongation=np.append(0.0, -sign * gaps), fixed=[[1], [0], [1]])  # fmt: skip


def between(gap, load=0.0, count=1):
    """Make grains in a row between two walls, with so much room at each contact: none when it is negative."""
    scene = row(Law.CONTACT, np.full(count + 1, gap), load)
    fixed = np.isin(np.arange(count + 2), (0, count + 1))[:, None]
    return replace(scene, fixed=fixed, load=np.where(fixed, 0.0, scene.load))


def packing(side=8, load=1.0, gap=1.0, contrast=1.0, **given):
    """Make grains in a box, with so many times their loads and gaps, some elastic contacts so many times as stiff."""
    scene = make("packing", side=side, **given)
    chosen = np.random.default_rng(0).random(len(scene.links)) < 0.3
    return replace(scene, load=load * scene.load, initial_elongation=gap * scene.initial_elongation, subdomain=None,
                   stiffness=np.where(chosen, contrast * scene.stiffness, scene.stiffness))  # fmt: skip


def dealt(scene, parts=None):
    """Give every link a subdomain of its own, or deal them at random."""
    many = np.arange(len(scene.links))
    return replace(scene, subdomain=many if parts is None else np.random.default_rng(0).permutation(many) % parts)


def simplex(scene):
    """Return the tensions of rigid grains by the simplex method: the loads do as much work as gaps allow."""
    from scipy.optimize import linprog

    from latinpc.bench.peers.qp import kinematics

    b, _ = kinematics(scene)
    force, gap = scene.load[~scene.fixed], np.abs(scene.initial_elongation).max()
    found = linprog(-force / np.abs(force).max(), A_ub=-b, b_ub=scene.initial_elongation / gap, bounds=(None, None),
                    method="highs-ds")  # fmt: skip
    return found.ineqlin.marginals * np.abs(force).max()


def at_rest(scene):
    """Nothing moves."""
    return np.zeros(scene.nodes.shape)


def slope(friction, angle, k=1e3, weight=10.0):
    """Make a block on a slope, with a spring along the slope."""
    n, t = np.array([-np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])
    return Scene(name="slope", nodes=[[0.0, 0.0], [0.0, 0.0], 3 * t], links=[[2, 1], [0, 1], [0, 1]],
                 law=[Law.BAR, Law.FRICTION, Law.TANGENT], stiffness=[k, 0.0, 0.0], direction=[[0.0, 0.0], n, t],
                 friction=[0.0, friction, 0.0], fixed=[[1, 1], [0, 0], [1, 1]],
                 load=[[0.0, 0.0], [0.0, -weight], [0.0, 0.0]])  # fmt: skip


def slope_solution(scene):
    """Let the block slide until the spring bears what friction does not."""
    n, t = scene.direction[1:]
    weight = -scene.load[1]
    rest = max(weight @ t - scene.friction[1] * weight @ n, 0.0)
    return np.array([[0.0, 0.0], -rest / scene.stiffness[0] * t, [0.0, 0.0]])


def tabulated(slope):
    """Make half of the bars of the girder harder or softer, `slope` times, from strains of 20 micrometres on."""
    scene, k, knee, far = girder(), 6.5e7, 2e-5, 1e-3
    end = k * (knee + slope * (far - knee))
    bars = np.flatnonzero(scene.law == Law.BAR)
    chosen = bars[np.random.default_rng(1).random(len(bars)) < 0.5]
    law, stiffness = scene.law.copy(), scene.stiffness.copy()
    law[~np.isin(np.arange(len(law)), bars)], law[chosen] = Law.CABLE, len(Law)
    stiffness[law == Law.CABLE], stiffness[chosen] = k, 0.0
    table = ([-far, -knee, knee, far], [-end, -k * knee, k * knee, end])
    return replace(scene, law=law, stiffness=stiffness, tables=[table])


# ---- the catalogue ---------------------------------------------------------------------------


def cases():
    """Return all cases, group by group."""
    return [*_links(), *_rows(), *_grains(), *_friction(), *_elastic(), *_none()]


def _few(count, **more):
    """Return the options for a structure of few links."""
    return options(snes_latin_subdomains=min(count, SUBDOMAINS), **more)


def _links():
    for half, where in ((False, "between bars"), (True, "in one half")):
        for power in (4, -4, 8, -8, 12, -12):
            # beside forces 1e12 times as large soft bars have four digits
            yield Case("rigid links", f"contrast 1e{power} {where} beside them",
                       lambda power=power, half=half: stiffened(10.0**power, half),
                       "right" if power < 12 else "either", options())  # fmt: skip
    for power in (-12, -6, -2, 2, 6, 12):
        yield Case("rigid links", f"girder, 1e{power} times the load", lambda power=power: (
            girder(load=10.0**power * girder().load)), options=options())  # fmt: skip
        yield Case("rigid links", f"net, 1e{power} times the load", lambda power=power: net(10.0**power),
                   options=options())  # fmt: skip
    yield Case("rigid links", "girder without load", lambda: girder(load=0.0 * girder().load), options=options())
    for name, make_scene in (("girder", girder), ("net", net)):
        many = len(make_scene().links)
        yield Case("rigid links", f"{name}, one subdomain", make_scene, options=options(snes_latin_subdomains=1))
        yield Case("rigid links", f"{name}, one link a subdomain", lambda make_scene=make_scene: dealt(make_scene()),
                   options=options(snes_latin_subdomains=many))  # fmt: skip
    yield Case("rigid links", "net, 4 ranks", net, options=options(), ranks=4)
    for law, what in ((Law.INEXTENSIBLE, "cable"), (Law.CONTACT, "contact")):
        for gap in (0.0, 1e-3, 1e-3 * (1 + 1e-9), 1e-3 * (1 - 1e-9), 1e-12, 1e12, -1e-4, -1e12):
            # displacements of 1e12 hide the load of 1 in the rounding of what links bear
            yield Case("rigid links", f"{what} at {gap:.10g} of a way of 1e-3", lambda law=law, gap=gap: against(
                law, gap), "right" if gap > -1e12 else "either", _few(2), solution=lambda scene, gap=gap: np.array(
                [[0.0], [np.sign(scene.load[1, 0]) * min(gap, 1e-3)], [0.0]]))  # fmt: skip
        for name, given in (("spring of 1e-12", {"k": 1e-12}), ("spring of 1e12", {"k": 1e12}),
                            ("load of 1e-12", {"load": 1e-12}), ("load of 1e12", {"load": 1e12})):  # fmt: skip
            # where the load is 1e12 times what stretches the spring to the gap the gap is lost beside tau / l
            least = {"spring of 1e-12", "load of 1e12"}
            yield Case("rigid links", f"{what}, {name}", lambda law=law, given=given: against(law, 5e-4, **given),
                       "either" if name in least else "right", _few(2))  # fmt: skip
        yield Case("rigid links", f"three {what}s for one", lambda law=law: against(law, 5e-4, copies=3),
                   options=_few(2))  # fmt: skip
        yield Case("rigid links", f"two {what}s, one tighter", lambda law=law: against(law, [1e-4, 2e-4], copies=2),
                   options=_few(2))  # fmt: skip


def _rows():
    gap = 0.01
    for law, what in ((Law.INEXTENSIBLE, "chain"), (Law.CONTACT, "stack")):
        for count in (10, 1000, 10000):
            yield Case("rows", f"{what} of {count:,}", lambda law=law, count=count: row(law, np.full(count, gap), 1.0),
                       options=options(snes_latin_subdomains=max(SUBDOMAINS, count // 100)),
                       solution=row_solution)  # fmt: skip
        for power in (-12, 12):
            yield Case("rows", f"{what}, 1e{power} times the weight", lambda law=law, power=power: row(
                law, np.full(100, gap), 10.0**power), options=options(), solution=row_solution)  # fmt: skip
            yield Case("rows", f"{what}, 1e{power} times the gaps", lambda law=law, power=power: row(
                law, np.full(20, gap * 10.0**power), 1.0), options=options(), solution=row_solution)  # fmt: skip
            yield Case("rows", f"{what}, every other gap 1e{power} times", lambda law=law, power=power: row(
                law, np.where(np.arange(20) % 2, gap, gap * 10.0**power), 1.0), options=options(),
                solution=row_solution)  # fmt: skip
        for power in (-12, -6, 3, 6, 12):  # the last node is a light one: it may never get to the one before it
            yield Case("rows", f"{what}, every other weight 1e{power} times", lambda law=law, power=power: row(
                law, np.full(20, gap), np.where(np.arange(20) % 2, 1.0, 10.0**power)),
                "right" if power < 6 else "either", options(), solution=row_solution)  # fmt: skip
        yield Case("rows", f"{what} without gaps", lambda law=law: row(law, np.zeros(20), 1.0), options=options(),
                   solution=at_rest)  # fmt: skip
        yield Case("rows", f"{what} without weight", lambda law=law: row(law, np.full(20, gap), 0.0),
                   options=options(), unique="nothing")  # fmt: skip
    for count in (10, 1000, 10000):
        for upside_down, what in ((False, "catenary"), (True, "arch")):
            yield Case("rows", f"{what} of {count:,}", lambda count=count, upside_down=upside_down: replace(
                make("chain", links=count, upside_down=upside_down), subdomain=None),
                options=options(snes_latin_subdomains=max(4, count // 50)), solution=at_rest)  # fmt: skip
    for pull in (1e-12, 1e-6, 1e3):  # the first moves it by less than its tensions let one see
        yield Case("rows", f"catenary, pulled by {pull:g} of its weight", lambda pull=pull: replace(
            make("chain", links=24, pull=pull), subdomain=None), "right" if pull == 1e-6 else "either",
            options(snes_latin_subdomains=3))  # fmt: skip


def _grains():
    tensions = {"solution": simplex, "unique": "tensions"}
    for name, given in (("1e-12 times the load", {"load": 1e-12}), ("1e12 times the load", {"load": 1e12}),
                        ("gaps 1e-12 of the size", {"gap": 1e-9}), ("gaps 1e-15 of the size", {"gap": 1e-12}),
                        ("gaps 1e6 times the size", {"gap": 1e9}), ("12 x 12", {"side": 12}),
                        ("spheres", {"side": 5, "dim": 3})):  # fmt: skip
        yield Case("grains", name, lambda given=given: packing(**given), options=options(), **tensions)
    yield Case("grains", "all touch", lambda: packing(disorder=0.0), options=options(), solution=at_rest)
    yield Case("grains", "all touch, tensions", lambda: packing(disorder=0.0), options=options(), unique="nothing")
    yield Case("grains", "one subdomain", packing, options=options(snes_latin_subdomains=1), **tensions)
    many = len(packing().links)
    yield Case("grains", "one contact a subdomain", lambda: dealt(packing()),
               options=options(snes_latin_subdomains=many), **tensions)  # fmt: skip
    yield Case("grains", "contacts dealt at random", lambda: dealt(packing(), SUBDOMAINS), options=options(),
               **tensions)  # fmt: skip
    yield Case("grains", "4 ranks", packing, options=options(), ranks=4, **tensions)


def _friction():
    for friction in (0.0, 1e-12, 0.3, 1.0, 1e6):
        for angle, what in ((0.0, "flat"), (0.2, "a slope"), (np.arctan(0.3), "a slope of 0.3"), (1.5, "steep")):
            yield Case("friction", f"block, coefficient {friction:g}, {what}",
                       lambda friction=friction, angle=angle: slope(friction, angle), options=_few(2),
                       solution=slope_solution)  # fmt: skip
    for k in (1e-12, 1e12):
        yield Case("friction", f"block, spring of {k:g}", lambda k=k: slope(0.3, 0.8, k), options=_few(2),
                   solution=slope_solution)  # fmt: skip
    for friction in (0.0, 1e-12, 0.3, 1.0, 1e6):  # for grains no theorem promises a solution
        yield Case("friction", f"grains, coefficient {friction:g}", lambda friction=friction: packing(
            5, law="friction", friction=friction), "right" if friction <= 1.0 else "either", options(),
            unique="nothing")  # fmt: skip
    for name, given in (("1e-12 times the load", {"load": 1e-12}), ("1e12 times the load", {"load": 1e12}),
                        ("gaps 1e-12 of the size", {"gap": 1e-9}), ("gaps 1e6 times the size", {"gap": 1e9}),
                        ("all touch", {"gap": 0.0}), ("spheres", {"side": 4, "dim": 3})):  # fmt: skip
        yield Case("friction", f"grains, {name}", lambda given=given: packing(**{"side": 5, **given}, law="friction"),
                   options=options(), unique="nothing")  # fmt: skip
    yield Case("friction", "grains, 3 ranks", lambda: packing(5, law="friction"), options=options(), ranks=3,
               unique="nothing")  # fmt: skip


def _elastic():
    for load, gap in ((0, -12), (-12, -15), (0, -4), (6, 2), (12, 9), (12, -12)):
        yield Case("elastic contacts", f"1e{load} times the load, 1e{gap} times the gaps",
                   lambda load=load, gap=gap: packing(6, 10.0**load, 10.0**gap, law="elastic"), options=options(),
                   unique="elongations")  # fmt: skip
    for load, gap in ((-6, 0), (-8, 0), (-6, 4), (-12, 0), (-24, 0)):
        yield Case("elastic contacts", f"1e{load} times the load, 1e{gap} times the gaps: as good as rigid",
                   lambda load=load, gap=gap: packing(6, 10.0**load, 10.0**gap, law="elastic"),
                   "right" if load - gap >= -8 else "either", options(), unique="closed")  # fmt: skip
    for power in (-12, -6, 6, 12):
        yield Case("elastic contacts", f"stack, every other weight 1e{power} times", lambda power=power: row(
            Law.COMPRESSION_ONLY, np.full(20, 0.01), np.where(np.arange(20) % 2, 1.0, 10.0**power)), options=options(),
            solution=row_solution)  # fmt: skip
    for power in (4, -4, 8, -8, 12, -12):
        yield Case("elastic contacts", f"grains, contrast 1e{power}", lambda power=power: packing(
            6, gap=1e-6, contrast=10.0**power, law="elastic"), "right" if abs(power) < 8 else "either", options(),
            unique="elongations")  # fmt: skip
    for factor in (1e-2, 1e-4, 1e-8, 1e2, 1e4, 1e8, 1e12):  # the last hides the loads in rounding
        yield Case("tables", f"girder, bars {factor:g} times as stiff from a knee on", lambda factor=factor: (
            tabulated(factor)), "right" if factor < 1e12 else "either", options())  # fmt: skip
    yield Case("tables", "girder, bars that yield", lambda: tabulated(0.0), "refused", options())


def _none():
    yield Case("no equilibrium", "grain pushed off a table", lambda: row(Law.CONTACT, np.full(5, 0.01), -1.0),
               "refused", _few(4))  # fmt: skip
    yield Case("no equilibrium", "chain pushed up", lambda: row(Law.INEXTENSIBLE, np.full(5, 0.01), -1.0), "refused",
               _few(4))  # fmt: skip
    for count in (1, 20):
        for load in (0.0, 1.0):
            yield Case("no equilibrium", f"{count} without room, load {load:g}", lambda count=count, load=load: (
                between(-1e-3, load, count)), "refused", _few(count))  # fmt: skip
            yield Case("no equilibrium", f"{count} with just room, load {load:g}", lambda count=count, load=load: (
                between(0.0, load, count)), options=_few(count), solution=at_rest)  # fmt: skip
    yield Case("no equilibrium", "too short for its contact", lambda: replace(
        against(Law.INEXTENSIBLE, 0.0, copies=2), law=[Law.BAR, Law.INEXTENSIBLE, Law.CONTACT],
        initial_elongation=[0.0, 0.1, -0.2]), "refused", _few(2))  # fmt: skip
