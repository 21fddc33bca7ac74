"""Files: written whole under a temporary name in the same folder, read within limits, kept within their folder, run as they are now."""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import h5py

from fcsim.brief import shown
from fcsim.errors import InputError

_PARTIAL = re.compile(r"\..*\.[0-9a-f]{12}\.partial(\.[^.]*)?")


def path_of(argument: str, what: str, given: object) -> Path:
    """A user's path; InputError, which names the argument and what the file is to be, where it is none: a number would be a descriptor."""
    if isinstance(given, (str, os.PathLike)) and isinstance(name := os.fspath(given), str):
        return Path(name)
    raise InputError(f"{argument}: expected the path of {what}, got {shown(given)}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`, which takes the place of `path` if the block ends well and is removed if it does not.

    Two processes that write one file do not touch each other's. Raises InputError where a device or a pipe is there, which a file would
    replace: /dev/null is everybody's.
    """
    _refuse_streams(path)
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:12]}.partial{path.suffix}")  # programs choose formats by the extension
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.errno is not None and (error.filename is None or str(error.filename) == str(temporary)):
            error.filename = str(path)  # a full disk does not say which file it was, and the temporary name tells nobody anything
        raise
    finally:
        with suppress(OSError):  # a disk that has become read-only meanwhile: what went wrong first is what is told
            temporary.unlink(missing_ok=True)


@contextmanager
def replacing_for_good(path: Path) -> Iterator[Path]:
    """As `replacing`; what took the place is on the disk also if the machine stops: for what says how far others have come."""
    with replacing(path) as temporary:
        yield temporary
        _to_the_disk(temporary)


def _to_the_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _refuse_streams(path: Path) -> None:
    """InputError where a device or a pipe is, or a link to what a process has open, as /dev/stdout: a file would take its place."""
    of_a_process = path.is_symlink() and path.readlink().is_relative_to("/proc")
    if of_a_process or (path.exists() and not path.is_file() and not path.is_dir()):
        raise InputError(f"{path}: expected the name of a file to write, found a pipe or a device")


def refuse_unwritable(path: Path) -> None:
    """InputError where no file can be written at `path`: no such folder, a folder itself or a device, or one that lets nobody write."""
    _refuse_streams(path)
    if path.is_dir():
        raise InputError(f"{path}: expected a file to write, found a folder")
    if not path.parent.is_dir():
        raise InputError(f"{path}: expected an existing folder, {path.parent} is none")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: expected a folder that can be written to, {path.parent} cannot")


def refuse_unwritable_place(path: Path) -> None:
    """InputError where neither a file nor a folder can be written at `path`, whose folders may be made: a read-only disk."""
    folder = next(place for place in (path.absolute(), *path.absolute().parents) if place.is_dir())
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{path}: expected a place that can be written to, {folder} cannot")


def remove_partial_files(directory: Path) -> None:
    """Remove what writers that were killed left in a folder and its folders, whose lock the caller holds."""
    for folder, _, names in os.walk(directory):
        for name in names:
            if _PARTIAL.fullmatch(name):
                Path(folder, name).unlink(missing_ok=True)


@contextmanager
def replacing_hdf5(path: Path) -> Iterator[h5py.File]:
    """Yield a new HDF5 file in memory, written to `path` as a whole if the block ends well.

    On a disk that is full HDF5 can neither write nor close a file, and its process ends in a segmentation fault; a file in memory is
    written with an OSError that can be told, and faster.
    """
    in_memory = f"{uuid.uuid4().hex}-{path.name}"  # HDF5 opens no name twice, and threads may write files of the same name
    with h5py.File(in_memory, "w", driver="core", backing_store=False, block_size=2**20) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with replacing(path) as temporary:
        temporary.write_bytes(image)


@contextmanager
def replacing_hdf5_for_good(path: Path) -> Iterator[h5py.File]:
    """As `replacing_hdf5`, and on the disk when the block has ended."""
    with replacing_for_good(path) as temporary, replacing_hdf5(temporary) as file:
        yield file


@contextmanager
def alone_in(directory: Path, what: str) -> Iterator[None]:
    """Keep other writers out of a folder; the lock goes with the process, however it ends. File systems without locks keep nobody out."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{directory}: another {what} is writing there; wait for its end, or choose another folder") from None
        except OSError:  # no locks on this file system
            pass
        yield
    finally:
        os.close(descriptor)


def inside(directory: Path, path: Path) -> Path:
    """`path`, which links and .. must not lead out of `directory`; InputError where they do."""
    place = resolved(path)
    if not place.is_relative_to(resolved(directory)):
        raise InputError(f"{path}: expected a place within {directory}, it leads to {place}")
    return path


def resolved(path: Path) -> Path:
    """The absolute place that a path leads to, links followed; InputError for links in a circle."""
    try:
        return path.resolve()
    except RuntimeError:  # Python's error for it
        raise InputError(f"{path}: expected a file or folder, found links in a circle") from None


def regular(path: Path) -> Path:
    """`path`, unless a pipe or a device is there, whose reading may never end; InputError for these."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: expected a file, got a pipe or a device")
    return path


def plain_name(name: str, what: str) -> str:
    """A name that a file of a folder can have and that no shell or terminal stumbles over; InputError for another."""
    if not re.fullmatch(r"\w[\w.+-]{0,99}", name):
        raise InputError(f"{what}: expected a name of letters, digits, '.', '_', '+' and '-', got {name[:120]!r}")
    return name


def sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, as `sha256sum` prints it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_READ: ContextVar[dict[str, str] | None] = ContextVar("files read", default=None)


@contextmanager
def files_read() -> Iterator[dict[str, str]]:
    """Collect the files that are read as input within the block, see `note_read`: name -> SHA-256."""
    found: dict[str, str] = {}
    token = _READ.set(found)
    try:
        yield found
    finally:
        _READ.reset(token)


def note_read(path: str | Path) -> None:
    """Say that a result depends on this file: a mesh, a table of loads."""
    found = _READ.get()
    if found is not None and Path(path).is_file():
        found[str(path)] = sha256(Path(path))


class _AsItIsNow(SourceFileLoader):
    """Neither reads nor keeps byte code: Python takes what it kept for current where size and whole seconds of the file's time agree, so
    that 2e7 for 1e7 within a second would run the old script."""

    def path_stats(self, path: object) -> NoReturn:
        """Say that nothing is known, which SourceLoader takes for "compile"."""
        raise OSError


def run_script(name: str, path: Path) -> ModuleType:
    """Run a Python file of a user's as the module `name` of sys.modules; whatever the file raises comes through."""
    loader = _AsItIsNow(name, str(path.absolute()))
    spec = spec_from_loader(name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    loader.exec_module(module)
    return module
