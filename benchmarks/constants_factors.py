"""The constants of orders of elimination and factors that trade no iterations, for constants.py."""

#: As `constants_others.OTHERS`: unit, and why this value.
FACTORS = {
    "LATIN_ELIMINATE_DENSE": (
        "rows",
        "Dense algebra takes less time below: tensegrity-grid 60 and network 8000 by METIS into 8 to 240. "
        "Without it set-up of the former in 240 0.55 -> 0.65 s.",
    ),
    "LATIN_CHOLESKY_COUPLED": (
        "times the entries of separate fields",
        "Fields apart from each other have 1, structures 1.2 (lattice) to 3 (network). Analysed by nodes, METIS grid "
        "of 100: set-up 405 -> 358 ms; separate fields would get bs times the entries.",
    ),
    "LATIN_ORDERING_PASSES": (
        "passes of refinement",
        "METIS' default is 10. Operations over three seeds: network 8,000 1.30e8 -> 1.34e8, 20,000 8.63e8 -> 8.56e8, "
        "METIS grid of 100 1.52e8 -> 1.53e8, in 37 -> 26, 104 -> 75 and 130 -> 109 ms.",
    ),
    "LATIN_DISSECTION_LEAF": (
        "nodes",
        "Operations of the METIS grid of 200, networks of 8,000 and 20,000 and a vault: with 50 up to 1 % fewer, with "
        "200 up to 1 % more; orders take 10 % more and less time.",
    ),
    "LATIN_DISSECTION_CUTS": (
        "slices",
        "With 32, 64 and 256 operations of the same four differ by 2 % both ways.",
    ),
    "LATIN_DISSECTION_LEAST": (
        "of the nodes",
        "0.2 is no different; with 0.4 the vault takes 5 % more operations.",
    ),
    "LATIN_DISSECTION_THIN": (
        "of the largest extent",
        "0.25 gives the same orders of the same four, in 7 to 20 % more time.",
    ),
    "LATIN_DISSECTION_HALVES": (
        "times the weight in orders",
        "Sides of 49 and 51 % count as much as a separator 2 % larger. Halves of the METIS grids of 100 and 200 are "
        "equal, with 199 and 401 nodes between them; those of the network of 20,000 differ by 0.1 %, with 460 between "
        "them: with 1 they would by 10 %, with 434.",
    ),
    "LATIN_LINE": ("bytes", "Of a cache line, and of the longest vector register of x86-64."),
    "LATIN_FRONT_ROWS": ("rows", "Eight sums keep two units for multiply-add busy whose answers take four cycles."),
    "LATIN_FRONT_AHEAD": (
        "bytes",
        "Both halves of a solve with one right-hand side: METIS grid of 100 11.5 ms without it, 12.2 with 1024, 10.1 "
        "with 2048, 9.2 with 4096, 8.7 with 8192; network 8,000 2.7 ms without it, 2.5 from 2048 on; network 20,000 "
        "the same.",
    ),
    "LATIN_FRONT_PANEL": (
        "columns",
        "What lies above the diagonal is left out of a factor but for blocks of so many columns: entries of network "
        "20,000 2.73e7 -> 2.36e7, of the METIS grid of 200 7.54e7 -> 7.08e7. As many as `LATIN_BATCH_COLUMNS`. "
        "Fronts of no more columns are updated by blocks: elimination of the METIS grid of 60 takes 42 ms in place of "
        "52, that of network 27,000 the same. Columns are solved for by panels of so many."
        " Ranks send fronts by such panels: a message of 1 MB for one of 2,000 rows is all bandwidth; what has been "
        "read goes by as many where a rank has rows that others share.",
    ),
    "LATIN_FRONT_LAST": (
        "of the rows, as 1 of so many",
        "Their place in the factor is no large page, and what their large fronts have read goes before more comes. For "
        "all large fronts of the METIS grid of 200 on two ranks that was 40,000 more page faults, 45 ms of 1.05 s.",
    ),
    "LATIN_CONTRIBUTION_PANEL": (
        "columns",
        "Blocks of so many, those on the diagonal by their symmetric form, in place of 64 and products alone, and "
        "columns of a front eliminated by halves: a solid of 24^3 nodes with 27 neighbours 0.65 -> 0.60 s, METIS grid "
        "of 200 0.83 -> 0.79 s, of 100 the same. With 128 and 192 the same within the noise.",
    ),
    "LATIN_FRONT_BLOCK": (
        "columns",
        "Wider blocks fill more above the diagonal. 64, 32 and 24: factor of the METIS grid of 100 0.153, 0.147, 0.145 "
        "s of the processor, network 8,000 61, 58, 54 ms, 20,000 0.31, 0.30, 0.30 s, METIS grid of 200 the same.",
    ),
    "LATIN_PANEL_ROWS": (
        "rows",
        "64 of 64 columns are 32 kB. 32, 64 and 128: factor of the METIS grid of 200 0.89, 0.88, 0.84 s of the "
        "processor, network 20,000 0.25 s.",
    ),
    "LATIN_SMALL_PAGE": ("bytes", "Of a page of x86-64, and no more than of others: each is touched."),
    "LATIN_PAGE": (
        "bytes",
        "Of a large page of x86-64 and of most others. Factors in such pages: stages of network 20,000 264 -> 240 ms, "
        "of 8,000 98 -> 89 ms (three runs in turn), of the METIS grid of 100 the same. Of panels as "
        "large, with kept rows, what has been read goes at once, where the stack is more than half full: METIS grid of "
        "284 on eight ranks 285 -> 268 MB, set-up 2 to 4 % longer; without kept rows it would "
        "be 6 %, and no peak is there.",
    ),
    "LATIN_CHOLESKY_FULL": (
        "entries",
        "A matrix with a quarter of its entries has a full factor, whatever the order.",
    ),
}
