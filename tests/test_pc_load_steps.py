"""PC latin in steps of a load: a tangent that is not positive definite shortens a step, and is no error."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc

LIMIT = 2.0 / np.sqrt(27.0)  # the largest tension, of the elongation 1 / sqrt(3)


class Chain:
    """Springs in a row, held at one end and pulled at the other; the tension e - e^3 of elongation e has a maximum."""

    def __init__(self, springs=6):
        self.n, self.load = springs, 0.0
        rows = np.arange(springs, dtype=PETSc.IntType)
        self.tangent = PETSc.Mat().create(PETSc.COMM_SELF)
        self.tangent.setSizes(springs)
        self.tangent.setType("is")
        self.tangent.setLGMap(PETSc.LGMap().create(rows, comm=PETSc.COMM_SELF))
        self.assemble(np.zeros(springs))
        self.snes = PETSc.SNES().create(PETSc.COMM_SELF)
        self.u, self.f = self.tangent.createVecs()
        self.snes.setFunction(self.unbalance, self.f)
        self.snes.setJacobian(self.jacobian, self.tangent)
        self.snes.ksp.setType("cg")
        self.snes.ksp.pc.setType("latin")

    def assemble(self, stiffness_loss):
        """Set the tangent stiffness for elongations of which stiffness_loss is three times the square."""
        k = 1.0 - stiffness_loss
        matrix = np.diag(k + np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
        self.tangent.setISLocalMat(
            PETSc.Mat().createDense(matrix.shape, array=matrix, comm=PETSc.COMM_SELF).convert("aij")
        )
        self.tangent.assemble()

    def unbalance(self, snes, u, f):
        e = np.diff(u.getArray(readonly=True), prepend=0.0)
        tension = e - e**3
        f.setArray(tension - np.append(tension[1:], self.load))

    def jacobian(self, snes, u, a, p):
        self.assemble(3.0 * np.diff(u.getArray(readonly=True), prepend=0.0) ** 2)
        return True


def test_the_limit_load_is_found_by_shorter_steps():
    """Where the next load is too large, the linear solve fails, as with PETSc's own factorisations."""
    chain, step, borne, failed = Chain(), 0.25, 0.0, 0
    while step > 1e-4:
        chain.load, before = borne + step, chain.u.getArray().copy()
        chain.snes.solve(None, chain.u)
        if chain.snes.getConvergedReason() > 0:
            borne = chain.load
        else:
            assert chain.snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE
            assert chain.snes.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED
            chain.u.setArray(before)
            step, failed = step / 2.0, failed + 1
    assert failed > 5
    assert borne == pytest.approx(LIMIT, rel=1e-3)


@pytest.mark.parametrize("told", [False, True])
def test_it_is_an_error_at_once_or_where_asked_for(told):
    """The message names the cause: at the first set-up, and with -ksp_error_if_not_converged at all."""
    chain = Chain()
    b, u = chain.tangent.createVecs()
    ksp = chain.snes.ksp
    ksp.setOperators(chain.tangent)
    if told:
        ksp.setErrorIfNotConverged(True)
        ksp.solve(b, u)
    chain.assemble(np.full(chain.n, 2.0))
    with pytest.raises(PETSc.Error) as caught:
        ksp.solve(b, u)
    assert "not positive definite" in latinpc.error_message(caught.value)


def test_other_errors_remain():
    """New values that are wrong are no reason for a shorter step."""
    chain = Chain()
    b, u = chain.tangent.createVecs()
    chain.snes.ksp.setOperators(chain.tangent)
    chain.snes.ksp.solve(b, u)
    chain.assemble(np.full(chain.n, np.nan))
    with pytest.raises(PETSc.Error) as caught:
        chain.snes.ksp.solve(b, u)
    assert "not a finite number" in latinpc.error_message(caught.value)


def test_events_of_a_set_up_that_fails_end(tmp_path, mpirun):
    """Nested logging refuses an event that ends outside of the one in which it began; both kinds of failure."""
    program = tmp_path / "program.py"
    program.write_text(
        "import sys, petsc4py; petsc4py.init(sys.argv)\n"
        "import latinpc, numpy as np\n"
        "from petsc4py import PETSc\n"
        "comm = PETSc.COMM_WORLD\n"
        "local = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])\n"
        "rows = np.arange(2 * comm.rank, 2 * comm.rank + 3, dtype=PETSc.IntType)\n"
        "a = PETSc.Mat().create(comm)\n"
        "a.setSizes(2 * comm.size + 1)\n"
        "a.setType('is')\n"
        "a.setLGMap(PETSc.LGMap().create(rows, comm=comm))\n"
        "ksp = PETSc.KSP().create(comm)\n"
        "ksp.setType('cg')\n"
        "ksp.getPC().setType('latin')\n"
        "ksp.setOperators(a)\n"
        "for sign in (1.0, -1.0, 1.0, -1.0):\n"
        "    dense = PETSc.Mat().createDense((3, 3), array=sign * local, comm=PETSc.COMM_SELF)\n"
        "    a.setISLocalMat(dense.convert('aij'))\n"
        "    a.assemble()\n"
        "    b, u = a.createVecs()\n"
        "    b.set(1.0)\n"
        "    ksp.setUp()\n"
        "    ksp.solve(b, u)\n"
        "    PETSc.Sys.Print('reason', ksp.getConvergedReason())\n"
    )
    done = mpirun(2, program, "-log_view", f":{tmp_path / 'log.xml'}:ascii_xml")
    reasons = done.stdout.split()[1::2]
    assert reasons[0] == "2" and reasons[1::2] == ["-11", "-11"]  # PETSc 3.18 ends the solve after a failure with -9
    assert (tmp_path / "log.xml").stat().st_size > 0
