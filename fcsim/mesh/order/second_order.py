"""From a mesh of first order to one of second order: a node in the middle of every edge, quadrilateral face and hexahedron.

The new nodes lie on the straight edges and in the middle of the faces: the body keeps its shape. A `Part` puts those of boundaries that are
evidently curved on the curves (`fcsim.mesh.curves.middles`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES, RAISED


class RaisedMesh(NamedTuple):
    """points (nn, d) [m], those of the first-order mesh first; cells (ncells, k); cell_type; surfaces and nodes as those of `Part`."""

    points: FloatArray
    cells: IntArray
    cell_type: str
    surfaces: dict[str, IntArray]
    nodes: dict[str, IntArray]


def raised(
    points: FloatArray,
    cells: IntArray,
    cell_type: str,
    surfaces: Mapping[str, IntArray],
    what: str,
    nodes: Mapping[str, IntArray] | None = None,
) -> RaisedMesh:
    """Return the mesh of second order on the corners of a first-order one; its nodes keep their numbers, lines (k, 2) get their middles.

    InputError (`what` names the part) for a surface or a line with edges that no cell has.
    """
    first, second = CELL_TYPES[cell_type], CELL_TYPES[RAISED[cell_type]]
    between = {len(corners): np.array([c for c in second.middles if len(c) == len(corners)]) for corners in second.middles}
    known: dict[int, _Middles] = {}
    new_points, new_nodes, count = [points], {}, len(points)
    for size, corners in between.items():
        known[size] = _Middles(np.sort(cells[:, corners].reshape(-1, size), axis=1), count, len(points))
        new_nodes[size] = known[size].of_cells.reshape(len(cells), -1)
        new_points.append(points[known[size].corners].mean(axis=1))
        count += len(known[size].corners)
    place = {size: iter(range(len(corners))) for size, corners in between.items()}
    columns = [new_nodes[len(corners)][:, [next(place[len(corners)])]] for corners in second.middles]
    widened = {}
    for name, facets in surfaces.items():
        ring = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2) if first.dimension == 3 else facets[:, None]
        middles = known[2].find(np.sort(ring.reshape(-1, 2), axis=1), f"{what}, surface {name!r}").reshape(len(facets), -1)
        faces = [known[4].find(np.sort(facets, axis=1), f"{what}, surface {name!r}")[:, None]] if facets.shape[1] == 4 else []
        widened[name] = np.concatenate([facets, middles, *faces], axis=1)
    groups = {}
    for name, group in (nodes or {}).items():
        if group.ndim == 2:
            middle = known[2].find(np.sort(group, axis=1), f"{what}, nodes {name!r}", "edges")
            group = np.concatenate([group, middle[:, None]], axis=1)
        groups[name] = group
    return RaisedMesh(np.concatenate(new_points), np.concatenate([cells, *columns], axis=1), second.name, widened, groups)


class _Middles:
    """Nodes in the middle of sets of corners (n, size), sorted in each row: distinct sets (nm, size), numbered from `first`."""

    def __init__(self, sets: IntArray, first: int, count: int) -> None:
        """count: number of corners there are."""
        self.corners, inverse = np.unique(sets, axis=0, return_inverse=True)
        self.of_cells: IntArray = first + inverse.reshape(-1)
        self._first, self._count = first, count
        self._keys = self._key(self.corners)
        self._order = np.argsort(self._keys)

    def _key(self, sets: IntArray) -> IntArray:
        """A number for each set: its two least and its largest corner tell edges and faces of a mesh apart."""
        key: IntArray = (sets[:, 0] * self._count + sets[:, 1]) * self._count + sets[:, -1]
        return key

    def find(self, sets: IntArray, what: str, kind: str = "facets") -> IntArray:
        """Their nodes (n,) for sets as in `__init__`; InputError for one that no cell has."""
        wanted = self._key(sets)
        at = np.minimum(np.searchsorted(self._keys, wanted, sorter=self._order), len(self._keys) - 1)
        found = self._order[at] if len(self._keys) else at
        wrong = ~(self.corners[found] == sets).all(axis=1)
        if wrong.any():
            raise InputError(f"{what}: expected {kind} of the part's cells, got one with the nodes {sets[np.argmax(wrong)].tolist()}")
        return np.asarray(self._first + found, dtype=np.int64)
