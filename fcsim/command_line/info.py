"""fcsim info: what an FCLIB file holds, and how good its stored solution is."""

from __future__ import annotations

import argparse
from pathlib import Path

from fcsim.command_line.terminal import say
from fcsim.errors import EXIT_OK


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `info`."""
    info = commands.add_parser("info", help="describe an FCLIB file", description="Print what an FCLIB file holds.")
    info.add_argument("file", type=Path)
    info.set_defaults(act=_info)


def _info(options: argparse.Namespace) -> int:
    import numpy as np

    from fcsim.export_fclib import read_fclib
    from fcsim.problem import GlobalProblem, Judge, LocalProblem

    content = read_fclib(options.file)
    problem = content.problem
    say(f"{options.file}: FCLIB {content.form.replace('_', ' ')} problem")
    for name in ("title", "description", "math_info"):
        if getattr(content.info, name):
            say(f"  {name:12s} {getattr(content.info, name)}")
    unknowns = f"{problem.m} local unknowns"
    density = ""
    if not isinstance(problem, LocalProblem):
        unknowns += f", {problem.n} degrees of freedom"
        density = f", contact density m/n = {problem.m / problem.n:.4g}" if problem.n else ""
    say(f"  contacts     {problem.nc} in {getattr(problem, 'dimension', 5)}D: {unknowns}{density}")
    if problem.nc:
        say(f"  friction     mu from {problem.mu.min():g} to {problem.mu.max():g}")
    for letter, matrix in content.matrices.items():
        known = {name: getattr(matrix, name) for name in ("conditioning", "determinant", "rank")}
        more = [f"{name} {value:g}" for name, value in known.items() if value is not None] + ([matrix.comment] if matrix.comment else [])
        shape = " x ".join(map(str, matrix.shape))
        say(f"  {letter:12s} {shape}, {matrix.nnz} entries stored as {matrix.storage}" + (f"; {', '.join(more)}" if more else ""))
    vector = "q" if isinstance(problem, LocalProblem) else "f"
    say(f"  |{vector}|          {np.linalg.norm(getattr(problem, vector)):.6g}")
    if content.solution is not None:
        stated = "stored"
        if isinstance(problem, GlobalProblem | LocalProblem):
            judge = Judge(problem)
            stated += f", error {judge.scaled_error(content.solution.r):.3e} (published: {judge.error(content.solution.r):.3e})"
        say(f"  solution     {stated}")
    if content.guesses:
        say(f"  guesses      {len(content.guesses)}")
    return EXIT_OK
