"""Plates, frames, nearly incompressible bodies, anisotropic diffusion: PC latin beside BDDC, GAMG and Schwarz.

    python benchmarks/bending.py      prints the table of docs/preconditioners.md

Conjugate gradients to a relative residual of 1e-8 in the natural norm, 8 ranks, one subdomain each. All methods have
the rigid motions as near null space, PC latin the coordinates as well. GAMG and Schwarz have the assembled matrix. Work
is processor time outside MPI of the slowest rank, as in matis.py.
"""

import argparse
import ast
import itertools
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import petsc4py
import scipy.sparse as sp

FACES = "-pc_bddc_use_faces -pc_bddc_monolithic"
MUMPS = " ".join(f"-pc_bddc_{which}_pc_factor_mat_solver_type mumps" for which in ("dirichlet", "neumann"))
#: Title: options, whether the matrix is assembled.
METHODS = {
    "PC latin": ("-pc_type latin", False),
    "PC latin, schur, local fields": ("-pc_type latin -pc_latin_direction schur -pc_latin_modes_local 1", False),
    "BDDC, faces, MUMPS": (f"-pc_type bddc {FACES} {MUMPS}", False),
    "GAMG": ("-pc_type gamg", True),
    "Schwarz, overlap 2": ("-pc_type asm -pc_asm_type basic -pc_asm_overlap 2 -sub_pc_type cholesky", True),
}
#: Title: element, cells, lengths, blocks, parameter.
CASES = {
    "plate, thickness 1/10": ("mindlin", (96, 96), (1, 1), (4, 2), 0.1),
    "plate, thickness 1/100": ("mindlin", (96, 96), (1, 1), (4, 2), 0.01),
    "plate, thickness 1/1000": ("mindlin", (96, 96), (1, 1), (4, 2), 0.001),
    "frame of beams": ("beams", (12, 12, 24), (12, 12, 24), (2, 2, 2), 1e-3),
    "bar 4 x 1 x 1, nu 0.3": ("solid", (48, 12, 12), (4, 1, 1), (8, 1, 1), 0.3),
    "bar 4 x 1 x 1, nu 0.499": ("solid", (48, 12, 12), (4, 1, 1), (8, 1, 1), 0.499),
    "diffusion, 1 and 1000": ("diffusion", (160, 160), (1, 1), (4, 2), 1e-3),
}
KEYS = ("element", "cells", "lengths", "blocks", "parameter")

PARSER = argparse.ArgumentParser(description=__doc__.splitlines()[0])
PARSER.add_argument("--one", nargs=2, metavar=("CASE", "METHOD"), help="one case, under mpirun")
PARSER.add_argument("--change", nargs=2, action="append", metavar=("KEY", "VALUE"), help="another value of the case")
GIVEN, OPTIONS = PARSER.parse_known_args()
if GIVEN.one:  # not where mpirun is started: MPI does not start in itself
    petsc4py.init([sys.argv[0], "-skip_petscrc", *METHODS[GIVEN.one[1]][0].split(), *OPTIONS])
    from mpi4py import MPI
    from petsc4py import PETSc

    import latinpc  # noqa: F401 - registers the types


def gradients(size, points):
    """Yield values and gradients of the bilinear or trilinear functions, and the weight, at points of the unit cell."""
    dim = len(size)
    corners = np.array(list(itertools.product((0, 1), repeat=dim)))
    for p in points:
        factors = np.where(corners, p, 1.0 - p)
        slopes = np.where(corners, 1.0, -1.0) / size
        yield factors.prod(1), np.array([slopes[:, c] * np.delete(factors, c, 1).prod(1) for c in range(dim)])


def gauss(dim):
    """Return the points of the rule with two points in each direction."""
    return np.array(list(itertools.product((-1, 1), repeat=dim))) / np.sqrt(12) + 0.5


def mindlin(size, t):
    """Shear-flexible plate, deflection and two rotations of a node; shear at the centre alone."""
    nu, area = 0.3, size.prod()
    bending = t**3 / 12 / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    k = np.zeros((12, 12))
    for _, g in gradients(size, gauss(2)):
        b = np.zeros((3, 12))
        b[0, 1::3], b[1, 2::3], b[2, 1::3], b[2, 2::3] = g[0], g[1], g[1], g[0]
        k += area / 4 * b.T @ bending @ b
    for n, g in gradients(size, np.full((1, 2), 0.5)):
        b = np.zeros((2, 12))
        b[0, 0::3], b[0, 1::3], b[1, 0::3], b[1, 2::3] = g[0], -n, g[1], -n
        k += area * 5 / 12 / (1 + nu) * t * b.T @ b
    return k


def solid(size, nu):
    """Elastic cell."""
    shear, bulk, k = 0.5 / (1 + nu), nu / (1 + nu) / (1 - 2 * nu), np.zeros((24, 24))
    for _, g in gradients(size, gauss(3)):
        for a, b in itertools.product(range(3), repeat=2):
            block = shear * np.outer(g[b], g[a]) + bulk * np.outer(g[a], g[b]) + (a == b) * shear * g.T @ g
            k[a::3, b::3] += size.prod() / 8 * block
    return k


def diffusion(size, ratio):
    """Diffusion that is `ratio` times as fast along the second direction."""
    stiffness = np.diag([1.0, ratio])
    return sum(size.prod() / 4 * g.T @ stiffness @ g for _, g in gradients(size, gauss(2)))


def beam(axis, stiffness):
    """Beam of length and axial stiffness one along an axis, three displacements and three rotations of a node."""
    k = np.zeros((12, 12))
    k[0, [0, 6]], k[6, [0, 6]] = [1, -1], [-1, 1]
    k[3, [3, 9]], k[9, [3, 9]] = [stiffness, -stiffness], [-stiffness, stiffness]
    bend = stiffness * np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    sign = np.diag([1, -1, 1, -1])
    k[np.ix_([1, 5, 7, 11], [1, 5, 7, 11])] += bend
    k[np.ix_([2, 4, 8, 10], [2, 4, 8, 10])] += sign @ bend @ sign
    turn = np.kron(np.eye(4), np.roll(np.eye(3), axis, axis=1))
    return turn.T @ k @ turn


def elements(kind, cells, lengths, parameter):
    """Return the places of the nodes, unknowns per node, and pairs of a matrix and the nodes of its elements."""
    shape, size = np.array(cells), np.array(lengths) / cells
    nodes = np.array(list(np.ndindex(*(shape + 1))))
    number = np.arange(len(nodes)).reshape(shape + 1)
    if kind == "beams":
        ends = [(np.moveaxis(number, a, 0)[:-1].ravel(), np.moveaxis(number, a, 0)[1:].ravel()) for a in range(3)]
        return nodes * size, 6, [(beam(a, parameter), np.array(e).T) for a, e in enumerate(ends)]
    corners = itertools.product((0, 1), repeat=len(cells))
    corner = [number[tuple(slice(o, n + o) for o, n in zip(c, cells))].ravel() for c in corners]
    make = {"mindlin": mindlin, "solid": solid, "diffusion": diffusion}[kind]
    return nodes * size, {"mindlin": 3, "solid": 3, "diffusion": 1}[kind], [(make(size, parameter), np.array(corner).T)]


def rigid(kind, x, bs):
    """Return the rigid motions, or the constant, at nodes: columns of [nodes * bs]."""
    fields = []

    def add(**of):
        fields.append(np.zeros((len(x), bs)))
        for c, values in of.items():
            fields[-1][:, int(c[1:])] = values

    if kind == "mindlin":
        add(c0=1.0), add(c0=x[:, 0], c1=1.0), add(c0=x[:, 1], c2=1.0)
        return fields
    for c in range(min(bs, 3)):
        add(**{f"c{c}": 1.0})
    for a in range(3 if bs > 1 else 0):
        b, c = (a + 1) % 3, (a + 2) % 3
        add(**{f"c{c}": x[:, b], f"c{b}": -x[:, c], **({f"c{3 + a}": 1.0} if bs == 6 else {})})
    return fields


def local_matrix(groups, place, rank, renumber, bs):
    """Return the sum of the elements of a rank, without the nodes that are held, and the nodes that it has."""
    rows, cols, values = [], [], []
    for (k, connect), of in zip(groups, place):
        mine = renumber[connect[of == rank]]
        unknowns = np.where(mine[..., None] < 0, -1, mine[..., None] * bs + np.arange(bs)).reshape(len(mine), len(k))
        rows.append(np.repeat(unknowns, len(k), axis=1).ravel())
        cols.append(np.tile(unknowns, len(k)).ravel())
        values.append(np.tile(k.ravel(), len(mine)))
    rows, cols, values = (np.concatenate(each) for each in (rows, cols, values))
    kept = (rows >= 0) & (cols >= 0)
    nodes = np.unique(rows[kept] // bs)
    index = [np.searchsorted(nodes, n[kept] // bs) * bs + n[kept] % bs for n in (rows, cols)]
    k = sp.csr_matrix((values[kept], tuple(index)), shape=(len(nodes) * bs,) * 2)
    k.sort_indices()
    return k, nodes


def matrix(kind, cells, lengths, blocks, parameter, assembled):
    """Return the matrix, the places of its nodes, and its near null space. The nodes at x = 0 are held."""
    comm = PETSc.COMM_WORLD
    x, bs, groups = elements(kind, cells, lengths, parameter)
    free = x[:, 0] > 0.0
    middle = [x[connect].mean(axis=1) / lengths * blocks for _, connect in groups]
    place = [np.ravel_multi_index(np.minimum(m.astype(int), np.array(blocks) - 1).T, blocks) for m in middle]
    k, nodes = local_matrix(groups, place, comm.rank, np.where(free, np.cumsum(free) - 1, -1), bs)
    a = PETSc.Mat().create(comm)
    a.setSizes(int(free.sum()) * bs, bsize=bs)
    a.setType("is")
    a.setLGMap(PETSc.LGMap().create(nodes.astype(PETSc.IntType), bsize=bs, comm=comm))
    a.setISLocalMat(PETSc.Mat().createAIJ(k.shape, csr=(k.indptr, k.indices, k.data), comm=PETSc.COMM_SELF))
    a.assemble()
    if assembled:
        a = a.convert("aij", out=PETSc.Mat())
        a.setBlockSize(bs)
    first, last = a.getOwnershipRange()
    vectors = []
    for field in rigid(kind, x[free], bs):
        vectors.append(a.createVecRight())
        vectors[-1].setArray(field.ravel()[first:last])
        for other in vectors[:-1]:
            vectors[-1].axpy(-vectors[-1].dot(other), other)
        vectors[-1].normalize()
    a.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=comm))
    return a, x[free][first // bs : last // bs]


def job(title, method, change):
    """Solve a case, on every rank; the first one prints unknowns, reason, iterations, residual, and the work."""
    comm = PETSc.COMM_WORLD
    a, x = matrix(*(change.get(k, c) for k, c in zip(KEYS, CASES[title])), METHODS[method][1])
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(a)
    ksp.setType("cg")
    ksp.setNormType(PETSc.KSP.NormType.NATURAL)
    ksp.setTolerances(rtol=1e-8, max_it=500)
    ksp.setFromOptions()
    if ksp.getPC().getType() == "latin":
        ksp.getPC().setCoordinates(x)
    b, u = a.createVecs()
    b.setArray(np.sin(1.0 + 7.3 * np.arange(*a.getOwnershipRange())))
    times = [MPI.Wtime()]
    ksp.setUp()
    ksp.setUpOnBlocks()
    times.append(MPI.Wtime())
    ksp.solve(b, u)
    times.append(MPI.Wtime())
    work = np.max(comm.tompi4py().allgather(np.diff(times)), axis=0)
    residual = (b - a * u).norm() / b.norm()
    found = [a.getSize()[0], ksp.getConvergedReason(), ksp.getIterationNumber(), residual, *work.tolist()]
    PETSc.Sys.Print(json.dumps(found))


def cell(words, title, method):
    """Return what the table says of a case and a method, and the number of unknowns, 0: not known."""
    try:
        done = subprocess.run([*words, "--one", title, method], capture_output=True, text=True, timeout=120)
        size, reason, iterations, _, setup, solve = json.loads(done.stdout.splitlines()[-1])
    except (subprocess.TimeoutExpired, IndexError, json.JSONDecodeError):
        return "no result", 0
    return f"{iterations}, {1e3 * setup:.0f} + {1e3 * solve:.0f}" if reason > 0 else "no result", size


def main():
    """Measure all cases, one after the other, and print the table."""
    import matis

    print("| | unknowns |", " | ".join(METHODS), "|\n| --- | ---: |", " | ".join(["---:"] * len(METHODS)), "|")
    with tempfile.TemporaryDirectory() as name:
        matis.compile_all(None, Path(name), {})
        words = ["mpirun", "-n", "8", "-x", f"LD_PRELOAD={name}/clock.so", sys.executable, __file__]
        for title in CASES:
            cells, sizes = zip(*(cell(words, title, method) for method in METHODS))
            print(f"| {title} | {max(sizes):,} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    if GIVEN.one:
        job(*GIVEN.one, {key: ast.literal_eval(value) for key, value in (GIVEN.change or [])})
    else:
        main()
