"""KSP latin on the matrices of `matis_program`, beside conjugate gradients with PC latin and FETI-DP."""

import argparse
import json
import sys

import petsc4py

if __name__ == "__main__":
    petsc4py.init([sys.argv[0], "-skip_petscrc"])

import numpy as np
from matis_program import Grid, matis, near_null
from petsc4py import PETSc

import latinpc

CHOSEN = dict(problem="poisson", dim=2, cells=8, blocks="2,2", dirichlet="zeroed", jump="none", contrast=1e6,
              local_type="aij", scalar_map=False, asymmetric=False, coordinates=True, owned=False)  # fmt: skip


def job(words):
    """Solve one system by each method; return how far their solutions are apart."""
    args = argparse.Namespace(**CHOSEN | json.loads(words))
    problem = Grid(args)
    a, x, free = matis(problem, args, PETSc.COMM_WORLD)
    if args.dirichlet == "none":
        a.setNullSpace(near_null(a, x, free, problem))
    b = a.createVecLeft()
    first, last = b.getOwnershipRange()
    b.setArray(np.sin(1.0 + 7.3 * np.arange(first, last)))
    if args.dirichlet == "none":
        a.getNullSpace().remove(b)

    def solve(ksp_type, pc_type=None):
        ksp, u = PETSc.KSP().create(), b.duplicate()
        ksp.setOperators(a)
        ksp.setType(ksp_type)
        if pc_type:
            ksp.getPC().setType(pc_type)
        if "latin" in (ksp_type, pc_type) and args.coordinates:
            ksp.getPC().setCoordinates(x[:: problem.bs] if len(x) % problem.bs == 0 else x)
        ksp.setTolerances(rtol=1e-10, max_it=500)
        ksp.setFromOptions()
        ksp.solve(b, u)
        return ksp, u

    ksp, u = solve("latin")
    _, cg = solve("cg", "latin")
    found = dict(reason=ksp.getConvergedReason(), iterations=ksp.getIterationNumber(), cg=(u - cg).norm() / u.norm(),
                 subdomains=latinpc.statistics(ksp)["subdomains"], residual=(b - a * u).norm() / b.norm())  # fmt: skip
    if args.problem == "poisson" and args.dirichlet != "none":
        fetidp, v = solve("fetidp")
        found |= {"fetidp": (u - v).norm() / u.norm(), "fetidp_iterations": fetidp.getIterationNumber()}
    a.scale(3.0)  # new entries of the same matrix, without KSPSetOperators()
    if args.dirichlet != "none":
        a.shift(0.1)
    v = b.duplicate()
    ksp.solve(b, v)
    found |= {"again": (b - a * v).norm() / b.norm(), "again_reason": ksp.getConvergedReason()}
    return found


if __name__ == "__main__":
    job(sys.argv[1])
