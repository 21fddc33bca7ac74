"""A collection from several cases by a recipe: each is run, and problems of graded difficulty are chosen from all their steps."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fcsim.collection.build import Progress, build_collection
from fcsim.collection.folder import naming, refuse_folder, refuse_kinds
from fcsim.collection.select import Made, Selection, select_problems
from fcsim.errors import InputError
from fcsim.linear.storage import SUM_UP_TO
from fcsim.records import from_json, read_json
from fcsim.running.case import Case
from fcsim.timestep.step import Step

FORMAT = "collection-recipe/1"


@dataclass(frozen=True)
class Source:
    """One run: case (a path from the recipe's folder), of whose steps every `every`-th is a candidate; parameters by name, as texts."""

    case: str
    every: int = 1
    parameters: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Recipe:
    """A collection as a JSON file says it: `count` problems from all sources, graded by the iterations of `solver` from r = 0 to `tol`,
    which has `time_limit` [s] for each; text: what the collection is, for its README."""

    format: str
    title: str
    text: str
    sources: tuple[Source, ...]
    count: int = 50
    solver: str = "NSN-AC"
    tol: float = 1e-8
    time_limit: float = 10.0
    seed: int = 0


def read_recipe(path: str | Path) -> Recipe:
    """Read a recipe; InputError that names file, key, what was expected and what came."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: expected a recipe, a JSON file of the format {FORMAT!r}, found none")
    content = read_json(path)
    found = content.get("format") if isinstance(content, dict) else None
    if found != FORMAT:
        raise InputError(f"{path}: expected a recipe of the format {FORMAT!r}, got {found!r}")
    recipe = from_json(Recipe, content, str(path))
    if not recipe.sources:
        raise InputError(f"{path}, 'sources': expected at least one case, got none")
    return recipe


def compose_collection(
    recipe: str | Path,
    out: str | Path,
    *,
    count: int | None = None,
    iterations: bool = False,
    spectrum_up_to: int = SUM_UP_TO,
    overwrite: bool = False,
    progress: Progress | None = None,
    watch: Callable[[Case, Step], None] | None = None,
) -> tuple[Selection, bool]:
    """Run the cases of a recipe, a JSON file, and write the collection `out` of its `count` problems, whole or not at all; and whether all
    runs ended well.

    The files are those of `build_collection`, chosen and named as by `select_problems`; iterations: of steps with nonlinear bodies the
    linearised problems that led to the last one are candidates too. The runs stand in a temporary folder beside `out` until it is made.
    Raises InputError where recipe, cases or out cannot be used.
    """
    path, out = Path(recipe), Path(out)
    refuse_kinds(spectrum_up_to, iterations=iterations, overwrite=overwrite)
    asked = read_recipe(path)
    refuse_folder(out, overwrite)
    out.resolve().parent.mkdir(parents=True, exist_ok=True)
    number = asked.count if count is None else count
    notes: list[str] = []
    complete = True
    with naming(out.resolve()), tempfile.TemporaryDirectory(prefix=f".{out.name}.runs.", dir=out.resolve().parent) as work:
        for k, source in enumerate(asked.sources, 1):
            case = path.parent / source.case
            built = build_collection(
                case,
                Path(work) / f"{k:02d}-{case.resolve().stem}",
                every=source.every,
                assignments=source.parameters,
                iterations=iterations,
                spectrum_up_to=0,
                pictures=False,
                progress=progress,
                watch=watch,
            )
            complete &= built.complete
            notes += [f"{source.case}: {note}" for note in built.notes]
        made = Made(asked.title, _text(asked), _command(path, asked, number, iterations))
        selection = select_problems(
            work,
            out,
            count=number,
            solver=asked.solver,
            tol=asked.tol,
            time_limit=asked.time_limit,
            seed=asked.seed,
            spectrum_up_to=spectrum_up_to,
            overwrite=overwrite,
            progress=progress,
            made=made,
            notes=notes,
        )
    return selection, complete


def _text(asked: Recipe) -> str:
    runs = "\n".join(
        f"* {source.case}, {'every step' if source.every == 1 else f'every {source.every} steps'}"
        + "".join(f", {name} = {value}" for name, value in source.parameters.items())
        for source in asked.sources
    )
    return f"{asked.text}\n\nFrom the cases\n\n{runs}\n\n"


def _command(path: Path, asked: Recipe, count: int, iterations: bool) -> str:
    more = f" --count {count}" if count != asked.count else ""
    return f"fcsim collection compose {shlex.quote(path.name)}{more}{' --iterations' if iterations else ''} --out DIR"
