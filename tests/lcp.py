"""Linear complementarity and quadratic programs, solved by methods that have nothing in common with the plugin."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.optimize import linprog
from scipy.sparse.linalg import splu

from latinpc.peers.qp import Clarabel, kinematics
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
        row = int(np.argmin(ratio))
    raise RuntimeError("too many pivots")


def program(scene):
    """Displacements (n, dim) and tensions of the quadratic program, by Clarabel, then exactly for its active set."""
    solver = Clarabel(scene, 1e-9)
    x, _, _, status = solver.solve()
    assert "Solved" in status, status
    B, e_d = kinematics(scene)
    u = x[: B.shape[1]] * solver.program.length
    strain = B @ u + e_d + scene.prestrain
    sign = np.where(np.isin(scene.law, (Law.STRUT, Law.CONTACT)), -1.0, 1.0)
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
        right = scene.load[~scene.fixed] - B.T @ (k * (e_d + scene.prestrain))
        kkt = sparse.bmat([[K, A.T], [A, None]], format="csc")
        found = splu(kkt).solve(np.concatenate([right, -(e_d + scene.prestrain)[active]]))
        u, tension = found[: B.shape[1]], k * (B @ found[: B.shape[1]] + e_d + scene.prestrain)
        tension[active] = found[B.shape[1] :]
        strain = B @ u + e_d + scene.prestrain
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
    scale = np.abs(scene.prestrain).max() or 1.0
    found = linprog(
        -force / np.abs(force).max(), A_ub=-B, b_ub=(scene.prestrain + e_d) / scale, bounds=(None, None),
        method="highs-ds", options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )  # fmt: skip
    assert found.status == 0, found.message
    whole = scene.prescribed.copy()
    whole[~scene.fixed] = found.x * scale
    return whole, found.ineqlin.marginals * np.abs(force).max()
