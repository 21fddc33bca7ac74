"""Which files of a folder are a run's own: they alone are ever deleted, and only where run.json says that fcsim wrote it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from fcsim.errors import InputError
from fcsim.files import inside, remove_partial_files
from fcsim.running.description import FILE, Description, is_a_run, read_description

FOLDERS = ("vtk", "fclib", "fclib/global", "fclib/local", "plots", "pictures")
OWN = (
    r"steps\.(csv|h5)",
    r"checkpoint\.h5",
    r"film\.(gif|mp4)",
    r"page\.html",
    r"vtk/run\.pvd",
    r"vtk/(blocks|contacts|rigid|links)(\.pvd|_\d{5,}\.vt[up])",
    r"fclib/(global|local)/.+-i\d+-\d+-\d{5,}\.hdf5",
    r"plots/(reaction|energies|contacts|convergence|phases)\.(png|svg)",
    r"pictures/(stress|bodies|instants|contacts|cracks)\.png",
)


def check_folder(directory: Path, overwrite: bool) -> None:
    """Refuse a folder that holds anything but a run, a run that may not be replaced, and links that lead out of it."""
    try:
        str(directory).encode()
    except UnicodeEncodeError:
        raise InputError(f"{str(directory)!r}: expected a folder with a name of UTF-8, in which VTK and HDF5 can write") from None
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: expected a folder for the results, found a file")
    if directory.is_symlink() and not directory.exists():
        raise InputError(f"{directory}: expected a folder for the results, found a link to {directory.readlink()}, which is not there")
    if not directory.exists():
        above = next(folder for folder in directory.absolute().parents if folder.exists())
        if not above.is_dir():
            raise InputError(f"{directory}: expected a folder for the results, and {above}, in which it would be, is a file")
        if not os.access(above, os.W_OK | os.X_OK):
            raise InputError(f"{directory}: expected a folder for the results, and nothing may be written in {above}")
        return
    for name in FOLDERS:
        inside(directory, directory / name)
    entries = sorted(entry.name for entry in directory.iterdir() if not entry.name.endswith(".partial"))
    if not entries:
        return
    if not is_a_run(directory):
        if {FILE, "steps.csv"} <= set(entries):  # nothing says any more whose these files are: to delete them is the user's to decide
            why = f"{FILE} is damaged or not fcsim's, so nothing here is replaced"
            raise InputError(f"{directory}: {why}; delete the folder yourself, or choose another --out")
        raise InputError(f"{directory}: expected an empty or new folder, or a run's, for the results, found {', '.join(entries[:5])}")
    if not overwrite:
        raise InputError(f"{directory}: holds the results of an earlier run; go on with --resume, replace it with --overwrite")


def make_folder(directory: Path) -> None:
    """Make the folder of a run, and those above it; InputError with the system's reason where it cannot be made."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: expected a folder for the results, and it cannot be made: {error.strerror}") from None


def empty(directory: Path) -> None:
    """Remove an earlier run's files one by one, run.json last, and the folders that are empty then; what others put there stays."""
    if is_a_run(directory):
        for path in own_files(directory):
            path.unlink()
        (directory / FILE).unlink()
    remove_partial_files(directory)
    for name in sorted(FOLDERS, key=len, reverse=True):
        folder = directory / name
        if folder.is_dir() and not folder.is_symlink() and not any(folder.iterdir()):
            folder.rmdir()


def own_files(directory: Path) -> Iterator[Path]:
    """The run's files but run.json."""
    histories = "|".join(re.escape(history.name) for history in _described(directory).plots.histories)
    own = re.compile("|".join((*OWN, rf"plots/({histories})\.(png|svg)") if histories else OWN))
    for folder, _, names in os.walk(directory):
        for name in names:
            path = Path(folder, name)
            if own.fullmatch(path.relative_to(directory).as_posix()):
                yield path


def _described(directory: Path) -> Description:
    try:
        return read_description(directory)
    except InputError:  # marked as a run's, and damaged
        return Description()
