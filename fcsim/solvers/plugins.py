"""Methods of one's own in the table: Python files that add to SOLVERS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from pathlib import Path

from fcsim.errors import InputError
from fcsim.files import run_script, sha256
from fcsim.solvers.base import Method
from fcsim.solvers.table import SOLVERS

_ORIGIN: dict[str, str] = {}


def plugin_of(solver: str) -> str:
    """SHA-256 of the plugin that a method came with, empty for one of fcsim's own: a changed plugin is another method."""
    return _ORIGIN.get(solver, "")


def kept_apart[P](problem: P, run: Callable[..., object], solver: str) -> P:
    """The problem for a method to work on: a copy where the method is not fcsim's own.

    One that writes into the problem's arrays would else be judged by what it wrote: it would "solve" anything by W = 0. A copy takes the
    time and memory of one; fcsim's own methods, which write nothing there, have the problem itself.
    """
    own = not plugin_of(solver) and (getattr(run, "__module__", None) or "").partition(".")[0] == "fcsim"
    return problem if own else deepcopy(problem)


def load_plugins(files: Sequence[str | Path]) -> None:
    """Run Python files that add methods to the solver table, see docs/guides/add_a_solver.md.

    Raises InputError for what is no Python file, for whatever it raises (SystemExit included) with its place, and for entries that are no
    `Method`; the table is then as it was.
    """
    for number, file in enumerate(files):
        before = dict(SOLVERS)
        try:
            digest = _load(number, Path(file))
            added = {name: entry for name, entry in SOLVERS.items() if before.get(name) is not entry}
            for name, entry in added.items():
                _check(f"--plugin {file}", name, entry)
        except InputError:
            SOLVERS.clear()
            SOLVERS.update(before)
            raise
        _ORIGIN.update(dict.fromkeys(added, digest))


def _load(number: int, path: Path) -> str:
    if path.suffix != ".py" or not path.is_file():
        raise InputError(f"--plugin {path}: expected a Python file")
    digest = sha256(path)
    try:
        run_script(f"fcsim_plugin_{number}", path)
    except (Exception, SystemExit) as error:  # whatever the user's file raises
        trace, line = error.__traceback__, 0
        while trace is not None:
            line = trace.tb_lineno if Path(trace.tb_frame.f_code.co_filename) == path.absolute() else line
            trace = trace.tb_next
        where = f", line {line}" if line else ""
        raise InputError(f"--plugin {path}{where}: {type(error).__name__}: {error}") from error
    return digest


def _check(what: str, name: object, entry: object) -> None:
    if not isinstance(name, str) or not name or "," in name:
        raise InputError(f"{what}: expected a name without commas in SOLVERS, got {name!r}")
    if not isinstance(entry, Method):
        kind = "a function" if callable(entry) else f"a {type(entry).__name__}"
        raise InputError(f"{what}: expected SOLVERS[{name!r}] = Method(run, Options(), family, source), got {kind}")
    if not callable(entry.run) or not hasattr(entry.options, "max_iterations"):
        raise InputError(f"{what}: expected SOLVERS[{name!r}] with a function run and options derived from Options, got {entry!r:.200}")
