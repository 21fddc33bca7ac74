"""What a bench shows on the terminal: a progress bar with the time left, and who solved how many at the end."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from types import TracebackType

from fcsim.bench.results import Measurement
from fcsim.bench.run import Progress
from fcsim.errors import MissingDependency

try:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as RichProgress
    from rich.table import Table
except ImportError as error:
    raise MissingDependency(f"rich cannot be imported ({error}): pip install 'fcsim[fem]'") from None


def duration(seconds: float) -> str:
    """Hours, minutes and seconds."""
    return str(timedelta(seconds=round(seconds)))


def _short(measurement: Measurement) -> str:
    m = measurement
    seconds = "" if m.seconds is None else f" {m.seconds:.3g} s"
    return f"{m.problem} {m.solver} {m.tol:g}: {m.outcome}{seconds}"


class Bar:
    """A bar with the last measurement and the time left; on a terminal only, else a line every twentieth of the bench."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._bar = RichProgress(
            TextColumn("measured"),
            MofNCompleteColumn(),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
            console=self._console,
            disable=not self._console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("", total=None)
        self._last = ""
        self._told = -1

    def __enter__(self) -> Bar:
        self._bar.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self._bar.__exit__(kind, value, trace)

    def update(self, progress: Progress, measurement: Measurement | None) -> None:
        """Show a measurement that has just ended, or that none has for a while."""
        if measurement is not None:
            self._last = _short(measurement)
        left = "" if progress.left is None else f"about {duration(progress.left)} left (at most {duration(progress.at_most)})"
        self._bar.update(self._task, completed=progress.done, total=progress.total, description=f"{left}  {self._last}")
        twentieth = 20 * progress.done // max(progress.total, 1)
        if not self._console.is_terminal and measurement is not None and twentieth > self._told:
            self._told = twentieth
            self._console.print(f"{progress.done} of {progress.total}: {left}; {self._last}", highlight=False, soft_wrap=True)


def print_summary(measurements: Sequence[Measurement]) -> None:
    """A table of the problems solved by solver and tolerance."""
    tols = sorted({m.tol for m in measurements}, reverse=True)
    table = Table(title="problems solved of those measured", caption="wrong: said to be solved, above the tolerance when recomputed")
    table.add_column("solver")
    for tol in tols:
        table.add_column(f"{tol:g}", justify="right")
    table.add_column("late", justify="right")
    table.add_column("killed, crashed", justify="right")
    table.add_column("wrong", justify="right")
    for solver in dict.fromkeys(m.solver for m in measurements):
        own = [m for m in measurements if m.solver == solver]
        cells = []
        for tol in tols:
            here = [m for m in own if m.tol == tol]
            cells.append(f"{sum(m.solved for m in here)} of {len(here)}" if here else "")
        counts = [
            sum(m.outcome in kinds for m in own) for kinds in (("TIME_LIMIT", "KILLED_TIME"), ("KILLED_MEMORY", "CRASHED"), ("WRONG",))
        ]
        table.add_row(solver, *cells, *(str(count) if count else "" for count in counts))
    Console().print(table)
