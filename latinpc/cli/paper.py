"""``latinpc paper``: tables and figures of the article."""

from __future__ import annotations

import sys

import click

from latinpc.results.atomic import check_writable
from latinpc.results.summary import summary

from .arguments import Command, List
from .printing import open_console, print_lines, print_table, progress, write_json
from .ranks import NOT_CONVERGED, on_root


@click.command(cls=Command)
@click.argument("what", type=click.Choice(["3", "4", "5", "6", "7", "fig8", "fig9"]))
@click.option(
    "--subdomains",
    type=List(int, "9,16,25"),
    metavar="A,B,...",
    help="Numbers of subdomains, squares such as 9,16,25. Default: the article's.",
)
@click.option(
    "--json", "json_file", metavar="FILE", help="Write our values and the article's; '-' prints them and nothing else."
)
@click.option("--picture", metavar="FILE.png", help="File of the figure. Default: fig8.png, fig9.png.")
@click.option("--outer", type=click.Choice(["richardson", "anderson"]), default="richardson", show_default=True,
              help="Plain iteration of the article, or Anderson acceleration.")  # fmt: skip
@click.option("--published", is_flag=True, help="Keep the micro springs on corner nodes, equation (28).")
@click.option("--direction", type=float, metavar="D",
              help="Search direction (N/m), 0: automatic. Default: 7e6, automatic with anderson.")  # fmt: skip
@click.pass_obj
def paper(comm, what, subdomains, json_file, picture, outer, published, direction):
    """Reproduce a table or a figure of the article."""
    from latinpc.bench import paper as article

    alone = json_file == "-"
    is_figure = what.startswith("fig")
    if is_figure and picture is None:
        picture = f"{what}.png"
    if picture is not None and not is_figure:
        raise ValueError("--picture is for fig8 and fig9")
    for path, suffixes in ((None if alone else json_file, None), (picture, (".png", ".pdf", ".svg"))):
        if path is not None:
            on_root(comm, check_writable, path, suffixes)
    if is_figure:
        return _figure(comm, int(what[3:]), subdomains, json_file, picture)
    with progress(comm, alone) as say:
        result = article.table(
            int(what), subdomains, outer=outer, published=published, direction=direction, progress=say
        )
    if json_file is not None:
        on_root(comm, write_json, json_file, result)
    if comm.rank == 0 and not alone:
        print_table(
            f"Table {what}. {article.CAPTIONS[int(what)]}", article.layout(result), left=(0, 1), bold=(1, "ours")
        )
        if what != "3":
            print(article.NOTE)
    missed = [row for row in result.get("rows", []) if None in row["iterations"].values()]
    for row in missed:
        print(f"latinpc: {row['subdomains']} subdomains, {row['variant']}: {row['reason']}", file=sys.stderr)
    return NOT_CONVERGED if missed or not result.get("same", True) else 0


def _figure(comm, number, subdomains, json_file, picture):
    from latinpc.bench import paper as article

    with progress(comm, json_file == "-") as say:
        result = article.figure(number, subdomains=(subdomains or (144,))[0], progress=say)

    def draw():
        from latinpc.bench import paper_figures as pictures

        if json_file is not None:
            write_json(json_file, {"figure": number, "picture": str(picture), **result.report})
        if number == 8:
            pictures.draw_figure_8(result.structure, result.displacements, picture)
        else:
            pictures.draw_figure_9(result.structure, result.tensions, picture)

    on_root(comm, draw)
    if comm.rank == 0 and json_file != "-":
        print_lines(open_console(), f"Figure {number}", [*summary(result), ("written", str(picture))])
    return 0 if result.converged else NOT_CONVERGED
