"""The constants of the C code that trade no iterations, for constants.py."""

from constants_factors import FACTORS
from constants_interior import INTERIOR
from constants_large import LARGE

#: Constants that trade nothing, or time and memory alone: unit, and why this value.
OTHERS = {
    # load cases side by side
    "LATIN_FRONT_LANES": (
        "right-hand sides",
        "Single precision fills a vector register of 512 bits; 32 cost as much a case, and more wait for the last.",
    ),
    "LATIN_CASE_SAFETY": (
        "times the correction",
        "The largest error of 5,042 cases of 76 scenes was half the one asked for; with a half of it 1 of 3,763"
        " was 1.3 times that, with an eighth 9 of 494 were up to 4.4 times.",
    ),
    "LATIN_KERNEL_LEFT": (
        "of the largest diagonal entry",
        "Rounding leaves 1e-12 of a kernel; a vector that is none leaves 1e-2 and more where all unknowns are alike.",
    ),
    "LATIN_CASE_PAST": (
        "stages",
        "Conjugate gradients go by leaps of a few stages; of the rates since any stage before them the slowest counts:"
        " that of the last ones alone says less of soft modes.",
    ),
    "LATIN_SELF_STRESS": (
        "times eps, of the tensions",
        "1,985 random self-stresses leave at most 4 at nodes, domes and wheels of up to 38 sectors 8.",
    ),
    "LATIN_CASE_RATE": ("of a stage", "As `LATIN_ESTIMATE_RATE`."),
    "LATIN_UNBALANCE_ROUNDING": (
        "of the loads",
        "Two of 3,000 structures with rigid links or friction move millions of times farther than they are large, and "
        "are wrong and called right without. 10 in single precision: of 17,000 structures some 300 lie between 1 and"
        " 10, none wrong; without a bound 8 of 9,900 are wrong, from 90 on. 1e-2 refuses grids of 8 modules a side and"
        " more, which are right to 1e-6.",
    ),
    "LATIN_STEP_ERROR": (
        "times the indicator",
        "Of 800 structures with rigid links 35 are claimed and wrong by `-snes_stol 1e-5` alone, with 2 to 10 these are"
        " 5, with 50 6. With 2 packings take up to a third more stages; other scenes and presets as many as without.",
    ),
    "LATIN_CASE_TIGHT": (
        "of the loads",
        "Of 600 structures next to collapse, four equal cases each, 3 are wrong and called right with 1e-2.",
    ),
    "LATIN_CASE_STAGES": (
        "stages of a case",
        "More, and Newton's method with operators of its own takes fewer: of 5,042 cases the longest took 96.",
    ),
    # rounding
    "LATIN_NOISE": (
        "of the energy norm",
        "A distance of the two stages below it is rounding: about 45 eps, less than any stop in use.",
    ),
    "LATIN_MECHANISM": (
        "of the diagonal",
        "A stiffness below it is rounding: 45 eps, as a factor of so few digits is no factor.",
    ),
    "LATIN_NEWTON_FLOOR_GREATEST": (
        "of the greatest stiffness",
        "What a slack link keeps must be more than a mechanism, or the factorisation stops: three times as much. After "
        "a failed solve of the interior-point method: without it 15 of 16 packings of spheres of different stiffness, "
        "half of them rigid, fail; with it from the start two of 190 packings and nets fail that converge without it.",
    ),
    "LATIN_DIGITS_FLOOR": (
        "of the least stiffness",
        "As `LATIN_NEWTON_FLOOR`, for the solves that count digits: no mechanism ends them.",
    ),
    "LATIN_DIGITS_UNIT": ("relative", "The unit roundoff: half the distance of two numbers."),
    "LATIN_FORCE_NOISE": (
        "eps, of the forces at a node",
        "The forces at a node are a sum of tens of rounded terms. With 64 two of 2,500 structures next to collapse are "
        "wrong and called right, with 8 none; no more are refused.",
    ),
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
    "LATIN_METIS_ALONE": (
        "links",
        "Beside the 126 MB that Python and a small part take, the graph of so many takes 94 MB on one rank.",
    ),
    "LATIN_METIS_RANKS": (
        "ranks",
        "Grids of 284 and 400 modules on 8 ranks: METIS on one rank takes 0.3 of 7 s of the set-up, PT-Scotch 1.6 "
        "of 8; the largest rank 260 and 439 MB, with either. On 16 ranks 363 MB beside 264.",
    ),
    "LATIN_REPAIR_HUB": (
        "links",
        "Wheels of 8,000 spokes on 4 ranks: the repair takes 3.4 s if they move one by one, 0.5 s if not.",
    ),
    "LATIN_REPAIR_REACH": (
        "nodes",
        "A way round a node leads through neighbours of neighbours, some tens of nodes; longer ones do not count.",
    ),
    "LATIN_GROUP_PIVOT": (
        "of the diagonal",
        "A pivot below it may be a mechanism: 1e3 times `LATIN_MECHANISM`; the coarse solver decides.",
    ),
    "LATIN_MATRIX_ASYMMETRY": (
        "of the largest entries",
        "Assembly in another order leaves 1e-15; a matrix that is not symmetric differs by more than half of "
        "the digits.",
    ),
    "LATIN_RESIDUAL_NOISE": (
        "eps, of x",
        "A smaller b - A x is rounding; matrices of the robustness suite whose solution is right leave up to 9.",
    ),
    "LATIN_HASH": ("", "2^32 over the golden ratio, for signs without a pattern."),
    "LATIN_LOCAL_TILE": ("rows", "A cache line of a dense matrix that is compared with its transpose."),
    "LATIN_REFINE_GAIN": (
        "of b - A x",
        "A pass of KSP latin that leaves more has met rounding; one that has not leaves 1e-5 or less.",
    ),
    "LATIN_DIRECTION_RANGE": (
        "of the interface stiffness",
        "Of the grid, regular and cut, with each direction: 1e8 and 1e-8 solve, 1e30 and 1e-30 look like a mechanism.",
    ),
    "LATIN_GUESS_ROUNDING": (
        "eps, of the forces of the copies",
        "Interface forces of a guess are sums of tens of rounded terms: what they may leave to pass on.",
    ),
    "LATIN_OUTER_DEPTH": ("states", "The default of `-snes_anderson_m`: so many, and as many residuals, go at once."),
    # bounds that are not met
    "LATIN_GUESS_MOST": (
        "iterations",
        "One for each number of copies of a node and pattern of its interfaces: 2 on the grid and networks.",
    ),
    "LATIN_FAR": ("m", "A strain beyond every gap, whose square is a number still."),
    "LATIN_ROOT_MOST": (
        "steps",
        "A bound that no link meets: Newton's method in a bracket takes 2 on average, 20 at most.",
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
    **FACTORS,
    "LATIN_INVERSE_FIRM": (
        "`LATIN_MECHANISM`",
        "One step of inverse iteration shows a mechanism more clearly than this; ordinary structures end after it.",
    ),
    "LATIN_SCALE_FAR": (
        "ratio",
        "Loads of another magnitude get other search parameters; with those of no loads 10,000 stages do not suffice.",
    ),
    "LATIN_PARAMETER_WINDOW": (
        "linear stages",
        "As many as between two restarts of Anderson's acceleration; girders of contrast 1e4 to 1e8 then take 10 more.",
    ),
    "LATIN_PARAMETER_RANGE": (
        "the first parameter",
        "Bars of contrast 1e8 beside rigid links need 1e8; an arch of thickness 0.08, which falls, asks for ever less.",
    ),
    "LATIN_HELD_NOISE": (
        "eps, of prescribed displacements and gap",
        "Three sums: 3 times eps at most. A contact that is closed by what is prescribed is held to rounding.",
    ),
    "LATIN_LEAST": ("N, m", "Squares of less lose digits, and vanish below 1e-162: not converged."),
    "LATIN_ERROR": ("relative", "The default of -snes_latin_error: less than drawings and stiffnesses are known to."),
    "LATIN_STOL": ("indicator", "The default of -snes_stol; another value makes auto stop on the indicator."),
    "LATIN_PENALTY": (
        "search parameter",
        "Springs for rigid links, at first: net 20 and 30 take 5 to 7 problems; 1e40 at once is the exact judge's.",
    ),
    "LATIN_PENALTY_GROWS": (
        "ratio",
        "100 makes net 20 take twice the steps; without growth its tensions creep for 30 problems and more.",
    ),
    "LATIN_PENALTY_MOST": (
        "search parameter",
        "Seven digits are left for what soft links bear; more made a random structure fail beside links of 1e-4 N/m.",
    ),
    "LATIN_MULTIPLIER_TIMES": ("problems", "A bound that solvable structures do not meet: net 30 takes 6."),
    "LATIN_COLLAPSE_WINDOW": (
        "linear stages",
        "One of many looks at balance that a collapse takes; of 80 arches beyond their limit 78 end before all stages.",
    ),
    "LATIN_ESTIMATE_NOISE": (
        "eps, of the forces at a node",
        "Tensions of rigid links are a sum of tens of rounded terms.",
    ),
    "LATIN_COLLAPSE_STEPS": ("steps", "A bound: what is found takes 3 to 31 steps."),
    "LATIN_COLLAPSE_REGULARISATION": (
        "of the metric",
        "With 1e-8 bars and taut cables that work together are met slowly: a network of 19,000 unknowns takes no end.",
    ),
    "LATIN_COLLAPSE_ROUNDING": ("eps", "The displacements of both ends, in three components, and their differences."),
    "LATIN_COLLAPSE_TENSION": (
        "tensions of bars",
        "Forces of such tensions round to a millionth of the loads; beyond 1e12 no solution has four digits.",
    ),
    "LATIN_COLLAPSE_HELD": (
        "displacements of bars",
        "A push of the loads that is less is next to collapse, where Newton's method decides: half of the digits.",
    ),
    "LATIN_LOOSE_FAR": (
        "size of the structure",
        "Where a node without equilibrium is drawn: any number well above one.",
    ),
    "LATIN_LOOSE_LINKS": ("of a node", "Room: networks have 20 at most."),
    "LATIN_PATCH_NODES": (
        "of a patch",
        "A node of a network of 7,000 and its neighbours are 9.5 on average, 17 at most; of a grid 9.9 and 13.",
    ),
    "LATIN_PATCH_LINKS": ("at a patch", "Room: patches of networks and grids have 104 and 108 at most."),
    "LATIN_CONE_SPAN": (
        "of a row",
        "A row that others make up to half of the digits adds nothing that they do not bear.",
    ),
    "LATIN_CONE_RESIDUAL": ("of the load", "Less leaves a proof, with tensions of 1e10 those of bars, no digit."),
    "LATIN_CONE_SIGN": ("of the load", "Products of 96 rounded terms: an unknown less than that has no sign."),
    "LATIN_CONE_CHANGES": ("times the links", "A bound on a method that comes to its end by itself but for rounding."),
    "LATIN_COLLAPSE_START": (
        "of bars",
        "Five networks and two grids take 14 to 28 steps, with 1 they take 13 to 41, with 100 16 to 24.",
    ),
    "LATIN_NEWTON_FULL": (
        "steps",
        "Search from the start loses six of 500 random motions. With laws of the user, which yield, 12 lose 20 of 400.",
    ),
    "LATIN_SEARCH_TOLERANCE": (
        "of the first slope",
        "Links that yield: 1e-3 stalls between kinks, which refuses five more of 2,000 random structures.",
    ),
    "LATIN_NEWTON_SLOW": (
        "steps",
        "Four such networks are refused in 55 to 470 ms, with 12 in 84 to 650; solvable ones take what they took.",
    ),
    "LATIN_NEWTON_AFTER": (
        "linear stages",
        "Where there is no proof: a network of 19,008 unknowns took 135 s with 10,000, 80 s with 1,000.",
    ),
    "LATIN_NEWTON_OWN": (
        "unknowns",
        "Of 3,000 structures next to collapse 8 are wrong and called right without, 1 with. A lattice of 561 nodes "
        "takes 7 stages in the place of 9 and twice the time, 13 ms; larger structures pay the same share for less.",
    ),
    "LATIN_PETSC_DIVTOL": ("ratio", "PETSc's own default, for a SNES that leaves TS latin."),
    "LATIN_NEWTON_SAFETY_MOST": (
        "ratio",
        "A bound on the digits asked of linear solves, beside the target of 1e-4 their rounding.",
    ),
    "LATIN_NEWTON_FAR": (
        "of the loads",
        "Of 1,500 structures next to collapse three, without equilibrium, which moved farther than they are large, "
        "were called right.",
    ),
    "LATIN_NEWTON_REST": ("relative", "Rounding of displacements: links that such a step changes are just taut."),
    "LATIN_CORRECTION_SAFETY": (
        "ratio",
        "Without it estimates of tensions are 0.3 to 1 times the true error; with 2, 6 % of 200 are below it.",
    ),
    "LATIN_SEARCH_GROWS": ("ratio", "Lengths to try are few with 8: thirteen to the longest."),
    "LATIN_SEARCH_FAR": ("times the step", "Farther, rounding of the step is larger than the displacements."),
    "LATIN_ESTIMATE_FIRST": (
        "iterates",
        "Two show no rate. With three, rigid links started warm claimed 9e-6 where a motion was wrong by 6e-4.",
    ),
    "LATIN_ESTIMATE_MOVING": (
        "ratio",
        "Of 1,200 motions one step was wrong by 2.5e-3 without; of 1,400 with it the worst is 1e-5. A packing that "
        "settles takes 3 % more stages, a grid on stops 18 %.",
    ),
    "LATIN_PUSH": (
        "of the loads",
        "Rounding of a node without load is 1e-16 of them, a load 1e-6 beyond collapse pushes by more than 1e-9.",
    ),
    "LATIN_FLOOR_GROWS": (
        "ratio",
        "Three of 3,000 random structures have taut links that are a mechanism to rounding.",
    ),
    "LATIN_FLOOR_TIMES": ("times", "Nine digits: more, and slack links bear what taut ones should."),
    "LATIN_ROUNDED_CONTRACTION": (
        "energy",
        "tensegrity-grid 200 1e-3, 13 stages in either precision; network 20000 3e-5; truss of 1000 bays 0.03. PC "
        "latin, elasticity 24^3 1e-6, cubes beside others 1e6 times as stiff 2e-5; the softest coarse "
        "displacement, 0.03 and 3e-8, separates these: bars of 2000 x 4 x 4 cells, 1e-8, take 14 iterations in "
        "single precision, 10 in double.",
    ),
    "LATIN_SINGLE_ENTRIES": (
        "entries",
        "network 1000 10 ms, tensegrity-grid 24 20 ms either way; network 2000 40 -> 30 ms, 4000 120 -> 80 ms.",
    ),
    "LATIN_REPEATS": (
        "subdomains",
        "tensegrity-grid 48 in 16 blocks, 4 for each different one: primal 0.24, corner 0.26 s; in 64 0.14, 0.12 s.",
    ),
    "LATIN_GROUPS": (
        "subdomains a side",
        "Of 2, 3, 4 and 6 the least set-up and memory. Without groups tensegrity-grid 200 in 2500 blocks: set-up "
        "0.60 -> 0.80 s, stages 36 -> 41 ms, 646 -> 710 MB.",
    ),
    "LATIN_GROUP_FULL": ("subdomains", "LATIN_GROUPS in each of three directions."),
    "LATIN_GROUP_CELLS": (
        "cells a side",
        "A grid that finds groups of any structure: 3^8 subdomains a side are fewer.",
    ),
    "LATIN_GROUP_INTERIOR": (
        "rows",
        "A dense factor of 1536 rows has 19 MB and takes 1.2 Gflop; a sparse one of a larger group does less work.",
    ),
    "LATIN_COARSE_KEPT": ("rows", "18 MB: products that monitors show are worth more than this memory."),
    "LATIN_COARSE_CONTRACTION": (
        "relative energy",
        "The next stage corrects it, or conjugate gradients of Newton's method. Second level, 4 ranks, 0.01 and 0.1: "
        "network 8000 29 and 28 stages, 223 and 129 steps; METIS grid of 48 18 and 19, 75 and 42; METIS grid of 200 on "
        "8 ranks 22 and 22, 204 and 138.",
    ),
    "LATIN_SPECTRAL_FACE": (
        "relative",
        "Second level, METIS grid of 200 on 8 ranks: 0.1, 0.2, 0.33 and 0.5 leave 142, 170, 195 and 227 unknowns "
        "and take 100, 68, 64 and 57 steps; of 140 on 16: 372, 435, 502 and 570, 96, 75, 61 and 56.",
    ),
    "LATIN_SPECTRAL_FACE_SIZE": (
        "of its norm",
        "Second level, METIS grid of 200 on 8 ranks, LATIN_SPECTRAL_FACE 0.2: 0.1, 0.01 and 0.0001 leave 136, 167 and "
        "170 unknowns and take 96, 76 and 68 steps; of 140 on 16: 88, 75 and 75 steps.",
    ),
    "LATIN_TREE_STAGES": (
        "solves",
        "Linear stages for each set-up: METIS grids on 8 ranks take 22 to 24, blocks 47 to 50.",
    ),
    "LATIN_TREE_RATE": ("operations/s", "Dense blocks on one core; only the choice depends on it."),
    "LATIN_TREE_BANDWIDTH": ("bytes/s", "A core that reads a factor; only the choice depends on it."),
    "LATIN_TREE_LATENCY": (
        "s",
        "Of a message on a network, as in benchmarks/parts.md; only the choice depends on it.",
    ),
    "LATIN_TREE_MESSAGES": (
        "messages",
        "MUMPS, messages a solve of the busiest rank: 18 to 55 on 4 ranks, 40 to 88 on 8. Ten for each doubling "
        "are no more than that.",
    ),
    "LATIN_TREE_SHARE": (
        "of the ranks",
        "MUMPS, operations of all over P times those of the busiest rank: METIS grids of 100 and 200 on 2, 4 and 8 "
        "ranks 0.46 to 0.65, before ranks wait for each other. METIS grid of 200, 8 ranks, processor time of set-up "
        "and solve: 7.8 s with it, 6.1 s with the tree.",
    ),
    "LATIN_TREE_SURFACE": (
        "times the surface of a cube",
        "Of 64 cubes of a network on 2, 4 and 8 ranks 9, 28 and 38 % of the unknowns are shared, numbered at random "
        "61, 76 and 90 %; the bound is 47, 60 and 75 %. METIS grid of 40, 100 parts in the order of METIS on 4 ranks, "
        "80 %: set-up 0.43 -> 0.09 s. 512 cubes of elasticity on 8 ranks in eight colours, all: 57 -> 2 s.",
    ),
    "LATIN_TREE_LONGER": (
        "times",
        "METIS grids of 200, 284 and 400, 16 ranks: peak of the largest rank 159, 245 and 405 MB by the tree, 327, 579 "
        "and 975 by MUMPS; set-up of the slowest rank outside MPI, of the first two, 0.32 and 0.75 s, 0.60 and 1.65; "
        "of all ranks 3.2 and 10.3 s, 5.7 and 16.7. As joints come one after the other, 1.85, 1.41 and 1.31 times the "
        "time of MUMPS is predicted for the three.",
    ),
    "LATIN_HALVES_BALANCE": (
        "thousandths",
        "Network 20,000, METIS grid of 200 and lattice 300 x 200, three seeds each: halves differ by 2 % at most, "
        "interfaces of 461, 421 and 208 nodes; with METIS' default of 200 by 8 %, of 452, 403 and 201.",
    ),
    "LATIN_INVERSE_ROWS": ("rows", "The inverse has 2 MB, about a second-level cache."),
    "LATIN_INVERSE_RUN": (
        "subdomains",
        "The product of one inverse with eight vectors or more is arithmetic, with fewer it is memory traffic. "
        "Without inverses stages of lattice 256 x 128 take 3 to 9 % longer, of tensegrity-grid 200 "
        "4 %, of others as long.",
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
    "LATIN_SAME_MOST": ("settings", "The options of the method, which are checked in one reduction."),
    "LATIN_LISTED": ("nodes or links", "As many as an error message names."),
    # formats
    "LATIN_STATE_FORMAT": ("version", "Changes with the format of a state; files of other versions are refused."),
    "LATIN_STATE_HEAD": ("bytes", "HDF5 looks for its own head behind 512 bytes; ours takes less."),
    "LATIN_FILE_LINKS": ("links", "Symbolic links followed from a name to its file: as many as Linux follows."),
    "LATIN_FILE_NAME": ("letters", "Of a name, in that of the file being written: 9 more stay below the limit of 255."),
    "LATIN_STATE_CHUNK": ("bytes", "Read at once for the sum of a file."),
    "LATIN_STATE_KIND": ("numbers", "How operators have been made, and whether there is a last path."),
    "LATIN_STATE_ITEMS": ("items", "More than any rank has; an assertion counts them."),
    "LATIN_STATE_LINES": ("lines", "Members of the head, counted by the compiler."),
    "LATIN_GROUP_EDGE": (
        "of a cell",
        "Rounding puts no corner into the cell below; far more than eps, far less than a subdomain.",
    ),
    "LATIN_GROUP_REPEAT": (
        "of all groups",
        "Where more groups differ a sparse direct solver does the same elimination with less work.",
    ),
    "LATIN_MOVED_MOST": ("nodes", "What a rank looks at for a message."),
    "LATIN_CONTRAST": ("", "Of masses: a message on a failed step names it."),
    "LATIN_MOVED_NAMED": ("nodes", "What a message names."),
    "LATIN_MOVED_PART": (
        "of the largest displacement",
        "Nodes that a mechanism moves most; a share near neither 0 nor 1.",
    ),
    "LATIN_DOUBT": (
        "of the least stiffness",
        "Where rounding of the greatest stiffness is more, the message says that it may hide a link.",
    ),
    "LATIN_NODAL_PIECES": (
        "pieces",
        "An eighth of the nodes of 90,000 unknowns takes 1.3 MB, two vectors of displacements; only memory and time "
        "depend on it.",
    ),
    "LATIN_STICKS": ("of the greatest friction", "Below it a contact sticks; above, rounding may be why."),
    "LATIN_DIGITS_RTOL": ("of the residual", "An order of magnitude is enough."),
    "LATIN_DIGITS_MOST": ("iterations", "Ends a linear solve that does not converge."),
    "LATIN_DIRECTION_MATRIX": (
        "of the interface stiffness",
        "Springs only keep subdomains regular, which seldom have mechanisms.",
    ),
    "LATIN_DIRECTION_LINKS": ("of the interface stiffness", "The same of links, whose subdomains have mechanisms."),
    "LATIN_SPECTRAL_PRECONDITION": (
        "eigenvalue",
        "The threshold of PC latin beside jumps: random jumps of 1e6 take 8 iterations instead of 19.",
    ),
    "LATIN_SPECTRAL_THIN": (
        "thickness over extent",
        "Below, subdomains bend: a plate of 1/80 takes 7 iterations instead of 38, one of 1/40 7 instead of 19. At 1/7"
        " the set-up grows by more than the solve gains.",
    ),
    "LATIN_INTERFACE_NOISE": ("of the energy norm", "Rounding of interface data."),
    "LATIN_SAME_MATRIX": ("of a product", "Two products with one matrix differ by rounding alone."),
    "LATIN_SHIFT_GROWS": (
        "ratio",
        "From one shift to the next: 2 to 64 show a negative stiffness of the same 11 of 12 rows of pressed bars.",
    ),
    "LATIN_SHIFT_MOST": (
        "of the diagonal",
        "The last shift: 1 to 100 are no different on 12 rows of pressed bars, whose stiffnesses are down to -2.3.",
    ),
    "LATIN_INVERSE_STEPS": (
        "steps",
        "Of inverse iteration: 10 show a negative stiffness of 11 of 12 rows of pressed bars, 2 to 5 of 9, one of 6.",
    ),
    "LATIN_SHIFT": (
        "of the diagonal",
        "Makes a matrix regular that could not be factored, to find its softest displacement.",
    ),
    "LATIN_WEIGHT_LEAST": ("of the largest stiffness", "What a copy without stiffness counts, where no copy has any."),
    "LATIN_NEWTON_GAIN": ("of the error before", "A step that was to bring digits and leaves more has met rounding."),
    "TS_LATIN_ERROR": (
        "relative error of a step",
        "With 1e-4 the energy of a wheel of stiff bars changes by 1.5 % in 200 steps, with 1e-8 by 5e-7.",
    ),
} | LARGE
OTHERS |= INTERIOR
