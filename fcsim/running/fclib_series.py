"""The problems of a simulation as FCLIB files, with solution and guess."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.export_fclib.chunks import Compressor
from fcsim.export_fclib.content import Solution
from fcsim.export_fclib.write import file_name, write_fclib
from fcsim.linear.sparse.columns import transposed_times
from fcsim.problem import LocalProblem
from fcsim.problem.problem import GlobalForm
from fcsim.problem.reduction import BlockFactor, Reduction
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.solvers import Result
from fcsim.timestep.step import Step


def write_step(
    directory: str | Path,
    step: Step,
    fclib_set: str,
    forms: Iterable[str] = ("global",),
    *,
    iterations: bool = False,
    title: str = "",
    description: str = "",
    compression: bool | Compressor = True,
) -> list[Path]:
    """Write the step's problem into directory/<form>/<SET>-i<iterations>-<contacts>-<step>.hdf5, form "global" or "local".

    The solution is the step's result; the guess is where its solver began (from the last steps' reactions, matched contact by contact).
    math_info states sizes, contact density, solver, error and the time step that is in M: of a step that was cut, that of its last part.
    compression: see `write_fclib`.
    iterations: of a step with nonlinear bodies also the problems that led to the last one, as the sets <SET>-newton00, -newton01, ...
    Returns the files' paths; a step without contacts is written too.
    """
    series = FclibSeries(Path(directory), fclib_set, tuple(forms), iterations, description, compression)
    return [write() for write in series.files(step, title)]


@dataclass(frozen=True)
class FclibSeries:
    """Where the steps' problems are written, which of them, and what the files say; as in `write_step`."""

    directory: Path
    fclib_set: str
    forms: tuple[str, ...]
    iterations: bool
    description: str
    compression: bool | Compressor

    def files(self, step: Step, title: str) -> list[Callable[[], Path]]:
        """What writes the files of a step, one call a file; all that needs the step's factors is computed here already."""
        if unknown := [form for form in self.forms if form not in ("global", "local")]:
            raise InputError(f"FCLIB form {unknown[0]!r}: expected 'global' or 'local'")
        if isinstance(step.problem, GlobalRollingProblem) and "local" in self.forms:
            raise InputError("FCLIB form 'local': expected 'global' with rolling resistance, for which FCLIB has no local form")
        to = _Files(self, step.number, title, _length(step))
        files = to.of(self.fclib_set, step.reduction, step.result, step.start, step.guess)
        for k, earlier in enumerate(step.linearised[:-1] if self.iterations else ()):
            reduction = Reduction(earlier.problem, BlockFactor(earlier.problem.entries))
            guess = reduction.velocity(earlier.start)
            files += to.of(f"{self.fclib_set}-newton{k:02d}", reduction, earlier.result, earlier.start, guess)
        return files


@dataclass(frozen=True)
class _Files:
    """The files of the step `number`; length: what they say of its length."""

    series: FclibSeries
    number: int
    title: str
    length: str

    def of(
        self, fclib_set: str, reduction: Reduction, result: Result, start: FloatArray, velocity: tuple[FloatArray, FloatArray | None]
    ) -> list[Callable[[], Path]]:
        """What writes one problem in all forms, with its solution and the guess r = start (m,), of which velocity is (v, l)."""
        problem, (v, multiplier) = reduction.problem, velocity
        guess = Solution(transposed_times(problem.H, v) + problem.w, start, v, multiplier)
        answer = Solution(result.u, result.r, result.v, result.multiplier)
        sizes = f"n = {problem.n}, nc = {problem.nc}, m/n = {problem.m / max(problem.n, 1):.4g}"
        solved = f"solved by {result.method} in {result.iterations} iterations, error {result.error:.3e}"

        def write(form: str, given: GlobalForm | LocalProblem) -> Path:
            path = self.series.directory / form / file_name(fclib_set, result.iterations, problem.nc, self.number)
            path.parent.mkdir(parents=True, exist_ok=True)
            for earlier in path.parent.glob(f"{fclib_set}-i*-{self.number:05d}.hdf5"):  # of a run that was interrupted after this step
                earlier.unlink()
            without_v = form == "local"
            return write_fclib(
                path,
                given,
                solution=Solution(answer.u, answer.r) if without_v else answer,
                guesses=(Solution(guess.u, guess.r) if without_v else guess,),
                title=self.title,
                description=self.series.description,
                math_info=f"{sizes}; {solved}; {self.length}",
                compression=self.series.compression,
            )

        forms = self.series.forms
        return [partial(write, form, problem if form == "global" else reduction.local.whole) for form in forms]


def _length(step: Step) -> str:
    """The length of the step that the problem is of."""
    part = f", the last of {step.substeps} parts of a step that was cut" if step.substeps > 1 else ""
    return f"time step {step.scheme.h:.6g} s{part}"
