"""The largest multiplier that contact forces bear, by a linear program of its own (static theorem), in space.

Built of convex pieces alone, with nothing of fcsim: where faces of two stones lie upon each other, forces at the corners of what they
share, each a sum of `WAYS` forces n + m t_k >= 0. m = mu: within Coulomb's cone, a bound from below; m = mu / cos(pi / WAYS): around it,
from above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_array
from scipy.spatial import ConvexHull, Delaunay

from tests.analytic.masonry_in_space.stones import G, Solid, Stone, Structure

WAYS = 32
NEAR = 1e-7  # [m] faces that lie upon each other


def volume_and_centroid(stone: Stone) -> tuple[float, np.ndarray]:
    volumes, moments = [], []
    for piece in stone.pieces:
        corners = piece.corners[Delaunay(piece.corners).simplices]
        six = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        volumes.append(float(six.sum()) / 6)
        moments.append((six[:, None] * corners.mean(axis=1)).sum(axis=0) / 6)
        assert math.isclose(volumes[-1], ConvexHull(piece.corners).volume, rel_tol=1e-9)
    return sum(volumes), np.sum(moments, axis=0) / sum(volumes)


def faces_of(solid: Solid) -> list[tuple[np.ndarray, np.ndarray]]:
    """Corners and outward normal of every face."""
    middle, found = solid.corners.mean(axis=0), []
    for face in solid.faces:
        p = solid.corners[list(face)]
        normal = np.cross(p[1] - p[0], p[2] - p[1])
        normal /= np.linalg.norm(normal)
        outwards = normal @ (p[0] - middle) > 0
        found.append((p if outwards else p[::-1], normal if outwards else -normal))
    return found


def shared(first: np.ndarray, normal: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Corners of what two convex polygons in one plane have in common (I. E. Sutherland, G. W. Hodgman, Commun. ACM 17, 1974)."""
    left = list(second)
    for k, a in enumerate(first):
        inwards = np.cross(normal, first[(k + 1) % len(first)] - a)
        inwards /= np.linalg.norm(inwards)
        kept: list[np.ndarray] = []
        for j, p in enumerate(left):
            q = left[(j + 1) % len(left)]
            dp, dq = inwards @ (p - a), inwards @ (q - a)
            if dp >= 0:
                kept.append(p)
            if dp * dq < 0:
                kept.append(p + (q - p) * dp / (dp - dq))
        left = kept
        if not left:
            return np.empty((0, 3))
    points = np.array(left)
    area = 0.5 * np.linalg.norm(np.cross(points - points[0], np.roll(points - points[0], -1, axis=0)).sum(axis=0))
    return points if area > NEAR else np.empty((0, 3))


def joints(structure: Structure) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    """(stone, other, point, normal into the first) of every corner of every patch."""
    found = []
    stones = structure.stones
    faces = [[face for piece in stone.pieces for face in faces_of(piece)] for stone in stones]
    for i in range(len(stones)):
        for j in range(i + 1, len(stones)):
            if not (stones[i].density or stones[j].density):
                continue
            a, b = stones[i].surface.corners, stones[j].surface.corners
            if (a.min(axis=0) > b.max(axis=0) + NEAR).any() or (b.min(axis=0) > a.max(axis=0) + NEAR).any():
                continue
            for p, n in faces[i]:
                for q, m in faces[j]:
                    if n @ m < -1 + 1e-9 and abs((q - p[0]) @ n).max() < NEAR:
                        found += [(i, j, point, -n) for point in shared(p, n, q)]
    return found


def largest_multiplier(structure: Structure, direction: Sequence[float], mu: float) -> float | None:
    """The largest lambda at which forces n + mu t_k bear the weight and lambda of it along `direction`; None: not even the weight."""
    stones = structure.stones
    known = [volume_and_centroid(stone) for stone in stones]
    middle, count = np.array([c for _, c in known]), len(stones)
    weight = np.array([v * stone.density * G for (v, _), stone in zip(known, stones, strict=True)])
    unit = weight.max()
    dead, live = np.zeros((count, 6)), np.zeros((count, 6))
    dead[:, 2], live[:, :3] = -weight / unit, weight[:, None] / unit * np.asarray(direction, dtype=float)
    points = joints(structure)
    first, second = np.array([p[0] for p in points]), np.array([p[1] for p in points])
    at, normal = np.array([p[2] for p in points]), np.array([p[3] for p in points])
    aside = np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
    t1 = np.cross(normal, aside)
    t1 /= np.linalg.norm(t1, axis=1)[:, None]
    t2 = np.cross(normal, t1)
    angles = 2 * math.pi * np.arange(WAYS) / WAYS
    ways = normal[:, None] + mu * (np.cos(angles)[None, :, None] * t1[:, None] + np.sin(angles)[None, :, None] * t2[:, None])
    values, rows, columns = [], [], []
    number = np.arange(len(points) * WAYS).reshape(len(points), WAYS)
    for body, sign in ((first, 1.0), (second, -1.0)):
        arm = (at - middle[body])[:, None]
        wrench = sign * np.concatenate([ways, np.cross(np.broadcast_to(arm, ways.shape), ways)], axis=2)
        rows.append((6 * body[:, None, None] + np.arange(6)).repeat(WAYS, axis=1).ravel())
        columns.append(np.broadcast_to(number[:, :, None], wrench.shape).ravel())
        values.append(wrench.ravel())
    columns.append(np.full(6 * count, number.size))
    rows.append(np.arange(6 * count))
    values.append(live.ravel())
    free = np.repeat([stone.density > 0 for stone in stones], 6)
    matrix = csc_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(6 * count, number.size + 1))[free]
    cost = np.zeros(number.size + 1)
    cost[-1] = -1.0
    found = linprog(cost, A_eq=matrix, b_eq=-dead.ravel()[free], bounds=(0, None), method="highs-ds")
    if found.status == 2:
        return None
    if found.status == 3:
        return math.inf
    assert found.status == 0, found.message
    return float(-found.fun)


def bounds(structure: Structure, direction: Sequence[float]) -> tuple[float, float] | None:
    """The largest multiplier within Coulomb's cones lies between these; None: the structure falls by itself whatever the approximation."""
    outer = largest_multiplier(structure, direction, structure.mu / math.cos(math.pi / WAYS))
    if outer is None:
        return None
    inner = largest_multiplier(structure, direction, structure.mu)
    return (0.0 if inner is None else inner), outer
