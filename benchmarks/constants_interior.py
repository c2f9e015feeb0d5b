"""The constants of the interior-point methods, for constants.py."""

#: As `constants_others.OTHERS`: unit, and why this value.
INTERIOR = {
    "LATIN_PRIMAL_DUAL_LENGTH": ("part of the way", "What interior-point methods take as a rule."),
    "LATIN_PRIMAL_DUAL_POWER": ("", "What interior-point methods take as a rule [S. Mehrotra]."),
    "LATIN_SLIP_LENGTH": (
        "part of the way",
        "Packings with friction 0.3 to 0.9, 60 of 1,000 to 6,500 contacts: solved 57 with 0.9, 58 with 0.95 and 0.8.",
    ),
    "LATIN_SLIP_POWER": (
        "",
        "Spheres in motion, 12 a side: with 3 a step in four is not found. After a lift it is 3: with 1 there as well "
        "94 of 120 packings are solved, else 109. Where the path of one turns back, that of the other may not.",
    ),
    "LATIN_SLIP_FOLLOWS": (
        "of the change",
        "With 1 pushes alternate in a packing of 20 discs a side; with 0.25 they take twice the steps.",
    ),
    "LATIN_NEWTON_GRAINS": (
        "links",
        "100,283 contacts with friction to an indicator of 3e-4: 31 s, with the interior-point method 84 s. It solves "
        "one of two packings of discs of 21,000 links, one of spheres of 30,000, and none of five of 28,000 to 60,000.",
    ),
    "LATIN_COULOMB_STEPS": (
        "steps",
        "A bound on lost time. 120 packings with friction 0.3 to 0.9: solved 109 in 200.",
    ),
    "LATIN_COULOMB_SHORT": ("of a step", "60 packings: solved 56 with 0.05, 57 with 0.1, 55 with 0.2."),
    "LATIN_COULOMB_PATIENCE": ("steps", "60 packings: solved 57 with 3 and 5, 56 with 10."),
    "LATIN_COULOMB_LIFT": (
        "",
        "Without lifts six of 736 random structures are not solved. With 100 or 10,000 fewer packings than with 1,000.",
    ),
    "LATIN_COULOMB_LONG": ("of a step", "120 packings: solved 101 with 0.1, 107 with 0.5."),
    "LATIN_COULOMB_SETTLED": ("", "60 packings: solved 58 with 0.05, 57 with 0.1 and 0.2."),
    "LATIN_COULOMB_REDUCED": ("", "Packings with which it was tried: solved 13 of 13 with 0.03, 0.1 and 0.3."),
    "LATIN_COULOMB_SETTLES": ("steps", "120 packings: solved 103 with 10, 107 with 20; 60: 54 with 40."),
    "LATIN_COULOMB_GAP_LEAST": ("of the work", "Packings of 20 discs a side converge to errors of 1e-10 with it."),
    "LATIN_COULOMB_LEAST": ("", "Without it a random structure with a self-stress comes to a halt off balance."),
    "LATIN_COULOMB_LESS": ("", "With 1 the tensions of a random structure with a self-stress creep for 200 steps."),
    "LATIN_COULOMB_CREEPS": ("steps", "They only confirm: the tensions do not change any more."),
    "LATIN_COULOMB_REFINED": ("solves", "With 1 a block held by friction misses balance by more than rounding."),
    "LATIN_COULOMB_FLOOR": (
        "of the search parameter",
        "The same 69: solved 50 with 0, 58 with 1e-10, 52 with less the nearer the solution is.",
    ),
    "LATIN_CONVEX_STEPS": ("steps", "A bound: packings of 1,000 to 80,000 rigid contacts take 15 to 58."),
    "LATIN_CONVEX_REGULARISATION": (
        "compliance of the search parameter",
        "From 1e-6 to 1e-4 packings of 20 to 120 discs a side take the same steps; with 1e-3 one of 80 does not"
        " converge, with 1e-12 none of rigid discs does.",
    ),
    "LATIN_CONVEX_GAP": (
        "of the work",
        "At 1e-8 the contacts that bear are not all known in a packing of 120 rigid discs a side, and Newton's method"
        " fails; the last steps each gain one to two digits.",
    ),
}
