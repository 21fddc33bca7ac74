"""Nodes and facets by where they are: at points, or where a function of the coordinates says so, as those of dolfinx's
`locate_entities`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from fcsim.arrays import BoolArray, FloatArray, IntArray, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError, asked, expect
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part

Where = Callable[[FloatArray], ArrayLike]
"""Of the coordinates x (d, n) [m], x[0] all those along x: whether each place is meant (n,)."""

NEAR = 1e-6
"""Of the largest extent of the points: how far a node may be from the point that names it."""


def nodes_at(points: FloatArray, at: ArrayLike | Where, what: str) -> IntArray:
    """Return the ascending numbers of the points (n, d) at one place (d,), at several (k, d), or where the function `at` says so.

    InputError (`what` names the asker) where a place has no node, naming the nearest, and where the function is true nowhere.
    """
    if callable(at):
        meant = np.flatnonzero(_told(points, at, what))
        if not meant.size:
            low, high = (tuple(float(f"{c:.6g}") for c in end) for end in (points.min(axis=0), points.max(axis=0)))
            raise InputError(
                f"{what}: expected a function that is true at some of the {len(points)} nodes, which lie between {low} and {high}; it "
                "is at none (coordinates carry round-off: numpy.isclose(x[0], 0.5), not x[0] == 0.5)"
            )
        return meant
    d = points.shape[1]
    places: FloatArray = np.atleast_2d(numbers_of(at))
    if places.ndim != 2 or places.shape[1] != d or not len(places) or not np.all(np.isfinite(places)):
        raise InputError(f"{what}: expected a point of {d} finite coordinates, several (k, {d}), or a function of them, got {shown(at)}")
    distance, nearest = cKDTree(points).query(places)
    far = int(np.argmax(distance))
    if not np.isfinite(distance[far]):  # its square is beyond all floats
        raise InputError(f"{what}: expected points at nodes, got {tuple(places[far].tolist())}, far from all of them")
    if distance[far] > NEAR * np.ptp(points, axis=0).max():
        raise InputError(
            f"{what}: expected points at nodes, got {tuple(places[far].tolist())}; the nearest node is at "
            f"{tuple(float(f'{c:.9g}') for c in points[nearest[far]])}, number {nearest[far]}"
        )
    return np.unique(nearest).astype(np.int64)


def with_surface(part: Part, name: str, where: Where) -> Part:
    """Return the part with one more named surface: the facets of its boundary at all of whose nodes `where` is true.

    where takes coordinates x (d, n) [m] in the part's axes, as dolfinx's `locate_entities_boundary`. Facets are oriented outwards.
    InputError for a name that is there, and where no facet is meant.
    """
    expect(part, Part, "with_surface, part", "a Part, as brick(...) gives")
    what = f"Part {part.name!r}, surface {name!r}"
    if name in part.surfaces:
        raise InputError(f"{what}: expected a new name, the surfaces are {', '.join(map(repr, part.surfaces))}")
    meant = _told(part.points, where, what)
    cell = CELL_TYPES[part.cell_type]
    every = part.cells[:, cell.facets].reshape(-1, cell.facet_size)
    every = every[meant[every].all(axis=1)]
    _, first, count = np.unique(np.sort(every, axis=1), axis=0, return_index=True, return_counts=True)
    facets = every[np.sort(first[count == 1])]
    if not len(facets):
        raise InputError(f"{what}: expected facets of the boundary, got {np.count_nonzero(meant)} nodes that hold none between them")
    return replace(part, surfaces={**part.surfaces, name: facets})


def _told(points: FloatArray, where: Where, what: str) -> BoolArray:
    """What the function says of each point (n,); InputError where that is no truth value a point."""
    expected = f"expected a function of coordinates x ({points.shape[1]}, n), as lambda x: numpy.isclose(x[0], 0)"
    told = np.asarray(asked(f"{what}: {expected}", where, np.ascontiguousarray(points.T)))
    if told.shape != (len(points),) or told.dtype != np.bool_:
        raise InputError(
            f"{what}: expected a function of coordinates x ({points.shape[1]}, {len(points)}) that gives {len(points)} truth values, as "
            f"lambda x: numpy.isclose(x[0], 0), got an array of shape {told.shape}, {told.dtype}"
        )
    return told
