"""Rigid bodies of exact shape: spheres (2D: disks), capsules, cylinders and planes, without facets.

A shape is a core and a radius around it: a sphere a point, a capsule a segment, a cylinder a segment with flat ends, a plane a half-space.
Its body has d + 1 points, the centre and one along each axis, by which any point of it moves: a point p with the affine weights w
(w sums to 1, sum w_i x_i = p) has the velocity sum w_i v_i. Detection and the witness take the shape itself, pictures a mesh of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, IntArray

ShapeKind = Literal["sphere", "capsule", "cylinder", "plane"]


@dataclass(frozen=True, eq=False)
class ExactShape:
    """kind; radius [m] (of a plane: half the size that pictures show); length [m] of the core; axis (d,): unit vector along the core, or a
    plane's normal out of the solid, in the reference configuration; the core is centred on the body's centre."""

    kind: ShapeKind
    radius: float
    length: float
    axis: FloatArray

    @property
    def size(self) -> float:
        """The smallest extent [m]; infinite for a plane."""
        if self.kind == "plane":
            return np.inf
        return min(2 * self.radius, self.length) if self.kind == "cylinder" else 2 * self.radius

    def display(self, around: int = 24) -> tuple[FloatArray, IntArray]:
        """Points (n, d) [m] about the centre and facets (nf, k), -1 = none, of a mesh of the shape, for pictures alone.

        around: facets around a circle, a multiple of 4.
        """
        return (
            _plane_display(self)
            if self.kind == "plane"
            else _round_display(self, around)
            if len(self.axis) == 3
            else _flat_display(self, around)
        )


def endless(body: object) -> bool:
    """Whether a body is a plane, which has no extent: its points are those of a picture of any size."""
    return getattr(getattr(body, "shape", None), "kind", None) == "plane"


def across(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors (n, 3) orthogonal to unit vectors (n, 3) and to each other, right-handed with them."""
    other = np.where(np.abs(axis[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(axis, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(axis, first)


def _plane_display(shape: ExactShape) -> tuple[FloatArray, IntArray]:
    r, n = shape.radius, shape.axis
    if len(n) == 2:
        t = r * np.array([-n[1], n[0]])
        return np.stack([t, -t]), np.array([[1, 0]])
    a, b = (r * v[0] for v in across(n[None]))
    return np.stack([-a - b, a - b, a + b, b - a]), np.array([[0, 1, 2, 3]])


def _flat_display(shape: ExactShape, around: int) -> tuple[FloatArray, IntArray]:
    """The outline of a disk or a stadium."""
    n = 2 * around
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    turn = np.stack([shape.axis, [-shape.axis[1], shape.axis[0]]])
    local = shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    local[:, 0] += np.sign(np.cos(angle)) * shape.length / 2
    return local @ turn, np.stack([np.arange(n), (np.arange(n) + 1) % n], axis=1)


def _round_display(shape: ExactShape, around: int) -> tuple[FloatArray, IntArray]:
    """Rings around the axis: of a ball or capsule along its meridian, of a cylinder its two rims; closed at both ends by one point."""
    r, half = shape.radius, shape.length / 2
    if shape.kind == "cylinder":
        ring = np.array([(r, -half), (r, half)])
        ends = -half, half
    else:
        lower = np.linspace(-np.pi / 2, 0, around // 4 + 1)[1:]
        ring = np.concatenate([np.stack([r * np.cos(lower), r * np.sin(lower) - half], axis=1)])
        upper = ring[::-1] * (1, -1)
        ring = np.concatenate([ring, upper if half else upper[1:]])
        ends = -half - r, half + r
    a, b = (v[0] for v in across(shape.axis[None]))
    angle = 2 * np.pi * np.arange(around) / around
    out = np.cos(angle)[:, None] * a + np.sin(angle)[:, None] * b
    points = (ring[:, 0, None, None] * out + ring[:, 1, None, None] * shape.axis).reshape(-1, 3)
    n, k = len(points), np.arange(around)
    after = (k + 1) % around
    rows = around * np.arange(len(ring) - 1)[:, None]
    sides = np.stack([rows + k, rows + after, rows + around + after, rows + around + k], axis=-1).reshape(-1, 4)
    top = n - around
    bottom_fan = np.stack([after, k, np.full(around, n), np.full(around, -1)], axis=1)
    top_fan = np.stack([top + k, top + after, np.full(around, n + 1), np.full(around, -1)], axis=1)
    return np.concatenate([points, np.outer(ends, shape.axis)]), np.concatenate([sides, bottom_fan, top_fan])
