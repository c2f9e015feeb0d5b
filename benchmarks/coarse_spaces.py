"""Coarse spaces side by side: macro fields as in the article, with and without corners (section 4).

    python benchmarks/coarse_spaces.py            renews results/coarse-spaces.json, fills in coarse-spaces.md
    mpirun -n 16 python benchmarks/coarse_spaces.py --peers truss-grid 16      a row of BDDC and of FETI-DP alone

Iterations to a relative energy error of 1e-8 of KSP latin and of conjugate gradients with PC latin, the same matrices.
"""

import argparse
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import petsc4py

if __name__ == "__main__":
    petsc4py.init([sys.argv[0], "-skip_petscrc"])

from petsc4py import PETSc

import latinpc
from latinpc.options import default_options
from latinpc.scenes import make

HERE = Path(__file__).resolve().parent
RESULT, PAGE = HERE / "results" / "coarse-spaces.json", HERE / "coarse-spaces.md"
ACCURACY, MOST = 1e-8, 300

#: What the coarse problem has of strong interfaces, and of weak ones: modes, variant.
SPACES = {
    "macro only, 4.1": ("affine", "none"),
    "macro, weak interfaces macro, 4.2": ("affine", "macro"),
    "both, 4.4": ("affine", "corner"),
    "both, rigid fields": ("rigid", "corner"),
}
SUBDOMAINS = (16, 64, 144, 400)


def scene_of(name, subdomains):
    """Make a linear structure with so many subdomains, 4 x 4 modules or 4 x 4 cells each."""
    side = round(subdomains**0.5)
    if name == "lattice":
        scene = make("lattice", nx=4 * side, ny=4 * side, subdomains=subdomains)
        scene.law[:] = 0
        return scene
    if name == "truss-grid metis":
        return make("truss-grid", modules=4 * side, partition="metis")
    return make("truss-grid", modules=4 * side, subdomains=subdomains)


SCENES = ("truss-grid", "truss-grid metis", "lattice")


class System:
    """Matrix, load and solution of a structure of bars."""

    def __init__(self, scene):
        self.structure = latinpc.Structure.from_scene(scene)
        self.matrix, u, self.b = self.structure.dm.createMat(), self.structure.create_vec(), self.structure.create_vec()
        self.structure.jacobian(u, self.matrix)
        self.structure.residual(u, self.b)
        self.b.scale(-1.0)
        self.exact = solution(self.matrix, self.b)

    def count(self, ksp_type, subdomains, modes, variant):
        """Iterations to the accuracy and size of the coarse problem; None where it is not reached."""
        family = "ksp" if ksp_type == "latin" else "pc"
        ksp = PETSc.KSP().create()
        ksp.setOperators(self.matrix)
        ksp.setType(ksp_type)
        if family == "pc":
            ksp.getPC().setType("latin")
        ksp.setFromOptions()
        latin = ksp if family == "ksp" else ksp.getPC()
        latinpc.set_variant(latin, variant)
        latinpc.set_modes(latin, modes)
        latinpc.set_subdomains(latin, subdomains)
        errors = watch(ksp, self.matrix, self.exact, stop=True)
        ksp.setTolerances(max_it=MOST)
        ksp.solve(self.b, self.b.duplicate())
        size = latinpc.statistics(latin)
        iterations = len(errors) - 1 if errors[-1] <= ACCURACY else None
        ksp.destroy()
        return iterations, size["strong_macro_dofs"] + size["weak_dofs"]


def solution(matrix, b):
    """Solve with a direct solver."""
    ksp, x = PETSc.KSP().create(matrix.comm), b.duplicate()
    ksp.setOptionsPrefix("exact_")
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("mumps")
    ksp.solve(b, x)
    ksp.destroy()
    return x


def watch(ksp, matrix, exact, stop):
    """Collect the relative energy error of each iterate; stop at the accuracy."""
    errors, product = [], exact.duplicate()
    matrix.mult(exact, product)
    scale = np.sqrt(exact.dot(product))

    def error(ksp):
        difference = ksp.buildSolution() - exact
        matrix.mult(difference, product)
        errors.append(np.sqrt(max(difference.dot(product), 0.0)) / scale)
        return errors[-1]

    def test(ksp, iteration, _norm):
        return PETSc.KSP.ConvergedReason.CONVERGED_RTOL if error(ksp) <= ACCURACY else iteration >= MOST and -3

    if stop:
        ksp.setConvergenceTest(test)
    else:
        ksp.setMonitor(lambda ksp, *_: error(ksp))
    return errors


def spaces(name, subdomains, chosen=SPACES):
    """Count for each coarse space of a scene: iterations of KSP latin and of CG with PC latin, coarse unknowns."""
    system = System(scene_of(name, subdomains))
    asked = subdomains if name.endswith("metis") else 0
    found = {}
    for space in chosen:
        modes, variant = SPACES[space]
        ksp, size = system.count("latin", asked, modes=modes, variant=variant)
        cg, _ = system.count("cg", asked, modes=modes, variant=variant)
        found[space] = {"ksp": ksp, "cg": cg, "coarse": size}
    return found


# ---- BDDC and FETI-DP, one subdomain a rank ----------------------------------------------------
BASIS = {"pc_bddc_use_change_of_basis": 1}
EDGES = {**BASIS, "pc_bddc_use_edges": 1, "pc_bddc_use_faces": 1}
NULL_PIVOTS = {
    f"pc_bddc_{place}_{key}": value
    for place in ("neumann", "dirichlet")
    for key, value in {"pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_24": 1}.items()
}


def _fetidp(options):
    return {"ksp_type": "fetidp", "fetidp_ksp_type": "cg", **{f"fetidp_bddc_{key}": options[key] for key in options}}


PEERS = {
    "KSP latin": {"ksp_type": "latin"},
    "CG, PC latin": {"ksp_type": "cg", "pc_type": "latin"},
    "CG, BDDC, stock options": {"ksp_type": "cg", "pc_type": "bddc"},
    "CG, BDDC, change of basis": {"ksp_type": "cg", "pc_type": "bddc", **EDGES},
    "CG, BDDC, change of basis, null pivots": {"ksp_type": "cg", "pc_type": "bddc", **EDGES, **NULL_PIVOTS},
    "FETI-DP, stock options": _fetidp({}),
    "FETI-DP, change of basis": _fetidp(EDGES),
    "FETI-DP, change of basis, null pivots": _fetidp({**EDGES, **NULL_PIVOTS}),
}
PEER_SCENES = ("truss-grid", "lattice", "elasticity")


def elasticity():
    """Plane elasticity of the example, 64 x 64 elements."""
    spec = importlib.util.spec_from_file_location("peers", HERE.parent / "examples" / "10_peers.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    return example.elasticity(64)


def matis(scene):
    """Assemble the stiffness with one subdomain a rank, and the load; rigid fields are its near null space."""
    comm, dim = PETSc.COMM_WORLD, scene.nodes.shape[1]
    links = scene.links[scene.subdomain == comm.rank]
    number = np.full(scene.nodes.shape, -1)
    used = ~scene.fixed & np.isin(np.arange(len(scene.nodes)), scene.links)[:, None]
    number[used] = np.arange(used.sum())
    ends = (scene.nodes[links[:, 1]] - scene.nodes[links[:, 0]]) / scene.lengths[scene.subdomain == comm.rank, None]
    rows = np.hstack([-ends, ends])
    dofs = number[links].reshape(len(links), 2 * dim)
    mine = np.unique(dofs[dofs >= 0]).astype(PETSc.IntType)
    places = np.where(dofs >= 0, np.searchsorted(mine, np.maximum(dofs, 0)), -1).astype(PETSc.IntType)
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes(used.sum())
    matrix.setType("is")
    matrix.setLGMap(PETSc.LGMap().create(mine, comm=comm))
    matrix.setPreallocationNNZ(100)
    for place, row, k in zip(places, rows, scene.stiffness[scene.subdomain == comm.rank]):
        matrix.setValuesLocal(place, place, k * np.outer(row, row), addv=True)
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    b = matrix.createVecRight()
    low, high = b.getOwnershipRange()
    b.setArray(scene.load[used][low:high])
    centred, fields = scene.nodes - scene.nodes.mean(axis=0), []
    for a in range(dim):
        fields.append(np.zeros_like(centred))
        fields[-1][:, a] = 1.0
        for c in range(a):
            fields.append(np.zeros_like(centred))
            fields[-1][:, a], fields[-1][:, c] = centred[:, c], -centred[:, a]
    orthonormal, vectors = np.linalg.qr(np.column_stack([field[used] for field in fields]))[0], []
    for field in orthonormal.T:
        vectors.append(b.duplicate())
        vectors[-1].setArray(field[low:high])
    matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=comm))
    return matrix, b, np.broadcast_to(scene.nodes[:, None], (*scene.nodes.shape, dim))[used][low:high]


def peer(name, scene_name, subdomains):
    """One row: iterations to the accuracy, or why there are none."""
    matrix, b, x = elasticity() if scene_name == "elasticity" else matis(scene_of(scene_name, subdomains))
    exact = solution(matrix.convert("aij", PETSc.Mat()), b)
    with default_options(PEERS[name]):
        ksp = PETSc.KSP().create()
        ksp.setOperators(matrix)
        ksp.setTolerances(rtol=1e-13, max_it=500)
        ksp.setFromOptions()
        if "latin" in name:
            ksp.getPC().setCoordinates(x)
        errors = watch(ksp, matrix, exact, stop=False)
        ksp.solve(b, b.duplicate())
    reasons = {value: key for key, value in vars(PETSc.KSP.ConvergedReason).items() if isinstance(value, int)}
    reached = [i for i, error in enumerate(errors) if error <= ACCURACY]
    return {"iterations": reached[0] if reached else None, "reason": reasons.get(ksp.getConvergedReason(), "?"),
            "error": float(errors[-1]) if errors and np.isfinite(errors[-1]) else None}  # fmt: skip


def run_peers(name, subdomains):
    """Each in a process of its own on as many ranks: an error of one of them ends it."""
    # as it was before MPI has started in this process, which mpirun must not see
    environment = {"OMPI_MCA_rmaps_base_oversubscribe": "1", "OMP_NUM_THREADS": "1", **os.environ}
    found = {}
    for method in PEERS:
        command = ["mpirun", "-n", str(subdomains), sys.executable, __file__, "--peer", method, name, str(subdomains)]
        try:
            out = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600)
            last = next((line for line in out.stdout.splitlines() if line.startswith("{")), None)
            found[method] = json.loads(last) if last else {"iterations": None, "reason": "error", "error": None}
        except subprocess.TimeoutExpired:
            found[method] = {"iterations": None, "reason": "not over after ten minutes", "error": None}
        print("   ", method, found[method], flush=True)
    return found


# ---- the page ----------------------------------------------------------------------------------
def cell(value):
    return "–" if value is None else str(value)


def tables(document):
    """Return the tables of the page: scene -> lines."""
    out = {}
    for name in SCENES:
        sizes = document["spaces"][name]
        lines = [
            "| coarse space | " + " | ".join(f"{s} subdomains" for s in sizes) + " |",
            "| --- |" + " --- |" * len(sizes),
        ]
        for space in next(iter(sizes.values())):
            cells = (
                f"{cell(found[space]['ksp'])}, {cell(found[space]['cg'])} ({found[space]['coarse']})"
                for found in sizes.values()
            )
            lines.append(f"| {space} | " + " | ".join(cells) + " |")
        out[name] = lines
    lines = ["| method | " + " | ".join(document["peers"]) + " |", "| --- |" + " --- |" * len(document["peers"])]
    for method in PEERS:
        rows = [found[method] for found in document["peers"].values()]
        cells = (cell(row["iterations"]) if row["iterations"] is not None else row["reason"] for row in rows)
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    out["peers"] = lines
    return out


def fill(document):
    """Write the tables between the marks of the page."""
    page = PAGE.read_text()
    for name, lines in tables(document).items():
        table = "\n".join(lines)
        page = re.sub(
            rf"(<!-- {name} -->\n).*?(\n<!-- end -->)", lambda m, t=table: m[1] + t + m[2], page, flags=re.DOTALL
        )
    PAGE.write_text(page)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", metavar="METHOD", choices=PEERS, help="one of them, on as many ranks as subdomains")
    parser.add_argument("--fill", action="store_true", help="the page again from the results")
    parser.add_argument("scene", nargs="?")
    parser.add_argument("subdomains", nargs="?", type=int)
    given = parser.parse_args()
    if given.peer:
        row = peer(given.peer, given.scene, given.subdomains)
        if PETSc.COMM_WORLD.rank == 0:
            print(json.dumps(row))
        return
    if not given.fill:
        document = json.loads(RESULT.read_text())
        for name in SCENES:
            for subdomains in SUBDOMAINS:
                document["spaces"][name][str(subdomains)] |= spaces(name, subdomains)
                print(name, subdomains, document["spaces"][name][str(subdomains)], flush=True)
        for name in PEER_SCENES:
            print(name, "16 ranks", flush=True)
            document["peers"][f"{name}, 16 subdomains"] = run_peers(name, 16)
        RESULT.write_text(json.dumps(document, indent=1) + "\n")
    fill(json.loads(RESULT.read_text()))


if __name__ == "__main__":
    main()
