"""What each link asks of its points in a configuration: rows dir . (sum_k c_k p_k) - length = 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linkage.links import Ball, Cable, Control, Hinge, Rod, Slider, SpringDamper

Jointed = Ball | Hinge | Slider | Rod | Cable | SpringDamper | Control


class Asked(NamedTuple):
    """Of one link: coefficients (k, points), direction (k, d), unit vectors, and length (k,) [m]; gap = direction . (coefficients @ points)
    - length. A row's derivative by the points is coefficient times direction wherever the gap is zero."""

    coefficients: FloatArray
    direction: FloatArray
    length: FloatArray


def asked(link: Jointed, points: FloatArray, rest: float) -> Asked:
    """The rows of a link whose points stand at `points` (k, d): for each of its places the first body's point, then the second's.

    rest [m]: the length of a rod, cable or spring, of a control where its points' mean begins.
    """
    if isinstance(link, Ball):
        return _together(np.eye(points.shape[1]), 2, 0)
    if isinstance(link, Hinge):
        at = _together(np.eye(3), 4, 0)
        coefficients = np.zeros((5, 4))
        coefficients[:3], coefficients[3:] = at.coefficients, -_beside(points, 3, 2)
        return Asked(coefficients, np.concatenate([at.direction, _across(points[2] - points[0])]), np.zeros(5))
    if isinstance(link, Slider):
        return _on_line(link, points)
    if isinstance(link, Control):
        weights, along = np.array([weight for _, _, weight in link.points]), np.asarray(link.direction, dtype=np.float64)
        return Asked((weights / weights.sum())[None], (along / np.linalg.norm(along))[None], np.array([rest]))
    arm = points[0] - points[-1]
    length = float(np.linalg.norm(arm))
    direction = arm / length if length > 0 else np.eye(len(arm))[0]
    coefficients = np.zeros((1, len(points)))
    coefficients[0, 0], coefficients[0, -1] = 1, -1
    return Asked(coefficients, direction[None], np.array([rest]))


def _together(directions: FloatArray, count: int, begin: int) -> Asked:
    """Point `begin` on point begin + 1, along the directions (k, d)."""
    coefficients = np.zeros((len(directions), count))
    coefficients[:, begin], coefficients[:, begin + 1] = 1, -1
    return Asked(coefficients, directions, np.zeros(len(directions)))


def _beside(points: FloatArray, point: int, count: int) -> FloatArray:
    """Coefficients (count, points) of the way from the line through points 0 and 2 to a point, across it: where these stand farther apart,
    as places on deformable bodies do, a force between the point and number 2 alone would have a moment."""
    along = points[2] - points[0]
    s = float((points[point] - points[0]) @ along / (along @ along))
    row = np.zeros((count, len(points)))
    row[:, point], row[:, 0], row[:, 2] = 1, -(1 - s), -s
    return row


def _on_line(link: Slider, points: FloatArray) -> Asked:
    """Points 1 and 3 (of the second body) on the line through 0 and 2 (of the first); beside: 4 (first), 5 (second)."""
    along = points[2] - points[0]
    across = _across(along)
    coefficients, directions = [_beside(points, point, len(across)) for point in (1, 3)], [across, across]
    if link.beside is not None:
        arm = points[4] - points[0]
        normal = np.cross(along, arm)
        s = float((points[5] - points[0]) @ along / (along @ along))
        q = float((points[5] - points[0] - s * along) @ arm / (arm @ arm - (arm @ along) ** 2 / (along @ along)))
        s -= q * float(arm @ along / (along @ along))
        row = np.zeros((1, len(points)))
        row[0, 5], row[0, 4], row[0, 2], row[0, 0] = 1, -q, -s, -(1 - s - q)  # the place of 5 in the first body's plane
        coefficients.append(row)
        directions.append(normal[None] / np.linalg.norm(normal))
    return Asked(np.concatenate(coefficients), np.concatenate(directions), np.zeros(sum(map(len, directions))))


def _across(along: FloatArray) -> FloatArray:
    """Unit vectors (d - 1, d) across a vector (d,), the same for the same vector."""
    n = along / np.linalg.norm(along)
    if len(n) == 2:
        return np.array([[-n[1], n[0]]])
    least = np.eye(3)[int(np.argmin(np.abs(n)))]
    first = np.cross(n, least)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(n, first)])
