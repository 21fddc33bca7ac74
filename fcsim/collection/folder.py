"""Folders of problems: written whole under a temporary name, and read whoever made them."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fcsim.collection.manifest import MANIFEST
from fcsim.errors import InputError

FORMS = ("global", "local")
OWN_ENTRIES = {*FORMS, MANIFEST, "README.md", "picture.png", "distributions.png", "selection.png"}


@contextmanager
def whole_folder(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder beside `path` that takes its place if the block ends well and is removed if it does not.

    Raises InputError where `path` holds something, unless it is a collection and may be overwritten.
    """
    refuse_folder(path, overwrite)
    path = path.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary, old = (path.with_name(f".{path.name}.{what}") for what in ("partial", "replaced"))
    shutil.rmtree(temporary, ignore_errors=True)  # of a process that was killed
    temporary.mkdir()
    try:
        yield temporary
        refuse_folder(path, overwrite)
        if path.exists():
            shutil.rmtree(old, ignore_errors=True)
            path.rename(old)
        temporary.rename(path)
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def refuse_folder(path: Path, overwrite: bool, source: Path | None = None) -> None:
    """Raise InputError where a collection may not be written to `path`, as where that is or holds the `source` it is made from."""
    if source is not None and source.resolve().is_relative_to(path.resolve()):
        raise InputError(f"{path}: expected a folder apart from {source}, which the collection is made from")
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: expected a new folder for the collection, found a file")
    entries = {entry.name for entry in path.iterdir()} if path.exists() else set()
    if foreign := sorted(entries - OWN_ENTRIES):
        raise InputError(f"{path}: expected a new folder or a collection to replace, found {', '.join(foreign[:5])} in it")
    if entries and not overwrite:
        raise InputError(f"{path}: holds a collection; replace it with --overwrite")


@dataclass(frozen=True)
class Member:
    """A problem of a folder: its files, the global form first where both are there."""

    stem: str
    paths: tuple[Path, ...]

    @property
    def path(self) -> Path:
        return self.paths[0]


def members(directory: str | Path) -> list[Member]:
    """The problems of a folder (*.hdf5, in its folders too), in natural order of their names.

    Files of one name in folders `global` and `local` beside each other are two forms of one problem.
    """
    directory = Path(directory)
    if not directory.is_dir():
        raise InputError(f"{directory}: expected a folder of FCLIB files, found {'a file' if directory.exists() else 'no such folder'}")
    found: dict[tuple[Path, str], list[Path]] = {}
    for path in sorted(directory.rglob("*.hdf5")):  # global before local
        if any(part.startswith(".") for part in path.relative_to(directory).parts):
            continue  # being written
        beside = path.parent != directory and path.parent.name in FORMS
        found.setdefault((path.parent.parent if beside else path.parent, path.stem), []).append(path)
    if not found:
        raise InputError(f"{directory}: expected FCLIB files (*.hdf5), the folder holds none")
    return sorted((Member(stem, tuple(paths)) for (_, stem), paths in found.items()), key=lambda member: natural(member.stem))


def natural(text: str) -> list[tuple[int, str]]:
    """Sort key that puts 9 before 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", text)]


@dataclass(frozen=True)
class Name:
    """What a file's name tells: its set, the iterations that it states, its step."""

    fclib_set: str
    iterations: int | None = None
    step: int | None = None


def parse_name(stem: str, nc: int) -> Name:
    """Read SET-i<iterations>-<contacts>-<step>; of other names the set and what number may be a step.

    SET-i<iterations>-<number> is found in FCLIB: the number is the contacts where it equals nc, else the step. Otherwise a step is a
    trailing number after a separator or of three digits at least. A name that says no step is its own set.
    """
    if found := re.fullmatch(r"(.+)-i(\d+)-(\d+)-(\d+)", stem):
        return Name(found[1], int(found[2]), int(found[4]))
    if found := re.fullmatch(r"(.+)-i(\d+)-(\d+)", stem):
        return Name(found[1], int(found[2]), None if int(found[3]) == nc else int(found[3]))
    if found := re.fullmatch(r"(.*?[^\d_-])(?:[_-]+(\d+)|(\d{3,}))", stem) or re.fullmatch(r"(.+)[_-](\d+)()", stem):
        return Name(found[1].removesuffix(f"-{nc}"), None, int(found[2] or found[3]))
    return Name(stem)
