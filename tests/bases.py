"""Macro bases of interfaces, section 3.2, for the oracle: affine fields, rigid motions, what of them is visible."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import scipy.linalg as la

RANK = 1e-6  # relative size below which a direction does not count
VISIBLE = 1e-3  # share of a macro mode that must lie on the nodes that are assigned to its interface
LOCAL = 0.1  # share of a local low-energy field that must be outside the macro basis


def affine_modes(scene, nodes):
    """Macro modes of an interface, (len * dim, modes), in centred and scaled coordinates; None if it is weak.

    dim x (1, xi, eta) over the principal plane, and where the nodes leave it zeta e_xi, zeta e_eta, without
    which the rotations of the interface were not among them.
    """
    dim, x = scene.dim, scene.nodes[nodes] - scene.nodes[nodes].mean(axis=0)
    if dim == 1:
        return np.ones((len(nodes), 1))
    if len(nodes) < dim:
        return None
    u, s, axes = np.linalg.svd(x, full_matrices=False)
    if not (s[0] > RANK * scene.lengths.max() and s[dim - 2] > RANK * s[0]):
        return None
    modes = np.kron(np.column_stack([np.ones(len(nodes)), u[:, : dim - 1]]), np.eye(dim))
    if s[dim - 1] <= RANK * s[0]:
        return modes
    return np.hstack([modes] + [np.kron(u[:, dim - 1], axes[k])[:, None] for k in range(dim - 1)])


def rigid_modes(scene, nodes):
    """Translations and rotations of an interface, (len * dim, modes); None if it is weak."""
    if affine_modes(scene, nodes) is None:
        return None
    x = scene.nodes[nodes] - scene.nodes[nodes].mean(axis=0)
    x, axes = x / np.abs(x).max(initial=1e-300), np.eye(scene.dim)
    spins = [np.outer(x[:, a], axes[b]) - np.outer(x[:, b], axes[a]) for a, b in combinations(range(scene.dim), 2)]
    return np.column_stack([np.tile(axes, (len(nodes), 1))] + [spin.ravel() for spin in spins])


def macro_basis(modes, d, assigned, local):
    """R with R^t D R = 1: the affine fields that are visible on the dofs assigned to the interface.

    `local`: low-energy fields, weighted by sqrt(d), that complete them.

    Fields that live on the other dofs alone may coincide on two interfaces of a subdomain; without them the
    rows A of a subdomain are independent by construction. Orthonormal fields first, so that the result does
    not depend on how the modes are scaled.
    """
    u, s, _ = np.linalg.svd(np.sqrt(d)[:, None] * modes, full_matrices=False)
    fields = u[:, s > RANK * s[:1]]
    if local.shape[1]:
        u, s, _ = np.linalg.svd(local - fields @ (fields.T @ local), full_matrices=False)
        fields = np.hstack([fields, u[:, s > LOCAL]])
    _, visible, v = np.linalg.svd(fields[assigned], full_matrices=False)
    return fields @ v[visible > VISIBLE].T / np.sqrt(d)[:, None]


def orthonormal(r, d):
    """Columns of the same span with R^t D R = 1."""
    return la.solve_triangular(la.cholesky(r.T @ d @ r, lower=True), r.T, lower=True).T if r.size else r
