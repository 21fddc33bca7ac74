"""Rigid plane bodies from polygons."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.part import RigidBody
from fcsim.mesh.solids.outline import outline_of


def rigid_polygon(
    name: str,
    points: ArrayLike,
    *,
    density: float | None = None,
    mass: float | None = None,
    thickness: float = 1.0,
    holes: Sequence[ArrayLike] = (),
) -> RigidBody:
    """Return the homogeneous plate within a closed polygon of corners (n, 2) [m], convex or not, and around its holes, polygons of the
    same kind; with one surface "skin".

    Of `density` [kg/m^3] times `thickness` [m], or of `mass` [kg]. Area, centroid and polar moment by Green's theorem: sums over the
    sides of c = x_k y_k+1 - x_k+1 y_k times polynomials. InputError: see `outline_of`.
    """
    what, loops = f"polygon {name!r}", outline_of(name, points, holes)
    given = mass if density is None else density
    if (density is None) == (mass is None) or not (is_number(given) and given > 0):
        raise InputError(f"{what}: expected a density > 0 in kg/m^3 or a mass > 0 in kg, got {shown(density)} and {shown(mass)}")
    if not (is_number(thickness) and thickness > 0):
        raise InputError(f"{what}: expected a thickness > 0 in m, got {shown(thickness)}")
    p, origin = np.concatenate(loops), loops[0].mean(axis=0)
    first = np.cumsum([0, *map(len, loops)])
    after = np.concatenate([np.roll(np.arange(a, b), -1) for a, b in pairwise(first)])
    x, y = (p - origin).T
    xn, yn = x[after], y[after]
    c = x * yn - xn * y
    area = c.sum() / 2
    arm = np.array([((x + xn) * c).sum(), ((y + yn) * c).sum()]) / (6 * area)
    polar = (c * (x * x + x * xn + xn * xn + y * y + y * yn + yn * yn)).sum() / 12 - area * arm @ arm
    if mass is None:
        assert density is not None
        mass = density * thickness * area
    sides = np.stack([np.arange(len(p)), after], axis=1)
    return RigidBody(name, float(mass), np.array([[mass * polar / area]]), origin + arm, p, {"skin": sides})
