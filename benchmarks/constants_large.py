"""The constants of large displacements that trade no iterations, for constants.py."""

#: As `constants_others.OTHERS`: unit, and why this value.
LARGE = {
    "LATIN_FRAME_FLAT": ("squares of extents", "Extents below 1e-6 of the largest make a plane, or a line."),
    "LATIN_FRAME_POINT": ("times eps, of the coordinates", "Extents below are those of one point."),
    "LATIN_FRAME_FIRST": (
        "times tau / R",
        "c as drawn: nets that sag by 7 to 15 % of their span take 11 to 16 stages with 4, up to 26 with 1 and 16.",
    ),
    "LATIN_FRAME_LEAST": (
        "of the mean c",
        "The least c: 0.1 to 0.3 are level on seven saddles, 0.03 takes a tenth more stages.",
    ),
    "LATIN_FRAME_SLACK": (
        "of the mean c",
        "k of slack cables: on seven saddles 1 takes a tenth more stages, 7 a quarter.",
    ),
    "LATIN_FRAME_NEAR": (
        "of the mean c",
        "Nearly slack cables: with 0.02 saddles take three times as many stages, with 0.3 a few more.",
    ),
    "LATIN_FRAME_FLOOR": (
        "of the mean c",
        "What slack cables keep in the tangent, so that it can be factored; 1e-3 misses an error of 1e-9 on one net.",
    ),
    "LATIN_FRAME_STRUT": (
        "times -tau / R",
        "With 1 the length of a strut in the local stage is not unique: twice as much.",
    ),
    "LATIN_FRAME_PENALTY": (
        "times the stiffness beside it",
        "Inextensible cables, at first: nets of 112 take 402, 324, 221 stages; with 1 465, 384, 324; 1000 fails.",
    ),
    "LATIN_MIDPOINT_NOISE": (
        "eps, of the energies of a link",
        "The mean of two tensions has no cancellation: without it a net at 1e-5 m/s fails.",
    ),
    "LATIN_LARGE_PENALTY_GROWS": ("ratio", "Without growth one of three nets takes twice the stages."),
    "LATIN_LARGE_PENALTY_SLOW": (
        "ratio",
        "With 2 a chain of 20 links takes four times the stages, with 10 a flat net fails.",
    ),
    "LATIN_LARGE_PENALTY_MOST": (
        "times the first penalty",
        "With 1e4 a net of variant published takes no end, with 1e3 1106 stages, with 1e2 648.",
    ),
    "LATIN_LARGE_PENALTY_TIMES": (
        "solves",
        "A bound that structures with a solution do not meet: chains and nets take 3 to 16.",
    ),
    "LATIN_LARGE_PENALTY_LEFT": (
        "times the last change of tensions",
        "A change that falls more slowly is rounding: without it a net next to a jam is refused "
        "(tests/test_large_laws.py).",
    ),
    "LATIN_LARGE_PENALTY_NEAR": (
        "times the mean tension over length",
        "With 1e4 4 of 8 nets of 2,000 to 4,000 unknowns do not converge from there, with 1e5 all 8.",
    ),
    "LATIN_FRAME_LOWEST": (
        "of the mean stiffness",
        "The least mean c: times `LATIN_FRAME_FLOOR` it is still a hundred times what a mechanism is to rounding.",
    ),
    "LATIN_FRAME_NONE": ("of the mean stiffness", "c where nothing is taut: any that keeps the operators regular."),
    "LATIN_LARGE_NEAR": (
        "of the displacements",
        "Where Newton's method starts: 16 nets take 492 stages, 74 set-ups, with 1e-3 562, 81, with 5e-2 329, 93.",
    ),
    "LATIN_LARGE_FAR": (
        "of the error",
        "Where it has failed it waits for two digits more: with 0.1 a net in the wind takes 14 set-ups, not 9.",
    ),
    "LATIN_LARGE_WINDOW": ("linear stages", "With 12 saddles take a few stages more, with 6 progress does not show."),
    "LATIN_LARGE_GROW": (
        "times",
        "With 1 random saddles take half as many set-ups again, with 4 saddles of 30 to 100 meshes twice the stages.",
    ),
    "LATIN_LARGE_COST": (
        "linear stages",
        "What a set-up takes in time steps, whose operators serve later ones, and with other local solvers.",
    ),
    "LATIN_LARGE_FIXED": (
        "linear stages",
        "Measured 7, 10, 12 to 18 on saddles of 60, 100, 300 meshes; 2 and 8 make 20 scenes no faster.",
    ),
    "LATIN_LARGE_RATE": (
        "linear stages",
        "Saddles of 60 and 100 meshes take 140 and 630 ms, with 30 for all 180 and 730; 0.15: one of 300 creeps.",
    ),
    "LATIN_LARGE_REST": ("", "Some way above 5e-13, where the indicator of the mast and the tower comes to rest."),
    "LATIN_LARGE_PATIENCE": (
        "stages",
        "Of steps that never converge; of those of 0.03 to 100 s of six scenes two are lost.",
    ),
    "LATIN_LARGE_IDLE": ("stages", "They only confirm: each tenth of the indicator takes 2 to 5."),
    "LATIN_LARGE_STAGNATION": (
        "set-ups",
        "Without it nets of 60 and 100 meshes in the wind take 19 and 24 set-ups, not 10 and 9; with 2 more stages. ",
    ),
    "LATIN_LARGE_CREEPS": (
        "of the forces before",
        "With 1 grids of 5 to 9 modules take 305 set-ups, not 280; with 0.5 a link that tightens ends a path.",
    ),
    "LATIN_LARGE_MOST": (
        "set-ups",
        "Ends Newton's method where it creeps; after the iteration it needs 1 to 11, along a path up to 30.",
    ),
    "LATIN_LARGE_STEPS": ("steps", "Ends Newton's method where it does not converge."),
    "LATIN_LARGE_RTOL": ("of the residual", "Two digits a step; less is lost to the next one."),
    "LATIN_LARGE_LONG": (
        "linear stages",
        "New operators for Newton's method: with 5 nets with weak interfaces fail, and flat nets take two set-ups.",
    ),
    "LATIN_LARGE_STALE": (
        "of a set-up",
        "20 bridges, towers, masts take 17,800 stages and 3.0 s; with 1 17,500 and 3.5 s, with 0.25 8,500 and 3.2 s.",
    ),
    "LATIN_LARGE_FINER": (
        "of LATIN_LARGE_RTOL",
        "With 1 a mast at 0.9993 of the load that buckles it is not solved.",
    ),
    "LATIN_LARGE_HOLD": (
        "of the step",
        "What holds slack cables: with 0.1 and 1 masts take up to a third more stages, without it some fail.",
    ),
    "LATIN_LARGE_HELD": (
        "of the step",
        "The same after the iteration: saddles of 200 and 300 meshes take 40 stages, with 0.01 74 and 269.",
    ),
    "LATIN_LARGE_CHANGES": (
        "links",
        "16 nets take 74 set-ups and 434 iterations of linear solves, with 50 82 and 395, with 30 84 and 317.",
    ),
    "LATIN_LARGE_STEP": (
        "of the displacements",
        "With 1 a bridge takes twice the set-ups; without it a truss comes to rest beyond its snap.",
    ),
    "LATIN_LARGE_SAFETY": (
        "times",
        "Of 29 scenes at 1e-4 no claim was wrong; where cables change next the estimate is up to 20 times too small.",
    ),
    "LATIN_LARGE_PROOF": (
        "times the target",
        "Larger steps are not worth a linear stage that shows what they leave: with 1e30 a tenth more stages.",
    ),
    "LATIN_LARGE_LEAST": (
        "iterations",
        "With 1 a tower claimed a fiftieth of its error, far below the one asked for; with 6 a tenth more stages.",
    ),
    "LATIN_LARGE_SHRINK": ("of the error before", "As `LATIN_NEWTON_GAIN`."),
    "LATIN_LARGE_ROUND": (
        "times rounding",
        "Steps that do not shrink any more meet rounding, as far as its estimate goes: one digit.",
    ),
    "LATIN_LARGE_NOISE": (
        "times eps, of the tensions",
        "As `LATIN_ESTIMATE_NOISE`, for links that rounded coordinates turn.",
    ),
    "LATIN_LARGE_NONE": ("of the size", "Displacements of an unloaded structure are rounding of its prestress."),
    "LATIN_LARGE_PREDICT": ("iterations", "Ends a linear solve that does not converge."),
    "LATIN_LARGE_FIRM": (
        "times `LATIN_MECHANISM`, of the largest stiffness",
        "Without, 28 of 400 random structures more are claimed: mechanisms at rest.",
    ),
    "LATIN_DESCENT_RADIUS": (
        "of the size",
        "60 random towers: 0.01 and 1 find the same 49 states; the trust region adapts.",
    ),
    "LATIN_DESCENT_BALANCE": (
        "of the stiffness times the size",
        "60 random towers: 1e-9 finds the same 49 states in 71,000 stages, not 37,000; 1e-6 misses one.",
    ),
    "LATIN_DESCENT_RTOL": (
        "relative",
        "Of a linear solve: three digits a step near the state, which ends after a few.",
    ),
    "LATIN_DESCENT_SOON": (
        "steps",
        "Of 100 towers drawn far from their form 1 finds another state when it is rotated; with 200 steps 8.",
    ),
    "LATIN_DESCENT_STEPS": (
        "steps",
        "Of 150 tied arches with slack hangers 45 are refused with 200, 10 with 500, 4 with 1000, 3 with 2000; loose "
        "chains of 300 bars that nothing holds are refused after 1.3, 5, 20 and 40 s.",
    ),
    "LATIN_DESCENT_AWAY": (
        "of the size",
        "A branch begins within a hundredth, a snap-through leaves at once: without, a bridge of 60 panels that buckles"
        " takes 6.3 s in the place of 0.6.",
    ),
    "LATIN_DESCENT_HEAVY": (
        "of the stiffness times the size",
        "60 random towers: a rotation changes the state of 1; with 0.01 of 4, with 1 of 2.",
    ),
    "LATIN_DESCENT_LIGHTER": (
        "ratio",
        "60 random towers: a rotation changes the state of 1, as with 3; with 100 of 2.",
    ),
    "LATIN_LARGE_NOWHERE": ("sizes", "60 random towers: 10 and 1e5 find the same states."),
    "LATIN_PATH_RESIDUAL": (
        "of forces on all nodes",
        "A solve leaves a hundredth as a rule; a bar that hangs loose left 0.7.",
    ),
    "LATIN_PATH_REFINEMENTS": ("linear solves", "The second one shows the mechanism; a third one for a second."),
    "LATIN_PATH_PART": (
        "of the loads",
        "A chain of bars that yield under a fourteenth of the loads, and struts that lean on each other, start there.",
    ),
    "LATIN_PATH_FAR": (
        "times the linear step",
        "The limit of a fold, where force is a parabola of displacement: 2 exactly.",
    ),
    "LATIN_PATH_EQUAL": (
        "times half the difference",
        "The error of a linear solve is 1e-4: with 1 a structure of slack struts and cables ends where it is drawn.",
    ),
    "LATIN_PATH_ASIDE": (
        "of the middle",
        "With 0 random masts and bridges take 4 % more set-ups; above 0.3 a bridge ends on another path.",
    ),
    "LATIN_PATH_CURVE": (
        "times the displacements",
        "What monotone cubic interpolation allows; without it 240 random structures take 8,669 set-ups, not 7,957.",
    ),
    "LATIN_PATH_CORRECTED": (
        "times the step by the tangent",
        "150 random structures take 728 set-ups with 30, 733 with 10, 742 with 100, 811 with 1000, 922 without.",
    ),
    "LATIN_PATH_SOFT": (
        "times the step by the tangent before",
        "In increments below a thousandth, elsewhere 2. With 4 there a mast in strong wind ends at a fortieth of its "
        "path, where a guy slackens. With 4 elsewhere a random tower of 240 is given an equilibrium beyond a limit "
        "point; 240 random structures take 2 % fewer set-ups. At a limit point it is 1e5.",
    ),
    "LATIN_BRANCH_AHEAD": ("", "The branch begins within one of these; a quarter of the step must not end before it."),
    "LATIN_BRANCH_LESS": ("times less", "Displacements are a quarter, or half: well apart from each other and from 1."),
    "LATIN_BRANCH_NEARER": ("ratio", "Between 1/2, of what buckles and bears more, and 1, of what snaps through."),
    "LATIN_BRANCH_LINEAR": (
        "ratio",
        "Between 1/4, of panels that shear, and 1/2, of what buckles and bears more. If no branch is followed, 2 of "
        "100 prestressed towers, seeds 345 and 381, are refused.",
    ),
    "LATIN_BRANCH_DISTURB": (
        "of the size",
        "Forces of this far along the mode are above the balance of a descent; displacements ahead alone, of a strut"
        " that is stiff along its path, are not.",
    ),
    "LATIN_PANELS_HEAVY": (
        "of the size",
        "Of 120 braced towers and frames 1 is refused, 7 with 1e-4; of 120 prestressed ones 6, 9 with 1e-4. 5e-2 and "
        "1e-3 differ by 2 at most.",
    ),
    "LATIN_PANELS_DISTURB": (
        "of the prediction",
        "Of 360 towers, 120 each of those rows and under 1e-3 of the loads, 6 are refused, 9 with 1e-4, 14 with 1e-2.",
    ),
    "LATIN_PANELS_LIGHTER": (
        "ratio",
        "The same towers: 2 and 9 are refused, 1 and 13 with 0.1, 2 and 8 with 0.5, which takes longer.",
    ),
    "LATIN_PANELS_CLOSE": (
        "ratio",
        "Three ratios before a search begins anew. Without the guess in proportion 69 and 21 of these towers are "
        "refused.",
    ),
    "LATIN_PANELS_LINEAR": (
        "times as far",
        "With 1.1 four of 120 prestressed towers more are refused.",
    ),
    "LATIN_PANELS_STATES": (
        "comparisons",
        "With 1 a shell that snaps is given a state beyond (tests/test_large_branches.py); with 3 two more of 120 "
        "prestressed towers are refused.",
    ),
    "LATIN_PANELS_BRANCH": ("of the path", "Of 120 prestressed towers 9 are refused, 13 with 2e-3."),
    "LATIN_DESCENT_FORCES": (
        "of the loads",
        "Of 300 braced towers and frames 9 were refused without, 7 with 1e-6, 6 with 1e-9.",
    ),
    "LATIN_DESCENT_NEAR": (
        "steps",
        "Of 300 braced towers and frames 10 were refused with 100, 6 with 200, 5 with 1000, which takes 2.7 times as "
        "long.",
    ),
    "LATIN_PATH_KINK": (
        "of the displacements",
        "Where a cable slackens a tower was 13 times softer, with smaller increments than 1e-4 of the loads before.",
    ),
    "LATIN_PATH_STIFFENS": (
        "of the loads",
        "With 1e-2 a truss under 1000 times its limit load is inverted; without it a cable that tightens ends a path.",
    ),
    "LATIN_PATH_HALVES": (
        "points",
        "Of 30 trusses under 1e4 to 1e6 times their limit load 2 are claimed, whose path starts under loads, and 22 "
        "without; all that sag are solved.",
    ),
    "LATIN_PATH_TARGETS": (
        "loads",
        "A bound that none meets: each is at most half as far as the one before, down to `LATIN_PATH_SMALL`.",
    ),
    "LATIN_PATH_INVERSE": (
        "solves",
        "Nodes of the mode at limit points of masts, towers, a bridge, a von Mises truss: with 4 those of 20, with 3 a "
        "tower has one more, with 2 three masts have nodes of guys.",
    ),
    "LATIN_PATH_LEAST": (
        "of the loads borne",
        "Of all loads, two of 600 structures of cables are refused: domes whose loads are thousands of times what "
        "their prestress bears. With 1e-2 five of 700 random structures were refused next to where a cable slackens; "
        "limit points take more.",
    ),
    "LATIN_PATH_SMALL": (
        "of the loads",
        "Of 92 tents whose tensions as drawn are not in balance 13 are refused with 1e-4, 8 with 1e-5, 5 with 1e-6, "
        "none with 1e-7 and 1e-8.",
    ),
    "LATIN_PATH_STAGES": (
        "linear stages",
        "An increment that takes longer is halved: with 100 a solve beyond a limit point takes more than 1000 stages.",
    ),
    "LATIN_INTERIOR_MOST": (
        "steps",
        "Ends a method that takes 8 to 20 steps, on grids and nets of 621 to 24,000 unknowns.",
    ),
    "LATIN_INTERIOR_BACK": ("of the way to zero", "Usual: 0.9 to 0.995 [S. Mehrotra 1992]."),
    "LATIN_INTERIOR_CENTRE": ("of the mean product", "A bound for the last steps, which fall by the square otherwise."),
    "LATIN_INTERIOR_SPREAD": ("ratio", "Products within one order of magnitude of their mean count as central."),
    "LATIN_INTERIOR_CORRECT": (
        "solves",
        "Without any, grids of 8, 20, 40 modules take 41, 20, 27 set-ups in place of 32, 15, 22.",
    ),
    "LATIN_INTERIOR_ENOUGH": (
        "of a step",
        "With 1 a grid of 40 modules takes 254 linear stages in place of 211, random nets 66 in place of 52.",
    ),
    "LATIN_INTERIOR_SHORT": (
        "of a step",
        "A step that is cut to less leads nowhere; with 1e-3 1 of 30 mixed nets fails.",
    ),
    "LATIN_INTERIOR_STEP": (
        "of the displacements",
        "With 1e-3 Newton's method fails on grids of 8, 20 and 40 modules and starts again: up to a tenth more stages.",
    ),
    "LATIN_INTERIOR_AGAIN": ("of the step", "Where Newton's method has failed it waits for one digit more."),
    "LATIN_INTERIOR_SMALL": (
        "of tensions times lengths",
        "With 1e-8 a net of 24,000 unknowns takes 649 stages in place of 234, one of 10,000 248 in place of 107.",
    ),
    "LATIN_INTERIOR_LEAST": (
        "of the first",
        "95 % of 600 successful runs on braced towers end above; without it 100 of them take a half more iterations in "
        "all, and as many are refused, also with 1e-12 and 1e-24.",
    ),
    "LATIN_INTERIOR_AIM": (
        "times the same",
        "Without it 5 of 30 long chains are refused as mechanisms: products vanish before forces balance.",
    ),
    "LATIN_INTERIOR_FIRST": (
        "of the length",
        "Any slack that is no zero; that of a cable whose nodes are 0.9 L apart is as large.",
    ),
    "LATIN_INTERIOR_NONE": (
        "of the length as drawn",
        "A cable that is next to no length long is a spring: its slack over its length has no number.",
    ),
    "LATIN_INTERIOR_FLOOR": (
        "of the mean tension",
        "Without it nets with loads on a tenth of their nodes take 205 stages in place of 79.",
    ),
    "LATIN_INTERIOR_DIGITS": (
        "times LATIN_MECHANISM",
        "Without it 3 of 1,160 small nets with inextensible cables are mechanisms; with 1 and 10 none,"
        " and as many stages.",
    ),
    "LATIN_TURNING_OWN": ("of a unit vector", "Directions that differ by less differ by rounding."),
}
