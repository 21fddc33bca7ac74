"""What a run writes of each step: the row of its table, FCLIB and VTK files, checkpoints."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import cast

from fcsim.errors import InputError
from fcsim.export_fclib.chunks import Compressor
from fcsim.interrupts import end_forks_of
from fcsim.ranks import shared
from fcsim.running.case import Case
from fcsim.running.checkpoint import write_checkpoint
from fcsim.running.fclib_series import FclibSeries
from fcsim.running.step_table import Row, StepTable, write_hdf5
from fcsim.running.vtk_series import SeriesWriter
from fcsim.runtime import release_freed_memory, threads
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.version import __version__
from fcsim.witness import Witness

RELEASED_EVERY = 500
"""After so many steps the pages between what is used are given back: arrays of ever other sizes leave holes that add up, a percent of the
process in some thousand steps. Seldom, since the next step has to have its pages cleared anew (`keep_freed_memory`)."""
ROWS_BEHIND_FILES = 3
"""Steps of which nothing but a row is to be written that may wait, with what they hold, for the files of one before them: files take as
long as two or three steps of a wall."""


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Every how many steps to write FCLIB files, VTK files and checkpoints (0 = none), and the forms of the FCLIB files;
    export_iterations: also the problems that led to the last one of a step with nonlinear bodies.

    witness_every, witness_tolerance: of the witness of penetration, None = what the case says; witness_every = 0: nobody looks.
    """

    export_every: int = 10
    export_forms: tuple[str, ...] = ("global",)
    vtk_every: int = 10
    checkpoint_every: int = 20
    export_iterations: bool = False
    witness_every: int | None = None
    witness_tolerance: float | None = None

    def __post_init__(self) -> None:
        for name in ("export_every", "vtk_every", "checkpoint_every"):
            if getattr(self, name) < 0:
                raise InputError(f"{name.replace('_', '-')}: expected a whole number >= 0 (0 = none), got {getattr(self, name)}")


def witnessed(simulation: Simulation, options: RunOptions) -> Simulation:
    """The simulation with the witness that the options ask for. InputError: numbers that a witness does not take."""
    if options.witness_every == 0:
        return replace(simulation, witness=None)
    if options.witness_every is None and options.witness_tolerance is None:
        return simulation
    own = simulation.witness or Witness()
    every = own.every if options.witness_every is None else options.witness_every
    tolerance = own.tolerance if options.witness_tolerance is None else options.witness_tolerance
    return replace(simulation, witness=replace(own, every=every, tolerance=tolerance))


class Outputs:
    """Takes the steps of a run one after the other and writes what its options ask for."""

    def __init__(self, directory: Path, case: Case, parameters: object, options: RunOptions, start: int, origin: str) -> None:
        self._directory, self._case, self._options, self._origin = directory, case, options, origin
        self._process = os.getpid()
        self._table = StepTable(directory / "steps.csv", case.sensors, start)
        self._series = SeriesWriter(directory / "vtk", case.simulation.model) if options.vtk_every else None
        about = (case.description, f"fcsim {__version__}", f"parameters: {asdict(parameters)}")  # type: ignore[call-overload] # a dataclass: `case`
        text = "; ".join(filter(None, about))
        forms, iterations = options.export_forms, options.export_iterations
        self._fclib = FclibSeries(directory / "fclib", case.fclib_set, forms, iterations, text, Compressor())
        self._beside: ThreadPoolExecutor | None = None
        self._writing: deque[Future[None]] = deque()  # steps on their way, in their order
        self._failed = False
        self.last: Step | None = None

    def take(self, step: Step) -> Mapping[str, float]:
        """Write a step, whose files may still be on their way when this returns, with the rows of `ROWS_BEHIND_FILES` steps after it:
        `finish` waits for them.

        Returns its seconds by phase, under "output" those that the run waited for here. Errors of the files of a step before are
        raised as soon as they are known; its own also by a later `take`, or by `finish`.
        """
        begin, options = time.perf_counter(), self._options
        final = step.number == self._case.simulation.steps
        drawn = bool(self._series) and (step.number % options.vtk_every == 0 or final)
        exported = bool(options.export_every) and step.number % options.export_every == 0
        kept = final or bool(options.checkpoint_every and step.number % options.checkpoint_every == 0)
        more = exported or drawn or kept
        self._wait(0 if more else ROWS_BEHIND_FILES)
        row, files = self._table.row(step), self._fclib.files(step, f"{self._case.title}, step {step.number}") if exported else []
        write = partial(self._write, step, row, files, drawn=drawn, kept=kept, prepared=time.perf_counter() - begin)
        if self._writing or (more and not final and self._may_be_beside):
            self._beside = self._beside or ThreadPoolExecutor(1, "fcsim-files")
            self._writing.append(self._beside.submit(self._unless_one_failed, write))
        else:
            write()
        if step.number % RELEASED_EVERY == 0:
            release_freed_memory()
        return {**step.seconds, "output": time.perf_counter() - begin}

    @property
    def _may_be_beside(self) -> bool:
        """Whether files are written while the next step is computed: what nonlinear bodies show is computed by what computes the steps.
        Nor beside the exchanges of ranks."""
        return threads() > 1 and not shared() and not self._case.simulation.model.nonlinear

    def _unless_one_failed(self, write: Callable[[], None]) -> None:
        """Write a step behind others, of which all are written: the table has no holes."""
        if self._failed:
            return
        try:
            write()
        except BaseException:  # an interrupt, too
            self._failed = True
            raise

    def _write(self, step: Step, row: Row, files: list[Callable[[], Path]], *, drawn: bool, kept: bool, prepared: float) -> None:
        """The files of a step, then its row, which says how long that took, then the checkpoint, which stands for all before it."""
        begin = time.perf_counter()
        if drawn and self._series is not None:
            self._series.write(step)
        for write in files:
            write()
        self._table.write(row, {**step.seconds, "output": prepared + time.perf_counter() - begin})
        self.last = step
        if kept:
            self._table.to_the_disk()
            write_checkpoint(self._directory / "checkpoint.h5", step, self._origin)

    def finish(self) -> None:
        """Return when what was taken is written; raises what went wrong there."""
        self._wait(0)

    def _wait(self, behind: int) -> None:
        """Return when no more than `behind` steps are on their way; raises what went wrong with those that are not any more."""
        while self._writing and (len(self._writing) > behind or self._writing[0].done()):
            wait([self._writing[0]])  # where an interrupt strikes here, `end` waits anew
            self._writing.popleft().result()

    def end(self, describe_end: Callable[[], None], failed: bool = False) -> None:
        """Write what is written last: what was taken before, checkpoint, table with units, and then the description, so that a run that is
        killed meanwhile is not said to have finished; of one that failed before its first instant also that, see `_only_instant`.

        On a full disk each is tried all the same. Raises the first error once all were.
        """
        end_forks_of(self._process)
        first: Exception | None = None
        while self._writing:
            wait([self._writing[0]])  # not its result: an interrupt would look like its error
            first = first or cast(Exception | None, self._writing.popleft().exception())
        if self._beside is not None:
            self._beside.shutdown()
        pictured = (self._only_instant,) if failed else ()
        for write in (self._table.close, self._last_checkpoint, self._table_with_units, *pictured, describe_end):
            try:
                write()
            except (OSError, RuntimeError) as error:  # HDF5 has both where a disk is full
                first = first or error
        if first is not None:
            raise first

    def _last_checkpoint(self) -> None:
        if self.last is not None:
            write_checkpoint(self._directory / "checkpoint.h5", self.last, self._origin)

    def _only_instant(self) -> None:
        """Where a run has ended without an instant in its series: its last step, or the state in which it began and the contacts of its
        first step as they are found. What goes wrong there is not said beside why the run ended."""
        series, simulation = self._series, self._case.simulation
        if series is None or not series.empty:
            return
        if self.last is not None:
            series.write(self.last)
            return
        model, scheme = simulation.model, simulation.scheme
        try:
            state = simulation.initial or at_rest(model, h=scheme.h)
            contacts = simulation.detector(model.positions(scheme.detection_configuration(model, state)))
        except InputError:
            return
        series.write_beginning(state, contacts)

    def _table_with_units(self) -> None:
        write_hdf5(self._directory / "steps.csv", self._directory / "steps.h5", self._case.sensors)


class Unwritten:
    """In the place of `Outputs` on ranks that write nothing."""

    last: Step | None = None

    def take(self, step: Step) -> Mapping[str, float]:
        self.last = step
        return step.seconds

    def finish(self) -> None:
        return

    def end(self, describe_end: Callable[[], None], failed: bool = False) -> None:
        return
