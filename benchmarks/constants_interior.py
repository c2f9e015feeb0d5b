"""The constants of the interior-point methods and of the search for slides without end, for constants.py."""

#: As `constants_others.OTHERS`: unit, and why this value.
INTERIOR = {
    "LATIN_PRIMAL_DUAL_LENGTH": ("part of the way", "What interior-point methods take as a rule."),
    "LATIN_PRIMAL_DUAL_GROWS": (
        "ratio",
        "Without growth 9 of 3,000 random structures next to collapse are a mechanism to rounding, and 4 of 33 packings"
        " of 8 to 80 grains a side take up to 10,000 iterations. With 10 the packings take as long.",
    ),
    "LATIN_PRIMAL_DUAL_POWER": ("", "What interior-point methods take as a rule [S. Mehrotra]."),
    "LATIN_PRIMAL_DUAL_RISE": (
        "of the mean product",
        "Motions of 20 and 24 discs a side with friction, eight of 40 steps: with 2 all are found, 10: seven, without "
        "it six, in up to 1.5 times the stages. 80 discs a side, friction 0.6, seed 1: 277 steps; without, none in "
        "3,000 stages.",
    ),
    "LATIN_SLIP_LENGTH": (
        "part of the way",
        "Packings with friction, 31 of 400 to 4,000 contacts, with lifts alone: solved 29 with 0.9, 26 with 0.7, 23 "
        "with 0.99. That it grows with the reduction of the mean product saves three to four steps of each.",
    ),
    "LATIN_SLIP_INSIDE": (
        "of X.S",
        "Motion of spheres, 12 a side, friction 0.9: without it step 6 is not found in 1,000 steps; with it eight "
        "steps take at most 393 stages. If contacts move after long steps as well, 265, and discs, 100 a side, "
        "friction 0.3, make 40 steps, not 14; but packings at rest do not reach errors of 1e-9.",
    ),
    "LATIN_SLIP_POWER": (
        "",
        "Spheres in motion, 12 a side: with 3 a step in four is not found.",
    ),
    "LATIN_SLIP_FOLLOW": ("", "50 packings: solved 46 with 1, 49 with 3."),
    "LATIN_NEWTON_GRAINS": (
        "links",
        "100,283 contacts with friction to an indicator of 3e-4: 31 s, with the interior-point method 84 s. It solves "
        "one of two packings of discs of 21,000 links, one of spheres of 30,000, and none of five of 28,000 to 60,000.",
    ),
    "LATIN_COULOMB_STEPS": (
        "steps",
        "120 packings: 117 end in 240 steps, one in 730, one fails, and one is left to the iteration.",
    ),
    "LATIN_SLIP_SHORT": (
        "of a step",
        "50 packings: solved 49 with 0.03 and 0.1, 48 with 0.3, in a third more stages.",
    ),
    "LATIN_COULOMB_LONG": (
        "of a step",
        "50 packings: solved 48 with 0.3, in a quarter more stages, 49 with 0.5 and 0.8.",
    ),
    "LATIN_COULOMB_PATIENCE": (
        "steps",
        "Motions of spheres, friction 0.6 and 0.9: with 1 three of six fail, with 3 none. Of 50 packings 50 and 49.",
    ),
    "LATIN_COULOMB_PACE": ("", "50 packings, patience 1: solved 50 with 1, 49 with 0.25 and with 4."),
    "LATIN_COULOMB_SLOWER": (
        "ratio",
        "50 packings, patience 1: solved 50 with 0.5, 49 with 0.25, in 1.4 times the stages.",
    ),
    "LATIN_COULOMB_FASTER": ("ratio", "50 packings: solved 49 with 1.5 and 2."),
    "LATIN_COULOMB_FASTEST": ("", "50 packings: solved 45 with 5, 49 with 20."),
    "LATIN_COULOMB_GAP_LEAST": ("of the work", "Packings of 20 discs a side converge to errors of 1e-10 with it."),
    "LATIN_COULOMB_LEAST": ("", "Without it a random structure with a self-stress comes to a halt off balance."),
    "LATIN_COULOMB_CREEPS": ("steps", "They only confirm: the tensions do not change any more."),
    "LATIN_COULOMB_REFINED": ("solves", "With 1 a block held by friction misses balance by more than rounding."),
    "LATIN_COULOMB_FLOOR": (
        "of the search parameter",
        "69 packings, with lifts alone: solved 50 with 0, 58 with 1e-10, 52 with less the nearer the solution is.",
    ),
    "LATIN_CONVEX_STEPS": ("steps", "A bound: packings of 1,000 to 80,000 rigid contacts take 15 to 58."),
    "LATIN_CONVEX_REGULARISATION": (
        "compliance of the search parameter",
        "`net --side 200` takes 91 s with 1e-5, as tensions creep in the method of multipliers, and 21 s with 1e-7;"
        " with friction the tensions of a random structure with a self-stress creep for 200 steps with 1e-5. With"
        " 1e-8 spheres in motion take 220 stages per time step, not 150, most of them for contacts without force.",
    ),
    "LATIN_CONVEX_GAP": (
        "of the work",
        "At 1e-8 the contacts that bear are not all known in a packing of 120 rigid discs a side, and Newton's method"
        " fails; the last steps each gain one to two digits.",
    ),
    "LATIN_SLIDES_MOST": (
        "stages",
        "A bound: of 48 columns of blocks that slide the slowest takes 4,000. Gravel cycles, which idle windows end.",
    ),
    "LATIN_SLIDES_WINDOW": (
        "stages",
        "50 and 200 find the same slides of 90 walls, columns and wedges, in 0.98 and 1.05 times the stages.",
    ),
    "LATIN_SLIDES_IDLE": ("windows", "With 10 a wall that slides is given up, which 15 and 20 find."),
    "LATIN_SLIDES_DAMP": (
        "of a step",
        "0.5 and 0.9 take 0.91 and 1.0 times the stages of 48 slides; with 0.9 a wedge cycles, "
        "with 0.5 walls take longer.",
    ),
    "LATIN_SLIDES_EXACT": (
        "relative, per stage",
        "Without leaps 4 of 12 columns with gaps of 1 cm are not found, and 4 take 1.7 to 3.4 times the stages; "
        "with 1e-8 a wall is not found.",
    ),
    "LATIN_SLIDES_SAME": ("relative", "0.01 finds the same slides in 1.01 times the stages."),
    "LATIN_SLIDES_LEAP": ("stages", "A bound: slides cross the structure in 1e4 to 1e8."),
    "LATIN_SLIDES_ALONG": (
        "cosine",
        "Without extrapolation 88 slides take 1.19 times the stages, and 7 of 48 columns are not found.",
    ),
    "LATIN_SLIDES_SLOW": ("ratio", "A bound: more extrapolates noise, over more than a hundred windows."),
    "LATIN_SLIDES_AFTER": (
        "linear stages",
        "With 0 one of 1,371 solves is refused that converges, and those without a solution take "
        "two thirds of the stages.",
    ),
}
