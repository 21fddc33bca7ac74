"""Rigid plane bodies from polygons."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import is_number, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.part import RigidBody


def rigid_polygon(
    name: str, points: ArrayLike, *, density: float | None = None, mass: float | None = None, thickness: float = 1.0
) -> RigidBody:
    """Return the homogeneous plate within a closed polygon of corners (n, 2) [m], convex or not, with one surface "skin".

    Of `density` [kg/m^3] times `thickness` [m], or of `mass` [kg]. Area, centroid and polar moment by Green's theorem: sums over the
    sides of c = x_k y_k+1 - x_k+1 y_k times polynomials. InputError for polygons without an area, with a corner twice, or that
    cross themselves.
    """
    what = f"polygon {name!r}"
    p = numbers_of(points)
    if p.ndim != 2 or p.shape[1] != 2 or len(p) < 3 or not np.isfinite(p).all():
        raise InputError(f"{what}: expected at least three finite corners of shape (n, 2), got shape {p.shape}")
    if (same := np.flatnonzero((p == np.roll(p, -1, axis=0)).all(axis=1))).size:
        again = (int(same[0]) + 1) % len(p)
        raise InputError(
            f"{what}: expected corners that differ from the next one (the last is joined to the first by itself), got corner {again} "
            f"where corner {int(same[0])} is, at {tuple(p[again].tolist())}"
        )
    given = mass if density is None else density
    if (density is None) == (mass is None) or not (is_number(given) and given > 0):
        raise InputError(f"{what}: expected a density > 0 in kg/m^3 or a mass > 0 in kg, got {shown(density)} and {shown(mass)}")
    if not (is_number(thickness) and thickness > 0):
        raise InputError(f"{what}: expected a thickness > 0 in m, got {shown(thickness)}")
    origin = p.mean(axis=0)
    x, y = (p - origin).T
    xn, yn = np.roll(x, -1), np.roll(y, -1)
    c = x * yn - xn * y
    area = c.sum() / 2
    if not abs(area) > 1e-12 * np.ptp(p, axis=0).max() ** 2:
        raise InputError(f"{what}: expected corners around an area, got {area:.3g} m^2")
    if area < 0:
        return rigid_polygon(name, p[::-1], density=density, mass=mass, thickness=thickness)
    if _crosses_itself(p):
        raise InputError(f"{what}: expected sides that do not cross each other")
    arm = np.array([((x + xn) * c).sum(), ((y + yn) * c).sum()]) / (6 * area)
    polar = (c * (x * x + x * xn + xn * xn + y * y + y * yn + yn * yn)).sum() / 12 - area * arm @ arm
    if mass is None:
        assert density is not None
        mass = density * thickness * area
    sides = np.stack([np.arange(len(p)), np.roll(np.arange(len(p)), -1)], axis=1)
    return RigidBody(name, float(mass), np.array([[mass * polar / area]]), origin + arm, p, {"skin": sides})


def _crosses_itself(p: np.ndarray) -> bool:
    """Whether two sides that are no neighbours cross."""
    a, b = p, np.roll(p, -1, axis=0)

    def side(i: int) -> np.ndarray:
        along = b[i] - a[i]
        return along[0] * (p[:, 1] - a[i, 1]) - along[1] * (p[:, 0] - a[i, 0])

    signs = np.array([np.sign(side(i)) for i in range(len(p))])  # (side, corner)
    after = np.roll(signs, -1, axis=1)
    splits = signs * after < 0  # side i's line passes between the ends of side j
    return bool((splits & splits.T).any())
