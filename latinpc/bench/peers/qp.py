r"""The structure as a quadratic program, for interior point methods.

Bars, cables and compression-only links minimise (section 2.1, equations (2), (4), (5))

    sum_bars k/2 (e + e0)^2 + sum_cables k/2 max(e + e0, 0)^2 + sum_struts k/2 min(e + e0, 0)^2 - F . u

where e = B u + e_d. With one more unknown v for each cable or compression-only link, its taut elongation, that is

    minimise   sum_bars k/2 (e + e0)^2 + sum_others k/2 v^2 - F . u
    subject to v >= e + e0 in a cable, v <= e + e0 in compression:

at the minimum v = max(e + e0, 0), or min(e + e0, 0). (The form with a slack s >= 0 of each cable, k/2 (e + e0 + s)^2,
takes PIQP as long and Clarabel longer.) Inextensible cables and contacts store nothing: they are the constraints
e + e0 <= 0 and e + e0 >= 0 alone, and their tensions are the multipliers. Lengths are divided by a typical elongation
and energies by its square times the largest stiffness, for neither method likes 1e7 N/m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from latinpc.laws import RIGID, Law


@dataclass
class Program:
    """Minimise x.P x/2 + c.x with G x <= h; u is the first part of x, in units of `length`."""

    P: sparse.csc_matrix
    c: np.ndarray
    G: sparse.csc_matrix
    h: np.ndarray
    free: np.ndarray  #: (n, dim) bool
    length: float  #: m
    force: float  #: N, unit of the multipliers

    def displacements(self, scene, x):
        """Return the displacement of every node (m)."""
        whole = scene.prescribed.copy()
        whole[self.free] = x[: self.free.sum()] * self.length
        return whole


def kinematics(scene):
    """Return B (m, free dofs), sparse, and the elongations of the prescribed displacements (m)."""
    n, dim = scene.nodes.shape
    m = len(scene.links)
    free = ~scene.fixed
    number = np.full((n, dim), -1)
    number[free] = np.arange(free.sum())
    columns = number[scene.links].reshape(m, 2 * dim)
    values = np.hstack([-scene.directions, scene.directions])
    rows = np.repeat(np.arange(m), 2 * dim)
    keep = columns.ravel() >= 0
    B = sparse.csr_matrix((values.ravel()[keep], (rows[keep], columns.ravel()[keep])), shape=(m, free.sum()))
    moved = scene.prescribed[scene.links[:, 1]] - scene.prescribed[scene.links[:, 0]]
    return B, np.einsum("ij,ij->i", moved, scene.directions)


def program(scene):
    """Make the quadratic program of a scene.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Program
    """
    B, e_d = kinematics(scene)
    offset = scene.initial_elongation + e_d  # m
    rigid = np.isin(scene.law, RIGID)
    if np.isin(scene.law, (Law.FRICTION, Law.TANGENT)).any() or (scene.law >= len(Law)).any():
        raise ValueError(f"scene {scene.name!r} is no quadratic program: it has friction, or laws from tables")
    largest = scene.stiffness[~rigid].max() if not rigid.all() else np.abs(scene.load).max() / scene.lengths.mean()
    k = scene.stiffness / largest
    force = scene.load[~scene.fixed] / largest  # m
    length = max(np.abs(offset).max(), np.abs(force).max(initial=0.0)) or 1.0
    offset, force = offset / length, force / length
    bar = scene.law == Law.BAR
    sign = sparse.diags(np.where(np.isin(scene.law[~bar], (Law.COMPRESSION_ONLY, Law.CONTACT)), -1.0, 1.0))
    taut = sparse.eye(sign.shape[0], format="csc")[:, ~rigid[~bar]]  # v of the links that have one
    B_b, k_b = B[bar], k[bar]
    P = sparse.block_diag([B_b.T @ sparse.diags(k_b) @ B_b, sparse.diags(k[~bar & ~rigid])], format="csc")
    c = np.concatenate([B_b.T @ (k_b * offset[bar]) - force, np.zeros(taut.shape[1])])
    G = sparse.hstack([sign @ B[~bar], -sign @ taut], format="csc")
    return Program(P, c, G, -(sign @ offset[~bar]), ~scene.fixed, length, length * largest)


class Piqp:
    """PIQP with its own sparse factorisation."""

    def __init__(self, scene, tolerance):
        import piqp

        self.program = problem = program(scene)
        self.solver = solver = piqp.SparseSolver()
        solver.settings.eps_abs = tolerance
        solver.settings.eps_rel = 0.0
        solver.settings.check_duality_gap = False  # the two residuals bound the error; the gap's scale is another
        solver.settings.max_iter = 200
        G, h = (problem.G, problem.h) if len(problem.h) else (None, None)
        solver.setup(problem.P, problem.c, G=G, h_u=h)
        self.solved = piqp.PIQP_SOLVED

    def solve(self):
        """Return x, whether it is solved, the iterations and the reason."""
        status = self.solver.solve()
        result = self.solver.result
        return np.array(result.x), status == self.solved, result.info.iter, str(status).rsplit(".", 1)[-1]


class Clarabel:
    """Clarabel with its own sparse factorisation."""

    def __init__(self, scene, tolerance):
        import clarabel

        self.program = problem = program(scene)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = tolerance
        cones = [clarabel.NonnegativeConeT(len(problem.h))] if len(problem.h) else []
        P = sparse.triu(problem.P, format="csc")
        self.solver = clarabel.DefaultSolver(P, problem.c, problem.G, problem.h, cones, settings)

    def solve(self):
        """Return x, whether it is solved, the iterations and the reason."""
        solution = self.solver.solve()
        status = str(solution.status)
        return np.array(solution.x), status == "Solved", solution.iterations, status


SOLVERS = {"piqp": Piqp, "clarabel": Clarabel}
