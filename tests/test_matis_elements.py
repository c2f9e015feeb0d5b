"""PC latin on the MATIS of finite elements on a DMPLEX, whose interpolants tell where the unknowns are."""

import json

import pytest

PROGRAM = """
import json
import sys
import petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", "-petscspace_degree", "1", *sys.argv[1:]])
import numpy as np
from petsc4py import PETSc
import latinpc

components = [int(n) for n in sys.argv[1].split(",")]
dim, each, comm = 2, sum(components), PETSc.COMM_WORLD
plex = PETSc.DMPlex().createBoxMesh([6, 6], simplex=False, comm=comm)
plex.distribute()
for number, count in enumerate(components):
    plex.setField(number, PETSc.FE().createDefault(dim, count, False, PETSc.DETERMINE, comm=comm))
plex.createDS()
plex.setMatType("is")
a = plex.createMat()
section = (plex.getLocalSection if hasattr(plex, "getLocalSection") else plex.getSection)()  # since PETSc 3.19
owned = plex.getGlobalSection()
place, x = plex.getCoordinateSection(), plex.getCoordinatesLocal().getArray()
where = lambda vertex: x[place.getOffset(vertex) : place.getOffset(vertex) + dim]
first, last = plex.getDepthStratum(0)

# bars between the corners of each cell, and as many springs for each unknown that is not a displacement
for cell in range(*plex.getHeightStratum(0)):
    corners = [point for point in plex.getTransitiveClosure(cell)[0] if first <= point < last]
    for i, one in enumerate(corners):
        at = section.getOffset(one) + np.arange(each, dtype=PETSc.IntType)
        if where(one)[0] == 0.0:
            a.setValuesLocal(at, at, 10.0 * np.eye(each), addv=True)
        for other in corners[i + 1 :]:
            n = where(other) - where(one)
            k = np.eye(each) / np.linalg.norm(n)
            if components[-1] == dim:
                k[-dim:, -dim:] = np.outer(n, n) / np.linalg.norm(n) ** 3
            to = section.getOffset(other) + np.arange(each, dtype=PETSc.IntType)
            both = np.concatenate([at, to])
            a.setValuesLocal(both, both, np.block([[k, -k], [-k, k]]), addv=True)
a.assemble()
a.setOption(PETSc.Mat.Option.SPD, True)
mine = sorted((owned.getOffset(v), v) for v in range(first, last) if owned.getOffset(v) >= 0)
nodes = np.array([where(v) for _, v in mine]).reshape(-1, dim)
b, rng = a.createVecRight(), np.random.default_rng(comm.rank)
b.setArray(rng.normal(size=b.getLocalSize()))


def applied(dm=None, coordinates=None):
    a.compose("__PETSc_dm", None)  # of itself the matrix knows nothing
    pc = PETSc.PC().create(comm)
    pc.setOperators(a)
    pc.setType("latin")
    if dm is not None:
        pc.setDM(dm)
    if coordinates is not None:
        pc.setCoordinates(coordinates)
    y = b.duplicate()
    pc.setUp()
    pc.apply(b, y)
    file = f"{sys.argv[2]}/view"
    viewer = PETSc.Viewer().createASCII(file, comm=comm)
    pc.view(viewer)
    viewer.destroy()
    return y, next(line for line in open(file) if line.lstrip().startswith("matrix: ")).strip()


told, view = applied(dm=plex)
given, given_view = applied(coordinates=nodes)
unknown, bare = applied()
size = told.norm()
answer = {"view": view, "bare": bare, "given": (told - given).norm() / size, "unknown": (told - unknown).norm() / size}
print(json.dumps(answer) if comm.rank == 0 else "", flush=True)
"""


@pytest.mark.parametrize("components", ["1", "2", "1,2"])
def test_elements_tell_coordinates_and_fields(mpirun, tmp_path, components):
    """The same preconditioner as with coordinates given by hand, and another one without any."""
    told = json.loads(mpirun(2, PROGRAM, components, tmp_path).stdout.strip())
    each = sum(int(n) for n in components.split(","))
    assert f"in {each} fields, coordinates in 2D" in told["view"]
    assert "no coordinates" in told["bare"]
    assert told["given"] < 1e-12
    assert told["unknown"] > 1e6 * told["given"]
