"""checkpoint.h5: the moment from which an interrupted run goes on, bit by bit."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import h5py

from fcsim.errors import InputError
from fcsim.files import replacing_hdf5
from fcsim.timestep.state import State
from fcsim.timestep.step import Moment, Step
from fcsim.timestep.warm_start import Reactions

_ARRAYS = tuple(field.name for field in fields(State) if field.name != "t")


def write_checkpoint(path: Path, step: Step) -> None:
    """Write the end of a step and its anchor, see `Simulation.run`."""
    with replacing_hdf5(path) as file:
        _write_moment(file, step.moment)
        _write_moment(file.create_group("anchor"), step.anchor)


def _write_moment(group: h5py.Group, moment: Moment) -> None:
    group.attrs["step"] = moment.number
    group.attrs["t"] = moment.state.t
    group.attrs["cuts"] = moment.cuts
    for name in _ARRAYS:
        if (values := getattr(moment.state, name)) is not None:
            group[name] = values
    memory = group.create_group("memory")
    for age, reactions in enumerate(moment.memory):
        for name in ("identity", "frame", "r"):
            memory[f"{age}/{name}"] = getattr(reactions, name)


def read_checkpoint(path: Path) -> tuple[Moment, Moment] | None:
    """The moment to go on from, and its anchor."""
    if not path.is_file():
        return None
    try:
        with h5py.File(path) as file:
            return _read_moment(file), _read_moment(file["anchor"])
    except (OSError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected a checkpoint of an earlier run: {error}") from None


def _read_moment(group: h5py.Group) -> Moment:
    state = State(float(group.attrs["t"]), **{name: group[name][()] for name in _ARRAYS if name in group})
    stored = [group[f"memory/{age}"] for age in range(len(group["memory"]))]
    memory = tuple(Reactions(*(entry[name][()] for name in ("identity", "frame", "r"))) for entry in stored)
    return Moment(int(group.attrs["step"]), state, memory, int(group.attrs["cuts"]))
