"""The constants of latinpc/src: those that trade iterations or work, the scenes that count them, and the others."""

from dataclasses import dataclass


@dataclass
class Tuning:
    """What a constant is for."""

    unit: str  #: "" for a number or a ratio
    decides: str
    scenes: tuple  #: names in constant_scenes.py
    so: str = ""  #: why the value is what it is
    values: tuple | None = None  #: in place of a quarter, a half, twice and four times the value


STAGES = ("grid", "grid cut", "truss cut", "network", "lattice cut")
DIAGONAL = ("grid, diagonal", "grid cut, diagonal", "network, diagonal", "lattice cut, diagonal")
LOW = ("grid cut, low-energy modes", "network, low-energy modes", "lattice cut, low-energy modes")
CG = ("CG, truss-grid", "CG, truss-grid metis", "CG, lattice", "KSP latin, truss-grid", "KSP latin, truss-grid metis",
      "KSP latin, lattice")  # fmt: skip
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
EXTREMES = tuple(f"extremes, {suite}" for suite in ("catalogue", "rigid", "motions"))
HALF = (0.125, 0.25, 0.75, 0.95)

TUNING = {
    # interfaces
    "LATIN_STIFFNESS_FLOOR": Tuning(
        "of the diagonal",
        "foundation of SNES and KSP latin",
        (*STAGES, *CG[3:]),
        so="Fewest in all: half or twice the value costs a METIS cut or KSP latin 2 to 5 iterations.",
    ),
    "LATIN_STIFFNESS_SIDES": Tuning(
        "of the diagonal",
        "foundation of PC latin at interfaces",
        (*CG[:3], *JUMPS[:5]),
        so="Less costs iterations; more saves one of five on jumps, for 5 to 20 percent more coarse unknowns.",
    ),
    "LATIN_STIFFNESS_LEAST": Tuning(
        "of the mean",
        "least foundation of a dof that few links reach",
        (*STAGES, *DIAGONAL, *CG, "extremes, catalogue"),
        values=(0.00625, 0.025, 0.4, 1.6),
        so=(
            "From 1/16 to 4 times the value structures see nothing of it: it only has to be positive and small. "
            "The suite's cases at the extremes end otherwise either way."
        ),
    ),
    "LATIN_DIRECTION_FLOOR": Tuning(
        "of the mean",
        "least diagonal search direction",
        (*DIAGONAL, "MATIS inside 100", "MATIS random 1e+06", *CG, "extremes, catalogue"),
        values=(0.00625, 0.025, 0.4, 1.6),
        so="From 1/16 to 4 times nothing changes: it only has to be positive.",
    ),
    "LATIN_DIRECTION_SMALL": Tuning(
        "rows x rows on interfaces",
        "Schur complements as directions of a matrix",
        ("MATIS elasticity 40", "MATIS elasticity 64", "MATIS across 1e+06"),
        so=(
            "Schur complements save one iteration of eight; twice would save it at 64 cells a side as well, where"
            " they cost more."
        ),
    ),
    "LATIN_JUMP": Tuning(
        "ratio",
        "where coefficients jump",
        JUMPS,
        so="Half finds the same jumps. Twice misses those of 40 and takes 7 iterations in place of 4.",
    ),
    "LATIN_SPECTRAL_MOST": Tuning(
        "fields",
        "most low-energy fields of a subdomain",
        (*LOW, *JUMPS),
        so="More change nothing; fewer cost iterations of KSP latin.",
    ),
    "LATIN_SPECTRAL_SIZE": Tuning(
        "of its norm",
        "fields that the macro basis has already",
        (*LOW, *JUMPS),
        so="A compromise: half saves one iteration in ten for 2 to 15 percent more coarse unknowns.",
    ),
    "LATIN_SPECTRAL_SOFT": Tuning(
        "of the interface's stiffness",
        "springs that fields of a matrix are compared with",
        JUMPS,
        so=("A compromise: from 1 on nearly the whole interface is macro, and a direct solve is left of the method."),
    ),
    "LATIN_SPECTRAL_ITERATION": Tuning(
        "eigenvalue",
        "threshold of KSP latin on jumps",
        JUMPS[-2:],
        so="The same compromise: at twice the value nothing is left to iterate.",
    ),
    "LATIN_MODE_VISIBLE": Tuning(
        "of its norm",
        "macro modes kept on nodes of their interface",
        ("grid cut, coarse", "truss cut, coarse", "network, coarse", "lattice cut, coarse", "extremes, catalogue"),
        values=(6.25e-05, 0.00025, 0.004, 0.016),
        so="Nothing changes from 1/16 to 16 times: modes show on the nodes of their interface, or not at all.",
    ),
    # partition
    "LATIN_REPAIR_SOFT": Tuning(
        "link stiffnesses",
        "directions that links hold",
        PARTS,
        so=(
            "Half changes nothing, twice adds coarse unknowns on the network. Without the repair PC and KSP latin take "
            "22 and 24 iterations on the METIS truss, not 17 and 18."
        ),
    ),
    "LATIN_REPAIR_BALANCE": Tuning(
        "of the mean",
        "size of subdomains after repair",
        PARTS,
        values=(0.0625, 0.125, 0.5, 0.9),
        so="A narrower bound costs iterations; a wider one is not used.",
    ),
    "LATIN_METIS_SMALL": Tuning(
        "links a subdomain",
        "links or nodes as vertices of METIS",
        CRUMBS,
        so="With a quarter METIS leaves 27 of 89 subdomains empty; more brings an iteration at most.",
    ),
    "LATIN_SIZE_LINKS": Tuning(
        "links a subdomain",
        "subdomains on several ranks, but for the default of one a rank",
        ("two ranks, lattice", "two ranks, grid", "two ranks, network", "two ranks, network 2000"),
        so="The least work in all, of plane, flat and solid structures.",
    ),
    # the estimate
    "LATIN_ESTIMATE_ROWS": Tuning(
        "numbers",
        "size of a sketch",
        (*PROVED, *RATIOS),
        so="A sketch of a quarter gives the same stages; its distances are wrong by 9 percent in place of 4.",
    ),
    "LATIN_ESTIMATE_WINDOW": Tuning(
        "iterates",
        "longest past",
        (*PROVED, *RATIOS),
        so="A quarter forgets slow fields, and the estimate falls; a longer past changes nothing.",
    ),
    "LATIN_ESTIMATE_STEP": Tuning(
        "iterates",
        "step of the extrapolation",
        (*PROVED, *RATIOS, *SLACK),
        so="8 exaggerates less on grids, smaller values more on lattices; stages stay the same.",
    ),
    "LATIN_ESTIMATE_RATE": Tuning(
        "a stage of the extrapolation",
        "largest rate believed",
        (*PROVED, *RATIOS, *SLACK),
        values=(0.9, 0.95, 0.99, 0.995),
        so="Larger rates only exaggerate; smaller ones would hide a field that creeps.",
    ),
    "LATIN_ESTIMATE_EARLY": Tuning(
        "ratio",
        "caution at the first iterates",
        (*PROVED, *RATIOS),
        so="Half falls to 0.7 of the error on the METIS cut; twice costs a stage.",
    ),
    "LATIN_PROOF_EARLY": Tuning(
        "of the target",
        "when Newton's method proves the error",
        (*PROVED, *SLACK),
        so=(
            "Linear stages and iterations of Newton's method together are fewest from 2 to 8; at 16 an error is wrong."
        ),
    ),
    # Newton's method
    "LATIN_NEWTON_STAGES": Tuning(
        "linear stages",
        "stall: predicted stages",
        (*PROVED, *SLACK, *CONTRAST, *EXTREMES[:2]),
        so=(
            "Half and twice move the switch by a window or two, on three scenes; twice solves a case of the suite"
            " that is refused now."
        ),
    ),
    "LATIN_NEWTON_WINDOW": Tuning(
        "linear stages",
        "stall: window",
        (*PROVED, *SLACK, *CONTRAST, *EXTREMES[:2]),
        so=(
            "A compromise: half saves 30 linear stages on stalls and costs up to 64 iterations of Newton's "
            "method; twice costs 15 to 220 stages."
        ),
    ),
    "LATIN_NEWTON_CONTRAST": Tuning(
        "ratio of stiffnesses",
        "when a displacement at rest proves nothing",
        (*SLACK[2:], *CONTRAST, *EXTREMES),
        values=(1e2, 1e4, 1e8, 1e10),
        so=(
            "From 1e2 to 1e10 the suite takes 0.2 percent more or less, and nothing ends otherwise. By the indicator a "
            "network of which half is 1e6 or 1e10 times as stiff is claimed at an error of 2e-3 or 0.9 without."
        ),
    ),
    "LATIN_NEWTON_RTOL": Tuning(
        "of the residual",
        "linear solve while links change",
        (*PROVED, *SLACK, *CONTRAST, *EXTREMES[:2]),
        values=(0.000625, 0.0025, 0.04, 0.16),
        so="A share of 16 times or 1/16 changes 0.2 percent: where links change, the next solve is another one.",
    ),
    "LATIN_NEWTON_TIGHT": Tuning(
        "of the residual",
        "linear solve after a stall",
        (*PROVED, *SLACK, *CONTRAST, *EXTREMES),
        values=(1e-7, 1e-8, 1e-10, 1e-11),
        so="1e-8 saves a tenth of the iterations on stalls, and gives another verdict on one case of the suite.",
    ),
    "LATIN_NEWTON_PROOF": Tuning(
        "of the residual",
        "before it, no step is a measure",
        (*PROVED, *SLACK),
        values=HALF,
        so="Larger values save iterations, but miss the tolerance on the network.",
    ),
    "LATIN_NEWTON_FLOOR": Tuning(
        "of the least stiffness",
        "what a slack link keeps",
        (*SLACK, *CONTRAST, *UPLIFT, *EXTREMES),
        values=(1e-10, 1e-9, 1e-7, 1e-6),
        so="Larger values cost iterations; smaller ones save some, and other cases of rigid links are solved.",
    ),
    "LATIN_NEWTON_LINEAR": Tuning(
        "iterations",
        "most of a linear solve",
        (*SLACK, *CONTRAST, *UPLIFT, *EXTREMES[:2]),
        values=(31, 125, 2000, 8000),
        so="A quarter refuses two more cases of the suite; nothing needs more.",
    ),
    "LATIN_NEWTON_STEPS": Tuning(
        "steps",
        "most steps",
        (*SLACK, *CONTRAST, *UPLIFT, *EXTREMES[:2]),
        so=(
            "Half refuses a case with rigid links; twice solves one that is refused now, for twice the work where"
            " there is no equilibrium."
        ),
    ),
    # the equilibrium check
    "LATIN_FORCE_FACTOR": Tuning(
        "ratio",
        "error from unbalance",
        (*PROVED, *CONTRAST, *LOOSE, *JAMS, *MOTIONS, *EXTREMES),
        values=(0.625, 2.5, 40.0, 160.0),
        so=(
            "Four times the value refuses a right solution; 16 times costs 45 iterations on the network. A "
            "quarter accepts one case that is refused now."
        ),
    ),
    "LATIN_UNHELD": Tuning(
        "of the forces",
        "nodes that nothing holds",
        (*JAMS, *LOOSE, *UPLIFT, *EXTREMES),
        values=HALF,
        so="The share is 0 or 1: the middle.",
    ),
    "LATIN_WORK_LEFT": Tuning(
        "of the work",
        "free fall",
        (*UPLIFT, *LOOSE, *JAMS, *EXTREMES),
        values=HALF,
        so="The share is 0 at rest and 1 in free fall: the middle.",
    ),
    "LATIN_WORK_CANCELS": Tuning(
        "of the works",
        "works that cancel",
        (*UPLIFT, *LOOSE, *JAMS, "grid to 1e-04", "network to 1e-04", *EXTREMES),
        values=(0.001875, 0.0075, 0.12, 0.48),
        so="Nothing changes from 1/16 to 16 times; with 0 two motions of the suite are refused.",
    ),
    "LATIN_LOAD_LEFT": Tuning(
        "of the work",
        "loads along a mechanism",
        (*UPLIFT, *LOOSE, *EXTREMES),
        values=(0.00625, 0.025, 0.4, 0.9),
        so="Only 0.9 finds a mechanism later.",
    ),
    "LATIN_SOFT": Tuning(
        "of the softest link",
        "stiffness of a mechanism",
        (*UPLIFT, *LOOSE, *CONTRAST[:2], *EXTREMES),
        values=(1e-9, 1e-8, 1e-6, 1e-5),
        so=(
            "Nothing changes from 1e-9 to 1e-5, nor with 1e-3: mechanisms have rounding for a stiffness. Without this "
            "test 1 of 500 random rigid structures is refused after 10,000 stages, not 88."
        ),
    ),
    "LATIN_JAM_STAGES": Tuning(
        "damped stages",
        "when jammed links show",
        (*JAMS, EXTREMES[1]),
        values=(6, 25, 400, 1600),
        so="6 stages miss a jam, 25 find all.",
    ),
    "LATIN_JAM_LEAST": Tuning(
        "linear stages",
        "solves whose jams are looked for",
        (*JAMS, EXTREMES[1]),
        values=(6, 25, 400, 1600),
        so="Nothing changes: it spares solves of a few stages a search that takes more than they do.",
    ),
    # rigid links and motions
    "LATIN_RIGID_SMALL": Tuning(
        "of the spacing",
        "search parameter without gaps",
        GRANULAR,
        so="A unit: without gaps and elastic links all iterates scale with it, and stages stay the same.",
    ),
    "LATIN_RIGID_RUBS": Tuning(
        "ratio",
        "search parameter with friction",
        (*FRICTION, "discs with friction", "arch"),
        so=("Not the best: 0.2 takes a tenth fewer stages, on packings of other seeds, sizes and friction as well."),
    ),
    "LATIN_PARAMETER_OFF": Tuning(
        "ratio",
        "change beside elastic links",
        (*HUNG, "extremes, rigid"),
        so=(
            "Half saves 3 percent on the suite. Twice saves 5 and solves a case that is refused now. Without such "
            "changes 9 of 2,515 random structures with friction are lost and 3 others solved, which take a tenth more "
            "stages, and 2 of 1,487 rigid ones; `-snes_latin_newton never` diverges on girders 1e4 and 1e8 times as "
            "stiff, which take 42 stages with them."
        ),
    ),
    "LATIN_PARAMETER_AGAIN": Tuning(
        "times",
        "changes beside elastic links",
        (*HUNG, "extremes, rigid"),
        so=(
            "More change nothing; 2 costs 3 percent, 1 saves 5 and solves a case that is refused now. Of 4,967 random "
            "structures with friction 1 loses 6 and solves 2 others."
        ),
    ),
    "LATIN_STEP_CLOSED": Tuning(
        "of the flight",
        "contacts that are closed",
        (*MOTIONS, "extremes, motions"),
        values=(6.25e-06, 2.5e-05, 0.0004, 0.0016),
        so="Four times the value refuses two motions of the suite; less costs nothing to speak of.",
    ),
    # solvers
    "LATIN_INEXACT_RTOL": Tuning(
        "of the residual",
        "iterative solvers taken to be exact",
        ("grid cut, CG inside", "network, CG inside"),
        values=(1e-12, 1e-11, 1e-9, 1e-8),
        so="1e-9 gives the same stages; 1e-8 takes twice as many on the METIS cut.",
    ),
    "LATIN_BOUND_SPRINGS": Tuning(
        "ratio",
        "bound of the energy error",
        ("bound, truss", "bound, lattice", "bound, network"),
        so="A proof needs it, the figure does not depend on it: the residual that it multiplies is small.",
    ),
    "LATIN_DIGITS_SAMPLES": Tuning(
        "samples",
        "digits lost to rounding",
        ("rounding, grid", "rounding, network", "rounding, lattice"),
        so="One sample is right to a quarter, three to a tenth: enough for an order of magnitude.",
    ),
    "LATIN_DIGITS_SAFETY": Tuning(
        "ratio",
        "errors that rounding leaves",
        ("network to 1e-14", "contrast 1e+06 to 1e-10", "extremes, catalogue"),
        so="Twice the value refuses 1e-14 on a network that reaches it.",
    ),
}
