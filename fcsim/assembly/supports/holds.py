"""What each support holds: directions of nodes or of a rigid body's centre and rotation, and how they move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fcsim.arrays import FloatArray, IntArray, numbers_of
from fcsim.assembly.layout import DIRECTIONS, BodyLayout
from fcsim.assembly.supports.selection import Selection
from fcsim.assembly.supports.support import DrivenRotation, Support
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.part import RigidBody


@dataclass(frozen=True, eq=False)
class Hold:
    """One support's directions of groups of s dofs that belong together: nodes, or a rigid body's centre or rotation.

    number of the support; first (k,) ascending, the groups' first dofs; rows (r, s) unit vectors in world axes: the directions
    """

    number: int
    source: Support
    first: IntArray
    rows: FloatArray

    def velocity(self, t: float, h: float) -> FloatArray:
        """(r,) [m/s, rad/s] at time t, the same for all groups."""
        return np.full(len(self.rows), self.source.speed(t, h))

    def increment(self, t: float, h: float) -> FloatArray:
        """(r,) [m, rad] of the step from t: the velocity at its middle times h, exact for linear ramps; a displacement's own."""
        if self.source.displacement is not None:
            return np.full(len(self.rows), self.source.way(t + h) - self.source.way(t))
        return h * self.velocity(t + 0.5 * h, h)


@dataclass(frozen=True, eq=False)
class Turn:
    """A driven rotation of nodes, or of a rigid body's centre (turns None) or rotation; all directions are held, as in `Hold`.

    arm (k, s) [m] from the axis' point in the reference configuration; axis (3,), unused in 2D; spin: of a rigid body's rotation, which has
    no arm: its vector is the angle times this (s,)
    """

    number: int
    source: DrivenRotation
    first: IntArray
    rows: FloatArray
    arm: FloatArray
    axis: FloatArray
    spin: FloatArray | None = None

    def velocity(self, t: float, h: float) -> FloatArray:
        """(k, r) [m/s, rad/s] at time t: omega x (p - c) where the nodes stand then."""
        speed = self.source.speed(t, h)
        if self.spin is not None:
            return speed * self.spin
        return speed * self._across(self.arm + self.displacement(t))

    def increment(self, t: float, h: float) -> FloatArray:
        """(k, r) [m, rad] from t to t + h, exact."""
        if self.spin is not None:
            return (self.source.turned(t + h) - self.source.turned(t)) * self.spin
        return self.displacement(t + h) - self.displacement(t)

    def displacement(self, t: float) -> FloatArray:
        """(k, s) [m, rad] at time t from the reference configuration; a rotation vector in 3D is at most pi long."""
        angle = self.source.turned(t)
        if self.spin is not None:
            turned = angle * self.spin
            return np.asarray(turned if len(turned) == 1 else Rotation.from_rotvec(turned).as_rotvec())[None]
        across = self._across(self.arm)
        return np.sin(angle) * across + 2 * np.sin(0.5 * angle) ** 2 * self._across(across)  # Rodrigues' formula

    def _across(self, a: FloatArray) -> FloatArray:
        """axis x a (k, s)."""
        if a.shape[1] == 2:
            return np.stack([-a[:, 1], a[:, 0]], axis=1)
        return np.cross(self.axis, a)


def holds_of(layout: BodyLayout, supports: Sequence[Support | DrivenRotation]) -> list[Hold | Turn]:
    """Return what the supports hold, in their order; InputError for unknown bodies, surfaces, directions and axes that do not fit."""
    holds: list[Hold | Turn] = []
    for number, support in enumerate(supports):
        if isinstance(support, DrivenRotation):
            holds += _turns(layout, number, support)
        elif isinstance(support, Support):
            holds += _holds(layout, number, support)
        else:
            raise InputError(f"supports: expected Support or DrivenRotation, got {support!r}")
    return holds


def _holds(layout: BodyLayout, number: int, support: Support) -> list[Hold | Turn]:
    d = layout.dimension
    body = layout.bodies[layout.body_number(support.body)]
    known = DIRECTIONS[d] if isinstance(body, RigidBody) else DIRECTIONS[d][:d]
    named = support.directions if isinstance(support.directions, tuple | list | str) else ()
    if not named or (wrong := [direction for direction in named if direction not in known]):
        got = shown(wrong[0] if named and len(named) > 1 and not isinstance(named, str) else support.directions)
        raise InputError(f"support of body {support.body!r}: expected directions among {', '.join(known)}, got {got}")
    axes = np.eye(d) if support.axes is None else np.array(support.axes)
    if axes.shape != (d, d):
        raise InputError(f"support of body {support.body!r}, axes: expected a rotation matrix ({d}, {d}), got {axes.shape}")
    component = np.unique([known.index(direction) for direction in named])
    along, about = component[component < d], component[component >= d] - d
    first = _groups(layout, support.body, support.selection, f"support of body {support.body!r}")
    holds: list[Hold | Turn] = []
    if len(along):
        holds.append(Hold(number, support, first, axes.T[along]))
    if len(about):
        holds.append(Hold(number, support, first + d, axes.T[about] if d == 3 else np.ones((1, 1))))
    return holds


def _turns(layout: BodyLayout, number: int, support: DrivenRotation) -> list[Hold | Turn]:
    d, what = layout.dimension, f"driven rotation of body {support.body!r}"
    body_number = layout.body_number(support.body)
    body = layout.bodies[body_number]
    if not callable(support.angle) or not (support.rate is None or callable(support.rate)):
        raise InputError(f"{what}: expected functions of time for the angle and its rate, got {support.angle!r} and {support.rate!r}")
    point = _numbers(support.point, d, f"{what}, point")
    axis = np.zeros(3)
    if d == 2 and support.axis is not None:
        raise InputError(f"{what}, axis: expected None in 2D, where rotations are in the plane, got {support.axis!r}")
    if d == 3:
        axis = _numbers(support.axis, 3, f"{what}, axis")
        if not np.any(axis):
            raise InputError(f"{what}, axis: expected a direction, got {support.axis!r}")
        axis = axis / np.linalg.norm(axis)
    first = _groups(layout, support.body, support.selection, what)
    if isinstance(body, RigidBody):
        spin = axis if d == 3 else np.ones(1)
        centre = Turn(number, support, first, np.eye(d), (body.centre - point)[None], axis)
        return [centre, Turn(number, support, first + d, np.eye(len(spin)), np.zeros((1, len(spin))), axis, spin)]
    nodes = (first - layout.dof_offset[body_number]) // d
    return [Turn(number, support, first, np.eye(d), body.points[nodes] - point, axis)]


def _groups(layout: BodyLayout, name: str, selection: Selection, what: str) -> IntArray:
    """The first dofs (k,) of the nodes that are meant of a body, or of a rigid body."""
    number = layout.body_number(name)
    begin = layout.dof_offset[number]
    if isinstance(layout.bodies[number], RigidBody) and selection.whole:
        return np.array([begin])
    return np.asarray(begin + layout.dimension * selection.of(layout, name, what))


def _numbers(given: object, count: int, what: str) -> FloatArray:
    values = numbers_of(given)
    if values.shape != (count,) or not np.all(np.isfinite(values)):
        raise InputError(f"{what}: expected {count} finite numbers, got {shown(given)}")
    return values
