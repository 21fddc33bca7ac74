"""Running a case into a folder: the consumers of a simulation's steps.

DIR/run.json       case, title, parameters, versions, status, and which columns the plots take
DIR/steps.csv      one row a step: contacts, solver, checks, energies, seconds, the case's sensors
DIR/steps.h5       the same with units, written when the run ends
DIR/vtk/           ParaView series of blocks, contacts, rigid bodies
DIR/fclib/global/  FCLIB files (and local/ where asked for)
DIR/checkpoint.h5  state and the last reactions: what `--resume` goes on from
"""

from __future__ import annotations

import json
import platform
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from fcsim.errors import InputError, NotConverged, Penetration
from fcsim.export_fclib.chunks import Compressor
from fcsim.files import replacing
from fcsim.running.case import Case, CaseScript, parse_parameters
from fcsim.running.checkpoint import read_checkpoint, write_checkpoint
from fcsim.running.fclib_series import write_step
from fcsim.running.step_table import StepTable, write_hdf5
from fcsim.running.vtk_series import SeriesWriter
from fcsim.runtime import is_interrupt
from fcsim.timestep.step import Step
from fcsim.version import __version__
from fcsim.witness import Overlap

OWN_ENTRIES = ("run.json", "steps.csv", "steps.h5", "vtk", "fclib", "checkpoint.h5", "pictures", "plots", "film.gif", "film.mp4")


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Every how many steps to write FCLIB files, VTK files and checkpoints (0 = none), and the forms of the FCLIB files."""

    export_every: int = 10
    export_forms: tuple[str, ...] = ("global",)
    vtk_every: int = 10
    checkpoint_every: int = 20

    def __post_init__(self) -> None:
        for name in ("export_every", "vtk_every", "checkpoint_every"):
            if getattr(self, name) < 0:
                raise InputError(f"{name.replace('_', '-')}: expected a whole number >= 0 (0 = none), got {getattr(self, name)}")


@dataclass(frozen=True)
class Summary:
    """How a run ended: status "finished", "not converged", "failed" (penetration seen) or "interrupted"; seconds by phase; steps that
    needed the fallback chain, steps that were cut; energy_residual the largest of a step [J]; overlap the largest that the witness saw;
    notes: what is to be known of the results."""

    status: str
    message: str
    steps: int
    computed: int
    seconds: Mapping[str, float]
    wall_time: float
    iterations: int
    largest_error: float
    fallbacks: int
    cut: int
    energy_residual: float
    overlap: Overlap
    notes: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        return self.status == "finished"


def run_case(
    script: CaseScript,
    assignments: Mapping[str, str],
    directory: str | Path,
    options: RunOptions | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    watch: Callable[[Case, Step], None] | None = None,
) -> Summary:
    """Run a case script with the given parameter texts into a folder; `watch` is called after each step.

    resume goes on from the folder's checkpoint with the parameters stored there (steps may be raised); overwrite empties an earlier
    run's folder first. Nothing is touched before the case is built. Returns the summary also when a step does not converge or the run
    is interrupted by Ctrl-C.
    """
    options = options or RunOptions()
    directory = Path(directory)
    if resume:
        assignments = _resumed_assignments(directory, script, assignments)
    else:
        _check_folder(directory, overwrite)
    parameters = parse_parameters(script, assignments)
    case = script.build(parameters)
    description = _describe(case, script, parameters, assignments, options)
    checkpoint = read_checkpoint(directory / "checkpoint.h5") if resume else None
    start = checkpoint[0].number if checkpoint else 0
    if start > case.simulation.steps:
        raise InputError(f"--resume: expected at least the {start} steps that {directory} holds, got {case.simulation.steps}")
    if checkpoint is None:  # a new run, or one that stopped before its first checkpoint
        _check_folder(directory, overwrite or resume)
        _empty(directory)
    _write_json(directory / "run.json", {**description, "status": "running"})
    table = StepTable(directory / "steps.csv", case.sensors, start)
    series = SeriesWriter(directory / "vtk", case.simulation.model) if options.vtk_every else None
    about = f"{case.description}; fcsim {__version__}; parameters: {asdict(parameters)}"
    compressor = Compressor()
    status, message, last = "finished", "", None
    totals: dict[str, float] = {}
    overlap = Overlap()
    iterations, largest, fallbacks, cut, computed, residual = 0, 0.0, 0, 0, 0, 0.0
    begin = time.perf_counter()
    try:
        for step in case.simulation.run(*checkpoint) if checkpoint else case.simulation:
            output = time.perf_counter()
            final = step.number == case.simulation.steps
            if series and (step.number % options.vtk_every == 0 or final):
                series.write(step)
            if options.export_every and step.number % options.export_every == 0:
                title = f"{case.title}, step {step.number}"
                write_step(
                    directory / "fclib",
                    step,
                    case.fclib_set,
                    options.export_forms,
                    title=title,
                    description=about,
                    compression=compressor,
                )
            seconds = {**step.seconds, "output": time.perf_counter() - output}
            table.write(step, seconds)
            if final or (options.checkpoint_every and step.number % options.checkpoint_every == 0):
                write_checkpoint(directory / "checkpoint.h5", step)
            seconds["output"] = time.perf_counter() - output
            for phase, value in seconds.items():
                totals[phase] = totals.get(phase, 0.0) + value
            iterations += step.iterations
            cut += step.substeps > 1
            residual = max(residual, abs(step.energy.residual))
            overlap = max(overlap, step.overlap or overlap, key=lambda seen: seen.depth)
            largest = max(largest, step.result.error)
            fallbacks += len(step.attempts) > step.substeps
            computed += 1
            last = step
            if watch is not None:
                watch(case, step)
    except NotConverged as error:
        status, message = "not converged", str(error)
    except Penetration as error:
        status, message = "failed", str(error)
    except BaseException as error:
        if not is_interrupt(error):
            status, message = "failed", f"{type(error).__name__}: {error}"
            raise
        status, message = "interrupted", "interrupted from the keyboard; go on with --resume"
    finally:
        table.close()
        write_hdf5(directory / "steps.csv", directory / "steps.h5", case.sensors)
        reached = last.number if last is not None else start
        if last is not None:
            write_checkpoint(directory / "checkpoint.h5", last)
        seen = {"depth": overlap.depth, "share": overlap.share, "between": overlap.between}
        ending = {"status": status, "message": message, "steps_done": reached, "overlap": seen}
        _write_json(directory / "run.json", {**description, **ending})
    return Summary(
        status=status,
        message=message,
        steps=reached,
        computed=computed,
        seconds=totals,
        wall_time=time.perf_counter() - begin,
        iterations=iterations,
        largest_error=largest,
        fallbacks=fallbacks,
        cut=cut,
        energy_residual=residual,
        overlap=overlap,
        notes=case.simulation.notes,
    )


def _check_folder(directory: Path, overwrite: bool) -> None:
    """Refuse a folder that holds anything but an earlier run's results, and those too unless they may be replaced."""
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: expected a folder for the results, found a file")
    entries = {entry.name for entry in directory.iterdir()} if directory.exists() else set()
    foreign = entries - set(OWN_ENTRIES)
    if foreign:
        raise InputError(f"{directory}: expected an empty or new folder for the results, found {', '.join(sorted(foreign)[:5])}")
    if entries and not overwrite:
        raise InputError(f"{directory}: holds the results of an earlier run; go on with --resume, replace it with --overwrite")


def _empty(directory: Path) -> None:
    """Make the folder, or remove an earlier run's results."""
    for name in OWN_ENTRIES:
        path = directory / name
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    directory.mkdir(parents=True, exist_ok=True)


def _resumed_assignments(directory: Path, script: CaseScript, given: Mapping[str, str]) -> dict[str, str]:
    """The parameters of the run to go on with and those given now; only the number of steps may differ."""
    path = directory / "run.json"
    if not path.is_file():
        raise InputError(f"{directory}: expected the folder of an earlier run to resume, found no run.json")
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{path}: expected JSON: {error}") from None
    if stored.get("case") != script.name:
        raise InputError(f"{directory}: expected a run of case {script.name!r} to resume, found {stored.get('case')!r}")
    assignments = {**stored.get("assignments", {}), **given}
    now = json.loads(json.dumps(asdict(parse_parameters(script, assignments))))  # tuples become lists, as in the file
    first = stored.get("parameters", {})
    for name in [name for name in (*first, *now) if name != "steps"]:
        if first.get(name) != now.get(name):
            raise InputError(f"--resume: expected the first run's {name} = {first.get(name)}, got {now.get(name)}")
    return assignments


def _describe(case: Case, script: CaseScript, parameters: Any, assignments: Mapping[str, str], options: RunOptions) -> dict[str, Any]:
    """What run.json holds, apart from the status."""
    sensors = {sensor.column: {"column": sensor.column, "label": sensor.label, "unit": sensor.unit} for sensor in case.sensors}
    plots: dict[str, Any] = {}
    if "imposed" in case.plots:
        plots["imposed"] = sensors[case.plots["imposed"]]
    if "reaction" in case.plots:
        plots["reaction"] = [sensors[column] for column in case.plots["reaction"]]
    if "bound" in case.plots:
        value, label = case.plots["bound"]
        plots["bound"] = {"value": value, "label": label}
    if "histories" in case.plots:
        time_axis = {"column": "t", "label": "time", "unit": "s"}
        plots["histories"] = [
            {
                "name": history.name,
                "against": time_axis if history.against == "t" else sensors[history.against],
                "curves": [sensors[column] for column in history.columns],
            }
            for history in case.plots["histories"]
        ]
    simulation = case.simulation
    return {
        "case": script.name,
        "title": case.title,
        "description": case.description,
        "parameters": asdict(parameters),
        "assignments": dict(assignments),
        "scheme": repr(simulation.scheme),
        "notes": simulation.notes,
        "h": simulation.scheme.h,
        "steps": simulation.steps,
        "solver": simulation.solver.name,
        "tol": simulation.solver.tol,
        "options": asdict(options),
        "plots": plots,
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Versions of fcsim, Python and the packages that matter to a result."""
    found = {"fcsim": __version__, "python": platform.python_version()}
    for name in ("numpy", "scipy", "numba", "fenics-dolfinx", "dolfinx-solver-real", "gmsh"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
