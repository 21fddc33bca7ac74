"""All pictures, plots, the film and the page of a run's folder: what `fcsim render DIR` makes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from fcsim.errors import InputError
from fcsim.files import inside
from fcsim.running.folder import open_run
from fcsim.view.film import FORMATS, film_instants, write_film
from fcsim.view.page import write_page
from fcsim.view.pictures import write_pictures
from fcsim.view.plots import write_plots
from fcsim.view.scene import looked_past, survey, toward_eye

Progress = Callable[[str, int, int], None]


def render(
    directory: str | Path,
    *,
    film: Literal["gif", "mp4"] | None = "gif",
    page: bool = False,
    exaggeration: float | None = None,
    progress: Progress | None = None,
    tell: Callable[[str], None] | None = None,
) -> list[Path]:
    """Draw the run in `directory` and return the files written, in this order:

    DIR/plots/reaction.png, energies.png, contacts.png, convergence.png, phases.png   from steps.csv, those whose columns are there
    DIR/plots/NAME.png                                                  the histories that the case declares
    DIR/pictures/stress.png, instants.png, contacts.png                 from vtk/, where the run wrote a series; of rigid bodies alone
                                                                        bodies.png in the place of stress.png
    DIR/pictures/cracks.png                                             joints by their opening, where any has opened, but
                                                                        those that bodies have rolled on from
    DIR/film.gif or film.mp4                                            likewise, unless `film` is None
    DIR/page.html                                                       where `page` says so: bodies in space over time, curves, numbers,
                                                                        see `fcsim.view.page`

    exaggeration  factor on displacements; None: the largest is shown as 5 to 8 % of the size of the whole (1 where it is more already), or
                  less where bodies would be drawn in each other or what turns would grow (`Framed.largest_factor`)
    progress      called with (what, done, total): "plots", "survey", "pictures", "film", "page"
    tell          called with what pictures do not show: rigid bodies between the camera and the rest

    Raises InputError where `directory` is not a run's folder or a file in it cannot be read, MissingDependency without matplotlib,
    pyvista, Pillow, imageio-ffmpeg or plotly, or without an OpenGL library.
    """
    if film is not None and film not in FORMATS:
        raise InputError(f"film: expected {' or '.join(map(repr, FORMATS))}, or None for no film, got {film!r}")
    report: Progress = progress or (lambda what, done, total: None)
    run = open_run(directory)
    for place in ("plots", "pictures"):
        inside(run.directory, run.directory / place)
    written = write_plots(run)
    report("plots", 1, 1)
    if not (written or run.instants or page):
        raise InputError(f"{directory}: expected a run of at least one step, found nothing to draw")
    if not run.instants:
        return [*written, write_page(run, None)] if page else written
    seen = survey(run, film_instants(run), exaggeration)
    report("survey", 1, 1)
    if tell is not None and len(bodies := looked_past(seen, toward_eye(seen))):
        numbers = ", ".join(map(str, bodies.tolist()))
        tell(f"pictures and film look past rigid bodies that stand before all others (body {numbers} in vtk/), as if they were not there")
    written += write_pictures(run, seen, run.directory / "pictures", lambda done, total: report("pictures", done, total))
    if film is not None:
        path = run.directory / f"film.{film}"
        written.append(write_film(run, seen, path, film, lambda done, total: report("film", done, total)))
    if page:
        written.append(write_page(run, seen, lambda done, total: report("page", done, total)))
    return written
