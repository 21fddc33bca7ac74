"""The common look of plots and pictures: matplotlib without pyplot, fonts, colours, SI prefixes, saving."""

from __future__ import annotations

import textwrap
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcsim.errors import InputError, MissingDependency
from fcsim.files import replacing
from fcsim.runtime import without_local_options

if TYPE_CHECKING:
    from types import ModuleType

    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers tell apart (https://jfly.uni-koeln.de/color)
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, YELLOW, BLACK = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#F0E442", "#000000",
)  # fmt: skip
GREY = "#595959"

STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib: the same picture on every machine
    "font.size": 11.0,
    "axes.titlesize": 12.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e3e3",
    "lines.linewidth": 1.8,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "svg.fonttype": "none",
}

PREFIXES = {
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm")),
    "N": ((1e9, "GN"), (1e6, "MN"), (1e3, "kN"), (1.0, "N"), (1e-3, "mN"), (1e-6, "µN"), (1e-9, "nN")),
    "Pa": ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (1.0, "Pa")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")),
    "J": ((1e9, "GJ"), (1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "µJ"), (1e-9, "nJ"), (1e-12, "pJ")),
}


LEAST = {"m": 0.0999, "Pa": 0.0999}  # 0.36 mm and 0.45 MPa rather than 360 µm and 450 kPa


KINDS = (".png", ".jpg", ".svg", ".pdf")
"""Of pictures whose name is the user's."""


def matplotlib() -> ModuleType:
    """Return the matplotlib package; MissingDependency where it is absent."""
    try:
        with without_local_options():
            import matplotlib
            import matplotlib.figure
    except ImportError as error:
        raise MissingDependency(f"matplotlib cannot be imported ({error}), which pictures need: pip install 'fcsim[view]'") from None
    return matplotlib


def styled(dpi: int = 160) -> AbstractContextManager[None]:
    """Within the block plots have the common look, and files as many points an inch."""
    context: AbstractContextManager[None] = matplotlib().rc_context({**STYLE, "savefig.dpi": dpi})
    return context


def figure(width: float, height: float, dpi: float = 100.0, **options: object) -> Figure:
    """Return a figure of width x height [inch], owned by the caller alone (pyplot knows nothing of it)."""
    return matplotlib().figure.Figure(figsize=(width, height), dpi=dpi, **options)


LONGEST_LABEL, TWO_LINES = 80, 0.6
"""Characters of a line of a legend, which fit into the width of a plot; height [inch]."""


def legend_below(drawing: Figure, most: int, **options: object) -> None:
    """A legend of all curves under the axes, in as many columns as fit into the width, at most `most`; long labels in several lines. The
    figure grows by what is higher than two lines, so that the axes keep their height."""
    entries = [entry for axes in drawing.axes for entry in zip(*axes.get_legend_handles_labels(), strict=True)]
    handles, labels = [handle for handle, _ in entries], [textwrap.fill(str(label), LONGEST_LABEL) for _, label in entries]
    for columns in range(max(min(most, len(labels)), 1), 0, -1):
        legend = drawing.legend(handles, labels, loc="outside lower center", ncols=columns, **options)
        box = legend.get_window_extent()
        if columns == 1 or box.width <= 0.98 * drawing.bbox.width:
            drawing.set_figheight(drawing.get_figheight() + max(0.0, box.height / drawing.dpi - TWO_LINES))
            return
        legend.remove()


def refuse_picture(path: Path) -> None:
    """InputError where the path's suffix is that of no picture."""
    if path.suffix.lower() not in KINDS:
        raise InputError(f"{path}: expected the name of a picture, {', '.join(KINDS)}, got {path.suffix or 'no suffix'}")


def save(drawing: Figure, path: Path) -> Path:
    """Write a figure, in the format of the path's suffix, under a temporary name and rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        drawing.savefig(temporary, format=path.suffix[1:].lower())
    return path


def prefixed(unit: str, *values: ArrayLike | None) -> tuple[float, str]:
    """Return (factor, unit with SI prefix), the largest prefix with which the largest value is at least 1 (0.1 m, 0.1 Pa)."""
    finite = [np.abs(np.ravel(np.asarray(v, dtype=float))) for v in values if v is not None]
    every: NDArray = np.concatenate([*finite, [0.0]])
    largest = every[np.isfinite(every)].max()
    choices = PREFIXES.get(unit, ((1.0, unit),))
    if largest == 0:
        return 1.0, unit
    return next(((factor, name) for factor, name in choices if largest >= LEAST.get(unit, 0.9999) * factor), choices[-1])
