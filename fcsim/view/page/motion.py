"""The instants of a run as arrays for the page: where all surfaces go, stresses, velocities, contacts and their forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.running.folder import Instant, RunFolder
from fcsim.view.joints import Joints, find_joints, without_moved_on
from fcsim.view.joints.surface import Surface, surface_of
from fcsim.view.page.encoding import Encoded, largest, scaled, size, whole
from fcsim.view.scene import gravity_of, read

BYTES = 9_000_000
"""Of all arrays of a page; a run of more instants than fit in is shown by fewer of them, evenly spread."""

_OF_POINTS = ("reaction", "displacement")
_OF_CONTACTS = ("reaction_normal", "reaction_tangential", "gap", "sliding_velocity", "mu")
_NUMBERS = ("slave", "master")


@dataclass(frozen=True, eq=False)
class _Series:
    """The blocks or the rigid bodies of all instants: their surface, and what was read of each instant."""

    points: FloatArray
    surface: Surface
    cell: IntArray
    count: int
    displacement: list[FloatArray] = field(default_factory=list)
    speed: list[FloatArray] = field(default_factory=list)
    stress: list[FloatArray] = field(default_factory=list)


def motion(run: RunFolder, instants: Sequence[Instant], progress: Callable[[int, int], None], planar: bool = False) -> dict[str, object]:
    """Return the encoded motion of the run, with as many of the `instants` as fit into BYTES, the first and the last among them.

    t (n,); vertices (nv, 3) [m], triangle (nt, 3), line (nl, 2), body (nv,), cell (nt,): which entry of the stresses a triangle has;
    displacement (n, nv, 3) [m], speed (n, nv) [m/s], stress (n, ncells) [Pa]; contacts: first (n + 1,) and arrays over all of them;
    joints, where there are any: vertex (nf, k) and weight (nf, k k) of the corners of their facets, opening (n, nf) [m];
    gravity (n, 3) [m/s^2] or None; most: the largest displacement [m], speed [m/s], reaction [N] and opening [m] of the instants kept.
    InputError: files that cannot be read, or of other meshes than the first instant's.
    """
    joints = without_moved_on(find_joints(instants[0], planar), instants[-1])
    series, contacts, opening = _read(run, instants, joints, progress)
    gravity = [None if (g := gravity_of(instant)) is None else g.tolist() for instant in instants]
    keep = np.arange(len(instants))
    while True:
        encoded = _encode(series, contacts, [instant.t for instant in instants], keep)
        encoded["gravity"] = [gravity[k] for k in keep]
        encoded["most"] = {
            "displacement": max(largest(one.displacement[k]) for one in series for k in keep),
            "speed": max(largest(one.speed[k]) for one in series for k in keep),
            "reaction": max(largest(contacts[k].get("reaction", np.empty((0, 3)))) for k in keep),
            "opening": max(largest(opening[k]) for k in keep),
        }
        if len(joints):
            encoded["joints"] = _encode_joints(joints, series, np.stack([opening[k] for k in keep]))
        excess = size(encoded) / BYTES
        if excess <= 1 or len(keep) < 3:
            return {**encoded, "left_out": len(instants) - len(keep)}
        keep = np.unique(np.linspace(0, len(instants) - 1, max(2, int(0.97 * len(keep) / excess))).round().astype(int))


def _read(
    run: RunFolder, instants: Sequence[Instant], joints: Joints, progress: Callable[[int, int], None]
) -> tuple[list[_Series], list[dict[str, NDArray]], list[FloatArray]]:
    series: dict[str, _Series] = {}
    contacts, opening = [], []
    for number, instant in enumerate(instants):
        places = []
        for name, path in (("blocks", instant.blocks), ("rigid", instant.rigid)):
            if path is None:
                continue
            if name not in series:
                data, surface = surface_of(path)
                cell = np.unique(surface.cell, return_inverse=True)
                series[name] = _Series(np.asarray(data.points)[surface.node], surface, cell[1].ravel(), data.n_points)
            one, data = series[name], read(path)
            if data.n_points <= one.surface.node.max(initial=0) or data.n_cells <= one.surface.cell.max(initial=0):
                raise InputError(f"{path}: expected the mesh of the other instants of {run.directory}, found another one")
            places.append(np.asarray(data.points, dtype=float) + data["displacement"])
            one.displacement.append(np.asarray(data["displacement"])[one.surface.node])
            one.speed.append(np.linalg.norm(np.asarray(data["velocity"])[one.surface.node], axis=1))
            if "von_mises" in data.cell_data:
                one.stress.append(np.asarray(data["von_mises"])[np.unique(one.surface.cell)])
        opening.append(joints.opening(np.vstack(places)) if len(joints) and places else np.empty(0))
        contacts.append({} if instant.contacts is None else _contacts_of(instant))
        progress(number + 1, len(instants))
    counts = {len(one.displacement) for one in series.values()}
    if counts - {len(instants)}:
        raise InputError(f"{run.directory}: expected blocks and rigid bodies at each instant of vtk/, found some missing")
    return list(series.values()), contacts, opening


def _contacts_of(instant: Instant) -> dict[str, NDArray]:
    assert instant.contacts is not None
    data = read(instant.contacts)
    found: dict[str, NDArray] = {"point": np.asarray(data.points)}
    for name in (*_OF_POINTS, *_OF_CONTACTS, *_NUMBERS, "identity", "status"):
        if name in data.point_data:  # runs of older versions have neither bodies nor identities
            found[name] = np.asarray(data[name])
    return found


def _encode(series: list[_Series], contacts: list[dict[str, NDArray]], times: list[float], keep: IntArray) -> dict[str, object]:
    first = np.cumsum([0, *(len(one.points) for one in series)])
    first_cell = np.cumsum([0, *(len(one.stress[0]) if one.stress else 0 for one in series)])
    low = np.vstack([one.points for one in series]).min(axis=0)
    vertices = np.vstack([one.points for one in series]) - low
    stress = [np.stack([one.stress[k] for k in keep]) for one in series if one.stress]
    cell = [one.cell + begin if one.stress else np.full(len(one.cell), -1) for one, begin in zip(series, first_cell, strict=False)]
    content: dict[str, object] = {
        "t": [times[k] for k in keep],
        "low": low.tolist(),
        "vertices": scaled(vertices),
        "triangle": whole(np.vstack([one.surface.triangle + k for one, k in zip(series, first, strict=False)]).astype(np.int32)),
        "line": whole(np.vstack([one.surface.line + k for one, k in zip(series, first, strict=False)]).astype(np.int32)),
        "body": whole(np.concatenate([one.surface.body for one in series]).astype(np.int32)),
        "cell": whole(np.concatenate(cell).astype(np.int32)),
        "displacement": scaled(np.concatenate([np.stack([one.displacement[k] for k in keep]) for one in series], axis=1)),
        "speed": scaled(np.concatenate([np.stack([one.speed[k] for k in keep]) for one in series], axis=1)),
    }
    if stress:
        content["stress"] = scaled(np.concatenate(stress, axis=1))
    if any(contacts):
        content["contacts"] = _encode_contacts([contacts[k] for k in keep], low)
    return content


def _encode_joints(joints: Joints, series: list[_Series], opening: FloatArray) -> dict[str, object]:
    """Corners by the page's vertices, of which a point of the data set has one at least."""
    of_point, begin = [], 0
    for one in series:
        vertex = np.zeros(one.count, dtype=np.int64)
        vertex[one.surface.node] = np.arange(begin, begin + len(one.surface.node))
        of_point.append(vertex)
        begin += len(one.surface.node)
    own = np.concatenate(of_point)[joints.own]
    return {
        "vertex": whole(own.astype(np.int32)),
        "weight": scaled(joints.corner.reshape(len(joints), -1)),
        "opening": scaled(np.maximum(opening, 0.0)),
    }


def _encode_contacts(contacts: list[dict[str, NDArray]], low: FloatArray) -> dict[str, Encoded | list[int]]:
    count = [len(instant["point"]) if instant else 0 for instant in contacts]
    given = [instant for instant in contacts if instant]

    def all_of(name: str) -> NDArray | None:
        return np.concatenate([instant[name] for instant in given]) if all(name in instant for instant in given) else None

    found: dict[str, Encoded | list[int]] = {"first": np.cumsum([0, *count]).tolist()}
    for name in ("point", *_OF_POINTS, *_OF_CONTACTS):
        if (values := all_of(name)) is not None:
            found[name] = scaled(values - low if name == "point" else values)
    for name in _NUMBERS:
        if (values := all_of(name)) is not None:
            found[name] = whole(values.astype(np.int32))
    if (values := all_of("identity")) is not None:
        found["identity"] = whole(np.unique(values, return_inverse=True)[1].ravel().astype(np.int32))
    if (values := all_of("status")) is not None:
        found["status"] = whole(values.astype(np.int8))
    return found
