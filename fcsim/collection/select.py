"""A graded selection of a folder of problems: difficulty is the number of iterations that a method needs from r = 0."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fcsim.bench.judge import FclibProblem
from fcsim.collection.folder import Member, Name, members, natural, parse_name, refuse_folder, whole_folder
from fcsim.collection.grade import choose
from fcsim.collection.manifest import AT_REST, MANIFEST, Entry, read_manifest, sha256, write_manifest
from fcsim.collection.plots import write_distributions, write_selection
from fcsim.collection.properties import Properties, properties
from fcsim.collection.readme import facts, write_readme
from fcsim.errors import FcsimError, InputError, MissingDependency
from fcsim.export_fclib import FclibFile, file_name, read_fclib
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.delassus_sum import DENSE_W_UP_TO
from fcsim.problem.reduction import eliminate_equalities, reduce
from fcsim.solvers import method, solve

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Graded:
    """A problem and how the method ended on it from r = 0."""

    member: Member
    name: Name
    nc: int
    status: str
    iterations: int

    @property
    def solved(self) -> bool:
        return self.status == "SOLVED"


@dataclass(frozen=True)
class Selection:
    """A selection on the disk: its folder, its rows, all problems with their difficulty in the order of time, and notes."""

    directory: Path
    entries: tuple[Entry, ...]
    graded: tuple[Graded, ...]
    notes: tuple[str, ...]


def select_problems(
    directory: str | Path,
    out: str | Path,
    *,
    count: int = 50,
    solver: str = "NSN-AC",
    tol: float = 1e-8,
    time_limit: float = 100.0,
    seed: int = 0,
    spectrum_up_to: int = DENSE_W_UP_TO,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Selection:
    """Copy `count` problems of graded difficulty from a folder of FCLIB files, fcsim's or not, to the collection `out`.

    Each problem is solved by `solver` from r = 0 to `tol`, for at most `time_limit` [s]; unsolved ones are the hardest. They are chosen
    evenly over difficulty and time, see `grade.choose`, and copied in the forms that are there, byte by byte, under a name that
    states these iterations. OUT holds them as global/ and local/, manifest.csv, README.md, distributions.png, selection.png.

    Left out with a note: rolling friction, files that cannot be read, problems at rest and such as r = 0 solves, dimensions that the
    method does not work in. Raises InputError where nothing is left, and for an argument that cannot be used.
    """
    directory, out = Path(directory), Path(out)
    method(solver)
    if count < 1:
        raise InputError(f"count: expected a whole number >= 1, got {count}")
    for name, value in (("tol", tol), ("time limit", time_limit)):
        if not value > 0:
            raise InputError(f"{name}: expected a number > 0, got {value}")
    refuse_folder(out, overwrite, directory)
    found = members(directory)
    known = {entry.place: entry for entry in read_manifest(directory)} if (directory / MANIFEST).is_file() else {}
    graded: list[Graded] = []
    notes: list[str] = []
    for done, member in enumerate(found, 1):
        try:
            graded.append(_grade(member, known.get(_place(directory, member.path)), solver, tol, time_limit))
        except FcsimError as error:
            notes.append(f"{member.stem}: left out, {error}")
        if progress is not None:
            progress("cold starts", done, len(found))
    if not graded:
        raise InputError(f"{directory}: expected problems that {solver} can be tried on, none is left:\n" + "\n".join(notes))
    graded.sort(key=lambda g: (natural(g.name.fclib_set), np.inf if g.name.step is None else g.name.step, natural(g.member.stem)))
    if count > len(graded):
        notes.append(f"{count} problems were asked for, there are {len(graded)}.")
    places = choose(np.array([g.iterations for g in graded]), np.array([g.solved for g in graded]), count, seed)
    with whole_folder(out, overwrite) as folder:
        entries: list[Entry] = []
        described: list[Properties] = []
        for done, place in enumerate(places, 1):
            rows, about = _copy(graded[place], folder, directory, known, solver, tol, spectrum_up_to, {e.name for e in entries})
            entries += rows
            described.append(about)
            if progress is not None:
                progress("copies", done, len(places))
        entries.sort(key=lambda entry: entry.place)
        write_manifest(folder, entries)
        pictures = _draw(graded, places, entries, folder, solver, notes)
        if (directory / "picture.png").is_file():
            shutil.copyfile(directory / "picture.png", folder / "picture.png")
            pictures = {"picture.png": "the case", **pictures}
        sets = sorted({g.name.fclib_set for g in graded})
        write_readme(
            folder / "README.md",
            f"{len(places)} problems of graded difficulty: {', '.join(sets[:5])}{' and others' if len(sets) > 5 else ''}",
            facts={"required accuracy": f"{tol:g}", **facts(entries, described)},
            text=_text(directory, graded, count, solver, tol, time_limit, seed),
            pictures=pictures,
            notes=notes,
        )
    return Selection(out, tuple(entries), tuple(graded), tuple(notes))


def _place(directory: Path, path: Path) -> str:
    return path.relative_to(directory).as_posix()


def _grade(member: Member, known: Entry | None, solver: str, tol: float, time_limit: float) -> Graded:
    """Solve a problem from r = 0; InputError says why it has no difficulty."""
    if known is not None and known.status == AT_REST:
        raise InputError("at rest: q is round-off")
    problem = _problem(read_fclib(member.path))
    if not problem.nc:
        raise InputError("no contacts")
    try:
        result = solve(problem, solver, tol=tol, time_limit=time_limit)
        status, iterations = result.status.name, result.iterations
    except SingularMatrix:
        status, iterations = "SINGULAR", 0
    if status == "SOLVED" and iterations == 0:
        raise InputError("r = 0 solves it")
    return Graded(member, parse_name(member.stem, problem.nc), problem.nc, status, iterations)


def _problem(content: FclibFile) -> GlobalProblem | LocalProblem:
    if isinstance(content.problem, GlobalProblem | LocalProblem):
        return content.problem
    raise InputError("a rolling friction problem (spacedim 5)")


def _copy(
    graded: Graded,
    folder: Path,
    directory: Path,
    known: dict[str, Entry],
    solver: str,
    tol: float,
    spectrum_up_to: int,
    taken: set[str],
) -> tuple[list[Entry], Properties]:
    """Copy the files of a problem and return their rows and the problem's properties."""
    name = file_name(graded.name.fclib_set, graded.iterations, graded.nc, graded.name.step or 0)
    if name in taken:  # two problems of one set and step: the whole of the old name tells them apart
        name = file_name(graded.member.stem, graded.iterations, graded.nc, graded.name.step or 0)
    entries: list[Entry] = []
    about = None
    for path in graded.member.paths:
        content = read_fclib(path)
        problem = _problem(content)
        target = folder / content.form / name
        target.parent.mkdir(exist_ok=True)
        shutil.copyfile(path, target)
        row = known.get(_place(directory, path))
        if about is None:
            local = reduce(problem).local if isinstance(problem, GlobalProblem) else eliminate_equalities(problem)
            about = properties(problem, local, 0 if row is not None and row.rank is not None else spectrum_up_to)
            if row is not None and row.rank is not None:
                about = replace(about, rank=row.rank, condition=row.condition, n=row.n)
        r = None if content.solution is None else content.solution.r
        entries.append(
            Entry(
                name=name,
                form=content.form,
                step=graded.name.step,
                time=None if row is None else row.time,
                nc=about.nc,
                n=about.n,
                m=about.m,
                density=about.density,
                symmetric=about.symmetric,
                rank=about.rank,
                condition=about.condition,
                solver=solver,
                iterations=graded.iterations,
                error=None if r is None else FclibProblem(name, content.form, problem).error(r),
                sha256=sha256(target),
                status=graded.status,
                tol=tol,
                fill=about.fill,
                dimension=about.dimension,
                source=_place(directory, path),
            )
        )
    assert about is not None
    return entries, about


def _draw(
    graded: Sequence[Graded], places: Sequence[int] | np.ndarray, entries: Sequence[Entry], folder: Path, solver: str, notes: list[str]
) -> dict[str, str]:
    chosen = np.zeros(len(graded), dtype=bool)
    chosen[places] = True
    stepped = len({g.name.fclib_set for g in graded}) == 1 and all(g.name.step is not None for g in graded)
    try:
        write_selection(
            [g.iterations for g in graded],
            [g.solved for g in graded],
            chosen.tolist(),
            folder / "selection.png",
            solver=solver,
            ordered_by="problems in the order of time" if stepped else "problems in the order of set, step and name",
        )
        write_distributions(entries, folder / "distributions.png")
    except MissingDependency as error:
        notes.append(f"No plots: {error}.")
        return {}
    return {"selection.png": "difficulty of all problems and of those chosen", "distributions.png": "distributions of those chosen"}


def _text(directory: Path, graded: Sequence[Graded], count: int, solver: str, tol: float, time_limit: float, seed: int) -> str:
    return (
        f"Chosen from {len(graded)} problems. The difficulty of a problem is the number of iterations of {solver} from r = 0 to the error "
        f"{tol:g} ({sum(g.solved for g in graded)} solved; time limit {time_limit:g} s); unsolved problems count as the hardest. "
        "The range of log iterations is divided into classes of equal width that get equal shares, each spread over time; within, the "
        f"choice is systematic from starts drawn by the seed {seed}. The files are copies, byte by byte, under names that state these "
        "iterations: the solution in them, and what their info says of iterations, are those of the program that made them.\n\n"
        "To make it again:\n\n"
        f"    fcsim collection select {directory.name} --count {count} --by iterations --solver {solver} --tol {tol:g} "
        f"--time-limit {time_limit:g} --seed {seed} --out DIR"
    )
