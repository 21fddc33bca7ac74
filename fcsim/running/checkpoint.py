"""checkpoint.h5: the moment from which an interrupted run goes on, bit by bit, with a checksum of all that it holds."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, fields
from pathlib import Path

import h5py
import numpy as np

from fcsim.contact_law.law import Variables
from fcsim.contact_law.rolling_rows import ROWS
from fcsim.errors import InputError
from fcsim.files import replacing_hdf5_for_good
from fcsim.timestep.energy import Ledger
from fcsim.timestep.state import State
from fcsim.timestep.step import Lead, Moment, Step
from fcsim.timestep.warm_start import Reactions

_ARRAYS = tuple(field.name for field in fields(State) if field.name != "t")
MEMORIES = 100
"""More reactions of earlier steps than any run keeps."""


def write_checkpoint(path: Path, step: Step) -> None:
    """Write the end of a step and its anchor, see `Simulation.run`."""
    with replacing_hdf5_for_good(path) as file:
        _write_moment(file, step.moment)
        _write_moment(file.create_group("anchor"), step.anchor)
        file.attrs["sha256"] = content_digest(file)


def _write_moment(group: h5py.Group, moment: Moment) -> None:
    group.attrs["step"] = moment.number
    group.attrs["t"] = moment.state.t
    group.attrs["cuts"] = moment.cuts
    group.attrs["seen"] = moment.seen
    for name in _ARRAYS:
        if (values := getattr(moment.state, name)) is not None:
            group[name] = values
    memory = group.create_group("memory")
    for age, reactions in enumerate(moment.memory):
        for name in ("identity", "frame", "r"):
            memory[f"{age}/{name}"] = getattr(reactions, name)
    group.attrs["ledger"] = np.array(list(asdict(moment.ledger).values()), dtype=np.float64)
    lead = moment.lead
    group.attrs["lead"], group.attrs["lead_counts"] = lead.solver, np.array([lead.streak, lead.steps])
    if (variables := moment.variables) is not None:
        law = group.create_group("law")
        law.attrs["stored"] = variables.stored
        law["identity"] = variables.identity
        for name, values in variables.values.items():
            law[f"values/{name}"] = values


def content_digest(file: h5py.File) -> str:
    """SHA-256 of the names, types, shapes and values of all datasets and attributes but the digest itself."""
    digest = hashlib.sha256()

    def take(name: str, entry: h5py.Group | h5py.Dataset) -> None:
        for key in sorted(set(entry.attrs) - {"sha256"}):
            digest.update(f"{name}@{key}={entry.attrs[key]!r};".encode())
        if isinstance(entry, h5py.Dataset):
            values = np.ascontiguousarray(entry[()])
            digest.update(f"{name}:{values.dtype.str}{values.shape};".encode() + values.tobytes())

    take("", file)
    file.visititems(take)
    return digest.hexdigest()


def read_checkpoint(path: Path) -> tuple[Moment, Moment] | None:
    """The moment to go on from, and its anchor; None where there is no checkpoint, InputError where it is not as it was written."""
    if not path.is_file():
        return None
    try:
        with h5py.File(path) as file:
            _refuse_foreign(file)
            stated, found = file.attrs.get("sha256"), content_digest(file)
            if stated != found:
                raise InputError(f"{path}: expected the checkpoint as it was written; its checksum does not agree with what it holds")
            return _read_moment(file), _read_moment(file["anchor"])
    except InputError:
        raise
    except (OSError, KeyError, TypeError, ValueError, AttributeError, RuntimeError, OverflowError) as error:
        raise InputError(f"{path}: expected a checkpoint of an earlier run: {error}") from None


def _refuse_foreign(file: h5py.File) -> None:
    """Links to other files and storage in them are never a checkpoint's; nor is data that unpacks to more than the file holds."""
    groups, seen = [file], 0
    while groups:
        group, seen = groups.pop(), seen + 1
        if seen > 3 * MEMORIES:
            raise ValueError("groups in a circle")
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise ValueError(f"{name} is a link")
            entry = group[name]
            if isinstance(entry, h5py.Group):
                groups.append(entry)
            elif entry.external or entry.is_virtual or entry.chunks is not None:
                raise ValueError(f"{name} is not stored as a checkpoint's arrays are")


def _read_moment(group: h5py.Group) -> Moment:
    arrays = {name: _array(group[name], 1) for name in _ARRAYS if name in group}
    state = State(float(group.attrs["t"]), **arrays)
    if not 0 <= len(group["memory"]) <= MEMORIES:
        raise ValueError(f"{len(group['memory'])} reactions of earlier steps")
    stored = [group[f"memory/{age}"] for age in range(len(group["memory"]))]
    memory = tuple(_reactions(entry) for entry in stored)
    supplied, gained, lowest, created, begun = map(float, group.attrs["ledger"])
    ledger = Ledger(supplied, gained, lowest, created, bool(begun))
    streak, steps = map(int, group.attrs["lead_counts"])
    lead = Lead(str(group.attrs["lead"]), streak, steps)
    variables = _variables(group["law"]) if "law" in group else None
    return Moment(int(group.attrs["step"]), state, memory, int(group.attrs["cuts"]), variables, ledger, lead, float(group.attrs["seen"]))


def _variables(group: h5py.Group) -> Variables:
    """What the contact law remembers, see `fcsim.contact_law`."""
    identity = group["identity"][()]
    values = {name: entry[()] for name, entry in group["values"].items()} if "values" in group else {}
    if identity.ndim != 1 or any(array.dtype != np.float64 or len(array) != len(identity) for array in values.values()):
        raise ValueError(f"{group.name}: expected variables of {len(identity)} contacts")
    return Variables(identity, values, float(group.attrs["stored"]))


def _array(dataset: h5py.Dataset, ndim: int) -> np.ndarray:
    values = dataset[()]
    if values.dtype != np.float64 or values.ndim != ndim:
        raise ValueError(f"{dataset.name}: expected float64 of {ndim} axes, got {values.dtype} of shape {values.shape}")
    return values


def _reactions(group: h5py.Group) -> Reactions:
    identity, frame, r = group["identity"][()], _array(group["frame"], 3), _array(group["r"], 2)
    nc, d = r.shape[0], frame.shape[-1]
    if r.shape[1] not in (d, ROWS) or identity.shape != (nc,) or identity.dtype.kind != "i" or frame.shape != (nc, d, d):
        raise ValueError(f"{group.name}: identity {identity.shape}, frame {frame.shape} and r {r.shape} do not fit")
    return Reactions(identity, frame, r)
