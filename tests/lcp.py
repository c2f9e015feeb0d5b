"""Linear complementarity and quadratic programs, solved by methods that have nothing in common with the plugin."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy import sparse
from scipy.optimize import linprog, nnls
from scipy.sparse.linalg import splu

from latinpc.bench.peers.qp import Clarabel, kinematics
from latinpc.scenes import Law


def lemke(M, q, steps=5000):
    """Solve 0 <= z, w = M z + q >= 0, z.w = 0 by Lemke's complementary pivots, for M positive semidefinite."""
    n = len(q)
    if (q >= 0).all():
        return np.zeros(n), q
    tableau = np.hstack([np.eye(n), -M, -np.ones((n, 1)), q[:, None]])  # w, z, the artificial variable, right side
    basis, entering = np.arange(n), 2 * n
    row = int(np.argmin(q))
    for _ in range(steps):
        tableau[row] /= tableau[row, entering]
        others = np.arange(n) != row
        tableau[others] -= np.outer(tableau[others, entering], tableau[row])
        leaving, basis[row] = basis[row], entering
        if leaving == 2 * n:
            z = np.zeros(2 * n + 1)
            z[basis] = tableau[:, -1]
            return z[n : 2 * n], z[:n]
        entering = leaving + n if leaving < n else leaving - n
        column = tableau[:, entering]
        ratio = np.full(n, np.inf)
        ratio[column > 1e-11] = tableau[column > 1e-11, -1] / column[column > 1e-11]
        if not np.isfinite(ratio).any():
            raise RuntimeError("the complementarity problem has no solution")
        tied = np.flatnonzero(ratio <= ratio.min() * (1 + 1e-12) + 1e-15)
        if len(tied) > 1:  # the least row in lexicographic order: no cycles where many contacts close at once
            tied = tied[np.lexsort(np.round(tableau[tied, :n] / column[tied, None], 9).T[::-1])]
        row = int(tied[0])
    raise RuntimeError("too many pivots")


def nonnegative(M, q):
    """Solve the same, for -q in the range of M, as least squares: many contacts that close at once make no ties."""
    value, vector = np.linalg.eigh(M)
    kept = value > 1e-13 * value[-1]
    root = np.sqrt(value[kept])[:, None] * vector[:, kept].T  # M = root^T root
    return nnls(root, -(vector[:, kept].T @ q) / np.sqrt(value[kept]), maxiter=100 * len(q))[0]


def program(scene):
    """Displacements (n, dim) and tensions of the quadratic program, by Clarabel, then exactly for its active set."""
    solver = Clarabel(scene, 1e-9)
    x, _, _, status = solver.solve()
    assert "Solved" in status, status
    B, e_d = kinematics(scene)
    u = x[: B.shape[1]] * solver.program.length
    strain = B @ u + e_d + scene.initial_elongation
    sign = np.where(np.isin(scene.law, (Law.COMPRESSION_ONLY, Law.CONTACT)), -1.0, 1.0)
    rigid = np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT))
    multiplier = np.zeros(len(sign))
    multiplier[scene.law != Law.BAR] = np.array(solver.solver.solve().z) * solver.program.force
    small = 1e-6 * np.abs(strain).max()
    for _ in range(20):  # the active set, settled by its own signs
        taut = (scene.law == Law.BAR) | (~rigid & (sign * strain > 0))
        active = np.flatnonzero(rigid & (sign * strain > -small) & (multiplier > 0))
        k = np.where(taut, scene.stiffness, 0.0)
        k[rigid] = 0.0
        K, A = B.T @ sparse.diags(k) @ B, B[active]
        right = scene.load[~scene.fixed] - B.T @ (k * (e_d + scene.initial_elongation))
        kkt = sparse.bmat([[K, A.T], [A, None]], format="csc")
        found = splu(kkt).solve(np.concatenate([right, -(e_d + scene.initial_elongation)[active]]))
        u, tension = found[: B.shape[1]], k * (B @ found[: B.shape[1]] + e_d + scene.initial_elongation)
        tension[active] = found[B.shape[1] :]
        strain = B @ u + e_d + scene.initial_elongation
        multiplier = np.where(rigid, sign * tension, multiplier)
        multiplier[rigid & (sign * strain > small)] = 1.0
        if (sign[active] * tension[active] >= 0).all() and (sign * strain)[rigid].max(initial=0.0) <= small:
            whole = scene.prescribed.copy()
            whole[~scene.fixed] = u
            return whole, tension
    raise RuntimeError("the active set does not settle")


def linear_program(scene):
    """Displacements and tensions where nothing is elastic: min -F.u under e + e0 >= 0, by the simplex method."""
    B, e_d = kinematics(scene)
    force = scene.load[~scene.fixed]
    scale = np.abs(scene.initial_elongation).max() or 1.0
    found = linprog(
        -force / np.abs(force).max(), A_ub=-B, b_ub=(scene.initial_elongation + e_d) / scale, bounds=(None, None),
        method="highs-ds", options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )  # fmt: skip
    assert found.status == 0, found.message
    whole = scene.prescribed.copy()
    whole[~scene.fixed] = found.x * scale
    return whole, found.ineqlin.marginals * np.abs(force).max()


def tensegrity(scene):
    """Which links are cables, their corrected lengths and tensions: (18), (19)."""
    B, _ = kinematics(scene)
    cable, k = scene.law == Law.CABLE, scene.stiffness
    K = (B.T @ sparse.diags(k) @ B).toarray()
    Bc, kc = B[cable].toarray(), k[cable]
    tau0 = (k * scene.initial_elongation)[cable]
    A = np.diag(kc) - kc[:, None] * (Bc @ np.linalg.solve(K, Bc.T)) * kc  # (19)
    scale, force = kc.max(), np.abs(tau0).max()
    d = -kc * (Bc @ np.linalg.solve(K, scene.load[~scene.fixed])) - tau0  # the right side of (18)
    length, tension = lemke(A / scale, -d / force)
    return cable, length * force / scale, tension * force


def step(scene, h):
    """One step of length h from the scene's velocities and no displacement: (16), (17), with extensible cables (20)."""
    B, e_d = kinematics(scene)
    B, free = B.toarray(), ~scene.fixed
    mass = np.broadcast_to(scene.mass[:, None], scene.nodes.shape)[free]
    sign = np.where(
        np.isin(scene.law, (Law.COMPRESSION_ONLY, Law.CONTACT)), -1.0, 1.0
    )  # contacts push where cables pull
    bar, rigid = scene.law == Law.BAR, np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT))
    B, strain = sign[:, None] * B, sign * (e_d + scene.initial_elongation)
    W = B @ (B / mass).T
    soft = np.zeros(len(bar))
    soft[~rigid] = 1.0 / (h * h * scene.stiffness[~rigid])
    start = h * (B @ (scene.load[free] / mass)) - (-B @ scene.velocity[free])  # h F - eta-
    strain = np.where(rigid, np.minimum(strain, 0.0), strain) / h  # rigid links: no further than they are
    c, b = np.flatnonzero(~bar), np.flatnonzero(bar)
    tilde, right = W[np.ix_(c, c)] + np.diag(soft[c]), start[c] + strain[c]
    if len(b):
        inverse = np.linalg.inv(W[np.ix_(b, b)] + np.diag(soft[b]))
        tilde = tilde - W[np.ix_(c, b)] @ inverse @ W[np.ix_(b, c)]
        right = right - W[np.ix_(c, b)] @ inverse @ (start[b] + strain[b])
    pi = nonnegative(tilde / tilde.max(), -right / np.abs(right).max())
    pi *= np.abs(right).max() / tilde.max()
    whole = np.zeros(len(bar))
    whole[c] = pi
    if len(b):
        whole[b] = inverse @ (start[b] + strain[b] - W[np.ix_(b, c)] @ pi)
    velocity = scene.velocity[free] + (h * scene.load[free] - B.T @ whole) / mass
    value = np.linalg.eigvalsh(tilde)
    return SimpleNamespace(
        velocity=velocity,
        impulse=sign[c] * pi,
        unilateral=c,
        regular=value[0] > 1e-10 * value[-1],
        rate=tilde @ pi - right,
    )
