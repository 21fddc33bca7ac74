"""checkpoint.h5: the moment from which an interrupted run goes on, bit by bit, with a checksum of all that it holds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from fcsim.apart import Array, Group, opened_apart
from fcsim.arrays import FloatArray
from fcsim.contact_law.law import Variables
from fcsim.contact_law.rolling_rows import ROWS, SPINNING_ROWS
from fcsim.errors import InputError
from fcsim.files import replacing_hdf5_for_good
from fcsim.timestep.chain import Lead
from fcsim.timestep.energy import Ledger
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.state import State
from fcsim.timestep.step import Moment, Step

_ARRAYS = tuple(field.name for field in fields(State) if field.name != "t")
MEMORIES = 100
"""More reactions of earlier steps than any run keeps."""


@dataclass(frozen=True)
class _Content:
    """A group of the file before it is written: attributes, arrays and groups by name."""

    attrs: dict[str, object]
    entries: dict[str, _Content | NDArray[np.generic]]

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)

    def __getitem__(self, name: str) -> _Content | NDArray[np.generic]:
        return self.entries[name]

    def write(self, group: h5py.Group) -> None:
        for name, value in self.attrs.items():
            group.attrs[name] = value
        for name, entry in self.entries.items():
            if isinstance(entry, _Content):
                entry.write(group.create_group(name))
            else:
                group[name] = entry


def write_checkpoint(path: Path, step: Step, origin: str = "") -> None:
    """Write the end of a step and its anchor, see `Simulation.run`; origin: which run it is of, see `Description`."""
    content = _moment(step.moment)
    content.attrs["origin"] = origin
    content.entries["anchor"] = _moment(step.anchor)
    content.attrs["sha256"] = content_digest(content)  # of what is in memory: reading the file back takes as long as writing it
    with replacing_hdf5_for_good(path) as file:
        content.write(file)


def _moment(moment: Moment) -> _Content:
    state, lead = moment.state, moment.lead
    attributes: dict[str, object] = {
        "step": moment.number,
        "t": state.t,
        "cuts": moment.cuts,
        "seen": moment.seen,
        "ledger": np.array(list(asdict(moment.ledger).values()), dtype=np.float64),
        "lead": lead.solver,
        "lead_counts": np.array([lead.streak, lead.steps]),
    }
    memory = {str(age): _Content({}, {"identity": r.identity, "frame": r.frame, "r": r.r}) for age, r in enumerate(moment.memory)}
    arrays = {name: values for name in _ARRAYS if (values := getattr(state, name)) is not None}
    content = _Content(attributes, {**arrays, "memory": _Content({}, dict(memory))})
    if (variables := moment.variables) is not None:
        law = content.entries["law"] = _Content({"stored": variables.stored}, {"identity": variables.identity})
        if variables.values:
            law.entries["values"] = _Content({}, dict(variables.values))
    return content


def content_digest(file: _Content | h5py.File | Group) -> str:
    """SHA-256 of the names, types, shapes and bytes of all datasets and attributes but the digest itself.

    Of bytes, not of what is printed: that has eight digits of an array, and others once a case has called `np.set_printoptions`.
    """
    digest = hashlib.sha256()

    def add(place: list[str], value: object) -> None:
        if isinstance(value, str):
            digest.update(json.dumps([*place, "text", value]).encode())
            return
        values = np.asarray(value)
        if values.dtype.hasobject:
            raise ValueError(f"{'/'.join(place)}: expected numbers or a text")
        digest.update(json.dumps([*place, values.dtype.str, values.shape]).encode() + values.tobytes())

    def take(name: str, entry: _Content | NDArray[np.generic] | h5py.Group | h5py.Dataset | Group | Array) -> None:
        if isinstance(entry, np.ndarray):
            add([name], entry)
            return
        for key in sorted(set(entry.attrs) - {"sha256"}):
            add([name, key], entry.attrs[key])
        if isinstance(entry, h5py.Dataset | Array):
            add([name], entry[()])
        else:
            for key in sorted(entry):
                if isinstance(entry, _Content | Group) or isinstance(entry.get(key, getlink=True), h5py.HardLink):
                    take(f"{name}/{key}" if name else key, entry[key])

    take("", file)
    return digest.hexdigest()


class _Changed(InputError):
    """The checksum of another content, or the checkpoint of another run."""


def read_checkpoint(path: Path, origin: str | None = None) -> tuple[Moment, Moment] | None:
    """The moment to go on from, and its anchor; None where there is no checkpoint, InputError where it is not as it was written, or is
    of a run of another origin (None: of any)."""
    if not path.is_file():
        return None
    try:
        file = opened_apart(path)
        _refuse_foreign(file)
        stated, found = file.attrs.get("sha256"), content_digest(file)
        if stated != found:
            raise _Changed(f"{path}: expected the checkpoint as it was written; its checksum does not agree with what it holds")
        if origin is not None and file.attrs.get("origin") != origin:
            raise _Changed(f"{path}: expected a checkpoint of the run that run.json describes, got one of another run")
        return _read_moment(file), _read_moment(_group(file, "anchor"))
    except _Changed:
        raise
    except (InputError, OSError, KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"{path}: expected a checkpoint of an earlier run: {error}") from None


def _refuse_foreign(file: Group) -> None:
    """Links, storage in other files and packed arrays are never a checkpoint's, nor are more groups than it has."""
    groups, seen = [file], 0
    while groups:
        group, seen = groups.pop(), seen + 1
        if seen > 3 * MEMORIES:
            raise ValueError("groups in a circle")
        for name, entry in group.items():
            if isinstance(entry, Group):
                groups.append(entry)
            elif not isinstance(entry, Array):
                raise ValueError(f"{name} is a link")
            elif entry.elsewhere or entry.chunked:
                raise ValueError(f"{name} is not stored as a checkpoint's arrays are")


def _read_moment(group: Group) -> Moment:
    arrays = {name: _array(group, name, 1) for name in _ARRAYS if name in group}
    state = State(float(group.attrs["t"]), **arrays)
    stored = _group(group, "memory")
    if not 0 <= len(stored) <= MEMORIES:
        raise ValueError(f"{len(stored)} reactions of earlier steps")
    memory = tuple(_reactions(_group(stored, str(age))) for age in range(len(stored)))
    supplied, gained, lowest, created, begun = map(float, group.attrs["ledger"])
    ledger = Ledger(supplied, gained, lowest, created, bool(begun))
    streak, steps = map(int, group.attrs["lead_counts"])
    lead = Lead(str(group.attrs["lead"]), streak, steps)
    variables = _variables(_group(group, "law")) if "law" in group else None
    return Moment(int(group.attrs["step"]), state, memory, int(group.attrs["cuts"]), variables, ledger, lead, float(group.attrs["seen"]))


def _variables(group: Group) -> Variables:
    """What the contact law remembers, see `fcsim.contact_law`."""
    identity = group.array("identity")
    values = {name: _group(group, "values").array(name) for name in _group(group, "values")} if "values" in group else {}
    if identity.ndim != 1 or any(array.dtype != np.float64 or len(array) != len(identity) for array in values.values()):
        raise ValueError(f"{group.name}: expected variables of {len(identity)} contacts")
    return Variables(identity, values, float(group.attrs["stored"]))


def _group(parent: Group, name: str) -> Group:
    entry = parent[name]
    if not isinstance(entry, Group):
        raise ValueError(f"{parent.name.rstrip('/')}/{name}: expected a group")
    return entry


def _array(group: Group, name: str, ndim: int) -> FloatArray:
    values = group.array(name)
    if values.dtype != np.float64 or values.ndim != ndim:
        raise ValueError(f"{group.name.rstrip('/')}/{name}: expected float64 of {ndim} axes, got {values.dtype} of shape {values.shape}")
    return values


def _reactions(group: Group) -> Reactions:
    identity, frame, r = group.array("identity"), _array(group, "frame", 3), _array(group, "r", 2)
    nc, d = r.shape[0], frame.shape[-1]
    if r.shape[1] not in (d, ROWS, SPINNING_ROWS) or identity.shape != (nc,) or identity.dtype.kind != "i" or frame.shape != (nc, d, d):
        raise ValueError(f"{group.name}: identity {identity.shape}, frame {frame.shape} and r {r.shape} do not fit")
    return Reactions(identity, frame, r)
