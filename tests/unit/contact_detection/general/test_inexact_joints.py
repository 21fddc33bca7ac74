"""Blocks whose joints close but for micrometres, as files' digits and masons leave them: no contact is invented, none is forgotten."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, Voronoi
from scipy.spatial.transform import Rotation

from fcsim.arrays import FloatArray
from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything
from fcsim.mesh.exact.rigid_polyhedron import rigid_polyhedron


def cells(n: int, size: tuple[float, float, float], astray: float, seed: int) -> list[FloatArray]:
    """Corners of the Voronoi cells of n random points in a unit cube, stretched to a box of that size, each laid astray and turned by up
    to `astray` [m, rad]: mirrored points make the cube's faces faces of cells."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 1, (n, 3))
    mirrored = [np.where(np.arange(3) == axis, 2 * wall - points, points) for axis in range(3) for wall in (0, 1)]
    diagram = Voronoi(np.concatenate([points, *mirrored]))
    corners = [diagram.vertices[diagram.regions[diagram.point_region[k]]] * size for k in range(n)]
    return [Rotation.from_rotvec(rng.uniform(-astray, astray, 3)).apply(cell) + rng.uniform(-astray, astray, 3) for cell in corners]


def least_way_out(first: FloatArray, second: FloatArray) -> float:
    """Of two convex bodies along the normal of a facet of either, by the hulls of their corners."""
    ways = [
        -(other @ hull.equations[:, :3].T + hull.equations[:, 3]).min(axis=0)
        for hull, other in ((ConvexHull(first), second), (ConvexHull(second), first))
    ]
    return float(np.concatenate(ways).min())


def common_ball(first: FloatArray, second: FloatArray) -> float:
    """The radius of the largest ball in both bodies (negative: they are apart), by a linear programme."""
    planes = np.concatenate([ConvexHull(first).equations, ConvexHull(second).equations])
    walls = np.column_stack([planes[:, :3], np.ones(len(planes))])
    return float(linprog([0, 0, 0, -1], A_ub=walls, b_ub=-planes[:, 3], bounds=[(None, None)] * 4).x[3])


@pytest.mark.each_value
@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (3.0, 3.0, 0.3), (0.3, 0.3, 3.0)])
@pytest.mark.parametrize("astray", [1e-5, 1e-4])
def test_contacts_of_cells_laid_astray(size: tuple[float, float, float], astray: float) -> None:
    """No contact is deeper than twice the way that parts its two bodies, every two bodies that overlap have one, and both forces of a
    contact act on one line, but for ten times its depth."""
    points = cells(24, size, astray, seed=22)
    model = build_model([rigid_polyhedron(f"cell {k}", corners, 2000.0) for k, corners in enumerate(points)])
    contacts = Everything(model, 0.5)(model.reference)
    pairs, pair = np.unique(np.sort(contacts.bodies, axis=1), axis=0, return_inverse=True)
    deepest = np.full(len(pairs), np.inf)
    np.minimum.at(deepest, pair, contacts.gap)
    for (a, b), gap in zip(pairs, deepest, strict=True):
        if gap < 0:
            assert -gap <= 2 * max(least_way_out(points[a], points[b]), 0.0) + 1e-5 * max(size)
    known = {(int(a), int(b)) for (a, b), gap in zip(pairs, deepest, strict=True) if gap < astray}
    boxes = [(p.min(axis=0), p.max(axis=0)) for p in points]
    beside = [(a, b) for b in range(24) for a in range(b) if np.all(boxes[a][0] < boxes[b][1]) and np.all(boxes[b][0] < boxes[a][1])]
    overlapping = [(a, b) for a, b in beside if common_ball(points[a], points[b]) > 0.2 * astray]
    assert len(overlapping) > 30 and known.issuperset(overlapping)
    on_slave = np.einsum("ck,ckd->cd", np.maximum(contacts.weights, 0.0), model.reference[contacts.nodes])
    arm = on_slave - contacts.point
    off = np.linalg.norm(arm - contacts.gap[:, None] * contacts.frame[:, 0], axis=1)
    assert np.all(off <= 10 * np.abs(contacts.gap) + 1e-6 * max(size))
