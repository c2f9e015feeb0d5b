"""What the command line says of a structure that is refused as a mechanism."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import replace

from petsc4py import PETSc

from latinpc.errors import MAT_CH_ZRPVT
from latinpc.files.misses import near_misses
from latinpc.results.notices import SolveError


@contextlib.contextmanager
def mechanism_explained(comm, scene, picture=None):
    """Where a structure is refused as a mechanism, name ends that miss each other, and draw the motion.

    Other ranks do not wait.
    """
    try:
        yield
    except (PETSc.Error, SolveError) as error:
        if comm.rank == 0 and error.ierr == MAT_CH_ZRPVT:
            for text in near_misses(scene) if "file" in scene.metadata else ():
                print(f"latinpc: {text}", file=sys.stderr)
        if comm.rank == 0 and picture is not None:
            _draw(replace(scene, geometry="linear"), picture)  # what an option has made of it, or as drawn
        raise


def _draw(flat, picture):
    """Draw the motion that no link resists, where there is one."""
    motion = flat.free_motion()
    if motion is not None:
        from latinpc.results.drawing import save
        from latinpc.results.motionpicture import motion_figure

        save(motion_figure(flat, motion), picture)
        print(f"latinpc: {picture} shows the motion that no link resists", file=sys.stderr)
