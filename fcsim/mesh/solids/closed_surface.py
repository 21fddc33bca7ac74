"""Closed surfaces of polygons: what solids are given by that were not meshed, checked, and the rigid bodies that they bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import breadth_first_order

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.brief import brief, shown
from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.part import RigidBody
from fcsim.mesh.solids.ears import STRAIGHT, with_corners_on_edges

FLAT = 1e-6
"""A polygon's corners lie in its plane to this part of its size."""
LARGEST = 1e60
"""[m] Extents from which on moments of inertia leave the range of floats."""
SMALLEST_VOLUME = 1e-9
"""Of what a surface bounds, as a share of its size cubed."""


@dataclass(frozen=True, eq=False)
class ClosedSurface:
    """The boundary of a solid, convex or not: points (n, 3) [m], triangles (m, 3) counter-clockwise seen from outside, and the polygons
    that these were, in any orientation.

    Every edge belongs to two triangles that run along it in opposite directions, and the volume within is positive: made by
    `closed_surface`, which checks that.
    """

    name: str
    points: FloatArray
    triangles: IntArray
    polygons: tuple[tuple[int, ...], ...]

    __repr__ = brief

    def moments(self) -> tuple[float, FloatArray, FloatArray]:
        """Volume V [m^3], centroid c (3,) [m] and second moments int (x - c)(x - c)^T dV (3, 3) [m^5].

        Sums over the signed tetrahedra between the triangles and a point within: exact (int x x^T over a simplex of corners 0, a, b, c is
        6 V / 120 (aa^T + bb^T + cc^T + ss^T), s = a + b + c).
        """
        origin = self.points.mean(axis=0)
        corners = (self.points - origin)[self.triangles]
        six = np.linalg.det(corners)
        volume = float(six.sum()) / 6
        total = corners.sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a body without volume: not finite
            arm = np.einsum("f,fd->d", six, total) / np.float64(24 * volume)
        second = (np.einsum("f,fki,fkj->ij", six, corners, corners) + np.einsum("f,fi,fj->ij", six, total, total)) / 120
        return volume, origin + arm, second - volume * np.outer(arm, arm)


def closed_surface(name: str, points: ArrayLike, faces: Sequence[Sequence[int]] | IntArray) -> ClosedSurface:
    """Return the surface of polygons (lists of point numbers, plane, convex or not), cut into triangles and checked.

    Points of the same place, to 1e-9 of the surface's size, become one. Faces that look inwards are turned outwards, all of them or
    those that differ from their neighbours; a surface of several pieces, which may be cavities, must say itself where outside is.
    InputError: numbers that are not finite or not there, faces that are bent, holes, edges of more than two faces, no volume.
    """
    what = f"surface of {name!r}"
    x = np.asarray(points, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3 or not np.isfinite(x).all():
        raise InputError(f"{what}: expected finite points of shape (n, 3), got {x.shape}")
    size = float(np.ptp(x, axis=0).max()) if len(x) else 0.0
    if not size > 0:
        raise InputError(f"{what}: expected points that span a volume, got {len(x)} at one place")
    if not size < LARGEST:
        raise InputError(f"{what}: expected points whose volume is a number, got an extent of {size:.3g} m")
    triangles = np.concatenate([_triangles(what, x, face) for face in faces]) if len(faces) else np.empty((0, 3), dtype=np.int64)
    _, first, place = np.unique(np.round((x - x.min(axis=0)) / (1e-9 * size)), axis=0, return_index=True, return_inverse=True)
    triangles = first[place.ravel()][triangles]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]  # those that have lost an edge
    used, numbers = np.unique(triangles, return_inverse=True)
    corners = first[place.ravel()]
    polygons = tuple(tuple(np.searchsorted(used, corners[np.asarray(face, dtype=np.int64)]).tolist()) for face in faces)
    x, triangles = x[used], numbers.reshape(-1, 3)
    _refuse_open(what, x, triangles)
    triangles = _consistent(what, triangles)
    volume = np.linalg.det((x - x.mean(axis=0))[triangles]).sum() / 6
    if not abs(volume) > SMALLEST_VOLUME * size**3:
        raise InputError(f"{what}: expected a surface around a volume, got {volume:.3g} m^3 within {size:.3g} m")
    return ClosedSurface(name, x, triangles[:, ::-1] if volume < 0 else triangles, polygons)


def rigid_solid(surface: ClosedSurface, *, density: float | None = None, mass: float | None = None) -> RigidBody:
    """Return the homogeneous rigid body within a surface, of `density` [kg/m^3] or of `mass` [kg], with one surface "skin"."""
    given = mass if density is None else density
    if (density is None) == (mass is None) or not (is_number(given) and given > 0):
        raise InputError(f"{surface.name!r}: expected a density > 0 in kg/m^3 or a mass > 0 in kg, got {shown(density)} and {shown(mass)}")
    size = float(np.ptp(surface.points, axis=0).max())
    volume, centre, second = surface.moments()
    if not volume > SMALLEST_VOLUME * size**3:
        raise InputError(
            f"{surface.name!r}: expected points around a volume, got {volume:.3g} m^3 within {size:.3g} m (placed too far away?)"
        )
    rho = density if mass is None else mass / volume
    assert rho is not None
    inertia = rho * (np.trace(second) * np.eye(3) - second)
    return RigidBody(surface.name, rho * volume, 0.5 * (inertia + inertia.T), centre, surface.points, {"skin": surface.triangles})


def _triangles(what: str, x: FloatArray, face: Sequence[int] | IntArray) -> IntArray:
    """A plane polygon as triangles of the same orientation."""
    corners = np.asarray(face)
    if corners.ndim != 1 or len(corners) < 3 or corners.dtype.kind not in "iu" or corners.min() < 0 or corners.max() >= len(x):
        raise InputError(f"{what}: expected faces of at least three point numbers 0 ... {len(x) - 1}, got {face!r}")
    corners = corners.astype(np.int64)
    if len(corners) == 3:
        return corners[None]
    p = x[corners] - x[corners].mean(axis=0)
    normal = 0.5 * np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)  # the polygon's vector area
    area = float(np.linalg.norm(normal))
    size = float(np.abs(p).max())
    if area <= 1e-12 * size**2:
        raise InputError(f"{what}: expected faces with an area, got {face!r} without")
    normal /= area
    off = float(np.abs(p @ normal).max())
    if off > FLAT * size:
        raise InputError(f"{what}: expected plane faces, got {face!r} with corners off it by {off:.3g} m; cut it into triangles")
    edge = np.roll(p, -1, axis=0) - p
    turn = np.cross(edge, np.roll(edge, -1, axis=0)) @ normal
    if (np.abs(turn) <= STRAIGHT * size**2).any():  # a fan would have triangles without area, and earcut leaves such corners out
        cut = with_corners_on_edges(p, normal)
        if cut is not None:
            return corners[cut]
    if (turn >= -1e-12 * size**2).all():
        return np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)
    try:
        import mapbox_earcut
    except ImportError as error:
        raise MissingDependency(f"faces that are not convex need mapbox_earcut ({error}): pip install 'fcsim[masonry]'") from None
    first = p[np.argmax(np.linalg.norm(p, axis=1))]  # not any corner: that of an L may be where the mean of its corners is
    first = first - normal * (first @ normal)
    first /= np.linalg.norm(first)
    flat = np.stack([p @ first, p @ np.cross(normal, first)], axis=1)
    cut = mapbox_earcut.triangulate_float64(flat, np.array([len(corners)], dtype=np.uint32)).astype(np.int64).reshape(-1, 3)
    a, b, c = flat[cut[:, 0]], flat[cut[:, 1]], flat[cut[:, 2]]
    left = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    if not np.isclose(np.abs(left).sum() / 2, area, rtol=1e-6, atol=0.0):
        raise InputError(f"{what}: expected faces that do not cross themselves, got {face!r}")
    if (np.abs(left) <= STRAIGHT * size**2).any():  # corners of different edges in one line, as the shoulders of a T
        rounder = with_corners_on_edges(p, normal)
        if rounder is not None:
            return corners[rounder]
    return corners[np.where(left[:, None] < 0, cut[:, ::-1], cut)]


def _refuse_open(what: str, x: FloatArray, triangles: IntArray) -> None:
    if not len(triangles):
        raise InputError(f"{what}: expected faces, got none")
    edges, uses = np.unique(np.sort(_edges(triangles), axis=1), axis=0, return_counts=True)
    for wrong, expected, found in ((uses == 1, "a closed surface", "of one face alone"), (uses > 2, "edges of two faces", "of more")):
        if wrong.any():
            ends = " and ".join(f"({p[0]:.4g}, {p[1]:.4g}, {p[2]:.4g})" for p in x[edges[wrong][0]])
            raise InputError(f"{what}: expected {expected}, got {int(wrong.sum())} edges {found}, one between {ends}")


def _edges(triangles: IntArray) -> IntArray:
    """Directed edges (3 m, 2); edge k belongs to the triangle k mod m."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _consistent(what: str, triangles: IntArray) -> IntArray:
    """The triangles, each edge run through once in either direction; those of one piece are turned where they differ from the first."""
    edges = _edges(triangles)
    order = np.lexsort(np.sort(edges, axis=1).T)
    one, other = order[::2], order[1::2]
    a, b = one % len(triangles), other % len(triangles)
    same = edges[one, 0] != edges[other, 0]  # the two run along it in opposite directions
    if same.all():
        return triangles
    count = len(triangles)
    graph = sp.coo_array((np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(count, count)).tocsr()
    reached, before = breadth_first_order(graph, 0, directed=False)
    if len(reached) < count:
        raise InputError(f"{what}: expected faces that look outwards, got neighbours that look to different sides in one of several pieces")
    relation = {(int(i), int(j)): bool(s) for i, j, s in zip(np.minimum(a, b), np.maximum(a, b), same, strict=True)}
    kept = np.ones(count, dtype=bool)
    for k in reached[1:]:
        kept[k] = kept[before[k]] == relation[(min(k, before[k]), max(k, before[k]))]
    if (same != (kept[a] == kept[b])).any():
        raise InputError(f"{what}: expected a surface with an inside, got a one-sided one")
    return np.where(kept[:, None], triangles, triangles[:, ::-1])
