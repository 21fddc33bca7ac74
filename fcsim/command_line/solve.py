"""fcsim solve: the problem of an FCLIB file by a solver of the table."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.answers import current
from fcsim.command_line.assignments import add_plugin_option, checked_tolerance, positive, read_assignments
from fcsim.command_line.compiling import saying_so
from fcsim.command_line.terminal import prints_aside, say
from fcsim.errors import EXIT_NOT_CONVERGED, EXIT_OK, FcsimError, InputError
from fcsim.files import refuse_unwritable
from fcsim.version import __version__

if TYPE_CHECKING:
    from fcsim.arrays import FloatArray
    from fcsim.export_fclib import FclibFile
    from fcsim.export_fclib.content import Problem
    from fcsim.solvers import Result


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `solve`."""
    solve = commands.add_parser("solve", help="solve an FCLIB problem", description="Solve the problem of an FCLIB file.")
    solve.add_argument("file", type=Path, metavar="FILE", help="FCLIB file, as those of results/NAME/fclib")
    solve.add_argument("--solver", default="auto", help="name of a solver (see fcsim solvers; default auto, which chooses)")
    solve.add_argument("--tol", type=float, default=1e-8, help="tolerance on the error (default 1e-8)")
    solve.add_argument(
        "--error",
        choices=("scaled", "published"),
        default="scaled",
        help="which error the tolerance is on: scaled, which does not depend on the units (default), or that of the tables",
    )
    solve.add_argument(
        "--floor",
        type=float,
        default=0.0,
        metavar="VELOCITY",
        help="what counts as rest (in statics a length): errors are relative to ||q|| or this, whichever is larger (default 0)",
    )
    solve.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="an option of the solver")
    solve.add_argument(
        "--start", choices=("zero", "guess", "solution"), default="zero", help="where to begin: r = 0, or as stored (default zero)"
    )
    solve.add_argument("--time-limit", type=float, default=float("inf"), metavar="SECONDS", help="of the solve (default: none)")
    solve.add_argument("--json", action="store_true", help="print the answer as JSON")
    solve.add_argument("--write-solution", type=Path, metavar="FILE", help="write the problem with its solution as an FCLIB file")
    add_plugin_option(solve)
    solve.set_defaults(act=_solve)


def _solve(options: argparse.Namespace) -> int:
    from fcsim.export_fclib import read_fclib
    from fcsim.solvers import solve
    from fcsim.solvers.plugins import load_plugins

    with _prints_aside(options.json):
        load_plugins(options.plugin)
    if options.tol > 0:
        checked_tolerance(options.tol)
    positive("--time-limit", options.time_limit, infinite=True)
    overrides = solver_options(options.solver, options.assignments)
    if options.write_solution is not None:
        refuse_unwritable(options.write_solution)  # before a solve that may take long
        if options.write_solution.exists() and options.write_solution.samefile(options.file):
            raise InputError(
                f"--write-solution {options.write_solution}: expected another file than the problem's own, which it would replace"
            )
    content = read_fclib(options.file)
    problem = content.problem
    start = _start(content, options.start)
    solved: Callable[..., Result] = solve  # which checks the overrides
    limits = {"tol": options.tol, "error": options.error, "floor": options.floor, "time_limit": options.time_limit}
    with saying_so(_aside), _prints_aside(options.json), _raising_plainly(options.solver), _naming(options.file):
        result = solved(problem, options.solver, start, **limits, **overrides)
    if options.json:
        say(json.dumps(_answer(options, content, problem, result), indent=1, allow_nan=False))
    else:
        _print_answer(options, content, problem, result)
    if options.write_solution is not None:  # last: the answer is known, whether or not the disk takes it
        _write(options.write_solution, content, problem, result)
        if not options.json:
            say(f"written: {options.write_solution}")
    return EXIT_OK if result.solved else EXIT_NOT_CONVERGED


def _prints_aside(as_json: bool) -> AbstractContextManager[object]:
    return prints_aside() if as_json else nullcontext()


@contextmanager
def _raising_plainly(solver: str) -> Iterator[None]:
    """Whatever a plugin's method raises as an InputError that names it; fcsim's own errors, and Ctrl-C, as they are."""
    from fcsim.solvers.plugins import plugin_of

    try:
        yield
    except FcsimError:
        raise
    except Exception as error:  # whatever a plugin raises
        if not plugin_of(solver):
            raise
        text = f"{type(error).__name__}: {error}".strip().splitlines()[0]
        raise InputError(f"--solver {solver}: the plugin's method raised {text[:500]}") from error


@contextmanager
def _naming(file: Path) -> Iterator[None]:
    """A singular M or R as an InputError that names the file it stands in."""
    from fcsim.linear.factors import SingularMatrix

    try:
        yield
    except SingularMatrix as error:
        raise InputError(f"{file}: its equations of motion cannot be solved: {error}") from None


def _aside(text: str) -> None:
    if not current().quiet:
        say(f"{text} (the seconds below count it)", to_stderr=True)


def solver_options(name: str, texts: Sequence[str]) -> dict[str, bool | int | float | str]:
    """Read `name=value` texts as the types of the solver's options; InputError for what is no value of the type."""
    from fcsim.running.parameters import read_value
    from fcsim.solvers import method

    defaults = method(name).options
    values: dict[str, bool | int | float | str] = {}
    for option, text in read_assignments(texts).items():
        kind = type(getattr(defaults, option, ""))
        if kind not in (int, float, str, bool):
            raise InputError(f"--set {option}={text}: this option of {name} is set from Python only")
        try:
            values[option] = read_value(text, kind)
        except ValueError:
            expected = "on or off" if kind is bool else f"a value of type {kind.__name__}"
            raise InputError(f"--set {option}={text}: solver {name} expects {expected}") from None
    return values


def _start(content: FclibFile, where: str) -> FloatArray | None:
    """The reactions to begin with, None for zero."""
    if where == "guess":
        if not content.guesses:
            raise InputError(f"{content.path}: --start guess expects /guesses, the file holds none")
        return content.guesses[0].r
    if where == "solution":
        if content.solution is None:
            raise InputError(f"{content.path}: --start solution expects /solution, the file holds none")
        return content.solution.r
    return None


def _write(path: Path, content: FclibFile, problem: Problem, result: Result) -> None:
    from fcsim.export_fclib import Solution, write_fclib

    write_fclib(
        path,
        problem,
        solution=Solution(result.u, result.r, result.v, result.multiplier),
        guesses=content.guesses,
        title=content.info.title,
        description=content.info.description,
        math_info=f"solved by fcsim {__version__}, {result.method}: {result.status.value}, error {result.error:.3e}",
    )


def _finite(values: Mapping[str, object]) -> dict[str, object]:
    """The values, None for floats that JSON has no word for."""
    return {name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in values.items()}


def _answer(options: argparse.Namespace, content: FclibFile, problem: Problem, result: Result) -> dict[str, object]:
    from fcsim.export_fclib import odd_matrices

    return _finite(
        {
            "file": str(options.file),
            "solver": result.method,
            "status": result.status.name,
            "error": result.error,
            "scaled_error": result.scaled_error,
            "published_error": result.published_error,
            "tol": options.tol,
            "iterations": result.iterations,
            "seconds": result.time,
            "seconds_by_phase": result.seconds,
            "nc": problem.nc,
            "n": _unknowns(problem),
            "dimension": problem.dimension,
            "form": content.form,
            "checks": _finite(vars(result.checks)),
            "message": result.message,
            "remarks": odd_matrices(problem),
        }
    )


def _unknowns(problem: Problem) -> int:
    return int(getattr(problem, "n", problem.m))


def _space(problem: Problem) -> str:
    return "with rolling friction" if problem.dimension == 5 else f"in {problem.dimension}D"


def _print_answer(options: argparse.Namespace, content: FclibFile, problem: Problem, result: Result) -> None:
    from fcsim.export_fclib import odd_matrices

    say(f"{options.file}: {content.form} form, {problem.nc} contacts {_space(problem)}, n = {_unknowns(problem)}")
    error = f"{options.error} error {result.error:.3e} (tol {options.tol:g})"
    say(f"{result.method}: {result.status.value}; {error}, {result.iterations} iterations")
    other = "published" if options.error == "scaled" else "scaled"
    say(f"the {other} error is {getattr(result, f'{other}_error'):.3e}" + (f"; {result.message}" if result.message else ""))
    say("seconds: " + ", ".join(f"{phase} {value:.3f}" for phase, value in result.seconds.items()))
    finite = {name: value for name, value in _finite(vars(result.checks)).items() if value is not None}
    say("checks:  " + ", ".join(f"{name.replace('_', ' ')} {value:.1e}" for name, value in finite.items()))
    for remark in odd_matrices(problem):
        say(f"note: {remark}")
