"""fcsim render, compare: a run's folder as pictures, film, plots and page; runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from fcsim.command_line.answers import answer
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_OK


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands `render` and `compare`."""
    render = commands.add_parser("render", help="pictures, film, plots and page of a run", description="Draw a run's folder, off-screen.")
    render.add_argument("directory", type=Path, metavar="DIR", help="folder of a run, as results/masonry_wall")
    render.add_argument("--film", choices=("gif", "mp4", "none"), default="gif", help="kind of the film (default gif)")
    render.add_argument("--page", action="store_true", help="also page.html: the run in one file that a browser turns, plays and cuts")
    render.add_argument("--exaggeration", type=float, help="factor on displacements (default: chosen from their size)")
    render.set_defaults(act=_render)

    about = "Key numbers of runs beside each other, the parameters in which they differ, and their curves over each other as a page."
    compare = commands.add_parser("compare", help="runs side by side", description=about)
    compare.add_argument(
        "directories", type=Path, nargs="+", metavar="DIR", help="folders of two runs or more; that of a sweep stands for its runs"
    )
    compare.add_argument("--page", type=Path, metavar="FILE.html", help="also the curves over each other, as one HTML file")
    compare.set_defaults(act=_compare)


def _render(options: argparse.Namespace) -> int:
    from fcsim.view import render

    film = None if options.film == "none" else options.film
    with Bar("drawing", lines=0) as bar:
        written = render(
            options.directory,
            film=film,
            page=options.page,
            exaggeration=options.exaggeration,
            progress=lambda what, done, total: bar.update(done, total, what=what),
            tell=bar.say,
        )
        if not any(path.parent.name == "pictures" for path in written):
            bar.say(
                "no pictures and no film: the run has no VTK files, which fcsim run writes every 10th step and after the last (--vtk-every)"
            )
    if not answer({"run": options.directory, "files": written}):
        for path in written:
            say(path)
    return EXIT_OK


def _compare(options: argparse.Namespace) -> int:
    from fcsim.campaign.record import runs_in
    from fcsim.running.folder import open_run
    from fcsim.view.page.comparison import compare, write_comparison

    compared = compare([open_run(run) for directory in options.directories for run in runs_in(directory)])
    header = ["number or parameter", *compared.names]
    print_table(header, [[what, *values] for what, values in compared.numbers])
    if compared.differences:
        print_table(header, [[what, *values] for what, values in compared.differences], title="Parameters that differ")
    else:
        say("\nNo parameter differs.")
    if options.page is not None:
        say(f"\n{write_comparison(compared, options.page)}")
    return EXIT_OK
