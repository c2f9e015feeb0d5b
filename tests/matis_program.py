"""A program in the manner of applications: a MATIS of finite elements or links, one block of cells a rank, and a KSP.

``mpirun -n 4 matis_program.py --problem elasticity --dim 2 --cells 8 --blocks 2,2 -pc_type latin``

Single-dash options are PETSc's. Prints one line of JSON: what the solver did, and what is asked for by ``--check``.
"""

import argparse
import itertools
import json
import sys
import tempfile
from pathlib import Path

import petsc4py

if __name__ == "__main__":  # ours first, then PETSc's
    ours = next((i for i, word in enumerate(sys.argv) if word[:1] == "-" != word[1:2]), len(sys.argv))
    petsc4py.init([sys.argv[0], "-skip_petscrc", *sys.argv[ours:]])

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

import latinpc


def element(problem, dim, size=1.0, nu=0.3):
    """Stiffness of a square or cube of bilinear or trilinear functions, node by node in the order of their corners."""
    corners = np.array(list(itertools.product((0, 1), repeat=dim)))
    points = np.array(list(itertools.product((-1, 1), repeat=dim))) / np.sqrt(3.0) / 2 + 0.5
    bs = dim if problem == "elasticity" else 1
    stiffness = np.zeros((len(corners) * bs,) * 2)
    for point in points:
        factors = np.where(corners, point, 1.0 - point)
        slopes = np.where(corners, 1.0, -1.0) / size
        gradient = np.array([slopes[:, c] * np.delete(factors, c, 1).prod(1) for c in range(dim)])
        weight = size**dim / len(points)
        if bs == 1:
            stiffness += weight * gradient.T @ gradient
            continue
        shear, bulk = 0.5 / (1 + nu), nu / (1 + nu) / (1 - 2 * nu)
        inner = gradient.T @ gradient
        for a, b in itertools.product(range(dim), repeat=2):
            block = shear * np.outer(gradient[b], gradient[a]) + bulk * np.outer(gradient[a], gradient[b])
            stiffness[a::bs, b::bs] += weight * (block + (a == b) * shear * inner)
    return stiffness


class Grid:
    """Cells of a square, cube or plate, shared out in blocks; the side x = 0 is held."""

    def __init__(self, args):
        self.dim, self.cells = args.dim, args.cells
        shape = np.array([args.cells] * (args.dim - 1) + [getattr(args, "layers", 0) or args.cells])
        self.nodes = np.array(list(itertools.product(*(range(n + 1) for n in shape))), float)
        self.bs = args.dim if args.problem == "elasticity" else 1
        cells = np.array(list(itertools.product(*(range(n) for n in shape))))
        blocks = np.array([int(n) for n in args.blocks.split(",")])
        place = cells * blocks // shape
        self.part = np.ravel_multi_index(place.T, blocks)
        if getattr(args, "colours", False):  # blocks that touch nowhere: as many parts of the local matrix
            self.part = np.ravel_multi_index((place % 2).T, [2] * args.dim)
        corners = np.array(list(itertools.product((0, 1), repeat=args.dim)))
        self.connect = np.ravel_multi_index((cells[:, None] + corners).transpose(2, 0, 1), shape + 1)
        self.counts = None
        if args.owned:
            owner = np.full(len(self.nodes), self.part.max())
            np.minimum.at(owner, self.connect, self.part[:, None])
            order = np.argsort(owner, kind="stable")
            self.nodes, self.connect = self.nodes[order], np.argsort(order)[self.connect]
            self.counts = np.bincount(owner) * self.bs
        self.scale = np.ones(len(cells))
        if args.jump == "across":
            self.scale = np.where(place.sum(axis=1) % 2, args.contrast, 1.0)
        elif args.jump == "inside":  # stiff bars through the middle of all blocks, which cut every interface
            width = args.cells // max(blocks)
            self.scale = np.where(cells[:, 1] % width == width // 2, args.contrast, 1.0)
        elif args.jump == "left":  # one half is soft
            self.scale = np.where(cells[:, 0] < args.cells // 2, 1.0, args.contrast)
        elif args.jump == "random":
            self.scale = args.contrast ** np.random.default_rng(1).random(len(cells))
        self.stiffness = element(args.problem, args.dim)
        self.held = np.repeat(self.nodes[:, 0] == 0.0, self.bs)

    def local(self, part):
        """Stiffness of a part on its own unknowns, and their global numbers."""
        mine = np.flatnonzero(self.part == part)
        connect = (self.connect[mine][:, :, None] * self.bs + np.arange(self.bs)).reshape(
            len(mine), len(self.stiffness)
        )
        return assemble([(c, s * self.stiffness) for c, s in zip(connect, self.scale[mine])])


class Truss:
    """Links of a scene, one subdomain a rank; nodes held."""

    def __init__(self, args):
        from latinpc.scenes import make

        self.scene = make("truss-grid", modules=args.cells, subdomains=int(args.blocks))
        self.nodes, self.dim = self.scene.nodes, self.scene.dim
        self.bs = self.dim
        self.held = self.scene.fixed.ravel()

    def local(self, part):
        """Stiffness of a part on its own unknowns, and their global numbers."""
        pieces = []
        for link in np.flatnonzero(self.scene.subdomain == part):
            a, b = self.scene.links[link]
            n = (self.nodes[b] - self.nodes[a]) / np.linalg.norm(self.nodes[b] - self.nodes[a])
            row = np.concatenate([-n, n])
            where = np.concatenate([self.bs * a + np.arange(self.bs), self.bs * b + np.arange(self.bs)])
            pieces.append((where, self.scene.stiffness[link] * np.outer(row, row)))
        return assemble(pieces)


def assemble(pieces):
    """Sum of small matrices, (matrix, global numbers of its rows)."""
    if not pieces:
        return sp.csr_matrix((0, 0)), np.zeros(0, int)
    rows = np.concatenate([np.repeat(where, len(where)) for where, _ in pieces])
    cols = np.concatenate([np.tile(where, len(where)) for where, _ in pieces])
    values = np.concatenate([matrix.ravel() for _, matrix in pieces])
    numbers, inverse = np.unique(np.concatenate([rows, cols]), return_inverse=True)
    r, c = inverse[: len(rows)], inverse[len(rows) :]
    return sp.csr_matrix((values, (r, c)), shape=(len(numbers),) * 2), numbers


def parts(args, comm):
    """The parts of this rank: one, or (repeated) as many as the others, each with rows of its own."""
    if not getattr(args, "repeated", False):
        return [comm.getRank()]
    count = int(np.prod([int(n) for n in args.blocks.split(",")]))
    return [part for part in range(count) if part * comm.getSize() // count == comm.getRank()]


def together(pieces):
    """One local matrix of those of several parts, and the global numbers of its rows."""
    return sp.block_diag([k for k, _ in pieces], format="csr"), np.concatenate([numbers for _, numbers in pieces])


def matis(problem, args, comm):
    """The matrix as applications leave it: `dirichlet` says how the held unknowns are treated."""
    rank = comm.getRank()
    k, numbers = together([problem.local(part) for part in parts(args, comm)])
    n, bs = len(problem.held), problem.bs
    if args.dirichlet == "eliminated":
        keep = ~problem.held[numbers]
        renumber = np.cumsum(~problem.held) - 1
        k, numbers, n = k[keep][:, keep].tocsr(), renumber[numbers[keep]], int((~problem.held).sum())
        bs = bs if n % bs == 0 else 1
    if args.asymmetric and rank == comm.getSize() - 1:
        k[0, 1] *= 1.5
    first, last = n // bs * rank // comm.getSize() * bs, n // bs * (rank + 1) // comm.getSize() * bs
    if args.owned:
        first, last = problem.counts[:rank].sum(), problem.counts[: rank + 1].sum()
    blocked = args.dirichlet != "eliminated" and not args.scalar_map
    lgmap = PETSc.LGMap().create(
        (numbers[::bs] // bs if blocked else numbers).astype(PETSc.IntType), bsize=bs if blocked else 1, comm=comm
    )
    a = PETSc.Mat().create(comm)
    a.setSizes(((last - first, n), (last - first, n)), bsize=bs)
    a.setType("is")
    if getattr(args, "repeated", False):
        a.setISAllowRepeated(True)
    a.setLGMap(lgmap, lgmap)
    k = k.tocsr()
    local = PETSc.Mat().createAIJ(k.shape, csr=(k.indptr, k.indices, k.data), comm=PETSc.COMM_SELF)
    if args.local_type != "aij":
        local.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        local.convert(args.local_type)
    a.setISLocalMat(local)
    a.assemble()
    if args.dirichlet in ("zeroed", "scaled"):
        held = np.flatnonzero(problem.held)
        mine = held[(first <= held) & (held < last)].astype(PETSc.IntType)
        a.zeroRowsColumns(mine, diag=1.0 if args.dirichlet == "zeroed" else 123.0)
    elif args.dirichlet == "rows":  # their columns stay
        held = np.flatnonzero(problem.held)
        a.zeroRows(held[(first <= held) & (held < last)].astype(PETSc.IntType), diag=1.0)
    free = np.flatnonzero(~problem.held) if args.dirichlet == "eliminated" else np.arange(n)
    x = problem.nodes[free[first:last] // problem.bs]
    return a, x, free


def near_null(a, x, free, problem):
    """Rigid motions as near null space."""
    first, last = a.getOwnershipRange()
    c = free[first:last] % problem.bs
    fields = [(c == k).astype(float) for k in range(problem.bs)]
    for p, q in itertools.combinations(range(problem.bs), 2):
        fields.append((c == q) * x[:, p] - (c == p) * x[:, q])
    vecs = [a.createVecRight() for _ in fields]
    for v, f in zip(vecs, fields):
        v.setArray(f)
        v.normalize()
    for i, v in enumerate(vecs):
        for w in vecs[:i]:
            v.axpy(-v.dot(w), w)
        v.normalize()
    return PETSc.NullSpace().create(vectors=vecs, comm=a.getComm())


def explicit(pc, a):
    """The preconditioned matrix's spectrum and the preconditioner's asymmetry, on every rank."""
    n = a.getSize()[0]
    m, k = np.zeros((n, n)), np.zeros((n, n))
    x, y = a.createVecs()
    for j in range(n):
        for matrix, apply in ((m, pc.apply), (k, a.mult)):
            x.set(0.0)
            x.setValue(j, 1.0)
            x.assemble()
            apply(x, y)
            scatter, whole = PETSc.Scatter.toAll(y)
            scatter.scatter(y, whole)
            matrix[:, j] = whole.getArray()
    lower = np.linalg.cholesky((k + k.T) / 2)
    values = np.linalg.eigvalsh(lower.T @ (m + m.T) @ lower / 2)
    return float(values[0]), float(values[-1]), float(abs(m - m.T).max() / abs(m).max())


def set_value(pc, value):
    """Give the search direction of the options another fraction of the interface stiffness."""
    if value:
        latinpc.set_direction(pc, PETSc.Options().getString("pc_latin_direction"), value)


def job(*words):
    """Build and solve; return what the solver did, on every rank."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--problem", default="poisson")
    parser.add_argument("--dim", type=int, default=2)
    parser.add_argument("--cells", type=int, default=8)
    parser.add_argument("--layers", type=int, default=0, help="cells in the last direction")
    parser.add_argument("--blocks", default="2,2")
    parser.add_argument("--dirichlet", default="zeroed")
    parser.add_argument("--jump", default="none")
    parser.add_argument("--contrast", type=float, default=1e6)
    parser.add_argument("--local-type", default="aij")
    parser.add_argument("--coordinates", type=int, default=1)
    parser.add_argument("--scalar-map", action="store_true", help="a local-to-global map without blocks")
    parser.add_argument("--colours", action="store_true", help="every rank has all blocks of one colour")
    parser.add_argument("--owned", action="store_true", help="what is inside a block belongs to its rank")
    parser.add_argument(
        "--repeated", action="store_true", help="a rank has several blocks, unknowns between them twice"
    )
    parser.add_argument("--near", action="store_true")
    parser.add_argument("--unbalanced", action="store_true", help="the loads of a free body have a resultant")
    parser.add_argument("--asymmetric", action="store_true")
    parser.add_argument("--spectrum", action="store_true")
    parser.add_argument("--value", type=float, default=0.0, help="fraction of the search direction")
    parser.add_argument("--links", action="store_true", help="compare with the preconditioner of the links")
    parser.add_argument("--view", action="store_true", help="what -ksp_view prints")
    args, _ = parser.parse_known_args(words)
    comm = PETSc.COMM_WORLD
    problem = Truss(args) if args.problem == "truss" else Grid(args)
    a, x, free = matis(problem, args, comm)
    if args.near:
        a.setNearNullSpace(near_null(a, x, free, problem))
    if args.dirichlet == "none":
        a.setNullSpace(near_null(a, x, free, problem))
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(a)
    ksp.setType("cg")
    ksp.setTolerances(rtol=1e-8, max_it=500)
    pc = ksp.getPC()
    pc.setType("latin")
    if args.coordinates:
        pc.setCoordinates(x[:: problem.bs] if len(x) % problem.bs == 0 else x)
    ksp.setFromOptions()
    set_value(pc, args.value)
    b, u = a.createVecs()
    first, last = b.getOwnershipRange()
    b.setArray(np.sin(1.0 + 7.3 * np.arange(first, last)))
    if args.dirichlet == "none" and not args.unbalanced:
        a.getNullSpace().remove(b)
    if args.dirichlet == "rows":
        b.setArray(np.where(problem.held[first:last], 0.0, b.getArray()))
    ksp.solve(b, u)
    result = {"reason": ksp.getConvergedReason(), "iterations": ksp.getIterationNumber(), "unknowns": a.getSize()[0]}
    residual = b - a * u
    if args.unbalanced:
        result["resultant"] = residual.norm() / b.norm()
        a.getNullSpace().remove(residual)
    result["residual"] = residual.norm() / b.norm()
    if pc.getType() == "latin":
        result["subdomains"] = latinpc.statistics(pc)["subdomains"]
        result["coarse"] = latinpc.statistics(pc)["coarse_size"]
    if args.spectrum:
        result["least"], result["largest"], result["asymmetry"] = explicit(pc, a)
    if args.links:
        structure = latinpc.Structure.from_scene(problem.scene, comm=comm)
        other, f, v = structure.create_vec(), structure.create_vec(), structure.create_vec()
        jacobian = structure.dm.createMat()
        structure.jacobian(other, jacobian)
        by_links = PETSc.PC().create(comm)
        by_links.setOperators(jacobian)
        by_links.setType("latin")
        structure.attach(by_links)
        by_links.setFromOptions()
        set_value(by_links, args.value)
        given = np.where(problem.held, 0.0, np.sin(np.arange(len(problem.held))))
        structure.set_displacements(given.reshape(problem.nodes.shape), f)
        by_links.apply(f, v)
        theirs = structure.displacements(v).ravel()[~problem.held]
        b.setArray(given[free[first:last]])
        pc.apply(b, u)
        scatter, whole = PETSc.Scatter.toAll(u)
        scatter.scatter(u, whole)
        ours = whole.getArray() if len(free) < len(problem.held) else whole.getArray()[~problem.held]
        result["apart"] = float(abs(ours - theirs).max() / abs(theirs).max())
    if args.view:
        result["view"] = view(ksp)
    return result


def view(ksp):
    """Return what -ksp_view prints, on one rank."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "view")
        viewer = PETSc.Viewer().createASCII(str(file), comm=ksp.comm)
        ksp.view(viewer)
        viewer.destroy()
        return file.read_text() if ksp.comm.rank == 0 else ""


if __name__ == "__main__":
    PETSc.Sys.Print(json.dumps(job(*sys.argv[1:])))
