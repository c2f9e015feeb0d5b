"""A structure that no rank has whole: a row of trusses, each rank makes its own panels.

    python examples/16_distributed.py
    mpirun -n 2 python examples/16_distributed.py
    mpirun -n 4 python examples/16_distributed.py

Each rank gives its nodes, numbered after those of the ranks before it, and its links, by the numbers of all nodes. The
last panel of a rank joins the first nodes of the next one. Solvers leave the arrays where they are: displacements,
tensions and reactions are those of a rank's own nodes and links. To bring them together is a choice.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc

PANELS = 240  # of 1 m x 1 m, in all
comm = PETSc.COMM_WORLD.tompi4py()

# nodes 2 i at the bottom and 2 i + 1 at the top of post i
first, last = (PANELS + 1) * comm.rank // comm.size, (PANELS + 1) * (comm.rank + 1) // comm.size
post = np.arange(first, last)
nodes = np.column_stack([np.repeat(post, 2), np.tile([0, 1], len(post))]).astype(float)
panel = post[post < PANELS]
bars = [(0, 1), (0, 2), (1, 3)]
cables = [(0, 3), (1, 2)]
links = np.concatenate([2 * panel + np.array(pair)[:, None] for pair in bars + cables], axis=1).T
law = np.repeat(["bar"] * len(bars) + ["cable"] * len(cables), len(panel))
end = 2 * PANELS + np.array([[0, 1]] if last == PANELS + 1 else np.zeros((0, 2), int))  # the last post
links, law = np.vstack([links, end]), np.append(law, ["bar"] * len(end))

fixed = np.zeros((len(nodes), 2), bool)
fixed[(nodes[:, 1] == 0) & (nodes[:, 0] % 12 == 0)] = True  # a pier every 12 m
load = np.where(fixed, 0.0, [0.0, -1e3])  # N

truss = latinpc.LocalStructure(nodes, links, law, 1e7, fixed=fixed, load=load, name="viaduct")
result = truss.solve(error=1e-6)
assert result.converged

sinks = comm.allreduce(-result.displacements[:, 1].min(), op=max)
borne = comm.allreduce(result.reactions()[:, 1].sum())
loads = -comm.allreduce(load[:, 1].sum())
assert abs(borne - loads) < 1e-3 * loads
PETSc.Sys.Print(f"{truss} sinks by {1e3 * sinks:.2f} mm, the piers bear {1e-3 * borne:.1f} kN of {1e-3 * loads:.1f} kN")
PETSc.Sys.Print(f"slack: {100 * result.report['slack_fraction']:.1f} % of the cables")

with tempfile.TemporaryDirectory() as folder:
    place = Path(comm.bcast(folder))
    result.to_vtu(place / "viaduct.pvtu")  # for ParaView: a file of each rank, and an index
    whole = result.gather(root=0)  # a latinpc.Result on rank 0, None elsewhere
    if whole is not None:
        assert len(list((place / "viaduct").iterdir())) == comm.size
        print(f"worst link: {np.abs(whole.tensions).max() / 1e3:.2f} kN")
    comm.barrier()
