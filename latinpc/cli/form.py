"""``latinpc form``: the form of a drawing in equilibrium, from force densities, forces or natural lengths."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace

import click
import numpy as np
from petsc4py import PETSc

import latinpc
from latinpc.files.description import lumped
from latinpc.files.text import finite
from latinpc.laws import Law
from latinpc.results.atomic import check_writable
from latinpc.results.cad import check_ezdxf
from latinpc.results.summary import summary_of_file

from .printing import open_console, print_lines, progress, write_json
from .ranks import on_root
from .scenes import SceneCommand, open_scene, scene_options

SETTLED = 1e-9  # of the largest load: a change of loads per metre that the form does not show
STEPS = 100  # of loads per metre and forms; 45 were seen where a chain is 300 times as deep as its span


@click.command("form", cls=SceneCommand)
@click.argument("scene", metavar="SCENE|FILE")
@scene_options
@click.option("--density", "densities", multiple=True, metavar="[WHAT=]X|drawn",
              help="Force density, tension over length (N/m), of all links or of those of a law or a group, such as"
                   " cable=500 or edges=5000; drawn: prestress over drawn length of each link.")  # fmt: skip
@click.option("--force", "forces", multiple=True, metavar="[WHAT=]X",
              help="Force (N) of all links or of those of a law or a group, such as stays=1e5, whatever their lengths"
                   " become.")  # fmt: skip
@click.option(
    "--natural",
    is_flag=True,
    help="Keep the natural lengths of links without a force: drawn, less the elongation of prestress.",
)
@click.option("--without-load", is_flag=True, help="Ignore the loads.")
@click.option(
    "--error",
    type=float,
    metavar="X",
    help="Unbalanced forces with --natural or --force, relative to the largest force. Default: 1e-8.",
)
@click.option("--json", "json_file", metavar="FILE", help="Write the summary; '-' prints it and nothing else.")
@click.option(
    "--output", multiple=True, metavar="FILE", help="Write the form: .vtu (ParaView), .dxf (CAD) or .npz (numpy)."
)
@click.option("--csv", nargs=2, metavar="MEMBERS NODES", help="Write two .csv files, which latinpc solve reads again.")
@click.option("--picture", metavar="FILE", help="Draw the form: .png, .pdf or .svg.")
@click.option("--quiet", is_flag=True, help="Print only notices and errors.")
@click.pass_obj
def form(
    comm, scene, densities, forces, natural, without_load, error, json_file, output, csv, picture, quiet, **options
):  # fmt: skip
    """Find the form in which a drawing is in equilibrium.

    --density solves a linear system per coordinate, by a direct factor unless -form_ksp_type and -form_pc_type say
    otherwise (-form_pc_type latin). --natural and --force solve with large displacements, from the form of the
    densities if they are given, else from the drawing. Supports do not move.
    """
    alone = json_file == "-"
    quiet = quiet or alone
    files = [(None if alone else json_file, None), (picture, (".png", ".pdf", ".svg"))]
    files += [(path, (".vtu", ".npz", ".dxf")) for path in output] + [(path, (".csv",)) for path in csv or ()]
    if error is not None and not natural and not forces:
        raise ValueError("--error is for natural lengths and forces: give --natural or --force")
    scene, given = on_root(comm, _prepare, scene, (densities, forces, natural), without_load, files, options)
    given |= {} if error is None else {"error": error}
    with progress(comm, quiet) as say, warnings.catch_warnings():
        warnings.simplefilter("ignore", latinpc.LatinWarning)  # notices are printed in the end
        if say is not None:
            say(f"{scene.name}: finding the form")
        try:
            found = _find(scene, given)
        except (ValueError, latinpc.SolveError) as wrong:
            wrong.args = (scene.counted_as_given(str(wrong)),)
            raise
    found.numbering = scene.numbering
    on_root(comm, _write, found, json_file, output, csv, picture)
    if comm.rank == 0:
        for notice in found.notices:
            print(f"latinpc: {notice}", file=sys.stderr)
        if not quiet:
            written = [str(path) for path, _ in files if path is not None]
            lines = (
                summary_of_file(scene.metadata) + found.lines() + ([("written", ", ".join(written))] if written else [])
            )
            print_lines(open_console(), found.name, lines)


@np.errstate(over="ignore", invalid="ignore")  # of forms that grow without end
def _find(scene, given):
    """Find the form; collective.

    With natural lengths, links keep the masses and weights with which they are cut. Else what the file gives per metre
    acts over the lengths of the form, which follow from it.
    """
    found, load = _once(scene, given), given["load"]
    if given["natural_length"] is not None:
        return found

    def longer(along):
        return lumped(along, found.lengths - scene.lengths, scene.links, len(scene.nodes))

    step, weighs = 0, scene.line_load is not None and load is not None
    while weighs:  # changes may grow at first
        before, given["load"] = given["load"], load + longer(scene.line_load)
        change = np.abs(given["load"] - before).max()
        if change <= SETTLED * np.abs(load).max():
            break
        if step == STEPS or not np.isfinite(change):
            raise ValueError("loads per metre lengthen the form, and grow with it, without end: give larger densities")
        found, step = _once(scene, given), step + 1
    if scene.line_mass is not None:
        found.mass = found.mass + longer(scene.line_mass)
    return found


def _once(scene, given):
    return latinpc.form_find(scene.nodes, scene.links, scene.fixed, name=scene.name, **given)


def _prepare(name, what, without_load, files, options):
    """Refuse results that could not be written, open the scene, and return what `form_find` takes; on one rank."""
    for path, suffixes in files:
        if path is not None:
            check_writable(path, suffixes)
            check_ezdxf(path)
    densities, forces, natural = what
    if not any(what):
        raise ValueError(
            "give force densities with --density, forces with --force, or --natural to keep natural lengths"
        )
    geometry = PETSc.Options().getString("snes_latin_geometry", "large")
    if geometry.lower() != "large":
        raise ValueError(f"-snes_latin_geometry {geometry}: forms are found with large displacements; leave it out")
    scene = open_scene(name, options, [path for path, _ in files])
    if scene.direction is not None:
        raise ValueError(f"{scene.name} has links with directions of their own: a form is of links along their nodes")
    elastic = np.isin(scene.law, (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY))
    if not elastic.all():
        raise ValueError(
            "form finding takes links of the laws bar, cable and compression_only; give EA, and --law cable"
        )
    lengths = scene.lengths - (scene.initial_elongation if natural else 0.0)
    if (lengths <= 0.0).any():
        raise ValueError(
            f"link {scene.link_name(int((lengths <= 0.0).argmax()))} has a prestress beyond its stiffness: no length is"
            " left"
        )
    given = {"density": None, "force": None, "law": scene.law, "mass": scene.mass}
    if forces:
        given["force"] = _values(scene, "--force", forces)
    free = np.ones(len(lengths), bool) if given["force"] is None else np.isnan(given["force"])
    if densities:
        given["density"] = _densities(scene, densities, ~free)
    elif free.any() and not natural:
        link = scene.link_name(int(free.argmax()))
        raise ValueError(
            f"link {link} has no --force: give a --density of such links, or --natural to keep their natural lengths"
        )
    given |= {"area": scene.area, "strength": scene.strength}
    given |= {"EA": scene.stiffness * lengths, "natural_length": lengths if natural else None}
    return replace(scene, cases=()), given | {"load": None if without_load else scene.load}


def _densities(scene, texts, forced):
    """Return the force density of each link; those with a force may have none, nan."""
    if "drawn" in texts:
        if len(texts) > 1:
            raise ValueError("--density drawn stands alone")
        found = scene.stiffness * scene.initial_elongation / scene.lengths
        none = (found == 0.0) & ~forced
        if none.any():
            count, laws = int(none.sum()), ", ".join(Law(law).name.lower() for law in np.unique(scene.law[none]))
            said = "1 link has" if count == 1 else f"{count:,} links have"
            raise ValueError(
                f"--density drawn: {said} no prestress (law {laws}), the first is"
                f" {scene.link_name(int(none.argmax()))}; give --prestress, or numbers in place of drawn"
            )
        return np.where(found == 0.0, np.nan, found)
    found = _values(scene, "--density", texts)
    lost = np.isnan(found) & ~forced
    if lost.any():
        law = Law(scene.law[lost.argmax()]).name.lower()
        raise ValueError(f"--density: links of the law {law} have none; give {law}=X")
    return found


def _values(scene, option, texts):
    """Return what an option gives each link by [LAW= or GROUP=]number, nan where nothing."""
    known = _laws_and_groups(scene)
    kinds = {text: _kind(text, known) for text in texts}
    twice = [text for text in texts if [kinds[other] for other in texts].count(kinds[text]) > 1]
    if twice:
        raise ValueError(f"{option} {twice[0]} and {option} {twice[1]} are for the same links; keep one")
    found, of_group = np.full(len(scene.links), np.nan), np.full(len(scene.links), "", object)
    for text in sorted(texts, key=lambda text: list(known).index(kinds[text]) if kinds[text] in known else 0):
        value, kind = finite(text.rpartition("=")[2]), kinds[text]
        if value is None or kind not in known:
            names = ", ".join(name.name.lower() if isinstance(name, Law) else name for name in known if name != "")
            wanted = {"--density": "a number (N/m)", "--force": "a number (N)"}[option]
            drawn = ", or drawn" if option == "--density" else ""
            raise ValueError(
                f"{option} {text}: write {wanted}, LAW=number or GROUP=number with one of the drawing ({names}){drawn}"
            )
        chosen, group = known[kind], kind != "" and not isinstance(kind, Law)
        both = np.flatnonzero(chosen & (of_group != "") & (found != value) & group)
        if both.size:
            raise ValueError(
                f"{option} {of_group[both[0]]} and {option} {text}: link {scene.link_name(both[0])} is of both groups;"
                " give their links a group of their own, or keep one"
            )
        found[chosen], of_group[chosen] = value, text if group else ""
    return found


def _kind(text, known):
    """Return the group of a value, else the law, empty where it is for all."""
    word = text.rpartition("=")[0].strip()
    return word if word in known else Law.__members__.get(word.upper().replace("-", "_"), word)


def _laws_and_groups(scene):
    """Return the links of all, of each law, and of each group of the drawing: the later ones say more."""
    known = {"": np.ones(len(scene.links), bool)}
    for law in (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY):
        known |= {law: scene.law == law} if (scene.law == law).any() else {}
    groups = [] if scene.numbering is None or scene.numbering.link_groups is None else scene.numbering.link_groups
    several = [names.split("; ") for names in groups]
    for name in dict.fromkeys(name for names in several for name in names if name):
        known[name] = np.array([name in names for names in several])
    return known


def _write(found, json_file, output, csv, picture):
    """Write the files; on one rank."""
    if json_file is not None:
        write_json(json_file, found.to_dict())
    for path in output:
        {"vtu": found.to_vtu, "dxf": found.to_dxf, "npz": found.to_npz}[str(path).lower()[-3:]](path)
    if csv:
        found.to_csv(*csv)
    if picture is not None:
        from latinpc.results.drawing import save

        save(found.plot(), picture)
