"""Plots of a run's table of steps: reaction, energies, contacts, convergence, time by phase, and the histories that a case declares."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fcsim.errors import InputError
from fcsim.running.description import Column, HistoryPlot
from fcsim.running.folder import RunFolder
from fcsim.view.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RED, SKY, figure, legend_below, prefixed, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg")
CONVERGED = ("SOLVED", "CONVERGED")


def write_plots(run: RunFolder, directory: Path | None = None, *, format: str = "png") -> list[Path]:
    """Write reaction, energies, contacts, convergence, phases and the case's histories (.png or .svg) into `directory` (default
    DIR/plots); return what was written.

    A plot whose columns are not in steps.csv is left out. Raises InputError for another format, MissingDependency without matplotlib.
    """
    if format not in FORMATS:
        raise InputError(f"write_plots: expected a format among {', '.join(FORMATS)}, got {format!r}")
    directory = run.directory / "plots" if directory is None else Path(directory)
    makers: dict[str, Callable[[RunFolder], Figure | None]] = {
        "reaction": reaction_plot,
        "energies": energy_plot,
        "contacts": contact_plot,
        "convergence": convergence_plot,
        "phases": phase_plot,
    }
    written = []
    with styled():
        for name, make in makers.items():
            drawing = make(run)
            if drawing is not None:
                written.append(save(drawing, directory / f"{name}.{format}"))
        for history in run.plots.histories:
            drawing = history_plot(run, history)
            if drawing is not None:
                written.append(save(drawing, directory / f"{history.name}.{format}"))
    return written


def reaction_plot(run: RunFolder) -> Figure | None:
    """Reactions [N] against the imposed displacement [m], or over time where run.json's "plots" names none, with the bound; None unless
    it names columns of reactions that exist.

    All with the signs that they have in steps.csv; the bound on the side, or both, to which the reactions go.
    """
    imposed, bound = run.plots.imposed or Column("t", "time", "s"), run.plots.bound
    x = run.numbers(imposed.column)
    curves = [(entry, values) for entry in run.plots.reaction if (values := run.numbers(entry.column)) is not None]
    if x is None or not curves:
        return None
    scale, y_unit = prefixed(curves[0][0].unit or "N", None if bound is None else bound.value, *(values for _, values in curves))
    x_scale, x_unit = prefixed(imposed.unit or "m", x)

    drawing, axes = _one_panel()
    shapes = (("-", 2.6), ("--", 1.6), (":", 1.6), ("-.", 1.6))  # curves that coincide, as at equilibrium, stay visible
    for (entry, values), colour, (dash, width) in zip(curves, (BLUE, ORANGE, GREEN, PURPLE), shapes, strict=False):
        axes.plot(x / x_scale, values / scale, dash, color=colour, linewidth=width, label=entry.label or entry.column)
    if bound is not None:
        label: str | None = f"{bound.label}: {bound.value / scale:.4g} {y_unit}"
        for side in _sides([values for _, values in curves], bound.value):
            axes.axhline(side * bound.value / scale, color=RED, linestyle=(0, (6, 2)), linewidth=1.4, label=label)
            label = None  # once in the legend
    axes.set_xlabel(f"{imposed.label or imposed.column} [{x_unit}]")
    axes.set_ylabel(f"reaction [{y_unit}]")
    axes.margins(x=0.02, y=0.08)
    axes.set_title(run.title)
    legend_below(drawing, 2)
    return drawing


def energy_plot(run: RunFolder) -> Figure | None:
    """Energies, and what loads, supports and dissipation exchanged up to each time, added up from the first step; None without them."""
    t = run.numbers("t")
    curves = [
        ("kinetic_energy", "kinetic", BLUE, "-", False),
        ("elastic_energy", "elastic", GREEN, "-", False),
        ("load_work", "work of loads", BLACK, "--", True),
        ("support_work", "work of supports", GREY, "--", True),
        ("damping_dissipation", "dissipated by damping", PURPLE, ":", True),
        ("numerical_dissipation", "by the time scheme", SKY, ":", True),
        ("normal_dissipation", "by impacts", ORANGE, ":", True),
        ("tangential_dissipation", "by friction", RED, ":", True),
    ]
    present = [
        (label, colour, dash, np.cumsum(v) if add else v) for n, label, colour, dash, add in curves if (v := run.numbers(n)) is not None
    ]
    if t is None or not any(np.any(values) for *_, values in present):
        return None
    largest = max(float(np.nanmax(np.abs(values))) for *_, values in present)
    scale, unit = prefixed("J", largest)
    t_scale, t_unit = prefixed("s", t)
    drawing, axes = _one_panel()
    for label, colour, dash, values in present:
        if np.nanmax(np.abs(values)) > 1e-6 * largest:
            axes.plot(t / t_scale, values / scale, dash, color=colour, label=label, linewidth=1.8)
    axes.set(xlabel=f"time [{t_unit}]", ylabel=f"energy [{unit}]", title=run.title)
    axes.margins(x=0.01)
    legend_below(drawing, 4)
    return drawing


def history_plot(run: RunFolder, history: HistoryPlot) -> Figure | None:
    """A case's history: curves of sensors against time or another sensor, as run.json's "plots" names them; None where columns miss."""
    against = history.against
    x = run.numbers(against.column)
    curves = [(entry, values) for entry in history.curves if (values := run.numbers(entry.column)) is not None]
    if x is None or not curves:
        return None
    x_scale, x_unit = prefixed(against.unit, x)
    scale, unit = prefixed(curves[0][0].unit, *(values for _, values in curves))
    drawing, axes = _one_panel()
    colours = (BLUE, ORANGE, GREEN, PURPLE, RED, SKY, BLACK, GREY)
    for k, (entry, values) in enumerate(curves):
        dash = "-" if k == 0 or len(curves) > 2 else "--"
        axes.plot(x / x_scale, values / scale, dash, color=colours[k % len(colours)], label=entry.label or entry.column, linewidth=1.6)
    y_label = f"[{unit}]" if len(curves) > 1 else f"{curves[0][0].label} [{unit}]"
    axes.set(xlabel=f"{against.label or against.column} [{x_unit}]", ylabel=y_label)
    axes.set_title(run.title)
    axes.margins(x=0.01)
    if len(curves) > 1:
        legend_below(drawing, 3)
    return drawing


def contact_plot(run: RunFolder) -> Figure | None:
    """Numbers of candidate, active, sticking and sliding contacts over time."""
    t, x_label = _abscissa(run)
    curves = [
        ("nc", "candidates", GREY, "--"),
        ("active", "active (closed)", BLACK, "-"),
        ("sticking", "sticking", BLUE, "-"),
        ("sliding", "sliding", RED, "-"),
    ]
    present = [(label, colour, dash, v) for name, label, colour, dash in curves if (v := run.numbers(name)) is not None]
    if t is None or not present:
        return None
    drawing, axes = _one_panel()
    axes.locator_params(axis="y", integer=True)
    for label, colour, dash, values in present:
        axes.plot(t, values, dash, color=colour, label=label, linewidth=1.4 if dash == "--" else 1.8)
    axes.set(xlabel=x_label, ylabel="number of contacts", ylim=(0, None), title=run.title)
    axes.margins(x=0.01)
    legend_below(drawing, 4)
    return drawing


def convergence_plot(run: RunFolder) -> Figure | None:
    """Iterations and error of each step, the error on a logarithmic axis; steps that did not converge are marked."""
    number = run.numbers("step")
    rows = [(name, v) for name in ("iterations", "error") if (v := run.numbers(name)) is not None and np.any(np.isfinite(v))]
    if number is None or not rows:
        return None
    status = run.columns.get("status", np.array([]))
    failed = np.array([s.upper() not in CONVERGED for s in status]) if status.dtype.kind == "U" else np.zeros(len(number), bool)
    drawing = figure(8.0, 2.6 * len(rows) + 0.9, layout="constrained")
    panels = np.atleast_1d(drawing.subplots(len(rows), 1, sharex=True))
    for axes, (name, values) in zip(panels, rows, strict=True):
        if name == "error":
            values = np.where(values > 0, values, np.nan)  # an exact zero has no place on a logarithmic axis
            axes.set_yscale("log")
            if not np.any(np.isfinite(values)):
                axes.set_ylim(1e-16, 1.0)
            if (tolerance := run.description.tol) is not None and tolerance > 0:
                axes.axhline(tolerance, color=RED, linestyle=(0, (6, 2)), linewidth=1.4, label=f"tolerance {tolerance:.0e}")
        axes.plot(number, values, ".", color=BLUE, markersize=5)
        axes.set_ylabel("iterations" if name == "iterations" else "relative error")
        if failed.any():
            axes.plot(number[failed], values[failed], "x", color=RED, markersize=9, label=f"not converged ({failed.sum()} steps)")
        axes.margins(x=0.01)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2)
        if name == "iterations":
            axes.set_ylim(0, max(1.0, 1.05 * float(np.nanmax(values, initial=0.0))))  # all of 0 have no range
            axes.yaxis.get_major_locator().set_params(integer=True)
    panels[-1].xaxis.get_major_locator().set_params(integer=True)
    panels[0].set_title(run.title)
    panels[-1].set_xlabel("step")
    return drawing


def phase_plot(run: RunFolder) -> Figure | None:
    """Wall-clock time of each step by phase (columns seconds_*), stacked, with the mean of each phase in the legend."""
    number = run.numbers("step")
    phases = {
        n.removeprefix("seconds_"): np.nan_to_num(v) for n in run.columns if n.startswith("seconds_") and (v := run.numbers(n)) is not None
    }
    phases = {name: values for name, values in phases.items() if name != "total"}
    if number is None or not phases:
        return None
    total = np.sum(list(phases.values()), axis=0)
    usual = 3 * np.percentile(total, 95)  # a step that compiles kernels would flatten all others
    scale, unit = prefixed("s", np.minimum(total, usual))
    labels = [f"{name}: {values.mean() / scale:.3g} {unit}" for name, values in phases.items()]
    drawing, axes = _one_panel()
    colours = [SKY, ORANGE, BLUE, GREEN, PURPLE, RED, GREY][: len(phases)]
    axes.stackplot(number, [values / scale for values in phases.values()], labels=labels, colors=colours, step="mid", linewidth=0)
    if usual > 0 and total.max() > usual:
        axes.set_ylim(0, usual / scale)
        out = np.flatnonzero(total > usual)
        longest = f"at most {total.max() / scale:.0f} {unit} (step {number[total.argmax()]:.0f})"
        note = f"beyond the axis: {len(out)} step{'s' * (len(out) > 1)}, {longest}"
        axes.text(0.99, 0.97, note, transform=axes.transAxes, ha="right", va="top", color=GREY, fontsize=10)
    axes.set(xlabel="step", ylabel=f"time per step [{unit}]", title=f"{run.title}: {total.sum():.3g} s in {len(number)} steps")
    axes.locator_params(axis="x", integer=True)
    axes.margins(x=0.0)
    legend_below(drawing, 4, title="mean of each phase")
    return drawing


def _one_panel() -> tuple[Figure, Axes]:
    drawing = figure(8.0, 5.0, layout="constrained")
    return drawing, drawing.subplots()


def _abscissa(run: RunFolder) -> tuple[NDArray[np.float64] | None, str]:
    t = run.numbers("t")
    if t is None:
        return run.numbers("step"), "step"
    scale, unit = prefixed("s", t)
    return t / scale, f"time [{unit}]"


def _sides(curves: list[NDArray], bound: float) -> list[float]:
    """On which sides the curves come to half of a bound, 1 and -1; where they come to none, that of the largest value."""
    values = np.concatenate(curves)
    values = values[np.isfinite(values)]
    if not values.size:
        return [1.0]
    sides = [side for side in (1.0, -1.0) if (side * values).max() > 0.5 * abs(bound)]
    return sides or [-1.0 if values[np.argmax(np.abs(values))] < 0 else 1.0]
