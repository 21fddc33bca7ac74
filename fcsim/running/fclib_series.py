"""The problems of a simulation as FCLIB files, with solution and guess."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fcsim.errors import InputError
from fcsim.export_fclib.chunks import Compressor
from fcsim.export_fclib.content import Solution
from fcsim.export_fclib.write import file_name, write_fclib
from fcsim.timestep.step import Step


def write_step(
    directory: str | Path,
    step: Step,
    fclib_set: str,
    forms: Iterable[str] = ("global",),
    *,
    title: str = "",
    description: str = "",
    compression: bool | Compressor = True,
) -> list[Path]:
    """Write the step's problem into directory/<form>/<SET>-i<iterations>-<contacts>-<step>.hdf5, form "global" or "local".

    The solution is the step's result; the guess is where its solver began (from the last steps' reactions, matched contact by contact).
    math_info states sizes, contact density, solver and error. compression: see `write_fclib`.
    Returns the files' paths; a step without contacts is written too.
    """
    problem, result = step.problem, step.result
    v, multiplier = step.reduction.velocity(step.start)
    u = problem.H.T @ v + problem.w
    written = []
    for form in forms:
        if form not in ("global", "local"):
            raise InputError(f"FCLIB form {form!r}: expected 'global' or 'local'")
        is_global = form == "global"
        path = Path(directory) / form / file_name(fclib_set, result.iterations, problem.nc, step.number)
        path.parent.mkdir(parents=True, exist_ok=True)
        for earlier in path.parent.glob(f"{fclib_set}-i*-{step.number:05d}.hdf5"):  # of a run that was interrupted after this step
            earlier.unlink()
        write_fclib(
            path,
            problem if is_global else step.reduction.local,
            solution=Solution(result.u, result.r, result.v if is_global else None, result.multiplier if is_global else None),
            guesses=(Solution(u, step.start, v if is_global else None, multiplier if is_global else None),),
            title=title,
            description=description,
            math_info=f"n = {problem.n}, nc = {problem.nc}, m/n = {problem.m / problem.n:.4g}; solved by {result.method} in "
            f"{result.iterations} iterations, error {result.error:.3e}",
            compression=compression,
        )
        written.append(path)
    return written
