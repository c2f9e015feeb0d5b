r"""A structure that no one here made: the lines of a drawing, raised to a vault of two layers and braced by cables.

The drawing is `lines_bigger.obj` of compas (pip install compas==2.15.1, as `make bench` does): 23,040 lines of a floor
plan in one plane, 18,624 of them different. `latinpc.read` makes the vault, as the options of this command do:

    latinpc solve lines_bigger.obj --raise 0.2 --brace 2 --EA 6.5e7 --EA braces=1e7 --prestress braces=1000 \
        --support x=min --support x=max --support y=min --support y=max --load z=-100

The self-stress of the cables is as of the scene `network`, and so is the load.
"""

from dataclasses import replace
from importlib.resources import files

import numpy as np

import latinpc
from latinpc.scenes.network import EA_BAR, EA_CABLE, MAX_CABLE_TENSION, Balance
from latinpc.scenes.scene import Law

RISE = 0.2  # of the vault, in spans
BAY = 2.0  # m, length of a line and distance of the layers
RIM = ("x=min", "x=max", "y=min", "y=max")
SLACK = 0.09  # share of cables that slacken


def drawn():
    """Return the scene."""
    drawing = files("compas") / "data/samples/lines_bigger.obj"
    vault = latinpc.read(drawing, rise=RISE, brace=BAY, EA={None: EA_BAR, "braces": EA_CABLE}, support=RIM)
    held = vault.fixed.all(axis=1)
    free = ~(held[vault.links[:, 0]] & held[vault.links[:, 1]])  # links between supports would do nothing
    links, cable, length = vault.links[free], vault.law[free] == Law.CABLE, vault.lengths[free]
    rng = np.random.default_rng(0)
    balance = Balance(vault.directions[free], links, vault.fixed)
    tension = balance.self_stress(np.where(cable, rng.uniform(0.5, 1.5, len(links)), -2.0))
    cable &= tension > 0.0  # what the self-stress compresses is a bar
    tension *= MAX_CABLE_TENSION / tension[cable].max()
    stiffness = np.where(cable, EA_CABLE, EA_BAR) / length
    force = np.where(vault.fixed, 0.0, rng.normal(scale=0.3, size=vault.nodes.shape) - [0.0, 0.0, 1.0])
    load = balance.load_for_slack(force, stiffness, tension, cable, SLACK)
    return replace(
        vault, name="drawn", links=links, law=np.where(cable, Law.CABLE, Law.BAR), stiffness=stiffness,
        initial_elongation=tension / stiffness, load=load * force, metadata={"partition": "metis"},
    )  # fmt: skip
