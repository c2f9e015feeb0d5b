"""Digits that arithmetic loses on structures at the extremes, and what brings them back.

python benchmarks/digits.py      prints a table; some minutes

Every solver runs until nothing changes any more (-snes_stol 1e-15). Errors are those of the displacements in the l2
norm, against solutions in exact arithmetic or in closed form; the last three columns are what `latinpc.digits` says.
"""

from dataclasses import replace

from latinpc import Structure, digits
from latinpc.bench.extremes import catalogue
from latinpc.bench.extremes.exact import solve_exactly
from latinpc.options import default_options
from latinpc.results.mechanics import errors
from latinpc.scenes import Law

REFINED = {
    f"snes_latin_{where}_ksp_{key}": value
    for where in ("local", "coarse")
    for key, value in (("type", "richardson"), ("max_it", 3), ("norm_type", "none"))
}
ALONE = {"snes_latin_newton": "never"}
WAYS = {
    "iteration alone": ALONE,
    "local, coarse solves refined": ALONE | REFINED,
    "finished by Newton": {"snes_latin_stop": "error", "snes_latin_error": 1e-13},
    "by default": {},
    "Newton, CHOLMOD": {
        "snes_type": "newtonls", "snes_linesearch_type": "basic", "ksp_type": "preonly", "pc_type": "cholesky",
        "pc_factor_mat_solver_type": "cholmod", "snes_rtol": 0.0, "snes_atol": 0.0, "snes_max_it": 20,
    },
}  # fmt: skip


def scenes():
    """Yield the name of each structure and the structure."""
    yield "network of bars", catalogue.network(Law.BAR)
    for power in (4, 8, 12):
        yield f"one half 1e{power} times as stiff", catalogue.contrast(10.0**power, True, Law.BAR)
    for power in (4, 8, 12):
        yield f"30 % of the links 1e{power} times", catalogue.contrast(10.0**power, False, Law.BAR)
    yield "cables, 30 % of the links 1e12 times", catalogue.contrast(1e12, False)
    for distance in (1e-3, 1e-6, 1e-9, 1e-12):
        yield f"two nodes at {distance:g} of the size", catalogue.close_nodes(distance)
    for count in (100, 10**4, 10**6):
        yield f"{count:,} bars in a row", catalogue.chain(count)
    for shift in (1e4, 1e8):
        scene = catalogue.grid()
        yield f"grid, {shift:g} m from the origin", replace(scene, nodes=scene.nodes + shift)


def solution(scene, guess):
    """Return the true displacements."""
    return catalogue.chain_solution(scene) if scene.name == "chain" else solve_exactly(scene, guess).displacements


def main():
    """Print the table."""
    print(f"| structure | {' | '.join(WAYS)} | rounding | coordinates | other data |")
    print("| --- |" + " ---: |" * (len(WAYS) + 3))
    for name, scene in scenes():
        structure = Structure.from_scene(scene)
        exact, row, told = None, [], {}
        parts = max(catalogue.SUBDOMAINS, len(scene.links) // 1000)
        for way, options in WAYS.items():
            common = {"snes_latin_subdomains": parts, "snes_stol": 1e-15, "snes_max_it": 300}
            with default_options(common | options):
                snes, u = structure.create_snes(), structure.create_vec()
                snes.setFromOptions()
                snes.solve(None, u)
                found = structure.displacements(u)
                if way == "by default":
                    told = digits(snes)
                snes.destroy()
            exact = solution(scene, found) if exact is None else exact
            row.append(errors(scene, found, exact)[0])
        row += [told[key] for key in ("rounding", "places", "values")]
        print(
            f"| {name} | " + " | ".join("< 1e-16" if value < 1e-16 else f"{value:.0e}" for value in row) + " |",
            flush=True,
        )


if __name__ == "__main__":
    main()
