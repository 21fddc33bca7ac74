"""A collection from a case or from a finished run's folder: files in both forms, manifest, README, picture and plot."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import is_whole
from fcsim.brief import shown
from fcsim.collection.folder import Name, members, parse_name, refuse_folder, refuse_kinds, whole_folder
from fcsim.collection.manifest import AT_REST, Entry, write_manifest
from fcsim.collection.plots import write_distributions
from fcsim.collection.properties import Properties, properties
from fcsim.collection.readme import facts, write_readme
from fcsim.collection.run_about import RunAbout, notes_on
from fcsim.errors import InputError, MissingDependency
from fcsim.export_fclib import FclibFile, Solution, file_name, read_fclib, write_fclib
from fcsim.files import sha256
from fcsim.linear.storage import SUM_UP_TO
from fcsim.problem import GlobalProblem, Judge, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.running.case import Case, load_case
from fcsim.running.folder import RunFolder, open_run
from fcsim.running.run import RunOptions, run_case
from fcsim.timestep.step import Step

Progress = Callable[[str, int, int], None]
"""Called with (what, done, total)."""


@dataclass(frozen=True)
class Built:
    """A collection on the disk: its folder, its rows, what is to be said of it, and whether the run behind it ended well."""

    directory: Path
    entries: tuple[Entry, ...]
    notes: tuple[str, ...]
    complete: bool


def build_collection(
    source: str | Path,
    out: str | Path,
    *,
    every: int = 1,
    assignments: Mapping[str, str] | None = None,
    iterations: bool = False,
    authors: str = "",
    spectrum_up_to: int = SUM_UP_TO,
    pictures: bool = True,
    overwrite: bool = False,
    progress: Progress | None = None,
    watch: Callable[[Case, Step], None] | None = None,
) -> Built:
    """Write the problems of a case, which is run, or of a run's folder as the collection `out`, whole or not at all.

    source          folder of a run that exported FCLIB files, or a case (its folder or its script)
    every           keep the steps that it divides
    assignments     of a case: parameters by name, as texts
    iterations      of steps with nonlinear bodies also the linearised problems that led to the last one, as sets of their own,
                    SET-newton00, SET-newton01, ...; a finished run must have exported them
    spectrum_up_to  contact unknowns up to which rank and condition of W are computed (0.8 s a problem at 2064)
    pictures        whether to draw the last step and the distributions
    progress        called after each problem written, `watch` after each step of the case's run

    OUT/global, OUT/local  SET-i<iterations>-<contacts>-<step>.hdf5 with title, description, math_info, solution and guess; local by
                           reduction of global. The iterations are those of the run.
    OUT/manifest.csv       one row a file, see `Entry`
    OUT/README.md          with picture.png, where the run's VTK files can be drawn, and distributions.png

    Raises InputError where source or out cannot be used.
    """
    source, out = Path(source), Path(out)
    if not is_whole(every, 1):
        raise InputError(f"every: expected a whole number >= 1, got {shown(every)}")
    refuse_kinds(spectrum_up_to, iterations=iterations, pictures=pictures, overwrite=overwrite)
    if not isinstance(authors, str):
        raise InputError(f"authors: expected a text, got {shown(authors)}")
    if assignments is not None and not (
        isinstance(assignments, Mapping) and all(isinstance(text, str) for pair in assignments.items() for text in pair)
    ):
        raise InputError(f"assignments: expected texts by names of parameters, got {shown(assignments)}")
    refuse_folder(out, overwrite, source)
    is_run = (source / "run.json").is_file()
    if is_run and assignments:
        raise InputError(f"{source}: a finished run, whose parameters stay as they are; got {', '.join(assignments)}")
    with whole_folder(out, overwrite) as folder:
        made = folder / "run"
        if not is_run:
            # VTK files of the last step only
            options = RunOptions(export_every=every, export_iterations=iterations, vtk_every=1 << 60, checkpoint_every=0)
            if run_case(load_case(source), assignments or {}, made, options, watch=watch).status == "interrupted":
                raise KeyboardInterrupt
            if not any(made.rglob("*.hdf5")):
                raise InputError(f"{source}: expected steps that every = {every} divides, to make a collection of; the run had none")
        built = _write_collection(
            open_run(source if is_run else made), folder, _Kept(every, iterations, pictures), authors, spectrum_up_to, progress
        )
        shutil.rmtree(made, ignore_errors=True)
    return replace(built, directory=out)


@dataclass(frozen=True)
class _Kept:
    """Which problems of a run: of the steps that `every` divides the last, or with `iterations` all; and whether pictures are drawn."""

    every: int
    iterations: bool
    pictures: bool


LINEARISED = re.compile(r".+-newton\d+")
"""Sets of the problems before the last one of a step, see `fcsim.running.fclib_series`."""


def _write_collection(run: RunFolder, folder: Path, kept: _Kept, authors: str, spectrum_up_to: int, progress: Progress | None) -> Built:
    """Write the problems of a run's folder with manifest, README and pictures into an empty folder."""
    about = RunAbout.of(run)
    chosen = _exported(run, kept)
    entries: list[Entry] = []
    described: list[Properties] = []
    for done, (step, path) in enumerate(chosen, 1):
        content = read_fclib(path)
        written, known = _write_problem(content, step, run, about, folder, spectrum_up_to)
        entries += written
        described.append(known)
        if progress is not None:
            progress("problems", done, len(chosen))
    entries.sort(key=lambda entry: entry.place)
    complete = run.description.status == "finished"
    drawn, notes = _draw(run, entries, folder) if kept.pictures else ([], [])
    notes = [*notes_on(run, entries), *notes]
    write_manifest(folder, entries)
    write_readme(
        folder / "README.md",
        about.title,
        facts={**about.facts(authors), **facts(entries, described)},
        text=about.text(kept.every, kept.iterations),
        pictures={name: text for name, text in PICTURES.items() if name in drawn},
        notes=notes,
    )
    return Built(folder, tuple(entries), tuple(notes), complete)


PICTURES = {
    "picture.png": "the last step",
    "distributions.png": "distribution of contacts, degrees of freedom, contact density, iterations",
}


def _exported(run: RunFolder, kept: _Kept) -> list[tuple[int, Path]]:
    """The steps that `every` divides, with their files: global where there, else local; of a step in the order of its iterations."""
    fclib = run.directory / "fclib"
    if not fclib.is_dir():
        raise InputError(f"{run.directory}: expected FCLIB files in fclib/, the run exported none (fcsim run --export-every K)")
    found = [(name, member.path) for member in members(fclib) if (name := parse_name(member.stem, 0)).step is not None]
    earlier = [LINEARISED.fullmatch(name.fclib_set) is not None for name, _ in found]
    chosen = sorted(
        (name.step, not before, name.fclib_set, path)
        for (name, path), before in zip(found, earlier, strict=True)
        if name.step is not None and name.step % kept.every == 0 and (kept.iterations or not before)
    )
    if not chosen:
        steps = ", ".join(map(str, sorted({name.step for name, _ in found if name.step is not None})[:10]))
        raise InputError(f"{run.directory}: expected an exported step that {kept.every} divides, got {steps}")
    if kept.iterations and not any(earlier) and not run.description.options.get("export_iterations"):
        raise InputError(
            f"{run.directory}: expected all linearised problems of its steps, the run wrote only the last of each (--export-iterations)"
        )
    return [(step, path) for step, _, _, path in chosen]


def _write_problem(
    content: FclibFile, step: int, run: RunFolder, about: RunAbout, folder: Path, spectrum_up_to: int
) -> tuple[list[Entry], Properties]:
    """Write a problem in both forms (a local one as it is) and return its rows and properties."""
    problem, solution = content.problem, content.solution
    if solution is None or not isinstance(problem, GlobalProblem | LocalProblem):
        raise InputError(f"{content.path}: expected a problem with its solution, as fcsim run exports it")
    local = reduce(problem).local if isinstance(problem, GlobalProblem) else problem
    known = properties(problem, local, spectrum_up_to)
    named = parse_name(content.path.stem, 0)
    solver, iterations, t = _solve_of(run, step, named)
    tol = math.nan if run.description.tol is None else run.description.tol
    name = file_name(named.fclib_set, iterations, problem.nc, step)
    stored = replace(local, W=sp.csc_array(local.W))  # judged in the storage of the file, as `check` will
    forms: dict[str, GlobalProblem | LocalProblem] = {"local": stored}
    if isinstance(problem, GlobalProblem):
        forms = {"global": problem, **forms}
    entries = []
    for form, written in forms.items():
        error = Judge(written).error(solution.r)
        path = folder / form / name
        path.parent.mkdir(exist_ok=True)
        write_fclib(
            path,
            written,
            solution=_of_form(form, solution),
            guesses=[_of_form(form, guess) for guess in content.guesses],
            title=content.info.title or f"{about.title}, step {step}",
            description=about.of_each_file,
            math_info=f"{known.text}; solution by {solver} in {iterations} iterations from the reactions of the steps before, "
            f"error ||r - P_K(r - u - g(u))|| / ||q|| = {error:.3e}",
        )
        at_rest = not np.any(solution.r) and error > tol
        entries.append(
            Entry(
                name=name,
                form=form,
                step=step,
                time=t,
                nc=known.nc,
                n=known.n,
                m=known.m,
                density=known.density,
                symmetric=known.symmetric,
                rank=known.rank,
                condition=known.condition,
                solver=solver,
                iterations=iterations,
                error=error,
                sha256=sha256(path),
                status=AT_REST if at_rest else "SOLVED",
                tol=tol,
                fill=known.fill,
                dimension=known.dimension,
                source="",
                parameters=about.parameters_text,
            )
        )
    return entries, known


def _of_form(form: str, solution: Solution) -> Solution:
    return solution if form == "global" else Solution(solution.u, solution.r)


def _solve_of(run: RunFolder, step: int, named: Name) -> tuple[str, int, float | None]:
    """Solver, iterations and time [s] of a problem: the file's name states its own iterations, where the row of the step in steps.csv has
    those of all its parts and linearised problems; without a row the rest is as run.json says."""
    numbers = run.numbers("step")
    rows = np.flatnonzero(numbers == step) if numbers is not None else np.empty(0, dtype=int)
    if not len(rows):
        h = run.description.h
        return run.description.solver, named.iterations or 0, None if h is None else step * h
    row = int(rows[-1])
    iterations = int(run.columns["iterations"][row]) if named.iterations is None else named.iterations
    return str(run.columns["solver"][row]), iterations, float(run.columns["t"][row])


def _draw(run: RunFolder, entries: list[Entry], folder: Path) -> tuple[list[str], list[str]]:
    """Draw what can be drawn; return the pictures' names and a note for each that cannot."""
    drawn, notes = [], []
    try:
        write_distributions(entries, folder / "distributions.png")
        drawn.append("distributions.png")
        if run.instants:
            _picture(run, folder / "picture.png")
            drawn.append("picture.png")
        else:
            notes.append("No picture: the run wrote no VTK files.")
    except MissingDependency as error:
        notes.append(f"No {'picture' if drawn else 'pictures'}: {error}.")
    return drawn, notes


def _picture(run: RunFolder, path: Path) -> None:
    """The deformed shape at the last instant, coloured by stress."""
    from fcsim.view.pictures import stress_figure
    from fcsim.view.scene import Scene, survey
    from fcsim.view.style import STYLE, matplotlib, save

    with matplotlib().rc_context(STYLE), Scene(survey(run, run.instants)) as scene:
        save(stress_figure(run, scene, run.instants[-1]), path)
