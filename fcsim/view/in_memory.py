"""Steps in memory, in a script or a notebook: `picture` draws some of them, `interactive` makes a page of them that turns and plays."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Literal

from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.files import replacing
from fcsim.running.description import FORMAT, Description, write_description
from fcsim.running.folder import RunFolder, instants_in, open_run
from fcsim.running.step_table import StepTable
from fcsim.running.vtk_series import SeriesWriter
from fcsim.timestep.step import Step
from fcsim.version import __version__
from fcsim.view.page.write import write_page
from fcsim.view.pictures import ROOM, contact_figure, instants_figure, stress_figure
from fcsim.view.scene import MARGIN, Scene, survey
from fcsim.view.style import STYLE, matplotlib

DRAWN = ("stress", "contacts")
WIDTH, DPI = 1500, 150.0
MOST = 500
"""Instants of one picture or page: more are a run's, whose folder `fcsim render` draws."""


def _saved(place: Path, content: bytes) -> Path:
    place.parent.mkdir(parents=True, exist_ok=True)
    with replacing(place) as temporary:
        temporary.write_bytes(content)
    return place


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as PNG; a notebook shows it where it is the last value of a cell."""

    png: bytes

    __repr__ = brief

    def save(self, path: str | Path) -> Path:
        """Write the picture as a .png file, whole or not at all, and return its path."""
        place = Path(path)
        if place.suffix.lower() != ".png":
            raise InputError(f"path: expected the name of a .png file, got {str(path)!r}")
        return _saved(place, self.png)

    def _repr_png_(self) -> bytes:
        return self.png


@dataclass(frozen=True, eq=False)
class Interactive:
    """A page as one HTML text that loads nothing; a notebook shows it in a frame where it is the last value of a cell."""

    html: str

    __repr__ = brief

    def save(self, path: str | Path) -> Path:
        """Write the page, whole or not at all, and return its path."""
        return _saved(Path(path), self.html.encode())

    def _repr_html_(self) -> str:
        style = "width: 100%; height: 46rem; border: 1px solid #999"
        return f'<iframe title="Bodies over time" style="{style}" srcdoc="{escape(self.html)}"></iframe>'


def picture(
    *steps: Step,
    what: Literal["stress", "contacts"] = "stress",
    view: Literal["oblique", "front"] = "oblique",
    exaggeration: float | None = None,
    title: str = "",
) -> Picture:
    """Draw one step, or several side by side, without a display and without a file.

    what          "stress": the deformed bodies by von Mises stress (rigid ones in grey); "contacts": points by status with their reactions,
                  of one step
    view          of 3D models, "front": along the thickness; 2D models are seen along z
    exaggeration  factor on displacements; None: the largest is shown as 5 to 8 % of the size of the whole (1 where it is more already), or
                  less where bodies would be drawn in each other or what turns would grow (`Framed.largest_factor`)

    The bodies fill the picture, of wide floors that stand still the part near what moves is shown.
    Raises InputError for no step, steps of several models, and choices that are not there; MissingDependency without pyvista or OpenGL.
    """
    given = _checked(steps)
    for name, value, known in (("what", what, DRAWN), ("view", view, ("oblique", "front"))):
        if value not in known:
            raise InputError(f"{name}: expected one of {', '.join(map(repr, known))}, got {value!r}")
    if what == "contacts" and len(given) > 1:
        raise InputError(f"steps: expected one step for a picture of its contacts, got {len(given)}")
    with tempfile.TemporaryDirectory() as folder, matplotlib().rc_context(STYLE):
        run = _series(given, Path(folder), title)
        seen = survey(run, run.instants, exaggeration)
        with Scene(seen, view, WIDTH, margin=ROOM if what == "contacts" else MARGIN) as scene:
            if what == "contacts":
                drawing = contact_figure(run, scene, run.instants[0])
            else:
                drawing = stress_figure(run, scene, run.instants[0]) if len(given) == 1 else instants_figure(run, scene, list(run.instants))
        file = io.BytesIO()
        drawing.savefig(file, format="png", dpi=DPI)
    return Picture(file.getvalue())


def interactive(*steps: Step, exaggeration: float | None = None, title: str = "") -> Interactive:
    """A page that turns, plays and answers to the mouse (docs/result_page.md) of steps in memory, for a notebook or a file.

    exaggeration  as in `picture`
    Raises InputError for no step and for steps of several models; MissingDependency without pyvista, OpenGL or plotly.
    """
    given = _checked(steps)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _series(given, folder, title)
        table = StepTable(folder / "steps.csv", (), 0)
        for step in given:
            table.write(table.row(step), step.seconds)
        table.close()
        last = given[-1]
        about = Description(
            format=FORMAT,
            title=title or "Steps",
            h=last.scheme.h,
            steps=last.number,
            steps_done=last.number,
            bodies=tuple(body.name for body in last.model.bodies),
            scheme=type(last.scheme).__name__,
            versions={"fcsim": __version__},
            status="in memory",
        )
        write_description(folder, about)
        run = open_run(folder)
        path = write_page(run, survey(run, run.instants, exaggeration))
        return Interactive(path.read_text(encoding="utf-8"))


def _checked(steps: Iterable[Step]) -> tuple[Step, ...]:
    """The steps in the order of time, one an instant."""
    given = tuple(steps)
    if not given or not all(hasattr(step, "state") and hasattr(step, "model") for step in given):
        raise InputError(
            f"steps: expected one or more steps of a Simulation, got {', '.join(type(step).__name__ for step in given) or 'none'}"
        )
    if len({id(step.model) for step in given}) > 1:
        raise InputError("steps: expected steps of one model, got those of several")
    if len(given) > MOST:
        raise InputError(f"steps: expected at most {MOST}, got {len(given)}; choose every k-th by steps[::k], k = {-(-len(given) // MOST)}")
    return tuple({step.state.t: step for step in sorted(given, key=lambda step: step.state.t)}.values())


def _series(steps: tuple[Step, ...], folder: Path, title: str) -> RunFolder:
    """The steps as a run's folder holds them, under `folder`."""
    writer = SeriesWriter(folder / "vtk", steps[0].model)
    for step in steps:
        writer.write(step)
    h = getattr(getattr(steps[-1], "scheme", None), "h", None)
    return RunFolder(
        folder, Description(title=title or "Step " + ", ".join(str(step.number) for step in steps), h=h), {}, instants_in(folder / "vtk")
    )
