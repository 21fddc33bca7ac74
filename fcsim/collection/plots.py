"""Plots of a collection: distributions of its problems, and how a selection covers difficulty and time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.collection.manifest import Entry
from fcsim.collection.readme import one_a_problem
from fcsim.view.style import BLUE, GREY, RED, figure, matplotlib, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDE = 30.0  # ratio of the largest to the smallest value from which on an axis is logarithmic


def write_distributions(entries: Sequence[Entry], path: Path) -> Path:
    """Draw how contacts, degrees of freedom, contact density and iterations are distributed over the problems (.png or .svg).

    Raises MissingDependency without matplotlib.
    """
    rows = one_a_problem(entries)
    solver = ", ".join(sorted({row.solver for row in rows}))
    columns: dict[str, Sequence[float | None]] = {
        "contacts nc": [row.nc for row in rows],
        "degrees of freedom n": [row.n for row in rows],
        "contact density m/n": [row.density for row in rows],
        f"iterations, {solver}": [row.iterations for row in rows],
    }
    with styled():
        drawing = figure(8.0, 6.0, layout="constrained")
        for axes, (name, values) in zip(drawing.subplots(2, 2).flat, columns.items(), strict=True):
            _histogram(axes, np.array([value for value in values if value is not None], dtype=float), name)
        drawing.suptitle(f"{len(rows)} problem{'s' * (len(rows) != 1)}", x=0.01, ha="left", fontweight="bold")
        return save(drawing, path)


def _histogram(axes: Axes, values: FloatArray, name: str) -> None:
    axes.set(xlabel=name, ylabel="problems")
    axes.yaxis.set_major_locator(matplotlib().ticker.MaxNLocator(integer=True))
    if not len(values):
        axes.text(0.5, 0.5, "not known", transform=axes.transAxes, ha="center", va="center", color=GREY)
        axes.set(xticks=[], yticks=[])
        return
    low, high = values.min(), values.max()
    whole = bool(np.all(values == np.round(values)))
    if low == high:
        axes.bar([0], [len(values)], width=0.25, color=BLUE)
        axes.set(xlim=(-1, 1), xticks=[0], xticklabels=[f"{low:.6g}"])
        return
    if low > 0 and high / low > WIDE:
        axes.set_xscale("log")
        edges = np.geomspace(low, high * (1 + 1e-9), 21)
    elif whole and high - low <= 40:
        edges = np.arange(low, high + 2) - 0.5
        axes.xaxis.set_major_locator(matplotlib().ticker.MaxNLocator(integer=True))
    else:
        edges = np.linspace(low, high, 21)
    axes.hist(values, bins=list(edges), color=BLUE, edgecolor="white", linewidth=0.5)


def write_selection(
    iterations: Sequence[int], solved: Sequence[bool], chosen: Sequence[bool], path: Path, *, solver: str, ordered_by: str
) -> Path:
    """Draw the iterations of every problem in the order of time, (k,) each, with those chosen marked, unsolved ones as crosses on top."""
    good, taken = np.asarray(solved, dtype=bool), np.asarray(chosen, dtype=bool)
    count = np.asarray(iterations, dtype=float)
    highest, lowest = count[good].max(initial=1.0), count[good].min(initial=np.inf)
    wide = highest > WIDE * max(lowest, 1.0)
    count[~good] = highest * 1.6 if wide else highest * 1.08 + 0.5  # as they rank: the hardest
    place = np.arange(1, len(count) + 1)
    with styled():
        drawing = figure(8.0, 5.0, layout="constrained")
        axes = drawing.subplots()
        if wide:
            axes.set_yscale("log")
        for group, marker, what in ((good, "o", ""), (~good, "X", ", unsolved")):
            others, own = group & ~taken, group & taken
            if others.any():
                axes.plot(place[others], count[others], marker, color="#b0b0b0", markersize=4, label=f"not chosen{what} ({others.sum()})")
            if own.any():
                colour = RED if what else BLUE
                axes.plot(place[own], count[own], marker, color=colour, markersize=6, label=f"chosen{what} ({own.sum()})")
        axes.set(xlabel=ordered_by, ylabel=f"iterations of {solver} from r = 0")
        axes.set_title(f"{taken.sum()} of {len(count)} problems")
        axes.margins(x=0.02)
        drawing.legend(loc="outside lower center", ncols=2)
        return save(drawing, path)
