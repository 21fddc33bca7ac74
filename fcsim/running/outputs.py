"""What a run writes of each step: the row of its table, FCLIB and VTK files, checkpoints."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from fcsim.errors import InputError
from fcsim.export_fclib.chunks import Compressor
from fcsim.interrupts import end_forks_of
from fcsim.running.case import Case
from fcsim.running.checkpoint import write_checkpoint
from fcsim.running.fclib_series import write_step
from fcsim.running.step_table import StepTable, write_hdf5
from fcsim.running.vtk_series import SeriesWriter
from fcsim.runtime import release_freed_memory
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.version import __version__
from fcsim.witness import Witness

RELEASED_EVERY = 500
"""After so many steps the pages between what is used are given back: arrays of ever other sizes leave holes that add up, a percent of the
process in some thousand steps. Seldom, since the next step has to have its pages cleared anew (`keep_freed_memory`)."""


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
        self._compressor = Compressor()
        self._about = f"{case.description}; fcsim {__version__}; parameters: {asdict(parameters)}"  # type: ignore[call-overload]
        self.last: Step | None = None

    def take(self, step: Step) -> Mapping[str, float]:
        """Write a step; return its seconds by phase, those of this writing under "output"."""
        begin, options = time.perf_counter(), self._options
        final = step.number == self._case.simulation.steps
        if self._series and (step.number % options.vtk_every == 0 or final):
            self._series.write(step)
        if options.export_every and step.number % options.export_every == 0:
            self._export(step)
        self._table.write(step, {**step.seconds, "output": time.perf_counter() - begin})
        self.last = step
        if step.number % RELEASED_EVERY == 0:
            release_freed_memory()
        if final or (options.checkpoint_every and step.number % options.checkpoint_every == 0):
            self._table.to_the_disk()
            write_checkpoint(self._directory / "checkpoint.h5", step, self._origin)
        return {**step.seconds, "output": time.perf_counter() - begin}

    def _export(self, step: Step) -> None:
        write_step(
            self._directory / "fclib",
            step,
            self._case.fclib_set,
            self._options.export_forms,
            iterations=self._options.export_iterations,
            title=f"{self._case.title}, step {step.number}",
            description=self._about,
            compression=self._compressor,
        )

    def end(self, describe_end: Callable[[], None]) -> None:
        """Write what is written last, the most important first: checkpoint, description, table with units.

        On a full disk each is tried all the same. Raises the first error once all were.
        """
        end_forks_of(self._process)
        first: OSError | None = None
        for write in (self._table.close, self._last_checkpoint, describe_end, self._table_with_units):
            try:
                write()
            except OSError as error:
                first = first or error
        if first is not None:
            raise first

    def _last_checkpoint(self) -> None:
        if self.last is not None:
            write_checkpoint(self._directory / "checkpoint.h5", self.last, self._origin)

    def _table_with_units(self) -> None:
        write_hdf5(self._directory / "steps.csv", self._directory / "steps.h5", self._case.sensors)


class Unwritten:
    """In the place of `Outputs` on ranks that write nothing."""

    last: Step | None = None

    def take(self, step: Step) -> Mapping[str, float]:
        self.last = step
        return step.seconds

    def end(self, describe_end: Callable[[], None]) -> None:
        return
