"""The inner forces of nonlinear bodies in a step's equation: w F(x(v)), and their share of the system matrix, w dF/dv."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State


@dataclass(frozen=True, eq=False)
class Term:
    """At an iterate: force (n_dofs,) = w F; blocks of each group (nb, nblocks, d, d) = w dF/dv, () where not asked for; inadmissible:
    name of
    a body whose points have no admissible state there, "" = none."""

    force: FloatArray
    blocks: tuple[FloatArray, ...]
    inadmissible: str = ""


@dataclass(frozen=True, eq=False)
class InnerTerm:
    """The term of one step of a scheme from a state."""

    scheme: Scheme
    model: Model
    state: State

    def first(self) -> FloatArray:
        """The first iterate (n_dofs,): in statics no motion; else the velocity before, of bodies that turn so changed that their way over
        the step
        follows the rotation. On a straight way they would be stretched by half the square of the angle, which stiff or plastic bodies
        answer
        out of proportion."""
        scheme, model, state = self.scheme, self.model, self.state
        if not scheme.timing.moving:
            return np.zeros(model.n_dofs)
        h, d, v = scheme.h, model.dimension, state.v
        change = np.zeros_like(v)
        for group in model.nonlinear.groups:
            if not group.rotates:
                continue
            shape, weight = (len(group.members), -1, d), group.nodal_volume / group.nodal_volume.sum()
            rate = state.v[group.dofs].reshape(shape)
            arm = model.reference.ravel()[group.dofs].reshape(shape) + state.x[group.dofs].reshape(shape)
            arm, rate = arm - (weight @ arm)[:, None], rate - (weight @ rate)[:, None]
            omega = _spin(weight, arm, rate)
            turned = Rotation.from_rotvec(h * omega).as_matrix()[:, :d, :d]
            rigid = np.cross(omega[:, None], _three(arm))[..., :d]
            change[group.dofs] = (arm @ turned.transpose(0, 2, 1) - arm - h * rigid).reshape(len(group.members), -1)
        share = scheme.elastic_time / h
        return v + share * change / scheme.elastic_reach

    def at(self, v: FloatArray, tangent: bool = False, earlier: FloatArray | None = None) -> Term:
        """The term at the iterate v (n_dofs,); earlier: the iterate before, from whose tangent that of v is to foresee its stresses
        (statics: forces of the step's end)."""
        scheme, state = self.scheme, self.state
        first, last = scheme.elastic_path(self.model, state, v)
        x = first + scheme.elastic_share * (last - first)
        dt, weight = scheme.elastic_time, scheme.elastic_weight
        damped = scheme.damping_velocity(self.model, state, v) if self.model.beta else None
        rate = scheme.damping_reach / scheme.elastic_reach
        start = state.x, dt / scheme.h
        begun = None if earlier is None else scheme.elastic_path(self.model, state, earlier)[1]
        inner = self.model.nonlinear.inner(
            x, state.internal, state.t + dt, dt, v=damped, rate=rate, start=start, tangent=tangent, earlier=begun
        )
        bad = "" if inner.admissible else self.model.deformable[inner.inadmissible].name
        factor = weight * scheme.elastic_reach
        return Term(weight * inner.force, tuple(factor * blocks for blocks in inner.blocks), bad)


def _three(a: FloatArray) -> FloatArray:
    """(..., 3) of vectors (..., d)."""
    return a if a.shape[-1] == 3 else np.concatenate([a, np.zeros((*a.shape[:-1], 1))], axis=-1)


def _spin(weight: FloatArray, arm: FloatArray, rate: FloatArray) -> FloatArray:
    """Angular velocities (nb, 3) of bodies with nodes at arm (nb, nn, d) from their centres, that have the moment of the velocities
    `rate`."""
    r = _three(arm)
    moment = np.einsum("n,bni->bi", weight, np.cross(r, _three(rate)))
    spread = np.einsum("n,bni,bnj->bij", weight, r, r)
    inertia = np.trace(spread, axis1=1, axis2=2)[:, None, None] * np.eye(3) - spread
    omega: FloatArray = np.linalg.solve(inertia, moment[..., None])[..., 0]
    return omega


def stiffened(base: SystemFactor, blocks: tuple[FloatArray, ...], body: int, factor: float, held: float = 0.0) -> tuple[FloatArray, ...]:
    """The blocks with a share of the first stiffness added to one body's, and its mass times `held` [1/s^2]."""
    changed = []
    for group, own in zip(base.nonlinear_groups, blocks, strict=True):
        own, of_body = own.copy(), group.members == body
        if factor:
            own[of_body] += factor * group.first_stiffness
        if held:
            own[of_body] += held * group.mass
        changed.append(own)
    return tuple(changed)
