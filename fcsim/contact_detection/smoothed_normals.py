"""Node-to-segment detection along smoothed normals: the master's normal is interpolated between nodal means and continuous.

With the unit mean n_l of the normals that the facets around each master node have there (twisted quadrilaterals: that of the corner), the
foot of a candidate p on a facet of corners x_l is at the shape functions psi_l and the distance g that solve

    sum_l psi_l (x_l + g n_l) = p,    N = sum_l psi_l n_l / |.|,    gap = (p - sum_l psi_l x_l) . N - b

with b how far the surfaces bulge over their facets there (`bulges`), so that N is the gradient of the gap on circles.
Normal and gap are continuous where a candidate passes from facet to facet, and on a mesh of size h of a smooth surface N is off its normal
by O(h^2), where facet normals jump by O(h). Weights stay those of the facets. All edges of a surface are smoothed, sharp ones too:
see `split_at_sharp_edges`.

Source: V. Padmanabhan and T. A. Laursen, A framework for development of surface smoothing procedures in large deformation frictional
contact analysis, Finite Elements in Analysis and Design 37, 2001 (averaged normal fields among other smoothings).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.node_to_segment import ROUND, Configuration, Feet, NodeToSegment
from fcsim.contact_detection.surfaces.facets import mean_normals
from fcsim.contact_detection.surfaces.surface import OPPOSING, SurfacePair
from fcsim.mesh.curves.bulges import heights, highest

Shape = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

_MAX_NEWTON = 25
_STEP = 1e-10  # Newton's error is the square of its last step
_FAR = 3.0  # an iterate is kept within this of the facet's parameters: farther out only "outside" matters


class AlongNormals(NamedTuple):
    """Feet of n points on n facets: weights (n, k) >= 0 of sum 1, the facet's nearest where the foot is outside; unit normal (n, d);
    outside (n,) [m], how far the foot was moved; infinite where there is none."""

    weights: FloatArray
    normal: FloatArray
    outside: FloatArray


def _segment(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shape functions (n, k) and their gradients (n, k, d - 1) in -1 <= z <= 1."""
    return 0.5 * np.concatenate([1 - z, 1 + z], axis=1), np.broadcast_to([[-0.5], [0.5]], (len(z), 2, 1))


def _triangle(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same for a triangle, its barycentric coordinates (1 - z_0 - z_1) / 3, (1 + 2 z_0 - z_1) / 3, ... with 0 in the centre."""
    s, t = z[:, :1], z[:, 1:]
    shape = np.concatenate([1 - s - t, 1 + 2 * s - t, 1 - s + 2 * t], axis=1) / 3
    return shape, np.broadcast_to(np.array([[-1, -1], [2, -1], [-1, 2]]) / 3, (len(z), 3, 2))


def _quadrilateral(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    s, t = z[:, :1] * [-1, 1, 1, -1], z[:, 1:] * [-1, -1, 1, 1]
    return (1 + s) * (1 + t) / 4, np.stack([(1 + t) * [-1, 1, 1, -1], (1 + s) * [-1, -1, 1, 1]], axis=2) / 4


def _nearest_inside(shape: FloatArray) -> FloatArray:
    """Weights of a point in the facet, the same where there is one."""
    if shape.shape[1] == 4:  # (1 + s)/2 and (1 + t)/2 from the bilinear products
        s, t = (np.clip(shape[:, pair].sum(axis=1), 0, 1)[:, None] for pair in ([1, 2], [2, 3]))
        return np.concatenate([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
    inside = np.maximum(shape, 0.0)
    return inside / inside.sum(axis=1)[:, None]


def project_along_normals(points: FloatArray, corners: FloatArray, normals: FloatArray) -> AlongNormals:
    """Solve sum_l psi_l (x_l + g n_l) = p for points (n, d), corners x (n, k, d) and unit nodal normals n (n, k, d), by Newton's method.

    Facets are 2D segments (k = 2), triangles (3) or bilinear quadrilaterals (4).
    """
    n, k, d = corners.shape
    functions: Shape = {2: _segment, 3: _triangle, 4: _quadrilateral}[k]
    z, converged = np.zeros((n, d - 1)), np.zeros(n, dtype=bool)
    mean = normals.mean(axis=1)
    g = np.einsum("nd,nd->n", points - corners.mean(axis=1), mean) / np.maximum(np.einsum("nd,nd->n", mean, mean), 1e-300)
    active = np.arange(n)
    for _ in range(_MAX_NEWTON):
        x, m = corners[active], normals[active]
        shape, gradient = functions(z[active])
        raised = x + g[active, None, None] * m
        residual = np.einsum("nk,nkd->nd", shape, raised) - points[active]
        jacobian = np.concatenate([np.einsum("nki,nkd->ndi", gradient, raised), np.einsum("nk,nkd->nd", shape, m)[:, :, None]], axis=2)
        size = np.einsum("ndi,ndi->ni", jacobian, jacobian)
        regular = np.abs(np.linalg.det(jacobian)) > 1e-9 * np.sqrt(size.prod(axis=1))
        active, residual, jacobian = active[regular], residual[regular], jacobian[regular]  # elsewhere the offset surface folds
        step = np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0]
        moved = np.clip(z[active] - step[:, :-1], -_FAR, _FAR)
        done = np.abs(moved - z[active]).max(axis=1, initial=0.0) <= _STEP
        z[active] = moved
        g[active] -= step[:, -1]
        converged[active] = done
        active = active[~done]
        if not len(active):
            break
    shape = functions(z)[0]
    weights = _nearest_inside(shape)
    away = np.einsum("nk,nkd->nd", weights - shape, corners)
    normal = np.einsum("nk,nkd->nd", weights, normals)
    normal /= np.maximum(np.sqrt(np.einsum("nd,nd->n", normal, normal)), 1e-300)[:, None]
    return AlongNormals(weights, normal, np.where(converged, np.sqrt(np.einsum("nd,nd->n", away, away)), np.inf))


class SmoothedNodeToSegment(NodeToSegment):
    """Contacts of candidate points with master facets along smoothed normals; edges inside a surface need no rules of their own."""

    def __init__(self, pairs: Sequence[SurfacePair], edge_tolerance: float, penetration: float) -> None:
        super().__init__(pairs, edge_tolerance, penetration)
        bulges = [facets.bulge for facets in (self.slaves, self.masters) if facets.bulge is not None]
        self.over_facets = sum(float(highest(bulge).max(initial=0.0)) for bulge in bulges)

    def _once_per_body(self, now: Configuration, candidate: IntArray, facet: IntArray) -> Feet:
        """The foot of each candidate on each master body, sorted by (candidate, body): inside a facet before moved onto its edge."""
        nodal = mean_normals(self.topology, now.master)
        nodal /= np.maximum(np.sqrt(np.einsum("nd,nd->n", nodal, nodal)), 1e-300)[:, None]
        corners, normals, points = now.master.corners[facet], nodal[self.topology.vertex[facet]], now.point[candidate]
        weights, normal, outside = np.zeros(corners.shape[:2]), np.empty_like(points), np.empty(len(points))
        sides = (self.masters.nodes[facet] >= 0).sum(axis=1)
        for k in np.unique(sides):
            those = sides == k
            found = project_along_normals(points[those], corners[those, :k], normals[those, :k])
            weights[those, :k], normal[those], outside[those] = found
        feet = self.at_weights(now, candidate, facet, weights, normal)
        bulge = self._bulge(feet)
        if bulge is not None:
            feet = feet._replace(gap=feet.gap - bulge)
        keep = outside <= (self.edge_tolerance + ROUND) * feet.scale
        keep &= np.einsum("nd,nd->n", now.outward[candidate], normal) < OPPOSING
        keep &= (feet.gap <= self._alert(candidate)) & (feet.gap >= -self.penetration * feet.scale)
        feet, outside = feet.take(keep), outside[keep]
        return feet.take(self._nearest_by_body(now, feet, outside > ROUND * feet.scale))

    @cached_property
    def _bulge_of_candidate(self) -> FloatArray | None:
        """How far (nc,) [m] the slave's surface bulges over its facets at the candidates, None where it is flat; nodes are on it."""
        if self.slaves.bulge is None:
            return None
        on_facet = self._node < 0
        facet = np.where(on_facet, self.candidates.averaging.indices[self.candidates.averaging.indptr[:-1]], 0)
        return np.where(on_facet, heights(self.slaves.bulge, facet, self.candidates.weights), 0.0)

    def _bulge(self, feet: Feet) -> FloatArray | None:
        """How far (n,) [m] both surfaces stand out over their facets; None where they are flat."""
        slave, master = self._bulge_of_candidate, self.masters.bulge
        if slave is None and master is None:
            return None
        own = np.zeros(len(feet.candidate)) if slave is None else slave[feet.candidate]
        return own if master is None else own + heights(master, feet.facet, feet.weights)

    def _truly(self, now: Configuration, feet: Feet) -> Feet:
        """As for facets, whose sides are asked for: by the gaps to these."""
        bulge = self._bulge(feet)
        if bulge is None:
            return super()._truly(now, feet)
        kept = super()._truly(now, feet._replace(gap=feet.gap + bulge))
        over = self._bulge(kept)
        assert over is not None
        return kept._replace(gap=kept.gap - over)

    def _contacts(self, feet: Feet) -> Contacts:
        return replace(super()._contacts(feet), bulge=self._bulge(feet))
