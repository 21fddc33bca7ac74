"""Which problems a folder holds, from the sizes in the files alone: matrices are read by the process that measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fcsim.apart import Array, Group, opened_apart
from fcsim.errors import InputError
from fcsim.tables import cell

FORMS = ("global", "local")
ROLLING = 5
"""spacedim of rolling friction problems, which benchmarks leave out: few methods solve them."""


@dataclass(frozen=True)
class Entry:
    """A file and the sizes of its problem; `n`: degrees of freedom, contact unknowns in local form."""

    path: Path
    form: str
    dimension: int
    nc: int
    n: int

    @property
    def name(self) -> str:
        """The stem of the file as a table has it, by which a bench that goes on knows what it has measured."""
        return cell(self.path.stem)


def _entry(path: Path) -> Entry:
    try:
        file = opened_apart(path)
        form = next((form for form in FORMS if f"fclib_{form}" in file), None)
        if form is None:
            if any("rolling" in name for name in file):
                return Entry(path, "rolling", ROLLING, 0, 0)
            raise InputError(f"expected an FCLIB problem (/fclib_global or /fclib_local), got {', '.join(file) or 'nothing'}")
        group = file[f"fclib_{form}"]
        if not isinstance(group, Group):
            raise KeyError(f"fclib_{form} is no group")
        dimension = int(group.array("spacedim").item())
        return Entry(path, form, dimension, _length(group, "vectors/mu"), _length(group, "vectors/f" if form == "global" else "vectors/q"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (OSError, KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(f"{path}: expected an FCLIB file, which cannot be read: {error}") from None


def _length(group: Group, name: str) -> int:
    vector = group[name]
    if not isinstance(vector, Array):
        raise KeyError(f"no vector {name}")
    return vector.shape[0]


def entries(
    paths: Sequence[Path], form: str = "all", dimension: int | None = None, unreadable: list[str] | None = None
) -> tuple[list[Entry], list[str]]:
    """The problems of that form (global, local or all) and dimension (2, 3 or None for both) in files and folders, the small ones first.

    Also a note for each that is left out: rolling friction, no contact. unreadable: takes the errors of a folder's files that cannot be
    read; None: they are raised, as those of files that are named themselves. Raises InputError where there is none, or two of one name.
    """
    found: list[Entry] = []
    notes: list[str] = []
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: expected a folder of FCLIB files, or such a file; it does not exist")
        files = sorted(path.rglob("*.hdf5")) if path.is_dir() else [path]
        for file in files:
            if file.name.startswith("."):  # being written
                continue
            try:
                found.append(_entry(file))
            except InputError as error:
                if unreadable is None or not path.is_dir():
                    raise
                unreadable.append(str(error))
    kept: dict[tuple[str, str], Entry] = {}
    for entry in found:
        if entry.dimension == ROLLING or entry.nc == 0:
            notes.append(f"{entry.name}: left out, " + ("a rolling friction problem" if entry.dimension == ROLLING else "no contact"))
        elif form in ("all", entry.form) and dimension in (None, entry.dimension):
            other = kept.setdefault((entry.name, entry.form), entry)
            if other.path.resolve() != entry.path.resolve():
                raise InputError(f"{entry.path}: expected another name, {other.path} is a {entry.form} problem of the same")
    if not kept:
        wanted = f"FCLIB problems{'' if dimension is None else f' in {dimension}D'}{'' if form == 'all' else f' in {form} form'} (*.hdf5)"
        none = f"{', '.join(map(str, paths))}: expected {wanted} with contacts, found none among {len(found) + len(unreadable or ())} files"
        raise InputError("; ".join([none, *(unreadable or ())[:1]]))
    return sorted(kept.values(), key=lambda entry: (entry.nc, entry.n, entry.name)), notes
