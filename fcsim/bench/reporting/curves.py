"""Many curves in one plot, told apart in print: colour, dashes and marker of each, and labels at the right edge in place of a legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcsim.view.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RED, SKY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WINE, OLIVE = "#882255", "#7F7F1A"  # two more, after Paul Tol's muted scheme (https://personal.sron.nl/~pault/)
COLOURS = (BLACK, BLUE, RED, GREEN, PURPLE, ORANGE, SKY, GREY, WINE, OLIVE)
Dashes = str | tuple[int, tuple[float, ...]]
DASHES: tuple[Dashes, ...] = ("-", (0, (5, 1.6)), (0, (1.2, 1.2)), (0, (7, 1.6, 1.4, 1.6)), (0, (4, 1.2, 1.2, 1.2, 1.2, 1.2)))
MARKERS = "os^DvPX<>*p"


class Look(TypedDict, total=False):
    """What matplotlib is told of a line and its markers."""

    color: str
    linestyle: Dashes
    linewidth: float
    marker: str
    markersize: float
    markerfacecolor: str
    markeredgecolor: str
    markeredgewidth: float


@dataclass(frozen=True)
class CurveStyle:
    """How a solver's curve is drawn: colour, dashes, marker (hollow or full), scale of line and marker."""

    colour: str
    dashes: Dashes
    marker: str
    hollow: bool
    scale: float = 1.0

    @property
    def line(self) -> Look:
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": 1.6 * self.scale}

    @property
    def points(self) -> Look:
        face = "white" if self.hollow else self.colour
        size = self.scale * (5.0 if self.marker in "sD" else 6.2)
        return Look(
            linestyle="none", marker=self.marker, markersize=size, markerfacecolor=face, markeredgecolor=self.colour, markeredgewidth=1.2
        )


def curve_styles(number: int) -> list[CurveStyle]:
    """Styles of up to 110 curves, no two alike; the first 10 differ in colour, the first 11 in marker alone, for print in grey."""
    return [CurveStyle(COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)], MARKERS[k % len(MARKERS)], k % 2 == 1) for k in range(number)]


def spread(wanted: ArrayLike, gap: float, low: float, high: float) -> NDArray[np.float64]:
    """Places for labels: nearest (least squares) to the wanted ones, which descend, at least `gap` apart, between low and high.

    With x_i = place_i + i gap the distances become an ordering, and the places its isotonic regression. Where the labels do not fit,
    the gap is what fits.
    """
    from scipy.optimize import isotonic_regression

    y = np.asarray(wanted, dtype=float)
    if len(y) == 0:
        return y
    gap = min(gap, (high - low) / max(len(y) - 1, 1))
    index = np.arange(len(y))
    x = isotonic_regression(y + index * gap, increasing=False).x
    return np.clip(x, low + (len(y) - 1) * gap, high) - index * gap


def strip_width(labels: Sequence[str], size: float) -> float:
    """[inch] The width that `edge_labels` needs in letters of `size` points."""
    return SAMPLE + 0.0092 * size * max(map(len, labels))


SAMPLE = 0.85  # inch from the plot's edge to the labels: a leading line, then a sample of the curve


def edge_labels(
    axes: Axes, heights: ArrayLike | None, labels: Sequence[str], styles: Sequence[CurveStyle], *, size: float, heading: str = ""
) -> None:
    """Label curves in `axes`, a strip right of their plot with the same y limits: each at its height [data], from top to bottom.

    A thin line leads from the curve's end to a sample of the curve and its label, moved where labels would overlap. Curves
    that do not reach the edge have no heights: then the labels are a list.
    """
    low, high = axes.get_ylim()
    figure = axes.get_figure(root=True)
    assert figure is not None
    inches = figure.get_size_inches() * axes.get_position().size
    gap = 1.5 * size / 72 / inches[1] * (high - low)
    axes.set_axis_off()
    axes.set_xlim(0, inches[0])
    ends = np.full(len(labels), high) if heights is None else np.asarray(heights, dtype=float)
    places = spread(ends, gap, low + 0.4 * gap, high - 0.4 * gap)
    for end, place, label, style in zip(ends, places, labels, styles, strict=True):
        if heights is not None:
            axes.plot([0.04, 0.22], [end, place], color="#9a9a9a", linewidth=0.6, clip_on=False)
        axes.plot([0.24, SAMPLE - 0.09], [place, place], clip_on=False, **style.line)
        axes.plot([(0.15 + SAMPLE) / 2], [place], clip_on=False, **style.points)
        axes.text(SAMPLE, place, label, va="center", fontsize=size)
    above_axes(axes, SAMPLE / inches[0], heading, size)


def above_axes(axes: Axes, x: float, text: str, size: float) -> None:
    """Grey text 4 points above the axes, whatever their height, from the fraction x of their width on."""
    axes.annotate(text, (x, 1), (0, 4), "axes fraction", "offset points", va="bottom", color=GREY, fontsize=size, annotation_clip=False)


def log_ticks(axes: Axes, low: float, high: float) -> None:
    """Ticks of a logarithmic x axis from low to high as plain numbers, the denser the fewer decades there are."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

    decades = np.log10(high / low)
    multiples = (1, 2, 3, 5) if decades < 1.2 else (1, 2, 5) if decades < 2.5 else (1,)
    exponents = range(int(np.floor(np.log10(low))), int(np.floor(np.log10(high))) + 1)
    ticks = [m * 10.0**e for e in exponents for m in multiples]
    axes.xaxis.set_major_locator(FixedLocator([t for t in ticks if low * (1 - 1e-9) <= t <= high * (1 + 1e-9)]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
