"""Which rigid bodies would hide the rest of a run from the camera: the front walls of a box that something is poured into."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pyvista import DataSet

_TOWARDS = 0.1  # cosine: sides of the scene that face the camera less are not before it
_TOUCHES = 1e-2  # of the scene's size: what reaches into it by less is beside it
_HIDES = 0.5  # share of the side that a body covers before it is left out


def standing_before(rigid: DataSet, blocks: DataSet | None, toward: NDArray[np.float64]) -> NDArray[np.int64]:
    """Numbers of the rigid bodies that do not move and cover more than half of what moves, on a side of it that faces the camera.

    rigid, blocks: the data sets of the last instant; toward (3,): to the camera. A floor is below and covers nothing.
    """
    bodies = np.asarray(rigid.cell_data["body"])
    still: list[tuple[int, NDArray[np.float64]]] = []
    seen = [] if blocks is None else [np.asarray(blocks.points + blocks["displacement"])]
    for body in np.unique(bodies):
        part = rigid.extract_cells(bodies == body)
        if np.any(np.asarray(part["displacement"]) != 0):
            seen.append(np.asarray(part.points + part["displacement"]))
        else:
            still.append((int(body), np.asarray(part.points)))
    if not seen or not still:
        return np.empty(0, dtype=np.int64)
    every = np.concatenate(seen)
    hidden = [body for body, points in still if _covers(_box(points), _box(every), toward)]
    return np.array(hidden, dtype=np.int64)


def _box(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The least and the largest coordinates (2, 3) of points (n, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _covers(own: NDArray[np.float64], moving: NDArray[np.float64], toward: NDArray[np.float64]) -> bool:
    """Whether a box lies beyond that of what moves, both (2, 3), along an axis towards the camera, and over more than half of that side."""
    (own_low, own_high), (low, high) = own, moving
    slack = _TOUCHES * float((high - low).max())
    for axis in range(2):  # what is above is a load, not a wall
        beyond = own_low[axis] > high[axis] - slack if toward[axis] > 0 else own_high[axis] < low[axis] + slack
        if abs(toward[axis]) < _TOWARDS or not beyond:
            continue
        others = [k for k in range(3) if k != axis]
        common = np.minimum(own_high, high)[others] - np.maximum(own_low, low)[others]
        if np.all(common > 0) and np.prod(common) > _HIDES * np.prod((high - low)[others]):
            return True
    return False
