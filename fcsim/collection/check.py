"""Verification of a collection: every file is read again, and what its manifest says of it computed again."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.collection.folder import members, parse_name
from fcsim.collection.manifest import AT_REST, MANIFEST, Entry, read_manifest
from fcsim.errors import InputError
from fcsim.export_fclib import FclibFile, Solution, read_fclib
from fcsim.files import resolved, sha256
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, Judge, LocalProblem, check

Progress = Callable[[str, int, int], None]

ERROR_SLACK = (1.1, 1e-10)
"""An error up to 1.1 times the stated one + 1e-10 agrees with it: round-off differs from machine to machine."""
POOR = 1e-2
"""A stored solution with a larger error is reported as none."""
EQUATIONS_UP_TO = 1e-6
"""Relative residual of the equations of motion that a stored solution may leave; its multiple of round-off is cond(M)."""


@dataclass(frozen=True)
class Checked:
    """What was found of a file; None where it could not be computed. `failures` is empty where all is well.

    error     of the stored reactions, by a judge that shares no code with the solvers; `stated` is the manifest's
    cone      max (||r_T|| - mu r_N)_+ / max |r| of the stored reactions
    equations the largest relative residual of the equations that bind v, u, l to r
    """

    place: str
    form: str = ""
    dimension: int | None = None
    nc: int | None = None
    n: int | None = None
    m: int | None = None
    error: float | None = None
    stated: float | None = None
    cone: float | None = None
    equations: float | None = None
    note: str = ""
    failures: tuple[str, ...] = ()


def check_collection(directory: str | Path, progress: Progress | None = None) -> list[Checked]:
    """Check every file of a collection, or of any folder of FCLIB files, and return a row for each.

    With a manifest: its files are all there and no others, SHA-256, form, dimension, nc, n, m, the name's numbers, and the
    stored solution: its error is the stated one, and u, v, l follow from r. A folder without a manifest states nothing: its files must be
    readable and consistent, and the solutions' errors are reported (real files hold zeros there). A file that fails stops nothing.
    """
    directory = Path(directory)
    stated: dict[str, list[Entry]] | None = None
    if (directory / MANIFEST).is_file():
        stated = {}
        for entry in read_manifest(directory):
            stated.setdefault(entry.place, []).append(entry)
    try:
        places = [path.relative_to(directory).as_posix() for member in members(directory) for path in member.paths]
    except InputError:
        if not stated:
            raise
        places = []
    every = sorted({*places, *(stated or {})})
    rows = []
    for done, place in enumerate(every, 1):
        rows.append(_check(directory, place, stated))
        if progress is not None:
            progress("files", done, len(every))
    return rows


def _check(directory: Path, place: str, stated: dict[str, list[Entry]] | None) -> Checked:
    entries = (stated or {}).get(place, [])
    entry = entries[0] if entries else None
    path = directory / place
    if not path.is_file():
        return Checked(place, failures=("missing: the manifest lists it, the folder does not hold it",))
    if entry is not None and not resolved(path).is_relative_to(resolved(directory)):
        return Checked(place, failures=("a link that leads out of the collection",))
    failures = ["not in the manifest"] if stated is not None and entry is None else []
    if len(entries) > 1:
        failures.append(f"listed {len(entries)} times in the manifest, for one file")
    found = sha256(path) if entries else ""
    for digest in sorted({row.sha256 for row in entries} - {found}):
        failures.append(f"changed: SHA-256 {found[:12]}..., the manifest states {digest[:12]}...")
    try:
        content = read_fclib(path)
    except InputError as unreadable:
        return Checked(place, failures=(*failures, str(unreadable).removeprefix(f"{path}: ")))
    return _check_content(path, place, content, entry, failures)


def _check_content(path: Path, place: str, content: FclibFile, entry: Entry | None, failures: list[str]) -> Checked:
    """The sizes, and the stored solution, of a file that could be read."""
    problem, solution = content.problem, content.solution
    n = None if isinstance(problem, LocalProblem) else problem.n
    sizes = {"form": content.form, "dimension": problem.dimension, "nc": problem.nc, "m": problem.m}
    if entry is not None:
        held = {**sizes, **({} if n is None else {"n": n})}
        failures += [
            f"{name}: the file has {v}, the manifest states {getattr(entry, name)}" for name, v in held.items() if v != getattr(entry, name)
        ]
        said = parse_name(path.stem, problem.nc).iterations
        if said != entry.iterations:
            failures.append(f"iterations: the name has {said}, the manifest states {entry.iterations}")
    stated = None if entry is None else entry.error
    row = Checked(place, content.form, problem.dimension, problem.nc, n, problem.m, stated=stated)
    if not isinstance(problem, GlobalProblem | LocalProblem):
        return replace(row, note="rolling friction: read, not judged", failures=tuple(failures))
    if solution is None:
        if entry is not None and entry.error is not None:
            failures.append("no /solution, the manifest states its error")
        return replace(row, note="no solution", failures=tuple(failures))
    try:
        judge = Judge(problem)
        error = judge.error(solution.r)
    except SingularMatrix as singular:
        return replace(row, failures=(*failures, f"the stored solution cannot be judged: {singular}"))
    cone = check(solution.r, solution.u, problem.mu, problem.dimension).cone
    equations = _equations(problem, solution, judge.scale)
    at_rest = entry is not None and entry.status == AT_REST
    note = "at rest" if at_rest else "not a solution" if error > POOR else ""
    if entry is not None and not at_rest:
        if entry.error is None:
            failures.append("a /solution, the manifest states none")
        elif not error <= ERROR_SLACK[0] * entry.error + ERROR_SLACK[1]:
            failures.append(f"error of the stored solution: {error:.3e}, the manifest states {entry.error:.3e}")
        if entry.source == "" and not equations <= EQUATIONS_UP_TO:  # copies hold what others stored
            failures.append(f"stored solution: v, u, l do not follow from r, relative residual {equations:.1e}")
    return replace(row, error=error, cone=cone, equations=equations, note=note, failures=tuple(failures))


def _equations(problem: GlobalProblem | LocalProblem, solution: Solution, scale: float) -> float:
    """Largest relative residual of the equations of motion, kinematics and constraints at a stored solution; `scale` = ||q||."""
    p, u, r, v, l = problem, solution.u, solution.r, solution.v, solution.l
    residuals: list[tuple[FloatArray, tuple[FloatArray, ...]]] = []
    if isinstance(p, LocalProblem):
        bound = p.W @ r if p.V is None or l is None else p.W @ r + p.V @ l
        residuals = [(u - bound - p.q, (p.q,))]
        if p.V is not None and p.R is not None and p.s is not None and l is not None:
            residuals.append((p.V.T @ r + p.R @ l + p.s, (p.s, p.V.T @ r, p.R @ l)))
    elif v is not None:
        momentum, load = p.M @ v, p.H @ r + p.f
        residuals = [(u - p.H.T @ v - p.w, (u, np.array([scale])))]
        if p.G is not None and p.b is not None and l is not None:
            load = load + p.G @ l
            residuals.append((p.G.T @ v + p.b, (p.b, p.G.T @ v)))
        residuals.append((momentum - load, (p.f, p.H @ r)))
    return max((_ratio(residual, terms) for residual, terms in residuals), default=math.nan)


def _ratio(residual: FloatArray, terms: tuple[FloatArray, ...]) -> float:
    size = float(np.linalg.norm(residual))
    scale = max(float(np.linalg.norm(term)) for term in terms)
    return size / scale if scale else 0.0 if size == 0 else math.inf
