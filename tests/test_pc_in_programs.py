"""PC latin where programs put it: behind PCSHELL, in the fields of PCFIELDSPLIT, after an error that was put right."""

import numpy as np
import pytest
from petsc4py import PETSc
from support import logged

import latinpc
from latinpc.options import default_options

SIDE = 8
NODES = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij"), -1).reshape(-1, 2).astype(float)


def stiffness():
    """Squares with two diagonals, held on one side: (2 n, 2 n)."""
    n = len(NODES)
    matrix = np.zeros((2 * n, 2 * n))
    for i in range(n):
        for j in range(i):
            line = NODES[i] - NODES[j]
            if abs(line).max() > 1.0:
                continue
            along = np.zeros(2 * n)
            along[2 * i : 2 * i + 2], along[2 * j : 2 * j + 2] = line, -line
            matrix += np.outer(along, along)
    held = np.repeat(NODES[:, 0] == 0.0, 2)
    matrix[held], matrix[:, held] = 0.0, 0.0
    matrix[held, held] = 1.0
    return matrix


def matis():
    """That matrix as a MATIS of one rank."""
    whole = stiffness()
    local = PETSc.Mat().createDense(whole.shape, array=whole, comm=PETSc.COMM_SELF).convert("aij")
    matrix = PETSc.Mat().create(PETSc.COMM_SELF)
    matrix.setSizes(len(whole), bsize=2)
    matrix.setType("is")
    matrix.setLGMap(*2 * [PETSc.LGMap().create(range(len(whole)), comm=PETSc.COMM_SELF)])
    matrix.setISLocalMat(local)
    matrix.assemble()
    return matrix


def test_a_shell_has_the_coordinates_that_it_is_given():
    """Of the last call, from the next set-up on."""
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOperators(matis())
    pc.setType("shell")
    latinpc.pcshell_set_latin(pc)
    pc.setUp()
    inner = pc.query("PCLatin")
    assert inner.query("LatinCoordinates") is None
    for places in (NODES, 2.0 * NODES):
        pc.setCoordinates(places)
        pc.setUp()
        assert np.array_equal(inner.query("LatinCoordinates").getArray(), places.ravel())


def test_a_shell_that_was_set_up_becomes_ours():
    """It is set up again: the application had met a preconditioner without a matrix."""
    x, y = matis().createVecs()
    x.set(1.0)
    found = []
    for before in (False, True):
        pc = PETSc.PC().create(PETSc.COMM_SELF)
        pc.setOperators(matis())
        pc.setType("shell")
        if before:
            pc.setUp()
        latinpc.pcshell_set_latin(pc)
        pc.setUp()
        pc.apply(x, y)
        found.append(y.getArray().copy())
    assert np.array_equal(*found) and found[0].any()


def test_a_shell_has_the_structure_that_it_is_given():
    """For a matrix that does not know it, as PC latin itself."""
    ends = [[i, j] for i in range(len(NODES)) for j in range(i) if abs(NODES[i] - NODES[j]).max() <= 1.0]
    structure = latinpc.Structure(
        NODES, ends, "bar", 1.0, fixed=np.repeat(NODES[:, :1] == 0.0, 2, axis=1), comm=PETSc.COMM_SELF
    )
    tangent = structure.dm.createMat()
    structure.jacobian(structure.create_vec(), tangent)
    matrix = PETSc.Mat().createAIJ(tangent.getSizes(), csr=tangent.getValuesCSR(), comm=PETSc.COMM_SELF)
    x, y = matrix.createVecs()
    x.set(1.0)
    found = []
    for shell in (False, True):
        pc = PETSc.PC().create(PETSc.COMM_SELF)
        pc.setOperators(matrix)
        pc.setType("shell" if shell else "latin")
        if shell:
            latinpc.pcshell_set_latin(pc)
        structure.attach(pc)
        pc.setUp()
        pc.apply(x, y)
        found.append(y.getArray().copy())
    assert np.array_equal(*found) and found[0].any()


def test_a_choice_after_the_set_up_is_one_set_up():
    """It had been two: when it was applied, and at the next solve."""
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    matrix = matis()
    ksp.setOperators(matrix)
    ksp.setType("cg")
    ksp.getPC().setType("latin")
    x, b = matrix.createVecs()
    b.set(1.0)
    with logged():
        event = PETSc.Log.Event("LatinSetUp")
        ksp.solve(b, x)
        before = event.getPerfInfo()["count"]
        latinpc.set_variant(ksp.getPC(), "macro")
        for _ in range(3):
            ksp.solve(b, x)
        assert event.getPerfInfo()["count"] == before + 1


def test_the_matrix_of_ksp_latin_may_be_assembled():
    """A floating one, whose kernel the MATIS beside it knows: springs that hold it are no part of the matrix."""
    n = 20
    rods = 2.0 * np.eye(n + 1) - np.eye(n + 1, k=1) - np.eye(n + 1, k=-1)
    rods[[0, -1], [0, -1]] = 1.0
    local = PETSc.Mat().createDense(rods.shape, array=rods, comm=PETSc.COMM_SELF).convert("aij")
    matrix = PETSc.Mat().create(PETSc.COMM_SELF)
    matrix.setSizes(n + 1)
    matrix.setType("is")
    matrix.setLGMap(*2 * [PETSc.LGMap().create(range(n + 1), comm=PETSc.COMM_SELF)])
    matrix.setISLocalMat(local)
    matrix.assemble()
    kernel = PETSc.NullSpace().create(constant=True, comm=PETSc.COMM_SELF)
    whole = local.copy()
    x, b = matrix.createVecs()
    b.setArray(np.sin(np.arange(n + 1)))
    kernel.remove(b)
    for given in (matrix, whole):
        given.setNullSpace(kernel)
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setType("latin")
        ksp.setOperators(given, matrix)
        ksp.solve(b, x)
        assert ksp.getConvergedReason() > 0
        assert rods @ x.getArray() == pytest.approx(b.getArray(), abs=1e-9)
    whole.shift(1e-3)
    with pytest.raises(PETSc.Error) as caught:
        ksp.solve(b, x)
    assert "is not the MATIS that it is set up from" in latinpc.error_message(caught.value)


@pytest.mark.parametrize("inner", ["pc", "ksp"])
def test_fields_of_a_split_whose_whole_has_coordinates(inner):
    """PCFIELDSPLIT gives its fields none: it says so by the dimension 0."""
    matrix = matis()
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType("fgmres")
    ksp.getPC().setType("fieldsplit")
    ksp.getPC().setCoordinates(NODES)
    options = {"pc_fieldsplit_type": "symmetric_multiplicative", "pc_fieldsplit_block_size": 2, "ksp_rtol": 1e-8}
    for field in "01":
        options |= {f"fieldsplit_{field}_ksp_type": "latin" if inner == "ksp" else "preonly"}
        options |= {f"fieldsplit_{field}_pc_type": "none" if inner == "ksp" else "latin"}
    x, b = matrix.createVecs()
    b.setArray(np.where(np.repeat(NODES[:, 0] == 0.0, 2), 0.0, 1.0))
    with default_options(options):
        ksp.setFromOptions()
        ksp.solve(b, x)
    assert ksp.getConvergedReason() > 0
    assert stiffness() @ x.getArray() == pytest.approx(b.getArray(), abs=1e-6)


def test_a_set_up_that_was_refused_is_tried_again():
    """Values change together with a null space that is none; it is taken away again, and nothing else changes."""
    matrix = matis()
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType("cg")
    ksp.getPC().setType("latin")
    x, b = matrix.createVecs()
    b.set(1.0)
    ksp.solve(b, x)
    first = x.getArray().copy()
    matrix.scale(2.0)
    matrix.setNullSpace(PETSc.NullSpace().create(constant=True, comm=PETSc.COMM_SELF))
    with pytest.raises(PETSc.Error):
        ksp.solve(b, x)
    matrix.setNullSpace(PETSc.NullSpace().create(comm=PETSc.COMM_SELF))
    ksp.solve(b, x)
    assert ksp.getConvergedReason() > 0
    assert x.getArray() == pytest.approx(0.5 * first, rel=1e-6, abs=1e-9)
