"""A graded selection of a folder of problems: difficulty is the number of iterations that a method needs from r = 0."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from itertools import count as numbers
from pathlib import Path

import numpy as np

from fcsim.arrays import is_number, is_whole
from fcsim.brief import shown
from fcsim.collection.folder import FORMS, Member, Name, members, natural, parse_name, refuse_folder, refuse_kinds, whole_folder
from fcsim.collection.grade import choose
from fcsim.collection.manifest import AT_REST, Entry, read_manifests_below, write_manifest
from fcsim.collection.plots import write_distributions, write_selection
from fcsim.collection.properties import Properties, properties
from fcsim.collection.readme import facts, write_readme
from fcsim.errors import FcsimError, InputError, MissingDependency
from fcsim.export_fclib import FclibFile, file_name, read_fclib
from fcsim.files import resolved, sha256
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.storage import SUM_UP_TO
from fcsim.problem import GlobalProblem, Judge, LocalProblem
from fcsim.problem.reduction import reduced
from fcsim.solvers import method, solve
from fcsim.tables import cell

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
class Made:
    """What a selection's README says in the place of its folder: title, where the problems come from, the command that makes it again."""

    title: str
    text: str
    command: str


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
    spectrum_up_to: int = SUM_UP_TO,
    overwrite: bool = False,
    progress: Progress | None = None,
    made: Made | None = None,
    notes: Sequence[str] = (),
) -> Selection:
    """Copy `count` problems of graded difficulty from a folder of FCLIB files, fcsim's or not, to the collection `out`.

    Each problem is solved by `solver` from r = 0 to `tol`, for at most `time_limit` [s]; unsolved ones are the hardest. The
    iterations are to be alike in all problems: NSN-AC's are, `auto`'s are of whatever method it chose, sweeps or Newton's. They are chosen
    evenly over difficulty and time, see `grade.choose`, and copied in the forms that are there, byte by byte, under a name that
    states these iterations. `made` says in the README what the folder came of, where it does not last, with these `notes`. OUT holds
    them as global/ and local/, manifest.csv, README.md, distributions.png, selection.png.

    Left out with a note: rolling friction, files that cannot be read, problems at rest and such as r = 0 solves, dimensions that the
    method does not work in. Raises InputError where nothing is left, and for an argument that cannot be used.
    """
    directory, out = Path(directory), Path(out)
    method(solver)
    for name, value, least in (("count", count, 1), ("seed", seed, 0)):
        if not is_whole(value, least):
            raise InputError(f"{name}: expected a whole number >= {least}, got {shown(value)}")
    for name, given in (("tol", tol), ("time limit", time_limit)):
        if not (is_number(given) and given > 0):
            raise InputError(f"{name}: expected a number > 0, got {shown(given)}")
    refuse_kinds(spectrum_up_to, overwrite=overwrite)
    refuse_folder(out, overwrite, directory)
    known = read_manifests_below(directory)
    asked = _Asked(directory, count, solver, tol, time_limit, seed, spectrum_up_to, made)
    found = [member for member in members(directory) if not resolved(member.path).is_relative_to(resolved(out))]  # earlier copies
    graded, left_out = _grade_all(found, known, asked, progress)
    notes = [*notes, *left_out]
    if count > len(graded):
        notes.append(f"{count} problems were asked for, there are {len(graded)}.")
    if 2 * (unsolved := sum(not g.solved for g in graded)) > len(graded):
        notes.append(f"{unsolved} of {len(graded)} problems are left unsolved by {solver}, which grades them alike: try another solver.")
    places = choose(np.array([g.iterations for g in graded]), np.array([g.solved for g in graded]), count, seed)
    with whole_folder(out, overwrite) as folder:
        entries: list[Entry] = []
        described: list[Properties] = []
        names = _names([graded[place] for place in places], directory)
        for done, (place, name) in enumerate(zip(places, names, strict=True), 1):
            rows, about = _copy(graded[place], name, folder, known, asked)
            entries += rows
            described.append(about)
            if progress is not None:
                progress("copies", done, len(places))
        entries.sort(key=lambda entry: entry.place)
        write_manifest(folder, entries)
        _write_readme(folder, asked, graded, places, entries, described, notes)
    return Selection(out, tuple(entries), tuple(graded), tuple(notes))


@dataclass(frozen=True)
class _Asked:
    """What a selection was asked for."""

    directory: Path
    count: int
    solver: str
    tol: float
    time_limit: float
    seed: int
    spectrum_up_to: int
    made: Made | None


def _grade_all(
    found: Sequence[Member], known: Mapping[str, Entry], asked: _Asked, progress: Progress | None
) -> tuple[list[Graded], list[str]]:
    """All problems with their difficulty in the order of time, and a note for each that is left out."""
    graded: list[Graded] = []
    notes: list[str] = []
    for done, member in enumerate(found, 1):
        try:
            graded.append(_grade(member, known.get(_place(asked.directory, member.path)), asked))
        except FcsimError as error:
            notes.append(f"{member.stem}: left out, {error}")
        if progress is not None:
            progress("cold starts", done, len(found))
    if not graded:
        raise InputError(f"{asked.directory}: expected problems that {asked.solver} can be tried on, none is left: " + "; ".join(notes))
    graded.sort(key=lambda g: (natural(g.name.fclib_set), np.inf if g.name.step is None else g.name.step, natural(g.member.stem)))
    return graded, notes


def _names(chosen: Sequence[Graded], directory: Path) -> list[str]:
    """A file name for each problem, no two the same, not even on file systems that know no capitals.

    SET-i<iterations>-<contacts>-<step>, with the whole of the old name for the set, then with its folders, then with a number, where
    another problem has the name.
    """
    taken: set[str] = set()
    names = []
    for graded in chosen:
        folders = [cell(part) for part in graded.member.path.relative_to(directory).parent.parts if part not in FORMS]
        stem, step = graded.member.stem, graded.name.step or 0
        whole = "-".join([*folders, stem])
        sets = chain((graded.name.fclib_set, stem, whole), (f"{whole}_{k}" for k in numbers(2)))
        made = (file_name(s.replace("\\", "_"), graded.iterations, graded.nc, step) for s in sets)  # bytes that are no UTF-8: \udce9
        name = next(name for name in made if name.lower() not in taken)
        taken.add(name.lower())
        names.append(name)
    return names


def _write_readme(
    folder: Path,
    asked: _Asked,
    graded: Sequence[Graded],
    places: Sequence[int] | np.ndarray,
    entries: Sequence[Entry],
    described: Sequence[Properties],
    notes: list[str],
) -> None:
    """README.md with its pictures; the problems that it counts are those of the folder."""
    held = len(members(folder))
    if held != len(places) or sum(1 for _ in folder.rglob("*.hdf5")) != len(entries):
        raise RuntimeError(f"{folder}: {len(places)} problems were chosen, the folder holds {held}")
    pictures = _draw(graded, places, entries, folder, asked.solver, notes)
    if (asked.directory / "picture.png").is_file():
        shutil.copyfile(asked.directory / "picture.png", folder / "picture.png")
        pictures = {"picture.png": "the case", **pictures}
    sets = sorted({g.name.fclib_set for g in graded})
    title = f"{held} problems of graded difficulty: {', '.join(sets[:5])}{' and others' if len(sets) > 5 else ''}"
    write_readme(
        folder / "README.md",
        title if asked.made is None else asked.made.title,
        facts={"required accuracy": f"{asked.tol:g}", **facts(entries, described)},
        text=_text(asked, graded),
        pictures=pictures,
        notes=notes,
    )


def _place(directory: Path, path: Path) -> str:
    return path.relative_to(directory).as_posix()


def _grade(member: Member, known: Entry | None, asked: _Asked) -> Graded:
    """Solve a problem from r = 0; InputError says why it has no difficulty."""
    if known is not None and known.status == AT_REST:
        raise InputError("at rest: q is round-off")
    problem = _problem(read_fclib(member.path))
    if not problem.nc:
        raise InputError("no contacts")
    try:
        result = solve(problem, asked.solver, tol=asked.tol, time_limit=asked.time_limit)
        status, iterations = result.status.name, result.iterations
    except SingularMatrix:
        reduced(problem)  # where M or R itself is singular: there is no W to describe, and the problem is left out
        status, iterations = "SINGULAR", 0
    if status == "SOLVED" and iterations == 0:
        raise InputError("r = 0 solves it")
    return Graded(member, parse_name(member.stem, problem.nc), problem.nc, status, iterations)


def _problem(content: FclibFile) -> GlobalProblem | LocalProblem:
    if isinstance(content.problem, GlobalProblem | LocalProblem):
        return content.problem
    raise InputError("a rolling friction problem (spacedim 5)")


def _copy(graded: Graded, name: str, folder: Path, known: Mapping[str, Entry], asked: _Asked) -> tuple[list[Entry], Properties]:
    """Copy the files of a problem and return their rows and the problem's properties."""
    entries: list[Entry] = []
    about = None
    for path in graded.member.paths:
        content = read_fclib(path)
        problem = _problem(content)
        target = folder / content.form / name
        target.parent.mkdir(exist_ok=True)
        shutil.copyfile(path, target)
        row = known.get(_place(asked.directory, path))
        if about is None:
            local = reduced(problem).local
            about = properties(problem, local, 0 if row is not None and row.rank is not None else asked.spectrum_up_to)
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
                solver=asked.solver,
                iterations=graded.iterations,
                error=None if r is None else Judge(problem).error(r),
                sha256=sha256(target),
                status=graded.status,
                tol=asked.tol,
                fill=about.fill,
                dimension=about.dimension,
                source=_place(asked.directory, path),
                parameters="" if row is None else row.parameters,
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


def _text(asked: _Asked, graded: Sequence[Graded]) -> str:
    command = (
        f"fcsim collection select {asked.directory.name} --count {asked.count} --by iterations --solver {asked.solver} "
        f"--tol {asked.tol:g} --time-limit {asked.time_limit:g} --seed {asked.seed} --out DIR"
    )
    return (
        f"{'' if asked.made is None else asked.made.text}"
        f"Chosen from {len(graded)} problems. The difficulty of a problem is the number of iterations of {asked.solver} from r = 0 to the "
        f"error {asked.tol:g} ({sum(g.solved for g in graded)} solved; time limit {asked.time_limit:g} s); unsolved problems count as the "
        "hardest. The range of log iterations is divided into classes of equal width that get equal shares, each spread over time; within, "
        f"the choice is systematic from starts drawn by the seed {asked.seed}. The files are copies, byte by byte, under names that state "
        "these iterations: the solution in them, and what their info says of iterations, are those of the program that made them.\n\n"
        "To make it again:\n\n"
        f"    {command if asked.made is None else asked.made.command}"
    )
