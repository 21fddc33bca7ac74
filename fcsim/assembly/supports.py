"""Supports: which degrees of freedom are held or driven, and how fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import IntArray
from fcsim.assembly.layout import DIRECTIONS, BodyLayout
from fcsim.errors import InputError
from fcsim.mesh.part import RigidBody

TimeFunction = Callable[[float], float]


@dataclass(frozen=True)
class Support:
    """Holds or drives degrees of freedom of one body.

    directions of x, y, z; of a rigid body also rx, ry, rz (2D: x, y, rz)
    surface    name of the surface whose nodes are meant; None = all nodes of the body, or the rigid body itself
    velocity   [m/s] or [rad/s], a number or a function of the time t [s]; 0 holds
    """

    body: str
    directions: tuple[str, ...]
    surface: str | None = None
    velocity: float | TimeFunction = 0.0


def support_dofs(layout: BodyLayout, support: Support) -> IntArray:
    """The dofs that a support drives."""
    number = layout.body_number(support.body)
    body = layout.bodies[number]
    known = DIRECTIONS[layout.dimension] if isinstance(body, RigidBody) else DIRECTIONS[layout.dimension][: layout.dimension]
    unknown = [direction for direction in support.directions if direction not in known]
    if unknown or not support.directions:
        raise InputError(f"support of body {support.body!r}: expected directions among {', '.join(known)}, got {support.directions}")
    component = np.array([known.index(direction) for direction in support.directions])
    first = layout.dof_offset[number]
    if isinstance(body, RigidBody):
        if support.surface is not None:
            raise InputError(f"support of rigid body {support.body!r}: expected no surface, got {support.surface!r}")
        return first + component
    nodes = np.arange(len(body.part.points)) if support.surface is None else None
    if nodes is None:
        nodes = np.unique(layout.facets(support.body, str(support.surface))) - layout.node_offset[number]
    return (first + nodes[:, None] * layout.dimension + component).ravel()


def support_velocity(support: Support, t: float) -> float:
    value = support.velocity(t) if callable(support.velocity) else support.velocity
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise InputError(f"support of body {support.body!r} at t = {t} s: expected a velocity that is a finite number, got {value!r}")
    return number


def refuse_contradictions(supports: Sequence[Support], dofs: IntArray, support: IntArray) -> None:
    """A dof may be named by two supports only if both say the same; dofs, and the number of the support that drives each."""
    order = np.argsort(dofs, kind="stable")
    twice = np.flatnonzero(np.diff(dofs[order]) == 0)
    for k in twice:
        first, second = (supports[support[order[k + i]]] for i in (0, 1))
        if first.velocity is not second.velocity and first.velocity != second.velocity:
            raise InputError(
                f"supports: degree of freedom {int(dofs[order[k]])} of body {second.body!r} is driven twice and differently, by the "
                f"supports {supports.index(first)} and {supports.index(second)}"
            )
