"""A case: a simulation with a name, its parameters, and what is measured at every step."""

from __future__ import annotations

import dataclasses
import re
import shlex
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypedDict

from fcsim.arrays import is_number
from fcsim.brief import brief, shown
from fcsim.errors import FcsimError, InputError
from fcsim.files import plain_name, resolved, run_script, sha256
from fcsim.running.known_cases import case_place
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclass(frozen=True)
class Sensor:
    """A number measured at every step: column name in steps.csv, label and unit for plots, measure(step)."""

    column: str
    label: str
    unit: str
    measure: Callable[[Step], float]

    def __post_init__(self) -> None:
        if not (isinstance(self.column, str) and self.column.strip() and self.column.isprintable() and not set(self.column) & set(',"')):
            raise InputError(f"Sensor, column: expected a name of one line without commas and quotation marks, got {shown(self.column)}")
        for name in ("label", "unit"):
            if not isinstance(getattr(self, name), str):
                raise InputError(f"Sensor {self.column!r}, {name}: expected a text, got {shown(getattr(self, name))}")
        if not callable(self.measure):
            raise InputError(f"Sensor {self.column!r}, measure: expected a function of a step, got {shown(self.measure)}")


@dataclass(frozen=True)
class History:
    """A plot of columns of steps.csv over time or another column, drawn by `fcsim render` as plots/NAME.png; columns of one unit."""

    name: str
    columns: tuple[str, ...]
    against: str = "t"

    def __post_init__(self) -> None:
        plain_name(self.name, "history")
        if not isinstance(self.columns, (tuple, list)):  # a text would be taken letter by letter
            raise InputError(f"history {self.name!r}, columns: expected a tuple, as (one,), got {shown(self.columns)}")


class PlotWishes(TypedDict, total=False):
    """What `fcsim render` is to plot of a case; columns among those of its sensors."""

    imposed: str
    reaction: tuple[str, ...]
    bound: tuple[float, str]
    histories: tuple[History, ...]


@dataclass(frozen=True, eq=False)
class Case:
    """What a case script's `build(parameters)` returns.

    plots: for `fcsim render`: {"imposed": column, "reaction": (columns), "bound": (value, label), "histories": (History, ...)}; each
           optional, its columns among those of the sensors
    fclib_set: name of the FCLIB set that its exported problems form
    """

    name: str
    title: str
    simulation: Simulation
    sensors: tuple[Sensor, ...] = ()
    plots: PlotWishes = field(default_factory=PlotWishes)
    fclib_set: str = "FCSIM"
    description: str = ""

    __repr__ = brief

    def __post_init__(self) -> None:
        if not isinstance(self.simulation, Simulation):
            raise InputError(f"case {self.name!r}, simulation: expected a Simulation, got {type(self.simulation).__name__}")
        if not isinstance(self.sensors, (tuple, list)):
            given = type(self.sensors).__name__
            raise InputError(f"case {self.name!r}, sensors: expected a tuple of Sensors, (first, second) or (one,), got {given}")
        for sensor in self.sensors:
            if not isinstance(sensor, Sensor):
                raise InputError(f"case {self.name!r}, sensors: expected each a Sensor, got {type(sensor).__name__}")
        columns = [sensor.column for sensor in self.sensors]
        twice = sorted({column for column in columns if columns.count(column) > 1})
        if twice:
            raise InputError(f"case {self.name!r}, sensors: expected different columns, got {', '.join(twice)} more than once")
        _check_plots(self.name, self.plots)
        histories = self.plots.get("histories", ())
        plotted = [*([self.plots["imposed"]] if "imposed" in self.plots else []), *self.plots.get("reaction", ())]
        for history in histories:
            plotted += [*history.columns, *([] if history.against == "t" else [history.against])]
        for column in plotted:
            if column not in columns:
                raise InputError(f"case {self.name!r}, plots: expected columns among {', '.join(columns)}, got {column!r}")
        units = {sensor.column: sensor.unit for sensor in self.sensors}
        for history in histories:
            if len({units[column] for column in history.columns}) != 1:
                raise InputError(
                    f"case {self.name!r}, history {history.name!r}: expected columns of one unit, got {', '.join(history.columns)}"
                )


def _check_plots(case: str, plots: PlotWishes) -> None:
    """InputError where what is to be plotted is another kind of thing, or has a name that nobody would draw."""
    known = tuple(PlotWishes.__annotations__)
    if not isinstance(plots, dict):
        raise InputError(f"case {case!r}, plots: expected a dictionary of some of {', '.join(known)}, got {type(plots).__name__}")
    for name, value in plots.items():
        if name not in known:
            raise InputError(f"case {case!r}, plots: expected some of {', '.join(known)}, got {shown(name)}")
        if name in ("reaction", "histories") and not isinstance(value, (tuple, list)):  # a text would be taken letter by letter
            raise InputError(f"case {case!r}, plots: expected a tuple as {name!r}, as (one,), got {shown(value)}")
    for history in plots.get("histories", ()):
        if not isinstance(history, History):
            raise InputError(f"case {case!r}, plots: expected each of 'histories' a History, got {type(history).__name__}")
    if "bound" in plots and not (isinstance(plots["bound"], (tuple, list)) and len(plots["bound"]) == 2 and is_number(plots["bound"][0])):
        raise InputError(f"case {case!r}, plots: expected 'bound' as (value, label), got {shown(plots['bound'])}")


@dataclass(frozen=True, eq=False)
class CaseScript:
    """A case script as found on disk: folder/name.py with a frozen dataclass `Parameters` and a function `build`; SHA-256 of its text."""

    name: str
    path: Path
    parameters: type[Any]  # the case's own dataclass: a script that runs another's case knows its fields, mypy cannot
    build: Callable[..., Case]
    sha256: str


def load_case(path: str | Path) -> CaseScript:
    """Load the case script at `path`: a folder `cases/name` holding `name.py`, the script itself, or, where no such path is there, the name
    of a case that comes with fcsim, as "arch"."""
    given = case_place(path)
    script = given / f"{resolved(given).name}.py" if given.is_dir() else given
    if not script.is_file() or script.suffix != ".py":
        raise InputError(f"case {str(path)!r}: expected a folder NAME that holds NAME.py, or such a script; found no {script}")
    name = script.stem
    digest = sha256(script)
    try:
        module = run_script(f"fcsim_case_{name}", script)
    except SystemExit as error:  # with 0 nothing would have been done, and well
        raise InputError(f"case {str(path)!r}: expected a script that can be loaded, {script} ends the program ({error})") from None
    except SyntaxError as error:
        raise InputError(f"case {str(path)!r}: {script} cannot be loaded as Python: {error}") from None
    except EOFError as error:
        raise _asks(error, script) from None
    except Exception as error:  # whatever a user's script raises
        raise _of_the_script(error, script) from error
    return _checked(module, name, script, digest)


_TOO_LARGE = re.compile("Maximum allowed (dimension|size) exceeded|too large; arrays|array is too big")
"""What NumPy says of arrays that no memory holds."""


def _checked(module: ModuleType, name: str, script: Path, digest: str) -> CaseScript:
    parameters, build = getattr(module, "Parameters", None), getattr(module, "build", None)
    what = f"case script {script}: expected a dataclass Parameters and a function build(parameters), found"
    if not callable(build):
        raise InputError(f"{what} no function build (`fcsim new NAME` writes a case that runs)")
    if parameters is None:
        raise InputError(f"{what} no Parameters")
    if not (dataclasses.is_dataclass(parameters) and isinstance(parameters, type)):
        raise InputError(f"{what} Parameters that is no dataclass: write @dataclass(frozen=True) above the class")

    @wraps(build)
    def built(values: DataclassInstance) -> Case:
        """The case; numbers that its script cannot compute with (a length of 0, a step of 1e-320) are the parameters' fault."""
        try:
            case: object = build(values)
        except SystemExit as error:
            raise InputError(f"case {name!r}: expected a case from build(), it ends the program ({error})") from None
        except EOFError as error:
            raise _asks(error, script) from None
        except (ZeroDivisionError, OverflowError, MemoryError, ValueError) as error:
            if isinstance(error, ValueError) and not _TOO_LARGE.search(str(error)):
                raise _of_the_script(error, script) from error
            raise InputError(f"case {name!r}: expected parameters that its script can compute with: {error}") from error
        except OSError:  # the machine's
            raise
        except Exception as error:  # whatever a user's script raises
            raise _of_the_script(error, script) from error
        if not isinstance(case, Case):
            mend = "; is the `return` missing?" if case is None else ""
            mend = "; Case(name, title, simulation) makes one of it" if isinstance(case, Simulation) else mend
            raise InputError(f"case script {script}: expected build to return a Case, got {type(case).__name__}{mend}")
        return case

    return CaseScript(name, script, parameters, built, digest)


def _asks(error: EOFError, script: Path) -> InputError:
    """Of a script that calls input() where nobody answers."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == script.resolve()]
    where = f", line {lines[-1]}" if lines else ""
    return InputError(f"{script}{where}: expected a script that asks nothing, there is no answer to input(): make it a parameter")


_PACKAGE = Path(__file__).resolve().parents[1]


def passed_through(error: BaseException, script: Path) -> bool:
    """Whether what was raised came out of the script, or of what that called."""
    return any(Path(frame.filename) == script.resolve() for frame in traceback.extract_tb(error.__traceback__))


def _of_the_script(error: Exception, script: Path) -> Exception:
    """The InputError that names the script's line, where what was raised comes from the script itself and not from fcsim, which it called;
    of ValueErrors those of other libraries count too (`default_rng(-1)`); the error itself elsewhere."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [k for k, frame in enumerate(frames) if Path(frame.filename) == script.resolve()]
    if isinstance(error, FcsimError) or not own:
        return error
    called = [frame for frame in frames[own[-1] + 1 :] if frame.filename != dataclasses.__file__]  # of fields without a default
    if called and (not isinstance(error, ValueError) or any(_PACKAGE in Path(frame.filename).parents for frame in called)):
        return error
    line = frames[own[-1]]
    return InputError(f"{script}, line {line.lineno}: {line.line}: {type(error).__name__}: {error}{_beside(error, script)}")


def _beside(error: Exception, script: Path) -> str:
    """What helps where a script imports a module that lies beside it, as `python SCRIPT` would find it."""
    name = (error.name or "").partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    if not name or not any((script.parent / place).exists() for place in (f"{name}.py", name)):
        return ""
    return (
        f"; it lies beside the script, whose folder is not on Python's path: PYTHONPATH={shlex.quote(str(script.parent.resolve()))} "
        "before the command finds it (--resume does not see when it changes)"
    )
