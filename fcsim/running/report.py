"""What a run shows on the terminal: a progress bar with the state of the step, and a summary table at the end."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from fcsim.errors import MissingDependency
from fcsim.running.case import Case
from fcsim.running.run import Summary
from fcsim.timestep.step import Step

try:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress
    from rich.table import Table
except ImportError as error:
    raise MissingDependency(f"rich cannot be imported ({error}): pip install 'fcsim[fem]'") from None


class Progress:
    """A bar with step, contacts, iterations, error and time left; on a terminal only, else a line every tenth of the run."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._progress = RichProgress(
            TextColumn("step"),
            MofNCompleteColumn(),
            BarColumn(),
            TextColumn("{task.description}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
            transient=True,
        )
        self._task: TaskID | None = None

    def __enter__(self) -> Progress:
        self._progress.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self._progress.__exit__(kind, value, trace)

    def update(self, case: Case, step: Step) -> None:
        """Show the step that has just ended."""
        total = case.simulation.steps
        text = f"{len(step.contacts)} contacts, {step.result.iterations} iterations, error {step.result.error:.1e}"
        if self._task is None:
            self._task = self._progress.add_task(text, total=total)
        self._progress.update(self._task, completed=step.number, description=text)
        if step.substeps > 1:
            self._progress.console.print(f"step {step.number}: cut into {step.substeps} parts")
        elif len(step.attempts) > 1:
            tried = "; ".join(f"{a.solver} from {a.start}: {a.status}" for a in step.attempts)
            self._progress.console.print(f"step {step.number}: fallback chain used ({tried})")
        every = max(1, total // 10)
        if not self._console.is_terminal and (step.number % every == 0 or step.number == total):
            self._console.print(f"step {step.number} of {total}: {text}", highlight=False)


def print_summary(summary: Summary, directory: Path) -> None:
    """Print how the run ended, the seconds by phase and where the results are."""
    console = Console()
    phases = sum(summary.seconds.values())
    table = Table(title=f"{summary.status}: {summary.computed} steps computed, {summary.wall_time:.1f} s")
    table.add_column("phase")
    for heading in ("seconds", "seconds a step", "share"):
        table.add_column(heading, justify="right")
    for phase, seconds in [*summary.seconds.items(), ("sum", phases)]:
        share = f"{100 * seconds / phases:.0f} %" if phases else "-"
        table.add_row(phase, f"{seconds:.2f}", f"{seconds / max(summary.computed, 1):.4f}", share)
    console.print(table)
    console.print(
        f"iterations {summary.iterations}, largest error {summary.largest_error:.1e}, steps that needed the fallback chain "
        f"{summary.fallbacks}, steps that were cut {summary.cut}, largest residual of the energy balance {summary.energy_residual:.1e} J",
        highlight=False,
    )
    if summary.overlap.bodies is not None:
        seen = summary.overlap
        console.print(
            f"largest overlap seen {seen.depth:.2e} m, {100 * seen.share:.2g} % of a body's extent, between {seen.between}", highlight=False
        )
    for note in summary.notes:
        console.print(note, highlight=False)
    if summary.message:
        console.print(summary.message, highlight=False)
    console.print(f"results: {directory} (run.json, steps.csv, vtk/*.pvd for ParaView, fclib/)", highlight=False)
    if summary.converged:
        console.print(f"pictures, film and plots: fcsim render {directory}", highlight=False)
