"""Large displacements: cables without natural length, as springs of form finding are, beside others."""

import numpy as np
import pytest

import latinpc


def unbalanced(net, found):
    """Return the largest unbalanced force, of the lengths that the displacements make."""
    start, end = np.array(net["links"]).T
    line = (net["nodes"] + found.displacements)[end] - (net["nodes"] + found.displacements)[start]
    size = np.linalg.norm(line, axis=1)
    drawn = np.linalg.norm(net["nodes"][end] - net["nodes"][start], axis=1)
    tension = net["stiffness"] * np.maximum(size - drawn + net["initial_elongation"], 0.0)
    force = (tension / np.maximum(size, 1e-300))[:, None] * line
    left = net["load"].copy()
    np.add.at(left, start, force)
    np.add.at(left, end, -force)
    return np.abs(left[~net["fixed"]]).max()


def net(nodes, links, stiffness, initial_elongation, held, load=None, prescribed=None):
    nodes = np.array(nodes, float)
    fixed = np.zeros(nodes.shape, bool)
    fixed[held] = True
    zero = np.zeros(nodes.shape)
    return {
        "nodes": nodes,
        "links": links,
        "stiffness": np.array(stiffness, float),
        "initial_elongation": np.array(initial_elongation),
        "fixed": fixed,
        "load": zero if load is None else np.array(load),
        "prescribed": zero if prescribed is None else prescribed,
    }


NETS = {
    "no loads, one without length": net(
        [[0.0, 0.0], [0.0, 1.0], [2.0, 0.0], [1.5, 1.5]], [[0, 1], [0, 2], [2, 3]], [1e3] * 3, [1.0, 0.4, 0.3], [0, 3]
    ),
    "a node pulled to its support": net(
        [[2.0], [0.0], [3.0], [1.0]],
        [[0, 1], [0, 2], [1, 3]],
        [123.00685976454113, 1001.9254586603893, 3745.2410535232525],
        [2.0, 1.0, 0.0],
        [3],
        [[0.0], [-406.06280383128615], [0.0], [0.0]],
    ),
    "small loads beside a large prestress": net(
        [[2.33631, 0.48260], [1.85913, 0.70070], [1.40321, 2.86751], [0.61015, 2.25219]],
        [[0, 1], [1, 2], [2, 3]],
        [78.4346] * 3,
        [np.hypot(2.33631 - 1.85913, 0.70070 - 0.48260), 0.0, 0.0],
        [3],
        [[0.005946, -0.077474], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
    ),
    "a support that passes its nodes": net(
        [[1.0], [2.0], [3.0], [0.0]],
        [[0, 1], [1, 2], [0, 3]],
        [22.0686] * 3,
        [1.0, 0.164142, -0.090341],
        [1],
        [[0.035125], [0.0], [0.035125], [0.035125]],
        [[0.0], [-1.376109], [0.0], [0.0]],
    ),
}


@pytest.mark.parametrize("name", NETS)
def test_cables_without_natural_length_balance(name):
    """They had ended as not a number, or as displacements without end."""
    found = latinpc.Structure(**NETS[name], law="cable", geometry="large").solve(error=1e-6)
    assert found.converged
    assert unbalanced(NETS[name], found) < 1e-4 * max(1e-2, np.abs(NETS[name]["load"]).max())
