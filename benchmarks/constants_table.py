"""The constants of latinpc/src: those that trade iterations or work, the scenes that count them, and the others."""

from dataclasses import dataclass


@dataclass
class Tuning:
    """What a constant is for."""

    unit: str  #: "" for a number or a ratio
    decides: str
    scenes: tuple  #: names in constant_scenes.py
    so: str = ""  #: why its value is kept
    values: tuple | None = None  #: in place of a quarter, a half, twice and four times the value


STAGES = ("grid", "grid cut", "truss cut", "network", "lattice cut")
DIAGONAL = ("grid, diagonal", "grid cut, diagonal", "network, diagonal", "lattice cut, diagonal")
LOW = ("grid cut, low-energy modes", "network, low-energy modes", "lattice cut, low-energy modes")
CG = (
    "CG, truss-grid",
    "CG, truss-grid metis",
    "CG, lattice",
    "KSP latin, truss-grid",
    "KSP latin, truss-grid metis",
    "KSP latin, lattice",
)
PROVED = ("grid to 1e-04", "grid to 1e-08", "grid cut to 1e-04", "grid cut to 1e-08", "network to 1e-04",
          "network to 1e-08", "lattice to 1e-04", "lattice to 1e-08")  # fmt: skip
SLACK = ("lattice x 100 to 1e-04", "grid x 100 to 1e-04", "girder 0.9 to 1e-04", "girder 0.99 to 1e-04",
         "girder 0.999 to 1e-04")  # fmt: skip
CONTRAST = ("contrast 1e-08 to 1e-04", "contrast 0.0001 to 1e-04", "contrast 10000 to 1e-04", "contrast 1e+06 to 1e-04",
            "contrast 1e+08 to 1e-04", "contrast 1e+06 to 1e-10", "halves 1e+08 to 1e-04")  # fmt: skip
RATIOS = ("estimate over error, grid", "estimate over error, grid cut", "estimate over error, network",
          "estimate over error, lattice")  # fmt: skip
FRICTION = ("10 friction packings", "5 large friction packings")
GRANULAR = (*FRICTION, "discs with friction", "10 packings", "spheres", "net", "chain", "arch")
HUNG = (
    "hung truss",
    "hung girder 1e-08",
    "hung girder 0.0001",
    "hung girder 10000",
    "hung girder 1e+08",
    "hung girder, half 1e+08",
)
JAMS = ("20 without room", "20 without room, no load", "20 with just room", "net at rest")
LOOSE = ("row that flies", "light last grain", "very light last grain", "small load on grains")
UPLIFT = ("uplift 0.99", "uplift 0.999", "uplift 1.01", "uplift 1.5", "slack lattice, rest")
MOTIONS = ("bouncing chain", "mass on grid", "mass on tower")
JUMPS = ("MATIS elasticity", "MATIS inside 40", "MATIS inside 100", "MATIS inside 1e+06", "MATIS random 100",
         "MATIS random 1e+06", "MATIS inside 3D", "KSP latin MATIS inside", "KSP latin MATIS random")  # fmt: skip
PARTS = ("grid cut, parts", "truss cut, parts", "network, parts", "lattice cut, parts")
CRUMBS = ("2 links a part", "6 links a part", "12 links a part", "24 links a part", "48 links a part")
FACTORS = ("factors, grid in 36", "factors, network 2000 in 12", "factors, grid in 4", "factors, lattice in 2",
           "factors, network 2000 in 2")  # fmt: skip
HALF = (0.125, 0.25, 0.75, 0.95)

TUNING = {
    # interfaces
    "LATIN_STIFFNESS_FLOOR": Tuning("of the diagonal", "foundation of SNES and KSP latin", (*STAGES, *CG[3:])),
    "LATIN_STIFFNESS_SIDES": Tuning("of the diagonal", "foundation of PC latin at interfaces", (*CG[:3], *JUMPS[:5])),
    "LATIN_STIFFNESS_LEAST": Tuning(
        "of the mean", "least foundation of a dof that few links reach", (*STAGES, *DIAGONAL, *CG)
    ),
    "LATIN_DIRECTION_FLOOR": Tuning(
        "of the mean", "least diagonal search direction", (*DIAGONAL, "MATIS inside 100", "MATIS random 1e+06", *CG)
    ),
    "LATIN_DIRECTION_SMALL": Tuning(
        "rows x rows on interfaces",
        "Schur complements as directions of a matrix",
        ("MATIS elasticity 40", "MATIS elasticity 64", "MATIS across 1e+06"),
    ),
    "LATIN_JUMP": Tuning("ratio", "where coefficients jump", JUMPS),
    "LATIN_SPECTRAL_MOST": Tuning("fields", "most low-energy fields of a subdomain", (*LOW, *JUMPS)),
    "LATIN_SPECTRAL_SIZE": Tuning("of its norm", "fields that the macro basis has already", (*LOW, *JUMPS)),
    "LATIN_SPECTRAL_SOFT": Tuning(
        "of the interface's stiffness", "springs that fields of a matrix are compared with", JUMPS
    ),
    "LATIN_SPECTRAL_ITERATION": Tuning("eigenvalue", "threshold of KSP latin on jumps", JUMPS[-2:]),
    "LATIN_MODE_VISIBLE": Tuning(
        "of its norm",
        "macro modes kept on nodes that serve",
        ("grid cut, coarse", "truss cut, coarse", "network, coarse", "lattice cut, coarse"),
    ),
    # partition
    "LATIN_REPAIR_SOFT": Tuning("link stiffnesses", "directions that links hold", PARTS),
    "LATIN_REPAIR_BALANCE": Tuning(
        "of the mean", "size of subdomains after repair", PARTS, values=(0.0625, 0.125, 0.5, 0.9)
    ),
    "LATIN_METIS_SMALL": Tuning("links a subdomain", "links or nodes as vertices of METIS", CRUMBS),
    "LATIN_SIZE_PLANE": Tuning("links a subdomain", "subdomains on several ranks, plane", ("two ranks, lattice",)),
    "LATIN_SIZE_FLAT": Tuning("links a subdomain", "the same, flat", ("two ranks, grid",)),
    "LATIN_SIZE_SOLID": Tuning(
        "links a subdomain", "the same, solid", ("two ranks, network", "two ranks, network 2000")
    ),
    "LATIN_SIZE_THICK": Tuning(
        "links", "flat or solid", ("two ranks, grid", "two ranks, network", "two ranks, network 2000")
    ),
    # the estimate
    "LATIN_ESTIMATE_ROWS": Tuning("numbers", "size of a sketch", (*PROVED, *RATIOS)),
    "LATIN_ESTIMATE_WINDOW": Tuning("iterates", "longest past", (*PROVED, *RATIOS)),
    "LATIN_ESTIMATE_SHORT": Tuning("iterates", "shortest past", (*PROVED, *RATIOS)),
    "LATIN_ESTIMATE_STEP": Tuning("iterates", "step of the extrapolation", (*PROVED, *RATIOS, *SLACK)),
    "LATIN_ESTIMATE_RATE": Tuning(
        "a stage of the extrapolation",
        "largest rate believed",
        (*PROVED, *RATIOS, *SLACK),
        values=(0.9, 0.95, 0.99, 0.995),
    ),
    "LATIN_ESTIMATE_EARLY": Tuning("ratio", "caution at the first iterates", (*PROVED, *RATIOS)),
    "LATIN_PROOF_EARLY": Tuning("of the target", "when Newton's method proves the error", (*PROVED, *SLACK)),
    # Newton's method
    "LATIN_NEWTON_STAGES": Tuning("linear stages", "stall: predicted stages", (*PROVED, *SLACK, *CONTRAST)),
    "LATIN_NEWTON_WINDOW": Tuning("linear stages", "stall: window", (*PROVED, *SLACK, *CONTRAST)),
    "LATIN_NEWTON_CONTRAST": Tuning(
        "ratio of stiffnesses",
        "when a displacement at rest proves nothing",
        (*SLACK[2:], *CONTRAST),
        values=(1e2, 1e4, 1e8, 1e10),
    ),
    "LATIN_NEWTON_RTOL": Tuning("of the residual", "linear solve while links change", (*PROVED, *SLACK, *CONTRAST)),
    "LATIN_NEWTON_TIGHT": Tuning(
        "of the residual", "linear solve after a stall", (*PROVED, *SLACK, *CONTRAST), values=(1e-7, 1e-8, 1e-10, 1e-11)
    ),
    "LATIN_NEWTON_SAFETY": Tuning(
        "of the target", "linear solve at the end", (*PROVED, *SLACK, *CONTRAST), values=(0.125, 0.25, 0.75, 1.0)
    ),
    "LATIN_NEWTON_PROOF": Tuning("of the residual", "before it, no step is a measure", (*PROVED, *SLACK), values=HALF),
    "LATIN_NEWTON_FLOOR": Tuning(
        "of the least stiffness",
        "what a slack link keeps",
        (*SLACK, *CONTRAST, *UPLIFT),
        values=(1e-10, 1e-9, 1e-7, 1e-6),
    ),
    "LATIN_NEWTON_LINEAR": Tuning("iterations", "most of a linear solve", (*SLACK, *CONTRAST, *UPLIFT)),
    "LATIN_NEWTON_STEPS": Tuning("steps", "most steps", (*SLACK, *CONTRAST, *UPLIFT)),
    "LATIN_NEWTON_FULL": Tuning("steps", "steps before the line search", (*SLACK, *CONTRAST, *UPLIFT)),
    "LATIN_NEWTON_STILL": Tuning("steps", "steps at rest that are believed", (*SLACK, *CONTRAST, *UPLIFT)),
    "LATIN_SEARCH_TOLERANCE": Tuning("of the first slope", "end of the line search", (*SLACK, *CONTRAST, *UPLIFT)),
    # the equilibrium check
    "LATIN_FORCE_FACTOR": Tuning("ratio", "error from unbalance", (*PROVED, *CONTRAST, *LOOSE, *JAMS, *MOTIONS)),
    "LATIN_MOVED_FACTOR": Tuning("ratio", "error of a step from forces and masses", MOTIONS),
    "LATIN_TENSION_SHARE": Tuning("ratio", "error of tensions of rigid links", (*JAMS, *LOOSE)),
    "LATIN_UNHELD": Tuning("of the forces", "nodes that nothing holds", (*JAMS, *LOOSE, *UPLIFT), values=HALF),
    "LATIN_WORK_LEFT": Tuning("of the work", "free fall", (*UPLIFT, *LOOSE, *JAMS), values=HALF),
    "LATIN_WORK_CANCELS": Tuning(
        "of the works", "works that cancel", (*UPLIFT, *LOOSE, *JAMS, "grid to 1e-04", "network to 1e-04")
    ),
    "LATIN_LOAD_LEFT": Tuning("of the work", "loads along a mechanism", (*UPLIFT, *LOOSE)),
    "LATIN_SOFT": Tuning(
        "of the softest link",
        "stiffness of a mechanism",
        (*UPLIFT, *LOOSE, *CONTRAST[:2]),
        values=(1e-9, 1e-8, 1e-6, 1e-5),
    ),
    "LATIN_JAM_STAGES": Tuning("damped stages", "when jammed links show", JAMS),
    "LATIN_JAM_FAR": Tuning("times the displacements", "how far a solution is looked for", (*JAMS, "light last grain")),
    "LATIN_JAM_LEAST": Tuning("linear stages", "solves whose jams are looked for", JAMS),
    # rigid links and motions
    "LATIN_RIGID_SMALL": Tuning("of the spacing", "search parameter without gaps", GRANULAR),
    "LATIN_RIGID_RUBS": Tuning("ratio", "search parameter with friction", (*FRICTION, "discs with friction", "arch")),
    "LATIN_PARAMETER_WINDOW": Tuning("linear stages", "window of the search parameter", (*GRANULAR, *HUNG)),
    "LATIN_PARAMETER_GAIN": Tuning("of the indicator", "stall of contacts with friction", FRICTION, values=HALF),
    "LATIN_PARAMETER_PAST": Tuning("windows", "stall of contacts with friction", FRICTION, values=(2, 3, 6, 8)),
    "LATIN_PARAMETER_MOST": Tuning("ratio", "largest change at once", FRICTION),
    "LATIN_PARAMETER_FAR": Tuning("ratio", "largest change in all", FRICTION),
    "LATIN_PARAMETER_OFF": Tuning("ratio", "change beside elastic links", HUNG),
    "LATIN_PARAMETER_AGAIN": Tuning("times", "changes beside elastic links", HUNG),
    "LATIN_STEP_CLOSED": Tuning("of the free flight", "contacts that are closed", MOTIONS),
    # solvers
    "LATIN_LARGE": Tuning("rows", "order of elimination: nested dissection or minimum degree", FACTORS),
    "LATIN_INEXACT_RTOL": Tuning(
        "of the residual",
        "iterative solvers taken to be exact",
        ("grid cut, CG inside", "network, CG inside"),
        values=(1e-12, 1e-11, 1e-9, 1e-8),
    ),
    "LATIN_BOUND_SPRINGS": Tuning(
        "ratio", "bound of the energy error", ("bound, truss", "bound, lattice", "bound, network")
    ),
    "LATIN_DIGITS_SAMPLES": Tuning(
        "samples", "digits lost to rounding", ("rounding, grid", "rounding, network", "rounding, lattice")
    ),
    "LATIN_DIGITS_SAFETY": Tuning(
        "ratio", "errors that rounding leaves", ("network to 1e-14", "contrast 1e+06 to 1e-10")
    ),
}

#: Constants that trade nothing, or time and memory alone: unit, and why this value.
OTHERS = {
    # rounding
    "LATIN_NOISE": (
        "of the energy norm",
        "A distance of the two stages below it is rounding: about 45 eps, less than any stop in use.",
    ),
    "LATIN_MECHANISM": (
        "of the diagonal",
        "A stiffness below it is rounding: 45 eps, as a factor of so few digits is no factor.",
    ),
    "LATIN_NEWTON_SEEN": (
        "of the greatest stiffness",
        "What a slack link keeps must be more than a mechanism, or the factorisation stops: three times as much.",
    ),
    "LATIN_DIGITS_FLOOR": (
        "of the least stiffness",
        "As `LATIN_NEWTON_FLOOR`, for the solves that count digits: no mechanism ends them.",
    ),
    "LATIN_DIGITS_UNIT": ("relative", "The unit roundoff: half the distance of two numbers."),
    "LATIN_FORCE_NOISE": ("eps, of the forces at a node", "The forces at a node are a sum of tens of rounded terms."),
    "LATIN_GAP_NOISE": (
        "eps, of displacements and gap",
        "An elongation is a difference and a sum of three rounded numbers: four roundings.",
    ),
    "LATIN_GAP_NONE": (
        "eps, of tau / l",
        "Displacements below it come from rounded tensions alone: three digits over rounding.",
    ),
    "LATIN_POINT": (
        "eps, of the size",
        "Coordinates of the size differ by one eps: less than 64 is no displacement that shows.",
    ),
    "LATIN_GAP_POINT": ("eps, of the size", "The same of gaps, which are data and not results: four roundings."),
    "LATIN_STEP_SAME": ("relative", "Lengths of steps that differ by rounding: half of the digits."),
    "LATIN_STIFFNESS_TINY": (
        "of the mean",
        "A foundation that keeps the operators of a matrix regular; coefficients may jump by 1e10, so it is no larger.",
    ),
    "LATIN_MODE_RANK": (
        "of the largest singular value",
        "Modes with less of their own are dependent: the weighted modes would have a condition of 1e12.",
    ),
    "LATIN_NEAR_RANK": ("of its norm", "A field with less of its own is that of others: half of the digits."),
    "LATIN_FRAME_FLAT": ("squares of extents", "Extents below 1e-6 of the largest make a plane, or a line."),
    "LATIN_GROUP_PIVOT": (
        "of the diagonal",
        "A pivot below it may be a mechanism: 1e3 times `LATIN_MECHANISM`; the coarse solver decides.",
    ),
    "LATIN_MATRIX_ASYMMETRY": (
        "of the largest entries",
        "Assembly in another order leaves 1e-15; a matrix that is not symmetric differs by more than half of "
        "the digits.",
    ),
    # bounds that are not met
    "LATIN_STEP_FAR": ("m", "A gap that nothing closes: the largest number."),
    "LATIN_FAR": ("m", "A strain beyond every gap, whose square is a number still."),
    "LATIN_LAW_STEPS": (
        "steps",
        "Newton's method inside a bracket that bisection halves: 200 halvings are more than any number has digits.",
    ),
    "LATIN_SEARCH_MOST": (
        "trial lengths",
        "Every third one halves the interval: 80 of them leave 1e-8 of it at worst.",
    ),
    "LATIN_ROOM": ("percent", "Work space of MUMPS beyond its own estimate, at first: twice the estimate."),
    "LATIN_ROOM_MOST": ("percent", "Three fourfold increases of it; then the error is the user's to see."),
    "LATIN_WATCH_SECONDS": (
        "s",
        "How long a rank with an error waits for the others to meet the same one; it only delays the end of a"
        " program that is lost.",
    ),
    "LATIN_GROUP_LEVELS": ("levels", "3^8 subdomains a side, and the last level is small from 3^3 on."),
    # time and memory, the same iterations
    "LATIN_ELIMINATE_DENSE": (
        "rows",
        "Dense algebra takes less time below: tensegrity-grid 60 and network 8000 by METIS into 8 to 240.",
    ),
    "LATIN_GROUPS": ("subdomains a side", "Of 2, 3, 4 and 6 the least set-up and memory."),
    "LATIN_GROUP_INTERIOR": (
        "rows",
        "A dense factor of 1536 rows has 19 MB and takes 1.2 Gflop; a sparse one of a larger group does less work.",
    ),
    "LATIN_REDUNDANT": ("rows", "A parallel factor of so few rows is all messages: each rank factors the whole."),
    "LATIN_INVERSE_ROWS": ("rows", "The inverse has 2 MB, about a second-level cache."),
    "LATIN_INVERSE_RUN": (
        "subdomains",
        "The product of one inverse with eight vectors or more is arithmetic, with fewer it is memory traffic.",
    ),
    "LATIN_INVERSE_STAGES": (
        "linear stages",
        "The inverse costs as many solves as it has rows: those of eight linear stages at most.",
    ),
    "LATIN_FACTOR_POWER": (
        "exponent",
        "Entries of a factor grow about so with its links (`partition/subdomaincount.c`): ranks get blocks of"
        " like cost.",
    ),
    "LATIN_SIZE_LEAST": ("links", "A structure of fewer links stays on one rank."),
    # buffers
    "LATIN_LANES": ("subdomains", "Eight doubles fill a vector of AVX-512."),
    "LATIN_BATCH_COLUMNS": ("right-hand sides", "64 of 300 rows are 150 kB: they stay in the second cache."),
    "LATIN_GROUP_COLUMNS": ("right-hand sides", "The same for groups."),
    "LATIN_HOMOGENISE_COLUMNS": (
        "right-hand sides",
        "Bounds the work space of condensation to 16 copies of the displacements.",
    ),
    "LATIN_MATE_COLUMNS": ("numbers", "Exchanged in one message: few messages, work space of 16 numbers a dof."),
    "LATIN_HISTORY": ("linear stages", "Kept indicators and errors take 32 MB at most."),
    "LATIN_ESTIMATE_BITS": ("bits", "Eight for one of 256 rows, one for the sign: goes with `LATIN_ESTIMATE_ROWS`."),
    "LATIN_ESTIMATE_SHARE": ("entries", "Six times nine bits are 54 of the 63 that a random number has."),
    "LATIN_LISTED": ("nodes or links", "As many as an error message names."),
    "LATIN_LAWS_MAX": (
        "laws",
        "Room in the table for built-in laws and those of the user; an error says when it is full.",
    ),
    # formats
    "LATIN_STATE_FORMAT": ("version", "Changes with the format of a state; files of other versions are refused."),
    "LATIN_STATE_HEAD": ("bytes", "HDF5 looks for its own head behind 512 bytes; ours takes less."),
    "LATIN_STATE_CHUNK": ("bytes", "Read at once for the sum of a file."),
    "LATIN_STATE_ITEMS": ("items", "More than any rank has; an assertion counts them."),
    "LATIN_STATE_LINES": ("lines", "Members of the head, counted by the compiler."),
}
