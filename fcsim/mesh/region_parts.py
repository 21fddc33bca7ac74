"""The regions of a part of several materials, each as a part of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from fcsim.arrays import IntArray
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.part import Part


@dataclass(frozen=True, eq=False)
class RegionPart:
    """The cells of one region as a part of one material, with the numbers of its nodes and of its cells in the whole."""

    part: Part
    nodes: IntArray
    cells: IntArray


_MADE: WeakKeyDictionary[Part, tuple[RegionPart, ...]] = WeakKeyDictionary()


def region_parts(part: Part) -> tuple[RegionPart, ...]:
    """A part whose material is a `ByRegion`, region by region; made once, as long as the part lives."""
    assert isinstance(part.material, ByRegion)
    if part in _MADE:
        return _MADE[part]
    found = []
    for name, material in part.material.materials.items():
        cells = part.regions[name]
        nodes, own = np.unique(part.cells[cells], return_inverse=True)
        piece = replace(
            part, points=part.points[nodes], cells=own.reshape(len(cells), -1), surfaces={}, material=material, regions={}, nodes={}
        )
        found.append(RegionPart(piece, nodes, cells))
    return _MADE.setdefault(part, tuple(found))
