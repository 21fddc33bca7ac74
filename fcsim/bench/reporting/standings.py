"""Standings: how solvers compare on groups of problems, one group a family or a folder, and one of all of them.

Unlike a performance profile, a standing takes each solver on the problems that it is made for (its dimensions and forms), and counts what
it leaves unsolved into its time.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from fcsim.bench.reporting.profiles import RESOLUTION
from fcsim.bench.reporting.summary import AT_TIME_LIMIT, geometric_mean
from fcsim.bench.reporting.time_table import CLOCKS, solver_names, time_of
from fcsim.bench.results import Measurement

ALL = "all"


@dataclass(frozen=True, eq=False)
class Group:
    """Problems of one kind in one dimension, and their measurements at one tolerance.

    about      what they are
    solvable   False where they are known to have no solution, None where it is not known whether each has one
    """

    name: str
    about: str
    dimension: int
    solvable: bool | None
    tol: float
    measurements: tuple[Measurement, ...]

    @property
    def problems(self) -> list[tuple[str, str]]:
        """(name, form) of each, small ones first."""
        sizes = {(m.problem, m.form): (m.nc, m.n) for m in self.measurements}
        return sorted(sizes, key=lambda key: (sizes[key], key))

    @property
    def contacts(self) -> list[int]:
        """Of each problem, ascending."""
        return sorted({(m.problem, m.form): m.nc for m in self.measurements}.values())

    @property
    def solvers_of_all(self) -> list[str]:
        """The solvers that were measured on every problem: those that a profile can compare."""
        counts = Counter(m.solver for m in self.measurements)
        return [name for name in solver_names(self.measurements) if counts[name] == len(self.problems)]


@dataclass(frozen=True)
class Standing:
    """One solver in one group. Times [s]; t_p: its time on problem p, t*_p that of the fastest solver of p.

    measured   problems of the group that it is made for
    solved     of them
    median     of t_p over the measured, infinity for the unsolved
    total      sum of t_p over the problems that some solver solved, the time limit where this one did not: a lower bound then
    bound      how many of those there are
    to_best    total over the least total of a solver on the same problems, its own included
    ratio      geometric mean of t_p / t*_p over the solved
    worst      largest t_p / t*_p over the solved
    """

    solver: str
    measured: int
    solved: int
    median: float
    total: float
    bound: int
    to_best: float
    ratio: float
    worst: float


@dataclass(frozen=True)
class Refusal:
    """One solver on problems that have no solution: how it ended on them, and how long that took [s].

    infeasible  it says that there is no solution
    gave_up     it stopped by itself without an answer
    late        it went on to the time limit
    failed      crashed, above the memory limit, or said to be solved above the tolerance
    solved      the recomputed error is below the tolerance all the same
    median      of the time until it said so; the time limit where it had to be killed
    """

    solver: str
    measured: int
    infeasible: int
    gave_up: int
    late: int
    failed: int
    solved: int
    median: float


def standings(group: Group, clock: str = "wall") -> list[Standing]:
    """The standings of a group, best first: by the fraction solved, then by the total over the best's. `clock`: see `CLOCKS`."""
    column = CLOCKS[clock][0]
    times: dict[str, dict[tuple[str, str], float]] = defaultdict(dict)
    limits: dict[str, dict[tuple[str, str], float]] = defaultdict(dict)
    for m in group.measurements:
        key = m.problem, m.form
        times[m.solver][key] = max(time_of(m, column), RESOLUTION)
        limits[m.solver][key] = m.time_limit
    fastest = {key: min(own.get(key, math.inf) for own in times.values()) for key in group.problems}
    solvable = {key for key, time in fastest.items() if time < math.inf}

    def total(solver: str, keys: set[tuple[str, str]]) -> float:
        return math.fsum(times[solver][key] if times[solver][key] < math.inf else limits[solver][key] for key in keys)

    rows = []
    for solver, own in times.items():
        keys = solvable & own.keys()
        ratios = [own[key] / fastest[key] for key in keys if own[key] < math.inf]
        rivals = [name for name in times if keys <= times[name].keys()]
        least = min(total(name, keys) for name in rivals)
        rows.append(
            Standing(
                solver=solver,
                measured=len(own),
                solved=len(ratios),
                median=_median(list(own.values())),
                total=total(solver, keys) if keys else math.nan,
                bound=sum(own[key] == math.inf for key in keys),
                to_best=total(solver, keys) / least if keys else math.nan,
                ratio=geometric_mean(ratios),
                worst=max(ratios, default=math.nan),
            )
        )
    return sorted(rows, key=lambda row: (-row.solved / row.measured, math.isnan(row.to_best), row.to_best, row.solver))


def _median(values: Sequence[float]) -> float:
    """The median; infinity where it lies among the unsolved."""
    ordered = np.sort(values)
    middle = ordered[[(len(ordered) - 1) // 2, len(ordered) // 2]]
    return float(middle.mean())


def refusals(group: Group, clock: str = "wall") -> list[Refusal]:
    """How solvers end on problems without a solution: those that prove it on most come first, the quicker before the slower."""
    column = CLOCKS[clock][0]
    by: dict[str, list[Measurement]] = defaultdict(list)
    for m in group.measurements:
        by[m.solver].append(m)
    rows = []
    for solver, own in by.items():
        ends: Counter[str] = Counter(_end(m) for m in own)
        seconds = [m.time_limit if getattr(m, column) is None else float(getattr(m, column)) for m in own]
        counts = {name: ends[name] for name in ("infeasible", "gave_up", "late", "failed", "solved")}
        rows.append(Refusal(solver, len(own), **counts, median=median(seconds)))
    return sorted(rows, key=lambda row: (-row.infeasible / row.measured, row.failed, row.median, row.solver))


def _end(m: Measurement) -> str:
    if m.solved:
        return "solved"
    if m.outcome == "INFEASIBLE":
        return "infeasible"
    if m.outcome in AT_TIME_LIMIT:
        return "late"
    return "failed" if m.outcome in ("KILLED_MEMORY", "CRASHED", "WRONG") else "gave_up"


def groups(measurements: Sequence[Measurement], of: Mapping[tuple[str, str], tuple[str, str, bool | None]], tol: float) -> list[Group]:
    """Groups at one tolerance, one a name and dimension in the order of `of`: (problem, form) -> (name, about, solvable).

    After them one of all that are not known to have no solution, for each dimension in which there are several. Measurements of other
    problems are left out.
    """
    here = [m for m in measurements if m.tol == tol and (m.problem, m.form) in of]
    sorted_in: dict[tuple[str, int], list[Measurement]] = defaultdict(list)
    places = {name: place for place, (name, _, _) in enumerate(dict.fromkeys(of.values()))}
    for m in here:
        sorted_in[of[m.problem, m.form][0], m.dimension].append(m)
    described = {name: (about, solvable) for name, about, solvable in of.values()}
    found = [
        Group(name, described[name][0], dimension, described[name][1], tol, tuple(own))
        for (name, dimension), own in sorted(sorted_in.items(), key=lambda item: (places[item[0][0]], -item[0][1]))
    ]
    whole = []
    for dimension in (3, 2):
        parts = [group for group in found if group.dimension == dimension and group.solvable is not False]
        if len(parts) > 1:
            about = f"All problems in {dimension}D but those that are known to have no solution, each with the same weight."
            whole.append(Group(ALL, about, dimension, None, tol, tuple(m for group in parts for m in group.measurements)))
    return [*found, *whole]
