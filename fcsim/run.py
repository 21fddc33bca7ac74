"""Running a case into a folder: the consumers of a simulation's steps.

DIR/run.json       case, title, parameters, versions, status, and which columns the plots take
DIR/steps.csv      one row a step: contacts, solver, checks, energies, seconds, the case's sensors
DIR/vtk/           ParaView series of blocks, contacts, rigid bodies
DIR/fclib/global/  FCLIB files (and local/ where asked for)
DIR/checkpoint.h5  state and the last reactions: what `--resume` goes on from
"""

from __future__ import annotations

import csv
import json
import platform
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fcsim import __version__
from fcsim.case import Case, CaseScript, parse_parameters
from fcsim.errors import InputError, NotConverged
from fcsim.export_fclib.steps import write_step
from fcsim.files import replacing
from fcsim.timestep.simulation import Moment, Step
from fcsim.timestep.state import State
from fcsim.timestep.warm_start import Reactions
from fcsim.view.vtk import SeriesWriter

OWN_ENTRIES = ("run.json", "steps.csv", "vtk", "fclib", "checkpoint.h5", "pictures", "plots", "film.gif", "film.mp4")


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
    """How a run ended: status "finished", "not converged" or "interrupted"; seconds by phase; the solver chain's use."""

    status: str
    message: str
    steps: int
    computed: int
    seconds: Mapping[str, float]
    wall_time: float
    iterations: int
    largest_error: float
    fallbacks: int

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
    checkpoint = _read_checkpoint(directory / "checkpoint.h5") if resume else None
    start = checkpoint[0].number if checkpoint else 0
    if start > case.simulation.steps:
        raise InputError(f"--resume: expected at least the {start} steps that {directory} holds, got {case.simulation.steps}")
    if checkpoint is None:  # a new run, or one that stopped before its first checkpoint
        _check_folder(directory, overwrite or resume)
        _empty(directory)
    _write_json(directory / "run.json", {**description, "status": "running"})
    table = _StepTable(directory / "steps.csv", case, start)
    series = SeriesWriter(directory / "vtk", case.simulation.model) if options.vtk_every else None
    about = f"{case.description}; fcsim {__version__}; parameters: {asdict(parameters)}"
    status, message, last = "finished", "", None
    totals: dict[str, float] = {}
    iterations, largest, fallbacks, computed = 0, 0.0, 0, 0
    begin = time.perf_counter()
    try:
        for step in case.simulation.run(*checkpoint) if checkpoint else case.simulation:
            output = time.perf_counter()
            final = step.number == case.simulation.steps
            if series and (step.number % options.vtk_every == 0 or final):
                series.write(step)
            if options.export_every and step.number % options.export_every == 0:
                title = f"{case.title}, step {step.number}"
                write_step(directory / "fclib", step, case.fclib_set, options.export_forms, title=title, description=about)
            seconds = {**step.seconds, "output": time.perf_counter() - output}
            table.write(step, seconds)
            if final or (options.checkpoint_every and step.number % options.checkpoint_every == 0):
                _write_checkpoint(directory / "checkpoint.h5", step)
            seconds["output"] = time.perf_counter() - output
            for phase, value in seconds.items():
                totals[phase] = totals.get(phase, 0.0) + value
            iterations += step.result.iterations
            largest = max(largest, step.result.error)
            fallbacks += len(step.attempts) > 1
            computed += 1
            last = step
            if watch is not None:
                watch(case, step)
    except NotConverged as error:
        status, message = "not converged", str(error)
    except KeyboardInterrupt:
        status, message = "interrupted", "interrupted from the keyboard; go on with --resume"
    except BaseException as error:
        status, message = "failed", f"{type(error).__name__}: {error}"
        raise
    finally:
        table.close()
        reached = last.number if last is not None else start
        if last is not None:
            _write_checkpoint(directory / "checkpoint.h5", last)
        _write_json(directory / "run.json", {**description, "status": status, "message": message, "steps_done": reached})
    return Summary(status, message, reached, computed, totals, time.perf_counter() - begin, iterations, largest, fallbacks)


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
    simulation = case.simulation
    return {
        "case": script.name,
        "title": case.title,
        "description": case.description,
        "parameters": asdict(parameters),
        "assignments": dict(assignments),
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


def _write_checkpoint(path: Path, step: Step) -> None:
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        _write_moment(file, step.moment)
        _write_moment(file.create_group("anchor"), step.anchor)


def _write_moment(group: h5py.Group, moment: Moment) -> None:
    group.attrs["step"] = moment.number
    group.attrs["t"] = moment.state.t
    for name in ("x", "v"):
        group[name] = getattr(moment.state, name)
    memory = group.create_group("memory")
    for age, reactions in enumerate(moment.memory):
        for name in ("identity", "frame", "r"):
            memory[f"{age}/{name}"] = getattr(reactions, name)


def _read_checkpoint(path: Path) -> tuple[Moment, Moment] | None:
    """The moment to go on from, and its anchor."""
    if not path.is_file():
        return None
    try:
        with h5py.File(path) as file:
            return _read_moment(file), _read_moment(file["anchor"])
    except (OSError, KeyError) as error:
        raise InputError(f"{path}: expected a checkpoint of an earlier run: {error}") from None


def _read_moment(group: h5py.Group) -> Moment:
    state = State(float(group.attrs["t"]), group["x"][()], group["v"][()])
    stored = [group[f"memory/{age}"] for age in range(len(group["memory"]))]
    memory = tuple(Reactions(*(entry[name][()] for name in ("identity", "frame", "r"))) for entry in stored)
    return Moment(int(group.attrs["step"]), state, memory)


class _StepTable:
    """steps.csv, one row a step, flushed at once; a resumed run drops the rows after its checkpoint."""

    def __init__(self, path: Path, case: Case, start: int) -> None:
        self._case = case
        kept: list[list[str]] = []
        if start and path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                kept = [row for row in csv.reader(file) if row and row[0].isdigit() and int(row[0]) <= start]
        sensors = [sensor.column for sensor in case.sensors]
        header = [*_COLUMNS, "seconds_detection", "seconds_assembly", "seconds_solve", "seconds_output", *sensors]
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([header, *(row for row in kept if len(row) == len(header))])
        self._file = path.open("a", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)

    def write(self, step: Step, seconds: Mapping[str, float]) -> None:
        values = [_number(column(step, self._case)) for column in _COLUMNS.values()]
        phases = [f"{seconds.get(phase, 0.0):.5f}" for phase in ("detection", "assembly", "solve", "output")]
        self._writer.writerow([*values, *phases, *(_number(sensor.measure(step)) for sensor in self._case.sensors)])
        self._file.flush()

    def close(self) -> None:
        self._file.close()


def _number(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float | np.floating) else str(value)


def _kinetic(step: Step, case: Case) -> float:
    model, v = case.simulation.model, step.state.v
    return 0.5 * float(v @ model.apply_mass(v, model.rigid_mass(step.state.x)))


def _elastic(step: Step, case: Case) -> float:
    x = step.state.x
    return 0.5 * float(x @ case.simulation.model.apply_stiffness(x))


_COLUMNS: dict[str, Callable[[Step, Case], Any]] = {
    "step": lambda step, case: step.number,
    "t": lambda step, case: step.state.t,
    "nc": lambda step, case: len(step.contacts),
    "active": lambda step, case: int(np.count_nonzero(step.contact_status)),
    "sliding": lambda step, case: int(np.count_nonzero(step.contact_status == 2)),
    "sticking": lambda step, case: int(np.count_nonzero(step.contact_status == 1)),
    "status": lambda step, case: step.result.status.name,
    "solver": lambda step, case: step.result.method,
    "attempts": lambda step, case: len(step.attempts),
    "iterations": lambda step, case: step.result.iterations,
    "error": lambda step, case: step.result.error,
    "penetration": lambda step, case: step.penetration,
    "momentum_residual": lambda step, case: step.result.checks.momentum,
    "kinetic_energy": _kinetic,
    "elastic_energy": _elastic,
    "friction_dissipation": lambda step, case: step.friction_dissipation,
}
