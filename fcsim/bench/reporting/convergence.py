"""Convergence of solvers on one problem: the error against time and against iterations."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fcsim.bench.reporting.curves import CurveStyle, above_axes, curve_styles, edge_labels, log_ticks, strip_width
from fcsim.bench.reporting.time_table import tolerance_name
from fcsim.bench.workers.compiling import compiled_so_far, watch
from fcsim.errors import InputError
from fcsim.files import replacing
from fcsim.view.style import GREY, figure, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WARM_UP = 0.5  # seconds of a solve that is not recorded: compiled code is loaded in it
WARM_UPS = 10  # of them at most, until one compiles nothing: the limit may end one before all has been called
MARKS = 6
BINS = 300  # points of a curve are thinned to what a picture shows


@dataclass(frozen=True, eq=False)
class Convergence:
    """One solve: rows of (iteration, seconds, error), and how it ended. Seconds count from the start, reduction included."""

    solver: str
    iteration: NDArray[np.float64]
    time: NDArray[np.float64]
    error_history: NDArray[np.float64]
    status: str
    error: float
    iterations: int
    seconds: float

    @property
    def solved(self) -> bool:
        return self.status == "SOLVED"


def solve_all(file: Path, solvers: Sequence[str], *, tol: float = 1e-8, time_limit: float = 100.0) -> list[Convergence]:
    """Solve an FCLIB file from r = 0 by each solver in turn, in this process.

    The time limit [s] is tested between iterations, so a solver may exceed it by one. Each is run briefly before, so that
    compiling and loading code does not count. Raises InputError for an unknown solver and for a file that cannot be solved.
    """
    from fcsim.export_fclib import read_fclib
    from fcsim.problem import GlobalProblem, LocalProblem
    from fcsim.solvers import method, solve

    for name in solvers:
        method(name)
    problem = read_fclib(file).problem
    if not isinstance(problem, GlobalProblem | LocalProblem):
        raise InputError(f"{file}: a rolling friction problem (spacedim 5), which benchmarks leave out; fcsim solve solves it")
    runs = []
    watch(lambda begins: None)
    for name in solvers:
        for _ in range(WARM_UPS):
            before = compiled_so_far()
            solve(problem, name, tol=tol, error="published", time_limit=min(WARM_UP, time_limit))
            if compiled_so_far() == before:
                break
        result = solve(problem, name, tol=tol, error="published", time_limit=time_limit)
        rows = np.array(result.history, dtype=float).reshape(-1, 3)
        iteration, seconds, error = rows.T
        runs.append(Convergence(name, iteration, seconds, error, result.status.name, result.error, result.iterations, result.time))
    return runs


def convergence_figure(runs: Sequence[Convergence], title: str, tol: float) -> Figure:
    """Two panels with a common error axis: against seconds and against iterations; a cross ends the curve of a solve that failed."""
    size, height, width, left, bottom, top = 10.0, max(3.9, 0.21 * len(runs)), 4.6, 0.85, 0.62, 0.66
    strip = strip_width([_label(run) for run in runs], size)
    whole = np.array([left + 2 * width + 0.3 + strip + 0.1, bottom + height + top])
    drawing = figure(*whole)
    places = [(left, width), (left + width + 0.3, width), (left + 2 * width + 0.3, strip)]
    by_time, by_iteration, labels = (
        drawing.add_axes((x / whole[0], bottom / whole[1], w / whole[0], height / whole[1])) for x, w in places
    )
    styles = curve_styles(len(runs))
    for axes in (by_time, by_iteration):
        axes.set_yscale("log")
    by_time.set_xscale("log")
    by_iteration.set_xscale("symlog", linthresh=1.0)
    low, high = _limits(runs, tol)
    for k, run in enumerate(runs):
        some = run.error_history > 0  # an exact zero has no place on a logarithmic axis
        for axes, x in ((by_time, run.time), (by_iteration, run.iteration)):
            _curve(axes, x[some], run.error_history[some], styles[k], (k + 0.5) / len(runs), run.solved, high)
    for axes in (by_time, by_iteration):
        axes.set_ylim(low, high)
        axes.axhline(tol, color=GREY, linestyle=(0, (8, 4)), linewidth=1.0)
        axes.text(0.01, tol, f"tolerance {tolerance_name(tol)}", transform=axes.get_yaxis_transform(), va="bottom", color=GREY, fontsize=9)
    log_ticks(by_time, *by_time.get_xlim())
    by_iteration.tick_params(labelleft=False)
    by_iteration.set_xlim(left=0)
    by_time.set_ylabel("relative error")
    by_time.set_xlabel("time [s], reduction included")
    by_iteration.set_xlabel("iteration")
    by_time.set_title(title, pad=20)
    above_axes(by_time, 0, "from r = 0", size)
    order = ranked(runs)
    labels.set_ylim(0, 1)
    edge_labels(labels, None, [_label(runs[k]) for k in order], [styles[k] for k in order], size=size)
    return drawing


def _label(run: Convergence) -> str:
    return run.solver + ("" if run.solved else f" ({run.status.lower().replace('_', ' ')})")


def ranked(runs: Sequence[Convergence]) -> list[int]:
    """Those that solved by time, then the others by their last error."""
    return sorted(range(len(runs)), key=lambda k: (not runs[k].solved, runs[k].seconds if runs[k].solved else runs[k].error))


def _limits(runs: Sequence[Convergence], tol: float) -> tuple[float, float]:
    errors = np.concatenate([[tol], *(run.error_history for run in runs)])
    errors = errors[np.isfinite(errors) & (errors > 0)]
    high = min(3 * errors.max(), 1e4 * max(1.0, np.median([run.error_history[0] for run in runs if len(run.error_history)] or [1.0])))
    return max(errors.min() / 3, 1e-4 * tol), float(high)


def _curve(axes: Axes, x: NDArray, y: NDArray, style: CurveStyle, phase: float, solved: bool, high: float) -> None:
    if not len(x):
        return
    kept = thinned(x, y)
    axes.plot(x[kept], y[kept], **style.line)
    scale = np.log1p(x / max(x[0], 1e-12)) if axes.get_xscale() == "log" else np.log1p(x)
    at = np.searchsorted(scale, scale[0] + (scale[-1] - scale[0]) * (np.arange(MARKS) + phase) / MARKS)
    axes.plot(x[at], y[at], **style.points)
    end = np.clip(y[-1:], None, high)  # one that diverged ends at the top
    look = {**style.points, "markerfacecolor": style.colour, "markersize": 8} if solved else {"marker": "x", "color": style.colour}
    axes.plot(x[-1:], end, clip_on=False, **(look if solved else {**look, "markersize": 9, "markeredgewidth": 2}))


def thinned(x: NDArray, y: NDArray, bins: int = BINS) -> NDArray[np.int64]:
    """Indices of the first, the lowest and the highest point of each bin of log x, and of the last: the same picture with less points."""
    if len(x) <= 3 * bins:
        return np.arange(len(x))
    scale = np.log1p(x / max(x[x > 0].min(initial=1.0), 1e-12))
    place = np.minimum((bins * (scale - scale[0]) / max(scale[-1] - scale[0], 1e-300)).astype(int), bins - 1)
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    low = [int(s + np.argmin(part)) for s, part in zip(starts, np.split(y, starts[1:]), strict=True)]
    high = [int(s + np.argmax(part)) for s, part in zip(starts, np.split(y, starts[1:]), strict=True)]
    return np.unique(np.concatenate([starts, low, high, [len(x) - 1]]))


def write_convergence(runs: Sequence[Convergence], name: str, directory: Path, tol: float) -> list[Path]:
    """Write convergence-NAME as PNG, SVG and CSV (solver, iteration, seconds, error); return the files."""
    stem = f"convergence-{name}"
    with styled(200):
        drawing = convergence_figure(runs, name, tol)
        written = [save(drawing, directory / f"{stem}.{format}") for format in ("png", "svg")]
    path = directory / f"{stem}.csv"
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("solver", "iteration", "seconds", "error"))
        for run in runs:
            rows = zip(run.iteration.astype(int).tolist(), run.time.tolist(), run.error_history.tolist(), strict=True)
            writer.writerows((run.solver, *row) for row in rows)
    return [*written, path]
