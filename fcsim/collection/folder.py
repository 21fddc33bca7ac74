"""Folders of problems: written whole under a temporary name, and read whoever made them."""

from __future__ import annotations

import glob
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fcsim.arrays import is_whole
from fcsim.brief import shown
from fcsim.collection.manifest import MANIFEST, read_manifest
from fcsim.errors import InputError
from fcsim.files import alone_in, resolved
from fcsim.tables import cell

FORMS = ("global", "local")
BESIDE = (MANIFEST, "README.md", "picture.png", "distributions.png", "selection.png")


@contextmanager
def whole_folder(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder beside `path` that takes its place if the block ends well and is removed if it does not.

    What killed processes left is removed. Raises InputError where `path` holds something, unless it is a collection, all of it, and may be
    overwritten, and where another process makes it: two that begin in the same moment do not touch each other's, the later one is refused
    at its end.
    """
    refuse_folder(path, overwrite)
    path = resolved(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_abandoned(path)
    if _at_work(path):
        raise InputError(f"{path}: another fcsim collection is making it; wait for its end, or choose another folder")
    with naming(path):
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent))
        temporary.chmod(0o777 & ~_umask())  # mkdtemp lets nobody else in
        try:
            with alone_in(temporary, "fcsim collection"):
                yield temporary
                refuse_folder(path, overwrite)
                _take_place(temporary, path)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def _take_place(made: Path, path: Path) -> None:
    """What was made in the place of `path`: the folder itself, but in the working directory what is in it, its manifest last, since whoever
    stands there would stand in a folder that is removed."""
    if path.exists() and path.samefile(os.curdir):
        _remove_collection(path, itself=False)
        for entry in sorted(made.iterdir(), key=lambda entry: entry.name == MANIFEST):
            entry.rename(path / entry.name)
        return
    if path.exists():
        _remove_collection(path)
    made.rename(path)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Errors of the system about temporary folders beside `path` that are made for it name `path`: theirs tell nobody anything."""
    try:
        yield
    except OSError as error:
        beside = path.absolute().parent
        for name in (error.filename, error.filename2):  # of a copy both
            if isinstance(name, str) and Path(name).is_relative_to(beside):
                own = Path(name).relative_to(beside).parts
                if own and own[0].startswith(f".{path.name}."):
                    error.filename, error.filename2 = str(path), None
        raise


PARTIAL = ".fcsim-collection.partial"


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current


def _at_work(path: Path) -> list[Path]:
    """Where this collection is made: folders of processes at work, and of killed ones."""
    return list(path.parent.glob(f".{glob.escape(path.name)}.*{PARTIAL}"))


def _remove_abandoned(path: Path) -> None:
    """Remove what processes that were killed left while they made this collection; those at work hold a lock."""
    for folder in _at_work(path):
        try:
            with alone_in(folder, "fcsim collection"):
                shutil.rmtree(folder, ignore_errors=True)
        except (InputError, OSError):
            continue


def _remove_collection(path: Path, *, itself: bool = True) -> None:
    """Remove the files of a collection one by one, its manifest last, and what is empty then, with the folder itself or without."""
    own = _own_files(path) if any(path.iterdir()) else {MANIFEST}
    for place in [*sorted(own - {MANIFEST}), MANIFEST]:
        (path / place).unlink(missing_ok=True)
    for form in FORMS:
        if (path / form).is_dir():
            (path / form).rmdir()
    if itself:
        path.rmdir()


def _own_files(path: Path) -> set[str]:
    return {*BESIDE, *(entry.place for entry in read_manifest(path))}


def refuse_kinds(spectrum_up_to: object, **switches: object) -> None:
    """Raise InputError where what is asked of a collection is of another kind: overwrite="no" would be true."""
    if not is_whole(spectrum_up_to, 0):
        raise InputError(f"spectrum_up_to: expected a whole number >= 0, got {shown(spectrum_up_to)}")
    for name, value in switches.items():
        if not isinstance(value, bool):
            raise InputError(f"{name}: expected True or False, got {shown(value)}")


def refuse_folder(path: Path, overwrite: bool, source: Path | None = None) -> None:
    """Raise InputError where a collection may not be written to `path`, as where that is or holds the `source` it is made from
    (which is not there where it is the name of a case that comes with fcsim).

    Only a folder whose manifest.csv lists all that it holds counts as a collection that may be replaced.
    """
    if source is not None and source.exists() and resolved(source).is_relative_to(resolved(path)):
        raise InputError(f"{path}: expected a folder apart from {source}, which the collection is made from")
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: expected a new folder for the collection, found a file")
    around = next(folder for folder in resolved(path).parents if folder.exists())
    if around.is_dir() and not os.access(around, os.W_OK | os.X_OK):
        raise InputError(f"{path}: expected a folder that can be written to, {around} cannot")
    if not path.exists() or not any(path.iterdir()):
        return
    found = {(Path(folder, name)).relative_to(path).as_posix() for folder, _, names in os.walk(path) for name in names}
    links = {entry.name for entry in path.iterdir() if entry.is_symlink()}
    own = _own_files(path) if (path / MANIFEST).is_file() else set()
    if foreign := sorted((found - own) | links) or ([] if own else sorted(entry.name for entry in path.iterdir())):
        raise InputError(f"{path}: expected a new folder or a collection to replace, found {', '.join(foreign[:5])} in it")
    if not overwrite:
        raise InputError(f"{path}: holds a collection; replace it with --overwrite")


@dataclass(frozen=True)
class Member:
    """A problem of a folder: its files, the global form first where both are there; `stem` is their name as tables have it."""

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
    return sorted((Member(cell(stem), tuple(paths)) for (_, stem), paths in found.items()), key=lambda member: natural(member.stem))


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
