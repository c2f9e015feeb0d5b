"""Write the links of a form or of a displaced structure as a DXF drawing, with ezdxf (the extra ``import``)."""

from __future__ import annotations

import importlib.util
import re

import numpy as np

from latinpc.laws import Law

from .atomic import atomic, check_writable

SLACK = "slack"
_FORBIDDEN = re.compile(r'[<>/\\":;?*|=`]')  # in names of layers


def check_ezdxf(path):
    """Raise ValueError where the package is missing that writes a ``.dxf`` file; for other files nothing."""
    if str(path).lower().endswith(".dxf") and importlib.util.find_spec("ezdxf") is None:
        raise ValueError(f"{path}: DXF files need ezdxf: pip install ezdxf")


def write_dxf(path, structure, nodes, slack):
    """Write a line per link, on the layer of its group, else of its law, slack ones on layers of their own.

    Not collective: call it on one rank.

    Parameters
    ----------
    path : str or path-like
        A ``.dxf`` file, in m; it is replaced only once it is completely written.
    structure : Scene or Structure
    nodes : (n, dim) array
        Where the nodes are (m).
    slack : (m,) array of bool
        Links that bear nothing.
    """
    check_writable(path, (".dxf",))
    check_ezdxf(path)
    import ezdxf

    document = ezdxf.new(units=ezdxf.units.M)
    space, places = document.modelspace(), np.zeros((len(nodes), 3))
    places[:, : nodes.shape[1]] = nodes
    groups = getattr(structure.numbering, "link_groups", None)
    laws = [Law(law).name.lower() if law < len(Law) else "own law" for law in structure.law]
    for link, ends in enumerate(places[structure.links].tolist()):
        name = (str(groups[link]).split("; ")[0] if groups is not None else "") or laws[link]
        layer = _FORBIDDEN.sub("_", name) + (f" {SLACK}" if slack[link] else "")
        space.add_line(*ends, dxfattribs={"layer": layer})
        if layer not in document.layers:
            document.layers.add(layer)
    with atomic(path) as temporary:
        document.saveas(temporary)
