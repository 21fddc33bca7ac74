"""Pictures of a run: the deformed shape coloured by stress, and the contacts by status with their reactions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fcsim.running.folder import Instant, RunFolder
from fcsim.view.joints import Joints, find_joints, without_moved_on
from fcsim.view.joints.draw import crack_colours, draw_joints, opened
from fcsim.view.scene import Scene, Survey, colour_map, gravity_of, read
from fcsim.view.style import BLUE, GREY, RED, STYLE, figure, matplotlib, prefixed, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation, Text

WIDTH = 10.0  # of every page [inch], whatever the resolution
TOP, BOTTOM = 0.72, 0.85  # bands for title and for colours or legend [inch]
STATUS = {1: ("stick", BLUE), 2: ("slip", RED), 0: ("open", "#a6a6a6")}
SEPARATOR = "   ·   "
LONGEST_SEGMENT = 0.12  # of the width of the picture
ROOM = 0.52 * LONGEST_SEGMENT
"""Margin of a scene in which segments, whose middle is a contact's point, end within the picture."""


def write_pictures(
    run: RunFolder, seen: Survey, directory: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> list[Path]:
    """Write stress.png (bodies.png where all are rigid and have none), contacts.png, cracks.png where joints have opened (last instant)
    and instants.png (four instants) into `directory`; return what was written."""
    last = run.instants[-1]
    written = []
    with matplotlib().rc_context(STYLE):
        with Scene(seen) as scene:
            written.append(save(stress_figure(run, scene, last), directory / ("bodies.png" if seen.stress is None else "stress.png")))
            progress(1, 3)
            if len(run.instants) > 1:
                written.append(save(instants_figure(run, scene, _spread(run.instants, 4)), directory / "instants.png"))
        progress(2, 3)
        with Scene(seen, "front", margin=ROOM) as scene:
            if last.contacts is not None:
                written.append(save(contact_figure(run, scene, last), directory / "contacts.png"))
            joints = without_moved_on(find_joints(run.instants[0], seen.planar), last)
            if (cracks := crack_figure(run, scene, last, joints)) is not None:
                written.append(save(cracks, directory / "cracks.png"))
        progress(3, 3)
    return written


def stress_figure(run: RunFolder, scene: Scene, instant: Instant) -> Figure:
    """The deformed shape of an instant, coloured by von Mises stress where bodies have one, with title and colour bar."""
    page = _Page(scene)
    page.title(run.title, describe(run, scene, instant))
    page.gravity(page.image(scene.image(instant)), instant)
    page.colour_bar()
    return page.drawing


def stress_frames(run: RunFolder, scene: Scene, instants: tuple[Instant, ...]) -> Iterator[NDArray[np.uint8]]:
    """The pictures of `stress_figure` of several instants, (height, width, 3) each: what they share is drawn once, the rest over it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    page = _Page(scene)
    subtitle = page.title(run.title, "")
    axes = page.image(np.full((scene.height, scene.width, 3), 255, np.uint8))
    page.colour_bar()
    canvas = FigureCanvasAgg(page.drawing)
    canvas.draw()
    shared = canvas.copy_from_bbox(page.drawing.bbox)
    for instant in instants:
        canvas.restore_region(shared)
        axes.images[0].set_data(scene.image(instant))
        subtitle.set_text(describe(run, scene, instant))
        arrow = page.gravity(axes, instant)
        for artist in (axes.images[0], *arrow, subtitle):
            page.drawing.draw_artist(artist)
        for artist in arrow:
            artist.remove()
        yield np.array(canvas.buffer_rgba())[..., :3]


def instants_figure(run: RunFolder, scene: Scene, instants: list[Instant]) -> Figure:
    """Several instants in two columns with one colour bar; what they share is said once, in the line under the title."""
    page = _Page(scene, columns=2, rows=(len(instants) + 1) // 2, caption=0.36)
    label = _imposed_label(run)
    page.title(run.title, SEPARATOR.join(["time", *([label] if label else []), _factor(scene)]))
    for place, instant in enumerate(instants):
        page.image(scene.image(instant), place, SEPARATOR.join(filter(None, [_time(run, instant), _imposed(run, instant)])))
    page.colour_bar()
    return page.drawing


def contact_figure(run: RunFolder, scene: Scene, instant: Instant) -> Figure:
    """The contact points of an instant, coloured by status, each with a segment along its reaction, of a length proportional to it."""
    assert instant.contacts is not None
    contacts = read(instant.contacts)
    reaction, status = np.asarray(contacts["reaction"]).reshape(-1, 3), np.asarray(contacts["status"])
    points = scene.pixels(scene.shown(contacts))
    in_plane = np.column_stack([reaction @ scene.right, -(reaction @ scene.up)])
    largest = scene.survey.force or 1.0  # no contact of the run bore anything: segments of no length
    half = 0.5 * LONGEST_SEGMENT * scene.width / largest * in_plane

    page = _Page(scene)
    axes = page.image(scene.image(instant, coloured=False))
    page.gravity(axes, instant)
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    # the largest forces come last, on top of the others
    order = np.argsort(np.linalg.norm(reaction, axis=1))
    order = order[status[order] > 0]
    colours = [STATUS[int(s)][1] for s in status[order]]
    segments = np.stack([points - half, points + half], axis=1)[order]
    axes.add_collection(LineCollection(list(segments), colors=colours, linewidths=1.3, alpha=0.75, capstyle="round", clip_on=False))
    handles = []
    for kind in (0, 1, 2):
        name, colour = STATUS[kind]
        of_kind = points[status == kind]
        face, edge, width = ("white", colour, 1.0) if kind == 0 else (colour, "white", 0.4)
        dots = axes.plot(of_kind[:, 0], of_kind[:, 1], "o", markersize=4.2, color=colour, markerfacecolor=face)[0]
        dots.set(markeredgecolor=edge, markeredgewidth=width)
        handles.append(
            Line2D(
                [],
                [],
                marker="o",
                linestyle="none",
                markersize=7,
                color=colour,
                markerfacecolor=face,
                markeredgecolor=edge,
                markeredgewidth=width,
                label=f"{name} ({len(of_kind)})",
            )
        )
    scale, unit = prefixed("N", largest)
    longest = f"longest of the run: {largest / scale:.3g} {unit}" if scene.survey.force else "none in the run"
    handles.append(Line2D([], [], color=GREY, linewidth=1.6, label=f"reaction ({longest})"))
    page.drawing.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.02), ncols=4, handletextpad=0.5, columnspacing=1.8)
    page.title(run.title, describe(run, scene, instant))
    return page.drawing


def crack_figure(run: RunFolder, scene: Scene, instant: Instant, joints: Joints) -> Figure | None:
    """The joints by their opening since the beginning, which their surfaces tell, however far they are apart; None where none opened."""
    opening = opened(joints, instant, float((scene.survey.high - scene.survey.low).max()))
    if not opening.any():
        return None
    page = _Page(scene)
    axes = page.image(scene.image(instant, coloured=False))
    draw_joints(axes, scene, instant, joints, opening)
    page.gravity(axes, instant)
    scale, unit = prefixed("m", opening)
    page.bar((0.0, float(opening.max()) / scale), crack_colours(), f"opening of joints [{unit}]")
    page.title(run.title, describe(run, scene, instant))
    return page.drawing


def describe(run: RunFolder, scene: Scene, instant: Instant) -> str:
    """Time, imposed displacement (where the run names its column) and the factor on displacements, as one line."""
    time, imposed = _time(run, instant), _imposed(run, instant)
    words = [time, *([f"{_imposed_label(run)} {imposed}"] if imposed else []), _factor(scene)]
    return SEPARATOR.join(words)


def _time(run: RunFolder, instant: Instant) -> str:
    h = run.description.h
    digits = max(0, math.ceil(-math.log10(h) - 1e-9)) if h is not None and h > 0 else 3
    return f"t = {instant.t:.{digits}f} s"


def _factor(scene: Scene) -> str:
    return f"displacements × {scene.survey.exaggeration:g}"


def _imposed_label(run: RunFolder) -> str:
    imposed = run.plots.imposed
    return "" if imposed is None else (imposed.label or imposed.column).replace(" -", " −")


def _imposed(run: RunFolder, instant: Instant) -> str:
    """The imposed displacement with its unit; empty where the run names no such column."""
    imposed = run.plots.imposed
    value = None if imposed is None else run.at(imposed.column, instant.t)
    if imposed is None or value is None:
        return ""
    scale, unit = prefixed(imposed.unit or "m", run.numbers(imposed.column))
    return f"{value / scale:z.3f} {unit}".replace("-", "−")


class _Page:
    """A figure of fixed bands: title above, images in rows and columns at their own resolution, colours or legend below."""

    def __init__(self, scene: Scene, columns: int = 1, rows: int = 1, caption: float = 0.0) -> None:
        self.scene, self.columns, self.rows, self.caption = scene, columns, rows, caption
        self.cell_height = WIDTH / columns * scene.height / scene.width
        self.height = TOP + rows * (self.cell_height + caption) + BOTTOM
        self.drawing = figure(WIDTH, self.height, scene.width / WIDTH)

    def title(self, title: str, subtitle: str) -> Text:
        left = 0.25 / WIDTH
        self.drawing.text(left, 1 - 0.34 / self.height, title, fontsize=14, fontweight="bold", va="center")
        return self.drawing.text(left, 1 - 0.60 / self.height, subtitle, fontsize=11, color=GREY, va="center")

    def image(self, pixels: NDArray[np.uint8], place: int = 0, caption: str = "") -> Axes:
        row, column = divmod(place, self.columns)
        bottom = BOTTOM + (self.rows - 1 - row) * (self.cell_height + self.caption)
        axes = self.drawing.add_axes((column / self.columns, bottom / self.height, 1 / self.columns, self.cell_height / self.height))
        axes.set_axis_off()
        axes.imshow(pixels, interpolation="antialiased", aspect="auto", extent=(0, self.scene.width, self.scene.height, 0))
        axes.set(xlim=(0, self.scene.width), ylim=(self.scene.height, 0))
        if caption:
            x, y = (column + 0.5) / self.columns, (bottom + self.cell_height + 0.5 * self.caption) / self.height
            self.drawing.text(x, y, caption, ha="center", va="center", fontsize=10)
        return axes

    def colour_bar(self) -> None:
        if self.scene.survey.stress is None:
            return
        scale, unit = prefixed("Pa", self.scene.survey.stress)
        low, high = self.scene.survey.stress
        self.bar((low / scale, high / scale), colour_map(), f"von Mises stress [{unit}]", extend="max")

    def bar(self, ends: tuple[float, float], colours: Colormap, label: str, extend: str = "neither") -> None:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        axes = self.drawing.add_axes((0.25, 0.56 / self.height, 0.5, 0.14 / self.height))
        bar = self.drawing.colorbar(ScalarMappable(Normalize(*ends), colours), cax=axes, orientation="horizontal", extend=extend)
        bar.set_label(label, labelpad=2)
        bar.outline.set_linewidth(0.5)

    def gravity(self, axes: Axes, instant: Instant) -> list[Annotation]:
        """An arrow along gravity of that instant, in the upper right corner; nothing where there is none, or it is along the view."""
        g = gravity_of(instant)
        if g is None:
            return []
        seen = np.array([g @ self.scene.right, -(g @ self.scene.up)])
        if np.linalg.norm(seen) < 0.1 * np.linalg.norm(g):
            return []
        length = 0.045 * self.scene.width
        along = length * seen / np.linalg.norm(seen)
        centre = np.array([self.scene.width - 1.1 * length, -0.15 * length])
        tail, tip = centre - along / 2, centre + along / 2
        arrow = axes.annotate(
            "",
            tip,
            tail,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-|>", "color": GREY, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0},
        )
        letter = axes.annotate(
            "g", (centre[0] + 0.35 * length, centre[1]), color=GREY, fontsize=11, style="italic", va="center", annotation_clip=False
        )
        return [arrow, letter]


def _spread(instants: tuple[Instant, ...], number: int) -> list[Instant]:
    """Return up to `number` instants, evenly spread and ending with the last."""
    places = np.unique(np.round(np.linspace(0, len(instants) - 1, number + 1)[1:]).astype(int))
    return [instants[k] for k in places]
