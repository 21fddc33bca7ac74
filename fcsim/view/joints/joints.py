"""The facets of joints, followed with the material: their opening does not ask what contact detection still sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.running.folder import Instant
from fcsim.view.scene import read


@dataclass(frozen=True, eq=False)
class Joints:
    """nf facets of k corners (triangles in space, segments in the plane) on one body, each with a point of the body across.

    own     (nf, k) vertices of the surface's facet that a joint's facet is a part of; corner (nf, k, k): weights of its corners there
    across  (nf, k) vertices of the other body's facet, foot (nf, k): weights of the point that faced the centre
    bodies  (nf, 2) numbers of the two bodies
    start   (nf,) distance along the normal at the beginning [m]
    """

    own: IntArray
    corner: FloatArray
    across: IntArray
    foot: FloatArray
    bodies: IntArray
    start: FloatArray

    def __len__(self) -> int:
        return len(self.own)

    def corners(self, x: FloatArray) -> FloatArray:
        """Places (nf, k, 3) of the corners, the vertices at x (nv, 3)."""
        found: FloatArray = np.einsum("fck,fkd->fcd", self.corner, x[self.own])
        return found

    def opening(self, x: FloatArray) -> FloatArray:
        """(nf,) [m] how far the two material points have parted along the other body's normal of now, positive where the joint opened."""
        return distance(self.corners(x).mean(axis=1), x[self.across], self.foot) - self.start


def normals(simplex: FloatArray) -> FloatArray:
    """Outward unit normals (n, 3) of facets (n, k, 3): triangles by the right hand, segments with the body to their left."""
    along = simplex[:, 1] - simplex[:, 0]
    normal = np.column_stack([along[:, 1], -along[:, 0], 0 * along[:, 2]])
    if simplex.shape[1] == 3:
        normal = np.cross(along, simplex[:, 2] - simplex[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None])


def distance(centre: FloatArray, simplex: FloatArray, foot: FloatArray) -> FloatArray:
    """(n,) from points of facets (n, k, 3), given by their weights (n, k), to centres (n, 3), along the facets' normals."""
    found: FloatArray = np.einsum("fd,fd->f", normals(simplex), centre - np.einsum("fk,fkd->fd", foot, simplex))
    return found


def configuration(instant: Instant, factor: float = 1.0) -> FloatArray:
    """Vertices of all bodies (nv, 3) of an instant, blocks before rigid bodies, with their displacement times `factor` (0: reference)."""
    given = [read(path) for path in (instant.blocks, instant.rigid) if path is not None]
    return np.vstack([np.asarray(data.points, dtype=float) + factor * np.asarray(data["displacement"]) for data in given])
