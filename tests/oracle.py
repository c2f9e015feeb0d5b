"""The method written slowly: one short function a stage, numpy and scipy, one process.

The C code must agree with it to rounding. Equation numbers are those of the article. Unknowns are the free
dofs ``node * dim + component``; prescribed displacements enter as the elongations e_d that they cause.
"""

from __future__ import annotations

import contextlib
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from bases import LOCAL, affine_modes, macro_basis, orthonormal

FLOOR = 0.1  # least diagonal search direction of an interface, or stiffness of a foundation, relative to its mean
FOUNDATION = 0.01  # part of its diagonal added to the stiffness of a subdomain for a matrix direction
FRACTION = {"scalar": 0.08, "diagonal": 0.08, "block": 0.25, "schur": 1.0}  # self-tuned direction
OWNED = True  # do nodes of more than two subdomains serve an interface, see `macro_nodes`


# ---- the structure -----------------------------------------------------------------------------
def kinematics(scene):
    """B (m, n dim) with e = B U, and the elongations e_d of the prescribed displacements, (22)."""
    m, dim = len(scene.links), scene.dim
    rows = np.repeat(np.arange(m), 2 * dim)
    columns = (scene.links[:, :, None] * dim + np.arange(dim)).reshape(-1)
    values = np.stack([-scene.directions, scene.directions], axis=1).reshape(-1)
    b = sp.csr_matrix((values, (rows, columns)), shape=(m, scene.nodes.size))
    return b, b @ np.where(scene.fixed, scene.prescribed, 0.0).ravel()


def tension(scene, e):
    """Laws (2), (4) and their mirror image."""
    t = scene.stiffness * (e + scene.initial_elongation)
    return np.where(scene.law == 1, np.maximum(t, 0.0), np.where(scene.law == 2, np.minimum(t, 0.0), t))


def factor(matrix):
    """Solve of a sparse symmetric positive definite matrix, pivots on the diagonal."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return spla.splu(matrix.tocsc(), **options).solve


def newton(scene, rtol=1e-12, max_it=200):
    """Displacements (n, dim) by semismooth Newton with backtracking on the convex energy."""
    b, e_d = kinematics(scene)
    free = np.flatnonzero(~scene.fixed.ravel())
    b, load, k = b[:, free].tocsc(), scene.load.ravel()[free], scene.stiffness

    def energy(u):
        return np.sum(tension(scene, b @ u + e_d) ** 2 / (2 * k)) - load @ u

    def residual(u):
        return b.T @ tension(scene, b @ u + e_d) - load

    u, r = np.zeros(len(free)), residual(np.zeros(len(free)))
    floor = 1e-10 * k.mean()  # where slack links leave a mechanism the step stays finite
    scale = np.linalg.norm(load) + np.linalg.norm(abs(b).T @ abs(k * (scene.initial_elongation + e_d)))

    def stiffness(u):
        active = (scene.law == 0) | (tension(scene, b @ u + e_d) != 0.0)
        return b.T @ sp.diags(k * active) @ b

    for _ in range(max_it):
        if np.linalg.norm(r) <= rtol * scale:
            break
        step = factor(stiffness(u) + floor * sp.identity(len(free)))(-r)
        length, start = 1.0, energy(u)
        while energy(u + length * step) > start + 1e-4 * length * (r @ step) + 1e-13 * abs(start) and length > 1e-6:
            length /= 2
        u = u + length * step
        r = residual(u)
    with contextlib.suppress(RuntimeError):  # a mechanism; else steps without the floor, which hides soft modes
        for _ in range(3):
            step = factor(stiffness(u))(-r)
            terms = abs(b).T @ (k * (abs(b) @ abs(u + step)))  # large ones leave rounding in the residual
            if np.linalg.norm(residual(u + step)) > 2 * np.linalg.norm(r) + 1e-15 * (scale + np.linalg.norm(terms)):
                break
            u, r = u + step, residual(u + step)
    whole = np.where(scene.fixed, scene.prescribed, 0.0)
    whole[~scene.fixed] = u
    return whole


# ---- partition -> interfaces -> primal nodes, micro pairs --------------------------------------
def node_subdomains(scene):
    """Per node, the sorted subdomains that touch it: S(n)."""
    touching = [set() for _ in scene.nodes]
    for (a, b), part in zip(scene.links, scene.subdomain):
        touching[a].add(int(part))
        touching[b].add(int(part))
    return [tuple(sorted(parts)) for parts in touching]


def interfaces(scene, touching):
    """Per pair (E, E') the nodes shared by both that have a free dof."""
    shared = {}
    for node, parts in enumerate(touching):
        if not scene.fixed[node].all():
            for pair in combinations(parts, 2):
                shared.setdefault(pair, []).append(node)
    return dict(sorted(shared.items()))


def components(members, edges):
    """Connected components of at least two members."""
    label = {member: member for member in members}
    for a, b in edges:
        old, new = label[b], label[a]
        label = {member: new if value == old else value for member, value in label.items()}
    groups = [tuple(m for m in members if label[m] == value) for value in sorted(set(label.values()))]
    return [group for group in groups if len(group) > 1]


def primal_groups(parts, weak, variant):
    """Subdomains among which the node has one displacement: sections 4.2 (macro) and 4.4 (corner, published)."""
    if variant in ("corner", "published") and (weak or len(parts) > 2):
        return [parts]
    return components(parts, weak) if variant == "macro" else []


def micro_pairs(parts, weak, groups, variant):
    """Pairs of subdomains that exchange micro quantities at the node."""
    pairs = [pair for pair in combinations(parts, 2) if pair not in weak]
    if variant != "published":  # one displacement needs no springs
        pairs = [pair for pair in pairs if not any(set(pair) <= set(group) for group in groups)]
    if variant == "none":  # weak pairs implied by the strong ones are dropped, section 4
        joined = components(parts, [pair for pair in combinations(parts, 2) if pair not in weak])
        pairs += [pair for pair in weak if not any(set(pair) <= set(group) for group in joined)]
    return pairs


# ---- local low-energy fields -------------------------------------------------------------------
def local_modes(latin, threshold):
    """Fields of both sides of every interface: S v = lambda diag(d) v, S the stiffness of a subdomain at its interfaces
    with its primal dofs held, lambda < threshold.
    """
    dim = latin.scene.dim
    for i, part in enumerate(latin.parts):
        sides = [(side, side.pair.index(i)) for side in latin.sides if i in side.pair]
        spring = np.zeros(len(part.dofs))
        for side, which in sides:
            np.add.at(spring, side.local[which], side.d.diagonal())
        held = np.isin(part.dofs // dim, [n for n, g in latin.primal.items() if any(i in group for group in g)])
        b, r = np.flatnonzero(~held & (spring > 0)), np.flatnonzero(~held & (spring == 0))
        k, q = part.stiffness, np.sqrt(spring[b])
        s = k[np.ix_(b, b)] - k[np.ix_(b, r)] @ np.linalg.pinv(k[np.ix_(r, r)], 1e-10, True) @ k[np.ix_(r, b)]
        values, vectors = la.eigh(s / np.outer(q, q))
        modes = np.zeros((len(part.dofs), np.count_nonzero(values < threshold)))
        modes[b] = vectors[:, : modes.shape[1]] / q[:, None]
        for side, which in sides:
            u, size, _ = np.linalg.svd(
                np.sqrt(side.d.diagonal())[:, None] * modes[side.local[which]], full_matrices=False
            )
            side.fields = np.hstack([side.fields, (u * size)[:, size > LOCAL]])


# ---- set-up ------------------------------------------------------------------------------------
def build(scene, variant="corner", direction="schur", value=0.0, owned=OWNED, modes=affine_modes, local=0.0):
    """Everything that is built once: interfaces, subdomain operators, coarse factor.

    direction: a fraction of the mean of the neighbours' stiffness: its mean diagonal, its diagonal, its block, or its
    Schur complement. value: d of the scalar direction (N/m), of the others the fraction (0: `FRACTION`). `owned`: see
    `macro_nodes`. modes: `affine_modes` or `rigid_modes`. local: see `local_modes`.
    """
    b, e_d = kinematics(scene)
    latin = SimpleNamespace(scene=scene, e_d=e_d, free=~scene.fixed.ravel())
    latin.parts = [subdomain(scene, b, i, latin.free) for i in range(scene.n_subdomains)]
    latin.touching = node_subdomains(scene)
    latin.shared = interfaces(scene, latin.touching)
    latin.modes = {pair: modes(scene, nodes) for pair, nodes in latin.shared.items()}
    latin.primal, latin.micro = {}, {pair: [] for pair in latin.shared}
    for node in sorted({node for nodes in latin.shared.values() for node in nodes}):
        parts = latin.touching[node]
        weak = [pair for pair in combinations(parts, 2) if latin.modes[pair] is None]
        latin.primal[node] = primal_groups(parts, weak, variant)
        for pair in micro_pairs(parts, weak, latin.primal[node], variant):
            latin.micro[pair].append(node)
    latin.sides = [interface_side(latin, pair) for pair, nodes in latin.micro.items() if nodes]
    directions(latin, direction, value)
    if local:
        local_modes(latin, local)
    latin.n_z = number_macro(latin, owned)
    latin.n_macro = sum(side.r.shape[1] for side in latin.sides)
    latin.n_coarse = number_primal(latin)
    latin.copies = np.zeros(scene.nodes.size)
    for part in latin.parts:
        latin.copies[part.dofs] += 1
    for i, part in enumerate(latin.parts):
        part.load = scene.load.ravel()[part.dofs] / latin.copies[part.dofs]
        condense(part, [(side, side.pair.index(i)) for side in latin.sides if i in side.pair])
    latin.nonsmooth = np.flatnonzero((scene.law != 0) & ~scene.fixed[scene.links].all(axis=(1, 2)))
    latin.coarse = assemble(latin)
    return latin


def free_dofs(latin, nodes):
    """Free dofs of the nodes, in their order."""
    dofs = (np.array(nodes, int)[:, None] * latin.scene.dim + np.arange(latin.scene.dim)).ravel()
    return dofs[latin.free[dofs]]


def interface_side(latin, pair):
    """The micro dofs of an interface, and the diagonal of B^t k B there, mean of both sides."""
    side = SimpleNamespace(pair=pair, dofs=free_dofs(latin, latin.micro[pair]))
    side.local = [np.searchsorted(latin.parts[i].dofs, side.dofs) for i in pair]
    side.fields = np.zeros((len(side.dofs), 0))
    side.mean = sum(latin.parts[i].stiffness.diagonal()[at] for i, at in zip(pair, side.local)) / 2
    return side


def directions(latin, direction, value):
    """The search direction of every interface, a matrix `d` (27); a spring must be there whatever the links."""
    alpha = value or FRACTION[direction]
    for side in latin.sides:
        mean = side.mean.mean() or np.concatenate([other.mean for other in latin.sides]).mean() or 1.0
        if direction == "scalar":
            side.d = (value or alpha * mean) * np.eye(len(side.dofs))
        elif direction == "diagonal":
            side.d = alpha * np.diag(np.maximum(side.mean, FLOOR * mean))
        else:
            both = [seen(latin.parts[i], at, direction) for i, at in zip(side.pair, side.local)]
            side.d = alpha * (both[0] + both[1]) / 2


def seen(part, at, direction):
    """Stiffness of a subdomain, on an elastic foundation, at some of its dofs: its block or its Schur complement."""
    diagonal = part.stiffness.diagonal()
    k = part.stiffness + FOUNDATION * np.diag(np.maximum(diagonal, FLOOR * diagonal.mean()))
    return np.linalg.inv(np.linalg.inv(k)[np.ix_(at, at)]) if direction == "schur" else k[np.ix_(at, at)]


def number_macro(latin, owned):
    """Macro basis, its unknowns and the places in z of every interface; returns the length of z."""
    n_z, n_macro = 0, 0
    for side in latin.sides:
        nodes, modes = latin.micro[side.pair], latin.modes[side.pair]
        side.r = np.zeros((len(side.dofs), 0))
        if modes is not None:  # strong
            rows = np.searchsorted(latin.shared[side.pair], nodes)
            size, width = latin.scene.dim, modes.shape[1]
            modes = modes.reshape(len(modes) // size, size * width)[rows].reshape(len(rows) * size, width)
            dofs = (np.array(nodes)[:, None] * latin.scene.dim + np.arange(latin.scene.dim)).ravel()
            visible = np.isin(side.dofs // latin.scene.dim, macro_nodes(latin, side.pair, owned))
            fields = macro_basis(modes[latin.free[dofs]], side.d.diagonal(), visible, side.fields)
            side.r = orthonormal(fields, side.d)
        n, m = side.r.shape
        side.z = [slice(n_z, n_z + n), slice(n_z + n, n_z + 2 * n)]
        side.macro = np.arange(n_macro, n_macro + m)
        n_z, n_macro = n_z + 2 * n, n_macro + m
    return n_z


def macro_nodes(latin, pair, owned):
    """Nodes on which the macro modes of an interface must be visible; no node serves two interfaces.

    Those of its two subdomains alone; with `owned`, a node of more subdomains serves the thinnest of its
    interfaces too. Taking the interfaces of a subdomain from the last (thickest) to the first shows that its
    rows A are independent: what is owned by one is touched by thicker ones only.
    """
    candidates = [node for node in latin.micro[pair] if not latin.primal[node]]
    if not owned:
        return [node for node in candidates if len(latin.touching[node]) == 2]

    def thinnest(node):
        pairs = [
            other
            for other in combinations(latin.touching[node], 2)
            if latin.modes[other] is not None and node in latin.micro[other]
        ]
        return pairs and min(pairs, key=lambda other: (len(latin.micro[other]), other))

    return [node for node in candidates if thinnest(node) == pair]


def number_primal(latin):
    """One coarse unknown per free component of a primal node; returns the size of the coarse problem."""
    n = latin.n_macro
    for node, groups in latin.primal.items():
        for group in groups:
            dofs = free_dofs(latin, [node])
            for i in group:
                latin.parts[i].coarse_of_dof.update(zip(dofs, range(n, n + len(dofs))))
            n += len(dofs)
    return n


def subdomain(scene, b, i, free):
    """Links, free dofs, B and B^t k B of subdomain i."""
    links = np.flatnonzero(scene.subdomain == i)
    nodes = np.unique(scene.links[links])
    dofs = (nodes[:, None] * scene.dim + np.arange(scene.dim)).ravel()
    part = SimpleNamespace(links=links, dofs=dofs[free[dofs]], coarse_of_dof={})
    part.b = b[links][:, part.dofs].toarray()
    part.stiffness = part.b.T @ (scene.stiffness[links][:, None] * part.b)
    return part


def condense(part, sides):
    """Operators of the linear stage: K_E (28), its factor, H (29), (51)."""
    n = len(part.dofs)
    k = part.stiffness.copy()
    for side, which in sides:
        at = side.local[which]
        k[np.ix_(at, at)] += side.d
    a = np.zeros((sum(len(side.macro) for side, _ in sides), n))
    row = 0
    for side, which in sides:
        a[row : row + len(side.macro), side.local[which]] = (side.d @ side.r).T
        row += len(side.macro)
    is_primal = np.isin(part.dofs, list(part.coarse_of_dof))
    part.r, part.c = np.flatnonzero(~is_primal), np.flatnonzero(is_primal)
    macro = np.concatenate([side.macro for side, _ in sides] + [np.zeros(0, int)]).astype(int)
    part.n_macro, a_r = len(macro), a[:, part.r]
    part.coarse = np.concatenate([macro, [part.coarse_of_dof[dof] for dof in part.dofs[part.c]]]).astype(int)
    part.factor = la.cho_factor(k[np.ix_(part.r, part.r)]) if len(part.r) else None
    part.v_m, part.v_c = solve(part, a_r.T), solve(part, k[np.ix_(part.r, part.c)])
    part.k_rc, part.a_r = k[np.ix_(part.r, part.c)], a_r
    part.n = a[:, part.c] - a_r @ part.v_c
    part.t_inv = np.linalg.inv(a_r @ part.v_m)
    tn = part.t_inv @ part.n
    corner = k[np.ix_(part.c, part.c)] - part.k_rc.T @ part.v_c + part.n.T @ tn
    part.h = np.block([[part.t_inv - np.eye(len(a)), -tn], [-tn.T, corner]])


def solve(part, rhs):
    """K_rr^-1 times a vector or the columns of a matrix."""
    return la.cho_solve(part.factor, rhs) if len(part.r) and rhs.size else np.zeros(rhs.shape)


def assemble(latin):
    """Factor of the coarse problem (30), (52); None without coarse unknowns."""
    rows = [np.repeat(p.coarse, len(p.coarse)) for p in latin.parts]
    columns = [np.tile(p.coarse, len(p.coarse)) for p in latin.parts]
    values = np.concatenate([p.h.ravel() for p in latin.parts])
    shape = (latin.n_coarse, latin.n_coarse)
    h = sp.csc_matrix((values, (np.concatenate(rows), np.concatenate(columns))), shape=shape)
    return factor(h) if latin.n_coarse else None


# ---- the iteration -----------------------------------------------------------------------------
def start(latin):
    """z = 0 and s = k e0."""
    links = latin.nonsmooth
    return np.concatenate([np.zeros(latin.n_z), (latin.scene.stiffness * latin.scene.initial_elongation)[links]])


def linear_stage(latin, x):
    """Displacements of every subdomain, (26) to (30) and (42) to (52)."""
    scene = latin.scene
    s = scene.stiffness * scene.initial_elongation
    s[latin.nonsmooth] = x[latin.n_z :]
    forces = [p.load - p.b.T @ (s + scene.stiffness * latin.e_d)[p.links] for p in latin.parts]
    for side in latin.sides:
        for i, at, z in zip(side.pair, side.local, side.z):
            forces[i][at] += x[z]
    rhs = np.zeros(latin.n_coarse)
    for p, g in zip(latin.parts, forces):
        m = p.t_inv @ (p.v_m.T @ g[p.r])
        np.add.at(rhs, p.coarse, np.concatenate([m, g[p.c] - p.v_c.T @ g[p.r] - p.n.T @ m]))
    u_coarse = latin.coarse(rhs) if latin.n_coarse else rhs
    result = []
    for p, g in zip(latin.parts, forces):
        u_m, u_c = u_coarse[p.coarse[: p.n_macro]], u_coarse[p.coarse[p.n_macro :]]
        multiplier = p.t_inv @ (u_m - p.n @ u_c - p.v_m.T @ g[p.r])
        u = np.zeros(len(p.dofs))
        u[p.c], u[p.r] = u_c, solve(p, g[p.r] - p.k_rc @ u_c + p.a_r.T @ multiplier)
        result.append(u)
    return result


def local_stage(latin, x, u):
    """New state: each side receives the micro part of 2 d U - z of its mate; links meet their law."""
    scene, new = latin.scene, np.empty_like(x)
    for side in latin.sides:
        sent = []
        for i, at, z in zip(side.pair, side.local, side.z):
            y = 2 * side.d @ u[i][at] - x[z]
            sent.append(y - side.d @ (side.r @ (side.r.T @ y)))
        new[side.z[0]], new[side.z[1]] = sent[1], sent[0]
    links = latin.nonsmooth
    k, ke0 = scene.stiffness[links], (scene.stiffness * scene.initial_elongation)[links]
    y = x[latin.n_z :] + 2 * k * elongations(latin, u)[links]
    taut = np.where(scene.law[links] == 1, y + ke0 > 0, y + ke0 < 0)
    new[latin.n_z :] = np.where(taut, ke0, -y)
    return new


def elongations(latin, u):
    """e of every link, in its own subdomain."""
    e = latin.e_d.copy()
    for part, displacement in zip(latin.parts, u):
        e[part.links] += part.b @ displacement
    return e


def average(latin, u):
    """Displacement of the structure (n, dim): mean of the copies."""
    total = np.zeros(latin.scene.nodes.size)
    for part, displacement in zip(latin.parts, u):
        total[part.dofs] += displacement / latin.copies[part.dofs]
    return np.where(latin.scene.fixed, latin.scene.prescribed, total.reshape(latin.scene.nodes.shape))


def indicator(latin, x, new, u):
    """Distance between the two stages, relative to the energy of the elongations that carry tension."""
    k, dx = latin.scene.stiffness.copy(), new - x
    distance = np.sum(dx[latin.n_z :] ** 2 / (4 * k[latin.nonsmooth]))
    distance += sum(dx[z] @ np.linalg.solve(4 * side.d, dx[z]) for side in latin.sides for z in side.z)
    e = np.abs(elongations(latin, u))
    taut, nonsmooth = e.copy(), latin.nonsmooth
    taut[nonsmooth] = np.minimum(e, np.abs(elongations(latin, u) + latin.scene.initial_elongation))[nonsmooth]
    taut[nonsmooth[new[latin.n_z :] != (k * latin.scene.initial_elongation)[nonsmooth]]] = 0.0  # slack
    energy = np.sum(k * e * taut)
    return np.sqrt(distance / energy) if energy else np.sqrt(distance)


def errors(latin, u, reference):
    """Relative errors: l2 over the dofs of all subdomains, prescribed ones too, and energy over the links."""
    whole = np.asarray(reference, float).ravel()
    ref = [whole[p.dofs] for p in latin.parts]
    copies = np.bincount(np.concatenate([np.unique(latin.scene.links[p.links]) for p in latin.parts]))
    norm = np.sum(np.repeat(copies, latin.scene.dim) * whole**2)
    difference = sum(np.sum((a - b) ** 2) for a, b in zip(u, ref))
    e_ref, k = elongations(latin, ref), latin.scene.stiffness
    return np.sqrt(difference / norm), np.sqrt(np.sum(k * (elongations(latin, u) - e_ref) ** 2) / np.sum(k * e_ref**2))


def plain(x, g, _memory):
    """Next iterate of the article's method."""
    return g


def anderson(depth=10):
    """Next iterate of Anderson's acceleration: the combination of the last `depth` + 1 with least F = x - G(x)."""

    def next_iterate(x, g, memory):
        memory.append((g - x, g))
        del memory[: -depth - 1]
        if len(memory) == 1:
            return g
        df = np.stack([f - memory[-1][0] for f, _ in memory[:-1]], axis=1)
        dg = np.stack([h - g for _, h in memory[:-1]], axis=1)
        return g + dg @ np.linalg.lstsq(df, x - g, rcond=1e-14)[0]

    return next_iterate


def latin_history(scene, iterations=50, reference=None, outer=plain, target=None, **options):
    """Run the method: indicator and errors per iteration, averaged displacements per iteration.

    `target` stops at that l2 error; `options` are those of `build`.
    """
    latin = options.pop("latin", None) or build(scene, **options)
    x, memory, history = start(latin), [], SimpleNamespace(indicator=[], error_l2=[], error_energy=[], iterates=[])
    for _ in range(iterations):
        u = linear_stage(latin, x)
        g = local_stage(latin, x, u)
        history.indicator.append(indicator(latin, x, g, u))
        history.iterates.append(average(latin, u))
        if reference is not None:
            for name, value in zip(("error_l2", "error_energy"), errors(latin, u, reference)):
                getattr(history, name).append(value)
            if target is not None and history.error_l2[-1] <= target:
                break
        x = outer(x, g, memory)
    history.latin, history.x = latin, x
    return history
