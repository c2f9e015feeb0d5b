"""The methods that are compared: ours, others of PETSc, interior points.

`METHODS` names them. Each is run by `latinpc.bench.peers.worker` in a process of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["DEFAULT", "LINEAR", "METHODS", "Method"]


@dataclass(frozen=True)
class Method:
    """A way to solve a scene.

    Parameters
    ----------
    about : str
        What it is, in one line.
    kind : {'latin', 'newton', 'qp', 'linear'}
        SNES latin, Newton's method of PETSc, an interior point method on the quadratic program, or a KSP on the
        stiffness of a structure of bars.
    options : dict
        PETSc options without the leading dash; the best ones known for structures with slackening cables.
    package : str
        What PETSc or Python must bring for it.
    rigid : bool
        Whether the preconditioner gets the rigid modes.
    matrix : str
        PETSc's type of the tangent.
    whole : bool
        Whether it leaves out the partition of the scene.
    """

    about: str
    kind: str
    options: dict = field(default_factory=dict)
    package: str = ""
    rigid: bool = False
    matrix: str = "aij"
    whole: bool = False


# Full steps: the energy is convex and its gradient piecewise linear, so they end in a few iterations; a step
# that makes links slack may raise the residual by orders before the next ones bring it down.
_NEWTON = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "none",
    "snes_divergence_tolerance": -1,
    "snes_max_it": 100,
}
_DIRECT = {**_NEWTON, "ksp_type": "preonly", "pc_type": "cholesky"}
# Ours of the orderings of PETSc: CHOLMOD's own one is of the graph of the unknowns, and takes longer than the factor
_CHOLMOD = {
    "pc_factor_mat_solver_type": "cholmod", "pc_factor_mat_ordering_type": "latin", "mat_cholmod_nmethods": 1,
}  # fmt: skip
# The tangent changes with the active set, so a rough linear solution is enough until it has settled
_CG = {**_NEWTON, "ksp_type": "cg", "ksp_rtol": 1e-2, "ksp_max_it": 3000}
_BDDC = {"pc_bddc_use_change_of_basis": 1, "pc_bddc_use_edges": 1, "pc_bddc_use_faces": 1}

METHODS = {
    "latin": Method("the default of SNES latin", "latin", {"snes_type": "latin"}),
    "latin-macro": Method("weak interfaces macro, section 4.2", "latin",
                          {"snes_type": "latin", "snes_latin_variant": "macro"}),
    "latin-rigid": Method("rigid macro fields and CHOLMOD for the coarse problem, options/large.opts", "latin", {
        "snes_type": "latin", "snes_latin_modes": "rigid", "snes_latin_coarse_pc_factor_mat_solver_type": "cholmod",
    }, "suitesparse"),
    "latin-one": Method("one subdomain, the method's trivial case", "latin", {
        "snes_type": "latin", "snes_latin_subdomains": 1,
    }, whole=True),
    "newton-cholmod": Method("Newton, CHOLMOD, METIS on the graph of the nodes", "newton", {
        **_DIRECT, **_CHOLMOD,
    }, "suitesparse"),
    "newton-mumps": Method("Newton, MUMPS with METIS", "newton", {
        **_DIRECT, "pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_7": 5,
    }, "mumps"),
    "newton-gamg": Method("Newton, conjugate gradients, GAMG with rigid modes, kept", "newton", {
        **_CG, "pc_type": "gamg", "pc_gamg_threshold": 0.02, "snes_lag_preconditioner": -2,
        "mat_no_inode": 1,
    }, rigid=True),
    "newton-hypre": Method("Newton, conjugate gradients, BoomerAMG", "newton", {
        **_CG, "pc_type": "hypre", "pc_hypre_type": "boomeramg", "pc_hypre_boomeramg_strong_threshold": 0.7,
        "pc_hypre_boomeramg_coarsen_type": "HMIS", "pc_hypre_boomeramg_interp_type": "ext+i",
        "pc_hypre_boomeramg_P_max": 4,
    }, "hypre"),
    "newton-bddc": Method("Newton, conjugate gradients, BDDC with one subdomain a rank", "newton", {
        **_CG, "pc_type": "bddc", "pc_bddc_use_faces": 1, "pc_bddc_use_edges": 1,
    }, rigid=True, matrix="is"),
    "newton-latin": Method("Newton, conjugate gradients, PC latin built once and kept", "newton", {
        **_CG, "pc_type": "latin", "snes_lag_preconditioner": -2,
    }),
    "piqp": Method("PIQP on the quadratic program", "qp", package="piqp"),
    "clarabel": Method("Clarabel on the quadratic program", "qp", package="clarabel"),
    "ksp-latin": Method("KSP latin", "linear", {"ksp_type": "latin"}),
    "cg-latin": Method("conjugate gradients, PC latin", "linear", {"ksp_type": "cg", "pc_type": "latin"}),
    "cg-bddc": Method("conjugate gradients, BDDC with one subdomain a rank", "linear", {
        "ksp_type": "cg", "pc_type": "bddc", **_BDDC,
    }, rigid=True, matrix="is"),
    "fetidp": Method("FETI-DP with one subdomain a rank", "linear", {
        "ksp_type": "fetidp", "fetidp_ksp_type": "cg", **{f"fetidp_bddc_{key}": _BDDC[key] for key in _BDDC},
    }, rigid=True, matrix="is"),
    "cg-gamg": Method("conjugate gradients, GAMG with rigid modes", "linear", {
        "ksp_type": "cg", "pc_type": "gamg", "pc_gamg_threshold": 0.02, "mat_no_inode": 1,
    }, rigid=True),
    "cg-hypre": Method("conjugate gradients, BoomerAMG", "linear", {
        "ksp_type": "cg", "pc_type": "hypre", "pc_hypre_type": "boomeramg",
        "pc_hypre_boomeramg_strong_threshold": 0.7, "pc_hypre_boomeramg_coarsen_type": "HMIS",
        "pc_hypre_boomeramg_interp_type": "ext+i", "pc_hypre_boomeramg_P_max": 4,
    }, "hypre"),
    "mumps": Method("MUMPS with METIS", "linear", {
        "ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_7": 5,
    }, "mumps"),
    "cholmod": Method("CHOLMOD, METIS on the graph of the nodes", "linear", {
        "ksp_type": "preonly", "pc_type": "cholesky", **_CHOLMOD,
    }, "suitesparse"),
}  # fmt: skip

#: Defaults of `latinpc compare`: LINEAR for scenes of bars, DEFAULT for others
LINEAR = tuple(name for name, method in METHODS.items() if method.kind == "linear")
DEFAULT = tuple(name for name in METHODS if name not in LINEAR)
