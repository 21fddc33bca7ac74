"""The bodies of exact shape of a model: where their cores stand, and the weights by which their points move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.mesh.exact_shape import ShapeKind, across
from fcsim.mesh.part import RigidBody

_BENT = 1e-12  # of 1: frames nearer to rotations stay as they are


class Solids(NamedTuple):
    """ns bodies of exact shape: body (ns,) numbers; node (ns, d + 1); kind (ns,); radius, half (ns,) [m] of the core; axis (ns, d) and
    arm (ns,) [m], the distance of the nodes from the centre, in the reference configuration."""

    body: IntArray
    node: IntArray
    kind: tuple[ShapeKind, ...]
    radius: FloatArray
    half: FloatArray
    axis: FloatArray
    arm: FloatArray

    def of(self, *kinds: ShapeKind) -> IntArray:
        """Numbers of the solids of these kinds."""
        return np.flatnonzero([kind in kinds for kind in self.kind])

    def swung(self, moved: FloatArray) -> FloatArray:
        """How far (ns,) [m] the ends of capsules and cylinders go beside their middles, by the nodes' motions (n_nodes, d) [m]; else 0."""
        moves = moved[self.node]
        turned = np.linalg.norm(np.einsum("nij,ni->nj", moves[:, 1:] - moves[:, :1], self.axis), axis=1) / self.arm
        flat = np.isin(np.arange(len(self.kind)), self.of("cylinder"))
        far: FloatArray = turned * (self.half + np.where(flat, self.radius, 0.0))
        return far


class Placed(NamedTuple):
    """Solids at positions: centre (ns, d), frame (ns, d, d) columns: the body's axes, along (ns, d): the core's direction."""

    solids: Solids
    centre: FloatArray
    frame: FloatArray
    along: FloatArray

    def core(self, chosen: IntArray, share: FloatArray | float) -> FloatArray:
        """Points of the cores of the chosen solids, share from -1 to 1 along them."""
        return self.centre[chosen] + (share * self.solids.half[chosen])[:, None] * self.along[chosen]

    def weights(self, chosen: IntArray, points: FloatArray) -> FloatArray:
        """Weights (n, d + 1) of the nodes of the chosen solids at points (n, d) [m] that move with them; each row sums to 1."""
        local = np.einsum("nij,ni->nj", self.frame[chosen], points - self.centre[chosen]) / self.solids.arm[chosen][:, None]
        return np.column_stack([1.0 - local.sum(axis=1), local])


def solids_of(model: Model) -> Solids:
    """Return the model's bodies of exact shape; there may be none."""
    d = model.dimension
    found = [(k, body) for k, body in enumerate(model.bodies) if isinstance(body, RigidBody) and body.shape is not None]
    shapes = [body.shape for _, body in found if body.shape is not None]
    number = np.array([k for k, _ in found], dtype=np.int64)
    return Solids(
        body=number,
        node=model.node_offset[number][:, None] + np.arange(d + 1),
        kind=tuple(shape.kind for shape in shapes),
        radius=np.array([0.0 if shape.kind == "plane" else shape.radius for shape in shapes]),
        half=np.array([shape.length / 2 for shape in shapes]),
        axis=np.array([shape.axis for shape in shapes]).reshape(-1, d),
        arm=np.array([shape.radius for shape in shapes]),
    )


def placed(solids: Solids, positions: FloatArray) -> Placed:
    """Return the solids at the nodes' positions (n_nodes, d) [m]."""
    nodes = positions[solids.node]
    centre = nodes[:, 0]
    frame = ((nodes[:, 1:] - centre[:, None]) / solids.arm[:, None, None]).transpose(0, 2, 1)
    return Placed(solids, centre, frame, np.einsum("nij,nj->ni", frame, solids.axis))


def placed_on_the_way(solids: Solids, positions: FloatArray) -> Placed:
    """`placed` at nodes' positions (n_nodes, d) [m] on the straight way of a step, with frames that are rotations, F = Q S to Q (polar).

    On straight ways a body that turns by an angle shrinks across its axis to the cosine of half of it: a capsule of 1 m that turns by half
    a radian would end 15 mm short, its direction would be no unit vector and its gaps wrong by as much. Balls look the same in any frame.
    """
    now = placed(solids, positions)
    gram = np.einsum("nji,njk->nik", now.frame, now.frame)
    bent = np.abs(gram - np.eye(now.frame.shape[1])).max(axis=(1, 2), initial=0.0) > _BENT
    bent[solids.of("sphere")] = False
    if not bent.any():
        return now
    left, _, right = np.linalg.svd(now.frame[bent])
    now.frame[bent] = left @ right
    now.along[bent] = np.einsum("nij,nj->ni", now.frame[bent], solids.axis[bent])
    return now


def rim_points(now: Placed, solid: IntArray, end: FloatArray | float, normal: FloatArray) -> FloatArray:
    """Three points (n, 3, 3) of the rims of cylinders at an end (-1 or 1), a third of the circle apart, the lowest first."""
    axis = now.along[solid]
    down = np.einsum("nd,nd->n", normal, axis)[:, None] * axis - normal
    steep = np.linalg.norm(down, axis=1)
    first = np.where(steep[:, None] > 1e-9, down / np.maximum(steep, 1e-300)[:, None], across(axis)[0])
    second = np.cross(axis, first)
    angle = 2 * np.pi * np.arange(3) / 3
    out = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
    return now.core(solid, end)[:, None] + now.solids.radius[solid][:, None, None] * out


class Touch(NamedTuple):
    """Contacts before they have mu and frames, n of them: normal (n, d) from the master to the slave; points (n, d) of both; nodes and
    weights (n, k) of both, -1 = none; bodies (n, 2) slave, master; identity (n,)."""

    normal: FloatArray
    slave_point: FloatArray
    master_point: FloatArray
    slave_node: IntArray
    slave_weights: FloatArray
    master_node: IntArray
    master_weights: FloatArray
    bodies: IntArray
    identity: IntArray

    def take(self, chosen: BoolArray | IntArray) -> Touch:
        return Touch._make(array[chosen] for array in self)

    @property
    def gap(self) -> FloatArray:
        return np.einsum("nd,nd->n", self.slave_point - self.master_point, self.normal)


def leaves_by_its_side(now: Placed, solid: IntArray, along: FloatArray, gap: FloatArray) -> BoolArray:
    """Whether what is `along` (n,) [m] the axes from the centres, with this gap to the sides, leaves cylinders by these, not by an end."""
    flat = np.isin(solid, now.solids.of("cylinder"))
    return ~flat | (-gap <= np.maximum(now.solids.half[solid] - np.abs(along), 0.0)) | (gap > 0)


def round_points(touch: Touch, there: Placed, begin: Placed) -> Touch:
    """Contacts met on the way, `there`, with the weights of the points that touched in the same place of the solids where they stood at the
    `begin`.

    What is round rolls: the point at which it will touch is another one of its skin each time, always that along the normal. The point that
    touches then comes down along a cycloid from where it is now, and to the law 0 <= g + h u_N, which takes its motion for straight, it
    would seem to come by R (omega h)^2 / 2 too far.
    """
    if not len(touch.bodies):
        return touch
    solid = np.full(int(max(touch.bodies.max(initial=0), there.solids.body.max(initial=0))) + 1, -1)
    solid[there.solids.body] = np.arange(len(there.solids.body))
    weights = []
    for side, node, own, point in (
        (0, touch.slave_node, touch.slave_weights, touch.slave_point),
        (1, touch.master_node, touch.master_weights, touch.master_point),
    ):
        k = solid[touch.bodies[:, side]]
        curved = np.flatnonzero(np.isin(k, there.solids.of("sphere", "capsule", "cylinder")))
        if not len(curved) or node.shape[1] != there.solids.node.shape[1]:
            weights.append(own)
            continue
        k = k[curved]
        arm = point[curved] - there.centre[k]
        axial = np.where(np.isin(k, there.solids.of("sphere")), 0.0, np.einsum("nd,nd->n", arm, there.along[k]))[:, None]
        place = begin.centre[k] + axial * begin.along[k] + arm - axial * there.along[k]
        own = own.copy()
        own[curved] = begin.weights(k, place)
        weights.append(own)
    return touch._replace(slave_weights=weights[0], master_weights=weights[1])


def no_touch(now: Placed, slave: int, master: int) -> Touch:
    """No contacts, of so many nodes on either side: what is found where no solid is of the kind, without a look at anything."""
    d = now.centre.shape[1]
    vectors, nodes = np.empty((0, d)), [np.empty((0, k), dtype=np.int64) for k in (slave, master)]
    bodies = np.empty((0, 2), dtype=np.int64)
    weights = [np.empty((0, k)) for k in (slave, master)]
    return Touch(vectors, vectors, vectors, nodes[0], weights[0], nodes[1], weights[1], bodies, np.empty(0, dtype=np.int64))


def joined(parts: Sequence[Touch]) -> Touch:
    """Contacts one after the other."""
    return Touch._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def touch_of_solids(
    now: Placed, slave: IntArray, master: IntArray, normal: FloatArray, slave_point: FloatArray, master_point: FloatArray, code: IntArray
) -> Touch:
    """Contacts between solids at these points; code (n,): number of the contact within the pair, below 8."""
    s = now.solids
    bodies = np.stack([s.body[slave], s.body[master]], axis=1)
    count = int(s.body.max(initial=0)) + 1
    return Touch(
        normal,
        slave_point,
        master_point,
        s.node[slave],
        now.weights(slave, slave_point),
        s.node[master],
        now.weights(master, master_point),
        bodies,
        8 * (s.body[slave] * count + s.body[master]) + code,
    )
