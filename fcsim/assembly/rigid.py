"""Rigid bodies, all of a model at once: finite rotations, inertia in the bodies' own axes, the motion of their points.

A configuration q (nr, k) holds for each body the displacement of its centre of mass and its rotation vector, k = 6, or 3 in 2D (an
angle); a velocity (nr, k) holds v and the angular velocity omega, both in world axes. With R = exp(rotation vector) a point of the
reference configuration stands at c + R (X - C), moves with v + omega x (p - c), and the inertia in world axes is R J R^T, where J is
constant: the inertia in the body's axes, which are the world's in the reference configuration.

Source: J. C. Simo, K. K. Wong, "Unconditionally stable algorithms for rigid body dynamics that exactly preserve energy and momentum",
Int. J. Numer. Methods Eng. 31, 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.kinematics import _rigid_kernels as kernels
from fcsim.assembly.kinematics.recent import Recent
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh.part import RigidBody

_MAX_ITERATIONS = 50
_ROUND = 1e-15


class RigidBodies:
    """The arrays of rigid bodies of one dimension d, and what follows from a configuration; see the top of this file."""

    def __init__(self, bodies: Sequence[RigidBody], dimension: int) -> None:
        d = dimension
        self.dimension, self.size, self.count = d, len(DIRECTIONS[d]), len(bodies)
        self.inertia: FloatArray = np.array([body.inertia for body in bodies]).reshape(-1, self.size - d, self.size - d)
        self._mass = np.array([body.mass for body in bodies])
        points = [body.points for body in bodies]
        self._body = np.repeat(np.arange(len(points)), [len(p) for p in points])
        self._arm = np.concatenate([p - body.centre for p, body in zip(points, bodies, strict=True)]) if bodies else np.empty((0, d))
        # a step asks twenty times for three configurations
        self._exp, self._composed = Recent(kernels.rotation_matrices), Recent(kernels.composed_vectors)
        self._turned_mass = Recent(self._mass_of)

    @cached_property
    def turning(self) -> bool:
        """Whether the inertia in world axes changes with the orientation: in 3D, unless every J is a multiple of the identity."""
        scale = np.trace(self.inertia, axis1=1, axis2=2)[:, None, None] / 3
        return self.dimension == 3 and bool(np.any(np.abs(self.inertia - scale * np.eye(3)) > 1e-12 * scale))

    def rotation(self, q: FloatArray) -> FloatArray:
        """Rotation matrices R (nr, d, d)."""
        angle = q[:, self.dimension :].copy()  # in rows one after the other, of which kind alone numba compiles for
        if self.dimension == 3:
            return self._exp(angle)
        c, s = np.cos(angle[:, 0]), np.sin(angle[:, 0])
        return np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)

    def advance(self, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Return the configuration q moved by dq: translations add, rotations are composed, exp(dq) exp(q), to an angle up to pi."""
        moved = q + dq
        if self.dimension == 3 and self.count:
            moved[:, 3:] = self._composed(dq[:, 3:].copy(), q[:, 3:].copy())
        return moved

    @cached_property
    def reference_mass(self) -> FloatArray:
        """`mass` in the reference configuration."""
        d = self.dimension
        M = np.zeros((self.count, self.size, self.size))
        M[:, range(d), range(d)] = self._mass[:, None]
        M[:, d:, d:] = self.inertia
        M.setflags(write=False)
        return M

    def mass(self, q: FloatArray) -> FloatArray:
        """M = diag(m I, R J R^T) (nr, k, k), read-only; one and the same array for all q where no inertia is `turning`."""
        return self._turned_mass(self.rotation(q)) if self.turning else self.reference_mass

    def _mass_of(self, R: FloatArray) -> FloatArray:
        M = self.reference_mass.copy()
        M[:, 3:, 3:] = R @ self.inertia @ R.transpose(0, 2, 1)
        return M

    def free_end_mass(self, middle: FloatArray, momentum: FloatArray, velocity: FloatArray, dt: float, free: BoolArray) -> FloatArray:
        """`mass` after a last rotation exp(dt omega) from the configuration `middle` by which each body has its angular momentum.

        R = exp(dt omega) R_m with R J R^T omega = momentum (nr, 3) [N m s]: implicit in omega, solved for all bodies at once in their
        own axes. A body of whose rotations only some are `free` (nr, 3) turns by dt `velocity` (nr, 3) instead.
        """
        if not self.turning:
            return self.reference_mass
        R, J = self.rotation(middle), self.inertia
        held = ~free.all(axis=1)
        P = np.einsum("aji,aj->ai", R, momentum)
        W = np.linalg.solve(J, P[:, :, None])[:, :, 0]
        for _ in range(_MAX_ITERATIONS):  # J W = y(W) = exp(-dt W) P; its derivative is about dt y x, exact to first order in dt W
            y = np.einsum("aij,aj->ai", kernels.rotation_matrices(-dt * W), P)
            step = np.linalg.solve(J - dt * _cross(y), (y - np.einsum("aij,aj->ai", J, W))[:, :, None])[:, :, 0]
            W = W + step
            if np.all(np.abs(step[~held]) <= _ROUND * np.abs(W[~held]).max(initial=0.0)):
                break
        omega = np.where(held[:, None], velocity, np.einsum("aij,aj->ai", R, W))
        return self._mass_of(kernels.rotation_matrices(dt * omega) @ R)

    def displacement(self, q: FloatArray) -> FloatArray:
        """Displacement (np, d) [m] of the points of all bodies, one body after the other."""
        return q[self._body, : self.dimension] + self._turned_arms(q) - self._arm

    def points(self, q: FloatArray) -> tuple[IntArray, FloatArray]:
        """The body (np,) of each point and p - c (np, d) [m] in the configuration q."""
        return self._body, self._turned_arms(q)

    def _turned_arms(self, q: FloatArray) -> FloatArray:
        """p - c (np, d) [m] of the points of all bodies."""
        turned: FloatArray = kernels.turned_arms(self.rotation(q), self._body, self._arm)
        return turned

    def velocity(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Velocities v + omega x (p - c) (np, d) [m/s] of the points of all bodies for v (nr, k) in the configuration q."""
        velocities: FloatArray = kernels.point_velocities(np.ascontiguousarray(v), self._body, self._turned_arms(q))
        return velocities

    def on_bodies(self, q: FloatArray, nodal: sp.csc_array, split: int) -> sp.csc_array:
        """B^T G (split + k nr, m) of a nodal matrix G (split + d np, m): rows from `split` on, forces g at points, become forces and
        moments (g, (p - c) x g) on the bodies in the configuration q."""
        k, points = self.size, (split, self.dimension, self._body, self.count)
        ordered = bool(nodal.has_sorted_indices)
        elastic, bodies = kernels.bodies_of_columns(nodal.indptr, nodal.indices, ordered, *points)
        starts = np.concatenate([[0], np.cumsum(elastic + k * bodies)])
        index = np.int32 if starts[-1] < np.iinfo(np.int32).max else np.int64
        rows, values = np.empty(starts[-1], dtype=index), np.empty(starts[-1])
        columns = nodal.indptr, nodal.indices, nodal.data
        kernels.on_bodies(*columns, split, self._body, self._turned_arms(q), k, self.count, elastic, starts, rows, values)
        H = sp.csc_array((values, rows, starts.astype(index)), shape=(split + k * self.count, nodal.shape[1]))
        if nodal.has_canonical_format:  # points of a body stand together, bodies in their order
            H.has_canonical_format = True
        return H


def _cross(a: FloatArray) -> FloatArray:
    """The matrices (n, 3, 3) of a x."""
    A = np.zeros((len(a), 3, 3))
    A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    return A - A.transpose(0, 2, 1)


def inverse_on(free: BoolArray, matrices: FloatArray) -> FloatArray:
    """Inverses (n, k, k) of the matrices' rows and columns that are `free` (n, k); zero elsewhere."""
    outer = free[:, :, None] & free[:, None, :]
    held = np.zeros_like(matrices)
    k = matrices.shape[-1]
    held[:, range(k), range(k)] = ~free
    return np.where(outer, np.linalg.inv(np.where(outer, matrices, held)), 0.0)


def turned_matrices(axes: FloatArray | None, matrices: FloatArray) -> FloatArray:
    """A B A^T (n, k, k) of each matrix B and the axes A (n, k, k), its rows; the matrices themselves where axes is None."""
    return matrices if axes is None else axes @ matrices @ axes.transpose(0, 2, 1)
