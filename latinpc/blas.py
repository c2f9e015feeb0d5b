"""Which kernels OpenBLAS has chosen, and whether this processor has wider ones."""

from __future__ import annotations

import ctypes
import os
import pathlib
import re
from functools import cache
from typing import Any

CHOICE = "OPENBLAS_CORETYPE"
WIDE = ("SkylakeX", "Cooperlake", "SapphireRapids")  # kernels for AVX-512
MIDDLE = ("Haswell", "Zen")  # for AVX2; all others are for less


@cache
def kernels() -> dict[str, Any] | None:
    """Return version and kernels of the OpenBLAS that the C library calls; not collective.

    OpenBLAS does not know processors that are newer than itself. It runs kernels for AVX2 there, or even for SSE3.

    Returns
    -------
    dict or None
        version, kernels, and wider: those to choose by `CHOICE`, None where nothing is better or the user has chosen.
        None with another BLAS.
    """
    try:
        loaded = ctypes.CDLL(str(pathlib.Path(__file__).with_name("liblatinpc.so")))
        said = [getattr(loaded, f"openblas_get_{what}") for what in ("config", "corename")]
    except (OSError, AttributeError):
        return None
    for function in said:
        function.restype = ctypes.c_char_p
    config, chosen = (function().decode() for function in said)
    version = re.search(r"OpenBLAS ([\d.]+)", config)
    choice = "DYNAMIC_ARCH" in config and not os.environ.get(CHOICE)
    return {
        "version": version.group(1) if version else None,
        "kernels": chosen,
        "wider": _wider(chosen, _instructions()) if choice else None,
    }


def _instructions():
    """Return the names of the instruction sets of this processor, as Linux gives them."""
    file = pathlib.Path("/proc/cpuinfo")
    match = re.search(r"^flags\s*:(.*)$", file.read_text(errors="replace"), re.MULTILINE) if file.is_file() else None
    return set(match.group(1).split()) if match else set()


def _wider(chosen, instructions):
    """Return the widest kernels for these instruction sets, None if those chosen are as wide."""
    if "avx512f" in instructions and "avx512dq" in instructions:
        return None if chosen in WIDE else "SKYLAKEX"
    return "HASWELL" if {"avx2", "fma"} <= instructions and chosen not in WIDE + MIDDLE else None
