"""Rigid bodies that touch, and the global problem of one time step of theirs: M from masses and inertias, H from the contacts' geometry.

Units are those of the masses, lengths and times given; a body has the unknowns (velocity, angular velocity), 3 in 2D and 6 in 3D.
Held bodies have none: what they do is prescribed and enters w. Law and signs: formulation.md, "Contact problem" and the law "gap".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem


@dataclass(frozen=True, eq=False)
class Bodies:
    """Rigid bodies: centre (nb, d), mass (nb,), inertia (nb, k, k) with k = 1 in 2D and 3 in 3D, held (nb,), velocity (nb, d + k)."""

    centre: FloatArray
    mass: FloatArray
    inertia: FloatArray
    held: BoolArray
    velocity: FloatArray

    @property
    def dimension(self) -> int:
        return self.centre.shape[1]


@dataclass(frozen=True, eq=False)
class Touching:
    """Contact points (nc, d) of the bodies `first` and `second` (nc,), unit normals (nc, d) from first to second, gaps (nc,)."""

    first: IntArray
    second: IntArray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    def taken(self, index: IntArray | slice) -> Touching:
        """The contacts of that index."""
        return Touching(self.first[index], self.second[index], self.point[index], self.normal[index], self.gap[index])


def joined(*parts: Touching) -> Touching:
    """All the contacts, one list after the other."""
    fields = ("first", "second", "point", "normal", "gap")
    return Touching(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


def box_inertia(half: FloatArray, mass: FloatArray) -> FloatArray:
    """Inertia (nb, k, k) of homogeneous boxes of half sizes (nb, d): m / 3 (b^2 + c^2) about each axis."""
    squares = half**2
    total = squares.sum(axis=1)
    if half.shape[1] == 2:
        return (mass * total / 3)[:, None, None]
    return (mass[:, None] / 3 * (total[:, None] - squares))[:, :, None] * np.eye(3)


def ball_inertia(radius: FloatArray, mass: FloatArray, dimension: int) -> FloatArray:
    """Inertia (nb, k, k) of homogeneous balls, 2/5 m r^2, and of disks, 1/2 m r^2."""
    if dimension == 2:
        return (0.5 * mass * radius**2)[:, None, None]
    return (0.4 * mass * radius**2)[:, None, None] * np.eye(3)


def frames(normal: FloatArray) -> FloatArray:
    """Orthonormal right-handed frames (nc, d, d) with rows N, T1[, T2]; T1 is normal to the axis that N is farthest from."""
    if normal.shape[1] == 2:
        return np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    tangent = np.cross(normal, axis)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([normal, tangent, np.cross(normal, tangent)], axis=1)


def _motion(bodies: Bodies, touching: Touching) -> sp.csr_array:
    """The contact matrix of all bodies, held ones too, transposed: u = H^T v (m, nb (d + k))."""
    d, nc = bodies.dimension, len(touching)
    k = bodies.inertia.shape[1]
    frame = frames(touching.normal)
    blocks = []
    for body, sign in ((touching.second, 1.0), (touching.first, -1.0)):
        arm = touching.point - bodies.centre[body]
        if d == 2:  # omega x arm = omega (-y, x)
            turn = np.einsum("aij,aj->ai", frame, np.column_stack([-arm[:, 1], arm[:, 0]]))[:, :, None]
        else:  # t . (omega x arm) = omega . (arm x t)
            turn = np.cross(arm[:, None, :], frame)
        values = sign * np.concatenate([frame, turn], axis=2)
        columns = body[:, None, None] * (d + k) + np.arange(d + k)
        rows = (np.arange(nc)[:, None] * d + np.arange(d))[:, :, None]
        blocks.append((values.ravel(), np.broadcast_to(rows, values.shape).ravel(), np.broadcast_to(columns, values.shape).ravel()))
    values, rows, columns = (np.concatenate(part) for part in zip(*blocks, strict=True))
    return sp.csr_array((values, (rows, columns)), shape=(nc * d, len(bodies.mass) * (d + k)))


def assemble(bodies: Bodies, touching: Touching, mu: FloatArray, step: float, gravity: FloatArray) -> GlobalProblem:
    """One implicit step of length `step` under the acceleration `gravity` (d,): M v = H r + M v_0 + h m g, u = H^T v + w, w_N = gap / h.

    Raises InputError where no body is free or no two bodies touch.
    """
    d, k = bodies.dimension, bodies.inertia.shape[1]
    free = np.flatnonzero(~bodies.held)
    if not len(free) or not len(touching):
        raise InputError(f"assembly: expected a free body and a contact, got {len(free)} free bodies and {len(touching)} contacts")
    dofs = (free[:, None] * (d + k) + np.arange(d + k)).ravel()
    fixed = np.setdiff1d(np.arange(len(bodies.mass) * (d + k)), dofs)
    motion = _motion(bodies, touching)
    mass = np.zeros((len(free), d + k, d + k))
    mass[:, :d, :d] = bodies.mass[free, None, None] * np.eye(d)
    mass[:, d:, d:] = bodies.inertia[free]
    M = sp.bsr_array((mass, np.arange(len(free)), np.arange(len(free) + 1)), shape=(len(dofs), len(dofs)))
    pull = np.zeros((len(free), d + k))
    pull[:, :d] = step * bodies.mass[free, None] * gravity
    w = motion[:, fixed] @ bodies.velocity.ravel()[fixed]
    w[::d] += touching.gap / step
    f = M @ bodies.velocity[free].ravel() + pull.ravel()
    return GlobalProblem(sp.csc_array(M), sp.csc_array(motion[:, dofs].T), f, w, mu, dimension=d)
