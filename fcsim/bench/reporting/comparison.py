"""A comparison of solvers: what is drawn and tabulated of a bench's results, tolerance by tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fcsim.bench.reporting.profiles import RESOLUTION, Profile, performance_profile
from fcsim.bench.reporting.summary import Summary, number, summarize
from fcsim.bench.reporting.time_table import CLOCKS, TimeTable, solver_names, time_table, tolerance_name, tolerances
from fcsim.bench.results import Measurement, read_results
from fcsim.errors import InputError


@dataclass(frozen=True)
class Selection:
    """What of the results is compared, and how; None = all that were measured."""

    tols: Sequence[float] | None = None
    solvers: Sequence[str] | None = None
    clock: str = "wall"
    reference: str | None = None
    leave_out_unsolved: bool = False
    resolution: float = RESOLUTION

    def arguments(self) -> list[str]:
        """The options of fcsim profile and fcsim report that select this."""
        words = ["--tols", ",".join(map(tolerance_name, self.tols))] if self.tols is not None else []
        words += ["--solvers", ",".join(self.solvers)] if self.solvers is not None else []
        words += ["--clock", self.clock] if self.clock != "wall" else []
        words += ["--reference", self.reference] if self.reference is not None else []
        words += ["--leave-out-unsolved"] if self.leave_out_unsolved else []
        return words + (["--resolution", f"{self.resolution:g}"] if self.resolution != RESOLUTION else [])


@dataclass(frozen=True, eq=False)
class ToleranceComparison:
    """The measurements at one tolerance: times, performance profile, counts."""

    table: TimeTable
    profile: Profile
    summary: Summary

    def description(self) -> str:
        """The counts behind the curves in one line."""
        of, unsolved = self.profile.problems, self.profile.unsolved_by_all
        felt = self.summary.censored_from
        limit = f"time limit {self.limits()}" + (f", felt from τ = {number(felt)} on (dotted)" if felt <= self.profile.largest else "")
        words = [f"{of} problem{'s' * (of != 1)}", CLOCKS[self.table.clock][1], limit]
        if unsolved:
            words.append(f"{unsolved} solved by none " + ("left out" if self.profile.left_out else "counted"))
        if self.table.left_out:
            words.append(f"{len(self.table.left_out)} not measured by all left out")
        return " · ".join(words)

    def limits(self) -> str:
        """The time limit, or its range."""
        low, high = self.table.limits.min(), self.table.limits.max()
        return f"{low:g} s" if low == high else f"{low:g} to {high:g} s"


@dataclass(frozen=True, eq=False)
class Comparison:
    """measurements: those of the chosen solvers and tolerances. remarks: what a reader must know before trusting the figures."""

    measurements: tuple[Measurement, ...]
    parts: tuple[ToleranceComparison, ...]
    remarks: tuple[str, ...]
    selection: Selection = field(default_factory=Selection)

    @property
    def summaries(self) -> list[Summary]:
        return [part.summary for part in self.parts]

    @property
    def solvers(self) -> tuple[str, ...]:
        return self.parts[0].table.solvers


def compare(results: Path | Sequence[Measurement], selection: Selection | None = None) -> Comparison:
    """Read a results table (file or folder) and compare its solvers.

    A tolerance at which no problem was measured by all solvers yet is left out with a remark, unless it was asked for.
    Raises InputError for results that cannot be compared.
    """
    s = selection or Selection()
    measurements = read_results(results) if isinstance(results, Path) else list(results)
    if not measurements:
        raise InputError(f"{results if isinstance(results, Path) else 'results'}: expected at least one measurement, the table is empty")
    names = solver_names(measurements, s.solvers)
    if s.reference is not None and s.reference not in names:
        raise InputError(f"--reference {s.reference}: expected one of the compared solvers, {', '.join(names)}")
    names, remarks = (names, []) if s.solvers is not None else _with_common_problems(measurements, names, s)
    parts = []
    for tol in tolerances(measurements, s.tols):
        try:
            table = time_table(measurements, tol, names, s.clock)
        except InputError as error:
            if s.tols is not None:
                raise
            remarks.append(str(error))
            continue
        profile = performance_profile(table.times, resolution=s.resolution, leave_out_unsolved=s.leave_out_unsolved)
        parts.append(ToleranceComparison(table, profile, summarize(table, s.reference, resolution=s.resolution)))
    if not parts:
        raise InputError("; ".join(remarks))
    chosen = tuple(m for m in measurements if m.solver in names and m.tol in {part.table.tol for part in parts})
    return Comparison(chosen, tuple(parts), (*remarks, *_remarks(chosen, parts)), s)


def _with_common_problems(measurements: Sequence[Measurement], names: list[str], s: Selection) -> tuple[list[str], list[str]]:
    """All solvers where some problem was measured with each; else without those of the fewest problems, as methods for 2D alone are beside
    those for 3D, and a remark for each. All, too, where less than two would stay."""
    wanted = set(tolerances(measurements, s.tols))
    problems: dict[str, set[tuple[str, str, float]]] = {name: set() for name in names}
    for m in measurements:
        if m.tol in wanted:
            problems[m.solver].add((m.problem, m.form, m.tol))
    kept, remarks = list(names), []
    while not set.intersection(*(problems[name] for name in kept)):
        rarest = min((name for name in kept if name != s.reference), key=lambda name: len(problems[name]), default="")
        if len(kept) <= 2 or not rarest:
            return names, []
        kept.remove(rarest)
        count = len({problem for problem, _, _ in problems[rarest]})
        why = f"no problem was measured with every solver, and the fewest, {count}, with it"
        remarks.append(f"{rarest} is left out: {why}; choose by --solvers")
    return kept, remarks


def _remarks(measurements: Sequence[Measurement], parts: Sequence[ToleranceComparison]) -> list[str]:
    remarks = []
    for name, values in (
        ("machines", {m.machine for m in measurements}),
        ("numbers of threads", {m.threads for m in measurements}),
        ("time limits", {m.time_limit for m in measurements}),
        ("versions of fcsim", {m.version for m in measurements if m.program == "fcsim"}),
    ):
        if len(values) > 1:
            listed = ", ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in sorted(values))
            remarks.append(f"the measurements were made with different {name} ({listed}): their times may not compare")
    left_out = max(len(part.table.left_out) for part in parts)
    if left_out:
        remarks.append(f"up to {left_out} problems a tolerance were not measured with every solver (yet) and are left out")
    return remarks
