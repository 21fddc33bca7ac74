"""fcsim render: pictures, film, plots and page of a run's folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from fcsim.command_line.terminal import Bar, say
from fcsim.errors import EXIT_OK


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `render`."""
    render = commands.add_parser("render", help="pictures, film, plots and page of a run", description="Draw a run's folder, off-screen.")
    render.add_argument("directory", type=Path)
    render.add_argument("--film", choices=("gif", "mp4", "none"), default="gif")
    render.add_argument("--page", action="store_true", help="also page.html: the run in one file that a browser turns, plays and cuts")
    render.add_argument("--exaggeration", type=float, help="factor on displacements (default: chosen from their size)")
    render.set_defaults(act=_render)


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
        )
    for path in written:
        say(path)
    return EXIT_OK
