"""Bad input: the same clear sentence on every rank, no deadlock, and the process goes on.

Each case runs here on one rank, and all of them on two ranks in one `mpirun` of this very file.
"""


import numpy as np
from petsc4py import PETSc

import latinpc
from latinpc import _latin

# A square of bars with its diagonals, hung at its lower nodes, and a node on a post: enough for every mistake.
SQUARE = {
    "nodes": np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], dtype=float),
    "links": np.array([[0, 1], [1, 2], [2, 3], [0, 3], [0, 2], [1, 3], [1, 4], [2, 4]]),
    "law": np.zeros(8, dtype=int),
    "stiffness": np.full(8, 1e3),
    "fixed": np.array([[1, 1], [1, 1], [0, 0], [0, 0], [0, 0]], dtype=bool),
    "load": np.array([[0, 0], [0, 0], [1, 0], [0, 0], [0, -1]], dtype=float),
}
NAN, INFINITE = float("nan"), float("inf")
CASES = {}


def case(message, kind=ValueError):
    """Register a function that must raise `kind` with a sentence that matches `message`."""

    def register(function):
        CASES[function.__name__] = (function, kind, message)
        return function

    return register


def cases(message, kind, make_one, **named):
    """Register one case for each keyword: its value goes to `make_one`."""
    for name, value in named.items():
        CASES[name] = (lambda value=value: make_one(value), kind, message)


def square(**changes):
    return latinpc.Links(**{**SQUARE, **changes})


def changed(name, place, value):
    array = SQUARE[name].copy() if name in SQUARE else np.zeros((5, 2) if name == "prescribed" else 8)
    array[place] = value
    return array


def spoiled(name, place, value):
    return lambda: square(**{name: changed(name, place, value)})


def solve(links, prefix_free=True, **settings):
    """Solve with options given as keywords, which leave no trace."""
    database = PETSc.Options()
    for name, value in settings.items():
        database[name] = value
    try:
        snes, u = links.create_snes(), links.create_vec()
        snes.setFromOptions()
        snes.solve(None, u)
    finally:
        for name in settings:
            database.delValue(name)
    return snes, u


def the_process_goes_on():
    """Solve the square: what a mistake leaves behind must not be in the way."""
    links = square()
    snes, u = solve(links, snes_latin_subdomains=2)
    assert snes.reason > 0
    axis = np.diff(SQUARE["nodes"][SQUARE["links"]], axis=1)[:, 0]
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    B = np.zeros((8, 5, 2))
    for row, (a, b) in enumerate(SQUARE["links"]):
        B[row, a], B[row, b] = -axis[row], axis[row]
    B = B.reshape(8, 10)[:, ~SQUARE["fixed"].ravel()]
    expected = np.linalg.solve(1e3 * B.T @ B, SQUARE["load"][~SQUARE["fixed"]])
    assert np.allclose(links.displacements(u)[~SQUARE["fixed"]], expected, rtol=1e-3)


# ---- structures that Python refuses ---------------------------------------------------------------------

cases(r"link 2 \(\[.+\]\) joins a node that does not exist \(nodes are numbered from 0 to 4\)", ValueError,
      lambda n: square(links=changed("links", 2, [2, n])), node_beyond=5, node_negative=-1)  # fmt: skip
cases(r"link 3 \(.+\) needs a positive stiffness", ValueError, lambda k: spoiled("stiffness", 3, k)(),
      stiffness_zero=0.0, stiffness_negative=-1.0, stiffness_nan=NAN, stiffness_infinite=INFINITE)  # fmt: skip
cases(r"link 1 \(.+\) has an unknown law \(0 bar, 1 cable, 2 strut\)", ValueError, lambda law: spoiled("law", 1, law)(),
      law_beyond=3, law_negative=-1)  # fmt: skip
case(r"link 4 .* joins a node to itself")(spoiled("links", 4, [2, 2]))
CASES["node_to_itself"] = CASES.pop("<lambda>")
cases(r"that is not finite", ValueError, lambda where: spoiled(*where)(),
      coordinate_nan=("nodes", (2, 0), NAN), load_nan=("load", (2, 1), NAN), load_infinite=("load", (2, 1), INFINITE),
      prestrain_nan=("prestrain", 5, NAN), prescribed_nan=("prescribed", (0, 1), NAN))  # fmt: skip


@case(r"link 1 .* has no length: its two nodes are at one place")
def coincident_nodes():
    square(nodes=changed("nodes", 2, SQUARE["nodes"][1]))


@case(r"node 2 .* has a prescribed displacement in a direction that is not fixed")
def prescribed_where_free():
    square(prescribed=changed("prescribed", (2, 0), 0.1))


@case(r"links must be an \(m, 2\) array of node numbers")
def no_link():
    square(links=np.zeros((0, 2), int))


@case(r"links must be integers")
def fractional_node():
    square(links=SQUARE["links"] + 0.5)


@case(r"load must have the shape \(5, 2\), a row per node")
def load_of_wrong_shape():
    square(load=np.zeros((4, 2)))


@case(r"subdomain 1 has no link; subdomains are numbered from 0 without gaps")
def partition_with_gap():
    square(subdomain=[0, 0, 0, 0, 2, 2, 2, 2])


@case(r"9 subdomains for 8 links")
def partition_beyond_links():
    square(subdomain=[0, 1, 2, 3, 4, 5, 6, 8])


@case(r"has a negative subdomain")
def partition_negative():
    square(subdomain=[0, 0, 0, 0, -1, 0, 0, 0])


# ---- the same mistakes made by the last rank alone, in C ------------------------------------------------


def raw(upto="setup", **spoil):
    """Build the square as a C program would, each rank its share; `spoil` maps a name to (place, value)."""
    comm = PETSc.COMM_WORLD
    last = comm.rank == comm.size - 1
    nodes, links = ((len(SQUARE[name]) * comm.rank // comm.size, len(SQUARE[name]) * (comm.rank + 1) // comm.size)
                    for name in ("nodes", "links"))  # fmt: skip
    data = {name: SQUARE[name][slice(*nodes)].astype(float) for name in ("nodes", "load")}
    data["fixed"] = SQUARE["fixed"][slice(*nodes)].astype(f"i{_latin.BOOL_SIZE}")
    data["prescribed"] = np.zeros_like(data["load"])
    data["links"] = SQUARE["links"][slice(*links)].astype(PETSc.IntType)
    data["law"] = SQUARE["law"][slice(*links)].astype(PETSc.IntType)
    data["stiffness"], data["prestrain"] = SQUARE["stiffness"][slice(*links)].copy(), np.zeros(links[1] - links[0])
    data["subdomain"] = np.zeros(links[1] - links[0], PETSc.IntType)
    if last:
        for name, (place, value) in spoil.items():
            data[name][place] = value
    handle = _latin.LinksHandle()
    handle.create(comm, spoil.get("count", 5), data["nodes"], data["links"])
    if "forget_laws" not in spoil:
        handle.set_laws(data["law"], data["stiffness"], data["prestrain"])
    handle.set_supports(data["fixed"], data["prescribed"])
    handle.set_loads(data["load"])
    if "subdomain" in spoil:
        handle.set_subdomains(data["subdomain"])
    handle.setup()
    return handle


C_CASES = {
    "c_node_beyond": (r"Link 7 joins nodes 2 and 5, but the nodes are numbered from 0 to 4", {"links": ((-1, 1), 5)}),
    "c_node_to_itself": (r"Link 7 joins node 2 to itself", {"links": ((-1, 1), 2)}),
    "c_coincident_nodes": (r"Link \d has no length: its nodes \d and \d lie at the same point", {"nodes": (-1, [1, 0])}),
    "c_coordinate_nan": (r"Node 4 has a coordinate that is not a finite number", {"nodes": ((-1, 0), NAN)}),
    "c_law_beyond": (r"Link 7 has law 3; the laws are 0 \(bar\), 1 \(cable\), 2 \(strut\)", {"law": (-1, 3)}),
    "c_stiffness_zero": (r"Link 7 has stiffness 0.*positive finite number", {"stiffness": (-1, 0.0)}),
    "c_stiffness_negative": (r"Link 7 has stiffness -1.*positive finite number", {"stiffness": (-1, -1.0)}),
    "c_stiffness_nan": (r"Link 7 has stiffness nan.*positive finite number", {"stiffness": (-1, NAN)}),
    "c_prestrain_nan": (r"Link 7 has a prestrain that is not a finite number", {"prestrain": (-1, NAN)}),
    "c_load_nan": (r"Node 4 has a load that is not a finite number", {"load": ((-1, 0), NAN)}),
    "c_no_laws": (r"Link 0 has no stiffness: call LatinLinksSetLaws\(\)", {"forget_laws": ((), 0)}),
    "c_partition_negative": (r"Link 7 is in subdomain -1; subdomains are numbered from 0", {"subdomain": (-1, -1)}),
    "c_partition_beyond": (r"Link 7 is in subdomain 8; .* at most as many as links", {"subdomain": (-1, 8)}),
}


def register_c_cases():
    for name, (message, spoil) in C_CASES.items():
        spoil = {key: value for key, value in spoil.items()}
        CASES[name] = (lambda spoil=spoil: raw(**spoil), PETSc.Error, message)
