"""The command line: fcsim run | solve | info | render | solvers | collection | bench | profile | report."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import signal
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fcsim.command_line.bench import add_parsers as add_bench_parser
from fcsim.command_line.collection import add_parsers as add_collection_parsers
from fcsim.command_line.profile import add_parsers as add_profile_parsers
from fcsim.errors import FcsimError, InputError
from fcsim.runtime import is_interrupt
from fcsim.version import __version__

EXIT_OK, EXIT_NOT_CONVERGED, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsim",
        description="Frictional contact between deformable bodies: run cases, solve and describe FCLIB problems.",
        epilog="Exit codes: 0 all converged, 1 no convergence or penetration seen, 2 bad input, 130 interrupted.",
    )
    parser.add_argument("--version", action="version", version=f"fcsim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="run a case", description="Run a case script and write its results into a folder.")
    run.add_argument("case", help="folder of a case, as cases/masonry_wall, or its script")
    run.add_argument("--steps", type=int, help="number of steps")
    run.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="change a parameter of the case")
    run.add_argument("--out", type=Path, help="folder of the results (default: results/CASE)")
    run.add_argument("--solver", help="solver of every step (see fcsim solvers)")
    run.add_argument("--tol", type=float, help="tolerance on the error of every step")
    run.add_argument("--export-every", type=int, default=10, metavar="K", help="write an FCLIB file every K steps, 0 = none (default 10)")
    run.add_argument("--export-form", choices=("global", "local", "both"), default="global", help="form of the FCLIB files")
    run.add_argument("--vtk-every", type=int, default=10, metavar="K", help="write VTK files every K steps, 0 = none (default 10)")
    run.add_argument("--checkpoint-every", type=int, default=20, metavar="K", help="steps between checkpoints (default 20)")
    run.add_argument("--resume", action="store_true", help="go on with an interrupted run in the folder of the results")
    run.add_argument("--overwrite", action="store_true", help="replace an earlier run's results")
    run.add_argument("--parameters", action="store_true", help="list the case's parameters and stop")
    run.set_defaults(act=_run)

    solve = commands.add_parser("solve", help="solve an FCLIB problem", description="Solve the problem of an FCLIB file.")
    solve.add_argument("file", type=Path)
    solve.add_argument("--solver", default="auto", help="name of a solver (see fcsim solvers; default auto, which chooses)")
    solve.add_argument("--tol", type=float, default=1e-8, help="tolerance on the error (default 1e-8)")
    solve.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="an option of the solver")
    solve.add_argument("--start", choices=("zero", "guess", "solution"), default="zero", help="where to begin: r = 0, or as stored")
    solve.add_argument("--time-limit", type=float, default=float("inf"), metavar="SECONDS")
    solve.add_argument("--json", action="store_true", help="print the answer as JSON")
    solve.add_argument("--write-solution", type=Path, metavar="FILE", help="write the problem with its solution as an FCLIB file")
    solve.set_defaults(act=_solve)

    info = commands.add_parser("info", help="describe an FCLIB file", description="Print what an FCLIB file holds.")
    info.add_argument("file", type=Path)
    info.set_defaults(act=_info)

    render = commands.add_parser("render", help="pictures, film and plots of a run", description="Draw a run's folder, off-screen.")
    render.add_argument("directory", type=Path)
    render.add_argument("--film", choices=("gif", "mp4", "none"), default="gif")
    render.add_argument("--exaggeration", type=float, help="factor on displacements (default: chosen from their size)")
    render.set_defaults(act=_render)

    solvers = commands.add_parser("solvers", help="list the solvers", description="Print the table of solvers.")
    solvers.set_defaults(act=_solvers)
    add_collection_parsers(commands)

    add_bench_parser(commands)
    add_profile_parsers(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.act(options))
    except FcsimError as error:
        print(f"fcsim: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except BrokenPipeError:  # the reader of our output left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except OSError as error:  # a folder that cannot be written, a full disk
        print(f"fcsim: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        print("fcsim: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def _assignments(texts: Sequence[str]) -> dict[str, str]:
    assignments = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise InputError(f"--set {text}: expected NAME=VALUE")
        assignments[name.strip()] = value.strip()
    return assignments


def _run(options: argparse.Namespace) -> int:
    from dataclasses import fields

    from fcsim.running.case import load_case
    from fcsim.running.report import Progress, print_summary
    from fcsim.running.run import RunOptions, run_case

    script = load_case(options.case)
    if options.parameters:
        defaults = script.parameters()
        for parameter in fields(script.parameters):
            print(f"{parameter.name:20s} {getattr(defaults, parameter.name)}")
        return EXIT_OK
    assignments = _assignments(options.assignments)
    for name in ("steps", "solver", "tol"):
        if getattr(options, name) is not None:
            assignments[name] = str(getattr(options, name))
    directory = options.out or Path("results") / script.name
    forms = ("global", "local") if options.export_form == "both" else (options.export_form,)
    settings = RunOptions(
        export_every=options.export_every,
        export_forms=forms,
        vtk_every=options.vtk_every,
        checkpoint_every=options.checkpoint_every,
    )
    # a polite kill ends the run as Ctrl-C does, also where Ctrl-C itself is ignored, as under nohup
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with Progress() as progress:
            summary = run_case(
                script, assignments, directory, settings, resume=options.resume, overwrite=options.overwrite, watch=progress.update
            )
    finally:
        signal.signal(signal.SIGTERM, before)
    print_summary(summary, directory)
    return {"finished": EXIT_OK, "not converged": EXIT_NOT_CONVERGED, "failed": EXIT_NOT_CONVERGED}.get(summary.status, EXIT_INTERRUPTED)


def _solver_options(name: str, texts: Sequence[str]) -> dict[str, Any]:
    """Read `name=value` texts as the types of the solver's options."""
    from fcsim.solvers import method

    defaults = method(name).options
    values: dict[str, Any] = {}
    for option, text in _assignments(texts).items():
        kind = type(getattr(defaults, option, ""))
        if kind not in (int, float, str, bool):
            raise InputError(f"--set {option}={text}: this option of {name} is set from Python only")
        try:
            values[option] = text.lower() in ("on", "true", "yes", "1") if kind is bool else kind(text)
        except ValueError:
            raise InputError(f"--set {option}={text}: solver {name} expects a value of type {kind.__name__}") from None
    return values


def _solve(options: argparse.Namespace) -> int:
    from fcsim.export_fclib import Solution, read_fclib, write_fclib
    from fcsim.problem import GlobalProblem, LocalProblem
    from fcsim.solvers import solve

    content = read_fclib(options.file)
    problem = content.problem
    if not isinstance(problem, GlobalProblem | LocalProblem):
        raise InputError(f"{options.file}: a rolling friction problem (spacedim 5); it can be read and described, not solved")
    r = None
    if options.start == "guess":
        if not content.guesses:
            raise InputError(f"{options.file}: --start guess expects /guesses, the file holds none")
        r = content.guesses[0].r
    elif options.start == "solution":
        if content.solution is None:
            raise InputError(f"{options.file}: --start solution expects /solution, the file holds none")
        r = content.solution.r
    overrides = _solver_options(options.solver, options.assignments)
    result = solve(problem, options.solver, r, tol=options.tol, time_limit=options.time_limit, **overrides)
    if options.write_solution is not None:
        write_fclib(
            options.write_solution,
            problem,
            solution=Solution(result.u, result.r, result.v, result.multiplier),
            guesses=content.guesses,
            title=content.info.title,
            description=content.info.description,
            math_info=f"solved by fcsim {__version__}, {result.method}: {result.status.value}, error {result.error:.3e}",
        )
    checks = {name: value if value is None or math.isfinite(value) else None for name, value in vars(result.checks).items()}
    answer = {
        "file": str(options.file),
        "solver": result.method,
        "status": result.status.name,
        "error": result.error,
        "tol": options.tol,
        "iterations": result.iterations,
        "seconds": result.time,
        "seconds_by_phase": result.seconds,
        "nc": problem.nc,
        "n": problem.n if isinstance(problem, GlobalProblem) else problem.m,
        "dimension": problem.dimension,
        "form": content.form,
        "checks": checks,
    }
    if options.json:
        finite = {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in answer.items()}
        print(json.dumps(finite, indent=1, allow_nan=False))
    else:
        print(f"{options.file}: {content.form} form, {problem.nc} contacts in {problem.dimension}D, n = {answer['n']}")
        print(f"{result.method}: {result.status.value}; error {result.error:.3e} (tol {options.tol:g}), {result.iterations} iterations")
        print("seconds: " + ", ".join(f"{phase} {value:.3f}" for phase, value in result.seconds.items()))
        print("checks:  " + ", ".join(f"{name.replace('_', ' ')} {value:.1e}" for name, value in checks.items() if value is not None))
        if options.write_solution is not None:
            print(f"written: {options.write_solution}")
    return EXIT_OK if result.solved else EXIT_NOT_CONVERGED


def _info(options: argparse.Namespace) -> int:
    import numpy as np

    from fcsim.export_fclib import read_fclib
    from fcsim.problem import GlobalProblem, LocalProblem

    content = read_fclib(options.file)
    problem = content.problem
    print(f"{options.file}: FCLIB {content.form.replace('_', ' ')} problem")
    for name in ("title", "description", "math_info"):
        if getattr(content.info, name):
            print(f"  {name:12s} {getattr(content.info, name)}")
    unknowns = f"{problem.m} local unknowns"
    density = ""
    if not isinstance(problem, LocalProblem):
        unknowns += f", {problem.n} degrees of freedom"
        density = f", contact density m/n = {problem.m / problem.n:.4g}" if problem.n else ""
    print(f"  contacts     {problem.nc} in {getattr(problem, 'dimension', 5)}D: {unknowns}{density}")
    if problem.nc:
        print(f"  friction     mu from {problem.mu.min():g} to {problem.mu.max():g}")
    for letter, matrix in content.matrices.items():
        known = {name: getattr(matrix, name) for name in ("conditioning", "determinant", "rank")}
        more = [f"{name} {value:g}" for name, value in known.items() if value is not None] + ([matrix.comment] if matrix.comment else [])
        shape = " x ".join(map(str, matrix.shape))
        print(f"  {letter:12s} {shape}, {matrix.nnz} entries stored as {matrix.storage}" + (f"; {', '.join(more)}" if more else ""))
    vector = "q" if isinstance(problem, LocalProblem) else "f"
    print(f"  |{vector}|          {np.linalg.norm(getattr(problem, vector)):.6g}")
    if content.solution is not None:
        stated = "stored"
        if isinstance(problem, GlobalProblem | LocalProblem):
            stated += f", error {_stored_error(problem, content.solution.r):.3e}"
        print(f"  solution     {stated}")
    if content.guesses:
        print(f"  guesses      {len(content.guesses)}")
    return EXIT_OK


def _stored_error(problem: Any, r: Any) -> float:
    """The error of a stored solution, which files do not promise to be one."""
    from fcsim.problem import GlobalProblem, error
    from fcsim.problem.reduction import eliminate_equalities, reduce

    if isinstance(problem, GlobalProblem):
        reduction = reduce(problem)
        v, _ = reduction.velocity(r)
        from fcsim.problem import LocalProblem

        # only q enters the scale: no W is formed for one error
        trivial = LocalProblem(_no_matrix(problem.m), reduction.q, problem.mu, dimension=problem.dimension)
        return error(trivial, r, problem.H.T @ v + problem.w)
    return error(eliminate_equalities(problem), r)


def _no_matrix(m: int) -> Any:
    import scipy.sparse as sp

    return sp.csr_array((m, m))


def _render(options: argparse.Namespace) -> int:
    from fcsim.view import render

    written = render(options.directory, film=None if options.film == "none" else options.film, exaggeration=options.exaggeration)
    for path in written:
        print(path)
    return EXIT_OK


def _solvers(options: argparse.Namespace) -> int:
    from fcsim.solvers import SOLVERS

    rows = [("name", "family", "forms", "dim", "source")]
    rows += [(name, m.family, m.forms, ",".join(map(str, m.dimensions)), m.source) for name, m in SOLVERS.items()]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    print(lines[0])
    for line, method in zip(lines[1:], SOLVERS.values(), strict=True):
        print(line)
        described = (f"Siconos: {method.siconos}; " if method.siconos else "") + _described(method.options)
        described += f"; limits: {method.limits}" if method.limits else ""
        print(textwrap.fill(described, 132, initial_indent="    ", subsequent_indent="    "))
    print("forms: L local (reduced), G global; options with their defaults, changed by --set NAME=VALUE")
    return EXIT_OK


def _described(options: Any) -> str:
    """A method's options and their defaults in one line; a hybrid's stages by their functions."""
    texts = []
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if field.name in ("first", "stages"):
            value = " then ".join(f"{stage.options.max_iterations} {stage.run.__name__}" for stage in value) or "none"
        elif isinstance(value, Mapping):
            value = ", ".join(f"{key} {entry}" for key, entry in value.items()) or "none"
        texts.append(f"{field.name}={value:.6g}" if isinstance(value, float) else f"{field.name}={value}")
    return "; ".join(texts)


if __name__ == "__main__":
    raise SystemExit(main())
