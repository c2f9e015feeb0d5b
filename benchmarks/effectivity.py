"""Effectivity of the indicator and of the estimated error: what they say over what is true, at every iterate.

Cases are drawn at random from all scenes and options. The factors of latinpc/src/estimate.c were chosen on the set
CALIBRATION; what is reported is from the set TEST, drawn with another seed and not looked at before.
"""

import sys

import numpy as np

CALIBRATION = {"seed": 1, "cases": 160}
TEST = {"seed": 3, "cases": 240}
BOUNDED = {"seed": 7, "cases": 60}
TARGETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
NORMS = ("l2", "energy")
STOPS = {"l2": "error", "energy": "energy"}
QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
MAX_IT = 200
SLACK = (0.0, 0.05, 0.09, 0.15, 0.25)
LATTICES = ((16, 8), (32, 16), (64, 32), (48, 8))


def draw(rng):
    """Return a random scene and options: name, arguments of the generator, PETSc options."""
    name = str(rng.choice(["tensegrity-grid", "truss-grid", "network", "lattice"], p=[0.45, 0.15, 0.25, 0.15]))
    made, options = {}, {}
    if name.endswith("grid"):
        made["modules"] = int(rng.choice([8, 12, 16, 20, 24, 28]))
        if rng.random() < 0.4:
            made["partition"] = "metis"
            options["snes_latin_subdomains"] = int(rng.choice([4, 9, 16, 25, 36]))
        if name == "tensegrity-grid":
            made["slack"] = float(rng.choice([0.0, 0.02, 0.05, 0.09, 0.12, 0.15, 0.2, 0.25]))
    elif name == "network":
        made["nodes"] = int(rng.choice([200, 400, 800, 1200]))
        made["seed"] = int(rng.integers(1000))
        made["slack"] = float(rng.choice(SLACK))
        made["supports"] = int(rng.choice([1, 2]))
        made["neighbours"] = int(rng.choice([8, 10]))
        options["snes_latin_subdomains"] = int(rng.choice([4, 8, 16]))
    else:
        made["nx"], made["ny"] = LATTICES[rng.integers(len(LATTICES))]
        made["seed"] = int(rng.integers(1000))
        made["slack"] = float(rng.choice(SLACK))
        if rng.random() < 0.3:
            made["partition"] = "metis"
            options["snes_latin_subdomains"] = int(rng.choice([4, 9, 16]))
    options["snes_latin_variant"] = str(rng.choice(["none", "macro", "corner"], p=[0.25, 0.25, 0.5]))
    if rng.random() < 0.3:
        options["snes_latin_direction"] = "scalar"
    else:
        options["snes_latin_direction_value"] = float(rng.choice([0.02, 0.04, 0.08, 0.16], p=[0.1, 0.2, 0.5, 0.2]))
    if rng.random() < 0.2:
        options["snes_latin_modes"] = "rigid"
    if options["snes_latin_variant"] == "corner" and rng.random() < 0.2:
        options["snes_latin_variant"] = "published"
    outer = rng.random()
    if outer < 0.3:
        options["snes_latin_outer_snes_type"] = "nrichardson"
        if outer >= 0.25:
            options["snes_latin_outer_snes_linesearch_damping"] = 0.9
    elif outer < 0.5:
        options["snes_latin_outer_snes_anderson_m"] = int(rng.choice([5, 20]))
    return name, made, options


def measure(seed, case):
    """Solve one case of a set, one time for each norm; None where the structure has no reference."""
    import latinpc
    from latinpc.bench.peers.reference import by_newton
    from latinpc.runs.solve import solve
    from latinpc.scenes import make

    name, made, options = draw(np.random.default_rng([seed, case]))
    try:
        scene = make(name, **made)
        reference, about = by_newton(scene, TARGETS[-1])
    except (RuntimeError, ValueError) as error:
        return {"case": case, "scene": name, "made": made, "skipped": str(error)}
    structure = latinpc.Structure.from_scene(scene)
    given = structure.create_vec()
    structure.set_displacements(reference, given)
    record = {"case": case, "scene": name, "made": made, "options": options, "reference": about["accuracy"]}
    for norm in NORMS:
        stop = {"snes_latin_stop": STOPS[norm], "snes_latin_error": 0.1 * TARGETS[-1]}
        history = solve(scene, {"snes_max_it": MAX_IT, **options, **stop}, reference=given, structure=structure).history
        record[norm] = {
            "error": history[f"error_{norm}"],
            "estimate": history["estimate"],
            "indicator": history["indicator"],
        }
    return record


def bounds(chosen):
    """Return the energy bound over the true error for the cases of a set, all links made bars, at three accuracies."""
    from dataclasses import replace

    import latinpc
    from latinpc.bench.peers.reference import by_newton
    from latinpc.options import default_options
    from latinpc.scenes import Law, make

    ratios = []
    for case in range(chosen["cases"]):
        name, made, options = draw(np.random.default_rng([chosen["seed"], case]))
        scene = make(name, **made)
        scene = replace(scene, law=np.full(len(scene.links), Law.BAR))
        structure = latinpc.Structure.from_scene(scene)
        solution, u = structure.create_vec(), structure.create_vec()
        true = by_newton(scene, 1e-9)[0]
        structure.set_displacements(true, solution)
        first, second = scene.links.T
        direction = scene.nodes[second] - scene.nodes[first]
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        size = np.sqrt(scene.stiffness @ np.sum(direction * (true[second] - true[first]), axis=1) ** 2)
        for tolerance in (1e-1, 1e-3, 1e-6):
            with default_options({**options, "snes_type": "latin", "snes_stol": tolerance, "snes_max_it": 60}):
                snes = structure.create_snes()
                snes.setFromOptions()
                snes.solve(None, u)
            error = structure.errors(u, solution)[1]
            if error > 1e-8:  # below, rounding has its share in the bound
                ratios.append(latinpc.energy_bound(snes)[0] / (error * size))
            snes.destroy()
    return ratios


def group(record):
    """Return what the tables tell apart: acceleration and partition."""
    plain = record["options"].get("snes_latin_outer_snes_type") == "nrichardson"
    irregular = record["scene"] == "network" or "partition" in record["made"]
    return ("plain" if plain else "Anderson") + (", METIS" if irregular else ", regular")


def stop(record, norm, target, what="estimate"):
    """Return the true error over the target where the iteration stops, the iterates done and the first good one."""
    error, measured = (np.asarray(record[norm][key]) for key in ("error", what))
    met, good = np.flatnonzero(measured <= target), np.flatnonzero(error <= target)
    if not len(met):
        return None
    return error[met[0]] / target, int(met[0]) + 1, int(good[0]) + 1 if len(good) else None


def quantiles(values):
    """Return the quantiles of positive numbers, or None without any."""
    return [float(q) for q in np.quantile(values, QUANTILES)] if len(values) else None


def stops(records, norm, target, what="estimate"):
    """Return how the stop on a measure fares on some cases."""
    found = [found for record in records if (found := stop(record, norm, target, what))]
    ratio = np.array([f[0] for f in found])
    in_time = [f for f in found if f[0] <= 1.0]
    missed = sum(np.min(r[norm]["error"]) <= target for r in records if not stop(r, norm, target, what))
    return {
        "target": target,
        "cases": len(found),
        "met": float(np.mean(ratio <= 1.0)),
        "worst": float(ratio.max()),
        "median": float(np.median(ratio)),
        "extra_iterations": float(np.median([f[1] - f[2] for f in in_time])),
        "extra_relative": float(np.median([f[1] / f[2] - 1.0 for f in in_time])),
        "not_noticed": int(missed),
    }


def summarise(records):
    """Return the tables: effectivities at all iterates by group, stops by norm and target."""
    solved = [record for record in records if "skipped" not in record]
    rows = []
    for norm in NORMS:
        for name in sorted({group(record) for record in solved}):
            chosen = [record[norm] for record in solved if group(record) == name]
            row = {"norm": norm, "group": name, "cases": len(chosen)}
            for what in ("indicator", "estimate"):
                ratio = [
                    np.divide(c[what][2:], c["error"][2:])[np.asarray(c["error"][2:]) > 0.1 * TARGETS[-1]]
                    for c in chosen
                ]
                row[what] = quantiles(np.concatenate(ratio))
            rows.append(row)
    return {
        "cases": len(solved),
        "skipped": len(records) - len(solved),
        "quantiles": QUANTILES,
        "effectivity": rows,
        "stops": {norm: [stops(solved, norm, target) for target in TARGETS] for norm in NORMS},
        "indicator_stops": {norm: [stops(solved, norm, target, "indicator") for target in TARGETS] for norm in NORMS},
    }


def document(chosen=TEST, progress=sys.stderr):
    """Measure a set; its tables, and how they were made."""
    records = []
    for case in range(chosen["cases"]):
        records.append(measure(chosen["seed"], case))
        print(f"\r{case + 1} of {chosen['cases']}", end="", file=progress, flush=True)
    print(file=progress)
    bound = {"set": BOUNDED, "effectivity": quantiles(bounds(BOUNDED))}
    return {"set": chosen, "calibration": CALIBRATION, "max_it": MAX_IT, "bound": bound, **summarise(records)}
