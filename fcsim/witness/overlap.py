"""The true overlap of bodies at given positions, from their skins alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.witness._overlap_kernels import common_points, meeting_boxes, overlaps
from fcsim.witness.exact_overlap import exact_overlaps
from fcsim.witness.folding import own_overlaps
from fcsim.witness.skin import Skins

_GRID = 6


class PairOverlaps(NamedTuple):
    """Pairs of bodies (n, 2) that overlap, the depth (n,) [m] of the deepest point of one in the other, and where it is (n, d) [m]."""

    bodies: IntArray
    depth: FloatArray
    point: FloatArray


@dataclass(frozen=True)
class Overlap:
    """The largest overlap of two bodies: depth [m] of the deepest point of one's skin below the other's, 0 where there is none.

    share: the depth relative to the smaller body's smallest extent; bodies: their names; point (d,) [m]: where; beyond: more than borne
    """

    depth: float = 0.0
    share: float = 0.0
    bodies: tuple[str, str] | None = None
    point: tuple[float, ...] = ()
    beyond: bool = False

    @property
    def between(self) -> str:
        """Where, in one text: the two bodies and the point; empty where there is none."""
        return "" if self.bodies is None else f"{self.bodies[0]} and {self.bodies[1]} at ({', '.join(f'{c:.6g}' for c in self.point)})"


def measure(skins: Skins, positions: FloatArray, least: float, *, thorough: bool = False) -> PairOverlaps:
    """Return the overlaps deeper than `least`, relative to the smaller body's size, at the positions (n_nodes, d) [m].

    The overlap of a pair is the depth of the deepest point of either skin, its vertices and the pieces of its edges within the other
    body, below the other's skin: exact for vertices; along an edge the highest of five samples, followed uphill. Where a skin is deepest
    within a facet, or a body is mostly within another, it is less than the depth of the deepest point, never more. `thorough` looks also
    at points where the bodies' boxes meet, which finds coincident bodies and bars that cross at one height.
    """
    d = skins.dimension
    forest = skins.forest(positions)
    low, high = forest.low, forest.high
    bodies = np.flatnonzero(skins.roots >= 0)
    box_low, box_high = np.full((len(skins.roots), d), np.inf), np.full((len(skins.roots), d), -np.inf)
    box_low[bodies], box_high[bodies] = low[skins.roots[bodies], :d], high[skins.roots[bodies], :d]
    axes = np.argsort(-np.var(box_low[bodies], axis=0)) if len(bodies) else np.arange(d)  # sweep along the axis that tells most apart
    order = bodies[np.argsort(box_low[bodies, axes[0]], kind="stable")]
    first, second = meeting_boxes(order, np.ascontiguousarray(box_low[:, axes]), np.ascontiguousarray(box_high[:, axes]), d)
    floor = least * np.minimum(skins.size[first], skins.size[second])
    moves = (skins.movable[first] | skins.movable[second]) & measured(skins, first, second)
    meet = moves & ((np.minimum(box_high[first], box_high[second]) - np.maximum(box_low[first], box_low[second])).min(axis=1) > floor)
    first, second, floor = first[meet], second[meet], floor[meet]
    skin = (skins.vertices, skins.first_vertex, skins.edges, skins.first_edge)
    depth, place = overlaps(first, second, floor, forest, *skin, box_low, box_high, d)
    if thorough:
        inner, at = common_points(first, second, np.maximum(floor, depth), _GRID, forest, box_low, box_high, d)
        deeper = inner > depth
        depth, place = np.where(deeper, inner, depth), np.where(deeper[:, None], at, place)
    found = depth > 0
    pairs, depth, place = np.stack([first, second], axis=1)[found], depth[found], place[found, :d]
    if len(skins.folding.bodies):
        own = own_overlaps(skins.folding, least * skins.size[skins.folding.bodies], forest, skins.modulus, d)
        pairs, depth, place = (np.concatenate([a, b]) for a, b in zip((pairs, depth, place), own, strict=True))
    if len(skins.exact.body):
        closed = np.flatnonzero(np.diff(skins.first_vertex))
        owner = np.repeat(closed, np.diff(skins.first_vertex)[closed])
        more = exact_overlaps(skins.exact, positions, forest, bodies, (forest.points[skins.vertices, :d], owner))
        deep = more[1] > least * np.minimum(skins.size[more[0][:, 0]], skins.size[more[0][:, 1]])
        deep &= skins.movable[more[0]].any(axis=1) & measured(skins, *more[0].T)
        pairs, depth, place = (np.concatenate([a, b[deep]]) for a, b in zip((pairs, depth, place), more, strict=True))
    return PairOverlaps(pairs, depth, place)


def measured(skins: Skins, first: IntArray, second: IntArray) -> BoolArray:
    """Which pairs of bodies (n,) are none of those that are left out."""
    return ~np.isin(np.minimum(first, second) * len(skins.roots) + np.maximum(first, second), skins.without)
