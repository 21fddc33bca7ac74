"""The overlap of bodies of exact shape, with each other and with meshed bodies: distances of points and segments, in closed form.

A sphere or capsule overlaps another body by its radius less the signed distance of its core to that body. Between two cores the distance
is in closed form; of a core to a plane too; of a core to a skin it is exact at points, and along a capsule's core the least at points no
farther apart than its radius: nothing passes between them. So is that of the largest capsule within a cylinder; its rims are looked at
elsewhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.mesh.part import RigidBody
from fcsim.witness._distance_kernels import Forest
from fcsim.witness._overlap_kernels import depth_of_balls
from fcsim.witness.points_in_solids import points_in_cylinders, points_in_planes

LEAST, MOST = 9, 257
"""Points along a core: a rod of 128 times its thickness is looked at without a gap."""


class ExactBodies(NamedTuple):
    """Bodies (n,) of exact shape: their kinds; first (n,): the first of their d + 1 nodes; radius, half the length, arm of the nodes
    (n,) [m]; axis (n, d) in the reference configuration."""

    body: IntArray
    kind: tuple[str, ...]
    first: IntArray
    radius: FloatArray
    half: FloatArray
    axis: FloatArray
    arm: FloatArray

    def of(self, *kinds: str) -> IntArray:
        return np.flatnonzero([kind in kinds for kind in self.kind])

    def placed(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Centres and directions (n, d) at node positions."""
        d = positions.shape[1]
        nodes = positions[self.first[:, None] + np.arange(d + 1)]
        arms = (nodes[:, 1:] - nodes[:, :1]) / self.arm[:, None, None]
        return nodes[:, 0], np.einsum("nji,nj->ni", arms, self.axis)


def exact_bodies(model: Model) -> ExactBodies:
    """Return the bodies of exact shape of a model."""
    found = [(k, body.shape) for k, body in enumerate(model.bodies) if isinstance(body, RigidBody) and body.shape is not None]
    number = np.array([k for k, _ in found], dtype=np.int64)
    shapes = [shape for _, shape in found]
    return ExactBodies(
        number,
        tuple(shape.kind for shape in shapes),
        model.node_offset[number],
        np.array([shape.radius for shape in shapes]),
        np.array([shape.length / 2 for shape in shapes]),
        np.array([shape.axis for shape in shapes]).reshape(-1, model.dimension),
        np.array([shape.radius for shape in shapes]),
    )


def exact_overlaps(
    exact: ExactBodies, positions: FloatArray, forest: Forest, meshed: IntArray, vertices: tuple[FloatArray, IntArray]
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Pairs of bodies (n, 2), overlap (n,) [m] and place (n, d) of all that overlap; meshed: bodies with a tree in the forest; vertices:
    points (nv, d) of their skins and the bodies (nv,) that these belong to."""
    centre, along = exact.placed(positions)
    found = [_cores(exact, centre, along), _planes(exact, centre, along), _skins(exact, centre, along, forest, meshed)]
    planes, cylinders = exact.of("plane"), exact.of("cylinder")
    found += points_in_planes(*vertices, exact.body[planes], centre[planes], along[planes])
    solids = (x[cylinders] for x in (centre, along, exact.radius, exact.half))
    found += points_in_cylinders(*vertices, exact.body[cylinders], *solids)
    bodies, depth, place = (np.concatenate(parts) for parts in zip(*found, strict=True))
    deep = depth > 0
    return np.sort(bodies[deep], axis=1), depth[deep], place[deep]


def _cores(exact: ExactBodies, centre: FloatArray, along: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Spheres and capsules with each other: radii less the distance of two segments (Ericson 5.1.9, for all pairs at once)."""
    round_ = exact.of("sphere", "capsule")
    if len(round_) < 2:
        return _none(centre.shape[1])
    reach = exact.radius[round_] + exact.half[round_]
    i, j = cKDTree(centre[round_]).query_pairs(2 * float(reach.max()), output_type="ndarray").reshape(-1, 2).T
    a, b = round_[i], round_[j]
    u, v, apart = along[a], along[b], centre[a] - centre[b]
    ha, hb = exact.half[a], exact.half[b]
    cosine, alpha, beta = (np.einsum("nd,nd->n", *pair) for pair in ((u, v), (apart, u), (apart, v)))
    square = 1 - cosine**2
    s = np.where(square > 1e-12, (cosine * beta - alpha) / np.maximum(square, 1e-12), 0.0)
    s = np.clip(s, -ha, ha)
    t = np.clip(beta + cosine * s, -hb, hb)
    s = np.clip(cosine * t - alpha, -ha, ha)
    p, q = centre[a] + s[:, None] * u, centre[b] + t[:, None] * v
    depth = exact.radius[a] + exact.radius[b] - np.linalg.norm(p - q, axis=1)
    return np.stack([exact.body[a], exact.body[b]], axis=1), depth, (p + q) / 2


def _planes(exact: ExactBodies, centre: FloatArray, along: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Spheres, capsules and cylinders below planes: how far their lowest point is."""
    a, b = (x.ravel() for x in np.meshgrid(exact.of("sphere", "capsule", "cylinder"), exact.of("plane"), indexing="ij"))
    if not len(a):
        return _none(centre.shape[1])
    normal = along[b]
    tilt = np.einsum("nd,nd->n", along[a], normal)
    flat = np.array([kind == "cylinder" for kind in exact.kind])[a]
    below = np.abs(tilt) * exact.half[a] + exact.radius[a] * np.where(flat, np.sqrt(np.maximum(1 - tilt**2, 0)), 1.0)
    height = np.einsum("nd,nd->n", centre[a] - centre[b], normal)
    lowest = centre[a] - np.sign(tilt)[:, None] * exact.half[a][:, None] * along[a]
    return np.stack([exact.body[a], exact.body[b]], axis=1), below - height, lowest


def _skins(
    exact: ExactBodies, centre: FloatArray, along: FloatArray, forest: Forest, meshed: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Spheres, capsules and the balls within cylinders in meshed bodies."""
    d = centre.shape[1]
    round_ = exact.of("sphere", "capsule", "cylinder")
    if not len(round_) or not len(meshed):
        return _none(d)
    cylinder = np.array(exact.kind)[round_] == "cylinder"
    radius = np.where(cylinder, np.minimum(exact.radius[round_], exact.half[round_]), exact.radius[round_])
    half = np.where(cylinder, exact.half[round_] - radius, exact.half[round_])
    count = np.where(half > 0, np.clip(np.ceil(2 * half / radius).astype(int) + 1, LEAST, MOST), 1)
    along_core = np.concatenate([np.linspace(-1, 1, n) * h if n > 1 else np.zeros(1) for n, h in zip(count, half, strict=True)])
    owner = np.repeat(round_, count)
    points = centre[owner] + along_core[:, None] * along[owner]
    body, other, depth, place = depth_of_balls(np.pad(points, ((0, 0), (0, 3 - d))), np.repeat(radius, count), forest, meshed, d)
    pairs = np.stack([exact.body[owner[body]], other], axis=1)
    order = np.lexsort((-depth, *pairs.T))  # of each pair the deepest
    first = order[np.any(np.diff(pairs[order], axis=0, prepend=-1) != 0, axis=1)]
    return pairs[first], depth[first], points[place[first]]


def _none(d: int) -> tuple[IntArray, FloatArray, FloatArray]:
    return np.empty((0, 2), dtype=np.int64), np.empty(0), np.empty((0, d))
