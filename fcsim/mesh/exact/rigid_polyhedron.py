"""Rigid convex polyhedra from points: stones, crystals, wedges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

from fcsim.arrays import is_number, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.part import RigidBody

# S = sum over tetrahedra (a, b, c, origin) of det / 120 (sum x x^T + (a + b + c)(a + b + c)^T): the second moments of a simplex
_SECOND = 120.0


def rigid_polyhedron(name: str, points: ArrayLike, density: float) -> RigidBody:
    """Return the convex hull of points (n, 3) [m] as a homogeneous rigid body of `density` [kg/m^3], with one surface "skin" of triangles.

    Mass, centre and inertia are exact, summed over the tetrahedra between the triangles and a point within. InputError where the points
    span no volume.
    """
    given = numbers_of(points)
    if given.ndim != 2 or given.shape[1] != 3 or not np.all(np.isfinite(given)):
        raise InputError(f"polyhedron {name!r}: expected finite points of shape (n, 3), got {given.shape}")
    if not (is_number(density) and density > 0):
        raise InputError(f"polyhedron {name!r}: expected a density > 0 in kg/m^3, got {shown(density)}")
    try:
        hull = ConvexHull(given)
    except (QhullError, ValueError) as error:
        raise InputError(f"polyhedron {name!r}: expected points that span a volume: {str(error).splitlines()[0]}") from None
    used, facets = np.unique(hull.simplices, return_inverse=True)
    x, facets = given[used], facets.reshape(-1, 3)
    origin = x.mean(axis=0)
    corners = (x - origin)[facets]
    volume = np.linalg.det(corners)
    facets = np.where(volume[:, None] < 0, facets[:, ::-1], facets)
    volume = np.abs(volume)  # six times the tetrahedra's
    mass = density * float(volume.sum()) / 6
    total = corners.sum(axis=1)
    centre = density / mass * np.einsum("f,fd->d", volume, total) / 24
    second = np.einsum("f,fki,fkj->ij", volume, corners, corners) + np.einsum("f,fi,fj->ij", volume, total, total)
    S = density * second / _SECOND - mass * np.outer(centre, centre)
    return RigidBody(name, mass, np.trace(S) * np.eye(3) - S, origin + centre, x, {"skin": facets})
