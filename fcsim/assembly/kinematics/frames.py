"""Floating frames: what of a body's motion is rotation, and the elastic forces of what is left.

A turning body stands at x_i = c + R (X_i + y_i), X_i its nodes in the reference configuration relative to their centre, R the rotation of
the polar decomposition of A = sum_i w_i (x_i - c) X_i^T with the nodes' shares w_i of the volume: of all rotations the one that leaves the
least sum w_i |y_i|^2. Its energy is E = y . K y / 2 with the K of small strains, so that no rotation stresses it.

Forces are a discrete derivative of E between two configurations 0 and 1 (which may be one and the same: then they are the gradient).
With the means R_ = (R_0 + R_1) / 2 and p_ of x - c, N = R_^-1 A_ and any change dx of the nodes from 0 to 1

    y_1 - y_0 = D dx,  D dx = b - phi x q,  b = R_^T (dx - dc),  q = R_^-1 p_,  (tr N I - N) phi = sum_i w_i X_i x b_i

exactly, since R^T A is symmetric at both ends. The forces D^T f with f = K (y_0 + y_1) / 2 do exactly the work E_1 - E_0 and have no
resultant and no moment about the mean configuration: a scheme whose mean velocity is dx / h keeps momentum, angular momentum
and energy.

Sources: B. Fraeijs de Veubeke, "The dynamics of flexible bodies", Int. J. Eng. Sci. 14, 1976 (the frame); O. Gonzalez, "Time integration
and discrete Hamiltonian systems", J. Nonlinear Sci. 6, 1996 (discrete derivatives).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.forms.rotations import polar_rotation
from fcsim.assembly.groups import Group
from fcsim.brief import brief


@dataclass(frozen=True, eq=False)
class Frames:
    """Where bodies of one part stand: rotation R (nb, d, d); spread A (nb, d, d); arm x - c (nb, nn, d); strained y (nb, nn, d) [m]."""

    rotation: FloatArray
    spread: FloatArray
    arm: FloatArray
    strained: FloatArray

    __repr__ = brief


class FloatingGroup:
    """The frames of a group's bodies; displacements x and velocities v of nodes are (nb, nn, d) in world axes."""

    def __init__(self, group: Group) -> None:
        self.group = group
        weight = group.nodal_volume / group.nodal_volume.sum()
        points = group.part.points @ group.rotation.T
        self.weight = weight
        self.arm: FloatArray = points - weight @ points

    @cached_property
    def dimension(self) -> int:
        return self.arm.shape[1]

    def displacement(self, x: FloatArray) -> FloatArray:
        """The group's nodes' share (nb, nn, d) of a vector on all dofs."""
        return x[self.group.dofs].reshape(-1, *self.arm.shape)

    def frames(self, x: FloatArray) -> Frames:
        """The frames at the displacements x (nb, nn, d) of the nodes."""
        arm = self.arm + self._centred(x)
        spread = arm.transpose(0, 2, 1) @ (self.weight[:, None] * self.arm)
        R = polar_rotation(spread)
        return Frames(R, spread, arm, arm @ R - self.arm)

    def _centred(self, x: FloatArray) -> FloatArray:
        return x - (self.weight @ x)[:, None]

    def force(self, ends: tuple[Frames, Frames], share: float, damping: float, v: FloatArray | None) -> FloatArray:
        """D^T K (share y_1 + (1 - share) y_0 + damping D v) (nb, nn, d) [N] between the frames 0 and 1; damping [s]."""
        first, last = ends
        mean = _Mean(self, first, last)
        y = share * last.strained + (1 - share) * first.strained
        if damping and v is not None:
            y = y + damping * mean.strain_rate(self._centred(v))
        return mean.force(self.stress(y))

    def stress(self, y: FloatArray) -> FloatArray:
        """K y (nb, nn, d) [N] in the bodies' axes."""
        forces: FloatArray = (self.group.K @ y.reshape(len(y), -1).T).T.reshape(y.shape)
        return forces


class _Mean:
    """D and D^T between two frames, see the top of this file."""

    def __init__(self, group: FloatingGroup, first: Frames, last: Frames) -> None:
        self.group = group
        self.R = 0.5 * (first.rotation + last.rotation)
        inverse = np.linalg.inv(self.R)
        self.q = np.einsum("bij,bnj->bni", inverse, 0.5 * (first.arm + last.arm))
        N = inverse @ (0.5 * (first.spread + last.spread))
        trace = np.trace(N, axis1=1, axis2=2)[:, None, None]
        self.J = trace * np.eye(3) - N if group.dimension == 3 else trace

    def strain_rate(self, v: FloatArray) -> FloatArray:
        b = v @ self.R
        group = self.group
        phi = np.linalg.solve(self.J, _moment(group.weight[:, None] * group.arm, b)[:, :, None])[:, :, 0]
        return b - _turn(phi, self.q)

    def force(self, f: FloatArray) -> FloatArray:
        group = self.group
        tau = np.linalg.solve(self.J.transpose(0, 2, 1), _moment(self.q, f)[:, :, None])[:, :, 0]
        inner = f - group.weight[:, None] * _turn(tau, group.arm)
        return inner @ self.R.transpose(0, 2, 1)


def _moment(a: FloatArray, f: FloatArray) -> FloatArray:
    """sum_i a_i x f_i: (nb, 3), in 2D (nb, 1); a (nn, d) or (nb, nn, d), f (nb, nn, d)."""
    T = np.swapaxes(a, -1, -2) @ f
    if f.shape[-1] == 2:
        return (T[:, 0, 1] - T[:, 1, 0])[:, None]
    return np.stack([T[:, 1, 2] - T[:, 2, 1], T[:, 2, 0] - T[:, 0, 2], T[:, 0, 1] - T[:, 1, 0]], axis=1)


def _turn(phi: FloatArray, a: FloatArray) -> FloatArray:
    """phi x a_i (nb, nn, d) for phi (nb, 3 or 1) and a (nn, d) or (nb, nn, d)."""
    if a.shape[-1] == 2:
        return phi[:, :, None] * np.stack([-a[..., 1], a[..., 0]], axis=-1)
    spin = np.zeros((len(phi), 3, 3))  # a spin = phi x a
    spin[:, 0, 1], spin[:, 1, 2], spin[:, 2, 0] = phi[:, 2], phi[:, 0], phi[:, 1]
    turned: FloatArray = a @ (spin - spin.transpose(0, 2, 1))
    return turned
