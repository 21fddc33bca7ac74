"""Figures of performance profiles: one axes per tolerance, and all tolerances as panels."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fcsim.bench.reporting.comparison import Comparison, ToleranceComparison
from fcsim.bench.reporting.curves import CurveStyle, above_axes, curve_styles, edge_labels, log_ticks, strip_width
from fcsim.bench.reporting.profiles import Profile
from fcsim.bench.reporting.summary import number
from fcsim.bench.reporting.time_table import tolerance_name
from fcsim.errors import InputError
from fcsim.view.style import GREY, figure, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = 6  # markers a curve, spread evenly over the axis and shifted from curve to curve


def profile_figure(part: ToleranceComparison, tau_max: float | None = None) -> Figure:
    """The profile of one tolerance; tau_max defaults to just beyond the largest ratio, from which on no curve changes."""
    return _figure([part], tau_max or axis_end([part.profile]), columns=1, plot=(6.1, 3.9), size=10.0)


def panels_figure(parts: Sequence[ToleranceComparison], tau_max: float | None = None) -> Figure:
    """All tolerances with one tau axis, in two columns; a solver has the same look in all of them."""
    return _figure(parts, tau_max or axis_end([part.profile for part in parts]), columns=min(2, len(parts)), plot=(4.6, 3.0), size=9.0)


LEFT, RIGHT, BOTTOM, TOP = 0.72, 0.12, 0.62, 0.86  # [inch] around each plot with its labels


def _figure(parts: Sequence[ToleranceComparison], tau_max: float, *, columns: int, plot: tuple[float, float], size: float) -> Figure:
    """Plots of `plot` inches (higher where many labels need it) in rows of `columns`, each with its strip of labels."""
    most = max(len(part.table.solvers) for part in parts)
    width, height = plot[0], max(plot[1], 1.5 * size / 72 * most)
    strip = strip_width([f"100 %  {solver}" for part in parts for solver in part.table.solvers], size)
    cell = np.array([LEFT + width + strip + RIGHT, TOP + height + BOTTOM])
    rows = -(-len(parts) // columns)
    whole = cell * (columns, rows)
    drawing = figure(*whole)
    for place, part in enumerate(parts):
        x, y = cell * (place % columns, rows - 1 - place // columns) + (LEFT, BOTTOM)
        axes = drawing.add_axes((x / whole[0], y / whole[1], width / whole[0], height / whole[1]))
        labels = drawing.add_axes(((x + width) / whole[0], y / whole[1], strip / whole[0], height / whole[1]))
        _draw(axes, labels, part, tau_max, width, size)
    return drawing


def axis_end(profiles: Sequence[Profile]) -> float:
    """The end of a tau axis that shows every step of the curves, a little beyond the last; at least 2."""
    return max(2.0, 1.05 * max(profile.largest for profile in profiles))


def _draw(axes: Axes, strip: Axes, part: ToleranceComparison, tau_max: float, inches: float, size: float) -> None:
    profile, solvers = part.profile, part.table.solvers
    styles = curve_styles(len(solvers))
    for s in reversed(range(len(solvers))):  # the first solver on top
        _curve(axes, profile, s, styles[s], tau_max)
    axes.set_xscale("log")
    log_ticks(axes, 1.0, tau_max)
    for each in (axes, strip):
        each.set_ylim(-0.02, 1.03)
    axes.set_xlim(1, tau_max)
    axes.set_yticks(np.linspace(0, 1, 6))
    # the curves end at tau_max; whether all that is solved is solved within it, is said
    more = "" if tau_max >= profile.largest else f", largest ratio {number(profile.largest)}"
    axes.set_xlabel(f"τ = time / time of the fastest  (τₘₐₓ = {number(tau_max)}{more})", fontsize=size + 0.5)
    axes.set_ylabel("ρ(τ): fraction of the problems", fontsize=size + 0.5)
    axes.tick_params(labelsize=size)
    whole_words = part.description().replace(" ", "\u00a0").replace("·\u00a0", "· ")  # lines break between the counts only
    wrapped = textwrap.wrap(whole_words, round((inches + 0.6) / (0.0069 * size)))  # up to the strip's heading
    lines = [line.replace("\u00a0", " ").removesuffix(" ·") for line in wrapped]
    axes.set_title(f"tolerance {tolerance_name(part.table.tol)}", pad=8 + 1.3 * size * len(lines), fontsize=size + 2)
    above_axes(axes, 0, "\n".join(lines), size)
    if part.summary.censored_from <= min(tau_max, profile.largest):
        axes.axvline(part.summary.censored_from, color=GREY, linestyle=(0, (1, 3)), linewidth=1.0, zorder=1)
    order = profile.order(tau_max)
    labels = [f"{_percent(profile.solved[s])}  {solvers[s]}" for s in order]
    edge_labels(strip, profile.rho(tau_max)[order], labels, [styles[s] for s in order], size=size, heading="solved")


def _percent(fraction: float) -> str:
    """Three digits wide; 100 % and 0 % only where they are exact."""
    rounded = round(100 * float(fraction))
    rounded = min(rounded, 99) if fraction < 1 else rounded
    rounded = max(rounded, 1) if fraction > 0 else rounded
    return f"{rounded:3d} %".replace(" ", "\u2007", 3 - len(str(rounded)))  # blanks as wide as digits


def _curve(axes: Axes, profile: Profile, s: int, style: CurveStyle, tau_max: float) -> None:
    tau, rho = profile.steps(s, tau_max)
    axes.plot(tau, rho, drawstyle="steps-post", clip_on=False, **style.line)
    at = tau_max ** ((np.arange(MARKS) + (s + 0.5) / profile.ratios.shape[1]) / MARKS)
    reached = profile.rho(at)[:, s]
    some = reached > 0  # on the axis itself marks would only pile up
    axes.plot(at[some], reached[some], clip_on=False, **style.points)


def write_profiles(comparison: Comparison, directory: Path, tau_max: float | None = None) -> list[Path]:
    """Write profile-TOL for each tolerance and profiles (all of them, where there are several) as PNG and SVG; return the files."""
    if tau_max is not None and not 1 < tau_max < np.inf:
        raise InputError(f"--tau-max: expected a number > 1, got {tau_max:g}")
    written = []
    with styled(200):
        drawings = {f"profile-{tolerance_name(part.table.tol)}": profile_figure(part, tau_max) for part in comparison.parts}
        if len(comparison.parts) > 1:
            drawings["profiles"] = panels_figure(comparison.parts, tau_max)
        for name, drawing in drawings.items():
            written += [save(drawing, directory / f"{name}.{format}") for format in ("png", "svg")]
    return written
