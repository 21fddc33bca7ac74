"""What a user says of supports: held or driven directions along any axes, and rotations about an axis by any angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import is_number, numbers_of
from fcsim.assembly.supports.selection import NodesNamed, Selection, SurfaceNames
from fcsim.brief import shown
from fcsim.errors import InputError, asked
from fcsim.mesh.named.places import Where

TimeFunction = Callable[[float], float]

RATE_SPAN = 1e-3
"""Of a step: half the span of the central difference by which an angle's rate is known where it is not given."""


@dataclass(frozen=True)
class Support:
    """Holds or drives degrees of freedom of one body.

    directions of x, y, z; of a rigid body also rx, ry, rz (2D: x, y, rz)
    surface    name of the surface whose nodes are meant, or several: the edge or corner that they share, ("x-", "z-")
    at         a point (x, y, z), several, or a function of the coordinates, lambda x: numpy.isclose(x[0], 0), in the reference
    nodes      the name of points or a line of the part, or numbers of its nodes; see `Selection`. Of these three, several mean the nodes
               that all of them name; none means all nodes of the body, or the rigid body itself
    velocity   [m/s] or [rad/s], a number or a function of the time t [s]; 0 holds. It is that of EVERY direction named: ("x", "y") with
               0.1 moves along the diagonal. To move x and hold y: two supports, Support(b, ("x",), velocity=0.1), Support(b, ("y",))
    displacement  [m] or [rad], in place of a velocity: a function of the time, 0 where the run begins (a `Table` of a test's record, a
               triangle wave); increments are its exact differences, velocities its central differences over 1/500 of a step
    axes       (d, d) rotation matrix whose columns are the axes that x, y, z (and rx, ry, rz) mean: a roller on a slope, or
               `body.rotation` for the own axes of a body that is placed by a rotation; None = the world's. They stay as they are in space

    Several supports may name one node along different axes: what they hold together is held, and where they say more than a node has
    directions they must agree.
    """

    body: str
    directions: tuple[str, ...]
    surface: SurfaceNames | None = None
    velocity: float | TimeFunction = 0.0
    axes: ArrayLike | None = None
    at: ArrayLike | Where | None = field(default=None, kw_only=True)
    nodes: NodesNamed | None = field(default=None, kw_only=True)
    displacement: TimeFunction | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        what = f"support of body {self.body!r}"
        _keep_comparable(self)
        if self.displacement is not None and (not callable(self.displacement) or callable(self.velocity) or self.velocity != 0):
            raise InputError(
                f"{what}: expected a velocity or a displacement, a function of the time, got {self.velocity!r} and {self.displacement!r}"
            )
        if self.axes is not None:
            object.__setattr__(self, "axes", _rotation(self.axes, f"support of body {self.body!r}, axes"))

    @property
    def selection(self) -> Selection:
        """Which nodes are meant."""
        return Selection(self.surface, self.at, self.nodes)

    def speed(self, t: float, h: float = 1e-3) -> float:
        """The velocity [m/s, rad/s] of each direction at t [s] in steps of h [s]; InputError where it is none."""
        if self.displacement is not None:
            before, after = t - RATE_SPAN * h, t + RATE_SPAN * h
            return (self.way(after) - self.way(before)) / (after - before)
        return finite(self.velocity, t, f"support of body {self.body!r}", "a velocity")

    def way(self, t: float) -> float:
        """The displacement [m, rad] of each direction at t [s], where that is given."""
        assert self.displacement is not None
        return finite(self.displacement, t, f"support of body {self.body!r}", "a displacement")


@dataclass(frozen=True)
class DrivenRotation:
    """Turns a rigid body, a deformable body's surface or a whole deformable body about an axis by the angle `angle`(t) [rad], of any size.

    point     (d,) [m] on the axis; axis (3,) its direction, about which turning is positive as the right hand says; 2D: None, out of the
              plane. What is turned is held in all its degrees of freedom: at the end of each step it stands where the angle says, from the
              reference configuration on, and at the start the angle must be 0
    surface, at, nodes   which nodes are turned, as those of `Support`; None = the whole body
    rate      its derivative(t) [rad/s]; None = by central differences over 1/500 of a step
    """

    body: str
    angle: TimeFunction
    point: tuple[float, ...]
    axis: tuple[float, ...] | None = None
    surface: SurfaceNames | None = None
    rate: TimeFunction | None = None
    at: ArrayLike | Where | None = field(default=None, kw_only=True)
    nodes: NodesNamed | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        _keep_comparable(self)

    @property
    def selection(self) -> Selection:
        """Which nodes are meant."""
        return Selection(self.surface, self.at, self.nodes)

    def turned(self, t: float) -> float:
        """The angle [rad] at t [s]; InputError where it is none."""
        return finite(self.angle, t, f"driven rotation of body {self.body!r}", "an angle")

    def speed(self, t: float, h: float) -> float:
        """The rate [rad/s] at t [s] in steps of h [s]."""
        if self.rate is not None:
            return finite(self.rate, t, f"driven rotation of body {self.body!r}", "an angular velocity")
        before, after = t - RATE_SPAN * h, t + RATE_SPAN * h
        return (self.turned(after) - self.turned(before)) / (after - before)


def _keep_comparable(support: Support | DrivenRotation) -> None:
    """Lists and arrays as tuples: supports are compared."""
    for key in ("surface", "at", "nodes"):
        given = getattr(support, key)
        if isinstance(given, list | np.ndarray):
            listed = np.asarray(given).tolist()
            object.__setattr__(support, key, tuple(tuple(row) if isinstance(row, list) else row for row in listed))


def finite(value: float | TimeFunction, t: float, what: str, expected: str) -> float:
    """The value at time t, a number or a function of it; InputError where it is not a finite number."""
    given: object = asked(f"{what} at t = {t} s, {expected}", value, t) if callable(value) else value
    if isinstance(given, np.ndarray) and given.size == 1:
        given = given.item()
    if not is_number(given):
        raise InputError(f"{what} at t = {t} s: expected {expected} that is a finite number, got {shown(given)}")
    return float(given)


def _rotation(axes: object, what: str) -> tuple[tuple[float, ...], ...]:
    R = numbers_of(axes)
    d = len(R) if R.ndim else 0
    if R.shape not in ((2, 2), (3, 3)) or not np.all(np.isfinite(R)):
        raise InputError(f"{what}: expected a rotation matrix (d, d) of finite numbers, got {shown(axes)}")
    if not np.allclose(R.T @ R, np.eye(d), rtol=0, atol=1e-10) or np.linalg.det(R) < 0:
        raise InputError(f"{what}: expected a rotation matrix (orthogonal, determinant +1), got {R.tolist()}")
    return tuple(map(tuple, R.tolist()))
