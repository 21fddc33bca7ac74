"""LCPs solved by the user's PATH (Dirkse, Ferris, Munson), spoken to in the files of AMPL's solver interface.

PATH is not free software: fcsim neither brings nor links it, it runs the program `pathampl` of the PATH distribution, found by the
environment variable FCSIM_PATHAMPL or on the search path. Beyond 300 variables PATH asks for its licence, which it reads from the
environment variable PATH_LICENSE_STRING. File formats: Gay, Writing .nl Files, Sandia report SAND2005-7907P, 2005.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import MissingDependency


def path_program() -> str:
    """Return the program to run; a MissingDependency says how it is looked for."""
    named = os.environ.get("FCSIM_PATHAMPL", "")
    program = shutil.which(named or "pathampl")
    if program is None:
        where = f"FCSIM_PATHAMPL={named!r} is no program" if named else "no program pathampl on the search path"
        raise MissingDependency(
            f"engine 'PATH': {where}; install PATH (pages.cs.wisc.edu/~ferris/path.html) and put pathampl on the search path or name it "
            "in the environment variable FCSIM_PATHAMPL, or use engine 'Lemke'"
        )
    return program


@dataclass(frozen=True, eq=False)
class PathAnswer:
    """z (n,) of 0 <= z ⊥ M z + q >= 0, None where PATH finds none; message: what it said, with its codes where they are not 0."""

    z: FloatArray | None
    message: str


def solve_by_path(M: FloatArray, q: FloatArray, time_limit: float = float("inf")) -> PathAnswer:
    """Solve 0 <= z ⊥ M z + q >= 0 by PATH, stopped after time_limit [s]."""
    program = path_program()
    with tempfile.TemporaryDirectory(prefix="fcsim-path-") as folder:
        stub = Path(folder) / "lcp"
        stub.with_suffix(".nl").write_text(nl_text(M, q))
        try:
            done = subprocess.run(
                [program, str(stub), "-AMPL"],
                cwd=folder,
                capture_output=True,
                timeout=None if np.isinf(time_limit) else max(time_limit, 0.01),
                check=False,
            )
        except subprocess.TimeoutExpired:
            return PathAnswer(None, f"PATH: stopped after {time_limit:.3g} s")
        except OSError as error:
            return PathAnswer(None, f"PATH: {program} cannot be run: {error}")
        said = done.stderr.decode(errors="replace").strip() or done.stdout.decode(errors="replace").strip()
        ended = f", return code {done.returncode}" if done.returncode else ""
        answer = stub.with_suffix(".sol")
        if not answer.exists():
            return PathAnswer(None, f"PATH: no .sol file{ended}: {_last_line(said)}")
        text = answer.read_text(errors="replace")
        z, code = read_sol(text, len(q)), _code(text)
        told = next((line.strip() for line in text.splitlines() if line.strip()), said)
        return PathAnswer(z, f"PATH: {told[:200]}{f', solve code {code}' if code else ''}{ended}")


def _last_line(text: str) -> str:
    """The last line of what a program said, 200 characters of it."""
    return next(iter(text.splitlines()[-1:]), "nothing said")[:200]


def _code(text: str) -> int:
    """The solve code of a .sol file (0 to 99: solved), 0 where it has none."""
    lines = [line.split() for line in text.splitlines() if line.startswith("objno")]
    return int(lines[0][-1]) if lines and lines[0][-1].isdigit() else 0


def nl_text(M: FloatArray, q: FloatArray) -> str:
    """The LCP as a text .nl file: variables z >= 0 and free w, rows w - M z = q and w complementing z >= 0."""
    n = len(q)
    row, column = np.nonzero(M)
    entries = [[(int(j), -float(M[i, j])) for j in column[row == i]] + [(n + i, 1.0)] for i in range(n)]
    count = np.bincount(column, minlength=n).tolist() + [2] * n  # of each variable's column: w stands in two rows
    lines = [
        "g3 1 1 0",
        f" {2 * n} {2 * n} 1 0 {n}",  # variables, constraints, objectives, ranges, equations
        f" 0 0 {n} 0 0 0",  # nonlinear constraints, objectives; complementarity conditions: linear, nonlinear, double, nonzero bounds
        " 0 0",  # network constraints
        " 0 0 0",  # nonlinear variables
        " 0 0 0 1",  # network variables; functions; arithmetic; flags
        " 0 0 0 0 0",  # discrete variables
        f" {sum(count)} 0",  # nonzeros of the Jacobian and of the objective
        " 0 0",  # lengths of names
        " 0 0 0 0 0",  # common expressions
    ]
    for i in range(2 * n):
        lines += [f"C{i}", "n0"]
    lines += ["O0 0", "n0", "r"]
    lines += [f"4 {value!r}" for value in q.tolist()]
    lines += [f"5 1 {i + 1}" for i in range(n)]  # complements variable i + 1 (counted from 1), which has a lower bound
    lines += ["b"] + ["2 0"] * n + ["3"] * n
    lines += [f"k{2 * n - 1}"] + [str(total) for total in np.cumsum(count)[:-1].tolist()]
    for i, row_entries in enumerate(entries):
        lines += [f"J{i} {len(row_entries)}"] + [f"{j} {value!r}" for j, value in row_entries]
    for i in range(n):
        lines += [f"J{n + i} 1", f"{n + i} 1"]
    return "\n".join(lines) + "\n"


def read_sol(text: str, n: int) -> FloatArray | None:
    """Return the first n primal values of a text .sol file, None where it holds none or reports a failure (code >= 200)."""
    lines = [line.strip() for line in text.splitlines()]
    if "Options" not in lines:
        return None
    try:
        at = lines.index("Options") + 1
        options = int(lines[at])
        # more than four options announce a tolerance after the counts
        tolerance = options > 4
        at += 1 + (options - 2 if tolerance else options)
        duals, primals = int(lines[at + 1]), int(lines[at + 3])
        at += 4 + tolerance + duals
        values = np.array([float(line) for line in lines[at : at + primals]])
        code = next((int(line.split()[-1]) for line in lines[at + primals :] if line.startswith("objno")), 0)
    except (IndexError, ValueError):
        return None
    if len(values) < n or code >= 200 or not np.all(np.isfinite(values[:n])):
        return None
    return np.maximum(values[:n], 0)
