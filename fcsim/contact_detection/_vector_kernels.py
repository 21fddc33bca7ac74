"""Vectors in space as three numbers, compiled: loops over contacts that make no arrays."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray

Vector = tuple[float, float, float]


@njit(cache=True)
def at(points: FloatArray, k: int) -> Vector:
    """Row k of points (n, 3)."""
    return points[k, 0], points[k, 1], points[k, 2]


@njit(cache=True)
def dot(a: Vector | FloatArray, b: Vector | FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(cache=True)
def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True)
def times(c: float, a: Vector) -> Vector:
    return c * a[0], c * a[1], c * a[2]


@njit(cache=True)
def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def length(a: Vector) -> float:
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@njit(cache=True, error_model="numpy")
def unit(a: Vector) -> Vector:
    """NaN for a vector of no length."""
    return times(1.0 / length(a), a)
